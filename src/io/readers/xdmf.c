/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * Reading XDMF 2 and 3: an XML file that tells of grids (topology, geometry, attributes) whose numbers are in its text,
 * in raw binary files or in HDF5 files beside it. Uniform grids, spatial collections and trees (blocks), temporal
 * collections (steps).
 */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

#include "format/fail.h"
#include "src/io/services/contain.h"
#include "src/io/readers/readers.h"
#include "src/io/services/time_steps.h"
#include "src/io/readers/xdmf_item.h"
#include "src/util/array.h"

struct xdmf {
    struct xdmf_source source;
    struct blocks *out;
    const struct io_input *input;
    struct io_report *report;
    struct tetlod_error *error;
    const struct xml_node **shapes; /* owned: topology and geometry of each block */
    size_t shape_count, shape_capacity; /* of blocks; of nodes */
};

static enum tetlod_status fail_at(const struct xdmf *x, const struct xml_node *node, const char *what)
{
    return tetlodi_fail(x->error, TETLOD_ERR_MESH, "line %llu: %s %s", (unsigned long long)node->line, node->name,
                        what);
}

static const char *attribute_of(const struct xml_node *node, const char *name, const char *older)
{
    const char *value = xml_attribute(node, name);
    value = value ? value : xml_attribute(node, older);
    return value ? value : "";
}

/* ---- cells */

struct topology {
    const char *name;
    uint8_t mixed, vtk_type, points; /* mixed: its number in a topology of mixed cells */
};

static const struct topology topologies[] = {
    {"Polyvertex", 1, VTK_TYPE_FLAT, 0},
    {"Polyline", 2, VTK_TYPE_FLAT, 0},
    {"Polygon", 3, VTK_TYPE_FLAT, 0},
    {"Triangle", 4, VTK_TYPE_FLAT, 3},
    {"Quadrilateral", 5, VTK_TYPE_FLAT, 4},
    {"Tetrahedron", 6, VTK_TYPE_TET, 4},
    {"Pyramid", 7, VTK_TYPE_PYRAMID, 5},
    {"Wedge", 8, VTK_TYPE_WEDGE, 6},
    {"Hexahedron", 9, VTK_TYPE_HEXAHEDRON, 8},
    {"Edge_3", 34, VTK_TYPE_FLAT, 3},
    {"Triangle_6", 36, VTK_TYPE_FLAT, 6},
    {"Quadrilateral_8", 37, VTK_TYPE_FLAT, 8},
    {"Tetrahedron_10", 38, VTK_TYPE_TET10, 10},
    {"Tet_10", 38, VTK_TYPE_TET10, 10},
    {"Pyramid_13", 39, VTK_TYPE_PYRAMID13, 13},
    {"Wedge_15", 40, VTK_TYPE_WEDGE15, 15},
    {"Wedge_18", 41, VTK_TYPE_WEDGE18, 18},
    {"Hexahedron_20", 48, VTK_TYPE_HEXAHEDRON20, 20},
    {"Hex_20", 48, VTK_TYPE_HEXAHEDRON20, 20},
    {"Hexahedron_27", 50, VTK_TYPE_HEXAHEDRON27, 27},
    {"Quad", 5, VTK_TYPE_FLAT, 4},
};

static const struct topology *find_topology(const char *name, int64_t mixed)
{
    for (size_t t = 0; t < sizeof topologies / sizeof *topologies; t++)
        if (name ? strcasecmp(topologies[t].name, name) == 0 : topologies[t].mixed == mixed)
            return &topologies[t];
    return NULL;
}

/* Cells one after the other: its type, for those without a fixed number of points that number, the points. */
static enum tetlod_status add_mixed(const struct xdmf *x, const struct xml_node *node, const uint32_t *numbers,
                                    uint64_t count,
                                    struct cells *cells)
{
    for (uint64_t at = 0; at < count;) {
        const struct topology *topology = find_topology(NULL, numbers[at++]);
        if (!topology)
            return fail_at(x, node, "has a type of cell that is not known");
        uint64_t points = topology->points;
        if (!points)
            points = at < count ? numbers[at++] : UINT64_MAX;
        if (points > count - at)
            return fail_at(x, node, "ends in the middle of a cell");
        bool flat = topology->vtk_type == VTK_TYPE_FLAT;
        TETLOD_TRY(cells_add_numbers(cells, topology->vtk_type, numbers + at, flat ? 0 : (size_t)points, x->error));
        at += points;
    }
    return TETLOD_OK;
}

