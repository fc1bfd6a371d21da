/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * Writing surfaces as binary glTF 2.0: one mesh with positions, the colours of the first scalar field, and the fields
 * as attributes. The JSON names the length of every array and comes first; it is put twice, at first only to know its
 * own length.
 */
#include <ctype.h>
#include <float.h>
#include <inttypes.h>
#include <math.h>

#include "format/fail.h"
#include "src/cut/cut.h"
#include "src/io/writers/writers.h"
#include "src/mesh/ids.h"
#include "src/util/put.h"

static bool has_attribute(const struct point_field *field)
{
    return field->components <= 4;
}

/* What a buffer view is for: OpenGL's numbers. */
enum { CORNERS = 34963, VERTICES = 34962 };

static void put_view(struct put *put, uint64_t *offset, uint64_t size, int target)
{
    put_format(put, "%s{\"buffer\":0,\"byteOffset\":%" PRIu64 ",\"byteLength\":%" PRIu64 ",\"target\":%d}",
               *offset ? "," : "", *offset,
               size, target);
    *offset += size;
}

/* One a buffer, in the order of put_buffer. Returns what they take in all. */
static uint64_t put_views(struct put *put, const struct tetmesh *mesh, const struct cut *surface)
{
    uint64_t offset = 0, vertices = surface->vertex_count;
    put_text(put, "\"bufferViews\":[");
    put_view(put, &offset, 12 * (uint64_t)surface->triangle_count, CORNERS);
    put_view(put, &offset, 12 * vertices, VERTICES);
    put_view(put, &offset, 4 * vertices, VERTICES);
    for (uint32_t f = 0; f < mesh->field_count; f++)
        if (has_attribute(&mesh->fields[f]))
            put_view(put, &offset, 4 * vertices * mesh->fields[f].components, VERTICES);
    put_text(put, "]");
    return offset;
}

static void put_accessors(struct put *put, const struct tetmesh *mesh, const struct cut *surface)
{
    static const char *const types[] = {"", "SCALAR", "VEC2", "VEC3", "VEC4"};
    float least[3] = {HUGE_VALF, HUGE_VALF, HUGE_VALF}, most[3] = {-HUGE_VALF, -HUGE_VALF, -HUGE_VALF};
    uint32_t view = 3, vertices = surface->vertex_count;
    for (uint32_t v = 0; v < vertices; v++)
        for (uint32_t d = 0; d < 3; d++) {
            float value = (float)cut_value(surface, v, mesh->positions, 3, d);
            least[d] = value < least[d] ? value : least[d];
            most[d] = value > most[d] ? value : most[d];
        }
    put_format(put,
               ",\"accessors\":[{\"bufferView\":0,\"componentType\":5125,\"count\":%" PRIu64 ",\"type\":\"SCALAR\"}",
               3 * (uint64_t)surface->triangle_count);
    put_format(put, ",{\"bufferView\":1,\"componentType\":5126,\"count\":%" PRIu32 ",\"type\":\"VEC3\"", vertices);
    put_format(put, ",\"min\":[%.9g,%.9g,%.9g]", (double)least[0], (double)least[1], (double)least[2]);
    put_format(put, ",\"max\":[%.9g,%.9g,%.9g]}", (double)most[0], (double)most[1], (double)most[2]);
    put_format(put,
               ",{\"bufferView\":2,\"componentType\":5121,\"normalized\":true,\"count\":%" PRIu32 ",\"type\":\"VEC4\"}",
               vertices);
    for (uint32_t f = 0; f < mesh->field_count; f++)
        if (has_attribute(&mesh->fields[f]))
            put_format(put,
                       ",{\"bufferView\":%" PRIu32 ",\"componentType\":5126,\"count\":%" PRIu32 ",\"type\":\"%s\"}",
                       view++, vertices, types[mesh->fields[f].components]);
    put_text(put, "]");
}

/* The name of a field's attribute: application-specific ones start with '_', letters, digits and '_' are safe anywhere,
 * and the number keeps two of them apart. */
static void put_name(struct put *put, const struct tetmesh *mesh, uint32_t field)
{
    put_text(put, "\"_");
    for (const char *c = mesh->fields[field].name; *c; c++)
        put_word(put, (unsigned char)*c < 128 &&
                 isalnum((unsigned char)*c) ? (uint64_t)toupper((unsigned char)*c) : '_', 1);
    put_format(put, "_%" PRIu32 "\":", field);
}

static void put_json_text(struct put *put, const char *text)
{
    for (; *text; text++)
        if (*text == '"' || *text == '\\' || (unsigned char)*text < 0x20)
            put_format(put, "\\u%04x", (unsigned)*text);
        else
            put_word(put, (unsigned char)*text, 1);
}

/* The extras say which field an attribute is. */
static void put_mesh(struct put *put, const struct tetmesh *mesh)
{
    const char *separator = "";
    uint32_t accessor = 3;
    put_text(put, ",\"meshes\":[{\"primitives\":[{\"mode\":4,\"indices\":0,\"material\":0,\"attributes\":{\"POSITION\":"
                  "1,\"COLOR_0\":2");
    for (uint32_t f = 0; f < mesh->field_count; f++)
        if (has_attribute(&mesh->fields[f])) {
            put_text(put, ",");
            put_name(put, mesh, f);
            put_format(put, "%" PRIu32, accessor++);
        }
    put_text(put, "}}],\"extras\":{\"fields\":{");
    for (uint32_t f = 0; f < mesh->field_count; f++)
        if (has_attribute(&mesh->fields[f])) {
            put_text(put, separator);
            put_name(put, mesh, f);
            put_text(put, "\"");
            put_json_text(put, mesh->fields[f].name);
            put_text(put, "\"");
            separator = ",";
        }
    put_text(put, "}}}]");
}

