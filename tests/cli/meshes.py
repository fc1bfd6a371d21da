# SPDX-License-Identifier: BSD-3-Clause
"""Meshes for the tests of formats, and how what was read is held against them, array by array."""
import numpy as np
import vtk
from vtk.util.numpy_support import numpy_to_vtk, vtk_to_numpy

from common import must, path, read_grid

vtk.vtkObject.GlobalWarningDisplayOff()


def tet_mesh(count=300, precision=np.float64, seed=5):
    """Points, tetrahedra (all positive), fields at points, and of cells: a float and regions."""
    from scipy.spatial import Delaunay
    random = np.random.default_rng(seed)
    points = random.random((count, 3)).astype(precision)
    tets = Delaunay(points.astype(float)).simplices
    v = volumes(points, tets)
    tets, v = tets[abs(v) > 1e-7], v[abs(v) > 1e-7]
    tets[v < 0] = tets[v < 0][:, [0, 1, 3, 2]]
    used = np.unique(tets)
    points, tets = points[used], np.searchsorted(used, tets)
    fields = {'heat': random.standard_normal(len(points)), 'wind': random.standard_normal((len(points), 3)),
              'mass': random.standard_normal(len(points)).astype(np.float32)}
    cells = {'load': random.standard_normal(len(tets)),
             'region': (points[tets].mean(axis=1)[:, 0] > 0.5).astype(np.int32) + 1}
    return points, tets, fields, cells


def volumes(points, tets):
    p = np.asarray(points, float)[tets]
    return np.einsum('ij,ij->i', p[:, 1] - p[:, 0], np.cross(p[:, 2] - p[:, 0], p[:, 3] - p[:, 0])) / 6


def read(name):
    """Points, tetrahedra, fields at points, of cells: of a VTU as VTK reads it."""
    grid = read_grid(name)
    if not grid.GetNumberOfCells():
        return np.zeros((0, 3)), np.zeros((0, 4), int), {}, {}
    return (vtk_to_numpy(grid.GetPoints().GetData()),
            vtk_to_numpy(grid.GetCells().GetConnectivityArray()).reshape(-1, 4),
            arrays_of(grid.GetPointData()), arrays_of(grid.GetCellData()))


def arrays_of(data):
    return {
        data.GetArrayName(i): vtk_to_numpy(data.GetArray(i)) for i in range(data.GetNumberOfArrays())
        if data.GetArray(i)
    }


def converted(*arguments):
    """What tetlod makes of a file, and what it says."""
    must('convert', *arguments, '-o', path('converted.vtu'))
    return read('converted.vtu')


def differ(kind, wanted, got, exact=True):
    if sorted(wanted) != sorted(got):
        return '%s: %s, not %s' % (kind, sorted(got), sorted(wanted))
    for name in wanted:
        a, b = np.asarray(wanted[name], float), np.asarray(got[name], float)
        if a.shape != b.shape or not (np.array_equal(a, b) if exact else np.allclose(a, b, rtol=1e-6, atol=1e-9)):
            return '%s %s differs' % (kind, name)
    return None


def compare(wanted, got, exact=True):
    """None, or how two meshes (points, tetrahedra, fields, fields of cells) differ."""
    same = np.array_equal if exact else (lambda a, b: a.shape == b.shape and np.allclose(a, b, rtol=1e-6, atol=1e-9))
    if not same(np.asarray(wanted[0], float), np.asarray(got[0], float)):
        return 'points differ'
    if not np.array_equal(wanted[1], got[1]):
        return 'tetrahedra differ'
    return differ('field', wanted[2], got[2], exact) or differ('cell field', wanted[3], got[3], exact)


