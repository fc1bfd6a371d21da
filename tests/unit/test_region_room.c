/* SPDX-License-Identifier: BSD-3-Clause */
/* What a region asks its room for is no less than what it allocates, and not much more; what it is not granted it
 * does not take. */
#include <stdbool.h>
#include <stdlib.h>

#include "format/fail.h"
#include "src/measure/region_error.h"
#include "src/pipeline/build.h"
#include "src/sample/sample.h"
#include "tests/heap.h"
#include "tests/memory_sink.h"
#include "tests/test.h"

#ifdef __SANITIZE_ADDRESS__ // which makes 113 bits slow
enum { SIZE = 10 };
#else
enum { SIZE = 24 };
#endif

/* ---- regions ---- */

static uint64_t most; /* that the room grants */

static enum tetlod_status grant(struct room *room, uint64_t bytes, struct tetlod_error *error)
{
    if (bytes > most)
        return tetlodi_fail(error, TETLOD_ERR_LIMIT, "no room");
    room->granted = bytes;
    return TETLOD_OK;
}

static struct room empty_room(void)
{
    return (struct room){grant, 0, 0};
}

static enum tetlod_status make(const struct forest *forest, const struct region *region, struct room *room,
                               uint64_t *out_left)
{
    struct region_counts counts;
    struct tetmesh mesh;
    uint32_t *tets;
    double errors[16];
    enum tetlod_status status = region_mesh(forest, region, room, &mesh, &tets, &counts, NULL);
    if (status == TETLOD_OK) {
        status = region_measure(forest, &mesh, tets, 1, room, errors, NULL);
        *out_left = now;
        free(tets);
        tetmesh_fini(&mesh);
    }
    return status;
}

/* The box that has this part of the domain along each axis, in its middle. */
static struct region_box box_of(const struct tetlod_info *info, double part)
{
    struct region_box box;
    for (int i = 0; i < 3; i++) {
        double middle = (info->bounds[0][i] + info->bounds[1][i]) / 2,
            half = (info->bounds[1][i] - info->bounds[0][i]) / 2 * part;
        box.low[i] = middle - half;
        box.high[i] = middle + half;
    }
    return box;
}

static void check_box(const struct forest *forest, uint32_t coarse, uint32_t fine, double part)
{
    const struct tetlod_info *info = forest_info(forest);
    const struct region_box box = box_of(info, part);
    const struct region region = {coarse, fine, &box, 1};
    struct room room = empty_room();
    const size_t before = now;
    uint64_t left = 0;
    most = UINT64_MAX;
    peak = now;
    REQUIRE(make(forest, &region, &room, &left) == TETLOD_OK);
    const uint64_t taken = peak - before, granted = room.granted;
    CHECK_INT(now, before);
    CHECK(room.held >= left - before);
    if (granted < taken || (part <= 0.3 && 2 * granted > 3 * taken))
        TEST_FAIL("levels %u and %u, box %g: %llu were granted, %llu taken", coarse, fine, part,
                  (unsigned long long)granted, (unsigned long long)taken);
    CHECK(region_most_bytes(info, &region) + region_error_most_bytes(info) >= granted);
    printf("# levels %u and %u, box %g: %llu granted of %llu taken: %.2f\n", coarse, fine, part,
           (unsigned long long)granted, (unsigned long long)taken,
           (double)granted / (double)taken);
    for (int tenths = 1; tenths < 10; tenths += 2) {
        room = empty_room();
        most = granted / 10 * (unsigned)tenths;
        peak = now;
        CHECK_INT(make(forest, &region, &room, &left), TETLOD_ERR_LIMIT);
        CHECK_INT(now, before);
        CHECK(peak - before <= most);
    }
}

static void check_boxes(const struct forest *forest)
{
    static const double parts[] = {0.02, 0.1, 0.3, 0.6, 1.1};
    const uint32_t last = forest_info(forest)->level_count - 1;
    for (size_t i = 0; i < sizeof parts / sizeof *parts; i++) {
        check_box(forest, 0, last, parts[i]);
        check_box(forest, last / 4, last / 2, parts[i]);
    }
}

static void check_sample(const char *name, uint32_t size, bool local_bound)
{
    struct memory_sink memory = {0};
    struct tetlodi_sink sink = memory_sink(&memory);
    struct build_options options = build_options_default();
    const struct build_control control = {0};
    struct build_report report;
    struct tetlod_file *file;
    struct forest *forest;
    struct tetmesh mesh;
    options.controls = &control;
    options.control_count = 1;
    options.metadata = "{}";
    options.threads = 2;
    options.local_bound = local_bound;
    REQUIRE(sample_find(name)->make(&mesh, size, NULL) == TETLOD_OK);
    REQUIRE(build_stream(&mesh, &options, &sink, &report, NULL) == TETLOD_OK);
    REQUIRE(tetlod_open_memory(&file, memory.bytes, memory.size, NULL, NULL) == TETLOD_OK);
    REQUIRE(forest_new(&forest, file, tetlod_info(file)->level_count - 1, NULL) == TETLOD_OK);
    while (forest_levels(forest) < tetlod_info(file)->level_count)
        REQUIRE(forest_grow(forest, NULL) == TETLOD_OK);
    check_boxes(forest);
    forest_free(forest);
    tetlod_close(file);
    free(memory.bytes);
    tetmesh_fini(&mesh);
}

static void test_fin(void)
{
    check_sample("fin", SIZE, false);
}

static void test_local_bounds(void)
{
    check_sample("cube", SIZE / 2, true);
}

int main(void)
{
    RUN(test_fin);
    RUN(test_local_bounds);
    return test_end();
}
