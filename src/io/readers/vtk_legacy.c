/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * Reading legacy VTK, versions 1.0 to 5.1: a line of keyword and counts, then its data, and so on. In versions from 5.0
 * cells are two arrays, OFFSETS and CONNECTIVITY; before, each cell is its number of corners and these.
 */
#include <stdlib.h>
#include <string.h>

#include "format/fail.h"
#include "src/io/readers/readers.h"
#include "src/io/readers/vtk_data.h"
#include "src/util/array.h"

enum dataset { NO_DATASET, UNSTRUCTURED_GRID, STRUCTURED_GRID, RECTILINEAR_GRID, STRUCTURED_POINTS };
enum attributes { FIELD_DATA, POINT_DATA, CELL_DATA };

struct legacy {
    struct vtk_stream stream;
    struct block *block;
    struct tetmesh *mesh; /* the block's */
    struct io_report *report;
    struct tetlod_error *error;
    enum dataset dataset;
    enum attributes attributes;
    uint64_t tuples;
    int major_version;
    bool is_old_lagrange; /* before 5.1 */
    bool has_types; /* of cells */
    struct point_field *last; /* the field that was just read, to which metadata belong; or NULL */
    int64_t dims[3];
    double origin[3], spacing[3];
    double *coordinates[3]; /* owned: of a rectilinear grid */
    enum tetlod_type coordinate_type;
    int64_t coordinate_count[3];
};

static enum tetlod_status fail(const struct legacy *l, const char *why)
{
    return vtk_fail(&l->stream, l->error, "%s", why);
}

static enum tetlod_status take_count(const struct legacy *l, struct text *line, int64_t *out)
{
    return text_int(line, out) && *out >= 0 ? TETLOD_OK : fail(l, "there should be a count on this line");
}

static enum tetlod_status take_type(const struct legacy *l, struct text *line, enum value_type *out)
{
    struct vtk_array_type type;
    TETLOD_TRY(vtk_array_type(&l->stream, text_word(line), &type, l->error));
    *out = type.type;
    return type.kind == VTK_NUMBERS ? TETLOD_OK : fail(l, "this array should be of numbers");
}

static enum tetlod_type float_type(enum value_type type)
{
    return type == VALUE_FLOAT32 ? TETLOD_FLOAT32 : TETLOD_FLOAT64;
}

/* ---- geometry */

static enum tetlod_status on_dataset(struct legacy *l, struct text line)
{
    static const char *const names[] = {"", "UNSTRUCTURED_GRID", "STRUCTURED_GRID", "RECTILINEAR_GRID",
                                        "STRUCTURED_POINTS"};
    struct text word = text_word(&line);
    for (int d = UNSTRUCTURED_GRID; d <= STRUCTURED_POINTS; d++)
        if (text_is(word, names[d])) {
            l->dataset = (enum dataset)d;
            return TETLOD_OK;
        }
    return fail(l, "this kind of DATASET has no tetrahedra and no cells to split into them");
}

static enum tetlod_status on_dimensions(struct legacy *l, struct text line)
{
    for (int d = 0; d < 3; d++)
        TETLOD_TRY(take_count(l, &line, &l->dims[d]));
    return TETLOD_OK;
}

static enum tetlod_status take_vector(const struct legacy *l, struct text *line, double out[3])
{
    for (int d = 0; d < 3; d++)
        if (!text_double(line, false, &out[d]))
            return fail(l, "there should be three numbers on this line");
    return TETLOD_OK;
}

static enum tetlod_status on_origin(struct legacy *l, struct text line)
{
    return take_vector(l, &line, l->origin);
}

static enum tetlod_status on_spacing(struct legacy *l, struct text line)
{
    return take_vector(l, &line, l->spacing);
}

static enum tetlod_status on_points(struct legacy *l, struct text line)
{
    int64_t count;
    enum value_type type;
    TETLOD_TRY(take_count(l, &line, &count));
    TETLOD_TRY(take_type(l, &line, &type));
    if (l->mesh->positions)
        return fail(l, "there are POINTS a second time");
    if (count > INT64_MAX / 3)
        return fail(l, "there are more points than a file can hold");
    TETLOD_TRY(vtk_check_count(&l->stream, type, 3 * (uint64_t)count, l->error));
    TETLOD_TRY(assemble_points(l->mesh, (uint64_t)count, float_type(type), l->error));
    return vtk_doubles(&l->stream, type, 3 * (size_t)count, l->mesh->positions, l->error);
}

