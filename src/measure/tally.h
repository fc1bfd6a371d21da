/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * The largest error and the sum of squares over samples, by chunks of their numbers: the order of additions is fixed,
 * so threads do not change it, and a chunk in which an error changed is added up anew. Measuring by what changed gives
 * the same bits as measuring all of it.
 */
#ifndef TETLOD_TALLY_H
#define TETLOD_TALLY_H

#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include "src/mesh/tetmesh.h"

enum { TALLY_CHUNK = 8192 };

static inline size_t tally_chunks(size_t samples)
{
    return (samples + TALLY_CHUNK - 1) / TALLY_CHUNK;
}

struct tally {
    double squares; /* of errors times the scale */
    double most;
};

/* A power of two that brings errors of a field below 1, so that no square overflows: of two meshes whose values are in
 * these ranges. */
double tally_scale(const double a[2], const double b[2]);

/* An error times the scale, rounded up to what a float holds: it may be kept for every sample. */
static inline float tally_keep(double error, double scale)
{
    float kept = (float)(error * scale);
    uint32_t bits;
    memcpy(&bits, &kept, sizeof bits); // of a number that is not negative: one more is the next one
    bits += (double)kept < error * scale;
    memcpy(&kept, &bits, sizeof kept);
    return kept;
}

/* Of errors that tally_keep made. */
void tally_add_up_kept(const float *errors, size_t count, double scale, struct tally *out);

void tally_add_up(const double *errors, size_t count, double scale, struct tally *out);

/* The largest of all, and the root of the mean square over `counted` samples. */
void tally_result(const struct tally *tallies, size_t chunks, double scale, size_t counted, double *out_most,
                  double *out_rms);

#endif
