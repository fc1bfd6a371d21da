/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * The overlay is of the belt and of those few of the finest tetrahedra on which the maximum hangs:
 *   1. a guess: the largest difference at a finest vertex inside a tetrahedron of the belt;
 *   2. by a grid of the belt's values, the finest tetrahedra that may differ by more than the guess: they are wanted;
 *   3. the overlay of these, with all that lies near them, because where the finest level covers a place twice the better one counts.
 * What is above the guess is the maximum. If nothing is, the finest level overlaps itself and the guess was the worse one: then all is
 * measured without a guess.
 */
#include "src/measure/region_error.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "format/fail.h"
#include "src/measure/overlay.h"
#include "src/measure/value_grid.h"
#include "src/mesh/tet_geom.h"
#include "src/util/array.h"

/* A vertex inside a tetrahedron is this far from its faces, by weights: on a face it might be of another body. */
static const double INSIDE = 1e-6;

/* Rounding of a guess. */
static const double SLACK = 1e-9;

/* The controlled fields, and their components in a row. */
struct controlled {
    uint32_t count, width;
    uint32_t *fields, *places; /* [count]; 0, 1, 2 ... */
    uint32_t *of;              /* [width] place in `fields` */
};

struct region_measure {
    const struct forest *forest;
    const struct tetlod_level *level; /* the finest */
    struct forest_view *view;
    struct controlled controlled;
    struct tetmesh belt;          /* borrows all but its corners */
    struct value_grid grid;       /* of the belt */
    double *positions, *values;   /* [vertex of the level] */
    uint8_t (*cells)[3];          /* [vertex of the level] */
    uint32_t *first, *order;      /* [cell + 1], [vertex of the level]: the vertices in each cell */
    double *guess;                /* [controlled field] */
    unsigned char *far;           /* [tet of the level] it may differ by more than the guess */
    unsigned char *near;          /* [cell] such a tetrahedron touches it */
    uint32_t *numbers;            /* [vertex of the level] in `finest` */
    struct tetmesh finest;        /* what lies near */
    uint8_t *wanted;              /* [tet of `finest`] */
};

static void drop_finest(struct region_measure *m)
{
    tetmesh_fini(&m->finest);
    free(m->numbers);
    free(m->far);
    free(m->near);
    free(m->wanted);
    m->numbers = NULL;
    m->far = m->near = m->wanted = NULL;
}

static void measure_fini(struct region_measure *m)
{
    forest_view_free(m->view);
    value_grid_fini(&m->grid);
    drop_finest(m);
    void *const owned[] = {m->controlled.fields, m->controlled.places, m->controlled.of, m->belt.corners, m->positions,
                           m->values,            m->cells,             m->first,         m->order,        m->guess};
    for (size_t i = 0; i < sizeof owned / sizeof *owned; i++)
        free(owned[i]);
}

uint64_t region_error_bytes(const struct tetlod_info *info)
{
    const struct tetlod_level *finest = &info->levels[info->level_count - 1];
    uint64_t width = 3;
    for (uint32_t f = 0; f < info->field_count; f++)
        width += info->fields[f].components;
    return finest->vertices * (16 * width + 3 + 4 + 4 + 8) + finest->tets * (uint64_t)(18 + 2 * 112 + 48 + 1 + 20 + 12) + ((uint64_t)48 << 20);
}

/* ---- what is compared ---- */

static bool list_controlled(const struct tetlod_info *info, struct controlled *out)
{
    uint32_t components = 0;
    for (uint32_t f = 0; f < info->field_count; f++)
        components += info->fields[f].components;
    out->fields = array_new(info->field_count, sizeof *out->fields);
    out->places = array_new(info->field_count, sizeof *out->places);
    out->of = array_new(components, sizeof *out->of);
    if (!out->fields || !out->places || !out->of)
        return false;
    for (uint32_t f = 0; f < info->field_count; f++) {
        if (!info->fields[f].controlled)
            continue;
        for (uint32_t c = 0; c < info->fields[f].components; c++)
            out->of[out->width++] = out->count;
        out->places[out->count] = out->count;
        out->fields[out->count++] = f;
    }
    return true;
}

