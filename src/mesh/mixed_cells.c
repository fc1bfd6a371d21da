/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/mesh/mixed_cells.h"

#include <stdlib.h>

void cells_fini(struct cells *cells)
{
    free(cells->types);
    free(cells->offsets);
    free(cells->connectivity);
    *cells = (struct cells){0};
}

/* The faces of a polyhedron: their number, and for each the number of its points and these. */
static bool visit_faces(uint32_t *stream, uint64_t size, void (*visit)(void *opaque, uint32_t *point), void *opaque)
{
    uint64_t at = 1;
    for (uint32_t f = 0; size && f < stream[0]; f++) {
        if (at >= size || stream[at] > size - at - 1)
            return false;
        for (uint32_t i = 1; i <= stream[at]; i++)
            visit(opaque, &stream[at + i]);
        at += 1 + (uint64_t)stream[at];
    }
    return size && at == size;
}

bool cells_visit_points(const struct cells *cells, uint64_t cell, void (*visit)(void *opaque, uint32_t *point),
                        void *opaque)
{
    uint32_t *points = cells->connectivity + (cells->types ? cells->offsets[cell] : 4 * cell);
    uint64_t size = cells->types ? cells->offsets[cell + 1] - cells->offsets[cell] : 4;
    if (cells->types && cells->types[cell] == VTK_TYPE_POLYHEDRON)
        return visit_faces(points, size, visit, opaque);
    for (uint64_t i = 0; i < size; i++)
        visit(opaque, &points[i]);
    return true;
}
