#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""A series in time: `build` of a PVD file or of several files, `extract --time`, `info`, `verify --against`."""
import glob
import json
import os
import re
import sys
import urllib.request

import numpy as np

from cell_meshes import block, coil, save
from common import (
    CONFIG, SANITIZED, case, fails, finish, info, must, path, read_grid, read_vtu, report, succeeds, tetlod, write,
)

sys.path[:0] = [os.path.join(os.environ['ROOT'], *part) for part in (('client-examples', 'python'), ('tests', 'http'))]
os.environ['TETLOD_LIBRARY'] = glob.glob(os.path.join(os.environ['ROOT'], 'build', 'release', 'libtetlod.so.*'))[0]
import tetlod as client  # noqa: E402
from served import Server  # noqa: E402
from tetlod import reference  # noqa: E402

STEPS = 20


def step(name, *choice):
    done = must('extract', path(name), *choice, '-o', path('step.vtu'))
    return read_vtu('step.vtu'), done.stderr.decode()


def exact_case():
    for number in (0, 7, 8, STEPS - 1):
        (points, cells, fields), _ = step('wake.tetlod', '--step', str(number), '--original-order')
        wanted = read_vtu('wake_%d.vtu' % number)
        if not (np.array_equal(points, wanted[0]) and np.array_equal(cells, wanted[1]) and
                set(fields) == {'Pressure', 'Velocity:mag', 'Velocity'}):
            return 'another mesh at step %d' % number
        for name in ('Pressure', 'Velocity'):
            if fields[name].tobytes() != wanted[2][name].tobytes():
                return '%s differs at step %d' % (name, number)
    return None


def within_case():
    ranges = {field['name']: field['range'] for field in info(path('wake.tetlod'))['series']['fields']}
    width = ranges['Pressure'][1] - ranges['Pressure'][0]
    for number in (0, 11):
        for error in (0.05, 0.01):
            (points, _, fields), said = step('wake.tetlod', '--step', str(number), '--error', str(error))
            promised = float(re.search(r'Pressure within (\S+) %', said).group(1)) / 100
            must('convert', path('wake_%d.vtu' % number), '-o', path('original.vtk'))
            done = must('compare', path('wake_%d.vtu' % number), path('step.vtu'), '--field',
                        'Pressure').stdout.decode()
            found = float(re.search(r'max +\S+ % of the range \((\S+)\)', done).group(1)) / width
            if not 0 < found <= promised <= error:
                return 'step %d: %g of the range, promised %g, asked %g' % (number, found, promised, error)
    return None


def chosen_case():
    times = info(path('wake.tetlod'))['series']['times']
    near = 0.6 * times[4] + 0.4 * times[5]
    said = step('wake.tetlod', '--time', repr(near), '--error', '5%')[1]
    if 'step 4 of 0..%d' % (STEPS - 1) not in said:
        return said
    units = step('wake.tetlod', '--step', '4', '--abs-error', '1e9')[1]
    return None if 'level' in units and units.count('\n') == 1 else units


def info_case():
    series = info(path('wake.tetlod'))['series']
    errors = [band['error'] for band in series['bands']]
    tets = [band['tets'] for band in series['bands']]
    if series['steps'] != STEPS or errors != [0.05, 0.01, 0.0] or tets != sorted(tets) or not 0 < tets[0] < tets[-1]:
        return series
    if any(band['largest_error'] > band['error'] for band in series['bands']):
        return series
    text = must('info', path('wake.tetlod')).stdout.decode()
    return None if '%d steps in time' % STEPS in text else text


def plot_case():
    must('plot', path('wake.tetlod'), '--steps', '--field', 'Velocity:mag', '-o', path('steps.svg'))
    picture = open(path('steps.svg')).read()
    curves = [(kind, [tuple(map(float, pair.split(','))) for pair in points.split()])
              for kind, points in re.findall(r'class="(\w+)"[^>]*points="([^"]*)"', picture)]
    promises = [
        float(y)
        for y in re.findall(r'<line x1="90.0" y1="([0-9.]+)" x2="950.0"[^>]*stroke="#(?:0072b2|d55e00)"', picture)
    ]
    if [kind for kind, _ in curves] != ['rms', 'sampled'] * 2 or len(promises) != 2 or '>5 %<' not in picture:
        return picture
    for (_, rms), (_, sampled), promise in zip(curves[::2], curves[1::2], promises):
        if not len(rms) == len(sampled) == STEPS or not all(r[1] > s[1] >= promise - 0.02 and r[0] == s[0]
                                                            for r, s in zip(rms, sampled)):
            return rms, sampled, promise
    return None