/* The belt as a mesh that borrows all but its corners. */
static bool take_belt(const struct tetmesh *mesh, struct tetmesh *out)
{
    const double *parts = mesh->cell_fields[tetmesh_find_cell_field(mesh, REGION_FIELD)].values;
    *out = *mesh;
    out->cell_field_count = 0;
    out->tet_count = 0;
    out->corners = array_new(mesh->tet_count, 4 * sizeof *out->corners);
    for (size_t t = 0; out->corners && t < mesh->tet_count; t++)
        if (parts[t] == (double)REGION_BELT)
            memcpy(out->corners + 4 * (size_t)out->tet_count++, mesh->corners + 4 * t, 16);
    return out->corners != NULL;
}

/* The components of a field into rows of `width`. */
static void put_columns(const double *values, uint32_t components, size_t count, uint32_t width, double *out)
{
    for (size_t v = 0; v < count; v++)
        memcpy(out + v * width, values + v * components, components * sizeof *out);
}

static enum tetlod_status make_grid(struct region_measure *m, struct tetlod_error *error)
{
    uint32_t width = m->controlled.width, column = 0;
    double *rows = array_new(m->belt.vertex_count, width * sizeof *rows);
    if (!rows)
        return tetlodi_fail_nomem(error, "a region's error", (uint64_t)m->belt.vertex_count * width * 8);
    for (uint32_t i = 0; i < m->controlled.count; i++) {
        const struct point_field *field = &m->belt.fields[m->controlled.fields[i]];
        put_columns(field->values, field->components, m->belt.vertex_count, width, rows + column);
        column += field->components;
    }
    enum tetlod_status status = value_grid_init(&m->grid, &m->belt, rows, width, error);
    free(rows);
    return status;
}

/* The finest level's vertices: positions, rows of values, cells. */
static enum tetlod_status take_level(struct region_measure *m, struct tetlod_error *error)
{
    enum { BLOCK = 256 };
    const struct tetlod_info *info = forest_info(m->forest);
    uint32_t vertices = m->level->vertices, width = m->controlled.width;
    TETLOD_TRY(forest_view_new(&m->view, m->forest, info->level_count - 1, error));
    m->positions = array_new(vertices, 3 * sizeof *m->positions);
    m->values = array_new(vertices, width * sizeof *m->values);
    m->cells = array_new(vertices, sizeof *m->cells);
    double *block = array_new(BLOCK * (size_t)width, sizeof *block);
    if (!m->positions || !m->values || !m->cells || !block) {
        free(block);
        return tetlodi_fail_nomem(error, "a region's error", vertices * (uint64_t)(8 * width + 27));
    }
    for (uint32_t first = 0; first < vertices; first += BLOCK) {
        size_t count = vertices - first < BLOCK ? vertices - first : BLOCK;
        double *p = m->positions + 3 * (size_t)first, *rows = m->values + (size_t)width * first;
        forest_view_values(m->view, 0, first, count, p);
        for (uint32_t i = 0, column = 0; i < m->controlled.count; i++) {
            uint32_t field = m->controlled.fields[i];
            forest_view_values(m->view, 1 + field, first, count, block);
            put_columns(block, info->fields[field].components, count, width, rows + column);
            column += info->fields[field].components;
        }
        for (size_t v = 0; v < 3 * count; v++)
            m->cells[first + v / 3][v % 3] = grid_coordinate(&m->grid, p[v], (int)(v % 3));
    }
    free(block);
    return TETLOD_OK;
}

/* ---- the guess ---- */