/* Returns how many bytes of arrays it names. A surface without triangles has none: glTF allows no empty buffers. */
static uint64_t put_json(struct put *put, const struct tetmesh *mesh, const struct cut *surface)
{
    put_text(put, "{\"asset\":{\"version\":\"2.0\",\"generator\":\"tetlod\"},\"scene\":0,");
    if (!surface->triangle_count) {
        put_text(put, "\"scenes\":[{}]}");
        return 0;
    }
    put_text(put, "\"scenes\":[{\"nodes\":[0]}],\"nodes\":[{\"mesh\":0}],"
                  "\"materials\":[{\"doubleSided\":true,\"pbrMetallicRoughness\":{\"metallicFactor\":0,"
                  "\"roughnessFactor\":0.8}}],");
    uint64_t size = put_views(put, mesh, surface);
    put_accessors(put, mesh, surface);
    put_mesh(put, mesh);
    put_format(put, ",\"buffers\":[{\"byteLength\":%" PRIu64 "}]}", size);
    return size;
}

static enum tetlod_status count_bytes(void *opaque, const void *bytes, size_t size)
{
    (void)bytes;
    *(uint64_t *)opaque += size;
    return TETLOD_OK;
}

static enum tetlod_status measure_json(const struct tetmesh *mesh, const struct cut *surface, uint64_t *json,
                                       uint64_t *arrays,
                                       struct tetlod_error *error)
{
    struct tetlodi_sink counter = {count_bytes, json};
    struct put put;
    *json = 0;
    TETLOD_TRY(put_init(&put, &counter, false, error));
    *arrays = put_json(&put, mesh, surface);
    return put_finish(&put);
}

static bool fits_float32(const struct tetmesh *mesh, const struct cut *surface)
{
    for (uint32_t v = 0; v < surface->vertex_count; v++)
        for (uint32_t d = 0; d < 3; d++)
            if (fabs(cut_value(surface, v, mesh->positions, 3, d)) > FLT_MAX)
                return false;
    return true;
}

static void put_array(struct put *put, const struct cut *surface, const double *values, uint32_t components)
{
    for (uint32_t v = 0; v < surface->vertex_count; v++)
        for (uint32_t c = 0; c < components; c++)
            put_double(put, cut_value(surface, v, values, components, c), TETLOD_FLOAT32);
}

/* From blue by white to red over the mesh's range of the first scalar field that is not ids; white if there is none. */
static void put_colours(struct put *put, const struct tetmesh *mesh, const struct cut *surface)
{
    uint32_t first = ids_first_other(mesh, 1);
    const struct point_field *field = first == TETLOD_NONE ? NULL : &mesh->fields[first];
    double range[2] = {0, 0};
    if (field)
        point_field_range(field, mesh->vertex_count, range);
    for (uint32_t v = 0; v < surface->vertex_count; v++) {
        double at = range[1] > range[0] ? (cut_value(surface, v, field->values, 1,
                                                     0) - range[0]) / (range[1] - range[0]) : 0.5;
        at = fmin(fmax(at, 0), 1); // a difference of huge values may be infinite
        double low = at < 0.5 ? 2 * at : 1, high = at > 0.5 ? 2 - 2 * at : 1;
        put_word(put, (uint64_t)(230 * low), 1);
        put_word(put, (uint64_t)(230 * (low < high ? low : high)), 1);
        put_word(put, (uint64_t)(230 * high), 1);
        put_word(put, 255, 1);
    }
}

static void put_buffer(struct put *put, const struct tetmesh *mesh, const struct cut *surface)
{
    for (size_t i = 0; i < 3 * (size_t)surface->triangle_count; i++)
        put_word(put, surface->triangles[i], 4);
    put_array(put, surface, mesh->positions, 3);
    put_colours(put, mesh, surface);
    for (uint32_t f = 0; f < mesh->field_count; f++)
        if (has_attribute(&mesh->fields[f]))
            put_array(put, surface, mesh->fields[f].values, mesh->fields[f].components);
}

enum tetlod_status io_write_glb(const struct tetmesh *mesh, const struct cut *surface, const struct tetlodi_sink *sink,
                                struct tetlod_error *error)
{
    enum { HEAD = 12, CHUNK_HEAD = 8 };
    struct put put;
    uint64_t json, arrays;
    if (!fits_float32(mesh, surface))
        return tetlodi_fail(error, TETLOD_ERR_LIMIT,
                            "a GLB file has float32 coordinates, which these do not fit into; write .vtp");
    TETLOD_TRY(measure_json(mesh, surface, &json, &arrays, error));
    uint64_t padded = (json + 3) & ~(uint64_t)3, all = HEAD + CHUNK_HEAD + padded + (arrays ? CHUNK_HEAD + arrays : 0);
    if (all > UINT32_MAX)
        return tetlodi_fail(error, TETLOD_ERR_LIMIT, "a GLB file holds at most 4 GB; write .vtp");
    TETLOD_TRY(put_init(&put, sink, false, error));
    put_text(&put, "glTF");
    put_word(&put, 2, 4);
    put_word(&put, all, 4);
    put_word(&put, padded, 4);
    put_text(&put, "JSON");
    put_json(&put, mesh, surface);
    for (uint64_t i = json; i < padded; i++)
        put_word(&put, ' ', 1);
    if (arrays) {
        put_word(&put, arrays, 4);
        put_word(&put, 0x004e4942, 4); // "BIN" and a zero
        put_buffer(&put, mesh, surface);
    }
    return put_finish(&put);
}
