#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""Lagrange cells up to order 4, numbered and written by VTK: hexahedra, a wedge and tetrahedra that share faces are
taken by their corners, or by all their points with --subdivide, and neighbours match."""
import itertools

import numpy as np
import vtk

from common import case, fails, finish, must, path, read_grid
from meshes import add_arrays, converted, volumes
from test_io_vtkxml import save

TET, HEX, WEDGE = vtk.VTK_LAGRANGE_TETRAHEDRON, vtk.VTK_LAGRANGE_HEXAHEDRON, vtk.VTK_LAGRANGE_WEDGE
CORNERS = {TET: np.eye(4, 3, -1),
           HEX: np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]]),
           WEDGE: np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [0, 1, 1]])}


def lattice(kind, orders):
    """The place of each point in VTK's order, from 0 to 1 along each axis."""
    n = np.array(orders)
    if kind == TET:
        cell, places = vtk.vtkLagrangeTetra(), []
        count = (n[0] + 1) * (n[0] + 2) * (n[0] + 3) // 6
        cell.GetPointIds().SetNumberOfIds(count)
        cell.GetPoints().SetNumberOfPoints(count)
        cell.Initialize()
        for i in range(count):
            place = [0] * 4
            cell.ToBarycentricIndex(i, place)
            places.append(place[:3])
        return np.array(places) / n
    all_places = [p for p in itertools.product(*[range(k + 1) for k in n]) if kind == HEX or p[0] + p[1] <= n[0]]
    cell = vtk.vtkLagrangeHexahedron() if kind == HEX else vtk.vtkLagrangeWedge()
    order = [*map(int, n), len(all_places)]
    return np.array(sorted(all_places, key=lambda p: cell.PointIndexFromIJK(*p, order))) / n


def shape(kind, corners, places):
    """Places of a cell as points between its corners."""
    if kind == TET:
        weights = np.column_stack([1 - places.sum(axis=1), places])
    elif kind == WEDGE:
        flat = np.column_stack([1 - places[:, 0] - places[:, 1], places[:, 0], places[:, 1]])
        weights = np.hstack([flat * (1 - places[:, 2:]), flat * places[:, 2:]])
    else:
        weights = np.prod(np.where(CORNERS[HEX][None] == 1, places[:, None], 1 - places[:, None]), axis=2)
    return weights @ corners


def bend(points):
    return points + 0.04 * np.sin(points[:, [1, 2, 0]] * 2)


def grid_of(cells, orders, bent):
    """Cells as (type, corners): points at one place are one point."""
    known, grid, at = {}, vtk.vtkUnstructuredGrid(), vtk.vtkPoints()
    at.SetDataTypeToDouble()
    for kind, corners in cells:
        places = lattice(kind, orders if kind == HEX else [max(orders)] * 3)
        points, ids = shape(kind, np.asarray(corners, float), places), []
        for straight, point in zip(points, bend(points) if bent else points):
            key = tuple(np.round(straight, 6))
            if key not in known:
                known[key] = at.InsertNextPoint(*point)
            ids.append(known[key])
        grid.InsertNextCell(kind, len(ids), ids)
    grid.SetPoints(at)
    places = np.array([at.GetPoint(i) for i in range(at.GetNumberOfPoints())])
    add_arrays(grid.GetPointData(), {'heat': places @ [1.0, 2, 3]})
    data = {'id': np.arange(len(cells), dtype=np.int32)}
    if len(set(orders)) > 1:
        data['HigherOrderDegrees'] = np.array([orders] * len(cells), float)
    add_arrays(grid.GetCellData(), data)
    return grid


def bar():
    """Two hexahedra side by side, numbered from different corners, a wedge beside them, two tetrahedra on top of it."""
    box = CORNERS[HEX]
    turned = np.array([1, 0, 0]) + box[[5, 1, 0, 4, 6, 2, 3, 7]]
    wedge = np.array([[2, 0, 0], [3, 0, 0], [2, 1, 0], [2, 0, 1], [3, 0, 1], [2, 1, 1]])[[1, 2, 0, 4, 5, 3]]
    first = np.array([[2, 0, 1], [3, 0, 1], [2, 1, 1], [2, 0, 2]])
    second = np.array([[2, 1, 1], [2, 0, 2], [3, 0, 1], [3, 1, 2]])
    return [(HEX, box), (HEX, turned), (WEDGE, wedge), (TET, first), (TET, second)], [1, 1, 1 / 2, 1 / 6, 1 / 3]


def faces_of(tets):
    faces = tets[:, [[1, 2, 3], [0, 2, 3], [0, 1, 3], [0, 1, 2]]].reshape(-1, 3)
    return np.unique(np.sort(faces, axis=1), axis=0, return_counts=True)


