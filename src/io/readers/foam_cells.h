/* SPDX-License-Identifier: BSD-3-Clause */
/* The cells of an OpenFOAM mesh, out of its faces. */
#ifndef TETLOD_FOAM_CELLS_H
#define TETLOD_FOAM_CELLS_H

#include "src/io/readers/foam_text.h"

/* Reads constant/polyMesh of the case. */
TETLOD_CHECKED enum tetlod_status foam_cells(struct cells *out, const struct io_input *input,
                                             struct tetlod_error *error);

#endif
