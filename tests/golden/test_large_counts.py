#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""Streams of up to 2^40 vertices and tetrahedra (SPEC 2.3): their coarse levels are there for every decoder; a level
that a decoder cannot hold is refused before room is made for it."""
import glob
import os
import resource
import struct
import subprocess
import sys
import warnings

import numpy as np

from streams import sealed, tetlod as reference
from tap import finish, report

ROOT, TETLOD, SCRATCH = os.environ.get('ROOT', '.'), os.environ['TETLOD'], os.environ['SCRATCH']
os.environ['TETLOD_LIBRARY'] = glob.glob(os.path.join(ROOT, 'build', 'release', 'libtetlod.so.*'))[0]
import tetlod  # noqa: E402

SMALL = open(os.path.join(ROOT, 'format', 'conformance', 'valid', 'profile_0.tetlod'), 'rb').read()
ROW = 48 + 56  # of a level with one field


def grown(vertices, tets):
    """The stream with a second level of so many, whose bytes are not there: a file that is cut off."""
    end = 64 + int.from_bytes(SMALL[20:24], 'little')
    index = bytearray(SMALL[64:end])
    row = len(index) - 4 - 48 - ROW  # of level 0, before the directory of one section
    frame = (max(vertices, tets) + 3) // 4
    further = struct.pack('<QQd4dQ16sQ16s', vertices, tets, 0, *[0.0] * 4, frame, b'', frame, b'')
    index[row + ROW:row + ROW] = further
    index[0:20] = struct.pack('<QQI', vertices, tets, 2)
    head = struct.pack('<II', len(index), len(index))
    total = int.from_bytes(SMALL[32:40], 'little') + ROW + 2 * frame
    rest = struct.pack('<Q', total) + SMALL[40:64] + index + SMALL[end:]
    return sealed(SMALL[:20] + head + SMALL[28:32] + rest), total


def refused(function, *words):
    try:
        function()
    except (ValueError, OSError, MemoryError) as problem:
        return all(word in str(problem) for word in words) or repr(problem)
    return 'taken'


def command(*arguments):
    done = subprocess.run([TETLOD, *arguments], stdin=subprocess.DEVNULL, stdout=subprocess.PIPE,
                          stderr=subprocess.PIPE, cwd=SCRATCH, text=True)
    return done.returncode, done.stdout, done.stderr


def check(name, vertices, tets):
    data, total = grown(vertices, tets)
    path = os.path.join(SCRATCH, name + '.tetlod')
    with open(path, 'wb') as file:
        file.write(data)
    small = tetlod.read(SMALL, decoder='python')
    for decoder in ('library', 'python'):
        stream = tetlod.open(path, decoder=decoder)
        counts = [(level.vertices, level.tets) for level in stream.levels]
        report('%s: the %s counts' % (name, decoder), counts == [(4, 1), (vertices, tets)], counts)
        mesh = stream.seek(level=0).mesh
        report('%s: the %s has the coarse level' % (name, decoder), np.array_equal(mesh.points, small.points) and
               np.array_equal(mesh.fields['T'], small.fields['T']))
    status, printed, said = command('info', path)
    report('%s: info counts' % name, status == 0 and str(tets) in printed and str(vertices) in printed, (printed, said))
    for level, wanted in ((0, 0), (1, 3)):
        status, _, said = command('extract', path, '--level', str(level), '-o', 'out.vtu')
        report('%s: extract of level %d' % (name, level), status == wanted and said.count('\n') <= 2, (status, said))

    def fetch(offset, size):  # all of it is there: zeros
        have = data[offset:offset + size]
        return have + bytes(min(size, max(total - offset, 0)) - len(have)) if size < 1 << 24 else b''

    stream = tetlod.open(fetch, decoder='library')
    found = refused(lambda: stream.seek(level=1), 'level 1', str(tets), '1073741824')
    report('%s: a level that is there, and too large' % name, found is True, found)


def main():
    warnings.simplefilter('ignore')  # the files are cut off on purpose
    for name, vertices, tets in (('vertices', 1 << 33, 1 << 20), ('tetrahedra', 5, 1 << 33),
                                 ('both', 1 << 40, 1 << 40), ('just_too_large', 5, (1 << 30) + 1)):
        check(name, vertices, tets)
    most = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    report('without memory for it', most < 400 << 10, most)
    for name, counts in (('vertices', ((1 << 40) + 1, 1)), ('tetrahedra', (5, (1 << 40) + 1))):
        data, _ = grown(*counts)
        for decoder in ('library', 'python'):
            found = refused(lambda decoder=decoder: tetlod.open(data, decoder=decoder))
            report('more than 2^40 %s: refused by the %s' % (name, decoder), found is True, found)
        found = refused(lambda: reference.open(data))
        report('more than 2^40 %s: refused by the reference' % name, found is True, found)
    return finish()


sys.exit(main())
