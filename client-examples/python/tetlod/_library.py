# SPDX-License-Identifier: BSD-3-Clause
"""Decoding by libtetlod, through ctypes: the structs and functions of tetlod.h that are used here, and no others."""
from __future__ import annotations

import ctypes
import ctypes.util
import functools
import json
import os
import weakref
from ctypes import POINTER, Structure, byref, c_char, c_char_p, c_double, c_int, c_size_t, c_uint32, c_uint64, c_void_p
from typing import Any, Callable, Dict, List, Optional, Sequence, Tuple

import numpy as np

from ._model import MEASURES, Field, Info, Level, Region, Topology, unknown_field
from ._sources import Source
from ._steps import Steps, own_ranges
from ._words import speak
from .reference import StreamError

VERSION = '0.1'  # of the library: structs may differ in another one
ERR_NOMEM, ERR_IO = 10, 12
NONE, UNLIMITED = 0xffffffff, (1 << 64) - 1
CELL_TYPES = ('f4', 'f8', 'i1', 'i2', 'i4', 'i8')  # by enum tetlod_cell_type
READ = ctypes.CFUNCTYPE(c_int, c_void_p, c_uint64, c_void_p, c_size_t)


class CError(Structure):
    _fields_ = [('status', c_int), ('offset', c_uint64), ('message', c_char * 1024)]


class CSource(Structure):
    _fields_ = [('read', READ), ('opaque', c_void_p), ('size', c_uint64)]


GAP = 24 << 10  # bytes between two spans that are read along, for one request less


class CField(Structure):
    _fields_ = [('name', c_char_p), ('components', c_uint32), ('type', c_int), ('range', c_double * 2),
                ('controlled', c_int),
                ('bounds', c_uint32), ('reserved', c_uint64 * 2)]


class CLevel(Structure):
    _fields_ = [('vertices', c_uint64), ('tets', c_uint64), ('offset', c_uint64), ('end', c_uint64),
                ('domain_error', c_double),
                ('errors', POINTER(c_double)), ('reserved', c_uint64 * 2)]


class CCellField(Structure):
    _fields_ = [('name', c_char_p), ('components', c_uint32), ('type', c_int), ('region', c_int),
                ('range', c_double * 2),
                ('quantum', c_double), ('error', c_double)]


class CSection(Structure):
    _fields_ = [('tag', c_char * 5), ('critical', c_int), ('offset', c_uint64), ('stored', c_uint64),
                ('size', c_uint64), ('reserved', c_uint64 * 2)]


class CTopology(Structure):
    _fields_ = [('step_count', c_uint32), ('times', POINTER(c_double)), ('cid', c_char * 33), ('offset', c_uint64),
                ('size', c_uint64),
                ('reserved', c_uint64 * 2)]


class CInfo(Structure):
    _fields_ = [('cid', c_char * 33), ('vertices', c_uint64), ('tets', c_uint64), ('bytes', c_uint64),
                ('bounds', c_double * 6), ('position_type', c_int), ('lossless', c_int), ('degenerate_tets', c_uint64),
                ('inverted_tets', c_uint64), ('unused_points', c_uint64), ('field_count', c_uint32),
                ('level_count', c_uint32), ('fields', POINTER(CField)), ('levels', POINTER(CLevel)),
                ('metadata', c_char_p), ('metadata_size', c_size_t),
                ('keeps_order', c_int), ('section_count', c_uint32), ('sections', POINTER(CSection)),
                ('cell_field_count', c_uint32), ('cell_fields', POINTER(CCellField)), ('topology_count', c_uint32),
                ('topologies', POINTER(CTopology)), ('cell_rows', c_uint32), ('page_count', c_uint32),
                ('first_paged_level', c_uint32), ('exact_last', c_int), ('stream_offset', c_uint64)]


class CPlace(Structure):
    _fields_ = [('low', c_double * 3), ('high', c_double * 3), ('radius', c_double), ('level', c_uint32)]


class CPageSetInfo(Structure):
    _fields_ = [('level', c_uint32), ('pages', c_uint32), ('vertices', c_uint64), ('tets', c_uint64),
                ('memory', c_uint64), ('reserved', c_uint64)]


