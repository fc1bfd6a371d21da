#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""Finite element results to measure sizes with: fe_results.py OUT.vtu [POINTS] [KIND]

KIND `elastic`: linear elasticity on an unstructured Delaunay mesh of a plate with a hole, solved by conjugate gradients
to a relative residual of 1e-9: displacement (3), stress (6, averaged at nodes), von Mises stress (1), reactions (3),
temperature (1). KIND `block`: a heat problem on a structured block of hexahedra split into tetrahedra: temperature (1),
flux (3), energy (1). All float64, as a solver leaves them: the last bits are noise.
"""
import sys

import numpy as np
from scipy.sparse import coo_matrix
from scipy.spatial import Delaunay


def plate(count, random):
    """Points of a plate with a hole, and its tetrahedra."""
    low, high, center, radius = np.array([0, 0, 0.0]), np.array([4, 2, 0.5]), np.array([2, 1.0]), 0.5
    size = (np.prod(high - low) / count) ** (1 / 3)
    axes = [np.linspace(a, b, int(round((b - a) / size)) + 1) for a, b in zip(low, high)]
    points = np.stack(np.meshgrid(*axes, indexing='ij'), -1).reshape(-1, 3)
    inner = np.all((points > low + 1e-9) & (points < high - 1e-9), axis=1)
    points[inner] += random.normal(scale=0.2 * size, size=(inner.sum(), 3))
    points = np.clip(points, low, high)
    away = np.hypot(*(points[:, :2] - center).T) > radius + 0.5 * size
    angles = np.linspace(0, 2 * np.pi, int(2 * np.pi * radius / size), endpoint=False)
    ring = np.stack([center[0] + radius * np.cos(angles), center[1] + radius * np.sin(angles)], -1)
    rim = np.concatenate([np.column_stack([ring, np.full(len(ring), z)]) for z in axes[2]])
    points = np.concatenate([points[away], rim])
    tets = Delaunay(points + random.normal(scale=1e-7 * size, size=points.shape)).simplices
    middle = points[tets].mean(axis=1)
    tets = tets[np.hypot(*(middle[:, :2] - center).T) > radius * 0.98]
    edges = points[tets[:, 1:]] - points[tets[:, :1]]
    volume = np.linalg.det(edges)
    tets = tets[np.abs(volume) > 1e-4 * size ** 3]
    volume = np.linalg.det(points[tets[:, 1:]] - points[tets[:, :1]])
    tets[volume < 0] = tets[volume < 0][:, [1, 0, 2, 3]]
    used, tets = np.unique(tets, return_inverse=True)
    return points[used], tets.reshape(-1, 4)


def block(side):
    n = side + 1
    axes = np.linspace(0, 1, n)
    points = np.stack(np.meshgrid(axes, axes, axes, indexing='ij'), -1).reshape(-1, 3)
    corner = np.arange(n ** 3).reshape(n, n, n)[:-1, :-1, :-1].ravel()
    step = np.array([n * n, n, 1])
    tets = []
    for order in ((0, 1, 2), (1, 2, 0), (2, 0, 1), (0, 2, 1), (2, 1, 0), (1, 0, 2)):
        path = np.cumsum(step[list(order)])
        tets.append(np.stack([corner, corner + path[0], corner + path[1], corner + path[2]], -1))
    tets = np.concatenate(tets)
    volume = np.linalg.det(points[tets[:, 1:]] - points[tets[:, :1]])
    tets[volume < 0] = tets[volume < 0][:, [1, 0, 2, 3]]
    return points, tets


def gradients(points, tets):
    edges = points[tets[:, 1:]] - points[tets[:, :1]]
    inverse = np.linalg.inv(edges)
    rest = inverse.transpose(0, 2, 1)
    return np.concatenate([-rest.sum(axis=1, keepdims=True), rest], axis=1), np.linalg.det(edges) / 6


def conjugate_gradients(matrix, right):
    """With Jacobi's preconditioner, to 1e-9 of the first residual."""
    weights, x = 1 / matrix.diagonal(), np.zeros(len(right))
    rest = right.copy()
    way = step = weights * rest
    product = rest @ step
    first = np.linalg.norm(rest)
    while np.linalg.norm(rest) > 1e-9 * first:
        image = matrix @ way
        length = product / (way @ image)
        x += length * way
        rest -= length * image
        step = weights * rest
        product, last = rest @ step, product
        way = step + product / last * way
    return x


def solve(matrix, right, fixed, values):
    free = np.setdiff1d(np.arange(len(right)), fixed)
    solution = np.zeros(len(right))
    solution[fixed] = values
    reduced = matrix[free][:, free]
    found = conjugate_gradients(reduced, (right - matrix @ solution)[free])
    solution[free] = found
    return solution


def nodal(tets, volume, values, count):
    """Averages of what is constant in elements, weighted by volume."""
    weights = np.bincount(tets.ravel(), np.repeat(volume, 4), count)
    return np.stack([np.bincount(tets.ravel(), np.repeat(volume * v, 4), count) / weights for v in values.T], -1)


