/* SPDX-License-Identifier: BSD-3-Clause */
/* What a stream is written from. Not installed. */
#ifndef TETLOD_WRITE_INPUT_H
#define TETLOD_WRITE_INPUT_H

#include <stdbool.h>

#include "format/common/cuts.h"
#include "format/tetlod.h"

struct tetlodi_stack_work; /* page_stack.h */

struct tetlodi_write_field {
    const char *name;
    uint32_t components;
    enum tetlod_type type; /* values below are exactly representable in it */
    int was_float64;       /* the original's type is float64 although `type`, float32, is enough for its values */
    int controlled;
    int local_bound; /* it bounds, at every point of every level, the error of the field that has its name without
                        TETLOD_BOUND_SUFFIX */
    double range[2];
    /* [components * vertices], the original's in all levels; NULL: `exact` at the nearest k up to `most` */
    const double *values;
    const double *node_values; /* [components * contractions], of the nodes that contractions made */
    /* 0: bit for bit. Else every value is (type)(origin + step * k) for a k of so many bits */
    unsigned bits;
    double origin, step;
    int64_t most;
    /* with bits: the original's values are rounded, and are these in the last level. NULL: they are not */
    const double *exact;
};

struct tetlodi_write_level {
    uint32_t contractions; /* done at this level; falls strictly with the level's number, 0 at the finest. Where fields
                              are exact later there is one level more, with 0 as well: the exact tail */
    double domain_error;  /* this and the errors are read behind `measured` */
    const double *errors; /* [field_count * TETLOD_MEASURES]; NaN: not known */
};

enum { EFFORT_ALL_RATES = 20 };

#define ROW_CODED UINT32_MAX

/* A section of its own kind (SPEC 3.5); META, ORDR, CELL and CVAL are the writer's. */
struct tetlodi_write_section {
    const char *tag; /* 4 of A-Z, 0-9 */
    int critical;    /* who does not know it must not read the stream */
    int early;       /* before level 0, so that every prefix has it */
    /* bytes of a row of its table; 0: it is no table; ROW_CODED: its bytes are neither packed nor copied */
    uint32_t row;
    const void *bytes;
    size_t size;
    const struct tetlod_source *source; /* in place of bytes, with ROW_CODED: read twice, in pieces */
};

/* Values of the tetrahedra, exactly representable in their type. */
struct tetlodi_write_cells {
    const char *name;
    uint32_t components;
    enum tetlod_cell_type type;
    int region;
    const double *values; /* [components * tets] */
    double quantum; /* not 0: values, of floats, are stored as the multiples of it that are nearest */
    double error;   /* the greatest difference that this makes to the original's values; 0 without a quantum */
};

/* Rows of values of cells, as a stream has them. */
struct tetlodi_late_rows {
    uint32_t count;
    const uint32_t *tet_of; /* [count] the number of a tetrahedron with the row's values */
    bool in_parents;        /* sections PTIM and PSTP, in place of CTIM and CSTP */
};

/* Everything is borrowed for the call. Positions and values are exactly representable in their type. */
struct tetlodi_write_input {
    uint32_t vertices, tets, contractions;
    enum tetlod_type position_type;
    int positions_were_float64; /* as a field's was_float64 */
    unsigned position_bits; /* as a field's, with an origin and a step for each axis */
    double position_origin[3], position_step[3];
    const double *positions;      /* [3 * vertices] */
    const uint32_t *corners;      /* [4 * tets] */
    const uint32_t *children;     /* [4 * contractions] node ids, unused ones TETLOD_NONE, last */
    const double *node_positions; /* [3 * contractions] */
    const uint8_t *later; /* [vertices] it comes of a contraction that is no part of this; NULL: none does */
    uint32_t field_count, level_count;
    const struct tetlodi_write_field *fields;
    const struct tetlodi_write_level *levels; /* coarse to fine: levels[0] is the base mesh */
    uint32_t group_count; /* the last levels before the exact tail are in pages; fewer than there are levels */
    const struct tetlodi_write_group *groups; /* [group_count] coarse to fine */
    uint64_t degenerate_tets, inverted_tets, unused_points;
    const char *metadata; /* a JSON object, NUL-terminated */
    int compression;      /* effort, 1..22; from EFFORT_ALL_RATES on it takes four times as long for the last bytes */
    int keep_order;       /* store the numbering of vertices, tetrahedra and corners above */
    uint32_t section_count;
    const struct tetlodi_write_section *sections; /* further ones */
    uint32_t cell_field_count;
    const struct tetlodi_write_cells *cells;
    const uint32_t *parents; /* [tets] alike where tetrahedra are of one cell, whose values they have; or NULL */
    /* Makes more of them when the levels are written, or NULL: original_of[i] is the number above of the finest level's
     * vertex i. Vertex i of a coarser level is the node there that this one comes from. What it gives is borrowed until
     * tetlodi_write returns. */
    enum tetlod_status (*late)(void *opaque, const uint32_t *original_of, const struct tetlodi_late_rows *rows,
                               const struct tetlodi_write_section **out, uint32_t *count, struct tetlod_error *error);
    void *late_opaque;
    /* Sees to it, when all frames are there, that the levels have their errors; NULL: they have. */
    enum tetlod_status (*measured)(void *opaque, struct tetlod_error *error);
    void *measured_opaque;
    /* Has the stacks of pages coded, by other programs as well, and fills in what they have come to; NULL: the caller's
     * threads code page by page. The bytes are the same. */
    enum tetlod_status (*share)(void *opaque, const struct tetlodi_stack_work *work, struct tetlod_error *error);
    void *share_opaque;
    unsigned threads; /* the caller's included; bytes do not depend on it */
    int (*progress)(void *opaque, double done); /* asked now and then by the caller's thread: 0 cancels; may be NULL */
    void *progress_opaque;
};

/* What is wrong with metadata, the number of fields, or a field's name and components, or NULL: a caller can ask before
 * work that takes long. */
const char *tetlodi_metadata_wrong(const char *metadata);
const char *tetlodi_field_count_wrong(uint32_t fields, uint32_t cell_fields);
const char *tetlodi_field_wrong(const char *name, uint32_t components);

#endif
