/* SPDX-License-Identifier: BSD-3-Clause */
/* The border of a mesh, which a helper finds (src/util/work_share.h) while the one that leads cuts the mesh. Those that
 * are called keep the mesh, to measure with it later. */
#ifndef TETLOD_BORDER_HELP_H
#define TETLOD_BORDER_HELP_H

#include "src/mesh/mesh_channel.h"
#include "src/simplify/piece.h"
#include "src/util/work_share.h"

/* What the one that leads has to do meanwhile. */
struct border_meanwhile {
    enum tetlod_status (*work)(void *opaque);
    void *opaque;
};

/* What those few keep of the mesh, as the one that leads has it, borrowed; NULL: it was not shared. */
struct kept_mesh border_kept(const struct work_share *share, const struct tetmesh *mesh);

/* Where there are helpers that last, as piece_border_find. ERR_CANCELLED: a member has failed; what `meanwhile` fails
 * with. */
TETLOD_CHECKED enum tetlod_status border_share(const struct work_share *share, struct piece_border *out,
                                               const struct tetmesh *mesh, bool turned,
                                               const struct simplify_options *options,
                                               const struct border_meanwhile *meanwhile, struct tetlod_error *error);

/* Of a helper, once it is called. ERR_NOMEM, ERR_CANCELLED, or what the stage fails with. */
TETLOD_CHECKED enum tetlod_status border_help(const struct work_share *share, unsigned threads,
                                              struct kept_mesh *out, struct tetlod_error *error);

#endif
