/* SPDX-License-Identifier: BSD-3-Clause */
/* An OpenFOAM case: the empty file that marks its folder, the mesh, and two fields. */
#include "tests/reader_fuzz.h"

int LLVMFuzzerTestOneInput(const uint8_t *bytes, size_t size);

int LLVMFuzzerTestOneInput(const uint8_t *bytes, size_t size)
{
    static const char *const names[] = {"case.foam", "constant/polyMesh/points", "constant/polyMesh/faces",
                                        "constant/polyMesh/owner",
                                        "constant/polyMesh/neighbour", "1/p", "1/U"};
    reader_fuzz_folder(names, sizeof names / sizeof *names, bytes, size);
    return 0;
}
