#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""`tetlod ask`: intervals against the original's own answers, which are worked out here from its tetrahedra.

ANSWERS=1 asks about twenty questions of ten meshes, each at twenty widths, so from about as many levels."""
import itertools
import json
import os
import struct
import sys

import numpy as np

sys.path.insert(0, os.path.join(os.environ.get('ROOT', '.'), 'tests'))
import common
from common import SANITIZED, fails, finish, must, note, path, read_grid, report
from streams import plain, sealed, tetlod as reference, with_section

ALL = os.environ.get('ANSWERS') == '1'
WITHIN = ['%.3g%%' % (60 * 0.7 ** i) for i in range(19)] + ['0'] if ALL else ['20%', '1%', '0']


class Original:
    """What a question is about, computed without the program."""

    def __init__(self, name):
        from vtk.util.numpy_support import vtk_to_numpy
        grid = read_grid(name)
        self.points = vtk_to_numpy(grid.GetPoints().GetData()).astype(float)
        self.tets = vtk_to_numpy(grid.GetCells().GetConnectivityArray()).reshape(-1, 4)
        data = grid.GetPointData()
        arrays = [data.GetArray(i) for i in range(data.GetNumberOfArrays())]
        self.fields = {array.GetName(): vtk_to_numpy(array).astype(float) for array in arrays}
        material = grid.GetCellData().GetArray('material')
        self.regions = vtk_to_numpy(material) if material else None
        corners = self.points[self.tets]
        self.edges = corners[:, 1:] - corners[:, :1]
        self.volumes = np.abs(np.linalg.det(self.edges)) / 6

    def corner_values(self, name):
        return self.fields[name][self.tets]

    def above(self, values, t, volumes):
        """The volume where a linear function is above t: a cubic between each two of its corners' values."""
        a, b, c, d = np.sort(values, axis=1).T
        with np.errstate(divide='ignore', invalid='ignore'):
            low = (t - a) ** 3 / ((b - a) * (c - a) * (d - a))
            rest = (c - a + d - b) / ((c - b) * (d - b)) * (t - b) ** 3
            middle = ((b - a) ** 2 + 3 * (b - a) * (t - b) + 3 * (t - b) ** 2 - rest) / ((c - a) * (d - a))
            high = 1 - (d - t) ** 3 / ((d - a) * (d - b) * (d - c))
        below = np.select([t < a, t >= d, t <= b, t < c], [0, 1, low, middle], high)
        return float(((1 - below) * volumes).sum())

    def quantile(self, values, share):
        low, high = values.min(), values.max()
        for _ in range(60):
            middle = (low + high) / 2
            if self.volumes.sum() - self.above(values, middle, self.volumes) >= share * self.volumes.sum():
                high = middle
            else:
                low = middle
        return low

    def at(self, name, point):
        weights = np.linalg.solve(self.edges.transpose(0, 2, 1),
                                  (point - self.points[self.tets[:, 0]])[..., None])[..., 0]
        weights = np.column_stack([1 - weights.sum(axis=1), weights])
        inside = np.where(weights.min(axis=1) >= -1e-9)[0]
        return [np.tensordot(weights[t], self.fields[name][self.tets[t]], 1) for t in inside]

    def in_box(self, name, box, samples=600):
        """Points of the box with their values: what a mean lies between cannot be told from them, extremes can."""
        random = np.random.default_rng(7)
        places = box[0] + random.random((samples, 3)) * (np.array(box[1]) - box[0])
        return [value for p in places for value in self.at(name, p)[:1]]


def answer(stream, question, within):
    done = common.tetlod('ask', path(stream), question, '--within', within, '--json')
    if done.returncode:
        raise RuntimeError('%s: %s' % (question, done.stderr.decode()))
    return json.loads(done.stdout)


