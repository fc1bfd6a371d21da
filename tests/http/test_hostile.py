# SPDX-License-Identifier: BSD-3-Clause
"""Malformed and hostile requests from a seeded generator (HOSTILE=1000000 for many, SEED=n for others): never a crash, a hang or a
file outside the catalogue, and every answer is one that HTTP knows. A good request is answered throughout."""
import os
import random
import re
import socket
import subprocess
import threading
import time

from served import PATIENCE, SCRATCH, SLOW, TETLOD, Server, eventually, run

COUNT = int(os.environ.get('HOSTILE', '20000' if SLOW == 1 else '2000'))
SEED = int(os.environ.get('SEED', '1'))
FOLDER = os.path.join(SCRATCH, 'streams')
MARK = b'never-to-be-sent'
KNOWN = {100, 200, 204, 206, 303, 304, 308, 400, 404, 405, 411, 413, 414, 416, 421, 422, 431, 500, 501, 503, 505}
server = None


class Generator:
    def __init__(self, seed, cid):
        self.random = random.Random(seed)
        at = '/v1/meshes/fin/%s' % cid
        self.paths = ['/', '/catalogue.css', '/healthz', '/metrics', '/v1/meshes', '/v1/meshes/fin', '/v1/meshes/fin/mesh?error=0.1', at + '/stream',
                      at + '/records/0-3', at + '/levels/2/mesh.vtu', at + '/levels/2/surface.vtp',
                      at + '/levels/2/isosurface.stl?field=Pressure&value=2', at + '/levels/2/slice.glb?origin=0,0,1&normal=0,0,1']
        self.pieces = ['..', '%2e%2e', '%2f', '%00', '%', '%zz', '//', '/', '\\', '?', '&', '=', '#', '%ff', '%c0%af', 'a' * 200, '\x7f', '-1',
                       '99999999999999999999', 'nan', '1e999', ',', ';', '"', "'", '<', '{id}', '*', '../secret', '/etc/passwd', '%0d%0aX: y']
        self.headers = ['Range: bytes=%s', 'If-Range: %s', 'If-None-Match: %s', 'Accept-Encoding: %s', 'Host: %s', 'Connection: %s',
                        'Content-Length: %s', 'Transfer-Encoding: %s', 'Expect: %s', 'X-Request-Id: %s', 'Cookie: %s', 'Upgrade: %s', '%s: a', '%s',
                        'Accept: %s', 'Origin: %s', 'Authorization: %s']
        self.values = ['', '0-', '-1', '0-0,5-9', '9-1', '*', '"x"', 'W/"', 'gzip;q=2', 'zstd;q=0.5,*', '100-continue', 'chunked', 'close', 'x' * 300,
                       '5', '-5', '0x5', 'keep-alive, upgrade', 'h2c', '\t', '\x01', 'bytes=0-1',
                       'text/html', 'https://a.example', 'null', 'Bearer x', 'tetlod_token=x']

    def target(self):
        r = self.random
        path = list(r.choice(self.paths))
        for _ in range(r.choice((0, 0, 1, 1, 2, 4))):
            place = r.randrange(len(path) + 1)
            kind = r.randrange(4)
            if kind == 0 and path:
                del path[min(place, len(path) - 1)]
            elif kind == 1:
                path[place:place] = r.choice(self.pieces)
            elif kind == 2 and path:
                path[min(place, len(path) - 1)] = chr(r.randrange(33, 256))
            else:
                path[place:] = path[place:] + path[:place]
        return ''.join(path)

    def request(self):
        r = self.random
        target = self.target() if r.random() < 0.98 else r.choice(('\0', '', '*', 'x', '?', 'http:', 'https://', '\0/healthz'))
        method = r.choice(('GET', 'GET', 'GET', 'HEAD', 'OPTIONS', 'POST', 'FOO', '', 'G\x00T'))
        version = r.choice(('HTTP/1.1',) * 6 + ('HTTP/1.0', 'HTTP/2.0', 'HTTP/1.', 'XTTP/1.1', ''))
        lines = ['%s %s %s' % (method, target, version)]
        if r.random() < 0.9:
            lines.append('Host: localhost')
        for _ in range(r.choice((0, 0, 1, 2, 5))):
            header = r.choice(self.headers)
            lines.append(header % r.choice(self.values))
        text = r.choice(('\r\n',) * 8 + ('\n', '\r')).join(lines) + '\r\n\r\n'
        data = text.encode('latin-1')
        damage = r.random()
        if damage < 0.1:
            data = bytearray(data)
            for _ in range(r.randrange(1, 6)):
                data[r.randrange(len(data))] = r.randrange(256)
            data = bytes(data)
        elif damage < 0.13:
            data = data[:r.randrange(len(data))]
        elif damage < 0.15:
            data = data + data
        elif damage < 0.16:
            data = bytes(r.randrange(256) for _ in range(r.randrange(1, 400)))
        return data


