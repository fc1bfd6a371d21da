/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * Reading Abaqus and CalculiX .inp: *NODE and *ELEMENT with the lines of data that follow; ** starts a comment. The set
 * of elements that *ELEMENT names, else the part, is the cell field region, numbered from 1 in order of appearance.
 * Each *PART is a block, moved as its *INSTANCE says; files that *INCLUDE and INPUT= name are read in their place.
 */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

#include "format/fail.h"
#include "src/io/services/file_values.h"
#include "src/io/readers/readers.h"
#include "src/io/services/tag_map.h"
#include "src/util/array.h"

enum { MAX_SETS = 4096, NAME_SIZE = 96, DEEPEST = 8 };

struct part {
    uint16_t set; /* whose name is the part's */
    size_t block;
    bool is_placed;
};

struct inp {
    const char *begin;
    struct text rest;
    struct tetlod_error *error;
    struct io_report *report;
    const struct io_input *input;
    struct blocks *out;
    struct block *block; /* the one that is read, or NULL */
    double *positions; /* owned */
    size_t position_capacity;
    struct tag_map nodes;
    struct cell_numbers sets;
    struct file_view *view;
    char (*names)[NAME_SIZE]; /* owned: of sets */
    size_t name_count, name_capacity;
    struct part *parts; /* owned */
    size_t part_count, part_capacity;
    uint16_t part_set;  /* of the part that is read, or 0 */
    unsigned depth;     /* files that name one another */
};

static enum tetlod_status fail(const struct inp *p, const char *why)
{
    unsigned long line = 0;
    for (const char *at = p->begin; at < p->rest.at; at++)
        line += *at == '\n';
    return tetlodi_fail(p->error, TETLOD_ERR_MESH, "line %lu: %s", line ? line : 1, why);
}

/* The next line that is not blank and not a comment; false at the end. */
static bool next_line(struct inp *p, struct text *out)
{
    file_view_pass(p->view, p->rest.at);
    while (p->rest.at < p->rest.end) {
        *out = text_line(&p->rest);
        while (out->at < out->end && (*out->at == ' ' || *out->at == '\t'))
            out->at++;
        if (out->at < out->end && !(out->end - out->at >= 2 && out->at[0] == '*' && out->at[1] == '*'))
            return true;
    }
    return false;
}

/* What is before the next comma, without white space about it; the text goes on after it. False at the end of the
 * line. */
static bool next_item(struct text *line, struct text *out)
{
    if (line->at >= line->end)
        return false;
    const char *comma = memchr(line->at, ',', (size_t)(line->end - line->at));
    *out = (struct text){line->at, comma ? comma : line->end};
    line->at = comma ? comma + 1 : line->end;
    while (out->at < out->end && (*out->at == ' ' || *out->at == '\t'))
        out->at++;
    while (out->at < out->end && (out->end[-1] == ' ' || out->end[-1] == '\t'))
        out->end--;
    return true;
}

/* The value of NAME=VALUE of a keyword's line; an empty text if there is none. */
static struct text parameter(struct text line, const char *name)
{
    struct text item;
    size_t length = strlen(name);
    while (next_item(&line, &item)) {
        const char *equals = memchr(item.at, '=', (size_t)(item.end - item.at));
        const char *end = equals;
        while (end && end > item.at && end[-1] == ' ')
            end--;
        if (!equals || (size_t)(end - item.at) != length || strncasecmp(item.at, name, length) != 0)
            continue;
        item.at = equals + 1;
        while (item.at < item.end && *item.at == ' ')
            item.at++;
        return item;
    }
    return (struct text){line.end, line.end};
}

static bool at_keyword(const struct inp *p)
{
    struct inp look = *p;
    struct text line;
    return !next_line(&look, &line) || *line.at == '*';
}

static enum tetlod_status need_block(struct inp *p)
{
    return p->block ? TETLOD_OK : blocks_add(p->out, &p->block, p->error);
}

