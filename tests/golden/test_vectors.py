#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""The invalid streams are refused, by both decoders and where verdicts.txt says; no changed byte keeps a content id; a
small file cannot ask for much memory."""
import os
import random
import resource
import struct
import subprocess
import tracemalloc

from streams import crafted, plain, sealed, still_steps, tetlod
from tap import finish, report

ROOT = os.environ.get('ROOT', '.')
GOLDEN = os.path.join(ROOT, 'tests', 'golden')
SCRATCH = os.environ.get('SCRATCH', '.')


def command(verb, path):
    return subprocess.run([os.environ['TETLOD'], verb, path, *(['--quiet'] if verb == 'verify' else ['--json'])],
                          stdout=subprocess.PIPE,
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
        stream.original_cells()
        for field in stream.cell_fields:
            stream.cells(field['name'])
        for level in range(len(stream.levels)):
            for part in range(len(stream.fields) + 1):
                stream.frame(level, part)
        if levels is not None:
            stream.cursor().seek(len(stream.levels) - 1)
            some = {level: set(range(group.count)) for level, group in stream.groups.items()}
            if some:
                stream.cursor().seek_pages(some)
        for band in range(len(series.bands) if series else 0):
            for step in range(len(series.times)):
                series.seek(band, step)
        for field in stream.cell_fields if series else []:
            for step in range(len(series.times)):
                series.cells(field['name'], step)
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
    report('%d bytes that ask for 128 GB are refused' % len(data), done.returncode == 3 and
           b'than their bytes can hold' in done.stderr, done.stderr)
    if os.environ.get('CONFIG', 'release') == 'release':
        report('in less than 64 MB', peak < 64, '%d MB' % peak)


def limits():
    """What a limit of SPEC 2.3 is about, streams at it and beyond it, and words of what is said about the latter."""
    data, packed, values = read(
        'grid_float32.tetlod'), b'\1\0\0' + bytes(97), b'levels of more than their bytes can hold'
    index = [
        sealed(data[:24] + struct.pack('<I', (1 << 16) + 3 * int.from_bytes(data[20:24], 'little') + over) + data[28:])
        for over in (0, 1)
    ]
    yield 'the packed index', *index, b'contradicts itself'
    for what, tag, size in (('a packed section', b'XABC', 6400), ('a packed table', b'TIME', 65836)):
        yield what, *(crafted([(8, 1, 20, 8)], 1, [(tag, 4, packed, size + over)])
                      for over in (0, 1)), b'impossible size of section'
    yield 'many packed sections', *(crafted([(8, 1, 20, 8)], 1,
                                            [(b'XABC', 4, b'\1\0\0' + bytes(9997),
                                              640000 + over)] * 20) for over in (0, 1)), b'impossible size of section'
    yield 'vertices', *(crafted([(5024 + over, 1, 1000, 2000)]) for over in (0, 1)), values
    yield 'values', *(crafted([(5024, 1, 1000, 80128 - over)], 64) for over in (0, 1)), values
    yield 'levels', *(crafted([(40000 + k, 1, 9744 if k == 0 else 1, 0) for k in range(count)], 0)
                      for count in (104, 330)), b'more levels than go with'
    tables = [still_steps(1024 + over) for over in (0, 1)]
    yield 'steps', *(crafted([(4095, 1, 768, 768)], 1,
                             [(b'TIME', 0, table, len(table)),
                              (b'TVAL', 0, b'', 0)]) for table in tables), b'more steps than their bytes'


def check_limit(what, data, words, refused):
    """Both decoders say what they should, in memory and time that go with the file."""
    path = os.path.join(SCRATCH, 'limit.tetlod')
    with open(path, 'wb') as file:
        file.write(data)
    process = subprocess.Popen([os.environ['TETLOD'], 'verify', '--quiet', path], stdout=subprocess.DEVNULL,
                               stderr=subprocess.PIPE)
    said = process.stderr.read()
    _, status, used = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    try:
        tetlod.open(data).series()
        accepted = True
    except tetlod.StreamError:
        accepted = False
    good = (words in said) == refused and not (refused and (process.returncode != 3 or accepted))
    report('%s %s' % (what, 'beyond the limit' if refused else 'at the limit'), good,
           (process.returncode, said, accepted))
    if os.environ.get('CONFIG', 'release') == 'release':
        megabytes = len(data) / 1e6
        enough = used.ru_maxrss / 1024 <= 64 + 64 * megabytes and used.ru_utime + used.ru_stime <= 2 * (1 + megabytes)
        report('%s: in memory and time that go with %d bytes' % (what, len(data)), enough, used)


def check_limits():
    for what, at, beyond, words in limits():
        check_limit(what, at, words, False)
        check_limit(what, beyond, words, True)


def seek_finest(data, memory=None):
    """A cursor at the finest level; None where the budget refuses it."""
    try:
        stream = tetlod.open(data, memory)
        return stream.cursor().seek(len(stream.levels) - 1)
    except tetlod.StreamError as problem:
        return None if 'more memory than is allowed' in str(problem) else problem


def check_budget():
    """The reference decoder's memory stays within what is allowed: what takes more is refused, and room comes back."""
    for name in 'grid_float32', 'paged_float32', 'tail_float64':
        data, allowed = read(name + '.tetlod'), 64 << 20
        tracemalloc.start()
        cursor = seek_finest(data)
        traced = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        taken = allowed + 2048 * len(data) - cursor.stream.budget.left
        report('%s: what is taken is what is counted, about' % name, 0.8 * traced < taken < 5 * traced, (traced, taken))
        report('less is refused', seek_finest(data, taken) and not seek_finest(data, taken - 1), taken)
    data = read('grid_float32.tetlod')
    stream = tetlod.open(data)
    left = stream.budget.left
    cursors = [stream.cursor().seek(1) for _ in range(3)]
    report('cursors share the budget', stream.budget.left < left - 3 * cursors[0].taken + 1, stream.budget.left)
    del cursors
    report('and give it back', stream.budget.left == left, (stream.budget.left, left))
    sizes = [tetlod.Budget(size, None).left for size in (0, 1000, 1 << 40)]
    report('it goes with the bytes', sizes == [64 << 20, (64 << 20) + 2048000, 16 << 30], sizes)
    report('and is no more than asked for', tetlod.Budget(1 << 30, 1 << 20).left == 1 << 20)


