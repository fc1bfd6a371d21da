/* SPDX-License-Identifier: BSD-3-Clause */
/* Writing Gmsh MSH 4.1, binary, little-endian: one volume that holds all. Points and tetrahedra are numbered from 1.
 * Everything is float64 there. Gmsh knows fields of 1, 3 and 9 components; others are written as scalars NAME:0, ... */
#include <inttypes.h>

#include "format/fail.h"
#include "src/io/writers/writers.h"
#include "src/util/put.h"

enum { VOLUME = 3, VOLUME_TAG = 1, GMSH_TET = 4 };

static void put_entities(struct put *put, const struct tetmesh *mesh)
{
    double bounds[6] = {0};
    for (size_t i = 0; i < 3 * (size_t)mesh->vertex_count; i++) {
        double *least = &bounds[i % 3], *most = &bounds[3 + i % 3], value = mesh->positions[i];
        *least = i < 3 || value < *least ? value : *least;
        *most = i < 3 || value > *most ? value : *most;
    }
    put_text(put, "$Entities\n");
    for (int dimension = 0; dimension <= VOLUME; dimension++)
        put_word(put, dimension == VOLUME, 8);
    put_word(put, VOLUME_TAG, 4);
    for (int i = 0; i < 6; i++)
        put_double(put, bounds[i], TETLOD_FLOAT64);
    put_word(put, 0, 8); // physical groups
    put_word(put, 0, 8); // bounding surfaces
    put_text(put, "\n$EndEntities\n");
}

/* Blocks, entries, least and largest tag; then the one block's head. */
static void put_block_head(struct put *put, uint32_t count, uint32_t third)
{
    put_word(put, 1, 8);
    put_word(put, count, 8);
    put_word(put, 1, 8);
    put_word(put, count, 8);
    put_word(put, VOLUME, 4);
    put_word(put, VOLUME_TAG, 4);
    put_word(put, third, 4);
    put_word(put, count, 8);
}

static void put_mesh(struct put *put, const struct tetmesh *mesh)
{
    put_text(put, "$Nodes\n");
    put_block_head(put, mesh->vertex_count, 0); // not parametric
    for (uint32_t v = 0; v < mesh->vertex_count; v++)
        put_word(put, (uint64_t)v + 1, 8);
    for (size_t i = 0; i < 3 * (size_t)mesh->vertex_count; i++)
        put_double(put, mesh->positions[i], TETLOD_FLOAT64);
    put_text(put, "\n$EndNodes\n$Elements\n");
    put_block_head(put, mesh->tet_count, GMSH_TET);
    for (uint32_t t = 0; t < mesh->tet_count; t++) {
        put_word(put, (uint64_t)t + 1, 8);
        for (int c = 0; c < 4; c++)
            put_word(put, (uint64_t)mesh->corners[4 * (size_t)t + (size_t)c] + 1, 8);
    }
    put_text(put, "\n$EndElements\n");
}

/* The components first .. first + count of a field, of points or of cells. */
static void put_field(struct put *put, const char *section, const struct point_field *field, uint32_t rows,
                      uint32_t first,
                      uint32_t count)
{
    put_format(put, "$%s\n1\n\"", section);
    for (const char *c = field->name; *c; c++)
        put_word(put, *c == '"' ? '\'' : (unsigned char)*c, 1);
    if (count != field->components)
        put_format(put, ":%" PRIu32, first);
    put_format(put, "\"\n1\n0\n3\n0\n%" PRIu32 "\n%" PRIu32 "\n", count, rows);
    for (uint32_t r = 0; r < rows; r++) {
        put_word(put, (uint64_t)r + 1, 4);
        for (uint32_t c = first; c < first + count; c++)
            put_double(put, field->values[(size_t)r * field->components + c], TETLOD_FLOAT64);
    }
    put_format(put, "\n$End%s\n", section);
}

static void put_fields(struct put *put, const char *section, const struct point_field *fields, uint32_t count,
                       uint32_t rows)
{
    for (uint32_t f = 0; f < count; f++) {
        uint32_t n = fields[f].components, width = n == 1 || n == 3 || n == 9 ? n : 1;
        for (uint32_t c = 0; c < n; c += width)
            put_field(put, section, &fields[f], rows, c, width);
    }
}

enum tetlod_status gmsh_write(const struct tetmesh *mesh, const struct tetlodi_sink *sink, struct tetlod_error *error)
{
    struct put put;
    if (mesh->vertex_count > INT32_MAX || mesh->tet_count > INT32_MAX)
        return tetlodi_fail(error, TETLOD_ERR_LIMIT, "Gmsh numbers the points of a field with 31 bits; write .vtu");
    TETLOD_TRY(put_init(&put, sink, false, error));
    put_text(&put, "$MeshFormat\n4.1 1 8\n");
    put_word(&put, 1, 4); // tells the byte order
    put_text(&put, "\n$EndMeshFormat\n");
    put_entities(&put, mesh);
    put_mesh(&put, mesh);
    put_fields(&put, "NodeData", mesh->fields, mesh->field_count, mesh->vertex_count);
    put_fields(&put, "ElementData", mesh->cell_fields, mesh->cell_field_count, mesh->tet_count);
    return put_finish(&put);
}
