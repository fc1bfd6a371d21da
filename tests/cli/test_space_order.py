#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""Meshes whose points and tetrahedra come in an order by chance, as mesh generators list them: the stream does not tell
which one it was, and all that it holds is where it was."""
import os

import numpy as np

from cell_meshes import save
from common import CONFIG, case, finish, must, path, report
import mpi_job
from meshes import converted, read

SIZE = 36  # 280,000 tetrahedra: smaller meshes keep their order
SOME = ['--field', 'heat', '--min-tets', '150000']  # levels by which it can be told
PAGES = [*SOME, '--paged=40000']


def shuffled(mesh, seed):
    points, tets, fields, cells = mesh
    random = np.random.default_rng(seed)
    vertices, order = random.permutation(len(points)), random.permutation(len(tets))
    number = np.argsort(vertices)  # of each old point, the new one
    return (points[vertices], number[tets[order]], {n: v[vertices] for n, v in fields.items()},
            {n: v[order] for n, v in cells.items()})


def sample():
    must('sample', 'cube', '--size', str(SIZE), '-o', 'cube.vtu')
    points, tets, fields, _ = read('cube.vtu')
    middles = points[tets].mean(axis=1)
    cells = {'load': middles @ [1.0, 100, 10000], 'material': (middles[:, 0] > 0.4 * points.max()).astype(np.int32)}
    return points, tets, {**fields, 'heat': np.sin(points.astype(float) @ [0.3, 0.2, 0.1])}, cells


def same_as(name, *command):
    must(*command)
    return None if mpi_job.read(command[command.index('-o') + 1]) == mpi_job.read(name) else 'other bytes'


def by_place(mesh):
    """Values at places, and of tetrahedra at their corners' places, in one order."""
    points, tets, fields, cells = mesh
    rank = np.lexsort(points.T)
    number = np.argsort(rank)
    corners = np.sort(number[tets], axis=1)
    order = np.lexsort(corners.T)
    return [points[rank], corners[order], *(fields[n][rank] for n in sorted(fields)),
            *(cells[n][order] for n in sorted(cells))]


def alike(first, second):
    pairs = list(zip(by_place(first), by_place(second), strict=False))
    return None if len(pairs) == 6 and all(np.array_equal(a, b) for a, b in pairs) else [a.shape for a, _ in pairs]


def original_order(mesh):
    must('build', 'mesh.vtu', '-o', 'kept.tetlod', '--keep-order', *PAGES)
    must('extract', 'kept.tetlod', '--original-order', '-o', 'back.vtu')
    back = read('back.vtu')
    good = all(np.array_equal(a, b) for a, b in zip(back[:2], mesh[:2]))
    return None if good and all(np.array_equal(back[3][n], mesh[3][n]) for n in mesh[3]) else back[3].keys()


def ranks():
    missing = mpi_job.missing()
    if missing:
        return report('ranks', True, skip=missing)
    return case('ranks', mpi_job.same, [3], ['mesh.vtu'], *PAGES)


def tasks():
    must('plan', 'work', 'mesh.vtu', *PAGES)
    must('run', 'work', '--task', '1/2')
    return same_as('paged.tetlod', 'merge', 'work', '-o', 'many.tetlod')


if CONFIG == 'release':
    cube = sample()
    one = shuffled(cube, 1)
    os.mkdir(path('other'))
    save('mesh.vtu', *one)
    save('other/mesh.vtu', *shuffled(cube, 2))
    must('build', 'mesh.vtu', '-o', 'one.tetlod', *SOME)
    must('build', 'mesh.vtu', '-o', 'paged.tetlod', *PAGES)
    other = 'build', 'other/mesh.vtu', '-o', 'other.tetlod'
    case('another order has the same stream', same_as, 'one.tetlod', *other, *SOME)
    case('and pages, with the arrays in files', same_as, 'paged.tetlod', *other, *PAGES, '--memory', '60M')
    case('all is where it was', lambda: alike(converted('one.tetlod'), cube))
    case('the stream is of its input', lambda: must('verify', 'one.tetlod', '--against', 'mesh.vtu', '--quiet') and None)
    case('the order of the input is stored', original_order, one)
    ranks()
    case('tasks', tasks)
else:
    report('orders by chance', True, skip='large meshes: release only')
finish()
