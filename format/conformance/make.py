#!/usr/bin/python3
# SPDX-License-Identifier: 0BSD
"""make.py: writes expected.json, what a decoder must give of each stream, with the reference decoder.

`make.py --streams TETLOD` writes the streams of valid/ first, with that program. Another version of the program may
write other bytes: a stream that is here stays, so that it is the same for every reader. `make.py --copy FOLDER` writes
the kit with all of its streams into a folder that needs nothing else."""
import json
import os
import shutil
import subprocess
import sys
import tempfile

import numpy as np

HERE = os.path.dirname(os.path.abspath(__file__))
ROOT = os.path.dirname(os.path.dirname(HERE))
sys.path[:0] = [HERE, *(os.path.join(ROOT, *place) for place in (('tests',), ('tests', 'golden'),
                                                                   ('client-examples', 'python')))]
import make_invalid  # noqa: E402
import profile0  # noqa: E402
import reference_reader  # noqa: E402
from streams import plain, sealed  # noqa: E402
from tetlod._build import write_vtu  # noqa: E402


def lattice(n=3, holes=()):
    """A cube of n³ cells, of six tetrahedra each."""
    points = np.array([(x, y, z) for z in range(n + 1) for y in range(n + 1) for x in range(n + 1)], float) / n
    corners = []
    for cell in np.ndindex(n, n, n):
        if cell in holes:
            continue
        for order in ((0, 1, 2), (0, 2, 1), (1, 0, 2), (1, 2, 0), (2, 0, 1), (2, 1, 0)):
            at, tet = np.array(cell), []
            for axis in (None, *order):
                at = at if axis is None else at + np.eye(3, dtype=int)[axis]
                tet.append(at[0] + (n + 1) * (at[1] + (n + 1) * at[2]))
            even = order in ((0, 1, 2), (1, 2, 0), (2, 0, 1))
            corners.append(tet if even else tet[:2] + tet[:1:-1])
    used, local = np.unique(np.array(corners), return_inverse=True)
    return points[used], local.reshape(-1, 4)


def smooth(points):
    x, y, z = points.T
    return np.sin(3 * x) + y * y - x * z


@np.errstate(over='ignore')  # of what is no float32
def fields_of(kind, points):
    base = smooth(points)
    if kind.startswith('components_'):
        return {'value': np.column_stack([base * (i + 1) - i for i in range(int(kind[11:]))])}
    return {
        'none': {}, 'float32': {'value': base.astype('f4')}, 'float64': {'value': base},
        'two': {'value': base, 'second': points[:, 0] ** 3},
        'eight': {'f%d' % i: (base * points[:, i % 3]).astype('f4') for i in range(8)},
        'constant': {'value': base, 'constant': np.full(len(points), 2.5)},
        'ids': {'value': base, 'GlobalNodeId': np.arange(len(points), dtype='i8')},
        'integers': {'value': base, 'count': (10 * points[:, 1]).astype('i4')},
        'decimals': {'value': np.round(base, 2)},
        'powers': {'value': np.round(base * 64) / 64},
        'repeated': {'value': np.column_stack([base, base, base])},
        'negative_zero': {'value': np.where(base > 0.5, -0.0, base)},
        'small32': {'value': (base * 1e-40).astype('f4')},
        'huge': {'value': base * 1e300}, 'huge32': {'value': (base * 1e36).astype('f4')},
        'offset': {'value': base + 1e6}, 'noise': {'value': np.random.default_rng(1).random(len(points))},
        'steps': {'value': (base > 0.5).astype('f4')}, 'name': {'Übertemperatur ΔT': base},
        'long_name': {'n' * 255: base}, 'near': {'value': base, 'near': base + 1e-9 * points[:, 0]},
    }[kind]


