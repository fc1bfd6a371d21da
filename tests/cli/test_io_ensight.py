#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""EnSight Gold as VTK's writer writes it, and as text, big-endian and Fortran files laid out by hand, of which VTK's
reader reads the same."""
import ctypes
import os
import re
import shutil

import numpy as np
import vtk
from vtk.util.numpy_support import numpy_to_vtk

from common import CONFIG, case, damage, fails, finish, path, report, survived, tetlod, write
from ensight_file import EnsightFile
from meshes import arrays_of, compare, compare_split, converted, tet_mesh, volumes
from test_io_vtkxml import other_cells


def grid_of(points, tets, fields, cells):
    grid, at = vtk.vtkUnstructuredGrid(), vtk.vtkPoints()
    at.SetData(numpy_to_vtk(np.ascontiguousarray(points), deep=True))
    grid.SetPoints(at)
    for tet in tets:
        grid.InsertNextCell(vtk.VTK_TETRA, 4, tet.tolist())
    for data, arrays in (grid.GetPointData(), fields), (grid.GetCellData(), cells):
        for name, values in arrays.items():
            array = numpy_to_vtk(np.ascontiguousarray(values, np.float32), deep=True)
            array.SetName(name)
            data.AddArray(array)
    return grid


def write_by_vtk(grids):
    """A grid for each step in time."""
    shutil.rmtree(path('vtk'), ignore_errors=True)
    os.makedirs(path('vtk'))
    writer = vtk.vtkEnSightWriter()
    writer.SetFileName(path('vtk/run'))
    writer.SetPath(path('vtk'))
    writer.SetBaseName('run')
    for step, grid in enumerate(grids):
        ids = numpy_to_vtk(np.ones(grid.GetNumberOfCells(), np.int32), deep=True)
        ids.SetName('BlockId')
        grid.GetCellData().AddArray(ids)
        writer.SetInputData(grid)
        writer.SetTimeStep(step)
        writer.Write()
    writer.WriteCaseFile(len(grids))
    ctypes.CDLL(None).fflush(None)  # the writer leaves it open
    return path('vtk/run.0.case')


def single(arrays):
    return {name: np.asarray(values, np.float32) for name, values in arrays.items()}


def written_by_vtk():
    points, tets, fields, cells = tet_mesh(precision=np.float32)
    later = {name: values + 1 for name, values in fields.items()}
    name = write_by_vtk([grid_of(points, tets, f, cells) for f in (fields, later)])
    for step, at in enumerate((fields, later)):
        p, t, f, c = converted(name, '--time', str(step))
        c = {key: values for key, values in c.items() if not key.startswith('BlockId')}
        problem = compare((points, tets, {k + '_n': v for k, v in single(at).items()},
                           {k + '_c': v for k, v in single(cells).items()}),
                          (p, t, f, c))
        if problem:
            return 'step %d: %s' % (step, problem)
    return None


def mixed_by_vtk():
    grid, points, fields = other_cells(())
    got = converted(write_by_vtk([grid]))
    p, t, f, c = got
    ids = c['id_c'].astype(int)
    if not np.allclose(np.bincount(ids, volumes(p, t)), [1, 0.5, 1 / 3, 1 / 6]):
        return 'volumes'
    return None if np.array_equal(f['heat_n'], np.float32(p @ [1, 2, 3.0])) else 'values'


class Out(EnsightFile):
    """The numbers of EnSight Gold."""

    def ints(self, values, width=1):
        values = np.atleast_1d(values)
        if self.kind == 'text':
            for row in values.reshape(-1, width):
                self.file.write(b''.join(b'%10d' % v for v in row) + b'\n')
        else:
            self.record(values.astype(self.order + 'i4').tobytes())

    def floats(self, values):
        if self.kind == 'text':
            self.file.write(b''.join(b'%12.5e\n' % v for v in values))
        else:
            self.record(np.asarray(values).astype(self.order + 'f4').tobytes())


POINTS = other_cells(())[1]
SECTIONS = [('tetra4', [[5, 11, 6, 10]]), ('pyramid5', [[4, 5, 6, 7, 10]]), ('hexa8', [[0, 1, 2, 3, 4, 5, 6, 7]]),
            ('penta6', [[1, 2, 8, 5, 6, 9]]), ('tria3', [[0, 1, 2]])]
FACES = [[[5, 11, 6], [5, 6, 10], [5, 10, 11], [6, 11, 10]]]


def write_geometry(kind, ids, polyhedron, structured):
    out = Out('mesh.geo', kind, True)
    out.line('a mesh')
    out.line('by hand')
    out.line('node id ' + ids)
    out.line('element id ' + ids)
    out.line('extents')
    out.file.write(b'-1.00000e+00-1.00000e+00\n' * 3) if kind == 'text' else out.floats(np.zeros(6))
    out.line('part')
    out.ints(3)
    out.line('the body')
    out.line('coordinates')
    out.ints(len(POINTS))
    if ids != 'assign':
        out.ints(np.arange(len(POINTS)) + 7)
    for column in POINTS.T:
        out.floats(column)
    for name, corners in SECTIONS[1 if polyhedron else 0:]:
        out.line(name)
        out.ints(len(corners))
        if ids != 'assign':
            out.ints(np.arange(len(corners)) + 70)
        out.ints(np.array(corners).ravel() + 1, len(corners[0]))
    if polyhedron:
        out.line('nfaced')
        out.ints(1)
        if ids != 'assign':
            out.ints(9)
        out.ints(4)
        out.ints([3, 3, 3, 3])
        out.ints(np.array(FACES[0]).ravel() + 1, 3)
    out.line('part')
    out.ints(5)
    out.line('a surface')
    out.line('coordinates')
    out.ints(3)
    if ids != 'assign':
        out.ints([1, 2, 3])
    out.floats([0, 1, 0])
    out.floats([0, 0, 1])
    out.floats([9, 9, 9])
    out.line('tria3')
    out.ints(1)
    if ids != 'assign':
        out.ints(1)
    out.ints([1, 2, 3], 3)
    if structured:
        out.line('part')
        out.ints(8)
        out.line('a grid')
        out.line('block iblanked' if structured == 'curvilinear' else 'block ' + structured)
        out.ints([3, 2, 2], 3)
        write_block(out, structured)
    out.file.close()


def write_block(out, structured):
    x, y, z = [5, 6, 8], [0, 1], [0, 2]
    if structured == 'curvilinear':
        for column in np.stack(np.meshgrid(z, y, x, indexing='ij'), -1).reshape(-1, 3).T[::-1]:
            out.floats(column)
        out.ints([1, 1, 0] + [1] * 9)
    elif structured == 'rectilinear':
        for axis in x, y, z:
            out.floats(axis)
    else:
        out.floats([5, 0, 0])
        out.floats([1, 1, 2])


def write_values(name, kind, columns, cell, polyhedron, structured, undefined):
    out = Out(name, kind)
    out.line('values')
    out.line('part')
    out.ints(3)
    sections = [(s, len(c)) for s, c in SECTIONS[1 if polyhedron else 0:]] + ([('nfaced', 1)] if polyhedron else [])
    at = 0
    for section, count in sections if cell else [('coordinates', len(POINTS))]:
        out.line(section + (' undef' if undefined else ''))
        if undefined:
            out.floats([-99])
        for c in range(columns):
            out.floats([-99 if undefined and at + i == 0 else at + i + 100 * c for i in range(count)])
        at += count
    out.line('part')
    out.ints(5)
    out.line('tria3' if cell else 'coordinates')
    for c in range(columns):
        out.floats(np.zeros(1 if cell else 3))
    if structured:
        out.line('part')
        out.ints(8)
        out.line('block')
        for c in range(columns):
            out.floats(np.arange(2 if cell else 12) + 50 + 100 * c)
    out.file.close()


CASE = '''FORMAT
type:  ensight gold

GEOMETRY
model:        1 mesh.geo

VARIABLE
scalar per node:         1 pressure "p%s"
vector per node:         1 wind u
tensor symm per node:    stress s
scalar per element:      1 load q
constant per case:       gravity 9.81
complex scalar per node: wave w w

TIME
time set:               1 Model
number of steps:        2
filename start number:  4
filename increment:     2
time values:
 0.5
 1.5
'''


def write_case(kind, ids='given', polyhedron=False, structured=None, undefined=False):
    shutil.rmtree(path('hand'), ignore_errors=True)
    os.makedirs(path('hand'))
    write_geometry(kind, ids, polyhedron, structured)
    for name, columns, cell in (('p04', 1, False), ('p06', 1, False), ('u', 3, False), ('s', 6, False), ('q', 1, True)):
        write_values(name, kind, columns, cell, polyhedron, structured, undefined and name == 'p06')
    return write('hand/mesh.case', CASE % '**')


def read_by_vtk(name):
    reader = vtk.vtkGenericEnSightReader()
    reader.SetCaseFileName(name)
    reader.UpdateInformation()
    reader.SetTimeValue(1.5)
    reader.Update()
    return reader.GetOutput()


def by_hand(*how):
    name = write_case(*how)
    structured = how[3] if len(how) > 3 else None
    p, t, f, c = converted(name)
    grid = read_by_vtk(name).GetBlock(0)
    if grid.GetNumberOfCells() != 5:
        return 'VTK reads %d cells' % grid.GetNumberOfCells()
    if not np.isclose(volumes(p, t).sum(),
                      2 + (6 - 4 * (structured == 'curvilinear') if structured != 'uniform' else 4) * bool(structured)):
        return 'volume %g' % volumes(p, t).sum()
    if sorted(f) != ['pressure', 'stress', 'wind'] or sorted(c) != ['load']:
        return 'fields %s %s' % (sorted(f), sorted(c))
    points = np.array([grid.GetPoint(i) for i in range(grid.GetNumberOfPoints())])
    rows = [np.flatnonzero((points == q).all(axis=1)) for q in p[p[:, 0] < 4]]  # a point in the middle is not VTK's
    mine = np.array([n for n, row in enumerate(rows) if len(row)])
    theirs = np.array([row[0] for row in rows if len(row)])
    if len(mine) != len(POINTS):
        return '%d points' % len(mine)
    for key, values in arrays_of(grid.GetPointData()).items():
        if not np.array_equal(f[key][mine], values[theirs]):
            return '%s: %s, not %s' % (key, f[key][mine][:2], values[theirs][:2])
    body = p[t].mean(axis=1)[:, 0] < 4
    wanted = arrays_of(grid.GetCellData())['load']
    kinds = {int(v): grid.GetCell(n).GetCellDimension() for n, v in enumerate(wanted)}
    return (None if set(c['load'][body].astype(int)) == {v for v in kinds
                                                         if kinds[v] == 3} else 'load %s, %s' % (c['load'], kinds))


def in_one_file():
    """Steps in time that are in one file."""
    name = write_case('little')
    data = open(path('hand/p06'), 'rb').read()
    line = lambda text: text.encode().ljust(80)
    later = data.replace(np.float32(5).tobytes(), np.float32(55).tobytes())
    write('hand/all', b''.join(line('BEGIN TIME STEP') + step + line('END TIME STEP') for step in (data, later)))
    write('hand/mesh.case', (CASE % '**').replace('"p**"', 'all').replace('1 pressure', '1 1 pressure') +
          'FILE\nfile set: 1\nnumber of steps: 2\n')
    got = [sorted(converted(name, '--time', step)[2]['pressure']) for step in '01']
    return None if 55 in got[1] and 55 not in got[0] and 5 in got[0] else '%s' % got


def damaged(kind):
    random, bad, names = np.random.default_rng(8), [], ['mesh.geo', 'mesh.case', 'p06', 'q']
    for n in range(40 if CONFIG == 'release' else 16):
        write_case(kind, 'given', True, 'curvilinear')
        name = path('hand/' + names[n % len(names)])
        damage(name, n, random)
        done = tetlod('convert', path('hand/mesh.case'), '-o', path('out.vtu'), timeout=600)
        if not survived(done):
            bad.append(done)
    report('damaged %s cases end in one line or a mesh' % kind, not bad, bad[:2])


def main():
    case('tetrahedra, two steps in time: written by VTK', written_by_vtk)
    case('hexahedron, wedge, pyramid, tetrahedron: written by VTK', mixed_by_vtk)
    for kind in 'text', 'little', 'big', 'fortran':
        for ids in 'given', 'assign':
            case('%s, ids %s' % (kind, ids), by_hand, kind, ids)
        case('%s, a polyhedron' % kind, by_hand, kind, 'ignore', True)
        for structured in 'curvilinear', 'rectilinear', 'uniform':
            case('%s, a %s block' % (kind, structured), by_hand, kind, 'assign', False, structured)
    case('steps in one file', in_one_file)
    name = write_case('text', undefined=True)
    fails('an undefined value is NaN', 3, ['mesh.case', 'NaN', 'nan-fill'], 'convert', name, '-o', path('out.vtu'))
    name = write_case('little')
    fails('a block that is not there', 3, ['mesh.case', 'nobody'], 'convert', name, '--block', 'nobody', '-o',
          path('out.vtu'))
    name = write_case('text')
    with open(path('hand/mesh.geo')) as file:
        text = file.read()
    write('hand/mesh.geo', re.sub(r'(pyramid5\n *\d+\n(?: +70\n)?) *5 ', r'\1-9223372036854775808 ', text))
    fails('the least of all numbers as a corner', 3, ['mesh.case', 'point'], 'convert', name, '-o', path('out.vtu'))
    name = write_case('little')
    write('hand/mesh.case', (CASE % '**').replace('gold', '6'))
    words = ['mesh.case', 'mesh.geo', 'is it a geometry of EnSight Gold']
    fails('EnSight Gold that says to be EnSight 6', 3, words, 'convert', name, '-o', path('out.vtu'))
    write_case('little')
    os.remove(path('hand/u'))
    fails('a variable that is missing', 1, ['mesh.case', 'hand/u'], 'convert', name, '-o', path('out.vtu'))
    for kind in 'text', 'little':
        damaged(kind)
    finish()


if __name__ == '__main__':
    main()
