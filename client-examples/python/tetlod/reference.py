# SPDX-License-Identifier: BSD-3-Clause
"""Reads tetlod streams: levels of detail of a tetrahedral mesh. Written from format/SPEC.md alone; numpy only.

    from tetlod import reference
    stream = reference.open('fin.tetlod')          # or an http(s) URL, or bytes
    cursor = stream.cursor()                      # at level 0; fields=['Pressure'] decodes only that one
    cursor.seek(stream.level_for_error(0.01))     # up by replaying records, down by undoing them
    cursor.positions, cursor.tets, cursor.field('Pressure')
    stream.cells('material')[:len(cursor.tets)]   # of the level's tetrahedra
    stream.series()                               # the steps in time, of a stream that has some (reference_steps)
    stream.order()                                # the original's own numbering, of a stream built with --keep-order
    stream.original_cells()                       # the cells that were split, of such a stream (reference_cells)

From a shell: python3 -m tetlod.reference FILE_OR_URL [--error E | --level K] [-o OUT.npz]
"""
import hashlib
import itertools
import json
import math
import operator
import re
import struct
import sys
import urllib.request
from bisect import bisect_left

import numpy as np

MAGIC, POINTER_MAGIC = b'\x89TLD\r\n\x1a\n', b'\x89TLH\r\n\x1a\n'
CELL_TYPES = ('float32', 'float64', 'int8', 'int16', 'int32', 'int64')
MEASURES = ('max', 'sampled', 'rms', 'predicted')
FLOAT32_END = float(2**128 - 2**103)  # what is below is a float32, or rounds to one
SHIFT = [(seen + 1).bit_length() for seen in range(127)]
NONE = None
NOT_IN_NAMES = re.compile('[\x00-\x1f\x7f-\x9f\ufffe\uffff]')
FLOAT32, FLOAT64, UINT32, UINT64 = (struct.Struct('<' + form) for form in 'fdIQ')


class StreamError(ValueError):
    """The bytes are not a stream, or are damaged or cut off."""


def require(condition, message):
    if not condition:
        raise StreamError(message)


# ---------------------------------------------------------------- what a stream may ask for by its bytes (SPEC 2.3)

# How many are free, and how many come with each byte
TABLE, PACKED, NUMBERS, LEVEL_ROWS = (1 << 16, 3), (0, 64), (1 << 10, 4), (1 << 22, 256)
LABELS, FIELD_LABELS, STEP_ROWS = (1 << 16, 16), (1 << 16, 512), (1 << 22, 64)


# Sections that are tables of numbers
TABLES = 'TIME', 'CTIM', 'PTIM', 'TOPO', 'PAGE'


def allowed(allowance, size):
    return allowance[0] + allowance[1] * size


# Memory that a stream may take in all: so much, and so much for each byte of it; never more than the largest. A
# heavily rounded stream has two tetrahedra in a byte.
MEMORY, MOST_MEMORY = (64 << 20, 2048), 16 << 30

# What Python's objects take: for a byte of a table, a cursor with its models, a vertex or a tetrahedron of it, a value
# of a vertex there, one in a list of values
TABLE_BYTE, CURSOR, ROW, VALUE, LISTED = 16, 1 << 20, 512, 128, 96


class Budget:
    def __init__(self, size, memory):
        self.left = min(allowed(MEMORY, size), MOST_MEMORY if memory is None else memory)

    def need(self, size, what):
        """That much is going to be taken, and given back soon."""
        require(size <= self.left, '%s takes more memory than is allowed' % what)

    def take(self, size, what):
        self.need(size, what)
        self.left -= size

    def give(self, size):
        self.left += size


# ---------------------------------------------------------------- header and index (SPEC 3)

class Bytes:
    def __init__(self, data):
        self.data, self.at = data, 0

    def take(self, form):
        size = struct.calcsize('<' + form)
        require(self.at + size <= len(self.data), 'the index ends too early')
        values = struct.unpack_from('<' + form, self.data, self.at)
        self.at += size
        return values if len(values) > 1 else values[0]

    def text(self, size, errors='replace'):
        require(self.at + size <= len(self.data), 'the index ends too early')
        self.at += size
        return self.data[self.at - size:self.at].decode('utf-8', errors)

    def name(self, size):
        try:
            name = self.text(size, 'strict')
        except UnicodeDecodeError:
            name = ''
        require(name and size <= 255 and not NOT_IN_NAMES.search(name),
                'a field without a name, or with one of more than 255 bytes')
        return name


def in_ring(code, width, signed):
    code &= (1 << width) - 1
    return code - (1 << width) if signed and code >> (width - 1) else code


class Scale:
    """How the numbers of one column are coded (SPEC 5)."""

    def __init__(self, data, axes):
        kind, self.bits = data.take('BB')
        require(kind in (0, 1, 3) and self.bits <= 30, 'numbers of an unknown kind')
        self.original, self.type = kind & 1, int(kind == 1)  # 3: float64 whose values are all float32 values
        self.origin, self.step = [0.0] * axes, [0.0] * axes
        for i in range(axes if self.bits else 0):
            self.origin[i], self.step[i] = data.take('dd')
            require(math.isfinite(self.origin[i]) and self.step[i] > 0, 'numbers of an unknown kind')
            last = self.origin[i] + self.step[i] * float((1 << self.bits) - 1)
            require(math.isfinite(last) and (self.type or abs(last) < FLOAT32_END), 'numbers of an unknown kind')
        self.width = self.bits or (64 if self.type else 32)
        self.as_float, self.as_int = (FLOAT64, UINT64) if self.type else (FLOAT32, UINT32)
        self.most = (1 << (63 if self.type else 31)) - 1  # a float's bits without the sign

    def code(self, value, axis=0):
        """The code nearest to a value."""
        if self.bits:
            most = (1 << self.bits) - 1
            code = math.floor((value - self.origin[axis]) / self.step[axis] + 0.5)
            return min(max(code, 0), most)
        return self.float_code(value)

    def float_code(self, value):
        try:
            bits = self.as_int.unpack(self.as_float.pack(value))[0]
        except OverflowError:  # of float32
            bits = 0x7f800000 if value > 0 else 0xff800000
        return bits if bits <= self.most else -1 - (bits & self.most)

    def value(self, code, axis=0):
        if self.bits:
            return self.rounded(self.origin[axis] + self.step[axis] * float(code))
        return self.float_value(code)

    def rounded(self, value):
        """To the type of the codes."""
        try:
            return value if self.type else FLOAT32.unpack(FLOAT32.pack(value))[0]
        except OverflowError:
            return math.copysign(math.inf, value)

    def float_value(self, code):
        return self.as_float.unpack(self.as_int.pack(code if code >= 0 else ~code | self.most + 1))[0]

    def offset(self, base, difference):
        """The code at a difference from another, in a ring of `width` bits."""
        return in_ring(base + difference, self.width, not self.bits)


def digest(data):
    return hashlib.sha256(data).digest()[:16]


def unpack(packed, size):
    """A packed table of bytes (SPEC 6.4)."""
    stride = int.from_bytes(packed[:3], 'little')
    require(len(packed) >= 3 and 0 < stride < 1 << 16, 'a packed part has rows of no known length')
    coder, same, trees = Coder(62), bits(stride), [NONE] * 256
    coder.start(packed[3:])
    out = bytearray(size)
    for i in range(size):
        above = out[i - stride] if i >= stride else 0
        if coder.bit(same, i % stride):
            out[i] = above
            continue
        place = above if stride == 1 else i % stride % 8
        if trees[place] is NONE:
            trees[place] = bits(256)
        out[i] = coder.tree(trees[place], 8)
    coder.finish('a packed part')
    return bytes(out)


