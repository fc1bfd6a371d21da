/* SPDX-License-Identifier: BSD-3-Clause */
/* Counts of simplices and parts, by sorting. */
#include <stdlib.h>
#include <string.h>

#include "tests/attack/oracle.h"

static void sort_few(uint32_t *v, int count)
{
    for (int i = 1; i < count; i++)
        for (int j = i; j > 0 && v[j] < v[j - 1]; j--) {
            uint32_t swap = v[j];
            v[j] = v[j - 1];
            v[j - 1] = swap;
        }
}

static int compare(const uint32_t *a, const uint32_t *b, int count)
{
    for (int i = 0; i < count; i++)
        if (a[i] != b[i])
            return a[i] < b[i] ? -1 : 1;
    return 0;
}

static int compare_faces(const void *a, const void *b)
{
    return compare(((const struct oracle_face *)a)->v, ((const struct oracle_face *)b)->v, 3);
}

static int compare_edges(const void *a, const void *b)
{
    return compare(a, b, 2);
}

static int compare_tets(const void *a, const void *b)
{
    return compare(a, b, 4);
}

bool oracle_same_face(const struct oracle_face *a, const struct oracle_face *b)
{
    return compare(a->v, b->v, 3) == 0;
}

struct oracle_face *oracle_faces(const struct oracle_mesh *mesh)
{
    struct oracle_face *faces = oracle_memory(4 * (size_t)mesh->tets, sizeof *faces);
    for (uint32_t t = 0; t < mesh->tets; t++)
        for (uint32_t f = 0; f < 4; f++) {
            struct oracle_face *face = &faces[4 * (size_t)t + f];
            face->tet = t;
            for (uint32_t i = 0, k = 0; i < 4; i++)
                if (i != f)
                    face->v[k++] = mesh->corners[4 * (size_t)t + i];
            sort_few(face->v, 3);
        }
    qsort(faces, 4 * (size_t)mesh->tets, sizeof *faces, compare_faces);
    return faces;
}

static uint32_t root(uint32_t *parent, uint32_t v)
{
    while (parent[v] != v)
        v = parent[v] = parent[parent[v]];
    return v;
}

static void join(uint32_t *parent, uint32_t a, uint32_t b)
{
    a = root(parent, a);
    b = root(parent, b);
    parent[a > b ? a : b] = a > b ? b : a;
}

void oracle_parts(uint32_t vertices, const uint32_t *corners, uint32_t tets, uint32_t *part)
{
    for (uint32_t v = 0; v < vertices; v++)
        part[v] = v;
    for (uint32_t t = 0; t < tets; t++)
        for (uint32_t i = 1; i < 4; i++)
            join(part, corners[4 * (size_t)t], corners[4 * (size_t)t + i]);
    for (uint32_t v = 0; v < vertices; v++)
        part[v] = root(part, v);
}

/* How many roots there are among the vertices that are in use. */
static long roots(const uint32_t *part, const bool *used, uint32_t vertices)
{
    long count = 0;
    for (uint32_t v = 0; v < vertices; v++)
        count += used[v] && part[v] == v;
    return count;
}

/* Parts of the boundary: its faces, connected by vertices. */
static void count_boundary(const struct oracle_mesh *mesh, const struct oracle_face *faces, struct oracle_counts *out)
{
    uint32_t *part = oracle_memory(mesh->vertices, sizeof *part);
    bool *used = oracle_memory(mesh->vertices, sizeof *used);
    for (uint32_t v = 0; v < mesh->vertices; v++)
        part[v] = v;
    size_t count = 4 * (size_t)mesh->tets;
    for (size_t i = 0, end; i < count; i = end) {
        for (end = i + 1; end < count && oracle_same_face(&faces[i], &faces[end]);)
            end++;
        out->euler++;
        out->overfull_faces += end - i > 2;
        for (int k = 0; k < 3 && end - i == 1; k++) {
            used[faces[i].v[k]] = true;
            join(part, faces[i].v[0], faces[i].v[k]);
        }
    }
    for (uint32_t v = 0; v < mesh->vertices; v++)
        part[v] = root(part, v);
    out->boundary_parts = roots(part, used, mesh->vertices);
    free(part);
    free(used);
}

static long count_edges(const struct oracle_mesh *mesh)
{
    uint32_t(*edges)[2] = oracle_memory(6 * (size_t)mesh->tets, sizeof *edges);
    size_t count = 0;
    long different = 0;
    for (uint32_t t = 0; t < mesh->tets; t++)
        for (uint32_t i = 0; i < 4; i++)
            for (uint32_t j = 0; j < i; j++, count++) {
                edges[count][0] = mesh->corners[4 * (size_t)t + i];
                edges[count][1] = mesh->corners[4 * (size_t)t + j];
                sort_few(edges[count], 2);
            }
    qsort(edges, count, sizeof *edges, compare_edges);
    for (size_t i = 0; i < count; i++)
        different += i == 0 || compare(edges[i], edges[i - 1], 2) != 0;
    free(edges);
    return different;
}

static long count_duplicates(const struct oracle_mesh *mesh)
{
    uint32_t(*tets)[4] = oracle_memory(mesh->tets, sizeof *tets);
    long same = 0;
    memcpy(tets, mesh->corners, mesh->tets * sizeof *tets);
    for (uint32_t t = 0; t < mesh->tets; t++)
        sort_few(tets[t], 4);
    qsort(tets, mesh->tets, sizeof *tets, compare_tets);
    for (uint32_t t = 1; t < mesh->tets; t++)
        same += compare(tets[t], tets[t - 1], 4) == 0;
    free(tets);
    return same;
}

void oracle_count(const struct oracle_mesh *mesh, struct oracle_counts *out)
{
    *out = (struct oracle_counts){0};
    struct oracle_face *faces = oracle_faces(mesh);
    uint32_t *part = oracle_memory(mesh->vertices, sizeof *part);
    bool *used = oracle_memory(mesh->vertices, sizeof *used);
    oracle_parts(mesh->vertices, mesh->corners, mesh->tets, part);
    for (size_t i = 0; i < 4 * (size_t)mesh->tets; i++)
        used[mesh->corners[i]] = true;
    out->parts = roots(part, used, mesh->vertices);
    count_boundary(mesh, faces, out); // euler: the faces
    for (uint32_t v = 0; v < mesh->vertices; v++)
        out->euler += used[v];
    out->duplicates = count_duplicates(mesh);
    out->euler -= count_edges(mesh) + (long)mesh->tets - out->duplicates;
    for (uint32_t t = 0; t < mesh->tets; t++) {
        int sign = oracle_sign(mesh, t, NULL);
        out->inverted += sign < 0;
        out->flat += sign == 0;
    }
    free(faces);
    free(part);
    free(used);
}
