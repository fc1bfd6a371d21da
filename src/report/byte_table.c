/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/report/byte_table.h"

#include <stdarg.h>
#include <string.h>

/* Lines for so many fields of each kind; smaller ones are added up. */
enum { MAX_LINES = 8 };

/* A part that takes this share of the stream dominates. */
static const double DOMINATES = 0.5;

/* Bits of a value that --field-bits 16 is compared with. */
enum { USUAL_BITS = 16 };

struct sums {
    uint64_t geometry, fields, cells, steps, rest; /* rest: index, metadata, order */
    uint64_t values;                               /* of fields: components times vertices of the original */
};

/* Bytes of all levels with one field, or with none. */
static uint64_t bytes_with(const struct tetlod_file *file, const uint32_t *fields, uint32_t count)
{
    struct tetlod_span spans[4]; // a level or a page at a time: few
    const struct tetlod_info *info = tetlod_info(file);
    uint64_t sum = 0;
    for (uint32_t from = TETLOD_NONE, to = 0; to < info->level_count; from = to++) {
        uint32_t pages = tetlod_page_count(file, to);
        for (uint32_t page = 0; page < pages || (page == 0 && !pages); page++) {
            size_t found = pages ? tetlod_page_spans(file, to, page, fields, count, spans, 4)
                                 : tetlod_spans(file, from, to, fields, count, spans, 4);
            for (size_t i = 0; i < found; i++)
                sum += spans[i].size;
        }
    }
    return sum;
}

static uint64_t field_bytes(const struct tetlod_file *file, uint32_t field)
{
    return bytes_with(file, &field, 1) - bytes_with(file, &(uint32_t){0}, 0);
}

static bool is_cells(const struct tetlod_section *section)
{
    return strcmp(section->tag, "CVAL") == 0 || strcmp(section->tag, "PVAL") == 0;
}

/* Where there are cells, which tetrahedra are whose. */
static uint64_t map_bytes(const struct tetlod_info *info)
{
    uint32_t map = info->cell_rows ? tetlod_section_index(info, "PMAP") : TETLOD_NONE;
    return map == TETLOD_NONE ? 0 : info->sections[map].stored;
}

static bool is_steps(const struct tetlod_section *section)
{
    static const char *const tags[] = {"TIME", "TVAL", "CTIM", "CSTP", "PTIM", "PSTP", "TOPO"};
    bool found = false;
    for (size_t i = 0; i < sizeof tags / sizeof *tags; i++)
        found |= strcmp(section->tag, tags[i]) == 0;
    return found;
}

static struct sums sum_up(const struct tetlod_file *file)
{
    const struct tetlod_info *info = tetlod_info(file);
    const uint64_t index = info->levels[0].offset;
    struct sums sums = {.geometry = bytes_with(file, &(uint32_t){0}, 0) - index,
                        .rest = info->bytes - info->levels[info->level_count - 1].end + index};
    for (uint32_t f = 0; f < info->field_count; f++) {
        sums.fields += field_bytes(file, f);
        sums.values += (uint64_t)info->fields[f].components * info->vertices;
    }
    for (uint32_t i = 0; i < info->section_count; i++) {
        const struct tetlod_section *section = &info->sections[i];
        bool steps = is_steps(section);
        sums.cells += is_cells(section) ? section->stored : 0;
        sums.steps += steps ? section->stored : 0;
        sums.rest -= is_cells(section) || steps ? section->stored : 0;
    }
    sums.cells += map_bytes(info);
    sums.rest -= map_bytes(info);
    return sums;
}

__attribute__((format(printf, 4, 5))) static void line(FILE *out, uint64_t bytes, uint64_t all, const char *format, ...)
{
    va_list list;
    va_start(list, format);
    fprintf(out, "%12llu %5.1f %%  ", (unsigned long long)bytes, 100.0 * (double)bytes / (double)all);
    vfprintf(out, format, list);
    fputc('\n', out);
    va_end(list);
}

