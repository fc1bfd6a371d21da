# SPDX-License-Identifier: BSD-3-Clause
"""What the tests of the command line share: the program, its scratch folder, and results in TAP."""
import http.server
import itertools
import json
import os
import subprocess
import threading

from tap import SANITIZED, finish, note, report  # noqa: F401 (for the tests)

TETLOD, SCRATCH, ROOT = os.environ['TETLOD'], os.environ['SCRATCH'], os.environ['ROOT']
CONFIG = os.environ.get('CONFIG', 'release')
PATIENCE = 60
DATA = os.path.join(ROOT, '..', 'shared', 'data')


def report_problem(name, problem):
    """`problem` is what is wrong, or None."""
    report(name, problem is None, problem)


def case(name, function, *arguments):
    """Reports a function that returns what is wrong, or None, or raises."""
    try:
        problem = function(*arguments)
    except Exception as raised:
        problem = repr(raised)
    report_problem(name, problem)


def path(name):
    return os.path.join(SCRATCH, name)


def write(name, content):
    with open(path(name), 'wb') as file:
        file.write(content if isinstance(content, bytes) else content.encode())
    return path(name)


def tetlod(*arguments, **more):
    return subprocess.run([TETLOD, *arguments], stdin=subprocess.DEVNULL, stdout=subprocess.PIPE,
                          stderr=subprocess.PIPE,
                          cwd=SCRATCH, **more)


def must(*arguments):
    """What was said; raises it, should tetlod fail."""
    done = tetlod(*arguments)
    if done.returncode:
        raise RuntimeError('%s: exit %d: %s' % (' '.join(arguments), done.returncode, done.stderr.decode()))
    return done


def succeeds(name, *arguments):
    done = tetlod(*arguments)
    report(name, done.returncode == 0, done)
    return done


def fails(name, code, words, *arguments):
    """Exit status `code`, one line that has all the words in it, nothing on standard output."""
    done = tetlod(*arguments)
    message = done.stderr.decode(errors='replace')
    good = done.returncode == code and message.count('\n') == 1 and message.startswith('tetlod') and not done.stdout
    report(name, good and all(word in message for word in words), (done, words))


def damage(name, n, random):
    """A file cut off, every third time, or with three other bytes in it."""
    with open(name, 'rb') as file:
        data = bytearray(file.read())
    if n % 3 == 0:
        data = data[:random.integers(len(data))]
    else:
        for at in random.integers(0, len(data), 3):
            data[at] = random.integers(256)
    write(name, bytes(data))


def survived(done):
    """Done, failed or refused the input with one line: no crash."""
    return done.returncode in (0, 1, 3) and (not done.returncode or done.stderr.count(b'\n') == 1)


def info(name):
    return json.loads(tetlod('info', '--json', name).stdout)


class Host:
    """A host of files that answers ranges alone, while `with` lasts. `files`: their bytes by name, or None for those of
    the scratch folder; `asked`: (offset, size) of each range that left. `trips`: how many requests come together, trip
    by trip: none of a trip is answered before all of it are there."""

    def __init__(self, files=None, trips=()):
        self.files, self.asked, self.trips, self.here, self.arrived = files, [], trips, 0, threading.Condition()
        host = self

        class Handler(http.server.BaseHTTPRequestHandler):
            protocol_version = 'HTTP/1.1'

            def do_GET(self):
                host.wait_for_trip()
                data = host.read(self.path[1:])
                first, last = map(int, self.headers['Range'][len('bytes='):].split('-'))
                part = data[first:last + 1]
                host.asked.append((first, len(part)))
                self.send_response(206)
                self.send_header('Content-Range', 'bytes %d-%d/%d' % (first, first + len(part) - 1, len(data)))
                self.send_header('Content-Length', str(len(part)))
                self.end_headers()
                self.wfile.write(part)

            def log_message(self, *_):
                pass

        self.server = http.server.ThreadingHTTPServer(('127.0.0.1', 0), Handler)
        self.url = 'http://127.0.0.1:%d/' % self.server.server_port

    def wait_for_trip(self):
        with self.arrived:
            self.here += 1
            end = next((end for end in itertools.accumulate(self.trips) if end >= self.here), self.here)
            self.arrived.notify_all()
            if not self.arrived.wait_for(lambda: self.here >= end, PATIENCE):
                raise TimeoutError('a client asks for one after the other')

    def read(self, name):
        if self.files is not None:
            return self.files[name]
        with open(path(name), 'rb') as file:
            return file.read()

    @property
    def sent(self):
        return sum(size for _, size in self.asked)

    def __enter__(self):
        threading.Thread(target=self.server.serve_forever, daemon=True).start()
        return self

    def __exit__(self, *_):
        self.server.shutdown()
        self.server.server_close()


def read_grid(name):
    """As VTK reads a .vtu or .vtk file."""
    import vtk
    legacy = name.endswith('.vtk')
    reader = vtk.vtkUnstructuredGridReader() if legacy else vtk.vtkXMLUnstructuredGridReader()
    if legacy:
        reader.ReadAllScalarsOn()
        reader.ReadAllFieldsOn()
    reader.SetFileName(path(name))
    reader.Update()
    return reader.GetOutput()


def read_vtu(name):
    """Points, tetrahedra, fields."""
    from vtk.util.numpy_support import vtk_to_numpy
    grid = read_grid(name)
    data = grid.GetPointData()
    fields = {data.GetArrayName(i): vtk_to_numpy(data.GetArray(i)) for i in range(data.GetNumberOfArrays())}
    return vtk_to_numpy(grid.GetPoints().GetData()), vtk_to_numpy(grid.GetCells().GetConnectivityArray()).reshape(
        -1, 4), fields
