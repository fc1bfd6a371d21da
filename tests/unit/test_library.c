/* SPDX-License-Identifier: BSD-3-Clause */
/* libtetlod-build: what it takes, what it refuses, progress, a sink that fails. That its bytes are the program's:
 * tests/clients/test_python.py. */
#include <math.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

#include "src/library/tetlod_build.h"
#include "tests/memory_sink.h"
#include "tests/test.h"

/* Two tetrahedra, and a point that none uses. */
static const double positions[][3] = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {1, 1, 1}, {9, 9, 9}};
static const uint32_t corners[][4] = {{0, 1, 2, 3}, {1, 2, 3, 4}};
static const float values[] = {0, 1, 2, 3, 4, 5};
static const int64_t ids[] = {7, -1};

static struct tetlod_build_array field = {"p", 1, TETLOD_CELL_FLOAT32, values};
static struct tetlod_build_array cells = {"id", 1, TETLOD_CELL_INT64, ids};

static struct tetlod_build_mesh mesh_of(void)
{
    return (struct tetlod_build_mesh){sizeof(struct tetlod_build_mesh), 6, 2, TETLOD_FLOAT64, positions, corners[0], 1,
                                      1, &field, &cells};
}

static enum tetlod_status count(void *opaque, const void *bytes, size_t size)
{
    (void)bytes;
    *(size_t *)opaque += size;
    return TETLOD_OK;
}

static enum tetlod_status refuse(void *opaque, const void *bytes, size_t size)
{
    (void)opaque, (void)bytes, (void)size;
    return TETLOD_ERR_IO;
}

static int never(void *opaque, const char *phase, double done)
{
    (void)opaque, (void)phase, (void)done;
    return 0;
}

static enum tetlod_status build(const struct tetlod_build_mesh *mesh, const struct tetlod_build_options *options,
                                struct tetlod_error *error)
{
    size_t size = 0;
    enum tetlod_status status = tetlod_build(mesh, options, count, &size, error);
    CHECK((status == TETLOD_OK) == (size > 0));
    return status;
}

static void test_stream(void)
{
    struct tetlod_build_mesh mesh = mesh_of();
    struct tetlod_error error = {0};
    struct memory_sink out = {0};
    struct tetlod_file *file;
    const struct tetlodi_sink sink = memory_sink(&out);
    CHECK(tetlod_build(&mesh, NULL, sink.write, sink.opaque, &error) == TETLOD_OK);
    CHECK(tetlod_open_memory(&file, out.bytes, out.size, NULL, &error) == TETLOD_OK);
    const struct tetlod_info *info = tetlod_info(file);
    CHECK(info->vertices == 5 && info->tets == 2 && info->unused_points == 1 && info->lossless);
    CHECK(info->field_count == 1 && info->fields[0].controlled && info->cell_field_count == 1 &&
          info->cell_fields[0].type == TETLOD_CELL_INT8);
    tetlod_close(file);
    free(out.bytes);
}

static void test_refusals(void)
{
    struct tetlod_build_mesh mesh = mesh_of();
    struct tetlod_error error = {0};
    struct tetlod_build_array wrong = field;
    static const uint32_t outside[] = {0, 1, 2, 6};
    static const float not_finite[] = {0, 1, 2, 3, NAN, 5};
    static const int64_t large[] = {1, INT64_MAX};
    mesh.positions = NULL;
    CHECK(build(&mesh, NULL, &error) == TETLOD_ERR_ARGUMENT);
    mesh = mesh_of();
    mesh.corners = outside;
    mesh.tets = 1;
    CHECK(build(&mesh, NULL, &error) == TETLOD_ERR_MESH && strstr(error.message, "point 6"));
    mesh = mesh_of();
    mesh.fields = &wrong;
    wrong.values = not_finite;
    CHECK(build(&mesh, NULL, &error) == TETLOD_ERR_MESH && strstr(error.message, "NaN"));
    wrong.type = (enum tetlod_cell_type)9;
    CHECK(build(&mesh, NULL, &error) == TETLOD_ERR_ARGUMENT && strstr(error.message, "'p'"));
    wrong.name = NULL;
    CHECK(build(&mesh, NULL, &error) == TETLOD_ERR_ARGUMENT);
    mesh = mesh_of();
    mesh.cell_fields = &wrong;
    wrong = cells;
    wrong.values = large;
    CHECK(build(&mesh, NULL, &error) == TETLOD_ERR_FIELD && strstr(error.message, "2^53"));
    mesh = mesh_of();
    struct tetlod_build_array twice[] = {field, field};
    mesh.fields = twice;
    mesh.field_count = 2;
    CHECK(build(&mesh, NULL, &error) == TETLOD_ERR_FIELD && strstr(error.message, "two fields"));
    mesh = mesh_of();
    mesh.field_count = 0;
    CHECK(build(&mesh, NULL, &error) == TETLOD_OK); // a coordinate is controlled
}