static enum tetlod_status take_coordinates(struct legacy *l, struct text line, int axis)
{
    int64_t count;
    enum value_type type;
    TETLOD_TRY(take_count(l, &line, &count));
    TETLOD_TRY(take_type(l, &line, &type));
    TETLOD_TRY(vtk_check_count(&l->stream, type, (uint64_t)count, l->error));
    if (l->coordinates[axis])
        return fail(l, "these coordinates are there a second time");
    if (type != VALUE_FLOAT32)
        l->coordinate_type = TETLOD_FLOAT64;
    l->coordinate_count[axis] = count;
    l->coordinates[axis] = array_new((size_t)count, sizeof **l->coordinates);
    if (!l->coordinates[axis])
        return tetlodi_fail_nomem(l->error, "the coordinates", (uint64_t)count * 8);
    return vtk_doubles(&l->stream, type, (size_t)count, l->coordinates[axis], l->error);
}

static enum tetlod_status on_x(struct legacy *l, struct text line)
{
    return take_coordinates(l, line, 0);
}

static enum tetlod_status on_y(struct legacy *l, struct text line)
{
    return take_coordinates(l, line, 1);
}

static enum tetlod_status on_z(struct legacy *l, struct text line)
{
    return take_coordinates(l, line, 2);
}

/* ---- cells */

static enum tetlod_status fail_twice(const struct legacy *l)
{
    return fail(l, "there are CELLS a second time");
}

/* Numbers of points, or counts between them, into a new array. */
static enum tetlod_status take_numbers(struct legacy *l, enum value_type type, uint64_t count, uint32_t **out)
{
    enum { CHUNK = 4096 };
    int64_t numbers[CHUNK];
    TETLOD_TRY(vtk_check_count(&l->stream, type, count, l->error));
    if (*out)
        return fail_twice(l);
    *out = array_new((size_t)count, sizeof **out);
    if (!*out)
        return tetlodi_fail_nomem(l->error, "the cells", count * sizeof **out);
    for (uint64_t done = 0; done < count;) {
        size_t some = count - done < CHUNK ? (size_t)(count - done) : CHUNK;
        TETLOD_TRY(vtk_ints(&l->stream, type, some, numbers, l->error));
        for (size_t i = 0; i < some; i++)
            (*out)[done + i] = cells_point(numbers[i]);
        done += some;
    }
    return TETLOD_OK;
}

static enum tetlod_status new_offsets(const struct legacy *l, uint64_t count)
{
    struct cells *cells = &l->block->cells;
    if (cells->offsets)
        return fail_twice(l);
    cells->offsets = array_zero((size_t)count + 1, sizeof *cells->offsets);
    return cells->offsets ? TETLOD_OK : tetlodi_fail_nomem(l->error, "the cells", count * 8);
}

/* Before 5.0: n corner-0 ... corner-(n-1) for each cell, `size` integers in all. */
static enum tetlod_status take_old_cells(struct legacy *l, int64_t count, int64_t size)
{
    struct cells *cells = &l->block->cells;
    uint64_t read = 0, kept = 0;
    if (count > size)
        return fail(l, "CELLS: the size is less than the number of cells");
    TETLOD_TRY(take_numbers(l, VALUE_INT32, (uint64_t)size, &cells->connectivity));
    TETLOD_TRY(new_offsets(l, (uint64_t)count));
    for (int64_t c = 0; c < count; c++) {
        uint64_t corners = read < (uint64_t)size ? cells->connectivity[read++] : UINT64_MAX;
        if (corners > (uint64_t)size - read)
            return tetlodi_fail(l->error, TETLOD_ERR_MESH, "cell %lld does not fit the size that CELLS gives",
                                (long long)c);
        cells->offsets[c] = kept;
        memmove(cells->connectivity + kept, cells->connectivity + read, (size_t)corners * sizeof *cells->connectivity);
        kept += corners;
        read += corners;
    }
    cells->offsets[count] = kept;
    cells->count = (uint64_t)count;
    cells->connectivity_count = kept;
    return TETLOD_OK;
}

