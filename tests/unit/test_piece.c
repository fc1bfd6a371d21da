/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * Pieces: the whole mesh as one is contracted as simplify() does it; cut in pieces whose seams are frozen, contracted
 * piece by piece, joined, cut elsewhere and contracted further, a mesh stays sound, and its certified error is an upper
 * bound of the true one.
 */
#include "src/simplify/piece.h"

#include <stdlib.h>

#include "src/measure/measure.h"
#include "src/measure/overlay.h"
#include "src/mesh/mesh_check.h"
#include "src/mesh/tet_geom.h"
#include "src/sample/sample.h"
#include "src/simplify/rounds/rounds.h"
#include "src/simplify/simplify.h"
#include "tests/test.h"

enum { PIECES = 3 };

static struct simplify_options usual(const struct tetmesh *mesh, double max_error)
{
    return (struct simplify_options){.metric = METRIC_ENVELOPE,
                                     .contract = CONTRACT_EDGES,
                                     .max_error = max_error,
                                     .min_tets = 1,
                                     .boundary_angle = 30,
                                     .boundary_limit = 1e-3 * mesh_diagonal(mesh),
                                     .growth = 1.2,
                                     .threads = 2};
}

static struct mesh_report look(const struct tetmesh *mesh)
{
    struct mesh_report report = {0};
    CHECK_INT(mesh_check(mesh->positions, mesh->corners, mesh->vertex_count, mesh->tet_count, &report, NULL),
              TETLOD_OK);
    return report;
}

/* ---- one piece */

static void turn(struct tetmesh *mesh)
{
    for (size_t t = 0; t < mesh->tet_count; t++) {
        uint32_t swap = mesh->corners[4 * t];
        mesh->corners[4 * t] = mesh->corners[4 * t + 1];
        mesh->corners[4 * t + 1] = swap;
    }
}

static void check_whole(const char *name, uint32_t size, bool turned)
{
    struct tetmesh mesh = {0};
    struct contraction_log logs[2];
    struct piece piece;
    struct piece_whole whole;
    const uint32_t controlled = 0;
    REQUIRE(sample_find(name)->make(&mesh, size, NULL) == TETLOD_OK);
    if (turned)
        turn(&mesh);
    struct simplify_options options = usual(&mesh, 0.1);
    REQUIRE(simplify(&logs[0], &mesh, &controlled, 1, NULL, &options, NULL) == TETLOD_OK);
    REQUIRE(piece_of_mesh(&piece, &whole, &mesh, &controlled, 1, NULL, &options, NULL) == TETLOD_OK);
    REQUIRE(rounds_contract(&logs[1], &piece, 1e-6, &options, NULL) == TETLOD_OK);
    const struct contraction_log *a = &logs[0], *b = &logs[1];
    REQUIRE(a->count == b->count && a->mark_count == b->mark_count && a->count > 100);
    CHECK(memcmp(a->children, b->children, 16 * (size_t)a->count) == 0);
    CHECK(memcmp(a->positions, b->positions, 24 * (size_t)a->count) == 0);
    for (uint32_t f = 0; f < mesh.field_count; f++)
        CHECK(memcmp(a->fields[f].values, b->fields[f].values, 8 * (size_t)mesh.fields[f].components * a->count) == 0);
    CHECK(memcmp(a->certified, b->certified, a->mark_count * sizeof *a->certified) == 0);
    CHECK_INT(piece.mesh.vertex_count, a->marks[a->mark_count - 1].vertices);
    CHECK_INT(piece.mesh.tet_count, a->marks[a->mark_count - 1].tets);
    CHECK_INT(look(&piece.mesh).orientation, look(&mesh).orientation);
    CHECK(piece.state.certified[0] == a->certified[a->mark_count - 1]);
    piece_fini(&piece);
    piece_whole_fini(&whole);
    for (int i = 0; i < 2; i++)
        log_fini(&logs[i]);
    tetmesh_fini(&mesh);
}

static void test_whole(void)
{
    check_whole("fin", 12, false);
    check_whole("cube", 8, true);
    check_whole("torus", 5, false);
}

/* ---- several */

