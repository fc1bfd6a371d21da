/* SPDX-License-Identifier: BSD-3-Clause */
/* Writing XDMF as one file, which says that it is XDMF 2: meshio takes values of the grid only there. All numbers are
 * in its text, with as many digits as bring them back. */
#include <inttypes.h>
#include <math.h>
#include <string.h>

#include "format/fail.h"
#include "src/io/writers/facts.h"
#include "src/io/writers/writers.h"
#include "src/util/put.h"

static void put_values(struct put *put, const struct point_field *field, uint64_t rows)
{
    uint32_t n = field->components;
    bool whole = field->is_integer;
    for (uint64_t i = 0; i < rows * n && whole; i++)
        whole = fabs(field->values[i]) <= 0x1p53;
    put_format(put, "<DataItem Dimensions=\"%" PRIu64, rows);
    if (n > 1)
        put_format(put, " %" PRIu32, n);
    put_format(put, "\" NumberType=\"%s\" Precision=\"%d\" Format=\"XML\">\n", whole ? "Int" : "Float",
               !whole && field->type == TETLOD_FLOAT32 ? 4 : 8);
    for (uint64_t i = 0; i < rows * n; i++)
        put_format(put, "%.*g%c", field->type == TETLOD_FLOAT32 ? 9 : 17, field->values[i], (i + 1) % n ? ' ' : '\n');
    put_text(put, "</DataItem>");
}

static void put_attribute(struct put *put, const struct point_field *field, bool cell, uint64_t rows)
{
    uint32_t n = field->components;
    put_text(put, "<Attribute Name=\"");
    put_escaped(put, field->name);
    put_format(put, "\" AttributeType=\"%s\" Center=\"%s\"",
               n == 1   ? "Scalar"
               : n == 3 ? "Vector"
               : n == 6 ? "Tensor6"
               : n == 9 ? "Tensor"
                        : "Matrix",
               cell ? "Cell" : "Node");
    if (field->unit[0]) {
        put_text(put, " Units=\"");
        put_escaped(put, field->unit);
        put_text(put, "\"");
    }
    put_text(put, ">\n");
    put_values(put, field, rows);
    put_text(put, "</Attribute>\n");
}

/* Values of the whole grid: VTK takes them as field data. */
static void put_fact(struct put *put, const struct fact *fact)
{
    put_format(put, "<Attribute Name=\"%s", fact->name);
    if (fact->field) {
        put_text(put, " ");
        put_escaped(put, fact->field);
    }
    put_format(put, "\" AttributeType=\"Scalar\" Center=\"Grid\">\n<DataItem Dimensions=\"%zu\" NumberType=\"%s\" "
               "Precision=\"%d\" Format=\"XML\">", fact->codes ? strlen(fact->codes) : 1, fact->codes ? "Int" : "Float",
               fact->codes ? 4 : 8);
    for (const char *code = fact->codes; code && *code; code++)
        put_format(put, code[1] ? "%d " : "%d", *code);
    if (!fact->codes)
        put_format(put, "%.17g", fact->value);
    put_text(put, "</DataItem></Attribute>\n");
}

enum tetlod_status xdmf_write(const struct tetmesh *mesh, const struct tetlodi_sink *sink, struct tetlod_error *error)
{
    struct put put;
    const struct point_field points = {.components = 3, .type = mesh->position_type, .values = mesh->positions};
    TETLOD_TRY(put_init(&put, sink, false, error));
    put_text(&put, "<?xml version=\"1.0\"?>\n<Xdmf Version=\"2.0\"><Domain><Grid Name=\"mesh\" "
                   "GridType=\"Uniform\">\n");
    put_format(&put,
               "<Topology TopologyType=\"Tetrahedron\" NumberOfElements=\"%" PRIu32
               "\">\n<DataItem Dimensions=\"%" PRIu32 " 4\" NumberType=\"Int\" Precision=\"8\" Format=\"XML\">\n",
               mesh->tet_count, mesh->tet_count);
    for (size_t i = 0; i < 4 * (size_t)mesh->tet_count; i++)
        put_format(&put, "%" PRIu32 "%c", mesh->corners[i], (i + 1) % 4 ? ' ' : '\n');
    put_text(&put, "</DataItem></Topology>\n<Geometry GeometryType=\"XYZ\">\n");
    put_values(&put, &points, mesh->vertex_count);
    put_text(&put, "</Geometry>\n");
    for (uint32_t f = 0; f < mesh->field_count; f++)
        put_attribute(&put, &mesh->fields[f], false, mesh->vertex_count);
    for (uint32_t f = 0; f < mesh->cell_field_count; f++)
        put_attribute(&put, &mesh->cell_fields[f], true, mesh->tet_count);
    struct fact fact;
    for (uint32_t i = 0; fact_of(mesh, i, &fact); i++)
        put_fact(&put, &fact);
    put_text(&put, "</Grid></Domain></Xdmf>\n");
    return put_finish(&put);
}
