/* SPDX-License-Identifier: BSD-3-Clause */
/* The formats that libraries read (VTKHDF, XDMF, Exodus, CGNS), which want a file: one in memory. */
#define _GNU_SOURCE // memfd_create
#include <stdio.h>
#include <sys/mman.h>
#include <unistd.h>

#include "tests/reader_fuzz.h"

int LLVMFuzzerTestOneInput(const uint8_t *bytes, size_t size);

int LLVMFuzzerTestOneInput(const uint8_t *bytes, size_t size)
{
    char path[64];
    int file = memfd_create("input", 0);
    if (file < 0 || write(file, bytes, size) != (ssize_t)size)
        return 0;
    snprintf(path, sizeof path, "/proc/self/fd/%d", file);
    reader_fuzz("in.cgns", &(struct io_input){.bytes = bytes, .size = size, .path = path});
    close(file);
    return 0;
}
