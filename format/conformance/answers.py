# SPDX-License-Identifier: 0BSD
"""Digests as README.md defines them: the first 16 hexadecimal digits of a SHA-256."""
import hashlib

import numpy as np


def digest(arrays, form='<f8'):
    sha = hashlib.sha256()
    for array in arrays:
        sha.update(np.ascontiguousarray(array, form).tobytes())
    return sha.hexdigest()[:16]


def ball(low, high):
    """Its middle and its radius."""
    return [*((3 * a + b) / 4 for a, b in zip(low, high)), 0.3 * max(b - a for a, b in zip(low, high))]


def of_pages(points, corners, fields, levels, numbers):
    """Of some of the pages; also of which level each tetrahedron is, and its number with all pages."""
    return [*level(points, corners, fields), digest([levels], '<u4'), digest([numbers], '<u4')]


def level(points, corners, fields):
    return [digest([points]), digest([corners], '<u4'), digest(fields)]
