#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""VTK's XML files of every kind, as VTK itself writes them: cells, data, pieces, blocks, times."""
import os

import numpy as np
import vtk
from vtk.util.numpy_support import numpy_to_vtk

from common import case, fails, finish, must, path, report, tetlod, write
from meshes import (add_arrays, arrays_of, compare, compare_split, converted, read, structured, tet_mesh, vtk_mesh,
                    volumes)

WRITERS = {'image': (vtk.vtkXMLImageDataWriter, 'vti'), 'rectilinear': (vtk.vtkXMLRectilinearGridWriter, 'vtr'),
           'structured': (vtk.vtkXMLStructuredGridWriter, 'vts')}
PARALLEL = {'image': (vtk.vtkXMLPImageDataWriter, 'pvti'), 'rectilinear': (vtk.vtkXMLPRectilinearGridWriter, 'pvtr'),
            'structured': (vtk.vtkXMLPStructuredGridWriter, 'pvts')}


def save(writer, data, name, mode='appended', compressor='zlib', header=64, order='little', block=4096):
    writer.SetInputData(data)
    writer.SetFileName(path(name))
    {'ascii': writer.SetDataModeToAscii, 'inline': writer.SetDataModeToBinary}.get(mode, writer.SetDataModeToAppended)()
    writer.SetEncodeAppendedData(mode == 'base64')
    {'none': writer.SetCompressorTypeToNone, 'zlib': writer.SetCompressorTypeToZLib,
     'lz4': writer.SetCompressorTypeToLZ4,
     'lzma': writer.SetCompressorTypeToLZMA}[compressor]()
    writer.SetHeaderTypeToUInt64() if header == 64 else writer.SetHeaderTypeToUInt32()
    writer.SetByteOrderToBigEndian() if order == 'big' else writer.SetByteOrderToLittleEndian()
    writer.SetBlockSize(block)
    assert writer.Write()
    return path(name)


def tets_case(mesh, *how):
    return compare(mesh, converted(save(vtk.vtkXMLUnstructuredGridWriter(), vtk_mesh(*mesh), 'in.vtu', *how)))


def structured_case(kind, *how):
    grid, *wanted = structured(kind)
    writer, extension = WRITERS[kind]
    return compare_split(*wanted, converted(save(writer(), grid, 'in.' + extension, *how)))


def parallel_case(kind, ghosts):
    """Four pieces that share planes of points, with or without ghosts."""
    grid, *wanted = structured(kind, (9, 7, 6))
    writer, extension = PARALLEL[kind]
    writer = writer()
    writer.SetInputData(grid)
    writer.SetFileName(path('whole.' + extension))
    writer.SetNumberOfPieces(4)
    writer.SetGhostLevel(ghosts)
    writer.SetStartPiece(0)
    writer.SetEndPiece(3)
    assert writer.Write()
    return compare_split(*wanted, converted(path('whole.' + extension)))


def pvtu_case():
    """Three pieces in files, with ghost cells that are marked and points that are there several times."""
    points, tets, fields, cells = mesh = tet_mesh(500)
    part = (points[tets].mean(axis=1)[:, 1] * 3).astype(int)
    names = []
    for p in range(3):
        mine, others = np.flatnonzero(part == p), np.flatnonzero(part == (p + 1) % 3)[:20]
        take = np.concatenate([mine, others])
        used, local = np.unique(tets[take], return_inverse=True)
        piece = vtk_mesh(points[used], local.reshape(-1, 4), {n: v[used] for n, v in fields.items()},
                         {n: v[take] for n, v in cells.items()})
        add_arrays(piece.GetCellData(), {'vtkGhostType': np.array([0] * len(mine) + [1] * len(others), np.uint8)})
        names.append('piece_%d.vtu' % p)
        save(vtk.vtkXMLUnstructuredGridWriter(), piece, names[-1])
    write(
        'all.pvtu',
        '<?xml version="1.0"?>\n<VTKFile type="PUnstructuredGrid" version="1.0"><PUnstructuredGrid GhostLevel="1">'
        '<PPointData><PDataArray type="Float64" Name="heat"/></PPointData>%s</PUnstructuredGrid></VTKFile>' %
        ''.join('<Piece Source="%s"/>' % n for n in names))
    done = tetlod('convert', path('all.pvtu'), '-o', path('out.vtu'))
    if b'60 ghost' not in done.stderr or b'welded' not in done.stderr:
        return done.stderr
    p, t, f, c = converted(path('all.pvtu'))
    if len(p) != len(points) or len(t) != len(tets):
        return '%d points, %d tetrahedra' % (len(p), len(t))
    order = {tuple(q): i for i, q in enumerate(points)}
    back = np.array([order[tuple(q)] for q in p])
    key = {tuple(sorted(tet)): i for i, tet in enumerate(tets)}
    where = np.array([key[tuple(sorted(tet))] for tet in back[t]])
    good = (all(np.array_equal(f[n], fields[n][back]) for n in fields)
            and all(np.array_equal(c[n], cells[n][where]) for n in cells))
    return None if good and len(set(where)) == len(tets) else 'values differ'


