/* SPDX-License-Identifier: BSD-3-Clause */
/* The values of a series' steps in a temporary file, as the build reads them (build_series.h). */
#ifndef TETLOD_SERIES_SPOOL_H
#define TETLOD_SERIES_SPOOL_H

#include "src/pipeline/build_series.h"
#include "src/util/spool.h"

/* Appends the controlled fields of a step, each in its type. `first` is the mesh of the first step, whose fields
 * `controls` count; magnitudes and components become fields of `mesh`. TETLOD_MORE: a field needs float64 after all;
 * its type says so now, and what was appended is to be made again. ERR_FIELD if a field is missing or has other
 * components. */
TETLOD_CHECKED enum tetlod_status series_spool_put(struct spool *spool, struct tetmesh *mesh,
                                                   const struct tetmesh *first, const struct build_control *controls,
                                                   uint32_t count, enum tetlod_type *types, struct tetlod_error *error);

/* The fields of cells of the first step, as they are before any step is put: [cell_field_count]. */
void series_spool_cells(const struct tetmesh *first, struct build_series_cells *cells);

/* Appends one step's values of cells, of the fields that the first step has. A field that a step lacks, or has in
 * another form, has no steps: the first step's values stand in its place. ERR_IO, ERR_NOMEM. */
TETLOD_CHECKED enum tetlod_status series_spool_put_cells(struct spool *spool, const struct tetmesh *mesh,
                                                         const struct tetmesh *first, struct build_series_cells *cells,
                                                         struct tetlod_error *error);

#endif
