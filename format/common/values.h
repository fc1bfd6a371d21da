/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * Numbers of a mesh as integers (SPEC 5): a float's code keeps its order and its every bit (-0.0 is just below 0.0);
 * a quantised number's code is its step. Predictions are made in double and become codes by plain rounding. Not
 * installed.
 */
#ifndef TETLOD_VALUES_H
#define TETLOD_VALUES_H

#include "format/common/arithmetic.h"

#include <math.h>
#include <string.h>

#include "format/common/round.h"
#include "format/tetlod.h"

enum { MAX_COMPONENTS = 64 };

/* How one column is coded. bits = 0: bit for bit as `type`. Else value = (type)(origin + step * code), 0 <= code <
 * 2^bits. */
struct tetlodi_scale {
    enum tetlod_type type;     /* float32 also for an original of float64 all of whose values are float32 values */
    enum tetlod_type original;
    unsigned bits;
    double origin[3], step[3]; /* of the axes of positions; a field has the first only */
};

static inline int64_t code_from_double(double value)
{
    uint64_t bits;
    memcpy(&bits, &value, sizeof bits);
    return (int64_t)(bits ^ (0 - (bits >> 63)) >> 1); // -1 - m has the bits of m turned
}

static inline double code_to_double(int64_t code)
{
    uint64_t bits = (uint64_t)code ^ (0 - ((uint64_t)code >> 63)) >> 1;
    double value;
    memcpy(&value, &bits, sizeof value);
    return value;
}

static inline int64_t code_from_float(float value)
{
    uint32_t bits;
    memcpy(&bits, &value, sizeof bits);
    return (int32_t)(bits ^ (0 - (bits >> 31)) >> 1);
}

static inline float code_to_float(int64_t code)
{
    uint32_t bits = (uint32_t)code ^ (0 - ((uint32_t)code >> 31)) >> 1;
    float value;
    memcpy(&value, &bits, sizeof value);
    return value;
}

/* The code of the nearest float of a type, and back. */
static inline int64_t float_code(enum tetlod_type type, double value)
{
    return type == TETLOD_FLOAT32 ? code_from_float((float)value) : code_from_double(value);
}

static inline double float_value(enum tetlod_type type, int64_t code)
{
    return type == TETLOD_FLOAT32 ? (double)code_to_float(code) : code_to_double(code);
}

/* The code nearest to a predicted value, which may be anything, NaN included for the float types. */
static inline int64_t scale_code(const struct tetlodi_scale *scale, unsigned axis, double value)
{
    if (scale->bits) {
        double most = (double)((UINT32_C(1) << scale->bits) - 1);
        double code = floor((value - scale->origin[axis]) / scale->step[axis] + 0.5);
        if (!(code > 0))
            return 0;
        return (int64_t)(code < most ? code : most);
    }
    return float_code(scale->type, value);
}

static inline double scale_value(const struct tetlodi_scale *scale, unsigned axis, int64_t code)
{
    if (scale->bits) {
        double value = scale->origin[axis] + scale->step[axis] * (double)code;
        return tetlodi_round(scale->type, value);
    }
    return float_value(scale->type, code);
}

/* Bits of a code's ring: differences of codes are taken modulo 2^width. */
static inline unsigned scale_width(const struct tetlodi_scale *scale)
{
    return scale->bits ? scale->bits : scale->type == TETLOD_FLOAT32 ? 32 : 64;
}

/* a - b as a number of `width` bits with a sign. */
static inline int64_t code_difference(int64_t a, int64_t b, unsigned width)
{
    uint64_t ring = ((uint64_t)a - (uint64_t)b) << (64 - width);
    return (int64_t)ring >> (64 - width);
}

/* The code at a difference from another: the inverse of code_difference in a. */
static inline int64_t code_offset(int64_t base, int64_t difference, const struct tetlodi_scale *scale)
{
    unsigned width = scale_width(scale);
    uint64_t ring = ((uint64_t)base + (uint64_t)difference) << (64 - width);
    return scale->bits ? (int64_t)(ring >> (64 - width)) : (int64_t)ring >> (64 - width);
}

/* Bits of the distance between two codes. */
static inline uint64_t code_distance(int64_t a, int64_t b)
{
    return a > b ? (uint64_t)a - (uint64_t)b : (uint64_t)b - (uint64_t)a;
}

/* Bytes of one value of a cell. */
static inline unsigned cell_width(enum tetlod_cell_type type)
{
    static const unsigned char widths[] = {4, 8, 1, 2, 4, 8};
    return widths[type];
}

#endif
