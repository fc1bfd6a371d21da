# SPDX-License-Identifier: 0BSD
"""Digests as README.md defines them: the first 16 hexadecimal digits of a SHA-256."""
import hashlib

import numpy as np


def digest(arrays, form='<f8'):
    sha = hashlib.sha256()
    for array in arrays:
        sha.update(np.ascontiguousarray(array, form).tobytes())
    return sha.hexdigest()[:16]


def level(points, corners, fields):
    return [digest([points]), digest([corners], '<u4'), digest(fields)]
