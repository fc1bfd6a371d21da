#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""Field data of what is extracted: content id, level, errors and time, by VTK and meshio; none becomes a field."""
import os
import re
import sys
import xml.etree.ElementTree as etree

import meshio
import numpy as np
from vtk.util.numpy_support import vtk_to_numpy
import vtk

from common import case, finish, info, must, path, tetlod

sys.path.insert(0, os.path.join(os.environ['ROOT'], 'client-examples', 'python'))
import tetlod as client  # noqa: E402

HEAVY = b'VTKHDF' in tetlod('formats').stdout


def of_grid(grid):
    data = grid.GetFieldData()
    return {data.GetArrayName(i): vtk_to_numpy(data.GetArray(i)) for i in range(data.GetNumberOfArrays())}


def facts(name):
    if name.endswith('.xdmf'):  # Debian's VTK has no reader of XDMF, and meshio passes over values of the grid
        items = etree.parse(path(name)).iter('Attribute')
        meshio.read(path(name))
        return {a.get('Name'): np.array(a[0].text.split(), float) for a in items if a.get('Center') == 'Grid'}
    reader = vtk.vtkHDFReader() if name.endswith('.vtkhdf') else vtk.vtkXMLUnstructuredGridReader()
    reader.SetFileName(path(name))
    reader.Update()
    return of_grid(reader.GetOutputDataObject(0))


def differs(found, stream, level, errors, time=None):
    wanted = {'tetlod_id': np.frombuffer(stream['cid'].encode(), np.uint8), 'tetlod_level': [level],
              'tetlod_domain_error': [stream['levels'][level]['domain_error']]}
    wanted.update({'tetlod_max_error ' + name: [error] for name, error in errors.items()})
    if time is not None:
        wanted['TimeValue'] = [time]
    same = found.keys() == wanted.keys() and all(np.array_equal(found[name], wanted[name]) for name in wanted)
    return None if same else (found, wanted)


def level_of(message):
    return int(re.search(r'level (\d+)', message)[1])


def level_case(extension):
    stream = info('fin.tetlod')
    level = level_of(must('extract', 'fin.tetlod', '--error', '1%', '-o', 'level' + extension).stderr.decode())
    at = stream['levels'][level]
    errors = {name: error['max'] for name, error in at['errors'].items()}
    problem = differs(facts('level' + extension), stream, level, errors)
    again = must('extract', 'fin.tetlod', '--level', str(level), '-o', 'again' + extension)
    if not problem and open(path('level' + extension), 'rb').read() != open(path('again' + extension), 'rb').read():
        problem = 'other bytes: %r' % again
    return problem or fields_of('level' + extension, {'Pressure', 'Density', 'Velocity'})


def fields_of(name, wanted):
    """None, or which fields the stream of such a file has instead."""
    said = must('build', name, '-o', 'again.tetlod').stderr.decode()
    stream = info('again.tetlod')
    found = {field['name'] for field in stream['fields']} | {field['name'] for field in stream.get('cells', [])}
    return None if found == wanted and 'left out' not in said else (found, said)


def step_case(extension):
    stream = info('wake.tetlod')
    level = level_of(must('extract', 'wake.tetlod', '--step', '2', '--error', '5%', '-o',
                          'step' + extension).stderr.decode())
    mesh = client.open(path('wake.tetlod')).at(stream['series']['times'][2], error=0.05)
    errors = {name: error['max'] for name, error in mesh.errors.items()}
    problem = differs(facts('step' + extension), stream, level, errors, mesh.time)
    return problem or differs(of_grid(mesh.to_vtk()), stream, level, errors, mesh.time)


def box_case():
    """The errors of a level that is finer in a box hold in its transition, too."""
    stream = info('fin.tetlod')
    must('extract', 'fin.tetlod', '--error', '10%', '--box', '0,0,0,.3,.3,.3', '-o', 'box.vtu')
    found = facts('box.vtu')
    level = int(found['tetlod_level'][0])
    coarse = stream['levels'][level]['errors']
    if any(found['tetlod_max_error ' + name][0] < error['max'] for name, error in coarse.items()):
        return found
    return None if found['tetlod_id'].tobytes().decode() == stream['cid'] else found


def original_case():
    """The original has none: the finest level's file is the one that is made of the input."""
    must('convert', 'fin.vtu', '-o', 'plain.vtu')
    must('build', 'fin.vtu', '--keep-order', '-o', 'kept.tetlod')
    must('extract', 'kept.tetlod', '--original-order', '-o', 'original.vtu')
    same = open(path('plain.vtu'), 'rb').read() == open(path('original.vtu'), 'rb').read()
    return None if same and not facts('original.vtu') else facts('original.vtu')


must('sample', 'fin', '--size', '8', '-o', 'fin.vtu')
must('build', 'fin.vtu', '-o', 'fin.tetlod')
must('sample', 'wake', '--size', '4', '--steps', '4', '-o', 'wake.pvd')
must('build', 'wake.pvd', '-o', 'wake.tetlod')
for ending in ['.vtu'] + ['.vtkhdf', '.xdmf'] * HEAVY:
    case('a level as %s' % ending, level_case, ending)
    case('a step as %s' % ending, step_case, ending)
case('a level that is finer in a box', box_case)
case('the original', original_case)
finish()
