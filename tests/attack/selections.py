#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""usage: selections.py FIRST COUNT

Random boxes of random levels of streams in pages, of random meshes: one field or two, with regions or without, in a
cube or in one whose sides are curved, so that they move. The mesh is closed, no tetrahedron is turned, regions have
their volumes, and at each vertex of the original and in the middle of each of its tetrahedra the values are within what
was certified of the part that holds it (tests/cli/region_judge.py): near sides that move nothing is asked."""
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


def cracks(mesh, bent):
    """Faces of more than two tetrahedra; and those of one that are not in a side of the unit cube, or, if it is bent,
    that are not of one surface."""
    faces = np.sort(mesh['tets'][:, FACES].reshape(-1, 3), axis=1)
    faces, counts = np.unique(faces, axis=0, return_counts=True)
    boundary = faces[counts == 1]
    if bent:
        return int((counts > 2).sum()) + bodies(boundary) - 1
    corners = mesh['points'][boundary]
    aside = ((corners == 0).all(axis=1) | (corners == 1).all(axis=1)).any(axis=1)
    return int((counts > 2).sum() + (~aside).sum())


def bodies(triangles):
    """Of how many surfaces they are."""
    of = {int(v): int(v) for v in np.unique(triangles)}

    def root(v):
        while of[v] != v:
            of[v] = v = of[of[v]]
        return v
    for a, b, c in triangles.tolist():
        of[root(a)] = of[root(b)] = root(c)
    return len({root(v) for v in of})


def bend(points):
    """Sides become curved."""
    around = np.roll(points, 1, axis=1)
    return points + 0.1 * (points - 0.5) * np.sin(np.pi * around) * np.sin(np.pi * np.roll(around, 1, axis=1))


def write_more(path, field, material):
    with open(path, 'a') as out:
        out.write('SCALARS q double 1\nLOOKUP_TABLE default\n')
        np.savetxt(out, field, '%.17g')
        out.write('CELL_DATA %d\nSCALARS material int 1\nLOOKUP_TABLE default\n' % len(material))
        np.savetxt(out, material, '%d')


def worst_excess(mesh, name, bounds, points, values):
    """The largest difference above the bound of the tetrahedron that holds the point; points that none holds."""
    corners, field = mesh['points'][mesh['tets']], mesh['point'][name][:, 0][mesh['tets']]
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
    values = {'p': smooth(random, points), 'q': smooth(random, points)}
    two, regions, bent = random.random(3) < 0.5
    material = (points[tets].mean(axis=1) @ random.random(3) > 0.7).astype(int)
    inside = np.concatenate([points, points[tets].mean(axis=1)])
    inside = ((inside > 0.1) & (inside < 0.9)).all(axis=1) | (not bent)
    points = bend(points) if bent else points
    source, stream, out = (os.path.join(folder, name) for name in ('mesh.vtk', 'mesh.tetlod', 'box.vtk'))
    write_mesh(source, points, tets, values['p'])
    write_more(source, values['q'], material)
    asked = [*('--field', 'p'), *(('--field', 'q') if two else ()), '--region', 'material' if regions else 'none']
    moves = ['--domain-error', '0.01'] if bent else []
    run('build', source, '-o', stream, '--paged=%d' % random.integers(100, 400), *asked, *moves, '--quiet')
    index = json.loads(run('info', stream, '--json'))
    if 'first_paged_level' not in index:
        return None
    names = ('p', 'q') if two else ('p',)
    errors = [max(level['errors'][name]['max'] for name in names) for level in index['levels']]
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
    if cracks(mesh, bent) or inverted(mesh):
        return '%d cracks, %d turned' % (cracks(mesh, bent), len(inverted(mesh)))
    whole, inner = volumes({'points': points, 'tets': tets}), volumes(mesh)
    for number in (0, 1) if regions else ():
        before, now = whole[material == number].sum(), inner[mesh['cell']['material'][:, 0] == number].sum()
        if abs(now - before) > (0.1 if bent else 1e-9):
            return 'region %d has %.17g, not %.17g' % (number, now, before)
    if abs(inner.sum() - whole.sum()) > (0.1 if bent else 1e-9):
        return 'volume %.17g' % inner.sum()
    samples = np.concatenate([points, points[tets].mean(axis=1)])[inside]
    for name in names:
        scale, of = np.ptp(values[name]), [level['errors'][name]['max'] for level in index['levels']]
        outside = max(coarse, root) if fine > root else coarse  # a level before those in pages is taken from all
        bounds = np.where(part == FINE, of[fine], of[min(outside, fine)]) * scale
        wanted = np.concatenate([values[name], values[name][tets].mean(axis=1)])[inside]
        excess, lost = worst_excess(mesh, name, bounds, samples, wanted)
        if excess > 1e-9 * scale or lost:
            return '%s: %g above what is certified, %d samples lost' % (name, excess, lost)
    return None


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
