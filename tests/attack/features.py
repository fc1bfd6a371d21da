#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""usage: features.py FIRST COUNT

Random fields on random meshes: the answers of `tetlod features` for a few levels of a stream, held against the original's
own merge tree (tests/cli/feature_judge.py). Also says how often a stream is caught whose index claims half of the
errors."""
import json
import os
import struct
import subprocess
import sys
import tempfile

import numpy as np
from scipy.spatial import Delaunay

ROOT = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
sys.path[:0] = [os.path.join(ROOT, 'tests', 'cli'), os.path.join(ROOT, 'tests')]
from feature_judge import edges_of, judge  # noqa: E402

TETLOD = os.environ.get('TETLOD', os.path.join(ROOT, 'build', 'release', 'tetlod'))
PERSISTENCES = (0, 0.01, 0.05, 0.2)


def block(random, n, offset=0.0):
    """A box whose inner points are jittered: a boundary that may be contracted and keeps its place."""
    axis = np.linspace(0, 1, n)
    points = np.stack(np.meshgrid(axis, axis, axis, indexing='ij'), -1).reshape(-1, 3)
    inner = ((points > 0) & (points < 1)).all(axis=1)
    points[inner] += random.uniform(-0.3, 0.3, (inner.sum(), 3)) / (n - 1)
    tets = Delaunay(points).simplices
    volumes = np.linalg.det(points[tets[:, 1:]] - points[tets[:, :1]])
    tets = tets[abs(volumes) > 1e-9]
    turned = np.linalg.det(points[tets[:, 1:]] - points[tets[:, :1]]) < 0
    tets[turned] = tets[turned][:, [0, 1, 3, 2]]
    return points + [offset, 0, 0], tets


def smooth(random, points):
    """A few hills and hollows, and noise."""
    values = np.zeros(len(points))
    for _ in range(random.integers(1, 9)):
        centre, width = random.random(3), random.uniform(0.08, 0.5)
        values += random.normal() * np.exp(-((points - centre) ** 2).sum(axis=1) / width ** 2)
    return values + random.choice([0, 0, 1e-3, 0.02, 0.2]) * random.standard_normal(len(points))


def case(seed):
    """Points, tetrahedra, the scalar's values."""
    random = np.random.default_rng(seed)
    points, tets = block(random, random.integers(5, 10))
    if seed % 4 == 1:  # another body, apart or touching
        more, further = block(random, random.integers(3, 6), random.choice([1.0, 1.5]))
        tets = np.concatenate([tets, further + len(points)])
        points = np.concatenate([points, more])
    values = smooth(random, points)
    if seed % 4 == 2:  # plateaus: many ties
        values = np.round(values * random.choice([5, 20]), 0)
    if seed % 4 == 3:  # a seam of double values, joined by a tetrahedron without volume
        twins = random.choice(len(points), 3, replace=False)
        tets = np.concatenate([tets, [[*twins[:3], len(points)]]])
        points = np.concatenate([points, points[twins[:1]]])
        values = np.append(values, values[twins[0]] + random.normal())
    return points, tets, values


def write_mesh(path, points, tets, values):
    with open(path, 'w') as out:
        out.write('# vtk DataFile Version 3.0\nt\nASCII\nDATASET UNSTRUCTURED_GRID\nPOINTS %d double\n' % len(points))
        np.savetxt(out, points, '%.17g')
        out.write('CELLS %d %d\n' % (len(tets), 5 * len(tets)))
        np.savetxt(out, np.column_stack([np.full(len(tets), 4), tets]), '%d')
        out.write('CELL_TYPES %d\n' % len(tets) + '10\n' * len(tets))
        out.write('POINT_DATA %d\nSCALARS p double 1\nLOOKUP_TABLE default\n' % len(points))
        np.savetxt(out, values, '%.17g')


def run(folder, *arguments):
    return subprocess.run([TETLOD, *arguments], cwd=folder, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE,
                          stderr=subprocess.PIPE)


