/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * How long pictures of a mesh take: bench_cut [SIDE] cuts a cube of SIDE^3 cells of six tetrahedra (44: 511,104), its
 * vertices moved and numbered at random, and prints milliseconds, the least of five. Also built for WebAssembly
 * (`make bench-cut`).
 */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <time.h>

#include "src/cut/cut.h"
#include "src/cut/resample.h"
#include "src/util/array.h"

enum { TIMES = 5 };

struct picture {
    struct tetmesh mesh;
    /* functions to cut at zero; noise cuts nearly every tetrahedron, the most work there can be */
    double *plane, *shell, *noise;
    struct cut boundary, cut;
    struct cut_grid grid;
    struct cut_voxels voxels;
    float *points, *normals;
    struct tetlod_error error;
    size_t found; /* so that nothing is left out */
};

static double now(void)
{
    struct timespec time;
    clock_gettime(CLOCK_MONOTONIC, &time);
    return 1e3 * (double)time.tv_sec + 1e-6 * (double)time.tv_nsec;
}

static uint32_t random32(uint64_t *state)
{
    *state = *state * 6364136223846793005u + 1442695040888963407u;
    return (uint32_t)(*state >> 32);
}

static void *need(void *block)
{
    if (!block) {
        fprintf(stderr, "bench_cut: out of memory\n");
        exit(1);
    }
    return block;
}

static void make_vertices(struct picture *p, uint32_t side, const uint32_t *ids)
{
    uint64_t state = 1;
    for (uint32_t v = 0; v < p->mesh.vertex_count; v++) {
        double *at = p->mesh.positions + 3 * (size_t)ids[v], r2 = 0;
        for (uint32_t d = 0, rest = v; d < 3; d++, rest /= side + 1) {
            double x = rest % (side + 1), move = x > 0 && x < side ? 0.2 * (random32(&state) / 4294967296.0 - 0.5) : 0;
            at[d] = (x + move) / side;
            r2 += (at[d] - 0.5) * (at[d] - 0.5);
        }
        p->plane[ids[v]] = at[0] + 0.7 * at[1] + 0.4 * at[2] - 1.03;
        p->shell[ids[v]] = r2 - 0.16;
        p->noise[ids[v]] = random32(&state) - 2147483648.0;
    }
}

static void make_mesh(struct picture *p, uint32_t side)
{
    static const uint8_t paths[6][4] = {{0, 1, 3, 7}, {0, 5, 1, 7}, {0, 3, 2, 7}, {0, 2, 6, 7}, {0, 4, 5, 7},
                                        {0, 6, 4, 7}};
    uint32_t row = side + 1, count = row * row * row, *ids = need(array_new(count, sizeof *ids));
    uint64_t state = 2;
    p->mesh = (struct tetmesh){.vertex_count = count, .tet_count = 6 * side * side * side};
    p->mesh.positions = need(array_new(count, 3 * sizeof(double)));
    p->mesh.corners = need(array_new(p->mesh.tet_count, 4 * sizeof(uint32_t)));
    p->plane = need(array_new(count, sizeof(double)));
    p->shell = need(array_new(count, sizeof(double)));
    p->noise = need(array_new(count, sizeof(double)));
    for (uint32_t v = 0; v < count; v++) { // near ones stay near, as in a stream
        uint32_t other = v < 512 ? v : v - random32(&state) % 512;
        ids[v] = v;
        ids[v] = ids[other];
        ids[other] = v;
    }
    make_vertices(p, side, ids);
    uint32_t *at = p->mesh.corners;
    for (uint32_t cell = 0; cell < side * side * side; cell++) {
        uint32_t first = cell % side + row * (cell / side % side) + row * row * (cell / (side * side));
        for (int path = 0; path < 6; path++)
            for (int c = 0; c < 4; c++) {
                unsigned corner = paths[path][c];
                *at++ = ids[first + (corner & 1) + row * (corner >> 1 & 1) + row * row * (corner >> 2)];
            }
    }
    free(ids);
}

static void must(enum tetlod_status status, const struct picture *p)
{
    if (status == TETLOD_OK)
        return;
    fprintf(stderr, "bench_cut: %s\n", p->error.message);
    exit(1);
}

static void boundary(struct picture *p)
{
    must(cut_boundary(&p->mesh, &p->boundary, &p->error), p);
    p->found = p->boundary.triangle_count;
}

