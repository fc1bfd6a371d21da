# SPDX-License-Identifier: BSD-3-Clause
"""Decoding without a library: the reference decoder behind the interface of _library.LibraryDecoder."""
from __future__ import annotations

import contextlib
import functools
import gc
from typing import Any, Dict, Iterator, Optional, Sequence, Tuple

from . import reference, reference_pages
from ._model import Field, Info, Level, Region, Topology, unknown_field
from ._sources import Source
from ._steps import Steps, own_ranges


class PythonDecoder:
    def __init__(self, source: Source, fields: Optional[Sequence[str]]) -> None:
        self._stream: Any = reference.Stream(source.read, source.size)
        self._names = [f['name'] for f in self._stream.fields] if fields is None else list(fields)
        for name in self._names:
            if name not in [f['name'] for f in self._stream.fields]:
                raise unknown_field(name, [f['name'] for f in self._stream.fields])
        self._cursor: Any = None
        self.info = information(self._stream)
        self.cell_ends = tuple(s['offset'] + s['stored'] for s in self._stream.sections if s['tag'] in ('CVAL', 'PVAL'))

    def seek(self, level: int) -> None:
        if self._cursor is None:
            self._cursor = self._stream.cursor(self._names)
        with collector_paused():
            self._cursor.seek(level)

    def region(self, boxes: Sequence[Sequence[float]], coarse: int, fine: int, memory: Optional[int] = None) -> Region:
        """As the library's, but levels in pages are read whole."""
        if memory is not None:
            raise ValueError('memory= counts what libtetlod takes, and the decoder in Python takes several times as '
                             'much: install the library, or leave memory= out')
        chosen = {level: set(range(group.count)) for level, group in self._stream.groups.items() if level <= coarse}
        for box in boxes:
            for level, pages in reference_pages.meeting(self._stream, box, fine).items():
                chosen.setdefault(level, set()).update(pages)
        chosen = reference_pages.closure(self._stream, chosen)
        cursor = self._stream.cursor(self._names)
        with collector_paused():
            cursor.seek_pages(chosen)
        levels, numbers = reference_pages.rows_of(cursor, chosen)
        fields = {name: cursor.field(name) for name in self._names}
        return Region(cursor.positions, cursor.tets, fields, levels, numbers)

    def cells(self, name: str) -> Any:
        return self._stream.cells(name)

    @functools.cached_property
    def steps(self) -> Optional[Steps]:
        self._series: Any = self._stream.series()
        if self._series is None:
            return None
        return Steps(tuple(self._series.times), tuple((band['error'], band['level']) for band in self._series.bands),
                     {field['name']: (field['range'][0], field['range'][1]) for field in self._series.fields},
                     self._series.displacement is not None, self.step_error, own_ranges(self.info.metadata))

    def seek_step(self, band: int, step: int) -> Tuple[Any, Any, Dict[str, Any]]:
        with collector_paused():
            cursor, values = self._series.seek(band, step)
        return self._series.points(), cursor.tets, values

    def has_step_cells(self, name: str, step: int) -> bool:
        return bool(self._series.has_cells(name, step))

    def step_cells(self, name: str, step: int) -> Any:
        return self._series.cells(name, step)

    def step_error(self, field: int, band: int, step: int) -> float:
        return float(self._series.error(band, step, field))

    def arrays(self) -> Tuple[Any, Any, Dict[str, Any]]:
        arrays = [self._cursor.positions, self._cursor.tets, *(self._cursor.field(name) for name in self._names)]
        for array in arrays:
            array.flags.writeable = False
        return arrays[0], arrays[1], dict(zip(self._names, arrays[2:]))


@contextlib.contextmanager
def collector_paused() -> Iterator[None]:
    """Decoding makes no cycles; the collector would visit every tetrahedron again and again, an eighth of the time."""
    enabled = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if enabled:
            gc.enable()


def information(stream: Any) -> Info:
    fields = tuple(Field(f['name'], f['components'], f['type'], (f['range'][0], f['range'][1]), f['controlled'],
                         f['bounds']) for f in stream.fields)
    levels = tuple(Level(k['level'], k['vertices'], k['tets'], k['bytes'], k['domain_error'],
                         k['errors']) for k in stream.levels)
    exact = [f['exact_later'] or not scale.bits for f, scale in zip(stream.fields, stream.scales[1:])]
    low, high = stream.bounds
    return Info(stream.cid, stream.vertices, stream.tets, stream.bytes,
                ((low[0], low[1], low[2]), (high[0], high[1], high[2])), not stream.scales[0].bits and all(exact)
                and not any(f['quantum'] for f in stream.cell_fields), fields, levels, stream.metadata,
                tuple(f['name'] for f in stream.cell_fields),
                tuple(Topology(**topology) for topology in stream.topologies), tuple(sorted(stream.groups)))
