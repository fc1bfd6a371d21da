/* SPDX-License-Identifier: BSD-3-Clause */
/* Finds the tetrahedron of a coarsening that holds a point, from one that is near. */
#ifndef TETLOD_WALK_H
#define TETLOD_WALK_H

#include "src/log/coarsening.h"

enum { WALK_CELLS = 512 };

/* A component of a field: of vertex v it is values[v * stride]. */
struct walk_component {
    const double *values;
    size_t stride;
};

/* A tetrahedron as affine functions: weights[1 + i](p) = rows[i] . (p - origin). */
struct walk_cell {
    uint32_t tet;
    bool flat, thin; /* no volume; so little that weights have few digits that are right */
    uint32_t slots[4], across[4]; /* corners; the neighbours, as the coarsening has them */
    double origin[3], rows[3][3];
    double *values; /* as walk_gather makes them */
};

/* One thread's cache of cells, and its list of those that a search along a line has seen. */
struct walker {
    const struct coarsening *mesh; /* borrowed */
    size_t width;
    struct walk_component *components; /* [width] of all fields of the mesh */
    struct walk_cell *cells;       /* [WALK_CELLS] by the number's last bits */
    double *values;                /* theirs */
    uint32_t *seen;                /* [seen_count] */
    size_t seen_count, seen_capacity;
    uint32_t *table;               /* [table_size, a power of two] hashed: those of `seen`, or TETLOD_NONE */
    size_t table_size;
};

/* out [4][width]: the values at the first of four vertices, and what those at the others are above it. */
void walk_gather(const struct walk_component *components, size_t width, const uint32_t vertices[4], double *out);

TETLOD_CHECKED enum tetlod_status walker_init(struct walker *walker, const struct coarsening *mesh,
                                              struct tetlod_error *error);
void walker_fini(struct walker *walker);

/* After a step the cells are not what they were. */
void walker_reset(struct walker *walker);

/* The tetrahedron may be walked from soon: what is known of it is on its way into the processor's cache; once it is
 * there, what is known of its corners. */
static inline void walk_expect(const struct walker *walker, uint32_t tet)
{
    if (walker->cells[tet % WALK_CELLS].tet == tet)
        return;
    __builtin_prefetch(walker->mesh->corners + 4 * (size_t)tet);
    __builtin_prefetch(walker->mesh->neighbours + 4 * (size_t)tet);
}

static inline void walk_expect_corners(const struct walker *walker, uint32_t tet)
{
    if (walker->cells[tet % WALK_CELLS].tet == tet)
        return;
    for (size_t i = 4 * (size_t)tet; i < 4 * (size_t)tet + 4; i++)
        __builtin_prefetch(walker->mesh->positions + 3 * (size_t)walker->mesh->corners[i]);
}

/* From `from` across the face that p is furthest behind. The cell that holds p (weights >= -1e-9), or NULL if the walk
 * leaves the mesh, comes to a flat tetrahedron, or does not end soon: that decides nothing. */
const struct walk_cell *walk_to(struct walker *walker, uint32_t from, const double p[3], double weights[4]);

/* Through all tetrahedra, face to face, that the straight line from `start`, a point of the tetrahedron `from`, to p
 * meets. Where `start` is the boundary's closest point to p, NULL says that p is outside. *out_room is false if memory
 * was short. */
const struct walk_cell *walk_along(struct walker *walker, uint32_t from, const double start[3], const double p[3],
                                   double weights[4], bool *out_room);

#endif
