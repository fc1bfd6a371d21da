/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * Four doubles at a time. The same operations on every machine, in the same order for each of the four, so that the
 * plain form gives the same bits as the others. The greater of two is a > b ? a : b, as the instruction has it.
 */
#ifndef TETLOD_WIDE_H
#define TETLOD_WIDE_H

#include <string.h>

enum { WIDE = 4 };

#if defined(__AVX2__)
#include <immintrin.h>

typedef __m256d wide;

static inline wide wide_of(double a, double b, double c, double d) { return _mm256_set_pd(d, c, b, a); }
static inline wide wide_all(double a) { return _mm256_set1_pd(a); }
static inline wide wide_load(const double *p) { return _mm256_loadu_pd(p); }
static inline void wide_store(double *p, wide a) { _mm256_storeu_pd(p, a); }

/* The first of them, up to four, and 0; nothing behind them is read. */
static inline wide wide_load_some(const double *p, unsigned count)
{
    return _mm256_maskload_pd(p, _mm256_cmpgt_epi64(_mm256_set1_epi64x(count), _mm256_set_epi64x(3, 2, 1, 0)));
}

static inline wide wide_add(wide a, wide b) { return _mm256_add_pd(a, b); }
static inline wide wide_sub(wide a, wide b) { return _mm256_sub_pd(a, b); }
static inline wide wide_mul(wide a, wide b) { return _mm256_mul_pd(a, b); }
static inline wide wide_div(wide a, wide b) { return _mm256_div_pd(a, b); }
static inline wide wide_max(wide a, wide b) { return _mm256_max_pd(a, b); }
static inline wide wide_min(wide a, wide b) { return _mm256_min_pd(a, b); }
static inline wide wide_sqrt(wide a) { return _mm256_sqrt_pd(a); }
static inline wide wide_abs(wide a) { return _mm256_andnot_pd(_mm256_set1_pd(-0.0), a); }

/* Bit i is set where a is at most b in place i. */
static inline unsigned wide_at_most(wide a,
                                    wide b) { return (unsigned)_mm256_movemask_pd(_mm256_cmp_pd(a, b, _CMP_LE_OQ)); }

/* In how many places it is. */
static inline unsigned wide_count_at_most(wide a, wide b) { return (unsigned)__builtin_popcount(wide_at_most(a, b)); }

/* Columns of four rows. */
static inline void wide_columns(const double *const row[4], wide out[4])
{
    wide a = wide_load(row[0]), b = wide_load(row[1]), c = wide_load(row[2]), d = wide_load(row[3]);
    wide e = _mm256_unpacklo_pd(a, b), f = _mm256_unpackhi_pd(a, b), g = _mm256_unpacklo_pd(c, d),
         h = _mm256_unpackhi_pd(c, d);
    out[0] = _mm256_permute2f128_pd(e, g, 0x20);
    out[1] = _mm256_permute2f128_pd(f, h, 0x20);
    out[2] = _mm256_permute2f128_pd(e, g, 0x31);
    out[3] = _mm256_permute2f128_pd(f, h, 0x31);
}

static inline double wide_greatest(wide a)
{
    __m128d b = _mm_max_pd(_mm256_castpd256_pd128(a), _mm256_extractf128_pd(a, 1));
    return _mm_cvtsd_f64(_mm_max_sd(b, _mm_unpackhi_pd(b, b)));
}

static inline double wide_least(wide a)
{
    __m128d b = _mm_min_pd(_mm256_castpd256_pd128(a), _mm256_extractf128_pd(a, 1));
    return _mm_cvtsd_f64(_mm_min_sd(b, _mm_unpackhi_pd(b, b)));
}

#else

#include <math.h>

typedef struct {
    double at[4];
} wide;

#define WIDE_EACH(expression)                                                                                          \
    wide out;                                                                                                          \
    for (int i = 0; i < WIDE; i++)                                                                                     \
        out.at[i] = (expression);                                                                                      \
    return out

static inline wide wide_of(double a, double b, double c, double d) { return (wide){{a, b, c, d}}; }
static inline wide wide_all(double a) { return (wide){{a, a, a, a}}; }
static inline wide wide_load(const double *p) { WIDE_EACH(p[i]); }
static inline wide wide_load_some(const double *p, unsigned count) { WIDE_EACH((unsigned)i < count ? p[i] : 0); }
static inline void wide_store(double *p, wide a) { memcpy(p, a.at, sizeof a.at); }
static inline wide wide_add(wide a, wide b) { WIDE_EACH(a.at[i] + b.at[i]); }
static inline wide wide_sub(wide a, wide b) { WIDE_EACH(a.at[i] - b.at[i]); }
static inline wide wide_mul(wide a, wide b) { WIDE_EACH(a.at[i] * b.at[i]); }
static inline wide wide_div(wide a, wide b) { WIDE_EACH(a.at[i] / b.at[i]); }
static inline wide wide_max(wide a, wide b) { WIDE_EACH(a.at[i] > b.at[i] ? a.at[i] : b.at[i]); }
static inline wide wide_min(wide a, wide b) { WIDE_EACH(a.at[i] < b.at[i] ? a.at[i] : b.at[i]); }
static inline wide wide_sqrt(wide a) { WIDE_EACH(sqrt(a.at[i])); }
static inline wide wide_abs(wide a) { WIDE_EACH(fabs(a.at[i])); }

static inline unsigned wide_at_most(wide a, wide b)
{
    unsigned bits = 0;
    for (int i = 0; i < WIDE; i++)
        bits |= (unsigned)(a.at[i] <= b.at[i]) << i;
    return bits;
}

static inline unsigned wide_count_at_most(wide a, wide b)
{
    unsigned count = 0;
    for (int i = 0; i < WIDE; i++)
        count += a.at[i] <= b.at[i];
    return count;
}

static inline void wide_columns(const double *const row[4], wide out[4])
{
    for (int i = 0; i < WIDE; i++)
        out[i] = (wide){{row[0][i], row[1][i], row[2][i], row[3][i]}};
}

static inline double wide_greatest(wide a)
{
    double b = a.at[0] > a.at[2] ? a.at[0] : a.at[2], c = a.at[1] > a.at[3] ? a.at[1] : a.at[3];
    return b > c ? b : c;
}

static inline double wide_least(wide a)
{
    double b = a.at[0] < a.at[2] ? a.at[0] : a.at[2], c = a.at[1] < a.at[3] ? a.at[1] : a.at[3];
    return b < c ? b : c;
}

#undef WIDE_EACH
#endif

static inline wide wide_dot(wide a, wide b, wide c, wide d, wide e, wide f)
{
    return wide_add(wide_add(wide_mul(a, b), wide_mul(c, d)), wide_mul(e, f));
}

/* a b - c d */
static inline wide wide_cross(wide a, wide b, wide c, wide d)
{
    return wide_sub(wide_mul(a, b), wide_mul(c, d));
}

#endif
