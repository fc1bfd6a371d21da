/* SPDX-License-Identifier: BSD-3-Clause */
/* Layers of cells over the surface of a lattice cube: what the shell and the delta are made of. */
#ifndef TETLOD_SAMPLE_LAYERS_H
#define TETLOD_SAMPLE_LAYERS_H

#include "format/tetlod.h"

/* Which points of the lattice {0..size}^3 the surface has: all six sides, or the three sides where a coordinate is
 * `size`. */
enum surface_sides { SIDES_ALL, SIDES_FAR };

struct surface {
    uint32_t size, point_count, quad_count;
    uint32_t (*points)[3]; /* owned */
    uint32_t (*quads)[4];  /* owned; indices of points */
    uint32_t *index;       /* owned, [(size+1)^3]: lattice point to index in points, or TETLOD_NONE */
};

TETLOD_CHECKED enum tetlod_status surface_init(struct surface *surface, uint32_t size, enum surface_sides sides,
                                               struct tetlod_error *error);
void surface_fini(struct surface *surface);

#endif