static void boundary_lines(struct picture *p)
{
    must(cut_lines(&p->boundary, NULL, &p->error), p);
    p->found = p->boundary.line_count;
}

static void slice(struct picture *p)
{
    must(cut_zero(&p->mesh, p->plane, &p->cut, &p->error), p);
    p->found = p->cut.triangle_count;
}

static void slice_lines(struct picture *p)
{
    must(cut_lines(&p->cut, p->plane, &p->error), p);
    p->found = p->cut.line_count;
}

static void isosurface(struct picture *p)
{
    must(cut_zero(&p->mesh, p->shell, &p->cut, &p->error), p);
    p->found = p->cut.triangle_count;
}

static void isosurface_of_noise(struct picture *p)
{
    must(cut_zero(&p->mesh, p->noise, &p->cut, &p->error), p);
    p->found = p->cut.triangle_count;
}

static void normals(struct picture *p)
{
    p->points = need(array_resize(p->points, p->cut.vertex_count, 3 * sizeof(float)));
    p->normals = need(array_resize(p->normals, p->cut.vertex_count, 3 * sizeof(float)));
    for (uint32_t v = 0; v < p->cut.vertex_count; v++)
        for (uint32_t d = 0; d < 3; d++)
            p->points[3 * (size_t)v + d] = (float)cut_value(&p->cut, v, p->mesh.positions, 3, d);
    cut_normals(&p->cut, p->points, p->normals);
    p->found = p->cut.vertex_count;
}

static void clip(struct picture *p)
{
    must(cut_clip(&p->mesh, &p->boundary, p->plane, &p->cut, &p->error), p);
    p->found = p->cut.triangle_count;
}

static void resample(struct picture *p, uint32_t size)
{
    cut_grid_cover(&p->grid, (const double[]){0, 0, 0}, (const double[]){1, 1, 1}, size);
    must(cut_resample(&p->mesh, p->shell, NULL, &p->grid, &p->error), p);
    p->found = 0;
    for (size_t i = 0; i < (size_t)size * size * size; i++)
        p->found += !isnan(p->grid.values[i]);
}

static void resample_64(struct picture *p)
{
    resample(p, 64);
}

static void resample_128(struct picture *p)
{
    resample(p, 128);
}

static void voxels(struct picture *p)
{
    static const struct cut_plane clip = {{0.5, 0.5, 0.5}, {1, 2, 3}};
    must(cut_make_voxels(&p->grid, true, &clip, &p->voxels, &p->error), p);
    p->found = (size_t)p->grid.dims[0] * p->grid.dims[1] * p->grid.dims[2];
}

static void probe(struct picture *p)
{
    double weights[4];
    p->found = cut_probe(&p->mesh, (const double[]){0.99, 0.98, 0.97}, 0, weights);
}

static void measure(struct picture *p, const char *name, void (*make)(struct picture *))
{
    double least = 1e30;
    for (int i = 0; i < TIMES; i++) {
        double start = now();
        make(p);
        double passed = now() - start;
        least = passed < least ? passed : least;
    }
    printf("%-16s %8.1f ms  %zu\n", name, least, p->found);
}

int main(int argc, char **argv)
{
    struct picture p = {0};
    make_mesh(&p, argc > 1 ? (uint32_t)strtoul(argv[1], NULL, 10) : 44);
    printf("%u tetrahedra\n", p.mesh.tet_count);
    measure(&p, "boundary", boundary);
    measure(&p, "boundary lines", boundary_lines);
    measure(&p, "slice", slice);
    measure(&p, "slice lines", slice_lines);
    measure(&p, "isosurface", isosurface);
    measure(&p, "points, normals", normals);
    measure(&p, "clip", clip);
    measure(&p, "noise", isosurface_of_noise);
    measure(&p, "resample 64^3", resample_64);
    measure(&p, "resample 128^3", resample_128);
    measure(&p, "voxels of that", voxels);
    measure(&p, "probe", probe);
    cut_fini(&p.boundary);
    cut_fini(&p.cut);
    cut_grid_fini(&p.grid);
    cut_voxels_fini(&p.voxels);
    free(p.points);
    free(p.normals);
    free(p.plane);
    free(p.shell);
    free(p.noise);
    tetmesh_fini(&p.mesh);
    return 0;
}
