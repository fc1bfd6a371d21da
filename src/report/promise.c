/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/report/promise.h"

#include <math.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stdio.h>
#include <string.h>

#include "src/stream/metadata.h"

static double error_of(const struct tetlod_info *info, uint32_t level, uint32_t field, enum tetlod_measure measure)
{
    return info->levels[level].errors[field * TETLOD_MEASURES + (uint32_t)measure];
}

static bool is_uncontrolled(const struct tetlod_info *info, uint32_t field, const json_t *ids)
{
    const struct tetlod_field *of = &info->fields[field];
    return !of->controlled && of->bounds == TETLOD_NONE && !metadata_is_id(ids, of->name);
}

struct uncontrolled uncontrolled_at(const struct tetlod_info *info, uint32_t level)
{
    struct uncontrolled found = {0, TETLOD_NONE, 0};
    json_t *ids = metadata_ids(info);
    for (uint32_t f = 0; f < info->field_count; f++) {
        double sampled = error_of(info, level, f, TETLOD_SAMPLED);
        if (!is_uncontrolled(info, f, ids))
            continue;
        found.count++;
        if (found.worst == TETLOD_NONE || sampled > found.sampled) {
            found.worst = f;
            found.sampled = sampled;
        }
    }
    json_decref(ids);
    return found;
}

__attribute__((format(printf, 3, 4))) static void add(char *out, size_t size, const char *format, ...)
{
    size_t used = strlen(out);
    va_list list;
    va_start(list, format);
    vsnprintf(out + used, size - used, format, list);
    va_end(list);
}

double promise_percent(double fraction)
{
    if (!(fraction > 0))
        return 0;
    double step = pow(10, floor(log10(100 * fraction)) - 2);
    return step * ceil(100 * fraction / step - 1e-9);
}

static void print_uncontrolled(const struct tetlod_info *info, uint32_t level, char *out, size_t size)
{
    struct uncontrolled found = uncontrolled_at(info, level);
    if (!found.count)
        return;
    const char *name = info->fields[found.worst].name;
    const bool known = !isnan(found.sampled); // another writer may not say it
    if (found.count == 1)
        add(out, size, "; %.60s not controlled%s", name, known ? ":" : "");
    else if (known)
        add(out, size, "; %u fields not controlled, worst %.60s", found.count, name);
    else
        add(out, size, "; %u fields not controlled", found.count);
    if (known)
        add(out, size, " %.3g %% (measured)", promise_percent(found.sampled));
}

void promise_print(const struct tetlod_info *info, uint32_t level, char *out, size_t size)
{
    bool first = true;
    out[0] = 0;
    for (uint32_t f = 0; f < info->field_count; f++) {
        double max = error_of(info, level, f, TETLOD_MAX);
        if (!info->fields[f].controlled)
            continue;
        if (isnan(max))
            add(out, size, "%s%.60s %.3g %% (measured)", first ? "" : ", ", info->fields[f].name,
                promise_percent(error_of(info, level, f, TETLOD_SAMPLED)));
        else
            add(out, size, "%s%.60s \u2264 %.3g %% (certified)", first ? "" : ", ", info->fields[f].name,
                promise_percent(max));
        first = false;
    }
    print_uncontrolled(info, level, out, size);
}

void promise_of_field(const struct tetlod_info *info, uint32_t level, uint32_t f, const json_t *ids, char *out,
                      size_t size)
{
    const struct tetlod_field *field = &info->fields[f];
    double max = error_of(info, level, f, TETLOD_MAX), error = isnan(max) ? error_of(info, level, f,
                                                                                     TETLOD_SAMPLED) : max;
    double fraction = promise_percent(error) / 100;
    if (field->bounds != TETLOD_NONE)
        snprintf(out, size, "%.60s: how far off %.60s is at most at each point (certified)", field->name,
                 info->fields[field->bounds].name);
    else if (!field->controlled && metadata_is_id(ids, field->name))
        snprintf(out, size, "%.60s: ids, of one of the points that a vertex was made of", field->name);
    else if (isnan(error))
        snprintf(out, size, "%.60s: how far it is off is not known at this level", field->name);
    else
        snprintf(out, size, "%.60s %s %.3g %% of the range, %.4g in its units (%s%s)", field->name,
                 isnan(max) ? "about" : "\u2264", 100 * fraction, fraction * (field->range[1] - field->range[0]),
                 isnan(max) ? "measured" : "certified", field->controlled ? "" : ", not controlled");
}