def blocks_case():
    """A multi-block file of two halves that share a face, one of polygons, and an empty one."""
    points, tets, fields, cells = tet_mesh()
    left = cells['region'] == 1
    blocks = vtk.vtkMultiBlockDataSet()
    for i, mask in enumerate((left, ~left)):
        used, local = np.unique(tets[mask], return_inverse=True)
        blocks.SetBlock(i, vtk_mesh(points[used], local.reshape(-1, 4), {n: v[used] for n, v in fields.items()},
                                    {n: v[mask] for n, v in cells.items()}))
        blocks.GetMetaData(i).Set(vtk.vtkCompositeDataSet.NAME(), 'half%d' % i)
    sphere = vtk.vtkSphereSource()
    sphere.Update()
    blocks.SetBlock(2, sphere.GetOutput())
    blocks.SetBlock(3, None)
    writer = vtk.vtkXMLMultiBlockDataWriter()
    writer.SetInputData(blocks)
    writer.SetFileName(path('blocks.vtm'))
    assert writer.Write()
    p, t, f, c = converted(path('blocks.vtm'))
    if len(p) != len(points) or abs(volumes(p, t).sum() - volumes(points, tets).sum()) > 1e-12:
        return '%d points' % len(p)
    p, t, f, c = converted(path('blocks.vtm'), '--block', 'half1')
    return None if (c['region'] == 2).all() and len(t) == (~left).sum() else 'not the second half'


def collection_case():
    mesh = tet_mesh(80)
    entries = []
    for step, time in enumerate((0, 0.5, 2)):
        mesh[2]['heat'] = mesh[2]['heat'] + 1
        save(vtk.vtkXMLUnstructuredGridWriter(), vtk_mesh(*mesh), 'step%d.vtu' % step)
        entries.append('<DataSet timestep="%g" part="0" file="step%d.vtu"/>' % (time, step))
    write('all.pvd',
          '<VTKFile type="Collection" version="0.1"><Collection>%s</Collection></VTKFile>' % ''.join(entries))
    last, first = converted(path('all.pvd')), converted(path('all.pvd'), '--time', '0')
    if not np.array_equal(last[2]['heat'], mesh[2]['heat']) or not np.allclose(first[2]['heat'], mesh[2]['heat'] - 2):
        return 'not the step that was asked for'
    return compare(mesh, converted(path('all.pvd'), '--time', '2'))


def part_of(mesh, mask, more=()):
    """Some of the tetrahedra, with further fields."""
    points, tets, fields, cells = mesh
    used, local = np.unique(tets[mask], return_inverse=True)
    return vtk_mesh(points[used], local.reshape(-1, 4), {n: v[used] for n, v in {**fields, **dict(more)}.items()},
                    {n: v[mask] for n, v in cells.items()})


def loads(*arguments):
    """A value that every tetrahedron has of its own, and what was said."""
    done = must('convert', *arguments, '-o', path('converted.vtu'))
    return sorted(read('converted.vtu')[3]['load']), done.stderr.decode()


