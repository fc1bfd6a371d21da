# SPDX-License-Identifier: BSD-3-Clause
"""The steps of a series as a sequence of meshes, and what one part of them costs to read."""
from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, Dict, List, Optional, Sequence, Tuple, Union, overload

from ._mesh import Mesh
from ._model import Fraction

if TYPE_CHECKING:
    from ._stream import Stream

GROUP = 8  # steps that are stored together (SPEC 3.7)


class StepSequence(Sequence[Mesh]):
    """The steps of a stream, or some of them: `steps[3]` is a mesh, `steps[2:8]` are steps, `steps.sel(time=0.4)` is
    the mesh of a time.

    Nothing is read before a mesh is asked for. `within(error)` are the same steps at an error; without, they are exact.
    Steps pickle where their stream does: a worker of another process opens the stream itself.
    """

    def __init__(self, stream: 'Stream', numbers: Optional[range] = None, error: Optional[Fraction] = None,
                 band: Optional[int] = None) -> None:
        self._stream, self._error, self._band = stream, error, band
        self._numbers = range(len(stream.times)) if numbers is None else numbers

    @property
    def times(self) -> Tuple[float, ...]:
        times = self._stream.times
        return tuple(times[number] for number in self._numbers)

    @property
    def sizes(self) -> Dict[str, int]:
        return {'time': len(self)}

    @property
    def chunks(self) -> Tuple[int, ...]:
        """How many steps in a row are stored together, as dask takes it: in these parts no byte is read twice."""
        groups: List[Tuple[int, int]] = []
        counts: List[int] = []
        for number in self._numbers:
            group = self._stream._group(number)
            if groups and groups[-1] == group:
                counts[-1] += 1
            else:
                groups.append(group)
                counts.append(1)
        return tuple(counts)

    def blocks(self) -> List['StepSequence']:
        """The steps in the parts that `chunks` counts."""
        begins = [sum(self.chunks[:i]) for i in range(len(self.chunks) + 1)]
        return [self[begin:end] for begin, end in zip(begins, begins[1:])]

    def within(self, error: Optional[Fraction]) -> 'StepSequence':
        """These steps at an error: a fraction of each field's range over all steps (0.01 or '1%'). Each has the
        coarsest mesh that is within it at that step."""
        return StepSequence(self._stream, self._numbers, error)

    def in_band(self, band: int) -> 'StepSequence':
        """These steps in one band: all on one mesh."""
        return StepSequence(self._stream, self._numbers, band=band)

    def isel(self, time: Union[int, slice]) -> Union[Mesh, 'StepSequence']:
        """By number, as xarray has it."""
        return self[time]

    def sel(self, time: Union[float, slice], method: Optional[str] = None) -> Union[Mesh, 'StepSequence']:
        """By time, as xarray has it: the step of this very time, or with method='nearest' the one that is nearest;
        or, of a slice, the steps from one time to another, both among them."""
        times = self.times
        if isinstance(time, slice):
            low = -math.inf if time.start is None else time.start
            high = math.inf if time.stop is None else time.stop
            inside = [i for i, own in enumerate(times) if low <= own <= high]
            return self[inside[0]:inside[-1] + 1:time.step] if inside else self[0:0]
        if not times:
            raise KeyError('there are no steps')
        moment = float(time)
        nearest = min(range(len(times)), key=lambda i: abs(times[i] - moment))
        if method not in (None, 'nearest'):
            raise ValueError("method is None or 'nearest', not %r" % method)
        if method is None and times[nearest] != moment:
            raise KeyError("no step has the time %r; the nearest is %r (method='nearest' takes it)" % (moment,
                                                                                                       times[nearest]))
        return self[nearest]

    def __len__(self) -> int:
        return len(self._numbers)

    @overload
    def __getitem__(self, index: int) -> Mesh: ...

    @overload
    def __getitem__(self, index: slice) -> 'StepSequence': ...

    def __getitem__(self, index: Any) -> Any:
        if isinstance(index, slice):
            return StepSequence(self._stream, self._numbers[index], self._error, self._band)
        try:
            return self._stream._step_mesh(self._numbers[index], self._error, self._band)
        except IndexError:
            raise IndexError('no step %d; there are %d' % (index, len(self))) from None

    def __repr__(self) -> str:
        times = self.times
        span = ', times %g to %g' % (times[0], times[-1]) if times else ''
        return '<tetlod.StepSequence of %s: %d steps%s>' % (self._stream._source.name, len(self), span)
