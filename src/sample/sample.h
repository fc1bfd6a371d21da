/* SPDX-License-Identifier: BSD-3-Clause */
/* Meshes made by formula, the same on every machine. */
#ifndef TETLOD_SAMPLE_H
#define TETLOD_SAMPLE_H

#include "src/mesh/tetmesh.h"

struct sample {
    const char *name, *text; /* one line for --list */
    uint32_t default_size, least_size, most_size;
    enum tetlod_status (*make)(struct tetmesh *out, uint32_t size, struct tetlod_error *error);
    void (*move)(struct tetmesh *mesh, double time); /* sets the fields of a time from 0 to 1; NULL: nothing moves */
};

extern const struct sample samples[]; /* ends with name == NULL */

const struct sample *sample_find(const char *name); /* NULL: there is none */

#endif
