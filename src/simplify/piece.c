/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/simplify/piece.h"

#include <stdlib.h>
#include <string.h>

#include "format/fail.h"
#include "src/mesh/tet_geom.h"
#include "src/simplify/mesh/regions.h"
#include "src/util/array.h"
#include "src/util/parallel.h"

enum { KEPT_FLAGS = VERTEX_BOUNDARY | VERTEX_FROZEN | VERTEX_SINGULAR | VERTEX_FIXED };

/* ---- memory */

void piece_fini(struct piece *piece)
{
    void *const owned[] = {piece->frozen,  piece->flags,           piece->boundary_faces,
                           piece->bounds,  piece->predicted,       piece->moved,
                           piece->most,    piece->nodes,           piece->tets,
                           piece->origins, piece->state.certified, piece->state.predicted};
    for (size_t i = 0; i < sizeof owned / sizeof *owned; i++)
        free(owned[i]);
    if (!piece->fresh)
        tetmesh_fini(&piece->mesh);
    *piece = (struct piece){0};
}

void piece_whole_fini(struct piece_whole *whole)
{
    free(whole->ranges.field_ranges);
    free(whole->ranges.component_ranges);
    free(whole->controlled);
    free(whole->limits);
    *whole = (struct piece_whole){0};
}

static enum tetlod_status no_memory(struct tetlod_error *error, uint64_t vertices)
{
    return tetlodi_fail_nomem(error, "a piece", 64 * vertices);
}

/* A mesh of so many vertices and tetrahedra with the types, grids and fields of another. */
static enum tetlod_status make_mesh(struct tetmesh *mesh, const struct tetmesh *like, uint32_t vertices, uint32_t tets,
                                    struct tetlod_error *error)
{
    *mesh = (struct tetmesh){.vertex_count = vertices, .tet_count = tets, .position_type = like->position_type};
    memcpy(mesh->position_grid, like->position_grid, sizeof mesh->position_grid);
    mesh->positions = array_new(vertices, 3 * sizeof(double));
    mesh->corners = array_new(tets, 4 * sizeof(uint32_t));
    if (!mesh->positions || !mesh->corners)
        return no_memory(error, vertices);
    for (uint32_t f = 0; f < like->field_count; f++) {
        const struct point_field *field = &like->fields[f];
        TETLOD_TRY(tetmesh_add_field(mesh, field->name, field->components, field->type, error));
        mesh->fields[f].grid = field->grid;
        mesh->fields[f].is_integer = field->is_integer;
        mesh->fields[f].is_ids = field->is_ids;
        memcpy(mesh->fields[f].unit, field->unit, sizeof field->unit);
    }
    return TETLOD_OK;
}

/* An empty piece of that size. On an error it is to be freed. */
static enum tetlod_status make_piece(struct piece *piece, const struct piece_whole *whole, const struct tetmesh *like,
                                     uint32_t vertices, uint32_t tets, struct tetlod_error *error)
{
    size_t n = vertices, k = whole->component_count;
    *piece = (struct piece){.whole = whole};
    TETLOD_TRY(make_mesh(&piece->mesh, like, vertices, tets, error));
    piece->frozen = array_zero(n, 1);
    piece->flags = array_zero(n, 1);
    piece->boundary_faces = array_zero(tets, 1);
    piece->bounds = array_new(n * k, 2 * sizeof(double));
    piece->predicted = array_new(n * k, sizeof(double));
    piece->moved = array_new(n, sizeof(double));
    piece->most = array_new(n, sizeof(double));
    piece->state.certified = array_zero(k, sizeof(double));
    piece->state.predicted = array_zero(k, sizeof(double));
    bool room = piece->frozen && piece->flags && piece->boundary_faces && piece->bounds && piece->predicted &&
                piece->moved && piece->most && piece->state.certified && piece->state.predicted;
    return room ? TETLOD_OK : no_memory(error, vertices);
}

