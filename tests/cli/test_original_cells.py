#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""Cells that were split into tetrahedra, against VTK: their values are stored once a cell."""
import os
import sys

import numpy as np

from common import ROOT, case, finish, must, path, read_grid, report

try:
    import vtk
    from vtk.util.numpy_support import numpy_to_vtk
except ImportError as missing:
    report('VTK', True, skip='not installed: %s' % missing)
    finish()
    sys.exit()

from cell_meshes import cells_of  # noqa: E402

sys.path.insert(0, os.path.join(ROOT, 'tests'))
from streams import tetlod as reference  # noqa: E402

FACES = ((0, 3, 2, 1), (4, 5, 6, 7), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7))


def mixed(size, shuffled=False):
    """A cube of hexahedra, wedges, pyramids and polyhedra: points, and cells as VTK's type and points or faces."""
    random, side = np.random.default_rng(3), size + 1
    points = np.stack(np.meshgrid(*[np.arange(side)] * 3, indexing='ij'), -1).reshape(-1, 3).astype(np.float32)
    points += random.random(points.shape, np.float32) * np.float32(0.2)
    points, cells = list(points), []
    for i, j, k in np.ndindex(size, size, size):
        low = (i * side + j) * side + k
        a = [low, low + side * side, low + side * side + side, low + side]
        a += [corner + 1 for corner in a]
        if 4 * i < size:
            cells.append((12, a))
        elif 4 * i < 2 * size:
            cells += [(13, [a[0], a[1], a[2], a[4], a[5], a[6]]), (13, [a[0], a[2], a[3], a[4], a[6], a[7]])]
        elif 4 * i < 3 * size:
            points.append(np.mean([points[corner] for corner in a], 0))
            cells += [(14, [*(a[corner] for corner in reversed(face)), len(points) - 1]) for face in FACES]
        else:
            cells.append((42, [[a[corner] for corner in face] for face in FACES]))
    points = np.array(points, np.float32)
    if shuffled:
        places = random.permutation(len(points))
        points = points[np.argsort(places)]
        cells = [cells[number] for number in random.permutation(len(cells))]
        cells = [(kind, np.take(places, corners).tolist()) for kind, corners in cells]
    return points, cells


def corners_of(cell):
    return sorted(set(np.ravel(cell[1]).tolist()))


def grid_of(points, cells, point_data, cell_data):
    grid, at = vtk.vtkUnstructuredGrid(), vtk.vtkPoints()
    at.SetData(numpy_to_vtk(points, deep=True))
    grid.SetPoints(at)
    for kind, corners in cells:
        if kind == vtk.VTK_POLYHEDRON:
            faces = vtk.vtkIdList()
            for number in [len(corners), *(number for face in corners for number in [len(face), *face])]:
                faces.InsertNextId(number)
            grid.InsertNextCell(kind, faces)
        else:
            grid.InsertNextCell(kind, len(corners), corners)
    for data, arrays in ((grid.GetPointData(), point_data), (grid.GetCellData(), cell_data)):
        for key, values in arrays.items():
            array = numpy_to_vtk(np.ascontiguousarray(values), deep=True)
            array.SetName(key)
            data.AddArray(array)
    return grid


def write_grid(name, grid):
    writer = vtk.vtkXMLUnstructuredGridWriter()
    writer.SetFileName(path(name))
    writer.SetInputData(grid)
    assert writer.Write()


def values_of(points, cells):
    """At points; of cells, where no two cells have one pressure, and some are NaN."""
    random = np.random.default_rng(4)
    centres = np.array([points[corners_of(cell)].mean(0) for cell in cells])
    pressure = np.sin(centres[:, 0]) + random.random(len(cells)) / 1000
    holes = np.cos(centres[:, 1]).astype(np.float32)
    holes[::17] = np.nan
    speed = np.stack([np.sin(centres @ axis) + random.random(len(cells)) / 1000 for axis in np.eye(3) + 0.5], 1)
    return {'p': np.sin(points[:, 0]) + points[:, 1]}, \
        {'id': np.arange(len(cells), dtype=np.int32), 'pressure': pressure, 'holes': holes, 'speed': speed,
         'material': (centres[:, 2] > 3).astype(np.int8)}


