/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * The cells are words of 4 bytes, most of them differences that are 0 where cells are numbered regularly: packing makes
 * little of these. Further points have their values beside; which point has which number follows from the order that
 * the stream keeps.
 */
#include "src/mesh/originals.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "format/fail.h"
#include "src/mesh/mixed_cells.h"
#include "src/util/array.h"

/* ---- settling */

struct marks {
    unsigned char *at; /* [count] */
    uint32_t count;
    bool outside;
};

static void mark(void *opaque, uint32_t *point)
{
    struct marks *marks = opaque;
    marks->outside |= *point >= marks->count;
    if (*point < marks->count)
        marks->at[*point] = 1;
}

static void rename_point(void *opaque, uint32_t *point)
{
    const uint32_t *names = opaque;
    *point = names[*point];
}

static enum tetlod_status drop_empty(struct tetmesh *mesh, struct tetlod_error *error)
{
    struct cells *cells = mesh->cells;
    uint32_t *names = array_new((size_t)cells->count, sizeof *names), kept = 0;
    uint64_t end = 0;
    if (!names)
        return tetlodi_fail_nomem(error, "the cells", cells->count * sizeof *names);
    memset(names, 0xff, (size_t)cells->count * sizeof *names); // TETLOD_NONE
    for (size_t t = 0; t < mesh->tet_count; t++)
        names[mesh->parents[t]] = 0;
    for (uint64_t c = 0; c < cells->count; c++) {
        uint64_t begin = cells->offsets[c], size = cells->offsets[c + 1] - begin;
        if (names[c] == TETLOD_NONE)
            continue;
        memmove(cells->connectivity + end, cells->connectivity + begin, (size_t)size * sizeof *cells->connectivity);
        cells->types[kept] = cells->types[c];
        cells->offsets[kept] = end;
        end += size;
        names[c] = kept++;
    }
    cells->offsets[kept] = cells->connectivity_count = end;
    cells->count = kept;
    for (size_t t = 0; t < mesh->tet_count; t++)
        mesh->parents[t] = names[mesh->parents[t]];
    free(names);
    return TETLOD_OK;
}

/* Rows of the points whose number is from `from` on in `names`, of which there are so many. */
static void take_rows(double *out, const double *values, uint32_t width, const uint32_t *names, uint32_t points,
                      uint32_t from)
{
    for (uint32_t v = 0; v < points; v++)
        if (names[v] != TETLOD_NONE && names[v] >= from)
            memcpy(out + (names[v] - from) * (size_t)width, values + v * (size_t)width, width * sizeof *out);
}

static enum tetlod_status take_further(struct tetmesh *mesh, const uint32_t *names, uint32_t kept, uint32_t further,
                                       struct tetlod_error *error)
{
    struct tetmesh *out = mesh->further = array_zero(1, sizeof *out);
    if (!out)
        return tetlodi_fail_nomem(error, "the further points", sizeof *out);
    out->vertex_count = further;
    out->position_type = mesh->position_type;
    out->positions = array_new(further, 3 * sizeof *out->positions);
    if (!out->positions)
        return tetlodi_fail_nomem(error, "the further points", further * (uint64_t)24);
    take_rows(out->positions, mesh->positions, 3, names, mesh->vertex_count, kept);
    for (uint32_t f = 0; f < mesh->field_count; f++) {
        const struct point_field *field = &mesh->fields[f];
        TETLOD_TRY(tetmesh_add_field(out, field->name, field->components, field->type, error));
        take_rows(out->fields[f].values, field->values, field->components, names, mesh->vertex_count, kept);
    }
    return TETLOD_OK;
}

/* Numbers of points: first those of tetrahedra, as tetmesh_drop_unused will give them, then the further ones. */
static enum tetlod_status name_points(struct tetmesh *mesh, const struct marks *used, const struct marks *wanted,
                                      uint32_t *names, struct tetlod_error *error)
{
    uint32_t kept = 0, further = 0, place = 0;
    for (uint32_t v = 0; v < mesh->vertex_count; v++)
        kept += used->at[v];
    mesh->further_places = array_new(mesh->vertex_count, sizeof *mesh->further_places);
    if (!mesh->further_places)
        return tetlodi_fail_nomem(error, "the further points", mesh->vertex_count * (uint64_t)4);
    for (uint32_t v = 0, next = 0; v < mesh->vertex_count; v++) {
        names[v] = used->at[v] ? next++ : wanted->at[v] ? kept + further : TETLOD_NONE;
        if (!used->at[v] && wanted->at[v])
            mesh->further_places[further++] = place;
        place += wanted->at[v];
    }
    for (uint64_t c = 0; c < mesh->cells->count; c++)
        cells_visit_points(mesh->cells, c, rename_point, names);
    return take_further(mesh, names, kept, further, error);
}

