#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""extract --box of streams in pages: what the reference decoder has, within what is certified, out of few bytes."""
import glob
import itertools
import json
import os
import random
import re
import sys

from common import ROOT, SANITIZED, Host, case, fails, finish, info, must, path, write

sys.path[:0] = [os.path.join(ROOT, 'client-examples', 'python'), os.path.join(ROOT, 'tests', 'http')]
import numpy  # noqa: E402
from region_judge import COARSE, FINE, TRANSITION, read_vtk  # noqa: E402
os.environ['TETLOD_LIBRARY'] = glob.glob(os.path.join(ROOT, 'build', 'release', 'libtetlod.so.*'))[0]
import tetlod as client  # noqa: E402
from tetlod import reference, reference_pages  # noqa: E402

CASES = {  # a boundary that moves, several fields, parts, a local bound
    'ring': (('torus', '--size', '5'), ('--paged=200',)),
    'fin': (('fin', '--size', '12'), ('--paged=300', '--field', 'Pressure', '--field', 'Velocity:mag')),
    'parts': (('parts', '--size', '10'), ('--paged=100', '--region', 'material')),
    'cube': (('cube', '--size', '8'), ('--paged=200', '--local-bound')),
    'coarse': (('fin', '--size', '12'), ('--paged=300', '--position-bits', '12', '--field-bits', '10')),
}
MOVES = 'ring'


def errors_of(stream):
    """Of each level the largest certified error of the controlled fields."""
    names = [field['name'] for field in stream['fields'] if field['controlled']]
    return [max(level['errors'][name]['max'] for name in names) for level in stream['levels']]


def finest(stream):
    """The last level in pages."""
    return len(stream['levels']) - 1 - (stream['levels'][-1]['tets'] == stream['levels'][-2]['tets'])


def random_box(stream, chance, share):
    low, high = (numpy.array(corner) for corner in stream['bounds'])
    size = (high - low) * share ** (1 / 3)
    at = low + (high - low - size) * numpy.array([chance.random() for _ in range(3)])
    return numpy.concatenate([at, at + size])


def extract(stream, boxes, coarse, fine, out='box.vtk'):
    """The mesh, and what was said of it."""
    options = ['--box=' + ','.join('%.17g' % x for x in box) for box in boxes]
    said = must('extract', stream, '--level', str(coarse), '--box-error', repr(fine), *options, '-o', out)
    return read_vtk(path(out)), said.stderr.decode()


def agrees(stream, name, field, chance):
    """Python decodes the same set to the same mesh; each part is what it says; the error is what was certified."""
    decoder = reference.open(path(name + '.tetlod'))
    root = stream['first_paged_level'] - 1
    coarse, fine = chance.randint(root - 2, root + 3), chance.randint(root + 4, finest(stream))
    boxes = [random_box(stream, chance, chance.choice((1 / 512, 1 / 64))) for _ in range(chance.randint(1, 2))]
    levels = errors_of(stream)
    fine = next(k for k, error in enumerate(levels) if error <= levels[fine])
    if fine <= max(coarse, root):
        return 'no box'
    mesh, said = extract(name + '.tetlod', boxes, coarse, levels[fine])
    chosen = {level: set(range(group.count)) for level, group in decoder.groups.items() if level <= coarse}
    for box in boxes:
        for level, pages in reference_pages.meeting(decoder, box, fine).items():
            chosen.setdefault(level, set()).update(pages)
    cursor = decoder.cursor().seek_pages(reference_pages.closure(decoder, chosen))
    same = numpy.array_equal(mesh['points'], cursor.positions) and numpy.array_equal(mesh['tets'], cursor.tets)
    if not same:
        return 'another mesh than the reference decoder has: %d, %d' % (len(mesh['tets']), len(cursor.tets))
    return parts_are_levels(name, mesh, boxes, max(coarse, root), fine) or within(name, field, said, mesh)


def rows(mesh, chosen):
    """Tetrahedra by the places of their corners, which tell them where no two points are at one place."""
    return {tuple(sorted(map(tuple, corners))) for corners in mesh['points'][mesh['tets'][chosen]].tolist()}


def parts_are_levels(name, mesh, boxes, coarse, fine):
    part = mesh['cell']['Region'][:, 0]
    for number, level in ((COARSE, coarse), (FINE, fine)):
        must('extract', name + '.tetlod', '--level', str(level), '-o', 'level.vtk', '--quiet')
        whole = read_vtk(path('level.vtk'))
        if not rows(mesh, part == number) <= rows(whole, slice(None)):
            return 'tetrahedra of part %d are not those of level %d' % (number, level)
    ends = mesh['points'][mesh['tets']]
    for box in boxes:
        meets = numpy.all((ends.min(axis=1) <= box[3:]) & (ends.max(axis=1) >= box[:3]), axis=1)
        if numpy.any(meets & (part != FINE)):
            return 'a tetrahedron that meets a box is not of the fine level'
    return None


