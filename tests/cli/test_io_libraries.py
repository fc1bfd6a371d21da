#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""VTKHDF, XDMF, Exodus and CGNS files, as h5py, meshio, VTK, netCDF and libcgns write them, are read exactly."""
import os
import subprocess

import numpy as np
import vtk

import mpi_job
from common import CONFIG, case, fails, finish, must, path, report, tetlod, write
from meshes import compare, compare_split, converted, read, structured, tet_mesh, vtk_mesh, volumes
from test_io_vtkxml import other_cells, quadratic_grid

try:
    import h5py
    import meshio
    import netCDF4
    import cgns_file
except ImportError as missing:
    report('libraries', True, skip='not installed: %s' % missing)
    finish()

BUILT = tetlod('formats').stdout.decode()
WEDGE = [0, 2, 1, 3, 5, 4]  # VTK's wedges are turned the other way


# ---- VTKHDF

def vtkhdf_mesh(name, parts, compression=None, variable_type=False, typed=True):
    """`parts` is a list of meshes: one partition each."""
    with h5py.File(path(name), 'w') as file:
        root = file.create_group('VTKHDF')
        root.attrs['Version'] = (1, 0)
        if typed:
            root.attrs['Type'] = 'UnstructuredGrid' if variable_type else np.bytes_('UnstructuredGrid')
        put = lambda where, name, values: where.create_dataset(name, data=values, compression=compression)
        put(root, 'NumberOfPoints', [len(p[0]) for p in parts])
        put(root, 'NumberOfCells', [len(p[1]) for p in parts])
        put(root, 'NumberOfConnectivityIds', [4 * len(p[1]) for p in parts])
        put(root, 'Points', np.concatenate([p[0] for p in parts]))
        put(root, 'Connectivity', np.concatenate([p[1].ravel() for p in parts]))
        put(root, 'Offsets', np.concatenate([4 * np.arange(len(p[1]) + 1) for p in parts]))
        put(root, 'Types', np.full(sum(len(p[1]) for p in parts), 10, np.uint8))
        for group, at in (('PointData', 2), ('CellData', 3)):
            where = root.create_group(group)
            for field in parts[0][at]:
                put(where, field, np.concatenate([p[at][field] for p in parts]))
    return path(name)


def vtkhdf_untyped_case():
    mesh = tet_mesh()
    return compare(mesh, converted(vtkhdf_mesh('in.vtkhdf', [mesh], typed=False)))


def vtkhdf_case(precision, compression, variable):
    mesh = tet_mesh(precision=precision)
    name = vtkhdf_mesh('in.vtkhdf', [mesh], compression, variable)
    reader = vtk.vtkHDFReader()
    reader.SetFileName(name)
    reader.Update()
    if not variable and reader.GetOutput().GetNumberOfCells() != len(mesh[1]):
        return 'VTK does not read it'
    return compare(mesh, converted(name))


def halves(mesh):
    points, tets, fields, cells = mesh
    for mask in (cells['region'] == 1, cells['region'] == 2):
        used, local = np.unique(tets[mask], return_inverse=True)
        yield points[used], local.reshape(-1, 4), {n: v[used]
                                                   for n, v in fields.items()}, {n: v[mask] for n, v in cells.items()}


def vtkhdf_parts_case():
    mesh = tet_mesh()
    p, t, f, c = converted(vtkhdf_mesh('in.vtkhdf', list(halves(mesh))))
    if len(p) != len(mesh[0]) or not np.isclose(volumes(p, t).sum(), volumes(*mesh[:2]).sum()) or \
            sorted(c['load']) != sorted(mesh[3]['load']):
        return '%d points' % len(p)
    return None if mpi_job.missing() else mpi_job.same((2,), [path('in.vtkhdf')], '--field', 'heat', '--paged=100')


