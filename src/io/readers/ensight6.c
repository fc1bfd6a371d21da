/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * Reading EnSight 6, of which a case says "type: ensight". It differs from EnSight Gold in this: one list of nodes for
 * all unstructured parts, numbers in fixed columns that may touch, the connectivity in the numbers that the file gives
 * its nodes, and values of vectors node by node. The unstructured parts make one block, each structured part one of its
 * own.
 */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include "format/fail.h"
#include "src/io/readers/ensight_file.h"
#include "src/io/readers/ensight_words.h"
#include "src/io/services/tag_map.h"
#include "src/util/array.h"

/* Elements of one type in a part: `first` counts the cells of the block, which has them if the part is wanted. */
struct section {
    int64_t part;
    const struct ensight_element *element;
    uint64_t first, count;
    bool is_wanted;
};

/* A structured part: a block, or NO_BLOCK. */
enum { NO_BLOCK = -1 };

struct grid_part {
    int64_t part, block;
    uint64_t points, cells;
};

struct six {
    const struct io_input *input;
    struct io_report *report;
    struct tetlod_error *error;
    struct blocks *out;
    size_t nodes_block; /* which of them has the nodes */
    struct ensight_file *file;
    char line[ENSIGHT_LINE + 1]; /* the one that is next; empty: there is none */
    bool node_ids, element_ids, found;
    struct tag_map nodes;
    struct section *sections; /* owned */
    struct grid_part *grids;  /* owned */
    size_t section_count, section_capacity, grid_count, grid_capacity;
};

static void next_line(struct six *s)
{
    while (ensight_line(s->file, s->line) && !*s->line)
        ;
}

static bool is_part_end(const struct six *s)
{
    return !*s->line || ensight_starts(s->line, "part") || ensight_starts(s->line, "END TIME STEP");
}

/* ---- nodes */

static enum tetlod_status add_node(struct six *s, int64_t number)
{
    return tag_map_add(&s->nodes, number, s->error);
}

/* Text has the number and the place of a node on one line; binary files all numbers, then all places. */
static enum tetlod_status read_nodes_of(struct six *s, uint64_t count, int64_t *numbers, double *positions)
{
    bool is_text = s->file->kind == ENSIGHT_TEXT;
    for (uint64_t v = 0; is_text && v < count; v++) {
        if (s->node_ids)
            TETLOD_TRY(ensight_ints(s->file, 1, &numbers[v]));
        TETLOD_TRY(ensight_floats(s->file, 3, positions + 3 * v));
    }
    if (!is_text && s->node_ids)
        TETLOD_TRY(ensight_ints(s->file, count, numbers));
    if (!is_text)
        TETLOD_TRY(ensight_floats(s->file, 3 * count, positions));
    for (uint64_t v = 0; v < count; v++)
        TETLOD_TRY(add_node(s, s->node_ids ? numbers[v] : (int64_t)v + 1));
    return tag_map_sort(&s->nodes, s->error);
}

static enum tetlod_status read_nodes(struct six *s)
{
    uint64_t count = 0;
    struct block *block;
    ensight_find_order(s->file);
    TETLOD_TRY(ensight_count(s->file, &count));
    TETLOD_TRY(ensight_fits(s->file, count));
    TETLOD_TRY(blocks_add(s->out, &block, s->error));
    TETLOD_TRY(assemble_points(&block->mesh, count, TETLOD_FLOAT32, s->error));
    int64_t *numbers = s->node_ids ? array_new((size_t)count, sizeof *numbers) : NULL;
    if (s->node_ids && !numbers)
        return tetlodi_fail_nomem(s->error, "the numbers of the points", count * sizeof *numbers);
    enum tetlod_status status = count ? read_nodes_of(s, count, numbers, block->mesh.positions) : TETLOD_OK;
    free(numbers);
    return status;
}

/* ---- elements */

/* The points of one element in the file's numbers, as the block has them. */
static enum tetlod_status add_cell(struct six *s, const struct section *section, const int64_t *corners)
{
    uint32_t points[20];
    size_t width = section->element->corners;
    if (!section->is_wanted)
        return TETLOD_OK;
    for (size_t i = 0; i < width; i++)
        points[i] = tag_map_find(&s->nodes, corners[i]);
    return cells_add_numbers(&s->out->at[s->nodes_block].cells, section->element->type, points,
                             section->element->type == VTK_TYPE_FLAT ? 0 : width, s->error);
}

