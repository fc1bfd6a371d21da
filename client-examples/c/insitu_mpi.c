/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * mpirun -n 4 insitu_mpi SERIES LAST: a solver whose mesh lies on the ranks of an MPI job. Each EVERY rounds it adds a
 * step and writes the series so far, which a server shows while the solver goes on; at the end all ranks build the last
 * step as a stream of its own. The solver is a stand-in: heat that spreads through a box of N x N x N cubes, six
 * tetrahedra each. A rank has some layers of cubes, and the points on both sides of them.
 *
 * mpicc insitu_mpi.c $(pkg-config --cflags --libs --static tetlod-mpi) -o insitu_mpi
 */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <tetlod_mpi.h>

enum { N = 12, M = N + 1, LAYER = M * M, POINTS = M * LAYER, TETS = 6 * N * N * N, ROUNDS = 60, EVERY = 20 };

/* What a rank has: layers `first` to `last` of cubes, and as many layers of points and one more. */
static int rank, ranks, first, last;
static double positions[POINTS][3], temperature[POINTS], before[POINTS];
static uint64_t ids[POINTS];
static uint32_t corners[TETS][4], points, tets;

static void make_piece(void)
{
    static const int steps[3] = {1, M, LAYER},
                     ways[6][3] = {{0, 1, 2}, {1, 2, 0}, {2, 0, 1}, {0, 2, 1}, {1, 0, 2}, {2, 1, 0}};
    first = N * rank / ranks;
    last = N * (rank + 1) / ranks;
    points = last > first ? (uint32_t)((last - first + 1) * LAYER) : 0;
    for (uint32_t p = 0; p < points; p++) {
        ids[p] = p + (uint64_t)first * LAYER;
        for (int k = 0; k < 3; k++)
            positions[p][k] = (int)ids[p] / steps[k] % M / (double)N;
        temperature[p] = positions[p][0] < 0.3 && positions[p][2] < 0.5 ? 100 : 20;
    }
    tets = (uint32_t)(6 * N * N * (last - first));
    for (uint32_t t = 0; t < tets; t++) { /* along the edges of a cube from corner to opposite corner */
        int cube = (int)t / 6, point = cube % N + cube / N % N * M + cube / (N * N) * LAYER;
        for (int k = 0; k < 4; point += k < 3 ? steps[ways[t % 6][k]] : 0, k++)
            corners[t][t % 6 < 3 || k < 2 ? k : 5 - k] = (uint32_t)point;
    }
}

/* A layer of points of this rank goes to a neighbour, whose own comes back below or above. */
static void swap_layer(double *own, int with, double *out)
{
    MPI_Sendrecv(own, LAYER, MPI_DOUBLE, with, 0, out, LAYER, MPI_DOUBLE, with, 0, MPI_COMM_WORLD, MPI_STATUS_IGNORE);
}

/* Each point inside goes towards the mean of its neighbours. */
static void solve(void)
{
    static double below[LAYER], above[LAYER];
    memcpy(before, temperature, sizeof before);
    if (points && first > 0)
        swap_layer(before + LAYER, rank - 1, below);
    if (points && last < N)
        swap_layer(before + (last - first - 1) * LAYER, rank + 1, above);
    for (int z = 0; z <= last - first && points; z++)
        for (int p = z * LAYER; p < (z + 1) * LAYER; p++) {
            int x = p % M, y = p / M % M, inner = p - z * LAYER;
            const double *down = z ? before + p - LAYER : below + inner,
                         *up = z < last - first ? before + p + LAYER : above + inner;
            if (x % N && y % N && (first + z) % N)
                temperature[p] += 0.15 * (before[p - 1] + before[p + 1] + before[p - M] + before[p + M] + *down + *up -
                                          6 * before[p]);
        }
}

static enum tetlod_status write_bytes(void *file, const void *bytes, size_t size)
{
    return file && fwrite(bytes, 1, size, file) == size ? TETLOD_OK : TETLOD_ERR_IO;
}

/* The stream appears under its name when it is whole. NULL: the last step alone, by all ranks. */
static enum tetlod_status write_stream(const char *name, struct tetlod_build_comm_series *series,
                                       const struct tetlod_build_piece *piece, struct tetlod_error *error)
{
    char part[4096];
    snprintf(part, sizeof part, "%s.part", name);
    FILE *file = rank ? NULL : fopen(part, "wb");
    enum tetlod_status status = series ? tetlod_build_comm_series_write(series, write_bytes, file, error)
                                       : tetlod_build_comm(MPI_COMM_WORLD, piece, NULL, write_bytes, file, error);
    int good = !file || (fclose(file) == 0 && (status != TETLOD_OK || rename(part, name) == 0));
    MPI_Bcast(&good, 1, MPI_INT, 0, MPI_COMM_WORLD); /* or the others would wait for rank 0 in the next call */
    if (!good)
        snprintf(error->message, sizeof error->message, "%.400s: cannot be written", name);
    return good ? status : TETLOD_ERR_IO;
}

static enum tetlod_status run(char **names, struct tetlod_error *error)
{
    struct tetlod_build_array field = {"temperature", 1, TETLOD_CELL_FLOAT64, temperature};
    struct tetlod_build_mesh mesh = {sizeof mesh, points, tets, TETLOD_FLOAT64, positions,
                                     corners[0],  1,      0,    &field,         NULL};
    struct tetlod_build_piece piece = {sizeof piece, &mesh, ids, NULL};
    struct tetlod_build_comm_series *series;
    enum tetlod_status status = tetlod_build_comm_series_new(&series, MPI_COMM_WORLD, NULL, error);
    for (int round = 0; round <= ROUNDS && status == TETLOD_OK; round++, solve())
        if (round % EVERY == 0) {
            status = tetlod_build_comm_series_add(series, &piece, 0.01 * round, error);
            if (status == TETLOD_OK)
                status = write_stream(names[0], series, NULL, error);
        }
    tetlod_build_comm_series_free(series);
    return status == TETLOD_OK ? write_stream(names[1], NULL, &piece, error) : status;
}

int main(int argc, char **argv)
{
    struct tetlod_error error = {0};
    int provided;
    MPI_Init_thread(&argc, &argv, MPI_THREAD_SERIALIZED, &provided);
    MPI_Comm_rank(MPI_COMM_WORLD, &rank);
    MPI_Comm_size(MPI_COMM_WORLD, &ranks);
    if (argc != 3 || ranks > N) {
        fprintf(stderr, "insitu_mpi SERIES LAST, on at most %d ranks\n", N);
        MPI_Abort(MPI_COMM_WORLD, 2);
    }
    make_piece();
    enum tetlod_status status = run(argv + 1, &error);
    if (status != TETLOD_OK && rank == 0)
        fprintf(stderr, "insitu_mpi: %s\n", error.message);
    MPI_Finalize();
    return status != TETLOD_OK;
}