class CSpan(Structure):
    _fields_ = [('offset', c_uint64), ('size', c_uint64)]


class CMesh(Structure):
    _fields_ = [('vertices', c_uint32), ('tets', c_uint32), ('level', c_uint32), ('positions', c_void_p),
                ('fields', POINTER(c_void_p)),
                ('corners', c_void_p), ('parents', c_void_p), ('reserved', c_void_p * 4)]


class CBand(Structure):
    _fields_ = [('error', c_double), ('level', c_uint32), ('reserved', c_uint64 * 2)]


class CSeriesInfo(Structure):
    _fields_ = [('step_count', c_uint32), ('band_count', c_uint32), ('field_count', c_uint32),
                ('displacement', c_uint32), ('times', POINTER(c_double)),
                ('bands', POINTER(CBand)), ('fields', POINTER(c_uint32)), ('ranges', POINTER(c_double * 2)),
                ('cell_field_count', c_uint32), ('cell_fields', POINTER(c_uint32)), ('cell_ranges',
                                                                                     POINTER(c_double * 2)),
                ('types', c_void_p)]


FUNCTIONS: Dict[str, Tuple[Any, List[Any]]] = {
    'tetlod_version': (c_char_p, []),
    'tetlod_open': (c_int, [POINTER(c_void_p), POINTER(CSource), c_void_p, POINTER(CError)]),
    'tetlod_close': (None, [c_void_p]),
    'tetlod_info': (POINTER(CInfo), [c_void_p]),
    'tetlod_cells': (c_int, [c_void_p, c_uint32, c_void_p, POINTER(CError)]),
    'tetlod_cursor_new': (c_int, [POINTER(c_void_p), c_void_p, POINTER(c_uint32), c_uint32, POINTER(CError)]),
    'tetlod_cursor_free': (None, [c_void_p]),
    'tetlod_cursor_seek': (c_int, [c_void_p, c_uint32, POINTER(CError)]),
    'tetlod_cursor_mesh': (None, [c_void_p, POINTER(CMesh)]),
    'tetlod_page_set_fit': (c_int, [POINTER(c_void_p), c_void_p, c_uint32, POINTER(CPlace), c_size_t, c_uint64,
                                    POINTER(c_uint32), POINTER(CError)]),
    'tetlod_page_set_free': (None, [c_void_p]),
    'tetlod_page_set_info': (None, [c_void_p, POINTER(CPageSetInfo)]),
    'tetlod_page_set_spans': (c_size_t, [c_void_p, POINTER(c_uint32), c_uint32, c_uint64, POINTER(CSpan), c_size_t]),
    'tetlod_cursor_select': (c_int, [c_void_p, c_void_p, POINTER(CError)]),
    'tetlod_cursor_numbers': (None, [c_void_p, c_void_p, c_void_p]),
    'tetlod_cursor_tet_levels': (None, [c_void_p, c_void_p]),
    'tetlod_section_index': (c_uint32, [POINTER(CInfo), c_char_p]),
    'tetlod_series_new': (c_int, [POINTER(c_void_p), c_void_p, POINTER(CError)]),
    'tetlod_series_free': (None, [c_void_p]),
    'tetlod_series_info': (POINTER(CSeriesInfo), [c_void_p]),
    'tetlod_step_error': (c_double, [c_void_p, c_uint32, c_uint32, c_uint32]),
    'tetlod_seek_step': (c_int, [c_void_p, c_void_p, c_uint32, c_uint32, POINTER(CError)]),
    'tetlod_step_values': (c_void_p, [c_void_p, c_uint32]),
    'tetlod_has_step_cells': (c_int, [c_void_p, c_uint32, c_uint32]),
    'tetlod_step_cells': (c_int, [c_void_p, c_uint32, c_uint32, c_void_p, POINTER(CError)]),
    'tetlod_step_move': (c_int, [c_void_p, c_void_p, POINTER(CError)]),
}


