#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""Answers of verify for good streams and for the wrong input, and that every field has a maximum where it is asked for.
That verify refuses figures that are wrong is tested by the attack (tests/attack), which seals such streams."""
import json
import struct
import sys

from common import ROOT, case, finish, info, must, path, tetlod, write

sys.path.insert(0, ROOT + '/tests')
from streams import plain, sealed, tetlod as decoder  # noqa: E402

MESH = 'fin.vtu'


def all_levels():
    said = must('verify', 'fin.tetlod', '--against', MESH, '--all-levels').stdout.decode()
    return None if 'levels measured, max held against the exact maximum at all of them' in said else said


def names_levels():
    found = json.loads(must('verify', 'fin.tetlod', '--against', MESH, '--json').stdout)
    levels = len(info('fin.tetlod')['levels'])
    return (None if found['ok'] and found['measured_levels'] == levels and found['exact_levels'] == list(range(levels))
            else found)


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


def infinite_errors():
    """A bound that is not there is infinite in the stream, and null in JSON."""
    data = bytearray(plain(open(path('fin.tetlod'), 'rb').read()))
    stream = decoder.open(path('fin.tetlod'))
    fields = len(stream.fields)
    row, levels = 48 + 56 * fields, len(stream.levels)
    directory = data.index(struct.pack('<I', len(stream.sections)) + b'META', 64)
    for level in range(levels):
        at = directory - (levels - level) * row + 16
        data[at:at + 8] = struct.pack('<d', float('inf'))
        if level == 0:
            data[at + 8:at + 8 + 32 * fields] = struct.pack('<d', float('inf')) * 4 * fields
    write('infinite.tetlod', sealed(data))
    said = json.loads(must('info', 'infinite.tetlod', '--json').stdout, parse_constant=lambda name: 1 / 0)
    base, honest = said['levels'][0], info('fin.tetlod')['levels']
    if any(level['domain_error'] is not None for level in said['levels']):
        return 'a domain error is not null'
    if any(error is not None for errors in base['errors'].values() for error in errors.values()):
        return base
    must('info', 'infinite.tetlod')
    must('verify', 'infinite.tetlod', '--quiet')
    return None if said['levels'][1]['errors'] == honest[1]['errors'] else said['levels'][1]


def damaged_order():
    """Levels are as they were; what is damaged is named, and nothing else fails."""
    must('build', MESH, '--growth', '1.5', '--keep-order', '-o', 'kept.tetlod')
    data = bytearray(open(path('kept.tetlod'), 'rb').read())
    data[-5] ^= 1
    write('damaged.tetlod', bytes(data))
    must('info', 'damaged.tetlod', '--json')
    must('extract', 'damaged.tetlod', '-o', 'levels.vtu', '--quiet')
    for command in (['verify', 'damaged.tetlod'], ['extract', 'damaged.tetlod', '--original-order', '-o', 'none.vtu']):
        done = tetlod(*command)
        if done.returncode != 3 or b'ORDR' not in done.stderr or done.stderr.count(b'\n') != 1:
            return command, done.returncode, done.stderr
    return None


must('sample', 'fin', '--size', '8', '-o', MESH)
must('sample', 'fin', '--size', '9', '-o', 'other.vtu')
must('build', MESH, '-o', 'fin.tetlod', '--growth', '1.3')
case('max is held against the exact maximum at all levels', all_levels)
case('the levels are named', names_levels)
case('another input is refused', another_input)
case('infinite errors are null in JSON', infinite_errors)
case('a damaged order part is found', damaged_order)
case('--certify-all: every field has a maximum', every_field)
case('--certify-all: it is what compare finds', agrees_with_compare)
finish()
