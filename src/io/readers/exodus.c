/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * Reading Exodus II: a netCDF file, classic or HDF5, with element blocks connect1, connect2, ... of one type each, and
 * variables of nodes (vals_nod_var1, ...) and of the elements of a block (vals_elem_var1eb1, ...) for each step in
 * time. "Small model" files hold all variables of nodes in one: vals_nod_var (step, variable, node). Variables become
 * vectors and tensors by their names, as VTK's reader joins them. The number of a block becomes the cell field
 * ObjectId, as VTK calls it. Sets of nodes and sides are skipped.
 *
 * Pieces that a parallel program has written are the files NAME.N.0 to NAME.N.(N-1): one of them stands for all. What
 * numbers their nodes and elements have in the whole mesh is in node_num_map and elem_num_map.
 */
#include <netcdf.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

#include "format/fail.h"
#include "src/io/services/contain.h"
#include "src/io/readers/readers.h"
#include "src/io/services/pieces.h"
#include "src/io/services/time_steps.h"
#include "src/util/array.h"

struct exodus {
    int file;
    uint64_t size; /* of the file */
    struct block *block;
    struct io_report *report;
    struct tetlod_error *error;
    uint64_t blocks, step;
    bool has_steps;
    bool is_piece; /* of several */
};

enum { MAX_NAME = 256, MAX_JOINED = 6 };

/* A field of variables that follow one another, and which component each of them is. */
struct joined {
    char name[MAX_NAME + 1];
    uint32_t width, places[MAX_JOINED];
};

struct variable {
    int id, rank;
    nc_type type;
    size_t dims[3];
};

static enum tetlod_status fail(const struct exodus *e, const char *what)
{
    return tetlodi_fail(e->error, TETLOD_ERR_MESH, "%s", what);
}

/* The length of a dimension, 0 if there is none of that name. */
static uint64_t dimension(const struct exodus *e, const char *name)
{
    int id;
    size_t length = 0;
    return nc_inq_dimid(e->file, name, &id) == NC_NOERR && nc_inq_dimlen(e->file, id, &length) == NC_NOERR ? length : 0;
}

/* False if there is none, or it has more dimensions than any of Exodus. */
static bool find_variable(const struct exodus *e, const char *name, struct variable *out)
{
    int dims[NC_MAX_VAR_DIMS];
    *out = (struct variable){0};
    if (nc_inq_varid(e->file, name, &out->id) != NC_NOERR ||
        nc_inq_varndims(e->file, out->id, &out->rank) != NC_NOERR || out->rank > 3 ||
        nc_inq_vardimid(e->file, out->id, dims) != NC_NOERR || nc_inq_vartype(e->file, out->id, &out->type) != NC_NOERR)
        return false;
    for (int d = 0; d < out->rank; d++)
        if (nc_inq_dimlen(e->file, dims[d], &out->dims[d]) != NC_NOERR)
            return false;
    return true;
}

/* Whether a file of this size can have so many values. */
static bool plausible(const struct exodus *e, uint64_t count)
{
    return count / 1100 <= e->size;
}

/* `count` values of a variable from start[...] on: one step, one row, all of the last dimension. */
static enum tetlod_status read_row(const struct exodus *e, const char *name, int rank, const size_t *start,
                                   uint64_t count, double *out,
                                   nc_type *type)
{
    struct variable variable;
    if (!find_variable(e, name, &variable) || variable.rank != rank || variable.dims[rank - 1] != count)
        return tetlodi_fail(e->error, TETLOD_ERR_MESH, "variable %.60s is missing, or is not of %llu values", name,
                            (unsigned long long)count);
    size_t size[3] = {1, 1, 1};
    size[rank - 1] = (size_t)count;
    if (type)
        *type = variable.type;
    if (count && nc_get_vara_double(e->file, variable.id, start, size, out) != NC_NOERR)
        return tetlodi_fail(e->error, TETLOD_ERR_MESH, "variable %.60s cannot be read; is the file damaged?", name);
    return TETLOD_OK;
}

static enum tetlod_status read_values(const struct exodus *e, const char *name, uint64_t count, double *out)
{
    const size_t start[1] = {0};
    return read_row(e, name, 1, start, count, out, NULL);
}

