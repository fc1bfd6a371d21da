/* SPDX-License-Identifier: BSD-3-Clause */
/* The mesh at any moment of the contraction sequence, by filter and map: a tetrahedron's corners are the living
 * ancestors of its original vertices, and it is there while they are four. */
#ifndef TETLOD_ANCESTRY_H
#define TETLOD_ANCESTRY_H

#include "src/log/contraction_log.h"

struct ancestry {
    const struct contraction_log *log; /* borrowed */
    const struct tetmesh *original;        /* borrowed */
    uint32_t *parent;                      /* [node] or TETLOD_NONE */
    uint32_t *ancestor;                    /* [original vertex] living node at the current moment */
    uint32_t contractions;                 /* the moment; it only rises */
    uint32_t *neighbours; /* [4 * original tet] across each face, as adjacency_build has it: of those that
                             are there at the moment; of others when they were there last */
};

struct ancestry_level {
    struct tetmesh mesh;
    uint32_t *nodes;  /* [vertex] */
    uint32_t *origin; /* [tet] number in the original */
    uint32_t *image;  /* [original tet] tetrahedron of the level, or TETLOD_NONE */
    uint32_t *standing; /* [original vertex] the vertex of the level that it has become part of */
    uint32_t *neighbours; /* [4 * tet] as adjacency_build makes them; NULL: not known */
};

TETLOD_CHECKED enum tetlod_status ancestry_init(struct ancestry *ancestry, const struct contraction_log *log,
                                              const struct tetmesh *original, struct tetlod_error *error);
void ancestry_fini(struct ancestry *ancestry);

/* The mesh after `contractions` contractions, which is no less than in the last call. O(n). */
TETLOD_CHECKED enum tetlod_status ancestry_level(struct ancestry *ancestry, uint32_t contractions,
                                                 struct ancestry_level *out,
                                               struct tetlod_error *error);
void ancestry_level_fini(struct ancestry_level *level);

#endif
