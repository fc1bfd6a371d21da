# SPDX-License-Identifier: BSD-3-Clause
"""`open` and `read`: streams that move from level to level, and one level at once."""
from __future__ import annotations

import html
import math
import os
import warnings
from types import TracebackType
from typing import Any, Dict, Iterator, Optional, Sequence, Tuple, Type, Union, overload

from ._answers import Answer, ask
from ._library import LibraryDecoder, library_path
from ._mesh import Cells, Mesh
from ._model import Choice, Field, Fraction, Info, Level, error_of, level_for, names_of, unknown_field
from ._python import PythonDecoder
from ._sequences import FieldSequence, LevelSequence
from ._series import GROUP, StepSequence
from ._sources import Headers, Location, Part, Progress, Source, open_source
from ._steps import Steps
from .reference import StreamError

Decoder = Union[LibraryDecoder, PythonDecoder]


class Stream:
    """A stream at one of its levels; `open` makes one.

    Iterating gives the mesh of each level from the current one to `target`, as soon as its bytes are there.
    """

    def __init__(self, source: Source, choice: Choice, fields: Optional[Sequence[str]], decoder: Optional[str]) -> None:
        self._source, self._choice, self._selected, self._wanted = source, choice, fields, decoder
        self._topologies: Dict[int, Stream] = {0: self}
        self._others: Dict[str, Stream] = {}
        self._decoder = choose_decoder(source, fields, decoder)
        self.info: Info = self._decoder.info
        source.late = self.levels[-1].bytes
        self.target = self._available(choice)
        self.level = -1
        source.expect(self.levels[self.target].bytes)

    @property
    def levels(self) -> Tuple[Level, ...]:
        return self.info.levels

    @property
    def fields(self) -> Tuple[Field, ...]:
        return self.info.fields

    @property
    def times(self) -> Tuple[float, ...]:
        """The times of the steps of a series; () of a stream with one moment."""
        if self.info.topologies:
            return tuple(time for topology in self.info.topologies for time in topology.times)
        steps = self._decoder.steps
        return steps.times if steps else ()

    @property
    def mesh(self) -> Mesh:
        """The mesh of the current level. Its arrays are copies: they stay as they are when the stream moves on."""
        return self._mesh(copy=True)

    def seek(self, level: Optional[int] = None, **choice: Any) -> 'Stream':
        """Moves to a level: its number, or `error`, `abs_error`, `tets`, `bytes` with `field` and `measure` as in
        `open`."""
        self._choice = Choice(level=level, **choice)
        return self._seek(level_for(self.fields, self.levels, self._choice))

    def region(self, box: Sequence[Any], *, box_error: Optional[Fraction] = None, memory: Optional[int] = None,
               **choice: Any) -> Mesh:
        """A mesh that is finer in a box (x0, y0, z0, x1, y1, z1), in a ball (x, y, z, radius), or in several, of a
        stream in pages (build --paged). Of the pages only what it needs is read: open a URL with `level=0` for that.

        Outside it is the level of `choice`, as in `seek`, but not coarser than the last level before the pages, which
        is also the default; in the box that of `box_error`, or the finest. Its `errors` are those of its coarsest
        tetrahedra, its `tet_levels` say of which level each one is. The stream stays at its level.

        memory: bytes that decoding may take, all fields counted. Where that is not enough no level is finer than the
        finest for which it is, and only pages of these are read: `level` says which. StreamError where the levels
        before the pages take more.
        """
        boxes = [box] if isinstance(box[0], (int, float)) else list(box)
        if not self.info.paged:
            raise ValueError('%s is not in pages (tetlod build --paged): tetlod extract --box makes a region of it' %
                             self._source.name)
        root, finest = self.info.paged[0] - 1, self.info.paged[-1]
        coarse = max(root, min(finest, level_for(self.fields, self.levels, Choice(**choice)) if choice else root))
        fine = finest
        if box_error is not None:
            fine = min(finest, level_for(self.fields, self.levels, Choice(error=box_error)))
        self._source.expect(self.levels[root].bytes)
        region = self._decoder.region(boxes, coarse, max(coarse, fine), memory)
        here = sorted(set(region.levels.tolist())) or [coarse]
        level = self.levels[here[0]]
        read = lambda name: self._decoder.cells(name)[region.numbers]  # noqa: E731
        cells = Cells([name for name in self.info.cells if name not in self._missing_cells()], read, len(region.tets))
        fields = {name: frozen(values) for name, values in region.fields.items()}
        return Mesh(frozen(region.points), frozen(region.tets), fields, here[-1],
                    error_of(level, self.fields, Choice()), level.errors,
                    max(self.levels[number].domain_error for number in here), cells, id=self.info.cid,
                    tet_levels=frozen(region.levels))

    @property
    def steps(self) -> StepSequence:
        """The steps of a series as meshes; none of a stream with one moment."""
        return StepSequence(self)

    def at(self, time: float, error: Optional[Fraction] = None, *, abs_error: Optional[float] = None) -> Mesh:
        """The step whose time is nearest, as a mesh of copies with the fields that have steps. The stream stays at its
        level.

        error: a fraction of each field's range over all steps; abs_error: the same in the fields' units. The coarsest
        form within it is taken; without one, the exact form. Its `cells` are those that have values at the step.
        ValueError for a time that is more than half a step outside of the series.
        """
        check_time(self.times, time)
        topologies = self.info.topologies
        nearest = min(range(len(topologies)), key=lambda i: min(abs(own - time) for own in topologies[i].times),
                      default=0)
        return (self._topology(nearest) if nearest else self)._at(time, error, abs_error)

    def _at(self, time: float, error: Optional[Fraction], abs_error: Optional[float]) -> Mesh:
        steps = self._decoder.steps
        if steps is None:
            raise ValueError('%s is no series: it has one moment only' % self._source.name)
        return self._step_of(steps, steps.step_for(time), Choice(error=error, abs_error=abs_error))

    def _step_mesh(self, number: int, error: Optional[Fraction], band: Optional[int] = None) -> Mesh:
        """A step by its number through all topology groups, in a band or within an error."""
        topology, own = self._place(number)
        stream = self._topology(topology)
        steps = stream._decoder.steps
        assert steps is not None  # there are times
        return stream._step_of(steps, own, Choice(error=error)) if band is None else stream._step_in(steps, own, band)

    def _place(self, number: int) -> Tuple[int, int]:
        """The topology group of a step, and its number there."""
        for topology, table in enumerate(self.info.topologies):
            if number < len(table.times):
                return topology, number
            number -= len(table.times)
        return 0, number

    def _group(self, number: int) -> Tuple[int, int]:
        """The group of steps that a step is stored in."""
        topology, own = self._place(number)
        return topology, own // GROUP

    def _step_of(self, steps: Steps, step: int, choice: Choice) -> Mesh:
        return self._step_in(steps, step, steps.band_at(step, choice))

    def _step_in(self, steps: Steps, step: int, band: int) -> Mesh:
        level = self.levels[steps.bands[band][1]]
        self._source.expect(level.bytes)
        points, tets, values = self._decoder.seek_step(band, step)
        fields = {
            name: frozen(found) for name, found in values.items() if self._selected is None or name in self._selected
        }
        errors = {
            name: {'max': self._decoder.step_error(i, band, step)} for i, name in enumerate(values) if name in fields
        }
        return Mesh(frozen(points), frozen(tets), fields, level.level,
                    max((known['max'] for known in errors.values()), default=math.nan), errors, level.domain_error,
                    self._step_cells(step, len(tets)), steps.times[step], self.info.cid)

    def ask(self, question: str, within: Optional[Fraction] = None, *, time: Optional[float] = None,
            step: Optional[int] = None) -> Answer:
        """What is certain of a question about the original, as `tetlod ask` says it: 'mean(p)', 'max(T) < 500', 'p at
        (0,0,1)'.

        within: how wide the interval may be, in the answer's units, or '1%' (the default) of what it can be. time,
        step: of a series. The program answers ($TETLOD, or of the PATH); of a URL it reads the bytes that the answer
        needs. The stream stays at its level.
        """
        return ask(self._source, question, within, time, step)

    def level_for(self, **choice: Any) -> int:
        """The level that `seek` would move to."""
        return level_for(self.fields, self.levels, Choice(**choice))

    @property
    def available(self) -> int:
        """The finest level of which all bytes are there: that of a stream that is cut off is not the last one."""
        return max((i for i, level in enumerate(self.levels) if level.bytes <= self._source.size), default=-1)

    def refine(self) -> bool:
        """One level finer. False if this is the finest."""
        return self._step(1)

    def coarsen(self) -> bool:
        """One level coarser. False if this is the coarsest."""
        return self._step(-1)

    def close(self) -> None:
        """Ends a download that is under way. Meshes stay."""
        self._source.close()

    def __len__(self) -> int:
        return len(self.levels)

    @overload
    def __getitem__(self, key: int) -> Mesh: ...

    @overload
    def __getitem__(self, key: slice) -> LevelSequence: ...

    @overload
    def __getitem__(self, key: str) -> FieldSequence: ...

    def __getitem__(self, key: Any) -> Any:
        """`stream[3]` is the mesh of a level, `stream[2:5]` are levels, `stream['Pressure']` are a field's values: at
        the steps of a series, or at the levels. Nothing is decoded before a mesh or values are asked for; of a field,
        it alone."""
        if not isinstance(key, str):
            return LevelSequence(self._apart('', self._selected))[key]
        if key not in [field.name for field in self.fields]:
            raise unknown_field(key, [field.name for field in self.fields])
        alone, steps = self._apart(key, [key]), self._decoder.steps
        return FieldSequence(key, StepSequence(alone) if steps and key in steps.ranges else LevelSequence(alone))

    def _apart(self, name: str, fields: Optional[Sequence[str]]) -> 'Stream':
        """The same stream once more, over the same bytes: it moves while this one stays."""
        if name not in self._others:
            self._others[name] = Stream(self._source, Choice(level=0), fields, self._wanted)
        return self._others[name]

    def __iter__(self) -> Iterator[Mesh]:
        for level in range(max(self.level, 0), self.target + 1):
            self._seek(level)
            yield self.mesh

    def __enter__(self) -> 'Stream':
        return self

    def __exit__(self, kind: Optional[Type[BaseException]], value: Optional[BaseException],
                 trace: Optional[TracebackType]) -> None:
        self.close()

    def __reduce__(self) -> Any:
        """A stream pickles as where it is and what was asked for: unpickling opens it again, at the same level."""
        location = self._source.location
        if location is None:
            raise TypeError('%s cannot be pickled: it is a part of another stream' % self)
        return reopen, (location, self._choice, self._selected, self._wanted, self.level, self._source.headers)

    def __repr__(self) -> str:
        return '<tetlod.Stream %s: level %d of %d>' % (self._source.name, max(self.level, 0), len(self.levels) - 1)

    def _repr_html_(self) -> Optional[str]:
        """What a notebook shows of a server's stream, at the error that was asked for; None of others. It is the
        server's element where the server lets the notebook's origin read it (serve --cors), else its page in a frame,
        and what both need."""
        source, error = self._source, self._choice.fraction
        if source.server is None or source.page is None:
            return None
        page, asked = ((source.page, '') if error is None else
                       ('%s#error=%.6g' % (source.page, error), 'error="%.6g"' % error))
        style = 'style="display: block; width: 100%; height: 480px; border: 0"'
        frame = '<iframe src="%s" title="tetlod" %s></iframe>' % (html.escape(page), style)
        words = '<p>This is <a href="%s">%s</a>. Nothing is shown while its server does not run (tetlod serve), or cannot be reached.</p>' % (
            html.escape(page), html.escape(source.page))
        script = '<script type="module" src="%s"></script>' % html.escape(source.server + '/element.js')
        return '%s<tetlod-view src="%s" %s %s>%s%s</tetlod-view>' % (script, html.escape(
            source.name), asked, style, frame, words)

    def _topology(self, number: int) -> 'Stream':
        """The stream of a topology group."""
        if number not in self._topologies:
            table = self.info.topologies[number]
            stream = Stream(Part(self._source, table.offset, table.bytes), Choice(), self._selected, self._wanted)
            if (stream.info.cid, stream.info.bytes, stream.info.topologies) != (table.cid, table.bytes, ()):
                raise StreamError(
                    '%s: topology group %d is another stream than the table says' % (self._source.name, number))
            self._topologies[number] = stream
        return self._topologies[number]

    def _seek(self, level: int) -> 'Stream':
        self._source.expect(self.levels[level].bytes)
        self._decoder.seek(level)
        self.level = level
        return self

    def _level_mesh(self, number: int) -> Mesh:
        return self._seek(number).mesh

    def _step(self, by: int) -> bool:
        level = max(self.level, 0) + by
        if not 0 <= level < len(self.levels):
            return False
        self._seek(level)
        return True

    def _mesh(self, copy: bool) -> Mesh:
        if self.level < 0:
            self._seek(0)
        level = self.levels[self.level]
        points, tets, fields = self._decoder.arrays()
        if copy:
            points, tets, fields = frozen(points), frozen(tets), {
                name: frozen(values) for name, values in fields.items()
            }
        return Mesh(points, tets, fields, self.level, error_of(level, self.fields, self._choice), level.errors,
                    level.domain_error, self._cells(len(tets)), id=self.info.cid)

    def _cells(self, count: int) -> Cells:
        return Cells([name for name in self.info.cells if name not in self._missing_cells()], self._decoder.cells,
                     count)

    def _step_cells(self, step: int, count: int) -> Cells:
        here = [name for name in self.info.cells if name not in self._missing_cells()]
        names = [name for name in here if self._decoder.has_step_cells(name, step)]
        return Cells(names, lambda name: self._decoder.step_cells(name, step), count)

    def _missing_cells(self) -> Tuple[str, ...]:
        """Of a stream that is cut off: the values of tetrahedra of which bytes are missing."""
        return tuple(name for name, end in zip(self.info.cells, self._decoder.cell_ends) if end > self._source.size)

    def _available(self, choice: Choice) -> int:
        """The level that is meant. Of a stream that is cut off: the finest that is there, unless the choice needs a
        finer one."""
        wanted, missing, here = level_for(self.fields, self.levels, choice), self._missing_cells(), self.available
        if wanted <= here and (choice != Choice() or not missing):
            return wanted
        cut = '%s: the stream is cut off' % self._source.name
        if here < 0:
            raise StreamError(cut + ' before the end of its coarsest level')
        message = cut + ': it holds levels 0 to %d of %d' % (here, len(self.levels) - 1)
        if choice != Choice():
            raise StreamError('%s, not level %d' % (message, wanted))
        warnings.warn(message + (', without values of cells: %s' % ', '.join(missing) if missing else ''), stacklevel=4)
        return here


