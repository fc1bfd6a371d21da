# SPDX-License-Identifier: BSD-3-Clause
"""Who may read: other origins (CORS), other names for loopback (rebinding), the token."""
import concurrent.futures
import glob
import http.client
import json
import os
import re
import signal
import socket
import subprocess
import threading
import time
import urllib.parse

from served import PATIENCE, ROOT, SCRATCH, TETLOD, Server, eventually, open_files, run

FOLDER = os.path.join(SCRATCH, 'streams')
PATHS = ('/', '/v1/meshes', '/v1/meshes/fin', '/v1/meshes/fin/prefix?level=0', '/nothing', '/metrics')


# All that answers say of meshes, as the sources have it.
OWN = tuple({name for source in glob.glob(os.path.join(ROOT, 'server', '*', '*.c'))
             for name in re.findall(r'response_header\w*\(\w+(?:->\w+)*, "(Tetlod-[A-Za-z-]+)"', open(source).read())})
assert len(OWN) > 10, OWN


def allowed(server, origin, path='/v1/meshes', method='GET', **headers):
    head = server.get(path, method, Origin=origin, **headers)[1]
    return head.get('access-control-allow-origin')


def test_none_on_loopback():
    with Server(FOLDER) as server:
        for path in PATHS:
            for method in ('GET', 'OPTIONS'):
                head = server.get(path, method, Origin='http://elsewhere', Access_Control_Request_Method='GET')[1]
                assert not [name for name in head if name.startswith('access-control') or
                            name == 'timing-allow-origin'], (path, head)
                assert head['cross-origin-resource-policy'] == 'same-origin'


def test_any_elsewhere():
    with Server(FOLDER, listen='0.0.0.0:0') as server:
        for path in PATHS:
            head = server.get(path, Origin='http://elsewhere', Host='anything.example')[1]
            assert (head['access-control-allow-origin'] == head['timing-allow-origin'] == '*'
                    and head['cross-origin-resource-policy'] == 'cross-origin')
            for name in ('ETag', 'Content-Range', 'Server-Timing', 'Location') + OWN:
                assert name in head['access-control-expose-headers'].split(', '), name


def test_named_origins():
    with Server(FOLDER, '--cors', 'https://a.example', '--cors', 'http://b.example:8000') as server:
        for origin in ('https://a.example', 'http://b.example:8000'):
            assert allowed(server, origin) == origin
            head = server.get('/v1/meshes', 'OPTIONS', Origin=origin, Access_Control_Request_Method='GET')[1]
            assert ('GET' in head['access-control-allow-methods'] and 'Range' in head['access-control-allow-headers']
                    and int(head['access-control-max-age']) > 0)
        for origin in ('http://a.example', 'https://a.example.evil', 'https://a.example:1', 'null', ''):
            assert allowed(server, origin) is None, origin
            assert 'Origin' in server.get('/healthz', Origin=origin)[1]['vary']
    with Server(FOLDER, '--cors', '*') as server:
        assert allowed(server, 'https://x') == '*'
    with Server(FOLDER, '--cors', 'none', listen='0.0.0.0:0') as server:
        assert allowed(server, 'https://x') is None
    for bad in ('example.org', 'https://*', 'ftp://x', ''):
        done = subprocess.run([TETLOD, 'serve', FOLDER, '--listen', '127.0.0.1:0', '--cors', bad],
                              stderr=subprocess.PIPE)
        assert done.returncode == 2 and b'origin' in done.stderr, (bad, done)


