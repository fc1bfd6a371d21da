#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""What reading a file takes: its arrays once, and at most half as much again, but with --memory no more than that. A
tetlod stream is decoded, which takes more without."""
import os
import re
import subprocess
import sys

from common import CONFIG, SCRATCH, TETLOD, must, path, write
from tap import finish, report

SIZE = 36
OWN = ('vtu', 'vtk', 'msh', 'vtkhdf', 'xdmf', 'exo', 'mesh', 'meshb')


# A process starts with the memory of the one that it was forked from, as far as the system's figures go: this one is
# small
SMALL = 'import os, sys; _, status, usage = os.wait4(os.spawnv(os.P_NOWAIT, sys.argv[1], sys.argv[1:]), 0); print(status, usage.ru_maxrss)'


def peak(*arguments, command='convert', out='out.vtk', ends=0):
    """Bytes that converting it takes, in whichever of its processes takes most. Legacy VTK is written without room for
    a copy."""
    done = subprocess.run([sys.executable, '-S', '-c', SMALL, TETLOD, command, *arguments, '-o', out],
                          cwd=SCRATCH,
                          stdout=subprocess.PIPE, stderr=subprocess.DEVNULL)
    status, kilobytes = map(int, done.stdout.split())
    return kilobytes * 1024 if os.waitstatus_to_exitcode(status) == ends else float('inf')


def arrays():
    """Bytes of the arrays of the mesh that was read last: positions, corners, fields."""
    with open(path('out.vtk'), 'rb') as file:
        text = file.read()
    points, tets = (int(re.search(rb'\n%s (\d+)' % key, text).group(1)) for key in (b'POINTS', b'CELL_TYPES'))
    fields = sum(int(a) * int(b)
                 for a, b in re.findall(rb'\n\S+ (\d+) (\d+) (?:double|float|int|vtktypeint64)\n', text))
    return 24 * points + 16 * tets + 8 * fields


def save(writer, data, name, mode='Appended'):
    writer.SetInputData(data)
    writer.SetFileName(path(name))
    getattr(writer, 'SetDataModeTo' + mode)()
    writer.SetCompressorTypeToNone()
    writer.Write()


def grid_of(kind, points, cells):
    """A grid with a field at points and one of cells."""
    import numpy as np
    import vtk
    from meshes import add_arrays
    from vtk.util.numpy_support import numpy_to_vtk, numpy_to_vtkIdTypeArray
    grid, at, list_ = vtk.vtkUnstructuredGrid(), vtk.vtkPoints(), vtk.vtkCellArray()
    at.SetData(numpy_to_vtk(points, deep=True))
    grid.SetPoints(at)
    ends = np.arange(len(cells) + 1) * cells.shape[1]
    list_.SetData(numpy_to_vtkIdTypeArray(ends, deep=True),
                  numpy_to_vtkIdTypeArray(np.ascontiguousarray(cells).ravel(), deep=True))
    grid.SetCells(kind, list_)
    add_arrays(grid.GetPointData(), {'f': points[:, 0] + 1})
    add_arrays(grid.GetCellData(), {'c': np.arange(len(cells)) / 7})
    return grid


def vtk_files(points, tets, hexahedra):
    """As VTK writes them: text, base64, two pieces, hexahedra, polyhedra."""
    import numpy as np
    import vtk
    from test_io_foam import HEXAHEDRON
    writer = vtk.vtkXMLUnstructuredGridWriter()
    grid = grid_of(vtk.VTK_TETRA, points, tets)
    save(writer, grid, 'ascii.vtu', 'Ascii')
    save(writer, grid, 'base64.vtu', 'Binary')
    for part in range(2):
        used, local = np.unique(tets[part::2], return_inverse=True)
        save(writer, grid_of(vtk.VTK_TETRA, points[used], local.reshape(-1, 4)), 'part%d.vtu' % part)
    write(
        'parts.pvtu', '''<VTKFile type="PUnstructuredGrid" version="1.0" byte_order="LittleEndian"><PUnstructuredGrid>
        <PPointData><PDataArray type="Float64" Name="f"/></PPointData><PCellData><PDataArray type="Float64" Name="c"/></PCellData>
        <PPoints><PDataArray type="Float64" NumberOfComponents="3"/></PPoints><Piece Source="part0.vtu"/><Piece Source="part1.vtu"/>
        </PUnstructuredGrid></VTKFile>''')
    save(writer, grid_of(vtk.VTK_HEXAHEDRON, points, hexahedra), 'hexahedra.vtu')
    faces = hexahedra[:, HEXAHEDRON].reshape(-1, 6, 4)
    grid = vtk.vtkUnstructuredGrid()
    grid.SetPoints(grid_of(vtk.VTK_TETRA, points, tets).GetPoints())
    for cell in faces[::4]:
        ids = vtk.vtkIdList()
        for number in [6] + [n for face in cell.tolist() for n in [4] + face]:
            ids.InsertNextId(number)
        grid.InsertNextCell(vtk.VTK_POLYHEDRON, ids)
    save(writer, grid, 'polyhedra.vtu')
    return ['ascii.vtu', 'base64.vtu', 'parts.pvtu', 'hexahedra.vtu', 'polyhedra.vtu']


def other_files(points, tets):
    """EnSight, CGNS, Abaqus, TetGen."""
    import numpy as np
    import cgns_file
    names = []
    line = lambda text: text.encode().ljust(80)
    one = lambda number: np.array([number], '<i4').tobytes()
    geometry = ([line(t) for t in ('C Binary', 'a', 'b', 'node id assign', 'element id assign', 'part')] + [
        one(1),
        line('p'),
        line('coordinates'),
        one(len(points)),
        points.T.astype('<f4').tobytes(),
        line('tetra4'),
        one(len(tets)), (tets + 1).astype('<i4').tobytes()
    ])
    write('geometry', b''.join(geometry))
    write('values', b''.join([line('v'), line('part'), one(1), line('coordinates'),
                              points[:, 0].astype('<f4').tobytes()]))
    write('in.case', 'FORMAT\ntype: ensight gold\nGEOMETRY\nmodel: geometry\nVARIABLE\nscalar per node: f values\n')
    names.append('in.case')
    for hdf5 in True, False:
        names.append('hdf5%d.cgns' % hdf5)
        file = cgns_file.File(path(names[-1]), hdf5)
        file.zone('zone', points, len(tets))
        file.section('tets', 'tetra', tets)
        file.solution('f', cgns_file.VERTEX, {'f': points[:, 0]})
        file.close()
    numbered = lambda values: ((np.arange(len(values)) + 1).tolist(), *values.T.tolist())
    rows = lambda form, values: ''.join(form % row for row in zip(*numbered(values)))
    write('in.inp', '*NODE\n' + rows('%d, %.9g, %.9g, %.9g\n',
                                     points) + '*ELEMENT, TYPE=C3D4\n' + rows('%d, %d, %d, %d, %d\n', tets + 1))
    write('in.node', '%d 3 0 0\n' % len(points) + rows('%d %.9g %.9g %.9g\n', points))
    write('in.ele', '%d 4 0\n' % len(tets) + rows('%d %d %d %d %d\n', tets + 1))
    return names + ['in.inp', 'in.node']


def plot3d():
    """A grid and its solution, float32; split into five tetrahedra each."""
    import numpy as np
    head, points = np.array([SIZE] * 3,
                            '<i4').tobytes(), np.stack(np.meshgrid(*[np.arange(SIZE, dtype='<f4')] * 3)).reshape(3, -1)
    write('in.xyz', head + points.tobytes())
    write('in.q', head + np.zeros(4,
                                  '<f4').tobytes() + np.concatenate([points[:1] + 1, points,
                                                                     points[:1] + 9 * SIZE * SIZE]).tobytes())


def write_all():
    import numpy as np
    from meshes import read
    from test_io_foam import HEXAHEDRON, TETRAHEDRON, foam_files
    points, tets = read('in.vtu')[:2]
    tets = tets.astype(np.int64)
    n = SIZE + 1
    i, j, k = np.meshgrid(*[np.arange(SIZE)] * 3, indexing='ij')
    o = (i * n * n + j * n + k).ravel()
    hexahedra = np.stack([o, o + 1, o + 1 + n, o + n, o + n * n, o + n * n + 1, o + n * n + 1 + n, o + n * n + n],
                         axis=1)
    plot3d()
    names = vtk_files(points, tets, hexahedra) + other_files(points, tets)
    for binary, packed in (True, False), (False, True):
        names += foam_files(points, tets, TETRAHEDRON, binary, packed)
    return names + foam_files(points, hexahedra, HEXAHEDRON, True, False)


def hold(name, most, *arguments):
    used = peak(*arguments)
    ratio = (used - BASE) / arrays() if used < float('inf') else used
    report('%s: at most %g times the arrays' % (name, most), ratio <= most, ratio)


if CONFIG != 'release':
    report('memory of reading', True, skip='release only')
    finish()
must('sample', 'cube', '--size', '2', '-o', 'tiny.vtu')
must('sample', 'cube', '--size', str(SIZE), '-o', 'in.vtu')
NAMES = write_all()
BASE = peak('tiny.vtu') + (3 << 20)  # pages and buffers, however large the file
for extension in OWN:
    must('convert', 'in.vtu', '-o', 'in2.' + extension)
for name in ['in2.' + extension for extension in OWN] + NAMES:
    hold(name, 1.5, name)
hold('PLOT3D', 1.5, 'in.xyz', '--q', 'in.q')
for name in 'large.exo', 'large.vtk':  # the first is read in a process of its own; exact ones do not fit, and say so
    must('sample', 'cube', '--size', '60', '-o', name)
    most = 30 << 20
    held = peak(name, '--memory', str(most), '--certify', 'exact', command='build', out='large.tetlod', ends=1)
    report('%s: at most --memory' % name, held <= most, held)
must('build', 'in.vtu', '-o', 'pages.tetlod', '--paged=5000')
for name in 'out.vtu', 'out.vtkhdf':
    most = 28 << 20
    free, held = (peak('pages.tetlod', '--memory', memory, command='extract', out=name) for memory in ('1G', str(most)))
    report('%s of a stream in pages: at most --memory' % name, held <= most < free, (held, free))
finish()
