/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * Predictions are made in binary64, each operation rounded by itself (SPEC 2.2). A compiler that fuses, reorders or
 * widens them would decode other meshes without noticing. What can be switched off is switched off here, whatever the
 * flags; what cannot is refused. Included before any function that computes. Not installed.
 */
#ifndef TETLOD_ARITHMETIC_H
#define TETLOD_ARITHMETIC_H

#include <float.h>

#if defined(__clang__)
#pragma clang fp contract(off)
#elif defined(__GNUC__)
#pragma GCC optimize("fp-contract=off")
#else
#pragma STDC FP_CONTRACT OFF
#endif

#if defined(__FAST_MATH__) || defined(__ASSOCIATIVE_MATH__) || defined(__RECIPROCAL_MATH__) ||                         \
    defined(__NO_SIGNED_ZEROS__) || (defined(__FINITE_MATH_ONLY__) && __FINITE_MATH_ONLY__)
#error "tetlod must not be compiled with -ffast-math or parts of it: streams would decode wrong"
#endif
/* 16, of machines that compute in binary16 (-mavx512fp16): float and double are evaluated in their own precision, as
 * with 0 */
#if !defined(FLT_EVAL_METHOD) || (FLT_EVAL_METHOD != 0 && FLT_EVAL_METHOD != 16)
#error "tetlod needs double arithmetic in double precision; on 32-bit x86 compile with -msse2 -mfpmath=sse"
#endif
#if FLT_RADIX != 2 || DBL_MANT_DIG != 53 || FLT_MANT_DIG != 24
#error "tetlod needs IEEE 754 binary32 and binary64"
#endif

/* Does this program, as it was compiled and as it runs, round as the format wants? 0: no. */
int tetlodi_arithmetic_holds(void);

#endif
