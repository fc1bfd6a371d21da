/* SPDX-License-Identifier: BSD-3-Clause */
/* tetlod extract --box: a mesh that is finer in boxes. */
#ifndef TETLOD_EXTRACT_REGION_H
#define TETLOD_EXTRACT_REGION_H

#include "src/stream/region.h"

/* The mesh, and in `about` what is promised of it. The region's fine level is finer than its coarse one. */
TETLOD_CHECKED enum tetlod_status extract_region(struct tetlod_file *file, const struct region *region,
                                                 struct tetmesh *out,
                                                 char *about, size_t about_size, struct tetlod_error *error);

#endif