def make():
    for name, shuffled in (('in', False), ('mixed', True)):
        points, cells = mixed(8, shuffled)
        write_grid(name + '.vtu', grid_of(points, cells, *values_of(points, cells)))
        must('build', path(name + '.vtu'), '--field', 'p', '-o', path(name + '.tetlod'))
        must('convert', path(name + '.vtu'), '-o', path(name + '_tets.vtu'))
        must('build', path(name + '_tets.vtu'), '--field', 'p', '-o', path(name + '_tets.tetlod'))


def sizes(name):
    """Against what the same tetrahedra take, as those of a file of tetrahedra, whose bytes stay as they are."""
    whole, split = (os.path.getsize(path(name + end)) for end in ('_tets.tetlod', '.tetlod'))
    tags = [{section['tag'] for section in reference.open(path(name + end)).sections} for end in ('_tets.tetlod', '.tetlod')]
    if 'CELL' not in tags[0] or 'PCEL' in tags[0] or not {'PCEL', 'PMAP', 'PVAL'} <= tags[1]:
        return tags
    return None if split <= 0.6 * whole else '%d of %d bytes' % (split, whole)


def by_level(name):
    """Every tetrahedron has the values of its cell, at every level and in prefixes, as where each has its own."""
    wanted = cells_of(read_grid(name + '.vtu'))
    levels = len(reference.open(path(name + '.tetlod')).levels)
    for level in (0, levels // 2, levels - 1):
        must('extract', path(name + '.tetlod'), '--level', str(level), '-o', path('level.vtu'), '--quiet')
        must('extract', path(name + '.tetlod'), '--level', str(level), '-o', path('prefix.tetlod'), '--quiet')
        must('verify', path('prefix.tetlod'))
        must('extract', path('prefix.tetlod'), '-o', path('prefix.vtu'), '--quiet')
        for file in ('level.vtu', 'prefix.vtu'):
            found = cells_of(read_grid(file))
            ids = found['id'].astype(int)
            for key, values in wanted.items():
                if not np.array_equal(values[ids], found[key], equal_nan=True):
                    return '%s of %s at level %d is wrong' % (key, file, level)
    return None


def python_decoder():
    stream, wanted = reference.open(path('in.tetlod')), cells_of(read_grid('in.vtu'))
    ids = stream.cells('id').astype(int)
    return next((name for name, values in wanted.items() if not np.array_equal(values[ids], stream.cells(name), equal_nan=True)), None)


def cut_off():
    """Values of cells that are whole are there, as are those of tetrahedra."""
    data = open(path('in.tetlod'), 'rb').read()
    ends = [section['offset'] + section['stored'] for section in reference.open(data).sections if section['tag'] == 'PVAL']
    with open(path('cut.tetlod'), 'wb') as file:
        file.write(data[:ends[1]])
    must('extract', path('cut.tetlod'), '-o', path('cut.vtu'), '--quiet')
    found = cells_of(read_grid('cut.vtu'))
    return None if set(found) == {'id', 'pressure'} else str(list(found))


def verified(name):
    must('verify', path(name + '.tetlod'), '--against', path(name + '.vtu'))


if __name__ == '__main__':
    case('streams of hexahedra, wedges, pyramids and polyhedra', make)
    for mesh in ('in', 'mixed'):
        case('%s: 0.6 of the bytes that tetrahedra take' % mesh, sizes, mesh)
        case('%s: every tetrahedron has its cell\'s values' % mesh, by_level, mesh)
        case('%s: verified against the input' % mesh, verified, mesh)
    case('the decoder in Python', python_decoder)
    case('a file that is cut off', cut_off)
    finish()