def test_host_on_loopback():
    with Server(FOLDER, '--host', 'proxy.example') as server:
        for host in ('localhost', 'LOCALHOST:80', 'a.localhost', '127.0.0.1', '127.1.2.3:9', '[::1]', '[::1]:80',
                     'proxy.example', 'Proxy.example:443'):
            assert server.get('/v1/meshes', Host=host)[0] == 200, host
        for host in ('evil.example', 'localhost.evil.example', 'notlocalhost', '127.0.0.1.evil.example',
                     '127.evil.example', '[::2]', '[::1', '', 'x', '10.0.0.1',
                     'proxy.example.org'):
            for path in PATHS:
                assert server.get(path, Host=host)[0] == 421, (host, path)
    with Server(FOLDER, '--host', '*') as server:
        assert server.get('/v1/meshes', Host='evil.example')[0] == 200
    path = os.path.join('/tmp', 'tetlod-access-%d.sock' % os.getpid())
    with Server(FOLDER, listen='unix:' + path):  # no browser gets there
        with socket.socket(socket.AF_UNIX) as connection:
            connection.connect(path)
            connection.sendall(b'GET /healthz HTTP/1.1\r\nHost: any.example\r\nConnection: close\r\n\r\n')
            assert connection.recv(1000).startswith(b'HTTP/1.1 200')


def write_token(name, secret):
    path = os.path.join(SCRATCH, name)
    with open(path, 'w') as file:
        file.write(secret)
    return path


def listening(server):
    """The ports that a server listens on, beside the first."""
    inodes = {what[len('socket:['):-1] for _, what in open_files(server.process.pid)}
    with open('/proc/net/tcp') as table:
        rows = [line.split() for line in table][1:]
    ports = [int(row[1].split(':')[1], 16) for row in rows if row[3] == '0A' and row[9] in inodes]
    return [port for port in ports if port != server.address[1]]


def ask(port, path, method='GET', host='localhost', **headers):
    connection = http.client.HTTPConnection('127.0.0.1', port, timeout=PATIENCE)
    try:
        connection.request(method, path, headers={'Host': host, **{k.replace('_', '-'): v for k, v in headers.items()}})
        answer = connection.getresponse()
        return answer.status, answer.headers, answer.read()
    finally:
        connection.close()


SECRET = 'a-Secret_0123456789'


def test_token():
    path = write_token('token', SECRET + '\n')
    wrong = ({'Authorization': 'Bearer wrong'}, {'Authorization': 'Bearer ' + SECRET + 'x'},
             {'Authorization': 'Bearer ' + SECRET[:-1]})
    none = ({}, {'Authorization': 'Basic ' + SECRET}, {'Cookie': 'tetlod_token=' + SECRET},
            {'Cookie': 'xtetlod_token=' + SECRET})
    with Server(FOLDER, '--token', path, '--metrics', '127.0.0.1:0', '--access-log', '--base-path', '/x/') as server:
        for asked, many in [(asked, none)
                            for asked in PATHS + ('/openapi.json', '/x', '/x/')] + [('/v1/meshes', wrong),
                                                                                    ('/v1/meshes?token=wrong', ({}, )),
                                                                                    ('/?token=', ({}, ))]:
            for headers in many:
                status, head, body = server.get(asked, **headers)
                assert (status == 401 and head['www-authenticate'] == 'Bearer'
                        and SECRET.encode() not in body), (asked, headers, status)
        for asked in ('/healthz', '/readyz'):
            assert server.get(asked)[0] == 200
        assert server.get('/v1/meshes', Authorization='Bearer ' + SECRET)[0] == server.get(
            '/v1/meshes', Authorization='bearer  ' + SECRET)[0] == 200
        assert server.get('/v1/meshes', Authorization='Bearer ' + SECRET,
                          Host='proxy.example')[0] == 200  # an attacker has no token
        status, head, _ = server.get('/view/fin?a=1&token=%s&b=2' % SECRET)
        assert (status == 303 and head['location'] == '/x/view/fin?a=1&b=2' and 'HttpOnly' in head['set-cookie']
                and 'Path=/x/;' in head['set-cookie']), head
        assert 'Secure' not in head['set-cookie']
        cookie = head['set-cookie'].split(';')[0]
        # however the name is written
        assert server.get('/view/fin?a=1&t%%6fken=%s&&b=2' % SECRET)[1]['location'] == '/x/view/fin?a=1&b=2'
        assert server.get('/x/view/fin', Cookie='other=1; ' + cookie + '; more=2')[0] == 200
        assert server.get('/v1/meshes', Cookie=cookie[:-1])[0] == 401
        status, head, _ = server.get('/v1/meshes/fin/mesh?level=0', Cookie=cookie)
        assert status == 303
        cid = server.json('/v1/meshes/fin', Cookie=cookie)['cid']
        head = server.get('/v1/meshes/fin/%s/levels/0/mesh.vtu' % cid, Cookie=cookie)[1]
        assert head['cache-control'].startswith('private,') and 'immutable' in head['cache-control']
        assert server.get('/v1/meshes', 'OPTIONS')[0] == 204  # preflights carry no token
        server.stop()
        assert SECRET not in server.messages() and 'token=*' in server.messages() and 't%6fken=*' in server.messages()
    for text in ('', ' \n', 'two words', 'line\nline', 'x' * 300, 'a;b'):
        write_token('token', text)
        done = subprocess.run([TETLOD, 'serve', FOLDER, '--listen', '127.0.0.1:0', '--token', path],
                              stderr=subprocess.PIPE)
        assert done.returncode == 2 and b'token' in done.stderr and path.encode() in done.stderr, (text, done)
    done = subprocess.run([TETLOD, 'serve', FOLDER, '--token', path + '-none'], stderr=subprocess.PIPE)
    assert done.returncode == 1 and path.encode() in done.stderr


