#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""build --paged: contraction by cells, and levels in pages (format/SPEC.md, 7.6)."""
import itertools
import os
import random
import sys

from common import SANITIZED, case, fails, finish, info, must, path, report

sys.path.insert(0, os.path.join(os.environ['ROOT'], 'client-examples', 'python'))
try:
    import numpy
    from tetlod import reference, reference_pages
except ImportError:
    numpy = None


def read(name):
    with open(path(name), 'rb') as file:
        return file.read()


def build(mesh, name, *options):
    must('build', mesh, '-o', name, *options)
    return info(name)


def differs_in_files(mesh, name, *options):
    """Less memory than one piece takes (src/pipeline/build_memory.c), so that cells wait in a file: not the stream that
    `name` is?"""
    cell = int(next(option for option in options if '--paged=' in option).split('=')[1])
    memory = str((14 << 20) + 1300 * cell)
    must('build', mesh, '-o', 'files.tetlod', *options, '--threads', '2', '--memory', memory)
    return read(name) != read('files.tetlod')


def holds(sample, *options):
    """All that verify checks, with the original; more than one group; the same bytes on any number of threads, and
    where memory is short."""
    must('sample', *sample, '-o', 'mesh.vtu')
    streams = []
    for threads in ('2',) if SANITIZED else ('1', '2', '3'):
        stream = build('mesh.vtu', 'mesh.tetlod', *options, '--threads', threads)
        streams.append(read('mesh.tetlod'))
    if len(set(streams)) != 1:
        return 'other bytes on other threads'
    if differs_in_files('mesh.vtu', 'mesh.tetlod', *options):
        return 'other bytes where memory is short'
    said = must('verify', 'mesh.tetlod', '--against', 'mesh.vtu').stdout.decode()
    if 'max held against the exact maximum at all of them' not in said:
        return said
    head = streams[0][:16]
    return None if stream['pages'] > 20 and head[12] == 1 and head[10] == 1 else (stream['pages'], head)


def tets_at(stream, error):
    name = next(field['name'] for field in stream['fields'] if field['controlled'])
    return next(level['tets'] for level in stream['levels'] if level['errors'][name]['max'] <= error)


def costs_little():
    """Against one cell: at errors that end a group, and in the root."""
    must('sample', 'fin', '--size', '16' if SANITIZED else '32', '-o', 'fin.vtu')
    paged = build('fin.vtu', 'paged.tetlod', '--paged=1000' if SANITIZED else '--paged=8000')
    if SANITIZED:
        return None
    whole = build('fin.vtu', 'whole.tetlod')
    more = {error: tets_at(paged, error) / tets_at(whole, error) for error in (0.001, 0.002, 0.005, 0.01, 0.05)}
    size = paged['bytes'] / whole['bytes']
    return None if max(more.values()) < 1.12 and size < 1.12 else (more, size)


def parts_are_streams():
    """A level in pages, and one before them, extracted with all that is coarser: a stream that stands for itself."""
    stream = info('paged.tetlod')
    first = stream['first_paged_level']
    for level in (first - 1, first, first + 1, len(stream['levels']) - 2):
        must('extract', 'paged.tetlod', '--level', str(level), '-o', 'part.tetlod')
        must('verify', 'part.tetlod')
        part = info('part.tetlod')
        paged = 'pages' in part, read('part.tetlod')[12] == 1
        if part['tets'] != stream['levels'][level]['tets'] or paged != (level >= first, level >= first):
            return level, part.get('pages')
    return None


def small_meshes_stay():
    must('sample', 'fin', '--size', '8', '-o', 'small.vtu')
    build('small.vtu', 'one.tetlod')
    build('small.vtu', 'other.tetlod', '--paged')
    return None if read('one.tetlod')[64:] == read('other.tetlod')[64:] else 'other bytes'


def no_cells_are_needed():
    """Where the contraction stops early, what is left is no larger than the root may be: there are no pages."""
    must('sample', 'cube', '--size', '7', '-o', 'few.vtu')
    stream = build('few.vtu', 'few.tetlod', '--paged=100', '--min-tets', '1000')
    must('verify', 'few.tetlod', '--against', 'few.vtu')
    whole = build('few.vtu', 'few.tetlod', '--min-tets', '1000')
    return None if 'pages' not in stream and stream['levels'] == whole['levels'] else stream['levels']


