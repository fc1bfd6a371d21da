#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""A VTU to each format and back is the same mesh; and the programs and libraries of the formats read what is written.
Gmsh's element data and groups, Abaqus, PLOT3D of every kind."""
import json
import os
import struct
import subprocess

import numpy as np
import vtk
from vtk.util.numpy_support import vtk_to_numpy

from common import DATA, case, finish, must, path, report, tetlod, write
from meshes import arrays_of, compare, compare_split, converted, structured, tet_mesh, vtk_mesh, volumes
from test_io_vtkxml import save

try:
    import meshio
    import netCDF4
except ImportError as missing:
    report('libraries', True, skip='not installed: %s' % missing)
    finish()

BUILT = {line.split()[0]: line.split()[2] == 'write' for line in tetlod('formats').stdout.decode().splitlines()}


def sample(precision=np.float64):
    points, tets, fields, cells = tet_mesh(200, precision)
    fields['stress'] = np.random.default_rng(1).standard_normal((len(points), 6))
    mesh = points, tets, fields, cells
    return mesh, save(vtk.vtkXMLUnstructuredGridWriter(), vtk_mesh(*mesh), 'sample.vtu')


def joined(arrays):
    """Components that were written one by one (NAME:0, NAME_1, ...) as the fields that they are of."""
    out, names = {}, list(arrays)
    for name in names:
        stem, end = name.rstrip('0123456789'), name[len(name.rstrip('0123456789')):]
        if end and stem[-1:] in ':_':
            out.setdefault(stem[:-1], []).append(arrays[name])
        else:
            out[name] = arrays[name]
    return {n: np.stack(v, axis=1) if isinstance(v, list) else v for n, v in out.items()}


def round_trip_case(extension, precision):
    (points, tets, fields, cells), name = sample(precision)
    must('convert', name, '-o', path('out' + extension))
    if extension in ('.mesh', '.meshb'):
        must('convert', name, '-o', path('out.sol'))
        p, t, f, c = converted(path('out' + extension), '--q', path('out.sol'))
        f = dict(zip(fields, f.values()))
        return compare((points, tets, fields, {'medit:ref': cells['region']}), (p, t, f, c))
    p, t, f, c = converted(path('out' + extension))
    c.pop('ObjectId', None)
    return compare((points, tets, fields, cells), (p, t, joined(f), c))


def meshio_case(extension, form):
    (points, tets, fields, cells), name = sample()
    must('convert', name, '-o', path('out' + extension))
    got = meshio.read(path('out' + extension), form)
    if not np.array_equal(got.points, points) or not np.array_equal(got.cells_dict['tetra'], tets):
        return 'mesh'
    if form == 'medit':
        return None if np.array_equal(got.cell_data['medit:ref'][0], cells['region']) else 'references'
    wrong = [n for n in ('heat', 'wind') if n in got.point_data and not np.array_equal(got.point_data[n], fields[n])]
    wrong += [n for n in cells if form != 'exodus' and not np.array_equal(np.ravel(got.cell_data[n][0]), cells[n])]
    return wrong or None


def vtkhdf_case():
    (points, tets, fields, cells), name = sample()
    must('convert', name, '-o', path('out.vtkhdf'))
    reader = vtk.vtkHDFReader()
    reader.SetFileName(path('out.vtkhdf'))
    reader.Update()
    grid = reader.GetOutput()
    got = (vtk_to_numpy(grid.GetPoints().GetData()),
           vtk_to_numpy(grid.GetCells().GetConnectivityArray()).reshape(-1, 4),
           arrays_of(grid.GetPointData()), arrays_of(grid.GetCellData()))
    return compare((points, tets, fields, cells), got)


def exodus_case():
    (points, tets, fields, cells), name = sample()
    must('convert', name, '-o', path('out.e'))
    reader = vtk.vtkExodusIIReader()
    reader.SetFileName(path('out.e'))
    reader.UpdateInformation()
    reader.SetAllArrayStatus(vtk.vtkExodusIIReader.NODAL, 1)
    reader.SetAllArrayStatus(vtk.vtkExodusIIReader.ELEM_BLOCK, 1)
    reader.Update()
    grid = reader.GetOutput().GetBlock(0).GetBlock(0)
    order = vtk_to_numpy(grid.GetCells().GetConnectivityArray()).reshape(-1, 4)  # VTK numbers points as they are used
    if not np.allclose(vtk_to_numpy(grid.GetPoints().GetData())[order], points[tets], atol=1e-7):
        return 'mesh'
    f = arrays_of(grid.GetPointData())
    return None if np.array_equal(f['heat'][order], fields['heat'][tets]) and np.array_equal(
        arrays_of(grid.GetCellData())['load'], cells['load']) else 'values'


