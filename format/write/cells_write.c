/* SPDX-License-Identifier: BSD-3-Clause */
#include "format/write/cells_write.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "format/coding/cell_steps.h"
#include "format/coding/cells.h"
#include "format/common/pack.h"
#include "format/common/values.h"

/* Does a value survive in the type? */
static bool fits(double value, enum tetlod_cell_type type)
{
    float narrow = (float)value;
    double back = (double)narrow, most = ldexp(1, (int)(8 * cell_width(type)) - 1);
    if (type == TETLOD_CELL_FLOAT64)
        return true;
    if (type == TETLOD_CELL_FLOAT32)
        return isnan(value) || memcmp(&back, &value, sizeof value) == 0;
    return fabs(value) <= MAX_WHOLE_CELL && value == floor(value) && value >= -most && value < most &&
           !(value == 0 && signbit(value));
}

static double code_of(const struct tetlodi_write_cells *cells, double value)
{
    return floor(value / cells->quantum + 0.5);
}

/* Of rounded values: is it that of its code? */
static bool is_rounded(const struct tetlodi_write_cells *cells, double value)
{
    return !(cells->quantum > 0) || tetlodi_cell_value(cells->type, cells->quantum, code_of(cells, value)) == value;
}

const char *tetlodi_cells_wrong(const struct tetlodi_write_cells *cells, uint32_t count, uint32_t tets)
{
    if (count > MAX_FIELDS)
        return "it has too many fields of cells";
    for (uint32_t f = 0; f < count; f++) {
        const char *wrong = tetlodi_field_wrong(cells[f].name, cells[f].components);
        if (wrong)
            return wrong;
        for (uint32_t g = 0; g < f; g++)
            if (strcmp(cells[g].name, cells[f].name) == 0)
                return "two fields of cells have one name";
        for (size_t i = 0; i < (size_t)tets * cells[f].components; i++)
            if (!fits(cells[f].values[i], cells[f].type) || !is_rounded(&cells[f], cells[f].values[i]))
                return "a field of cells has a value that its type does not hold";
    }
    return NULL;
}

static void put_range(const struct tetlodi_write_cells *cells, uint32_t tets, struct tetlodi_buffer *out)
{
    double range[2] = {0, 0};
    bool any = false;
    for (size_t i = 0; i < (size_t)tets * cells->components; i++) {
        double value = cells->values[i];
        if (!isfinite(value))
            continue;
        range[0] = any && range[0] <= value ? range[0] : value;
        range[1] = any && range[1] >= value ? range[1] : value;
        any = true;
    }
    tetlodi_put_f64(out, range[0]);
    tetlodi_put_f64(out, range[1]);
}

static void encode_table(const struct tetlodi_cells_input *in, const struct tetlodi_cell_parts *parts, bool in_parents,
                         struct tetlodi_buffer *out)
{
    if (in_parents)
        tetlodi_put(out, parts->row_count, 8);
    tetlodi_put(out, in->count, 2);
    for (uint32_t f = 0; f < in->count; f++) {
        const struct tetlodi_write_cells *cells = &in->cells[f];
        size_t size = strlen(cells->name);
        tetlodi_put(out, cells->type, 1);
        tetlodi_put(out, cells->components, 1);
        tetlodi_put(out, cells->region ? CELL_REGION : 0, 1);
        tetlodi_put(out, 0, 1); // reserved
        put_range(cells, in->tets, out);
        if (in_parents) {
            tetlodi_put_f64(out, cells->quantum);
            tetlodi_put_f64(out, cells->error);
        }
        tetlodi_put(out, size, 2);
        tetlodi_put_block(out, cells->name, size);
    }
}

static uint64_t bits_of(double value, enum tetlod_cell_type type)
{
    float single = (float)value;
    uint32_t narrow;
    uint64_t wide;
    memcpy(&narrow, &single, sizeof narrow);
    memcpy(&wide, &value, sizeof wide);
    return type == TETLOD_CELL_FLOAT32 ? narrow : type == TETLOD_CELL_FLOAT64 ? wide : (uint64_t)(int64_t)value;
}

static void encode_rows(const struct tetlodi_write_cells *cells, const uint32_t *tet_of, uint32_t rows,
                        struct tetlodi_buffer *out)
{
    size_t n = cells->components;
    for (uint32_t row = 0; row < rows; row++)
        for (size_t c = 0; c < n; c++)
            tetlodi_put(out, bits_of(cells->values[tet_of[row] * n + c], cells->type),
                        cell_width(cells->type));
}

