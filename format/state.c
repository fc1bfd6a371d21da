/* SPDX-License-Identifier: BSD-3-Clause */
#include "format/state.h"

#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

#include "format/fail.h"

enum tetlod_status tetlodi_state_init(struct tetlodi_state *state, const uint32_t *components, uint32_t field_count,
                                      size_t max_bytes, struct tetlod_error *error)
{
    *state = (struct tetlodi_state){.components = components, .field_count = field_count, .row = 3, .max_bytes = max_bytes};
    for (uint32_t f = 0; f < field_count; f++)
        state->row += components[f];
    state->fields = calloc(field_count ? field_count : 1, sizeof *state->fields);
    return state->fields ? TETLOD_OK : tetlodi_fail_nomem(error, "the fields", field_count * sizeof *state->fields);
}

void tetlodi_state_fini(struct tetlodi_state *state)
{
    for (uint32_t f = 0; f < state->field_count && state->fields; f++)
        free(state->fields[f]);
    free(state->fields);
    free(state->positions);
    free(state->parents);
    free(state->corners);
    free(state->stars);
    free(state->pool);
    free(state->undos);
    free(state->undo_rows);
    *state = (struct tetlodi_state){0};
}

/* What the arrays take at the given capacities. */
static size_t bytes_at(const struct tetlodi_state *state, size_t vertices, size_t tets)
{
    return vertices * (state->row * sizeof(double) + sizeof(uint32_t) + sizeof(struct tetlodi_star)) + tets * 4 * 4 +
           state->pool_capacity * 4 + state->undo_capacity * sizeof(struct tetlodi_undo) + state->undo_row_capacity * 8;
}

static bool resize(void *pointer, size_t count, size_t size)
{
    void **array = pointer;
    void *moved = realloc(*array, count && size ? count * size : 1);
    *array = moved ? moved : *array;
    return moved;
}

static size_t grown(size_t capacity, size_t needed)
{
    size_t more = capacity + capacity / 4 + 64;
    return more > needed ? more : needed;
}

enum tetlod_status tetlodi_state_reserve(struct tetlodi_state *state, size_t vertices, size_t tets,
                                         struct tetlod_error *error)
{
    bool done = true;
    if (bytes_at(state, vertices, tets) > state->max_bytes)
        return tetlodi_fail(error, TETLOD_ERR_LIMIT, "%zu vertices and %zu tetrahedra take more than the %zu bytes allowed",
                            vertices, tets, state->max_bytes);
    if (vertices > state->vertex_capacity) {
        size_t capacity = grown(state->vertex_capacity, vertices);
        done = resize(&state->positions, capacity, 3 * sizeof(double)) &&
               resize(&state->parents, capacity, sizeof(uint32_t)) &&
               resize(&state->stars, capacity, sizeof *state->stars);
        for (uint32_t f = 0; f < state->field_count && done; f++)
            done = !state->components[f] || resize(&state->fields[f], capacity, state->components[f] * sizeof(double));
        state->vertex_capacity = done ? capacity : state->vertex_capacity;
    }
    if (done && tets > state->tet_capacity) {
        size_t capacity = grown(state->tet_capacity, tets);
        done = resize(&state->corners, capacity, 4 * sizeof(uint32_t));
        state->tet_capacity = done ? capacity : state->tet_capacity;
    }
    return done ? TETLOD_OK : tetlodi_fail_nomem(error, "the mesh", bytes_at(state, vertices, tets));
}

/* ---- stars */

/* Moves all stars together when half of the pool is dead. Room is left behind each. */
static enum tetlod_status compact_pool(struct tetlodi_state *state, size_t needed, struct tetlod_error *error)
{
    size_t size = needed;
    for (uint32_t v = 0; v < state->vertices; v++)
        size += state->stars[v].count + state->stars[v].count / 4 + 2;
    size_t capacity = size + size / 4;
    uint32_t *pool = malloc(capacity * sizeof *pool);
    if (!pool)
        return tetlodi_fail_nomem(error, "the stars", capacity * sizeof *pool);
    state->pool_size = 0;
    for (uint32_t v = 0; v < state->vertices; v++) {
        struct tetlodi_star *star = &state->stars[v];
        memcpy(pool + state->pool_size, state->pool + star->begin, star->count * sizeof *pool);
        star->begin = state->pool_size;
        star->capacity = star->count + star->count / 4 + 2;
        state->pool_size += star->capacity;
    }
    free(state->pool);
    state->pool = pool;
    state->pool_capacity = capacity;
    state->pool_dead = 0;
    return TETLOD_OK;
}

