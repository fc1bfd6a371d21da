#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""What reading a file takes: its arrays once, and at most half as much again."""
import os
import subprocess

from common import CONFIG, SCRATCH, TETLOD, must, path
from tap import finish, report

SIZE = 40
POINTS, TETS = (SIZE + 1) ** 3, 6 * SIZE ** 3
FORMATS = ('vtu', 'vtk', 'msh', 'vtkhdf', 'xdmf', 'exo', 'mesh', 'meshb')


def peak(name):
    """Bytes that converting it takes, in whichever of its processes takes most. Legacy VTK is written without room for a copy."""
    child = subprocess.Popen([TETLOD, 'convert', name, '-o', 'out.vtk'], cwd=SCRATCH, stderr=subprocess.DEVNULL)
    _, status, usage = os.wait4(child.pid, 0)
    child.returncode = os.waitstatus_to_exitcode(status)
    return usage.ru_maxrss * 1024 if child.returncode == 0 else float('inf')


def text():
    """An ascii and an inline base64 VTU, as VTK writes them."""
    import vtk
    reader = vtk.vtkXMLUnstructuredGridReader()
    reader.SetFileName(path('in.vtu'))
    for name, mode in (('ascii.vtu', 'Ascii'), ('base64.vtu', 'Binary')):
        writer = vtk.vtkXMLUnstructuredGridWriter()
        writer.SetInputConnection(reader.GetOutputPort())
        writer.SetFileName(path(name))
        getattr(writer, 'SetDataModeTo' + mode)()
        writer.SetCompressorTypeToNone()
        writer.Write()


def arrays(name):
    """Positions, corners, the sample's field; Medit keeps no field, Exodus adds the number of the block of each element."""
    fields = 0 if 'mesh' in name else 8 * POINTS
    return 24 * POINTS + 16 * TETS + fields + (8 * TETS if name.endswith('.exo') else 0)


def main():
    if CONFIG != 'release':
        report('memory of reading', True, skip='release only')
        return finish()
    must('sample', 'cube', '--size', '2', '-o', 'tiny.vtu')
    must('sample', 'cube', '--size', str(SIZE), '-o', 'in.vtu')
    text()
    base = peak('tiny.vtu') + (3 << 20)  # pages and buffers, however large the file
    for extension in FORMATS:
        must('convert', 'in.vtu', '-o', 'in2.' + extension)
    for name in ['in2.' + extension for extension in FORMATS] + ['ascii.vtu', 'base64.vtu']:
        ratio = (peak(name) - base) / arrays(name)
        report('%s: at most 1.5 times the arrays' % name, ratio <= 1.5, ratio)
    return finish()


main()
