# SPDX-License-Identifier: BSD-3-Clause
"""make_invalid.py: writes tests/golden/invalid, streams that every decoder refuses, from the golden ones beside it. Run
from the root.

verdicts.txt has a line for each: its name, `open` if the index alone shows it or `decode` if not, and why."""
import os
import struct
import sys

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), '..'))
from streams import plain, sealed, tetlod, with_section  # noqa: E402

FOLDER = os.path.join(os.path.dirname(os.path.abspath(__file__)))
ONE, GRID, KEPT, CELLS, STEPS, NOISE, MESHES, HEAT, PARENTS, HEX, PAGED, ORIGINAL, BENT = (
    plain(open(os.path.join(FOLDER, name + '.tetlod'), 'rb').read())
    for name in ('one_tet', 'grid_float32', 'kept_order', 'cells_float32', 'series_float64', 'tail_noise',
                 'topologies', 'series_cells', 'parents_float32', 'series_parents', 'paged_float32',
                 'original_cells', 'original_quadratic'))
with open(os.path.join(FOLDER, '..', '..', 'format', 'conformance', 'valid', 'paged_none.tetlod'), 'rb') as stored:
    FLAT = plain(stored.read())
NAN, INFINITY = float('nan'), float('inf')


def index_end(data):
    return 64 + int.from_bytes(data[20:24], 'little')


def put(data, at, form, *values):
    data = bytearray(data)
    struct.pack_into('<' + form, data, at, *values)
    return sealed(data)


def sections_of(data):
    """Where each entry of the directory begins."""
    count = len(tetlod.open(data).sections)
    return [index_end(data) - 48 * (count - i) for i in range(count)]


def level_of(data, level):
    stream = tetlod.open(data)
    row = 48 + 56 * len(stream.fields)
    return sections_of(data)[0] - 4 - row * (len(stream.levels) - level)


def section(data, tag, flags, offset=None, content=b'', unpacked=0):
    """A further section behind all others, empty or of some bytes."""
    end, size = index_end(data), int.from_bytes(data[20:24], 'little')
    late = sum(s['stored'] for s in tetlod.open(data).sections
               if s['tag'] not in ('META', 'CELL', 'PCEL', 'TOPO', 'PAGE'))  # those of these streams that are early
    entry = struct.pack('<4sIQQQ16s', tag, flags, late if offset is None else offset, len(content), unpacked,
                        tetlod.digest(content))
    count = len(sections_of(data)) + 1
    at = sections_of(data)[0] - 4
    data = data[:at] + struct.pack('<I', count) + data[at + 4:end] + entry + data[end:] + content
    total = int.from_bytes(data[32:40], 'little') + 48 + len(content)
    return sealed(data[:20] + struct.pack('<II', size + 48, size + 48) + data[28:32] + struct.pack('<Q', total) +
                  data[40:])


def reframed(data, level, part, change):
    """A frame whose bytes are changed, of the same size, with its digest."""
    stream = tetlod.open(data)
    offset, size, _ = stream.frames[level][part]
    frame = change(data[offset:offset + size])
    data = data[:offset] + frame + data[offset + size:]
    at = level_of(data, level) + 24 + 32 * len(stream.fields) + 24 * part
    return put(data, at + 8, '16s', tetlod.digest(frame))


