/* SPDX-License-Identifier: BSD-3-Clause */
#include "format/coding/cells.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "format/coding/step_code.h"
#include "format/common/allowance.h"
#include "format/common/utf8.h"
#include "format/common/values.h"
#include "format/fail.h"

/* bytes of the table for a field without its name; of a field in PCEL */
enum { CELL_ENTRY = 22, PARENT_ENTRY = 38 };

static bool is_quantum(const struct tetlod_cell_field *field)
{
    return field->quantum >= 0 && field->quantum <= 0x1p900 && field->error >= 0 && isfinite(field->error) &&
           (field->quantum > 0 ? field->type <= TETLOD_CELL_FLOAT64 : field->error == 0);
}

static bool decode_field(struct tetlod_cell_field *field, bool in_parents, struct tetlodi_bytes *in, char **text)
{
    unsigned type = (unsigned)tetlodi_get(in, 1);
    field->type = (enum tetlod_cell_type)(type <= TETLOD_CELL_INT64 ? type : 0);
    field->components = (uint32_t)tetlodi_get(in, 1);
    field->region = (tetlodi_get(in, 1) & CELL_REGION) != 0;
    uint64_t reserved = tetlodi_get(in, 1);
    field->range[0] = tetlodi_get_f64(in);
    field->range[1] = tetlodi_get_f64(in);
    field->quantum = in_parents ? tetlodi_get_f64(in) : 0;
    field->error = in_parents ? tetlodi_get_f64(in) : 0;
    size_t size = (size_t)tetlodi_get(in, 2);
    const uint8_t *name = tetlodi_get_block(in, size);
    field->name = *text;
    if (name)
        memcpy(*text, name, size);
    *text += name ? size + 1 : 0;
    return !in->failed && type <= TETLOD_CELL_INT64 && field->components && field->components <= MAX_CELL_COMPONENTS &&
           !reserved && isfinite(field->range[0]) && isfinite(field->range[1]) && field->range[0] <= field->range[1] &&
           is_quantum(field) && size && size <= MAX_NAME && tetlodi_plain_text(field->name, size);
}

const struct tetlodi_section *tetlodi_cells_section(const struct tetlodi_index *index, uint32_t field)
{
    const char *tag = tetlodi_has_parents(index) ? TAG_PARENT_VALUES : TAG_CELL_VALUES;
    for (uint32_t i = 0; i < index->info.section_count; i++)
        if (strcmp(index->sections[i].tag, tag) == 0 && field-- == 0)
            return &index->sections[i];
    return NULL;
}

static const struct tetlodi_section *find(const struct tetlodi_index *index, const char *tag)
{
    return tetlodi_section_find(index->sections, index->info.section_count, tag);
}

bool tetlodi_spread_holds(uint64_t numbers, uint64_t bytes)
{
    return is_within(numbers, STEP_ROWS_FREE, STEP_ROWS_PER_BYTE, bytes);
}

/* A field's section of values holds all rows. */
static bool has_values(const struct tetlodi_index *index, uint32_t f)
{
    const struct tetlod_cell_field *field = &index->cells[f];
    const struct tetlodi_section *section = tetlodi_cells_section(index, f);
    const struct tetlodi_section *map = tetlodi_has_parents(index) ? find(index, TAG_PARENT_MAP) : NULL;
    uint64_t numbers = (uint64_t)tetlodi_cell_rows(index) * field->components;
    if (section && map && !tetlodi_spread_holds((uint64_t)index->info.tets * field->components,
                                                section->frame.size + map->frame.size))
        return false;
    if (section && field->quantum > 0)
        return !(section->flags & SECTION_PACKED) && (!section->plain || tetlodi_steps_hold(numbers, section->plain));
    return section && section->plain == numbers * cell_width(field->type);
}

static bool is_repeated(const struct tetlodi_index *index, uint32_t f)
{
    for (uint32_t g = 0; g < f; g++)
        if (strcmp(index->cells[g].name, index->cells[f].name) == 0)
            return true;
    return false;
}

static enum tetlod_status fail_table(struct tetlod_error *error)
{
    return tetlodi_fail(error, TETLOD_ERR_STREAM,
                        "the table of cell data is damaged, or does not go with the values");
}

