# SPDX-License-Identifier: BSD-3-Clause
"""Meshes that are finer in boxes, from the command line and from the server, before an independent judge."""
import os
import subprocess
import sys

import numpy as np

sys.path.insert(0, os.path.join(os.environ['ROOT'], 'tests', 'http'))
from region_judge import TRANSITION, COARSE, FINE, holders, judge, read_vtk, value_at  # noqa: E402
from served import SCRATCH, TETLOD, Server, run  # noqa: E402
from tap import SANITIZED  # noqa: E402


def tetlod(*arguments, code=0):
    done = subprocess.run([TETLOD, *map(str, arguments)], cwd=SCRATCH, stderr=subprocess.PIPE, text=True)
    assert done.returncode == code, done.stderr
    return done.stderr


def level(stream, *choice):
    tetlod('extract', stream, *choice, '-o', 'level.vtk', '--quiet')
    return read_vtk(os.path.join(SCRATCH, 'level.vtk'))


def random_box(fine, fraction, seed):
    random = np.random.default_rng(seed)
    low, high = fine['points'].min(0), fine['points'].max(0)
    size = (high - low) * fraction ** (1 / 3)
    at = fine['points'][random.integers(len(fine['points']))] - size / 2
    return np.concatenate([at, at + size])


def option(box):
    return '--box=' + ','.join('%.17g' % x for x in box)


def halves(boxes):
    return [(box[:3], box[3:]) for box in boxes]


def check_measured(answer, fine, name, said, seed):
    """No original vertex in the transition is further off than was measured."""
    transition = np.nonzero(answer['cell']['Region'][:, 0] == TRANSITION)[0]
    corners = answer['points'][answer['tets'][transition]]
    low, high = corners.min((0, 1)), corners.max((0, 1))
    near = np.nonzero(((fine['points'] >= low) & (fine['points'] <= high)).all(1))[0]
    chosen = np.random.default_rng(seed).permutation(near)[:500]
    worst = 0
    for v, t in zip(chosen, holders({'points': answer['points'], 'tets': answer['tets'][transition]},
                                    fine['points'][chosen])):
        if t >= 0:
            worst = max(worst,
                        abs(value_at(answer, transition[t], fine['points'][v], name)[0] - fine['point'][name][v, 0]))
    extent = fine['point'][name].max() - fine['point'][name].min()
    assert worst / extent <= said * (1 + 1e-4) + 1e-9, (worst / extent, said)
    return worst / extent


def measured(message, name):
    return float(message.split('transition between them:')[1].split(name + ' ')[1].split(' %')[0]) / 100


def check_stream(stream, name, error, fraction, seeds, domain_moves, fields=()):
    coarse, fine = level(stream, '--error', error), level(stream)
    parts = {COARSE: 0, FINE: 0, TRANSITION: 0}
    seen = 0
    for seed in seeds:
        box = random_box(fine, fraction, seed)
        message = tetlod('extract', stream, '--error', error, option(box), '-o', 'region.vtk')
        answer = read_vtk(os.path.join(SCRATCH, 'region.vtk'))
        for part, count in judge(answer, coarse, fine, halves([box]), seed, domain_moves).items():
            parts[part] += count
        seen = max(seen, check_measured(answer, fine, name, measured(message, name), seed))
        assert set(answer['point']) == {name, *fields}
    assert all(parts.values()) and seen > 0, (parts, seen)  # there was something to judge


def test_a_fixed_boundary():
    tetlod('sample', 'fin', '--size', '12' if SANITIZED else '18', '-o', 'fin.vtu')
    tetlod('build', 'fin.vtu', '-o', 'fixed.tetlod', '--carry', 'Pressure', '--domain-error', '0', '--quiet')
    check_stream('fixed.tetlod', 'Pressure', '5%', 0.004, range(3), False)


