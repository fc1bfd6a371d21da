/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/cli/extract_region.h"

#include <inttypes.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "format/fail.h"
#include "src/measure/region_error.h"
#include "src/report/promise.h"
#include "src/stream/level_mesh.h"
#include "src/stream/page_region.h"
#include "src/util/array.h"
#include "src/util/parallel.h"

/* Puts text behind what is there, as far as there is room. */
static void append(char *out, size_t size, const char *format, ...)
{
    size_t used = strlen(out);
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(out + used, size - used, format, arguments);
    va_end(arguments);
}

/* What the parts are, but for the error of the transition. */
static void print_parts(const struct tetlod_info *info, const struct region *region, const struct region_counts *counts,
                        char *out, size_t size)
{
    char coarse[300], fine[300];
    promise_print(info, region->coarse, coarse, sizeof coarse);
    promise_print(info, region->fine, fine, sizeof fine);
    out[0] = 0;
    append(out, size, "%" PRIu32 " tetrahedra of level %" PRIu32 ": %s; ", counts->tets[REGION_COARSE], region->coarse,
           coarse);
    append(out, size, "%" PRIu32 " of level %" PRIu32 ": %s; ", counts->tets[REGION_FINE], region->fine, fine);
    append(out, size, "%" PRIu32 " of the transition between them", counts->tets[REGION_TRANSITION]);
}

static void print_measured(const struct tetlod_info *info, const double *errors, char *out, size_t size)
{
    const char *before = ":";
    for (uint32_t f = 0; f < info->field_count; f++) {
        const struct tetlod_field *field = &info->fields[f];
        double range = field->range[1] - field->range[0];
        if (!field->controlled)
            continue;
        append(out, size, "%s %s %.3g %%", before, field->name, promise_percent(range > 0 ? errors[f] / range : 0));
        before = ",";
    }
    append(out, size, " (measured)");
}

static enum tetlod_status make(const struct forest *forest, struct tetlod_file *file, const struct region *region,
                               struct tetmesh *out, char *about,
                               size_t about_size, struct tetlod_error *error)
{
    const struct tetlod_info *info = forest_info(forest);
    struct region_counts counts;
    uint32_t *tets = NULL;
    double *errors = array_new(info->field_count, sizeof *errors);
    if (!errors)
        return tetlodi_fail_nomem(error, "a region", info->field_count * sizeof *errors);
    enum tetlod_status status = region_mesh(forest, region, NULL, out, &tets, &counts, error);
    if (status == TETLOD_OK)
        status = region_measure(forest, out, tets, parallel_cores(), NULL, errors, error);
    if (status == TETLOD_OK)
        status = level_mesh_cells_here(file, REGION_FIELD, tets, out, error);
    if (status == TETLOD_OK) {
        print_parts(info, region, &counts, about, about_size);
        print_measured(info, errors, about, about_size);
    }
    free(tets);
    free(errors);
    return status;
}

/* Out of the whole stream, in memory. */
static enum tetlod_status extract_whole(struct tetlod_file *file, const struct region *region, struct tetmesh *out,
                                        char *about, size_t about_size, struct tetlod_error *error)
{
    uint32_t levels = tetlod_info(file)->level_count;
    struct forest *forest = NULL;
    // the transition is measured against the finest level
    enum tetlod_status status = forest_new(&forest, file, levels - 1, error);
    while (status == TETLOD_OK && forest_levels(forest) < levels)
        status = forest_grow(forest, error);
    if (status == TETLOD_OK)
        status = make(forest, file, region, out, about, about_size, error);
    forest_free(forest);
    return status;
}

/* ---- pages */

/* Pages with no more bytes between them are fetched as one. */
enum { MAX_GAP = 24 << 10 };

/* Fetches all bytes that a set of pages is decoded from, at once. */
static enum tetlod_status fetch_pages(const struct stream_input *input, const struct tetlod_page_set *set,
                                      struct tetlod_error *error)
{
    uint32_t root = tetlod_info(input->file)->first_paged_level - 1;
    size_t before = tetlod_spans(input->file, TETLOD_NONE, root, NULL, 0, NULL, 0);
    size_t count = before + tetlod_page_set_spans(set, NULL, 0, MAX_GAP, NULL, 0);
    struct tetlod_span *spans = array_new(count, sizeof *spans);
    if (!spans)
        return tetlodi_fail_nomem(error, "a list of pages", count * sizeof *spans);
    tetlod_spans(input->file, TETLOD_NONE, root, NULL, 0, spans, before);
    tetlod_page_set_spans(set, NULL, 0, MAX_GAP, spans + before, count - before);
    enum tetlod_status status = stream_input_fetch(input, spans, count, error);
    free(spans);
    return status;
}

static enum tetlod_status decode_pages(const struct stream_input *input, const struct tetlod_page_set *set,
                                       const struct region *region, struct tetmesh *out, char *about,
                                       size_t about_size, struct tetlod_error *error)
{
    const struct tetlod_info *info = tetlod_info(input->file);
    struct region_counts counts;
    uint32_t *tets = NULL, transition = TETLOD_NONE;
    enum tetlod_status status = fetch_pages(input, set, error);
    if (status == TETLOD_OK)
        status = page_region_mesh(input->file, set, region, NULL, out, &tets, &counts, &transition, error);
    if (status == TETLOD_OK)
        status = level_mesh_cells_here(input->file, REGION_FIELD, tets, out, error);
    free(tets);
    if (status != TETLOD_OK)
        return status;
    print_parts(info, region, &counts, about, about_size);
    if (transition != TETLOD_NONE) {
        char promise[300];
        promise_print(info, transition, promise, sizeof promise);
        append(about, about_size, ": %s", promise);
    }
    return TETLOD_OK;
}

enum tetlod_status extract_region(const struct stream_input *input, const struct region *region, struct tetmesh *out,
                                  char *about, size_t about_size, struct tetlod_error *error)
{
    const struct tetlod_info *info = tetlod_info(input->file);
    struct tetlod_page_set *set;
    struct region of_pages = *region;
    *out = (struct tetmesh){0};
    if (!page_region_is(info, region->fine))
        return extract_whole(input->file, region, out, about, about_size, error);
    of_pages.coarse = page_region_outside(info, region->coarse);
    TETLOD_TRY(page_region_set(input->file, &of_pages, &set, error));
    enum tetlod_status status = decode_pages(input, set, &of_pages, out, about, about_size, error);
    tetlod_page_set_free(set);
    return status;
}
