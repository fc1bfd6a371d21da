/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * In batches of whole groups the steps are retraced. At the mark of each band the living nodes have L and U of every
 * step: the values that are stored lie where both are within the band's error, on the band's grid, and cost least to
 * tell (format/coding/step_code.h). Frames wait in a file for each control and band, so that memory does not grow with
 * the steps.
 */
#include <float.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "format/fail.h"
#include "format/coding/step_code.h"
#include "format/coding/time_table.h"
#include "src/mesh/tet_geom.h"
#include "src/pipeline/build_series.h"
#include "src/pipeline/series_parts.h"
#include "src/util/array.h"

/* Codes up to this size are exact in float32, times a power of two. */
static const double FLOAT32_CODES = 0x1p24;

/* The level of a band in the stream's numbers. */
struct band_level {
    uint32_t vertices, tets;
    uint32_t *nodes; /* [vertex] */
    struct tetlodi_lower lower;
};

struct series_encoding {
    uint32_t band_count, row_count;
    struct tetlodi_time time;
    struct band_level *levels; /* [band] */
    struct spool *spools;      /* [control][band] */
    struct tetlod_source *sources; /* the same, in the end */
    struct tetlodi_buffer table;
    struct series_cells_encoding cells;
    struct tetlodi_write_section *sections;
    uint32_t section_count;
    uint64_t row_total, byte_total; /* of the frames so far: what decoding them counts (SPEC 2.3), and their bytes */
};

/* A batch. */
struct batch {
    struct series_build *series;
    const uint32_t *original_of;
    uint32_t first, count; /* steps */
    struct tetlod_error *error;
};

void series_encoding_free(struct series_encoding *encoding)
{
    if (!encoding)
        return;
    for (uint32_t b = 0; b < encoding->band_count && encoding->levels; b++) {
        free(encoding->levels[b].nodes);
        tetlodi_lower_fini(&encoding->levels[b].lower);
    }
    for (uint32_t i = 0; i < encoding->row_count && encoding->spools; i++)
        spool_close(&encoding->spools[i]);
    tetlodi_time_fini(&encoding->time);
    free(encoding->levels);
    free(encoding->spools);
    free(encoding->sources);
    tetlodi_buffer_fini(&encoding->table);
    series_cells_encoding_fini(&encoding->cells);
    free(encoding->sections);
    free(encoding);
}

/* ---- levels */

/* Of each node the ancestor that lives after so many contractions. */
static uint32_t *find_ancestors(const struct contraction_log *log, uint32_t contractions)
{
    uint32_t n = log->vertex_count, *ancestor = array_new((size_t)n + contractions, sizeof *ancestor);
    for (uint32_t node = 0; ancestor && node < n + contractions; node++)
        ancestor[node] = node;
    for (uint32_t c = contractions; ancestor && c-- > 0;)
        for (int i = 0; i < 4 && log->children[4 * (size_t)c + (size_t)i] != TETLOD_NONE; i++)
            ancestor[log->children[4 * (size_t)c + (size_t)i]] = ancestor[n + c];
    return ancestor;
}

/* The level's tetrahedra: those of the original whose corners have four different ancestors. Returns how many. */
static size_t level_corners(const struct tetmesh *mesh, const uint32_t *number_of, const uint32_t *ancestor,
                            uint32_t *out)
{
    size_t count = 0;
    for (size_t t = 0; t < mesh->tet_count; t++) {
        uint32_t *c = out + 4 * count;
        for (size_t i = 0; i < 4; i++)
            c[i] = number_of[ancestor[mesh->corners[4 * t + i]]];
        count += c[0] != c[1] && c[0] != c[2] && c[0] != c[3] && c[1] != c[2] && c[1] != c[3] && c[2] != c[3];
    }
    return count;
}