def nested_case():
    """Blocks in blocks, pieces without names, an empty block; a collection that names that file: --block takes a block
    as a whole."""
    mesh = tet_mesh(200)
    load, x = mesh[3]['load'], mesh[0][mesh[1]].mean(axis=1)[:, 0]
    masks = [x < 0.25, (x >= 0.25) & (x < 0.5), (x >= 0.5) & (x < 0.75), x >= 0.75]
    inner, outer, pieces = vtk.vtkMultiBlockDataSet(), vtk.vtkMultiBlockDataSet(), vtk.vtkMultiPieceDataSet()
    pieces.SetNumberOfPieces(3)
    for i in range(2):
        inner.SetBlock(i, part_of(mesh, masks[i]))
        inner.GetMetaData(i).Set(vtk.vtkCompositeDataSet.NAME(), 'ab'[i])
        pieces.SetPiece(2 * i, part_of(mesh, masks[2 + i]))
    for i, (block, name) in enumerate(((inner, 'Fluid'), (pieces, 'Solid'), (vtk.vtkUnstructuredGrid(), 'Empty'))):
        outer.SetBlock(i, block)
        outer.GetMetaData(i).Set(vtk.vtkCompositeDataSet.NAME(), name)
    writer = vtk.vtkXMLMultiBlockDataWriter()
    writer.SetInputData(outer)
    writer.SetFileName(path('nested.vtm'))
    assert writer.Write()
    beside = (mesh[0] + 2, *mesh[1:])
    save(vtk.vtkXMLUnstructuredGridWriter(), part_of(beside, masks[0]), 'first.vtu')
    write(
        'nested.pvd', '<VTKFile type="Collection"><Collection><DataSet timestep="0" part="0" file="first.vtu"/>'
        '<DataSet timestep="1e-1" group="" part="0" file="nested.vtm"/><DataSet timestep="0.1" part="1" file="%s"/>'
        '</Collection></VTKFile>'
        % path('./first.vtu'))
    wanted = {(): masks, ('--block', 'Fluid'): masks[:2], ('--block', 'b'): masks[1:2],
              ('--block', 'Fluid/a'): masks[:1],
              ('--block', 'Solid'): masks[2:]}
    for name in 'nested.vtm', 'nested.pvd':
        for arguments, parts in wanted.items():
            more = [load[masks[0]]] if name == 'nested.pvd' and not arguments else []
            if loads(name, *arguments)[0] != sorted(np.concatenate([load[m] for m in parts] + more)):
                return '%s %s' % (name, arguments)
    if loads('nested.pvd', '--time', '0')[0] != sorted(load[masks[0]]) or loads('nested.pvd', '--block',
                                                                                '1')[0] != sorted(load[masks[0]]):
        return 'one part'
    refused = tetlod('convert', 'nested.vtm', '--block', 'Flu', '-o', 'out.vtu')
    return None if refused.returncode == 3 and b'Fluid/a Fluid/b Solid' in refused.stderr else refused


def partitions_case():
    mesh = tet_mesh(120)
    load, region = mesh[3]['load'], mesh[3]['region']
    collection = vtk.vtkPartitionedDataSetCollection()
    for i in range(2):
        collection.SetPartition(i, 0, part_of(mesh, region == i + 1))
    collection.GetMetaData(1).Set(vtk.vtkCompositeDataSet.NAME(), 'second')
    writer = vtk.vtkXMLPartitionedDataSetCollectionWriter()
    writer.SetInputData(collection)
    writer.SetFileName(path('parts.vtpc'))
    assert writer.Write()
    good = loads('parts.vtpc')[0] == sorted(load) and loads('parts.vtpc', '--block',
                                                            'second')[0] == sorted(load[region == 2])
    return None if good else 'values'


