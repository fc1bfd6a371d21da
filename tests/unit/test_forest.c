/* SPDX-License-Identifier: BSD-3-Clause */
/* The filter and map of the server gives the cursor's mesh at every level, bit for bit, of any sequence over any
 * complex. */
#include <stdlib.h>

#include "src/stream/forest.h"
#include "tests/gen.h"
#include "tests/memory_sink.h"
#include "tests/test.h"

static int same_mesh(const struct tetmesh *ours, const struct tetlod_mesh *theirs)
{
    if (ours->vertex_count != theirs->vertices || ours->tet_count != theirs->tets || ours->field_count != 2)
        return 0;
    size_t vertices = ours->vertex_count;
    return (!ours->tet_count || memcmp(ours->corners, theirs->corners, ours->tet_count * 16ul) == 0) &&
           memcmp(ours->positions, theirs->positions, vertices * 24) == 0 &&
           memcmp(ours->fields[0].values, theirs->fields[0], vertices * 8) == 0 &&
           memcmp(ours->fields[1].values, theirs->fields[1], vertices * 16) == 0;
}

/* Every level below `levels` is the cursor's. */
static void check_levels(const struct forest *forest, struct tetlod_cursor *cursor, uint32_t levels,
                         const struct gen_options *options)
{
    struct tetlod_mesh theirs;
    struct tetmesh ours;
    for (uint32_t i = 0; i < 2 * levels; i++) {
        uint32_t level = i < levels ? i : 2 * levels - 1 - i; // up by replaying, down by undoing
        REQUIRE(tetlod_cursor_seek(cursor, level, NULL) == TETLOD_OK);
        tetlod_cursor_mesh(cursor, &theirs);
        REQUIRE(forest_mesh(forest, level, &ours, NULL) == TETLOD_OK);
        if (!same_mesh(&ours, &theirs))
            TEST_FAIL("kind %d, seed %d, arity %u: level %u differs", (int)options->kind, (int)options->seed,
                      options->arity, level);
        tetmesh_fini(&ours);
    }
}

/* All levels that are there, whenever there are more, are right. */
static void check_growth(struct tetlod_file *file, const struct gen_options *options)
{
    struct forest *forest;
    struct tetlod_cursor *cursor;
    uint32_t stages = 0;
    REQUIRE(forest_new(&forest, file, tetlod_info(file)->level_count - 1, NULL) == TETLOD_OK);
    REQUIRE(tetlod_cursor_new(&cursor, file, NULL, 0, NULL) == TETLOD_OK);
    for (uint32_t grown = 0, levels = 0; grown < tetlod_info(file)->level_count; grown++) {
        REQUIRE(forest_grow(forest, NULL) == TETLOD_OK);
        CHECK(forest_levels(forest) == levels || forest_levels(forest) == grown + 1);
        if (forest_levels(forest) == levels)
            continue;
        levels = forest_levels(forest);
        stages++;
        check_levels(forest, cursor, levels, options);
    }
    CHECK_INT(forest_levels(forest), tetlod_info(file)->level_count);
    CHECK(stages >= 2 && forest_bytes(forest) > 16ull * tetlod_info(file)->tets);
    tetlod_cursor_free(cursor);
    forest_free(forest);
}

/* A forest for a level has it and no more than its stage. */
static void check_partial(struct tetlod_file *file, const struct gen_options *options)
{
    const struct tetlod_info *info = tetlod_info(file);
    struct tetlod_cursor *cursor;
    REQUIRE(tetlod_cursor_new(&cursor, file, NULL, 0, NULL) == TETLOD_OK);
    for (uint32_t level = 0; level < info->level_count; level++) {
        struct forest *forest;
        uint32_t last = forest_last_level(info, level);
        CHECK(last >= level && last < info->level_count);
        for (uint32_t k = level; k < last; k++)
            CHECK(2 * (uint64_t)info->levels[k].tets > info->levels[last].tets); // no more than twice is decoded
        REQUIRE(forest_new(&forest, file, level, NULL) == TETLOD_OK);
        while (forest_levels(forest) <= level)
            REQUIRE(forest_grow(forest, NULL) == TETLOD_OK);
        CHECK_INT(forest_levels(forest), last + 1);
        CHECK(forest_bytes(forest) <= forest_estimate(info, level));
        check_levels(forest, cursor, last + 1, options);
        forest_free(forest);
    }
    tetlod_cursor_free(cursor);
}

static void check_sequence(const struct gen_options *options)
{
    struct recode recode;
    struct memory_sink memory = {0};
    struct tetlodi_sink sink = memory_sink(&memory);
    struct tetlod_file *file = NULL;
    REQUIRE(gen_make(&recode, options));
    if (tetlodi_write(&recode.input, &sink, NULL) == TETLOD_OK &&
        tetlod_open_memory(&file, memory.bytes, memory.size, NULL, NULL) == TETLOD_OK) {
        check_growth(file, options);
        check_partial(file, options);
    } else
        TEST_FAIL("kind %d, seed %d: no stream", (int)options->kind, (int)options->seed);
    tetlod_close(file);
    free(memory.bytes);
    gen_free(&recode);
}

static void test_lossless(void)
{
    for (int kind = 0; kind < GEN_KINDS; kind++)
        for (unsigned arity = 2; arity <= 4; arity++)
            for (uint64_t seed = 1; seed <= 4; seed++)
                check_sequence(&(struct gen_options){.kind = (enum gen_kind)kind,
                                                     .seed = seed,
                                                     .size = 3,
                                                     .levels = 9,
                                                     .arity = arity,
                                                     .type = seed % 2 ? TETLOD_FLOAT32 : TETLOD_FLOAT64});
}

static void test_quantised(void)
{
    for (int kind = 0; kind < GEN_KINDS; kind++)
        check_sequence(&(struct gen_options){.kind = (enum gen_kind)kind, .seed = 7, .size = 3, .levels = 6, .arity = 2,
                                             .type = TETLOD_FLOAT32, .position_bits = 14});
}

int main(void)
{
    RUN(test_lossless);
    RUN(test_quantised);
    return test_end();
}
