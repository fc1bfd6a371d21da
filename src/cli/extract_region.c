/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/cli/extract_region.h"

#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "format/fail.h"
#include "src/measure/region_error.h"
#include "src/stream/level_mesh.h"
#include "src/report/promise.h"
#include "src/util/array.h"
#include "src/util/parallel.h"

static void print_about(const struct tetlod_info *info, const struct region *region, const struct region_counts *counts,
                        const double *errors, char *out, size_t size)
{
    char coarse[300], fine[300];
    promise_print(info, region->coarse, coarse, sizeof coarse);
    promise_print(info, region->fine, fine, sizeof fine);
    int used = snprintf(out, size,
                        "%" PRIu32 " tetrahedra of level %" PRIu32 ": %s; %" PRIu32 " of level %" PRIu32 ": %s; %" PRIu32 " of the transition between them:",
                        counts->tets[REGION_COARSE], region->coarse, coarse, counts->tets[REGION_FINE], region->fine, fine, counts->tets[REGION_TRANSITION]);
    bool any = false;
    for (uint32_t f = 0; f < info->field_count && used > 0 && (size_t)used < size; f++) {
        const struct tetlod_field *field = &info->fields[f];
        double range = field->range[1] - field->range[0];
        if (!field->controlled)
            continue;
        used += snprintf(out + used, size - (size_t)used, "%s %s %.3g %%", any ? "," : "", field->name,
                         promise_percent(range > 0 ? errors[f] / range : 0));
        any = true;
    }
    if (used > 0 && (size_t)used < size)
        snprintf(out + used, size - (size_t)used, " (measured)");
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
    if (status == TETLOD_OK)
        print_about(info, region, &counts, errors, about, about_size);
    free(tets);
    free(errors);
    return status;
}

enum tetlod_status extract_region(struct tetlod_file *file, const struct region *region, struct tetmesh *out,
                                  char *about,
                                  size_t about_size, struct tetlod_error *error)
{
    uint32_t levels = tetlod_info(file)->level_count;
    struct forest *forest = NULL;
    *out = (struct tetmesh){0};
    // the transition is measured against the finest level
    enum tetlod_status status = forest_new(&forest, file, levels - 1, error);
    while (status == TETLOD_OK && forest_levels(forest) < levels)
        status = forest_grow(forest, error);
    if (status == TETLOD_OK)
        status = make(forest, file, region, out, about, about_size, error);
    forest_free(forest);
    return status;
}
