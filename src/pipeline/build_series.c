/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/pipeline/build_series.h"

#include <float.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "format/fail.h"
#include "format/coding/time_table.h"
#include "src/mesh/tet_geom.h"
#include "src/pipeline/build_memory.h"
#include "src/pipeline/series_parts.h"
#include "src/util/array.h"

/* Steps that drive at least, where there are so many; components that are retraced together, where they fit. */
enum { MIN_KEYS = 16, BATCH_COMPONENTS = 32 };

/* Bytes. A component that drives takes DRIVING_BYTES a vertex (its values here, in the working mesh and in the log, U,
 * L, the prediction) and STAR_BYTES a thread (values and planes of a large star). The levels of the bands and the
 * current frame take ENCODING_BYTES a vertex. The last two are measured. */
enum { DRIVING_BYTES = 56, STAR_BYTES = 3 << 10, ENCODING_BYTES = 400 };

/* ---- values */

uint32_t series_components(const struct series_build *series, uint32_t control)
{
    return series->mesh->fields[series->options->controls[control].field].components;
}

static size_t control_bytes(const struct series_build *series, uint32_t control)
{
    size_t width = series->input->types[control] == TETLOD_FLOAT32 ? sizeof(float) : sizeof(double);
    return width * series_components(series, control) * series->mesh->vertex_count;
}

enum tetlod_status series_load(const struct series_build *series, uint32_t step, uint32_t control, double *out,
                               struct tetlod_error *error)
{
    size_t count = (size_t)series_components(series, control) * series->mesh->vertex_count,
           size = control_bytes(series, control);
    uint64_t offset = 0, row = 0;
    for (uint32_t i = 0; i < series->options->control_count; i++) {
        offset += i < control ? control_bytes(series, i) : 0;
        row += control_bytes(series, i);
    }
    // floats come at the end, and become doubles from there
    unsigned char *bytes = (unsigned char *)out + count * sizeof *out - size;
    const struct tetlod_source *values = &series->input->values;
    if (values->read(values->opaque, step * row + offset, bytes, size) != TETLOD_OK)
        return tetlodi_fail(error, TETLOD_ERR_IO, "a step's values cannot be read from a temporary file");
    for (size_t i = 0; i < count && series->input->types[control] == TETLOD_FLOAT32; i++) {
        float value;
        memcpy(&value, bytes + i * sizeof value, sizeof value);
        out[i] = (double)value;
    }
    return TETLOD_OK;
}

/* ---- set-up */

/* A control's range over all steps, and the width of each step's. */
static enum tetlod_status find_control_range(struct series_build *series, uint32_t control, struct tetlod_error *error)
{
    size_t count = (size_t)series_components(series, control) * series->mesh->vertex_count;
    double *values = array_new(count, sizeof *values), *range = series->ranges[control];
    enum tetlod_status status = values ? TETLOD_OK : tetlodi_fail_nomem(error, "a step's values",
                                                                        count * sizeof *values);
    bool displacement = series_is_displacement(series, control);
    const double *given = series->input->ranges && !displacement ? series->input->ranges[control] : NULL;
    range[0] = given ? given[0] : INFINITY;
    range[1] = given ? given[1] : -INFINITY;
    for (uint32_t s = 0; s < series->input->step_count && status == TETLOD_OK; s++) {
        double own[2] = {INFINITY, -INFINITY};
        status = series_load(series, s, control, values, error);
        for (size_t i = 0; i < count && status == TETLOD_OK; i++) {
            own[0] = smaller(own[0], values[i]);
            own[1] = larger(own[1], values[i]);
            if (displacement)
                series->reach = larger(series->reach, fabs(series->mesh->positions[i] + values[i]));
        }
        range[0] = smaller(range[0], own[0]);
        range[1] = larger(range[1], own[1]);
        series->units[(size_t)s * series->options->control_count + control] = own[1] - own[0];
    }
    free(values);
    return status;
}