/* Text i of a list of names, cleaned; "" if there is none. */
static void read_name(const struct exodus *e, const char *list, size_t i, char out[MAX_NAME + 1])
{
    struct variable variable;
    out[0] = 0;
    if (!find_variable(e, list, &variable) || variable.rank != 2 || i >= variable.dims[0])
        return;
    size_t length = variable.dims[1] < MAX_NAME ? variable.dims[1] : MAX_NAME;
    const size_t start[2] = {i, 0}, size[2] = {1, length};
    if (nc_get_vara_text(e->file, variable.id, start, size, out) != NC_NOERR)
        length = 0;
    out[length] = 0;
    for (length = strlen(out); length && out[length - 1] == ' '; length--)
        out[length - 1] = 0;
}

/* ---- points */

static enum tetlod_status read_points(struct exodus *e)
{
    static const char *const names[3] = {"coordx", "coordy", "coordz"};
    struct variable variable;
    uint64_t count = dimension(e, "num_nodes");
    if (dimension(e, "num_dim") != 3)
        return fail(e, "is an Exodus file in other than three dimensions");
    if (!plausible(e, count))
        return fail(e, "num_nodes is more than the file can hold");
    bool apart = find_variable(e, names[0], &variable);
    if (!apart && (!find_variable(e, "coord", &variable) || variable.rank != 2 || variable.dims[0] != 3 ||
                   variable.dims[1] != count))
        return fail(e, "has no coordinates");
    bool is_double = variable.type != NC_FLOAT;
    for (size_t d = 1; d < 3 && apart; d++)
        is_double |= find_variable(e, names[d], &variable) && variable.type != NC_FLOAT;
    TETLOD_TRY(assemble_points(&e->block->mesh, count, is_double ? TETLOD_FLOAT64 : TETLOD_FLOAT32, e->error));
    double *axis = array_new((size_t)count, sizeof *axis);
    enum tetlod_status status = axis ? TETLOD_OK : tetlodi_fail_nomem(e->error, "the points", count * 8);
    for (size_t d = 0; d < 3 && status == TETLOD_OK; d++) {
        const size_t start[2] = {d, 0}, size[2] = {1, (size_t)count};
        if (apart)
            status = read_values(e, names[d], count, axis);
        else if (count && nc_get_vara_double(e->file, variable.id, start, size, axis) != NC_NOERR)
            status = fail(e, "its coordinates cannot be read");
        for (uint64_t p = 0; p < count && status == TETLOD_OK; p++)
            e->block->mesh.positions[3 * p + d] = axis[p];
    }
    free(axis);
    return status;
}

/* ---- cells */

struct element {
    const char *prefix;
    uint8_t points, vtk_type;
};

/* The beginnings of names, by which Exodus tells types; the number of points tells the order. */
static const struct element elements[] = {
    {"TET", 4, VTK_TYPE_TET},           {"TET", 8, VTK_TYPE_TET},           {"TET", 10, VTK_TYPE_TET10},
    {"TET", 11, VTK_TYPE_TET10},        {"TET", 14, VTK_TYPE_TET10},        {"TET", 15, VTK_TYPE_TET10},
    {"HEX", 8, VTK_TYPE_HEXAHEDRON},    {"HEX", 9, VTK_TYPE_HEXAHEDRON},    {"HEX", 20, VTK_TYPE_HEXAHEDRON20},
    {"HEX", 27, VTK_TYPE_HEXAHEDRON20}, {"WED", 6, VTK_TYPE_WEDGE},         {"WED", 15, VTK_TYPE_WEDGE15},
    {"WED", 16, VTK_TYPE_WEDGE15},      {"WED", 18, VTK_TYPE_WEDGE15},      {"WED", 20, VTK_TYPE_WEDGE15},
    {"WED", 21, VTK_TYPE_WEDGE15},      {"PYR", 5, VTK_TYPE_PYRAMID},       {"PYR", 13, VTK_TYPE_PYRAMID13},
    {"PYR", 14, VTK_TYPE_PYRAMID13},    {"PYR", 18, VTK_TYPE_PYRAMID13},    {"PYR", 19, VTK_TYPE_PYRAMID13},
};

/* The points of an element that VTK's type has: they come first. */
static size_t kept_points(unsigned char type)
{
    static const uint8_t counts[] = {
        [VTK_TYPE_TET] = 4,    [VTK_TYPE_HEXAHEDRON] = 8,    [VTK_TYPE_WEDGE] = 6,    [VTK_TYPE_PYRAMID] = 5,
        [VTK_TYPE_TET10] = 10, [VTK_TYPE_HEXAHEDRON20] = 20, [VTK_TYPE_WEDGE15] = 15, [VTK_TYPE_PYRAMID13] = 13};
    return counts[type];
}

