/* SPDX-License-Identifier: BSD-3-Clause */
/* The errors of all levels, measured by several programs: each takes some of the samples through all levels. */
#ifndef TETLOD_MEASURE_SHARED_H
#define TETLOD_MEASURE_SHARED_H

#include "src/log/contraction_log.h"
#include "src/measure/measure.h"
#include "src/mesh/mesh_channel.h"
#include "src/util/work_share.h"

struct shared_levels {
    const struct tetmesh *original, *mesh; /* as of measure_levels_new, and the mesh that was contracted */
    const struct contraction_log *log;
    const bool *asked;                     /* [mark] it is measured; the last one is */
    const double *domains;                 /* [mark] what the domain error is known to be at least */
    unsigned threads;
    const struct work_share *share;
    const struct kept_mesh *kept; /* of the mesh what helpers have from a call before; empty: nothing */
    bool (*progress)(void *opaque, double done); /* false cancels; may be NULL */
    void *progress_opaque;
};

/* Measures the level of each mark that is asked for, bit for bit as measure_levels_next does: measured [mark][field],
 * domains [mark]. Of members that do not write these are not filled in. ERR_NOMEM, ERR_LIMIT, ERR_CANCELLED, or what
 * the share fails with. */
TETLOD_CHECKED enum tetlod_status measure_shared(const struct shared_levels *levels, struct measured *measured,
                                                 double *domains, struct tetlod_error *error);

/* Of a helper, once it is called (work_share.h): its share of the measuring; what it has kept goes with it. `settle`
 * hears true when it has what it works on, which changes no more, and false when that is gone; NULL: nobody asks.
 * ERR_NOMEM, ERR_LIMIT, or what the share fails with. */
TETLOD_CHECKED enum tetlod_status measure_help(const struct work_share *share, unsigned threads,
                                               struct kept_mesh *kept, void (*settle)(bool measures),
                                               struct tetlod_error *error);

/* Of a helper that is called to be idle meanwhile. */
TETLOD_CHECKED enum tetlod_status measure_idle(const struct work_share *share, struct tetlod_error *error);

#endif