def test_a_boundary_that_moves():
    tetlod('sample', 'torus', '--size', '7' if SANITIZED else '10', '-o', 'torus.vtu')
    tetlod('build', 'torus.vtu', '-o', 'torus.tetlod', '--quiet')
    name = next(iter(level('torus.tetlod')['point']))
    check_stream('torus.tetlod', name, '5%', 0.01, range(3), True)


def test_lossy_and_several_fields():
    """The last level is a tail: it has other values than the one before, and no more vertices."""
    tetlod('build', 'fin.vtu', '-o', 'all.tetlod', '--quiet')
    check_stream('all.tetlod', 'Pressure', '3%', 0.01, range(2), True, ('Density', 'Velocity'))
    tetlod('build', 'fin.vtu', '-o', 'lossy.tetlod', '--carry', 'Pressure', '--field-bits', '14', '--position-bits',
           '16', '--quiet')
    coarse, fine = level('lossy.tetlod', '--error', '3%'), level('lossy.tetlod', '--error', '0.5%')
    box = random_box(fine, 0.02, 3)
    tetlod('extract', 'lossy.tetlod', '--error', '3%', '--box-error', '0.5%', option(box), '-o', 'region.vtk')
    judge(read_vtk(os.path.join(SCRATCH, 'region.vtk')), coarse, fine, halves([box]), 3, True)


def test_several_boxes_and_a_level_between():
    coarse, fine = level('fixed.tetlod', '--error', '10%'), level('fixed.tetlod', '--error', '0.5%')
    boxes = [random_box(fine, 0.002, seed) for seed in (7, 8, 9)]
    tetlod('extract', 'fixed.tetlod', '--error', '10%', '--box-error', '0.5%', *map(option, boxes), '-o', 'region.vtk')
    judge(read_vtk(os.path.join(SCRATCH, 'region.vtk')), coarse, fine, halves(boxes), 1, False)


def test_boxes_at_the_edges():
    coarse, fine = level('fixed.tetlod', '--error', '5%'), level('fixed.tetlod')
    for box in ([-100, -100, -100, 100, 100, 100], [50, 50, 50, 51, 51, 51], [*fine['points'][5], *fine['points'][5]]):
        tetlod('extract', 'fixed.tetlod', '--error', '5%', option(box), '-o', 'region.vtk')
        answer = read_vtk(os.path.join(SCRATCH, 'region.vtk'))
        judge(answer, coarse, fine, halves([np.array(box, float)]), 1, False)
        if box[0] == -100:
            assert len(answer['tets']) == len(fine['tets'])
        if box[0] == 50:
            assert len(answer['tets']) == len(coarse['tets'])


def check_bounds(answer, fine, name, component_count):
    """A local bound holds at the original's vertices, in all three parts; returns by part how far the field is off at
    most."""
    values, bounds = answer['point'][name], answer['point'][name + '%20bound'][:, 0]
    region = answer['cell']['Region'][:, 0]
    assert values.shape[1] == component_count
    corners = answer['points'][answer['tets']]
    low, high = corners.min(1), corners.max(1)
    inverse = np.linalg.inv((corners[:, 1:] - corners[:, :1]).transpose(0, 2, 1))
    most = {COARSE: 0, FINE: 0, TRANSITION: 0}
    for point, value in zip(fine['points'], fine['point'][name]):
        for t in np.nonzero(((low <= point) & (point <= high)).all(1))[0]:
            weights = inverse[t] @ (point - corners[t, 0])
            weights = np.append(1 - weights.sum(), weights)
            if weights.min() < -1e-9:
                continue
            error, bound = np.abs(weights @ values[answer['tets'][t]] -
                                  value).max(), weights @ bounds[answer['tets'][t]]
            assert error <= bound + 1e-6 * np.abs(fine['point'][name]).max(), (name, point, region[t], error, bound)
            most[region[t]] = max(most[region[t]], error)
    return most


