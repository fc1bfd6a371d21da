# SPDX-License-Identifier: BSD-3-Clause
"""Levels in pages (format/SPEC.md, 7.6): the section PAGE, and which tetrahedra and vertices a page has."""
import math
import struct

import numpy as np

from .reference import require

MAX_CUTS, BYTES_A_PAGE, PAGES_FREE, BOX_STEPS = 64, 256, 64, 65535


class Page:
    def __init__(self, stream, data):
        self.vertices, self.tets, *self.box, needed = data.take('II6HI')
        self.frames = [data.take('I16s') for _ in range(1 + len(stream.fields))]
        self.offsets = [0] * len(self.frames)  # of them in the stream
        self.needed = [None] * needed  # pages of the group before: their numbers follow behind all rows
        empty = not self.tets and not any(size for size, _ in self.frames)
        ordered = all(map(int.__le__, self.box[:3], self.box[3:]))
        require((self.vertices or empty) and ordered, 'a page that contradicts itself')


class Group:
    """A level in pages. `tree` has (axis, at, the node that `at` and what is above goes to), or a page's number."""

    def __init__(self, level, count, nodes):
        self.level, self.count, self.nodes, self.tree, self.pages = level, count, nodes, [], []

    def read_tree(self, data):
        wrong, open_cuts, depth, pages = 'a tree of cuts that is none', [], 0, 0
        for i in range(self.nodes):
            axis, at = data.take('B4s')
            at = struct.unpack('<f', at)[0] if axis < 3 else at
            if axis < 3:
                require(math.isfinite(at) and depth < MAX_CUTS, wrong)
                depth += 1
                open_cuts.append((i, depth))
                self.tree.append((axis, at, None))
                continue
            require(axis == 3 and at == bytes(4) and bool(open_cuts) == (i + 1 < self.nodes), wrong)
            self.tree.append(pages)
            pages += 1
            if open_cuts:
                cut, depth = open_cuts.pop()
                self.tree[cut] = (*self.tree[cut][:2], i + 1)

    def page_at(self, middle):
        node = self.tree[0]
        at = 0
        while isinstance(node, tuple):
            at = at + 1 if middle[node[0]] < node[1] else node[2]
            node = self.tree[at]
        return node

    def place(self, at):
        """Geometry and the first field lie page by page, and so does each other field behind them."""
        parts = range(len(self.pages[0].frames))
        for some in [parts[:2]] + [[part] for part in parts[2:]]:
            for page in self.pages:
                for part in some:
                    page.offsets[part] = at
                    at += page.frames[part][0]

    def lists(self, positions, tets, left_out):
        """Of each page the vertices of its tetrahedra, ascending; those at seams; and each tetrahedron's page.
        Tetrahedra of pages that were left out before are in none."""
        found, seams, page_of, tet_pages = [set() for _ in self.pages], set(), {}, []
        for t, corners in enumerate(tets):
            axes = [[values[c] for c in corners] for values in positions]
            page = None if t in left_out else self.page_at([(min(axis) + max(axis)) / 2 for axis in axes])
            tet_pages.append(page)
            for c in corners:
                if page is None or page_of.setdefault(c, page) != page:
                    seams.add(c)
                if page is not None:
                    found[page].add(c)
        return [sorted(vertices) for vertices in found], seams, tet_pages


