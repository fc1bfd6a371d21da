/* SPDX-License-Identifier: BSD-3-Clause */
#include "tests/ancestry.h"

#include <stdlib.h>
#include <string.h>

#include "format/fail.h"
#include "src/mesh/adjacency.h"
#include "src/util/array.h"

enum tetlod_status ancestry_init(struct ancestry *ancestry, const struct contraction_log *log,
                               const struct tetmesh *original, struct tetlod_error *error)
{
    uint32_t n = original->vertex_count, nodes = n + log->count;
    *ancestry = (struct ancestry){.log = log,
                                  .original = original,
                                  .parent = array_new(nodes, sizeof(uint32_t)),
                                  .ancestor = array_new(n, sizeof(uint32_t)),
                                  .neighbours = array_new(original->tet_count, 4 * sizeof(uint32_t))};
    enum tetlod_status status = TETLOD_OK;
    if (!ancestry->parent || !ancestry->ancestor || !ancestry->neighbours)
        status = tetlodi_fail_nomem(error, "the ancestry",
                                    4 * ((uint64_t)nodes + n + 4 * (uint64_t)original->tet_count));
    if (status == TETLOD_OK)
        status = adjacency_build(original->corners, original->tet_count, n, ancestry->neighbours, NULL, error);
    if (status != TETLOD_OK) {
        ancestry_fini(ancestry);
        return status;
    }
    memset(ancestry->parent, 0xff, nodes * sizeof(uint32_t));
    for (uint32_t c = 0; c < log->count; c++)
        for (int i = 0; i < 4; i++)
            if (log->children[4 * (size_t)c + i] != TETLOD_NONE)
                ancestry->parent[log->children[4 * (size_t)c + i]] = n + c;
    for (uint32_t v = 0; v < n; v++)
        ancestry->ancestor[v] = v;
    return TETLOD_OK;
}

void ancestry_fini(struct ancestry *ancestry)
{
    free(ancestry->parent);
    free(ancestry->ancestor);
    free(ancestry->neighbours);
    *ancestry = (struct ancestry){0};
}

void ancestry_level_fini(struct ancestry_level *level)
{
    tetmesh_fini(&level->mesh);
    free(level->nodes);
    free(level->origin);
    free(level->image);
    free(level->standing);
    free(level->neighbours);
    *level = (struct ancestry_level){0};
}

static void climb(struct ancestry *ancestry, uint32_t contractions)
{
    uint32_t n = ancestry->original->vertex_count, first_later = n + contractions;
    for (uint32_t v = 0; v < n; v++) {
        uint32_t node = ancestry->ancestor[v], up;
        while ((up = ancestry->parent[node]) < first_later) // TETLOD_NONE is greater, too
            node = up;
        ancestry->ancestor[v] = node;
    }
    ancestry->contractions = contractions;
}

static bool four_different(const uint32_t c[4])
{
    return c[0] != c[1] && c[0] != c[2] && c[0] != c[3] && c[1] != c[2] && c[1] != c[3] && c[2] != c[3];
}

static uint32_t count_alive(const struct ancestry *ancestry)
{
    uint32_t alive = 0;
    for (size_t t = 0; t < ancestry->original->tet_count; t++) {
        const uint32_t *corners = ancestry->original->corners + 4 * t;
        uint32_t c[4];
        for (int i = 0; i < 4; i++)
            c[i] = ancestry->ancestor[corners[i]];
        alive += four_different(c);
    }
    return alive;
}

/* Numbers the living nodes in the order of the first tetrahedron that has them. */
static void fill_tets(const struct ancestry *ancestry, struct ancestry_level *level, uint32_t *number)
{
    struct tetmesh *mesh = &level->mesh;
    for (uint32_t t = 0; t < ancestry->original->tet_count; t++) {
        uint32_t c[4];
        for (int i = 0; i < 4; i++)
            c[i] = ancestry->ancestor[ancestry->original->corners[4 * (size_t)t + i]];
        level->image[t] = TETLOD_NONE;
        if (!four_different(c))
            continue;
        for (int i = 0; i < 4; i++) {
            if (number[c[i]] == TETLOD_NONE) {
                level->nodes[mesh->vertex_count] = c[i];
                number[c[i]] = mesh->vertex_count++;
            }
            mesh->corners[4 * (size_t)mesh->tet_count + i] = number[c[i]];
        }
        level->image[t] = mesh->tet_count;
        level->origin[mesh->tet_count++] = t;
    }
}

