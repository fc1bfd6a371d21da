#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""Cells that were split into tetrahedra, against VTK: their values are stored once a cell, and the finest level gives
them back as they were."""
import os
import sys

import numpy as np

from common import ROOT, case, fails, finish, info, must, path, read_grid, report

try:
    import vtk
    from vtk.util.numpy_support import numpy_to_vtk, vtk_to_numpy
except ImportError as missing:
    report('VTK', True, skip='not installed: %s' % missing)
    finish()
    sys.exit()

from cell_meshes import cells_of  # noqa: E402

sys.path.insert(0, os.path.join(ROOT, 'tests'))
from streams import tetlod as reference  # noqa: E402

FACES = ((0, 3, 2, 1), (4, 5, 6, 7), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7))


def mixed(size, shuffled=False):
    """A cube of hexahedra, wedges, pyramids and polyhedra: points, and cells as VTK's type and points or faces."""
    random, side = np.random.default_rng(3), size + 1
    points = np.stack(np.meshgrid(*[np.arange(side)] * 3, indexing='ij'), -1).reshape(-1, 3).astype(np.float32)
    points += random.random(points.shape, np.float32) * np.float32(0.2)
    points, cells = list(points), []
    for i, j, k in np.ndindex(size, size, size):
        low = (i * side + j) * side + k
        a = [low, low + side * side, low + side * side + side, low + side]
        a += [corner + 1 for corner in a]
        if 4 * i < size:
            cells.append((12, a))
        elif 4 * i < 2 * size:
            cells += [(13, [a[0], a[1], a[2], a[4], a[5], a[6]]), (13, [a[0], a[2], a[3], a[4], a[6], a[7]])]
        elif 4 * i < 3 * size:
            points.append(np.mean([points[corner] for corner in a], 0))
            cells += [(14, [*(a[corner] for corner in reversed(face)), len(points) - 1]) for face in FACES]
        else:
            cells.append((42, [[a[corner] for corner in face] for face in FACES]))
    points = np.array(points, np.float32)
    if shuffled:
        places = random.permutation(len(points))
        points = points[np.argsort(places)]
        cells = [cells[number] for number in random.permutation(len(cells))]
        cells = [(kind, np.take(places, corners).tolist()) for kind, corners in cells]
    return points, cells


def corners_of(cell):
    return sorted(set(np.ravel(cell[1]).tolist()))


def grid_of(points, cells, point_data, cell_data):
    grid, at = vtk.vtkUnstructuredGrid(), vtk.vtkPoints()
    at.SetData(numpy_to_vtk(points, deep=True))
    grid.SetPoints(at)
    for kind, corners in cells:
        if kind == vtk.VTK_POLYHEDRON:
            faces = vtk.vtkIdList()
            for number in [len(corners), *(number for face in corners for number in [len(face), *face])]:
                faces.InsertNextId(number)
            grid.InsertNextCell(kind, faces)
        else:
            grid.InsertNextCell(kind, len(corners), corners)
    for data, arrays in ((grid.GetPointData(), point_data), (grid.GetCellData(), cell_data)):
        for key, values in arrays.items():
            array = numpy_to_vtk(np.ascontiguousarray(values), deep=True)
            array.SetName(key)
            data.AddArray(array)
    return grid


def write_grid(name, grid):
    writer = vtk.vtkXMLUnstructuredGridWriter()
    writer.SetFileName(path(name))
    writer.SetInputData(grid)
    assert writer.Write()


def values_of(points, cells):
    """At points; of cells, where no two cells have one pressure, and some are NaN."""
    random = np.random.default_rng(4)
    centres = np.array([points[corners_of(cell)].mean(0) for cell in cells])
    pressure = np.sin(centres[:, 0]) + random.random(len(cells)) / 1000
    holes = np.cos(centres[:, 1]).astype(np.float32)
    holes[::17] = np.nan
    speed = np.stack([np.sin(centres @ axis) + random.random(len(cells)) / 1000 for axis in np.eye(3) + 0.5], 1)
    return {'p': np.sin(points[:, 0]) + points[:, 1]}, \
        {'id': np.arange(len(cells), dtype=np.int32), 'pressure': pressure, 'holes': holes, 'speed': speed,
         'material': (centres[:, 2] > 3).astype(np.int8)}


