#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""A stream is smaller than the compressed VTU that holds its finest level alone, and rounding makes it smaller."""
import os
import resource

import numpy as np

import results
from common import CONFIG, case, finish, info, must, path, read_vtu, report
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


def rounded_positions():
    """Positions alone are rounded: values of levels stay short all the same, and the finest level has all digits."""
    results.write(path('beam.vtu'), *results.solid(12))
    sizes = []
    for bits in [], ['--position-bits', '16']:
        must('build', path('beam.vtu'), '-o', path('beam.tetlod'), '--quiet', *bits)
        sizes.append(os.path.getsize(path('beam.tetlod')))
    must('verify', 'beam.tetlod', '--against', 'beam.vtu', '--quiet')
    must('extract', 'beam.tetlod', '-o', 'finest.vtu', '--quiet')
    points, _, wanted = read_vtu('beam.vtu')
    at, _, values = read_vtu('finest.vtu')
    nearest = np.array([np.abs(points - p).sum(axis=1).argmin() for p in at])
    same = all((values[name] == wanted[name][nearest]).all() for name in wanted)
    return None if same and len(set(nearest)) == len(points) and sizes[1] < sizes[0] else (same, sizes)


def processor_time(*command, runs=1):
    """The least of some runs."""
    times = []
    for _ in range(runs):
        before = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime
        must(*command, '--quiet', '--threads', '1')
        times.append(resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime - before)
    return min(times)


def times_of_builds():
    """Rounded positions take less than four times a build, verify less than ten times."""
    mesh, stream = path('solid.vtu'), path('solid.tetlod')
    results.write(mesh, *results.solid(12))
    rounded = processor_time('build', mesh, '--position-bits', '16', '-o', stream)
    build = processor_time('build', mesh, '-o', stream, runs=2)
    verify = processor_time('verify', stream, '--against', mesh)
    return None if rounded < 4 * build and verify < 10 * build else (build, rounded, verify)


def time_of_flat():
    """Where rounding has made tetrahedra flat, a sample may be in several: verify still takes less than ten builds."""
    mesh, stream = path('delta.vtu'), path('delta.tetlod')
    must('sample', 'delta', '-o', mesh)
    build = processor_time('build', mesh, '--position-bits', '16', '-o', stream, runs=2)
    verify = processor_time('verify', stream, '--against', mesh)
    return None if info(stream)['degenerate_tets'] and verify < 10 * build else (build, verify)


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
    case('rounded positions make a stream smaller, not larger', rounded_positions)
    case('rounding takes less than four builds, verify less than ten', times_of_builds)
    case('so where rounded tetrahedra are flat', time_of_flat)


main()
finish()
