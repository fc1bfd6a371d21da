/* SPDX-License-Identifier: BSD-3-Clause */
#define _GNU_SOURCE // memmem
/*
 * Reading Gmsh MSH 2.0 to 2.2, 4.0 and 4.1, text and binary: sections between $Name and $EndName, of which $Nodes,
 * $Elements, $Entities, $NodeData and $ElementData matter. Points and cells have numbers (tags) of their own. In 4.0
 * and 4.1 they come in blocks, one per entity; 4.0 has the entity's tag before its dimension, and tags of points and
 * cells are 32-bit integers.
 */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "format/fail.h"
#include "src/io/readers/readers.h"
#include "src/io/services/tag_map.h"
#include "src/io/services/file_values.h"
#include "src/util/array.h"

struct gmsh {
    const char *begin;
    struct text rest;
    struct tetmesh *mesh;
    struct io_report *report;
    struct tetlod_error *error;
    bool binary, big_endian, is_4, is_40; /* is_40: is_4, too */
    double *positions; /* owned: grows, because blocks are not to be trusted to sum up */
    size_t position_capacity;
    struct tag_map tags;
    bool sorted;
    struct cells *cells; /* the block's */
    bool keeps_numbers;  /* there is element data */
    bool cells_sorted;
    struct tag_map cell_tags;
    struct cell_numbers physical; /* the groups that cells are in */
    struct file_view *view;
    int64_t *groups; /* owned: of volumes, pairs of tag and physical group */
    size_t group_count, group_capacity;
};

static enum tetlod_status fail(const struct gmsh *g, const char *why)
{
    return tetlodi_fail(g->error, TETLOD_ERR_MESH, "byte %td: %s", g->rest.at - g->begin, why);
}

static const char number_missing[] = "there should be a number here; is the file truncated?";

/* The next integers, in text or of `type`. */
static enum tetlod_status take_ints(struct gmsh *g, enum value_type type, size_t count, int64_t *out)
{
    file_view_pass(g->view, g->rest.at);
    if (!g->binary) {
        for (size_t i = 0; i < count; i++)
            if (!text_int(&g->rest, &out[i]))
                return fail(g, number_missing);
        return TETLOD_OK;
    }
    if ((size_t)(g->rest.end - g->rest.at) / value_size(type) < count)
        return fail(g, number_missing);
    values_to_ints((const unsigned char *)g->rest.at, type, g->big_endian, count, out);
    g->rest.at += count * value_size(type);
    return TETLOD_OK;
}

static enum tetlod_status take_doubles(struct gmsh *g, size_t count, double *out)
{
    file_view_pass(g->view, g->rest.at);
    if (!g->binary) {
        for (size_t i = 0; i < count; i++)
            if (!text_double(&g->rest, false, &out[i]))
                return fail(g, number_missing);
        return TETLOD_OK;
    }
    if ((size_t)(g->rest.end - g->rest.at) / 8 < count)
        return fail(g, number_missing);
    values_to_doubles((const unsigned char *)g->rest.at, VALUE_FLOAT64, g->big_endian, count, out);
    g->rest.at += count * 8;
    return TETLOD_OK;
}

/* A count that is text also in binary files. */
static enum tetlod_status take_text_count(struct gmsh *g, int64_t *out)
{
    return text_int(&g->rest, out) && *out >= 0 ? TETLOD_OK : fail(g, "there should be a count here");
}

/* Binary data begins after the end of the line. */
static void end_line(struct gmsh *g)
{
    if (g->binary)
        text_line(&g->rest);
}

/* ---- points */

static enum tetlod_status add_point(struct gmsh *g, int64_t tag, const double position[3])
{
    size_t count = g->tags.count;
    if (count + 1 >= TETLOD_NONE)
        return fail(g, "there are more points than fit");
    if (!ARRAY_RESERVE(g->positions, g->position_capacity, 3 * (count + 1)))
        return tetlodi_fail_nomem(g->error, "the points", (uint64_t)count * 24);
    memcpy(g->positions + 3 * count, position, 3 * sizeof *position);
    return tag_map_add(&g->tags, tag, g->error);
}

