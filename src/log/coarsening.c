/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/log/coarsening.h"

#include <stdlib.h>
#include <string.h>

#include "format/fail.h"
#include "src/mesh/adjacency.h"
#include "src/mesh/grid.h"
#include "src/util/array.h"
#include "src/util/parallel.h"

enum { TETS_A_CHUNK = 16384 };

/* ---- beginning and end */

uint64_t coarsening_bytes(const struct tetmesh *mesh)
{
    uint64_t components = 0;
    for (uint32_t f = 0; f < mesh->field_count; f++)
        components += mesh->fields[f].components;
    return (uint64_t)mesh->vertex_count * (24 + 8 * components + 1 + 4 * 4) + (uint64_t)mesh->tet_count * (16 + 16 + 1);
}

/* Numbers of before the last step are no longer known. */
static void forget_last(struct coarsening *coarsening)
{
    struct coarse_before *last = &coarsening->last;
    free(last->numbers.living);
    free(last->numbers.before);
    free(last->own_corners);
    free(last->states);
    *last = (struct coarse_before){0};
}

void coarsening_fini(struct coarsening *coarsening)
{
    for (uint32_t f = 0; f < coarsening->field_count; f++)
        free(coarsening->fields[f].values);
    forget_last(coarsening);
    void *const owned[] = {coarsening->positions, coarsening->fields,  coarsening->own_corners, coarsening->neighbours,
                           coarsening->states,    coarsening->slots,   coarsening->into,        coarsening->touched,
                           coarsening->slot_of,   coarsening->tet_of,  (void *)coarsening->log_values};
    for (size_t i = 0; i < sizeof owned / sizeof *owned; i++)
        free(owned[i]);
    *coarsening = (struct coarsening){0};
}

static bool copy_fields(struct coarsening *coarsening, const struct tetmesh *mesh)
{
    coarsening->fields = array_zero(mesh->field_count, sizeof *coarsening->fields);
    for (uint32_t f = 0; f < mesh->field_count && coarsening->fields; f++) {
        const struct point_field *field = &mesh->fields[f];
        size_t count = (size_t)mesh->vertex_count * field->components;
        coarsening->fields[f] = (struct coarse_field){field->components, array_new(count, sizeof(double))};
        coarsening->field_count++;
        if (!coarsening->fields[f].values)
            return false;
        for (size_t i = 0; i < count; i++)
            coarsening->fields[f].values[i] = field->grid.bits ? grid_round(&field->grid, field->type,
                                                                            field->values[i]) : field->values[i];
    }
    return coarsening->fields;
}

enum tetlod_status coarsening_init(struct coarsening *coarsening, const struct tetmesh *mesh,
                                   const struct contraction_log *log,
                                   struct tetlod_error *error)
{
    size_t n = mesh->vertex_count, m = mesh->tet_count;
    *coarsening = (struct coarsening){.slot_count = mesh->vertex_count,
                                      .stored = mesh->tet_count,
                                      .tets = mesh->tet_count,
                                      .positions = array_new(n, 3 * sizeof(double)),
                                      .corners = mesh->corners,
                                      .states = array_zero(m, 1),
                                      .slots = array_zero(n, 1),
                                      .into = array_new(n, sizeof(uint32_t)),
                                      .touched = array_new(n, sizeof(uint32_t)),
                                      .tet_of = array_new(n, sizeof(uint32_t)),
                                      .slot_of = array_new(log ? log->count : 0, sizeof(uint32_t)),
                                      .log_values = array_new(mesh->field_count, sizeof(double *))};
    bool room = coarsening->positions && coarsening->states && coarsening->slots && coarsening->into &&
                coarsening->touched && coarsening->tet_of && coarsening->slot_of && coarsening->log_values &&
                copy_fields(coarsening, mesh);
    if (!room) {
        coarsening_fini(coarsening);
        return tetlodi_fail_nomem(error, "the levels' mesh", coarsening_bytes(mesh));
    }
    memcpy(coarsening->positions, mesh->positions, n * 3 * sizeof(double));
    for (size_t v = 0; v < n; v++)
        coarsening->tet_of[v] = TETLOD_NONE;
    for (size_t i = 4 * m; i-- > 0;)
        coarsening->tet_of[mesh->corners[i]] = (uint32_t)(i / 4);
    for (uint32_t f = 0; f < mesh->field_count && log; f++)
        coarsening->log_values[f] = log->fields[f].values;
    return TETLOD_OK;
}

void coarsening_adopt_corners(struct coarsening *coarsening, struct tetmesh *mesh)
{
    coarsening->own_corners = mesh->corners;
    mesh->corners = NULL;
}

static enum tetlod_status no_memory(const struct coarsening *coarsening, struct tetlod_error *error)
{
    return tetlodi_fail_nomem(error, "the levels' mesh", 32 * (uint64_t)coarsening->stored);
}

