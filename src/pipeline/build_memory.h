/* SPDX-License-Identifier: BSD-3-Clause */
#ifndef TETLOD_BUILD_MEMORY_H
#define TETLOD_BUILD_MEMORY_H

#include "src/pipeline/build_options.h"

/* Bytes that building a stream takes at its peak, the mesh included, about: each phase frees what is its own before the
 * next. */
uint64_t build_bytes(const struct tetmesh *mesh, const struct build_options *options);

/* Bytes that must be resident where it is built by cells of options->paged tetrahedra and large arrays may be in files,
 * about. */
uint64_t build_spooled_bytes(const struct build_options *options);

/* Bytes that one of several programs which share the work may take: half more than its share of what one takes alone,
 * and two of the largest cells; no less than must be resident. `mesh` NULL: it is not known yet, so that alone. */
uint64_t build_share_bytes(const struct tetmesh *mesh, const struct build_options *options, uint32_t members);

/* Where a build is to be, so that options->memory (0: no limit) is enough: in memory as it was asked for; else by cells
 * that spool, where the caller can keep large arrays in files. ERR_LIMIT, with the figures: neither does. */
TETLOD_CHECKED enum tetlod_status build_fit_memory(const struct tetmesh *mesh, struct build_options *options,
                                                   struct tetlod_error *error);

/* ERR_LIMIT, with the figure, if a build that does not spool takes more than options->memory. */
TETLOD_CHECKED enum tetlod_status build_check_memory(const struct tetmesh *mesh, const struct build_options *options,
                                                     struct tetlod_error *error);

#endif
