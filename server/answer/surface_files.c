/* SPDX-License-Identifier: BSD-3-Clause */
#include "server/answer/surface_files.h"

#include <ctype.h>
#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "format/fail.h"

/* Little-endian stores: both formats and every machine we build for agree, but the bytes are spelled out all the same. */
static void store32(unsigned char *out, uint32_t word)
{
    for (int b = 0; b < 4; b++)
        out[b] = (unsigned char)(word >> 8 * b);
}

static void store64(unsigned char *out, uint64_t word)
{
    store32(out, (uint32_t)word);
    store32(out + 4, (uint32_t)(word >> 32));
}

static void store_float(unsigned char *out, double value)
{
    float narrow = (float)value;
    uint32_t word;
    memcpy(&word, &narrow, 4);
    store32(out, word);
}

static void store_double(unsigned char *out, double value)
{
    uint64_t word;
    memcpy(&word, &value, 8);
    store64(out, word);
}

/* An array of the mesh, interpolated at the surface's vertices. */
static enum tetlod_status put_values(const struct cut *surface, const double *values, uint32_t components, bool narrow,
                                     struct buffer *out)
{
    size_t width = narrow ? 4 : 8;
    unsigned char *at = buffer_extend(out, (size_t)surface->vertex_count * components * width);
    if (!at)
        return TETLOD_ERR_NOMEM;
    for (uint32_t v = 0; v < surface->vertex_count; v++)
        for (uint32_t c = 0; c < components; c++, at += width) {
            double value = cut_value(surface, v, values, components, c);
            if (narrow)
                store_float(at, value);
            else
                store_double(at, value);
        }
    return TETLOD_OK;
}

static enum tetlod_status put_triangles(const struct cut *surface, struct buffer *out)
{
    unsigned char *at = buffer_extend(out, (size_t)surface->triangle_count * 12);
    if (!at)
        return TETLOD_ERR_NOMEM;
    for (size_t i = 0; i < (size_t)surface->triangle_count * 3; i++)
        store32(at + 4 * i, surface->triangles[i]);
    return TETLOD_OK;
}

/* ---- VTP ---- */

/* An array's element; `offset` moves on past its bytes and their count. */
static enum tetlod_status put_element(struct buffer *out, const char *type, const char *name, uint32_t components,
                                      uint64_t bytes, uint64_t *offset)
{
    TETLOD_TRY(buffer_printf(out, "<DataArray type=\"%s\" Name=\"", type));
    TETLOD_TRY(buffer_append_escaped(out, name));
    TETLOD_TRY(buffer_printf(out, "\" NumberOfComponents=\"%" PRIu32 "\" format=\"appended\" offset=\"%" PRIu64 "\"/>\n",
                             components, *offset));
    *offset += 8 + bytes;
    return TETLOD_OK;
}

static enum tetlod_status put_count(struct buffer *out, uint64_t bytes)
{
    unsigned char *at = buffer_extend(out, 8);
    if (!at)
        return TETLOD_ERR_NOMEM;
    store64(at, bytes);
    return TETLOD_OK;
}

static uint64_t field_bytes(const struct cut *surface, const struct point_field *field)
{
    return (uint64_t)surface->vertex_count * field->components * (field->type == TETLOD_FLOAT32 ? 4 : 8);
}

static enum tetlod_status put_vtp_head(const struct tetmesh *mesh, const struct cut *surface, struct buffer *out)
{
    uint64_t offset = 0;
    TETLOD_TRY(buffer_printf(out,
                             "<?xml version=\"1.0\"?>\n<VTKFile type=\"PolyData\" version=\"1.0\" byte_order=\"LittleEndian\" "
                             "header_type=\"UInt64\">\n<PolyData>\n<Piece NumberOfPoints=\"%" PRIu32
                             "\" NumberOfPolys=\"%" PRIu32 "\">\n<PointData>\n",
                             surface->vertex_count, surface->triangle_count));
    for (uint32_t f = 0; f < mesh->field_count; f++) {
        const struct point_field *field = &mesh->fields[f];
        TETLOD_TRY(put_element(out, field->type == TETLOD_FLOAT32 ? "Float32" : "Float64", field->name, field->components,
                               field_bytes(surface, field), &offset));
    }
    TETLOD_TRY(buffer_printf(out, "</PointData>\n<Points>\n"));
    TETLOD_TRY(put_element(out, "Float64", "Points", 3, (uint64_t)surface->vertex_count * 24, &offset));
    TETLOD_TRY(buffer_printf(out, "</Points>\n<Polys>\n"));
    TETLOD_TRY(put_element(out, "Int32", "connectivity", 1, (uint64_t)surface->triangle_count * 12, &offset));
    TETLOD_TRY(put_element(out, "Int32", "offsets", 1, (uint64_t)surface->triangle_count * 4, &offset));
    return buffer_printf(out, "</Polys>\n</Piece>\n</PolyData>\n<AppendedData encoding=\"raw\">\n_");
}

