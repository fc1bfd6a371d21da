#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""Meshes in pieces that know the numbers of the whole one: what is read does not tell into which pieces it was cut."""
import os
import re

import numpy as np
import vtk

from common import CONFIG, case, finish, must, path, report, tetlod, write
import mpi_job
from kuhn_grid import kuhn
from meshes import add_arrays, converted, tet_mesh, vtk_mesh

PIECES = 3


def cut(points, tets):
    """Pieces in slices; each has its tetrahedra in another order."""
    part = np.minimum((points[tets].mean(axis=1)[:, 1] * PIECES).astype(int), PIECES - 1)
    return [np.flatnonzero(part == p)[::-1 if p % 2 else 1] for p in range(PIECES)]


# ---- VTK

def save_vtu(name, points, tets, fields, cells):
    grid = vtk_mesh(points, tets, fields, cells)
    writer = vtk.vtkXMLUnstructuredGridWriter()
    writer.SetInputData(grid)
    writer.SetFileName(path(name))
    assert writer.Write()


def save_pvtu(points, tets, fields, cells, pieces, ghosts=()):
    for p, mine in enumerate(pieces):
        others = ghosts[p] if len(ghosts) else []
        take = np.concatenate([mine, others]).astype(int)
        used, local = np.unique(tets[take], return_inverse=True)
        marks = np.array([0] * len(mine) + [1] * len(others), np.uint8)
        own = {n: v[p] if isinstance(v, list) else v for n, v in fields.items()}
        save_vtu('piece_%d.vtu' % p, points[used], local.reshape(-1, 4), {n: v[used] for n, v in own.items()},
                 {**{n: v[take] for n, v in cells.items()}, 'vtkGhostType': marks})
    write('all.pvtu', '<VTKFile type="PUnstructuredGrid"><PUnstructuredGrid>%s</PUnstructuredGrid></VTKFile>' % ''.join(
        '<Piece Source="piece_%d.vtu"/>' % p for p in range(len(pieces))))


def numbered_mesh():
    points, tets, fields, cells = tet_mesh(500)
    used, tets = np.unique(tets, return_inverse=True)
    points, tets = points[used], tets.reshape(-1, 4)
    fields = {n: v[used] for n, v in fields.items()}
    fields['GlobalPointIds'] = np.arange(len(points), dtype=np.int64) * 3 + 7
    cells = {**cells, 'GlobalCellIds': np.arange(len(tets), dtype=np.int64)}
    return points, tets, fields, cells


def as_vtu(name, *options):
    done = must('convert', path(name), '-o', path(name + '.out.vtu'), *options)
    with open(path(name + '.out.vtu'), 'rb') as file:
        return file.read(), done.stderr.decode()


def vtk_case():
    points, tets, fields, cells = mesh = numbered_mesh()
    pieces = cut(points, tets)
    save_vtu('whole.vtu', *mesh)
    save_pvtu(*mesh, pieces, [pieces[(p + 1) % PIECES][:20] for p in range(PIECES)])
    whole, (parts, said) = as_vtu('whole.vtu')[0], as_vtu('all.pvtu')
    return None if parts == whole and '%d ghost' % (20 * PIECES) in said else said


def ranks_case(name, field):
    """Ranks that read some pieces each build what one program does."""
    differs = mpi_job.same((2,), [path(name)], '--field', field, '--paged=300')
    done = mpi_job.mpi(2, 'build', path(name), '-o', 'many.tetlod', '--field', field, '--quiet', '--model', '2')
    return differs or (None if re.search(r'\n1 +%d ' % PIECES, done.stdout.decode()) else done)  # the first stage


def empty_piece_case():
    """A piece that has neither points nor cells comes from another rank like any other."""
    with open(path('all.pvtu')) as file:
        write('holes.pvtu', file.read().replace('<Piece', '<Piece Source="empty.vtu"/><Piece', 1))
    write('empty.vtu', '<VTKFile type="UnstructuredGrid"><UnstructuredGrid><Piece NumberOfPoints="0" NumberOfCells="0">'
                       '</Piece></UnstructuredGrid></VTKFile>')
    return mpi_job.same((2,), [path('holes.pvtu')], '--field', 'heat', '--paged=300')


