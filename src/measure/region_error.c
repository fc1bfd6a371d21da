/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * The maximum hangs on a few of the finest tetrahedra:
 *   1. a guess: the largest difference at a finest vertex inside a tetrahedron of the transition;
 *   2. the finest tetrahedra that may differ by more than the guess (transition.h);
 *   3. the overlay of these with the transition.
 * What is above the guess is the maximum. If nothing is, the region overlaps itself and the guess was the worse of two
 * values: then all is measured without a guess.
 *
 * A local bound b holds in a tetrahedron if neither s + (M - b) nor s - (M - b) is further than M from the original
 * there, with s the field and M the largest value of b: what they are further off is what b lacks.
 */
#include "src/measure/region_error.h"

#include <float.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "format/fail.h"
#include "src/measure/overlay.h"
#include "src/measure/transition.h"
#include "src/mesh/tet_geom.h"
#include "src/util/array.h"

/* A vertex inside a tetrahedron is this far from its faces, by weights: on a face it might be of another sheet. */
static const double INSIDE = 1e-6;

/* Rounding of a guess; what a local bound may lack, which is within the promise (PROOF.md, 3). */
static const double SLACK = 1e-9;

struct measuring {
    const struct transition *transition;
    unsigned threads;
    uint32_t *first, *order; /* [cell + 1], [vertex of the finest level]: the vertices in each cell */
    double *guess;           /* [compared field] */
};

/* What is too little to be counted one by one: numbers of fields. */
enum { SMALL_BYTES = 1 << 14 };

uint64_t region_error_most_bytes(const struct tetlod_info *info)
{
    const struct tetlod_level *finest = &info->levels[info->level_count - 1];
    const uint64_t grid_cells = 1 << 18, corners = 4 * sizeof(uint32_t), of_bound = 2 * sizeof(double);
    uint32_t width = 0;
    for (uint32_t f = 0; f < info->field_count; f++)
        width += info->fields[f].components;
    uint64_t of_vertex = 3 * (3 + width) * sizeof(double) + 8 * sizeof(uint32_t) + (2 * width + 1) * sizeof(double);
    return SMALL_BYTES + value_grid_bytes(finest->tets, width) + grid_cells * sizeof(uint32_t) +
           finest->vertices * of_vertex + finest->tets * (5 * corners + 1 + of_bound) +
           overlay_bytes(finest->tets, finest->tets);
}

/* ---- the guess ---- */

static enum tetlod_status list_vertices(struct measuring *m, struct tetlod_error *error)
{
    const struct value_grid *grid = &m->transition->grid;
    const struct finest *finest = &m->transition->finest;
    size_t cells = grid->cell_count;
    const uint64_t bytes = (cells + 1 + finest->vertices) * sizeof(uint32_t);
    TETLOD_TRY(room_take(m->transition->room, bytes, error));
    m->first = array_zero(cells + 1, sizeof *m->first);
    m->order = array_new(finest->vertices, sizeof *m->order);
    if (!m->first || !m->order)
        return tetlodi_fail_nomem(error, "a region's error", bytes);
    for (uint32_t v = 0; v < finest->vertices; v++)
        m->first[grid_number(grid, finest->cells[v][0], finest->cells[v][1], finest->cells[v][2])]++;
    for (size_t c = 0, before = 0; c <= cells; c++) {
        before += m->first[c];
        m->first[c] = (uint32_t)before; // the end; the loop below makes it the start
    }
    for (uint32_t v = finest->vertices; v-- > 0;)
        m->order[--m->first[grid_number(grid, finest->cells[v][0], finest->cells[v][1], finest->cells[v][2])]] = v;
    return TETLOD_OK;
}

