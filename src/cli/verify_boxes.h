/* SPDX-License-Identifier: BSD-3-Clause */
/* Are the sums by boxes and regions of a stream (section KSUM) those of its original? */
#ifndef TETLOD_VERIFY_BOXES_H
#define TETLOD_VERIFY_BOXES_H

#include "src/mesh/tetmesh.h"

/* Holds the section against the finest level of a lossless stream; others, and none, are accepted. ERR_STREAM. */
TETLOD_CHECKED enum tetlod_status verify_boxes(const struct tetlod_file *file, const struct tetmesh *finest,
                                               struct tetlod_error *error);

#endif
