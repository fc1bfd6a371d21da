/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/cut/cut.h"

#include <stdlib.h>

#include "format/fail.h"
#include "src/cut/cut_add.h"
#include "src/mesh/adjacency.h"
#include "src/mesh/tet_geom.h"
#include "src/util/array.h"

/* A face that has come once so far, in the list of its least vertex. Where tetrahedra that are near each other come
 * near each other, few wait at a time, and what is looked at stays in the cache. */
struct face {
    uint32_t mid, high, slot, next; /* slot = 4 * tet + face; next entry, or TETLOD_NONE */
};

struct waiting {
    uint32_t *first; /* [vertex] entry, or TETLOD_NONE */
    struct face *faces;
    size_t face_cap;
    uint32_t count, free; /* entries in use or free again; the first of these */
};

static bool add(struct waiting *waiting, uint32_t low, uint32_t mid, uint32_t high, uint32_t slot)
{
    uint32_t entry = waiting->free;
    if (entry != TETLOD_NONE)
        waiting->free = waiting->faces[entry].next;
    else if (ARRAY_RESERVE(waiting->faces, waiting->face_cap, (size_t)waiting->count + 1))
        entry = waiting->count++;
    else
        return false;
    waiting->faces[entry] = (struct face){mid, high, slot, waiting->first[low]};
    waiting->first[low] = entry;
    return true;
}

/* A face that waits leaves, any other begins to wait. */
static bool toggle(struct waiting *waiting, const uint32_t *corners, uint32_t slot)
{
    const uint8_t *face = tet_faces[slot & 3];
    uint32_t a = corners[face[0]], b = corners[face[1]], c = corners[face[2]];
    uint32_t least = a < b ? a : b, most = a < b ? b : a;
    uint32_t low = least < c ? least : c, high = most > c ? most : c, mid = a ^ b ^ c ^ low ^ high;
    for (uint32_t *link = &waiting->first[low]; *link != TETLOD_NONE; link = &waiting->faces[*link].next) {
        struct face *other = &waiting->faces[*link];
        if (other->mid == mid && other->high == high) {
            uint32_t entry = *link;
            *link = other->next;
            other->next = waiting->free;
            waiting->free = entry;
            return true;
        }
    }
    return add(waiting, low, mid, high, slot);
}

static uint64_t mix(uint64_t x)
{
    x = (x ^ x >> 32) * 0xd6e8feb86659fd93u;
    return (x ^ x >> 32) * 0xd6e8feb86659fd93u;
}

/* At each vertex the faces that come an odd number of times, as far as 64 bits tell them apart: 0 where there is none.
 * Most vertices are inside, so that few faces are left for what takes longer. */
static void add_odd_faces(const struct tetmesh *mesh, uint64_t *odd)
{
    for (uint32_t t = 0; t < mesh->tet_count; t++) {
        const uint32_t *corners = mesh->corners + 4 * (size_t)t;
        uint64_t keys[4], faces[4], whole = 0, all = 0;
        for (int i = 0; i < 4; i++)
            whole += keys[i] = mix(corners[i] + (uint64_t)1);
        for (int i = 0; i < 4; i++)
            all ^= faces[i] = mix(whole - keys[i]);
        for (int i = 0; i < 4; i++)
            odd[corners[i]] ^= all ^ faces[i];
    }
}

static bool match_faces(const struct tetmesh *mesh, const uint64_t *odd, struct waiting *waiting)
{
    for (uint32_t v = 0; v < mesh->vertex_count; v++)
        waiting->first[v] = TETLOD_NONE;
    for (uint32_t slot = 0; slot < 4 * mesh->tet_count; slot++) {
        const uint32_t *corners = mesh->corners + (slot & ~3u);
        const uint8_t *face = tet_faces[slot & 3];
        if (odd[corners[face[0]]] && odd[corners[face[1]]] && odd[corners[face[2]]] && !toggle(waiting, corners, slot))
            return false;
    }
    return true;
}

static bool add_faces(const struct tetmesh *mesh, const struct waiting *waiting, uint32_t *numbers, struct cut *out)
{
    for (uint32_t v = 0; v < mesh->vertex_count; v++)
        numbers[v] = TETLOD_NONE;
    for (uint32_t v = 0; v < mesh->vertex_count; v++)
        for (uint32_t entry = waiting->first[v]; entry != TETLOD_NONE; entry = waiting->faces[entry].next) {
            uint32_t slot = waiting->faces[entry].slot, ids[3];
            const uint32_t *corners = mesh->corners + (slot & ~3u);
            for (int c = 0; c < 3; c++) {
                uint32_t vertex = corners[tet_faces[slot & 3][c]];
                if (numbers[vertex] == TETLOD_NONE && !cut_add_vertex(out, vertex, vertex, 0, &numbers[vertex]))
                    return false;
                ids[c] = numbers[vertex];
            }
            bool inverted = cut_is_inverted(mesh, corners);
            if (!cut_add_triangle(out, slot >> 2, ids[0], ids[inverted ? 2 : 1], ids[inverted ? 1 : 2]))
                return false;
        }
    return true;
}

enum tetlod_status cut_boundary(const struct tetmesh *mesh, struct cut *out, struct tetlod_error *error)
{
    if (mesh->tet_count > ADJACENCY_MAX_TETS)
        return tetlodi_fail(error, TETLOD_ERR_LIMIT, "%u tetrahedra are more than the %d that fit", mesh->tet_count,
                            ADJACENCY_MAX_TETS);
    struct waiting waiting = {.first = array_new(mesh->vertex_count, sizeof(uint32_t)), .free = TETLOD_NONE};
    uint32_t *numbers = array_new(mesh->vertex_count, sizeof *numbers);
    uint64_t *odd = array_zero(mesh->vertex_count, sizeof *odd);
    cut_empty(out);
    if (odd)
        add_odd_faces(mesh, odd);
    bool made = waiting.first && numbers && odd && match_faces(mesh, odd, &waiting) &&
                add_faces(mesh, &waiting, numbers, out);
    free(odd);
    free(waiting.first);
    free(waiting.faces);
    free(numbers);
    return cut_result(made, out, error);
}