/* Through a tetrahedron that is gone: by the face `slot` one comes in and, as that face has three different corners,
 * exactly one of them is the corner across it as well. The faces across these two corners have become one. */
static uint32_t pass_through(const struct ancestry *ancestry, uint32_t slot)
{
    const uint32_t *corners = ancestry->original->corners + (slot & ~(size_t)3);
    for (uint32_t c = 0; c < 4; c++)
        if (c != (slot & 3) && ancestry->ancestor[corners[c]] == ancestry->ancestor[corners[slot & 3]])
            return ancestry->neighbours[(slot & ~UINT32_C(3)) + c];
    return TETLOD_NONE;
}

/* What is across each face now: what was there at the last moment or, where that is gone, what is behind it. */
static void join_neighbours(struct ancestry *ancestry, struct ancestry_level *level)
{
    for (size_t slot = 0; slot < 4 * (size_t)level->mesh.tet_count; slot++) {
        uint32_t *across = &ancestry->neighbours[4 * (size_t)level->origin[slot / 4] + slot % 4];
        while (*across != TETLOD_NONE && level->image[*across / 4] == TETLOD_NONE)
            *across = pass_through(ancestry, *across);
        level->neighbours[slot] = *across == TETLOD_NONE ? TETLOD_NONE : 4 * level->image[*across / 4] + *across % 4;
    }
}

static void fill_rows(double *out, const double *original, const double *made, uint32_t width, const uint32_t *nodes,
                      uint32_t count, uint32_t vertices)
{
    for (uint32_t v = 0; v < count; v++) {
        const double *from = nodes[v] < vertices ? original + (size_t)nodes[v] * width
                                                 : made + (size_t)(nodes[v] - vertices) * width;
        memcpy(out + (size_t)v * width, from, width * sizeof *out);
    }
}

enum tetlod_status ancestry_level(struct ancestry *ancestry, uint32_t contractions, struct ancestry_level *out,
                                struct tetlod_error *error)
{
    const struct tetmesh *original = ancestry->original;
    const struct contraction_log *log = ancestry->log;
    uint32_t n = original->vertex_count, nodes = n + log->count;
    uint32_t *number = array_new(nodes, sizeof *number); // [node] vertex of the level, or TETLOD_NONE
    climb(ancestry, contractions);
    uint32_t tets = count_alive(ancestry);
    *out = (struct ancestry_level){.nodes = array_new(n, sizeof(uint32_t)),
                                 .origin = array_new(tets, sizeof(uint32_t)),
                                 .image = array_new(original->tet_count, sizeof(uint32_t)),
                                 .standing = array_new(n, sizeof(uint32_t)),
                                 .neighbours = array_new(tets, 4 * sizeof(uint32_t))};
    out->mesh.position_type = original->position_type;
    out->mesh.corners = array_new(tets, 4 * sizeof(uint32_t));
    enum tetlod_status status = TETLOD_OK;
    if (!out->nodes || !out->origin || !out->image || !out->standing || !out->neighbours || !out->mesh.corners ||
        !number)
        TETLOD_TRY_DONE(tetlodi_fail_nomem(error, "a level", 4 * ((uint64_t)n + 10 * (uint64_t)tets + nodes)));
    memset(number, 0xff, nodes * sizeof *number);
    fill_tets(ancestry, out, number);
    join_neighbours(ancestry, out);
    for (uint32_t v = 0; v < n; v++)
        out->standing[v] = number[ancestry->ancestor[v]];
    uint32_t count = out->mesh.vertex_count;
    out->mesh.positions = array_new(count, 3 * sizeof(double));
    if (!out->mesh.positions)
        TETLOD_TRY_DONE(tetlodi_fail_nomem(error, "a level", 24 * (uint64_t)count));
    fill_rows(out->mesh.positions, original->positions, log->positions, 3, out->nodes, count, n);
    for (uint32_t f = 0; f < original->field_count; f++) {
        const struct point_field *field = &original->fields[f];
        TETLOD_TRY_DONE(tetmesh_add_field(&out->mesh, field->name, field->components, field->type, error));
        fill_rows(out->mesh.fields[f].values, field->values, log->fields[f].values, field->components,
                  out->nodes, count, n);
    }
done:
    free(number);
    if (status != TETLOD_OK)
        ancestry_level_fini(out);
    return status;
}
