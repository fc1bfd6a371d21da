# SPDX-License-Identifier: BSD-3-Clause
"""tetlod for xarray: `xarray.open_dataset('x.tetlod', error='1%')`. Nothing is decoded before values are asked for."""
from __future__ import annotations

import os
from typing import Any, Callable, Dict, Iterable, List, Optional, Tuple

import numpy as np
from xarray import Dataset, Variable
from xarray.backends import BackendArray, BackendEntrypoint
from xarray.core import indexing

from ._model import Choice, Fraction
from ._sequences import FieldSequence
from ._stream import Stream, open as open_stream

Shape = Tuple[int, ...]


class Lazy(BackendArray):
    """An array that a function gives; with `step`, one for each number of its first axis."""

    def __init__(self, shape: Shape, dtype: Any, read: Callable[..., Any], steps: bool) -> None:
        self.shape, self.dtype, self.read, self.steps = shape, np.dtype(dtype), read, steps

    def __getitem__(self, key: Any) -> Any:
        return indexing.explicit_indexing_adapter(key, self.shape, indexing.IndexingSupport.BASIC, self._get)

    def _get(self, key: Tuple[Any, ...]) -> Any:
        if not self.steps:
            return np.asarray(self.read())[key]
        first, rest = key[0], key[1:]
        if not isinstance(first, slice):
            return np.asarray(self.read(int(first)))[rest]
        numbers = range(self.shape[0])[first]
        found = [np.asarray(self.read(number))[rest] for number in numbers]
        return np.stack(found) if found else np.empty((0, *self.shape[1:]), self.dtype)[(slice(None), *rest)]


class TetlodBackend(BackendEntrypoint):
    description = 'tetlod streams: a level of detail of a tetrahedral mesh, or the steps of a series'

    def open_dataset(self, filename_or_obj: Any, *, drop_variables: Optional[Iterable[str]] = None,
                     error: Optional[Fraction] = None, abs_error: Optional[float] = None, level: Optional[int] = None,
                     tets: Optional[int] = None, headers: Any = None) -> Dataset:
        """The choice is as in `tetlod.read`; of a series `error` and `abs_error` choose, and time is a coordinate."""
        choice = Choice(error, abs_error, level, tets)
        stream = open_stream(filename_or_obj, level=0, headers=headers)
        variables = of_steps(stream, choice) if stream.times else of_level(stream, choice)
        for name in [drop_variables] if isinstance(drop_variables, str) else drop_variables or ():
            variables.pop(name, None)
        made = Dataset(variables, attrs={'tetlod_id': stream.info.cid})
        made.set_close(stream.close)
        return made.set_coords([name for name in ('time', 'points') if name in variables])

    def guess_can_open(self, filename_or_obj: Any) -> bool:
        return isinstance(filename_or_obj, (str, os.PathLike)) and os.fspath(filename_or_obj).endswith('.tetlod')


def variable(dims: List[str], shape: Shape, dtype: Any, read: Callable[..., Any], **attributes: Any) -> Variable:
    lazy = indexing.LazilyIndexedArray(Lazy(shape, dtype, read, dims[0] == 'time'))
    return Variable(dims, lazy, attrs=attributes)


def of_level(stream: Stream, choice: Choice) -> Dict[str, Variable]:
    number = stream.level_for(**vars(choice))
    here = stream.levels[number]
    apart = stream[0:]  # a cursor of its own

    def read(what: Callable[[Any], Any]) -> Callable[[], Any]:
        return lambda: what(apart[number])

    made = {'points': variable(['vertex', 'xyz'], (here.vertices, 3), float, read(lambda mesh: mesh.points)),
            'tets': variable(['tet', 'corner'], (here.tets, 4), np.uint32, read(lambda mesh: mesh.tets))}
    for field in stream.fields:
        values = stream[field.name]
        shape, dims = shaped(here.vertices, field, ['vertex'])
        made[field.name] = variable(dims, shape, float, lambda values=values: values[number],
                                    max_error=here.errors[field.name].get('max'))
    return made


def of_steps(stream: Stream, choice: Choice) -> Dict[str, Variable]:
    """All steps in one form, so that they have one mesh."""
    if stream.info.topologies:
        raise ValueError('the meshes of the steps differ, a dataset has one: use tetlod.open(...).steps')
    steps = stream._decoder.steps
    assert steps is not None  # there are times
    band = steps.band_for(choice)
    error, level = steps.bands[band]
    here, meshes, count = stream.levels[level], stream.steps.in_band(band), len(steps.times)
    points = (lambda step: meshes[step].points) if steps.moves else (lambda: meshes[0].points)
    dims = ['time', 'vertex', 'xyz'][0 if steps.moves else 1:]
    made = {'time': Variable(['time'], np.array(steps.times)),
            'points': variable(dims, (count, here.vertices, 3)[-len(dims):], float, points),
            'tets': variable(['tet', 'corner'], (here.tets, 4), np.uint32, lambda: meshes[0].tets)}
    for field in stream.fields:
        if field.name in steps.ranges:
            values = FieldSequence(field.name, meshes)
            shape, dims = shaped(here.vertices, field, ['time', 'vertex'])
            made[field.name] = variable(dims, (count, *shape), float, lambda step, values=values: values[step],
                                        max_error=error)
    return made


def shaped(vertices: int, field: Any, dims: List[str]) -> Tuple[Shape, List[str]]:
    if field.components == 1:
        return (vertices,), dims
    return (vertices, field.components), [*dims, 'component_%d' % field.components]