/* ---- from a working mesh, and to one */

/* Copies what a slot has to a vertex of the piece. */
static void take_vertex(struct piece *piece, const struct working *working, const struct border *border, uint32_t slot,
                        uint32_t v)
{
    const double *row = working_row(working, slot);
    uint32_t k = working->component_count;
    memcpy(piece->mesh.positions + 3 * (size_t)v, row, 3 * sizeof *row);
    memcpy(piece->bounds + 2 * (size_t)v * k, row + ROW_FIELDS, 2 * k * sizeof *row);
    for (uint32_t c = 0; c < k; c++)
        piece->predicted[(size_t)v * k + c] = working->components[c].predicted[slot];
    for (uint32_t f = 0; f < working->field_count; f++) {
        const struct working_field *field = &working->fields[f];
        double *values = piece->mesh.fields[f].values + (size_t)v * field->components;
        for (uint32_t c = 0; c < field->components; c++)
            values[c] = working_values(working, slot, f)[c] + field->middles[c];
    }
    piece->moved[v] = row[row_moved(working)];
    piece->most[v] = border->most[slot];
    piece->flags[v] = working->flags[slot] & KEPT_FLAGS;
}

/* Faces by their corners, where the last two change places. */
static uint8_t turn_faces(uint8_t faces)
{
    return (uint8_t)((faces & 3) | (faces >> 1 & 4) | (faces << 1 & 8));
}

/* Copies a tetrahedron: `vertex` [slot] is the piece's. */
static void take_tet(struct piece *piece, const struct working *working, const uint32_t *vertex, uint32_t from,
                     uint32_t to)
{
    const uint32_t *corners = working->corners[from];
    bool turned = piece->whole->ranges.turned;
    uint32_t *out = piece->mesh.corners + 4 * (size_t)to;
    for (int c = 0; c < 4; c++)
        out[c] = vertex[corners[turned && c > 1 ? 5 - c : c]];
    piece->boundary_faces[to] = turned ? turn_faces(working->boundary_faces[from]) : working->boundary_faces[from];
}

static void keep_state(struct piece_state *out, const struct piece_state *state, uint32_t components)
{
    memcpy(out->certified, state->certified, components * sizeof(double));
    memcpy(out->predicted, state->predicted, components * sizeof(double));
    out->moved = state->moved;
}

enum tetlod_status piece_take(struct piece *piece, const struct working *working, const struct border *border,
                              struct tetlod_error *error)
{
    struct piece left;
    uint32_t *vertex = array_new(working->slot_count, sizeof *vertex), n = 0, m = 0;
    enum tetlod_status status =
        make_piece(&left, piece->whole, &piece->mesh, working->vertices_alive, working->tets_alive, error);
    left.nodes = array_new(working->vertices_alive, sizeof *left.nodes);
    left.tets = array_new(working->tets_alive, sizeof *left.tets);
    if (status == TETLOD_OK && (!vertex || !left.nodes || !left.tets))
        status = no_memory(error, working->slot_count);
    for (uint32_t slot = 0; slot < working->slot_count && status == TETLOD_OK; slot++) {
        if (!working_alive(working, slot))
            continue;
        uint32_t node = working->node[slot];
        take_vertex(&left, working, border, slot, n);
        if (node < working->slot_count) { // it was a vertex of the piece
            left.frozen[n] = piece->frozen[node];
            left.flags[n] = piece->frozen[node] ? piece->flags[node] : left.flags[n];
        }
        left.nodes[n] = node;
        vertex[slot] = n++;
    }
    for (uint32_t t = 0; t < working->tet_count && status == TETLOD_OK; t++)
        if (!tet_gone(working, t)) {
            left.tets[m] = piece->origins[t];
            take_tet(&left, working, vertex, t, m++);
        }
    free(vertex);
    if (status != TETLOD_OK) {
        piece_fini(&left);
        return status;
    }
    keep_state(&left.state, &piece->state, piece->whole->component_count);
    piece_fini(piece);
    *piece = left;
    return TETLOD_OK;
}

