# SPDX-License-Identifier: BSD-3-Clause
"""The configurations in server/deploy, on loopback: failover behind nginx and Varnish, plain files, socket activation.
"""
import contextlib
import http.client
import json
import os
import re
import shutil
import socket
import ssl
import subprocess
import sys
import threading
import time
import urllib.parse

from served import PATIENCE, ROOT, SCRATCH, TETLOD, Server, eventually, free_port, run

sys.path.insert(0, os.path.join(ROOT, 'client-examples', 'python'))
import tetlod.reference as tetlod  # noqa: E402  the client that knows only Range

DEPLOY = os.path.join(ROOT, 'server', 'deploy')
FOLDER = os.path.join(SCRATCH, 'streams')
PATH = os.environ['PATH'] + ':/usr/sbin'
NGINX = shutil.which('nginx', path=PATH)
VARNISH = shutil.which('varnishd', path=PATH)
cid = None


def wait_for_port(port):
    def listens():
        with contextlib.suppress(OSError), socket.create_connection(('127.0.0.1', port), timeout=PATIENCE):
            return True

    eventually(listens)


def start_nginx(name, text):
    place = os.path.join(SCRATCH, name)
    os.makedirs(place, exist_ok=True)
    os.chmod(place, 0o755)
    configuration = os.path.join(place, 'nginx.conf')
    temporary = ''.join('%s_temp_path %s/%s; ' % (kind, place, kind) for kind in ('client_body', 'proxy', 'fastcgi',
                                                                                  'uwsgi', 'scgi'))
    user = 'root' if os.getuid() == 0 else ''
    text = re.sub(r'^user .*;', 'user %s;' % user if user else '', text, flags=re.M)
    text = text.replace('http {', 'http { ' + temporary, 1).replace('/run/nginx.pid', place + '/nginx.pid')
    text = text.replace('/var/log/nginx/tetlod.log', place + '/access.log').replace('/var/cache/nginx/tetlod',
                                                                                    place + '/cache')
    with open(configuration, 'w') as file:
        file.write('daemon off;\n' + text)
    return subprocess.Popen([NGINX, '-p', place, '-e', place + '/error.log', '-c', configuration])


def stop(process):
    process.terminate()
    process.wait(timeout=PATIENCE)


class Load:
    """Threads that ask for good things and count what is not 200."""

    def __init__(self, connect, paths):
        self.connect, self.paths, self.asked, self.lost, self.running = connect, paths, 0, [], True
        self.lock = threading.Lock()
        self.threads = [threading.Thread(target=self.work, args=(i,), daemon=True) for i in range(8)]
        for thread in self.threads:
            thread.start()

    def work(self, number):
        connection = self.connect()
        while self.running:
            number += 1
            path = self.paths[number % len(self.paths)]
            try:
                connection.request('GET', path)
                answer = connection.getresponse()
                answer.read()
                status = answer.status
            except (OSError, http.client.HTTPException) as error:
                status = repr(error)
                connection.close()
                connection = self.connect()
            with self.lock:
                self.asked += 1
                if status != 200:
                    self.lost.append((path, status))
        connection.close()

    def go_on(self):
        """Waits until 200 more were asked."""
        before = self.asked
        eventually(lambda: self.asked > before + 200)

    def finish(self):
        self.running = False
        for thread in self.threads:
            thread.join()


def paths_of(described, salt):
    at = '/v1/meshes/fin/%s' % described['cid']
    last = len(described['levels']) - 1
    return (['/v1/meshes', '/v1/meshes/fin'] + ['%s/levels/%d/mesh.vtu' % (at, k) for k in range(0, last, 5)] +
            ['%s/records/%d-%d?fields=%s' % (at, k, last, salt) for k in range(0, last, 4)])


def answers_of(server):
    counted = re.findall(rb'^tetlod_requests_total{route="(?!/metrics).*} (\d+)$', server.get('/metrics')[2], re.M)
    return sum(map(int, counted))


def fail_over(start_front, connect):
    """Loads two servers behind a front, kills one without warning, starts it again, stops the other: nothing is lost.
    """
    ports = free_port(), free_port()
    servers = [Server(FOLDER, listen='127.0.0.1:%d' % port) for port in ports]
    described = servers[0].json('/v1/meshes/fin')
    front = None
    try:
        front, port = start_front(ports)
        load = Load(lambda: connect(port), paths_of(described, 'Pressure'))
        load.go_on()
        servers[0].process.kill()
        servers[0].process.wait()
        load.go_on()
        servers[0] = Server(FOLDER, listen='127.0.0.1:%d' % ports[0])
        time.sleep(3.5)  # longer than a server counts as gone
        eventually(lambda: answers_of(servers[0]) > 10)  # it is trusted again
        servers[1].stop()
        load.go_on()
        load.finish()
        assert not load.lost, (len(load.lost), load.asked, load.lost[:5])
    finally:
        if front:
            stop(front)
        for server in servers:
            server.process.kill()
            server.process.wait()