def vtkhdf_steps_case():
    """Two steps: the same mesh, other values, as version 2.0 has it."""
    points, tets, fields, cells = mesh = tet_mesh(100)
    name = vtkhdf_mesh('in.vtkhdf', [mesh])
    with h5py.File(name, 'a') as file:
        root = file['VTKHDF']
        root.attrs['Version'] = (2, 0)
        later = fields['heat'] + 1
        del root['PointData/heat']
        root['PointData/heat'] = np.concatenate([fields['heat'], later])
        steps = root.create_group('Steps')
        steps.attrs['NSteps'] = 2
        steps['Values'] = [0.5, 1.5]
        for n in 'PartOffsets', 'PointOffsets', 'CellOffsets', 'ConnectivityIdOffsets':
            steps[n] = [0, 0]
        steps['NumberOfParts'] = [1, 1]
        steps['PointDataOffsets/heat'] = [0, len(points)]
    problem = compare(mesh, converted(name, '--time', '0'))
    return problem or compare((points, tets, dict(fields, heat=later), cells), converted(name))


def vtkhdf_image_case():
    grid, points, fields, cells, volume = structured('image')
    with h5py.File(path('in.vtkhdf'), 'w') as file:
        root = file.create_group('VTKHDF')
        root.attrs['Version'] = (1, 0)
        root.attrs['Type'] = np.bytes_('ImageData')
        root.attrs['WholeExtent'] = (0, 4, 0, 3, 0, 2)
        root.attrs['Origin'], root.attrs['Spacing'] = (1.0, 2, 3), (0.5, 0.25, 2)
        for group, arrays, shape in (('PointData', fields, (3, 4, 5)), ('CellData', cells, (2, 3, 4))):
            for n, v in arrays.items():
                root['%s/%s' % (group, n)] = v.reshape(shape + v.shape[1:])
    return compare_split(points, fields, cells, volume, converted(path('in.vtkhdf')))


# ---- XDMF

def xdmf_meshio_case(form, mixed):
    points, tets, fields, cells = tet_mesh(120)
    blocks = [('tetra', tets), ('triangle', tets[:3, :3])] if mixed else [('tetra', tets)]
    data = {n: [v, v[:3]] if mixed else [v] for n, v in cells.items()}
    meshio.write(path('in.xdmf'), meshio.Mesh(points, blocks, point_data=fields, cell_data=data), data_format=form)
    return compare((points, tets, fields, cells), converted(path('in.xdmf')), form != 'XML')


def xdmf_steps_case():
    points, tets, fields, cells = tet_mesh(60)
    item = lambda values, kind='Float': '<DataItem Dimensions="%s" NumberType="%s" Precision="8" Format="XML">%s</DataItem>' % (
        ' '.join(map(str, values.shape)), kind, ' '.join(map(repr,
                                                             values.ravel().tolist())))
    grids = ''.join(
        '''<Grid Name="t%d"><Time Value="%g"/><Topology TopologyType="Tetrahedron" NumberOfElements="%d">%s</Topology>
        <Geometry GeometryType="X_Y_Z">%s</Geometry><Attribute Name="heat" Center="Node">%s</Attribute></Grid>''' %
        (s, s / 2, len(tets), item(tets, 'Int'), ''.join(item(points[:, d])
                                                         for d in range(3)), item(fields['heat'] + s))
        for s in range(3))
    write(
        'in.xdmf',
        '<Xdmf Version="3.0"><Domain><Grid GridType="Collection" CollectionType="Temporal">%s</Grid></Domain></Xdmf>' %
        grids)
    problem = compare((points, tets, {'heat': fields['heat'] + 2}, {}), converted(path('in.xdmf')))
    return problem or compare((points, tets, {'heat': fields['heat']}, {}), converted(path('in.xdmf'), '--time', '0'))


