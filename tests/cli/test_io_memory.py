#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""What reading a file takes: its arrays once, and at most half as much again."""
import subprocess
import sys

from common import CONFIG, SCRATCH, TETLOD, must, path, write
from tap import finish, report

SIZE = 40
POINTS, TETS = (SIZE + 1) ** 3, 6 * SIZE ** 3
FORMATS = ('vtu', 'vtk', 'msh', 'vtkhdf', 'xdmf', 'exo', 'mesh', 'meshb')


# A process starts with the memory of the one that it was forked from, as far as the system's figures go: this one is small
SMALL = 'import os, sys; _, status, usage = os.wait4(os.spawnv(os.P_NOWAIT, sys.argv[1], sys.argv[1:]), 0); print(status, usage.ru_maxrss)'


def peak(*arguments):
    """Bytes that converting it takes, in whichever of its processes takes most. Legacy VTK is written without room for a copy."""
    done = subprocess.run([sys.executable, '-S', '-c', SMALL, TETLOD, 'convert', *arguments, '-o', 'out.vtk'], cwd=SCRATCH,
                          stdout=subprocess.PIPE, stderr=subprocess.DEVNULL)
    status, kilobytes = map(int, done.stdout.split())
    return kilobytes * 1024 if status == 0 else float('inf')


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


def plot3d():
    """A grid and its solution, float32; split into five tetrahedra each. Bytes of its arrays."""
    import numpy as np
    size = 44
    head, points = np.array([size] * 3, '<i4').tobytes(), np.stack(np.meshgrid(*[np.arange(size, dtype='<f4')] * 3)).reshape(3, -1)
    write('in.xyz', head + points.tobytes())
    write('in.q', head + np.zeros(4, '<f4').tobytes() + np.concatenate([points[:1] + 1, points, points[:1] + 9 * size * size]).tobytes())
    return (24 + 8 * 6) * size ** 3 + 16 * 5 * (size - 1) ** 3


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
    plot3d_bytes = plot3d()
    base = peak('tiny.vtu') + (3 << 20)  # pages and buffers, however large the file
    for extension in FORMATS:
        must('convert', 'in.vtu', '-o', 'in2.' + extension)
    for name in ['in2.' + extension for extension in FORMATS] + ['ascii.vtu', 'base64.vtu']:
        ratio = (peak(name) - base) / arrays(name)
        report('%s: at most 1.5 times the arrays' % name, ratio <= 1.5, ratio)
    ratio = (peak('in.xyz', '--q', 'in.q') - base) / plot3d_bytes
    report('PLOT3D: at most 1.5 times the arrays', ratio <= 1.5, ratio)
    return finish()


main()
