/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * Reading MFEM meshes of versions 1.0 to 1.3, with a grid function where one is given. Text is words; '#' begins a
 * comment. Curved meshes have nodes in place of positions of vertices: a space of functions, then its values, of which
 * the first of a continuous space are those of the vertices. The same holds for a grid function. Meshes and spaces of
 * other kinds are refused by name.
 */
#include <stdio.h>
#include <string.h>

#include "format/fail.h"
#include "src/io/readers/readers.h"
#include "src/io/services/file_values.h"

enum { MAX_WIDTH = 16 }; // of a vector of a grid function

struct mfem {
    const char *begin;
    struct text rest;
    struct file_view *view;
    struct block *block;
    struct io_report *report;
    struct tetlod_error *error;
    struct cell_numbers attributes;
    uint64_t elements, vertices;
};

/* A space of functions as nodes and grid functions name it. */
struct space {
    struct text collection;
    int64_t width, ordering; /* 0: all first components first; 1: vector after vector */
    int64_t order;
    bool is_continuous, is_constant; /* neither: not read */
};

static enum tetlod_status fail(const struct mfem *m, const char *why)
{
    unsigned long line = 1;
    for (const char *at = m->begin; at < m->rest.at; at++)
        line += *at == '\n';
    return tetlodi_fail(m->error, TETLOD_ERR_MESH, "line %lu: %s", line, why);
}

static struct text next_word(struct mfem *m)
{
    file_view_pass(m->view, m->rest.at);
    return text_word_past_comments(&m->rest);
}

static enum tetlod_status take_int(struct mfem *m, int64_t *out)
{
    struct text word = next_word(m);
    return text_int(&word, out) ? TETLOD_OK : fail(m, "there should be a whole number here; is the file truncated?");
}

static enum tetlod_status take_double(struct mfem *m, double *out)
{
    struct text word = next_word(m);
    return text_double(&word, false, out) ? TETLOD_OK
                                          : fail(m, "there should be a number here; is the file truncated?");
}

/* A count of things of at least so many numbers each. */
static enum tetlod_status take_count(struct mfem *m, uint64_t numbers, uint64_t *out)
{
    int64_t count;
    TETLOD_TRY(take_int(m, &count));
    if (count < 0 || (uint64_t)count > (uint64_t)(m->rest.end - m->rest.at + 1) / 2 / numbers)
        return fail(m, "the file ends too early for this count; is it truncated?");
    *out = (uint64_t)count;
    return TETLOD_OK;
}

/* ---- elements */

static enum tetlod_status read_elements(struct mfem *m)
{
    static const struct {
        unsigned char type;
        uint8_t corners;
    } kinds[] = {{VTK_TYPE_FLAT, 1}, {VTK_TYPE_FLAT, 2},       {VTK_TYPE_FLAT, 3},  {VTK_TYPE_FLAT, 4},
                 {VTK_TYPE_TET, 4},  {VTK_TYPE_HEXAHEDRON, 8}, {VTK_TYPE_WEDGE, 6}, {VTK_TYPE_PYRAMID, 5}};
    struct cells *cells = &m->block->cells;
    int64_t attribute, kind, corner[8];
    TETLOD_TRY(take_count(m, 3, &m->elements));
    for (uint64_t c = 0; c < m->elements; c++) {
        TETLOD_TRY(take_int(m, &attribute));
        TETLOD_TRY(take_int(m, &kind));
        if (kind < 0 || kind >= (int64_t)(sizeof kinds / sizeof *kinds))
            return fail(m, "an element is of a geometry that MFEM does not have");
        bool is_flat = kinds[kind].type == VTK_TYPE_FLAT;
        for (unsigned i = 0; i < kinds[kind].corners; i++)
            TETLOD_TRY(take_int(m, &corner[i]));
        TETLOD_TRY(cells_add(cells, kinds[kind].type, corner, is_flat ? 0 : kinds[kind].corners, m->error));
        TETLOD_TRY(cell_numbers_add(&m->attributes, cells->count - 1, attribute, m->error));
    }
    return TETLOD_OK;
}

