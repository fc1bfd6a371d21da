#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""Hexahedra, wedges, pyramids and tetrahedra of the first and second order in the formats that hold them: h5py, meshio
and libcgns write them, and all are read as VTK's own file of them is. Also what VTK writes of partitions, and old
headers of its legacy files."""
import numpy as np
import vtk
from vtk.util.numpy_support import vtk_to_numpy

from common import case, finish, path, report, tetlod
from meshes import compare, converted, tet_mesh, volumes, vtk_mesh
from test_io_vtkxml import other_cells, quadratic_grid, save

try:
    import h5py
    import meshio
    import cgns_file
except ImportError as missing:
    report('libraries', True, skip='not installed: %s' % missing)
    finish()

NAMES = {
    vtk.VTK_HEXAHEDRON: 'hexahedron', vtk.VTK_WEDGE: 'wedge', vtk.VTK_PYRAMID: 'pyramid', vtk.VTK_TETRA: 'tetra',
    vtk.VTK_QUADRATIC_HEXAHEDRON: 'hexahedron20', vtk.VTK_QUADRATIC_WEDGE: 'wedge15',
    vtk.VTK_QUADRATIC_PYRAMID: 'pyramid13', vtk.VTK_QUADRATIC_TETRA: 'tetra10'
}
TO_CGNS = {20: [*range(12), *range(16, 20), *range(12, 16)], 15: [*range(9), 12, 13, 14, 9, 10, 11]}


def cells_of(grid):
    """VTK's type and the points of each cell."""
    return [(grid.GetCellType(n), [grid.GetCell(n).GetPointId(i) for i in range(grid.GetCell(n).GetNumberOfPoints())])
            for n in range(grid.GetNumberOfCells())]


def write_vtkhdf(name, cells, points, heat):
    with h5py.File(name, 'w') as file:
        root = file.create_group('VTKHDF')
        root.attrs['Version'], root.attrs['Type'] = (1, 0), np.bytes_('UnstructuredGrid')
        ends = np.cumsum([0] + [len(corners) for _, corners in cells])
        for key, values in (('NumberOfPoints', [len(points)]), ('NumberOfCells', [len(cells)]),
                            ('NumberOfConnectivityIds', [ends[-1]]),
                            ('Points', points), ('Connectivity',
                                                 sum((corners for _, corners in cells), [])), ('Offsets', ends),
                            ('Types', np.array([kind for kind, _ in cells], np.uint8)), ('PointData/heat', heat),
                            ('CellData/id', np.arange(len(cells)))):
            root[key] = values


def write_meshio(name, cells, points, heat):
    data = {} if name.endswith('.inp') else {'cell_data': {'id': [[n] for n in range(len(cells))]},
                                             'point_data': {'heat': heat}}
    meshio.write(name, meshio.Mesh(points, [(NAMES[kind], [corners]) for kind, corners in cells], **data))


def write_cgns(name, cells, points, heat):
    file = cgns_file.File(name)
    file.zone('Zone', points, len(cells))
    for kind, corners in cells:
        file.section(NAMES[kind], NAMES[kind], [[corners[i] for i in TO_CGNS.get(len(corners), range(len(corners)))]])
    file.solution('AtVertices', cgns_file.VERTEX, {'heat': heat})
    file.solution('InCells', cgns_file.CELL, {'id': np.arange(len(cells), dtype=np.int32)})
    file.close()


def cells_case(extension, writer, quadratic, kinds):
    grid = quadratic_grid()[0] if quadratic else other_cells(())[0]
    points, heat = vtk_to_numpy(grid.GetPoints().GetData()).astype(float), vtk_to_numpy(
        grid.GetPointData().GetArray('heat'))
    cells = [cell for cell in cells_of(grid) if NAMES[cell[0]] in kinds]
    writer(path('in' + extension), cells, points, heat)
    for options in ([], ['--subdivide']) if quadratic else ([],):
        p, t, f, c = converted(path('in' + extension), *options)
        v, volume = volumes(p, t), {'hexahedron': 1, 'wedge': 0.5, 'pyramid': 1 / 3, 'tetra': 1 / 6}
        wanted = [volume[NAMES[kind].rstrip('0123456789')] for kind, _ in cells]
        if (v <= 0).any() or not np.isclose(v.sum(), sum(wanted)):
            return 'volumes %s' % v
        if 'id' in c and not np.allclose(np.bincount(c['id'].astype(int), v), wanted):
            return 'volumes of cells'
        if extension != '.inp' and not ('id' in c and np.allclose(f['heat'], p @ [1, 2, 3.0])):
            return 'values'
    return None


