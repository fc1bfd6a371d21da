/* SPDX-License-Identifier: BSD-3-Clause */
#include "format/read/cell_values.h"

#include <stdlib.h>
#include <string.h>

#include "format/coding/cell_steps.h"
#include "format/coding/cells.h"
#include "format/common/values.h"
#include "format/fail.h"

static double float_of(uint64_t bits, unsigned width)
{
    uint32_t narrow = (uint32_t)bits;
    float single;
    double value;
    memcpy(&single, &narrow, sizeof single);
    memcpy(&value, &bits, sizeof value);
    return width == 4 ? (double)single : value;
}

/* False: a double may not hold it. */
static bool whole_of(uint64_t bits, unsigned width, double *out)
{
    uint64_t sign = (uint64_t)1 << (8 * width - 1), size = bits & sign ? (~bits & (sign - 1)) + 1 : bits;
    *out = bits & sign ? -(double)size : (double)size;
    return size <= (uint64_t)MAX_WHOLE_CELL;
}

enum tetlod_status tetlodi_read_parents(const struct tetlod_file *file, uint32_t **out, struct tetlod_error *error)
{
    const struct tetlodi_index *index = &file->index;
    const struct tetlodi_section *map =
        tetlodi_has_parents(index) ? tetlodi_section_find(index->sections, index->info.section_count, TAG_PARENT_MAP)
                                   : NULL;
    struct tetlodi_coder coder;
    uint8_t *bytes;
    *out = NULL;
    if (!map)
        return TETLOD_OK;
    TETLOD_TRY(tetlodi_read_section(file, map, &bytes, error));
    uint32_t *parents = calloc(index->info.tets, sizeof *parents);
    if (!parents) {
        free(bytes);
        return tetlodi_fail_nomem(error, "the cells of tetrahedra", index->info.tets * (uint64_t)4);
    }
    tetlodi_decode_start(&coder, PARENTS_SLOWEST, bytes, (size_t)map->plain);
    int good = tetlodi_parents_code(&coder, parents, (uint32_t)index->info.tets, index->parents);
    while (good && coder.at < coder.end)
        good = *coder.at++ == 0;
    free(bytes);
    if (!good) {
        free(parents);
        return tetlodi_fail(error, TETLOD_ERR_STREAM, "the map from tetrahedra to cells is damaged");
    }
    *out = parents;
    return TETLOD_OK;
}

void tetlodi_spread_rows(double *values, uint32_t components, const uint32_t *parents, uint32_t tets)
{
    size_t n = components;
    for (size_t t = tets; parents && t--;) // no tetrahedron's row is behind its own number
        if (parents[t] != t)
            memcpy(values + t * n, values + parents[t] * n, n * sizeof *values);
}

/* One frame, as of a step behind one of zeros. */
static enum tetlod_status decode_rounded(const struct tetlodi_index *index, const struct tetlod_cell_field *field,
                                         const uint8_t *bytes, size_t size, double *out, struct tetlod_error *error)
{
    size_t count = (size_t)tetlodi_cell_rows(index) * field->components;
    struct tetlodi_steps steps = {0};
    bool good = true;
    memset(out, 0, count * sizeof *out);
    uint32_t rows = (uint32_t)tetlodi_cell_rows(index); // of a finest level that is held
    bool room = tetlodi_cell_steps_start(&steps, TETLOD_CELL_INT64, field->components, rows, out);
    if (room && size)
        good = tetlodi_steps_decode(&steps, bytes, size);
    if (room)
        tetlodi_cell_steps_values(&steps, TETLOD_CELL_INT64, out);
    tetlodi_steps_fini(&steps);
    for (size_t i = 0; i < count && good && room; i++) {
        out[i] = tetlodi_cell_value(field->type, field->quantum, out[i]);
        good = isfinite(out[i]);
    }
    if (!room)
        return tetlodi_fail_nomem(error, field->name, count * sizeof *out);
    return good ? TETLOD_OK : tetlodi_fail(error, TETLOD_ERR_STREAM, "cell data %.60s is damaged", field->name);
}

static enum tetlod_status read_rounded(const struct tetlod_file *file, uint32_t number, double *out,
                                       struct tetlod_error *error)
{
    const struct tetlodi_section *section = tetlodi_cells_section(&file->index, number);
    uint8_t *bytes;
    TETLOD_TRY(tetlodi_read_section(file, section, &bytes, error));
    enum tetlod_status status =
        decode_rounded(&file->index, &file->index.cells[number], bytes, (size_t)section->plain, out, error);
    free(bytes);
    return status;
}

enum tetlod_status tetlodi_read_cell_rows(const struct tetlod_file *file, uint32_t field, double *out,
                                          struct tetlod_error *error)
{
    const struct tetlodi_index *index = &file->index;
    const struct tetlod_cell_field *cells = &index->cells[field];
    if (cells->quantum > 0)
        return read_rounded(file, field, out, error);
    const struct tetlodi_section *section = tetlodi_cells_section(index, field);
    size_t count = (size_t)tetlodi_cell_rows(index) * cells->components;
    unsigned width = cell_width(cells->type);
    uint8_t *bytes = malloc(count * width);
    if (!bytes)
        return tetlodi_fail_nomem(error, cells->name, count * width);
    enum tetlod_status status = tetlod_section_read(file, (uint32_t)(section - index->sections), bytes, error);
    struct tetlodi_bytes in = {bytes, count * width, false};
    for (size_t i = 0; i < count && status == TETLOD_OK; i++) {
        uint64_t bits = tetlodi_get(&in, width);
        if (cells->type <= TETLOD_CELL_FLOAT64)
            out[i] = float_of(bits, width);
        else if (!whole_of(bits, width, &out[i]))
            status = tetlodi_fail(error, TETLOD_ERR_STREAM, "cell data %.60s: a number beyond 2^53", cells->name);
    }
    free(bytes);
    return status;
}

enum tetlod_status tetlod_cells(const struct tetlod_file *file, uint32_t field, double *out, struct tetlod_error *error)
{
    const struct tetlod_info *info = &file->index.info;
    uint32_t *parents;
    if (field >= info->cell_field_count)
        return tetlodi_fail(error, TETLOD_ERR_ARGUMENT, "there is no cell field number %u", field);
    TETLOD_TRY(tetlodi_finest_held(&file->index, error));
    TETLOD_TRY(tetlodi_read_parents(file, &parents, error));
    enum tetlod_status status = tetlodi_read_cell_rows(file, field, out, error);
    if (status == TETLOD_OK)
        tetlodi_spread_rows(out, info->cell_fields[field].components, parents, (uint32_t)info->tets);
    free(parents);
    return status;
}
