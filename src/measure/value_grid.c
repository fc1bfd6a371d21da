/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/measure/value_grid.h"

#include <math.h>
#include <stdlib.h>

#include "format/fail.h"
#include "src/mesh/tet_geom.h"
#include "src/util/array.h"

enum { MAX_SIDE = 64, MAX_RANGES = 1 << 21, CELLS_OF_TET = 64, MIN_SIDE = 8 };

/* The cube of the longest edge by six times the volume: above it the gradients are not used. */
static const double THIN = 1e5;

/* Room for rounding, of the size of what is added up. */
static const double SLACK = 1e-9;

void grid_tet_set(struct grid_tet *tet, const struct tetmesh *mesh, uint32_t number)
{
    const double **p = tet->corners;
    double edges[3][3];
    for (int c = 0; c < 4; c++)
        p[c] = mesh->positions + 3 * (size_t)mesh->corners[4 * (size_t)number + (size_t)c];
    for (int i = 0; i < 3; i++) {
        tet->low[i] = smaller(smaller(p[0][i], p[1][i]), smaller(p[2][i], p[3][i]));
        tet->high[i] = larger(larger(p[0][i], p[1][i]), larger(p[2][i], p[3][i]));
        for (int j = 0; j < 3; j++)
            edges[j][i] = p[j + 1][i] - p[0][i];
    }
    double volume6 = tet_volume6(p[0], p[1], p[2], p[3]), size2 = tet_size_squared(p[0], p[1], p[2], p[3]);
    tet->known = size2 * sqrt(size2) < THIN * fabs(volume6);
    for (int j = 0; j < 3 && tet->known; j++) {
        const double *u = edges[(j + 1) % 3], *v = edges[(j + 2) % 3];
        for (int i = 0; i < 3; i++)
            tet->rows[j][i] = (u[(i + 1) % 3] * v[(i + 2) % 3] - u[(i + 2) % 3] * v[(i + 1) % 3]) / volume6;
    }
}

/* A tetrahedron in a cell: its weights in the middle, and how far they go from there. */
struct part {
    double middle[4], reach[4];
};

/* False if the cell is outside. */
static bool weigh_cell(const struct value_grid *grid, const struct grid_tet *tet, const int cell[3], struct part *out)
{
    double from[3], half[3], total[3] = {0, 0, 0};
    *out = (struct part){{1, 0, 0, 0}, {0, 0, 0, 0}};
    for (int i = 0; i < 3; i++) {
        half[i] = grid->scale[i] > 0 ? 0.5 / grid->scale[i] : 0;
        from[i] = (2 * cell[i] + 1) * half[i] + (grid->low[i] - tet->corners[0][i]);
    }
    for (int k = 1; k < 4; k++)
        for (int i = 0; i < 3; i++) {
            out->middle[k] += tet->rows[k - 1][i] * from[i];
            out->reach[k] += fabs(tet->rows[k - 1][i]) * half[i];
            total[i] -= tet->rows[k - 1][i];
        }
    for (int k = 1; k < 4; k++)
        out->middle[0] -= out->middle[k];
    for (int i = 0; i < 3; i++)
        out->reach[0] += fabs(total[i]) * half[i];
    for (int k = 0; k < 4; k++)
        if (out->middle[k] + out->reach[k] < -SLACK * (1 + fabs(out->middle[k]) + out->reach[k]))
            return false;
    return true;
}

/* A component on a tetrahedron. */
struct component {
    double values[4], least, most;
    double reach; /* how far its gradient goes from the middle of a cell; INFINITY: not known */
};

static void set_component(const struct value_grid *grid, const struct grid_tet *tet, const double *const rows[4],
                          uint32_t c, struct component *out)
{
    double *values = out->values;
    for (int k = 0; k < 4; k++)
        values[k] = rows[k][c];
    out->least = smaller(smaller(values[0], values[1]), smaller(values[2], values[3]));
    out->most = larger(larger(values[0], values[1]), larger(values[2], values[3]));
    out->reach = tet->known ? SLACK * (fabs(out->least) + fabs(out->most)) : INFINITY;
    for (int i = 0; i < 3 && tet->known; i++) {
        double slope = 0;
        for (int k = 1; k < 4; k++)
            slope += tet->rows[k - 1][i] * (values[k] - values[0]);
        out->reach += grid->scale[i] > 0 ? fabs(slope) * 0.5 / grid->scale[i] : 0;
    }
}