/* Room in the star of v for `count` tetrahedra. Its pointer into the pool changes. */
static enum tetlod_status reserve_star(struct tetlodi_state *state, uint32_t v, uint32_t count,
                                       struct tetlod_error *error)
{
    struct tetlodi_star *star = &state->stars[v];
    if (count <= star->capacity)
        return TETLOD_OK;
    uint32_t capacity = count + count / 4 + 2;
    if (state->pool_capacity - state->pool_size < capacity) {
        if (state->pool_dead > state->pool_size / 4) {
            TETLOD_TRY(compact_pool(state, capacity, error));
        } else {
            size_t more = grown(state->pool_capacity, state->pool_size + capacity);
            if (!resize(&state->pool, more, sizeof *state->pool))
                return tetlodi_fail_nomem(error, "the stars", more * sizeof *state->pool);
            state->pool_capacity = more;
        }
    }
    if (count <= star->capacity) // compacting left room
        return TETLOD_OK;
    memcpy(state->pool + state->pool_size, state->pool + star->begin, star->count * sizeof *state->pool);
    state->pool_dead += star->capacity;
    star->begin = state->pool_size;
    star->capacity = capacity;
    state->pool_size += capacity;
    return TETLOD_OK;
}

static enum tetlod_status push_star(struct tetlodi_state *state, uint32_t v, uint32_t tet, struct tetlod_error *error)
{
    struct tetlodi_star *star = &state->stars[v];
    TETLOD_TRY(reserve_star(state, v, star->count + 1, error));
    state->pool[star->begin + star->count++] = tet;
    return TETLOD_OK;
}

enum tetlod_status tetlodi_state_begin(struct tetlodi_state *state, uint32_t vertices, uint32_t tets,
                                       struct tetlod_error *error)
{
    state->vertices = vertices;
    state->tets = tets;
    for (uint32_t v = 0; v < vertices; v++) {
        state->stars[v] = (struct tetlodi_star){0};
        state->parents[v] = v;
    }
    for (size_t c = 0; c < 4 * (size_t)tets; c++)
        TETLOD_TRY(push_star(state, state->corners[c], (uint32_t)(c / 4), error));
    return TETLOD_OK;
}

/* ---- split and undo */

static void copy_row(const struct tetlodi_state *state, uint32_t v, double *row)
{
    memcpy(row, state->positions + 3 * (size_t)v, 3 * sizeof *row);
    row += 3;
    for (uint32_t f = 0; f < state->field_count; row += state->components[f++])
        if (state->components[f])
            memcpy(row, state->fields[f] + (size_t)v * state->components[f], state->components[f] * sizeof *row);
}

static void set_row(struct tetlodi_state *state, uint32_t v, const double *position, const double *values)
{
    memcpy(state->positions + 3 * (size_t)v, position, 3 * sizeof *position);
    for (uint32_t f = 0; f < state->field_count; values += state->components[f++])
        if (state->components[f])
            memcpy(state->fields[f] + (size_t)v * state->components[f], values, state->components[f] * sizeof *values);
}

static enum tetlod_status remember(struct tetlodi_state *state, const struct tetlodi_record *record,
                                   struct tetlod_error *error)
{
    size_t count = state->undo_count + 1;
    if (count > state->undo_capacity) {
        size_t more = grown(state->undo_capacity, count);
        if (!resize(&state->undos, more, sizeof *state->undos) ||
            !resize(&state->undo_rows, more, state->row * sizeof(double)))
            return tetlodi_fail_nomem(error, "the way back", more * (sizeof *state->undos + state->row * 8));
        state->undo_capacity = more;
        state->undo_row_capacity = more * state->row;
    }
    state->undos[state->undo_count] = (struct tetlodi_undo){record->slot, record->children, state->tets};
    copy_row(state, record->slot, state->undo_rows + state->undo_count * state->row);
    state->undo_count = count;
    return TETLOD_OK;
}

