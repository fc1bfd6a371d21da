/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/simplify/mesh/working.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "format/fail.h"
#include "src/mesh/adjacency.h"
#include "src/mesh/hilbert.h"
#include "src/mesh/tet_geom.h"
#include "src/util/array.h"

/* A part of the pool's entries that is kept free, one in so many. */
enum { SPARE = 4 };

uint64_t working_bytes(const struct tetmesh *mesh, uint32_t controlled_count)
{
    uint64_t components = 0, row = (ROW_FIELDS + 1 + 2 * (uint64_t)controlled_count + 3) / 4 * 4;
    for (uint32_t f = 0; f < mesh->field_count; f++)
        components += mesh->fields[f].components;
    return mesh->vertex_count * (8 * (row + components + controlled_count) + sizeof(struct span) + 5) +
           mesh->tet_count * (uint64_t)(16 + 1 + 16 + 16 / SPARE);
}

void working_fini(struct working *working)
{
    for (uint32_t f = 0; f < working->field_count && working->fields; f++) {
        free(working->fields[f].middles);
        free(working->fields[f].component_range);
    }
    for (uint32_t c = 0; c < working->component_count && working->components; c++)
        free(working->components[c].predicted);
    free(working->fields);
    free(working->firsts);
    free(working->values);
    free(working->components);
    free(working->rows);
    free(working->corners);
    free(working->boundary_faces);
    free(working->flags);
    free(working->node);
    free(working->stars);
    free(working->pool);
    *working = (struct working){0};
}

void working_round(const struct working *working, double p[3])
{
    for (int i = 0; i < 3; i++)
        p[i] = grid_round(&working->position_grid[i], working->position_type, p[i]);
}

int working_orientation(const struct working *working, uint32_t tet)
{
    const uint32_t *c = working->corners[tet];
    return tet_orientation(working_row(working, c[0]), working_row(working, c[1]), working_row(working, c[2]),
                           working_row(working, c[3]));
}

/* ---- set-up */

static bool allocate(struct working *working, const struct tetmesh *mesh)
{
    size_t n = mesh->vertex_count, m = mesh->tet_count;
    working->stride = (row_moved(working) + 1 + 3) / 4 * 4;
    working->pool_capacity = 4 * m + 4 * m / SPARE;
    working->rows = aligned_alloc(64, (n * working->stride * sizeof(double) + 63) / 64 * 64);
    working->corners = array_new(m, sizeof *working->corners);
    working->boundary_faces = array_zero(m, 1);
    working->flags = array_zero(n, 1);
    working->node = array_new(n, sizeof(uint32_t));
    working->stars = array_new(n, sizeof *working->stars);
    working->pool = array_new(working->pool_capacity, sizeof(uint32_t));
    return working->rows && working->corners && working->boundary_faces && working->flags && working->node &&
           working->stars && working->pool;
}

bool working_is_turned(const struct tetmesh *mesh)
{
    double volume = 0;
    for (uint32_t t = 0; t < mesh->tet_count; t++) {
        const uint32_t *c = mesh->corners + 4 * (size_t)t;
        volume += tet_volume6(mesh->positions + 3 * (size_t)c[0], mesh->positions + 3 * (size_t)c[1],
                              mesh->positions + 3 * (size_t)c[2], mesh->positions + 3 * (size_t)c[3]);
    }
    return volume < 0;
}

/* The least slot of a tetrahedron's corners. */
static uint32_t least_slot(const uint32_t *slot, const uint32_t corners[4])
{
    return smaller(smaller(slot[corners[0]], slot[corners[1]]), smaller(slot[corners[2]], slot[corners[3]]));
}

