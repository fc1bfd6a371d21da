/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/pipeline/limits.h"

#include <stdlib.h>

#include "format/fail.h"
#include "src/mesh/tet_geom.h"
#include "src/util/array.h"

void limits_fini(struct limits *limits)
{
    free(limits->fields);
    free(limits->weights);
    *limits = (struct limits){0};
}

/* The widest limit that a field has of its own; 0: none has one. */
static double widest_limit(const struct build_options *options)
{
    double widest = 0;
    for (uint32_t i = 0; i < options->control_count; i++)
        widest = larger(widest, options->controls[i].limit);
    return widest;
}

/* A field's limit in all: its own, or the common one; a share of it; and all shrink together to --max-error. */
static double limit_of(const struct build_options *options, uint32_t i, double widest)
{
    const struct build_control *control = &options->controls[i];
    double limit = control->limit > 0 ? control->limit : widest > 0 ? widest : 1;
    double stop = widest > 0 ? smaller(1, options->max_error / widest) : options->max_error;
    return limit * stop * (control->share > 0 ? control->share : 1);
}

/* What rounding leaves of a field's limit. Without a limit there is nothing to be inside of. */
static enum tetlod_status take_off(double *limit, const struct build_options *options, const struct point_field *field,
                                   uint32_t vertices,
                                   double rounding, double widest, struct tetlod_error *error)
{
    double range[2];
    point_field_range(field, vertices, range);
    double lost = range[1] > range[0] ? rounding / (range[1] - range[0]) : 0;
    if (!(lost > 0) || (widest <= 0 && options->max_error >= 1))
        return TETLOD_OK;
    if (lost >= *limit)
        return tetlodi_fail(error, TETLOD_ERR_ARGUMENT,
                            "rounding alone changes '%.60s' by up to %.3g %% of its range, its limit is %.3g %%; keep "
                            "more bits, or "
                            "allow a larger error", field->name, 100 * lost, 100 * *limit);
    *limit -= lost;
    return TETLOD_OK;
}

enum tetlod_status limits_set(struct limits *out, const struct build_options *options, const struct tetmesh *original,
                              const double *rounding, struct tetlod_error *error)
{
    uint32_t count = options->control_count;
    double widest = widest_limit(options);
    enum tetlod_status status = TETLOD_OK;
    *out = (struct limits){array_new(count, sizeof *out->fields), array_new(count, sizeof *out->weights), 0};
    if (!out->fields || !out->weights)
        status = tetlodi_fail_nomem(error, "the controlled fields", count * 12);
    for (uint32_t i = 0; i < count && status == TETLOD_OK; i++) {
        uint32_t f = out->fields[i] = options->controls[i].field;
        out->weights[i] = limit_of(options, i, widest);
        if (rounding)
            status = take_off(&out->weights[i], options, &original->fields[f], original->vertex_count, rounding[f],
                              widest, error);
        out->max_error = larger(out->max_error, out->weights[i]);
    }
    for (uint32_t i = 0; i < count && status == TETLOD_OK; i++)
        out->weights[i] /= out->max_error;
    if (status != TETLOD_OK)
        limits_fini(out);
    return status;
}
