/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/simplify/mesh/links.h"

#include <stdlib.h>
#include <string.h>

#include "src/mesh/tet_geom.h"
#include "src/util/array.h"

/* Of a neighbour of a: it is in Lk(ab); its edge to b is on the boundary; its face with ab is; a vertex of b's star may
 * be it, as all may that are no neighbours of a, whose mark stands behind those of the neighbours. */
enum { RING = 1, ALONG_B = 2, OPEN = 4, MET = 8 };

void links_fini(struct links *links)
{
    free(links->marks);
    free(links->beside);
    free(links->copy);
    table_fini(&links->pairs);
    table_fini(&links->numbers);
    *links = (struct links){0};
}

static bool reserve(struct links *links, const struct star_data *data)
{
    return ARRAY_RESERVE(links->marks, links->mark_room, data->count + 1) &&
           ARRAY_RESERVE(links->beside, links->beside_room, data->count);
}

/* The vertex x of the ring has y beside it. False: it has two already, so that the ring is no cycle and no path. */
static bool join_ring(struct links *links, uint32_t x, uint32_t y)
{
    uint32_t *beside = links->beside[x];
    if (!(links->marks[x] & RING))
        beside[0] = beside[1] = TETLOD_NONE;
    links->marks[x] |= RING | MET;
    if (beside[0] != TETLOD_NONE && beside[1] != TETLOD_NONE)
        return false;
    beside[beside[0] != TETLOD_NONE] = y;
    return true;
}

/* Is the edge of two vertices of the ring in Lk(ab)? */
static inline bool in_ring(const struct links *links, uint32_t x, uint32_t y)
{
    return links->beside[x][0] == y || links->beside[x][1] == y;
}

/* Marks Lk(ab) by the tetrahedra of ab. False: one of them has boundary faces at both of its ends. */
static bool mark_ring(struct links *links, const struct star_data *data, const struct working *working, uint32_t b)
{
    uint32_t slot_a = data->vertex, slot_b = data->slots[b];
    memset(links->marks, 0, data->count);
    links->marks[b] = links->marks[data->count] = MET;
    for (uint32_t i = 0, left = data->shared[b]; left; i++) {
        uint32_t ring[2] = {0, 0}, count = 0;
        if ((data->corners[0][i] != b) & (data->corners[1][i] != b) & (data->corners[2][i] != b))
            continue;
        left--;
        for (int k = 0; k < 3; k++)
            if (data->corners[k][i] != b)
                ring[count++ & 1] = data->corners[k][i];
        if (!join_ring(links, ring[0], ring[1]) || !join_ring(links, ring[1], ring[0]))
            return false;
        unsigned faces = working->boundary_faces[data->tets[i]];
        const uint32_t *corners = working->corners[data->tets[i]];
        if (!faces)
            continue;
        if (faces >> corner_of(corners, slot_a) & 1 && faces >> corner_of(corners, slot_b) & 1)
            return false;
        for (int k = 0; k < 2; k++)
            if (faces >> corner_of(corners, data->slots[ring[k]]) & 1)
                links->marks[ring[1 - k]] |= OPEN;
    }
    return true;
}

/* Lists what Lk(a) has between vertices of the ring that is not of Lk(ab): edges, and the triangle inside a ring of
 * three; when it is first asked for, which is seldom. False: no memory. */
static bool list_own(struct links *links, const struct star_data *data, uint32_t b, bool *out_room)
{
    if (links->listed)
        return true;
    links->listed = true;
    links->pair_count = 0;
    links->closed = false;
    for (uint32_t i = 0; i < data->tet_count; i++) {
        uint32_t v[3] = {data->corners[0][i], data->corners[1][i], data->corners[2][i]}, of_ring = 0;
        unsigned marks[3] = {links->marks[v[0]], links->marks[v[1]], links->marks[v[2]]};
        if (!(((marks[0] & marks[1]) | (marks[1] & marks[2]) | (marks[2] & marks[0])) & RING))
            continue;
        for (int k = 0; k < 3 && v[0] != b && v[1] != b && v[2] != b; k++) {
            uint32_t x = v[k], y = v[(k + 1) % 3];
            if (!(marks[k] & marks[(k + 1) % 3] & RING))
                continue;
            if (in_ring(links, x, y))
                of_ring++;
            else if (!links->pair_count++ && !table_clear(&links->pairs, 3 * (size_t)data->tet_count))
                return *out_room = false;
            else
                table_at(&links->pairs, pair_key(x, y), 0);
        }
        links->closed |= of_ring == 3;
    }
    return true;
}

/* A tetrahedron of b's star without a, in numbers of the neighbours: does its link triangle, all of whose vertices may
 * be there, meet Lk(a) in Lk(ab) only? *out_room as in links_hold. */