def questions(original, scalar, vector):
    """Questions with their true answers."""
    v, volumes = original.corner_values(scalar), original.volumes
    low, high = v.min(), v.max()
    yield 'volume()', volumes.sum()
    yield 'mean(%s)' % scalar, (v.mean(axis=1) * volumes).sum() / volumes.sum()
    yield 'integral(%s)' % scalar, (v.mean(axis=1) * volumes).sum()
    yield 'min(%s)' % scalar, low
    yield 'max(%s)' % scalar, high
    for share in (0.1, 0.5, 0.8):
        threshold = float(np.float32(low + share * (high - low)))
        above = original.above(v, threshold, volumes)
        yield 'volume(%s > %.17g)' % (scalar, threshold), above
        yield 'volume(%s <= %.17g)' % (scalar, threshold), volumes.sum() - above
        yield 'quantile(%s, %g)' % (scalar, share), original.quantile(v, share)
    box = original.points.min(axis=0), original.points.max(axis=0)
    for share in (0.21, 0.47, 0.83):
        place = box[0] + share * (box[1] - box[0])
        for value in original.at(scalar, place):
            yield '%s at (%s)' % (scalar, ','.join(map(repr, map(float, place)))), value
    if not vector:
        return
    w = original.fields[vector]
    yield 'max(|%s|)' % vector, np.sqrt((w ** 2).sum(axis=1)).max()
    yield 'mean(%s:1)' % vector, (original.corner_values(vector)[..., 1].mean(axis=1) * volumes).sum() / volumes.sum()
    if original.regions is not None:
        there = original.regions == 2
        yield 'mean(%s) over region 2' % scalar, (v.mean(axis=1) * volumes)[there].sum() / volumes[there].sum()
        yield 'volume() over region 2', volumes[there].sum()


def enclosed(name, original, stream, scalar, vector):
    missed, halved, asked, levels = [], 0, 0, set()
    for question, truth in questions(original, scalar, vector):
        for within in WITHIN:
            found = answer(stream, question, within)
            slack = 1e-6 * max(1e-3, abs(truth))  # of this judge: ties, float32 thresholds, bisection
            asked += 1
            levels.add(found.get('level'))
            if not found['lower'] - slack <= truth <= found['upper'] + slack:
                missed.append((question, within, truth, found))
            middle, half = (found['lower'] + found['upper']) / 2, (found['upper'] - found['lower']) / 4
            halved += abs(truth - middle) > half + slack
    report('%s: %d intervals of %d levels hold the original\'s answer' % (name, asked, len(levels)), not missed,
           missed[:3])
    return asked, halved


def box_answers(original, stream, scalar):
    """Extremes in a box against samples; sums of boxes against the whole; a box of everything is the whole."""
    low, high = original.points.min(axis=0), original.points.max(axis=0)
    box = low + 0.2 * (high - low), low + 0.65 * (high - low)
    text = 'box(%s)' % ', '.join(map(repr, map(float, itertools.chain(*box))))
    values = original.in_box(scalar, box)
    greatest, least = answer(stream, 'max(%s) in %s' % (scalar, text), '1%'), answer(stream,
                                                                                     'min(%s) in %s' % (scalar,
                                                                                                        text), '1%')
    report('extremes in a box enclose its samples', greatest['upper'] >= max(values) and least['lower'] <= min(values),
           (greatest, least))
    mean = answer(stream, 'mean(%s) in %s' % (scalar, text), '1%')
    sure = 6 * np.std(values) / np.sqrt(len(values))
    report('a mean in a box is that of its samples', mean['lower'] - sure <= np.mean(values) <= mean['upper'] + sure,
           (mean, np.mean(values)))
    middle = (low + high) / 2
    for what in ('integral(%s)' % scalar, 'volume(%s > %.17g)' % (scalar, float(np.median(values)))):
        whole, parts = answer(stream, what, '0'), 0
        for side in itertools.product((0, 1), repeat=3):
            corner = [(low[i], middle[i]) if s == 0 else (middle[i], high[i]) for i, s in enumerate(side)]
            text = 'box(%s)' % ', '.join(repr(float(corner[i][k])) for k in (0, 1) for i in (0, 1, 2))
            one = answer(stream, '%s in %s' % (what, text), '0')
            parts += (one['lower'] + one['upper']) / 2
        report('%s: eight boxes make the whole' % what, abs(parts - whole['lower']) <= 1e-9 * (1 + abs(parts)),
               (parts, whole))


def write_mesh(name, n, seed, material, is_round=False):
    import vtk
    from kuhn_grid import kuhn
    from meshes import vtk_mesh
    random = np.random.default_rng(seed)
    points, tets = kuhn(n, random)
    if is_round:  # each cube around the middle becomes nearly a sphere
        out = points - 0.5
        points = 0.5 + out * (np.abs(out).max(axis=1) / np.linalg.norm(out, axis=1))[:, None] ** 0.6
    points = points.astype(np.float32)
    x, y, z = points.astype(float).T
    heat = (np.tanh(6 * (x + 0.4 * y - 0.6)) + 0.3 * np.sin(7 * z)).astype(np.float32)
    heat[x < 0.2] = np.float32(-1.25)  # a plateau
    wind = np.column_stack([np.cos(4 * y), np.sin(4 * x) * z, 0.5 - z]).astype(np.float32)
    cells = {'material': np.where(points[tets][:, :, 2].mean(axis=1) > 0.5, 2, 1).astype(np.int32)} if material else {}
    writer = vtk.vtkXMLUnstructuredGridWriter()
    writer.SetFileName(path(name))
    writer.SetInputData(vtk_mesh(points, tets, {'heat': heat, 'wind': wind}, cells))
    writer.Write()


