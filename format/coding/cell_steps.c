/* SPDX-License-Identifier: BSD-3-Clause */
#include "format/coding/cell_steps.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "format/coding/cells.h"
#include "format/common/values.h"
#include "format/fail.h"

enum { TABLE_HEAD = 8, FIELD_ROW = 24 };

/* ---- the table */

bool tetlodi_cell_time_allocate(struct tetlodi_cell_time *time, uint32_t fields, uint32_t steps)
{
    uint32_t groups = (steps + STEP_GROUP - 1) / STEP_GROUP;
    *time = (struct tetlodi_cell_time){.field_count = fields, .step_count = steps, .group_count = groups};
    time->fields = calloc(fields, sizeof *time->fields);
    time->ranges = calloc(fields, sizeof *time->ranges);
    time->sizes = calloc((size_t)fields * steps, sizeof *time->sizes);
    time->digests = calloc((size_t)fields * groups, sizeof *time->digests);
    time->ends = calloc((size_t)fields * steps, sizeof *time->ends);
    return time->fields && time->ranges && time->sizes && time->digests && time->ends;
}

void tetlodi_cell_time_fini(struct tetlodi_cell_time *time)
{
    free(time->fields);
    free(time->ranges);
    free(time->sizes);
    free(time->digests);
    free(time->ends);
    *time = (struct tetlodi_cell_time){0};
}

uint64_t tetlodi_cell_time_before(const struct tetlodi_cell_time *time, uint32_t field, uint32_t step)
{
    step = step < time->step_count ? step : time->step_count;
    return step ? time->ends[(size_t)field * time->step_count + step - 1] : 0;
}

void tetlodi_cell_time_encode(const struct tetlodi_cell_time *time, struct tetlodi_buffer *out)
{
    tetlodi_put(out, time->field_count, 4);
    tetlodi_put(out, time->step_count, 4);
    for (uint32_t f = 0; f < time->field_count; f++) {
        tetlodi_put(out, time->fields[f], 8);
        tetlodi_put_f64(out, time->ranges[f][0]);
        tetlodi_put_f64(out, time->ranges[f][1]);
    }
    for (size_t i = 0; i < (size_t)time->field_count * time->step_count; i++)
        tetlodi_put(out, time->sizes[i], 8);
    tetlodi_put_block(out, time->digests, (size_t)time->field_count * time->group_count * DIGEST_SIZE);
}

/* Bytes that a table of these counts has; UINT64_MAX beyond the limits. */
static uint64_t table_size(uint64_t fields, uint64_t steps)
{
    if (!fields || fields > MAX_FIELDS || !steps || steps > MAX_STEPS)
        return UINT64_MAX;
    return TABLE_HEAD + fields * (FIELD_ROW + 8 * steps + DIGEST_SIZE * ((steps + STEP_GROUP - 1) / STEP_GROUP));
}

static bool decode_rows(struct tetlodi_cell_time *time, struct tetlodi_bytes *in)
{
    bool good = true;
    uint64_t end = 0;
    for (uint32_t f = 0; f < time->field_count; f++) {
        uint64_t field = tetlodi_get(in, 8);
        double *range = time->ranges[f];
        range[0] = tetlodi_get_f64(in);
        range[1] = tetlodi_get_f64(in);
        good &= field < MAX_FIELDS && (f == 0 || field > time->fields[f - 1]);
        good &= isfinite(range[0]) && isfinite(range[1]) && range[0] <= range[1];
        time->fields[f] = (uint32_t)(field % MAX_FIELDS);
    }
    for (size_t i = 0; i < (size_t)time->field_count * time->step_count; i++) {
        time->sizes[i] = tetlodi_get(in, 8);
        good &= time->sizes[i] <= MAX_CELL_FRAME && (i % time->step_count || !time->sizes[i]);
        end = (i % time->step_count ? end : 0) + time->sizes[i] % (MAX_CELL_FRAME + 1);
        time->ends[i] = end;
    }
    size_t size = (size_t)time->field_count * time->group_count * DIGEST_SIZE;
    const uint8_t *digests = tetlodi_get_block(in, size);
    if (digests)
        memcpy(time->digests, digests, size);
    return good && digests;
}