static void guess_at(struct measuring *m, const uint32_t *corners, const struct grid_tet *tet, uint32_t vertex)
{
    const struct transition *t = m->transition;
    const double *p = t->finest.positions + 3 * (size_t)vertex,
                 *row = t->finest.values + (size_t)t->fields.width * vertex;
    double weights[4] = {1, 0, 0, 0};
    for (int k = 1; k < 4; k++) {
        for (int i = 0; i < 3; i++)
            weights[k] += tet->rows[k - 1][i] * (p[i] - tet->corners[0][i]);
        weights[0] -= weights[k];
        if (weights[k] < INSIDE)
            return;
    }
    if (weights[0] < INSIDE || t->finest.bodies[vertex] != t->bodies[corners[0]])
        return;
    for (uint32_t i = 0, column = 0; i < t->fields.count; i++) {
        const struct point_field *field = &t->tets.fields[t->fields.fields[i]];
        for (uint32_t c = 0; c < field->components; c++, column++) {
            double value = 0;
            for (int k = 0; k < 4; k++)
                value += weights[k] * field->values[(size_t)corners[k] * field->components + c];
            m->guess[i] = larger(m->guess[i], fabs(value - row[column]) - SLACK * (fabs(value) + fabs(row[column])));
        }
    }
}

/* The finest vertices in the cells that a tetrahedron of the transition touches. Along the last axis the cells lie in a
 * row. */
static void guess_tet(struct measuring *m, uint32_t number)
{
    const struct transition *t = m->transition;
    struct grid_tet tet;
    uint8_t from[3], to[3];
    grid_tet_set(&tet, &t->tets, number);
    if (!tet.known)
        return;
    for (int i = 0; i < 3; i++) {
        from[i] = grid_coordinate(&t->grid, tet.low[i], i);
        to[i] = grid_coordinate(&t->grid, tet.high[i], i);
    }
    for (int x = from[0]; x <= to[0]; x++)
        for (int y = from[1]; y <= to[1]; y++) {
            uint32_t end = m->first[grid_number(&t->grid, x, y, to[2]) + 1];
            for (uint32_t i = m->first[grid_number(&t->grid, x, y, from[2])]; i < end; i++)
                guess_at(m, t->tets.corners + 4 * (size_t)number, &tet, m->order[i]);
        }
}

/* ---- the maximum ---- */

/* The largest differences as far as they are above the guess. */
static enum tetlod_status overlay_above(const struct measuring *m, double *most, struct tetlod_error *error)
{
    const struct transition *t = m->transition;
    const uint64_t held = room_held(t->room);
    struct finest_part far;
    struct overlay_report report;
    enum tetlod_status status = transition_far(t, m->guess, &far, error);
    if (status == TETLOD_OK)
        status = room_take(t->room, overlay_bytes(far.mesh.tet_count, t->near.tet_count), error);
    const struct overlay_options options = {
        .threads = m->threads, .bodies = {far.bodies, t->bodies}, .wanted = t->wanted, .floors = m->guess};
    if (status == TETLOD_OK)
        status = overlay_max(&far.mesh, t->fields.places, &t->near, t->fields.fields, t->fields.count, &options, most,
                             &report, error);
    finest_part_fini(&far);
    room_back_to(t->room, held);
    return status;
}

/* False if nothing is above a guess, which was less than a difference that was seen: then there is none. */
static bool keep_guess(struct measuring *m, const double *most)
{
    bool reached = true;
    for (uint32_t i = 0; i < m->transition->fields.count; i++)
        reached &= most[i] > m->guess[i] || m->guess[i] == 0;
    for (uint32_t i = 0; i < m->transition->fields.count && !reached; i++)
        m->guess[i] = 0;
    return reached;
}

static enum tetlod_status find_maximum(struct measuring *m, double *most, struct tetlod_error *error)
{
    TETLOD_TRY(list_vertices(m, error));
    for (uint32_t i = 0; i < m->transition->tets.tet_count; i++)
        guess_tet(m, i);
    TETLOD_TRY(overlay_above(m, most, error));
    return keep_guess(m, most) ? TETLOD_OK : overlay_above(m, most, error);
}

/* ---- local bounds ---- */

