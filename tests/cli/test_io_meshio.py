#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""Files that meshio writes are read exactly, what tetlod writes for Gmsh and as a surface meshio reads; and the formats
by hand where meshio does not write them."""
import numpy as np

from common import case, finish, must, path, read_vtu, report, write
from meshes import converted

try:
    import meshio
except ImportError:
    report('meshio', True, skip='python3-meshio is not installed')
    finish()


def sample(with_fields=True):
    """A cube of tetrahedra with fields of one, three and nine components."""
    must('sample', 'cube', '--size', '4', '-o', path('cube.vtu'))
    points, tets = read_vtu('cube.vtu')[:2]
    random = np.random.default_rng(7)
    points = points.astype(float) + random.random(points.shape) * 0.1
    fields = {'heat': random.standard_normal(len(points)), 'wind': random.standard_normal((len(points), 3)),
              'stress': random.standard_normal((len(points), 9))} if with_fields else {}
    return meshio.Mesh(points, [('tetra', tets), ('triangle', tets[:5, :3])], point_data=fields)


def compare(mesh, name, tolerance=0):
    points, tets, fields = read_vtu(name)
    if not np.allclose(points, mesh.points, rtol=tolerance, atol=tolerance):
        return 'points differ'
    if not np.array_equal(tets, mesh.cells_dict['tetra']):
        return 'tetrahedra differ'
    if sorted(fields) != sorted(mesh.point_data):
        return 'fields %s' % sorted(fields)
    wrong = [f for f in fields if not np.allclose(fields[f], mesh.point_data[f], rtol=tolerance, atol=tolerance)]
    return 'fields %s differ' % wrong if wrong else None


def read_case(extension, mesh, tolerance=0, **options):
    mesh.write(path('in' + extension), **options)
    must('convert', path('in' + extension), '-o', path('out.vtu'))
    return compare(mesh, 'out.vtu', tolerance)


def medit_case(mesh, solution):
    mesh.write(path('in.mesh'), file_format='medit')
    arguments = []
    if solution:
        rows = np.column_stack([mesh.point_data['heat'], mesh.point_data['wind']])
        with open(path('in.sol'), 'w') as file:
            file.write('MeshVersionFormatted 2\nDimension 3\n# values\nSolAtVertices\n%d\n2 1 2\n' % len(rows))
            file.write('\n'.join(' '.join(repr(float(v)) for v in row) for row in rows) + '\nEnd\n')
        arguments = ['--q', path('in.sol')]
    must('convert', path('in.mesh'), *arguments, '-o', path('out.vtu'))
    fields = {'solution': mesh.point_data['heat'], 'solution_2': mesh.point_data['wind']} if solution else {}
    return compare(meshio.Mesh(mesh.points, mesh.cells, point_data=fields), 'out.vtu', 1e-12)


def medit_binary_case(mesh, version, order):
    """All versions and both byte orders; meshio writes some of them, its reader reads all."""
    integer, real = ('i8' if version == 4 else 'i4'), ('f4' if version == 1 else 'f8')
    place = 'i4' if version < 3 else 'i8'
    values = lambda kind, *numbers: np.array(numbers, order + kind).tobytes()

    def file_of(*parts):
        out = values('i4', 1, version)
        for number, content in parts + ((54, b''),):
            end = len(out) + 4 + np.dtype(place).itemsize + len(content)
            out += values('i4', number) + values(place, end if content else 0) + content
        return out

    def rows(block, references):
        row = np.dtype([('a', order + ('f8' if block.dtype.kind == 'f' and
                                       version > 1 else 'f4' if block.dtype.kind == 'f' else integer), block.shape[1]),
                        ('r', order + integer)])
        table = np.zeros(len(block), row)
        table['a'], table['r'] = block, references
        return values(integer, len(block)) + table.tobytes()

    tets = mesh.cells_dict['tetra']
    marks = np.arange(len(tets)) % 3 + 1
    write('in.meshb', file_of((3, values('i4', 3)), (4, rows(mesh.points, 0)), (13, values(integer, 2, 1, 2)),
                              (8, rows(tets + 1, marks))))
    both = np.column_stack([mesh.point_data['heat'], mesh.point_data['wind']])
    write('in.solb', file_of((3, values('i4', 3)),
                             (62, values(integer, len(both)) + values('i4', 2, 1, 2) + values(real, *both.ravel()))))
    p, t, f, c = converted(path('in.meshb'), '--q', path('in.solb'))
    exact = (lambda a: np.asarray(a, np.float32)) if version == 1 else np.asarray
    good = np.array_equal(p, exact(mesh.points)) and np.array_equal(t, tets) and np.array_equal(c['medit:ref'], marks)
    good = good and np.array_equal(f['solution'], exact(both[:, 0])) and np.array_equal(f['solution_2'],
                                                                                        exact(both[:, 1:]))
    return None if good and np.array_equal(meshio.read(path('in.meshb')).cells_dict['tetra'], tets) else 'arrays differ'


def tetgen_case(mesh, first, asked):
    tets = mesh.cells_dict['tetra']
    heat, wind = mesh.point_data['heat'], mesh.point_data['wind'][:, 0]
    with open(path('in.node'), 'w') as file:
        file.write('# points\n%d 3 2 1\n' % len(mesh.points))
        for i, (p, a, b) in enumerate(zip(mesh.points, heat, wind)):
            file.write('%d  %r %r %r %r %r 1 # mark\n' % (i + first, *map(float, p), float(a), float(b)))
    with open(path('in.ele'), 'w') as file:
        file.write('%d 4 1\n' % len(tets))
        for i, t in enumerate(tets):
            file.write('%d %d %d %d %d 7\n' % (i + first, *(t + first)))
    must('convert', path('in' + asked), '-o', path('out.vtu'))
    return compare(meshio.Mesh(mesh.points, mesh.cells, point_data={'attribute': heat, 'attribute_2': wind}), 'out.vtu')


GMSH_BY_HAND = '''$MeshFormat
%s 0 8
$EndMeshFormat
$Comments
$Nodes of nothing
$EndComments
$Nodes
%s
$EndNodes
$Elements
%s
$EndElements
$NodeData
2
"a name"
"a scheme"
1
0.5
4
0
1
5
0
%s
$EndNodeData
'''


def gmsh_case(mesh, version, binary):
    meshio.gmsh.write(path('in.msh'), mesh, fmt_version=version, binary=binary)
    must('convert', path('in.msh'), '-o', path('out.vtu'))
    return compare(mesh, 'out.vtu', 0 if binary else 1e-9)


def gmsh_by_hand(version):
    """Tags in no order, a wedge of the second order beside surface elements, parameters on a surface."""
    points = {7: (0, 0, 0), 3: (1, 0, 0), 12: (0, 1, 0), 9: (0, 0, 1), 1: (5, 5, 5)}
    if version[0] == '2':
        nodes = '5\n' + '\n'.join('%d %g %g %g' % (t, *p) for t, p in points.items())
        elements = '3\n1 2 2 0 1 7 3 12\n2 4 3 0 1 9 7 3 12 9\n3 15 2 0 1 1'
    elif version == '4':
        at = ['%d %g %g %g' % (t, *points[t]) for t in points]
        nodes = '2 5\n1 2 1 2\n%s 0.5 0.5\n%s 0.25 1\n1 3 0 3\n' % tuple(at[:2]) + '\n'.join(at[2:])
        elements = '2 2\n1 2 2 1\n1 7 3 12\n1 3 4 1\n2 7 3 12 9'
    else:
        tags = list(points)
        nodes = '2 5 1 12\n2 1 1 2\n7\n3\n0 0 0 0.5 0.5\n1 0 0 0.25 1\n3 1 0 3\n' + '\n'.join(
            map(str, tags[2:])) + '\n' + '\n'.join('%g %g %g' % points[t] for t in tags[2:])
        elements = '2 2 1 2\n2 1 2 1\n1 7 3 12\n3 1 4 1\n2 7 3 12 9'
    values = '\n'.join('%d %d' % (t, 10 * t) for t in sorted(points))
    with open(path('in.msh'), 'w') as file:
        file.write(GMSH_BY_HAND % (version, nodes, elements, values))
    must('convert', path('in.msh'), '-o', path('out.vtu'))
    got, tets, fields = read_vtu('out.vtu')
    good = (np.array_equal(got, list(points.values())[:4]) and np.array_equal(tets, [[0, 1, 2, 3]])
            and np.array_equal(fields['a name'], [70, 30, 120, 90]))
    return None if good else 'not what was written: %s %s %s' % (got, tets, fields)


def hexahedra_case(extension, **options):
    """A row of two hexahedra, a wedge and a pyramid on it, in the order that each format has for them."""
    points = np.array([(i, j, k) for k in (0, 1) for j in (0, 1) for i in (0, 1, 2)] +
                      [(3, 0, 0), (3, 0, 1), (0.5, 0.5, 2)], float)
    cells = [('hexahedron', [[0, 1, 4, 3, 6, 7, 10, 9], [1, 2, 5, 4, 7, 8, 11, 10]]),
             ('wedge', [[2, 12, 5, 8, 13, 11]]), ('pyramid', [[6, 7, 10, 9, 14]])]
    meshio.Mesh(points, cells).write(path('in' + extension), **options)
    must('convert', path('in' + extension), '-o', path('out.vtu'))
    p, tets, _ = read_vtu('out.vtu')
    p = p.astype(float)[tets]
    volume = np.einsum('ij,ij->i', p[:, 1] - p[:, 0], np.cross(p[:, 2] - p[:, 0], p[:, 3] - p[:, 0])) / 6
    good = len(tets) == 6 + 6 + 3 + 2 and (volume > 0).all() and abs(volume.sum() - 2 - 0.5 - 1 / 3) < 1e-12
    return None if good else '%d tetrahedra, volume %g' % (len(tets), volume.sum())


def write_gmsh_case(mesh):
    mesh.write(path('in.vtu'))
    must('convert', path('in.vtu'), '-o', path('out.msh'))
    got = meshio.read(path('out.msh'))
    good = np.array_equal(got.points, mesh.points) and np.array_equal(got.cells_dict['tetra'], mesh.cells_dict['tetra'])
    wrong = [f for f in mesh.point_data if not np.array_equal(got.point_data[f], mesh.point_data[f])]
    must('convert', path('out.msh'), '-o', path('again.vtu'))
    return compare(mesh, 'again.vtu') if good and not wrong else 'meshio reads %s %s' % (got, wrong)


def surface_case(extension):
    must('sample', 'shell', '-o', path('shell.vtu'))
    must('convert', path('shell.vtu'), '-o', path('out' + extension))
    surface = meshio.read(path('out' + extension))
    p = surface.points[surface.cells_dict['triangle']].astype(float)
    volume = np.einsum('ij,ij->i', p[:, 0], np.cross(p[:, 1], p[:, 2])).sum() / 6
    points, tets, fields = read_vtu('shell.vtu')
    t = points.astype(float)[tets]
    wanted = np.einsum('ij,ij->i', t[:, 1] - t[:, 0], np.cross(t[:, 2] - t[:, 0], t[:, 3] - t[:, 0])).sum() / 6
    if abs(volume - wanted) > 1e-5 or len(p) != 2 * 6 * 10 * 10 * 2:
        return '%d triangles around %g instead of %g' % (len(p), volume, wanted)
    if extension == '.ply':
        at = {tuple(q): s for q, s in zip(points, fields['temperature'])}
        values = surface.point_data['temperature']
        if len(values) != 2 * 602 or any(at[tuple(q)] != s for q, s in zip(surface.points, values)):
            return 'the field differs'
    return None


def main():
    mesh = sample()
    small = meshio.Mesh(mesh.points.astype(np.float32), mesh.cells, point_data={'heat': mesh.point_data['heat']})
    for binary, compression in ((True, 'zlib'), (True, None), (False, None)):
        for header in 'UInt32', 'UInt64':
            label = 'vtu %s %s %s' % ('binary' if binary else 'ascii', compression, header)
            case(label, lambda: read_case('.vtu', mesh, 0 if binary else 1e-9, binary=binary, compression=compression,
                                          header_type=header))
    case('vtu float32', lambda: read_case('.vtu', small))
    for binary in True, False:
        kind = 'binary' if binary else 'ascii'
        case('vtk %s' % kind, lambda: read_case('.vtk', mesh, 0 if binary else 1e-9, binary=binary))
        case('gmsh 2.2 %s' % kind,
             lambda: read_case('.msh', mesh, 0 if binary else 1e-9, file_format='gmsh22', binary=binary))
        case('gmsh 2.2 %s: other cells' % kind, lambda: hexahedra_case('.msh', file_format='gmsh22', binary=binary))
        only_tets = meshio.Mesh(mesh.points, mesh.cells[:1], point_data=mesh.point_data)
        for version in '4.0', '4.1':
            case('gmsh %s %s' % (version, kind), gmsh_case, only_tets, version, binary)
    for version in '2', '2.1', '2.2', '4', '4.1':
        case('gmsh %s by hand' % version, gmsh_by_hand, version)
    case('medit', medit_case, mesh, False)
    case('medit with its solution', medit_case, mesh, True)
    case('medit: other cells', lambda: hexahedra_case('.mesh', file_format='medit'))
    case('medit binary: other cells', lambda: hexahedra_case('.meshb', file_format='medit'))
    for version in range(1, 5):
        for order in '<>':
            case(
                'medit binary, version %d, %s-endian, with its solution' %
                (version, 'big' if order == '>' else 'little'), medit_binary_case, mesh, version, order)
    case('tetgen from 0 by .node', tetgen_case, mesh, 0, '.node')
    case('tetgen from 1 by .ele', tetgen_case, mesh, 1, '.ele')
    case('tetgen as meshio writes it', lambda: read_case('.node', meshio.Mesh(mesh.points, mesh.cells[:1]), 1e-9))
    case('written gmsh', write_gmsh_case, mesh)
    case('written stl', surface_case, '.stl')
    case('written ply', surface_case, '.ply')
    finish()


main()
