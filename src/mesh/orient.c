/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/mesh/orient.h"

#include <stdlib.h>
#include <string.h>

#include "format/fail.h"
#include "src/mesh/adjacency.h"
#include "src/mesh/tet_geom.h"
#include "src/util/array.h"

bool same_turn(const uint32_t *corners, const uint32_t *neighbours, size_t slot)
{
    uint32_t across = neighbours[slot];
    const uint32_t *own = corners + (slot & ~(size_t)3), *other = corners + (across & ~(uint32_t)3);
    uint32_t first = own[tet_faces[slot & 3][0]], second = own[tet_faces[slot & 3][1]];
    for (int k = 0; k < 3; k++)
        if (other[tet_faces[across & 3][k]] == first)
            return other[tet_faces[across & 3][(k + 1) % 3]] == second;
    return false;
}

enum { UNSEEN = 2 }; /* of a tetrahedron; else 1: turned, 0: not */

struct orienter {
    const double *positions;
    const uint32_t *corners, *neighbours;
    uint32_t tet_count;
    uint8_t *turned; /* [tet] */
    uint32_t *queue; /* [tet] part after part */
    uint32_t queued;
};

/* Tetrahedra that hang together through faces: queue[begin .. end). */
struct part {
    uint32_t begin, end;
    double volume6; /* with its numbering made consistent */
};

static double volume_of(const struct orienter *o, uint32_t t)
{
    const double *p[4];
    for (int c = 0; c < 4; c++)
        p[c] = o->positions + 3 * (size_t)o->corners[4 * (size_t)t + (size_t)c];
    double volume6 = tet_volume6(p[0], p[1], p[2], p[3]);
    return o->turned[t] ? -volume6 : volume6;
}

static void turn_part(const struct orienter *o, struct part *part)
{
    for (uint32_t i = part->begin; i < part->end; i++)
        o->turned[o->queue[i]] ^= 1;
    part->volume6 = -part->volume6;
}

/* Gathers the part of a tetrahedron, and turns its minority. False: no numbering of it is consistent. */
static bool gather(struct orienter *o, uint32_t t, struct part *part)
{
    bool consistent = true;
    uint32_t turned = 0;
    *part = (struct part){o->queued, o->queued, 0};
    o->turned[t] = 0;
    o->queue[o->queued++] = t;
    for (uint32_t i = part->begin; i < o->queued; i++)
        for (size_t slot = 4 * (size_t)o->queue[i], end = slot + 4; slot < end; slot++) {
            uint32_t across = o->neighbours[slot];
            if (across == TETLOD_NONE)
                continue;
            uint8_t wanted = o->turned[slot / 4] ^ (uint8_t)same_turn(o->corners, o->neighbours, slot);
            if (o->turned[across / 4] == UNSEEN) {
                o->turned[across / 4] = wanted;
                turned += wanted;
                o->queue[o->queued++] = across / 4;
            }
            consistent &= o->turned[across / 4] == wanted;
        }
    part->end = o->queued;
    for (uint32_t i = part->begin; i < part->end && !consistent; i++)
        o->turned[o->queue[i]] = 0;
    for (uint32_t i = part->begin; i < part->end; i++)
        part->volume6 += volume_of(o, o->queue[i]);
    if (consistent && turned > (part->end - part->begin) / 2)
        turn_part(o, part);
    return consistent;
}

/* Fills `turned`; gives how many are. Two passes: only with all parts is it known how the largest volume is turned. */
static uint32_t find_turned(struct orienter *o)
{
    double volumes[2] = {0, 0}; // of parts that are numbered negatively, and positively
    uint32_t count = 0;
    memset(o->turned, UNSEEN, o->tet_count);
    for (uint32_t t = 0; t < o->tet_count; t++) {
        struct part part;
        if (o->turned[t] != UNSEEN)
            continue;
        gather(o, t, &part);
        volumes[part.volume6 > 0] += fabs(part.volume6);
    }
    memset(o->turned, UNSEEN, o->tet_count);
    o->queued = 0;
    double sign = volumes[1] >= volumes[0] ? 1 : -1;
    for (uint32_t t = 0; t < o->tet_count; t++) {
        struct part part;
        if (o->turned[t] == UNSEEN && gather(o, t, &part) && part.volume6 * sign < 0)
            turn_part(o, &part);
    }
    for (uint32_t t = 0; t < o->tet_count; t++)
        count += o->turned[t];
    return count;
}

static bool make_corners(struct oriented *out, const uint32_t *corners, uint32_t tet_count)
{
    out->corners = array_new(tet_count, 4 * sizeof *out->corners);
    if (!out->corners)
        return false;
    memcpy(out->corners, corners, 4 * (size_t)tet_count * sizeof *corners);
    for (size_t t = 0; t < tet_count; t++)
        if (out->turned[t]) {
            out->corners[4 * t + 2] = corners[4 * t + 3];
            out->corners[4 * t + 3] = corners[4 * t + 2];
        }
    return true;
}

/* Whether there are tetrahedra of both signs: else numbering and orientation agree. */
static bool has_both_signs(const double *positions, const uint32_t *corners, uint32_t tet_count)
{
    bool seen[2] = {false, false};
    for (size_t t = 0; t < tet_count && !(seen[0] && seen[1]); t++) {
        const double *p[4];
        for (size_t c = 0; c < 4; c++)
            p[c] = positions + 3 * (size_t)corners[4 * t + c];
        double volume6 = tet_volume6(p[0], p[1], p[2], p[3]);
        seen[volume6 > 0] |= volume6 != 0;
    }
    return seen[0] && seen[1];
}

enum tetlod_status orient(struct oriented *out, const double *positions, const uint32_t *corners, uint32_t vertex_count,
                          uint32_t tet_count, const uint32_t *neighbours, struct tetlod_error *error)
{
    *out = (struct oriented){0};
    if (!has_both_signs(positions, corners, tet_count))
        return TETLOD_OK;
    uint32_t *own = neighbours ? NULL : array_new(tet_count, 4 * sizeof *own),
             *queue = array_new(tet_count, sizeof *queue);
    enum tetlod_status status = TETLOD_OK;
    out->turned = array_new(tet_count, 1);
    if (!out->turned || !queue || (!neighbours && !own))
        TETLOD_TRY_DONE(tetlodi_fail_nomem(error, "the orientation", tet_count * (uint64_t)21));
    if (own)
        TETLOD_TRY_DONE(adjacency_build(corners, tet_count, vertex_count, own, NULL, error));
    struct orienter orienter = {.positions = positions, .corners = corners, .neighbours = own ? own : neighbours,
                                .tet_count = tet_count, .turned = out->turned, .queue = queue};
    out->turned_count = find_turned(&orienter);
    if (out->turned_count && !make_corners(out, corners, tet_count))
        status = tetlodi_fail_nomem(error, "the orientation", tet_count * (uint64_t)16);
done:
    free(own);
    free(queue);
    if (status != TETLOD_OK || !out->turned_count)
        oriented_fini(out);
    return status;
}

void oriented_fini(struct oriented *oriented)
{
    free(oriented->corners);
    free(oriented->turned);
    *oriented = (struct oriented){0};
}
