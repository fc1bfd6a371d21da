#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""What verify says of good streams and of the wrong input, and that every field has a maximum where it is asked for. That verify
refuses figures that are wrong is tested by the attack (tests/attack), which seals such streams."""
import json

from common import case, finish, info, must, tetlod

MESH = 'fin.vtu'


def all_levels():
    said = must('verify', 'fin.tetlod', '--against', MESH, '--all-levels').stdout.decode()
    return None if 'levels measured, max held against the exact maximum at all of them' in said else said


def names_levels():
    found = json.loads(must('verify', 'fin.tetlod', '--against', MESH, '--json').stdout)
    levels = len(info('fin.tetlod')['levels'])
    return None if found['ok'] and found['measured_levels'] == levels and found['exact_levels'] == list(range(levels)) else found


def another_input():
    done = tetlod('verify', 'fin.tetlod', '--against', 'other.vtu')
    return None if done.returncode == 3 and b'input' in done.stderr else (done.returncode, done.stderr)


def every_field():
    must('build', MESH, '--certify-all', '--growth', '1.5', '-o', 'all.tetlod')
    for level in info('all.tetlod')['levels']:
        for name, errors in level['errors'].items():
            if errors['max'] is None or errors['max'] < errors['sampled']:
                return level['level'], name, errors
    must('verify', 'all.tetlod', '--against', MESH, '--quiet')
    return None


def agrees_with_compare():
    """The maximum of a field that nothing holds is what compare finds."""
    level = info('all.tetlod')['levels'][2]
    must('extract', 'all.tetlod', '--level', '2', '-o', 'level.vtu')
    for name, errors in level['errors'].items():
        true = json.loads(must('compare', MESH, 'level.vtu', '--field', name, '--json').stdout)['errors']['max']
        if true > errors['max'] * (1 + 1e-9) + 1e-12:
            return name, errors, true
    return None


must('sample', 'fin', '--size', '8', '-o', MESH)
must('sample', 'fin', '--size', '9', '-o', 'other.vtu')
must('build', MESH, '-o', 'fin.tetlod', '--growth', '1.3')
case('max is held against the exact maximum at all levels', all_levels)
case('the levels are named', names_levels)
case('another input is refused', another_input)
case('--certify-all: every field has a maximum', every_field)
case('--certify-all: it is what compare finds', agrees_with_compare)
finish()
