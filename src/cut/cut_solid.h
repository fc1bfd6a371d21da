/* SPDX-License-Identifier: BSD-3-Clause */
/* The part of a mesh in which linear functions are negative, as tetrahedra: those that a zero set passes through are
 * divided there. Neighbours are divided alike, so that faces fit. */
#ifndef TETLOD_CUT_SOLID_H
#define TETLOD_CUT_SOLID_H

#include "src/cut/pairs.h"
#include "src/mesh/tetmesh.h"

enum { SOLID_SUPPORT = 4 };

/* Vertices are the mesh's, and behind them new ones, each between two that come before it. Begins zeroed; what an
 * earlier call has made is replaced, in its memory. */
struct cut_solid {
    uint32_t old_count, new_count, tet_count;
    uint32_t *ends;               /* [2 * new_count] */
    double *along;                /* [new_count] 0 .. 1 from the first to the second */
    uint32_t (*of)[SOLID_SUPPORT]; /* [new_count] corners of the mesh's edge, face or tetrahedron that it is in */
    uint32_t *corners, *tets;     /* [4 * tet_count]; [tet_count] as begin() had them */
    uint8_t *on;                  /* [vertices] bit k: it is in the zero set of cut k */
    uint32_t cuts;
    size_t end_cap, along_cap, of_cap, corner_cap, tet_cap, on_cap, old_corner_cap, old_tet_cap;
    struct pairs pairs;               /* working space: which vertex lies between two others */
    uint32_t *old_corners, *old_tets; /* working space: as they were before the last cut */
};

void cut_solid_fini(struct cut_solid *solid);

/* All of the tetrahedra with these corners, of a mesh of so many vertices; `tets`: numbers of theirs. ERR_NOMEM. */
TETLOD_CHECKED enum tetlod_status cut_solid_begin(uint32_t vertices, const uint32_t *corners, const uint32_t *tets,
                                                  uint32_t tet_count, struct cut_solid *out,
                                                  struct tetlod_error *error);

/* From now on only what is where the function with these values at the vertices is negative. At most 8 times. */
TETLOD_CHECKED enum tetlod_status cut_solid_below(struct cut_solid *solid, const double *values,
                                                  struct tetlod_error *error);

/* An array of the mesh, which has room behind it, at the new vertices. */
void cut_solid_extend(const struct cut_solid *solid, double *values, uint32_t components);

/* Is a line that these vertices span an edge that was there before, a side of where a face was cut, or where two cuts
 * meet? Others only divide what was one. `in_zero_set`: it is where another function is zero. */
bool cut_solid_is_edge(const struct cut_solid *solid, const uint32_t *vertices, uint32_t count, bool in_zero_set);

#endif
