/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/measure/walk.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "format/fail.h"
#include "src/mesh/tet_geom.h"
#include "src/util/array.h"

/* A point this far outside by a barycentric weight is on the face, if nothing is behind it; this far it is inside. The rounding of
 * well shaped tetrahedra is far below either. */
static const double ON_FACE = -1e-9, INSIDE = -1e-13;

enum tetlod_status walker_init(struct walker *walker, const struct coarsening *mesh, struct tetlod_error *error)
{
    size_t values = 0;
    for (uint32_t f = 0; f < mesh->field_count; f++)
        values += 4 * (size_t)mesh->fields[f].components;
    *walker = (struct walker){.mesh = mesh,
                              .cells = array_new(WALK_CELLS, sizeof *walker->cells),
                              .values = array_new(WALK_CELLS, values * sizeof(double))};
    if (!walker->cells || !walker->values) {
        walker_fini(walker);
        return tetlodi_fail_nomem(error, "the walk", WALK_CELLS * (sizeof *walker->cells + 8 * values));
    }
    for (size_t i = 0; i < WALK_CELLS; i++)
        walker->cells[i].values = walker->values + i * values;
    walker_reset(walker);
    return TETLOD_OK;
}

void walker_fini(struct walker *walker)
{
    free(walker->cells);
    free(walker->values);
    free(walker->seen);
    free(walker->table);
    *walker = (struct walker){0};
}

void walker_reset(struct walker *walker)
{
    for (size_t i = 0; i < WALK_CELLS; i++)
        walker->cells[i].tet = TETLOD_NONE;
}

static void cross(const double a[3], const double b[3], double factor, double out[3])
{
    out[0] = (a[1] * b[2] - a[2] * b[1]) * factor;
    out[1] = (a[2] * b[0] - a[0] * b[2]) * factor;
    out[2] = (a[0] * b[1] - a[1] * b[0]) * factor;
}

static void fill_cell(const struct coarsening *mesh, struct walk_cell *cell, uint32_t tet)
{
    double edges[3][3], *values = cell->values;
    cell->tet = tet;
    memcpy(cell->slots, mesh->corners + 4 * (size_t)tet, sizeof cell->slots);
    memcpy(cell->origin, mesh->positions + 3 * (size_t)cell->slots[0], sizeof cell->origin);
    for (int i = 0; i < 3; i++)
        for (int d = 0; d < 3; d++)
            edges[i][d] = mesh->positions[3 * (size_t)cell->slots[i + 1] + (size_t)d] - cell->origin[d];
    cross(edges[1], edges[2], 1, cell->rows[0]);
    double volume6 = cell->rows[0][0] * edges[0][0] + cell->rows[0][1] * edges[0][1] + cell->rows[0][2] * edges[0][2];
    cell->flat = volume6 == 0;
    for (int i = 0; i < 3 && !cell->flat; i++)
        cross(edges[(i + 1) % 3], edges[(i + 2) % 3], 1 / volume6, cell->rows[i]);
    for (uint32_t f = 0; f < mesh->field_count; f++)
        for (uint32_t k = 0, n = mesh->fields[f].components; k < n; k++)
            for (int c = 0; c < 4; c++)
                *values++ = mesh->fields[f].values[(size_t)cell->slots[c] * n + k];
}

static inline const struct walk_cell *cell_of(struct walker *walker, uint32_t tet)
{
    struct walk_cell *cell = &walker->cells[tet % WALK_CELLS];
    if (cell->tet != tet)
        fill_cell(walker->mesh, cell, tet);
    return cell;
}

/* The weights of p, the number of the least, and the least. Not of flat cells. */
static inline double cell_weights(const struct walk_cell *cell, const double p[3], double weights[4], int *out_least)
{
    double x = p[0] - cell->origin[0], y = p[1] - cell->origin[1], z = p[2] - cell->origin[2];
    double b = cell->rows[0][0] * x + cell->rows[0][1] * y + cell->rows[0][2] * z;
    double c = cell->rows[1][0] * x + cell->rows[1][1] * y + cell->rows[1][2] * z;
    double d = cell->rows[2][0] * x + cell->rows[2][1] * y + cell->rows[2][2] * z, a = 1 - b - c - d;
    weights[0] = a;
    weights[1] = b;
    weights[2] = c;
    weights[3] = d;
    int ab = b < a ? 1 : 0, cd = d < c ? 3 : 2;
    double least_ab = smaller(a, b), least_cd = smaller(c, d);
    *out_least = least_cd < least_ab ? cd : ab;
    return smaller(least_ab, least_cd);
}

