/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * The mesh at a moment of a contraction log, carried from fine to coarse in place.
 *
 * Vertices live in slots: at first slot v holds the original's vertex v; a contraction puts its result into the slot of
 * its first child. A step is a number of merges and moves, made known one by one, and then coarsening_step, which finds
 * what they did to the tetrahedra: it visits each that is left once. They keep their numbers until so many have died
 * that it is less work to list the others anew: then a step numbers these 0, 1, ... in their order.
 */
#ifndef TETLOD_COARSENING_H
#define TETLOD_COARSENING_H

#include <stdatomic.h>

#include "src/log/contraction_log.h"

enum coarsening_state {
    COARSE_SAME,    /* as it was before the last step */
    COARSE_CHANGED, /* a corner moved, or has another value, in the last step */
    COARSE_DIED,    /* two of its corners became one in the last step; its corners are where they are now */
    COARSE_GONE,    /* died earlier */
};

struct coarse_field {
    uint32_t components;
    double *values; /* [components * slot] */
};

/* The numbers that living tetrahedra get, by bits and counts: a table of them would be as large as an array of the
 * mesh. */
struct coarse_numbers {
    uint64_t *living; /* [old / 64] a bit each; NULL: they kept their numbers */
    uint32_t *before; /* [old / 64] living ones of less number */
};

/* Tetrahedra as they were numbered before the last step, if that numbered them anew. */
struct coarse_before {
    struct coarse_numbers numbers;
    const uint32_t *corners; /* [4 * old] as before the step */
    uint32_t *own_corners;   /* the same, or NULL: they are the mesh's */
    uint8_t *states;         /* [old] what the step did to it */
};

struct coarsening {
    uint32_t slot_count;
    uint32_t stored, tets; /* numbers of tetrahedra in use; those that are there */
    double *positions;     /* [3 * slot] */
    uint32_t field_count;
    struct coarse_field *fields;
    const uint32_t *corners; /* [4 * tet] slots */
    uint32_t *own_corners; /* the same, or NULL: they are the mesh's, as nothing has changed */
    uint32_t *neighbours;  /* [4 * tet] as adjacency_build makes them, of the living; NULL: nobody has asked for them */
    uint8_t *states;       /* [tet] enum coarsening_state */
    uint8_t *slots;        /* [slot] SLOT_... */
    uint32_t *into;        /* [slot] that a slot which merged in this step merged into */
    uint32_t *touched;     /* [touched_count] slots that the last or the current step merged or moved */
    uint32_t touched_count;
    bool in_step;
    _Atomic uint32_t *tet_of; /* [slot] one of its tetrahedra */
    uint32_t *slot_of;     /* [contraction] slot of the node that it made */
    const double **log_values; /* [field] of the log */
    uint32_t contractions; /* of the log, that are done */
    struct coarse_before last;
};

enum {
    SLOT_ORIGINAL = 0, /* holds the original's vertex of its number, which never moved */
    SLOT_MADE = 1,     /* moved, or has another value */
    SLOT_MERGED = 2,   /* is no more */
    SLOT_IN_STEP = 4,  /* was touched by this step */
};

/* All of the mesh is there, and COARSE_SAME. It borrows the corners, and copies the rest; the log may be NULL.
 * ERR_NOMEM. */
TETLOD_CHECKED enum tetlod_status coarsening_init(struct coarsening *coarsening, const struct tetmesh *mesh,
                                                  const struct contraction_log *log, struct tetlod_error *error);
void coarsening_fini(struct coarsening *coarsening);

/* Takes over the corners of the mesh that it was made of, before any step: the mesh has none then. */
void coarsening_adopt_corners(struct coarsening *coarsening, struct tetmesh *mesh);

/* Makes the neighbours, where they are not there: steps do so. ERR_NOMEM, ERR_LIMIT. */
TETLOD_CHECKED enum tetlod_status coarsening_need_neighbours(struct coarsening *coarsening, struct tetlod_error *error);

/* Bytes that one takes, about. */
uint64_t coarsening_bytes(const struct tetmesh *mesh);

/* In the current step `slot` merges into another, which may merge as well. */
void coarsening_merge(struct coarsening *coarsening, uint32_t slot, uint32_t into);

/* In the current step the vertex in `slot` gets the position and the values: row `row` of `positions` and of each
 * field's values (values[field]). */
void coarsening_move(struct coarsening *coarsening, uint32_t slot, const double *positions, const double *const *values,
                     size_t row);

/* Ends the step. O(tetrahedra stored). The result does not depend on `threads`. ERR_NOMEM, ERR_LIMIT. */
TETLOD_CHECKED enum tetlod_status coarsening_step(struct coarsening *coarsening, unsigned threads,
                                                  struct tetlod_error *error);

/* A whole step: to the moment after `contractions` contractions of the log, no less than those done. As above. */
TETLOD_CHECKED enum tetlod_status coarsening_advance(struct coarsening *coarsening, const struct contraction_log *log,
                                                     uint32_t contractions, unsigned threads,
                                                     struct tetlod_error *error);

/* ---- of a tetrahedron by the number that it had before the last step, while it was there */

/* What the last step did to it. */
static inline enum coarsening_state coarsening_state_of(const struct coarsening *coarsening, uint32_t before)
{
    const struct coarse_before *last = &coarsening->last;
    return (enum coarsening_state)(last->numbers.living ? last->states : coarsening->states)[before];
}

/* Its number now. Of one that died it is TETLOD_NONE. */
static inline uint32_t coarsening_number(const struct coarsening *coarsening, uint32_t before)
{
    const struct coarse_numbers *numbers = &coarsening->last.numbers;
    if (!numbers->living)
        return coarsening->states[before] < COARSE_DIED ? before : TETLOD_NONE;
    uint64_t word = numbers->living[before / 64], bit = UINT64_C(1) << before % 64;
    return word & bit ? numbers->before[before / 64] + (uint32_t)__builtin_popcountll(word & (bit - 1)) : TETLOD_NONE;
}

/* The living tetrahedron that it is, or one that is where it was. */
uint32_t coarsening_heir(const struct coarsening *coarsening, uint32_t before);

/* Its face, 4 * tet + face, or the one that is where that was. TETLOD_NONE: it collapsed, or the tetrahedron changed in
 * a step that numbered them anew. */
uint32_t coarsening_heir_face(const struct coarsening *coarsening, uint32_t face);

#endif
