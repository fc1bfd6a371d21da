/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * The mesh that a cursor (or the writer) holds, and the two moves on it: a split brings one record in, undoing takes the last
 * one out. Vertices and tetrahedra are numbered in order of arrival; stars are in ascending order. SPEC.md, replay and undo.
 */
#ifndef TETLOD_STATE_H
#define TETLOD_STATE_H

#include "format/tetlod.h"

enum { MOST_CHILDREN = 4 };

struct tetlodi_star {
    size_t begin;
    uint32_t count, capacity;
};

struct tetlodi_undo {
    uint32_t slot, children, tets; /* tets: how many there were before */
};

struct tetlodi_state {
    uint32_t field_count;
    const uint32_t *components;    /* [field_count], borrowed; 0: the field is not held */
    uint32_t row;                  /* numbers per vertex: 3 and those of every field */
    uint32_t vertices, tets;
    size_t vertex_capacity, tet_capacity;
    double *positions;             /* [3 * vertices] */
    double **fields;               /* [field_count] NULL or [components * vertices] */
    uint32_t *parents;             /* [vertices] */
    uint32_t *corners;             /* [4 * tets] */
    struct tetlodi_star *stars;    /* [vertices] */
    uint32_t *pool;
    size_t pool_size, pool_capacity, pool_dead;
    struct tetlodi_undo *undos;    /* one per record applied */
    double *undo_rows;             /* [row * record] what the split vertex was */
    size_t undo_count, undo_capacity, undo_row_capacity;
    size_t max_bytes;              /* of all of it */
};

/* One record: vertex `slot` becomes `children` vertices, the first in its slot, the others at the end. */
struct tetlodi_record {
    uint32_t slot, children;
    double positions[MOST_CHILDREN][3];
    double *values[MOST_CHILDREN]; /* each [row - 3], fields in order */
    uint8_t *labels;               /* [star's count] child that gets the tetrahedron */
    uint32_t tet_count;
    uint32_t (*tets)[4];           /* that come with it; new vertices by the numbers that they get */
};

/* `components` as above. ERR_NOMEM. */
TETLOD_CHECKED enum tetlod_status tetlodi_state_init(struct tetlodi_state *state, const uint32_t *components,
                                                     uint32_t field_count, size_t max_bytes, struct tetlod_error *error);
void tetlodi_state_fini(struct tetlodi_state *state);

/* Room for that many vertices and tetrahedra. ERR_NOMEM, ERR_LIMIT. */
TETLOD_CHECKED enum tetlod_status tetlodi_state_reserve(struct tetlodi_state *state, size_t vertices, size_t tets,
                                                        struct tetlod_error *error);

/* After the base mesh has been put into the reserved arrays: its stars. Corners are in range. */
TETLOD_CHECKED enum tetlod_status tetlodi_state_begin(struct tetlodi_state *state, uint32_t vertices, uint32_t tets,
                                                      struct tetlod_error *error);

/* Brings a valid record in; room for it has been reserved. ERR_NOMEM leaves the state unusable but freeable. */
TETLOD_CHECKED enum tetlod_status tetlodi_state_split(struct tetlodi_state *state, const struct tetlodi_record *record,
                                                      struct tetlod_error *error);

/* Takes the last record out: exactly the state before it. There is one. */
TETLOD_CHECKED enum tetlod_status tetlodi_state_undo(struct tetlodi_state *state, struct tetlod_error *error);

#endif
