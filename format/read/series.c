/* SPDX-License-Identifier: BSD-3-Clause */
#include "format/coding/step_code.h"

#include <stdlib.h>

#include "format/coding/time_table.h"
#include "format/common/round.h"
#include "format/fail.h"
#include "format/read/parts.h"
#include "format/read/series_cells.h"

/* A field's part of the current band. */
struct track {
    struct tetlodi_steps steps;
    uint8_t *bytes; /* of the group */
    uint64_t at, size;
    double *values; /* [components * vertices] */
};

struct tetlod_series {
    const struct tetlod_file *file;
    struct tetlod_series_info info;
    struct tetlodi_time time;
    uint32_t *fields;
    double (*ranges)[2];
    enum tetlod_type *types;
    const struct tetlodi_section **sections; /* [field][band] */
    struct tetlodi_memory memory;            /* of the current band */
    uint32_t band, group, next;              /* TETLOD_NONE: none; next: the step that its tracks would decode */
    struct tetlodi_lower lower;
    struct track *tracks; /* [field] */
    bool *chosen;         /* [field] to be decoded */
    struct tetlodi_series_cells cells;
    int ready;            /* the tracks' values are there */
};

static uint32_t components_of(const struct tetlod_series *series, uint32_t field)
{
    return series->file->index.info.fields[series->fields[field]].components;
}

static void drop_band(struct tetlod_series *series)
{
    for (uint32_t f = 0; f < series->time.field_count && series->tracks; f++) {
        tetlodi_steps_fini(&series->tracks[f].steps);
        free(series->tracks[f].bytes);
        free(series->tracks[f].values);
        series->tracks[f] = (struct track){0};
    }
    tetlodi_lower_fini(&series->lower);
    series->memory = (struct tetlodi_memory){.most = tetlodi_memory_limit(series->file)};
    series->band = series->group = TETLOD_NONE;
    series->ready = 0;
}

void tetlod_series_free(struct tetlod_series *series)
{
    if (!series)
        return;
    drop_band(series);
    tetlodi_series_cells_fini(&series->cells);
    tetlodi_time_fini(&series->time);
    free(series->fields);
    free(series->ranges);
    free(series->types);
    free(series->sections);
    free(series->tracks);
    free(series->chosen);
    free(series);
}

/* ---- the table */

static enum tetlod_status read_table(struct tetlod_series *series, struct tetlod_error *error)
{
    const struct tetlodi_index *index = &series->file->index;
    const struct tetlodi_section *section = tetlodi_section_find(index->sections, index->info.section_count, TAG_TIME);
    uint8_t *bytes;
    if (!section)
        return tetlodi_fail(error, TETLOD_ERR_ARGUMENT, "it is no series: it has one moment only");
    TETLOD_TRY(tetlodi_read_section(series->file, section, &bytes, error));
    enum tetlod_status status = tetlodi_time_decode(&series->time, bytes, (size_t)section->plain, error);
    free(bytes);
    return status;
}

static enum tetlod_status mismatch(struct tetlod_error *error)
{
    return tetlodi_fail(error, TETLOD_ERR_STREAM, "the table of steps does not go with the stream");
}

/* Values of error 0 are the original's: they lie at a level that has its mesh. */
static bool has_exact_bands_at_the_end(const struct tetlodi_time *time, const struct tetlod_info *info)
{
    for (uint32_t b = 0; b < time->band_count; b++) {
        const struct tetlod_level *level = &info->levels[time->bands[b].level];
        if (!(time->bands[b].error > 0) && (level->vertices != info->vertices || level->tets != info->tets))
            return false;
    }
    return true;
}

/* In a topology group the steps are those that the table of groups has. */
static bool has_steps_of_group(const struct tetlod_file *file, const struct tetlodi_time *time)
{
    const struct tetlod_topology *first = file->index.topologies;
    const struct tetlodi_part *part = file->part && file->part->step_count ? file->part : NULL;
    const double *times = part ? part->times : first ? first->times : time->times;
    if (time->step_count != (part ? part->step_count : first ? first->step_count : time->step_count))
        return false;
    for (uint32_t s = 0; s < time->step_count; s++)
        if (time->times[s] < times[s] || time->times[s] > times[s])
            return false;
    return true;
}

