#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""Why files that people hold did not build: each cause has a file, which builds and verifies, or is refused with a
reason that is right.

| cause | test |
|---|---|
| no arrays at all; ids, integers or a constant at points; values of cells only; text | `bare_case` here |
| a hint to give an option that was given | `hints` here |
| values far below and far above one | `far_values` here |
| degenerate and duplicate tetrahedra | `flat_or_double` here |
| every tetrahedron has points of its own | `loose` here |
| a vector or a field that is constant but for its unit | `test_defaults.py` |
| pyramids of 14 points: Gmsh, CGNS, Exodus | `pyramid14_case` here |
| VTKHDF without Type, hexahedra | `untyped_hexahedra` here; tetrahedra: `test_io_libraries.py` |
| Exodus "small model"; its vectors and tensors as VTK names them | `test_io_exodus.py` |
| Gmsh 2.0, 2.1, 4.0 | `test_io_meshio.py`, `gmsh_by_hand` and `gmsh_case` |
| Lagrange cells up to order 4 | `test_io_lagrange.py`; of order 5: `order_five` here |
| EnSight 6; variables of some nodes or elements | `test_io_ensight6.py` |
| MFEM; NURBS refused by name | `test_io_mfem.py` |
"""
import re

import numpy as np
import vtk

import results
from common import case, finish, info, must, path, read_vtu, tetlod, write
from meshes import volumes

try:
    import cgns_file
except OSError:  # no libcgns
    cgns_file = None


def built(name):
    """Builds and verifies; what the build says."""
    said = must('build', name, '-o', 'built.tetlod').stderr.decode()
    must('verify', 'built.tetlod', '--against', name, '--quiet')
    return said


# ---- meshes in which nothing is to be controlled

POINTS, TETS = results.block((4, 4, 4))
COUNTS = len(POINTS), len(TETS)


def text_of(values, kind):
    return '%s\n' % kind + '\n'.join(map(str, values)) + '\n'


BARE = {
    'nothing': '',
    'ids': 'POINT_DATA %d\nSCALARS GlobalNodeId vtkIdType 1\nLOOKUP_TABLE default\n' % COUNTS[0] +
           text_of(range(COUNTS[0]), ''),
    'integers': 'POINT_DATA %d\nSCALARS mark int 1\nLOOKUP_TABLE default\n' % COUNTS[0] +
                text_of(np.arange(COUNTS[0]) % 7, ''),
    'a constant': 'POINT_DATA %d\nSCALARS T float 1\nLOOKUP_TABLE default\n' % COUNTS[0] +
                  text_of(np.full(COUNTS[0], 293.15), ''),
    'values of cells': 'CELL_DATA %d\nSCALARS load float 1\nLOOKUP_TABLE default\n' % COUNTS[1] +
                       text_of(np.sin(np.arange(COUNTS[1])), ''),
    'materials': 'CELL_DATA %d\nSCALARS material int 1\nLOOKUP_TABLE default\n' % COUNTS[1] +
                 text_of((POINTS[TETS].mean(axis=1)[:, 0] > 0.5).astype(int), ''),
    'text': 'POINT_DATA %d\nFIELD FieldData 1\nlabel 1 %d string\n' % (COUNTS[0], COUNTS[0]) +
            text_of(['a%d' % (i % 3) for i in range(COUNTS[0])], ''),
}


def bare_file(name, data):
    lines = ['# vtk DataFile Version 3.0', 'bare', 'ASCII', 'DATASET UNSTRUCTURED_GRID',
             'POINTS %d double' % COUNTS[0], *('%r %r %r' % tuple(map(float, p)) for p in POINTS),
             'CELLS %d %d' % (COUNTS[1], 5 * COUNTS[1]), *('4 %d %d %d %d' % tuple(t) for t in TETS),
             'CELL_TYPES %d' % COUNTS[1], *['10'] * COUNTS[1]]
    return write(name, '\n'.join(lines) + '\n' + re.sub('\n\n+', '\n', data))


def bare_case(kind):
    """The boundary is kept, a coordinate says how far a level is off, and what there is comes back exactly."""
    said = built(bare_file('bare.vtk', BARE[kind]))
    fields = {field['name']: field['controlled'] for field in info('built.tetlod')['fields']}
    made = {'a constant': 'T', 'values of cells': 'load'}.get(kind, 'coordinate_x')
    if not fields[made] or (made not in ('T', 'load')) != ('there is no field to control' in said):
        return said, fields
    must('extract', 'built.tetlod', '--level', '0', '-o', 'coarse.vtu')
    at = read_vtu('coarse.vtu')[0].astype(float)
    if not (np.allclose(at.min(axis=0), POINTS.min(axis=0)) and np.allclose(at.max(axis=0), POINTS.max(axis=0))):
        return 'the coarsest level has another boundary'
    return None if len(at) < len(POINTS) / 2 else '%d points are left' % len(at)


def hints():
    """--cell-data average is offered where it makes a field, and not where it was given."""
    both = BARE['ids'] + BARE['values of cells']
    plain = must('build', bare_file('bare.vtk', both), '-o', 'x.tetlod').stderr.decode()
    given = must('build', 'bare.vtk', '--cell-data', 'average', '-o', 'x.tetlod').stderr.decode()
    averaged = [field['name'] for field in info('x.tetlod')['fields'] if field['controlled']]
    others = [must('build', bare_file('none.vtk', data), '-o', 'x.tetlod', *options).stderr.decode()
              for data in (BARE['nothing'], BARE['materials']) for options in ([], ['--cell-data', 'average'])]
    good = '--cell-data average' in plain and not any('--cell-data' in said for said in (given, *others))
    return None if good and averaged == ['load'] else (plain, given, averaged, others)


def loose():
    """Points of each tetrahedron's own: --weld is named, and joins them; of a mesh that is joined nothing is said."""
    must('sample', 'cube', '--size', '3', '-o', path('joined.vtu'))
    points, tets, fields = read_vtu('joined.vtu')
    results.write(path('loose.vtu'), points[tets.ravel()], np.arange(tets.size).reshape(-1, 4),
                  {'xyz': fields['xyz'][tets.ravel()]})
    said = [must('build', path(name), *options, '-o', 'x.tetlod').stderr.decode()
            for name, options in (('joined.vtu', []), ('loose.vtu', []), ('loose.vtu', ['--weld', '0']))]
    good = ['--weld 0' in text for text in said] == [False, True, False]
    return None if good and info('x.tetlod')['vertices'] == len(points) else said


