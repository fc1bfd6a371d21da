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

static inline uint32_t number_of(struct star_data *data, uint32_t slot)
{
    uint32_t number = data->numbers[slot];
    if (number >= data->count || data->slots[number] != slot) {
        number = data->numbers[slot] = data->count++;
        data->slots[number] = slot;
        data->shared[number] = 0;
        data->along[number] = 0;
    }
    data->shared[number]++;
    return number;
}

static inline void add_tet(struct star_data *data, const struct working *working, uint32_t tet)
{
    const uint32_t *corners = working->corners[tet];
    unsigned own = corner_of(corners, data->vertex);
    unsigned faces = __atomic_load_n(&working->boundary_faces[tet], __ATOMIC_RELAXED); // border_find may be at it
    const uint8_t *others = others_of[own];
    uint32_t i = data->tet_count++, number[3];
    data->tets[i] = tet;
    for (int k = 0; k < 3; k++)
        data->corners[k][i] = number[k] = number_of(data, corners[others[k]]);
    for (int k = 0; k < 3 && faces; k++)
        if (faces >> others[k] & 1) // the face of the vertex and the other two
            data->along[number[(k + 1) % 3]] = data->along[number[(k + 2) % 3]] = 1;
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
    data->tet_count = data->count = 0;
    for (uint32_t i = 0; i < star->count; i++)
        if (!tet_gone(working, tets[i]))
            add_tet(data, working, tets[i]);
    for (uint32_t n = 0; n < data->count; n++)
        __builtin_prefetch(working_row(working, data->slots[n]));
    return true;
}
