#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""Answers keep the promise: absolute errors of fields in different units, magnitudes and components of vectors,
rounding inside the limit, and what is said of fields that nothing holds down."""
import re

import numpy as np
import vtk
from vtk.util.numpy_support import numpy_to_vtk, vtk_to_numpy

from common import case, finish, info, must, path, tetlod

LEVELS = ('1%', '0.3%', '5%')


def read(name):
    reader = vtk.vtkXMLUnstructuredGridReader()
    reader.SetFileName(path(name))
    reader.Update()
    return reader.GetOutput()


def array(mesh, name):
    return vtk_to_numpy(mesh.GetPointData().GetArray(name)).astype(float)


def make_input():
    """Two scalars in units that are nine orders apart, a vector that turns, and a field that nobody controls."""
    must('sample', 'cube', '--size', '10', '-o', 'cube.vtu')
    mesh = read('cube.vtu')
    points = vtk_to_numpy(mesh.GetPoints().GetData()).astype(float)
    x, y, z = (points / points.max()).T
    fields = {'stress': 2.1e9 * np.sin(x) * y, 'jacobian': 0.5 + 0.5 * np.cos(5 * y * z),
              'flow': np.column_stack([np.cos(4 * x + z), np.sin(4 * x + z),
                                       0.3 * y]), 'noise': np.sin(40 * x * y + 9 * z)}
    data = mesh.GetPointData()
    while data.GetNumberOfArrays():
        data.RemoveArray(0)
    for name, values in fields.items():
        made = numpy_to_vtk(np.ascontiguousarray(values), deep=True)
        made.SetName(name)
        data.AddArray(made)
    writer = vtk.vtkXMLUnstructuredGridWriter()
    writer.SetFileName(path('input.vtu'))
    writer.SetInputData(mesh)
    writer.Write()


def difference(level, name, of=lambda values: values):
    """The largest difference from the input at its points, of some function of a field."""
    probe = vtk.vtkProbeFilter()
    probe.SetInputData(read('input.vtu'))
    probe.SetSourceData(read(level))
    probe.Update()
    inside = array(probe.GetOutput(), probe.GetValidPointMaskArrayName()) > 0
    assert inside.mean() > 0.5
    wanted, got = of(array(read('input.vtu'), name)), of(array(probe.GetOutput(), name))
    return np.abs(wanted - got)[inside].max()


def width(values):
    return values.max() - values.min()


def absolute_errors():
    must('build', 'input.vtu', '-o', 'two.tetlod', '--field', 'stress', '--field', 'jacobian', '--carry', 'stress',
         '--quiet')
    levels = info('two.tetlod')['levels']
    for error in 1e7, 1e8, 0.02:
        done = must('extract', 'two.tetlod', '--abs-error', repr(error), '-o', 'level.vtu')
        for name in 'stress', 'jacobian':
            if difference('level.vtu', name) > error * (1 + 1e-6):
                return '%s is off by %g, not %g' % (name, difference('level.vtu', name), error)
        if error == 1e7 and 'level %d ' % (len(levels) - 1) in done.stderr.decode():
            return 'the finest level is no test'
    return None


def off_at_levels(stream, what, of):
    for error in LEVELS:
        must('extract', stream, '--error', error, '-o', 'level.vtu')
        off = difference('level.vtu', 'flow', of) / width(of(array(read('input.vtu'), 'flow')))
        if off > float(error[:-1]) / 100:
            return '%s of flow is off by %g at %s' % (what, off, error)
    return None


def magnitudes():
    length = lambda v: np.linalg.norm(v, axis=1)  # noqa: E731
    must('build', 'input.vtu', '-o', 'mag.tetlod', '--field', 'flow:mag', '--quiet')
    off = off_at_levels('mag.tetlod', 'the length', length)
    if off:
        return off
    fields = {f['name']: f['controlled'] for f in info('mag.tetlod')['fields']}
    return None if fields['flow'] and fields['flow:mag'] and not fields['stress'] else fields


def components():
    first = lambda v: v[:, 0]  # noqa: E731
    must('build', 'input.vtu', '-o', 'part.tetlod', '--field', 'flow:0', '--quiet')
    return off_at_levels('part.tetlod', 'component 0', first)


def rounding_is_inside():
    must('build', 'input.vtu', '-o', 'round.tetlod', '--field', 'stress:1%', '--field-bits', '7', '--position-error',
         '0.1%', '--quiet')
    base = info('round.tetlod')['levels'][0]['errors']['stress']
    if not 0.004 < base['max'] <= 0.01:
        return 'the base is at %s, the limit is 0.01' % base
    must('build', 'input.vtu', '-o', 'stop.tetlod', '--field', 'stress', '--max-error', '1%', '--field-bits', '7',
         '--quiet')
    base = info('stop.tetlod')['levels'][0]['errors']['stress']
    return None if 0.004 < base['max'] <= 0.01 else base


def rounding_beyond_the_limit():
    done = tetlod('build', 'input.vtu', '-o', 'x.tetlod', '--field', 'stress:0.1%', '--field-bits', '7')
    said = done.stderr.decode()
    return (None if done.returncode == 2 and 'rounding' in said and '0.39' in said and '0.1 %' in said else
            (done.returncode, said))


def which_field():
    said = must('build', 'input.vtu', '-o', 'default.tetlod').stderr.decode()
    if 'controlled: stress, jacobian, flow, noise' not in said or 'only measured' in said:
        return said
    said = must('build', 'input.vtu', '-o', 'one.tetlod', '--field', 'stress').stderr.decode()
    if 'not controlled, their error is only measured: jacobian, flow, noise' not in said:
        return said
    said = must('build', 'input.vtu', '-o', 'named.tetlod', '--field', 'noise', '--carry', 'noise').stderr.decode()
    return said if '--field' in said or 'controlled' in said else None


def what_is_off():
    level = next(i for i in info('one.tetlod')['levels'] if i['errors']['stress']['max'] <= 0.01)
    others = {name: errors['sampled'] for name, errors in level['errors'].items() if name != 'stress'}
    worst = max(others, key=others.get)
    said = must('extract', 'one.tetlod', '--error', '1%', '-o', 'level.vtu').stderr.decode()
    certified = re.search(r"stress \u2264 ([\d.]+) % of the range, [-+.e\d]+ in its units \(certified\)", said)
    measured = dict(
        re.findall(r"(\w+) about ([\d.]+) % of the range, [-+.e\d]+ in its units \(measured, not controlled\)", said))
    if (not certified or not 1 <= float(certified[1]) / (100 * level['errors']['stress']['max']) < 1.01
            or set(measured) != set(others)
            or any(not 1 <= float(said) / (100 * others[name]) < 1.01 for name, said in measured.items())):
        return said, worst, others
    lines = must('info', 'one.tetlod').stdout.decode().splitlines()
    row = next(line.split() for line in lines if line.split()[:2] == [str(level['level']), str(level['vertices'])])
    said = any('3 fields that are not controlled' in line for line in lines)
    return None if float(row[-1]) == float('%.4g' % (100 * others[worst])) and said else (row, lines[-1])


make_input()
case('an absolute error is of every field in its own range', absolute_errors)
case("a magnitude's promise holds for the vector", magnitudes)
case("a component's promise holds for the vector", components)
case('rounding is inside the limit', rounding_is_inside)
case('rounding beyond the limit is refused with the figure', rounding_beyond_the_limit)
case('build says which field it chose, and which are not controlled', which_field)
case('extract and info say how far off fields are that are not controlled', what_is_off)
finish()