class Stream:
    def __init__(self, read, size, memory=None):
        header = read(0, 64)
        pointer = pointer_of(header)
        if pointer:
            read, size = inside(read, size, *pointer)
            header = read(0, 64)
        self._read, self.size = read, size
        require(len(header) == 64 and header[:8] == MAGIC, 'not a tetlod stream')
        fields = struct.unpack('<8sHHIIIIIQ16sI4s', header)
        _, major, minor, required, _, index_size, plain_size, early_size, self.bytes, cid, reserved, check = fields
        require(major >= 2,
                'the stream has the old layout (format %d.%d), from before the first release' % (major, minor))
        require(major == 2, 'the stream needs a newer reader')
        require(digest(header[:60])[:4] == check, 'the header is damaged')
        require(required & ~1 == 0, 'the stream needs a newer reader')
        require(
            reserved == 0 and index_size <= plain_size <= min(1 << 28, max(index_size, allowed(TABLE, index_size)))
            and early_size <= 1 << 28 and 64 + index_size + early_size <= self.bytes < 1 << 63,
            'the header contradicts itself')
        self.budget = Budget(self.bytes if size is None else min(size, self.bytes), memory)
        self.budget.take(TABLE_BYTE * plain_size, 'the index')
        index = read(64, index_size)
        require(len(index) == index_size, 'the stream ends too early')
        require(digest(header[:40] + index) == cid, 'the index is damaged: the content id is another')
        self.cid = cid.hex()
        index = index if index_size == plain_size else unpack(index, plain_size)
        self._parse(Bytes(index), 64 + index_size, early_size)
        require(size is None or size <= self.bytes, 'bytes follow the end of the stream')
        require(not pointer or pointer[1] == self.bytes, 'the pointer to the stream gives another length')
        self._metadata = (self.section('META') or b'').decode('utf-8', 'replace')
        self.cell_fields, self.cell_rows = [], None  # rows of values of cells, if they are those of PCEL
        self._parse_cell_tables([section['tag'] for section in self.sections])
        self.topologies, self.group_times = [], None  # the latter: of the steps, in a topology group
        if any(section['tag'] == 'TOPO' for section in self.sections):
            self._parse_topologies(Bytes(self.section('TOPO')))
        table = self.section('PAGE')
        require((table is not None) == bool(required & 1), 'the header and the index disagree about pages')
        self.groups = {}  # levels in pages
        if table is not None:
            from .reference_pages import Pages
            self.groups = Pages(self, Bytes(table)).groups

    def _parse(self, data, offset, early_size):
        self.vertices, self.tets, levels, fields, slowest, reserved = data.take('QQIHBB')
        require(1 <= levels <= 65536 and fields <= 256 and 5 <= slowest <= 7 and reserved == 0, 'the index is damaged')
        require(len(data.data) >= levels * (48 + 56 * fields), 'the index ends too early')
        require(max(self.vertices, self.tets) <= 1 << 40, 'the stream is beyond the limits of the format')
        self.seen_most = (1 << slowest) - 2
        bounds = data.take('6d')
        self.bounds = [list(bounds[:3]), list(bounds[3:])]
        require(
            all(map(math.isfinite, bounds)) and all(map(operator.le, *self.bounds)),
            'the index has invalid bounds')
        self.degenerate_tets, self.inverted_tets, self.unused_points = data.take('QQQ')
        self.scales = [Scale(data, 3)]
        self.fields = []
        for _ in range(fields):
            self.scales.append(Scale(data, 1))
            components, flags, low, high, size = data.take('BBddH')
            require(1 <= components <= 64, 'a field of too many components or none')
            require(math.isfinite(low) and math.isfinite(high) and low <= high, 'a field without a range')
            name = data.name(size)
            require(all(name != field['name'] for field in self.fields), 'two fields of one name')
            self.fields.append({'name': name, 'components': components, 'controlled': bool(flags & 1),
                                'exact_later': bool(flags & 2), 'range': [low, high],
                                'type': 'float64' if self.scales[-1].original else 'float32',
                                'bounds': name[:-len(' bound')] if flags & 4 and name.endswith(' bound') else None})
        names = {field['name'] for field in self.fields}
        for field in self.fields:
            field['bounds'] = field['bounds'] if field['bounds'] in names else None
        self.levels, self.frames, stored = [], [], [0] * (fields + 1)
        early = offset
        offset += early_size
        for k in range(levels):
            vertices, tets, domain_error = data.take('QQd')
            errors = {f['name']: dict(zip(MEASURES, data.take('4d'))) for f in self.fields}
            level = {'level': k, 'vertices': vertices, 'tets': tets, 'domain_error': domain_error, 'errors': errors,
                     'offset': offset}
            frames = []
            for _ in range(fields + 1):
                size, sha = data.take('Q16s')
                frames.append((offset, size, sha))
                offset += size
            level['bytes'] = offset
            coarser = self.levels[-1] if self.levels else None
            self.tail = k == levels - 1 and bool(coarser) and (vertices, tets) == (coarser['vertices'], coarser['tets'])
            stored = [before + size for before, (_, size, _) in zip(stored, frames)]
            self._check_level(level, coarser, stored)
            self.levels.append(level)
            self.frames.append(frames)
        require(
            sum(level['vertices'] + level['tets'] for level in self.levels) <= allowed(LEVEL_ROWS, self.bytes),
            'more levels than go with the bytes')
        self._check_errors()
        self._check_tail()
        self._parse_sections(data, early, early_size, offset)
        finest = self.levels[-1]
        require(finest['vertices'] == self.vertices and finest['tets'] == self.tets > 0,
                'the levels do not lead to the original')

    def _parse_sections(self, data, early, early_size, late):
        """The directory (SPEC 3.5)."""
        self.sections, ends = [], {2: 0, 0: 0}
        count = data.take('I')
        require(count <= 65536 and len(data.data) - data.at == 48 * count, 'the index is damaged')
        for _ in range(count):
            tag, flags, offset, size, plain, sha = data.take('4sIQQQ16s')
            require(re.fullmatch(b'[A-Z0-9]{4}', tag) and flags < 8, 'a section of no known form')
            tag, place = tag.decode(), flags & 2
            require(offset == ends[place], 'sections that do not follow each other')
            ends[place] += size
            room = allowed(TABLE if tag in TABLES else PACKED, size)
            require(plain <= room if flags & 4 else plain == size, 'a section of another size than its bytes can hold')
            known = {'META': 2, 'ORDR': 0, 'CELL': 2, 'CVAL': 0, 'TIME': 0, 'TVAL': 0, 'CTIM': 0, 'CSTP': 0,
                     'PCEL': 2, 'PMAP': 0, 'PVAL': 0, 'PTIM': 0, 'PSTP': 0, 'TOPO': 2, 'NEXT': 0,
                     'PAGE': 2, 'ORIG': 0}
            twice = tag not in ('CVAL', 'TVAL', 'CSTP', 'PVAL', 'PSTP') and any(tag == s['tag'] for s in self.sections)
            require(tag not in known or known[tag] == place and not twice, 'a section at the wrong place')
            require(tag != 'META' or plain <= 1 << 20, 'too much metadata')
            require(tag in known or not flags & 1,
                    'the stream cannot be read without its section %s, which is not known here' % tag)
            self.sections.append({
                'tag': tag, 'offset': offset + (early if place else late), 'stored': size, 'size': plain,
                'packed': bool(flags & 4), 'digest': sha
            })
        require(ends[2] == early_size and late + ends[0] == self.bytes, 'the header and the index disagree about sizes')

    def section(self, tag, number=0):
        """What the first section with a tag holds, or a further one; None if there is none."""
        for section in [section for section in self.sections if section['tag'] == tag][number:number + 1]:
            table = section['tag'] in TABLES
            self.budget.need((TABLE_BYTE if table else 2) * section['size'] + section['stored'], 'section ' + tag)
            data = self._part('section ' + tag, section['offset'], section['stored'], section['digest'])
            return unpack(data, section['size']) if section['packed'] else data
        return None

    def sums(self):
        """Exact sums over the original (SPEC 3.9), or None: the volume, the levels' swept volumes, integrals of each
        component and its square, and, where they are there, places of extremes and distributions."""
        section = self.section('SUMS')
        if section is None:
            return None
        levels, components, volume = struct.unpack_from('<IId', section)
        names = [(field['name'], c) for field in self.fields for c in range(field['components'])]
        require(levels >= len(self.levels) and components == len(names), 'sums of other levels or components')
        require(len(section) >= 16 + 4 * levels + 16 * components, 'the sums end too early')
        swept = np.frombuffer(section, '<f4', levels, 16)
        sums = np.frombuffer(section, '<f8', 2 * components, 16 + 4 * levels).reshape(-1, 2)
        numbers, rest = [np.array([volume]), sums.ravel()], section[16 + 4 * levels + 16 * components:]
        places = distributions = {}
        if rest:
            count = int.from_bytes(rest[:4], 'little')
            require(1 <= count <= 4096 and len(rest) == 4 + components * (48 + 16 * count), 'bytes behind the sums')
            rows = np.frombuffer(rest, '<f8', offset=4).reshape(components, 6 + 2 * count)
            below = rows[:, 6:].reshape(-1, count, 2)
            require((np.diff(below, axis=1) >= 0).all() and (below[:, :, 1] >= 0).all() and
                    (below[:, -1, 1] <= volume * (1 + 1e-9)).all(), 'a distribution that falls')
            numbers.append(rows.ravel())
            places, distributions = dict(zip(names, rows[:, :6].reshape(-1, 2, 3))), dict(zip(names, below))
        require(all(np.isfinite(part).all() for part in numbers) and volume >= 0 and (sums[:, 1] >= 0).all() and
                (swept >= 0).all() and (swept[1:] <= swept[:-1]).all(), 'sums that are no numbers')
        return {'volume': volume, 'swept': swept, 'sums': dict(zip(names, sums)), 'places': places,
                'distributions': distributions}

    def box_sums(self):
        """Sums over the original by boxes and regions (SPEC 3.9), or None: the depth, the box and the volume; of each
        node of the tree where its box is split and what part of its volume its first child has; of each component the
        least and greatest value and the mean in the boxes of its depth; of each region its volume and the same."""
        section = self.section('KSUM')
        if section is None:
            return None
        components, depth, regions = struct.unpack_from('<IHH', section)
        names = [(field['name'], c) for field in self.fields for c in range(field['components'])]
        require(components == len(names) and depth <= 12 and len(section) > 64, 'sums of boxes of other components')
        box, volume = np.frombuffer(section, '<f8', 6, 8).reshape(2, 3), struct.unpack_from('<d', section, 56)[0]
        depths, inner, at = list(section[64:64 + components]), (1 << depth) - 1, 64 + components
        size = at + 3 * inner + 16 * regions + sum(16 + (4 << d) + 24 * regions for d in depths)
        require(max(depths) <= depth and size == len(section), 'sums of boxes that end too early or too late')
        splits = np.frombuffer(section, 'u1', inner, at)
        parts = np.frombuffer(section, '<u2', inner, at + inner)
        at, boxes = at + 3 * inner, {}
        for name, own in zip(names, depths):
            ends, count = np.frombuffer(section, '<f8', 2, at), 1 << own
            low, high = (np.frombuffer(section, 'u1', count, at + 16 + i * count) for i in range(2))
            means = np.frombuffer(section, '<u2', count, at + 16 + 2 * count)
            require(np.isfinite(ends).all() and ends[0] <= ends[1], 'a range that is none')
            low, high = ((1 - part / 255) * ends[0] + part / 255 * ends[1] for part in (low, high))
            boxes[name] = np.column_stack([low, high, (1 - means / 65535) * low + means / 65535 * high])
            at += 16 + 4 * count
        numbers = np.frombuffer(section, '<f8', 2 * regions, at).reshape(-1, 2)
        rows = np.frombuffer(section, '<f8', 3 * regions * components, at + 16 * regions).reshape(components, -1, 3)
        require(np.isfinite(box).all() and (box[0] <= box[1]).all() and np.isfinite(volume) and volume >= 0 and
                np.isfinite(numbers).all() and (np.diff(numbers[:, 0]) > 0).all() and
                ((numbers[:, 1] >= 0) & (numbers[:, 1] <= volume * (1 + 1e-9))).all() and np.isfinite(rows).all() and
                (rows[..., 0] <= rows[..., 1]).all(), 'sums of boxes or regions that are no numbers')
        return {'depth': depth, 'box': box, 'volume': volume, 'splits': splits, 'parts': parts / 65535, 'boxes': boxes,
                'regions': {number: {'volume': of, 'rows': dict(zip(names, rows[:, r]))}
                            for r, (number, of) in enumerate(numbers)}}

    def _parse_cell_tables(self, tags):
        if 'CELL' in tags:
            require('PCEL' not in tags, 'two tables of cell fields')
            self._parse_cells(Bytes(self.section('CELL')), 'CVAL', self.tets)
        if 'PCEL' in tags:
            data = Bytes(self.section('PCEL'))
            self.cell_rows = data.take('Q')
            require(0 < self.cell_rows <= self.tets, 'cell fields of too many cells or none')
            if 'PMAP' in tags:
                packed = [section['packed'] for section in self.sections if section['tag'] == 'PMAP']
                require(not packed[0] and 'PVAL' not in tags[:tags.index('PMAP')],
                        'a map from tetrahedra to cells at the wrong place')
            else:
                require(self.cell_rows == self.tets, 'cells without the map to them')
            self._parse_cells(data, 'PVAL', self.cell_rows)

    def _parse_cells(self, data, tag, rows):
        """The table of cell fields (SPEC 3.6)."""
        values = [section for section in self.sections if section['tag'] == tag]
        count = data.take('H')
        require(count <= 256 and count == len(values), 'cell fields that do not go with their values')
        for section in values:
            kind, components, flags, reserved, low, high = data.take('BBBBdd')
            quantum, error = data.take('dd') if tag == 'PVAL' else (0.0, 0.0)
            length = data.take('H')
            require(0 <= quantum <= 2.0**900 and 0 <= error < math.inf and (kind < 2 if quantum else error == 0),
                    'rounded cell data of an unknown kind')
            require(kind < len(CELL_TYPES) and 1 <= components <= 64 and reserved == 0, 'cell data of an unknown kind')
            require(math.isfinite(low) and math.isfinite(high) and low <= high, 'cell data without a range')
            name = data.name(length)
            require(all(name != field['name'] for field in self.cell_fields), 'two cell fields of one name')
            size, numbers = section['size'], rows * components
            fits = size == numbers * np.dtype(CELL_TYPES[kind]).itemsize
            if quantum:
                fits = not section['packed'] and (size == 0 or numbers <= allowed(STEP_ROWS, size))
            if 'PMAP' in [other['tag'] for other in self.sections] and tag == 'PVAL':
                mapped = [other['stored'] for other in self.sections if other['tag'] == 'PMAP'][0]
                fits = fits and self.tets * components <= allowed(STEP_ROWS, section['stored'] + mapped)
            require(fits, 'cell fields that do not go with their values')
            self.cell_fields.append({
                'name': name, 'components': components, 'type': CELL_TYPES[kind], 'region': bool(flags & 1),
                'range': [low, high], 'quantum': quantum, 'error': error
            })
        require(data.at == len(data.data), 'the table of cell data is damaged')

    def _parse_topologies(self, data):
        """The table of topology groups (SPEC 3.8)."""
        following = [section for section in self.sections if section['tag'] == 'NEXT']
        count = data.take('I')
        require(any(section['tag'] == 'TIME' for section in self.sections), 'topology groups without steps')
        require(following and not following[0]['packed'] and count > 1 and len(data.data) >= 4 + 32 * count,
                'the table of topology groups is damaged')
        offset = following[0]['offset']
        for number in range(count):
            steps, reserved, size, cid = data.take('IIQ16s')
            require(1 <= steps <= 1 << 20 and reserved == 0, 'the table of topology groups is damaged')
            require(size >= 64 if number else size == 0 and cid == bytes(16), 'the table of topology groups is damaged')
            self.topologies.append({'steps': steps, 'cid': cid.hex() if number else self.cid,
                                    'offset': offset if number else 0, 'bytes': size if number else self.bytes})
            offset += size
        steps = sum(topology['steps'] for topology in self.topologies)
        require(
            offset == following[0]['offset'] + following[0]['stored'] and steps <= 1 << 20
            and len(data.data) == 4 + 32 * count + 8 * steps, 'the table of topology groups is damaged')
        times = struct.unpack('<%dd' % steps, data.data[4 + 32 * count:])
        require(all(map(math.isfinite, times)) and all(map(operator.le, times, times[1:])), 'times that fall')
        for topology in self.topologies:
            topology['times'], times = times[:topology['steps']], times[topology['steps']:]
        self.group_times = self.topologies[0]['times']

    def topology(self, number):
        """A topology group as a stream of its own."""
        if number == 0:
            return self
        table = self.topologies[number]
        stream = Stream(
            lambda offset, size: self._read(table['offset'] + offset, min(size, max(0, table['bytes'] - offset))),
            table['bytes'])
        require((stream.cid, stream.bytes, stream.topologies) == (table['cid'], table['bytes'], []),
                'a topology group is another stream than the table says')
        require(any(section['tag'] == 'TIME' for section in stream.sections), 'a topology group without steps')
        stream.group_times = table['times']
        return stream

    def cells(self, name):
        """The values of all tetrahedra, in the order in which they arrive: those of a level's tetrahedra are the first.
        """
        return self.spread(self.cell_values(name))

    def spread(self, rows):
        """Values of cells as values of tetrahedra."""
        parents = self.parents()
        return rows if parents is None else rows[parents]

    def cell_values(self, name):
        """A row for each cell, or for each tetrahedron where `parents` gives None."""
        number = [field['name'] for field in self.cell_fields].index(name)
        field, rows = self.cell_fields[number], self.cell_rows or self.tets
        data, kind = self.section('PVAL' if self.cell_rows else 'CVAL',
                                  number), np.dtype(field['type']).newbyteorder('<')
        shape = (rows, field['components']) if field['components'] > 1 else (rows,)
        self.need_cells(field)
        if field['quantum']:
            from .reference_steps import CellGroup
            codes = CellGroup(np.zeros(shape, '<i8'))
            if data:
                codes.decode(data)
            values = (codes.values() * field['quantum']).astype(kind)
            require(np.all(np.isfinite(values)), 'cell data that is not finite')
            return values
        values = np.frombuffer(data, kind)
        require(field['type'] != 'int64' or not np.any((values > 1 << 53) | (values < -(1 << 53))),
                'cell data beyond 2^53')
        return values.reshape(shape)

    def need_cells(self, field):
        """Values of cells, where they are listed one by one and as arrays of all tetrahedra."""
        rows = self.cell_rows or self.tets
        listed = LISTED * rows if field['quantum'] else 0
        self.budget.need(field['components'] * (listed + 16 * (rows + self.tets)) + 4 * self.tets, 'values of cells')

    def parents(self):
        """The cell of each tetrahedron (SPEC 3.6), cells numbered as they arrive; None: each is its own."""
        data = self.section('PMAP') if self.cell_rows else None
        if data is None:
            return None
        coder, fresh, models = Coder(126), bits(2), Number()
        coder.start(data)
        parents, seen, last, context, new = np.empty(self.tets, np.uint32), 0, 0, 0, 1
        for t in range(self.tets):
            new = 1 if t == 0 else coder.bit(fresh, new)
            if new:
                last, seen = seen, seen + 1
            else:
                distance = coder.number(models, context)
                last, context = last + distance, abs(distance).bit_length()
            require(0 <= last < min(seen, self.cell_rows), 'a map to cells that are not there')
            parents[t] = last
        require(seen == self.cell_rows, 'a map to cells that are not there')
        coder.finish('the map from tetrahedra to cells')
        return parents

    def series(self):
        """The steps in time (reference_steps.Series), or None."""
        from .reference_steps import Series
        table = self.section('TIME')
        return None if table is None else Series(self, table)

    def _part(self, what, offset, size, sha):
        data = self._read(offset, size)
        require(len(data) == size, what + ': the stream ends too early')
        require(digest(data) == sha, what + ' is damaged')
        return data

    @property
    def metadata(self):
        """The metadata, {} if they are none."""
        try:
            metadata = json.loads(self._metadata or '{}')
        except ValueError:
            metadata = {}
        return metadata if isinstance(metadata, dict) else {}

    def _check_level(self, level, coarser, stored):
        """`stored`: bytes of the frames of each part, up to this level."""
        vertices, tets = level['vertices'], level['tets']
        if coarser:
            require(self.tail or vertices > coarser['vertices'] and tets >= coarser['tets'], 'levels that do not grow')
        given = [max(vertices, tets)]
        given += [
            vertices * field['components'] * (2 if self.tail and field['exact_later'] else 1) for field in self.fields
        ]
        require(all(numbers <= allowed(NUMBERS, size) for numbers, size in zip(given, stored)),
                'levels of more than their bytes can hold')

    def _check_tail(self):
        """The exact tail has no mesh, and a frame for each field that it makes exact."""
        for part, field in enumerate(self.fields, 1):
            require(not field['exact_later'] or self.tail and self.scales[part].bits,
                    'an exact tail that does not go with its fields')
            require(field['exact_later'] or not self.tail or not self.frames[-1][part][1],
                    'an exact tail that does not go with its fields')
        require(not self.tail or not self.frames[-1][0][1], 'a tail with a mesh of its own')

    def _check_errors(self):
        """No error grows from level to level; NaN is one that is not known."""
        require(not any(level['domain_error'] < 0 for level in self.levels), 'a negative domain error')
        columns = [[level['errors'][f['name']][m] for level in self.levels] for f in self.fields for m in MEASURES]
        for column in columns:
            known = [error for error in column if not math.isnan(error)]
            require(all(a >= b for a, b in zip(known, known[1:] + [0.0])), 'errors that grow with the level')

    def frame(self, level, part, page=None):
        """Of a level, or of a page of it, where it is in pages."""
        if page is None:
            return self._part('level %d' % level, *self.frames[level][part])
        row = self.groups[level].pages[page]
        return self._part('level %d, page %d' % (level, page), row.offsets[part], *row.frames[part])

    def order(self):
        """The original's own numbering (SPEC 10): numbers there of the finest level's vertices and tetrahedra, and for
        each tetrahedron which of its corners are the original's first to fourth. None if the stream does not keep it.
        """
        data = self.section('ORDR')
        if data is None:
            return None
        self.budget.need(16 * (self.vertices + self.tets), 'the order')
        coder, first, second = Coder(self.seen_most), bits(4), [bits(4) for _ in range(4)]
        coder.start(data)
        numbers = []
        for count in (self.vertices, self.tets):
            models, expected, seen = Number(), 0, np.zeros(count, dtype=bool)
            found = np.empty(count, dtype=np.uint32)
            for i in range(count):
                number = expected + coder.number(models, 0)
                require(0 <= number < count and not seen[number], 'the order is none')
                seen[number] = True
                found[i], expected = number, number + 1
            numbers.append(found)
        corners = np.empty((self.tets, 4), dtype=np.uint8)
        for t in range(self.tets):
            i = coder.tree(first, 2)
            j = coder.tree(second[i], 2)
            require(i != j, 'the order is none')
            k, m = [c for c in range(4) if c != i and c != j]
            odd = ((i > j) + (i > k) + (i > m) + (j > k) + (j > m)) % 2
            corners[t] = (i, j, m, k) if odd else (i, j, k, m)
        coder.finish('the order')
        return numbers[0], numbers[1], corners

    def original_cells(self):
        """The cells that were split (reference_cells.OriginalCells); None if the stream does not keep them."""
        from .reference_cells import OriginalCells
        data = self.section('ORIG')
        return None if data is None or self.section('ORDR') is None else OriginalCells(self, data)

    def field_index(self, name):
        for i, field in enumerate(self.fields):
            if field['name'] == name:
                return i
        raise KeyError('no field %r; there are %s' % (name, ', '.join(f['name'] for f in self.fields)))

    def level_for_error(self, error, field=None, measure='max', absolute=False):
        """The coarsest level whose error is at most `error`: a fraction of the range, or `absolute`, in the field's
        units.

        Without a field: of every controlled field, each in its own range."""
        fields = [f for f in self.fields if (f['name'] == field if field else f['controlled'])]
        units = [(f['name'], f['range'][1] - f['range'][0] if absolute else 1) for f in fields]
        for level in self.levels:
            if units and all(level['errors'][name].get(measure, math.nan) * unit <= error for name, unit in units):
                return level['level']
        raise ValueError('no level has an error of at most %g' % error)

    def cursor(self, fields=None):
        return Cursor(self, range(len(self.fields)) if fields is None else [self.field_index(f) for f in fields])