static enum tetlod_status read_nodes_2(struct gmsh *g)
{
    int64_t count, tag;
    double position[3];
    TETLOD_TRY(take_text_count(g, &count));
    end_line(g);
    for (int64_t i = 0; i < count; i++) {
        TETLOD_TRY(take_ints(g, VALUE_INT32, 1, &tag));
        TETLOD_TRY(take_doubles(g, 3, position));
        TETLOD_TRY(add_point(g, tag, position));
    }
    return TETLOD_OK;
}

/* The head of a block of points or cells: its entity's dimension and tag, a third number, and how many there are. */
static enum tetlod_status take_block_head(struct gmsh *g, int64_t head[3], int64_t *count)
{
    TETLOD_TRY(take_ints(g, VALUE_INT32, 3, head));
    int64_t first = head[0];
    head[0] = g->is_40 ? head[1] : first;
    head[1] = g->is_40 ? first : head[1];
    return take_ints(g, VALUE_UINT64, 1, count);
}

/* A block of 4.0: of each point its tag, position and parameters. */
static enum tetlod_status read_node_block_40(struct gmsh *g, int64_t count, size_t width)
{
    for (int64_t i = 0; i < count; i++) {
        int64_t tag;
        double values[6];
        TETLOD_TRY(take_ints(g, VALUE_INT32, 1, &tag));
        TETLOD_TRY(take_doubles(g, width, values));
        TETLOD_TRY(add_point(g, tag, values));
    }
    return TETLOD_OK;
}

/* A block: the tags of its points, then their positions and, if it is parametric, their parameters on the entity. */
static enum tetlod_status read_node_block(struct gmsh *g)
{
    int64_t entity[3], count; // dimension, tag, parametric
    TETLOD_TRY(take_block_head(g, entity, &count));
    size_t first = g->tags.count, width = entity[2] ? 3 + (size_t)(entity[0] & 3) : 3;
    if (g->is_40)
        return read_node_block_40(g, count, width);
    for (int64_t i = 0; i < count; i++) {
        int64_t tag;
        TETLOD_TRY(take_ints(g, VALUE_UINT64, 1, &tag));
        TETLOD_TRY(add_point(g, tag, (const double[3]){0}));
    }
    for (size_t i = first; i < g->tags.count; i++) {
        double values[6];
        TETLOD_TRY(take_doubles(g, width, values));
        memcpy(g->positions + 3 * i, values, 3 * sizeof *values);
    }
    return TETLOD_OK;
}

static enum tetlod_status read_nodes(struct gmsh *g)
{
    int64_t header[4]; // blocks, points; 4.1: least tag, largest tag
    if (g->sorted)
        return fail(g, "$Nodes come after $Elements or $NodeData, or twice");
    if (!g->is_4)
        return read_nodes_2(g);
    end_line(g);
    TETLOD_TRY(take_ints(g, VALUE_UINT64, g->is_40 ? 2 : 4, header));
    for (int64_t b = 0; b < header[0]; b++)
        TETLOD_TRY(read_node_block(g));
    return TETLOD_OK;
}

static enum tetlod_status finish_points(struct gmsh *g)
{
    if (g->sorted)
        return TETLOD_OK;
    TETLOD_TRY(tag_map_sort(&g->tags, g->error));
    TETLOD_TRY(assemble_points_of(g->mesh, g->tags.count, &g->positions, TETLOD_FLOAT64, g->error));
    g->sorted = true;
    return TETLOD_OK;
}

/* ---- cells */

struct element {
    uint8_t type, points, vtk_type;
};