def test_nginx_fails_over():
    if not NGINX or not shutil.which('openssl'):
        return 'no nginx or no openssl'
    key, certificate = os.path.join(SCRATCH, 'key.pem'), os.path.join(SCRATCH, 'certificate.pem')
    subprocess.run(['openssl', 'req', '-x509', '-newkey', 'rsa:2048', '-nodes', '-keyout', key, '-out', certificate,
                    '-days', '2',
                    '-subj', '/CN=localhost'], check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)

    def start_front(ports):
        with open(os.path.join(DEPLOY, 'nginx.conf')) as file:
            text = file.read()
        port = free_port()
        text = text.replace('listen 80;', 'listen 127.0.0.1:%d;' % free_port()).replace('listen 443 ',
                                                                                        'listen 127.0.0.1:%d ' % port)
        text = text.replace('127.0.0.1:8081', '127.0.0.1:%d' % ports[0]).replace('127.0.0.1:8082',
                                                                                 '127.0.0.1:%d' % ports[1])
        text = text.replace('/etc/ssl/certs/tetlod.pem', certificate).replace('/etc/ssl/private/tetlod.key', key)
        text = text.replace('proxy_connect_timeout 1s',
                            'proxy_connect_timeout 60s')  # on a slow machine a server may be slow and yet well
        process = start_nginx('front', text)
        wait_for_port(port)
        check_cache(port)
        return process, port

    def connect(port):
        return http.client.HTTPSConnection('127.0.0.1', port, timeout=PATIENCE,
                                           context=ssl._create_unverified_context())

    def ask(port, path, **headers):
        connection = connect(port)
        connection.request('GET', path, headers=headers)
        answer = connection.getresponse()
        body = answer.read()
        connection.close()
        return answer, body

    def check_cache(port):
        with open(os.path.join(FOLDER, 'fin.tetlod'), 'rb') as file:
            stream = file.read()
        at = '/v1/meshes/fin/%s' % cid
        for expected in ('MISS', 'HIT'):
            answer, body = ask(port, at + '/levels/3/mesh.vtu')
            assert answer.status == 200 and answer.getheader('X-Cache') == expected, (answer.status,
                                                                                      answer.getheader('X-Cache'))
        answer, body = ask(port, at + '/stream', Range='bytes=10-29')
        assert answer.status == 206 and body == stream[10:30], answer.status
        answer, body = ask(port, at + '/stream')
        assert answer.status == 200 and body == stream
        assert ask(port, '/metrics')[0].status == 404
        answer, _ = ask(port, '/v1/meshes/fin/mesh?error=0.1')
        assert answer.status == 303 and answer.getheader('Location').startswith(cid + '/levels/')

    fail_over(start_front, connect)


def urls_of(node):
    """All links of a JSON answer."""
    if isinstance(node, dict):
        yield from node.get('links', {}).values()
        for value in node.values():
            yield from urls_of(value)
    elif isinstance(node, list):
        for value in node:
            yield from urls_of(value)


def check_under(port, root):
    """Every URL that the API and the page's files name leads to where the site is."""
    def get(url, method='GET'):
        connection = http.client.HTTPConnection('127.0.0.1', port, timeout=PATIENCE)
        connection.request(method, url)
        answer = connection.getresponse()
        body = answer.read()
        connection.close()
        return answer, body

    for path in ('v1/meshes', 'v1/meshes/fin'):
        answer, body = get(root + path)
        assert answer.status == 200, (path, answer.status)
        links = list(urls_of(json.loads(body)))
        assert links, path
        for link in links:
            link = re.sub(r'\{\?.*\}', '', link)
            for name, value in (('level', '1'), ('format', 'vtu' if '/mesh' in link else 'stl'), ('from', '0'),
                                ('to', '1')):
                link = link.replace('{%s}' % name, value)
            query = {'mesh': '?level=1', 'prefix': '?level=1', 'isosurface.stl': '?field=Pressure&value=1',
                     'slice.stl': '?origin=0,0,1&normal=0,0,1'}
            url = urllib.parse.urljoin(root + path, link) + query.get(link.rpartition('/')[2], '')
            assert url.startswith(root) and get(url)[0].status in (200, 303), (path, link, url, get(url)[1])
    answer, _ = get(root + 'v1/meshes/fin/mesh?error=0.1')
    target = urllib.parse.urljoin(root + 'v1/meshes/fin/mesh', answer.getheader('Location'))
    assert answer.status == 303 and target.startswith(root) and get(target)[0].status == 200, target
    for page in ('', 'view/fin'):
        answer, body = get(root + page)
        assert answer.status == 200, page
        described = re.match('<(.*?)>', answer.getheader('Link'))[1]
        assert urllib.parse.urljoin(root + page, described) == root + 'openapi.json'
        loaded = re.findall(rb'(?:href|src)="([^"#]*)"', body)
        assert len(loaded) > 3
        for link in loaded:
            url = urllib.parse.urljoin(root + page, link.decode())
            assert url.startswith(root) and get(url)[0].status == 200, (page, link)
    answer, body = get(root + 'v1/meshes/nothing?x=1')
    assert urllib.parse.urljoin(root + 'v1/meshes/nothing',
                                json.loads(body)['instance']) == root + 'v1/meshes/nothing?x=1'


