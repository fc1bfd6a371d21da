/* SPDX-License-Identifier: BSD-3-Clause */
#include "format/common/arithmetic.h"

/* The operands come through volatiles, so that they are computed when the program runs. */
int tetlodi_arithmetic_holds(void)
{
    volatile double inputs[] = {1 + DBL_EPSILON, 1 - DBL_EPSILON, 1, DBL_EPSILON / 2, DBL_MIN, 1.0 / 3, -1};
    volatile float single;
    double a = inputs[0], b = inputs[1], one = inputs[2], half = inputs[3], least = inputs[4], third = inputs[5],
           minus = inputs[6];
    volatile double product = a * b + minus;            // 0; a fused one is -2^-104
    volatile double sum = (one + half) + half;          // 1; wide or reassociated: more
    volatile double up = one + half * 1.5;              // rounds to nearest
    volatile double down = minus - half;                // a tie goes to the even one
    volatile double small = least / 2;                  // not flushed
    single = (float)third;
    return product == 0 && sum == 1 && up == a && down == -1 && small > 0 && small * 2 == least && single != third &&
           (double)single * 3 > 1;
}
