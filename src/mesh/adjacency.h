/* SPDX-License-Identifier: BSD-3-Clause */
/* Which tetrahedra share a face, and which vertices' stars hold which tetrahedra. */
#ifndef TETLOD_ADJACENCY_H
#define TETLOD_ADJACENCY_H

#include "format/tetlod.h"

enum { ADJACENCY_MAX_TETS = 0x3ffffffe }; /* 4 * tet + face fits 32 bits */

/* neighbours[4*t+f] = 4*t'+f' of the tetrahedron across face f of t (opposite corner f), or TETLOD_NONE on the
 * boundary. A face of more than two tetrahedra has no neighbours on any side; *out_overfull (may be NULL) counts such
 * faces. O(n). */
TETLOD_CHECKED enum tetlod_status adjacency_build(const uint32_t *corners, uint32_t tet_count, uint32_t vertex_count,
                                                  uint32_t *neighbours, uint32_t *out_overfull,
                                                  struct tetlod_error *error);

/* Stars as CSR: the tetrahedra of vertex v are tets[offsets[v] .. offsets[v+1]), ascending. offsets has vertex_count +
 * 1, tets 4 * tet_count elements, both the caller's. O(n). */
void stars_build(const uint32_t *corners, uint32_t tet_count, uint32_t vertex_count, size_t *offsets, uint32_t *tets);

#endif