def band_case():
    """An error of --bands is a rung of the ladder, even one between the round errors."""
    must('build', path('wake.pvd'), '--times', '0:3', '--field', 'Pressure', '--bands', '10%,4%,2%', '-o',
         path('bands.tetlod'))
    tets = [band['tets'] for band in info(path('bands.tetlod'))['series']['bands']]
    return None if tets[0] < 0.97 * tets[1] < 0.97 ** 2 * tets[2] else tets


def few_keys_case():
    """With little memory some steps drive, and what the others are certified to holds as well."""
    build = ['build', path('wake.pvd'), '--field', 'Velocity', '--carry', 'Velocity', '--bands', '5%,1%', '-o',
             path('keys.tetlod'), '--memory']
    kilobytes = int(re.search(r'needs about (\d+) MB', tetlod(*build, '1M').stderr.decode()).group(1)) * 1024
    for kilobytes in range(kilobytes - 1024, kilobytes + 4096, 80):
        done = tetlod(*build, '%dK' % kilobytes)
        if done.returncode == 0:
            break
        if done.returncode != 1 or b'memory' not in done.stderr:
            return done
    drove = int(re.search(r'of which (\d+) limit the contraction', done.stderr.decode()).group(1))
    if not 16 <= drove < STEPS:
        return 'drove: %d of %d at %d kB' % (drove, STEPS, kilobytes)
    must('verify', path('keys.tetlod'), '--against', path('wake.pvd'))
    return None


def memory_case():
    """Ten times as many steps take no more memory, on any number of threads: nothing of a step is kept, no temporary
    file is mapped."""
    if CONFIG != 'release':
        return None
    must('sample', 'wake', '--size', '4', '--steps', str(STEPS), '-o', path('few.pvd'))
    sets = ''.join('<DataSet timestep="%d" file="few_%d.vtu"/>' % (i, i % STEPS) for i in range(1000))
    with open(path('many.pvd'), 'w') as file:
        file.write('<VTKFile type="Collection" version="0.1"><Collection>%s</Collection></VTKFile>' % sets)
    build = ['build', path('many.pvd'), '--field', 'Velocity', '--carry', 'Velocity', '--bands', '5%,1%', '-o',
             path('many.tetlod'), '--json', '--quiet']
    room = 2 + int(re.search(r'needs about (\d+) MB', tetlod(*build, '--memory', '1M').stderr.decode()).group(1))
    peaks = [json.loads(must(*build, '--memory', '%dM' % room, '--threads', '8', '--times',
                             times).stdout)['peak_memory'] / 2 ** 20 for times in ('0:99', ':')]
    return None if peaks[1] - peaks[0] < 1.2 and max(peaks) < 1.1 * room else (peaks, room)


def temporary_case():
    """Temporary files are in TMPDIR: a folder that is not there is named; one that has no files without a name is left
    empty."""
    build = ['build', path('wake.pvd'), '--times', '0:3', '--field', 'Pressure', '--bands', '5%', '--quiet', '-o']
    done = tetlod(*build, path('none.tetlod'), env=dict(os.environ, TMPDIR=path('missing')))
    if done.returncode != 1 or 'missing' not in done.stderr.decode() or 'TMPDIR' not in done.stderr.decode():
        return done
    os.makedirs(path('named'), exist_ok=True)
    must(*build, path('usual.tetlod'))
    environment = dict(os.environ, TMPDIR=path('named'))
    if CONFIG == 'release':
        environment['LD_PRELOAD'] = os.path.join(os.environ['ROOT'], 'build/release/tests/cli/no_tmpfile.so')
    done = tetlod(*build, path('named.tetlod'), env=environment)
    same = done.returncode == 0 and open(path('named.tetlod'), 'rb').read() == open(path('usual.tetlod'), 'rb').read()
    return None if same and not os.listdir(path('named')) else (done, os.listdir(path('named')))