static bool meets_well(struct links *links, const struct star_data *data, uint32_t b, const uint32_t v[4],
                       bool *out_room)
{
    uint32_t of_ring = 0;
    for (int k = 0; k < 4; k++)
        for (int l = k + 1; l < 4; l++) {
            if (!(links->marks[v[k]] & links->marks[v[l]] & RING))
                continue;
            if (in_ring(links, v[k], v[l])) {
                of_ring++;
                continue;
            }
            if (!list_own(links, data, b, out_room) ||
                (links->pair_count && table_find(&links->pairs, pair_key(v[k], v[l]))))
                return false;
        }
    // then the ring is that triangle, and both have it
    return of_ring < 3 || (list_own(links, data, b, out_room) && !links->closed);
}

/* Marks the edges at b of its boundary faces. */
static void mark_along(struct links *links, const uint32_t corners[4], const uint32_t v[4], unsigned faces,
                       uint32_t slot_b)
{
    for (unsigned f = 0; f < 4; f++)
        for (unsigned c = 0; c < 4 && faces >> f & 1 && corners[f] != slot_b; c++)
            if (c != f)
                links->marks[v[c]] |= ALONG_B;
}

bool links_hold(struct links *links, const struct star_data *data, const struct working *working, uint32_t neighbour,
                bool *out_room)
{
    uint32_t slot_a = data->vertex, slot_b = data->slots[neighbour];
    const struct span *star = &working->stars[slot_b];
    bool open = working->flags[slot_a] & working->flags[slot_b] & VERTEX_BOUNDARY;
    *out_room = true;
    if (open && !data->along[neighbour])
        return false;
    if (!reserve(links, data)) {
        *out_room = false;
        return false;
    }
    if (!mark_ring(links, data, working, neighbour))
        return false;
    links->listed = false;
    for (uint32_t i = 0; i < star->count; i++) {
        uint32_t tet = working->pool[star->begin + i], v[4], met = MET, of_ring = 0;
        const uint32_t *corners = working->corners[tet];
        if (corners[0] == TETLOD_NONE)
            continue;
        for (unsigned c = 0; c < 4; c++) {
            v[c] = star_data_number_or(data, corners[c], data->count);
            met &= links->marks[v[c]];
            of_ring += links->marks[v[c]] & RING;
        }
        if (!met)
            return false;
        bool has_a = (corners[0] == slot_a) | (corners[1] == slot_a) | (corners[2] == slot_a) | (corners[3] == slot_a);
        if (of_ring > 1 && !has_a && !meets_well(links, data, neighbour, v, out_room))
            return false;
        if (open && working->boundary_faces[tet])
            mark_along(links, corners, v, working->boundary_faces[tet], slot_b);
    }
    for (uint32_t n = 0; n < data->count && open; n++)
        if ((links->marks[n] & (RING | ALONG_B | OPEN)) == (RING | ALONG_B) && data->along[n])
            return false;
    return true;
}

/* ---- any simplex, on a copy of its star with the boundary coned to one more vertex */

enum { IN_A = 1, IN_B = 2, IN_AB = 4 };

/* Numbers of a copy's vertices are below 2^21; a triangle's key has the highest bit set. */
static const uint32_t MAX_OF_COPY = UINT32_C(1) << 21;

/* The simplex's vertices are 0 .. simplex_count-1, the cone's apex is simplex_count, the others follow. False: no
 * memory. */
static bool copy_star(struct links *links, const struct star *star, const struct working *working)
{
    bool room = ARRAY_RESERVE(links->copy, links->copy_room, 5 * (size_t)star->tet_count) &&
                ARRAY_RESERVE(links->marks, links->mark_room, 4 * (size_t)star->tet_count + 5);
    if (!room || !table_clear(&links->numbers, 4 * (size_t)star->tet_count + 4))
        return false;
    links->copy_count = links->copy_vertices = 0;
    for (uint32_t s = 0; s < star->simplex_count; s++)
        *table_at(&links->numbers, star->simplex[s], 0) = links->copy_vertices++;
    uint32_t apex = links->copy_vertices++;
    for (uint32_t i = 0; i < star->tet_count; i++) {
        uint32_t tet[4];
        for (unsigned c = 0; c < 4; c++) {
            tet[c] = *table_at(&links->numbers, working->corners[star->tets[i]][c], links->copy_vertices);
            links->copy_vertices += tet[c] == links->copy_vertices;
        }
        memcpy(links->copy[links->copy_count++], tet, sizeof tet);
        for (unsigned f = 0; f < 4; f++)
            if (working->boundary_faces[star->tets[i]] >> f & 1) {
                memcpy(links->copy[links->copy_count], tet, sizeof tet);
                links->copy[links->copy_count++][f] = apex;
            }
    }
    return true;
}

