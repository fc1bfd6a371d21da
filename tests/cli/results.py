# SPDX-License-Identifier: BSD-3-Clause
"""Results of six kinds, as solvers leave them: flow, solid, a field of the wall only, tensors, ids, values of cells.
`python3 results.py FOLDER [N]` writes them, N cells to a side."""
import os
import sys

import numpy as np
import vtk
from vtk.util.numpy_support import numpy_to_vtk, numpy_to_vtkIdTypeArray

# A cube's tetrahedra, around its diagonal 0 - 7
SPLIT = np.array([(0, 1, 3, 7), (0, 1, 7, 5), (0, 5, 7, 4), (0, 3, 2, 7), (0, 2, 6, 7), (0, 6, 4, 7)])


def block(n):
    """Points in the unit cube and tetrahedra of n[0] x n[1] x n[2] cells."""
    axes = [np.linspace(0, 1, count + 1) for count in n]
    points = np.stack(np.meshgrid(*axes, indexing='ij'), axis=-1).reshape(-1, 3)
    number = np.arange(len(points)).reshape([count + 1 for count in n])
    offsets = [(i, j, k) for k in (0, 1) for j in (0, 1) for i in (0, 1)]
    corners = np.stack([number[i:n[0] + i, j:n[1] + j, k:n[2] + k].ravel() for i, j, k in offsets], axis=1)
    tets = corners[:, SPLIT].reshape(-1, 4)
    a, b, c, d = (points[tets[:, i]] for i in range(4))
    turned = np.einsum('ij,ij->i', b - a, np.cross(c - a, d - a)) < 0
    tets[turned] = tets[turned][:, [0, 1, 3, 2]]
    return points, tets


def write(name, points, tets, fields, cells=()):
    grid, array = vtk.vtkUnstructuredGrid(), vtk.vtkCellArray()
    at = vtk.vtkPoints()
    at.SetData(numpy_to_vtk(np.ascontiguousarray(points, np.float32), deep=True))
    grid.SetPoints(at)
    array.SetData(4, numpy_to_vtkIdTypeArray(np.ascontiguousarray(tets, np.int64).ravel(), deep=True))
    grid.SetCells(vtk.VTK_TETRA, array)
    for data, arrays in (grid.GetPointData(), dict(fields)), (grid.GetCellData(), dict(cells)):
        for field, values in arrays.items():
            made = numpy_to_vtk(np.ascontiguousarray(values), deep=True)
            made.SetName(field)
            data.AddArray(made)
    writer = vtk.vtkXMLUnstructuredGridWriter()
    writer.SetFileName(name)
    writer.SetInputData(grid)
    writer.Write()


def single(**fields):
    return {name: np.asarray(values, np.float32) for name, values in fields.items()}


def flow(n):
    """A shear layer over a plate: a vector before the scalars, and two of them follow the wall."""
    points, tets = block((2 * n, n, n // 2))
    x, y, z = points.T
    u = np.tanh(4 * y / (0.3 + x))
    velocity = np.column_stack([u, 0.1 * np.sin(6 * x) * y * (1 - y), 0.05 * np.cos(5 * z) * y])
    fields = single(U=velocity, p=np.cos(3 * x) * (1 - 0.3 * y), T=300 + 40 * np.exp(-6 * y), k=u * (1 - u))
    return points * (2, 1, 0.5), tets, fields


def solid(n):
    """A beam that bends: how far it moves, and its stress."""
    points, tets = block((3 * n, n // 2, n // 2))
    x, y, z = points.T
    bend = np.column_stack([-(y - 0.5) * x * (2 - x), x ** 2 * (3 - x) / 3, 0 * x])
    stress = 2e8 * np.abs((1 - x) * (y - 0.5))
    fields = single(displacement=0.01 * bend, VonMises=stress, temperature=20 + 3 * x + z * z)
    return points * (3, 0.5, 0.5), tets, fields


def pipe(n):
    """A flow in a pipe, whose shear stress is known on the wall and zero elsewhere."""
    points, tets = block((n, n, 2 * n))
    a, b = 2 * points[:, 0] - 1, 2 * points[:, 1] - 1
    a, b = np.sign(a) * np.abs(a) ** 0.7, np.sign(b) * np.abs(b) ** 0.7  # layers that get thinner towards the wall
    x, y, z = a * np.sqrt(1 - b * b / 2), b * np.sqrt(1 - a * a / 2), 6 * points[:, 2]
    r2, wall = x * x + y * y, np.maximum(np.abs(a), np.abs(b)) > 1 - 1e-9
    swirl = 0.2 * np.sin(z)
    velocity = np.column_stack([-y * swirl * (1 - r2), x * swirl * (1 - r2), 1 - r2])
    shear = wall[:, None] * np.column_stack([-y * swirl, x * swirl, 2 + 0.5 * np.sin(2 * z + 3 * x)])
    return np.column_stack([x, y, z]), tets, single(p=10 - z + 0.1 * np.cos(z) * x, U=velocity, wallShearStress=shear)


def tensors(n):
    """Nine components of a stress, six of a strain."""
    points, tets = block((n, n, n))
    x, y, z = points.T
    load = np.exp(-4 * ((x - 0.5) ** 2 + (y - 0.5) ** 2)) * (1 - z)
    xy, xz, yz = 0.2 * x * y, 0.1 * z, 0.3 * y * z
    stress = np.stack([load, xy, xz, xy, load * (1 - z), yz, xz, yz, np.sin(3 * z) * load], axis=1)
    return points, tets, single(stress=1e6 * stress, strain=stress[:, [0, 4, 8, 1, 5, 2]] * 1e-3)


def ids(n):
    """Ids in front, as integers, by name and by value, and one field."""
    points, tets = block((n, n, n))
    x, y, z = points.T
    mixed = np.random.default_rng(3).permutation(len(points))
    fields = {'GlobalNodeId': mixed.astype(np.int64) + 7, 'originalIds': mixed.astype(np.float64),
              'owner': np.floor(4 * x).astype(np.float32)}
    return points, tets, {**fields, **single(heat=np.sin(3 * x) * np.cos(2 * y) + z)}


def cells(n):
    """Values of cells only: a pressure, a velocity, a material of few numbers and an id of each cell."""
    points, tets = block((n, n, n))
    x, y, z = points[tets].mean(axis=1).T
    of_cells = single(pressure=np.sin(2 * x) + y * z, velocity=np.column_stack([y, -x, 0.2 * np.sin(3 * z)]))
    of_cells.update(part=(1 + (z > 0.5)).astype(np.int32), CellId=np.arange(len(tets), dtype=np.int32))
    return points, tets, {}, of_cells


KINDS = {'flow': flow, 'solid': solid, 'wall': pipe, 'tensors': tensors, 'ids': ids, 'cells': cells}


def make(folder, n):
    for kind, of in KINDS.items():
        write(os.path.join(folder, kind + '.vtu'), *of(n))


if __name__ == '__main__':
    make(sys.argv[1], int(sys.argv[2]) if len(sys.argv) > 2 else 24)
