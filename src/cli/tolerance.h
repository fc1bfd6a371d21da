/* SPDX-License-Identifier: BSD-3-Clause */
/* What rounding may do to a figure of the index before it is refused. Values are taken less one of them: how far a
 * field is from 0 does not matter. */
#ifndef TETLOD_TOLERANCE_H
#define TETLOD_TOLERANCE_H

/* What every user of an error has to allow (PROOF.md, 3). */
static const double TIE = 1e-9;

/* As a fraction of the range: what rounding makes of an error at samples; differences that the overlay does not look
 * for. */
static const double NOISE = 1e-14, NO_DIFFERENCE = 1e-12;

/* Where a maximum is promised, in the field's units. */
static inline double largest_difference(double max, const double range[2])
{
    return (max * (1 + TIE) + NO_DIFFERENCE) * (range[1] - range[0]);
}

#endif