/* Reads a file that a line names in the place of that line. */
static enum tetlod_status follow(struct inp *p, struct text name,
                                 enum tetlod_status (*read)(struct inp *p, struct text keyword),
                                 struct text keyword)
{
    struct inp outer = *p;
    struct file_view view;
    struct tetlod_error *error = p->error, inner = {.offset = UINT64_MAX};
    char *copy = strndup(name.at, (size_t)(name.end - name.at)), *path = NULL;
    enum tetlod_status status = copy ? TETLOD_OK : tetlodi_fail_nomem(error, "a file's name", 0);
    if (status == TETLOD_OK && p->depth == DEEPEST)
        status = fail(p, "files name one another more than 8 times over");
    if (status == TETLOD_OK)
        status = io_resolve(p->input, copy, &path, error);
    if (status == TETLOD_OK)
        status = file_view_path(&view, path, error);
    if (status == TETLOD_OK) {
        p->begin = (const char *)view.bytes;
        p->rest = (struct text){p->begin, p->begin + view.size};
        p->view = &view;
        p->error = &inner;
        p->depth++;
        status = read(p, keyword);
        if (status != TETLOD_OK)
            tetlodi_fail(error, status, "%.400s: %s", copy, inner.message);
        file_view_close(&view);
    }
    p->begin = outer.begin;
    p->rest = outer.rest;
    p->view = outer.view;
    p->error = error;
    p->depth = outer.depth;
    free(copy);
    free(path);
    return status;
}

/* ---- nodes */

static enum tetlod_status read_nodes(struct inp *p, struct text keyword)
{
    struct text line, item;
    (void)keyword;
    TETLOD_TRY(need_block(p));
    while (!at_keyword(p) && next_line(p, &line)) {
        int64_t number;
        double position[3] = {0, 0, 0};
        bool good = next_item(&line, &item) && text_int(&item, &number);
        for (int d = 0; d < 3 && good; d++)
            good = next_item(&line, &item) && text_double(&item, false, &position[d]);
        if (!good)
            return fail(p, "there should be the number of a node and three coordinates here");
        size_t count = p->nodes.count;
        if (!ARRAY_RESERVE(p->positions, p->position_capacity, 3 * (count + 1)))
            return tetlodi_fail_nomem(p->error, "the nodes", count * 24);
        memcpy(p->positions + 3 * count, position, sizeof position);
        TETLOD_TRY(tag_map_add(&p->nodes, number, p->error));
    }
    return TETLOD_OK;
}

/* ---- elements */

struct element {
    const char *name;
    uint8_t points, vtk_type;
};

/* By the beginning of the type's name, the longest first. */
static const struct element elements[] = {
    {"C3D20", 20, VTK_TYPE_HEXAHEDRON20}, {"C3D27", 27, VTK_TYPE_HEXAHEDRON27}, {"C3D15", 15, VTK_TYPE_WEDGE15},
    {"C3D10", 10, VTK_TYPE_TET10},        {"C3D4", 4, VTK_TYPE_TET},            {"C3D5", 5, VTK_TYPE_PYRAMID},
    {"C3D6", 6, VTK_TYPE_WEDGE},          {"C3D8", 8, VTK_TYPE_HEXAHEDRON},     {"DC3D20", 20, VTK_TYPE_HEXAHEDRON20},
    {"DC3D15", 15, VTK_TYPE_WEDGE15},     {"DC3D10", 10, VTK_TYPE_TET10},       {"DC3D4", 4, VTK_TYPE_TET},
    {"DC3D6", 6, VTK_TYPE_WEDGE},         {"DC3D8", 8, VTK_TYPE_HEXAHEDRON},    {"F3D4", 4, VTK_TYPE_TET},
    {"F3D6", 6, VTK_TYPE_WEDGE},          {"F3D8", 8, VTK_TYPE_HEXAHEDRON},     {"AC3D4", 4, VTK_TYPE_TET},
    {"AC3D8", 8, VTK_TYPE_HEXAHEDRON},    {"AC3D10", 10, VTK_TYPE_TET10},       {"AC3D20", 20, VTK_TYPE_HEXAHEDRON20},
};

static const struct element *find_element(struct text type)
{
    for (size_t i = 0; i < sizeof elements / sizeof *elements; i++) {
        size_t length = strlen(elements[i].name), size = (size_t)(type.end - type.at);
        if (size >= length && strncasecmp(type.at, elements[i].name, length) == 0 &&
            (size == length || type.at[length] < '0' || type.at[length] > '9'))
            return &elements[i];
    }
    return NULL;
}

/* The number of a set, from 1; 0 for none. */
static enum tetlod_status find_set(struct inp *p, struct text name, uint16_t *out)
{
    char copy[NAME_SIZE] = "";
    size_t length = (size_t)(name.end - name.at);
    *out = 0;
    if (length == 0)
        return TETLOD_OK;
    memcpy(copy, name.at, length < NAME_SIZE - 1 ? length : NAME_SIZE - 1);
    for (size_t s = 0; s < p->name_count; s++)
        if (strcasecmp(p->names[s], copy) == 0) {
            *out = (uint16_t)(s + 1);
            return TETLOD_OK;
        }
    if (p->name_count == MAX_SETS)
        return fail(p, "there are more than 4096 sets of elements");
    if (!ARRAY_RESERVE(p->names, p->name_capacity, p->name_count + 1))
        return tetlodi_fail_nomem(p->error, "the sets", NAME_SIZE);
    memcpy(p->names[p->name_count++], copy, NAME_SIZE);
    *out = (uint16_t)p->name_count;
    return TETLOD_OK;
}

