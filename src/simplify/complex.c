/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/simplify/complex.h"

#include <assert.h>
#include <stdlib.h>
#include <string.h>

#include "format/fail.h"
#include "src/mesh/adjacency.h"
#include "src/mesh/tet_geom.h"
#include "src/util/array.h"
#include "src/util/union_find.h"

uint64_t complex_bytes(uint32_t vertices, uint32_t tets)
{
    uint64_t per_vertex = 24 + 1 + 4 + 4 + 8 + 4 + 4 + 4 + 16 + 24 + 8, per_tet = 16 + 16 + 4 + 8 + 16;
    return vertices * per_vertex + tets * per_tet;
}

void complex_fini(struct complex *complex)
{
    void *const owned[] = {complex->positions,  complex->corners,    complex->neighbours,    complex->flags,
                           complex->changed,    complex->born,       complex->pool,          complex->star_begin,
                           complex->star_count, complex->star_capacity, complex->node,       complex->local,
                           complex->epoch_of,   complex->tet_changed,
                           complex->least_volume6};
    for (size_t i = 0; i < sizeof owned / sizeof *owned; i++)
        free(owned[i]);
    log_fini(&complex->log);
    *complex = (struct complex){0};
}

static bool allocate(struct complex *complex)
{
    size_t n = complex->vertex_count, m = complex->tet_count;
    complex->positions = array_new(n, 3 * sizeof(double));
    complex->corners = array_new(m, 4 * sizeof(uint32_t));
    complex->neighbours = array_new(m, 4 * sizeof(uint32_t));
    complex->flags = array_zero(n, 1);
    complex->changed = array_zero(n, sizeof(uint32_t));
    complex->tet_changed = array_zero(m, sizeof(uint32_t));
    complex->least_volume6 = array_new(m, sizeof(double));
    complex->born = array_zero(n, sizeof(uint32_t));
    complex->pool_size = 4 * m;
    complex->pool_capacity = 6 * m;
    complex->pool = array_new(complex->pool_capacity, sizeof(uint32_t));
    complex->star_begin = array_new(n + 1, sizeof(size_t));
    complex->star_count = array_new(n, sizeof(uint32_t));
    complex->star_capacity = array_new(n, sizeof(uint32_t));
    complex->node = array_new(n, sizeof(uint32_t));
    complex->local = array_new(n, sizeof(uint32_t));
    complex->epoch_of = array_zero(n, sizeof(uint32_t));
    return complex->positions && complex->corners && complex->neighbours && complex->flags && complex->changed &&
           complex->born && complex->pool && complex->star_begin && complex->star_count && complex->star_capacity &&
           complex->node && complex->tet_changed && complex->least_volume6 && complex->local && complex->epoch_of;
}

static void corner_positions(const struct complex *complex, uint32_t tet, const double *p[4])
{
    for (int c = 0; c < 4; c++)
        p[c] = complex->positions + 3 * (size_t)complex->corners[4 * (size_t)tet + c];
}

static void set_least_volume(struct complex *complex, uint32_t tet)
{
    const double *p[4];
    corner_positions(complex, tet, p);
    double size2 = tet_size_squared(p[0], p[1], p[2], p[3]);
    complex->least_volume6[tet] = TET_DEGENERATE * size2 * sqrt(size2);
}

static int orientation_of(const struct complex *complex, uint32_t tet)
{
    const double *p[4];
    corner_positions(complex, tet, p);
    return tet_orientation(p[0], p[1], p[2], p[3]) * complex->orientation;
}

/* Do two well oriented tetrahedra lie on the same side of their common face? Then they overlap: they list the face in the same
 * turn, while those on two sides list it in opposite ones. */