/* How far points move counts in its range over all steps in any case, and so does a step without a range. */
static void choose_units(struct series_build *series, uint32_t control)
{
    bool own = series->input->own_ranges && !series_is_displacement(series, control);
    for (uint32_t s = 0; s < series->input->step_count; s++) {
        double *unit = &series->units[(size_t)s * series->options->control_count + control];
        *unit = own && *unit > 0 && isfinite(1 / *unit) ? *unit : series_width(series, control);
    }
}

static enum tetlod_status find_ranges(struct series_build *series, struct tetlod_error *error)
{
    for (uint32_t c = 0; c < series->options->control_count; c++) {
        TETLOD_TRY(find_control_range(series, c, error));
        double width = series_width(series, c), *range = series->ranges[c];
        if (!isfinite(width) || (width > 0 && !isfinite(1 / width)))
            return tetlodi_fail(error, TETLOD_ERR_MESH,
                                "field '%.60s' has the range %g .. %g over the series, too %s for errors relative to "
                                "it",
                                series->mesh->fields[series->options->controls[c].field].name, range[0], range[1],
                                width > 1 ? "wide" : "narrow");
        choose_units(series, c);
    }
    return TETLOD_OK;
}

const double *build_series_bands(uint32_t *out_count)
{
    static const double usual[] = {0.05, 0.02, 0.01, 0.005, 0.002, 0.001, 0};
    *out_count = sizeof usual / sizeof *usual;
    return usual;
}

enum tetlod_status series_new(struct series_build **out, const struct tetmesh *mesh,
                              const struct build_options *options,
                              struct tetlod_error *error)
{
    struct series_build *series = *out = array_zero(1, sizeof *series);
    if (!series)
        return tetlodi_fail_nomem(error, "the series", sizeof *series);
    series->mesh = mesh;
    series->options = options;
    series->input = options->series;
    series->ranges = array_new(options->control_count, sizeof *series->ranges);
    series->units = array_new((size_t)options->control_count * series->input->step_count, sizeof *series->units);
    series->band_marks = array_zero(series->input->band_count, sizeof *series->band_marks);
    if (!series->ranges || !series->units || !series->band_marks)
        return tetlodi_fail_nomem(error, "the series", options->control_count * sizeof *series->ranges);
    for (uint32_t c = 0; c < options->control_count; c++)
        series->component_count += series_components(series, c);
    return find_ranges(series, error);
}

void series_free(struct series_build *series)
{
    if (!series)
        return;
    series_encoding_free(series->encoding);
    free(series->ranges);
    free(series->units);
    free(series->band_marks);
    free(series->worst);
    free(series);
}

uint32_t series_key_count(const struct series_build *series)
{
    return series->key_count;
}

/* What is left of --memory: beside the build of one step a group of steps is retraced and encoded, whatever the number
 * of steps. */
static uint64_t left_over(const struct series_build *series)
{
    uint64_t group = retrace_bytes(series->mesh, STEP_GROUP * series->component_count) +
                     (uint64_t)series->mesh->vertex_count * ENCODING_BYTES;
    uint64_t base = build_bytes(series->mesh, series->options) + group, memory = series->options->memory;
    return !memory ? UINT64_MAX : memory > base ? memory - base : 0;
}

/* As many keys as the memory has room for, on any number of threads; then as many threads as there is room for beside
 * the first. */
static enum tetlod_status choose_keys(struct series_build *series, struct tetlod_error *error)
{
    uint64_t star = (uint64_t)STAR_BYTES * series->component_count,
             one = (uint64_t)series->mesh->vertex_count * DRIVING_BYTES * series->component_count + star;
    uint64_t left = left_over(series), fit = left / one;
    uint32_t steps = series->input->step_count, least = steps < MIN_KEYS ? steps : MIN_KEYS;
    series->key_count = fit < steps ? (uint32_t)fit : steps;
    if (series->key_count >= least) {
        uint64_t threads = 1 + (left - series->key_count * one) / (series->key_count * star);
        series->simplify.threads = threads < series->simplify.threads ? (unsigned)threads : series->simplify.threads;
        return TETLOD_OK;
    }
    return tetlodi_fail(error, TETLOD_ERR_LIMIT,
                        "%u of %u steps have to drive the contraction, each takes %llu MB, and --memory leaves room "
                        "for %u",
                        least, steps, (unsigned long long)(one >> 20) + 1, series->key_count);
}