/* Fills the rows' positions in the order `node`, and the corners: in slots, positive, by their least slot. */
static enum tetlod_status renumber(struct working *working, const struct tetmesh *mesh, bool turned,
                                   struct tetlod_error *error)
{
    uint32_t n = mesh->vertex_count, *slot = array_new(n, sizeof *slot),
             *first = array_zero((size_t)n + 1, sizeof *first);
    if (!slot || !first) {
        free(slot);
        free(first);
        return tetlodi_fail_nomem(error, "the order of the vertices", 8 * (uint64_t)n);
    }
    for (uint32_t v = 0; v < n; v++) {
        slot[working->node[v]] = v;
        memcpy(working_row(working, v), mesh->positions + 3 * (size_t)working->node[v], 3 * sizeof(double));
    }
    for (uint32_t t = 0; t < mesh->tet_count; t++)
        first[least_slot(slot, mesh->corners + 4 * (size_t)t) + 1]++;
    for (uint32_t v = 0; v < n; v++)
        first[v + 1] += first[v];
    for (uint32_t t = 0; t < mesh->tet_count; t++) {
        const uint32_t *c = mesh->corners + 4 * (size_t)t;
        uint32_t own[4] = {slot[c[0]], slot[c[1]], slot[c[turned ? 3 : 2]], slot[c[turned ? 2 : 3]]};
        memcpy(working->corners[first[least_slot(slot, c)]++], own, sizeof own);
    }
    free(slot);
    free(first);
    return TETLOD_OK;
}

enum tetlod_status working_origins(const struct working *working, const struct tetmesh *mesh, uint32_t *out,
                                   struct tetlod_error *error)
{
    uint32_t n = working->slot_count, *slot = array_new(n, sizeof *slot);
    uint32_t *first = array_zero((size_t)n + 1, sizeof *first);
    bool room = slot && first;
    for (uint32_t v = 0; v < n && room; v++)
        slot[working->node[v]] = v;
    for (uint32_t t = 0; t < mesh->tet_count && room; t++)
        first[least_slot(slot, mesh->corners + 4 * (size_t)t) + 1]++;
    for (uint32_t v = 0; v < n && room; v++)
        first[v + 1] += first[v];
    for (uint32_t t = 0; t < mesh->tet_count && room; t++)
        out[first[least_slot(slot, mesh->corners + 4 * (size_t)t)]++] = t;
    free(slot);
    free(first);
    return room ? TETLOD_OK : tetlodi_fail_nomem(error, "the order of the tetrahedra", 8 * (uint64_t)n);
}

static enum tetlod_status list_stars(struct working *working, struct tetlod_error *error)
{
    size_t *begin = array_new((size_t)working->slot_count + 1, sizeof *begin);
    if (!begin)
        return tetlodi_fail_nomem(error, "the stars", 8 * (uint64_t)working->slot_count);
    stars_build(working->corners[0], working->tet_count, working->slot_count, begin, working->pool);
    for (size_t v = 0; v < working->slot_count; v++) {
        uint32_t count = (uint32_t)(begin[v + 1] - begin[v]);
        working->stars[v] = (struct span){begin[v], count, count};
    }
    atomic_init(&working->pool_size, begin[working->slot_count]);
    free(begin);
    return TETLOD_OK;
}

/* What has no orientation, or not the mesh's, is frozen. */
static void freeze(struct working *working)
{
    for (uint32_t t = 0; t < working->tet_count; t++) {
        int orientation = working_orientation(working, t);
        working->log->degenerate_tets += orientation == 0;
        working->log->inverted_tets += orientation < 0;
        for (int c = 0; c < 4 && orientation <= 0; c++)
            working->flags[working->corners[t][c]] |= VERTEX_FROZEN;
    }
}

static bool init_values(struct working *working, uint32_t f, const struct point_field *from,
                        const struct working_whole *whole)
{
    size_t k = from->components, n = working->slot_count;
    struct working_field *field = &working->fields[f];
    *field = (struct working_field){.components = from->components,
                                    .type = from->type,
                                    .middles = array_new(k, sizeof(double)),
                                    .component_range = array_new(k, 2 * sizeof(double)),
                                    .grid = from->grid,
                                    .is_ids = from->is_ids};
    if (!field->middles || !field->component_range)
        return false;
    for (size_t c = 0; c < k; c++) {
        double *range = field->component_range[c];
        range[0] = range[1] = from->values[c];
        for (size_t v = 1; v < n; v++) {
            range[0] = smaller(range[0], from->values[v * k + c]);
            range[1] = larger(range[1], from->values[v * k + c]);
        }
        if (whole)
            memcpy(range, whole->component_ranges[working->firsts[f] + c], 2 * sizeof *range);
        double middle = field->middles[c] = field_middle(range);
        for (size_t v = 0; v < n; v++)
            working_values(working, (uint32_t)v, f)[c] =
                grid_round(&field->grid, field->type, from->values[working->node[v] * k + c]) - middle;
        range[0] = grid_round(&field->grid, field->type, range[0]) - middle;
        range[1] = grid_round(&field->grid, field->type, range[1]) - middle;
    }
    return true;
}

