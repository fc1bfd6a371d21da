/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/mesh/space_order.h"

#include <stdlib.h>
#include <string.h>

#include "format/fail.h"
#include "src/mesh/hilbert.h"
#include "src/mesh/tet_geom.h"
#include "src/util/array.h"

/* Smaller meshes fit in the caches, so that their order does not matter. */
enum { LARGE_TETS = 1 << 18 };

/* A cube of as many points, numbered row by row, has neighbours that are about one layer apart. More than this many
 * layers is far. */
enum { FAR_LAYERS = 8 };

static uint32_t least_corner(const uint32_t *corners)
{
    uint32_t least = corners[0];
    for (int c = 1; c < 4; c++)
        least = corners[c] < least ? corners[c] : least;
    return least;
}

static uint32_t greatest_corner(const uint32_t *corners)
{
    uint32_t greatest = corners[0];
    for (int c = 1; c < 4; c++)
        greatest = corners[c] > greatest ? corners[c] : greatest;
    return greatest;
}

static bool is_lost(const struct tetmesh *mesh)
{
    if (mesh->tet_count < LARGE_TETS || mesh->parents)
        return false;
    uint32_t side = 1; // of that cube; not cbrt(), whose last digit may differ between machines
    while ((uint64_t)side * side * side < mesh->vertex_count)
        side++;
    uint32_t far = FAR_LAYERS * side * side, apart = 0, before = least_corner(mesh->corners);
    for (uint32_t t = 0; t < mesh->tet_count; t++) {
        const uint32_t *corners = mesh->corners + 4 * (size_t)t;
        uint32_t least = least_corner(corners), step = least > before ? least - before : before - least;
        apart += greatest_corner(corners) - least > far || step > far;
        before = least;
    }
    return apart > mesh->tet_count / 2;
}

/* Replaces the values by the same rows in the given order. */
static enum tetlod_status order_rows(double **io_values, uint32_t width, const uint32_t *order, uint32_t count,
                                     struct tetlod_error *error)
{
    double *rows = array_new((size_t)width * count, sizeof *rows);
    if (!rows)
        return tetlodi_fail_nomem(error, "the mesh in order", (uint64_t)width * count * sizeof *rows);
    for (uint32_t i = 0; i < count; i++)
        memcpy(rows + (size_t)i * width, *io_values + (size_t)order[i] * width, width * sizeof *rows);
    free(*io_values);
    *io_values = rows;
    return TETLOD_OK;
}

static enum tetlod_status order_points(struct tetmesh *mesh, struct tetlod_error *error)
{
    enum tetlod_status status;
    uint32_t count = mesh->vertex_count;
    uint32_t *order = array_new(count, sizeof *order), *number = array_new(count, sizeof *number);
    if (!order || !number)
        TETLOD_TRY_DONE(tetlodi_fail_nomem(error, "the order of points", 2 * (uint64_t)count * sizeof *order));
    TETLOD_TRY_DONE(hilbert_order(mesh->positions, count, order, error));
    TETLOD_TRY_DONE(order_rows(&mesh->positions, 3, order, count, error));
    for (uint32_t f = 0; f < mesh->field_count; f++)
        TETLOD_TRY_DONE(order_rows(&mesh->fields[f].values, mesh->fields[f].components, order, count, error));
    for (uint32_t i = 0; i < count; i++)
        number[order[i]] = i;
    for (size_t c = 0; c < 4 * (size_t)mesh->tet_count; c++)
        mesh->corners[c] = number[mesh->corners[c]];
    status = TETLOD_OK;
done:
    free(order);
    free(number);
    return status;
}

static bool is_before(const struct tetmesh *mesh, uint32_t a, uint32_t b)
{
    uint32_t own[4], other[4];
    sort_corners(mesh->corners + 4 * (size_t)a, own);
    sort_corners(mesh->corners + 4 * (size_t)b, other);
    for (int c = 1; c < 4; c++)
        if (own[c] != other[c])
            return own[c] < other[c];
    return false;
}

/* Sorts tetrahedra that have the same least corner: they are few. */
static void sort_star(const struct tetmesh *mesh, uint32_t *tets, uint32_t count)
{
    for (uint32_t i = 1; i < count; i++) {
        uint32_t tet = tets[i], k = i;
        for (; k && is_before(mesh, tet, tets[k - 1]); k--)
            tets[k] = tets[k - 1];
        tets[k] = tet;
    }
}

/* order[i] is the i-th tetrahedron by its corners in rising order. `begin`: [vertex_count + 1], zeros. */
static void list_tets(const struct tetmesh *mesh, uint32_t *begin, uint32_t *order)
{
    for (uint32_t t = 0; t < mesh->tet_count; t++)
        begin[least_corner(mesh->corners + 4 * (size_t)t) + 1]++;
    for (uint32_t v = 0; v < mesh->vertex_count; v++)
        begin[v + 1] += begin[v];
    for (uint32_t t = 0; t < mesh->tet_count; t++)
        order[begin[least_corner(mesh->corners + 4 * (size_t)t)]++] = t;
    for (uint32_t v = 0, from = 0; v < mesh->vertex_count; from = begin[v++])
        sort_star(mesh, order + from, begin[v] - from);
}

static enum tetlod_status order_tets(struct tetmesh *mesh, struct tetlod_error *error)
{
    enum tetlod_status status;
    uint32_t count = mesh->tet_count;
    uint32_t *begin = array_zero((size_t)mesh->vertex_count + 1, sizeof *begin);
    uint32_t *order = array_new(count, sizeof *order), *corners = array_new(4 * (size_t)count, sizeof *corners);
    if (!begin || !order || !corners)
        TETLOD_TRY_DONE(tetlodi_fail_nomem(error, "the order of tetrahedra", 5 * (uint64_t)count * sizeof *order));
    list_tets(mesh, begin, order);
    for (uint32_t t = 0; t < count; t++)
        memcpy(corners + 4 * (size_t)t, mesh->corners + 4 * (size_t)order[t], 4 * sizeof *corners);
    free(mesh->corners);
    mesh->corners = corners;
    corners = NULL;
    for (uint32_t f = 0; f < mesh->cell_field_count; f++)
        TETLOD_TRY_DONE(order_rows(&mesh->cell_fields[f].values, mesh->cell_fields[f].components, order, count, error));
    status = TETLOD_OK;
done:
    free(begin);
    free(order);
    free(corners);
    return status;
}

enum tetlod_status space_order_settle(struct tetmesh *mesh, struct tetlod_error *error)
{
    if (!is_lost(mesh))
        return TETLOD_OK;
    TETLOD_TRY(order_points(mesh, error));
    return order_tets(mesh, error);
}