static bool list_vertices(struct region_measure *m)
{
    size_t cells = m->grid.cell_count;
    m->first = array_zero(cells + 1, sizeof *m->first);
    m->order = array_new(m->level->vertices, sizeof *m->order);
    if (!m->first || !m->order)
        return false;
    for (uint32_t v = 0; v < m->level->vertices; v++)
        m->first[grid_number(&m->grid, m->cells[v][0], m->cells[v][1], m->cells[v][2])]++;
    for (size_t c = 0, before = 0; c <= cells; c++) {
        before += m->first[c];
        m->first[c] = (uint32_t)before; // the end; the loop below makes it the start
    }
    for (uint32_t v = m->level->vertices; v-- > 0;)
        m->order[--m->first[grid_number(&m->grid, m->cells[v][0], m->cells[v][1], m->cells[v][2])]] = v;
    return true;
}

static void guess_at(struct region_measure *m, const uint32_t *corners, const struct grid_tet *tet, uint32_t vertex)
{
    const double *p = m->positions + 3 * (size_t)vertex, *row = m->values + (size_t)m->controlled.width * vertex;
    double weights[4] = {1, 0, 0, 0};
    for (int k = 1; k < 4; k++) {
        for (int i = 0; i < 3; i++)
            weights[k] += tet->rows[k - 1][i] * (p[i] - tet->corners[0][i]);
        weights[0] -= weights[k];
        if (weights[k] < INSIDE)
            return;
    }
    if (weights[0] < INSIDE)
        return;
    for (uint32_t i = 0, column = 0; i < m->controlled.count; i++) {
        const struct point_field *field = &m->belt.fields[m->controlled.fields[i]];
        for (uint32_t c = 0; c < field->components; c++, column++) {
            double value = 0;
            for (int k = 0; k < 4; k++)
                value += weights[k] * field->values[(size_t)corners[k] * field->components + c];
            m->guess[i] = larger(m->guess[i], fabs(value - row[column]) - SLACK * (fabs(value) + fabs(row[column])));
        }
    }
}

/* The finest vertices in the cells that a tetrahedron of the belt touches. Along the last axis the cells lie in a row. */
static void guess_tet(struct region_measure *m, uint32_t number)
{
    struct grid_tet tet;
    uint8_t from[3], to[3];
    grid_tet_set(&tet, &m->belt, number);
    if (!tet.known)
        return;
    for (int i = 0; i < 3; i++) {
        from[i] = grid_coordinate(&m->grid, tet.low[i], i);
        to[i] = grid_coordinate(&m->grid, tet.high[i], i);
    }
    for (int x = from[0]; x <= to[0]; x++)
        for (int y = from[1]; y <= to[1]; y++) {
            uint32_t end = m->first[grid_number(&m->grid, x, y, to[2]) + 1];
            for (uint32_t i = m->first[grid_number(&m->grid, x, y, from[2])]; i < end; i++)
                guess_at(m, m->belt.corners + 4 * (size_t)number, &tet, m->order[i]);
        }
}

/* ---- what hangs on it ---- */

/* The cells that a tetrahedron of the finest level touches. */
struct span {
    int from[3], to[3];
};

static struct span span_of(const struct region_measure *m, const uint32_t corners[4])
{
    struct span span;
    for (int i = 0; i < 3; i++) {
        int at[4];
        for (int c = 0; c < 4; c++)
            at[c] = m->cells[corners[c]][i];
        int low[2] = {at[0] < at[1] ? at[0] : at[1], at[2] < at[3] ? at[2] : at[3]};
        int high[2] = {at[0] > at[1] ? at[0] : at[1], at[2] > at[3] ? at[2] : at[3]};
        span.from[i] = low[0] < low[1] ? low[0] : low[1];
        span.to[i] = high[0] > high[1] ? high[0] : high[1];
    }
    return span;
}

static bool touches(const struct region_measure *m, const struct span *span, const unsigned char *marks)
{
    for (int x = span->from[0]; x <= span->to[0]; x++)
        for (int y = span->from[1]; y <= span->to[1]; y++)
            for (int z = span->from[2]; z <= span->to[2]; z++)
                if (marks[grid_number(&m->grid, x, y, z)])
                    return true;
    return false;
}

