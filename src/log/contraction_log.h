/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * The contraction log: what a simplification did, and the only thing that leaves it. Ancestry, measuring and the
 * stream's writer read it; none of them knows how it was made.
 *
 * Nodes 0 .. vertex_count-1 are the vertices of the original mesh, in the original's numbering. Contraction c makes
 * node vertex_count + c out of two to four nodes that are alive. A level is the mesh after the first m contractions; a
 * mark names such an m and says what the errors are there.
 *
 * How to fill it:
 *   log_init, log_control        once, before the first contraction; log_keep_bounds behind them, where local bounds
 * are asked for log_extend(log, n)           makes room for n records and returns the first; it never fails and
 * allocates nothing, as a mesh has fewer contractions than vertices and the memory of records that are not written is
 * not used children, positions, values  are written directly, each record once, in any order and by any thread log_mark
 * between rounds, when all records before it are written log_finish                   gives back the room that was not
 * used
 *
 * A parallel round counts its contractions, extends the log once, and gives each contraction the record first + (its
 * place in the round by a prefix sum): the places decide the bytes, so they must not depend on threads. Within a round
 * no contraction may use a node that another one of the round makes. Records of a round are made in the order of their
 * numbers, as if one after the other.
 */
#ifndef TETLOD_CONTRACTION_LOG_H
#define TETLOD_CONTRACTION_LOG_H

#include "src/mesh/tetmesh.h"

/* A moment that may become a level. */
struct log_mark {
    uint32_t contractions, vertices, tets;
    double moved; /* most that the boundary moved so far, in units of length: a bound (PROOF.md, 5) */
};

/* A component of a field whose error is controlled. */
struct log_component {
    uint32_t field, component;
    double scale; /* 1 / the field's range; 0 for a constant field */
    /* [contraction] of the node that it made: largest of U - s and s - L (PROOF.md, 2), in the field's units; NULL: not
     * kept */
    double *bounds;
};

struct log_field {
    uint32_t components;
    double *values; /* [components * contraction] of the nodes that contractions made */
};

/* Why contractions were refused that the error would have allowed, as often as they were asked for. */
enum log_refusal {
    LOG_REFUSED_FLIP,
    LOG_REFUSED_LINK,
    LOG_REFUSED_BOUNDARY,
    LOG_REFUSED_ROUNDING,
    LOG_REFUSED_SIZE, /* by the exact limit: a star with too many originals in it */
    LOG_REFUSED_CELL, /* of a paged build: a tetrahedron would have left its cell */
    LOG_REFUSALS
};

struct contraction_log {
    uint32_t vertex_count; /* of the original */
    uint32_t count;        /* contractions */
    uint32_t *children;    /* [4 * contraction] nodes, TETLOD_NONE last */
    double *positions;     /* [3 * contraction] of the nodes that contractions made */
    uint32_t field_count;
    struct log_field *fields;
    uint32_t component_count;
    struct log_component *components;
    uint32_t mark_count;
    struct log_mark *marks; /* fine to coarse; the first is the original, the last the end */
    double *certified;      /* [component_count * mark] running maximum of the certified error, fraction of the range */
    double *predicted;      /* [component_count * mark] running maximum of the prediction, fraction of the range */
    size_t mark_capacity, certified_capacity, predicted_capacity;
    uint64_t refused[LOG_REFUSALS]; /* [enum log_refusal] */
    /* of the original; folded: on one side of a face with a neighbour */
    uint64_t degenerate_tets, inverted_tets, folded_tets;
};

/* An empty log of a mesh: room for vertex_count records. ERR_NOMEM; *log is then empty. */
TETLOD_CHECKED enum tetlod_status log_init(struct contraction_log *log, const struct tetmesh *mesh,
                                           struct tetlod_error *error);
void log_fini(struct contraction_log *log);

/* The controlled components, which are copied: what a mark has errors of. ERR_NOMEM. */
TETLOD_CHECKED enum tetlod_status log_control(struct contraction_log *log, const struct log_component *components,
                                              uint32_t count, struct tetlod_error *error);

/* Makes room for the components' bounds. ERR_NOMEM. */
TETLOD_CHECKED enum tetlod_status log_keep_bounds(struct contraction_log *log, struct tetlod_error *error);

/* Adds `count` records, which the caller fills, and returns the first one's number. */
uint32_t log_extend(struct contraction_log *log, uint32_t count);

/* Adds a mark of all records so far. `certified` and `predicted` have component_count running maxima. A mark with as
 * many contractions as the last one adds nothing. ERR_NOMEM. */
TETLOD_CHECKED enum tetlod_status log_mark(struct contraction_log *log, uint32_t vertices, uint32_t tets, double moved,
                                           const double *certified, const double *predicted,
                                           struct tetlod_error *error);

/* Puts a mark in the place of another one. */
void log_move_mark(struct contraction_log *log, uint32_t from, uint32_t to);

/* Gives back the room of records that were not used. */
void log_finish(struct contraction_log *log);

#endif