enum tetlod_status originals_settle(struct tetmesh *mesh, struct tetlod_error *error)
{
    if (!mesh->cells)
        return TETLOD_OK;
    TETLOD_TRY(drop_empty(mesh, error));
    struct marks used = {array_zero(mesh->vertex_count, 1), mesh->vertex_count, false};
    struct marks wanted = {array_zero(mesh->vertex_count, 1), mesh->vertex_count, false};
    uint32_t *names = array_new(mesh->vertex_count, sizeof *names);
    enum tetlod_status status = TETLOD_OK;
    if (!used.at || !wanted.at || !names)
        TETLOD_TRY_DONE(tetlodi_fail_nomem(error, "the points of cells", mesh->vertex_count * (uint64_t)6));
    for (size_t i = 0; i < 4 * (size_t)mesh->tet_count; i++)
        used.at[mesh->corners[i]] = 1;
    for (uint64_t c = 0; c < mesh->cells->count; c++)
        cells_visit_points(mesh->cells, c, mark, &wanted);
    if (wanted.outside)
        TETLOD_TRY_DONE(tetlodi_fail(error, TETLOD_ERR_MESH, "a cell refers to a point that is not there"));
    status = name_points(mesh, &used, &wanted, names, error);
done:
    free(used.at);
    free(wanted.at);
    free(names);
    return status;
}

/* ---- bytes */

enum { HEAD_WORDS = 5, NO_VALUES = 0, WORD_FLOAT32 = 1, WORD_FLOAT64 = 2 };

struct words {
    unsigned char *at;
    size_t count, used;
};

static void put_word(struct words *out, uint32_t word)
{
    for (size_t b = 0; b < 4; b++)
        out->at[4 * out->used + b] = (unsigned char)(word >> 8 * b);
    out->used++;
}

static void put_difference(struct words *out, uint32_t word, uint32_t *before)
{
    put_word(out, word - *before);
    *before = word;
}

static uint32_t kind_of(enum tetlod_type type)
{
    return type == TETLOD_FLOAT32 ? WORD_FLOAT32 : WORD_FLOAT64;
}

/* One component after the other; of float64 the lower halves first. */
static void put_values(struct words *out, const double *values, uint32_t components, uint32_t rows, uint32_t kind)
{
    for (uint32_t c = 0; c < components; c++)
        for (uint32_t half = 0; half < kind; half++)
            for (size_t row = 0; row < rows; row++) {
                double value = values[row * components + c];
                float narrow = (float)value;
                uint64_t bits = 0;
                memcpy(&bits, kind == WORD_FLOAT32 ? (void *)&narrow : (void *)&value, 4 * kind);
                put_word(out, (uint32_t)(bits >> 32 * half));
            }
}

/* A field's values at the further points, or NULL. */
static const struct point_field *further_field(const struct tetmesh *mesh, uint32_t f)
{
    uint32_t found = tetmesh_find_field(mesh->further, mesh->fields[f].name);
    return found == TETLOD_NONE || mesh->further->fields[found].components != mesh->fields[f].components
               ? NULL : &mesh->further->fields[found];
}

static size_t count_words(const struct tetmesh *mesh)
{
    const struct tetmesh *further = mesh->further;
    size_t words = HEAD_WORDS + mesh->field_count + 2 * (size_t)mesh->cells->count +
                   (size_t)mesh->cells->connectivity_count + mesh->tet_count;
    words += further->vertex_count * (size_t)(1 + 3 * kind_of(further->position_type));
    for (uint32_t f = 0; f < mesh->field_count; f++) {
        const struct point_field *field = further_field(mesh, f);
        words += field ? (size_t)further->vertex_count * field->components * kind_of(field->type) : 0;
    }
    return words;
}

static uint32_t size_of(const struct cells *cells, uint64_t c)
{
    return (uint32_t)(cells->offsets[c + 1] - cells->offsets[c]);
}

/* How far behind an entry of the connectivity lies the one that predicts it: in the cell before, if that has as many
 * entries. */
static uint64_t distance_back(const struct cells *cells, uint64_t c)
{
    return c && size_of(cells, c) == size_of(cells, c - 1) ? size_of(cells, c) : 1;
}

