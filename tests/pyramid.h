/* SPDX-License-Identifier: BSD-3-Clause */
/* A square of corners 1 to 4 with a raised middle, vertex 0, over a point below: contracting the middle to a corner
 * leaves the flat square. */
#ifndef TETLOD_PYRAMID_H
#define TETLOD_PYRAMID_H

#include <string.h>

#include "src/mesh/tetmesh.h"

struct pyramid {
    double positions[18];
    uint32_t corners[16];
    struct tetmesh mesh; /* without fields; nothing of it is to be freed */
};

static inline void pyramid_init(struct pyramid *out)
{
    static const double positions[] = {0, 0, 0.25, 1, 1, 0, -1, 1, 0, -1, -1, 0, 1, -1, 0, 0, 0, -1};
    static const uint32_t corners[] = {0, 1, 2, 5, 0, 2, 3, 5, 0, 3, 4, 5, 0, 4, 1, 5};
    memcpy(out->positions, positions, sizeof positions);
    memcpy(out->corners, corners, sizeof corners);
    out->mesh = (struct tetmesh){.vertex_count = 6, .tet_count = 4, .position_type = TETLOD_FLOAT64,
                                 .positions = out->positions,
                                 .corners = out->corners};
}

#endif