/* Tetrahedra are taken over as they are. */
static enum tetlod_status add_uniform(const struct xdmf *x, const struct topology *topology, struct xdmf_item *item,
                                      struct cells *cells)
{
    uint64_t count = topology->points ? item->count / topology->points : 0;
    bool flat = topology->vtk_type == VTK_TYPE_FLAT;
    if (topology->vtk_type == VTK_TYPE_TET && count) {
        cells->connectivity = item->numbers;
        cells->count = count;
        cells->connectivity_count = 4 * count;
        item->numbers = NULL;
        return TETLOD_OK;
    }
    for (uint64_t c = 0; c < count; c++)
        TETLOD_TRY(cells_add_numbers(cells, topology->vtk_type, item->numbers + c * topology->points,
                                     flat ? 0 : topology->points, x->error));
    return TETLOD_OK;
}

/* The points along k, j, i of a structured topology. */
static enum tetlod_status take_dims(const struct xdmf *x, const struct xml_node *node, struct block *block)
{
    const char *value = attribute_of(node, "Dimensions", "NumberOfElements");
    struct text text = {value, value + strlen(value)};
    for (int d = 2; d >= 0; d--) {
        int64_t n;
        if (!text_int(&text, &n) || n < 1 || n > INT32_MAX)
            return fail_at(x, node, "should have three Dimensions");
        block->dims[d] = (uint32_t)n;
    }
    return TETLOD_OK;
}

static enum tetlod_status read_topology(const struct xdmf *x, const struct xml_node *node, struct block *block)
{
    const char *type = attribute_of(node, "TopologyType", "Type");
    if (strncasecmp(type, "3D", 2) == 0)
        return take_dims(x, node, block);
    const struct topology *topology = find_topology(type, 0);
    bool mixed = strcasecmp(type, "Mixed") == 0;
    const struct xml_node *child = xml_child(x->source.tree, node, "DataItem", NULL);
    struct xdmf_item item;
    if ((!topology && !mixed) || !child)
        return fail_at(x, node, "is of a type that cannot be read, or has no DataItem");
    TETLOD_TRY(xdmf_load(&x->source, child, true, &item, x->error));
    enum tetlod_status status = mixed ? add_mixed(x, node, item.numbers, item.count, &block->cells)
                                      : add_uniform(x, topology, &item, &block->cells);
    xdmf_item_fini(&item);
    return status;
}

/* ---- points */

/* Three items, of x, y and z at all points, or along the axes of a grid. */
static enum tetlod_status three_items(const struct xdmf *x, const struct xml_node *node, struct block *block, bool axes)
{
    struct xdmf_item items[3] = {{0}};
    const struct xml_node *child = NULL;
    enum tetlod_status status = TETLOD_OK;
    enum tetlod_type type = TETLOD_FLOAT32;
    uint64_t points = 1;
    for (int d = 0; d < 3 && status == TETLOD_OK; d++) {
        child = xml_child(x->source.tree, node, "DataItem", child);
        status = child ? xdmf_load(&x->source, child, false, &items[d], x->error)
                       : fail_at(x, node, "should have three DataItems");
        if (status == TETLOD_OK && axes && items[d].count != block->dims[d])
            status = fail_at(x, node, "has coordinates that do not match the Dimensions");
        if (status == TETLOD_OK && !axes && items[d].count != items[0].count)
            status = fail_at(x, node, "has different numbers of coordinates");
        points = axes && points < TETLOD_NONE ? points * items[d].count : points;
        type = items[d].type == TETLOD_FLOAT64 ? TETLOD_FLOAT64 : type;
    }
    points = axes ? points : items[0].count;
    if (status == TETLOD_OK)
        status = assemble_points(&block->mesh, points, type, x->error);
    for (uint64_t p = 0; p < points && status == TETLOD_OK; p++) {
        uint64_t at[3] = {p, p, p};
        if (axes) {
            at[0] = p % block->dims[0];
            at[1] = p / block->dims[0] % block->dims[1];
            at[2] = p / block->dims[0] / block->dims[1];
        }
        for (int d = 0; d < 3; d++)
            block->mesh.positions[3 * p + (uint64_t)d] = items[d].doubles[at[d]];
    }
    for (int d = 0; d < 3; d++)
        xdmf_item_fini(&items[d]);
    return status;
}