/* What the finest level is off itself, in the field's units. */
static double finest_error(const struct tetlod_info *info, uint32_t field)
{
    double max = info->levels[info->level_count - 1].errors[field * TETLOD_MEASURES + TETLOD_MAX];
    return max > 0 ? max * (info->fields[field].range[1] - info->fields[field].range[0]) : 0;
}

/* A number of the field's type that is no less. */
static double round_up(enum tetlod_type type, double x)
{
    float single = (float)x;
    return type == TETLOD_FLOAT64 ? x : (double)((double)single < x ? nextafterf(single, INFINITY) : single);
}

/* s + (M - b) and s - (M - b), at the region's vertices. */
static void shift(const struct tetmesh *region, const struct point_field *s, const double *bounds, double most,
                  double *out)
{
    size_t components = s->components, count = components * region->vertex_count;
    for (size_t i = 0; i < count; i++) {
        double by = most - bounds[i / components];
        out[i] = s->values[i] + by;
        out[count + i] = s->values[i] - by;
    }
}

/* Adds to the bounds at the corners of each tetrahedron what they lack in it: [tet of `near`][2], as far as it is above
 * the floor. */
static void raise_corners(const struct transition *t, const double *found, double floor, double most,
                          struct point_field *bound, double *lack)
{
    memset(lack, 0, t->region->vertex_count * sizeof *lack);
    for (size_t i = 0; i < t->near.tet_count; i++) {
        double worst = larger(found[2 * i], found[2 * i + 1]);
        for (size_t c = 0; c < 4 && t->wanted[i] && worst > floor; c++) {
            double *at = &lack[t->near.corners[4 * i + c]];
            *at = larger(*at, worst - most);
        }
    }
    for (size_t v = 0; v < t->region->vertex_count; v++)
        if (lack[v] > 0)
            bound->values[v] = round_up(bound->type, bound->values[v] + lack[v]);
}

static double largest_bound(const struct tetmesh *region, const struct point_field *bound)
{
    double most = 0;
    for (size_t v = 0; v < region->vertex_count; v++)
        most = larger(most, bound->values[v]);
    return most;
}

/* The local bound of compared field i. */
static enum tetlod_status raise_bound(const struct measuring *m, const struct finest_part *all, uint32_t i,
                                      struct point_field *bound,
                                      struct tetlod_error *error)
{
    const struct transition *t = m->transition;
    const struct tetlod_info *info = forest_info(t->forest);
    const uint32_t field = t->fields.fields[i], both[2] = {i, i}, shifted[2] = {0, 1};
    const struct point_field *s = &t->region->fields[field];
    const double *range = info->fields[field].range;
    double most = largest_bound(t->region, bound), own = finest_error(info, field);
    double floor = most * (1 + SLACK) + 4 * DBL_EPSILON * larger(fabs(range[0]), fabs(range[1])) - own;
    size_t count = (size_t)s->components * t->region->vertex_count;
    const uint64_t held = room_held(t->room);
    const uint64_t bytes = (2 * (count + t->near.tet_count) + t->region->vertex_count) * sizeof(double);
    TETLOD_TRY(room_take(t->room, bytes + overlay_bytes(all->mesh.tet_count, t->near.tet_count), error));
    double *values = array_new(count, 2 * sizeof *values), *found = array_new(t->near.tet_count, 2 * sizeof *found);
    double *lack = array_new(t->region->vertex_count, sizeof *lack), unused[2];
    struct point_field fields[2] = {*s, *s};
    struct tetmesh near = t->near;
    struct overlay_report report;
    enum tetlod_status status = TETLOD_OK;
    if (!values || !found || !lack)
        TETLOD_TRY_DONE(tetlodi_fail_nomem(error, "a region's local bounds", bytes));
    shift(t->region, s, bound->values, most, values);
    for (size_t f = 0; f < 2 * (size_t)t->near.tet_count; f++)
        found[f] = floor;
    fields[0].values = values;
    fields[1].values = values + count;
    near.fields = fields;
    near.field_count = 2;
    const struct overlay_options options = {.threads = m->threads, .bodies = {all->bodies, t->bodies},
                                            .wanted = t->wanted, .each = found};
    TETLOD_TRY_DONE(overlay_max(&all->mesh, both, &near, shifted, 2, &options, unused, &report, error));
    raise_corners(t, found, floor, most - own, bound, lack);
done:
    free(values);
    free(found);
    free(lack);
    room_back_to(t->room, held);
    return status;
}