static enum tetlod_status read_corners(struct six *s, const struct section *section, int64_t *corners)
{
    size_t width = section->element->corners, step = width + 1;
    uint64_t count = section->count;
    bool is_text = s->file->kind == ENSIGHT_TEXT;
    for (uint64_t c = 0; is_text && c < count; c++) {
        TETLOD_TRY(ensight_ints(s->file, s->element_ids ? step : width, corners));
        TETLOD_TRY(add_cell(s, section, corners + s->element_ids));
    }
    if (is_text)
        return TETLOD_OK;
    if (s->element_ids)
        TETLOD_TRY(ensight_ints(s->file, count, NULL));
    TETLOD_TRY(ensight_ints(s->file, count * width, corners));
    for (uint64_t c = 0; c < count; c++)
        TETLOD_TRY(add_cell(s, section, corners + c * width));
    return TETLOD_OK;
}

static enum tetlod_status read_section(struct six *s, int64_t part, bool is_wanted)
{
    bool is_ghost;
    const struct ensight_element *element = ensight_find_element(s->line, &is_ghost);
    uint64_t count = 0;
    if (!element || is_ghost || element->varies)
        return ensight_fail(s->file, "there should be a type of elements here");
    TETLOD_TRY(ensight_count(s->file, &count));
    if (count > UINT64_MAX / element->corners)
        return ensight_fail(s->file, "a count is too large");
    TETLOD_TRY(ensight_fits(s->file, count * element->corners));
    if (!ARRAY_RESERVE(s->sections, s->section_capacity, s->section_count + 1))
        return tetlodi_fail_nomem(s->error, "the list of cells", s->section_count * sizeof *s->sections);
    struct section *section = &s->sections[s->section_count++];
    *section = (struct section){part, element, s->out->at[s->nodes_block].cells.count, count, is_wanted};
    size_t room = s->file->kind == ENSIGHT_TEXT ? element->corners + 1u : (size_t)count * element->corners;
    int64_t *corners = array_new(room, sizeof *corners);
    if (!corners)
        return tetlodi_fail_nomem(s->error, "the cells", room * sizeof *corners);
    enum tetlod_status status = count ? read_corners(s, section, corners) : TETLOD_OK;
    free(corners);
    return status;
}

/* ---- structured parts */

/* Columns of `rows` values each into rows of `width`; `out` NULL: past them. */
static enum tetlod_status read_columns(struct six *s, uint64_t rows, uint32_t width, double *out)
{
    TETLOD_TRY(ensight_fits(s->file, rows));
    double *column = out ? array_new((size_t)rows, sizeof *column) : NULL;
    if (out && !column)
        return tetlodi_fail_nomem(s->error, "an array", rows * sizeof *column);
    enum tetlod_status status = TETLOD_OK;
    for (uint32_t c = 0; c < width && status == TETLOD_OK; c++) {
        status = ensight_floats(s->file, rows, column);
        for (uint64_t i = 0; out && status == TETLOD_OK && i < rows; i++)
            out[i * width + ensight_place(c, width)] = column[i];
    }
    free(column);
    return status;
}

static enum tetlod_status read_blanks(struct six *s, struct block *block, uint64_t points)
{
    TETLOD_TRY(ensight_fits(s->file, points));
    int64_t *values = array_new((size_t)points, sizeof *values);
    unsigned char *blank = array_new((size_t)points, 1);
    enum tetlod_status status = values && blank ? ensight_ints(s->file, points, values)
                                                : tetlodi_fail_nomem(s->error, "the blanked points", points * 9);
    for (uint64_t i = 0; status == TETLOD_OK && i < points; i++)
        blank[i] = values[i] == 0;
    if (status == TETLOD_OK && block_cell_count(block))
        status = block_hide_points(block, blank, s->report, s->error);
    free(values);
    free(blank);
    return status;
}