def drain(connection, seconds):
    """What comes until nothing comes for some time, or the end."""
    received = b''
    connection.settimeout(seconds)
    try:
        while some := connection.recv(1 << 20):
            received += some
    except (socket.timeout, ConnectionResetError):
        pass
    return received


def attack(seed, cid, count, found, problems):
    generator = Generator(seed, cid)
    sent = 0
    while sent < count:
        # many to a connection: the server closes it at the first that is broken, the rest is lost on it
        batch = [generator.request() for _ in range(generator.random.choice((1, 1, 1, 2, 5)))]
        try:
            with server.connect() as connection:
                connection.settimeout(PATIENCE)
                for data in batch:
                    connection.sendall(data)
                connection.shutdown(socket.SHUT_WR)
                received = drain(connection, 0.005)
        except OSError:  # it was closed while we were sending
            received = b''
        sent += len(batch)
        if MARK in received or b'root:x:' in received:
            problems.append(('a file leaked', batch))
        found['HTML'] = found.get('HTML', 0) + received.count(b'<html><head>')  # libmicrohttpd's own: test_protocol.py
        found['connections'] = found.get('connections', 0) + 1
        for status in re.findall(rb'(?:^|\n)HTTP/1\.[01] (\d+) ', received):
            found[int(status)] = found.get(int(status), 0) + 1
            if int(status) not in KNOWN:
                problems.append((status, batch))


def descriptors():
    return len(os.listdir('/proc/%d/fd' % server.process.pid))


def test_hostile_requests():
    cid = server.json('/v1/meshes/fin')['cid']
    found, problems, threads = {}, [], []
    before = descriptors()
    workers = 8
    started = time.monotonic()
    for i in range(workers):
        threads.append(threading.Thread(target=attack, args=(SEED * 1000 + i, cid, COUNT // workers, found, problems)))
        threads[-1].start()
    slowest = 0
    while any(thread.is_alive() for thread in threads):
        start = time.monotonic()
        assert server.get('/v1/meshes/fin')[0] == 200
        slowest = max(slowest, time.monotonic() - start)
        time.sleep(0.1)
    for thread in threads:
        thread.join()
    print('# %d requests in %.0f s, seed %d: %s; a good one waited %.0f ms at most' % (
        COUNT, time.monotonic() - started, SEED, ', '.join('%s: %d' % pair for pair in sorted(found.items(), key=str)), slowest * 1e3))
    assert not problems, problems[:3]
    assert server.process.poll() is None and server.get('/healthz')[0] == 200
    eventually(lambda: descriptors() <= before)  # none of the connections hangs: after the time-out they are gone
    answered = set(re.findall(rb'^tetlod_requests_total{.*status="(\d+)"}', server.get('/metrics')[2], re.M))
    assert {b'200', b'400', b'404', b'405'} <= answered, answered  # it was not all thrown away


def test_it_ends_well():
    """All connections were let go of, nothing leaked: stopping waits for nobody, and sanitizers are silent."""
    server.stop()


os.makedirs(FOLDER, exist_ok=True)
with open(os.path.join(SCRATCH, 'secret'), 'wb') as secret:
    secret.write(MARK)
subprocess.run([TETLOD, 'sample', 'fin', '--size', '6', '-o', 'fin.vtu'], cwd=SCRATCH, check=True)
subprocess.run([TETLOD, 'build', 'fin.vtu', '-o', os.path.join(FOLDER, 'fin.tetlod'), '--quiet'], cwd=SCRATCH, check=True)
with Server(FOLDER, '--timeout', '2', '--drain', '1000') as server:
    run([test_hostile_requests, test_it_ends_well])
