/* SPDX-License-Identifier: BSD-3-Clause */
/* The parts of src/io that the command line does not show: numbers, names, reports, sinks that fail. */
#include <stdlib.h>

#include "src/io/services/file_values.h"
#include "src/io/io.h"
#include "src/io/read_input.h"
#include "src/io/services/tag_map.h"
#include "src/sample/sample.h"
#include "src/util/utf8_clean.h"
#include "tests/memory_sink.h"
#include "tests/test.h"

static struct text text_of(const char *text)
{
    return (struct text){text, text + strlen(text)};
}

static void test_numbers_in_text(void)
{
    struct text text = text_of(" 12 -7\t+3\n1e3 0x 9223372036854775808 4.5 1.00000001 ");
    int64_t whole;
    double number;
    CHECK(text_int(&text, &whole) && whole == 12);
    CHECK(text_int(&text, &whole) && whole == -7);
    CHECK(text_int(&text, &whole) && whole == 3);
    CHECK(text_double(&text, false, &number) && number == 1000);
    CHECK(!text_double(&text, false, &number));
    CHECK(!text_int(&text, &whole)); // too large
    CHECK(!text_int(&text, &whole)); // not whole
    CHECK(text_double(&text, true, &number) && number == 1);
    CHECK(!text_double(&text, false, &number) && text.at == text.end);
    char digits[400];
    memset(digits, '1', sizeof digits);
    text = (struct text){digits, digits + sizeof digits};
    CHECK(!text_double(&text, false, &number));
}

static void test_numbers_in_bytes(void)
{
    const unsigned char bytes[8] = {0xbf, 0xf0, 0, 0, 0, 0, 0, 0x80};
    double number;
    int64_t whole;
    values_to_doubles(bytes, VALUE_FLOAT64, true, 1, &number);
    CHECK_NEAR(number, -(1 + 128 * 0x1p-52), 0);
    values_to_ints(bytes, VALUE_INT16, true, 1, &whole);
    CHECK_INT(whole, -16400);
    values_to_ints(bytes, VALUE_UINT16, false, 1, &whole);
    CHECK_INT(whole, 0xf0bf);
    values_to_ints(bytes, VALUE_UINT64, true, 1, &whole);
    CHECK_INT(whole, -1); // above INT64_MAX
    values_to_doubles(bytes, VALUE_INT8, true, 1, &number);
    CHECK_NEAR(number, -65, 0);
    values_to_doubles(bytes, VALUE_FLOAT32, true, 1, &number);
    CHECK_NEAR(number, -1.875, 0);
}

static void test_lines(void)
{
    struct text text = text_of("one\r\n\ntwo"), line = text_line(&text);
    CHECK(text_is(line, "ONE"));
    line = text_line(&text);
    CHECK(line.at == line.end && text.at < text.end);
    line = text_line(&text);
    CHECK(text_is(line, "two") && text.at == text.end);
    line = text_line(&text);
    CHECK(line.at == line.end);
}

static void test_names(void)
{
    char good[] = "\xc3\xa9t\xc3\xa9 \xe2\x82\xac \xf0\x9f\x92\xa7", bad[] = "a\nb\xff\xc3(\xed\xa0\x80\xc0\xaf";
    utf8_clean(good);
    CHECK_TEXT(good, "\xc3\xa9t\xc3\xa9 \xe2\x82\xac \xf0\x9f\x92\xa7");
    utf8_clean(bad);
    CHECK_TEXT(bad, "a_b__(_____");
    struct tetmesh mesh = {.vertex_count = 1};
    const char *const wanted[] = {"x", "x_2", "x_3", "field"};
    for (int i = 0; i < 4; i++)
        CHECK_INT(assemble_field(&mesh, i < 3 ? "x" : "", 1, TETLOD_FLOAT32, NULL), TETLOD_OK);
    for (int i = 0; i < 4; i++)
        CHECK_TEXT(mesh.fields[i].name, wanted[i]);
    CHECK_INT(assemble_field(&mesh, "y", 0, TETLOD_FLOAT32, NULL), TETLOD_ERR_MESH);
    tetmesh_fini(&mesh);
}

