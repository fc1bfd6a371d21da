/* SPDX-License-Identifier: BSD-3-Clause */
/* Who asks for a level, who decodes, who waits and who hears of failure; and readers beside the decoder. */
#include <pthread.h>
#include <sched.h>
#include <stdatomic.h>
#include <stdlib.h>

#include "server/store/decoding.h"
#include "tests/gen.h"
#include "tests/memory_sink.h"
#include "tests/test.h"

struct fixture {
    struct memory_sink memory;
    struct tetlod_file *file;
    struct decoding *decoding;
    uint32_t finest;
};

static int open_fixture(struct fixture *f, int damaged)
{
    struct recode recode;
    const struct gen_options options = {.kind = GEN_GRID, .seed = 3, .size = 5, .levels = 20, .arity = 2, .type = TETLOD_FLOAT32};
    *f = (struct fixture){0};
    struct tetlodi_sink sink = memory_sink(&f->memory);
    int made = gen_make(&recode, &options) && tetlodi_write(&recode.input, &sink, NULL) == TETLOD_OK;
    gen_free(&recode);
    if (made && damaged)
        f->memory.bytes[f->memory.size - 3] ^= 0xff; // in the finest level
    if (!made || tetlod_open_memory(&f->file, f->memory.bytes, f->memory.size, NULL, NULL) != TETLOD_OK)
        return 0;
    f->finest = tetlod_info(f->file)->level_count - 1;
    return (f->decoding = decoding_new(f->file)) != NULL;
}

static void close_fixture(struct fixture *f)
{
    decoding_free(f->decoding);
    tetlod_close(f->file);
    free(f->memory.bytes);
}

struct counted {
    struct waiter waiter; /* first */
    int woken;
};

static void count(struct waiter *waiter)
{
    ((struct counted *)(void *)waiter)->woken++;
}

static void test_states(void)
{
    struct fixture f;
    struct tetlod_error failure = {0};
    struct counted first = {{count, NULL}, 0}, second = first;
    REQUIRE(open_fixture(&f, 0));
    CHECK(!decoding_find(f.decoding, 0) && decoding_bytes(f.decoding) == 0);
    CHECK_INT(decoding_ask(f.decoding, 0, false, &first.waiter, &failure), DECODING_MINE);
    CHECK_INT(decoding_ask(f.decoding, f.finest, false, &second.waiter, &failure), DECODING_COMING);
    CHECK_INT(decoding_run(f.decoding, 0, NULL, NULL, &failure), TETLOD_OK);
    CHECK(first.woken == 1 && second.woken == 1); // the one for its level, the other for nobody decodes any more
    CHECK(decoding_find(f.decoding, 0) && !decoding_find(f.decoding, f.finest));
    CHECK_INT(decoding_ask(f.decoding, 0, true, NULL, &failure), DECODING_READY);
    CHECK_INT(decoding_ask(f.decoding, f.finest, true, &second.waiter, &failure), DECODING_MINE);
    CHECK_INT(decoding_run(f.decoding, f.finest, NULL, NULL, &failure), TETLOD_OK);
    CHECK(second.woken == 2 && decoding_find(f.decoding, f.finest));
    CHECK(decoding_bytes(f.decoding) > 16ull * tetlod_info(f.file)->tets);
    close_fixture(&f);
}

static void test_cancelled(void)
{
    struct fixture f;
    struct tetlod_error failure = {0};
    struct counted waiting = {{count, NULL}, 0};
    REQUIRE(open_fixture(&f, 0));
    CHECK_INT(decoding_ask(f.decoding, 0, false, &waiting.waiter, &failure), DECODING_MINE);
    decoding_cancel(f.decoding, &(struct tetlod_error){.status = TETLOD_ERR_LIMIT, .message = "too much"});
    CHECK_INT(waiting.woken, 1);
    CHECK_INT(decoding_ask(f.decoding, 0, true, &waiting.waiter, &failure), DECODING_FAILED);
    CHECK_INT(failure.status, TETLOD_ERR_LIMIT);
    CHECK_TEXT(failure.message, "too much");
    CHECK_INT(decoding_ask(f.decoding, 0, false, NULL, &failure), DECODING_MINE); // others try again
    CHECK_INT(decoding_run(f.decoding, f.finest, NULL, NULL, NULL), TETLOD_OK);
    CHECK_INT(decoding_ask(f.decoding, f.finest, true, NULL, &failure), DECODING_READY);
    close_fixture(&f);
}

