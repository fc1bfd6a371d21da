/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * Reading EnSight Gold (ensight6.c has EnSight 6): a case names a geometry of parts and a file for each variable. A
 * part with cells that have volume is a block; others (surfaces, lines) are left out. Values come part by part and, of
 * cells, type by type. Values that are said to be undefined become NaN.
 */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "format/fail.h"
#include "src/io/readers/ensight_file.h"
#include "src/io/readers/ensight_words.h"
#include "src/io/readers/readers.h"
#include "src/util/array.h"

enum { NO_BLOCK = -1 };

/* Cells of one type in a part: `first` counts the part's cells. */
struct section {
    const struct ensight_element *element;
    bool is_ghost;
    uint64_t first, count;
};

struct part {
    int64_t number, block; /* block: its index, or NO_BLOCK */
    uint64_t points, cells;
    size_t first_section, section_end;
};

struct ensight {
    const struct io_input *input;
    struct io_report *report;
    struct tetlod_error *error;
    struct blocks *out;
    struct ensight_file *file;
    char line[ENSIGHT_LINE + 1]; /* the one that is next; empty: there is none */
    bool node_ids, element_ids, found;
    /* that a file of a variable can hold: bounds what a few numbers in a geometry can ask for */
    uint64_t most_values;
    struct part *parts;       /* owned */
    struct section *sections; /* owned */
    size_t part_count, part_capacity, section_count, section_capacity;
};

/* The next line that is not empty. */
static void next_line(struct ensight *e)
{
    while (ensight_line(e->file, e->line) && !*e->line)
        ;
}

static bool is_part_end(const struct ensight *e)
{
    return !*e->line || ensight_starts(e->line, "part") || ensight_starts(e->line, "END TIME STEP");
}

/* ---- cells */

/* The connectivity is one record; numbers count from 1. */
static enum tetlod_status read_corners(struct ensight *e, struct cells *cells, const struct ensight_element *element,
                                       uint64_t count)
{
    size_t width = element->corners;
    if (count > UINT64_MAX / width)
        return ensight_fail(e->file, "a count is too large");
    TETLOD_TRY(ensight_fits(e->file, count * width));
    uint32_t *corners = array_new((size_t)count, width * sizeof *corners);
    if (!corners)
        return tetlodi_fail_nomem(e->error, "the cells", count * width * sizeof *corners);
    enum tetlod_status status = ensight_points(e->file, count * width, corners);
    for (uint64_t c = 0; status == TETLOD_OK && c < count; c++)
        status = cells_add_numbers(cells, element->type, corners + c * width,
                                   element->type == VTK_TYPE_FLAT ? 0 : width, e->error);
    free(corners);
    return status;
}

/* `count` sizes of 1 and more, and their sum, which the file can hold; the caller frees them, also after a failure. */
static enum tetlod_status read_sizes(struct ensight *e, uint64_t count, int64_t **out, uint64_t *sum)
{
    TETLOD_TRY(ensight_fits(e->file, count));
    *sum = 0;
    *out = array_new((size_t)count, sizeof **out);
    if (!*out)
        return tetlodi_fail_nomem(e->error, "the polyhedra", count * sizeof **out);
    TETLOD_TRY(ensight_ints(e->file, count, *out));
    for (uint64_t i = 0; i < count; i++) {
        if ((*out)[i] < 1)
            return ensight_fail(e->file, "a polyhedron or polygon has a part without points");
        *sum += (uint64_t)(*out)[i];
        TETLOD_TRY(ensight_fits(e->file, *sum));
    }
    return TETLOD_OK;
}

static enum tetlod_status read_polygons(struct ensight *e, struct cells *cells, uint64_t count)
{
    int64_t *sizes = NULL;
    uint64_t corners;
    enum tetlod_status status = read_sizes(e, count, &sizes, &corners);
    if (status == TETLOD_OK)
        status = ensight_ints(e->file, corners, NULL);
    for (uint64_t c = 0; status == TETLOD_OK && c < count; c++)
        status = cells_add(cells, VTK_TYPE_FLAT, NULL, 0, e->error);
    free(sizes);
    return status;
}