static void test_tags(void)
{
    const int64_t tags[] = {7, -3, INT64_MAX, INT64_MIN, 8, 9};
    struct tag_map map = {0};
    for (int i = 0; i < 6; i++)
        CHECK_INT(tag_map_add(&map, tags[i], NULL), TETLOD_OK);
    CHECK_INT(tag_map_sort(&map, NULL), TETLOD_OK);
    for (uint32_t i = 0; i < 6; i++)
        CHECK_INT(tag_map_find(&map, tags[i]), i);
    CHECK_INT(tag_map_find(&map, 10), TETLOD_NONE);
    CHECK_INT(tag_map_add(&map, 8, NULL), TETLOD_OK);
    CHECK_INT(tag_map_sort(&map, NULL), TETLOD_ERR_MESH);
    tag_map_fini(&map);
    CHECK_INT(tag_map_find(&map, 0), TETLOD_NONE);
}

static const char mixed[] =
    "# vtk DataFile Version 3.0\nmixed\nASCII\nDATASET UNSTRUCTURED_GRID\nPOINTS 10 double\n"
    "0 0 0 1 0 0 1 1 0 0 1 0 0 0 1 1 0 1 1 1 1 0 1 1 0 0 3 9 9 9\n"
    "CELLS 4 21\n8 0 1 2 3 4 5 6 7\n4 4 5 6 8\n3 0 1 2\n2 0 1\nCELL_TYPES 4\n12 10 5 3\n"
    "CELL_DATA 4\nSCALARS c int 1\nLOOKUP_TABLE default\n1 2 3 4\n"
    "POINT_DATA 10\nSCALARS id int\nLOOKUP_TABLE default\n0 1 2 3 4 5 6 7 8 9\n";

static void test_report(void)
{
    struct tetmesh mesh = {0};
    struct io_report report = {0};
    struct tetlod_error error = {0};
    struct io_input input = {.bytes = (const unsigned char *)mixed, .size = sizeof mixed - 1};
    CHECK_INT(io_read_input(&mesh, "x", &input, &report, &error), TETLOD_OK);
    CHECK_TEXT(report.format, "vtk");
    CHECK_INT(report.split_cells, 1);
    CHECK_INT(report.skipped_cells, 2);
    CHECK_INT(report.skipped_arrays, 0);
    CHECK_INT(mesh.cell_field_count, 1);
    CHECK_NEAR(mesh.cell_fields[0].values[0], 2, 0); // the tetrahedron comes first
    CHECK_NEAR(mesh.cell_fields[0].values[1], 1, 0);
    CHECK(mesh.cell_fields[0].is_integer);
    CHECK_INT(mesh.unused_points, 1);
    CHECK_INT(mesh.vertex_count, 9);
    CHECK_INT(mesh.tet_count, 7);
    CHECK_INT(mesh.field_count, 1);
    CHECK_INT(mesh.fields[0].type, TETLOD_FLOAT64);
    CHECK_INT(mesh.position_type, TETLOD_FLOAT64);
    CHECK_NEAR(mesh.fields[0].values[8], 8, 0);
    tetmesh_fini(&mesh);
}

struct short_sink {
    size_t left;
    enum tetlod_status status;
};

static enum tetlod_status write_short(void *opaque, const void *bytes, size_t size)
{
    struct short_sink *sink = opaque;
    (void)bytes;
    if (sink->status != TETLOD_OK)
        TEST_FAIL("written to after it had failed");
    if (size > sink->left) {
        sink->status = TETLOD_ERR_CANCELLED;
        return sink->status;
    }
    sink->left -= size;
    return TETLOD_OK;
}

static void test_sinks_that_fail(void)
{
    enum tetlod_status (*const writers[])(const struct tetmesh *, const struct tetlodi_sink *,
                                          struct tetlod_error *) = {
        io_write_vtu, io_write_vtu_plain, io_write_vtk, gmsh_write, stl_write, ply_write, vtp_write, glb_write};
    struct tetmesh mesh;
    REQUIRE(sample_find("cube")->make(&mesh, 12, NULL) == TETLOD_OK);
    for (size_t w = 0; w < sizeof writers / sizeof *writers; w++) {
        struct memory_sink memory = {0};
        struct tetlodi_sink whole = memory_sink(&memory);
        CHECK_INT(writers[w](&mesh, &whole, NULL), TETLOD_OK);
        for (size_t part = 0; part < 8; part++) {
            struct short_sink state = {memory.size * part / 8, TETLOD_OK};
            struct tetlodi_sink sink = {write_short, &state};
            CHECK_INT(writers[w](&mesh, &sink, NULL), TETLOD_ERR_CANCELLED);
        }
        free(memory.bytes);
    }
    tetmesh_fini(&mesh);
}