/* Whether what the belt has in a cell may be further than the guess from what the corners have. */
static bool is_far_in(const struct region_measure *m, size_t cell, const uint32_t corners[4])
{
    uint32_t width = m->controlled.width;
    for (uint32_t c = 0; c < width && m->grid.marked[cell]; c++) {
        const double *range = m->grid.ranges + 2 * (cell * width + c);
        double least = INFINITY, most = -INFINITY;
        for (int k = 0; k < 4; k++) {
            double value = m->values[(size_t)width * corners[k] + c];
            least = smaller(least, value);
            most = larger(most, value);
        }
        if (larger(range[1] - least, most - range[0]) > m->guess[m->controlled.of[c]])
            return true;
    }
    return false;
}

/* Whether a finest tetrahedron may differ by more than the guess. */
static bool may_be_far(const struct region_measure *m, const struct span *span, const uint32_t corners[4])
{
    if (!touches(m, span, m->grid.marked))
        return false;
    for (int x = span->from[0]; x <= span->to[0]; x++)
        for (int y = span->from[1]; y <= span->to[1]; y++)
            for (int z = span->from[2]; z <= span->to[2]; z++)
                if (is_far_in(m, grid_number(&m->grid, x, y, z), corners))
                    return true;
    return false;
}

static void mark_near(struct region_measure *m, const struct span *span)
{
    for (int x = span->from[0]; x <= span->to[0]; x++)
        for (int y = span->from[1]; y <= span->to[1]; y++)
            for (int z = span->from[2]; z <= span->to[2]; z++)
                m->near[grid_number(&m->grid, x, y, z)] = 1;
}

static bool add_tet(struct region_measure *m, const uint32_t corners[4], bool wanted, size_t capacities[2])
{
    struct tetmesh *out = &m->finest;
    if (!array_reserve((void **)&out->corners, &capacities[0], (size_t)out->tet_count + 1, 4 * sizeof *out->corners) ||
        !array_reserve((void **)&m->wanted, &capacities[1], (size_t)out->tet_count + 1, 1))
        return false;
    for (size_t c = 0; c < 4; c++) {
        uint32_t *number = &m->numbers[corners[c]];
        if (*number == TETLOD_NONE)
            *number = out->vertex_count++;
        out->corners[4 * (size_t)out->tet_count + c] = *number;
    }
    m->wanted[out->tet_count++] = wanted;
    return true;
}

/* Takes what may be far and what lies near that. */
static enum tetlod_status take_tets(struct region_measure *m, struct tetlod_error *error)
{
    size_t capacities[2] = {0, 0};
    bool room = true;
    m->numbers = array_new(m->level->vertices, sizeof *m->numbers);
    m->far = array_new(m->level->tets, 1);
    m->near = array_zero(m->grid.cell_count, 1);
    if (!m->numbers || !m->far || !m->near)
        return tetlodi_fail_nomem(error, "a region's error", m->level->vertices * (uint64_t)4 + m->level->tets);
    memset(m->numbers, 0xff, m->level->vertices * sizeof *m->numbers);
    for (int turn = 0; turn < 2; turn++)
        for (uint32_t t = 0; room && t < m->level->tets; t++) {
            uint32_t corners[4];
            forest_view_corners(m->view, t, 1, corners);
            struct span span = span_of(m, corners);
            if (turn == 0 && (m->far[t] = may_be_far(m, &span, corners)))
                mark_near(m, &span);
            else if (turn == 1 && touches(m, &span, m->near))
                room = add_tet(m, corners, m->far[t], capacities);
        }
    return room ? TETLOD_OK : tetlodi_fail_nomem(error, "a region's error", (uint64_t)m->finest.tet_count * 17);
}