def different_arrays_case():
    """A field that only some pieces have, the first one or not, is left out and named; a piece may be empty."""
    mesh = tet_mesh(120)
    region = mesh[3]['region']
    for i in range(2):
        name = ('only_first', 'only_second')[i]
        save(vtk.vtkXMLUnstructuredGridWriter(), part_of(mesh, region == i + 1, {name: mesh[2]['heat']}),
             'piece%d.vtu' % i)
    save(vtk.vtkXMLUnstructuredGridWriter(), vtk.vtkUnstructuredGrid(), 'empty.vtu')
    write(
        'mixed.pvtu', '<VTKFile type="PUnstructuredGrid"><PUnstructuredGrid><PPoints>'
        '<PDataArray type="Float64" NumberOfComponents="3"/></PPoints><Piece Source="empty.vtu"/><Piece '
        'Source="piece0.vtu"/><Piece Source="piece1.vtu"/></PUnstructuredGrid></VTKFile>'
    )
    got, said = loads('mixed.pvtu')
    reader = vtk.vtkXMLPUnstructuredGridReader()
    reader.SetFileName(path('mixed.pvtu'))
    reader.Update()
    theirs, ours = reader.GetOutput().GetNumberOfCells(), len(got)
    good = got == sorted(mesh[3]['load']) and "'only_second', 'only_first'" in said and theirs == ours
    return (None if good and sorted(read('converted.vtu')[2]) == sorted(mesh[2]) else '%d of %d: %s' %
            (ours, theirs, said))


def different_structured_case():
    grid, *wanted = structured('structured', (9, 7, 6))
    writer = vtk.vtkXMLPStructuredGridWriter()
    for set_, value in ((writer.SetInputData, grid), (writer.SetFileName, path('whole.pvts')),
                        (writer.SetNumberOfPieces, 2), (writer.SetEndPiece, 1)):
        set_(value)
    assert writer.Write()
    reader = vtk.vtkXMLStructuredGridReader()
    reader.SetFileName(path('whole_1.vts'))
    reader.Update()
    piece = reader.GetOutput()
    add_arrays(piece.GetPointData(), {'late': np.arange(float(piece.GetNumberOfPoints()))})
    save(vtk.vtkXMLStructuredGridWriter(), piece, 'whole_1.vts')
    said = must('convert', 'whole.pvts', '-o', 'out.vtu').stderr.decode()
    return compare_split(*wanted, converted(path('whole.pvts'))) or (None if "left out: 'late'" in said else said)


def other_cells(polyhedra):
    """A column of a hexahedron, a wedge beside it, a pyramid on it and a tetrahedron on that; as polyhedra or
    themselves."""
    points = np.array([(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1),
                       (2, 0, 0),
                       (2, 0, 1), (.5, .5, 2), (1.5, .5, 2)], float)
    kinds = [(vtk.VTK_HEXAHEDRON, [0, 1, 2, 3, 4, 5, 6, 7]), (vtk.VTK_WEDGE, [1, 2, 8, 5, 6, 9]),
             (vtk.VTK_PYRAMID, [4, 5, 6, 7, 10]), (vtk.VTK_TETRA, [5, 11, 6, 10])]
    faces = {vtk.VTK_HEXAHEDRON: [[0, 3, 2, 1], [4, 5, 6, 7], [0, 1, 5, 4], [1, 2, 6, 5], [2, 3, 7, 6], [3, 0, 4, 7]],
             vtk.VTK_WEDGE: [[0, 1, 2], [3, 5, 4], [0, 3, 4, 1], [1, 4, 5, 2], [2, 5, 3, 0]],
             vtk.VTK_PYRAMID: [[0, 3, 2, 1], [0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4]],
             vtk.VTK_TETRA: [[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]]}
    grid, at = vtk.vtkUnstructuredGrid(), vtk.vtkPoints()
    at.SetData(numpy_to_vtk(points, deep=True))
    grid.SetPoints(at)
    for n, (kind, corners) in enumerate(kinds):
        if n in polyhedra:
            stream = vtk.vtkIdList()
            for number in [len(faces[kind])] + [x for face in faces[kind] for x in [len(face)] +
                                                [corners[i] for i in face]]:
                stream.InsertNextId(number)
            grid.InsertNextCell(vtk.VTK_POLYHEDRON, stream)
        else:
            grid.InsertNextCell(kind, len(corners), corners)
    fields = {'heat': points @ [1, 2, 3.0]}
    add_arrays(grid.GetPointData(), fields)
    add_arrays(grid.GetCellData(), {'id': np.arange(4, dtype=np.int64)})
    return grid, points, fields