def files_case():
    names = [path('wake_%d.vtu' % i) for i in (3, 5, 9)]
    must('build', *names, '--field', 'Pressure', '--carry', 'Pressure', '--bands', '5%', '-o', path('files.tetlod'))
    said = must('verify', path('files.tetlod'),
                *[word for name in names for word in ('--against', name)]).stdout.decode()
    must('build', path('wake.pvd'), '--times', '3:9:3', '--field', 'Pressure', '--carry', 'Pressure', '-o',
         path('some.tetlod'))
    some = info(path('some.tetlod'))['series']
    must('verify', path('some.tetlod'), '--against', path('wake.pvd'), '--times', '3:9:3')
    wrong = tetlod('verify', path('some.tetlod'), '--against', path('wake.pvd'), '--times', '4:10:3')
    swapped = [names[0], names[2], names[1]] + names[3:]
    other = tetlod('verify', path('files.tetlod'), *[word for name in swapped for word in ('--against', name)])
    good = ('3 steps' in said and some['steps'] == 3 and wrong.returncode == 3 and other.returncode == 3
            and b'step 1: ' in other.stderr)
    return None if good and 'series' in info(path('files.tetlod')) else (said, some, wrong, other)


def one_step_case():
    must('build', path('wake.pvd'), '--time', '2', '--field', 'Pressure', '-o', path('one.tetlod'))
    return 'a series' if 'series' in info(path('one.tetlod')) else None


def write_grid(name, grid):
    import vtk
    writer = vtk.vtkXMLUnstructuredGridWriter()
    writer.SetFileName(path(name))
    writer.SetInputData(grid)
    writer.Write()
    return path(name)


def clipped_case():
    """Waves that are cut off at both ends of the range: L and U pass it, and must not be cut there (PROOF.md, 10)."""
    from vtk.util.numpy_support import numpy_to_vtk
    must('sample', 'wake', '--size', '6', '-o', path('waves.vtu'))
    grid, points, names = read_grid('waves.vtu'), read_vtu('waves.vtu')[0].astype(np.float64), []
    for number in range(4):
        random = np.random.default_rng(number)
        waves = np.sin(points @ (1.5 * random.normal(size=(6, 3))).T + random.uniform(0, 6, 6)).sum(axis=1)
        array = numpy_to_vtk(np.clip(0.5 * waves, 0, 1).astype(np.float32), deep=True)
        array.SetName('waves')
        grid.GetPointData().AddArray(array)
        names.append(write_grid('waves_%d.vtu' % number, grid))
    must('build', *names, '--field', 'waves', '--carry', 'waves', '--bands', '40%,20%,10%', '-o', path('waves.tetlod'))
    must('verify', path('waves.tetlod'), *[word for name in names for word in ('--against', name)])


def own_error_case():
    """A step is taken in the coarsest band in which its own errors are within the asked one, by every reader."""
    stream = reference.open(path('wake.tetlod'))
    series, fields = stream.series(), range(len(stream.series().fields))

    def own(band, number):
        return max(series.error(band, number, f) for f in fields)

    number = min(range(STEPS), key=lambda at: own(0, at))
    error, below = own(0, number), np.nextafter(own(0, number), 0)
    widths = [field['range'][1] - field['range'][0] for field in series.fields]
    units = max(series.error(0, number, f) * widths[f] for f in fields)
    if not error < series.bands[0]['error'] or series.band_for_error(error) == 0:
        return 'nothing to choose: %g' % error
    for choice, band in (({'error': error}, 0), ({'error': below}, 1), ({'abs_error': units}, 0),
                         ({'abs_error': np.nextafter(units, 0)}, 1)):
        wanted = stream.levels[series.bands[band]['level']]['tets']
        words = ['--%s' % name.replace('_', '-') for name in choice] + [repr(float(limit)) for limit in choice.values()]
        found = [len(step('wake.tetlod', '--step', str(number), *words)[0][1])]
        found += [len(client.open(path('wake.tetlod'), decoder=decoder).at(series.times[number], **choice).tets)
                  for decoder in ('library', 'python')]
        with Server(path('wake.tetlod')) as server:
            query = '&'.join('%s=%r' % (name, float(limit)) for name, limit in choice.items())
            with urllib.request.urlopen('%sv1/meshes/wake/mesh?step=%d&%s' % (server.url, number, query)) as answer:
                found.append(int(answer.headers['Tetlod-Tets']))
        if found != [wanted] * 4 or ('error' in choice and series.band_for_step(number, choice['error']) != band):
            return choice, found, wanted
    same = client.open(path('wake.tetlod')).steps.within(error)
    tets = [stream.levels[series.bands[series.band_for_step(at, error)]['level']]['tets'] for at in range(STEPS)]
    return None if [len(mesh.tets) for mesh in same] == tets and len(set(tets)) == 2 else (tets, error)