/* An element's number and points, which may go on over several lines. */
static enum tetlod_status read_element(struct inp *p, const struct element *element, uint16_t set)
{
    struct text line = {NULL, NULL}, item;
    int64_t number, corners[27];
    for (int i = -1; i < element->points;) {
        if (!next_item(&line, &item)) {
            if (at_keyword(p) || !next_line(p, &line))
                return fail(p, "an element has fewer nodes than its type");
            continue;
        }
        if (item.at == item.end)
            continue; // after the comma at the end of a line
        if (!text_int(&item, i < 0 ? &number : &corners[i]))
            return fail(p, "there should be the number of a node here");
        i++;
    }
    TETLOD_TRY(cell_numbers_add(&p->sets, p->block->cells.count, set, p->error));
    return cells_add(&p->block->cells, element->vtk_type, corners, element->points, p->error);
}

static enum tetlod_status read_elements(struct inp *p, struct text keyword)
{
    const struct element *element = find_element(parameter(keyword, "TYPE"));
    uint16_t set;
    struct text line;
    TETLOD_TRY(need_block(p));
    if (!element) { // shells, beams and their like
        while (!at_keyword(p) && next_line(p, &line))
            p->report->skipped_cells++;
        return TETLOD_OK;
    }
    TETLOD_TRY(find_set(p, parameter(keyword, "ELSET"), &set));
    set = set ? set : p->part_set;
    while (!at_keyword(p))
        TETLOD_TRY(read_element(p, element, set));
    return TETLOD_OK;
}

/* ---- the whole */

static bool is_keyword(struct text line, const char *name)
{
    struct text item;
    return next_item(&line, &item) && text_is(item, name);
}

/* Ends the block that is read. */
static enum tetlod_status finish(struct inp *p)
{
    if (!p->block)
        return TETLOD_OK;
    struct cells *cells = &p->block->cells;
    struct tetmesh *mesh = &p->block->mesh;
    p->block = NULL;
    p->position_capacity = 0;
    TETLOD_TRY(tag_map_sort(&p->nodes, p->error));
    TETLOD_TRY(assemble_points_of(mesh, p->nodes.count, &p->positions, TETLOD_FLOAT64, p->error));
    for (uint64_t i = 0; i < cells->connectivity_count; i++) { // until now by the file's numbers
        uint32_t number = cells->connectivity[i];
        cells->connectivity[i] = number == TETLOD_NONE ? TETLOD_NONE : tag_map_find(&p->nodes, number);
        if (number == TETLOD_NONE)
            return tetlodi_fail(p->error, TETLOD_ERR_MESH,
                                "an element refers to a node whose number is not one of 0 to %u", TETLOD_NONE - 1);
        if (cells->connectivity[i] == TETLOD_NONE)
            return tetlodi_fail(p->error, TETLOD_ERR_MESH, "an element refers to node %u, which is not there", number);
    }
    TETLOD_TRY(cell_numbers_to_field(&p->sets, mesh, "region", cells->count, p->error));
    cell_numbers_fini(&p->sets);
    p->sets = (struct cell_numbers){0};
    tag_map_fini(&p->nodes);
    p->nodes = (struct tag_map){0};
    return TETLOD_OK;
}

static enum tetlod_status begin_part(struct inp *p, struct text keyword)
{
    TETLOD_TRY(finish(p));
    TETLOD_TRY(find_set(p, parameter(keyword, "NAME"), &p->part_set));
    if (!ARRAY_RESERVE(p->parts, p->part_capacity, p->part_count + 1))
        return tetlodi_fail_nomem(p->error, "the parts", sizeof *p->parts);
    p->parts[p->part_count++] = (struct part){p->part_set, p->out->count, false};
    return need_block(p);
}

static enum tetlod_status end_part(struct inp *p)
{
    p->part_set = 0;
    return finish(p);
}