static unsigned char find_element(const char *name, size_t points)
{
    for (size_t i = 0; i < sizeof elements / sizeof *elements; i++)
        if (strncasecmp(name, elements[i].prefix, 3) == 0 && elements[i].points == points)
            return elements[i].vtk_type;
    return VTK_TYPE_FLAT;
}

/* The type of a block's elements. */
static enum tetlod_status type_of(const struct exodus *e, const char *name, const struct variable *connect,
                                  unsigned char *out)
{
    char type_name[64] = "";
    size_t length = 0;
    if (nc_inq_attlen(e->file, connect->id, "elem_type", &length) == NC_NOERR && length < sizeof type_name)
        nc_get_att_text(e->file, connect->id, "elem_type", type_name);
    *out = find_element(type_name, connect->dims[1]);
    if (*out == VTK_TYPE_FLAT && (strncasecmp(type_name, "NSIDED", 6) == 0 || strncasecmp(type_name, "NFACED", 6) == 0))
        return tetlodi_fail(e->error, TETLOD_ERR_MESH, "variable %s: elements of type %.20s cannot be read", name,
                            type_name);
    return TETLOD_OK;
}

/* Elements by the numbers of their points, of which there are `points` each. */
static enum tetlod_status add_elements(struct exodus *e, unsigned char type, size_t points, const long long *numbers,
                                       size_t count)
{
    for (size_t c = 0; c < count; c++) {
        int64_t corners[27];
        for (size_t i = 0; i < points && i < 27; i++)
            corners[i] = point_from_one(numbers[c * points + i]);
        cells_middles_to_vtk(type, corners);
        TETLOD_TRY(cells_add(&e->block->cells, type, corners, kept_points(type), e->error));
    }
    return TETLOD_OK;
}

/* The elements of block b, part by part; none if it is empty. */
static enum tetlod_status read_block(struct exodus *e, uint64_t b, uint64_t *count)
{
    enum { PART = 1 << 16 };
    char name[40];
    unsigned char type;
    struct variable connect;
    snprintf(name, sizeof name, "connect%llu", (unsigned long long)b);
    *count = 0;
    if (!find_variable(e, name, &connect))
        return TETLOD_OK;
    uint64_t numbers = connect.rank == 2 ? (uint64_t)connect.dims[0] * connect.dims[1] : UINT64_MAX;
    if (connect.rank != 2 || connect.dims[1] > 1000 || !plausible(e, connect.dims[0]) || !plausible(e, numbers))
        return tetlodi_fail(e->error, TETLOD_ERR_MESH, "variable %s has more numbers than the file can hold", name);
    TETLOD_TRY(type_of(e, name, &connect, &type));
    size_t points = connect.dims[1], most = connect.dims[0] < PART ? connect.dims[0] : PART;
    long long *part = array_new(most * points, sizeof *part);
    enum tetlod_status status = part ? TETLOD_OK : tetlodi_fail_nomem(e->error, "the cells",
                                                                      (uint64_t)most * points * sizeof *part);
    for (size_t at = 0; at < connect.dims[0] && status == TETLOD_OK; at += PART) {
        const size_t start[2] = {at, 0}, size[2] = {connect.dims[0] - at < PART ? connect.dims[0] - at : PART, points};
        if (points && nc_get_vara_longlong(e->file, connect.id, start, size, part) != NC_NOERR)
            status = tetlodi_fail(e->error, TETLOD_ERR_MESH, "variable %s cannot be read; is the file damaged?", name);
        if (status == TETLOD_OK)
            status = add_elements(e, type, points, part, size[0]);
    }
    free(part);
    *count = connect.dims[0];
    return status;
}

