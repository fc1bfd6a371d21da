#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""The Python package: both decoders, every source, the meshes of other packages, building, types, doctests, the
notebook."""
import contextlib
import ctypes
import doctest
import glob
import http.server
import importlib.util
import io
import json
import os
import pathlib
import re
import shutil
import subprocess
import sys
import threading
import warnings
from unittest import mock

import numpy as np

ROOT = os.environ['ROOT']
sys.path[:0] = [os.path.join(ROOT, 'tests', folder) for folder in ('http', 'cli', '')]
from common import read_vtu  # noqa: E402
from streams import plain, sealed  # noqa: E402
from raising import raises  # noqa: E402
from served import SCRATCH, TETLOD, Server, run  # noqa: E402

PACKAGE = os.path.join(ROOT, 'client-examples', 'python')
LIBRARY = sorted(glob.glob(os.path.join(ROOT, 'build', os.environ['CONFIG'], 'libtetlod.so.*')))[-1]
os.environ['TETLOD_LIBRARY'] = LIBRARY
os.environ['TETLOD_BUILD_LIBRARY'] = BUILD_LIBRARY = LIBRARY.replace('libtetlod.so', 'libtetlod-build.so')
sys.path.insert(0, PACKAGE)
import tetlod  # noqa: E402
from tetlod import _build_library, _library, _model, reference  # noqa: E402

HAS_PYVISTA = importlib.util.find_spec('pyvista') is not None
FIN = os.path.join(SCRATCH, 'fin.tetlod')


def same(a, b):
    return np.array_equal(a.points, b.points) and np.array_equal(a.tets,
                                                                 b.tets) and a.fields.keys() == b.fields.keys() and \
        all(np.array_equal(a.fields[name], b.fields[name]) for name in a.fields) and a.level == b.level and \
        (a.error == b.error or a.error != a.error and b.error != b.error)


def command(*arguments):
    subprocess.run([TETLOD, *arguments], check=True, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL,
                   stderr=subprocess.DEVNULL)


def test_both_decoders_agree():
    for path in sorted(glob.glob(os.path.join(ROOT, 'tests', 'golden', '*.tetlod'))):
        streams = [tetlod.open(path, decoder=decoder) for decoder in ('library', 'python')]
        a, b = (stream.info for stream in streams)
        assert repr(a) == repr(b), path
        count = len(a.levels)
        for level in (*range(count), count // 2, 0, count - 1):
            meshes = [stream.seek(level).mesh for stream in streams]
            assert same(*meshes), (path, level)
            assert all(np.array_equal(meshes[0].cells[name], meshes[1].cells[name], equal_nan=True) and
                       len(meshes[0].cells[name]) == len(meshes[0].tets) for name in a.cells), (path, level)


def test_local_bound():
    """Both decoders know whose error a field bounds; where there is no such field, it is an ordinary one."""
    with open(os.path.join(ROOT, 'tests', 'golden', 'local_bound.tetlod'), 'rb') as file:
        data = file.read()
    for decoder in ('library', 'python'):
        assert [f.bounds for f in tetlod.open(data, decoder=decoder).fields] == [None, None, None, 'Pressure']
        for name in (b'Pressure bounX', b'pressure bound', b'Density  bound'):
            other = sealed(plain(data).replace(b'Pressure bound', name))
            assert [f.bounds for f in tetlod.open(other, decoder=decoder).fields] == [None] * 4


def test_levels_are_those_of_the_program():
    from vtkmodules.util.numpy_support import vtk_to_numpy
    from vtkmodules.vtkIOXML import vtkXMLUnstructuredGridReader
    for error in ('0.2%', '1%', '30%'):
        out = os.path.join(SCRATCH, 'level.vtu')
        command('extract', FIN, '--error', error, '-o', out)
        reader = vtkXMLUnstructuredGridReader()
        reader.SetFileName(out)
        reader.Update()
        grid, mesh = reader.GetOutput(), tetlod.read(FIN, error=error)
        for made in (grid, mesh.to_vtk()):
            assert np.array_equal(vtk_to_numpy(made.GetPoints().GetData()), mesh.points)
            assert np.array_equal(vtk_to_numpy(made.GetCells().GetConnectivityArray()).reshape(-1, 4), mesh.tets)
            assert all(np.array_equal(vtk_to_numpy(made.GetPointData().GetArray(name)),
                                      mesh.fields[name]) for name in mesh.fields)
        assert mesh.error <= float(error[:-1]) / 100 and made.GetCellType(0) == 10


def test_choices():
    with open(os.path.join(ROOT, 'tests', 'choices', 'choices.json')) as file:
        table = json.load(file)
    fields = [_model.Field(f['name'], 1, 'float64', tuple(f['range']), f['controlled']) for f in table['fields']]
    levels = [_model.Level(k['level'], k.get('vertices', 0), k.get('tets', 0), k.get('bytes', 0), 0,
                           k['errors']) for k in table['levels']]
    for question in table['questions']:
        choice = _model.Choice(**{name: value for name, value in question.items() if name != 'level'})
        assert _model.level_for(fields, levels, choice) == question['level'], question
    raises(ValueError, 'no level', _model.level_for, fields, levels, _model.Choice(error=1.0, field='carried'))
    assert tetlod.read(FIN, tets=5000).level == max(k.level for k in tetlod.open(FIN).levels if k.tets <= 5000)
    assert tetlod.read(FIN, bytes=50000).level == max(k.level for k in tetlod.open(FIN).levels if k.bytes <= 50000)
    raises(ValueError, 'give one of', tetlod.read, FIN, error=0.1, level=3)
    raises(ValueError, 'not negative', tetlod.read, FIN, error=float('nan'))
    raises(ValueError, 'no measure', tetlod.read, FIN, error=1, measure='exact')
    raises(KeyError, 'Pressure', tetlod.read, FIN, error=1, field='T')
    raises(KeyError, 'Pressure', tetlod.read, FIN, fields=['T'])
    raises(ValueError, 'no level 999', tetlod.read, FIN, level=999)


def test_local_sources():
    mesh = tetlod.read(FIN, error=0.02)
    with open(FIN, 'rb') as file:
        data = file.read()
    for source in (pathlib.Path(FIN), data, bytearray(data), memoryview(data)):
        assert same(tetlod.read(source, error=0.02), mesh)
    raises(OSError, 'none.tetlod', tetlod.read, os.path.join(SCRATCH, 'none.tetlod'))
    one = tetlod.read(data, error=0.02, fields=['Pressure'])
    assert list(one.fields) == ['Pressure'] and np.array_equal(one.fields['Pressure'], mesh.fields['Pressure'])
    for decoder in ('library', 'python'):
        raises(tetlod.StreamError, 'tetlod.build makes one', tetlod.read, b'VTU ' * 100, decoder=decoder)
        raises(tetlod.StreamError, '', tetlod.read, b'', decoder=decoder)
        raises(ValueError, 'such as 0.01', tetlod.read, FIN, error='1 m', decoder=decoder)
        changed = bytearray(data)
        changed[len(data) // 2] ^= 1
        raises(tetlod.StreamError, '', tetlod.read, changed, decoder=decoder)


def test_arrays_are_safe():
    """They are read-only, live longer than the stream, and those of a stream do not change when it moves."""
    mesh = tetlod.read(FIN)
    tets = mesh.tets
    raises(ValueError, 'read-only', tets.__setitem__, (0, 0), 1)
    assert not mesh.tets.flags.owndata  # no copy
    copied = tets.copy()
    del mesh
    for _ in range(3):
        tetlod.read(FIN, level=0)
    assert np.array_equal(tets, copied)
    for decoder in ('library', 'python'):
        stream = tetlod.open(FIN, decoder=decoder)
        first = stream.mesh
        kept = first.points.copy(), first.tets.copy(), first.fields['Pressure'].copy()
        assert stream.refine() and stream.refine() and not np.array_equal(stream.mesh.points.shape, first.points.shape)
        assert all(np.array_equal(*pair) for pair in zip(kept, (first.points, first.tets, first.fields['Pressure'])))
        assert stream.coarsen() and stream.coarsen() and not stream.coarsen() and same(stream.mesh, first)


def test_cut_off():
    with open(FIN, 'rb') as file:
        data = file.read()
    ends = [level.bytes for level in tetlod.open(data).levels]
    for decoder in ('library', 'python'):
        with warnings.catch_warnings(record=True) as warned:
            warnings.simplefilter('always')
            warnings.simplefilter('ignore', ResourceWarning)  # what earlier tests left open may be collected here
            mesh = tetlod.read(data[:ends[7] + 10], decoder=decoder)
        assert mesh.level == 7 and 'levels 0 to 7 of' in str(warned[0].message) and len(warned) == 1
        raises(tetlod.StreamError, 'levels 0 to 7', tetlod.read, data[:ends[7]], error=0.001, decoder=decoder)
        assert tetlod.read(data[:ends[7]], level=3, decoder=decoder).level == 3
        raises(tetlod.StreamError, 'cut off', tetlod.read, data[:ends[0] - 1], decoder=decoder)


def test_server():
    wanted = tetlod.read(FIN, error=0.01)
    with Server(FIN) as server:
        url = server.url + 'v1/meshes/fin'
        for decoder in ('library', 'python'):
            reports = []
            with tetlod.open(url, error=0.01, decoder=decoder,
                             progress=lambda *report: reports.append(report)) as stream:
                for mesh in stream:
                    pass
                assert same(mesh, wanted) and stream._source.requests == 1
                assert reports[-1] == (wanted_bytes(wanted), wanted_bytes(wanted))
                assert (stream.refine() and stream._source.requests == 2
                        and same(stream.mesh,
                                 tetlod.open(FIN).seek(wanted.level + 1).mesh))
                assert np.array_equal(stream.mesh.tets, tetlod.read(FIN, level=wanted.level + 1).tets)
                assert stream.seek(0).level == 0 and stream._source.requests == 2
        assert same(tetlod.read(server.url + 'view/fin#field=Pressure', error=0.01), wanted)
        assert same(tetlod.read(url), tetlod.read(FIN))
        assert np.array_equal(tetlod.read(url, abs_error=0.1, field='Pressure').tets,
                              tetlod.read(FIN, abs_error=0.1, field='Pressure').tets)
        raises(OSError, '404', tetlod.read, server.url + 'v1/meshes/none')
        raises(OSError, "'T'", tetlod.read, url, error=0.1, field='T')
        # any host that answers Range requests
        static = '%s/%s/stream' % (url, tetlod.open(FIN).info.cid)
        with tetlod.open(static, error=0.01) as stream:
            assert same(stream.seek(error=0.01).mesh, wanted) and stream._source.requests <= 2
            assert len(stream._source.data) <= max(65536, wanted_bytes(wanted))
    raises(OSError, 'v1/meshes/fin', tetlod.read, url)  # nobody listens


def wanted_bytes(mesh):
    return tetlod.open(FIN).levels[mesh.level].bytes


def some_levels():
    """One in the middle of the sample's levels, and a later one."""
    count = len(tetlod.open(FIN).levels)
    return count // 2, 3 * count // 4


