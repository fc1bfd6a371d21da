# SPDX-License-Identifier: BSD-3-Clause
"""HTTP itself: what libmicrohttpd gets wrong or leaves to us, request by request."""
import contextlib
import http.client
import json
import os
import re
import resource
import shutil
import signal
import socket
import subprocess
import sys
import time

from served import PATIENCE, ROOT, SCRATCH, SLOW, TETLOD, Server, answers, eventually, free_port, run, statuses

FOLDER = os.path.join(SCRATCH, 'streams')
os.makedirs(FOLDER, exist_ok=True)
HOST = b'Host: localhost\r\n'
server = None


def ask(line, headers=b'', host=HOST):
    return server.raw(line + b'\r\n' + host + headers + b'Connection: close\r\n\r\n')


def one(received):
    found = statuses(received)
    assert len(found) == 1, received
    return found[0]


def problem(path, status, **headers):
    got, head, body = server.get(path, **headers)
    assert got == status, (path, got, body)
    assert head['content-type'] == 'application/problem+json', head
    value = json.loads(body)
    assert value['status'] == status and value['title'] and value['detail'], value
    return head, value


def test_health():
    assert server.get('/healthz')[0] == 200
    status, head, body = server.get('/readyz')
    assert status == 200 and json.loads(body)['status'] == 'ready'
    assert head['cache-control'] == 'no-store'


def test_common_headers():
    for path in ('/healthz', '/v1/meshes', '/nothing'):
        _, head, _ = server.get(path, Origin='http://elsewhere')
        assert head['x-request-id'] and head['server'] == 'tetlod'


def test_request_id():
    assert server.get('/healthz', X_Request_Id='abc-1')[1]['x-request-id'] == 'abc-1'
    given = server.get('/healthz', X_Request_Id='a b"{')[1]['x-request-id']
    assert given and given != 'a b"{'
    assert server.get('/healthz')[1]['x-request-id'] != server.get('/healthz')[1]['x-request-id']


def test_options():
    status, head, body = server.get('/v1/meshes', 'OPTIONS', Origin='http://x', Access_Control_Request_Method='GET',
                                    Access_Control_Request_Headers='range')
    assert status == 204 and body == b''
    assert head['allow'] == 'GET, HEAD, OPTIONS'
    assert 'content-length' not in head and 'transfer-encoding' not in head
    assert one(ask(b'OPTIONS * HTTP/1.1')) == 204


def test_methods():
    for method in ('POST', 'PUT', 'DELETE', 'PATCH', 'TRACE', 'FOO', 'get'):
        status, head, body = server.get('/v1/meshes', method)
        assert status == 405, (method, status)
        assert head['allow'] == 'GET, HEAD, OPTIONS' and head['content-type'] == 'application/problem+json'


def test_unknown_paths():
    for path in ('/nothing', '/v1', '/v1/', '/v1/meshes/', '/v1/meshes/x', '/v1/meshes/x/mesh', '//v1/meshes',
                 '/v1//meshes',
                 '/v1/meshes/x/y/stream', '/v1/meshes/x/y/levels/0/mesh.vtu', '/healthz/', '/%68ealthz2'):
        problem(path, 404)


def test_a_page_for_browsers():
    """Who comes with an address line sees a page with a way back; programs see a problem."""
    browser = {'Accept': 'text/html,application/xhtml+xml,*/*;q=0.8'}
    for path, back in (('/nothing', '"./"'), ('/no/where/here?x=1/2', '"./../../"'),
                       ('/v1/meshes/%3Cscript%3E&', '"./../../"')):
        status, head, body = server.get(path, **browser)
        assert status == 404 and head['content-type'] == 'text/html; charset=utf-8', head
        assert ('href=' + back in body.decode() and b'<script' not in body
                and "default-src 'none'" in head['content-security-policy']), body
        assert head['cache-control'] == 'no-store'
        problem(path, 404)
        problem(path, 404, Accept='application/json, */*')
    assert server.get('/nothing', method='HEAD', **browser)[0] == 404
    status, head, _ = server.get('/v1/meshes?wrong=1', **browser)
    assert status == 400 and head['content-type'] != 'text/html; charset=utf-8'  # only what is not there
    problem('/v1/meshes?wrong=1', 400)


def test_traversal():
    for path in (b'/../etc/passwd', b'/%2e%2e/etc/passwd', b'/v1/meshes/..%2f..%2fetc%2fpasswd',
                 b'/v1/meshes/../../etc/passwd', b'/v1/meshes/%2e%2e', b'/..%5c..%5cetc', b'/v1/meshes/.%00./x',
                 b'/./catalogue.css/../../etc/passwd', b'/%c0%ae%c0%ae/'):
        received = ask(b'GET ' + path + b' HTTP/1.1')
        assert one(received) == 404 and b'root:' not in received, (path, received)


