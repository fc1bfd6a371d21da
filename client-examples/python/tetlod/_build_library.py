# SPDX-License-Identifier: BSD-3-Clause
"""Building by libtetlod-build, through ctypes: arrays in memory go in, the bytes of the stream come out; no file, no
process."""
from __future__ import annotations

import ctypes
import ctypes.util
import functools
import json
import os
import warnings
from ctypes import POINTER, Structure, byref, c_char_p, c_double, c_int, c_size_t, c_uint, c_uint32, c_uint64, c_void_p
from typing import Any, Callable, Dict, List, Mapping, Optional, Tuple

import numpy as np

from ._library import CELL_TYPES, ERR_IO, ERR_NOMEM, CError
from ._words import speak

ERR_CANCELLED = 13
# Integers that the library does not have, and the least type that holds them
WIDER = {'u1': 'i2', 'u2': 'i4', 'u4': 'i8', 'u8': 'i8'}
Progress = Callable[[str, float], Optional[bool]]
WRITE = ctypes.CFUNCTYPE(c_int, c_void_p, c_void_p, c_size_t)
PROGRESS = ctypes.CFUNCTYPE(c_int, c_void_p, c_char_p, c_double)
WARN = ctypes.CFUNCTYPE(None, c_void_p, c_char_p)


class CArray(Structure):
    _fields_ = [('name', c_char_p), ('components', c_uint32), ('type', c_int), ('values', c_void_p)]


class CMesh(Structure):
    _fields_ = [('struct_size', c_size_t), ('vertices', c_uint32), ('tets', c_uint32), ('position_type', c_int),
                ('positions', c_void_p), ('corners', c_void_p), ('field_count', c_uint32),
                ('cell_field_count', c_uint32), ('fields', POINTER(CArray)), ('cell_fields', POINTER(CArray))]


class COptions(Structure):
    _fields_ = [('struct_size', c_size_t), ('controls', POINTER(c_char_p)), ('control_count', c_uint32),
                ('region', c_char_p), ('max_error', c_double), ('min_tets', c_uint32), ('domain_error', c_double),
                ('boundary_angle', c_double), ('growth', c_double), ('certify_exact', c_int), ('certify_all', c_int),
                ('local_bound', c_int), ('position_bits', c_uint), ('field_bits', c_uint), ('position_error', c_double),
                ('field_error', c_double), ('keep_order', c_int), ('compression', c_int), ('threads', c_uint),
                ('memory', c_uint64), ('metadata', c_char_p), ('progress', PROGRESS), ('progress_opaque', c_void_p),
                ('warn', WARN), ('warn_opaque', c_void_p), ('without', POINTER(c_char_p)), ('without_count', c_uint32),
                ('summary', c_int), ('keep_features', c_double)]


FUNCTIONS = (('tetlod_build_defaults', None, (POINTER(COptions),)),
             ('tetlod_build', c_int, (POINTER(CMesh), POINTER(COptions), WRITE, c_void_p, POINTER(CError))))
FRACTIONS = ('max_error', 'domain_error', 'position_error', 'field_error', 'keep_features')
NUMBERS = ('min_tets', 'boundary_angle', 'growth', 'certify_all', 'local_bound', 'position_bits', 'field_bits',
           'keep_order', 'threads', 'memory', 'summary')
OPTIONS = {'field', 'no_field', 'region', 'certify', 'compress', 'metadata', 'progress', *FRACTIONS, *NUMBERS}


def library_path() -> Optional[str]:
    """The libtetlod-build that builds: TETLOD_BUILD_LIBRARY, else an installed one. None: the program does."""
    named = os.environ.get('TETLOD_BUILD_LIBRARY')
    return ctypes.util.find_library('tetlod-build') if named is None else named or None


@functools.lru_cache(maxsize=None)
def functions(path: str) -> ctypes.CDLL:
    library = ctypes.CDLL(path)
    for name, result, arguments in FUNCTIONS:
        function = getattr(library, name)
        function.restype, function.argtypes = result, arguments
    return library


def fraction(value: Any) -> float:
    text = str(value).strip()
    return float(text[:-1]) / 100 if text.endswith('%') else float(text)


