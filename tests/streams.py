# SPDX-License-Identifier: BSD-3-Clause
"""Streams changed on purpose, for tests: whole in every respect but the one that is changed."""
import os
import struct
import sys

sys.path.insert(0, os.path.join(os.environ.get('ROOT', '.'), 'client-examples', 'python'))
import tetlod.reference as tetlod  # noqa: E402


def sealed(data):
    """A stream whose header and index were changed, with the checks that go with them."""
    data = bytearray(data)
    index = data[64:64 + int.from_bytes(data[20:24], 'little')]
    data[40:56] = tetlod.digest(data[:40] + index)
    data[60:64] = tetlod.digest(data[:60])[:4]
    return bytes(data)


def plain(data):
    """The stream with an index that is not packed."""
    size, unpacked = (int.from_bytes(data[at:at + 4], 'little') for at in (20, 24))
    if size == unpacked:
        return data
    index = tetlod.unpack(data[64:64 + size], unpacked)
    total = int.from_bytes(data[32:40], 'little') + unpacked - size
    return sealed(data[:20] + data[24:28] + data[24:32] + total.to_bytes(8, 'little') + data[40:64] + index +
                  data[64 + size:])


def with_section(data, tag, content, further=0):
    """A stream with a plain index, and in the place of a section (the first of its tag, or a further one) other bytes,
    which are not packed."""
    stream = tetlod.open(data)
    end, count = 64 + int.from_bytes(data[20:24], 'little'), len(stream.sections)
    number = [i for i, section in enumerate(stream.sections) if section['tag'] == tag][further]
    old, directory, grown = stream.sections[number], bytearray(data[end - 48 * count:end]), 0
    early = directory[48 * number + 4] & 2
    for i, section in enumerate(stream.sections):
        if i == number:
            flags = int.from_bytes(directory[48 * i + 4:48 * i + 8], 'little') & ~4
            place = directory[48 * i + 8:48 * i + 16]
            directory[48 * i + 4:48 * i + 48] = struct.pack('<I8sQQ16s', flags, bytes(place), len(content),
                                                            len(content), tetlod.digest(content))
            grown = len(content) - old['stored']
        elif grown and section['offset'] > old['offset'] and directory[48 * i + 4] & 2 == early:
            at = int.from_bytes(directory[48 * i + 8:48 * i + 16], 'little') + grown
            directory[48 * i + 8:48 * i + 16] = at.to_bytes(8, 'little')
    total = int.from_bytes(data[32:40], 'little') + grown
    body = data[end:old['offset']] + content + data[old['offset'] + old['stored']:]
    before = int.from_bytes(data[28:32], 'little') + (grown if early else 0)
    head = data[:28] + before.to_bytes(4, 'little') + total.to_bytes(8, 'little') + data[40:end - 48 * count]
    return sealed(head + bytes(directory) + body)


def only_ones(count):
    """A string of the range coder: so many bits 1 of one new model of the slowest rate 6, and zeros without end."""
    low, width, chance = 0, 0xffffffff, 32768
    for seen in range(count):
        bound = (width >> 12) * (chance >> 4)
        low, width, chance = low + bound, width - bound, chance - (chance >> tetlod.SHIFT[seen])
    return low.to_bytes(4, 'big')


def crafted(levels, components=1, sections=()):
    """A stream with a plain index, whose numbers are all as small as can be: levels as vertices, tetrahedra, bytes of
    the geometry and of the one field's frame (0 components: no field); sections as tag, flags, bytes and unpacked size.
    Level 0 decodes if it has one tetrahedron."""
    frames, fields = [], min(components, 1)
    for number, (_, _, geometry, field) in enumerate(levels):
        first = only_ones(4) if number == 0 else b''
        frames.append([first + bytes(geometry - len(first)), bytes(field)][:1 + fields])
    index = struct.pack('<QQIHBB6dQQQBB', *levels[-1][:2], len(levels), fields, 6, 0, *[0.0] * 6, 1, 0, 0, 0, 0)
    index += struct.pack('<BBBBddH', 0, 0, components, 0, 0.0, 0.0, 1) + b'f' if fields else b''
    for (vertices, tets, _, _), parts in zip(levels, frames):
        index += struct.pack('<QQd', vertices, tets, 0.0) + bytes(32 * fields)
        index += b''.join(struct.pack('<Q16s', len(part), tetlod.digest(part)) for part in parts)
    index += struct.pack('<I', len(sections))
    at, bodies = {2: 0, 0: 0}, {2: b'', 0: b''}
    for tag, flags, content, size in sections:
        index += struct.pack('<4sIQQQ16s', tag, flags, at[flags & 2], len(content), size, tetlod.digest(content))
        at[flags & 2] += len(content)
        bodies[flags & 2] += content
    body = bodies[2] + b''.join(b''.join(parts) for parts in frames) + bodies[0]
    header = tetlod.MAGIC + struct.pack('<HHIIIIIQ', 2, 0, 0, 0, len(index), len(index), at[2],
                                        64 + len(index) + len(body))
    return sealed(header + bytes(24) + index + body)


def still_steps(steps, fields=1):
    """A table of steps in one band, whose frames have no bytes."""
    table = struct.pack('<IIII', fields, 1, steps,
                        0) + b''.join(struct.pack('<IIdd', field, 0, 0.0, 0.0) for field in range(fields))
    table += struct.pack('<dQ', 0.5, 0) + struct.pack('<%dd' % fields, *[1.0] * fields) + struct.pack(
        '<%dd' % steps, *range(steps))
    return table + bytes(8 * fields * steps) + tetlod.digest(b'') * (fields * ((steps + 7) // 8))
