/* SPDX-License-Identifier: BSD-3-Clause */
/* The piecewise linear function along a segment: exact, one piece for each tetrahedron that the segment passes
 * through. */
#ifndef TETLOD_LINE_H
#define TETLOD_LINE_H

#include "src/mesh/tetmesh.h"

/* Where a piece begins or ends: `at` from 0 to 1 along the segment. */
struct cut_line_end {
    double at, value;
};

/* In order along the segment. Where two pieces do not meet, the segment is outside of the mesh. Begins zeroed; its
 * memory is used again. */
struct cut_line {
    uint32_t count;
    struct cut_line_end *ends; /* [2 * count]: begin and end of each piece */
    size_t cap;
};

void cut_line_fini(struct cut_line *line);

/* `values` are those at the mesh's vertices; `of_tets`, if not NULL, those of its tetrahedra, instead. Of several
 * tetrahedra over one stretch the one that begins first gives the values; degenerate ones give none. ERR_NOMEM. Costs
 * O(tetrahedra). */
TETLOD_CHECKED enum tetlod_status cut_along(const struct tetmesh *mesh, const double *values, const double *of_tets,
                                            const double from[3], const double to[3], struct cut_line *out,
                                            struct tetlod_error *error);

/* Does the segment pass through a tetrahedron? Then from at[0] to at[1] of it (0 to 1), where the corners have these
 * barycentric weights. */
bool cut_stretch(const double *const corners[4], const double from[3], const double to[3], double at[2],
                 double weights[2][4]);

#endif