/* The next line that is not blank; false at the end of the file. */
static bool next_line(struct legacy *l, struct text *line)
{
    while (l->stream.rest.at < l->stream.rest.end) {
        *line = text_line(&l->stream.rest);
        struct text look = *line, word = text_word(&look);
        if (word.at != word.end)
            return true;
    }
    return false;
}

static enum tetlod_status take_array_type(struct legacy *l, const char *name, enum value_type *type)
{
    struct text line;
    if (!next_line(l, &line) || !text_is(text_word(&line), name))
        return vtk_fail(&l->stream, l->error, "there should be %s here", name);
    return take_type(l, &line, type);
}

static enum tetlod_status take_new_cells(struct legacy *l, int64_t offsets, int64_t connectivity)
{
    struct cells *cells = &l->block->cells;
    enum value_type type;
    uint64_t count = offsets ? (uint64_t)offsets - 1 : 0;
    TETLOD_TRY(take_array_type(l, "OFFSETS", &type));
    TETLOD_TRY(vtk_check_count(&l->stream, type, (uint64_t)offsets, l->error));
    TETLOD_TRY(new_offsets(l, count));
    for (int64_t c = 0; c < offsets; c++) {
        int64_t offset;
        TETLOD_TRY(vtk_ints(&l->stream, type, 1, &offset, l->error));
        cells->offsets[c] = (uint64_t)offset; // a negative one is beyond every array
    }
    TETLOD_TRY(take_array_type(l, "CONNECTIVITY", &type));
    TETLOD_TRY(take_numbers(l, type, (uint64_t)connectivity, &cells->connectivity));
    cells->count = count;
    cells->connectivity_count = (uint64_t)connectivity;
    return TETLOD_OK;
}

static enum tetlod_status on_cells(struct legacy *l, struct text line)
{
    int64_t first, second;
    TETLOD_TRY(take_count(l, &line, &first));
    TETLOD_TRY(take_count(l, &line, &second));
    return l->major_version >= 5 ? take_new_cells(l, first, second) : take_old_cells(l, first, second);
}

static enum tetlod_status on_cell_types(struct legacy *l, struct text line)
{
    int64_t count, type;
    struct cells *cells = &l->block->cells;
    TETLOD_TRY(take_count(l, &line, &count));
    if ((uint64_t)count != cells->count || l->has_types)
        return fail(l, "CELL_TYPES: their number is not the number of cells");
    TETLOD_TRY(vtk_check_count(&l->stream, VALUE_INT32, (uint64_t)count, l->error));
    cells->types = array_new((size_t)count, 1);
    if (!cells->types)
        return tetlodi_fail_nomem(l->error, "the cells", (uint64_t)count);
    for (int64_t c = 0; c < count; c++) {
        TETLOD_TRY(vtk_ints(&l->stream, VALUE_INT32, 1, &type, l->error));
        cells->types[c] = (unsigned char)(type < 0 || type > 255 ? 255 : type);
    }
    cells_drop_types(cells);
    l->has_types = true;
    return TETLOD_OK;
}

/* ---- attributes */

static int hex_digit(char c)
{
    return c >= '0' && c <= '9'   ? c - '0'
           : c >= 'A' && c <= 'F' ? c - 'A' + 10
           : c >= 'a' && c <= 'f' ? c - 'a' + 10
                                  : -1;
}

/* Names are written with %XX for what would end a word. The caller frees it. */
static char *decode_name(struct text word)
{
    char *name = array_new((size_t)(word.end - word.at) + 1, 1), *out = name;
    for (const char *at = word.at; name && at < word.end; at++) {
        int high = *at == '%' && word.end - at > 2 ? hex_digit(at[1]) : -1, low = high >= 0 ? hex_digit(at[2]) : -1;
        *out++ = low >= 0 ? (char)(high << 4 | low) : *at;
        at += low >= 0 ? 2 : 0;
    }
    if (name)
        *out = 0;
    return name;
}

