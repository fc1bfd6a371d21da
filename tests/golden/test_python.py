#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""The Python decoder against the golden streams: every level, up and down, has the arrays that the hashes say."""
import glob
import hashlib
import os
import sys

import numpy as np

ROOT = os.environ.get('ROOT', '.')
sys.path.insert(0, os.path.join(ROOT, 'client-examples', 'python'))
import tetlod  # noqa: E402


def state(stream, cursor):
    sha = hashlib.sha256(np.ascontiguousarray(cursor.positions, '<f8').tobytes())
    sha.update(np.ascontiguousarray(cursor.tets, '<u4').tobytes())
    for field in stream.fields:
        sha.update(np.ascontiguousarray(cursor.field(field['name']), '<f8').tobytes())
    return sha.hexdigest()


def check(path):
    wanted = open(path + '.levels').read().split()
    stream = tetlod.open(path)
    cursor = stream.cursor()
    up = [state(stream, cursor.seek(k)) for k in range(len(stream.levels))]
    down = [state(stream, cursor.seek(k)) for k in reversed(range(len(stream.levels)))]
    records = 0
    while cursor.refine():
        records += 1
    again = state(stream, cursor)
    while cursor.coarsen():
        records -= 1
    return up == wanted and down[::-1] == wanted and again == wanted[-1] and records == 0 and \
        state(stream, cursor) == wanted[0]


def damage(path):
    """A changed byte is an error, wherever it is."""
    data = bytearray(open(path, 'rb').read())
    found = 0
    places = range(0, len(data), 7)
    for i in places:
        data[i] ^= 16
        try:
            stream = tetlod.open(bytes(data))
            stream.cursor().seek(len(stream.levels) - 1)
        except tetlod.StreamError:
            found += 1
        data[i] ^= 16
    return found == len(places)


number = 0
for path in sorted(glob.glob(os.path.join(ROOT, 'tests', 'golden', '*.tetlod'))):
    number += 1
    print('%s %d - Python agrees on %s' % ('ok' if check(path) else 'not ok', number, os.path.basename(path)))
print('%s %d - Python notices damage' % ('ok' if damage(os.path.join(ROOT, 'tests/golden/one_tet.tetlod')) else 'not ok',
                                         number + 1))