/* What is there before the damage stays, however often it is tried. */
static void test_damaged(void)
{
    struct fixture f, whole;
    struct tetlod_error failure = {0};
    struct tetmesh ours, theirs;
    REQUIRE(open_fixture(&f, 1) && open_fixture(&whole, 0));
    CHECK_INT(decoding_ask(whole.decoding, 0, false, NULL, &failure), DECODING_MINE);
    CHECK_INT(decoding_run(whole.decoding, 0, NULL, NULL, NULL), TETLOD_OK);
    for (int tries = 0; tries < 2; tries++) {
        CHECK_INT(decoding_ask(f.decoding, f.finest, false, NULL, &failure), DECODING_MINE);
        CHECK_INT(decoding_run(f.decoding, f.finest, NULL, NULL, &failure), TETLOD_ERR_CHECKSUM);
        CHECK(!decoding_find(f.decoding, f.finest));
        CHECK_INT(decoding_ask(f.decoding, f.finest, true, NULL, &failure), DECODING_FAILED);
        CHECK_INT(failure.status, TETLOD_ERR_CHECKSUM);
        REQUIRE(decoding_find(f.decoding, 0));
        REQUIRE(forest_mesh(decoding_find(f.decoding, 0), 0, &ours, NULL) == TETLOD_OK);
        REQUIRE(forest_mesh(decoding_find(whole.decoding, 0), 0, &theirs, NULL) == TETLOD_OK);
        CHECK(ours.tet_count == theirs.tet_count && memcmp(ours.corners, theirs.corners, ours.tet_count * 16ul) == 0);
        tetmesh_fini(&ours);
        tetmesh_fini(&theirs);
    }
    close_fixture(&f);
    close_fixture(&whole);
}

static atomic_int wrong;

/* Reads every level that is there as soon as it is. */
static void *read_levels(void *opaque)
{
    const struct fixture *f = opaque;
    for (uint32_t level = 0; level <= f->finest; level++) {
        const struct forest *forest;
        struct tetmesh mesh;
        while (!(forest = decoding_find(f->decoding, level)))
            sched_yield();
        if (forest_mesh(forest, level, &mesh, NULL) != TETLOD_OK ||
            mesh.tet_count != tetlod_info(f->file)->levels[level].tets)
            atomic_fetch_add(&wrong, 1);
        for (size_t i = 0; i < (size_t)mesh.tet_count * 4; i++)
            atomic_fetch_add(&wrong, mesh.corners[i] >= mesh.vertex_count);
        tetmesh_fini(&mesh);
    }
    return NULL;
}

static bool yield(void *opaque)
{
    (void)opaque;
    sched_yield();
    return false;
}

static void test_readers(void)
{
    enum { READERS = 3 };
    struct fixture f;
    struct tetlod_error failure;
    pthread_t readers[READERS];
    REQUIRE(open_fixture(&f, 0));
    for (int i = 0; i < READERS; i++)
        REQUIRE(pthread_create(&readers[i], NULL, read_levels, &f) == 0);
    CHECK_INT(decoding_ask(f.decoding, f.finest, false, NULL, &failure), DECODING_MINE);
    CHECK_INT(decoding_run(f.decoding, f.finest, yield, NULL, NULL), TETLOD_OK);
    for (int i = 0; i < READERS; i++)
        pthread_join(readers[i], NULL);
    CHECK_INT(atomic_load(&wrong), 0);
    close_fixture(&f);
}

int main(void)
{
    RUN(test_states);
    RUN(test_cancelled);
    RUN(test_damaged);
    RUN(test_readers);
    return test_end();
}
