# SPDX-License-Identifier: BSD-3-Clause
"""Meshes that are finer in boxes, from the command line and from the server, before an independent judge."""
import os
import subprocess
import sys

import numpy as np

sys.path.insert(0, os.path.join(os.environ['ROOT'], 'tests', 'http'))
from region_judge import BELT, COARSE, FINE, holders, judge, read_vtk, value_at  # noqa: E402
from served import SCRATCH, TETLOD, Server, run  # noqa: E402


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
    """No original vertex in the belt is further off than was measured."""
    belt = np.nonzero(answer['cell']['Region'][:, 0] == BELT)[0]
    corners = answer['points'][answer['tets'][belt]]
    low, high = corners.min((0, 1)), corners.max((0, 1))
    near = np.nonzero(((fine['points'] >= low) & (fine['points'] <= high)).all(1))[0]
    chosen = np.random.default_rng(seed).permutation(near)[:500]
    worst = 0
    for v, t in zip(chosen, holders({'points': answer['points'], 'tets': answer['tets'][belt]}, fine['points'][chosen])):
        if t >= 0:
            worst = max(worst, abs(value_at(answer, belt[t], fine['points'][v], name)[0] - fine['point'][name][v, 0]))
    extent = fine['point'][name].max() - fine['point'][name].min()
    assert worst / extent <= said * (1 + 1e-4) + 1e-9, (worst / extent, said)
    return worst / extent


def measured(message, name):
    return float(message.split('belt between them:')[1].split(name + ' ')[1].split(' %')[0]) / 100


def check_stream(stream, name, error, fraction, seeds, domain_moves, fields=()):
    coarse, fine = level(stream, '--error', error), level(stream)
    parts = {COARSE: 0, FINE: 0, BELT: 0}
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
    tetlod('sample', 'fin', '--size', '18', '-o', 'fin.vtu')
    tetlod('build', 'fin.vtu', '-o', 'fixed.tetlod', '--carry', 'Pressure', '--domain-error', '0', '--quiet')
    check_stream('fixed.tetlod', 'Pressure', '5%', 0.004, range(3), False)


def test_a_boundary_that_moves():
    tetlod('sample', 'torus', '--size', '10', '-o', 'torus.vtu')
    tetlod('build', 'torus.vtu', '-o', 'torus.tetlod', '--quiet')
    name = next(iter(level('torus.tetlod')['point']))
    check_stream('torus.tetlod', name, '5%', 0.01, range(3), True)


def test_lossy_and_several_fields():
    """The last level is a tail: it has other values than the one before, and no more vertices."""
    tetlod('build', 'fin.vtu', '-o', 'all.tetlod', '--quiet')
    check_stream('all.tetlod', 'Pressure', '3%', 0.01, range(2), True, ('Density', 'Velocity'))
    tetlod('build', 'fin.vtu', '-o', 'lossy.tetlod', '--carry', 'Pressure', '--field-bits', '14', '--position-bits', '16', '--quiet')
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


def test_usage():
    for wrong in (['--box', '1,2,3'], ['--box', '1,1,1,0,2,2'], ['--box', '0,0,0,1,1,nan'], ['--box-error', '1%'], ['--box', '0,0,0,1,1,1', '--box-error', 'x']):
        assert 'box' in tetlod('extract', 'fixed.tetlod', '--error', '5%', *wrong, '-o', 'x.vtk', code=2)
    assert '--error' in tetlod('extract', 'fixed.tetlod', '--box', '0,0,0,1,1,1', '-o', 'x.vtk', code=2)
    assert 'level' in tetlod('extract', 'fixed.tetlod', '--error', '1%', '--box', '0,0,0,1,1,1', '--box-error', '5%', '-o', 'x.vtk')  # no finer there


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
        assert head['tetlod-belt-tets'] == str(parts[BELT]) and int(head['tetlod-box-level']) > int(head['tetlod-level'])
        check_measured(answer, level('fixed.tetlod'), 'Pressure', float(head['tetlod-belt-error'].split('measured=')[1]), 5)
        tetlod('extract', 'fixed.tetlod', '--error', '5%', '--box-error', '0.2%', *map(option, boxes), '-o', 'region.vtk')
        with open(os.path.join(SCRATCH, 'region.vtk'), 'rb') as file:
            assert file.read() == body
        assert server.get(path, If_None_Match=head['etag'])[0] == 304
        assert server.get(path, method='HEAD')[1]['tetlod-belt-tets'] == str(parts[BELT])
        assert 'xml' in server.get(path.replace('.vtk', '.vtu'))[2][:20].decode()
        plain = server.get('/v1/meshes/fixed/mesh?error=0.01&box=0,0,0,1,1,1&box_error=0.5')
        assert plain[0] == 303 and '/mesh.vtu' in plain[1]['location']
        for wrong in ('error=0.05&box=1,2,3', 'error=0.05&box=1,1,1,0,2,2', 'error=0.05&box_error=0.1', 'error=0.05&box=0,0,0,1,1,1&format=tetlod',
                      'error=0.05&box=0,0,0,1,1,1&box_error=x', 'error=0.05&box=' + ';'.join(['0,0,0,1,1,1'] * 17)):
            assert server.get('/v1/meshes/fixed/mesh?' + wrong)[0] == 400, wrong
        base = path.split('?')[0]
        for wrong in ('', '?box=0,0,0,1,1,1', '?box_level=100', '?box=0,0,0,1,1,1&box_level=0', '?box=0,0,0,1,1,1&box_level=999999'):
            assert server.get(base + wrong)[0] == 400, wrong


run([test_a_fixed_boundary, test_a_boundary_that_moves, test_lossy_and_several_fields, test_several_boxes_and_a_level_between,
     test_boxes_at_the_edges, test_usage, test_over_http])