def compare_split(points, fields, cells, volume, got, exact=True):
    """Cells were split: the points are the same, every tetrahedron has the values of a cell, and these fill the volume.
    `cells` has a field 'id', the cell's number; `volume` the cells' volumes."""
    p, tets, f, c = got
    if p.shape != points.shape or not np.allclose(p, points, rtol=1e-6, atol=1e-9):
        return 'points differ'
    v = volumes(p, tets)
    if (v <= 0).any() and (v >= 0).any():
        return 'turned both ways'
    if np.sort(np.sort(tets[:, [[1, 2, 3], [0, 2, 3], [0, 1, 3], [0, 1, 2]]].reshape(-1, 3)), axis=1).size == 0:
        return 'nothing'
    faces = np.sort(tets[:, [[1, 2, 3], [0, 2, 3], [0, 1, 3], [0, 1, 2]]].reshape(-1, 3), axis=1)
    if np.unique(faces, axis=0, return_counts=True)[1].max() > 2:
        return 'a face of more than two'
    ids = c['id'].astype(int)
    if not np.allclose(np.bincount(ids, abs(v), len(volume)), volume, rtol=1e-5):
        return 'volumes of cells differ'
    for name in cells:
        a, b = np.asarray(cells[name], float)[ids], np.asarray(c[name], float)
        if not np.array_equal(a, b):
            return 'cell field %s differs' % name
    return differ('field', fields, f, exact)


def add_arrays(data, arrays):
    for name, values in arrays.items():
        array = numpy_to_vtk(np.ascontiguousarray(values), deep=True)
        array.SetName(name)
        data.AddArray(array)


def vtk_mesh(points, tets, fields, cells):
    grid, at, list_ = vtk.vtkUnstructuredGrid(), vtk.vtkPoints(), vtk.vtkCellArray()
    at.SetData(numpy_to_vtk(points, deep=True))
    grid.SetPoints(at)
    for tet in tets:
        list_.InsertNextCell(4, [int(v) for v in tet])
    grid.SetCells(vtk.VTK_TETRA, list_)
    add_arrays(grid.GetPointData(), fields)
    add_arrays(grid.GetCellData(), cells)
    return grid


def structured(kind, dims=(5, 4, 3)):
    """A grid of VTK, its points, fields, fields of cells, volumes of cells."""
    random = np.random.default_rng(3)
    axes = [np.cumsum(random.random(n) + 0.5) for n in dims]
    if kind == 'image':
        grid = vtk.vtkImageData()
        grid.SetDimensions(*dims)
        grid.SetOrigin(1, 2, 3)
        grid.SetSpacing(0.5, 0.25, 2)
        axes = [o + s * np.arange(n) for o, s, n in zip((1, 2, 3), (0.5, 0.25, 2), dims)]
    k, j, i = np.meshgrid(axes[2], axes[1], axes[0], indexing='ij')
    points = np.stack([i.ravel(), j.ravel(), k.ravel()], axis=1)
    if kind == 'rectilinear':
        grid = vtk.vtkRectilinearGrid()
        grid.SetDimensions(*dims)
        for axis, set_ in zip(axes, (grid.SetXCoordinates, grid.SetYCoordinates, grid.SetZCoordinates)):
            set_(numpy_to_vtk(axis, deep=True))
    if kind == 'structured':
        grid = vtk.vtkStructuredGrid()
        grid.SetDimensions(*dims)
        at = vtk.vtkPoints()
        points = points @ np.array([[1, 0.1, 0], [0, 1, 0.2], [0, 0, 1.0]])
        at.SetData(numpy_to_vtk(points, deep=True))
        grid.SetPoints(at)
    count = (dims[0] - 1) * (dims[1] - 1) * (dims[2] - 1)
    fields = {'heat': random.standard_normal(len(points)),
              'wind': random.standard_normal((len(points), 3)).astype(np.float32)}
    cells = {'id': np.arange(count, dtype=np.int32), 'load': random.standard_normal(count)}
    add_arrays(grid.GetPointData(), fields)
    add_arrays(grid.GetCellData(), cells)
    size = [np.diff(a) for a in axes]
    volume = np.einsum('k,j,i->kji', size[2], size[1], size[0]).ravel()
    return grid, points, fields, cells, volume
