/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * Values of cells at the steps of a series are stored exactly, in the stream's order of tetrahedra
 * (format/SPEC.md, 3.7). Every group of steps goes on from the first step, which is there as a value of the stream
 * itself. Frames wait in a file for each field.
 */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "format/common/allowance.h"
#include "format/fail.h"
#include "src/mesh/tet_geom.h"
#include "src/pipeline/series_parts.h"
#include "src/util/array.h"

/* One field. */
struct cell_row {
    const struct series_build *series;
    const struct tetlodi_late_rows *rows;
    uint32_t cells, row; /* of the input's list; of the table */
    size_t count;        /* numbers of a step */
    double *first, *read, *now; /* [count] the first step's; a step's as they were read; in the stream's order */
    struct tetlodi_steps steps;
    struct tetlodi_buffer group;
};

void series_cells_encoding_fini(struct series_cells_encoding *encoding)
{
    for (uint32_t f = 0; f < encoding->time.field_count; f++)
        spool_close(&encoding->spools[f]);
    free(encoding->spools);
    free(encoding->sources);
    tetlodi_buffer_fini(&encoding->table);
    tetlodi_cell_time_fini(&encoding->time);
    *encoding = (struct series_cells_encoding){0};
}

/* The values of a step, in the stream's order. */
static enum tetlod_status load(struct cell_row *row, uint32_t step, double *out, struct tetlod_error *error)
{
    const struct build_series *input = row->series->input;
    uint64_t before = 0, all = 0, tets = row->series->mesh->tet_count;
    uint32_t k = input->cells[row->cells].components;
    for (uint32_t c = 0; c < input->cell_count; c++) {
        before += c < row->cells ? input->cells[c].components : 0;
        all += input->cells[c].components;
    }
    uint64_t offset = (step * all + before) * tets * sizeof *out;
    if (input->cell_values.read(input->cell_values.opaque, offset, row->read, tets * k * sizeof *out) != TETLOD_OK)
        return tetlodi_fail(error, TETLOD_ERR_IO, "a step's values of cells cannot be read from a temporary file");
    for (size_t i = 0; i < row->rows->count; i++)
        memcpy(out + i * k, row->read + row->rows->tet_of[i] * (size_t)k, k * sizeof *out);
    return TETLOD_OK;
}

static void widen(double range[2], const double *values, size_t count)
{
    for (size_t i = 0; i < count; i++)
        if (isfinite(values[i])) {
            range[0] = smaller(range[0], values[i]);
            range[1] = larger(range[1], values[i]);
        }
}

/* Appends a step's frame to the group, and zero bytes, which change nothing, if all frames so far have fewer than
 * decoding them asks for. */
static enum tetlod_status encode_step(struct cell_row *row, uint32_t step, struct series_cells_encoding *out,
                                      struct tetlod_error *error)
{
    struct tetlodi_cell_time *time = &out->time;
    TETLOD_TRY(load(row, step, row->now, error));
    widen(time->ranges[row->row], row->now, row->count);
    size_t size =
        tetlodi_cell_steps_encode(&row->steps, row->series->input->cells[row->cells].type, row->now, &row->group);
    out->numbers += size ? row->count : 0;
    for (;
         size && !row->group.failed && !is_within(out->numbers, STEP_ROWS_FREE, STEP_ROWS_PER_BYTE, out->bytes + size);
         size++)
        tetlodi_put(&row->group, 0, 1);
    out->bytes += size;
    time->sizes[(size_t)row->row * time->step_count + step] = size;
    return row->group.failed ? tetlodi_fail_nomem(error, "a step of cells", size) : TETLOD_OK;
}

static enum tetlod_status encode_group(struct cell_row *row, uint32_t group, struct series_cells_encoding *out,
                                       struct tetlod_error *error)
{
    uint32_t begin = group * STEP_GROUP,
             end = begin + STEP_GROUP < out->time.step_count ? begin + STEP_GROUP : out->time.step_count;
    const struct build_series_cells *cells = &row->series->input->cells[row->cells];
    row->group.size = 0;
    if (!tetlodi_cell_steps_start(&row->steps, cells->type, cells->components, row->rows->count, row->first))
        return tetlodi_fail_nomem(error, "a step of cells", row->count * sizeof(double));
    for (uint32_t step = begin; step < end; step++)
        TETLOD_TRY(encode_step(row, step, out, error));
    tetlodi_digest(row->group.bytes, row->group.size,
                   out->time.digests[(size_t)row->row * out->time.group_count + group]);
    return spool_write(&out->spools[row->row], row->group.bytes, row->group.size, error);
}

static enum tetlod_status encode_field(struct cell_row *row, struct series_cells_encoding *out,
                                       struct tetlod_error *error)
{
    double *range = out->time.ranges[row->row];
    enum tetlod_status status = TETLOD_OK;
    uint32_t components = row->series->input->cells[row->cells].components;
    row->count = (size_t)row->rows->count * components;
    row->first = array_new(row->count, sizeof *row->first);
    row->read = array_new(row->series->mesh->tet_count, components * sizeof *row->read);
    row->now = array_new(row->count, sizeof *row->now);
    if (!row->first || !row->read || !row->now)
        TETLOD_TRY_DONE(tetlodi_fail_nomem(error, "a step of cells", row->count * 3 * sizeof(double)));
    range[0] = INFINITY;
    range[1] = -INFINITY;
    TETLOD_TRY_DONE(load(row, 0, row->first, error));
    for (uint32_t group = 0; group < out->time.group_count; group++)
        TETLOD_TRY_DONE(encode_group(row, group, out, error));
    if (range[0] > range[1])
        range[0] = range[1] = 0;
done:
    tetlodi_steps_fini(&row->steps);
    tetlodi_buffer_fini(&row->group);
    free(row->first);
    free(row->read);
    free(row->now);
    return status;
}

static enum tetlod_status start(const struct series_build *series, uint32_t fields, struct series_cells_encoding *out,
                                struct tetlod_error *error)
{
    out->spools = array_zero(fields, sizeof *out->spools);
    out->sources = array_zero(fields, sizeof *out->sources);
    if (!out->spools || !out->sources || !tetlodi_cell_time_allocate(&out->time, fields, series->input->step_count))
        return tetlodi_fail_nomem(error, "the table of cells' steps", (uint64_t)fields * series->input->step_count * 8);
    for (uint32_t f = 0; f < fields; f++)
        TETLOD_TRY(spool_open(&out->spools[f], error));
    return TETLOD_OK;
}

enum tetlod_status series_cells_encode(const struct series_build *series, const struct tetlodi_late_rows *rows,
                                       struct series_cells_encoding *out, struct tetlod_error *error)
{
    uint32_t fields = 0, row = 0;
    for (uint32_t c = 0; c < series->input->cell_count; c++)
        fields += !series->input->cells[c].missing;
    if (!fields)
        return TETLOD_OK;
    TETLOD_TRY(start(series, fields, out, error));
    for (uint32_t c = 0; c < series->input->cell_count; c++) {
        struct cell_row at = {.series = series, .rows = rows, .cells = c, .row = row};
        if (series->input->cells[c].missing)
            continue;
        out->time.fields[row] = series->input->cells[c].field;
        TETLOD_TRY(encode_field(&at, out, error));
        TETLOD_TRY(spool_source(&out->spools[row], &out->sources[row], error));
        row++;
    }
    tetlodi_cell_time_encode(&out->time, &out->table);
    return out->table.failed ? tetlodi_fail_nomem(error, "the table of cells' steps", out->table.size) : TETLOD_OK;
}
