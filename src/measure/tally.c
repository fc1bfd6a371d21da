/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/measure/tally.h"

#include <math.h>

double tally_scale(const double a[2], const double b[2])
{
    double least = a[0] < b[0] ? a[0] : b[0], greatest = a[1] > b[1] ? a[1] : b[1], half = greatest / 2 - least / 2;
    int exponent = -1000; // of half the range: the range itself may be no number
    half = half > 0 ? half : fabs(greatest); // of a constant only the rounding is left
    if (half > 0)
        frexp(half, &exponent);
    exponent = exponent < -1000 ? -1000 : exponent;
    return ldexp(1, -exponent - 1);
}

void tally_add_up(const double *errors, size_t count, double scale, struct tally *out)
{
    enum { LANES = 4 };
    double squares[LANES] = {0}, most[LANES] = {0};
    for (size_t i = 0; i < count / LANES * LANES; i += LANES)
        for (size_t k = 0; k < LANES; k++) {
            double e = errors[i + k] * scale;
            squares[k] += e * e;
            most[k] = errors[i + k] > most[k] ? errors[i + k] : most[k];
        }
    for (size_t i = count / LANES * LANES; i < count; i++) {
        double e = errors[i] * scale;
        squares[0] += e * e;
        most[0] = errors[i] > most[0] ? errors[i] : most[0];
    }
    for (int k = 1; k < LANES; k++) {
        squares[0] += squares[k];
        most[0] = most[k] > most[0] ? most[k] : most[0];
    }
    *out = (struct tally){squares[0], most[0]};
}

void tally_add_up_kept(const float *errors, size_t count, double scale, struct tally *out)
{
    typedef float four_floats __attribute__((vector_size(16), aligned(4)));
    typedef int32_t four_ints __attribute__((vector_size(16)));
    typedef double four_doubles __attribute__((vector_size(32)));
    four_doubles squares = {0};
    four_ints most = {0}; // bits of numbers that are not negative are in their order
    for (size_t i = 0; i + 4 <= count; i += 4) {
        const four_floats kept = *(const four_floats *)(errors + i);
        const four_doubles wide = __builtin_convertvector(kept, four_doubles);
        const four_ints bits = (four_ints)kept, more = bits > most;
        squares += wide * wide;
        most = (bits & more) | (most & ~more);
    }
    *out = (struct tally){(squares[0] + squares[1]) + (squares[2] + squares[3]), 0};
    float greatest[4];
    memcpy(greatest, &most, sizeof greatest);
    for (size_t i = count / 4 * 4; i < count; i++) {
        out->squares += (double)errors[i] * (double)errors[i];
        greatest[0] = errors[i] > greatest[0] ? errors[i] : greatest[0];
    }
    for (int k = 0; k < 4; k++)
        out->most = (double)greatest[k] > out->most ? (double)greatest[k] : out->most;
    out->most /= scale;
}

void tally_result(const struct tally *tallies, size_t chunks, double scale, size_t counted, double *out_most,
                  double *out_rms)
{
    double squares = 0, most = 0;
    for (size_t i = 0; i < chunks; i++) {
        squares += tallies[i].squares;
        most = tallies[i].most > most ? tallies[i].most : most;
    }
    *out_most = most;
    *out_rms = counted ? sqrt(squares / (double)counted) / scale : 0;
}
