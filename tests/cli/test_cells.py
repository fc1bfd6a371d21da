#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""Values of tetrahedra through the stream: exact, in the stream's own order, and at every level each tetrahedron's own.
"""
import json
import os
import sys

import numpy as np

from cell_meshes import block, cells_of, points_of, save, tets_of
from common import ROOT, case, finish, must, path, read_grid, tetlod, write

sys.path.insert(0, os.path.join(ROOT, 'tests'))
from streams import tetlod as reference  # noqa: E402

NAN = float('nan')


def cell_data(tets):
    random = np.random.default_rng(5)
    strain = random.standard_normal((tets, 6)).astype(np.float32)
    strain[3] = [NAN, np.inf, -np.inf, -0.0, 1e-40, 3e38]
    energy = random.standard_normal(tets) * 1e200
    energy[7] = NAN
    return {
        'strain': strain, 'energy': energy, 'rank': random.integers(-3, 100, tets).astype(np.int8),
        'part': random.integers(-30000, 30000, tets).astype(np.int16), 'number': np.arange(tets, dtype=np.int32) * 90,
        'key': random.integers(-2**52, 2**52, tets), 'one': np.ones(tets, np.uint8)
    }


def make():
    points, tets = block(6)
    save('in.vtu', points, tets, {'heat': np.sin(points @ [3.0, 2.0, 1.0])}, cell_data(len(tets)))
    said = must('build', path('in.vtu'), '-o', path('a.tetlod'), '--keep-order').stderr
    assert b'left out' not in said, said


def same(wanted, got):
    if list(wanted) != list(got):
        return 'fields %s, not %s' % (list(got), list(wanted))
    for name in wanted:
        a, b = wanted[name], got[name]
        if ((a.dtype.kind == 'f') != (b.dtype.kind == 'f') or a.shape != b.shape
                or not np.array_equal(a, b, equal_nan=a.dtype.kind == 'f')
                or a.dtype.kind == 'f' and (a.dtype != b.dtype or not np.array_equal(np.signbit(a), np.signbit(b)))):
            return '%s differs' % name
    return None


def original_order():
    must('extract', path('a.tetlod'), '--original-order', '-o', path('back.vtu'), '--quiet')
    return same(cells_of(read_grid('in.vtu')), cells_of(read_grid('back.vtu')))


def row_of(grid):
    """Values of cells by the cell's own number."""
    cells = cells_of(grid)
    order = np.argsort(cells['number'])
    return {name: values[order] for name, values in cells.items()}


def stream_order():
    must('convert', path('a.tetlod'), '-o', path('again.vtu'))
    return same(cells_of(read_grid('in.vtu')), row_of(read_grid('again.vtu')))