def open(source, memory=None):
    """A stream from a path, an http(s) URL whose server knows Range, or bytes. `memory`: bytes that it and its cursors
    may take, about; never more than 64 MiB and 2048 for each byte of it, or 16 GiB."""
    if isinstance(source, (bytes, bytearray, memoryview)):
        data = bytes(source)
    elif source.startswith(('http://', 'https://')):
        def read(offset, size):
            if not size:
                return b''
            request = urllib.request.Request(source, headers={'Range': 'bytes=%d-%d' % (offset, offset + size - 1)})
            with urllib.request.urlopen(request) as answer:
                data = answer.read()
                return data if answer.status == 206 else data[offset:offset + size]
        return Stream(read, None, memory)
    else:
        with __builtins_open(source, 'rb') as file:
            data = file.read()
    return Stream(lambda offset, size: data[offset:offset + size], len(data), memory)


def pointer_of(head):
    """Offset and length of the stream in an HDF5 file that begins with these bytes (SPEC 3.10); None: it is none."""
    if head[:8] != POINTER_MAGIC or len(head) < 64:
        return None
    require(digest(head[:60])[:4] == head[60:], 'the pointer to the stream is damaged')
    offset, length = struct.unpack('<QQ', head[8:24])
    require(not any(head[24:60]) and min(offset, length) >= 64 and offset + length < 1 << 63,
            'the pointer to the stream is damaged')
    return offset, length


