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

/* Tetrahedra whose differences may be above the limit. */
struct open_tets {
    uint32_t *numbers, *corners, count; /* owned, [count], [4 * count] */
    struct bvh tree;
};

static enum tetlod_status find_open_tets(struct open_tets *out, const struct difference *found,
                                         const struct tetmesh *mesh, double limit, struct tetlod_error *error)
{
    *out = (struct open_tets){.numbers = array_new(mesh->tet_count, sizeof(uint32_t)),
                              .corners = array_new(mesh->tet_count, 4 * sizeof(uint32_t))};
    if (!out->numbers || !out->corners)
        return tetlodi_fail_nomem(error, "the overlay", mesh->tet_count * (uint64_t)20);
    for (uint32_t t = 0; t < mesh->tet_count; t++)
        if (found->cells[t].upper > limit) {
            memcpy(out->corners + 4 * (size_t)out->count, mesh->corners + 4 * (size_t)t, 4 * sizeof *mesh->corners);
            out->numbers[out->count++] = t;
        }
    return bvh_build(&out->tree, mesh->positions, out->corners, out->count, 4, BVH_LEAF, error);
}

static void open_tets_fini(struct open_tets *open)
{
    free(open->numbers);
    free(open->corners);
    bvh_fini(&open->tree);
}

/* Not, if all of a finer tetrahedron is in those whose differences are within the limit, and out of reach of the
 * boundaries, but where what these have left is within it, too. First, if it is in one whose difference may be great.
 */
static enum difference_asked asked_of(const struct difference *found, const struct tetmesh *mesh,
                                      const struct open_tets *open, double limit, const struct tetmesh *finer,
                                      uint32_t tet)
{
    const double great = found->inner - (found->inner - limit) / 4;
    enum difference_asked asked = ASKED_NOT;
    struct reach reach;
    uint32_t first, end;
    reach_set(&reach, finer, tet);
    for (int m = 0; m < 2 && found->shell > limit; m++)
        if (!moved_boundary_leaves_box(&found->boundaries[m], reach.box))
            asked = ASKED_LAST;
    struct bvh_walk walk = bvh_walk_begin(&open->tree);
    while (open->count && bvh_next_leaf_where(&walk, reaches, &reach, &first, &end))
        for (uint32_t i = first; i < end; i++) {
            const uint32_t number = open->numbers[open->tree.order[i]];
            const enum difference_asked most = found->cells[number].upper > great ? ASKED_FIRST : ASKED_LAST;
            if (most > asked && tets_meet(&reach, finer, tet, mesh, number))
                asked = most;
        }
    return asked;
}

enum tetlod_status open_parts_find(const struct difference *found, const struct tetmesh *mesh,
                                   const struct tetmesh *finer, struct difference_open *out, double *out_most,
                                   struct tetlod_error *error)
{
    const double limit = out->limit;
    struct open_tets open;
    *out_most = found->shell <= limit ? found->shell : 0;
    out->asked = array_new(finer->tet_count, sizeof *out->asked);
    if (!out->asked)
        return tetlodi_fail_nomem(error, "the overlay", finer->tet_count);
    enum tetlod_status status = find_open_tets(&open, found, mesh, limit, error);
    for (uint32_t t = 0; t < mesh->tet_count; t++)
        if (found->cells[t].upper <= limit)
            *out_most = larger(*out_most, found->cells[t].upper);
    for (uint32_t t = 0; t < finer->tet_count && status == TETLOD_OK; t++)
        out->asked[t] = (uint8_t)asked_of(found, mesh, &open, limit, finer, t);
    open_tets_fini(&open);
    return status;
}

void open_parts_complete(struct difference *open, const uint8_t *asked, size_t tets, double most,
                         const struct difference *whole)
{
    most = open->decided ? whole->inner : most;
    for (size_t t = 0; t < tets; t++)
        if (asked[t] < (open->decided ? ASKED_FIRST : ASKED_LAST))
            open->cells[t].upper = most;
    open->inner = larger(open->inner, most);
    open->shell = open->decided ? whole->shell : open->shell;
    open->max[1] = larger(larger(open->max[1], most), open->shell);
    if (whole->max[0] > open->max[0]) {
        open->max[0] = whole->max[0];
        memcpy(open->place, whole->place, sizeof open->place);
    }
    memcpy(open->volumes, whole->volumes, sizeof open->volumes);
    memcpy(open->squares, whole->squares, sizeof open->squares);
    open->overlap = whole->overlap;
    open->swept = whole->swept;
}