/* Elements of the boundary, or parents of vertices: lists of numbers that a mesh of tetrahedra has no use for. */
static enum tetlod_status skip_boundary(struct mfem *m)
{
    static const uint8_t corners[] = {1, 2, 3, 4};
    uint64_t count = 0;
    int64_t number, kind;
    TETLOD_TRY(take_count(m, 3, &count));
    for (uint64_t c = 0; c < count; c++) {
        TETLOD_TRY(take_int(m, &number));
        TETLOD_TRY(take_int(m, &kind));
        if (kind < 0 || kind >= (int64_t)sizeof corners)
            return fail(m, "an element of the boundary is no point, segment, triangle or square");
        for (unsigned i = 0; i < corners[kind]; i++)
            TETLOD_TRY(take_int(m, &number));
    }
    return TETLOD_OK;
}

/* ---- spaces of functions */

/* The value of a key "Name:" that must come next. */
static enum tetlod_status take_key(struct mfem *m, const char *key, struct text *out)
{
    char why[80];
    if (text_is(next_word(m), key)) {
        *out = next_word(m);
        return TETLOD_OK;
    }
    snprintf(why, sizeof why, "there should be '%s' here", key);
    return fail(m, why);
}

static bool begins(struct text word, const char *with)
{
    size_t length = strlen(with);
    return (size_t)(word.end - word.at) >= length && memcmp(word.at, with, length) == 0;
}

/* Of "H1_3D_P2" and the like the order behind "_P"; the older names are words. */
static void read_collection(struct space *space)
{
    static const struct {
        const char *name;
        int64_t order;
        bool is_continuous;
    } known[] = {{"Linear", 1, true},
                 {"Quadratic", 2, true},
                 {"Cubic", 3, true},
                 {"Const3D", 0, false},
                 {"LinearDiscont3D", 1, false}};
    struct text word = space->collection;
    for (size_t k = 0; k < sizeof known / sizeof *known; k++)
        if (text_is(word, known[k].name)) {
            space->order = known[k].order;
            space->is_continuous = known[k].is_continuous;
            space->is_constant = !known[k].is_continuous && !known[k].order;
        }
    const char *at = word.end;
    while (at > word.at && at[-1] >= '0' && at[-1] <= '9')
        at--;
    struct text digits = {at, word.end};
    if (at - word.at < 2 || at[-1] != 'P' || !text_int(&digits, &space->order))
        return;
    space->is_continuous = begins(word, "H1") && space->order >= 1;
    space->is_constant = begins(word, "L2") && space->order == 0;
}

static enum tetlod_status read_space(struct mfem *m, struct space *out)
{
    struct text word;
    *out = (struct space){0};
    TETLOD_TRY(take_key(m, "FiniteElementCollection:", &out->collection));
    read_collection(out);
    TETLOD_TRY(take_key(m, "VDim:", &word));
    if (!text_int(&word, &out->width) || out->width < 1 || out->width > MAX_WIDTH)
        return fail(m, "VDim should be a small whole number");
    TETLOD_TRY(take_key(m, "Ordering:", &word));
    if (!text_int(&word, &out->ordering) || out->ordering < 0 || out->ordering > 1)
        return fail(m, "Ordering should be 0 or 1");
    return TETLOD_OK;
}

/* How many values follow: up to the end of the mesh. */
static uint64_t count_values(const struct mfem *m)
{
    struct text look = m->rest;
    uint64_t count = 0;
    for (;; count++) {
        struct text word = text_word_past_comments(&look);
        if (word.at == word.end || (*word.at >= 'a' && *word.at <= 'z'))
            return count;
    }
}

