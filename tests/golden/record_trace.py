# SPDX-License-Identifier: BSD-3-Clause
"""What a decoder reads for a stream's first record of a vertex that has tetrahedra, operation by operation: the example
of SPEC 14."""
import math
import os
import sys

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), '..'))
from streams import plain, tetlod  # noqa: E402


def names_of(thing, name, found):
    """The name of each set of models, by the identity of the object that holds it."""
    if isinstance(thing, tuple) and len(thing) == 2 and isinstance(thing[0], list):
        found[id(thing)] = name
    elif isinstance(thing, list):
        for i, part in enumerate(thing):
            names_of(part, '%s[%d]' % (name, i), found)
    elif hasattr(thing, '__dict__'):
        for key, part in vars(thing).items():
            if key not in ('codes', 'values', 'scale', 'exact'):
                names_of(part, '%s.%s' % (name, key) if name else key, found)


class Tracer(tetlod.Coder):
    lines, models = None, None  # of the class: what was read, and all models

    def _note(self, models, operation, result):
        if Tracer.lines is None:
            return result
        found = {}
        for name, thing in Tracer.models:
            names_of(thing, name, found)
        Tracer.lines.append('%-36s %6d   %08x %08x' % (operation.replace('@', found.get(id(models), '?')), result,
                                                       self.range, self.code))
        return result

    def bit(self, models, i=0):
        return self._note(models, 'bit(@)' if len(models[0]) == 1 else 'bit(@[%d])' % i, super().bit(models, i))

    def tree(self, models, depth):
        return self._note(models, 'tree(@, %d)' % depth, super().tree(models, depth))

    def plain(self, count):
        return self._note(None, 'plain(%d)' % count, super().plain(count))


class FirstRecord(Exception):
    pass


def first_record(path):
    """Its lines."""
    stream = tetlod.open(path)
    plain_coder, record = tetlod.Coder, tetlod.Cursor._record

    def stop_after(cursor, vertex, to):
        if not cursor.stars[vertex]:
            return record(cursor, vertex, to)
        Tracer.lines = ['level %d, vertex %d, tetrahedra of its star: %d' % (cursor.decoded + 1, vertex,
                                                                             len(cursor.stars[vertex]))]
        record(cursor, vertex, to)
        raise FirstRecord

    tetlod.Coder, tetlod.Cursor._record = Tracer, stop_after
    try:
        cursor = stream.cursor()
        Tracer.models = [('', cursor.models)] + [(stream.fields[c.part - 1]['name'], c) for c in cursor.columns[1:]]
        cursor.seek(len(stream.levels) - 1)
    except FirstRecord:
        pass
    finally:
        lines, Tracer.lines, tetlod.Coder, tetlod.Cursor._record = Tracer.lines, None, plain_coder, record
    return lines


def row(path, level):
    """A level's row in the unpacked index, as text."""
    with open(path, 'rb') as file:
        data = plain(file.read())
    stream = tetlod.open(data)
    size = 48 + 56 * len(stream.fields)
    end = 64 + int.from_bytes(data[20:24],
                              'little') - 48 * len(stream.sections) - 4 - size * (len(stream.levels) - 1 - level)
    return '\n'.join(data[at:min(at + 16, end)].hex(' ') for at in range(end - size, end, 16))


if __name__ == '__main__':
    print('\n'.join(first_record(sys.argv[1])))


# ---- a level that is stored whole (SPEC 14)

FACES = ((1, 2), (0, 2), (0, 1), (0, 1))  # corners that are exchanged across a face


