/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * Writing USD as text: one TetMesh of UsdGeom, with its boundary as surfaceFaceVertexIndices, fields at points as
 * primvars of interpolation "vertex" and those of cells as "uniform". USD's points are float32. A name in USD is a
 * word: another one stays as displayName.
 */
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "format/fail.h"
#include "src/io/writers/facts.h"
#include "src/io/writers/writers.h"
#include "src/mesh/adjacency.h"
#include "src/util/array.h"
#include "src/util/put.h"

enum { NAME = 256 };

/* Corners of the face opposite a corner, seen from outside in the order that USD takes for right-handed. */
static const int faces[4][3] = {{1, 2, 3}, {0, 3, 2}, {0, 1, 3}, {0, 2, 1}};

static bool is_letter(unsigned char c)
{
    return (c >= 'A' && c <= 'Z') || (c >= 'a' && c <= 'z') || c == '_';
}

/* The word for a name; a number behind it where an earlier array has it. */
static void make_word(const char *name, char out[static NAME])
{
    size_t used = 0;
    if (!is_letter((unsigned char)name[0]))
        out[used++] = '_';
    for (; *name && used + 16 < NAME; name++)
        out[used++] = is_letter((unsigned char)*name) || (*name >= '0' && *name <= '9') ? *name : '_';
    out[used] = 0;
}

/* The word of array `number`, where those of cells come behind those at points. */
static void find_word(const struct tetmesh *mesh, uint32_t number, char out[static NAME])
{
    char other[NAME];
    unsigned same = 1;
    const uint32_t points = mesh->field_count;
    make_word(number < points ? mesh->fields[number].name : mesh->cell_fields[number - points].name, out);
    for (uint32_t i = 0; i < number; i++) {
        make_word(i < points ? mesh->fields[i].name : mesh->cell_fields[i - points].name, other);
        same += strcmp(out, other) == 0;
    }
    if (same > 1)
        snprintf(out + strlen(out), 16, "_%u", same);
}

static void put_quoted(struct put *put, const char *text)
{
    put_text(put, "\"");
    for (; *text; text++) {
        if (*text == '"' || *text == '\\')
            put_text(put, "\\");
        put_word(put, (unsigned char)*text, 1);
    }
    put_text(put, "\"");
}

/* ---- the layer */

static void put_head(struct put *put, const struct tetmesh *mesh)
{
    struct fact fact;
    put_text(put, "#usda 1.0\n(\n    customLayerData = {\n");
    for (uint32_t i = 0; fact_of(mesh, i, &fact); i++) {
        char name[NAME];
        snprintf(name, sizeof name, "%s%s%.200s", fact.name, fact.field ? " " : "", fact.field ? fact.field : "");
        put_text(put, fact.codes ? "        string " : "        double ");
        put_quoted(put, name);
        put_text(put, " = ");
        if (fact.codes)
            put_quoted(put, fact.codes);
        else
            put_format(put, "%.17g", fact.value);
        put_text(put, "\n");
    }
    put_text(put, "    }\n    defaultPrim = \"mesh\"\n    upAxis = \"Z\"\n)\n\ndef TetMesh \"mesh\"\n{\n");
}

static void put_extent(struct put *put, const struct tetmesh *mesh)
{
    float low[3] = {0}, high[3] = {0};
    for (size_t v = 0; v < mesh->vertex_count; v++)
        for (size_t d = 0; d < 3; d++) {
            const float x = (float)mesh->positions[3 * v + d];
            low[d] = v == 0 || x < low[d] ? x : low[d];
            high[d] = v == 0 || x > high[d] ? x : high[d];
        }
    put_format(put, "    float3[] extent = [(%.9g, %.9g, %.9g), (%.9g, %.9g, %.9g)]\n", low[0], low[1], low[2], high[0],
               high[1], high[2]);
}

static const char *between(size_t number)
{
    return number == 0 ? "" : number % 8 ? ", " : ",\n        ";
}

static void put_corners(struct put *put, const struct tetmesh *mesh)
{
    put_text(put, "    uniform token orientation = \"rightHanded\"\n    int4[] tetVertexIndices = [");
    for (size_t t = 0; t < mesh->tet_count; t++) {
        const uint32_t *c = mesh->corners + 4 * t;
        put_format(put, "%s(%" PRIu32 ", %" PRIu32 ", %" PRIu32 ", %" PRIu32 ")", between(t), c[0], c[1], c[2], c[3]);
    }
    put_text(put, "]\n");
}

