/* SPDX-License-Identifier: BSD-3-Clause */
/* Writing surfaces, binary little-endian: STL (triangles with normals), VTP (raw appended data) and PLY (both: points
 * with all fields). The size of every array is known before it is written. */
#include <inttypes.h>
#include <math.h>

#include "format/fail.h"
#include "src/cut/cut.h"
#include "src/io/writers/writers.h"
#include "src/util/put.h"

static void put_triangles(struct put *put, const struct cut *surface)
{
    for (size_t i = 0; i < 3 * (size_t)surface->triangle_count; i++)
        put_word(put, surface->triangles[i], 4);
}

/* ---- STL: 80 bytes of title, a count, and per triangle its normal, corners and two bytes of nothing */

static void put_normal(struct put *put, double p[3][3])
{
    double a[3], b[3];
    for (int d = 0; d < 3; d++) {
        a[d] = p[1][d] - p[0][d];
        b[d] = p[2][d] - p[0][d];
    }
    double n[3] = {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
    double length = sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2]);
    for (int d = 0; d < 3; d++)
        put_double(put, length > 0 ? n[d] / length : 0, TETLOD_FLOAT32);
}

enum tetlod_status io_write_stl(const struct tetmesh *mesh, const struct cut *surface, const struct tetlodi_sink *sink,
                                struct tetlod_error *error)
{
    enum { TITLE = 80 };
    static const char title[TITLE] = "tetlod surface"; // not "solid": that is text
    struct put put;
    TETLOD_TRY(put_init(&put, sink, false, error));
    for (int i = 0; i < TITLE; i++)
        put_word(&put, (unsigned char)title[i], 1);
    put_word(&put, surface->triangle_count, 4);
    for (size_t t = 0; t < surface->triangle_count; t++) {
        double p[3][3];
        for (uint32_t i = 0; i < 9; i++)
            p[i / 3][i % 3] = cut_value(surface, surface->triangles[3 * t + i / 3], mesh->positions, 3, i % 3);
        put_normal(&put, p);
        for (int i = 0; i < 9; i++)
            put_double(&put, p[i / 3][i % 3], TETLOD_FLOAT32);
        put_word(&put, 0, 2);
    }
    return put_finish(&put);
}

/* ---- PLY */

/* A property's name is one word. */
static void put_property(struct put *put, enum tetlod_type type, const char *name)
{
    put_text(put, type == TETLOD_FLOAT64 ? "property double " : "property float ");
    for (; *name; name++)
        put_word(put, (unsigned char)*name <= ' ' ? '_' : (unsigned char)*name, 1);
}

static void put_ply_header(struct put *put, const struct tetmesh *mesh, const struct cut *surface)
{
    put_format(put, "ply\nformat binary_little_endian 1.0\nelement vertex %" PRIu32 "\n", surface->vertex_count);
    for (int d = 0; d < 3; d++) {
        put_property(put, mesh->position_type, (const char[2]){"xyz"[d], 0});
        put_text(put, "\n");
    }
    for (uint32_t f = 0; f < mesh->field_count; f++) {
        const struct point_field *field = &mesh->fields[f];
        for (uint32_t c = 0; c < field->components; c++) {
            put_property(put, field->type, field->name);
            if (field->components > 1)
                put_format(put, "_%" PRIu32, c);
            put_text(put, "\n");
        }
    }
    put_format(put, "element face %" PRIu32 "\nproperty list uchar uint vertex_indices\nend_header\n",
               surface->triangle_count);
}

static void put_ply_point(struct put *put, const struct tetmesh *mesh, const struct cut *surface, uint32_t v)
{
    for (uint32_t d = 0; d < 3; d++)
        put_double(put, cut_value(surface, v, mesh->positions, 3, d), mesh->position_type);
    for (uint32_t f = 0; f < mesh->field_count; f++) {
        const struct point_field *field = &mesh->fields[f];
        for (uint32_t c = 0; c < field->components; c++)
            put_double(put, cut_value(surface, v, field->values, field->components, c), field->type);
    }
}

static enum tetlod_status write_ply(const struct tetmesh *mesh, const struct cut *surface,
                                    const struct tetlodi_sink *sink,
                                    struct tetlod_error *error)
{
    struct put put;
    TETLOD_TRY(put_init(&put, sink, false, error));
    put_ply_header(&put, mesh, surface);
    for (uint32_t v = 0; v < surface->vertex_count; v++)
        put_ply_point(&put, mesh, surface, v);
    for (size_t t = 0; t < surface->triangle_count; t++) {
        put_word(&put, 3, 1);
        for (size_t i = 0; i < 3; i++)
            put_word(&put, surface->triangles[3 * t + i], 4);
    }
    return put_finish(&put);
}

/* ---- VTP */

static uint64_t array_size(const struct cut *surface, uint32_t components, enum tetlod_type type)
{
    return (uint64_t)surface->vertex_count * components * (type == TETLOD_FLOAT32 ? 4 : 8);
}

