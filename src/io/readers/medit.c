/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * Reading Medit .mesh and .meshb, with the .sol or .solb file of values at its vertices where one is given. Text is
 * words: a keyword, a count, numbers; line ends mean nothing, and what is not known is passed over up to the next
 * keyword. A binary file begins with the number 1, which tells its byte order, and its version, which tells the widths
 * of numbers; each keyword is a number followed by the place of the next one.
 */
#include <stdlib.h>
#include <string.h>

#include "format/fail.h"
#include "src/io/readers/readers.h"
#include "src/io/services/file_values.h"
#include "src/util/array.h"

struct medit {
    const char *begin;
    struct text rest;
    struct tetmesh *mesh;
    struct tetlod_error *error;
    bool is_float; /* MeshVersionFormatted 1 */
    bool binary, big_endian;
    enum value_type integer, real, place; /* of a binary file */
    struct cells *cells;
    struct cell_numbers references;
    struct file_view *view;
};

static enum tetlod_status fail(const struct medit *m, const char *why)
{
    unsigned long line = 1;
    if (m->binary)
        return tetlodi_fail(m->error, TETLOD_ERR_MESH, "byte %td: %s", m->rest.at - m->begin, why);
    for (const char *at = m->begin; at < m->rest.at; at++)
        line += *at == '\n';
    return tetlodi_fail(m->error, TETLOD_ERR_MESH, "line %lu: %s", line, why);
}

static bool is_keyword(struct text word)
{
    return word.at < word.end && ((*word.at >= 'A' && *word.at <= 'Z') || (*word.at >= 'a' && *word.at <= 'z'));
}

/* The bytes of the next number of a binary file, or NULL. */
static const unsigned char *take_bytes(struct medit *m, enum value_type type)
{
    const char *at = m->rest.at;
    file_view_pass(m->view, at);
    if ((size_t)(m->rest.end - at) < value_size(type))
        return NULL;
    m->rest.at += value_size(type);
    return (const unsigned char *)at;
}

static enum tetlod_status take_binary_int(struct medit *m, enum value_type type, int64_t *out)
{
    const unsigned char *bytes = take_bytes(m, type);
    if (!bytes)
        return fail(m, "the file ends too early; is it truncated?");
    values_to_ints(bytes, type, m->big_endian, 1, out);
    return TETLOD_OK;
}

static enum tetlod_status take_int(struct medit *m, int64_t *out)
{
    if (m->binary)
        return take_binary_int(m, m->integer, out);
    file_view_pass(m->view, m->rest.at);
    struct text word = text_word_past_comments(&m->rest);
    return text_int(&word, out) ? TETLOD_OK : fail(m, "there should be a whole number here; is the file truncated?");
}

/* Of 32 bits in every binary file. */
static enum tetlod_status take_small_int(struct medit *m, int64_t *out)
{
    return m->binary ? take_binary_int(m, VALUE_INT32, out) : take_int(m, out);
}

static enum tetlod_status take_double(struct medit *m, double *out)
{
    if (m->binary) {
        const unsigned char *bytes = take_bytes(m, m->real);
        if (!bytes)
            return fail(m, "the file ends too early; is it truncated?");
        values_to_doubles(bytes, m->real, m->big_endian, 1, out);
        return TETLOD_OK;
    }
    file_view_pass(m->view, m->rest.at);
    struct text word = text_word_past_comments(&m->rest);
    return text_double(&word, m->is_float, out) ? TETLOD_OK
                                                : fail(m, "there should be a number here; is the file truncated?");
}

/* How many numbers there can still be at most. */
static uint64_t most_left(const struct medit *m)
{
    uint64_t left = (uint64_t)(m->rest.end - m->rest.at);
    return m->binary ? left / 4 : (left + 1) / 2;
}

