#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""MFEM meshes and grid functions laid out by hand, as Mesh::Print and GridFunction::Save write them."""
import numpy as np

from common import case, CONFIG, damage, fails, finish, must, path, report, survived, tetlod, write
from meshes import compare_split, converted
from test_io_vtkxml import other_cells

POINTS = other_cells(())[1]
TETS = [[5, 11, 6, 10]]
ELEMENTS = [(5, [0, 1, 2, 3, 4, 5, 6, 7]), (6, [1, 2, 8, 5, 6, 9]), (7, [4, 5, 6, 7, 10]), (4, [5, 11, 6, 10])]
VOLUMES = [1, 1 / 2, 1 / 3, 1 / 6]


def values(rows, ordering):
    """Rows of values: all first components first (0), or row by row (1)."""
    rows = np.atleast_2d(rows)
    return '\n'.join(repr(float(v)) for v in (rows if ordering else rows.T).ravel())


def space(collection, width, ordering):
    return 'FiniteElementSpace\nFiniteElementCollection: %s\nVDim: %d\nOrdering: %d\n\n' % (collection, width, ordering)


def mesh(head='MFEM mesh v1.0', nodes=None, ordering=1, more=''):
    text = head + '\n\n'
    text += '#\n# MFEM Geometry Types (see mesh/geom.hpp):\n#\n# POINT       = 0\n#\n\ndimension\n3\n\n'
    text += 'elements\n%d\n' % len(ELEMENTS)
    text += ''.join('%d %d %s\n' % (number % 2 + 1, kind, ' '.join(map(str, corners)))
                    for number, (kind, corners) in enumerate(ELEMENTS))
    text += '\nboundary\n2\n1 3 0 1 2 3\n1 2 5 11 6\n\nvertices\n%d\n' % len(POINTS)
    if nodes:  # those of edges, faces and elements follow those of vertices
        text += '\nnodes\n' + space(nodes, 3, ordering) + values(np.vstack([POINTS, np.full((7, 3), 99.0)]),
                                                                 ordering) + '\n'
    else:
        text += '3\n' + '\n'.join(' '.join(map(repr, map(float, p))) for p in POINTS) + '\n'
    return write('in.mesh', text + more)


def mesh_case(*how):
    name = mesh(*how)
    ids = np.arange(len(ELEMENTS))
    write('id.gf', space('L2_3D_P0', 1, 0) + values(ids[:, None], 0))
    got = converted(name, '--q', path('id.gf'))
    problem = compare_split(POINTS, {'id': None}, {'id': ids, 'mfem:attribute': ids % 2 + 1}, VOLUMES,
                            (got[0], got[1], {'id': None}, got[3]))
    return problem if problem and 'field id' not in problem else None


def function_case(collection, width, ordering):
    rows = np.arange(len(POINTS))[:, None] + 100.0 * np.arange(width)
    extra = np.full((5 if collection[-1] != '1' else 0, width), -1.0)
    write('wind.gf', space(collection, width, ordering) + values(np.vstack([rows, extra]), ordering) + '\n')
    _, _, f, c = converted(mesh(), '--q', path('wind.gf'))
    if sorted(f) != ['wind'] or sorted(c) != ['mfem:attribute']:
        return '%s %s' % (sorted(f), sorted(c))
    return None if np.array_equal(f['wind'].reshape(rows.shape), rows) else '%s' % f['wind']


def build_case():
    write('heat.gf', space('H1_3D_P1', 1, 0) + values(POINTS @ [[1.0], [2], [3]], 0))
    must('build', mesh(), '--q', path('heat.gf'), '--field', 'heat', '-o', path('out.tetlod'))
    must('verify', path('out.tetlod'), '--against', path('in.mesh'), '--q', path('heat.gf'))


def refused(name, words, *arguments):
    fails(name, 3, words, 'convert', *arguments, '-o', path('out.vtu'))


def damaged():
    random, bad = np.random.default_rng(8), []
    for n in range(40 if CONFIG == 'release' else 16):
        mesh('MFEM mesh v1.0', 'H1_3D_P2')
        write('wind.gf', space('H1_3D_P1', 3, 0) + values(np.zeros((len(POINTS), 3)), 0))
        name = path(['in.mesh', 'wind.gf'][n % 2])
        damage(name, n, random)
        done = tetlod('convert', path('in.mesh'), '--q', path('wind.gf'), '-o', path('out.vtu'), timeout=600)
        if not survived(done):
            bad.append(done)
    report('damaged files end in one line or a mesh', not bad, bad[:2])


def main():
    case('hexahedron, wedge, pyramid, tetrahedron', mesh_case)
    case('version 1.2 of several processes', mesh_case, 'MFEM mesh v1.2', None, 1,
         'mfem_serial_mesh_end\n\ncommunication_groups\nnumber_of_groups 1\n')
    for collection in 'H1_3D_P1', 'H1_3D_P3', 'Quadratic', 'H1Pos_3D_P2':
        for ordering in 0, 1:
            case('nodes of %s, ordering %d' % (collection, ordering), mesh_case, 'MFEM mesh v1.1', collection,
                 ordering, 'mfem_mesh_end\n')
    for collection, width in ('H1_3D_P1', 1), ('H1_3D_P1', 3), ('H1_3D_P2', 3), ('Linear', 1):
        for ordering in 0, 1:
            case('%d values of %s, ordering %d' % (width, collection, ordering), function_case, collection, width,
                 ordering)
    case('build and verify', build_case)
    said = must('convert', mesh('MFEM mesh v1.0', 'H1_3D_P2'), '-o', path('out.vtu')).stderr.decode()
    report('cells of higher order are counted', '4 cells of higher order taken by their corners' in said, said)
    for kind in 'NURBS', 'NC', 'INLINE':
        refused('%s is refused by name' % kind, ['in.mesh', "'%s'" % kind, 'PrintVTU'],
                mesh('MFEM %s mesh v1.0' % kind))
    refused('hanging vertices', ['hanging', 'PrintVTU'],
            mesh('MFEM mesh v1.1', None, 1, 'vertex_parents\n1\n3 1 2\nmfem_mesh_end\n'))
    refused('discontinuous nodes', ["'L2_T1_3D_P2'", 'SetCurvature'], mesh('MFEM mesh v1.0', 'L2_T1_3D_P2'))
    write('flux.gf', space('RT_3D_P0', 1, 0) + '1\n')
    refused('a space that has no values at vertices', ['flux.gf', "'RT_3D_P0'", 'project'], mesh(), '--q',
            path('flux.gf'))
    write('flux.gf', space('H1_3D_P1', 1, 0) + '1\n2\n')
    refused('too few values', ['flux.gf', 'truncated'], mesh(), '--q', path('flux.gf'))
    refused('a plane mesh', ['dimension should be 3'], write('in.mesh', 'MFEM mesh v1.0\n\ndimension\n2\n'))
    damaged()
    finish()


main()
