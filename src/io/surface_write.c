/* SPDX-License-Identifier: BSD-3-Clause */
/* Writing the boundary of a mesh, binary little-endian: STL (triangles with normals) and PLY (points with all fields). */
#include <inttypes.h>
#include <math.h>
#include <string.h>

#include "format/fail.h"
#include "src/io/formats.h"
#include "src/io/boundary_surface.h"
#include "src/util/put.h"

static const double *point(const struct tetmesh *mesh, uint32_t v)
{
    return mesh->positions + 3 * (size_t)v;
}

static void put_normal(struct put *put, const double *p, const double *q, const double *r)
{
    double a[3], b[3];
    for (int d = 0; d < 3; d++) {
        a[d] = q[d] - p[d];
        b[d] = r[d] - p[d];
    }
    double n[3] = {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
    double length = sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2]);
    for (int d = 0; d < 3; d++)
        put_double(put, length > 0 ? n[d] / length : 0, TETLOD_FLOAT32);
}

enum tetlod_status stl_write(const struct tetmesh *mesh, const struct tetlodi_sink *sink, struct tetlod_error *error)
{
    enum { HEADER = 80 };
    static const char header[HEADER + 1] = "boundary of a tetrahedral mesh, written by tetlod"; // not "solid": that is text
    struct boundary_surface surface;
    struct put put;
    TETLOD_TRY(put_init(&put, sink, false, error));
    enum tetlod_status status = boundary_surface_find(mesh, &surface, error);
    for (int i = 0; status == TETLOD_OK && i < HEADER; i++)
        put_word(&put, (unsigned char)header[i], 1);
    put_word(&put, surface.count, 4);
    for (uint32_t t = 0; status == TETLOD_OK && t < surface.count; t++) {
        const uint32_t *v = surface.triangles[t];
        put_normal(&put, point(mesh, v[0]), point(mesh, v[1]), point(mesh, v[2]));
        for (int i = 0; i < 9; i++)
            put_double(&put, point(mesh, v[i / 3])[i % 3], TETLOD_FLOAT32);
        put_word(&put, 0, 2);
    }
    boundary_surface_fini(&surface);
    enum tetlod_status written = put_finish(&put);
    return status != TETLOD_OK ? status : written;
}

/* A property's name is one word. */
static void put_property(struct put *put, enum tetlod_type type, const char *name)
{
    put_text(put, type == TETLOD_FLOAT64 ? "property double " : "property float ");
    for (; *name; name++)
        put_word(put, (unsigned char)*name <= ' ' ? '_' : (unsigned char)*name, 1);
}

static void put_ply_header(struct put *put, const struct tetmesh *mesh, uint32_t points, uint32_t triangles)
{
    put_format(put, "ply\nformat binary_little_endian 1.0\nelement vertex %" PRIu32 "\n", points);
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
    put_format(put, "element face %" PRIu32 "\nproperty list uchar uint vertex_indices\nend_header\n", triangles);
}

static void put_ply_point(struct put *put, const struct tetmesh *mesh, uint32_t v)
{
    for (int d = 0; d < 3; d++)
        put_double(put, point(mesh, v)[d], mesh->position_type);
    for (uint32_t f = 0; f < mesh->field_count; f++) {
        const struct point_field *field = &mesh->fields[f];
        for (uint32_t c = 0; c < field->components; c++)
            put_double(put, field->values[(size_t)v * field->components + c], field->type);
    }
}

enum tetlod_status ply_write(const struct tetmesh *mesh, const struct tetlodi_sink *sink, struct tetlod_error *error)
{
    struct boundary_surface surface;
    struct put put;
    enum tetlod_status status, written;
    TETLOD_TRY(put_init(&put, sink, false, error));
    TETLOD_TRY_DONE(boundary_surface_find(mesh, &surface, error));
    put_ply_header(&put, mesh, surface.point_count, surface.count);
    for (uint32_t v = 0; v < mesh->vertex_count; v++)
        if (surface.numbers[v] != TETLOD_NONE)
            put_ply_point(&put, mesh, v);
    for (uint32_t t = 0; t < surface.count; t++) {
        put_word(&put, 3, 1);
        for (int i = 0; i < 3; i++)
            put_word(&put, surface.numbers[surface.triangles[t][i]], 4);
    }
done:
    boundary_surface_fini(&surface);
    written = put_finish(&put);
    return status != TETLOD_OK ? status : written;
}