static enum tetlod_status decode_table(struct tetlodi_index *index, struct tetlodi_bytes in, struct tetlod_error *error)
{
    bool in_parents = tetlodi_has_parents(index);
    size_t size = in.left;
    uint32_t count = (uint32_t)tetlodi_get(&in, 2);
    bool good = !in.failed && count <= MAX_FIELDS &&
                (uint64_t)count * (in_parents ? PARENT_ENTRY : CELL_ENTRY) <= in.left;
    index->cells = calloc(good && count ? count : 1, sizeof *index->cells);
    index->cell_names = calloc(size + 1, 1);
    if (!index->cells || !index->cell_names)
        return tetlodi_fail_nomem(error, "the table of cell data", size);
    char *text = index->cell_names;
    for (uint32_t f = 0; f < count && good; f++)
        good = decode_field(&index->cells[f], in_parents, &in, &text) && !is_repeated(index, f) && has_values(index, f);
    if (!good || in.left || tetlodi_cells_section(index, count))
        return fail_table(error);
    index->info.cell_field_count = count;
    index->info.cell_fields = index->cells;
    return TETLOD_OK;
}

enum tetlod_status tetlodi_cells_decode(struct tetlodi_index *index, const uint8_t *bytes, size_t size,
                                        struct tetlod_error *error)
{
    return decode_table(index, (struct tetlodi_bytes){bytes, size, false}, error);
}

enum tetlod_status tetlodi_parents_decode(struct tetlodi_index *index, const uint8_t *bytes, size_t size,
                                          struct tetlod_error *error)
{
    struct tetlodi_bytes in = {bytes, size, false};
    uint64_t rows = tetlodi_get(&in, 8);
    const struct tetlodi_section *map = find(index, TAG_PARENT_MAP), *values = find(index, TAG_PARENT_VALUES);
    if (in.failed || !rows || rows > index->info.tets || find(index, TAG_CELLS) ||
        (map ? map->flags & SECTION_PACKED || (values && values < map) : rows != index->info.tets))
        return fail_table(error);
    index->parents = (uint32_t)rows;
    TETLOD_TRY(decode_table(index, in, error));
    index->info.cell_rows = index->parents;
    for (uint32_t f = 0; f < index->info.cell_field_count; f++)
        index->info.lossless &= index->cells[f].quantum == 0;
    return TETLOD_OK;
}

/* ---- the map */

int tetlodi_parents_code(struct tetlodi_coder *coder, uint32_t *parents, uint32_t tets, uint32_t count)
{
    struct tetlodi_bit fresh[2];
    struct tetlodi_number models;
    uint32_t seen = 0, last = 0;
    unsigned context = 0;
    int is_fresh = 1;
    tetlodi_bits_init(fresh, 2);
    tetlodi_number_init(&models);
    for (uint32_t t = 0; t < tets; t++) {
        is_fresh = t == 0 || code_bit(coder, &fresh[is_fresh], parents[t] == seen);
        int64_t distance = is_fresh ? (int64_t)seen - last
                                    : code_number(coder, &models, context, (int64_t)parents[t] - last);
        if (is_fresh ? seen == count : distance < -(int64_t)last || distance >= (int64_t)seen - last)
            return 0;
        context = is_fresh ? context : bit_length((uint64_t)(distance < 0 ? -distance : distance));
        parents[t] = last = (uint32_t)(last + distance);
        seen += (uint32_t)is_fresh;
    }
    return seen == count && !coder->bad;
}

uint32_t tetlod_cell_section(const struct tetlod_info *info, uint32_t field)
{
    for (uint32_t i = 0; i < info->section_count && field < info->cell_field_count; i++)
        if (strcmp(info->sections[i].tag, info->cell_rows ? TAG_PARENT_VALUES : TAG_CELL_VALUES) == 0 && field-- == 0)
            return i;
    return TETLOD_NONE;
}

uint32_t tetlod_cell_field_index(const struct tetlod_info *info, const char *name)
{
    for (uint32_t f = 0; f < info->cell_field_count; f++)
        if (strcmp(info->cell_fields[f].name, name) == 0)
            return f;
    return TETLOD_NONE;
}
