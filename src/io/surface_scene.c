/* SPDX-License-Identifier: BSD-3-Clause */
/* Writing the boundary of a mesh as VTP (raw appended data, all fields) and GLB (glTF 2.0: positions, fields as attributes _NAME,
 * and colours of the first scalar field). Both little-endian; every array's size is known before it is written. */
#include <ctype.h>
#include <inttypes.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "format/fail.h"
#include "src/io/formats.h"
#include "src/io/boundary_surface.h"
#include "src/util/array.h"
#include "src/util/put.h"

static uint64_t width_of(enum tetlod_type type)
{
    return type == TETLOD_FLOAT32 ? 4 : 8;
}

/* Rows of the points that the surface has. */
static void put_rows(struct put *put, const struct boundary_surface *surface, uint32_t vertex_count, const double *values, uint32_t width,
                     enum tetlod_type type)
{
    for (uint32_t v = 0; v < vertex_count; v++)
        for (uint32_t c = 0; c < width && surface->numbers[v] != TETLOD_NONE; c++)
            put_double(put, values[(size_t)v * width + c], type);
}

static void put_triangles(struct put *put, const struct boundary_surface *surface)
{
    for (uint32_t t = 0; t < surface->count; t++)
        for (int i = 0; i < 3; i++)
            put_word(put, surface->numbers[surface->triangles[t][i]], 4);
}

/* ---- VTP */

static void put_array(struct put *put, const char *type, const char *name, uint32_t components, uint64_t bytes, const char *unit,
                      uint64_t *offset)
{
    put_format(put, "<DataArray type=\"%s\" NumberOfComponents=\"%" PRIu32 "\" format=\"appended\" offset=\"%" PRIu64 "\" Name=\"",
               type, components, *offset);
    put_escaped(put, name);
    put_text(put, "\">");
    if (*unit) {
        put_text(put, VTK_XML_UNIT);
        put_escaped(put, unit);
        put_text(put, VTK_XML_UNIT_END);
    }
    put_text(put, "</DataArray>\n");
    *offset += 8 + bytes;
}

static void put_vtp_head(struct put *put, const struct tetmesh *mesh, const struct boundary_surface *surface)
{
    static const char *const types[] = {[TETLOD_FLOAT32] = "Float32", [TETLOD_FLOAT64] = "Float64"};
    uint64_t offset = 0, points = surface->point_count;
    put_text(put, "<?xml version=\"1.0\"?>\n<VTKFile type=\"PolyData\" version=\"1.0\" byte_order=\"LittleEndian\" header_type=\"UInt64\">\n");
    put_format(put, "<PolyData><Piece NumberOfPoints=\"%" PRIu64 "\" NumberOfVerts=\"0\" NumberOfLines=\"0\" NumberOfStrips=\"0\" "
                    "NumberOfPolys=\"%" PRIu32 "\">\n<PointData>\n", points, surface->count);
    for (uint32_t f = 0; f < mesh->field_count; f++) {
        const struct point_field *field = &mesh->fields[f];
        put_array(put, types[field->type], field->name, field->components, points * field->components * width_of(field->type), field->unit,
                  &offset);
    }
    put_text(put, "</PointData>\n<Points>\n");
    put_array(put, types[mesh->position_type], "Points", 3, points * 3 * width_of(mesh->position_type), "", &offset);
    put_text(put, "</Points>\n<Polys>\n");
    put_array(put, "Int32", "connectivity", 1, 12 * (uint64_t)surface->count, "", &offset);
    put_array(put, "Int32", "offsets", 1, 4 * (uint64_t)surface->count, "", &offset);
    put_text(put, "</Polys>\n</Piece></PolyData>\n<AppendedData encoding=\"raw\">\n_");
}

enum tetlod_status vtp_write(const struct tetmesh *mesh, const struct tetlodi_sink *sink, struct tetlod_error *error)
{
    struct boundary_surface surface;
    struct put put;
    TETLOD_TRY(put_init(&put, sink, false, error));
    enum tetlod_status status = boundary_surface_find(mesh, &surface, error);
    uint64_t points = surface.point_count;
    if (status == TETLOD_OK) {
        put_vtp_head(&put, mesh, &surface);
        for (uint32_t f = 0; f < mesh->field_count; f++) {
            const struct point_field *field = &mesh->fields[f];
            put_word(&put, points * field->components * width_of(field->type), 8);
            put_rows(&put, &surface, mesh->vertex_count, field->values, field->components, field->type);
        }
        put_word(&put, points * 3 * width_of(mesh->position_type), 8);
        put_rows(&put, &surface, mesh->vertex_count, mesh->positions, 3, mesh->position_type);
        put_word(&put, 12 * (uint64_t)surface.count, 8);
        put_triangles(&put, &surface);
        put_word(&put, 4 * (uint64_t)surface.count, 8);
        for (uint32_t t = 0; t < surface.count; t++)
            put_word(&put, 3 * ((uint64_t)t + 1), 4);
        put_text(&put, "\n</AppendedData></VTKFile>\n");
    }
    boundary_surface_fini(&surface);
    enum tetlod_status written = put_finish(&put);
    return status != TETLOD_OK ? status : written;
}

