# SPDX-License-Identifier: BSD-3-Clause
"""Meshes with values of tetrahedra, for the tests of them."""
import numpy as np
import vtk
from vtk.util.numpy_support import numpy_to_vtk, vtk_to_numpy

from common import path


def points_of(grid):
    return vtk_to_numpy(grid.GetPoints().GetData())


def tets_of(grid):
    return vtk_to_numpy(grid.GetCells().GetConnectivityArray()).reshape(-1, 4)


def cells_of(grid):
    data = grid.GetCellData()
    return {data.GetArrayName(i): vtk_to_numpy(data.GetArray(i)) for i in range(data.GetNumberOfArrays())}


def save(name, points, tets, point_data, cell_data):
    grid = vtk.vtkUnstructuredGrid()
    at, cells = vtk.vtkPoints(), vtk.vtkCellArray()
    at.SetData(numpy_to_vtk(points, deep=True))
    grid.SetPoints(at)
    cells.SetData(4, numpy_to_vtk(np.ascontiguousarray(tets, np.int64).ravel(), deep=True, array_type=vtk.VTK_ID_TYPE))
    grid.SetCells(vtk.VTK_TETRA, cells)
    for data, arrays in ((grid.GetPointData(), point_data), (grid.GetCellData(), cell_data)):
        for key, values in arrays.items():
            array = numpy_to_vtk(np.ascontiguousarray(values), deep=True)
            array.SetName(key)
            data.AddArray(array)
    writer = vtk.vtkXMLUnstructuredGridWriter()
    writer.SetFileName(path(name))
    writer.SetInputData(grid)
    assert writer.Write()


def block(size):
    """A cube of size^3 cubes of six tetrahedra each."""
    n = size + 1
    points = np.stack(np.meshgrid(*[np.arange(n)] * 3, indexing='ij'), -1).reshape(-1, 3).astype(np.float64) / size
    corner = np.stack(np.meshgrid(*[np.arange(size)] * 3, indexing='ij'), -1).reshape(-1, 3) @ [n * n, n, 1]
    steps, tets = np.array([n * n, n, 1]), []
    for order in ((0, 1, 2), (1, 2, 0), (2, 0, 1), (0, 2, 1), (2, 1, 0), (1, 0, 2)):
        path_ = np.cumsum([0] + [steps[i] for i in order])
        path_ = path_ if order in ((0, 1, 2), (1, 2, 0), (2, 0, 1)) else path_[[0, 2, 1, 3]]
        tets.append(corner[:, None] + path_)
    return points, np.concatenate(tets)


def coil(length):
    """A body that winds twice around and overlaps itself: length * 24 tetrahedra, and how far along it each point is.
    """
    points, tets = [], []
    for i in range(length + 1):
        points += [(i / length, j / 2, k / 2) for j in range(3) for k in range(3)]
    for i in range(length):
        for j in range(2):
            for k in range(2):
                for order in ((9, 3, 1), (3, 1, 9), (1, 9, 3), (9, 1, 3), (1, 3, 9), (3, 9, 1)):
                    path_ = np.cumsum([9 * i + 3 * j + k, *order])
                    tets.append(path_ if order in ((9, 3, 1), (3, 1, 9), (1, 9, 3)) else path_[[0, 2, 1, 3]])
    along, across, up = np.array(points).T
    angle, radius = 4 * np.pi * along, 2 + across
    return np.stack([radius * np.cos(angle), radius * np.sin(angle), up + along / 50], 1), np.array(tets), along


def volumes(points, tets):
    p = points[tets]
    return np.einsum('ij,ij->i', p[:, 1] - p[:, 0], np.cross(p[:, 2] - p[:, 0], p[:, 3] - p[:, 0])) / 6