def swept(original, stream, scalar):
    """A level whose boundary has moved has another volume than the original; the interval allows for it. Sums of boxes,
    which would answer first, have a tag that no reader knows."""
    with open(path(stream), 'rb') as file:
        data = plain(file.read())
    stream = 'swept.tetlod'
    with open(path(stream), 'wb') as file:
        file.write(sealed(data.replace(b'KSUM', b'XSUM')))
    low, high = original.points.min(axis=0) - 1, original.points.max(axis=0) + 1
    everything = ' in box(%s)' % ', '.join(map(repr, map(float, itertools.chain(low, high))))
    volume, v = original.volumes.sum(), original.corner_values(scalar)
    coarse = answer(stream, 'volume()' + everything, '20%')
    off = abs((coarse['lower'] + coarse['upper']) / 2 - volume)
    report('%s: a coarse level has another volume, and its interval the original\'s' % stream,
           coarse['lower'] <= volume <= coarse['upper'] and
           off > 1e-5 * volume and coarse['bytes'] < coarse['of_bytes'] * 0.6, (coarse, volume))
    mean = answer(stream, 'mean(%s)' % scalar + everything, '10%')
    truth = (v.mean(axis=1) * original.volumes).sum() / volume
    report('%s: so has a mean' % stream, mean['lower'] <= truth <= mean['upper'] and mean['bytes'] < mean['of_bytes'],
           (mean, truth))
    exact = answer(stream, 'mean(%s)' % scalar, '0')
    report('%s: the sums answer exactly' % stream,
           abs(exact['lower'] - truth) <= 1e-9 * abs(truth) and 'level' not in exact, (exact, truth))


def mix():
    """A boundary that moves, regions, pages and rounded values in one stream. Sums of boxes and regions have a tag that
    no reader knows: levels answer. Without its finest level it says no extremes, and why."""
    write_mesh('round.vtu', 6, 3, True, True)
    must('build', path('round.vtu'), '-o', path('mixed.tetlod'), '--region', 'material', '--domain-error', '1%',
         '--paged=400', '--field-bits', '9', '--summary', '--field', 'heat', '--field', 'wind')
    with open(path('mixed.tetlod'), 'rb') as file:
        data = plain(file.read()).replace(b'KSUM', b'XSUM')
    with open(path('mixed.tetlod'), 'wb') as file:
        file.write(sealed(data))
    must('extract', path('mixed.tetlod'), '--error', '10%', '-o', path('coarse.tetlod'))
    fails('a coarse stream whose boundary has moved', 3, ('boundary', 'has moved', '--domain-error 0'), 'ask',
          path('coarse.tetlod'), 'max(|wind|)')
    must('build', path('plain.vtu'), '-o', path('whole.tetlod'), '--field', 'heat')
    must('extract', path('whole.tetlod'), '--error', '10%', '-o', path('free.tetlod'))
    fails('a field that no level certifies', 3, ('no level certifies wind', '--field wind'), 'ask',
          path('free.tetlod'), 'max(|wind|)')


SAMPLES = (('torus', '8', 'temperature', None), ('fin', '14', 'Pressure', 'Velocity'),
           ('post', '10', 'Pressure', 'Velocity'),
           ('shell', '8', 'temperature', None), ('delta', '6', 'potential', None), ('cube', '9', 'xyz', None))


def many_meshes(totals):
    """Samples, whose boundaries move in half of them."""
    for name, size, scalar, vector in SAMPLES:
        must('sample', name, '--size', size, '-o', path('many.vtu'))
        must('build', path('many.vtu'), '-o', path('many.tetlod'), '--summary', '--quiet', '--domain-error', '0.005')
        for i, n in enumerate(enclosed(name, Original('many.vtu'), 'many.tetlod', scalar, vector)):
            totals[i] += n


