/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * A grid over a mesh that knows which values the mesh has where: for each cell and component the range of what the
 * tetrahedra that meet the cell have in it. So most tetrahedra of another mesh are known to differ by little without a
 * look at pairs.
 */
#ifndef TETLOD_VALUE_GRID_H
#define TETLOD_VALUE_GRID_H

#include "src/mesh/tetmesh.h"

struct value_grid {
    int side; /* cells along an axis, at most 64: fewer where there are many components or few tetrahedra */
    size_t cell_count;
    double low[3], scale[3];
    uint32_t width;
    double *ranges;        /* [cell_count * width][2]: the least above the most where nothing is */
    unsigned char *marked; /* [cell_count] something is there */
};

/* A tetrahedron as linear functions: weights[1 + i] = rows[i] . (p - origin). Not known of thin ones, where rounding
 * says anything. */
struct grid_tet {
    bool known;
    const double *corners[4];
    double low[3], high[3], rows[3][3];
};

void grid_tet_set(struct grid_tet *tet, const struct tetmesh *mesh, uint32_t number);

/* values: [width] for each vertex of the mesh. ERR_NOMEM. */
TETLOD_CHECKED enum tetlod_status value_grid_init(struct value_grid *grid, const struct tetmesh *mesh,
                                                  const double *values, uint32_t width,
                                                  struct tetlod_error *error);
void value_grid_fini(struct value_grid *grid);

/* Memory that a grid takes. */
uint64_t value_grid_bytes(uint32_t tets, uint32_t width);

/* The coordinate of the cell that holds a number along an axis; that at the end if it is outside. */
static inline uint8_t grid_coordinate(const struct value_grid *grid, double at, int axis)
{
    double cell = (at - grid->low[axis]) * grid->scale[axis];
    return (uint8_t)(cell > 0 ? cell < grid->side ? cell : grid->side - 1 : 0);
}

static inline size_t grid_number(const struct value_grid *grid, int x, int y, int z)
{
    return (size_t)((x * grid->side + y) * grid->side + z);
}

#endif
