/* SPDX-License-Identifier: BSD-3-Clause */
/* The piecewise linear function at the points of a regular grid (for volume rendering), and at one point. */
#ifndef TETLOD_RESAMPLE_H
#define TETLOD_RESAMPLE_H

#include "src/mesh/tetmesh.h"

/* Begins zeroed; its memory is used again. */
struct cut_grid {
    uint32_t dims[3];
    double origin[3], spacing[3]; /* of the first point; between two points, > 0 */
    float *values;                /* [dims[0] * dims[1] * dims[2]], x fastest; NaN where no tetrahedron is */
    /* working space: vertices in the grid's own coordinates; what these are rounded relative to */
    double *points, far;
    float *boxes;                 /* the same, four numbers each */
    size_t value_cap, point_cap, box_cap;
};

void cut_grid_fini(struct cut_grid *grid);

/* Lays the grid over a box: `size` points (>= 2) along its longest side, as many on the others as make cells nearly
 * cubes. */
void cut_grid_cover(struct cut_grid *grid, const double low[3], const double high[3], uint32_t size);

/* Fills the values, which are those at vertices, or, if not NULL, those of tetrahedra. No point within the mesh is
 * missed; degenerate tetrahedra are. ERR_NOMEM, ERR_LIMIT. */
TETLOD_CHECKED enum tetlod_status cut_resample(const struct tetmesh *mesh, const double *values, const double *of_tets,
                                               struct cut_grid *grid, struct tetlod_error *error);

/* What is behind a plane: where normal * (p - origin) < 0. */
struct cut_plane {
    double origin[3], normal[3];
};

/* A grid as volume renderers take it. Begins zeroed; its memory is used again. */
struct cut_voxels {
    float *pairs;   /* [2 * points of the grid]: a value, and how much of the point is seen, 0 .. 1 */
    float range[2]; /* least and greatest value inside; 0 and 1 if nothing is */
    size_t pair_cap;
};

void cut_voxels_fini(struct cut_voxels *voxels);

/* Points outside are not seen, and have the value of a neighbour inside if there is one, so that what is interpolated
 * up to the rim stays what it is. `logarithmic`: decimal logarithms of the values. `clip` (or NULL) hides what is not
 * behind it. */
TETLOD_CHECKED enum tetlod_status cut_make_voxels(const struct cut_grid *grid, bool logarithmic,
                                                  const struct cut_plane *clip,
                                                  struct cut_voxels *out, struct tetlod_error *error);

/* The tetrahedron that holds p, and p's barycentric weights in it; or the one that p is closest to its inside, if that
 * is no farther than `reach` from each of its faces: then the weights are those of a point in it. TETLOD_NONE if there
 * is none. */
uint32_t cut_probe(const struct tetmesh *mesh, const double p[3], double reach, double weights[4]);

#endif