class Slow(http.server.BaseHTTPRequestHandler):
    """A host without Range: sends a stream's first half, and the rest when the test lets it."""
    requests, rest = [], threading.Event()

    def do_GET(self):
        self.requests.append(self.path)
        with open(FIN, 'rb') as file:
            data = file.read()
        self.send_response(200)
        self.send_header('Content-Length', str(len(data)))
        self.end_headers()
        half = tetlod.open(data).levels[some_levels()[0]].bytes
        self.wfile.write(data[:half])
        self.wfile.flush()
        if 'broken' not in self.path:
            self.rest.wait(60)
            self.wfile.write(data[half:])

    def log_message(self, *_):
        pass


def test_cells_cut_off():
    """Every whole level, with those values of cells that are whole."""
    mesh, made = tetlod.read(FIN), os.path.join(SCRATCH, 'cut-cells.tetlod')
    cells = {'one': np.arange(len(mesh.tets)) % 3, 'two': np.linspace(0, 1, len(mesh.tets))}
    tetlod.build(mesh.points, mesh.tets, mesh.fields, cells=cells, output=made, program=TETLOD, field='Pressure')
    stream = reference.open(made)
    with open(made, 'rb') as file:
        whole = file.read()
    ends = [section['offset'] + section['stored'] for section in stream.sections if section['tag'] == 'CVAL']
    for decoder in ('library', 'python'):
        for size, level, held in ((stream.levels[4]['bytes'], 4, []), (ends[0], len(stream.levels) - 1, ['one']),
                                  (ends[1] - 1, len(stream.levels) - 1, ['one'])):
            with warnings.catch_warnings(record=True) as warned:
                warnings.simplefilter('always')
                warnings.simplefilter('ignore', ResourceWarning)
                found = tetlod.read(whole[:size], decoder=decoder)
            assert (found.level == level and list(found.cells) == held and 'two' not in found.cells
                    and 'values of cells' in str(warned[0].message))
            wanted = tetlod.read(whole, level=level, decoder=decoder)
            assert np.array_equal(wanted.points,
                                  found.points) and all(np.array_equal(wanted.cells[name],
                                                                       found.cells[name]) for name in held)
            found.to_vtk()


