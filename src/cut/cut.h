/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * Triangles out of a tetrahedral mesh: its boundary, an isosurface of a field, a plane section. Exact for fields that are
 * linear on each tetrahedron: there a level set is flat, and values along an edge are linear. Vertices are shared: one
 * per vertex or edge of the mesh that is met.
 */
#ifndef TETLOD_CUT_H
#define TETLOD_CUT_H

#include "src/mesh/tetmesh.h"

/* Each vertex lies between two vertices of the mesh, at `along` from the first to the second. */
struct cut {
    uint32_t vertex_count, triangle_count;
    uint32_t *ends;      /* [2 * vertex_count] of the mesh; twice the same for a vertex of the mesh */
    double *along;       /* [vertex_count] 0 .. 1 */
    uint32_t *triangles; /* [3 * triangle_count] counter-clockwise seen from where the function is larger, or from outside */
    size_t vertex_cap, along_cap, triangle_cap;
};

void cut_fini(struct cut *surface);

/* The faces that belong to one tetrahedron only, seen from outside. */
TETLOD_CHECKED enum tetlod_status cut_boundary(const struct tetmesh *mesh, struct cut *out, struct tetlod_error *error);

/* Where the piecewise linear function with these values at the vertices is zero. A face in which it is zero belongs to the
 * surface once, if it is negative on one side. */
TETLOD_CHECKED enum tetlod_status cut_zero(const struct tetmesh *mesh, const double *values, struct cut *out,
                                           struct tetlod_error *error);

/* The value of an array of the mesh ([components * vertex_count]) at a vertex of the surface. */
static inline double cut_value(const struct cut *surface, uint32_t vertex, const double *values, uint32_t components,
                                   uint32_t component)
{
    double a = values[(size_t)surface->ends[2 * (size_t)vertex] * components + component];
    double b = values[(size_t)surface->ends[2 * (size_t)vertex + 1] * components + component];
    return a + surface->along[vertex] * (b - a);
}

#endif
