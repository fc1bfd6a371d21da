/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * In: a piece on each rank. All rows of all ranks come to rank 0, one behind the other, rank by rank. There points are
 * sorted by their numbers, and those that several ranks have become one; tetrahedra but ghosts are sorted by their
 * points, so that their order does not tell ranks either. Out: arrays in that order.
 */
#include "src/mpi/gather.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "format/fail.h"
#include "src/util/array.h"
#include "src/util/buffer.h"

/* Counts of MPI are int: larger arrays go in pieces. */
enum { PIECE = 1 << 30 };

/* An array of all ranks, and what this rank has of it. */
struct rows {
    const void *own;
    size_t size;     /* bytes of a row */
    bool of_tets;
    unsigned char *all; /* owned; on rank 0 */
};

enum { IDS, POSITIONS, CORNERS, GHOSTS, FIELDS };

struct gathering {
    MPI_Comm comm;
    int rank, ranks;
    const struct tetlod_build_piece *piece;
    const struct tetlod_build_mesh *mesh; /* the piece's */
    uint64_t *counts;  /* [ranks][points, tetrahedra] */
    uint64_t totals[2];
    struct rows *rows; /* [FIELDS + fields + cell fields] */
    uint32_t row_count;
    uint8_t *no_ghosts;  /* [tet of the piece] zeros, where the piece says nothing of ghosts */
    uint32_t *vertex_of; /* [point of all] */
    uint32_t *points;    /* [vertex] the first point of all that is it */
    uint32_t *tets;      /* [tet] in all */
    struct tetlod_error *error;
};

enum tetlod_status comm_agree(MPI_Comm comm, enum tetlod_status status, struct tetlod_error *error)
{
    struct tetlod_error shared = {0};
    int rank, ranks, first;
    MPI_Comm_rank(comm, &rank);
    MPI_Comm_size(comm, &ranks);
    int failed = status == TETLOD_OK ? ranks : rank;
    MPI_Allreduce(&failed, &first, 1, MPI_INT, MPI_MIN, comm);
    if (first == ranks)
        return TETLOD_OK;
    if (error)
        shared = *error;
    shared.status = status;
    MPI_Bcast(&shared, (int)sizeof shared, MPI_BYTE, first, comm);
    return tetlodi_fail(error, shared.status, "rank %d: %.400s", first, shared.message);
}

static enum tetlod_status no_memory(const struct gathering *g)
{
    return tetlodi_fail_nomem(g->error, "the mesh of all ranks", 24 * g->totals[0] + 16 * g->totals[1]);
}

/* ---- what there is */

static size_t type_size(enum tetlod_cell_type type)
{
    static const size_t sizes[] = {[TETLOD_CELL_FLOAT32] = 4, [TETLOD_CELL_FLOAT64] = 8, [TETLOD_CELL_INT8] = 1,
                                   [TETLOD_CELL_INT16] = 2,   [TETLOD_CELL_INT32] = 4,   [TETLOD_CELL_INT64] = 8};
    return (unsigned)type < sizeof sizes / sizeof *sizes ? sizes[type] : 0;
}

/* The fields as a text, which must be the same on all ranks. */
static bool describe(const struct tetlod_build_mesh *mesh, struct buffer *out)
{
    bool good = buffer_printf(out, "positions of type %d", (int)mesh->position_type) == TETLOD_OK;
    for (uint32_t f = 0; f < mesh->field_count + mesh->cell_field_count && good; f++) {
        bool of_tets = f >= mesh->field_count;
        const struct tetlod_build_array *array =
            of_tets ? &mesh->cell_fields[f - mesh->field_count] : &mesh->fields[f];
        good = buffer_printf(out, ", %s '%.200s' of %u components of type %d", of_tets ? "cells" : "points",
                             array->name ? array->name : "", array->components, (int)array->type) == TETLOD_OK;
    }
    return good && buffer_append(out, "", 1) == TETLOD_OK;
}

static enum tetlod_status check_same(const struct gathering *g)
{
    struct buffer own = {0};
    bool good = describe(g->mesh, &own);
    int size = (int)own.size;
    MPI_Bcast(&size, 1, MPI_INT, 0, g->comm);
    char *first = array_zero((size_t)size + 1, 1);
    enum tetlod_status status = comm_agree(g->comm, good && first ? TETLOD_OK : no_memory(g), g->error);
    if (status == TETLOD_OK) {
        if (g->rank == 0)
            memcpy(first, own.bytes, own.size);
        MPI_Bcast(first, size, MPI_CHAR, 0, g->comm);
        if (strcmp(first, (const char *)own.bytes) != 0)
            status = tetlodi_fail(g->error, TETLOD_ERR_ARGUMENT, "has %.150s, where rank 0 has %.150s",
                                  (const char *)own.bytes, first);
        status = comm_agree(g->comm, status, g->error);
    }
    free(first);
    buffer_fini(&own);
    return status;
}

