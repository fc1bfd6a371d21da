#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""Streams that say what is not true, whole in every other respect: `verify` refuses each with exit status 3. Streams
that are valid, but whose levels are poor meshes, have a status of their own. No string of a file reaches the terminal
with control characters."""
import glob
import json
import os
import struct
import sys

import numpy as np

from cell_meshes import block, save
from common import ROOT, case, finish, must, path, tetlod, write

sys.path.insert(0, ROOT + '/tests')
from streams import plain, sealed, tetlod as decoder, with_section  # noqa: E402

BOUNDS, DEGENERATE, INVERTED, UNUSED = 64 + 24, 64 + 72, 64 + 80, 64 + 88  # in a plain index (SPEC 3.2)


def content(name):
    with open(path(name), 'rb') as file:
        return file.read()


def put(data, at, form, value):
    data = bytearray(data)
    struct.pack_into('<' + form, data, at, value)
    return sealed(data)


def range_at(data, name):
    """Where a field's range is."""
    return data.index(struct.pack('<H', len(name)) + name.encode(), 64) - 16


def refused(words, data, *arguments):
    write('forged.tetlod', data)
    done = tetlod('verify', 'forged.tetlod', '--quiet', *arguments)
    good = (done.returncode == 3 and done.stderr.count(b'\n') == 1
            and all(word in done.stderr.decode() for word in words))
    return None if good else (words, done)


def first(problems):
    return next((problem for problem in problems if problem), None)


