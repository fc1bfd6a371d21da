/* SPDX-License-Identifier: BSD-3-Clause */
/* Floating point numbers of 113 bits: long double where it has them, the compiler's own type elsewhere. */
#ifndef TETLOD_QUAD_H
#define TETLOD_QUAD_H

#include <float.h>

#if LDBL_MANT_DIG >= 113
typedef long double quad;
#else
__extension__ typedef __float128 quad;
#endif

#endif