def cases():
    row, fields = level_of(GRID, 1), len(tetlod.open(GRID).fields)
    frames = row + 24 + 32 * fields
    yield 'magic', 'open', 'not a stream', b'\x89TLE' + ONE[4:]
    yield 'old_layout', 'open', 'format 1.0, from before the first release', put(ONE, 8, 'H', 1)
    yield 'newer_major', 'open', 'format 3', put(ONE, 8, 'H', 3)
    yield 'required_feature', 'open', 'a required feature that is not known', put(ONE, 12, 'I', 2)
    yield 'reserved', 'open', 'a reserved field is not 0', put(ONE, 56, 'I', 1)
    yield 'header_check', 'open', 'the check of the header', ONE[:60] + bytes([ONE[60] ^ 1]) + ONE[61:]
    yield 'content_id', 'open', 'the content id is not that of the index', ONE[:40] + bytes(16) + bytes(
        4) + tetlod.digest(ONE[:40] + bytes(20))[:4] + ONE[64:]
    yield 'too_long', 'open', 'a byte follows the end', ONE + b'\0'
    yield 'no_tetrahedra', 'open', 'tetrahedra of the original: 0', put(ONE, 72, 'Q', 0)
    yield 'many_vertices', 'open', '2^32 vertices', put(ONE, 64, 'Q', 1 << 32)
    yield 'slowest', 'open', 'slowest is 8', put(ONE, 64 + 22, 'B', 8)
    yield 'bounds', 'open', 'bounds that are not finite', put(ONE, 64 + 24, 'd', INFINITY)
    yield 'levels_shrink', 'open', 'fewer vertices than the level before', put(GRID, row, 'Q', 1)
    yield 'domain_error', 'open', 'a negative domain error', put(GRID, row + 16, 'd', -1.0)
    yield 'error_negative', 'open', 'a negative error', put(GRID, row + 24, 'd', -1.0)
    yield 'error_grows', 'open', 'an error greater than that of the level before', put(GRID, row + 24, 'd', INFINITY)
    yield 'frame_size', 'open', 'frames do not add up to the size of the stream', put(GRID, frames, 'Q', 5)
    yield 'expansion', 'open', 'a level with more vertices than go with the bytes of its frame', put(
        ONE, level_of(ONE, 0), 'Q', 1 << 20)
    yield 'two_names', 'open', 'two fields of one name', renamed(GRID, tetlod.open(GRID).fields[1]['name'].encode())
    yield 'name_long', 'open', 'a name of 256 bytes', renamed(GRID, b'n' * 256)
    yield 'section_tag', 'open', 'a tag of small letters', section(ONE, b'abcd', 0)
    yield 'section_flag', 'open', 'a flag that is not known', section(ONE, b'XABC', 8)
    yield 'section_offset', 'open', 'a section that does not begin where the one before ends', section(
        ONE, b'XABC', 0, 1)
    yield 'section_critical', 'open', 'a critical section XABC that is not known', section(ONE, b'XABC', 1)
    yield 'section_twice', 'open', 'ORDR twice', section(KEPT, b'ORDR', 0)
    yield 'cells_early', 'open', 'values of cells before level 0', section(ONE, b'CVAL', 2)
    yield 'cells_many', 'open', 'more values of cells than fields', section(CELLS, b'CVAL', 0)
    yield 'frame_digest', 'decode', 'a byte of the last frame is changed', KEPT[:tetlod.open(KEPT).frames[1][0][0]] + \
        bytes([KEPT[tetlod.open(KEPT).frames[1][0][0]] ^ 1]) + KEPT[tetlod.open(KEPT).frames[1][0][0] + 1:]
    yield 'frame_random', 'decode', 'a frame of other bytes, with its digest', reframed(
        GRID, 1, 0, lambda frame: bytes(255 - b for b in frame))
    yield 'frame_zero', 'decode', 'a base mesh of zeros, with its digest', reframed(GRID, 0, 0,
                                                                                    lambda frame: bytes(len(frame)))
    yield 'coder_start', 'decode', 'a string of the range coder that begins with 2^32 - 1', section(
        ONE, b'XABC', 4, None, b'\1\0\0' + b'\xff' * 4, 100)
    exact = len(tetlod.open(STEPS).levels) - 1
    yield 'coder_quotient', 'decode', 'plain bits that are more than there is room for', reframed(
        STEPS, exact, 1, overflowing)
    tail = len(tetlod.open(NOISE).levels) - 1
    yield 'tail_source', 'decode', 'a component with the exact values of a later one', reframed(
        NOISE, tail, 2, lambda frame: b'\xfe' * len(frame))
    yield 'tail_near', 'decode', 'a component that is near twice', reframed(NOISE, tail, 2,
                                                                            lambda frame: b'\xc0\xf0' + frame[2:])
    yield 'time_early', 'open', 'steps in time before level 0', section(ONE, b'TIME', 2)
    yield 'time_twice', 'open', 'TIME twice', section(STEPS, b'TIME', 0)
    yield 'time_length', 'decode', 'a table of steps that is too long', retimed(0, '', b'', 8)
    yield 'time_steps', 'decode', 'a table of steps of another number of them', retimed(8, 'I', 10)
    yield 'time_moves', 'decode', 'points that are moved by a field that has no steps', retimed(12, 'I', 3)
    yield 'time_moves_by', 'decode', 'points that are moved by a field of one component', retimed(12, 'I', 1)
    yield 'time_field', 'decode', 'steps of a field that is not there', retimed(16, 'I', 2)
    yield 'time_bands', 'decode', 'bands whose errors do not fall', retimed(16 + 48 + 16, 'd', 0.5)
    yield 'time_level', 'decode', 'a band of a level that is not there', retimed(16 + 48 + 32 + 8, 'Q', 99)
    yield 'time_exact', 'decode', 'a band of error 0 at a level that has not all vertices', retimed(
        16 + 48 + 32 + 8, 'Q', 13)
    yield 'time_quantum', 'decode', 'a grid with a step that is negative', retimed(16 + 48 + 48, 'd', -1.0)
    yield 'time_falls', 'decode', 'times that fall', retimed(16 + 48 + 48 + 48 + 16, 'd', 0.5)
    yield 'time_frame', 'decode', 'a frame of another size than its section has', retimed(16 + 48 + 48 + 48 + 72, 'I',
                                                                                          5)
    yield 'time_error', 'decode', 'a step with an error that is not a number', retimed(16 + 48 + 48 + 48 + 72 + 4, 'f',
                                                                                       NAN)
    yield 'time_digest', 'decode', 'a group of steps with another digest', retimed(-16, '16s', bytes(16))
    yield 'time_random', 'decode', 'steps of other bytes, with their digests', shuffled(
        lambda group: bytes(255 - b for b in group))
    yield 'time_mode', 'decode', 'a first step that is predicted from the one before', shuffled(
        lambda group: b'\x60' * len(group))
    sizes = 8 + 5 * 24
    yield 'cell_steps_early', 'open', 'steps of cells before level 0', section(ONE, b'CTIM', 2)
    yield 'cell_steps_twice', 'open', 'CTIM twice', section(HEAT, b'CTIM', 0)
    table = tetlod.open(HEAT).section('CTIM')
    yield ('cell_steps_place', 'decode', 'a table of cells\' steps that does not follow TIME',
           section(STEPS, b'CTIM', 0, content=table, unpacked=len(table)))
    yield 'cell_steps_none', 'decode', 'a table of cells\' steps without fields', cells_retimed(0, 'I', 0)
    yield 'cell_steps_steps', 'decode', 'a table of cells\' steps of another number of them', cells_retimed(4, 'I', 10)
    yield 'cell_steps_length', 'decode', 'a table of cells\' steps that is too long', cells_retimed(0, '', b'', 8)
    yield 'cell_steps_field', 'decode', 'steps of a cell field that is not there', cells_retimed(8 + 4 * 24, 'Q', 6)
    yield 'cell_steps_order', 'decode', 'a cell field that has steps twice', cells_retimed(8 + 24, 'Q', 0)
    yield 'cell_steps_range', 'decode', 'steps of cells without a range', cells_retimed(16, 'd', INFINITY)
    yield 'cell_steps_first', 'decode', 'a frame of the first step of cells', cells_retimed(sizes, 'Q', 1)
    yield 'cell_steps_frame', 'decode', 'a frame of cells of another size than its section', cells_retimed(
        sizes + 8, 'Q', 5)
    yield ('cell_steps_digest', 'decode', 'a group of cells\' steps with another digest',
           cells_retimed(sizes + 5 * 88, '16s', bytes(16)))
    yield ('cell_steps_mode', 'decode', 'a step of cells of the fourth mode',
           cells_shuffled(lambda group: b'\xf0' * len(group)))
    yield ('cell_steps_whole', 'decode', 'a step with a whole number that its type does not hold',
           cells_shuffled(lambda group: bytes(255 - b for b in group), 3))
    yield 'topologies_one', 'open', 'one topology group, which needs no table', regrouped(0, 'I', 1)
    yield 'topologies_steps', 'open', 'a topology group without steps', regrouped(4 + 32, 'I', 0)
    yield 'topologies_times', 'open', 'steps of topology groups whose times fall', regrouped(4 + 3 * 32 + 8, 'd', -1.0)
    yield 'topologies_size', 'open', 'topology groups that do not fill their section', regrouped(
        4 + 2 * 32 + 8, 'Q', 64)
    yield 'topologies_alone', 'open', 'a table of topology groups without their streams', section(ONE, b'TOPO', 2)
    yield 'topologies_other', 'decode', 'a topology group of another content id', regrouped(
        4 + 32 + 16, '16s', bytes(16))
    yield 'topologies_table', 'decode', 'a topology group of other steps than its own table says', regrouped(
        4, 'I', 1, 4 + 32, 'I', 3)
    yield 'topologies_still', 'open', 'topology groups without steps in the first one', retagged(
        MESHES, b'TIME', b'XIME')
    yield 'topologies_twice', 'open', 'NEXT twice', section(MESHES, b'NEXT', 0)
    yield 'parents_and_cells', 'open', 'PCEL and CELL', section(PARENTS, b'CELL', 2, 0)
    yield 'parents_twice', 'open', 'PMAP twice', section(PARENTS, b'PMAP', 0)
    yield 'parents_early', 'open', 'values of cells before level 0', section(ONE, b'PVAL', 2)
    yield 'parents_many', 'open', 'more values of cells than fields', section(PARENTS, b'PVAL', 0)
    yield 'parents_none', 'open', 'no cells', parents_changed(0, 'Q', 0)
    yield 'parents_rows', 'open', 'more cells than tetrahedra', parents_changed(0, 'Q', tetlod.open(PARENTS).tets + 1)
    yield ('parents_more', 'open', 'cells whose values have another number of rows',
           parents_changed(0, 'Q', tetlod.open(PARENTS).cell_rows + 1))
    quantum = 8 + 2 + 38 + 6 + 4 + 16  # of the second field
    yield 'parents_quantum', 'open', 'a quantum that is negative', parents_changed(quantum, 'd', -1.0)
    yield ('parents_error', 'open', 'an error of rounding that is not finite',
           parents_changed(quantum + 8, 'd', INFINITY))
    yield 'parents_exact', 'open', 'an error of values that are not rounded', parents_changed(8 + 2 + 4 + 24, 'd', 1.0)
    yield 'parents_integer', 'open', 'integers that are rounded', parents_changed(quantum + 38 + 6, 'd', 1.0)
    yield ('parents_map_random', 'decode', 'a map of other bytes',
           with_section(PARENTS, 'PMAP', bytes(255 - b for b in tetlod.open(PARENTS).section('PMAP'))))
    yield ('parents_map_zero', 'decode', 'a map to one cell only',
           with_section(PARENTS, 'PMAP', bytes(len(tetlod.open(PARENTS).section('PMAP')))))
    yield ('parents_map_long', 'decode', 'a map with bytes behind it',
           with_section(PARENTS, 'PMAP', tetlod.open(PARENTS).section('PMAP') + b'\1' * 8))
    yield ('parents_rounded', 'decode', 'rounded values of the fourth mode',
           with_section(PARENTS, 'PVAL', b'\xff\xff\xff\x00' * 100, 1))
    yield 'parents_steps', 'decode', 'a table of cells\' steps of another number of them', parents_retimed(4, 'I', 10)
    yield 'paged_alone', 'open', 'levels in pages without a table of pages', put(ONE, 12, 'I', 1)
    yield 'paged_quiet', 'open', 'a table of pages without the required feature', put(PAGED, 12, 'I', 0)
    groups, nodes, rows = paged_places()
    yield 'paged_first', 'open', 'a first level in pages that is level 0', repaged(0, 'I', 0)
    yield 'paged_groups', 'open', 'a group less than levels', repaged(4, 'I', groups - 1)
    yield 'paged_none', 'open', 'a group of no pages', repaged(8, 'I', 0)
    yield 'paged_nodes', 'open', 'a tree of two nodes', repaged(12, 'I', 2)
    yield 'paged_root', 'open', 'a first group with the tree of the one before', repaged(12, 'I', 0)
    yield 'paged_axis', 'open', 'a cut on axis 4', repaged(nodes, 'B', 4)
    yield 'paged_tree', 'open', 'a page in the place of the first cut', repaged(nodes, 'B', 3, nodes + 1, 'I', 0)
    yield 'paged_cut', 'open', 'a cut that is not finite', repaged(nodes + 1, 'f', INFINITY)
    yield 'paged_vertices', 'open', 'pages that add other vertices than their level', repaged(rows, 'I', 1000)
    yield 'paged_tets', 'open', 'pages that add other tetrahedra than their level', repaged(rows + 4, 'I', 1000)
    yield 'paged_box', 'open', 'a box whose least is greater than its greatest', \
        repaged(rows + 8, 'H', 65535, rows + 14, 'H', 0)
    yield 'paged_needs', 'open', 'a page of the first group that needs one', repaged(rows + 20, 'I', 1)
    yield 'paged_needed', 'open', 'a page that needs one that is not there', repaged(-4, 'I', 1000)
    yield 'paged_size', 'open', 'pages that do not fill their frame', repaged(rows + 24, 'I', 3)
    yield 'paged_moved', 'decode', 'a tree whose first cut is elsewhere', repaged(nodes + 1, 'f', 100.0)
    group, shared = paged_rows(), next(g for g in range(1, groups) if paged_word(12 + 8 * g) == 0)
    yield 'paged_last', 'open', 'a first level in pages that is not there', repaged(0, 'I', 1000)
    yield ('paged_shared', 'open', 'a group of the tree of one of another number of pages',
           repaged(8 + 8 * shared, 'I', paged_word(8 + 8 * shared) - 1))
    yield 'paged_long', 'open', 'a table of pages with a byte behind it', repaged(spliced=(None, 0, bytes(1)))
    twice = next(row for rows in group for row in rows if len(row['needed']) > 1)
    yield ('paged_twice', 'open', 'a page that needs another one twice',
           repaged(twice['needs'] + 4, 'I', twice['needed'][0]))
    empty = next(row for rows in group for row in rows if not row['vertices'])
    yield 'paged_empty', 'open', 'a page without vertices that adds a tetrahedron', repaged(empty['at'] + 4, 'I', 1)
    yield 'paged_digest', 'decode', 'a page with the digest of another one', repaged(rows + 28, '16s', bytes(16))
    # one that a reader of the low half has anyway: only the row is wrong
    page = next(row for rows, of in zip(group, group[1:]) for row in of
                        if row['vertices'] and row['count'] == 1 and row['low'] and rows[row['needed'][0]]['low'])
    yield ('paged_unsaid', 'decode', 'a page that needs another one, and says not so',
           repaged(page['at'] + 20, 'I', 0, spliced=(page['needs'], 4, b'')))
    # of level 25: where its pages have their tetrahedra at the begin, but not all of them at the end of level 26
    yield ('paged_leaves', 'decode', 'a page with a tetrahedron of another one',
           repaged(nodes + 5 * (paged_word(12) + 2) + 1, 'f', 2.0))
    yield 'paged_random', 'decode', 'a page of other bytes, with its digest', random_page(group[-1])
    yield 'paged_checked', 'open', 'a level in pages with a digest', put(
        PAGED, level_of(PAGED, len(tetlod.open(PAGED).levels) - 2) + 24 + 32 + 8, 'B', 1)
    yield 'paged_deep', 'open', 'pages behind 65 cuts', deepened(62)
    yield 'original_early', 'open', 'original cells before level 0', section(KEPT, b'ORIG', 2)
    yield 'original_twice', 'open', 'ORIG twice', section(ORIGINAL, b'ORIG', 0)
    fields, (cells, corners, further) = len(tetlod.open(BENT).fields), original_words(BENT)[:3]
    yield 'original_none', 'decode', 'no cells', original_changed(BENT, 0, 0)
    yield 'original_fields', 'decode', 'more fields than the index has', original_changed(BENT, 3, fields + 1)
    yield 'original_kind', 'decode', 'coordinates of an unknown kind', original_changed(BENT, 4, 3)
    yield 'original_kinds', 'decode', 'values of an unknown kind', original_changed(BENT, 5, 3)
    first = 5 + fields
    yield 'original_type', 'decode', 'a cell of type 256', original_changed(BENT, first, 256)
    yield 'original_size', 'decode', 'a cell of 3 corners', original_changed(BENT, first + cells, 3)
    yield 'original_sizes', 'decode', 'corners that do not add up', original_changed(BENT, 1, corners - 1)
    yield 'original_corner', 'decode', 'a corner that is not there', original_changed(BENT, first + 2 * cells, 1 << 30)
    yield ('original_parent', 'decode', 'a tetrahedron of a cell that is not there',
           original_changed(BENT, first + 2 * cells + corners, cells))
    yield ('original_empty', 'decode', 'a cell without a tetrahedron',
           original_changed(BENT, last_new_cell(first + 2 * cells + corners), 0))
    places = first + 2 * cells + corners + tetlod.open(BENT).tets
    yield 'original_places', 'decode', 'further points whose numbers do not rise', original_changed(BENT, places + 1, 0)
    yield ('original_beyond', 'decode', 'a further point beyond the points',
           original_changed(BENT, places + further - 1, 1 << 20))
    yield ('original_short', 'decode', 'original cells that end too early',
           with_section(BENT, 'ORIG', tetlod.open(BENT).section('ORIG')[:-4]))
    yield ('original_long', 'decode', 'original cells with a word behind them',
           with_section(BENT, 'ORIG', tetlod.open(BENT).section('ORIG') + bytes(4)))
    yield 'original_faces', 'decode', 'faces that do not fill their polyhedron', polyhedron_of_more_faces()
    yield 'cells_whole', 'decode', 'a value of cells that is 2^53 + 1', whole_number(CELLS)
    yield 'packed_rest', 'open', 'bytes behind a packed index that are not zero', longer_index(b'\0\0\0\0\1')
    yield 'truncated', 'decode', 'the last byte is missing', GRID[:-1]


