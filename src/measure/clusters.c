/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/measure/clusters.h"

#include <stdlib.h>

#include "format/fail.h"
#include "src/util/array.h"

/* Numbers the vertices of the tetrahedra at these places of the order. Their count is returned. */
static uint32_t number_vertices(struct clusters *clusters, const uint32_t *corners, uint32_t first, uint32_t end,
                                uint32_t *vertices)
{
    uint32_t count = 0;
    for (uint32_t i = first; i < end; i++)
        for (int c = 0; c < 4; c++) {
            uint32_t v = corners[4 * (size_t)clusters->tree.order[i] + (size_t)c], k = 0;
            while (k < count && vertices[k] != v)
                k++;
            if (k == count)
                vertices[count++] = v;
            clusters->corners[i][c] = (uint8_t)k;
        }
    return count;
}

enum tetlod_status clusters_build(struct clusters *clusters, const struct tetmesh *mesh, struct tetlod_error *error)
{
    uint32_t tets = mesh->tet_count, count = tets / CLUSTER_TETS + 1, used = 0;
    *clusters = (struct clusters){0};
    TETLOD_TRY(bvh_build(&clusters->tree, mesh->positions, mesh->corners, tets, 4, CLUSTER_TETS, error));
    clusters->begin = array_new((size_t)count + 1, sizeof *clusters->begin);
    clusters->vertices = array_new(4 * (size_t)tets, sizeof *clusters->vertices);
    clusters->corners = array_new(tets, sizeof *clusters->corners);
    if (!clusters->begin || !clusters->vertices || !clusters->corners) {
        clusters_fini(clusters);
        return tetlodi_fail_nomem(error, "the clusters", 20 * (uint64_t)tets);
    }
    for (uint32_t cluster = 0; cluster < count; cluster++) {
        uint32_t first = cluster * CLUSTER_TETS, left = tets - first;
        clusters->begin[cluster] = used;
        used += number_vertices(clusters, mesh->corners, first, first + (left < CLUSTER_TETS ? left : CLUSTER_TETS),
                                clusters->vertices + used);
    }
    clusters->begin[count] = used;
    clusters->vertices = array_shrink(clusters->vertices, used, sizeof *clusters->vertices);
    return TETLOD_OK;
}

void clusters_fini(struct clusters *clusters)
{
    bvh_fini(&clusters->tree);
    free(clusters->begin);
    free(clusters->vertices);
    free(clusters->corners);
    *clusters = (struct clusters){0};
}

uint64_t clusters_building_bytes(uint32_t tets)
{
    uint64_t own = (uint64_t)(tets / CLUSTER_TETS + 2) * sizeof(uint32_t) + tets * (uint64_t)(4 * sizeof(uint32_t) + 4);
    return bvh_building_bytes(tets, CLUSTER_TETS) + own;
}

uint64_t clusters_bytes(uint32_t tets)
{
    return (uint64_t)tets * (4 + 4 + 5) + (uint64_t)tets / CLUSTER_TETS * (4 + 4 * 24);
}
