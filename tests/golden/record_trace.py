# SPDX-License-Identifier: BSD-3-Clause
"""What a decoder reads for a stream's first record of a vertex that has tetrahedra, operation by operation: the example of SPEC 14."""
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
