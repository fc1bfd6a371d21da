/* SPDX-License-Identifier: BSD-3-Clause */
#include "format/coding/cells.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "format/common/allowance.h"
#include "format/common/utf8.h"
#include "format/common/values.h"
#include "format/fail.h"

enum { CELL_ENTRY = 22 }; /* bytes of the table for a field without its name */

static bool decode_field(struct tetlod_cell_field *field, struct tetlodi_bytes *in, char **text)
{
    unsigned type = (unsigned)tetlodi_get(in, 1);
    field->type = (enum tetlod_cell_type)(type <= TETLOD_CELL_INT64 ? type : 0);
    field->components = (uint32_t)tetlodi_get(in, 1);
    field->region = (tetlodi_get(in, 1) & CELL_REGION) != 0;
    uint64_t reserved = tetlodi_get(in, 1);
    field->range[0] = tetlodi_get_f64(in);
    field->range[1] = tetlodi_get_f64(in);
    size_t size = (size_t)tetlodi_get(in, 2);
    const uint8_t *name = tetlodi_get_block(in, size);
    field->name = *text;
    if (name)
        memcpy(*text, name, size);
    *text += name ? size + 1 : 0;
    return !in->failed && type <= TETLOD_CELL_INT64 && field->components && field->components <= MAX_CELL_COMPONENTS && !reserved &&
           isfinite(field->range[0]) && isfinite(field->range[1]) && field->range[0] <= field->range[1] && size && size <= MAX_NAME &&
           tetlodi_plain_text(field->name, size);
}

const struct tetlodi_section *tetlodi_cells_section(const struct tetlodi_index *index, uint32_t field)
{
    for (uint32_t i = 0; i < index->info.section_count; i++)
        if (strcmp(index->sections[i].tag, TAG_CELL_VALUES) == 0 && field-- == 0)
            return &index->sections[i];
    return NULL;
}

/* A field's section of values holds a row for each tetrahedron. */
static bool has_values(const struct tetlodi_index *index, uint32_t f)
{
    const struct tetlod_cell_field *field = &index->cells[f];
    const struct tetlodi_section *section = tetlodi_cells_section(index, f);
    return section && section->plain == (uint64_t)index->info.tets * field->components * cell_width(field->type);
}

static bool is_repeated(const struct tetlodi_index *index, uint32_t f)
{
    for (uint32_t g = 0; g < f; g++)
        if (strcmp(index->cells[g].name, index->cells[f].name) == 0)
            return true;
    return false;
}

enum tetlod_status tetlodi_cells_decode(struct tetlodi_index *index, const uint8_t *bytes, size_t size,
                                        struct tetlod_error *error)
{
    struct tetlodi_bytes in = {bytes, size, false};
    uint32_t count = (uint32_t)tetlodi_get(&in, 2);
    bool good = !in.failed && count <= MAX_FIELDS && (uint64_t)count * CELL_ENTRY <= in.left;
    index->cells = calloc(good && count ? count : 1, sizeof *index->cells);
    index->cell_names = calloc(size + 1, 1);
    if (!index->cells || !index->cell_names)
        return tetlodi_fail_nomem(error, "the table of cell data", size);
    char *text = index->cell_names;
    for (uint32_t f = 0; f < count && good; f++)
        good = decode_field(&index->cells[f], &in, &text) && !is_repeated(index, f) && has_values(index, f);
    if (!good || in.left || tetlodi_cells_section(index, count))
        return tetlodi_fail(error, TETLOD_ERR_STREAM,
                            "the table of cell data is damaged, or does not go with the values");
    index->info.cell_field_count = count;
    index->info.cell_fields = index->cells;
    return TETLOD_OK;
}

uint32_t tetlod_cell_field_index(const struct tetlod_info *info, const char *name)
{
    for (uint32_t f = 0; f < info->cell_field_count; f++)
        if (strcmp(info->cell_fields[f].name, name) == 0)
            return f;
    return TETLOD_NONE;
}
