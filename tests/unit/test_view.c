/* SPDX-License-Identifier: BSD-3-Clause */
/* What the browser's module does, natively: so that sanitizers see it. What it gives is held against the library by
 * tests/web/test_decoder.mjs. */
#include <limits.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "server/web/wasm/print.h"
#include "server/web/wasm/view.h"
#include "tests/test.h"

enum { SIZE = 1 << 16, MAX_VIEWS = 64 };
static struct view *views[MAX_VIEWS]; /* they are never freed, as in the module: kept for the leak checker */
static size_t view_count;
static unsigned char bytes[SIZE];

static struct view *view_of(const char *name, uint32_t *size)
{
    char path[4096];
    snprintf(path, sizeof path, "%s/tests/golden/%s.tetlod", getenv("ROOT") ? getenv("ROOT") : ".", name);
    FILE *file = fopen(path, "rb");
    *size = file ? (uint32_t)fread(bytes, 1, sizeof bytes, file) : 0;
    if (file)
        fclose(file);
    return *size && view_count < MAX_VIEWS ? views[view_count++] = view_new() : NULL;
}

static struct view *open_view(const char *name)
{
    uint32_t size;
    struct view *view = view_of(name, &size);
    return view && view_add(view, bytes, size) == TETLOD_OK && view_open(view, NULL,
                                                                         TETLOD_NONE) == TETLOD_OK ? view : NULL;
}

static uint32_t *copy_words(const uint32_t *words, size_t count)
{
    uint32_t *copy = malloc(count * sizeof *copy + 1);
    for (size_t i = 0; copy && i < count; i++)
        copy[i] = words[i];
    return copy;
}

/* The square of the first field, wherever it is shown; what is no function is refused. */
static void draw_a_function(struct view *view)
{
    double c[3];
    for (int i = 0; i < 3; i++)
        c[i] = (view_info(view)->bounds[0][i] + view_info(view)->bounds[1][i]) / 2;
    const uint32_t number = view->shown.field_count;
    const double square[] = {0, 0, 1, 0, 1, 0, 4, 0}, bad[] = {0, 0, 1, 0, 4, 0}, tensor[] = {0, 0, 1, 0, 12, 0};
    CHECK_INT(view_define(view, bad, 1, 2), TETLOD_ERR_ARGUMENT);
    CHECK_INT(view_define(view, tensor, 1, 2), TETLOD_ERR_ARGUMENT);
    CHECK_INT(view_define(view, square, 1, 3), TETLOD_OK);
    const double *range = view_shade(view, number, 0), middle = (range[0] + range[1]) / 2;
    CHECK(!(range[0] < 0));
    CHECK_INT(view_isosurface(view, WITH_NORMALS, number, 0, middle), TETLOD_OK);
    view_clip(view, c[0], c[1], c[2], 1, 2, 3);
    CHECK_INT(view_surface(view, WITH_LINES), TETLOD_OK);
    CHECK_INT(view_slice(view, WITH_LINES, c[0], c[1], c[2], 0, 0, 1), TETLOD_OK);
    const struct view_part *part = view_part(view);
    for (uint32_t v = 0; v < part->point_count; v++)
        CHECK(fabs((double)part->values[v] - (double)part->vectors[v] * (double)part->vectors[v]) <=
              1e-6 * fabs((double)part->values[v]) + 1e-30);
    view_unclip(view);
    const double *to = view_info(view)->bounds[1];
    CHECK_INT(view_along(view, c[0], c[1], c[2], to[0], to[1], to[2]), TETLOD_OK);
    CHECK_INT(view_resample(view, 5, 0), TETLOD_OK);
}