def test_nul_does_not_cut():
    # libmicrohttpd would show the handler /healthz
    assert one(ask(b'GET /healthz%00.html HTTP/1.1')) == 404
    assert one(ask(b'GET /healthz%2fx HTTP/1.1')) == 404


def test_targets_without_a_path():
    """What begins with neither '/' nor a scheme, or has control characters, is refused, with every header that makes an
    answer look at the path."""
    browser = b'Accept: text/html\r\n'
    for target in (b'\0', b'\0/healthz', b'healthz', b'?', b'*', b'http:/x', b'http', b'//\0'[2:], b'localhost:80',
                   b'/view/x\x01', b'/healthz?\x7f'):
        received = ask(b'GET ' + target + b' HTTP/1.1', browser)
        assert statuses(received) == [400], (target, received)
        assert (b'application/problem+json' in received
                and json.loads(received.partition(b'\r\n\r\n')[2])['status'] == 400)
    assert one(ask(b'OPTIONS healthz HTTP/1.1')) == 400
    assert one(ask(b'GET /\0 HTTP/1.1', browser)) == 200


def test_one_vary():
    """Where an answer varies by two headers, one line says so: a proxy may look at the first one alone."""
    with Server(FOLDER, '--cors', 'https://a.example') as named:
        for path, names in (('/', ['Accept-Encoding', 'Origin']), ('/v1/meshes', ['Accept-Encoding', 'Origin']),
                            ('/healthz', ['Origin'])):
            for headers in ({}, {'Origin': 'https://a.example'}, {'If-None-Match': '*'}):
                head = named.get(path, **headers)[1]
                assert head['vary'].split(', ') == names, (path, head)  # get() finds headers that come twice


def test_absolute_form():
    assert one(ask(b'GET http://x/healthz HTTP/1.1')) == 200
    assert one(ask(b'GET HTTP://x:80/readyz?a HTTP/1.1')) == 200
    assert one(ask(b'GET http://x HTTP/1.1')) == 200


def test_host():
    assert one(ask(b'GET /healthz HTTP/1.1', host=b'')) == 400
    assert one(ask(b'GET /healthz HTTP/1.1', host=HOST + HOST)) == 400
    assert one(ask(b'GET /healthz HTTP/1.1', host=b'Host : x\r\n')) == 400
    assert one(ask(b'GET /healthz HTTP/9.9')) == 505
    assert one(ask(b'GET /healthz HTTP/1.0', host=b'')) == 200


def test_bodies_are_refused():
    received = server.raw(b'GET /healthz HTTP/1.1\r\n' + HOST + b'Content-Length: 5\r\n\r\nhello')
    assert statuses(received) == [413], received
    received = server.raw(b'GET /healthz HTTP/1.1\r\n' + HOST + b'Content-Length: 0\r\nConnection: close\r\n\r\n')
    assert statuses(received) == [200], received


def test_smuggling():
    """A second request inside what a proxy may take for a body must never be answered."""
    inner = b'GET /v1/meshes HTTP/1.1\r\nHost: localhost\r\n\r\n'
    for headers, body in (
            (b'Content-Length: 5\r\nTransfer-Encoding: chunked\r\n', b'0\r\n\r\n' + inner),
            (b'Transfer-Encoding: chunked\r\nContent-Length: %d\r\n' % (5 + len(inner)), b'0\r\n\r\n' + inner),
            (b'Transfer-Encoding: chunked\r\n', b'0\r\n\r\n' + inner),
            (b'Transfer-Encoding: identity, chunked\r\n', b'0\r\n\r\n' + inner),
            (b'Transfer-Encoding: x\r\n', inner),
            (b'Content-Length: 0\r\nContent-Length: %d\r\n' % len(inner), inner),
            (b'Content-Length: %d\r\nContent-Length: 0\r\n' % len(inner), inner),
            (b'Content-Length: 0, %d\r\n' % len(inner), inner),
            (b'Content-Length: +0\r\n', inner),
            (b'Content-Length: -1\r\n', inner),
            (b'Content-Length: 0x0\r\n', inner),
            (b'Content-Length: 99999999999999999999999999\r\n', inner)):
        for method in (b'GET', b'HEAD', b'OPTIONS', b'POST'):
            received = server.raw(method + b' /healthz HTTP/1.1\r\n' + HOST + headers + b'\r\n' + body, finish=True)
            # libmicrohttpd cannot tell where a body of a coding that it does not know ends: it says nothing
            if not received:
                assert headers.startswith((b'Transfer-Encoding: identity', b'Transfer-Encoding: x')), (method, headers)
            else:
                assert one(received) >= 400, (method, headers, received)