/* In a thin tetrahedron the rounding of weights says anything, even of its own corners. */
static bool at_corner(const struct walker *walker, const struct walk_cell *cell, const double p[3], double weights[4])
{
    for (int c = 0; c < 4; c++) {
        const double *q = walker->mesh->positions + 3 * (size_t)cell->slots[c];
        if (p[0] != q[0] || p[1] != q[1] || p[2] != q[2])
            continue;
        for (int i = 0; i < 4; i++)
            weights[i] = i == c;
        return true;
    }
    return false;
}

const struct walk_cell *walk_to(struct walker *walker, uint32_t from, const double p[3], double weights[4])
{
    enum { MOST_STEPS = 1024 };
    uint32_t before = TETLOD_NONE;
    for (int step = 0; step < MOST_STEPS && from != TETLOD_NONE; step++) {
        const struct walk_cell *cell = cell_of(walker, from);
        int worst;
        if (cell->flat)
            return NULL;
        double least = cell_weights(cell, p, weights, &worst);
        if (least >= INSIDE)
            return cell;
        uint32_t across = walker->mesh->neighbours[4 * (size_t)from + (unsigned)worst];
        uint32_t next = across == TETLOD_NONE ? TETLOD_NONE : across / 4;
        if (least >= ON_FACE && (next == TETLOD_NONE || next == before))
            return cell;
        if ((next == TETLOD_NONE || next == before) && at_corner(walker, cell, p, weights))
            return cell;
        before = from;
        from = next;
    }
    return NULL;
}

/* ---- along a line */

/* Does the line from `start` (parameter 0) to p (1) meet the cell? */
static bool meets(const struct walk_cell *cell, const double start[3], const double p[3])
{
    double a[4], b[4], from = 0, to = 1;
    int least;
    if (cell->flat)
        return true;
    cell_weights(cell, start, a, &least);
    cell_weights(cell, p, b, &least);
    for (int i = 0; i < 4; i++) {
        double at = a[i] - ON_FACE, end = b[i] - ON_FACE; // >= 0 inside
        if (at < 0 && end < 0)
            return false;
        if (at < 0)
            from = larger(from, at / (at - end));
        else if (end < 0)
            to = smaller(to, at / (at - end));
    }
    return from <= to;
}

/* ---- the set of those that were seen */

static size_t place_in_table(const struct walker *walker, uint32_t tet)
{
    size_t at = (tet * UINT32_C(0x9e3779b1)) & (walker->table_size - 1);
    while (walker->table[at] != TETLOD_NONE && walker->table[at] != tet)
        at = (at + 1) & (walker->table_size - 1);
    return at;
}

static void forget_seen(struct walker *walker)
{
    memset(walker->table, 0xff, walker->table_size * sizeof *walker->table);
    walker->seen_count = 0;
}

/* Room for four more, in a table that is at most half full. */
static bool make_room(struct walker *walker)
{
    void *seen = walker->seen;
    bool room = array_reserve(&seen, &walker->seen_capacity, walker->seen_count + 4, sizeof *walker->seen);
    walker->seen = seen;
    if (!room || 2 * (walker->seen_count + 4) <= walker->table_size)
        return room;
    size_t size = walker->table_size ? 2 * walker->table_size : 64;
    uint32_t *table = array_resize(walker->table, size, sizeof *table);
    if (!table)
        return false;
    walker->table = table;
    walker->table_size = size;
    memset(table, 0xff, size * sizeof *table);
    for (size_t i = 0; i < walker->seen_count; i++)
        table[place_in_table(walker, walker->seen[i])] = walker->seen[i];
    return true;
}

/* False: it was seen before. */
static bool see(struct walker *walker, uint32_t tet)
{
    size_t at = place_in_table(walker, tet);
    if (walker->table[at] == tet)
        return false;
    walker->table[at] = walker->seen[walker->seen_count++] = tet;
    return true;
}

const struct walk_cell *walk_along(struct walker *walker, uint32_t from, const double start[3], const double p[3],
                                   double weights[4], bool *out_room)
{
    const struct walk_cell *found = NULL;
    int least;
    walker->seen_count = 0;
    *out_room = make_room(walker);
    if (*out_room)
        see(walker, from);
    for (size_t i = 0; i < walker->seen_count && *out_room && !found; i++) {
        uint32_t tet = walker->seen[i];
        const struct walk_cell *cell = cell_of(walker, tet);
        if ((!cell->flat && cell_weights(cell, p, weights, &least) >= ON_FACE) || at_corner(walker, cell, p, weights)) {
            found = cell;
            break;
        }
        *out_room = make_room(walker);
        for (unsigned f = 0; f < 4 && *out_room; f++) {
            uint32_t across = walker->mesh->neighbours[4 * (size_t)tet + f];
            if (across != TETLOD_NONE && meets(cell_of(walker, across / 4), start, p))
                see(walker, across / 4);
        }
    }
    if (walker->table)
        forget_seen(walker);
    return found;
}