def overflowing(frame):
    """A frame of STEPS with the greatest code that leads to plain bits near its end: the quotient is too large for
    them."""
    found = []

    class Noticing(tetlod.Coder):
        def start(self, data):
            super().start(data)
            self.own = data == frame

        def plain(self, count):
            used = len(frame) - self.rest.__length_hint__()
            if self.own and used < len(frame) and self.range & (1 << count) - 1:
                found.append((used, self.range, self.code))
            return super().plain(count)

    whole, tetlod.Coder = tetlod.Coder, Noticing
    tetlod.open(STEPS).cursor().seek(len(tetlod.open(STEPS).levels) - 1)
    tetlod.Coder = whole
    used, width, code = found[-1]
    highest = int.from_bytes(frame[:used], 'big') - code + width - 1
    return highest.to_bytes(used, 'big') + bytes(len(frame) - used)


def retagged(data, old, new):
    """A section under another tag, which no reader knows."""
    number = [section['tag'] for section in tetlod.open(data).sections].index(old.decode())
    return put(data, sections_of(data)[number], '4s', new)


def regrouped(*changes):
    """The table of topology groups with numbers changed: (place, form, value) of each."""
    stream = tetlod.open(MESHES)
    entry = next(s for s in stream.sections if s['tag'] == 'TOPO')
    table = bytearray(stream.section('TOPO'))
    for at, form, value in zip(*[iter(changes)] * 3):
        struct.pack_into('<' + form, table, at, value)
    data = MESHES[:entry['offset']] + bytes(table) + MESHES[entry['offset'] + len(table):]
    number = [s['tag'] for s in stream.sections].index('TOPO')
    return put(data, sections_of(MESHES)[number] + 32, '16s', tetlod.digest(bytes(table)))