/* Decoding all steps takes no longer than goes with their bytes. */
static bool has_bytes_for_steps(const struct tetlodi_time *time, const struct tetlodi_index *index)
{
    uint64_t rows = 0, bytes = 0;
    for (uint32_t f = 0; f < time->field_count; f++)
        for (uint32_t b = 0; b < time->band_count; b++) {
            uint64_t offset, size;
            tetlodi_time_place(time, f, b, time->group_count - 1, &offset, &size);
            bytes += offset + size;
            rows += tetlodi_step_rows(index, time->fields[f].field, time->bands[b].level) * time->step_count;
            if (rows > UINT64_MAX / 2)
                return false;
        }
    return tetlodi_steps_hold(rows, bytes);
}

/* The table's fields and levels are the stream's, and its rows fill their sections. */
static enum tetlod_status check_table(struct tetlod_series *series, struct tetlod_error *error)
{
    const struct tetlodi_index *index = &series->file->index;
    const struct tetlodi_time *time = &series->time;
    uint32_t rows = time->field_count * time->band_count, row = 0;
    for (uint32_t f = 0; f < time->field_count; f++)
        if (time->fields[f].field >= index->info.field_count)
            return mismatch(error);
    if (time->bands[time->band_count - 1].level >= index->info.level_count ||
        (time->displacement && index->info.fields[time->fields[time->displacement - 1].field].components != 3) ||
        !has_exact_bands_at_the_end(time, &index->info) || !has_steps_of_group(series->file, time))
        return mismatch(error);
    for (uint32_t i = 0; i < index->info.section_count; i++) {
        uint64_t offset, size;
        if (strcmp(index->sections[i].tag, TAG_STEP_VALUES) != 0)
            continue;
        if (row == rows || index->sections[i].flags & SECTION_PACKED)
            return mismatch(error);
        tetlodi_time_place(time, row / time->band_count, row % time->band_count, time->group_count - 1, &offset, &size);
        if (offset + size != index->sections[i].frame.size)
            return mismatch(error);
        series->sections[row++] = &index->sections[i];
    }
    if (row != rows)
        return mismatch(error);
    return has_bytes_for_steps(time, index) ? TETLOD_OK : tetlodi_fail(error, TETLOD_ERR_STREAM,
                                                                       "it has more steps than their bytes can hold");
}

static enum tetlod_status open_series(struct tetlod_series *series, struct tetlod_error *error)
{
    TETLOD_TRY(read_table(series, error));
    const struct tetlodi_time *time = &series->time;
    series->fields = malloc(time->field_count * sizeof *series->fields);
    series->ranges = malloc(time->field_count * sizeof *series->ranges);
    series->types = malloc(time->field_count * sizeof *series->types);
    series->sections = calloc((size_t)time->field_count * time->band_count, sizeof *series->sections);
    series->tracks = calloc(time->field_count, sizeof *series->tracks);
    series->chosen = malloc(time->field_count * sizeof *series->chosen);
    if (!series->fields || !series->ranges || !series->types || !series->sections || !series->tracks ||
        !series->chosen)
        return tetlodi_fail_nomem(error, "the steps", time->field_count * sizeof *series->tracks);
    tetlod_series_select(series, NULL, 0);
    for (uint32_t f = 0; f < time->field_count; f++) {
        series->fields[f] = time->fields[f].field;
        series->types[f] = time->fields[f].type;
        memcpy(series->ranges[f], time->fields[f].range, sizeof *series->ranges);
    }
    series->info =
        (struct tetlod_series_info){.step_count = time->step_count,
                                    .band_count = time->band_count,
                                    .field_count = time->field_count,
                                    .displacement = time->displacement ? time->displacement - 1 : TETLOD_NONE,
                                    .times = time->times,
                                    .bands = time->bands,
                                    .fields = series->fields,
                                    .ranges = (const double(*)[2])series->ranges,
                                    .types = series->types};
    TETLOD_TRY(check_table(series, error));
    TETLOD_TRY(tetlodi_series_cells_open(&series->cells, series->file, time->step_count, error));
    series->info.cell_field_count = series->cells.time.field_count;
    series->info.cell_fields = series->cells.time.fields;
    series->info.cell_ranges = (const double(*)[2])series->cells.time.ranges;
    return TETLOD_OK;
}