/* Hands the star's tetrahedra to the children, in order; what the first child keeps closes up. */
static enum tetlod_status deal_star(struct tetlodi_state *state, const struct tetlodi_record *record,
                                    uint32_t first_new, struct tetlod_error *error)
{
    uint32_t count = state->stars[record->slot].count, kept = 0;
    for (uint32_t i = 0; i < count; i++) {
        uint32_t *tets = state->pool + state->stars[record->slot].begin, tet = tets[i];
        if (record->labels[i] == 0) {
            tets[kept++] = tet;
            continue;
        }
        uint32_t child = first_new + record->labels[i] - 1;
        uint32_t *corners = state->corners + 4 * (size_t)tet;
        for (int c = 0; c < 4; c++)
            if (corners[c] == record->slot)
                corners[c] = child;
        // compacting meanwhile keeps the order and the whole of the slot's old star, whose count still stands
        TETLOD_TRY(push_star(state, child, tet, error));
    }
    state->stars[record->slot].count = kept;
    return TETLOD_OK;
}

enum tetlod_status tetlodi_state_split(struct tetlodi_state *state, const struct tetlodi_record *record,
                                       struct tetlod_error *error)
{
    uint32_t first_new = state->vertices;
    TETLOD_TRY(remember(state, record, error));
    set_row(state, record->slot, record->positions[0], record->values[0]);
    for (uint32_t child = 1; child < record->children; child++) {
        uint32_t v = state->vertices++;
        state->stars[v] = (struct tetlodi_star){0};
        state->parents[v] = record->slot;
        set_row(state, v, record->positions[child], record->values[child]);
    }
    TETLOD_TRY(deal_star(state, record, first_new, error));
    for (uint32_t i = 0; i < record->tet_count; i++) {
        uint32_t tet = state->tets++;
        memcpy(state->corners + 4 * (size_t)tet, record->tets[i], 4 * sizeof(uint32_t));
        for (int c = 0; c < 4; c++)
            TETLOD_TRY(push_star(state, record->tets[i][c], tet, error));
    }
    return TETLOD_OK;
}

/* Merges the ascending star of a child back into the ascending star of the slot, from the end. */
static enum tetlod_status merge_star(struct tetlodi_state *state, uint32_t slot, uint32_t child,
                                     struct tetlod_error *error)
{
    uint32_t i = state->stars[slot].count, j = state->stars[child].count;
    TETLOD_TRY(reserve_star(state, slot, i + j, error));
    uint32_t *into = state->pool + state->stars[slot].begin, *from = state->pool + state->stars[child].begin;
    state->stars[slot].count = i + j;
    for (uint32_t k = 0; k < j; k++) {
        uint32_t *corners = state->corners + 4 * (size_t)from[k];
        for (int c = 0; c < 4; c++)
            if (corners[c] == child)
                corners[c] = slot;
    }
    while (j)
        if (i && into[i - 1] > from[j - 1]) {
            into[i + j - 1] = into[i - 1];
            i--;
        } else {
            into[i + j - 1] = from[j - 1];
            j--;
        }
    return TETLOD_OK;
}

enum tetlod_status tetlodi_state_undo(struct tetlodi_state *state, struct tetlod_error *error)
{
    struct tetlodi_undo undo = state->undos[state->undo_count - 1];
    while (state->tets > undo.tets) { // the last to come is the last in each of its stars
        const uint32_t *corners = state->corners + 4 * (size_t)--state->tets;
        for (int c = 0; c < 4; c++)
            state->stars[corners[c]].count--;
    }
    for (uint32_t child = undo.children; child-- > 1;) {
        uint32_t v = state->vertices - 1;
        TETLOD_TRY(merge_star(state, undo.slot, v, error));
        state->pool_dead += state->stars[v].capacity;
        state->vertices--;
    }
    const double *row = state->undo_rows + --state->undo_count * state->row;
    set_row(state, undo.slot, row, row + 3);
    return TETLOD_OK;
}