static bool folded_at(const struct complex *complex, uint32_t tet, unsigned face)
{
    uint32_t across = complex->neighbours[4 * (size_t)tet + face];
    if (across == TETLOD_NONE)
        return false;
    const uint32_t *own = complex->corners + 4 * (size_t)tet, *other = complex->corners + (across & ~3u);
    uint32_t first = own[tet_faces[face][0]], second = own[tet_faces[face][1]];
    for (int k = 0; k < 3; k++)
        if (other[tet_faces[across & 3][k]] == first)
            return other[tet_faces[across & 3][(k + 1) % 3]] == second && orientation_of(complex, tet) > 0 &&
                   orientation_of(complex, across / 4) > 0;
    return false;
}

static bool folded(const struct complex *complex, uint32_t tet)
{
    return folded_at(complex, tet, 0) || folded_at(complex, tet, 1) || folded_at(complex, tet, 2) || folded_at(complex, tet, 3);
}

/* The orientation of most of the volume is the mesh's; what has none or the other is frozen, and so is what lies over a
 * neighbour: around those a point is not in one tetrahedron (PROOF.md, 6). */
static void orient(struct complex *complex)
{
    const double *p[4];
    double volume = 0;
    for (uint32_t t = 0; t < complex->tet_count; t++) {
        corner_positions(complex, t, p);
        volume += tet_volume6(p[0], p[1], p[2], p[3]);
        set_least_volume(complex, t);
    }
    complex->orientation = volume < 0 ? -1 : 1;
    for (uint32_t t = 0; t < complex->tet_count; t++) {
        int orientation = orientation_of(complex, t);
        bool fold = orientation > 0 && folded(complex, t);
        complex->log.degenerate_tets += orientation == 0;
        complex->log.inverted_tets += orientation < 0;
        complex->log.folded_tets += fold;
        for (int c = 0; c < 4 && (orientation <= 0 || fold); c++)
            complex->flags[complex->corners[4 * (size_t)t + c]] |= VERTEX_FROZEN;
    }
}

/* Joins corners of the same vertex across faces: afterwards a vertex has a root corner per fan of tetrahedra. */
static void join_fans(const struct complex *complex, uint32_t *parent)
{
    for (size_t i = 0; i < 4 * (size_t)complex->tet_count; i++)
        parent[i] = (uint32_t)i;
    for (uint32_t t = 0; t < complex->tet_count; t++)
        for (unsigned f = 0; f < 4; f++) {
            uint32_t across = complex->neighbours[4 * (size_t)t + f];
            if (across == TETLOD_NONE || across / 4 < t)
                continue;
            for (unsigned c = 0; c < 4; c++)
                for (unsigned d = 0; d < 4; d++)
                    if (c != f && complex->corners[4 * (size_t)t + c] == complex->corners[(across & ~3u) + d])
                        join_sets(parent, 4 * t + c, (across & ~3u) + d);
        }
}

/* The Euler characteristic of v's link: 2 for a sphere, 1 for a disc. */
static int link_euler(struct complex *complex, uint32_t v)
{
    const uint32_t *star = complex->pool + complex->star_begin[v];
    uint32_t tets = complex->star_count[v], boundary_faces = 0, neighbours = 0, epoch = ++complex->epoch;
    complex->epoch_of[v] = epoch;
    for (uint32_t i = 0; i < tets; i++)
        for (unsigned c = 0; c < 4; c++) {
            uint32_t w = complex->corners[4 * (size_t)star[i] + c];
            boundary_faces += w != v && complex_boundary_face(complex, star[i], c);
            neighbours += complex->epoch_of[w] != epoch;
            complex->epoch_of[w] = epoch;
        }
    return (int)neighbours - (int)((3 * tets + boundary_faces) / 2) + (int)tets;
}

