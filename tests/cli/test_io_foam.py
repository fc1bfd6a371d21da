#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""OpenFOAM cases, text, binary and packed, as OpenFOAM lays them out; VTK's reader reads the same from them."""
import gzip
import os
import shutil

import numpy as np
import vtk
from vtk.util.numpy_support import vtk_to_numpy

import mpi_job
from common import CONFIG, case, fails, finish, must, path, report, tetlod, write
from meshes import arrays_of, compare, converted, read, volumes
from test_io_vtkxml import other_cells

POINTS = other_cells(())[1]
CELLS = [([0, 1, 2, 3, 4, 5, 6, 7],
          [[0, 3, 2, 1], [4, 5, 6, 7], [0, 1, 5, 4], [1, 2, 6, 5], [2, 3, 7, 6], [3, 0, 4, 7]]),
         ([1, 8, 2, 5, 9, 6], [[0, 2, 1], [3, 4, 5], [0, 1, 4, 3], [1, 2, 5, 4], [2, 0, 3, 5]]),
         ([4, 5, 6, 7, 10], [[0, 3, 2, 1], [0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4]]),
         ([5, 11, 6, 10], [[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]])]


def mesh(split):
    """Faces (those of two cells first), owners, neighbours. `split`: the pyramid's base has a point more, in the middle
    of an edge, so that two cells become polyhedra."""
    points, faces = POINTS.tolist(), {}
    if split:
        points.append([0.5, 0, 1])
    for number, (corners, sides) in enumerate(CELLS):
        for side in sides:
            face = [corners[i] for i in side]
            if split:
                for i in range(len(face)):
                    if {face[i], face[(i + 1) % len(face)]} == {4, 5}:
                        face.insert(i + 1, 12)
                        break
            key = tuple(sorted(face))
            faces.setdefault(key, [face, []])[1].append(number)
    listed = sorted(faces.values(), key=lambda f: (len(f[1]) == 1, f[1]))
    return np.array(points), [f[0] for f in listed], [f[1][0]
                                                      for f in listed], [f[1][1] for f in listed if len(f[1]) > 1]


WIDTHS = {'label': 32, 'scalar': 64}  # bits of the numbers of binary files


def put(name, kind, content, binary, packed):
    head = 'FoamFile\n{\n version 2.0;\n format %s;\n class %s;\n arch "LSB;label=%d;scalar=%d";\n object %s;\n}\n// * * //\n\n' % (
        'binary' if binary else 'ascii', kind, WIDTHS['label'], WIDTHS['scalar'], os.path.basename(name))
    data = head.encode() + (content if isinstance(content, bytes) else content.encode()) + b'\n\n// **** //\n'
    os.makedirs(os.path.dirname(path(name)), exist_ok=True)
    with (gzip.open(path(name + '.gz'), 'wb', 1) if packed else open(path(name), 'wb')) as file:
        file.write(data)