def check_invalid():
    with open(os.path.join(GOLDEN, 'invalid', 'verdicts.txt')) as file:
        verdicts = [line.split(' ', 2) for line in file]
    report('there are invalid streams', len(verdicts) > 20)
    for name, when, why in verdicts:
        path = os.path.join(GOLDEN, 'invalid', name + '.tetlod')
        data = read(os.path.join('invalid', name + '.tetlod'))
        shown, verified = command('info', path), command('verify', path)
        good = (verified.returncode == 3 and (shown.returncode == 3) == (when == 'open')
                and opens(data) == (when == 'decode') and decode(data, True) is None)
        report('refused, %s: %s' % (when, why.strip()), good, (shown.returncode, verified.returncode, verified.stderr))


def check_exact_band():
    """A band of error 0 below the finest level is refused as such: the original order counts more vertices than it has.
    """
    path = os.path.join(ROOT, 'tests', 'fuzz', 'corpus', 'reader', 'exact_band_below_the_original')
    said = command('verify', path).stderr
    try:
        tetlod.open(read(path)).series()
        problem = 'accepted'
    except tetlod.StreamError as refusal:
        problem = str(refusal)
    report('an exact band below the finest level', b'table of steps does not go with the stream' in said and
           'an exact band below the finest level' in problem, (said, problem))


def check_forged():
    """10,000 changed streams: none decodes under the content id of what it was made from, as it is or with its checks
    renewed."""
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


for check in check_bomb, check_limits, check_budget, check_invalid, check_exact_band, check_forged:
    if os.environ.get('ONLY', '') in check.__name__:
        check()
finish()
