/* SPDX-License-Identifier: BSD-3-Clause */
/* A waiting list keeps what it is given, whatever is added, taken out and swept in between, and in little room. */
#include "src/simplify/waiting_list.h"

#include <stdlib.h>

#include "format/tetlod.h"
#include "tests/gen.h"
#include "tests/test.h"

enum { MOST = 4000 };

/* Of any size, with any number of witnesses. */
static struct queue_entry random_entry(uint64_t *seed)
{
    struct queue_entry entry = {.value = (double)(gen_random(seed) % 1000), .stamp = (uint32_t)gen_random(seed) % 1000};
    uint32_t vertices = 2 + (uint32_t)(gen_random(seed) % 3);
    for (uint32_t i = 0; i < 4; i++)
        entry.vertices[i] = i < vertices ? (uint32_t)gen_random(seed) % 100000 : TETLOD_NONE;
    entry.witness_count = gen_random(seed) % (QUEUE_WITNESSES + 2);
    for (uint32_t i = 0; i < entry.witness_count && i < QUEUE_WITNESSES; i++)
        entry.witness[i] = (uint32_t)gen_random(seed);
    return entry;
}

static bool same(const struct queue_entry *a, const struct queue_entry *b)
{
    bool known = a->witness_count <= QUEUE_WITNESSES;
    return a->value == b->value && a->stamp == b->stamp && a->witness_count == b->witness_count &&
           !memcmp(a->vertices, b->vertices, sizeof a->vertices) &&
           (!known || !memcmp(a->witness, b->witness, a->witness_count * sizeof *a->witness));
}

/* How many of the list are other than expected, in its order. */
static int differences(const struct waiting_list *list, const struct queue_entry *expected, size_t count)
{
    int wrong = list->count != count;
    for (size_t i = 0; i < count && !wrong; i++) {
        struct queue_entry entry = waiting_list_get(list, i);
        wrong += !same(&entry, &expected[i]);
    }
    return wrong;
}

static void test_kept(void)
{
    struct waiting_list list = {0};
    struct queue_entry *expected = malloc(2 * MOST * sizeof *expected);
    size_t count = 0;
    uint64_t seed = 3;
    int wrong = 0;
    REQUIRE(expected != NULL);
    for (int round = 0; round < 60; round++) {
        size_t before = count, kept = 0;
        for (size_t k = gen_random(&seed) % 300; k > 0 && count < MOST; k--) {
            expected[count] = random_entry(&seed);
            wrong += !waiting_list_add(&list, &expected[count++]);
        }
        for (size_t i = 0; i < count; i++) {
            uint64_t chance = gen_random(&seed) % 8;
            if (i < before && chance == 2) { // taken out, and another one comes in its place
                waiting_list_take(&list, i);
                expected[i] = random_entry(&seed);
                wrong += !waiting_list_replace(&list, i, &expected[i]);
            }
            if (i < before && chance < 2)
                waiting_list_take(&list, i);
            else
                expected[kept++] = expected[i];
        }
        count = kept;
        waiting_list_sweep(&list);
        wrong += differences(&list, expected, count);
    }
    CHECK_INT(wrong, 0);
    CHECK(count > 500);
    waiting_list_fini(&list);
    free(expected);
}

/* Most edges have no witnesses; and room is given back. */
static void test_room(void)
{
    struct waiting_list list = {0};
    struct queue_entry edge = {.vertices = {1, 2, TETLOD_NONE, TETLOD_NONE}}, unknown = edge, known = edge;
    unknown.witness_count = QUEUE_WITNESSES + 1;
    known.witness_count = 2;
    for (int i = 0; i < MOST; i++)
        CHECK(waiting_list_add(&list, i % 2 ? &edge : &unknown));
    CHECK_INT(list.pool_size, 0);
    CHECK_INT(sizeof *list.simplices, 24);
    for (int i = 0; i < MOST; i++)
        CHECK(waiting_list_add(&list, &known));
    CHECK_INT(list.pool_size, 5 * MOST);
    for (size_t i = 16; i < list.count; i++)
        waiting_list_take(&list, i);
    waiting_list_sweep(&list);
    CHECK_INT(list.count, 16);
    CHECK_INT(list.pool_size, 0);
    CHECK(list.capacity < 64);
    CHECK(list.pool_capacity < 64);
    waiting_list_fini(&list);
}

/* Records that nobody has any more make room for new ones: the pool does not grow for ever between two sweeps. */
static void test_pool_is_compacted(void)
{
    struct waiting_list list = {0};
    struct queue_entry known = {.vertices = {1, 2, TETLOD_NONE, TETLOD_NONE}, .witness_count = 8};
    for (int round = 0; round < 200; round++) {
        for (int i = 0; i < 100; i++)
            CHECK(waiting_list_add(&list, &known));
        for (size_t i = list.count - 100; i < list.count; i++)
            waiting_list_take(&list, i);
    }
    CHECK(list.pool_capacity < 4000);
    waiting_list_sweep(&list);
    CHECK_INT(list.count, 0);
    waiting_list_fini(&list);
}

int main(void)
{
    RUN(test_kept);
    RUN(test_room);
    RUN(test_pool_is_compacted);
    return test_end();
}
