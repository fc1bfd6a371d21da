/* SPDX-License-Identifier: BSD-3-Clause */
/* tetlod extract --time, --step: one step of a series. */
#ifndef TETLOD_EXTRACT_STEP_H
#define TETLOD_EXTRACT_STEP_H

#include "src/stream/level_mesh.h"
#include "src/mesh/tetmesh.h"
#include "src/stream/selection.h"

/* The step as a mesh with the series' fields, and in `about` which it is and what is promised of it. */
TETLOD_CHECKED enum tetlod_status extract_step(struct tetlod_file *file, const struct step_selection *selection,
                                               enum level_form form, struct tetmesh *out, char *about,
                                               size_t about_size, struct tetlod_error *error);

#endif
