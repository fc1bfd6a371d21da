/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * A cell's bytes are its counts and then its arrays, the large ones packed (packed_words.h). One function visits all of
 * them, in both directions, so that what is packed and what is unpacked cannot differ.
 */
#include "src/cells/cell.h"

#include <stdlib.h>
#include <string.h>

#include "format/fail.h"
#include "src/util/array.h"
#include "src/util/packed_words.h"

/* The counts of a cell, and whether there are arrays that not every one has. */
struct counts {
    uint32_t tets, vertices, left_vertices, left_tets, nodes;
    uint8_t has_vertices, has_nodes, has_bounds[CELL_STAGES];
    uint32_t log_vertices[CELL_STAGES], records[CELL_STAGES], components[CELL_STAGES], marks[CELL_STAGES];
    uint64_t refused[CELL_STAGES][LOG_REFUSALS];
};

struct visit {
    struct buffer *out;       /* packing */
    struct words_source from; /* unpacking */
    enum tetlod_status status;
};

void cell_fini(struct cell *cell)
{
    piece_fini(&cell->piece);
    for (int stage = 0; stage < CELL_STAGES; stage++)
        log_fini(&cell->logs[stage]);
    free(cell->vertices);
    free(cell->nodes);
    *cell = (struct cell){0};
}

static void drop_log(struct contraction_log *log)
{
    for (uint32_t f = 0; f < log->field_count; f++)
        free(log->fields[f].values);
    for (uint32_t c = 0; c < log->component_count; c++) {
        free(log->components[c].bounds);
        log->components[c].bounds = NULL;
    }
    free(log->fields);
    free(log->children);
    free(log->positions);
    log->fields = NULL;
    log->field_count = 0;
    log->children = NULL;
    log->positions = NULL;
}

void cell_drop(struct cell *cell)
{
    piece_fini(&cell->piece);
    for (int stage = 0; stage < CELL_STAGES; stage++)
        drop_log(&cell->logs[stage]);
    free(cell->vertices);
    free(cell->nodes);
    cell->vertices = cell->nodes = NULL;
}

/* Bytes that are there already, in both directions. */
static void visit_bytes(struct visit *visit, void *bytes, size_t size)
{
    if (visit->status != TETLOD_OK || !size)
        return;
    if (visit->out) {
        visit->status = buffer_append(visit->out, bytes, size);
    } else if (!words_get(&visit->from, bytes, size, 1, 1)) {
        visit->status = TETLOD_ERR_IO;
    }
}

/* The same for numbers, of which each is like the one `lag` before. */
static void visit_words(struct visit *visit, void *words, size_t count, size_t width, size_t lag)
{
    if (visit->status != TETLOD_OK)
        return;
    if (visit->out)
        visit->status = words_put(visit->out, words, count, (unsigned)width, (unsigned)lag) ? TETLOD_OK
                                                                                            : TETLOD_ERR_NOMEM;
    else if (!words_get(&visit->from, words, count, (unsigned)width, (unsigned)lag))
        visit->status = TETLOD_ERR_IO;
}

/* An array, which is allocated where the cell is unpacked: of numbers, or as it is (lag 0). Its address as a pointer of
 * any type. */
static void *visit_array(struct visit *visit, void *array, size_t count, size_t element_size, size_t lag)
{
    if (!visit->out && visit->status == TETLOD_OK) {
        if (!words_fit(count, lag ? (unsigned)element_size : 1, visit->from.left))
            visit->status = TETLOD_ERR_IO;
        else if (!(array = array_new(count, element_size)))
            visit->status = TETLOD_ERR_NOMEM;
    }
    if (lag)
        visit_words(visit, array, count, element_size, lag);
    else
        visit_bytes(visit, array, count * element_size);
    return array;
}

#define VISIT(visit, array, count, lag)                                                                                \
    ((array) = visit_array((visit), (array), (count), sizeof *(array), (lag)))

/* What a log has come to. */
static void visit_marks(struct visit *visit, struct contraction_log *log, const struct counts *counts, int stage)
{
    size_t marks = counts->marks[stage], components = counts->components[stage];
    if (!visit->out) {
        log->vertex_count = counts->log_vertices[stage];
        log->count = counts->records[stage];
        log->mark_count = counts->marks[stage];
        memcpy(log->refused, counts->refused[stage], sizeof log->refused);
    }
    VISIT(visit, log->marks, marks, 0);
    VISIT(visit, log->certified, marks * components, components);
    VISIT(visit, log->predicted, marks * components, components);
    VISIT(visit, log->components, components, 0);
    if (visit->status != TETLOD_OK)
        return;
    for (size_t c = 0; c < components && !visit->out; c++)
        log->components[c].bounds = NULL;
    log->component_count = counts->components[stage];
}

