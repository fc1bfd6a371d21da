/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * The star of a simplex of two to four vertices: all tetrahedra that touch one of them. A tetrahedron that has two of
 * them or more is removed by the contraction; one that has a single one is re-attached, with that corner moved.
 */
#ifndef TETLOD_STAR_H
#define TETLOD_STAR_H

#include "src/simplify/mesh/working.h"

struct star {
    uint32_t simplex[4], simplex_count;
    uint32_t tet_count, removed_count;
    bool at_one_point; /* the simplex's vertices are at one point: contracting it moves nothing */
    uint32_t *tets;
    uint8_t *moving;   /* [tet] the corner that moves, or STAR_REMOVED */
    size_t tet_room, moving_room;
};

enum { STAR_REMOVED = 4 };

void star_fini(struct star *star);

/* Are a simplex's vertices at one point? */
bool simplex_at_one_point(const struct working *working, const uint32_t *simplex, uint32_t count);

/* Gathers the star of a simplex of distinct living vertices. False: no memory. */
bool star_gather(struct star *star, const struct working *working, const uint32_t *simplex, uint32_t count);

/* Would every re-attached tetrahedron be well oriented and not degenerate with the moving corner at p? */
bool star_fits(const struct star *star, const struct working *working, const double p[3]);

#endif
