/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/cli/verify_boxes.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "format/fail.h"
#include "src/pipeline/make_box_sums.h"
#include "src/util/array.h"

/* Sums of other orders differ by less, as a part of what is summed; figures by one of their steps. */
static const double SUM_NOISE = 1e-9;

static bool is_near(double declared, double found, double scale)
{
    return fabs(declared - found) <= SUM_NOISE * scale;
}

static enum tetlod_status compare_parts(const struct tetlodi_box_sums *declared, const struct tetlodi_box_sums *found,
                                        struct tetlod_error *error)
{
    if (!is_near(declared->volume, found->volume, found->volume))
        return tetlodi_fail(error, TETLOD_ERR_STREAM,
                            "section KSUM says that the volume is %.9g, the finest level has %.9g in its box",
                            declared->volume, found->volume);
    for (uint32_t n = 1; n < (uint32_t)1 << declared->depth; n++)
        if (abs(declared->parts[n] - found->parts[n]) > 1)
            return tetlodi_fail(error, TETLOD_ERR_STREAM,
                                "section KSUM says that %u of 65535 parts of box %u lie in its first half, the finest "
                                "level has %u there", declared->parts[n], n, found->parts[n]);
    return TETLOD_OK;
}

/* Bounds may be further out than they need be by a step, not further in. */
static enum tetlod_status compare_values(const struct tetlodi_box_sums *declared, const struct tetlodi_box_sums *found,
                                         uint32_t component, struct tetlod_error *error)
{
    if (memcmp(declared->ranges[component], found->ranges[component], sizeof *declared->ranges) != 0)
        return tetlodi_fail(error, TETLOD_ERR_STREAM,
                            "section KSUM says that component %u is in %.9g .. %.9g, the finest level has %.9g .. %.9g",
                            component, declared->ranges[component][0], declared->ranges[component][1],
                            found->ranges[component][0], found->ranges[component][1]);
    for (uint32_t i = 0; i < (uint32_t)1 << declared->depths[component]; i++) {
        const uint32_t row = declared->firsts[component] + i;
        const bool same = declared->least[row] == found->least[row] && declared->greatest[row] == found->greatest[row];
        if (!same || abs(declared->means[row] - found->means[row]) > 1)
            return tetlodi_fail(error, TETLOD_ERR_STREAM,
                                "section KSUM says that component %u is in %u .. %u, %u on average, in box %u, the "
                                "finest level has %u .. %u and %u", component, declared->least[row],
                                declared->greatest[row], declared->means[row], i, found->least[row],
                                found->greatest[row], found->means[row]);
    }
    return TETLOD_OK;
}

static enum tetlod_status compare_regions(const struct tetlodi_box_sums *declared,
                                          const struct tetlodi_box_sums *found, struct tetlod_error *error)
{
    if (declared->region_count != found->region_count)
        return tetlodi_fail(error, TETLOD_ERR_STREAM, "section KSUM has sums of %u regions, the finest level has %u",
                            declared->region_count, found->region_count);
    for (uint32_t r = 0; r < found->region_count; r++)
        if (declared->regions[r][0] != found->regions[r][0] ||
            !is_near(declared->regions[r][1], found->regions[r][1], found->volume))
            return tetlodi_fail(error, TETLOD_ERR_STREAM,
                                "section KSUM says that region %.9g has the volume %.9g, the finest level has %.9g and "
                                "%.9g", declared->regions[r][0], declared->regions[r][1], found->regions[r][0],
                                found->regions[r][1]);
    for (size_t i = 0; i < (size_t)found->region_count * found->component_count; i++) {
        const double *a = declared->region_rows[i], *b = found->region_rows[i];
        if (a[0] != b[0] || a[1] != b[1] || !is_near(a[2], b[2], found->volume * fmax(fabs(b[0]), fabs(b[1]))))
            return tetlodi_fail(error, TETLOD_ERR_STREAM,
                                "section KSUM says that component %zu is in %.9g .. %.9g with the integral %.9g in "
                                "region %.9g, the finest level has %.9g .. %.9g and %.9g", i / found->region_count,
                                a[0], a[1], a[2], found->regions[i % found->region_count][0], b[0], b[1], b[2]);
    }
    return TETLOD_OK;
}

static enum tetlod_status compare(const struct tetlodi_box_sums *declared, const struct tetlodi_box_sums *found,
                                  struct tetlod_error *error)
{
    TETLOD_TRY(compare_parts(declared, found, error));
    for (uint32_t c = 0; c < declared->component_count; c++)
        TETLOD_TRY(compare_values(declared, found, c, error));
    return declared->region_count ? compare_regions(declared, found, error) : TETLOD_OK;
}

/* The numbers of the tetrahedra's regions, to be freed; NULL where levels keep none. */
static enum tetlod_status take_regions(const struct tetlod_file *file, double **out, struct tetlod_error *error)
{
    const struct tetlod_info *info = tetlod_info(file);
    uint32_t field = 0;
    *out = NULL;
    while (field < info->cell_field_count && !info->cell_fields[field].region)
        field++;
    if (field == info->cell_field_count || info->cell_fields[field].components != 1)
        return TETLOD_OK;
    *out = array_new(info->tets, sizeof **out);
    return *out ? tetlod_cells(file, field, *out, error)
                : tetlodi_fail_nomem(error, "the regions of the tetrahedra", info->tets * sizeof **out);
}

enum tetlod_status verify_boxes(const struct tetlod_file *file, const struct tetmesh *finest,
                                struct tetlod_error *error)
{
    struct tetlodi_box_sums declared, found = {0};
    double *regions = NULL;
    TETLOD_TRY(tetlodi_box_sums_read(file, &declared, error));
    enum tetlod_status status = TETLOD_OK;
    if (declared.component_count && tetlod_info(file)->lossless) {
        status = take_regions(file, &regions, error);
        if (status == TETLOD_OK)
            status = box_sums_like(&found, &declared, finest, regions, error);
        if (status == TETLOD_OK)
            status = compare(&declared, &found, error);
    }
    free(regions);
    tetlodi_box_sums_fini(&declared);
    tetlodi_box_sums_fini(&found);
    return status;
}