enum tetlod_status tetlod_series_new(struct tetlod_series **out, const struct tetlod_file *file,
                                     struct tetlod_error *error)
{
    struct tetlod_series *series = calloc(1, sizeof *series);
    *out = NULL;
    if (!series)
        return tetlodi_fail_nomem(error, "the series", sizeof *series);
    series->file = file;
    drop_band(series);
    enum tetlod_status status = open_series(series, error);
    if (status == TETLOD_OK)
        *out = series;
    else
        tetlod_series_free(series);
    return status;
}

void tetlod_series_select(struct tetlod_series *series, const uint32_t *fields, uint32_t count)
{
    for (uint32_t f = 0; f < series->time.field_count; f++) {
        series->chosen[f] = !fields || series->time.displacement == f + 1;
        for (uint32_t i = 0; i < count && fields; i++)
            series->chosen[f] |= fields[i] == f;
    }
    drop_band(series);
}

/* ---- what there is */

const struct tetlod_series_info *tetlod_series_info(const struct tetlod_series *series)
{
    return &series->info;
}

uint32_t tetlod_band_for_error(const struct tetlod_series_info *info, double error)
{
    for (uint32_t b = 0; b < info->band_count; b++)
        if (info->bands[b].error <= error)
            return b;
    return TETLOD_NONE;
}

uint32_t tetlod_band_for_abs_error(const struct tetlod_series_info *info, double error)
{
    double least = INFINITY; // of the fractions; a field without a range has no error
    for (uint32_t f = 0; f < info->field_count; f++) {
        double width = info->ranges[f][1] - info->ranges[f][0];
        least = width > 0 ? fmin(least, error / width) : least;
    }
    return tetlod_band_for_error(info, least);
}

uint32_t tetlod_step_for_time(const struct tetlod_series_info *info, double time)
{
    uint32_t best = 0;
    for (uint32_t s = 1; s < info->step_count; s++)
        if (fabs(info->times[s] - time) < fabs(info->times[best] - time))
            best = s;
    return best;
}

static int is_there(const struct tetlod_series *series, uint32_t field, uint32_t band, uint32_t step)
{
    return field < series->time.field_count && band < series->time.band_count && step < series->time.step_count;
}

double tetlod_step_error(const struct tetlod_series *series, uint32_t field, uint32_t band, uint32_t step)
{
    if (!is_there(series, field, band, step))
        return NAN;
    double stored = (double)time_entries(&series->time, field, band)[step].error;
    return fmin(stored, series->time.bands[band].error);
}

static int step_is_within(const struct tetlod_series *series, uint32_t band, uint32_t step, double error, int absolute)
{
    for (uint32_t f = 0; f < series->time.field_count; f++) {
        const double *range = series->time.fields[f].range;
        double width = absolute ? range[1] - range[0] : 1;
        if (width > 0 && !(tetlod_step_error(series, f, band, step) * width <= error))
            return 0;
    }
    return step < series->time.step_count;
}

static uint32_t band_for_step(const struct tetlod_series *series, uint32_t step, double error, int absolute)
{
    for (uint32_t b = 0; b < series->time.band_count; b++)
        if (step_is_within(series, b, step, error, absolute))
            return b;
    return TETLOD_NONE;
}

uint32_t tetlod_band_for_step(const struct tetlod_series *series, uint32_t step, double error)
{
    return band_for_step(series, step, error, 0);
}

uint32_t tetlod_band_for_step_abs(const struct tetlod_series *series, uint32_t step, double error)
{
    return band_for_step(series, step, error, 1);
}

/* Of a group that there is. */
static struct tetlod_span group_span(const struct tetlod_series *series, uint32_t field, uint32_t band, uint32_t group)
{
    struct tetlod_span span;
    tetlodi_time_place(&series->time, field, band, group, &span.offset, &span.size);
    const struct tetlodi_section *section = series->sections[time_row(&series->time, field, band)];
    span.offset += series->file->index.info.sections[section - series->file->index.sections].offset;
    return span;
}