static enum tetlod_status take_vertices(struct region_measure *m, struct tetlod_error *error)
{
    struct tetmesh *out = &m->finest;
    out->position_type = m->belt.position_type;
    out->positions = array_new(out->vertex_count, 3 * sizeof *out->positions);
    if (!out->positions)
        return tetlodi_fail_nomem(error, "a region's error", (uint64_t)out->vertex_count * 24);
    for (uint32_t i = 0; i < m->controlled.count; i++) {
        const struct point_field *field = &m->belt.fields[m->controlled.fields[i]];
        TETLOD_TRY(tetmesh_add_field(out, field->name, field->components, field->type, error));
    }
    for (uint32_t v = 0; v < m->level->vertices; v++) {
        uint32_t to = m->numbers[v];
        const double *row = m->values + (size_t)m->controlled.width * v;
        if (to == TETLOD_NONE)
            continue;
        memcpy(out->positions + 3 * (size_t)to, m->positions + 3 * (size_t)v, 3 * sizeof *out->positions);
        for (uint32_t i = 0; i < out->field_count; row += out->fields[i++].components)
            memcpy(out->fields[i].values + (size_t)to * out->fields[i].components, row, out->fields[i].components * sizeof *row);
    }
    return TETLOD_OK;
}

/* ---- the whole ---- */

/* The largest differences as far as they are above the guess. */
static enum tetlod_status overlay_above(struct region_measure *m, unsigned threads, double *most, struct tetlod_error *error)
{
    struct overlay_report report;
    TETLOD_TRY(take_tets(m, error));
    TETLOD_TRY(take_vertices(m, error));
    return overlay_max(&m->belt, m->controlled.fields, &m->finest, m->controlled.places, m->controlled.count,
                       &(struct overlay_options){.threads = threads, .wanted = m->wanted, .floors = m->guess}, most, &report, error);
}

/* False if nothing is above a guess, which was less than a difference that was seen: then there is none. */
static bool keep_guess(struct region_measure *m, const double *most)
{
    bool reached = true;
    for (uint32_t i = 0; i < m->controlled.count; i++)
        reached &= most[i] > m->guess[i] || m->guess[i] == 0;
    for (uint32_t i = 0; i < m->controlled.count && !reached; i++)
        m->guess[i] = 0;
    return reached;
}

static enum tetlod_status measure_belt(struct region_measure *m, unsigned threads, double *most, struct tetlod_error *error)
{
    TETLOD_TRY(make_grid(m, error));
    TETLOD_TRY(take_level(m, error));
    m->guess = array_zero(m->controlled.count, sizeof *m->guess);
    if (!m->guess || !list_vertices(m))
        return tetlodi_fail_nomem(error, "a region's error", m->level->vertices * (uint64_t)4);
    for (uint32_t t = 0; t < m->belt.tet_count; t++)
        guess_tet(m, t);
    TETLOD_TRY(overlay_above(m, threads, most, error));
    if (keep_guess(m, most))
        return TETLOD_OK;
    drop_finest(m);
    return overlay_above(m, threads, most, error);
}

enum tetlod_status region_error(const struct forest *forest, const struct tetmesh *mesh, unsigned threads, double *out,
                                struct tetlod_error *error)
{
    const struct tetlod_info *info = forest_info(forest);
    struct region_measure m = {.forest = forest, .level = &info->levels[info->level_count - 1]};
    double *most = array_zero(info->field_count, sizeof *most);
    enum tetlod_status status = most && list_controlled(info, &m.controlled) && take_belt(mesh, &m.belt)
                                    ? TETLOD_OK
                                    : tetlodi_fail_nomem(error, "a region's error", mesh->tet_count * (uint64_t)16);
    if (status == TETLOD_OK && m.belt.tet_count && m.controlled.count)
        status = measure_belt(&m, threads, most, error);
    for (uint32_t f = 0; f < mesh->field_count; f++)
        out[f] = 0;
    for (uint32_t i = 0; status == TETLOD_OK && i < m.controlled.count; i++)
        out[m.controlled.fields[i]] = most[i];
    measure_fini(&m);
    free(most);
    return status;
}