/* Marks vertices whose link is neither a sphere nor a disc. */
static enum tetlod_status mark_singular(struct complex *complex, struct tetlod_error *error)
{
    size_t corners = 4 * (size_t)complex->tet_count;
    uint32_t *parent = array_new(corners, sizeof *parent);
    uint8_t *fans = array_zero(complex->vertex_count, 1);
    if (!parent || !fans) {
        free(parent);
        free(fans);
        return tetlodi_fail_nomem(error, "the check of the links", corners * sizeof *parent);
    }
    join_fans(complex, parent);
    for (size_t i = 0; i < corners; i++)
        if (parent[i] == i && fans[complex->corners[i]] < 2)
            fans[complex->corners[i]]++;
    for (uint32_t v = 0; v < complex->vertex_count; v++)
        if (fans[v] != 1 || link_euler(complex, v) != (complex->flags[v] & VERTEX_BOUNDARY ? 1 : 2))
            complex->flags[v] |= VERTEX_SINGULAR;
    free(parent);
    free(fans);
    return TETLOD_OK;
}

static void mark_boundary(struct complex *complex)
{
    for (uint32_t t = 0; t < complex->tet_count; t++)
        for (unsigned f = 0; f < 4; f++)
            for (int i = 0; i < 3 && complex_boundary_face(complex, t, f); i++)
                complex->flags[complex->corners[4 * (size_t)t + tet_faces[f][i]]] |= VERTEX_BOUNDARY;
}

enum tetlod_status complex_init(struct complex *complex, const struct tetmesh *mesh, struct tetlod_error *error)
{
    *complex = (struct complex){.vertex_count = mesh->vertex_count,
                                .tet_count = mesh->tet_count,
                                .slot_count = mesh->vertex_count,
                                .tets_stored = mesh->tet_count,
                                .vertices_alive = mesh->vertex_count,
                                .tets_alive = mesh->tet_count,
                                .position_type = mesh->position_type};
    size_t n = mesh->vertex_count, m = mesh->tet_count;
    enum tetlod_status status = TETLOD_OK;
    if (!allocate(complex))
        status = tetlodi_fail_nomem(error, "the complex", complex_bytes(mesh->vertex_count, mesh->tet_count));
    if (status == TETLOD_OK)
        status = log_init(&complex->log, mesh, error);
    if (status == TETLOD_OK)
        status = adjacency_build(mesh->corners, mesh->tet_count, mesh->vertex_count, complex->neighbours, NULL, error);
    if (status != TETLOD_OK) {
        complex_fini(complex);
        return status;
    }
    memcpy(complex->position_grid, mesh->position_grid, sizeof complex->position_grid);
    memcpy(complex->positions, mesh->positions, n * 3 * sizeof(double));
    memcpy(complex->corners, mesh->corners, m * 4 * sizeof(uint32_t));
    stars_build(complex->corners, complex->tet_count, complex->vertex_count, complex->star_begin, complex->pool);
    for (size_t v = 0; v < n; v++) {
        complex->flags[v] = VERTEX_ALIVE;
        complex->node[v] = (uint32_t)v;
        complex->star_count[v] = complex->star_capacity[v] =
            (uint32_t)(complex->star_begin[v + 1] - complex->star_begin[v]);
    }
    mark_boundary(complex);
    orient(complex);
    status = mark_singular(complex, error);
    if (status != TETLOD_OK)
        complex_fini(complex);
    return status;
}

bool complex_unfreeze(struct complex *complex, uint32_t v)
{
    const uint32_t *tets = complex->pool + complex->star_begin[v];
    if (!(complex->flags[v] & VERTEX_FROZEN))
        return false;
    for (uint32_t i = 0; i < complex->star_count[v]; i++)
        if (orientation_of(complex, tets[i]) <= 0 || folded(complex, tets[i]))
            return false;
    complex->flags[v] &= (uint8_t)~VERTEX_FROZEN;
    return true;
}

void complex_round_position(const struct complex *complex, double p[3])
{
    for (int i = 0; i < 3; i++)
        p[i] = grid_round(&complex->position_grid[i], complex->position_type, p[i]);
}