def outside(tets, points):
    """How far the boundary is from closed, and the volume within it."""
    faces = np.concatenate([tets[:, c] for c in ([1, 2, 3], [0, 3, 2], [0, 1, 3], [0, 2, 1])])
    _, first, count = np.unique(np.sort(faces, axis=1), axis=0, return_index=True, return_counts=True)
    a, b, c = (points[faces[first[count == 1]][:, i]] for i in range(3))
    area = np.cross(b - a, c - a) / 2
    return abs(area.sum(axis=0)).max(), np.einsum('ij,ij->', area, a) / 3


def lagrange_case(orders, bent, extension):
    cells, volume = bar()
    if len(set(orders)) > 1:
        cells, volume = cells[:1], volume[:1]
    grid = grid_of(cells, orders, bent)
    writer = vtk.vtkXMLUnstructuredGridWriter() if extension == '.vtu' else vtk.vtkUnstructuredGridWriter()
    if extension == '.vtu':
        save(writer, grid, 'in.vtu')
    else:
        writer.SetInputData(grid)
        writer.SetFileName(path('in.vtk'))
        assert writer.Write()
    for options in [], ['--subdivide']:
        p, t, f, c = converted(path('in' + extension), *options)
        v = volumes(p, t)
        if options and len(p) != grid.GetNumberOfPoints():
            return '%d of %d points' % (len(p), grid.GetNumberOfPoints())
        if (v <= 0).any():
            return '%s: volumes %s' % (options, v.min())
        gap, inside = outside(t, p)
        if faces_of(t)[1].max() > 2 or gap > 1e-12 or not np.isclose(inside, v.sum()):
            return '%s: neighbours do not match: %g, %g of %g' % (options, gap, inside, v.sum())
        if not bent and not np.allclose(np.bincount(c['id'].astype(int), v), volume):
            return '%s: volumes of cells' % options
        if not np.allclose(f['heat'], p @ [1, 2, 3.0]):
            return '%s: values' % options
    must('build', path('in' + extension), '--subdivide', '-o', path('in.tetlod'))
    must('verify', path('in.tetlod'), '--against', path('in' + extension), '--subdivide')
    return None


def old_case(extension, version, old):
    """What VTK wrote before its version 9: of two edges the points are swapped. VTK reads them back as they were."""
    grid = grid_of([(HEX, CORNERS[HEX])], [3] * 3, True)
    cell = grid.GetCell(0)
    ids = [cell.GetPointId(i) for i in range(64)]
    mixed = vtk.vtkUnstructuredGrid()
    mixed.CopyStructure(grid)
    mixed.GetPointData().ShallowCopy(grid.GetPointData())
    mixed.SetCells(HEX, vtk.vtkCellArray())
    mixed.InsertNextCell(HEX, 64, ids[:28] + ids[30:32] + ids[28:30] + ids[32:])
    writer = vtk.vtkXMLUnstructuredGridWriter() if extension == '.vtu' else vtk.vtkUnstructuredGridWriter()
    writer.SetInputData(mixed)
    writer.SetFileName(path('in' + extension))
    writer.Write()
    data = open(path('in' + extension), 'rb').read()
    open(path('in' + extension), 'wb').write(data.replace(version, old, 1))
    p, t, _, _ = converted(path('in' + extension), '--subdivide')
    seen = read_grid('in' + extension).GetCell(0)
    if [seen.GetPointId(i) for i in range(64)] != ids:
        return 'VTK sees other points'
    return None if len(t) >= 27 * 5 and (volumes(p, t) > 0).all() else volumes(p, t).min()


def word_case():
    """By their corners: how many, and what uses more of them."""
    save(vtk.vtkXMLUnstructuredGridWriter(), grid_of(bar()[0], [3] * 3, True), 'in.vtu')
    said = must('convert', path('in.vtu'), '-o', path('out.vtu')).stderr.decode()
    return None if '5 cells of higher order taken by their corners; --subdivide' in said else said


def main():
    for orders in [1] * 3, [2] * 3, [3] * 3, [4] * 3:
        for bent in False, True:
            case('order %d%s' % (orders[0], ', bent' if bent else ''), lagrange_case, orders, bent, '.vtu')
    case('orders 2, 1, 3', lagrange_case, [2, 1, 3], True, '.vtu')
    case('legacy VTK', lagrange_case, [3] * 3, True, '.vtk')
    case('taken by their corners', word_case)
    case('as before VTK 9, VTU', old_case, '.vtu', b'version="2.2"', b'version="1.0"')
    case('as before VTK 9, legacy VTK', old_case, '.vtk', b'Version 5.1', b'Version 5.0')
    save(vtk.vtkXMLUnstructuredGridWriter(), grid_of([(HEX, CORNERS[HEX])], [5] * 3, False), 'five.vtu')
    words = ['cell 0', '216 points', 'order 1 to 4', 'leave --subdivide out']
    fails('order 5 is refused by name', 3, words, 'convert', path('five.vtu'), '--subdivide', '-o', path('out.vtu'))
    case('order 5 by its corners', lambda: None if len(converted(path('five.vtu'))[0]) == 8 else 'points')
    finish()


main()