def own_range_case():
    """A field that fades: with --range step each step is within the error of its own range, else only of that over all.
    """
    from vtk.util.numpy_support import numpy_to_vtk
    grid, names = read_grid('wake_0.vtu'), []
    pressure = read_vtu('wake_0.vtu')[2]['Pressure'].astype(np.float64)
    for number, factor in enumerate((1, 0.1, 1e-3, 0)):
        array = numpy_to_vtk((pressure * factor).astype(np.float32), deep=True)
        array.SetName('fading')
        grid.GetPointData().AddArray(array)
        names.append(write_grid('fading_%d.vtu' % number, grid))
    largest = {}
    for relative in ('series', 'step'):
        must('build', *names, '--field', 'fading', '--carry', 'fading', '--bands', '5%', '--range', relative, '-o',
             path('fading.tetlod'))
        must('verify', path('fading.tetlod'), *[word for name in names for word in ('--against', name)])
        largest[relative] = 0
        if info(path('fading.tetlod'))['series']['relative_to'] != relative:
            return info(path('fading.tetlod'))['series']
        for number, name in enumerate(names[:3]):
            step('fading.tetlod', '--step', str(number), '--error', '5%')
            tets = stream_tets = len(read_vtu('step.vtu')[1])
            if relative == 'step':  # in its own range no band but the promised one is known to be within
                stream = reference.open(path('fading.tetlod'))
                band = stream.series().band_for_step(number, 0.05)
                stream_tets = stream.levels[stream.series().bands[band]['level']]['tets']
                tets = len(client.open(path('fading.tetlod')).at(float(number), '5%').tets)
            if not tets == stream_tets == len(read_vtu('step.vtu')[1]):
                return number, tets, stream_tets
            done = must('compare', name, path('step.vtu'), '--field', 'fading').stdout.decode()
            largest[relative] = max(largest[relative], float(re.search(r'max +(\S+) % of the range', done).group(1)))
    return None if 2 < largest['step'] <= 5.001 and largest['series'] > 10 else largest


def own_table_case():
    """With --range step no error that is stored is above the band's in the step's own range."""
    from vtk.util.numpy_support import numpy_to_vtk
    must('sample', 'wake', '--size', '8', '--steps', '2', '-o', path('small.pvd'))
    pressure, names, steps = read_vtu('small_0.vtu')[2]['Pressure'].astype(np.float64), [], []
    for number in range(12):
        grid = read_grid('small_0.vtu')
        steps.append((pressure * 0.8 ** number).astype(np.float32))
        array = numpy_to_vtk(steps[-1], deep=True)
        array.SetName('fading')
        grid.GetPointData().AddArray(array)
        names.append(write_grid('fades_%d.vtu' % number, grid))
    must('build', *names, '--field', 'fading', '--carry', 'fading', '--bands', '5%,2%,1%,0.5%,0.2%', '--range', 'step',
         '-o', path('fades.tetlod'))
    stream, width, most = client.open(path('fades.tetlod')), np.ptp(np.array(steps, float)), 0
    for band in 0.05, 0.02, 0.01, 0.005, 0.002:
        for number, values in enumerate(steps):
            most = max(most, stream.at(number,
                                       band).errors['fading']['max'] * width / (band * np.ptp(values.astype(float))))
    return None if 0.99 < most <= 1 + 1e-12 else most


