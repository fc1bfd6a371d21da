/* SPDX-License-Identifier: BSD-3-Clause */
/* What contraction by cells knows while it runs (cell_phases.c), and how the cells of a phase are contracted. */
#ifndef TETLOD_CELL_RUN_H
#define TETLOD_CELL_RUN_H

#include <stdatomic.h>

#include "src/cells/cell.h"
#include "src/cells/cell_store.h"
#include "src/cells/partition.h"
#include "src/simplify/simplify_options.h"
#include "src/util/parallel.h"
#include "src/util/work_share.h"

struct cell_groups;

struct cell_run {
    const struct tetmesh *mesh;
    const struct simplify_options *options;
    uint32_t cell_tets;
    bool fine, coarse; /* bands (cell_phases.h) */
    struct pool *pool;
    uint32_t **numbers; /* [worker, and one more] scratch of piece_part */
    struct piece_whole whole;
    struct piece state; /* what is left */
    uint32_t *nodes;    /* [vertex of it] in the whole log */
    uint8_t *was_seam;  /* [vertex of it] NULL: there was no partition */
    struct partition partition;
    struct cell *cells;
    uint32_t cell_count;
    const uint32_t *order; /* cells as they are given out: the largest first */
    struct cell_store store; /* zeros: cells wait in memory */
    bool spools;           /* they wait in a temporary file */
    const struct work_share *share; /* of the cells, or NULL */
    const struct work_share *crew;  /* of its members those that the stage is of */
    bool root;             /* the only cell is what is left, to be contracted to the end */
    bool tries;            /* cells are contracted for trial: to no limit, and nothing is kept */
    double from, to;       /* the last limit, 0 before the first; the next one */
    double left;           /* of the tetrahedra, by the last limit */
    struct contraction_log *log;
    struct cell_groups *groups;
    atomic_uint done; /* cells */
    atomic_bool cancelled;
    struct tetlod_error *error;
};

enum tetlod_status cells_no_memory(const struct cell_run *run);

/* Room for cutting cells out of the state. ERR_NOMEM. */
TETLOD_CHECKED enum tetlod_status cells_make_scratch(struct cell_run *run);

/* Contracts `count` cells, those that `order` lists, alone or with others. */
TETLOD_CHECKED enum tetlod_status cells_contract(struct cell_run *run, const uint32_t *order, uint32_t count);

/* The cells of a stage that other programs have not taken: `opaque` is the run. */
TETLOD_CHECKED enum tetlod_status cells_take(void *opaque);

/* Contracts what is left, from the last limit on. */
TETLOD_CHECKED enum tetlod_status cells_contract_rest(const struct cell_run *run, struct cell *root, struct piece *rest,
                                                      const struct simplify_options *options,
                                                      struct tetlod_error *error);

/* ERR_IO where a cell that another program has contracted is not what this one's options ask for. */
TETLOD_CHECKED enum tetlod_status cells_check(const struct cell_run *run, bool same);

/* A cell that waited elsewhere is here again. */
TETLOD_CHECKED enum tetlod_status cells_bring_back(const struct cell_run *run, struct cell *cell, uint32_t number);

/* The cells' bytes are of no more use. */
void cells_leave_store(struct cell_run *run);
void cells_free(struct cell_run *run);

#endif