/* ---- files piece by piece ---- */

static void rows_values(const void *opaque, uint32_t column, uint64_t first, size_t count, double *out)
{
    const struct tetmesh *mesh = opaque;
    size_t components = column ? mesh->fields[column - 1].components : 3;
    memcpy(out, (column ? mesh->fields[column - 1].values : mesh->positions) + first * components,
           count * components * sizeof *out);
}

static void rows_corners(const void *opaque, uint64_t first, size_t count, uint32_t *out)
{
    const struct tetmesh *mesh = opaque;
    memcpy(out, mesh->corners + 4 * first, count * 4 * sizeof *out);
}

static void check_layout(const struct tetmesh *mesh,
                         enum tetlod_status (*write)(const struct tetmesh *, const struct tetlodi_sink *,
                                                     struct tetlod_error *),
                         enum tetlod_status (*lay_out)(struct io_layout **, const struct tetmesh *,
                                                       struct tetlod_error *))
{
    struct memory_sink memory = {0};
    struct tetlodi_sink sink = memory_sink(&memory);
    struct io_layout *layout;
    const struct io_rows rows = {mesh, rows_values, rows_corners};
    CHECK_INT(write(mesh, &sink, NULL), TETLOD_OK);
    REQUIRE(lay_out(&layout, mesh, NULL) == TETLOD_OK);
    REQUIRE(io_layout_size(layout) == memory.size);
    unsigned char *bytes = malloc(memory.size);
    REQUIRE(bytes != NULL);
    for (size_t begin = 0, step = 1; begin < memory.size; begin += step, step = step * 7 % 100003) {
        size_t size = memory.size - begin < step ? memory.size - begin : step;
        io_layout_read(layout, &rows, begin, size, bytes + begin);
    }
    CHECK(memcmp(bytes, memory.bytes, memory.size) == 0);
    memset(bytes, 0, memory.size);
    io_layout_read(layout, &rows, 0, memory.size, bytes);
    CHECK(memcmp(bytes, memory.bytes, memory.size) == 0);
    free(bytes);
    free(memory.bytes);
    io_layout_free(layout);
}

static void test_layouts(void)
{
    struct tetmesh mesh;
    REQUIRE(sample_find("cube")->make(&mesh, 9, NULL) == TETLOD_OK);
    for (int fields = 0; fields < 4; fields++) {
        check_layout(&mesh, io_write_vtu_plain, io_layout_vtu);
        check_layout(&mesh, io_write_vtk, io_layout_vtk);
        uint32_t components = fields == 2 ? 5000 : 3; // more than a block has words
        REQUIRE(tetmesh_add_field(&mesh, fields ? "a \"b\" <c>" : "plain", components,
                                  fields % 2 ? TETLOD_FLOAT32 : TETLOD_FLOAT64, NULL) == TETLOD_OK);
        for (size_t i = 0; i < (size_t)mesh.vertex_count * components; i++)
            mesh.fields[mesh.field_count - 1].values[i] = (double)(i % 1000) / 8;
    }
    mesh.position_type = mesh.position_type == TETLOD_FLOAT32 ? TETLOD_FLOAT64 : TETLOD_FLOAT32;
    check_layout(&mesh, io_write_vtu_plain, io_layout_vtu);
    check_layout(&mesh, io_write_vtk, io_layout_vtk);
    tetmesh_fini(&mesh);
    mesh = (struct tetmesh){0}; // nothing at all
    check_layout(&mesh, io_write_vtu_plain, io_layout_vtu);
    check_layout(&mesh, io_write_vtk, io_layout_vtk);
}

int main(void)
{
    RUN(test_layouts);
    RUN(test_numbers_in_text);
    RUN(test_numbers_in_bytes);
    RUN(test_lines);
    RUN(test_names);
    RUN(test_tags);
    RUN(test_report);
    RUN(test_sinks_that_fail);
    return test_end();
}