/* The number of points of Gmsh's element types; cells of higher order start with their corners. */
static const struct element elements[] = {
    {1, 2, VTK_TYPE_FLAT},   {2, 3, VTK_TYPE_FLAT},   {3, 4, VTK_TYPE_FLAT},      {4, 4, VTK_TYPE_TET},
    {5, 8, VTK_TYPE_HEXAHEDRON}, {6, 6, VTK_TYPE_WEDGE}, {7, 5, VTK_TYPE_PYRAMID}, {8, 3, VTK_TYPE_FLAT},
    {9, 6, VTK_TYPE_FLAT},   {10, 9, VTK_TYPE_FLAT},  {11, 10, VTK_TYPE_TET10},     {12, 27, VTK_TYPE_HEXAHEDRON20},
    {13, 18, VTK_TYPE_WEDGE15}, {14, 14, VTK_TYPE_PYRAMID13}, {15, 1, VTK_TYPE_FLAT}, {16, 8, VTK_TYPE_FLAT},
    {17, 20, VTK_TYPE_HEXAHEDRON20}, {18, 15, VTK_TYPE_WEDGE15}, {19, 13, VTK_TYPE_PYRAMID13}, {20, 9, VTK_TYPE_FLAT},
    {21, 10, VTK_TYPE_FLAT}, {22, 12, VTK_TYPE_FLAT}, {23, 15, VTK_TYPE_FLAT},    {24, 15, VTK_TYPE_FLAT},
    {25, 21, VTK_TYPE_FLAT}, {26, 4, VTK_TYPE_FLAT},  {27, 5, VTK_TYPE_FLAT},     {28, 6, VTK_TYPE_FLAT},
    {29, 20, VTK_TYPE_TET},  {30, 35, VTK_TYPE_TET},  {31, 56, VTK_TYPE_TET},     {92, 64, VTK_TYPE_HEXAHEDRON},
    {93, 125, VTK_TYPE_HEXAHEDRON},
};

static enum tetlod_status find_element(const struct gmsh *g, int64_t type, struct element *out)
{
    for (size_t e = 0; e < sizeof elements / sizeof *elements; e++)
        if (elements[e].type == type) {
            *out = elements[e];
            return TETLOD_OK;
        }
    return tetlodi_fail(g->error, TETLOD_ERR_MESH, "byte %td: Gmsh element type %lld is not known",
                        g->rest.at - g->begin,
                        (long long)type);
}

/* The middles of edges in VTK's order, where Gmsh has one of its own. */
static void reorder(const struct element *element, int64_t *points)
{
    static const uint8_t tet[10] = {0, 1, 2, 3, 4, 5, 6, 7, 9, 8};
    static const uint8_t hexahedron[20] = {0, 1, 2, 3, 4, 5, 6, 7, 8, 11, 13, 9, 16, 18, 19, 17, 10, 12, 14, 15};
    static const uint8_t wedge[15] = {0, 1, 2, 3, 4, 5, 6, 9, 7, 12, 14, 13, 8, 10, 11};
    static const uint8_t pyramid[13] = {0, 1, 2, 3, 4, 5, 8, 10, 6, 7, 9, 11, 12};
    const uint8_t *order = element->vtk_type == VTK_TYPE_TET10           ? tet
                           : element->vtk_type == VTK_TYPE_HEXAHEDRON20 ? hexahedron
                           : element->vtk_type == VTK_TYPE_WEDGE15      ? wedge
                           : element->vtk_type == VTK_TYPE_PYRAMID13    ? pyramid
                                                                        : NULL;
    size_t count = order == tet ? 10 : order == hexahedron ? 20 : order == wedge ? 15 : 13;
    int64_t old[20];
    if (!order)
        return;
    memcpy(old, points, count * sizeof *old);
    for (size_t i = 0; i < count; i++)
        points[i] = old[order[i]];
}

/* What a cell is called and belongs to. Cells without volume are left out, and so are their numbers. */
static enum tetlod_status note_cell(struct gmsh *g, int64_t tag, int64_t group)
{
    TETLOD_TRY(cell_numbers_add(&g->physical, g->cells->count, group, g->error));
    return g->keeps_numbers ? tag_map_add(&g->cell_tags, tag, g->error) : TETLOD_OK;
}

static enum tetlod_status take_element(struct gmsh *g, const struct element *element, enum value_type type, int64_t tag,
                                       int64_t group)
{
    int64_t corners[125];
    TETLOD_TRY(take_ints(g, type, element->points, corners));
    for (int p = 0; p < element->points; p++) {
        uint32_t index = tag_map_find(&g->tags, corners[p]);
        if (index == TETLOD_NONE)
            return tetlodi_fail(g->error, TETLOD_ERR_MESH,
                                "byte %td: an element refers to point %lld, which is not there",
                                g->rest.at - g->begin, (long long)corners[p]);
        corners[p] = index;
    }
    if (element->vtk_type == VTK_TYPE_FLAT) {
        g->report->skipped_cells++;
        return TETLOD_OK;
    }
    TETLOD_TRY(note_cell(g, tag, group));
    reorder(element, corners);
    return cells_add(g->cells, element->vtk_type, corners, element->points, g->error);
}

