#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""What others take: USD's TetMesh held against its schema, values at points, points with weights that integrate a level
exactly, and verify of a URL by ranges."""
import csv
import glob
import os
import re
import sys

import numpy as np
import vtk
from vtk.util.numpy_support import vtk_to_numpy

from common import ROOT, Host, case, fails, finish, info, must, path, report, tetlod, write

sys.path.insert(0, os.path.join(ROOT, 'client-examples', 'python'))
# Python cannot load the library that the sanitizers have changed: the program is the one that they look at
os.environ['TETLOD_LIBRARY'] = glob.glob(os.path.join(ROOT, 'build', 'release', 'libtetlod.so.*'))[0]
import tetlod as client  # noqa: E402
from tetlod._build import write_vtu  # noqa: E402

# ---- USD

ATTRIBUTE = re.compile(r'^    (?:uniform )?([a-z0-9]+)(\[\])? ([A-Za-z0-9_:]+) = (.*?)(?: \(\n(.*?)\n    \))?$',
                       re.M | re.S)
WIDTHS = {'int3': 3, 'int4': 4, 'point3f': 3, 'float2': 2, 'float3': 3, 'float4': 4,
          'double2': 2, 'double3': 3, 'double4': 4}


def usd(name):
    """The attributes of the one prim: type, values, metadata."""
    text = open(path(name), encoding='utf-8').read()
    head, body = re.fullmatch(r'#usda 1\.0\n\((.*?)\n\)\n\ndef TetMesh "mesh"\n\{\n(.*)\}\n', text, re.S).groups()
    found = {}
    for statement in re.split(r'\n(?=    \S)(?!    \))', '\n' + body.rstrip('\n'))[1:]:
        kind, array, key, value, more = ATTRIBUTE.fullmatch(statement).groups()
        assert key not in found, key
        if array:
            numbers = re.sub(r'[()\[\]\s]', '', value)
            parts = [part for part in numbers.split(',') if part]
            value = np.array(parts, float).reshape(-1, WIDTHS.get(kind, 1))
            assert re.fullmatch(r'\[[^\[\]]*\]', value if isinstance(value, str) else '[]')
        found[key] = (kind, value, dict(re.findall(r'(\w+) = "?((?:[^"\\\n]|\\.)*)"?', more or '')))
    return head, found


def usd_case():
    points, tets, fields, cells = odd_mesh()
    must('extract', 'odd.tetlod', '-o', 'odd.usda', '--quiet')
    must('extract', 'odd.tetlod', '-o', 'odd.vtu', '--quiet')
    mesh = client.read(path('odd.tetlod'))
    head, found = usd('odd.usda')
    assert 'defaultPrim = "mesh"' in head and 'upAxis = "Z"' in head
    kinds = {key: kind for key, (kind, _, _) in found.items() if ':' not in key}
    assert kinds == {'extent': 'float3', 'orientation': 'token', 'tetVertexIndices': 'int4', 'points': 'point3f',
                     'surfaceFaceVertexIndices': 'int3'}, kinds
    place, corners = found['points'][1], found['tetVertexIndices'][1].astype(int)
    assert np.array_equal(place.astype('f4'), mesh.points.astype('f4')) and np.array_equal(corners, mesh.tets)
    assert np.allclose(found['extent'][1], [place.min(axis=0), place.max(axis=0)])
    sides = {tuple(sorted(face)): face for face in found['surfaceFaceVertexIndices'][1].astype(int).tolist()}
    count = {}
    for tet in corners.tolist():
        for f in range(4):
            face = tuple(sorted(tet[:f] + tet[f + 1:]))
            count.setdefault(face, []).append(tet[f])
    assert sides.keys() == {face for face, inside in count.items() if len(inside) == 1}
    for face, (a, b, c) in sides.items():  # right-handed: the normal leads away from the corner inside
        normal = np.cross(place[b] - place[a], place[c] - place[a])
        assert normal @ (place[count[face][0]] - place[a]) < 0
    vars_ = {key[9:]: value for key, value in found.items() if key.startswith('primvars:')}
    names = {re.sub(r'\\(.)', r'\1', data['displayName']): (key, kind, values, data)
             for key, (kind, values, data) in vars_.items()}
    assert all(re.fullmatch('[A-Za-z_][A-Za-z0-9_]*', key) for key in vars_) and len(names) == len(vars_) == 6
    assert names['2 hot'][0] == '_2_hot' and names['2_hot'][0] == '_2_hot_2'
    for name in fields:
        key, kind, values, data = names[name]
        wanted = np.asarray(mesh.fields[name], float).reshape(len(points), -1)
        assert data['interpolation'] == 'vertex' and np.array_equal(values.reshape(wanted.shape), wanted), name
        assert data.get('elementSize') == (str(wanted.shape[1]) if wanted.shape[1] > 4 else None)
    kind, data = names['part'][1], names['part'][3]
    assert kind == 'int64' and data['interpolation'] == 'uniform'
    assert np.array_equal(names['part'][2].ravel(), mesh.cells['part'])
    must('extract', 'fin.tetlod', '--error', '2%', '-o', 'coarse.usda', '--quiet')
    assert 'string "tetlod_id" = "%s"' % info('fin.tetlod')['cid'] in usd('coarse.usda')[0]


def odd_mesh():
    """Six tetrahedra in a cube, with names that are no words of USD."""
    points = np.array([(x, y, z) for z in (0, 1) for y in (0, 1) for x in (0, 1)], float) * [1, 2, 3]
    tets = np.array([(0, 1, 3, 7), (0, 3, 2, 7), (0, 5, 1, 7), (0, 4, 5, 7), (0, 2, 6, 7), (0, 6, 4, 7)])
    base = points[:, 0] + points[:, 1]**2
    fields = {'2 hot': base.astype('f4'), '2_hot': base * 2, 'flow': np.column_stack([base, -base, base + 1]),
              'stress': np.column_stack([base * i for i in range(6)]), 'say "ü"\\': base - 1}
    return points, tets, fields, {'part': np.arange(6, dtype='i4')}


# ---- values at points

def inside(mesh, point):
    """Values at a point by the first tetrahedron that has it."""
    for t, tet in enumerate(mesh.tets):
        p = mesh.points[tet]
        weights = np.linalg.solve(np.vstack([p.T, np.ones(4)]), [*point, 1])
        if weights.min() > -1e-9:
            return {name: weights @ values[tet] for name, values in mesh.fields.items()}, t
    return None, None


def probe_case(extension):
    mesh = client.read(path('fin.tetlod'), error='5%')
    rng = np.random.default_rng(1)
    points = mesh.points.min(axis=0) + rng.random((20, 3)) * np.ptp(mesh.points, axis=0)
    lines = ['x;y;z', '# a note', *('%.17g, %.17g\t%.17g, more' % tuple(p) for p in points)]
    write('points.txt', '\n'.join(lines) + '\n')
    must('extract', 'fin.tetlod', '--error', '5%', '--points', 'points.txt', '-o', 'probed' + extension, '--quiet')
    if extension == '.csv':
        rows = list(csv.reader(open(path('probed.csv'), encoding='utf-8')))
        assert rows[0][:5] == ['x', 'y', 'z', 'inside', 'Pressure'], rows[0]
        table = {name: [row[i] for row in rows[1:]] for i, name in enumerate(rows[0])}
        read = lambda name: np.array([float(text) if text else np.nan for text in table[name]])  # noqa: E731
        place, is_inside, pressure, flow = (np.column_stack([read(c) for c in 'xyz']), read('inside'), read('Pressure'),
                                            np.column_stack([read('Velocity:%d' % c) for c in range(3)]))
    else:
        reader = vtk.vtkXMLPolyDataReader()
        reader.SetFileName(path('probed.vtp'))
        reader.Update()
        out = reader.GetOutput()
        data = {name: vtk_to_numpy(out.GetPointData().GetArray(name)) for name in ('inside', 'Pressure', 'Velocity')}
        place, is_inside, pressure, flow = (vtk_to_numpy(out.GetPoints().GetData()), data['inside'], data['Pressure'],
                                            data['Velocity'])
        assert out.GetNumberOfVerts() == len(points)
    assert np.array_equal(place, points)
    for i, point in enumerate(points):
        wanted, _ = inside(mesh, point)
        assert bool(is_inside[i]) == (wanted is not None), i
        if wanted is None:
            assert np.isnan(pressure[i]) and np.isnan(flow[i]).all()
        else:
            assert abs(pressure[i] - wanted['Pressure']) < 1e-9 and np.allclose(flow[i], wanted['Velocity'], atol=1e-9)
    assert 0 < is_inside.sum() < len(points)


def given_points_case():
    must('extract', 'odd.tetlod', '--points', '0.5,1,1.5;9,9,9', '-o', 'two.csv', '--quiet')
    rows = list(csv.DictReader(open(path('two.csv'), encoding='utf-8')))
    assert [row['inside'] for row in rows] == ['1', '0'] and rows[1]['part'] == '' and int(rows[0]['part']) in range(6)


# ---- points with weights

def load(name):
    with np.load(path(name)) as file:
        return {key: file[key] for key in file.files}


def integrals(mesh):
    p = mesh.points[mesh.tets]
    volume = np.abs(np.linalg.det(p[:, 1:] - p[:, :1])) / 6
    return volume.sum(), {name: np.tensordot(volume, values[mesh.tets].mean(axis=1), 1)
                          for name, values in mesh.fields.items()}


def weights_case():
    mesh = client.read(path('fin.tetlod'), error='2%')
    volume, wanted = integrals(mesh)
    for seed, count in ((0, 100), (7, 2000)):
        must('sample-points', 'fin.tetlod', '--error', '2%', '--count', str(count), '--seed', str(seed), '-o', 'p.npz')
        found = load('p.npz')
        assert found.keys() == {'points', 'weights', *('values/' + name for name in mesh.fields)}
        weights = found['weights']
        assert found['points'].shape == (count, 3) and weights.shape == (count,) and weights.min() > 0
        assert abs(weights.sum() - volume) < 1e-12 * volume
        for name, integral in wanted.items():
            values = found['values/' + name]
            scale = np.abs(values).max() * volume
            assert np.abs(np.tensordot(weights, values, 1) - integral).max() < 1e-12 * scale, name
    for i in range(0, 2000, 200):
        values, _ = inside(mesh, found['points'][i])
        assert abs(values['Pressure'] - found['values/Pressure'][i]) < 1e-9
    half = found['points'][:, 0] < np.median(mesh.points[:, 0])
    assert 0.1 < half.mean() < 0.9  # all over the mesh
    again, other = ['sample-points', 'fin.tetlod', '--error', '2%', '--count', '2000', '-o'], load('p.npz')
    must(*again, 'again.npz', '--seed', '7')
    assert open(path('again.npz'), 'rb').read() == open(path('p.npz'), 'rb').read()
    must(*again, 'again.npz', '--seed', '8')
    assert not np.array_equal(load('again.npz')['points'], other['points'])


def box_case():
    """Of a box: its volume, and the integrals that a fine sum gives."""
    box = (0.25, 0.5, 0.5, 0.75, 1.5, 9)
    must('sample-points', 'odd.tetlod', '--box', ','.join(map(str, box)), '--count', '500', '-o', 'box.npz')
    found, low, high = load('box.npz'), np.array(box[:3]), np.array((0.75, 1.5, 3))
    assert ((found['points'] >= low - 1e-12) & (found['points'] <= high + 1e-12)).all()
    assert abs(found['weights'].sum() - np.prod(high - low)) < 1e-12
    part = (low + high) / 2  # of the cube, 2_hot is 2 (x + y^2 at the corners): in x it is linear everywhere
    mean = (found['weights'] @ found['points']) / np.prod(high - low)
    assert np.allclose(mean, part, atol=0.05)
    mesh, samples = client.read(path('odd.tetlod')), np.random.default_rng(3).random((4000, 3))
    fine = np.mean([inside(mesh, low + at * (high - low))[0]['2_hot'] for at in samples])
    total = found['weights'] @ found['values/2_hot']
    assert abs(total / np.prod(high - low) - fine) < 0.02, (total, fine)


# ---- verify of a URL

def verify_url_case():
    data = open(path('fin.tetlod'), 'rb').read()
    with Host({'fin.tetlod': data}) as host:
        done = must('verify', host.url + 'fin.tetlod')
        assert done.stdout.decode() == host.url + 'fin.tetlod: ok\n' and host.sent == len(data), host.asked
        host.files['fin.tetlod'] = data[:len(data) // 2] + bytes([data[len(data) // 2] ^ 1]) + data[len(data) // 2 + 1:]
        done = tetlod('verify', host.url + 'fin.tetlod')
        assert done.returncode == 3 and b'checksum' in done.stderr and done.stderr.count(b'\n') == 1, done


def main():
    points, tets, fields, cells = odd_mesh()
    write_vtu(path('odd.vtu'), points, tets, fields, cells)
    must('build', 'odd.vtu', '-o', 'odd.tetlod', '--quiet', '--no-region')
    must('sample', 'fin', '--size', '8', '-o', 'fin.vtu')
    must('build', 'fin.vtu', '-o', 'fin.tetlod', '--quiet')
    case('USD', usd_case)
    for extension in ('.csv', '.vtp'):
        case('values at points: ' + extension, probe_case, extension)
    case('points on the command line', given_points_case)
    case('points with weights', weights_case)
    case('points in a box', box_case)
    if b'without libcurl' not in tetlod('ask', 'http://127.0.0.1:1/', 'mean(x)').stderr:
        case('verify of a URL', verify_url_case)
    fails('--points into a mesh', 2, ['--points', '.csv'], 'extract', 'fin.tetlod', '--points', '0,0,0', '-o', 'x.vtu')
    fails('no such points', 1, ['nothing.txt'], 'extract', 'fin.tetlod', '--points', 'nothing.txt', '-o', 'x.csv')
    write('bad.txt', '0 0 0\n1 2\n')
    fails('a line that is no point', 2, ['bad.txt', 'line 2'], 'extract', 'fin.tetlod', '--points', 'bad.txt', '-o',
          'x.csv')
    fails('a box outside', 2, ['fin.tetlod', 'nothing of the mesh'], 'sample-points', 'fin.tetlod', '--box',
          '90,90,90,91,91,91', '--count', '9', '-o', 'x.npz')
    fails('too few points', 2, ['too few', 'more than 6'], 'sample-points', 'fin.tetlod', '--count', '6', '-o', 'x.npz')
    fails('no count', 2, ['--count'], 'sample-points', 'fin.tetlod', '-o', 'x.npz')
    report('no file is left', not glob.glob(path('x.*')))
    return finish()


if __name__ == '__main__':
    sys.exit(main())
