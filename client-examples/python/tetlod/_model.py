# SPDX-License-Identifier: BSD-3-Clause
"""What a stream says about itself, and which of its levels a caller wants."""
from __future__ import annotations

import difflib
import math
from dataclasses import dataclass
from typing import Any, Dict, Optional, Sequence, Tuple, Union

MEASURES = ('max', 'sampled', 'rms', 'predicted')
Fraction = Union[float, str]


@dataclass(frozen=True)
class Field:
    """A field of the points. `range` is that of the original over all components; of a local bound, 0 and the largest.
    """
    name: str
    components: int
    type: str
    range: Tuple[float, float]
    controlled: bool
    bounds: Optional[str] = None  # the field whose error this one bounds at every point


@dataclass(frozen=True)
class Level:
    """A level: `bytes` is the length of the prefix that decodes to it, `errors[field][measure]` a fraction of the
    field's range."""
    level: int
    vertices: int
    tets: int
    bytes: int
    domain_error: float
    errors: Dict[str, Dict[str, float]]


@dataclass(frozen=True)
class Topology:
    """Steps of a series over one mesh, where others are over other ones: a stream of its own, `bytes` from `offset` on.
    The first one is the stream itself."""
    steps: int
    times: Tuple[float, ...]
    cid: str
    offset: int
    bytes: int


@dataclass(frozen=True)
class Info:
    """The index of a stream. `cells` are the names of fields whose values belong to tetrahedra; `topologies` is empty
    unless steps in time have different meshes."""
    cid: str
    vertices: int
    tets: int
    bytes: int
    bounds: Tuple[Tuple[float, float, float], Tuple[float, float, float]]
    lossless: bool
    fields: Tuple[Field, ...]
    levels: Tuple[Level, ...]
    metadata: Dict[str, Any]
    cells: Tuple[str, ...]
    topologies: Tuple[Topology, ...] = ()
    paged: Tuple[int, ...] = ()  # levels in pages, of which a region takes some


@dataclass(frozen=True)
class Region:
    """A mesh of some of the pages: of each tetrahedron its level, and the number that it has with all pages."""
    points: Any
    tets: Any
    fields: Dict[str, Any]
    levels: Any
    numbers: Any


@dataclass(frozen=True)
class Choice:
    """Which level: at most one of error, abs_error, level, tets and bytes; without one, the finest."""
    error: Optional[Fraction] = None
    abs_error: Optional[float] = None
    level: Optional[int] = None
    tets: Optional[int] = None
    bytes: Optional[int] = None
    field: Optional[str] = None
    measure: str = 'max'

    def __post_init__(self) -> None:
        given = [name for name in ('error', 'abs_error', 'level', 'tets', 'bytes') if getattr(self, name) is not None]
        if len(given) > 1:
            raise ValueError('give one of %s' % ' or '.join(given))
        if self.measure not in MEASURES:
            raise ValueError('no measure %r; there are %s' % (self.measure, ', '.join(MEASURES)))
        for limit in (self.fraction, self.abs_error):
            if limit is not None and not 0 <= limit < math.inf:
                raise ValueError('an error is a number that is not negative, such as 0.01 or "1%%", not %r' % limit)

    @property
    def fraction(self) -> Optional[float]:
        if isinstance(self.error, str):
            text = self.error.strip()
            try:
                return float(text[:-1]) / 100 if text.endswith('%') else float(text)
            except ValueError:
                raise ValueError('an error is a number such as 0.01 or "1%%", not %r' % self.error) from None
        return self.error

    def query(self) -> Dict[str, str]:
        """The same choice as parameters of the server."""
        asked = {'error': self.fraction, 'abs_error': self.abs_error, 'level': self.level, 'tets': self.tets,
                 'bytes': self.bytes, 'field': self.field, 'measure': None if self.measure == 'max' else self.measure}
        return {name: repr(value) if isinstance(value, float) else str(value)
                for name, value in asked.items() if value is not None}


def fields_meant(fields: Sequence[Field], name: Optional[str]) -> Sequence[Field]:
    """The named field, or every controlled one."""
    meant = [f for f in fields if (f.controlled if name is None else f.name == name)]
    if name is not None and not meant:
        raise unknown_field(name, [f.name for f in fields])
    return meant


class FieldError(KeyError):
    """A field that a stream does not have. As a KeyError, but its message is not in quotes."""

    def __str__(self) -> str:
        return str(self.args[0])


def unknown_field(name: Any, names: Sequence[str]) -> FieldError:
    close = difflib.get_close_matches(str(name), names, 1, 0.5)
    advice = 'is %r meant?' % close[0] if close else 'there are %s' % ', '.join(names)
    return FieldError('no field %r; %s' % (name, advice))


def names_of(fields: Union[str, Sequence[str], None]) -> Optional[Sequence[str]]:
    """One name is a list of one."""
    return [fields] if isinstance(fields, str) else fields


def error_of(level: Level, fields: Sequence[Field], choice: Choice) -> float:
    """The largest error of the fields that are meant, as a fraction of the range; NaN if it is not known."""
    found = [level.errors[f.name].get(choice.measure, math.nan) for f in fields_meant(fields, choice.field)]
    return math.nan if not found or any(map(math.isnan, found)) else max(found)


def level_for(fields: Sequence[Field], levels: Sequence[Level], choice: Choice) -> int:
    """The level that is meant; ValueError if there is none."""
    if choice.level is not None:
        if not 0 <= choice.level < len(levels):
            raise ValueError('no level %d; there are 0 to %d' % (choice.level, len(levels) - 1))
        return choice.level
    if choice.tets is not None or choice.bytes is not None:
        within = [
            i for i, k in enumerate(levels)
            if (k.tets <= choice.tets if choice.tets is not None else k.bytes <= (choice.bytes or 0))
        ]
        return max(within, default=0)
    limit = choice.fraction if choice.abs_error is None else choice.abs_error
    meant = fields_meant(fields, choice.field)
    if limit is None:
        return len(levels) - 1
    for i, level in enumerate(levels):
        units = [1.0 if choice.abs_error is None else f.range[1] - f.range[0] for f in meant]
        if meant and all(level.errors[f.name].get(choice.measure, math.nan) * unit <= limit
                         for f, unit in zip(meant, units)):
            return i
    raise ValueError('no level has an error of at most %g: %s' % (limit, why_none(fields, levels, meant, choice)))


def why_none(fields: Sequence[Field], levels: Sequence[Level], meant: Sequence[Field], choice: Choice) -> str:
    """What to do where no level is within the error."""
    if not meant:
        return 'the stream controls no field; name one by field='
    unknown = [f.name for f in meant if math.isnan(levels[-1].errors[f.name].get(choice.measure, math.nan))]
    if unknown and choice.measure == 'max':
        certified = ', '.join(f.name for f in fields if f.controlled)
        return "%s has no certified error (%s has); measure='sampled' takes the measured one, " \
            'tetlod.build(..., field=[...]) certifies more' % (', '.join(unknown), certified or 'no field')
    found = ['%s has %.3g' % (f.name, levels[-1].errors[f.name].get(choice.measure, math.nan)) for f in meant]
    return '%s at the finest level' % ', '.join(found)
