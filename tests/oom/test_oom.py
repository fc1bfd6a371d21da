#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""Every allocation of every command fails in turn: an error message, exit status 1, no file left; never a crash."""
import concurrent.futures
import os
import re
import struct
import subprocess

from tap import finish, report

TETLOD, SCRATCH, ROOT = os.environ['TETLOD'], os.environ['SCRATCH'], os.environ['ROOT']
PRELOAD = os.path.join(ROOT, 'build/release/tests/oom/failmalloc.so')
# Allocations of one command that fail; where it makes more, these are evenly spread
MAX_RUNS = int(os.environ.get('ALLOCATIONS', 50))


def path(name):
    return os.path.join(SCRATCH, name)


def run(arguments, folder, **environment):
    arguments = [a.replace('OUT', folder) for a in arguments]
    return subprocess.run([TETLOD, *arguments], stdin=subprocess.DEVNULL, stdout=subprocess.PIPE,
                          stderr=subprocess.PIPE,
                          env=dict(os.environ, LD_PRELOAD=PRELOAD, **environment))


def allocations(arguments):
    folder = path('counted')
    os.makedirs(folder, exist_ok=True)
    done = run(arguments, folder, FAILMALLOC_COUNT=path('count'))
    if done.returncode:
        raise RuntimeError('%s: exit %d: %s' % (arguments, done.returncode, done.stderr.decode()))
    return int(open(path('count')).read())


def attempt(arguments, mode, number):
    """None, or what is wrong when allocation `number` fails. That may be survived, for what is not needed."""
    folder = path('%s%d' % (mode, number))
    os.mkdir(folder)
    done = run(arguments, folder, **{'FAILMALLOC_' + mode: str(number)})
    left = os.listdir(folder)
    for name in left:
        os.remove(os.path.join(folder, name))
    os.rmdir(folder)
    message = done.stderr.decode(errors='replace')
    if done.returncode == 0:
        return 'not one allocation failed' if (mode, number) == ('FROM', 1) else None
    if done.returncode != 1:
        return '%s %d: exit status %d: %r' % (mode, number, done.returncode, message)
    if not re.fullmatch(r'tetlod: [^\n]*(memory|allocate)[^\n]*\n', message):
        return '%s %d: message %r' % (mode, number, message)
    return '%s %d: left behind %s' % (mode, number, left) if left else None