static enum tetlod_status take_count(struct medit *m, uint64_t values_each, uint64_t *out)
{
    int64_t count;
    TETLOD_TRY(take_int(m, &count));
    if (count < 0 || (uint64_t)count > most_left(m) / values_each)
        return fail(m, "the file ends too early for this count; is it truncated?");
    *out = (uint64_t)count;
    return TETLOD_OK;
}

static enum tetlod_status read_version(struct medit *m)
{
    int64_t version;
    TETLOD_TRY(take_int(m, &version));
    m->is_float = version == 1;
    return TETLOD_OK;
}

static enum tetlod_status read_dimension(struct medit *m)
{
    int64_t dimension;
    TETLOD_TRY(take_small_int(m, &dimension));
    return dimension == 3 ? TETLOD_OK : fail(m, "the dimension should be 3");
}

static enum tetlod_status read_vertices(struct medit *m)
{
    uint64_t count = 0;
    int64_t reference;
    TETLOD_TRY(take_count(m, 4, &count));
    if (m->mesh->positions)
        return fail(m, "there are Vertices a second time");
    TETLOD_TRY(assemble_points(m->mesh, count, m->is_float ? TETLOD_FLOAT32 : TETLOD_FLOAT64, m->error));
    for (uint64_t v = 0; v < count; v++) {
        for (int d = 0; d < 3; d++)
            TETLOD_TRY(take_double(m, &m->mesh->positions[3 * v + (uint64_t)d]));
        TETLOD_TRY(take_int(m, &reference));
    }
    return TETLOD_OK;
}

static enum tetlod_status read_cells(struct medit *m, unsigned char type, unsigned corners)
{
    uint64_t count = 0;
    int64_t corner[8], reference;
    TETLOD_TRY(take_count(m, corners + 1, &count));
    for (uint64_t c = 0; c < count; c++) {
        for (unsigned i = 0; i < corners; i++) {
            TETLOD_TRY(take_int(m, &corner[i]));
            if (corner[i] < 1 || (uint64_t)corner[i] > m->mesh->vertex_count)
                return fail(m, "a cell refers to a vertex that is not there");
            corner[i]--;
        }
        TETLOD_TRY(take_int(m, &reference));
        TETLOD_TRY(cells_add(m->cells, type, corner, type == VTK_TYPE_FLAT ? 0 : corners, m->error));
        if (type != VTK_TYPE_FLAT) // those of surfaces tell nothing of the volume
            TETLOD_TRY(cell_numbers_add(&m->references, m->cells->count - 1, reference, m->error));
    }
    return TETLOD_OK;
}

/* Passes over what belongs to a keyword; a binary file says where the next one is. */
static enum tetlod_status skip_keyword(struct medit *m)
{
    struct text look = m->rest;
    while (!m->binary && look.at < look.end) {
        struct text word = text_word_past_comments(&look);
        if (is_keyword(word))
            break;
        m->rest = look;
    }
    return TETLOD_OK;
}

static enum tetlod_status read_keyword(struct medit *m, struct text keyword)
{
    static const struct {
        const char *name;
        unsigned char type;
        uint8_t corners;
    } cells[] = {{"Tetrahedra", VTK_TYPE_TET, 4},      {"Hexahedra", VTK_TYPE_HEXAHEDRON, 8},
                 {"Prisms", VTK_TYPE_WEDGE, 6},        {"Pyramids", VTK_TYPE_PYRAMID, 5},
                 {"Triangles", VTK_TYPE_FLAT, 3},      {"Edges", VTK_TYPE_FLAT, 2},
                 {"Quadrilaterals", VTK_TYPE_FLAT, 4}, {"Hexaedra", VTK_TYPE_HEXAHEDRON, 8}};
    if (text_is(keyword, "MeshVersionFormatted"))
        return read_version(m);
    if (text_is(keyword, "Dimension"))
        return read_dimension(m);
    if (text_is(keyword, "Vertices"))
        return read_vertices(m);
    for (size_t k = 0; k < sizeof cells / sizeof *cells; k++)
        if (text_is(keyword, cells[k].name))
            return read_cells(m, cells[k].type, cells[k].corners);
    return skip_keyword(m);
}

