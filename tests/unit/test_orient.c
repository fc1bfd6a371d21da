/* SPDX-License-Identifier: BSD-3-Clause */
/* Numbering made consistent through faces, and what is left alone. */
#include "src/mesh/orient.h"

#include "src/mesh/mesh_check.h"
#include "tests/test.h"

static const double points[6 * 3] = {0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1, 1, 1, 1, -1, -1, -1};

static struct oriented turn(const uint32_t *corners, uint32_t tets)
{
    struct oriented out;
    CHECK_INT(orient(&out, points, corners, 6, tets, NULL, NULL), TETLOD_OK);
    return out;
}

static void test_alike(void)
{
    struct oriented plain = turn((uint32_t[]){0, 1, 2, 3, 1, 2, 3, 4},
                                 2), mirrored = turn((uint32_t[]){1, 0, 2, 3, 2, 1, 3, 4}, 2);
    CHECK(!plain.corners && !plain.turned_count);
    CHECK(!mirrored.corners && !mirrored.turned_count);
}

static void test_minority_is_turned(void)
{
    const uint32_t corners[] = {0, 1, 2, 3, 2, 1, 3, 4, 0, 2, 1, 5};
    struct oriented out = turn(corners, 3);
    CHECK_INT(out.turned_count, 1);
    CHECK(out.turned[1] && !out.turned[0] && !out.turned[2]);
    CHECK(out.corners[4] == 2 && out.corners[5] == 1 && out.corners[6] == 4 && out.corners[7] == 3);
    struct mesh_report report;
    CHECK_INT(mesh_check(points, corners, 6, 3, &report, NULL), TETLOD_OK);
    CHECK_INT(report.turned_tets, 1);
    CHECK_INT(report.inverted_tets, 0);
    CHECK_INT(report.same_side_faces, 0);
    oriented_fini(&out);
}

/* Parts that share no face follow the largest volume. */
static void test_parts(void)
{
    const double apart[8 * 3] = {0, 0, 0, 2, 0, 0, 0, 2, 0, 0, 0, 2, 5, 0, 0, 6, 0, 0, 5, 1, 0, 5, 0, 1};
    struct oriented out;
    CHECK_INT(orient(&out, apart, (uint32_t[]){0, 1, 2, 3, 5, 4, 6, 7}, 8, 2, NULL, NULL), TETLOD_OK);
    CHECK_INT(out.turned_count, 1);
    CHECK(out.turned[1]);
    oriented_fini(&out);
    CHECK_INT(orient(&out, apart, (uint32_t[]){1, 0, 2, 3, 4, 5, 6, 7}, 8, 2, NULL, NULL), TETLOD_OK);
    CHECK(out.turned_count == 1 && out.turned[1]);
    oriented_fini(&out);
}

/* A tetrahedron that is really inverted is numbered as its neighbours are: it stays, and is counted. */
static void test_inverted(void)
{
    const double folded[5 * 3] = {0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1, 0.1, 0.1, 0.1};
    const uint32_t corners[] = {0, 1, 2, 3, 1, 2, 3, 4};
    struct oriented out;
    struct mesh_report report;
    CHECK_INT(orient(&out, folded, corners, 5, 2, NULL, NULL), TETLOD_OK);
    CHECK_INT(out.turned_count, 0);
    CHECK_INT(mesh_check(folded, corners, 5, 2, &report, NULL), TETLOD_OK);
    CHECK_INT(report.inverted_tets, 1);
}

int main(void)
{
    RUN(test_alike);
    RUN(test_minority_is_turned);
    RUN(test_parts);
    RUN(test_inverted);
    return test_end();
}
