#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""Sources of the Python package beside paths (functions, files, headers, queries), its lazy sequences, and its readers
and writers for PyVista (a stub where there is none), meshio and xarray."""
import glob
import http.server
import importlib.util
import os
import pickle
import re
import subprocess
import sys
import threading
import types
import urllib.request

import numpy as np

ROOT = os.environ['ROOT']
sys.path.insert(0, os.path.join(ROOT, 'tests', 'http'))
from raising import raises  # noqa: E402
from served import SCRATCH, TETLOD, Server, run  # noqa: E402

PACKAGE = os.path.join(ROOT, 'client-examples', 'python')
os.environ['TETLOD_LIBRARY'] = sorted(glob.glob(os.path.join(ROOT, 'build', 'release', 'libtetlod.so.*')))[-1]
os.environ['TETLOD_BUILD_LIBRARY'] = os.environ['TETLOD_LIBRARY'].replace('libtetlod.so', 'libtetlod-build.so')
import tetlod  # noqa: E402

FIN, WAKE = (os.path.join(SCRATCH, name) for name in ('fin.tetlod', 'wake.tetlod'))
MOVING = os.path.join(ROOT, 'tests', 'golden', 'series_moving.tetlod')


def same(a, b):
    return a.level == b.level and np.array_equal(a.points, b.points) and np.array_equal(a.tets, b.tets) and \
        a.fields.keys() == b.fields.keys() and all(np.array_equal(a.fields[name], b.fields[name]) for name in a.fields)


def fetch(offset, size):
    fetch.asked.append((offset, offset + size))
    with open(FIN, 'rb') as file:
        file.seek(offset)
        return file.read(size)


fetch.asked = []


def test_functions_and_files():
    """A function, and a file that is open: no byte is fetched twice, and a stream of a function pickles."""
    coarse, whole = tetlod.read(FIN, error='5%'), tetlod.read(FIN)
    for decoder in 'library', 'python':
        del fetch.asked[:]
        with tetlod.open(fetch, error='5%', decoder=decoder) as stream:
            assert same(stream.seek(error='5%').mesh, coarse)
            assert max(end for _, end in fetch.asked) <= max(65536, coarse_bytes(coarse)), fetch.asked
            assert same(stream.seek().mesh, whole)
        asked = sorted(fetch.asked)
        assert all(a[1] <= b[0] for a, b in zip(asked, asked[1:])) and len(asked) <= 4, asked
    again = pickle.loads(pickle.dumps(tetlod.open(fetch).seek(error='5%')))
    assert same(again.mesh, coarse)
    with open(FIN, 'rb') as file:
        assert same(tetlod.read(file, error='5%'), coarse)
    raises(tetlod.StreamError, 'too early', tetlod.read, lambda offset, size: fetch(offset, size)[:-1])
    raises(ValueError, 'headers= go with requests', tetlod.open, FIN, headers={'X-Key': 'secret'})
    raises(ValueError, 'ask reads a path', tetlod.open(fetch).ask, 'mean(Pressure)')


def coarse_bytes(mesh):
    return tetlod.open(FIN).levels[mesh.level].bytes


class Host(http.server.BaseHTTPRequestHandler):
    """Answers who has the key and the signature, also in front of a tetlod server."""
    behind = None

    def do_GET(self):
        if self.headers.get('X-Key') != 'secret' or 'sig=a%2Fb' not in self.path:
            return self.send_error(403)
        if self.path.startswith('/v1/'):
            return self.pass_on(re.sub(r'[?&]sig=a%2Fb', '', self.path))
        with open(FIN, 'rb') as file:
            data = file.read()
        first, last = map(int, re.findall(r'\d+', self.headers['Range']))
        part = data[first:last + 1]
        self.send_response(206)
        self.send_header('Content-Range', 'bytes %d-%d/%d' % (first, first + len(part) - 1, len(data)))
        self.send_header('Content-Length', str(len(part)))
        self.end_headers()
        self.wfile.write(part)

    def pass_on(self, path):
        asked = urllib.request.Request(Host.behind + path[1:])
        if self.headers['Range']:
            asked.add_header('Range', self.headers['Range'])
        with urllib.request.urlopen(asked) as answer:
            self.send_response(answer.status)
            for name in 'Content-Length', 'Content-Range', 'ETag':
                if answer.headers[name]:
                    self.send_header(name, answer.headers[name])
            self.end_headers()
            self.wfile.write(answer.read())

    def log_message(self, *_):
        pass


def check_example(name, url, mesh):
    """The C example takes them, too."""
    program = os.path.join(SCRATCH, name)
    built = subprocess.run(['cc', '-I' + os.path.join(ROOT, 'format'), '-o', program,
                            os.path.join(ROOT, 'client-examples', 'c', name + '.c'),
                            os.path.join(ROOT, 'build', 'release', 'libtetlod.a'), '-lcurl', '-lm', '-pthread'],
                           stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    assert built.returncode == 0, built.stdout
    done = subprocess.run([program, url, '0.05', 'X-Other: 1', 'X-Key: secret'], stdout=subprocess.PIPE, text=True)
    assert done.returncode == 0 and ' %d tetrahedra' % len(mesh.tets) in done.stdout, (name, done.stdout)
    assert subprocess.run([program, url, '0.05'], stderr=subprocess.DEVNULL).returncode == 1


def test_headers_and_queries():
    """Both go with every request: of a host, and of a tetlod server."""
    coarse, whole, key = tetlod.read(FIN, error='5%'), tetlod.read(FIN), {'X-Key': 'secret'}
    host = http.server.ThreadingHTTPServer(('127.0.0.1', 0), Host)
    threading.Thread(target=host.serve_forever, daemon=True).start()
    place = 'http://127.0.0.1:%d/' % host.server_address[1]
    with Server(FIN) as server:
        Host.behind = server.url
        for url in place + 'fin.tetlod?sig=a%2Fb', place + 'v1/meshes/fin?sig=a%2Fb':
            stream = tetlod.open(url, error='5%', headers=key)
            assert same(stream.seek(error='5%').mesh, coarse) and same(stream.seek().mesh, whole), url
            assert same(pickle.loads(pickle.dumps(stream)).mesh, whole)
            raises(OSError, '403', tetlod.open, url)
            raises(OSError, '403', tetlod.open, url.split('?')[0], headers=key)
        for name, url in ('callback', place + 'fin.tetlod?sig=a%2Fb'), ('fetch', place + 'v1/meshes/fin?sig=a%2Fb'):
            check_example(name, url, coarse)
    host.shutdown()
    host.server_close()


def test_sequences():
    """Levels and fields by key; what they give is what `read` and `at` give; the stream stays where it is."""
    stream, wake = tetlod.open(FIN).seek(4), tetlod.open(WAKE)
    assert len(stream) == len(stream.levels) and same(stream[3], tetlod.read(FIN, level=3)) and stream.level == 4
    assert same(stream[-1], tetlod.read(FIN)) and [mesh.level for mesh in stream[2:7:2]] == [2, 4, 6]
    assert stream[2:7:2].levels == stream.levels[2:7:2] and stream[2:7][1].level == 3
    field = stream['Pressure']
    assert len(field) == len(stream) and field.times == () and len(field[1:3]) == 2
    assert np.array_equal(field[5], tetlod.read(FIN, level=5).fields['Pressure']) and stream.level == 4
    assert list(field.meshes[5].fields) == ['Pressure']  # the others are not decoded
    steps = wake['Pressure']
    assert steps.times == wake.times and np.array_equal(steps[2], wake.steps[2].fields['Pressure'])
    assert np.array_equal(steps.sel(time=wake.times[3]), steps.isel(time=3)) and len(steps.sel(time=slice(0, 0.3))) == 3
    assert np.array_equal(steps.within('5%')[1], wake.at(wake.times[1], '5%').fields['Pressure'])
    raises(KeyError, 'Pressure', lambda: stream['T'])
    raises(IndexError, 'no level 999', lambda: stream[999])
    raises(ValueError, 'has no steps', field.sel, time=0)


PYVISTA = '''
"""As much of PyVista 0.48 as finds readers and writers: by entry points, by the ending of a name."""
import os
from importlib.metadata import entry_points
from vtkmodules.vtkCommonDataModel import vtkUnstructuredGrid

def handler(group, path):
    found = [e for e in entry_points(group='pyvista.' + group) if e.name == os.path.splitext(str(path))[1].lower()]
    return found[0].load()

class UnstructuredGrid(vtkUnstructuredGrid):
    def save(self, filename, binary=True, texture=None, **kwargs):
        handler('writers', filename)(self, str(filename), **kwargs)

def read(filename, **kwargs):
    return handler('readers', filename)(str(filename), **kwargs)

def wrap(grid):
    made = UnstructuredGrid()
    made.DeepCopy(grid)
    return made
'''


def environment():
    """The package as it is when it is installed, and PyVista or a stub of it."""
    folder = os.path.join(SCRATCH, 'site')
    environment = {k: v for k, v in os.environ.items() if k not in ('MAKEFLAGS', 'MAKELEVEL', 'MFLAGS')}
    subprocess.run(['make', '-s', '-C', ROOT, 'install-python', 'pythondir=' + folder], check=True, env=environment)
    if importlib.util.find_spec('pyvista') is None:
        with open(os.path.join(folder, 'pyvista.py'), 'w') as file:
            file.write(PYVISTA)
    return dict(environment, PYTHONPATH=folder)


def python(code, where, *arguments):
    done = subprocess.run(['/usr/bin/python3', '-c', code, *arguments], env=where, cwd=SCRATCH, text=True,
                          stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT)
    assert done.returncode == 0, done.stdout
    return done.stdout.split()


def test_pyvista():
    """`pyvista.read` and `mesh.save`, found by the entry points of the installed package."""
    code = 'import pyvista, sys; mesh = pyvista.read(sys.argv[1], error=0.05); print(mesh.GetNumberOfCells()); ' \
        'mesh.save("saved.tetlod", field="Pressure", keep_order=True); ' \
        'print(pyvista.read("saved.tetlod").GetNumberOfCells())'
    mesh = tetlod.read(FIN, error=0.05)
    assert python(code, environment(), FIN) == [str(len(mesh.tets))] * 2
    made = tetlod.open(os.path.join(SCRATCH, 'saved.tetlod'))
    assert [field.name for field in made.fields if field.controlled] == ['Pressure'] and len(made.fields) == 3
    from tetlod.adapters import write_pyvista
    surface = types.SimpleNamespace(IsA=lambda name: False)
    raises(TypeError, 'cannot become a stream', write_pyvista, surface, 'surface.tetlod')


ANYWIDGET = '''
"""As much of anywidget as a widget calls: attributes, and messages of both directions."""
import traitlets
class AnyWidget(traitlets.HasTraits):
    def __init__(self, **attributes):
        super().__init__(**attributes)
        self.sent = []
    def on_msg(self, call):
        self.hear = lambda content: call(self, content, [])
    def send(self, content, buffers=None):
        self.sent.append((content, [bytes(one) for one in buffers]))
'''


def test_widget():
    """The installed package has the module; the kernel's side gives bytes of any source, and says what goes wrong."""
    if importlib.util.find_spec('traitlets') is None:
        return 'traitlets is not installed'
    where = environment()
    with open(os.path.join(where['PYTHONPATH'], 'anywidget.py'), 'w') as file:
        file.write(ANYWIDGET)
    code = """
import sys, tetlod
data = open(sys.argv[1], 'rb').read()
w = tetlod.widget(sys.argv[1], 0.05, field='Pressure')
assert (w.error, w.field, w.height) == ('0.05', 'Pressure', 480) and len(w._esm) > 500000 and 'render' in w._esm
for offset, size in (0, 64), (100, 999), (len(data) - 5, 64), (len(data), 1):
    w.hear({'question': 'q', 'offset': offset, 'size': size})
    assert w.sent.pop() == ({'answer': 'q'}, [data[offset:offset + size]]), offset
for bad in {'question': 'q', 'offset': -1, 'size': 5}, {'question': 'q'}, {'question': 'q', 'offset': 'x', 'size': 1}:
    w.hear(bad)
    reply, buffers = w.sent.pop()
    assert reply['answer'] == 'q' and reply['error'] and not buffers, reply
print('good')
"""
    assert python(code, where, FIN) == ['good']
    return None