enum tetlod_status complex_link_vertices(struct complex *complex, uint32_t v, uint32_t **out, size_t *out_capacity,
                                         size_t *out_count, struct tetlod_error *error)
{
    const uint32_t *star = complex->pool + complex->star_begin[v];
    uint32_t count = complex->star_count[v], epoch = ++complex->epoch;
    void *grown = *out;
    if (!array_reserve(&grown, out_capacity, *out_count + 3 * (size_t)count, sizeof **out))
        return tetlodi_fail_nomem(error, "a link", 3 * (uint64_t)count * sizeof **out);
    *out = grown;
    complex->epoch_of[v] = epoch;
    for (uint32_t i = 0; i < count; i++)
        for (unsigned c = 0; c < 4; c++) {
            uint32_t w = complex->corners[4 * (size_t)star[i] + c];
            if (complex->epoch_of[w] != epoch)
                (*out)[(*out_count)++] = w;
            complex->epoch_of[w] = epoch;
        }
    return TETLOD_OK;
}

/* ---- contraction */

/* A removed tetrahedron becomes a triangle or less: where exactly two of its corners meet, the two faces that do not hold
 * both of them fall together, and what lies across them becomes neighbours. */
static void close_gap(struct complex *complex, uint32_t tet, const bool in_simplex[4])
{
    uint32_t sides[2];
    unsigned count = 0;
    for (unsigned c = 0; c < 4; c++)
        if (in_simplex[c] && count < 2)
            sides[count++] = complex->neighbours[4 * (size_t)tet + c];
    if (sides[0] != TETLOD_NONE)
        complex->neighbours[sides[0]] = sides[1];
    if (sides[1] != TETLOD_NONE)
        complex->neighbours[sides[1]] = sides[0];
}

/* Tetrahedra with three or four corners in the simplex vanish to an edge or a point: no face of theirs is left, so nothing
 * has to be joined across them. Those with two are closed one by one; a chain of them across shared faces closes link by
 * link, as taking elements out of a linked list does. */
static void close_gaps(struct complex *complex, const struct star *star)
{
    for (uint32_t i = 0; i < star->tet_count; i++) {
        if (star->moving[i] != STAR_REMOVED)
            continue;
        uint32_t tet = star->tets[i], inside = 0;
        bool in_simplex[4];
        for (unsigned c = 0; c < 4; c++) {
            in_simplex[c] = false;
            for (uint32_t s = 0; s < star->simplex_count; s++)
                in_simplex[c] |= complex->corners[4 * (size_t)tet + c] == star->simplex[s];
            inside += in_simplex[c];
        }
        if (inside == 2)
            close_gap(complex, tet, in_simplex);
    }
}

/* Takes the removed tetrahedra out of the star of a vertex of the link. */
static void prune_star(struct complex *complex, uint32_t v)
{
    uint32_t *tets = complex->pool + complex->star_begin[v], kept = 0;
    for (uint32_t i = 0; i < complex->star_count[v]; i++)
        if (complex->corners[4 * (size_t)tets[i]] != TETLOD_NONE)
            tets[kept++] = tets[i];
    complex->star_count[v] = kept;
}

/* Marks the link's vertices as changed; those of removed tetrahedra go to complex->local, which is free now. */
static uint32_t touch_link(struct complex *complex, const struct star *star, uint32_t epoch, uint32_t now)
{
    uint32_t count = 0;
    for (int pass = 0; pass < 2; pass++) // the ring first, so that it is listed although the others hold it too
        for (uint32_t i = 0; i < star->tet_count; i++) {
            if ((star->moving[i] == STAR_REMOVED) != (pass == 0))
                continue;
            for (unsigned c = 0; c < 4; c++) {
                uint32_t w = complex->corners[4 * (size_t)star->tets[i] + c];
                if (complex->epoch_of[w] == epoch)
                    continue;
                complex->epoch_of[w] = epoch;
                complex->changed[w] = now;
                if (pass == 0)
                    complex->local[count++] = w;
            }
        }
    return count;
}