static enum tetlod_status read_grid(struct six *s, int64_t part, bool is_wanted)
{
    bool is_blanked = strstr(s->line, "iblanked") != NULL;
    int64_t dims[3];
    uint64_t points = 1;
    struct block *block;
    if (!s->out->at[s->nodes_block].mesh.vertex_count && !s->grid_count)
        ensight_find_order(s->file);
    TETLOD_TRY(ensight_ints(s->file, 3, dims));
    TETLOD_TRY(blocks_add(s->out, &block, s->error));
    for (int d = 0; d < 3; d++) {
        if (dims[d] < 1 || points > TETLOD_NONE / (uint64_t)dims[d])
            return ensight_fail(s->file, "the dimensions of a block do not fit");
        block->dims[d] = (uint32_t)dims[d];
        points *= (uint64_t)dims[d];
    }
    TETLOD_TRY(ensight_fits(s->file, points));
    TETLOD_TRY(assemble_points(&block->mesh, points, TETLOD_FLOAT32, s->error));
    TETLOD_TRY(read_columns(s, points, 3, block->mesh.positions));
    if (is_blanked)
        TETLOD_TRY(read_blanks(s, block, points));
    if (!ARRAY_RESERVE(s->grids, s->grid_capacity, s->grid_count + 1))
        return tetlodi_fail_nomem(s->error, "the list of parts", s->grid_count * sizeof *s->grids);
    uint64_t cells = block_cell_count(block);
    is_wanted &= cells > 0;
    s->grids[s->grid_count++] =
        (struct grid_part){part, is_wanted ? (int64_t)s->out->count - 1 : NO_BLOCK, points, cells};
    if (!is_wanted) {
        block_fini(block);
        s->out->count--;
    }
    return TETLOD_OK;
}

/* ---- geometry */

static bool part_number(const char *line, int64_t *out)
{
    struct text text = {line + 4, line + strlen(line)};
    return ensight_starts(line, "part") && text_int(&text, out);
}

static enum tetlod_status read_part(struct six *s)
{
    char name[ENSIGHT_LINE + 1];
    int64_t part;
    const char *wanted = s->input->options ? s->input->options->block : NULL;
    if (!part_number(s->line, &part))
        return ensight_fail(s->file, "there should be 'part' and its number here");
    ensight_line(s->file, name);
    bool is_wanted = !wanted || strcmp(wanted, name) == 0;
    s->found |= is_wanted;
    s->report->names_blocks = true;
    for (next_line(s); !is_part_end(s); next_line(s))
        TETLOD_TRY(ensight_starts(s->line, "block") ? read_grid(s, part, is_wanted) : read_section(s, part, is_wanted));
    return TETLOD_OK;
}

static enum tetlod_status read_geometry(struct six *s, uint64_t step)
{
    const char *wanted = s->input->options ? s->input->options->block : NULL;
    TETLOD_TRY(ensight_seek(s->file, step));
    for (int i = 0; i < 2; i++)
        ensight_line(s->file, s->line); // descriptions
    next_line(s);
    if (!ensight_starts(s->line, "node id"))
        return ensight_fail(s->file, "there should be 'node id' here; is it a geometry of EnSight 6?");
    s->node_ids = ensight_gives_ids(s->line);
    next_line(s);
    if (!ensight_starts(s->line, "element id"))
        return ensight_fail(s->file, "there should be 'element id' here");
    s->element_ids = ensight_gives_ids(s->line);
    next_line(s);
    if (!ensight_starts(s->line, "coordinates"))
        return ensight_fail(s->file, "there should be 'coordinates' here; is it a geometry of EnSight Gold?");
    TETLOD_TRY(read_nodes(s));
    for (next_line(s); ensight_starts(s->line, "part");)
        TETLOD_TRY(read_part(s));
    if (!is_part_end(s))
        return ensight_fail(s->file, "there should be 'part' here");
    return s->found || !wanted ? TETLOD_OK : tetlodi_fail(s->error, TETLOD_ERR_MESH, "has no part '%.60s'", wanted);
}

/* ---- variables */

/* Room for the values of a block, NaN until they are read: a file need not have those of all parts. */
static enum tetlod_status add_field(struct six *s, const struct ensight_variable *v, struct block *block)
{
    struct tetmesh *mesh = &block->mesh;
    uint64_t rows = v->cell ? block_cell_count(block) : mesh->vertex_count;
    if (rows == 0)
        return TETLOD_OK;
    TETLOD_TRY(v->cell ? assemble_cell_field(mesh, v->name, v->components, TETLOD_FLOAT32, rows, s->error)
                       : assemble_field(mesh, v->name, v->components, TETLOD_FLOAT32, s->error));
    double *values =
        v->cell ? mesh->cell_fields[mesh->cell_field_count - 1].values : mesh->fields[mesh->field_count - 1].values;
    for (uint64_t i = 0; i < rows * v->components; i++)
        values[i] = NAN;
    return TETLOD_OK;
}

static double *last_values(const struct block *block, bool cell)
{
    const struct tetmesh *mesh = &block->mesh;
    if (cell)
        return mesh->cell_field_count ? mesh->cell_fields[mesh->cell_field_count - 1].values : NULL;
    return mesh->field_count ? mesh->fields[mesh->field_count - 1].values : NULL;
}