/* One cell after the other as a face stream. */
static enum tetlod_status add_polyhedra(struct ensight *e, struct cells *cells, uint64_t count, const int64_t *faces,
                                        const int64_t *sides, const int64_t *corners)
{
    int64_t *stream = NULL;
    size_t capacity = 0;
    enum tetlod_status status = TETLOD_OK;
    for (uint64_t c = 0; c < count && status == TETLOD_OK; c++) {
        size_t size = 1;
        for (int64_t f = 0; f < faces[c] && status == TETLOD_OK; f++, sides++) {
            if (!ARRAY_RESERVE(stream, capacity, size + 1 + (size_t)*sides))
                status = tetlodi_fail_nomem(e->error, "the polyhedra", size * sizeof *stream);
            for (int64_t i = 0; status == TETLOD_OK && i < *sides; i++)
                stream[size + 1 + (size_t)i] = point_from_one(*corners++);
            if (status == TETLOD_OK)
                stream[size] = *sides;
            size += 1 + (size_t)*sides;
        }
        if (status != TETLOD_OK)
            break;
        stream[0] = faces[c];
        status = cells_add(cells, VTK_TYPE_POLYHEDRON, stream, size, e->error);
    }
    free(stream);
    return status;
}

static enum tetlod_status read_polyhedra(struct ensight *e, struct cells *cells, uint64_t count)
{
    int64_t *faces = NULL, *sides = NULL, *corners = NULL;
    uint64_t face_count, corner_count;
    enum tetlod_status status;
    TETLOD_TRY_DONE(read_sizes(e, count, &faces, &face_count));
    TETLOD_TRY_DONE(read_sizes(e, face_count, &sides, &corner_count));
    corners = array_new((size_t)corner_count, sizeof *corners);
    if (!corners)
        status = tetlodi_fail_nomem(e->error, "the polyhedra", corner_count * sizeof *corners);
    else
        status = ensight_ints(e->file, corner_count, corners);
    if (status == TETLOD_OK)
        status = add_polyhedra(e, cells, count, faces, sides, corners);
done:
    free(faces);
    free(sides);
    free(corners);
    return status;
}

static enum tetlod_status read_section(struct ensight *e, const struct ensight_element *element, bool is_ghost,
                                       struct block *block)
{
    uint64_t count = 0;
    if (!ARRAY_RESERVE(e->sections, e->section_capacity, e->section_count + 1))
        return tetlodi_fail_nomem(e->error, "the list of cells", e->section_count * sizeof *e->sections);
    TETLOD_TRY(ensight_count(e->file, &count));
    e->sections[e->section_count++] = (struct section){element, is_ghost, block->cells.count, count};
    if (e->element_ids)
        TETLOD_TRY(ensight_ints(e->file, count, NULL));
    if (count == 0)
        return TETLOD_OK;
    if (!element->varies)
        return read_corners(e, &block->cells, element, count);
    return element->corners == ENSIGHT_NSIDED ? read_polygons(e, &block->cells, count)
                                              : read_polyhedra(e, &block->cells, count);
}

/* ---- geometry */

/* A column of values into rows of `width`; `out` NULL: past it. */
static enum tetlod_status read_column(struct ensight *e, uint64_t count, double *out, size_t width)
{
    if (!out)
        return ensight_floats(e->file, count, NULL);
    TETLOD_TRY(ensight_fits(e->file, count));
    if (width == 1)
        return ensight_floats(e->file, count, out);
    double *column = array_new((size_t)count, sizeof *column);
    if (!column)
        return tetlodi_fail_nomem(e->error, "an array", count * sizeof *column);
    enum tetlod_status status = ensight_floats(e->file, count, column);
    for (uint64_t i = 0; status == TETLOD_OK && i < count; i++)
        out[i * width] = column[i];
    free(column);
    return status;
}

