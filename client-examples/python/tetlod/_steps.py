# SPDX-License-Identifier: BSD-3-Clause
"""Which step in time, and which band of errors, a caller wants."""
from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Dict, Tuple

from ._model import Choice


@dataclass(frozen=True)
class Steps:
    """The steps in time of a stream. `bands`: error and level of each, coarse to fine; `ranges` by field, over all
    steps; do points move?"""
    times: Tuple[float, ...]
    bands: Tuple[Tuple[float, int], ...]
    ranges: Dict[str, Tuple[float, float]]
    moves: bool

    def band_for(self, choice: Choice) -> int:
        """The coarsest band within the error; without an error, the exact one. ValueError if there is none."""
        limit = choice.fraction or 0.0
        if choice.abs_error is not None:
            widths = [high - low for low, high in self.ranges.values()]
            limit = min((choice.abs_error / width if width > 0 else math.inf for width in widths), default=math.inf)
        for band, (error, _) in enumerate(self.bands):
            if error <= limit:
                return band
        raise ValueError('no band of the series has an error of at most %g; the finest has %g' % (limit, self.bands[-1][0]))

    def step_for(self, time: float) -> int:
        """The step whose time is nearest: the first of several."""
        if not math.isfinite(time):
            raise ValueError('a time is a number, not %r' % time)
        return min(range(len(self.times)), key=lambda step: abs(self.times[step] - time))