def far_values():
    """Values far below and far above one are values like others: whole numbers of 2^53 and more are no ids."""
    must('sample', 'cube', '--size', '6', '-o', path('cube.vtu'))
    points, tets, fields = read_vtu('cube.vtu')
    values = np.sin(3 * points[:, 0]) * points[:, 1]
    results.write(path('far.vtu'), points, tets, {'small': 1e-200 * values, 'large': 1e200 * values})
    must('build', path('far.vtu'), '-o', 'far.tetlod')
    must('verify', 'far.tetlod', '--against', path('far.vtu'))
    controlled = [field['name'] for field in info('far.tetlod')['fields'] if field['controlled']]
    return None if controlled == ['small', 'large'] else controlled


def flat_or_double():
    """Degenerate and duplicate tetrahedra: what leaves them out is named, and does; a surface has no volume."""
    must('sample', 'cube', '--size', '2', '-o', path('cube.vtu'))
    points, tets, fields = read_vtu('cube.vtu')
    results.write(path('flat.vtu'), points, np.concatenate([tets, tets[:2], [[0, 0, 1, 2]]]), fields)
    refused = tetlod('build', path('flat.vtu'), '-o', 'flat.tetlod').stderr.decode()
    must('build', path('flat.vtu'), '--drop-degenerate', '-o', 'flat.tetlod')
    return None if '--drop-degenerate' in refused and info('flat.tetlod')['tets'] == len(tets) else refused


