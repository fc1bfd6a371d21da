#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""The invalid streams are refused, by both decoders and where verdicts.txt says; no changed byte keeps a content id; a small file cannot
ask for much memory."""
import os
import random
import resource
import struct
import subprocess

from streams import plain, sealed, tetlod
from tap import finish, report

ROOT = os.environ.get('ROOT', '.')
GOLDEN = os.path.join(ROOT, 'tests', 'golden')
SCRATCH = os.environ.get('SCRATCH', '.')


def command(verb, path):
    return subprocess.run([os.environ['TETLOD'], verb, path, *(['--quiet'] if verb == 'verify' else ['--json'])], stdout=subprocess.PIPE,
                          stderr=subprocess.PIPE)


def read(name):
    with open(os.path.join(GOLDEN, name), 'rb') as file:
        return file.read()


def decode(data, levels=None):
    """Everything that the index promises, with Python; None if it is refused."""
    try:
        stream = tetlod.open(data)
        for section in stream.sections:
            stream.section(section['tag'])
        series = stream.series() if levels is not None else None
        for field in stream.cell_fields:
            stream.cells(field['name'])
        for level in range(len(stream.levels)):
            for part in range(len(stream.fields) + 1):
                stream.frame(level, part)
        if levels is not None:
            stream.cursor().seek(len(stream.levels) - 1)
        for band in range(len(series.bands) if series else 0):
            for step in range(len(series.times)):
                series.seek(band, step)
        for topology in range(1, len(stream.topologies) if levels is not None else 0):
            stream.topology(topology).series()
        return stream.cid
    except (tetlod.StreamError, IndexError, KeyError):
        return None


def opens(data):
    try:
        return bool(tetlod.open(data))
    except tetlod.StreamError:
        return False


def bomb():
    """No bytes in any frame, and 256 fields of 64 components at a million vertices are asked for."""
    vertices, fields = 1 << 20, b''
    for f in range(256):
        fields += struct.pack('<BBBBddH', 1, 0, 64, 0, 0.0, 1.0, 4) + b'f%03d' % f
    index = struct.pack('<QQIHBB6dQQQBB', vertices, 1, 1, 256, 6, 0, *[0.0] * 3, *[1.0] * 3, 0, 0, 0, 1, 0) + fields
    index += struct.pack('<QQd', vertices, 1, 0.0) + struct.pack('<4d', 0, 0, 0, 0) * 256
    index += struct.pack('<Q16s', 0, tetlod.digest(b'')) * 257 + struct.pack('<I', 0)
    header = tetlod.MAGIC + struct.pack('<HHIIIIIQ', 2, 0, 0, 0, len(index), len(index), 0, 64 + len(index))
    return sealed(header + bytes(24) + index)


def check_bomb():
    path = os.path.join(SCRATCH, 'bomb.tetlod')
    data = bomb()
    with open(path, 'wb') as file:
        file.write(data)
    done = command('verify', path)
    peak = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss // 1024
    report('%d bytes that ask for 128 GB are refused' % len(data), done.returncode == 3 and b'than their bytes can hold' in done.stderr, done.stderr)
    if os.environ.get('CONFIG', 'release') == 'release':
        report('in less than 64 MB', peak < 64, '%d MB' % peak)


def check_invalid():
    with open(os.path.join(GOLDEN, 'invalid', 'verdicts.txt')) as file:
        verdicts = [line.split(' ', 2) for line in file]
    report('there are invalid streams', len(verdicts) > 20)
    for name, when, why in verdicts:
        path = os.path.join(GOLDEN, 'invalid', name + '.tetlod')
        data = read(os.path.join('invalid', name + '.tetlod'))
        shown, verified = command('info', path), command('verify', path)
        good = verified.returncode == 3 and (shown.returncode == 3) == (when == 'open') and opens(data) == (when == 'decode') and decode(data, True) is None
        report('refused, %s: %s' % (when, why.strip()), good, (shown.returncode, verified.returncode, verified.stderr))


def check_forged():
    """10,000 changed streams: none decodes under the content id of what it was made from, as it is or with its checks renewed."""
    dice, kept, tried = random.Random(12), [], 0
    for name in ('one_tet', 'grid_float32', 'kept_order'):
        data = read(name + '.tetlod')
        cid = tetlod.open(data).cid
        for variant in (data, plain(data)):
            own = tetlod.open(variant).cid
            for i in range(1700):
                changed = bytearray(variant)
                for _ in range(dice.choice((1, 1, 2, 4))):
                    changed[dice.randrange(len(changed))] ^= 1 << dice.randrange(8)
                if bytes(changed) == variant:
                    continue
                tried += 1
                forged = bytes(changed) if i % 2 else sealed(changed)
                if forged != variant and decode(forged) in (cid, own):
                    kept.append((name, i))
    report('of %d forged streams none keeps its content id' % tried, tried > 10000 and not kept, kept[:5])


check_bomb()
check_invalid()
check_forged()
finish()