/* ---- GLB */

/* JSON is made twice: once to know its length. */
struct json {
    char *text; /* owned */
    size_t length, capacity;
};

static void add_text(struct json *json, const char *format, ...) __attribute__((format(printf, 2, 3)));

static void add_text(struct json *json, const char *format, ...)
{
    va_list arguments;
    va_start(arguments, format);
    int length = vsnprintf(json->text ? json->text + json->length : NULL, json->text ? json->capacity - json->length : 0, format, arguments);
    va_end(arguments);
    json->length += length > 0 ? (size_t)length : 0;
}

static bool has_attribute(const struct point_field *field)
{
    return field->components <= 4;
}

static void add_view(struct json *json, uint64_t *offset, uint64_t size, int target)
{
    add_text(json, "%s{\"buffer\":0,\"byteOffset\":%" PRIu64 ",\"byteLength\":%" PRIu64 ",\"target\":%d}", *offset ? "," : "", *offset,
             size, target);
    *offset += size;
}

/* Application-specific names start with '_'; capital letters, figures and '_' are safe anywhere. */
static void add_name(struct json *json, const char *name)
{
    add_text(json, ",\"_");
    for (; *name; name++)
        add_text(json, "%c", isalnum((unsigned char)*name) && (unsigned char)*name < 128 ? toupper((unsigned char)*name) : '_');
    add_text(json, "\":");
}

static void make_json(struct json *json, const struct tetmesh *mesh, const struct boundary_surface *surface, const double bounds[6])
{
    static const char *const kinds[] = {"SCALAR", "VEC2", "VEC3", "VEC4"};
    uint64_t points = surface->point_count, offset = 0;
    uint32_t accessor = 3;
    add_text(json, "{\"asset\":{\"version\":\"2.0\",\"generator\":\"tetlod\"},\"scene\":0,\"scenes\":[{\"nodes\":[0]}],\"nodes\":[{\"mesh\":0}],"
                   "\"materials\":[{\"doubleSided\":true,\"pbrMetallicRoughness\":{\"metallicFactor\":0,\"roughnessFactor\":0.8}}],"
                   "\"meshes\":[{\"primitives\":[{\"mode\":4,\"material\":0,\"indices\":0,\"attributes\":{\"POSITION\":1,\"COLOR_0\":2");
    for (uint32_t f = 0; f < mesh->field_count; f++)
        if (has_attribute(&mesh->fields[f])) {
            add_name(json, mesh->fields[f].name);
            add_text(json, "%" PRIu32, accessor++);
        }
    add_text(json, "}}]}],\"bufferViews\":[");
    add_view(json, &offset, 12 * (uint64_t)surface->count, 34963);
    add_view(json, &offset, 12 * points, 34962);
    add_view(json, &offset, 4 * points, 34962);
    for (uint32_t f = 0; f < mesh->field_count; f++)
        if (has_attribute(&mesh->fields[f]))
            add_view(json, &offset, 4 * points * mesh->fields[f].components, 34962);
    add_text(json, "],\"accessors\":[{\"bufferView\":0,\"componentType\":5125,\"count\":%" PRIu64 ",\"type\":\"SCALAR\"}", 3 * (uint64_t)surface->count);
    add_text(json, ",{\"bufferView\":1,\"componentType\":5126,\"count\":%" PRIu64 ",\"type\":\"VEC3\",\"min\":[%.9g,%.9g,%.9g],\"max\":[%.9g,%.9g,%.9g]}",
             points, bounds[0], bounds[1], bounds[2], bounds[3], bounds[4], bounds[5]);
    add_text(json, ",{\"bufferView\":2,\"componentType\":5121,\"normalized\":true,\"count\":%" PRIu64 ",\"type\":\"VEC4\"}", points);
    accessor = 3;
    for (uint32_t f = 0; f < mesh->field_count; f++)
        if (has_attribute(&mesh->fields[f]))
            add_text(json, ",{\"bufferView\":%" PRIu32 ",\"componentType\":5126,\"count\":%" PRIu64 ",\"type\":\"%s\"}", accessor++, points,
                     kinds[mesh->fields[f].components - 1]);
    add_text(json, "],\"buffers\":[{\"byteLength\":%" PRIu64 "}]}", offset);
}