/* Vertex i of a level is the ancestor of the finest level's vertex i, because a split keeps the number (SPEC 1). */
static enum tetlod_status find_level(struct band_level *level, const struct batch *batch, uint32_t mark)
{
    const struct contraction_log *log = batch->series->log;
    const struct tetmesh *mesh = batch->series->mesh;
    uint32_t contractions = log->marks[mark].contractions;
    uint32_t *ancestor = find_ancestors(log,
                                        contractions), *number_of = array_new((size_t)log->vertex_count + contractions,
                                                                              sizeof *number_of);
    uint32_t *corners = array_new(mesh->tet_count, 4 * sizeof *corners);
    struct tetlodi_memory memory = {.most = UINT64_MAX};
    level->vertices = log->marks[mark].vertices;
    level->nodes = array_new(level->vertices, sizeof *level->nodes);
    bool room = ancestor && number_of && corners && level->nodes;
    for (uint32_t v = 0; v < level->vertices && room; v++) {
        level->nodes[v] = ancestor[batch->original_of[v]];
        number_of[level->nodes[v]] = v;
    }
    level->tets = room ? (uint32_t)level_corners(mesh, number_of, ancestor, corners) : 0;
    room = room && tetlodi_lower_init(&level->lower, corners, level->tets, level->vertices, &memory);
    free(ancestor);
    free(number_of);
    free(corners);
    return room ? TETLOD_OK : tetlodi_fail_nomem(batch->error, "a band's level", 16 * (uint64_t)mesh->tet_count);
}

/* ---- codes that will do */

/* A band of one control, over the batch. */
struct row {
    const struct batch *batch;
    const struct retrace_mark *mark;
    uint32_t control, band;
    uint32_t first;       /* component of the control, among those of all */
    double tolerance;     /* of a value of the current step; 0: exact */
    struct tetlodi_steps steps;
    double *values;       /* the original's, of the current step */
    double (*ranges)[2];  /* [component] of these */
    double (*bounds)[2];  /* [component * vertices + vertex of the level] L and U there */
    int64_t *allowed;
};

/* Its multiples are exact in the type: it has so few bits, or one, that no product has more bits than the type. 0:
 * there is none. */
static double choose_quantum(const double range[2], double tolerance, enum tetlod_type type)
{
    enum { BITS = 5 };
    int exponent;
    if (!(tolerance > 0))
        return 0;
    double part = frexp(tolerance / GRID_STEPS, &exponent), quantum = ldexp(floor(ldexp(part, BITS)), exponent - BITS);
    double size = larger(fabs(range[0]),
                         fabs(range[1])), limit = type == TETLOD_FLOAT32 ? FLOAT32_CODES : (double)MAX_STEP_CODE;
    if (type == TETLOD_FLOAT32 && !(ldexp(size / quantum + 1, BITS) < limit))
        quantum = ldexp(1, exponent - 1);
    bool normal = quantum > (type == TETLOD_FLOAT32 ? 0x1p-120 : 0x1p-1016);
    return normal && size / quantum + 1 < limit ? quantum : 0;
}

/* The least code whose value is at least x. */
static int64_t code_up(const struct tetlodi_step_scale *scale, double x)
{
    if (scale->quantum > 0)
        return (int64_t)ceil(x / scale->quantum);
    int64_t code = float_code(scale->type, x);
    return code + (float_value(scale->type, code) < x);
}

static int64_t code_down(const struct tetlodi_step_scale *scale, double x)
{
    if (scale->quantum > 0)
        return (int64_t)floor(x / scale->quantum);
    int64_t code = float_code(scale->type, x);
    return code - (float_value(scale->type, code) > x);
}