def gmsh_program_case():
    """Gmsh itself reads what is written and writes it again, in all versions that it has."""
    (points, tets, fields, cells), name = sample()
    must('convert', name, '-o', path('out.msh'))
    for version, binary in ('msh22', 0), ('msh22', 1), ('msh40', 0), ('msh41', 0), ('msh41',
                                                                                    1):  # Gmsh writes 4.0 as text only
        subprocess.run(['gmsh', path('out.msh'), '-0', '-save_all', '-bin' if binary else '-nopopup', '-format',
                        version, '-o',
                        path('again.msh')], check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        p, t, f, c = converted(path('again.msh'))
        if not np.allclose(p, points, atol=1e-14) or len(t) != len(tets):
            return '%s: mesh' % version
    return None


def gmsh_groups_case(version, order, binary, more=()):
    """Two boxes of Gmsh, a physical group each, of the first or second order."""
    write(
        'in.geo',
        'SetFactory("OpenCASCADE"); Box(1) = {0,0,0,1,1,1}; Box(2) = {1,0,0,1,1,1}; Coherence; Physical Volume("a",7) = {1};'
        'Physical Volume("b",9) = {2};\nMesh.MeshSizeMax = 0.4;\n')
    done = subprocess.run(['gmsh', path('in.geo'), '-3', '-order', str(order), '-format', version, '-o', path('in.msh')]
                          + (['-bin'] if binary else []) + list(more), stdout=subprocess.PIPE, stderr=subprocess.STDOUT)
    if done.returncode:
        return done.stdout[-500:]
    p, t, f, c = converted(path('in.msh'), *(['--subdivide'] if order == 2 else []))
    v = np.abs(volumes(p, t))
    ids = c['gmsh:physical']
    return None if set(ids) == {7, 9} and np.isclose(v[ids == 7].sum(), 1) and np.isclose(v[ids == 9].sum(),
                                                                                          1) else 'volumes'


def gmsh_data_case(version, binary):
    points, tets, fields, cells = tet_mesh(80)
    mesh = meshio.Mesh(points, [('tetra', tets)], point_data={'heat': fields['heat']},
                       cell_data={n: [v.astype(float)] for n, v in cells.items()})
    meshio.gmsh.write(path('in.msh'), mesh, fmt_version=version, binary=binary)
    return compare((points, tets, {'heat': fields['heat']}, cells), converted(path('in.msh')), binary)


def surface_case(extension):
    (points, tets, fields, cells), name = sample(np.float32)
    must('convert', name, '-o', path('out' + extension))
    reader = vtk.vtkXMLPolyDataReader() if extension == '.vtp' else vtk.vtkGLTFReader()
    reader.SetFileName(path('out' + extension))
    reader.Update()
    surface = reader.GetOutput()
    while not surface.IsA('vtkPolyData'):
        surface = surface.GetBlock(0)
    p = vtk_to_numpy(surface.GetPoints().GetData())
    triangles = vtk_to_numpy(surface.GetPolys().GetConnectivityArray()).reshape(-1, 3)
    q = p.astype(float)[triangles]
    volume = np.einsum('ij,ij->i', q[:, 0], np.cross(q[:, 1], q[:, 2])).sum() / 6
    if not np.isclose(volume, volumes(points, tets).sum(), rtol=1e-5):
        return 'volume %g' % volume
    at = {tuple(a): h for a, h in zip(points, fields['heat'])}
    if extension == '.vtp':
        return None if all(at[tuple(a)] == h
                           for a, h in zip(p, arrays_of(surface.GetPointData())['heat'])) else 'values'
    blob = open(path('out.glb'), 'rb').read()
    size = struct.unpack_from('<I', blob, 12)[0]
    scene = json.loads(blob[20:20 + size])
    attribute = next(name for name, field in scene['meshes'][0]['extras']['fields'].items() if field == 'heat')
    view = scene['bufferViews'][scene['accessors'][scene['meshes'][0]['primitives'][0]['attributes'][attribute]]
                                ['bufferView']]
    heat = np.frombuffer(blob, '<f4', view['byteLength'] // 4, 28 + size + view['byteOffset'])
    good = struct.unpack_from('<4sII', blob) == (b'glTF', 2, len(blob)) and all(np.float32(at[tuple(a)]) == h
                                                                                for a, h in zip(p, heat))
    return None if good else 'values'


def huge_case():
    """Coordinates beyond float32 are no numbers of JSON."""
    points, tets, fields, cells = tet_mesh(20)
    meshio.write(path('in.vtu'), meshio.Mesh(points.astype(float) * 1e39, [('tetra', tets)]))
    done = tetlod('convert', path('in.vtu'), '-o', path('huge.glb'))
    return None if done.returncode == 1 and b'.vtp' in done.stderr and not os.path.exists(path('huge.glb')) else done


def abaqus_case():
    points, tets, fields, cells = tet_mesh(60)
    meshio.write(path('in.inp'), meshio.Mesh(points, [('tetra', tets), ('triangle', tets[:3, :3])]))
    return compare((points, tets, {}, {}), converted(path('in.inp')))


def calculix_case():
    """Numbers in no order, sets, comments, an element over several lines."""
    write('in.inp', '''** made by hand
*HEADING
a plate
*NODE, NSET=all
 11, 0, 0, 0
 12, 1, 0, 0
 13, 1, 1., 0
 14, 0, 1, 0
 5, 0, 0, 1
 6, 1, 0, 1
 7, 1, 1, 1
 8, 0, 1, 1
 90, .5, .5, 2
*ELEMENT, TYPE=C3D8R, ELSET=Steel
 1, 11, 12, 13, 14,
 5, 6, 7, 8
*Element, type=C3D5, elset=Air
 2, 5, 6, 7, 8, 90
*ELEMENT, TYPE=S4
 3, 5, 6, 7, 8
*MATERIAL, NAME=X
*ELASTIC
 1e9, 0.3
''')
    p, t, f, c = converted(path('in.inp'))
    v = volumes(p, t)
    return None if np.allclose(np.bincount(c['region'].astype(int), v), [0, 1, 1 / 3]) and len(t) == 8 else (v, c)


def abaqus_parts_case():
    """Two parts, the second one turned and shifted in the assembly, its elements in a file that is included; then one
    of them twice."""
    points, tets, _, _ = tet_mesh(30)
    rows = lambda values, start: ''.join('%d, %s\n' % (i + 1, ', '.join(map(repr, v.tolist())))
                                         for i, v in enumerate(values + start))
    os.makedirs(path('more'), exist_ok=True)
    write('more/tets.inc', '*ELEMENT, TYPE=C3D4\n' + rows(tets, 1))
    write('nodes.inc', rows(points, 0.0))
    text = '*HEADING\nx\n*PART, NAME=Wheel\n*NODE\n%s*ELEMENT, TYPE=C3D4\n%s*END PART\n*PART, NAME=Empty\n*END PART\n*PART, NAME=Axle\n' \
           '*NODE, INPUT=nodes.inc\n*INCLUDE, INPUT=more/tets.inc\n*END PART\n*ASSEMBLY, NAME=A\n*INSTANCE, NAME=a, PART=Wheel\n*END INSTANCE\n' \
           '*INSTANCE, NAME=b, PART=%s\n 10., 0., 0.\n 1., 0., 0., 1., 0., 2., 90.\n*END INSTANCE\n*END ASSEMBLY\n'
    p, t, f, c = converted(write('in.inp', text % (rows(points, 0.0), rows(tets, 1), 'Axle')))
    turned = np.stack([1 - points[:, 1], points[:, 0] + 9, points[:, 2]], axis=1)
    wrong = compare((np.concatenate([points, turned]), np.concatenate([tets, tets + len(points)]), {},
                     {'region': np.repeat([1, 3], len(tets))}),
                    (p, t, f, c), False)
    done = tetlod('convert', write('in.inp', text % (rows(points, 0.0), rows(tets, 1), 'Wheel')), '-o', path('out.vtu'))
    return wrong or (None if done.returncode == 3 and 'only one instance' in done.stderr.decode() else done)


def plot3d_file(grids, big, markers, count, blank, double):
    """Grids (points [k, j, i, 3], blanks) and their solutions (5 columns) as bytes."""
    i4, real = '>i4' if big else '<i4', ('>f8' if big else '<f8') if double else ('>f4' if big else '<f4')
    record = lambda data: (np.array(len(data), i4).tobytes() + data + np.array(len(data),
                                                                               i4).tobytes()) if markers else data
    head = (record(np.array(len(grids), i4).tobytes()) if count else b'') + record(
        b''.join(np.array(g.shape[2::-1], i4).tobytes() for g, _, _ in grids))
    xyz = (head + b''.join(
        record(g.reshape(-1, 3).T.astype(real).tobytes() + (b.astype(i4).tobytes() if blank else b''))
        for g, b, _ in grids))
    q = head + b''.join(record(np.zeros(4, real).tobytes()) + record(s.astype(real).tobytes()) for _, _, s in grids)
    return xyz, q


def plot3d_case(big, markers, count, blank, double):
    random = np.random.default_rng(2)
    k, j, i = np.meshgrid(np.arange(3.0), np.arange(4.0), np.arange(5.0), indexing='ij')
    grids = []
    for n in range(2 if count else 1):
        points = np.stack([i + 4 * n, j, k], axis=-1)
        mask = np.ones((3, 4, 5), int)
        if blank and n == 0:
            mask[0, 0, 0] = 0
        solution = np.stack([1 + points[..., 0].ravel() * 0.01] + [points[..., d].ravel() for d in range(3)] +
                            [points.sum(axis=-1).ravel() + 9])
        grids.append((points, mask, solution))
    xyz, q = plot3d_file(grids, big, markers, count, blank, double)
    p, t, f, c = converted(write('in.xyz', xyz), '--q', write('in.q', q))
    wanted = 24 * len(grids) - (1 if blank else 0)
    points = 60 * len(grids) - (12 if count else 0) - (1 if blank else 0)
    if len(p) != points or not np.isclose(np.abs(volumes(p, t)).sum(), wanted):
        return '%d points, volume %g' % (len(p), np.abs(volumes(p, t)).sum())
    return None if np.allclose(f['Density'], 1 + p[:, 0] * 0.01) and np.allclose(f['Momentum'], p) else 'values'


def main():
    for extension in '.vtu', '.vtk', '.vtkhdf', '.xdmf', '.msh', '.e', '.mesh', '.meshb':
        name = {'.e': 'exodus', '.msh': 'gmsh', '.mesh': 'medit'}.get(extension, extension[1:])
        for precision in np.float64, np.float32:
            if BUILT[name]:
                case('%s and back, %s' % (name, np.dtype(precision)), round_trip_case, extension,
                     np.float64 if extension == '.msh' else precision)
    for extension, form in (('.xdmf', 'xdmf'), ('.msh', 'gmsh'), ('.mesh', 'medit'), ('.meshb', 'medit'),
                            ('.vtk', 'vtk')):
        case('meshio reads %s' % extension, meshio_case, extension, form)
    if BUILT['vtkhdf']:
        case('VTK reads .vtkhdf', vtkhdf_case)
    if BUILT['exodus']:
        case('VTK reads .e', exodus_case)
    case('Gmsh reads .msh and writes it', gmsh_program_case)
    for version in 'msh22', 'msh40', 'msh41':
        for order in 1, 2:
            for binary in (False, True)[:1 if version == 'msh40' else 2]:  # Gmsh writes 4.0 as text only
                case('groups of %s of order %d%s' % (version, order, ', binary' if binary else ''), gmsh_groups_case,
                     version, order, binary)
    for version in '2.2', '4.1':  # meshio counts the cells of 4.0 from 0 and their data from 1
        for binary in False, True:
            case('element data of %s%s' % (version, ', binary' if binary else ''), gmsh_data_case, version, binary)
    for extension in '.vtp', '.glb':
        case('the surface as %s' % extension, surface_case, extension)
    case('coordinates beyond float32 as .glb', huge_case)
    case('abaqus by meshio', abaqus_case)
    case('calculix by hand', calculix_case)
    case('abaqus: parts, instances, files that are named', abaqus_parts_case)
    for binary in False, True:
        case('groups of msh41 in partitions%s' % (', binary' if binary else ''), gmsh_groups_case, 'msh41', 1, binary,
             ['-part', '3', '-part_ghosts', '-part_topo'])
    for trial in range(32):
        how = [bool(trial >> bit & 1) for bit in range(5)]
        case('plot3d: big %d, markers %d, multi-grid %d, iblank %d, double %d' % tuple(how), plot3d_case, *how)
    finish()


if __name__ == '__main__':
    main()