# ---- pyramids of 14 points: of 13, and one in the middle of the base

CORNERS = np.array([[0, 0, 0], [2, 0, 0], [2, 2, 0], [0, 2, 0], [1, 1, 1.5], [1, 1, -1]], float)
PYRAMIDS = (0, 1, 2, 3, 4), (1, 0, 3, 2, 5)  # two that share their base
AS_VTK = (0, 1), (1, 2), (2, 3), (3, 0), (0, 4), (1, 4), (2, 4), (3, 4)
AS_GMSH = (0, 1), (0, 3), (0, 4), (1, 2), (1, 4), (2, 3), (2, 4), (3, 4)


def pyramids(edges):
    """Points, and two rows of 14: corners, middles of edges in a format's order, the middle of the base."""
    points, known, rows = list(CORNERS), {}, []
    for corners in PYRAMIDS:
        row = list(corners)
        for ends in [*edges, (0, 1, 2, 3)]:
            key = frozenset(corners[e] for e in ends)
            if key not in known:
                known[key] = len(points)
                points.append(CORNERS[sorted(key)].mean(axis=0))
            row.append(known[key])
        rows.append(row)
    return np.array(points), np.array(rows)


def heat(points):
    return 1 + points @ (1, 2, 4)


def write_gmsh(name):
    points, rows = pyramids(AS_GMSH)
    numbered = ['%d %r %r %r' % (i + 1, *map(float, p)) for i, p in enumerate(points)]
    elements = ['%d 14 2 0 1 %s' % (i + 1, ' '.join(str(v + 1) for v in row)) for i, row in enumerate(rows)]
    values = ['%d %r' % (i + 1, float(v)) for i, v in enumerate(heat(points))]
    return write(name, '\n'.join(
        ['$MeshFormat', '2.2 0 8', '$EndMeshFormat', '$Nodes', str(len(points)), *numbered, '$EndNodes', '$Elements',
         '2', *elements, '$EndElements', '$NodeData', '1', '"heat"', '1', '0', '3', '0', '1', str(len(points)),
         *values, '$EndNodeData', '']))


def write_cgns(name):
    points, rows = pyramids(AS_VTK)
    file = cgns_file.File(path(name))
    file.zone('Zone', points, len(rows))
    file.section('Cells', 'pyramid14', rows)
    file.solution('AtVertices', cgns_file.VERTEX, {'heat': heat(points)})
    file.do('cg_close', file.fn)
    return path(name)


def write_exodus(name):
    import exodus_file
    points, rows = pyramids(AS_VTK)
    return exodus_file.write(path(name), points, [('PYRAMID14', rows)], [0], {'heat': [heat(points)]})


def boundary_count(tets):
    faces = np.sort(tets[:, [[1, 2, 3], [0, 2, 3], [0, 1, 3], [0, 1, 2]]].reshape(-1, 3), axis=1)
    return (np.unique(faces, axis=0, return_counts=True)[1] == 1).sum()


def pyramid14_case(write_file, name):
    """By their corners, and by all their points but that of the base; neighbours match, and the volume is theirs."""
    name = write_file(name)
    built(name)
    for options, least, faces in ([], 4, 8), (['--subdivide'], 20, 32):
        must('convert', name, *options, '-o', path('out.vtu'))
        points, tets, fields = read_vtu('out.vtu')
        sizes = volumes(points, tets)
        if (sizes <= 0).any() or abs(sizes.sum() - 4 * 2.5 / 3) > 1e-12 or len(tets) < least:
            return options, sizes
        if boundary_count(tets) != faces or not np.allclose(fields['heat'], heat(points.astype(float)), rtol=1e-12):
            return options, boundary_count(tets), fields['heat'], heat(points)
    return None


