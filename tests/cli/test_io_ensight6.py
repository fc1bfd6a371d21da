#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""EnSight 6 as text, of which VTK's reader reads the same, also with numbers that touch, and as big- and little-endian
and Fortran files, all laid out by hand; and variables of EnSight Gold that only some nodes or elements have."""
import os
import shutil

import numpy as np
import vtk

from common import CONFIG, case, damage, fails, finish, path, report, survived, tetlod, write
from ensight_file import EnsightFile
from meshes import arrays_of, compare, converted, volumes
from test_io_vtkxml import other_cells

POINTS = other_cells(())[1]
PARTS = [('the body', [('tetra4', [[5, 11, 6, 10]]), ('pyramid5', [[4, 5, 6, 7, 10]]),
                       ('hexa8', [[0, 1, 2, 3, 4, 5, 6, 7]])]),
         ('a wedge', [('penta6', [[1, 2, 8, 5, 6, 9]]), ('tria3', [[0, 1, 2], [0, 2, 3]])])]
COLUMNS = {'wind': [0, 100, 200], 'stress': [0, 100, 200, 300, 500, 400]}
AXES = [5, 6, 8], [0, 1], [0, 2]
CASE = '''FORMAT
type:  ensight

GEOMETRY
model:        1 mesh.geo

VARIABLE
scalar per node:         1 pressure p**
vector per node:         1 wind u
tensor symm per node:    stress s
scalar per element:      1 load q
vector per element:      1 flux f

TIME
time set:               1 Model
number of steps:        2
filename start number:  4
filename increment:     2
time values:
 0.5
 1.5
'''


class Out(EnsightFile):
    """The numbers of EnSight 6."""

    def ints(self, values):
        values = np.atleast_1d(values).ravel()
        if self.kind == 'text':
            self.file.write(b''.join(b'%8d' % v for v in values) + b'\n')
        else:
            self.record(values.astype(self.order + 'i4').tobytes())

    def floats(self, values):
        """Six on a line."""
        values = np.asarray(values, float).ravel()
        if self.kind == 'text':
            for i in range(0, len(values), 6):
                self.file.write(b''.join(b'%12.5e' % v for v in values[i:i + 6]) + b'\n')
        else:
            self.record(values.astype(self.order + 'f4').tobytes())

    def rows(self, numbers, values, form):
        """Text has a row on a line, binary files have all numbers first."""
        if self.kind == 'text':
            for n, row in enumerate(values):
                head = b'' if numbers is None else b'%8d' % numbers[n]
                self.file.write(head + b''.join(form % v for v in row) + b'\n')
            return
        if numbers is not None:
            self.ints(numbers)
        self.ints(values) if form == b'%8d' else self.floats(values)


def write_geometry(kind, ids, structured, touching=False):
    names = np.arange(len(POINTS)) * 3 + (12345670
                                          if touching else 100) if ids == 'given' else np.arange(len(POINTS)) + 1
    out = Out('mesh.geo', kind, True)
    for line in 'a mesh', 'by hand', 'node id ' + ids, 'element id ' + ids, 'coordinates':
        out.line(line)
    out.ints(len(POINTS))
    out.rows(names if ids == 'given' else None, POINTS, b'%12.5e')
    for number, (name, sections) in enumerate(PARTS):
        out.line('part %d' % (number + 1))
        out.line(name)
        for section, corners in sections:
            out.line(section)
            out.ints(len(corners))
            out.rows(np.arange(len(corners)) + 70 if ids == 'given' else None, names[np.array(corners)], b'%8d')
    if structured:
        out.line('part 3')
        out.line('a grid')
        out.line('block iblanked')
        out.ints([3, 2, 2])
        for column in np.stack(np.meshgrid(*AXES[::-1], indexing='ij'), -1).reshape(-1, 3).T[::-1]:
            out.floats(column)
        out.ints([1, 1, 0] + [1] * 9)
    out.file.close()


def write_values(name, kind, columns, cell, structured):
    """Row by row, but of a block column by column."""
    out = Out(name, kind)
    out.line('values')
    rows = lambda first, count: -(first + np.arange(count)[:, None] + 100 * np.arange(columns) + 1.0)
    at = 0
    if not cell:
        out.floats(rows(0, len(POINTS)))
    for number, (_, sections) in enumerate(PARTS if cell else ()):
        out.line('part %d' % (number + 1))
        for section, corners in sections:
            out.line(section)
            out.floats(rows(at, len(corners)))
            at += len(corners)
    if structured:
        out.line('part 3')
        out.line('block')
        for column in rows(50, 2 if cell else 12).T:
            out.floats(column)
    out.file.close()


def write_case(kind, ids='given', structured=False, touching=False):
    shutil.rmtree(path('hand'), ignore_errors=True)
    os.makedirs(path('hand'))
    write_geometry(kind, ids, structured, touching)
    for name, columns, cell in (('p04', 1, False), ('p06', 1, False), ('u', 3, False), ('s', 6, False),
                                ('q', 1, True), ('f', 3, True)):
        write_values(name, kind, columns, cell, structured)
    return write('hand/mesh.case', CASE)


def read_by_vtk(name):
    reader = vtk.vtkGenericEnSightReader()
    reader.SetCaseFileName(name)
    reader.UpdateInformation()
    reader.SetTimeValue(1.5)
    reader.Update()
    return reader.GetOutput()


def centres(grid):
    """The values of each of VTK's cells with a volume, by its centre."""
    arrays, out = arrays_of(grid.GetCellData()), {}
    for n in range(grid.GetNumberOfCells()):
        cell = grid.GetCell(n)
        if cell.GetCellDimension() == 3:
            b = cell.GetBounds()
            out[tuple(np.round([b[0] + b[1], b[2] + b[3], b[4] + b[5]], 3))] = {k: v[n] for k, v in arrays.items()}
    return out


