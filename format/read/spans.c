/* SPDX-License-Identifier: BSD-3-Clause */
/* What a client fetches for a move between levels. */
#include "format/read/reader.h"
#include "format/read/span_list.h"

void tetlodi_span_add(struct tetlodi_span_list *spans, uint64_t offset, uint64_t size)
{
    if (!size)
        return;
    if (!spans->count || offset - spans->end > spans->gap) {
        if (spans->count < spans->capacity)
            spans->out[spans->count] = (struct tetlod_span){offset, 0};
        spans->count++;
    }
    if (spans->count <= spans->capacity) {
        struct tetlod_span *last = &spans->out[spans->count - 1];
        last->size = offset + size - last->offset;
    }
    spans->end = offset + size;
}

int tetlodi_is_wanted(uint32_t part, const uint32_t *fields, uint32_t field_count)
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
    struct tetlodi_span_list spans = {.out = out, .capacity = capacity};
    uint32_t first = from == TETLOD_NONE ? 0 : from + 1;
    if (from == TETLOD_NONE)
        tetlodi_span_add(&spans, 0, index->info.levels[0].offset);
    for (uint32_t level = first; level <= to && level < index->info.level_count; level++)
        for (size_t i = 0; i < tetlodi_frame_count(index, level); i++) {
            uint32_t part;
            const struct tetlodi_frame frame = tetlodi_frame_at(index, level, i, &part);
            if (tetlodi_is_wanted(part, fields, field_count))
                tetlodi_span_add(&spans, frame.offset, frame.size);
        }
    return spans.count;
}