/* The first of a cell's own tags is its physical group. */
static enum tetlod_status take_own_tags(struct gmsh *g, int64_t count, int64_t *out_group)
{
    int64_t tag;
    *out_group = 0;
    if (count < 0)
        return fail(g, "there should be a count here");
    for (int64_t i = 0; i < count; i++) {
        TETLOD_TRY(take_ints(g, VALUE_INT32, 1, &tag));
        *out_group = i ? *out_group : tag;
    }
    return TETLOD_OK;
}

/* Text: tag, type, number of tags, tags, points. Binary: groups of the same type and number of tags. */
static enum tetlod_status read_elements_2(struct gmsh *g)
{
    int64_t total;
    struct element element;
    TETLOD_TRY(take_text_count(g, &total));
    end_line(g);
    while (total > 0) {
        int64_t header[3], in_group = 1, group, tag; // text: tag, type, tags; binary: type, elements, tags
        TETLOD_TRY(take_ints(g, VALUE_INT32, 3, header));
        TETLOD_TRY(find_element(g, header[g->binary ? 0 : 1], &element));
        tag = header[0];
        if (g->binary)
            in_group = header[1];
        if (in_group < 1)
            return fail(g, "there should be a count here");
        for (int64_t i = 0; i < in_group; i++) {
            if (g->binary)
                TETLOD_TRY(take_ints(g, VALUE_INT32, 1, &tag));
            TETLOD_TRY(take_own_tags(g, header[2], &group));
            TETLOD_TRY(take_element(g, &element, VALUE_INT32, tag, group));
        }
        total -= in_group;
    }
    return TETLOD_OK;
}

static int64_t group_of(const struct gmsh *g, int64_t entity)
{
    for (size_t i = 0; i < g->group_count; i++)
        if (g->groups[2 * i] == entity)
            return g->groups[2 * i + 1];
    return 0;
}

static enum tetlod_status skip_tags(struct gmsh *g)
{
    int64_t count, tag;
    TETLOD_TRY(take_ints(g, VALUE_UINT64, 1, &count));
    for (int64_t i = 0; i < count; i++)
        TETLOD_TRY(take_ints(g, VALUE_INT32, 1, &tag));
    return TETLOD_OK;
}

/* An entity: its tag, of a part of one also that one and the partitions, a point or the bounds, its physical groups
 * and, but for points, what bounds it. A part without a group is in that of the whole. */
static enum tetlod_status read_entity(struct gmsh *g, int dimension, bool is_part)
{
    int64_t tag, count, number, whole[2] = {0, 0}, first = 0;
    double bounds[6];
    TETLOD_TRY(take_ints(g, VALUE_INT32, 1, &tag));
    if (is_part) {
        TETLOD_TRY(take_ints(g, VALUE_INT32, 2, whole));
        TETLOD_TRY(skip_tags(g));
        first = whole[0] == 3 ? group_of(g, whole[1]) : 0;
    }
    TETLOD_TRY(take_doubles(g, dimension || g->is_40 ? 6 : 3, bounds));
    TETLOD_TRY(take_ints(g, VALUE_UINT64, 1, &count));
    for (int64_t i = 0; i < count; i++) {
        TETLOD_TRY(take_ints(g, VALUE_INT32, 1, &number));
        first = i == 0 ? number : first;
    }
    if (dimension)
        TETLOD_TRY(skip_tags(g));
    if (dimension < 3 || !first)
        return TETLOD_OK;
    if (!ARRAY_RESERVE(g->groups, g->group_capacity, 2 * (g->group_count + 1)))
        return tetlodi_fail_nomem(g->error, "the physical groups", 16);
    g->groups[2 * g->group_count] = tag;
    g->groups[2 * g->group_count++ + 1] = first;
    return TETLOD_OK;
}

static enum tetlod_status read_all_entities(struct gmsh *g, bool are_parts)
{
    int64_t counts[4];
    TETLOD_TRY(take_ints(g, VALUE_UINT64, 4, counts));
    for (int dimension = 0; dimension < 4; dimension++)
        for (int64_t i = 0; i < counts[dimension]; i++)
            TETLOD_TRY(read_entity(g, dimension, are_parts));
    return TETLOD_OK;
}

