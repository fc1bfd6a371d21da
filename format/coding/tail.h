/* SPDX-License-Identifier: BSD-3-Clause */
/* The exact tail of a field (SPEC 9.3): from the values on its grid to the original's, bit for bit. Not installed. */
#ifndef TETLOD_TAIL_H
#define TETLOD_TAIL_H

#include "format/coding/recorder.h"

/* Codes the exact values of `vertices` vertices whose codes the column has, both ways: an encoder's are in `exact`
 * [components * vertices], a decoder's are put there. ERR_STREAM, ERR_NOMEM. */
TETLOD_CHECKED enum tetlod_status tetlodi_tail_code(struct tetlodi_coder *coder, const struct tetlodi_column *column,
                                                    uint32_t vertices, double *exact, struct tetlod_error *error);

#endif
