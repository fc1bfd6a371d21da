/* SPDX-License-Identifier: BSD-3-Clause */
#include "tests/reader_fuzz.h"

int LLVMFuzzerTestOneInput(const uint8_t *bytes, size_t size);

int LLVMFuzzerTestOneInput(const uint8_t *bytes, size_t size)
{
    reader_fuzz("in.inp", &(struct io_input){.bytes = bytes, .size = size});
    return 0;
}
