/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * insitu_series FILE: a solver that writes one stream of its mesh and of many steps in time. A step is added whenever
 * the solver says so; the stream is written when it is done. The solver is a stand-in: heat that spreads through a box
 * of N x N x N cubes, six tetrahedra each.
 *
 * cc insitu_series.c $(pkg-config --cflags --libs tetlod-build) -lm -o insitu_series
 */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

#include <tetlod_build.h>

enum { N = 12, M = N + 1, POINTS = M * M * M, TETS = 6 * N * N * N, ROUNDS = 200, EVERY = 10 };
static double positions[POINTS][3], temperature[POINTS], before[POINTS];
static uint32_t corners[TETS][4];

static void make_mesh(void)
{
    static const int steps[3] = {1, M, M * M},
                     ways[6][3] = {{0, 1, 2}, {1, 2, 0}, {2, 0, 1}, {0, 2, 1}, {1, 0, 2}, {2, 1, 0}};
    for (int p = 0; p < POINTS; p++)
        for (int k = 0; k < 3; k++)
            positions[p][k] = p / steps[k] % M / (double)N;
    for (int t = 0; t < TETS; t++) { /* along the edges of a cube from corner to opposite corner */
        int cube = t / 6, point = cube % N + cube / N % N * M + cube / (N * N) * M * M;
        for (int k = 0; k < 4; point += k < 3 ? steps[ways[t % 6][k]] : 0, k++)
            corners[t][t % 6 < 3 || k < 2 ? k : 5 - k] = (uint32_t)point;
    }
    for (int p = 0; p < POINTS; p++)
        temperature[p] = positions[p][0] < 0.3 && positions[p][1] < 0.5 ? 100 : 20;
}

/* Each point inside goes towards the mean of its neighbours. */
static void solve(void)
{
    memcpy(before, temperature, sizeof before);
    for (int z = 1; z < N; z++)
        for (int y = 1; y < N; y++)
            for (int x = 1, p; x < N; x++) {
                p = x + M * (y + M * z);
                temperature[p] += 0.15 * (before[p - 1] + before[p + 1] + before[p - M] + before[p + M] +
                                          before[p - M * M] + before[p + M * M] - 6 * before[p]);
            }
}

static void warn(void *opaque, const char *line)
{
    (void)opaque;
    fprintf(stderr, "warning: %s\n", line);
}

static enum tetlod_status write_bytes(void *file, const void *bytes, size_t size)
{
    return fwrite(bytes, 1, size, file) == size ? TETLOD_OK : TETLOD_ERR_IO;
}

static enum tetlod_status run(FILE *file, struct tetlod_error *error)
{
    struct tetlod_build_array field = {"temperature", 1, TETLOD_CELL_FLOAT64, temperature};
    struct tetlod_build_mesh mesh = {sizeof mesh, POINTS, TETS, TETLOD_FLOAT64, positions,
                                     corners[0],  1,      0,    &field,         NULL};
    struct tetlod_build_options options;
    struct tetlod_build_series *series;
    tetlod_build_defaults(&options);
    options.warn = warn;
    enum tetlod_status status = tetlod_build_series_new(&series, &options, error);
    for (int round = 0; round <= ROUNDS && status == TETLOD_OK; round++, solve())
        if (round % EVERY == 0) /* the values are copied: the solver goes on with its arrays */
            status = tetlod_build_series_add(series, &mesh, 0.01 * round, error);
    if (status == TETLOD_OK)
        status = tetlod_build_series_finish(series, write_bytes, file, error);
    tetlod_build_series_free(series);
    return status;
}

int main(int argc, char **argv)
{
    struct tetlod_error error = {0};
    FILE *file = argc == 2 ? fopen(argv[1], "wb") : NULL;
    if (!file) {
        fprintf(stderr, "insitu_series FILE: %s\n", argc == 2 ? strerror(errno) : "give a name");
        return argc == 2 ? 1 : 2;
    }
    make_mesh();
    enum tetlod_status status = run(file, &error);
    if (status != TETLOD_OK)
        fprintf(stderr, "%s: %s\n", argv[1], error.message);
    return fclose(file) || status != TETLOD_OK;
}
