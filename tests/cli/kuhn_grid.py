# SPDX-License-Identifier: BSD-3-Clause
"""A mesh that fills a cube."""
import itertools

import numpy as np


def kuhn(n, random):
    """A cube of n^3 cells of six tetrahedra; points inside are moved a little."""
    grid = np.array(list(itertools.product(range(n + 1), repeat=3)), float)
    inner = ((grid > 0) & (grid < n)).all(axis=1)
    grid[inner] += random.uniform(-0.2, 0.2, (inner.sum(), 3))
    tets = []
    for cell in itertools.product(range(n), repeat=3):
        for axes in itertools.permutations(range(3)):
            at, corners = list(cell), [tuple(cell)]
            for axis in axes:
                at[axis] += 1
                corners.append(tuple(at))
            tets.append([(x * (n + 1) + y) * (n + 1) + z for x, y, z in corners])
    tets = np.array(tets)
    corners = grid[tets]
    turned = np.linalg.det(corners[:, 1:] - corners[:, :1]) < 0
    tets[turned] = tets[turned][:, [0, 1, 3, 2]]
    return grid / n, tets
