/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/mesh/sheets.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdlib.h>

#include "format/fail.h"
#include "src/mesh/adjacency.h"
#include "src/mesh/tet_geom.h"
#include "src/util/array.h"

static uint32_t root(uint32_t *body, uint32_t v)
{
    while (body[v] != v)
        v = body[v] = body[body[v]];
    return v;
}

void sheets_bodies(const uint32_t *corners, uint32_t tet_count, uint32_t vertex_count, uint32_t *out)
{
    for (uint32_t v = 0; v < vertex_count; v++)
        out[v] = v;
    for (size_t t = 0; t < tet_count; t++)
        for (int i = 1; i < 4; i++) {
            uint32_t a = root(out, corners[4 * t]), b = root(out, corners[4 * t + (size_t)i]);
            out[a < b ? b : a] = a < b ? a : b;
        }
    for (uint32_t v = 0; v < vertex_count; v++)
        out[v] = root(out, v);
}

int sheets_promised(const double *positions, const uint32_t *corners, const uint32_t *neighbours, uint32_t tet_count,
                    uint8_t *out)
{
    enum { GOOD = 1, FOLDED = 2 };
    double volume = 0;
    for (int pass = 0; pass < 2; pass++)
        for (size_t t = 0; t < tet_count; t++) {
            const double *p[4];
            for (int c = 0; c < 4; c++)
                p[c] = positions + 3 * (size_t)corners[4 * t + (size_t)c];
            if (pass == 0)
                volume += tet_volume6(p[0], p[1], p[2], p[3]);
            else
                out[t] = tet_orientation(p[0], p[1], p[2], p[3]) == (volume < 0 ? -1 : 1);
        }
    for (size_t slot = 0; slot < 4 * (size_t)tet_count; slot++)
        if (neighbours[slot] != TETLOD_NONE && out[slot / 4] & GOOD && out[neighbours[slot] / 4] & GOOD &&
            same_turn(corners, neighbours, slot))
            out[slot / 4] |= FOLDED;
    for (size_t t = 0; t < tet_count; t++)
        out[t] = out[t] == GOOD;
    return volume < 0 ? -1 : 1;
}

static enum tetlod_status find_promised(struct sheets *out, const struct tetmesh *mesh, const uint32_t *neighbours,
                                        uint32_t *own, struct tetlod_error *error)
{
    const uint32_t vertices = mesh->vertex_count, tets = mesh->tet_count;
    if (!neighbours)
        TETLOD_TRY(adjacency_build(mesh->corners, tets, vertices, own, NULL, error));
    neighbours = neighbours ? neighbours : own;
    TETLOD_TRY(orient(&out->oriented, mesh->positions, mesh->corners, vertices, tets, neighbours, error));
    const uint32_t *corners = out->oriented.corners ? out->oriented.corners : mesh->corners;
    if (out->oriented.corners) // others are opposite the faces
        TETLOD_TRY(adjacency_build(corners, tets, vertices, own, NULL, error));
    neighbours = out->oriented.corners ? own : neighbours;
    out->orientation = sheets_promised(mesh->positions, corners, neighbours, tets, out->promised);
    return TETLOD_OK;
}

enum tetlod_status sheets_find(struct sheets *out, const struct tetmesh *mesh, const uint32_t *neighbours,
                               struct tetlod_error *error)
{
    uint32_t *own = array_new(mesh->tet_count, 4 * sizeof *own);
    *out = (struct sheets){.promised = array_new(mesh->tet_count, 1)};
    enum tetlod_status status =
        own && out->promised ? find_promised(out, mesh, neighbours, own, error)
                             : tetlodi_fail_nomem(error, "the sheets", 17 * (uint64_t)mesh->tet_count);
    free(own);
    if (status != TETLOD_OK)
        sheets_fini(out);
    return status;
}

void sheets_fini(struct sheets *sheets)
{
    free(sheets->promised);
    oriented_fini(&sheets->oriented);
    *sheets = (struct sheets){0};
}