def make():
    for name, shuffled in (('in', False), ('mixed', True)):
        points, cells = mixed(8, shuffled)
        write_grid(name + '.vtu', grid_of(points, cells, *values_of(points, cells)))
        must('build', path(name + '.vtu'), '--field', 'p', '-o', path(name + '.tetlod'))
        must('convert', path(name + '.vtu'), '-o', path(name + '_tets.vtu'))
        must('build', path(name + '_tets.vtu'), '--field', 'p', '-o', path(name + '_tets.tetlod'))


def sizes(name):
    """Against what the same tetrahedra take, as those of a file of tetrahedra, whose bytes stay as they are."""
    whole, split = (os.path.getsize(path(name + end)) for end in ('_tets.tetlod', '.tetlod'))
    tags = [{section['tag'] for section in reference.open(path(name + end)).sections}
            for end in ('_tets.tetlod', '.tetlod')]
    if 'CELL' not in tags[0] or 'PCEL' in tags[0] or not {'PCEL', 'PMAP', 'PVAL'} <= tags[1]:
        return tags
    return None if split <= 0.6 * whole else '%d of %d bytes' % (split, whole)


def by_level(name):
    """Every tetrahedron has the values of its cell, at every level and in prefixes, as where each has its own."""
    wanted = cells_of(read_grid(name + '.vtu'))
    levels = len(reference.open(path(name + '.tetlod')).levels)
    for level in (0, levels // 2, levels - 1):
        must('extract', path(name + '.tetlod'), '--level', str(level), '-o', path('level.vtu'), '--quiet')
        must('extract', path(name + '.tetlod'), '--level', str(level), '-o', path('prefix.tetlod'), '--quiet')
        must('verify', path('prefix.tetlod'))
        must('extract', path('prefix.tetlod'), '-o', path('prefix.vtu'), '--quiet')
        for file in ('level.vtu', 'prefix.vtu'):
            found = cells_of(read_grid(file))
            ids = found['id'].astype(int)
            for key, values in wanted.items():
                if not np.array_equal(values[ids], found[key], equal_nan=True):
                    return '%s of %s at level %d is wrong' % (key, file, level)
    return None


def python_decoder():
    stream, wanted = reference.open(path('in.tetlod')), cells_of(read_grid('in.vtu'))
    ids = stream.cells('id').astype(int)
    wrong = [name for name, values in wanted.items()
             if not np.array_equal(values[ids], stream.cells(name), equal_nan=True)]
    return wrong or None


def cut_off():
    """Values of cells that are whole are there, as are those of tetrahedra."""
    data = open(path('in.tetlod'), 'rb').read()
    values = [section for section in reference.open(data).sections if section['tag'] == 'PVAL']
    ends = [section['offset'] + section['stored'] for section in values]
    with open(path('cut.tetlod'), 'wb') as file:
        file.write(data[:ends[1]])
    must('extract', path('cut.tetlod'), '-o', path('cut.vtu'), '--quiet')
    found = cells_of(read_grid('cut.vtu'))
    return None if set(found) == {'id', 'pressure'} else str(list(found))


def verified(name):
    must('verify', path(name + '.tetlod'), '--against', path(name + '.vtu'))

# ---- the cells as they were

def read_any(name):
    kinds = {'vtu': vtk.vtkXMLUnstructuredGridReader, 'vtk': vtk.vtkUnstructuredGridReader, 'vtkhdf': vtk.vtkHDFReader}
    reader = kinds[name.rsplit('.', 1)[1]]()
    reader.SetFileName(path(name))
    reader.Update()
    return reader.GetOutput()


def arrays(data):
    return {data.GetArrayName(i): vtk_to_numpy(data.GetArray(i)) for i in range(data.GetNumberOfArrays())}


def cell_list(grid):
    """Of each cell its type, and its points or the faces of a polyhedron."""
    out = []
    for number in range(grid.GetNumberOfCells()):
        ids = vtk.vtkIdList()
        kind = grid.GetCellType(number)
        (grid.GetFaceStream if kind == vtk.VTK_POLYHEDRON else grid.GetCellPoints)(number, ids)
        out.append((kind, [ids.GetId(i) for i in range(ids.GetNumberOfIds())]))
    return out


def bits_differ(a, b):
    a = a.astype(b.dtype) if a.dtype.kind == b.dtype.kind == 'i' else a
    return a.dtype != b.dtype or a.shape != b.shape or \
        np.ascontiguousarray(a).tobytes() != np.ascontiguousarray(b).tobytes()


def difference(wanted, found):
    """Bit for bit: points, cells, values at points and of cells."""
    points = [vtk_to_numpy(grid.GetPoints().GetData()) for grid in (wanted, found)]
    if bits_differ(*points):
        return 'the points differ'
    if cell_list(wanted) != cell_list(found):
        return 'the cells differ'
    for what in ('GetPointData', 'GetCellData'):
        a, b = (arrays(getattr(grid, what)()) for grid in (wanted, found))
        if set(a) != set(b):
            return '%s: %s, not %s' % (what, sorted(b), sorted(a))
        wrong = [name for name in a if bits_differ(a[name], b[name])]
        if wrong:
            return '%s: %s differ' % (what, wrong)
    return None


def back(name, ending='vtu', *options):
    must('build', path(name + '.vtu'), '--keep-order', '-o', path(name + '_kept.tetlod'), *options)
    must('extract', path(name + '_kept.tetlod'), '--cells', 'original', '-o', path('back.' + ending))
    return difference(read_grid(name + '.vtu'), read_any('back.' + ending))


def no_polyhedra():
    points, cells = mixed(4)
    cells = [cell for cell in cells if cell[0] != vtk.VTK_POLYHEDRON]
    used = np.unique(np.concatenate([cell[1] for cell in cells]))
    names = np.full(len(points), -1)
    names[used] = np.arange(len(used))
    cells = [(kind, names[corners].tolist()) for kind, corners in cells]
    points = points[used]
    write_grid('plain.vtu', grid_of(points, cells, *values_of(points, cells)))
    return back('plain', 'vtkhdf')


def quadratic():
    """Middles of edges, which no tetrahedron has, come back with their values; with --subdivide they are vertices."""
    points, cells = mixed(3)
    cells, edges = [cell for cell in cells if cell[0] in (12, 13)], {}
    pairs = {12: (25, ((0, 1), (1, 2), (2, 3), (3, 0), (4, 5), (5, 6), (6, 7), (7, 4), (0, 4), (1, 5), (2, 6), (3, 7))),
             13: (26, ((0, 1), (1, 2), (2, 0), (3, 4), (4, 5), (5, 3), (0, 3), (1, 4), (2, 5)))}
    points, bent = [tuple(point) for point in points], []
    for kind, corners in cells:
        ends = [tuple(sorted((corners[a], corners[b]))) for a, b in pairs[kind][1]]
        for end in ends:
            if end not in edges:
                edges[end] = len(points)
                points.append(tuple(np.add(points[end[0]], points[end[1]]) / 2 + 0.01))
        bent.append((pairs[kind][0], corners + [edges[end] for end in ends]))
    used = set(np.concatenate([corners for _, corners in bent]).tolist())
    used = sorted(used, key=lambda point: point * 7919 % len(points))
    names = {point: number for number, point in enumerate(used)}
    bent = [(kind, [names[corner] for corner in corners]) for kind, corners in bent]
    points = np.array([points[point] for point in used], np.float64)
    values, of_cells = values_of(points, bent)
    values['speed'] = np.stack([np.sin(points[:, 0]), points[:, 1], points[:, 2]], 1).astype(np.float32)
    write_grid('bent.vtu', grid_of(points, bent, values, of_cells))
    return back('bent') or python_cells('bent') or back('bent', 'vtk') or back('bent', 'vtu', '--subdivide') or \
        python_cells('bent')


def python_cells(name):
    cells, wanted = reference.open(path(name + '_kept.tetlod')).original_cells(), read_grid(name + '.vtu')
    if not np.array_equal(cells.points, vtk_to_numpy(wanted.GetPoints().GetData())):
        return 'the points differ'
    lists = [cells.connectivity[begin:end] for begin, end in zip(cells.offsets, cells.offsets[1:])]
    if list(zip(cells.types.tolist(), lists)) != cell_list(wanted):
        return 'the cells differ'
    data = arrays(wanted.GetCellData())
    wrong = [key for key in data if not np.array_equal(cells.values(key), data[key], equal_nan=True)]
    at = arrays(wanted.GetPointData())
    wrong += [key for key in at if not np.array_equal(cells.field(key).reshape(at[key].shape), at[key])]
    return wrong or None


def ghosts():
    """Cells that VTK does not draw are left out, as are points that only these have."""
    grid = read_grid('plain.vtu')
    count = grid.GetNumberOfCells()
    hidden = numpy_to_vtk((np.arange(count) % 7 == 0).astype(np.uint8), deep=True)
    hidden.SetName('vtkGhostType')
    grid.GetCellData().AddArray(hidden)
    write_grid('ghosts.vtu', grid)
    must('build', path('ghosts.vtu'), '--keep-order', '-o', path('ghosts.tetlod'))
    must('extract', path('ghosts.tetlod'), '--cells', 'original', '-o', path('back.vtu'))
    wanted, found = read_grid('plain.vtu'), read_grid('back.vtu')
    seen = np.flatnonzero(np.arange(count) % 7)
    places = [vtk_to_numpy(each.GetPoints().GetData()) for each in (wanted, found)]
    wanted_cells, found_cells = cell_list(wanted), cell_list(found)
    if not np.array_equal(arrays(wanted.GetCellData())['id'][seen], arrays(found.GetCellData())['id']):
        return 'the cells differ'
    return None if all(wanted_cells[a][0] == kind and np.array_equal(places[0][wanted_cells[a][1]], places[1][corners])
                       for a, (kind, corners) in zip(seen, found_cells)) else 'the corners differ'


def turned():
    """Tetrahedra that are numbered both ways, among hexahedra."""
    points, cells = mixed(4)
    cells = [cell for cell in cells if cell[0] == 12]
    for low in range(2):
        a = np.array(cells[low][1])
        split = [(0, 1, 3, 4), (1, 2, 3, 6), (1, 3, 4, 6), (1, 4, 5, 6), (3, 4, 6, 7)]
        cells += [(10, a[list(tet if number % 2 else tet[::-1])].tolist()) for number, tet in enumerate(split)]
    cells = cells[2:]
    used = np.unique(np.concatenate([corners for _, corners in cells]))
    names = np.zeros(len(points), int)
    names[used] = np.arange(len(used))
    cells = [(kind, names[corners].tolist()) for kind, corners in cells]
    points = points[used]
    write_grid('turned.vtu', grid_of(points, cells, *values_of(points, cells)))
    return back('turned')


def welded():
    """Blocks whose points are welded: the same cells at the same places."""
    blocks = vtk.vtkMultiBlockDataSet()
    points, cells = mixed(4)
    halves = [[cell for cell in cells if cell[0] == 12], [cell for cell in cells if cell[0] == 13]]
    for number, half in enumerate(halves):
        used = np.unique(np.concatenate([corners for _, corners in half]))
        names = np.zeros(len(points), int)
        names[used] = np.arange(len(used))
        moved = [(kind, names[corners].tolist()) for kind, corners in half]
        blocks.SetBlock(number, grid_of(points[used], moved, *values_of(points[used], moved)))
        halves[number] = (points[used], moved)
    writer = vtk.vtkXMLMultiBlockDataWriter()
    writer.SetFileName(path('two.vtm'))
    writer.SetInputData(blocks)
    assert writer.Write()
    must('build', path('two.vtm'), '--keep-order', '-o', path('two.tetlod'))
    must('extract', path('two.tetlod'), '--cells', 'original', '-o', path('back.vtu'))
    found = read_grid('back.vtu')
    at = vtk_to_numpy(found.GetPoints().GetData())
    wanted = [(kind, places[corners]) for places, half in halves for kind, corners in half]
    got = cell_list(found)
    return None if len(at) < sum(len(places) for places, _ in halves) and len(got) == len(wanted) and \
        all(kind == other and np.array_equal(places, at[corners])
            for (kind, places), (other, corners) in zip(wanted, got)) else 'other cells'


def steps():
    sets = ''
    points, cells = mixed(4)
    for step in range(10):
        values, of_cells = values_of(points, cells)
        of_cells['pressure'] = of_cells['pressure'] + step
        write_grid('t%d.vtu' % step, grid_of(points, cells, {'p': values['p'] * (step + 1)}, of_cells))
        sets += '<DataSet timestep="%d" file="t%d.vtu"/>' % (step, step)
    with open(path('t.pvd'), 'w') as file:
        file.write('<VTKFile type="Collection" version="0.1"><Collection>%s</Collection></VTKFile>' % sets)
    must('build', path('t.pvd'), '--keep-order', '-o', path('t.tetlod'))
    must('verify', path('t.tetlod'), '--against', path('t.pvd'))
    for step in (0, 3, 9):
        must('extract', path('t.tetlod'), '--step', str(step), '--cells', 'original', '-o', path('back.vtu'))
        problem = difference(read_grid('t%d.vtu' % step), read_grid('back.vtu'))
        if problem:
            return 'step %d: %s' % (step, problem)
    fails('at a coarse band: refused', 2, ['finest level'], 'extract', path('t.tetlod'), '--step', '3', '--error', '5%',
          '--cells', 'original', '-o', path('back.vtu'))
    return None


def rounded():
    """Cells stay what they are where points and values are rounded, and it is told."""
    must('build', path('in.vtu'), '--keep-order', '--position-bits', '16', '--field-bits', '12', '-o', path('r.tetlod'))
    said = must('extract', path('r.tetlod'), '--cells', 'original', '-o', path('back.vtu')).stderr
    must('verify', path('r.tetlod'), '--against', path('in.vtu'))
    wanted, found = read_grid('in.vtu'), read_grid('back.vtu')
    if cell_list(wanted) != cell_list(found) or b'rounded' not in said:
        return said
    stated = {field['name']: field for field in info('r.tetlod')['cell_fields']}
    for name, values in arrays(wanted.GetCellData()).items():
        got = arrays(found.GetCellData())[name]
        off = np.max(np.abs(got.astype(float) - values)) if name != 'holes' else 0
        if name == 'holes' and not np.array_equal(values, got, equal_nan=True) or \
                (off > 0) != ('error' in stated[name]) or off > stated[name].get('error', 0) or \
                off > 0.5000001 / 4095 * np.ptp(values):
            return '%s is %g off, and %s is stated' % (name, off, stated[name])
    return None if 'error' in stated['pressure'] and 'error' in stated['speed'] else stated


def refusals():
    kept, out = path('in_kept.tetlod'), path('no.vtu')
    words = ('--cells', 'original', '-o')
    fails('a coarse level: refused', 2, ['finest level'], 'extract', kept, '--level', '1', *words, out)
    fails('a box: refused', 2, ['--box'], 'extract', kept, '--level', '1', '--box', '0,0,0,1,1,1', *words, out)
    fails('Gmsh: refused', 2, ['.vtu'], 'extract', kept, *words, path('no.msh'))
    fails('polyhedra in VTKHDF: refused', 2, ['polyhedra'], 'extract', kept, *words, path('no.vtkhdf'))
    fails('without --keep-order: refused', 2, ['--keep-order'], 'extract', path('in.tetlod'), *words, out)
    with open(kept, 'rb') as file:
        data = file.read()
    place = [section for section in reference.open(data).sections if section['tag'] == 'ORIG'][0]
    with open(path('cut.tetlod'), 'wb') as file:
        file.write(data[:place['offset'] + place['stored'] - 1])
    fails('a file that is cut off: refused', 3, ['ends at byte'], 'extract', path('cut.tetlod'), *words, out)
    must('extract', kept, '--level', '2', '-o', path('prefix.tetlod'))
    fails('a prefix: refused', 2, ['--keep-order'], 'extract', path('prefix.tetlod'), *words, out)
    must('ask', path('in.tetlod'), 'mean(p)')


if __name__ == '__main__':
    case('streams of hexahedra, wedges, pyramids and polyhedra', make)
    for mesh in ('in', 'mixed'):
        case('%s: 0.6 of the bytes that tetrahedra take' % mesh, sizes, mesh)
        case('%s: every tetrahedron has its cell\'s values' % mesh, by_level, mesh)
        case('%s: verified against the input' % mesh, verified, mesh)
    case('the decoder in Python', python_decoder)
    case('a file that is cut off', cut_off)
    for mesh in ('in', 'mixed'):
        for ending in ('vtu', 'vtk'):
            case('%s: the original cells in .%s, bit for bit' % (mesh, ending), back, mesh, ending)
    case('the original cells, read in Python', python_cells, 'in')
    case('hexahedra, wedges and pyramids in .vtkhdf', no_polyhedra)
    case('in pages, which have a table as well', back, 'in', 'vtu', '--paged=300')
    case('quadratic cells', quadratic)
    case('ghosts', ghosts)
    case('tetrahedra that are numbered both ways', turned)
    case('blocks that are welded', welded)
    case('steps in time', steps)
    case('rounded', rounded)
    case('what is refused', refusals)
    finish()
