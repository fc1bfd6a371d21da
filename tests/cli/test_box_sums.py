#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""Sums by boxes and regions (section KSUM): what they answer without a level holds what the finest level answers of a
stream without them, and verify and the reference decoder refuse malformed and wrong sections."""
import json
import os
import struct
import sys

import numpy as np

sys.path.insert(0, os.path.join(os.environ.get('ROOT', '.'), 'tests'))
import common
from common import finish, must, path, report
from kuhn_grid import kuhn
from streams import plain, tetlod as reference, with_section

BOXES = int(os.environ.get('BOXES', '8'))


def write_mesh(name, n):
    """A mesh with a hole, a scalar, a vector and three materials, as VTU in text."""
    points, tets = kuhn(n, np.random.default_rng(3))
    middle = points[tets].mean(axis=1)
    tets = tets[np.linalg.norm(middle - [0.7, 0.6, 0.5], axis=1) > 0.2]
    used, index = np.unique(tets, return_inverse=True)
    points, tets = points[used].astype('f4'), index.reshape(-1, 4)
    x, y, z = points.astype(float).T
    fields = {'heat': np.tanh(5 * (x + 0.3 * y - 0.6)) + 0.2 * np.sin(6 * z) - 0.4,
              'wind': np.column_stack([np.cos(4 * y), z * np.sin(4 * x), 0.5 - z])}
    middle = points[tets].mean(axis=1)
    material = np.where(middle[:, 2] > 0.5, 7, np.where(middle[:, 0] > 0.5, -2, 3))

    def array(name, values, kind, components=1):
        return '<DataArray type="%s" Name="%s" NumberOfComponents="%d" format="ascii">%s</DataArray>' % (
            kind, name, components, ' '.join('%.9g' % value for value in np.ravel(values)))

    data = ''.join(array(name, values, 'Float32', values.size // len(points)) for name, values in fields.items())
    with open(path(name), 'w') as file:
        file.write('<VTKFile type="UnstructuredGrid" version="0.1"><UnstructuredGrid><Piece NumberOfPoints="%d" '
                   'NumberOfCells="%d"><PointData>%s</PointData><CellData>%s</CellData><Points>%s</Points>'
                   '<Cells>%s%s%s</Cells></Piece></UnstructuredGrid></VTKFile>' % (
                       len(points), len(tets), data, array('material', material, 'Int32'),
                       array('Points', points, 'Float32', 3), array('connectivity', tets, 'Int32'),
                       array('offsets', 4 * np.arange(1, len(tets) + 1), 'Int32'),
                       array('types', np.full(len(tets), 10), 'UInt8')))


def ask(stream, question, within):
    done = common.tetlod('ask', path(stream), question, '--within', within, '--json')
    if done.returncode:
        raise RuntimeError('%s: %s' % (question, done.stderr.decode()))
    return json.loads(done.stdout)


def questions(where, number):
    for what in ('mean(heat)', 'integral(heat)', 'min(heat)', 'max(wind:1)', 'integral(wind:2)', 'volume()',
                 'volume(heat > %.17g)' % number, 'volume(heat <= %.17g)' % number):
        yield '%s %s' % (what, where)


def holds(kind, wheres):
    """Intervals of the first bytes against those of the finest level of the stream without sums."""
    wrong, misses, asked, exact = [], 0, 0, 0
    for where, number in wheres:
        for question in questions(where, number):
            early, truth = ask('sums.tetlod', question, '1e9'), ask('none.tetlod', question, '0')
            middle, half = (early['lower'] + early['upper']) / 2, (early['upper'] - early['lower']) / 4
            slack = 1e-9 * (1 + abs(truth['lower']))
            asked += 'level' not in early
            exact += 'level' not in early and 4 * half <= 1e-6 * (1 + abs(middle))
            misses += abs(truth['lower'] - middle) > half + slack
            if not early['lower'] - slack <= truth['lower'] <= truth['upper'] <= early['upper'] + slack:
                wrong.append((question, early, truth))
    report('%s: %d answers of the first bytes hold the finest level\'s' % (kind, asked), not wrong, wrong[:2])
    return asked, misses, exact


def boxes():
    random = np.random.default_rng(11)
    for _ in range(BOXES):
        ends = np.sort(random.uniform(-0.1, 1.1, (2, 3)), axis=0)
        ends[1] = np.maximum(ends[1], ends[0] + 0.4)
        yield 'in box(%s)' % ','.join('%.17g' % x for x in ends.ravel()), random.uniform(-1, 0.5)


def tree(data):
    """The reference decoder's tree: its figures of a box are those of the finest level there."""
    sums = reference.open(data).box_sums()
    low, high, depth = sums['box'][0].copy(), sums['box'][1].copy(), sums['depth']
    for axis in range(3):  # the last box of the depth three
        split, node = low.copy(), (1 << (axis + 1)) - 1
        split[axis] = low[axis] + sums['splits'][node - 1] / 256 * (high[axis] - low[axis])
        low = split
    where = 'in box(%s)' % ','.join('%.17g' % x for x in (*low, *high))
    share = np.prod([1 - sums['parts'][(1 << (d + 1)) - 2] for d in range(3)])
    volume = ask('none.tetlod', 'volume() ' + where, '0')['lower']
    report('a node has the part of the volume that it says', abs(share * sums['volume'] - volume) <=
           3e-5 * sums['volume'], (share * sums['volume'], volume))
    rows = sums['boxes']['heat', 0][-(len(sums['boxes']['heat', 0]) // 8):]
    ends = [ask('none.tetlod', '%s(heat) %s' % (what, where), '0')['lower'] for what in ('min', 'max')]
    step = 1.01 / 255 * np.ptp(sums['boxes']['heat', 0][:, :2])
    report('bounds of boxes are next to the values', rows[:, 0].min() <= ends[0] <= rows[:, 0].min() + step and
           rows[:, 1].max() - step <= ends[1] <= rows[:, 1].max(), (rows, ends))
    regions = {number: of['volume'] for number, of in sums['regions'].items()}
    report('regions are there', sorted(regions) == [-2, 3, 7] and
           abs(sum(regions.values()) - sums['volume']) <= 1e-9 * sums['volume'], regions)
    return sums


def nodes(sums):
    """The part of a node's volume that is in its first child is rounded: boxes of nodes have an interval, too."""
    boxes = {1: sums['box'].copy()}
    for node in range(2, 16):
        axis, share = (node.bit_length() - 2) % 3, sums['splits'][node // 2 - 1] / 256
        low, high = boxes[node // 2][:, axis]
        boxes[node] = boxes[node // 2].copy()
        boxes[node][0 if node % 2 else 1, axis] = (1 - share) * low + share * high
    wrong = []
    for node in range(8, 16):
        where = 'volume() in box(%s)' % ','.join('%.17g' % x for x in boxes[node].ravel())
        early, truth = ask('sums.tetlod', where, '1e9'), ask('none.tetlod', where, '0')
        if not early['lower'] <= truth['upper'] <= early['upper'] * (1 + 1e-12) or 'level' in early:
            wrong.append((where, early, truth))
    report('the volume of a node\'s box is in its interval', not wrong, wrong[:2])


def sizes(data):
    stream = reference.open(data)
    both = {tag: len(stream.section(tag)) for tag in ('SUMS', 'KSUM')}
    report('sums take at most 5 kB a field', sum(both.values()) <= 5000 * len(stream.fields) + 4 * len(stream.levels),
           both)
    sections = sum(section['stored'] for section in stream.sections if section['tag'] in both)
    report('and 1 % of a stream of 1 MB', sections <= 10486, sections)
    report('there are 8^3 boxes', stream.box_sums()['depth'] == 9 or stream.tets < 16 << 9, stream.tets)


def refused(data):
    try:
        reference.open(data).box_sums()
    except ValueError:
        return True
    return False


def forged(whole, sums):
    """Malformed sections, and sections with other figures than the finest level."""
    section, components = bytes(reference.open(whole).section('KSUM')), 4
    tree_at = 64 + components
    inner = (1 << sums['depth']) - 1
    rows_at = tree_at + 3 * inner
    regions_at = len(section) - 3 * (16 + 24 * components)

    def put(at, form, value):
        packed = struct.pack('<' + form, value)
        return section[:at] + packed + section[at + len(packed):]

    half = struct.unpack_from('<H', section, tree_at + inner)[0]
    mean_at = rows_at + 16 + 2 * (1 << section[64])
    mean = struct.unpack_from('<H', section, mean_at)[0]
    least = section[rows_at + 16]
    for name, other, malformed in (
            ('a byte more', section + b'x', True), ('a byte less', section[:-1], True),
            ('a depth of 13', put(4, 'H', 13), True),
            ('other components', put(0, 'I', 3), True),
            ('a component that is deeper than the tree', put(64, 'B', 12), True),
            ('a box that is turned around', put(8, 'd', 9.0), True),
            ('a volume that is none', put(56, 'd', float('nan')), True),
            ('regions that do not rise', put(regions_at, 'd', 99.0), True),
            ('a range that is none', put(rows_at, 'd', 1e9), True),
            ('another volume', put(56, 'd', sums['volume'] * 1.001), False),
            ('another split', put(tree_at, 'B', section[tree_at] ^ 16), False),
            ('another part', put(tree_at + inner, 'H', half ^ 64), False),
            ('another mean', put(mean_at, 'H', mean ^ 1024), False),
            ('a bound further in', put(rows_at + 16, 'B', least + 1), False),
            ('another volume of a region', put(regions_at + 8, 'd', 1e-3), False),
            ('another number of a region', put(regions_at, 'd', -3.0), False),
            ('another integral of a region', put(len(section) - 8, 'd', 1e-3), False)):
        data = with_section(plain(whole), 'KSUM', other)
        with open(path('forged.tetlod'), 'wb') as file:
            file.write(data)
        done = common.tetlod('verify', path('forged.tetlod'))
        report('verify refuses ' + name, done.returncode == 3 and b'KSUM' in done.stderr, done)
        if malformed:
            report('the reference decoder refuses ' + name, refused(data))


def main():
    write_mesh('mesh.vtu', 12)
    options = ('--region', 'material', '--quiet')
    must('build', path('mesh.vtu'), '-o', path('sums.tetlod'), '--summary', *options)
    must('build', path('mesh.vtu'), '-o', path('none.tetlod'), *options)
    with open(path('sums.tetlod'), 'rb') as file:
        data = file.read()
    done = common.tetlod('verify', path('sums.tetlod'))
    report('verify accepts the sums', done.returncode == 0, done)
    asked, misses, _ = holds('boxes', boxes())
    report('most answers come from the first bytes', asked >= 8 * BOXES * 0.7, asked)
    report('intervals of half the width would miss', misses >= asked // 20, misses)
    regions = [('over region %d' % number, level) for number in (-2, 3, 7) for level in (-9.0, 0.0, 9.0)]
    asked, _, exact = holds('regions', regions)
    report('sums of regions are exact', exact == asked >= 9 * 6, (exact, asked))
    everything = ask('sums.tetlod', 'integral(heat) in box(-9,-9,-9, 9,9,9)', '1e9')
    report('all boxes together are narrow', everything['upper'] - everything['lower'] <= 1e-3, everything)
    sums = tree(data)
    nodes(sums)
    sizes(data)
    forged(data, sums)
    finish()


main()