static uint64_t binary_size(const struct tetmesh *mesh, const struct boundary_surface *surface)
{
    uint64_t size = 12 * (uint64_t)surface->count + 16 * (uint64_t)surface->point_count;
    for (uint32_t f = 0; f < mesh->field_count; f++)
        size += has_attribute(&mesh->fields[f]) ? 4 * (uint64_t)surface->point_count * mesh->fields[f].components : 0;
    return size;
}

static void find_bounds(const struct tetmesh *mesh, const struct boundary_surface *surface, double bounds[6])
{
    bool first = true;
    for (uint32_t v = 0; v < mesh->vertex_count; v++) {
        if (surface->numbers[v] == TETLOD_NONE)
            continue;
        for (int d = 0; d < 3; d++) {
            double value = (double)(float)mesh->positions[3 * (size_t)v + (size_t)d];
            bounds[d] = first || value < bounds[d] ? value : bounds[d];
            bounds[3 + d] = first || value > bounds[3 + d] ? value : bounds[3 + d];
        }
        first = false;
    }
}

/* From blue by white to red over the range of the first scalar field; grey if there is none. */
static void put_colours(struct put *put, const struct tetmesh *mesh, const struct boundary_surface *surface)
{
    const struct point_field *field = NULL;
    double range[2] = {0, 0};
    for (uint32_t f = 0; f < mesh->field_count && !field; f++)
        field = mesh->fields[f].components == 1 ? &mesh->fields[f] : NULL;
    if (field)
        point_field_range(field, mesh->vertex_count, range);
    for (uint32_t v = 0; v < mesh->vertex_count; v++) {
        if (surface->numbers[v] == TETLOD_NONE)
            continue;
        double at = range[1] > range[0] ? (field->values[v] - range[0]) / (range[1] - range[0]) : 0.5;
        double low = at < 0.5 ? 2 * at : 1, high = at > 0.5 ? 2 - 2 * at : 1;
        put_word(put, (uint64_t)(230 * low), 1);
        put_word(put, (uint64_t)(230 * (low < high ? low : high)), 1);
        put_word(put, (uint64_t)(230 * high), 1);
        put_word(put, 255, 1);
    }
}

static void put_glb(struct put *put, const struct tetmesh *mesh, const struct boundary_surface *surface, const struct json *json, uint64_t binary)
{
    size_t padded = (json->length + 3) & ~(size_t)3;
    put_text(put, "glTF");
    put_word(put, 2, 4);
    put_word(put, 12 + 8 + padded + 8 + binary, 4);
    put_word(put, padded, 4);
    put_text(put, "JSON");
    put_text(put, json->text);
    for (size_t i = json->length; i < padded; i++)
        put_word(put, ' ', 1);
    put_word(put, binary, 4);
    put_word(put, 0x004e4942, 4); // "BIN" and a zero
    put_triangles(put, surface);
    put_rows(put, surface, mesh->vertex_count, mesh->positions, 3, TETLOD_FLOAT32);
    put_colours(put, mesh, surface);
    for (uint32_t f = 0; f < mesh->field_count; f++)
        if (has_attribute(&mesh->fields[f]))
            put_rows(put, surface, mesh->vertex_count, mesh->fields[f].values, mesh->fields[f].components, TETLOD_FLOAT32);
}

enum tetlod_status glb_write(const struct tetmesh *mesh, const struct tetlodi_sink *sink, struct tetlod_error *error)
{
    struct boundary_surface surface;
    struct put put;
    struct json json = {0};
    double bounds[6] = {0};
    TETLOD_TRY(put_init(&put, sink, false, error));
    enum tetlod_status status = boundary_surface_find(mesh, &surface, error);
    uint64_t binary = status == TETLOD_OK ? binary_size(mesh, &surface) : 0;
    if (status == TETLOD_OK && binary > UINT32_MAX - (1 << 20))
        status = tetlodi_fail(error, TETLOD_ERR_LIMIT, "a GLB file holds at most 4 GB; write .vtp");
    if (status == TETLOD_OK) {
        find_bounds(mesh, &surface, bounds);
        make_json(&json, mesh, &surface, bounds);
        json = (struct json){array_new(json.length + 1, 1), 0, json.length + 1};
        status = json.text ? TETLOD_OK : tetlodi_fail_nomem(error, "the JSON", json.capacity);
    }
    if (status == TETLOD_OK) {
        make_json(&json, mesh, &surface, bounds);
        put_glb(&put, mesh, &surface, &json, binary);
    }
    free(json.text);
    boundary_surface_fini(&surface);
    enum tetlod_status written = put_finish(&put);
    return status != TETLOD_OK ? status : written;
}
