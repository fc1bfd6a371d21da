/* SPDX-License-Identifier: BSD-3-Clause */
#define _GNU_SOURCE // madvise
#include "src/util/pages.h"

#include <stdint.h>
#include <sys/mman.h>
#include <unistd.h>

void pages_drop(void *begin, size_t size)
{
    uintptr_t page = (uintptr_t)sysconf(_SC_PAGESIZE), first = ((uintptr_t)begin + page - 1) / page * page,
              end = ((uintptr_t)begin + size) / page * page;
    if (end > first)
        madvise((char *)begin + (first - (uintptr_t)begin), end - first, MADV_DONTNEED);
}
