/* SPDX-License-Identifier: BSD-3-Clause */
/* tetlod extract --points: the values of a level at points, as CSV or VTP. */
#ifndef TETLOD_PROBE_H
#define TETLOD_PROBE_H

#include "src/mesh/tetmesh.h"

/* Whether a file of values at points can have the name. */
bool probe_is_output(const char *path);

/* `points` is a file with a point in each line, or the points themselves: x,y,z;x,y,z. */
TETLOD_CHECKED enum tetlod_status probe_write(const struct tetmesh *mesh, const char *points, const char *output,
                                              struct tetlod_error *error);

#endif
