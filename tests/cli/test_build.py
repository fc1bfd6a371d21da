#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""`tetlod build`, `info`, `extract`, `verify` and `compare` as a user meets them."""
import hashlib
import json
import os
import shutil
import signal
import struct
import subprocess
import sys
import time

import numpy as np
import vtk

sys.path.insert(0, os.path.join(os.environ.get('ROOT', '.'), 'tests'))
from common import CONFIG, SANITIZED, TETLOD, fails, finish, info, path, read_vtu, report, succeeds, tetlod
from streams import plain, sealed

MEASURES = ['max', 'sampled', 'rms', 'predicted']


def odd(order):
    """Whether a permutation of four is odd."""
    return sum(order[i] > order[j] for i in range(4) for j in range(i + 1, 4)) % 2


def as_set(mesh):
    """A mesh apart from the order of its points, cells, and corners up to even permutations."""
    points, cells, fields = mesh
    rows = np.concatenate([points.astype('f8')] + [fields[k].astype('f8').reshape(len(points),
                                                                                  -1) for k in sorted(fields)], 1)
    keys = [row.tobytes() for row in rows]
    tets = set()
    for cell in cells:
        corners = [keys[v] for v in cell]
        order = sorted(range(4), key=lambda i: corners[i])
        tets.add((tuple(corners[i] for i in order), odd(order)))
    return sorted(keys), tets, {k: v.dtype.str for k, v in fields.items()}, points.dtype.str