def inside(read, size, offset, length):
    """`read` and the size of what lies at `offset`."""
    here = length if size is None else max(0, min(length, size - offset))
    return (lambda at, count: read(offset + at, max(0, min(count, length - at)))), here


__builtins_open = __builtins__['open'] if isinstance(__builtins__, dict) else __builtins__.open


# ---------------------------------------------------------------- range decoder (SPEC 6)

def bits(count):
    return [32768] * count, [0] * count


class Number:
    """Models of a signed number (SPEC 6.3)."""

    def __init__(self):
        self.length = [NONE] * 66
        self.sign = bits(1)
        self.top = [NONE] * 65


class Coder:
    def __init__(self, seen_most):
        self.seen_most = seen_most

    def start(self, data):
        self.rest, self.range, self.code = iter(data[4:]), 0xffffffff, int.from_bytes(data[:4].ljust(4, b'\0'), 'big')
        require(self.code < self.range, 'a frame holds what no writer writes')

    def finish(self, what):
        """What is left of the frame is zeros (SPEC 6.1)."""
        require(not any(self.rest), what + ' has bytes that belong to nothing')

    def _refill(self, width):
        while width < 0x1000000:
            width <<= 8
            self.code = self.code << 8 | next(self.rest, 0)
        self.range = width

    def bit(self, models, i=0):
        chances, counts = models
        p, seen = chances[i], counts[i]
        bound = (self.range >> 12) * (p >> 4)
        if self.code >= bound:
            self.code -= bound
            width, bit = self.range - bound, 1
            chances[i] = p - (p >> SHIFT[seen])
        else:
            width, bit = bound, 0
            chances[i] = p + ((65536 - p) >> SHIFT[seen])
        if seen < self.seen_most:
            counts[i] = seen + 1
        if width < 0x1000000:
            self._refill(width)
        else:
            self.range = width
        return bit

    def plain(self, count):
        width = self.range >> count
        value = self.code // width
        require(value < 1 << count, 'a frame holds what no writer writes')
        self.code -= width * value
        self._refill(width)
        return value

    def tree(self, models, depth):
        chances, counts = models
        width, code, most, rest, node = self.range, self.code, self.seen_most, self.rest, 1
        for _ in range(depth):  # bit(models, node), written out: most of the time goes here
            p, seen = chances[node], counts[node]
            bound = (width >> 12) * (p >> 4)
            if seen < most:
                counts[node] = seen + 1
            if code >= bound:
                code -= bound
                width -= bound
                chances[node] = p - (p >> SHIFT[seen])
                node += node + 1
            else:
                width = bound
                chances[node] = p + ((65536 - p) >> SHIFT[seen])
                node += node
            while width < 0x1000000:
                width <<= 8
                code = code << 8 | next(rest, 0)
        self.range, self.code = width, code
        return node - (1 << depth)

    def below(self, tops, length):
        left = length - 1
        top = min(left, 2)
        value = 1
        if top:
            left -= top
            if tops[length] is NONE:
                tops[length] = bits(4)
            value = value << top | self.tree(tops[length], top)
        while left:
            some = min(left, 16)
            left -= some
            value = value << some | self.plain(some)
        return value

    def length(self, lengths, context):
        if lengths[context] is NONE:
            lengths[context] = bits(128)
        length = self.tree(lengths[context], 7)
        require(length <= 64, 'a number is not one')
        return length

    def distance(self, models, wides, width, context):
        """A number whose bits above a mantissa have models (SPEC 9.3)."""
        length, mantissa = self.length(models.length, context), 23 if width == 32 else 52
        require(length <= width, 'a number is not one')
        if not length:
            return 0
        negative = self.bit(models.sign)
        if length <= mantissa + 1:
            value = self.below(models.top, length)
        else:
            wide = min(length - mantissa, 12)
            value, left = 1 << wide | self.tree(wides[wide], wide), length - 1 - wide
            while left:
                some = min(left, 16)
                left -= some
                value = value << some | self.plain(some)
        return -value if negative else value

    def number(self, models, context):
        length = self.length(models.length, context)
        if not length:
            return 0
        negative = self.bit(models.sign)
        value = self.below(models.top, length)
        value = -value if negative else value
        return (value + (1 << 63)) % (1 << 64) - (1 << 63)