static void test_options(void)
{
    struct tetlod_build_mesh mesh = mesh_of();
    struct tetlod_build_options options;
    struct tetlod_error error = {0};
    static const char *const names[] = {"q", "p", "p"};
    tetlod_build_defaults(&options);
    options.controls = names;
    options.control_count = 1;
    CHECK(build(&mesh, &options, &error) == TETLOD_ERR_FIELD && strstr(error.message, "'q'"));
    options.controls = names + 1;
    CHECK(build(&mesh, &options, &error) == TETLOD_OK);
    options.control_count = 2;
    CHECK(build(&mesh, &options, &error) == TETLOD_ERR_ARGUMENT && strstr(error.message, "twice"));
    tetlod_build_defaults(&options);
    options.growth = 1;
    CHECK(build(&mesh, &options, &error) == TETLOD_ERR_ARGUMENT && strstr(error.message, "growth"));
    options.struct_size = sizeof options.struct_size; // a program of another day: what it does not know has its default
    CHECK(build(&mesh, &options, &error) == TETLOD_OK);
    tetlod_build_defaults(&options);
    options.threads = 65;
    CHECK(build(&mesh, &options, &error) == TETLOD_ERR_ARGUMENT && strstr(error.message, "threads is 0 .. 64"));
    tetlod_build_defaults(&options);
    options.progress = never;
    CHECK(build(&mesh, &options, &error) == TETLOD_ERR_CANCELLED);
    CHECK(tetlod_build(&mesh, NULL, refuse, NULL, &error) == TETLOD_ERR_IO);
}

/* Of what was said of the progress: how often of encoding, and up to where. */
struct heard {
    int encoding, other;
    double last;
    bool cancels; /* the encoding */
};

static int hear(void *opaque, const char *phase, double done)
{
    struct heard *heard = opaque;
    bool encoding = strcmp(phase, "encode") == 0;
    CHECK(done >= 0 && done <= 1 && (!heard->encoding || done >= heard->last));
    *(encoding ? &heard->encoding : &heard->other) += 1;
    heard->last = encoding ? done : 0;
    return !(encoding && heard->cancels);
}

enum { SIDE = 13, CUBES = SIDE - 1 };

/* A cube of cubes of six tetrahedra, around the diagonal of each. */
static void fill_grid(double (*points)[3], float *at, uint32_t (*tets)[4])
{
    static const uint32_t steps[6][2] = {{1, SIDE}, {1, SIDE * SIDE}, {SIDE, 1}, {SIDE, SIDE * SIDE}, {SIDE * SIDE, 1},
                                         {SIDE * SIDE, SIDE}};
    for (uint32_t i = 0; i < SIDE * SIDE * SIDE; i++) {
        uint32_t x = i % SIDE, y = i / SIDE % SIDE, z = i / SIDE / SIDE;
        double p[3] = {x, y, z};
        memcpy(points[i], p, sizeof p);
        at[i] = (float)(x * y + sin(z));
        if (x == CUBES || y == CUBES || z == CUBES)
            continue;
        for (int t = 0; t < 6; t++, tets++) {
            uint32_t corners_of[4] = {i, i + steps[t][0], i + steps[t][0] + steps[t][1], i + 1 + SIDE + SIDE * SIDE};
            memcpy(*tets, corners_of, sizeof corners_of);
        }
    }
}

static void test_cancelled_while_encoding(void)
{
    static double points[SIDE * SIDE * SIDE][3];
    static float at[SIDE * SIDE * SIDE];
    static uint32_t tets[6 * CUBES * CUBES * CUBES][4];
    struct tetlod_build_array array = {"p", 1, TETLOD_CELL_FLOAT32, at};
    struct tetlod_build_mesh mesh = {.struct_size = sizeof mesh,
                                     .vertices = SIDE * SIDE * SIDE,
                                     .tets = 6 * CUBES * CUBES * CUBES,
                                     .position_type = TETLOD_FLOAT64,
                                     .positions = points,
                                     .corners = tets[0],
                                     .field_count = 1,
                                     .fields = &array};
    struct tetlod_build_options options;
    struct tetlod_error error = {0};
    struct heard heard = {0};
    fill_grid(points, at, tets);
    tetlod_build_defaults(&options);
    options.progress = hear;
    options.progress_opaque = &heard;
    CHECK(build(&mesh, &options, &error) == TETLOD_OK && heard.encoding > 1);
    heard = (struct heard){.cancels = true};
    // and nothing reached the sink
    CHECK(build(&mesh, &options, &error) == TETLOD_ERR_CANCELLED && heard.encoding == 1);
}