static enum tetlod_status check_piece(const struct gathering *g)
{
    const struct tetlod_build_mesh *mesh = g->mesh;
    if ((mesh->vertices && (!mesh->positions || !g->piece->point_ids)) || (mesh->tets && !mesh->corners))
        return tetlodi_fail(g->error, TETLOD_ERR_ARGUMENT, "a piece needs positions, corners and point_ids");
    for (size_t i = 0; i < 4 * (size_t)mesh->tets; i++)
        if (mesh->corners[i] >= mesh->vertices)
            return tetlodi_fail(g->error, TETLOD_ERR_MESH, "tetrahedron %zu has point %u of %u", i / 4,
                                mesh->corners[i], mesh->vertices);
    for (uint32_t f = 0; f < mesh->field_count + mesh->cell_field_count; f++) {
        const struct tetlod_build_array *array =
            f < mesh->field_count ? &mesh->fields[f] : &mesh->cell_fields[f - mesh->field_count];
        uint32_t rows = f < mesh->field_count ? mesh->vertices : mesh->tets;
        if (!array->name || !type_size(array->type) || !array->components || (rows && !array->values))
            return tetlodi_fail(g->error, TETLOD_ERR_ARGUMENT, "a field needs a name, a type, components and values");
    }
    return TETLOD_OK;
}

static enum tetlod_status count_rows(struct gathering *g)
{
    uint64_t own[2] = {g->mesh->vertices, g->mesh->tets};
    g->counts = array_new(2 * (size_t)g->ranks, sizeof *g->counts);
    TETLOD_TRY(comm_agree(g->comm, g->counts ? TETLOD_OK : no_memory(g), g->error));
    MPI_Allgather(own, 2, MPI_UINT64_T, g->counts, 2, MPI_UINT64_T, g->comm);
    for (int r = 0; r < g->ranks; r++)
        for (int k = 0; k < 2; k++)
            g->totals[k] += g->counts[2 * r + k];
    return g->totals[0] < TETLOD_NONE && g->totals[1] < TETLOD_NONE
               ? TETLOD_OK
               : tetlodi_fail(g->error, TETLOD_ERR_LIMIT, "%llu points of all ranks are too many",
                              (unsigned long long)g->totals[0]);
}

/* ---- arrays of all ranks */

static void list_rows(struct gathering *g)
{
    const struct tetlod_build_mesh *mesh = g->mesh;
    size_t real = mesh->position_type == TETLOD_FLOAT32 ? 4 : 8;
    g->rows[IDS] = (struct rows){g->piece->point_ids, sizeof(uint64_t), false, NULL};
    g->rows[POSITIONS] = (struct rows){mesh->positions, 3 * real, false, NULL};
    g->rows[CORNERS] = (struct rows){mesh->corners, 4 * sizeof(uint32_t), true, NULL};
    g->rows[GHOSTS] = (struct rows){g->piece->ghosts ? g->piece->ghosts : g->no_ghosts, 1, true, NULL};
    for (uint32_t f = FIELDS; f < g->row_count; f++) {
        uint32_t i = f - FIELDS;
        bool of_tets = i >= mesh->field_count;
        const struct tetlod_build_array *array =
            of_tets ? &mesh->cell_fields[i - mesh->field_count] : &mesh->fields[i];
        g->rows[f] = (struct rows){array->values, array->components * type_size(array->type), of_tets, NULL};
    }
}

static enum tetlod_status allocate(struct gathering *g)
{
    g->row_count = FIELDS + g->mesh->field_count + g->mesh->cell_field_count;
    g->rows = array_zero(g->row_count, sizeof *g->rows);
    g->no_ghosts = array_zero(g->mesh->tets, 1);
    if (!g->rows || !g->no_ghosts)
        return no_memory(g);
    list_rows(g);
    for (uint32_t i = 0; i < g->row_count && g->rank == 0; i++)
        if (!(g->rows[i].all = array_zero(g->totals[g->rows[i].of_tets], g->rows[i].size)))
            return no_memory(g);
    return TETLOD_OK;
}

/* Sends or receives any number of bytes. */
static void pass(const struct gathering *g, unsigned char *bytes, uint64_t size, int from)
{
    for (uint64_t at = 0; at < size; at += PIECE) {
        int count = (int)(size - at < PIECE ? size - at : PIECE);
        if (g->rank == 0)
            MPI_Recv(bytes + at, count, MPI_BYTE, from, 0, g->comm, MPI_STATUS_IGNORE);
        else if (g->rank == from)
            MPI_Send(bytes + at, count, MPI_BYTE, 0, 0, g->comm);
    }
}

