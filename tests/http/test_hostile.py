# SPDX-License-Identifier: BSD-3-Clause
"""Malformed and hostile requests from a seeded grammar (HOSTILE=500000 for many, SEED=n for others), of every path,
parameter and header that the server heeds: never a crash, a hang, a file outside the catalogue or an answer without the
token. Every answer is one that HTTP knows, and every refusal is whole. A good request is answered throughout."""
import os
import random
import re
import shutil
import socket
import subprocess
import threading
import time

import described
from served import ROOT, SCRATCH, SLOW, TETLOD, Server, answers, eventually, run

COUNT = int(os.environ.get('HOSTILE', '20000' if SLOW == 1 else '4000'))
SEED = int(os.environ.get('SEED', '1'))
FOLDER = os.path.join(SCRATCH, 'streams')
MARK = b'never-to-be-sent'
TOKEN = 'a-Secret_0123456789'
KNOWN = {100, 200, 204, 206, 303, 304, 308, 400, 401, 404, 405, 411, 413, 414, 416, 421, 422, 429, 431, 500, 501, 503,
         505}
LAST = b'GET /healthz HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n'
QUIET = 0.2  # seconds for which a connection may say nothing before it is given up

ODD = [
    '', '..', '%2e%2e', '%2f', '%00', '%', '%zz', '//', '\\', '?', '&', '=', '#', '%ff', '%c0%af', 'a' * 200, '\x7f',
    '-1', '0', '1', '7', '99999999999999999999', 'nan', '1e999', '-0', '0x1', '1.5', ',', ';', '"', "'", '<', '{id}',
    '*', '../secret', '/etc/passwd', '%0d%0aX:%20y', '+', '%2B', '\xe9', '\xc3\xa9', '\x01', '1,2,3', '0,0,0,1,1,1',
    ',,', 'all', 'Pressure', 'vtu', 'K', '1%', '1%25'
]
GOOD = {
    'format': ['vtu', 'vtk', 'tetlod', 'vtp', 'stl',
               'glb'], 'fields': ['Pressure', 'Pressure,Velocity', ''], 'field': ['Pressure', 'Velocity:0', 'material'],
    'cells': ['all', 'material', 'part,strain'], 'measure': ['max', 'sampled', 'rms', 'predicted'],
    'error': ['0', '0.01', '1', '5%25'], 'abs_error': ['0.1'], 'tets': ['100', '1K'], 'bytes': ['9000', '1M'],
    'value': ['2', '0.5'], 'origin': ['0,0,1'], 'normal': ['0,0,1'], 'box': ['0,0,0,1,1,1', '0,0,0,9,9,9;1,1,1,2,2,2'],
    'box_error': ['0', '0.1%25'], 'time': ['0.5'], 'token': [TOKEN[:-1], TOKEN + 'x']
}
NUMBERS = ['0', '0', '0', '1', '1', '2', '8']
FRAMING = ('Content-Length', 'Transfer-Encoding', 'Host', 'Expect')  # most of these end the connection: they are rarer
# Values of headers: pieces, of which some are put together
HEADERS = {
    'Accept': ['text/html', '*/*', 'application/json', ';q=0', ';q=x', ',', 'text/*'],
    'Accept-Encoding': ['gzip', 'zstd', 'br', 'identity', '*', ';q=0', ';q=0.5', ';q=2', ';', ',', ' '],
    'Access-Control-Request-Method': ['GET', 'POST', ''],
    'Access-Control-Request-Headers': ['range', 'authorization', ',', 'x'],
    'Authorization': ['Bearer ', 'bearer  ', 'Basic ', TOKEN[:-1], TOKEN + 'x', 'x', '=', ' ', ','],
    'Connection': ['close', 'keep-alive', 'upgrade', ',', 'x'],
    'Content-Length': ['0', '5', '-5', '0x5', '+', '99999999999999999999', ','],
    'Cookie': ['tetlod_token', '=', '; ', TOKEN[:-1], 'a=b', '"', ',', ';;;'],
    'Expect': ['100-continue', 'x'],
    'Forwarded': ['for=1.2.3.4', ';', 'proto=https', '"'],
    'Host': ['localhost', ':80', '[::1]', '127.0.0.1', 'evil.example', '[', ':', '@', ' '],
    'If-Modified-Since': ['Sat, 01 Jan 2000 00:00:00 GMT', 'x'],
    'If-None-Match': ['*', '"x"', 'W/', '"', ', ', 'CID', '-0-'],
    'If-Range': ['"x"', 'W/', '*', 'Sat, 01 Jan 2000 00:00:00 GMT', 'CID'],
    'Origin': ['https://a.example', 'null', 'http://localhost', ' ', '\xff', 'https://a.example.evil'],
    'Range': ['bytes=0-9', 'bytes=-7', 'bytes=999999999-', 'bytes', '=', '0-', '-1', '0-0', ',', '5-9', '9-1',
              '18446744073709551615', '-', 'items'],
    'Transfer-Encoding': ['chunked', 'identity', 'x', ', '],
    'Upgrade': ['h2c', 'websocket'],
    'X-Forwarded-For': ['1.2.3.4', ', ', '::1', 'x'],
    'X-Request-Id': ['abc', '"', 'x' * 60, '\xe9'],
}
PLAIN = [name for name in HEADERS if name not in FRAMING]