static enum tetlod_status write_vtp(const struct tetmesh *mesh, const struct cut *surface, struct buffer *out)
{
    if (surface->triangle_count > INT32_MAX / 3)
        return TETLOD_ERR_LIMIT; // its offsets are Int32
    TETLOD_TRY(put_vtp_head(mesh, surface, out));
    for (uint32_t f = 0; f < mesh->field_count; f++) {
        const struct point_field *field = &mesh->fields[f];
        TETLOD_TRY(put_count(out, field_bytes(surface, field)));
        TETLOD_TRY(put_values(surface, field->values, field->components, field->type == TETLOD_FLOAT32, out));
    }
    TETLOD_TRY(put_count(out, (uint64_t)surface->vertex_count * 24));
    TETLOD_TRY(put_values(surface, mesh->positions, 3, false, out));
    TETLOD_TRY(put_count(out, (uint64_t)surface->triangle_count * 12));
    TETLOD_TRY(put_triangles(surface, out));
    TETLOD_TRY(put_count(out, (uint64_t)surface->triangle_count * 4));
    unsigned char *at = buffer_extend(out, (size_t)surface->triangle_count * 4);
    if (!at)
        return TETLOD_ERR_NOMEM;
    for (uint32_t t = 0; t < surface->triangle_count; t++)
        store32(at + 4 * (size_t)t, 3 * (t + 1));
    return buffer_printf(out, "\n</AppendedData>\n</VTKFile>\n");
}

/* ---- STL: 80 bytes of title, a count, and per triangle normal, corners and two bytes of nothing ---- */

static enum tetlod_status write_stl(const struct tetmesh *mesh, const struct cut *surface, struct buffer *out)
{
    enum { HEAD = 84, TRIANGLE = 50 };
    unsigned char *at = buffer_extend(out, HEAD + (size_t)surface->triangle_count * TRIANGLE);
    if (!at)
        return TETLOD_ERR_NOMEM;
    memset(at, 0, HEAD);
    memcpy(at, "tetlod surface", 14);
    store32(at + 80, surface->triangle_count);
    at += HEAD;
    for (size_t t = 0; t < surface->triangle_count; t++, at += TRIANGLE) {
        double p[3][3], n[3], length = 0;
        for (size_t c = 0; c < 3; c++)
            for (uint32_t axis = 0; axis < 3; axis++) {
                p[c][axis] = cut_value(surface, surface->triangles[3 * t + c], mesh->positions, 3, axis);
                store_float(at + 12 + 12 * c + 4 * axis, p[c][axis]);
            }
        for (int axis = 0; axis < 3; axis++) {
            int i = (axis + 1) % 3, j = (axis + 2) % 3;
            n[axis] = (p[1][i] - p[0][i]) * (p[2][j] - p[0][j]) - (p[1][j] - p[0][j]) * (p[2][i] - p[0][i]);
            length += n[axis] * n[axis];
        }
        for (int axis = 0; axis < 3; axis++)
            store_float(at + 4 * axis, length > 0 ? n[axis] / sqrt(length) : 0);
        at[48] = at[49] = 0;
    }
    return TETLOD_OK;
}

/* ---- glTF: one mesh; fields are application-specific attributes, whose names start with '_' ---- */

static const char *const gltf_types[] = {"", "SCALAR", "VEC2", "VEC3", "VEC4"};

