/* SPDX-License-Identifier: BSD-3-Clause */
/* New numbers change nothing but numbers: the complex, and what lists and queues say of it. */
#include "src/simplify/renumber.h"

#include <stdlib.h>

#include "src/sample/sample.h"
#include "src/simplify/complex.h"
#include "src/simplify/waiting_list.h"
#include "tests/gen.h"
#include "tests/test.h"

/* A cube of which some edges have been contracted to one of their ends. */
static void contract_some(struct complex *complex, uint64_t seed)
{
    struct star star = {0};
    uint32_t done = 0;
    for (int tries = 0; tries < 4000 && done < 150; tries++) {
        uint32_t tet = (uint32_t)gen_random(&seed) % complex->tet_count, ends[2];
        const uint32_t *corners = complex->corners + 4 * (size_t)tet;
        if (corners[0] == TETLOD_NONE)
            continue;
        ends[0] = corners[0] < corners[1] ? corners[0] : corners[1];
        ends[1] = corners[0] < corners[1] ? corners[1] : corners[0];
        double p[3];
        bool holds;
        memcpy(p, complex->positions + 3 * (size_t)ends[tries % 2], sizeof p);
        REQUIRE(star_gather(&star, complex, ends, 2, NULL) == TETLOD_OK);
        REQUIRE(star_link_condition(&star, complex, &holds, NULL) == TETLOD_OK);
        if (!holds || !star_fits(&star, complex, p))
            continue;
        REQUIRE(complex_contract(complex, &star, p, NULL) == TETLOD_OK);
        done++;
    }
    CHECK(done == 150);
    star_fini(&star);
}

/* The numbers of everything that a tetrahedron knows, under renumberings or (NULL) as they are. */
static void describe_tet(const struct complex *complex, uint32_t tet, const struct renumbering *tets, const struct renumbering *slots,
                         uint32_t out[9])
{
    for (int c = 0; c < 4; c++) {
        uint32_t corner = complex->corners[4 * (size_t)tet + c], across = complex->neighbours[4 * (size_t)tet + c];
        out[c] = slots ? renumbered(slots, corner) : corner;
        out[4 + c] = across == TETLOD_NONE || !tets ? across : 4 * renumbered(tets, across / 4) + across % 4;
    }
    out[8] = complex->tet_changed[tet];
}

/* The same of a slot, with its star. */
static size_t describe_slot(const struct complex *complex, uint32_t slot, const struct renumbering *tets, uint32_t *out)
{
    size_t count = 0;
    out[count++] = complex->flags[slot];
    out[count++] = complex->node[slot];
    out[count++] = complex->changed[slot];
    out[count++] = complex->born[slot];
    memcpy(out + count, complex->positions + 3 * (size_t)slot, 24);
    count += 6;
    for (uint32_t i = 0; i < complex->star_count[slot]; i++) {
        uint32_t tet = complex->pool[complex->star_begin[slot] + i];
        out[count++] = tets ? renumbered(tets, tet) : tet;
    }
    return count;
}

static void test_complex(void)
{
    struct tetmesh mesh;
    struct complex complex;
    struct renumbering tets, slots;
    REQUIRE(sample_find("cube")->make(&mesh, 6, NULL) == TETLOD_OK);
    REQUIRE(complex_init(&complex, &mesh, NULL) == TETLOD_OK);
    contract_some(&complex, 5);
    REQUIRE(complex_find_numbers(&complex, &tets, &slots));
    CHECK_INT(tets.after, complex.tets_alive);
    CHECK_INT(slots.after, complex.vertices_alive);
    uint32_t(*tets_before)[9] = malloc(tets.before * sizeof *tets_before), tet_now[9];
    uint32_t(*slots_before)[1000] = malloc(slots.before * sizeof *slots_before), slot_now[1000];
    size_t *sizes = malloc(slots.before * sizeof *sizes);
    REQUIRE(tets_before && slots_before && sizes);
    for (uint32_t t = 0; t < tets.before; t++)
        if (renumbered(&tets, t) != TETLOD_NONE)
            describe_tet(&complex, t, &tets, &slots, tets_before[renumbered(&tets, t)]);
    for (uint32_t v = 0; v < slots.before; v++)
        if (renumbered(&slots, v) != TETLOD_NONE)
            sizes[renumbered(&slots, v)] = describe_slot(&complex, v, &tets, slots_before[renumbered(&slots, v)]);
    REQUIRE(complex_renumber(&complex, &tets, &slots));
    int wrong = 0;
    for (uint32_t t = 0; t < tets.after; t++) {
        describe_tet(&complex, t, NULL, NULL, tet_now);
        wrong += memcmp(tet_now, tets_before[t], sizeof tet_now) != 0;
    }
    for (uint32_t v = 0; v < slots.after; v++) {
        size_t size = describe_slot(&complex, v, NULL, slot_now);
        wrong += size != sizes[v] || memcmp(slot_now, slots_before[v], size * sizeof *slot_now) != 0;
    }
    CHECK_INT(wrong, 0);
    CHECK_INT(complex.tets_stored, complex.tets_alive);
    free(tets_before);
    free(slots_before);
    free(sizes);
    renumbering_fini(&tets);
    renumbering_fini(&slots);
    complex_fini(&complex);
    tetmesh_fini(&mesh);
}

