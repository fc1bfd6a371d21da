#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""A series whose mesh changes: `build` into topology groups, and every command over their borders."""
import os
import re

import numpy as np

from common import case, finish, info, must, path, read_vtu, report, tetlod

STEPS, EACH = 7, 3


def exact_case():
    for number in range(STEPS):
        must('extract', path('changes.tetlod'), '--step', str(number), '--original-order', '-o', path('step.vtu'))
        found, wanted = read_vtu('step.vtu'), read_vtu('changes_%d.vtu' % number)
        if not np.array_equal(found[0], wanted[0]) or not np.array_equal(found[1], wanted[1]):
            return 'another mesh at step %d' % number
        if found[2]['Pressure'].tobytes() != wanted[2]['Pressure'].tobytes():
            return 'other values at step %d' % number
    return None


def info_case():
    found = info(path('changes.tetlod'))
    groups = found['topologies']
    if [group['steps'] for group in groups] != [EACH, EACH, STEPS - 2 * EACH] or groups[0]['cid'] != found['cid']:
        return groups
    values = [read_vtu('changes_%d.vtu' % number)[2]['Pressure'] for number in range(STEPS)]
    all_of_them = [float(min(v.min() for v in values)), float(max(v.max() for v in values))]
    with open(path('changes.tetlod'), 'rb') as file:
        data = file.read()
    for group in groups:
        with open(path('part.tetlod'), 'wb') as file:
            file.write(data[group['offset']:group['offset'] + group['bytes']])
        part = info(path('part.tetlod'))
        ranges = {field['name']: field['range'] for field in part['series']['fields']}
        if (part['cid'] != group['cid'] or part['series']['steps'] != group['steps']
                or ranges['Pressure'] != all_of_them):
            return 'a group is another stream: %s' % part['series']
    shown = must('info', path('changes.tetlod')).stdout.decode()
    return None if shown.count('\ntopology ') == 3 and 'steps 6 to 6' in shown else shown


def chosen_case():
    last = info(path('changes.tetlod'))['topologies'][-1]['times'][-1]
    for choice, said in ((('--time', '0.56'), 'step 3 of 0..6'), (('--time', '%r' % (last + 1e-6)), 'step 6 of 0..6'),
                         (('--step', '5'), 'step 5 of 0..6')):
        done = must('extract', path('changes.tetlod'), *choice, '--error', '5%', '-o', path('step.vtu'))
        found = re.search(r'Pressure within (\S+) %', done.stderr.decode())
        if said not in done.stderr.decode() or not 0 < float(found.group(1)) <= 5:
            return done.stderr
    done = tetlod('extract', path('changes.tetlod'), '--step', '7', '-o', path('step.vtu'))
    return None if done.returncode != 0 and b'it has 7 steps' in done.stderr else done.stderr


def verify_case():
    done = must('verify', path('changes.tetlod'), '--against', path('changes.pvd'))
    if b'7 steps in 3 topology groups' not in done.stdout:
        return done.stdout
    with open(path('changes.tetlod'), 'rb') as file:
        data = bytearray(file.read())
    group = info(path('changes.tetlod'))['topologies'][2]
    data[group['offset'] + group['bytes'] - 9] ^= 1
    with open(path('damaged.tetlod'), 'wb') as file:
        file.write(data)
    done = tetlod('verify', path('damaged.tetlod'))
    return None if done.returncode == 3 else 'damage in the last group is not seen'


def other_steps_case():
    """Another step in the place of one behind a border is noticed, and named."""
    files = [path('changes_%d.vtu' % number) for number in (0, 1, 2, 3, 5, 4, 6)]
    done = tetlod('verify', path('changes.tetlod'), *[word for file in files for word in ('--against', file)])
    return None if done.returncode != 0 and b'topology group 1' in done.stderr else done.stderr


def same_bytes_case():
    with open(path('changes.tetlod'), 'rb') as file:
        wanted = file.read()
    for threads in ('1', '3'):
        must('build', path('changes.pvd'), '-o', path('again.tetlod'), '--field', 'Pressure', '--threads', threads,
             '--quiet', '--keep-order')
        with open(path('again.tetlod'), 'rb') as file:
            if file.read() != wanted:
                return 'other bytes with %s threads' % threads
    return None


def level_case():
    must('extract', path('changes.tetlod'), '--error', '5%', '-o', path('level.tetlod'))
    must('verify', path('level.tetlod'))
    must('plot', path('changes.tetlod'), '--steps', '-o', path('steps.svg'))
    return None if 'topologies' not in info(path('level.tetlod')) else 'a level names topology groups that it has not'


def refused_case():
    points, cells, fields = read_vtu('changes_0.vtu')
    must('sample', 'cube', '--size', '3', '-o', path('cube.vtu'))
    done = tetlod('build', path('changes_0.vtu'), path('cube.vtu'), '-o', path('no.tetlod'), '--field', 'Pressure')
    if done.returncode == 0 or b'step 1, cube.vtu' not in done.stderr or b'Pressure' not in done.stderr:
        return done.stderr
    text = open(path('changes_3.vtu'), 'rb').read()
    must('convert', path('changes_3.vtu'), '-o', path('far.vtk'))
    lines = open(path('far.vtk'), 'rb').read()
    at = lines.index(b'POINTS')
    begin = lines.index(b'\n', at) + 1
    count = int(lines[at:begin].split()[1])
    kind = '>f4' if b'float' in lines[at:begin] else '>f8'
    size = np.dtype(kind).itemsize * 3 * count
    moved = (np.frombuffer(lines[begin:begin + size], kind) + 1000).astype(kind).tobytes()
    with open(path('far.vtk'), 'wb') as file:
        file.write(lines[:begin] + moved + lines[begin + size:])
    done = tetlod('build', path('changes_0.vtu'), path('far.vtk'), '-o', path('no.tetlod'), '--field', 'Pressure')
    if done.returncode == 0 or b'lies elsewhere' not in done.stderr or os.path.exists(path('no.tetlod')):
        return done.stderr
    return None if text else 'no step'


must('sample', 'wake', '--size', '5', '--steps', str(STEPS), '--remesh', str(EACH), '-o', path('changes.pvd'))
said = must('build', path('changes.pvd'), '-o', path('changes.tetlod'), '--field', 'Pressure',
            '--keep-order').stderr.decode()
report('every group is said', said.count('topology group') >= 3 and 'steps 3 to 5' in said, said)
case('exact values on both sides of every border', exact_case)
case('info says where the groups are; the range is that of all steps', info_case)
case('steps are numbered through all groups', chosen_case)
case('verify reads every group', verify_case)
case('verify notices another step behind a border', other_steps_case)
case('the same bytes on any number of threads', same_bytes_case)
case('a level is the first group alone', level_case)
case('steps that are no series are refused', refused_case)
finish()
