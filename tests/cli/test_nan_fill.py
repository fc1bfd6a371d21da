#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""NaN values of fields: refused by name, or filled (--nan-fill), whatever format they come in."""
import json

import numpy as np

from common import fails, finish, info, path, read_vtu, report, succeeds, tetlod, write

try:
    import meshio
except ImportError:
    report('NaN values', True, skip='python3-meshio is not installed')
    finish()

HOLES = [0, 17, 18, 60]


def sample():
    """A cube of tetrahedra with two fields; one has holes."""
    tetlod('sample', 'cube', '--size', '4', '-o', 'cube.vtu')
    points, tets, _ = read_vtu('cube.vtu')
    random = np.random.default_rng(7)
    heat, wind = 1 + random.random(len(points)), random.random((len(points), 3))
    heat[HOLES] = np.nan
    return meshio.Mesh(points.astype(float), [('tetra', tets)], point_data={'heat': heat, 'wind': wind})


def tetgen(mesh):
    rows = ['%d %r %r %r %r' % (i, *map(float, p), float(s))
            for i, (p, s) in enumerate(zip(mesh.points, mesh.point_data['heat']))]
    write('in.node', '%d 3 1 0\n%s\n' % (len(rows), '\n'.join(rows)))
    tets = mesh.cells_dict['tetra']
    write('in.ele', '%d 4 0\n%s\n' % (len(tets), '\n'.join('%d %d %d %d %d' % (i, *t) for i, t in enumerate(tets))))
    return ['in.node']


def medit(mesh):
    mesh.write(path('in.mesh'), file_format='medit')
    heat = mesh.point_data['heat']
    write('in.sol', 'MeshVersionFormatted 2\nDimension 3\nSolAtVertices\n%d\n1 1\n%s\nEnd\n' %
          (len(heat), '\n'.join(repr(float(v)) for v in heat)))
    return ['in.mesh', '--q', 'in.sol']


def written(mesh, extension, **options):
    mesh.write(path('in' + extension), **options)
    return ['in' + extension]


def plot3d(kind):
    dims = np.array([4, 4, 4], '<i4').tobytes()
    k, j, i = np.meshgrid(*[np.arange(4)] * 3, indexing='ij')
    values = np.random.default_rng(3).random((5, 64)) + 1
    values[4, HOLES] = np.nan
    write('in.xyz', dims + np.array([i.ravel(), j.ravel(), k.ravel()]).astype('<' + kind).tobytes())
    write('in.q', dims + np.concatenate([[1, 2, 3, 4], values.ravel()]).astype('<' + kind).tobytes())
    return ['in.xyz', '--q', 'in.q']


def by_hand(values, tets):
    """The documented mean, ring by ring."""
    values = values.copy()
    while np.isnan(values).any():
        filled = values.copy()
        for v in np.flatnonzero(np.isnan(values)):
            around = values[np.unique(tets[(tets == v).any(1)])]  # each neighbour once
            if not np.isnan(around).all():
                filled[v] = np.nanmean(around)
        values = filled
    return values


def reader(name, field, arguments, filled=len(HOLES)):
    fails('%s: NaN is refused by name' % name, 3, [field, 'NaN', '--nan-fill', arguments[0].split('.')[0]], 'convert',
          *arguments, '-o', 'out.vtu')
    done = tetlod('convert', *arguments, '--nan-fill', '7', '-o', 'seven.vtu')
    report('%s: --nan-fill 7 says how many' % name, done.returncode == 0 and
           b': %d NaN values filled' % filled in done.stderr, done)
    done = tetlod('convert', *arguments, '--nan-fill', 'neighbours', '-o', 'means.vtu')
    (points, tets, sevens), (_, _, means) = read_vtu('seven.vtu'), read_vtu('means.vtu')
    s, m = sevens[field].astype(float), means[field].astype(float)
    holes = np.flatnonzero(s == 7)
    rest = np.setdiff1d(np.arange(len(s)), holes)
    report('%s: the value is where NaN was, nowhere else' % name, np.array_equal(holes, HOLES) and
           np.isfinite(s).all(), holes)
    s[holes] = np.nan
    wanted = by_hand(s, tets)
    report('%s: the means of the points around' % name, np.array_equal(m[rest], s[rest]) and
           np.allclose(m, wanted, rtol=1e-6), (m[holes], wanted[holes]))