def by_hand(ids, structured):
    name = write_case('text', ids, structured)
    p, t, f, c = converted(name)
    if sorted(f) != ['pressure', 'stress', 'wind'] or sorted(c) != ['flux', 'load']:
        return 'fields %s %s' % (sorted(f), sorted(c))
    if not np.isclose(volumes(p, t).sum(), 2 + 2 * structured):  # one of the grid's two cells is blanked
        return 'volume %g' % volumes(p, t).sum()
    theirs, known = read_by_vtk(name), {}
    for b in range(theirs.GetNumberOfBlocks()):
        grid = theirs.GetBlock(b)
        arrays = arrays_of(grid.GetPointData())
        for i in range(grid.GetNumberOfPoints()):
            known[tuple(np.round(grid.GetPoint(i), 4))] = {k: v[i] for k, v in arrays.items()}
    for i, point in enumerate(p):
        for key in f:
            if key != 'pressure' and point[0] > 4:  # VTK 9.1 mixes the columns of a block up
                if not np.array_equal(f[key][i], f['pressure'][i] - COLUMNS[key]):
                    return '%s of the block: %s' % (key, f[key][i])
            elif not np.array_equal(f[key][i], known[tuple(np.round(point, 4))][key]):
                return '%s at %s: %s, not %s' % (key, point, f[key][i], known[tuple(np.round(point, 4))][key])
    mine = {(float(q), *map(float, w)) for q, w in zip(c['load'], c['flux'])}
    cells = {k: v for b in range(theirs.GetNumberOfBlocks()) for k, v in centres(theirs.GetBlock(b)).items()}
    wanted = {(float(v['load']), *map(float, v['flux'])) for v in cells.values()}
    return None if mine <= wanted and len(mine) == 4 + structured else 'values of cells: %s of %s' % (mine, wanted)


def alike(how):
    """Kinds of which VTK does not read all values, as the text of which it does."""
    return compare(converted(write_case('text', 'given', True)), converted(write_case(*how)))


