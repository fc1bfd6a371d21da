#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Writes a mesh as a stream of profile 0 (SPEC.md, 16.1): one level, which is stored whole.

Every program that reads streams reads it; `tetlod build` makes the coarser levels. It is the shortest encoder to start
from, and needs numpy alone, and meshio for files.

    python3 profile0.py mesh.vtu mesh.tetlod
"""
import hashlib
import json
import struct
import sys

import numpy as np

SLOWEST = 6
FREE, PER_BYTE = 1024, 4  # vertices, tetrahedra and values that go with the bytes of a frame (2.3)
CELL_TYPES = ('float32', 'float64', 'int8', 'int16', 'int32', 'int64')
# The two corners that are exchanged in the tetrahedron across the face opposite each corner (9.1)
EXCHANGED = ((1, 2), (0, 2), (0, 1), (0, 1))


def digest(data):
    return hashlib.sha256(data).digest()[:16]


def new_models(count):
    return [[32768, 0] for _ in range(count)]  # p, seen (6.2)


class Numbers:
    """Models of signed numbers (6.3)."""

    def __init__(self):
        self.length, self.sign, self.top = {}, new_models(1), {}


class Encoder:
    """The range coder of 6.1 to 6.3, the other way round."""

    def __init__(self):
        self.low, self.range, self.out = 0, 0xffffffff, bytearray()

    def _add(self, some):
        """To the number that is written; what is out already may have to take a carry."""
        carry, self.low = divmod(self.low + some, 1 << 32)
        at = len(self.out) - 1
        while carry:
            carry, self.out[at] = divmod(self.out[at] + 1, 256)
            at -= 1

    def _refill(self):
        while self.range < 1 << 24:
            self.out.append(self.low >> 24)
            self.low = self.low << 8 & 0xffffffff
            self.range <<= 8

    def bit(self, models, i, bit):
        p, seen = models[i]
        bound, shift = (self.range >> 12) * (p >> 4), (seen + 1).bit_length()
        self._add(bound if bit else 0)
        self.range = self.range - bound if bit else bound
        models[i] = (p - (p >> shift) if bit else p + ((65536 - p) >> shift)), min(seen + 1, 2**SLOWEST - 2)
        self._refill()

    def plain(self, count, value):
        self.range >>= count
        self._add(value * self.range)
        self._refill()

    def tree(self, models, depth, value):
        node = 1
        for place in reversed(range(depth)):
            bit = value >> place & 1
            self.bit(models, node, bit)
            node = 2 * node + bit

    def number(self, models, context, value):
        magnitude = abs(value)
        length = magnitude.bit_length()
        self.tree(models.length.setdefault(context, new_models(128)), 7, length)
        if not length:
            return
        self.bit(models.sign, 0, value < 0)
        left = length - 1
        top = min(left, 2)
        left -= top
        if top:
            self.tree(models.top.setdefault(length, new_models(4)), top, magnitude >> left & (1 << top) - 1)
        while left:
            some = min(left, 16)
            left -= some
            self.plain(some, magnitude >> left & (1 << some) - 1)

    def finish(self, count):
        """The frame of so many vertices, tetrahedra or values: without zeros at its end but for those of the limits."""
        out = (bytes(self.out) + self.low.to_bytes(4, 'big')).rstrip(b'\0')
        return out.ljust(max(0, -((FREE - count) // PER_BYTE)), b'\0')


# ---- connectivity (9.1)

def face_of(corners, f):
    return tuple(sorted(corners[:f] + corners[f + 1:]))


class Walk:
    """Tetrahedra in the order in which they are written, each as its corners in the input's numbers."""

    def __init__(self, tets, coder):
        self.tets, self.coder, self.order, self.corners = tets, coder, [], []
        self.number, self.first = {}, {}  # of a vertex: its number in the stream, and its first tetrahedron
        self.at_face, self.written, self.met = {}, [False] * len(tets), {}
        self.across, self.fresh, self.numbers = new_models(2), new_models(1), Numbers()
        for t, corners in enumerate(tets):
            for f in range(4):
                self.at_face.setdefault(face_of(corners, f), []).append(t)

    def vertex(self, vertex):
        is_fresh = vertex not in self.number
        self.coder.bit(self.fresh, 0, is_fresh)
        if is_fresh:
            self.number[vertex] = len(self.number)
        else:
            self.coder.number(self.numbers, 0, len(self.number) - 1 - self.number[vertex])

    def add(self, t, corners):
        self.written[t] = True
        self.order.append(t)
        self.corners.append(corners)
        for f in range(4):
            self.first.setdefault(corners[f], len(self.order) - 1)
            self.met[face_of(corners, f)] = self.met.get(face_of(corners, f), 0) + 1

    def behind(self, corners, f):
        """A tetrahedron that is not written yet, and its corners as a decoder would make them; None: there is none."""
        for t in self.at_face[face_of(corners, f)]:
            if self.written[t]:
                continue
            made, (a, b) = list(corners), EXCHANGED[f]
            made[f], = set(self.tets[t]) - set(corners)
            made[a], made[b] = made[b], made[a]
            places = [self.tets[t].index(corner) for corner in made]
            if sum(x > y for i, x in enumerate(places) for y in places[i + 1:]) % 2 == 0:
                return t, made  # as it was, not turned over
        return None

    def near(self):
        """Of each vertex, the corners of its first tetrahedron that have lower numbers."""
        for number, vertex in enumerate(self.number):
            corners = [self.number[corner] for corner in self.corners[self.first[vertex]]]
            yield [corner for corner in corners if corner < number]

    def go(self):
        side = start = 0
        while len(self.order) < len(self.tets):
            if side == 4 * len(self.order):
                start = next(t for t in range(start, len(self.tets)) if not self.written[t])
                for vertex in self.tets[start]:
                    self.vertex(vertex)
                self.add(start, self.tets[start])
                continue
            corners, f = self.corners[side // 4], side % 4
            side += 1
            if self.met[face_of(corners, f)] > 1:
                continue
            found = self.behind(corners, f)
            self.coder.bit(self.across, int(f > 0), found is not None)
            if found:
                self.vertex(found[1][f])
                self.add(*found)


# ---- positions and values (5.1, 9.2)

def codes_of(values):
    """Floats as integers in their order."""
    width = values.dtype.itemsize * 8
    bits = values.view('u%d' % values.dtype.itemsize).astype(object)
    sign = 1 << width - 1
    return [b if b < sign else -1 - (b - sign) for b in bits.tolist()]


def write_rows(coder, rows, near, models):
    """Numbers at the vertices in the stream's order, with the models of each component."""
    codes, half = [codes_of(np.ascontiguousarray(column)) for column in rows.T], 1 << rows.dtype.itemsize * 8 - 1
    for vertex, corners in enumerate(near):
        for component, own in enumerate(codes):
            base, context, found = 0, 65, [own[corner] for corner in corners]
            if found:
                mean = 0.0
                for corner in corners:
                    mean += float(rows[corner, component])
                mean /= len(found)
                with np.errstate(over='ignore'):
                    base = codes_of(np.array([mean], rows.dtype))[0] if np.isfinite(mean) else found[0]
            if len(found) > 1:
                context = max(abs(code - found[0]) for code in found).bit_length()
            coder.number(models[component], context, (own[vertex] - base + half) % (2 * half) - half)


# ---- the whole (3)

def packed_name(name):
    return struct.pack('<H', len(name.encode())) + name.encode()


def range_of(values):
    finite = values[np.isfinite(values)]
    return (float(finite.min()), float(finite.max())) if finite.size else (0, 0)


def rows_of(values, is_float=True):
    """A row for each, of the float type that holds the values."""
    rows = np.asarray(values).reshape(len(values), -1)
    return rows.astype(np.float64) if is_float and rows.dtype != np.float32 else rows


def cell_sections(cells, order):
    """CELL and CVAL (3.6): tag, flags, bytes."""
    table, sections = struct.pack('<H', len(cells)), []
    for name, values in cells.items():
        rows = rows_of(values, False)[order]
        table += struct.pack('<BBBBdd', CELL_TYPES.index(str(rows.dtype)), rows.shape[1], 0, 0, *range_of(rows))
        table += packed_name(name)
        sections.append((b'CVAL', 0, np.ascontiguousarray(rows, rows.dtype.newbyteorder('<')).tobytes()))
    return [(b'CELL', 2, table), *sections] if cells else []


def stream_of(points, tets, fields=(), cells=(), metadata=None):
    """The stream's bytes. `fields` and `cells`: values by name, a row for each point, for each tetrahedron."""
    points, tets = rows_of(points), np.array(tets, np.int64)
    used, tets = np.unique(tets, return_inverse=True)
    unused, points, tets = len(points) - len(used), points[used], tets.reshape(-1, 4)
    fields = {name: rows_of(values)[used] for name, values in dict(fields).items()}
    if any(not np.isfinite(values).all() for values in (points, *fields.values())):
        raise ValueError('points and their values have to be finite numbers')
    volume = np.linalg.det((points[tets[:, 1:]] - points[tets[:, :1]]).astype(float))
    if not volume.all() or len(np.unique(np.sort(tets), axis=0)) < len(tets):
        raise ValueError('a tetrahedron is flat, or there twice')
    tets[volume < 0] = tets[volume < 0][:, [1, 0, 2, 3]]  # all are oriented alike

    coder = Encoder()
    walk = Walk(tets.tolist(), coder)
    walk.go()
    vertices, near = list(walk.number), list(walk.near())
    write_rows(coder, points[vertices], near, [Numbers() for _ in range(3)])
    frames = [coder.finish(max(len(points), len(tets)))]
    for values in fields.values():
        coder, copies = Encoder(), new_models(1)
        for _ in values[0, 1:]:
            coder.bit(copies, 0, 0)  # no component repeats another
        write_rows(coder, values[vertices], near, [Numbers()] * values.shape[1])
        frames.append(coder.finish(values.size))
    sections = [(b'META', 2, json.dumps(metadata or {'program': 'profile0.py'}).encode()),
                *cell_sections(dict(cells), walk.order)]
    return joined(index_of(points, tets, fields, unused, frames, sections), frames, sections)


def index_of(points, tets, fields, unused, frames, sections):
    """The index (3.2), not packed."""
    index = struct.pack('<QQIHBB', len(points), len(tets), 1, len(fields), SLOWEST, 0)
    index += struct.pack('<6d', *points.min(axis=0).tolist(), *points.max(axis=0).tolist())
    index += struct.pack('<QQQ', 0, 0, unused) + bytes([points.dtype == np.float64, 0])
    for name, values in fields.items():
        index += struct.pack('<BBBB', values.dtype == np.float64, 0, values.shape[1], 1)
        index += struct.pack('<dd', *range_of(values)) + packed_name(name)
    index += struct.pack('<QQd', len(points), len(tets), 0.0) + bytes(32 * len(fields))  # the original: no error
    index += b''.join(struct.pack('<Q16s', len(frame), digest(frame)) for frame in frames)
    index += struct.pack('<I', len(sections))
    at = {2: 0, 0: 0}
    for tag, flags, content in sections:
        index += struct.pack('<4sIQQQ16s', tag, flags, at[flags], len(content), len(content), digest(content))
        at[flags] += len(content)
    return index


def joined(index, frames, sections):
    early, late = (b''.join(content for _, flags, content in sections if flags == kind) for kind in (2, 0))
    body = early + b''.join(frames) + late
    head = b'\x89TLD\r\n\x1a\n' + struct.pack('<HHIIIIIQ', 2, 0, 0, 0, len(index), len(index), len(early),
                                              64 + len(index) + len(body))
    head += digest(head + index) + bytes(4)
    return head + digest(head)[:4] + index + body


def main(source, target):
    import meshio
    mesh = meshio.read(source)
    cells = {name: values['tetra'] for name, values in mesh.cell_data_dict.items() if 'tetra' in values}
    with open(target, 'wb') as file:
        file.write(stream_of(mesh.points, mesh.cells_dict['tetra'], mesh.point_data, cells))


if __name__ == '__main__':
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    main(*sys.argv[1:])
