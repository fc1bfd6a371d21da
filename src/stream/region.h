/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * A mesh that is fine in some boxes and coarse elsewhere, out of the finest tetrahedra: each of their corners stands
 * for the nearest of its ancestors that are living, and tetrahedra with two equal corners are dropped. Which vertices
 * are split is chosen so that, of the fine level,
 *   1. every tetrahedron that meets a box is there as it is;
 *   2. no tetrahedron is flipped or degenerate that is not so in a level, and no face has more than two: while there is
 * one, its corner that was contracted last is split. A tetrahedron is one of the fine level, of the coarse level, or of
 * the transition between them, where no certificate holds.
 */
#ifndef TETLOD_REGION_H
#define TETLOD_REGION_H

#include "src/stream/forest.h"
#include "src/util/room.h"

struct region_box {
    double low[3], high[3];
};

enum region_part { REGION_COARSE, REGION_FINE, REGION_TRANSITION, REGION_PARTS };

struct region {
    uint32_t coarse, fine; /* levels, coarse < fine */
    const struct region_box *boxes;
    size_t box_count;
};

struct region_counts {
    uint32_t tets[REGION_PARTS];
    uint32_t rounds; /* of repair */
};

/* The name of the cell field that says each tetrahedron's part. */
#define REGION_FIELD "Region"

/* The mesh; its vertices and tetrahedra are in the order of the levels'. *tets: their numbers in the fine level, the
 * caller's to free. The room (NULL: no limit) is asked for memory as the region grows, and holds both afterwards.
 * ERR_NOMEM, and what the room says. */
TETLOD_CHECKED enum tetlod_status region_mesh(const struct forest *forest, const struct region *region,
                                              struct room *room, struct tetmesh *out, uint32_t **tets,
                                              struct region_counts *counts, struct tetlod_error *error);

/* Memory that making takes beside the forest at most: as if the boxes held everything. */
uint64_t region_most_bytes(const struct tetlod_info *info, const struct region *region);

/* Whether a closed tetrahedron and a closed box have a point in common, or nearly so. */
bool region_meets(const double *const corners[4], const struct region_box *box);

#endif