static enum tetlod_status read_positions(struct ensight *e, struct tetmesh *mesh, uint64_t count)
{
    TETLOD_TRY(ensight_fits(e->file, count));
    TETLOD_TRY(assemble_points(mesh, count, TETLOD_FLOAT32, e->error));
    for (int d = 0; d < 3 && count; d++)
        TETLOD_TRY(read_column(e, count, mesh->positions + d, 3));
    return TETLOD_OK;
}

static enum tetlod_status read_unstructured(struct ensight *e, struct block *block)
{
    uint64_t count = 0;
    bool is_ghost;
    TETLOD_TRY(ensight_count(e->file, &count));
    if (e->node_ids)
        TETLOD_TRY(ensight_ints(e->file, count, NULL));
    TETLOD_TRY(read_positions(e, &block->mesh, count));
    for (next_line(e); !is_part_end(e); next_line(e)) {
        const struct ensight_element *element = ensight_find_element(e->line, &is_ghost);
        if (!element)
            return ensight_fail(e->file, "there should be a type of elements here");
        TETLOD_TRY(read_section(e, element, is_ghost, block));
    }
    return TETLOD_OK;
}

static enum tetlod_status hide_ghosts(struct ensight *e, struct block *block, size_t first_section)
{
    bool any = false;
    for (size_t s = first_section; s < e->section_count; s++)
        any |= e->sections[s].is_ghost && e->sections[s].count;
    if (!any)
        return TETLOD_OK;
    double *flags = array_zero((size_t)block->cells.count, sizeof *flags);
    if (!flags)
        return tetlodi_fail_nomem(e->error, "the ghost cells", block->cells.count * sizeof *flags);
    for (size_t s = first_section; s < e->section_count; s++)
        for (uint64_t c = 0; e->sections[s].is_ghost && c < e->sections[s].count; c++)
            flags[e->sections[s].first + c] = 1;
    enum tetlod_status status = block_hide(block, flags, e->report, e->error);
    free(flags);
    return status;
}

/* Points along i, j, k; with `range` only those from one number to another of each. */
static enum tetlod_status read_dims(struct ensight *e, bool has_range, uint32_t dims[3], uint64_t *points)
{
    int64_t whole[3], range[6];
    TETLOD_TRY(ensight_ints(e->file, 3, whole));
    if (has_range)
        TETLOD_TRY(ensight_ints(e->file, 6, range));
    *points = 1;
    for (int d = 0; d < 3; d++) {
        int64_t n = has_range ? range[2 * d + 1] - range[2 * d] + 1 : whole[d];
        if (n < 1 || n > INT32_MAX || *points > TETLOD_NONE / (uint64_t)n)
            return ensight_fail(e->file, "the dimensions of a block do not fit");
        dims[d] = (uint32_t)n;
        *points *= (uint64_t)n;
    }
    return TETLOD_OK;
}

/* The points of a block that is not curvilinear: coordinates along each axis, or origin and spacing. */
static enum tetlod_status make_positions(struct ensight *e, struct block *block, uint64_t points, bool is_uniform)
{
    double *axes[3] = {NULL, NULL, NULL}, box[6] = {0};
    const uint32_t *dims = block->dims;
    enum tetlod_status status = TETLOD_OK;
    for (int i = 0; i < 2 && status == TETLOD_OK && is_uniform; i++)
        status = ensight_floats(e->file, 3, box + 3 * i);
    for (int d = 0; d < 3 && status == TETLOD_OK; d++) {
        axes[d] = array_new(dims[d], sizeof **axes);
        if (!axes[d])
            status = tetlodi_fail_nomem(e->error, "the coordinates", dims[d] * sizeof **axes);
        else if (!is_uniform)
            status = ensight_floats(e->file, dims[d], axes[d]);
        for (uint32_t i = 0; status == TETLOD_OK && is_uniform && i < dims[d]; i++)
            axes[d][i] = (double)(float)(box[d] + i * box[3 + d]);
    }
    if (status == TETLOD_OK)
        status = assemble_points(&block->mesh, points, TETLOD_FLOAT32, e->error);
    for (uint64_t i = 0; status == TETLOD_OK && i < points; i++) {
        double *p = block->mesh.positions + 3 * i;
        p[0] = axes[0][i % dims[0]];
        p[1] = axes[1][i / dims[0] % dims[1]];
        p[2] = axes[2][i / ((uint64_t)dims[0] * dims[1])];
    }
    for (int d = 0; d < 3; d++)
        free(axes[d]);
    return status;
}

