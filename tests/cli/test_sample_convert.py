#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""`tetlod sample` and `tetlod convert` as a user meets them."""
import os
import resource
import signal
import subprocess
import time
from xml.etree import ElementTree

import numpy as np

from common import DATA, TETLOD, finish, path, read_grid, read_vtu, report, tetlod

SAMPLES = {'cube': (9261, 48000), 'fin': (9025, 38880), 'post': (6175, 25920), 'torus': (4050, 19200),
           'shell': (3612, 18000),
           'delta': (8598, 43416), 'wake': (5049, 20480)}


def active_scalars(name):
    return read_grid(name).GetPointData().GetScalars().GetName()


def samples():
    done = tetlod('sample', '--list')
    names = [line.split()[0] for line in done.stdout.decode().splitlines()]
    report('sample --list', done.returncode == 0 and names == list(SAMPLES), done)
    for name, (vertices, tets) in SAMPLES.items():
        done = tetlod('sample', name, '-o', path(name + '.vtu'))
        points, cells, fields = read_vtu(name + '.vtu')
        report('sample %s' % name, done.returncode == 0 and not done.stderr and
               (len(points), len(cells)) == (vertices, tets)
               and active_scalars(name + '.vtu') == list(fields)[0], (done, len(points), len(cells), list(fields)))
    points, _, fields = read_vtu('cube.vtu')
    report('cube: the field is x y z', np.array_equal(fields['xyz'], points.prod(axis=1)))
    _, _, fields = read_vtu('fin.vtu')
    report('fin: two scalars and a vector, a scalar first', [fields[n].ndim for n in fields] == [1, 1, 2], list(fields))
    first = open(path('fin.vtu'), 'rb').read()
    tetlod('sample', 'fin', '-o', path('fin.vtu'))
    report('the same bytes again', open(path('fin.vtu'), 'rb').read() == first)
    done = tetlod('sample', 'cube', '--size', '2', '-o', path('cube.vtu'))
    report('sample --size', done.returncode == 0 and len(read_vtu('cube.vtu')[1]) == 48)


def series():
    done = tetlod('sample', 'wake', '--steps', '3', '--size', '4', '-o', path('wake.pvd'))
    report(
        'sample --steps: a PVD file and a file of each step', done.returncode == 0 and not done.stderr
        and all(os.path.exists(path('wake_%d.vtu' % i)) for i in range(3)) and not os.path.exists(path('wake_3.vtu')),
        done)
    done = tetlod('convert', path('wake.pvd'), '--time', '1', '-o', path('second.vtu'))
    report('convert reads a step of it', b'0.5' in done.stderr, done)
    steps = [read_vtu(name) for name in ('wake_0.vtu', 'second.vtu', 'wake_2.vtu')]
    report('one mesh, other values', all(np.array_equal(steps[0][i], steps[k][i]) for i in (0, 1) for k in (1, 2)) and
           not any(np.array_equal(steps[i][2][n], steps[i + 1][2][n]) for i in (0, 1) for n in steps[0][2]))


def names_in_xml():
    """Names with what XML reserves, in every XML that is written: of files, of fields, of streams."""
    name = 'a&b<"c>\''
    done = tetlod('sample', 'wake', '--steps', '2', '--size', '4', '-o', path(name + '.pvd'))
    parts = ([part.get('file')
              for part in ElementTree.parse(path(name + '.pvd')).iter('DataSet')] if done.returncode == 0 else done)
    report('a PVD file names its parts as XML wants it', parts == ['%s_%d.vtu' % (name, i) for i in range(2)], parts)
    built = tetlod('build', path(name + '.pvd'), '-o', path(name + '.tetlod'), '--quiet')
    report('and is read again', built.returncode == 0, built)
    done = tetlod('sample', 'wake', '--steps', '2', '--size', '4', '-o', path('a\1.pvd'))
    report('a name that XML cannot hold is refused', done.returncode == 2 and b'XML' in done.stderr, done)
    with open(path('names.vtk'), 'w') as file:
        file.write(
            '# vtk DataFile Version 3.0\nx\nASCII\nDATASET UNSTRUCTURED_GRID\nPOINTS 4 float\n0 0 0 1 0 0 0 1 0 0 0 1\n'
            'CELLS 1 5\n4 0 1 2 3\nCELL_TYPES 1\n10\nPOINT_DATA 4\nFIELD f 1\na&b<"c>\' 1 4 float\n0 1 2 3\n'
            'CELL_DATA 1\nFIELD f 1\nd&e 1 1 float\n5\n')
    tetlod('build', path('names.vtk'), '-o', path('names.tetlod'), '--quiet')
    for extension in 'vtu', 'xdmf', 'vtp':
        done = tetlod('extract', path('names.tetlod'), '-o', path('names.' + extension), '--quiet')
        with open(path('names.' + extension), 'rb') as file:
            text = file.read().split(b'<AppendedData')[0]
        end = b'' if extension == 'xdmf' else b'</VTKFile>'
        found = [one.get('Name') for one in ElementTree.fromstring(text + end).iter()]
        report('names in %s' % extension, name in found and (extension == 'vtp' or 'd&e' in found), (done, found))
    done = tetlod('plot', path('names.tetlod'), '-o', path('names.svg'))
    report('names in svg', done.returncode == 0 and
           name in ''.join(ElementTree.parse(path('names.svg')).getroot().itertext()), done)


