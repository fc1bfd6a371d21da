/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * Contraction cell by cell: what a paged stream is made of (SPEC 7.6). Threads take cells, so that they need not wait
 * for each other; the result does not depend on how many there are.
 */
#ifndef TETLOD_CELL_PHASES_H
#define TETLOD_CELL_PHASES_H

#include "format/write/write_input.h"
#include "src/log/contraction_log.h"
#include "src/simplify/simplify.h"
#include "src/util/work_share.h"

/* The pages of a log: groups from fine to coarse. What follows the last group is the root's. */
struct cell_groups {
    uint32_t count;
    struct tetlodi_write_group *groups; /* [count] */
};

/* Why a mesh cannot be contracted cell by cell with these options, or NULL. */
const char *cells_wrong(const struct simplify_options *options);

/* How far the limits of phases are apart: from each named error (1, 2, 5 of every decade) to the next, which leaves
 * about half of the tetrahedra; with those between (1.5, 3, 7); or every second named one, until few cells are left.
 * With more phases fewer tetrahedra are left in the end, and parts of the mesh need more pages. By size: medium, and
 * coarse for meshes from LARGE_TETS on, of which nobody has all pages. */
enum cell_bands { BANDS_BY_SIZE, BANDS_MEDIUM, BANDS_FINE, BANDS_COARSE, BANDS_COUNT };

struct cell_choice {
    uint32_t tets; /* of a cell, about */
    enum cell_bands bands;
    bool spools;   /* cells that are contracted wait in a temporary file */
    const struct work_share *share; /* programs that contract them together, or NULL */
};

/* Contracts the mesh as simplify() does, in cells until few tetrahedra are left. Without groups
 * the mesh was small: the log is that of simplify(). */
TETLOD_CHECKED enum tetlod_status cells_simplify(struct contraction_log *out, struct cell_groups *groups,
                                                 const struct tetmesh *mesh, const uint32_t *controlled,
                                                 uint32_t controlled_count, const double *limits,
                                                 const struct cell_choice *choice,
                                                 const struct simplify_options *options, struct tetlod_error *error);
void cell_groups_fini(struct cell_groups *groups);

#endif