# ---------------------------------------------------------------- the mesh and its log (SPEC 4)

class Step:
    def __init__(self):
        self.none, self.level = [bits(4) for _ in range(8)], [bits(2) for _ in range(4)]
        self.side = [[bits(5) for _ in range(3)] for _ in range(4)]
        self.rank = [[bits(64) for _ in range(4)] for _ in range(4)]
        self.length, self.top = [[NONE] * 65 for _ in range(4)], [NONE] * 65


class Models:
    def __init__(self):
        self.splits = [bits(16), bits(16)]
        self.leaf = [[bits(16), bits(16), bits(16)] for _ in range(3)]
        self.arity, self.placement, self.label, self.irregular = bits(4), bits(4), bits(1280), bits(1)
        self.boundary, self.made, self.flip, self.across, self.fresh = bits(16), bits(2), bits(1), bits(2), bits(1)
        self.step = [Step() for _ in range(3)]
        self.extra, self.vertex = Number(), Number()
        self.middle, self.corner = [Number() for _ in range(3)], [Number() for _ in range(3)]


class Column:
    def __init__(self, scale, components, part):
        self.scale, self.components, self.part = scale, components, part
        self.codes, self.values = [], []  # per component, per vertex
        for _ in range(components):
            self.codes.append([])
            self.values.append([])
        self.restart()
        self.copied, self.exact = list(range(components)), None  # exact: values of the tail

    def restart(self):
        """Models as at the beginning."""
        self.child, self.corner = [[Number(), Number()], [Number(), Number()]], Number()
        self.zeros, self.last_zeros = [bits(16) for _ in range(16)], [0] * self.components
        self.kept, self.nudge = [bits(2), bits(2)], bits(4)

    def copies(self, coder):
        """Which components repeat others (SPEC 9.2)."""
        flag, source = bits(1), bits(64)
        for c in range(1, self.components):
            if coder.bit(flag):
                self.copied[c] = coder.tree(source, 6)
                require(self.copied[c] < c, 'a component repeats a later one')

    def axis(self, component):
        return component if self.part == 0 else 0


# By the labels of three edges' earlier tetrahedra, two bits each (1: one stays, 2: one goes): SPEC 7.3's table
NEIGHBOURS = [((0, 1, 2, 3), (4, 5, 6, 6), (7, 8, 8, 8),
               (9, 9, 9, 9))[bin(n & 0b010101).count('1')][bin(n & 0b101010).count('1')] for n in range(64)]
STEPS = (-6.0, -2.5, -0.75, 0.0, 0.75, 2.5, 6.0)


OTHERS = [[[c for c in range(4) if c != place and c != opposite][:2] for opposite in range(4)] for place in range(4)]


def replaced(corners, place, opposite, own, other):
    """The tetrahedron on the other side of the face that has `own` at `place` and not the corner `opposite` (SPEC 7.4).
    """
    out = list(corners)
    out[place], out[opposite] = own, other
    first, second = OTHERS[place][opposite]
    out[first], out[second] = out[second], out[first]
    return out


def middle_of(scale, axis, own, codes):
    """The code of the first child if the vertex is in the middle of all (SPEC 7.2)."""
    if scale.bits:
        return min(max(own * len(codes) - sum(codes[1:]), 0), (1 << scale.bits) - 1)
    value = scale.value(own, axis) * float(len(codes))
    for code in codes[1:]:
        value = value - scale.value(code, axis)
    return scale.code(value, axis) if math.isfinite(value) else own


POWERS = [float(10**i) for i in range(23)]


class Numbers:
    """What the exact values of a component are (SPEC 9.3): floats, decimals of so many digits behind the point, or in
    all."""

    def __init__(self, kind, digits, scale):
        self.kind, self.digits, self.scale = kind, digits, scale
        self.width = 64 if kind or scale.type else 32

    def code(self, value):
        if self.kind == 0:
            return self.scale.float_code(value)
        if self.kind == 1:
            scaled = value * POWERS[self.digits] + 0.5
            return int(min(max(math.floor(scaled) if math.isfinite(scaled) else scaled, -2**53), 2**53))
        size, e = abs(value), -22
        while e <= 22:
            scaled = (size * POWERS[-e] if e < 0 else size / POWERS[e]) + 0.5
            if scaled < POWERS[self.digits]:
                break
            e += 1
        m = 10**self.digits - 1 if e > 22 else math.floor(scaled)
        code = m + (min(e, 22) + 22) * 9 * 10**(self.digits - 1)
        return -code if value < 0 else code

    def value(self, code):
        if self.kind == 0:
            return self.scale.float_value(code)
        if self.kind == 1:
            return self.scale.rounded(float(code) / POWERS[self.digits])
        size, tenth = abs(code), 10**(self.digits - 1)
        steps = 0 if size < 10 * tenth else (size - tenth) // (9 * tenth)
        if steps > 44:
            return math.nan
        m, e = float(size - steps * 9 * tenth), steps - 22
        value = m / POWERS[-e] if e < 0 else m * POWERS[e]
        return self.scale.rounded(-value if code < 0 else value)