def both_types_case():
    """Steps of float32 and of float64: each comes back bit for bit, as float64; `verify` holds them against both."""
    (points, tets), steps = block(3), []
    for number, form in enumerate((np.float32, np.float64, np.float32)):
        steps.append((np.sin(3 * points[:, 0] + number) + points[:, 1]).astype(form))
        save('both_%d.vtu' % number, points, tets, {'T': steps[-1]}, {})
    names = [path('both_%d.vtu' % number) for number in range(3)]
    must('build', *names, '--keep-order', '-o', path('both.tetlod'))
    for number, values in enumerate(steps):
        found = step('both.tetlod', '--step', str(number), '--original-order')[0][2]['T']
        if found.dtype != np.float64 or found.tobytes() != values.astype(np.float64).tobytes():
            return 'step %d: %s' % (number, found.dtype)
    must('verify', path('both.tetlod'), *[word for name in names for word in ('--against', name)])
    return None


def turn(name, points, time):
    """The mesh's file with points that are bent, turned and stretched in time."""
    from vtk.util.numpy_support import numpy_to_vtk
    grid = read_grid(name)
    x, y, z = points.astype(np.float64).T
    angle = 0.5 * time * x / 12
    moved = np.stack([x * (1 + 0.05 * time), y * np.cos(angle) - z * np.sin(angle),
                      y * np.sin(angle) + z * np.cos(angle) + time], axis=1)
    grid.GetPoints().SetData(numpy_to_vtk(moved.astype(points.dtype), deep=True))
    return write_grid('moved_%s' % name, grid)


def moving_case(dtype):
    points = read_vtu('wake_0.vtu')[0].astype(dtype)
    names = [turn('wake_%d.vtu' % i, points, i / 8) for i in range(0, 9, 2)]
    said = must('build', *names, '--field', 'Pressure', '--carry', 'Pressure', '--bands', '5%,1%', '--keep-order',
                '-o', path('moving.tetlod')).stderr.decode()
    against = [word for name in names for word in ('--against', name)]
    checked = must('verify', path('moving.tetlod'), *against).stdout.decode()
    series = info(path('moving.tetlod'))['series']
    if ("'point_displacement' says how far" not in said or 'of points that move, which turns over 0' not in checked
            or series['displacement'] != 'point_displacement'):
        return said, checked, series
    width = np.diff(next(field['range'] for field in series['fields'] if field['name'] == 'point_displacement'))[0]
    rounded = 0
    for number, name in enumerate(names):
        wanted = read_vtu(os.path.basename(name))
        exact, _ = step('moving.tetlod', '--step', str(number), '--original-order')
        off = np.abs(exact[0].astype(np.float64) - wanted[0])
        if (exact[0].dtype != dtype or off.max() > 2.0**-52 * np.abs(wanted[0]).max()
                or exact[2]['Pressure'].tobytes() != wanted[2]['Pressure'].tobytes()):
            return 'step %d is not the input' % number, off.max()
        rounded += np.count_nonzero(off)
        near, about = step('moving.tetlod', '--step', str(number), '--error', '1%')
        corner = np.abs(near[0].max(axis=0) - wanted[0].max(axis=0)).max()
        if not (corner <= 0.0101 * width and 'turns over 0 of' in about and len(near[0]) < len(wanted[0])):
            return 'step %d' % number, corner, width, about
    counted = re.search(r'(\d+) coordinates', said)
    if rounded != (int(counted.group(1)) if counted else 0) or (dtype == np.float32 and rounded):
        return rounded, said
    others = [name.replace('moved_', '') for name in names]
    wrong = tetlod('verify', path('moving.tetlod'), *[word for name in others for word in ('--against', name)])
    return None if wrong.returncode == 3 else wrong


