/* SPDX-License-Identifier: BSD-3-Clause */
/* Dropping tetrahedra that mean nothing: degenerate ones, and all but the first of those with the same corners. */
#ifndef TETLOD_TET_CLEAN_H
#define TETLOD_TET_CLEAN_H

#include "src/mesh/tetmesh.h"

/* Drops them together with their values and adds their number to *io_dropped. ERR_NOMEM, ERR_MESH if none is left. */
TETLOD_CHECKED enum tetlod_status tet_clean(struct tetmesh *mesh, uint64_t *io_dropped, struct tetlod_error *error);

#endif