/* Of each point 0 if it is blanked. */
static enum tetlod_status read_blanks(struct ensight *e, struct block *block, uint64_t points)
{
    TETLOD_TRY(ensight_fits(e->file, points));
    int64_t *values = array_new((size_t)points, sizeof *values);
    unsigned char *blank = array_new((size_t)points, 1);
    enum tetlod_status status = values && blank ? ensight_ints(e->file, points, values)
                                                : tetlodi_fail_nomem(e->error, "the blanked points", points * 9);
    for (uint64_t i = 0; status == TETLOD_OK && i < points; i++)
        blank[i] = values[i] == 0;
    if (status == TETLOD_OK && block_cell_count(block))
        status = block_hide_points(block, blank, e->report, e->error);
    free(values);
    free(blank);
    return status;
}

static enum tetlod_status read_ghost_flags(struct ensight *e, struct block *block, uint64_t cells)
{
    TETLOD_TRY(ensight_fits(e->file, cells));
    int64_t *values = array_new((size_t)cells, sizeof *values);
    double *flags = array_new((size_t)cells, sizeof *flags);
    enum tetlod_status status = values && flags ? ensight_ints(e->file, cells, values)
                                                : tetlodi_fail_nomem(e->error, "the ghost cells", cells * 16);
    for (uint64_t i = 0; status == TETLOD_OK && i < cells; i++)
        flags[i] = values[i] != 0;
    if (status == TETLOD_OK && cells)
        status = block_hide(block, flags, e->report, e->error);
    free(values);
    free(flags);
    return status;
}

static enum tetlod_status read_structured(struct ensight *e, struct block *block)
{
    char kind[ENSIGHT_LINE + 1];
    uint64_t points = 0;
    memcpy(kind, e->line, sizeof kind);
    TETLOD_TRY(read_dims(e, strstr(kind, "range") != NULL, block->dims, &points));
    uint64_t cells = block_cell_count(block);
    bool is_uniform = strstr(kind, "uniform") != NULL, is_rectilinear = strstr(kind, "rectilinear") != NULL;
    if ((is_uniform || is_rectilinear) && points > e->most_values)
        return ensight_fail(e->file, "a block has more points than any variable of the case has values");
    if (is_uniform || is_rectilinear)
        TETLOD_TRY(make_positions(e, block, points, is_uniform));
    else
        TETLOD_TRY(read_positions(e, &block->mesh, points));
    if (strstr(kind, "iblanked"))
        TETLOD_TRY(read_blanks(e, block, points));
    for (next_line(e); !is_part_end(e); next_line(e)) {
        if (ensight_starts(e->line, "ghost_flags"))
            TETLOD_TRY(read_ghost_flags(e, block, cells));
        else if (ensight_starts(e->line, "node_ids") || ensight_starts(e->line, "element_ids"))
            TETLOD_TRY(ensight_ints(e->file, ensight_starts(e->line, "node_ids") ? points : cells, NULL));
        else
            return ensight_fail(e->file, "there should be a part here");
    }
    return TETLOD_OK;
}

static bool has_volume(const struct block *block)
{
    for (uint64_t c = 0; c < block->cells.count; c++)
        if (!block->cells.types || block->cells.types[c] != VTK_TYPE_FLAT)
            return true;
    return block->dims[0] && block_cell_count(block) > 0;
}

