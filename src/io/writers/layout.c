/* SPDX-License-Identifier: BSD-3-Clause */
/* Files of which any range can be written by itself: each array knows the bytes of its rows, and asks for those that it needs. */
#include "src/io/writers/layout.h"

#include <stdlib.h>
#include <string.h>

#include "format/fail.h"
#include "src/util/array.h"

enum { BLOCK_WORDS = 4096, VTK_TETRA = 10 };

struct part {
    uint64_t begin, size; /* in the file */
    size_t text;          /* where it is in the texts, if `rows` of the array are 0 */
    struct layout_array array;
};

struct io_layout {
    struct part *parts;
    size_t count, capacity;
    unsigned char *texts;
    size_t text_size, text_capacity;
    uint64_t size;
    /* Of one block of rows, for so many words: */
    size_t words;
    double *values;
    uint32_t *corners;
    unsigned char *bytes;
};

enum tetlod_status layout_start(struct io_layout **out, struct tetlod_error *error)
{
    *out = array_zero(1, sizeof **out);
    return *out ? TETLOD_OK : tetlodi_fail_nomem(error, "a mesh file", sizeof **out);
}

void io_layout_free(struct io_layout *layout)
{
    if (!layout)
        return;
    free(layout->parts);
    free(layout->texts);
    free(layout->values);
    free(layout->corners);
    free(layout->bytes);
    free(layout);
}

uint64_t io_layout_size(const struct io_layout *layout)
{
    return layout->size;
}

static bool add_part(struct io_layout *layout, const struct part *part)
{
    if (!array_reserve((void **)&layout->parts, &layout->capacity, layout->count + 1, sizeof *part))
        return false;
    layout->parts[layout->count++] = *part;
    layout->size += part->size;
    return true;
}

static enum tetlod_status add_text(void *opaque, const void *bytes, size_t size)
{
    struct io_layout *layout = opaque;
    if (!size)
        return TETLOD_OK;
    if (!array_reserve((void **)&layout->texts, &layout->text_capacity, layout->text_size + size, 1))
        return TETLOD_ERR_NOMEM;
    memcpy(layout->texts + layout->text_size, bytes, size);
    struct part *last = layout->count ? &layout->parts[layout->count - 1] : NULL;
    if (last && !last->array.rows) {
        last->size += size;
        layout->size += size;
    } else if (!add_part(layout, &(struct part){layout->size, size, layout->text_size, {0}}))
        return TETLOD_ERR_NOMEM;
    layout->text_size += size;
    return TETLOD_OK;
}

struct tetlodi_sink layout_sink(struct io_layout *layout)
{
    return (struct tetlodi_sink){add_text, layout};
}

static size_t block_rows(const struct layout_array *array)
{
    return array->words < BLOCK_WORDS ? BLOCK_WORDS / array->words : 1;
}

/* Room for a block of rows of any array, however many components a field has. */
static bool make_room(struct io_layout *layout, const struct layout_array *array)
{
    size_t words = array->words < BLOCK_WORDS ? BLOCK_WORDS : array->words;
    if (words <= layout->words)
        return true;
    double *values = array_resize(layout->values, words, sizeof *values);
    layout->values = values ? values : layout->values;
    uint32_t *corners = array_resize(layout->corners, BLOCK_WORDS, sizeof *corners);
    layout->corners = corners ? corners : layout->corners;
    unsigned char *bytes = array_resize(layout->bytes, words, 8);
    layout->bytes = bytes ? bytes : layout->bytes;
    bool all = values && corners && bytes;
    layout->words = all ? words : 0;
    return all;
}

enum tetlod_status layout_add(struct io_layout *layout, const struct layout_array *array, struct tetlod_error *error)
{
    uint64_t size = array->rows * array->words * array->width;
    if (!array->rows)
        return TETLOD_OK;
    if (!make_room(layout, array) || !add_part(layout, &(struct part){layout->size, size, 0, *array}))
        return tetlodi_fail_nomem(error, "a mesh file", BLOCK_WORDS * (uint64_t)20);
    return TETLOD_OK;
}

/* ---- rows to bytes; compilers make single stores of the inner loops ---- */

static void store32(unsigned char *out, uint32_t word, bool big)
{
    if (big)
        for (size_t b = 0; b < 4; b++)
            out[b] = (unsigned char)(word >> (24 - 8 * b));
    else
        for (size_t b = 0; b < 4; b++)
            out[b] = (unsigned char)(word >> 8 * b);
}