def ranks_fail():
    """The rank that reads the piece says that it is not there."""
    done = mpi_job.mpi(2, 'build', path('in.e.3.0'), '-o', path('no.tetlod'))
    said = mpi_job.own_lines(done)
    return None if done.returncode and len(said) == 1 and 'piece 2 of 3' in said[0] else done


def stream_case():
    """The tetrahedra of all levels are those of the whole file's stream."""
    for name in 'whole.vtu', 'all.pvtu':
        must('build', path(name), '-o', path(name + '.tetlod'), '--field', 'heat')
        must('extract', path(name + '.tetlod'), '--error', '0.05', '-o', path(name + '.coarse.vtu'))
        must('extract', path(name + '.tetlod'), '--error', '0', '-o', path(name + '.finest.vtu'))
    for level in 'coarse', 'finest':
        a, b = (converted(path('%s.%s.vtu' % (name, level))) for name in ('whole.vtu', 'all.pvtu'))
        if not all(np.array_equal(x, y) for x, y in zip((*a[:2], a[2]['heat']), (*b[:2], b[2]['heat']))):
            return level
    return None


def crack_case():
    """Points at one place with two numbers stay two."""
    points, tets, fields, cells = numbered_mesh()
    pieces = cut(points, tets)
    twice = np.intersect1d(tets[pieces[0]], np.concatenate([tets[p].ravel() for p in pieces[1:]]))[:3]
    copies = {v: len(points) + i for i, v in enumerate(twice)}
    points = np.concatenate([points, points[twice]])
    fields = {n: np.concatenate([v, v[twice]]) for n, v in fields.items()}
    fields['GlobalPointIds'] = np.arange(len(points), dtype=np.int64)
    tets = tets.copy()
    tets[pieces[0]] = np.vectorize(lambda v: copies.get(v, v))(tets[pieces[0]])
    save_vtu('whole.vtu', points, tets, fields, cells)
    save_pvtu(points, tets, fields, cells, pieces)
    return None if as_vtu('all.pvtu')[0] == as_vtu('whole.vtu')[0] else 'the crack is closed, or numbers are others'