def within(name, field, said, mesh):
    """The exact overlay's largest difference from the original is at most that of the coarsest part."""
    promised = [float(words.split(field + ' ≤ ')[1].split(' %')[0]) for words in
                re.split('level|transition', said) if field + ' ≤ ' in words]
    counts = [numpy.sum(mesh['cell']['Region'] == part) for part in (COARSE, FINE, TRANSITION)]
    if len(promised) != (3 if counts[2] else 2):
        return 'not certified: ' + said
    most = max(error for error, count in zip(promised, counts) if count)
    found = json.loads(must('compare', name + '.vtu', 'box.vtk', '--field', field, '--json').stdout)
    if name != MOVES and not found['errors']['max'] * 100 <= most * (1 + 1e-6) + 1e-4:
        return 'off by %g %%, certified is %g %%' % (found['errors']['max'] * 100, most)
    return None


def page_sets(name):
    sample, options = CASES[name]
    if name == 'parts':
        write_parts()
    else:
        must('sample', *sample, '-o', name + '.vtu')
    must('build', name + '.vtu', '-o', name + '.tetlod', *options)
    stream, chance = info(name + '.tetlod'), random.Random(name)
    field, held = next(f['name'] for f in stream['fields'] if f['controlled']), 0
    for trial in range(1 if SANITIZED else 3):
        problem = agrees(stream, name, field, chance)
        held += problem is None
        if problem not in (None, 'no box'):
            return trial, problem
    return None if held or SANITIZED else 'no box'


def write_parts():
    """Two materials, with values of cells."""

    size = 6
    points = list(itertools.product(range(size + 1), repeat=3))
    number = {point: i for i, point in enumerate(points)}
    tets, material = [], []
    for at in itertools.product(range(size), repeat=3):
        for axes in itertools.permutations(range(3)):
            corner, corners = list(at), [number[at]]
            for axis in axes:
                corner[axis] += 1
                corners.append(number[tuple(corner)])
            tets.append(corners)
            material.append(2 if at[0] < 3 else 5)
    lines = ['# vtk DataFile Version 3.0', 'parts', 'ASCII', 'DATASET UNSTRUCTURED_GRID']
    lines += ['POINTS %d float' % len(points), *('%d %d %d' % point for point in points)]
    lines += ['CELLS %d %d' % (len(tets), 5 * len(tets)), *('4 %d %d %d %d' % tuple(corners) for corners in tets)]
    lines += ['CELL_TYPES %d' % len(tets)] + ['10'] * len(tets) + ['CELL_DATA %d' % len(tets)]
    lines += ['SCALARS material int 1', 'LOOKUP_TABLE default', *map(str, material), 'POINT_DATA %d' % len(points)]
    lines += ['SCALARS heat float 1', 'LOOKUP_TABLE default', *(str(x * y + z * z) for x, y, z in points)]
    write('parts.vtk', '\n'.join(lines) + '\n')
    must('convert', 'parts.vtk', '-o', 'parts.vtu')


def cells_follow():
    """The values of cells are those of the tetrahedra that are left."""
    box, _ = extract('parts.tetlod', [[0, 0, 0, 3, 3, 3]], 2, 0.001)
    material = box['cell']['material'][:, 0]
    middles = box['points'][box['tets']].mean(axis=1)
    wrong = material != numpy.where(middles[:, 0] < 3, 2, 5)
    return None if not wrong.any() and len(set(material)) == 2 else int(wrong.sum())


def over_http():
    """Of a URL only what the box needs is fetched, and what it gives is the same."""
    size, cell = ('20', '2000') if SANITIZED else ('28', '8000')
    must('sample', 'fin', '--size', size, '-o', 'big.vtu')
    must('build', 'big.vtu', '-o', 'big.tetlod', '--paged=' + cell, '--quiet')
    options = '--error', '2%', '--box', '1,1,1,1,1,1'
    must('extract', 'big.tetlod', *options, '-o', 'here.vtu')
    must('extract', 'big.tetlod', '--level', '3', '-o', 'level.vtu')
    with Host() as host:
        must('extract', host.url + 'big.tetlod', *options, '-o', 'there.vtu')
        size, sent, asked = os.path.getsize(path('big.tetlod')), host.sent, list(host.asked)
        must('extract', host.url + 'big.tetlod', '--level', '3', '-o', 'there_level.vtu')
    with open(path('here.vtu'), 'rb') as here, open(path('there.vtu'), 'rb') as there:
        if here.read() != there.read():
            return 'another mesh'
    with open(path('level.vtu'), 'rb') as here, open(path('there_level.vtu'), 'rb') as there:
        if here.read() != there.read():
            return 'another level'
    overlap = len({first for first, _ in asked}) != len(asked)
    return None if (SANITIZED or sent < 0.75 * size) and not overlap else (size, sent, asked)