/* What a stream cannot hold is refused before the contraction. */
static void test_refused_early(void)
{
    struct tetlod_build_mesh mesh = mesh_of();
    struct tetlod_build_options options;
    struct tetlod_error error = {0};
    struct heard heard = {0};
    static char large[(1 << 20) + 16], long_name[5000];
    tetlod_build_defaults(&options);
    options.progress = hear;
    options.progress_opaque = &heard;
    memset(large, ' ', sizeof large - 3);
    memcpy(large + sizeof large - 3, "{}", 3);
    static const char *const wrong[] = {"", "x", "[]", "{\"a\":}", "{} {}", "{\"a\":\"\xff\"}", large};
    for (size_t i = 0; i < sizeof wrong / sizeof *wrong; i++) {
        options.metadata = wrong[i];
        CHECK(build(&mesh, &options, &error) == TETLOD_ERR_ARGUMENT && strstr(error.message, "metadata"));
    }
    options.metadata = "{\"a\": [1, \"\\u00e9\"]}";
    CHECK(build(&mesh, &options, &error) == TETLOD_OK && heard.other);
    heard.other = heard.encoding = 0;
    memset(long_name, 'a', sizeof long_name - 1);
    static const char *const names[] = {"a\nb", "\xff", long_name};
    for (size_t i = 0; i < sizeof names / sizeof *names; i++) {
        struct tetlod_build_array point = field, cell = cells;
        point.name = cell.name = names[i];
        mesh.fields = &point;
        CHECK(build(&mesh, &options, &error) == TETLOD_ERR_FIELD && strstr(error.message, "name"));
        mesh = mesh_of();
        mesh.cell_fields = &cell;
        CHECK(build(&mesh, &options, &error) == TETLOD_ERR_FIELD && strstr(error.message, "name"));
        mesh = mesh_of();
    }
    static const float many[6 * 65];
    struct tetlod_build_array wide = {"p", 65, TETLOD_CELL_FLOAT32, many};
    mesh.fields = &wide;
    CHECK(build(&mesh, &options, &error) == TETLOD_ERR_FIELD && strstr(error.message, "components"));
    CHECK(heard.other == 0 && heard.encoding == 0);
}

/* ---- series */

static void add_steps(struct tetlod_build_series *series, unsigned count)
{
    struct tetlod_error error = {0};
    float moving[6];
    const struct tetlod_build_array p = {"p", 1, TETLOD_CELL_FLOAT32, moving};
    int32_t load[2]; // of the tetrahedra
    const struct tetlod_build_array loads = {"load", 1, TETLOD_CELL_INT32, load};
    struct tetlod_build_mesh mesh = mesh_of();
    mesh.fields = &p;
    mesh.cell_fields = &loads;
    mesh.cell_field_count = 1;
    for (unsigned s = 0; s < count; s++) {
        for (int i = 0; i < 6; i++)
            moving[i] = values[i] * (float)(s + 1);
        load[0] = (int32_t)s;
        load[1] = 1000 * (int32_t)s;
        CHECK(tetlod_build_series_add(series, &mesh, 0.5 * s, &error) == TETLOD_OK);
    }
}

static void check_series(const struct memory_sink *out, uint32_t steps)
{
    struct tetlod_error error = {0};
    struct tetlod_file *file;
    struct tetlod_series *series;
    struct tetlod_cursor *cursor;
    CHECK(tetlod_open_memory(&file, out->bytes, out->size, NULL, &error) == TETLOD_OK);
    CHECK(tetlod_series_new(&series, file, &error) == TETLOD_OK);
    const struct tetlod_series_info *info = tetlod_series_info(series);
    CHECK(info->step_count == steps && info->field_count == 1 && info->times[steps - 1] == 0.5 * (steps - 1));
    CHECK(tetlod_cursor_new(&cursor, file, NULL, 0, &error) == TETLOD_OK);
    for (uint32_t s = 0; s < steps; s++) {
        double sum = 0, load[2];
        CHECK(tetlod_seek_step(series, cursor, info->band_count - 1, s, &error) == TETLOD_OK);
        for (int v = 0; v < 5; v++)
            sum += tetlod_step_values(series, 0)[v];
        CHECK(tetlod_step_cells(series, 0, s, load, &error) == TETLOD_OK && load[0] + load[1] == 1001.0 * s);
        CHECK(sum == 10 * (s + 1)); // 0 + 1 + 2 + 3 + 4; the sixth point is used by no tetrahedron
    }
    tetlod_cursor_free(cursor);
    tetlod_series_free(series);
    tetlod_close(file);
}

