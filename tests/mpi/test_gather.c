/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * Pieces of all ranks as one mesh: points with gaps between their numbers, tetrahedra spread over the ranks at random,
 * ghosts, a rank that has nothing, a crack. Rank 0 gets the mesh in the order of the numbers, whoever has what; what
 * does not fit all ranks refuse. A stream is built with rank 0's options. Run with two ranks or more: prints "good".
 * With a number N: how long it takes for N x N x N cubes, and what rank 0 has in memory at most.
 */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>

#include "src/mpi/gather.h"
#include "src/util/hash.h"

static int rank, ranks, bad;

static void expect(bool good, const char *what)
{
    if (!good)
        fprintf(stderr, "rank %d: %s\n", rank, what);
    bad |= !good;
}

/* A box of cubes, six tetrahedra each. Of a crack the middle layer of points is there twice, at the same places. */
struct box {
    uint32_t cubes, layer, points, tets;
    bool crack;
};

/* What a rank has of it. */
struct piece {
    struct tetlod_build_mesh mesh;
    struct tetlod_build_piece piece;
    struct tetlod_build_array heat, load;
    double *positions, *heats;
    float *loads;
    uint64_t *ids;
    uint32_t (*corners)[4];
    uint8_t *ghosts;
};

static struct box new_box(uint32_t cubes, bool crack)
{
    uint32_t side = cubes + 1, layer = side * side;
    return (struct box){cubes, layer, layer * (side + crack), 6 * cubes * cubes * cubes, crack};
}

static uint64_t id_of(uint32_t point)
{
    return 7 + 3 * (uint64_t)point;
}

static void place_of(const struct box *box, uint32_t point, double out[3])
{
    uint32_t side = box->cubes + 1, z = point / box->layer;
    out[0] = point % side;
    out[1] = point / side % side;
    out[2] = z - (box->crack && z > box->cubes / 2);
}

/* Along the edges of a cube from corner to opposite corner. */
static void corners_of(const struct box *box, uint32_t tet, uint32_t out[4])
{
    static const int ways[6][3] = {{0, 1, 2}, {1, 2, 0}, {2, 0, 1}, {0, 2, 1}, {1, 0, 2}, {2, 1, 0}};
    const uint32_t n = box->cubes, steps[3] = {1, n + 1, box->layer}, cube = tet / 6;
    uint32_t z = cube / (n * n), point = cube % n + cube / n % n * (n + 1) + z * box->layer;
    if (box->crack && z >= n / 2)
        point += box->layer;
    for (int k = 0; k < 4; point += k < 3 ? steps[ways[tet % 6][k]] : 0, k++)
        out[tet % 6 < 3 || k < 2 ? k : 5 - k] = point;
}

/* The last rank has nothing. */
static int owner_of(uint32_t tet)
{
    return (int)(tet / 6 * 2654435761u >> 7) % (ranks - 1);
}

/* Rank r has its own tetrahedra, the last ones first, and every seventh of another rank's as a ghost; so that they all
 * have all points, but for those that belong to no tetrahedron of theirs. */
static void make_piece(struct piece *p, const struct box *box)
{
    uint32_t *local = malloc(box->points * sizeof *local), *corners = NULL;
    *p = (struct piece){.positions = malloc(3 * box->points * sizeof(double)),
                        .heats = malloc(box->points * sizeof(double)), .loads = malloc(box->tets * sizeof(float)),
                        .ids = malloc(box->points * sizeof(uint64_t)), .ghosts = malloc(box->tets),
                        .corners = malloc(box->tets * sizeof *p->corners)};
    memset(local, 255, box->points * sizeof *local);
    for (uint32_t t = box->tets; t-- > 0;) {
        bool own = owner_of(t) == rank, ghost = !own && rank < ranks - 1 && t % 7 == 0;
        if (!own && !ghost)
            continue;
        corners = p->corners[p->mesh.tets];
        corners_of(box, t, corners);
        p->ghosts[p->mesh.tets] = ghost;
        p->loads[p->mesh.tets++] = (float)t;
        for (int c = 0; c < 4; c++) {
            uint32_t *number = &local[corners[c]];
            if (*number == UINT32_MAX) {
                *number = p->mesh.vertices++;
                p->ids[*number] = id_of(corners[c]);
                place_of(box, corners[c], p->positions + 3 * (size_t)*number);
                p->heats[*number] = corners[c] / 8.0;
            }
            corners[c] = *number;
        }
    }
    free(local);
    p->heat = (struct tetlod_build_array){"heat", 1, TETLOD_CELL_FLOAT64, p->heats};
    p->load = (struct tetlod_build_array){"load", 1, TETLOD_CELL_FLOAT32, p->loads};
    p->mesh.struct_size = sizeof p->mesh;
    p->mesh.position_type = TETLOD_FLOAT64;
    p->mesh.positions = p->positions;
    p->mesh.corners = p->corners[0];
    p->mesh.fields = &p->heat;
    p->mesh.cell_fields = &p->load;
    p->mesh.field_count = p->mesh.cell_field_count = 1;
    p->piece = (struct tetlod_build_piece){sizeof p->piece, &p->mesh, p->ids, p->ghosts};
}

