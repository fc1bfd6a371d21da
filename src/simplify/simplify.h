/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * The contraction sequence. The error limit rises along a ladder of rungs; on each rung all contractions that the limit
 * allows are done in the order of the metric's key, so that one sequence serves every error. The queue is lazy: an entry
 * whose star has changed is evaluated again when it surfaces, and what a rung refused is looked at again on the next.
 */
#ifndef TETLOD_SIMPLIFY_H
#define TETLOD_SIMPLIFY_H

#include "src/simplify/boundary.h"
#include "src/simplify/metric.h"

enum { CONTRACT_EDGES = 1, CONTRACT_FACES = 2, CONTRACT_TETS = 4 };

enum certify {
    CERTIFY_FAST,  /* the metric's own limit: the envelope, or what it predicts */
    CERTIFY_EXACT, /* the exact maximum; the metric only orders */
};

struct simplify_options {
    enum metric metric;
    enum certify certify;
    unsigned contract;     /* CONTRACT_... of the kinds of simplices */
    uint32_t candidates;   /* final vertex positions tried on each (candidates_count) */
    double max_error;      /* fraction of the range */
    const double *rungs;   /* limits that are asked for: rungs of the ladder, too. If there are any, no others stand between the round ones */
    uint32_t rung_count;
    uint32_t min_tets;
    double boundary_angle; /* degrees */
    double boundary_limit; /* units of length */
    double boundary_least; /* how far the boundary may move even where it meets another part of it: by rounding */
    const double *regions; /* [tet] its region, or NULL */
    bool local_bound;      /* the log keeps every node's bound */
    double growth;         /* vertices of a level / vertices of the one below */
    unsigned threads;      /* of the rescans; the result does not depend on it */
    bool (*progress)(void *opaque, double done); /* 0..1; false cancels; may be NULL */
    void *progress_opaque;
};

/* Contracts the mesh. `controlled` and `limits` as in fields_init. Only the log is left of it. */
TETLOD_CHECKED enum tetlod_status simplify(struct contraction_log *out, const struct tetmesh *mesh,
                                           const uint32_t *controlled, uint32_t controlled_count, const double *limits,
                                           const struct simplify_options *options, struct tetlod_error *error);

/* Bytes that this takes at its peak, about, without the mesh. */
uint64_t simplify_bytes(const struct tetmesh *mesh, uint32_t controlled_count, const struct simplify_options *options);

#endif