# ---- other cells

def untyped_hexahedra():
    """A VTKHDF file of hexahedra without the attribute Type, as simulations before it was asked for wrote them."""
    import h5py
    n = 6
    points = np.array([(i, j, k) for k in range(n) for j in range(n) for i in range(n)], float)
    at = np.array([i + n * (j + n * k) for k in range(n - 1) for j in range(n - 1) for i in range(n - 1)])
    cells = at[:, None] + np.array([0, 1, 1 + n, n, n * n, 1 + n * n, 1 + n + n * n, n + n * n])
    with h5py.File(path('can.hdf'), 'w') as file:
        root = file.create_group('VTKHDF')
        root.attrs['Version'] = (1, 0)
        for key, values in (('NumberOfPoints', [len(points)]), ('NumberOfCells', [len(cells)]),
                            ('NumberOfConnectivityIds', [cells.size]), ('Points', points),
                            ('Connectivity', cells.ravel()), ('Offsets', 8 * np.arange(len(cells) + 1)),
                            ('Types', np.full(len(cells), vtk.VTK_HEXAHEDRON, np.uint8)),
                            ('PointData/heat', heat(points) ** 2), ('CellData/load', np.sin(np.arange(len(cells))))):
            root[key] = values
    built(path('can.hdf'))
    must('convert', path('can.hdf'), '-o', path('out.vtu'))
    points_read, tets, fields = read_vtu('out.vtu')
    sizes = volumes(points_read, tets)
    good = abs(sizes.sum() - (n - 1) ** 3) < 1e-9 and (sizes > 0).all() and len(tets) >= 5 * len(cells)
    return None if good and np.array_equal(np.sort(fields['heat']), np.sort(heat(points) ** 2)) else (len(tets), sizes)


def order_five():
    """More than 4 is taken by its corners, and refused by --subdivide, which says so."""
    cell = vtk.vtkLagrangeTetra()
    count = 56  # (5 + 1) (5 + 2) (5 + 3) / 6
    cell.GetPointIds().SetNumberOfIds(count)
    cell.GetPoints().SetNumberOfPoints(count)
    cell.Initialize()
    grid, at = vtk.vtkUnstructuredGrid(), vtk.vtkPoints()
    for i in range(count):
        place = [0] * 4
        cell.ToBarycentricIndex(i, place)
        at.InsertNextPoint(*(p / 5 for p in place[:3]))
    grid.SetPoints(at)
    grid.InsertNextCell(vtk.VTK_LAGRANGE_TETRAHEDRON, count, list(range(count)))
    writer = vtk.vtkXMLUnstructuredGridWriter()
    writer.SetFileName(path('five.vtu'))
    writer.SetInputData(grid)
    writer.Write()
    said = built(path('five.vtu'))
    done = tetlod('convert', path('five.vtu'), '--subdivide', '-o', path('x.vtu'))
    refused = done.stderr.decode()
    good = 'taken by their corners' in said and done.returncode == 3 and 'order 1 to 4' in refused
    return None if good and 'leave --subdivide out' in refused else (said, refused)


for one in BARE:
    case('at its points and cells there is %s' % one, bare_case, one)
case('what would help is said, what was given is not', hints)
case('values far from one', far_values)
case('degenerate and duplicate tetrahedra', flat_or_double)
case('every tetrahedron has points of its own', loose)
case('pyramids of 14 points: Gmsh', pyramid14_case, write_gmsh, 'pyramids.msh')
if cgns_file and cgns_file.LIBRARY:
    case('pyramids of 14 points: CGNS', pyramid14_case, write_cgns, 'pyramids.cgns')
case('pyramids of 14 points: Exodus', pyramid14_case, write_exodus, 'pyramids.exo')
case('VTKHDF without Type: hexahedra', untyped_hexahedra)
case('Lagrange cells of order 5', order_five)
finish()