def one_part():
    p, t, f, c = converted(write_case('little'), '--block', 'a wedge')
    return None if np.isclose(volumes(p, t).sum(), 0.5) and len(p) == 6 and len(f) == 3 else 'volume %g' % volume


def partial(kind, cell):
    """A Gold variable of which the last node, or element, has no value."""
    shutil.rmtree(path('hand'), ignore_errors=True)
    os.makedirs(path('hand'))
    out = Out('mesh.geo', kind, True)
    for line in 'a mesh', 'by hand', 'node id assign', 'element id assign', 'part':
        out.line(line)
    out.ints(1)
    out.line('body')
    out.line('coordinates')
    points, tets = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 1, 1.0]]), [[1, 2, 3, 4], [2, 3, 4, 5]]
    column = lambda values: [out.floats([v]) for v in values] if kind == 'text' else out.floats(values)
    out.ints(5)
    for axis in points.T:
        column(axis)
    out.line('tetra4')
    out.ints(2)
    out.ints(tets)
    out.file.close()
    out = Out('v', kind)
    out.line('values')
    out.line('part')
    out.ints(1)
    out.line('tetra4 partial' if cell else 'coordinates partial')
    rows = [1] if cell else [4, 2, 1, 3]
    out.ints(len(rows))
    out.ints(rows)
    for axis in range(3):
        column([10 * axis + row for row in rows])
    out.file.close()
    out = Out('m', kind)
    for line in 'values', 'part':
        out.line(line)
    out.ints(1)
    out.line('coordinates')
    column(np.arange(5))
    out.file.close()
    name = write('hand/mesh.case', 'FORMAT\ntype: ensight gold\nGEOMETRY\nmodel: mesh.geo\n'
                 'VARIABLE\nvector per %s: wind v\n'
                 'scalar per node: mass m\n' % ('element' if cell else 'node'))
    if not cell:
        done = tetlod('convert', name, '-o', path('out.vtu'))
        if done.returncode != 3 or b'wind' not in done.stderr or b'--nan-fill' not in done.stderr:
            return done
    _, _, f, c = converted(name, *([] if cell else ['--nan-fill', '-5']))
    wind, lack = (c if cell else f)['wind'], np.nan if cell else -5
    wanted = [[10 * axis + row if row in rows else lack for axis in range(3)]
              for row in range(1, (2 if cell else 5) + 1)]
    return None if np.array_equal(wind, wanted, equal_nan=True) else '%s' % wind


def damaged(kind):
    random, bad, names = np.random.default_rng(8), [], ['mesh.geo', 'mesh.case', 'p06', 'q']
    for n in range(20 if CONFIG == 'release' else 10):
        write_case(kind, 'given', True)
        name = path('hand/' + names[n % len(names)])
        damage(name, n, random)
        done = tetlod('convert', path('hand/mesh.case'), '-o', path('out.vtu'), timeout=600)
        if not survived(done):
            bad.append(done)
    report('damaged %s cases end in one line or a mesh' % kind, not bad, bad[:2])


def main():
    for ids in 'given', 'off':
        for structured in False, True:
            case('text, ids %s%s' % (ids, ', a block' * structured), by_hand, ids, structured)
        for kind in 'little', 'big', 'fortran':
            case('%s, ids %s' % (kind, ids), alike, [kind, ids, True])
    case('numbers of text that touch', alike, ['text', 'given', True, True])
    case('one part', one_part)
    fails('a part that is not there', 3, ['mesh.case', "no part 'nobody'"], 'convert', write_case('text'), '--block',
          'nobody', '-o',
          path('out.vtu'))
    for kind in 'text', 'little', 'fortran':
        for cell in False, True:
            case('values of some %s, %s' % ('elements' if cell else 'nodes', kind), partial, kind, cell)
    for kind in 'text', 'little':
        damaged(kind)
    finish()


main()