class Cursor:
    """A mesh at one level. `positions`, `tets`, `field(name)` copy it into numpy arrays."""

    def __init__(self, stream, fields):
        self.stream, self.level, self.decoded, self.taken = stream, 0, 0, 0
        self.columns = [Column(stream.scales[0], 3, 0)]
        for f in fields:
            self.columns.append(Column(stream.scales[1 + f], stream.fields[f]['components'], 1 + f))
        self.coders = [Coder(stream.seen_most) for _ in self.columns]
        self.models = Models()
        self.tets_list, self.stars, self.parents = [], [], []
        self.count = self.tet_count = 0
        # bytes of the columns' frames; labels of records
        self.stored, self.labels, self.most_labels = [0] * len(self.columns), 0, 0
        self.log, self.done = [], 0  # records: (vertex, other codes and values, [(labels, tetrahedra)])
        self.ends = [0]              # records in the log at each level's end
        self.leaf = []               # of each vertex at the log's end: one of the original's, which does not split
        self.exact = False           # fields have the tail's values
        self.listed, self.seams = None, frozenset()  # of a page: its vertices, and those that do not split
        self.left_out = {}           # tetrahedra of pages that were left out: of which level
        self.page_of = []            # of some pages: of which one of the last level in pages each tetrahedron is
        self._base()

    def __del__(self):
        self.stream.budget.give(self.taken)

    def _take_room(self, level):
        """Before a level is decoded: for all that it adds, as far as it is decoded."""
        there = self.stream.levels[level]
        before = self.stream.levels[level - 1] if level else {'vertices': 0, 'tets': 0}
        vertices = there['vertices'] - before['vertices']
        components = sum(column.components for column in self.columns if column.part)
        if self._is_tail(level):
            size = LISTED * there['vertices'] * components
        else:
            size = ROW * (vertices + there['tets'] - before['tets']) + VALUE * vertices * components
        size += 0 if level else CURSOR
        self.stream.budget.take(size, 'level %d' % level)
        self.taken += size

    # ------------------------------------------------ what it holds

    @property
    def positions(self):
        return np.array([v[:self.count] for v in self.columns[0].values], dtype=np.float64).T.copy()

    @property
    def tets(self):
        return np.array(self.tets_list[:self.tet_count], dtype=np.uint32).reshape(-1, 4)

    def field(self, name):
        part = 1 + self.stream.field_index(name)
        for column in self.columns:
            if column.part == part:
                values = np.array([v[:self.count] for v in column.values]).T
                return values[:, 0].copy() if column.components == 1 else values.copy()
        raise KeyError('the cursor does not decode field %r' % name)

    # ------------------------------------------------ moving

    def seek(self, level):
        require(0 <= level < len(self.stream.levels), 'there is no level %d' % level)
        known = min(level, self.decoded)
        self._use_exact(False)
        while self.done < self.ends[known]:
            self._forward()
        while self.done > self.ends[known]:
            self._back()
        while self.decoded < level:
            self._decode_level(self.decoded + 1)
        self._use_exact(self._is_tail(level))
        self.level = level
        return self

    def _is_tail(self, level):
        return self.stream.tail and level + 1 == len(self.stream.levels)

    def _use_exact(self, exact):
        """Exchanges the values on the grid and those of the tail."""
        if exact != self.exact:
            for column in self.columns:
                if column.exact is not None:
                    column.values, column.exact = column.exact, column.values
        self.exact = exact

    def refine(self):
        """One record up; False at the finest level."""
        if self.done == len(self.log):
            if self.exact or not self._is_tail(self.decoded) and self.decoded + 1 == len(self.stream.levels):
                return False
            here = self.done
            if not self._is_tail(self.decoded):
                self._decode_level(self.decoded + 1)
            while self.done > here:
                self._back()
        if self.done < len(self.log):
            self._forward()
        else:
            self._use_exact(True)
        return self._settle()

    def coarsen(self):
        """One record down; False at the base mesh."""
        if self.exact:
            self._use_exact(False)
        elif not self.done:
            return False
        else:
            self._back()
        return self._settle()

    def _settle(self):
        finest = self.decoded - (self._is_tail(self.decoded) and not self.exact)
        self.level = min(self.level, finest)
        while self.level < finest and self.done >= self.ends[self.level + 1]:
            self.level += 1
        while self.level and self.done < self.ends[self.level]:
            self.level -= 1
        return True

    def _exchange(self, vertex, row):
        at = 0
        for column in self.columns:
            for codes, values in zip(column.codes, column.values):
                codes[vertex], row[at] = row[at], codes[vertex]
                values[vertex], row[at + 1] = row[at + 1], values[vertex]
                at += 2

    def _forward(self):
        vertex, row, splits = self.log[self.done]
        for labels, added in splits:
            self._apply(vertex, labels, added)
        self._exchange(vertex, row)
        self.done += 1

    def _back(self):
        self.done -= 1
        vertex, row, splits = self.log[self.done]
        for labels, added in reversed(splits):
            self._undo(vertex, added)
        self._exchange(vertex, row)

    def _apply(self, vertex, labels, added):
        child, star = self.count, self.stars[vertex]
        tets = self.tets_list
        moved = list(itertools.compress(star, labels))
        self.stars[vertex] = [t for t, label in zip(star, labels) if not label]
        for t in moved:
            corners = tets[t]
            corners[corners.index(vertex)] = child
        if child == len(self.stars):
            self.stars.append(moved)
            self.parents.append(vertex)
        else:
            self.stars[child] = moved
        self.count += 1
        for corners in tets[self.tet_count:self.tet_count + added]:
            for c in corners:
                self.stars[c].append(self.tet_count)
            self.tet_count += 1

    def _undo(self, vertex, added):
        child, tets = self.count - 1, self.tets_list
        for _ in range(added):
            self.tet_count -= 1
            for c in tets[self.tet_count]:
                self.stars[c].pop()
        for t in self.stars[child]:
            corners = tets[t]
            corners[corners.index(child)] = vertex
        self.stars[vertex] = sorted(self.stars[vertex] + self.stars[child])
        self.count -= 1

    # ------------------------------------------------ base mesh (SPEC 9)

    def _start(self, level):
        for c, (coder, column) in enumerate(zip(self.coders, self.columns)):
            self.stored[c] += self.stream.frames[level][column.part][1]
            if level not in self.stream.groups:
                coder.start(self.stream.frame(level, column.part))
        self.most_labels = min(
            allowed(FIELD_LABELS if column.part else LABELS, size) // (column.components if column.part else 1)
            for column, size in zip(self.columns, self.stored))

    def _finish(self, level):
        for coder in self.coders:
            coder.finish('level %d' % level)

    def _base(self):
        base = self.stream.levels[0]
        self._take_room(0)
        self._start(0)
        self._grow(base['vertices'], base['tets'])
        self.tet_count, self.count = len(self.tets_list), base['vertices']
        for column, coder in zip(self.columns, self.coders):
            for lists in (column.codes, column.values):
                for values in lists:
                    values.extend([0] * self.count)
            if column.part:
                column.copies(coder)
            self._base_column(column, coder)
        self._finish(0)
        self.leaf = [0] * self.count
        self.parents = list(range(self.count))
        self.stars = [[] for _ in range(self.count)]
        for t, corners in enumerate(self.tets_list):
            for c in corners:
                self.stars[c].append(t)

    def _vertex(self, seen, most):
        coder = self.coders[0]
        if coder.bit(self.models.fresh):
            require(seen[0] < most, 'the base mesh is not one')
            seen[0] += 1
            return seen[0] - 1
        back = coder.number(self.models.vertex, 0)
        require(0 <= back < seen[0], 'the base mesh is not one')
        return seen[0] - 1 - back

    def _grow(self, vertices, count):
        tets, sides, seen, side = self.tets_list, {}, [0], 0

        def arrive(corners):
            require(len(set(corners)) == 4, 'the base mesh is not one')
            tets.append(corners)
            for f in range(4):
                key = frozenset(corners[:f] + corners[f + 1:])
                sides[key] = sides.get(key, 0) + 1

        while len(tets) < count:
            if side == 4 * len(tets):
                arrive([self._vertex(seen, vertices) for _ in range(4)])
                continue
            corners, face = tets[side // 4], side % 4
            side += 1
            if sides[frozenset(corners[:face] + corners[face + 1:])] > 1:
                continue
            if self.coders[0].bit(self.models.across, int(face > 0)):
                vertex = self._vertex(seen, vertices)
                out = list(corners)
                first, second = (1 if face == 0 else 0), (2 if face <= 1 else 1)
                out[face], out[first], out[second] = vertex, corners[second], corners[first]
                arrive(out)

    def _base_column(self, column, coder):
        known = 0
        for corners in self.tets_list:
            for corner in corners:
                if corner == known:
                    self._base_vertex(column, coder, known, corners)
                    known += 1
        while known < self.count:
            self._base_vertex(column, coder, known, ())
            known += 1

    def _base_vertex(self, column, coder, vertex, corners):
        for c in range(column.components):
            codes, values, axis = column.codes[c], column.values[c], column.axis(c)
            source = column.copied[c]
            if source < c:
                codes[vertex], values[vertex] = column.codes[source][vertex], column.values[source][vertex]
                continue
            near = [x for x in corners if x < vertex]
            base, context = 0, 65
            if near:
                total = 0.0
                for x in near:
                    total = total + values[x]
                first = codes[near[0]]
                value = total / float(len(near))
                base = column.scale.code(value, axis) if math.isfinite(value) else first
                if len(near) > 1:
                    context = max(abs(codes[x] - first) for x in near).bit_length()
            models = self.models.corner[axis] if column.part == 0 else column.corner
            codes[vertex] = column.scale.offset(base, coder.number(models, context))
            values[vertex] = column.scale.value(codes[vertex], axis)
            require(math.isfinite(values[vertex]), 'the base mesh holds a value that is not finite')

    # ------------------------------------------------ records (SPEC 7)

    def _decode_level(self, level):
        self._take_room(level)
        self._start(level)
        if self._is_tail(level):
            self._tail()
        if level in self.stream.groups:
            self._decode_group(level, self.stream.groups[level])
        else:
            self._decode_records(level, self.stream.levels[level])
        self.decoded = level
        self.ends.append(self.done)

    def _decode_records(self, level, to):
        """The records of a level, or of a page of it."""
        place, self.start = 0, self.count
        while self.count < to['vertices']:
            place = self._walk(place)
            require(place < self._walk_end(), 'level %d has fewer records than its index says' % level)
            self._record(self._vertex_at(place), to)
        require(self.tet_count == to['tets'], 'level %d has other tetrahedra than its index says' % level)
        self._finish(level)

    def seek_pages(self, chosen):
        """From the root on, in a new cursor: of each level in pages only some, {level: numbers of pages}. They have to
        be a closed set (reference_pages.closure): the pages that they need are among them."""
        self.seek(min(self.stream.groups) - 1)
        for level, group in sorted(self.stream.groups.items()):
            self._take_room(level)
            self._start(level)
            self._decode_group(level, group, chosen.get(level, ()))
        self.decoded = self.level = None  # no level of the stream
        return self

    def _decode_group(self, level, group, chosen=None):
        """A level in pages (SPEC 7.6), or some of its pages."""
        lists, self.seams, pages = self._pages_now(group)
        if chosen is not None:
            self._leave_out(level, group, pages, chosen)
        for number, page in enumerate(group.pages):
            if not page.vertices or chosen is not None and number not in chosen:
                continue
            self.models, self.listed = Models(), lists[number]
            for column, coder in zip(self.columns, self.coders):
                column.restart()
                coder.start(self.stream.frame(level, column.part, number))
            self._decode_records(level, {'vertices': self.count + page.vertices, 'tets': self.tet_count + page.tets})
            pages += [number] * page.tets
        self.listed, self.seams = None, frozenset()
        if chosen is not None:
            self.page_of = [page if page in chosen else None for page in pages]
            require(self._pages_now(group)[2] == self.page_of,
                    'a page of level %d has tetrahedra of another one' % level)

    def _pages_now(self, group):
        return group.lists(self.columns[0].values, self.tets_list[:self.tet_count], self.left_out)

    def _leave_out(self, level, group, pages, chosen):
        """Tetrahedra of pages that are left out; those of others come from pages that these need."""
        for t, page in enumerate(pages):
            if page not in chosen:
                self.left_out.setdefault(t, level)
            elif self.page_of:
                require(self.page_of[t] in group.pages[page].needed,
                        'a page of level %d needs another one, and says not so' % level)

    def _vertex_at(self, place):
        """The vertex at a place of the walk: of a page first those that it has, then those that it adds."""
        if self.listed is None:
            return place
        return self.listed[place] if place < len(self.listed) else self.start + place - len(self.listed)

    def _walk_end(self):
        return self.count if self.listed is None else len(self.listed) + self.count - self.start

    def _walk(self, place):
        """The next place from `place` on of a vertex that splits, or the walk's end (SPEC 7.1)."""
        coder, stars, leaf, end, seams = self.coders[0], self.stars, self.leaf, self._walk_end(), self.seams
        width, code, most, rest = coder.range, coder.code, coder.seen_most, coder.rest
        while place < end:
            vertex = self._vertex_at(place)
            if leaf[vertex] or vertex in seams:
                place += 1
                continue
            chances, counts = self.models.splits[vertex >= self.start]
            i = len(stars[vertex]) >> 2
            if i > 15:
                i = 15
            p, seen = chances[i], counts[i]  # coder.bit, written out
            bound = (width >> 12) * (p >> 4)
            if seen < most:
                counts[i] = seen + 1
            splits = code >= bound
            if splits:
                code -= bound
                width -= bound
                chances[i] = p - (p >> SHIFT[seen])
            else:
                width = bound
                chances[i] = p + ((65536 - p) >> SHIFT[seen])
                place += 1
            while width < 0x1000000:
                width <<= 8
                code = code << 8 | next(rest, 0)
            if splits:
                break
        coder.range, coder.code = width, code
        return place

    def _lay_out(self, vertex):
        """The star: per tetrahedron which of its corners the vertex is, and the others; what takes the link's out of a
        list."""
        star, link, tets = [], {}, self.tets_list
        for t in self.stars[vertex]:
            a, b, c, d = tets[t]
            if a == vertex:
                star.append((0, b, c, d))
                link[b] = link[c] = link[d] = True
            elif b == vertex:
                star.append((1, a, c, d))
                link[a] = link[c] = link[d] = True
            elif c == vertex:
                star.append((2, a, b, d))
                link[a] = link[b] = link[d] = True
            else:
                star.append((3, a, b, c))
                link[a] = link[b] = link[c] = True
        return star, operator.itemgetter(*link) if link else lambda values: ()

    def _record(self, vertex, to):
        coder, models, columns = self.coders[0], self.models, self.columns
        star, link = self._lay_out(vertex)
        children = 2 + coder.tree(models.arity, 2)
        require(children <= 4 and self.count + children - 1 <= to['vertices'], 'a record makes too many vertices')
        codes, placement = self._positions(vertex, children, link, min(len(star) >> 3, 7))
        leaves = []
        for i in range(children):
            leaves.append(coder.bit(models.leaf[placement][1 + leaves[0] if i else 0], min(len(star) >> 2, 15)))
        self.leaf[vertex] = leaves[0]
        self.leaf += leaves[1:]
        first_stays = all(codes[d][0] == columns[0].codes[d][vertex] for d in range(3))
        values = [[columns[0].scale.value(code, d) for code in codes[d]] for d in range(3)]
        points = list(zip(*values))
        self._fields(vertex, leaves, placement, star, link, codes, values, points)
        row, at = [], 0
        for column in columns:
            for c in range(column.components):
                require(all(map(math.isfinite, values[at])), 'a record holds a value that is not finite')
                row += [codes[at][0], values[at][0]]
                column.codes[c].extend(codes[at][1:])
                column.values[c].extend(values[at][1:])
                at += 1
        self._exchange(vertex, row)
        splits = []
        for i in range(1, children):
            if i > 1:
                star, link = self._lay_out(vertex)
            splits.append(self._split(vertex, star, points[0], points[i], first_stays, to))
        self.log.append((vertex, row, splits))
        self.done += 1

    # ---- positions (SPEC 7.2)

    def _step(self, axis, own, near, eighth, trail):
        coder, models, kind = self.coders[0], self.models.step[axis], trail[3]
        if coder.bit(models.none[eighth], trail[0]):
            return 0
        low, high = max(own - min(near, default=own), 0), max(max(near, default=own) - own, 0)
        side = 4 if high // 2 > low else 0 if low // 2 > high else 3 if high > low else 2
        negative = coder.bit(models.side[kind][trail[2]], side)
        trail[2] = 2 if negative else 1
        room = (low if negative else high).bit_length()
        trail[1] = coder.bit(models.level[trail[0]], trail[1])
        if trail[1]:
            rank = coder.tree(models.rank[kind][trail[0]], 6)
            layers = sorted({c for c in near if (c < own if negative else c > own)}, reverse=bool(negative))
            code = layers[min(rank, len(layers) - 1)] if layers else own
            value, length = code - own, abs(code - own).bit_length()
        else:
            length = coder.length(models.length[trail[0]], room)
            require(length, 'a record holds what no writer writes')
            value = coder.below(models.top, length)
            value = -value if negative else value
        trail[0] = max(trail[0], 1 if length + 3 <= room else 2 if length + 2 <= room else 3)
        return value

    def _positions(self, vertex, children, link, eighth):
        coder, column = self.coders[0], self.columns[0]
        placement = coder.tree(self.models.placement, 2)
        require(placement < 3, 'a record holds what no writer writes')
        # far, level, side, kind
        trails, result = [[0, 0, 0, 3 if placement == 2 and i == 0 else placement] for i in range(4)], []
        for axis in range(3):
            known, codes, scale = column.codes[axis], [0] * children, column.scale
            own, near = known[vertex], link(known)
            for i in range(0 if placement == 2 else 1, children):
                codes[i] = scale.offset(own, self._step(axis, own, near, eighth, trails[i]))
            if placement == 0:
                codes[0] = own
            elif placement == 1:
                middle = middle_of(scale, axis, own, codes)
                codes[0] = scale.offset(middle, coder.number(self.models.middle[axis], children))
            result.append(codes)
        return result, placement

    # ---- fields (SPEC 8)

    def _locate(self, vertex, star, point):
        X, Y, Z = self.columns[0].values
        vx, vy, vz = X[vertex], Y[vertex], Z[vertex]
        px, py, pz = point[0] - vx, point[1] - vy, point[2] - vz
        best, found = -math.inf, None
        for _, i, j, k in star:
            ax, ay, az = X[i] - vx, Y[i] - vy, Z[i] - vz
            bx, by, bz = X[j] - vx, Y[j] - vy, Z[j] - vz
            cx, cy, cz = X[k] - vx, Y[k] - vy, Z[k] - vz
            nx, ny, nz = by * cz - bz * cy, bz * cx - bx * cz, bx * cy - by * cx
            volume = (ax * nx + ay * ny) + az * nz
            scale = 1 / volume if volume else math.copysign(math.inf, volume)
            w0 = ((px * nx + py * ny) + pz * nz) * scale
            if w0 <= best:  # the least weight is no larger
                continue
            mx, my, mz = py * az - pz * ay, pz * ax - px * az, px * ay - py * ax
            w1 = ((cx * mx + cy * my) + cz * mz) * scale
            w2 = 0 - ((bx * mx + by * my) + bz * mz) * scale
            least = 1 - ((w0 + w1) + w2)
            least = w0 if w0 < least else least
            least = w1 if w1 < least else least
            least = w2 if w2 < least else least
            if least > best:
                best, found = least, (i, j, k, w0, w1, w2)
                if best >= 0:
                    break
        return found

    def _fields(self, vertex, leaves, placement, star, link, codes, all_values, points):
        if len(self.columns) == 1:
            return
        children = len(leaves)
        own = [self.columns[0].codes[d][vertex] for d in range(3)]
        where = [None if [codes[d][i] for d in range(3)] == own else self._locate(vertex, star, points[i])
                 for i in range(children)]
        for column, coder in zip(self.columns[1:], self.coders[1:]):
            scale, first = column.scale, len(codes)
            for c in range(column.components):
                if column.copied[c] < c:
                    codes.append(codes[first + column.copied[c]])
                    all_values.append(all_values[first + column.copied[c]])
                    continue
                known, values = column.codes[c], column.values[c]
                mine, here = known[vertex], values[vertex]
                near = link(known) or (mine,)
                extent = max(max(near) - mine, mine - min(near)).bit_length()
                bases, result = [], [0] * children
                for i in range(children):
                    base = mine
                    if where[i]:
                        p, q, r, w0, w1, w2 = where[i]
                        value = here + w0 * (values[p] - here)
                        value = value + w1 * (values[q] - here)
                        value = value + w2 * (values[r] - here)
                        base = scale.code(value) if math.isfinite(value) else mine
                    bases.append(base)
                for i in range(1, children):
                    result[i] = self._value(column, coder, c, 0, leaves[i], bases[i], extent)
                if placement < 2 and coder.bit(column.kept[placement], leaves[0]):
                    result[0] = mine
                    if placement == 1:
                        middle = middle_of(scale, 0, mine, result)
                        result[0] = scale.offset(middle, coder.tree(column.nudge, 2) - 1)
                else:
                    result[0] = self._value(column, coder, c, 1, leaves[0], bases[0], extent)
                codes.append(result)
                all_values.append([scale.value(code) for code in result])

    @staticmethod
    def _value(column, coder, c, first, leaf, base, extent):
        """A child's code; one that a contraction made ends in a number of zero bits."""
        scale = column.scale
        if leaf or not scale.bits:
            return scale.offset(base, coder.number(column.child[leaf][first], extent))
        zeros, most = coder.tree(column.zeros[column.last_zeros[c]], 4), min(scale.bits - 1, 15)
        require(zeros <= most, 'a record holds what no writer writes')
        column.last_zeros[c] = zeros
        shift = min(zeros + 1, most)
        if zeros < most:
            base = (base >> shift << shift) + (1 << zeros)
        else:
            base = base + (1 << most >> 1) >> most << most
        return scale.offset(base, coder.number(column.child[0][first], max(extent - shift, 0)) << shift)

    # ---- the exact tail (SPEC 9.3)

    def _tail(self):
        for column, coder in zip(self.columns, self.coders):
            if column.part and self.stream.fields[column.part - 1]['exact_later']:
                kinds, digits, sources = bits(4), bits(32), bits(64)
                models = bits(2), bits(1), (Number(), Number(), Number()), [bits(1 << wide) for wide in range(13)]
                column.exact = []
                for c in range(column.components):
                    kind, source = coder.tree(kinds, 2), c
                    near = kind == 3
                    if near:
                        source = coder.tree(sources, 6)
                        require(source <= c, 'a component repeats a later one')
                    if source < c:
                        column.exact.append(column.exact[source])
                        continue
                    if near:
                        kind = coder.tree(kinds, 2)
                    digit = coder.tree(digits, 5) if kind else 0
                    require(kind < 3 and digit <= 15 and (kind < 2 or digit), 'numbers of an unknown kind')
                    column.exact.append(self._exact(column, coder, c, Numbers(kind, digit, column.scale), near, models))

    @staticmethod
    def _exact(column, coder, c, numbers, near, models):
        scale, half, floats = column.scale, 0.5 * column.scale.step[0], Numbers(0, 0, column.scale)
        (repeat, odd, distances, wides), memory, result = models, {}, []
        for code in column.codes[c]:
            place = code % (65536 if near else 4096)
            known = memory.get(place)
            known = known if known and known[0] == code else None
            if known:
                known[2] = coder.bit(repeat, known[2])
                if known[2]:
                    result.append(known[1])
                    continue
            kind = floats if not numbers.kind or coder.bit(odd) else numbers
            if near and known:
                value, chosen, room = known[1], distances[2], 0
            else:
                value, chosen = scale.value(code), distances[kind.kind > 0]
                room = abs(kind.code(value + half) - kind.code(value - half)).bit_length()
            distance = coder.distance(chosen, wides, kind.width, room)
            exact = kind.value(in_ring(kind.code(value) + distance, kind.width, True))
            require(math.isfinite(exact), 'the tail holds a value that is not finite')
            memory[place] = [code, exact, 0]
            result.append(exact)
        return result

    # ---- labels and tetrahedra (SPEC 7.3, 7.4)

    def _labels(self, star, a, b, first_stays):
        """The label of each tetrahedron of the star, and the link's edges in the order in which they are met: of each
        8 * (3 * the place of its first tetrahedron + which of that one's other corners is not on it), 4 if there are
        more tetrahedra than that one, 2 if one goes, 1 if one stays."""
        X, Y, Z = self.columns[0].values
        coder, (chances, counts), vertices = self.coders[0], self.models.label, self.count
        width, code, most, rest = coder.range, coder.code, coder.seen_most, coder.rest
        a0, a1, a2 = a
        b0, b1, b2 = b
        d0, d1, d2 = b0 - a0, b1 - a1, b2 - a2
        m0, m1, m2 = 1.5 * (a0 + b0), 1.5 * (a1 + b1), 1.5 * (a2 + b2)
        length2 = (d0 * d0 + d1 * d1) + d2 * d2
        bounds = [s * length2 for s in STEPS]
        labels, edges, base = [], {}, 640 if first_stays else 0
        known = edges.get
        for tet, (place, i, j, k) in enumerate(star):
            x, y, z, xj, yj, zj, xk, yk, zk = X[i], Y[i], Z[i], X[j], Y[j], Z[j], X[k], Y[k], Z[k]
            ux, uy, uz, vx, vy, vz = xj - x, yj - y, zj - z, xk - x, yk - y, zk - z
            nx, ny, nz = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
            va = (nx * (a0 - x) + ny * (a1 - y)) + nz * (a2 - z)
            vb = (nx * (b0 - x) + ny * (b1 - y)) + nz * (b2 - z)
            if place & 1:
                va, vb = -va, -vb
            nearer = ((((x + xj) + xk) - m0) * d0 + (((y + yj) + yk) - m1) * d1) + (((z + zj) + zk) - m2) * d2
            n = base + 10 * bisect_left(bounds, nearer)
            if va < 0:
                n += 80
            if vb < 0:
                n += 160
            if va * va > vb * vb:
                n += 320
            key0 = j * vertices + k if j < k else k * vertices + j
            key1 = i * vertices + k if i < k else k * vertices + i
            key2 = i * vertices + j if i < j else j * vertices + i
            edge0, edge1, edge2 = known(key0), known(key1), known(key2)
            edge0 = 24 * tet if edge0 is NONE else edge0 | 4
            edge1 = 24 * tet + 8 if edge1 is NONE else edge1 | 4
            edge2 = 24 * tet + 16 if edge2 is NONE else edge2 | 4
            n += NEIGHBOURS[(edge0 & 3) << 4 | (edge1 & 3) << 2 | edge2 & 3]
            p, seen = chances[n], counts[n]  # coder.bit, written out
            bound = (width >> 12) * (p >> 4)
            if seen < most:
                counts[n] = seen + 1
            if code >= bound:
                code -= bound
                width -= bound
                chances[n] = p - (p >> SHIFT[seen])
                labels.append(1)
                mark = 2
            else:
                width = bound
                chances[n] = p + ((65536 - p) >> SHIFT[seen])
                labels.append(0)
                mark = 1
            while width < 0x1000000:
                width <<= 8
                code = code << 8 | next(rest, 0)
            edges[key0], edges[key1], edges[key2] = edge0 | mark, edge1 | mark, edge2 | mark
        coder.range, coder.code = width, code
        return labels, edges.values()

    def _between(self, star, vertex, child, edge, labels):
        i, c = divmod(edge >> 3, 3)
        place = star[i][0]
        opposite = c + (c >= place)
        own, other = (child, vertex) if labels[i] else (vertex, child)
        return replaced(self.tets_list[self.stars[vertex][i]], place, opposite, own, other)

    def _positive(self, corners):
        X, Y, Z = self.columns[0].values
        p, q, r, s = corners
        ax, ay, az = X[q] - X[p], Y[q] - Y[p], Z[q] - Z[p]
        bx, by, bz = X[r] - X[p], Y[r] - Y[p], Z[r] - Z[p]
        cx, cy, cz = X[s] - X[p], Y[s] - Y[p], Z[s] - Z[p]
        nx, ny, nz = by * cz - bz * cy, bz * cx - bx * cz, bx * cy - by * cx
        return (ax * nx + ay * ny) + az * nz > 0

    def _split(self, vertex, star, a, b, first_stays, to):
        coder, models, child = self.coders[0], self.models, self.count
        self.labels += len(star)
        require(self.labels <= self.most_labels, 'records that split larger stars than go with their bytes')
        labels, edges = self._labels(star, a, b, first_stays)
        irregular = coder.bit(models.irregular)
        added = []
        for edge in edges:
            if 4 <= edge & 7 < 7 and not irregular:
                continue  # inside, between tetrahedra that all stay or all go
            corners, differ = None, edge & 3 == 3
            if not edge & 4:
                corners = self._between(star, vertex, child, edge, labels)
                context = (first_stays * 2 + labels[edge // 24]) * 2 + self._positive(corners)
                made = coder.bit(models.boundary, context)
            elif irregular:
                made = coder.bit(models.made, int(differ))
            else:
                made = differ
            if made:
                corners = corners or self._between(star, vertex, child, edge, labels)
                if irregular and coder.bit(models.flip):
                    corners[0], corners[1] = corners[1], corners[0]
                added.append(corners)
        if irregular:
            count = coder.number(models.extra, 0)
            require(0 <= count <= to['tets'] - self.tet_count, 'a record brings back too many tetrahedra')
            for _ in range(count):
                x, y = coder.number(models.extra, 1), coder.number(models.extra, 1)
                require(0 <= x < self._walk_end() and 0 <= y < self._walk_end(), 'a record names a wrong vertex')
                x, y = self._vertex_at(x), self._vertex_at(y)
                require(len({x, y, vertex}) == 3, 'a record names a wrong vertex')
                added.append([vertex, child, x, y])
        require(self.tet_count + len(added) <= to['tets'], 'a record brings back too many tetrahedra')
        self.tets_list.extend(added)
        self._apply(vertex, labels, len(added))
        return labels, len(added)


def main():
    import argparse
    parser = argparse.ArgumentParser(description='Decodes one level of a tetlod stream into numpy arrays.')
    parser.add_argument('stream', help='a file or an http(s) URL')
    parser.add_argument('--error', type=float, help='the coarsest level within this fraction of the range')
    parser.add_argument('--level', type=int, help='this level (default: the finest)')
    parser.add_argument('-o', '--output', help='an .npz file: positions, tets and every field')
    options = parser.parse_args()
    stream = open(options.stream)
    level = len(stream.levels) - 1 if options.level is None else options.level
    if options.error is not None:
        level = stream.level_for_error(options.error)
    cursor = stream.cursor().seek(level)
    print('%s: level %d of %d, %d vertices, %d tetrahedra' %
          (options.stream, level, len(stream.levels) - 1, cursor.count, cursor.tet_count))
    if options.output:
        fields = {f['name']: cursor.field(f['name']) for f in stream.fields}
        np.savez(options.output, positions=cursor.positions, tets=cursor.tets, **fields)


if __name__ == '__main__':
    try:
        main()
    except (StreamError, OSError, KeyError, ValueError) as error:
        sys.exit('tetlod.reference: %s' % error)
