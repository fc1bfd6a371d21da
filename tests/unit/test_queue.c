/* SPDX-License-Identifier: BSD-3-Clause */
/* The heap gives its entries in one order, whatever order they came in. */
#include "src/simplify/queue.h"

#include <stdlib.h>

#include "tests/gen.h"
#include "tests/test.h"

static int compare(const void *a, const void *b)
{
    const struct queue_entry *x = a, *y = b;
    if (x->value != y->value)
        return x->value < y->value ? -1 : 1;
    for (int i = 0; i < 4; i++)
        if (x->vertices[i] != y->vertices[i])
            return x->vertices[i] < y->vertices[i] ? -1 : 1;
    return 0;
}

enum { COUNT = 3000 };

/* Few values, so that there are many ties; the vertices differ from entry to entry. */
static void make_entries(struct queue_entry *entries, uint64_t seed)
{
    memset(entries, 0, COUNT * sizeof *entries);
    for (uint32_t i = 0; i < COUNT; i++) {
        entries[i].value = (double)(gen_random(&seed) % 50) / 7;
        for (uint32_t j = 0; j < 4; j++)
            entries[i].vertices[j] = j < 2 ? (i >> (6 * (1 - j)) & 63) : TETLOD_NONE;
        entries[i].candidate = i;
    }
}

static void shuffle(struct queue_entry *entries, uint64_t seed)
{
    for (uint32_t i = COUNT - 1; i; i--) {
        uint32_t j = (uint32_t)(gen_random(&seed) % (i + 1));
        struct queue_entry swap = entries[i];
        entries[i] = entries[j];
        entries[j] = swap;
    }
}

static void test_order(void)
{
    struct queue_entry *entries = malloc(COUNT * sizeof *entries), *sorted = malloc(COUNT * sizeof *sorted);
    REQUIRE(entries && sorted);
    make_entries(entries, 1);
    memcpy(sorted, entries, COUNT * sizeof *entries);
    qsort(sorted, COUNT, sizeof *sorted, compare);
    for (uint64_t seed = 2; seed < 6; seed++) {
        struct queue queue = {0};
        int wrong = 0, broken = 0;
        shuffle(entries, seed);
        for (int i = 0; i < COUNT; i++) {
            CHECK(queue_push(&queue, &entries[i]));
            broken += i % 97 == 0 && !queue_check(&queue);
        }
        CHECK_INT(queue.count, COUNT);
        for (int i = 0; i < COUNT; i++) {
            struct queue_entry entry = queue_pop(&queue);
            wrong += entry.candidate != sorted[i].candidate;
            broken += i % 97 == 0 && !queue_check(&queue);
        }
        CHECK_INT(wrong, 0);
        CHECK_INT(broken, 0);
        CHECK_INT(queue.count, 0);
        queue_fini(&queue);
    }
    free(entries);
    free(sorted);
}

/* What is pushed between pops comes out in its place. */
static void test_pushes_between_pops(void)
{
    struct queue_entry *entries = malloc(COUNT * sizeof *entries);
    struct queue queue = {0};
    uint64_t random = 11;
    uint32_t next = 0, late = 0;
    double floor = -1;
    REQUIRE(entries);
    make_entries(entries, 9);
    while (next < COUNT || queue.count) {
        if (next < COUNT && (!queue.count || gen_random(&random) % 3)) {
            CHECK(queue_push(&queue, &entries[next]));
            floor = entries[next].value < floor ? entries[next].value : floor;
            next++;
        } else {
            struct queue_entry entry = queue_pop(&queue);
            late += entry.value < floor;
            floor = entry.value;
        }
    }
    CHECK_INT(late, 0);
    queue_fini(&queue);
    free(entries);
}

static void test_check_sees_disorder(void)
{
    struct queue queue = {0};
    struct queue_entry entry = {.value = 1, .vertices = {0, 1, TETLOD_NONE, TETLOD_NONE}};
    CHECK(queue_check(&queue));
    CHECK(queue_append(&queue, &entry));
    entry.value = 0;
    CHECK(queue_append(&queue, &entry));
    CHECK(!queue_check(&queue));
    queue_fini(&queue);
    CHECK_INT(queue.count, 0);
}

int main(void)
{
    RUN(test_order);
    RUN(test_pushes_between_pops);
    RUN(test_check_sees_disorder);
    return test_end();
}
