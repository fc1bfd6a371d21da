/* SPDX-License-Identifier: BSD-3-Clause */
/* Files of which any range can be written by itself: each array knows the bytes of its rows, and asks for those that it
 * needs. */
#include "src/io/writers/layout.h"

#include <math.h>
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

/* Bytes of an integer of which all values are whole numbers that doubles hold exactly; 0: they have to be floats. */
static size_t integer_width(const struct point_field *field, size_t count)
{
    size_t width = field->is_integer && field->values ? 4 : 0;
    for (size_t i = 0; i < count && width; i++)
        width = !(fabs(field->values[i]) <= 0x1p53) ? 0 : fabs(field->values[i]) > INT32_MAX ? 8 : width; // also NaN
    return width;
}

struct layout_array layout_of_field(const struct point_field *field, uint32_t column, uint64_t rows)
{
    size_t integer = integer_width(field,
                                   (size_t)rows * field->components), real = field->type == TETLOD_FLOAT32 ? 4 : 8;
    return (struct layout_array){.kind = ROW_VALUES, .column = column, .words = field->components,
                                 .width = integer ? integer : real,
                                 .integer = integer > 0, .rows = rows, .values = field->values};
}

static bool add_part(struct io_layout *layout, const struct part *part)
{
    if (!ARRAY_RESERVE(layout->parts, layout->capacity, layout->count + 1))
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
    if (!ARRAY_RESERVE(layout->texts, layout->text_capacity, layout->text_size + size))
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

static void store_values(const struct layout_array *array, const double *values, size_t count, unsigned char *out)
{
    for (size_t i = 0; i < count; i++)
        if (array->width == 4) {
            float narrow = (float)values[i];
            uint32_t word;
            memcpy(&word, &narrow, sizeof word);
            store32(out + 4 * i, word, array->big_endian);
        } else {
            uint64_t word;
            memcpy(&word, &values[i], sizeof word);
            store64(out + 8 * i, word, array->big_endian);
        }
}

static void store_whole_values(const struct layout_array *array, const double *values, size_t count, unsigned char *out)
{
    for (size_t i = 0; i < count; i++)
        if (array->width == 4)
            store32(out + 4 * i, (uint32_t)(int32_t)values[i], array->big_endian);
        else
            store64(out + 8 * i, (uint64_t)(int64_t)values[i], array->big_endian);
}

/* Word first + i; the corners are those from `first` on. */
static uint64_t integer_at(const struct layout_array *array, const uint32_t *corners, uint64_t first, size_t i)
{
    switch (array->kind) {
    case ROW_CORNERS:
        return corners[i];
    case ROW_COUNT_CORNERS:
        return i % 5 ? corners[i / 5 * 4 + i % 5 - 1] : 4;
    case ROW_END:
        return 4 * (first + i + 1);
    default:
        return VTK_TETRA;
    }
}

static void store_integers(const struct layout_array *array, const uint32_t *corners, uint64_t first, size_t count,
                           unsigned char *out)
{
    for (size_t i = 0; i < count; i++) {
        uint64_t word = integer_at(array, corners, first, i);
        if (array->width == 1)
            out[i] = (unsigned char)word;
        else if (array->width == 4)
            store32(out + 4 * i, (uint32_t)word, array->big_endian);
        else
            store64(out + 8 * i, word, array->big_endian);
    }
}

/* `values` and `corners` are those from the word `first` on. */
static void store_words(const struct layout_array *array, const double *values, const uint32_t *corners,
                        uint64_t first, size_t count,
                        unsigned char *out)
{
    if (array->kind != ROW_VALUES)
        store_integers(array, corners, first, count, out);
    else if (array->integer)
        store_whole_values(array, values, count, out);
    else
        store_values(array, values, count, out);
}

void layout_store(const struct layout_array *array, uint64_t first, size_t count, unsigned char *out)
{
    uint64_t corner = array->kind == ROW_COUNT_CORNERS ? first / 5 * 4 : first;
    store_words(array, array->values ? array->values + first : NULL, array->corners ? array->corners + corner : NULL,
                first, count, out);
}

/* The bytes of some rows, into layout->bytes. */
static void make_block(struct io_layout *layout, const struct layout_array *array, const struct io_rows *rows,
                       uint64_t first,
                       size_t count)
{
    uint64_t word = first * array->words;
    size_t words = count * array->words;
    bool has_corners = array->kind == ROW_CORNERS || array->kind == ROW_COUNT_CORNERS;
    if ((array->kind == ROW_VALUES && array->values) || (has_corners && array->corners)) {
        layout_store(array, word, words, layout->bytes);
        return;
    }
    if (array->kind == ROW_VALUES)
        rows->values(rows->opaque, array->column, first, count, layout->values);
    else if (has_corners)
        rows->corners(rows->opaque, first, count, layout->corners);
    store_words(array, layout->values, layout->corners, word, words, layout->bytes);
}

/* Bytes begin .. begin + size of a part. */
static void read_part(struct io_layout *layout, const struct part *part, const struct io_rows *rows, uint64_t begin,
                      size_t size,
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

void io_layout_read(struct io_layout *layout, const struct io_rows *rows, uint64_t begin, size_t size,
                    unsigned char *out)
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

enum tetlod_status layout_end(struct io_layout **out, enum tetlod_status status)
{
    if (status != TETLOD_OK) {
        io_layout_free(*out);
        *out = NULL;
    }
    return status;
}

enum tetlod_status layout_write_whole(io_layout_maker *lay_out, const struct tetmesh *mesh,
                                      const struct tetlodi_sink *sink,
                                      struct tetlod_error *error)
{
    enum { PIECE = 1 << 16 };
    struct io_layout *layout;
    TETLOD_TRY(lay_out(&layout, mesh, error));
    unsigned char *piece = array_new(PIECE, 1);
    enum tetlod_status status = piece ? TETLOD_OK : tetlodi_fail_nomem(error, "a buffer", PIECE);
    for (uint64_t at = 0; status == TETLOD_OK && at < layout->size; at += PIECE) {
        size_t size = layout->size - at < PIECE ? (size_t)(layout->size - at) : PIECE;
        io_layout_read(layout, NULL, at, size, piece);
        status = sink->write(sink->opaque, piece, size);
    }
    free(piece);
    io_layout_free(layout);
    return status;
}