enum tetlod_status coarsening_need_neighbours(struct coarsening *coarsening, struct tetlod_error *error)
{
    if (coarsening->neighbours)
        return TETLOD_OK;
    coarsening->neighbours = array_new(coarsening->stored, 4 * sizeof *coarsening->neighbours);
    return coarsening->neighbours ? adjacency_build(coarsening->corners, coarsening->stored, coarsening->slot_count,
                                                    coarsening->neighbours, NULL, error)
                                  : no_memory(coarsening, error);
}

/* ---- what a step consists of */

static void touch(struct coarsening *coarsening, uint32_t slot, unsigned flag)
{
    if (!coarsening->in_step)
        coarsening->touched_count = 0;
    coarsening->in_step = true;
    if (!(coarsening->slots[slot] & SLOT_IN_STEP))
        coarsening->touched[coarsening->touched_count++] = slot;
    coarsening->slots[slot] |= (uint8_t)(flag | SLOT_IN_STEP);
}

void coarsening_merge(struct coarsening *coarsening, uint32_t slot, uint32_t into)
{
    coarsening->into[slot] = into;
    touch(coarsening, into, SLOT_MADE);
    touch(coarsening, slot, SLOT_MERGED);
}

void coarsening_move(struct coarsening *coarsening, uint32_t slot, const double *positions, const double *const *values,
                     size_t row)
{
    memcpy(coarsening->positions + 3 * (size_t)slot, positions + 3 * row, 3 * sizeof(double));
    for (uint32_t f = 0; f < coarsening->field_count; f++) {
        size_t n = coarsening->fields[f].components;
        memcpy(coarsening->fields[f].values + n * slot, values[f] + n * row, n * sizeof(double));
    }
    touch(coarsening, slot, SLOT_MADE);
}

/* Where each slot that merged in this step has come to in the end. */
static void follow_merges(struct coarsening *coarsening)
{
    for (size_t i = 0; i < coarsening->touched_count; i++) {
        uint32_t slot = coarsening->touched[i], end = slot;
        while (coarsening->slots[end] & SLOT_MERGED)
            end = coarsening->into[end];
        while (coarsening->slots[slot] & SLOT_MERGED) {
            uint32_t next = coarsening->into[slot];
            coarsening->into[slot] = end;
            slot = next;
        }
    }
}

/* ---- tetrahedra */

static bool four_different(const uint32_t c[4])
{
    return c[0] != c[1] && c[0] != c[2] && c[0] != c[3] && c[1] != c[2] && c[1] != c[3] && c[2] != c[3];
}

/* Where a corner is after the step. */
static inline uint32_t slot_now(const struct coarsening *coarsening, uint32_t slot)
{
    return coarsening->slots[slot] & SLOT_MERGED ? coarsening->into[slot] : slot;
}

static void corners_now(const struct coarsening *coarsening, const uint32_t *corners, uint32_t out[4])
{
    for (int i = 0; i < 4; i++)
        out[i] = slot_now(coarsening, corners[i]);
}

/* What the step does to each tetrahedron; its corners are still those of before. */
static void find_states(void *context, unsigned worker, size_t begin, size_t end)
{
    struct coarsening *coarsening = context;
    const uint8_t *slots = coarsening->slots;
    uint8_t *states = coarsening->states;
    (void)worker;
    for (size_t t = begin; t < end; t++) {
        const uint32_t *c = coarsening->corners + 4 * t;
        uint32_t now[4];
        if (states[t] >= COARSE_DIED) {
            states[t] = COARSE_GONE;
            continue;
        }
        states[t] = COARSE_SAME;
        if (!((slots[c[0]] | slots[c[1]] | slots[c[2]] | slots[c[3]]) & SLOT_IN_STEP))
            continue;
        corners_now(coarsening, c, now);
        states[t] = four_different(now) ? COARSE_CHANGED : COARSE_DIED;
    }
}

static bool is_of_step(const struct coarsening *coarsening, size_t tet)
{
    return coarsening->states[tet] == COARSE_CHANGED || coarsening->states[tet] == COARSE_DIED;
}

static void update_corners(void *context, unsigned worker, size_t begin, size_t end)
{
    struct coarsening *coarsening = context;
    (void)worker;
    for (size_t t = begin; t < end; t++)
        if (is_of_step(coarsening, t))
            corners_now(coarsening, coarsening->own_corners + 4 * t, coarsening->own_corners + 4 * t);
}

/* Through a tetrahedron that died: by the face `slot` one comes in and, as that face has three different corners,
 * exactly one of them is the corner across it as well. The faces across these two corners have become one. */
