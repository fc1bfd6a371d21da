/* SPDX-License-Identifier: BSD-3-Clause */
/* Writing Medit: .mesh, text, and .meshb, binary, with the tetrahedra's region as their reference; and .sol, the fields
 * at its vertices, of one, three and six components, others as scalars. */
#include <inttypes.h>

#include "format/fail.h"
#include "src/io/writers/writers.h"
#include "src/util/put.h"

enum tetlod_status medit_write(const struct tetmesh *mesh, const struct tetlodi_sink *sink, struct tetlod_error *error)
{
    struct put put;
    uint32_t region = tetmesh_find_region(mesh);
    const double *ids = region == TETLOD_NONE ? NULL : mesh->cell_fields[region].values;
    int digits = mesh->position_type == TETLOD_FLOAT32 ? 9 : 17; // what comes back the same
    TETLOD_TRY(put_init(&put, sink, false, error));
    put_format(&put, "MeshVersionFormatted %d\nDimension 3\nVertices\n%" PRIu32 "\n",
               mesh->position_type == TETLOD_FLOAT32 ? 1 : 2, mesh->vertex_count);
    for (size_t v = 0; v < mesh->vertex_count; v++) {
        const double *p = mesh->positions + 3 * v;
        put_format(&put, "%.*g %.*g %.*g 0\n", digits, p[0], digits, p[1], digits, p[2]);
    }
    put_format(&put, "Tetrahedra\n%" PRIu32 "\n", mesh->tet_count);
    for (size_t t = 0; t < mesh->tet_count; t++) {
        const uint32_t *c = mesh->corners + 4 * t;
        put_format(&put, "%" PRIu64 " %" PRIu64 " %" PRIu64 " %" PRIu64 " %.0f\n", (uint64_t)c[0] + 1,
                   (uint64_t)c[1] + 1,
                   (uint64_t)c[2] + 1, (uint64_t)c[3] + 1, ids ? ids[t] : 0);
    }
    put_text(&put, "End\n");
    return put_finish(&put);
}

/* A keyword's number, and where the next one is. */
static void put_keyword(struct put *put, uint64_t number, uint64_t next, size_t place)
{
    put_word(put, number, 4);
    put_word(put, next, place);
}

/* Version 1 has float32 and 32 bit places, version 3 float64 and 64 bit places: float32 become float64 in a file of 2
 * GB and more. */
enum tetlod_status meshb_write(const struct tetmesh *mesh, const struct tetlodi_sink *sink, struct tetlod_error *error)
{
    enum { DIMENSION = 3, VERTICES = 4, TETRAHEDRA = 8, END = 54, HEAD = 64 };
    struct put put;
    uint32_t region = tetmesh_find_region(mesh);
    const double *ids = region == TETLOD_NONE ? NULL : mesh->cell_fields[region].values;
    bool narrow = mesh->position_type == TETLOD_FLOAT32 &&
                  HEAD + 16 * (uint64_t)mesh->vertex_count + 20 * (uint64_t)mesh->tet_count < INT32_MAX;
    enum tetlod_type type = narrow ? TETLOD_FLOAT32 : TETLOD_FLOAT64;
    size_t place = narrow ? 4 : 8;
    uint64_t vertices = 16 + place, tets = vertices + 8 + place + (narrow ? 16 : 28) * (uint64_t)mesh->vertex_count;
    uint64_t end = tets + 8 + place + 20 * (uint64_t)mesh->tet_count;
    TETLOD_TRY(put_init(&put, sink, false, error));
    put_word(&put, 1, 4);
    put_word(&put, narrow ? 1 : 3, 4);
    put_keyword(&put, DIMENSION, vertices, place);
    put_word(&put, 3, 4);
    put_keyword(&put, VERTICES, tets, place);
    put_word(&put, mesh->vertex_count, 4);
    for (size_t v = 0; v < mesh->vertex_count; v++) {
        for (int d = 0; d < 3; d++)
            put_double(&put, mesh->positions[3 * v + (size_t)d], type);
        put_word(&put, 0, 4);
    }
    put_keyword(&put, TETRAHEDRA, end, place);
    put_word(&put, mesh->tet_count, 4);
    for (size_t t = 0; t < mesh->tet_count; t++) {
        for (int i = 0; i < 4; i++)
            put_word(&put, (uint64_t)mesh->corners[4 * t + (size_t)i] + 1, 4);
        put_word(&put, ids ? (uint64_t)(int64_t)ids[t] : 0, 4);
    }
    put_keyword(&put, END, 0, place);
    return put_finish(&put);
}

enum tetlod_status sol_write(const struct tetmesh *mesh, const struct tetlodi_sink *sink, struct tetlod_error *error)
{
    struct put put;
    uint32_t columns = 0;
    TETLOD_TRY(put_init(&put, sink, false, error));
    for (uint32_t f = 0; f < mesh->field_count; f++) {
        uint32_t n = mesh->fields[f].components;
        columns += n == 3 || n == 6 ? 1 : n;
    }
    put_format(&put, "MeshVersionFormatted 2\nDimension 3\nSolAtVertices\n%" PRIu32 "\n%" PRIu32, mesh->vertex_count,
               columns);
    for (uint32_t f = 0; f < mesh->field_count; f++) {
        uint32_t n = mesh->fields[f].components;
        if (n == 3 || n == 6)
            put_text(&put, n == 3 ? " 2" : " 3");
        for (uint32_t c = 0; c < n && n != 3 && n != 6; c++)
            put_text(&put, " 1");
    }
    put_text(&put, "\n");
    for (size_t v = 0; v < mesh->vertex_count; v++)
        for (uint32_t f = 0; f < mesh->field_count; f++) {
            const struct point_field *field = &mesh->fields[f];
            for (uint32_t c = 0; c < field->components; c++)
                put_format(&put, "%.17g%c", field->values[v * field->components + c],
                           f + 1 == mesh->field_count && c + 1 == field->components ? '\n' : ' ');
        }
    put_text(&put, "End\n");
    return put_finish(&put);
}
