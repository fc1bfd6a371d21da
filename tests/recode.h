/* SPDX-License-Identifier: BSD-3-Clause */
/* A stream's contraction sequence, read back through a cursor, so that it can be written again: the same, or
 * quantised. */
#ifndef TETLOD_RECODE_H
#define TETLOD_RECODE_H

#include "format/write/writer.h"

struct recode {
    struct tetlodi_write_input input; /* its arrays are owned by this */
    struct tetlodi_write_field *fields;
    struct tetlodi_write_level *levels;
};

/* ERR_NOMEM, or what the cursor said. The file must stay open as long as the result is used. */
TETLOD_CHECKED enum tetlod_status recode_read(struct recode *out, struct tetlod_file *file, struct tetlod_error *error);
void recode_free(struct recode *recode);

/* Rounds positions and values to grids of so many bits across the bounds; 0 leaves them as they are. */
void recode_quantise(struct recode *recode, unsigned position_bits, unsigned field_bits);

/* All values of a field, which has a grid, times a power of two. */
void recode_scale(struct recode *recode, uint32_t field, double by);

/* Rounds the nodes' values of all fields but the first to grids of so many bits; the original's become exact in a level
 * more, for which there is room. */
void recode_exact_later(struct recode *recode, unsigned field_bits);

#endif