enum tetlod_status piece_open(struct piece *piece, struct working *working, struct contraction_log *log,
                              struct tetlod_error *error)
{
    const struct piece_whole *whole = piece->whole;
    uint32_t k = whole->component_count, *origins = array_new(piece->mesh.tet_count, sizeof *origins);
    free(piece->origins);
    piece->origins = origins;
    if (!origins)
        return no_memory(error, piece->mesh.tet_count);
    TETLOD_TRY(working_init(working, &piece->mesh, &whole->ranges, whole->controlled, whole->controlled_count,
                            whole->limits, log, error));
    TETLOD_TRY(working_origins(working, &piece->mesh, origins, error));
    for (uint32_t slot = 0; slot < working->slot_count; slot++) {
        uint32_t v = working->node[slot];
        double *row = working_row(working, slot);
        memcpy(row + ROW_FIELDS, piece->bounds + 2 * (size_t)v * k, 2 * k * sizeof *row);
        for (uint32_t c = 0; c < k; c++)
            working->components[c].predicted[slot] = piece->predicted[(size_t)v * k + c];
        row[row_moved(working)] = piece->moved[v];
        working->flags[slot] = (uint8_t)(VERTEX_ALIVE | piece->flags[v] | (piece->frozen[v] ? VERTEX_SINGULAR : 0));
    }
    for (uint32_t t = 0; t < working->tet_count; t++) {
        uint8_t faces = piece->boundary_faces[origins[t]];
        working->boundary_faces[t] = whole->ranges.turned ? turn_faces(faces) : faces;
    }
    return TETLOD_OK;
}

/* ---- the whole, and parts of it */

static enum tetlod_status find_whole(struct piece_whole *whole, const struct tetmesh *mesh, const uint32_t *controlled,
                                     uint32_t controlled_count, const double *limits, struct tetlod_error *error)
{
    uint32_t values = 0;
    for (uint32_t f = 0; f < mesh->field_count; f++)
        values += mesh->fields[f].components;
    *whole = (struct piece_whole){.ranges = {.turned = working_is_turned(mesh),
                                             .field_ranges = array_new(controlled_count, 2 * sizeof(double)),
                                             .component_ranges = array_new(values, 2 * sizeof(double))},
                                  .controlled = array_new(controlled_count, sizeof(uint32_t)),
                                  .controlled_count = controlled_count,
                                  .limits = limits ? array_new(controlled_count, sizeof(double)) : NULL};
    if (!whole->ranges.field_ranges || !whole->ranges.component_ranges || !whole->controlled ||
        (limits && !whole->limits))
        return no_memory(error, controlled_count);
    for (uint32_t i = 0; i < controlled_count; i++) {
        whole->controlled[i] = controlled[i];
        whole->component_count += mesh->fields[controlled[i]].components;
        point_field_range(&mesh->fields[controlled[i]], mesh->vertex_count, whole->ranges.field_ranges[i]);
        if (limits)
            whole->limits[i] = limits[i];
    }
    double(*range)[2] = whole->ranges.component_ranges;
    for (uint32_t f = 0; f < mesh->field_count; f++)
        for (size_t k = mesh->fields[f].components, c = 0; c < k; c++, range++) {
            (*range)[0] = (*range)[1] = mesh->fields[f].values[c];
            for (size_t v = 1; v < mesh->vertex_count; v++) {
                (*range)[0] = smaller((*range)[0], mesh->fields[f].values[v * k + c]);
                (*range)[1] = larger((*range)[1], mesh->fields[f].values[v * k + c]);
            }
        }
    return TETLOD_OK;
}

