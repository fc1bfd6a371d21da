# SPDX-License-Identifier: BSD-3-Clause
"""Who may read: other origins (CORS), other names for loopback (rebinding), the token."""
import glob
import os
import re
import socket
import subprocess

from served import ROOT, SCRATCH, TETLOD, Server, run

FOLDER = os.path.join(SCRATCH, 'streams')
PATHS = ('/', '/v1/meshes', '/v1/meshes/fin', '/v1/meshes/fin/prefix?level=0', '/nothing', '/metrics')


# All that answers say of meshes, as the sources have it.
OWN = tuple({name for folder in ('answer', 'net') for source in glob.glob(os.path.join(ROOT, 'server', folder, '*.c'))
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
                assert not [name for name in head if name.startswith('access-control') or name == 'timing-allow-origin'], (path, head)
                assert head['cross-origin-resource-policy'] == 'same-origin'


def test_any_elsewhere():
    with Server(FOLDER, listen='0.0.0.0:0') as server:
        for path in PATHS:
            head = server.get(path, Origin='http://elsewhere', Host='anything.example')[1]
            assert head['access-control-allow-origin'] == head['timing-allow-origin'] == '*' and head['cross-origin-resource-policy'] == 'cross-origin'
            for name in ('ETag', 'Content-Range', 'Server-Timing', 'Location') + OWN:
                assert name in head['access-control-expose-headers'].split(', '), name


def test_named_origins():
    with Server(FOLDER, '--cors', 'https://a.example', '--cors', 'http://b.example:8000') as server:
        for origin in ('https://a.example', 'http://b.example:8000'):
            assert allowed(server, origin) == origin
            head = server.get('/v1/meshes', 'OPTIONS', Origin=origin, Access_Control_Request_Method='GET')[1]
            assert 'GET' in head['access-control-allow-methods'] and 'Range' in head['access-control-allow-headers'] and int(head['access-control-max-age']) > 0
        for origin in ('http://a.example', 'https://a.example.evil', 'https://a.example:1', 'null', ''):
            assert allowed(server, origin) is None, origin
            assert 'Origin' in server.get('/healthz', Origin=origin)[1]['vary']
    with Server(FOLDER, '--cors', '*') as server:
        assert allowed(server, 'https://x') == '*'
    with Server(FOLDER, '--cors', 'none', listen='0.0.0.0:0') as server:
        assert allowed(server, 'https://x') is None
    for bad in ('example.org', 'https://*', 'ftp://x', ''):
        done = subprocess.run([TETLOD, 'serve', FOLDER, '--listen', '127.0.0.1:0', '--cors', bad], stderr=subprocess.PIPE)
        assert done.returncode == 2 and b'origin' in done.stderr, (bad, done)


def test_host_on_loopback():
    with Server(FOLDER, '--host', 'proxy.example') as server:
        for host in ('localhost', 'LOCALHOST:80', 'a.localhost', '127.0.0.1', '127.1.2.3:9', '[::1]', '[::1]:80', 'proxy.example', 'Proxy.example:443'):
            assert server.get('/v1/meshes', Host=host)[0] == 200, host
        for host in ('evil.example', 'localhost.evil.example', 'notlocalhost', '127.0.0.1.evil.example', '127.evil.example', '[::2]', '[::1', '', 'x', '10.0.0.1',
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


def test_token():
    path, secret = os.path.join(SCRATCH, 'token'), 'a-Secret_0123456789'
    with open(path, 'w') as file:
        file.write(secret + '\n')
    with Server(FOLDER, '--token', path, '--metrics', '127.0.0.1:0', '--access-log', '--base-path', '/x/') as server:
        for asked in PATHS + ('/openapi.json', '/v1/meshes?token=wrong', '/?token='):
            for headers in ({}, {'Authorization': 'Bearer wrong'}, {'Authorization': 'Bearer ' + secret + 'x'}, {'Authorization': 'Bearer ' + secret[:-1]},
                            {'Authorization': 'Basic ' + secret}, {'Cookie': 'tetlod_token=' + secret[:-1]}, {'Cookie': 'xtetlod_token=' + secret}):
                status, head, body = server.get(asked, **headers)
                assert status == 401 and head['www-authenticate'] == 'Bearer' and secret.encode() not in body, (asked, headers, status)
        for asked in ('/healthz', '/readyz'):
            assert server.get(asked)[0] == 200
        assert server.get('/v1/meshes', Authorization='Bearer ' + secret)[0] == server.get('/v1/meshes', Authorization='bearer  ' + secret)[0] == 200
        assert server.get('/v1/meshes', Authorization='Bearer ' + secret, Host='proxy.example')[0] == 200  # an attacker has no token
        status, head, _ = server.get('/view/fin?a=1&token=%s&b=2' % secret)
        assert status == 303 and head['location'] == './fin?a=1&b=2' and 'HttpOnly' in head['set-cookie'] and 'Path=/x/;' in head['set-cookie'], head
        cookie = head['set-cookie'].split(';')[0]
        assert server.get('/view/fin?a=1&t%%6fken=%s&&b=2' % secret)[1]['location'] == './fin?a=1&b=2'  # however the name is written
        assert server.get('/x/view/fin', Cookie='other=1; ' + cookie + '; more=2')[0] == 200
        status, head, _ = server.get('/v1/meshes/fin/mesh?level=0', Cookie=cookie)
        assert status == 303
        cid = server.json('/v1/meshes/fin', Cookie=cookie)['cid']
        head = server.get('/v1/meshes/fin/%s/levels/0/mesh.vtu' % cid, Cookie=cookie)[1]
        assert head['cache-control'].startswith('private,') and 'immutable' in head['cache-control']
        assert server.get('/v1/meshes', 'OPTIONS')[0] == 204  # preflights carry no token
        server.stop()
        assert secret not in server.messages() and 'token=*' in server.messages() and 't%6fken=*' in server.messages()
    for text in ('', ' \n', 'two words', 'line\nline', 'x' * 300, 'a;b'):
        with open(path, 'w') as file:
            file.write(text)
        done = subprocess.run([TETLOD, 'serve', FOLDER, '--listen', '127.0.0.1:0', '--token', path], stderr=subprocess.PIPE)
        assert done.returncode == 2 and b'token' in done.stderr and path.encode() in done.stderr, (text, done)
    done = subprocess.run([TETLOD, 'serve', FOLDER, '--token', path + '-none'], stderr=subprocess.PIPE)
    assert done.returncode == 1 and path.encode() in done.stderr


os.makedirs(FOLDER, exist_ok=True)
subprocess.run([TETLOD, 'sample', 'fin', '--size', '6', '-o', 'fin.vtu'], cwd=SCRATCH, check=True)
subprocess.run([TETLOD, 'build', 'fin.vtu', '-o', os.path.join(FOLDER, 'fin.tetlod'), '--quiet'], cwd=SCRATCH, check=True)
run([test_none_on_loopback, test_any_elsewhere, test_named_origins, test_host_on_loopback, test_token])