def xdmf_hyperslab_case():
    """All steps in one data set; a vector whose components are items of their own."""
    points, tets, fields, cells = tet_mesh(60)
    n = len(points)
    with h5py.File(path('in.h5'), 'w') as file:
        file['points'], file['tets'] = points, tets
        file['heat'] = np.stack([fields['heat'] + s for s in range(5)])
        file['wind'] = np.stack([fields['wind'] + s for s in range(5)])
        file['wide'] = np.repeat(np.repeat(cells['load'].reshape(-1, 1), 4, axis=1), 2, axis=0) + np.arange(4) * 10
        for d in range(3):
            file['w%d' % d] = fields['wind'][:, d]
    item = lambda name, shape: (
        '<DataItem Dimensions="%s" Precision="8" Format="HDF">in.h5:/%s</DataItem>' % (shape, name))
    slab = lambda shape, chosen, of: '<DataItem ItemType="HyperSlab" Dimensions="%s"><DataItem Format="XML" Dimensions="%d">%s</DataItem>%s</DataItem>' % (
        shape, len(chosen.split()), chosen, of)
    attribute = lambda name, centre, inside: '<Attribute Name="%s" Center="%s">%s</Attribute>' % (name, centre, inside)
    text = '<Xdmf><Domain><Grid><Topology TopologyType="Tetrahedron">%s</Topology><Geometry GeometryType="XYZ">%s</Geometry>%s</Grid></Domain></Xdmf>'
    inside = (attribute('heat', 'Node', slab(n, '3 0 1 1 1 %d' % n, item('heat', '5 %d' % n))),
              attribute('wind', 'Node', slab('%d 3' % n, '2 0 0 1 1 1 1 %d 3' % n, item('wind', '5 %d 3' % n))),
              attribute('load', 'Cell',
                        slab(len(tets), '1 2 2 1 %d 1' % len(tets), item('wide', '%d 4' % (2 * len(tets))))),
              attribute('joined', 'Node',
                        '<DataItem ItemType="Function" Function="JOIN($0, $1, $2)">%s</DataItem>' % ''.join(
                  item('w%d' % d, n) for d in range(3))))
    shape = item('tets', '%d 4' % len(tets)), item('points', '%d 3' % n)
    write('in.xdmf', text % (*shape, ''.join(inside)))
    wanted = points, tets, {'heat': fields['heat'] + 3, 'wind': fields['wind'] + 2,
                            'joined': fields['wind']}, {'load': cells['load'] + 20}
    problem = compare(wanted, converted(path('in.xdmf')))
    for bad, word in (('4 1 1 1 1 %d' % n, 'beyond'), ('0 0 1 1 %d' % n, 'start, stride'), ('0 0 0 1 1 1', 'beyond')):
        write('in.xdmf', text % (*shape, attribute('heat', 'Node', slab(n, bad, item('heat', '5 %d' % n)))))
        done = tetlod('convert', path('in.xdmf'), '-o', path('out.vtu'))
        problem = problem or (None if done.returncode == 3 and word in done.stderr.decode() else done)
    return problem


def xdmf_types_case():
    """Coordinates and components of two types, each item with its own: the mesh has the wider one."""
    points, tets, fields, cells = tet_mesh(60)
    points[:, 0] = points[:, 0].astype(np.float32)
    n, whole = len(points), np.arange(len(points))
    item = lambda values, kind, size: '<DataItem Dimensions="%s" NumberType="%s" Precision="%d">%s</DataItem>' % (
        ' '.join(map(str, values.shape)), kind, size, ' '.join(map(repr, values.ravel().tolist())))
    joined = item(whole, 'Int', 4) + item(points[:, 0], 'Float', 4) + item(points[:, 1], 'Float', 8)
    write(
        'in.xdmf',
        '<Xdmf><Domain><Grid><Topology TopologyType="Tetrahedron">%s</Topology><Geometry '
        'GeometryType="X_Y_Z">%s</Geometry>'
        '<Attribute Name="joined" Center="Node"><DataItem ItemType="Function" Function="JOIN($0, $1, '
        '$2)">%s</DataItem></Attribute></Grid></Domain>'
        '</Xdmf>' % (item(tets, 'Int', 8), ''.join(item(points[:, d], 'Float', 8 if d else 4)
                                                   for d in range(3)), joined))
    return compare((points, tets, {'joined': np.column_stack([whole, points[:, :2]])}, {}), converted(path('in.xdmf')))