static void visit_records(struct visit *visit, struct contraction_log *log, const struct counts *counts, int stage,
                          const struct piece *piece)
{
    size_t records = counts->records[stage];
    if (!visit->out && counts->marks[stage]) {
        log->fields = array_zero(piece->mesh.field_count, sizeof *log->fields);
        log->field_count = log->fields ? piece->mesh.field_count : 0;
        visit->status = log->fields ? visit->status : TETLOD_ERR_NOMEM;
    }
    VISIT(visit, log->children, 4 * records, 4);
    VISIT(visit, log->positions, 3 * records, 3);
    for (uint32_t f = 0; f < log->field_count; f++) {
        log->fields[f].components = piece->mesh.fields[f].components;
        VISIT(visit, log->fields[f].values, log->fields[f].components * records, log->fields[f].components);
    }
    for (size_t c = 0; c < log->component_count && counts->has_bounds[stage]; c++)
        VISIT(visit, log->components[c].bounds, records, 1);
}

/* What is left of the cell; the piece has its arrays. */
static void visit_piece(struct visit *visit, struct piece *piece)
{
    size_t n = piece->mesh.vertex_count, m = piece->mesh.tet_count, k = piece->whole->component_count;
    visit_words(visit, piece->mesh.positions, 3 * n, sizeof(double), 3);
    visit_words(visit, piece->mesh.corners, 4 * m, sizeof(uint32_t), 4);
    for (uint32_t f = 0; f < piece->mesh.field_count; f++)
        visit_words(visit, piece->mesh.fields[f].values, n * piece->mesh.fields[f].components, sizeof(double),
                    piece->mesh.fields[f].components);
    visit_bytes(visit, piece->frozen, n);
    visit_bytes(visit, piece->flags, n);
    visit_bytes(visit, piece->boundary_faces, m);
    visit_words(visit, piece->bounds, 2 * n * k, sizeof(double), 1); // U and L are the same at first
    visit_words(visit, piece->predicted, n * k, sizeof(double), k);
    visit_words(visit, piece->moved, n, sizeof(double), 1);
    visit_words(visit, piece->most, n, sizeof(double), 1);
}

/* What comes first. */
static void visit_head(struct visit *visit, struct cell *cell, const struct counts *counts)
{
    for (int stage = 0; stage < CELL_STAGES; stage++)
        visit_marks(visit, &cell->logs[stage], counts, stage);
}

/* Are arrays as long as the logs say? */
static bool counts_fit(const struct counts *counts)
{
    return counts->vertices == counts->log_vertices[counts->has_nodes ? CELL_CATCH_UP : CELL_GO_ON] &&
           (!counts->has_nodes || counts->nodes == counts->log_vertices[CELL_GO_ON]);
}

static void visit_cell(struct visit *visit, struct cell *cell, const struct counts *counts)
{
    if (!visit->out && !counts_fit(counts))
        visit->status = TETLOD_ERR_IO;
    visit_head(visit, cell, counts);
    visit_piece(visit, &cell->piece);
    VISIT(visit, cell->piece.nodes, cell->piece.mesh.vertex_count, 1);
    for (int stage = 0; stage < CELL_STAGES; stage++)
        visit_records(visit, &cell->logs[stage], counts, stage, &cell->piece);
    if (counts->has_vertices)
        VISIT(visit, cell->vertices, counts->vertices, 1);
    if (counts->has_nodes)
        VISIT(visit, cell->nodes, counts->nodes, 1);
}

static void visit_start(struct visit *visit, struct cell *cell, const struct counts *counts)
{
    visit_piece(visit, &cell->piece);
    if (counts->has_vertices)
        VISIT(visit, cell->vertices, cell->piece.mesh.vertex_count, 1);
}

static struct counts count(const struct cell *cell)
{
    struct counts counts = {.tets = cell->tets,
                            .vertices = cell->logs[cell->nodes ? CELL_CATCH_UP : CELL_GO_ON].vertex_count,
                            .left_vertices = cell->piece.mesh.vertex_count,
                            .left_tets = cell->piece.mesh.tet_count,
                            .nodes = cell->nodes ? cell->logs[CELL_GO_ON].vertex_count : 0,
                            .has_vertices = cell->vertices != NULL,
                            .has_nodes = cell->nodes != NULL};
    for (int stage = 0; stage < CELL_STAGES; stage++) {
        const struct contraction_log *log = &cell->logs[stage];
        counts.log_vertices[stage] = log->vertex_count;
        counts.records[stage] = log->count;
        counts.components[stage] = log->component_count;
        counts.marks[stage] = log->mark_count;
        counts.has_bounds[stage] = log->component_count && log->components[0].bounds;
        memcpy(counts.refused[stage], log->refused, sizeof log->refused);
    }
    return counts;
}

enum tetlod_status cell_pack(const struct cell *cell, struct buffer *out, struct tetlod_error *error)
{
    struct visit visit = {.out = out};
    struct counts counts = count(cell);
    struct cell copy = *cell; // its pointers: packing changes nothing behind them
    visit_bytes(&visit, &counts, sizeof counts);
    visit_cell(&visit, &copy, &counts);
    return visit.status == TETLOD_OK ? TETLOD_OK : tetlodi_fail_nomem(error, "a cell", out->size);
}