/* Origin and spacing, each along k, j, i. */
static enum tetlod_status origin_points(const struct xdmf *x, const struct xml_node *node, struct block *block)
{
    struct xdmf_item items[2] = {{0}};
    const struct xml_node *child = NULL;
    enum tetlod_status status = TETLOD_OK;
    uint64_t points = 1;
    for (int i = 0; i < 2 && status == TETLOD_OK; i++) {
        child = xml_child(x->source.tree, node, "DataItem", child);
        status = child ? xdmf_load(&x->source, child, false, &items[i], x->error)
                       : fail_at(x, node, "should have two DataItems");
        if (status == TETLOD_OK && items[i].count != 3)
            status = fail_at(x, node, "should have three numbers in each DataItem");
    }
    for (int d = 0; d < 3; d++)
        points = points < TETLOD_NONE ? points * block->dims[d] : points;
    if (status == TETLOD_OK)
        status = assemble_points(&block->mesh, points, TETLOD_FLOAT64, x->error);
    for (uint64_t p = 0; p < points && status == TETLOD_OK; p++) {
        const uint64_t at[3] = {p % block->dims[0], p / block->dims[0] % block->dims[1],
                                p / block->dims[0] / block->dims[1]};
        for (int d = 0; d < 3; d++)
            block->mesh.positions[3 * p + (uint64_t)d] =
                items[0].doubles[2 - d] + (double)at[d] * items[1].doubles[2 - d];
    }
    xdmf_item_fini(&items[0]);
    xdmf_item_fini(&items[1]);
    return status;
}

static enum tetlod_status read_geometry(const struct xdmf *x, const struct xml_node *node, struct block *block)
{
    const char *type = attribute_of(node, "GeometryType", "Type");
    const struct xml_node *child = xml_child(x->source.tree, node, "DataItem", NULL);
    struct xdmf_item item;
    if (strcasecmp(type, "X_Y_Z") == 0)
        return three_items(x, node, block, false);
    if (strcasecmp(type, "VXVYVZ") == 0)
        return three_items(x, node, block, true);
    if (strcasecmp(type, "ORIGIN_DXDYDZ") == 0)
        return origin_points(x, node, block);
    if ((*type && strcasecmp(type, "XYZ") != 0) || !child)
        return fail_at(x, node, "should be XYZ, X_Y_Z, VXVYVZ or ORIGIN_DXDYDZ with its DataItems");
    TETLOD_TRY(xdmf_load(&x->source, child, false, &item, x->error));
    enum tetlod_status status = item.count % 3 ? fail_at(x, node, "should have three numbers for each point")
                                               : assemble_points_of(&block->mesh, item.count / 3, &item.doubles,
                                                                    item.type, x->error);
    xdmf_item_fini(&item);
    return status;
}

/* ---- values */

/* The unit of an attribute: Units="..." at it, or Information in it of that name. */
static const char *unit_of(const struct xdmf *x, const struct xml_node *node)
{
    static const char *const names[] = {"Units", "Unit"};
    for (size_t i = 0; i < sizeof names / sizeof *names; i++) {
        const char *unit = xml_attribute(node, names[i]);
        const struct xml_node *child = NULL;
        while (!unit && (child = xml_child(x->source.tree, node, "Information", child)) != NULL) {
            const char *name = xml_attribute(child, "Name");
            unit = name && strcasecmp(name, names[i]) == 0 ? xml_attribute(child, "Value") : NULL;
        }
        if (unit)
            return unit;
    }
    return "";
}