/* Leaves a part out that has no volume, or is not the one that is asked for. */
static enum tetlod_status close_part(struct ensight *e, struct part *part, const char *name)
{
    const char *wanted = e->input->options ? e->input->options->block : NULL;
    struct block *block = &e->out->at[part->block];
    bool is_wanted = !wanted || strcmp(wanted, name) == 0, keeps = is_wanted && has_volume(block);
    e->found |= is_wanted;
    e->report->names_blocks = true;
    part->points = block->mesh.vertex_count;
    part->cells = block->dims[0] ? block_cell_count(block) : block->cells.count;
    if (keeps)
        return hide_ghosts(e, block, part->first_section);
    e->report->skipped_cells += is_wanted ? block->cells.count : 0;
    block_fini(block);
    e->out->count--;
    part->block = NO_BLOCK;
    return TETLOD_OK;
}

static enum tetlod_status read_part(struct ensight *e)
{
    char name[ENSIGHT_LINE + 1];
    struct block *block;
    struct part part = {.block = (int64_t)e->out->count, .first_section = e->section_count};
    if (e->part_count == 0)
        ensight_find_order(e->file);
    TETLOD_TRY(ensight_ints(e->file, 1, &part.number));
    ensight_line(e->file, name);
    next_line(e);
    TETLOD_TRY(blocks_add(e->out, &block, e->error));
    if (ensight_starts(e->line, "coordinates"))
        TETLOD_TRY(read_unstructured(e, block));
    else if (ensight_starts(e->line, "block"))
        TETLOD_TRY(read_structured(e, block));
    else
        return ensight_fail(e->file, "there should be 'coordinates' or 'block' here");
    part.section_end = e->section_count;
    TETLOD_TRY(close_part(e, &part, name));
    if (!ARRAY_RESERVE(e->parts, e->part_capacity, e->part_count + 1))
        return tetlodi_fail_nomem(e->error, "the list of parts", e->part_count * sizeof *e->parts);
    e->parts[e->part_count++] = part;
    return TETLOD_OK;
}

static enum tetlod_status skip_extents(struct ensight *e)
{
    char line[ENSIGHT_LINE + 1];
    if (e->file->kind != ENSIGHT_TEXT)
        return ensight_floats(e->file, 6, NULL);
    for (int i = 0; i < 3; i++) // of which neighbours may touch
        ensight_line(e->file, line);
    return TETLOD_OK;
}

static enum tetlod_status read_geometry(struct ensight *e, uint64_t step)
{
    TETLOD_TRY(ensight_seek(e->file, step));
    for (int i = 0; i < 2; i++)
        ensight_line(e->file, e->line); // descriptions
    next_line(e);
    if (!ensight_starts(e->line, "node id"))
        return ensight_fail(e->file, "there should be 'node id' here; is it a geometry of EnSight Gold?");
    e->node_ids = ensight_gives_ids(e->line);
    next_line(e);
    if (!ensight_starts(e->line, "element id"))
        return ensight_fail(e->file, "there should be 'element id' here");
    e->element_ids = ensight_gives_ids(e->line);
    next_line(e);
    if (ensight_starts(e->line, "extents")) {
        TETLOD_TRY(skip_extents(e));
        next_line(e);
    }
    while (ensight_starts(e->line, "part"))
        TETLOD_TRY(read_part(e));
    if (!is_part_end(e))
        return ensight_fail(e->file, "there should be 'part' here");
    const char *wanted = e->input->options ? e->input->options->block : NULL;
    return e->found || !wanted ? TETLOD_OK
                               : tetlodi_fail(e->error, TETLOD_ERR_MESH, "has no part '%.60s'", wanted);
}

/* ---- variables */