def shaking_case(offset, amplitude):
    """Points that move by little, far from the origin: what rounding to float32 adds is in the errors that are stored.
    """
    from vtk.util.numpy_support import numpy_to_vtk
    must('sample', 'fin', '--size', '10', '-o', path('rest.vtu'))
    (points, cells, _), moved = read_vtu('rest.vtu'), []
    for number in range(4):
        grid, swing = read_grid('rest.vtu'), amplitude * number
        x, y, z = points.astype(np.float64).T
        moved.append(np.stack([x + offset + swing * np.sin(x + y), y + swing * np.cos(z), z + swing * np.sin(0.7 * x)],
                              axis=1).astype(np.float32).astype(float))
        grid.GetPoints().SetData(numpy_to_vtk(moved[-1].astype(np.float32), deep=True))
        write_grid('shaking_%d.vtu' % number, grid)
    names = [path('shaking_%d.vtu' % number) for number in range(4)]
    must('build', *names, '--field', 'Pressure', '--carry', 'Pressure', '--bands', '5%,1%,0.1%', '-o',
         path('shaking.tetlod'))
    stream, corners = client.open(path('shaking.tetlod')), moved[0][cells]
    width = np.ptp([moved[number] - moved[0] for number in range(4)])
    low, high, inverse = corners.min(1), corners.max(1), np.linalg.inv(
        (corners[:, 1:] - corners[:, :1]).transpose(0, 2, 1))
    for band in '5%', '1%', '0.1%':
        for number in range(1, 4):
            level = stream.at(number, band)
            error = level.errors['point_displacement']['max']
            if error > float(band[:-1]) / 100:
                return 'step %d says %g in the band of %s' % (number, error, band)
            rest = np.asarray(client.read(path('shaking.tetlod'), level=level.level).points, float)
            for at, place in zip(rest, np.asarray(level.points, float)):
                tet = next(t for t in np.nonzero(((low <= at) & (at <= high)).all(1))[0]
                           if np.all((w := inverse[t] @ (at - corners[t, 0])) >= -1e-6) and w.sum() <= 1 + 1e-6)
                weights = inverse[tet] @ (at - corners[tet, 0])
                off = np.abs(np.append(1 - weights.sum(), weights) @ moved[number][cells[tet]] - place).max()
                if off > error * width * (1 + 1e-6) + 1e-11 * offset:
                    return 'step %d in the band of %s: a point is %.9g off, and %.9g is promised' % (number, band, off,
                                                                                                     error * width)
    return None


def refuse_others():
    must('sample', 'cube', '--size', '3', '-o', path('other.vtu'))
    fails('another mesh', 3, ['step 1', 'other.vtu', 'Pressure'], 'build', path('wake_0.vtu'), path('other.vtu'), '-o',
          path('x.tetlod'))
    fails('a file that is not there', 1, ['bare.vtu'], 'build', path('wake_0.vtu'), path('bare.vtu'), '-o',
          path('x.tetlod'))
    report('nothing is left', not os.path.exists(path('x.tetlod')))
    crafted = os.path.join(os.environ.get('ROOT', '.'), 'tests', 'fuzz', 'corpus', 'reader',
                           'exact_band_below_the_original')
    fails('an exact band below the finest level', 3, ['the table of steps does not go with the stream'], 'extract',
          crafted, '--step', '0', '--original-order',
          '-o', path('x.vtu'))


def refuse_options():
    for words, options in ((['--certify exact'], ['--certify', 'exact']), (['rounding'], ['--position-bits', '12']),
                           (['--domain-error'], ['--domain-error', '0.01'])):
        done = tetlod('build', path('wake.pvd'), *options, '-o', path('x.tetlod'))
        message = done.stderr.decode()
        report('refused: ' + options[0], done.returncode in (2, 3) and message.count('\n') == 1 and
               all(word in message for word in words), done)
    for name, words, arguments in (('--times', '--times', ['build', path('wake.pvd'), '--times', '3:1']),
                                   ('--bands', '--bands', ['build', path('wake.pvd'), '--bands', '1%,5%']),
                                   ('--range', '--range', ['build', path('wake.pvd'), '--range', 'steps']),
                                   ('files and --time', '--time',
                                    ['build', path('wake_0.vtu'), path('wake_1.vtu'), '--time', '1']),
                                   ('a step and a level', '--level',
                                    ['extract', path('wake.tetlod'), '--step', '1', '--level', '2', '-o',
                                     path('x.vtu')]),
                                   ('a step and a time', '--time',
                                    ['extract', path('wake.tetlod'), '--step', '1', '--time', '2', '-o',
                                     path('x.vtu')])):
        fails('usage: ' + name, 2, [words], *arguments)
    fails('a file behind an option without a value', 2, ['wake_1.vtu is a second step', '--json', 'no value'], 'build',
          path('wake_0.vtu'), '--json', path('wake_1.vtu'),
          '--certify', 'exact', '-o', path('x.tetlod'))
    fails('a step that is not there', 2, ['step 99'], 'extract', path('wake.tetlod'), '--step', '99', '-o',
          path('x.vtu'))
    fails('a stream without steps', 2, ['no series'], 'extract', path('one.tetlod'), '--step', '0', '-o', path('x.vtu'))
    fails('a picture over time of one', 2, ['one.tetlod', 'no series'], 'plot', path('one.tetlod'), '--steps', '-o',
          path('x.svg'))
    fails('a picture of a field without steps', 3, ["'Speed'"], 'plot', path('wake.tetlod'), '--steps', '--field',
          'Speed', '-o', path('x.svg'))


