#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""How long a large stream takes to its first answers after the server's start, and the memory of decoding it.

usage: opening.py TETLOD TILE_STREAM [STREAM]: loopback only. The stream is 64 cubes side by side, 10,368,000 tetrahedra, unless one is
given. Seconds that the client waited, and processor time of the server until then, which other load on the machine disturbs less.
Fails where the first mesh takes more than 6 s of either.
"""
import http.client
import json
import os
import re
import subprocess
import sys
import tempfile
import time
import urllib.parse

TETLOD, TILE = (os.path.abspath(path) for path in sys.argv[1:3])


class Server:
    def __init__(self, stream):
        self.process = subprocess.Popen([TETLOD, 'serve', stream, '--listen', '127.0.0.1:0', '--quiet', '--cache', '2G'], stdout=subprocess.PIPE)
        self.port = int(re.search(rb':(\d+)/', self.process.stdout.readline())[1])
        self.about = '/v1/meshes/' + os.path.basename(stream)[:-len('.tetlod')]

    def __enter__(self):
        return self

    def __exit__(self, *error):
        self.process.terminate()
        self.process.wait()

    def get(self, path):
        connection = http.client.HTTPConnection('127.0.0.1', self.port, timeout=600)
        connection.request('GET', path)
        answer = connection.getresponse()
        body = answer.read()
        if answer.status not in (200, 303):
            sys.exit('%s: %d %s' % (path, answer.status, body[:300]))
        return answer, body

    def level(self, query):
        """The address of a level, whose meshes are below it, and its tetrahedra."""
        answer, _ = self.get('%s/mesh?%s' % (self.about, query))
        return urllib.parse.urljoin(self.about + '/mesh', answer.getheader('Location')).rsplit('/', 1)[0], int(answer.getheader('Tetlod-Tets'))

    def processor_seconds(self):
        with open('/proc/%d/stat' % self.process.pid) as stat:
            return sum(map(int, stat.read().rsplit(')', 1)[1].split()[11:13])) / os.sysconf('SC_CLK_TCK')

    def kilobytes(self, key):
        with open('/proc/%d/status' % self.process.pid) as status:
            return int(re.search(key + r':\s+(\d+)', status.read())[1])


def times(stream):
    rows = {}
    for name, query, file in (('prefix at 1 %', 'error=0.01', 'mesh.tetlod'), ('mesh at 1 %', 'error=0.01', 'mesh.vtu'),
                              ('mesh of a tenth', 'tets=10', 'mesh.vtu'), ('mesh of a half', 'tets=2', 'mesh.vtu'),
                              ('finest level, cut', 'error=0', 'slice.stl?origin=0,0,0.1&normal=0,0,1')):
        with Server(stream) as server:  # of its own: nothing is decoded yet
            start = time.monotonic()
            if query.startswith('tets'):  # so many times fewer than the finest level has
                query = 'tets=%d' % (server.level('error=0')[1] // int(query[5:]))
            at, tets = server.level(query)
            server.get('%s/%s' % (at, file))
            rows[name] = {'tets': tets, 'seconds': time.monotonic() - start, 'processor_seconds': server.processor_seconds()}
        print('%-18s %9d tetrahedra after %6.2f s, %5.2f s of processor time' % (name, *rows[name].values()))
    return rows


def memory(stream):
    """Bytes a tetrahedron that stay, and at most while it is decoded."""
    with Server(stream) as server:
        before = server.kilobytes('VmRSS')
        at, tets = server.level('error=0')
        server.get(at + '/slice.stl?origin=0,0,1e9&normal=0,0,1')
        stays = float(re.search(rb'^tetlod_stream_memory_bytes (\S+)', server.get('/metrics')[1], re.M)[1])
        peak = (server.kilobytes('VmHWM') - before) * 1024
    print('memory: %.1f bytes a tetrahedron, %.1f at most while it is decoded' % (stays / tets, peak / tets))
    return {'stays': stays / tets, 'peak': peak / tets}


def main():
    with tempfile.TemporaryDirectory(prefix='tetlod-bench-') as folder:
        stream = sys.argv[3] if len(sys.argv) > 3 else os.path.join(folder, 'cubes.tetlod')
        if len(sys.argv) <= 3:
            mesh, one = os.path.join(folder, 'cube.vtu'), os.path.join(folder, 'cube.tetlod')
            subprocess.run([TETLOD, 'sample', 'cube', '--size', '30', '-o', mesh], check=True)
            subprocess.run([TETLOD, 'build', mesh, '-o', one, '--quiet'], check=True)
            subprocess.run([TILE, one, '64', stream], check=True)
        result = {'times': times(stream), 'memory': memory(stream)}
        print(json.dumps(result))
        first = result['times']['mesh at 1 %']
        if max(first['seconds'], first['processor_seconds']) > 6:
            sys.exit('missed: the first mesh')


main()