def cells_of(kind, tets):
    count = np.arange(len(tets))
    if kind in ('i1', 'i2', 'i4', 'i8', 'f4', 'f8'):
        return {'cell': (count % 100 * (1 if kind[0] == 'i' else 0.5)).astype(kind)}
    finite = np.where(count % 5 == 0, np.inf, count)
    return {'none': {}, 'not_finite': {'cell': np.where(count % 7 == 0, np.nan, finite)},
            'vector': {'cell': np.column_stack([count, count * 2.0, count % 3])},
            'large': {'cell': (count * 1000003).astype('i8')}, 'negative': {'cell': (-count).astype('i4')},
            'constant': {'cell': np.full(len(tets), 7, 'i4')},
            'region': {'region': (count > len(tets) // 2).astype('i4')},
            'many': {'c%d' % i: (count * (i + 1)).astype('f4') for i in range(9)}}[kind]


def shapes():
    points, tets = lattice(2)
    flat = tets.copy()
    flat[0] = flat[0][[1, 0, 2, 3]]
    far = points + [3, 0, 0]
    touching = points + [1, 1, 1]
    yield 'shape_inverted', 'an inverted tetrahedron', points, flat
    yield 'shape_two_bodies', 'two bodies', np.concatenate([points, far]), np.concatenate([tets, tets + len(points)])
    joined, index = np.unique(np.concatenate([points, touching]), axis=0, return_inverse=True)
    yield ('shape_touching', 'two bodies that share one vertex', joined,
           index.reshape(-1)[np.concatenate([tets, tets + len(points)])])
    yield 'shape_repeated', 'a tetrahedron twice', points, np.concatenate([tets, tets[:1]])
    yield 'shape_overlap', 'bodies that overlap', np.concatenate([points, points + 0.3]), \
        np.concatenate([tets, tets + len(points)])
    squashed = points.copy()
    squashed[:, 2] = np.where(squashed[:, 2] < 0.6, 0, squashed[:, 2])
    yield 'shape_degenerate', 'degenerate tetrahedra', squashed, tets
    yield ('shape_cavity', 'a cavity', *lattice(3, [(1, 1, 1)]))
    yield ('shape_tunnel', 'a tunnel', *lattice(3, [(1, 1, i) for i in range(3)]))
    yield 'shape_one', 'one tetrahedron', np.eye(4)[:, 1:], np.array([[0, 1, 2, 3]])
    yield 'shape_thin', 'a plate without extent in z but little', points * [1, 1, 1e-6], tets
    yield 'shape_far', 'coordinates far from 0', points + 1e7, tets
    yield 'shape_float32', 'positions of float32', points.astype('f4'), tets


FIELDS = {
    'none': 'no field of its own', 'float32': 'float32', 'float64': 'float64', 'two': 'two fields',
    'eight': 'eight fields', 'constant': 'a constant field', 'ids': 'ids', 'integers': 'integers at points',
    'decimals': 'decimals', 'powers': 'multiples of a power of two', 'repeated': 'components that repeat',
    'negative_zero': '-0 beside 0', 'small32': 'denormal float32', 'huge': 'large float64', 'huge32': 'large float32',
    'offset': 'a range that is small beside the values', 'noise': 'values without order', 'steps': 'two values only',
    'name': 'a name beyond ASCII', 'long_name': 'a name of 255 bytes', 'near': 'two fields that are nearly the same',
    'components_2': '2 components', 'components_6': '6 components', 'components_9': '9 components',
    'components_64': '64 components'}
CELLS = {'i1': 'int8', 'i2': 'int16', 'i4': 'int32', 'i8': 'int64', 'f4': 'float32', 'f8': 'float64',
         'not_finite': 'NaN and infinities', 'vector': 'three components', 'large': 'large integers',
         'negative': 'negative integers', 'constant': 'a constant', 'region': 'regions', 'many': 'nine fields'}
OPTIONS = {
    'positions_1_bit': '5.2', 'positions_8_bit': '5.2', 'positions_16_bit': '5.2', 'positions_30_bit': '5.2',
    'fields_1_bit': '5.2', 'fields_8_bit': '5.2', 'fields_16_bit': '5.2', 'fields_30_bit': '5.2', 'both_12_bit': '5.2',
    'kept_order': '10', 'certify_exact': '3.3', 'domain_error_0': '7.2', 'summary': '3.9',
    'box_sums': '3.9'}
ARGUMENTS = {'kept_order': ['--keep-order'], 'certify_exact': ['--certify', 'exact'],
             'domain_error_0': ['--domain-error', '0'], 'summary': ['--summary'], 'box_sums': ['--summary'],
             'both_12_bit': ['--position-bits', '12', '--field-bits', '12']}


PAGED = {
    'float64': ('float64 positions', 'two', {}, []), 'none': ('no field', 'none', {}, []),
    'components': ('components that repeat', 'repeated', {}, []), 'tail': ('exact decimals', 'decimals', {}, []),
    'cells': ('values of tetrahedra', 'float32', 'vector', []), 'regions': ('regions', 'float32', 'region', []),
    'quantised': ('rounded positions and values', 'two', {}, ['--position-bits', '12', '--field-bits', '10']),
    'order': ('the original order', 'float32', {}, ['--keep-order']),
    'bound': ('a local bound', 'float32', {}, ['--local-bound'])}


def paged():
    """As listed() has them: levels in pages, of small cells."""
    points, tets = lattice(6)
    for name, (feature, kind, cells, options) in PAGED.items():
        yield ('paged_' + name, 'levels in pages: ' + feature, '7.6', points, tets, fields_of(kind, points),
               cells_of(cells, tets) if cells else {}, ['--paged=160', '--growth', '1.4', *options])


def listed():
    """Name, feature, clause, points, tetrahedra, fields, cells, options of tetlod build."""
    points, tets = lattice(3)
    for kind, feature in FIELDS.items():
        small = lattice(1) if kind == 'components_64' else (points, tets)
        yield 'field_' + kind, 'fields: ' + feature, '8', *small, fields_of(kind, small[0]), {}, []
    for kind, feature in CELLS.items():
        at, corners = lattice(2)
        yield ('cells_' + kind, 'values of tetrahedra: ' + feature, '3.6', at, corners, fields_of('float32', at),
               cells_of(kind, corners), ['--no-region'] * (kind != 'region'))
    for name, feature, at, corners in shapes():
        yield name, 'mesh: ' + feature, '9.1', at, corners, fields_of('float32', at.astype(float)), {}, []
    for name, clause in OPTIONS.items():
        kind, *rest = name.split('_')
        given = ARGUMENTS.get(name) or ['--%s-bits' % kind.rstrip('s'), rest[0]]
        yield ('option_' + name, 'tetlod build ' + ' '.join(given), clause, points, tets, fields_of('two', points), {},
               given)
    yield from paged()


def profile_0():
    """Streams that are stored whole: name, feature, clause, bytes."""
    points, tets = lattice(2)
    fields = {'value': smooth(points), 'flow': np.column_stack([smooth(points), points[:, :2]]).astype('f4')}
    one = np.array([(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)], 'f4'), np.array([(0, 1, 2, 3)])
    yield ('profile_0', 'profile 0: one tetrahedron', '16.1',
           profile0.stream_of(*one, {'T': np.array([1, 2, 3, 5], 'f4')}, metadata={'units': {'T': 'K'}}))
    yield ('profile_0_cells', 'profile 0: values of tetrahedra', '16.1',
           profile0.stream_of(points, tets, fields, {'part': np.arange(len(tets), dtype='i4') // 9}))
    for profile0.SLOWEST in (5, 7, 6):
        if profile0.SLOWEST != 6:
            yield ('profile_0_slowest_%d' % profile0.SLOWEST, 'models of another rate', '6.2',
                   profile0.stream_of(points, tets, fields))


def write_profile_0():
    notes = {}
    for name, feature, clause, data in profile_0():
        with open(os.path.join(HERE, 'valid', name + '.tetlod'), 'wb') as file:
            file.write(data)
        notes[name] = {'feature': feature, 'clause': clause}
    return notes


ONE_SERIES = np.array([(1, 2, 3, 5), (1.5, 2.5, 3.5, 5.5), (1.5, 2.75, 3.5, 6)], 'f4')  # values of T at each step


def write_series(program, folder):
    """One tetrahedron at three steps, in a band of 10 % and exactly."""
    names = [os.path.join(folder, 'step_%d.vtu' % number) for number in range(len(ONE_SERIES))]
    for name, values in zip(names, ONE_SERIES):
        write_vtu(name, np.eye(4, 3, -1), np.array([(0, 1, 2, 3)]), {'T': values}, {})
    path = os.path.join(HERE, 'valid', 'series_one.tetlod')
    subprocess.run([program, 'build', *names, '--bands', '10%', '--carry', 'T', '-o', path, '--quiet'], check=True)
    return {'series_one': {'feature': 'a series: one tetrahedron, three steps', 'clause': '3.7'}}


def write_streams(program):
    notes = write_profile_0()
    with tempfile.TemporaryDirectory() as folder:
        notes.update(write_series(program, folder))
    with tempfile.TemporaryDirectory() as folder:
        mesh = os.path.join(folder, 'mesh.vtu')
        for name, feature, clause, points, tets, fields, cells, options in listed():
            write_vtu(mesh, points, tets, fields, cells)
            path = os.path.join(HERE, 'valid', name + '.tetlod')
            subprocess.run([program, 'build', mesh, '-o', path, '--quiet', *options], check=True)
            notes[name] = {'feature': feature, 'clause': clause}
    base = open(os.path.join(HERE, 'valid', 'field_float32.tetlod'), 'rb').read()
    other = make_invalid.section(plain(base), b'XABC', 0, content=b'unknown', unpacked=7)
    write = {'section_unknown': (other, 'a section that is not known', '3.5'),
             'index_plain': (plain(base), 'an index that is not packed', '3.2'),
             'header_optional': (sealed(base[:16] + b'\1\0\0\0' + base[20:]), 'an unknown optional feature', '3.1'),
             'minor_version': (sealed(base[:10] + b'\7\0' + base[12:]), 'a later minor version', '11'),
             'paged_deep': (make_invalid.deepened(61), 'levels in pages: pages behind 64 cuts', '7.6')}
    for name, (data, feature, clause) in write.items():
        with open(os.path.join(HERE, 'valid', name + '.tetlod'), 'wb') as file:
            file.write(data)
        notes[name] = {'feature': feature, 'clause': clause}
    return notes


EXPECTED = os.path.join(HERE, 'expected.json')
GOLDEN = os.path.join(ROOT, 'tests', 'golden')


def may_be_taken(name, when):
    """By a reader that does not look at what is wrong."""
    seen_by_some = name in ('coder_start', 'paged_unsaid', 'paged_leaves')
    return seen_by_some or (name.startswith('original_') and when == 'decode')


def clause_of(name):
    """The clause of SPEC.md that refuses an invalid stream."""
    return next(clause for start, clause in CLAUSES if name.startswith(start))


CLAUSES = [
    ('parents_steps', '3.7'),
    *((name, '3.5') for name in ('cells_early', 'time_early', 'time_twice', 'cell_steps_early', 'cell_steps_twice',
                                 'topologies_alone', 'topologies_twice', 'parents_and_cells', 'parents_twice',
                                 'parents_early', 'original_early', 'original_twice')),
    ('magic', '3.1'), ('old_layout', '3.1'), ('newer_major', '3.1'), ('required_feature', '3.1'), ('reserved', '3.1'),
    ('header_check', '3.1'), ('content_id', '3.1'), ('too_long', '3'), ('truncated', '3'), ('packed_rest', '6.4'),
    ('no_tetrahedra', '3.2'), ('many_vertices', '3.2'), ('slowest', '3.2'), ('bounds', '3.2'), ('levels_shrink', '3.4'),
    ('domain_error', '3.4'), ('error_negative', '3.4'), ('error_grows', '3.4'), ('frame_size', '3.1'),
    ('expansion', '2.3'), ('two_names', '3.3'), ('name_long', '3.3'), ('section_', '3.5'), ('cells_', '3.6'),
    ('frame_digest', '3.1'), ('frame_random', '7.5'), ('frame_zero', '5.1'), ('coder_start', '6.4'),
    ('coder_quotient', '6.3'), ('tail_', '9.3'), ('time_', '3.7'), ('cell_steps_', '3.7'), ('topologies_', '3.8'),
    ('parents_', '3.6'), ('paged_', '7.6'), ('original_', '10.1')]


def golden_notes():
    """The streams of tests/golden, whose table is in SPEC.md, 17."""
    for name in sorted(os.listdir(GOLDEN)):
        if name.endswith('.tetlod'):
            yield '../../tests/golden/' + name, {'feature': 'SPEC.md, 17: ' + name[:-7], 'clause': '17'}


def expected(known):
    """The text of expected.json for the streams of valid/ that are known by their notes, and those of tests/golden."""
    known = {**known, **dict(golden_notes())}
    valid = [{'stream': stream, 'feature': note['feature'], 'clause': note['clause'],
              'answer': reference_reader.answer(os.path.join(HERE, stream))} for stream, note in sorted(known.items())]
    with open(os.path.join(GOLDEN, 'invalid', 'verdicts.txt')) as file:
        verdicts = [line.split(' ', 2) for line in file.read().splitlines()]
    invalid = [{'stream': '../../tests/golden/invalid/%s.tetlod' % name, 'refused': when, 'why': why,
                'clause': clause_of(name), **({'validator': True} if may_be_taken(name, when) else {})}
               for name, when, why in verdicts]
    rows = [',\n'.join(json.dumps(entry, ensure_ascii=False) for entry in entries) for entries in (valid, invalid)]
    return '{"valid": [\n%s\n], "invalid": [\n%s\n]}\n' % tuple(rows)


def noted():
    """What expected.json has for the streams of valid/."""
    with open(EXPECTED, encoding='utf-8') as file:
        return {entry['stream']: entry for entry in json.load(file)['valid'] if entry['stream'].startswith('valid/')}


def copy_kit(folder):
    """Streams of tests/golden become streams of the folder."""
    with open(EXPECTED, encoding='utf-8') as file:
        text = file.read()
    for stream in (entry['stream'] for kind in json.loads(text).values() for entry in kind):
        place = os.path.join(folder, stream.replace('../../tests/golden/', 'golden/'))
        os.makedirs(os.path.dirname(place), exist_ok=True)
        shutil.copyfile(os.path.join(HERE, stream), place)
    for name in ('run', 'README.md', 'answers.py'):
        shutil.copy(os.path.join(HERE, name), folder)
    with open(os.path.join(folder, 'expected.json'), 'w', encoding='utf-8') as file:
        file.write(text.replace('../../tests/golden/', 'golden/'))


def main():
    if sys.argv[1:2] == ['--copy']:
        return copy_kit(sys.argv[2])
    if sys.argv[1:2] == ['--streams']:
        made = write_streams(os.path.abspath(sys.argv[2]))
        known = {'valid/%s.tetlod' % name: note for name, note in made.items()}
    else:
        known = noted()
    text = expected(known)
    with open(EXPECTED, 'w', encoding='utf-8') as file:
        file.write(text)


if __name__ == '__main__':
    main()
