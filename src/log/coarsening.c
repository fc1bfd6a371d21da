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

void coarsening_fini(struct coarsening *coarsening)
{
    for (uint32_t f = 0; f < coarsening->field_count; f++)
        free(coarsening->fields[f].values);
    void *const owned[] = {coarsening->positions, coarsening->fields,  coarsening->corners, coarsening->neighbours,
                           coarsening->states,    coarsening->slots,   coarsening->into,    coarsening->touched,
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
                                      .corners = array_new(m, 4 * sizeof(uint32_t)),
                                      .neighbours = array_new(m, 4 * sizeof(uint32_t)),
                                      .states = array_zero(m, 1),
                                      .slots = array_zero(n, 1),
                                      .into = array_new(n, sizeof(uint32_t)),
                                      .touched = array_new(n, sizeof(uint32_t)),
                                      .tet_of = array_new(n, sizeof(uint32_t)),
                                      .slot_of = array_new(log ? log->count : 0, sizeof(uint32_t)),
                                      .log_values = array_new(mesh->field_count, sizeof(double *))};
    bool room = coarsening->positions && coarsening->corners && coarsening->neighbours && coarsening->states &&
                coarsening->slots && coarsening->into && coarsening->touched && coarsening->tet_of &&
                coarsening->slot_of && coarsening->log_values && copy_fields(coarsening, mesh);
    enum tetlod_status status = TETLOD_OK;
    if (!room)
        TETLOD_TRY_DONE(tetlodi_fail_nomem(error, "the levels' mesh", coarsening_bytes(mesh)));
    memcpy(coarsening->positions, mesh->positions, n * 3 * sizeof(double));
    memcpy(coarsening->corners, mesh->corners, m * 4 * sizeof(uint32_t));
    for (size_t v = 0; v < n; v++)
        coarsening->tet_of[v] = TETLOD_NONE;
    for (size_t i = 4 * m; i-- > 0;)
        coarsening->tet_of[mesh->corners[i]] = (uint32_t)(i / 4);
    for (uint32_t f = 0; f < mesh->field_count && log; f++)
        coarsening->log_values[f] = log->fields[f].values;
    status = adjacency_build(mesh->corners, mesh->tet_count, mesh->vertex_count, coarsening->neighbours, NULL, error);
done:
    if (status != TETLOD_OK)
        coarsening_fini(coarsening);
    return status;
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

static void update_corners(void *context, unsigned worker, size_t begin, size_t end)
{
    struct coarsening *coarsening = context;
    const uint8_t *slots = coarsening->slots;
    (void)worker;
    for (size_t t = begin; t < end; t++) {
        uint32_t *c = coarsening->corners + 4 * t;
        if (coarsening->states[t] >= COARSE_DIED) {
            coarsening->states[t] = COARSE_GONE;
            continue;
        }
        coarsening->states[t] = COARSE_SAME;
        if (!((slots[c[0]] | slots[c[1]] | slots[c[2]] | slots[c[3]]) & SLOT_IN_STEP))
            continue;
        for (int i = 0; i < 4; i++)
            c[i] = slots[c[i]] & SLOT_MERGED ? coarsening->into[c[i]] : c[i];
        coarsening->states[t] = four_different(c) ? COARSE_CHANGED : COARSE_DIED;
    }
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

void coarsening_step(struct coarsening *coarsening, unsigned threads)
{
    void (*const passes[])(void *, unsigned, size_t, size_t) = {update_corners, join_neighbours, forget_dead,
                                                                offer_changed};
    coarsening->touched_count = coarsening->in_step ? coarsening->touched_count : 0;
    follow_merges(coarsening);
    for (int pass = 0; pass < 4; pass++)
        parallel_for(threads, coarsening->stored, TETS_A_CHUNK, passes[pass], coarsening);
    for (size_t t = 0; t < coarsening->stored; t++)
        coarsening->tets -= coarsening->states[t] == COARSE_DIED;
    for (size_t i = 0; i < coarsening->touched_count; i++)
        coarsening->slots[coarsening->touched[i]] &= (uint8_t)~SLOT_IN_STEP;
    coarsening->in_step = false;
}

static uint32_t slot_of_node(const struct coarsening *coarsening, uint32_t node)
{
    return node < coarsening->slot_count ? node : coarsening->slot_of[node - coarsening->slot_count];
}

void coarsening_advance(struct coarsening *coarsening, const struct contraction_log *log, uint32_t contractions,
                        unsigned threads)
{
    for (uint32_t c = coarsening->contractions; c < contractions; c++) {
        const uint32_t *children = log->children + 4 * (size_t)c;
        uint32_t slot = coarsening->slot_of[c] = slot_of_node(coarsening, children[0]);
        for (int i = 1; i < 4 && children[i] != TETLOD_NONE; i++)
            coarsening_merge(coarsening, slot_of_node(coarsening, children[i]), slot);
        coarsening_move(coarsening, slot, log->positions, coarsening->log_values, c);
    }
    coarsening->contractions = contractions;
    coarsening_step(coarsening, threads);
}

uint32_t coarsening_heir(const struct coarsening *coarsening, uint32_t tet)
{
    return coarsening->states[tet] < COARSE_DIED ? tet : coarsening->tet_of[coarsening->corners[4 * (size_t)tet]];
}

uint32_t coarsening_heir_face(const struct coarsening *coarsening, uint32_t face)
{
    const uint32_t *corners = coarsening->corners + (face & ~(size_t)3);
    uint32_t a = corners[(face + 1) % 4], b = corners[(face + 2) % 4], c = corners[(face + 3) % 4];
    if (a == b || a == c || b == c)
        return TETLOD_NONE;
    return pass_dead(coarsening, face);
}

/* ---- numbers */

void coarse_numbers_fini(struct coarse_numbers *numbers)
{
    free(numbers->living);
    free(numbers->before);
    *numbers = (struct coarse_numbers){0};
}

static enum tetlod_status number_living(const struct coarsening *coarsening, struct coarse_numbers *out,
                                        struct tetlod_error *error)
{
    size_t words = ((size_t)coarsening->stored + 63) / 64;
    uint32_t count = 0;
    *out = (struct coarse_numbers){array_zero(words, sizeof *out->living), array_new(words, sizeof *out->before)};
    if (!out->living || !out->before) {
        coarse_numbers_fini(out);
        return tetlodi_fail_nomem(error, "the levels' mesh", 12 * (uint64_t)words);
    }
    for (size_t t = 0; t < coarsening->stored; t++) {
        if (t % 64 == 0)
            out->before[t / 64] = count;
        bool living = coarsening->states[t] < COARSE_DIED;
        out->living[t / 64] |= (uint64_t)living << t % 64;
        count += living;
    }
    return TETLOD_OK;
}

enum tetlod_status coarsening_compact(struct coarsening *coarsening, struct coarse_numbers *out,
                                      struct tetlod_error *error)
{
    size_t count = 0;
    TETLOD_TRY(number_living(coarsening, out, error));
    for (size_t t = 0; t < coarsening->stored; t++) {
        if (coarse_number(out, (uint32_t)t) == TETLOD_NONE)
            continue;
        memmove(coarsening->corners + 4 * count, coarsening->corners + 4 * t, 4 * sizeof(uint32_t));
        coarsening->states[count] = coarsening->states[t];
        for (int i = 0; i < 4; i++) {
            uint32_t across = coarsening->neighbours[4 * t + i];
            coarsening->neighbours[4 * count + i] =
                across == TETLOD_NONE ? across : 4 * coarse_number(out, across / 4) + across % 4;
        }
        count++;
    }
    for (size_t v = 0; v < coarsening->slot_count; v++)
        if (!(coarsening->slots[v] & SLOT_MERGED) && coarsening->tet_of[v] != TETLOD_NONE)
            coarsening->tet_of[v] = coarse_number(out, coarsening->tet_of[v]);
    coarsening->stored = coarsening->tets = (uint32_t)count;
    coarsening->corners = array_shrink(coarsening->corners, count, 4 * sizeof(uint32_t));
    coarsening->neighbours = array_shrink(coarsening->neighbours, count, 4 * sizeof(uint32_t));
    coarsening->states = array_shrink(coarsening->states, count, 1);
    return TETLOD_OK;
}