/* Values node by node, or element by element: all components of one, then those of the next. */
static enum tetlod_status read_rows(struct six *s, uint64_t rows, uint32_t width, double *out)
{
    TETLOD_TRY(rows <= UINT64_MAX / width ? ensight_fits(s->file, rows * width)
                                          : ensight_fail(s->file, "a count is too large"));
    TETLOD_TRY(ensight_floats(s->file, rows * width, out));
    for (uint64_t i = 0; out && width == 6 && i < rows; i++) {
        double swap = out[6 * i + 4];
        out[6 * i + 4] = out[6 * i + 5];
        out[6 * i + 5] = swap;
    }
    return TETLOD_OK;
}

static enum tetlod_status read_grid_values(struct six *s, const struct ensight_variable *v, int64_t part)
{
    for (size_t g = 0; g < s->grid_count; g++) {
        const struct grid_part *grid = &s->grids[g];
        if (grid->part != part)
            continue;
        double *values = grid->block == NO_BLOCK ? NULL : last_values(&s->out->at[grid->block], v->cell);
        return read_columns(s, v->cell ? grid->cells : grid->points, v->components, values);
    }
    return ensight_fail(s->file, "it has values of a block that the geometry does not have");
}

static enum tetlod_status read_section_values(struct six *s, const struct ensight_variable *v, int64_t part)
{
    bool is_ghost;
    const struct ensight_element *element = ensight_find_element(s->line, &is_ghost);
    for (size_t i = 0; i < s->section_count; i++) {
        const struct section *section = &s->sections[i];
        if (section->part != part || section->element != element)
            continue;
        double *values = section->is_wanted ? last_values(&s->out->at[s->nodes_block], true) : NULL;
        return read_rows(s, section->count, v->components, values ? values + section->first * v->components : NULL);
    }
    return ensight_fail(s->file, "there should be a type of elements of this part here");
}

static enum tetlod_status read_values(struct six *s, const struct ensight_variable *v)
{
    uint64_t nodes = s->out->at[s->nodes_block].mesh.vertex_count;
    int64_t part;
    for (size_t b = s->nodes_block; b < s->out->count; b++)
        TETLOD_TRY(add_field(s, v, &s->out->at[b]));
    ensight_line(s->file, s->line); // description
    if (!v->cell && nodes)
        TETLOD_TRY(read_rows(s, nodes, v->components, last_values(&s->out->at[s->nodes_block], false)));
    for (next_line(s); *s->line && !ensight_starts(s->line, "END TIME STEP");) {
        if (!part_number(s->line, &part))
            return ensight_fail(s->file, "there should be 'part' and its number here");
        for (next_line(s); !is_part_end(s); next_line(s)) {
            if (!v->cell && !ensight_starts(s->line, "block"))
                return ensight_fail(s->file, "there should be 'block' here");
            TETLOD_TRY(ensight_starts(s->line, "block") ? read_grid_values(s, v, part)
                                                        : read_section_values(s, v, part));
        }
    }
    return TETLOD_OK;
}

static enum tetlod_status read_variable(struct six *s, const struct ensight_entry *entry)
{
    struct ensight_variable v;
    struct ensight_file *geometry = s->file;
    struct ensight_file file = {.kind = geometry->kind, .big_endian = geometry->big_endian, .has_columns = true};
    if (!ensight_find_variable(entry, &v)) {
        io_leave_out(s->report, &s->report->skipped_arrays, entry->name, strlen(entry->name));
        return TETLOD_OK;
    }
    s->file = &file;
    enum tetlod_status status = ensight_open(&file, s->input, entry->file, false, s->error);
    if (status == TETLOD_OK)
        status = ensight_seek(&file, entry->step);
    if (status == TETLOD_OK)
        status = read_values(s, &v);
    ensight_close(&file);
    s->file = geometry;
    return status;
}

enum tetlod_status ensight6_read(struct blocks *out, const struct ensight_case *ensight, const struct io_input *input,
                                 struct io_report *report, struct tetlod_error *error)
{
    struct ensight_file file = {.has_columns = true};
    struct six s = {
        .input = input, .report = report, .error = error, .out = out, .nodes_block = out->count, .file = &file};
    enum tetlod_status status = ensight_open(&file, input, ensight->model.file, true, error);
    if (status == TETLOD_OK)
        status = read_geometry(&s, ensight->model.step);
    ensight_close(&file);
    for (size_t v = 0; v < ensight->variable_count && status == TETLOD_OK; v++)
        status = read_variable(&s, &ensight->variables[v]);
    tag_map_fini(&s.nodes);
    free(s.sections);
    free(s.grids);
    return status;
}