def test_under_a_path():
    """A proxy that takes the path off, one that leaves it, and a base path without a proxy."""
    if not NGINX:
        return 'no nginx'
    with Server(FOLDER) as plain, Server(FOLDER, '--base-path', '/deep/er/') as based:
        assert based.url.endswith('/deep/er/')
        port = free_port()
        process = start_nginx(
            'paths', 'user x;\npid /run/nginx.pid;\nevents { }\nhttp { access_log off; server { listen 127.0.0.1:%d;\n'
            'location /some/prefix/ { proxy_pass http://127.0.0.1:%d/; }\n'
            'location /deep/er/ { proxy_pass http://127.0.0.1:%d; }\n'
            'location /stripped/ { proxy_pass http://127.0.0.1:%d/; } } }\n' %
            (port, plain.address[1], based.address[1], based.address[1]))
        try:
            wait_for_port(port)
            check_under(port, '/some/prefix/')
            check_under(port, '/deep/er/')
            check_under(port, '/stripped/')
        finally:
            stop(process)
        check_under(based.address[1], '/deep/er/')
        check_under(plain.address[1], '/')
        status, head, _ = based.get('/deep/er')
        assert status == 308 and urllib.parse.urljoin('/deep/er', head['location']) == '/deep/er/'
        assert based.get('/deep/erx')[0] == based.get('/deep')[0] == 404
    for bad in ('x/', '/x', '/', '//x/', '/a b/', '/x"/'):
        done = subprocess.run([TETLOD, 'serve', FOLDER, '--listen', '127.0.0.1:0', '--base-path', bad],
                              stderr=subprocess.PIPE)
        assert done.returncode == 2 and b'base path' in done.stderr, (bad, done)


def test_varnish_fails_over():
    if not VARNISH:
        return 'no varnishd'
    place = os.path.join('/tmp', 'tetlod-varnish-%d' % os.getpid())  # its sockets' paths must be short

    try:
        fail_over(lambda ports: start_varnish(ports, place),
                  lambda port: http.client.HTTPConnection('127.0.0.1', port, timeout=PATIENCE))
    finally:
        shutil.rmtree(place, ignore_errors=True)


