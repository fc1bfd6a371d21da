# SPDX-License-Identifier: BSD-3-Clause
"""What the HTTP tests share: a server on a port of its own, plain sockets to it, TAP lines."""
import contextlib
import http.client
import json
import os
import random
import re
import resource
import signal
import socket
import subprocess
import sys
import time
import traceback
import zlib

import described

TETLOD = os.environ['TETLOD']
SCRATCH = os.environ['SCRATCH']
ROOT = os.environ['ROOT']
SLOW = {'asan': 3, 'tsan': 8}.get(os.environ.get('CONFIG', ''), 1)  # sanitizers stretch time
# Seconds: what has not come by then, on however slow a machine, will not come
PATIENCE = float(os.environ.get('PATIENCE', '300'))


class Headers:
    """Headers of an answer by lower-case name, with all values of each. A header that is taken by its name must be
    there once."""

    def __init__(self, pairs):
        self.values = {}
        for name, value in pairs:
            self.values.setdefault(name.lower(), []).append(value)

    def __getitem__(self, name):
        value, = self.values[name]
        return value

    def __contains__(self, name):
        return name in self.values

    def __iter__(self):
        return iter(self.values)

    def __repr__(self):
        return repr(self.values)

    def get(self, name, otherwise=None):
        return self[name] if name in self else otherwise

    def lists(self):
        return self.values.items()


def plain(headers, body):
    """A body without its coding; None where it takes a library that Python does not have."""
    coding = headers.get('content-encoding', 'identity')
    return body if coding == 'identity' or not body else zlib.decompress(body, 31) if coding == 'gzip' else None


class Server:
    """`with Server(paths, options) as server`: ends with SIGTERM and checks that it ends well and silently."""

    def __init__(self, *arguments, listen='127.0.0.1:0', environment=None, descriptors=None):
        self.base = arguments[arguments.index('--base-path') + 1] if '--base-path' in arguments else '/'
        self.hasty = '--timeout' in arguments and float(arguments[arguments.index('--timeout') + 1]) < 10
        command = [TETLOD, 'serve', *(['--listen', listen] if listen else []), *map(str, arguments)]
        self.log_path = os.path.join(SCRATCH, 'server-%d.log' % time.monotonic_ns())
        self.log = open(self.log_path, 'wb')
        self.process = subprocess.Popen(
            command, stdout=subprocess.PIPE, stderr=self.log, env=dict(os.environ, **(environment or {})),
            preexec_fn=descriptors and (lambda: resource.setrlimit(resource.RLIMIT_NOFILE, (descriptors, descriptors))))
        self.url = self.process.stdout.readline().decode().strip()
        if not self.url:
            self.process.wait()
            raise RuntimeError('the server did not start: ' + self.messages())
        found = re.match(r'http://\[?(.*?)\]?:(\d+)/', self.url)
        self.address = (found[1], int(found[2])) if found else None

    def messages(self):
        with open(self.log_path, errors='replace') as log:
            return log.read()

    def __enter__(self):
        return self

    def __exit__(self, kind, value, trace):
        self.stop()

    def stop(self):
        if self.process.poll() is None:
            self.process.send_signal(signal.SIGTERM)
        code = self.process.wait(timeout=PATIENCE)
        self.log.close()
        if code != 0 or 'Sanitizer' in self.messages():
            raise AssertionError('the server ended with %d: %s' % (code, self.messages()[:3000]))

    def memory(self):
        with open('/proc/%d/status' % self.process.pid) as status:
            return int(re.search(r'VmRSS:\s+(\d+)', status.read())[1]) * 1024

    def counted(self):
        """Calls that read, of files and of what wakes threads (sockets do not count), and the bytes that came."""
        with open('/proc/%d/io' % self.process.pid) as counts:
            found = dict(line.split(': ') for line in counts.read().splitlines())
        return int(found['syscr']), int(found['rchar'])

    def connect(self):
        return socket.create_connection(self.address, timeout=PATIENCE)

    def get(self, path, method='GET', **headers):
        """One request of its own connection: status, headers, body. The answer is held against the description.
        Underscores become dashes. A server with a short time-out may shut a connection before a busy machine has asked:
        it is asked again."""
        end = time.monotonic() + PATIENCE
        while True:
            try:
                status, found, body = self.get_once(path, method, headers)
                break
            except (OSError, http.client.HTTPException):
                if not self.hasty or time.monotonic() > end:
                    raise
        below = '/' + path[len(self.base):] if path.startswith(self.base) else path
        described.hold(method, below, status, found, plain(found, body))
        return status, found, body

    def get_once(self, path, method, headers):
        connection = http.client.HTTPConnection(*self.address, timeout=PATIENCE)
        try:
            connection.request(method, path, headers={k.replace('_', '-'): v for k, v in headers.items()})
            answer = connection.getresponse()
            return answer.status, Headers(answer.getheaders()), answer.read()
        finally:
            connection.close()

    def json(self, path, **headers):
        status, _, body = self.get(path, **headers)
        assert status == 200, (path, status, body)
        return json.loads(body)

    def raw(self, data, finish=False):
        """All bytes that come back for these bytes until the server closes the connection."""
        with self.connect() as connection:
            try:
                connection.sendall(data)
                if finish:
                    connection.shutdown(socket.SHUT_WR)
            except OSError:
                pass
            received = b''
            try:
                while True:
                    some = connection.recv(65536)
                    if not some:
                        return received
                    received += some
            except ConnectionResetError:
                return received