def test_way_in():
    """What a browser opens leads in, with every base path and every spelling of it, and the cookie goes where the site
    is."""
    path = write_token('token', SECRET)
    for base, opened in (('/', ('/',)), ('/x/', ('/x', '/x/', '/')), ('/deep/er/', ('/deep/er', '/deep/er/', '/'))):
        for options in ((), ('--secure-cookie',)):
            with Server(FOLDER, '--token', path, *(['--base-path', base] if base != '/' else []), *options) as server:
                for at in opened:
                    status, head, _ = server.get('%s?token=%s' % (at, SECRET))
                    name, _, rest = head['set-cookie'].partition('=')
                    place = urllib.parse.urljoin(at, head['location'])
                    assert status == 303 and place == base and ('; Path=%s;' % base) in rest, (base, at, head)
                    assert rest.endswith('; Secure') == bool(options)
                    assert server.get(place, Cookie=head['set-cookie'].split(';')[0])[0] == 200, (base, at)


def test_cookies_of_several_servers():
    """A browser keeps one jar for a host, whatever the port: one server's cookie does not shut out from another, nor
    does its base path."""
    paths = [write_token('token%d' % i, 'secret-%d' % i) for i in range(3)]
    with Server(FOLDER, '--token', paths[0]) as one, Server(FOLDER, '--token', paths[1]) as two, Server(
            FOLDER, '--token', paths[2], '--base-path', '/b/') as three:
        jar = {}
        for i, server in enumerate((one, two, three)):
            cookie = server.get('/?token=secret-%d' % i,
                                Host='localhost:%d' % (server.address[1] if i < 2 else one.address[1]))[1]['set-cookie']
            name, _, value = cookie.split(';')[0].partition('=')
            jar[name] = value
        assert len(jar) == 3, jar
        cookies = '; '.join('%s=%s' % pair for pair in jar.items())
        for server in (one, two):
            assert server.get('/v1/meshes', Cookie=cookies, Host='localhost:%d' % server.address[1])[0] == 200
        assert three.get('/b/v1/meshes', Cookie=cookies, Host='localhost:%d' % one.address[1])[0] == 200


