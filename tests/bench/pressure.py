#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""What a server does to others while it is under pressure.

1. 50 clients take the finest level of a stream of 1.3 million tetrahedra drop by drop, others ask for cached answers:
of those 99 %
   must come within 20 ms, and none may be refused.
2. 100 streams of a million tetrahedra are all asked for surfaces and levels in turns, with 700 MB for what is decoded
and 150 MB of
   answers: the server must stay within these, the files and 64 MB.

usage: pressure.py TETLOD TILE_STREAM [SECONDS]: loopback only. Prints a line for each and fails where a bound is
missed.
"""
import concurrent.futures
import os
import socket
import subprocess
import sys
import tempfile
import threading
import time

from served_process import Server

TETLOD, TILE = (os.path.abspath(path) for path in sys.argv[1:3])
SECONDS = float(sys.argv[3]) if len(sys.argv) > 3 else 20
TRICKLING, STREAMS = 50, 100
CACHE_MB, MEMORY_MB = 150, 700


def make(folder, copies, name):
    """A stream of `copies` times 10,368 tetrahedra."""
    one = os.path.join(folder, 'one')
    if not os.path.exists(one):
        subprocess.run([TETLOD, 'sample', 'cube', '--size', '12', '-o', one + '.vtu'], check=True)
        subprocess.run([TETLOD, 'build', one + '.vtu', '-o', one + '.tetlod', '--quiet'], check=True)
        os.rename(one + '.tetlod', one)
    subprocess.run([TILE, one, str(copies), os.path.join(folder, name + '.tetlod')], check=True)


def drop_by_drop(port, path, end, complete):
    """4 KiB ten times a second: faster than what the server takes for a stalled reader, far slower than it could send.
    """
    with socket.create_connection(('127.0.0.1', port)) as connection:
        connection.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        connection.sendall(b'GET %s HTTP/1.1\r\nHost: localhost\r\n\r\n' % path.encode())
        complete.append(connection.recv(4096).startswith(b'HTTP/1.1 200'))
        while not end.wait(0.1):
            if not connection.recv(4096):
                return


def trickling(folder):
    make(folder, 125, 'large')
    with Server(TETLOD, os.path.join(folder, 'large.tetlod')) as server:
        at, _ = server.level('large', 'error=0')
        cached = [at.rsplit('/', 2)[0] + '/records/0-5', server.level('large', 'error=0.05')[0] + '/mesh.vtu',
                  '/v1/meshes/large']
        for path in cached:
            server.get(path)
        end, accepted, waited = threading.Event(), [], []
        slow = [threading.Thread(target=drop_by_drop,
                                 args=(server.port, at + '/mesh.vtu', end, accepted)) for _ in range(TRICKLING)]
        for thread in slow:
            thread.start()
        until = time.monotonic() + SECONDS
        while time.monotonic() < until:
            for path in cached:
                start = time.monotonic()
                server.get(path)  # ends the program where it is refused
                waited.append(1e3 * (time.monotonic() - start))
            time.sleep(0.005)
        end.set()
        for thread in slow:
            thread.join()
    waited.sort()
    p99 = waited[len(waited) * 99 // 100]
    print('%d readers drop by drop (%d got their answer): %d cached answers for others, median %.1f ms, p99 %.1f ms'
          % (TRICKLING, sum(accepted), len(waited), waited[len(waited) // 2], p99))
    return p99 <= 20 and all(accepted)


def hundred(folder):
    os.mkdir(os.path.join(folder, 'hundred'))
    names = ['s%d' % copies for copies in range(80, 80 + STREAMS)]
    for copies, name in enumerate(names, 80):
        make(folder, copies, os.path.join('hundred', name))
    files_mb = sum(entry.stat().st_size for entry in os.scandir(os.path.join(folder, 'hundred'))) / 2**20
    with Server(TETLOD, os.path.join(folder, 'hundred'), '--cache', '%dM' % CACHE_MB, '--memory',
                '%dM' % MEMORY_MB) as server:
        def ask(name):
            fine, tets = server.level(name, 'error=0')
            server.get(fine + '/slice.stl?origin=0,0,0.37&normal=0,0,1')
            server.get(server.level(name, 'error=0.01')[0] + '/mesh.vtu')
            return tets
        start = time.monotonic()
        with concurrent.futures.ThreadPoolExecutor(4) as clients:
            tets = sum(clients.map(ask, names))
        seconds, peak_mb = time.monotonic() - start, server.kilobytes('VmHWM') / 1024
    bound = files_mb + CACHE_MB + MEMORY_MB + 64
    print(
        '%d streams of %.1f M tetrahedra in all, %.0f MB: each sliced at its finest level and sent at 1 %% in %.0f s; '
        '%.0f MB at most (bound: %.0f)'
        % (STREAMS, tets / 1e6, files_mb, seconds, peak_mb, bound))
    return peak_mb <= bound


def main():
    with tempfile.TemporaryDirectory(prefix='tetlod-bench-') as folder:
        good = [trickling(folder), hundred(folder)]
    sys.exit(0 if all(good) else 'missed')


main()