/* U and L are the original's values, whatever the grid. */
static bool init_component(struct working *working, const struct tetmesh *mesh, uint32_t c)
{
    struct component *component = &working->components[c];
    const struct working_field *field = &working->fields[component->field];
    const double *values = mesh->fields[component->field].values + component->component;
    component->predicted = array_zero(working->slot_count, sizeof(double));
    for (uint32_t v = 0; v < working->slot_count; v++) {
        double *row = working_row(working, v);
        row[ROW_FIELDS + 2 * c] = row[ROW_FIELDS + 2 * c + 1] =
            values[(size_t)working->node[v] * field->components] - field->middles[component->component];
    }
    return component->predicted != NULL;
}

static enum tetlod_status init_fields(struct working *working, const struct tetmesh *mesh,
                                      const struct working_whole *whole, const uint32_t *controlled,
                                      uint32_t controlled_count, const double *limits, struct tetlod_error *error)
{
    bool room;
    working->field_count = mesh->field_count;
    working->fields = array_zero(mesh->field_count, sizeof *working->fields);
    working->firsts = array_new(mesh->field_count, sizeof *working->firsts);
    for (uint32_t f = 0; f < mesh->field_count && working->firsts; f++) {
        working->firsts[f] = working->value_count;
        working->value_count += mesh->fields[f].components;
    }
    working->values = array_new((size_t)working->slot_count * working->value_count, sizeof *working->values);
    room = working->fields && working->firsts && working->values;
    for (uint32_t f = 0; f < mesh->field_count && room; f++)
        room = init_values(working, f, &mesh->fields[f], whole);
    if (!room)
        return tetlodi_fail_nomem(error, "the fields", working_bytes(mesh, controlled_count));
    struct log_component *names = array_new(working->component_count, sizeof *names);
    room = names != NULL;
    for (uint32_t i = 0, c = 0; i < controlled_count && room; i++) {
        double range[2];
        if (whole)
            memcpy(range, whole->field_ranges[i], sizeof range);
        else
            point_field_range(&mesh->fields[controlled[i]], mesh->vertex_count, range);
        for (uint32_t k = 0; k < mesh->fields[controlled[i]].components && room; k++, c++) {
            struct component *component = &working->components[c];
            component->field = controlled[i];
            component->component = k;
            component->scale = range[1] > range[0] ? 1 / (range[1] - range[0]) : 0;
            component->factor = component->scale * (limits ? 1 / limits[i] : 1);
            room = init_component(working, mesh, c);
            names[c] = (struct log_component){.field = component->field, .component = k, .scale = component->scale};
        }
    }
    enum tetlod_status status = room ? log_control(working->log, names, working->component_count, error)
                                     : tetlodi_fail_nomem(error, "the fields", working_bytes(mesh, controlled_count));
    free(names);
    return status;
}

enum tetlod_status working_init(struct working *working, const struct tetmesh *mesh, const struct working_whole *whole,
                                const uint32_t *controlled, uint32_t controlled_count, const double *limits,
                                struct contraction_log *log, struct tetlod_error *error)
{
    *working = (struct working){.slot_count = mesh->vertex_count,
                                .tet_count = mesh->tet_count,
                                .vertices_alive = mesh->vertex_count,
                                .tets_alive = mesh->tet_count,
                                .position_type = mesh->position_type,
                                .log = log};
    memcpy(working->position_grid, mesh->position_grid, sizeof working->position_grid);
    for (uint32_t i = 0; i < controlled_count; i++)
        working->component_count += mesh->fields[controlled[i]].components;
    working->components = array_zero(working->component_count, sizeof *working->components);
    if (!working->components || !allocate(working, mesh))
        return tetlodi_fail_nomem(error, "the working mesh", working_bytes(mesh, controlled_count));
    memset(working->rows, 0, (size_t)working->slot_count * working->stride * sizeof(double));
    TETLOD_TRY(hilbert_order(mesh->positions, mesh->vertex_count, working->node, error));
    TETLOD_TRY(renumber(working, mesh, whole ? whole->turned : working_is_turned(mesh), error));
    TETLOD_TRY(list_stars(working, error));
    memset(working->flags, VERTEX_ALIVE, working->slot_count);
    freeze(working);
    return init_fields(working, mesh, whole, controlled, controlled_count, limits, error);
}

