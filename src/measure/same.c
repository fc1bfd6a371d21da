/* SPDX-License-Identifier: BSD-3-Clause */
/* Vertices of both meshes are ranked together by position and values; a tetrahedron is then its four sorted ranks, the
 * parity of the sorting, and the rank of its own values. What has the same bits has the same rank: nothing
 * distinguishes it. */
#include "src/measure/same.h"

#include <stdlib.h>
#include <string.h>

#include "format/fail.h"
#include "src/util/array.h"

struct row {
    const double *numbers;
    uint32_t width, number; /* b's vertices, or tetrahedra, follow a's */
};

struct key {
    uint32_t ranks[4], values, odd, tet;
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
    if (a->values != b->values)
        return a->values < b->values ? -1 : 1;
    return (int)a->odd - (int)b->odd;
}

/* Rows of vertices: position and values; of tetrahedra: values. Those of the fields that `names` has. */
static void fill_rows(const struct tetmesh *mesh, const struct tetmesh *names, bool cell, double *numbers,
                      uint32_t width)
{
    const struct point_field *fields = cell ? mesh->cell_fields : mesh->fields;
    uint32_t field_count = cell ? names->cell_field_count : names->field_count, at = cell ? 0 : 3;
    size_t count = cell ? mesh->tet_count : mesh->vertex_count;
    for (size_t i = 0; i < count && !cell; i++)
        memcpy(numbers + i * width, mesh->positions + 3 * i, 3 * sizeof *numbers);
    for (uint32_t f = 0; f < field_count; f++) {
        const struct point_field *field = cell ? &fields[tetmesh_find_cell_field(mesh, names->cell_fields[f].name)]
                                               : &fields[tetmesh_find_field(mesh, names->fields[f].name)];
        for (size_t i = 0; i < count; i++)
            memcpy(numbers + i * width + at, field->values + i * field->components,
                   field->components * sizeof *numbers);
        at += field->components;
    }
}

/* The rank of every vertex, or of every tetrahedron's values, a's then b's, among the different rows. */
static enum tetlod_status rank_rows(const struct tetmesh *a, const struct tetmesh *b, const struct tetmesh *names,
                                    bool cell, uint32_t width, uint32_t *ranks, struct tetlod_error *error)
{
    size_t first = cell ? a->tet_count : a->vertex_count, count = first + (cell ? b->tet_count : b->vertex_count);
    double *numbers = array_new(count * width, sizeof *numbers);
    struct row *rows = array_new(count, sizeof *rows);
    if (!numbers || !rows) {
        free(numbers);
        free(rows);
        return tetlodi_fail_nomem(error, "the comparison", count * (width * 8 + sizeof *rows));
    }
    fill_rows(a, names, cell, numbers, width);
    fill_rows(b, names, cell, numbers + first * width, width);
    for (size_t i = 0; i < count; i++)
        rows[i] = (struct row){numbers + i * width, width, (uint32_t)i};
    qsort(rows, count, sizeof *rows, compare_rows);
    for (size_t i = 0; i < count; i++) {
        bool is_new = i == 0 || compare_rows(&rows[i - 1], &rows[i]) != 0;
        ranks[rows[i].number] = is_new ? (uint32_t)i : ranks[rows[i - 1].number];
    }
    free(numbers);
    free(rows);
    return TETLOD_OK;
}