static uint64_t cell_tuples(const struct legacy *l)
{
    uint64_t count = 1;
    if (l->dataset == UNSTRUCTURED_GRID)
        return l->block->cells.count;
    for (int d = 0; d < 3; d++)
        count *= l->dims[d] > 1 ? (uint64_t)l->dims[d] - 1 : 1;
    return count;
}

static enum tetlod_status make_points(struct legacy *l);
static enum tetlod_status set_dims(struct legacy *l);

static enum tetlod_status read_values(struct legacy *l, struct text name, struct vtk_array_type type,
                                      uint64_t components)
{
    struct tetmesh *mesh = l->mesh;
    bool cell = l->attributes == CELL_DATA;
    char *decoded = decode_name(name);
    if (!decoded)
        return tetlodi_fail_nomem(l->error, "a field's name", (uint64_t)(name.end - name.at));
    bool ghosts = is_ghosts(decoded, components);
    enum tetlod_status status = cell ? assemble_cell_field(mesh, decoded, components, float_type(type.type), l->tuples,
                                                           l->error)
                                     : assemble_field(mesh, decoded, components, float_type(type.type), l->error);
    free(decoded);
    TETLOD_TRY(status);
    struct point_field *field = cell ? &mesh->cell_fields[mesh->cell_field_count -
                                                          1] : &mesh->fields[mesh->field_count - 1];
    TETLOD_TRY(vtk_doubles(&l->stream, type.type, (size_t)(l->tuples * components), field->values, l->error));
    field->is_integer = !value_is_float(type.type) && values_are_whole(field->values, (size_t)(l->tuples * components));
    l->last = ghosts ? NULL : field;
    if (ghosts && l->dataset != UNSTRUCTURED_GRID)
        TETLOD_TRY(set_dims(l)); // by which cells have points
    return ghosts ? block_take_ghosts(l->block, cell, l->report, l->error) : TETLOD_OK;
}

/* An array of the current attributes: numbers at points and of cells are read, all others are passed over. */
static enum tetlod_status take_attribute(struct legacy *l, struct text name, struct vtk_array_type type,
                                         int64_t components, uint64_t tuples)
{
    bool wanted = l->attributes != FIELD_DATA && type.kind == VTK_NUMBERS && components > 0;
    if (components < 0 || (components && tuples > UINT64_MAX / (uint64_t)components))
        return fail(l, "there are more values than a file can hold");
    uint64_t count = tuples * (uint64_t)components;
    l->last = NULL;
    if (wanted && tuples != l->tuples)
        return fail(l, l->attributes == POINT_DATA
                    ? "this point array has another number of values than there are points"
                                                   : "this cell array has another number of values than there are "
                                                     "cells");
    if (!wanted) {
        if (l->attributes != FIELD_DATA)
            io_leave_out(l->report, &l->report->skipped_arrays, name.at, (size_t)(name.end - name.at));
        return vtk_skip(&l->stream, type, count, l->error);
    }
    TETLOD_TRY(vtk_check_count(&l->stream, type.type, count, l->error));
    return read_values(l, name, type, (uint64_t)components);
}

static enum tetlod_status start_attributes(struct legacy *l, struct text line, enum attributes attributes)
{
    int64_t count;
    TETLOD_TRY(take_count(l, &line, &count));
    l->attributes = attributes;
    l->tuples = (uint64_t)count;
    return TETLOD_OK;
}

static enum tetlod_status on_point_data(struct legacy *l, struct text line)
{
    TETLOD_TRY(start_attributes(l, line, POINT_DATA));
    TETLOD_TRY(make_points(l));
    if (l->tuples != l->mesh->vertex_count)
        return vtk_fail(&l->stream, l->error, "POINT_DATA is for %llu points, but there are %u",
                        (unsigned long long)l->tuples, l->mesh->vertex_count);
    return TETLOD_OK;
}