def elastic(points, tets):
    young, poisson, count = 210e9, 0.3, len(points)
    b, volume = gradients(points, tets)
    lame, shear = young * poisson / ((1 + poisson) * (1 - 2 * poisson)), young / (2 * (1 + poisson))
    d = np.zeros((6, 6))
    d[:3, :3] = lame
    d[np.arange(3), np.arange(3)] += 2 * shear
    d[np.arange(3, 6), np.arange(3, 6)] = shear
    strain = np.zeros((len(tets), 6, 12))
    for i in range(4):
        x, y, z = b[:, i].T
        for row, column, value in ((0, 0, x), (1, 1, y), (2, 2, z), (3, 0, y), (3, 1, x), (4, 1, z), (4, 2, y),
                                   (5, 0, z), (5, 2, x)):
            strain[:, row, 3 * i + column] = value
    element = np.einsum('eki,kl,elj,e->eij', strain, d, strain, volume, optimize=True)
    numbers = (3 * tets[:, :, None] + np.arange(3)).reshape(-1, 12)
    rows, columns = np.repeat(numbers, 12, axis=1).ravel(), np.tile(numbers, (1, 12)).ravel()
    matrix = coo_matrix((element.ravel(), (rows, columns)), shape=(3 * count, 3 * count)).tocsr()
    left, right = np.flatnonzero(points[:, 0] < 1e-9), np.flatnonzero(points[:, 0] > 4 - 1e-9)
    force = np.zeros(3 * count)
    force[3 * right] = 1e6 / len(right)
    fixed = (3 * left[:, None] + np.arange(3)).ravel()
    u = solve(matrix, force, fixed, 0.0)
    stress = np.einsum('kl,eli,ei->ek', d, strain, u[numbers], optimize=True)
    s = nodal(tets, volume, stress, count)
    mises = np.sqrt(0.5 * ((s[:, 0] - s[:, 1])**2 + (s[:, 1] - s[:, 2])**2 + (s[:, 2] - s[:, 0])**2) + 3 *
                    (s[:, 3:]**2).sum(axis=1))
    reactions = (matrix @ u - force).reshape(-1, 3)
    return {'Displacement': u.reshape(-1, 3), 'Stress': s, 'VonMises': mises, 'Reaction': reactions,
            'Temperature': heat(points, tets)['Temperature']}


def heat(points, tets):
    b, volume = gradients(points, tets)
    count = len(points)
    element = np.einsum('eik,ejk,e->eij', b, b, volume)
    rows, columns = np.repeat(tets, 4, axis=1).ravel(), np.tile(tets, (1, 4)).ravel()
    matrix = coo_matrix((element.ravel(), (rows, columns)), shape=(count, count)).tocsr()
    source = np.bincount(tets.ravel(),
                         np.repeat(volume / 4 *
                                   (1 + 20 *
                                    np.exp(-8 * ((points[tets].mean(axis=1) - 0.7) ** 2).sum(axis=1))), 4), count)
    low = np.flatnonzero(points[:, 2] < 1e-9)
    t = solve(matrix, source, low, 20.0)
    flux = nodal(tets, volume, -np.einsum('eik,ei->ek', b, t[tets]), count)
    return {'Temperature': t, 'Flux': flux, 'Energy': 0.5 * (flux ** 2).sum(axis=1)}


def write(path, points, tets, fields):
    import vtk
    from vtk.util.numpy_support import numpy_to_vtk, numpy_to_vtkIdTypeArray
    grid, place, cells = vtk.vtkUnstructuredGrid(), vtk.vtkPoints(), vtk.vtkCellArray()
    place.SetDataType(vtk.VTK_DOUBLE)
    place.SetData(numpy_to_vtk(points, deep=True))
    cells.SetCells(len(tets), numpy_to_vtkIdTypeArray(np.insert(tets, 0, 4, axis=1).astype(np.int64).ravel(),
                                                      deep=True))
    grid.SetPoints(place)
    grid.SetCells(vtk.VTK_TETRA, cells)
    for name, values in fields.items():
        array = numpy_to_vtk(np.ascontiguousarray(values), deep=True)
        array.SetName(name)
        grid.GetPointData().AddArray(array)
    writer = vtk.vtkXMLUnstructuredGridWriter()
    writer.SetFileName(path)
    writer.SetInputData(grid)
    writer.Write()


def main():
    path, count, kind = sys.argv[1], int((sys.argv[2:] + ['10000'])[0]), (sys.argv[3:] + ['elastic'])[0]
    if kind == 'block':
        points, tets = block(round(count ** (1 / 3)) - 1)
        write(path, points, tets, heat(points, tets))
    else:
        points, tets = plate(count, np.random.default_rng(7))
        write(path, points, tets, elastic(points, tets))


if __name__ == '__main__':
    main()