def packages():
    """The package: the library and Python give the mesh of extract, of a URL by the ranges that it needs."""
    stream = info('big.tetlod')
    box, root = random_box(stream, random.Random(7), 1 / 512), stream['first_paged_level'] - 1
    fine = errors_of(stream)[finest(stream) - 1]
    wanted, _ = extract('big.tetlod', [box], root, fine)
    level = next(k for k, error in enumerate(errors_of(stream)) if error <= fine)
    with Host() as host:
        for place, decoder in ((path('big.tetlod'), 'library'), (path('big.tetlod'), 'python'),
                               (host.url + 'big.tetlod', 'library')):
            mesh = client.read(place, box=list(box), box_error=fine, decoder=decoder)
            same = numpy.array_equal(mesh.points, wanted['points']) and numpy.array_equal(mesh.tets, wanted['tets'])
            outside = numpy.where(mesh.tet_levels <= root, COARSE, TRANSITION)
            parts = numpy.where(mesh.tet_levels >= level, FINE, outside)
            if not same or not numpy.array_equal(parts, wanted['cell']['Region'][:, 0]) or mesh.level != level:
                return place, decoder, len(mesh.tets), len(wanted['tets'])
            if mesh.error != errors_of(stream)[mesh.tet_levels.min()] or mesh.errors['Pressure']['max'] > mesh.error:
                return mesh.error
        size = os.path.getsize(path('big.tetlod'))
        if (not SANITIZED and host.sent > 0.75 * size) or len(host.asked) > 12:
            return host.sent, size, host.asked
    material = client.read(path('parts.tetlod'), box=[0, 0, 0, 3, 3, 3], box_error=0.001)
    middles = material.points[material.tets].mean(axis=1)
    if not numpy.array_equal(material.cells['material'], numpy.where(middles[:, 0] < 3, 2, 5)):
        return 'other values of cells'
    try:
        client.open(path('level.tetlod')).region([0, 0, 0, 1, 1, 1])
        return 'a region of a stream without pages'
    except ValueError as problem:
        return None if '--paged' in str(problem) else problem


def budgets():
    """The package's regions within a budget of memory: the finest level that fits, of which less is read."""
    stream = info('big.tetlod')
    box, root = list(random_box(stream, random.Random(7), 1 / 512)), stream['first_paged_level'] - 1
    with Host() as host:
        ask = lambda memory: client.read(host.url + 'big.tetlod', box=box, memory=memory, decoder='library')  # noqa
        all_of_it, sent = ask(None), host.sent
        least = 1 << 19
        while True:
            try:
                mesh = ask(least)
                break
            except client.StreamError as problem:
                if 'levels before those in pages take' not in str(problem):
                    return problem
                least += least // 4
        before = host.sent
        some = ask(2 * least)
        less = host.sent - before
    if not root <= mesh.level <= some.level <= all_of_it.level or mesh.level == all_of_it.level or less > sent:
        return mesh.level, some.level, all_of_it.level, sent, less
    if mesh.tet_levels.max() != mesh.level or len(mesh.tets) > len(some.tets):
        return mesh.tet_levels.max(), len(mesh.tets), len(some.tets)
    for words in dict(box=box, memory=least, decoder='python'), dict(memory=least):
        try:
            client.read(path('big.tetlod'), **words)
            return 'a budget that nothing heeds', words
        except ValueError as problem:
            if 'memory=' not in str(problem):
                return problem
    return None


def two_trips():
    """Of a host that answers none before all have asked: the begin, with the index; then all pages at once."""
    box = [1, 1, 1, 1.5, 1.5, 1.5]
    region = lambda place: client.read(place, box=box, decoder='library').tets  # noqa: E731
    file = lambda place: must('extract', place, '--error', '2%', '--box', ','.join(map(str, box)),  # noqa: E731
                              '-o', 'trips.vtu')
    for ask, least in (file, 2), (region, 2 if SANITIZED else 3):  # the stream is smaller there
        with Host() as host:
            ask(host.url + 'big.tetlod')
            asked = len(host.asked)
        with Host(trips=(1, asked - 1)) as host:
            ask(host.url + 'big.tetlod')
        if asked not in range(least, 10) or host.here != asked:
            return least, asked, host.here
    return None


def cut_off():
    """A file without what lies behind the pages of a box."""
    with open(path('cube.tetlod'), 'rb') as file:
        whole = file.read()
    stream = info('cube.tetlod')
    fine = stream['levels'][finest(stream)]
    write('cut.tetlod', whole[:fine['bytes']])
    options = '--error', '20%', '--box', '0,0,0,3,3,3', '--box-error', repr(errors_of(stream)[finest(stream)])
    must('extract', 'cut.tetlod', *options, '-o', 'cut.vtu')
    must('extract', 'cube.tetlod', *options, '-o', 'uncut.vtu')
    with open(path('cut.vtu'), 'rb') as cut, open(path('uncut.vtu'), 'rb') as uncut:
        return None if cut.read() == uncut.read() else 'another mesh'


for each in CASES:
    case('%s: as the reference decoder, within what is certified' % each, page_sets, each)
case('values of cells', cells_follow)
case('of a URL', over_http)
must('build', path('big.vtu'), '-o', 'level.tetlod', '--max-error', '0', '--quiet')
case('of the package', packages)
case('of the package, within a budget of memory', budgets)
case('in two trips', two_trips)
case('of a file that is cut off', cut_off)
fails('a host that is not there', 1, ['cannot be read'], 'extract', 'http://127.0.0.1:1/x.tetlod', '--error', '1%',
      '-o', 'no.vtu')
finish()