/* A map of all nodes or elements to the numbers of the whole mesh; NULL if there is none. */
static enum tetlod_status read_map(const struct exodus *e, const char *name, uint64_t count, uint64_t **out)
{
    struct variable variable;
    const size_t start = 0, size = (size_t)count;
    if (!plausible(e, count) || !find_variable(e, name, &variable) || variable.rank != 1 || variable.dims[0] != count)
        return TETLOD_OK;
    long long *numbers = array_new(size, sizeof *numbers);
    *out = array_new(size, sizeof **out);
    enum tetlod_status status = numbers && *out ? TETLOD_OK : tetlodi_fail_nomem(e->error, name, count * 16);
    if (status == TETLOD_OK && count && nc_get_vara_longlong(e->file, variable.id, &start, &size, numbers) != NC_NOERR)
        status = tetlodi_fail(e->error, TETLOD_ERR_MESH, "variable %s cannot be read; is the file damaged?", name);
    for (size_t i = 0; i < size && status == TETLOD_OK; i++)
        (*out)[i] = (uint64_t)numbers[i];
    free(numbers);
    return status;
}

/* The numbers of a piece's nodes, and of the elements of those blocks that were read. */
static enum tetlod_status read_numbers(struct exodus *e, const uint64_t *counts)
{
    struct block *block = e->block;
    uint64_t *all = NULL, first = 0, at = 0;
    enum tetlod_status status = read_map(e, "node_num_map", block->mesh.vertex_count, &block->point_numbers);
    if (status == TETLOD_OK)
        status = read_map(e, "elem_num_map", dimension(e, "num_elem"), &all);
    if (status == TETLOD_OK && all)
        block->cell_numbers = array_new((size_t)block->cells.count, sizeof *all);
    if (status == TETLOD_OK && all && !block->cell_numbers)
        status = tetlodi_fail_nomem(e->error, "elem_num_map", block->cells.count * sizeof *all);
    for (uint64_t b = 0; b < e->blocks && block->cell_numbers; b++) {
        char name[40];
        snprintf(name, sizeof name, "num_el_in_blk%llu", (unsigned long long)(b + 1));
        for (uint64_t c = 0; c < counts[b]; c++)
            block->cell_numbers[at++] = first + c < dimension(e, "num_elem") ? all[first + c] : 0;
        first += dimension(e, name);
    }
    free(all);
    return status;
}

/* The numbers by which a file calls its blocks. */
static enum tetlod_status read_ids(const struct exodus *e, double *ids)
{
    struct variable property;
    for (uint64_t b = 0; b < e->blocks; b++)
        ids[b] = (double)(b + 1);
    return find_variable(e, "eb_prop1", &property) ? read_values(e, "eb_prop1", e->blocks, ids) : TETLOD_OK;
}

/* Is block b the one that is asked for, by its name or number, or are all? */
static bool is_wanted(const struct exodus *e, uint64_t b, double id, const char *wanted)
{
    char name[MAX_NAME + 1], number[32];
    if (!wanted)
        return true;
    read_name(e, "eb_names", (size_t)b, name);
    snprintf(number, sizeof number, "%.0f", id);
    return strcmp(name, wanted) == 0 || strcmp(number, wanted) == 0;
}

/* The elements of the blocks that are asked for, and their blocks' numbers; counts[b] stays 0 for others. */
static enum tetlod_status read_blocks(struct exodus *e, const char *wanted, const double *ids, uint64_t *counts)
{
    struct tetmesh *mesh = &e->block->mesh;
    bool found = false;
    e->report->names_blocks = true;
    for (uint64_t b = 0; b < e->blocks; b++)
        if (is_wanted(e, b, ids[b], wanted)) {
            found = true;
            TETLOD_TRY(read_block(e, b + 1, &counts[b]));
        }
    if (!found)
        return tetlodi_fail(e->error, TETLOD_ERR_MESH, "has no element block '%.60s'", wanted);
    TETLOD_TRY(assemble_cell_field(mesh, "ObjectId", 1, TETLOD_FLOAT64, e->block->cells.count, e->error));
    struct point_field *field = &mesh->cell_fields[mesh->cell_field_count - 1];
    double *at = field->values;
    field->is_integer = true;
    for (uint64_t b = 0; b < e->blocks; b++)
        for (uint64_t c = 0; c < counts[b]; c++)
            *at++ = ids[b];
    return TETLOD_OK;
}

/* ---- values */

/* Where variable `number` (from 1) at points, or in block b, is in the file. */
struct place {
    char name[80];
    int rank;
    size_t start[3];
};