def test_local_bounds():
    """Of several fields, one of them a vector: true in the transition, too, where vertices of several levels meet; and
    the server's are the same."""
    tetlod('build', 'fin.vtu', '-o', 'bounds.tetlod', '--field', 'Pressure', '--field', 'Velocity', '--local-bound',
           '--domain-error', '0', '--quiet')
    fine, off = level('bounds.tetlod'), 0
    for seed, fraction in enumerate((0.002, 0.01, 0.05)):
        box = random_box(fine, fraction, seed)
        tetlod('extract', 'bounds.tetlod', '--error', '10%', option(box), '--box-error', '0.1%', '-o', 'region.vtk')
        answer = read_vtk(os.path.join(SCRATCH, 'region.vtk'))
        for name, components in (('Pressure', 1), ('Velocity', 3)):
            off += check_bounds(answer, fine, name, components)[TRANSITION] > 0
    assert off > 3  # there was something to bound
    with Server(os.path.join(SCRATCH, 'bounds.tetlod')) as server:
        text = ','.join('%.17g' % x for x in box)
        head = server.get('/v1/meshes/bounds/mesh?error=0.1&box_error=0.001&format=vtk&box=' + text)[1]
        with open(os.path.join(SCRATCH, 'region.vtk'), 'rb') as file:
            assert file.read() == server.get('/v1/meshes/bounds/' + head['location'])[2]


def write_vtk(path, points, tets, fields, cells):
    with open(path, 'w') as out:
        out.write('# vtk DataFile Version 3.0\nx\nASCII\nDATASET UNSTRUCTURED_GRID\nPOINTS %d double\n' % len(points))
        np.savetxt(out, points, '%.17g')
        out.write('CELLS %d %d\n' % (len(tets), 5 * len(tets)))
        np.savetxt(out, np.insert(tets, 0, 4, axis=1), '%d')
        out.write('CELL_TYPES %d\n%s' % (len(tets), '10\n' * len(tets)))
        for where, count, values in ('POINT_DATA', len(points), fields), ('CELL_DATA', len(tets), cells):
            out.write('%s %d\n' % (where, count))
            for name, value in values.items():
                out.write('SCALARS %s double\nLOOKUP_TABLE default\n' % name)
                np.savetxt(out, value, '%.17g')


def test_bodies_that_overlap():
    """Two bodies in one place, with other values: the transition of each is compared with its own original."""
    one = level('fixed.tetlod')
    values = one['point']['Pressure'][:, 0]
    count, extent = len(values), np.ptp(one['points'], axis=0)
    write_vtk(os.path.join(SCRATCH, 'two.vtk'), np.vstack([one['points'], one['points'] + 0.01 * extent]),
              np.vstack([one['tets'], one['tets'] + count]), {'f': np.append(values, values + 0.04 * np.ptp(values))},
              {'Body': np.repeat([0.25, 0.75], len(one['tets']))})
    tetlod('build', 'two.vtk', '-o', 'two.tetlod', '--domain-error', '0', '--local-bound', '--quiet')
    fine = level('two.tetlod')
    for seed in range(3):
        box = random_box(fine, 0.01, seed)
        message = tetlod('extract', 'two.tetlod', '--error', '10%', option(box), '-o', 'region.vtk')
        answer, said, worst = read_vtk(os.path.join(SCRATCH, 'region.vtk')), measured(message, 'f'), 0
        for body in (0.25, 0.75):
            parts = [{'points': mesh['points'], 'tets': mesh['tets'][mesh['cell']['Body'][:, 0] == body],
                      'point': mesh['point'],
                      'cell': {name: cell[mesh['cell']['Body'][:, 0] == body]
                               for name, cell in mesh['cell'].items()}} for mesh in (answer, fine)]
            used = np.unique(parts[1]['tets'])
            parts[1]['points'], parts[1]['point'] = fine['points'][used], {'f': fine['point']['f'][used]}
            worst = max(worst, check_bounds(parts[0], parts[1], 'f', 1)[TRANSITION])
        assert worst / np.ptp(fine['point']['f']) <= said * (1 + 1e-9), (worst, said)


