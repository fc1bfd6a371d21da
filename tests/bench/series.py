#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""What a series in time costs: series.py TETLOD BLUNT FOLDER [STEPS]. The blunt fin's pressure goes back and forth
along the grid's first axis. Prints tetrahedra and bytes of each band, processor time of building, bytes of a seek, and
a step's time in the browser's decoder."""
import json
import math
import os
import resource
import subprocess
import sys

import numpy
from vtkmodules.util.numpy_support import numpy_to_vtk, vtk_to_numpy
from vtkmodules.vtkIOXML import vtkXMLUnstructuredGridReader, vtkXMLUnstructuredGridWriter

SHAPE = (32, 32, 40) # of the grid, slowest first
REACH = 4            # cells that the values move at most
STEPS_MJS = os.path.join(os.path.dirname(os.path.abspath(__file__)), 'series_steps.mjs')


def displaced(values, by):
    """Values on the grid as they are `by` cells further along the fastest axis."""
    at = numpy.clip(numpy.arange(SHAPE[2]) - by, 0, SHAPE[2] - 1)
    low = numpy.minimum(at.astype(int), SHAPE[2] - 2)
    rest = at - low
    grid = values.reshape(SHAPE)
    return (grid[:, :, low] * (1 - rest) + grid[:, :, low + 1] * rest).ravel().astype(numpy.float32)


def make(tetlod, blunt, folder, steps):
    base = os.path.join(folder, 'base.vtu')
    subprocess.run([tetlod, 'convert', os.path.join(blunt, 'bluntfinxyz.bin'), '--q',
                    os.path.join(blunt, 'bluntfinq.bin'), '-o', base],
                   check=True, stdout=subprocess.DEVNULL)
    reader, writer = vtkXMLUnstructuredGridReader(), vtkXMLUnstructuredGridWriter()
    reader.SetFileName(base)
    reader.Update()
    mesh = reader.GetOutput()
    pressure = vtk_to_numpy(mesh.GetPointData().GetArray('Pressure')).astype(float)
    assert pressure.size == numpy.prod(SHAPE), pressure.size
    while mesh.GetPointData().GetNumberOfArrays():
        mesh.GetPointData().RemoveArray(0)
    lines = []
    for step in range(steps):
        array = numpy_to_vtk(displaced(pressure, REACH * math.sin(2 * math.pi * step / steps)), deep=True)
        array.SetName('Pressure')
        mesh.GetPointData().AddArray(array)
        writer.SetInputData(mesh)
        writer.SetFileName(os.path.join(folder, 'fin_%d.vtu' % step))
        writer.Write()
        lines.append('<DataSet timestep="%.6g" file="fin_%d.vtu"/>' % (step / max(steps - 1, 1), step))
    with open(os.path.join(folder, 'fin.pvd'), 'w') as file:
        file.write('<VTKFile type="Collection" version="0.1"><Collection>%s</Collection></VTKFile>\n' % ''.join(lines))


def build(tetlod, folder):
    """Processor time."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run([tetlod, 'build', os.path.join(folder, 'fin.pvd'), '--field', 'Pressure', '-o',
                    os.path.join(folder, 'fin.tetlod'), '--quiet'], check=True)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def main(tetlod, blunt, folder, steps=32):
    os.makedirs(folder, exist_ok=True)
    make(tetlod, blunt, folder, steps)
    stream = os.path.join(folder, 'fin.tetlod')
    seconds = build(tetlod, folder)
    print('build: %.2f s of processor time, %.3f s a driving step' % (seconds, seconds / steps), flush=True)
    info = json.loads(subprocess.run([tetlod, 'info', '--json', stream], check=True, stdout=subprocess.PIPE).stdout)
    for band in info['series']['bands']:
        print('%6.2g %%: %5.1f %% of the tetrahedra, %8.0f bytes a step, largest error %.4g %%' %
              (100 * band['error'], 100 * band['tets'] / info['tets'], band['bytes'] / steps,
               100 * band['largest_error']))
    print(subprocess.run(['node', STEPS_MJS, stream], check=True, stdout=subprocess.PIPE).stdout.decode(), end='')


if __name__ == '__main__':
    main(*sys.argv[1:4], *map(int, sys.argv[4:]))
