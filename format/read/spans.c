/* SPDX-License-Identifier: BSD-3-Clause */
/* What a client fetches for a move between levels. */
#include "format/read/reader.h"

/* Spans as they are found; neighbours are joined. */
struct spans {
    struct tetlod_span *out;
    size_t capacity, count;
    uint64_t end; /* of the last one */
};

static void add(struct spans *spans, uint64_t offset, uint64_t size)
{
    if (!size)
        return;
    if (!spans->count || offset != spans->end) {
        if (spans->count < spans->capacity)
            spans->out[spans->count] = (struct tetlod_span){offset, 0};
        spans->count++;
    }
    if (spans->count <= spans->capacity)
        spans->out[spans->count - 1].size += size;
    spans->end = offset + size;
}

static int is_wanted(uint32_t part, const uint32_t *fields, uint32_t field_count)
{
    int wanted = part == 0 || !fields;
    for (uint32_t i = 0; i < field_count && !wanted; i++)
        wanted = fields[i] + 1 == part;
    return wanted;
}

size_t tetlod_spans(const struct tetlod_file *file, uint32_t from, uint32_t to, const uint32_t *fields,
                    uint32_t field_count,
                    struct tetlod_span *out, size_t capacity)
{
    const struct tetlodi_index *index = &file->index;
    struct spans spans = {out, capacity, 0, 0};
    uint32_t parts = 1 + index->info.field_count, first = from == TETLOD_NONE ? 0 : from + 1;
    if (from == TETLOD_NONE)
        add(&spans, 0, index->info.levels[0].offset);
    for (uint32_t level = first; level <= to && level < index->info.level_count; level++)
        for (uint32_t part = 0; part < parts; part++)
            if (is_wanted(part, fields, field_count)) {
                const struct tetlodi_frame *frame = &index->frames[(size_t)level * parts + part];
                add(&spans, frame->offset, frame->size);
            }
    return spans.count;
}