def original_comes_back():
    must('sample', 'torus', '--size', '6', '-o', 'ring.vtu')
    build('ring.vtu', 'ring.tetlod', '--paged=300', '--keep-order')
    must('extract', 'ring.tetlod', '--original-order', '-o', 'back.vtu')
    must('extract', 'ring.tetlod', '-o', 'level.vtu')
    build('ring.vtu', 'plain.tetlod', '--keep-order')
    must('extract', 'plain.tetlod', '--original-order', '-o', 'plain.vtu')
    return None if read('back.vtu') == read('plain.vtu') else 'another mesh'


def parts_of_cells():
    """Regions, values of cells and exact sums; each value comes back with its tetrahedron, at any level. Ids of
    points do not make all levels measured."""
    size, lines = 7, []
    points = list(itertools.product(range(size + 1), repeat=3))
    number = {point: i for i, point in enumerate(points)}
    tets, material, load = [], [], []
    for x, y, z in itertools.product(range(size), repeat=3):
        for axes in itertools.permutations(range(3)):
            corner, corners = [x, y, z], [number[x, y, z]]
            for axis in axes:
                corner[axis] += 1
                corners.append(number[tuple(corner)])
            tets.append(corners)
            material.append(2 if x < 3 else 5)
            load.append(len(load) * 0.5)
    lines += ['# vtk DataFile Version 3.0', 'parts', 'ASCII', 'DATASET UNSTRUCTURED_GRID']
    lines += ['POINTS %d float' % len(points)]
    lines += ['%d %d %d' % point for point in points] + ['CELLS %d %d' % (len(tets), 5 * len(tets))]
    lines += ['4 %d %d %d %d' % tuple(corners) for corners in tets] + ['CELL_TYPES %d' % len(tets)] + ['10'] * len(tets)
    lines += ['CELL_DATA %d' % len(tets), 'SCALARS material int 1', 'LOOKUP_TABLE default', *map(str, material)]
    lines += ['SCALARS load float 1', 'LOOKUP_TABLE default', *map(str, load), 'POINT_DATA %d' % len(points)]
    lines += ['SCALARS heat float 1', 'LOOKUP_TABLE default', *(str(x * y + z) for x, y, z in points)]
    lines += ['SCALARS GlobalPointIds int 1', 'LOOKUP_TABLE default', *map(str, range(len(points)))]
    with open(path('parts.vtk'), 'w') as file:
        file.write('\n'.join(lines) + '\n')
    options = '--paged=300', '--region', 'material', '--summary', '--keep-order'
    stream = build('parts.vtk', 'parts.tetlod', *options)
    if differs_in_files('parts.vtk', 'parts.tetlod', *options):
        return 'other bytes where memory is short'
    said = must('verify', 'parts.tetlod', '--against', 'parts.vtk').stdout.decode()
    must('ask', 'parts.tetlod', 'mean(heat)')
    wrong = measured_where_users_look(stream)
    if wrong:
        return wrong
    if not numpy:
        return None if stream['pages'] > 4 and 'ok' in said else said
    whole = reference.open(path('parts.tetlod'))
    cursor = whole.cursor().seek(len(whole.levels) - 1)
    middles = cursor.positions[cursor.tets].mean(axis=1)
    agree = numpy.array_equal(numpy.asarray(whole.cells('material')), numpy.where(middles[:, 0] < 3, 2, 5))
    agree = agree and len(set(whole.cells('load'))) == len(tets)
    return None if stream['pages'] > 4 and agree else (stream['pages'], agree)


