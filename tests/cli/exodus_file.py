# SPDX-License-Identifier: BSD-3-Clause
"""Exodus II files, as the manual of the format has them."""
import netCDF4
import numpy as np


def text(names):
    return np.array([list(name.ljust(33, '\0')) for name in names], 'S1')


def write(path, points, blocks, times, nodal=None, element=None, small=False, maps=None):
    """blocks: (type, rows of points), which may be empty. nodal: {name: [step][point]}; element: {name: [block][step]
    [row]}, None where a block does not have it. small: the coordinates in one variable, and what points have, too.
    maps: the numbers of points and of elements."""
    nodal, element = nodal or {}, element or {}
    with netCDF4.Dataset(path, 'w', format='NETCDF3_64BIT_OFFSET') as file:
        file.setncatts({'api_version': np.float32(5), 'version': np.float32(5), 'floating_point_word_size': np.int32(8),
                        'file_size': np.int32(not small), 'title': 'test'})
        sizes = {'num_dim': 3, 'num_nodes': len(points), 'num_elem': sum(len(rows) for _, rows in blocks),
                 'num_el_blk': len(blocks), 'len_string': 33, 'time_step': None, 'num_nod_var': len(nodal),
                 'num_elem_var': len(element)}
        for name, size in sizes.items():
            if size != 0:  # 0 would be unlimited, as None is
                file.createDimension(name, size)
        _write_points(file, points, small)
        _write_blocks(file, blocks)
        file.createVariable('time_whole', 'f8', ('time_step',))[:] = times
        for kind, names in ('nod', nodal), ('elem', element):
            if names:
                named = file.createVariable('name_%s_var' % kind, 'S1', ('num_%s_var' % kind, 'len_string'))
                named[:] = text(names)
        _write_nodal(file, nodal, small)
        for v, parts in enumerate(element.values()):
            for b, part in enumerate(parts):
                if part is not None and len(blocks[b][1]):
                    file.createVariable('vals_elem_var%deb%d' % (v + 1, b + 1), 'f8',
                                        ('time_step', 'num_el_in_blk%d' % (b + 1)))[:] = part
        for kind, rows, numbers in zip(('node', 'elem'), ('num_nodes', 'num_elem'), maps or ()):
            file.createVariable(kind + '_num_map', 'i4', (rows,))[:] = numbers
    return path


def _write_points(file, points, small):
    if small:
        file.createVariable('coord', 'f8', ('num_dim', 'num_nodes'))[:] = points.T
    for d in range(0 if small else 3):
        file.createVariable('coord' + 'xyz'[d], 'f8', ('num_nodes',))[:] = points[:, d]


def _write_blocks(file, blocks):
    file.createVariable('eb_status', 'i4', ('num_el_blk',))[:] = [int(len(rows) > 0) for _, rows in blocks]
    ids = file.createVariable('eb_prop1', 'i4', ('num_el_blk',))
    ids[:] = 10 * np.arange(1, len(blocks) + 1)
    ids.setncattr('name', 'ID')
    for b, (kind, rows) in enumerate(blocks, 1):
        if len(rows):
            shape = 'num_el_in_blk%d' % b, 'num_nod_per_el%d' % b
            for name, size in zip(shape, rows.shape):
                file.createDimension(name, size)
            connect = file.createVariable('connect%d' % b, 'i4', shape)
            connect[:], connect.elem_type = rows + 1, kind


def _write_nodal(file, nodal, small):
    if small:
        file.createVariable('vals_nod_var', 'f8', ('time_step', 'num_nod_var', 'num_nodes'))[:] = np.stack(
            list(nodal.values()), axis=1)
    for v, values in enumerate(() if small else nodal.values()):
        file.createVariable('vals_nod_var%d' % (v + 1), 'f8', ('time_step', 'num_nodes'))[:] = values