static void draw_all(struct view *view)
{
    const struct tetlod_info *info = view_info(view);
    double c[3];
    for (int i = 0; i < 3; i++)
        c[i] = (info->bounds[0][i] + info->bounds[1][i]) / 2;
    for (uint32_t f = 0; f < info->field_count; f++) {
        view_shade(view, f, f ? -1 : 0);
        CHECK_INT(view_isosurface(view, WITH_NORMALS, f, 0, (info->fields[f].range[0] + info->fields[f].range[1]) / 2),
                  TETLOD_OK);
    }
    CHECK_INT(view_surface(view, WITH_LINES | WITH_NORMALS), TETLOD_OK);
    CHECK(!view_part(view)->triangle_count == !view_part(view)->line_count); // levels of soups may have no faces
    CHECK(!view_part(view)->point_count || view_part(view)->normals);
    CHECK_INT(view_surface(view, 0), TETLOD_OK);
    CHECK(!view_part(view)->line_count && !view_part(view)->normals);
    view_clip(view, c[0], c[1], c[2], 1, 2, 3);
    CHECK_INT(view_surface(view, WITH_LINES), TETLOD_OK);
    CHECK_INT(view_slice(view, WITH_LINES | WITH_NORMALS, c[0], c[1], c[2], 0, 0, 1), TETLOD_OK);
    CHECK_INT(view_resample(view, 9, 0), TETLOD_OK);
    view_unclip(view);
    CHECK_INT(view_slice(view, WITH_LINES | WITH_NORMALS, c[0], c[1], c[2], 0, 0, 1), TETLOD_OK);
    CHECK_INT(view_resample(view, 9, 1), TETLOD_OK);
    uint32_t tet = view_probe(view, c[0], c[1], c[2]);
    CHECK(tet == TETLOD_NONE || tet < view->shown.tet_count);
    CHECK_INT(view_probe(view, info->bounds[1][0] + 100, 0, 0), TETLOD_NONE);
}

static void test_every_level_moves_and_is_drawn(void)
{
    static const char *const names[] = {"one_tet", "grid_float32", "grid_12_bit", "holes_float32", "soup_float64",
                                        "kept_order"};
    for (size_t i = 0; i < sizeof names / sizeof *names; i++) {
        struct view *view = open_view(names[i]);
        REQUIRE(view);
        uint32_t levels = view_info(view)->level_count;
        draw_all(view);
        draw_a_function(view);
        for (uint32_t k = 1; k < levels; k++) {
            CHECK_INT(view_seek(view, k), TETLOD_OK);
            CHECK_INT(view_move(view, k - 1), TETLOD_OK);
            if (k + 1 < levels)
                CHECK_INT(view_seek(view, k + 1), TETLOD_OK); // what moves is a copy
            view_place(view, 0.5);
            draw_all(view);
            view_place(view, 0);
            draw_all(view);
            CHECK_INT(view_seek(view, k), TETLOD_OK);
            CHECK_INT(view_rest(view), TETLOD_OK);
            draw_all(view);
        }
        for (uint32_t k = levels; k-- > 0;) {
            CHECK_INT(view_seek(view, k), TETLOD_OK);
            draw_all(view);
        }
        CHECK_INT(view_mesh(view)->level, 0);
        CHECK(strstr(view_describe(view), view_info(view)->cid) != NULL);
    }
}

static void test_some_fields(void)
{
    const uint32_t second = 1;
    uint32_t size;
    struct view *view = view_of("grid_float32", &size);
    REQUIRE(view);
    CHECK_INT(view_add(view, bytes, size), TETLOD_OK);
    CHECK_INT(view_open(view, &second, 1), TETLOD_OK);
    CHECK_INT(view_seek(view, 3), TETLOD_OK);
    CHECK_INT(view_move(view, 1), TETLOD_OK);
    view_place(view, 0.25);
    draw_all(view); // a field that is not decoded counts as 0
    view_place(view, 1);
    double p[3] = {0};
    for (int i = 0; i < 12; i++)
        p[i % 3] += view->shown.positions[3 * view->shown.corners[i / 3] + i % 3] / 4;
    CHECK(view_probe(view, p[0], p[1], p[2]) != TETLOD_NONE);
    CHECK(isnan(view_probed(view)[0]) && !isnan(view_probed(view)[1]));
}

