#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""`tetlod features`: what it proves of a stream's original, held against that one's own merge tree (feature_judge.py).
Many more random fields: tests/attack/features.py."""
import csv
import json
import os
import sys

import numpy as np

ROOT = os.environ.get('ROOT', '.')
sys.path[:0] = [os.path.join(ROOT, 'tests'), os.path.join(ROOT, 'tests', 'attack')]
import common
import features as attack
from common import SANITIZED, SCRATCH, fails, finish, info, must, note, path, report
from feature_judge import bars, edges_of, judge, matches, true_features

SEEDS = (1, 2, 3) if SANITIZED else (1, 2, 3, 4, 6, 9, 11, 12, 15)
TEETH = () if SANITIZED else (5, 10)  # seeds of which an answer is false if the errors are halved


def random_fields():
    wrong, asked, caught = [], 0, 0
    for seed in SEEDS + TEETH:
        answers, problems, false, _ = attack.attack(seed, SCRATCH)
        asked, wrong, caught = asked + answers, wrong + problems, caught + false
    report('%d answers about random fields are those of the original' % asked,
           not wrong and asked > 5 * len(SEEDS), wrong)
    report('with errors halved some are false', caught > 0 or not TEETH, caught)


def judge_itself():
    """Three hills on a line, of which one is a shoulder of another."""
    values = np.array([0.0, 5, 1, 9, 8.5, 8.75, 2])
    edges = np.array([[i, i + 1] for i in range(6)])
    found = sorted(bars(values, edges))
    found = [bar for bar in found if bar[1] > bar[2]]
    report('the judge finds bars', found == [(1, 5.0, 1.0), (3, 9.0, 0.0), (5, 8.75, 8.5)], found)


def answer(*arguments):
    done = common.tetlod('features', *arguments, '--json')
    if done.returncode not in (0, 5):
        raise RuntimeError('%s: %s' % (arguments, done.stderr.decode()))
    return done.returncode, json.loads(done.stdout)


def write_vectors(name, points, tets, vectors):
    attack.write_mesh(path(name), points, tets, vectors[:, 0])
    with open(path(name), 'a') as out:
        out.write('VECTORS v double\n')
        np.savetxt(out, vectors, '%.17g')


def vectors():
    points, tets, values = attack.case(8)
    edges = edges_of(tets)
    field = np.column_stack([values, attack.smooth(np.random.default_rng(80), points), np.full(len(points), 0.3)])
    write_vectors('vectors.vtk', points, tets, field)
    must('build', 'vectors.vtk', '-o', 'vectors.tetlod', '--domain-error', '0', '--field', 'v')
    lengths, wrong = np.sqrt((field ** 2).sum(axis=1)), []
    for level in (5, 12, len(info('vectors.tetlod')['levels']) - 1):
        _, said = answer('vectors.tetlod', '--field', 'v:1', '--level', str(level), '--persistence', '2%')
        wrong.append(judge(said, points, field[:, 1], edges))
        _, said = answer('vectors.tetlod', '--field', '|v|', '--level', str(level), '--persistence', '2%')
        true = true_features('maximum', lengths, edges, said['persistence'])
        proven = [f for f in said['features'] if f['kind'] == 'maximum' and f['proven']]
        for feature in proven:  # lengths of this judge are rounded
            feature['lower'] -= 1e-12
            feature['upper'] += 1e-12
        wrong.append(matches(proven, points, true))
    report('components and lengths of a vector', not any(wrong) and proven, wrong)
    field[0, 1] = np.nan
    write_vectors('hole.vtk', points, tets, field)
    report('NaN in another field is nothing to it', answer('hole.vtk', '--field', 'p') ==
           answer('vectors.vtk', '--field', 'p'))
    fails('NaN in the field', 3, ('field v', 'point 0'), 'features', 'hole.vtk', '--field', '|v|')


def outputs():
    code, said = answer('plain.tetlod', '--field', 'p', '--persistence', '3%')
    must('features', 'plain.tetlod', '--field', 'p', '--persistence', '3%', '-o', 'points.csv')
    must('features', 'plain.tetlod', '--field', 'p', '--persistence', '3%', '-o', 'points.vtu')
    with open(path('points.csv')) as file:
        rows = list(csv.DictReader(file))
    good = code == 0 and len(rows) == len(said['features']) and all(
        [float(row[c]) for c in 'xyz'] == feature['at'] and row['kind'] == feature['kind'] and
        float(row['upper']) == feature['upper'] for row, feature in zip(rows, said['features']))
    report('-o .csv has what --json has', good, (rows, said))
    try:
        points, _, fields = common.read_vtu('points.vtu')
    except ImportError:
        note('skipped: VTK for Python is not here')
        return
    report('-o .vtu is read by VTK', points.tolist() == [f['at'] for f in said['features']] and
           fields['proven'].tolist() == [f['proven'] for f in said['features']] and
           fields['persistence'].tolist() == [f['persistence'] for f in said['features']], fields)


def prefixes():
    """Coarse levels say what they can; a file that is cut off says what is there; no more is read than is needed."""
    stages, levels = [], len(info('plain.tetlod')['levels'])
    for level in range(0, levels, 6):
        stages.append(answer('plain.tetlod', '--field', 'p', '--persistence', '3%', '--level', str(level))[1])
    proven = [stage['counts']['maximum']['proven'] for stage in stages]
    report('finer levels prove more', proven == sorted(proven) and proven[0] < proven[-1], proven)
    code, said = answer('plain.tetlod', '--field', 'p', '--persistence', '3%')
    report('the coarsest level that decides is read',
           code == 0 and said['bytes'] < said['of_bytes'] and said['level'] < levels - 1, said)
    code, coarse = answer('plain.tetlod', '--field', 'p', '--persistence', '3%', '--error', '10%')
    report('what stays possible has a status of its own', code == 5 and coarse['error'] > 0, coarse)
    with open(path('plain.tetlod'), 'rb') as whole:
        data = whole.read()
    with open(path('cut.tetlod'), 'wb') as cut:
        cut.write(data[:len(data) // 2])
    code, said = answer('cut.tetlod', '--field', 'p', '--persistence', '0.1%')
    report('a file that is cut off', 0 < said['level'] < levels - 1, said)


def write_waves(name, n):
    points, tets = attack.block(np.random.default_rng(5), n)
    values = np.sin(5 * points[:, 0]) * np.cos(4 * points[:, 1]) * np.sin(3 * points[:, 2] + 1)
    attack.write_mesh(path(name), points, tets, values)


def urls():
    """A stream at a URL answers as its file does; what is finer than the level that decides is not fetched."""
    question = '--field', 'p', '--persistence', '10%'
    write_waves('fine.vtk', 19)
    must('build', 'fine.vtk', '-o', 'fine.tetlod', '--domain-error', '0')
    local = answer('fine.tetlod', *question)
    with common.Host() as host:
        remote = answer(host.url + 'fine.tetlod', *question)
    report('a URL gives the same answer', remote == local, (remote, local))
    report('and fetches what it needs', host.sent < 0.7 * local[1]['of_bytes'], (host.sent, local[1]['of_bytes']))
    fails('a host that is not there', 1, ('http://127.0.0.1:1/x.tetlod', 'cannot be read'), 'features',
          'http://127.0.0.1:1/x.tetlod', *question)


def series():
    must('sample', 'wake', '--steps', '3', '--size', '6', '-o', 'wake.pvd')
    must('build', 'wake.pvd', '-o', 'wake.tetlod')
    field = next(f['name'] for f in info('wake.tetlod')['fields'] if f['components'] == 1)
    said = [answer('wake.tetlod', '--field', field, '--step', str(step))[1] for step in (0, 2)]
    files = [answer('wake_%d.vtu' % step, '--field', field)[1] for step in (0, 2)]
    report('a step of a series is the step\'s file', [s['counts'] for s in said] == [f['counts'] for f in files] and
           [sorted(f['at'] for f in s['features']) for s in said] ==
           [sorted(f['at'] for f in s['features']) for s in files], said)


def refusals():
    must('sample', 'torus', '--size', '6', '-o', 'torus.vtu')
    must('build', 'torus.vtu', '-o', 'torus.tetlod')
    for name, code, words, *arguments in (('no field', 2, ('--field', ), 'plain.tetlod'),
                                          ('another field', 3, ("no field 'q'", ), 'plain.tetlod', '--field',
                                           'q'), ('a vector', 3, ('|v|', 'v:0'), 'vectors.tetlod', '--field',
                                                  'v'), ('a component', 3, ('0 to 2', ), 'vectors.tetlod', '--field',
                                                         'v:3'), ('a field that nothing bounds', 3, ('--certify-all', ),
                                                                  'vectors.tetlod', '--field', 'p', '--level', '3'),
                                          ('a moved boundary', 3, ('--domain-error 0', ), 'torus.tetlod', '--field',
                                           'temperature', '--level',
                                           '3'), ('no such level', 2, ('levels 0 to', ), 'plain.tetlod', '--field', 'p',
                                                  '--level', '999'), ('a format', 2, ('.vtu or .csv', ), 'plain.tetlod',
                                                                      '--field', 'p', '-o', 'a.txt'),
                                          ('level and error', 2, ('one is enough', ), 'plain.tetlod', '--field', 'p',
                                           '--level', '3', '--error', '1%'), ('more than the range', 2, ('2%',
                                                                               'not \'2\''), 'plain.tetlod',
                                                         '--field', 'p', '--persistence', '2')):
        fails('refused: ' + name, code, words, 'features', *arguments)


def main():
    judge_itself()
    random_fields()
    write_waves('plain.vtk', 9)
    must('build', 'plain.vtk', '-o', 'plain.tetlod', '--domain-error', '0')
    vectors()
    outputs()
    prefixes()
    urls()
    series()
    refusals()
    finish()


main()