/* Values of some of the rows: their number, which rows from 1 on, then column after column. The others stay NaN. */
static enum tetlod_status read_partial(struct ensight *e, const struct ensight_variable *v, uint64_t rows, double *out)
{
    uint64_t count = 0;
    TETLOD_TRY(ensight_count(e->file, &count));
    if (count > rows)
        return ensight_fail(e->file, "it has values of more nodes or elements than the part has");
    int64_t *at = array_new((size_t)count, sizeof *at);
    double *column = array_new((size_t)count, sizeof *column);
    enum tetlod_status status =
        at && column ? ensight_ints(e->file, count, at) : tetlodi_fail_nomem(e->error, "a variable", count * 16);
    for (uint64_t i = 0; status == TETLOD_OK && i < count; i++)
        if (at[i] < 1 || (uint64_t)at[i] > rows)
            status = ensight_fail(e->file, "it has a value of a node or element that the part does not have");
    for (uint64_t i = 0; status == TETLOD_OK && out && i < rows * v->components; i++)
        out[i] = NAN;
    for (uint32_t c = 0; status == TETLOD_OK && c < v->components; c++) {
        status = ensight_floats(e->file, count, column);
        for (uint64_t i = 0; status == TETLOD_OK && out && i < count; i++)
            out[((uint64_t)at[i] - 1) * v->components + ensight_place(c, v->components)] = column[i];
    }
    free(at);
    free(column);
    return status;
}

/* The values of some rows: column after column. The line in front of them may say that one value stands for none, or
 * that only some rows have values. */
static enum tetlod_status read_values(struct ensight *e, const struct ensight_variable *v, uint64_t rows, double *out)
{
    double undefined = NAN;
    if (strstr(e->line, "partial"))
        return read_partial(e, v, rows, out);
    if (strstr(e->line, "undef"))
        TETLOD_TRY(ensight_floats(e->file, 1, &undefined));
    for (uint32_t c = 0; c < v->components && rows; c++)
        TETLOD_TRY(read_column(e, rows, out ? out + ensight_place(c, v->components) : NULL, v->components));
    for (uint64_t i = 0; out && !isnan(undefined) && i < rows * v->components; i++)
        out[i] = out[i] == undefined ? NAN : out[i];
    return TETLOD_OK;
}

static enum tetlod_status find_part(struct ensight *e, int64_t number, const struct part **out)
{
    for (size_t p = 0; p < e->part_count; p++)
        if (e->parts[p].number == number) {
            *out = &e->parts[p];
            return TETLOD_OK;
        }
    return ensight_fail(e->file, "it has values of a part that the geometry does not have");
}

static const struct section *find_section(const struct ensight *e, const struct part *part)
{
    bool is_ghost;
    const struct ensight_element *element = ensight_find_element(e->line, &is_ghost);
    for (size_t s = part->first_section; s < part->section_end; s++)
        if (e->sections[s].element == element && e->sections[s].is_ghost == is_ghost)
            return &e->sections[s];
    return NULL;
}

/* Room for the values of a part: of each or, of a partial variable, of some of its rows, which the geometry has. */
static enum tetlod_status add_field(struct ensight *e, const struct ensight_variable *v, const struct part *part,
                                    double **out)
{
    struct tetmesh *mesh = &e->out->at[part->block].mesh;
    uint64_t rows = v->cell ? part->cells : part->points;
    if (!strstr(e->line, "partial"))
        TETLOD_TRY(ensight_fits(e->file, rows * v->components));
    if (v->cell)
        TETLOD_TRY(assemble_cell_field(mesh, v->name, v->components, TETLOD_FLOAT32, rows, e->error));
    else
        TETLOD_TRY(assemble_field(mesh, v->name, v->components, TETLOD_FLOAT32, e->error));
    *out = v->cell ? mesh->cell_fields[mesh->cell_field_count - 1].values : mesh->fields[mesh->field_count - 1].values;
    return TETLOD_OK;
}

