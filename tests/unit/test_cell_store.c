/* SPDX-License-Identifier: BSD-3-Clause */
/* A cell as bytes: it comes back as it was, through a store, in any order; bytes that are cut off or too many are
 * refused. */
#include "src/cells/cell_store.h"

#include <stdlib.h>
#include <string.h>

#include "src/cells/cell.h"
#include "src/measure/measure.h"
#include "src/sample/sample.h"
#include "src/simplify/rounds/rounds.h"
#include "tests/test.h"

struct made {
    struct tetmesh mesh;
    struct piece_whole whole;
    struct piece like; /* the whole mesh, as it was */
    struct cell cell;
};

/* A cell that has caught up and gone on, with its local bounds. */
static void make(struct made *made)
{
    const uint32_t controlled = 0;
    struct cell *cell = &made->cell;
    *made = (struct made){0};
    REQUIRE(sample_find("fin")->make(&made->mesh, 10, NULL) == TETLOD_OK);
    struct simplify_options options = {.metric = METRIC_ENVELOPE,
                                       .contract = CONTRACT_EDGES,
                                       .max_error = 0.01,
                                       .min_tets = 1,
                                       .boundary_angle = 30,
                                       .boundary_limit = 1e-3 * mesh_diagonal(&made->mesh),
                                       .local_bound = true,
                                       .growth = 1.2,
                                       .threads = 1};
    REQUIRE(piece_of_mesh(&made->like, &made->whole, &made->mesh, &controlled, 1, NULL, &options, NULL) == TETLOD_OK);
    uint32_t *tets = malloc(made->mesh.tet_count * sizeof *tets);
    REQUIRE(tets);
    for (uint32_t t = 0; t < made->mesh.tet_count; t++)
        tets[t] = t;
    REQUIRE(piece_cut(&cell->piece, &made->like, tets, made->mesh.tet_count / 2, &cell->vertices, NULL) == TETLOD_OK);
    free(tets);
    cell->tets = made->mesh.tet_count / 2;
    REQUIRE(rounds_contract(&cell->logs[CELL_CATCH_UP], &cell->piece, 1e-4, &options, NULL) == TETLOD_OK);
    size_t size = cell->piece.mesh.vertex_count * sizeof *cell->nodes;
    cell->nodes = malloc(size);
    REQUIRE(cell->nodes);
    memcpy(cell->nodes, cell->piece.nodes, size);
    options.max_error = 0.1;
    REQUIRE(rounds_contract(&cell->logs[CELL_GO_ON], &cell->piece, 0.01, &options, NULL) == TETLOD_OK);
    REQUIRE(cell->logs[CELL_CATCH_UP].count > 50 && cell->logs[CELL_GO_ON].count > 50);
}

static void unmake(struct made *made)
{
    cell_fini(&made->cell);
    piece_fini(&made->like);
    piece_whole_fini(&made->whole);
    tetmesh_fini(&made->mesh);
}

static void check_logs(const struct contraction_log *a, const struct contraction_log *b)
{
    CHECK_INT(a->vertex_count, b->vertex_count);
    REQUIRE(a->count == b->count && a->mark_count == b->mark_count && a->component_count == b->component_count);
    CHECK(memcmp(a->children, b->children, 16 * (size_t)a->count) == 0);
    CHECK(memcmp(a->positions, b->positions, 24 * (size_t)a->count) == 0);
    CHECK(memcmp(a->marks, b->marks, a->mark_count * sizeof *a->marks) == 0);
    CHECK(memcmp(a->certified, b->certified, a->mark_count * sizeof *a->certified) == 0);
    CHECK(memcmp(a->refused, b->refused, sizeof a->refused) == 0);
    REQUIRE(a->components[0].bounds && b->components[0].bounds && a->components[0].bounds != b->components[0].bounds);
    CHECK(memcmp(a->components[0].bounds, b->components[0].bounds, 8 * (size_t)a->count) == 0);
}

static void check_pieces(const struct piece *a, const struct piece *b)
{
    size_t n = a->mesh.vertex_count, m = a->mesh.tet_count;
    REQUIRE(n == b->mesh.vertex_count && m == b->mesh.tet_count);
    CHECK(memcmp(a->mesh.positions, b->mesh.positions, 24 * n) == 0);
    CHECK(memcmp(a->mesh.corners, b->mesh.corners, 16 * m) == 0);
    for (uint32_t f = 0; f < a->mesh.field_count; f++)
        CHECK(memcmp(a->mesh.fields[f].values, b->mesh.fields[f].values, 8 * n * a->mesh.fields[f].components) == 0);
    CHECK(memcmp(a->frozen, b->frozen, n) == 0 && memcmp(a->flags, b->flags, n) == 0);
    CHECK(memcmp(a->bounds, b->bounds, 16 * n) == 0 && memcmp(a->most, b->most, 8 * n) == 0);
    CHECK(memcmp(a->moved, b->moved, 8 * n) == 0 && memcmp(a->nodes, b->nodes, 4 * n) == 0);
    CHECK(memcmp(a->boundary_faces, b->boundary_faces, m) == 0);
}

