/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * Triangles out of a tetrahedral mesh: its boundary, an isosurface of a field, a plane section, the surface of a part.
 * Exact for fields that are linear on each tetrahedron: there a level set is flat, and values along an edge are linear.
 * Vertices are shared: one per vertex or edge of the mesh that is met.
 */
#ifndef TETLOD_CUT_H
#define TETLOD_CUT_H

#include "src/cut/pairs.h"
#include "src/mesh/tetmesh.h"

/* Each vertex lies between two vertices of the mesh, at `along` from the first to the second. Begins zeroed; what an
 * earlier call has made is replaced, in its memory. */
struct cut {
    uint32_t vertex_count, triangle_count, line_count;
    uint32_t *ends;      /* [2 * vertex_count] of the mesh; twice the same for a vertex of the mesh */
    double *along;       /* [vertex_count] 0 .. 1 */
    /* [3 * triangle_count] counter-clockwise seen from where the function is larger, or from outside */
    uint32_t *triangles;
    uint32_t *tets;      /* [triangle_count] that each triangle is of */
    uint32_t *lines;     /* [2 * line_count] by cut_lines */
    size_t vertex_cap, along_cap, triangle_cap, tet_cap, line_cap, below_cap;
    struct pairs pairs;  /* working space: which vertex lies between two of the mesh; which lines there are */
    uint8_t *below;      /* working space: [mesh's vertex_count] is the function negative? */
};

void cut_fini(struct cut *cut);

/* The faces of one tetrahedron (or of three), seen from outside: closed. It holds while vertices move, as long as none
 * of them turns a tetrahedron inside out. */
TETLOD_CHECKED enum tetlod_status cut_boundary(const struct tetmesh *mesh, struct cut *out, struct tetlod_error *error);

/* Where the piecewise linear function with these values at the vertices is zero. A face in which it is zero belongs to
 * the surface once, if it is negative on one side. */
TETLOD_CHECKED enum tetlod_status cut_zero(const struct tetmesh *mesh, const double *values, struct cut *out,
                                           struct tetlod_error *error);

/* The surface of the part of the mesh where the function is negative: the boundary's triangles (of cut_boundary), as
 * far as they are in it, and where it is zero, closed. */
TETLOD_CHECKED enum tetlod_status cut_clip(const struct tetmesh *mesh, const struct cut *boundary, const double *values,
                                           struct cut *out, struct tetlod_error *error);

/* Triangles and lines of another surface, as far as they are where the function with these values at that surface's
 * vertices is negative. `out`'s vertices lie between two of that surface. */
TETLOD_CHECKED enum tetlod_status cut_trim(const struct cut *surface, const double *values, struct cut *out,
                                           struct tetlod_error *error);

/* Fills `lines` with the edges of the cells in the surface, each once: edges of the mesh, and where the zero set meets
 * faces. `values` are those of the function; a boundary has none. */
TETLOD_CHECKED enum tetlod_status cut_lines(struct cut *cut, const double *values, struct tetlod_error *error);

/* The value of an array of the mesh ([components * vertex_count]) at a vertex of the surface. */
static inline double cut_value(const struct cut *cut, uint32_t vertex, const double *values, uint32_t components,
                               uint32_t component)
{
    double a = values[(size_t)cut->ends[2 * (size_t)vertex] * components + component];
    double b = values[(size_t)cut->ends[2 * (size_t)vertex + 1] * components + component];
    return a + cut->along[vertex] * (b - a);
}

/* Unit normals [3 * vertex_count] for smooth shading, of the surface with these points: the triangles' mean by area. */
void cut_normals(const struct cut *cut, const float *points, float *normals);

#endif