static enum tetlod_status read_part_values(struct ensight *e, const struct ensight_variable *v)
{
    int64_t number;
    const struct part *part = NULL;
    double *values = NULL;
    uint64_t done = 0;
    TETLOD_TRY(ensight_ints(e->file, 1, &number));
    TETLOD_TRY(find_part(e, number, &part));
    for (next_line(e); !is_part_end(e); next_line(e)) {
        const struct section *section = v->cell ? find_section(e, part) : NULL;
        if (!section && !ensight_starts(e->line, "block") && (v->cell || !ensight_starts(e->line, "coordinates")))
            return ensight_fail(e->file, "there should be a type of elements of this part here");
        uint64_t first = section ? section->first : 0, count = section   ? section->count
                                                               : v->cell ? part->cells
                                                                         : part->points;
        if (part->block != NO_BLOCK && !values)
            TETLOD_TRY(add_field(e, v, part, &values));
        TETLOD_TRY(read_values(e, v, count, values ? values + first * v->components : NULL));
        done += count;
    }
    return done >= (v->cell ? part->cells : part->points) ? TETLOD_OK
                                                          : ensight_fail(e->file,
                                                                         "a part has fewer values than elements or "
                                                                         "points");
}

static enum tetlod_status read_variable(struct ensight *e, const struct ensight_entry *entry)
{
    struct ensight_variable v;
    struct ensight_file file = {.kind = e->file->kind, .big_endian = e->file->big_endian};
    struct ensight_file *geometry = e->file;
    if (!ensight_find_variable(entry, &v)) {
        io_leave_out(e->report, &e->report->skipped_arrays, entry->name, strlen(entry->name));
        return TETLOD_OK;
    }
    e->file = &file;
    enum tetlod_status status = ensight_open(&file, e->input, entry->file, false, e->error);
    if (status == TETLOD_OK)
        status = ensight_seek(&file, entry->step);
    if (status == TETLOD_OK) {
        ensight_line(&file, e->line); // description
        for (next_line(e); status == TETLOD_OK && ensight_starts(e->line, "part");)
            status = read_part_values(e, &v);
        if (status == TETLOD_OK && !is_part_end(e))
            status = ensight_fail(&file, "there should be 'part' here");
    }
    ensight_close(&file);
    e->file = geometry;
    return status;
}

static uint64_t most_values(const struct io_input *input, const struct ensight_case *ensight)
{
    uint64_t most = 0;
    for (size_t v = 0; v < ensight->variable_count; v++) {
        struct tetlod_error ignored;
        struct file_input file;
        char *path = NULL;
        if (io_resolve(input, ensight->variables[v].file, &path, &ignored) == TETLOD_OK &&
            file_input_open(&file, path, &ignored) == TETLOD_OK) {
            most = file.size / 2 > most ? file.size / 2 : most; // a digit and a space
            file_input_close(&file);
        }
        free(path);
    }
    return most;
}

bool ensight_sniff(const unsigned char *bytes, size_t size)
{
    struct text text = {(const char *)bytes, (const char *)bytes + (size < 2048 ? size : 2048)};
    struct text word = text_word_past_comments(&text);
    return text_is(word, "FORMAT") && sniff_holds((const unsigned char *)text.at, (size_t)(text.end - text.at),
                                                  "ensight");
}

enum tetlod_status ensight_read(struct blocks *out, const struct io_input *input, struct io_report *report,
                                struct tetlod_error *error)
{
    struct ensight_case ensight;
    struct ensight_file file = {0};
    struct ensight e = {.input = input, .report = report, .error = error, .out = out, .file = &file};
    enum tetlod_status status;
    TETLOD_TRY_DONE(ensight_case_read(&ensight, input, report, error));
    if (!ensight.is_gold) {
        status = ensight6_read(out, &ensight, input, report, error);
        goto done;
    }
    e.most_values = most_values(input, &ensight);
    TETLOD_TRY_DONE(ensight_open(&file, input, ensight.model.file, true, error));
    status = read_geometry(&e, ensight.model.step);
    ensight_close(&file);
    for (size_t v = 0; v < ensight.variable_count && status == TETLOD_OK; v++)
        status = read_variable(&e, &ensight.variables[v]);
done:
    ensight_close(&file);
    free(e.parts);
    free(e.sections);
    ensight_case_fini(&ensight);
    return status;
}
