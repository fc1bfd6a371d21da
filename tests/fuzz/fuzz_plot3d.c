/* SPDX-License-Identifier: BSD-3-Clause */
#include "tests/reader_fuzz.h"

int LLVMFuzzerTestOneInput(const uint8_t *bytes, size_t size);

int LLVMFuzzerTestOneInput(const uint8_t *bytes, size_t size)
{
    reader_fuzz_two("grid.xyz", "solution.bin", bytes, size);
    return 0;
}