static void free_piece(struct piece *p)
{
    free(p->positions);
    free(p->heats);
    free(p->loads);
    free(p->ids);
    free(p->ghosts);
    free(p->corners);
}

static uint32_t ascending(const uint32_t corners[4], uint32_t out[4])
{
    memcpy(out, corners, 4 * sizeof *out);
    for (int i = 1; i < 4; i++)
        for (int k = i; k && out[k - 1] > out[k]; k--) {
            uint32_t swap = out[k];
            out[k] = out[k - 1];
            out[k - 1] = swap;
        }
    return out[0];
}

static int compare(const uint32_t a[4], const uint32_t b[4])
{
    uint32_t x[4], y[4];
    ascending(a, x);
    ascending(b, y);
    for (int c = 0; c < 4; c++)
        if (x[c] != y[c])
            return x[c] < y[c] ? -1 : 1;
    return 0;
}

/* All points by their numbers; each tetrahedron once, turned as it was and with its value, in the order of points. */
static void check_mesh(const struct box *box, const struct tetlod_build_mesh *mesh)
{
    const double *positions = mesh->positions, *heats = mesh->fields[0].values;
    const float *loads = mesh->cell_fields[0].values;
    expect(mesh->vertices == box->points && mesh->tets == box->tets, "there are other points or tetrahedra");
    for (uint32_t v = 0; v < mesh->vertices && !bad; v++) {
        double place[3];
        place_of(box, v, place);
        expect(memcmp(place, positions + 3 * (size_t)v, sizeof place) == 0, "a point is elsewhere");
        expect(heats[v] == v / 8.0, "a point has another value");
    }
    for (uint32_t t = 0; t < mesh->tets && !bad; t++) {
        const uint32_t *corners = mesh->corners + 4 * (size_t)t;
        uint32_t wanted[4];
        corners_of(box, (uint32_t)loads[t], wanted);
        expect(memcmp(wanted, corners, sizeof wanted) == 0, "a tetrahedron has other points, or another value");
        expect(!t || compare(corners - 4, corners) < 0, "the order of the tetrahedra tells who had them");
    }
}

static void gather_box(uint32_t cubes, bool crack)
{
    const struct box box = new_box(cubes, crack);
    struct tetlod_build_mesh mesh;
    struct tetlod_error error = {0};
    struct piece p;
    make_piece(&p, &box);
    double begun = MPI_Wtime();
    enum tetlod_status status = gather_pieces(&mesh, MPI_COMM_WORLD, &p.piece, &error);
    double seconds = MPI_Wtime() - begun;
    expect(status == TETLOD_OK, error.message);
    if (status == TETLOD_OK && rank == 0)
        check_mesh(&box, &mesh);
    expect(!rank || (!mesh.positions && !mesh.corners && !mesh.fields), "another rank than 0 has the mesh");
    struct rusage usage;
    getrusage(RUSAGE_SELF, &usage);
    if (cubes > 32)
        printf("rank %d: %.2f s, %.2f s of processor time, %ld MB at most\n", rank, seconds,
               (double)usage.ru_utime.tv_sec + (double)usage.ru_utime.tv_usec / 1e6, usage.ru_maxrss >> 10);
    gathered_fini(&mesh);
    free_piece(&p);
}

/* The stream of a box, on rank 0; the others' options may say something else. */
struct stream {
    size_t size;
    uint64_t hash;
};

static enum tetlod_status take_bytes(void *opaque, const void *bytes, size_t size)
{
    struct stream *stream = opaque;
    stream->hash = hash_bytes(stream->hash, bytes, size);
    stream->size += size;
    return TETLOD_OK;
}