static void store64(unsigned char *out, uint64_t word, bool big)
{
    if (big)
        for (size_t b = 0; b < 8; b++)
            out[b] = (unsigned char)(word >> (56 - 8 * b));
    else
        for (size_t b = 0; b < 8; b++)
            out[b] = (unsigned char)(word >> 8 * b);
}

static void put_values(const struct io_layout *layout, const struct layout_array *array, const double *values, size_t count)
{
    for (size_t i = 0; i < count; i++)
        if (array->width == 4) {
            float narrow = (float)values[i];
            uint32_t word;
            memcpy(&word, &narrow, sizeof word);
            store32(layout->bytes + 4 * i, word, array->big_endian);
        } else {
            uint64_t word;
            memcpy(&word, &values[i], sizeof word);
            store64(layout->bytes + 8 * i, word, array->big_endian);
        }
}

static void put_whole_values(const struct io_layout *layout, const struct layout_array *array, const double *values, size_t count)
{
    for (size_t i = 0; i < count; i++)
        if (array->width == 4)
            store32(layout->bytes + 4 * i, (uint32_t)(int32_t)values[i], array->big_endian);
        else
            store64(layout->bytes + 8 * i, (uint64_t)(int64_t)values[i], array->big_endian);
}

static uint64_t integer_at(const struct io_layout *layout, const struct layout_array *array, uint64_t first, size_t i)
{
    switch (array->kind) {
    case ROW_CORNERS:
        return layout->corners[i];
    case ROW_COUNT_CORNERS:
        return i % 5 ? layout->corners[i / 5 * 4 + i % 5 - 1] : 4;
    case ROW_END:
        return 4 * (first + i + 1);
    default:
        return VTK_TETRA;
    }
}

static void put_integers(const struct io_layout *layout, const struct layout_array *array, uint64_t first, size_t count)
{
    for (size_t i = 0; i < count; i++) {
        uint64_t word = integer_at(layout, array, first, i);
        if (array->width == 1)
            layout->bytes[i] = (unsigned char)word;
        else if (array->width == 4)
            store32(layout->bytes + 4 * i, (uint32_t)word, array->big_endian);
        else
            store64(layout->bytes + 8 * i, word, array->big_endian);
    }
}

/* The bytes of some rows, into layout->bytes. */
static void make_block(struct io_layout *layout, const struct layout_array *array, const struct io_rows *rows, uint64_t first,
                       size_t count)
{
    if (array->kind == ROW_VALUES) {
        if (!array->values)
            rows->values(rows->opaque, array->column, first, count, layout->values);
        (array->integer ? put_whole_values : put_values)(layout, array, array->values ? array->values + first * array->words : layout->values,
                                                         count * array->words);
        return;
    }
    if (array->kind == ROW_CORNERS || array->kind == ROW_COUNT_CORNERS)
        rows->corners(rows->opaque, first, count, layout->corners);
    put_integers(layout, array, first, count * array->words);
}

/* Bytes begin .. begin + size of a part. */
static void read_part(struct io_layout *layout, const struct part *part, const struct io_rows *rows, uint64_t begin, size_t size,
                      unsigned char *out)
{
    const struct layout_array *array = &part->array;
    if (!array->rows) {
        memcpy(out, layout->texts + part->text + begin, size);
        return;
    }
    size_t row = array->words * array->width, most = block_rows(array);
    while (size) {
        uint64_t first = begin / row, skip = begin % row;
        uint64_t count = (skip + size + row - 1) / row;
        count = count < most ? count : most;
        make_block(layout, array, rows, first, (size_t)count);
        size_t some = (size_t)(count * row - skip);
        some = some < size ? some : size;
        memcpy(out, layout->bytes + skip, some);
        out += some;
        begin += some;
        size -= some;
    }
}

void io_layout_read(struct io_layout *layout, const struct io_rows *rows, uint64_t begin, size_t size, unsigned char *out)
{
    for (size_t p = 0; size && p < layout->count; p++) {
        const struct part *part = &layout->parts[p];
        if (begin >= part->begin + part->size)
            continue;
        uint64_t left = part->begin + part->size - begin;
        size_t some = left < size ? (size_t)left : size;
        read_part(layout, part, rows, begin - part->begin, some, out);
        begin += some;
        out += some;
        size -= some;
    }
}
