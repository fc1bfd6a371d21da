#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""The Python decoder against the golden streams: every level, up and down, has the arrays that the hashes say."""
import glob
import hashlib
import os
import subprocess

import numpy as np

from streams import plain, sealed, tetlod
from tap import finish, report

ROOT = os.environ.get('ROOT', '.')


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


def check_cells(path):
    wanted = open(path + '.cells').read().split()
    stream = tetlod.open(path)
    found = [hashlib.sha256(np.ascontiguousarray(stream.cells(field['name']),
                                                 '<f8').tobytes()).hexdigest() for field in stream.cell_fields]
    return found == wanted and len(found) > 3


def check_original(path):
    """The cells that were split: points, types, offsets, corners, values of fields at points."""
    stream = tetlod.open(path)
    cells = stream.original_cells()
    sha = hashlib.sha256(np.ascontiguousarray(cells.points, '<f8').tobytes() + cells.types.astype('u1').tobytes() +
                         cells.offsets.astype('<i8').tobytes() + np.array(cells.connectivity, '<i8').tobytes())
    for field in stream.fields:
        sha.update(np.ascontiguousarray(cells.field(field['name']), '<f8').tobytes())
    return sha.hexdigest() == open(path + '.original').read().strip()


def check_steps(path):
    wanted, found = open(path + '.steps').read().split(), []
    series = tetlod.open(path).series()
    for band in range(len(series.bands)):
        for step in range(len(series.times)):
            sha = hashlib.sha256()
            for values in series.seek(band, step)[1].values():
                sha.update(np.ascontiguousarray(values, '<f8').tobytes())
            if series.displacement:
                sha.update(np.ascontiguousarray(series.points(), '<f8').tobytes())
            found.append(sha.hexdigest())
    return found == wanted and len(found) > 20


def check_cell_steps(path):
    wanted, stream = open(path + '.cell_steps').read().split(), tetlod.open(path)
    series = stream.series()
    names = [field['name'] for field in stream.cell_fields if series.has_cells(field['name'], 1)]
    found = [hashlib.sha256(np.ascontiguousarray(series.cells(name, step), '<f8').tobytes()).hexdigest()
             for name in names for step in range(len(series.times))]
    return found == wanted and len(found) > 20 and series.cells('late', 1) is None


def check_topologies(path):
    """The groups behind the first, each as a stream of its own."""
    stream = tetlod.open(path)
    for number in range(1, len(stream.topologies)):
        part = stream.topology(number)
        name = '%s.%d' % (path, number)
        cursor, series, found = part.cursor(), part.series(), []
        if [state(part, cursor.seek(k)) for k in range(len(part.levels))] != open(name + '.levels').read().split():
            return False
        for band in range(len(series.bands)):
            for step in range(len(series.times)):
                values = series.seek(band, step)[1].values()
                found.append(
                    hashlib.sha256(b''.join(np.ascontiguousarray(v, '<f8').tobytes() for v in values)).hexdigest())
        if found != open(name + '.steps').read().split():
            return False
    return len(stream.topologies) == 3


def damage_steps(path):
    """A changed byte of a late section is an error."""
    data = bytearray(open(path, 'rb').read())
    found, places = 0, range(tetlod.open(path).levels[-1]['bytes'], len(data), 397)
    for i in places:
        data[i] ^= 16
        try:
            series = tetlod.open(bytes(data)).series()
            for band in range(len(series.bands)):
                for step in range(7, len(series.times), 8):
                    series.seek(band, step)
                series.seek(band, len(series.times) - 1)
        except tetlod.StreamError:
            found += 1
        data[i] ^= 16
    return found == len(places) > 15


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


def same_verdicts(path, stride):
    """Header and index with a byte changed are accepted or refused by both decoders."""
    data, scratch, differ = plain(open(path, 'rb').read()), os.path.join(os.environ['SCRATCH'], 'changed.tetlod'), 0
    assert sealed(data) == data
    for i in range(8, 64 + int.from_bytes(data[20:24], 'little'), stride):
        changed = bytearray(data)
        changed[i] ^= (0x80, 0x01, 0x50)[i % 3]
        changed = sealed(changed)
        with open(scratch, 'wb') as file:
            file.write(changed)
        accepted = subprocess.run([os.environ['TETLOD'], 'info', scratch], stdout=subprocess.DEVNULL,
                                  stderr=subprocess.DEVNULL).returncode == 0
        try:
            tetlod.open(changed)
            differ += not accepted
        except tetlod.StreamError:
            differ += accepted
    return differ == 0


for path in sorted(glob.glob(os.path.join(ROOT, 'tests', 'golden', '*.tetlod'))):
    report('Python agrees on ' + os.path.basename(path), check(path))
golden = os.path.join(ROOT, 'tests', 'golden')
for verdict, what in ((check_cells(os.path.join(golden, 'cells_float32.tetlod')), 'Python agrees on values of cells'),
                      (check_steps(os.path.join(golden, 'series_float32.tetlod')), 'Python agrees on steps in time'),
                      (check_steps(os.path.join(golden, 'series_float64.tetlod')), 'Python agrees on steps of float64'),
                      (check_steps(os.path.join(golden, 'series_moving.tetlod')), 'Python agrees on points that move'),
                      (check_cell_steps(os.path.join(golden, 'series_cells.tetlod')),
                       'Python agrees on steps of cells'),
                      (check_cells(os.path.join(golden, 'parents_float32.tetlod')),
                       'Python agrees on values of cells that were split'),
                      (check_original(os.path.join(golden, 'original_cells.tetlod')),
                       'Python agrees on original cells'),
                      (check_original(os.path.join(golden, 'original_quadratic.tetlod')),
                       'Python agrees on points that no tetrahedron has'),
                      (check_topologies(os.path.join(golden, 'topologies.tetlod')),
                       'Python agrees on steps over several meshes'),
                      (damage_steps(os.path.join(golden, 'series_float64.tetlod')), 'Python notices damage of steps'),
                      (damage(os.path.join(golden, 'one_tet.tetlod')), 'Python notices damage'),
                      (same_verdicts(os.path.join(golden, 'one_tet.tetlod'), 3),
                       'Python refuses what C refuses, of one level'),
                      (same_verdicts(os.path.join(golden, 'grid_12_bit.tetlod'), 13),
                       'Python refuses what C refuses, of several'),
                      (same_verdicts(os.path.join(golden, 'cells_float32.tetlod'), 11),
                       'Python refuses what C refuses, with cells')):
    report(what, verdict)
finish()
