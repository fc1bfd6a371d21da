#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""The Python package: what a mesh prints, steps as a sequence, series from arrays, handles that pickle, messages."""
import concurrent.futures
import glob
import os
import pickle
import re
import sys

import numpy as np

ROOT = os.environ['ROOT']
sys.path[:0] = [os.path.join(ROOT, 'tests', 'http'), os.path.join(ROOT, 'client-examples', 'python')]
from raising import raises  # noqa: E402
from served import SCRATCH, TETLOD, Server, run  # noqa: E402

LIBRARY = sorted(glob.glob(os.path.join(ROOT, 'build', os.environ['CONFIG'], 'libtetlod.so.*')))[-1]
os.environ['TETLOD_LIBRARY'], os.environ['TETLOD'] = LIBRARY, TETLOD
os.environ['TETLOD_BUILD_LIBRARY'] = LIBRARY.replace('libtetlod.so', 'libtetlod-build.so')
import tetlod  # noqa: E402
from tetlod._words import speak  # noqa: E402

SIDE = 5


def refuses(*given, **more):
    message = raises(*given, **more)
    assert not re.search(r'(?<!\w)--[a-z]|tetlod_[a-z]+|^tetlod', message) and '\n' not in message, message


def box():
    """A cube of SIDE^3 cubes of six tetrahedra each."""
    n = SIDE + 1
    points = np.stack(np.meshgrid(*[np.arange(n)] * 3, indexing='ij'), -1).reshape(-1, 3) / SIDE
    corner = np.stack(np.meshgrid(*[np.arange(SIDE)] * 3, indexing='ij'), -1).reshape(-1, 3) @ [n * n, n, 1]
    tets = []
    for order in ((0, 1, 2), (1, 2, 0), (2, 0, 1), (0, 2, 1), (2, 1, 0), (1, 0, 2)):
        path = np.cumsum([0] + [(n * n, n, 1)[i] for i in order])
        tets.append(corner[:, None] + (path if order in ((0, 1, 2), (1, 2, 0), (2, 0, 1)) else path[[0, 2, 1, 3]]))
    return points, np.concatenate(tets)


POINTS, TETS = box()
TIMES = np.linspace(0.5, 2.5, 11)
STEPS = [{'p': np.float32(np.sin(POINTS @ [1, 2, 3] + time)), 'wind': POINTS * time} for time in TIMES]


def series():
    return tetlod.build(POINTS, TETS, STEPS, times=TIMES, field=['p', 'wind'], cells={'id': np.arange(len(TETS))})


def test_mesh_prints():
    mesh = tetlod.read(tetlod.build(POINTS, TETS, STEPS[0], cells={'id': np.arange(len(TETS))}, field='p'), error='20%')
    lines = repr(mesh).splitlines()
    assert len(lines) == 3 and '%d tetrahedra' % len(mesh.tets) in lines[0], lines
    assert 'level %d' % mesh.level in lines[0], lines
    assert 'p ' in lines[1] and 'wind (3)' in lines[1] and lines[2] == ' cells: id>', lines
    assert repr(mesh.cells) == '<tetlod.Cells id>', mesh.cells
    empty = tetlod.Mesh(POINTS[:0], TETS[:0], {'p': POINTS[:0, 0]}, 0, float('nan'), {}, 0.0, {})
    assert len(repr(empty).splitlines()) == 3


def test_one_name():
    data = tetlod.build(POINTS, TETS, STEPS[0], field='p')
    for decoder in 'library', 'python':
        assert list(tetlod.read(data, fields='wind', decoder=decoder).fields) == ['wind']
        assert len(tetlod.read(data, '20%', field='p', decoder=decoder).tets) <= len(TETS)
        refuses(KeyError, ["no field 'wnd'", "is 'wind' meant"], tetlod.read, data, fields='wnd', decoder=decoder)
        refuses(KeyError, ["no field 'x'", 'there are p, wind'], tetlod.read, data, '1%', field='x', decoder=decoder)
    assert tetlod.read(data, '20%', field='wind', measure='sampled').error <= 0.2
    only = [k for k in tetlod.open(data).levels if not k.errors['wind']['max'] <= 0.2]
    if only:  # it has no certified error
        refuses(ValueError, ['wind has no certified error (p has)', "measure='sampled'", 'field=[...]'], tetlod.read,
               data, 1e-9, field='wind')


def test_series_of_arrays():
    stream = tetlod.open(series())
    steps = stream.steps
    assert len(steps) == 11 and np.allclose(steps.times,
                                            TIMES) and stream.times == steps.times and steps.sizes == {'time': 11}
    for number, mesh in enumerate(steps):
        order = np.lexsort(mesh.points.T)
        wanted = np.lexsort(POINTS.T)
        assert np.array_equal(mesh.points[order], POINTS[wanted]) and mesh.time == TIMES[number]
        for name in STEPS[number]:
            assert np.array_equal(mesh.fields[name][order], STEPS[number][name][wanted]), (number, name)
    meshes = [steps[i] for i in (0, 4)]
    again = tetlod.open(tetlod.build(meshes, field='p'))
    assert again.times == (0, 1) and np.array_equal(np.sort(again.steps[1].fields['p']), np.sort(meshes[1].fields['p']))
    out = os.path.join(SCRATCH, 'series.tetlod')
    assert tetlod.build(POINTS, TETS, STEPS[:2], output=out) is None and len(tetlod.open(out).steps) == 2