def distribution(original, stream, scalar):
    """Volumes below thresholds and quantiles come from the first bytes where they are narrow enough there."""
    with open(path(stream), 'rb') as file:
        data = file.read()
    sums, v = reference.open(data).sums(), original.corner_values(scalar)
    rows, volume = sums['distributions'][scalar, 0], original.volumes.sum()
    true = [volume - original.above(v, t, original.volumes) for t, _ in rows]
    report('%s: the distribution is exact' % stream, np.allclose(rows[:, 1], true, rtol=0, atol=1e-6 * volume),
           (rows, true))
    gaps = np.diff(np.concatenate([[0], rows[:, 1], [volume]])) / volume
    report('%s: no more than 3 %% of the volume lies between two thresholds' % stream, gaps.max() <= 0.03, gaps)
    extremes = [original.points[original.fields[scalar] == value].tolist() for value in (v.min(), v.max())]
    places = sums['places'][scalar, 0].tolist()
    report('%s: extremes have places' % stream, all(p in found for p, found in zip(places, extremes)), places)
    size, components = len(reference.open(data).section('SUMS')), len(sums['sums'])
    report('%s: the sums are small' % stream, size <= 850 * components + 4 * len(sums['swept']) + 20, size)
    early, missed = 0, []
    for share in np.linspace(0.02, 0.97, 9):
        t = float(np.float32(v.min() + share * (v.max() - v.min())))
        above, quantile = original.above(v, t, original.volumes), original.quantile(v, share)
        for question, truth in (('volume(%s > %.17g)' % (scalar, t), above),
                                ('volume(%s <= %.17g)' % (scalar, t), volume - above),
                                ('quantile(%s, %.17g)' % (scalar, share), quantile)):
            found = answer(stream, question, '5%')
            early += 'level' not in found
            if not found['lower'] - 1e-6 * abs(truth) <= truth <= found['upper'] + 1e-6 * abs(truth):
                missed.append((question, truth, found))
    report('%s: what the distribution says holds the truth' % stream, not missed and early >= 18, (early, missed))


def refuses_sums(data):
    try:
        reference.open(data).sums()
    except ValueError:
        return True
    return False


def patched(data, at, change):
    return data[:at] + struct.pack('<d', change(struct.unpack('<d', data[at:at + 8])[0])) + data[at + 8:]


def forged_sums():
    """verify holds the sums against the finest level, and refuses a section that is none."""
    with open(path('torus.tetlod'), 'rb') as file:
        stream = plain(file.read())
    sums = bytes(reference.open(stream).section('SUMS'))
    levels, components = struct.unpack('<II', sums[:8])
    end = 16 + 4 * levels + 16 * components  # of the integrals
    report('verify accepts the sums', common.tetlod('verify', path('torus.tetlod')).returncode == 0)
    for name, forged, word in (
            ('another volume', sums[:8] + struct.pack('<d', 1.0001 * struct.unpack('<d', sums[8:16])[0]) + sums[16:],
             b'volume'),
            ('another integral', patched(sums, end - 16, lambda value: value + 1), b'integrals'),
            ('another volume below a threshold', patched(sums, end + 60, lambda value: value * 0.999), b'in a volume'),
            ('a distribution that falls', patched(sums, end + 60, lambda value: 1e9), b'distribution'),
            ('another place of the least value', patched(sums, end + 4, lambda value: value + 1), b'is least where'),
            ('no thresholds', sums[:end] + bytes(4), b'trailing'),
            ('a part of the distributions', sums[:-8], b'trailing'),
            ('a swept volume that grows', sums[:16] + bytes(4) + sums[20:], b'swept'), ('a byte more', sums + b'x',
                                                                                        b'trailing')):
        with open(path('forged.tetlod'), 'wb') as file:
            file.write(with_section(stream, 'SUMS', forged))
        done = common.tetlod('verify', path('forged.tetlod'))
        report('verify refuses ' + name, done.returncode == 3 and word in done.stderr and b'SUMS' in done.stderr, done)
        if word in (b'distribution', b'trailing', b'swept'):
            with open(path('forged.tetlod'), 'rb') as file:
                report('the reference decoder refuses ' + name, refuses_sums(file.read()))


