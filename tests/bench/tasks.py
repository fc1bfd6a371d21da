#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""usage: tasks.py PROGRAM [ORDER]

Builds streams by arrays of tasks, and holds each against `build`, byte for byte: TASKS (6) tasks come by chance (ORDER
is the seed, 1), one after the other, and two of them are killed while they are at it. Meshes: the blunt fin
(BLUNT=folder; not without), a cube in 7 odd pieces (VTK; SIZE=60), a ring whose boundary may move, a flow with two
regions and two controlled fields, and a series of 8 steps (which is never in pages).
"""
import filecmp
import os
import random
import subprocess
import sys
import tempfile
import time

PROGRAM = os.path.abspath(sys.argv[1])
SEED = int(sys.argv[2]) if len(sys.argv) > 2 else 1
SIZE = int(os.environ.get('SIZE', '60'))
TASKS = int(os.environ.get('TASKS', '6'))
BLUNT = os.environ.get('BLUNT', '')

PIECES = '''
import sys
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkCommonCore import vtkIdList
from vtkmodules.vtkFiltersExtraction import vtkExtractCells
from vtkmodules.vtkIOXML import vtkXMLUnstructuredGridReader, vtkXMLUnstructuredGridWriter
reader = vtkXMLUnstructuredGridReader()
reader.SetFileName(sys.argv[1])
reader.Update()
mesh, end = reader.GetOutput(), 0
for piece in range(7):
    begin, end = end, mesh.GetNumberOfCells() * (piece + 1) ** 2 // 49
    cells, cut, writer = vtkIdList(), vtkExtractCells(), vtkXMLUnstructuredGridWriter()
    for cell in range(begin, end):
        cells.InsertNextId(cell)
    cut.SetInputData(mesh)
    cut.SetCellList(cells)
    cut.Update()
    cut.GetOutput().GetPointData().RemoveArray('vtkOriginalPointIds')
    cut.GetOutput().GetCellData().RemoveArray('vtkOriginalCellIds')
    writer.SetInputData(cut.GetOutput())
    writer.SetFileName('piece_%d.vtu' % piece)
    writer.Write()
fields = ''.join('<PDataArray type="%s" Name="%s" NumberOfComponents="%d"/>' %
                 ('Float64' if a.GetDataType() == 11 else 'Float32', a.GetName(), a.GetNumberOfComponents())
                 for a in (mesh.GetPointData().GetArray(i) for i in range(mesh.GetPointData().GetNumberOfArrays())))
point = 'Float64' if mesh.GetPoints().GetDataType() == 11 else 'Float32'
with open(sys.argv[2], 'w') as file:
    file.write('<VTKFile type="PUnstructuredGrid"><PUnstructuredGrid GhostLevel="0"><PPointData>%s</PPointData>'
               '<PPoints><PDataArray type="%s" NumberOfComponents="3"/></PPoints>%s</PUnstructuredGrid></VTKFile>' %
               (fields, point, ''.join('<Piece Source="piece_%d.vtu"/>' % i for i in range(7))))
'''

REGIONS = '''
import sys
from vtkmodules.vtkCommonCore import vtkIntArray
from vtkmodules.vtkIOXML import vtkXMLUnstructuredGridReader, vtkXMLUnstructuredGridWriter
reader, writer, part = vtkXMLUnstructuredGridReader(), vtkXMLUnstructuredGridWriter(), vtkIntArray()
reader.SetFileName(sys.argv[1])
reader.Update()
part.SetName('part')
for cell in range(reader.GetOutput().GetNumberOfCells()):
    part.InsertNextValue(2 * cell // reader.GetOutput().GetNumberOfCells())
reader.GetOutput().GetCellData().AddArray(part)
writer.SetInputData(reader.GetOutput())
writer.SetFileName(sys.argv[2])
writer.Write()
'''


def must(folder, *command):
    done = subprocess.run([PROGRAM, *command], cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    if done.returncode:
        sys.exit('tetlod %s: %s' % (' '.join(command), done.stderr.strip()))


def parts(folder):
    return sum(file.isdigit() for _, _, files in os.walk(os.path.join(folder, 'work')) for file in files)


def killed(folder, number):
    """A task that is killed once it has done a part more. False: it was done before."""
    before = parts(folder)
    task = subprocess.Popen([PROGRAM, 'run', 'work', '--task', '%d/%d' % (number, TASKS)], cwd=folder,
                            stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    while parts(folder) <= before and task.poll() is None:
        time.sleep(0.005)
    task.kill()
    task.wait()
    return task.returncode != 0


def array(folder, inputs, options, order):
    """Tasks in that order, of which the first two are killed; how many were."""
    must(folder, 'plan', 'work', *inputs, *options)
    count = sum(killed(folder, number) for number in order[:2])
    for number in order[2:] + order[:2]: # who was killed comes again, at the end
        must(folder, 'run', 'work', '--task', '%d/%d' % (number, TASKS))
    must(folder, 'merge', 'work', '-o', 'many.tetlod', '--quiet')
    return count


def meshes():
    """Name, what VTK makes of a sample, the sample, what is built of it, and how."""
    if BLUNT:
        grid, solution = (os.path.join(BLUNT, name) for name in ('bluntfinxyz.bin', 'bluntfinq.bin'))
        yield 'blunt fin', None, [], [os.path.abspath(grid), '--q', os.path.abspath(solution)], ['--paged=20000']
    yield 'cube in 7 pieces', PIECES, ['cube', '--size', str(SIZE), '-o', 'm.vtu'], ['m.pvtu'], ['--paged=20000']
    yield ('ring, its boundary moves', None, ['torus', '--size', '12', '-o', 'm.vtu'], ['m.vtu'],
           ['--paged=4000', '--domain-error', '0.001'])
    yield ('regions and two fields', REGIONS, ['fin', '--size', '32', '-o', 'm.vtu'], ['parts.vtu'],
           ['--paged=6000', '--region', 'part', '--field', 'Pressure', '--field', 'Density'])
    yield 'series of 8 steps', None, ['wake', '--steps', '8', '--size', '16', '-o', 'm.pvd'], ['m.pvd'], []


def main():
    chance, bad = random.Random(SEED), 0
    for name, makes, sample, inputs, options in meshes():
        with tempfile.TemporaryDirectory() as folder:
            if sample:
                must(folder, 'sample', *sample)
            if makes:
                subprocess.run(['/usr/bin/python3', '-c', makes, 'm.vtu', *inputs], cwd=folder, check=True)
            must(folder, 'build', *inputs, '-o', 'alone.tetlod', *options)
            order = chance.sample(range(1, TASKS + 1), TASKS)
            count = array(folder, inputs, options, order)
            same = filecmp.cmp(os.path.join(folder, 'alone.tetlod'), os.path.join(folder, 'many.tetlod'), False)
            bad += not same
            print('%-26s order %s, %d killed: %s' % (name, order, count, 'same bytes' if same else 'OTHER BYTES'),
                  flush=True)
    return bad != 0


if __name__ == '__main__':
    sys.exit(main())
