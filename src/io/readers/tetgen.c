/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * Reading TetGen's NAME.node (points, their attributes, which become fields) and NAME.ele (tetrahedra). Both are text,
 * a header and a line for each: its number, from 0 or 1 on, and values; # starts a comment.
 */
#include <stdlib.h>

#include "format/fail.h"
#include "src/io/readers/readers.h"
#include "src/io/services/file_values.h"

struct file {
    const char *name, *begin;
    struct text rest;
    struct file_view *view;
    struct tetlod_error *error;
};

static enum tetlod_status fail(const struct file *f, const char *why)
{
    unsigned long line = 1;
    for (const char *at = f->begin; at < f->rest.at; at++)
        line += *at == '\n';
    return tetlodi_fail(f->error, TETLOD_ERR_MESH, "%s, line %lu: %s", f->name, line, why);
}

static enum tetlod_status take_int(struct file *f, int64_t *out)
{
    file_view_pass(f->view, f->rest.at);
    struct text word = text_word_past_comments(&f->rest);
    return text_int(&word, out) ? TETLOD_OK : fail(f, "there should be a whole number here; is the file truncated?");
}

static enum tetlod_status take_double(struct file *f, double *out)
{
    file_view_pass(f->view, f->rest.at);
    struct text word = text_word_past_comments(&f->rest);
    return text_double(&word, false, out) ? TETLOD_OK : fail(f,
                                                             "there should be a number here; is the file truncated?");
}

/* The first of a header's numbers, checked against the bytes that are left for so many lines. */
static enum tetlod_status take_header(struct file *f, int64_t *header, size_t count)
{
    for (size_t i = 0; i < count; i++) {
        TETLOD_TRY(take_int(f, &header[i]));
        if (header[i] < 0)
            return fail(f, "there should be a count here");
    }
    if (header[0] > (f->rest.end - f->rest.at) / 2)
        return fail(f, "the file ends too early for this count; is it truncated?");
    return TETLOD_OK;
}

static enum tetlod_status read_nodes(struct tetmesh *mesh, struct file *f, int64_t *out_first)
{
    enum { MAX_ATTRIBUTES = 4096 };
    int64_t header[4], number, marker; // points, dimension, attributes, markers
    TETLOD_TRY(take_header(f, header, 4));
    if (header[1] != 3)
        return fail(f, "the dimension should be 3");
    if (header[2] > MAX_ATTRIBUTES ||
        (header[2] && (header[0] ? header[0] : 1) > (f->rest.end - f->rest.at) / 2 / header[2]))
        return fail(f, "the file ends too early for these attributes; is it truncated?");
    TETLOD_TRY(assemble_points(mesh, (uint64_t)header[0], TETLOD_FLOAT64, f->error));
    for (int64_t a = 0; a < header[2]; a++)
        TETLOD_TRY(assemble_field(mesh, "attribute", 1, TETLOD_FLOAT64, f->error));
    for (uint32_t v = 0; v < mesh->vertex_count; v++) {
        TETLOD_TRY(take_int(f, &number));
        *out_first = v ? *out_first : number;
        if (number < 0 || number - *out_first != v)
            return fail(f, "the points should be numbered one by one, from 0 or 1");
        for (uint32_t d = 0; d < 3; d++)
            TETLOD_TRY(take_double(f, &mesh->positions[3 * (size_t)v + d]));
        for (uint32_t a = 0; a < mesh->field_count; a++)
            TETLOD_TRY(take_double(f, &mesh->fields[a].values[v]));
        if (header[3])
            TETLOD_TRY(take_int(f, &marker));
    }
    return TETLOD_OK;
}

static enum tetlod_status read_elements(struct file *f, int64_t first_point, struct cells *cells)
{
    int64_t header[3], number, corner[10]; // tetrahedra, points of each, attributes
    double skipped;
    TETLOD_TRY(take_header(f, header, 3));
    if (header[1] != 4 && header[1] != 10)
        return fail(f, "a tetrahedron should have 4 or 10 points");
    for (int64_t t = 0; t < header[0]; t++) {
        TETLOD_TRY(take_int(f, &number));
        for (int64_t i = 0; i < header[1]; i++) {
            TETLOD_TRY(take_int(f, &corner[i]));
            if (corner[i] < first_point)
                return fail(f, "the number of a point is less than the first one's");
            corner[i] -= first_point;
        }
        for (int64_t a = 0; a < header[2]; a++)
            TETLOD_TRY(take_double(f, &skipped));
        TETLOD_TRY(cells_add(cells, VTK_TYPE_TET, corner, 4, f->error));
    }
    return TETLOD_OK;
}

enum tetlod_status tetgen_read(struct blocks *out, const struct io_input *input, struct io_report *report,
                            struct tetlod_error *error)
{
    struct block *block;
    TETLOD_TRY(blocks_add(out, &block, error));
    struct tetmesh *mesh = &block->mesh;
    const char *node_bytes = (const char *)input->bytes, *element_bytes = (const char *)input->other;
    struct file nodes = {".node", node_bytes, {node_bytes, node_bytes + input->size}, input->view, error};
    struct file elements = {".ele", element_bytes, {element_bytes, element_bytes + input->other_size},
                            input->other_view, error};
    int64_t first_point = 0;
    enum tetlod_status status = read_nodes(mesh, &nodes, &first_point);
    if (status == TETLOD_OK)
        status = read_elements(&elements, first_point, &block->cells);
    (void)report;
    return status;
}
