# SPDX-License-Identifier: BSD-3-Clause
"""Streams changed on purpose, for tests: whole in every respect but the one that is changed."""
import os
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