static struct key *make_keys(const struct tetmesh *mesh, const uint32_t *ranks, const uint32_t *values)
{
    struct key *keys = array_new(mesh->tet_count, sizeof *keys);
    for (size_t t = 0; t < mesh->tet_count && keys; t++) {
        struct key key = {{0}, values ? values[t] : 0, 0, (uint32_t)t};
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

/* `values`: the ranks of the tetrahedra's own values, or NULL. */
static enum tetlod_status compare_tets(const struct tetmesh *a, const struct tetmesh *b, const uint32_t *ranks,
                                       const uint32_t *values,
                                       struct tetlod_error *error)
{
    struct key *in_a = make_keys(a, ranks, values), *in_b = make_keys(b, ranks + a->vertex_count,
                                                                      values ? values + a->tet_count : NULL);
    enum tetlod_status status = TETLOD_OK;
    uint32_t missing = 0;
    if (!in_a || !in_b)
        status = tetlodi_fail_nomem(error, "the comparison", (uint64_t)a->tet_count * 2 * sizeof *in_a);
    for (uint32_t t = 0; t < a->tet_count && status == TETLOD_OK; t++)
        missing += compare_keys(&in_a[t], &in_b[t]) != 0;
    if (missing)
        status = tetlodi_fail(error, TETLOD_ERR_MISMATCH,
                              "the finest level is not the input: vertices%s or tetrahedra differ in %u of %u places",
                              values ? ", values of cells" : "", missing, a->tet_count);
    free(in_a);
    free(in_b);
    return status;
}

/* Whether `a` has all fields of `b`; *width grows by their components. */
static enum tetlod_status check_fields(const struct tetmesh *a, const struct tetmesh *b, bool cell, uint32_t *width,
                                       struct tetlod_error *error)
{
    uint32_t count = cell ? b->cell_field_count : b->field_count;
    for (uint32_t f = 0; f < count; f++) {
        const struct point_field *field = cell ? &b->cell_fields[f] : &b->fields[f];
        uint32_t found = cell ? tetmesh_find_cell_field(a, field->name) : tetmesh_find_field(a, field->name);
        const struct point_field *other = found == TETLOD_NONE ? NULL
                                          : cell               ? &a->cell_fields[found]
                                                               : &a->fields[found];
        if (!other || other->components != field->components ||
            (field->is_integer ? !other->is_integer : other->type != field->type))
            return tetlodi_fail(error, TETLOD_ERR_MISMATCH, "the input has no field '%.100s'%s of that type",
                                field->name,
                                cell ? " of cells" : "");
        *width += field->components;
    }
    return TETLOD_OK;
}

enum tetlod_status mesh_same(const struct tetmesh *a, const struct tetmesh *b, struct tetlod_error *error)
{
    uint32_t width = 3, cell_width = 0, *ranks = NULL, *values = NULL;
    enum tetlod_status status;
    if (a->vertex_count != b->vertex_count || a->tet_count != b->tet_count)
        return tetlodi_fail(error, TETLOD_ERR_MISMATCH,
                            "the finest level has %u vertices and %u tetrahedra, the input %u and %u", b->vertex_count,
                            b->tet_count, a->vertex_count, a->tet_count);
    if (a->position_type != b->position_type)
        return tetlodi_fail(error, TETLOD_ERR_MISMATCH, "the positions are of another type than the input's");
    TETLOD_TRY(check_fields(a, b, false, &width, error));
    TETLOD_TRY(check_fields(a, b, true, &cell_width, error));
    ranks = array_new(2 * (size_t)a->vertex_count, sizeof *ranks);
    values = cell_width ? array_new(2 * (size_t)a->tet_count, sizeof *values) : NULL;
    if (!ranks || (cell_width && !values)) {
        status = tetlodi_fail_nomem(error, "the comparison", 8 * ((uint64_t)a->vertex_count + a->tet_count));
        goto done;
    }
    TETLOD_TRY_DONE(rank_rows(a, b, b, false, width, ranks, error));
    if (values)
        TETLOD_TRY_DONE(rank_rows(a, b, b, true, cell_width, values, error));
    status = compare_tets(a, b, ranks, values, error);
done:
    free(ranks);
    free(values);
    return status;
}

static bool has_twins(const struct key *key)
{
    return key->ranks[0] == key->ranks[1] || key->ranks[1] == key->ranks[2] || key->ranks[2] == key->ranks[3];
}

/* The corners of a tetrahedron of a are those of the same rank of one of b. False if one is another vertex already. */
static bool pair_corners(const uint32_t *corners, const uint32_t *ranks, const uint32_t *others,
                         const uint32_t *other_ranks, uint32_t *out)
{
    bool good = true;
    for (int c = 0; c < 4; c++) {
        int other = 0;
        while (other_ranks[others[other]] != ranks[corners[c]])
            other++;
        if (out[corners[c]] == TETLOD_NONE)
            out[corners[c]] = others[other];
        good = good && out[corners[c]] == others[other];
    }
    return good;
}

/* Which vertex of b is which of a, by the tetrahedra that they are in; false if no such order is found. In those of two
 * corners at one place, which nobody can tell apart, only vertices that are in no other are taken. */
static bool pair_vertices(const struct tetmesh *a, const struct tetmesh *b, const uint32_t *ranks,
                          const struct key *in_a, const struct key *in_b, uint32_t *out)
{
    bool good = true;
    memset(out, 0xff, a->vertex_count * sizeof *out); // TETLOD_NONE
    for (int twins = 0; twins < 2; twins++)
        for (size_t t = 0; t < a->tet_count && good; t++)
            if (has_twins(&in_a[t]) == twins)
                good = compare_keys(&in_a[t], &in_b[t]) == 0 &&
                    (pair_corners(a->corners + 4 * (size_t)in_a[t].tet, ranks, b->corners + 4 * (size_t)in_b[t].tet,
                                  ranks + a->vertex_count, out) || twins);
    for (uint32_t v = 0; v < a->vertex_count; v++)
        good = good && out[v] != TETLOD_NONE;
    return good;
}

static enum tetlod_status put_in_order(const struct tetmesh *a, struct tetmesh *b, const uint32_t *order,
                                       struct tetlod_error *error)
{
    for (uint32_t f = 0; f < b->field_count; f++) {
        const size_t width = b->fields[f].components;
        double *values = array_new(b->vertex_count * width, sizeof *values);
        if (!values)
            return tetlodi_fail_nomem(error, "the comparison", b->vertex_count * width * sizeof *values);
        for (size_t v = 0; v < b->vertex_count; v++)
            memcpy(values + v * width, b->fields[f].values + order[v] * width, width * sizeof *values);
        free(b->fields[f].values);
        b->fields[f].values = values;
    }
    memcpy(b->positions, a->positions, a->vertex_count * 3 * sizeof *a->positions);
    memcpy(b->corners, a->corners, a->tet_count * 4 * sizeof *a->corners);
    return TETLOD_OK;
}

bool mesh_same_order(const struct tetmesh *a, const struct tetmesh *b)
{
    return a->vertex_count == b->vertex_count && a->tet_count == b->tet_count &&
        memcmp(a->positions, b->positions, a->vertex_count * 3 * sizeof *a->positions) == 0 &&
        memcmp(a->corners, b->corners, a->tet_count * 4 * sizeof *a->corners) == 0;
}

enum tetlod_status mesh_take_order(const struct tetmesh *a, struct tetmesh *b, struct tetlod_error *error)
{
    static const struct tetmesh no_fields = {0};
    if (a->vertex_count != b->vertex_count || a->tet_count != b->tet_count || mesh_same_order(a, b))
        return TETLOD_OK;
    uint32_t *ranks = array_new(2 * (size_t)a->vertex_count, sizeof *ranks);
    uint32_t *order = array_new(a->vertex_count, sizeof *order);
    struct key *in_a = NULL, *in_b = NULL;
    enum tetlod_status status = ranks && order ? rank_rows(a, b, &no_fields, false, 3, ranks, error)
                                               : tetlodi_fail_nomem(error, "the comparison", a->vertex_count * 12ull);
    if (status == TETLOD_OK) {
        in_a = make_keys(a, ranks, NULL);
        in_b = make_keys(b, ranks + a->vertex_count, NULL);
        if (!in_a || !in_b)
            status = tetlodi_fail_nomem(error, "the comparison", (uint64_t)a->tet_count * 2 * sizeof *in_a);
        else if (pair_vertices(a, b, ranks, in_a, in_b, order))
            status = put_in_order(a, b, order, error);
    }
    free(in_a);
    free(in_b);
    free(ranks);
    free(order);
    return status;
}