/* Three quarters of the tolerance are for cheap codes at most: values stay near the middle of L and U. */
static void allow(const struct row *row, const double bounds[2], int64_t out[2])
{
    const struct tetlodi_step_scale *scale = &row->steps.scale;
    double least = bounds[0], greatest = bounds[1], middle = least / 2 + greatest / 2, half = 0.75 * row->tolerance;
    if (bounds[0] == bounds[1] && !(row->tolerance > 0)) { // bit for bit, also -0
        out[0] = out[1] = float_code(scale->type, bounds[0]);
        return;
    }
    out[0] = code_up(scale, larger(middle - half, greatest - row->tolerance));
    out[1] = code_down(scale, smaller(middle + half, least + row->tolerance));
    if (out[0] > out[1]) // no code is that near: the nearest to the middle
        out[0] = out[1] =
            scale->quantum > 0 ? (int64_t)floor(middle / scale->quantum + 0.5) : float_code(scale->type, middle);
}

/* How far a value is off at most. */
static double error_of(const double bounds[2], double value)
{
    double error = larger(bounds[1] - value, value - bounds[0]);
    return error > 0 ? error * (1 + 0x1p-50) : 0;
}

/* ---- a group */

static float float_up(double x)
{
    int exponent;
    double mantissa = frexp(x, &exponent);
    return x > 0 ? (float)ldexp(ceil(ldexp(mantissa, 10)), exponent - 10) : 0; // 10 bits: the table is packed
}

/* Where bands count in each step's own range, the table says no more than the band's error in it: the largest float
 * that is no more, as a fraction of the range over all steps. INFINITY: readers take the band's error where it is
 * less. */
static float most_said(const struct series_build *series, uint32_t step, uint32_t control, uint32_t band)
{
    double most = series->input->bands[band] * series_unit(series, step, control) / series_width(series, control);
    float nearest = (float)most;
    if (!series->input->own_ranges || !(nearest > FLT_MIN))
        return INFINITY;
    return (double)nearest > most ? nextafterf(nearest, 0) : nearest;
}

/* What a value may be off, but for rounding of the positions. 0: bit for bit. */
static double tolerance_of(const struct series_build *series, uint32_t step, uint32_t control, uint32_t band)
{
    float most = most_said(series, step, control, band);
    double tolerance = series->input->bands[band] * series_unit(series, step, control);
    if (isfinite(most))
        tolerance = (double)most * series_width(series, control);
    return series_is_within_rounding(series, control, band) ? 0 : tolerance - series_rounding(series, control, band);
}

static void find_component_ranges(struct row *row)
{
    uint32_t k = row->steps.components;
    for (uint32_t c = 0; c < k; c++) {
        double *range = row->ranges[c];
        range[0] = INFINITY;
        range[1] = -INFINITY;
        for (size_t v = 0; v < row->batch->series->mesh->vertex_count; v++) {
            range[0] = smaller(range[0], row->values[v * k + c]);
            range[1] = larger(range[1], row->values[v * k + c]);
        }
    }
}

/* What L and U are at a vertex of the level; at the finest the value itself. A step whose whole range is within the
 * tolerance has that range for L and U everywhere. They are not cut to the range vertex by vertex: between the vertices
 * that would not hold the original. */
static void bounds_at(const struct row *row, uint32_t step, uint32_t component, uint32_t v, double out[2])
{
    const struct series_build *series = row->batch->series;
    const struct band_level *level = &series->encoding->levels[row->band];
    const double *range = row->ranges[component];
    if (series->band_marks[row->band] == 0)
        out[0] = out[1] = row->values[(size_t)level->nodes[v] * row->steps.components + component];
    else if (range[1] - range[0] <= row->tolerance)
        memcpy(out, range, 2 * sizeof *out);
    else
        retrace_bounds(row->mark->state, level->nodes[v],
                       (step - row->batch->first) * series->component_count + row->first + component, out);
}

/* Appends zero bytes to a frame, which change nothing, if all frames so far have fewer bytes than decoding them asks
 * for. Its size. */
static size_t pad_step(const struct row *row, size_t size, struct tetlodi_buffer *group)
{
    struct series_encoding *encoding = row->batch->series->encoding;
    const struct band_level *level = &encoding->levels[row->band];
    encoding->row_total += (level->vertices + (uint64_t)level->tets) * row->steps.components;
    for (; !group->failed && !tetlodi_steps_hold(encoding->row_total, encoding->byte_total + size); size++)
        tetlodi_put(group, 0, 1);
    encoding->byte_total += size;
    return size;
}