static void test_bytes_one_by_one_and_bad_ones(void)
{
    uint32_t size;
    struct view *view = view_of("grid_float32", &size);
    REQUIRE(view);
    uint32_t status = TETLOD_MORE;
    CHECK_INT(view_ready(view), TETLOD_NONE);
    for (uint32_t i = 0; i < size; i++) {
        status = view_add(view, bytes + i, 1);
        CHECK(status == TETLOD_OK || status == TETLOD_MORE);
    }
    CHECK_INT(status, TETLOD_OK);
    CHECK_INT(view_ready(view), view_info(view)->level_count - 1);
    struct view *other = view_of("grid_float32", &size);
    REQUIRE(other);
    uint64_t damaged = view_info(view)->levels[2].offset + 5;
    bytes[damaged] ^= 16;
    CHECK_INT(view_add(other, bytes, size), TETLOD_OK);
    CHECK_INT(view_open(other, NULL, TETLOD_NONE), TETLOD_OK);
    CHECK_INT(view_seek(other, 3), TETLOD_ERR_CHECKSUM);
    CHECK(strstr(view_message(other), "checksum") != NULL);
    CHECK_INT(view_mesh(other)->level, 1);
    draw_all(other);
    struct view *none = view_of("grid_float32", &size);
    REQUIRE(none);
    memset(bytes, 'x', 100);
    CHECK_INT(view_add(none, bytes, 100), TETLOD_ERR_NOT_TETLOD);
}

/* The boundary of a step is that of the next one, unless the level or what is drawn of it differs. */
static void test_steps_of_a_level_share_their_boundary(void)
{
    uint32_t size;
    struct view *view = view_of("series_float32", &size);
    REQUIRE(view);
    CHECK_INT(view_add(view, bytes, size), TETLOD_OK);
    CHECK_INT(view_open(view, NULL, TETLOD_NONE), TETLOD_OK);
    CHECK_INT(view_put(view, 0, bytes, size), TETLOD_OK);
    CHECK_INT(view_series(view, NULL, TETLOD_NONE), TETLOD_OK);
    const struct tetlod_series_info *series = tetlod_series_info(view->series);
    const uint32_t finest = series->band_count - 1;
    REQUIRE(series->bands[0].level < series->bands[finest].level);
    CHECK_INT(view_step(view, finest, 0), TETLOD_OK);
    CHECK(!view->has_boundary);
    draw_all(view);
    uint32_t *wanted = copy_words(view->boundary.triangles, 3 * (size_t)view->boundary.triangle_count);
    CHECK_INT(view_step(view, finest, 1), TETLOD_OK);
    CHECK(view->has_boundary);
    draw_all(view);
    CHECK_INT(view_step_move(view, finest, 2), TETLOD_OK);
    CHECK(view->has_boundary);
    view_place(view, 0.5);
    draw_all(view);
    view->has_boundary = false; // found anew it is the same
    draw_all(view);
    CHECK(memcmp(wanted, view->boundary.triangles, 12 * (size_t)view->boundary.triangle_count) == 0);
    free(wanted);
    CHECK_INT(view_step(view, 0, 2), TETLOD_OK);
    CHECK(!view->has_boundary);
    draw_all(view);
    view_threshold(view, false, 0, 0, 0, INFINITY);
    CHECK_INT(view_filter(view), TETLOD_OK);
    CHECK_INT(view_surface(view, 0), TETLOD_OK);
    CHECK_INT(view_step(view, 0, 1), TETLOD_OK);
    CHECK(!view->has_boundary);
}

/* Other fields of the steps are asked for: what was shown were values of the series that goes. */
static void test_another_series(void)
{
    uint32_t size;
    struct view *view = view_of("series_moving", &size);
    REQUIRE(view);
    CHECK_INT(view_add(view, bytes, size), TETLOD_OK);
    CHECK_INT(view_open(view, NULL, TETLOD_NONE), TETLOD_OK);
    CHECK_INT(view_put(view, 0, bytes, size), TETLOD_OK);
    CHECK_INT(view_series(view, NULL, TETLOD_NONE), TETLOD_OK);
    const uint32_t finest = tetlod_series_info(view->series)->band_count - 1, field = 0;
    for (int moving = 0; moving < 2; moving++) {
        CHECK_INT(view_step(view, finest, 0), TETLOD_OK);
        if (moving) {
            CHECK_INT(view_step_move(view, finest, 1), TETLOD_OK);
            view_place(view, 0.5);
        }
        CHECK(view->step_values);
        CHECK_INT(view_series(view, &field, 1), TETLOD_OK);
        CHECK(!view->step_values && !view->moving);
        for (uint32_t f = 0; f < view->shown.field_count; f++)
            CHECK(view->shown.fields[f].values == view->mesh.fields[f]);
        draw_all(view);
    }
    CHECK_INT(view_step(view, finest, 1), TETLOD_OK);
    draw_all(view);
}

