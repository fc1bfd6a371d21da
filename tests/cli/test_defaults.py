#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""What happens where nobody said what to do: which fields are controlled, what they cost, ids, regions, meshes without
fields, and what is said of it. Errors are judged by VTK's probe of the input's points, which knows nothing of bounds.
"""
import re

import numpy as np
import vtk
from vtk.util.numpy_support import vtk_to_numpy

import results
from common import SANITIZED, case, fails, finish, info, must, path, read_grid, read_vtu, tetlod
from meshes import arrays_of

N, ERRORS = 8, (0.05, 0.01, 0.001)
USUAL = {
    'flow': ['U', 'k', 'p', 'T'], 'solid': ['displacement', 'VonMises', 'temperature'],
    'wall': ['p', 'U', 'wallShearStress'], 'tensors': ['stress',
                                                       'strain'], 'ids': ['heat'], 'cells': ['pressure', 'velocity']
}


def controlled(stream):
    return [field['name'] for field in info(stream)['fields'] if field['controlled']]


def said_by(*arguments):
    return must(*arguments).stderr.decode()


def tets_within(stream, error):
    names = controlled(stream)
    return min(level['tets'] for level in info(stream)['levels']
               if all(level['errors'][n]['max'] <= error for n in names))


def off_by(given, level):
    """The largest difference of every field at the input's points, as a fraction of its range."""
    probe = vtk.vtkProbeFilter()
    probe.SetInputData(read_grid(given))
    probe.SetSourceData(read_grid(level))
    probe.Update()
    found, wanted = arrays_of(probe.GetOutput().GetPointData()), arrays_of(read_grid(given).GetPointData())
    inside = found[probe.GetValidPointMaskArrayName()] > 0
    assert inside.mean() > 0.8, inside.mean()
    return {name: np.abs(found[name].astype(float) - values)[inside].max() / np.ptp(values)
            for name, values in wanted.items() if name in found}


def one_kind(kind):
    said_by('build', kind + '.vtu', '-o', kind + '.tetlod', '--quiet')
    if sorted(controlled(kind + '.tetlod')) != sorted(USUAL[kind]):
        return controlled(kind + '.tetlod')
    must('extract', kind + '.tetlod', '-o', 'finest.vtu')  # of cells the fields at points are made while reading
    for error in ERRORS:
        must('extract', kind + '.tetlod', '--error', str(error), '-o', 'level.vtu')
        for name, off in off_by('finest.vtu', 'level.vtu').items():
            if name in USUAL[kind] and off > error * 1.001:
                return '%s is off by %g at %g' % (name, off, error)
    if not SANITIZED:
        must('verify', kind + '.tetlod', '--against', kind + '.vtu', '--quiet')
    return None


def what_is_chosen():
    for options, wanted in ((['--field', 'p,k'], {'p', 'k'}), (['--field', '[pk]'], {'p', 'k'}),
                            (['--field', 'all'], {'U', 'p', 'T', 'k'}),
                            (['--no-field', 'U'], {'p', 'T', 'k'}),
                            (['--no-field', 'U,T', '--no-field', '?'], {'coordinate_x'}),
                            (['--field', 'all', '--no-field', 'U'], {'p', 'T', 'k'}), (['--carry', 'p'], {'p'})):
        must('build', 'flow.vtu', '-o', 'x.tetlod', '--quiet', *options)
        if set(controlled('x.tetlod')) != wanted:
            return options, controlled('x.tetlod')
    must('build', 'flow.vtu', '-o', 'x.tetlod', '--quiet', '--field', 'all:5%', '--field', 'p:1%', '--max-error', '5%')
    base = info('x.tetlod')['levels'][0]['errors']
    if not base['p']['max'] <= 0.0101 or not 0.011 < base['T']['max'] <= 0.0501:
        return base
    must('build', 'flow.vtu', '-o', 'x.tetlod', '--quiet', '--for', 'mail')
    return None if [field['name'] for field in info('x.tetlod')['fields']] == ['U'] else info('x.tetlod')['fields']