static enum tetlod_status on_cell_data(struct legacy *l, struct text line)
{
    TETLOD_TRY(start_attributes(l, line, CELL_DATA));
    if (l->tuples != cell_tuples(l))
        return vtk_fail(&l->stream, l->error, "CELL_DATA is for %llu cells, but there are %llu",
                        (unsigned long long)l->tuples, (unsigned long long)cell_tuples(l));
    TETLOD_TRY(make_points(l));
    return l->dataset == UNSTRUCTURED_GRID ? TETLOD_OK : set_dims(l);
}

static enum tetlod_status on_scalars(struct legacy *l, struct text line)
{
    struct text name = text_word(&line), table = {0};
    struct vtk_array_type type;
    int64_t components = 1;
    TETLOD_TRY(vtk_array_type(&l->stream, text_word(&line), &type, l->error));
    if (text_word(&(struct text){line.at, line.end}).at != line.end)
        TETLOD_TRY(take_count(l, &line, &components));
    const char *before = l->stream.rest.at;
    if (!next_line(l, &table) || !text_is(text_word(&table), "LOOKUP_TABLE"))
        l->stream.rest.at = before; // some programs leave that line out
    return take_attribute(l, name, type, components, l->tuples);
}

/* NAME TYPE with a known number of components. */
static enum tetlod_status take_tuples(struct legacy *l, struct text line, int64_t components)
{
    struct text name = text_word(&line);
    struct vtk_array_type type;
    TETLOD_TRY(vtk_array_type(&l->stream, text_word(&line), &type, l->error));
    return take_attribute(l, name, type, components, l->tuples);
}

static enum tetlod_status on_vectors(struct legacy *l, struct text line)
{
    return take_tuples(l, line, 3);
}

static enum tetlod_status on_tensors(struct legacy *l, struct text line)
{
    return take_tuples(l, line, 9);
}

static enum tetlod_status on_symmetric_tensors(struct legacy *l, struct text line)
{
    return take_tuples(l, line, 6);
}

static enum tetlod_status on_ids(struct legacy *l, struct text line)
{
    return take_tuples(l, line, 1);
}

static enum tetlod_status on_texture(struct legacy *l, struct text line)
{
    struct text name = text_word(&line);
    struct vtk_array_type type;
    int64_t components;
    TETLOD_TRY(take_count(l, &line, &components));
    TETLOD_TRY(vtk_array_type(&l->stream, text_word(&line), &type, l->error));
    return take_attribute(l, name, type, components, l->tuples);
}

/* Colours: bytes in binary files, fractions of 1 in text. */
static enum tetlod_status on_color_scalars(struct legacy *l, struct text line)
{
    struct text name = text_word(&line);
    int64_t components;
    TETLOD_TRY(take_count(l, &line, &components));
    struct vtk_array_type type = {VTK_NUMBERS, l->stream.binary ? VALUE_UINT8 : VALUE_FLOAT32};
    return take_attribute(l, name, type, components, l->tuples);
}

static enum tetlod_status on_lookup_table(struct legacy *l, struct text line)
{
    int64_t entries;
    text_word(&line);
    TETLOD_TRY(take_count(l, &line, &entries));
    if (entries > INT64_MAX / 4)
        return fail(l, "there are more values than a file can hold");
    return vtk_skip(&l->stream, (struct vtk_array_type){VTK_NUMBERS, VALUE_UINT8}, 4 * (uint64_t)entries, l->error);
}

static enum tetlod_status take_unit(struct legacy *l, struct text word)
{
    char *unit = decode_name(word);
    if (!unit)
        return tetlodi_fail_nomem(l->error, "a unit", (uint64_t)(word.end - word.at));
    unit_set(l->last->unit, unit, strlen(unit));
    free(unit);
    return TETLOD_OK;
}

static enum tetlod_status on_metadata(struct legacy *l, struct text line)
{
    bool is_unit = false;
    struct text word;
    do { // up to a blank line
        line = text_line(&l->stream.rest);
        word = text_word(&line);
        if (text_is(word, "NAME"))
            is_unit = l->last && text_is(text_word(&line), "UNITS_LABEL");
        else if (is_unit && text_is(word, "DATA"))
            TETLOD_TRY(take_unit(l, text_word(&line)));
    } while (word.at != word.end && l->stream.rest.at < l->stream.rest.end);
    return TETLOD_OK;
}