def reopen(location: Location, choice: Choice, fields: Optional[Sequence[str]], decoder: Optional[str],
           level: int, headers: Optional[Headers]) -> Stream:
    stream = Stream(open_source(location, choice, None, headers), choice, fields, decoder)
    return stream._seek(level) if level >= 0 else stream


def check_time(times: Sequence[float], time: float) -> None:
    """Beyond half a step outside of the series the nearest step is not what was meant."""
    if not times or not math.isfinite(time):
        return
    first, last = times[0], times[-1]
    second, before = next((t for t in times if t > first), first), next((t for t in reversed(times) if t < last), last)
    if not first - (second - first) / 2 <= time <= last + (last - before) / 2:
        nearest = first if time < first else last
        raise ValueError(
            'there is no time %g: times go from %g to %g; the nearest is %g' % (time, first, last, nearest))


def frozen(array: Any) -> Any:
    array = array.copy()
    array.flags.writeable = False
    return array


def choose_decoder(source: Source, fields: Optional[Sequence[str]], decoder: Optional[str]) -> Decoder:
    if decoder not in (None, 'library', 'python'):
        raise ValueError("a decoder is 'library' or 'python', not %r" % decoder)
    path = None if decoder == 'python' else library_path()
    if path is not None:
        return LibraryDecoder(path, source, fields)
    if decoder == 'library':
        raise OSError('libtetlod is not installed (set TETLOD_LIBRARY to the file, or install tetlod)')
    return PythonDecoder(source, fields)


