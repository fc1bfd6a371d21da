#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""Levels that are not cached, and memory under load.

usage: server.py TETLOD [SECONDS [STREAM]]: needs wrk; loopback only. The stream is the fin sample unless one is given.
Prints a line for each and a JSON object at the end; fails where a floor is missed. tests/bench/nginx.py has what is
sent beside nginx.
"""
import contextlib
import http.client
import json
import os
import re
import shutil
import signal
import socket
import statistics
import subprocess
import sys
import tempfile
import time

TETLOD = os.path.abspath(sys.argv[1])
SECONDS = int(sys.argv[2]) if len(sys.argv) > 2 else 2
CORES = len(os.sched_getaffinity(0))
CONNECTIONS = 64
CACHE_MB = 32  # of the server whose memory is measured


def free_port():
    with socket.socket() as probe:
        probe.bind(('127.0.0.1', 0))
        return probe.getsockname()[1]


def wait_for(port):
    for _ in range(200):
        with contextlib.suppress(OSError), socket.create_connection(('127.0.0.1', port), timeout=1):
            return
        time.sleep(0.05)
    sys.exit('nothing listens on port %d' % port)


def fetch(port, path):
    connection = http.client.HTTPConnection('127.0.0.1', port, timeout=60)
    connection.request('GET', path)
    answer = connection.getresponse()
    body = answer.read()
    if answer.status != 200:
        sys.exit('%s: %d' % (path, answer.status))
    connection.close()
    return body, {k.lower(): v for k, v in answer.getheaders()}


def uncached_levels(port, at, levels):
    """Milliseconds that the server says it took for a level of about 38,000 tetrahedra, extracted and as a file, and
    that the client waited."""
    near = sorted(levels, key=lambda level: abs(level['tets'] - 38000))[:9]
    rows = []
    fetch(port, at + '/levels/%d/surface.stl' % (len(levels) - 1))  # the stream is decoded
    for level in near:
        start = time.perf_counter()
        _, head = fetch(port, at + '/levels/%d/mesh.vtu' % level['level'])
        waited = (time.perf_counter() - start) * 1e3
        timing = re.search(r'extract;dur=([\d.]+), make;dur=([\d.]+)', head['server-timing'])
        rows.append((float(timing[1]), float(timing[2]), waited, level['tets'] / float(timing[1]) / 1e3))
    extracted, made, waited, rate = (statistics.median(column) for column in zip(*rows))
    print(
        'levels of %d to %d tetrahedra as VTU, not cached: extracted in %.1f ms (%.0f M tetrahedra a second on one '
        'core), made in %.1f ms, '
        'waited for %.1f ms (medians)' %
        (min(level['tets'] for level in near), max(level['tets'] for level in near), extracted, rate, made, waited))
    return {'extracted_ms': extracted, 'made_ms': made, 'waited_ms': waited, 'mtets_per_second': rate}


MIX = """
local files = {"mesh.vtu", "mesh.vtk", "surface.vtp", "surface.stl"}
local codings = {"identity", "gzip", "zstd"}
function request()
  return wrk.format("GET", "%s/levels/" .. math.random(0, %d) .. "/" .. files[math.random(1, 4)], {["Accept-Encoding"] = codings[math.random(1, 3)]})
end
"""


def memory(folder, stream):
    """Megabytes beyond the stream in memory and the cache while many ask for more levels than the cache holds."""
    port = free_port()
    server = subprocess.Popen(
        [TETLOD, 'serve', stream, '--listen',
         '127.0.0.1:%d' % port, '--quiet', '--cache',
         '%dM' % CACHE_MB], stdout=subprocess.DEVNULL)
    try:
        wait_for(port)
        name = os.path.basename(stream)[:-len('.tetlod')]
        shown = json.loads(fetch(port, '/v1/meshes/' + name)[0])
        script = os.path.join(folder, 'mix.lua')
        with open(script, 'w') as file:
            file.write(MIX % ('/v1/meshes/%s/%s' % (name, shown['cid']), len(shown['levels']) - 1))
        fetch(port, '/v1/meshes/%s/%s/levels/0/mesh.vtu' % (name, shown['cid']))
        while b'\ntetlod_streams_decoded_total 1\n' not in fetch(port, '/metrics')[0]:
            time.sleep(0.05)
        with open('/proc/%d/clear_refs' % server.pid, 'w') as file:
            file.write('5')  # the peak from now on: decoding the stream takes more for a moment
        subprocess.run([
            'wrk',
            '-t%d' % CORES,
            '-c%d' % CONNECTIONS,
            '-d%ds' % max(8, 4 * SECONDS), '--timeout', '60s', '-s', script,
            'http://127.0.0.1:%d' % port
        ], check=True, stdout=subprocess.DEVNULL)
        with open('/proc/%d/status' % server.pid) as status:
            peak = int(re.search(r'VmHWM:\s+(\d+)', status.read())[1]) / 1024
        counted = {
            name: float(value) for name, value in re.findall(r'^(tetlod_\w+) (\S+)$',
                                                             fetch(port, '/metrics')[0].decode(), re.M)
        }
        in_memory = counted['tetlod_stream_memory_bytes'] / (1 << 20)
    finally:
        server.send_signal(signal.SIGTERM)
        server.wait()
    beyond = peak - in_memory - CACHE_MB
    print('memory while %d connections ask for levels (%d made): %.0f MB at most = stream %.0f + cache %d + %.0f' % (
        CONNECTIONS, counted['tetlod_levels_made_total'], peak, in_memory, CACHE_MB, beyond))
    return {'peak_mb': peak, 'stream_mb': in_memory, 'cache_mb': CACHE_MB, 'beyond_mb': beyond}


def missed(result):
    """Floors, and what misses them."""
    floors = (('extraction', result['levels']['mtets_per_second'] >= 20),
              ('levels', result['levels']['waited_ms'] <= 40),
              ('work before encoding', result['levels']['extracted_ms'] <= 15),
              ('memory', result['memory']['beyond_mb'] <= 64))
    return [name for name, fine in floors if not fine]


def main():
    folder = tempfile.mkdtemp(prefix='tetlod-bench-')
    mesh, stream = os.path.join(folder, 'fin.vtu'), os.path.join(folder, 'fin.tetlod')
    if len(sys.argv) > 3:
        shutil.copy(sys.argv[3], stream)
    else:
        subprocess.run([TETLOD, 'sample', 'fin', '--size', '56', '-o', mesh], check=True)
        subprocess.run([TETLOD, 'build', mesh, '-o', stream, '--quiet'], check=True)
    port = free_port()
    process = subprocess.Popen(
        [TETLOD, 'serve', stream, '--listen',
         '127.0.0.1:%d' % port, '--quiet', '--threads',
         str(CORES)], stdout=subprocess.DEVNULL)
    try:
        wait_for(port)
        shown = json.loads(fetch(port, '/v1/meshes/fin')[0])
        result = {
            'levels': uncached_levels(port, '/v1/meshes/fin/' + shown['cid'], shown['levels']),
            'memory': memory(folder, stream)
        }
        print(json.dumps(result))
        if missed(result):
            sys.exit('missed: ' + ', '.join(missed(result)))
    finally:
        process.send_signal(signal.SIGTERM)
        process.wait()
        shutil.rmtree(folder)


main()