/* Positions are the mesh's, and corners as well, unless the last two are to change places. */
static bool borrow(struct working *working, const struct tetmesh *mesh, bool turned)
{
    uint32_t(*own)[4] = turned ? array_new(mesh->tet_count, sizeof *own) : (uint32_t(*)[4])mesh->corners;
    for (size_t t = 0; t < mesh->tet_count && turned && own; t++) {
        const uint32_t *c = mesh->corners + 4 * t;
        memcpy(own[t], (uint32_t[4]){c[0], c[1], c[3], c[2]}, sizeof own[t]);
    }
    working->corners = own;
    working->rows = mesh->positions;
    working->stride = 3;
    working->pool_capacity = 4 * (size_t)mesh->tet_count;
    working->boundary_faces = array_zero(mesh->tet_count, 1);
    working->flags = array_zero(mesh->vertex_count, 1);
    working->stars = array_new(mesh->vertex_count, sizeof *working->stars);
    working->pool = array_new(working->pool_capacity, sizeof *working->pool);
    return own && working->boundary_faces && working->flags && working->stars && working->pool;
}

enum tetlod_status working_look(struct working *working, const struct tetmesh *mesh, bool turned,
                                struct contraction_log *log, struct tetlod_error *error)
{
    *working = (struct working){.slot_count = mesh->vertex_count, .tet_count = mesh->tet_count, .log = log};
    if (!borrow(working, mesh, turned))
        return tetlodi_fail_nomem(error, "the stars", 17 * (uint64_t)mesh->tet_count);
    TETLOD_TRY(list_stars(working, error));
    memset(working->flags, VERTEX_ALIVE, working->slot_count);
    freeze(working);
    return TETLOD_OK;
}

void working_look_end(struct working *working, const struct tetmesh *mesh)
{
    working->rows = NULL;
    if (working->corners == (uint32_t(*)[4])mesh->corners)
        working->corners = NULL;
    working_fini(working);
}

/* ---- the pool */

/* Lists the stars of the living in a new pool, with room for so many more entries. */
static enum tetlod_status list_anew(struct working *working, size_t entries, struct tetlod_error *error)
{
    size_t size = 0, capacity;
    for (uint32_t v = 0; v < working->slot_count; v++) {
        if (working_alive(working, v))
            working_prune(working, v);
        size += working->stars[v].count;
    }
    capacity = size + size / SPARE + entries;
    uint32_t *pool = array_new(capacity, sizeof *pool);
    if (!pool)
        return tetlodi_fail_nomem(error, "the stars", capacity * sizeof *pool);
    size = 0;
    for (uint32_t v = 0; v < working->slot_count; v++) {
        struct span *star = &working->stars[v];
        memcpy(pool + size, working->pool + star->begin, star->count * sizeof *pool);
        *star = (struct span){size, star->count, star->count};
        size += star->count;
    }
    free(working->pool);
    working->pool = pool;
    working->pool_capacity = capacity;
    atomic_store(&working->pool_size, size);
    return TETLOD_OK;
}

enum tetlod_status working_reserve(struct working *working, size_t entries, struct tetlod_error *error)
{
    if (atomic_load(&working->pool_size) + entries <= working->pool_capacity)
        return TETLOD_OK;
    return list_anew(working, entries, error);
}

/* ---- numbers without gaps */

void renumbering_fini(struct renumbering *renumbering)
{
    free(renumbering->tets);
    free(renumbering->slots);
    *renumbering = (struct renumbering){0};
}

static void *move_rows(void *array, const uint32_t *numbers, uint32_t count, uint32_t left, size_t size)
{
    char *bytes = array;
    for (uint32_t i = 0; i < count; i++)
        if (numbers[i] < i)
            memcpy(bytes + numbers[i] * size, bytes + i * size, size);
    return array_shrink(array, left, size);
}

void *renumber_slots(const struct renumbering *renumbering, void *array, size_t element_size)
{
    return move_rows(array, renumbering->slots, renumbering->slot_count, renumbering->slots_left, element_size);
}

