# SPDX-License-Identifier: BSD-3-Clause
"""Reads the cells that were split into tetrahedra (SPEC 10.1); numpy only. A part of tetlod.reference.

    stream = reference.open('hexahedra.tetlod')
    cells = stream.original_cells()                # None: the stream does not keep them
    cells.points, cells.types, cells.offsets, cells.connectivity, cells.field('p'), cells.values('material')
"""
import numpy as np

from .reference import require

POLYHEDRON = 42


class Words:
    def __init__(self, data):
        require(len(data) % 4 == 0, 'the original cells are damaged')
        self.all, self.at = np.frombuffer(data, '<u4'), 0

    def take(self, count):
        require(self.at + count <= len(self.all), 'the original cells are damaged')
        self.at += count
        return self.all[self.at - count:self.at]

    def sums(self, count):
        """Numbers that are given as differences, modulo 2^32."""
        return np.cumsum(self.take(count), dtype=np.uint32)

    def values(self, components, rows, kind):
        if kind == 0:
            return np.full((rows, components), np.nan)
        words = self.take(components * rows * kind).reshape(components, kind, rows)
        if kind == 1:
            return np.ascontiguousarray(words[:, 0].T).view('<f4').astype('f8')
        wide = words[:, 0] + (words[:, 1].astype('<u8') << np.uint64(32))
        return np.ascontiguousarray(wide.T).view('<f8')


class OriginalCells:
    def __init__(self, stream, data):
        words, self._stream, cursor = Words(data), stream, stream.cursor()
        cursor.seek(len(stream.levels) - 1)
        vertices, self._tets, _ = stream.order()
        count, corners, further, fields, kind = (int(word) for word in words.take(5))
        require(count > 0 and kind in (1, 2) and fields <= len(stream.fields), 'the original cells are damaged')
        kinds = words.take(fields)
        require(all(kind <= 2 for kind in kinds), 'the original cells are damaged')
        self.types, sizes = words.sums(count), words.sums(count)
        require(self.types.max() < 256 and sizes.min() >= 4 and sizes.sum(dtype='u8') == corners,
                'the original cells are damaged')
        self.offsets = np.concatenate([[0], np.cumsum(sizes, dtype='i8')])
        self.connectivity = self._connectivity(words.take(corners), sizes)
        self.parents = words.sums(stream.tets)  # by the original's numbers of tetrahedra
        require(np.array_equal(np.unique(self.parents), np.arange(count)), 'the original cells are damaged')
        places = words.sums(further).astype('i8')
        self._number_points(stream.vertices, further, places)
        rows = [(cursor.positions, 3, kind)]
        rows += [(cursor.field(field['name']), field['components'], kinds[number] if number < fields else 0)
                 for number, field in enumerate(stream.fields)]
        columns = [self._merge(np.reshape(values, (stream.vertices, -1)), vertices,
                               words.values(components, further, kind))
                   for values, components, kind in rows]
        require(words.at == len(words.all), 'the original cells are damaged')
        self.points, self._fields = columns[0], dict(zip([field['name'] for field in stream.fields], columns[1:]))

    def _connectivity(self, words, sizes):
        """Each number as the difference from the one at its place in the cell before, if that has as many, else from
        the number before."""
        words, out, begin, last = words.tolist(), [], 0, 0
        for size in sizes.tolist():
            back = size if size == last else 1
            for i in range(begin, begin + size):
                out.append((words[i] + (out[i - back] if i >= back else 0)) & 0xffffffff)
            begin, last = begin + size, size
        return out

    def _points_of(self, cell):
        """Where the numbers of points are in the connectivity."""
        begin, end = int(self.offsets[cell]), int(self.offsets[cell + 1])
        if self.types[cell] != POLYHEDRON:
            return range(begin, end)
        places, at = [], begin + 1
        for _ in range(self.connectivity[begin]):
            require(at < end and self.connectivity[at] < end - at, 'the faces of a polyhedron do not fit')
            places += range(at + 1, at + 1 + self.connectivity[at])
            at += 1 + self.connectivity[at]
        require(at == end, 'the faces of a polyhedron do not fit')
        return places

    def _number_points(self, vertices, further, places):
        where = [place for cell in range(len(self.types)) for place in self._points_of(cell)]
        self._wanted = np.zeros(vertices + further, bool)
        named = np.array([self.connectivity[place] for place in where])
        require(named.max() < vertices + further, 'a cell of a point that is not there')
        self._wanted[named] = True
        require(self._wanted[vertices:].all() and np.all(np.diff(places) > 0), 'further points that no cell has')
        count = int(self._wanted.sum())
        require(not further or places[-1] < count, 'further points that no cell has')
        self._names = np.zeros(vertices + further, 'i8')
        self._names[vertices:] = places
        self._names[np.flatnonzero(self._wanted[:vertices])] = np.setdiff1d(np.arange(count), places)
        for place in where:
            self.connectivity[place] = int(self._names[self.connectivity[place]])

    def _merge(self, values, vertices, further):
        rows = np.concatenate([np.empty_like(values), further])
        rows[vertices] = values
        out = np.empty((int(self._wanted.sum()), values.shape[1]))
        out[self._names[self._wanted]] = rows[self._wanted]
        return out

    def field(self, name):
        return self._fields[name]

    def values(self, name):
        """Of a field of cells: a row for each cell."""
        tets, rows = self._stream.cells(name), np.empty(self._stream.tets, 'i8')
        rows[self._tets] = np.arange(self._stream.tets)  # the stream's number of the original's tetrahedron
        _, first = np.unique(self.parents, return_index=True)
        return tets[rows[first]]