/* One step's frame, into the group; its error. */
static enum tetlod_status encode_step(struct row *row, uint32_t step, struct tetlodi_buffer *group)
{
    struct series_build *series = row->batch->series;
    struct series_encoding *encoding = series->encoding;
    uint32_t n = encoding->levels[row->band].vertices, k = row->steps.components;
    double worst = 0, width = series_width(series, row->control), (*bounds)[2] = row->bounds;
    row->tolerance = tolerance_of(series, step, row->control, row->band);
    TETLOD_TRY(series_load(series, step, row->control, row->values, row->batch->error));
    find_component_ranges(row);
    for (uint32_t c = 0; c < k; c++)
        for (uint32_t v = 0; v < n; v++) {
            size_t i = (size_t)c * n + v;
            bounds_at(row, step, c, v, bounds[i]);
            allow(row, bounds[i], row->allowed + 2 * i);
        }
    size_t size = tetlodi_steps_encode(&row->steps, row->allowed, group);
    size = pad_step(row, size, group);
    for (size_t i = 0; i < (size_t)n * k; i++)
        worst = larger(worst, error_of(bounds[i], tetlodi_step_value(&row->steps.scale, row->steps.codes[i])));
    if (worst > row->tolerance * (1 + 1e-9) || size > UINT32_MAX)
        return tetlodi_fail(row->batch->error, TETLOD_ERR_LIMIT, "step %u is off by %g in the band of %g", step, worst,
                            row->tolerance);
    if (row->tolerance > 0)
        worst += series_rounding(series, row->control, row->band); // of the positions that a reader computes
    float error = width > 0 ? float_up(worst / width) : 0;
    time_entries(&encoding->time, row->control, row->band)[step] =
        (struct tetlodi_time_entry){(uint32_t)size, fminf(error, most_said(series, step, row->control, row->band))};
    return group->failed ? tetlodi_fail_nomem(row->batch->error, "a step", size) : TETLOD_OK;
}

static enum tetlod_status encode_group(struct row *row, uint32_t begin, uint32_t end)
{
    struct series_encoding *encoding = row->batch->series->encoding;
    struct tetlodi_buffer group = {0};
    struct spool *spool = &encoding->spools[time_row(&encoding->time, row->control, row->band)];
    enum tetlod_status status = TETLOD_OK;
    tetlodi_steps_start(&row->steps);
    for (uint32_t step = begin; step < end && status == TETLOD_OK; step++)
        status = encode_step(row, step, &group);
    if (status == TETLOD_OK) {
        size_t at = time_row(&encoding->time, row->control,
                             row->band) * encoding->time.group_count + begin / STEP_GROUP;
        tetlodi_digest(group.bytes, group.size, encoding->time.digests[at]);
        status = spool_write(spool, group.bytes, group.size, row->batch->error);
    }
    tetlodi_buffer_fini(&group);
    return status;
}

/* The error of which a grid's step is a part: less where rounding leaves less than half a step beside the level, and a
 * hair less where the table's floats do. */
static double grid_error(const struct series_build *series, uint32_t control, uint32_t band)
{
    double least = INFINITY, rounding = series_rounding(series, control, band);
    for (uint32_t s = 0; s < series->input->step_count; s++)
        least = smaller(least, series_unit(series, s, control));
    least *= series->input->bands[band];
    if (series_is_within_rounding(series, control, band))
        return 0;
    if (series->input->own_ranges)
        least *= 1 - 0x1p-16;
    return larger(least - rounding / HALF_STEP, least / 2);
}