static struct place place_of(const struct exodus *e, bool cell, uint64_t number, uint64_t b)
{
    struct place place = {.rank = 2, .start = {(size_t)e->step}};
    struct variable all;
    if (cell) {
        snprintf(place.name, sizeof place.name, "vals_elem_var%llueb%llu", (unsigned long long)number,
                 (unsigned long long)(b + 1));
    } else if (find_variable(e, "vals_nod_var", &all) && all.rank == 3 && number <= all.dims[1]) {
        place = (struct place){"vals_nod_var", 3, {(size_t)e->step, (size_t)number - 1, 0}};
    } else {
        snprintf(place.name, sizeof place.name, "vals_nod_var%llu", (unsigned long long)number);
    }
    return place;
}

/* Whether there is any such variable in the blocks that were read. */
static bool has_variable(const struct exodus *e, bool cell, uint64_t number, const uint64_t *counts)
{
    bool has = !cell || e->is_piece; // another piece may have it
    for (uint64_t b = 0; b < e->blocks && !has; b++) {
        struct variable variable;
        has = counts[b] && find_variable(e, place_of(e, cell, number, b).name, &variable);
    }
    return has;
}

/* The unit that one of the variables says, as an attribute that netCDF's conventions have. */
static void read_unit(const struct exodus *e, bool cell, uint64_t number, char unit[UNIT_SIZE])
{
    char text[2 * UNIT_SIZE];
    for (uint64_t b = 0; b < (cell ? e->blocks : 1) && !unit[0]; b++) {
        struct variable variable;
        nc_type type;
        size_t length;
        if (find_variable(e, place_of(e, cell, number, b).name, &variable) &&
            nc_inq_att(e->file, variable.id, "units", &type, &length) == NC_NOERR && type == NC_CHAR &&
            length < sizeof text && nc_get_att_text(e->file, variable.id, "units", text) == NC_NOERR)
            unit_set(unit, text, strnlen(text, length));
    }
}

/* Values of variable `number` (from 1) at points or of cells into every width-th double. A block that lacks it has
 * NaN. */
static enum tetlod_status read_variable(struct exodus *e, bool cell, uint64_t number, const uint64_t *counts,
                                        uint64_t rows,
                                        double *buffer, double *out, uint32_t width, enum tetlod_type *io_type)
{
    uint64_t at = 0;
    for (uint64_t b = 0; b < (cell ? e->blocks : 1); b++) {
        uint64_t count = cell ? counts[b] : rows;
        if (cell && count == 0)
            continue;
        nc_type type = NC_FLOAT;
        struct variable variable;
        const struct place place = place_of(e, cell, number, b);
        bool lacks = cell && !find_variable(e, place.name, &variable);
        double *values = width == 1 ? out + at : buffer;
        if (!lacks)
            TETLOD_TRY(read_row(e, place.name, place.rank, place.start, count, values, &type));
        for (uint64_t c = 0; c < count && (lacks || width > 1); c++)
            out[(at + c) * width] = lacks ? 0.0 / 0.0 : values[c];
        at += count;
        *io_type = type == NC_FLOAT ? *io_type : TETLOD_FLOAT64;
    }
    return TETLOD_OK;
}

/* Variables whose names differ in an ending, in either case, are components of one field. Those of vectors are in this
 * order, as VTK's reader wants them; those of symmetric tensors in any, and get the one that VTK and tetlod have, which
 * the names begin with. */
static const struct join {
    uint32_t count;
    bool any_order;
    const char *endings[9];
} joins[] = {{6, true, {"xx", "yy", "zz", "xy", "yz", "xz", "yx", "zy", "zx"}},
             {3, false, {"x", "y", "z"}},
             {2, false, {"x", "y"}}};

/* Which component has this ending; `count`: none. */
static uint32_t place_of_ending(const struct join *join, const char *ending)
{
    for (uint32_t k = 0; k < sizeof join->endings / sizeof *join->endings && join->endings[k]; k++)
        if (strcasecmp(ending, join->endings[k]) == 0)
            return k < join->count ? k : k - 3;
    return join->count;
}

static bool joins_to(const char names[MAX_JOINED][MAX_NAME + 1], const struct join *join, struct joined *out)
{
    size_t length = strlen(names[0]), ending = strlen(join->endings[0]), stem = length > ending ? length - ending : 0;
    uint32_t seen = 0;
    for (uint32_t d = 0; d < join->count; d++) {
        bool alike = stem && strlen(names[d]) == length && strncmp(names[d], names[0], stem) == 0;
        uint32_t place = alike ? place_of_ending(join, names[d] + stem) : join->count;
        if (place == join->count || (!join->any_order && place != d))
            return false;
        out->places[d] = place;
        seen |= 1u << place;
    }
    memcpy(out->name, names[0], stem);
    out->name[stem] = 0;
    out->width = join->count;
    return seen == (1u << join->count) - 1;
}

