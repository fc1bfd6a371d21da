#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""Regions: at every level the interface of two materials is the original's, conforming, each region has its volume, and
no tetrahedron is in the wrong one."""
import json

import numpy as np

from cell_meshes import block, cells_of, points_of, save, tets_of, volumes
from common import SANITIZED, case, finish, must, path, read_grid, tetlod

FACES = np.array([(1, 2, 3), (0, 3, 2), (0, 1, 3), (0, 2, 1)])


def ball(size):
    """A ball of material 7 in a cube of material 2: the cube's shells, rounded up to half way."""
    points, tets = block(size)
    points = 2 * points - 1
    shell, length = np.abs(points).max(1), np.linalg.norm(points, axis=1)
    part = np.clip(2 * shell - 1, 0, 1)
    scale = np.where(length > 0, (1 - part) * shell / np.where(length > 0, length, 1) + part, 1)
    inside = shell[tets].max(1) <= 0.5
    return points * scale[:, None], tets, np.where(inside, 7, 2).astype(np.int32)


def waves(size):
    """Two layers that meet at a wave, which reaches the outer boundary; the upper one is bent, too."""
    points, tets = block(size)
    upper = (points[tets][:, :, 2].min(1) >= 0.5).astype(np.int32)
    x, y, z = points.T
    points = np.stack(
        [x, y, z + 0.15 * np.sin(5 * x) * np.cos(4 * y) * np.minimum(1, 2 * (1 - z)) * np.minimum(1, 4 * z)], 1)
    return points, tets, upper


def interface(points, tets, regions):
    """Faces between two regions, as sorted triples of points, and how many faces have more than two tetrahedra."""
    faces = np.sort(tets[:, FACES].reshape(-1, 3), 1)
    owner = np.repeat(regions, 4)
    unique, index, count = np.unique(faces, axis=0, return_inverse=True, return_counts=True)
    index = index.ravel()
    most, least = np.full(len(unique), -10**9), np.full(len(unique), 10**9)
    np.maximum.at(most, index, owner)
    np.minimum.at(least, index, owner)
    found = points[unique[most != least]]
    order = np.lexsort(found.reshape(-1, 9).T)
    return {tuple(sorted(map(tuple, face))) for face in found[order].tolist()}, int((count > 2).sum())


def locate(points, tets, regions):
    """Region of the original at any point, by VTK."""
    import vtk
    save('locate.vtu', points, tets, {}, {'region': regions})
    grid = read_grid('locate.vtu')
    locator = vtk.vtkStaticCellLocator()
    locator.SetDataSet(grid)
    locator.BuildLocator()
    return lambda at: regions[locator.FindCell(at)] if locator.FindCell(at) >= 0 else None


def holds(points, tets, at):
    """Is the point in one of the tetrahedra? For what VTK finds in another one: it allows more where they are flat."""
    corners = points[tets]
    edges = np.moveaxis(corners[:, :3] - corners[:, 3:], 1, 2)
    weights = np.linalg.solve(edges, (at - corners[:, 3])[..., None])[..., 0]
    return bool((np.minimum(weights.min(1), 1 - weights.sum(1)) > -1e-9).any())


def area(faces):
    p = np.array([list(face) for face in faces])
    return 0.5 * np.linalg.norm(np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]), axis=1).sum()