/* An array goes to rank 0. */
static void gather(const struct gathering *g, struct rows *rows)
{
    uint64_t at = 0;
    for (int r = 0; r < g->ranks; r++) {
        uint64_t part = g->counts[2 * r + rows->of_tets] * rows->size;
        if (r == 0 && g->rank == 0 && part)
            memcpy(rows->all, rows->own, part);
        else if (r && g->rank == 0)
            pass(g, rows->all + at, part, r);
        else if (r && g->rank == r)
            pass(g, (unsigned char *)(uintptr_t)rows->own, part, r); // is only sent
        at += part;
    }
}

/* ---- one mesh */

struct numbered {
    uint64_t id;
    uint32_t point;
};

static int by_id(const void *a, const void *b)
{
    const struct numbered *x = a, *y = b;
    return x->id != y->id ? (x->id > y->id) - (x->id < y->id) : (x->point > y->point) - (x->point < y->point);
}

/* Points of one number become one. */
static enum tetlod_status join_points(struct gathering *g, uint32_t *out_count)
{
    const uint64_t *ids = (const uint64_t *)(const void *)g->rows[IDS].all;
    const struct rows *positions = &g->rows[POSITIONS];
    uint32_t total = (uint32_t)g->totals[0], count = 0;
    struct numbered *order = array_new(total, sizeof *order);
    enum tetlod_status status = order ? TETLOD_OK : no_memory(g);
    for (uint32_t p = 0; p < total && order; p++)
        order[p] = (struct numbered){ids[p], p};
    if (order)
        qsort(order, total, sizeof *order, by_id);
    for (uint32_t i = 0; i < total && status == TETLOD_OK; i++) {
        uint32_t p = order[i].point;
        if (!i || order[i].id != order[i - 1].id)
            g->points[count++] = p;
        else if (memcmp(positions->all + p * positions->size, positions->all + g->points[count - 1] * positions->size,
                        positions->size) != 0)
            status = tetlodi_fail(g->error, TETLOD_ERR_MESH, "two ranks have point %llu at different places",
                                  (unsigned long long)order[i].id);
        g->vertex_of[p] = count - 1;
    }
    free(order);
    *out_count = count;
    return status;
}

/* A tetrahedron by its vertices. */
struct placed {
    uint32_t corners[4], tet; /* ascending; in all */
};

static int by_corners(const void *a, const void *b)
{
    const struct placed *x = a, *y = b;
    for (int c = 0; c < 4; c++)
        if (x->corners[c] != y->corners[c])
            return x->corners[c] > y->corners[c] ? 1 : -1;
    return (x->tet > y->tet) - (x->tet < y->tet);
}

static void place(const uint32_t corners[4], uint32_t tet, struct placed *out)
{
    out->tet = tet;
    for (int c = 0; c < 4; c++) {
        int at = c;
        for (; at && out->corners[at - 1] > corners[c]; at--)
            out->corners[at] = out->corners[at - 1];
        out->corners[at] = corners[c];
    }
}

/* Corners become vertices, rank by rank. */
static void number_corners(struct gathering *g)
{
    uint32_t *corners = (uint32_t *)(void *)g->rows[CORNERS].all;
    uint64_t first = 0, i = 0;
    for (int r = 0; r < g->ranks; first += g->counts[2 * r++])
        for (uint64_t end = i + 4 * g->counts[2 * r + 1]; i < end; i++)
            corners[i] = g->vertex_of[first + corners[i]];
}

static enum tetlod_status fail_twice(const struct gathering *g, const uint32_t corners[4])
{
    const uint64_t *ids = (const uint64_t *)(const void *)g->rows[IDS].all;
    unsigned long long id[4];
    for (int c = 0; c < 4; c++)
        id[c] = ids[g->points[corners[c]]];
    return tetlodi_fail(g->error, TETLOD_ERR_MESH,
                        "the tetrahedron of points %llu, %llu, %llu and %llu is there twice; mark copies as ghosts",
                        id[0], id[1], id[2], id[3]);
}

static enum tetlod_status join_tets(struct gathering *g, uint32_t *out_count)
{
    const uint32_t *corners = (const uint32_t *)(const void *)g->rows[CORNERS].all;
    uint32_t total = (uint32_t)g->totals[1], count = 0;
    struct placed *order = array_new(total, sizeof *order);
    if (!order)
        return no_memory(g);
    for (uint32_t t = 0; t < total; t++)
        if (!g->rows[GHOSTS].all[t])
            place(corners + 4 * (size_t)t, t, &order[count++]);
    qsort(order, count, sizeof *order, by_corners);
    enum tetlod_status status = TETLOD_OK;
    for (uint32_t i = 0; i < count && status == TETLOD_OK; i++) {
        g->tets[i] = order[i].tet;
        if (i && memcmp(order[i].corners, order[i - 1].corners, sizeof order->corners) == 0)
            status = fail_twice(g, order[i].corners);
    }
    free(order);
    *out_count = count;
    return status;
}

