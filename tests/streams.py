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
    return sealed(data[:20] + data[24:28] + data[24:32] + total.to_bytes(8, 'little') + data[40:64] + index + data[64 + size:])


def with_section(data, tag, content, further=0):
    """A stream with a plain index, and in the place of a late section (the first of its tag, or a further one) other bytes, which are not
    packed."""
    stream = tetlod.open(data)
    end, count = 64 + int.from_bytes(data[20:24], 'little'), len(stream.sections)
    number = [i for i, section in enumerate(stream.sections) if section['tag'] == tag][further]
    old, directory, grown = stream.sections[number], bytearray(data[end - 48 * count:end]), 0
    for i, section in enumerate(stream.sections):
        if i == number:
            flags = int.from_bytes(directory[48 * i + 4:48 * i + 8], 'little') & ~4
            place = directory[48 * i + 8:48 * i + 16]
            directory[48 * i + 4:48 * i + 48] = struct.pack('<I8sQQ16s', flags, bytes(place), len(content), len(content), tetlod.digest(content))
            grown = len(content) - old['stored']
        elif grown and section['offset'] > old['offset']:
            at = int.from_bytes(directory[48 * i + 8:48 * i + 16], 'little') + grown
            directory[48 * i + 8:48 * i + 16] = at.to_bytes(8, 'little')
    total = int.from_bytes(data[32:40], 'little') + grown
    body = data[end:old['offset']] + content + data[old['offset'] + old['stored']:]
    return sealed(data[:32] + total.to_bytes(8, 'little') + data[40:end - 48 * count] + bytes(directory) + body)