static struct stream build_box(const char *others_metadata, uint32_t others_least)
{
    const struct box box = new_box(6, false);
    struct tetlod_build_options options;
    struct tetlod_error error = {0};
    struct stream stream = {0};
    struct piece p;
    make_piece(&p, &box);
    tetlod_build_defaults(&options);
    options.threads = 1;
    options.metadata = rank ? others_metadata : NULL;
    options.min_tets = rank ? others_least : options.min_tets;
    expect(tetlod_build_comm(MPI_COMM_WORLD, &p.piece, &options, take_bytes, &stream, &error) == TETLOD_OK,
           error.message);
    expect(rank ? stream.size == 0 : stream.size > 1000, "another rank than 0 writes the stream");
    free_piece(&p);
    return stream;
}

static void build_with_options_of_rank_0(void)
{
    struct stream same = build_box(NULL, 1), others = build_box("{\"by\": \"another\"}", 1000);
    expect(same.size == others.size && same.hash == others.hash, "another rank's options count");
}

/* What one rank's piece has wrong all ranks refuse, with a word. */
static void refuse(void (*change)(struct piece *p), const char *word)
{
    const struct box box = new_box(4, false);
    struct tetlod_build_mesh mesh;
    struct tetlod_error error = {0};
    struct piece p;
    make_piece(&p, &box);
    change(&p);
    expect(gather_pieces(&mesh, MPI_COMM_WORLD, &p.piece, &error) != TETLOD_OK, "a wrong piece is taken");
    expect(strstr(error.message, word), error.message);
    gathered_fini(&mesh);
    free_piece(&p);
}

/* A tetrahedron that is another rank's, or, with one rank but the empty one, the rank's own. */
static void copy_tet(struct piece *p)
{
    uint32_t last = p->mesh.tets - 1;
    for (uint32_t t = 0; t < p->mesh.tets && rank == 0; t++)
        if (p->ghosts[t]) {
            p->ghosts[t] = 0;
            return;
        }
    if (rank == 0)
        memcpy(p->corners[last], p->corners[last - 1], sizeof *p->corners);
}

static void move_point(struct piece *p)
{
    if (rank == 0 && ranks > 2)
        p->positions[1] += 0.5;
    else if (rank == 0) // there is no other rank that has it
        p->ids[0] = p->ids[1];
}

static void lose_point(struct piece *p)
{
    if (rank == 0)
        p->corners[3][2] = p->mesh.vertices;
}

static void lose_field(struct piece *p)
{
    p->mesh.cell_field_count = rank < ranks - 1;
}

static void lose_list(struct piece *p)
{
    p->mesh.fields = rank ? p->mesh.fields : NULL;
}

static void lose_mesh(struct piece *p)
{
    p->piece.mesh = rank ? p->piece.mesh : NULL;
}

static void change_type(struct piece *p)
{
    p->load.type = rank ? p->load.type : TETLOD_CELL_INT32;
}

int main(int argc, char **argv)
{
    int any;
    MPI_Init_thread(&argc, &argv, MPI_THREAD_SERIALIZED, &any);
    MPI_Comm_rank(MPI_COMM_WORLD, &rank);
    MPI_Comm_size(MPI_COMM_WORLD, &ranks);
    if (argc > 1) {
        gather_box((uint32_t)atoi(argv[1]), false);
    } else {
        gather_box(6, false);
        gather_box(6, true);
        gather_box(1, false);
        build_with_options_of_rank_0();
        refuse(copy_tet, "is there twice");
        refuse(move_point, "at different places");
        refuse(lose_point, "rank 0: tetrahedron 3");
        refuse(lose_field, "has no more fields, where rank 0 has a cell field 'load', 1 x float32");
        refuse(change_type, "has a cell field 'load', 1 x float32, where rank 0 has a cell field 'load', 1 x i");
        refuse(lose_list, "rank 0: a piece needs a mesh, and fields");
        refuse(lose_mesh, "rank 0: a piece needs a mesh, and fields");
    }
    MPI_Allreduce(&bad, &any, 1, MPI_INT, MPI_MAX, MPI_COMM_WORLD);
    if (rank == 0)
        puts(any ? "bad" : "good");
    MPI_Finalize();
    return any;
}