/* A piece's tetrahedra by where their middles are along an axis, in as many slabs as there are pieces. */
static void cut(const struct piece *of, int axis, struct piece *pieces, uint32_t **vertices)
{
    double low = INFINITY, high = -INFINITY;
    uint32_t *tets = malloc(of->mesh.tet_count * sizeof *tets);
    REQUIRE(tets != NULL);
    for (uint32_t v = 0; v < of->mesh.vertex_count; v++) {
        low = smaller(low, of->mesh.positions[3 * v + axis]);
        high = larger(high, of->mesh.positions[3 * v + axis]);
    }
    for (int i = 0; i < PIECES; i++) {
        uint32_t count = 0;
        for (uint32_t t = 0; t < of->mesh.tet_count; t++) {
            double sum = 0;
            for (int c = 0; c < 4; c++)
                sum += of->mesh.positions[3 * of->mesh.corners[4 * t + c] + axis];
            int slab = (int)(PIECES * (sum / 4 - low) / (high - low));
            if ((slab < PIECES ? slab : PIECES - 1) == i)
                tets[count++] = t;
        }
        REQUIRE(piece_cut(&pieces[i], of, tets, count, &vertices[i], NULL) == TETLOD_OK);
    }
    free(tets);
}

/* Copies of a vertex that several pieces have must be the same. */
static void check_copy(const struct piece *a, uint32_t v, const struct piece *b, uint32_t w)
{
    CHECK(memcmp(a->mesh.positions + 3 * v, b->mesh.positions + 3 * w, 24) == 0);
    CHECK(memcmp(a->bounds + 2 * v, b->bounds + 2 * w, 16) == 0 &&
          a->mesh.fields[0].values[v] == b->mesh.fields[0].values[w]);
    CHECK(a->moved[v] == b->moved[w] && a->flags[v] == b->flags[w]);
}

/* The piece's vertices that are joined. */
struct joined {
    uint32_t piece, vertex;
};

static void copy_vertex(struct piece *out, uint32_t to, const struct piece *from, uint32_t v)
{
    memcpy(out->mesh.positions + 3 * to, from->mesh.positions + 3 * v, 24);
    memcpy(out->bounds + 2 * to, from->bounds + 2 * v, 16);
    out->mesh.fields[0].values[to] = from->mesh.fields[0].values[v];
    out->predicted[to] = from->predicted[v];
    out->moved[to] = from->moved[v];
    out->most[to] = from->most[v];
    out->flags[to] = from->flags[v];
}

/* Joins what is left of the pieces, in place of what they were cut from: a frozen vertex once. */
static void join(struct piece *out, const struct piece *pieces, uint32_t *const *vertices)
{
    uint32_t n = 0, m = 0, room = out->mesh.vertex_count;
    uint32_t *joined_as = malloc(room * sizeof *joined_as), *numbers = malloc(room * sizeof *numbers);
    struct joined *first = malloc(room * sizeof *first);
    REQUIRE(joined_as && numbers && first);
    memset(joined_as, 0xff, room * sizeof *joined_as);
    for (uint32_t i = 0; i < PIECES; i++) {
        const struct piece *piece = &pieces[i];
        for (uint32_t v = 0; v < piece->mesh.vertex_count; v++) {
            uint32_t was = piece->frozen[v] ? vertices[i][piece->nodes[v]] : TETLOD_NONE;
            numbers[v] = was != TETLOD_NONE && joined_as[was] != TETLOD_NONE ? joined_as[was] : n;
            if (numbers[v] < n) {
                check_copy(piece, v, &pieces[first[numbers[v]].piece], first[numbers[v]].vertex);
                continue;
            }
            if (was != TETLOD_NONE)
                joined_as[was] = n;
            first[n] = (struct joined){i, v};
            copy_vertex(out, n++, piece, v);
        }
        for (uint32_t t = 0; t < piece->mesh.tet_count; t++, m++) {
            for (int c = 0; c < 4; c++)
                out->mesh.corners[4 * m + c] = numbers[piece->mesh.corners[4 * t + c]];
            out->boundary_faces[m] = piece->boundary_faces[t];
        }
        out->state.certified[0] = larger(out->state.certified[0], piece->state.certified[0]);
        out->state.predicted[0] = larger(out->state.predicted[0], piece->state.predicted[0]);
        out->state.moved = larger(out->state.moved, piece->state.moved);
    }
    out->mesh.vertex_count = n;
    out->mesh.tet_count = m;
    free(joined_as);
    free(numbers);
    free(first);
}