static uint32_t pass_through(const struct coarsening *coarsening, uint32_t slot)
{
    const uint32_t *corners = coarsening->corners + (slot & ~UINT32_C(3));
    for (uint32_t c = 0; c < 4; c++)
        if (c != (slot & 3) && corners[c] == corners[slot & 3])
            return coarsening->neighbours[(slot & ~UINT32_C(3)) + c];
    return TETLOD_NONE;
}

static uint32_t pass_dead(const struct coarsening *coarsening, uint32_t slot)
{
    while (slot != TETLOD_NONE && coarsening->states[slot / 4] == COARSE_DIED)
        slot = pass_through(coarsening, slot);
    return slot;
}

/* What is next to a tetrahedron that died was changed: the two faces that became one hold the merged vertex. */
static void join_neighbours(void *context, unsigned worker, size_t begin, size_t end)
{
    struct coarsening *coarsening = context;
    (void)worker;
    for (size_t t = begin; t < end; t++)
        for (size_t i = 4 * t; i < 4 * t + 4 && coarsening->states[t] == COARSE_CHANGED; i++)
            coarsening->neighbours[i] = pass_dead(coarsening, coarsening->neighbours[i]);
}

/* Every slot keeps a tetrahedron that is there: where its own died, the least of those that changed. */
static void forget_dead(void *context, unsigned worker, size_t begin, size_t end)
{
    struct coarsening *coarsening = context;
    (void)worker;
    for (size_t t = begin; t < end; t++)
        for (size_t i = 4 * t; i < 4 * t + 4 && coarsening->states[t] == COARSE_DIED; i++) {
            _Atomic uint32_t *tet_of = &coarsening->tet_of[coarsening->corners[i]];
            uint32_t tet = atomic_load_explicit(tet_of, memory_order_relaxed);
            if (tet != TETLOD_NONE && coarsening->states[tet] >= COARSE_DIED)
                atomic_store_explicit(tet_of, TETLOD_NONE, memory_order_relaxed);
        }
}

static void offer_changed(void *context, unsigned worker, size_t begin, size_t end)
{
    struct coarsening *coarsening = context;
    (void)worker;
    for (size_t t = begin; t < end; t++)
        for (size_t i = 4 * t; i < 4 * t + 4 && coarsening->states[t] == COARSE_CHANGED; i++) {
            _Atomic uint32_t *tet_of = &coarsening->tet_of[coarsening->corners[i]];
            uint32_t tet = atomic_load_explicit(tet_of, memory_order_relaxed);
            while (t < tet && !atomic_compare_exchange_weak(tet_of, &tet, (uint32_t)t))
                ;
        }
}

/* Tetrahedra keep their numbers: what has changed is changed in place. */
static enum tetlod_status step_in_place(struct coarsening *coarsening, unsigned threads, struct tetlod_error *error)
{
    void (*const passes[])(void *, unsigned, size_t, size_t) = {update_corners, join_neighbours, forget_dead,
                                                                offer_changed};
    TETLOD_TRY(coarsening_need_neighbours(coarsening, error));
    if (!coarsening->own_corners) {
        coarsening->own_corners = array_new(coarsening->stored, 4 * sizeof(uint32_t));
        if (!coarsening->own_corners)
            return no_memory(coarsening, error);
        memcpy(coarsening->own_corners, coarsening->corners, coarsening->stored * 4 * sizeof(uint32_t));
        coarsening->corners = coarsening->own_corners;
    }
    for (int pass = 0; pass < 4; pass++)
        parallel_for(threads, coarsening->stored, TETS_A_CHUNK, passes[pass], coarsening);
    return TETLOD_OK;
}

static bool number_living(const struct coarsening *coarsening, struct coarse_numbers *out)
{
    size_t words = ((size_t)coarsening->stored + 63) / 64;
    uint32_t count = 0;
    *out = (struct coarse_numbers){array_zero(words, sizeof *out->living), array_new(words, sizeof *out->before)};
    for (size_t t = 0; t < coarsening->stored && out->living && out->before; t++) {
        if (t % 64 == 0)
            out->before[t / 64] = count;
        bool living = coarsening->states[t] < COARSE_DIED;
        out->living[t / 64] |= (uint64_t)living << t % 64;
        count += living;
    }
    return out->living && out->before;
}

/* The living of before, by their new numbers. */
static void list_living(void *context, unsigned worker, size_t begin, size_t end)
{
    struct coarsening *coarsening = context;
    const struct coarse_before *last = &coarsening->last;
    (void)worker;
    for (size_t t = begin; t < end; t++) {
        if (last->states[t] >= COARSE_DIED)
            continue;
        uint32_t number = coarsening_number(coarsening, (uint32_t)t);
        corners_now(coarsening, last->corners + 4 * t, coarsening->own_corners + 4 * (size_t)number);
        coarsening->states[number] = last->states[t];
    }
}