def make():
    points, tets = block(5)
    heat = np.sin(points @ [3.0, 2.0, 1.0])
    save('mesh.vtu', points, tets, {'heat': heat},
         {'key': np.arange(len(tets)) * (2**53 // len(tets)), 'load': np.linspace(-1, 1, len(tets))})
    for step in range(4):
        save('step_%d.vtu' % step, points, tets, {'heat': np.sin(points @ [3.0, 2.0, 1.0] + step)}, {})
    must('build', 'mesh.vtu', '--growth', '1.5', '-o', 'mesh.tetlod', '--quiet')
    must('build', 'mesh.vtu', '--growth', '1.5', '--position-bits', '12', '--field-bits', '12', '-o', 'rounded.tetlod',
         '--quiet')
    must('build', *['step_%d.vtu' % step for step in range(4)], '--field', 'heat', '--growth', '1.5', '-o',
         'steps.tetlod', '--quiet')


def figures():
    """Bounds, ranges and counts of the index."""
    problems = []
    for name in ('mesh.tetlod', 'rounded.tetlod'):
        data, heat = plain(content(name)), range_at(plain(content(name)), 'heat')
        must('verify', name, '--quiet')
        problems += [
            refused(['says that x is'], put(data, BOUNDS, 'd', -0.5)),
            refused(['says that z is'], put(data, BOUNDS + 40, 'd', 1.01)),
            refused(['1 tetrahedra are degenerate'], put(data, DEGENERATE, 'Q', 1)),
            refused(['7 tetrahedra are inverted'], put(data, INVERTED, 'Q', 7)),
            refused(['heat'], put(data, heat, 'd', -3.0)),
            refused(['unused'], put(data, UNUSED, 'Q', 3), '--against', 'mesh.vtu')
        ]
    return first(problems)


def parts():
    """The figures of a part are those of the whole."""
    must('extract', 'mesh.tetlod', '--level', '2', '-o', 'part.tetlod', '--quiet')
    must('verify', 'part.tetlod', '--quiet')
    return None


def whole_numbers():
    """An integer that a double cannot hold is refused, and not rounded in silence."""
    data = plain(content('mesh.tetlod'))
    values = bytearray(decoder.open(data).section('CVAL'))
    for value in (2**53 + 1, -2**53 - 1, 2**53 + 2, -2**63):
        struct.pack_into('<q', values, 80, value)
        problem = refused(['key', '2^53'], with_section(data, 'CVAL', bytes(values)))
        if problem:
            return value, problem
        done = tetlod('extract', 'forged.tetlod', '-o', 'x.vtu', '--quiet')
        if done.returncode != 3 or b'2^53' not in done.stderr:
            return value, done
    return None


def cell_range():
    data = plain(content('mesh.tetlod'))
    table = next(section for section in decoder.open(data).sections if section['tag'] == 'CELL')
    entry = data.index(table['digest'], 64)
    changed = bytearray(data)
    struct.pack_into('<d', changed, range_at(data, 'load'), -2.0)
    changed[entry:entry + 16] = decoder.digest(bytes(changed[table['offset']:table['offset'] + table['stored']]))
    return refused(['load', '-2'], sealed(changed))


def steps_table():
    """Times that do not rise, and ranges that are not those of the values."""
    data, problems = plain(content('steps.tetlod')), []
    stream = decoder.open(data)
    series, table = stream.series(), stream.section('TIME')
    times = 16 + 24 + 16 * len(series.bands) + 8 * len(series.bands)
    for at, value, words in ((times + 8, 0.0, ['same time']),
                             (16 + 8, series.fields[0]['range'][0] - 1, ['heat', 'the steps have']),
                             (16 + 16, series.fields[0]['range'][1] + 0.1, ['heat', 'the steps have'])):
        forged = bytearray(table)
        struct.pack_into('<d', forged, at, value)
        problems.append(refused(words, with_section(data, 'TIME', bytes(forged))))
    must('verify', 'steps.tetlod', '--quiet')
    return first(problems)


def errors_of_steps():
    """A band that is further off than the table says: where levels are coarser, and where a band's mesh is the
    original's."""
    points, tets = block(3)
    random = np.random.default_rng(3)
    for step in range(4):
        save('noise_%d.vtu' % step, points, tets, {'heat': random.standard_normal(len(points))}, {})
    must('build', *['noise_%d.vtu' % step for step in range(4)], '--field', 'heat', '-o', 'noise.tetlod', '--quiet')
    problems = []
    for name, files in (('steps.tetlod', 'step_%d.vtu'), ('noise.tetlod', 'noise_%d.vtu')):
        data = plain(content(name))
        stream = decoder.open(data)
        series, table = stream.series(), stream.section('TIME')
        at = 16 + 24 + 24 * len(series.bands) + 8 * len(series.times)
        against = [word for step in range(4) for word in ('--against', files % step)]
        must('verify', name, '--quiet', *against)
        for entry in (1, 4 + 2):  # steps of the first two bands
            forged = bytearray(table)
            struct.pack_into('<f', forged, at + 8 * entry + 4, 1e-9)
            problems.append(refused(['step %d' % (entry % 4), 'in the band'],
                                    with_section(data, 'TIME', bytes(forged)), *against))
        if (stream.levels[series.bands[0]['level']]['tets'] == stream.tets) != (name == 'noise.tetlod'):
            return 'the meshes do not test what they should'
    return first(problems)


def behind_packed_parts():
    data = content('mesh.tetlod')
    size, total = int.from_bytes(data[20:24], 'little'), int.from_bytes(data[32:40], 'little')
    longer = data[:20] + struct.pack('<I', size + 5) + data[24:32] + struct.pack('<Q', total + 5) + data[40:64 + size]
    good, bad = (sealed(longer + byte + data[64 + size:]) for byte in (bytes(5), b'\0\0\0\0\1'))
    write('padded.tetlod', good)
    must('verify', 'padded.tetlod', '--quiet')
    return refused(['packed part', 'belong to nothing'], bad)


def names_of_the_input():
    """A field whose name is an expression that the input cannot answer is a stream that does not go with it, no wrong
    use."""
    data = plain(content('mesh.tetlod'))
    return first(refused([], put(data, range_at(data, 'heat') + 18, '4s', name), '--against',
                         'mesh.vtu') for name in (b'he:9', b'k:at', b'heat'[::-1]))


def lost_fields():
    """What the input has and the stream does not was lost, where nobody chose to leave it out."""
    points, tets = block(5)
    heat = np.sin(points @ [3.0, 2.0, 1.0])
    full, problems = ({'heat': heat, 'wind': heat}, {'key': np.arange(len(tets))}), []
    save('full.vtu', points, tets, *full)
    for name, fields, cells, words in (('points', {'heat': heat}, full[1], ["no field 'wind',"]),
                                       ('cells', full[0], {}, ["no field 'key' of cells"])):
        save(name + '.vtu', points, tets, fields, cells)
        must('build', name + '.vtu', '--growth', '1.5', '-o', name + '.tetlod', '--quiet')
        problems.append(refused(words, content(name + '.tetlod'), '--against', 'full.vtu'))
    must('build', 'full.vtu', '--carry', 'heat', '--growth', '1.5', '-o', 'chosen.tetlod', '--quiet')
    must('verify', 'chosen.tetlod', '--against', 'full.vtu', '--quiet')
    return first(problems)


def quality():
    """Every golden stream is valid; those whose levels are poor meshes end with status 4 and say so."""
    poor = 0
    for name in sorted(glob.glob(os.path.join(ROOT, 'tests', 'golden', '*.tetlod'))):
        done, said = tetlod('verify', name, '--quiet'), tetlod('verify', name, '--json', '--quiet')
        found = json.loads(said.stdout)
        poor += done.returncode == 4
        if (done.returncode not in (0, 4) or said.returncode != done.returncode or done.stderr or not found['ok']
                or found['message']):
            return name, done, said
        if ((done.returncode == 4) != (b'poor quality' in done.stdout)
                or (done.returncode == 4) != bool(found['quality'])):
            return name, done, said
    return None if poor > 5 else '%d are poor' % poor


def terminal():
    """Units with escape sequences, in UTF-8 and in ASCII, go nowhere."""
    data = plain(content('mesh.tetlod'))
    stream = decoder.open(data)
    old = next(section for section in stream.sections if section['tag'] == 'META')
    for unit in ('\\u001b[31mred', '\x9b31m', 'K\x7f', '\\u0007'):
        text = ('{"units":{"heat":"%s"}}' % unit).encode()
        text += b' ' * (old['stored'] - len(text))
        write('units.tetlod', sealed(data[:old['offset']] + text +
                                     data[old['offset'] + len(text):]).replace(old['digest'], decoder.digest(text)))
        write('units.tetlod', sealed(content('units.tetlod')))
        for arguments in (['info', 'units.tetlod'], ['info', 'units.tetlod', '--json'],
                          ['extract', 'units.tetlod', '--error', '5%', '-o', 'x.vtu'],
                          ['verify', 'units.tetlod']):
            done = tetlod(*arguments)
            said = (done.stdout + done.stderr).decode()
            if done.returncode or any(ord(letter) < 32 and letter != '\n' or
                                      0x7f <= ord(letter) < 0xa0 for letter in said):
                return unit, arguments, done
            if (arguments[-1] == '--json'
                    and json.loads(done.stdout)['metadata']['units']['heat'] != json.loads('"%s"' % unit)):
                return unit, done.stdout
    return None


make()
case('bounds, ranges and counts of the index', figures)
case('a part keeps the figures of the whole', parts)
case('integers beyond 2^53', whole_numbers)
case('ranges of values of cells', cell_range)
case('times and ranges of steps', steps_table)
case('errors of steps', errors_of_steps)
case('bytes behind packed parts', behind_packed_parts)
case('names that are expressions', names_of_the_input)
case('fields that were lost', lost_fields)
case('golden streams are valid, some of poor quality', quality)
case('units keep off the terminal', terminal)
finish()