static enum tetlod_status raise_bounds(const struct measuring *m, struct tetmesh *region, struct tetlod_error *error)
{
    const struct tetlod_info *info = forest_info(m->transition->forest);
    const struct transition_fields *compared = &m->transition->fields;
    const uint64_t held = room_held(m->transition->room);
    double *all = array_new(compared->count, sizeof *all);
    struct finest_part near = {0};
    bool any = false;
    for (uint32_t f = 0; f < info->field_count; f++)
        any |= info->fields[f].bounds != TETLOD_NONE;
    for (uint32_t i = 0; all && i < compared->count; i++)
        all[i] = -1;
    enum tetlod_status status = all ? TETLOD_OK : tetlodi_fail_nomem(error, "a region's local bounds",
                                                                     compared->count * sizeof *all);
    if (status == TETLOD_OK && any)
        status = transition_far(m->transition, all, &near, error);
    for (uint32_t f = 0; f < info->field_count; f++)
        for (uint32_t i = 0; i < compared->count && status == TETLOD_OK; i++)
            if (info->fields[f].bounds == compared->fields[i])
                status = raise_bound(m, &near, i, &region->fields[f], error);
    finest_part_fini(&near);
    free(all);
    room_back_to(m->transition->room, held);
    return status;
}

/* ---- the whole ---- */

static enum tetlod_status measure(struct measuring *m, struct tetmesh *region, double *out, struct tetlod_error *error)
{
    const struct transition_fields *compared = &m->transition->fields;
    const struct tetlod_info *info = forest_info(m->transition->forest);
    double *most = array_zero(compared->count, sizeof *most);
    m->guess = array_zero(compared->count, sizeof *m->guess);
    enum tetlod_status status = most && m->guess ? TETLOD_OK : tetlodi_fail_nomem(error, "a region's error",
                                                                                  compared->count * sizeof *most);
    if (status == TETLOD_OK)
        status = find_maximum(m, most, error);
    for (uint32_t i = 0; status == TETLOD_OK && i < compared->count; i++)
        if (info->fields[compared->fields[i]].controlled)
            out[compared->fields[i]] = most[i] + finest_error(info, compared->fields[i]);
    if (status == TETLOD_OK)
        status = raise_bounds(m, region, error);
    free(m->first);
    free(m->order);
    free(m->guess);
    free(most);
    return status;
}

/* The errors that the region states are those of all its parts. */
static void state_errors(const struct tetlod_info *info, struct tetmesh *region, const double *errors)
{
    for (uint32_t f = 0; f < region->field_count; f++) {
        struct point_field *field = &region->fields[f];
        field->has_error &= info->fields[f].controlled != 0;
        field->error = fmax(field->error, range_fraction(info->fields[f].range, errors[f]));
    }
}

enum tetlod_status region_measure(const struct forest *forest, struct tetmesh *region, const uint32_t *tets,
                                  unsigned threads, struct room *room, double *out, struct tetlod_error *error)
{
    const uint64_t held = room_held(room);
    TETLOD_TRY(room_take(room, SMALL_BYTES, error));
    struct transition transition;
    struct measuring m = {.transition = &transition, .threads = threads};
    for (uint32_t f = 0; f < region->field_count; f++)
        out[f] = 0;
    enum tetlod_status status = transition_init(&transition, forest, region, tets, room, error);
    if (status == TETLOD_OK && transition.tets.tet_count && transition.fields.count)
        status = measure(&m, region, out, error);
    if (status == TETLOD_OK)
        state_errors(forest_info(forest), region, out);
    transition_fini(&transition);
    room_back_to(room, held);
    return status;
}