def preloaded(name, source):
    """A library that stands before the system's, for LD_PRELOAD. (Sanitizers want to be loaded first.)"""
    library = os.path.join(SCRATCH, name + '.so')
    with open(library + '.c', 'w') as file:
        file.write('#define _GNU_SOURCE\n#include <dlfcn.h>\n' + source)
    subprocess.run(['cc', '-shared', '-fPIC', '-o', library, library + '.c', '-ldl'], check=True)
    return library


def free_port():
    """One below those that the kernel gives to connections: nobody takes it before a server listens there."""
    while True:
        with socket.socket() as probe, contextlib.suppress(OSError):
            probe.bind(('127.0.0.1', random.randrange(10000, 32000)))
            return probe.getsockname()[1]


def eventually(condition):
    """Waits until a condition holds, however slow the machine."""
    end = time.monotonic() + PATIENCE
    while not condition():
        assert time.monotonic() < end, 'it did not come to this'
        time.sleep(0.02)


def open_files(process):
    """What each of its file descriptors is of, but for those that are closed meanwhile."""
    folder = '/proc/%d/fd' % process
    for fd in os.listdir(folder):
        with contextlib.suppress(FileNotFoundError):
            yield int(fd), os.readlink(os.path.join(folder, fd))


def answers(received):
    """Status, headers and body of the answers that a client would find in these bytes. The body of every refusal is
    checked."""
    found = []
    while head := re.match(rb'HTTP/1\.[01] (\d{3}) .*?\r\n\r\n', received, re.S):
        status = int(head[1])
        headers = Headers(line.split(': ', 1) for line in head[0].decode('latin-1').split('\r\n')[1:-2])
        rest = received[head.end():]
        # libmicrohttpd's own: it may send the head twice, and ends the connection
        if status >= 400 and 'content-type' not in headers:
            assert not rest or b'<html>' in rest or rest == head[0], (status, received)
            return found + [(status, headers, rest)]
        # an answer to HEAD has the length of a body that does not come
        to_head = not rest or rest.startswith(b'HTTP/1.')
        body = b'' if to_head else rest[:int(headers.get('content-length', 0))]
        received = rest[len(body):]
        if status >= 400 and body:
            check_refusal(status, headers, body)
        found.append((status, headers, body))
    return found


def check_refusal(status, headers, body):
    """A problem, or a page for browsers."""
    assert len(body) == int(headers['content-length']), (status, headers, body)
    if headers['content-type'] == 'application/problem+json':
        described.check_problem('an answer', status, headers, body)
    else:
        assert headers['content-type'].startswith('text/html') and b'<html' in body, (status, headers, body)


def statuses(received):
    return [status for status, _, _ in answers(received)]


def run(tests):
    failed = 0
    forgotten = {name for name in vars(sys.modules['__main__']) if name.startswith('test_')
                 } - {test.__name__ for test in tests}
    assert not forgotten, forgotten
    tests = [test for test in tests if os.environ.get('ONLY', '') in test.__name__]
    for number, test in enumerate(tests, 1):
        try:
            skipped = test()
        except Exception:  # whatever it is, the next test shall run
            failed += 1
            print('not ok %d - %s' % (number, test.__name__))
            print(''.join('# %s\n' % line for line in traceback.format_exc().splitlines()), end='')
        else:
            print('ok %d - %s%s' % (number, test.__name__, ' # SKIP ' + skipped if isinstance(skipped, str) else ''))
        sys.stdout.flush()
    print('1..%d' % len(tests))
    sys.exit(1 if failed else 0)
