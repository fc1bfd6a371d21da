/* SPDX-License-Identifier: BSD-3-Clause */
/* Levels that are finer in boxes. */
#ifndef TETLOD_SERVER_BOXES_H
#define TETLOD_SERVER_BOXES_H

#include "server/http/exchange.h"
#include "src/stream/selection.h"

enum { BOXES_CAPACITY = 700 };

/* The query's boxes, or none; false after a 400. */
bool parse_boxes(struct exchange *exchange, struct region_box out[static MAX_BOXES], size_t *out_count);

/* The boxes as text, each number as short as it can be: one text for the same boxes. False after a 400 if that is too
 * long. */
bool print_boxes(struct exchange *exchange, const struct region_box *boxes, size_t count,
                 char out[static BOXES_CAPACITY]);

#endif