enum tetlod_status piece_border_find(struct piece_border *out, const struct tetmesh *mesh, bool turned,
                                     const struct simplify_options *options, struct tetlod_error *error)
{
    struct working working = {0};
    struct contraction_log log = {0};
    struct pool *pool = pool_new(options->threads ? options->threads : parallel_cores());
    enum tetlod_status status;
    *out = (struct piece_border){.most = array_new(mesh->vertex_count, sizeof *out->most)};
    if (!pool || !out->most)
        TETLOD_TRY_DONE(no_memory(error, mesh->vertex_count));
    TETLOD_TRY_DONE(working_look(&working, mesh, turned, &log, error));
    TETLOD_TRY_DONE(border_find(&working, pool, error));
    TETLOD_TRY_DONE(border_find_most(out->most, &working, mesh, options->boundary_limit, options->boundary_least,
                                     pool_size(pool), error));
    out->degenerate_tets = log.degenerate_tets;
    out->inverted_tets = log.inverted_tets;
    out->folded_tets = log.folded_tets;
    for (uint32_t v = 0; v < mesh->vertex_count; v++)
        working.flags[v] &= KEPT_FLAGS;
    for (uint32_t t = 0; t < mesh->tet_count && turned; t++)
        working.boundary_faces[t] = turn_faces(working.boundary_faces[t]);
    out->flags = working.flags;
    out->boundary_faces = working.boundary_faces;
    working.flags = working.boundary_faces = NULL;
done:
    working_look_end(&working, mesh);
    pool_free(pool);
    return status;
}

void piece_border_fini(struct piece_border *border)
{
    free(border->flags);
    free(border->boundary_faces);
    free(border->most);
    *border = (struct piece_border){0};
}

enum tetlod_status piece_take_border(struct piece *piece, struct piece_whole *whole, struct piece_border *border,
                                     const struct simplify_options *options, struct tetlod_error *error)
{
    piece->flags = border->flags;
    piece->boundary_faces = border->boundary_faces;
    piece->most = border->most;
    whole->degenerate_tets = border->degenerate_tets;
    whole->inverted_tets = border->inverted_tets;
    whole->folded_tets = border->folded_tets;
    *border = (struct piece_border){0};
    regions_fix_vertices(piece->mesh.vertex_count, options->fixed, NULL, piece->flags);
    return regions_fix(&piece->mesh, options->regions, NULL, piece->flags, error);
}

enum tetlod_status piece_begin(struct piece *piece, struct piece_whole *whole, const struct tetmesh *mesh,
                               const uint32_t *controlled, uint32_t controlled_count, const double *limits,
                               struct tetlod_error *error)
{
    enum tetlod_status status;
    *piece = (struct piece){.whole = whole, .fresh = true, .mesh = *mesh};
    piece->mesh.cell_field_count = 0;
    *whole = (struct piece_whole){0};
    TETLOD_TRY_DONE(find_whole(whole, mesh, controlled, controlled_count, limits, error));
    piece->state.certified = array_zero(whole->component_count, sizeof(double));
    piece->state.predicted = array_zero(whole->component_count, sizeof(double));
    status = piece->state.certified && piece->state.predicted ? TETLOD_OK : no_memory(error, 0);
done:
    if (status != TETLOD_OK) {
        piece_fini(piece);
        piece_whole_fini(whole);
    }
    return status;
}

enum tetlod_status piece_own(struct piece *piece, struct tetlod_error *error)
{
    struct piece own;
    TETLOD_TRY(piece_new(&own, piece, piece->mesh.vertex_count, piece->mesh.tet_count, error));
    for (uint32_t v = 0; v < piece->mesh.vertex_count; v++)
        piece_copy_vertex(&own, v, piece, v);
    memcpy(own.mesh.corners, piece->mesh.corners, piece->mesh.tet_count * 4 * sizeof(uint32_t));
    memcpy(own.boundary_faces, piece->boundary_faces, piece->mesh.tet_count);
    piece_fini(piece);
    *piece = own;
    return TETLOD_OK;
}

