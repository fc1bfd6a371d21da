/* SPDX-License-Identifier: BSD-3-Clause */
/* tetlod extract --points: the values of a level at points, as CSV or VTP. */
#ifndef TETLOD_PROBE_H
#define TETLOD_PROBE_H

#include "src/mesh/tetmesh.h"

/* Whether a file of values at points can have the name. */
bool probe_is_output(const char *path);

struct probes {
    double *points; /* [3 * count] */
    size_t count, capacity;
    uint32_t *tets;       /* [count]; TETLOD_NONE: outside */
    double (*weights)[4]; /* [count] */
};

/* `points` is a file with a point in each line, or the points themselves: x,y,z;x,y,z. To be released, also after a
 * failure. */
TETLOD_CHECKED enum tetlod_status probes_read(struct probes *out, const char *points, struct tetlod_error *error);
void probes_fini(struct probes *probes);

/* Locates them in a mesh, and writes what it has there. Once. */
TETLOD_CHECKED enum tetlod_status probes_write(struct probes *probes, const struct tetmesh *mesh, const char *output,
                                               struct tetlod_error *error);

#endif
