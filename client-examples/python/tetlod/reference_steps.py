# SPDX-License-Identifier: BSD-3-Clause
"""Reads the steps in time of a tetlod stream (SPEC 3.7); numpy only. A part of tetlod.reference.

    stream = reference.open('wake.tetlod')
    series = stream.series()                       # None: the stream has one moment only
    step = series.step_for_time(0.5)
    cursor, values = series.seek(series.band_for_step(step, 0.01), step)
    series.points(), cursor.tets, values['Pressure']
    series.cells('Pressure', 3)[:len(cursor.tets)]  # None: it has no steps, and is known at the first one only
"""
import math

import numpy as np

from .reference import (LISTED, STEP_ROWS, Bytes, Coder, Number, Scale, allowed, bits, digest, in_ring,
                        require)

GROUP, KEY, SAME, MOVED = 8, 0, 1, 2
LIMITS = {'int8': 1 << 7, 'int16': 1 << 15, 'int32': 1 << 31, 'int64': 1 << 53}  # of whole numbers of cells


class Series:
    def __init__(self, stream, table):
        self.stream, data = stream, Bytes(table)
        fields, bands, steps, displacement = data.take('IIII')
        groups, rows = (steps + GROUP - 1) // GROUP, fields * bands
        require(0 < fields <= 256 and 0 < bands <= 64 and 0 < steps <= 1 << 20 and displacement <= fields,
                'a series beyond the limits')
        size = 16 + 24 * fields + 16 * bands + 8 * (rows + steps + rows * steps) + 16 * rows * groups
        require(len(table) == size, 'the table of steps has another length')
        self.fields = [self._field(data) for _ in range(fields)]
        self.displacement = self.fields[displacement - 1] if displacement else None
        require(not displacement or self.displacement['components'] == 3,
                'points that move in other than three directions')
        require(len({field['field'] for field in self.fields}) == fields, 'a field has steps twice')
        self.bands = [dict(zip(('error', 'level'), data.take('dQ'))) for _ in range(bands)]
        for band, before in zip(self.bands, [None] + self.bands):
            require(0 <= band['error'] < math.inf and band['level'] < len(stream.levels), 'a band of no level')
            require(before is None or band['error'] < before['error'] and band['level'] >= before['level'],
                    'bands that do not fall')
            level = stream.levels[band['level']]
            require(band['error'] or (level['vertices'], level['tets']) == (stream.vertices, stream.tets),
                    'an exact band below the finest level')
        self._quanta = [data.take('d') for _ in range(rows)]
        require(all(0 <= quantum <= 2.0 ** 900 for quantum in self._quanta), 'a grid that is none')
        self.times = [data.take('d') for _ in range(steps)]
        require(all(map(math.isfinite, self.times)) and self.times == sorted(self.times), 'times that fall')
        require(stream.group_times in (None, tuple(self.times)), 'other steps than the table of topology groups says')
        self._entries = [[data.take('If') for _ in range(steps)] for _ in range(rows)]
        require(all(0 <= error < math.inf for row in self._entries for _, error in row),
                'a step with an error that is none')
        self._digests = [[data.take('16s') for _ in range(groups)] for _ in range(rows)]
        self._sections = [section for section in stream.sections if section['tag'] == 'TVAL']
        sizes = [sum(size for size, _ in row) for row in self._entries]
        require([(s['stored'], s['packed']) for s in self._sections] == [(size, False) for size in sizes],
                'the table of steps does not go with the stream')
        levels = [stream.levels[band['level']] for band in self.bands]
        counted = sum(field['components'] for field in self.fields) * sum(level['vertices'] +
                                                                          level['tets'] for level in levels) * steps
        require(counted <= allowed(STEP_ROWS, sum(sizes)), 'more steps than their bytes can hold')
        self._cursor, self._lower, self._found = None, {}, {}
        cells = stream.section('PTIM' if stream.cell_rows else 'CTIM')
        self._cells = None if cells is None else CellSteps(stream, cells, steps)

    def _field(self, data):
        number, kind, low, high = data.take('IIdd')
        require(number < len(self.stream.fields) and kind < 2, 'steps of no field')
        require(math.isfinite(low) and math.isfinite(high) and low <= high, 'steps without a range')
        return {'field': number, 'name': self.stream.fields[number]['name'], 'type': kind, 'range': [low, high],
                'components': self.stream.fields[number]['components']}

    def band_for_error(self, error):
        """The coarsest band within the error; None if there is none."""
        return next((number for number, band in enumerate(self.bands) if band['error'] <= error), None)

    def band_for_step(self, step, error):
        """The coarsest band in which the step's own errors, those of all fields, are at most `error`; of a series whose
        errors are fractions of each step's own range (SPEC 3.7), the bands' hold. None if there is none."""
        options = self.stream.metadata.get('options')
        if isinstance(options, dict) and options.get('series_range') == 'step':
            return self.band_for_error(error)
        fields = range(len(self.fields))
        within = (band for band in range(len(self.bands)) if all(self.error(band, step, f) <= error for f in fields))
        return next(within, None)

    def step_for_time(self, time):
        return min(range(len(self.times)), key=lambda step: abs(self.times[step] - time))

    def error(self, band, step, field=0):
        """A bound, as a fraction of the field's range over the series."""
        return min(self._entries[field * len(self.bands) + band][step][1], self.bands[band]['error'])

    def seek(self, band, step):
        """A cursor at the band's level, without fields, and the values there by name."""
        self._cursor = self._cursor or self.stream.cursor([])
        level = self.bands[band]['level']
        self._cursor.seek(level)
        if level not in self._lower:
            self._lower = {level: lower_neighbours(self._cursor)}
        self._found = {field['name']: self._values(number, band, step) for number, field in enumerate(self.fields)}
        return self._cursor, self._found

    def points(self):
        """Where the points are at the step that was sought last."""
        if not self.displacement:
            return self._cursor.positions
        points = self._cursor.positions + self._found[self.displacement['name']]
        points = points.astype(np.float32).astype(np.float64) if not self.stream.scales[0].original else points
        require(np.isfinite(points).all(), 'a step moves a point out of all numbers')
        return points

    def has_cells(self, name, step):
        return step == 0 or bool(self._cells) and name in self._cells.names

    def cells(self, name, step):
        """The values of all tetrahedra at a step, or None."""
        if step == 0:
            return self.stream.cells(name)
        return self._cells.values(name, step) if self.has_cells(name, step) else None

    def _values(self, number, band, step):
        row, begin = number * len(self.bands) + band, step // GROUP * GROUP
        sizes = [size for size, _ in self._entries[row]]
        offset = self._sections[row]['offset'] + sum(sizes[:begin])
        group = self.stream._part('a group of steps', offset, sum(sizes[begin:begin + GROUP]),
                                  self._digests[row][begin // GROUP])
        field, there = self.fields[number], self.stream.levels[self.bands[band]['level']]
        self.stream.budget.need(2 * LISTED * field['components'] * there['vertices'], 'a step')
        steps = Steps(self._lower[self.bands[band]['level']], field['type'],
                      self._quanta[band * len(self.fields) + number], field['components'])
        for size in sizes[begin:step + 1]:
            steps.decode(group[:size])
            group = group[size:]
        values = np.array([[steps.value(code) for code in codes] for codes in steps.codes]).T
        return values[:, 0] if field['components'] == 1 else values


def lower_neighbours(cursor):
    """Of each vertex the vertices of lower numbers that it shares a tetrahedron with, ascending."""
    lower = [set() for _ in range(cursor.count)]
    for corners in cursor.tets.tolist():
        for a in corners:
            lower[a].update(b for b in corners if b < a)
    return [sorted(vertices) for vertices in lower]


class Steps:
    """One field in one group."""

    def __init__(self, lower, kind, quantum, components):
        self.lower, self.quantum, self.scale = lower, quantum, Scale(Bytes(bytes([kind, 0])), 1)
        self.codes, self.first = [[0] * len(lower) for _ in range(components)], True
        self.mode, self.models, self.coder = bits(4), (Number(), Number()), Coder((1 << 7) - 2)
        self.width = 64 if quantum else self.scale.width

    def value(self, code):
        return self.scale.rounded(self.quantum * float(code)) if self.quantum else self.scale.float_value(code)

    def decode(self, frame):
        self.coder.start(frame)
        mode = self.coder.tree(self.mode, 2)
        require(mode <= MOVED and (mode == KEY or not self.first), 'a step is predicted from none')
        for codes in self.codes:
            self._component(mode, codes)
        self.first = False
        self.coder.finish('a step')

    def _number(self, code):
        return float(code) if self.quantum else self.scale.float_value(code)

    def _component(self, mode, codes):
        before = [self._number(code) for code in codes] if mode else None
        now, lengths = [], []
        for v, lower in enumerate(self.lower):
            x = self._predict(mode, v, lower, before, now)
            near = math.floor(x + 0.5) if self.quantum else self.scale.float_code(x)
            if lower:
                context = 2 * sum(lengths[n] for n in lower) // len(lower)
            else:
                context = 2 * lengths[v - 1] if v else 0
            number = self.coder.number(self.models[mode != KEY], min(context, 65))
            codes[v] = in_ring(near + number, self.width, True)
            require(not self.quantum or abs(codes[v]) <= 1 << 30, 'a step holds a code that is none')
            require(math.isfinite(self.value(codes[v])), 'a step holds a value that is not finite')
            now.append(self._number(codes[v]))
            lengths.append(abs(number).bit_length())

    @staticmethod
    def _predict(mode, v, lower, before, now):
        rest = before[v] if mode else now[v - 1] if v else 0.0
        if mode == SAME or not lower:
            return rest
        total = 0.0
        for n in lower:
            total += now[n] - before[n] if mode else now[n]
        mean = total / len(lower)
        x = rest + mean if mode else mean
        return x if math.isfinite(x) else rest


# ---- values of cells

class CellSteps:
    """The table, and the steps of each field by its name."""

    def __init__(self, stream, table, steps):
        tags = [section['tag'] for section in stream.sections]
        table_tag, tag = ('PTIM', 'PSTP') if stream.cell_rows else ('CTIM', 'CSTP')
        require(tags[tags.index(table_tag) - 1] == 'TIME',
                'a table of cells\' steps that does not follow that of steps')
        self._stream, self.names, self.ranges, data = stream, [], {}, Bytes(table)
        fields, count = data.take('II')
        require(0 < fields <= 256 and count == steps, 'a table of cells\' steps beyond the limits')
        groups, numbers = (steps + GROUP - 1) // GROUP, []
        size = 8 + fields * (24 + 8 * steps + 16 * groups)
        require(len(table) == size, 'the table of cells\' steps has another length')
        for _ in range(fields):
            number, low, high = data.take('Qdd')
            require(number < len(stream.cell_fields) and number > max(numbers, default=-1), 'steps of no cell field')
            require(math.isfinite(low) and math.isfinite(high) and low <= high, 'steps of cells without a range')
            numbers.append(number)
            self.names.append(stream.cell_fields[number]['name'])
            self.ranges[self.names[-1]] = [low, high]
        self._sizes = [[data.take('Q') for _ in range(steps)] for _ in range(fields)]
        require(all(sizes[0] == 0 and max(sizes) <= 1 << 40 for sizes in self._sizes), 'a frame of the first step')
        self._digests = [[data.take('16s') for _ in range(groups)] for _ in range(fields)]
        self._sections = [section for section in stream.sections if section['tag'] == tag]
        require([(s['stored'], s['packed']) for s in self._sections] == [(sum(sizes), False) for sizes in self._sizes],
                'the table of cells\' steps does not go with the stream')
        coded = sum(stream.cell_fields[number]['components'] * sum(map(bool, sizes))
                    for number, sizes in zip(numbers, self._sizes))
        require(coded * (stream.cell_rows or stream.tets) <= allowed(STEP_ROWS, sum(map(sum, self._sizes))),
                'more steps of cells than their bytes can hold')

    def values(self, name, step):
        """Of all tetrahedra, as stream.cells."""
        first, row, begin = self._stream.cell_values(name), self.names.index(name), step // GROUP * GROUP
        sizes, offset = self._sizes[row], self._sections[row]['offset'] + sum(self._sizes[row][:begin])
        size = sum(sizes[begin:begin + GROUP])
        wanted = self._digests[row][begin // GROUP] if size else digest(b'')
        group = self._stream._part('a group of steps of cells', offset, size, wanted)
        self._stream.budget.need(2 * LISTED * first.size, 'a step of cells')
        steps = CellGroup(first)
        for size in sizes[begin:step + 1]:
            if size:
                steps.decode(group[:size])
            group = group[size:]
        return self._stream.spread(steps.values())


class CellGroup:
    """One field in one group: begins at the first step."""

    def __init__(self, first):
        self.type, self.shape = first.dtype, first.shape
        self.limit = LIMITS.get(first.dtype.newbyteorder('=').name)  # None of floats
        self.width = 32 if first.dtype.itemsize == 4 and not self.limit else 64
        self.codes = [self._codes(column) for column in first.reshape(len(first), -1).T]
        self.mode, self.models, self.coder = bits(4), (Number(), Number()), Coder((1 << 7) - 2)

    def _codes(self, values):
        if self.limit:
            return values.tolist()
        sign = 1 << self.width - 1
        plain = np.ascontiguousarray(values).view('<u%d' % (self.width // 8)).tolist()
        return [code if code < sign else -1 - (code - sign) for code in plain]

    def values(self):
        columns = self.codes
        if not self.limit:
            sign = 1 << self.width - 1
            columns = [[code if code >= 0 else sign + (-1 - code) for code in codes] for codes in columns]
        kind = self.type if self.limit else '<u%d' % (self.width // 8)
        return np.ascontiguousarray(np.array(columns, kind).T).view(self.type).reshape(self.shape)

    def decode(self, frame):
        self.coder.start(frame)
        mode = self.coder.tree(self.mode, 2)
        require(mode <= MOVED, 'a step of cells of an unknown kind')
        self.codes = [self._component(mode, codes) for codes in self.codes]
        self.coder.finish('a step of cells')

    def _component(self, mode, before):
        now, lengths = [], []
        for t, code in enumerate(before):
            if mode == KEY:
                near = now[t - 1] if t else 0
            else:
                near = code + (now[t - 1] - before[t - 1] if mode == MOVED and t else 0)
            context = min(lengths[t - 1] + lengths[max(t - 2, 0)], 65) if t else 0
            number = self.coder.number(self.models[mode != KEY], context)
            now.append(in_ring(near + number, self.width, True))
            lengths.append(abs(number).bit_length())
            require(not self.limit or -self.limit <= now[-1] < self.limit + (self.limit == 1 << 53),
                    'a number that its type does not hold')
        return now
