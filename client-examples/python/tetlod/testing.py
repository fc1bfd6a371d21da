# SPDX-License-Identifier: BSD-3-Clause
"""Regression tests of results, on any meshes of one domain: `tetlod diff` for pytest and unittest.

    from tetlod.testing import assert_same

    def test_pressure():
        assert_same('reference.tetlod', 'run/result.vtu', 'p', '2%')

Results are paths of streams or mesh files, URLs of streams, or meshes in memory (a Mesh, a grid of VTK, a meshio mesh).
"""
from __future__ import annotations

import os
import tempfile
from typing import Any, Dict, Sequence, Tuple, Union

from ._answers import chosen_step, run
from ._build import arrays_of, save_any

Limit = Union[float, str]
Times = Union[float, Sequence[float], None]
Steps = Union[int, Sequence[int], None]


def difference(a: Any, b: Any, field: str, limit: Union[Limit, None] = None, *, norm: str = 'max', time: Times = None,
               step: Steps = None) -> Dict[str, Any]:
    """What `tetlod diff --json` says: 'verdict', and 'max' and 'rms' with 'lower' and 'upper'.

    time, step: of series; a pair is one for each.
    """
    options = ['--field', field, '--norm', norm, *chosen_step(time, step)]
    return compared(a, b, options + ([] if limit is None else ['--limit', str(limit)]))[1]


def assert_same(a: Any, b: Any, field: str, limit: Limit, *, norm: str = 'max', time: Times = None,
                step: Steps = None) -> None:
    """AssertionError unless the difference of `field` is certainly at most `limit`: in its units, or '2%' of its range
    in a."""
    judge(difference(a, b, field, limit, norm=norm, time=time, step=step))


def assert_limits(a: Any, b: Any, limits: Union[str, 'os.PathLike[str]']) -> None:
    """The same for every field of a tolerance file, which has a line for each: `p 2%`."""
    found = compared(a, b, ['--limits', os.fspath(limits)])[1]
    for one in found['fields']:
        judge(one)


def judge(found: Dict[str, Any]) -> None:
    bounds = found[found['norm']]
    if found['verdict'] != 'within':
        raise AssertionError('%s: the %s difference is from %.9g to %.9g, the limit is %.9g (%s)%s' % (
            found['field'], {'max': 'largest', 'rms': 'rms'}[found['norm']], bounds['lower'], bounds['upper'],
            found['limit'], found['verdict'], where(found)))


def where(found: Dict[str, Any]) -> str:
    place = found['where'].get('place')
    return ', near (%.6g, %.6g, %.6g)' % tuple(place) if place else ''


def compared(a: Any, b: Any, options: Sequence[str]) -> Tuple[int, Dict[str, Any]]:
    with tempfile.TemporaryDirectory(prefix='tetlod-') as folder:
        places = [place_of(result, os.path.join(folder, name)) for result, name in ((a, 'a.vtu'), (b, 'b.vtu'))]
        return run(['diff', *places, *options])


def place_of(result: Any, path: str) -> str:
    """Where the program finds it."""
    if isinstance(result, (str, os.PathLike)):
        return os.fspath(result)
    save_any(path, result, arrays_of(result, None, None, None))
    return path