enum tetlod_status piece_of_mesh(struct piece *piece, struct piece_whole *whole, const struct tetmesh *mesh,
                                 const uint32_t *controlled, uint32_t controlled_count, const double *limits,
                                 const struct simplify_options *options, struct tetlod_error *error)
{
    struct piece_border border = {0};
    enum tetlod_status status;
    TETLOD_TRY(piece_begin(piece, whole, mesh, controlled, controlled_count, limits, error));
    TETLOD_TRY_DONE(piece_border_find(&border, mesh, whole->ranges.turned, options, error));
    TETLOD_TRY_DONE(piece_take_border(piece, whole, &border, options, error));
    status = piece_own(piece, error);
done:
    piece_border_fini(&border);
    if (status != TETLOD_OK) {
        piece_fini(piece);
        piece_whole_fini(whole);
    }
    return status;
}

/* Lists the vertices of the tetrahedra and numbers them from 0. */
static uint32_t list_vertices(const struct piece *of, const uint32_t *tets, uint32_t tet_count, uint32_t *number,
                              uint32_t *vertices)
{
    uint32_t count = 0;
    for (size_t i = 0; i < 4 * (size_t)tet_count; i++) {
        uint32_t v = of->mesh.corners[4 * (size_t)tets[i / 4] + i % 4];
        if (number[v] == TETLOD_NONE) {
            number[v] = count;
            vertices[count++] = v;
        }
    }
    return count;
}

/* What follows from the whole mesh at a vertex of a fresh piece (as working_init makes it): the values on their grids;
 * U and L, which are the values themselves. */
static void copy_fresh(struct piece *out, uint32_t to, const struct piece *of, uint32_t from)
{
    const struct piece_whole *whole = of->whole;
    const double(*range)[2] = (const double(*)[2])whole->ranges.component_ranges;
    double *bounds = out->bounds + 2 * (size_t)to * whole->component_count;
    for (uint32_t f = 0; f < of->mesh.field_count; range += of->mesh.fields[f++].components) {
        const struct point_field *field = &of->mesh.fields[f];
        const double *values = field->values + (size_t)from * field->components;
        for (uint32_t c = 0; c < field->components; c++)
            out->mesh.fields[f].values[(size_t)to * field->components + c] =
                grid_round(&field->grid, field->type, values[c]) - field_middle(range[c]) + field_middle(range[c]);
    }
    for (uint32_t i = 0; i < whole->controlled_count; i++) {
        const struct point_field *field = &of->mesh.fields[whole->controlled[i]];
        range = (const double(*)[2])whole->ranges.component_ranges;
        for (uint32_t f = 0; f < whole->controlled[i]; f++)
            range += of->mesh.fields[f].components;
        for (uint32_t c = 0; c < field->components; c++, bounds += 2)
            bounds[0] = bounds[1] = field->values[(size_t)from * field->components + c] - field_middle(range[c]);
    }
    memset(out->predicted + (size_t)to * whole->component_count, 0, whole->component_count * sizeof(double));
    out->moved[to] = 0;
    out->frozen[to] = 0;
}

static void copy_contracted(struct piece *out, uint32_t to, const struct piece *of, uint32_t from)
{
    uint32_t k = of->whole->component_count;
    memcpy(out->bounds + 2 * (size_t)to * k, of->bounds + 2 * (size_t)from * k, 2 * k * sizeof(double));
    memcpy(out->predicted + (size_t)to * k, of->predicted + (size_t)from * k, k * sizeof(double));
    for (uint32_t f = 0; f < of->mesh.field_count; f++) {
        size_t size = of->mesh.fields[f].components;
        memcpy(out->mesh.fields[f].values + to * size, of->mesh.fields[f].values + from * size, size * sizeof(double));
    }
    out->moved[to] = of->moved[from];
    out->frozen[to] = of->frozen[from];
}