def library_path() -> Optional[str]:
    """The libtetlod that decodes: TETLOD_LIBRARY, else an installed one. None: the decoder in Python does."""
    named = os.environ.get('TETLOD_LIBRARY')
    if named is not None:
        return named or None
    return ctypes.util.find_library('tetlod')


@functools.lru_cache(maxsize=None)
def load(path: str) -> ctypes.CDLL:
    library = ctypes.CDLL(path)
    for name, (result, arguments) in FUNCTIONS.items():
        function = getattr(library, name)
        function.restype, function.argtypes = result, arguments
    version = library.tetlod_version().decode()
    if not version.startswith(VERSION + '.'):
        raise OSError('%s is version %s; this package needs %s' % (path, version, VERSION))
    return library


class View:
    """Memory of the library as an array that keeps its owner alive."""

    def __init__(self, owner: object, address: int, shape: Tuple[int, ...], form: str) -> None:
        self.owner = owner
        self.__array_interface__ = {'data': (address, True), 'shape': shape, 'typestr': form, 'version': 3}


def view(owner: object, address: Optional[int], shape: Tuple[int, ...], form: str) -> Any:
    if not address:  # of a mesh without tetrahedra
        return np.zeros(shape, form)
    return np.asarray(View(owner, address, shape, form))


class LibraryDecoder:
    """A cursor of the library on a source. `seek` moves it, `arrays` are views that hold until it moves again."""

    def __init__(self, path: str, source: Source, fields: Optional[Sequence[str]]) -> None:
        self._library, self._source, self._problem = load(
            path), source, None  # type: ctypes.CDLL, Source, Optional[BaseException]
        here = weakref.ref(self)

        def read(_: Any, offset: int, buffer: int, size: int) -> int:
            decoder = here()
            return ERR_IO if decoder is None else decoder._fill(offset, buffer, size)

        self._read = READ(read)
        self._file, self._cursor, self._series, self._series_cursor, error = c_void_p(), c_void_p(), c_void_p(
        ), c_void_p(), CError()
        self._check(self._library.tetlod_open(byref(self._file), byref(CSource(self._read, None, source.size)), None,
                                              byref(error)), error)
        weakref.finalize(self, free, self._library, self._file, self._cursor, self._series, self._series_cursor,
                         self._read)
        self.info = self._information()
        c = self._library.tetlod_info(self._file).contents
        self.cell_ends = tuple(s.offset + s.stored for s in c.sections[:c.section_count] if s.tag in (b'CVAL', b'PVAL'))
        names = [f.name for f in self.info.fields]
        for name in fields or ():
            if name not in names:
                raise unknown_field(name, names)
        self._selected = list(range(len(names))) if fields is None else sorted({names.index(f) for f in fields})

    def open_cursor(self, cursor: c_void_p, fields: Sequence[int]) -> None:
        numbers, error = (c_uint32 * max(1, len(fields)))(*fields), CError()
        self._check(self._library.tetlod_cursor_new(byref(cursor), self._file, numbers, len(fields), byref(error)),
                    error)

    def _fill(self, offset: int, buffer: int, size: int) -> int:
        """The library's callback."""
        try:
            data = self._source.read(offset, size)
        except BaseException as problem:  # it must not pass through C; _check raises it
            self._problem = self._problem or problem
            return ERR_IO
        if len(data) < size:
            self._problem = StreamError('%s: the stream ends too early' % self._source.name)
            return ERR_IO
        ctypes.memmove(buffer, data, size)
        return 0

    def _check(self, status: int, error: CError) -> None:
        problem, self._problem = self._problem, None
        if problem is not None:
            raise problem
        if status == ERR_NOMEM:
            raise MemoryError(error.message.decode())
        if status:
            raise StreamError('%s: %s' % (self._source.name, speak(error.message.decode('utf-8', 'replace'))))

    def _information(self) -> Info:
        c = self._library.tetlod_info(self._file).contents
        names = [f.name.decode() for f in c.fields[:c.field_count]]
        fields = tuple(Field(name, f.components, 'float64' if f.type else 'float32', (f.range[0], f.range[1]),
                             bool(f.controlled),
                             names[f.bounds] if f.bounds < len(names) else None)
                       for name, f in zip(names, c.fields[:c.field_count]))
        levels = []
        for number, level in enumerate(c.levels[:c.level_count]):
            values = level.errors[:4 * len(fields)] if fields else []
            errors = {f.name: dict(zip(MEASURES, values[4 * i:4 * i + 4])) for i, f in enumerate(fields)}
            levels.append(Level(number, level.vertices, level.tets, level.end, level.domain_error, errors))
        b = c.bounds[:]
        return Info(
            c.cid.decode(), c.vertices, c.tets, c.bytes, ((b[0], b[1], b[2]), (b[3], b[4], b[5])), bool(c.lossless),
            fields, tuple(levels), metadata_of(c.metadata),
            tuple(f.name.decode() for f in c.cell_fields[:c.cell_field_count]),
            tuple(
                Topology(t.step_count, tuple(t.times[:t.step_count]), t.cid.decode(), t.offset, t.size)
                for t in c.topologies[:c.topology_count]),
            tuple(range(c.first_paged_level, c.level_count - c.exact_last)) if c.page_count else ())

    def seek(self, level: int) -> None:
        error = CError()
        if not self._cursor:
            self.open_cursor(self._cursor, self._selected)
        self._check(self._library.tetlod_cursor_seek(self._cursor, level, byref(error)), error)

    def arrays(self) -> Tuple[Any, Any, Dict[str, Any]]:
        mesh = CMesh()
        self._library.tetlod_cursor_mesh(self._cursor, byref(mesh))
        values = {number: mesh.fields[number] for number in self._selected}
        return self._arrays(mesh, values)

    def _arrays(self, mesh: CMesh, values: Dict[int, Optional[int]]) -> Tuple[Any, Any, Dict[str, Any]]:
        fields = {}
        for number, address in values.items():
            field = self.info.fields[number]
            shape = (mesh.vertices,) if field.components == 1 else (mesh.vertices, field.components)
            fields[field.name] = view(self, address, shape, '=f8')
        points = view(self, mesh.positions, (mesh.vertices, 3), '=f8')
        return points, view(self, mesh.corners, (mesh.tets, 4), '=u4'), fields

    def region(self, boxes: Sequence[Sequence[float]], coarse: int, fine: int, memory: Optional[int] = None) -> Region:
        """The pages of all levels up to `coarse`, and in the boxes or balls of those up to `fine`; of levels that are
        as fine as `memory` allows."""
        return self.region_of(self.page_set(boxes, coarse, fine, memory))

    def page_set(self, boxes: Sequence[Sequence[float]], coarse: int, fine: int,
                 memory: Optional[int] = None) -> c_void_p:
        pages, error, most = c_void_p(), CError(), c_uint32()
        places = (CPlace * len(boxes))(*(CPlace(tuple(box[:3]), tuple(box[3:]), 0, fine) if len(box) == 6 else
                                         CPlace(tuple(box[:3]), (0, 0, 0), box[3], fine) for box in boxes))
        status = self._library.tetlod_page_set_fit(byref(pages), self._file, coarse, places, len(boxes),
                                                   UNLIMITED if memory is None else memory, byref(most), byref(error))
        self._check(status, error)
        return pages

    def region_of(self, pages: c_void_p) -> Region:
        """The mesh of a set, which is freed."""
        cursor, error = c_void_p(), CError()
        try:
            self._source.hold(self._spans(pages))
            self.open_cursor(cursor, self._selected)
            self._check(self._library.tetlod_cursor_select(cursor, pages, byref(error)), error)
            about = CPageSetInfo()
            self._library.tetlod_page_set_info(pages, byref(about))
            self._check(self._library.tetlod_cursor_seek(cursor, about.level, byref(error)), error)
            return self._region(cursor)
        finally:
            self._library.tetlod_cursor_free(cursor)
            self._library.tetlod_page_set_free(pages)

    def _region(self, cursor: c_void_p) -> Region:
        """Copies: the cursor goes."""
        mesh = CMesh()
        self._library.tetlod_cursor_mesh(cursor, byref(mesh))
        points, tets, fields = self._arrays(mesh, {number: mesh.fields[number] for number in self._selected})
        levels, numbers = (np.empty(mesh.tets, np.uint32) for _ in range(2))
        self._library.tetlod_cursor_tet_levels(cursor, levels.ctypes.data)
        self._library.tetlod_cursor_numbers(cursor, None, numbers.ctypes.data)
        return Region(points.copy(), tets.copy(), {name: values.copy() for name, values in fields.items()}, levels,
                      numbers)

    def _spans(self, pages: c_void_p) -> Sequence[Tuple[int, int]]:
        """Of the pages' bytes, joined where little lies between."""
        fields = (c_uint32 * max(1, len(self._selected)))(*self._selected)
        count = self._library.tetlod_page_set_spans(pages, fields, len(self._selected), GAP, None, 0)
        spans = (CSpan * count)()
        self._library.tetlod_page_set_spans(pages, fields, len(self._selected), GAP, spans, count)
        return [(span.offset, span.size) for span in spans]

    @functools.cached_property
    def steps(self) -> Optional[Steps]:
        error = CError()
        if self._library.tetlod_section_index(self._library.tetlod_info(self._file), b'TIME') == NONE:
            return None
        self._check(self._library.tetlod_series_new(byref(self._series), self._file, byref(error)), error)
        c = self._library.tetlod_series_info(self._series).contents
        self._series_fields, self._moves = c.fields[:c.field_count], c.displacement != NONE
        ranges = {self.info.fields[number].name: (c.ranges[i][0], c.ranges[i][1])
                  for i, number in enumerate(self._series_fields)}
        return Steps(tuple(c.times[:c.step_count]), tuple((band.error, band.level) for band in c.bands[:c.band_count]),
                     ranges, self._moves, self.step_error, own_ranges(self.info.metadata))

    def seek_step(self, band: int, step: int) -> Tuple[Any, Any, Dict[str, Any]]:
        mesh, error = CMesh(), CError()
        if not self._series_cursor:
            self.open_cursor(self._series_cursor, [])
        self._check(self._library.tetlod_seek_step(self._series, self._series_cursor, band, step, byref(error)), error)
        self._library.tetlod_cursor_mesh(self._series_cursor, byref(mesh))
        points, tets, fields = self._arrays(mesh,
                                            {number: self._library.tetlod_step_values(self._series, i)
                                             for i, number in enumerate(self._series_fields)})
        if self._moves:
            points = points.copy()
            self._check(self._library.tetlod_step_move(self._series, points.ctypes.data, byref(error)), error)
        return points, tets, fields

    def step_error(self, field: int, band: int, step: int) -> float:
        return float(self._library.tetlod_step_error(self._series, field, band, step))

    def has_step_cells(self, name: str, step: int) -> bool:
        return bool(self._library.tetlod_has_step_cells(self._series, self.info.cells.index(name), step))

    def cells(self, name: str) -> Any:
        return self._cells(name, lambda *rest: self._library.tetlod_cells(self._file, *rest))

    def step_cells(self, name: str, step: int) -> Any:
        return self._cells(name, lambda number,
                           *rest: self._library.tetlod_step_cells(self._series, number, step, *rest))

    def _cells(self, name: str, read: Callable[[int, int, Any], Any]) -> Any:
        number = self.info.cells.index(name)
        field, error = self._library.tetlod_info(self._file).contents.cell_fields[number], CError()
        shape = (self.info.tets,) if field.components == 1 else (self.info.tets, field.components)
        values = np.empty(shape, np.float64)
        self._check(read(number, values.ctypes.data, byref(error)), error)
        return values.astype(CELL_TYPES[field.type])


def metadata_of(text: Optional[bytes]) -> Dict[str, Any]:
    try:
        found = json.loads(text or b'{}')
    except ValueError:
        found = {}
    return found if isinstance(found, dict) else {}


def free(library: ctypes.CDLL, file: c_void_p, cursor: c_void_p, series: c_void_p, series_cursor: c_void_p,
         _: Any) -> None:
    library.tetlod_series_free(series)
    library.tetlod_cursor_free(series_cursor)
    library.tetlod_cursor_free(cursor)
    library.tetlod_close(file)
