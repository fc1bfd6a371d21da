/* SPDX-License-Identifier: BSD-3-Clause */
#include "format/coding/time_table.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "format/fail.h"

enum { TIME_HEAD = 16, FIELD_ROW = 24, BAND_ROW = 16, NUMBER = 8 };

int tetlodi_time_allocate(struct tetlodi_time *time, uint32_t fields, uint32_t bands, uint32_t steps)
{
    size_t rows = (size_t)fields * bands;
    *time = (struct tetlodi_time){.field_count = fields, .band_count = bands, .step_count = steps,
                                  .group_count = (steps + STEP_GROUP - 1) / STEP_GROUP};
    time->fields = calloc(fields + 1, sizeof *time->fields);
    time->bands = calloc(bands + 1, sizeof *time->bands);
    time->quanta = calloc(rows + 1, sizeof *time->quanta);
    time->times = calloc(steps + 1, sizeof *time->times);
    time->entries = calloc(rows * steps + 1, sizeof *time->entries);
    time->digests = calloc(rows * time->group_count + 1, sizeof *time->digests);
    time->ends = calloc(rows * time->group_count + 1, sizeof *time->ends);
    return time->fields && time->bands && time->quanta && time->times && time->entries && time->digests && time->ends;
}

void tetlodi_time_fini(struct tetlodi_time *time)
{
    free(time->fields);
    free(time->bands);
    free(time->quanta);
    free(time->times);
    free(time->entries);
    free(time->digests);
    free(time->ends);
    *time = (struct tetlodi_time){0};
}

void tetlodi_time_place(const struct tetlodi_time *time, uint32_t field, uint32_t band, uint32_t group,
                        uint64_t *offset, uint64_t *size)
{
    const uint64_t *ends = time->ends + time_row(time, field, band) * time->group_count;
    *offset = group ? ends[group - 1] : 0;
    *size = ends[group] - *offset;
}

static void add_sizes(struct tetlodi_time *time)
{
    for (size_t row = 0; row < (size_t)time->field_count * time->band_count; row++) {
        uint64_t end = 0;
        for (uint32_t step = 0; step < time->step_count; step++) {
            end += time->entries[row * time->step_count + step].size;
            time->ends[row * time->group_count + step / STEP_GROUP] = end;
        }
    }
}

/* ---- bytes: every part has a multiple of 8 of them, so that columns stay columns when the section is packed */

static void put_f32(struct tetlodi_buffer *out, float value)
{
    uint32_t bits;
    memcpy(&bits, &value, sizeof bits);
    tetlodi_put(out, bits, 4);
}

static float get_f32(struct tetlodi_bytes *in)
{
    uint32_t bits = (uint32_t)tetlodi_get(in, 4);
    float value;
    memcpy(&value, &bits, sizeof value);
    return value;
}

void tetlodi_time_encode(const struct tetlodi_time *time, struct tetlodi_buffer *out)
{
    size_t rows = (size_t)time->field_count * time->band_count;
    tetlodi_put(out, time->field_count, 4);
    tetlodi_put(out, time->band_count, 4);
    tetlodi_put(out, time->step_count, 4);
    tetlodi_put(out, time->displacement, 4);
    for (uint32_t f = 0; f < time->field_count; f++) {
        tetlodi_put(out, time->fields[f].field, 4);
        tetlodi_put(out, time->fields[f].type, 4);
        tetlodi_put_f64(out, time->fields[f].range[0]);
        tetlodi_put_f64(out, time->fields[f].range[1]);
    }
    for (uint32_t b = 0; b < time->band_count; b++) {
        tetlodi_put_f64(out, time->bands[b].error);
        tetlodi_put(out, time->bands[b].level, 8);
    }
    for (size_t i = 0; i < rows; i++)
        tetlodi_put_f64(out, time->quanta[i]);
    for (uint32_t s = 0; s < time->step_count; s++)
        tetlodi_put_f64(out, time->times[s]);
    for (size_t i = 0; i < rows * time->step_count; i++) {
        tetlodi_put(out, time->entries[i].size, 4);
        put_f32(out, time->entries[i].error);
    }
    tetlodi_put_block(out, time->digests, rows * time->group_count * DIGEST_SIZE);
}