/* The whole stream is there: nothing has to be put. */
static void test_values_of_cells_colour_and_hide(void)
{
    struct view *view = open_view("cells_float32");
    REQUIRE(view);
    const struct tetlod_info *info = view_info(view);
    REQUIRE(info->cell_field_count > 1);
    CHECK(!view_cells(view, 0));
    for (uint32_t f = 0; f < info->cell_field_count; f++)
        CHECK_INT(view_load_cells(view, f, 0), TETLOD_OK);
    for (uint32_t level = 0; level < info->level_count; level++) {
        CHECK_INT(view_seek(view, level), TETLOD_OK);
        if (level)
            CHECK_INT(view_move(view, level - 1), TETLOD_OK);
        for (uint32_t f = 0; f < info->cell_field_count; f++) {
            const double half = view_cells(view, f)[0];
            CHECK_INT(view_hide(view, f, &half, level & 1 && info->cell_fields[f].components == 1), TETLOD_OK);
            CHECK_INT(view_filter(view), TETLOD_OK);
            CHECK_INT(view_shade_cells(view, f, info->cell_fields[f].components > 1 ? -1 : 0), TETLOD_OK);
            CHECK_INT(view_surface(view, WITH_LINES | WITH_NORMALS), TETLOD_OK);
            CHECK(view_part(view)->point_count == 3 * view_part(view)->triangle_count);
            view_clip(view, info->bounds[0][0], info->bounds[0][1], info->bounds[0][2], -1, -1, -1);
            CHECK_INT(view_slice(view, WITH_LINES, info->bounds[0][0] + 0.3, info->bounds[0][1] + 0.3,
                                 info->bounds[0][2] + 0.3, 1, 0, 0), TETLOD_OK);
            CHECK_INT(view_surface(view, WITH_LINES), TETLOD_OK);
            view_unclip(view);
            CHECK_INT(view_resample(view, 8, 0), TETLOD_OK);
            CHECK_INT(view_rays(view), TETLOD_OK);
            CHECK(view_ray_data(view)->has_of_tets == 1);
            view_sample(view);
        }
        CHECK_INT(view_hide(view, 0, NULL, 0), TETLOD_OK);
        view_shade(view, 0, 0);
        CHECK_INT(view_surface(view, 0), TETLOD_OK);
        const double *nothing = view_shade(view, UINT32_MAX, 0);
        CHECK(nothing[0] == 0 && nothing[1] == 0);
    }
}

/* The same text, and the same count, as the C library's in a buffer of any size. */
#define CHECK_PRINT(...)                                                              \
    for (size_t room = 0; room < sizeof own; room++) {                                \
        CHECK_INT(view_snprintf(own, room, __VA_ARGS__), snprintf(of_libc, room, __VA_ARGS__)); \
        CHECK(!room || strcmp(own, of_libc) == 0);                                    \
    }

static void test_prints_as_the_library_does(void)
{
    char own[80], of_libc[80];
    CHECK_PRINT("100 %% of %s, %.3s, %.9s and %.0s", "a text", "cut", "no", "none");
    CHECK_PRINT("%u %u %d %d %d", 0u, UINT32_MAX, 0, INT32_MIN, INT32_MAX);
    CHECK_PRINT("%zu %llu %lld %lld", SIZE_MAX, ULLONG_MAX, LLONG_MIN, 0LL);
    CHECK_PRINT("%02x%02x \\u%04x %016llx %x", 0x7u, 0xabu, 0x1fu, 0x123456789abcull, 0xffffffffu);
}

int main(void)
{
    RUN(test_prints_as_the_library_does);
    RUN(test_every_level_moves_and_is_drawn);
    RUN(test_some_fields);
    RUN(test_bytes_one_by_one_and_bad_ones);
    RUN(test_steps_of_a_level_share_their_boundary);
    RUN(test_another_series);
    RUN(test_values_of_cells_colour_and_hide);
    return test_end();
}
