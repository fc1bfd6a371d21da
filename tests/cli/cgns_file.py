# SPDX-License-Identifier: BSD-3-Clause
"""CGNS files written by libcgns itself, through its C functions."""
import ctypes
import glob

import numpy as np

LIBRARY = (glob.glob('/usr/lib/*/libcgns.so.*') + [None])[0]
TYPES = {'float32': 3, 'float64': 4, 'int32': 2}  # DataType_t
ELEMENTS = {'tetra': 10, 'tetra10': 11, 'pyramid': 12, 'pyramid14': 13, 'wedge': 14, 'wedge15': 15, 'hexahedron': 17,
            'hexahedron20': 18, 'triangle': 5,
            'mixed': 20, 'ngon': 22, 'nface': 23}
UNSTRUCTURED, STRUCTURED, VERTEX, CELL = 3, 2, 2, 3


class File:
    def __init__(self, path, hdf5=True):
        self.cg = ctypes.CDLL(LIBRARY)
        self.do('cg_set_file_type', 2 if hdf5 else 1)
        self.fn, self.base = ctypes.c_int(), ctypes.c_int()
        self.do('cg_open', path.encode(), 1, ctypes.byref(self.fn))
        self.new_base('Base')

    def new_base(self, name):
        """What follows belongs to it."""
        self.do('cg_base_write', self.fn, name.encode(), 3, 3, ctypes.byref(self.base))

    def do(self, name, *arguments):
        if getattr(self.cg, name)(*arguments):
            self.cg.cg_get_error.restype = ctypes.c_char_p
            raise RuntimeError('%s: %s' % (name, self.cg.cg_get_error()))

    def write(self, name, *arguments):
        """A function whose last argument gives a number."""
        number = ctypes.c_int()
        self.do(name, *arguments, ctypes.byref(number))
        return number

    def zone(self, name, points, cells=0, dims=None):
        size = np.array(list(dims) + [d - 1 for d in dims] + [0] * 3 if dims else [len(points), cells, 0], np.int32)
        self.z = self.write('cg_zone_write', self.fn, self.base, name.encode(), size.ctypes,
                            STRUCTURED if dims else UNSTRUCTURED)
        for d in range(3):
            axis = np.ascontiguousarray(points[:, d])
            self.write('cg_coord_write', self.fn, self.base, self.z, TYPES[str(axis.dtype)],
                       b'Coordinate' + b'XYZ'[d:d + 1],
                       axis.ctypes)
        self.last = 0

    def section(self, name, kind, elements):
        elements = np.ascontiguousarray(np.asarray(elements) + 1, np.int32)
        first, self.last = self.last + 1, self.last + len(elements)
        self.write('cg_section_write', self.fn, self.base, self.z, name.encode(), ELEMENTS[kind], first, self.last, 0,
                   elements.ctypes)

    def poly(self, name, kind, numbers, offsets):
        numbers, offsets = np.array(numbers, np.int32), np.array(offsets, np.int32)
        first, self.last = self.last + 1, self.last + len(offsets) - 1
        self.write('cg_poly_section_write', self.fn, self.base, self.z, name.encode(), ELEMENTS[kind], first,
                   self.last, 0,
                   numbers.ctypes, offsets.ctypes)

    def solution(self, name, where, fields):
        s = self.write('cg_sol_write', self.fn, self.base, self.z, name.encode(), where)
        for field, values in fields.items():
            columns = {field: values} if values.ndim == 1 else {field + 'XYZ'[d]: values[:, d] for d in range(3)}
            for column, v in columns.items():
                v = np.ascontiguousarray(v)
                self.write('cg_field_write', self.fn, self.base, self.z, s, TYPES[str(v.dtype)], column.encode(),
                           v.ctypes)

    def times(self, times, solutions):
        self.do('cg_biter_write', self.fn, self.base, b'Times', len(times))
        self.do('cg_goto', self.fn, self.base, b'BaseIterativeData_t', 1, b'end')
        values, size = np.array(times), np.array([len(times), 0], np.int32)
        self.do('cg_array_write', b'TimeValues', TYPES['float64'], 1, size.ctypes, values.ctypes)
        self.do('cg_ziter_write', self.fn, self.base, self.z, b'Steps')
        self.do('cg_goto', self.fn, self.base, b'Zone_t', self.z, b'ZoneIterativeData_t', 1, b'end')
        names, size = b''.join(s.encode().ljust(32) for s in solutions), np.array([32, len(times)], np.int32)
        self.do('cg_array_write', b'FlowSolutionPointers', 5, 2, size.ctypes, names)

    def close(self):
        self.do('cg_close', self.fn)
