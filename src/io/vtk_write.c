/* SPDX-License-Identifier: BSD-3-Clause */
/* Writing legacy VTK 3.0, binary, which is big-endian. All fields go into one FIELD, which takes any number of
 * components. */
#include <inttypes.h>
#include <math.h>

#include "format/fail.h"
#include "src/io/io.h"
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

static void put_cells(struct put *put, const struct tetmesh *mesh)
{
    put_format(put, "CELLS %" PRIu32 " %" PRIu64 "\n", mesh->tet_count, 5 * (uint64_t)mesh->tet_count);
    for (size_t c = 0; c < 4 * (size_t)mesh->tet_count; c++) {
        if (c % 4 == 0)
            put_word(put, 4, 4);
        put_word(put, mesh->corners[c], 4);
    }
    put_format(put, "\nCELL_TYPES %" PRIu32 "\n", mesh->tet_count);
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

static void put_fields(struct put *put, const char *where, const struct point_field *fields, uint32_t count, uint32_t rows)
{
    if (count)
        put_format(put, "%s %" PRIu32 "\nFIELD FieldData %" PRIu32 "\n", where, rows, count);
    for (uint32_t f = 0; f < count; f++) {
        size_t values = (size_t)fields[f].components * rows, integers = integer_size(&fields[f], values);
        const char *type = integers == 8 ? "vtktypeint64" : integers == 4 ? "int" : types[fields[f].type];
        put_name(put, fields[f].name);
        put_format(put, " %" PRIu32 " %" PRIu32 " %s\n", fields[f].components, rows, type);
        if (integers)
            put_integers(put, fields[f].values, values, integers);
        else
            put_doubles(put, fields[f].type, fields[f].values, values);
    }
}

enum tetlod_status io_write_vtk(const struct tetmesh *mesh, const struct tetlodi_sink *sink, struct tetlod_error *error)
{
    struct put put;
    if (mesh->vertex_count > INT32_MAX)
        return tetlodi_fail(error, TETLOD_ERR_LIMIT, "legacy VTK numbers points with 31 bits; write .vtu");
    TETLOD_TRY(put_init(&put, sink, true, error));
    put_text(&put, "# vtk DataFile Version 3.0\ntetlod\nBINARY\nDATASET UNSTRUCTURED_GRID\n");
    put_format(&put, "POINTS %" PRIu32 " %s\n", mesh->vertex_count, types[mesh->position_type]);
    put_doubles(&put, mesh->position_type, mesh->positions, 3 * (size_t)mesh->vertex_count);
    put_cells(&put, mesh);
    put_fields(&put, "POINT_DATA", mesh->fields, mesh->field_count, mesh->vertex_count);
    put_fields(&put, "CELL_DATA", mesh->cell_fields, mesh->cell_field_count, mesh->tet_count);
    return put_finish(&put);
}