static bool is_even(const void *context, uint32_t number)
{
    (void)context;
    return number % 2 == 0;
}

static void test_list(void)
{
    struct renumbering numbers;
    struct waiting_list list = {0};
    REQUIRE(renumbering_init(&numbers, 1000, is_even, NULL));
    for (uint32_t i = 0; i < 300; i++) {
        struct queue_entry entry = {.value = i % 7, .stamp = i, .vertices = {i, i + 2, TETLOD_NONE, TETLOD_NONE}};
        entry.witness[entry.witness_count++] = 2 * i;
        entry.witness[entry.witness_count++] = 2 * i + 1;
        CHECK(i % 2 || waiting_list_add(&list, &entry));
    }
    waiting_list_renumber(&list, &numbers, &numbers);
    int wrong = 0;
    uint32_t i = 0;
    for (size_t at = 0; at < list.size; at = waiting_list_next(&list, at), i++) {
        struct queue_entry entry = waiting_list_get(&list, at);
        wrong += entry.stamp != 2 * i || entry.vertices[0] != i || entry.vertices[1] != i + 1 || entry.witness_count != 2 ||
                 entry.witness[0] != 2 * i || entry.witness[1] != TETLOD_NONE || entry.value != entry.stamp % 7;
    }
    CHECK_INT(wrong, 0);
    CHECK_INT(i, 150);
    renumbering_fini(&numbers);
    waiting_list_fini(&list);
}

/* A queue keeps its order, and drops what has lost a vertex. */
static void test_queue(void)
{
    struct renumbering numbers;
    struct queue queue = {0};
    REQUIRE(renumbering_init(&numbers, 1000, is_even, NULL));
    for (uint32_t i = 0; i < 300; i++) {
        struct queue_entry entry = {.value = i % 7, .stamp = i, .vertices = {i, i + 2, i % 3 ? i + 4 : TETLOD_NONE, TETLOD_NONE}};
        entry.witness[entry.witness_count++] = 2 * i;
        entry.witness[entry.witness_count++] = 2 * i + 1;
        CHECK(queue_push(&queue, &entry));
    }
    queue_renumber(&queue, &numbers, &numbers);
    CHECK_INT(queue.count, 150);
    CHECK(queue_check(&queue));
    int wrong = 0;
    while (queue.count) {
        struct queue_entry entry = queue_pop(&queue);
        uint32_t i = entry.stamp / 2;
        wrong += entry.stamp % 2 || entry.vertices[0] != i || entry.vertices[1] != i + 1 || entry.witness[0] != 2 * i ||
                 entry.vertices[2] != (entry.stamp % 3 ? i + 2 : TETLOD_NONE) || entry.witness[1] != TETLOD_NONE ||
                 entry.value != entry.stamp % 7;
    }
    CHECK_INT(wrong, 0);
    renumbering_fini(&numbers);
    queue_fini(&queue);
}

/* What is left has the ranks of a set, at the ends of its words, too. */
static void test_numbers(void)
{
    struct renumbering numbers;
    for (uint32_t count = 1; count < 200; count++) {
        REQUIRE(renumbering_init(&numbers, count, is_even, NULL));
        int wrong = numbers.before != count || numbers.after != (count + 1) / 2 || renumbered(&numbers, TETLOD_NONE) != TETLOD_NONE;
        for (uint32_t i = 0; i < count; i++)
            wrong += renumbered(&numbers, i) != (i % 2 ? TETLOD_NONE : i / 2);
        CHECK_INT(wrong, 0);
        renumbering_fini(&numbers);
    }
}

int main(void)
{
    RUN(test_numbers);
    RUN(test_complex);
    RUN(test_list);
    RUN(test_queue);
    return test_end();
}