class Pages:
    """The table. `groups` by the number of their level."""

    def __init__(self, stream, data):
        levels = len(stream.levels) - stream.tail
        first, count = data.take('II')
        require(0 < first < levels and count == levels - first, 'groups of pages that are not the last levels')
        groups = [Group(first + g, *data.take('II')) for g in range(count)]
        for before, group in zip([None] + groups, groups):
            own, shared = group.nodes == 2 * group.count - 1, group.nodes == 0 and before and before.count == group.count
            require(group.count and (own or shared), 'a group without a tree')
        for before, group in zip([None] + groups, groups):
            group.read_tree(data)
            group.tree = group.tree or before.tree
        rows = sum(group.count for group in groups) * (24 + 20 * (1 + len(stream.fields)))
        require(rows <= len(data.data) - data.at, 'a table of pages that is too short')
        for group in groups:
            group.pages = [Page(stream, data) for _ in range(group.count)]
        for before, group in zip([None] + groups, groups):
            for page in group.pages:
                page.needed = [data.take('I') for _ in page.needed]
                there = all(number < (before.count if before else 0) for number in page.needed)
                require(there and page.needed == sorted(set(page.needed)),
                        'a page that needs another one that is not there')
        require(data.at == len(data.data), 'a table of pages that is too long')
        self._check(stream, groups)
        self.groups = {group.level: group for group in groups}

    @staticmethod
    def _check(stream, groups):
        """The pages of a group give its level."""
        seen, wrong = 0, 'pages that do not give their level'
        for group in groups:
            before, level = stream.levels[group.level - 1:group.level + 1]
            seen += group.count
            stored = sum(frames[0][1] for frames in stream.frames[:group.level + 1])
            require(BYTES_A_PAGE * (seen - PAGES_FREE) <= stored, 'more pages than go with the bytes')
            require(before['vertices'] + sum(page.vertices for page in group.pages) == level['vertices'], wrong)
            require(before['tets'] + sum(page.tets for page in group.pages) == level['tets'], wrong)
            for part, frame in enumerate(stream.frames[group.level]):
                require(sum(page.frames[part][0] for page in group.pages) == frame[1], wrong)
                require(frame[2] == bytes(16), 'a digest of a level in pages')
            group.place(stream.frames[group.level][0][0])


def meets(place, low, high):
    """Does a box of six numbers, or a ball of a middle and a radius, meet the box from `low` to `high`?"""
    least, greatest = place[:3], place[3:] if len(place) == 6 else place[:3]
    gaps = np.maximum(np.maximum(low - greatest, least - high), 0)
    return not gaps.any() if len(place) == 6 else not gaps @ gaps > (place[3] * (1 + 2 ** -40)) ** 2


def meeting(stream, place, to=None):
    """The pages, up to a level, whose boxes meet a box or ball: {level: numbers of pages}."""
    low, high = (np.array(corner, dtype=float) for corner in stream.bounds)
    found = {}
    for level, group in stream.groups.items():
        for number, page in enumerate(group.pages if to is None or level <= to else ()):
            steps = np.array(page.box).reshape(2, 3)
            least, greatest = np.where(steps == BOX_STEPS, high, low + (high - low) * (steps / BOX_STEPS))
            if meets(place, least, greatest):
                found.setdefault(level, set()).add(number)
    return found


def closure(stream, pages):
    """The pages, and all that they need, directly or not."""
    closed = {level: set(numbers) for level, numbers in pages.items()}
    for level in sorted(stream.groups, reverse=True):
        for number in closed.get(level, ()):
            if level - 1 in stream.groups:
                closed.setdefault(level - 1, set()).update(stream.groups[level].pages[number].needed)
    return closed


def rows_of(cursor, chosen):
    """Of each tetrahedron of a cursor with these pages: the level that it is of, and its number with all pages."""
    groups, levels = cursor.stream.groups, cursor.stream.levels
    root = min(groups) - 1
    finest = max((level for level, pages in chosen.items() if pages), default=root)
    of = [min(cursor.left_out.get(t, finest + 1) - 1, finest) for t in range(len(cursor.tets))]
    numbers, next_number = list(range(levels[root]['tets'])), levels[root]['tets']
    for level, group in sorted(groups.items()):
        for number, page in enumerate(group.pages):
            if number in chosen.get(level, ()):
                numbers.extend(range(next_number, next_number + page.tets))
            next_number += page.tets
    return np.array(of, np.uint32), np.array(numbers, np.uint32)