/* Bytes that a table of these counts has; UINT64_MAX beyond the limits. */
static uint64_t table_size(uint64_t fields, uint64_t bands, uint64_t steps)
{
    if (!fields || fields > 256 || !bands || bands > MAX_BANDS || !steps || steps > MAX_STEPS)
        return UINT64_MAX;
    uint64_t groups = (steps + STEP_GROUP - 1) / STEP_GROUP, rows = fields * bands;
    return TIME_HEAD + fields * FIELD_ROW + bands * BAND_ROW + NUMBER * (rows + steps + rows *
                                                                         steps) + DIGEST_SIZE * rows * groups;
}

static int decode_field(struct tetlodi_time_field *field, struct tetlodi_bytes *in)
{
    field->field = (uint32_t)tetlodi_get(in, 4);
    uint64_t type = tetlodi_get(in, 4);
    field->type = type == TETLOD_FLOAT64 ? TETLOD_FLOAT64 : TETLOD_FLOAT32;
    field->range[0] = tetlodi_get_f64(in);
    field->range[1] = tetlodi_get_f64(in);
    return type <= TETLOD_FLOAT64 && isfinite(field->range[0]) && isfinite(field->range[1]) &&
           field->range[0] <= field->range[1];
}

/* Errors fall from band to band, and levels do not. */
static int decode_band(struct tetlodi_time *time, uint32_t b, struct tetlodi_bytes *in)
{
    struct tetlod_band *band = &time->bands[b];
    band->error = tetlodi_get_f64(in);
    uint64_t level = tetlodi_get(in, 8);
    band->level = (uint32_t)level;
    return band->error >= 0 && isfinite(band->error) && level < UINT32_MAX &&
           (b == 0 || (band->error < band[-1].error && band->level >= band[-1].level));
}

static int decode_rows(struct tetlodi_time *time, struct tetlodi_bytes *in)
{
    size_t rows = (size_t)time->field_count * time->band_count;
    int good = 1;
    for (size_t i = 0; i < rows; i++) {
        time->quanta[i] = tetlodi_get_f64(in);
        good &= time->quanta[i] >= 0 && time->quanta[i] <= 0x1p900; // 2^30 of them are finite
    }
    for (uint32_t s = 0; s < time->step_count; s++) {
        time->times[s] = tetlodi_get_f64(in);
        good &= isfinite(time->times[s]) && (s == 0 || time->times[s] >= time->times[s - 1]);
    }
    for (size_t i = 0; i < rows * time->step_count; i++) {
        time->entries[i].size = (uint32_t)tetlodi_get(in, 4);
        time->entries[i].error = get_f32(in);
        good &= time->entries[i].error >= 0 && isfinite(time->entries[i].error);
    }
    add_sizes(time);
    const uint8_t *digests = tetlodi_get_block(in, rows * time->group_count * DIGEST_SIZE);
    if (digests)
        memcpy(time->digests, digests, rows * time->group_count * DIGEST_SIZE);
    return good && digests;
}

enum tetlod_status tetlodi_time_decode(struct tetlodi_time *time, const uint8_t *bytes, size_t size,
                                       struct tetlod_error *error)
{
    struct tetlodi_bytes in = {bytes, size, false};
    uint32_t fields = (uint32_t)tetlodi_get(&in, 4), bands = (uint32_t)tetlodi_get(&in, 4),
             steps = (uint32_t)tetlodi_get(&in, 4);
    uint32_t displacement = (uint32_t)tetlodi_get(&in, 4);
    int good = !in.failed && displacement <= fields && table_size(fields, bands, steps) == size;
    *time = (struct tetlodi_time){0};
    if (good && !tetlodi_time_allocate(time, fields, bands, steps))
        return tetlodi_fail_nomem(error, "the table of steps", size);
    time->displacement = displacement;
    for (uint32_t f = 0; f < fields && good; f++) {
        good = decode_field(&time->fields[f], &in);
        for (uint32_t g = 0; g < f; g++)
            good &= time->fields[g].field != time->fields[f].field;
    }
    for (uint32_t b = 0; b < bands && good; b++)
        good = decode_band(time, b, &in);
    if (good && decode_rows(time, &in))
        return TETLOD_OK;
    return tetlodi_fail(error, TETLOD_ERR_STREAM, "the table of steps in time is damaged");
}
