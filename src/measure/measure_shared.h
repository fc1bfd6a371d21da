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
    struct kept_mesh kept; /* of the mesh what helpers have from a call before, borrowed; empty: nothing */
    bool (*progress)(void *opaque, double done); /* false cancels; may be NULL */
    void *progress_opaque;
};

struct shared_measuring;

/* Begins to measure the level of each mark that is asked for, bit for bit as measure_levels_next does. What the levels
 * borrow stays where it is until the end. ERR_NOMEM, ERR_LIMIT, ERR_CANCELLED, or what the share fails with. */
TETLOD_CHECKED enum tetlod_status measure_shared_begin(struct shared_measuring **out,
                                                       const struct shared_levels *levels, struct tetlod_error *error);

/* Of a member that writes, once: what has been measured, measured [mark][field] and domains [mark]; waits for it. As
 * above. */
TETLOD_CHECKED enum tetlod_status measure_shared_end(struct shared_measuring *measuring, struct measured *measured,
                                                     double *domains, struct tetlod_error *error);
void measure_shared_free(struct shared_measuring *measuring);

/* Of a helper, once it is called (work_share.h): its share of the measuring; what it has kept goes with it. `settle`
 * hears true when it has what it works on, which changes no more, and false when that is gone; NULL: nobody asks.
 * ERR_NOMEM, ERR_LIMIT, or what the share fails with. */
TETLOD_CHECKED enum tetlod_status measure_help(const struct work_share *share, unsigned threads,
                                               struct kept_mesh *kept, void (*settle)(bool measures),
                                               struct tetlod_error *error);

#endif