/* Room for the new vertex's star: in the largest place that the simplex's vertices had, or at the end of the pool. */
static enum tetlod_status place_star(struct complex *complex, const struct star *star, struct tetlod_error *error)
{
    uint32_t count = star->tet_count - star->removed_count, v = star->simplex[0];
    for (uint32_t s = 1; s < star->simplex_count; s++) {
        uint32_t w = star->simplex[s];
        if (complex->star_capacity[w] > complex->star_capacity[v]) {
            complex->star_begin[v] = complex->star_begin[w];
            complex->star_capacity[v] = complex->star_capacity[w];
        }
        complex->star_count[w] = complex->star_capacity[w] = 0;
    }
    if (complex->star_capacity[v] < count) {
        void *pool = complex->pool;
        size_t room = count + count / 4;
        if (!array_reserve(&pool, &complex->pool_capacity, complex->pool_size + room, sizeof *complex->pool))
            return tetlodi_fail_nomem(error, "the stars", (complex->pool_size + room) * sizeof *complex->pool);
        complex->pool = pool;
        complex->star_begin[v] = complex->pool_size;
        complex->star_capacity[v] = (uint32_t)room;
        complex->pool_size += room;
    }
    complex->star_count[v] = count;
    return TETLOD_OK;
}

static void log_contraction(struct complex *complex, const struct star *star)
{
    struct contraction_log *log = &complex->log;
    uint32_t c = log_extend(log, 1);
    for (uint32_t s = 0; s < 4; s++)
        log->children[4 * (size_t)c + s] =
            s < star->simplex_count ? complex->node[star->simplex[s]] : TETLOD_NONE;
    memcpy(log->positions + 3 * (size_t)c, complex->positions + 3 * (size_t)star->simplex[0], 24);
    complex->node[star->simplex[0]] = complex->vertex_count + c;
}

enum tetlod_status complex_contract(struct complex *complex, const struct star *star, const double p[3],
                                    struct tetlod_error *error)
{
    uint32_t v = star->simplex[0], now = complex->log.count + 1, epoch = ++complex->epoch;
    assert(star->removed_count > 0);
    close_gaps(complex, star);
    for (uint32_t s = 0; s < star->simplex_count; s++)
        complex->epoch_of[star->simplex[s]] = epoch;
    uint32_t *ring = complex->local, ring_count = touch_link(complex, star, epoch, now);
    for (uint32_t i = 0; i < star->tet_count; i++) {
        complex->tet_changed[star->tets[i]] = now;
        if (star->moving[i] == STAR_REMOVED)
            complex->corners[4 * (size_t)star->tets[i]] = TETLOD_NONE;
    }
    complex->tets_alive -= star->removed_count;
    for (uint32_t i = 0; i < ring_count; i++)
        prune_star(complex, ring[i]);
    TETLOD_TRY(place_star(complex, star, error));
    uint32_t *tets = complex->pool + complex->star_begin[v], kept = 0;
    for (uint32_t i = 0; i < star->tet_count; i++)
        if (star->moving[i] != STAR_REMOVED) {
            complex->corners[4 * (size_t)star->tets[i] + star->moving[i]] = v;
            tets[kept++] = star->tets[i];
        }
    uint8_t inherited = 0;
    for (uint32_t s = 0; s < star->simplex_count; s++) {
        inherited |= complex->flags[star->simplex[s]] & (VERTEX_BOUNDARY | VERTEX_FROZEN | VERTEX_FIXED);
        complex->changed[star->simplex[s]] = now;
        complex->flags[star->simplex[s]] &= s ? 0 : 0xff;
    }
    complex->flags[v] |= inherited;
    memcpy(complex->positions + 3 * (size_t)v, p, 24);
    complex->born[v] = now;
    complex->vertices_alive -= star->simplex_count - 1;
    for (uint32_t i = 0; i < kept; i++)
        set_least_volume(complex, tets[i]);
    log_contraction(complex, star);
    return TETLOD_OK;
}

