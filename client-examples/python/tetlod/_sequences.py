# SPDX-License-Identifier: BSD-3-Clause
"""The levels of a stream as a sequence of meshes, and the values of one field at levels or steps. Nothing is read
before a mesh or values are asked for."""
from __future__ import annotations

from typing import TYPE_CHECKING, Any, Optional, Sequence, Tuple, Union, overload

from ._mesh import Mesh
from ._model import Fraction, Level
from ._series import StepSequence

if TYPE_CHECKING:
    from ._stream import Stream


class LevelSequence(Sequence[Mesh]):
    """The levels of a stream, or some of them: `stream[2:5]`."""

    def __init__(self, stream: 'Stream', numbers: Optional[range] = None) -> None:
        self._stream = stream
        self._numbers = range(len(stream.levels)) if numbers is None else numbers

    @property
    def levels(self) -> Tuple[Level, ...]:
        """What the index has of them: counts, bytes, errors."""
        return tuple(self._stream.levels[number] for number in self._numbers)

    def __len__(self) -> int:
        return len(self._numbers)

    @overload
    def __getitem__(self, index: int) -> Mesh: ...

    @overload
    def __getitem__(self, index: slice) -> 'LevelSequence': ...

    def __getitem__(self, index: Any) -> Any:
        if isinstance(index, slice):
            return LevelSequence(self._stream, self._numbers[index])
        try:
            return self._stream._level_mesh(self._numbers[index])
        except IndexError:
            raise IndexError('no level %d; there are %d' % (index, len(self))) from None

    def __repr__(self) -> str:
        return '<tetlod.LevelSequence of %s: %d levels>' % (self._stream._source.name, len(self))


class FieldSequence(Sequence[Any]):
    """A field's values, of the points of each level, or of each step of a series: `stream['p'][-1]`,
    `stream['p'][2:5]`, `stream['p'].sel(time=0.4)`. It is decoded without the others."""

    def __init__(self, name: str, meshes: Union[LevelSequence, StepSequence]) -> None:
        self.name, self.meshes = name, meshes

    @property
    def times(self) -> Tuple[float, ...]:
        """Of the steps; () where these are levels."""
        return self.meshes.times if isinstance(self.meshes, StepSequence) else ()

    def within(self, error: Optional[Fraction]) -> 'FieldSequence':
        """The same steps at an error."""
        return FieldSequence(self.name, self._steps().within(error))

    def isel(self, time: Union[int, slice]) -> Any:
        return self._values(self._steps().isel(time))

    def sel(self, time: Union[float, slice], method: Optional[str] = None) -> Any:
        return self._values(self._steps().sel(time, method))

    def __len__(self) -> int:
        return len(self.meshes)

    def __getitem__(self, index: Any) -> Any:
        return self._values(self.meshes[index])

    def __repr__(self) -> str:
        kind = 'steps' if isinstance(self.meshes, StepSequence) else 'levels'
        return '<tetlod.FieldSequence %s: %d %s>' % (self.name, len(self), kind)

    def _steps(self) -> StepSequence:
        if not isinstance(self.meshes, StepSequence):
            raise ValueError('%r has no steps: its values are those of levels' % self.name)
        return self.meshes

    def _values(self, found: Any) -> Any:
        return found.fields[self.name] if isinstance(found, Mesh) else FieldSequence(self.name, found)
