/* SPDX-License-Identifier: BSD-3-Clause */
/* tetlod build --for mail: one small file. Values are rounded within a tenth of the error, and the levels beyond the
 * error are cut off. */
#ifndef TETLOD_MAIL_H
#define TETLOD_MAIL_H

#include "src/pipeline/quantise.h"
#include "src/util/buffer.h"

#define MAIL_ERROR 0.01

/* Sets the rounding of values, if the user has not. Positions stay as they are: thin cells at a wall do not bear
 * rounding. */
void mail_round(struct quantise_options *quantise, double error);

/* Writes the levels of a stream up to the coarsest one within an error. ERR_ARGUMENT if none is. */
TETLOD_CHECKED enum tetlod_status mail_write(const struct buffer *whole, double limit,
                                             const struct tetlodi_sink *sink,
                                             struct tetlod_error *error);

#endif
