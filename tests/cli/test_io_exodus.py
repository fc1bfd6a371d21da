#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""Exodus files against VTK's own reader: variables in one array ("small model"), and names that become vectors and
tensors."""
import numpy as np
import vtk
from vtk.util.numpy_support import vtk_to_numpy

from common import case, finish, path, report
from meshes import converted, tet_mesh

try:
    import exodus_file
except ImportError as missing:
    report('netCDF', True, skip='not installed: %s' % missing)
    finish()

STEPS = 3


def write_case(name, names, small):
    """One block. Variable v is v + 1 at the first point, and grows with point and step."""
    points, tets = tet_mesh()[:2]
    values = np.arange(STEPS)[:, None] / 8 + np.arange(len(points)) / 1024
    nodal = {name: v + 1 + values for v, name in enumerate(names)}
    return exodus_file.write(path(name), points, [('TETRA', tets)], range(STEPS), nodal, small=small)


def vtk_fields(name, step):
    reader = vtk.vtkExodusIIReader()
    reader.SetFileName(name)
    reader.SetSqueezePoints(False)
    reader.UpdateInformation()
    reader.SetAllArrayStatus(reader.NODAL, 1)
    reader.SetTimeStep(step)
    reader.Update()
    data = reader.GetOutput().GetBlock(0).GetBlock(0).GetPointData()
    arrays = [data.GetArray(i) for i in range(data.GetNumberOfArrays())]
    fields = {a.GetName(): vtk_to_numpy(a) for a in arrays if a.GetName() != 'GlobalNodeId'}
    # its reader leaves xx, yy, zz, xy, xz, yz in this order, where VTK means the last two the other way round
    return {n: a[:, [0, 1, 2, 3, 5, 4]] if a.ndim == 2 and a.shape[1] == 6 else a for n, a in fields.items()}


def names_case(names, small):
    name = write_case('in.e', names, small)
    for step in 0, 2:
        wanted = vtk_fields(name, step)
        found = converted(name, '--time', str(step))[2]
        if set(found) != set(wanted):
            return 'step %d: %s, VTK has %s' % (step, sorted(found), sorted(wanted))
        wrong = [n for n in wanted if not np.array_equal(found[n], wanted[n])]
        if wrong:
            return 'step %d: values of %s' % (step, wrong)
    return None


NAMES = [['DISPX', 'DISPY', 'DISPZ', 'T'], ['disp_x', 'disp_y', 'disp_z'], ['p', 'vX', 'vy', 'vZ', 'q'],
         ['x', 'y', 'z'], ['u_X', 'u_Y', 'p'], ['S_XX', 'S_YY', 'S_ZZ', 'S_XY', 'S_XZ', 'S_YZ', 'end'],
         ['vx', 'vz', 'vy'], ['ax', 'ay'], ['sxx', 'syy', 'szz', 'sxy', 'sxz'],
         ['sxx', 'syy', 'szz', 'sxy', 'sxz', 'szx']]
for small in False, True:
    for names in NAMES:
        case('%s: %s' % ('small model' if small else 'large model', ' '.join(names)), names_case, names, small)


def tensor_case(endings):
    """Six components in any order are one tensor, in the order that VTK has."""
    names = ['stress_' + ending for ending in endings]
    found = converted(write_case('in.e', names, False), '--time', '1')[2]
    if set(found) != {'stress_'}:
        return sorted(found)
    wanted = ['xx', 'yy', 'zz', 'xy', 'yz', 'xz']
    plain = [''.join(sorted(ending.lower())) for ending in endings]
    scalars = converted(write_case('one.e', [n + '_' for n in names], False), '--time', '1')[2]
    for c, component in enumerate(wanted):
        if not np.array_equal(found['stress_'][:, c], scalars[names[plain.index(component)] + '_']):
            return 'component ' + component
    return None


for endings in (['xx', 'yy', 'zz', 'xy', 'yz', 'zx'], ['XX', 'XY', 'XZ', 'YY', 'YZ', 'ZZ'],
                ['xx', 'yx', 'yy', 'zx', 'zy', 'zz'], ['xx', 'yy', 'zz', 'xy', 'xz', 'yz']):
    case('a tensor: ' + ' '.join(endings), tensor_case, endings)
finish()
