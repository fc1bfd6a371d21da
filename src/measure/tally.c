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

void tally_result(const struct tally *tallies, size_t chunks, double scale, size_t counted, double *out_most, double *out_rms)
{
    double squares = 0, most = 0;
    for (size_t i = 0; i < chunks; i++) {
        squares += tallies[i].squares;
        most = tallies[i].most > most ? tallies[i].most : most;
    }
    *out_most = most;
    *out_rms = counted ? sqrt(squares / (double)counted) / scale : 0;
}