def test_the_address_of_metrics():
    """It answers /metrics, /healthz and /readyz and nothing else: with and without token, base path and CORS."""
    path = write_token('token', SECRET)
    for token in ((), ('--token', path)):
        for base in ((), ('--base-path', '/x/')):
            for cors in ((), ('--cors', '*'), ('--cors', 'https://a.example')):
                with Server(FOLDER, '--metrics', '127.0.0.1:0', *token, *base, *cors) as server:
                    cid = server.json('/v1/meshes/fin', Authorization='Bearer ' + SECRET)['cid']
                    port, = listening(server)
                    for front in ('', '/x') if base else ('',):
                        for asked in ('/metrics', '/healthz', '/readyz'):
                            status, head, _ = ask(port, front + asked, Origin='https://a.example')
                            assert status == 200, (asked, status)
                            assert head['Access-Control-Allow-Origin'] == (cors[1] if cors else None)
                        for asked in ('/', '/v1/meshes', '/v1/meshes/fin', '/v1/meshes/fin/%s/stream' % cid,
                                      '/view/fin', '/openapi.json', '/nothing', '/v1/meshes/fin/prefix?level=0',
                                      '/?token=' + SECRET, '/v1/meshes?token=wrong', 'http://localhost/v1/meshes'):
                            for method in ('GET', 'HEAD'):
                                status, head, body = ask(port, asked if asked[0] == 'h' else front + asked, method)
                                assert (status == 404 and 'Set-Cookie' not in head
                                        and b'fin' not in body.replace(b'"instance": "./fin', b'')), (asked, status,
                                                                                                      body)
                    assert ask(port, '/metrics', host='evil.example')[0] == (200 if token else 421)
                    if token:
                        assert server.get('/v1/meshes')[0] == 401
                        eventually(lambda: b'\ntetlod_requests_total{route="other",status="401"} 1\n' in ask(
                            port, '/metrics')[2])


def test_wrong_tokens_cost_time():
    """Each waits for a second, and eight of a client wait at a time: whoever has more is not told whether they are
    right."""
    path, count = write_token('token', SECRET), 60
    with Server(FOLDER, '--token', path) as server:
        def guess(i):
            place = ('?token=wrong%d' % i, {}) if i % 2 else ('', {'Authorization': 'Bearer wrong%d' % i})
            return server.get('/v1/meshes' + place[0], **place[1])

        with concurrent.futures.ThreadPoolExecutor(count) as pool:
            started = time.monotonic()
            waiting = [pool.submit(guess, i) for i in range(count)]
            found = [one.result() for one in waiting]
            took = time.monotonic() - started
        refused = [status for status, _, _ in found if status == 401]
        assert {status for status, _, _ in found} <= {401, 429} and all(head['retry-after']
                                                                        for status, head, _ in found if status == 429)
        assert len(refused) <= 8 * (1 + took) and took >= 1, (len(refused), took)
        assert server.get('/v1/meshes')[0] == 401  # it tried none: at once, even if others of its address wait
        eventually(lambda: server.get('/v1/meshes', Authorization='Bearer ' + SECRET)[0] == 200)
        text = server.get('/metrics', Authorization='Bearer ' + SECRET)[2]
        assert b'\ntetlod_wrong_tokens_total %d\n' % len(refused) in text
        assert re.search(rb'^tetlod_requests_total{route="other",status="401"} \d+$', text, re.M), text
        with server.connect() as gone:  # nor does a client that leaves save the time, or hold up the end
            gone.sendall(b'GET /v1/meshes?token=x HTTP/1.1\r\nHost: localhost\r\n\r\n')
            time.sleep(0.1)