def readers(mesh):
    scalar = meshio.Mesh(mesh.points, mesh.cells, point_data={'heat': mesh.point_data['heat']})
    for binary, compression in ((True, 'zlib'), (True, None), (False, None)):
        reader('vtu %s %s' % ('binary' if binary else 'ascii', compression), 'heat',
               written(mesh, '.vtu', binary=binary, compression=compression))
    for binary in True, False:
        kind = 'binary' if binary else 'ascii'
        reader('vtk ' + kind, 'heat', written(mesh, '.vtk', binary=binary))
        reader('gmsh 2.2 ' + kind, 'heat', written(mesh, '.msh', file_format='gmsh22', binary=binary))
        reader('gmsh 4.1 ' + kind, 'heat', written(mesh, '.msh', file_format='gmsh', binary=binary))
    reader('tetgen', 'attribute', tetgen(scalar))
    reader('medit', 'solution', medit(scalar))
    for kind in 'f4', 'f8':
        reader('plot3d ' + kind, 'StagnationEnergy', plot3d(kind), 2 * len(HOLES))  # the pressure's are found from it


def build(mesh):
    mesh.write(path('holes.vtu'))
    fails('build: refused by name', 3, ['heat', 'NaN', '--nan-fill'], 'build', 'holes.vtu', '-o', 'x.tetlod', '--quiet')
    done = tetlod('build', 'holes.vtu', '-o', 'holes.tetlod', '--nan-fill', 'neighbours', '--json')
    report('build: reports how many were filled', done.returncode == 0 and b'4 NaN values filled' in done.stderr and
           json.loads(done.stdout)['nan_filled'] == 4, done)
    metadata = info('holes.tetlod')['metadata']
    report('build: the metadata says so', metadata['nan_filled'] == 4 and
           metadata['options']['nan_fill'] == 'neighbours', metadata)
    succeeds('verify --against with the same filling', 'verify', 'holes.tetlod', '--against', 'holes.vtu',
             '--nan-fill', 'neighbours')
    fails('verify --against without', 3, ['heat', 'NaN'], 'verify', 'holes.tetlod', '--against', 'holes.vtu', '--quiet')
    fails('verify --against with another', 3, ['heat'], 'verify', 'holes.tetlod', '--against', 'holes.vtu',
          '--nan-fill', '-1',
          '--quiet')
    fails('a number is decimal', 2, ['--nan-fill', '0x10'], 'convert', 'holes.vtu', '-o', 'x.vtu', '--nan-fill', '0x10')
    tetlod('build', 'holes.vtu', '-o', 'value.tetlod', '--nan-fill', '-1.5', '--quiet')
    metadata = info('value.tetlod')['metadata']
    report('build: a negative number', metadata['options']['nan_fill'] == -1.5 and
           info('value.tetlod')['fields'][0]['range'][0] == -1.5, metadata)
    tetlod('build', 'cube.vtu', '-o', 'cube.tetlod', '--quiet')
    tetlod('build', 'cube.vtu', '-o', 'same.tetlod', '--nan-fill', '3', '--quiet')
    report('build: without NaN nothing is filled', info('same.tetlod')['metadata']['nan_filled'] == 0 and
           'nan_filled' not in info('cube.tetlod')['metadata'])


def corners(mesh):
    """What cannot be filled, and what need not be."""
    for words, value in ((['--nan-fill', 'nan'], 'nan'), (['--nan-fill', 'much'], 'much'), (['--nan-fill'], '')):
        fails('--nan-fill %r' % value, 2, words, 'convert', 'holes.vtu', '--nan-fill', value, '-o', 'x.vtu')
    heat = np.full(len(mesh.points), np.nan)
    meshio.Mesh(mesh.points, mesh.cells, point_data={'heat': heat}).write(path('none.vtu'))
    fails('no value at all to fill from', 3, ['heat', 'NaN'], 'convert', 'none.vtu', '--nan-fill', 'neighbours', '-o',
          'x.vtu')
    succeeds('no value at all, but one is given', 'convert', 'none.vtu', '--nan-fill', '2', '-o', 'x.vtu')
    heat = np.append(mesh.point_data['heat'], np.nan)
    points = np.append(mesh.points, [[9, 9, 9]], 0)
    meshio.Mesh(points, mesh.cells, point_data={'heat': heat}).write(path('loose.vtu'))
    done = tetlod('convert', 'loose.vtu', '--nan-fill', 'neighbours', '-o', 'x.vtu')
    report('a point that nothing uses is dropped, not filled', done.returncode == 0 and
           b'4 NaN values' in done.stderr and
           len(read_vtu('x.vtu')[0]) == len(mesh.points), done)
    heat = mesh.point_data['heat'].copy()
    heat[3] = np.inf
    meshio.Mesh(mesh.points, mesh.cells, point_data={'heat': heat}).write(path('inf.vtu'))
    fails('infinity is not filled', 3, ['heat', 'point 3'], 'convert', 'inf.vtu', '--nan-fill', '1', '-o', 'x.vtu')


mesh = sample()
readers(mesh)
build(mesh)
corners(mesh)
finish()