class Generator:
    """Requests by a grammar, of which some are damaged afterwards. None holds the right token."""

    def __init__(self, seed, cids, base):
        self.random, self.cids, self.base = random.Random(seed), cids, base
        # of the request that is being made: its stream, and the share of values that are odd
        self.id, self.odd = 'fin', 0

    def chance(self, share):
        return self.random.random() < share

    def value(self, name, choices=None):
        """Of a parameter or a part of a path."""
        r = self.random
        if self.chance(self.odd):
            return ''.join(r.choice(ODD) for _ in range(r.choice((1, 1, 2, 4))))
        return {'id': self.id, 'cid': self.cids[self.id]}.get(name) or r.choice(choices or GOOD.get(name, NUMBERS))

    def target(self):
        r = self.random
        self.id, self.odd = r.choice(list(self.cids)), r.choice((0, 0, 0.1, 0.5))
        template = r.choice(['/', '/catalogue.css', '/nothing', *described.DOCUMENT['paths']])
        parameters = [
            described.resolve(one)
            for one in described.DOCUMENT['paths'].get(template, {}).get('get', {}).get('parameters', [])
        ]
        choices = {one['name']: one['schema'].get('enum') for one in parameters}
        path = re.sub(r'\{(\w+)\}', lambda found: self.value(found[1], choices.get(found[1])), template)
        query = [one for one in parameters if one['in'] == 'query']
        names = ([one['name'] for one in query if one.get('required')] +
                 [one['name'] for one in r.sample(query, min(len(query), r.choice((0, 1, 1, 2, 4))))])
        names = list(dict.fromkeys(names)) if not self.chance(0.05) else names
        if self.chance(0.1):
            names.append(r.choice(['token', 'x', '', 'error']))
        query = '&'.join('%s=%s' % (name, self.value(name, choices.get(name))) for name in names)
        return r.choice((self.base,) * 5 + ('', 'http://x', '/x')) + path + ('?' + query if query or
                                                                             self.chance(0.05) else '')

    def header(self):
        name = self.random.choice(FRAMING if self.chance(self.odd / 2) else PLAIN)
        pieces = HEADERS[name] + [self.random.choice(ODD)]
        text = ''.join(self.random.choice(pieces) for _ in range(self.random.choice((1, 1, 1, 2, 4))))
        return name + ': ' + text.replace('CID', self.cids['fin'])

    def damaged(self, data):
        r, kind = self.random, self.random.randrange(6)
        if kind == 0:
            return data[:r.randrange(len(data))]
        if kind == 1:
            return data + data
        if kind == 2:
            return bytes(r.randrange(256) for _ in range(r.randrange(1, 400)))
        if kind == 3:
            place, many = r.randrange(len(data)), r.randrange(1, 3000)
            return data[:place] + data[place:place + 8] * many + data[place:]
        data = bytearray(data)
        for _ in range(r.randrange(1, 6)):
            data[r.randrange(len(data))] = r.randrange(256)
        return bytes(data)

    def request(self):
        r = self.random
        method = r.choice(('GET',) * 20 + ('HEAD', 'OPTIONS', 'POST', 'FOO', '', 'G\x00T'))
        version = r.choice(('HTTP/1.1',) * 30 + ('HTTP/1.0', 'HTTP/2.0', 'HTTP/1.', 'XTTP/1.1', ''))
        lines = ['%s %s %s' % (method, self.target(), version)]
        if not self.chance(0.05):
            lines.append('Host: localhost')
        lines += [self.header() for _ in range(r.choice((0, 1, 1, 2, 6)))]
        if self.chance(0.03):
            lines.insert(r.randrange(len(lines)), r.choice(ODD))
        data = (r.choice(('\r\n',) * 20 + ('\n', '\r')).join(lines) + '\r\n\r\n').encode('latin-1')
        return self.damaged(data) if self.chance(0.15) else data


def exchange(server, batch):
    """What comes back for some requests and a last one that ends the connection, and whether all of it has come."""
    received = b''
    try:
        with server.connect() as connection:
            for data in batch:
                connection.sendall(data)
            connection.settimeout(QUIET)
            while some := connection.recv(1 << 20):
                received += some
    except socket.timeout:  # it waits for the rest of a request; what it has begun to send it sends
        return received, False
    except OSError:  # closed while there was more to read: the kernel resets the connection, which takes away what was sent
        return received, False
    return received, True