/* The field that begins with variable v (from 0) of `count`. */
static struct joined name_field(const struct exodus *e, const char *list, uint64_t v, uint64_t count)
{
    char names[MAX_JOINED][MAX_NAME + 1] = {{0}};
    struct joined field;
    for (size_t d = 0; d < MAX_JOINED && v + d < count; d++)
        read_name(e, list, (size_t)v + d, names[d]);
    for (size_t join = 0; join < sizeof joins / sizeof *joins; join++)
        if (joins_to(names, &joins[join], &field))
            return field;
    field = (struct joined){.width = 1};
    memcpy(field.name, names[0], sizeof names[0]);
    return field;
}

/* Adds the field that begins with variable v (from 0). */
static enum tetlod_status read_field(struct exodus *e, bool cell, uint64_t v, const struct joined *joined,
                                     const uint64_t *counts, uint64_t rows, double *buffer)
{
    const uint32_t width = joined->width;
    const char *name = joined->name;
    struct tetmesh *mesh = &e->block->mesh;
    enum tetlod_type type = TETLOD_FLOAT32;
    if (cell)
        TETLOD_TRY(assemble_cell_field(mesh, name, width, TETLOD_FLOAT64, rows, e->error));
    else
        TETLOD_TRY(assemble_field(mesh, name, width, TETLOD_FLOAT64, e->error));
    struct point_field *field = cell ? &mesh->cell_fields[mesh->cell_field_count -
                                                          1] : &mesh->fields[mesh->field_count - 1];
    for (uint32_t d = 0; d < width; d++)
        TETLOD_TRY(read_variable(e, cell, v + d + 1, counts, rows, buffer, field->values + joined->places[d],
                                 width, &type));
    field->type = type;
    read_unit(e, cell, v + 1, field->unit);
    return TETLOD_OK;
}

/* All variables of nodes or elements at the step. */
static enum tetlod_status read_fields(struct exodus *e, bool cell, const uint64_t *counts)
{
    const char *list = cell ? "name_elem_var" : "name_nod_var";
    uint64_t count = e->has_steps ? dimension(e, cell ? "num_elem_var" : "num_nod_var") : 0;
    uint64_t rows = cell ? e->block->cells.count : e->block->mesh.vertex_count;
    double *buffer = array_new((size_t)rows, sizeof *buffer);
    enum tetlod_status status = buffer ? TETLOD_OK : tetlodi_fail_nomem(e->error, "a variable", rows * 8);
    for (uint64_t v = 0; v < count && status == TETLOD_OK;) {
        const struct joined field = name_field(e, list, v, count);
        if (has_variable(e, cell, v + 1, counts))
            status = read_field(e, cell, v, &field, counts, rows, buffer);
        v += field.width;
    }
    free(buffer);
    return status;
}

static enum tetlod_status choose_step(struct exodus *e, const struct io_read_options *options)
{
    uint64_t count = dimension(e, "time_step");
    if (count == 0)
        return TETLOD_OK;
    if (!plausible(e, count))
        return fail(e, "time_step is more than the file can hold");
    double *times = array_zero((size_t)count, sizeof *times);
    struct variable variable;
    if (!times)
        return tetlodi_fail_nomem(e->error, "the steps", count * 8);
    enum tetlod_status status = find_variable(e, "time_whole", &variable) ? read_values(e, "time_whole", count,
                                                                                        times) : TETLOD_OK;
    if (status == TETLOD_OK)
        status = time_steps_pick(count, times, options, e->report, e->error);
    e->has_steps = true;
    e->step = e->report->step;
    free(times);
    return status;
}

