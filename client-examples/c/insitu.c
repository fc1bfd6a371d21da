/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * insitu FOLDER: a solver that writes a stream of its mesh and its field now and then. The solver is a stand-in: a warm
 * spot that moves through a box of N x N x N cubes, six tetrahedra each.
 *
 * cc insitu.c $(pkg-config --cflags --libs tetlod-build) -lm -o insitu
 */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

#include <tetlod_build.h>

enum { N = 16, M = N + 1, POINTS = M * M * M, TETS = 6 * N * N * N };
static double positions[POINTS][3], temperature[POINTS];
static uint32_t corners[TETS][4];

static void make_mesh(void)
{
    static const int steps[3] = {1, M, M * M}, ways[6][3] = {{0, 1, 2}, {1, 2, 0}, {2, 0, 1}, {0, 2, 1}, {1, 0, 2},
                                                             {2, 1, 0}};
    for (int p = 0; p < POINTS; p++)
        for (int k = 0; k < 3; k++)
            positions[p][k] = p / steps[k] % M / (double)N;
    for (int t = 0; t < TETS; t++) { /* along the edges of a cube from corner to opposite corner */
        int cube = t / 6, point = cube % N + cube / N % N * M + cube / (N * N) * M * M;
        for (int k = 0; k < 4; point += k < 3 ? steps[ways[t % 6][k]] : 0, k++)
            corners[t][t % 6 < 3 || k < 2 ? k : 5 - k] = (uint32_t)point;
    }
}

static void solve(double time)
{
    for (int p = 0; p < POINTS; p++)
        temperature[p] = exp(-9 * (pow(positions[p][0] - time, 2) + pow(positions[p][1] - 0.5,
                                                                        2) + pow(positions[p][2] - 0.5, 2)));
}

static int show(void *path, const char *phase, double done)
{
    return fprintf(stderr, "\r%s: %-8s %3.0f %%", (char *)path, phase, 100 * done) > 0; /* 0 would cancel */
}

static enum tetlod_status write_bytes(void *file, const void *bytes, size_t size)
{
    return fwrite(bytes, 1, size, file) == size ? TETLOD_OK : TETLOD_ERR_IO;
}

static int save(char *path)
{
    struct tetlod_build_array field = {"temperature", 1, TETLOD_CELL_FLOAT64, temperature};
    struct tetlod_build_mesh mesh = {sizeof mesh, POINTS, TETS, TETLOD_FLOAT64, positions, corners[0], 1, 0, &field,
                                     NULL};
    struct tetlod_build_options options;
    struct tetlod_error error = {0};
    FILE *file = fopen(path, "wb");
    if (!file) {
        fprintf(stderr, "%s: %s\n", path, strerror(errno));
        return 1;
    }
    tetlod_build_defaults(&options);
    options.max_error = 0.1; /* nobody asks for coarser levels */
    options.progress = show;
    options.progress_opaque = path;
    enum tetlod_status status = tetlod_build(&mesh, &options, write_bytes, file, &error);
    fprintf(stderr, status == TETLOD_OK ? "\n" : "\n%s: %s\n", path, error.message);
    return fclose(file) || status != TETLOD_OK;
}

int main(int argc, char **argv)
{
    char path[4096];
    make_mesh();
    for (int step = 0; step <= 40 && argc == 2; step++) {
        solve(step / 40.0);
        snprintf(path, sizeof path, "%s/step%02d.tetlod", argv[1], step);
        if (step % 20 == 0 && save(path))
            return 1;
    }
    return argc == 2 ? 0 : 2;
}