def test_forwarded_addresses():
    """Behind a trusted proxy the last address that is none of its own counts; anybody else's word is nothing."""
    for trusted, forwarded, expected in (([], '1.2.3.4', '127.0.0.1'), (['10.0.0.0/8'], '1.2.3.4', '127.0.0.1'), ([
            '127.0.0.1'
    ], '1.2.3.4', '1.2.3.4'), (['127.0.0.0/8', '10.0.0.0/8'], '6.6.6.6, 1.2.3.4 , 10.1.1.1', '1.2.3.4'), ([
            '127.0.0.1'
    ], '6.6.6.6, 10.1.1.1', '10.1.1.1'), (['127.0.0.1', '::/0'], 'nonsense, 2001:db8::1', '2001:db8::1'), ([
            '127.0.0.1'
    ], '[2001:db8::1]:80', '2001:db8::1'), (['127.0.0.1'], '1.2.3.4:99', '1.2.3.4'), ([
            '127.0.0.1'
    ], 'nonsense', '127.0.0.1'), (['127.0.0.1'], '', '127.0.0.1'), (['::ffff:127.0.0.1'], '1.2.3.4', '1.2.3.4'), ([
            '127.0.0.1'
    ], '9.9.9.9, ' * 300 + '1.2.3.4', '1.2.3.4'), (['0.0.0.0/0'], '1.1.1.1, 2.2.2.2', '1.1.1.1')):
        options = [word for address in trusted for word in ('--trust-proxy', address)]
        with Server(FOLDER, '--access-log', *options) as server:
            server.get('/healthz', X_Forwarded_For=forwarded)
            assert one_line(server)['remote'] == expected, (trusted, forwarded)
    for bad in ('x', '1.2.3', '1.2.3.4/33', '::/129', '1.2.3.4/', ''):
        done = subprocess.run([TETLOD, 'serve', FOLDER, '--listen', '127.0.0.1:0', '--trust-proxy', bad],
                              stderr=subprocess.PIPE)
        assert done.returncode == 2 and b'proxy' in done.stderr, (bad, done)


def one_line(server):
    eventually(lambda: '{' in server.messages() and server.messages().endswith('\n'))
    return json.loads(next(line for line in server.messages().splitlines() if line.startswith('{')))


def test_forwarded_addresses_and_guesses():
    """Who guesses behind a proxy holds up nobody else there; two lines of the header are one list."""
    with Server(FOLDER, '--token', write_token('token', SECRET), '--trust-proxy', '127.0.0.1') as server:
        with concurrent.futures.ThreadPoolExecutor(20) as pool:
            guesses = [pool.submit(server.get, '/v1/meshes', Authorization='Bearer x',
                                   X_Forwarded_For='6.6.6.6') for _ in range(20)]
            eventually(lambda: any(one.done() and one.result()[0] == 429 for one in guesses))
            assert server.get('/v1/meshes', Authorization='Bearer ' + SECRET, X_Forwarded_For='1.2.3.4')[0] == 200
            assert not all(one.done() for one in guesses)
    with Server(FOLDER, '--access-log', '--trust-proxy', '127.0.0.1') as server:
        server.raw(
            b'GET /healthz HTTP/1.1\r\nHost: localhost\r\nX-Forwarded-For: 6.6.6.6\r\nx-forwarded-for: 1.2.3.4\r\nConnection: close\r\n\r\n'
        )
        assert one_line(server)['remote'] == '1.2.3.4'


