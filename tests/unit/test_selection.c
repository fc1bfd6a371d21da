/* SPDX-License-Identifier: BSD-3-Clause */
/* Which level, band and step a selection means. */
#include <math.h>

#include "src/stream/selection.h"
#include "tests/test.h"

enum { LEVELS = 3, FIELDS = 2 };

/* Three levels of two fields, of which the first is controlled; only `max` and `rms` of it are known. */
static struct tetlod_info make(struct tetlod_field *fields, struct tetlod_level *levels, double *errors)
{
    for (uint32_t k = 0; k < LEVELS; k++) {
        double *of_level = errors + k * FIELDS * TETLOD_MEASURES;
        for (int i = 0; i < FIELDS * TETLOD_MEASURES; i++)
            of_level[i] = NAN;
        of_level[TETLOD_MAX] = 0.1 * (LEVELS - 1 - k) + 0.01;
        of_level[TETLOD_RMS] = of_level[TETLOD_MAX] / 10;
        levels[k] = (struct tetlod_level){.vertices = 10 * (k + 1), .tets = 100 * (k + 1), .end = 1000 * (k + 1),
                                          .errors = of_level};
    }
    fields[0] = (struct tetlod_field){.name = "p", .components = 1, .range = {0, 2}, .controlled = 1};
    fields[1] = (struct tetlod_field){.name = "q", .components = 1, .range = {0, 1}};
    return (struct tetlod_info){.level_count = LEVELS, .levels = levels, .field_count = FIELDS, .fields = fields};
}

static void test_levels(void)
{
    struct tetlod_field fields[FIELDS];
    struct tetlod_level levels[LEVELS];
    double errors[LEVELS * FIELDS * TETLOD_MEASURES];
    const struct tetlod_info info = make(fields, levels, errors);
    struct selection selection = {.field = TETLOD_NONE, .measure = TETLOD_MAX};
    CHECK(selection_level(&info, &selection) == LEVELS - 1);
    selection.kind = TAKE_ERROR;
    selection.error = 0.15;
    selection.box_error = 0.05;
    CHECK(selection_level(&info, &selection) == 1);
    CHECK(selection_box_level(&info, &selection) == 2);
    selection.box_error = 0;
    CHECK(selection_box_level(&info, &selection) == TETLOD_NONE);
    selection.kind = TAKE_ABS_ERROR;
    selection.error = selection.box_error = 0.3;
    CHECK(selection_level(&info, &selection) == 1 && selection_box_level(&info, &selection) == 1);
    selection = (struct selection){.kind = TAKE_LEVEL, .count = LEVELS, .field = TETLOD_NONE, .box_error = 0.15};
    CHECK(selection_level(&info, &selection) == TETLOD_NONE);
    CHECK(selection_box_level(&info, &selection) == 1); // a fraction of the range
    selection.count = 1;
    CHECK(selection_level(&info, &selection) == 1);
    selection.kind = TAKE_TETS;
    selection.count = 250;
    CHECK(selection_level(&info, &selection) == 1);
    selection.kind = TAKE_BYTES;
    selection.count = 3000;
    CHECK(selection_level(&info, &selection) == 2);
}

static void test_measures(void)
{
    struct tetlod_field fields[FIELDS];
    struct tetlod_level levels[LEVELS];
    double errors[LEVELS * FIELDS * TETLOD_MEASURES];
    const struct tetlod_info info = make(fields, levels, errors);
    CHECK(selection_measure("rms") == TETLOD_RMS && selection_measure("most") == TETLOD_MEASURES);
    CHECK(selection_measured(&info, TETLOD_NONE, TETLOD_MAX) && selection_measured(&info, 0, TETLOD_RMS));
    CHECK(!selection_measured(&info, TETLOD_NONE, TETLOD_SAMPLED) && !selection_measured(&info, 1, TETLOD_MAX));
    fields[0].controlled = 0;
    CHECK(!selection_measured(&info, TETLOD_NONE, TETLOD_MAX));
}

static void test_boxes(void)
{
    struct region_box box;
    CHECK(selection_read_box("-0,1,2,3,4,5e0;6", 14, &box) && !signbit(box.low[0]) && box.high[2] == 5);
    CHECK(selection_read_box(" 0, 0, 0, 1,  1, 1", 18, &box) && box.high[1] == 1);
    static const char *const bad[] = {"", "0,0,0,1,1,1 2", "0,0,0,1,1", "0,0,0,1,1,1,", "0,0,0,1,1,-1",
                                      "0,0,0,1,1,nan", "0,0,0,1,1,1 "};
    for (size_t i = 0; i < sizeof bad / sizeof *bad; i++)
        CHECK(!selection_read_box(bad[i], strlen(bad[i]), &box));
}

static void test_steps(void)
{
    const struct tetlod_info one = {.level_count = 1};
    struct step_selection selection = {.step = 7};
    uint64_t step;
    CHECK(selection_topology(&one, &selection, &step) == 0 && step == 7);
    const struct tetlod_series_info series = {.step_count = 7};
    CHECK(selection_step(&series, &selection, 7) == TETLOD_NONE && selection_step(&series, &selection, 6) == 6);
    struct tetlod_topology topologies[2] = {{.step_count = 4}, {.step_count = 4}};
    const struct tetlod_info two = {.level_count = 1, .topology_count = 2, .topologies = topologies};
    CHECK(selection_topology(&two, &selection, &step) == 1 && step == 3);
    selection.step = 1ull << 32;
    CHECK(selection_topology(&two, &selection, &step) == TETLOD_NONE);
}

int main(void)
{
    RUN(test_levels);
    RUN(test_measures);
    RUN(test_boxes);
    RUN(test_steps);
    return test_end();
}