struct tetlod_span tetlod_step_span(const struct tetlod_series *series, uint32_t field, uint32_t band, uint32_t step)
{
    if (!is_there(series, field, band, step))
        return (struct tetlod_span){0, 0};
    return group_span(series, field, band, step / STEP_GROUP);
}

size_t tetlodi_series_parts(const struct tetlod_series *series, struct tetlodi_frame *out)
{
    const struct tetlodi_time *time = &series->time;
    size_t count = 0;
    for (size_t row = 0; row < (size_t)time->field_count * time->band_count; row++)
        for (uint32_t group = 0; group < time->group_count; group++) {
            uint64_t offset, size;
            tetlodi_time_place(time, (uint32_t)(row / time->band_count), (uint32_t)(row % time->band_count), group,
                               &offset, &size);
            if (!size)
                continue;
            if (out) {
                out[count] = (struct tetlodi_frame){series->sections[row]->frame.offset + offset, size, {0}};
                memcpy(out[count].digest, time->digests[row * time->group_count + group], DIGEST_SIZE);
            }
            count++;
        }
    return count + tetlodi_series_cells_parts(&series->cells, out ? out + count : NULL);
}

/* ---- values */

static enum tetlod_status no_room(const struct tetlod_series *series, struct tetlod_error *error)
{
    return tetlodi_no_room(&series->memory, error);
}

static enum tetlod_status open_band(struct tetlod_series *series, const uint32_t *corners, uint32_t band,
                                    struct tetlod_error *error)
{
    const struct tetlod_level *level = &series->file->index.info.levels[series->time.bands[band].level];
    drop_band(series);
    if (!tetlodi_lower_init(&series->lower, corners, (uint32_t)level->tets, (uint32_t)level->vertices, &series->memory))
        return no_room(series, error);
    for (uint32_t f = 0; f < series->time.field_count; f++) {
        if (!series->chosen[f])
            continue;
        struct track *track = &series->tracks[f];
        struct tetlodi_step_scale scale = {series->time.fields[f].type,
                                           series->time.quanta[(size_t)band * series->time.field_count + f]};
        size_t room = 0;
        if (!tetlodi_steps_init(&track->steps, &series->lower, &scale, components_of(series, f), &series->memory) ||
            !TETLODI_ROOM(&series->memory, track->values, room, (size_t)level->vertices * components_of(series, f) + 1))
            return no_room(series, error);
    }
    series->band = band;
    return TETLOD_OK;
}

static enum tetlod_status read_group(struct tetlod_series *series, uint32_t field, uint32_t group,
                                     struct tetlod_error *error)
{
    struct track *track = &series->tracks[field];
    struct tetlod_span span = group_span(series, field, series->band, group);
    size_t row = time_row(&series->time, field, series->band);
    struct tetlodi_frame frame = {span.offset, span.size, {0}};
    memcpy(frame.digest, series->time.digests[row * series->time.group_count + group], DIGEST_SIZE);
    free(track->bytes);
    track->bytes = NULL;
    TETLOD_TRY(tetlodi_read_part(series->file, &frame, GROUP_OF_STEPS, &track->bytes, error));
    track->at = 0;
    track->size = span.size;
    tetlodi_steps_start(&track->steps);
    return TETLOD_OK;
}

static enum tetlod_status open_group(struct tetlod_series *series, uint32_t group, struct tetlod_error *error)
{
    series->group = TETLOD_NONE;
    for (uint32_t f = 0; f < series->time.field_count; f++)
        if (series->chosen[f])
            TETLOD_TRY(read_group(series, f, group, error));
    series->group = group;
    series->next = group * STEP_GROUP;
    return TETLOD_OK;
}

static enum tetlod_status decode_next(struct tetlod_series *series, struct tetlod_error *error)
{
    for (uint32_t f = 0; f < series->time.field_count; f++) {
        struct track *track = &series->tracks[f];
        uint32_t size = time_entries(&series->time, f, series->band)[series->next].size;
        if (series->chosen[f] && !tetlodi_steps_decode(&track->steps, track->bytes + track->at, size)) {
            series->group = TETLOD_NONE;
            return tetlodi_fail(error, TETLOD_ERR_STREAM, "step %u is damaged", series->next);
        }
        track->at += size;
    }
    series->next++;
    return TETLOD_OK;
}

