/* SPDX-License-Identifier: BSD-3-Clause */
#include "tests/attack/falsify.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "tests/attack/oracle.h"
#include "tests/recode.h"

enum lie { LIE_MAX, LIE_SAMPLED, LIE_DOMAIN, LIE_LARGE, LIES };

void falsehood_begin(struct falsehood *falsehood, const struct tetlod_info *info)
{
    size_t count = (size_t)info->level_count * info->field_count;
    *falsehood = (struct falsehood){oracle_memory(count, sizeof(double)), oracle_memory(count, sizeof(double)),
                                    oracle_memory(info->level_count,
                                                  sizeof(double)), info->level_count, info->field_count, false};
    for (size_t i = 0; i < count; i++)
        falsehood->max[i] = falsehood->sampled[i] = NAN;
    for (uint32_t k = 0; k < info->level_count; k++)
        falsehood->domain[k] = NAN;
}

void falsehood_end(struct falsehood *falsehood)
{
    free(falsehood->max);
    free(falsehood->sampled);
    free(falsehood->domain);
}

void falsehood_note(double *at, double difference)
{
    *at = fmax(*at, difference);
}

/* Levels from k on get at most this much; finer ones with less keep what they have. */
static void lower(double *errors, uint32_t k, uint32_t levels, uint32_t step, double to)
{
    for (; k < levels; k++)
        errors[(size_t)k * step] = fmin(errors[(size_t)k * step], to);
}

/* Where to lie: a level with a true figure that is large enough for a lie of 1 % to be one. */
static bool choose(const struct falsehood *f, struct dice *dice, enum lie *what, uint32_t *level, uint32_t *field,
                   double *truth)
{
    for (int tries = 0; tries < 60; tries++) {
        *what = (enum lie)dice_below(dice, LIES);
        *level = dice_below(dice, f->levels);
        *field = dice_below(dice, f->fields);
        size_t i = (size_t)*level * f->fields + *field;
        if (*what == LIE_LARGE && !f->definite)
            continue;
        *truth = *what == LIE_LARGE     ? f->sampled[i]
                 : *what == LIE_MAX     ? f->max[i]
                 : *what == LIE_SAMPLED ? f->sampled[i]
                                        : f->domain[*level];
        if (*truth > 1e-6)
            return true;
    }
    return false;
}

static enum tetlod_status write_file(void *opaque, const void *bytes, size_t size)
{
    return fwrite(bytes, 1, size, opaque) == size ? TETLOD_OK : TETLOD_ERR_IO;
}

static bool seal(const struct recode *recode, const char *path)
{
    FILE *out = fopen(path, "wb");
    const struct tetlodi_sink sink = {write_file, out};
    bool written = out && tetlodi_write(&recode->input, &sink, NULL) == TETLOD_OK;
    return out && fclose(out) == 0 && written;
}

bool falsehood_write(const struct falsehood *f, struct tetlod_file *file, struct dice *dice, const char *path,
                     bool *out_lie,
                     char *text, size_t size)
{
    static const char *const names[] = {"max", "sampled", "domain error", "too large: sampled"};
    const struct tetlod_info *info = tetlod_info(file);
    uint32_t level, field, step = f->fields * TETLOD_MEASURES;
    struct recode recode;
    enum lie what;
    double truth;
    if (!choose(f, dice, &what, &level, &field, &truth) || recode_read(&recode, file, NULL) != TETLOD_OK)
        return false;
    double *errors = oracle_memory((size_t)f->levels * step, sizeof *errors), lie = 0.99 * truth;
    *out_lie = !dice_once_in(dice, 8);
    if (!*out_lie)
        lie = INFINITY;
    bool alone = dice_once_in(dice, 2); // what finer levels say of the boundary stays: it is more
    for (uint32_t k = 0; k < f->levels; k++) {
        memcpy(errors + (size_t)k * step, info->levels[k].errors, step * sizeof *errors);
        recode.levels[k].errors = errors + (size_t)k * step;
        if (what == LIE_DOMAIN && (alone ? k == level : k >= level))
            recode.levels[k].domain_error = fmin(recode.levels[k].domain_error, lie);
    }
    // as a whole in order: no level below a finer one
    for (uint32_t k = 0; k <= level && what == LIE_LARGE && *out_lie; k++) {
        double *of = errors + (size_t)k * step + field * TETLOD_MEASURES;
        lie = 1.001 * info->levels[level].errors[field * TETLOD_MEASURES + TETLOD_SAMPLED];
        of[TETLOD_SAMPLED] = fmax(of[TETLOD_SAMPLED], lie);
        of[TETLOD_MAX] = isnan(of[TETLOD_MAX]) ? of[TETLOD_MAX] : fmax(of[TETLOD_MAX], lie);
    }
    if (what == LIE_MAX || what == LIE_SAMPLED)
        lower(errors + field * TETLOD_MEASURES + (what == LIE_MAX ? TETLOD_MAX : TETLOD_SAMPLED), level, f->levels,
              step, lie);
    snprintf(text, size, "%s of %.20s at level %u of %u put to %.9g, it is %.9g", names[what],
             info->fields[field].name, level,
             f->levels, lie, truth);
    bool done = seal(&recode, path);
    free(errors);
    recode_free(&recode);
    return done;
}

bool falsehood_write_bound(const struct falsehood *f, struct tetlod_file *file, const char *path, char *text,
                           size_t size)
{
    const struct tetlod_info *info = tetlod_info(file);
    for (uint32_t bound = 0; bound < info->field_count; bound++) {
        const struct tetlod_field *field = &info->fields[bound];
        struct recode recode;
        double truth = 0, by = 0.5;
        for (uint32_t k = 0; k < f->levels && field->bounds != TETLOD_NONE; k++) {
            const double *range = info->fields[field->bounds].range;
            truth = fmax(truth, f->max[(size_t)k * f->fields + field->bounds] * (range[1] - range[0]));
        }
        if (!(truth > 1e-6 * field->range[1]) || recode_read(&recode, file, NULL) != TETLOD_OK)
            continue;
        while (field->range[1] * by > 0.99 * truth)
            by /= 2;
        recode_scale(&recode, bound, by);
        snprintf(text, size, "%.20s put to at most %.9g, the difference is %.9g", field->name, field->range[1] * by,
                 truth);
        bool done = seal(&recode, path);
        recode_free(&recode);
        return done;
    }
    return false;
}
