/* SPDX-License-Identifier: BSD-3-Clause */
/* Steps whose mesh changes: which have the same tetrahedra, and what all of them come to (format/SPEC.md, 3.8). */
#ifndef TETLOD_SERIES_TOPOLOGIES_H
#define TETLOD_SERIES_TOPOLOGIES_H

#include "src/cli/series_input.h"

struct series_topology {
    uint32_t from, count; /* steps of the series */
    uint32_t tets;
};

struct series_topologies {
    uint32_t count;
    struct series_topology *groups; /* owned, as the rest */
    size_t room;
    double *times;       /* [step] */
    double (*ranges)[2]; /* [name] over all steps and components */
};

/* Reads all steps, one at a time: the fields with these names have to be at each. `numbered` is set if the times do not
 * rise. ERR_MESH for steps that are not of one series; the message names the step. */
TETLOD_CHECKED enum tetlod_status series_topologies_find(struct series_topologies *out, struct series_input *input,
                                                         const struct reading *reading, const char *const *names,
                                                         uint32_t count, struct progress *progress,
                                                         struct tetlod_error *error);
void series_topologies_fini(struct series_topologies *topologies);

#endif