def test_reload():
    """SIGHUP takes token, CORS and hosts from the file; what cannot be read, or needs a restart, changes nothing."""
    token, options = write_token('token', 'first'), os.path.join(SCRATCH, 'options')
    refused = 401, 429  # so many are refused here that on a slow machine the address has to wait

    def write(*lines):
        with open(options + '.new', 'w') as file:
            file.write('\n'.join(lines) + '\n')
        os.replace(options + '.new', options)  # the server may still read for the signal before

    def reload(server, *lines):
        write(*lines)
        server.process.send_signal(signal.SIGHUP)

    write('# who may read', 'cors https://a.example', '  host\tproxy.example  ', 'cors = https://b.example', '',
          'access-log')
    with Server(FOLDER, '--config', options, '--cors', 'https://c.example') as server:
        assert [allowed(server, 'https://%s.example' % name) is not None
                for name in 'abcd'] == [True, True, True, False]
        assert server.get('/v1/meshes', Host='proxy.example')[0] == 200
        reload(server, 'cors https://d.example', 'access-log')
        eventually(lambda: allowed(server, 'https://d.example') and
                   server.get('/healthz', Host='proxy.example')[0] == 421)
        assert [allowed(server, 'https://%s.example' % name) is not None
                for name in 'abcd'] == [False, False, True, True]
        reload(server, 'token ' + token, 'access-log')
        eventually(lambda: server.get('/v1/meshes')[0] in refused)
        assert server.get('/v1/meshes', Authorization='Bearer first')[0] == 200
        write_token('token', 'second')  # the token's file alone
        server.process.send_signal(signal.SIGHUP)
        eventually(lambda: server.get('/v1/meshes', Authorization='Bearer second')[0] == 200)
        assert server.get('/v1/meshes', Authorization='Bearer first')[0] in refused
        for lines, word in ((['nonsense 1'], 'line 1'), (['token'], 'needs a value'), (['cors nonsense'], 'origin'),
                            (['token ' + token + '-none'], '-none'),
                            (['quiet yes'], 'no value'), (['scan 5', 'token ' + token, 'access-log'], "'scan'")):
            assert word not in server.messages(), word
            reload(server, *lines)
            eventually(lambda: word in server.messages())
            with_token = server.get('/v1/meshes', Authorization='Bearer second')[0]
            without = server.get('/v1/meshes')[0]
            assert with_token == 200 and without in refused, (lines, with_token, without)
        reload(server, 'cors none')
        eventually(lambda: server.get('/v1/meshes')[0] == 200)
        os.unlink(options)
        server.process.send_signal(signal.SIGHUP)
        eventually(lambda: server.messages().count('as they were') == 6)
        assert server.get('/v1/meshes')[0] == 200
    for lines in (['nonsense 1'], ['cors'], ['config x'], ['quiet x'], ['threads x']):
        write(*lines)
        done = subprocess.run([TETLOD, 'serve', FOLDER, '--listen', '127.0.0.1:0', '--config', options],
                              stderr=subprocess.PIPE)
        assert done.returncode == 2 and done.stderr.count(b'\n') == 1, (lines, done)
        assert b'threads' in done.stderr or b'line 1' in done.stderr, (lines, done)


def test_reload_under_load():
    """Answers in progress keep the policy that they began with; every answer is one of the two that were valid."""
    token = write_token('token', 'first')
    with Server(FOLDER, '--token', token) as server:
        stop = threading.Event()

        def work():
            while not stop.is_set():
                status, head, _ = server.get('/v1/meshes/fin')
                assert status == 401
                statuses = {server.get('/v1/meshes/fin/prefix?level=1', Authorization='Bearer ' + word,
                                       X_Forwarded_For='1.1.1.%d' % i)[0] for i, word in enumerate(('first', 'second'))}
                assert statuses <= {200, 401, 429}

        with concurrent.futures.ThreadPoolExecutor(3) as pool:
            threads = [pool.submit(work) for _ in range(3)]
            for i in range(40):
                write_token('token', ('second', 'first')[i % 2])
                server.process.send_signal(signal.SIGHUP)
                time.sleep(0.02)
            stop.set()
            for thread in threads:
                thread.result()


os.makedirs(FOLDER, exist_ok=True)
subprocess.run([TETLOD, 'sample', 'fin', '--size', '6', '-o', 'fin.vtu'], cwd=SCRATCH, check=True)
subprocess.run([TETLOD, 'build', 'fin.vtu', '--field', 'Pressure', '-o', os.path.join(FOLDER, 'fin.tetlod'), '--quiet'],
               cwd=SCRATCH, check=True)
run([
    test_none_on_loopback, test_any_elsewhere, test_named_origins, test_host_on_loopback, test_token, test_way_in,
    test_cookies_of_several_servers, test_the_address_of_metrics, test_wrong_tokens_cost_time, test_forwarded_addresses,
    test_forwarded_addresses_and_guesses, test_reload, test_reload_under_load
])