def open(source: Location, *, error: Optional[Fraction] = None, abs_error: Optional[float] = None,
         level: Optional[int] = None, tets: Optional[int] = None, bytes: Optional[int] = None,
         field: Optional[str] = None, measure: str = 'max', fields: Union[str, Sequence[str], None] = None,
         decoder: Optional[str] = None, progress: Optional[Progress] = None,
         headers: Optional[Headers] = None) -> Stream:
    """Opens a stream: a path, bytes, `http(s)://…/v1/meshes/{id}` of a tetlod server, the URL of a stream on any host,
    a file that is open for reading, or a function fetch(offset, size) that gives bytes of the stream.

    The choice, as in `read`, is the level where iterating ends; what a server sends first goes up to it.
    `fields` are the fields to decode, or one (default: all), `decoder` is 'library' or 'python' (default: the library
    where it is installed), `progress(bytes, expected)` is called as bytes arrive. `headers` go with every request of a
    URL; so does the URL's own query.
    """
    choice = Choice(error, abs_error, level, tets, bytes, field, measure)
    found = open_source(source, choice, progress, headers)
    try:
        return Stream(found, choice, names_of(fields), decoder)
    except StreamError as fault:
        found.close()
        if 'not a tetlod stream' in str(fault):
            fault.args = ('%s: not a tetlod stream; tetlod.build makes one of a mesh' % found.name,)
        raise
    except BaseException:
        found.close()
        raise


