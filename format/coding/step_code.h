/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * Values of one field at the steps of a group, over the mesh of one level or of its tetrahedra (SPEC 3.7): one frame a
 * step. One set of functions codes in both directions, as in coder.h. Not installed.
 */
#ifndef TETLOD_STEP_CODE_H
#define TETLOD_STEP_CODE_H

#include "format/common/values.h"

#include "format/common/bytes.h"
#include "format/common/coder.h"

/* Of each vertex the vertices that share a tetrahedron with it and have a lower number, ascending. */
struct tetlodi_lower {
    uint32_t vertices;
    size_t *begin;      /* [vertices + 1] */
    uint32_t *vertex;
};

/* 0: out of memory, or beyond the budget. What these two take comes from malloc, counted by `memory`. */
int tetlodi_lower_init(struct tetlodi_lower *lower, const uint32_t *corners, size_t tets, uint32_t vertices,
                       struct tetlodi_memory *memory);
void tetlodi_lower_fini(struct tetlodi_lower *lower);

/* How a field's values are coded in a band. quantum 0: bit for bit as the type. Else the value is (type)(quantum *
 * code). */
struct tetlodi_step_scale {
    enum tetlod_type type;
    double quantum;
};

/* How rows are coded that have no neighbours, values of cells: codes from `least` to `most`, in a ring of so many bits.
 */
struct tetlodi_step_rows {
    size_t count;
    unsigned width;
    int64_t least, most;
};

#define MAX_STEP_CODE (INT64_C(1) << 30) /* of codes with a quantum: their size at most */

double tetlodi_step_value(const struct tetlodi_step_scale *scale, int64_t code);

/* How a frame's values are predicted: from those of lower neighbours; or from the step before, without and with the
 * neighbours' change. */
enum step_mode { STEP_KEY, STEP_SAME, STEP_MOVED, STEP_MODES };

struct tetlodi_step_models {
    struct tetlodi_bit mode[4];
    struct tetlodi_number value[2]; /* of keys, of others */
};

/* The steps of a group: `codes` are those of the step before, if there was one in this group, then those of this. */
struct tetlodi_steps {
    const struct tetlodi_lower *lower; /* NULL: `rows` */
    struct tetlodi_step_scale scale;
    struct tetlodi_step_rows rows;     /* of vertices: their number alone */
    uint32_t components;
    int64_t *codes;   /* [component * rows + row] */
    double *before, *now; /* [vertices] scratch */
    uint8_t *lengths; /* [vertices] scratch */
    int first;        /* there was no step before */
    struct tetlodi_step_models models;
};

/* 0: as tetlodi_lower_init; to be freed even so. */
int tetlodi_steps_init(struct tetlodi_steps *steps, const struct tetlodi_lower *lower,
                       const struct tetlodi_step_scale *scale,
                       uint32_t components, struct tetlodi_memory *memory);
int tetlodi_steps_init_rows(struct tetlodi_steps *steps, const struct tetlodi_step_rows *rows, uint32_t components,
                            struct tetlodi_memory *memory);
void tetlodi_steps_fini(struct tetlodi_steps *steps);

/* Begins a group. That of rows goes on from the step that `codes` are of. */
void tetlodi_steps_start(struct tetlodi_steps *steps);

/* Do the frames of all steps have the bytes that go with the rows that decoding them counts: of each frame the level's
 * vertices and tetrahedra, times the components (SPEC 2.3)? */
bool tetlodi_steps_hold(uint64_t rows, uint64_t bytes);

/* Decodes a step's frame. 0: it holds what no encoder writes. */
int tetlodi_steps_decode(struct tetlodi_steps *steps, const uint8_t *bytes, size_t size);

/* Appends the smallest frame to `out`, and returns its size. `allowed` [2 * (component * rows + row)]: the least and
 * the greatest code that will do; steps->codes are then those that were taken. 0 and out->failed: no memory. */
size_t tetlodi_steps_encode(struct tetlodi_steps *steps, const int64_t *allowed, struct tetlodi_buffer *out);

#endif