def test_usage():
    for wrong in (['--box', '1,2,3'], ['--box', '1,1,1,0,2,2'], ['--box', '0,0,0,1,1,nan'], ['--box-error', '1%'],
                  ['--box', '0,0,0,1,1,1', '--box-error', 'x']):
        assert 'box' in tetlod('extract', 'fixed.tetlod', '--error', '5%', *wrong, '-o', 'x.vtk', code=2)
    assert '--error' in tetlod('extract', 'fixed.tetlod', '--box', '0,0,0,1,1,1', '-o', 'x.vtk', code=2)
    assert 'level' in tetlod('extract', 'fixed.tetlod', '--error', '1%', '--box', '0,0,0,1,1,1', '--box-error', '5%',
                             '-o', 'x.vtk')  # no finer there


def test_over_http():
    coarse, fine = level('fixed.tetlod', '--error', '5%'), level('fixed.tetlod', '--error', '0.2%')
    boxes = [random_box(fine, 0.004, seed) for seed in (1, 2)]
    text = ';'.join(','.join('%.17g' % x for x in box) for box in boxes)
    with Server(os.path.join(SCRATCH, 'fixed.tetlod')) as server:
        status, head, _ = server.get('/v1/meshes/fixed/mesh?error=0.05&box_error=0.002&format=vtk&box=' + text)
        assert status == 303 and 'region.vtk' in head['location'], (status, head)
        path = '/v1/meshes/fixed/' + head['location']
        status, head, body = server.get(path)
        assert status == 200 and 'immutable' in head['cache-control'], (status, body[:300])
        with open(os.path.join(SCRATCH, 'served.vtk'), 'wb') as out:
            out.write(body)
        answer = read_vtk(os.path.join(SCRATCH, 'served.vtk'))
        parts = judge(answer, coarse, fine, halves(boxes), 5, False)
        assert head['tetlod-tets'] == str(len(answer['tets'])) and head['tetlod-vertices'] == str(len(answer['points']))
        assert (head['tetlod-transition-tets'] == str(parts[TRANSITION])
                and int(head['tetlod-box-level']) > int(head['tetlod-level']))
        check_measured(answer, level('fixed.tetlod'), 'Pressure',
                       float(head['tetlod-transition-error'].split('measured=')[1]), 5)
        tetlod('extract', 'fixed.tetlod', '--error', '5%', '--box-error', '0.2%', *map(option, boxes), '-o',
               'region.vtk')
        with open(os.path.join(SCRATCH, 'region.vtk'), 'rb') as file:
            assert file.read() == body
        assert server.get(path, If_None_Match=head['etag'])[0] == 304
        assert server.get(path, method='HEAD')[1]['tetlod-transition-tets'] == str(parts[TRANSITION])
        assert 'xml' in server.get(path.replace('.vtk', '.vtu'))[2][:20].decode()
        plain = server.get('/v1/meshes/fixed/mesh?error=0.01&box=0,0,0,1,1,1&box_error=0.5')
        assert plain[0] == 303 and '/mesh.vtu' in plain[1]['location']
        for wrong in ('error=0.05&box=1,2,3', 'error=0.05&box=1,1,1,0,2,2', 'error=0.05&box_error=0.1',
                      'error=0.05&box=0,0,0,1,1,1&format=tetlod',
                      'error=0.05&box=0,0,0,1,1,1&box_error=x', 'error=0.05&box=' + ';'.join(['0,0,0,1,1,1'] * 17)):
            assert server.get('/v1/meshes/fixed/mesh?' + wrong)[0] == 400, wrong
        base = path.split('?')[0]
        for wrong in ('', '?box=0,0,0,1,1,1', '?box_level=100', '?box=0,0,0,1,1,1&box_level=0',
                      '?box=0,0,0,1,1,1&box_level=999999'):
            assert server.get(base + wrong)[0] == 400, wrong


run([test_a_fixed_boundary, test_a_boundary_that_moves, test_lossy_and_several_fields,
     test_several_boxes_and_a_level_between,
     test_local_bounds, test_bodies_that_overlap, test_boxes_at_the_edges, test_usage, test_over_http])