static void put_cells(struct words *out, const struct tetmesh *mesh)
{
    const struct cells *cells = mesh->cells;
    uint32_t before = 0;
    for (uint64_t c = 0; c < cells->count; c++)
        put_difference(out, cells->types[c], &before);
    before = 0;
    for (uint64_t c = 0; c < cells->count; c++)
        put_difference(out, size_of(cells, c), &before);
    for (uint64_t c = 0; c < cells->count; c++)
        for (uint64_t i = cells->offsets[c], back = distance_back(cells, c); i < cells->offsets[c + 1]; i++)
            put_word(out, cells->connectivity[i] - (i >= back ? cells->connectivity[i - back] : 0));
    before = 0;
    for (size_t t = 0; t < mesh->tet_count; t++)
        put_difference(out, mesh->parents[t], &before);
}

enum tetlod_status originals_encode(const struct tetmesh *mesh, unsigned char **out, size_t *out_size,
                                    struct tetlod_error *error)
{
    const struct tetmesh *further = mesh->further;
    struct words words = {.count = count_words(mesh)};
    uint32_t before = 0;
    *out = words.at = array_new(words.count, 4);
    *out_size = 4 * words.count;
    if (!words.at)
        return tetlodi_fail_nomem(error, "the cells", 4 * (uint64_t)words.count);
    if (mesh->cells->connectivity_count > UINT32_MAX)
        return tetlodi_fail(error, TETLOD_ERR_LIMIT, "the cells have more corners than fit; leave --keep-order out");
    put_word(&words, (uint32_t)mesh->cells->count);
    put_word(&words, (uint32_t)mesh->cells->connectivity_count);
    put_word(&words, further->vertex_count);
    put_word(&words, mesh->field_count);
    put_word(&words, kind_of(further->position_type));
    for (uint32_t f = 0; f < mesh->field_count; f++)
        put_word(&words, further_field(mesh, f) ? kind_of(further_field(mesh, f)->type) : NO_VALUES);
    put_cells(&words, mesh);
    for (uint32_t e = 0; e < further->vertex_count; e++)
        put_difference(&words, mesh->further_places[e], &before);
    put_values(&words, further->positions, 3, further->vertex_count, kind_of(further->position_type));
    for (uint32_t f = 0; f < mesh->field_count; f++) {
        const struct point_field *field = further_field(mesh, f);
        if (field)
            put_values(&words, field->values, field->components, further->vertex_count, kind_of(field->type));
    }
    return TETLOD_OK;
}

/* ---- and back */

static uint32_t get_word(struct words *in)
{
    uint32_t word = 0;
    for (size_t b = 0; b < 4 && in->used < in->count; b++)
        word |= (uint32_t)in->at[4 * in->used + b] << 8 * b;
    in->used++; // beyond the end the table is refused
    return word;
}

static void get_values(struct words *in, double *values, uint32_t components, uint32_t rows, uint32_t kind)
{
    for (uint32_t c = 0; c < components; c++) {
        size_t first = in->used;
        for (size_t row = 0; row < rows; row++) {
            in->used = first + row;
            uint64_t bits = get_word(in);
            in->used = first + rows + row;
            bits |= kind == WORD_FLOAT64 ? (uint64_t)get_word(in) << 32 : 0;
            float narrow;
            double value;
            memcpy(&value, &bits, sizeof value);
            uint32_t low = (uint32_t)bits;
            memcpy(&narrow, &low, sizeof narrow);
            values[row * components + c] = kind == WORD_FLOAT32 ? (double)narrow : value;
        }
        in->used = first + (size_t)kind * rows;
    }
}

/* What a section holds, beside the mesh of the finest level. */
struct reading {
    struct tetmesh *mesh;
    struct words in;
    struct cells cells;
    uint32_t further, field_count, kind, points; /* points: of the original */
    uint32_t *kinds, *places, *first_tet, *names; /* names: of each vertex and further point, in the original */
    unsigned char *wanted;
    bool of_step;
};

static void reading_fini(struct reading *r)
{
    cells_fini(&r->cells);
    free(r->kinds);
    free(r->places);
    free(r->first_tet);
    free(r->names);
    free(r->wanted);
}

static enum tetlod_status fail_damaged(struct tetlod_error *error)
{
    return tetlodi_fail(error, TETLOD_ERR_STREAM, "the original cells are damaged");
}

