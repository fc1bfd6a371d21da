/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/simplify/mesh/star.h"

#include <stdlib.h>

#include "src/mesh/tet_geom.h"
#include "src/util/array.h"

void star_fini(struct star *star)
{
    free(star->tets);
    free(star->moving);
    *star = (struct star){0};
}

bool simplex_at_one_point(const struct working *working, const uint32_t *simplex, uint32_t count)
{
    bool same = true;
    for (uint32_t s = 1; s < count; s++)
        same &= distance_squared(working_row(working, simplex[0]), working_row(working, simplex[s])) == 0;
    return same;
}

static bool reserve(struct star *star, size_t count)
{
    return ARRAY_RESERVE(star->tets, star->tet_room, count) &&
           ARRAY_RESERVE(star->moving, star->moving_room, count);
}

bool star_gather(struct star *star, const struct working *working, const uint32_t *simplex, uint32_t count)
{
    size_t most = 0;
    for (uint32_t s = 0; s < count; s++)
        most += working->stars[star->simplex[s] = simplex[s]].count;
    star->simplex_count = count;
    star->tet_count = star->removed_count = 0;
    star->at_one_point = simplex_at_one_point(working, simplex, count);
    if (!reserve(star, most))
        return false;
    for (uint32_t s = 0; s < count; s++) {
        const struct span *span = &working->stars[simplex[s]];
        for (uint32_t i = 0; i < span->count; i++) {
            uint32_t tet = working->pool[span->begin + i];
            const uint32_t *corners = working->corners[tet];
            // it came with an earlier vertex
            if (tet_gone(working, tet) || (s && tet_has_other(corners, simplex, s, s)))
                continue;
            bool removed = tet_has_other(corners, simplex, count, s);
            star->tets[star->tet_count] = tet;
            star->moving[star->tet_count++] = removed ? STAR_REMOVED : (uint8_t)corner_of(corners, simplex[s]);
            star->removed_count += removed;
        }
    }
    return true;
}

bool star_fits(const struct star *star, const struct working *working, const double p[3])
{
    for (uint32_t i = 0; i < star->tet_count && !star->at_one_point; i++) {
        const double *q[4];
        if (star->moving[i] == STAR_REMOVED)
            continue;
        for (int c = 0; c < 4; c++)
            q[c] = working_row(working, working->corners[star->tets[i]][c]);
        q[star->moving[i]] = p;
        if (tet_orientation(q[0], q[1], q[2], q[3]) <= 0)
            return false;
    }
    return true;
}
