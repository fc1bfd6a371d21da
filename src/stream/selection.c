/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/stream/selection.h"

#include <math.h>
#include <string.h>

#include "src/stream/page_region.h"
#include "src/util/number_text.h"

uint32_t selection_level(const struct tetlod_info *info, const struct selection *selection)
{
    switch (selection->kind) {
    case TAKE_ERROR:
        return tetlod_level_for_error(info, selection->error, selection->field, selection->measure);
    case TAKE_ABS_ERROR:
        return tetlod_level_for_abs_error(info, selection->error, selection->field, selection->measure);
    case TAKE_LEVEL:
        return selection->count < info->level_count ? (uint32_t)selection->count : TETLOD_NONE;
    case TAKE_TETS:
        return tetlod_level_for_tets(info, selection->count);
    case TAKE_BYTES:
        return tetlod_level_for_bytes(info, selection->count);
    default:
        return info->level_count - 1;
    }
}

uint32_t selection_box_level(const struct tetlod_info *info, const struct selection *selection)
{
    struct selection fine = *selection;
    if (selection->box_finest)
        return info->page_count ? page_region_finest(info) : info->level_count - 1;
    fine.kind = selection->kind == TAKE_ABS_ERROR ? TAKE_ABS_ERROR : TAKE_ERROR;
    fine.error = selection->box_error;
    return selection_level(info, &fine);
}

static bool field_measured(const struct tetlod_info *info, uint32_t field, enum tetlod_measure measure)
{
    return info->level_count && !isnan(info->levels[0].errors[field * TETLOD_MEASURES + measure]);
}

bool selection_measured(const struct tetlod_info *info, uint32_t field, enum tetlod_measure measure)
{
    if (field != TETLOD_NONE)
        return field_measured(info, field, measure);
    bool any = false;
    for (uint32_t f = 0; f < info->field_count; f++) {
        if (info->fields[f].controlled && !field_measured(info, f, measure))
            return false;
        any |= info->fields[f].controlled != 0;
    }
    return any;
}

enum tetlod_measure selection_measure(const char *name)
{
    int m = 0;
    while (m < TETLOD_MEASURES && strcmp(name, tetlod_measure_name((enum tetlod_measure)m)) != 0)
        m++;
    return (enum tetlod_measure)m;
}

bool selection_read_box(const char *text, size_t size, struct region_box *out)
{
    char one[200];
    double numbers[6];
    size_t used = 0;
    if (size >= sizeof one)
        return false;
    for (size_t i = 0; i < size; i++)
        if (text[i] != ' ' || (used && one[used - 1] != ',')) // a blank may follow a comma
            one[used++] = text[i];
    one[used] = 0;
    if (!text_numbers(one, 6, numbers))
        return false;
    for (int i = 0; i < 3; i++) {
        out->low[i] = numbers[i] + 0.0; // -0 is 0: one text for both
        out->high[i] = numbers[i + 3] + 0.0;
        if (out->low[i] > out->high[i])
            return false;
    }
    return true;
}

uint32_t selection_topology(const struct tetlod_info *info, const struct step_selection *selection, uint64_t *out_step)
{
    *out_step = selection->step;
    if (!info->topology_count)
        return 0;
    if (selection->by_time)
        return tetlod_topology_for_time(info, selection->time);
    if (selection->step > UINT32_MAX)
        return TETLOD_NONE;
    uint32_t step = 0, topology = tetlod_topology_of_step(info, (uint32_t)selection->step, &step);
    *out_step = step;
    return topology;
}

uint32_t selection_step(const struct tetlod_series_info *series, const struct step_selection *selection, uint64_t step)
{
    if (selection->by_time)
        return tetlod_step_for_time(series, selection->time);
    return step < series->step_count ? (uint32_t)step : TETLOD_NONE;
}

/* By the step's own errors; the table has them as fractions of the range over all steps alone. */
uint32_t selection_band(const struct tetlod_series *series, const struct step_selection *selection, uint32_t step)
{
    if (selection->absolute)
        return tetlod_band_for_step_abs(series, step, selection->error);
    return selection->own_ranges ? tetlod_band_for_error(tetlod_series_info(series), selection->error)
                                 : tetlod_band_for_step(series, step, selection->error);
}
