/* SPDX-License-Identifier: BSD-3-Clause */
/* io_read of a file that is in memory, for tests. */
#ifndef TETLOD_READ_INPUT_H
#define TETLOD_READ_INPUT_H

#include "src/io/services/assemble.h"
#include "src/io/services/report.h"
#include "src/mesh/tetmesh.h"

/* io_read for a file that is in memory; the path only tells the extension, messages do not have it. On failure *out may
 * hold what there is so far. */
TETLOD_CHECKED enum tetlod_status io_read_input(struct tetmesh *out, const char *path, const struct io_input *input,
                                                struct io_report *report, struct tetlod_error *error);

#endif
