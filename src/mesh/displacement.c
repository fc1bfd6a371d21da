/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/mesh/displacement.h"

#include <math.h>
#include <string.h>

#include "format/fail.h"
#include "format/common/round.h"
#include "src/mesh/tet_geom.h"

/* The same tetrahedron, or the one with its last corners exchanged, as reading turns inverted cells (cell_tet_turn). */
static bool same_tet(const uint32_t *a, const uint32_t *b)
{
    return a[0] == b[0] && a[1] == b[1] && ((a[2] == b[2] && a[3] == b[3]) || (a[2] == b[3] && a[3] == b[2]));
}

const char *displacement_obstacle(const struct tetmesh *mesh, const struct tetmesh *first)
{
    bool same = mesh->vertex_count == first->vertex_count && mesh->tet_count == first->tet_count;
    for (size_t t = 0; t < first->tet_count && same; t++)
        same = same_tet(mesh->corners + 4 * t, first->corners + 4 * t);
    return same ? NULL : "its tetrahedra are others than those of the first step";
}

bool displacement_moves(const struct tetmesh *mesh, const struct tetmesh *first)
{
    return memcmp(mesh->positions, first->positions, 24 * (size_t)first->vertex_count) != 0;
}

enum tetlod_status displacement_take(struct tetmesh *mesh, const struct tetmesh *first, uint64_t *io_rounded,
                                     struct tetlod_error *error)
{
    size_t count = 3 * (size_t)first->vertex_count;
    if (tetmesh_find_field(mesh, DISPLACEMENT_FIELD) != TETLOD_NONE)
        return tetlodi_fail(error, TETLOD_ERR_FIELD,
                            "its points move, which takes a field '" DISPLACEMENT_FIELD "', and there is one already: "
                                                                                        "rename it");
    TETLOD_TRY(tetmesh_add_field(mesh, DISPLACEMENT_FIELD, 3, TETLOD_FLOAT64, error));
    double *values = mesh->fields[mesh->field_count - 1].values;
    for (size_t i = 0; i < count; i++) {
        double from = first->positions[i], to = mesh->positions[i], by = to - from, single = (double)(float)by;
        if (!isfinite(by))
            return tetlodi_fail(error, TETLOD_ERR_MESH, "point %zu moves from %g to %g, too far for a number", i / 3,
                                from, to);
        values[i] = tetlodi_round(first->position_type, from + single) == to ? single : by; // as decoders add it
        *io_rounded += tetlodi_round(first->position_type, from + values[i]) != to;
    }
    memmove(mesh->positions, first->positions, count * sizeof *mesh->positions);
    memmove(mesh->corners, first->corners, 4 * (size_t)first->tet_count * sizeof *mesh->corners);
    mesh->position_type = first->position_type;
    return TETLOD_OK;
}

static int orientation(const double *positions, const uint32_t *corners)
{
    return tet_orientation(positions + 3 * (size_t)corners[0], positions + 3 * (size_t)corners[1],
                           positions + 3 * (size_t)corners[2],
                           positions + 3 * (size_t)corners[3]);
}

uint64_t displacement_turned(const double *from, const double *to, const uint32_t *corners, uint32_t tets)
{
    uint64_t turned = 0;
    for (size_t t = 0; t < tets; t++) {
        int before = orientation(from, corners + 4 * t);
        turned += before != 0 && orientation(to, corners + 4 * t) != before;
    }
    return turned;
}