/* The version of a binary file, which begins with 1, the version, and the dimension as its first keyword; or 0. */
static int64_t binary_version(const unsigned char *bytes, size_t size, bool *big_endian)
{
    enum { WORDS = 6 };
    int64_t words[WORDS];
    for (int order = 0; order < 2 && size >= WORDS * 4; order++) {
        *big_endian = order == 1;
        values_to_ints(bytes, VALUE_INT32, *big_endian, WORDS, words);
        bool wide = words[1] >= 3; // the place of the next keyword, behind the dimension
        int64_t place = words[*big_endian && wide ? 4 : 3];
        if (words[0] == 1 && words[1] >= 1 && words[1] <= 4 && words[2] == 3 && place == (wide ? 24 : 20) &&
            words[wide ? 5 : 4] == 3)
            return words[1];
    }
    return 0;
}

/* The keyword of a binary file's number; empty: none that matters here. */
static struct text name_of(int64_t number)
{
    static const struct {
        int64_t number;
        const char *name;
    } names[] = {{3, "Dimension"}, {4, "Vertices"},   {5, "Edges"},     {6, "Triangles"}, {7, "Quadrilaterals"},
                 {8, "Tetrahedra"},
                 {9, "Prisms"},    {10, "Hexahedra"}, {49, "Pyramids"}, {54, "End"},      {62, "SolAtVertices"}};
    for (size_t i = 0; i < sizeof names / sizeof *names; i++)
        if (names[i].number == number)
            return (struct text){names[i].name, names[i].name + strlen(names[i].name)};
    return (struct text){NULL, NULL};
}

static enum tetlod_status read_binary(struct medit *m, int64_t version,
                                      enum tetlod_status (*read)(struct medit *m, struct text keyword))
{
    int64_t number = 0, next;
    size_t size = (size_t)(m->rest.end - m->begin);
    m->rest.at += 8;
    m->is_float = version == 1;
    m->real = version == 1 ? VALUE_FLOAT32 : VALUE_FLOAT64;
    m->integer = version == 4 ? VALUE_INT64 : VALUE_INT32;
    m->place = version < 3 ? VALUE_INT32 : VALUE_INT64;
    while (m->rest.at < m->rest.end) {
        TETLOD_TRY(take_binary_int(m, VALUE_INT32, &number));
        struct text keyword = name_of(number);
        if (keyword.at && text_is(keyword, "End"))
            return TETLOD_OK;
        TETLOD_TRY(take_binary_int(m, m->place, &next));
        if (keyword.at)
            TETLOD_TRY(read(m, keyword));
        if (next <= 0 && !keyword.at)
            return fail(m, "there is a keyword whose end is not given");
        if (next <= 0)
            continue;
        if ((uint64_t)next > size || m->begin + next < m->rest.at)
            return fail(m, "the place of the next keyword does not fit; is the file truncated?");
        m->rest.at = m->begin + next;
    }
    return TETLOD_OK;
}

/* Runs `read` on every keyword. */
static enum tetlod_status read_all(struct medit *m, enum tetlod_status (*read)(struct medit *m, struct text keyword))
{
    int64_t version = binary_version((const unsigned char *)m->begin, (size_t)(m->rest.end - m->begin), &m->big_endian);
    m->binary = version > 0;
    if (m->binary)
        return read_binary(m, version, read);
    for (;;) {
        struct text keyword = text_word_past_comments(&m->rest);
        if (keyword.at == keyword.end || text_is(keyword, "End"))
            return TETLOD_OK;
        if (!is_keyword(keyword))
            return fail(m, "there should be a keyword here");
        TETLOD_TRY(read(m, keyword));
    }
}