def paged_places():
    """Of the table of pages: groups, and where nodes and rows begin."""
    table = tetlod.open(PAGED).section('PAGE')
    groups = int.from_bytes(table[4:8], 'little')
    nodes = [int.from_bytes(table[12 + 8 * g:16 + 8 * g], 'little') for g in range(groups)]
    return groups, 8 + 8 * groups, 8 + 8 * groups + 5 * sum(nodes)


def paged_word(at):
    return int.from_bytes(tetlod.open(PAGED).section('PAGE')[at:at + 4], 'little')


def meets_low(at):
    """Does a row's box reach into the half below the middles?"""
    return all(step < 32768 for step in struct.unpack_from('<3H', tetlod.open(PAGED).section('PAGE'), at + 8))


def paged_rows():
    """Of each group the rows: where each is, what it adds, and where and what the pages are that it needs."""
    (groups, _, at), stream, found = paged_places(), tetlod.open(PAGED), []
    for g in range(groups):
        found.append([])
        for _ in range(paged_word(8 + 8 * g)):
            found[-1].append({'at': at, 'vertices': paged_word(at), 'count': paged_word(at + 20), 'low': meets_low(at)})
            at += 24 + 20 * (1 + len(stream.fields))
    for row in (row for rows in found for row in rows):
        row['needs'], row['needed'] = at, [paged_word(at + 4 * i) for i in range(row['count'])]
        at += 4 * row['count']
    return found