def test_cells():
    """Values of tetrahedra, of a file and of a server, which is asked for them alone."""
    mesh = tetlod.read(FIN)
    material = (mesh.points[mesh.tets].mean(axis=1)[:, 0] > 0).astype('i4')
    made = os.path.join(SCRATCH, 'material.tetlod')
    tetlod.build(mesh.points, mesh.tets, mesh.fields, cells={'material': material}, output=made, program=TETLOD,
                 field='Pressure')
    level = tetlod.read(made, error=0.02)
    assert (list(level.cells) == ['material'] and set(level.cells['material']) == {0, 1}
            and level.cells['material'].dtype.kind == 'i')
    assert level.to_meshio().cell_data['material'][0].shape == (len(level.tets),)
    assert level.to_vtk().GetCellData().GetArray('material').GetNumberOfTuples() == len(level.tets)
    with Server(made) as server:
        for decoder in ('library', 'python'):
            stream = tetlod.open(server.url + 'v1/meshes/material', error=0.02, decoder=decoder)
            found = stream.seek(error=0.02).mesh
            assert stream._source.requests == 1 and np.array_equal(found.cells['material'], level.cells['material'])
            assert stream._source.requests == 2 and len(stream._source.data) == stream.levels[found.level].bytes


def make_series(steps):
    out, made = os.path.join(SCRATCH, 'wake.pvd'), os.path.join(SCRATCH, 'wake.tetlod')
    command('sample', 'wake', '--size', '8', '--steps', str(steps), '-o', out)
    command('build', out, '--field', 'Pressure', '--carry', 'Velocity', '--bands', '5%,1%', '-o', made)
    return made