/* As a step behind one of zeros; zero bytes behind it change nothing. */
static bool encode_rounded(const struct tetlodi_write_cells *cells, const uint32_t *tet_of, uint32_t rows,
                           struct tetlodi_buffer *out)
{
    size_t n = cells->components, count = rows * n;
    double *codes = calloc(count, sizeof *codes);
    struct tetlodi_steps steps = {0};
    bool good = codes && tetlodi_cell_steps_start(&steps, TETLOD_CELL_INT64, cells->components, rows, codes);
    for (size_t i = 0; i < count && good; i++)
        codes[i] = code_of(cells, cells->values[tet_of[i / n] * n + i % n]);
    if (good && tetlodi_cell_steps_encode(&steps, TETLOD_CELL_INT64, codes, out))
        while (!out->failed && !tetlodi_steps_hold(count, out->size))
            tetlodi_put(out, 0, 1);
    tetlodi_steps_fini(&steps);
    free(codes);
    return good && !out->failed;
}

static bool encode_field(const struct tetlodi_write_cells *cells, const uint32_t *tet_of, uint32_t rows,
                         struct tetlodi_buffer *out)
{
    if (cells->quantum > 0)
        return encode_rounded(cells, tet_of, rows, out);
    encode_rows(cells, tet_of, rows, out);
    return !out->failed;
}

/* ---- rows of cells */

/* Numbers the cells by their first tetrahedra, which become tet_of; parents[t] is the row of the stream's tetrahedron
 * t. False: out of memory. */
static bool find_rows(const struct tetlodi_cells_input *in, struct tetlodi_cell_parts *out, uint32_t *parents)
{
    uint32_t most = 0;
    for (uint32_t t = 0; t < in->tets; t++)
        most = in->parents[t] > most ? in->parents[t] : most;
    uint32_t *row_of = malloc((most + (size_t)1) * sizeof *row_of);
    out->row_count = 0;
    if (!row_of)
        return false;
    memset(row_of, 0xff, (most + (size_t)1) * sizeof *row_of); // TETLOD_NONE
    for (uint32_t t = 0; t < in->tets; t++) {
        uint32_t *row = &row_of[in->parents[in->original_of[t]]];
        if (*row == TETLOD_NONE) {
            *row = out->row_count;
            out->tet_of[out->row_count++] = in->original_of[t];
        }
        parents[t] = *row;
    }
    free(row_of);
    return true;
}

static bool encode_map(uint32_t *parents, uint32_t tets, uint32_t rows, struct tetlodi_buffer *out)
{
    struct tetlodi_memory memory = {.most = UINT64_MAX};
    struct tetlodi_encoder encoder = {0};
    struct tetlodi_coder coder;
    tetlodi_encode_start(&coder, PARENTS_SLOWEST, &encoder, &memory);
    tetlodi_parents_code(&coder, parents, tets, rows);
    tetlodi_encode_finish(&coder);
    tetlodi_put_block(out, encoder.bytes, encoder.size);
    bool good = !encoder.failed && !out->failed;
    TETLODI_FREE(&memory, encoder.bytes, encoder.capacity);
    return good;
}

/* Bytes that a field takes in the stream. */
static size_t stored_size(const struct tetlodi_write_cells *cells, const struct tetlodi_buffer *rows)
{
    struct tetlodi_buffer packed = {0};
    uint32_t stride = cells->components * cell_width(cells->type);
    size_t size = rows->size;
    if (!(cells->quantum > 0) && tetlodi_pack(PACKED_VALUES, rows->bytes, rows->size, stride, &packed))
        size = packed.size;
    tetlodi_buffer_fini(&packed);
    return size;
}

/* All fields with the rows of tet_of, and the bytes that these take. False: out of memory. */
static bool encode_fields(struct tetlodi_cell_parts *out, const struct tetlodi_cells_input *in, bool measures,
                          size_t *size)
{
    bool good = true;
    out->rows = calloc(in->count, sizeof *out->rows);
    *size = out->map.size;
    for (uint32_t f = 0; f < in->count && out->rows && good; f++) {
        good = encode_field(&in->cells[f], out->tet_of, out->row_count, &out->rows[f]);
        size_t stored = good && measures ? stored_size(&in->cells[f], &out->rows[f]) : 0;
        *size += stored;
        if (out->has_parents &&
            !tetlodi_spread_holds((uint64_t)in->tets * in->cells[f].components, stored + out->map.size))
            *size = SIZE_MAX / 2; // rows of tetrahedra may be more
    }
    return good && out->rows;
}

