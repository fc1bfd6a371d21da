/* SPDX-License-Identifier: BSD-3-Clause */
/* The values of a series' steps in a temporary file, as the build reads them (build_series.h). */
#ifndef TETLOD_SERIES_SPOOL_H
#define TETLOD_SERIES_SPOOL_H

#include "src/pipeline/build.h"
#include "src/util/spool.h"

/* Appends the controlled fields of a step, each in its type. `first` is the mesh of the first step, whose fields
 * `controls` count; magnitudes and components become fields of `mesh`. TETLOD_MORE: a field needs float64 after all;
 * its type says so now, and what was appended is to be made again. ERR_FIELD if a field is missing or has other
 * components. */
TETLOD_CHECKED enum tetlod_status series_spool_put(struct spool *spool, struct tetmesh *mesh,
                                                   const struct tetmesh *first, const struct build_control *controls,
                                                   uint32_t count, enum tetlod_type *types, struct tetlod_error *error);

#endif