void piece_copy_vertex(struct piece *out, uint32_t to, const struct piece *of, uint32_t from)
{
    memcpy(out->mesh.positions + 3 * (size_t)to, of->mesh.positions + 3 * (size_t)from, 3 * sizeof(double));
    out->most[to] = of->most[from];
    out->flags[to] = of->flags[from];
    if (of->fresh)
        copy_fresh(out, to, of, from);
    else
        copy_contracted(out, to, of, from);
}

enum tetlod_status piece_new(struct piece *out, const struct piece *like, uint32_t vertices, uint32_t tets,
                             struct tetlod_error *error)
{
    enum tetlod_status status = make_piece(out, like->whole, &like->mesh, vertices, tets, error);
    if (status == TETLOD_OK)
        keep_state(&out->state, &like->state, like->whole->component_count);
    else
        piece_fini(out);
    return status;
}

enum tetlod_status piece_part(struct piece *out, const struct piece *of, const uint32_t *tets, uint32_t tet_count,
                              const uint8_t *shared, uint32_t *number, uint32_t **out_vertices,
                              struct tetlod_error *error)
{
    size_t n = of->mesh.vertex_count, most = n < 4 * (size_t)tet_count ? n : 4 * (size_t)tet_count;
    uint32_t *vertices = array_new(most, sizeof *vertices);
    *out = (struct piece){0};
    *out_vertices = vertices;
    if (!vertices)
        return no_memory(error, most);
    uint32_t count = list_vertices(of, tets, tet_count, number, vertices);
    enum tetlod_status status = piece_new(out, of, count, tet_count, error);
    for (uint32_t v = 0; v < count && status == TETLOD_OK; v++) {
        piece_copy_vertex(out, v, of, vertices[v]);
        out->frozen[v] |= shared[vertices[v]];
    }
    for (size_t i = 0; i < 4 * (size_t)tet_count && status == TETLOD_OK; i++)
        out->mesh.corners[i] = number[of->mesh.corners[4 * (size_t)tets[i / 4] + i % 4]];
    for (uint32_t t = 0; t < tet_count && status == TETLOD_OK; t++)
        out->boundary_faces[t] = of->boundary_faces[tets[t]];
    for (uint32_t v = 0; v < count; v++)
        number[vertices[v]] = TETLOD_NONE;
    if (status != TETLOD_OK) {
        free(vertices);
        *out_vertices = NULL;
    }
    return status;
}

/* Which vertices some of the tetrahedra have and some do not. */
static void find_shared(const struct piece *of, const uint32_t *tets, uint32_t tet_count, uint32_t *degrees,
                        uint8_t *shared)
{
    for (size_t i = 0; i < 4 * (size_t)of->mesh.tet_count; i++)
        degrees[of->mesh.corners[i]]++;
    for (size_t i = 0; i < 4 * (size_t)tet_count; i++)
        degrees[of->mesh.corners[4 * (size_t)tets[i / 4] + i % 4]]--;
    for (uint32_t v = 0; v < of->mesh.vertex_count; v++)
        shared[v] = degrees[v] != 0;
}

enum tetlod_status piece_cut(struct piece *out, const struct piece *of, const uint32_t *tets, uint32_t tet_count,
                             uint32_t **out_vertices, struct tetlod_error *error)
{
    size_t n = of->mesh.vertex_count;
    uint32_t *scratch = array_zero(n, sizeof *scratch);
    uint8_t *shared = array_new(n, 1);
    enum tetlod_status status = TETLOD_OK;
    *out = (struct piece){0};
    *out_vertices = NULL;
    if (!scratch || !shared)
        TETLOD_TRY_DONE(no_memory(error, n));
    find_shared(of, tets, tet_count, scratch, shared);
    memset(scratch, 0xff, n * sizeof *scratch);
    status = piece_part(out, of, tets, tet_count, shared, scratch, out_vertices, error);
done:
    free(scratch);
    free(shared);
    return status;
}
