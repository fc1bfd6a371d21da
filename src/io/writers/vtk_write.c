/* SPDX-License-Identifier: BSD-3-Clause */
/* Writing legacy VTK 3.0, binary, which is big-endian. All fields go into one FIELD, which takes any number of
 * components. */
#include <inttypes.h>
#include <stdlib.h>

#include "format/fail.h"
#include "src/io/writers/layout.h"
#include "src/io/writers/writers.h"
#include "src/mesh/mixed_cells.h"
#include "src/util/array.h"
#include "src/util/put.h"

static const char *const types[] = {[TETLOD_FLOAT32] = "float", [TETLOD_FLOAT64] = "double"};

/* Names are one word: what would end it, and '%' itself, is written as %XX. */
static void put_name(struct put *put, const char *name)
{
    for (; *name; name++) {
        unsigned char c = (unsigned char)*name;
        if (c > 32 && c < 127 && c != '%' && c != '"')
            put_word(put, c, 1);
        else
            put_format(put, "%%%02X", c);
    }
}

static void put_points_line(struct put *put, const struct tetmesh *mesh)
{
    put_text(put, "# vtk DataFile Version 3.0\ntetlod\nBINARY\nDATASET UNSTRUCTURED_GRID\n");
    put_format(put, "POINTS %" PRIu32 " %s\n", mesh->vertex_count, types[mesh->position_type]);
}

static void put_cells_line(struct put *put, const struct tetmesh *mesh)
{
    uint64_t words = mesh->cells ? mesh->cells->count + mesh->cells->connectivity_count : 5 * (uint64_t)mesh->tet_count;
    put_format(put, "CELLS %" PRIu32 " %" PRIu64 "\n", mesh->tet_count, words);
}

static void put_types_line(struct put *put, const struct tetmesh *mesh)
{
    put_format(put, "\nCELL_TYPES %" PRIu32 "\n", mesh->tet_count);
}

static void put_fields_line(struct put *put, const char *where, uint32_t count, uint32_t rows)
{
    if (count)
        put_format(put, "%s %" PRIu32 "\nFIELD FieldData %" PRIu32 "\n", where, rows, count);
}

static void put_field_line(struct put *put, const struct point_field *field, const char *type, uint32_t rows)
{
    put_name(put, field->name);
    put_format(put, " %" PRIu32 " %" PRIu32 " %s\n", field->components, rows, type);
}

/* A field's unit, behind its values. */
static void put_unit(struct put *put, const struct point_field *field)
{
    if (!field->unit[0])
        return;
    put_text(put, "METADATA\nINFORMATION 1\nNAME UNITS_LABEL LOCATION vtkDataArray\nDATA ");
    put_name(put, field->unit);
    put_text(put, "\n\n");
}

static const char *type_of(const struct point_field *field, const struct layout_array *array)
{
    return !array->integer ? types[field->type] : array->width == 8 ? "vtktypeint64" : "int";
}

static enum tetlod_status check_count(const struct tetmesh *mesh, struct tetlod_error *error)
{
    if (mesh->vertex_count > INT32_MAX)
        return tetlodi_fail(error, TETLOD_ERR_LIMIT, "legacy VTK numbers points with 31 bits; write .vtu");
    return TETLOD_OK;
}

/* The arrays: 0 the points, 1 the tetrahedra, 2 their types, then the fields of points, then those of cells. */
static uint32_t array_count(const struct tetmesh *shape)
{
    return 3 + shape->field_count + shape->cell_field_count;
}

/* The field of array `number`; NULL: it is none of a field. */
static const struct point_field *field_at(const struct tetmesh *shape, uint32_t number)
{
    if (number < 3 || number >= array_count(shape))
        return NULL;
    number -= 3;
    return number < shape->field_count ? &shape->fields[number] : &shape->cell_fields[number - shape->field_count];
}

static struct layout_array array_at(const struct tetmesh *shape, uint32_t number)
{
    const struct point_field positions = {.components = 3, .type = shape->position_type, .values = shape->positions};
    struct layout_array array = {.words = 1, .width = 4, .rows = shape->tet_count};
    if (number == 0) {
        array = layout_of_field(&positions, 0, shape->vertex_count);
    } else if (number == 1) {
        array.kind = ROW_COUNT_CORNERS;
        array.words = 5;
        array.corners = shape->corners;
    } else if (number == 2) {
        array.kind = ROW_TYPE;
    } else {
        bool of_points = number < 3 + shape->field_count;
        array = layout_of_field(field_at(shape, number), of_points ? number - 2 : 0,
                                of_points ? shape->vertex_count : shape->tet_count);
    }
    array.big_endian = true;
    return array;
}

