/* SPDX-License-Identifier: BSD-3-Clause */
/* Levels that are written while they are sent, straight from the stream in memory: for files that the cache has no room
 * for. */
#ifndef TETLOD_SERVER_STREAMED_H
#define TETLOD_SERVER_STREAMED_H

#include "server/http/exchange.h"
#include "server/jobs/cell_choice.h"
#include "src/io/io.h"

struct streamed_answer {
    uint32_t level;
    const char *name; /* of the format and the cells: for the entity tag */
    const char *media_type;
    enum tetlod_status (*lay_out)(struct io_layout **out, const struct tetmesh *shape, struct tetlod_error *error);
    const struct cell_choice *cells;
};

enum outcome answer_streamed(struct exchange *exchange, struct dataset *dataset, const struct streamed_answer *answer);

#endif