static uint32_t key_step(const struct series_build *series, uint32_t key)
{
    uint64_t last = series->input->step_count - 1;
    return series->key_count < 2 ? 0 : (uint32_t)(((uint64_t)key * last + (series->key_count - 1) / 2) /
                                                  (series->key_count - 1));
}

uint32_t series_batch(const struct series_build *series)
{
    uint32_t steps = BATCH_COMPONENTS / series->component_count / STEP_GROUP * STEP_GROUP;
    uint64_t group = retrace_bytes(series->mesh, STEP_GROUP * series->component_count);
    if (steps > STEP_GROUP && retrace_bytes(series->mesh, steps * series->component_count) - group > left_over(series))
        steps = STEP_GROUP;
    return steps ? steps : STEP_GROUP;
}

/* ---- fields of steps */

/* Room for the controlled fields of `count` steps behind `fields`, which it copies. */
struct step_fields {
    struct tetmesh mesh; /* borrows all else */
    uint32_t given;      /* fields that are not freed */
};

static enum tetlod_status step_fields_init(struct step_fields *out, const struct series_build *series,
                                           const struct tetmesh *mesh, uint32_t given,
                                           uint32_t count, struct tetlod_error *error)
{
    size_t most = given + (size_t)count * series->options->control_count;
    out->mesh = *mesh;
    out->given = out->mesh.field_count = given;
    out->mesh.fields = array_zero(most, sizeof *out->mesh.fields);
    if (!out->mesh.fields)
        return tetlodi_fail_nomem(error, "the steps", most * sizeof *out->mesh.fields);
    for (uint32_t f = 0; f < given; f++)
        out->mesh.fields[f] = mesh->fields[f];
    return TETLOD_OK;
}

static void step_fields_fini(struct step_fields *fields)
{
    for (uint32_t f = fields->given; f < fields->mesh.field_count && fields->mesh.fields; f++)
        free(fields->mesh.fields[f].values);
    free(fields->mesh.fields);
}

static enum tetlod_status step_fields_add(struct step_fields *fields, const struct series_build *series, uint32_t step,
                                          struct tetlod_error *error)
{
    for (uint32_t c = 0; c < series->options->control_count; c++) {
        size_t count = (size_t)series_components(series, c) * series->mesh->vertex_count;
        struct point_field *field = &fields->mesh.fields[fields->mesh.field_count];
        *field = (struct point_field){.name = series->mesh->fields[series->options->controls[c].field].name,
                                      .components = series_components(series, c),
                                      .type = series->input->types[c],
                                      .values = array_new(count, sizeof(double))};
        if (!field->values)
            return tetlodi_fail_nomem(error, "a step's values", count * sizeof(double));
        fields->mesh.field_count++;
        TETLOD_TRY(series_load(series, step, c, field->values, error));
    }
    return TETLOD_OK;
}

enum tetlod_status series_retrace(const struct series_build *series, const uint32_t *steps, uint32_t count,
                                  enum tetlod_status (*visit)(void *opaque,
                                                              const struct retrace_mark *mark), void *opaque,
                                  struct tetlod_error *error)
{
    struct step_fields fields = {0};
    enum tetlod_status status = step_fields_init(&fields, series, series->mesh, 0, count, error);
    for (uint32_t i = 0; i < count && status == TETLOD_OK; i++)
        status = step_fields_add(&fields, series, steps[i], error);
    if (status == TETLOD_OK)
        status = retrace(&fields.mesh, series->log, &series->simplify, visit, opaque, error);
    step_fields_fini(&fields);
    return status;
}

/* ---- what a level may be off in a band */

/* Two roundings of half a unit in the last place: the input's, and that of what is decoded. */
static double units_in_last_place(const struct series_build *series, uint32_t control, uint32_t band)
{
    int exponent, digits = series->mesh->position_type == TETLOD_FLOAT32 ? FLT_MANT_DIG : DBL_MANT_DIG;
    frexp(series->reach + series->input->bands[band] * series_width(series, control), &exponent);
    return ldexp(1, exponent - digits);
}