def deepened(cuts):
    """FLAT, whose one group has 8 pages behind 3 cuts each, with so many further cuts before them: empty pages lie on
    their other sides."""
    table = tetlod.open(FLAT).section('PAGE')
    first, groups, pages, nodes = struct.unpack_from('<4I', table)
    rows, row = 16 + 5 * nodes, (len(table) - 16 - 5 * nodes) // pages
    return with_section(FLAT, 'PAGE', struct.pack('<4I', first, groups, pages + cuts, nodes + 2 * cuts) +
                        struct.pack('<Bf', 0, 1e9) * cuts + table[16:rows] + struct.pack('<BI', 3, 0) * cuts +
                        table[rows:] + bytes(row) * cuts)


def random_page(rows):
    """The last page of a group that adds vertices has other bytes."""
    number = max(n for n, row in enumerate(rows) if row['vertices'])
    stream = tetlod.open(PAGED)
    level, frame = max(stream.groups), stream.frame(max(stream.groups), 0, number)
    changed = bytes(255 - b for b in frame)
    data = repaged(rows[number]['at'] + 28, '16s', tetlod.digest(changed))
    at = tetlod.open(data).groups[level].pages[number].offsets[0]
    return data[:at] + changed + data[at + len(changed):]


def repaged(*changes, spliced=None):
    """The table of pages, which is not packed then, with numbers changed: (place, form, value) of each; and bytes
    replaced: (place, how many, by what)."""
    stream = tetlod.open(PAGED)
    entry, number = next((s, i) for i, s in enumerate(stream.sections) if s['tag'] == 'PAGE')
    table = bytearray(stream.section('PAGE'))
    for at, form, value in zip(*[iter(changes)] * 3):
        struct.pack_into('<' + form, table, at % len(table), value)
    if spliced:
        begin = len(table) if spliced[0] is None else spliced[0]
        table[begin:begin + spliced[1]] = spliced[2]
    place, grown = sections_of(PAGED)[number], len(table) - entry['stored']
    early, total = (int.from_bytes(PAGED[at:at + size], 'little') + grown for at, size in ((28, 4), (32, 8)))
    data = PAGED[:28] + struct.pack('<IQ', early, total) + PAGED[40:entry['offset']] + bytes(table)
    data += PAGED[entry['offset'] + entry['stored']:]
    offset = entry['offset'] - index_end(PAGED)
    return put(data, place + 4, 'IQQQ16s', 2, offset, len(table), len(table), tetlod.digest(bytes(table)))