/* The text in front of an array, or behind the last. */
static void put_text_before(struct put *put, const struct tetmesh *shape, uint32_t number)
{
    if (number == 0)
        put_points_line(put, shape);
    if (number == 1 || number >= 3)
        put_text(put, "\n"); // ends the array before
    if (number > 3)
        put_unit(put, field_at(shape, number - 1));
    if (number == 1)
        put_cells_line(put, shape);
    if (number == 2)
        put_types_line(put, shape);
    if (number == 3)
        put_fields_line(put, "POINT_DATA", shape->field_count, shape->vertex_count);
    if (number == 3 + shape->field_count)
        put_fields_line(put, "CELL_DATA", shape->cell_field_count, shape->tet_count);
    const struct point_field *field = field_at(shape, number);
    if (!field)
        return;
    const struct layout_array array = array_at(shape, number);
    put_field_line(put, field, type_of(field, &array), (uint32_t)array.rows);
}

static enum tetlod_status lay_out(struct io_layout *layout, const struct tetmesh *shape, struct tetlod_error *error)
{
    const struct tetlodi_sink sink = layout_sink(layout);
    for (uint32_t number = 0; number <= array_count(shape); number++) {
        struct put put;
        TETLOD_TRY(put_init(&put, &sink, true, error));
        put_text_before(&put, shape, number);
        if (put_finish(&put) != TETLOD_OK)
            return tetlodi_fail_nomem(error, "a mesh file", 0);
        if (number < array_count(shape)) {
            const struct layout_array array = array_at(shape, number);
            TETLOD_TRY(layout_add(layout, &array, error));
        }
    }
    return TETLOD_OK;
}

enum tetlod_status io_layout_vtk(struct io_layout **out, const struct tetmesh *shape, struct tetlod_error *error)
{
    *out = NULL;
    TETLOD_TRY(check_count(shape, error));
    TETLOD_TRY(layout_start(out, error));
    enum tetlod_status status = lay_out(*out, shape, error);
    return layout_end(out, status);
}

/* ---- cells of any kind */

/* Of each cell how many words follow, and these. */
static uint32_t *make_lists(const struct cells *cells)
{
    uint32_t *out = array_new((size_t)(cells->count + cells->connectivity_count), sizeof *out), *at = out;
    for (uint64_t c = 0; c < cells->count && out; c++) {
        *at++ = (uint32_t)(cells->offsets[c + 1] - cells->offsets[c]);
        for (uint64_t i = cells->offsets[c]; i < cells->offsets[c + 1]; i++)
            *at++ = cells->connectivity[i];
    }
    return out;
}

static void put_words(struct put *put, const uint32_t *words, uint64_t count)
{
    for (uint64_t i = 0; i < count; i++)
        put_word(put, words[i], 4);
}

static void put_array(struct put *put, const struct layout_array *array)
{
    enum { BLOCK = 512 };
    unsigned char bytes[8 * BLOCK];
    for (uint64_t word = 0, all = array->rows * array->words; word < all; word += BLOCK) {
        size_t some = all - word < BLOCK ? (size_t)(all - word) : BLOCK;
        layout_store(array, word, some, bytes);
        put_bytes(put, bytes, some * array->width);
    }
}

static enum tetlod_status check_cells(const struct cells *cells, struct tetlod_error *error)
{
    if (cells->connectivity_count > INT32_MAX)
        return tetlodi_fail(error, TETLOD_ERR_LIMIT, "legacy VTK counts corners with 31 bits; write .vtu");
    for (uint64_t c = 0; c < cells->count; c++)
        if (cells->types[c] == VTK_TYPE_LAGRANGE_HEXAHEDRON)
            return tetlodi_fail(error, TETLOD_ERR_ARGUMENT,
                                "legacy VTK orders the points of Lagrange hexahedra in another way; write .vtu");
    return TETLOD_OK;
}

static enum tetlod_status write_cells(const struct tetmesh *mesh, const struct tetlodi_sink *sink,
                                      struct tetlod_error *error)
{
    struct put put;
    TETLOD_TRY(check_count(mesh, error));
    TETLOD_TRY(check_cells(mesh->cells, error));
    uint32_t *lists = make_lists(mesh->cells);
    if (!lists)
        return tetlodi_fail_nomem(error, "the cells", mesh->cells->connectivity_count * sizeof *lists);
    enum tetlod_status status = put_init(&put, sink, true, error);
    for (uint32_t number = 0; number <= array_count(mesh) && status == TETLOD_OK; number++) {
        put_text_before(&put, mesh, number);
        if (number == 1)
            put_words(&put, lists, mesh->cells->count + mesh->cells->connectivity_count);
        for (uint64_t c = 0; c < mesh->cells->count && number == 2; c++)
            put_word(&put, mesh->cells->types[c], 4);
        if ((number == 0 || number > 2) && number < array_count(mesh)) {
            const struct layout_array array = array_at(mesh, number);
            put_array(&put, &array);
        }
    }
    enum tetlod_status written = put_finish(&put);
    free(lists);
    return status == TETLOD_OK ? written : status;
}

enum tetlod_status io_write_vtk(const struct tetmesh *mesh, const struct tetlodi_sink *sink, struct tetlod_error *error)
{
    return mesh->cells ? write_cells(mesh, sink, error) : layout_write_whole(io_layout_vtk, mesh, sink, error);
}
