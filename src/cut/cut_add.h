/* SPDX-License-Identifier: BSD-3-Clause */
/* How the files of this folder fill a cut. */
#ifndef TETLOD_CUT_ADD_H
#define TETLOD_CUT_ADD_H

#include <stdbool.h>

#include "format/tetlod.h"

struct cut;
struct tetmesh;

/* No vertices, triangles and lines; the memory stays. */
void cut_empty(struct cut *cut);

/* False: out of memory. */
bool cut_add_vertex(struct cut *cut, uint32_t a, uint32_t b, double along, uint32_t *out);
/* A triangle of a tetrahedron. One of fewer than three different vertices is none. */
bool cut_add_triangle(struct cut *cut, uint32_t tet, uint32_t a, uint32_t b, uint32_t c);

/* Has the tetrahedron with these corners a negative volume? */
bool cut_is_inverted(const struct tetmesh *mesh, const uint32_t *corners);

/* TETLOD_OK, or the failure of what could not be made. */
enum tetlod_status cut_result(bool made, const struct cut *cut, struct tetlod_error *error);

#endif
