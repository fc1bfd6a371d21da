/* SPDX-License-Identifier: BSD-3-Clause */
/* The measured error of a transition is that of the overlay with the whole of the finest level, for any boxes over any
 * complex: also where bodies overlap each other or themselves. A local bound holds in the transition at every finest
 * vertex. */
#include <stdlib.h>

#include "src/measure/overlay.h"
#include "src/measure/region_error.h"
#include "src/mesh/sheets.h"
#include "tests/gen.h"
#include "tests/memory_sink.h"
#include "tests/test.h"

#ifdef __SANITIZE_ADDRESS__ // which makes 113 bits slow
enum { SEEDS = 1 };
#else
enum { SEEDS = 4 };
#endif

static int transitions, apart; /* regions with one; those whose difference is above 0 */

/* The overlay of the finest level and the transition, whole; each body with itself. */
static void measure_plainly(const struct forest *forest, const struct tetmesh *mesh, const uint32_t *tets,
                            double out[2])
{
    static const uint32_t both[] = {0, 1};
    struct tetmesh finest;
    struct overlay_report report;
    uint32_t found = 0, *bodies, *own;
    uint8_t *wanted;
    REQUIRE(forest_mesh(forest, forest_info(forest)->level_count - 1, &finest, NULL) == TETLOD_OK);
    REQUIRE((wanted = malloc(mesh->tet_count + (size_t)1)) && (bodies = malloc(finest.vertex_count * sizeof *bodies)) &&
            (own = malloc(mesh->vertex_count * sizeof *own)));
    sheets_bodies(finest.corners, finest.tet_count, finest.vertex_count, bodies);
    for (size_t t = 0; t < mesh->tet_count; t++) {
        found += wanted[t] = mesh->cell_fields[0].values[t] == (double)REGION_TRANSITION;
        for (size_t c = 0; c < 4; c++)
            own[mesh->corners[4 * t + c]] = bodies[finest.corners[4 * (size_t)tets[t]]];
    }
    transitions += found > 0;
    out[0] = out[1] = 0;
    const struct overlay_options options = {.threads = 1, .bodies = {bodies, own}, .wanted = wanted};
    if (found)
        REQUIRE(overlay_max(&finest, both, mesh, both, 2, &options, out, &report, NULL) == TETLOD_OK);
    free(wanted);
    free(bodies);
    free(own);
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
    REQUIRE(region_mesh(forest, &region, NULL, &mesh, &tets, &counts, NULL) == TETLOD_OK);
    measure_plainly(forest, &mesh, tets, plain);
    REQUIRE(region_measure(forest, &mesh, tets, 1 + (unsigned)(gen_random(state) % 2), NULL, ours, NULL) == TETLOD_OK);
    if (memcmp(plain, ours, sizeof ours) != 0)
        TEST_FAIL("kind %d, seed %d: %.17g and %.17g, not %.17g and %.17g", (int)options->kind, (int)options->seed,
                  ours[0], ours[1], plain[0], plain[1]);
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
            check_stream(&(struct gen_options){.kind = (enum gen_kind)kind, .seed = seed, .size = 3, .levels = 12,
                                               .arity = 2,
                                               .type = seed % 2 ? TETLOD_FLOAT32 : TETLOD_FLOAT64});
    printf("# %d transitions, %d apart\n", transitions, apart);
    CHECK(transitions > 5 * SEEDS && apart > 5 * SEEDS);
}

int main(void)
{
    RUN(test_as_the_whole_overlay);
    return test_end();
}