static enum tetlod_status read_attribute(const struct xdmf *x, const struct xml_node *node, struct block *block)
{
    const char *centre = attribute_of(node, "Center", "Center"), *name = attribute_of(node, "Name", "Name");
    const struct xml_node *child = xml_child(x->source.tree, node, "DataItem", NULL);
    struct tetmesh *mesh = &block->mesh;
    bool cell = strcasecmp(centre, "Cell") == 0;
    uint64_t rows = cell ? block_cell_count(block) : mesh->vertex_count;
    struct xdmf_item item;
    if (strcasecmp(centre, "Grid") == 0) // of the mesh as a whole: no field
        return TETLOD_OK;
    if ((*centre && !cell && strcasecmp(centre, "Node") != 0) || !child || rows == 0) {
        io_leave_out(x->report, &x->report->skipped_arrays, name, strlen(name));
        return TETLOD_OK;
    }
    TETLOD_TRY(xdmf_load(&x->source, child, false, &item, x->error));
    uint64_t width = item.count / rows;
    enum tetlod_status status = TETLOD_OK;
    if (width == 0 || width * rows != item.count)
        status = tetlodi_fail(x->error, TETLOD_ERR_MESH, "line %llu: Attribute %.60s has %llu numbers for %llu %s",
                              (unsigned long long)node->line, name, (unsigned long long)item.count,
                              (unsigned long long)rows, cell ? "cells" : "points");
    if (status == TETLOD_OK)
        status = cell ? assemble_cell_field(mesh, name, width, item.type, rows, x->error)
                      : assemble_field(mesh, name, width, item.type, x->error);
    if (status == TETLOD_OK) {
        struct point_field *field = cell ? &mesh->cell_fields[mesh->cell_field_count -
                                                              1] : &mesh->fields[mesh->field_count - 1];
        field->is_integer = item.is_integer && values_are_whole(item.doubles, (size_t)item.count);
        const char *unit = unit_of(x, node);
        unit_set(field->unit, unit, strlen(unit));
        free(field->values);
        field->values = item.doubles;
        item.doubles = NULL;
    }
    xdmf_item_fini(&item);
    return status;
}

/* ---- grids */

/* A structured grid must have values at its points or cells, so that a small file cannot mean a large one. */
static enum tetlod_status check_dims(const struct xdmf *x, const struct xml_node *grid, const struct block *block)
{
    const struct xml_node *attribute = xml_child(x->source.tree, grid, "Attribute", NULL);
    const struct xml_node *child = attribute ? xml_child(x->source.tree, attribute, "DataItem", NULL) : NULL;
    struct xdmf_item item = {0};
    uint64_t points = 1;
    if (!child)
        return fail_at(x, grid, "is structured, but has no Attribute");
    TETLOD_TRY(xdmf_load(&x->source, child, false, &item, x->error));
    for (int d = 0; d < 3; d++)
        points = points < TETLOD_NONE ? points * block->dims[d] : points;
    bool fits = points / 8 <= item.count;
    xdmf_item_fini(&item);
    return fits ? TETLOD_OK : fail_at(x, grid, "has more points than its first Attribute has values for");
}

/* The block of that topology and geometry: grids that share both, as those of several functions do, are one. */
static enum tetlod_status find_block(struct xdmf *x, const struct xml_node *grid,
                                     const struct xml_node *const shape[2], struct block **out)
{
    for (size_t b = 0; b < x->shape_count; b++)
        if (x->shapes[2 * b] == shape[0] && x->shapes[2 * b + 1] == shape[1]) {
            *out = &x->out->at[b];
            return TETLOD_OK;
        }
    if (!ARRAY_RESERVE(x->shapes, x->shape_capacity, 2 * (x->shape_count + 1)))
        return tetlodi_fail_nomem(x->error, "the grids", 16);
    memcpy(x->shapes + 2 * x->shape_count++, shape, 2 * sizeof *shape);
    TETLOD_TRY(blocks_add(x->out, out, x->error));
    TETLOD_TRY(read_topology(x, shape[0], *out));
    if ((*out)->dims[0])
        TETLOD_TRY(check_dims(x, grid, *out));
    return read_geometry(x, shape[1], *out);
}

static enum tetlod_status read_uniform(struct xdmf *x, const struct xml_node *grid)
{
    const struct xml_tree *tree = x->source.tree;
    const struct xml_node *shape[2] = {xdmf_part(&x->source, grid, "Topology"),
                                       xdmf_part(&x->source, grid, "Geometry")};
    struct block *block;
    if (!shape[0] || !shape[1])
        return fail_at(x, grid, "should have a Topology and a Geometry");
    TETLOD_TRY(find_block(x, grid, shape, &block));
    for (const struct xml_node *a = NULL; (a = xml_child(tree, grid, "Attribute", a)) != NULL;)
        TETLOD_TRY(read_attribute(x, a, block));
    return TETLOD_OK;
}

