/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * Reading Gmsh MSH 2.2 and 4.1, text and binary: sections between $Name and $EndName, of which $Nodes, $Elements and
 * $NodeData matter. Points and cells have numbers (tags) of their own. In 4.1 they come in blocks, one per entity.
 */
#include <stdlib.h>
#include <string.h>

#include "format/fail.h"
#include "src/io/formats.h"
#include "src/io/tag_map.h"
#include "src/io/file_values.h"
#include "src/util/array.h"

struct gmsh {
    const char *begin;
    struct text rest;
    struct tetmesh *mesh;
    struct io_report *report;
    struct tetlod_error *error;
    bool binary, big_endian, is_4;
    double *positions; /* owned: grows, because blocks are not to be trusted to sum up */
    size_t position_capacity;
    struct tag_map tags;
    bool sorted;
    struct cells *cells;
};

static enum tetlod_status fail(const struct gmsh *g, const char *why)
{
    return tetlodi_fail(g->error, TETLOD_ERR_MESH, "byte %td: %s", g->rest.at - g->begin, why);
}

static const char number_missing[] = "there should be a number here; is the file truncated?";

/* The next integers, in text or of `type`. */
static enum tetlod_status take_ints(struct gmsh *g, enum value_type type, size_t count, int64_t *out)
{
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
    if (!array_reserve((void **)&g->positions, &g->position_capacity, 3 * (count + 1), sizeof *g->positions))
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

/* A block: the tags of its points, then their positions and, if it is parametric, their parameters on the entity. */
static enum tetlod_status read_node_block(struct gmsh *g)
{
    int64_t entity[3], count; // dimension, tag, parametric
    TETLOD_TRY(take_ints(g, VALUE_INT32, 3, entity));
    TETLOD_TRY(take_ints(g, VALUE_UINT64, 1, &count));
    size_t first = g->tags.count, width = entity[2] ? 3 + (size_t)(entity[0] & 3) : 3;
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
    int64_t header[4]; // blocks, points, least tag, largest tag
    if (g->sorted)
        return fail(g, "$Nodes come after $Elements or $NodeData, or twice");
    if (!g->is_4)
        return read_nodes_2(g);
    end_line(g);
    TETLOD_TRY(take_ints(g, VALUE_UINT64, 4, header));
    for (int64_t b = 0; b < header[0]; b++)
        TETLOD_TRY(read_node_block(g));
    return TETLOD_OK;
}

static enum tetlod_status finish_points(struct gmsh *g)
{
    if (g->sorted)
        return TETLOD_OK;
    TETLOD_TRY(tag_map_sort(&g->tags, g->error));
    TETLOD_TRY(assemble_points(g->mesh, g->tags.count, TETLOD_FLOAT64, g->error));
    if (g->tags.count)
        memcpy(g->mesh->positions, g->positions, 3 * g->tags.count * sizeof *g->positions);
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
    {9, 6, VTK_TYPE_FLAT},   {10, 9, VTK_TYPE_FLAT},  {11, 10, VTK_TYPE_TET},     {12, 27, VTK_TYPE_HEXAHEDRON},
    {13, 18, VTK_TYPE_WEDGE}, {14, 14, VTK_TYPE_PYRAMID}, {15, 1, VTK_TYPE_FLAT}, {16, 8, VTK_TYPE_FLAT},
    {17, 20, VTK_TYPE_HEXAHEDRON}, {18, 15, VTK_TYPE_WEDGE}, {19, 13, VTK_TYPE_PYRAMID}, {20, 9, VTK_TYPE_FLAT},
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
    return tetlodi_fail(g->error, TETLOD_ERR_MESH, "byte %td: Gmsh element type %lld is not known", g->rest.at - g->begin,
                        (long long)type);
}

static enum tetlod_status take_element(struct gmsh *g, const struct element *element, enum value_type type)
{
    int64_t corners[125];
    TETLOD_TRY(take_ints(g, type, element->points, corners));
    for (int p = 0; p < element->points; p++) {
        uint32_t index = tag_map_find(&g->tags, corners[p]);
        if (index == TETLOD_NONE)
            return tetlodi_fail(g->error, TETLOD_ERR_MESH, "byte %td: an element refers to point %lld, which is not there",
                                g->rest.at - g->begin, (long long)corners[p]);
        corners[p] = index;
    }
    size_t kept = element->vtk_type == VTK_TYPE_FLAT ? 0 : element->points;
    return cells_add(g->cells, element->vtk_type, corners, kept, g->error);
}

static enum tetlod_status skip_ints(struct gmsh *g, int64_t count)
{
    int64_t skipped;
    if (count < 0)
        return fail(g, "there should be a count here");
    for (int64_t i = 0; i < count; i++)
        TETLOD_TRY(take_ints(g, VALUE_INT32, 1, &skipped));
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
        int64_t header[3], in_group = 1; // text: tag, type, tags; binary: type, elements, tags
        TETLOD_TRY(take_ints(g, VALUE_INT32, 3, header));
        TETLOD_TRY(find_element(g, header[g->binary ? 0 : 1], &element));
        if (g->binary)
            in_group = header[1];
        if (in_group < 1)
            return fail(g, "there should be a count here");
        for (int64_t i = 0; i < in_group; i++) {
            TETLOD_TRY(skip_ints(g, g->binary ? header[2] + 1 : header[2]));
            TETLOD_TRY(take_element(g, &element, VALUE_INT32));
        }
        total -= in_group;
    }
    return TETLOD_OK;
}