def field_array(name: str, values: Any, kept: List[Any]) -> CArray:
    values = np.ascontiguousarray(values)
    form = values.dtype.str[1:]
    form = WIDER.get(form, form)
    if form not in CELL_TYPES:
        raise TypeError('%r has values of type %s; convert them to float32 or float64' % (name, values.dtype))
    values = np.ascontiguousarray(values, '=' + form)
    kept.append(values)
    return CArray(name.encode(), values.size // max(1, len(values)), CELL_TYPES.index(form), values.ctypes.data)


def c_mesh(points: Any, tets: Any, fields: Mapping[str, Any], cells: Mapping[str, Any], kept: List[Any]) -> CMesh:
    points = np.ascontiguousarray(points,
                                  '=' + (points.dtype.str[1:] if points.dtype.str[1:] in ('f4', 'f8') else 'f8'))
    if tets.size and (tets.min() < 0 or tets.max() >= len(points)):
        raise ValueError('tets refer to points %d to %d; there are %d' % (tets.min(), tets.max(), len(points)))
    tets = np.ascontiguousarray(tets, '=u4')
    c_fields = (CArray * len(fields))(*(field_array(n, v, kept) for n, v in fields.items()))
    c_cells = (CArray * len(cells))(*(field_array(n, v, kept) for n, v in cells.items()))
    kept += [points, tets, c_fields, c_cells]
    return CMesh(ctypes.sizeof(CMesh), len(points), len(tets), points.dtype.itemsize == 8, points.ctypes.data,
                 tets.ctypes.data, len(fields),
                 len(cells), c_fields, c_cells)


def c_names(given: Any, kept: List[Any]) -> Tuple[Any, int]:
    names = [str(name).encode() for name in (given if isinstance(given, (list, tuple)) else [given])]
    array = (c_char_p * len(names))(*names)
    kept.append(array)
    return array, len(names)


def c_options(library: ctypes.CDLL, given: Mapping[str, Any], kept: List[Any]) -> COptions:
    options = COptions()
    library.tetlod_build_defaults(byref(options))
    for name in FRACTIONS:
        if given.get(name) is not None:
            setattr(options, name, fraction(given[name]))
    for name in NUMBERS:
        if given.get(name) is not None:
            setattr(options, name, given[name])
    options.controls, options.control_count = c_names(given.get('field') or (), kept)
    options.without, options.without_count = c_names(given.get('no_field') or (), kept)
    options.region = str(given['region']).encode() if given.get('region') is not None else None
    options.certify_exact = given.get('certify') == 'exact'
    options.compression = given.get('compress') or options.compression
    metadata = given.get('metadata')
    options.metadata = (metadata.encode() if isinstance(metadata, str) else
                        json.dumps(metadata).encode() if metadata is not None else None)
    return options


def build(path: str, points: Any, tets: Any, fields: Mapping[str, Any], cells: Mapping[str, Any],
          given: Dict[str, Any]) -> bytes:
    """The stream of arrays. `given` are options of OPTIONS."""
    library, kept, chunks, error = functions(
        path), [], [], CError()  # type: ctypes.CDLL, List[Any], List[bytes], CError
    raised: List[BaseException] = []

    def write(_: Any, data: int, size: int) -> int:
        try:
            chunks.append(ctypes.string_at(data, size))
            return 0
        except BaseException as problem:  # it must not pass through C
            raised.append(problem)
            return ERR_IO

    def progress(_: Any, phase: bytes, done: float) -> int:
        try:
            return given['progress'](phase.decode(), done) is not False
        except BaseException as problem:
            raised.append(problem)
            return 0

    mesh, options = c_mesh(points, tets, fields, cells, kept), c_options(library, given, kept)
    if given.get('progress'):
        options.progress = PROGRESS(progress)
    lines: List[str] = []
    options.warn = WARN(lambda _, line: lines.append(line.decode('utf-8', 'replace')))
    status = library.tetlod_build(byref(mesh), byref(options), WRITE(write), None, byref(error))
    if raised:
        raise raised[0]
    if status == ERR_NOMEM:
        raise MemoryError(error.message.decode())
    if status == ERR_CANCELLED:
        raise InterruptedError('progress returned False: the build was cancelled')
    if status:
        raise ValueError(speak(error.message.decode('utf-8', 'replace')))
    for line in lines:
        warnings.warn('tetlod.build: ' + speak(line), stacklevel=3)
    return b''.join(chunks)