def retimed(at, form, value, longer=0):
    """The table of steps with a number changed, or with more bytes."""
    table = bytearray(tetlod.open(STEPS).section('TIME')) + bytes(longer)
    if form:
        struct.pack_into('<' + form, table, at % len(table), value)
    return with_section(STEPS, 'TIME', bytes(table))


def shuffled(change):
    """The first row's groups changed, of the same sizes, with digests that match."""
    series, table = tetlod.open(STEPS).series(), bytearray(tetlod.open(STEPS).section('TIME'))
    sizes, values = [size for size, _ in series._entries[0]], b''
    rows, groups = len(series._entries), len(series._digests[0])
    data = tetlod.open(STEPS).section('TVAL', 0)
    for group in range(groups):
        part = change(data[sum(sizes[:8 * group]):sum(sizes[:8 * group + 8])])
        struct.pack_into('<16s', table, len(table) - 16 * rows * groups + 16 * group, tetlod.digest(part))
        values += part
    return with_section(with_section(STEPS, 'TIME', bytes(table)), 'TVAL', values)


def cells_retimed(at, form, value, longer=0):
    """The table of cells' steps with a number changed, or with more bytes."""
    table = bytearray(tetlod.open(HEAT).section('CTIM')) + bytes(longer)
    if form:
        struct.pack_into('<' + form, table, at, value)
    return with_section(HEAT, 'CTIM', bytes(table))


