/* SPDX-License-Identifier: BSD-3-Clause */
/* The mesh generator of the thesis: unit cubes, each cut into the six paths along its edges from 000 to 111, which
 * makes neighbours compatible by translation. */
#include "src/sample/make.h"

enum tetlod_status sample_make_cube(struct tetmesh *out, uint32_t size, struct tetlod_error *error)
{
    // bits: x y z; the last 3 are odd
    static const uint8_t paths[6][2] = {{1, 3}, {2, 6}, {4, 5}, {1, 5}, {2, 3}, {4, 6}};
    uint64_t points = size + 1, cells = (uint64_t)size * size * size;
    enum tetlod_status status = sample_alloc(out, points * points * points, 6 * cells, error);
    if (status == TETLOD_OK)
        status = tetmesh_add_field(out, "xyz", 1, TETLOD_FLOAT32, error);
    if (status != TETLOD_OK) {
        tetmesh_fini(out);
        return status;
    }
    uint32_t vertex = 0;
    for (uint32_t z = 0; z <= size; z++)
        for (uint32_t y = 0; y <= size; y++)
            for (uint32_t x = 0; x <= size; x++, vertex++) {
                double *p = out->positions + 3 * (size_t)vertex;
                p[0] = x;
                p[1] = y;
                p[2] = z;
                out->fields[0].values[vertex] = p[0] * p[1] * p[2];
                if (x == size || y == size || z == size)
                    continue;
                uint32_t corner[8], row = size + 1;
                for (uint32_t c = 0; c < 8; c++)
                    corner[c] = vertex + (c & 1) + row * ((c >> 1 & 1) + row * (c >> 2));
                for (int t = 0; t < 6; t++) {
                    uint32_t *tet = out->corners + 4 * (size_t)out->tet_count++;
                    tet[0] = corner[0];
                    tet[1] = corner[paths[t][t < 3 ? 0 : 1]];
                    tet[2] = corner[paths[t][t < 3 ? 1 : 0]];
                    tet[3] = corner[7];
                }
            }
    sample_round(out);
    return TETLOD_OK;
}