void *renumber_tets(const struct renumbering *renumbering, void *array, size_t element_size)
{
    return move_rows(array, renumbering->tets, renumbering->tet_count, renumbering->tets_left, element_size);
}

static bool number_living(const struct working *working, struct renumbering *out)
{
    *out = (struct renumbering){.tets = array_new(working->tet_count, sizeof(uint32_t)),
                                .slots = array_new(working->slot_count, sizeof(uint32_t)),
                                .tet_count = working->tet_count,
                                .slot_count = working->slot_count};
    if (!out->tets || !out->slots)
        return false;
    for (uint32_t t = 0; t < working->tet_count; t++)
        out->tets[t] = tet_gone(working, t) ? TETLOD_NONE : out->tets_left++;
    for (uint32_t v = 0; v < working->slot_count; v++)
        out->slots[v] = working_alive(working, v) ? out->slots_left++ : TETLOD_NONE;
    return true;
}

/* The corners, and the stars in a pool of their own size, by their new numbers. */
static void renumber_corners(struct working *working, const struct renumbering *numbers)
{
    for (uint32_t t = 0; t < working->tet_count; t++)
        for (int c = 0; c < 4 && !tet_gone(working, t); c++)
            working->corners[t][c] = numbers->slots[working->corners[t][c]];
    for (uint32_t v = 0; v < working->slot_count; v++) {
        uint32_t *star = working->pool + working->stars[v].begin;
        for (uint32_t i = 0; i < working->stars[v].count; i++)
            star[i] = numbers->tets[star[i]];
    }
}

enum tetlod_status working_renumber(struct working *working, struct renumbering *out, struct tetlod_error *error)
{
    enum tetlod_status status = number_living(working, out) ? list_anew(working, 0, error)
                                                            : tetlodi_fail_nomem(error, "new numbers",
                                                                                 4 * (uint64_t)working->tet_count);
    if (status != TETLOD_OK) {
        renumbering_fini(out);
        return status;
    }
    renumber_corners(working, out);
    working->corners = renumber_tets(out, working->corners, sizeof *working->corners);
    working->boundary_faces = renumber_tets(out, working->boundary_faces, 1);
    working->rows = renumber_slots(out, working->rows, working->stride * sizeof *working->rows);
    working->values = renumber_slots(out, working->values, working->value_count * sizeof *working->values);
    working->flags = renumber_slots(out, working->flags, 1);
    working->node = renumber_slots(out, working->node, sizeof *working->node);
    working->stars = renumber_slots(out, working->stars, sizeof *working->stars);
    for (uint32_t c = 0; c < working->component_count; c++)
        working->components[c].predicted = renumber_slots(out, working->components[c].predicted, sizeof(double));
    working->tet_count = out->tets_left;
    working->slot_count = out->slots_left;
    return TETLOD_OK;
}

void working_prune(struct working *working, uint32_t slot)
{
    struct span *star = &working->stars[slot];
    uint32_t *tets = working->pool + star->begin, kept = 0;
    for (uint32_t i = 0; i < star->count; i++)
        if (!tet_gone(working, tets[i]))
            tets[kept++] = tets[i];
    star->count = kept;
}

/* ---- contraction */

/* The tetrahedron of slot a's star, other than `but`, whose face with a, x and y is not closed by b: that face is open
 * now. False: it was so before, or there is none. */
static bool open_face(struct working *working, uint32_t a, uint32_t b, uint32_t x, uint32_t y, uint32_t but)
{
    const struct span *star = &working->stars[a];
    for (uint32_t i = 0; i < star->count; i++) {
        uint32_t tet = working->pool[star->begin + i], *corners = working->corners[tet];
        unsigned found = 0, other = 0;
        for (unsigned c = 0; c < 4 && tet != but && corners[0] != TETLOD_NONE; c++) {
            bool is = corners[c] == a || corners[c] == x || corners[c] == y;
            found += is;
            other = is ? other : c;
        }
        if (found == 3 && corners[other] != b) {
            bool closed = !(working->boundary_faces[tet] >> other & 1);
            working->boundary_faces[tet] |= (uint8_t)(1u << other);
            return closed;
        }
    }
    return false;
}

/* The two faces of a removed tetrahedron that have one of its two vertices of the simplex fall together: if one was on
 * the boundary, what is behind the other is open. Of those with three or four such vertices no face is left. */
