/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * In: points as text, in a file or on the command line. Out: a row for each, in the same order: x, y, z, inside (0 or
 * 1), the interpolated values of fields at points, those of the tetrahedron of fields of cells. Outside values are
 * empty in CSV, NaN in VTP.
 */
#include "src/cli/probe.h"

#include <inttypes.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

#include "format/fail.h"
#include "src/mesh/locate.h"
#include "src/util/array.h"
#include "src/util/file.h"
#include "src/util/number_text.h"
#include "src/util/put.h"

enum { MAX_LINE = 4096 };

static const char *ending(const char *path)
{
    const char *dot = strrchr(path, '.');
    return dot ? dot : "";
}

bool probe_is_output(const char *path)
{
    return strcasecmp(ending(path), ".csv") == 0 || strcasecmp(ending(path), ".vtp") == 0;
}

/* ---- points */

/* The first three numbers of a line; what follows them is left out. */
static bool read_point(const char *line, size_t size, double out[3])
{
    char text[MAX_LINE];
    size_t used = 0, words = 0;
    bool in_word = false;
    for (size_t i = 0; i < size && used + 1 < sizeof text; i++) {
        const bool separates = strchr(", \t\r;", line[i]) != NULL;
        if (separates && in_word && ++words == 3)
            break;
        if (!separates || in_word)
            text[used++] = separates ? ',' : line[i];
        in_word = !separates;
    }
    text[used] = 0;
    if (used && text[used - 1] == ',')
        text[used - 1] = 0;
    return text_numbers(text, 3, out);
}

/* A line of a file may begin with '#', and the first one may have names; there are no such lines otherwise. */
static enum tetlod_status read_points(struct probes *out, const char *text, size_t size, bool is_file,
                                      struct tetlod_error *error)
{
    size_t number = 0;
    for (const char *at = text, *end = text + size; at < end; number++) {
        const char *stop = memchr(at, is_file ? '\n' : ';', (size_t)(end - at));
        const size_t length = (size_t)((stop ? stop : end) - at);
        double point[3];
        const bool is_blank = strspn(at, " \t\r") >= length || (is_file && *at == '#');
        if (!is_blank && read_point(at, length, point)) {
            if (!array_reserve(&out->points, &out->capacity, 3 * (out->count + 1), sizeof *out->points))
                return tetlodi_fail_nomem(error, "the points", 24 * (uint64_t)out->count);
            memcpy(out->points + 3 * out->count++, point, sizeof point);
        } else if (!is_blank && (number || !is_file)) {
            return tetlodi_fail(error, TETLOD_ERR_ARGUMENT, "%s %zu of the points is not x,y,z: '%.*s'",
                                is_file ? "line" : "number", number + 1, length < 60 ? (int)length : 60, at);
        }
        at = stop ? stop + 1 : end;
    }
    return out->count ? TETLOD_OK : tetlodi_fail(error, TETLOD_ERR_ARGUMENT, "there is no point among the points");
}

enum tetlod_status probes_read(struct probes *out, const char *points, struct tetlod_error *error)
{
    double one[3];
    if (read_point(points, strcspn(points, ";"), one))
        return read_points(out, points, strlen(points), false, error);
    unsigned char *bytes;
    size_t size;
    struct tetlod_error inner = {0};
    TETLOD_TRY(file_read(points, &bytes, &size, error));
    char *text = array_new(size + 1, 1); // with an end, for functions of strings
    enum tetlod_status status = text ? TETLOD_OK : tetlodi_fail_nomem(error, "the points", size);
    if (text) {
        memcpy(text, bytes, size);
        text[size] = 0;
        status = read_points(out, text, size, true, &inner);
        if (status != TETLOD_OK)
            tetlodi_fail(error, status, "%.400s: %s", points, inner.message);
    }
    free(text);
    free(bytes);
    return status;
}

static enum tetlod_status locate(struct probes *probes, const struct tetmesh *mesh, struct tetlod_error *error)
{
    struct locator locator;
    probes->tets = array_new(probes->count, sizeof *probes->tets);
    probes->weights = array_new(probes->count, sizeof *probes->weights);
    if (!probes->tets || !probes->weights)
        return tetlodi_fail_nomem(error, "the points", probes->count * (uint64_t)36);
    TETLOD_TRY(locator_init(&locator, mesh->positions, mesh->vertex_count, mesh->corners, mesh->tet_count, error));
    for (size_t i = 0; i < probes->count; i++) {
        uint32_t tet = TETLOD_NONE;
        locator_find(&locator, probes->points + 3 * i, &tet, 1);
        probes->tets[i] = tet;
        if (tet != TETLOD_NONE)
            locator_weights(&locator, tet, probes->points + 3 * i, probes->weights[i]);
    }
    locator_fini(&locator);
    return TETLOD_OK;
}

static double value_at(const struct probes *probes, const struct tetmesh *mesh, size_t i,
                       const struct point_field *field, bool of_cells, uint32_t component)
{
    double sum = 0;
    const uint32_t tet = probes->tets[i], width = field->components;
    if (tet == TETLOD_NONE)
        return NAN;
    if (of_cells)
        return field->values[(size_t)tet * width + component];
    for (size_t c = 0; c < 4; c++)
        sum += probes->weights[i][c] * field->values[(size_t)mesh->corners[4 * (size_t)tet + c] * width + component];
    return sum;
}

/* ---- files */

