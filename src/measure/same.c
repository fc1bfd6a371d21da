/* SPDX-License-Identifier: BSD-3-Clause */
/* Vertices of both meshes are ranked together by position and values; a tetrahedron is then its four sorted ranks and the
 * parity of the sorting. Vertices with the same bits have the same rank: nothing distinguishes them. */
#include "src/measure/same.h"

#include <stdlib.h>
#include <string.h>

#include "format/fail.h"
#include "src/util/array.h"

struct row {
    const double *numbers;
    uint32_t width, vertex; /* b's vertices follow a's */
};

struct key {
    uint32_t ranks[4], odd;
};

static int compare_rows(const void *left, const void *right)
{
    const struct row *a = left, *b = right;
    return memcmp(a->numbers, b->numbers, a->width * sizeof(double));
}

static int compare_keys(const void *left, const void *right)
{
    const struct key *a = left, *b = right;
    for (int i = 0; i < 4; i++)
        if (a->ranks[i] != b->ranks[i])
            return a->ranks[i] < b->ranks[i] ? -1 : 1;
    return (int)a->odd - (int)b->odd;
}

static void fill_rows(const struct tetmesh *mesh, const struct tetmesh *names, double *numbers, uint32_t width)
{
    for (size_t v = 0; v < mesh->vertex_count; v++) {
        double *out = numbers + v * width;
        memcpy(out, mesh->positions + 3 * v, 3 * sizeof *out);
        out += 3;
        for (uint32_t f = 0; f < names->field_count; f++) {
            const struct point_field *field = &mesh->fields[tetmesh_find_field(mesh, names->fields[f].name)];
            memcpy(out, field->values + v * field->components, field->components * sizeof *out);
            out += field->components;
        }
    }
}

/* The rank of every vertex, a's then b's, among the different rows. */
static enum tetlod_status rank_vertices(const struct tetmesh *a, const struct tetmesh *b, uint32_t width, uint32_t *ranks,
                                        struct tetlod_error *error)
{
    size_t count = (size_t)a->vertex_count + b->vertex_count;
    double *numbers = array_new(count * width, sizeof *numbers);
    struct row *rows = array_new(count, sizeof *rows);
    if (!numbers || !rows) {
        free(numbers);
        free(rows);
        return tetlodi_fail_nomem(error, "the comparison", count * (width * 8 + sizeof *rows));
    }
    fill_rows(a, b, numbers, width);
    fill_rows(b, b, numbers + (size_t)a->vertex_count * width, width);
    for (size_t v = 0; v < count; v++)
        rows[v] = (struct row){numbers + v * width, width, (uint32_t)v};
    qsort(rows, count, sizeof *rows, compare_rows);
    for (size_t i = 0; i < count; i++) {
        bool first = i == 0 || compare_rows(&rows[i - 1], &rows[i]) != 0;
        ranks[rows[i].vertex] = first ? (uint32_t)i : ranks[rows[i - 1].vertex];
    }
    free(numbers);
    free(rows);
    return TETLOD_OK;
}

static struct key *make_keys(const struct tetmesh *mesh, const uint32_t *ranks)
{
    struct key *keys = array_new(mesh->tet_count, sizeof *keys);
    for (size_t t = 0; t < mesh->tet_count && keys; t++) {
        struct key key = {{0}, 0};
        bool twins = false;
        for (int c = 0; c < 4; c++)
            key.ranks[c] = ranks[mesh->corners[4 * t + (size_t)c]];
        for (int i = 1; i < 4; i++)
            for (int j = i; j > 0 && key.ranks[j - 1] >= key.ranks[j]; j--) {
                uint32_t swap = key.ranks[j];
                twins |= key.ranks[j - 1] == key.ranks[j];
                key.ranks[j] = key.ranks[j - 1];
                key.ranks[j - 1] = swap;
                key.odd ^= 1;
            }
        key.odd &= !twins; // with two equal ones there is no parity
        keys[t] = key;
    }
    if (keys)
        qsort(keys, mesh->tet_count, sizeof *keys, compare_keys);
    return keys;
}

static enum tetlod_status compare_tets(const struct tetmesh *a, const struct tetmesh *b, const uint32_t *ranks,
                                       struct tetlod_error *error)
{
    struct key *in_a = make_keys(a, ranks), *in_b = make_keys(b, ranks + a->vertex_count);
    enum tetlod_status status = TETLOD_OK;
    uint32_t missing = 0;
    if (!in_a || !in_b)
        status = tetlodi_fail_nomem(error, "the comparison", (uint64_t)a->tet_count * 2 * sizeof *in_a);
    for (uint32_t t = 0; t < a->tet_count && status == TETLOD_OK; t++)
        missing += compare_keys(&in_a[t], &in_b[t]) != 0;
    if (missing)
        status = tetlodi_fail(error, TETLOD_ERR_MISMATCH,
                              "the finest level is not the input: vertices or tetrahedra differ in %u of %u places", missing,
                              a->tet_count);
    free(in_a);
    free(in_b);
    return status;
}

enum tetlod_status mesh_same(const struct tetmesh *a, const struct tetmesh *b, struct tetlod_error *error)
{
    uint32_t width = 3;
    if (a->vertex_count != b->vertex_count || a->tet_count != b->tet_count)
        return tetlodi_fail(error, TETLOD_ERR_MISMATCH,
                            "the finest level has %u vertices and %u tetrahedra, the input %u and %u", b->vertex_count,
                            b->tet_count, a->vertex_count, a->tet_count);
    if (a->position_type != b->position_type)
        return tetlodi_fail(error, TETLOD_ERR_MISMATCH, "the positions are of another type than the input's");
    for (uint32_t f = 0; f < b->field_count; f++) {
        const struct point_field *field = &b->fields[f];
        uint32_t other = tetmesh_find_field(a, field->name);
        if (other == TETLOD_NONE || a->fields[other].components != field->components || a->fields[other].type != field->type)
            return tetlodi_fail(error, TETLOD_ERR_MISMATCH, "the input has no field '%.100s' of that type", field->name);
        width += field->components;
    }
    uint32_t *ranks = array_new(2 * (size_t)a->vertex_count, sizeof *ranks);
    if (!ranks)
        return tetlodi_fail_nomem(error, "the comparison", 8 * (uint64_t)a->vertex_count);
    enum tetlod_status status = rank_vertices(a, b, width, ranks, error);
    if (status == TETLOD_OK)
        status = compare_tets(a, b, ranks, error);
    free(ranks);
    return status;
}
