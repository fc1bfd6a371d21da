/* SPDX-License-Identifier: BSD-3-Clause */
/* The fields that a build stores: those of --carry, and those that it needs. */
#ifndef TETLOD_CARRY_H
#define TETLOD_CARRY_H

#include "src/pipeline/build.h"

/* Drops the fields that `list`, names with commas between, does not have: at points but for the controlled ones, whose
 * numbers change, and of cells but for the one that tells regions, if it is not NULL. ERR_FIELD names one that there is
 * not. */
TETLOD_CHECKED enum tetlod_status carry_only(struct tetmesh *mesh, const char *list, const char *region,
                                             struct build_control *controls,
                                             uint32_t count, struct tetlod_error *error);

#endif