def partitions_case(extension):
    points, tets, fields, cells = tet_mesh(60)
    parts = vtk.vtkPartitionedDataSet()
    for i, mask in enumerate((cells['region'] == 1, cells['region'] == 2)):
        used, local = np.unique(tets[mask], return_inverse=True)
        parts.SetPartition(i, vtk_mesh(points[used], local.reshape(-1, 4), {n: v[used] for n, v in fields.items()},
                                       {n: v[mask] for n, v in cells.items()}))
    writer = vtk.vtkXMLPartitionedDataSetWriter()
    if extension == '.vtpc':
        collection = vtk.vtkPartitionedDataSetCollection()
        collection.SetPartitionedDataSet(0, parts)
        writer, parts = vtk.vtkXMLPartitionedDataSetCollectionWriter(), collection
    writer.SetInputData(parts)
    writer.SetFileName(path('parts' + extension))
    assert writer.Write()
    p, t, f, c = converted(path('parts' + extension))
    same = len(p) == len(points) and len(t) == len(tets) and np.isclose(volumes(p, t).sum(),
                                                                        volumes(points, tets).sum())
    return None if same and sorted(c['load']) == sorted(cells['load']) else '%d points' % len(p)


def old_header_case(version):
    """VTK writes version 4.2 as 1.0 and 2.0 were but for the first line."""
    mesh = tet_mesh(60)
    writer = vtk.vtkUnstructuredGridWriter()
    writer.SetInputData(vtk_mesh(*mesh))
    writer.SetFileName(path('in.vtk'))
    writer.SetFileVersion(42)
    writer.SetFileTypeToBinary()
    writer.Write()
    data = open(path('in.vtk'), 'rb').read().split(b'\n', 1)[1]
    open(path('in.vtk'), 'wb').write(b'# vtk DataFile Version %s\n' % version + data)
    return compare(mesh, converted(path('in.vtk')))


def blanked_case(extension, point):
    """A grid of 27 cells without those about a point, or without one cell, as VTK sees it."""
    grid, at = vtk.vtkStructuredGrid(), vtk.vtkPoints()
    for n in range(64):
        at.InsertNextPoint(n % 4, n // 4 % 4, n // 16)
    grid.SetDimensions(4, 4, 4)
    grid.SetPoints(at)
    heat = vtk.vtkDoubleArray()
    heat.SetName('heat')
    heat.SetNumberOfValues(64)
    heat.Fill(1)
    grid.GetPointData().AddArray(heat)
    if point:
        grid.BlankPoint(42)
    else:
        grid.BlankCell(13)
    writer = vtk.vtkXMLStructuredGridWriter() if extension == '.vts' else vtk.vtkStructuredGridWriter()
    writer.SetInputData(grid)
    writer.SetFileName(path('in' + extension))
    assert writer.Write()
    p, t, f, c = converted(path('in' + extension))
    seen = [n for n in range(27) if grid.IsCellVisible(n)]
    found = np.unique(np.floor(p[t].mean(axis=1)).astype(int) @ [1, 3, 9])
    good = np.isclose(volumes(p, t).sum(), len(seen)) and np.array_equal(found, seen) and list(f) == ['heat'] and not c
    return None if good else '%s, not %s; %s %s' % (found, seen, list(f), list(c))


def main():
    all_kinds = set(NAMES.values())
    formats = [line.split()[:2] for line in tetlod('formats').stdout.decode().splitlines()]
    for name, extension, writer, kinds in (('vtkhdf', '.vtkhdf', write_vtkhdf, all_kinds),
                                           ('xdmf', '.xdmf', write_meshio, all_kinds - {'wedge15', 'pyramid13'}),
                                           ('cgns', '.cgns', write_cgns, all_kinds - {'pyramid13'}),
                                           ('inp', '.inp', write_meshio,
                                            all_kinds - {'wedge15', 'pyramid', 'pyramid13'})):
        for quadratic in (False, True) if [name, 'read'] in formats else ():
            case('%s: cells of the %s order' % (name, 'second' if quadratic else 'first'), cells_case, extension,
                 writer, quadratic, kinds)
    for extension in '.vtpd', '.vtpc':
        case('partitions as %s' % extension, partitions_case, extension)
    for extension in '.vts', '.vtk':
        for point in False, True:
            case('a blanked %s, %s' % ('point' if point else 'cell', extension), blanked_case, extension, point)
    for version in b'1.0', b'2.0':
        case('legacy VTK %s' % version.decode(), old_header_case, version)
    finish()


main()
