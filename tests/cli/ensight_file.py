# SPDX-License-Identifier: BSD-3-Clause
"""EnSight files laid out by hand: as text, big-endian, little-endian, or with Fortran's record lengths."""
import numpy as np

from common import path


class EnsightFile:
    """Lines and numbers as a kind of file has them."""

    def __init__(self, name, kind, head=False):
        self.kind, self.order = kind, '>' if kind == 'big' else '<'
        self.file = open(path('hand/' + name), 'wb')
        if head and kind != 'text':
            self.line('Fortran Binary' if kind == 'fortran' else 'C Binary')

    def record(self, data):
        marker = np.array([len(data)], '<i4').tobytes() if self.kind == 'fortran' else b''
        self.file.write(marker + data + marker)

    def line(self, text):
        self.file.write(text.encode() + b'\n') if self.kind == 'text' else self.record(text.encode().ljust(80))
