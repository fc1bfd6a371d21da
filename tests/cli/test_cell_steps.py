#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""Values of cells at every step of a series, in three formats, against VTK's own readers; and streams
whose cells have no steps."""
import os
import sys

import numpy as np

from common import ROOT, case, fails, finish, info, must, path, report, write

try:
    import exodus_file
    import vtk
    from vtk.util.numpy_support import vtk_to_numpy
except ImportError as missing:
    report('VTK and netCDF', True, skip='not installed: %s' % missing)
    finish()
    sys.exit()

from meshes import arrays_of, read, tet_mesh, vtk_mesh  # noqa: E402
from streams import plain, sealed  # noqa: E402
import test_io_foam as foam  # noqa: E402

STEPS = 11
TIMES = [0.25 * step for step in range(STEPS)]
GOLDEN = os.path.join(ROOT, 'tests', 'golden', 'series_cells.tetlod')


def values_at(step, count):
    """By cell: floats that change, some of them NaN or infinite, vectors, whole numbers, and what stays as it is."""
    random = np.random.default_rng(step)
    holes = np.sin(np.arange(count) + step).astype('f4')
    holes[step::13], holes[5::17] = np.nan, np.inf
    return {'id': np.arange(count, dtype='i4'), 'heat': np.cos(np.arange(count) / 9 + step), 'holes': holes,
            'flux': random.random((count, 3)).astype('f4'), 'load': (np.arange(count) * (step - 3)).astype('i4')}


def differences(wanted, stream):
    """Of every step: `wanted(step)` are VTK's values by cell, of which the field id numbers each tetrahedron's."""
    wrong = looked = 0
    for step in range(STEPS):
        must('extract', path(stream), '--step', str(step), '-o', path('step.vtu'), '--quiet')
        found, cells = read('step.vtu')[3], wanted(step)
        ids = found['id'].astype(int)
        for name, values in cells.items():
            if name not in found:
                return '%s is missing at step %d' % (name, step)
            looked += found[name].size
            got, here = found[name].astype(values.dtype), values[ids]  # VTK reads OpenFOAM's numbers as float32
            wrong += int(np.sum((got != here) & ~((got != got) & (here != here))))
    return 'of %d values %d are wrong' % (looked, wrong) if wrong or not looked else None


def pvd_case():
    points, tets, fields, _ = tet_mesh()
    sets = ''
    for step, time in enumerate(TIMES):
        moment = {'p': np.sin(points[:, 0] + time)}
        writer = vtk.vtkXMLUnstructuredGridWriter()
        writer.SetInputData(vtk_mesh(points, tets, moment, values_at(step, len(tets))))
        writer.SetFileName(path('s%d.vtu' % step))
        writer.Write()
        sets += '<DataSet timestep="%r" file="s%d.vtu"/>' % (time, step)
    write('s.pvd', '<VTKFile type="Collection" version="0.1"><Collection>%s</Collection></VTKFile>' % sets)
    must('build', path('s.pvd'), '--field', 'p', '--bands', '5%', '-o', path('pvd.tetlod'))
    must('verify', path('pvd.tetlod'), '--against', path('s.pvd'))
    return differences(lambda step: read('s%d.vtu' % step)[3], 'pvd.tetlod')


def exodus_case():
    points, tets = tet_mesh()[:2]
    moments = [values_at(step, len(tets)) for step in range(STEPS)]
    names = ['id', 'heat', 'load']
    exodus_file.write(path('s.exo'), points, [('TETRA', tets)], TIMES,
                      {'p': [np.sin(points[:, 0] + time) for time in TIMES]},
                      {name: [[moment[name] for moment in moments]] for name in names})
    reader = vtk.vtkExodusIIReader()
    reader.SetFileName(path('s.exo'))
    reader.UpdateInformation()
    reader.SetAllArrayStatus(reader.ELEM_BLOCK, 1)

    def wanted(step):
        reader.SetTimeStep(step)
        reader.Update()
        data = reader.GetOutput().GetBlock(0).GetBlock(0).GetCellData()
        return {name: vtk_to_numpy(data.GetArray(name)).copy() for name in names}

    must('build', path('s.exo'), '--field', 'p', '--bands', '5%', '-o', path('exo.tetlod'))
    return differences(wanted, 'exo.tetlod')


def foam_case():
    """Cells that are split: a hexahedron, a wedge, a pyramid; and a tetrahedron. The field id is VTK's number of each.
    """
    foam.write_case(False, False, False)
    for step, time in enumerate(TIMES):
        for name, values in (('id', np.arange(4.0)), ('p', np.array([2.5, 1, -3, 7]) * np.cos(step)),
                             ('U', np.arange(12.0).reshape(4, 3) * (step + 1))):
            kind = 'vector' if values.ndim > 1 else 'scalar'
            content = b'dimensions [0 2 -2 0 0 0 0];\n\ninternalField nonuniform List<' + kind.encode() + b'> ' + \
                foam.list_of(values, False) + b'\n;\n\nboundaryField\n{\n walls { type zeroGradient; }\n}\n'
            foam.put('case/%g/%s' % (time, name), 'vol%sField' % kind.capitalize(), content, False, False)
    foam.shutil.rmtree(path('case/10'))
    for step in range(STEPS):
        for name in ('T', 'phi'):
            if os.path.exists(path('case/%g/%s' % (TIMES[step], name))):
                os.remove(path('case/%g/%s' % (TIMES[step], name)))
    reader = vtk.vtkOpenFOAMReader()
    reader.SetFileName(path('case/case.foam'))
    reader.CreateCellToPointOff()
    reader.UpdateInformation()
    reader.EnableAllCellArrays()

    def wanted(step):
        reader.UpdateTimeStep(TIMES[step])
        return arrays_of(reader.GetOutput().GetBlock(0).GetCellData())

    must('build', path('case/case.foam'), '--bands', '5%', '-o', path('foam.tetlod'))
    if wanted(3)['p'][0] == wanted(0)['p'][0]:
        return 'VTK does not see steps'
    return differences(wanted, 'foam.tetlod')


def coarse_case():
    """A coarser level has the values of the step, too: those of the finest level's tetrahedra that arrived first."""
    coarse = {}
    for error in ('5%', '0'):
        must('extract', path('pvd.tetlod'), '--step', '7', '--error', error, '-o', path('step.vtu'))
        coarse[error] = read('step.vtu')[3]
    few = len(coarse['5%']['id'])
    same = all(np.array_equal(coarse['5%'][name], coarse['0'][name][:few], equal_nan=True) for name in coarse['0'])
    return None if same and 0 < few < len(coarse['0']['id']) else few


