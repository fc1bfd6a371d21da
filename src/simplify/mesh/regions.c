/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/simplify/mesh/regions.h"

#include <stdlib.h>

#include "format/fail.h"
#include "src/simplify/mesh/working.h"
#include "src/util/array.h"

enum { SEEN = 1, SEVERAL = 2 };

enum tetlod_status regions_fix(const struct tetmesh *mesh, const double *regions, const uint32_t *vertex,
                               uint8_t *flags,
                               struct tetlod_error *error)
{
    if (!regions)
        return TETLOD_OK;
    uint8_t *marks = array_zero(mesh->vertex_count, 1);
    double *first = array_new(mesh->vertex_count, sizeof *first);
    enum tetlod_status status = TETLOD_OK;
    if (!marks || !first)
        status = tetlodi_fail_nomem(error, "the regions", mesh->vertex_count * (uint64_t)9);
    for (size_t c = 0; c < 4 * (size_t)mesh->tet_count && status == TETLOD_OK; c++) {
        uint32_t v = mesh->corners[c];
        double region = regions[c / 4];
        if (!marks[v])
            first[v] = region;
        marks[v] |= first[v] == region ? SEEN : SEVERAL;
    }
    for (uint32_t i = 0; i < mesh->vertex_count && status == TETLOD_OK; i++)
        if (marks[vertex ? vertex[i] : i] & SEVERAL)
            flags[i] |= VERTEX_FIXED;
    free(marks);
    free(first);
    return status;
}

void regions_fix_vertices(uint32_t vertex_count, const bool *fixed, const uint32_t *vertex, uint8_t *flags)
{
    for (uint32_t i = 0; i < vertex_count && fixed; i++)
        if (fixed[vertex ? vertex[i] : i])
            flags[i] |= VERTEX_FIXED;
}