def read(source: Location, error: Optional[Fraction] = None, *, abs_error: Optional[float] = None,
         level: Optional[int] = None, tets: Optional[int] = None, bytes: Optional[int] = None,
         field: Optional[str] = None, measure: str = 'max', fields: Union[str, Sequence[str], None] = None,
         decoder: Optional[str] = None, progress: Optional[Progress] = None, headers: Optional[Headers] = None,
         box: Optional[Sequence[Any]] = None, box_error: Optional[Fraction] = None,
         memory: Optional[int] = None) -> Mesh:
    """One level as a mesh. Its arrays are the decoder's own memory, without a copy.

    error: the coarsest level whose error is at most this fraction of the range (0.01 or '1%'), in `measure`, of
    `field`, or of every field that the stream controls. abs_error: the same in the field's units. level: this level.
    tets, bytes: the finest level of at most so many tetrahedra or bytes. Without a choice: the finest level. box,
    box_error, memory: `Stream.region`.
    """
    if box is not None:
        choice = {'error': error, 'abs_error': abs_error, 'level': level, 'tets': tets, 'bytes': bytes}
        given = {name: value for name, value in choice.items() if value is not None}
        with open(source, level=0, fields=fields, decoder=decoder, progress=progress, headers=headers) as found:
            return found.region(box, box_error=box_error, memory=memory, **given)
    if box_error is not None or memory is not None:
        raise ValueError('box_error= and memory= are those of a region: they need box=')
    stream = open(source, error=error, abs_error=abs_error, level=level, tets=tets, bytes=bytes, field=field,
                  measure=measure, fields=fields, decoder=decoder, progress=progress, headers=headers)
    with stream:
        return stream._seek(stream.target)._mesh(copy=False)