def other_cells_case(polyhedra, mode):
    grid, points, fields = other_cells(polyhedra)
    p, t, f, c = converted(save(vtk.vtkXMLUnstructuredGridWriter(), grid, 'in.vtu', mode))
    v = volumes(p, t)
    wanted = [1, 0.5, 1 / 3, 1 / 6]
    if not np.allclose(np.bincount(c['id'].astype(int), v), wanted) or (v <= 0).any():
        return 'volumes %s' % np.bincount(c['id'].astype(int), v)
    if len(p) != len(points) + len(polyhedra) or not np.allclose(f['heat'], p @ [1, 2, 3.0]):
        return 'centres'
    faces = np.sort(t[:, [[1, 2, 3], [0, 2, 3], [0, 1, 3], [0, 1, 2]]].reshape(-1, 3), axis=1)
    uses = np.unique(faces, axis=0, return_counts=True)[1]
    return (None if
            (uses == 1).sum() == 2 * 4 + 2 * 2 + 2 + 3 + 3 and uses.max() == 2 else 'faces do not match: %s' % uses)


def quadratic_grid():
    """A hexahedron, a wedge, a pyramid and two tetrahedra of the second order that share faces."""
    grid, points, _ = other_cells(())
    points, middles = list(map(tuple, points)), {}
    edges = {vtk.VTK_HEXAHEDRON: [(0, 1), (1, 2), (2, 3), (3, 0), (4, 5), (5, 6), (6, 7), (7, 4), (0, 4), (1, 5),
                                  (2, 6), (3, 7)],
             vtk.VTK_WEDGE: [(0, 1), (1, 2), (2, 0), (3, 4), (4, 5), (5, 3), (0, 3), (1, 4), (2, 5)],
             vtk.VTK_PYRAMID: [(0, 1), (1, 2), (2, 3), (3, 0), (0, 4), (1, 4), (2, 4), (3, 4)],
             vtk.VTK_TETRA: [(0, 1), (1, 2), (0, 2), (0, 3), (1, 3), (2, 3)]}
    kind = {vtk.VTK_HEXAHEDRON: vtk.VTK_QUADRATIC_HEXAHEDRON, vtk.VTK_WEDGE: vtk.VTK_QUADRATIC_WEDGE,
            vtk.VTK_PYRAMID: vtk.VTK_QUADRATIC_PYRAMID, vtk.VTK_TETRA: vtk.VTK_QUADRATIC_TETRA}
    out, at = vtk.vtkUnstructuredGrid(), vtk.vtkPoints()
    for n in range(4):
        cell = grid.GetCell(n)
        corners = [cell.GetPointId(i) for i in range(cell.GetNumberOfPoints())]
        for a, b in edges[cell.GetCellType()]:
            key = tuple(sorted((corners[a], corners[b])))
            if key not in middles:
                middles[key] = len(points)
                points.append(tuple((np.array(points[key[0]]) + points[key[1]]) / 2))
            corners.append(middles[key])
        out.InsertNextCell(kind[cell.GetCellType()], len(corners), corners)
    for p in points:
        at.InsertNextPoint(*p)
    out.SetPoints(at)
    points = np.array(points)
    add_arrays(out.GetPointData(), {'heat': points @ [1, 2, 3.0]})
    add_arrays(out.GetCellData(), {'id': np.arange(4, dtype=np.int64)})
    return out, points


def subdivide_case():
    grid, points = quadratic_grid()
    name = save(vtk.vtkXMLUnstructuredGridWriter(), grid, 'in.vtu')
    p, t, f, c = converted(name, '--subdivide')
    v = volumes(p, t)
    if len(p) != len(points) + 3 or (v <= 0).any() or not np.allclose(np.bincount(c['id'].astype(int), v),
                                                                      [1, 0.5, 1 / 3, 1 / 6]):
        return '%d points, volumes %s' % (len(p), np.bincount(c['id'].astype(int), v))
    faces = np.sort(t[:, [[1, 2, 3], [0, 2, 3], [0, 1, 3], [0, 1, 2]]].reshape(-1, 3), axis=1)
    uses = np.unique(faces, axis=0, return_counts=True)[1]
    if uses.max() > 2 or (uses == 1).sum() != 4 * 6 + 2 * 6 + 2 * 4 + 3 * 4 + 3 * 4:
        return '%d boundary faces' % (uses == 1).sum()
    p, t, f, c = converted(name)
    return (None if len(p) == 12 and len(t) == 6 + 3 + 2 + 1 else 'corners only: %d points, %d tetrahedra' %
            (len(p), len(t)))


