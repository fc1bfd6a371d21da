/* SPDX-License-Identifier: BSD-3-Clause */
/* The forms in which a stream has a field, and what is certain of each: its levels, or the bands of one step. */
#ifndef TETLOD_FORMS_H
#define TETLOD_FORMS_H

#include "format/read/box_sums.h"
#include "format/read/summary.h"
#include "src/ask/blocks.h"
#include "src/stream/selection.h"

/* `error`: what a value at any point differs from the original's at most, in the field's units. `moved`: no point of
 * the boundary has moved further than that; `swept`: the volume that it has swept (PROOF.md 12), infinite if it is not
 * known. Both are 0 where it kept its place. */
struct form {
    uint32_t level, band; /* band: TETLOD_NONE for values of the level itself */
    double error, moved, swept;
};

struct forms {
    struct tetlod_file *file;       /* the stream, or the topology group that has the step; borrowed, or `part` */
    struct tetlod_file *part;       /* owned, or NULL */
    const struct tetlod_info *info; /* the file's */
    uint32_t field;                 /* TETLOD_NONE: only the mesh is asked for */
    uint32_t bound;                 /* the field that bounds its error; TETLOD_NONE: none */
    double range[2];                /* of the field; of a step, over the series */
    struct tetlod_series *series;   /* owned; NULL: values of levels */
    uint32_t series_field, step;    /* the step's number in its topology group */
    struct tetlodi_summary summary; /* of the stream's own values: empty if it has none, or for a step */
    struct tetlodi_box_sums boxes;  /* likewise */
    struct form *forms;             /* owned, coarse to fine: those whose error is certain, and that are here */
    uint32_t count, finest;         /* finest: the level that is here */
    struct tetlod_cursor *cursor;   /* owned */
    double *moved;                  /* owned: positions of a step that moves them */
    bool moves;
};

/* A form as arrays, which are the forms' until the next one is taken. */
struct form_mesh {
    uint32_t vertices, tets;
    const double *positions, *values, *bounds; /* values: NULL without a field; bounds: NULL if there are none */
    const uint32_t *corners;
    const uint32_t *numbers;         /* of its tetrahedra in the level, where it is in blocks */
    const struct ask_blocks *blocks; /* NULL: it is not */
};

/* `name`: NULL or "" for the mesh alone. `step`: NULL for the stream's own values. Levels up to `finest` are there
 * (TETLOD_NONE: none). The file is borrowed; forms_fini in any case. ERR_FIELD, ERR_ARGUMENT where there is no such
 * step, or as the reader. */
TETLOD_CHECKED enum tetlod_status forms_init(struct forms *forms, struct tetlod_file *file, uint32_t finest,
                                             const char *name, const struct step_selection *step,
                                             struct tetlod_error *error);
void forms_fini(struct forms *forms);

/* Says why there is no form that can be used: ERR_TRUNCATED, or ERR_FIELD. */
TETLOD_CHECKED enum tetlod_status forms_none(const struct forms *forms, struct tetlod_error *error);

TETLOD_CHECKED enum tetlod_status forms_take(struct forms *forms, uint32_t number, struct form_mesh *out,
                                             struct tetlod_error *error);

/* Bytes that a client reads for a form: those before the levels, and of the levels and the step those that it needs. */
TETLOD_CHECKED enum tetlod_status forms_bytes(const struct forms *forms, uint32_t number, uint64_t *out,
                                              struct tetlod_error *error);

#endif