static double time_of(const struct xdmf *x, const struct xml_node *grid, double otherwise)
{
    const struct xml_node *time = xml_child(x->source.tree, grid, "Time", NULL);
    const char *value = time ? xml_attribute(time, "Value") : NULL;
    struct text text = {value, value ? value + strlen(value) : NULL};
    double number;
    return value && text_double(&text, false, &number) ? number : otherwise;
}

static enum tetlod_status read_grid(struct xdmf *x, const struct xml_node *grid, bool chosen, unsigned depth);

/* The step of a collection that is asked for. */
static enum tetlod_status read_temporal(struct xdmf *x, const struct xml_node *grid, bool chosen, unsigned depth)
{
    const struct xml_tree *tree = x->source.tree;
    const struct xml_node *child = NULL;
    uint64_t count = 0;
    while ((child = xml_child(tree, grid, "Grid", child)) != NULL)
        count++;
    if (count == 0)
        return fail_at(x, grid, "has no steps");
    TETLOD_TRY(time_steps_pick(count, NULL, x->input->options, x->report, x->error));
    for (uint64_t s = 0; s <= x->report->step; s++)
        child = xml_child(tree, grid, "Grid", child);
    x->report->time = time_of(x, child, (double)x->report->step);
    return read_grid(x, child, chosen, depth + 1);
}

/* `chosen`: a grid that it is in is the one that is asked for. */
static enum tetlod_status read_grid(struct xdmf *x, const struct xml_node *grid, bool chosen, unsigned depth)
{
    enum { DEEPEST = 8 };
    const char *type = attribute_of(grid, "GridType", "Type"), *name = xml_attribute(grid, "Name");
    const char *wanted = x->input->options ? x->input->options->block : NULL;
    if (depth > DEEPEST)
        return fail_at(x, grid, "is nested too deep");
    chosen = chosen || !wanted || (name && strcmp(wanted, name) == 0);
    if (strcasecmp(type, "Collection") == 0 &&
        strcasecmp(attribute_of(grid, "CollectionType", "CollectionType"), "Temporal") == 0)
        return read_temporal(x, grid, chosen, depth);
    if (strcasecmp(type, "Collection") != 0 && strcasecmp(type, "Tree") != 0)
        return chosen ? read_uniform(x, grid) : TETLOD_OK;
    for (const struct xml_node *child = NULL; (child = xml_child(x->source.tree, grid, "Grid", child)) != NULL;)
        TETLOD_TRY(read_grid(x, child, chosen, depth + 1));
    return TETLOD_OK;
}

static enum tetlod_status read_document(struct blocks *out, const struct io_input *input, struct io_report *report,
                                        struct tetlod_error *error)
{
    struct xml_tree tree;
    struct xdmf x = {.source = {.tree = &tree, .input = input}, .out = out, .input = input, .report = report,
                     .error = error};
    enum tetlod_status status = xml_tree_parse(&tree, input->bytes, input->size, input->view, error);
    const struct xml_node *domain = NULL, *grid = NULL;
    report->names_blocks = true;
    if (status == TETLOD_OK && strcmp(tree.nodes[0].name, "Xdmf") == 0)
        domain = xml_child(&tree, &tree.nodes[0], "Domain", NULL);
    if (status == TETLOD_OK && !domain)
        status = tetlodi_fail(error, TETLOD_ERR_MESH, "has no Xdmf/Domain");
    while (status == TETLOD_OK && (grid = xml_child(&tree, domain, "Grid", grid)) != NULL)
        status = read_grid(&x, grid, false, 0);
    if (status == TETLOD_OK && out->count == 0)
        status = tetlodi_fail(error, TETLOD_ERR_MESH, "has no grid%s", input->options &&
                              input->options->block ? " of that name" : "");
    free(x.shapes);
    xml_tree_fini(&tree);
    return status;
}

bool xdmf_sniff(const unsigned char *bytes, size_t size)
{
    struct text text = {(const char *)bytes, (const char *)bytes + (size < 1024 ? size : 1024)};
    for (struct text word = text_word(&text); word.at != word.end; word = text_word(&text))
        if (word.end - word.at >= 5 && memcmp(word.at, "<Xdmf", 5) == 0)
            return true;
    return false;
}

enum tetlod_status xdmf_read(struct blocks *out, const struct io_input *input, struct io_report *report,
                             struct tetlod_error *error)
{
    return contain_read(read_document, out, input, report, error);
}