def xdmf_included_case():
    """Steps of two functions on one mesh that xi:include points to, as meshio and FEniCS write them, are one mesh with
    both."""
    points, tets, fields, cells = tet_mesh(60)
    with meshio.xdmf.TimeSeriesWriter(path('in.xdmf')) as writer:
        writer.write_points_cells(points, [('tetra', tets)])
        for s in range(3):
            writer.write_data(s / 2, point_data={'heat': fields['heat'] + s}, cell_data={'load': [cells['load'] - s]})
    problem = compare((points, tets, {'heat': fields['heat'] + 1}, {'load': cells['load'] - 1}),
                      converted(path('in.xdmf'), '--time', '1'))
    item = lambda values, kind='Float': '<DataItem Dimensions="%s" NumberType="%s" Precision="8">%s</DataItem>' % (
        ' '.join(map(str, values.shape)), kind, ' '.join(map(repr, values.ravel().tolist())))
    mesh = '<Topology TopologyType="Tetrahedron">%s</Topology><Geometry GeometryType="XYZ">%s</Geometry>' % (item(
        tets, 'Int'), item(points))
    step = lambda name, values, shape: '<Grid Name="%s">%s<Attribute Name="%s" Center="Node">%s</Attribute></Grid>' % (
        name, shape, name, item(values))
    series = lambda name, at: '<Grid Name="TimeSeries_%s" GridType="Collection" CollectionType="Temporal">%s</Grid>' % (
        name, ''.join(
            step(name, fields[name] + s, '<xi:include xpointer="xpointer(%s/*[self::Topology or self::Geometry])"/>' %
                 at) for s in range(2)))
    write(
        'in.xdmf',
        '<Xdmf xmlns:xi="http://www.w3.org/2001/XInclude"><Domain><Grid Name="mesh" '
        'GridType="Uniform">%s</Grid>%s%s</Domain></Xdmf>'
        % (mesh, series('heat', "/Xdmf/Domain/Grid[@GridType='Uniform'][1]"), series('wind', "//Grid[@Name='mesh']")))
    wanted = points, tets, {name: fields[name] + 1 for name in ('heat', 'wind')}, {}
    return problem or compare(wanted, converted(path('in.xdmf')))


def xdmf_structured_case(kind):
    grid, points, fields, cells, volume = structured({'3DSMesh': 'structured', '3DRectMesh': 'rectilinear',
                                                      '3DCoRectMesh': 'image'}[kind])
    arrays = {**fields, **cells}
    with h5py.File(path('in.h5'), 'w') as file:
        file['points'] = points
        for d in range(3):
            file['axis%d' %
                 d] = (np.unique(points[:, d].round(9)) if kind == '3DSMesh' else points[[0, 1, 5, 20]][:, d] * 0)
        for n, v in arrays.items():
            file[n] = v
        if kind == '3DRectMesh':
            for d, (start, step, count) in enumerate(((0, 1, 5), (0, 5, 4), (0, 20, 3))):
                del file['axis%d' % d]
                file['axis%d' % d] = points[start::step][:count, d]
    item = lambda name, shape: '<DataItem Dimensions="%s" Format="HDF">in.h5:/%s</DataItem>' % (shape, name)
    geometry = {
        '3DSMesh': ('XYZ', item('points', '3 4 5 3')),
        '3DRectMesh': ('VXVYVZ', item('axis0', '5') + item('axis1', '4') + item('axis2', '3')),
        '3DCoRectMesh': ('ORIGIN_DXDYDZ',
                         '<DataItem Dimensions="3">3 2 1</DataItem><DataItem Dimensions="3">2 .25 .5</DataItem>')
    }[kind]
    attributes = ''.join('<Attribute Name="%s" Center="%s">%s</Attribute>' % (
        n, 'Node' if n in fields else 'Cell', item(n, ' '.join(map(str, v.shape)))) for n, v in arrays.items())
    write(
        'in.xmf',
        '<?xml version="1.0"?><!DOCTYPE Xdmf SYSTEM "Xdmf.dtd" []><Xdmf><Domain><Grid><Topology TopologyType="%s" '
        'Dimensions="3 4 5"/><Geometry GeometryType="%s">%s</Geometry>%s</Grid></Domain></Xdmf>' %
        (kind, *geometry, attributes))
    return compare_split(points, fields, cells, volume, converted(path('in.xmf')))


# ---- Exodus

def with_id(mesh, ids):
    return mesh[0], mesh[1], mesh[2], dict(mesh[3], ObjectId=ids)