def check(name, arguments):
    total = allocations(arguments)
    numbers = range(1, total + 1) if total <= MAX_RUNS else [1 + total * i // MAX_RUNS for i in range(MAX_RUNS)]
    attempts = [('AT', n) for n in numbers] + [('FROM', n) for n in list(numbers)[::4]]
    with concurrent.futures.ThreadPoolExecutor(2) as pool:
        problems = [p for p in pool.map(lambda a: attempt(arguments, *a), attempts) if p]
    report('%s: %d of %d allocations' % (name, len(numbers), total), not problems, '\n'.join(problems[:10]))


def make_inputs():
    subprocess.run([TETLOD, 'sample', 'cube', '--size', '2', '-o', path('cube.vtu')], check=True)
    for name in 'cube.vtk', 'cube.msh':
        subprocess.run([TETLOD, 'convert', path('cube.vtu'), '-o', path(name)], check=True)
    subprocess.run([TETLOD, 'build', '--quiet', path('cube.vtu'), '-o', path('cube.tetlod')], check=True)
    subprocess.run([TETLOD, 'build', '--quiet', '--keep-order', path('cube.vtu'), '-o', path('kept.tetlod')],
                   check=True)
    n = 2 * 3 * 4
    with open(path('grid.xyz'), 'wb') as file:
        file.write(struct.pack('>3i', 2, 3, 4) + b''.join(
            struct.pack('>%df' % n, *[(p % 2, p // 2 % 3, p // 6)[axis] for p in range(n)]) for axis in range(3)))
    with open(path('flow.q'), 'wb') as file:
        file.write(struct.pack('>3i4f', 2, 3, 4, 1, 0, 0, 0) + struct.pack('>%df' % (5 * n), *[1.0] * (5 * n)))
    points = [(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)]
    with open(path('one.mesh'), 'w') as file:
        file.write('MeshVersionFormatted 2 Dimension 3 Vertices 4 %s Tetrahedra 1 1 2 3 4 0 End' %
                   ' '.join('%d %d %d 0' % p for p in points))
    with open(path('one.sol'), 'w') as file:
        file.write('MeshVersionFormatted 2 Dimension 3 SolAtVertices 4 1 1 1 2 3 4 End')
    with open(path('one.node'), 'w') as file:
        file.write('4 3 1 0\n' + '\n'.join('%d %d %d %d 5' % (i, *p) for i, p in enumerate(points)))
    with open(path('one.ele'), 'w') as file:
        file.write('1 4 0\n0 0 1 2 3\n')
    tets = '<DataArray type="Int32" Name="connectivity">0 1 2 3 0 1 2 3 4 5 6 7</DataArray>' \
           '<DataArray type="Int32" Name="offsets">4 12</DataArray><DataArray type="UInt8" Name="types">10 12</DataArray>'
    points = ' '.join('%d %d %d' % p for p in
                      [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1)])
    with open(path('mixed.vtu'), 'w') as file:
        file.write(
            '<VTKFile type="UnstructuredGrid"><UnstructuredGrid><Piece NumberOfPoints="8" NumberOfCells="2"><Points>'
            '<DataArray type="Float64" NumberOfComponents="3">%s</DataArray></Points><Cells>%s</Cells><PointData>'
            '<DataArray type="Int8" Name="a">1 2 3 4 5 6 7 8</DataArray></PointData></Piece></UnstructuredGrid>'
            '</VTKFile>' % (points, tets))


def main():
    make_inputs()
    for name in 'cube', 'fin', 'torus', 'shell', 'delta':
        check('sample %s' % name, ['sample', name, '--size', '4', '-o', 'OUT/a.vtu'])
    check('sample to legacy VTK', ['sample', 'cube', '--size', '2', '-o', 'OUT/a.vtk'])
    check('convert appended VTU', ['convert', path('cube.vtu'), '-o', 'OUT/a.vtu'])
    check('convert ascii VTU', ['convert', path('mixed.vtu'), '-o', 'OUT/a.vtk'])
    check('convert legacy VTK', ['convert', path('cube.vtk'), '-o', 'OUT/a.vtu'])
    check('convert to Gmsh', ['convert', path('cube.vtu'), '-o', 'OUT/a.msh'])
    check('convert Gmsh to STL', ['convert', path('cube.msh'), '-o', 'OUT/a.stl'])
    check('convert Medit to PLY', ['convert', path('one.mesh'), '--q', path('one.sol'), '-o', 'OUT/a.ply'])
    check('convert TetGen', ['convert', path('one.node'), '-o', 'OUT/a.vtu'])
    check('convert PLOT3D', ['convert', path('grid.xyz'), '--q', path('flow.q'), '-o', 'OUT/a.vtu'])
    check('convert a stream', ['convert', path('cube.tetlod'), '-o', 'OUT/a.vtu'])
    check('build', ['build', path('cube.vtu'), '--quiet', '-o', 'OUT/a.tetlod'])
    check('build by prediction', ['build', path('cube.vtu'), '--quiet', '--metric', 'sva', '-o', 'OUT/a.tetlod'])
    check('build quantised', ['build', path('cube.vtu'), '--quiet', '--field-bits', '8', '--keep-order', '-o',
                              'OUT/a.tetlod'])
    check('extract in the original order', ['extract', path('kept.tetlod'), '--original-order', '-o', 'OUT/a.vtu'])
    check('info', ['info', path('cube.tetlod')])
    check('info --json', ['info', '--json', path('cube.tetlod')])
    check('extract', ['extract', path('cube.tetlod'), '--level', '1', '-o', 'OUT/a.vtu'])
    check('verify', ['verify', path('cube.tetlod')])
    check('verify --against', ['verify', path('cube.tetlod'), '--against', path('cube.vtu')])
    check('compare', ['compare', path('cube.vtu'), path('cube.tetlod'), '--field', 'xyz'])
    finish()


main()