def test_series():
    """Steps in time: both decoders, the program, damage, a server that sends only what a step needs."""
    made = make_series(12)
    golden = os.path.join(ROOT, 'tests', 'golden', 'series_float')
    for path in (golden + '32.tetlod', golden + '64.tetlod', golden.replace('float', 'moving.tetlod'), made):
        streams = [tetlod.open(path, decoder=decoder) for decoder in ('library', 'python')]
        times = streams[0].times
        assert len(times) > 8 and times == streams[1].times
        for time, choice in ((times[3], {}), (0.7 * times[7] + 0.3 * times[8], {'error': '10%'}),
                             (times[0] - 1e-9, {'abs_error': 1e9}),
                             (times[2], {'error': 1.0})):
            a, b = meshes = [stream.at(time, **choice) for stream in streams]
            assert same(a, b) and a.time == b.time and a.errors == b.errors and a.fields, (path, time)
            assert a.time == min(times,
                                 key=lambda t: abs(t -
                                                   time)) and a.error <= (0.1 if choice == {'error': '10%'} else 1.0)
            assert all(stream.level == -1 for stream in streams)  # it stays where it was
        for stream, far in zip(streams, (-1e300, times[-1] + 2)):
            raises(ValueError, 'the nearest is', stream.at, far)
            if choice != {'error': 1.0}:
                options = [word
                           for name, value in choice.items() for word in ('--' + name.replace('_', '-'), str(value))]
                command('extract', path, '--time', repr(time), *options, '-o', os.path.join(SCRATCH, 'step.vtu'))
                points, tets, fields = read_vtu('step.vtu')
                assert (np.array_equal(points, a.points) and np.array_equal(tets, a.tets)
                        and fields.keys() == a.fields.keys()), path
                assert all(fields[name].tobytes() == a.fields[name].astype(fields[name].dtype).tobytes()
                           for name in fields), (path, time)
        for name in meshes[0].fields:
            raises(ValueError, 'read-only', a.fields[name].__setitem__, 0, 1.0)
        assert list(tetlod.open(path, fields=[name]).at(0).fields) == [name]
    refused_steps(made)
    with Server(made) as server:
        for decoder in ('library', 'python'):
            stream = tetlod.open(server.url + 'v1/meshes/wake', error=1.0, decoder=decoder)
            assert same(stream.at(0.5, '5%'), tetlod.open(made).at(0.5, '5%'))
            level = stream.levels[stream.at(0.5, '5%').level]
            assert len(stream._source.data) == level.bytes < stream.levels[-1].bytes, (len(stream._source.data), level)
            static = '%sv1/meshes/wake/%s/stream' % (server.url, stream.info.cid)
            with mock.patch.multiple(tetlod._sources, FIRST=2048,
                                     CHUNK=2048):  # the table of steps needs none of the levels
                stream = tetlod.open(static, decoder=decoder)
                assert (len(stream.times) == 12
                        and len(stream._source.data) < stream.levels[-1].bytes / 2), len(stream._source.data)


