/* SPDX-License-Identifier: BSD-3-Clause */
#include <stdlib.h>
#include <string.h>

#include "format/coding/cells.h"
#include "format/common/values.h"
#include "format/fail.h"
#include "format/read/reader.h"

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

enum tetlod_status tetlod_cells(const struct tetlod_file *file, uint32_t field, double *out, struct tetlod_error *error)
{
    const struct tetlodi_index *index = &file->index;
    if (field >= index->info.cell_field_count)
        return tetlodi_fail(error, TETLOD_ERR_ARGUMENT, "there is no cell field number %u", field);
    const struct tetlod_cell_field *cells = &index->cells[field];
    const struct tetlodi_section *section = tetlodi_cells_section(index, field);
    size_t count = (size_t)index->info.tets * cells->components;
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