def in_a_series():
    """Every field has steps, also one that begins with whole numbers."""
    points, tets, fields, _ = (*results.flow(4), {})
    first = {**fields, 'T': np.where(points[:, 1] > 0, 300, 340).astype(np.float32)}
    for step, values in enumerate((first, fields, {name: 1.1 * v for name, v in fields.items()})):
        results.write(path('step_%d.vtu' % step), points, tets, values)
    must('build', *(path('step_%d.vtu' % s) for s in range(3)), '-o', 'series.tetlod', '--quiet')
    names = [field['name'] for field in info('series.tetlod')['series']['fields']]
    return None if sorted(names) == ['T', 'U', 'k', 'p'] else names


def what_costs_most():
    """The figure is what a build without the field comes to, within a half."""
    said = said_by('build', 'wall.vtu', '-o', 'wall.tetlod')
    found = re.search(r"'wallShearStress' costs most: .* about ([\d.]+) times fewer tetrahedra, (\d+) instead of (\d+)",
                      said)
    if not found:
        return said
    must('build', 'wall.vtu', '-o', 'less.tetlod', '--no-field', 'wall*', '--quiet')
    with_it, without = tets_within('wall.tetlod', 0.01), tets_within('less.tetlod', 0.01)
    good = int(found[3]) == with_it and 2 / 3 < int(found[2]) / without < 3 / 2
    good = good and abs(float(found[1]) * int(found[2]) / with_it - 1) < 0.1
    if 'costs most' in said_by('build', 'ids.vtu', '-o', 'x.tetlod'):
        return 'a field alone'
    return None if good else (found[0], with_it, without)


def ids_stay_ids():
    """At every level they are ids of the original; at the finest, and where values are rounded, its own."""
    wanted = {name: set(values) for name, values in read_vtu('ids.vtu')[2].items() if name != 'heat'}
    said = said_by('build', 'ids.vtu', '-o', 'ids.tetlod', '--field-bits', '9')
    if 'ids, stored exactly, not controlled: GlobalNodeId, originalIds, owner' not in said:
        return said
    for choice in ['--error', '5%'], ['--level', '0'], []:
        must('extract', 'ids.tetlod', *choice, '-o', 'level.vtu')
        for name, values in read_vtu('level.vtu')[2].items():
            if name != 'heat' and not (set(values) <= wanted[name] if choice else set(values) == wanted[name]):
                return name, choice
    data = read_grid('level.vtu').GetPointData()
    if data.GetScalars() is None or data.GetScalars().GetName() != 'heat':
        return 'shown first'
    at = must('extract', 'ids.tetlod', '--error', '5%', '-o', 'level.vtu').stderr.decode()
    return None if at.count(': ids, of one') == 3 and 'warning' not in at and 'not controlled' not in at else at


def beside_constants():
    """A field of whole numbers is controlled where all others are constant: one that is tells nothing of the mesh."""
    points, tets = results.flow(4)[:2]
    scalar, vector = np.full(len(points), 2.5), np.tile([1.5, 0, 0], (len(points), 1))
    results.write(path('constant.vtu'), points, tets, {'start': scalar, 'wind': vector,
                                                       'depth': np.round(20 * points[:, 0])})
    said = said_by('build', 'constant.vtu', '-o', 'constant.tetlod')
    return None if re.search('controlled: .*depth', said) and 'ids' not in said else said


def first_field():
    """compare, build and info take the same one; Python and the viewer the first that is controlled."""
    must('extract', 'ids.tetlod', '--error', '1%', '-o', 'level.vtu')
    compared = must('compare', 'ids.vtu', 'level.vtu').stdout.decode()
    listed = must('info', 'ids.tetlod').stdout.decode()
    return None if compared.startswith('field         heat') and 'errors of heat' in listed else (compared, listed)


def regions_are_found():
    said = said_by('build', 'cells.vtu', '-o', 'x.tetlod')
    found = [field['name'] for field in info('x.tetlod')['cell_fields'] if field['region']]
    if "'part' of cells tells regions" not in said or found != ['part']:
        return said
    said = said_by('build', 'cells.vtu', '-o', 'x.tetlod', '--no-region')
    return said if 'regions' in said or any(f['region'] for f in info('x.tetlod')['cell_fields']) else None