/* Counts that the bytes hold, and room for what they count. */
static enum tetlod_status read_head(struct reading *r, struct tetlod_error *error)
{
    struct words *in = &r->in;
    r->cells.count = get_word(in);
    r->cells.connectivity_count = get_word(in);
    r->further = get_word(in);
    r->field_count = get_word(in);
    r->kind = get_word(in);
    uint64_t least = HEAD_WORDS + (uint64_t)r->field_count + 2 * r->cells.count + r->cells.connectivity_count +
                     r->mesh->tet_count + r->further * UINT64_C(4);
    uint64_t points = (uint64_t)r->mesh->vertex_count + r->further;
    if (!r->cells.count || least > in->count || r->kind < WORD_FLOAT32 || r->kind > WORD_FLOAT64 ||
        points >= TETLOD_NONE ||
        (!r->of_step && r->field_count > r->mesh->field_count))
        return fail_damaged(error);
    r->cells.types = array_new((size_t)r->cells.count, 1);
    r->cells.offsets = array_new((size_t)r->cells.count + 1, sizeof *r->cells.offsets);
    r->cells.connectivity = array_new((size_t)r->cells.connectivity_count, sizeof *r->cells.connectivity);
    r->kinds = array_new(r->field_count, sizeof *r->kinds);
    r->places = array_new(r->further, sizeof *r->places);
    r->first_tet = array_new((size_t)r->cells.count, sizeof *r->first_tet);
    r->names = array_new((size_t)points, sizeof *r->names);
    r->wanted = array_zero((size_t)points, 1);
    if (!r->cells.types || !r->cells.offsets || !r->cells.connectivity || !r->kinds || !r->places || !r->first_tet ||
        !r->names || !r->wanted)
        return tetlodi_fail_nomem(error, "the original cells", 4 * (uint64_t)in->count);
    uint64_t values = 3 * (uint64_t)r->kind, known = HEAD_WORDS + r->field_count;
    bool good = true;
    for (uint32_t f = 0; f < r->field_count; f++) {
        r->kinds[f] = get_word(in);
        good &= r->kinds[f] <= WORD_FLOAT64;
        values += f < r->mesh->field_count ? (uint64_t)(r->kinds[f] & 3) * r->mesh->fields[f].components : 0;
    }
    known += 2 * r->cells.count + r->cells.connectivity_count + r->mesh->tet_count;
    return good && known + r->further * (1 + values) == in->count ? TETLOD_OK : fail_damaged(error);
}

static bool read_connectivity(struct reading *r)
{
    struct cells *cells = &r->cells;
    struct marks wanted = {r->wanted, r->mesh->vertex_count + r->further, false};
    uint32_t word = 0;
    bool good = true;
    for (uint64_t c = 0; c < cells->count; c++) {
        word += get_word(&r->in);
        good &= word <= UINT8_MAX;
        cells->types[c] = (unsigned char)word;
    }
    word = 0;
    cells->offsets[0] = 0;
    for (uint64_t c = 0; c < cells->count && good; c++) {
        word += get_word(&r->in);
        good = word >= 4 && word <= cells->connectivity_count - cells->offsets[c];
        cells->offsets[c + 1] = cells->offsets[c] + word;
    }
    if (!good || cells->offsets[cells->count] != cells->connectivity_count)
        return false;
    for (uint64_t c = 0; c < cells->count && good; c++) {
        for (uint64_t i = cells->offsets[c], back = distance_back(cells, c); i < cells->offsets[c + 1]; i++)
            cells->connectivity[i] = get_word(&r->in) + (i >= back ? cells->connectivity[i - back] : 0);
        good = cells_visit_points(cells, c, mark, &wanted);
    }
    return good && !wanted.outside;
}

/* Every cell has a tetrahedron. */
static bool read_parents(struct reading *r)
{
    uint32_t word = 0;
    bool good = true;
    memset(r->first_tet, 0xff, (size_t)r->cells.count * sizeof *r->first_tet); // TETLOD_NONE
    for (uint32_t t = 0; t < r->mesh->tet_count && good; t++) {
        word += get_word(&r->in);
        good = word < r->cells.count;
        if (good && r->first_tet[word] == TETLOD_NONE)
            r->first_tet[word] = t;
    }
    for (uint64_t c = 0; c < r->cells.count && good; c++)
        good = r->first_tet[c] != TETLOD_NONE;
    return good;
}

