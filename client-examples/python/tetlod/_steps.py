# SPDX-License-Identifier: BSD-3-Clause
"""Which step in time, and which band of errors, a caller wants."""
from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Callable, Dict, Tuple

from ._model import Choice


def own_ranges(metadata: Dict[str, Any]) -> bool:
    """Do the metadata say that errors of bands are fractions of each step's own range (SPEC 3.7)?"""
    options = metadata.get('options')
    return isinstance(options, dict) and options.get('series_range') == 'step'


@dataclass(frozen=True)
class Steps:
    """The steps in time of a stream. `bands`: error and level of each, coarse to fine; `ranges` by field, over all
    steps; do points move? `error(field, band, step)`: that of one step; `own_ranges`: bands promise fractions of each
    step's own range."""
    times: Tuple[float, ...]
    bands: Tuple[Tuple[float, int], ...]
    ranges: Dict[str, Tuple[float, float]]
    moves: bool
    error: Callable[[int, int, int], float]
    own_ranges: bool

    def band_at(self, step: int, choice: Choice) -> int:
        """The coarsest band in which the step is within the error, by its own errors; without an error, the exact one.
        ValueError if there is none."""
        if choice.abs_error is None and self.own_ranges:
            return self.band_for(choice)
        widths = [high - low if choice.abs_error is not None else 1.0 for low, high in self.ranges.values()]
        limit = choice.abs_error if choice.abs_error is not None else choice.fraction or 0.0
        for band in range(len(self.bands)):
            if all(width <= 0 or self.error(field, band, step) * width <= limit for field, width in enumerate(widths)):
                return band
        return self.band_for(choice)  # which says what there is

    def band_for(self, choice: Choice) -> int:
        """The coarsest band within the error at every step; without an error, the exact one. ValueError if there is
        none."""
        limit = choice.fraction or 0.0
        if choice.abs_error is not None:
            widths = [high - low for low, high in self.ranges.values()]
            limit = min((choice.abs_error / width if width > 0 else math.inf for width in widths), default=math.inf)
        for band, (error, _) in enumerate(self.bands):
            if error <= limit:
                return band
        raise ValueError(
            'no band of the series has an error of at most %g; the finest has %g' % (limit, self.bands[-1][0]))

    def step_for(self, time: float) -> int:
        """The step whose time is nearest: the first of several."""
        if not math.isfinite(time):
            raise ValueError('a time is a number, not %r' % time)
        return min(range(len(self.times)), key=lambda step: abs(self.times[step] - time))