/* Rows in the order of the mesh; what is gathered goes. */
static void *arrange(struct rows *rows, const uint32_t *order, uint32_t count)
{
    unsigned char *out = array_new(count, rows->size);
    for (uint32_t i = 0; i < count && out; i++)
        memcpy(out + i * rows->size, rows->all + order[i] * rows->size, rows->size);
    free(rows->all);
    rows->all = NULL;
    return out;
}

static bool arrange_fields(struct gathering *g, struct tetlod_build_mesh *mesh)
{
    struct tetlod_build_array *fields = array_zero(mesh->field_count, sizeof *fields),
                              *cells = array_zero(mesh->cell_field_count, sizeof *cells);
    mesh->fields = fields;
    mesh->cell_fields = cells;
    bool good = fields && cells;
    for (uint32_t f = 0; f < mesh->field_count && good; f++) {
        fields[f] = g->mesh->fields[f];
        good = (fields[f].values = arrange(&g->rows[FIELDS + f], g->points, mesh->vertices)) != NULL;
    }
    for (uint32_t f = 0; f < mesh->cell_field_count && good; f++) {
        cells[f] = g->mesh->cell_fields[f];
        good = (cells[f].values = arrange(&g->rows[FIELDS + mesh->field_count + f], g->tets, mesh->tets)) != NULL;
    }
    return good;
}

static enum tetlod_status join(struct gathering *g, struct tetlod_build_mesh *mesh)
{
    g->vertex_of = array_new(g->totals[0], sizeof *g->vertex_of);
    g->points = array_new(g->totals[0], sizeof *g->points);
    g->tets = array_new(g->totals[1], sizeof *g->tets);
    if (!g->vertex_of || !g->points || !g->tets)
        return no_memory(g);
    TETLOD_TRY(join_points(g, &mesh->vertices));
    number_corners(g);
    TETLOD_TRY(join_tets(g, &mesh->tets));
    mesh->field_count = g->mesh->field_count;
    mesh->cell_field_count = g->mesh->cell_field_count;
    mesh->positions = arrange(&g->rows[POSITIONS], g->points, mesh->vertices);
    mesh->corners = arrange(&g->rows[CORNERS], g->tets, mesh->tets);
    return arrange_fields(g, mesh) && mesh->positions && mesh->corners ? TETLOD_OK : no_memory(g);
}

static void free_borrowed(const void *array)
{
    free((void *)(uintptr_t)array);
}

void gathered_fini(struct tetlod_build_mesh *mesh)
{
    for (uint32_t f = 0; f < mesh->field_count && mesh->fields; f++)
        free_borrowed(mesh->fields[f].values);
    for (uint32_t f = 0; f < mesh->cell_field_count && mesh->cell_fields; f++)
        free_borrowed(mesh->cell_fields[f].values);
    free_borrowed(mesh->fields);
    free_borrowed(mesh->cell_fields);
    free_borrowed(mesh->positions);
    free_borrowed(mesh->corners);
    *mesh = (struct tetlod_build_mesh){0};
}

static enum tetlod_status gather_all(struct gathering *g, struct tetlod_build_mesh *out)
{
    TETLOD_TRY(comm_agree(g->comm, check_piece(g), g->error));
    TETLOD_TRY(check_same(g));
    TETLOD_TRY(count_rows(g));
    TETLOD_TRY(comm_agree(g->comm, allocate(g), g->error));
    for (uint32_t i = 0; i < g->row_count; i++)
        gather(g, &g->rows[i]);
    return comm_agree(g->comm, g->rank == 0 ? join(g, out) : TETLOD_OK, g->error);
}

enum tetlod_status gather_pieces(struct tetlod_build_mesh *out, MPI_Comm comm, const struct tetlod_build_piece *piece,
                                 struct tetlod_error *error)
{
    struct gathering g = {.comm = comm, .piece = piece, .mesh = piece->mesh, .error = error};
    *out = (struct tetlod_build_mesh){.struct_size = sizeof *out, .position_type = piece->mesh->position_type};
    MPI_Comm_rank(comm, &g.rank);
    MPI_Comm_size(comm, &g.ranks);
    enum tetlod_status status = gather_all(&g, out);
    for (uint32_t i = 0; i < g.row_count && g.rows; i++)
        free(g.rows[i].all);
    free(g.rows);
    free(g.counts);
    free(g.no_ghosts);
    free(g.vertex_of);
    free(g.points);
    free(g.tets);
    return status;
}