def list_of(values, binary):
    values = np.asarray(values)
    if binary:
        kind = '<f%d' % (WIDTHS['scalar'] // 8) if values.dtype.kind == 'f' else '<i%d' % (WIDTHS['label'] // 8)
        return b'%d\n(' % len(values) + values.astype(kind).tobytes() + b')'
    row = (lambda v: '(%s)' % ' '.join(map(repr, v.tolist()))) if values.ndim > 1 else (lambda v: repr(v.item()))
    return ('%d\n(\n%s\n)' % (len(values), '\n'.join(row(v) for v in values))).encode()


def write_case(split, binary, packed):
    shutil.rmtree(path('case'), ignore_errors=True)
    points, faces, owner, neighbour = mesh(split)
    put('case/constant/polyMesh/points', 'vectorField', list_of(points, binary), binary, packed)
    if binary:
        ends = np.cumsum([0] + [len(f) for f in faces])
        put('case/constant/polyMesh/faces', 'faceCompactList',
            list_of(ends, True) + b'\n' + list_of(sum(faces, []), True), True, packed)
    else:
        put('case/constant/polyMesh/faces', 'faceList', '%d\n(\n%s\n)' % (len(faces), '\n'.join(
            '%d(%s)' % (len(f), ' '.join(map(str, f))) for f in faces)), False, packed)
    put('case/constant/polyMesh/owner', 'labelList', list_of(owner, binary), binary, packed)
    put('case/constant/polyMesh/neighbour', 'labelList', list_of(neighbour, binary), binary, packed)
    put('case/constant/polyMesh/boundary', 'polyBoundaryMesh',
        '1\n(\nwalls { type wall; nFaces %d; startFace %d; }\n)' % (
        len(faces) - len(neighbour), len(neighbour)), False, packed)
    for step, time in enumerate(('0', '0.5', '10')):
        p, u = np.arange(4.0) + step, np.arange(12.0).reshape(4, 3) * (step + 1)
        field = lambda values, what: b'dimensions [0 2 -2 0 0 0 0];\n\ninternalField nonuniform List<%s> ' % what + list_of(
            values, binary) + b'\n;\n\nboundaryField\n{\n walls { type zeroGradient; }\n}\n'
        put('case/%s/p' % time, 'volScalarField', field(p, b'scalar'), binary, packed)
        put('case/%s/U' % time, 'volVectorField', field(u, b'vector'), binary, packed)
        put('case/%s/T' % time, 'volScalarField',
            'dimensions [0 0 0 1 0 0 0];\ninternalField uniform 300;\nboundaryField\n{\n walls\n'
            '{ type zeroGradient; }\n}\n', binary, packed)
        put('case/%s/phi' % time, 'surfaceScalarField',
            'dimensions [0 3 -1 0 0 0 0];\ninternalField uniform 0;\nboundaryField {}\n',
            binary, packed)
    put('case/system/controlDict', 'dictionary',
        'application x; startTime 0; deltaT 0.5; writeInterval 1; writeControl timeStep;', False, False)
    write('case/case.foam', '')


def foam_case(split, binary, packed):
    write_case(split, binary, packed)
    points = mesh(split)[0]
    p, t, f, c = converted(path('case/case.foam'))
    v = volumes(p, t)
    wanted = np.array([1, 0.5, 1 / 3, 1 / 6])
    ids = (c['p'] - 2).astype(int)
    if (v <= 0).any() or not np.allclose(np.bincount(ids, v), wanted):
        return 'volumes %s' % np.bincount(ids, v)
    if len(p) != len(points) + (3 if split else 0):  # the hexahedron, the pyramid and what they share
        if len(p) - len(points) != 2:
            return '%d points' % len(p)
    if not np.array_equal(c['U'], np.arange(12.0).reshape(4, 3)[ids] * 3) or not (c['T'] == 300).all() or 'phi' in c:
        return 'values'
    first = converted(path('case/case.foam'), '--time', '0')[3]
    if sorted(set(first['p'])) != [0, 1, 2, 3]:
        return 'time'
    reader = vtk.vtkOpenFOAMReader()
    reader.SetFileName(path('case/case.foam'))
    reader.UpdateInformation()
    reader.EnableAllCellArrays()
    reader.CreateCellToPointOff()
    reader.UpdateTimeStep(10)
    grid = reader.GetOutput().GetBlock(0)
    return None if np.array_equal(vtk_to_numpy(grid.GetCellData().GetArray('p')),
                                  np.arange(4.0) + 2) else 'VTK reads other values'


TETRAHEDRON = [[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]]  # faces, seen from outside
HEXAHEDRON = CELLS[0][1]


def foam_files(points, cells, sides, binary, packed):
    """An OpenFOAM case; its faces, those of two cells first."""
    faces = cells[:, sides].reshape(-1, len(sides[0]))
    owner = np.repeat(np.arange(len(cells)), len(sides))
    corners = np.sort(faces, axis=1)[:, :3].astype(np.uint64)
    order = np.argsort((corners[:, 0] << np.uint64(42)) + (corners[:, 1] << np.uint64(21)) + corners[:, 2],
                       kind='stable')
    same = np.append((corners[order[1:]] == corners[order[:-1]]).all(axis=1), False)
    first = np.flatnonzero(~np.append(False, same[:-1]))
    inner, outer = first[same[first]], first[~same[first]]
    listed = order[np.concatenate([inner, outer])]
    folder = 'case%d%d%d/' % (len(sides), binary, packed)
    put(folder + 'constant/polyMesh/points', 'vectorField', list_of(points, binary), binary, packed)
    if binary:
        ends = np.arange(len(listed) + 1) * faces.shape[1]
        put(folder + 'constant/polyMesh/faces', 'faceCompactList',
            list_of(ends, True) + list_of(faces[listed].ravel(), True), True, packed)
    else:
        row = '3(%d %d %d)\n' if len(sides[0]) == 3 else '4(%d %d %d %d)\n'
        text = '%d\n(\n%s)' % (len(listed), row * len(listed) % tuple(faces[listed].ravel().tolist()))
        put(folder + 'constant/polyMesh/faces', 'faceList', text, False, packed)
    put(folder + 'constant/polyMesh/owner', 'labelList', list_of(owner[listed], binary), binary, packed)
    put(folder + 'constant/polyMesh/neighbour', 'labelList', list_of(owner[order[inner + 1]], binary), binary, packed)
    field = (b'dimensions [0 0 0 1 0 0 0]; internalField nonuniform List<scalar> ' +
             list_of(np.arange(len(cells)) / 7, binary) + b';')
    put(folder + '1/T', 'volScalarField', field, binary, packed)
    write(folder + 'case.foam', '')
    return [folder + 'case.foam']


def large_case():
    """Files longer than what is unpacked at once, whole and in two gzip members: the same mesh as from binary ones."""
    must('sample', 'cube', '--size', '14', '-o', 'in.vtu')
    points, tets = read('in.vtu')[:2]
    name = lambda binary, packed: path(foam_files(points, tets.astype(np.int64), TETRAHEDRON, binary, packed)[0])
    wanted, packed = converted(name(True, False)), name(False, True)
    got = compare(wanted, converted(packed)) or compare(wanted, converted(name(False, False)))
    faces = path(os.path.dirname(packed) + '/constant/polyMesh/faces.gz')
    text = gzip.open(faces).read()
    with open(faces, 'wb') as file:
        file.write(gzip.compress(text[:100001]) + gzip.compress(text[100001:]))
    if got or len(text) < 500000 or len(wanted[1]) != len(tets) or not np.allclose(volumes(*wanted[:2]).sum(),
                                                                                   volumes(points, tets).sum()):
        return got or 'mesh'
    return compare(wanted, converted(packed))


def parted_cube():
    """Points, tetrahedra, and which of three parts each of these is in; the folder of the parts is empty."""
    must('sample', 'cube', '--size', '5', '-o', 'in.vtu')
    points, tets = read('in.vtu')[:2]
    tets = tets.astype(np.int64)
    part_of = np.digitize(points[tets].mean(axis=1)[:, 0], [1.3, 3.1])
    shutil.rmtree(path('parts'), ignore_errors=True)
    os.makedirs(path('parts'))
    return points, tets, part_of


def decomposed_case():
    """A mesh in a folder for each processor, which meet in the same points, and may know their numbers; a whole mesh of
    earlier results beside them is not read, one of later results is."""
    points, tets, part_of = parted_cube()
    for part in range(3):
        used, corners = np.unique(tets[part_of == part], return_inverse=True)
        made = foam_files(points[used], corners.reshape(-1, 4), TETRAHEDRON, bool(part % 2), False)[0]
        shutil.move(path(os.path.dirname(made)), path('parts/processor%d' % part))
        os.remove(path('parts/processor%d/case.foam' % part)) # there is none in a piece's folder
    write('parts/case.foam', '')
    p, t, f, c = converted(path('parts/case.foam'))
    wanted = np.concatenate([np.arange((part_of == part).sum()) / 7 for part in range(3)])
    if len(p) != len(points) or not np.allclose(np.sort(volumes(p, t)), np.sort(volumes(points, tets))):
        return len(p), len(points)
    if not np.array_equal(c['T'], wanted):
        return 'values'
    for part in range(3):
        mine = np.flatnonzero(part_of == part)
        folder = 'parts/processor%d/constant/polyMesh/' % part
        put(folder + 'pointProcAddressing', 'labelList', list_of(np.unique(tets[mine]), bool(part % 2)), bool(part % 2),
            False)
        put(folder + 'cellProcAddressing', 'labelList', list_of(mine, bool(part % 2)), bool(part % 2), False)
    p, t, f, c = converted(path('parts/case.foam'))
    wanted = wanted[np.argsort(np.concatenate([np.flatnonzero(part_of == part) for part in range(3)]))]
    if not np.array_equal(p, points) or not np.array_equal(np.sort(t, axis=1), np.sort(tets, axis=1)) or \
            not np.array_equal(c['T'], wanted):
        return 'with numbers: another order than the whole'
    ranks = None if mpi_job.missing() else mpi_job.same((2,), [path('parts/case.foam')], '--paged=100')
    if ranks:
        return ranks
    whole = os.path.dirname(foam_files(points, tets, TETRAHEDRON, False, False)[0])
    shutil.move(path(whole + '/constant'), path('parts/constant'))
    shutil.move(path(whole + '/1'), path('parts/0'))
    if not np.array_equal(converted(path('parts/case.foam'))[3]['T'], wanted):
        return 'earlier results were read'
    shutil.move(path('parts/0'), path('parts/2'))
    if not np.array_equal(converted(path('parts/case.foam'))[3]['T'], np.arange(len(tets)) / 7):
        return 'later results were not read'
    shutil.rmtree(path('parts/2'))
    os.remove(path('parts/processor1/constant/polyMesh/owner'))
    done = tetlod('convert', path('parts/case.foam'), '-o', path('out.vtu'))
    return None if done.returncode == 3 and b'processor1: ' in done.stderr and b'owner' in done.stderr else done


def collate(name, pieces, folder, packed):
    """The files of pieces as one, with the bytes of each, of which the first has a header for all."""
    blocks = [open(path('parts/processor%d/%s' % (piece, name)), 'rb').read() for piece in pieces]
    blocks[1:] = [block[block.index(b'}\n') + 2:] for block in blocks[1:]]
    put('parts/%s/%s' % (folder, name), 'decomposedBlockData', b''.join(
        b'// Processor%d\n\n%d\n(%s)\n\n' % (piece, len(block), block) for piece, block in zip(pieces, blocks)), True,
        packed)


def collated_case(binary, packed, folders):
    """Pieces in the folders of several programs, each of which has written those of some."""
    points, tets, part_of = parted_cube()
    for part in range(3):
        mine = np.flatnonzero(part_of == part)
        used, corners = np.unique(tets[mine], return_inverse=True)
        made = foam_files(points[used], corners.reshape(-1, 4), TETRAHEDRON, binary, False)[0]
        for name, numbers in ('pointProcAddressing', used), ('cellProcAddressing', mine):
            name = '%s/constant/polyMesh/%s' % (os.path.dirname(made), name)
            put(name, 'labelList', list_of(numbers, binary), binary, False)
        shutil.move(path(os.path.dirname(made)), path('parts/processor%d' % part))
    write('parts/case.foam', '')
    wanted = converted(path('parts/case.foam'))
    files = [os.path.relpath(os.path.join(folder, name), path('parts/processor0'))
             for folder, _, names in os.walk(path('parts/processor0')) for name in names if name != 'case.foam']
    for name in files:
        for folder, pieces in folders.items():
            collate(name, pieces, folder, packed)
    for part in range(3):
        shutil.rmtree(path('parts/processor%d' % part))
    found = converted(path('parts/case.foam'))
    if not all(np.array_equal(a, b) for a, b in zip((*found[:2], found[3]['T']), (*wanted[:2], wanted[3]['T']))):
        return 'another mesh'
    last = 'parts/' + max(folders)
    write(last + '/one.foam', '')
    done = tetlod('convert', path(last + '/one.foam'), '-o', path('out.vtu'))
    if done.returncode != 3 or b'several pieces' not in done.stderr:
        return done
    name = path(last + '/constant/polyMesh/points' + ('.gz' if packed else ''))
    data = (gzip.open if packed else open)(name, 'rb').read()
    (gzip.open if packed else open)(name, 'wb').write(data[:len(data) // 2])
    done = tetlod('convert', path('parts/case.foam'), '-o', path('out.vtu'))
    if done.returncode != 3 or done.stderr.count(b'\n') != 1 or b'points' not in done.stderr:
        return done
    shutil.rmtree(path(last))
    done = tetlod('convert', path('parts/case.foam'), '-o', path('out.vtu'))
    return None if done.returncode == 3 and (len(folders) == 1 or b'processors3_A-B' in done.stderr) else done


def damaged_gzip_case():
    """What is behind the values is looked at, too: it is where the check sum is."""
    foam_case(False, False, True)
    name = path('case/10/p.gz')
    with open(name, 'rb') as file:
        data = file.read()
    for bad in data[:-6], data[:-6] + bytes([data[-6] ^ 1]) + data[-5:], data[:40]:
        write('case/10/p.gz', bad)
        done = tetlod('convert', path('case/case.foam'), '-o', path('out.vtu'))
        if done.returncode != 3 or b'gzip data is damaged' not in done.stderr:
            return done
    return None


def odd_tetrahedra_case():
    """Four faces of three points that are no tetrahedron: the cell becomes a polyhedron, all others stay what they are.
    """
    write_case(False, False, False)
    points, faces, owner, neighbour = mesh(False)
    last = [i for i, cell in enumerate(owner) if cell == 3] + [i for i, cell in enumerate(neighbour) if cell == 3]
    faces[last[-2]] = faces[last[-1]]
    put('case/constant/polyMesh/faces', 'faceList', '%d\n(\n%s\n)' % (len(faces), '\n'.join(
        '%d(%s)' % (len(f), ' '.join(map(str, f))) for f in faces)), False, False)
    p, t, f, c = converted(path('case/case.foam'))
    kept = np.bincount((c['p'] - 2).astype(int), volumes(p, t))[:3]
    return None if np.allclose(kept, [1, 0.5, 1 / 3]) else kept


def damaged_cases(binary):
    random, bad = np.random.default_rng(4), []
    names = ['constant/polyMesh/' + n for n in ('points', 'faces', 'owner', 'neighbour')] + ['10/p', '10/U']
    for n in range(24 if CONFIG == 'release' else 12):
        write_case(False, binary, False)
        name = path('case/' + names[n % len(names)])
        data = bytearray(open(name, 'rb').read())
        if n % 2:
            data = data[:random.integers(len(data))]
        else:
            for at in random.integers(0, len(data), 3):
                data[at] = random.integers(256)
        open(name, 'wb').write(bytes(data))
        done = tetlod('convert', path('case/case.foam'), '-o', path('out.vtu'), timeout=600)
        if done.returncode not in (0, 3) or (done.returncode == 3 and done.stderr.count(b'\n') != 1):
            bad.append(done)
    report('damaged %s cases end in one line or a mesh' % ('binary' if binary else 'text'), not bad, bad[:2])


def main():
    for split in False, True:
        for binary in False, True:
            for packed in False, True:
                case('openfoam%s, %s%s' % (' with polyhedra' if split else '', 'binary' if binary else 'text',
                                           ', packed' if packed else ''),
                     foam_case, split, binary, packed)
    for WIDTHS['label'], WIDTHS['scalar'] in (64, 64), (32, 32), (32, 64):
        case('openfoam, binary, labels of %(label)d bits, scalars of %(scalar)d' % WIDTHS, foam_case, True, True, False)
    case('longer files', large_case)
    case('a decomposed case', decomposed_case)
    case('a collated case', collated_case, False, False, {'processors3': range(3)})
    case('a collated case of two programs, binary, packed', collated_case, True, True,
         {'processors3_0-1': range(2), 'processors3_2-2': [2]})
    case('damaged gzip', damaged_gzip_case)
    case('four triangles that are no tetrahedron', odd_tetrahedra_case)
    damaged_cases(False)
    damaged_cases(True)
    os.remove(path('case/constant/polyMesh/owner'))
    fails('a file that is missing', 3, ['case.foam', 'owner'], 'convert', path('case/case.foam'), '-o', path('out.vtu'))
    finish()


if __name__ == '__main__':
    main()