static enum tetlod_status read_all(struct exodus *e, const struct io_read_options *options)
{
    e->blocks = dimension(e, "num_el_blk");
    if (e->blocks == 0 || e->blocks > 100000)
        return fail(e, "is a netCDF file without the element blocks of Exodus");
    uint64_t *counts = array_zero((size_t)e->blocks, sizeof *counts);
    double *ids = array_new((size_t)e->blocks, sizeof *ids);
    enum tetlod_status status = counts && ids ? read_points(e) : tetlodi_fail_nomem(e->error, "the blocks",
                                                                                    e->blocks * 16);
    if (status == TETLOD_OK)
        status = read_ids(e, ids);
    if (status == TETLOD_OK)
        status = read_blocks(e, options ? options->block : NULL, ids, counts);
    if (status == TETLOD_OK && e->is_piece)
        status = read_numbers(e, counts);
    if (status == TETLOD_OK)
        status = choose_step(e, options);
    if (status == TETLOD_OK)
        status = read_fields(e, false, NULL);
    if (status == TETLOD_OK)
        status = read_fields(e, true, counts);
    free(counts);
    free(ids);
    return status;
}

/* ---- files */

/* NAME.N.I, a piece of several: the length of NAME. N and I have as many digits. */
static bool is_piece(const char *path, size_t *name, unsigned *count, unsigned *digits)
{
    static const char all_digits[] = "0123456789";
    const char *end = path + strlen(path), *number = end, *total;
    while (number > path && strchr(all_digits, number[-1]))
        number--;
    *digits = (unsigned)(end - number);
    if (!*digits || *digits > 6 || number - path < (ptrdiff_t)*digits + 3 || number[-1] != '.')
        return false;
    total = number - 1 - *digits;
    *name = (size_t)(total - 1 - path);
    *count = (unsigned)strtoul(total, NULL, 10);
    return total[-1] == '.' && strspn(total, all_digits) == *digits && *count > 1 && strtoul(number, NULL, 10) < *count;
}

static enum tetlod_status read_file(struct blocks *out, const struct io_input *input, struct io_report *report,
                                    struct tetlod_error *error)
{
    struct exodus e = {.size = input->size, .report = report, .error = error};
    size_t name;
    unsigned count, digits;
    e.is_piece = is_piece(input->path, &name, &count, &digits);
    int result = nc_open(input->path, NC_NOWRITE, &e.file);
    if (result != NC_NOERR)
        return tetlodi_fail(error, TETLOD_ERR_MESH, "is damaged or truncated: %s", nc_strerror(result));
    enum tetlod_status status = blocks_add(out, &e.block, error);
    if (status == TETLOD_OK)
        status = read_all(&e, input->options);
    nc_close(e.file);
    return status;
}

/* The pieces that one of them belongs to. */
struct exodus_pieces {
    size_t name;
    unsigned count, digits;
};

static enum tetlod_status read_piece(void *opaque, uint32_t i, struct blocks *out, const struct io_input *input,
                                     struct io_report *report, struct tetlod_error *error)
{
    const struct exodus_pieces *of = opaque;
    char path[4200];
    struct tetlod_error inner = {0};
    struct opened_input opened;
    struct io_input piece = *input;
    snprintf(path, sizeof path, "%.*s.%u.%0*u", (int)of->name, input->path, of->count, (int)of->digits, i);
    enum tetlod_status status = io_input_open(&opened, &piece, path, &inner);
    piece.path = path;
    if (status == TETLOD_OK)
        status = contain_read(read_file, out, &piece, report, &inner);
    io_input_close(&opened);
    return status == TETLOD_OK ? status
                               : tetlodi_fail(error, status, "piece %u of %u: %.400s", i, of->count, inner.message);
}

/* Classic netCDF by its magic; in HDF5 files the names of Exodus are looked for. */
bool exodus_sniff(const unsigned char *bytes, size_t size)
{
    if (size < 8 || (memcmp(bytes, "CDF", 3) != 0 && memcmp(bytes, "\x89HDF\r\n\x1a\n", 8) != 0))
        return false;
    if (*bytes == 'C')
        return true;
    return sniff_holds(bytes, size, "num_el_blk");
}

enum tetlod_status exodus_read(struct blocks *out, const struct io_input *input, struct io_report *report,
                               struct tetlod_error *error)
{
    struct exodus_pieces of;
    if (!input->path)
        return tetlodi_fail(error, TETLOD_ERR_MESH, "is a netCDF file, which cannot be read from memory");
    if (!is_piece(input->path, &of.name, &of.count, &of.digits))
        return contain_read(read_file, out, input, report, error);
    return pieces_read(&(const struct piece_list){of.count, read_piece, &of}, out, input, report, error);
}
