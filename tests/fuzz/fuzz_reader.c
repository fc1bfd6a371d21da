/* SPDX-License-Identifier: BSD-3-Clause */
/* Bytes as they are: the checksums stand guard. */
#include "tests/stream_fuzz.h"

int LLVMFuzzerTestOneInput(const uint8_t *bytes, size_t size);

int LLVMFuzzerTestOneInput(const uint8_t *bytes, size_t size)
{
    stream_fuzz(bytes, size);
    return 0;
}