def without_steps_case():
    """A stream from before cells had steps: they are those of the first step, and are left out at others."""
    with open(GOLDEN, 'rb') as file:
        data = plain(file.read())
    write('old.tetlod', sealed(data.replace(b'CTIM', b'XTIM', 1)))
    for step, names in ((0, ['flux', 'heat', 'late', 'load', 'material', 'wide']), (5, [])):
        said = must('extract', path('old.tetlod'), '--step', str(step), '-o', path('step.vtu')).stderr.decode()
        if sorted(read('step.vtu')[3]) != names or ('without the values of cells heat, flux' in said) != (step > 0):
            return step, said
    must('extract', GOLDEN, '--step', '5', '-o', path('step.vtu'))
    return None if sorted(read('step.vtu')[3]) == ['flux', 'heat', 'load', 'material', 'wide'] else 'late has no steps'


def info_case():
    series = info(GOLDEN)['series']
    text = must('info', GOLDEN).stdout.decode()
    named = [field['name'] for field in series['cell_fields']]
    good = named == ['heat', 'flux', 'material', 'load', 'wide'] and series['cell_fields'][2]['range'] == [0, 2]
    good = good and 'none of late: the first step alone' in text
    return None if good else (named, text)


case('0 wrong values of cells in a PVD file of VTU files', pvd_case)
case('0 wrong values of cells in an Exodus file', exodus_case)
case('0 wrong values of cells in an OpenFOAM case', foam_case)
case('values of cells of a coarse band', coarse_case)
case('cells without steps are left out at other steps', without_steps_case)
case('info says which cells have steps', info_case)
for time in ('99', '-0.2', '2.7'):
    fails('no step near %s' % time, 2, ['times go from 0 to 2.5', 'the nearest is'], 'extract', path('pvd.tetlod'),
          '--time', time, '-o', path('x.vtu'))
case('half a step outside is near',
     lambda: must('extract', path('pvd.tetlod'), '--time', '2.6', '-o', path('x.vtu')) and None)
finish()
