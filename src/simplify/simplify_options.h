/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * What differs between ways of working: the order (enum metric), the limit (enum certify; two metrics have their own),
 * and what is contracted.
 */
#ifndef TETLOD_SIMPLIFY_OPTIONS_H
#define TETLOD_SIMPLIFY_OPTIONS_H

#include <stdbool.h>
#include <stdint.h>

#include "format/common/cuts.h"

enum { CONTRACT_EDGES = 1, CONTRACT_FACES = 2, CONTRACT_TETS = 4 };

/* What orders contractions. */
enum metric {
    METRIC_ENVELOPE,      /* the envelope's error / removed^1.5 */
    METRIC_SVA,           /* the thesis's accumulated prediction, which is the limit, too */
    METRIC_FIELD_QUADRIC, /* field quadric / removed^2; the value is the quadric's best */
    METRIC_QUADRIC,       /* the same with Garland and Heckbert's generalised quadric */
    METRIC_MEASURED,      /* field quadrics; the limit is the true error at samples (measured.h) */
};

/* Is a contraction within the limit only if its certified error is? */
static inline bool metric_is_certified(enum metric metric)
{
    return metric != METRIC_SVA && metric != METRIC_MEASURED;
}

enum certify {
    CERTIFY_FAST,  /* the metric's own limit: the envelope, or what it predicts */
    CERTIFY_EXACT, /* the exact maximum; a quadric orders */
};

struct simplify_options {
    enum metric metric;
    enum certify certify;
    unsigned contract;     /* CONTRACT_... of the kinds of simplices */
    double max_error;      /* fraction of the range */
    /* limits that are asked for: rungs of the ladder, too. If there are any, no others stand between the round ones */
    const double *rungs;
    uint32_t rung_count;
    uint32_t min_tets;
    double boundary_angle; /* degrees */
    double boundary_limit; /* units of length */
    double boundary_least; /* how far the boundary may move even where it meets another part of it: by rounding */
    const double *regions; /* [tet] its region, or NULL */
    const bool *fixed;     /* [vertex] does it stay where it is? or NULL */
    bool local_bound;      /* the log keeps every node's bound */
    double growth;         /* vertices of a level / vertices of the one below */
    /* of a piece: middles of its tetrahedra (format/cuts.h) stay inside; NULL: anywhere */
    const struct tetlodi_box *box;
    unsigned threads;      /* 0: all cores; the result does not depend on it */
    bool (*progress)(void *opaque, double done); /* 0..1; false cancels; may be NULL */
    void *progress_opaque;
};

#endif