def test_steps_as_xarray_has_them():
    steps = tetlod.open(series()).steps
    same = lambda a, b: np.array_equal(a.fields['p'], b.fields['p']) and a.time == b.time
    assert same(steps[-1], steps.isel(time=10)) and same(steps.sel(time=TIMES[3]), steps[3])
    assert same(steps.sel(time=0.62, method='nearest'),
                steps[1]) and steps.sel(time=slice(0.7, 1.3)).times == tuple(TIMES[1:5])
    assert steps[2:9:3].times == tuple(TIMES[2:9:3]) and len(steps.sel(time=slice(9, 10))) == 0
    coarse = steps.within('5%')
    assert coarse[3].errors['p']['max'] <= 0.05 and len(coarse[3].tets) <= len(steps[3].tets)
    assert coarse[1:3].times == steps[1:3].times
    refuses(KeyError, ['0.62', 'nearest'], steps.sel, 0.62)
    refuses(ValueError, ["'pad'"], steps.sel, 0.62, 'pad')
    refuses(IndexError, ['no step 11', 'there are 11'], steps.__getitem__, 11)
    assert '11 steps' in repr(steps) and len(tetlod.open(tetlod.build(POINTS, TETS, STEPS[0])).steps) == 0


def total(steps):
    return [float(mesh.fields['p'].sum()) for mesh in steps]


def test_parts_for_workers():
    """Steps in the groups that are stored together go to other processes, which open the stream themselves."""
    path = os.path.join(SCRATCH, 'parts.tetlod')
    with open(path, 'wb') as file:
        file.write(series())
    steps = tetlod.open(path).steps
    assert steps.chunks == (8, 3) and steps[5:].chunks == (3, 3) and [len(b) for b in steps.blocks()] == [8, 3]
    with concurrent.futures.ProcessPoolExecutor(2) as pool:
        parts = list(pool.map(total, steps.blocks()))
    assert parts[0] + parts[1] == total(steps)
    stream = pickle.loads(pickle.dumps(tetlod.open(path, error='5%', fields='p').seek(level=3)))
    assert stream.level == 3 and list(stream.mesh.fields) == ['p'] and stream.target < len(stream.levels) - 1
    assert len(pickle.loads(pickle.dumps(tetlod.open(open(path, 'rb').read()))).steps) == 11
    with Server(path) as server:
        far = pickle.loads(pickle.dumps(tetlod.open(server.url + 'v1/meshes/parts')))
        assert far.steps[2].time == TIMES[2]


def test_groups_over_meshes():
    """A series whose mesh changes: parts end where a mesh does."""
    fewer = TETS[:len(TETS) // 2]
    used, local = np.unique(fewer, return_inverse=True)
    mesh = lambda points, tets, fields: tetlod.Mesh(points, tets, fields, 0, 0.0, {}, 0.0, {})
    meshes = [mesh(POINTS, TETS, fields) for fields in STEPS[:3]]
    meshes += [mesh(POINTS[used], local.reshape(-1, 4), {n: v[used] for n, v in fields.items()})
               for fields in STEPS[3:5]]
    steps = tetlod.open(tetlod.build(meshes, times=TIMES[:5], field='p')).steps
    assert steps.times == tuple(TIMES[:5]), steps.times
    found = [len(m.tets) for m in steps]
    assert steps.chunks == (3, 2) and found == [len(TETS)] * 3 + [len(fewer)] * 2, (found, steps.chunks, len(TETS),
                                                                                    len(fewer))


def test_words():
    build = lambda **options: tetlod.build(POINTS, TETS, STEPS[0], **options)
    for program in None, TETLOD:
        refuses(ValueError, ["'T'"], build, field='T', program=program)
        refuses(ValueError, ['growth'], build, growth=99.0, program=program)
        refuses(ValueError, ['position_bits'], build, position_bits=99, program=program)
        refuses(ValueError, ['NaN', 'numpy.nan_to_num'] if program else ['NaN'], tetlod.build, POINTS, TETS,
               {'a': np.full(len(POINTS), np.nan)}, program=program)
    refuses(TypeError, ["'nonsense='"], build, nonsense=3)
    refuses(TypeError, ['times=', 'list'], build, times=[1])
    refuses(ValueError, ['2 times, 1 steps'], tetlod.build, POINTS, TETS, STEPS[:1], times=[1, 2])
    refuses(ValueError, ['rise'], tetlod.build, POINTS, TETS, STEPS[:2], times=[1, 1])
    refuses(ValueError, ["'wind'"], tetlod.build, POINTS, TETS, [STEPS[0], {'p': STEPS[1]['p']}], field=['p', 'wind'])
    assert speak('tetlod: a.vtu: give --nan-fill VALUE; --field A') == 'a.vtu: give nan_fill=VALUE; field=A'
    assert speak('a-b -- c --x') == 'a-b -- c x='


run([test_mesh_prints, test_one_name, test_series_of_arrays, test_steps_as_xarray_has_them, test_parts_for_workers,
     test_groups_over_meshes,
     test_words])
