/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/simplify/mesh/star_data.h"

#include <stdlib.h>
#include <string.h>

#include "src/util/array.h"

void star_data_fini(struct star_data *data)
{
    free(data->tets);
    for (int i = 0; i < 3; i++)
        free(data->corners[i]);
    free(data->slots);
    free(data->shared);
    free(data->along);
    free(data->rows);
    free(data->planes);
    free(data->doubtful);
    free(data->reach);
    free(data->numbers);
    *data = (struct star_data){0};
}

/* Larger arrays for stars of so many tetrahedra. What they hold is not needed. */
static bool grow(struct star_data *data, const struct working *working, size_t tets)
{
    size_t room = (tets + tets / 2 + 64) / BLOCK * BLOCK, neighbours = 3 * room;
    star_data_fini(data);
    data->tets = array_new(room, sizeof(uint32_t));
    for (int i = 0; i < 3; i++)
        data->corners[i] = array_new(room, sizeof(uint32_t));
    data->slots = array_new(neighbours, sizeof(uint32_t));
    data->shared = array_new(neighbours, sizeof(uint32_t));
    data->along = array_new(neighbours, 1);
    data->rows = array_new(neighbours, working->stride * sizeof(double));
    data->planes = array_new(room, plane_count(working->component_count) * sizeof(double));
    data->reach = array_new(neighbours, 2 * working->component_count * sizeof(double));
    data->doubtful = array_new(room, sizeof(uint32_t));
    data->numbers = array_zero(working->slot_count, sizeof(uint32_t));
    data->room = room;
    bool done = data->tets && data->corners[0] && data->corners[1] && data->corners[2] && data->slots && data->shared &&
                data->along && data->rows && data->planes && data->doubtful && data->reach && data->numbers;
    if (!done)
        star_data_fini(data);
    return done;
}

/* The corners beside each, so that with it first the tetrahedron is positive. */
static const uint8_t others_of[4][3] = {{1, 2, 3}, {0, 3, 2}, {0, 1, 3}, {0, 2, 1}};

/* Numbers the neighbours in the order in which the tetrahedra list them. Returns whether one of these has boundary
 * faces. */
static bool number_neighbours(struct star_data *data, const struct working *working, const uint32_t *tets,
                              uint32_t tet_count)
{
    uint32_t *const numbers = data->numbers, *const slots = data->slots, *const shared = data->shared;
    uint32_t *const out[3] = {data->corners[0], data->corners[1], data->corners[2]}, *const out_tets = data->tets;
    uint32_t count = 0, kept = 0, own = data->vertex;
    unsigned faces = 0;
    for (uint32_t i = 0; i < tet_count; i++) {
        const uint32_t *corners = working->corners[tets[i]];
        if (corners[0] == TETLOD_NONE)
            continue;
        const uint8_t *others = others_of[corner_of(corners, own)];
        for (int k = 0; k < 3; k++) {
            uint32_t slot = corners[others[k]], number = numbers[slot];
            if (number >= count || slots[number] != slot) {
                number = numbers[slot] = count++;
                slots[number] = slot;
                shared[number] = 0;
            }
            shared[number]++;
            out[k][kept] = number;
        }
        out_tets[kept++] = tets[i];
        faces |= __atomic_load_n(&working->boundary_faces[tets[i]], __ATOMIC_RELAXED); // border_find may be at it
    }
    data->tet_count = kept;
    data->count = count;
    return faces;
}

/* Which edges are on the boundary: two of each boundary face of the vertex. */
static void find_along(struct star_data *data, const struct working *working)
{
    for (uint32_t i = 0; i < data->tet_count; i++) {
        unsigned faces = __atomic_load_n(&working->boundary_faces[data->tets[i]], __ATOMIC_RELAXED);
        const uint8_t *others = others_of[corner_of(working->corners[data->tets[i]], data->vertex)];
        for (int k = 0; k < 3 && faces; k++)
            if (faces >> others[k] & 1) // the face of the vertex and the other two
                data->along[data->corners[(k + 1) % 3][i]] = data->along[data->corners[(k + 2) % 3][i]] = 1;
    }
}

bool star_data_gather(struct star_data *data, const struct working *working, uint32_t slot)
{
    const struct span *star = &working->stars[slot];
    const uint32_t *tets = working->pool + star->begin;
    if (star->count + BLOCK > data->room && !grow(data, working, star->count + BLOCK))
        return false;
    for (uint32_t i = 0; i < star->count; i++)
        __builtin_prefetch(working->corners[tets[i]]);
    data->vertex = slot;
    bool open = number_neighbours(data, working, tets, star->count);
    memset(data->along, 0, data->count);
    if (open)
        find_along(data, working);
    for (uint32_t n = 0; n < data->count; n++)
        __builtin_prefetch(working_row(working, data->slots[n]));
    return true;
}