enum tetlod_status cell_pack_start(const struct cell *cell, struct buffer *out, struct tetlod_error *error)
{
    struct visit visit = {.out = out};
    struct counts counts = count(cell);
    struct cell copy = *cell;
    visit_bytes(&visit, &counts, sizeof counts);
    visit_start(&visit, &copy, &counts);
    return visit.status == TETLOD_OK ? TETLOD_OK : tetlodi_fail_nomem(error, "a cell", out->size);
}

/* The other way, by `rest` behind the counts. */
static enum tetlod_status unpack(struct cell *out, const struct piece *like, struct visit *visit,
                                 void (*rest)(struct visit *visit, struct cell *cell, const struct counts *counts),
                                 struct tetlod_error *error)
{
    const size_t size = visit->from.left;
    struct counts counts = {0};
    *out = (struct cell){0};
    visit_bytes(visit, &counts, sizeof counts);
    if (visit->status == TETLOD_OK && like && counts.left_tets <= size / 4 && counts.left_vertices <= size)
        TETLOD_TRY(piece_new(&out->piece, like, counts.left_vertices, counts.left_tets, error));
    else if (like)
        visit->status = TETLOD_ERR_IO;
    if (visit->status == TETLOD_OK) {
        out->tets = counts.tets;
        rest(visit, out, &counts);
    }
    if (visit->status == TETLOD_ERR_NOMEM)
        return tetlodi_fail_nomem(error, "a cell", size);
    return visit->status == TETLOD_OK && (!like || !visit->from.left)
               ? TETLOD_OK
               : tetlodi_fail(error, TETLOD_ERR_IO, "a cell of the phase is not as it was written");
}

enum tetlod_status cell_unpack(struct cell *out, const struct piece *like, const unsigned char *bytes, size_t size,
                               struct tetlod_error *error)
{
    return unpack(out, like, &(struct visit){.from = {bytes, size}}, visit_cell, error);
}

enum tetlod_status cell_unpack_head(struct cell *out, const unsigned char *bytes, size_t size,
                                    struct tetlod_error *error)
{
    return unpack(out, NULL, &(struct visit){.from = {bytes, size}}, visit_head, error);
}

enum tetlod_status cell_unpack_start(struct cell *out, const struct piece *like, const unsigned char *bytes,
                                     size_t size, struct tetlod_error *error)
{
    return unpack(out, like, &(struct visit){.from = {bytes, size}}, visit_start, error);
}

/* ---- numbers */

static bool all_below(const uint32_t *numbers, size_t count, uint64_t end)
{
    bool good = true;
    for (size_t i = 0; i < count; i++)
        good &= numbers[i] < end;
    return good;
}

static uint64_t node_count(const struct contraction_log *log)
{
    return log->vertex_count + (uint64_t)log->count;
}

static bool log_fits(const struct contraction_log *log)
{
    bool good = log->count <= log->vertex_count;
    for (uint32_t m = 0; m < log->mark_count; m++)
        good &= log->marks[m].contractions >= (m ? log->marks[m - 1].contractions : 0) &&
                log->marks[m].contractions <= log->count;
    for (size_t i = 0; i < 4 * (size_t)log->count && good; i++)
        good = log->children[i] == TETLOD_NONE || log->children[i] < log->vertex_count + i / 4;
    return good;
}

static bool piece_fits(const struct cell *cell)
{
    const struct tetmesh *mesh = &cell->piece.mesh;
    const struct contraction_log *log = &cell->logs[CELL_GO_ON];
    bool good = all_below(cell->piece.nodes, mesh->vertex_count, node_count(log)) &&
                all_below(mesh->corners, 4 * (size_t)mesh->tet_count, mesh->vertex_count);
    for (uint32_t v = 0; v < mesh->vertex_count && good; v++)
        if (cell->piece.frozen[v]) // it is in no contraction
            good = cell->piece.nodes[v] < log->vertex_count &&
                   (!cell->nodes || cell->nodes[cell->piece.nodes[v]] < cell->logs[CELL_CATCH_UP].vertex_count);
    return good;
}

bool cell_fits(const struct cell *cell, uint32_t vertices)
{
    const struct contraction_log *first = &cell->logs[cell->nodes ? CELL_CATCH_UP : CELL_GO_ON];
    return log_fits(&cell->logs[CELL_CATCH_UP]) && log_fits(&cell->logs[CELL_GO_ON]) &&
           (cell->vertices ? all_below(cell->vertices, first->vertex_count, vertices)
                           : first->vertex_count == vertices) &&
           (!cell->nodes || all_below(cell->nodes, cell->logs[CELL_GO_ON].vertex_count,
                                      node_count(&cell->logs[CELL_CATCH_UP]))) &&
           cell->piece.mesh.vertex_count <= vertices && piece_fits(cell);
}