static enum tetlod_status on_field(struct legacy *l, struct text line)
{
    int64_t arrays;
    text_word(&line);
    TETLOD_TRY(take_count(l, &line, &arrays));
    while (arrays > 0) {
        int64_t components, tuples;
        struct vtk_array_type type;
        if (!next_line(l, &line))
            return fail(l, "the file ends too early; is it truncated?");
        struct text name = text_word(&line);
        if (text_is(name, "METADATA")) {
            TETLOD_TRY(on_metadata(l, line));
            continue;
        }
        TETLOD_TRY(take_count(l, &line, &components));
        TETLOD_TRY(take_count(l, &line, &tuples));
        TETLOD_TRY(vtk_array_type(&l->stream, text_word(&line), &type, l->error));
        TETLOD_TRY(take_attribute(l, name, type, components, (uint64_t)tuples));
        arrays--;
    }
    return TETLOD_OK;
}

/* ---- the whole */

static const struct {
    const char *name;
    enum tetlod_status (*run)(struct legacy *l, struct text line);
} keywords[] = {
    {"DATASET", on_dataset},           {"DIMENSIONS", on_dimensions},
    {"ORIGIN", on_origin},             {"SPACING", on_spacing},
    {"ASPECT_RATIO", on_spacing},      {"POINTS", on_points},
    {"X_COORDINATES", on_x},           {"Y_COORDINATES", on_y},
    {"Z_COORDINATES", on_z},           {"CELLS", on_cells},
    {"CELL_TYPES", on_cell_types},     {"POINT_DATA", on_point_data},
    {"CELL_DATA", on_cell_data},       {"SCALARS", on_scalars},
    {"VECTORS", on_vectors},           {"NORMALS", on_vectors},
    {"TENSORS", on_tensors},           {"TENSORS6", on_symmetric_tensors},
    {"GLOBAL_IDS", on_ids},            {"PEDIGREE_IDS", on_ids},
    {"TEXTURE_COORDINATES", on_texture}, {"COLOR_SCALARS", on_color_scalars},
    {"LOOKUP_TABLE", on_lookup_table}, {"METADATA", on_metadata},
    {"FIELD", on_field},
};

static enum tetlod_status run_line(struct legacy *l, struct text line)
{
    struct text word = text_word(&line);
    for (size_t k = 0; k < sizeof keywords / sizeof *keywords; k++)
        if (text_is(word, keywords[k].name)) {
            if (l->dataset == NO_DATASET && keywords[k].run != on_dataset && keywords[k].run != on_field)
                return fail(l, "the DATASET line is missing");
            return keywords[k].run(l, line);
        }
    return vtk_fail(&l->stream, l->error, "unknown keyword '%.*s'", text_length(word), word.at);
}

static bool grid_points(const struct legacy *l, uint64_t *out)
{
    *out = 1;
    for (int d = 0; d < 3; d++) {
        if (l->dims[d] < 1 || (uint64_t)l->dims[d] > TETLOD_NONE / *out)
            return false;
        *out *= (uint64_t)l->dims[d];
    }
    return true;
}

/* Of grids whose points are not in the file. Their number is bounded by the data that follows, of points or of cells,
 * which are at least an eighth as many. */
static enum tetlod_status make_points(struct legacy *l)
{
    uint64_t count;
    bool implicit = l->dataset == RECTILINEAR_GRID || l->dataset == STRUCTURED_POINTS;
    if (l->mesh->positions || !implicit)
        return TETLOD_OK;
    if (!grid_points(l, &count))
        return fail(l, "DIMENSIONS should be three numbers of points from 1 on, and their product below 2^32");
    TETLOD_TRY(vtk_check_count(&l->stream, VALUE_UINT8, count / 8, l->error));
    for (int d = 0; d < 3 && l->dataset == RECTILINEAR_GRID; d++)
        if (!l->coordinates[d] || l->coordinate_count[d] != l->dims[d])
            return tetlodi_fail(l->error, TETLOD_ERR_MESH, "the number of %c coordinates is not that of DIMENSIONS",
                                "XYZ"[d]);
    TETLOD_TRY(assemble_points(l->mesh, count,
                               l->dataset == RECTILINEAR_GRID ? l->coordinate_type : TETLOD_FLOAT64, l->error));
    double *p = l->mesh->positions;
    int64_t at[3];
    for (at[2] = 0; at[2] < l->dims[2]; at[2]++)
        for (at[1] = 0; at[1] < l->dims[1]; at[1]++)
            for (at[0] = 0; at[0] < l->dims[0]; at[0]++)
                for (int d = 0; d < 3; d++)
                    *p++ = l->dataset == RECTILINEAR_GRID ? l->coordinates[d][at[d]]
                                                          : l->origin[d] + (double)at[d] * l->spacing[d];
    return TETLOD_OK;
}