def features(folder, *arguments):
    """The answer, or None where nothing is proved."""
    done = run(folder, 'features', *arguments, '--field', 'p', '--json')
    if done.returncode == 1 or done.returncode == 3:
        return None
    if done.returncode not in (0, 5):
        raise RuntimeError('%s: %s' % (arguments, done.stderr.decode()))
    return json.loads(done.stdout)


def halve_errors(folder, stream, forged):
    """A stream whose index says half of the certified errors."""
    from streams import plain, sealed
    with open(os.path.join(folder, stream), 'rb') as file:
        data = plain(file.read())
    levels = json.loads(run(folder, 'info', '--json', stream).stdout)['levels']
    end = 64 + int.from_bytes(data[20:24], 'little')
    index = data[64:end]
    for level in levels:
        error = level['errors']['p'].get('max', 0)
        row = struct.pack('<d', error)
        if error:
            index = index.replace(row, struct.pack('<d', error / 2))
    with open(os.path.join(folder, forged), 'wb') as file:
        file.write(sealed(data[:64] + index + data[end:]))


def questions(random, levels, values):
    """Options of a few questions, and the threshold if they have one."""
    chosen = random.choice(levels, min(3, levels), replace=False).tolist()
    for level in chosen:
        persistence = str(random.choice(PERSISTENCES))
        yield ['--persistence', persistence, '--level', str(level)], None
        threshold = float(np.quantile(values, random.uniform(0.2, 0.8)))
        side = random.choice(['--above', '--below'])
        yield ['--persistence', persistence, side, repr(threshold), '--level', str(level)], threshold
    yield ['--persistence', str(random.choice(PERSISTENCES))], None


def attack(seed, folder):
    """Answers that were judged, what is wrong with them, and how many are wrong of the forged stream."""
    points, tets, values = case(seed)
    edges, random = edges_of(tets), np.random.default_rng(seed)
    write_mesh(os.path.join(folder, 'a.vtk'), points, tets, values)
    local = ['--local-bound'] if seed % 3 == 0 else []
    built = run(folder, 'build', 'a.vtk', '-o', 'a.tetlod', '--domain-error', '0', *local)
    if built.returncode:
        raise RuntimeError(built.stderr.decode())
    levels = len(json.loads(run(folder, 'info', '--json', 'a.tetlod').stdout)['levels'])
    asked, wrong, caught, undecided = 0, [], 0, 0
    if not local:
        halve_errors(folder, 'a.tetlod', 'forged.tetlod')
    for options, threshold in questions(random, levels, values):
        said = features(folder, 'a.tetlod', *options)
        if said is None:
            continue
        asked += 1
        undecided += any('at_most' not in count for count in said['counts'].values())
        problem = judge(said, points, values, edges, threshold)
        if problem:
            wrong.append('seed %d: %s: %s' % (seed, ' '.join(options), problem))
        forged = None if local else features(folder, 'forged.tetlod', *options)
        caught += bool(forged and judge(forged, points, values, edges, threshold))
    exact = features(folder, 'a.vtk', '--persistence', '0.01')
    problem = judge(exact, points, values, edges)
    if problem or any(count['proven'] != count.get('at_most') for count in exact['counts'].values()):
        wrong.append('seed %d: the mesh file: %s' % (seed, problem or exact['counts']))
    return asked + 1, wrong, caught, undecided


def main(first, count):
    total, failures, teeth, open_ends = 0, [], 0, 0
    with tempfile.TemporaryDirectory() as folder:
        for seed in range(first, first + count):
            asked, wrong, caught, undecided = attack(seed, folder)
            total, teeth, open_ends = total + asked, teeth + caught, open_ends + undecided
            failures += wrong
            for line in wrong:
                print(line, flush=True)
    print('%d answers, %d without an upper end, %d wrong; %d wrong with errors halved' %
          (total, open_ends, len(failures), teeth))
    return 1 if failures or not total else 0


if __name__ == '__main__':
    sys.exit(main(int(sys.argv[1]), int(sys.argv[2])))