/* The first `rows` rows of the values of a space. */
static enum tetlod_status read_rows(struct mfem *m, const struct space *space, uint64_t rows, double *out)
{
    uint64_t count = count_values(m), width = (uint64_t)space->width, all = count / width;
    double value;
    if (count % width || all < rows)
        return fail(m, "there are fewer values than the space of functions has; is the file truncated?");
    for (uint64_t i = 0; i < count; i++) {
        uint64_t row = space->ordering ? i / width : i % all, column = space->ordering ? i % width : i / all;
        TETLOD_TRY(take_double(m, &value));
        if (row < rows)
            out[row * width + column] = value;
    }
    return TETLOD_OK;
}

/* ---- vertices */

static enum tetlod_status read_nodes(struct mfem *m)
{
    struct space space;
    if (!text_is(next_word(m), "FiniteElementSpace"))
        return fail(m, "there should be 'FiniteElementSpace' here");
    TETLOD_TRY(read_space(m, &space));
    if (!space.is_continuous)
        return tetlodi_fail(
            m->error, TETLOD_ERR_MESH,
            "its nodes are in '%.*s'; only those of continuous spaces (H1) can be read: save the mesh with "
            "Mesh::SetCurvature(order, false)",
            text_length(space.collection), space.collection.at);
    if (space.width != 3)
        return fail(m, "the nodes should be in three dimensions");
    m->report->higher_cells += space.order > 1 ? m->elements : 0;
    return read_rows(m, &space, m->vertices, m->block->mesh.positions);
}

static enum tetlod_status read_vertices(struct mfem *m)
{
    struct text look;
    int64_t dimension;
    TETLOD_TRY(take_count(m, 1, &m->vertices));
    if (m->block->mesh.positions)
        return fail(m, "there are vertices a second time");
    TETLOD_TRY(assemble_points(&m->block->mesh, m->vertices, TETLOD_FLOAT64, m->error));
    look = m->rest;
    if (text_is(text_word_past_comments(&look), "nodes")) {
        m->rest = look;
        return read_nodes(m);
    }
    TETLOD_TRY(take_int(m, &dimension));
    if (dimension != 3)
        return fail(m, "the vertices should be in three dimensions");
    for (uint64_t v = 0; v < 3 * m->vertices; v++)
        TETLOD_TRY(take_double(m, &m->block->mesh.positions[v]));
    return TETLOD_OK;
}

/* ---- the mesh */

static enum tetlod_status read_dimension(struct mfem *m)
{
    int64_t dimension;
    TETLOD_TRY(take_int(m, &dimension));
    return dimension == 3 ? TETLOD_OK : fail(m, "the dimension should be 3");
}

/* Sets of attributes have names and numbers, of which the mesh has the numbers already. */
static enum tetlod_status read_section(struct mfem *m, struct text word)
{
    if (text_is(word, "dimension"))
        return read_dimension(m);
    if (text_is(word, "elements"))
        return read_elements(m);
    if (text_is(word, "boundary"))
        return skip_boundary(m);
    if (text_is(word, "vertices"))
        return read_vertices(m);
    if (text_is(word, "vertex_parents") || text_is(word, "coordinates"))
        return fail(m, "meshes with hanging vertices cannot be read; write the result as VTU: Mesh::PrintVTU");
    return TETLOD_OK;
}

static bool is_end(struct text word)
{
    return word.at == word.end || text_is(word, "mfem_mesh_end") || text_is(word, "mfem_serial_mesh_end");
}

/* The first line: "MFEM mesh v1.N", or "MFEM KIND mesh v1.0". */
static enum tetlod_status check_kind(struct mfem *m)
{
    struct text line = text_line(&m->rest), kind;
    text_word(&line);
    kind = text_word(&line);
    if (text_is(kind, "mesh"))
        return TETLOD_OK;
    return tetlodi_fail(m->error, TETLOD_ERR_MESH,
                        "is a mesh of MFEM's kind '%.*s', which cannot be read; write it as VTU: Mesh::PrintVTU",
                        text_length(kind), kind.at);
}