def refused_steps(made):
    with open(made, 'rb') as file:
        data = bytearray(file.read())
    cut = bytes(data[:tetlod.open(made).levels[-1].bytes])
    data[-20] ^= 1  # in the last group of steps
    for decoder in ('library', 'python'):
        stream = tetlod.open(made, decoder=decoder)
        assert tetlod.open(FIN, decoder=decoder).times == ()
        raises(ValueError, 'no series', tetlod.open(FIN, decoder=decoder).at, 0)
        raises(ValueError, 'a time', stream.at, float('nan'))
        raises(ValueError, 'give one', stream.at, 0, 0.1, abs_error=1)
        raises(ValueError, 'not negative', stream.at, 0, -1)
        raises(tetlod.StreamError, 'steps', tetlod.open(data, decoder=decoder).at, 1)
        raises(tetlod.StreamError, '', tetlod.open(cut, level=0, decoder=decoder).at, 1)


def test_levels_while_bytes_arrive():
    server = http.server.ThreadingHTTPServer(('127.0.0.1', 0), Slow)
    threading.Thread(target=server.serve_forever, daemon=True).start()
    url = 'http://127.0.0.1:%d/' % server.server_address[1]
    early, last = some_levels()
    try:
        for decoder in ('library', 'python'):
            Slow.requests.clear()
            Slow.rest.clear()
            with warnings.catch_warnings(record=True) as warned:
                warnings.simplefilter('always')
                with tetlod.open(url + 'fin.tetlod', level=last, decoder=decoder) as stream:
                    seen = []
                    for mesh in stream:
                        seen.append(mesh.level)
                        if mesh.level == early:
                            Slow.rest.set()  # that level came before the bytes of the next one were sent
            assert seen == list(range(last + 1)) and len(Slow.requests) == 1
            assert any('does not answer Range' in str(w.message) for w in warned)
            assert same(mesh, tetlod.read(FIN, level=last))
        with warnings.catch_warnings():
            warnings.simplefilter('ignore')
            with tetlod.open(url + 'broken') as stream:
                raises(tetlod.StreamError, 'after', stream.seek)
    finally:
        server.shutdown()
        server.server_close()


def canonical(mesh):
    """Tetrahedra as points and values, in an order that does not depend on numbering."""
    rows = np.hstack([mesh.points,
                      *(np.reshape(mesh.fields[name], (len(mesh.points), -1)) for name in sorted(mesh.fields))])
    corners = rows[mesh.tets]
    sortable = np.sort(np.ascontiguousarray(corners).view([('', corners.dtype)] * corners.shape[2])[..., 0], axis=1)
    return np.sort(sortable, axis=0)


def test_build():
    import meshio
    mesh = tetlod.read(FIN, fields=['Pressure', 'Velocity'])
    wanted = canonical(mesh)
    pressure = dict(field='Pressure', program=TETLOD)
    command('extract', FIN, '-o', os.path.join(SCRATCH, 'whole.vtu'))
    for source in ((mesh,), (mesh.points, mesh.tets, mesh.fields), (mesh.to_meshio(),), (mesh.to_vtk(),)):
        data = tetlod.build(*source, **pressure)
        stream = tetlod.open(data)
        assert ([f.name for f in stream.fields if f.controlled] == ['Pressure']
                and np.array_equal(canonical(tetlod.read(data)), wanted))
    out = os.path.join(SCRATCH, 'made.tetlod')
    assert tetlod.build(mesh.points, mesh.tets, {'Pressure': mesh.fields['Pressure'].astype('f4')}, output=out,
                        max_error=0.1, **pressure) is None
    assert tetlod.open(out).fields[0].type == 'float32' and tetlod.read(out, level=0).error <= 0.1
    whole = meshio.read(os.path.join(SCRATCH, 'whole.vtu'))
    tetlod.register_meshio()
    os.environ['TETLOD'] = TETLOD
    meshio.write(out, whole)
    assert len(meshio.read(out).cells_dict['tetra']) == len(mesh.tets)
    raises(ValueError, "'T'", tetlod.build, mesh, program=TETLOD, field='T')
    raises(ValueError, 'points', tetlod.build, mesh.points, mesh.tets, {'a': [1.0]}, program=TETLOD)
    raises(TypeError, 'tets', tetlod.build, mesh.points, program=TETLOD)
    raises(ValueError, '(m, 4)', tetlod.build, mesh.points, mesh.tets[:, :3], program=TETLOD)