static bool pass_boundary_on(struct working *working, uint32_t tet, const uint32_t *simplex, uint32_t count)
{
    const uint32_t *corners = working->corners[tet];
    unsigned inside[2] = {0, 0}, outside[2] = {0, 0}, inside_count = 0, outside_count = 0,
             faces = working->boundary_faces[tet];
    for (unsigned c = 0; c < 4; c++) {
        if (is_of(simplex, count, corners[c]))
            inside[inside_count++ & 1] = c;
        else
            outside[outside_count++ & 1] = c;
    }
    bool opened = false;
    for (int i = 0; i < 2 && inside_count == 2; i++)
        if (faces >> inside[i] & 1)
            opened |= open_face(working, corners[inside[i]], corners[inside[!i]], corners[outside[0]],
                                corners[outside[1]], tet);
    return opened;
}

/* Takes the tetrahedra of the star of one of the simplex's vertices that have no other into the list. */
static uint32_t keep(const struct working *working, const uint32_t *simplex, uint32_t count, uint32_t of,
                     uint32_t *list)
{
    const struct span *star = &working->stars[simplex[of]];
    uint32_t kept = 0;
    for (uint32_t i = 0; i < star->count; i++) {
        uint32_t tet = working->pool[star->begin + i];
        if (!tet_gone(working, tet) && !tet_has_other(working->corners[tet], simplex, count, of))
            list[kept++] = tet;
    }
    return kept;
}

/* Opens faces behind removed tetrahedra; and behind those that are removed themselves, until none is left. */
static void open_faces(struct working *working, const uint32_t *simplex, uint32_t count)
{
    bool opened = true;
    while (opened) {
        opened = false;
        for (uint32_t s = 0; s + 1 < count; s++) {
            const struct span *star = &working->stars[simplex[s]];
            for (uint32_t i = 0; i < star->count; i++) {
                uint32_t tet = working->pool[star->begin + i];
                if (!tet_gone(working, tet) && working->boundary_faces[tet] &&
                    tet_has_other(working->corners[tet], simplex, count, s))
                    opened |= pass_boundary_on(working, tet, simplex, count);
            }
        }
        opened &= count > 2; // two removed ones around an edge have no face between them that opens
    }
}

static uint32_t remove_tets(struct working *working, const uint32_t *simplex, uint32_t count)
{
    uint32_t removed = 0;
    for (uint32_t s = 0; s + 1 < count; s++) {
        const struct span *star = &working->stars[simplex[s]];
        for (uint32_t i = 0; i < star->count; i++) {
            uint32_t tet = working->pool[star->begin + i];
            if (tet_gone(working, tet) || !tet_has_other(working->corners[tet], simplex, count, s))
                continue;
            working->corners[tet][0] = TETLOD_NONE;
            removed++;
        }
    }
    return removed;
}

uint32_t working_contract(struct working *working, const uint32_t *simplex, uint32_t count, uint32_t *list)
{
    uint32_t kept = simplex[count - 1], listed = 0, ends[4];
    for (uint32_t s = 0; s < count; s++)
        ends[s] = listed += keep(working, simplex, count, s, list + listed);
    open_faces(working, simplex, count); // while all of the stars is there
    uint32_t removed = remove_tets(working, simplex, count);
    struct span *to = &working->stars[kept];
    for (uint32_t s = 0; s + 1 < count; s++) {
        struct span *star = &working->stars[simplex[s]];
        for (uint32_t i = s ? ends[s - 1] : 0; i < ends[s]; i++)
            working->corners[list[i]][corner_of(working->corners[list[i]], simplex[s])] = kept;
        if (star->capacity > to->capacity)
            *to = *star;
        *star = (struct span){0, 0, 0};
        working->flags[kept] |= working->flags[simplex[s]] & (VERTEX_BOUNDARY | VERTEX_FROZEN | VERTEX_FIXED);
        working->flags[simplex[s]] = 0;
    }
    if (to->capacity < listed) {
        uint32_t capacity = listed + listed / SPARE;
        *to = (struct span){atomic_fetch_add_explicit(&working->pool_size, capacity, memory_order_relaxed), listed,
                            capacity};
    }
    to->count = listed;
    memcpy(working->pool + to->begin, list, listed * sizeof *list);
    return removed;
}