bool series_is_within_rounding(const struct series_build *series, uint32_t control, uint32_t band)
{
    double tolerance = series->input->bands[band] * series_width(series, control);
    return series_is_displacement(series, control) &&
           units_in_last_place(series, control, band) > (1 - HALF_STEP / 2) * tolerance;
}

double series_rounding(const struct series_build *series, uint32_t control, uint32_t band)
{
    if (!series_is_displacement(series, control) || series_is_within_rounding(series, control, band))
        return 0;
    return units_in_last_place(series, control, band);
}

/* The largest bound of a level, a fraction of the unit, that leaves room for half a step of the band's grid, and for
 * rounding. */
static double level_share(const struct series_build *series, uint32_t control, uint32_t band)
{
    double tolerance = series->input->bands[band] * series_width(series, control),
           rounding = series_rounding(series, control, band);
    if (series_is_within_rounding(series, control, band))
        return 0;
    return rounding > HALF_STEP / 2 * tolerance ? 1 - HALF_STEP / 2 - rounding / tolerance : LEVEL_SHARE;
}

/* The least share of any band in which rounding leaves half of the error: the contraction has rungs at the bands, and a
 * rung that is a little too high for its band would leave it the one below. */
static double contraction_share(const struct series_build *series, uint32_t control)
{
    double least = LEVEL_SHARE;
    for (uint32_t b = 0; b < series->input->band_count; b++) {
        double share = level_share(series, control, b);
        least = share >= 0.5 ? smaller(least, share) : least;
    }
    return least;
}

/* ---- contraction */

static double field_width(const struct tetmesh *mesh, uint32_t field)
{
    double range[2];
    point_field_range(&mesh->fields[field], mesh->vertex_count, range);
    return range[1] - range[0];
}

/* A step's limit counts in the step's unit, where that of a field counts in the field's own range. */
static double step_weight(const struct tetmesh *mesh, uint32_t field, double unit, double weight)
{
    double width = field_width(mesh, field), factor = width > 0 ? unit / width : 1;
    return isfinite(factor) ? weight * factor : weight;
}

static void raise_worst(struct series_build *series, uint32_t mark, uint32_t step, uint32_t control, double bound)
{
    double *worst = &series->worst[(size_t)mark * series->options->control_count + control],
           unit = series_unit(series, step, control);
    *worst = larger(*worst, unit > 0 ? smaller(bound / unit, 1) : 0);
}

/* What the key steps are certified to. */
static void note_keys(struct series_build *series, const struct contraction_log *log)
{
    uint32_t controls = series->options->control_count, own = series->component_count;
    for (uint32_t m = 0; m < log->mark_count; m++)
        for (uint32_t d = 0; d < log->component_count; d++) {
            uint32_t control = 0;
            for (uint32_t first = series_components(series, 0); first <= d % own;
                 first += series_components(series, control))
                control++;
            double scale = log->components[d].scale;
            if (control < controls && scale > 0)
                raise_worst(series, m, key_step(series, d / own), control,
                            log->certified[(size_t)m * log->component_count + d] / scale);
        }
}

/* Only what is about the mesh's own fields is left in the log. */
static void strip(struct contraction_log *log, uint32_t fields, uint32_t components)
{
    for (uint32_t f = fields; f < log->field_count; f++)
        free(log->fields[f].values);
    log->field_count = fields;
    for (uint32_t m = 0; m < log->mark_count; m++) {
        memmove(log->certified + (size_t)m * components, log->certified + (size_t)m * log->component_count,
                components * sizeof(double));
        memmove(log->predicted + (size_t)m * components, log->predicted + (size_t)m * log->component_count,
                components * sizeof(double));
    }
    log->component_count = components;
}