/* Further points have the places that are said, the others those that are left, in their order. */
static bool read_places(struct reading *r)
{
    uint32_t vertices = r->mesh->vertex_count, word = 0, e = 0, v = 0;
    for (uint32_t i = 0; i < r->further; i++) {
        word += get_word(&r->in);
        if ((i && word <= r->places[i - 1]) || !r->wanted[vertices + i])
            return false;
        r->places[i] = word;
    }
    for (uint32_t i = 0; i < vertices; i++)
        r->points += r->wanted[i];
    r->points += r->further;
    for (uint32_t place = 0; place < r->points; place++) {
        if (e < r->further && r->places[e] == place) {
            r->names[vertices + e++] = place;
            continue;
        }
        while (v < vertices && !r->wanted[v])
            v++;
        if (v == vertices)
            return false;
        r->names[v++] = place;
    }
    return e == r->further;
}

/* Rows of vertices and further points in the original's order; further ones without values are NaN. */
static enum tetlod_status merge_rows(struct reading *r, double **rows, uint32_t components, uint32_t kind,
                                     struct tetlod_error *error)
{
    uint32_t vertices = r->mesh->vertex_count;
    size_t size = components * sizeof(double);
    double *out = array_new(r->points, size), *further = array_new(r->further, size);
    for (size_t i = 0; i < (size_t)r->further * components && further; i++)
        further[i] = NAN;
    if (further && kind != NO_VALUES)
        get_values(&r->in, further, components, r->further, kind);
    for (uint32_t i = 0; i < vertices + r->further && out && further; i++)
        if (r->wanted[i])
            memcpy(out + r->names[i] * (size_t)components,
                   i < vertices ? *rows + i * (size_t)components : further + (i - vertices) * (size_t)components, size);
    free(further);
    if (!out || !further)
        return tetlodi_fail_nomem(error, "the original points", r->points * (uint64_t)size);
    free(*rows);
    *rows = out;
    return TETLOD_OK;
}

static enum tetlod_status take_cell_values(struct reading *r, struct tetlod_error *error)
{
    for (uint32_t f = 0; f < r->mesh->cell_field_count; f++) {
        struct point_field *field = &r->mesh->cell_fields[f];
        size_t n = field->components;
        double *values = array_new((size_t)r->cells.count, n * sizeof *values);
        if (!values)
            return tetlodi_fail_nomem(error, field->name, r->cells.count * n * sizeof *values);
        for (uint64_t c = 0; c < r->cells.count; c++)
            memcpy(values + c * n, field->values + r->first_tet[c] * n, n * sizeof *values);
        free(field->values);
        field->values = values;
    }
    return TETLOD_OK;
}

static enum tetlod_status read_all(struct reading *r, struct tetlod_error *error)
{
    struct tetmesh *mesh = r->mesh;
    TETLOD_TRY(read_head(r, error));
    if (r->of_step && r->further)
        return tetlodi_fail(error, TETLOD_ERR_ARGUMENT,
                            "the original cells have points that no tetrahedron has (the middles of edges), and these "
                            "have no values at steps; leave --cells original out");
    if (!read_connectivity(r) || !read_parents(r) || !read_places(r))
        return fail_damaged(error);
    TETLOD_TRY(merge_rows(r, &mesh->positions, 3, r->kind, error));
    for (uint32_t f = 0; f < mesh->field_count; f++)
        TETLOD_TRY(merge_rows(r, &mesh->fields[f].values, mesh->fields[f].components,
                              f < r->field_count ? r->kinds[f] : NO_VALUES, error));
    TETLOD_TRY(take_cell_values(r, error));
    for (uint64_t c = 0; c < r->cells.count; c++)
        cells_visit_points(&r->cells, c, rename_point, r->names);
    mesh->cells = array_new(1, sizeof *mesh->cells);
    if (!mesh->cells)
        return tetlodi_fail_nomem(error, "the original cells", sizeof *mesh->cells);
    *mesh->cells = r->cells;
    r->cells = (struct cells){0};
    free(mesh->corners);
    mesh->corners = NULL;
    mesh->vertex_count = r->points;
    mesh->tet_count = (uint32_t)mesh->cells->count;
    return TETLOD_OK;
}

enum tetlod_status originals_decode(struct tetmesh *mesh, const unsigned char *bytes, size_t size, bool of_step,
                                    struct tetlod_error *error)
{
    struct reading r = {.mesh = mesh, .of_step = of_step};
    unsigned char *copy = array_new(size, 1);
    if (!copy)
        return tetlodi_fail_nomem(error, "the original cells", size);
    if (size)
        memcpy(copy, bytes, size);
    r.in = (struct words){copy, size / 4, 0};
    enum tetlod_status status = size % 4 ? fail_damaged(error) : read_all(&r, error);
    reading_fini(&r);
    free(copy);
    return status;
}