static enum tetlod_status read_entities(struct gmsh *g)
{
    if (!g->is_4)
        return fail(g, "$Entities are not for this version");
    end_line(g);
    return read_all_entities(g, false);
}

/* Of a mesh in partitions: their number, ghost entities and their partitions, and the parts of entities, in which the
 * elements are. */
static enum tetlod_status read_parts(struct gmsh *g)
{
    int64_t partitions, ghosts, ghost[2];
    if (!g->is_4)
        return fail(g, "$PartitionedEntities are not for this version");
    end_line(g);
    TETLOD_TRY(take_ints(g, VALUE_UINT64, 1, &partitions));
    TETLOD_TRY(take_ints(g, VALUE_UINT64, 1, &ghosts));
    for (int64_t i = 0; i < ghosts; i++)
        TETLOD_TRY(take_ints(g, VALUE_INT32, 2, ghost));
    return read_all_entities(g, true);
}

/* Versions 2 of points on curves and surfaces have a section of their own. */
static enum tetlod_status refuse_parametric(struct gmsh *g)
{
    return fail(g, "$ParametricNodes cannot be read; save the mesh with Mesh.SaveParametric = 0");
}

static enum tetlod_status read_elements(struct gmsh *g)
{
    int64_t header[4], block[3], count, tag; // block: dimension, tag, type
    struct element element;
    if (g->mesh->cell_field_count)
        return fail(g, "$Elements come after $ElementData");
    TETLOD_TRY(finish_points(g));
    if (!g->is_4)
        return read_elements_2(g);
    end_line(g);
    TETLOD_TRY(take_ints(g, VALUE_UINT64, g->is_40 ? 2 : 4, header));
    for (int64_t b = 0; b < header[0]; b++) {
        TETLOD_TRY(take_block_head(g, block, &count));
        TETLOD_TRY(find_element(g, block[2], &element));
        int64_t group = block[0] == 3 ? group_of(g, block[1]) : 0;
        enum value_type tags = g->is_40 ? VALUE_INT32 : VALUE_UINT64;
        for (int64_t i = 0; i < count; i++) {
            TETLOD_TRY(take_ints(g, tags, 1, &tag));
            TETLOD_TRY(take_element(g, &element, tags, tag, group));
        }
    }
    return TETLOD_OK;
}

/* ---- fields */

enum { MAX_GMSH_COMPONENTS = 9 }; // 1, 3 or 9

/* The first of a section's strings, without its quotes; the caller frees it. */
static char *take_name(struct gmsh *g, int64_t strings)
{
    struct text first = {0};
    for (int64_t s = 0; s < strings && g->rest.at < g->rest.end; s++) {
        struct text line = text_line(&g->rest);
        if (s == 0)
            first = line;
    }
    while (first.at < first.end && (*first.at == ' ' || *first.at == '"'))
        first.at++;
    while (first.at < first.end && (first.end[-1] == ' ' || first.end[-1] == '"'))
        first.end--;
    return strndup(first.at ? first.at : "", (size_t)(first.end - first.at));
}

/* Values for points must be there for all; cells may be without one (NaN), and those of surfaces are passed over. */
static enum tetlod_status take_values(struct gmsh *g, struct point_field *field, bool cell, int64_t count)
{
    size_t rows = cell ? (size_t)g->cells->count : g->mesh->vertex_count;
    unsigned char *seen = array_zero(rows, 1);
    size_t different = 0;
    enum tetlod_status status = seen ? TETLOD_OK : tetlodi_fail_nomem(g->error, field->name, rows);
    for (int64_t i = 0; status == TETLOD_OK && i < count; i++) {
        int64_t tag;
        double skipped[MAX_GMSH_COMPONENTS];
        status = take_ints(g, VALUE_INT32, 1, &tag);
        uint32_t v = status == TETLOD_OK ? tag_map_find(cell ? &g->cell_tags : &g->tags, tag) : 0;
        if (status == TETLOD_OK && v == TETLOD_NONE && !cell)
            status = fail(g, "this value is for a point that is not there");
        if (status == TETLOD_OK) {
            different += v != TETLOD_NONE && !seen[v];
            if (v != TETLOD_NONE)
                seen[v] = 1;
            status = take_doubles(g, field->components,
                                  v == TETLOD_NONE ? skipped : field->values + (size_t)v * field->components);
        }
    }
    for (size_t i = 0; status == TETLOD_OK && cell && i < rows * field->components; i++)
        field->values[i] = seen[i / field->components] ? field->values[i] : NAN;
    free(seen);
    if (status == TETLOD_OK && !cell && different != rows)
        return tetlodi_fail(g->error, TETLOD_ERR_MESH, "field %.60s has values at %zu of %zu points", field->name,
                            different, rows);
    return status;
}