def judge(guarded, received, whole):
    """What is wrong with these bytes, or None, and the statuses in them."""
    if MARK in received or b'root:x:' in received:
        return 'a file leaked', []
    if not whole:
        return None, [int(status) for status in re.findall(rb'(?:^|\n)HTTP/1\.[01] (\d{3}) ', received)]
    try:
        found = answers(received)
    except AssertionError as wrong:
        return repr(wrong), []
    if guarded and any(status in (200, 206) and body and not body.startswith(b'{"status"')
                       for status, _, body in found):
        return 'an answer without the token', []
    unknown = [status for status, _, _ in found if status not in KNOWN]
    return ('a status of none: %s' % unknown if unknown else None), [status for status, _, _ in found]


def attack(server, seed, cids, count, found, problems):
    generator = Generator(seed, cids, server.base.rstrip('/'))
    sent = 0
    while sent < count and len(problems) < 10:
        # many to a connection: the server closes it at the first that is broken, the rest is lost on it
        batch = [generator.request() for _ in range(generator.random.choice((1, 1, 1, 2, 5)))]
        received, whole = exchange(server, batch + [LAST])
        sent += len(batch)
        wrong, statuses = judge(server.base != '/', received, whole)
        if wrong:
            problems.append((wrong, batch, received[:2000]))
        for key in (*statuses, 'connections', *(() if whole else ('cut',))):
            found[key] = found.get(key, 0) + 1


def descriptors(server):
    return len(os.listdir('/proc/%d/fd' % server.process.pid))


def under_attack(server, seed):
    """Attacks a server from several threads while a good request is answered; returns what was answered."""
    authorized = {'Authorization': 'Bearer ' + TOKEN, 'X-Forwarded-For': '10.9.8.7'}  # not one who guesses
    cids = {mesh['id']: mesh['cid'] for mesh in server.json('/v1/meshes', **authorized)['meshes']}
    found, problems, workers, before = {}, [], 32, descriptors(server)
    started = time.monotonic()
    threads = [threading.Thread(target=attack,
                                args=(server, seed * 1000 + i, cids,
                                      COUNT // 2 // workers, found, problems)) for i in range(workers)]
    for thread in threads:
        thread.start()
    slowest = 0
    while any(thread.is_alive() for thread in threads):
        start = time.monotonic()
        assert server.get('/v1/meshes/fin', **authorized)[0] == 200
        slowest = max(slowest, time.monotonic() - start)
        time.sleep(0.1)
    print('# %d requests in %.0f s, seed %d: %s; a good one waited %.0f ms at most' %
          (COUNT // 2, time.monotonic() - started, seed, ', '.join(
              '%s: %d' % pair for pair in sorted(found.items(), key=str)), slowest * 1e3))
    assert not problems, problems[:3]
    assert server.process.poll() is None and server.get('/healthz')[0] == 200
    eventually(lambda: descriptors(server) <= before)  # none of the connections hangs: after the time-out they are gone
    return set(found)


def test_hostile_requests():
    """All connections are let go of and nothing leaks: stopping waits for nobody, and sanitizers are silent."""
    with Server(FOLDER, '--timeout', '5', '--drain', '1000') as server:
        answered = under_attack(server, SEED)
    assert {200, 204, 400, 404, 405} <= answered, answered  # it was not all thrown away


def test_guarded_server():
    path = os.path.join(SCRATCH, 'token')
    with open(path, 'w') as file:
        file.write(TOKEN)
    with Server(FOLDER, '--token', path, '--cors', 'https://a.example', '--base-path', '/x/', '--trust-proxy',
                '127.0.0.1', '--timeout', '5',
                '--drain', '1000') as server:
        answered = under_attack(server, SEED + 1)
    assert {200, 204, 400, 401, 405} <= answered, answered


os.makedirs(FOLDER, exist_ok=True)
with open(os.path.join(SCRATCH, 'secret'), 'wb') as secret:
    secret.write(MARK)
subprocess.run([TETLOD, 'sample', 'fin', '--size', '6', '-o', 'fin.vtu'], cwd=SCRATCH, check=True)
subprocess.run([TETLOD, 'build', 'fin.vtu', '--field', 'Pressure', '-o', os.path.join(FOLDER, 'fin.tetlod'), '--quiet'],
               cwd=SCRATCH, check=True)
for name in ('topologies', 'cells_float32', 'series_moving'):
    shutil.copy(os.path.join(ROOT, 'tests', 'golden', name + '.tetlod'), FOLDER)
run([test_hostile_requests, test_guarded_server])
