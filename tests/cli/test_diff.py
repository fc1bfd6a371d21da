#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""`tetlod diff`: PAIRS pairs with known differences, bodies, seams, domains, series, URLs, tolerance files."""
import json
import os
import sys

import numpy as np

sys.path.insert(0, os.path.join(os.environ.get('ROOT', '.'), 'tests'))
import common
from common import SANITIZED, Host, fails, finish, must, note, path, read_grid, report, write

PAIRS = int(os.environ.get('PAIRS', '15' if common.CONFIG == 'release' else '5'))  # the sanitizers are slow
FACTORS = (0.9, 1.1) if SANITIZED else (0.5, 0.9, 1.1, 2)


def write_mesh(name, points, tets, fields):
    import vtk
    from meshes import vtk_mesh
    writer = vtk.vtkXMLUnstructuredGridWriter()
    writer.SetFileName(path(name))
    writer.SetInputData(vtk_mesh(points, tets, fields, {}))
    writer.Write()


def diff(*arguments):
    """Exit status and answer."""
    done = common.tetlod('diff', *arguments, '--json')
    if done.returncode not in (0, 4, 5):
        raise RuntimeError('%s: %s' % (' '.join(arguments), done.stderr.decode()))
    return done.returncode, json.loads(done.stdout)


class Tally:
    """What was wrong, how often a bound of half the width would have been, and limits that were decided."""

    def __init__(self):
        self.wrong, self.asked, self.halved, self.decided = [], 0, 0, 0


def check_interval(tally, what, bounds, truth, slack):
    tally.asked += 1
    low, high = bounds['lower'], bounds['upper']
    if not low - slack <= truth <= high + slack:
        tally.wrong.append((what, bounds, truth))
    tally.halved += abs(truth - (low + high) / 2) > (high - low) / 4 + slack


def check_pair(tally, name, pair, files):
    truth = {'max': pair.largest, 'rms': pair.rms}
    for norm, value in truth.items():
        for factor in FACTORS:
            code, found = diff(*files, '--field', 'f', '--limit', repr(float(value * factor)), '--norm', norm)
            wanted = 'within' if factor > 1 else 'beyond'
            slack = 1e-9 * (found['range'][1] - found['range'][0])
            if code != {'within': 0, 'beyond': 4, 'undecided': 5}[found['verdict']] or \
                    found['verdict'] not in (wanted, 'undecided'):
                tally.wrong.append((name, norm, factor, code, found['verdict']))
            if found['rms']['upper'] > found['max']['upper'] * (1 + 1e-9) + slack:
                tally.wrong.append((name, 'a mean above the largest', found['rms'], found['max']))
            tally.decided += found['verdict'] == wanted
            for one in truth:
                check_interval(tally, (name, norm, factor, one), found[one], truth[one], slack)
    for within in ('50%', '1%'):
        _, found = diff(*files, '--field', 'f', '--within', within)
        for one in truth:
            check_interval(tally, (name, within, one), found[one], truth[one], 1e-9 * np.ptp(found['range']))


def known_pairs():
    import diff_judge
    tally = Tally()
    kinds = (diff_judge.hat, diff_judge.linear, diff_judge.hat, diff_judge.unrelated)
    for number in range(PAIRS):
        random = np.random.default_rng(number)
        pair = kinds[number % len(kinds)](random)
        files = []
        for m, (points, tets, values) in enumerate(pair.meshes):
            write_mesh('pair%d.vtu' % m, points, tets, {'f': values})
            if number % 3 < 2 or m == 0:  # the second one is a file of a mesh every third time
                must('build', path('pair%d.vtu' % m), '-o', path('pair%d.tetlod' % m), '--quiet',
                     *(('--local-bound',) if number % 5 == 4 else ()))
                files.append(path('pair%d.tetlod' % m))
            else:
                files.append(path('pair%d.vtu' % m))
        check_pair(tally, 'pair %d' % number, pair, files)
    report('%d pairs, %d intervals hold what is true' % (PAIRS, tally.asked), not tally.wrong, tally.wrong[:3])
    report('all limits are decided', tally.decided == 2 * len(FACTORS) * PAIRS, tally.decided)
    report('intervals of half the width would miss', tally.halved * 100 >= tally.asked, (tally.halved, tally.asked))