def test_expect_continue():
    for method, wanted in ((b'POST', 405), (b'GET', 413)):
        received = server.raw(method + b' /v1/meshes HTTP/1.1\r\n' + HOST +
                              b'Content-Length: 5\r\nExpect: 100-continue\r\n\r\n')
        assert statuses(received) == [wanted], received  # without 100: nobody wants the body


def test_nul_in_headers():
    """libmicrohttpd cuts values at a NUL; a proxy may read on."""
    for headers in (b'Content-Length: 0\x005\r\n', b'X: a\x00b\r\n', b'X: a\x00bc\r\nY: b\r\n',
                    b'Cookie: a=b\x00; c=d\r\n'):
        for more in (b'', b'Z: z\r\n'):
            assert one(ask(b'GET /healthz HTTP/1.1', headers + more)) == 400, (headers, more)
    for headers in (b'X: a\r\n', b'X:a\r\n', b'X:  a  \r\n', b'X:\r\n', b'X: \t\r\n', b'Cookie: a=b; c=d\r\n',
                    b'Content-Length: 0\r\n'):
        for more in (b'', b'Z: z\r\n'):
            assert one(ask(b'GET /healthz HTTP/1.1', headers + more)) == 200, (headers, more)


def test_no_silence():
    """Whatever a request's size, it is answered: well up to --header-bytes, else refused."""
    for size in (1000, 4500, 7500, 9000, 12000, 12300, 16000, 20000):
        many = b'; '.join(b'c%d=' % i + b'x' * 144 for i in range(size // 150))
        for line, headers in ((b'GET /healthz?' + b'a' * size, b''), (b'GET /healthz?' + b'a&' * (size // 2), b''),
                              (b'GET /healthz', b'Cookie: ' + many + b'\r\n'), (b'GET /healthz',
                                                                                b'X: ' + b'a' * size + b'\r\n'),
                              (b'GET /healthz', (b'Cookie: a=' + b'x' * 138 + b'\r\n') * (size // 150))):
            status = one(ask(line + b' HTTP/1.1', headers))
            assert status in ((200,) if size < 8000 else (414, 431)), (size, line[:20], headers[:20], status)
    # The library lists the lines of a request in a memory of fixed size
    short, longer = b'X: a\r\n', b'X: aaaaaaaaaaaaaaa\r\n'
    for line, count, wanted in ((short, 600, 200), (longer, 400, 200), (longer, 450, 431)):
        assert one(ask(b'GET /healthz HTTP/1.1', line * count)) == wanted, (line, count)


def test_refusals_are_problems():
    """All but the few that libmicrohttpd makes itself: those that its parser meets before a request reaches us."""
    get, chunked = b'GET /healthz HTTP/1.1\r\n' + HOST, b'POST /healthz HTTP/1.1\r\n' + HOST + b'Transfer-Encoding: chunked\r\n\r\n'
    ours = {
        b'GET /nothing HTTP/1.1\r\n' + HOST + b'Connection: close\r\n\r\n': 404,
        b'DELETE / HTTP/1.1\r\n' + HOST + b'\r\n': 405, b'GET / HTTP/1.1\r\n\r\n': 400, get + HOST + b'\r\n': 400,
        get + b'a b: c\r\n\r\n': 400, get + b'Content-Length: 5\r\n\r\nhello': 413,
        get + b'Content-Length: 0\r\nContent-Length: 0\r\n\r\n': 413, chunked + b'0\r\n\r\n': 405,
        b'GET /' + b'a' * 9000 + b' HTTP/1.1\r\n' + HOST + b'\r\n': 414,
        b'GET /?' + b'a&' * 4500 + b' HTTP/1.1\r\n' + HOST + b'\r\n': 414, get + b'X: ' + b'a' * 9000 + b'\r\n\r\n': 431
    }
    theirs = {
        b'GET /healthz\r\n' + HOST + b'\r\n': 400, get + b'abc\r\n\r\n': 400,
        b'GET / HTTP/9.9\r\n' + HOST + b'\r\n': 505, get + b'Content-Length: +0\r\n\r\n': 400,
        get + b'Content-Length: 99999999999999999999\r\n\r\n': 413, chunked + b'zz\r\n': 400,
        chunked + b'F' * 20 + b'\r\n': 413, get + b'X: a\r\n' * 1000 + b'\r\n': 431
    }
    # Of these it may read a part and close: the kernel then resets the connection, which takes away an answer that was
    # sent
    longer = {b'GET /' + b'a' * 40000 + b' HTTP/1.1\r\n' + HOST + b'\r\n': 414,
              get + b'X: ' + b'a' * 40000 + b'\r\n\r\n': 431,
              chunked + b'1;' + b'a' * 40000: 500}
    for data, wanted in ours.items():
        (status, head, _), = answers(server.raw(data))
        assert status == wanted and head['content-type'] == 'application/problem+json', (data[:100], status, wanted)
    for data, wanted in theirs.items():
        assert one(server.raw(data)) == wanted, (data[:100], wanted)
    for data, wanted in longer.items():
        assert statuses(server.raw(data)) in ([], [wanted]), (data[:100], wanted)
    assert server.raw(get + b'Transfer-Encoding: x\r\n\r\n') == b''  # it cannot tell where the body ends


def test_many_parameters():
    """They are refused or ignored, however many; libmicrohttpd would say nothing until the time-out."""
    for count in (100, 300, 1000, 3000):
        assert one(ask(b'GET /v1/meshes/x/mesh?' + b'a&' * count + b' HTTP/1.1')) == 404, count


def test_forgotten_requests():
    """Of a request with two faults libmicrohttpd closes the connection and tells nobody: it is let go of all the same.
    """
    with Server(FOLDER) as forgetful:
        data = b'GET /' + b'a' * 7000 + b' HTTP/1.1\r\n' + HOST + b'Content-Length: -5\r\nCookie: a="\r\n\r\n'
        forgetful.raw(data)
        before = forgetful.memory()
        for _ in range(1500):
            forgetful.raw(data)
        assert SLOW > 1 or forgetful.memory() - before < 4 << 20, (before, forgetful.memory())


def test_long_requests():
    """Longer than what is read: where the server closes before all of it is read, the kernel resets the connection,
    which may take the refusal away before the client sees it."""
    for line, headers, wanted in ((b'GET /' + b'a' * 20000, b'', 414), (b'GET /' + b'a' * 100000, b'', 414),
                                  (b'GET /healthz', b'X: ' + b'a' * 50000 + b'\r\n', 431), (b'GET /healthz',
                                                                                            b'X: a\r\n' * 20000, 431)):
        assert statuses(ask(line + b' HTTP/1.1', headers)) in ([], [wanted]), (line[:20], wanted)
    assert server.get('/v1/meshes/' + 'a' * 3000)[0] == 404
    assert server.get('/healthz')[0] == 200


def test_garbage():
    for data, status in ((b'GET / HTTP/9.9\r\nHost: localhost\r\n\r\n', 505), (b'GET /\r\n\r\n', 400),
                         (b'GET  /  HTTP/1.1\r\n\r\n', 400),
                         (b'PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n', 505), (b'GET / HTTP/1.1\r\n: x\r\n\r\n', 400),
                         (b'GET / HTTP/1.1\r\nHost : x\r\n\r\n', 400), (b'GET / HTTP/1.1\r\n Host: localhost\r\n\r\n',
                                                                        400)):
        assert one(server.raw(data, finish=True)) == status, data
    with Server(FOLDER, '--timeout', '1') as short:
        # No request: empty lines, no end of a line, no target. The time-out ends the connection.
        for data in (b'\0' * 100, b'\r\n\r\n\r\n', b'GET\r\n\r\n', b'\xff\xfe\xfd\r\n\r\n',
                     b'\x16\x03\x01\x02\x00\x01\x00\x01\xfc\x03\x03'):
            assert short.raw(data, finish=True) == b'', data
        assert short.get('/healthz')[0] == 200


def test_pipelining():
    request = b'GET /healthz HTTP/1.1\r\n' + HOST + b'\r\n'
    last = b'GET /readyz HTTP/1.1\r\n' + HOST + b'Connection: close\r\n\r\n'
    received = server.raw(request * 50 + last)
    assert statuses(received) == [200] * 51
    assert received.rstrip().endswith(b'"unreadable": 0, "open_files": 0}')


def test_half_closed():
    # libmicrohttpd may take the end of the client's side for the end of the connection, or not see it until the
    # time-out
    with Server(FOLDER, '--timeout', '1') as short:
        for data, answers in ((b'GET /healthz HTTP/1.1\r\n' + HOST + b'\r\n', ([], [200])), (b'GET /hea', ([], [400]))):
            received = short.raw(data, finish=True)
            assert statuses(received) in answers, (data, received)


def test_keep_alive():
    with server.connect() as connection:
        for _ in range(3):
            connection.sendall(b'GET /healthz HTTP/1.1\r\n' + HOST + b'\r\n')
            received = b''
            while not received.endswith(b'"alive"}\n'):
                some = connection.recv(65536)
                assert some
                received += some
    assert one(server.raw(b'GET /healthz HTTP/1.0\r\n\r\n')) == 200


def test_head():
    for path in ('/', '/v1/meshes', '/healthz', '/nothing'):
        status, head, body = server.get(path)
        head_status, head_head, head_body = server.get(path, 'HEAD')
        assert (status, head['content-length']) == (head_status, head_head['content-length']) and head_body == b''
        assert int(head['content-length']) == len(body)


def test_conditional():
    for path in ('/', '/catalogue.css', '/v1/meshes'):
        _, head, body = server.get(path)
        etag = head['etag']
        assert etag.startswith('"')
        for match in (etag, 'W/' + etag, '"x", ' + etag, '*'):
            status, not_modified, nothing = server.get(path, If_None_Match=match)
            assert status == 304 and nothing == b'' and not_modified['etag'] == etag, (path, match, status)
            # RFC 9110, 8.6: the length of a 304, if any, is that of the 200
            assert not_modified.get('content-length', head['content-length']) == head['content-length']
            assert not_modified['cache-control'] == head['cache-control']
        assert server.get(path, If_None_Match='"other"')[0] == 200
        assert server.get(path, 'HEAD', If_None_Match=etag)[0] == 304


def test_coding():
    import zlib
    _, plain_head, plain = server.get('/catalogue.js')
    assert 'content-encoding' not in plain_head and plain_head['vary'] == 'Accept-Encoding'
    _, head, body = server.get('/catalogue.js', Accept_Encoding='gzip')
    assert head['content-encoding'] == 'gzip' and zlib.decompress(body, 31) == plain
    assert head['etag'] != plain_head['etag']
    _, head, body = server.get('/catalogue.js', Accept_Encoding='gzip, zstd')
    assert head['content-encoding'] == 'zstd' and body[:4] == b'\x28\xb5\x2f\xfd'
    assert 'content-encoding' not in server.get('/catalogue.js', Accept_Encoding='gzip;q=0, br;q=0')[1]
    unzstd = subprocess.run(['zstd', '-dqc'], input=body, stdout=subprocess.PIPE, check=True).stdout
    assert unzstd == plain
    _, head, body = server.get('/catalogue.js', Accept_Encoding='gzip, deflate, br, zstd')
    decode = 'process.stdout.write(zlib.brotliDecompressSync(fs.readFileSync(0)))'
    assert head['content-encoding'] == 'br' and subprocess.run(['node', '-e', decode], input=body,
                                                               stdout=subprocess.PIPE, check=True).stdout == plain
    for coding in ('gzip', 'zstd', 'br'):  # each coding is a representation with a tag of its own
        head = server.get('/catalogue.js', Accept_Encoding=coding)[1]
        assert server.get('/catalogue.js', Accept_Encoding=coding, If_None_Match=head['etag'])[0] == 304
        assert server.get('/catalogue.js', If_None_Match=head['etag'])[0] == 200


def test_embedding():
    """What embed.py makes of a folder: media types, the codings that are smaller, tags by content."""
    folder = os.path.join(SCRATCH, 'assets')
    os.makedirs(os.path.join(folder, 'deep'))
    for name, data in (('a.wasm', b'\0asm' * 100), ('deep/index.html', b'x'), ('b.js', b'same ' * 50),
                       ('c.mjs', b'same ' * 50), ('b.js.br', b'short'),
                       ('chunk-0A1B2C3D.js', b'')):
        with open(os.path.join(folder, name), 'wb') as file:
            file.write(data)
    embed = [sys.executable, os.path.join(ROOT, 'server', 'embed.py'), os.path.join(SCRATCH, 'embedded'), folder]
    subprocess.run(embed, check=True)
    with open(os.path.join(SCRATCH, 'embedded', 'embedded.c')) as file:
        rows = {row[0]: row[1:] for row in re.findall(r'{"(.*?)", "(.*?)", "(.*?)", (\w+), (.*)},', file.read())}
    assert set(rows) == {'/a.wasm', '/deep/', '/b.js', '/c.mjs', '/chunk-0A1B2C3D.js'}, rows
    assert rows['/a.wasm'][0] == 'application/wasm' and rows['/a.wasm'][3].count('_end') == 3
    assert rows['/deep/'][3].count('_end') == 1  # one byte does not become smaller
    assert rows['/b.js'][3].count('_end') == 4 and rows['/c.mjs'][3].count('_end') == 3
    assert rows['/b.js'][1] == rows['/c.mjs'][1] != rows['/a.wasm'][1]
    assert [name for name in rows if rows[name][2] == 'true'] == ['/chunk-0A1B2C3D.js']
    with open(os.path.join(folder, 'd.exe'), 'wb'):
        pass
    done = subprocess.run(embed, stderr=subprocess.PIPE)
    assert done.returncode == 1 and b'media type' in done.stderr


def test_assets():
    """What the page loads is there, with its media type, and kept for good where its name tells its content."""
    seen, todo = {}, ['/', '/view/x']
    while todo:
        path = todo.pop()
        status, head, body = server.get(path)
        assert status == 200, path
        seen[path] = head
        for name in re.findall(r'["\']\.{0,2}(/[\w-]+\.(?:js|css|wasm|svg))["\']', body.decode('latin-1')):
            # that one lies beside pages opened from disk
            if name not in seen and name not in todo and name != '/inline.js':
                todo.append(name)
    assert all(any(part in name for name in seen) for part in ('.wasm', '/chunk-', '/worker-')), list(seen)
    for path, head in seen.items():
        forever = re.search(r'/(chunk|tetlod|refine|vectors)-[0-9A-Z]{8}\.(js|wasm)$', path)
        worker = re.search(r'/worker-[0-9A-Z]{8}\.js$', path)  # obeys the policy of its own answer
        assert ('immutable' if forever else 'max-age=60' if worker else 'no-cache') in head['cache-control'], (path,
                                                                                                               head)
        if path.endswith('.wasm'):
            assert head['content-type'] == 'application/wasm'
        if int(head['content-length']) > 2000:
            for coding in ('gzip', 'zstd', 'br'):
                assert server.get(path, Accept_Encoding=coding)[1]['content-encoding'] == coding, path
        assert server.get(path, If_None_Match=head['etag'])[0] == 304


def policy(text):
    return {name: set(sources) for name, *sources in (directive.split() for directive in text.split(';'))}


def test_page():
    status, head, body = server.get('/')
    assert status == 200 and head['content-type'].startswith('text/html') and b'<html' in body
    assert head['x-content-type-options'] == 'nosniff'
    rules = policy(head['content-security-policy'])
    assert rules == {'default-src': {"'self'"}, 'script-src': {"'self'", "'wasm-unsafe-eval'"},
                     'worker-src': {"'self'", 'blob:'},
                     'img-src': {"'self'", 'data:',
                                 'blob:'}, 'object-src': {"'none'"}, 'base-uri': {"'none'"}, 'form-action': {"'none'"},
                     'connect-src': {"'self'"}}, rules
    for path in ('/view/fin', '/view/a%20b', '/view/nothing?x'):
        status, head, body = server.get(path)
        assert (status == 200 and head['content-type'].startswith('text/html') and b'<html' in body
                and head['etag']), path
    for path in ('/view', '/view/', '/view/a/b', '/view/%00', '/view/%zz', '/catalogue.css/', '/catalogue.csss'):
        problem(path, 404)
    assert server.get('/catalogue.css')[1]['content-type'].startswith('text/css')


def test_stream_origins():
    with Server(FOLDER, '--stream-origin', 'https://data.example.org', '--stream-origin', 'http://[::1]:81') as two:
        rules = policy(two.get('/')[1]['content-security-policy'])
        assert rules['connect-src'] == {"'self'", 'https://data.example.org',
                                        'http://[::1]:81'} and rules['default-src'] == {"'self'"}
    for origin in ('*', "https://a; script-src 'unsafe-inline'", 'https://a b', 'ftp://a', 'https://',
                   'https://' + 'a' * 300, 'https://a/path'):
        done = subprocess.run([TETLOD, 'serve', FOLDER, '--listen', '127.0.0.1:0', '--stream-origin', origin],
                              stdout=subprocess.PIPE, stderr=subprocess.PIPE)
        assert done.returncode == 2 and b'origin' in done.stderr, (origin, done)


def test_slow_loris():
    """A client that sends a byte now and then is shut down; one that waits between two requests as well, silently."""
    with Server(FOLDER, '--timeout', '1') as slow:
        with slow.connect() as connection, slow.connect() as idle:
            with contextlib.suppress(BrokenPipeError, ConnectionResetError):
                for byte in b'GET /healthz HTTP/1.1\r\nHost: localhost\r\nX: ' + b'a' * 1000:
                    connection.sendall(bytes([byte]))
                    time.sleep(0.1)
                raise AssertionError('it is still listened to')
            assert idle.recv(10) == b''
        assert slow.get('/healthz')[0] == 200
        # the idle one may have met libmicrohttpd's own time-out
        eventually(lambda: int(re.search(rb'tetlod_connections_expired_total (\d+)', slow.get('/metrics')[2])[1]) >= 1)


def hold(limited, count):
    """Connections that the server has accepted, for each has had an answer."""
    held = [limited.connect() for _ in range(count)]
    for connection in held:
        connection.sendall(b'GET /healthz HTTP/1.1\r\n' + HOST + b'\r\n')
        assert connection.recv(100).startswith(b'HTTP/1.1 200')
    return held


def gets_in(limited):
    with contextlib.suppress(OSError, http.client.HTTPException):
        return limited.get('/healthz')[0] == 200


def test_connection_limits():
    for option, count in (('--connections', 5), ('--per-address', 2)):
        with Server(FOLDER, option, str(count), '--timeout', '1000') as small:
            held = hold(small, count)
            received = small.raw(b'GET /healthz HTTP/1.1\r\n' + HOST + b'\r\n')
            # nothing comes where the request was still on its way when the connection was closed
            for status, head, body in answers(received):
                assert (status == 503 and head['retry-after'] and body
                        and head['cache-control'] == 'no-store'), (option, received)
            held.pop().close()
            eventually(lambda: gets_in(small))
            for connection in held:
                connection.close()


def test_idle_connections():
    """Many connections that say nothing cost little and keep nobody out."""
    most = resource.getrlimit(resource.RLIMIT_NOFILE)[1]
    resource.setrlimit(resource.RLIMIT_NOFILE, (most, most))
    count = 300 if SLOW > 1 else 10000 if most > 10200 else most - 200
    with Server(FOLDER, '--connections', '20000') as many:
        before = many.memory()
        held = []
        for _ in range(count):
            held.append(many.connect())
        assert many.get('/healthz')[0] == 200
        grown = many.memory() - before
        assert SLOW > 1 or grown < 64 << 20, grown
        for connection in held:
            connection.close()


def test_addresses():
    path = os.path.join(SCRATCH, 's.sock')
    with Server(FOLDER, '--listen', 'unix:' + path) as two:
        assert two.get('/healthz')[0] == 200
        with socket.socket(socket.AF_UNIX) as connection:
            connection.settimeout(PATIENCE)
            connection.connect(path)
            connection.sendall(b'GET /healthz HTTP/1.1\r\n' + HOST + b'Connection: close\r\n\r\n')
            assert connection.recv(100).startswith(b'HTTP/1.1 200')
    assert not os.path.exists(path)
    with Server(FOLDER, '--listen', '127.0.0.1:0', '--listen', '[::1]:0', '--quiet') as three:
        second, third = (three.process.stdout.readline().decode() for _ in range(2))
        for url in (second, third):
            found = re.match(r'http://\[?([^]]*?)\]?:(\d+)/$', url)
            connection = http.client.HTTPConnection(found[1], int(found[2]), timeout=PATIENCE)
            connection.request('GET', '/healthz')
            assert connection.getresponse().status == 200, url
            connection.close()
        assert '[::1]' in third


def test_sockets_of_others():
    """A socket is removed only where nobody listens: not of a server that is stopped, nor of one whose queue is full.
    """
    path = os.path.join('/tmp', 'tetlod-socket-%d.sock' % os.getpid())

    def start():
        return subprocess.run([TETLOD, 'serve', FOLDER, '--listen', 'unix:' + path], stderr=subprocess.PIPE,
                              timeout=PATIENCE)

    with Server(FOLDER, listen='unix:' + path) as first:
        first.process.send_signal(signal.SIGSTOP)
        for _ in range(2):
            done = start()
            assert done.returncode == 1 and b'another server listens there' in done.stderr, done
        first.process.send_signal(signal.SIGCONT)
        assert os.path.exists(path)
    with socket.socket(socket.AF_UNIX) as full:
        full.bind(path)
        full.listen(0)
        waiting = [socket.socket(socket.AF_UNIX) for _ in range(3)]
        for connection in waiting:
            connection.setblocking(False)
            connection.connect_ex(path)
        done = start()
        assert done.returncode == 1 and b'another server listens there' in done.stderr, done
        for connection in waiting:
            connection.close()
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as other:  # not ours at all
        os.unlink(path)
        other.bind(path)
        done = start()
        assert done.returncode == 1 and os.path.exists(path), done
    os.unlink(path)
    with socket.socket(socket.AF_UNIX) as dead:
        dead.bind(path)
    for mode in (None, '660', '606', '777'):
        with Server(FOLDER, *(['--socket-mode', mode] if mode else []), listen='unix:' + path):
            found = os.stat(path).st_mode & 0o777
            assert found == int(mode, 8) if mode else not found & 0o111 or found == 0o755, (mode, oct(found))
        assert not os.path.exists(path)
    for bad in ('0', '8', '1777', 'x', ''):
        done = subprocess.run([TETLOD, 'serve', FOLDER, '--socket-mode', bad], stderr=subprocess.PIPE, timeout=PATIENCE)
        assert done.returncode == 2 and b'socket-mode' in done.stderr, (bad, done)


def test_long_times():
    """Times beyond what clocks count with are long ones: nothing spins, and a signal is heard."""
    with Server(FOLDER, '--scan', '1e30', '--keep-replaced', '1e300', '--timeout', '1e30', '--drain',
                '1e15') as server_of:
        before = os.times().elapsed, cpu_seconds(server_of)
        time.sleep(1)
        assert cpu_seconds(server_of) - before[1] < 0.5 * (os.times().elapsed - before[0])
        stream = os.path.join(FOLDER, 'late.tetlod')
        shutil.copy(os.path.join(ROOT, 'tests', 'golden', 'cells_float32.tetlod'), stream)
        server_of.process.send_signal(signal.SIGHUP)
        eventually(lambda: server_of.get('/v1/meshes/late')[0] == 200)
        os.unlink(stream)


def cpu_seconds(server_of):
    with open('/proc/%d/stat' % server_of.process.pid) as file:
        words = file.read().rpartition(')')[2].split()
    return (int(words[11]) + int(words[12])) / os.sysconf('SC_CLK_TCK')


def test_memory_is_said():
    with Server(FOLDER, '--memory', '300M', '--cache', '20M') as told, Server(FOLDER) as chosen:
        assert 'at most 300 MB for streams (--memory) and 20 MB for answers (--cache), of ' in told.messages()
        streams, answers, there = map(
            int,
            re.search(r'at most (\d+) MB for streams .* and (\d+) MB for answers .*, of (\d+) MB',
                      chosen.messages()).groups())
        assert abs(streams - there / 2) <= 1 and answers <= min(256, there / 8)


def test_metrics_apart():
    port = free_port()
    with Server(FOLDER, '--metrics', '127.0.0.1:%d' % port) as apart:
        assert apart.get('/metrics')[0] == 404
        connection = http.client.HTTPConnection('127.0.0.1', port, timeout=PATIENCE)

        def counted():
            connection.request('GET', '/metrics')
            return re.search(rb'^tetlod_requests_total{route="/metrics",status="404"} 1$',
                             connection.getresponse().read(), re.M)

        eventually(counted)  # an answer is counted when it has been sent
        connection.close()


def test_threads():
    """As many HTTP threads, as many that make meshes, that decode and that read files, as asked for, beside the main
    one, the acceptor and the reaper."""
    def threads(count):
        with Server(FOLDER, '--threads', str(count)) as server_of:
            return len(os.listdir('/proc/%d/task' % server_of.process.pid))

    assert threads(5) - threads(2) == 12
    with Server(FOLDER, '--threads', '1') as alone:
        assert [alone.get('/healthz')[0] for _ in range(5)] == [200] * 5


def test_graceful_stop():
    """An idle connection holds nobody up: without that it would end only after all our patience."""
    with Server(FOLDER, '--drain', '1000', '--timeout', '1000') as ending:
        idle, = hold(ending, 1)
        ending.stop()
        idle.close()


def test_access_log():
    with Server(FOLDER, '--access-log') as logging:
        logging.get('/nothing?a="\\', X_Request_Id='me')
        logging.stop()
        lines = [json.loads(line) for line in logging.messages().splitlines() if line.startswith('{')]
        assert len(lines) == 1, lines
        entry = lines[0]
        assert (entry['id'], entry['method'], entry['target'], entry['status'], entry['remote'], entry['complete']) == (
            'me', 'GET', '/nothing?a="\\', 404, '127.0.0.1', True), entry
        assert entry['bytes'] > 0 and entry['milliseconds'] >= 0 and entry['time'].endswith('Z')


def test_metrics():
    server.get('/healthz')
    eventually(lambda: b'\ntetlod_requests_total{route="/healthz",status="200"} ' in server.get('/metrics')[2])
    status, head, body = server.get('/metrics')
    assert status == 200 and head['content-type'].startswith('text/plain; version=0.0.4')
    lines = body.decode().splitlines()
    assert any(line.startswith('tetlod_requests_total{route="/healthz",status="200"} ') for line in lines)
    assert any(line.startswith('tetlod_request_seconds_bucket{route="/healthz",le="+Inf"} ') for line in lines)
    for line in lines:
        assert line.startswith('#') or len(line.rsplit(' ', 1)) == 2 and float(line.rsplit(' ', 1)[1]) >= 0, line
    names = [line.split()[2] for line in lines if line.startswith('# TYPE')]
    assert len(names) == len(set(names))


with Server(FOLDER, '--timeout', '1000') as server:  # what ends a connection is never that
    run([
        test_health, test_common_headers, test_request_id, test_options, test_methods, test_unknown_paths,
        test_a_page_for_browsers, test_traversal, test_nul_does_not_cut, test_targets_without_a_path, test_one_vary,
        test_absolute_form, test_host, test_bodies_are_refused, test_smuggling, test_expect_continue,
        test_nul_in_headers, test_no_silence, test_refusals_are_problems, test_many_parameters, test_forgotten_requests,
        test_long_requests, test_garbage, test_pipelining, test_half_closed, test_keep_alive, test_head,
        test_conditional, test_coding, test_embedding, test_assets, test_page, test_stream_origins, test_slow_loris,
        test_connection_limits, test_idle_connections, test_addresses, test_sockets_of_others, test_long_times,
        test_memory_is_said, test_metrics_apart, test_threads, test_graceful_stop, test_access_log, test_metrics
    ])