def usage():
    for name, arguments, mentions in (
            ('no name', ['sample', '-o', 'x.vtu'], 'NAME'), ('unknown name', ['sample', 'ball', '-o', 'x.vtu'], 'ball'),
            ('no output', ['sample', 'cube'], '-o'), ('nothing moves',
                                                      ['sample', 'cube', '--steps', '2', '-o', 'x.pvd'], 'wake'),
            ('a series is a PVD file', ['sample', 'wake', '--steps', '2', '-o', 'x.vtu'], '.pvd'),
            ('no steps', ['sample', 'wake', '--steps', '0', '-o', 'x.pvd'], 'steps'), ('size 0',
                                                                                       ['sample', 'cube', '--size',
                                                                                        '0', '-o', 'x.vtu'], 'size'),
            ('size too large', ['sample', 'cube', '--size', '501', '-o', 'x.vtu'], '500'),
            ('unknown extension', ['sample', 'cube', '-o', 'x.obj'], '.vtu'),
            ('no extension', ['convert', path('fin.vtu'), '-o', 'x'], 'extension'),
            ('no input', ['convert', '-o', 'x.vtu'], 'INPUT'), ('two inputs', ['convert', 'a', 'b', '-o', 'x.vtu'],
                                                                'INPUT'),
            ('unknown option', ['convert', '--fast', 'a', '-o', 'x.vtu'], '--fast'),
            ('option without value', ['convert', 'a', '-o'], '-o')):
        done = tetlod(*arguments)
        message = done.stderr.decode()
        report('usage: ' + name, done.returncode == 2 and mentions in message and message.count('\n') == 1, done)


def blunt_fin():
    grid, solution = (os.path.join(DATA, name) for name in ('bluntfinxyz.bin', 'bluntfinq.bin'))
    if not os.path.exists(grid) or not os.path.exists(solution):
        report('convert: NASA blunt fin', True, skip='its files are not there')
        return
    done = tetlod('convert', grid, '--q', solution, '-o', path('blunt.vtu'))
    report('convert: NASA blunt fin', done.returncode == 0, done)
    points, cells, fields = read_vtu('blunt.vtu')
    report('blunt fin: 40,960 vertices, 187,395 tetrahedra', (len(points), len(cells)) == (40960, 187395))
    raw = np.fromfile(grid, '>f4', offset=12).reshape(3, -1).T
    report('blunt fin: positions', points.dtype == np.float32 and np.array_equal(points, raw))
    q = np.fromfile(solution, '>f4', offset=28)[:5 * len(points)].reshape(5, -1).astype(float)
    pressure = (0.4 * (q[4] - (q[1] * q[1] + q[2] * q[2] + q[3] * q[3]) / (2 * q[0]))).astype(np.float32)
    report('blunt fin: fields', list(fields) == ['Density', 'Momentum', 'StagnationEnergy', 'Pressure']
           and np.array_equal(fields['Density'], q[0]) and np.array_equal(fields['Momentum'], q[1:4].T)
           and np.array_equal(fields['StagnationEnergy'], q[4]) and np.array_equal(fields['Pressure'], pressure))
    p = points.astype(float)[cells]
    volume = np.einsum('ij,ij->i', p[:, 1] - p[:, 0], np.cross(p[:, 2] - p[:, 0], p[:, 3] - p[:, 0]))
    report('blunt fin: none negative, 77 zero', ((volume < 0).sum(), (volume == 0).sum()) == (0, 77))


def plot3d():
    """Either byte order, either precision, a left-handed grid; bytes after the solution are not read."""
    dims, n = (3, 4, 5), 60
    k, j, i = np.meshgrid(*map(np.arange, dims[::-1]), indexing='ij')
    points = np.column_stack([-i.ravel() + 0.1 * j.ravel(), j.ravel(), k.ravel()])
    values = np.random.default_rng(3).random((5, n)) + 1
    for order in '<', '>':
        for kind in 'f4', 'f8':
            head = np.array(dims, order + 'i4').tobytes()
            with open(path('grid.xyz'), 'wb') as file:
                file.write(head + points.T.astype(order + kind).tobytes())
            with open(path('flow.q'), 'wb') as file:
                file.write(head + np.concatenate([[1, 2, 3, 4], values.ravel()]).astype(order + kind).tobytes() +
                           b'more')
            done = tetlod('convert', path('grid.xyz'), '--q', path('flow.q'), '-o', path('out.vtu'))
            got, cells, fields = read_vtu('out.vtu')
            p = got.astype(float)[cells]
            volume = np.einsum('ij,ij->i', p[:, 1] - p[:, 0], np.cross(p[:, 2] - p[:, 0], p[:, 3] - p[:, 0]))
            report('convert: PLOT3D %s%s' % (order, kind), done.returncode == 0 and got.dtype == kind
                   and np.array_equal(got, points.astype(kind)) and len(cells) == 5 * 2 * 3 * 4 and (volume > 0).all()
                   and np.array_equal(fields['StagnationEnergy'], values[4].astype(kind))
                   and fields['Pressure'].dtype == kind and b'24 cells split' in done.stderr, done)


