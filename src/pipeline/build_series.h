/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * A series in time over one mesh: the steps' values of the controlled fields drive one contraction, and are stored
 * beside its levels (format/SPEC.md, 3.7). Where not all steps fit the memory, key steps drive; the others are
 * certified by retracing the sequence (src/simplify/retrace.h). A band's level is the coarsest one that is within the
 * band's error at every step.
 */
#ifndef TETLOD_BUILD_SERIES_H
#define TETLOD_BUILD_SERIES_H

#include "src/log/contraction_log.h"
#include "src/pipeline/build_options.h"

/* The bands of a series whose user names none. */
const double *build_series_bands(uint32_t *out_count);

struct series_build;

/* `mesh` is the one that is contracted: its positions have the type that new ones are rounded to. *out is to be freed
 * in any case. Both are borrowed. ERR_NOMEM; ERR_MESH for a range that errors cannot be relative to. */
TETLOD_CHECKED enum tetlod_status series_new(struct series_build **out, const struct tetmesh *mesh,
                                             const struct build_options *options,
                                             struct tetlod_error *error);
void series_free(struct series_build *series);

/* simplify() with the steps' fields as well. `weights` [control] are limits of the controls' own (fields_init). The log
 * is that of `mesh`: its marks have the errors of the first step. ERR_LIMIT if fewer steps fit than have to
 * drive. */
TETLOD_CHECKED enum tetlod_status series_contract(struct series_build *series, struct contraction_log *log,
                                                  const struct tetmesh *mesh, const double *weights,
                                                  const struct simplify_options *options, struct tetlod_error *error);

/* The writer's late sections (struct tetlodi_write_input): `opaque` is the series. */
enum tetlod_status series_sections(void *opaque, const uint32_t *original_of, const struct tetlodi_late_rows *rows,
                                   const struct tetlodi_write_section **out, uint32_t *count,
                                   struct tetlod_error *error);

/* Steps that drove. */
uint32_t series_key_count(const struct series_build *series);

#endif