def average_case():
    """Cell data becomes point data by volume, and drives at once where there is nothing else."""
    points, tets, _, cells = tet_mesh()
    name = save(vtk.vtkXMLUnstructuredGridWriter(), vtk_mesh(points, tets, {}, {'load': cells['load']}), 'in.vtu')
    done = tetlod('build', name, '-o', path('out.tetlod'))
    if done.returncode or b'mean over its tetrahedra' not in done.stderr:
        return done
    v = volumes(points, tets)
    mean = np.bincount(tets.ravel(), np.repeat(v * cells['load'], 4)) / np.bincount(tets.ravel(), np.repeat(v, 4))
    p, t, f, c = converted(name)
    if not np.allclose(f['load'], mean) or not np.array_equal(c['load'], cells['load']):
        return 'values'
    name = save(vtk.vtkXMLUnstructuredGridWriter(), vtk_mesh(*tet_mesh()), 'in.vtu')
    if sorted(converted(name, '--cell-data', 'average')[2]) != ['heat', 'load', 'mass', 'wind']:
        return 'average'
    return 'drop' if converted(name, '--cell-data', 'drop')[3] else None


def clean_case():
    """A degenerate tetrahedron, a duplicate, a point twice."""
    points = np.array([(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1), (0, 0, 0), (1, 1, 0), (1, 1, 1)], float)
    tets = np.array([(0, 1, 2, 3), (4, 1, 2, 3), (0, 1, 2, 5), (1, 5, 2, 6), (2, 3, 1, 0)])
    name = save(vtk.vtkXMLUnstructuredGridWriter(),
                vtk_mesh(points, tets, {'heat': points @ [1, 2, 3.0]}, {'id': np.arange(5)}), 'in.vtu')
    kept, welded, near = converted(name), converted(name, '--weld', '0',
                                                    '--drop-degenerate'), converted(name, '--weld', '0.01')
    if len(kept[0]) != 7 or len(kept[1]) != 5:
        return 'without options all is kept'
    if len(near[0]) != 6 or len(welded[0]) != 6 or list(welded[3]['id']) != [0, 3]:
        return 'welded: %d points, cells %s' % (len(welded[0]), welded[3])
    points[4] += 1e-3
    name = save(vtk.vtkXMLUnstructuredGridWriter(),
                vtk_mesh(points, tets, {'heat': points[:, 1] * 0}, {'id': np.arange(5)}), 'in.vtu')
    return None if [len(converted(name, '--weld', w)[0]) for w in ('0.0001', '0.1')] == [7, 6] else 'tolerance'


def processor_seconds(*arguments):
    before = os.times()
    done = tetlod(*arguments)
    after = os.times()
    return done, after.children_user - before.children_user