/* Sound, of the original's topology, and within its certified error of the original. */
static void check_joined(const struct piece *joined, const struct tetmesh *mesh, const struct mesh_report *start)
{
    struct mesh_report now = look(&joined->mesh);
    struct overlay_report report;
    double range[2], truth = INFINITY;
    CHECK_INT(now.unused_vertices + now.degenerate_tets + now.inverted_tets + now.duplicate_tets, 0);
    CHECK_INT(now.overfull_faces + now.same_side_faces, 0);
    CHECK_INT(now.orientation, start->orientation);
    CHECK_INT(now.euler, start->euler);
    CHECK_INT(now.components, start->components);
    CHECK_INT(now.boundary_components, start->boundary_components);
    CHECK_INT(now.singular_vertices, start->singular_vertices);
    point_field_range(&mesh->fields[0], mesh->vertex_count, range);
    CHECK_INT(overlay_max(mesh, (uint32_t[]){0}, &joined->mesh, (uint32_t[]){0}, 1,
                          &(struct overlay_options){.threads = 2}, &truth, &report, NULL),
              TETLOD_OK);
    truth /= range[1] - range[0];
    printf("# %u tetrahedra left, true error %g, certified %g\n", joined->mesh.tet_count, truth,
           joined->state.certified[0]);
    CHECK(truth <= joined->state.certified[0] * (1 + 1e-6) + 1e-12);
    CHECK(truth > 0.1 * joined->state.certified[0]); // else the comparison says little
}

/* Cuts, contracts each piece, and joins them again. */
static void contract_pieces(struct piece *whole, int axis, double from, const struct simplify_options *options)
{
    struct piece pieces[PIECES];
    uint32_t *vertices[PIECES];
    cut(whole, axis, pieces, vertices);
    for (int i = 0; i < PIECES; i++) {
        struct contraction_log log;
        uint32_t frozen = 0, left = 0, before = pieces[i].mesh.tet_count;
        for (uint32_t v = 0; v < pieces[i].mesh.vertex_count; v++)
            frozen += pieces[i].frozen[v];
        REQUIRE(rounds_contract(&log, &pieces[i], from, options, NULL) == TETLOD_OK);
        for (uint32_t v = 0; v < pieces[i].mesh.vertex_count; v++)
            left += pieces[i].frozen[v] && pieces[i].nodes[v] < log.vertex_count;
        CHECK(frozen > 0 && left == frozen); // none is contracted
        CHECK(pieces[i].mesh.tet_count <= before);
        CHECK(pieces[i].state.certified[0] <= options->max_error * (1 + 1e-9));
        log_fini(&log);
    }
    join(whole, pieces, vertices);
    for (int i = 0; i < PIECES; i++) {
        piece_fini(&pieces[i]);
        free(vertices[i]);
    }
}

static void check_pieces(const char *name, uint32_t size, double boundary, bool turned)
{
    struct tetmesh mesh = {0};
    struct piece piece;
    struct piece_whole whole;
    REQUIRE(sample_find(name)->make(&mesh, size, NULL) == TETLOD_OK);
    if (turned)
        turn(&mesh);
    while (mesh.field_count > 1) // one field: join() above
        point_field_fini(&mesh.fields[--mesh.field_count]);
    struct mesh_report start = look(&mesh);
    struct simplify_options options = usual(&mesh, 0.01);
    options.boundary_limit = boundary * mesh_diagonal(&mesh);
    printf("# %s %u\n", name, size);
    REQUIRE(piece_of_mesh(&piece, &whole, &mesh, (uint32_t[]){0}, 1, NULL, &options, NULL) == TETLOD_OK);
    contract_pieces(&piece, 0, 1e-6, &options);
    check_joined(&piece, &mesh, &start);
    uint32_t once = piece.mesh.tet_count;
    contract_pieces(&piece, 1, 0.01, &options); // the seams of before are inside
    check_joined(&piece, &mesh, &start);
    CHECK(piece.mesh.tet_count < once);
    options.max_error = 0.03;
    contract_pieces(&piece, 2, 0.01, &options);
    check_joined(&piece, &mesh, &start);
    piece_fini(&piece);
    piece_whole_fini(&whole);
    tetmesh_fini(&mesh);
}

static void test_pieces(void)
{
    check_pieces("cube", 10, 1e-3, false);
    check_pieces("fin", 14, 0, true);
    check_pieces("torus", 6, 0, false);
}

int main(void)
{
    RUN(test_whole);
    RUN(test_pieces);
    return test_end();
}
