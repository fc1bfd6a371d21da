/* SPDX-License-Identifier: BSD-3-Clause */
/* tetlod extract --time, --step: one step of a series. */
#ifndef TETLOD_EXTRACT_STEP_H
#define TETLOD_EXTRACT_STEP_H

#include "src/mesh/tetmesh.h"

struct step_choice {
    bool by_time;
    double time;   /* the nearest step's is taken */
    uint64_t step; /* or its number */
    double error;  /* a fraction of the range over the series, or in the fields' units */
    bool absolute;
    uint32_t before, total; /* steps of the topology groups before, and of all of them; 0: there is one mesh */
};

/* The step as a mesh with the series' fields, and in `about` which it is and what is promised of it. */
TETLOD_CHECKED enum tetlod_status extract_step(struct tetlod_file *file, const struct step_choice *choice, bool original_order,
                                               struct tetmesh *out, char *about, size_t about_size, struct tetlod_error *error);

#endif