static enum tetlod_status read_elements(struct gmsh *g)
{
    int64_t header[4], block[3], count, tag; // block: dimension, tag, type
    struct element element;
    TETLOD_TRY(finish_points(g));
    if (!g->is_4)
        return read_elements_2(g);
    end_line(g);
    TETLOD_TRY(take_ints(g, VALUE_UINT64, 4, header));
    for (int64_t b = 0; b < header[0]; b++) {
        TETLOD_TRY(take_ints(g, VALUE_INT32, 3, block));
        TETLOD_TRY(take_ints(g, VALUE_UINT64, 1, &count));
        TETLOD_TRY(find_element(g, block[2], &element));
        for (int64_t i = 0; i < count; i++) {
            TETLOD_TRY(take_ints(g, VALUE_UINT64, 1, &tag));
            TETLOD_TRY(take_element(g, &element, VALUE_UINT64));
        }
    }
    return TETLOD_OK;
}

/* ---- fields */

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

static enum tetlod_status take_values(struct gmsh *g, struct point_field *field, int64_t count)
{
    unsigned char *seen = array_zero(g->mesh->vertex_count, 1);
    uint32_t different = 0;
    enum tetlod_status status = seen ? TETLOD_OK : tetlodi_fail_nomem(g->error, field->name, g->mesh->vertex_count);
    for (int64_t i = 0; status == TETLOD_OK && i < count; i++) {
        int64_t tag;
        status = take_ints(g, VALUE_INT32, 1, &tag);
        uint32_t v = status == TETLOD_OK ? tag_map_find(&g->tags, tag) : 0;
        if (status == TETLOD_OK && v == TETLOD_NONE)
            status = fail(g, "this value is for a point that is not there");
        if (status == TETLOD_OK) {
            different += !seen[v];
            seen[v] = 1;
            status = take_doubles(g, field->components, field->values + (size_t)v * field->components);
        }
    }
    free(seen);
    if (status == TETLOD_OK && different != g->mesh->vertex_count)
        return tetlodi_fail(g->error, TETLOD_ERR_MESH, "field %.60s has values at %u of %u points", field->name, different,
                            g->mesh->vertex_count);
    return status;
}

static enum tetlod_status read_node_data(struct gmsh *g)
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
    if (numbers[1] && (uint64_t)numbers[1] > (uint64_t)(g->rest.end - g->rest.at) / (g->mesh->vertex_count + 1u)) {
        status = fail(g, "the file ends too early for the values of this field; is it truncated?");
        goto done;
    }
    TETLOD_TRY_DONE(assemble_field(g->mesh, name, (uint64_t)numbers[1], TETLOD_FLOAT64, g->error));
    status = take_values(g, &g->mesh->fields[g->mesh->field_count - 1], numbers[2]);
done:
    free(name);
    return status;
}

/* ---- the whole */

static enum tetlod_status read_format(struct gmsh *g)
{
    double version;
    int64_t binary, size, one;
    if (!text_double(&g->rest, false, &version) || !text_int(&g->rest, &binary) || !text_int(&g->rest, &size))
        return fail(g, "$MeshFormat should be a version, 0 or 1, and 8");
    if ((version != 2.2 && version != 4.1) || size != 8)
        return fail(g, "only versions 2.2 and 4.1 of Gmsh's format are known; save the mesh as one of them");
    g->is_4 = version == 4.1;
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
                    {"$NodeData", read_node_data}};
    for (size_t s = 0; s < sizeof sections / sizeof *sections; s++)
        if (text_is(name, sections[s].name)) {
            TETLOD_TRY(sections[s].read(g));
            struct text end = text_word(&g->rest);
            if (end.end - end.at < 4 || memcmp(end.at, "$End", 4) != 0)
                return tetlodi_fail(g->error, TETLOD_ERR_MESH, "byte %td: section %.*s should end here",
                                    g->rest.at - g->begin, text_length(name), name.at);
            return TETLOD_OK;
        }
    g->report->skipped_arrays += text_is(name, "$ElementData") || text_is(name, "$ElementNodeData");
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
    return TETLOD_OK;
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
                     .report = report,
                     .error = error};
    enum tetlod_status status = read_all(&g);
    free(g.positions);
    tag_map_fini(&g.tags);
    return status;
}