def levels():
    """At every level a tetrahedron has the row of one of the original's whose corners its own stand for."""
    wanted, stream = cells_of(read_grid('in.vtu')), reference.open(path('a.tetlod'))
    for level in range(0, len(stream.levels), 9):
        must('extract', path('a.tetlod'), '--level', str(level), '-o', path('level.vtu'), '--quiet')
        got = cells_of(read_grid('level.vtu'))
        if len(got['number']) != stream.levels[level]['tets'] or len(set(got['number'])) != len(got['number']):
            return 'level %d: %d rows' % (level, len(set(got['number'])))
        problem = same({name: values[got['number'] // 90] for name, values in wanted.items()}, got)
        if problem:
            return 'level %d: %s' % (level, problem)
        if not np.array_equal(stream.cells('number')[:len(got['number'])], got['number']):
            return 'level %d: the reference decoder has others' % level
    return None


def described():
    text, info = must('info', path('a.tetlod')).stdout.decode(), json.loads(must('info', path('a.tetlod'),
                                                                                 '--json').stdout)
    found = [(field['name'], field['components'], field['type']) for field in info['cell_fields']]
    wanted = [('strain', 6, 'float32'), ('energy', 1, 'float64'), ('rank', 1, 'int8'), ('part', 1, 'int16'),
              ('number', 1, 'int32'),
              ('key', 1, 'int64'), ('one', 1, 'int8')]
    return None if found == wanted and 'cell field    strain, 6 x float32' in text else (found, text)


def small():
    """Packed: ones cost next to nothing, and no field more than its bytes."""
    sizes = [(section['stored'],
              section['size']) for section in reference.open(path('a.tetlod')).sections if section['tag'] == 'CVAL']
    return None if sizes[-1][0] < sizes[-1][1] / 50 and all(stored <= size for stored, size in sizes) else sizes


def verified():
    must('verify', path('a.tetlod'), '--against', path('in.vtu'), '--quiet')
    data = bytearray(open(path('a.tetlod'), 'rb').read())
    data[-5] ^= 1  # of the last field of cells
    open(path('bad.tetlod'), 'wb').write(data)
    return None if tetlod('verify', path('bad.tetlod'),
                          '--quiet').returncode == 3 else 'a changed value of a cell is not noticed'


def held_against_the_input():
    """One value of one tetrahedron that is another in the input is found, and so is one that changed places."""
    points, tets = block(6)
    fields = {'heat': np.sin(points @ [3.0, 2.0, 1.0])}
    for name, change in (('energy', lambda v: v[10] + 1e200), ('rank', lambda v: v[10] + 1),
                         ('strain', lambda v: v[11])):
        cells = cell_data(len(tets))
        cells[name][10] = change(cells[name])
        save('other.vtu', points, tets, fields, cells)
        done = tetlod('verify', path('a.tetlod'), '--against', path('other.vtu'), '--quiet')
        if done.returncode != 3 or b'values of cells' not in done.stderr:
            return done
    save('none.vtu', points, tets, fields, {})
    done = tetlod('verify', path('a.tetlod'), '--against', path('none.vtu'), '--quiet')
    return None if done.returncode == 3 and b"no field 'strain' of cells" in done.stderr else done


def points_and_cells(name):
    grid = read_grid(name)
    return points_of(grid), tets_of(grid), cells_of(grid)


def cut_off():
    """Every whole level comes out of a file that is cut off, with those values of cells that are whole."""
    data, stream = open(path('a.tetlod'), 'rb').read(), reference.open(path('a.tetlod'))
    values = [section for section in stream.sections if section['tag'] == 'CVAL']
    cuts = [(level, stream.levels[level]['bytes'] + 3 * (level % 2), 0) for level in range(0, len(stream.levels), 7)]
    cuts += [(len(stream.levels) - 1,
              values[held]['offset'] + values[held]['stored'] // 2, held) for held in range(len(values))]
    for level, size, held in cuts:
        write('cut.tetlod', data[:size])
        must('extract', path('a.tetlod'), '--level', str(level), '-o', path('wanted.vtu'), '--quiet')
        said = must('extract', path('cut.tetlod'), '-o', path('cut.vtu')).stderr.decode()
        must('extract', path('cut.tetlod'), '-o', path('saved.tetlod'), '--quiet')
        must('verify', path('saved.tetlod'), '--quiet')
        must('extract', path('saved.tetlod'), '-o', path('saved.vtu'), '--quiet')
        points, tets, cells = points_and_cells('wanted.vtu')
        names = [field['name'] for field in stream.cell_fields]
        for name in ('cut.vtu', 'saved.vtu'):
            found = points_and_cells(name)
            if not np.array_equal(points, found[0]) or not np.array_equal(tets, found[1]):
                return name, size, 'another mesh'
            problem = same({key: cells[key] for key in names[:held]}, found[2])
            if problem:
                return name, size, problem
        described = must('info', path('cut.tetlod')).stdout.decode()
        if (any('cells\' ' + name not in described for name in names[held:])
                or 'values of cells ' + ', '.join(names[held:]) not in said):
            return size, described, said
    return None


def cut_series():
    """Steps before the cut are there, and of the cells what is whole."""
    points, tets = block(4)
    for step in range(9):
        save('step_%d.vtu' % step, points, tets, {'heat': np.sin(points @ [3.0, 2.0, 1.0] + step / 9)},
             {'mat': np.arange(len(tets)) % 7})
    must('build', *(path('step_%d.vtu' % step) for step in range(9)), '--field', 'heat', '-o', path('steps.tetlod'),
         '--quiet')
    stream, data = reference.open(path('steps.tetlod')), open(path('steps.tetlod'), 'rb').read()
    sections = {section['tag']: section['offset'] + section['stored'] for section in stream.sections}
    for size in (sections['CVAL'] - 1, sections['CVAL'], sections['TIME'], sections['TVAL'] - 1):
        write('cut.tetlod', data[:size])
        must('extract', path('cut.tetlod'), '-o', path('level.vtu'))
        if ('mat' in cells_of(read_grid('level.vtu'))) != (size >= sections['CVAL']):
            return size, 'cells'
        done = tetlod('extract', path('cut.tetlod'), '--step', '2', '--error', '5%', '-o', path('step.vtu'))
        if done.returncode != (0 if size > sections['TIME'] else 3) or done.stderr.count(b'\n') != 1:
            return size, done
    done = tetlod('extract', path('cut.tetlod'), '--error', '5%', '--box', '0,0,0,1,1,1', '-o', path('box.vtu'))
    write('cut.tetlod', data[:stream.levels[5]['bytes']])
    refused = tetlod('extract', path('cut.tetlod'), '--level', '3', '--box', '0,0,0,1,1,1', '-o', path('box.vtu'))
    return (None if done.returncode == 0 and refused.returncode == 3 and b'--box needs the finest' in refused.stderr
            else (done, refused))


def rounded_streams():
    """Lossy ones: with and without the original order the finest level is the input, rounded, with its values of cells.
    """
    points, tets = block(6)
    fields, random = {'heat': np.sin(points @ [3.0, 2.0, 1.0])}, np.random.default_rng(7)
    places = points + random.uniform(-0.02, 0.02, points.shape)
    other = cell_data(len(tets))
    other['rank'][10] += 1
    moved = places.copy()
    moved[5] += 0.3
    lacking = cell_data(len(tets))
    del lacking['one']
    more = dict(cell_data(len(tets)), further=np.arange(len(tets)))
    save('lossy.vtu', places, tets, fields, cell_data(len(tets)))
    others = {'cells': (places, other, b'values of cells'), 'lacking': (places, lacking, b"'one' of cells"),
              'more': (places, more, b"'further' of cells"), 'moved': (moved, cell_data(len(tets)), b'differ')}
    for name, (where, data, _) in others.items():
        save(name + '.vtu', where, tets, fields, data)
    for options in (['--position-bits', '4', '--field-bits', '3'], ['--field-error', '1%', '--keep-order'],
                    ['--position-error', '2%']):
        must('build', path('lossy.vtu'), '--growth', '2', *options, '-o', path('lossy.tetlod'), '--quiet')
        must('verify', path('lossy.tetlod'), '--against', path('lossy.vtu'), '--quiet')
        for name, (_, _, word) in others.items():
            done = tetlod('verify', path('lossy.tetlod'), '--against', path(name + '.vtu'), '--quiet')
            if done.returncode != 3 or word not in done.stderr and b'bounds' not in done.stderr:
                return name, options, done
    return None


def order_kept_wrong():
    """A kept order that leads to another numbering of the same mesh."""
    points, tets = block(4)
    turned = np.arange(len(points))[::-1]
    for name, order in (('plain', np.arange(len(points))), ('turned', turned)):
        back = np.argsort(order)
        save(name + '.vtu', points[order], back[tets], {'heat': np.sin(points[order] @ [3.0, 2.0, 1.0])}, {})
    must('build', path('plain.vtu'), '--keep-order', '--growth', '2', '-o', path('plain.tetlod'), '--quiet')
    must('verify', path('plain.tetlod'), '--against', path('plain.vtu'), '--quiet')
    done = tetlod('verify', path('plain.tetlod'), '--against', path('turned.vtu'), '--quiet')
    return None if done.returncode == 3 and (b'another one' in done.stderr or
                                             b'original order' in done.stderr) else done


def carried():
    """--carry chooses among values of cells, too; those of regions are always stored."""
    points, tets = block(4)
    fields = {'heat': points[:, 0] ** 2, 'cold': points[:, 1]}
    cells = {'load': np.arange(len(tets)) / 7.0, 'stress': np.arange(len(tets)) * 1.0,
             'region': (points[tets].mean(1)[:, 0] > 0.5).astype(np.int32)}
    save('carry.vtu', points, tets, fields, cells)
    for carry, wanted in (('load', (['heat'], ['load', 'region'])), ('cold', (['heat', 'cold'], ['region']))):
        must('build', path('carry.vtu'), '-o', path('carry.tetlod'), '--field', 'heat', '--carry', carry, '--quiet')
        info = json.loads(must('info', path('carry.tetlod'), '--json').stdout)
        got = [f['name'] for f in info['fields']], [f['name'] for f in info['cell_fields']]
        if got != wanted:
            return got
        must('verify', path('carry.tetlod'), '--against', path('carry.vtu'), '--quiet')
    return None


def cells_only():
    points, tets = block(4)
    save('only.vtu', points, tets, {}, {'load': points[tets].mean(1)[:, 0]})
    must('build', path('only.vtu'), '-o', path('only.tetlod'), '--quiet')
    info = json.loads(must('info', path('only.tetlod'), '--json').stdout)
    good = [f['name'] for f in info['fields']] == ['load'] == [f['name'] for f in info['cell_fields']]
    return None if good else info


make()
case('bit for bit in the original order', original_order)
case('bit for bit in the stream\'s order', stream_order)
case('every level has the values of its tetrahedra', levels)
case('info describes them', described)
case('they are packed', small)
case('verify decodes them', verified)
case('verify holds them against the input', held_against_the_input)
case('a file that is cut off gives every whole level', cut_off)
case('and of a series every whole level and step', cut_series)
case('verify holds rounded streams against the input', rounded_streams)
case('and the order that is kept', order_kept_wrong)
case('--carry chooses among them', carried)
case('values of cells alone drive by their average', cells_only)
finish()
