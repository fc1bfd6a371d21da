#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""--local-bound: a field that bounds the error of another one at every point. That `verify` refuses one that is too
small is tested by the attack (tests/attack), which seals such streams."""
import json

from common import CONFIG, case, fails, finish, info, must, path, report, tetlod

try:
    import numpy
    from common import read_vtu
    import vtk
except ImportError:
    numpy = None


def holds(sample, *options):
    """Over the overlay of level and original, at every level."""
    must('sample', *sample, '-o', 'mesh.vtu')
    must('build', 'mesh.vtu', '-o', 'mesh.tetlod', '--local-bound', *options)
    bounds = [(field['name'], field['bounds']) for field in info('mesh.tetlod')['fields'] if 'bounds' in field]
    controlled = [field['name'] for field in info('mesh.tetlod')['fields'] if field['controlled']]
    if sorted(bounds) != sorted((name + ' bound', name) for name in controlled):
        return bounds
    for level in info('mesh.tetlod')['levels']:  # an error that is no number is left out
        for name, _ in bounds:
            if not set(level['errors'][name]) >= {'sampled', 'rms'}:
                return level
    said = must('verify', 'mesh.tetlod', '--against', 'mesh.vtu').stdout.decode()
    return None if 'max held against the exact maximum at all of them' in said else said


def describes():
    """Its range is 0 to the largest; what people read names it and does not count it among the fields that nothing
    holds."""
    field = info('fin.tetlod')['fields'][-1]
    top = max(level['errors']['Pressure']['max'] for level in info('fin.tetlod')['levels'])
    width = 1 / (info('fin.tetlod')['fields'][0]['range'][1] - info('fin.tetlod')['fields'][0]['range'][0])
    if field['range'][0] or abs(field['range'][1] * width / top -
                                1) > 2 ** -14 or field['controlled'] or field['components'] != 1:
        return field
    text = must('info', 'fin.tetlod').stdout.decode()
    said = tetlod('extract', 'fin.tetlod', '--error', '1%', '-o', 'level.vtu').stderr.decode()
    good = ('bounds the error of Pressure' in text and '2 fields that are not controlled' in text
            and 'how far off Pressure is at most' in said)
    return None if good else (text, said)


def values(level):
    must('extract', 'fin.tetlod', '--level', str(level), '-o', 'level.vtu')
    return read_vtu('level.vtu')


def bounds_vertices():
    """Where a level has a vertex at the place of one of the original's, the difference there is no more than it says;
    the largest is what the level is certified for: no more, and no less by more than a step."""
    points, _, fields = read_vtu('fin.vtu')
    original = {tuple(p): value for p, value in zip(points.tolist(), fields['Pressure'].astype(float))}
    low, high = info('fin.tetlod')['fields'][0]['range']
    for number, level in enumerate(info('fin.tetlod')['levels'][:-1]):
        points, _, fields = values(number)
        at = numpy.array([original.get(tuple(p), numpy.nan) for p in points.tolist()])
        off, bound = abs(fields['Pressure'].astype(float) - at), fields['Pressure bound'].astype(float)
        most = level['errors']['Pressure']['max'] * (high - low)
        if numpy.nanmax(off - bound) > 1e-9 * (high - low) or bound.max() > most * (1 + 1e-9) or bound.min() < 0:
            return number, numpy.nanmax(off - bound), bound.max(), most
    if bound.max() > 2 ** -13 * (high - low):
        return 'the last level before the exact one is off by rounding only', bound.max()
    return None if not values(number + 1)[2]['Pressure bound'].any() else 'the finest level is the original'


def changes_nothing_else():
    """Levels have the same tetrahedra and values as without it, and the same errors, but for `max`: it is that of the
    bounds as they are rounded up, which does not pass a round error."""
    must('build', 'fin.vtu', '-o', 'plain.tetlod', '--field', 'Pressure')
    for plain, level in zip(info('plain.tetlod')['levels'], info('fin.tetlod')['levels'], strict=True):
        errors, others = dict(level['errors']['Pressure']), dict(plain['errors']['Pressure'])
        more, most = errors.pop('max'), others.pop('max')
        if (errors != others or not most <= more <= most + 1 / 32768
                or any(most <= named < more for named in (.05, .02, .01, .005, .002, .001, .0005, .0001))):
            return level, plain
    for name in ('plain', 'fin'):
        must('extract', name + '.tetlod', '--error', '1%', '-o', name + '-level.vtu')
    with_it, without = read_vtu('fin-level.vtu'), read_vtu('plain-level.vtu')
    same = ((with_it[0] == without[0]).all() and (with_it[1] == without[1]).all() and all(
        (with_it[2][name] == without[2][name]).all() for name in without[2]))
    return None if same and set(with_it[2]) - set(without[2]) == {'Pressure bound'} else (set(with_it[2]),
                                                                                          set(without[2]))


def same_bytes():
    streams = []
    for threads in ('1', '2', '3', '8'):
        must('build', 'fin.vtu', '-o', 'threads.tetlod', '--local-bound', '--threads', threads)
        streams.append(open(path('threads.tetlod'), 'rb').read())
    return None if len(set(streams)) == 1 else 'the bytes depend on the threads'


def has_unit():
    grid = vtk.vtkXMLUnstructuredGridReader()
    grid.SetFileName(path('fin.vtu'))
    grid.Update()
    grid.GetOutput().GetPointData().GetArray('Pressure').GetInformation().Set(vtk.vtkDataArray.UNITS_LABEL(), 'Pa')
    writer = vtk.vtkXMLUnstructuredGridWriter()
    writer.SetInputData(grid.GetOutput())
    writer.SetFileName(path('unit.vtu'))
    writer.Write()
    must('build', 'unit.vtu', '-o', 'unit.tetlod', '--local-bound')
    units = info('unit.tetlod')['metadata'].get('units')
    return None if units == {'Pressure': 'Pa', 'Pressure bound': 'Pa'} else units


def of_a_scalar():
    """The one component of a scalar is the scalar itself."""
    must('build', 'fin.vtu', '-o', 'component.tetlod', '--local-bound', '--field', 'Pressure:0')
    fields = {field['name']: (field['controlled'], field.get('bounds')) for field in info('component.tetlod')['fields']}
    return (None if fields['Pressure'][0] and fields['Pressure bound'][1] == 'Pressure' and 'Pressure:0' not in fields
            else fields)


def memory():
    """What --memory says it needs is what it takes."""
    must('sample', 'fin', '--size', '24', '-o', 'm.vtu')
    refused = tetlod('build', 'm.vtu', '-o', 'm.tetlod', '--memory', '1', '--local-bound').stderr.decode()
    said = int(refused.split('needs about ')[1].split()[0])
    peak = json.loads(must('build', 'm.vtu', '-o', 'm.tetlod', '--json', '--quiet',
                           '--local-bound').stdout)['peak_memory'] / 2 ** 20
    return None if abs(said - peak) <= .1 * peak + .5 else (said, peak)


EVERYWHERE = (
    (('fin', '--size', '8'), ('--field', 'Pressure', '--field', 'Velocity', '--growth', '1.3')),
    (('fin', '--size', '7'), ('--field', 'Velocity:mag', '--field', 'Density:1%', '--growth', '1.3')),
    (('shell',), ('--domain-error', '0', '--growth', '1.5')),
    (('torus',), ('--metric', 'sva', '--growth', '1.5')),
    (('cube', '--size', '8'), ('--contract', 'hybrid', '--certify-all', '--growth', '1.3')),
    (('cube', '--size', '6'), ()),  # its finest level has a bound of 0 everywhere
    (('delta', '--size', '6'), ('--growth', '2')),  # contractions refused at the last moment
    (('post', '--size', '8'), ('--keep-order', '--growth', '1.3')))
for sample, options in EVERYWHERE if CONFIG == 'release' else (EVERYWHERE[0], EVERYWHERE[-1]):
    case('it holds everywhere: %s %s' % (sample[0], ' '.join(options)), holds, sample, *options)
must('sample', 'fin', '--size', '10', '-o', 'fin.vtu')
must('build', 'fin.vtu', '-o', 'fin.tetlod', '--local-bound', '--field', 'Pressure')
case('its range, and how it is told', describes)
case('of a component of a scalar', of_a_scalar)
case('the same bytes on 1, 2, 3 and 8 threads', same_bytes)
for name, problem in (('vertices of the original', bounds_vertices),
                      ('other fields are as without it', changes_nothing_else), ('it has the unit', has_unit)):
    case(name, problem) if numpy else report(name, True, skip='numpy or VTK is not there')
case('--memory: right within 10 %', memory) if CONFIG == 'release' else report('--memory', True, skip='release only')
for options, word in ((('--certify', 'exact'), 'carry no bound'), (('--metric', 'measured'), 'carry no bound'),
                      (('--for', 'mail'), 'lossless'),
                      (('--field-bits', '12'), 'lossless'), (('--domain-error', '0.01'), '0.001')):
    fails('not with ' + ' '.join(options), 2, ['--local-bound', word], 'build', 'fin.vtu', '-o', 'no.tetlod',
          '--local-bound', *options)
must('extract', 'fin.tetlod', '--error', '1%', '-o', 'again.vtu')
fails('a field of that name', 3, ['Pressure bound', '--carry'], 'build', 'again.vtu', '-o', 'no.tetlod',
      '--local-bound')
case('without that field', lambda: must('build', 'again.vtu', '-o', 'no.tetlod', '--local-bound', '--carry',
                                        'Density') and None)
must('sample', 'wake', '--steps', '2', '--size', '6', '-o', 'wake.pvd')
fails('not of a series', 2, ['--local-bound', '--time'], 'build', 'wake.pvd', '-o', 'no.tetlod', '--local-bound')
case('of one step', lambda: must('build', 'wake.pvd', '-o', 'step.tetlod', '--local-bound', '--time', '1') and None)
finish()