static void test_series(void)
{
    struct tetlod_build_series *series;
    struct tetlod_error error = {0};
    struct memory_sink out = {0};
    const struct tetlodi_sink sink = memory_sink(&out);
    CHECK(tetlod_build_series_new(&series, NULL, &error) == TETLOD_OK);
    CHECK(tetlod_build_series_finish(series, sink.write, sink.opaque, &error) == TETLOD_ERR_ARGUMENT);
    add_steps(series, 11);
    struct tetlod_build_mesh mesh = mesh_of();
    CHECK(tetlod_build_series_add(series, &mesh, 5, &error) == TETLOD_ERR_ARGUMENT && strstr(error.message, "step 11"));
    CHECK(tetlod_build_series_add(series, &mesh, NAN, &error) == TETLOD_ERR_ARGUMENT);
    CHECK(tetlod_build_series_finish(series, sink.write, sink.opaque, &error) == TETLOD_OK);
    tetlod_build_series_free(series);
    check_series(&out, 11);
    free(out.bytes);
}

/* What a second step may not be. The series cannot be finished then. */
static void check_refused(const struct tetlod_build_mesh *mesh, enum tetlod_status wanted, const char *word)
{
    struct tetlod_build_series *series;
    struct tetlod_error error = {0};
    size_t size = 0;
    CHECK(tetlod_build_series_new(&series, NULL, &error) == TETLOD_OK);
    add_steps(series, 1);
    enum tetlod_status status = tetlod_build_series_add(series, mesh, 1, &error);
    CHECK(status == wanted && strstr(error.message, "step 1: ") && strstr(error.message, word));
    CHECK(tetlod_build_series_add(series, mesh, 2, &error) == TETLOD_ERR_ARGUMENT);
    CHECK(tetlod_build_series_finish(series, count, &size, &error) == TETLOD_ERR_ARGUMENT && size == 0);
    tetlod_build_series_free(series);
}

static void test_series_refusals(void)
{
    static const double other[] = {0.1, 1.1, 2.1, 3.1, 4.1, 5.1};
    struct tetlod_build_array wide = {"p", 1, TETLOD_CELL_FLOAT64, other};
    struct tetlod_build_array two = {"p", 2, TETLOD_CELL_FLOAT32, (float[12]){0}};
    struct tetlod_build_array named = {"q", 1, TETLOD_CELL_FLOAT32, values};
    double moved[6][3];
    struct tetlod_build_mesh mesh = mesh_of();
    mesh.tets = 1;
    check_refused(&mesh, TETLOD_ERR_MESH, "stays as it is");
    mesh = mesh_of();
    memcpy(moved, positions, sizeof moved);
    moved[4][0] = 2;
    mesh.positions = moved;
    check_refused(&mesh, TETLOD_ERR_MESH, "points have moved");
    mesh = mesh_of();
    mesh.fields = &wide;
    check_refused(&mesh, TETLOD_ERR_FIELD, "float64");
    mesh.fields = &two;
    check_refused(&mesh, TETLOD_ERR_FIELD, "2 components");
    mesh.fields = &named;
    check_refused(&mesh, TETLOD_ERR_FIELD, "'p'");

    struct tetlod_build_options options;
    struct tetlod_build_series *series;
    struct tetlod_error error = {0};
    tetlod_build_defaults(&options);
    options.certify_exact = 1;
    CHECK(tetlod_build_series_new(&series, &options, &error) == TETLOD_ERR_ARGUMENT);
    CHECK(strstr(error.message, "certify_exact"));
    mesh = mesh_of();
    CHECK(tetlod_build_series_add(series, &mesh, 0, &error) == TETLOD_ERR_ARGUMENT);
    tetlod_build_series_free(series);
    tetlod_build_series_free(NULL);
}

int main(void)
{
    RUN(test_series);
    RUN(test_series_refusals);
    RUN(test_stream);
    RUN(test_refusals);
    RUN(test_options);
    RUN(test_cancelled_while_encoding);
    RUN(test_refused_early);
    return test_end();
}