def boxes_and_cut_files():
    """The finest level in a box of a paged stream; a file that ends in the middle of its pages."""
    stream = build('cube.vtu', 'cube.tetlod', '--paged=100')
    must('extract', 'cube.tetlod', '--error', '20%', '--box', '0,0,0,3,3,3', '--box-error', '0', '-o', 'box.vtu')
    whole = read('cube.tetlod')
    with open(path('cut.tetlod'), 'wb') as file:
        file.write(whole[:-len(whole) // 3])
    must('extract', 'cut.tetlod', '--level', str(stream['first_paged_level'] + 1), '-o', 'cut.vtu')
    must('extract', 'cube.tetlod', '--level', str(stream['first_paged_level'] + 1), '-o', 'uncut.vtu')
    return None if read('cut.vtu') == read('uncut.vtu') else 'another level'


def bands():
    """Fine ones are more levels in pages than medium ones, the default, and those more than coarse ones."""
    groups = {}
    for name in ('fine', 'medium', 'coarse'):
        stream = build('cube.vtu', name + '.tetlod', '--paged=100', '--bands', name)
        must('verify', name + '.tetlod', '--against', 'cube.vtu')
        groups[name] = len(stream['levels']) - stream['first_paged_level']
    good = groups['fine'] > groups['medium'] > groups['coarse'] and read('medium.tetlod') == read('cube.tetlod')
    return None if good else groups


def measured_where_users_look(stream):
    """Of the finest level, the coarsest, and the coarsest within an error that has a name (small ones of large meshes:
    only each ten times the one before); of others only what is proved is known."""
    errors = [level['errors'][stream['fields'][0]['name']] for level in stream['levels']]
    names = [digit / 10 ** power for power in range(1, 7) for digit in (1, 2, 5)
             if digit / 10 ** power <= 0.2 and (digit == 1 or power < 4 or stream['levels'][-1]['tets'] < 2 ** 18)]
    for k, error in enumerate(errors[:-2]):
        coarser = errors[k - 1]['max'] if k else 9
        named = not k or any(error['max'] <= name * (1 + 1e-9) < coarser for name in names)
        if ('sampled' in error, 'rms' in error) != (named, named):
            return k, error
    return None if sum('rms' in error for error in errors) < len(errors) else 'all are measured'


def large_meshes_are_measured_so():
    """From 2^18 tetrahedra on, without pages; another metric's limits are not proved, so all are measured."""
    must('sample', 'cube', '--size', '36', '-o', 'large.vtu')
    options = '--max-error', '0.0001', '--growth', '1.02'
    stream = build('large.vtu', 'large.tetlod', *options)
    must('verify', 'large.tetlod', '--against', 'large.vtu')
    must('extract', 'large.tetlod', '--error', '0.00009', '--measure', 'sampled', '-o', 'sampled.tetlod')
    within = [level for level in stream['levels'] if level['errors']['xyz'].get('sampled', 1) <= 0.00009]
    if info('sampled.tetlod')['tets'] != within[0]['tets']:
        return 'another level'
    whole = build('large.vtu', 'large.tetlod', *options, '--metric', 'sva')
    if not all('sampled' in level['errors']['xyz'] for level in whole['levels']):
        return 'another metric'
    return 'pages' if 'pages' in stream else measured_where_users_look(stream)


def volume(points, tets):
    a, b, c, d = (points[tets[:, i]] for i in range(4))
    return numpy.einsum('ij,ij->i', b - a, numpy.cross(c - a, d - a)) / 6


def is_closed_mesh(points, tets, size):
    """A cube of that size is filled once: no tetrahedron is turned, and faces are shared by two or lie on a side of it.
    """
    signed = volume(points, tets)
    faces = {}
    for corners in tets.tolist():
        for i in range(4):
            key = tuple(sorted(corners[:i] + corners[i + 1:]))
            faces[key] = faces.get(key, 0) + 1
    open_faces = points[numpy.array([face for face, count in faces.items() if count == 1])]
    on_side = numpy.all((open_faces == 0) | (open_faces == size), axis=1) & (numpy.ptp(open_faces, axis=1) == 0)
    turned = numpy.any(numpy.sign(signed) != numpy.sign(signed[0]))
    filled = abs(abs(signed.sum()) - size ** 3) < 1e-6 * size ** 3
    return filled and not turned and max(faces.values()) == 2 and bool(numpy.all(numpy.any(on_side, axis=1)))


def closed_sets():
    """Any closed set of pages is a mesh; within a box whose pages are all there it is the finest level."""
    size = 8
    must('sample', 'cube', '--size', str(size), '-o', 'cube.vtu')
    build('cube.vtu', 'cube.tetlod', '--paged=100')
    stream, chance = reference.open(path('cube.tetlod')), random.Random(1)
    whole = stream.cursor().seek(max(stream.groups))
    points, corners = whole.positions, whole.tets
    every = [(level, page) for level, group in stream.groups.items() for page in range(group.count)]
    for trial in range(24):
        low = numpy.array([chance.uniform(0, size - 2) for _ in range(3)])
        box = low, low + 2
        chosen = reference_pages.meeting(stream, [*low, *(low + 2)]) if trial % 2 else {}
        for level, page in chance.sample(every, trial // 2):
            chosen.setdefault(level, set()).add(page)
        chosen = reference_pages.closure(stream, chosen)
        cursor = stream.cursor().seek_pages(chosen)
        if not is_closed_mesh(cursor.positions, cursor.tets, size):
            return trial, 'no mesh'
        if trial % 2 and not inside(points, corners, box) <= inside(cursor.positions, cursor.tets, box):
            return trial, 'not the finest level in the box'
        if trial < 2 and cursor.tet_count == whole.tet_count:
            return trial, 'all pages'
    return None


def inside(points, tets, box):
    """The tetrahedra that meet a box by their own boxes, by the places of their corners."""
    ends = points[tets]
    meets = numpy.all((ends.min(axis=1) <= box[1]) & (ends.max(axis=1) >= box[0]), axis=1)
    return {tuple(sorted(map(tuple, corners))) for corners in ends[meets].tolist()}


case('a curved boundary that moves', holds, ('torus', '--size', '6'), '--paged=300')
FIN = (('fin', '--size', '12'), '--paged=210') if SANITIZED else (('fin', '--size', '16'), '--paged=500')
case('several fields, a vector among them', holds, *FIN, '--field', 'Pressure', '--field', 'Velocity:mag',
     '--keep-order')
case('local bounds', holds, ('cube', '--size', '9'), '--paged=300', '--local-bound')
case('rounded', holds, ('cube', '--size', '9'), '--paged=300', '--position-bits', '12', '--field-bits', '10')
case('limits of their own, up to an error', holds, *FIN, '--field', 'Pressure:0.02', '--max-error', '5%')
case('few tetrahedra more, and hardly any bytes', costs_little)
case('parts of it are streams', parts_are_streams)
case('a small mesh is stored as ever', small_meshes_stay)
case('no pages where the contraction stops early', no_cells_are_needed)
case('the original comes back, in its order', original_comes_back)
case('regions, values of cells, exact sums', parts_of_cells)
must('sample', 'cube', '--size', '8', '-o', 'cube.vtu')
case('boxes, and files that are cut off', boxes_and_cut_files)
case('levels are measured where users look', measured_where_users_look, info('cube.tetlod'))
if not SANITIZED:
    case('those of a large mesh without pages, too', large_meshes_are_measured_so)
case('bands', bands)
if numpy and not SANITIZED:  # Python alone
    case('any closed set of pages is a mesh', closed_sets)
RING = 'build', 'ring.vtu', '-o', 'no.tetlod'
fails('exact errors are refused', 2, ['--paged', '--certify exact'], *RING, '--paged', '--certify', 'exact')
fails('so is another metric', 2, ['--paged', '--metric'], *RING, '--paged', '--metric', 'quadric')
fails('and levels that keep features', 2, ['--paged', '--keep-features'], *RING, '--paged', '--keep-features', '0.1')
must('sample', 'wake', '--steps', '2', '--size', '6', '-o', 'wake.pvd')
fails('and a series', 2, ['--paged', 'series', 'whole levels', '--time N'], 'build', 'wake.pvd', '-o', 'no.tetlod',
      '--paged')
fails('bands of another name', 2, ['--bands', 'medium', 'wide'], *RING, '--paged', '--bands', 'wide')
fails('cells of too few tetrahedra', 2, ['paged'], *RING, '--paged=5')
finish()