enum tetlod_status tetlodi_cell_time_decode(struct tetlodi_cell_time *time, const uint8_t *bytes, size_t size,
                                            struct tetlod_error *error)
{
    struct tetlodi_bytes in = {bytes, size, false};
    uint32_t fields = (uint32_t)tetlodi_get(&in, 4), steps = (uint32_t)tetlodi_get(&in, 4);
    bool good = !in.failed && table_size(fields, steps) == size;
    *time = (struct tetlodi_cell_time){0};
    if (good && !tetlodi_cell_time_allocate(time, fields, steps))
        return tetlodi_fail_nomem(error, "the table of steps", size);
    if (good && decode_rows(time, &in))
        return TETLOD_OK;
    return tetlodi_fail(error, TETLOD_ERR_STREAM, "the table of steps in time is damaged");
}

/* ---- codes */

static bool is_float(enum tetlod_cell_type type)
{
    return type <= TETLOD_CELL_FLOAT64;
}

static enum tetlod_type float_type(enum tetlod_cell_type type)
{
    return type == TETLOD_CELL_FLOAT32 ? TETLOD_FLOAT32 : TETLOD_FLOAT64;
}

double tetlodi_cell_value(enum tetlod_cell_type type, double quantum, double code)
{
    return tetlodi_round(float_type(type), quantum * code);
}

static int64_t code_of(enum tetlod_cell_type type, double value)
{
    return is_float(type) ? float_code(float_type(type), value) : (int64_t)value;
}

/* Any float will do, NaN too; a whole number must be one of the type. */
static struct tetlodi_step_rows rows_of(enum tetlod_cell_type type, size_t count)
{
    unsigned bits = 8 * cell_width(type);
    int64_t most =
        type == TETLOD_CELL_INT64 ? INT64_C(1) << 53 : (INT64_C(1) << (bits - 2)) - 1 + (INT64_C(1) << (bits - 2));
    int64_t least = type == TETLOD_CELL_INT64 ? -most : -1 - most;
    return (struct tetlodi_step_rows){count, type == TETLOD_CELL_FLOAT32 ? 32u : 64u, least, most};
}

bool tetlodi_cell_steps_start(struct tetlodi_steps *steps, enum tetlod_cell_type type, uint32_t components, size_t rows,
                              const double *values)
{
    struct tetlodi_memory memory = {.most = UINT64_MAX};
    struct tetlodi_step_rows as = rows_of(type, rows);
    if (!steps->codes && !tetlodi_steps_init_rows(steps, &as, components, &memory))
        return false;
    for (size_t row = 0; row < rows; row++)
        for (size_t c = 0; c < components; c++)
            steps->codes[c * rows + row] = code_of(type, values[row * components + c]);
    tetlodi_steps_start(steps);
    return true;
}

void tetlodi_cell_steps_values(const struct tetlodi_steps *steps, enum tetlod_cell_type type, double *out)
{
    for (size_t row = 0; row < steps->rows.count; row++)
        for (size_t c = 0; c < steps->components; c++) {
            int64_t code = steps->codes[c * steps->rows.count + row];
            out[row * steps->components + c] = is_float(type) ? float_value(float_type(type), code) : (double)code;
        }
}

size_t tetlodi_cell_steps_encode(struct tetlodi_steps *steps, enum tetlod_cell_type type, const double *values,
                                 struct tetlodi_buffer *out)
{
    size_t rows = steps->rows.count, n = steps->components, size = 0;
    int64_t *allowed = malloc((2 * rows * n + 1) * sizeof *allowed);
    bool same = true;
    for (size_t i = 0; i < rows * n && allowed; i++) {
        allowed[2 * i] = allowed[2 * i + 1] = code_of(type, values[i % rows * n + i / rows]);
        same &= allowed[2 * i] == steps->codes[i];
    }
    out->failed |= !allowed;
    if (allowed && !same) {
        size = tetlodi_steps_encode(steps, allowed, out);
        for (; !out->failed && !size; size++)
            tetlodi_put(out, 0, 1); // a frame without bytes would be the step before
    }
    free(allowed);
    return size;
}
