/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * In: a piece on each rank. Each rank is the owner of a range of the points' numbers: points go to their owner, where
 * those that several ranks have become one, and their vertices come back. A tetrahedron goes to the owner of its first
 * vertex, unless it is a ghost. There points are in the order of their numbers, tetrahedra in that of their points; so
 * where the owners' ranges begin, and how many there are, does not show in what all of them have, one behind the other.
 * Out: this, on rank 0, which gets nothing else.
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

/* Numbers of points of a rank at most that the owners' ranges are found by. */
enum { MAX_SAMPLES = 64 };

/* An array of a piece: rows of points or of tetrahedra, and those that this rank owns. */
struct rows {
    const void *own;
    size_t size; /* bytes of a row */
    bool of_tets;
    unsigned char *owned; /* to be freed */
};

enum { POSITIONS, CORNERS, FIELDS };

/* How rows go from the pieces to the owners. */
struct route {
    uint32_t *order;   /* [row that goes] of the piece */
    uint64_t *sent;    /* [ranks + 1] where those for each rank begin */
    uint64_t *arrived; /* [ranks + 1] the same of those from each rank */
    uint32_t *kept;    /* [row that this rank owns] of those that arrived */
    uint64_t *begins;  /* [ranks + 1] of all rows those that each rank owns */
};

struct gathering {
    MPI_Comm comm;
    int rank, ranks;
    const struct tetlod_build_piece *piece;
    const struct tetlod_build_mesh *mesh; /* the piece's */
    struct rows *rows; /* [FIELDS + fields + cell fields] */
    uint32_t row_count;
    struct route points, tets;
    uint64_t *ids;      /* [owned point] */
    uint32_t *vertices; /* [point of the piece] */
    uint32_t *corners;  /* [tet of the piece][4] by vertices */
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
    return tetlodi_fail_nomem(g->error, "a share of the mesh",
                              24 * (uint64_t)g->mesh->vertices + 16 * (uint64_t)g->mesh->tets);
}

/* All ranks have room, or none goes on. */
static enum tetlod_status agree_room(const struct gathering *g, bool room)
{
    return comm_agree(g->comm, room ? TETLOD_OK : no_memory(g), g->error);
}

/* ---- what there is */

static size_t type_size(enum tetlod_cell_type type)
{
    static const size_t sizes[] = {[TETLOD_CELL_FLOAT32] = 4, [TETLOD_CELL_FLOAT64] = 8, [TETLOD_CELL_INT8] = 1,
                                   [TETLOD_CELL_INT16] = 2,   [TETLOD_CELL_INT32] = 4,   [TETLOD_CELL_INT64] = 8};
    return (unsigned)type < sizeof sizes / sizeof *sizes ? sizes[type] : 0;
}

static const char *type_name(enum tetlod_cell_type type)
{
    static const char *const names[] = {[TETLOD_CELL_FLOAT32] = "float32", [TETLOD_CELL_FLOAT64] = "float64",
                                        [TETLOD_CELL_INT8] = "int8",       [TETLOD_CELL_INT16] = "int16",
                                        [TETLOD_CELL_INT32] = "int32",     [TETLOD_CELL_INT64] = "int64"};
    return type_size(type) ? names[type] : "no type";
}

/* What must be the same on all ranks: a line for the positions, and for each field. */
static bool describe(const struct tetlod_build_mesh *mesh, struct buffer *out)
{
    bool good = buffer_printf(out, "positions of type %d\n", (int)mesh->position_type) == TETLOD_OK;
    for (uint32_t f = 0; f < mesh->field_count + mesh->cell_field_count && good; f++) {
        bool of_tets = f >= mesh->field_count;
        const struct tetlod_build_array *array =
            of_tets ? &mesh->cell_fields[f - mesh->field_count] : &mesh->fields[f];
        good = buffer_printf(out, "%s '%.100s', %u x %s\n", of_tets ? "a cell field" : "a field at points", array->name,
                             array->components, type_name(array->type)) == TETLOD_OK;
    }
    return good && buffer_append(out, "no more fields", sizeof "no more fields") == TETLOD_OK;
}