static enum tetlod_status set_dims(struct legacy *l)
{
    uint64_t count;
    if (!grid_points(l, &count) || count != l->mesh->vertex_count)
        return tetlodi_fail(l->error, TETLOD_ERR_MESH, "the number of points is not that of DIMENSIONS; is the file "
                                                       "truncated?");
    for (int d = 0; d < 3; d++)
        l->block->dims[d] = (uint32_t)l->dims[d];
    return TETLOD_OK;
}

static enum tetlod_status finish_cells(struct legacy *l)
{
    if (l->dataset != UNSTRUCTURED_GRID)
        return set_dims(l);
    if (!l->has_types && l->block->cells.count)
        return tetlodi_fail(l->error, TETLOD_ERR_MESH, "CELL_TYPES are missing; is the file truncated?");
    if (l->is_old_lagrange)
        cells_renew_lagrange(&l->block->cells);
    return TETLOD_OK;
}

static const char magic[] = "# vtk DataFile Version ";

bool vtk_sniff(const unsigned char *bytes, size_t size)
{
    return size >= sizeof magic - 1 && memcmp(bytes, magic, sizeof magic - 1) == 0;
}

static enum tetlod_status read_header(struct legacy *l)
{
    struct text line = text_line(&l->stream.rest), mode;
    line.at += line.end - line.at >= (ptrdiff_t)sizeof magic ? sizeof magic - 1 : 0;
    l->major_version = line.at < line.end && *line.at >= '0' && *line.at <= '9' ? *line.at - '0' : 0;
    if (l->major_version < 1 || l->major_version > 5)
        return fail(l, "only versions 1.0 to 5.1 of legacy VTK are known");
    l->is_old_lagrange = l->major_version < 5 || (line.end - line.at >= 3 && memcmp(line.at, "5.0", 3) == 0);
    text_line(&l->stream.rest); // the title
    if (!next_line(l, &mode))
        return fail(l, "the file ends too early; is it truncated?");
    struct text word = text_word(&mode);
    l->stream.binary = text_is(word, "BINARY");
    if (!l->stream.binary && !text_is(word, "ASCII"))
        return fail(l, "the line before should be ASCII or BINARY");
    return TETLOD_OK;
}

static enum tetlod_status read_all(struct legacy *l)
{
    struct text line;
    TETLOD_TRY(read_header(l));
    while (next_line(l, &line))
        TETLOD_TRY(run_line(l, line));
    if (l->dataset == NO_DATASET)
        return fail(l, "the file ends without a DATASET; is it truncated?");
    if (!l->mesh->positions)
        return fail(l, l->dataset == RECTILINEAR_GRID || l->dataset == STRUCTURED_POINTS
                           ? "there is neither POINT_DATA nor CELL_DATA"
                           : "there are no POINTS");
    return finish_cells(l);
}

enum tetlod_status vtk_read(struct blocks *out, const struct io_input *input, struct io_report *report,
                            struct tetlod_error *error)
{
    struct block *block;
    TETLOD_TRY(blocks_add(out, &block, error));
    struct tetmesh *mesh = &block->mesh;
    const char *begin = (const char *)input->bytes;
    struct legacy l = {.stream = {begin, {begin, begin + input->size}, false, input->view},
                       .mesh = mesh,
                       .block = block,
                       .report = report,
                       .error = error,
                       .spacing = {1, 1, 1}};
    enum tetlod_status status = read_all(&l);
    for (int d = 0; d < 3; d++)
        free(l.coordinates[d]);
    return status;
}
