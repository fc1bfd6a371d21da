/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * Reading Abaqus and CalculiX .inp: *NODE and *ELEMENT with the lines of data that follow; ** starts a comment. The set of elements
 * that *ELEMENT names is the cell field region, numbered from 1 in order of appearance.
 */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

#include "format/fail.h"
#include "src/io/file_values.h"
#include "src/io/formats.h"
#include "src/io/tag_map.h"
#include "src/util/array.h"

enum { MOST_SETS = 4096, NAME_SIZE = 96 };

struct inp {
    const char *begin;
    struct text rest;
    struct tetlod_error *error;
    struct io_report *report;
    struct block *block;
    double *positions; /* owned */
    size_t position_capacity;
    struct tag_map nodes;
    struct cell_numbers sets;
    struct file_view *view;
    char (*names)[NAME_SIZE]; /* owned: of sets */
    size_t name_count, name_capacity;
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

/* What is before the next comma, without white space about it; the text goes on after it. False at the end of the line. */
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

/* ---- nodes */

static enum tetlod_status read_nodes(struct inp *p)
{
    struct text line, item;
    while (!at_keyword(p) && next_line(p, &line)) {
        int64_t number;
        double position[3] = {0, 0, 0};
        bool good = next_item(&line, &item) && text_int(&item, &number);
        for (int d = 0; d < 3 && good; d++)
            good = next_item(&line, &item) && text_double(&item, false, &position[d]);
        if (!good)
            return fail(p, "there should be the number of a node and three coordinates here");
        size_t count = p->nodes.count;
        if (!array_reserve((void **)&p->positions, &p->position_capacity, 3 * (count + 1), sizeof *p->positions))
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
    if (p->name_count == MOST_SETS)
        return fail(p, "there are more than 4096 sets of elements");
    if (!array_reserve((void **)&p->names, &p->name_capacity, p->name_count + 1, sizeof *p->names))
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
    if (!element) { // shells, beams and their like
        while (!at_keyword(p) && next_line(p, &line))
            p->report->skipped_cells++;
        return TETLOD_OK;
    }
    TETLOD_TRY(find_set(p, parameter(keyword, "ELSET"), &set));
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

static enum tetlod_status finish(struct inp *p)
{
    struct cells *cells = &p->block->cells;
    struct tetmesh *mesh = &p->block->mesh;
    TETLOD_TRY(tag_map_sort(&p->nodes, p->error));
    TETLOD_TRY(assemble_points_of(mesh, p->nodes.count, &p->positions, TETLOD_FLOAT64, p->error));
    for (uint64_t i = 0; i < cells->connectivity_count; i++) { // until now by the file's numbers
        uint32_t number = cells->connectivity[i];
        cells->connectivity[i] = number == TETLOD_NONE ? TETLOD_NONE : tag_map_find(&p->nodes, number);
        if (cells->connectivity[i] == TETLOD_NONE)
            return tetlodi_fail(p->error, TETLOD_ERR_MESH, "an element refers to node %lld, which is not there",
                                number == TETLOD_NONE ? -1 : (long long)number);
    }
    return cell_numbers_to_field(&p->sets, mesh, "region", cells->count, p->error);
}

static enum tetlod_status read_all(struct inp *p)
{
    struct text line;
    while (next_line(p, &line)) {
        if (is_keyword(line, "*NODE"))
            TETLOD_TRY(read_nodes(p));
        else if (is_keyword(line, "*ELEMENT"))
            TETLOD_TRY(read_elements(p, line));
        else if (is_keyword(line, "*INCLUDE"))
            return fail(p, "*INCLUDE is not followed: put the file in its place");
    }
    if (!p->nodes.count)
        return fail(p, "there is no *NODE; is it an Abaqus input file?");
    return finish(p);
}

bool inp_sniff(const unsigned char *bytes, size_t size)
{
    struct inp p = {.rest = {(const char *)bytes, (const char *)bytes + (size < 4096 ? size : 4096)}};
    struct text line;
    while (next_line(&p, &line)) {
        if (*line.at != '*')
            continue;
        if (is_keyword(line, "*HEADING") || is_keyword(line, "*NODE") || is_keyword(line, "*INCLUDE") || is_keyword(line, "*PART"))
            return true;
    }
    return false;
}

enum tetlod_status inp_read(struct blocks *out, const struct io_input *input, struct io_report *report, struct tetlod_error *error)
{
    const char *begin = (const char *)input->bytes;
    struct inp p = {.begin = begin, .rest = {begin, begin + input->size}, .view = input->view, .error = error, .report = report};
    TETLOD_TRY(blocks_add(out, &p.block, error));
    enum tetlod_status status = read_all(&p);
    free(p.positions);
    tag_map_fini(&p.nodes);
    cell_numbers_fini(&p.sets);
    free(p.names);
    return status;
}
