/* SPDX-License-Identifier: BSD-3-Clause */
#ifndef TETLOD_BUILD_MEMORY_H
#define TETLOD_BUILD_MEMORY_H

#include "src/pipeline/build_options.h"

/* Bytes that building a stream takes at its peak, the mesh included, about: each phase frees what is its own before the
 * next. */
uint64_t build_bytes(const struct tetmesh *mesh, const struct build_options *options);

/* ERR_LIMIT, with the figure, if that is more than options->memory (0: no limit). */
TETLOD_CHECKED enum tetlod_status build_check_memory(const struct tetmesh *mesh, const struct build_options *options,
                                                     struct tetlod_error *error);

#endif