def connectivity(coder, tets, lines):
    """The tetrahedra of a level 0 (SPEC 9.1), and a line for each operation."""
    across, fresh, vertices = tetlod.bits(2), tetlod.bits(1), tetlod.Number()
    made, seen, side = [], 0, 0

    def vertex():
        nonlocal seen
        is_new = coder.bit(fresh)
        seen += is_new
        number = seen - 1 - (0 if is_new else coder.number(vertices, 0))
        lines.append('bit(fresh) %d: vertex %d' % (is_new, number))
        return number

    while len(made) < tets:
        if side == 4 * len(made):
            made.append([vertex() for _ in range(4)])
            lines.append('a new tetrahedron: %s' % ' '.join(map(str, made[-1])))
            continue
        corners, f = made[side // 4], side % 4
        side += 1
        face = set(corners) - {corners[f]}
        if sum(face <= set(tet) for tet in made) > 1:
            continue
        is_there = coder.bit(across, int(f > 0))
        lines.append('bit(across[%d]) %d: face %d' % (f > 0, is_there, side - 1))
        if is_there:
            a, b = FACES[f]
            made.append([vertex() if i == f else corner for i, corner in enumerate(corners)])
            made[-1][a], made[-1][b] = made[-1][b], made[-1][a]
    return made


def numbers(coder, models, scale, made, count, names, lines):
    """A line for each number of each vertex (SPEC 9.2)."""
    codes = [[] for _ in names]
    for vertex in range(count):
        tet = next(tet for tet in made if vertex in tet)
        near = [corner for corner in tet if corner < vertex]
        for c, name in enumerate(names):
            found = [codes[c][n] for n in near]
            mean = 0.0
            for code in found:
                mean += scale.value(code)
            base = scale.code(mean / len(found)) if found else 0
            context = max(abs(code - found[0]) for code in found).bit_length() if len(found) > 1 else 65
            d = coder.number(models[c], context)
            codes[c].append(scale.offset(base, d))
            lines.append('vertex %d %s: near %s, base %d, context %d, number %d, code %d, value %g' %
                         (vertex, name, near, base, context, d, codes[c][-1], scale.value(codes[c][-1])))


def whole_level(path):
    """What the frames of level 0 hold, of a stream whose fields have one component."""
    stream, lines = tetlod.open(path), []
    level = stream.levels[0]
    coder = tetlod.Coder(stream.seen_most)
    coder.start(stream.frame(0, 0))
    made = connectivity(coder, level['tets'], lines)
    numbers(coder, [tetlod.Number() for _ in range(3)], stream.scales[0], made, level['vertices'], 'xyz', lines)
    for f, field in enumerate(stream.fields):
        coder.start(stream.frame(0, 1 + f))
        numbers(coder, [tetlod.Number()], stream.scales[1 + f], made, level['vertices'], [field['name']], lines)
    return lines


def group(path):
    """Where the frames of the first level in pages are (SPEC 7.6)."""
    stream = tetlod.open(path)
    level = min(stream.groups)
    names = ['geometry'] + [field['name'] for field in stream.fields]
    lines = ['level %d ends at %d' % (number, stream.levels[number]['bytes']) for number in (level - 1, level)]
    for number, page in enumerate(stream.groups[level].pages):
        places = ['%s %d + %d' % (name, at, size) for name, at, (size, _) in zip(names, page.offsets, page.frames)]
        adds = '%d vertices, %d tetrahedra' % (page.vertices, page.tets)
        lines.insert(-1, 'page %d: %s; %s' % (number, adds, ', '.join(places)))
    return lines


# ---- the tail and the steps of a series (SPEC 14), of a field of one component

def tail(path):
    """What the tail's frame of the first field holds (SPEC 9.3), of a component that is like no other one."""
    stream, lines = tetlod.open(path), []
    cursor = stream.cursor()
    cursor.seek(len(stream.levels) - 2)
    scale, coder = stream.scales[1], tetlod.Coder(stream.seen_most)
    coder.start(stream.frame(len(stream.levels) - 1, 1))
    repeat, odd = tetlod.bits(2), tetlod.bits(1)
    exact, wides = [tetlod.Number(), tetlod.Number()], [tetlod.bits(1 << wide) for wide in range(13)]
    kind, memory = coder.tree(tetlod.bits(4), 2), {}
    digits = coder.tree(tetlod.bits(32), 5) if kind else 0
    lines.append('tree(kind, 2) %d' % kind + (', tree(digits, 5) %d' % digits if kind else ''))
    for vertex, code in enumerate(cursor.columns[1].codes[0]):
        line, known = 'vertex %d: code %d, grid %.9g' % (vertex, code, scale.value(code)), memory.get(code % 4096)
        if known and known[0] == code:
            known[2] = coder.bit(repeat, known[2])
            line += ', bit(repeat) %d' % known[2]
        else:
            known = [code, None, 0]
        if not known[2]:
            is_odd = coder.bit(odd) if kind else 1
            numbers = tetlod.Numbers(0 if is_odd else kind, digits, scale)
            g, half = scale.value(code), 0.5 * scale.step[0]
            room = abs(numbers.code(g + half) - numbers.code(g - half)).bit_length()
            distance = coder.distance(exact[1 - is_odd], wides, numbers.width, room)
            line += (', bit(odd) %d' % is_odd if kind else '') + ', room %d, distance %d' % (room, distance)
            memory[code % 4096] = known = [code, numbers.value(numbers.code(g) + distance), 0]
        lines.append(line + ', value %.9g' % known[1])
    return lines


def lower_of(cursor):
    """N of SPEC 3.7."""
    lower = [set() for _ in range(cursor.count)]
    for tet in cursor.tets.tolist():
        for a in tet:
            lower[a].update(b for b in tet if b < a)
    return [sorted(found) for found in lower]


def steps(path):
    """What the frames of the first field's steps hold, band by band, of one group."""
    stream, lines = tetlod.open(path), []
    series = stream.series()
    for band, row in enumerate(series._entries):
        cursor = stream.cursor()
        lower = lower_of(cursor.seek(series.bands[band]['level']))
        quantum, sections = series._quanta[band * len(series.fields)], series._sections
        mode_models, models, coder = tetlod.bits(4), (tetlod.Number(), tetlod.Number()), tetlod.Coder((1 << 7) - 2)
        frames, now = stream._read(sections[band]['offset'], sections[band]['stored']), []
        scale = tetlod.Scale(tetlod.Bytes(b'\0\0'), 1)
        for step, (size, _) in enumerate(row):
            frame, frames = frames[:size], frames[size:]
            coder.start(frame)
            mode = coder.tree(mode_models, 2)
            lines.append('band %d, step %d: %s; tree(mode, 2) %d' % (band, step, frame.hex(' '), mode))
            before, now, length = now, [], []
            for v, near in enumerate(lower):
                rest = (now[v - 1] if v else 0.0) if mode == 0 else before[v]
                change = [now[n] - (before[n] if mode else 0.0) for n in near]
                mean = sum(change, 0.0) / len(near) if near else 0.0
                x = rest if not near or mode == 1 else mean if mode == 0 else rest + mean
                base = math.floor(x + 0.5) if quantum else scale.float_code(x)
                context = 2 * sum(length[n] for n in near) // len(near) if near else 2 * length[v - 1] if v else 0
                d = coder.number(models[mode != 0], min(65, context))
                length.append(abs(d).bit_length())
                now.append(float(base + d) if quantum else scale.float_value(base + d))
                value = scale.rounded(quantum * now[-1]) if quantum else now[-1]
                lines.append('vertex %d: x %.9g, base %d, context %d, number %d, code %d, value %.9g' %
                             (v, x, base, min(65, context), d, base + d, value))
    return lines