def test_meshio():
    import meshio
    tetlod.register_meshio()
    mesh, out = meshio.read(FIN), os.path.join(SCRATCH, 'meshio.tetlod')
    whole = tetlod.read(FIN)
    assert np.array_equal(mesh.points, whole.points) and set(mesh.point_data) == set(whole.fields)
    meshio.write(out, mesh)
    again = tetlod.read(out)
    assert len(again.tets) == len(whole.tets) and set(again.fields) == set(whole.fields)


def check_lazy(open_dataset, backend):
    """The index is read; levels are sought for values alone."""
    sought, seek = [], tetlod.Stream._seek
    tetlod.Stream._seek = lambda self, level: (sought.append(level), seek(self, level))[1]
    try:
        whole, lazy = tetlod.open(FIN), open_dataset(FIN, engine=backend)
        assert lazy.sizes['tet'] == whole.info.tets and sought == []
        assert lazy.Density.shape == (whole.info.vertices,) and len(lazy.Density.values) and sought != []
    finally:
        tetlod.Stream._seek = seek


def test_xarray():
    """Time is a coordinate, fields are variables; nothing is decoded before values are asked for."""
    if importlib.util.find_spec('xarray') is None:
        return 'xarray is not installed'
    import xarray
    from tetlod._xarray import TetlodBackend
    wake, fin, moving = tetlod.open(WAKE), tetlod.read(FIN, error='5%'), tetlod.open(MOVING)
    series = xarray.open_dataset(WAKE, engine=TetlodBackend, error='5%')
    step = wake.at(0.3, '5%')
    assert tuple(series.time.values) == wake.times and series.attrs['tetlod_id'] == wake.info.cid
    assert np.array_equal(series.Pressure.sel(time=0.3, method='nearest'), step.fields['Pressure'])
    some = [mesh.fields['Pressure'][5:9] for mesh in wake.steps.within('5%')[1:4]]
    assert np.array_equal(series.Pressure[1:4, 5:9].values, some)
    assert np.array_equal(series.points, step.points) and np.array_equal(series.tets, step.tets)
    level = xarray.open_dataset(FIN, engine=TetlodBackend, error='5%', drop_variables='Density')
    assert np.array_equal(level.points, fin.points) and np.array_equal(level.Velocity[7], fin.fields['Velocity'][7])
    assert set(level.data_vars) == {'tets', 'Pressure', 'Velocity'} and level.Pressure.attrs['max_error'] <= 0.05
    check_lazy(xarray.open_dataset, TetlodBackend)
    moved = xarray.open_dataset(MOVING, engine=TetlodBackend, error=0)
    assert moved.points.dims == ('time', 'vertex', 'xyz') and np.array_equal(moved.points[-1], moving.steps[-1].points)
    raises(ValueError, 'the meshes of the steps differ', xarray.open_dataset,
           os.path.join(ROOT, 'tests', 'golden', 'topologies.tetlod'), engine=TetlodBackend)
    code = 'import xarray, sys; print(xarray.open_dataset(sys.argv[1], error="5%").sizes["tet"])'  # by its ending
    assert python(code, environment(), FIN) == [str(len(fin.tets))]
    return None


for command in (('sample', 'fin', '--size', '14', '-o', 'fin.vtu'), ('build', 'fin.vtu', '-o', FIN, '--quiet'),
                ('sample', 'wake', '--size', '8', '--steps', '9', '-o', 'wake.pvd'),
                ('build', 'wake.pvd', '--field', 'Pressure', '-o', WAKE, '--quiet')):
    subprocess.run([TETLOD, *command], cwd=SCRATCH, check=True, stdout=subprocess.DEVNULL)
run([test_functions_and_files, test_headers_and_queries, test_sequences, test_pyvista, test_meshio, test_xarray,
     test_widget])