static enum tetlod_status read_mesh(struct mfem *m)
{
    TETLOD_TRY(check_kind(m));
    for (struct text word = next_word(m); !is_end(word); word = next_word(m))
        TETLOD_TRY(read_section(m, word));
    if (!m->block->mesh.positions)
        return fail(m, "there are no vertices; is the file truncated?");
    return cell_numbers_to_field(&m->attributes, &m->block->mesh, "mfem:attribute", m->block->cells.count, m->error);
}

/* ---- a grid function */

/* The field is called as the file is, without folder and extension. */
static void name_field(const char *path, char *out, size_t size)
{
    const char *slash = strrchr(path, '/'), *name = slash ? slash + 1 : path, *dot = strrchr(name, '.');
    snprintf(out, size, "%.*s", dot ? (int)(dot - name) : (int)strlen(name), name);
}

static enum tetlod_status read_function(struct mfem *m, const char *path)
{
    struct tetmesh *mesh = &m->block->mesh;
    struct space space;
    char name[128];
    if (!text_is(next_word(m), "FiniteElementSpace"))
        return fail(m, "there should be 'FiniteElementSpace' here: is it a grid function of MFEM?");
    TETLOD_TRY(read_space(m, &space));
    uint64_t rows = space.is_constant ? m->block->cells.count : m->vertices, width = (uint64_t)space.width;
    if (!space.is_continuous && !space.is_constant)
        return tetlodi_fail(
            m->error, TETLOD_ERR_MESH,
            "it is in '%.*s'; only continuous spaces (H1) and constants of elements (L2 of order 0) can be read: "
            "project it onto one of these",
            text_length(space.collection), space.collection.at);
    if ((uint64_t)(m->rest.end - m->rest.at) < rows * width)
        return fail(m, "the file ends too early; is it truncated?");
    name_field(path, name, sizeof name);
    if (space.is_constant)
        TETLOD_TRY(assemble_cell_field(mesh, name, width, TETLOD_FLOAT64, rows, m->error));
    else
        TETLOD_TRY(assemble_field(mesh, name, width, TETLOD_FLOAT64, m->error));
    return read_rows(m, &space, rows,
                     space.is_constant ? mesh->cell_fields[mesh->cell_field_count - 1].values
                                       : mesh->fields[mesh->field_count - 1].values);
}

static enum tetlod_status read_other(struct mfem *m, const struct io_input *input)
{
    struct tetlod_error inner = {0};
    struct mfem other = *m;
    other.begin = (const char *)input->other;
    other.rest = (struct text){other.begin, other.begin + input->other_size};
    other.view = input->other_view;
    other.error = &inner;
    enum tetlod_status status = read_function(&other, input->other_path);
    return status == TETLOD_OK ? TETLOD_OK
                               : tetlodi_fail(m->error, status, "%.400s: %s", input->other_path, inner.message);
}

bool mfem_sniff(const unsigned char *bytes, size_t size)
{
    struct text rest = {(const char *)bytes, (const char *)bytes + size}, line = text_line(&rest);
    bool is_mfem = text_is(text_word(&line), "MFEM");
    for (struct text word = text_word(&line); is_mfem && word.at < word.end; word = text_word(&line))
        if (text_is(word, "mesh"))
            return true;
    return false;
}

enum tetlod_status mfem_read(struct blocks *out, const struct io_input *input, struct io_report *report,
                             struct tetlod_error *error)
{
    struct block *block;
    TETLOD_TRY(blocks_add(out, &block, error));
    const char *begin = (const char *)input->bytes;
    struct mfem m = {.begin = begin,
                     .rest = {begin, begin + input->size},
                     .view = input->view,
                     .block = block,
                     .report = report,
                     .error = error};
    enum tetlod_status status = read_mesh(&m);
    if (status == TETLOD_OK && input->other)
        status = read_other(&m, input);
    cell_numbers_fini(&m.attributes);
    return status;
}
