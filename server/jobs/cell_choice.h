/* SPDX-License-Identifier: BSD-3-Clause */
/* The parameter `cells`: which values of tetrahedra an answer has. */
#ifndef TETLOD_SERVER_CELL_CHOICE_H
#define TETLOD_SERVER_CELL_CHOICE_H

#include "server/http/exchange.h"
#include "src/mesh/tetmesh.h"

enum { MAX_CELL_FIELDS = 256 };

struct cell_choice {
    bool any;
    bool chosen[MAX_CELL_FIELDS];
    char text[3 * 1024 + 1]; /* as a query has it, percent-encoded */
};

/* Of which step values are meant; `series` NULL: of none, but of the stream. */
struct cell_step {
    const struct tetlod_series *series;
    uint32_t step;
};

/* What the query asks for: a list of names, or `all` that are known at the step. False: answered, there is no such
 * field. */
bool query_cells(struct exchange *exchange, const struct tetlod_info *info, struct cell_step at,
                 struct cell_choice *out);

/* Tells choices apart: hexadecimal digits of four fields each. */
void cell_choice_name(const struct cell_choice *choice, char out[MAX_CELL_FIELDS / 4 + 1]);

/* Bytes of the chosen values of that many tetrahedra; and of a level's while they are decoded, with all that the stream
 * holds. */
uint64_t cell_choice_bytes(const struct cell_choice *choice, const struct tetlod_info *info, uint64_t tets);
uint64_t cell_choice_decoding(const struct cell_choice *choice, const struct tetlod_info *info, uint32_t level);

/* Adds those of a step to the mesh of a band's level. */
TETLOD_CHECKED enum tetlod_status cell_choice_add_step(const struct cell_choice *choice, const struct tetlod_file *file,
                                                       uint32_t step, struct tetmesh *mesh, struct tetlod_error *error);

/* Adds them to a mesh of the tetrahedra that have these numbers (NULL: a level's). ERR_NOMEM, or as tetlod_cells. */
TETLOD_CHECKED enum tetlod_status cell_choice_add(const struct cell_choice *choice, const struct tetlod_file *file,
                                                  const uint32_t *tets,
                                                  struct tetmesh *mesh, struct tetlod_error *error);

#endif
