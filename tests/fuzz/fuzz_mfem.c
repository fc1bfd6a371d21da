/* SPDX-License-Identifier: BSD-3-Clause */
/* An MFEM mesh and a grid function. */
#include "tests/reader_fuzz.h"

int LLVMFuzzerTestOneInput(const uint8_t *bytes, size_t size);

int LLVMFuzzerTestOneInput(const uint8_t *bytes, size_t size)
{
    reader_fuzz_two("mesh.mesh", "heat.gf", bytes, size);
    return 0;
}