def predicates():
    for question, code, word in (('max(heat) < 5', 0, b'yes: '), ('max(heat) < 0', 4, b'no: '),
                                 ('mean(wind:0) >= -3', 0, b'yes: '),
                                 ('volume(heat > 9) > 0', 4, b'no: '), ('heat at (0.5,0.5,0.5) > -10', 0, b'yes: ')):
        done = common.tetlod('ask', path('plain.tetlod'), question)
        report('%s ends with %d' % (question, code), done.returncode == code and done.stdout.startswith(word), done)
    coarse = json.loads(must('ask', path('plain.tetlod'), 'max(heat) < 5', '--json').stdout)
    report('a predicate is decided by a coarse level',
           coarse['answer'] == 'yes' and coarse['bytes'] < coarse['of_bytes'] / 2, coarse)
    limit = answer('rounded.tetlod', 'mean(heat)', '0')
    done = common.tetlod('ask', path('rounded.tetlod'), 'mean(heat) < %.17g' % ((limit['lower'] + limit['upper']) / 2))
    report('what rounding leaves open is unknown', done.returncode == 5 and done.stdout.startswith(b'unknown: '), done)


def refusals():
    stream = path('plain.tetlod')
    for question, code, words in (
            ('gradient(heat)', 2, ('gradient', 'cannot be proved', 'slopes')),
            ('area(heat)', 2, ('cannot be proved', 'isosurfaces')),
            ('heat at (0x1,0,0)', 2, ('a number',)), ('mean(heat', 2, ('character 10', "')'")), ('median(heat)', 2,
                                                        ('functions are', 'quantile')), ('mean(cold)', 3,
                                                                                         ("no field 'cold'",)),
            ('mean(wind)', 3, ('3 components', '|wind|', 'wind:0')), ('mean(wind:3)', 3, ('components 0 to 2',)),
            ('quantile(heat, 2)', 2, ('fraction from 0 to 1',)), ('heat at (9,9,9)', 2, ('outside',)),
            ('mean(heat) in box(1,0,0, 0,1,1)', 2, ('least corner',)), ('mean(heat) in box(5,5,5, 6,6,6)', 2,
                                                                        ('holds nothing',)),
            ('mean(heat) over region 1', 3, ('--region',)), ('mean(heat) < ', 2, ('a number',)), ('mean(heat) 5', 2,
                                                                                                  ('the end',))):
        fails('refused: ' + question, code, words, 'ask', stream, question)
    for width in ('x%', '0x10', '5%%', '-1'):
        fails('a width that is none: ' + width, 2, ('--within',), 'ask', stream, 'mean(heat)', '--within', width)
    with open(stream, 'rb') as whole:
        data = whole.read()
    with open(path('cut.tetlod'), 'wb') as cut:
        cut.write(data[:len(data) * 2 // 3])
    done = common.tetlod('ask', path('cut.tetlod'), 'mean(heat)', '--within', '0')
    report('a file that is cut off answers by what is there', done.returncode == 0 and b'certified' in done.stdout,
           done)


def main():
    try:
        import vtk  # noqa: F401
    except ImportError:
        note('skipped: VTK for Python is not here')
        finish()
        return
    write_mesh('plain.vtu', 7, 1, False)
    write_mesh('parts.vtu', 6, 2, True)
    both = ('--field', 'heat', '--field', 'wind')
    must('build', path('plain.vtu'), '-o', path('plain.tetlod'), *both)
    must('build', path('plain.vtu'), '-o', path('local.tetlod'), '--local-bound', '--domain-error', '0', *both)
    must('build', path('plain.vtu'), '-o', path('rounded.tetlod'), '--field-bits', '10', *both)
    must('build', path('parts.vtu'), '-o', path('parts.tetlod'), '--region', 'material', *both)
    mix()
    totals = [0, 0]
    streams = ('plain', 'plain'), ('local', 'plain'), ('rounded', 'plain'), ('parts', 'parts'), ('mixed', 'round')
    for name, mesh in streams[3:] if SANITIZED else streams:  # regions and all that is mixed
        for i, n in enumerate(enclosed(name, Original(mesh + '.vtu'), name + '.tetlod', 'heat', 'wind')):
            totals[i] += n
    if ALL:
        many_meshes(totals)
    report('of %d intervals %d would miss if they were half as wide' % tuple(totals), totals[1] * 100 >= totals[0],
           totals)
    for name, scalar, size in (('torus', 'temperature', '6'), ('fin', 'Pressure', '12')):
        must('sample', name, '--size', size, '-o', path(name + '.vtu'))
        must('build', path(name + '.vtu'), '-o', path(name + '.tetlod'), '--summary')
        original = Original(name + '.vtu')
        if not SANITIZED:
            enclosed(name, original, name + '.tetlod', scalar, None)
        swept(original, name + '.tetlod', scalar)
        distribution(original, name + '.tetlod', scalar)
    box_answers(Original('plain.vtu'), 'plain.tetlod', 'heat')
    forged_sums()
    predicates()
    refusals()
    finish()


main()
