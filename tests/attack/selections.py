#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""usage: selections.py FIRST COUNT [MESH...]

COUNT random selections of pages, shared by ten meshes in pages (or those named), each held against the original
(page_selections.c): a boundary that moves, regions, several fields, cells stretched and graded, a cavity, a handle,
two steps of a series (which cannot be in pages as a series), and a level of the blunt fin where $BLUNT has it. With a
fifth of the certified errors each mesh must give findings, so that it is known that they would be found."""
import os
import subprocess
import sys
import tempfile

import numpy as np

ROOT = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
sys.path[:0] = [os.path.join(ROOT, 'tests', 'cli'), os.path.join(ROOT, 'tests', 'attack')]
from features import TETLOD, smooth, write_mesh  # noqa: E402
from kuhn_grid import kuhn  # noqa: E402

JUDGE = os.path.join(os.path.dirname(TETLOD), 'tests', 'attack', 'page_selections')
MOVES = ('--domain-error', '0.01')
MESHES = {  # a sample and its size, or what makes it; options of the build
    'cube': (('cube', '8'), ('--paged=200',)),
    'fin': (('fin', '10'), ('--paged=100', '--field', 'Pressure', '--field', 'Velocity:mag')),
    'post': (('post', '12'), ('--paged=150',)),
    'torus': (('torus', '4'), ('--paged=100', *MOVES)),
    'shell': (('shell', '5'), ('--paged=150', *MOVES)),
    'delta': (('delta', '2'), ('--paged=150', '--bands', 'coarse')),
    'blunt': ('write_blunt', ('--paged=200', '--field', 'Pressure', '--field', 'Density', *MOVES)),
    'parts': ('write_parts', ('--paged=150', '--field', 'p', '--region', 'material')),
    'bent': ('write_bent', ('--paged=150', '--field', 'p', '--field', 'q', '--region', 'material', *MOVES)),
    'wake': ('write_wake', ('--paged=120', '--time', '0', '--bands', 'fine')),
    'wake-end': ('write_wake', ('--paged=120', '--time', '2', *MOVES)),
}


def run(*arguments):
    return subprocess.run([TETLOD, *map(str, arguments)], stdout=subprocess.PIPE, check=True).stdout


def bend(points):
    """Sides become curved."""
    around = np.roll(points, 1, axis=1)
    return points + 0.1 * (points - 0.5) * np.sin(np.pi * around) * np.sin(np.pi * np.roll(around, 1, axis=1))


def write_blocks(path, seed, bent):
    """Two materials, two fields."""
    random = np.random.default_rng(seed)
    points, tets = kuhn(random.integers(7, 10), random)
    material = (points[tets].mean(axis=1) @ random.random(3) > 0.7).astype(int)
    p, q = smooth(random, points), smooth(random, points)
    write_mesh(path, bend(points) if bent else points, tets, p)
    with open(path, 'a') as out:
        out.write('SCALARS q double 1\nLOOKUP_TABLE default\n')
        np.savetxt(out, q, '%.17g')
        out.write('CELL_DATA %d\nSCALARS material int 1\nLOOKUP_TABLE default\n' % len(material))
        np.savetxt(out, material, '%d')


def write_parts(folder, seed):
    path = os.path.join(folder, 'parts.vtk')
    write_blocks(path, seed, False)
    return path


def write_bent(folder, seed):
    path = os.path.join(folder, 'bent.vtk')
    write_blocks(path, seed, True)
    return path


def write_wake(folder, seed):
    path = os.path.join(folder, 'wake.pvd')
    run('sample', 'wake', '--steps', 3, '--size', 8, '-o', path)
    return path


def write_blunt(folder, seed):
    """A level of it, as a mesh; None: it is not there."""
    stream, path = (os.path.join(folder, name) for name in ('whole.tetlod', 'blunt.vtu'))
    source = os.path.join(os.environ.get('BLUNT', ''), 'bluntfinxyz.bin')
    if not os.path.exists(source):
        return None
    run('build', source, '--q', source.replace('xyz.bin', 'q.bin'), '-o', stream, '--quiet')
    run('extract', stream, '--tets', 6000, '-o', path, '--quiet')
    return path


def stream_of(name, folder, seed):
    """In pages; None: it is not there."""
    source, options = MESHES[name]
    stream = os.path.join(folder, name + '.tetlod')
    if isinstance(source, str):
        path = globals()[source](folder, seed)
    else:
        path = os.path.join(folder, name + '.vtu')
        run('sample', source[0], '--size', source[1], '-o', path)
    if path:
        run('build', path, '-o', stream, '--quiet', *options)
    return stream if path else None


def judge(*arguments):
    """What it says, line by line."""
    done = subprocess.run([JUDGE, *map(str, arguments)], stdout=subprocess.PIPE, stderr=subprocess.STDOUT)
    lines = done.stdout.decode().splitlines()
    return lines if done.returncode == bool(lines) else [*lines, 'exit status %d' % done.returncode]


def main():
    first, count, names = int(sys.argv[1]), int(sys.argv[2]), sys.argv[3:] or list(MESHES)
    findings = selections = 0
    for number, name in enumerate(names):
        share = count * (number + 1) // len(names) - count * number // len(names)
        with tempfile.TemporaryDirectory() as folder:
            stream = stream_of(name, folder, first)
            lines = judge(stream, first, share) if stream and share else []
            if stream and share and not any('max:' in line for line in judge(stream, first, 3, 0.2)):
                lines.append('a fifth of the certified errors is taken for enough')
        selections += share if stream else 0
        findings += len(lines)
        for line in lines:
            print('%s, %s' % (name, line), flush=True)
        if not stream:
            print('%s: not there' % name)
    print('%d selections of pages, %d findings' % (selections, findings))
    return 1 if findings else 0


if __name__ == '__main__':
    sys.exit(main())
