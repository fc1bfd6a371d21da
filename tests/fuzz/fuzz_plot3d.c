/* SPDX-License-Identifier: BSD-3-Clause */
/* The first byte tells how many of the bytes are the grid: all, or in 255ths; the rest is the solution. */
#include "tests/reader_fuzz.h"

int LLVMFuzzerTestOneInput(const uint8_t *bytes, size_t size);

int LLVMFuzzerTestOneInput(const uint8_t *bytes, size_t size)
{
    if (size == 0)
        return 0;
    size_t grid = (size - 1) * bytes[0] / 255;
    struct io_input input = {.bytes = bytes + 1, .size = grid};
    if (bytes[0] < 255) {
        input.other = bytes + 1 + grid;
        input.other_size = size - 1 - grid;
        input.other_path = "solution.bin";
    }
    reader_fuzz("grid.xyz", &input);
    return 0;
}