def stream():
    """The finest level of a stream is a mesh like any other."""
    tetlod('sample', 'torus', '--size', '3', '-o', path('ring.vtu'))
    tetlod('build', '--quiet', path('ring.vtu'), '-o', path('ring.tetlod'))
    done = tetlod('convert', path('ring.tetlod'), '-o', path('ring2.vtu'))
    (points, cells, fields), (points2, cells2, fields2) = read_vtu('ring.vtu'), read_vtu('ring2.vtu')
    a, b = (np.column_stack([p, f['temperature']])[c].reshape(len(c), -1) for p, c, f in
            ((points, cells, fields), (points2, cells2, fields2)))
    same = sorted(sorted(map(tuple, row.reshape(4, 4))) for row in a) == \
        sorted(sorted(map(tuple, row.reshape(4, 4))) for row in b)
    report('convert: a stream', done.returncode == 0 and len(points) == len(points2) and same, done)


def output():
    """What is in the output's place is a whole file, whatever happens to the writer."""
    os.mkdir(path('killed'))
    target = path('killed/cube.vtu')
    left = []
    for delay in np.linspace(0.02, 0.5, 12):
        child = subprocess.Popen([TETLOD, 'sample', 'cube', '--size', '70', '-o', target])
        time.sleep(delay)
        child.kill()
        child.wait()
        left += [name for name in os.listdir(path('killed')) if name != 'cube.vtu']
    report('a killed writer leaves nothing', not left, left)
    old = open(path('fin.vtu'), 'rb').read()

    def small_files():
        signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
        resource.setrlimit(resource.RLIMIT_FSIZE, (20000, 20000))
    done = tetlod('sample', 'fin', '--size', '30', '-o', path('fin.vtu'), preexec_fn=small_files, restore_signals=False)
    report('a failed write keeps the older file', done.returncode == 1 and open(path('fin.vtu'), 'rb').read() == old
           and b'File too large' in done.stderr, done)
    done = tetlod('sample', 'cube', '-o', path('no/cube.vtu'))
    report('no such folder', done.returncode == 1 and b'make the folder first' in done.stderr, done)
    os.mkdir(path('folder.vtu'))
    done = tetlod('sample', 'cube', '-o', path('folder.vtu'))
    report('the output is a folder', done.returncode == 1 and b'directory' in done.stderr, done)
    os.symlink('/dev/full', path('full.vtu'))
    done = tetlod('sample', 'cube', '-o', path('full.vtu'))
    report('a full device, which stays one', done.returncode == 1 and os.path.islink(path('full.vtu'))
           and b'No space' in done.stderr, done)
    tetlod('sample', 'cube', '--size', '3', '-o', path('small.vtu'))
    for out in 'full.tetlod', 'rest.tetlod':
        os.symlink('/dev/full', path(out))
    done = tetlod('build', path('small.vtu'), '-o', path('full.tetlod'), '--quiet')
    report('build says which device is full', done.returncode == 1 and
           done.stderr.startswith(b'tetlod: ' + path('full.tetlod').encode())
           and b'No space' in done.stderr, done)
    tetlod('build', path('small.vtu'), '-o', path('small.tetlod'), '--quiet')
    done = tetlod('extract', path('small.tetlod'), '-o', path('rest.tetlod'), '--error', '1%')
    report('extract as well', done.returncode == 1 and
           done.stderr.startswith(b'tetlod: ' + path('rest.tetlod').encode())
           and b'No space' in done.stderr, done)
    for words in ('info', '--json', path('small.tetlod')), ('help', 'build'):
        with open('/dev/full', 'w') as full:
            done = subprocess.run([TETLOD, *words], stdout=full, stderr=subprocess.PIPE)
        report('what cannot be printed is said: ' + words[0], done.returncode == 1 and
               b'cannot write to standard output' in done.stderr, done)
    done = subprocess.run('"%s" sample cube --size 2 -o "%s" && "%s" convert "%s" -o "%s"' % (
        TETLOD, path('a.vtu'), TETLOD, path('a.vtu'), path('a.vtu')), shell=True)
    report('the input is not written onto', done.returncode == 2 and len(read_vtu('a.vtu')[1]) == 48)
    mode = os.stat(path('a.vtu')).st_mode & 0o777
    mask = os.umask(0)
    os.umask(mask)
    report('permissions as the umask says', mode == 0o666 & ~mask, oct(mode))


samples()
series()
names_in_xml()
usage()
blunt_fin()
plot3d()
stream()
output()
finish()
