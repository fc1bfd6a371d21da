/* SPDX-License-Identifier: BSD-3-Clause */
/* What a number becomes in a type. Not installed. */
#ifndef TETLOD_ROUND_H
#define TETLOD_ROUND_H

#include "format/tetlod.h"

static inline double tetlodi_round(enum tetlod_type type, double value)
{
    return type == TETLOD_FLOAT32 ? (double)(float)value : value;
}

#endif
