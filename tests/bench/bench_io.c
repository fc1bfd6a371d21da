/* SPDX-License-Identifier: BSD-3-Clause */
/* How long reading and writing a mesh file take: bench_io INPUT [OUTPUT] prints the seconds of either, as JSON. */
#include <stdio.h>

#include "src/io/io.h"
#include "src/util/clock.h"

int main(int argc, char **argv)
{
    struct tetmesh mesh;
    struct tetlod_error error = {0};
    if (argc < 2 || argc > 3) {
        fputs("usage: bench_io INPUT [OUTPUT]\n", stderr);
        return 2;
    }
    double start = monotonic_seconds();
    enum tetlod_status status = io_read(&mesh, argv[1], NULL, NULL, &error);
    double read = monotonic_seconds();
    if (status == TETLOD_OK && argc == 3)
        status = io_write(&mesh, argv[2], &error);
    double written = monotonic_seconds();
    if (status != TETLOD_OK) {
        fprintf(stderr, "bench_io: %s\n", error.message);
        return 1;
    }
    printf("{\"read\": %.4f, \"write\": %.4f, \"tetrahedra\": %u}\n", read - start, written - read, mesh.tet_count);
    tetmesh_fini(&mesh);
    return 0;
}