static enum tetlod_status encode_row(const struct batch *batch, const struct retrace_mark *mark, uint32_t control,
                                     uint32_t band)
{
    struct series_build *series = batch->series;
    const struct band_level *level = &series->encoding->levels[band];
    struct row row = {.batch = batch, .mark = mark, .control = control, .band = band};
    struct tetlodi_memory memory = {.most = UINT64_MAX};
    uint32_t k = series_components(series, control);
    struct tetlodi_step_scale scale = {series->input->types[control],
                                       choose_quantum(series->ranges[control], grid_error(series, control, band),
                                                      series->input->types[control])};
    enum tetlod_status status = TETLOD_OK;
    for (uint32_t c = 0; c < control; c++)
        row.first += series_components(series, c);
    series->encoding->time.quanta[(size_t)band * series->options->control_count + control] = scale.quantum;
    row.values = array_new((size_t)series->mesh->vertex_count * k, sizeof *row.values);
    row.ranges = array_new(k, sizeof *row.ranges);
    row.bounds = array_new((size_t)level->vertices * k, sizeof *row.bounds);
    row.allowed = array_new((size_t)level->vertices * k, 2 * sizeof *row.allowed);
    if (!tetlodi_steps_init(&row.steps, &level->lower, &scale, k, &memory) || !row.values || !row.ranges ||
        !row.bounds || !row.allowed)
        TETLOD_TRY_DONE(tetlodi_fail_nomem(batch->error, "a band", (uint64_t)level->vertices * k * 56));
    for (uint32_t at = 0; at < batch->count; at += STEP_GROUP) {
        uint32_t begin = batch->first + at, left = batch->count - at;
        TETLOD_TRY_DONE(encode_group(&row, begin, begin + (left < STEP_GROUP ? left : STEP_GROUP)));
    }
done:
    tetlodi_steps_fini(&row.steps);
    free(row.values);
    free(row.ranges);
    free(row.bounds);
    free(row.allowed);
    return status;
}

static enum tetlod_status encode_mark(void *opaque, const struct retrace_mark *mark)
{
    const struct batch *batch = opaque;
    struct series_build *series = batch->series;
    for (uint32_t b = 0; b < series->input->band_count; b++) {
        struct band_level *level = &series->encoding->levels[b];
        if (series->band_marks[b] != mark->number)
            continue;
        if (!level->nodes)
            TETLOD_TRY(find_level(level, batch, mark->number));
        for (uint32_t c = 0; c < series->options->control_count; c++)
            TETLOD_TRY(encode_row(batch, mark, c, b));
    }
    return TETLOD_OK;
}

/* ---- all of it */

static enum tetlod_status start(struct series_build *series, struct tetlod_error *error)
{
    const struct build_series *input = series->input;
    uint32_t controls = series->options->control_count;
    struct series_encoding *encoding = series->encoding = array_zero(1, sizeof *encoding);
    if (!encoding)
        return tetlodi_fail_nomem(error, "the steps", sizeof *encoding);
    encoding->band_count = input->band_count;
    encoding->row_count = controls * input->band_count;
    encoding->levels = array_zero(encoding->band_count, sizeof *encoding->levels);
    encoding->spools = array_zero(encoding->row_count, sizeof *encoding->spools);
    encoding->sources = array_zero(encoding->row_count, sizeof *encoding->sources);
    encoding->sections = array_zero(2 + (size_t)encoding->row_count + input->cell_count, sizeof *encoding->sections);
    if (!encoding->levels || !encoding->spools || !encoding->sources || !encoding->sections ||
        !tetlodi_time_allocate(&encoding->time, controls, input->band_count, input->step_count))
        return tetlodi_fail_nomem(error, "the table of steps", (uint64_t)encoding->row_count * input->step_count * 8);
    for (uint32_t i = 0; i < encoding->row_count; i++)
        TETLOD_TRY(spool_open(&encoding->spools[i], error));
    encoding->time.displacement = input->points_move ? controls : 0;
    for (uint32_t c = 0; c < controls; c++)
        encoding->time.fields[c] = (struct tetlodi_time_field){series->options->controls[c].field, input->types[c],
                                                               {series->ranges[c][0], series->ranges[c][1]}};
    for (uint32_t b = 0; b < input->band_count; b++)
        encoding->time.bands[b] = (struct tetlod_band){.error = input->bands[b],
                                                       .level = series->log->mark_count - 1 - series->band_marks[b]};
    memcpy(encoding->time.times, input->times, input->step_count * sizeof *input->times);
    return TETLOD_OK;
}

