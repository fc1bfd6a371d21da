/* SPDX-License-Identifier: BSD-3-Clause */
/* The measured error of a belt is that of the overlay with the whole of the finest level, for any boxes over any complex: also where the
 * finest level overlaps itself. */
#include <stdlib.h>

#include "src/measure/overlay.h"
#include "src/measure/region_error.h"
#include "tests/gen.h"
#include "tests/memory_sink.h"
#include "tests/test.h"

#ifdef __SANITIZE_ADDRESS__ // which makes 113 bits slow
enum { SEEDS = 1 };
#else
enum { SEEDS = 4 };
#endif

static int belts, apart; /* regions with one; those whose difference is above 0 */

/* The overlay of the belt and the finest level, whole. */
static void measure_plainly(const struct forest *forest, const struct tetmesh *mesh, double out[2])
{
    static const uint32_t both[] = {0, 1};
    struct tetmesh belt = *mesh, finest;
    struct overlay_report report;
    REQUIRE(forest_mesh(forest, forest_info(forest)->level_count - 1, &finest, NULL) == TETLOD_OK);
    REQUIRE((belt.corners = malloc(mesh->tet_count * (size_t)16 + 1)) != NULL);
    belt.tet_count = 0;
    for (size_t t = 0; t < mesh->tet_count; t++)
        if (mesh->cell_fields[0].values[t] == (double)REGION_BELT)
            memcpy(belt.corners + 4 * (size_t)belt.tet_count++, mesh->corners + 4 * t, 16);
    belts += belt.tet_count > 0;
    out[0] = out[1] = 0;
    if (belt.tet_count)
        REQUIRE(overlay_max(&belt, both, &finest, both, 2, &(struct overlay_options){.threads = 1}, out, &report, NULL) == TETLOD_OK);
    free(belt.corners);
    tetmesh_fini(&finest);
}

static void check_region(const struct forest *forest, uint64_t *state, const struct gen_options *options)
{
    const struct tetlod_info *info = forest_info(forest);
    struct region_box box;
    struct region_counts counts;
    struct tetmesh mesh;
    uint32_t *tets, coarse = (uint32_t)(gen_random(state) % (info->level_count - 1));
    uint32_t fine = coarse + 1 + (uint32_t)(gen_random(state) % (info->level_count - 1 - coarse));
    double plain[2], ours[2];
    for (int i = 0; i < 3; i++) {
        double size = info->bounds[1][i] - info->bounds[0][i];
        box.low[i] = info->bounds[0][i] + size * (double)(gen_random(state) % 80) / 100;
        box.high[i] = box.low[i] + size / 5;
    }
    const struct region region = {coarse, fine, &box, 1};
    REQUIRE(region_mesh(forest, &region, &mesh, &tets, &counts, NULL) == TETLOD_OK);
    measure_plainly(forest, &mesh, plain);
    REQUIRE(region_error(forest, &mesh, 1 + (unsigned)(gen_random(state) % 2), ours, NULL) == TETLOD_OK);
    if (memcmp(plain, ours, sizeof ours) != 0)
        TEST_FAIL("kind %d, seed %d: %.17g and %.17g, not %.17g and %.17g", (int)options->kind, (int)options->seed, ours[0], ours[1], plain[0], plain[1]);
    apart += ours[0] > 0 && ours[1] > 0;
    tetmesh_fini(&mesh);
    free(tets);
}

static void check_stream(const struct gen_options *options)
{
    struct recode recode;
    struct memory_sink memory = {0};
    struct tetlodi_sink sink = memory_sink(&memory);
    struct tetlod_file *file;
    struct forest *forest;
    uint64_t state = options->seed;
    REQUIRE(gen_make(&recode, options));
    recode.fields[1].controlled = 1;
    REQUIRE(tetlodi_write(&recode.input, &sink, NULL) == TETLOD_OK);
    REQUIRE(tetlod_open_memory(&file, memory.bytes, memory.size, NULL, NULL) == TETLOD_OK);
    const struct tetlod_info *info = tetlod_info(file);
    REQUIRE(info->field_count == 2 && info->fields[0].controlled && info->fields[1].controlled);
    REQUIRE(forest_new(&forest, file, info->level_count - 1, NULL) == TETLOD_OK);
    while (forest_levels(forest) < info->level_count)
        REQUIRE(forest_grow(forest, NULL) == TETLOD_OK);
    for (int i = 0; i < 8 && info->level_count > 1; i++)
        check_region(forest, &state, options);
    forest_free(forest);
    tetlod_close(file);
    free(memory.bytes);
    gen_free(&recode);
}

static void test_as_the_whole_overlay(void)
{
    for (int kind = 0; kind < GEN_KINDS; kind++)
        for (uint64_t seed = 1; seed <= SEEDS; seed++)
            check_stream(&(struct gen_options){.kind = (enum gen_kind)kind, .seed = seed, .size = 3, .levels = 12, .arity = 2,
                                               .type = seed % 2 ? TETLOD_FLOAT32 : TETLOD_FLOAT64});
    printf("# %d belts, %d apart\n", belts, apart);
    CHECK(belts > 5 * SEEDS && apart > 5 * SEEDS);
}

int main(void)
{
    RUN(test_as_the_whole_overlay);
    return test_end();
}