def exodus_vtk_case(precision):
    points, tets, fields, cells = mesh = tet_mesh(precision=precision)
    writer = vtk.vtkExodusIIWriter()
    writer.SetInputData(vtk_mesh(points, tets, fields, {'load': cells['load']}))
    writer.SetFileName(path('in.e'))
    writer.WriteAllTimeStepsOn()
    if not precision == np.float32:
        writer.SetStoreDoubles(1)
    writer.Write()
    p, t, f, c = converted(path('in.e'))
    if not np.allclose(p, points, atol=1e-7) or not np.array_equal(t, tets):
        return 'mesh'
    wrong = [n for n in ('heat', 'wind', 'mass') if n not in f or not np.allclose(f[n], fields[n], atol=1e-6)]
    return wrong or (None if np.allclose(c['load'], cells['load'], atol=1e-6) else 'cell field')


def exodus_netcdf_case(form, apart):
    """Three blocks, three steps; written as the manual of Exodus II has it."""
    points, tets, fields, cells = mesh = tet_mesh(90)
    order = np.argsort(cells['region'], kind='stable')
    tets, cells = tets[order], {n: v[order] for n, v in cells.items()}
    counts = np.bincount(cells['region'])[1:]
    with netCDF4.Dataset(path('in.exo'), 'w', format=form) as file:
        for name, size in (('num_dim', 3), ('num_nodes', len(points)), ('num_elem', len(tets) + 2), ('num_el_blk', 3),
                           ('len_string', 33),
                           ('time_step', None), ('num_nod_var', 2), ('num_elem_var', 1), ('four', 4), ('three', 3)):
            file.createDimension(name, size)
        if apart:
            points[:, 0] = points[:, 0].astype(np.float32)
            for d in range(3):
                file.createVariable('coord' + 'xyz'[d], 'f8' if d else 'f4', ('num_nodes',))[:] = points[:, d]
        else:
            file.createVariable('coord', 'f8', ('num_dim', 'num_nodes'))[:] = points.T
        file.createVariable('eb_prop1', 'i4', ('num_el_blk',))[:] = [10, 20, 30]
        file.createVariable('eb_names', 'S1', ('num_el_blk', 'len_string'))[:] = np.array(
            [list(n.ljust(33, '\0')) for n in ('core', 'shell', 'skin')], 'S1')
        times = file.createVariable('time_whole', 'f8', ('time_step',))
        text = lambda names: np.array([list(n.ljust(33, '\0')) for n in names], 'S1')
        file.createVariable('name_nod_var', 'S1', ('num_nod_var', 'len_string'))[:] = text(['heat', 'mass'])
        file.createVariable('name_elem_var', 'S1', ('num_elem_var', 'len_string'))[:] = text(['load'])
        begin = 0
        for b, count in enumerate(counts):
            file.createDimension('num_el_in_blk%d' % (b + 1), count)
            connect = file.createVariable('connect%d' % (b + 1), 'i4', ('num_el_in_blk%d' % (b + 1), 'four'),
                                          zlib=form == 'NETCDF4')
            connect.elem_type = 'TETRA'
            connect[:] = tets[begin:begin + count] + 1
            load = file.createVariable('vals_elem_var1eb%d' % (b + 1), 'f8', ('time_step', 'num_el_in_blk%d' % (b + 1)))
            for s in range(3):
                load[s, :] = cells['load'][begin:begin + count] + s
            begin += count
        file.createDimension('num_el_in_blk3', 2)
        connect = file.createVariable('connect3', 'i4', ('num_el_in_blk3', 'three'))
        connect.elem_type = 'TRI3'
        connect[:] = tets[:2, :3] + 1
        for v, name in enumerate(('heat', 'mass')):
            values = file.createVariable('vals_nod_var%d' % (v + 1), fields[name].dtype, ('time_step', 'num_nodes'),
                                         zlib=form == 'NETCDF4')
            for s in range(3):
                values[s, :] = fields[name] + np.float32(s)
        times[:] = [0, 1, 2]
    ids = cells['region'] * 10
    for step in 0, 2:
        wanted = (points, tets, {n: fields[n] + np.float32(step) for n in ('heat', 'mass')},
                  {'load': cells['load'] + step, 'ObjectId': ids})
        problem = compare(wanted, converted(path('in.exo'), *(['--time', '0'] if step == 0 else [])))
        if problem:
            return 'step %d: %s' % (step, problem)
    with netCDF4.Dataset(path('in.exo'), 'a') as file:  # as the truth table says: one block lacks the variable
        file.renameVariable('vals_elem_var1eb1', 'other')
    done = must('convert', path('in.exo'), '-o', path('converted.vtu'))
    lacks = np.isnan(read('converted.vtu')[3]['load'])
    if b'%d values of cells are NaN' % counts[0] not in done.stderr or not np.array_equal(lacks, ids == 10):
        return done.stderr
    second = ids == 20
    for block in '20', 'shell':
        p, t, f, c = converted(path('in.exo'), '--block', block)
        if (not np.array_equal(p[t], points[tets[second]]) or not np.array_equal(c['load'], cells['load'][second] + 2)
                or set(c['ObjectId']) != {20}):
            return 'block ' + block
    done = tetlod('convert', path('in.exo'), '--block', 'Shell', '-o', path('out.vtu'))
    return None if done.returncode == 3 and "no element block 'Shell'" in done.stderr.decode() else done