def check_level(name, original, wanted, where, domain_error):
    points, tets, regions = original
    grid = read_grid(name)
    at, corners, found = points_of(grid), tets_of(grid), cells_of(grid)['material']
    faces, crowded = interface(at, corners, found)
    if faces != wanted or crowded:
        return '%s: %d of %d faces of the interface, area %g; %d faces of more than two' % (
            name, len(faces & wanted), len(wanted), area(faces), crowded)
    sizes = np.ptp(points, axis=0)
    skin = 2 * (sizes[0] * sizes[1] + sizes[1] * sizes[2] + sizes[0] *
                sizes[2]) * 1.5 * domain_error * np.linalg.norm(sizes)
    for region in np.unique(regions):
        before, after = volumes(points, tets[regions == region]).sum(), volumes(at, corners[found == region]).sum()
        if abs(before - after) > skin + 1e-9:
            return '%s: region %d has the volume %g, not %g' % (name, region, after, before)
    for tet in range(0, len(corners), max(1, len(corners) // 300)):
        middle = at[corners[tet]].mean(0)
        there = where(middle)
        if there is not None and there != found[tet] and not holds(points, tets[regions == found[tet]], middle):
            return '%s: tetrahedron %d of region %d is in region %d' % (name, tet, found[tet], there)
    return None


def check(make, size, *options):
    points, tets, regions = make(size)
    heat = np.sin(points @ [2.0, 1.0, 0.5])
    save('in.vtu', points, tets, {'heat': heat}, {'material': regions})
    must('build', path('in.vtu'), '-o', path('a.tetlod'), '--quiet', *options)
    must('verify', path('a.tetlod'), '--against', path('in.vtu'), '--quiet')
    info = json.loads(must('info', path('a.tetlod'), '--json').stdout)
    if not info['cell_fields'][0]['region']:
        return 'material is not taken for regions'
    wanted, where, levels = interface(points, tets, regions)[0], locate(points, tets, regions), len(info['levels'])
    if info['levels'][0]['tets'] * 3 > len(tets) and '--domain-error' not in options:
        return 'the base mesh still has %d of %d tetrahedra' % (info['levels'][0]['tets'], len(tets))
    for level in sorted({0, 1, levels // 8, levels // 4, levels // 2, 3 * levels // 4, levels - 1}):
        must('extract', path('a.tetlod'), '--level', str(level), '-o', path('level.vtu'), '--quiet')
        problem = check_level('level.vtu', (points, tets, regions), wanted, where,
                              info['levels'][level]['domain_error'])
        if problem:
            return 'level %d: %s' % (level, problem)
    return None


def without():
    """With --region none the interface is given up: what the tests above look at is not there by itself."""
    points, tets, regions = ball(6 if SANITIZED else 8)
    save('in.vtu', points, tets, {'heat': points[:, 0]}, {'material': regions})
    must('build', path('in.vtu'), '-o', path('a.tetlod'), '--quiet', '--region', 'none')
    must('extract', path('a.tetlod'), '--level', '0', '-o', path('level.vtu'), '--quiet')
    grid = read_grid('level.vtu')
    faces = interface(points_of(grid), tets_of(grid), cells_of(grid)['material'])[0]
    return None if faces != interface(points, tets, regions)[0] else 'the interface is kept all the same'


def named():
    """No name says that these are regions: --region does, or that they have few values. One that is not there, or no
    integers, is refused."""
    points, tets, regions = waves(4 if SANITIZED else 6)
    save('in.vtu', points, tets, {'heat': points[:, 0]}, {'q': regions, 'w': regions * 0.5})
    must('build', path('in.vtu'), '-o', path('a.tetlod'), '--quiet', '--no-region')
    plain = json.loads(must('info', path('a.tetlod'), '--json').stdout)
    must('build', path('in.vtu'), '-o', path('b.tetlod'), '--quiet', '--region', 'q')
    regions = json.loads(must('info', path('b.tetlod'), '--json').stdout)
    refused = [tetlod('build', path('in.vtu'), '-o', path('c.tetlod'), '--region', name) for name in ('w', 'nothing')]
    good = [[f['region'] for f in info['cell_fields']] for info in (plain, regions)] == [[False, False], [True, False]]
    good &= regions['levels'][0]['tets'] > plain['levels'][0]['tets'] and all(b'--region' in done.stderr and
                                                                              done.returncode for done in refused)
    return None if good else [done.stderr for done in refused]


case('a ball in a cube', check, ball, 8 if SANITIZED else 12)
case('two layers that meet at a wave', check, waves, 8 if SANITIZED else 12)
case('the same with a boundary that moves far', check, waves, 8 if SANITIZED else 10, '--domain-error', '0.01')
case('certified exactly', check, ball, 6 if SANITIZED else 8, '--certify', 'exact')
case('edges, faces and tetrahedra', check, waves, 6 if SANITIZED else 8, '--contract', 'hybrid')
case('without regions the interface goes', without)
case('regions by name', named)
finish()
