/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/mesh/tet_clean.h"

#include <stdlib.h>
#include <string.h>

#include "format/fail.h"
#include "src/mesh/tet_geom.h"
#include "src/util/array.h"

static size_t hash_corners(const uint32_t *sorted, size_t mask)
{
    uint64_t hash = 0;
    for (int c = 0; c < 4; c++)
        hash = (hash ^ sorted[c]) * UINT64_C(0x9e3779b97f4a7c15), hash ^= hash >> 31;
    return (size_t)hash & mask;
}

/* Whether a kept tetrahedron has these corners; else it is remembered as one. */
static bool is_duplicate(const struct tetmesh *mesh, uint32_t *table, size_t mask, uint32_t tet)
{
    uint32_t sorted[4], other[4];
    sort_corners(mesh->corners + 4 * (size_t)tet, sorted);
    size_t at = hash_corners(sorted, mask);
    for (; table[at] != TETLOD_NONE; at = (at + 1) & mask) {
        sort_corners(mesh->corners + 4 * (size_t)table[at], other);
        if (memcmp(sorted, other, sizeof sorted) == 0)
            return true;
    }
    table[at] = tet;
    return false;
}

static bool is_degenerate(const struct tetmesh *mesh, uint32_t tet)
{
    const uint32_t *c = mesh->corners + 4 * (size_t)tet;
    const double *p[4];
    for (int i = 0; i < 4; i++) {
        if (c[i] >= mesh->vertex_count)
            return false; // validating says so
        for (int j = 0; j < i; j++)
            if (c[i] == c[j])
                return true;
        p[i] = mesh->positions + 3 * (size_t)c[i];
    }
    return tet_orientation(p[0], p[1], p[2], p[3]) == 0;
}

static void move_tet(struct tetmesh *mesh, uint32_t from, uint32_t to)
{
    if (from == to)
        return;
    memcpy(mesh->corners + 4 * (size_t)to, mesh->corners + 4 * (size_t)from, 4 * sizeof *mesh->corners);
    if (mesh->parents)
        mesh->parents[to] = mesh->parents[from];
    for (uint32_t f = 0; f < mesh->cell_field_count; f++) {
        size_t width = mesh->cell_fields[f].components;
        double *values = mesh->cell_fields[f].values;
        memcpy(values + to * width, values + from * width, width * sizeof *values);
    }
}

enum tetlod_status tet_clean(struct tetmesh *mesh, uint64_t *io_dropped, struct tetlod_error *error)
{
    size_t mask = 1;
    uint32_t kept = 0;
    while (mask < 2 * (size_t)mesh->tet_count)
        mask = 2 * mask + 1;
    uint32_t *table = array_new(mask + 1, sizeof *table);
    if (!table)
        return tetlodi_fail_nomem(error, "the search for duplicates", (mask + 1) * sizeof *table);
    memset(table, 0xff, (mask + 1) * sizeof *table); // TETLOD_NONE
    for (uint32_t t = 0; t < mesh->tet_count; t++) {
        move_tet(mesh, t, kept); // the table holds numbers after the move
        if (!is_degenerate(mesh, kept) && !is_duplicate(mesh, table, mask, kept))
            kept++;
    }
    *io_dropped += mesh->tet_count - kept;
    mesh->tet_count = kept;
    free(table);
    return TETLOD_OK;
}