static void renumber_slots(void *context, unsigned worker, size_t begin, size_t end)
{
    struct coarsening *coarsening = context;
    (void)worker;
    for (size_t slot = begin; slot < end; slot++) {
        uint32_t tet = atomic_load_explicit(&coarsening->tet_of[slot], memory_order_relaxed);
        if (tet != TETLOD_NONE && !(coarsening->slots[slot] & SLOT_MERGED))
            atomic_store_explicit(&coarsening->tet_of[slot], coarsening_number(coarsening, tet), memory_order_relaxed);
    }
}

/* The living are listed anew, and get their neighbours then: of those that died nothing more is looked at. */
static enum tetlod_status step_anew(struct coarsening *coarsening, unsigned threads, struct tetlod_error *error)
{
    const uint32_t stored = coarsening->stored;
    struct coarse_before *last = &coarsening->last;
    uint32_t *corners = array_new(coarsening->tets, 4 * sizeof *corners);
    uint8_t *states = array_new(coarsening->tets, 1);
    if (!corners || !states || !number_living(coarsening, &last->numbers)) {
        free(corners);
        free(states);
        return no_memory(coarsening, error);
    }
    last->corners = coarsening->corners;
    last->own_corners = coarsening->own_corners;
    last->states = coarsening->states;
    free(coarsening->neighbours);
    coarsening->neighbours = NULL;
    coarsening->corners = coarsening->own_corners = corners;
    coarsening->states = states;
    coarsening->stored = coarsening->tets;
    parallel_for(threads, stored, TETS_A_CHUNK, list_living, coarsening);
    parallel_for(threads, coarsening->slot_count, TETS_A_CHUNK, renumber_slots, coarsening);
    parallel_for(threads, coarsening->stored, TETS_A_CHUNK, offer_changed, coarsening);
    return coarsening_need_neighbours(coarsening, error);
}

enum tetlod_status coarsening_step(struct coarsening *coarsening, unsigned threads, struct tetlod_error *error)
{
    coarsening->touched_count = coarsening->in_step ? coarsening->touched_count : 0;
    coarsening->in_step = false;
    forget_last(coarsening);
    follow_merges(coarsening);
    parallel_for(threads, coarsening->stored, TETS_A_CHUNK, find_states, coarsening);
    for (size_t t = 0; t < coarsening->stored; t++)
        coarsening->tets -= coarsening->states[t] == COARSE_DIED;
    bool anew = coarsening->tets <= coarsening->stored / 2;
    TETLOD_TRY(anew ? step_anew(coarsening, threads, error) : step_in_place(coarsening, threads, error));
    for (size_t i = 0; i < coarsening->touched_count; i++)
        coarsening->slots[coarsening->touched[i]] &= (uint8_t)~SLOT_IN_STEP;
    return TETLOD_OK;
}

static uint32_t slot_of_node(const struct coarsening *coarsening, uint32_t node)
{
    return node < coarsening->slot_count ? node : coarsening->slot_of[node - coarsening->slot_count];
}

enum tetlod_status coarsening_advance(struct coarsening *coarsening, const struct contraction_log *log,
                                      uint32_t contractions, unsigned threads, struct tetlod_error *error)
{
    for (uint32_t c = coarsening->contractions; c < contractions; c++) {
        const uint32_t *children = log->children + 4 * (size_t)c;
        uint32_t slot = coarsening->slot_of[c] = slot_of_node(coarsening, children[0]);
        for (int i = 1; i < 4 && children[i] != TETLOD_NONE; i++)
            coarsening_merge(coarsening, slot_of_node(coarsening, children[i]), slot);
        coarsening_move(coarsening, slot, log->positions, coarsening->log_values, c);
    }
    coarsening->contractions = contractions;
    return coarsening_step(coarsening, threads, error);
}

uint32_t coarsening_heir(const struct coarsening *coarsening, uint32_t before)
{
    const struct coarse_before *last = &coarsening->last;
    if (coarsening_state_of(coarsening, before) < COARSE_DIED)
        return coarsening_number(coarsening, before);
    const uint32_t *corners = last->numbers.living ? last->corners : coarsening->corners;
    return coarsening->tet_of[slot_now(coarsening, corners[4 * (size_t)before])];
}

uint32_t coarsening_heir_face(const struct coarsening *coarsening, uint32_t face)
{
    if (coarsening->last.numbers.living)
        return coarsening_state_of(coarsening, face / 4) == COARSE_SAME
                   ? 4 * coarsening_number(coarsening, face / 4) + face % 4
                   : TETLOD_NONE;
    const uint32_t *corners = coarsening->corners + (face & ~(size_t)3);
    uint32_t a = corners[(face + 1) % 4], b = corners[(face + 2) % 4], c = corners[(face + 3) % 4];
    if (a == b || a == c || b == c)
        return TETLOD_NONE;
    return pass_dead(coarsening, face);
}