def exodus_cells_case(quadratic):
    grid = quadratic_grid()[0] if quadratic else other_cells(())[0]
    grid.GetCellData().RemoveArray('id')
    writer = vtk.vtkExodusIIWriter()
    writer.SetInputData(grid)
    writer.SetFileName(path('in.e'))
    writer.SetStoreDoubles(1)
    writer.Write()
    with netCDF4.Dataset(path('in.e'), 'a') as file:  # VTK leaves its own order, which is not that of Exodus
        for n in range(1, 5):
            connect = file.variables['connect%d' % n]
            order = {20: [*range(12), *range(16, 20), *range(12, 16)],
                     15: [*range(9), 12, 13, 14, 9, 10, 11]}.get(connect.shape[1])
            if order:
                connect[:] = connect[:][:, order]
    p, t, f, c = converted(path('in.e'), *(['--subdivide'] if quadratic else []))
    v = volumes(p, t)
    return None if (v > 0).all() and np.isclose(v.sum(), 2) and np.allclose(f['heat'],
                                                                            p @ [1, 2, 3.0]) else 'volumes %s' % v


# ---- CGNS

def cgns_tets_case(hdf5, precision):
    points, tets, fields, cells = mesh = tet_mesh(precision=precision)
    file = cgns_file.File(path('in.cgns'), hdf5)
    file.zone('Zone', points, len(tets))
    file.section('Walls', 'triangle', tets[:5, :3])
    file.section('Volume', 'tetra', tets)
    file.solution('AtVertices', cgns_file.VERTEX, fields)
    file.solution('InCells', cgns_file.CELL, cells)
    file.close()
    return compare(mesh, converted(path('in.cgns')))


def cgns_blocks_case():
    """Two zones that share a face; then one of them."""
    mesh = tet_mesh()
    file = cgns_file.File(path('in.cgns'))
    for n, (points, tets, fields, cells) in enumerate(halves(mesh)):
        file.zone('Half%d' % n, points, len(tets))
        file.section('Volume', 'tetra', tets)
        file.solution('AtVertices', cgns_file.VERTEX, fields)
        file.solution('InCells', cgns_file.CELL, cells)
    file.close()
    p, t, f, c = converted(path('in.cgns'))
    if len(p) != len(mesh[0]) or not np.isclose(volumes(p, t).sum(), volumes(*mesh[:2]).sum()):
        return '%d points' % len(p)
    return None if (converted(path('in.cgns'), '--block', 'Half1')[3]['region'] == 2).all() else 'block'


