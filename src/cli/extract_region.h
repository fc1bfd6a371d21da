/* SPDX-License-Identifier: BSD-3-Clause */
/* A level that is finer in boxes, out of a stream for `tetlod extract`. */
#ifndef TETLOD_EXTRACT_REGION_H
#define TETLOD_EXTRACT_REGION_H

#include "src/cli/stream_input.h"
#include "src/stream/region.h"

/* `about` becomes how many tetrahedra each part has, and how far it is off at most: certified where the fine level is
 * in pages, else measured in the transition. */
TETLOD_CHECKED enum tetlod_status extract_region(const struct stream_input *input, const struct region *region,
                                                 struct tetmesh *out, char *about, size_t about_size,
                                                 struct tetlod_error *error);

#endif
