#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""How long a large stream takes to its first answers after the server's start, and the memory of decoding it.

usage: opening.py TETLOD TILE_STREAM [STREAM]: loopback only. The stream is 64 cubes side by side, 10,368,000 tetrahedra, unless one is
given. Seconds that the client waited, and processor time of the server until then, which other load on the machine disturbs less.
Fails where the first mesh takes more than 6 s of either.
"""
import json
import os
import subprocess
import sys
import tempfile
import time

from served_process import Server

TETLOD, TILE = (os.path.abspath(path) for path in sys.argv[1:3])


def name_of(stream):
    return os.path.basename(stream)[:-len('.tetlod')]


def times(stream):
    rows = {}
    for name, query, file in (('prefix at 1 %', 'error=0.01', 'mesh.tetlod'), ('mesh at 1 %', 'error=0.01', 'mesh.vtu'),
                              ('mesh of a tenth', 'tets=10', 'mesh.vtu'), ('mesh of a half', 'tets=2', 'mesh.vtu'),
                              ('finest level, cut', 'error=0', 'slice.stl?origin=0,0,0.1&normal=0,0,1')):
        with Server(TETLOD, stream, '--cache', '2G') as server:  # of its own: nothing is decoded yet
            start = time.monotonic()
            if query.startswith('tets'):  # so many times fewer than the finest level has
                query = 'tets=%d' % (server.level(name_of(stream), 'error=0')[1] // int(query[5:]))
            at, tets = server.level(name_of(stream), query)
            server.get('%s/%s' % (at, file))
            rows[name] = {'tets': tets, 'seconds': time.monotonic() - start,
                          'processor_seconds': server.processor_seconds()}
        print('%-18s %9d tetrahedra after %6.2f s, %5.2f s of processor time' % (name, *rows[name].values()))
    return rows


def memory(stream):
    """Bytes a tetrahedron that stay, and at most while it is decoded."""
    with Server(TETLOD, stream, '--cache', '2G') as server:
        before = server.kilobytes('VmRSS')
        at, tets = server.level(name_of(stream), 'error=0')
        server.get(at + '/slice.stl?origin=0,0,1e9&normal=0,0,1')
        stays = server.metric('tetlod_stream_memory_bytes')
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
