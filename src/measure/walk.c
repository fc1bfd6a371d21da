/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/measure/walk.h"

#include <float.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "format/fail.h"
#include "src/mesh/tet_geom.h"
#include "src/util/array.h"

/* A point this far outside by a barycentric weight is on the face, if nothing is behind it; this far it is inside. The
 * rounding of well shaped tetrahedra is far below either. */
static const double ON_FACE = -1e-9, INSIDE = -1e-13;

/* Of the volume of a box with the same edges: weights in a thinner tetrahedron have few digits that are right. */
static const double THIN = 1e-9;

void walk_gather(const struct walk_component *components, size_t width, const uint32_t vertices[4], double *out)
{
    for (size_t i = 0; i < width; i++) {
        const double *values = components[i].values;
        size_t stride = components[i].stride;
        double first = out[i] = values[vertices[0] * stride];
        for (size_t c = 1; c < 4; c++)
            out[c * width + i] = values[vertices[c] * stride] - first;
    }
}

static size_t width_of(const struct coarsening *mesh)
{
    size_t width = 0;
    for (uint32_t f = 0; f < mesh->field_count; f++)
        width += mesh->fields[f].components;
    return width;
}

enum tetlod_status walker_init(struct walker *walker, const struct coarsening *mesh, struct tetlod_error *error)
{
    size_t width = width_of(mesh), i = 0;
    *walker = (struct walker){.mesh = mesh,
                              .width = width,
                              .components = array_new(width, sizeof *walker->components),
                              .cells = array_new(WALK_CELLS, sizeof *walker->cells),
                              .values = array_new(WALK_CELLS, 4 * width * sizeof(double))};
    if (!walker->components || !walker->cells || !walker->values) {
        walker_fini(walker);
        return tetlodi_fail_nomem(error, "the walk", WALK_CELLS * (sizeof *walker->cells + 32 * width));
    }
    for (uint32_t f = 0; f < mesh->field_count; f++)
        for (uint32_t k = 0; k < mesh->fields[f].components; k++)
            walker->components[i++] = (struct walk_component){mesh->fields[f].values + k, mesh->fields[f].components};
    for (i = 0; i < WALK_CELLS; i++)
        walker->cells[i].values = walker->values + 4 * i * width;
    walker_reset(walker);
    return TETLOD_OK;
}

void walker_fini(struct walker *walker)
{
    free(walker->components);
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

static void fill_cell(const struct walker *walker, struct walk_cell *cell, uint32_t tet)
{
    const struct coarsening *mesh = walker->mesh;
    double edges[3][3], box2 = 1;
    cell->tet = tet;
    memcpy(cell->slots, mesh->corners + 4 * (size_t)tet, sizeof cell->slots);
    memcpy(cell->across, mesh->neighbours + 4 * (size_t)tet, sizeof cell->across);
    memcpy(cell->origin, mesh->positions + 3 * (size_t)cell->slots[0], sizeof cell->origin);
    for (int i = 0; i < 3; i++) {
        for (int d = 0; d < 3; d++)
            edges[i][d] = mesh->positions[3 * (size_t)cell->slots[i + 1] + (size_t)d] - cell->origin[d];
        box2 *= edges[i][0] * edges[i][0] + edges[i][1] * edges[i][1] + edges[i][2] * edges[i][2];
    }
    cross(edges[1], edges[2], 1, cell->rows[0]);
    double volume6 = cell->rows[0][0] * edges[0][0] + cell->rows[0][1] * edges[0][1] + cell->rows[0][2] * edges[0][2];
    cell->flat = volume6 == 0;
    cell->thin = volume6 * volume6 <= THIN * THIN * box2;
    for (int i = 0; i < 3 && !cell->flat; i++)
        cross(edges[(i + 1) % 3], edges[(i + 2) % 3], 1 / volume6, cell->rows[i]);
    walk_gather(walker->components, walker->width, cell->slots, cell->values);
}

static inline const struct walk_cell *cell_of(struct walker *walker, uint32_t tet)
{
    struct walk_cell *cell = &walker->cells[tet % WALK_CELLS];
    if (cell->tet != tet)
        fill_cell(walker, cell, tet);
    return cell;
}

/* The weights of p. Not of flat cells. */
static inline void cell_weights(const struct walk_cell *cell, const double p[3], double weights[4])
{
    double x = p[0] - cell->origin[0], y = p[1] - cell->origin[1], z = p[2] - cell->origin[2];
    for (int i = 0; i < 3; i++)
        weights[i + 1] = cell->rows[i][0] * x + cell->rows[i][1] * y + cell->rows[i][2] * z;
    weights[0] = 1 - weights[1] - weights[2] - weights[3];
}

static inline double least_weight(const double w[4], int *out_least)
{
    int ab = w[1] < w[0] ? 1 : 0, cd = w[3] < w[2] ? 3 : 2;
    *out_least = w[cd] < w[ab] ? cd : ab;
    return w[*out_least];
}

static inline bool all_above(const double w[4], double least)
{
    return (w[0] >= least) & (w[1] >= least) & (w[2] >= least) & (w[3] >= least);
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
    enum { MAX_STEPS = 1024 };
    uint32_t before = TETLOD_NONE;
    for (int step = 0; step < MAX_STEPS && from != TETLOD_NONE; step++) {
        const struct walk_cell *cell = cell_of(walker, from);
        int worst;
        if (cell->flat)
            return NULL;
        cell_weights(cell, p, weights);
        if (all_above(weights, INSIDE)) {
            if (cell->thin)
                at_corner(walker, cell, p, weights);
            return cell;
        }
        double least = least_weight(weights, &worst);
        uint32_t across = cell->across[worst];
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
    double size = 0, steep = 0;
    if (cell->flat)
        return true;
    cell_weights(cell, start, a);
    cell_weights(cell, p, b);
    for (int i = 0; i < 9; i++) {
        size = larger(size, fabs(start[i % 3]));
        steep += fabs(cell->rows[i / 3][i % 3]);
    }
    // by how much rounding of its coordinates may put the start beside the face
    double room = -ON_FACE + DBL_EPSILON * size * steep;
    for (int i = 0; i < 4; i++) {
        double at = a[i] + room, end = b[i] + room; // >= 0 inside
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
    bool room = ARRAY_RESERVE(walker->seen, walker->seen_capacity, walker->seen_count + 4);
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
    walker->seen_count = 0;
    *out_room = make_room(walker);
    if (*out_room)
        see(walker, from);
    for (size_t i = 0; i < walker->seen_count && *out_room && !found; i++) {
        uint32_t tet = walker->seen[i];
        const struct walk_cell *cell = cell_of(walker, tet);
        if (!cell->flat)
            cell_weights(cell, p, weights);
        if (at_corner(walker, cell, p, weights) || (!cell->flat && all_above(weights, ON_FACE))) {
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
