/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/diff/open_parts.h"

#include <stdlib.h>
#include <string.h>

#include "format/fail.h"
#include "src/measure/weights_map.h"
#include "src/mesh/bvh.h"
#include "src/util/array.h"

/* Do two tetrahedra share more than a contact? False: a face of one parts them. */
static bool tets_meet(const struct reach *reach, const struct tetmesh *own, uint32_t tet, const struct tetmesh *mesh,
                      uint32_t other)
{
    struct weights_map map;
    double weights[4][4], slack;
    if (!weigh_corners(&reach->map, mesh, other, weights, &slack))
        return false;
    make_map(mesh, other, &map);
    return weigh_corners(&map, own, tet, weights, &slack);
}

/* Is all of a finer tetrahedron in those whose differences are within the limit, and out of reach of the boundaries? */
static bool is_decided(const struct difference *found, const struct tetmesh *mesh, const struct bvh *tree, double limit,
                       const struct tetmesh *finer, uint32_t tet)
{
    struct reach reach;
    uint32_t first, end;
    reach_set(&reach, finer, tet);
    for (int m = 0; m < 2; m++)
        if (!moved_boundary_leaves_box(&found->boundaries[m], reach.box))
            return false;
    struct bvh_walk walk = bvh_walk_begin(tree);
    while (bvh_next_leaf_where(&walk, reaches, &reach, &first, &end))
        for (uint32_t i = first; i < end; i++)
            if (found->cells[tree->order[i]].upper > limit && tets_meet(&reach, finer, tet, mesh, tree->order[i]))
                return false;
    return true;
}

enum tetlod_status open_parts_find(const struct difference *found, const struct tetmesh *mesh, double limit,
                                   const struct tetmesh *finer, uint8_t **out, double *out_most,
                                   struct tetlod_error *error)
{
    struct bvh tree;
    *out_most = 0;
    *out = array_new(finer->tet_count, sizeof **out);
    if (!*out)
        return tetlodi_fail_nomem(error, "the overlay", finer->tet_count);
    TETLOD_TRY(bvh_build(&tree, mesh->positions, mesh->corners, mesh->tet_count, 4, BVH_LEAF, error));
    for (uint32_t t = 0; t < mesh->tet_count; t++)
        if (found->cells[t].upper <= limit)
            *out_most = larger(*out_most, found->cells[t].upper);
    for (uint32_t t = 0; t < finer->tet_count; t++)
        (*out)[t] = !is_decided(found, mesh, &tree, limit, finer, t);
    bvh_fini(&tree);
    return TETLOD_OK;
}

void open_parts_complete(struct difference *open, const uint8_t *asked, size_t tets, double most,
                         const struct difference *whole)
{
    for (size_t t = 0; t < tets; t++)
        if (!asked[t])
            open->cells[t].upper = most;
    open->inner = larger(open->inner, most);
    open->max[1] = larger(open->max[1], most);
    if (whole->max[0] > open->max[0]) {
        open->max[0] = whole->max[0];
        memcpy(open->place, whole->place, sizeof open->place);
    }
    memcpy(open->volumes, whole->volumes, sizeof open->volumes);
    memcpy(open->squares, whole->squares, sizeof open->squares);
    open->overlap = whole->overlap;
    open->swept = whole->swept;
}
