/* SPDX-License-Identifier: BSD-3-Clause */
/* An EnSight case, its geometry, and two variables. */
#include "tests/reader_fuzz.h"

int LLVMFuzzerTestOneInput(const uint8_t *bytes, size_t size);

int LLVMFuzzerTestOneInput(const uint8_t *bytes, size_t size)
{
    static const char *const names[] = {"mesh.case", "mesh.geo", "p", "q"};
    reader_fuzz_folder(names, sizeof names / sizeof *names, bytes, size);
    return 0;
}
