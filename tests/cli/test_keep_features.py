#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""build --keep-features: levels have as many maxima and minima of the persistence as the original, which are counted
here (feature_judge.py) on the level as it is extracted."""
import os
import sys

ROOT = os.environ.get('ROOT', '.')
sys.path[:0] = [os.path.join(ROOT, 'tests'), os.path.join(ROOT, 'tests', 'attack')]
import features as attack
from common import fails, finish, info, must, path, report
from feature_judge import edges_of, true_features
from meshes import read


def counts(points, tets, values, persistence):
    edges = edges_of(tets)
    return [len(true_features(kind, values, edges, persistence)) for kind in ('maximum', 'minimum')]


def kept(name, seed, share, *options):
    points, tets, values = attack.case(seed)
    attack.write_mesh(path('a.vtk'), points, tets, values)
    must('build', 'a.vtk', '-o', 'a.tetlod', '--keep-features', str(share), *options)
    persistence = share * (values.max() - values.min())
    levels, wrong = info('a.tetlod')['levels'], []
    wanted = counts(points, tets, values, persistence)
    for level in sorted({*range(0, len(levels), 4), len(levels) - 1}):
        must('extract', 'a.tetlod', '--level', str(level), '-o', 'level.vtu', '--quiet')
        _, corners, fields, _ = read('level.vtu')
        found = counts(None, corners, fields['p'].astype(float), persistence)
        if found != wanted:
            wrong.append((level, found, wanted))
    report('%s: of %d levels all have %s' % (name, len(levels), wanted), not wrong and len(levels) > 1, wrong)
    return levels[0]['tets'], len(tets), wanted


def bites():
    """Without the option coarse levels lose some."""
    points, tets, values = attack.case(8)
    must('build', 'a.vtk', '-o', 'free.tetlod')
    must('extract', 'free.tetlod', '--level', '0', '-o', 'level.vtu', '--quiet')
    _, corners, fields, _ = read('level.vtu')
    persistence = 0.1 * (values.max() - values.min())
    found = counts(None, corners, fields['p'].astype(float), persistence)
    report('without the option the coarsest level has others', found != counts(points, tets, values, persistence),
           found)


def deterministic():
    for threads in '1', '3':
        must('build', 'a.vtk', '-o', threads + '.tetlod', '--keep-features', '10%', '--threads', threads)
    with open(path('1.tetlod'), 'rb') as one, open(path('3.tetlod'), 'rb') as three:
        report('the bytes do not depend on threads', one.read() == three.read())


def main():
    coarsest, whole, _ = kept('hills', 8, 0.1)
    report('what is left to contract is contracted', coarsest < whole / 2, (coarsest, whole))
    bites()
    deterministic()
    kept('a body beside another', 5, 0.2)
    kept('plateaus', 6, 0.3)
    kept('the boundary stays', 12, 0.1, '--domain-error', '0')
    kept('the exact limit', 4, 0.2, '--certify', 'exact')
    kept('a local bound beside it', 8, 0.1, '--local-bound')
    must('sample', 'wake', '--steps', '2', '--size', '4', '-o', 'wake.pvd')
    fails('not of a series', 2, ('--keep-features',), 'build', 'wake.pvd', '-o', 'wake.tetlod', '--keep-features', '2%')
    for value in '0', '-1%', '101%':
        fails('not ' + value, 2, ('--keep-features',), 'build', 'a.vtk', '-o', 'b.tetlod', '--keep-features', value)
    finish()


main()
