#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""Exodus files against VTK's own reader: variables in one array ("small model"), and names that become vectors and tensors."""
import numpy as np
import vtk
from vtk.util.numpy_support import vtk_to_numpy

from common import case, finish, path, report
from meshes import converted, tet_mesh

try:
    import netCDF4
except ImportError as missing:
    report('netCDF', True, skip='not installed: %s' % missing)
    finish()

STEPS = 3


def text(names):
    return np.array([list(n.ljust(33, '\0')) for n in names], 'S1')


def exodus_file(name, names, small):
    """One block; a file as Exodus II's manual has it. Variable v is v + 1 at the first point, and grows with point and step."""
    points, tets = tet_mesh()[:2]
    with netCDF4.Dataset(path(name), 'w', format='NETCDF3_64BIT_OFFSET') as file:
        file.setncatts({'api_version': np.float32(5), 'version': np.float32(5), 'floating_point_word_size': np.int32(8),
                        'file_size': np.int32(not small), 'title': 'test'})
        for dim, size in (('num_dim', 3), ('num_nodes', len(points)), ('num_elem', len(tets)), ('num_el_blk', 1),
                          ('len_string', 33),
                          ('time_step', None), ('num_nod_var', len(names)), ('num_el_in_blk1',
                                                                             len(tets)), ('num_nod_per_el1', 4)):
            file.createDimension(dim, size)
        if small:
            file.createVariable('coord', 'f8', ('num_dim', 'num_nodes'))[:] = points.T
        for d in range(0 if small else 3):
            file.createVariable('coord' + 'xyz'[d], 'f8', ('num_nodes',))[:] = points[:, d]
        file.createVariable('eb_status', 'i4', ('num_el_blk',))[:] = 1
        ids = file.createVariable('eb_prop1', 'i4', ('num_el_blk',))
        ids[:] = 1
        ids.setncattr('name', 'ID')
        connect = file.createVariable('connect1', 'i4', ('num_el_in_blk1', 'num_nod_per_el1'))
        connect[:], connect.elem_type = tets + 1, 'TETRA'
        file.createVariable('time_whole', 'f8', ('time_step',))[:] = range(STEPS)
        file.createVariable('name_nod_var', 'S1', ('num_nod_var', 'len_string'))[:] = text(names)
        values = np.arange(STEPS)[:, None, None] / 8 + np.arange(len(names))[:,
                                                                             None] + 1 + np.arange(len(points)) / 1024
        if small:
            file.createVariable('vals_nod_var', 'f8', ('time_step', 'num_nod_var', 'num_nodes'))[:] = values
        for v in range(0 if small else len(names)):
            file.createVariable('vals_nod_var%d' % (v + 1), 'f8', ('time_step', 'num_nodes'))[:] = values[:, v]
    return path(name)


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
    return {a.GetName(): vtk_to_numpy(a) for a in arrays if a.GetName() != 'GlobalNodeId'}


def names_case(names, small):
    name = exodus_file('in.e', names, small)
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
         ['x', 'y', 'z'], ['u_X', 'u_Y', 'p'],
         ['S_XX', 'S_YY', 'S_ZZ', 'S_XY', 'S_XZ', 'S_YZ', 'end'], ['sxx', 'syy', 'szz', 'sxy', 'syz', 'szx'], ['vx', 'vz', 'vy'], ['ax', 'ay'],
         ['sxx', 'syy', 'szz', 'sxy', 'sxz']]
for small in False, True:
    for names in NAMES:
        case('%s: %s' % ('small model' if small else 'large model', ' '.join(names)), names_case, names, small)
finish()