static void put_csv_name(struct put *put, const struct point_field *field, uint32_t component)
{
    put_text(put, ",\"");
    for (const char *c = field->name; *c; c++) {
        put_word(put, (unsigned char)*c, 1);
        if (*c == '"')
            put_text(put, "\"");
    }
    if (field->components > 1)
        put_format(put, ":%" PRIu32, component);
    put_text(put, "\"");
}

typedef void on_column(void *opaque, const struct point_field *field, bool of_cells);

static void each_field(const struct tetmesh *mesh, on_column *call, void *opaque)
{
    for (uint32_t f = 0; f < mesh->field_count; f++)
        call(opaque, &mesh->fields[f], false);
    for (uint32_t f = 0; f < mesh->cell_field_count; f++)
        call(opaque, &mesh->cell_fields[f], true);
}

struct table {
    struct put put;
    const struct probes *probes;
    const struct tetmesh *mesh;
    size_t row;
};

static void put_csv_names(void *opaque, const struct point_field *field, bool of_cells)
{
    struct table *table = opaque;
    (void)of_cells;
    for (uint32_t c = 0; c < field->components; c++)
        put_csv_name(&table->put, field, c);
}

static void put_csv_values(void *opaque, const struct point_field *field, bool of_cells)
{
    struct table *table = opaque;
    for (uint32_t c = 0; c < field->components; c++) {
        if (table->probes->tets[table->row] == TETLOD_NONE)
            put_text(&table->put, ",");
        else
            put_format(&table->put, ",%.17g", value_at(table->probes, table->mesh, table->row, field, of_cells, c));
    }
}

static void put_csv(struct table *table)
{
    const struct probes *probes = table->probes;
    put_text(&table->put, "x,y,z,inside");
    each_field(table->mesh, put_csv_names, table);
    put_text(&table->put, "\n");
    for (table->row = 0; table->row < probes->count; table->row++) {
        const double *p = probes->points + 3 * table->row;
        put_format(&table->put, "%.17g,%.17g,%.17g,%d", p[0], p[1], p[2], probes->tets[table->row] != TETLOD_NONE);
        each_field(table->mesh, put_csv_values, table);
        put_text(&table->put, "\n");
    }
}

static void put_vtp_array(void *opaque, const struct point_field *field, bool of_cells)
{
    struct table *table = opaque;
    put_text(&table->put, "<DataArray type=\"Float64\" Name=\"");
    put_escaped(&table->put, field->name);
    put_format(&table->put, "\" NumberOfComponents=\"%" PRIu32 "\" format=\"ascii\">\n", field->components);
    for (size_t i = 0; i < table->probes->count; i++)
        for (uint32_t c = 0; c < field->components; c++) {
            const double value = value_at(table->probes, table->mesh, i, field, of_cells, c);
            if (isnan(value))
                put_text(&table->put, "nan\n");
            else
                put_format(&table->put, "%.17g\n", value);
        }
    put_text(&table->put, "</DataArray>\n");
}

static void put_vtp(struct table *table)
{
    struct put *put = &table->put;
    const struct probes *probes = table->probes;
    put_format(put, "<VTKFile type=\"PolyData\" version=\"1.0\">\n<PolyData>\n<Piece NumberOfPoints=\"%zu\" "
                    "NumberOfVerts=\"%zu\">\n<Points>\n<DataArray type=\"Float64\" NumberOfComponents=\"3\" "
                    "format=\"ascii\">\n", probes->count, probes->count);
    for (size_t i = 0; i < 3 * probes->count; i++)
        put_format(put, "%.17g\n", probes->points[i]);
    put_text(put, "</DataArray>\n</Points>\n<Verts>\n<DataArray type=\"Int64\" Name=\"connectivity\" "
                  "format=\"ascii\">\n");
    for (size_t i = 0; i < probes->count; i++)
        put_format(put, "%zu\n", i);
    put_text(put, "</DataArray>\n<DataArray type=\"Int64\" Name=\"offsets\" format=\"ascii\">\n");
    for (size_t i = 0; i < probes->count; i++)
        put_format(put, "%zu\n", i + 1);
    put_text(put, "</DataArray>\n</Verts>\n<PointData>\n<DataArray type=\"UInt8\" Name=\"inside\" "
                  "format=\"ascii\">\n");
    for (size_t i = 0; i < probes->count; i++)
        put_text(put, probes->tets[i] == TETLOD_NONE ? "0\n" : "1\n");
    put_text(put, "</DataArray>\n");
    each_field(table->mesh, put_vtp_array, table);
    put_text(put, "</PointData>\n</Piece>\n</PolyData>\n</VTKFile>\n");
}

static enum tetlod_status write_file(const struct probes *probes, const struct tetmesh *mesh, const char *path,
                                     struct tetlod_error *error)
{
    struct table table = {.probes = probes, .mesh = mesh};
    struct file_output *output;
    TETLOD_TRY(file_output_open(&output, path, error));
    const struct tetlodi_sink sink = file_output_sink(output);
    enum tetlod_status status = put_init(&table.put, &sink, false, error);
    if (status == TETLOD_OK) {
        if (strcasecmp(ending(path), ".csv") == 0)
            put_csv(&table);
        else
            put_vtp(&table);
        status = put_finish(&table.put);
    }
    return file_output_finish(output, status, error);
}

enum tetlod_status probes_write(struct probes *probes, const struct tetmesh *mesh, const char *output,
                                struct tetlod_error *error)
{
    TETLOD_TRY(locate(probes, mesh, error));
    return write_file(probes, mesh, output, error);
}

void probes_fini(struct probes *probes)
{
    free(probes->points);
    free(probes->tets);
    free(probes->weights);
    *probes = (struct probes){0};
}
