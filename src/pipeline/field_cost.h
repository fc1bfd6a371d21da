/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * Which controlled field costs most tetrahedra. The level within FIELD_COST_ERROR is contracted further, within the
 * same error, without that field: the bounds of the other fields go on where they stand, so that what is left has
 * proved errors, too. A build without the field from the start finds about as many tetrahedra. The level is small:
 * this takes a part of the build's time.
 */
#ifndef TETLOD_FIELD_COST_H
#define TETLOD_FIELD_COST_H

#include "src/log/contraction_log.h"
#include "src/simplify/simplify.h"

static const double FIELD_COST_ERROR = 0.01;

struct field_cost {
    uint32_t field;             /* TETLOD_NONE: there is none that costs much */
    uint32_t tets_with, tets_without;
};

/* `log` is of the mesh, with the bounds of its nodes (log_keep_bounds), by simplify with these options in its default
 * metric; all fields `controlled` have the same limit. ERR_NOMEM. */
TETLOD_CHECKED enum tetlod_status field_cost_find(struct field_cost *out, const struct tetmesh *mesh,
                                                  const struct contraction_log *log, const uint32_t *controlled,
                                                  uint32_t count, const struct simplify_options *options,
                                                  struct tetlod_error *error);

#endif
