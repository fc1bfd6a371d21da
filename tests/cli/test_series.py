#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""A series in time: `build` of a PVD file or of several files, `extract --time`, `info`, `verify --against`."""
import os
import re

import numpy as np

from common import case, fails, finish, info, must, path, read_vtu, report, succeeds, tetlod

STEPS = 20


def step(name, *choice):
    done = must('extract', path(name), *choice, '-o', path('step.vtu'))
    return read_vtu('step.vtu'), done.stderr.decode()


def exact_case():
    for number in (0, 7, 8, STEPS - 1):
        (points, cells, fields), _ = step('wake.tetlod', '--step', str(number), '--original-order')
        wanted = read_vtu('wake_%d.vtu' % number)
        if not (np.array_equal(points, wanted[0]) and np.array_equal(cells, wanted[1]) and set(fields) == {'Pressure', 'Velocity:mag', 'Velocity'}):
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
            done = must('compare', path('wake_%d.vtu' % number), path('step.vtu'), '--field', 'Pressure').stdout.decode()
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


def few_keys_case():
    """With little memory some steps drive, and what the others are certified to holds as well."""
    build = ['build', path('wake.pvd'), '--field', 'Velocity', '--carry', 'Velocity', '--bands', '5%,1%', '-o', path('keys.tetlod'), '--memory']
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


def files_case():
    names = [path('wake_%d.vtu' % i) for i in (3, 5, 9)]
    must('build', *names, '--field', 'Pressure', '--carry', 'Pressure', '--bands', '5%', '-o', path('files.tetlod'))
    said = must('verify', path('files.tetlod'), *[word for name in names for word in ('--against', name)]).stdout.decode()
    must('build', path('wake.pvd'), '--times', '3:9:3', '--field', 'Pressure', '--carry', 'Pressure', '-o', path('some.tetlod'))
    some = info(path('some.tetlod'))['series']
    must('verify', path('some.tetlod'), '--against', path('wake.pvd'), '--times', '3:9:3')
    wrong = tetlod('verify', path('some.tetlod'), '--against', path('wake.pvd'), '--times', '4:10:3')
    good = '3 steps' in said and some['steps'] == 3 and wrong.returncode == 3
    return None if good and 'series' in info(path('files.tetlod')) else (said, some, wrong)


def one_step_case():
    must('build', path('wake.pvd'), '--time', '2', '--field', 'Pressure', '-o', path('one.tetlod'))
    return 'a series' if 'series' in info(path('one.tetlod')) else None


def refuse_others():
    must('sample', 'wake', '--size', '6', '-o', path('other.vtu'))
    must('convert', path('wake_0.vtu'), '-o', path('moved.vtk'))
    must('convert', path('moved.vtk'), '-o', path('moved.mesh'))
    lines = open(path('moved.mesh')).read().split('\n')
    first = next(i for i, line in enumerate(lines) if line.startswith('Vertices')) + 2
    x, rest = lines[first].split(' ', 1)
    lines[first] = '%r %s' % (float(x) - 0.001, rest)
    open(path('moved.mesh'), 'w').write('\n'.join(lines))
    must('convert', path('moved.mesh'), '-o', path('moved.vtu'))
    fails('another mesh', 3, ['step 1', 'other.vtu', 'tetrahedra are others'], 'build', path('wake_0.vtu'), path('other.vtu'), '-o', path('x.tetlod'))
    fails('points that move', 3, ['step 1', 'elsewhere'], 'build', path('wake_0.vtu'), path('moved.vtu'), '-o', path('x.tetlod'))
    fails('a file that is not there', 1, ['bare.vtu'], 'build', path('wake_0.vtu'), path('bare.vtu'), '-o', path('x.tetlod'))
    report('nothing is left', not os.path.exists(path('x.tetlod')))


def refuse_options():
    for words, options in ((['--certify exact'], ['--certify', 'exact']), (['rounding'], ['--position-bits', '12']), (['--domain-error'], ['--domain-error', '0.01'])):
        done = tetlod('build', path('wake.pvd'), *options, '-o', path('x.tetlod'))
        message = done.stderr.decode()
        report('refused: ' + options[0], done.returncode in (2, 3) and message.count('\n') == 1 and all(word in message for word in words), done)
    for name, words, arguments in (('--times', '--times', ['build', path('wake.pvd'), '--times', '3:1']), ('--bands', '--bands', ['build', path('wake.pvd'), '--bands', '1%,5%']),
                                   ('files and --time', '--time', ['build', path('wake_0.vtu'), path('wake_1.vtu'), '--time', '1']),
                                   ('a step and a level', '--level', ['extract', path('wake.tetlod'), '--step', '1', '--level', '2', '-o', path('x.vtu')]),
                                   ('a step and a time', '--time', ['extract', path('wake.tetlod'), '--step', '1', '--time', '2', '-o', path('x.vtu')])):
        fails('usage: ' + name, 2, [words], *arguments)
    fails('a step that is not there', 2, ['step 99'], 'extract', path('wake.tetlod'), '--step', '99', '-o', path('x.vtu'))
    fails('a stream without steps', 2, ['no series'], 'extract', path('one.tetlod'), '--step', '0', '-o', path('x.vtu'))


must('sample', 'wake', '--size', '5', '--steps', str(STEPS), '-o', path('wake.pvd'))
build = ['build', path('wake.pvd'), '--field', 'Pressure', '--field', 'Velocity:mag', '--bands', '5%,1%', '--keep-order']
succeeds('build a series', *build, '--threads', '2', '-o', path('wake.tetlod'))
must(*build, '--threads', '1', '-o', path('again.tetlod'))
report('the same bytes on one thread', open(path('wake.tetlod'), 'rb').read() == open(path('again.tetlod'), 'rb').read())
succeeds('verify holds every step against the input', 'verify', path('wake.tetlod'), '--against', path('wake.pvd'))
case('exact steps are the input bit for bit', exact_case)
case('steps within an error', within_case)
case('a step by time, and by an error in units', chosen_case)
case('info', info_case)
case('steps that do not drive', few_keys_case)
case('several files, and some steps', files_case)
case('--time builds one step', one_step_case)
refuse_others()
refuse_options()
finish()