def start_varnish(ports, place):
    with open(os.path.join(DEPLOY, 'varnish.vcl')) as file:
        text = file.read().replace('"8081"', '"%d"' % ports[0]).replace('"8082"', '"%d"' % ports[1])
        text = text.replace('timeout = 1s;', 'timeout = 60s;')  # on a slow machine a server may be slow and yet well
    vcl, port = os.path.join(SCRATCH, 'test.vcl'), free_port()
    with open(vcl, 'w') as file:
        file.write(text)
    process = subprocess.Popen([VARNISH, '-F', '-j', 'none', '-n', place, '-a', '127.0.0.1:%d' % port, '-f', vcl, '-s',
                                'malloc,32m'],
                               stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    wait_for_port(port)
    return process, port


def check_tokens(ask, server, from_cache):
    """What is asked for with a token is never anybody else's, whoever came first; and each client is known by its own
    address."""
    at = '/v1/meshes/fin/%s' % cid
    bearer = {'Authorization': 'Bearer the-secret'}
    eventually(lambda: ask('/healthz')[0] == 200)  # the front has seen that the server is well
    cookie = {'Cookie': 'a=b; ' + ask('/?token=the-secret')[1]['Set-Cookie'].split(';')[0]}
    for path in (at + '/stream', at + '/levels/2/mesh.vtu', at + '/records/0-3', '/v1/meshes',
                 '/v1/meshes/fin/prefix?level=2', '/view/fin'):
        for headers, status in ((bearer, 200), ({}, 401), (cookie, 200), ({}, 401), ({'Cookie': 'other=1'}, 401),
                                (bearer, 200), ({'Authorization': 'Bearer x'}, 401)):
            found, head, body = ask(path, **headers)
            assert found == status and not from_cache(head), (path, headers, found, head)
            assert (status != 200 or path[:11] != '/v1/meshes/' or 'private' in head['Cache-Control']
                    or 'no-cache' in head['Cache-Control']), head
    assert ask('/metrics', **bearer)[0] == 404
    ask('/healthz', **{'X-Forwarded-For': '1.2.3.4'})
    eventually(lambda: '"remote": "1.2.3.4"' in server.messages())


def token_server(port):
    path = os.path.join(SCRATCH, 'the-token')
    with open(path, 'w') as file:
        file.write('the-secret')
    return Server(FOLDER, '--token', path, '--access-log', '--trust-proxy', '127.0.0.1', listen='127.0.0.1:%d' % port)


def plain(port, path, **headers):
    connection = http.client.HTTPConnection('127.0.0.1', port, timeout=PATIENCE)
    connection.request('GET', path, headers=headers)
    answer = connection.getresponse()
    body = answer.read()
    connection.close()
    return answer.status, answer.headers, body


def test_varnish_and_tokens():
    if not VARNISH:
        return 'no varnishd'
    place = os.path.join('/tmp', 'tetlod-tokens-%d' % os.getpid())
    ports = free_port(), free_port()
    process = None
    try:
        with token_server(ports[0]) as server:
            process, port = start_varnish(ports, place)
            check_tokens(lambda path, **headers: plain(port, path, **headers), server,
                         lambda head: ' ' in head['X-Varnish'])
        with Server(FOLDER, listen='127.0.0.1:%d' % ports[0]):  # without token it keeps what it kept
            eventually(lambda: plain(port, '/healthz')[0] == 200)
            heads = [plain(port, '/v1/meshes/fin/%s/levels/3/mesh.vtu' % cid)[1] for _ in range(2)]
            assert ' ' in heads[1]['X-Varnish'], [dict(head) for head in heads]
    finally:
        if process:
            stop(process)
        shutil.rmtree(place, ignore_errors=True)


def test_nginx_and_tokens():
    if not NGINX:
        return 'no nginx'
    ports, port = (free_port(), free_port()), free_port()
    with open(os.path.join(DEPLOY, 'nginx.conf')) as file:
        text = file.read()
    text = text.replace('listen 80;', 'listen 127.0.0.1:%d;' % free_port()).replace('listen 443 ssl http2;',
                                                                                    'listen 127.0.0.1:%d;' % port)
    text = re.sub(r'^ *ssl_.*\n', '', text, flags=re.M)
    text = text.replace('127.0.0.1:8081', '127.0.0.1:%d' % ports[0]).replace('127.0.0.1:8082',
                                                                             '127.0.0.1:%d' % ports[0])
    with token_server(ports[0]) as server:
        process = start_nginx('tokens', text)
        try:
            wait_for_port(port)
            check_tokens(lambda path, **headers: plain(port, path, **headers), server,
                         lambda head: head.get('X-Cache') == 'HIT')
        finally:
            stop(process)


def test_plain_files():
    """What explode lays out, sent by nginx alone: the same bytes at the same paths."""
    www = os.path.join(SCRATCH, 'www')
    subprocess.run([TETLOD, 'explode', FOLDER, '-o', www, '--meshes'], check=True)
    with Server(FOLDER) as server:
        described = server.json('/v1/meshes/fin')
        at = '/v1/meshes/fin/' + described['cid']
        paths = [at + '/stream', at + '/levels/0/mesh.tetlod', at + '/records/0-1', at + '/records/7-8']
        wanted = {path: server.get(path)[2] for path in paths}
        catalogue = server.json('/v1/meshes')
        opening = server.get('/v1/meshes/fin/prefix?bytes=32K')[2]
    for path, body in wanted.items():
        with open(www + path, 'rb') as file:
            assert file.read() == body, path
    assert os.path.getsize('%s%s/levels/%d/mesh.vtu' % (www, at, len(described['levels']) - 1)) > 1000
    if not NGINX:
        return 'files are as served; no nginx to send them'
    port = free_port()
    with open(os.path.join(DEPLOY, 'nginx-static.conf')) as file:
        text = file.read().replace('listen 8080', 'listen 127.0.0.1:%d' % port).replace('/srv/tetlod', www)
    process = start_nginx('static', 'user x;\npid /run/nginx.pid;\nevents { }\nhttp { access_log off;\n%s}\n' % text)
    try:
        wait_for_port(port)

        def ask(path, method='GET', **headers):
            connection = http.client.HTTPConnection('127.0.0.1', port, timeout=PATIENCE)
            connection.request(method, path, headers=headers)
            answer = connection.getresponse()
            body = answer.read()
            connection.close()
            return answer, body

        assert json.loads(ask('/v1/meshes')[1]) == catalogue and json.loads(ask('/v1/meshes/fin')[1]) == described
        assert ask('/v1/meshes/fin')[0].getheader('Content-Type') == 'application/json'
        for path, body in wanted.items():
            answer, got = ask(path)
            assert answer.status == 200 and got == body and 'immutable' in answer.getheader('Cache-Control'), path
            assert answer.getheader('Access-Control-Allow-Origin') == '*'
        client = tetlod.open('http://127.0.0.1:%d%s/stream' % (port, at)).cursor()
        for level in (0, 4, 2):
            client.seek(level)
            assert len(client.tets) == described['levels'][level]['tets']
        answer, body = ask('/v1/meshes/fin/prefix?error=0.01')
        assert answer.status == 200 and body == opening and answer.getheader('Cache-Control') == 'no-cache'
        answer, body = ask(paths[0], Range='bytes=5-9')
        assert answer.status == 206 and body == wanted[paths[0]][5:10]
        assert ask('/v1/meshes/nothing')[0].status == 404
    finally:
        stop(process)


def test_socket_activation():
    """systemd's protocol: a listening descriptor 3, LISTEN_FDS and LISTEN_PID; READY=1 on NOTIFY_SOCKET."""
    notify_path = os.path.join('/tmp', 'tetlod-notify-%d' % os.getpid())
    with socket.socket() as listening, socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as notify:
        listening.bind(('127.0.0.1', 0))
        listening.listen()
        notify.bind(notify_path)
        notify.settimeout(PATIENCE)
        script = 'exec 3<&%d; LISTEN_PID=$$ LISTEN_FDS=1 exec "$0" "$@"' % listening.fileno()
        process = subprocess.Popen(['bash', '-c', script, TETLOD, 'serve', FOLDER, '--quiet'],
                                   pass_fds=[listening.fileno()],
                                   stdout=subprocess.PIPE, env=dict(os.environ, NOTIFY_SOCKET=notify_path))
        try:
            assert notify.recv(100) == b'READY=1'
            assert process.stdout.readline() == b'http://127.0.0.1:%d/\n' % listening.getsockname()[1]
            connection = http.client.HTTPConnection(*listening.getsockname(), timeout=PATIENCE)
            connection.request('GET', '/healthz')
            assert connection.getresponse().status == 200
            connection.close()
            process.terminate()
            assert notify.recv(100) == b'STOPPING=1' and process.wait(timeout=PATIENCE) == 0
        finally:
            process.kill()
            process.wait()
            os.unlink(notify_path)


def test_unit_files():
    if not shutil.which('systemd-analyze'):
        return 'no systemd-analyze'
    place = os.path.join(SCRATCH, 'units')
    os.makedirs(place, exist_ok=True)
    for name in ('tetlod.service', 'tetlod.socket'):
        with open(os.path.join(DEPLOY, name)) as file:
            text = file.read().replace('/usr/local/bin/tetlod', TETLOD)
        with open(os.path.join(place, name), 'w') as file:
            file.write(text)
    done = subprocess.run(['systemd-analyze', 'verify', '--man=no', os.path.join(place, 'tetlod.service')],
                          stdout=subprocess.PIPE,
                          stderr=subprocess.STDOUT)
    assert done.returncode == 0 and b'tetlod' not in done.stdout, done.stdout


os.makedirs(FOLDER, exist_ok=True)
subprocess.run([TETLOD, 'sample', 'fin', '--size', '8', '-o', 'fin.vtu'], cwd=SCRATCH, check=True)
subprocess.run([TETLOD, 'build', 'fin.vtu', '--field', 'Pressure', '-o', os.path.join(FOLDER, 'fin.tetlod'), '--quiet'],
               cwd=SCRATCH, check=True)
with Server(FOLDER) as first:
    cid = first.json('/v1/meshes/fin')['cid']
run([test_nginx_fails_over, test_under_a_path, test_varnish_fails_over, test_varnish_and_tokens, test_nginx_and_tokens,
     test_plain_files, test_socket_activation, test_unit_files])
