/* SPDX-License-Identifier: BSD-3-Clause */
/* Writing legacy VTK 3.0, binary, which is big-endian. All fields go into one FIELD, which takes any number of
 * components. */
#include <inttypes.h>

#include "format/fail.h"
#include "src/io/io.h"
#include "src/util/put.h"

enum { VTK_TETRA = 10 };

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

enum tetlod_status io_write_vtk(const struct tetmesh *mesh, const struct tetlodi_sink *sink, struct tetlod_error *error)
{
    static const char *const types[] = {[TETLOD_FLOAT32] = "float", [TETLOD_FLOAT64] = "double"};
    struct put put;
    if (mesh->vertex_count > INT32_MAX)
        return tetlodi_fail(error, TETLOD_ERR_LIMIT, "legacy VTK numbers points with 31 bits; write .vtu");
    TETLOD_TRY(put_init(&put, sink, true, error));
    put_text(&put, "# vtk DataFile Version 3.0\ntetlod\nBINARY\nDATASET UNSTRUCTURED_GRID\n");
    put_format(&put, "POINTS %" PRIu32 " %s\n", mesh->vertex_count, types[mesh->position_type]);
    put_doubles(&put, mesh->position_type, mesh->positions, 3 * (size_t)mesh->vertex_count);
    put_cells(&put, mesh);
    if (mesh->field_count)
        put_format(&put, "POINT_DATA %" PRIu32 "\nFIELD FieldData %" PRIu32 "\n", mesh->vertex_count, mesh->field_count);
    for (uint32_t f = 0; f < mesh->field_count; f++) {
        const struct point_field *field = &mesh->fields[f];
        put_name(&put, field->name);
        put_format(&put, " %" PRIu32 " %" PRIu32 " %s\n", field->components, mesh->vertex_count, types[field->type]);
        put_doubles(&put, field->type, field->values, (size_t)field->components * mesh->vertex_count);
    }
    return put_finish(&put);
}
