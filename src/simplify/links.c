/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/simplify/links.h"

#include <stdlib.h>
#include <string.h>

#include "src/util/array.h"

/* Of a neighbour of a: it is in Lk(ab); its edge to b is on the boundary; its face with ab is. */
enum { RING = 1, ALONG_B = 2, OPEN = 4 };

void links_fini(struct links *links)
{
    free(links->marks);
    free(links->triangles);
    table_fini(&links->pairs);
    *links = (struct links){0};
}

static inline uint64_t pair_key(uint32_t x, uint32_t y)
{
    return x < y ? (uint64_t)x << 32 | y : (uint64_t)y << 32 | x;
}

static bool reserve(struct links *links, const struct hood *hood)
{
    void *marks = links->marks, *triangles = links->triangles;
    bool room = array_reserve(&marks, &links->mark_room, hood->count, 1) &&
                array_reserve(&triangles, &links->triangle_room, hood->tet_count, sizeof *links->triangles);
    links->marks = marks;
    links->triangles = triangles;
    return room && table_clear(&links->pairs, 3 * (size_t)hood->tet_count);
}

static void sort3(uint32_t v[3])
{
    for (int i = 0; i < 3; i++) {
        int a = i == 1, b = a + 1; // 0 1, 1 2, 0 1
        if (v[a] > v[b]) {
            uint32_t swap = v[a];
            v[a] = v[b];
            v[b] = swap;
        }
    }
}

/* Marks Lk(ab) by the tetrahedra of ab. False: one of them has boundary faces at both of its ends. */
static bool mark_ring(struct links *links, const struct hood *hood, const struct working *working, uint32_t b)
{
    uint32_t slot_a = hood->vertex, slot_b = hood->slots[b];
    memset(links->marks, 0, hood->count);
    for (uint32_t i = 0; i < hood->tet_count; i++) {
        uint32_t ring[2] = {0, 0}, count = 0;
        if (hood->corners[0][i] != b && hood->corners[1][i] != b && hood->corners[2][i] != b)
            continue;
        for (int k = 0; k < 3; k++)
            if (hood->corners[k][i] != b)
                ring[count++ & 1] = hood->corners[k][i];
        links->marks[ring[0]] |= RING;
        links->marks[ring[1]] |= RING;
        *table_at(&links->pairs, pair_key(ring[0], ring[1]), 1) = 1;
        unsigned faces = working->boundary_faces[hood->tets[i]];
        const uint32_t *corners = working->corners[hood->tets[i]];
        if (!faces)
            continue;
        if (faces >> corner_of(corners, slot_a) & 1 && faces >> corner_of(corners, slot_b) & 1)
            return false;
        for (int k = 0; k < 2; k++)
            if (faces >> corner_of(corners, hood->slots[ring[k]]) & 1)
                links->marks[ring[1 - k]] |= OPEN;
    }
    return true;
}

/* Edges of Lk(a) between vertices of the ring that are not of Lk(ab), and triangles. Returns how many triangles. */
static uint32_t list_own(struct links *links, const struct hood *hood, uint32_t b)
{
    uint32_t triangles = 0;
    for (uint32_t i = 0; i < hood->tet_count; i++) {
        uint32_t v[3] = {hood->corners[0][i], hood->corners[1][i], hood->corners[2][i]}, on_ring = 0;
        if (v[0] == b || v[1] == b || v[2] == b)
            continue;
        for (int k = 0; k < 3; k++) {
            on_ring += links->marks[v[k]] & RING;
            if (links->marks[v[k]] & links->marks[v[(k + 1) % 3]] & RING)
                table_at(&links->pairs, pair_key(v[k], v[(k + 1) % 3]), 0);
        }
        if (on_ring == 3) {
            sort3(v);
            memcpy(links->triangles[triangles++], v, sizeof v);
        }
    }
    return triangles;
}

/* A tetrahedron of b's star without a: does its link triangle meet Lk(a) in Lk(ab) only? */
static bool meets_well(const struct links *links, const uint32_t v[3], uint32_t triangles)
{
    uint32_t on_ring = 0, sorted[3] = {v[0], v[1], v[2]};
    for (int k = 0; k < 3; k++) {
        if (v[k] != TETLOD_NONE && !(links->marks[v[k]] & RING))
            return false;
        on_ring += v[k] != TETLOD_NONE;
    }
    for (int k = 0; k < 3; k++) {
        uint32_t x = v[k], y = v[(k + 1) % 3];
        const uint32_t *found = x == TETLOD_NONE || y == TETLOD_NONE ? NULL : table_find(&links->pairs, pair_key(x, y));
        if (found && !*found)
            return false;
    }
    sort3(sorted);
    for (uint32_t i = 0; i < triangles && on_ring == 3; i++)
        if (memcmp(links->triangles[i], sorted, sizeof sorted) == 0)
            return false;
    return true;
}

bool links_hold(struct links *links, const struct hood *hood, const struct working *working, uint32_t neighbour, bool *out_room)
{
    uint32_t slot_a = hood->vertex, slot_b = hood->slots[neighbour];
    const struct span *star = &working->stars[slot_b];
    bool open = working->flags[slot_a] & working->flags[slot_b] & VERTEX_BOUNDARY;
    *out_room = true;
    if (open && !hood->along[neighbour])
        return false;
    if (!reserve(links, hood)) {
        *out_room = false;
        return false;
    }
    if (!mark_ring(links, hood, working, neighbour))
        return false;
    uint32_t triangles = list_own(links, hood, neighbour);
    for (uint32_t i = 0; i < star->count; i++) {
        uint32_t tet = working->pool[star->begin + i], v[3], count = 0;
        const uint32_t *corners = working->corners[tet];
        unsigned faces = working->boundary_faces[tet], has_a = 0;
        if (corners[0] == TETLOD_NONE)
            continue;
        for (unsigned c = 0; c < 4; c++) {
            has_a |= corners[c] == slot_a;
            if (corners[c] != slot_b && count < 3)
                v[count++] = corners[c] == slot_a ? TETLOD_NONE : hood_number(hood, corners[c]);
        }
        if (!has_a && !meets_well(links, v, triangles))
            return false;
        for (unsigned f = 0; f < 4 && open && faces; f++)
            for (unsigned c = 0; c < 4 && faces >> f & 1 && corners[f] != slot_b; c++) {
                uint32_t number = c == f || corners[c] == slot_b ? TETLOD_NONE : hood_number(hood, corners[c]);
                if (number != TETLOD_NONE)
                    links->marks[number] |= ALONG_B;
            }
    }
    for (uint32_t n = 0; n < hood->count && open; n++)
        if ((links->marks[n] & (RING | ALONG_B | OPEN)) == (RING | ALONG_B) && hood->along[n])
            return false;
    return true;
}