static enum tetlod_status read_data(struct gmsh *g, bool cell)
{
    int64_t strings, reals, integers, numbers[4] = {0};
    double skipped;
    TETLOD_TRY(finish_points(g));
    TETLOD_TRY(take_text_count(g, &strings));
    text_line(&g->rest);
    char *name = take_name(g, strings);
    if (!name)
        return tetlodi_fail_nomem(g->error, "a field's name", 0);
    enum tetlod_status status;
    TETLOD_TRY_DONE(take_text_count(g, &reals));
    for (int64_t i = 0; i < reals; i++)
        if (!text_double(&g->rest, false, &skipped)) {
            status = fail(g, number_missing);
            goto done;
        }
    TETLOD_TRY_DONE(take_text_count(g, &integers));
    for (int64_t i = 0; i < integers; i++) // time step, components, values, partition
        TETLOD_TRY_DONE(take_text_count(g, &numbers[i < 4 ? i : 3]));
    end_line(g);
    if (numbers[1] && (uint64_t)numbers[1] > (uint64_t)(g->rest.end - g->rest.at) /
        (cell ? 1u : g->mesh->vertex_count + 1u)) {
        status = fail(g, "the file ends too early for the values of this field; is it truncated?");
        goto done;
    }
    if (cell && numbers[1] > MAX_GMSH_COMPONENTS) {
        status = fail(g, "element data has more than 9 components");
        goto done;
    }
    TETLOD_TRY_DONE(cell ? assemble_cell_field(g->mesh, name, (uint64_t)numbers[1], TETLOD_FLOAT64, g->cells->count,
                                               g->error)
                         : assemble_field(g->mesh, name, (uint64_t)numbers[1], TETLOD_FLOAT64, g->error));
    status = take_values(g, cell ? &g->mesh->cell_fields[g->mesh->cell_field_count - 1]
                         : &g->mesh->fields[g->mesh->field_count - 1],
                         cell, numbers[2]);
done:
    free(name);
    return status;
}

static enum tetlod_status read_node_data(struct gmsh *g)
{
    return read_data(g, false);
}

/* Its elements are known by then; those of a file whose data comes first are not. */
static enum tetlod_status read_element_data(struct gmsh *g)
{
    if (g->cell_tags.count == g->cells->count && !g->cells_sorted) {
        TETLOD_TRY(tag_map_sort(&g->cell_tags, g->error));
        g->cells_sorted = true;
    }
    return read_data(g, true);
}

/* ---- the whole */

static enum tetlod_status read_format(struct gmsh *g)
{
    double version;
    int64_t binary, size, one;
    if (!text_double(&g->rest, false, &version) || !text_int(&g->rest, &binary) || !text_int(&g->rest, &size))
        return fail(g, "$MeshFormat should be a version, 0 or 1, and 8");
    bool is_2 = version == 2.0 || version == 2.1 || version == 2.2;
    g->is_40 = version == 4.0;
    g->is_4 = g->is_40 || version == 4.1;
    if ((!is_2 && !g->is_4) || size != 8)
        return fail(g, "only versions 2.0 to 2.2, 4.0 and 4.1 of Gmsh's format are known; save the mesh as one of "
                       "them");
    g->binary = binary != 0;
    end_line(g);
    if (!g->binary)
        return TETLOD_OK;
    TETLOD_TRY(take_ints(g, VALUE_INT32, 1, &one));
    g->big_endian = one != 1;
    return TETLOD_OK;
}