def cells_shuffled(change, row=0):
    """A row's groups changed, of the same sizes, with digests that match."""
    cells, table = tetlod.open(HEAT).series()._cells, bytearray(tetlod.open(HEAT).section('CTIM'))
    data, rows, groups, values = tetlod.open(HEAT).section('CSTP', row), len(cells._sizes), len(cells._digests[0]), b''
    for group in range(groups):
        begin = sum(cells._sizes[row][:8 * group])
        part = change(data[begin:begin + sum(cells._sizes[row][8 * group:8 * group + 8])])
        struct.pack_into('<16s', table, len(table) - 16 * groups * (rows - row) + 16 * group, tetlod.digest(part))
        values += part
    return with_section(with_section(HEAT, 'CTIM', bytes(table)), 'CSTP', values, row)


def original_words(data):
    content = tetlod.open(data).section('ORIG')
    return list(struct.unpack('<%dI' % (len(content) // 4), content))


def original_changed(data, at, word):
    words = original_words(data)
    words[at] = word
    return with_section(data, 'ORIG', struct.pack('<%dI' % len(words), *words))


def last_new_cell(begin):
    """Where the last cell's first tetrahedron is in the words."""
    words = original_words(BENT)
    return max(at for at in range(begin, begin + tetlod.open(BENT).tets) if words[at])


def polyhedron_of_more_faces():
    cells, stream = tetlod.open(ORIGINAL).original_cells(), tetlod.open(ORIGINAL)
    number = cells.types.tolist().index(42)
    at = 5 + len(stream.fields) + 2 * len(cells.types) + int(cells.offsets[number])
    return original_changed(ORIGINAL, at, (original_words(ORIGINAL)[at] + 1) % 2**32)


def parents_changed(at, form, value):
    """The table of the values of cells with a number changed."""
    table = bytearray(tetlod.open(PARENTS).section('PCEL'))
    struct.pack_into('<' + form, table, at, value)
    return with_section(PARENTS, 'PCEL', bytes(table))


def parents_retimed(at, form, value):
    table = bytearray(tetlod.open(HEX).section('PTIM'))
    struct.pack_into('<' + form, table, at, value)
    return with_section(HEX, 'PTIM', bytes(table))


def renamed(data, second):
    """The first field gets another name."""
    first = tetlod.open(data).fields[0]['name'].encode()
    at = data.index(struct.pack('<H', len(first)) + first, 64)
    out = data[:at] + struct.pack('<H', len(second)) + second + data[at + 2 + len(first):]
    grown = len(second) - len(first)
    size, total = int.from_bytes(data[20:24], 'little') + grown, int.from_bytes(data[32:40], 'little') + grown
    return sealed(out[:20] + struct.pack('<II', size, size) + out[28:32] + struct.pack('<Q', total) + out[40:])


def whole_number(data):
    """The last field of cells is not packed, and has a number that no double holds."""
    stream = tetlod.open(data)
    values = struct.pack('<q', 2**53 + 1) * stream.tets
    assert stream.cell_fields[-1]['type'] == 'int64'
    return with_section(data, 'CVAL', values, len(stream.cell_fields) - 1)


def longer_index(rest):
    """A packed index with more bytes."""
    with open(os.path.join(FOLDER, 'grid_float32.tetlod'), 'rb') as file:
        data = file.read()
    size, total = (int.from_bytes(data[at:at + length], 'little') for at, length in ((20, 4), (32, 8)))
    return sealed(data[:20] + struct.pack('<I', size + len(rest)) + data[24:32] + struct.pack('<Q', total + len(rest)) +
                  data[40:64 + size] + rest + data[64 + size:])


def main():
    folder = os.path.join(FOLDER, 'invalid')
    with open(os.path.join(folder, 'verdicts.txt'), 'w') as verdicts:
        for name, when, why, data in cases():
            verdicts.write('%s %s %s\n' % (name, when, why))
            with open(os.path.join(folder, name + '.tetlod'), 'wb') as out:
                out.write(data)


if __name__ == '__main__':
    main()
