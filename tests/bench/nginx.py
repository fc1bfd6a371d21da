#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""Bytes at nginx's price: whole streams, ranges of a stream and cached levels of 64 KiB, 1 MiB and 8 MB, beside nginx
(sendfile, as many workers) that sends the same bytes from files.

usage: nginx.py TETLOD TILE_STREAM [SECONDS [ROUNDS [ROW]]]: needs nginx and wrk; loopback only. The two servers take
turns, and a ratio is the median of the rounds' ratios: this is what other work on the machine disturbs least. Prints a
table in Markdown; fails where a row misses a floor. ROW names the rows to measure: 'range', '64 KiB'.
"""
import contextlib
import http.client
import json
import os
import re
import resource
import shutil
import socket
import statistics
import subprocess
import sys
import tempfile
import time

from served_process import Server

TETLOD, TILE = (os.path.abspath(path) for path in sys.argv[1:3])
SECONDS = int(sys.argv[3]) if len(sys.argv) > 3 else 2
ROUNDS = int(sys.argv[4]) if len(sys.argv) > 4 else 5
CHOSEN = sys.argv[5] if len(sys.argv) > 5 else ''
CORES = len(os.sched_getaffinity(0))
CONNECTIONS = 64
MIN_RATE, MAX_PROCESSOR = 0.95, 1.2  # of nginx's
SIZES = {'64 KiB': 64 << 10, '1 MiB': 1 << 20, '8 MB': 8000000}


def wait_for(port):
    for _ in range(200):
        with contextlib.suppress(OSError), socket.create_connection(('127.0.0.1', port), timeout=1):
            return
        time.sleep(0.05)
    sys.exit('nothing listens on port %d' % port)


class Nginx:
    """Sends the files of a folder until the end of a `with`."""

    def __init__(self, folder, root):
        with socket.socket() as probe:
            probe.bind(('127.0.0.1', 0))
            self.port = probe.getsockname()[1]
        configuration = os.path.join(folder, 'nginx.conf')
        with open(configuration, 'w') as file:
            file.write('''daemon off; worker_processes %d; pid %s/nginx.pid; error_log %s/error.log;
events { worker_connections 1024; }
http { access_log off; sendfile on; tcp_nodelay on; keepalive_requests 1000000000;
  client_body_temp_path %s/a; proxy_temp_path %s/b; fastcgi_temp_path %s/c; uwsgi_temp_path %s/d; scgi_temp_path %s/e;
  types { application/vnd.tetlod tetlod; }
  server { listen 127.0.0.1:%d backlog=1024; root %s; } }
''' % (CORES, *[folder] * 7, self.port, root))
        nginx = shutil.which('nginx', path=os.environ['PATH'] + ':/usr/sbin')
        self.process = subprocess.Popen([nginx, '-c', configuration, '-p', folder, '-e',
                                         os.path.join(folder, 'error.log')])
        wait_for(self.port)

    def __enter__(self):
        return self

    def __exit__(self, *error):
        self.process.terminate()
        self.process.wait()


def processor_seconds(pid):
    """Of a process and the children that it has now."""
    children = subprocess.run(['pgrep', '-P', str(pid)], stdout=subprocess.PIPE).stdout.split()
    ticks = 0
    for one in (pid, *map(int, children)):
        with open('/proc/%d/stat' % one) as stat:
            ticks += sum(map(int, stat.read().rsplit(')', 1)[1].split()[11:13]))
    return ticks / os.sysconf('SC_CLK_TCK')


def milliseconds(text):
    number, unit = re.fullmatch(r'([\d.]+)(us|ms|s)', text).groups()
    return float(number) * {'us': 1e-3, 'ms': 1, 's': 1e3}[unit]


def load(server, path, headers):
    """A round: requests a second, processor time for each of the server and of server and client, and latencies; any
    error is one too many."""
    options = [part for header in headers for part in ('-H', header)]
    before, client = processor_seconds(server.process.pid), resource.getrusage(resource.RUSAGE_CHILDREN)
    done = subprocess.run(['wrk', '-t%d' % CORES, '-c%d' % CONNECTIONS, '-d%ds' % SECONDS, '--latency', *options,
                           'http://127.0.0.1:%d%s' % (server.port, path)],
                          check=True, stdout=subprocess.PIPE).stdout.decode()
    spent, after = processor_seconds(server.process.pid) - before, resource.getrusage(resource.RUSAGE_CHILDREN)
    both = spent + after.ru_utime + after.ru_stime - client.ru_utime - client.ru_stime
    if 'Non-2xx' in done or 'Socket errors' in done:
        sys.exit(path + ':\n' + done)
    count = int(re.search(r'(\d+) requests in', done)[1])
    row = {'rate': float(re.search(r'Requests/sec:\s+([\d.]+)', done)[1]), 'us': spent * 1e6 / count,
           'both': both * 1e6 / count}
    row.update((name, milliseconds(re.search(r'\s%s%%\s+(\S+)' % name[1:], done)[1])) for name in ('p50', 'p99'))
    return row


def fetch(server, path, headers):
    connection = http.client.HTTPConnection('127.0.0.1', server.port, timeout=60)
    connection.request('GET', path, headers=dict(header.split(': ') for header in headers))
    answer = connection.getresponse()
    body = answer.read()
    connection.close()
    if answer.status not in (200, 206):
        sys.exit('%s: %d' % (path, answer.status))
    return body


def compare(ours, theirs, name, path, file, headers=()):
    body = fetch(ours, path, headers)
    if fetch(theirs, file, headers) != body:
        sys.exit('nginx sends other bytes')
    rounds = [(load(ours, path, headers), load(theirs, file, headers)) for _ in range(ROUNDS)]

    def medians(which):
        row = [statistics.median(pair[which][key] for pair in rounds) for key in ('rate', 'us', 'p50', 'p99')]
        return '%.0f /s, %.0f µs, %.1f, %.1f ms' % tuple(row)

    rate, processor, both = (statistics.median(a[key] / b[key] for a, b in rounds) for key in ('rate', 'us', 'both'))
    print('| %s, %d bytes | %.2f | %.2f | %.2f | %s | %s |' % (name, len(body), rate, processor, both, medians(0),
                                                               medians(1)))
    sys.stdout.flush()
    return rate >= MIN_RATE and processor <= MAX_PROCESSOR


def make_streams(folder):
    """A stream of more than 8 MB, and its levels that come nearest to the sizes, as streams."""
    mesh, one, large = (os.path.join(folder, name) for name in ('fin.vtu', 'one.tetlod', 'www/large.tetlod'))
    subprocess.run([TETLOD, 'sample', 'fin', '--size', '40', '-o', mesh], check=True)
    subprocess.run([TETLOD, 'build', mesh, '-o', one, '--quiet'], check=True)
    subprocess.run([TILE, one, '24', large], check=True)
    for name, size in SIZES.items():
        source = one if size < 1 << 20 else large
        levels = json.loads(subprocess.run([TETLOD, 'info', '--json', source], check=True,
                                           stdout=subprocess.PIPE).stdout)['levels']
        level = min(levels, key=lambda level: abs(level['bytes'] - size))['level']
        subprocess.run([TETLOD, 'extract', source, '--level', str(level), '-o',
                        os.path.join(folder, 'www', name.replace(' ', '-') + '.tetlod'), '--quiet'], check=True)


def measure(folder):
    failed = []
    with Server(TETLOD, os.path.join(folder, 'www'), '--threads',
                str(CORES)) as ours, Nginx(folder, os.path.join(folder, 'www')) as theirs:
        def describe(stream):
            about = json.loads(ours.get('/v1/meshes/' + stream)[1])
            return '/v1/meshes/%s/%s' % (stream, about['cid']), about['levels']

        def row(name, *arguments):
            if CHOSEN in name and not compare(ours, theirs, name, *arguments):
                failed.append(name)

        print(
            '| | rate | processor time of the server | with the client\'s | tetlod: rate, processor time, p50, p99 | nginx |\n|---|---|---|---|---|---|'
        )
        for name, size in SIZES.items():
            stream = name.replace(' ', '-')
            row('whole stream, ' + name, describe(stream)[0] + '/stream', '/%s.tetlod' % stream)
        for name, size in SIZES.items():
            row('range, ' + name, describe('large')[0] + '/stream', '/large.tetlod',
                ['Range: bytes=100000-%d' % (99999 + size)])
        for name, size in SIZES.items():
            stream = name.replace(' ', '-')
            at, levels = describe(stream if size < 1 << 20 else 'large')
            level = min(levels, key=lambda level: abs(28 * level['tets'] - size))['level']
            path = '%s/levels/%d/mesh.vtu' % (at, level)
            with open(os.path.join(folder, 'www', stream + '.vtu'), 'wb') as file:
                file.write(fetch(ours, path, ()))
            row('cached level, ' + name, path, '/%s.vtu' % stream)
    return failed


def main():
    folder = tempfile.mkdtemp(prefix='tetlod-bench-')
    os.chmod(folder, 0o755)  # nginx's workers may be another user
    os.makedirs(os.path.join(folder, 'www'))
    try:
        make_streams(folder)
        failed = measure(folder)
        if failed:
            sys.exit('missed (%.2f of the rate, %.1f times the processor time): %s' % (MIN_RATE, MAX_PROCESSOR,
                                                                                       ', '.join(failed)))
    finally:
        shutil.rmtree(folder)


main()
