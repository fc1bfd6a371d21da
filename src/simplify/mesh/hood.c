/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/simplify/mesh/hood.h"

#include <stdlib.h>
#include <string.h>

#include "src/simplify/mesh/kernels.h"
#include "src/util/array.h"

void hood_fini(struct hood *hood)
{
    free(hood->tets);
    for (int i = 0; i < 3; i++)
        free(hood->corners[i]);
    free(hood->slots);
    free(hood->shared);
    free(hood->along);
    free(hood->rows);
    free(hood->planes);
    free(hood->doubtful);
    free(hood->reach);
    free(hood->numbers);
    *hood = (struct hood){0};
}

/* Larger arrays for stars of so many tetrahedra. What they hold is not needed. */
static bool grow(struct hood *hood, const struct working *working, size_t tets)
{
    size_t room = (tets + tets / 2 + 64) / BLOCK * BLOCK, neighbours = 3 * room;
    hood_fini(hood);
    hood->tets = array_new(room, sizeof(uint32_t));
    for (int i = 0; i < 3; i++)
        hood->corners[i] = array_new(room, sizeof(uint32_t));
    hood->slots = array_new(neighbours, sizeof(uint32_t));
    hood->shared = array_new(neighbours, sizeof(uint32_t));
    hood->along = array_new(neighbours, 1);
    hood->rows = array_new(neighbours, working->stride * sizeof(double));
    hood->planes = array_new(room, plane_count(working->component_count) * sizeof(double));
    hood->reach = array_new(neighbours, 2 * working->component_count * sizeof(double));
    hood->doubtful = array_new(room, sizeof(uint32_t));
    hood->numbers = array_zero(working->slot_count, sizeof(uint32_t));
    hood->room = room;
    bool done = hood->tets && hood->corners[0] && hood->corners[1] && hood->corners[2] && hood->slots && hood->shared &&
                hood->along && hood->rows && hood->planes && hood->doubtful && hood->reach && hood->numbers;
    if (!done)
        hood_fini(hood);
    return done;
}

/* The corners beside each, so that with it first the tetrahedron is positive. */
static const uint8_t others_of[4][3] = {{1, 2, 3}, {0, 3, 2}, {0, 1, 3}, {0, 2, 1}};

static inline uint32_t number_of(struct hood *hood, uint32_t slot)
{
    uint32_t number = hood_number(hood, slot);
    if (number == TETLOD_NONE) {
        number = hood->count++;
        hood->numbers[slot] = number;
        hood->slots[number] = slot;
        hood->shared[number] = 0;
        hood->along[number] = 0;
    }
    hood->shared[number]++;
    return number;
}

static inline void add_tet(struct hood *hood, const struct working *working, uint32_t tet)
{
    const uint32_t *corners = working->corners[tet];
    unsigned own = corner_of(corners, hood->vertex);
    unsigned faces = __atomic_load_n(&working->boundary_faces[tet], __ATOMIC_RELAXED); // border_find may be at it
    const uint8_t *others = others_of[own];
    uint32_t i = hood->tet_count++, number[3];
    hood->tets[i] = tet;
    for (int k = 0; k < 3; k++)
        hood->corners[k][i] = number[k] = number_of(hood, corners[others[k]]);
    for (int k = 0; k < 3 && faces; k++)
        if (faces >> others[k] & 1) // the face of the vertex and the other two
            hood->along[number[(k + 1) % 3]] = hood->along[number[(k + 2) % 3]] = 1;
}

bool hood_gather(struct hood *hood, const struct working *working, uint32_t slot)
{
    const struct span *star = &working->stars[slot];
    const uint32_t *tets = working->pool + star->begin;
    if (star->count + BLOCK > hood->room && !grow(hood, working, star->count + BLOCK))
        return false;
    for (uint32_t i = 0; i < star->count; i++)
        __builtin_prefetch(working->corners[tets[i]]);
    hood->vertex = slot;
    hood->tet_count = hood->count = 0;
    for (uint32_t i = 0; i < star->count; i++)
        if (!tet_gone(working, tets[i]))
            add_tet(hood, working, tets[i]);
    for (uint32_t n = 0; n < hood->count; n++)
        __builtin_prefetch(working_row(working, hood->slots[n]));
    return true;
}
