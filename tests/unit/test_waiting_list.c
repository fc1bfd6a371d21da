/* SPDX-License-Identifier: BSD-3-Clause */
/* A waiting list keeps what it is given, whatever is added, taken out and swept in between, and in little room. */
#include "src/simplify/waiting_list.h"

#include <stdlib.h>

#include "format/tetlod.h"
#include "tests/gen.h"
#include "tests/test.h"

enum { MOST = 4000 };

/* Of any size, with any number of witnesses, and a value that no other one has. */
static struct queue_entry random_entry(uint64_t *seed, double value)
{
    struct queue_entry entry = {.value = value, .stamp = (uint32_t)gen_random(seed) % 1000};
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

static size_t count_simplices(const struct waiting_list *list)
{
    size_t count = 0;
    for (size_t at = 0; at < list->size; at = waiting_list_next(list, at))
        count++;
    return count;
}

enum { GONE, THERE };

/* How many of a swept list are not as expected, and how many are missing. `expected` is by value; `states` says which are there. */
static size_t differences(const struct waiting_list *list, const struct queue_entry *expected, const uint8_t *states, size_t count)
{
    size_t wrong = 0, there = 0;
    for (size_t i = 0; i < count; i++)
        there += states[i] == THERE;
    for (size_t at = 0; at < list->size; at = waiting_list_next(list, at)) {
        struct queue_entry entry = waiting_list_get(list, at);
        size_t i = (size_t)entry.value;
        wrong += !(i < count && states[i] == THERE && same(&entry, &expected[i]));
    }
    return wrong + (count_simplices(list) != there);
}

static void test_kept(void)
{
    struct waiting_list list = {0};
    struct queue_entry *expected = malloc(MOST * sizeof *expected);
    uint8_t states[MOST] = {GONE};
    size_t count = 0, wrong = 0, replaced = 0;
    uint64_t seed = 3;
    REQUIRE(expected != NULL);
    for (int round = 0; round < 40; round++) {
        for (size_t at = 0, end = list.size, next; at < end; at = next) {
            uint64_t chance = gen_random(&seed) % 8;
            next = waiting_list_next(&list, at);
            if (chance > 2 || count == MOST)
                continue;
            states[(size_t)waiting_list_at(&list, at)->value] = GONE;
            waiting_list_take(&list, at);
            if (chance < 2)
                continue;
            expected[count] = random_entry(&seed, (double)count); // another one comes in its place
            states[count] = THERE;
            wrong += !waiting_list_replace(&list, at, &expected[count++]);
            replaced++;
        }
        for (size_t k = gen_random(&seed) % 100; k > 0 && count < MOST; k--) {
            expected[count] = random_entry(&seed, (double)count);
            states[count] = THERE;
            wrong += !waiting_list_add(&list, &expected[count++]);
        }
        waiting_list_sweep(&list);
        wrong += differences(&list, expected, states, count);
    }
    CHECK_INT(wrong, 0);
    CHECK(replaced > 200);
    CHECK(count_simplices(&list) > 100);
    waiting_list_fini(&list);
    free(expected);
}

/* An edge takes 24 bytes and four for each witness, of which there are two at a time; and room is given back. */
static void test_room(void)
{
    struct waiting_list list = {0};
    struct queue_entry edge = {.vertices = {1, 2, TETLOD_NONE, TETLOD_NONE}}, unknown = edge, known = edge;
    unknown.witness_count = QUEUE_WITNESSES + 1;
    known.witness_count = 2;
    for (int i = 0; i < MOST; i++)
        CHECK(waiting_list_add(&list, i % 2 ? &edge : &unknown));
    CHECK_INT(list.size, 24 * MOST);
    CHECK(waiting_list_has_grown(&list));
    for (int i = 0; i < MOST; i++)
        CHECK(waiting_list_add(&list, &known));
    CHECK_INT(list.size, (24 + 32) * MOST);
    for (size_t at = 16 * 24; at < list.size; at = waiting_list_next(&list, at))
        waiting_list_take(&list, at);
    waiting_list_sweep(&list);
    CHECK_INT(count_simplices(&list), 16);
    CHECK_INT(list.size, 16 * 24);
    CHECK(list.capacity < 4096);
    CHECK(!waiting_list_has_grown(&list));
    waiting_list_fini(&list);
}

/* What needs no more room than there was stays in its place; what has less is as small as that after a sweep. */
static void test_replaced_in_place(void)
{
    struct waiting_list list = {0};
    struct queue_entry edge = {.vertices = {1, 2, TETLOD_NONE, TETLOD_NONE}}, known = edge;
    known.witness_count = 8;
    CHECK(waiting_list_add(&list, &known));
    CHECK(waiting_list_add(&list, &edge));
    size_t second = waiting_list_next(&list, 0), size = list.size;
    CHECK(waiting_list_replace(&list, 0, &edge));
    CHECK_INT(list.size, size);
    CHECK(waiting_list_replace(&list, second, &known)); // more than it had
    CHECK_INT(list.size, size + 24 + 32);
    CHECK_INT(waiting_list_at(&list, second)->vertices[0], TETLOD_NONE);
    waiting_list_sweep(&list);
    CHECK_INT(list.size, 24 + 24 + 32);
    CHECK_INT(waiting_list_get(&list, 24).witness_count, 8);
    waiting_list_fini(&list);
}

int main(void)
{
    RUN(test_kept);
    RUN(test_room);
    RUN(test_replaced_in_place);
    return test_end();
}