static void put_surface(struct put *put, const struct tetmesh *mesh, const uint32_t *neighbours)
{
    size_t count = 0;
    put_text(put, "    int3[] surfaceFaceVertexIndices = [");
    for (size_t side = 0; side < 4 * (size_t)mesh->tet_count; side++) {
        const uint32_t *c = mesh->corners + side / 4 * 4;
        const int *face = faces[side % 4];
        if (neighbours[side] == TETLOD_NONE)
            put_format(put, "%s(%" PRIu32 ", %" PRIu32 ", %" PRIu32 ")", between(count++), c[face[0]], c[face[1]],
                       c[face[2]]);
    }
    put_text(put, "]\n");
}

static void put_points(struct put *put, const struct tetmesh *mesh)
{
    put_text(put, "    point3f[] points = [");
    for (size_t v = 0; v < mesh->vertex_count; v++) {
        const double *p = mesh->positions + 3 * v;
        put_format(put, "%s(%.9g, %.9g, %.9g)", between(v), (double)(float)p[0], (double)(float)p[1],
                   (double)(float)p[2]);
    }
    put_text(put, "]\n");
}

/* ---- primvars */

static void put_value(struct put *put, const struct point_field *field, double value)
{
    if (field->is_integer)
        put_format(put, "%.0f", value);
    else if (value != value)
        put_text(put, "nan");
    else if (value - value != 0)
        put_text(put, value > 0 ? "inf" : "-inf");
    else
        put_format(put, "%.*g", field->type == TETLOD_FLOAT32 ? 9 : 17, value);
}

static void put_primvar(struct put *put, const struct tetmesh *mesh, uint32_t number)
{
    const bool of_cells = number >= mesh->field_count;
    const struct point_field *field = of_cells ? &mesh->cell_fields[number - mesh->field_count]
                                               : &mesh->fields[number];
    const size_t rows = of_cells ? mesh->tet_count : mesh->vertex_count, width = field->components;
    const bool is_tuple = !field->is_integer && width > 1 && width <= 4;
    char word[NAME];
    find_word(mesh, number, word);
    put_format(put, "    %s", field->is_integer ? "int64" : field->type == TETLOD_FLOAT32 ? "float" : "double");
    if (is_tuple)
        put_format(put, "%zu", width);
    put_text(put, "[] primvars:");
    put_text(put, word);
    put_text(put, " = [");
    for (size_t i = 0; i < rows * width; i++) {
        const bool first = i % width == 0;
        put_text(put, is_tuple && !first ? ", " : between(is_tuple ? i / width : i));
        put_text(put, is_tuple && first ? "(" : "");
        put_value(put, field, field->values[i]);
        put_text(put, is_tuple && i % width == width - 1 ? ")" : "");
    }
    put_text(put, "] (\n        displayName = ");
    put_quoted(put, field->name);
    if (!is_tuple && width > 1)
        put_format(put, "\n        elementSize = %zu", width);
    put_format(put, "\n        interpolation = \"%s\"\n    )\n", of_cells ? "uniform" : "vertex");
}

enum tetlod_status usda_write(const struct tetmesh *mesh, const struct tetlodi_sink *sink, struct tetlod_error *error)
{
    struct put put;
    uint32_t *neighbours = array_new((size_t)mesh->tet_count * 4, sizeof *neighbours);
    enum tetlod_status status =
        neighbours ? adjacency_build(mesh->corners, mesh->tet_count, mesh->vertex_count, neighbours, NULL, error)
                   : tetlodi_fail_nomem(error, "the boundary", mesh->tet_count * (uint64_t)16);
    if (status == TETLOD_OK)
        status = put_init(&put, sink, false, error);
    if (status == TETLOD_OK) {
        put_head(&put, mesh);
        put_extent(&put, mesh);
        put_corners(&put, mesh);
        put_surface(&put, mesh, neighbours);
        put_points(&put, mesh);
        for (uint32_t i = 0; i < mesh->field_count + mesh->cell_field_count; i++)
            put_primvar(&put, mesh, i);
        put_text(&put, "}\n");
        status = put_finish(&put);
    }
    free(neighbours);
    return status;
}