def unnumbered_crack_case():
    """Pieces that a crack goes through, with the same values on both sides, and no numbers: they are joined where they
    were cut, and the crack stays open."""
    points, tets = kuhn(4, np.random.default_rng(8))
    x, y = np.divmod(np.arange(len(points)) // 5, 5)
    layer = (tets % 5).min(axis=1)
    right = (x[tets] >= 2).all(axis=1)
    both = np.flatnonzero((x == 2) & (y < 2))
    copies = {v: len(points) + i for i, v in enumerate(both)}
    points = np.concatenate([points, points[both]])
    tets[right] = np.vectorize(lambda v: copies.get(v, v))(tets[right])
    part = np.minimum(layer, PIECES - 1)
    pieces = [np.flatnonzero(part == p) for p in range(PIECES)]
    save_pvtu(points, tets, {'heat': points.sum(axis=1)}, {}, pieces)
    found, owners = converted(path('all.pvtu')), {}
    if len(found[0]) != len(points) or len(found[1]) != len(tets):
        return len(found[0]), len(points)
    for corners in np.sort(found[1], axis=1):
        for i in range(4):
            face = tuple(np.delete(corners, i))
            owners[face] = owners.get(face, 0) + 1
    open_faces = sum(count == 1 for count in owners.values())
    return None if open_faces == 6 * 4 * 4 * 2 + 2 * 2 * 4 * 2 else open_faces


def own_numbers_case():
    """Pieces that each count from 0: they are joined by places, without these numbers, and that is said."""
    points, tets, fields, cells = numbered_mesh()
    del fields['GlobalPointIds'], cells['GlobalCellIds']
    pieces = cut(points, tets)
    save_pvtu(points, tets, fields, cells, pieces)
    wanted = as_vtu('all.pvtu')[0]
    for p, take in enumerate(pieces):
        used, local = np.unique(tets[take], return_inverse=True)
        save_vtu('piece_%d.vtu' % p, points[used], local.reshape(-1, 4),
                 {**{n: v[used] for n, v in fields.items()}, 'GlobalPointIds': np.arange(len(used), dtype=np.int64)},
                 {n: v[take] for n, v in cells.items()})
    found, said = as_vtu('all.pvtu')
    return None if found == wanted and 'by itself' in said and 'GlobalPointIds' in said else said


def unmarked_case(numbers):
    """Copies of a neighbour's cells that are not marked: refused by one program and by ranks, with how many there are,
    whether the points are joined by numbers or by places. Cells with a face in another piece are none."""
    points, tets, fields, cells = numbered_mesh()
    if not numbers:
        del fields['GlobalPointIds'], cells['GlobalCellIds']
    pieces = cut(points, tets)
    save_pvtu(points, tets, fields, cells, [np.concatenate([p, pieces[(i + 1) % PIECES][:7]])
                                            for i, p in enumerate(pieces)])
    programs = [tetlod('build', path('all.pvtu'), '-o', path('no.tetlod'))]
    if not NO_RANKS:
        programs.append(mpi_job.mpi(2, 'build', path('all.pvtu'), '-o', path('no.tetlod')))
    wanted = '%d cells are in several pieces' % (7 * PIECES)
    good = [done.returncode and wanted in done.stderr.decode() for done in programs]
    if not all(good) or os.path.exists(path('no.tetlod')):
        return programs
    wanted = len(tets), '%d degenerate or duplicate tetrahedra dropped' % (7 * PIECES)
    must('convert', path('all.pvtu'), '-o', path('once.vtu'), '--drop-degenerate')
    found = len(converted(path('once.vtu'))[1]), as_vtu('all.pvtu', '--drop-degenerate')[1]
    return None if found[0] == wanted[0] and wanted[1] in found[1] else found


def other_values_case():
    """Points of one number with other values in another piece: the first piece's are kept, and they are counted."""
    points, tets, fields, cells = numbered_mesh()
    pieces = cut(points, tets)
    heat = fields['heat']
    save_pvtu(points, tets, {**fields, 'heat': [heat + p / 8 for p in range(PIECES)]}, cells, pieces)
    found, said = converted(path('all.pvtu')), as_vtu('all.pvtu')[1]
    first = np.full(len(points), PIECES)
    for p in reversed(range(PIECES)):
        first[np.unique(tets[pieces[p]])] = p
    good = np.array_equal(found[0], points) and np.array_equal(found[2]['heat'], heat + first / 8)
    return None if good and 'have other values' in said else said


def apart_case():
    """Without numbers, points with other values in another piece stay apart, and are counted; those with the same are
    joined."""
    points, tets, fields, cells = numbered_mesh()
    pieces = cut(points, tets)
    users = [np.unique(tets[p]) for p in pieces]
    heat, more = fields['heat'], np.bincount(np.concatenate(users), minlength=len(points)) - 1
    warm = points[:, 0] < 0.5
    save_pvtu(points, tets, {'heat': [heat + warm * p / 8 for p in range(PIECES)]}, {}, pieces)
    found, said = converted(path('all.pvtu')), as_vtu('all.pvtu')[1]
    apart = more[warm].sum()
    good = apart and len(found[0]) == len(points) + apart and '%d points of pieces have other values' % apart in said
    return None if good and more[~warm].sum() else (apart, len(found[0]) - len(points), said)


def damaged_piece_case():
    """A piece whose cells name points of the next one, or that is not there, is named, once."""
    points, tets, fields, cells = numbered_mesh()
    save_pvtu(points, tets, fields, cells, cut(points, tets))
    save_vtu('piece_1.vtu', points[:99], tets[:9] % 9 + 97, {n: v[:99] for n, v in fields.items()},
             {n: v[:9] for n, v in cells.items()})
    for word in b'only 99 points', b'cannot open':
        done = tetlod('convert', path('all.pvtu'), '-o', path('out.vtu'))
        if not done.returncode or done.stderr.count(b'piece_1.vtu: ') != 1 or word not in done.stderr:
            return done
        if os.path.exists(path('piece_1.vtu')):
            os.remove(path('piece_1.vtu'))
    return None


# ---- Exodus

def write_exodus(name, points, blocks, heat, flux, maps=None):
    """Element blocks of tetrahedra; a variable of nodes, and one of the elements of the second block alone. Blocks may
    be empty."""
    exodus_file.write(path(name), points, [('TETRA', rows) for rows in blocks], [0.5], {'heat': heat[None]},
                      {'flux': [None, flux[None]]}, maps=[numbers + 1 for numbers in maps or ()])


def exodus_case(maps):
    """Two element blocks; one of the pieces has nothing of the second."""
    points, tets, fields, _ = tet_mesh(500)
    used, tets = np.unique(tets, return_inverse=True)
    points, tets, heat = points[used], tets.reshape(-1, 4), fields['heat'][used]
    middles = points[tets].mean(axis=1)
    blocks = [tets[middles[:, 1] < 0.5], tets[middles[:, 1] >= 0.5]]
    flux = np.arange(len(blocks[1])) / 4
    write_exodus('whole.exo', points, blocks, heat, flux)
    for p in range(PIECES):
        part = [(points[b].mean(axis=1)[:, 1] * PIECES).astype(int).clip(0, PIECES - 1) for b in blocks]
        take = [np.flatnonzero(of == p) for of in part]
        mine = [b[t] for b, t in zip(blocks, take)]
        nodes = np.unique(np.concatenate(mine))
        numbers = (nodes, np.concatenate([take[0], take[1] + len(blocks[0])])) if maps else None
        write_exodus('in.e.3.%d' % p, points[nodes], [np.searchsorted(nodes, m) for m in mine], heat[nodes],
                     flux[take[1]], numbers)
    if maps:
        return None if as_vtu('in.e.3.1')[0] == as_vtu('whole.exo')[0] else 'the pieces are another mesh'
    found, wanted = converted(path('in.e.3.0')), converted(path('whole.exo'))
    same = len(found[0]) == len(wanted[0]) and len(found[1]) == len(wanted[1])
    return None if same and np.array_equal(np.sort(found[2]['heat']), np.sort(wanted[2]['heat'])) else 'another mesh'


def missing_piece_case():
    os.remove(path('in.e.3.2'))
    done = tetlod('convert', path('in.e.3.0'), '-o', path('out.vtu'))
    return None if done.returncode and b'piece 2 of 3' in done.stderr and done.stderr.count(b'\n') == 1 else done


NO_RANKS = mpi_job.missing()
case('VTK: numbers of points and cells, with ghosts', vtk_case)
if CONFIG == 'release':
    case('VTK: the same levels', stream_case)
if not NO_RANKS:
    case('VTK: pieces and their ghosts, by ranks', ranks_case, 'all.pvtu', 'heat')
    case('VTK: a piece without points, by ranks', empty_piece_case)
case('VTK: a crack is not glued', crack_case)
case('VTK: a crack through pieces without numbers', unnumbered_crack_case)
case('VTK: numbers that are no numbers of the whole', own_numbers_case)
case('VTK: other values', other_values_case)
case('VTK: other values, without numbers', apart_case)
case('VTK: copies that are not marked', unmarked_case, True)
case('VTK: copies that are not marked, without numbers', unmarked_case, False)
case('VTK: a piece of wrong corners, and one that is not there', damaged_piece_case)
try:
    import exodus_file
except ImportError as missing:
    report('netCDF', True, skip='not installed: %s' % missing)
    finish()
case('Exodus: pieces with maps', exodus_case, True)
case('Exodus: pieces without maps', exodus_case, False)
if not NO_RANKS:
    case('Exodus: pieces, by ranks', ranks_case, 'in.e.3.0', 'heat')
case('Exodus: a piece that is not there', missing_piece_case)
if not NO_RANKS:
    case('Exodus: a piece that no rank finds', ranks_fail)
finish()
