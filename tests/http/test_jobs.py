# SPDX-License-Identifier: BSD-3-Clause
"""Work that takes a while: whoever has gone is not worked for, nobody has all of it, and stopping does not wait for it.
"""
import concurrent.futures
import http.client
import os
import re
import signal
import socket
import subprocess
import threading
import time

from served import PATIENCE, SCRATCH, SLOW, TETLOD, Server, eventually, run

FOLDER = os.path.join(SCRATCH, 'streams')
JOBS = 60
HOST = b'Host: localhost\r\n'
cid = last = None


def region(number):
    """A region of its own: no two are one answer. Each takes a tenth of a second or more."""
    return '/v1/meshes/fin/%s/levels/2/region.vtu?box_level=%d&box=0,0,0,2,2,%.3f' % (cid, last, 1.5 + number / 1000)


def gauges(server):
    return {name.decode(): float(value)
            for name, value in re.findall(rb'^(tetlod_\w+) ([0-9.]+)$', server.get('/metrics')[2], re.M)}


def ask(server, count, first=0, **more):
    """That many connections, each of which waits for a region."""
    lines = ''.join('%s: %s\r\n' % (name.replace('_', '-'), value) for name, value in more.items()).encode()
    waiting = []
    for i in range(first, first + count):
        waiting.append(server.connect())
        waiting[-1].sendall(b'GET ' + region(i).encode() + b' HTTP/1.1\r\n' + HOST + lines + b'\r\n')
    return waiting


def warm(server):
    """The stream is decoded."""
    assert server.get(region(-1))[0] == 200


def test_clients_that_have_gone():
    for unix in (False, True):
        path = os.path.join('/tmp', 'tetlod-jobs-%d.sock' % os.getpid())
        with Server(FOLDER, '--threads', '1', *(['--listen', 'unix:' + path] if unix else [])) as server:
            warm(server)
            before = gauges(server)['tetlod_levels_made_total']
            if unix:
                waiting = [socket.socket(socket.AF_UNIX) for _ in range(JOBS)]
                for i, connection in enumerate(waiting):
                    connection.connect(path)
                    connection.sendall(b'GET ' + region(i).encode() + b' HTTP/1.1\r\n' + HOST + b'\r\n')
            else:
                waiting = ask(server, JOBS)
            eventually(lambda: gauges(server)['tetlod_queue_length'] >= JOBS / 2)
            assert gauges(server)['tetlod_connections'] > JOBS / 2
            for connection in waiting:
                connection.close()
            assert server.get(region(JOBS))[0] == 200
            eventually(lambda: gauges(server)['tetlod_queue_length'] == gauges(server)['tetlod_jobs'] == 0)
            made = gauges(server)['tetlod_levels_made_total'] - before
            assert made < JOBS / 2, made
            assert gauges(server)['tetlod_connections_left_total'] >= JOBS / 2
            eventually(lambda: gauges(server)['tetlod_connections'] == 1)
            assert server.get(region(JOBS - 1))[0] == 200  # what was dropped is made when it is asked for again


def test_one_of_two_clients_goes():
    """What another one still waits for is made."""
    with Server(FOLDER, '--threads', '1') as server:
        warm(server)
        others = ask(server, 3)
        stay, = ask(server, 1, 10)
        gone, = ask(server, 1, 10)
        time.sleep(0.05)
        for connection in (*others, gone):
            connection.close()
        received = stay.recv(20)
        assert received.startswith(b'HTTP/1.1 200'), received
        stay.close()


