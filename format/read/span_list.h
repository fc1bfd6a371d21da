/* SPDX-License-Identifier: BSD-3-Clause */
/* Spans as they are found; neighbours are joined. Not installed. */
#ifndef TETLOD_SPAN_LIST_H
#define TETLOD_SPAN_LIST_H

#include "format/tetlod.h"

struct tetlodi_span_list {
    struct tetlod_span *out;
    size_t capacity, count;
    uint64_t gap; /* spans with no more between them are one */
    uint64_t end; /* of the last one */
};

/* Of spans in order. */
void tetlodi_span_add(struct tetlodi_span_list *spans, uint64_t offset, uint64_t size);

/* Is part `part` of a level, 0 the geometry, among those with these fields? */
int tetlodi_is_wanted(uint32_t part, const uint32_t *fields, uint32_t field_count);

#endif
