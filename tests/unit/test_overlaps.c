/* SPDX-License-Identifier: BSD-3-Clause */
/* What the exact limit knows of a level's tetrahedra: the originals that they overlap, and points that refused. */
#include "src/simplify/exact/overlaps.h"

#include "src/sample/sample.h"
#include "tests/test.h"
#include "tests/world.h"

/* Are the watches of a tetrahedron those, the last one first? */
static bool watches(const struct overlaps *overlaps, uint32_t tet, const uint32_t *ends, uint32_t count)
{
    uint32_t found = 0;
    for (uint32_t i = overlaps->sentinels[tet]; i != TETLOD_NONE; i = overlaps->watches[i].next, found++)
        if (found >= count || overlaps->watches[i].point.ends[0] != ends[found])
            return false;
    return found == count;
}

static void watch(struct overlaps *overlaps, uint32_t tet, uint32_t end)
{
    const struct sentinel sentinel = {tet, {{end, end + 1}, 0.5f}};
    overlaps_watch(overlaps, &sentinel);
}

/* The last two points of a tetrahedron are kept, each once, also under new numbers. */
static void test_watches(void)
{
    struct tetmesh mesh;
    struct overlaps overlaps;
    struct world world;
    struct renumbering numbers;
    uint32_t count;
    REQUIRE(sample_find("cube")->make(&mesh, 3, NULL) == TETLOD_OK);
    REQUIRE(world_open_plain(&world, &mesh) && overlaps_init(&overlaps, &mesh, &world.working, NULL) == TETLOD_OK);
    uint32_t original = *overlaps_of(&overlaps, 5, &count);
    CHECK(watches(&overlaps, 5, NULL, 0));
    watch(&overlaps, 5, 10);
    watch(&overlaps, 5, 10);
    CHECK(watches(&overlaps, 5, (uint32_t[]){10}, 1));
    watch(&overlaps, 5, 20);
    CHECK(watches(&overlaps, 5, (uint32_t[]){20, 10}, 2));
    watch(&overlaps, 5, 10);
    CHECK(watches(&overlaps, 5, (uint32_t[]){10, 20}, 2));
    watch(&overlaps, 5, 30);
    CHECK(watches(&overlaps, 5, (uint32_t[]){30, 10}, 2));
    watch(&overlaps, 4, 40);
    watch(&overlaps, TETLOD_NONE, 50);
    watch(&overlaps, 6, TETLOD_NONE);
    CHECK(watches(&overlaps, 6, NULL, 0));
    world.working.corners[1][0] = world.working.corners[4][0] = TETLOD_NONE; // they are gone: 5 becomes 3
    REQUIRE(working_renumber(&world.working, &numbers, NULL) == TETLOD_OK);
    overlaps_renumber(&overlaps, &numbers);
    CHECK(watches(&overlaps, 3, (uint32_t[]){30, 10}, 2));
    CHECK_INT(overlaps.watch_count, 3);
    const uint32_t *list = overlaps_of(&overlaps, 3, &count); // still the original of its old number
    CHECK_INT(count, 1);
    CHECK_INT(list[0], original);
    renumbering_fini(&numbers);
    world_close(&world);
    overlaps_fini(&overlaps);
    tetmesh_fini(&mesh);
}

int main(void)
{
    RUN(test_watches);
    return test_end();
}