static enum tetlod_status skip_section(struct gmsh *g, struct text name)
{
    size_t length = (size_t)(name.end - name.at) - 1; // without its $
    for (const char *at = g->rest.at; at < g->rest.end; at++) {
        at = memchr(at, '$', (size_t)(g->rest.end - at));
        if (!at)
            break;
        if ((size_t)(g->rest.end - at) >= length + 4 && memcmp(at, "$End", 4) == 0 &&
            memcmp(at + 4, name.at + 1, length) == 0) {
            g->rest.at = at;
            return TETLOD_OK;
        }
    }
    return tetlodi_fail(g->error, TETLOD_ERR_MESH, "section %.*s has no end; is the file truncated?", text_length(name),
                        name.at);
}

static enum tetlod_status read_section(struct gmsh *g, struct text name)
{
    static const struct {
        const char *name;
        enum tetlod_status (*read)(struct gmsh *g);
    } sections[] = {{"$MeshFormat", read_format},
                    {"$Nodes", read_nodes},
                    {"$Elements", read_elements},
                    {"$Entities", read_entities},
                    {"$PartitionedEntities", read_parts},
                    {"$ParametricNodes", refuse_parametric},
                    {"$NodeData", read_node_data},
                    {"$ElementData", read_element_data}};
    for (size_t s = 0; s < sizeof sections / sizeof *sections; s++)
        if (text_is(name, sections[s].name)) {
            TETLOD_TRY(sections[s].read(g));
            struct text end = text_word(&g->rest);
            if (end.end - end.at < 4 || memcmp(end.at, "$End", 4) != 0)
                return tetlodi_fail(g->error, TETLOD_ERR_MESH, "byte %td: section %.*s should end here",
                                    g->rest.at - g->begin, text_length(name), name.at);
            return TETLOD_OK;
        }
    if (text_is(name, "$ElementNodeData"))
        io_leave_out(g->report, &g->report->skipped_arrays, name.at, (size_t)(name.end - name.at));
    TETLOD_TRY(skip_section(g, name));
    text_word(&g->rest);
    return TETLOD_OK;
}

bool gmsh_sniff(const unsigned char *bytes, size_t size)
{
    static const char magic[] = "$MeshFormat";
    return size >= sizeof magic - 1 && memcmp(bytes, magic, sizeof magic - 1) == 0;
}

static enum tetlod_status read_all(struct gmsh *g)
{
    for (;;) {
        if (g->binary) // after binary data there may be no white space but the line's end
            while (g->rest.at < g->rest.end && *g->rest.at != '$')
                g->rest.at++;
        struct text name = text_word(&g->rest);
        if (name.at == name.end)
            break;
        if (*name.at != '$')
            return fail(g, "there should be the $Name of a section here");
        TETLOD_TRY(read_section(g, name));
    }
    TETLOD_TRY(finish_points(g));
    return cell_numbers_to_field(&g->physical, g->mesh, "gmsh:physical", g->cells->count, g->error);
}

/* Looks for the word part by part. */
static bool holds_element_data(const struct io_input *input)
{
    static const char word[] = "$ElementData";
    enum { PART = 1 << 20 };
    for (size_t at = 0; at < input->size; at += PART) {
        size_t left = input->size - at, part = left < PART + sizeof word ? left : PART + sizeof word;
        if (memmem(input->bytes + at, part, word, sizeof word - 1))
            return true;
        file_view_pass(input->view, input->bytes + at);
    }
    return false;
}

enum tetlod_status gmsh_read(struct blocks *out, const struct io_input *input, struct io_report *report,
                            struct tetlod_error *error)
{
    struct block *block;
    TETLOD_TRY(blocks_add(out, &block, error));
    struct tetmesh *mesh = &block->mesh;
    const char *begin = (const char *)input->bytes;
    struct gmsh g = {.begin = begin,
                     .rest = {begin, begin + input->size},
                     .mesh = mesh,
                     .cells = &block->cells,
                     .keeps_numbers = holds_element_data(input),
                     .view = input->view,
                     .report = report,
                     .error = error};
    enum tetlod_status status = read_all(&g);
    free(g.positions);
    cell_numbers_fini(&g.physical);
    free(g.groups);
    tag_map_fini(&g.tags);
    tag_map_fini(&g.cell_tags);
    return status;
}
