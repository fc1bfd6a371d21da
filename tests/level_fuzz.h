/* SPDX-License-Identifier: BSD-3-Clause */
/* What the program makes of a stream's levels and steps, for the fuzz targets of the stream. */
#ifndef TETLOD_LEVEL_FUZZ_H
#define TETLOD_LEVEL_FUZZ_H

#include "format/tetlod.h"

/* Meshes of the finest level and of each band's steps, with the values of cells and in the original order; levels and
 * regions out of a forest; a file of the first levels; and the same of the topology groups. Aborts if one is not a
 * mesh, or differs from the cursor's. */
void level_fuzz(struct tetlod_file *file);

#endif
