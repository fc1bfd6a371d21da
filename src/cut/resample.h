/* SPDX-License-Identifier: BSD-3-Clause */
/* The piecewise linear function at the points of a regular grid (for volume rendering), and at one point. */
#ifndef TETLOD_RESAMPLE_H
#define TETLOD_RESAMPLE_H

#include "src/mesh/tetmesh.h"

/* Begins zeroed; its memory is used again. */
struct cut_grid {
    uint32_t dims[3];
    double origin[3], spacing[3]; /* of the first point; between two points, > 0 */
    float *values;                /* [dims[0] * dims[1] * dims[2]], x fastest; 0 outside */
    uint8_t *inside;              /* 1 where a tetrahedron is */
    double *points, offset;       /* working space: vertices in the grid's own coordinates; what those leave out */
    size_t value_cap, inside_cap, point_cap;
};

void cut_grid_fini(struct cut_grid *grid);

/* Lays the grid over a box: `size` points (>= 2) along its longest side, as many on the others as make cells nearly cubes. */
void cut_grid_cover(struct cut_grid *grid, const double low[3], const double high[3], uint32_t size);

/* Fills values and inside. No point within the mesh is missed; degenerate tetrahedra are. ERR_NOMEM, ERR_LIMIT. */
TETLOD_CHECKED enum tetlod_status cut_resample(const struct tetmesh *mesh, const double *values, struct cut_grid *grid,
                                               struct tetlod_error *error);

/* The tetrahedron that holds p, and p's barycentric weights in it; or the one that p is closest to its inside, if that is no
 * farther than `reach` from each of its faces: then the weights are those of a point in it. TETLOD_NONE if there is none. */
uint32_t cut_probe(const struct tetmesh *mesh, const double p[3], double reach, double weights[4]);

#endif