/* ---- renumbering */

static bool tet_is_left(const void *context, uint32_t tet)
{
    const struct complex *complex = context;
    return complex->corners[4 * (size_t)tet] != TETLOD_NONE;
}

static bool slot_is_left(const void *context, uint32_t slot)
{
    return complex_alive(context, slot);
}

bool complex_find_numbers(const struct complex *complex, struct renumbering *tets, struct renumbering *slots)
{
    *tets = *slots = (struct renumbering){0};
    return renumbering_init(tets, complex->tets_stored, tet_is_left, complex) &&
           renumbering_init(slots, complex->slot_count, slot_is_left, complex);
}

static int compare_places(const void *left, const void *right)
{
    const uint64_t *a = left, *b = right;
    return *a < *b ? -1 : *a > *b;
}

/* Moves the stars together, in the order in which they lie in the pool. `order` has room for all of them: where each begins, and, in the
 * lower half, its slot. */
static void move_stars(struct complex *complex, const struct renumbering *tets, uint64_t *order)
{
    for (uint32_t v = 0; v < complex->slot_count; v++)
        order[v] = (uint64_t)complex->star_begin[v] << 32 | v;
    qsort(order, complex->slot_count, sizeof *order, compare_places);
    complex->pool_size = 0;
    for (uint32_t k = 0; k < complex->slot_count; k++) {
        uint32_t v = (uint32_t)order[k];
        size_t begin = order[k] >> 32;
        complex->star_begin[v] = complex->pool_size;
        complex->star_capacity[v] = complex->star_count[v];
        for (uint32_t i = 0; i < complex->star_count[v]; i++)
            complex->pool[complex->pool_size++] = renumbered(tets, complex->pool[begin + i]);
    }
    complex->pool = array_shrink(complex->pool, complex->pool_size, sizeof *complex->pool);
    complex->pool_capacity = complex->pool_size;
}

bool complex_renumber(struct complex *complex, const struct renumbering *tets, const struct renumbering *slots)
{
    uint64_t *order = complex->pool_size <= UINT32_MAX ? array_new(slots->after, sizeof *order) : NULL;
    if (!order)
        return false;
    renumber_array(&complex->corners, 4 * sizeof *complex->corners, tets);
    renumber_array(&complex->neighbours, 4 * sizeof *complex->neighbours, tets);
    renumber_array(&complex->tet_changed, sizeof *complex->tet_changed, tets);
    renumber_array(&complex->least_volume6, sizeof *complex->least_volume6, tets);
    renumber_array(&complex->positions, 3 * sizeof *complex->positions, slots);
    renumber_array(&complex->flags, sizeof *complex->flags, slots);
    renumber_array(&complex->changed, sizeof *complex->changed, slots);
    renumber_array(&complex->born, sizeof *complex->born, slots);
    renumber_array(&complex->star_begin, sizeof *complex->star_begin, slots);
    renumber_array(&complex->star_count, sizeof *complex->star_count, slots);
    renumber_array(&complex->star_capacity, sizeof *complex->star_capacity, slots);
    renumber_array(&complex->node, sizeof *complex->node, slots);
    renumber_array(&complex->local, sizeof *complex->local, slots);
    renumber_array(&complex->epoch_of, sizeof *complex->epoch_of, slots);
    complex->tets_stored = tets->after;
    complex->slot_count = slots->after;
    for (size_t i = 0; i < 4 * (size_t)tets->after; i++) {
        uint32_t across = complex->neighbours[i];
        complex->corners[i] = renumbered(slots, complex->corners[i]);
        complex->neighbours[i] = across == TETLOD_NONE ? across : 4 * renumbered(tets, across / 4) + across % 4;
    }
    move_stars(complex, tets, order);
    free(order);
    return true;
}