def test_jobs_of_one_client():
    limit = 5
    with Server(FOLDER, '--threads', '1', '--jobs', str(limit), '--trust-proxy', '127.0.0.1') as server:
        warm(server)
        with concurrent.futures.ThreadPoolExecutor(20) as pool:
            same = list(pool.map(lambda _: server.get(region(500))[0], range(20)))
            assert same == [200] * 20  # one job, however many wait for it
            many = [pool.submit(server.get, region(i), X_Forwarded_For='1.2.3.4') for i in range(19)]
            eventually(lambda: any(one.done() for one in many))
            assert server.get(region(300), X_Forwarded_For='5.6.7.8')[0] == 200
            found = [one.result() for one in many]
        refused = [head for status, head, _ in found if status == 429]
        assert ({status for status, _, _ in found} == {200, 429}
                and all(head['retry-after'] for head in refused)), [status for status, _, _ in found]
        assert len(refused) >= 19 - 2 * limit, len(refused)
        assert [server.get(region(600 + i), X_Forwarded_For='1.2.3.4')[0]
                for i in range(2 * limit)] == [200] * 2 * limit  # all are given back
        assert server.get(region(3), X_Forwarded_For='1.2.3.4')[0] == 200


def ends_within(server, seconds):
    started = time.monotonic()
    server.process.send_signal(signal.SIGTERM)
    assert server.process.wait(timeout=PATIENCE) == 0
    took = time.monotonic() - started
    assert took < seconds, took


def test_stop_with_a_queue():
    """--drain and a second, whatever is queued; and SIGHUPs meanwhile change nothing."""
    for hups in (False, True):
        with Server(FOLDER, '--threads', '1', '--drain', '0.5', '--cache', '4M') as server:
            warm(server)
            waiting = ask(server, JOBS)
            eventually(lambda: gauges(server)['tetlod_queue_length'] >= JOBS / 2)
            stop = threading.Event()

            def reload():
                while not stop.is_set() and server.process.poll() is None:
                    server.process.send_signal(signal.SIGHUP)
                    time.sleep(0.005)

            thread = threading.Thread(target=reload)
            if hups:
                thread.start()
                time.sleep(0.05)
            try:
                ends_within(server, 1.5 + 0.5 * SLOW)  # and what a busy machine adds
            finally:
                stop.set()
                if hups:
                    thread.join()
            for connection in waiting:
                connection.settimeout(PATIENCE)
                received = b''
                try:
                    received = connection.recv(30)
                except ConnectionResetError:
                    pass
                assert not received or received.startswith((b'HTTP/1.1 200', b'HTTP/1.1 503')), received
                connection.close()


def test_grace():
    """/readyz says that the server is about to stop while everybody is still answered."""
    with Server(FOLDER, '--drain', '6', '--grace', '2') as server:
        def get(path):
            connection = http.client.HTTPConnection(*server.address, timeout=PATIENCE)
            connection.request('GET', path)
            answer = connection.getresponse()
            answer.read()
            connection.close()
            return answer.status

        assert get('/readyz') == 200
        started = time.monotonic()
        server.process.send_signal(signal.SIGTERM)
        eventually(lambda: get('/readyz') == 503)
        assert get('/v1/meshes') == 200 and get('/healthz') == 200
        server.process.wait(timeout=PATIENCE)
        assert 1.9 < time.monotonic() - started < 7 + SLOW
        try:
            get('/healthz')
            raise AssertionError('it still listens')
        except ConnectionRefusedError:
            pass
    with Server(FOLDER, '--drain', '0.5', '--grace', '1000') as server:  # grace is a part of it
        ends_within(server, 1.5 + 0.5 * SLOW)


os.makedirs(FOLDER, exist_ok=True)
subprocess.run([TETLOD, 'sample', 'fin', '--size', '20', '-o', 'fin.vtu'], cwd=SCRATCH, check=True)
subprocess.run([TETLOD, 'build', 'fin.vtu', '--field', 'Pressure', '-o', os.path.join(FOLDER, 'fin.tetlod'), '--quiet'],
               cwd=SCRATCH, check=True)
with Server(FOLDER) as first:
    described = first.json('/v1/meshes/fin')
    cid, last = described['cid'], len(described['levels']) - 1
run([test_clients_that_have_gone, test_one_of_two_clients_goes, test_jobs_of_one_client, test_stop_with_a_queue,
     test_grace])