/* Says the first line that differs, or nothing. */
static enum tetlod_status compare_lines(const char *own, const char *first, struct tetlod_error *error)
{
    size_t size = strcspn(own, "\n"), others = strcspn(first, "\n");
    while (size == others && memcmp(own, first, size) == 0) {
        if (!own[size])
            return TETLOD_OK;
        own += size + 1;
        first += size + 1;
        size = strcspn(own, "\n");
        others = strcspn(first, "\n");
    }
    return tetlodi_fail(error, TETLOD_ERR_ARGUMENT, "has %.*s, where rank 0 has %.*s", (int)size, own, (int)others,
                        first);
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
        status = comm_agree(g->comm, compare_lines((const char *)own.bytes, first, g->error), g->error);
    }
    free(first);
    buffer_fini(&own);
    return status;
}

static enum tetlod_status check_piece(const struct gathering *g)
{
    const struct tetlod_build_mesh *mesh = g->mesh;
    if (!g->piece || !g->piece->mesh || (mesh->field_count && !mesh->fields) ||
        (mesh->cell_field_count && !mesh->cell_fields))
        return tetlodi_fail(g->error, TETLOD_ERR_ARGUMENT, "a piece needs a mesh, and fields as many as it says");
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

static enum tetlod_status check_counts(const struct gathering *g)
{
    uint64_t counts[2] = {g->mesh->vertices, g->mesh->tets};
    MPI_Allreduce(MPI_IN_PLACE, counts, 2, MPI_UINT64_T, MPI_SUM, g->comm);
    return counts[0] < TETLOD_NONE && counts[1] < TETLOD_NONE
               ? TETLOD_OK
               : tetlodi_fail(g->error, TETLOD_ERR_LIMIT, "%llu points of all ranks are too many",
                              (unsigned long long)counts[0]);
}

/* ---- from the pieces to the owners */

static void pass_pieces(const struct gathering *g, const unsigned char *out, uint64_t out_size, int to,
                        unsigned char *in, uint64_t in_size, int from)
{
    for (uint64_t at = 0; at < out_size || at < in_size; at += PIECE) {
        MPI_Request requests[2] = {MPI_REQUEST_NULL, MPI_REQUEST_NULL};
        if (at < in_size)
            MPI_Irecv(in + at, (int)(in_size - at < PIECE ? in_size - at : PIECE), MPI_BYTE, from, 0, g->comm,
                      &requests[0]);
        if (at < out_size)
            MPI_Isend(out + at, (int)(out_size - at < PIECE ? out_size - at : PIECE), MPI_BYTE, to, 0, g->comm,
                      &requests[1]);
        MPI_Waitall(2, requests, MPI_STATUSES_IGNORE);
    }
}

/* Rows of all ranks to all ranks, one after the other; where those of each rank begin is known on both sides. */
static void exchange(const struct gathering *g, const void *out, const uint64_t *out_begins, void *in,
                     const uint64_t *in_begins, size_t size)
{
    for (int step = 0; step < g->ranks; step++) {
        int to = (g->rank + step) % g->ranks, from = (g->rank + g->ranks - step) % g->ranks;
        const unsigned char *give = (const unsigned char *)out + out_begins[to] * size;
        unsigned char *take = (unsigned char *)in + in_begins[from] * size;
        uint64_t given = (out_begins[to + 1] - out_begins[to]) * size;
        if (step)
            pass_pieces(g, give, given, to, take, (in_begins[from + 1] - in_begins[from]) * size, from);
        else if (given)
            memcpy(take, give, given);
    }
}

/* How many rows come from each rank. */
static enum tetlod_status open_route(const struct gathering *g, struct route *route)
{
    size_t ranks = (size_t)g->ranks;
    uint64_t *counts = array_zero(2 * ranks, sizeof *counts);
    route->arrived = array_zero(ranks + 1, sizeof *route->arrived);
    TETLOD_TRY(agree_room(g, counts && route->arrived));
    for (size_t r = 0; r < ranks; r++)
        counts[r] = route->sent[r + 1] - route->sent[r];
    MPI_Alltoall(counts, 1, MPI_UINT64_T, counts + ranks, 1, MPI_UINT64_T, g->comm);
    for (size_t r = 0; r < ranks; r++)
        route->arrived[r + 1] = route->arrived[r] + counts[ranks + r];
    free(counts);
    return TETLOD_OK;
}

/* Rows of the piece, at their owners: *out is to be freed. */
static enum tetlod_status send_rows(const struct gathering *g, const struct route *route, const void *own, size_t size,
                                    void **out)
{
    uint64_t count = route->sent[g->ranks];
    unsigned char *packed = array_new(count, size);
    *out = array_new(route->arrived[g->ranks], size);
    enum tetlod_status status = agree_room(g, packed && *out);
    for (uint64_t i = 0; i < count && status == TETLOD_OK; i++)
        memcpy(packed + i * size, (const unsigned char *)own + route->order[i] * size, size);
    if (status == TETLOD_OK)
        exchange(g, packed, route->sent, *out, route->arrived, size);
    free(packed);
    return status;
}

/* Of rows that have arrived those that are kept stay. */
static enum tetlod_status keep_rows(const struct gathering *g, const struct route *route, const void *arrived,
                                    struct rows *rows)
{
    uint64_t count = route->begins[g->rank + 1] - route->begins[g->rank];
    rows->owned = array_new(count, rows->size);
    for (uint64_t i = 0; i < count && rows->owned; i++)
        memcpy(rows->owned + i * rows->size, (const unsigned char *)arrived + route->kept[i] * rows->size, rows->size);
    return agree_room(g, rows->owned);
}

/* What each rank owns follows what the one before does. */
static enum tetlod_status count_owned(const struct gathering *g, struct route *route, uint64_t count)
{
    route->begins = array_zero((size_t)g->ranks + 1, sizeof *route->begins);
    TETLOD_TRY(agree_room(g, route->begins));
    MPI_Allgather(&count, 1, MPI_UINT64_T, route->begins + 1, 1, MPI_UINT64_T, g->comm);
    for (int r = 0; r < g->ranks; r++)
        route->begins[r + 1] += route->begins[r];
    return TETLOD_OK;
}

static void close_route(struct route *route)
{
    free(route->order);
    free(route->sent);
    free(route->arrived);
    free(route->kept);
    free(route->begins);
}

/* ---- points */

struct numbered {
    uint64_t id;
    uint32_t row;
};

static int by_id(const void *a, const void *b)
{
    const struct numbered *x = a, *y = b;
    return x->id != y->id ? (x->id > y->id) - (x->id < y->id) : (x->row > y->row) - (x->row < y->row);
}

static int by_number(const void *a, const void *b)
{
    const uint64_t *x = a, *y = b;
    return (*x > *y) - (*x < *y);
}

/* Where the ranges of owners begin: samples of all pieces, in order, by equal shares. */
static enum tetlod_status find_ranges(const struct gathering *g, const struct numbered *points, uint64_t *begins)
{
    uint64_t count = g->mesh->vertices, most = count, own[MAX_SAMPLES + 1] = {0};
    size_t each = MAX_SAMPLES + 1, total = 0;
    uint64_t *all = array_new((size_t)g->ranks * each, sizeof *all);
    TETLOD_TRY(agree_room(g, all));
    MPI_Allreduce(MPI_IN_PLACE, &most, 1, MPI_UINT64_T, MPI_MAX, g->comm);
    own[MAX_SAMPLES] = most ? (MAX_SAMPLES * count + most - 1) / most : 0;
    for (uint64_t i = 0; i < own[MAX_SAMPLES]; i++)
        own[i] = points[i * count / own[MAX_SAMPLES]].id;
    MPI_Allgather(own, (int)each, MPI_UINT64_T, all, (int)each, MPI_UINT64_T, g->comm);
    for (int r = 0; r < g->ranks; r++) {
        size_t some = (size_t)all[(size_t)r * each + MAX_SAMPLES];
        memmove(all + total, all + (size_t)r * each, some * sizeof *all);
        total += some;
    }
    qsort(all, total, sizeof *all, by_number);
    for (int r = 0; r < g->ranks; r++)
        begins[r] = total ? all[(size_t)r * total / (size_t)g->ranks] : 0;
    begins[0] = 0;
    free(all);
    return TETLOD_OK;
}

/* The piece's points by their numbers, and which go to which owner. */
static enum tetlod_status route_points(struct gathering *g)
{
    uint32_t count = g->mesh->vertices, i = 0;
    struct route *route = &g->points;
    struct numbered *order = array_new(count, sizeof *order);
    uint64_t *begins = array_new((size_t)g->ranks, sizeof *begins);
    route->order = array_new(count, sizeof *route->order);
    route->sent = array_zero((size_t)g->ranks + 1, sizeof *route->sent);
    enum tetlod_status status = agree_room(g, order && begins && route->order && route->sent);
    for (uint32_t p = 0; p < count && status == TETLOD_OK; p++)
        order[p] = (struct numbered){g->piece->point_ids[p], p};
    if (status == TETLOD_OK) {
        qsort(order, count, sizeof *order, by_id);
        status = find_ranges(g, order, begins);
    }
    for (int r = 0; r < g->ranks && status == TETLOD_OK; r++) {
        for (; i < count && order[i].id < begins[r]; i++)
            route->order[i] = order[i].row;
        route->sent[r] = i;
    }
    for (; i < count && status == TETLOD_OK; i++)
        route->order[i] = order[i].row;
    if (status == TETLOD_OK)
        route->sent[g->ranks] = count;
    free(order);
    free(begins);
    return status == TETLOD_OK ? open_route(g, route) : status;
}

/* Of the points that have come those of one number become one: vertices[row] of this owner. */
static enum tetlod_status join_points(struct gathering *g, const uint64_t *ids, const unsigned char *positions,
                                      uint32_t *vertices, uint32_t *out_count)
{
    const size_t size = g->rows[POSITIONS].size;
    uint32_t total = (uint32_t)g->points.arrived[g->ranks], count = 0;
    struct numbered *order = array_new(total, sizeof *order);
    enum tetlod_status status = order ? TETLOD_OK : no_memory(g);
    for (uint32_t p = 0; p < total && order; p++)
        order[p] = (struct numbered){ids[p], p};
    if (order)
        qsort(order, total, sizeof *order, by_id);
    for (uint32_t i = 0; i < total && status == TETLOD_OK; i++) {
        uint32_t p = order[i].row;
        if (!i || order[i].id != order[i - 1].id) {
            g->ids[count] = order[i].id;
            g->points.kept[count++] = p;
        } else if (memcmp(positions + p * size, positions + g->points.kept[count - 1] * size, size) != 0)
            status = tetlodi_fail(g->error, TETLOD_ERR_MESH, "two ranks have point %llu at different places",
                                  (unsigned long long)order[i].id);
        vertices[p] = count - 1;
    }
    free(order);
    *out_count = count;
    return status;
}

/* The owner's vertices become those of all, and come back to the pieces. */
static enum tetlod_status return_vertices(struct gathering *g, uint32_t *vertices)
{
    const struct route *route = &g->points;
    uint32_t count = g->mesh->vertices, *back = array_new(count, sizeof *back);
    g->vertices = array_new(count, sizeof *g->vertices);
    enum tetlod_status status = agree_room(g, back && g->vertices);
    for (uint64_t i = 0; i < route->arrived[g->ranks]; i++)
        vertices[i] += (uint32_t)route->begins[g->rank];
    if (status == TETLOD_OK)
        exchange(g, vertices, route->arrived, back, route->sent, sizeof *back);
    for (uint32_t i = 0; i < count && status == TETLOD_OK; i++)
        g->vertices[route->order[i]] = back[i];
    free(back);
    return status;
}

static enum tetlod_status own_points(struct gathering *g)
{
    struct route *route = &g->points;
    struct rows *rows = &g->rows[POSITIONS];
    void *ids = NULL, *positions = NULL;
    uint32_t count = 0, *vertices = NULL;
    enum tetlod_status status;
    TETLOD_TRY_DONE(route_points(g));
    TETLOD_TRY_DONE(send_rows(g, route, g->piece->point_ids, sizeof(uint64_t), &ids));
    TETLOD_TRY_DONE(send_rows(g, route, rows->own, rows->size, &positions));
    vertices = array_new(route->arrived[g->ranks], sizeof *vertices);
    route->kept = array_new(route->arrived[g->ranks], sizeof *route->kept);
    g->ids = array_new(route->arrived[g->ranks], sizeof *g->ids);
    TETLOD_TRY_DONE(agree_room(g, vertices && route->kept && g->ids));
    TETLOD_TRY_DONE(comm_agree(g->comm, join_points(g, ids, positions, vertices, &count), g->error));
    TETLOD_TRY_DONE(count_owned(g, route, count));
    TETLOD_TRY_DONE(keep_rows(g, route, positions, rows));
    TETLOD_TRY_DONE(return_vertices(g, vertices));
done:
    free(ids);
    free(positions);
    free(vertices);
    return status;
}

/* ---- tetrahedra */

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

/* The piece's tetrahedra by their vertices, without ghosts, and which go to which owner. */
static enum tetlod_status route_tets(struct gathering *g)
{
    const struct tetlod_build_mesh *mesh = g->mesh;
    struct route *route = &g->tets;
    uint32_t count = 0, i = 0;
    struct placed *order = array_new(mesh->tets, sizeof *order);
    g->corners = array_new(mesh->tets, 4 * sizeof *g->corners);
    route->order = array_new(mesh->tets, sizeof *route->order);
    route->sent = array_zero((size_t)g->ranks + 1, sizeof *route->sent);
    enum tetlod_status status = agree_room(g, order && g->corners && route->order && route->sent);
    for (uint32_t t = 0; t < mesh->tets && status == TETLOD_OK; t++) {
        for (size_t c = 4 * (size_t)t; c < 4 * (size_t)t + 4; c++)
            g->corners[c] = g->vertices[mesh->corners[c]];
        if (!g->piece->ghosts || !g->piece->ghosts[t])
            place(g->corners + 4 * (size_t)t, t, &order[count++]);
    }
    if (status == TETLOD_OK)
        qsort(order, count, sizeof *order, by_corners);
    for (int r = 0; r < g->ranks && status == TETLOD_OK; r++) {
        while (i < count && order[i].corners[0] < g->points.begins[r])
            i++;
        route->sent[r] = i;
    }
    for (i = 0; i < count && status == TETLOD_OK; i++)
        route->order[i] = order[i].tet;
    route->sent[g->ranks] = count;
    free(order);
    return status == TETLOD_OK ? open_route(g, route) : status;
}

/* Puts the tetrahedra that have come in order; *twice becomes one that is there twice. */
static bool join_tets(struct gathering *g, const uint32_t *corners, uint32_t twice[4], bool *is_twice)
{
    uint32_t count = (uint32_t)g->tets.arrived[g->ranks];
    struct placed *order = array_new(count, sizeof *order);
    for (uint32_t t = 0; t < count && order; t++)
        place(corners + 4 * (size_t)t, t, &order[t]);
    if (order)
        qsort(order, count, sizeof *order, by_corners);
    for (uint32_t i = 0; i < count && order && !*is_twice; i++) {
        g->tets.kept[i] = order[i].tet;
        *is_twice = i && memcmp(order[i].corners, order[i - 1].corners, sizeof order->corners) == 0;
        if (*is_twice)
            memcpy(twice, order[i].corners, sizeof order->corners);
    }
    free(order);
    return order;
}

/* Collective: the first rank that has a tetrahedron twice names its points, whose numbers their owners know. */
static enum tetlod_status check_twice(const struct gathering *g, bool is_twice, uint32_t twice[4])
{
    const uint64_t *begins = g->points.begins;
    int own = is_twice ? g->rank : g->ranks, first;
    unsigned long long ids[4] = {0};
    MPI_Allreduce(&own, &first, 1, MPI_INT, MPI_MIN, g->comm);
    if (first == g->ranks)
        return TETLOD_OK;
    MPI_Bcast(twice, 4, MPI_UINT32_T, first, g->comm);
    for (int c = 0; c < 4; c++)
        if (twice[c] >= begins[g->rank] && twice[c] < begins[g->rank + 1])
            ids[c] = g->ids[twice[c] - begins[g->rank]];
    MPI_Allreduce(MPI_IN_PLACE, ids, 4, MPI_UNSIGNED_LONG_LONG, MPI_MAX, g->comm);
    return tetlodi_fail(g->error, TETLOD_ERR_MESH,
                        "the tetrahedron of points %llu, %llu, %llu and %llu is there twice; mark copies as ghosts",
                        ids[0], ids[1], ids[2], ids[3]);
}

static enum tetlod_status own_tets(struct gathering *g)
{
    struct route *route = &g->tets;
    struct rows *rows = &g->rows[CORNERS];
    void *corners = NULL;
    uint32_t twice[4] = {0};
    bool is_twice = false;
    enum tetlod_status status;
    TETLOD_TRY_DONE(route_tets(g));
    *rows = (struct rows){g->corners, 4 * sizeof *g->corners, true, NULL};
    TETLOD_TRY_DONE(send_rows(g, route, rows->own, rows->size, &corners));
    route->kept = array_new(route->arrived[g->ranks], sizeof *route->kept);
    TETLOD_TRY_DONE(agree_room(g, route->kept));
    TETLOD_TRY_DONE(agree_room(g, join_tets(g, corners, twice, &is_twice)));
    TETLOD_TRY_DONE(check_twice(g, is_twice, twice));
    TETLOD_TRY_DONE(count_owned(g, route, route->arrived[g->ranks]));
    TETLOD_TRY_DONE(keep_rows(g, route, corners, rows));
done:
    free(corners);
    return status;
}

/* ---- from the owners to rank 0 */

/* An array that rank 0 gets, owner by owner; the others' is NULL. */
static enum tetlod_status bring(const struct gathering *g, const struct route *route, struct rows *rows, void **out)
{
    const uint64_t *begins = route->begins;
    unsigned char *all = g->rank ? NULL : array_new(begins[g->ranks], rows->size);
    enum tetlod_status status = agree_room(g, g->rank || all);
    uint64_t own = (begins[g->rank + 1] - begins[g->rank]) * rows->size;
    for (int r = 1; r < g->ranks && status == TETLOD_OK && g->rank == 0; r++)
        pass_pieces(g, NULL, 0, r, all + begins[r] * rows->size, (begins[r + 1] - begins[r]) * rows->size, r);
    if (status == TETLOD_OK && g->rank)
        pass_pieces(g, rows->owned, own, 0, NULL, 0, 0);
    else if (status == TETLOD_OK && own)
        memcpy(all, rows->owned, own);
    free(rows->owned);
    rows->owned = NULL;
    *out = all;
    return status;
}

/* The array of a field at its owners, and then on rank 0. */
static enum tetlod_status move(const struct gathering *g, struct rows *rows, void **out)
{
    const struct route *route = rows->of_tets ? &g->tets : &g->points;
    void *arrived = NULL;
    enum tetlod_status status = send_rows(g, route, rows->own, rows->size, &arrived);
    if (status == TETLOD_OK)
        status = keep_rows(g, route, arrived, rows);
    free(arrived);
    return status == TETLOD_OK ? bring(g, route, rows, out) : status;
}

static enum tetlod_status move_fields(const struct gathering *g, struct tetlod_build_mesh *out)
{
    struct tetlod_build_array *fields = array_zero(g->mesh->field_count, sizeof *fields),
                              *cells = array_zero(g->mesh->cell_field_count, sizeof *cells);
    out->fields = fields;
    out->cell_fields = cells;
    TETLOD_TRY(agree_room(g, fields && cells));
    out->field_count = g->mesh->field_count;
    out->cell_field_count = g->mesh->cell_field_count;
    for (uint32_t i = 0; i < out->field_count + out->cell_field_count; i++) {
        bool of_tets = i >= out->field_count;
        struct tetlod_build_array *array = of_tets ? &cells[i - out->field_count] : &fields[i];
        void *values = NULL;
        *array = of_tets ? g->mesh->cell_fields[i - out->field_count] : g->mesh->fields[i];
        array->values = NULL;
        enum tetlod_status status = move(g, &g->rows[FIELDS + i], &values);
        array->values = values;
        TETLOD_TRY(status);
    }
    return TETLOD_OK;
}

static void list_rows(struct gathering *g)
{
    const struct tetlod_build_mesh *mesh = g->mesh;
    size_t real = mesh->position_type == TETLOD_FLOAT32 ? 4 : 8;
    g->rows[POSITIONS] = (struct rows){mesh->positions, 3 * real, false, NULL};
    for (uint32_t f = FIELDS; f < g->row_count; f++) {
        uint32_t i = f - FIELDS;
        bool of_tets = i >= mesh->field_count;
        const struct tetlod_build_array *array =
            of_tets ? &mesh->cell_fields[i - mesh->field_count] : &mesh->fields[i];
        g->rows[f] = (struct rows){array->values, array->components * type_size(array->type), of_tets, NULL};
    }
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

/* Collective in all that it calls: what one rank fails with, all do. */
static enum tetlod_status gather_all(struct gathering *g, struct tetlod_build_mesh *out)
{
    void *positions = NULL, *corners = NULL;
    TETLOD_TRY(comm_agree(g->comm, check_piece(g), g->error));
    TETLOD_TRY(check_same(g));
    TETLOD_TRY(check_counts(g));
    g->row_count = FIELDS + g->mesh->field_count + g->mesh->cell_field_count;
    g->rows = array_zero(g->row_count, sizeof *g->rows);
    TETLOD_TRY(agree_room(g, g->rows));
    list_rows(g);
    TETLOD_TRY(own_points(g));
    TETLOD_TRY(own_tets(g));
    out->vertices = (uint32_t)g->points.begins[g->ranks];
    out->tets = (uint32_t)g->tets.begins[g->ranks];
    enum tetlod_status status = bring(g, &g->points, &g->rows[POSITIONS], &positions);
    out->positions = positions;
    TETLOD_TRY(status);
    status = bring(g, &g->tets, &g->rows[CORNERS], &corners);
    out->corners = corners;
    TETLOD_TRY(status);
    return move_fields(g, out);
}

enum tetlod_status gather_pieces(struct tetlod_build_mesh *out, MPI_Comm comm, const struct tetlod_build_piece *piece,
                                 struct tetlod_error *error)
{
    static const struct tetlod_build_mesh none;
    struct gathering g = {.comm = comm, .piece = piece, .mesh = piece && piece->mesh ? piece->mesh : &none,
                          .error = error};
    *out = (struct tetlod_build_mesh){.struct_size = sizeof *out, .position_type = g.mesh->position_type};
    MPI_Comm_rank(comm, &g.rank);
    MPI_Comm_size(comm, &g.ranks);
    enum tetlod_status status = gather_all(&g, out);
    if (g.rank)
        gathered_fini(out);
    for (uint32_t i = 0; i < g.row_count && g.rows; i++)
        free(g.rows[i].owned);
    free(g.rows);
    close_route(&g.points);
    close_route(&g.tets);
    free(g.ids);
    free(g.vertices);
    free(g.corners);
    return status;
}
