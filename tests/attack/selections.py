#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""usage: selections.py FIRST COUNT

Random boxes of random levels of streams in pages, of random meshes: the mesh is closed, no tetrahedron is turned, and
at each vertex of the original and in the middle of each of its tetrahedra the value is within what was certified of the
part that holds it (tests/cli/region_judge.py)."""
import json
import os
import subprocess
import sys
import tempfile

import numpy as np

ROOT = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
sys.path[:0] = [os.path.join(ROOT, 'tests', 'cli'), os.path.join(ROOT, 'tests', 'attack')]
from features import TETLOD, smooth, write_mesh  # noqa: E402
from kuhn_grid import kuhn  # noqa: E402
from region_judge import FACES, FINE, inverted, read_vtk, volumes  # noqa: E402


def run(*arguments):
    return subprocess.run([TETLOD, *map(str, arguments)], stdout=subprocess.PIPE, check=True).stdout


def cracks(mesh):
    """Faces of one tetrahedron that are not in a side of the unit cube, which the boundary is."""
    faces = np.sort(mesh['tets'][:, FACES].reshape(-1, 3), axis=1)
    faces, counts = np.unique(faces, axis=0, return_counts=True)
    corners = mesh['points'][faces[counts == 1]]
    aside = ((corners == 0).all(axis=1) | (corners == 1).all(axis=1)).any(axis=1)
    return int((counts > 2).sum() + (~aside).sum())


def worst_excess(mesh, bounds, points, values):
    """The largest difference above the bound of the tetrahedron that holds the point; points that none holds."""
    corners, field = mesh['points'][mesh['tets']], mesh['point']['p'][:, 0][mesh['tets']]
    inverse = np.linalg.inv(corners[:, 1:] - corners[:, :1])
    worst, lost = -np.inf, 0
    for point, value in zip(points, values):
        weights = np.einsum('ti,tij->tj', point - corners[:, 0], inverse)
        weights = np.hstack([1 - weights.sum(axis=1, keepdims=True), weights])
        holding = weights.min(axis=1) > -1e-9
        lost += not holding.any()
        off = abs((weights[holding] * field[holding]).sum(axis=1) - value) - bounds[holding]
        worst = max(worst, off.max(initial=-np.inf))
    return worst, lost


def one(seed, folder):
    """What is wrong, or None."""
    random = np.random.default_rng(seed)
    points, tets = kuhn(random.integers(5, 10), random)
    values = smooth(random, points)
    source, stream, out = (os.path.join(folder, name) for name in ('mesh.vtk', 'mesh.tetlod', 'box.vtk'))
    write_mesh(source, points, tets, values)
    run('build', source, '-o', stream, '--paged=%d' % random.integers(100, 400), '--quiet')
    index = json.loads(run('info', stream, '--json'))
    if 'first_paged_level' not in index:
        return None
    errors, scale = [level['errors']['p']['max'] for level in index['levels']], np.ptp(values)
    last, root = len(errors) - 2, index['first_paged_level'] - 1  # the tail has no pages
    coarse = int(random.integers(0, last))
    fine_error = errors[int(random.integers(max(coarse, root + 1), last + 1))]  # coarser: no pages
    fine = next(level for level, error in enumerate(errors) if error <= fine_error)
    boxes = []
    for _ in range(random.integers(1, 4)):
        low, size = random.random(3), random.random(3) * random.choice([0.02, 0.2, 0.7])
        boxes.append('--box=' + ','.join('%.17g' % x for x in [*low, *(low + size)]))
    run('extract', stream, '--level', coarse, '--box-error', repr(fine_error), *boxes, '-o', out, '--quiet')
    mesh = read_vtk(out)
    part = mesh['cell']['Region'][:, 0] if 'Region' in mesh['cell'] else np.zeros(len(mesh['tets']))
    bounds = np.where(part == FINE, errors[fine], errors[min(max(coarse, root), fine)]) * scale
    if cracks(mesh) or inverted(mesh):
        return '%d cracks, %d turned' % (cracks(mesh), len(inverted(mesh)))
    if abs(volumes(mesh).sum() - 1) > 1e-9:
        return 'volume %.17g' % volumes(mesh).sum()
    samples = np.concatenate([points, points[tets].mean(axis=1)])
    wanted = np.concatenate([values, values[tets].mean(axis=1)])
    excess, lost = worst_excess(mesh, bounds, samples, wanted)
    return '%g above what is certified, %d samples lost' % (excess, lost) if excess > 1e-9 * scale or lost else None


def main():
    first, count, findings = int(sys.argv[1]), int(sys.argv[2]), 0
    with tempfile.TemporaryDirectory() as folder:
        for seed in range(first, first + count):
            wrong = one(seed, folder)
            findings += wrong is not None
            if wrong:
                print('seed %d: selection: %s' % (seed, wrong), flush=True)
    print('%d selections of pages, %d findings' % (count, findings))
    return 1 if findings else 0


if __name__ == '__main__':
    sys.exit(main())
