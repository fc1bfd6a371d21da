#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""Files of more than 4 GB, most of them holes that take no room on the disk: what lies behind those is found."""
import os
import struct

import numpy as np

from common import CONFIG, case, finish, path, report
from meshes import compare, converted, tet_mesh

HOLE = 5 * 10 ** 9 // 8  # numbers of eight bytes
ALL = tet_mesh(60)
POINTS, TETS = ALL[:2]
MESH = POINTS, TETS, {'heat': ALL[2]['heat']}, {'load': ALL[3]['load']}
N, M = len(POINTS), len(TETS)
ENDS, TYPES = 4 * np.arange(1, M + 1), np.full(M, 10, np.uint8)


def vtu_case(word):
    """Each array 5 GB behind the one before; lengths are words of 4 or 8 bytes."""
    arrays = {'Points': POINTS, 'heat': MESH[2]['heat'], 'load': MESH[3]['load'], 'connectivity': TETS.astype('i8'),
              'offsets': ENDS.astype('i8'), 'types': TYPES}
    kind = {'f': 'Float64', 'i': 'Int64', 'u': 'UInt8'}
    array = lambda i, name: '<DataArray type="%s" Name="%s" NumberOfComponents="%d" format="appended" offset="%d"/>' % (
        kind[arrays[name].dtype.kind], name, 3 if name == 'Points' else 1, 8 * HOLE * (i + 1))
    of = [array(i, name) for i, name in enumerate(arrays)]
    head = '''<VTKFile type="UnstructuredGrid" version="1.0" byte_order="LittleEndian" header_type="UInt%d"><UnstructuredGrid>
        <Piece NumberOfPoints="%d" NumberOfCells="%d"><Points>%s</Points><PointData>%s</PointData><CellData>%s</CellData><Cells>%s</Cells>
        </Piece></UnstructuredGrid><AppendedData encoding="raw">_''' % (8 * word, N, M, of[0], of[1], of[2], ''.join(
        of[3:]))
    with open(path('large.vtu'), 'wb') as file:
        file.write(head.encode())
        for i, values in enumerate(arrays.values()):
            file.seek(len(head) + 8 * HOLE * (i + 1))
            file.write(struct.pack('<I' if word == 4 else '<Q', values.nbytes) + values.tobytes())
        file.write(b'</AppendedData></VTKFile>')
    return compare(MESH, converted(path('large.vtu')))


def legacy_case():
    """Behind an array that belongs to the file as a whole."""
    with open(path('large.vtk'), 'wb') as file:
        def put(text, values, kind):
            file.write(text.encode() + np.asarray(values).astype(kind).tobytes() + b'\n')

        file.write(
            b'# vtk DataFile Version 5.1\nx\nBINARY\nDATASET UNSTRUCTURED_GRID\nFIELD FieldData 1\nhole 1 %d double\n' %
            HOLE)
        file.seek(8 * HOLE, 1)
        put('\nPOINTS %d double\n' % N, POINTS, '>f8')
        put('CELLS %d %d\nOFFSETS vtktypeint64\n' % (M + 1, 4 * M), np.append(0, ENDS), '>i8')
        put('CONNECTIVITY vtktypeint64\n', TETS, '>i8')
        put('CELL_TYPES %d\n' % M, TYPES, '>i4')
        put('POINT_DATA %d\nFIELD FieldData 1\nheat 1 %d double\n' % (N, N), MESH[2]['heat'], '>f8')
        put('CELL_DATA %d\nFIELD FieldData 1\nload 1 %d double\n' % (M, M), MESH[3]['load'], '>f8')
    return compare(MESH, converted(path('large.vtk')))


def vtkhdf_case():
    import h5py
    plan = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
    plan.set_layout(h5py.h5d.CONTIGUOUS)
    plan.set_alloc_time(h5py.h5d.ALLOC_TIME_EARLY)
    plan.set_fill_time(h5py.h5d.FILL_TIME_NEVER)
    with h5py.File(path('large.vtkhdf'), 'w') as file:
        h5py.h5d.create(file.id, b'hole', h5py.h5t.NATIVE_DOUBLE, h5py.h5s.create_simple((HOLE,)), plan)
        root = file.create_group('VTKHDF')
        root.attrs['Version'], root.attrs['Type'] = (1, 0), np.bytes_('UnstructuredGrid')
        for name, values in (('NumberOfPoints', [N]), ('NumberOfCells', [M]), ('NumberOfConnectivityIds', [4 * M]),
                             ('Points', POINTS),
                             ('Connectivity', TETS.ravel()), ('Offsets', np.append(0, ENDS)), ('Types', TYPES),
                             ('PointData/heat', MESH[2]['heat']), ('CellData/load', MESH[3]['load'])):
            root[name] = values
    return compare(MESH, converted(path('large.vtkhdf')))


def main():
    if CONFIG != 'release':
        report('large files', True, skip='release only')
        return finish()
    for word in 4, 8:
        case('VTU, lengths of %d bytes' % word, vtu_case, word)
    case('legacy VTK', legacy_case)
    try:
        import h5py  # noqa: F401
    except ImportError as missing:
        report('VTKHDF', True, skip='not installed: %s' % missing)
        return finish()
    case('VTKHDF', vtkhdf_case)
    for name in 'large.vtu', 'large.vtk', 'large.vtkhdf':
        os.remove(path(name))
    return finish()


main()