def crowded_case():
    """Points at a few places, whose values differ, or that have no place (NaN): welding takes little beside reading."""
    count = 300000
    tets = np.arange(count).reshape(-1, 4)
    points = np.array([(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1.0)])[np.arange(count) % 4]
    lost = points[:100000].copy()
    lost[4:] = np.nan
    for name, places, values, fails_with in (('crowded', points, np.arange(count) / 2, b''),
                                             ('lost', lost, np.zeros(len(lost)), b'not a finite number')):
        mesh = vtk_mesh(places, tets[:len(places) // 4], {'heat': values}, {})
        save(vtk.vtkXMLUnstructuredGridWriter(), mesh, name + '.vtu', compressor='none')
        _, plain = processor_seconds('convert', name + '.vtu', '-o', 'out.vtu')
        for tolerance in '0', '0.01':
            done, seconds = processor_seconds('convert', name + '.vtu', '-o', 'out.vtu', '--weld', tolerance)
            if fails_with not in done.stderr or (done.returncode != 0) != bool(fails_with) or seconds > 2 + 10 * plain:
                return name, tolerance, plain, seconds, done
    return None


def equal_values_case():
    """What is welded: equal places and equal values, where -0 is 0."""
    random = np.random.default_rng(7)
    corner, heat = np.array([(0, 0, 0), (9, 0, 0), (0, 9, 0),
                             (0, 0, 9)])[np.arange(4000) % 4], random.integers(-1, 2, 4000) * 0.5
    points, heat[heat == 0] = (corner + random.integers(-1, 2, (4000, 3))) * -1.0, -0.0
    heat[::3] += 0.0
    name = save(vtk.vtkXMLUnstructuredGridWriter(),
                vtk_mesh(points, np.arange(4000).reshape(-1, 4), {'heat': heat}, {}), 'in.vtu')
    wanted = len(np.unique(np.column_stack([points, heat]) + 0.0, axis=0))
    found = [len(converted(name, '--weld', tolerance)[0]) for tolerance in ('0', '0.001')]
    return None if found == [wanted, wanted] else (found, wanted)


def outside_case():
    os.makedirs(path('inner'), exist_ok=True)
    mesh = tet_mesh(60)
    save(vtk.vtkXMLUnstructuredGridWriter(), vtk_mesh(*mesh), 'outside.vtu')
    head = '<VTKFile type="PUnstructuredGrid"><PUnstructuredGrid><Piece Source="%s"/></PUnstructuredGrid></VTKFile>'
    for name in ('../outside.vtu', path('outside.vtu')):
        write('inner/names.pvtu', head % name)
        fails('a file outside is not read: ' + name[:3], 3, ['names.pvtu', 'outside.vtu', '--follow'], 'convert',
              path('inner/names.pvtu'), '-o', path('out.vtu'))
        case('but with --follow', lambda: compare(mesh, converted(path('inner/names.pvtu'), '--follow')))
    write('loop.pvtu', head % 'loop.pvtu')
    fails('a file that names itself', 3, ['loop.pvtu'], 'convert', path('loop.pvtu'), '-o', path('out.vtu'))
    write('gone.pvtu', head % 'gone.vtu')
    fails('a piece that is missing', 1, ['gone.pvtu', 'gone.vtu'], 'convert', path('gone.pvtu'), '-o', path('out.vtu'))


def main():
    for precision in np.float32, np.float64:
        mesh = tet_mesh(precision=precision)
        for mode in 'ascii', 'inline', 'base64', 'appended':
            for compressor in ('none',) if mode == 'ascii' else ('none', 'zlib', 'lz4', 'lzma'):
                for header, order in ((32, 'little'), (64, 'big')):
                    case('vtu %s %s %s %d %s' % (np.dtype(precision), mode, compressor, header, order), tets_case,
                         mesh, mode,
                         compressor, header, order)
    for kind in WRITERS:
        for mode, compressor in (('ascii', 'none'), ('inline', 'zlib'), ('appended', 'lzma'), ('base64', 'none')):
            case('%s %s %s' % (kind, mode, compressor), structured_case, kind, mode, compressor)
        for ghosts in 0, 1:
            case('%s in four pieces, %d ghosts' % (kind, ghosts), parallel_case, kind, ghosts)
    case('pvtu: pieces are welded, ghosts dropped', pvtu_case)
    case('vtm: blocks are merged, one is chosen', blocks_case)
    case('pvd: a step in time is chosen', collection_case)
    case('blocks in blocks, pieces, in a collection', nested_case)
    case('partitions', partitions_case)
    case('pieces of different fields', different_arrays_case)
    case('structured pieces of different fields', different_structured_case)
    for polyhedra in (), (0,), (0, 2), (0, 1, 2, 3):
        for mode in 'ascii', 'appended':
            case('cells of all kinds, %d polyhedra, %s' % (len(polyhedra), mode), other_cells_case, polyhedra, mode)
    case('cells of the second order are subdivided', subdivide_case)
    case('cell data is averaged', average_case)
    case('welding and dropping', clean_case)
    case('welding crowds', crowded_case)
    case('welding equal values', equal_values_case)
    outside_case()
    finish()


if __name__ == '__main__':
    main()
