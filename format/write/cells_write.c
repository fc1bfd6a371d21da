/* SPDX-License-Identifier: BSD-3-Clause */
#include "format/write/cells_write.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "format/coding/cells.h"
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
    return fabs(value) <= MAX_WHOLE_CELL && value == floor(value) && value >= -most && value < most && !(value == 0 && signbit(value));
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
            if (!fits(cells[f].values[i], cells[f].type))
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

static void encode_table(const struct tetlodi_write_cells *cells, uint32_t count, uint32_t tets,
                         struct tetlodi_buffer *out)
{
    tetlodi_put(out, count, 2);
    for (uint32_t f = 0; f < count; f++) {
        size_t size = strlen(cells[f].name);
        tetlodi_put(out, cells[f].type, 1);
        tetlodi_put(out, cells[f].components, 1);
        tetlodi_put(out, cells[f].region ? CELL_REGION : 0, 1);
        tetlodi_put(out, 0, 1); // reserved
        put_range(&cells[f], tets, out);
        tetlodi_put(out, size, 2);
        tetlodi_put_block(out, cells[f].name, size);
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

static void encode_rows(const struct tetlodi_write_cells *cells, const uint32_t *original_of, uint32_t tets,
                        struct tetlodi_buffer *out)
{
    size_t n = cells->components;
    for (uint32_t t = 0; t < tets; t++)
        for (size_t c = 0; c < n; c++)
            tetlodi_put(out, bits_of(cells->values[original_of[t] * n + c], cells->type),
                        cell_width(cells->type));
}

bool tetlodi_cells_encode(struct tetlodi_cell_parts *out, const struct tetlodi_write_cells *cells, uint32_t count,
                          const uint32_t *original_of, uint32_t tets)
{
    if (!count)
        return true;
    out->count = count;
    out->rows = calloc(count, sizeof *out->rows);
    if (!out->rows)
        return false;
    encode_table(cells, count, tets, &out->table);
    bool failed = out->table.failed;
    for (uint32_t f = 0; f < count; f++) {
        encode_rows(&cells[f], original_of, tets, &out->rows[f]);
        failed |= out->rows[f].failed;
    }
    return !failed;
}

uint32_t tetlodi_cells_list(const struct tetlodi_cell_parts *parts, const struct tetlodi_write_cells *cells,
                            struct tetlodi_write_section *sections)
{
    if (!parts->count)
        return 0;
    sections[0] = (struct tetlodi_write_section){.tag = TAG_CELLS, .early = 1, .bytes = parts->table.bytes,
                                                 .size = parts->table.size};
    for (uint32_t f = 0; f < parts->count; f++) {
        uint32_t row = cells[f].components * cell_width(cells[f].type);
        sections[1 + f] = (struct tetlodi_write_section){.tag = TAG_CELL_VALUES, .row = row,
                                                         .bytes = parts->rows[f].bytes, .size = parts->rows[f].size};
    }
    return 1 + parts->count;
}

void tetlodi_cell_parts_fini(struct tetlodi_cell_parts *parts)
{
    for (uint32_t f = 0; f < parts->count && parts->rows; f++)
        tetlodi_buffer_fini(&parts->rows[f]);
    free(parts->rows);
    tetlodi_buffer_fini(&parts->table);
}
