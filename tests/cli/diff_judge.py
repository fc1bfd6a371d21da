# SPDX-License-Identifier: BSD-3-Clause
"""Pairs of results with known differences, for tetlod diff: what is true of them, worked out without the program."""
import itertools

import numpy as np
from kuhn_grid import kuhn


class Pair:
    """Two meshes with a field each: (points, tets, values), and the largest difference and its square's integral."""

    def __init__(self, first, second, largest, square, volume):
        self.meshes, self.largest, self.rms = (first, second), largest, (square / volume) ** 0.5


def smooth(points, random):
    """Some field that no mesh here holds exactly."""
    k = random.uniform(2, 6, (3, 3))
    return sum(np.sin(points @ k[i] + i) for i in range(3)) + np.tanh(8 * (points @ k[0] / 6 - 0.7))


def volumes_of(points, tets):
    corners = points[tets]
    return np.abs(np.linalg.det(corners[:, 1:] - corners[:, :1])) / 6


def split(points, tets, values):
    """Each tetrahedron split at a point inside it: the same function on another mesh."""
    middles = points[tets].mean(axis=1)
    number = len(points) + np.arange(len(tets))
    parts = [np.column_stack([tets[:, a], tets[:, b], tets[:, c], number]) for a, b, c in
             ((0, 1, 2), (0, 3, 1), (0, 2, 3), (1, 3, 2))]
    fine = np.concatenate(parts)
    corners = np.concatenate([points, middles])[fine]
    turned = np.linalg.det(corners[:, 1:] - corners[:, :1]) < 0
    fine[turned] = fine[turned][:, [0, 1, 3, 2]]
    return np.concatenate([points, middles]), fine, np.concatenate([values, values[tets].mean(axis=1)])


def hat(random, base=None):
    """The same function but for a hat of known height over the star of one vertex."""
    if base is None:
        points, tets = kuhn(random.integers(3, 6), random)
        base = points, tets, smooth(points, random)
    fine = split(*base) if random.random() < 0.7 else [a.copy() for a in base]
    height = float(np.ptp(base[2]) * 10 ** random.uniform(-2.5, -0.3)) * random.choice([-1, 1])
    top = int(random.integers(len(fine[0])))
    order = random.permutation(len(fine[0]))  # the vertices of the second mesh have other numbers
    back = np.argsort(order)
    star = (fine[1] == top).any(axis=1)
    volumes = volumes_of(fine[0], fine[1])
    values = fine[2].copy()
    values[top] += height
    second = fine[0][order], back[fine[1]][random.permutation(len(fine[1]))], values[order]
    pair = Pair(base, second, abs(height), (volumes[star] * height ** 2 / 10).sum(), volumes.sum())
    pair.support = volumes[star].sum()
    return pair


def linear(random):
    """Two linear functions on meshes that have nothing in common but the cube."""
    meshes = [kuhn(n, random) for n in random.permutation([3, 4, 5])[:2]]
    slopes, start = random.uniform(-1, 1, (2, 3)), random.uniform(-1, 1, 2)
    sides = [(p, t, p @ slopes[m] + start[m]) for m, (p, t) in enumerate(meshes)]
    slope, at = slopes[0] - slopes[1], start[0] - start[1]
    corners = np.array(list(itertools.product((0, 1), repeat=3)))
    square = (slope ** 2).sum() / 12 + (at + slope.sum() / 2) ** 2
    return Pair(*sides, np.abs(corners @ slope + at).max(), square, 1)


def weights(points, tets, places):
    """[tets, places, 4] of places in tetrahedra."""
    corners = points[tets]
    inverse = np.linalg.inv((corners[:, 1:] - corners[:, :1]).transpose(0, 2, 1))
    rest = np.einsum('tij,tpj->tpi', inverse, places[None] - corners[:, None, 0])
    return np.concatenate([1 - rest.sum(axis=2, keepdims=True), rest], axis=2)


def unrelated(random):
    """Functions on meshes that have nothing in common: the largest difference is at a corner of the overlay, the
    square's integral is that of the tetrahedra of its cells."""
    sides = []
    for n in (2, 3):
        points, tets = kuhn(n, random)
        sides.append((points, tets, smooth(points, np.random.default_rng(7)) * random.uniform(0.9, 1.1)))
    largest, square = overlay(sides)
    return Pair(*sides, largest, square, 1)


def overlay(sides):
    (points, tets, values), (other_points, other_tets, other_values) = sides
    here = weights(points, tets, other_points)
    largest, square = 0, 0
    for t, tet in enumerate(tets):
        inside = here[t][other_tets]  # [other tets, 4 corners, 4 weights]
        for o in np.where((inside.max(axis=1) > 1e-12).all(axis=1))[0]:
            differences = inside[o] @ values[tet] - other_values[other_tets[o]]
            volume = np.abs(np.linalg.det(other_points[other_tets[o]][1:] - other_points[other_tets[o]][:1])) / 6
            for piece in clipped([np.eye(4)], inside[o]):
                d = piece @ differences
                square += volume * abs(np.linalg.det(piece)) * ((d ** 2).sum() + d.sum() ** 2) / 20
                largest = max(largest, np.abs(d).max()) if abs(np.linalg.det(piece)) > 1e-14 else largest
    return largest, square


def clipped(pieces, inside):
    """Tetrahedra by the weights of their corners, cut to where all four functions are positive."""
    for k in range(4):
        cut = []
        for piece in pieces:
            f = piece @ inside[:, k]
            order = np.argsort(-f)
            piece, f = piece[order], f[order]
            count = int((f > 0).sum())
            between = lambda i, j: piece[i] + f[i] / (f[i] - f[j]) * (piece[j] - piece[i])  # noqa: E731
            if count == 4:
                cut.append(piece)
            elif count == 1:
                cut.append(np.array([piece[0], *(between(0, j) for j in (1, 2, 3))]))
            elif count in (2, 3):
                if count == 3:
                    p, q = [piece[0], piece[1], piece[2]], [between(i, 3) for i in range(3)]
                else:
                    p, q = [piece[0], between(0, 2), between(0, 3)], [piece[1], between(1, 2), between(1, 3)]
                cut += [np.array([p[0], p[1], p[2], q[0]]), np.array([p[1], p[2], q[0], q[1]]),
                        np.array([p[2], q[0], q[1], q[2]])]
        pieces = cut
    return pieces
