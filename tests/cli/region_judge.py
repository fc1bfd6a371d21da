# SPDX-License-Identifier: BSD-3-Clause
"""An independent judge of meshes that are finer in boxes: arrays from legacy VTK files, geometry by numpy and, where it
is close, by fractions."""
import re
from fractions import Fraction

import numpy as np

FACES = np.array([[1, 2, 3], [0, 3, 2], [0, 1, 3], [0, 2, 1]])
COARSE, FINE, TRANSITION = 0, 1, 2


def read_vtk(path):
    """Points, tetrahedra, point fields and cell fields by name."""
    with open(path, 'rb') as file:
        data = file.read()
    at = [0]

    def line():
        end = data.index(b'\n', at[0])
        text, at[0] = data[at[0]:end].decode(), end + 1
        return text

    def array(kind, count):
        form = np.dtype({'float': '>f4', 'double': '>f8', 'int': '>i4', 'vtktypeint64': '>i8'}[kind])
        values = np.frombuffer(data, form, count, at[0])
        at[0] += form.itemsize * count
        assert data[at[0]:at[0] + 1] == b'\n'
        at[0] += 1
        return values

    mesh = {'point': {}, 'cell': {}}
    where = None
    while at[0] < len(data):
        words = line().split()
        if not words:
            continue
        if words[0] == 'POINTS':
            mesh['points'] = array(words[2], 3 * int(words[1])).reshape(-1, 3).astype(float)
        elif words[0] == 'CELLS':
            mesh['tets'] = array('int', int(words[2])).reshape(-1, 5)[:, 1:].astype(np.int64)
        elif words[0] == 'CELL_TYPES':
            array('int', int(words[1]))
        elif words[0] in ('POINT_DATA', 'CELL_DATA'):
            where = mesh['point' if words[0] == 'POINT_DATA' else 'cell']
        elif len(words) == 4 and re.fullmatch(r'\d+', words[1]):
            where[words[0]] = array(words[3], int(words[1]) * int(words[2])).reshape(-1, int(words[1])).astype(float)
    return mesh


def volumes(mesh):
    p = mesh['points'][mesh['tets']]
    return np.linalg.det(p[:, 1:] - p[:, :1]) / 6


def exact_sign(corners):
    a, b, c = ([Fraction(float(corners[i][k])) - Fraction(float(corners[0][k])) for k in range(3)] for i in (1, 2, 3))
    det = a[0] * (b[1] * c[2] - b[2] * c[1]) - a[1] * (b[0] * c[2] - b[2] * c[0]) + a[2] * (b[0] * c[1] - b[1] * c[0])
    return (det > 0) - (det < 0)


def inverted(mesh):
    """Numbers of the tetrahedra whose volume is not positive, exactly."""
    volume = volumes(mesh)
    close = np.nonzero(volume < 1e-9 * np.abs(volume).max())[0]
    return [t for t in close if exact_sign(mesh['points'][mesh['tets'][t]]) <= 0]


def crowded_faces(mesh):
    """How many faces have more than two tetrahedra."""
    faces = np.sort(mesh['tets'][:, FACES].reshape(-1, 3), axis=1)
    return int((np.unique(faces, axis=0, return_counts=True)[1] > 2).sum())


def keys(mesh, chosen=slice(None)):
    """Each tetrahedron as what is at its corners: positions and values."""
    if 'keys' not in mesh:
        rows = np.hstack([mesh['points']] + [mesh['point'][name] for name in sorted(mesh['point'])])
        corners = np.array([hash(row.tobytes()) for row in rows])
        mesh['keys'] = np.array([tuple(key) for key in np.sort(corners[mesh['tets']], axis=1).tolist()],
                                dtype='i8,i8,i8,i8')
    return set(mesh['keys'][chosen].tolist())


def holders(mesh, points):
    """For each point a tetrahedron that holds it well inside, or -1."""
    corners = mesh['points'][mesh['tets']]
    low, high = corners.min(1), corners.max(1)
    found = np.full(len(points), -1)
    for i, p in enumerate(points):
        for t in np.nonzero(((low <= p) & (p <= high)).all(1))[0]:
            edges = (corners[t, 1:] - corners[t, 0]).T
            try:
                weights = np.linalg.solve(edges, p - corners[t, 0])
            except np.linalg.LinAlgError:
                continue
            if weights.min() > 1e-6 and weights.sum() < 1 - 1e-6:
                found[i] = t
    return found


def value_at(mesh, tet, p, name):
    corners = mesh['points'][mesh['tets'][tet]]
    weights = np.linalg.solve((corners[1:] - corners[0]).T, p - corners[0])
    return np.append(1 - weights.sum(), weights) @ mesh['point'][name][mesh['tets'][tet]]


def judge(answer, coarse, fine, boxes, seed, domain_moves):
    """Raises AssertionError with what is wrong."""
    region = answer['cell']['Region'][:, 0]
    assert set(region) <= {COARSE, FINE, TRANSITION}
    assert not inverted(answer), ('inverted', len(inverted(answer)))
    assert crowded_faces(answer) == 0
    assert keys(answer, region == COARSE) <= keys(coarse), 'a tetrahedron of the coarse level is not one of it'
    assert keys(answer, region == FINE) <= keys(fine), 'a tetrahedron of the fine level is not one of it'
    if not domain_moves:
        assert abs(volumes(answer).sum() / volumes(fine).sum() - 1) < 1e-9, (volumes(answer).sum(), volumes(fine).sum())
    random = np.random.default_rng(seed)
    have = keys(answer)
    for low, high in boxes:
        inside = ((fine['points'] >= low) & (fine['points'] <= high)).all(1)
        touching = inside[fine['tets']].any(1)
        points = low + random.random((200, 3)) * (np.array(high) - low)
        there = holders(fine, points)
        assert keys(fine, touching) <= have, 'a fine tetrahedron with a corner in the box is missing'
        assert keys(fine, there[there >= 0]) <= have, 'a fine tetrahedron that meets the box is missing'
        ours = holders(answer, points)
        assert (not set(region[ours[ours >= 0]]) & {COARSE, TRANSITION}
                or keys(answer, ours[ours >= 0]) <= keys(fine)), 'what meets the box is not fine'
    return {part: int((region == part).sum()) for part in (COARSE, FINE, TRANSITION)}
