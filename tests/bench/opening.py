#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""How long a large stream takes to its first answers after the server's start, the memory of decoding it, and what work
for clients that have gone holds up.

usage: opening.py TETLOD TILE_STREAM [STREAM]: loopback only. The stream is 64 cubes side by side, 10,368,000
tetrahedra, unless one is given. Seconds that the client waited, and processor time of the server until then, which
other load on the machine disturbs less. Fails where the first mesh takes more than 6 s of either, or stopping more than
a second and --drain.
"""
import json
import os
import signal
import socket
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


SLICES, DRAIN = 60, 1


def ask_for_slices(server, at):
    """Each of its own; the answers are not read."""
    waiting = []
    for i in range(SLICES):
        waiting.append(socket.create_connection(('127.0.0.1', server.port)))
        path = '%s/slice.vtp?origin=0,0,%g&normal=%g,1,1' % (at, 0.1 + i / 100, i)
        waiting[-1].sendall(('GET %s HTTP/1.1\r\nHost: localhost\r\n\r\n' % path).encode())
    return waiting


def leaving(stream):
    """Slices of the finest level whose clients leave, while the stream is decoded and after: how long another request
    for a surface of the coarsest level waits then, and how long stopping takes with as many queued."""
    rows = {}
    for name, warm in (('while it is decoded', False), ('when it is decoded', True)):
        with Server(TETLOD, stream, '--cache', '2G', '--drain', str(DRAIN)) as server:
            at, _ = server.level(name_of(stream), 'error=0')
            coarse, _ = server.level(name_of(stream), 'error=1')
            if warm:
                server.get(at + '/slice.stl?origin=0,0,1e9&normal=0,0,1')
            waiting = ask_for_slices(server, at)
            while server.metric('tetlod_queue_length') < SLICES / 3 and warm:
                time.sleep(0.01)
            time.sleep(0 if warm else 0.3)
            for connection in waiting:
                connection.close()
            start = time.monotonic()
            server.get(coarse + '/surface.stl')
            other = time.monotonic() - start
            waiting = ask_for_slices(server, at)
            time.sleep(0.1)
            start = time.monotonic()
            server.process.send_signal(signal.SIGTERM)
            server.process.wait()
            rows[name] = {'other_seconds': other, 'stop_seconds': time.monotonic() - start}
        print('%d slices %s, all clients gone: another request waits %.2f s; stopping with as many queued takes '
              '%.2f s (--drain %d)' % (SLICES, name, *rows[name].values(), DRAIN))
    return rows


def main():
    with tempfile.TemporaryDirectory(prefix='tetlod-bench-') as folder:
        stream = sys.argv[3] if len(sys.argv) > 3 else os.path.join(folder, 'cubes.tetlod')
        if len(sys.argv) <= 3:
            mesh, one = os.path.join(folder, 'cube.vtu'), os.path.join(folder, 'cube.tetlod')
            subprocess.run([TETLOD, 'sample', 'cube', '--size', '30', '-o', mesh], check=True)
            subprocess.run([TETLOD, 'build', mesh, '-o', one, '--quiet'], check=True)
            subprocess.run([TILE, one, '64', stream], check=True)
        result = {'times': times(stream), 'memory': memory(stream), 'leaving': leaving(stream)}
        print(json.dumps(result))
        first = result['times']['mesh at 1 %']
        if max(first['seconds'], first['processor_seconds']) > 6:
            sys.exit('missed: the first mesh')
        if max(row['stop_seconds'] for row in result['leaving'].values()) > DRAIN + 1:
            sys.exit('missed: the end')


main()