def test_build_by_library():
    """The library's bytes are those of the program; progress, cancelling, what is wrong."""
    mesh = tetlod.read(FIN, fields=['Pressure', 'Velocity'])
    fields = {'Pressure': mesh.fields['Pressure'].astype('f4'), 'Velocity': mesh.fields['Velocity']}
    arrays = mesh.points.astype('f4'), mesh.tets, fields
    cells = {'material': (np.arange(len(mesh.tets)) % 3).astype('u1'), 'volume': np.linspace(0, 1, len(mesh.tets))}
    for options in (dict(field='Pressure'),
                    dict(field=['Velocity:mag', 'Pressure:2%'], max_error='10%', region='none', threads=2),
                    dict(field='Pressure', certify='exact',
                         min_tets=len(mesh.tets) // 2, keep_order=True, field_bits=16)):
        wanted = tetlod.build(*arrays, cells=cells, program=TETLOD, **options)
        phases = []
        # a byte each; the metadata end where the object does
        text = wanted[wanted.index(b'{"program":'):].decode('latin-1')
        metadata = text[:json.JSONDecoder().raw_decode(text)[1]].encode('latin-1').decode()
        made = tetlod.build(*arrays, cells=cells, metadata=metadata,
                            progress=lambda phase, done: phases.append((phase, done)), **options)
        assert made == wanted, options
        order = [p for i, (p, _) in enumerate(phases) if i == 0 or phases[i - 1][0] != p]
        assert order == ['contract', 'measure',
                         'encode'][-len(order):] and len(order) >= (2 if 'certify' in options else 3), (options, phases)
        assert all(0 <= done <= 1 for _, done in phases)
    out = os.path.join(SCRATCH, 'by_library.tetlod')
    assert (tetlod.build(mesh, output=out, max_error=0.1) is None and len(tetlod.read(out).tets) == len(mesh.tets)
            and not os.path.exists(out + '.part'))
    raises(InterruptedError, 'cancelled', tetlod.build, mesh, progress=lambda phase, done: False)
    raises(ZeroDivisionError, 'division', tetlod.build, mesh, progress=lambda phase, done: 1 / 0)
    raises(ValueError, "'T'", tetlod.build, mesh, field='T')
    raises(ValueError, 'growth', tetlod.build, mesh, growth=99.0)
    raises(ValueError, 'points', tetlod.build, mesh.points, mesh.tets + 10 ** 6, {'a': mesh.fields['Pressure']})
    raises(ValueError, 'NaN', tetlod.build, mesh.points, mesh.tets, {'a': np.full(len(mesh.points), np.nan)})
    def controlled(*arguments, **options):
        return [field.name for field in tetlod.open(tetlod.build(*arguments, **options)).fields if field.controlled]

    assert controlled(mesh.points, mesh.tets)[0].startswith('coordinate_')
    two = {'a': mesh.points[:, 0] ** 2, 'b': mesh.points[:, 1] ** 2, 'number': np.arange(len(mesh.points))}
    assert controlled(mesh.points, mesh.tets, two) == ['a', 'b'] and controlled(mesh.points, mesh.tets, two,
                                                                                no_field='a') == ['b']
    raises(ValueError, 'beyond 2^53', tetlod.build, mesh.points, mesh.tets, fields,
           cells={'i': np.full(len(mesh.tets), 2 ** 60)})
    raises(TypeError, 'complex', tetlod.build, mesh.points, mesh.tets, {'a': np.zeros(len(mesh.points), complex)})
    raises(TypeError, 'progress=', tetlod.build, mesh, program=TETLOD, progress=print)


def test_pyvista():
    if not HAS_PYVISTA:
        return 'pyvista is not installed'
    import pyvista
    grid = tetlod.read(FIN, error=0.1).to_pyvista()
    assert isinstance(grid, pyvista.UnstructuredGrid) and grid.n_cells == len(tetlod.read(FIN, error=0.1).tets)
    return None


def test_structs_are_those_of_the_header():
    """Sizes and places of members as a C compiler lays them out."""
    pairs = {
        'tetlod_error': _library.CError, 'tetlod_source': _library.CSource, 'tetlod_field': _library.CField,
        'tetlod_level': _library.CLevel, 'tetlod_cell_field': _library.CCellField, 'tetlod_band': _library.CBand,
        'tetlod_series_info': _library.CSeriesInfo, 'tetlod_info': _library.CInfo, 'tetlod_mesh': _library.CMesh,
        'tetlod_build_array': _build_library.CArray, 'tetlod_build_mesh': _build_library.CMesh,
        'tetlod_build_options': _build_library.COptions
    }
    lines = ['printf("%%zu\\n", sizeof(struct %s));' % name for name in pairs]
    wanted = [ctypes.sizeof(struct) for struct in pairs.values()]
    for name, struct in pairs.items():
        for member, _ in struct._fields_:
            lines.append('printf("%%zu\\n", offsetof(struct %s, %s));' % (name, member))
            wanted.append(getattr(struct, member).offset)
    source, program = os.path.join(SCRATCH, 'layout.c'), os.path.join(SCRATCH, 'layout')
    with open(source, 'w') as file:
        file.write(
            '#include <stddef.h>\n#include <stdio.h>\n#include "src/library/tetlod_build.h"\nint '
            'main(void)\n{\n%s\nreturn 0;\n}\n'
            % '\n'.join(lines))
    subprocess.run(['cc', '-I' + ROOT, source, '-o', program], check=True)
    assert [int(n) for n in subprocess.check_output([program]).split()] == wanted


def test_documents():
    """Doctests of the package, code of its README, the notebook."""
    os.chdir(SCRATCH)
    assert doctest.testmod(tetlod).failed == 0 and doctest.testmod(tetlod).attempted > 4
    with Server(FIN) as server:
        with open(os.path.join(PACKAGE, 'README.md')) as file:
            blocks = re.findall(r'```python\n(.*?)```', file.read(), re.S)
        mesh = tetlod.read(FIN)
        make_series(8)
        names = {'points': mesh.points, 'tets': mesh.tets, 'temperature': mesh.fields['Pressure'],
                 'grid': with_names(mesh)}
        os.environ['TETLOD'] = TETLOD
        for block in blocks:
            code = block.replace('http://127.0.0.1:8080/', server.url).replace(
                'https://example.org/data/fin.tetlod',
                '%sv1/meshes/fin/%s/stream' % (server.url, tetlod.open(FIN).info.cid))
            with contextlib.redirect_stdout(io.StringIO()):
                exec(compile(code if HAS_PYVISTA else re.sub('.*to_pyvista.*', '', code), 'README.md', 'exec'), names)
        with open(os.path.join(PACKAGE, 'tetlod.ipynb')) as file:
            notebook = json.load(file)
        cells, names = [c for c in notebook['cells'] if c['cell_type'] == 'code'], {}
        assert len(cells) > 3
        for cell in cells:
            with contextlib.redirect_stdout(io.StringIO()):
                exec(compile(''.join(cell['source']), 'tetlod.ipynb', 'exec'), names)


def with_names(mesh):
    grid = mesh.to_vtk()
    for old, new in (('Pressure', 'p'), ('Velocity', 'U')):
        grid.GetPointData().GetArray(old).SetName(new)
    return grid


def test_types():
    if not shutil.which('mypy'):
        return 'mypy is not installed'
    done = subprocess.run(['mypy', '--config-file', 'pyproject.toml', '--cache-dir', os.path.join(SCRATCH, 'mypy'),
                           'tetlod'], cwd=PACKAGE,
                          stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    assert done.returncode == 0, done.stdout
    return None


command('sample', 'fin', '--size', '18', '-o', os.path.join(SCRATCH, 'fin.vtu'))
command('build', os.path.join(SCRATCH, 'fin.vtu'), '--field', 'Pressure', '-o', FIN)
run([
    test_both_decoders_agree, test_local_bound, test_levels_are_those_of_the_program, test_choices, test_local_sources,
    test_arrays_are_safe, test_cut_off, test_cells_cut_off, test_server, test_cells, test_series,
    test_levels_while_bytes_arrive, test_build, test_build_by_library, test_pyvista,
    test_structs_are_those_of_the_header, test_documents, test_types
])