static bool encode_by_tets(struct tetlodi_cell_parts *out, const struct tetlodi_cells_input *in, bool measures,
                           size_t *size)
{
    out->count = in->count;
    out->row_count = in->tets;
    out->tet_of = malloc(in->tets * sizeof *out->tet_of);
    if (!out->tet_of)
        return false;
    memcpy(out->tet_of, in->original_of, in->tets * sizeof *out->tet_of);
    return encode_fields(out, in, measures, size);
}

static bool encode_by_cells(struct tetlodi_cell_parts *out, const struct tetlodi_cells_input *in, size_t *size)
{
    uint32_t *parents = malloc(in->tets * sizeof *parents);
    out->count = in->count;
    out->tet_of = malloc(in->tets * sizeof *out->tet_of);
    bool good = parents && out->tet_of && find_rows(in, out, parents);
    out->has_parents = good && out->row_count < in->tets;
    if (out->has_parents)
        good = encode_map(parents, in->tets, out->row_count, &out->map) && encode_fields(out, in, true, size);
    free(parents);
    return good;
}

/* Rows of cells where they are smaller with their map. */
static bool encode_smaller(struct tetlodi_cell_parts *out, const struct tetlodi_cells_input *in)
{
    struct tetlodi_cell_parts by_cells = {0};
    size_t size = 0, size_of_cells = 0;
    if (in->parents && !encode_by_cells(&by_cells, in, &size_of_cells)) {
        tetlodi_cell_parts_fini(&by_cells);
        return false;
    }
    bool good = encode_by_tets(out, in, by_cells.has_parents, &size);
    if (good && by_cells.has_parents && size_of_cells < size) {
        tetlodi_cell_parts_fini(out);
        *out = by_cells;
    } else {
        tetlodi_cell_parts_fini(&by_cells);
    }
    return good;
}

bool tetlodi_cells_encode(struct tetlodi_cell_parts *out, const struct tetlodi_cells_input *in)
{
    bool is_rounded = false;
    if (!in->count)
        return true;
    if (!encode_smaller(out, in))
        return false;
    for (uint32_t f = 0; f < in->count; f++)
        is_rounded |= in->cells[f].quantum > 0;
    out->in_parents = out->has_parents || is_rounded;
    encode_table(in, out, out->in_parents, &out->table);
    return !out->table.failed;
}

uint32_t tetlodi_cells_list(const struct tetlodi_cell_parts *parts, const struct tetlodi_write_cells *cells,
                            struct tetlodi_write_section *sections)
{
    uint32_t count = 0;
    if (!parts->count)
        return 0;
    sections[count++] = (struct tetlodi_write_section){.tag = parts->in_parents ? TAG_PARENTS : TAG_CELLS, .early = 1,
                                                       .bytes = parts->table.bytes, .size = parts->table.size};
    if (parts->has_parents)
        sections[count++] = (struct tetlodi_write_section){.tag = TAG_PARENT_MAP, .row = ROW_CODED,
                                                           .bytes = parts->map.bytes, .size = parts->map.size};
    for (uint32_t f = 0; f < parts->count; f++) {
        uint32_t row = cells[f].components * cell_width(cells[f].type);
        sections[count++] =
            (struct tetlodi_write_section){.tag = parts->in_parents ? TAG_PARENT_VALUES : TAG_CELL_VALUES,
                                           .row = cells[f].quantum > 0 ? ROW_CODED : row,
                                           .bytes = parts->rows[f].bytes,
                                           .size = parts->rows[f].size};
    }
    return count;
}

void tetlodi_cell_parts_fini(struct tetlodi_cell_parts *parts)
{
    for (uint32_t f = 0; f < parts->count && parts->rows; f++)
        tetlodi_buffer_fini(&parts->rows[f]);
    free(parts->rows);
    tetlodi_buffer_fini(&parts->table);
    tetlodi_buffer_fini(&parts->map);
    free(parts->tet_of);
    *parts = (struct tetlodi_cell_parts){0};
}
