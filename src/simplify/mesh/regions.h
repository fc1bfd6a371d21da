/* SPDX-License-Identifier: BSD-3-Clause */
/* Where regions of the mesh meet, such as materials: vertices there stay where they are, and others may only be
 * contracted into them. */
#ifndef TETLOD_REGIONS_H
#define TETLOD_REGIONS_H

#include "src/mesh/tetmesh.h"

/* Adds VERTEX_FIXED to flags[i] of each vertex whose tetrahedra have different numbers in `regions` [tet]. `vertex` [i]
 * is its number in the mesh (NULL: i). `regions` may be NULL: one region. ERR_NOMEM. */
TETLOD_CHECKED enum tetlod_status regions_fix(const struct tetmesh *mesh, const double *regions,
                                              const uint32_t *vertex, uint8_t *flags,
                                              struct tetlod_error *error);

/* The same of each vertex for which `fixed` [number in the mesh] says so; it may be NULL. */
void regions_fix_vertices(uint32_t vertex_count, const bool *fixed, const uint32_t *vertex, uint8_t *flags);

#endif