def write_vtu(name, points, cells, fields, kind='Float32'):
    def array(values, array_kind, array_name, width):
        text = ' '.join(repr(float(v)) if 'Float' in array_kind else str(int(v)) for v in np.asarray(values).ravel())
        return '<DataArray type="%s" Name="%s" NumberOfComponents="%d" format="ascii">%s</DataArray>' % (
            array_kind, array_name, width, text)
    data = ''.join(array(v, kind, k, np.asarray(v).size // len(points)) for k, v in fields.items())
    with open(path(name), 'w') as file:
        file.write(
            '<VTKFile type="UnstructuredGrid" version="0.1" byte_order="LittleEndian"><UnstructuredGrid>'
            '<Piece NumberOfPoints="%d" NumberOfCells="%d"><PointData>%s</PointData><Points>%s</Points><Cells>%s%s%s'
            '</Cells></Piece></UnstructuredGrid></VTKFile>' %
            (len(points), len(cells), data, array(points, kind, 'Points', 3), array(
                cells, 'Int64', 'connectivity', 1), array(4 * np.arange(1,
                                                                        len(cells) + 1), 'Int64', 'offsets',
                                                          1), array([10] * len(cells), 'UInt8', 'types', 1)))
    return name


def digest(name):
    return hashlib.sha256(open(path(name), 'rb').read()).hexdigest()


# ---- the whole way


def round_trip(name, build=(), against=None):
    """Builds NAME.vtu, verifies against it, extracts the finest level and compares it with the input through VTK."""
    done = tetlod('build', name + '.vtu', '-o', name + '.tetlod', *build)
    report('%s: build' % name, done.returncode == 0 and done.stdout.startswith(b'level '), done)
    succeeds('%s: verify --against' % name, 'verify', name + '.tetlod', '--against', against or name + '.vtu')
    done = tetlod('extract', name + '.tetlod', '-o', name + '.out.vtu')
    mesh, wanted = read_vtu(name + '.out.vtu'), read_vtu(name + '.vtu')
    wanted = wanted[0], wanted[1], {k: v for k, v in wanted[2].items() if k in mesh[2]}
    report('%s: the finest level is the input' % name, done.returncode == 0 and as_set(mesh) == as_set(wanted), done)


def samples():
    for name, size in ('cube', 4), ('fin', 4), ('torus', 2), ('shell', 3), ('delta', 2):
        tetlod('sample', name, '--size', str(size), '-o', name + '.vtu')
        round_trip(name)


def shape_of_json():
    done = tetlod('build', 'fin.vtu', '-o', 'fin.tetlod', '--field', 'Pressure', '--json', '--quiet')
    report('build --json --quiet: JSON alone', done.returncode == 0 and not done.stderr, done)
    built, shown = json.loads(done.stdout), info('fin.tetlod')
    report('build --json is info --json and more', all(built[k] == v for k, v in shown.items()) and
           set(built) - set(shown) == {'seconds', 'refused', 'contractions', 'peak_memory', 'bytes_per_tetrahedron',
                                       'threads', 'nan_filled', 'scratch_files', 'scratch_given_back'},
           set(built) ^ set(shown))
    report('build --json: seconds by phase',
           set(built['seconds']) == {'read', 'contract', 'measure', 'encode', 'write'} and
           all(s >= 0 for s in built['seconds'].values()), built['seconds'])
    report('info --json: what it has',
           {'id', 'cid', 'vertices', 'tets', 'bytes', 'bounds', 'lossless', 'degenerate_tets',
           'inverted_tets', 'unused_points', 'fields', 'levels'} <= set(shown) and shown['id'] == 'fin', sorted(shown))
    points, cells, fields = read_vtu('fin.vtu')
    report('info --json: counts, bounds, bytes', (shown['vertices'], shown['tets'], shown['lossless']) ==
           (len(points), len(cells), True) and shown['bytes'] == os.path.getsize(path('fin.tetlod')) and
           np.array_equal(shown['bounds'], [points.min(0), points.max(0)]), shown['bounds'])
    good = [f['name'] for f in shown['fields']] == list(fields)
    for field in shown['fields']:
        values = fields[field['name']]
        good &= field['range'] == [values.min(), values.max()] and field['components'] == values.size // len(points)
        good &= field['type'] == 'float32' and field['controlled'] == (field['name'] == 'Pressure')
    report('info --json: fields', good, shown['fields'])
    levels_of_json(shown)


def levels_of_json(shown):
    levels = shown['levels']
    good = [l['level'] for l in levels] == list(range(len(levels))) and len(levels) > 5
    good &= (levels[-1]['vertices'], levels[-1]['tets'], levels[-1]['bytes']) == (shown['vertices'], shown['tets'],
                                                                                  shown['bytes'])
    for a, b in zip(levels, levels[1:]):  # the last is the tail: the same mesh with the original's values
        good &= a['vertices'] < b['vertices'] or (b is levels[-1] and a['vertices'] == b['vertices'])
        good &= a['bytes'] < b['bytes'] and a['domain_error'] >= b['domain_error']
        for field, errors in a['errors'].items():
            good &= all(errors[m] >= b['errors'][field][m] for m in errors)
    report('info --json: levels grow, errors fall', good)
    report('info --json: a driving field has all four measures, others have what is measured',
           all(list(l['errors']['Pressure']) == MEASURES and list(l['errors']['Density']) == ['sampled', 'rms']
               for l in levels), levels[0])
    report('info --json: the finest level is exact',
           all(e == 0 for f in levels[-1]['errors'].values() for e in f.values()))
    report('a certified error is no less than what is sampled', all(
        l['errors']['Pressure']['max'] >= l['errors']['Pressure']['sampled'] * (1 - 1e-9) for l in levels))
    done = tetlod('info', 'fin.tetlod', '--all')
    lines = done.stdout.decode().splitlines()
    report('info: a line for each level', done.returncode == 0 and sum(
        line.split()[:3] == [str(l['level']), str(l['vertices']), str(l['tets'])] for l in levels
        for line in lines if line[:1] == ' ') == len(levels), done.stdout.decode())


# ---- extract, compare


def extracted(*choice):
    done = tetlod('extract', 'fin.tetlod', '-o', 'level.vtu', *choice)
    if done.returncode:
        return done
    points, cells, _ = read_vtu('level.vtu')
    return len(points), len(cells)


def extract():
    levels = info('fin.tetlod')['levels']
    low, high = next(f['range'] for f in info('fin.tetlod')['fields'] if f['name'] == 'Pressure')

    def check(name, wanted, *choice):
        got = extracted(*choice)
        report('extract %s' % ' '.join(choice), got == (wanted['vertices'], wanted['tets']),
               (name, got, wanted['level']))

    def by_error(limit, measure='max', field='Pressure'):
        return next(l for l in levels if l['errors'][field][measure] <= limit)
    check('default', levels[-1])
    check('level', levels[2], '--level', '2')
    check('base', levels[0], '--level', '0')
    for text, limit in ('0.05', .05), ('5%', .05), ('0', 0), ('1e-3', 1e-3), ('7', 7):
        check('error', by_error(limit), '--error', text)
    for measure in MEASURES:
        check('measure', by_error(.02, measure), '--error', '2%', '--measure', measure)
    check('another field', by_error(.02, 'sampled', 'Density'), '--error', '0.02', '--measure', 'sampled', '--field',
          'Density')
    check('abs-error', by_error(.3 / (high - low)), '--abs-error', '0.3')
    for name, key in ('tets', 'tets'), ('bytes', 'bytes'):
        most = levels[4][key]
        check(name, levels[4], '--' + name, str(most))
        check(name, levels[3], '--' + name, str(most - 1))
        check('less than the base', levels[0], '--' + name, '1')
    check('bytes with a suffix', levels[-1], '--bytes', '1G')
    for output in 'level.vtk', 'level.msh', 'level.stl':
        done = tetlod('extract', 'fin.tetlod', '--level', '1', '-o', output)
        report('extract to %s' % output, done.returncode == 0 and os.path.getsize(path(output)) > 100, done)
    reader = vtk.vtkUnstructuredGridReader()
    reader.SetFileName(path('level.vtk'))
    reader.Update()
    report('the legacy file of a level is read by VTK', reader.GetOutput().GetNumberOfCells() == levels[1]['tets'])
    fails('extract: a level that is not there', 2, ['level'], 'extract', 'fin.tetlod', '--level', '999', '-o', 'x.vtu')
    fails('extract: a field that is not there', 3, ['heat'], 'extract', 'fin.tetlod', '--error', '0.1', '--field',
          'heat',
          '-o', 'x.vtu')
    fails('extract: no certified error of that field', 2, ['Density', '--measure'], 'extract', 'fin.tetlod', '--error',
          '0.1', '--field',
          'Density', '-o', 'x.vtu')
    for choice in ('--error', '-1'), ('--error', 'nan'), ('--error', 'x'), ('--tets', '-3'), ('--measure',
                                                                                              'mean'), ('--level', ''):
        fails('extract %s %r' % choice, 2, [choice[0].strip('-')], 'extract', 'fin.tetlod', *choice, '-o', 'x.vtu')
    fails('extract: two choices', 2, [], 'extract', 'fin.tetlod', '--level', '1', '--error', '0.1', '-o', 'x.vtu')
    fails('extract: no output', 2, ['-o'], 'extract', 'fin.tetlod')
    fails('extract: output of no known format', 2, ['x.xyz'], 'extract', 'fin.tetlod', '-o', 'x.xyz')
    report('extract: failures leave no file', not os.path.exists(path('x.vtu')))


def compare():
    shown = info('fin.tetlod')
    level = shown['levels'][3]
    extracted('--level', '3')
    done = tetlod('compare', 'fin.vtu', 'level.vtu', '--field', 'Pressure', '--json')
    got, wanted = json.loads(done.stdout or '{}'), level['errors']['Pressure']
    report('compare: what the builder measured', done.returncode == 0 and
           got['vertices'] == [shown['vertices'], level['vertices']]
           and got['tets'] == [shown['tets'],
                               level['tets']] and 0 < got['errors']['sampled'] <= wanted['sampled'] * (1 + 1e-9)
           and got['errors']['rms'] <= wanted['rms'] * (1 + 1e-9), (got, level))
    report('compare: not far below either', got['errors']['sampled'] > .5 * wanted['sampled'], (got, wanted))
    one = tetlod('compare', 'fin.vtu', 'level.vtu', '--field', 'Pressure', '--json', '--threads', '1')
    report('compare: the same on one thread', one.stdout == done.stdout)
    same = json.loads(tetlod('compare', 'fin.vtu', 'fin.tetlod', '--field', 'Velocity', '--json').stdout)
    report('compare: a mesh with its stream', same['errors']['sampled'] < 1e-9 and same['domain_error'] < 1e-9, same)
    fails('compare: no such field', 3, ['heat'], 'compare', 'fin.vtu', 'level.vtu', '--field', 'heat')
    fails('compare: one mesh', 2, [], 'compare', 'fin.vtu')
    points, cells, fields = read_vtu('cube.vtu')
    write_vtu('raised.vtu', points, cells, {'xyz': fields['xyz'] + 6.4})
    raised = json.loads(tetlod('compare', 'cube.vtu', 'raised.vtu', '--json').stdout)
    report('compare: a constant difference', abs(raised['errors']['sampled'] - .1) < 1e-6 and
           abs(raised['errors']['rms'] - .1) < 1e-6 and raised['domain_error'] < 1e-9, raised)


def domain():
    """The boundary moves within what is allowed, which is worth it, and every level says how far."""
    succeeds('sample: torus', 'sample', 'torus', '--size', '3' if SANITIZED else '5', '-o',
             'ring.vtu')
    left = {}
    for limit in '0', '0.2%', '1%':
        succeeds('build: --domain-error %s' % limit, 'build', 'ring.vtu', '--domain-error', limit, '-o', 'ring.tetlod',
                 '--quiet')
        succeeds('verify: --domain-error %s' % limit, 'verify', 'ring.tetlod', '--against', 'ring.vtu')
        levels = info('ring.tetlod')['levels']
        left[limit] = min(l['tets'] for l in levels if l['errors']['temperature']['max'] <= .05)
        report('info: the domain error is within %s' % limit,
               levels[0]['domain_error'] <= float(limit.strip('%')) / 100 + 1e-12,
               levels[0])
    report('build: the more the boundary may move, the fewer tetrahedra are left', SANITIZED or
           left['1%'] < .7 * left['0.2%'] and left['0.2%'] < left['0'], left)
    fails('build: a domain error that is no fraction', 2, ['domain-error'], 'build', 'ring.vtu', '--domain-error', '-1')


# ---- fields and meshes


def controlled(name):
    return {f['name']: f['controlled'] for f in info(name)['fields']}


def fields():
    build = ('build', 'fin.vtu', '-o', 'f.tetlod', '--quiet')
    names = [f['name'] for f in info('fin.tetlod')['fields']]
    succeeds('two fields', *build, '--field', 'Pressure', '--field', 'Density')
    shown = info('f.tetlod')
    report('two fields: both are held',
           [n for n, c in controlled('f.tetlod').items() if c] == ['Pressure', 'Density'] or
           {n for n, c in controlled('f.tetlod').items() if c} == {'Pressure', 'Density'}, shown['fields'])
    report('two fields: a level for both', extracted_of('f.tetlod', '5%') == next(
        l['tets'] for l in shown['levels'] if all(l['errors'][f]['max'] <= .05 for f in ('Pressure', 'Density'))))
    for part in 'mag', '0', '2':
        succeeds('Velocity:%s' % part, *build, '--field', 'Velocity:%s' % part)
        held = controlled('f.tetlod')
        report('Velocity:%s: held, and the vector with its magnitude' % part, held.get('Velocity:%s' % part) and
               held.get('Velocity') is (part == 'mag'), held)
    succeeds('a vector by name', *build, '--field', 'Velocity')
    report('a vector by name: held', controlled('f.tetlod')['Velocity'])
    succeeds('--carry', *build, '--field', 'Pressure', '--carry', 'Velocity')
    report('--carry: those and the driving one', set(controlled('f.tetlod')) == {'Pressure', 'Velocity'} and
           len(names) > 2, controlled('f.tetlod'))
    succeeds('--carry: verify', 'verify', 'f.tetlod', '--against', 'fin.vtu')
    succeeds('limits of their own', *build, '--field', 'Pressure:0.01', '--field', 'Density:10%', '--max-error', '1')
    base = info('f.tetlod')['levels'][0]['errors']
    report('limits of their own: held', base['Pressure']['max'] <= .01 * (1 + 1e-6) and
           .01 < base['Density']['max'] <= .1 * (1 + 1e-6),
           base)
    succeeds('--max-error', *build, '--field', 'Pressure', '--max-error', '2%')
    report('--max-error: held', info('f.tetlod')['levels'][0]['errors']['Pressure']['max'] <= .02 * (1 + 1e-6))
    succeeds('--min-tets', *build, '--min-tets', '100')
    report('--min-tets: held', 80 < info('f.tetlod')['levels'][0]['tets'] <= 100, info('f.tetlod')['levels'][0])
    for words, options in ((['heat', 'Pressure'], ('--field', 'heat')), (['Velocity:3'], ('--field', 'Velocity:3')),
                           (['heat'], ('--carry', 'heat')), (['twice'], ('--field', 'Density', '--field', 'Density'))):
        done = tetlod('build', 'fin.vtu', '-o', 'x.tetlod', *options)
        message = done.stderr.decode()
        report('build %s' % ' '.join(options), done.returncode in (2, 3) and message.count('\n') == 1 and
               all(w in message for w in words) and not os.path.exists(path('x.tetlod')), done)


def extracted_of(name, error):
    tetlod('extract', name, '--error', error, '-o', 'level.vtu')
    return len(read_vtu('level.vtu')[1])


def contraction_kinds():
    for options in (('--contract', 'face'), ('--contract', 'tet'), ('--contract', 'hybrid'), ('--metric', 'sva'),
                    ('--metric', 'measured'),
                    ('--growth', '2')):
        name = 'torus'
        done = tetlod('build', 'torus.vtu', '-o', 'torus.tetlod', '--quiet', *options)
        checked = tetlod('verify', 'torus.tetlod', '--against', 'torus.vtu')
        report('%s %s: verified' % (name, ' '.join(options)), done.returncode == 0 and checked.returncode == 0,
               (done, checked))


def certified_exactly():
    tetlod('sample', 'cube', '--size', '8', '-o', 'cube8.vtu')
    left = {}
    for how in 'fast', 'exact':
        done = tetlod('build', 'cube8.vtu', '-o', how + '.tetlod', '--quiet', '--certify', how)
        checked = tetlod('verify', how + '.tetlod', '--against', 'cube8.vtu')
        report('--certify %s: verified' % how, done.returncode == 0 and checked.returncode == 0, (done, checked))
        left[how] = extracted_of(how + '.tetlod', '1%')
    report('--certify exact leaves far fewer tetrahedra at 1 %', left['exact'] < .5 * left['fast'], left)
    close = extracted_of('exact.tetlod', '0.5%')
    report('--certify exact: values that fit, and positions searched for, leave less than 64 % at 0.5 %',
           close < .64 * 3072, close)
    tetlod('extract', 'exact.tetlod', '--error', '1%', '-o', 'level.vtu')
    truth = json.loads(tetlod('compare', 'cube8.vtu', 'level.vtu', '--json').stdout)['errors']
    level = next(l for l in info('exact.tetlod')['levels'] if l['errors']['xyz']['max'] <= .01)
    report('--certify exact: the true maximum is at most what is stored, and most of it',
           .9 * level['errors']['xyz']['max'] <
           truth['max'] <= level['errors']['xyz']['max'] * (1 + 1e-6), (truth, level))
    plain = digest('exact.tetlod')
    for threads in ('1', '3') if CONFIG == 'release' else ():
        tetlod('build', 'cube8.vtu', '-o', 'd.tetlod', '--quiet', '--certify', 'exact', '--threads', threads)
        report('--certify exact: the same bytes on %s threads' % threads, digest('d.tetlod') == plain)
    done = tetlod('build', 'fin.vtu', '-o', 'f.tetlod', '--quiet', '--certify', 'exact', '--field', 'Pressure',
                  '--field', 'Velocity:3%')
    checked = tetlod('verify', 'f.tetlod', '--against', 'fin.vtu')
    report('--certify exact: a scalar and a vector with a limit of its own', done.returncode == 0 and
           checked.returncode == 0,
           (done, checked))


def usage():
    fails('build --certify exact --metric sva', 2, ['--certify'], 'build', 'cube.vtu', '-o', 'x.tetlod', '--certify',
          'exact',
          '--metric', 'sva')
    for words, options in ((['--metric', 'magic'], ('--metric', 'magic')), (['--contract'], ('--contract', 'cells')), ([
            '--certify'
    ], ('--certify', 'hope')), (['max-error'], ('--max-error', '-1')), (['max-error'], ('--max-error', 'inf')), ([
            'growth'
    ], ('--growth', '1')), (['growth'], ('--growth', '17')), (['domain-error', '0 to 1'], ('--domain-error', '2')), ([
            'compress'
    ], ('--compress', '23')), (['measured', 'exact'], ('--metric', 'measured', '--certify', 'exact')), ([
            'candidates'
    ], ('--candidates', '5')), (['threads'], ('--threads', 'many')), (['min-tets'], ('--min-tets', '0')),
                           (['wish'], ('--wish', )), (['memory'], ('--memory', '0'))):
        fails('build %s' % ' '.join(options), 2, words, 'build', 'cube.vtu', '-o', 'x.tetlod', *options)
    fails('build without a mesh', 2, ['INPUT'], 'build')
    fails('build of two meshes that are no series', 3, ['step 1', 'fin.vtu'], 'build', 'cube.vtu', 'fin.vtu')
    fails('build --memory 1', 1, ['--memory'], 'build', 'cube.vtu', '-o', 'x.tetlod', '--memory', '1')
    fails('build into a folder that is not there', 1, ['nowhere'], 'build', 'cube.vtu', '-o', 'nowhere/x.tetlod',
          '--quiet')
    report('failed builds leave no file', not os.path.exists(path('x.tetlod')))
    os.makedirs(path('elsewhere'), exist_ok=True)
    done = subprocess.run([TETLOD, 'build', '../cube.vtu', '--quiet'], cwd=path('elsewhere'), stderr=subprocess.PIPE)
    report('build names its output after the input', done.returncode == 0 and
           os.listdir(path('elsewhere')) == ['cube.tetlod'],
           (done, os.listdir(path('elsewhere'))))


def abs_volume(name):
    points, cells, _ = read_vtu(name)
    p = points[cells]
    return np.abs(np.einsum('ij,ij->i', p[:, 1] - p[:, 0], np.cross(p[:, 2] - p[:, 0], p[:, 3] - p[:, 0]))).sum() / 6


def special_meshes():
    tet = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]
    write_vtu('one.vtu', tet, [[0, 1, 2, 3]], {'s': [1, 2, 3, 4]})
    round_trip('one')
    report('one tetrahedron: one level, and its exact values',
           [l['tets'] for l in info('one.tetlod')['levels']] == [1, 1])
    write_vtu('turned.vtu', tet, [[1, 0, 2, 3]], {'s': [1, 2, 3, 4]}, 'Float64')
    round_trip('turned')
    report('one tetrahedron turned: not inverted', info('turned.tetlod')['inverted_tets'] == 0)
    points, cells, values = read_vtu('cube.vtu')
    write_vtu('mirrored.vtu', points, cells[:, [1, 0, 2, 3]], values)
    round_trip('mirrored')
    mirrored, plain = info('mirrored.tetlod'), info('cube.tetlod')
    report('a mesh turned inside out: as coarse as the other', mirrored['inverted_tets'] == 0 and
           mirrored['levels'][0]['tets'] < 30 and plain['levels'][0]['tets'] < 30, mirrored['levels'][0])
    turned = np.random.default_rng(3).random(len(cells)) < 0.5
    mixed = np.where(turned[:, None], cells[:, [0, 1, 3, 2]], cells)
    write_vtu('mixed.vtu', points, mixed, values)
    round_trip('mixed')
    counts = lambda name: [(l['vertices'], l['tets'], l['errors']) for l in info(name)['levels']]
    report('a mesh numbered both ways: none is inverted, its levels are those of the mesh numbered one way',
           info('mixed.tetlod')['inverted_tets'] == 0 and counts('mixed.tetlod') == counts('cube.tetlod'))
    done = tetlod('build', 'mixed.vtu', '--keep-order', '-o', 'kept.tetlod')
    report('and how many are turned is said',
           b'%d tetrahedra are numbered the other way round' % min(turned.sum(), (~turned).sum()) in done.stderr, done)
    tetlod('extract', 'kept.tetlod', '--original-order', '-o', 'kept.vtu')
    report('and the original order has every corner where it was', np.array_equal(read_vtu('kept.vtu')[1], mixed))
    done = tetlod('extract', 'mixed.tetlod', '--error', '20%', '--box', '0,0,0,1.5,1.5,1.5', '--box-error', '0', '-o',
                  'part.vtu')
    report('and a region of it is a mesh', done.returncode == 0 and abs(abs_volume('part.vtu') - 64) < 1e-9, done)
    bodies = np.concatenate([cells, cells[:, [1, 0, 2, 3]] + len(points)])
    write_vtu('bodies.vtu', np.concatenate([points, points + 9]), bodies,
              {k: np.concatenate([v, v]) for k, v in values.items()})
    round_trip('bodies')
    report('two bodies, each numbered its own way: none is inverted, both are contracted',
           info('bodies.tetlod')['inverted_tets'] == 0 and
           info('bodies.tetlod')['levels'][0]['tets'] < 60, info('bodies.tetlod')['levels'][0])
    write_vtu('constant.vtu', points, cells, {'s': np.full(len(points), 7.5)})
    round_trip('constant')
    shown = info('constant.tetlod')
    report('a constant field: all errors are 0, the base is small', shown['levels'][0]['tets'] < 30 and
           all(e == 0 for l in shown['levels'] for e in l['errors']['s'].values()), shown['levels'][0])
    apart = np.concatenate([points, points + [10, 0, 0], points + [0, 20, 5]])
    write_vtu('three.vtu', apart, np.concatenate([cells, cells + len(points), cells + 2 * len(points)]),
              {'s': apart[:, 0] * apart[:, 1]})
    round_trip('three')
    report('three components: all are left in the base', components('three.tetlod') == 3)
    loose = np.concatenate([[[99, 99, 99]], points, [[-99, 0, 0]]])
    write_vtu('loose.vtu', loose, cells + 1, {'s': loose[:, 0]})
    done = tetlod('build', 'loose.vtu', '-o', 'loose.tetlod')
    shown = info('loose.tetlod')
    report('isolated points: dropped, counted and said', shown['unused_points'] == 2 and
           shown['vertices'] == len(points) and
           shown['bounds'][1] == [4, 4, 4] and b'2 points' in done.stderr, (shown['bounds'], done.stderr))
    flat = np.array([[0, 0, 9], [1, 0, 9], [0, 1, 9], [1, 1, 9]], 'f4')
    write_vtu('flat.vtu', np.concatenate([points, flat]), np.concatenate([cells, [np.arange(4) + len(points)]]),
              {'s': np.concatenate([points, flat]).sum(1)})
    round_trip('flat')
    report('a degenerate tetrahedron: counted, and left in every level', info('flat.tetlod')['degenerate_tets'] == 1 and
           components('flat.tetlod') == 2)


def components(name):
    """Of the base mesh."""
    tetlod('extract', name, '--level', '0', '-o', 'base.vtu')
    grid = vtk.vtkXMLUnstructuredGridReader()
    grid.SetFileName(path('base.vtu'))
    parts = vtk.vtkConnectivityFilter()
    parts.SetInputConnection(grid.GetOutputPort())
    parts.SetExtractionModeToAllRegions()
    parts.Update()
    return parts.GetNumberOfExtractedRegions()


# ---- what must not vary, and what may break


def determinism():
    digests = set()
    for threads in '1', '2', '5', '0', '1':
        tetlod('build', 'fin.vtu', '-o', 'd.tetlod', '--threads', threads, '--quiet')
        digests.add(digest('d.tetlod'))
    report('the same bytes on any number of threads', len(digests) == 1, digests)


def killed():
    """A build that is killed leaves its folder as it was, or, killed while it ends, with the whole new stream: never
    anything else."""
    os.makedirs(path('kill'), exist_ok=True)
    tetlod('sample', 'cube', '--size', '12' if CONFIG == 'release' else '6', '-o', 'big.vtu')
    tetlod('build', 'big.vtu', '-o', 'whole.tetlod', '--quiet')
    whole = open(path('whole.tetlod'), 'rb').read()
    for name, older in ('a killed build leaves no file', None), ('a killed build leaves the older file', b'older'):
        problems, stopped = [], 0
        for delay in .02, .1, .2, .4, .8:
            if os.path.exists(path('kill/out.tetlod')):
                os.remove(path('kill/out.tetlod'))
            if older:
                open(path('kill/out.tetlod'), 'wb').write(older)
            build = subprocess.Popen([TETLOD, 'build', '../big.vtu', '-o', 'out.tetlod', '--quiet'], cwd=path('kill'))
            time.sleep(delay)
            build.kill()
            build.wait()
            left = {file: open(path('kill/' + file), 'rb').read() for file in os.listdir(path('kill'))}
            stopped += left.get('out.tetlod') == older
            if left not in ({'out.tetlod': older} if older else {}, {'out.tetlod': whole}):
                problems.append((delay, {file: len(bytes) for file, bytes in left.items()}))
        report(name, stopped > 0 and not problems, (stopped, problems))


def stopped():
    """Ctrl-C and SIGTERM end a build at once and leave nothing, also where a file system has no files without a name
    (O_TMPFILE). One that comes when the output is there already, before the process has ended, leaves it whole."""
    tetlod('build', 'big.vtu', '-o', 'whole.tetlod', '--quiet')
    with open(path('whole.tetlod'), 'rb') as file:
        whole = file.read()
    shim = os.path.join(os.environ['ROOT'], 'build/release/tests/cli/no_tmpfile.so')
    for name, preload in ('', None), (' without O_TMPFILE', shim):
        if preload and CONFIG != 'release':
            report('a stopped build' + name, True, skip='release only')
            continue
        environment = dict(os.environ, LD_PRELOAD=preload) if preload else os.environ
        problems, ended, seen = [], 0, set()
        for number in signal.SIGINT, signal.SIGTERM:
            for delay in .05, .2, .5:
                folder = path('stop')
                shutil.rmtree(folder, ignore_errors=True)
                os.makedirs(folder)
                build = subprocess.Popen([TETLOD, 'build', '../big.vtu', '-o', 'out.tetlod', '--quiet'], cwd=folder,
                                         env=environment)
                time.sleep(delay)
                while preload and not os.listdir(folder) and build.poll() is None:  # a busy machine is slow to begin
                    time.sleep(.01)
                seen |= {file for file in os.listdir(folder) if file != 'out.tetlod'}
                build.send_signal(number)
                code, left = build.wait(), os.listdir(folder)
                ended += code == -number and not left
                done = left == ['out.tetlod'] and open(os.path.join(folder, 'out.tetlod'), 'rb').read() == whole
                if code not in (0, -number) or not (done or (left == [] and code)):
                    problems.append((number, delay, code, left))
        report('a stopped build%s leaves nothing' % name, ended and not problems and bool(seen) == bool(preload),
               (ended, seen, problems))


def damaged():
    good = open(path('torus.tetlod'), 'rb').read()
    levels = info('torus.tetlod')['levels']
    start = levels[0]['offset']
    places = {'first byte': 0, 'version': 9, 'header': 20, 'index': start // 2, 'end of the index': start - 1,
              'base mesh': (start + levels[0]['bytes']) // 2, 'records': (levels[2]['bytes'] + levels[3]['bytes']) // 2,
              'last byte': len(good) - 1}
    for where, at in places.items():
        with open(path('damaged.tetlod'), 'wb') as file:
            file.write(good[:at] + bytes([good[at] ^ 0x10]) + good[at + 1:])
        fails('damaged %s: verify' % where, 3, ['damaged.tetlod'], 'verify', 'damaged.tetlod', '--quiet')
        fails('damaged %s: extract' % where, 3, ['damaged.tetlod'], 'extract', 'damaged.tetlod', '-o', 'x.vtu')
        if at < start:
            fails('damaged %s: info' % where, 3, ['damaged.tetlod'], 'info', 'damaged.tetlod')
        else:
            done = tetlod('info', 'damaged.tetlod', '--json')
            report('damaged %s: the index can be read' % where, done.returncode == 0 and
                   json.loads(done.stdout)['levels'] == levels)
    report('damaged streams: no output', not os.path.exists(path('x.vtu')))
    prefix = levels[2]['bytes']
    with open(path('cut.tetlod'), 'wb') as file:
        file.write(good[:prefix])
    done = tetlod('extract', 'cut.tetlod', '--level', '2', '-o', 'level.vtu')
    report('a prefix gives its finest level', done.returncode == 0 and
           len(read_vtu('level.vtu')[1]) == levels[2]['tets'], done)
    fails('a prefix does not give more', 3, ['cut.tetlod'], 'extract', 'cut.tetlod', '--level', '3', '-o', 'x.vtu')
    fails('a prefix is not verified', 3, ['cut.tetlod'], 'verify', 'cut.tetlod', '--quiet')
    for name, content in ('empty', b''), ('text', b'not a stream\n' * 9), ('header alone', good[:40]):
        open(path('other.tetlod'), 'wb').write(content)
        for command in ('info', 'other.tetlod'), ('verify', 'other.tetlod'), ('extract', 'other.tetlod', '-o', 'x.vtu'):
            fails('%s: %s' % (name, command[0]), 3, ['other.tetlod'], *command)
    for command in ('info', 'none.tetlod'), ('verify', 'none.tetlod'), ('extract', 'none.tetlod', '-o', 'x.vtu'), \
            ('compare', 'none.tetlod', 'cube.vtu'):
        fails('missing: %s' % command[0], 1, ['none.tetlod'], *command)


def against():
    """verify --against sees what differs."""
    points, cells, fields = read_vtu('cube.vtu')
    moved, raised = points.copy(), fields['xyz'].copy()
    moved[17, 1] = np.nextafter(moved[17, 1], np.float32(9))
    raised[20] = np.nextafter(raised[20], np.float32(99))
    turned = cells.copy()
    turned[5] = turned[5][[1, 0, 2, 3]]
    for name, mesh in (('a coordinate', (moved, cells, fields)), ('a value', (points, cells, {'xyz': raised})),
                       ('an orientation', (points, turned, fields)), ('a tetrahedron missing',
                                                                      (points, cells[:-1], fields))):
        fails('verify --against: %s' % name, 3, ['cube.tetlod'], 'verify', 'cube.tetlod', '--quiet', '--against',
              write_vtu('other.vtu', *mesh))
    order = np.random.default_rng(5).permutation(len(points))
    places = np.argsort(order)
    even = places[cells][::-1][:, [1, 2, 0, 3]]
    write_vtu('order.vtu', points[order], even, {'xyz': fields['xyz'][order]})
    succeeds('verify --against: another order is the same mesh', 'verify', 'cube.tetlod', '--against', 'order.vtu')
    done = tetlod('verify', 'cube.tetlod', '--json')
    report('verify --json', done.returncode == 0 and json.loads(done.stdout)['ok'] is True, done)


def forge_max(name, coarsest, most):
    """The stream with the stored `max` of its only field cut to `most` from a level on, whole in every other respect.
    """
    shown, data = info(name), bytearray(plain(open(path(name), 'rb').read()))
    size = struct.unpack_from('<I', data, 20)[0]
    for level in shown['levels'][coarsest:]:
        at = data.index(struct.pack('<QQd', level['vertices'], level['tets'], level['domain_error']), 64,
                        64 + size) + 24
        stored = struct.unpack_from('<d', data, at)[0]
        struct.pack_into('<d', data, at, min(stored, most))
    data = sealed(data)
    with open(path('forged.tetlod'), 'wb') as out:
        out.write(data)


def forged():
    """A certified error below the exact one, though not below the measured ones, is found."""
    tetlod('build', 'fin.vtu', '-o', 'honest.tetlod', '--contract', 'tet', '--carry', 'Pressure', '--quiet')
    checked = json.loads(tetlod('verify', 'honest.tetlod', '--against', 'fin.vtu', '--json').stdout)
    levels = len(info('honest.tetlod')['levels'])
    report('verify --against: measures every level, and takes the exact maximum of all of a small mesh',
           checked['measured_levels'] == levels and checked['exact_levels'] == list(range(levels)), checked)
    done = tetlod('verify', 'honest.tetlod', '--against', 'fin.vtu')
    report('verify --against: says so',
           b'%d levels measured, max held against the exact maximum at all of them' % levels in
           done.stdout, done)
    room = []
    for level in checked['exact_levels']:
        tetlod('extract', 'honest.tetlod', '--level', str(level), '-o', 'level.vtu', '--quiet')
        found = json.loads(tetlod('compare', 'fin.vtu', 'level.vtu', '--json').stdout)['errors']
        room.append((found['max'] / (found['sampled'] or 1), level, (found['max'] + found['sampled']) / 2))
    ratio, level, lie = max(room)
    report('forged max: there is room for a lie', ratio > 1.001, room)
    forge_max('honest.tetlod', 0, 1)
    report('forged max: nothing changed but what is to be', open(path('forged.tetlod'), 'rb').read() ==
           plain(open(path('honest.tetlod'), 'rb').read()))
    forge_max('honest.tetlod', level, lie)
    succeeds('forged max: the stream alone is well', 'verify', 'forged.tetlod')
    fails('forged max: found by the exact maximum', 3, ['level %d' % level, 'certified', 'exact maximum'], 'verify',
          'forged.tetlod', '--against', 'fin.vtu', '--quiet')


def compression():
    """All of the coder's rates of learning give no more bytes than the usual one, and hardly fewer."""
    size = {}
    for effort in '1', '19', '22':
        succeeds('compress %s' % effort, 'build', 'fin.vtu', '--field', 'Pressure', '-o', 'effort.tetlod',
                 '--compress', effort, '--quiet')
        succeeds('compress %s: verify' % effort, 'verify', 'effort.tetlod', '--quiet')
        size[effort] = os.path.getsize(path('effort.tetlod'))
    report('compress: more effort, no more bytes, within 0.1 %',
           .999 * size['19'] <= size['22'] <= size['19'] <= size['1'], size)


samples()
shape_of_json()
extract()
compare()
domain()
fields()
contraction_kinds()
certified_exactly()
usage()
special_meshes()
determinism()
killed()
stopped()
damaged()
against()
forged()
compression()
finish()
