/* SPDX-License-Identifier: BSD-3-Clause */
/* Bytes under checksums that match: what is behind them must stand alone. */
#include <stdlib.h>
#include <string.h>

#include "tests/stream_fuzz.h"

int LLVMFuzzerTestOneInput(const uint8_t *bytes, size_t size);

int LLVMFuzzerTestOneInput(const uint8_t *bytes, size_t size)
{
    uint8_t *copy = malloc(size ? size : 1);
    if (!copy || size > 1 << 16) {
        free(copy);
        return 0;
    }
    memcpy(copy, bytes, size);
    stream_fuzz_seal(copy, size);
    stream_fuzz(copy, size);
    free(copy);
    return 0;
}
