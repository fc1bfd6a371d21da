/* SPDX-License-Identifier: BSD-3-Clause */
/* What building one mesh (library.c) and a series (library_series.c) share. */
#ifndef TETLOD_LIBRARY_H
#define TETLOD_LIBRARY_H

#include "src/library/tetlod_build.h"
#include "src/pipeline/build.h"

/* tetlod_build of a copy (library_copy_mesh), with other programs (src/util/work_share.h); NULL: alone. A helper's is
 * empty, and it writes nothing. */
TETLOD_CHECKED enum tetlod_status library_build_copy(struct tetmesh *copy, const struct tetlod_build_options *options,
                                                     const struct work_share *share, const struct tetlodi_sink *sink,
                                                     struct tetlod_error *error);

/* The caller's options of its version of the struct, NULL: the defaults, and the pipeline's. */
TETLOD_CHECKED enum tetlod_status library_options(const struct tetlod_build_options *options,
                                                  struct tetlod_build_options *out, struct build_options *out_build,
                                                  struct tetlod_error *error);

/* Checked, and a copy. To be freed also after a failure. */
TETLOD_CHECKED enum tetlod_status library_copy_mesh(struct tetmesh *out, const struct tetlod_build_mesh *mesh,
                                                    struct tetlod_error *error);

/* The controlled fields, which the caller frees also after a failure, and the one of regions. `has_steps`: it is the
 * first step of a series. */
TETLOD_CHECKED enum tetlod_status library_choose(struct tetmesh *mesh, const struct tetlod_build_options *given,
                                                 bool has_steps,
                                                 struct build_options *build, struct build_control **out_controls,
                                                 struct tetlod_error *error);

/* Builds, with the caller's progress and warnings. */
TETLOD_CHECKED enum tetlod_status library_build(const struct tetmesh *mesh, const struct tetlod_build_options *given,
                                                struct build_options build, const struct tetlodi_sink *sink,
                                                struct tetlod_error *error);

#endif
