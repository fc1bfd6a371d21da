/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/report/series_json.h"

#include <math.h>

#include "src/stream/metadata.h"

/* What all steps of a band come to: bytes, and the largest error of a field. */
static void sum_band(const struct tetlod_series *series, uint32_t band, uint64_t *bytes, double *error)
{
    const struct tetlod_series_info *steps = tetlod_series_info(series);
    *bytes = 0;
    *error = 0;
    for (uint32_t f = 0; f < steps->field_count; f++) {
        struct tetlod_span group = {0, 0};
        for (uint32_t s = 0; s < steps->step_count; s++) {
            struct tetlod_span span = tetlod_step_span(series, f, band, s);
            // steps of a group share theirs
            *bytes += span.offset == group.offset && span.size == group.size ? 0 : span.size;
            *error = fmax(*error, tetlod_step_error(series, f, band, s));
            group = span;
        }
    }
}

static json_t *band_json(const struct tetlod_series *series, const struct tetlod_info *info, uint32_t b)
{
    const struct tetlod_band *band = &tetlod_series_info(series)->bands[b];
    uint64_t bytes;
    double error;
    sum_band(series, b, &bytes, &error);
    return json_pack("{s:f, s:i, s:I, s:I, s:I, s:f}", "error", band->error, "level", (int)band->level, "vertices",
                     (json_int_t)info->levels[band->level].vertices, "tets", (json_int_t)info->levels[band->level].tets,
                     "bytes", (json_int_t)bytes, "largest_error", error);
}

/* False: memory is out. */
static bool add_field(json_t *fields, const char *name, const double range[2])
{
    return !json_array_append_new(fields, json_pack("{s:s, s:[f,f]}", "name", name, "range", range[0], range[1]));
}

json_t *series_json(const struct tetlod_series *series, const struct tetlod_info *info)
{
    const struct tetlod_series_info *steps = tetlod_series_info(series);
    json_t *times = json_array(), *fields = json_array(), *cells = json_array(), *bands = json_array();
    bool room = times && fields && cells && bands;
    for (uint32_t s = 0; s < steps->step_count && room; s++)
        room = !json_array_append_new(times, json_real(steps->times[s]));
    for (uint32_t f = 0; f < steps->field_count && room; f++)
        room = add_field(fields, info->fields[steps->fields[f]].name, steps->ranges[f]);
    for (uint32_t f = 0; f < steps->cell_field_count && room; f++)
        room = add_field(cells, info->cell_fields[steps->cell_fields[f]].name, steps->cell_ranges[f]);
    for (uint32_t b = 0; b < steps->band_count && room; b++)
        room = !json_array_append_new(bands, band_json(series, info, b));
    const char *displacement =
        steps->displacement == TETLOD_NONE ? NULL : info->fields[steps->fields[steps->displacement]].name;
    json_t *object = json_pack("{s:i, s:s, s:s?, s:o, s:o, s:o, s:o}", "steps", (int)steps->step_count, "relative_to",
                               metadata_own_ranges(info) ? "step" : "series", "displacement", displacement, "times",
                               times, "fields", fields, "cell_fields", cells, "bands", bands);
    if (room)
        return object;
    json_decref(object);
    return NULL;
}

/* Which fields of cells are known at every step, and which are not. */
static void print_cell_fields(FILE *out, const struct tetlod_series *series, const struct tetlod_info *info)
{
    const struct tetlod_series_info *steps = tetlod_series_info(series);
    for (uint32_t f = 0; f < steps->cell_field_count; f++)
        fprintf(out, "cell steps    %s, range %.9g .. %.9g, exact\n", info->cell_fields[steps->cell_fields[f]].name,
                steps->cell_ranges[f][0], steps->cell_ranges[f][1]);
    for (uint32_t f = 0; f < info->cell_field_count; f++)
        if (steps->step_count > 1 && !tetlod_has_step_cells(series, f, 1))
            fprintf(out, "cell steps    none of %s: the first step alone is known\n", info->cell_fields[f].name);
}

void series_print(FILE *out, const struct tetlod_series *series, const struct tetlod_info *info)
{
    const struct tetlod_series_info *steps = tetlod_series_info(series);
    fprintf(out, "series        %u steps in time, %.9g .. %.9g; of", steps->step_count, steps->times[0],
            steps->times[steps->step_count - 1]);
    for (uint32_t f = 0; f < steps->field_count; f++)
        fprintf(out, " %s, range %.9g .. %.9g%s", info->fields[steps->fields[f]].name, steps->ranges[f][0],
                steps->ranges[f][1],
                f + 1 < steps->field_count ? ";" : "\n");
    print_cell_fields(out, series, info);
    if (steps->displacement != TETLOD_NONE)
        fprintf(out, "points        move by %s; errors are those at the same point of the body, proved on the mesh of "
                     "the first step\n",
                info->fields[steps->fields[steps->displacement]].name);
    if (metadata_own_ranges(info))
        fprintf(out, "bands         are fractions of each step's own range; 'max' is one of the range over all "
                     "steps\n");
    fprintf(out, "\n band     level   vertices tetrahedra   bytes/step   max %%\n");
    for (uint32_t b = 0; b < steps->band_count; b++) {
        const struct tetlod_level *level = &info->levels[steps->bands[b].level];
        uint64_t bytes;
        double error;
        sum_band(series, b, &bytes, &error);
        fprintf(out, "%5.3g %% %8u %10llu %10llu %12.0f %7.4g\n", 100 * steps->bands[b].error,
                steps->bands[b].level, (unsigned long long)level->vertices, (unsigned long long)level->tets,
                (double)bytes / steps->step_count, 100 * error);
    }
}