/* An attribute's name out of a field's: letters, digits and '_'. The field's own name stands in the extras. */
static void gltf_name(const char *field, uint32_t index, char *out, size_t capacity)
{
    size_t used = 1;
    out[0] = '_';
    for (; *field && used + 12 < capacity; field++)
        out[used++] = isalnum((unsigned char)*field) ? (char)toupper((unsigned char)*field) : '_';
    snprintf(out + used, capacity - used, "_%" PRIu32, index); // two names may become the same one
}

static enum tetlod_status put_json_text(struct buffer *out, const char *text)
{
    for (; *text; text++) {
        unsigned char c = (unsigned char)*text;
        if (c == '"' || c == '\\' || c < 0x20)
            TETLOD_TRY(buffer_printf(out, "\\u%04x", c));
        else
            TETLOD_TRY(buffer_append(out, text, 1));
    }
    return TETLOD_OK;
}

static void position_range(const struct tetmesh *mesh, const struct cut *surface, float least[3], float most[3])
{
    for (uint32_t axis = 0; axis < 3; axis++) {
        least[axis] = HUGE_VALF;
        most[axis] = -HUGE_VALF;
        for (uint32_t v = 0; v < surface->vertex_count; v++) {
            float value = (float)cut_value(surface, v, mesh->positions, 3, axis);
            least[axis] = value < least[axis] ? value : least[axis];
            most[axis] = value > most[axis] ? value : most[axis];
        }
    }
}

static bool gltf_has(const struct point_field *field)
{
    return field->components >= 1 && field->components <= 4;
}

static enum tetlod_status put_gltf_views(const struct tetmesh *mesh, const struct cut *surface, uint64_t *out_size,
                                         struct buffer *out)
{
    uint64_t triangles = (uint64_t)surface->triangle_count * 12, positions = (uint64_t)surface->vertex_count * 12;
    uint64_t offset = triangles + positions;
    TETLOD_TRY(buffer_printf(out,
                             "\"bufferViews\":[{\"buffer\":0,\"byteOffset\":0,\"byteLength\":%" PRIu64
                             ",\"target\":34963},{\"buffer\":0,\"byteOffset\":%" PRIu64 ",\"byteLength\":%" PRIu64
                             ",\"target\":34962}",
                             triangles, triangles, positions));
    for (uint32_t f = 0; f < mesh->field_count; f++)
        if (gltf_has(&mesh->fields[f])) {
            uint64_t size = (uint64_t)surface->vertex_count * mesh->fields[f].components * 4;
            TETLOD_TRY(buffer_printf(out, ",{\"buffer\":0,\"byteOffset\":%" PRIu64 ",\"byteLength\":%" PRIu64 ",\"target\":34962}",
                                     offset, size));
            offset += size;
        }
    *out_size = offset;
    return buffer_printf(out, "]");
}

static enum tetlod_status put_gltf_accessors(const struct tetmesh *mesh, const struct cut *surface, struct buffer *out)
{
    float least[3], most[3];
    unsigned view = 2;
    position_range(mesh, surface, least, most);
    TETLOD_TRY(buffer_printf(out,
                             ",\"accessors\":[{\"bufferView\":0,\"componentType\":5125,\"count\":%" PRIu64
                             ",\"type\":\"SCALAR\"},{\"bufferView\":1,\"componentType\":5126,\"count\":%" PRIu32
                             ",\"type\":\"VEC3\",\"min\":[%.9g,%.9g,%.9g],\"max\":[%.9g,%.9g,%.9g]}",
                             3 * (uint64_t)surface->triangle_count, surface->vertex_count, (double)least[0], (double)least[1],
                             (double)least[2], (double)most[0], (double)most[1], (double)most[2]));
    for (uint32_t f = 0; f < mesh->field_count; f++)
        if (gltf_has(&mesh->fields[f]))
            TETLOD_TRY(buffer_printf(out, ",{\"bufferView\":%u,\"componentType\":5126,\"count\":%" PRIu32 ",\"type\":\"%s\"}",
                                     view++, surface->vertex_count, gltf_types[mesh->fields[f].components]));
    return buffer_printf(out, "]");
}

