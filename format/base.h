/* SPDX-License-Identifier: BSD-3-Clause */
/* The coding of the base mesh (SPEC.md, base mesh), by the same coder as the records: both ways in one. */
#ifndef TETLOD_BASE_H
#define TETLOD_BASE_H

#include "format/records.h"

/* Codes positions, values and corners of the state's arrays, which have room for them. In an encoder the vertices are
 * numbered in the order in which the tetrahedra first have them, and those that none has come last. ERR_STREAM. */
TETLOD_CHECKED enum tetlod_status tetlodi_base_code(struct tetlodi_codec *codec, uint32_t vertices, uint32_t tets,
                                                    struct tetlod_error *error);

/* A float as the difference of its ordered bits from the prediction's (records.c). */
double tetlodi_code_float(struct tetlodi_coder *coder, struct tetlodi_number *model, double value, double predicted,
                          bool wide);

#endif
