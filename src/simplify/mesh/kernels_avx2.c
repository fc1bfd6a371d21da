/* SPDX-License-Identifier: BSD-3-Clause */
/* Built with -mavx2 where the compiler has it. */
#define KERNELS kernels_avx2
#include "src/simplify/mesh/kernels.c"
