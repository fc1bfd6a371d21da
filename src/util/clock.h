/* SPDX-License-Identifier: BSD-3-Clause */
#ifndef TETLOD_CLOCK_H
#define TETLOD_CLOCK_H

/* Seconds of a clock that only goes forward. */
double monotonic_seconds(void);

#endif
