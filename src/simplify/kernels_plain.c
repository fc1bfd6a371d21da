/* SPDX-License-Identifier: BSD-3-Clause */
#define KERNELS kernels_plain
#include "src/simplify/kernels_body.h"

const struct kernels *kernels_choose(void)
{
#if defined(__x86_64__)
    if (__builtin_cpu_supports("avx2"))
        return &kernels_avx2;
#endif
    return &kernels_plain;
}
