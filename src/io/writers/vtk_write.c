/* SPDX-License-Identifier: BSD-3-Clause */
/* Writing legacy VTK 3.0, binary, which is big-endian. All fields go into one FIELD, which takes any number of
 * components. */
#include <inttypes.h>
#include <math.h>

#include "format/fail.h"
#include "src/io/writers/writers.h"
#include "src/io/writers/layout.h"
#include "src/util/put.h"

enum { VTK_TETRA = 10 };

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

static void put_doubles(struct put *put, enum tetlod_type type, const double *values, size_t count)
{
    for (size_t i = 0; i < count; i++)
        put_double(put, values[i], type);
    put_text(put, "\n");
}

static void put_points_line(struct put *put, const struct tetmesh *mesh)
{
    put_text(put, "# vtk DataFile Version 3.0\ntetlod\nBINARY\nDATASET UNSTRUCTURED_GRID\n");
    put_format(put, "POINTS %" PRIu32 " %s\n", mesh->vertex_count, types[mesh->position_type]);
}

static void put_cells_line(struct put *put, const struct tetmesh *mesh)
{
    put_format(put, "CELLS %" PRIu32 " %" PRIu64 "\n", mesh->tet_count, 5 * (uint64_t)mesh->tet_count);
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

static void put_cells(struct put *put, const struct tetmesh *mesh)
{
    put_cells_line(put, mesh);
    for (size_t c = 0; c < 4 * (size_t)mesh->tet_count; c++) {
        if (c % 4 == 0)
            put_word(put, 4, 4);
        put_word(put, mesh->corners[c], 4);
    }
    put_types_line(put, mesh);
    for (uint32_t t = 0; t < mesh->tet_count; t++)
        put_word(put, VTK_TETRA, 4);
    put_text(put, "\n");
}

/* Integers stay integers: bytes of each, 0 where they have to be floats. */
static size_t integer_size(const struct point_field *field, size_t count)
{
    size_t size = field->is_integer ? 4 : 0;
    for (size_t i = 0; i < count && size; i++)
        size = !(fabs(field->values[i]) <= 0x1p53) ? 0 : fabs(field->values[i]) > INT32_MAX ? 8 : size;
    return size;
}

static void put_integers(struct put *put, const double *values, size_t count, size_t size)
{
    for (size_t i = 0; i < count; i++)
        put_word(put, (uint64_t)(int64_t)values[i], size);
    put_text(put, "\n");
}

static const char *type_of(const struct point_field *field, size_t integers)
{
    return integers == 8 ? "vtktypeint64" : integers == 4 ? "int" : types[field->type];
}

static void put_fields(struct put *put, const char *where, const struct point_field *fields, uint32_t count, uint32_t rows)
{
    put_fields_line(put, where, count, rows);
    for (uint32_t f = 0; f < count; f++) {
        size_t values = (size_t)fields[f].components * rows, integers = integer_size(&fields[f], values);
        put_field_line(put, &fields[f], type_of(&fields[f], integers), rows);
        if (integers)
            put_integers(put, fields[f].values, values, integers);
        else
            put_doubles(put, fields[f].type, fields[f].values, values);
        put_unit(put, &fields[f]);
    }
}

static enum tetlod_status check_count(const struct tetmesh *mesh, struct tetlod_error *error)
{
    if (mesh->vertex_count > INT32_MAX)
        return tetlodi_fail(error, TETLOD_ERR_LIMIT, "legacy VTK numbers points with 31 bits; write .vtu");
    return TETLOD_OK;
}

enum tetlod_status io_write_vtk(const struct tetmesh *mesh, const struct tetlodi_sink *sink, struct tetlod_error *error)
{
    struct put put;
    TETLOD_TRY(check_count(mesh, error));
    TETLOD_TRY(put_init(&put, sink, true, error));
    put_points_line(&put, mesh);
    put_doubles(&put, mesh->position_type, mesh->positions, 3 * (size_t)mesh->vertex_count);
    put_cells(&put, mesh);
    put_fields(&put, "POINT_DATA", mesh->fields, mesh->field_count, mesh->vertex_count);
    put_fields(&put, "CELL_DATA", mesh->cell_fields, mesh->cell_field_count, mesh->tet_count);
    return put_finish(&put);
}

/* ---- piece by piece ---- */

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
    static const size_t widths[] = {[TETLOD_FLOAT32] = 4, [TETLOD_FLOAT64] = 8};
    struct layout_array array = {.kind = ROW_VALUES, .big_endian = true, .rows = number == 0 ? shape->vertex_count : shape->tet_count};
    if (number == 0) {
        array.words = 3;
        array.width = widths[shape->position_type];
    } else if (number < 3) {
        array.kind = number == 1 ? ROW_COUNT_CORNERS : ROW_TYPE;
        array.words = number == 1 ? 5 : 1;
        array.width = 4;
    } else if (number < 3 + shape->field_count) {
        const struct point_field *field = field_at(shape, number);
        array = (struct layout_array){ROW_VALUES, number - 2, field->components, widths[field->type], true, false, shape->vertex_count, NULL};
    } else {
        const struct point_field *field = field_at(shape, number);
        size_t integers = integer_size(field, (size_t)field->components * shape->tet_count);
        array = (struct layout_array){ROW_VALUES, 0, field->components, integers ? integers : widths[field->type], true, integers > 0, shape->tet_count, field->values};
    }
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
    put_field_line(put, field, type_of(field, array.integer ? array.width : 0), (uint32_t)array.rows);
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
    if (status != TETLOD_OK) {
        io_layout_free(*out);
        *out = NULL;
    }
    return status;
}