/* A file of cells has two thirds of what they take in memory, or less. */
static void check_small(const struct cell *cell, size_t size)
{
    size_t vertices = cell->piece.mesh.vertex_count, tets = cell->piece.mesh.tet_count;
    size_t plain = vertices * (24 + 8 * 5 + 8 + 2 + 4) + tets * 17 +
                   4 * ((size_t)cell->logs[CELL_CATCH_UP].vertex_count + cell->logs[CELL_GO_ON].vertex_count);
    for (int stage = 0; stage < CELL_STAGES; stage++)
        plain += (16 + 24 + 8 + 8) * (size_t)cell->logs[stage].count;
    if (size > plain * 7 / 10)
        TEST_FAIL("%zu bytes of %zu", size, plain);
}

/* What of a cell is known by its first bytes. */
enum { HEAD = 4096 };

static void check_heads(const struct cell *head, const struct cell *cell)
{
    CHECK_INT(head->tets, cell->tets);
    for (int stage = 0; stage < CELL_STAGES; stage++) {
        const struct contraction_log *a = &head->logs[stage], *b = &cell->logs[stage];
        size_t rows = (size_t)b->mark_count * b->component_count;
        REQUIRE(a->mark_count == b->mark_count && a->component_count == b->component_count);
        CHECK_INT(a->count, b->count);
        CHECK(memcmp(a->marks, b->marks, b->mark_count * sizeof *b->marks) == 0);
        CHECK(memcmp(a->certified, b->certified, rows * sizeof *b->certified) == 0);
        CHECK(memcmp(a->predicted, b->predicted, rows * sizeof *b->predicted) == 0);
    }
}

static void test_store(void)
{
    struct made made;
    struct cell_store store;
    struct buffer bytes = {0};
    unsigned char *back;
    size_t size;
    make(&made);
    REQUIRE(cell_spool_new(&store, 3, NULL) == TETLOD_OK);
    REQUIRE(cell_pack(&made.cell, &bytes, NULL) == TETLOD_OK);
    check_small(&made.cell, bytes.size);
    REQUIRE(store.put(store.opaque, 2, "other", 5, NULL) == TETLOD_OK);
    REQUIRE(store.put(store.opaque, 0, bytes.bytes, bytes.size, NULL) == TETLOD_OK);
    REQUIRE(store.put(store.opaque, 1, "", 0, NULL) == TETLOD_OK);
    REQUIRE(store.get(store.opaque, 0, SIZE_MAX, &back, &size, NULL) == TETLOD_OK);
    struct cell cell;
    REQUIRE(size == bytes.size && cell_unpack(&cell, &made.like, back, size, NULL) == TETLOD_OK);
    free(back);
    CHECK_INT(cell.tets, made.cell.tets);
    for (int stage = 0; stage < CELL_STAGES; stage++)
        check_logs(&cell.logs[stage], &made.cell.logs[stage]);
    check_pieces(&cell.piece, &made.cell.piece);
    CHECK(memcmp(cell.vertices, made.cell.vertices, 4 * (size_t)made.cell.logs[CELL_CATCH_UP].vertex_count) == 0);
    CHECK(memcmp(cell.nodes, made.cell.nodes, 4 * (size_t)made.cell.logs[CELL_GO_ON].vertex_count) == 0);
    cell_drop(&cell);
    CHECK(cell.logs[CELL_GO_ON].mark_count == made.cell.logs[CELL_GO_ON].mark_count && !cell.vertices);
    cell_fini(&cell);
    REQUIRE(store.get(store.opaque, 0, HEAD, &back, &size, NULL) == TETLOD_OK);
    CHECK(size >= HEAD && size < bytes.size);
    REQUIRE(cell_unpack_head(&cell, back, size, NULL) == TETLOD_OK);
    free(back);
    check_heads(&cell, &made.cell);
    cell_fini(&cell);
    REQUIRE(store.get(store.opaque, 2, SIZE_MAX, &back, &size, NULL) == TETLOD_OK);
    CHECK(size == 5 && memcmp(back, "other", 5) == 0);
    free(back);
    cell_spool_free(&store);
    buffer_fini(&bytes);
    unmake(&made);
}

static void test_damage(void)
{
    struct made made;
    struct buffer bytes = {0};
    struct cell cell;
    make(&made);
    REQUIRE(cell_pack(&made.cell, &bytes, NULL) == TETLOD_OK);
    REQUIRE(buffer_append(&bytes, "x", 1) == TETLOD_OK);
    CHECK(cell_unpack(&cell, &made.like, bytes.bytes, bytes.size, NULL) == TETLOD_ERR_IO);
    cell_fini(&cell);
    for (size_t size = 0; size + 1 < bytes.size; size += 1 + size / 40) {
        CHECK(cell_unpack(&cell, &made.like, bytes.bytes, size, NULL) == TETLOD_ERR_IO);
        cell_fini(&cell);
    }
    buffer_fini(&bytes);
    unmake(&made);
}

int main(void)
{
    RUN(test_store);
    RUN(test_damage);
    return test_end();
}
