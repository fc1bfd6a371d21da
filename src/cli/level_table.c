/* SPDX-License-Identifier: BSD-3-Clause */
/* The table of levels that build and info print. */
#include <math.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>

#include "src/cli/cli.h"
#include "src/report/promise.h"
#include "src/stream/metadata.h"

/* The errors whose levels are shown: those that people ask for. */
static const double shown_errors[] = {0.2, 0.1, 0.05, 0.02, 0.01, 0.005, 0.002, 0.001};

/* A field that is not controlled and further off at a level that somebody takes is warned of. */
static const double MAX_OFF = 0.1;

/* Bytes of the stream that are there. */
static uint64_t bytes_here(const struct tetlod_info *info, int fd)
{
    struct stat about;
    if (fstat(fd, &about) != 0)
        return UINT64_MAX;
    return (uint64_t)about.st_size - info->stream_offset; // which is open
}

uint32_t cli_finest_here(const struct tetlod_info *info, int fd)
{
    uint32_t level = info->level_count;
    uint64_t here = bytes_here(info, fd);
    while (level > 0 && info->levels[level - 1].end > here)
        level--;
    return level ? level - 1 : TETLOD_NONE;
}

bool cli_is_whole(const struct tetlod_info *info, int fd)
{
    return info->bytes <= bytes_here(info, fd);
}

bool cli_section_here(const struct tetlod_info *info, const struct tetlod_section *section, int fd)
{
    return section->offset + section->stored <= bytes_here(info, fd);
}

bool cli_cells_here(const struct tetlod_info *info, int fd, uint32_t cell_field)
{
    uint32_t section = tetlod_cell_section(info, cell_field);
    return section != TETLOD_NONE && cli_section_here(info, &info->sections[section], fd);
}

/* The largest error of the controlled fields at a level; NaN if that of one of them is not known. */
static double error_at(const struct tetlod_info *info, uint32_t level, enum tetlod_measure measure)
{
    double worst = -1;
    for (uint32_t f = 0; f < info->field_count; f++) {
        double error = info->levels[level].errors[f * TETLOD_MEASURES + (uint32_t)measure];
        if (info->fields[f].controlled)
            worst = isnan(worst) || isnan(error) ? NAN : fmax(worst, error);
    }
    return worst < 0 ? NAN : worst;
}

/* Where max is not known, what is measured says which levels to show. */
static enum tetlod_measure shown_measure(const struct tetlod_info *info)
{
    return isnan(error_at(info, 0, TETLOD_MAX)) ? TETLOD_SAMPLED : TETLOD_MAX;
}

static bool is_shown(const struct tetlod_info *info, uint32_t level)
{
    bool shown = level == 0 || level + 1 == info->level_count || !info->field_count;
    for (size_t i = 0; i < sizeof shown_errors / sizeof *shown_errors && !shown; i++)
        shown = tetlod_level_for_error(info, shown_errors[i], TETLOD_NONE, shown_measure(info)) == level;
    return shown;
}

/* `predicted` is for those who ask for everything. */
static int measure_count(bool all)
{
    return all ? TETLOD_MEASURES : TETLOD_PREDICTED;
}

static void print_head(const struct tetlod_info *info, bool all, bool others)
{
    printf("%5s %10s %10s %12s %10s", "level", "vertices", "tets", "bytes", "domain");
    for (int m = 0; m < measure_count(all) && info->field_count; m++)
        printf(" %9s%%", tetlod_measure_name((enum tetlod_measure)m));
    printf("%s\n", others ? "    others%" : "");
}

static void print_row(const struct tetlod_info *info, uint32_t k, bool all, bool others)
{
    const struct tetlod_level *level = &info->levels[k];
    printf("%5u %10llu %10llu %12llu %10.3g", k, (unsigned long long)level->vertices,
           (unsigned long long)level->tets, (unsigned long long)level->end, level->domain_error);
    for (int m = 0; m < measure_count(all) && info->field_count; m++) {
        double error = error_at(info, k, (enum tetlod_measure)m);
        if (isnan(error))
            printf(" %10s", "-");
        else
            printf(" %10.4g", 100 * error);
    }
    if (others)
        printf(" %10.4g", 100 * uncontrolled_at(info, k).sampled);
    printf("\n");
}

/* Whose errors the table has. */
static void print_fields(const struct tetlod_info *info, const struct uncontrolled *others)
{
    uint32_t count = 0;
    for (uint32_t f = 0; f < info->field_count; f++)
        count += info->fields[f].controlled != 0;
    printf(count == 1 ? "errors of " : "errors: the largest of the controlled fields ");
    for (uint32_t f = 0, said = 0; f < info->field_count; f++)
        if (info->fields[f].controlled)
            printf("%s%s", said++ ? ", " : "", info->fields[f].name);
    printf(count == 1 ? ", %% of its range\n" : ", each in %% of its range\n");
    if (others->count)
        printf("others: the largest measured error of the %u field%s not controlled, at level 0 that of %s\n",
               others->count, others->count == 1 ? " that is" : "s that are", info->fields[others->worst].name);
}

void cli_print_levels(const struct tetlod_info *info, bool all)
{
    uint32_t left_out = 0;
    const struct uncontrolled others = uncontrolled_at(info, 0);
    print_head(info, all, others.count);
    for (uint32_t k = 0; k < info->level_count; k++)
        if (all || is_shown(info, k))
            print_row(info, k, all, others.count);
        else
            left_out++;
    if (info->field_count)
        print_fields(info, &others);
    if (left_out)
        printf("%u more levels: tetlod info --all\n", left_out);
}

void cli_warn_uncontrolled(const char *command, const struct tetlod_info *info, uint32_t level)
{
    const struct uncontrolled others = uncontrolled_at(info, level);
    if (others.count && others.sampled > MAX_OFF)
        fprintf(stderr,
                "tetlod %s: warning: '%.60s' is not controlled, and %.3g %% off at level %u; to control it, name it "
                "in tetlod build --field\n",
                command, info->fields[others.worst].name, promise_percent(others.sampled), level);
}

void cli_print_promises(FILE *out, const struct tetlod_info *info, uint32_t level)
{
    char text[256];
    json_t *ids = metadata_ids(info);
    for (uint32_t f = 0; f < info->field_count; f++) {
        promise_of_field(info, level, f, ids, text, sizeof text);
        fprintf(out, "  %s\n", text);
    }
    json_decref(ids);
}