static enum tetlod_status drive(struct series_build *series, struct contraction_log *log, const struct tetmesh *mesh,
                                const double *weights,
                                struct tetlod_error *error)
{
    uint32_t controls = series->options->control_count, count = controls * series->key_count;
    uint32_t *controlled = array_new(count, sizeof *controlled);
    double *limits = array_new(count, sizeof *limits);
    struct step_fields fields = {0};
    enum tetlod_status status = TETLOD_OK;
    if (!controlled || !limits)
        TETLOD_TRY_DONE(tetlodi_fail_nomem(error, "the steps", count * sizeof *limits));
    TETLOD_TRY_DONE(step_fields_init(&fields, series, mesh, mesh->field_count, series->key_count, error));
    for (uint32_t key = 1; key < series->key_count; key++)
        TETLOD_TRY_DONE(step_fields_add(&fields, series, key_step(series, key), error));
    for (uint32_t i = 0; i < count; i++) {
        controlled[i] = i < controls ? series->options->controls[i].field : mesh->field_count + i - controls;
        double unit = series_unit(series, key_step(series, i / controls), i % controls);
        limits[i] = contraction_share(series, i % controls) * step_weight(&fields.mesh, controlled[i], unit,
                                                                          weights[i % controls]);
    }
    status = simplify(log, &fields.mesh, controlled, count, limits, &series->simplify, error);
done:
    step_fields_fini(&fields);
    free(controlled);
    free(limits);
    return status;
}

/* ---- the other steps */

struct bounding {
    struct series_build *series;
    uint32_t *steps; /* the current ones */
    uint32_t count;
};

static enum tetlod_status bound_mark(void *opaque, const struct retrace_mark *mark)
{
    const struct bounding *bounding = opaque;
    struct series_build *series = bounding->series;
    uint32_t d = 0;
    for (uint32_t s = 0; s < bounding->count; s++)
        for (uint32_t c = 0; c < series->options->control_count; c++)
            for (uint32_t k = 0; k < series_components(series, c); k++)
                raise_worst(series, mark->number, bounding->steps[s], c, mark->halves[d++]);
    return TETLOD_OK;
}

static enum tetlod_status bound_others(struct series_build *series, struct tetlod_error *error)
{
    uint32_t batch = series_batch(series), key = 0, *steps = array_new(batch, sizeof *steps);
    struct bounding bounding = {series, steps, 0};
    enum tetlod_status status = steps ? TETLOD_OK : tetlodi_fail_nomem(error, "the steps", batch * sizeof *steps);
    for (uint32_t s = 0; s < series->input->step_count && status == TETLOD_OK; s++) {
        bool drives = key < series->key_count && key_step(series, key) == s;
        key += drives;
        if (!drives)
            steps[bounding.count++] = s;
        if (bounding.count == batch || (bounding.count && s + 1 == series->input->step_count)) {
            status = series_retrace(series, steps, bounding.count, bound_mark, &bounding, error);
            bounding.count = 0;
        }
    }
    free(steps);
    return status;
}

/* The coarsest mark whose bound leaves room for rounding at every step. */
static void choose_marks(struct series_build *series)
{
    uint32_t controls = series->options->control_count;
    for (uint32_t b = 0; b < series->input->band_count; b++)
        for (uint32_t m = series->log->mark_count; m-- > 0;) {
            bool within = true;
            for (uint32_t c = 0; c < controls; c++)
                within &= series->worst[(size_t)m * controls + c] <=
                          level_share(series, c, b) * series->input->bands[b] * (1 + 1e-9);
            if (!within && m)
                continue;
            series->band_marks[b] = m;
            break;
        }
}

enum tetlod_status series_contract(struct series_build *series, struct contraction_log *log, const struct tetmesh *mesh,
                                   const double *weights, const struct simplify_options *options,
                                   struct tetlod_error *error)
{
    series->simplify = *options;
    series->simplify.rungs = series->input->bands;
    series->simplify.rung_count = series->input->band_count;
    series->log = log;
    TETLOD_TRY(choose_keys(series, error));
    TETLOD_TRY(drive(series, log, mesh, weights, error));
    series->worst = array_zero((size_t)log->mark_count * series->options->control_count, sizeof *series->worst);
    if (!series->worst)
        return tetlodi_fail_nomem(error, "the levels", log->mark_count * sizeof *series->worst);
    note_keys(series, log);
    strip(log, mesh->field_count, series->component_count);
    TETLOD_TRY(bound_others(series, error));
    choose_marks(series);
    return TETLOD_OK;
}
