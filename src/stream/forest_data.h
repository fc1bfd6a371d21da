/* SPDX-License-Identifier: BSD-3-Clause */
/* What a forest holds, for the files of this folder. */
#ifndef TETLOD_FOREST_DATA_H
#define TETLOD_FOREST_DATA_H

#include <stdatomic.h>

#include "format/tetlod.h"

struct column {
    char *name; /* owned; NULL for the position */
    uint32_t components;
    enum tetlod_type type;
    size_t offset; /* in a row */
};

/* What a slot holds from `level` on; `previous` is the version before, of the same slot. */
struct version {
    uint32_t level, previous;
};

struct stage {
    uint32_t level, vertices, tets;
    uint32_t *corners; /* [4 * tets] */
    uint32_t *newest;  /* [vertices] versions */
};

struct forest {
    struct tetlod_file *file; /* borrowed */
    uint32_t *chosen, chosen_count; /* fields that are decoded; NULL: all */
    uint32_t column_count;
    struct column *columns; /* the position, then the fields */
    size_t row_size;
    uint32_t stage_count;
    struct stage *stages;
    /* How many are there. Set last: who sees a stage sees all that its levels need, which is never written again. */
    atomic_uint stages_there;
    atomic_uint_fast64_t bytes;
    uint32_t *parents; /* [slots] */
    struct version *versions; /* in order of time; at most two for each slot */
    unsigned char *rows;      /* [row_size] for each version, and one for the next */
    /* The decoding thread's: */
    struct tetlod_cursor *cursor; /* NULL while nothing is decoded */
    uint32_t next_level;
    size_t version_count;
    uint32_t *newest; /* [slots] version of a slot */
};

#endif