def read_ring(name):
    grid = read_grid(name)
    from vtk.util.numpy_support import vtk_to_numpy
    return (vtk_to_numpy(grid.GetPoints().GetData()).astype(float),
            vtk_to_numpy(grid.GetCells().GetConnectivityArray()).reshape(-1, 4),
            vtk_to_numpy(grid.GetPointData().GetArray(0)).astype(float))


def moved_boundaries():
    """The same results where levels have moved their boundary: a hat of known height on a ring."""
    import diff_judge
    tally = Tally()
    must('sample', 'torus', '--size', '6', '-o', path('torus.vtu'))
    base = read_ring('torus.vtu')
    for seed in range(1 if SANITIZED else 2 + PAIRS // 20):
        pair = diff_judge.hat(np.random.default_rng(seed), base)
        for m, (points, tets, values) in enumerate(pair.meshes):
            write_mesh('ring%d.vtu' % m, points, tets, {'f': values})
            must('build', path('ring%d.vtu' % m), '-o', path('ring%d.tetlod' % m), '--summary', '--quiet',
                 '--domain-error', '0.01')
        check_pair(tally, 'ring %d' % seed, pair, [path('ring0.tetlod'), path('ring1.tetlod')])
        code, found = diff(path('ring0.tetlod'), path('ring1.tetlod'), '--field', 'f', '--limit',
                           repr(0.1 * pair.largest))
        if code != 4:
            tally.wrong.append(('ring %d' % seed, found))
    report('rings: %d intervals hold what is true' % tally.asked, not tally.wrong, tally.wrong[:3])
    step = [values + (np.arange(len(values)) >= 0) * 0.5 * np.ptp(values) for _, _, values in pair.meshes[:1]][0]
    write_mesh('ring1.vtu', *pair.meshes[0][:2], {'f': step})
    must('build', path('ring1.vtu'), '-o', path('ring1.tetlod'), '--summary', '--quiet', '--domain-error', '0.01')
    code, found = diff(path('ring0.tetlod'), path('ring1.tetlod'), '--field', 'f', '--limit', '10%')
    report('a level whose boundary has moved shows what is beyond the limit',
           code == 4 and found['swept'] > 0 and found['first']['bytes'] < 0.7 * found['first']['of_bytes'], found)
    beyond_rims()


def beyond_rims():
    """The largest difference is where a level's boundary has left the original, or where the original is not."""
    from kuhn_grid import kuhn
    points, tets, _ = read_ring('torus.vtu')
    write_mesh('flat.vtu', points, tets, {'f': 1e-3 * points[:, 2]})
    must('build', path('flat.vtu'), '-o', path('flat.tetlod'), '--domain-error', '0.02', '--quiet')
    points, tets = kuhn(9, np.random.default_rng(5))
    points = 6 * points - 3
    radius = np.hypot(points[:, 0], points[:, 1])
    tally, coarse = Tally(), 0
    factors = (0.9, 1.1) if SANITIZED else (0.5, 0.9, 0.97, 0.99, 0.999, 1.001, 1.01, 1.03, 1.1, 2)
    for name, values in (('outside', radius), ('inside', 4 - radius)):
        write_mesh('steep.vtu', points, tets, {'f': values})
        truth = diff(path('steep.vtu'), path('flat.vtu'), '--field', 'f', '--within', '0')[1]['max']
        for factor in factors:
            code, found = diff(path('steep.vtu'), path('flat.tetlod'), '--field', 'f', '--limit',
                               repr(factor * truth['upper']))
            coarse += found['swept'] > 0
            for end in truth.values():
                check_interval(tally, (name, factor), found['max'], end, 1e-6)
            if code != (4 if factor < 1 else 0):
                tally.wrong.append((name, factor, code, found))
    report('where a boundary has moved, nothing wrong is said of the places it has left', not tally.wrong,
           tally.wrong[:3])
    report('and such levels decide', coarse > len(factors) // 2, coarse)


def wavy_bodies(n):
    """Two bodies that touch along a curved face, which a mesh of n cells has as n pieces; the field jumps there."""
    from kuhn_grid import kuhn
    points, tets = kuhn(2 * n, np.random.default_rng(3))
    points[:] = np.round(points * 2 * n) / (2 * n)  # without its unevenness
    upper = points[tets][:, :, 2].mean(axis=1) > 0.5
    points[:, 2] += 0.1 * np.sin(7 * points[:, 0]) * np.minimum(points[:, 2], 1 - points[:, 2])
    second = tets[upper]
    used = np.unique(second)
    number = np.full(len(points), -1)
    number[used] = len(points) + np.arange(len(used))
    both = np.concatenate([tets[~upper], number[second]])
    places = np.concatenate([points, points[used]])
    body = np.zeros(len(places))
    body[len(points):] = 1
    kept = np.unique(both)
    place = np.full(len(places), -1)
    place[kept] = np.arange(len(kept))
    return places[kept], place[both], 100 * body[kept] + places[kept][:, 0]


def slit(n, shift):
    """A cube cut open half way, with a jump across the cut, and points that rounding has moved by up to `shift`."""
    from kuhn_grid import kuhn
    points, tets = kuhn(2 * n, np.random.default_rng(3))
    points[:] = np.round(points * 2 * n) / (2 * n)
    right = points[tets][:, :, 0].mean(axis=1) > 0.5
    cut = np.where((points[:, 0] == 0.5) & (points[:, 1] > 0.5))[0]
    number = np.arange(len(points))
    number[cut] = len(points) + np.arange(len(cut))
    tets = np.where(right[:, None], number[tets], tets)
    places = np.concatenate([points, points[cut]])
    height = 10 * np.maximum(places[:, 1] - 0.5, 0)
    values = places[:, 2] + np.where(places[:, 0] > 0.5, height, 0)
    values[len(points):] = places[len(points):, 2] + height[len(points):]
    places = places + shift * np.random.default_rng(n).uniform(-1, 1, places.shape)
    return places, tets, values


def sheets():
    for m, n in enumerate((2, 3)):
        write_mesh('bodies%d.vtu' % m, *wavy_bodies(n)[:2], {'f': wavy_bodies(n)[2]})
    code, found = diff(path('bodies0.vtu'), path('bodies1.vtu'), '--field', 'f', '--limit', '1')
    report('bodies that touch are compared each with itself', code == 0 and found['apart'] > 0, found)
    for shift, wanted in ((0, (0,)), (1e-7, (0, 5))):
        for m, n in enumerate((1, 2)):
            points, tets, values = slit(n, shift)
            # right of the slit the two fields are the same only where the mesh has the ridge at y = 0.5
            write_mesh('slit%d.vtu' % m, points, tets, {'f': values})
        code, found = diff(path('slit0.vtu'), path('slit1.vtu'), '--field', 'f', '--limit', '2.6')
        report('a slit moved by %g: no sliver shows a difference' % shift,
               code in wanted and found['max']['lower'] < 2.6, (code, found))


def domains():
    """A cube and its left half: compared where both are; the volumes are said."""
    from kuhn_grid import kuhn
    points, tets = kuhn(4, np.random.default_rng(1))
    write_mesh('cube.vtu', points, tets, {'f': points[:, 0], 'v': points})
    points = points * [0.5, 1, 1]
    write_mesh('half.vtu', points, tets, {'f': points[:, 0] + 0.25, 'v': points + [0, 0, 0.5]})
    code, found = diff(path('cube.vtu'), path('half.vtu'), '--field', 'f', '--limit', '0.3')
    report('domains that differ are compared on their overlap', code == 0 and
           np.allclose([found['overlap'], *found['volumes'], found['max']['lower'], found['rms']['upper']],
                       [0.5, 1, 0.5, 0.25, 0.25]), found)
    said = common.tetlod('diff', path('cube.vtu'), path('half.vtu'), '--field', 'f').stdout
    report('and this is said', b"50.0000 % of the first's volume, 100.0000 % of the second's" in said, said)
    for field, wanted in (('v', 0.5), ('v:2', 0.5), ('v:0', 0)):
        found = diff(path('cube.vtu'), path('half.vtu'), '--field', field)[1]
        report('%s differs by %g' % (field, wanted), abs(found['max']['upper'] - wanted) < 1e-9 and
               abs(found['rms']['lower'] - wanted) < 1e-6, found)
    points, tets = kuhn(4, np.random.default_rng(1))
    middles = points[tets].mean(axis=1)
    arms = tets[(abs(middles[:, 0] - 0.5) > 0.25) | (middles[:, 1] < 0.25)]
    write_mesh('arms.vtu', points, arms, {'f': points[:, 0]})
    coarse = kuhn(1, np.random.default_rng(1))
    write_mesh('coarse.vtu', *coarse, {'f': coarse[0][:, 0]})
    found = diff(path('coarse.vtu'), path('arms.vtu'), '--field', 'f', '--limit', '0.001')[1]
    report('a tetrahedron that reaches across a gap is compared on both sides', found['verdict'] == 'within' and
           abs(found['overlap'] - found['volumes'][1]) < 1e-9, found)
    write_mesh('far.vtu', points + 7, tets, {'f': points[:, 0]})
    fails('meshes that do not overlap', 3, ('do not overlap',), 'diff', path('cube.vtu'), path('far.vtu'),
          '--field', 'f')


def other_orders():
    """One mesh in two orders is compared vertex by vertex: exactly, and alike bodies that touch each with itself."""
    from kuhn_grid import kuhn
    random = np.random.default_rng(5)
    points, tets = kuhn(5, random)
    points, tets = np.concatenate([points, points + [1, 0, 0]]), np.concatenate([tets, tets + len(points)])
    points[tets[-1][0]] = points[tets[-1][1]]  # tetrahedra at this edge are flat, as at the axis of a grid
    field = random.random(len(points))
    vertices, order = random.permutation(len(points)), random.permutation(len(tets))
    number = np.argsort(vertices)  # of each old vertex, the new one
    other = number[tets[order]][:, [1, 2, 0, 3]]
    write_mesh('bodies.vtu', points, tets, {'f': field})
    must('build', path('bodies.vtu'), '-o', path('bodies.tetlod'), '--quiet')
    for name, shift, goal in (('another order', 0, '--limit'), ('and other values', 0.25, '--within')):
        values = field[vertices] + shift * (np.arange(len(points)) == 7)
        write_mesh('shuffled.vtu', points[vertices], other, {'f': values})
        for first in 'bodies.vtu', 'bodies.tetlod':
            code, found = diff(path(first), path('shuffled.vtu'), '--field', 'f', goal, '0')
            largest = np.abs(values - field[vertices]).max()
            report('%s of %s' % (name, first), code == 0 and list(found['max'].values()) == [largest, largest], found)
    code, found = diff(path('bodies.tetlod'), path('bodies.vtu'), '--field', 'f', '--limit', '0')
    report('a stream is what it was built of', code == 0 and found['max']['upper'] == 0, found)
    moved = points[vertices]
    moved[3, 0] = np.nextafter(moved[3, 0], 5)
    write_mesh('moved.vtu', moved, other, {'f': field[vertices]})
    code, found = diff(path('bodies.tetlod'), path('moved.vtu'), '--field', 'f', '--limit', '0')
    report('a vertex that has moved by one digit', code == 5 and 0 < found['max']['upper'] < 1e-6, found)


def written():
    """What -o writes: bounds of the difference in each tetrahedron."""
    from vtk.util.numpy_support import vtk_to_numpy
    must('diff', path('cube.vtu'), path('half.vtu'), '--field', 'f', '-o', path('d.vtu'))
    cells = read_grid('d.vtu').GetCellData()
    arrays = [vtk_to_numpy(cells.GetArray(name)) for name in
              ('difference', 'difference bound', 'difference least', 'covered', 'where')]
    mean, most, least, covered, where = arrays
    inside = covered > 0.999
    report('the difference is written with its bound', inside.sum() > 50 and (covered == 0).sum() > 50 and
           np.allclose(mean[inside], -0.25) and np.allclose(most[inside], 0.25) and (least <= most).all() and
           (where[covered > 0] == 1).all() and (where[covered == 0] == 0).all(), arrays)


def over_http():
    must('sample', 'cube', '--size', '16', '-o', path('big.vtu'))
    must('build', path('big.vtu'), '-o', path('big.tetlod'), '--quiet')
    grid_field = 'xyz'
    files = [path('big.tetlod'), path('big.vtu')]
    local = diff(*files, '--field', grid_field, '--limit', '30%')
    question = ('max(xyz) in box(1,1,1, 2,2,2) < 4096', '--json')
    with Host() as host:
        remote = diff(host.url + 'big.tetlod', files[1], '--field', grid_field, '--limit', '30%')
        answer = common.tetlod('ask', host.url + 'big.tetlod', *question).stdout
    report('a URL gives the same answer', local == remote, (local, remote))
    report('ask too', answer == common.tetlod('ask', files[0], *question).stdout, answer)
    fails('a host that is not there', 1, ('cannot be read',), 'ask', 'http://127.0.0.1:1/x.tetlod', 'volume()')


def limits():
    files = path('cube.vtu'), path('half.vtu')
    for text, code in (('f 0.3\n', 0), ('# none\n\nf 0.2 # beyond\nv 60% max\n', 4), ('"f" 26% rms\nv 0.6\n', 0),
                       ('v 0.6\nf 0.1 rms\n', 4)):
        status, found = diff(*files, '--limits', write('limits', text))
        report('%r ends with %d' % (text, code), status == code and
               found['verdict'] == {0: 'within', 4: 'beyond'}[code] and
               len(found['fields']) == text.count('\n') - text.count('# none') * 2, found)
    for text, words in (('f\n', ('line 1', "'p 2%'")), ('f 1\nf x\n', ('line 2',)), ('f 1 min\n', ('line 1',)),
                        ('', ('no limits',)), ('f 1 max 2\n', ('line 1',))):
        fails('refused: %r' % text, 1 if not text else 2, words, 'diff', *files, '--limits', write('limits', text))
    fails('a tolerance file that is missing', 1, ('cannot open',), 'diff', *files, '--limits', path('none'))


def refusals():
    files = path('cube.vtu'), path('half.vtu')
    for words, code, arguments in (
            (('--field NAME',), 2, ()), (('--field NAME',), 2, ('--field', 'f', '--limits', 'x')),
            (("no field 'g'",), 3, ('--field', 'g')), (('components 0 to 2',), 3, ('--field', 'v:3')),
            (('lengths of vectors',), 2, ('--field', 'v:mag')), (('2%',), 2, ('--field', 'f', '--limit', 'x')),
            (('max or rms',), 2, ('--field', 'f', '--norm', 'l1')),
            (('no steps in time',), 3, ('--field', 'f', '--step', '1'))):
        fails('refused: ' + ' '.join(arguments), code, words, 'diff', *files, *arguments)
    write_mesh('other.vtu', *[read_arrays('cube.vtu')[i] for i in (0, 1)], {'v': read_arrays('cube.vtu')[0][:, 0]})
    fails('other components', 3, ('3 components in the first, 1 in the second',), 'diff', files[0], path('other.vtu'),
          '--field', 'v')
    points, tets = read_arrays('cube.vtu')
    write_mesh('hole.vtu', points, tets, {'f': points[:, 0], 'hole': np.where(points[:, 0] > 0.5, np.nan, 1)})
    found = diff(path('hole.vtu'), path('hole.vtu'), '--field', 'f', '--limit', '1%')
    report('NaN in a field that is not compared is nothing to it', found[0] == 0, found)
    fails('NaN in one that is', 3, ('field hole', '--nan-fill of build'), 'diff', path('hole.vtu'), path('hole.vtu'),
          '--field', 'hole')


def read_arrays(name):
    from vtk.util.numpy_support import vtk_to_numpy
    grid = read_grid(name)
    return (vtk_to_numpy(grid.GetPoints().GetData()),
            vtk_to_numpy(grid.GetCells().GetConnectivityArray()).reshape(-1, 4))


def series():
    """A step against another one, and against its own mesh; questions of a step."""
    must('sample', 'wake', '--steps', '5', '--size', '6', '-o', path('wake.pvd'))
    must('build', path('wake.pvd'), '-o', path('wake.tetlod'), '--quiet')
    stream = path('wake.tetlod')
    same = diff(stream, stream, '--field', 'Pressure', '--step', '2', '--limit', '0')
    report('a step is the same as itself', same[0] == 0, same)
    found = diff(stream, path('wake_3.vtu'), '--field', 'Pressure', '--step', '3,0', '--limit', '1%')
    report('a step is its mesh', found[0] == 0, found)
    found = diff(stream, path('wake_3.vtu'), '--field', 'Pressure', '--time', '0.75', '--limit', '1%')
    report('a time is of the series where the other is the mesh of one', found[0] == 0, found)
    fails('a time of a mesh file that has several', 2, ('wake.pvd', 'by its number'), 'diff', stream,
          path('wake.pvd'), '--field', 'Pressure', '--time', '0.75')
    truth = np.abs(np.subtract(*(values_of('wake_%d.vtu' % i, 'Pressure') for i in (1, 3)))).max()
    for chosen in (('--step', '1,3'), ('--time', '0.26,0.74')):
        code, found = diff(stream, stream, '--field', 'Pressure', *chosen, '--within', '0')
        report('steps differ by what their meshes do: %s' % chosen[0],
               found['max']['lower'] - 1e-6 <= truth <= found['max']['upper'] + 1e-6 and
               np.ptp(list(found['max'].values())) < 1e-4, (found, truth))
    tally = Tally()
    for factor in (0.6, 0.8, 0.95, 1.05, 1.3):
        code, found = diff(stream, stream, '--field', 'Pressure', '--step', '1,3', '--limit', '%.9g' % (factor * truth))
        check_interval(tally, factor, found['max'], truth, 1e-6)
        if code != (0 if factor > 1 else 4):
            tally.wrong.append((factor, found))
    report('limits about the difference of steps, which share each level', not tally.wrong, tally.wrong[:2])
    values = [values_of('wake_%d.vtu' % i, 'Pressure') for i in range(5)]
    for step, within in ((0, '20%'), (3, '5%'), (4, '0')):
        asked = json.loads(must('ask', stream, 'max(Pressure)', '--step', str(step), '--within', within,
                                '--json').stdout)
        report('ask: the largest value of step %d within %s' % (step, within),
               asked['lower'] - 1e-6 <= values[step].max() <= asked['upper'] + 1e-6 and
               asked['time'] == step / 4, (asked, values[step].max()))
    fails('a step that there is not', 2, ('no step 9',), 'ask', stream, 'max(Pressure)', '--step', '9')
    fails('a time that there is not', 2, ('no time 7',), 'diff', stream, stream, '--field', 'Pressure', '--time', '7')


def values_of(name, field):
    from vtk.util.numpy_support import vtk_to_numpy
    return vtk_to_numpy(read_grid(name).GetPointData().GetArray(field)).astype(float)


def main():
    try:
        import vtk  # noqa: F401
    except ImportError:
        note('skipped: VTK for Python is not here')
        finish()
        return
    for part in (known_pairs, moved_boundaries, sheets, domains, other_orders, written, limits, refusals, series,
                 over_http):
        part()
    finish()


main()