static void list_frames(struct series_encoding *encoding, const char *tag, const struct tetlod_source *source)
{
    encoding->sections[encoding->section_count++] =
        (struct tetlodi_write_section){.tag = tag, .row = ROW_CODED, .source = source, .size = (size_t)source->size};
}

static void list_table(struct series_encoding *encoding, const char *tag, const struct tetlodi_buffer *table)
{
    encoding->sections[encoding->section_count++] =
        (struct tetlodi_write_section){.tag = tag, .row = 8, .bytes = table->bytes, .size = table->size};
}

/* Tables first: a reader fetches them together. */
static enum tetlod_status list_sections(struct series_encoding *encoding, bool in_parents, struct tetlod_error *error)
{
    const struct series_cells_encoding *cells = &encoding->cells;
    tetlodi_time_encode(&encoding->time, &encoding->table);
    if (encoding->table.failed)
        return tetlodi_fail_nomem(error, "the table of steps", encoding->table.size);
    list_table(encoding, TAG_TIME, &encoding->table);
    if (cells->time.field_count)
        list_table(encoding, in_parents ? TAG_PARENT_TIME : TAG_CELL_TIME, &cells->table);
    for (uint32_t i = 0; i < encoding->row_count; i++) {
        TETLOD_TRY(spool_source(&encoding->spools[i], &encoding->sources[i], error));
        list_frames(encoding, TAG_STEP_VALUES, &encoding->sources[i]);
    }
    for (uint32_t f = 0; f < cells->time.field_count; f++)
        list_frames(encoding, in_parents ? TAG_PARENT_STEPS : TAG_CELL_STEPS, &cells->sources[f]);
    return TETLOD_OK;
}

enum tetlod_status series_sections(void *opaque, const uint32_t *original_of, const struct tetlodi_late_rows *rows,
                                   const struct tetlodi_write_section **out, uint32_t *count,
                                   struct tetlod_error *error)
{
    struct series_build *series = opaque;
    uint32_t batch_steps = series_batch(series), *numbers = array_new(batch_steps, sizeof *numbers);
    enum tetlod_status status = numbers ? start(series, error) : tetlodi_fail_nomem(error, "the steps",
                                                                                    batch_steps * sizeof *numbers);
    for (uint32_t first = 0; first < series->input->step_count && status == TETLOD_OK; first += batch_steps) {
        uint32_t left = series->input->step_count - first;
        struct batch batch = {series, original_of, first, left < batch_steps ? left : batch_steps, error};
        for (uint32_t i = 0; i < batch.count; i++)
            numbers[i] = first + i;
        status = series_retrace(series, numbers, batch.count, encode_mark, &batch, error);
        double done = (first + batch.count) / (double)series->input->step_count;
        if (status == TETLOD_OK && series->options->progress &&
            !series->options->progress(series->options->progress_opaque, BUILD_ENCODE, 0.5 + done / 2))
            status = tetlodi_fail(error, TETLOD_ERR_CANCELLED, "cancelled");
    }
    free(numbers);
    if (status == TETLOD_OK)
        status = series_cells_encode(series, rows, &series->encoding->cells, error);
    if (status == TETLOD_OK)
        status = list_sections(series->encoding, rows->in_parents, error);
    *out = status == TETLOD_OK ? series->encoding->sections : NULL;
    *count = status == TETLOD_OK ? series->encoding->section_count : 0;
    return status;
}
