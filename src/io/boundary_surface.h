/* SPDX-License-Identifier: BSD-3-Clause */
/* The boundary of a mesh as triangles, for the formats of surfaces. */
#ifndef TETLOD_BOUNDARY_SURFACE_H
#define TETLOD_BOUNDARY_SURFACE_H

#include "src/mesh/tetmesh.h"

struct boundary_surface {
    uint32_t (*triangles)[3]; /* owned; the mesh's points, counter-clockwise seen from outside */
    uint32_t count;
    uint32_t *numbers; /* owned, [point of the mesh]: which of the surface's it is, or TETLOD_NONE */
    uint32_t point_count;
};

/* To be freed also after a failure. */
TETLOD_CHECKED enum tetlod_status boundary_surface_find(const struct tetmesh *mesh, struct boundary_surface *out, struct tetlod_error *error);
void boundary_surface_fini(struct boundary_surface *surface);

#endif