static void set_values(struct tetlod_series *series)
{
    size_t n = series->lower.vertices;
    for (uint32_t f = 0; f < series->time.field_count; f++) {
        struct track *track = &series->tracks[f];
        size_t k = track->steps.components; // 0: not chosen
        for (size_t c = 0; c < k; c++)
            for (size_t v = 0; v < n; v++)
                track->values[v * k + c] = tetlodi_step_value(&track->steps.scale, track->steps.codes[c * n + v]);
    }
    series->ready = 1;
}

enum tetlod_status tetlod_series_decode(struct tetlod_series *series, const uint32_t *corners, uint32_t band,
                                        uint32_t step,
                                        struct tetlod_error *error)
{
    uint32_t group = step / STEP_GROUP;
    series->ready = 0;
    if (!is_there(series, 0, band, step))
        return tetlodi_fail(error, TETLOD_ERR_ARGUMENT, "there is no step %u in band %u", step, band);
    if (series->band != band)
        TETLOD_TRY(open_band(series, corners, band, error));
    if (series->group != group || step + 1 < series->next)
        TETLOD_TRY(open_group(series, group, error));
    while (series->next <= step)
        TETLOD_TRY(decode_next(series, error));
    set_values(series);
    return TETLOD_OK;
}

enum tetlod_status tetlod_seek_step(struct tetlod_series *series, struct tetlod_cursor *cursor, uint32_t band,
                                    uint32_t step,
                                    struct tetlod_error *error)
{
    struct tetlod_mesh mesh;
    if (is_there(series, 0, band, step))
        TETLOD_TRY(tetlod_cursor_seek(cursor, series->time.bands[band].level, error));
    tetlod_cursor_mesh(cursor, &mesh);
    return tetlod_series_decode(series, mesh.corners, band, step, error);
}

const double *tetlod_step_values(const struct tetlod_series *series, uint32_t field)
{
    return series->ready && field < series->time.field_count ? series->tracks[field].values : NULL;
}

enum tetlod_status tetlod_step_move(const struct tetlod_series *series, double *positions, struct tetlod_error *error)
{
    enum tetlod_type type = series->file->index.info.position_type;
    bool finite = true;
    const double *by = series->time.displacement ? tetlod_step_values(series, series->time.displacement - 1) : NULL;
    for (size_t i = 0; by && i < 3 * (size_t)series->lower.vertices; i++) {
        positions[i] = tetlodi_round(type, positions[i] + by[i]);
        finite &= isfinite(positions[i]) != 0;
    }
    return finite ? TETLOD_OK : tetlodi_fail(error, TETLOD_ERR_STREAM, "a step moves a point out of all numbers");
}

/* ---- values of cells */

int tetlod_has_step_cells(const struct tetlod_series *series, uint32_t field, uint32_t step)
{
    return field < series->file->index.info.cell_field_count && step < series->time.step_count &&
           (step == 0 || tetlodi_series_cells_find(&series->cells, field) != TETLOD_NONE);
}

struct tetlod_span tetlod_step_cells_span(const struct tetlod_series *series, uint32_t field, uint32_t step)
{
    uint32_t row = tetlodi_series_cells_find(&series->cells, field);
    if (step == 0 || step >= series->time.step_count || row == TETLOD_NONE)
        return (struct tetlod_span){0, 0};
    return tetlodi_series_cells_span(&series->cells, row, step / STEP_GROUP);
}

enum tetlod_status tetlod_step_cells(struct tetlod_series *series, uint32_t field, uint32_t step, double *out,
                                     struct tetlod_error *error)
{
    if (!tetlod_has_step_cells(series, field, step))
        return tetlodi_fail(error, TETLOD_ERR_ARGUMENT, "there is no cell field number %u at step %u", field, step);
    if (step == 0)
        return tetlod_cells(series->file, field, out, error);
    return tetlodi_series_cells_decode(&series->cells, tetlodi_series_cells_find(&series->cells, field), step, out,
                                       error);
}