must('sample', 'wake', '--size', '5', '--steps', str(STEPS), '-o', path('wake.pvd'))
build = ['build', path('wake.pvd'), '--field', 'Pressure', '--field', 'Velocity:mag', '--bands', '5%,1%',
         '--keep-order']
succeeds('build a series', *build, '--threads', '2', '-o', path('wake.tetlod'))
must(*build, '--threads', '1', '-o', path('again.tetlod'))
report('the same bytes on one thread',
       open(path('wake.tetlod'), 'rb').read() == open(path('again.tetlod'), 'rb').read())
succeeds('verify holds every step against the input', 'verify', path('wake.tetlod'), '--against', path('wake.pvd'))

def other_times_case():
    """A step's time that is another in the input."""
    with open(path('wake.pvd')) as file:
        text = file.read()
    times = re.findall(r'timestep="([^"]*)"', text)
    write('later.pvd', text.replace('timestep="%s"' % times[3],
                                    'timestep="%.17g"' % (0.9 * float(times[3]) + 0.1 * float(times[4]))))
    done = tetlod('verify', path('keys.tetlod'), '--against', path('later.pvd'))
    must('verify', path('keys.tetlod'), '--against', path('wake.pvd'))
    return None if done.returncode == 3 and b'step 3: its time is' in done.stderr else done


def overlapping_case():
    """A body that overlaps itself: seconds, not minutes."""
    points, tets, along = coil(29)
    names = []
    for step in range(12):
        names.append('coil_%d.vtu' % step)
        save(names[-1], points, tets, {'heat': np.sin(12 * along + 0.3 * step)}, {})
    must('build', *names, '--field', 'heat', '-o', 'coil.tetlod', '--quiet')
    against = [word for name in names for word in ('--against', name)]
    done = tetlod('verify', 'coil.tetlod', *against, timeout=60)
    return None if done.returncode == 0 and info('coil.tetlod')['levels'][0]['tets'] < len(tets) else done


def stretched_case():
    """Flat cells, whole numbers as values, and errors that are fractions of each step's range: some bands are exact."""
    points, tets = block(4 if SANITIZED else 5)
    names = []
    for step in range(4):
        names.append('flat_%d.vtu' % step)
        save(names[-1], points * [1, 1, 1e-7] + [0, 0, 1000], tets,
             {'level': np.floor(4 * points[:, 0] + 3 * points[:, 2] * step) * 10.0 ** -(3 * step)}, {})
    must('build', *names, '--field', 'level', '--range', 'step', '-o', 'flat.tetlod', '--quiet')
    must('verify', 'flat.tetlod', *[word for name in names for word in ('--against', name)])
    return None


case('exact steps are the input bit for bit', exact_case)
case('steps within an error', within_case)
case('a step by its own error', own_error_case)
case('a step by time, and by an error in units', chosen_case)
case('info', info_case)
case('a picture of the errors over time', plot_case)
case('a band between round errors has a level of its own', band_case)
case('steps that do not drive', few_keys_case)
case('memory is bounded, whatever the number of steps', memory_case)
case('temporary files', temporary_case)
case('several files, and some steps', files_case)
case('steps of float32 and of float64', both_types_case)
case('steps that are cut off at the ends of their range', clipped_case)
case('errors relative to each step', own_range_case)
case('errors relative to each step, as they are stored', own_table_case)
case('points that move, float32', moving_case, np.float32)
case('points that move, float64', moving_case, np.float64)
for amplitude in (0.05, 0.01, 0.002):
    case('points that move by %g beside 1,000' % amplitude, shaking_case, 1000, amplitude)
case('--time builds one step', one_step_case)
refuse_others()
refuse_options()
case('verify notices another time', other_times_case)
case('a body that overlaps itself', overlapping_case)
case('a stretched mesh, in ranges of its steps', stretched_case)
finish()