static void put_element(struct put *put, const char *type, const char *name, uint32_t components, uint64_t size,
                        const char *unit,
                        uint64_t *offset)
{
    put_format(put,
               "<DataArray type=\"%s\" NumberOfComponents=\"%" PRIu32 "\" format=\"appended\" offset=\"%" PRIu64
               "\" Name=\"",
               type, components, *offset);
    put_escaped(put, name);
    put_text(put, "\">");
    if (*unit) {
        put_text(put, VTK_XML_UNIT);
        put_escaped(put, unit);
        put_text(put, VTK_XML_UNIT_END);
    }
    put_text(put, "</DataArray>\n");
    *offset += 8 + size;
}

static void put_vtp_head(struct put *put, const struct tetmesh *mesh, const struct cut *surface)
{
    static const char *const types[] = {[TETLOD_FLOAT32] = "Float32", [TETLOD_FLOAT64] = "Float64"};
    uint64_t offset = 0, triangles = surface->triangle_count;
    put_text(put, "<?xml version=\"1.0\"?>\n<VTKFile type=\"PolyData\" version=\"1.0\" byte_order=\"LittleEndian\" "
                  "header_type=\"UInt64\">\n");
    put_format(put, "<PolyData><Piece NumberOfPoints=\"%" PRIu32 "\" NumberOfVerts=\"0\" NumberOfLines=\"0\" "
                                                                 "NumberOfStrips=\"0\" "
                    "NumberOfPolys=\"%" PRIu64 "\">\n<PointData>\n", surface->vertex_count, triangles);
    for (uint32_t f = 0; f < mesh->field_count; f++) {
        const struct point_field *field = &mesh->fields[f];
        put_element(put, types[field->type], field->name, field->components,
                    array_size(surface, field->components, field->type),
                    field->unit, &offset);
    }
    put_text(put, "</PointData>\n<Points>\n");
    put_element(put, types[mesh->position_type], "Points", 3, array_size(surface, 3, mesh->position_type), "", &offset);
    put_text(put, "</Points>\n<Polys>\n");
    put_element(put, "Int32", "connectivity", 1, 12 * triangles, "", &offset);
    put_element(put, "Int32", "offsets", 1, 4 * triangles, "", &offset);
    put_text(put, "</Polys>\n</Piece></PolyData>\n<AppendedData encoding=\"raw\">\n_");
}

/* An array of the mesh, at the surface's vertices. */
static void put_vtp_array(struct put *put, const struct cut *surface, const double *values, uint32_t components,
                          enum tetlod_type type)
{
    put_word(put, array_size(surface, components, type), 8);
    for (uint32_t v = 0; v < surface->vertex_count; v++)
        for (uint32_t c = 0; c < components; c++)
            put_double(put, cut_value(surface, v, values, components, c), type);
}

enum tetlod_status io_write_vtp(const struct tetmesh *mesh, const struct cut *surface, const struct tetlodi_sink *sink,
                                struct tetlod_error *error)
{
    struct put put;
    if (surface->triangle_count > INT32_MAX / 3)
        return tetlodi_fail(error, TETLOD_ERR_LIMIT,
                            "%" PRIu32 " triangles are more than the %d that fit into a VTP file",
                            surface->triangle_count, INT32_MAX / 3); // its offsets are Int32
    TETLOD_TRY(put_init(&put, sink, false, error));
    put_vtp_head(&put, mesh, surface);
    for (uint32_t f = 0; f < mesh->field_count; f++)
        put_vtp_array(&put, surface, mesh->fields[f].values, mesh->fields[f].components, mesh->fields[f].type);
    put_vtp_array(&put, surface, mesh->positions, 3, mesh->position_type);
    put_word(&put, 12 * (uint64_t)surface->triangle_count, 8);
    put_triangles(&put, surface);
    put_word(&put, 4 * (uint64_t)surface->triangle_count, 8);
    for (uint32_t t = 0; t < surface->triangle_count; t++)
        put_word(&put, 3 * ((uint64_t)t + 1), 4);
    put_text(&put, "\n</AppendedData></VTKFile>\n");
    return put_finish(&put);
}

/* ---- the boundary of a mesh as a file */

typedef enum tetlod_status surface_writer(const struct tetmesh *mesh, const struct cut *surface,
                                          const struct tetlodi_sink *sink,
                                          struct tetlod_error *error);

static enum tetlod_status write_boundary(const struct tetmesh *mesh, surface_writer *write,
                                         const struct tetlodi_sink *sink,
                                         struct tetlod_error *error)
{
    struct cut surface = {0};
    enum tetlod_status status = cut_boundary(mesh, &surface, error);
    if (status == TETLOD_OK)
        status = write(mesh, &surface, sink, error);
    cut_fini(&surface);
    return status;
}

enum tetlod_status stl_write(const struct tetmesh *mesh, const struct tetlodi_sink *sink, struct tetlod_error *error)
{
    return write_boundary(mesh, io_write_stl, sink, error);
}

enum tetlod_status ply_write(const struct tetmesh *mesh, const struct tetlodi_sink *sink, struct tetlod_error *error)
{
    return write_boundary(mesh, write_ply, sink, error);
}

enum tetlod_status vtp_write(const struct tetmesh *mesh, const struct tetlodi_sink *sink, struct tetlod_error *error)
{
    return write_boundary(mesh, io_write_vtp, sink, error);
}

enum tetlod_status glb_write(const struct tetmesh *mesh, const struct tetlodi_sink *sink, struct tetlod_error *error)
{
    return write_boundary(mesh, io_write_glb, sink, error);
}
