#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""Stored bytes against nginx (sendfile, as many workers) sending the same bytes, levels that are not cached, and memory under load.

usage: server.py TETLOD [SECONDS [ROUNDS [STREAM]]]: needs nginx and wrk; loopback only. The stream is the fin sample unless one
is given. Rounds alternate between the two servers: the median of the rounds' ratios counts, of requests a second and, which
other load on the machine disturbs less, of processor time for each request, server and client together. Prints a line per body and a
JSON object at the end; fails where a floor is missed.
"""
import contextlib
import http.client
import json
import os
import re
import resource
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


def processor_seconds(pid):
    """Of a process and the children that it has now."""
    children = subprocess.run(['pgrep', '-P', str(pid)], stdout=subprocess.PIPE).stdout.split()
    ticks = 0
    for one in (pid, *map(int, children)):
        with open('/proc/%d/stat' % one) as stat:
            ticks += sum(map(int, stat.read().rsplit(')', 1)[1].split()[11:13]))
    return ticks / os.sysconf('SC_CLK_TCK')


def wrk(url, pid):
    """Requests a second, and processor microseconds for each in the server and in both; any error is one too many."""
    def spent():
        client = resource.getrusage(resource.RUSAGE_CHILDREN)
        return processor_seconds(pid), client.ru_utime + client.ru_stime

    before = spent()
    done = subprocess.run(['wrk', '-t%d' % CORES, '-c%d' % CONNECTIONS, '-d%ds' % SECONDS, url], check=True,
                          stdout=subprocess.PIPE).stdout.decode()
    after = spent()
    if 'Non-2xx' in done or 'Socket errors' in done:
        sys.exit(url + ':\n' + done)
    count = int(re.search(r'(\d+) requests in', done)[1])
    server, client = ((b - a) * 1e6 / count for a, b in zip(before, after))
    return {'rate': float(re.search(r'Requests/sec:\s+([\d.]+)', done)[1]), 'server_us': server, 'both_us': server + client}


def nearest_records(levels, size):
    """The records j-k whose bytes come nearest to a size."""
    ends = [level['bytes'] for level in levels]
    return min(((j, k) for j in range(len(ends)) for k in range(j + 1, len(ends))), key=lambda jk: abs(ends[jk[1]] - ends[jk[0]] - size))


def nearest_level(levels, form, size):
    """The level whose prefix, or whose mesh (some 28 bytes a tetrahedron), comes nearest to a size."""
    return min(levels, key=lambda level: abs((level['bytes'] if form == 'tetlod' else 28 * level['tets']) - size))['level']


def compare(servers, folder, name, path):
    """`servers` are (port, pid) of tetlod and of nginx."""
    (ours, our_pid), (theirs, their_pid) = servers
    body, _ = fetch(ours, path)
    with open(os.path.join(folder, 'www', name), 'wb') as file:
        file.write(body)
    if fetch(theirs, '/' + name)[0] != body:
        sys.exit('nginx sends other bytes')
    rounds = [(wrk('http://127.0.0.1:%d%s' % (ours, path), our_pid), wrk('http://127.0.0.1:%d/%s' % (theirs, name), their_pid)) for _ in range(ROUNDS)]

    def median(key, which):
        return statistics.median(pair[which][key] for pair in rounds)

    ratio, cost = (statistics.median(a[key] / b[key] for a, b in rounds) for key in ('rate', 'both_us'))
    print('%-22s %8d bytes  tetlod %8.0f/s  nginx %8.0f/s  ratio %.2f   server %.0f and %.0f us a request, with client ratio %.2f' % (
        name, len(body), median('rate', 0), median('rate', 1), ratio, median('server_us', 0), median('server_us', 1), cost))
    sys.stdout.flush()
    return {'bytes': len(body), 'tetlod': median('rate', 0), 'nginx': median('rate', 1), 'ratio': ratio, 'cost_ratio': cost}


def uncached_levels(port, at, levels):
    """Milliseconds that the server says it took for a level of about 38,000 tetrahedra, extracted and as a file, and that the client
    waited."""
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
    print('levels of %d to %d tetrahedra as VTU, not cached: extracted in %.1f ms (%.0f M tetrahedra a second on one core), made in %.1f ms, '
          'waited for %.1f ms (medians)' % (min(level['tets'] for level in near), max(level['tets'] for level in near), extracted, rate, made, waited))
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
    server = subprocess.Popen([TETLOD, 'serve', stream, '--listen', '127.0.0.1:%d' % port, '--quiet', '--cache', '%dM' % CACHE_MB], stdout=subprocess.DEVNULL)
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
        subprocess.run(['wrk', '-t%d' % CORES, '-c%d' % CONNECTIONS, '-d%ds' % max(8, 4 * SECONDS), '--timeout', '60s', '-s', script,
                        'http://127.0.0.1:%d' % port], check=True, stdout=subprocess.DEVNULL)
        with open('/proc/%d/status' % server.pid) as status:
            peak = int(re.search(r'VmHWM:\s+(\d+)', status.read())[1]) / 1024
        counted = {name: float(value) for name, value in re.findall(r'^(tetlod_\w+) (\S+)$', fetch(port, '/metrics')[0].decode(), re.M)}
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
    bodies = {name: row for name, row in result.items() if 'ratio' in row}
    return ['%s: %.2f of nginx' % (name, row['ratio']) for name, row in bodies.items() if max(row['ratio'], 1 / row['cost_ratio']) < 0.9] + [
        name for name, fine in (('extraction', result['levels']['mtets_per_second'] >= 20), ('levels', result['levels']['waited_ms'] <= 40),
                                ('work before encoding', result['levels']['extracted_ms'] <= 15), ('memory', result['memory']['beyond_mb'] <= 64)) if not fine]


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
        shown = json.loads(fetch(tetlod_port, '/v1/meshes/fin')[0])
        at, levels = '/v1/meshes/fin/' + shown['cid'], shown['levels']
        servers = ((tetlod_port, processes[0].pid), (nginx_port, processes[1].pid))
        result = {}
        for name, size in (('records-4K', 4 << 10), ('records-64K', 64 << 10), ('records-1M', 1 << 20)):
            result[name] = compare(servers, folder, name, at + '/records/%d-%d' % nearest_records(levels, size))
        for name, form, size in (('prefix-64K', 'tetlod', 64 << 10), ('mesh-64K', 'vtu', 64 << 10), ('mesh-1M', 'vtu', 1 << 20)):
            result[name] = compare(servers, folder, name, at + '/levels/%d/mesh.%s' % (nearest_level(levels, form, size), form))
        result['levels'] = uncached_levels(tetlod_port, at, levels)
        result['memory'] = memory(folder, stream)
        print(json.dumps(result))
        if missed(result):
            sys.exit('missed: ' + ', '.join(missed(result)))
    finally:
        for process in processes:
            process.send_signal(signal.SIGTERM)
            process.wait()
        shutil.rmtree(folder)


main()