static void print_fields(FILE *out, const struct tetlod_file *file, const struct sums *sums)
{
    const struct tetlod_info *info = tetlod_info(file);
    uint64_t rest = sums->fields;
    for (uint32_t f = 0; f < info->field_count && f < MAX_LINES; f++) {
        uint64_t bytes = field_bytes(file, f);
        line(out, bytes, info->bytes, "field %s", info->fields[f].name);
        rest -= bytes;
    }
    if (info->field_count > MAX_LINES)
        line(out, rest, info->bytes, "%u more fields", info->field_count - MAX_LINES);
}

static void print_cells(FILE *out, const struct tetlod_info *info, const struct sums *sums)
{
    uint64_t rest = sums->cells - map_bytes(info);
    uint32_t f = 0;
    for (uint32_t i = 0; i < info->section_count && f < info->cell_field_count && f < MAX_LINES; i++)
        if (is_cells(&info->sections[i])) {
            line(out, info->sections[i].stored, info->bytes, "cell field %s", info->cell_fields[f++].name);
            rest -= info->sections[i].stored;
        }
    if (f < info->cell_field_count)
        line(out, rest, info->bytes, "%u more cell fields", info->cell_field_count - f);
    if (map_bytes(info))
        line(out, map_bytes(info), info->bytes, "which tetrahedra make which cell");
}

static void print_table(FILE *out, const struct tetlod_file *file, const struct sums *sums)
{
    const struct tetlod_info *info = tetlod_info(file);
    fprintf(out, "%12s %7s\n", "bytes", "share");
    line(out, sums->geometry, info->bytes, "geometry: points and connectivity");
    print_fields(out, file, sums);
    print_cells(out, info, sums);
    if (sums->steps)
        line(out, sums->steps, info->bytes, "steps in time");
    line(out, sums->rest, info->bytes, "index, errors and metadata");
}

/* The largest cell field that is no region, or TETLOD_NONE. */
static uint32_t largest_cells(const struct tetlod_info *info, uint64_t *bytes)
{
    uint32_t largest = TETLOD_NONE, f = 0;
    *bytes = 0;
    for (uint32_t i = 0; i < info->section_count && f < info->cell_field_count; i++) {
        if (!is_cells(&info->sections[i]))
            continue;
        if (!info->cell_fields[f].region && info->sections[i].stored > *bytes) {
            largest = f;
            *bytes = info->sections[i].stored;
        }
        f++;
    }
    return largest;
}

static void advise(FILE *out, const char *program, const struct tetlod_info *info, const struct sums *sums)
{
    uint64_t largest, rounded = sums->values * USUAL_BITS / 8;
    uint32_t field = largest_cells(info, &largest);
    if ((double)sums->cells > DOMINATES * (double)info->bytes && field != TETLOD_NONE)
        fprintf(out,
                "%s: values of cells take %.0f %% of the stream, %llu bytes; --carry with the fields that you need "
                "leaves others out "
                "(without '%.60s': %llu bytes less)\n",
                program, 100.0 * (double)sums->cells / (double)info->bytes, (unsigned long long)sums->cells,
                info->cell_fields[field].name, (unsigned long long)largest);
    if ((double)sums->fields > DOMINATES * (double)info->bytes && info->lossless && rounded < sums->fields)
        fprintf(out,
                "%s: exact values of fields take %.0f %% of the stream; --field-bits %d saves at least %llu bytes\n",
                program, 100.0 * (double)sums->fields / (double)info->bytes, USUAL_BITS,
                (unsigned long long)(sums->fields - rounded));
}

void byte_table_print(FILE *out, FILE *advice, const char *program, const struct tetlod_file *file)
{
    const struct sums sums = sum_up(file);
    if (out)
        print_table(out, file, &sums);
    if (advice)
        advise(advice, program, tetlod_info(file), &sums);
}