def cgns_bases_case():
    """Two bases with a zone of the same name each; one base, one zone of a base."""
    points, tets, fields, cells = tet_mesh(60)
    file = cgns_file.File(path('in.cgns'))
    for b, base in enumerate(('Base', 'Other')):
        if b:
            file.new_base(base)
        for z, zone in enumerate(('Zone', 'Only' + base)):
            file.zone(zone, points + 5 * z + 10 * b, len(tets))
            file.section('Volume', 'tetra', tets)
            file.solution('AtVertices', cgns_file.VERTEX, fields)
    file.close()
    wanted = {(): 4, ('--block', 'Other'): 2, ('--block', 'Other/Zone'): 1, ('--block', 'Zone'): 2,
              ('--block', 'OnlyBase'): 1}
    got = {arguments: len(converted(path('in.cgns'), *arguments)[1]) // len(tets) for arguments in wanted}
    refused = tetlod('convert', path('in.cgns'), '--block', 'Nobody', '-o', path('out.vtu'))
    return (None if got == wanted and refused.returncode == 3
            and b'Base/OnlyBase Base/Zone Other/OnlyOther Other/Zone' in refused.stderr else (got, refused))


def cgns_structured_case():
    grid, points, fields, cells, volume = structured('structured')
    file = cgns_file.File(path('in.cgns'))
    file.zone('Zone', points, dims=(5, 4, 3))
    file.solution('AtVertices', cgns_file.VERTEX, fields)
    file.solution('InCells', cgns_file.CELL, cells)
    file.close()
    return compare_split(points, fields, cells, volume, converted(path('in.cgns')))


def cgns_steps_case():
    points, tets, fields, cells = tet_mesh(60)
    file = cgns_file.File(path('in.cgns'))
    file.zone('Zone', points, len(tets))
    file.section('Volume', 'tetra', tets)
    for s in range(3):
        file.solution('Step%d' % s, cgns_file.VERTEX, {'heat': fields['heat'] + s})
    file.times([0, 1, 4.0], ['Step0', 'Step1', 'Step2'])
    file.close()
    problem = compare((points, tets, {'heat': fields['heat'] + 2}, {}), converted(path('in.cgns')))
    return problem or compare((points, tets, {'heat': fields['heat'] + 1}, {}),
                              converted(path('in.cgns'), '--time', '1'))


CELLS = [('hexahedron', [0, 1, 2, 3, 4, 5, 6, 7]), ('wedge', [1, 8, 2, 5, 9, 6]), ('pyramid', [4, 5, 6, 7, 10]),
         ('tetra', [5, 11, 6, 10])]
FACES = {'hexahedron': [[0, 3, 2, 1], [4, 5, 6, 7], [0, 1, 5, 4], [1, 2, 6, 5], [2, 3, 7, 6], [3, 0, 4, 7]],
         'wedge': [[0, 2, 1], [3, 4, 5], [0, 1, 4, 3], [1, 2, 5, 4], [2, 0, 3, 5]],
         'pyramid': [[0, 3, 2, 1], [0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4]], 'tetra': [[0, 2, 1], [0, 1, 3],
                                                                                          [1, 2, 3], [2, 0, 3]]}


def cgns_cells_case(kind):
    """All kinds of cells in sections of their own, in one of mixed ones, as polyhedra."""
    points = other_cells(())[1]
    file = cgns_file.File(path('in.cgns'))
    file.zone('Zone', points, 4)
    if kind == 'sections':
        for name, corners in CELLS:
            file.section(name, name, [corners])
    elif kind == 'mixed':
        numbers, offsets = [], [0]
        for name, corners in CELLS:
            numbers += [cgns_file.ELEMENTS[name]] + [c + 1 for c in corners]
            offsets.append(len(numbers))
        file.poly('Mixed', 'mixed', numbers, offsets)
    else:
        faces, cells, offsets = {}, [], [0]
        for name, corners in CELLS:
            for face in FACES[name]:
                face = [corners[i] for i in face]
                known = faces.get(tuple(sorted(face)))
                if known is None:
                    faces[tuple(sorted(face))] = (len(faces) + 1, face)
                    cells.append(len(faces))
                else:
                    cells.append(-known[0])
            offsets.append(len(cells))
        listed = [face for _, face in faces.values()]
        file.poly('Faces', 'ngon', [p + 1 for face in listed for p in face], np.cumsum([0] + [len(f) for f in listed]))
        file.poly('Cells', 'nface', cells, offsets)
    file.solution('AtVertices', cgns_file.VERTEX, {'heat': points @ [1, 2, 3.0]})
    file.solution('InCells', cgns_file.CELL, {'id': np.arange(4, dtype=np.int32)})
    file.close()
    p, t, f, c = converted(path('in.cgns'))
    v = volumes(p, t)
    if (v <= 0).any() or not np.allclose(np.bincount(c['id'].astype(int), v), [1, 0.5, 1 / 3, 1 / 6]):
        return 'volumes %s' % np.bincount(c['id'].astype(int), v)
    return None if np.allclose(f['heat'], p @ [1, 2, 3.0]) else 'values'


# ---- bad files

def damaged_cases(name):
    """Cut, and with bytes changed: an error or a mesh, never a crash."""
    good = open(path(name), 'rb').read()
    random = np.random.default_rng(11)
    bad = 0
    for n in range(25 if CONFIG == 'release' else 6):
        bytes_ = bytearray(good)
        if n % 3 == 0:
            bytes_ = bytes_[:random.integers(len(good))]
        else:
            for at in random.integers(0, len(good) if n % 3 == 1 else min(len(good), 4096), 1 + n % 7):
                bytes_[at] = random.integers(256)
        write('damaged' + os.path.splitext(name)[1], bytes(bytes_))
        done = tetlod('convert', path('damaged' + os.path.splitext(name)[1]), '-o', path('out.vtu'), timeout=600)
        bad += done.returncode not in (0, 3) or (done.returncode == 3 and done.stderr.count(b'\n') != 1)
    report('%s: damaged files end in one line or a mesh' % name, bad == 0, '%d did not' % bad)


def main():
    if 'vtkhdf' in BUILT:
        for precision in np.float32, np.float64:
            for compression in None, 'gzip':
                case('vtkhdf %s %s' % (np.dtype(precision), compression), vtkhdf_case, precision, compression, False)
        case('vtkhdf: without the attribute Type', vtkhdf_untyped_case)
        case('vtkhdf: type of variable length', vtkhdf_case, np.float64, None, True)
        case('vtkhdf: parts', vtkhdf_parts_case)
        case('vtkhdf: steps', vtkhdf_steps_case)
        case('vtkhdf: image', vtkhdf_image_case)
        damaged_cases('in.vtkhdf')
        for form in 'XML', 'Binary', 'HDF':
            for mixed in False, True:
                case('xdmf by meshio: %s%s' % (form, ', mixed cells' if mixed else ''), xdmf_meshio_case, form, mixed)
        for kind in '3DSMesh', '3DRectMesh', '3DCoRectMesh':
            case('xdmf: %s' % kind, xdmf_structured_case, kind)
        case('xdmf: steps', xdmf_steps_case)
        case('xdmf: parts of data sets, joined components', xdmf_hyperslab_case)
        case('xdmf: items of several types', xdmf_types_case)
        case('xdmf: steps of functions on an included mesh', xdmf_included_case)
        damaged_cases('in.xdmf')
    for precision in np.float32, np.float64:
        case('exodus by VTK %s' % np.dtype(precision), exodus_vtk_case, precision)
    for form in 'NETCDF3_CLASSIC', 'NETCDF3_64BIT_OFFSET', 'NETCDF4':
        for apart in True, False:
            case('exodus by netCDF: %s%s' % (form, '' if apart else ', coordinates in one'), exodus_netcdf_case, form,
                 apart)
    for quadratic in False, True:
        case('exodus: %s cells of all kinds' % ('quadratic' if quadratic else 'linear'), exodus_cells_case, quadratic)
    damaged_cases('in.exo')
    for hdf5 in True, False:
        for precision in np.float32, np.float64:
            case('cgns %s %s' % ('HDF5' if hdf5 else 'ADF', np.dtype(precision)), cgns_tets_case, hdf5, precision)
    damaged_cases('in.cgns')
    case('cgns: zones', cgns_blocks_case)
    case('cgns: bases', cgns_bases_case)
    case('cgns: structured', cgns_structured_case)
    case('cgns: steps', cgns_steps_case)
    for kind in 'sections', 'mixed', 'polyhedra':
        case('cgns: %s' % kind, cgns_cells_case, kind)
    finish()


if __name__ == '__main__':
    main()
