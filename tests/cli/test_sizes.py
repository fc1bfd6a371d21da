#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""A stream is smaller than the compressed VTU that holds its finest level alone."""
import os

import numpy as np

from common import CONFIG, finish, must, path, read_vtu, report
from meshes import vtk_mesh


def noisy(points, components):
    """Values that vary along one axis, with noise in their last digits, as solvers leave it."""
    random = np.random.default_rng(3)
    return {'n%d' % i: np.sin(points[:, i % 3].astype(float) * i) * (1 + 1e-13 * random.standard_normal(len(points)))
            for i in range(1, components + 1)}


def save(grid):
    import vtk
    writer = vtk.vtkUnstructuredGridWriter()
    writer.SetFileTypeToBinary()
    writer.SetFileName(path('noisy.vtk'))
    writer.SetInputData(grid)
    writer.Write()


def main():
    if CONFIG != 'release':
        return report('sizes', True, skip='the same bytes in every configuration')
    must('sample', 'cube', '--size', '10', '-o', path('cube.vtu'))
    points, tets, _ = read_vtu('cube.vtu')
    save(vtk_mesh(points.astype(float), tets, noisy(points, 12), {}))
    must('convert', path('noisy.vtk'), '-o', path('noisy.vtu'))
    must('build', path('noisy.vtk'), '--field', 'n1', '-o', path('noisy.tetlod'), '--quiet')
    stream, vtu = (os.path.getsize(path(name)) for name in ('noisy.tetlod', 'noisy.vtu'))
    report('values that repeat but for noise: the stream is the smaller', stream < vtu,
           '%d bytes, VTU %d' % (stream, vtu))


main()
finish()