static unsigned corner_mask(const uint32_t tet[4], uint32_t a, uint32_t b)
{
    unsigned mask = 0;
    for (int c = 0; c < 4; c++)
        mask |= tet[c] == a ? IN_A : tet[c] == b ? IN_B : 0;
    return mask;
}

/* Is the vertex in both links? */
static bool on_ring(const uint8_t *marks, uint32_t v)
{
    return (marks[v] & (IN_A | IN_B)) == (IN_A | IN_B);
}

static uint32_t least_of(uint32_t x, uint32_t y)
{
    return x < y ? x : y;
}

static uint64_t triangle_key(const uint32_t v[3])
{
    uint64_t least = least_of(v[0], least_of(v[1], v[2])), sum = (uint64_t)v[0] + v[1] + v[2];
    uint64_t greatest = (uint32_t)~least_of(~v[0], least_of(~v[1], ~v[2]));
    return (uint64_t)1 << 63 | least << 42 | (sum - least - greatest) << 21 | greatest;
}

/* Marks the vertices of both links, and files the edges of Lk(ab) with the value 1. False: a common vertex is outside
 * Lk(ab). */
static bool file_ring(struct links *links, uint32_t a, uint32_t b)
{
    uint8_t *marks = links->marks;
    memset(marks, 0, links->copy_vertices);
    for (uint32_t i = 0; i < links->copy_count; i++) {
        const uint32_t *tet = links->copy[i];
        unsigned mask = corner_mask(tet, a, b);
        uint32_t ends[2] = {0, 0}, count = 0;
        for (int c = 0; c < 4 && mask; c++) {
            marks[tet[c]] |= (uint8_t)(mask == (IN_A | IN_B) ? IN_A | IN_B | IN_AB : mask);
            if (tet[c] != a && tet[c] != b)
                ends[count++ & 1] = tet[c];
        }
        if (mask == (IN_A | IN_B))
            *table_at(&links->pairs, pair_key(ends[0], ends[1]), 1) = 1;
    }
    marks[a] = marks[b] = 0;
    for (uint32_t v = 0; v < links->copy_vertices; v++)
        if (on_ring(marks, v) && !(marks[v] & IN_AB))
            return false;
    return true;
}

/* What a tetrahedron of a or of b has between vertices of the ring: of a it is filed; of b, false if a has it and
 * Lk(ab) does not. */
static bool compare_links(struct links *links, const uint32_t tet[4], unsigned mask)
{
    uint32_t v[4], count = 0;
    for (int c = 0; c < 4; c++)
        if (on_ring(links->marks, tet[c]))
            v[count++] = tet[c];
    for (uint32_t i = 0; i < count; i++)
        for (uint32_t k = i + 1; k < count; k++) {
            uint64_t key = pair_key(v[i], v[k]);
            const uint32_t *found = mask == IN_A ? table_at(&links->pairs, key, 0) : table_find(&links->pairs, key);
            if (mask == IN_B && found && !*found)
                return false;
        }
    if (count == 3 && mask == IN_A)
        table_at(&links->pairs, triangle_key(v), 0);
    return !(count == 3 && mask == IN_B && table_find(&links->pairs, triangle_key(v)));
}

/* Lk(a) and Lk(b) meet in Lk(ab) only. */
static bool edge_links_meet_well(struct links *links, uint32_t a, uint32_t b)
{
    if (!file_ring(links, a, b))
        return false;
    for (unsigned mask = IN_A; mask <= IN_B; mask++)
        for (uint32_t i = 0; i < links->copy_count; i++)
            if (corner_mask(links->copy[i], a, b) == mask && !compare_links(links, links->copy[i], mask))
                return false;
    return true;
}

/* Contracts b into a in the copy. */
static void copy_contract(struct links *links, uint32_t a, uint32_t b)
{
    uint32_t kept = 0;
    for (uint32_t i = 0; i < links->copy_count; i++) {
        if (corner_mask(links->copy[i], a, b) == (IN_A | IN_B))
            continue;
        for (int c = 0; c < 4; c++)
            links->copy[kept][c] = links->copy[i][c] == b ? a : links->copy[i][c];
        kept++;
    }
    links->copy_count = kept;
}

bool links_hold_star(struct links *links, const struct star *star, const struct working *working, bool *out_room)
{
    *out_room = copy_star(links, star, working);
    if (!*out_room || links->copy_vertices >= MAX_OF_COPY)
        return false;
    for (uint32_t s = 1; s < star->simplex_count; s++) {
        if (!table_clear(&links->pairs, 4 * (size_t)links->copy_count + 1)) {
            *out_room = false;
            return false;
        }
        if (!edge_links_meet_well(links, 0, s))
            return false;
        copy_contract(links, 0, s);
    }
    return true;
}
