#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""Minutes of mixed load: 2,000 keep-alive connections that ask for cached answers now and then, beside levels that must
be made, ranges, answers broken off and malformed requests. No well-formed request may see an error, memory must stay
flat (within 5 %), and of the cached answers 99 % must come within 20 ms.

usage: soak.py TETLOD [SECONDS [STREAM]]: loopback only. Prints latencies of the cached answers and the memory, as JSON
at the end.
"""
import asyncio
import json
import multiprocessing
import os
import random
import re
import resource
import shutil
import signal
import socket
import struct
import subprocess
import sys
import tempfile
import time
import urllib.request

TETLOD = os.path.abspath(sys.argv[1])
SECONDS = int(sys.argv[2]) if len(sys.argv) > 2 else 60
CONNECTIONS, PAUSE = 2000, 4.0  # each asks every 4 s


async def ask(reader, writer, path):
    writer.write(b'GET %s HTTP/1.1\r\nHost: localhost\r\n\r\n' % path.encode())
    head = await reader.readuntil(b'\r\n\r\n')
    await reader.readexactly(int(re.search(rb'\r\nContent-Length: (\d+)', head)[1]))
    return int(head[9:12])


async def patient(port, path, until, latencies, errors):
    await asyncio.sleep(random.random() * PAUSE)
    try:
        reader, writer = await asyncio.open_connection('127.0.0.1', port)
        while time.monotonic() < until:
            start = time.monotonic()
            status = await ask(reader, writer, path)
            latencies.append((time.monotonic() - start) * 1e3)
            if status != 200:
                errors.append((path, status))
            await asyncio.sleep(PAUSE * (0.5 + random.random()))
        writer.close()
    except (OSError, asyncio.IncompleteReadError) as error:
        errors.append((path, repr(error)))


def keep_alive(port, paths, until, out):
    """The many connections; a process of its own so that the other load does not lengthen what it measures."""
    async def all_of_them():
        latencies, errors = [], []
        await asyncio.gather(*(patient(port, paths[i % len(paths)], until, latencies,
                                       errors) for i in range(CONNECTIONS)))
        out.put(('kept', latencies, errors))
    asyncio.run(all_of_them())


def break_off(port, path):
    with socket.create_connection(('127.0.0.1', port), timeout=20) as connection:
        connection.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack('ii', 1, 0))  # a reset, not an end
        connection.sendall(b'GET %s HTTP/1.1\r\nHost: localhost\r\n\r\n' % path.encode())
        if random.random() < 0.7:
            connection.recv(random.choice((1, 1000, 100000)))


def malformed(port):
    with socket.create_connection(('127.0.0.1', port), timeout=20) as connection:
        try:
            connection.sendall(
                random.choice(
                    (b'\x00' * 50 + b'\r\n\r\n', b'GET / HTTP/1.1\r\n\r\n',
                     b'GET /%00 HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n',
                     b'POST / HTTP/1.1\r\nHost: localhost\r\nContent-Length: 9\r\n\r\n', b'GET /' + b'a' * 30000)))
            connection.settimeout(0.02)
            connection.recv(4096)
        except OSError:
            pass


def disturb(port, at, levels, until, out):
    """Levels to be made, ranges, broken off and malformed requests, in turn."""
    errors, counts, seed = [], {}, random.Random(1)
    while time.monotonic() < until:
        kind = seed.choice(('level', 'level', 'range', 'abort', 'malformed'))
        counts[kind] = counts.get(kind, 0) + 1
        level = seed.choice(levels)['level']
        try:
            if kind == 'abort':
                break_off(port, seed.choice((at + '/stream', at + '/levels/%d/mesh.vtk' % level)))
            elif kind == 'malformed':
                malformed(port)
            else:
                path = (at + ('/stream' if kind == 'range' else '/levels/%d/%s' %
                              (level, seed.choice(('mesh.vtu', 'surface.vtp', 'mesh.vtk')))))
                headers = {'Range': 'bytes=%d-%d' % (level * 10, level * 1000 + 10)} if kind == 'range' else {}
                with urllib.request.urlopen(urllib.request.Request('http://127.0.0.1:%d%s' % (port, path),
                                                                   headers=headers), timeout=30) as answer:
                    answer.read()
        except OSError as error:
            if kind in ('level', 'range'):
                errors.append((kind, repr(error)))
        time.sleep(0.005)
    out.put(('disturbed', counts, errors))


def memory(pid):
    with open('/proc/%d/status' % pid) as status:
        return int(re.search(r'VmRSS:\s+(\d+)', status.read())[1]) / 1024


def main():
    resource.setrlimit(resource.RLIMIT_NOFILE, (resource.getrlimit(resource.RLIMIT_NOFILE)[1],) * 2)
    folder = tempfile.mkdtemp(prefix='tetlod-soak-')
    stream = os.path.join(folder, 'fin.tetlod')
    if len(sys.argv) > 3:
        shutil.copy(sys.argv[3], stream)
    else:
        subprocess.run([TETLOD, 'sample', 'fin', '-o', os.path.join(folder, 'fin.vtu')], check=True)
        subprocess.run([TETLOD, 'build', os.path.join(folder, 'fin.vtu'), '-o', stream, '--quiet'], check=True)
    server = subprocess.Popen([TETLOD, 'serve', stream, '--listen', '127.0.0.1:0', '--cache', '32M'],
                              stdout=subprocess.PIPE)
    try:
        port = int(re.search(rb':(\d+)/', server.stdout.readline())[1])
        with urllib.request.urlopen('http://127.0.0.1:%d/v1/meshes/fin' % port) as answer:
            shown = json.load(answer)
        at, levels = '/v1/meshes/fin/' + shown['cid'], shown['levels']
        cached = ['/v1/meshes/fin', at + '/records/0-5', at + '/levels/0/mesh.vtu', at + '/levels/3/mesh.tetlod',
                  '/catalogue.css']
        for path in cached:
            urllib.request.urlopen('http://127.0.0.1:%d%s' % (port, path)).read()
        until, out = time.monotonic() + SECONDS, multiprocessing.Queue()
        parts = [multiprocessing.Process(target=keep_alive, args=(port, cached, until, out)),
                 multiprocessing.Process(target=disturb, args=(port, at, levels, until, out))]
        for part in parts:
            part.start()
        sizes = []
        while time.monotonic() < until - 1:
            time.sleep(1)
            sizes.append(memory(server.pid))
        got = {name: (first, errors) for name, first, errors in (out.get() for _ in parts)}
        for part in parts:
            part.join()
        latencies, third = sorted(got['kept'][0]), len(sizes) // 3
        middle, last = sum(sizes[third:2 * third]) / third, sum(sizes[-third:]) / third
        result = {
            'seconds': SECONDS, 'connections': CONNECTIONS, 'cached_answers': len(latencies),
            'cached_p50_ms': latencies[len(latencies) // 2], 'cached_p99_ms': latencies[len(latencies) * 99 // 100],
            'others': got['disturbed'][0], 'errors': len(got['kept'][1]) + len(got['disturbed'][1]),
            'rss_mb_middle_third': middle, 'rss_mb_last_third': last, 'rss_growth': last / middle - 1
        }
        print(json.dumps(result, indent=1))
        print((got['kept'][1] + got['disturbed'][1])[:5] if result['errors'] else 'no errors')
        sys.exit(1 if result['errors'] or result['rss_growth'] > 0.05 else 0)
    finally:
        server.send_signal(signal.SIGTERM)
        server.wait()
        shutil.rmtree(folder)


main()