/* Moves points as an instance says: by three numbers, then about an axis through two points by degrees. */
static void move(struct tetmesh *mesh, const double shift[3], const double turn[7])
{
    double axis[3], length = 0;
    for (int d = 0; d < 3; d++) {
        axis[d] = turn[3 + d] - turn[d];
        length += axis[d] * axis[d];
    }
    length = sqrt(length);
    const double angle = turn[6] * acos(-1) / 180, c = cos(angle), s = sin(angle);
    for (size_t i = 0; i < mesh->vertex_count; i++) {
        double *at = mesh->positions + 3 * i, from[3], along = 0;
        for (int d = 0; d < 3; d++) {
            at[d] += shift[d];
            from[d] = at[d] - turn[d];
            along += length > 0 ? from[d] * axis[d] / length : 0;
        }
        for (int d = 0; d < 3 && length > 0 && angle != 0; d++) { // Rodrigues
            int e = (d + 1) % 3, f = (d + 2) % 3;
            at[d] = turn[d] + from[d] * c + (axis[e] * from[f] - axis[f] *
                                             from[e]) / length * s + axis[d] / length * along * (1 - c);
        }
    }
}

static enum tetlod_status read_instance(struct inp *p, struct text keyword)
{
    double numbers[10] = {0};
    uint16_t set;
    struct part *part = NULL;
    struct text line, item;
    TETLOD_TRY(find_set(p, parameter(keyword, "PART"), &set));
    for (size_t i = 0; i < p->part_count && !part; i++)
        part = p->parts[i].set == set ? &p->parts[i] : NULL;
    if (!part)
        return fail(p, "there is no *PART of this instance before it");
    if (part->is_placed)
        return fail(p, "its part is in the assembly already; only one instance of each part can be read");
    part->is_placed = true;
    for (int i = 0; i < 10 && !at_keyword(p) && next_line(p, &line);)
        for (; i < 10 && next_item(&line, &item); i++)
            if (!text_double(&item, false, &numbers[i]))
                return fail(p, "there should be the three numbers of a shift here, or the seven of a rotation");
    move(&p->out->at[part->block].mesh, numbers, numbers + 3);
    return TETLOD_OK;
}

static enum tetlod_status read_keywords(struct inp *p, struct text keyword);

static enum tetlod_status read_keyword(struct inp *p, struct text line)
{
    struct text input = parameter(line, "INPUT");
    bool elsewhere = input.at < input.end;
    if (is_keyword(line, "*NODE"))
        return elsewhere ? follow(p, input, read_nodes, line) : read_nodes(p, line);
    if (is_keyword(line, "*ELEMENT"))
        return elsewhere ? follow(p, input, read_elements, line) : read_elements(p, line);
    if (is_keyword(line, "*INCLUDE"))
        return elsewhere ? follow(p, input, read_keywords, line) : fail(p, "*INCLUDE should say INPUT=FILE");
    if (is_keyword(line, "*PART"))
        return begin_part(p, line);
    if (is_keyword(line, "*END PART"))
        return end_part(p);
    if (is_keyword(line, "*INSTANCE"))
        return read_instance(p, line);
    if (is_keyword(line, "*NGEN") || is_keyword(line, "*NFILL") || is_keyword(line, "*ELGEN"))
        return fail(p, "nodes and elements that are generated cannot be read: write them out");
    return TETLOD_OK;
}

static enum tetlod_status read_keywords(struct inp *p, struct text keyword)
{
    struct text line;
    (void)keyword;
    while (next_line(p, &line))
        TETLOD_TRY(read_keyword(p, line));
    return TETLOD_OK;
}

static enum tetlod_status read_all(struct inp *p)
{
    uint64_t points = 0;
    TETLOD_TRY(read_keywords(p, p->rest));
    TETLOD_TRY(finish(p));
    for (size_t b = 0; b < p->out->count; b++)
        points += p->out->at[b].mesh.vertex_count;
    return points ? TETLOD_OK : fail(p, "there is no *NODE; is it an Abaqus input file?");
}

bool inp_sniff(const unsigned char *bytes, size_t size)
{
    struct inp p = {.rest = {(const char *)bytes, (const char *)bytes + (size < 4096 ? size : 4096)}};
    struct text line;
    while (next_line(&p, &line)) {
        if (*line.at != '*')
            continue;
        if (is_keyword(line, "*HEADING") || is_keyword(line, "*NODE") || is_keyword(line, "*INCLUDE") ||
            is_keyword(line, "*PART"))
            return true;
    }
    return false;
}

enum tetlod_status inp_read(struct blocks *out, const struct io_input *input, struct io_report *report,
                            struct tetlod_error *error)
{
    const char *begin = (const char *)input->bytes;
    struct inp p = {.begin = begin, .rest = {begin, begin + input->size}, .view = input->view, .error = error,
                    .report = report,
                    .input = input, .out = out};
    enum tetlod_status status = read_all(&p);
    free(p.positions);
    tag_map_fini(&p.nodes);
    cell_numbers_fini(&p.sets);
    free(p.names);
    free(p.parts);
    return status;
}