def without_fields():
    points, tets = results.block((5, 5, 5))
    results.write(path('bare.vtu'), points, tets, {})
    said = said_by('build', 'bare.vtu', '-o', 'bare.tetlod')
    if 'coordinate_x' not in said or 'no field' not in said:
        return said
    must('verify', 'bare.tetlod', '--against', 'bare.vtu', '--quiet')
    must('extract', 'bare.tetlod', '--error', '1%', '-o', 'level.vtu')
    at = read_vtu('level.vtu')[0]
    low, high = at.min(axis=0), at.max(axis=0)
    if len(at) > 12 or not np.allclose(low, points.min(axis=0)) or not np.allclose(high, points.max(axis=0)):
        return at
    said = said_by('build', 'bare.vtu', '-o', 'x.tetlod', '--cell-data', 'average')
    return said if '--cell-data' in said else None


def where_bytes_are():
    """The parts add up to the stream."""
    must('build', 'cells.vtu', '-o', 'cells.tetlod', '--quiet')
    done = must('info', 'cells.tetlod')
    parts = [int(n) for n in re.findall(r'^ *(\d+) +[\d.]+ %  ', done.stdout.decode(), re.M)]
    advice = done.stderr.decode()
    good = sum(parts) == info('cells.tetlod')['bytes'] and len(parts) == 8 and '--carry' in advice
    return None if good else (parts, advice)


def what_is_off():
    said = said_by('build', 'wall.vtu', '-o', 'p.tetlod', '--field', 'p')
    at = must('extract', 'p.tetlod', '--error', '1%', '-o', 'level.vtu').stderr.decode()
    return None if all('warning: ' in text and "is not controlled, and " in text for text in (said, at)) else (said, at)


def narrow_help():
    for topic in ([], ['words'], *([c] for c in re.findall(r'^  ([a-z]+) ', must('help').stdout.decode(), re.M))):
        for line in must('help', *topic).stdout.decode().splitlines():
            if len(line) > 100:
                return topic, line
    return None


results.make(path(''), N)
for one in USUAL:
    case('%s: every field is within 5, 1 and 0.1 %%' % one, one_kind, one)
case('--field, --no-field, lists, patterns', what_is_chosen)
case('in a series every field has steps', in_a_series)
case('the field that costs most', what_costs_most)
case('ids stay ids', ids_stay_ids)
case('whole numbers beside constants', beside_constants)
case('the first field', first_field)
case('integers of few values are regions', regions_are_found)
case('a mesh without fields', without_fields)
case('where the bytes are', where_bytes_are)
case('a field that is far off is warned of', what_is_off)
case('no line of the help is above 100 columns', narrow_help)
fails('a pattern that nothing matches', 3, ['q*'], 'build', 'flow.vtu', '--field', 'q*')
fails('did you mean a field', 3, ["did you mean 'VonMises'"], 'build', 'solid.vtu', '--field', 'vonmise')
fails('a list with --abs-error', 2, ['--abs-error'], 'build', 'flow.vtu', '--field', 'p,k', '--abs-error', '1')
fails('did you mean an option', 2, ["'--levl', did you mean '--level K'?"], 'extract', 'solid.tetlod', '--levl', '3')
for given, ours in ((('serve', '--port', '80', '.'), '--listen ADDR:PORT'),
                    (('build', '-j', '4', 'flow.vtu'), '--threads N'),
                    (('build', '--tolerance=1%', 'flow.vtu'), '--max-error E'),
                    (('diff', '--tolerance=1%', 'a', 'b'), '--limit L')):
    fails("another program's name: " + given[1], 2, ["did you mean '%s'?" % ours], *given)
fails('half of a name is another one', 2, ["there is no option '--fort';"], 'serve', '--fort', '80', '.')
fails('an option takes no value', 2, ["'--keep-order' takes no value"], 'build', 'solid.vtu', '--keep-order=1')
fails('no option is like it', 2, ["there is no option '--zzzzzz';"], 'build', 'solid.vtu', '--zzzzzz')
fails('did you mean a command', 2, ["did you mean 'extract'"], 'extrakt')
fails('the version is an option', 2, ["did you mean '--version'"], 'version')
fails('info of a mesh', 3, ['tetlod build flow.vtu -o flow.tetlod'], 'info', 'flow.vtu')
finish()