static enum tetlod_status put_gltf_mesh(const struct tetmesh *mesh, struct buffer *out)
{
    unsigned accessor = 2;
    const char *separator = "";
    char name[80];
    TETLOD_TRY(buffer_printf(out, ",\"meshes\":[{\"primitives\":[{\"mode\":4,\"indices\":0,\"material\":0,\"attributes\":{\"POSITION\":1"));
    for (uint32_t f = 0; f < mesh->field_count; f++)
        if (gltf_has(&mesh->fields[f])) {
            gltf_name(mesh->fields[f].name, f, name, sizeof name);
            TETLOD_TRY(buffer_printf(out, ",\"%s\":%u", name, accessor++));
        }
    TETLOD_TRY(buffer_printf(out, "}}],\"extras\":{\"fields\":{"));
    for (uint32_t f = 0; f < mesh->field_count; f++)
        if (gltf_has(&mesh->fields[f])) {
            gltf_name(mesh->fields[f].name, f, name, sizeof name);
            TETLOD_TRY(buffer_printf(out, "%s\"%s\":\"", separator, name));
            TETLOD_TRY(put_json_text(out, mesh->fields[f].name));
            TETLOD_TRY(buffer_append(out, "\"", 1));
            separator = ",";
        }
    return buffer_printf(out, "}}}]");
}

/* The parts that only a surface with triangles has: glTF allows no empty buffers. */
static enum tetlod_status put_gltf_json(const struct tetmesh *mesh, const struct cut *surface, struct buffer *out)
{
    uint64_t size;
    TETLOD_TRY(buffer_printf(out, "{\"asset\":{\"version\":\"2.0\",\"generator\":\"tetlod " TETLOD_VERSION_STRING "\"},\"scene\":0,"));
    if (!surface->triangle_count)
        return buffer_printf(out, "\"scenes\":[{}]}");
    TETLOD_TRY(buffer_printf(out, "\"scenes\":[{\"nodes\":[0]}],\"nodes\":[{\"mesh\":0}],\"materials\":[{\"doubleSided\":true}],"));
    TETLOD_TRY(put_gltf_views(mesh, surface, &size, out));
    TETLOD_TRY(put_gltf_accessors(mesh, surface, out));
    TETLOD_TRY(put_gltf_mesh(mesh, out));
    return buffer_printf(out, ",\"buffers\":[{\"byteLength\":%" PRIu64 "}]}", size);
}

static enum tetlod_status put_chunk_head(struct buffer *out, uint32_t size, const char *type)
{
    unsigned char *at = buffer_extend(out, 8);
    if (!at)
        return TETLOD_ERR_NOMEM;
    store32(at, size);
    memcpy(at + 4, type, 4);
    return TETLOD_OK;
}

static enum tetlod_status write_glb(const struct tetmesh *mesh, const struct cut *surface, struct buffer *out)
{
    TETLOD_TRY(buffer_append(out, "glTF\2\0\0\0\0\0\0\0", 12));
    TETLOD_TRY(put_chunk_head(out, 0, "JSON"));
    size_t start = out->size;
    TETLOD_TRY(put_gltf_json(mesh, surface, out));
    TETLOD_TRY(buffer_append(out, "   ", -out->size & 3));
    store32(out->bytes + start - 8, (uint32_t)(out->size - start));
    if (surface->triangle_count) {
        TETLOD_TRY(put_chunk_head(out, 0, "BIN\0"));
        start = out->size;
        TETLOD_TRY(put_triangles(surface, out));
        TETLOD_TRY(put_values(surface, mesh->positions, 3, true, out));
        for (uint32_t f = 0; f < mesh->field_count; f++)
            if (gltf_has(&mesh->fields[f]))
                TETLOD_TRY(put_values(surface, mesh->fields[f].values, mesh->fields[f].components, true, out));
        if (out->size > UINT32_MAX)
            return TETLOD_ERR_LIMIT; // glTF's lengths have 32 bits
        store32(out->bytes + start - 8, (uint32_t)(out->size - start));
    }
    store32(out->bytes + 8, (uint32_t)out->size);
    return TETLOD_OK;
}

const struct surface_format surface_formats[] = {
    {"vtp", "application/vnd.vtk.vtp", write_vtp},
    {"stl", "model/stl", write_stl},
    {"glb", "model/gltf-binary", write_glb},
    {NULL, NULL, NULL},
};
