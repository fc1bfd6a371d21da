/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/mesh/locate.h"

#include <math.h>
#include <stdbool.h>
#include <stdlib.h>

#include "format/fail.h"
#include "src/mesh/adjacency.h"
#include "src/mesh/tet_geom.h"
#include "src/util/array.h"

/* A point this far outside by a barycentric weight is on the face: the rounding of well shaped tetrahedra is far
 * below. */
static const double ON_FACE = -1e-9;

enum tetlod_status locator_init(struct locator *locator, const double *positions, uint32_t vertex_count,
                                const uint32_t *corners, uint32_t tet_count, struct tetlod_error *error)
{
    uint32_t *neighbours = array_new(4 * (size_t)tet_count, sizeof *neighbours);
    enum tetlod_status status;
    *locator = (struct locator){.positions = positions, .corners = corners, .tet_count = tet_count};
    locator->neighbours = neighbours;
    if (!neighbours)
        TETLOD_TRY_DONE(tetlodi_fail_nomem(error, "the boundary", 16 * (uint64_t)tet_count));
    TETLOD_TRY_DONE(adjacency_build(corners, tet_count, vertex_count, neighbours, NULL, error));
    TETLOD_TRY_DONE(bvh_build(&locator->tets, positions, corners, tet_count, 4, BVH_LEAF, error));
    TETLOD_TRY_DONE(mesh_surface_init(&locator->surface, positions, corners, neighbours, tet_count, NULL, 0, 0, error));
done:
    if (status != TETLOD_OK)
        locator_fini(locator);
    return status;
}

void locator_fini(struct locator *locator)
{
    free(locator->neighbours);
    bvh_fini(&locator->tets);
    mesh_surface_fini(&locator->surface);
    *locator = (struct locator){0};
}

/* Is p a corner of the tetrahedron? */
static bool at_corner(const double *const q[4], const double p[3], double weights[4])
{
    for (int c = 0; c < 4; c++)
        if (p[0] == q[c][0] && p[1] == q[c][1] && p[2] == q[c][2]) {
            weights[0] = weights[1] = weights[2] = weights[3] = 0;
            weights[c] = 1;
            return true;
        }
    return false;
}

double locator_weights(const struct locator *locator, uint32_t tet, const double p[3], double weights[4])
{
    const double *q[4];
    for (int c = 0; c < 4; c++)
        q[c] = locator->positions + 3 * (size_t)locator->corners[4 * (size_t)tet + c];
    double whole = tet_volume6(q[0], q[1], q[2], q[3]), least = INFINITY;
    weights[0] = 1;
    for (int c = 1; c < 4 && whole != 0; c++) {
        const double *r[4] = {q[0], q[1], q[2], q[3]};
        r[c] = p;
        weights[c] = tet_volume6(r[0], r[1], r[2], r[3]) / whole;
        weights[0] -= weights[c];
        least = smaller(least, weights[c]);
    }
    least = whole != 0 ? smaller(least, weights[0]) : -INFINITY;
    // in a thin tetrahedron the rounding of volumes says anything, even of its own corners
    return least < 0 && at_corner(q, p, weights) ? 0 : least;
}

bool locator_contains(const struct locator *locator, uint32_t tet, const double p[3], double weights[4])
{
    return locator_weights(locator, tet, p, weights) >= ON_FACE;
}

uint32_t locator_find(const struct locator *locator, const double p[3], uint32_t *out_tets, uint32_t most)
{
    struct bvh_walk walk = bvh_walk_begin(&locator->tets);
    const double box[6] = {p[0], p[1], p[2], p[0], p[1], p[2]};
    uint32_t found = 0, first, end;
    double weights[4];
    while (found < most && bvh_next_leaf(&walk, box, &first, &end))
        for (uint32_t i = first; i < end && found < most; i++) {
            uint32_t tet = locator->tets.order[i];
            if (locator_contains(locator, tet, p, weights))
                out_tets[found++] = tet;
        }
    return found;
}

uint32_t locator_walk(const struct locator *locator, uint32_t from, const double p[3], double weights[4])
{
    enum { MAX_STEPS = 64 };
    for (int step = 0; step < MAX_STEPS && from != TETLOD_NONE; step++) {
        if (locator_weights(locator, from, p, weights) >= 0)
            return from;
        int worst = 0;
        for (int c = 1; c < 4; c++)
            if (weights[c] < weights[worst])
                worst = c;
        uint32_t across = locator->neighbours[4 * (size_t)from + (unsigned)worst];
        from = across == TETLOD_NONE ? across : across / 4;
    }
    return TETLOD_NONE;
}

double locator_closest(const struct locator *locator, const double p[3], struct place *out)
{
    uint32_t face;
    return mesh_surface_closest(&locator->surface, 0, p, out, &face);
}