/* A cell has what the component's gradient allows there, and no more than what is at the corners. */
static void widen(const struct component *component, const struct part *part, double range[2])
{
    const double *values = component->values;
    double middle = values[0];
    for (int k = 1; k < 4; k++)
        middle += part->middle[k] * (values[k] - values[0]);
    double reach = component->reach + SLACK * (fabs(middle) + component->reach);
    range[0] = smaller(range[0], larger(component->least, middle - reach));
    range[1] = larger(range[1], smaller(component->most, middle + reach));
}

/* `components` has room for [width]. */
static void mark(struct value_grid *grid, const struct grid_tet *tet, const double *const values[4],
                 struct component *components)
{
    int first[3], last[3], at[3];
    for (uint32_t c = 0; c < grid->width; c++)
        set_component(grid, tet, values, c, &components[c]);
    for (int i = 0; i < 3; i++) {
        first[i] = grid_coordinate(grid, tet->low[i], i);
        last[i] = grid_coordinate(grid, tet->high[i], i);
    }
    for (at[0] = first[0]; at[0] <= last[0]; at[0]++)
        for (at[1] = first[1]; at[1] <= last[1]; at[1]++)
            for (at[2] = first[2]; at[2] <= last[2]; at[2]++) {
                struct part part = {{0}, {0}};
                size_t cell = grid_number(grid, at[0], at[1], at[2]);
                if (tet->known && !weigh_cell(grid, tet, at, &part))
                    continue;
                grid->marked[cell] = 1;
                for (uint32_t c = 0; c < grid->width; c++)
                    widen(&components[c], &part, grid->ranges + 2 * (cell * grid->width + c));
            }
}

static void set_bounds(struct value_grid *grid, const struct tetmesh *mesh)
{
    double low[3] = {INFINITY, INFINITY, INFINITY}, high[3] = {-INFINITY, -INFINITY, -INFINITY};
    for (size_t c = 0; c < 4 * (size_t)mesh->tet_count; c++)
        for (int i = 0; i < 3; i++) {
            double at = mesh->positions[3 * (size_t)mesh->corners[c] + (size_t)i];
            low[i] = smaller(low[i], at);
            high[i] = larger(high[i], at);
        }
    for (int i = 0; i < 3; i++) {
        grid->low[i] = low[i];
        grid->scale[i] = high[i] > low[i] ? grid->side / (high[i] - low[i]) : 0;
    }
}

static int choose_side(uint32_t tets, uint32_t width)
{
    uint64_t most = MAX_RANGES / (width ? width : 1);
    int side = MAX_SIDE;
    while (side > 1 && (uint64_t)side * (uint64_t)side * (uint64_t)side > most)
        side /= 2;
    while (side > MIN_SIDE && (uint64_t)side * (uint64_t)side * (uint64_t)side > CELLS_OF_TET * (uint64_t)tets)
        side /= 2;
    return side;
}

uint64_t value_grid_bytes(uint32_t tets, uint32_t width)
{
    uint64_t side = (uint64_t)choose_side(tets, width);
    return side * side * side * (1 + 2 * sizeof(double) * width) + width * sizeof(struct component);
}

enum tetlod_status value_grid_init(struct value_grid *grid, const struct tetmesh *mesh, const double *values,
                                   uint32_t width, struct tetlod_error *error)
{
    const int side = choose_side(mesh->tet_count, width);
    size_t cells = (size_t)side * (size_t)side * (size_t)side, ranges = cells * width;
    *grid = (struct value_grid){.side = side, .cell_count = cells, .width = width,
                                .ranges = array_new(ranges, 2 * sizeof *grid->ranges),
                                .marked = array_zero(cells, 1)};
    struct component *components = array_new(width, sizeof *components);
    if (!grid->ranges || !grid->marked || !components) {
        free(components);
        value_grid_fini(grid);
        return tetlodi_fail_nomem(error, "a grid of values", ranges * 16);
    }
    for (size_t i = 0; i < ranges; i++) {
        grid->ranges[2 * i] = INFINITY;
        grid->ranges[2 * i + 1] = -INFINITY;
    }
    set_bounds(grid, mesh);
    for (uint32_t t = 0; t < mesh->tet_count; t++) {
        struct grid_tet tet;
        const double *own[4];
        grid_tet_set(&tet, mesh, t);
        for (int c = 0; c < 4; c++)
            own[c] = values + (size_t)width * mesh->corners[4 * (size_t)t + (size_t)c];
        mark(grid, &tet, own, components);
    }
    free(components);
    return TETLOD_OK;
}

void value_grid_fini(struct value_grid *grid)
{
    free(grid->ranges);
    free(grid->marked);
    *grid = (struct value_grid){0};
}