/* SolAtVertices: count, number of fields, the type of each; then the values of vertex after vertex. */
static enum tetlod_status read_solution_keyword(struct medit *m, struct text keyword)
{
    static const uint8_t components[] = {0, 1, 3, 6}; // scalar, vector, symmetric matrix
    int64_t count, fields, type;
    uint32_t first = m->mesh->field_count;
    if (text_is(keyword, "MeshVersionFormatted") || text_is(keyword, "Dimension"))
        return read_keyword(m, keyword);
    if (!text_is(keyword, "SolAtVertices")) // cells are those of the mesh
        return skip_keyword(m);
    TETLOD_TRY(take_int(m, &count));
    if (count != m->mesh->vertex_count)
        return fail(m, "the number of values is not the number of vertices of the mesh");
    TETLOD_TRY(take_small_int(m, &fields));
    for (int64_t f = 0; f < fields; f++) {
        TETLOD_TRY(take_small_int(m, &type));
        if (type < 1 || type > 3)
            return fail(m, "the type of a field should be 1, 2 or 3");
        if ((uint64_t)(m->rest.end - m->rest.at) < (uint64_t)m->mesh->vertex_count * components[type])
            return fail(m, "the file ends too early; is it truncated?");
        TETLOD_TRY(assemble_field(m->mesh, "solution", components[type], m->is_float ? TETLOD_FLOAT32 : TETLOD_FLOAT64,
                                  m->error));
    }
    for (uint32_t v = 0; v < m->mesh->vertex_count; v++)
        for (uint32_t f = first; f < m->mesh->field_count; f++) {
            struct point_field *field = &m->mesh->fields[f];
            for (uint32_t c = 0; c < field->components; c++)
                TETLOD_TRY(take_double(m, &field->values[(size_t)v * field->components + c]));
        }
    return TETLOD_OK;
}

static enum tetlod_status read_solution(struct medit *m, const struct io_input *input)
{
    struct tetlod_error inner = {0};
    struct tetlod_error *outer = m->error;
    const char *begin = (const char *)input->other;
    m->begin = begin;
    m->rest = (struct text){begin, begin + input->other_size};
    m->error = &inner;
    m->view = input->other_view;
    uint32_t before = m->mesh->field_count;
    enum tetlod_status status = read_all(m, read_solution_keyword);
    if (status == TETLOD_OK && m->mesh->field_count == before)
        status = fail(m, "there is no SolAtVertices");
    return status == TETLOD_OK ? TETLOD_OK : tetlodi_fail(outer, status, "%.400s: %.500s", input->other_path,
                                                          inner.message);
}

bool medit_sniff(const unsigned char *bytes, size_t size)
{
    struct text rest = {(const char *)bytes, (const char *)bytes + size};
    bool big_endian;
    return binary_version(bytes, size, &big_endian) > 0 || text_is(text_word_past_comments(&rest),
                                                                   "MeshVersionFormatted");
}

enum tetlod_status medit_read(struct blocks *out, const struct io_input *input, struct io_report *report,
                            struct tetlod_error *error)
{
    struct block *block;
    TETLOD_TRY(blocks_add(out, &block, error));
    struct tetmesh *mesh = &block->mesh;
    const char *begin = (const char *)input->bytes;
    struct medit m = {.begin = begin, .rest = {begin, begin + input->size}, .mesh = mesh, .error = error,
                      .cells = &block->cells, .view = input->view};
    enum tetlod_status status = read_all(&m, read_keyword);
    if (status == TETLOD_OK && !mesh->positions)
        status = fail(&m, "there are no Vertices; is the file truncated?");
    if (status == TETLOD_OK)
        status = cell_numbers_to_field(&m.references, mesh, "medit:ref", block->cells.count, error);
    if (status == TETLOD_OK && input->other)
        status = read_solution(&m, input);
    cell_numbers_fini(&m.references);
    (void)report;
    return status;
}
