#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""Stored bytes against nginx (sendfile, as many workers) sending the same bytes, and levels that are not cached.

usage: server.py TETLOD [SECONDS [ROUNDS]]: needs nginx and wrk; loopback only. The stream is the fin sample. Rounds alternate
between the two servers; the medians are compared. Prints a line per body and a JSON object at the end.
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
ROUNDS = int(sys.argv[3]) if len(sys.argv) > 3 else 5
CORES = len(os.sched_getaffinity(0))
CONNECTIONS = 64


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


def start_nginx(folder, port):
    configuration = os.path.join(folder, 'nginx.conf')
    with open(configuration, 'w') as file:
        file.write('''daemon off; worker_processes %d; pid %s/nginx.pid; error_log %s/error.log;
events { worker_connections 1024; }
http { access_log off; sendfile on; tcp_nopush on; tcp_nodelay on; keepalive_requests 1000000000;
  client_body_temp_path %s/a; proxy_temp_path %s/b; fastcgi_temp_path %s/c; uwsgi_temp_path %s/d; scgi_temp_path %s/e;
  types { application/vnd.tetlod tetlod; }
  server { listen 127.0.0.1:%d backlog=1024; root %s/www; } }
''' % (CORES, *[folder] * 7, port, folder))
    nginx = shutil.which('nginx', path=os.environ['PATH'] + ':/usr/sbin')
    process = subprocess.Popen([nginx, '-c', configuration, '-p', folder, '-e', os.path.join(folder, 'error.log')])
    wait_for(port)
    return process


def wrk(url):
    """Requests a second; any error is one too many."""
    done = subprocess.run(['wrk', '-t%d' % CORES, '-c%d' % CONNECTIONS, '-d%ds' % SECONDS, url], check=True,
                          stdout=subprocess.PIPE).stdout.decode()
    if 'Non-2xx' in done or 'Socket errors' in done:
        sys.exit(url + ':\n' + done)
    return float(re.search(r'Requests/sec:\s+([\d.]+)', done)[1])


def nearest_records(levels, size):
    """The records j-k whose bytes come nearest to a size."""
    ends = [level['bytes'] for level in levels]
    return min(((j, k) for j in range(len(ends)) for k in range(j + 1, len(ends))), key=lambda jk: abs(ends[jk[1]] - ends[jk[0]] - size))


def nearest_level(levels, form, size):
    """The level whose prefix, or whose mesh (some 28 bytes a tetrahedron), comes nearest to a size."""
    return min(levels, key=lambda level: abs((level['bytes'] if form == 'tetlod' else 28 * level['tets']) - size))['level']


def compare(tetlod_port, nginx_port, folder, name, path):
    body, _ = fetch(tetlod_port, path)
    with open(os.path.join(folder, 'www', name), 'wb') as file:
        file.write(body)
    if fetch(nginx_port, '/' + name)[0] != body:
        sys.exit('nginx sends other bytes')
    rates = {'tetlod': [], 'nginx': []}
    for _ in range(ROUNDS):
        rates['tetlod'].append(wrk('http://127.0.0.1:%d%s' % (tetlod_port, path)))
        rates['nginx'].append(wrk('http://127.0.0.1:%d/%s' % (nginx_port, name)))
    ours, theirs = statistics.median(rates['tetlod']), statistics.median(rates['nginx'])
    print('%-22s %8d bytes  tetlod %8.0f/s  nginx %8.0f/s  ratio %.2f' % (name, len(body), ours, theirs, ours / theirs))
    sys.stdout.flush()
    return {'bytes': len(body), 'tetlod': ours, 'nginx': theirs, 'ratio': ours / theirs}


def uncached_levels(port, at, levels):
    """Milliseconds that the server says it made a level of about 38,000 tetrahedra in, and that the client waited."""
    near = sorted(levels, key=lambda level: abs(level['tets'] - 38000))[:9]
    made, waited = [], []
    fetch(port, at + '/levels/0/mesh.vtu')  # the stream is decoded
    for level in near:
        start = time.perf_counter()
        _, head = fetch(port, at + '/levels/%d/mesh.vtu' % level['level'])
        waited.append((time.perf_counter() - start) * 1e3)
        made.append(float(re.search(r'make;dur=([\d.]+)', head['server-timing'])[1]))
    print('levels of %d to %d tetrahedra as VTU, not cached: made in %.1f ms, waited for %.1f ms (medians)' % (
        min(level['tets'] for level in near), max(level['tets'] for level in near), statistics.median(made), statistics.median(waited)))
    return {'made_ms': statistics.median(made), 'waited_ms': statistics.median(waited)}


def main():
    folder = tempfile.mkdtemp(prefix='tetlod-bench-')
    os.chmod(folder, 0o755)  # nginx's workers may be another user
    os.makedirs(os.path.join(folder, 'www'))
    os.makedirs(os.path.join(folder, 'streams'))
    mesh, stream = os.path.join(folder, 'fin.vtu'), os.path.join(folder, 'streams', 'fin.tetlod')
    if len(sys.argv) > 4:
        shutil.copy(sys.argv[4], stream)
    else:
        subprocess.run([TETLOD, 'sample', 'fin', '--size', '56', '-o', mesh], check=True)
        subprocess.run([TETLOD, 'build', mesh, '-o', stream, '--quiet'], check=True)
    processes = []
    try:
        tetlod_port, nginx_port = free_port(), free_port()
        processes.append(subprocess.Popen([TETLOD, 'serve', os.path.join(folder, 'streams'), '--listen', '127.0.0.1:%d' % tetlod_port,
                                           '--quiet', '--threads', str(CORES)], stdout=subprocess.DEVNULL))
        processes.append(start_nginx(folder, nginx_port))
        wait_for(tetlod_port)
        told = json.loads(fetch(tetlod_port, '/v1/meshes/fin')[0])
        at, levels = '/v1/meshes/fin/' + told['cid'], told['levels']
        result = {}
        for name, size in (('records-4K', 4 << 10), ('records-64K', 64 << 10), ('records-1M', 1 << 20)):
            result[name] = compare(tetlod_port, nginx_port, folder, name, at + '/records/%d-%d' % nearest_records(levels, size))
        for name, form, size in (('prefix-64K', 'tetlod', 64 << 10), ('mesh-64K', 'vtu', 64 << 10), ('mesh-1M', 'vtu', 1 << 20)):
            result[name] = compare(tetlod_port, nginx_port, folder, name, at + '/levels/%d/mesh.%s' % (nearest_level(levels, form, size), form))
        result['levels'] = uncached_levels(tetlod_port, at, levels)
        print(json.dumps(result))
    finally:
        for process in processes:
            process.send_signal(signal.SIGTERM)
            process.wait()
        shutil.rmtree(folder)


main()
