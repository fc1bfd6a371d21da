/* SPDX-License-Identifier: BSD-3-Clause */
/* Faces are bucketed by their least vertex and matched inside the bucket: no hashing, linear for bounded stars. */
#include "src/mesh/adjacency.h"

#include <stdlib.h>

#include "format/fail.h"
#include "src/mesh/tet_geom.h"
#include "src/util/array.h"

struct face {
    uint32_t mid, high, slot; /* the least vertex is the bucket; slot = 4*tet + face */
};

static void face_vertices(const uint32_t *corners, size_t slot, uint32_t v[3])
{
    const uint32_t *tet = corners + (slot & ~(size_t)3);
    for (int i = 0; i < 3; i++)
        v[i] = tet[tet_faces[slot & 3][i]];
    sort_three(v);
}

static int compare_faces(const void *left, const void *right)
{
    const struct face *a = left, *b = right;
    if (a->mid != b->mid)
        return a->mid < b->mid ? -1 : 1;
    if (a->high != b->high)
        return a->high < b->high ? -1 : 1;
    return a->slot < b->slot ? -1 : a->slot > b->slot;
}

static uint64_t key_of(const struct face *face)
{
    return (uint64_t)face->mid << 32 | face->high;
}

/* Faces come by ascending slots. Of the few of most buckets each is put in its place. */
static void sort_faces(struct face *faces, size_t count)
{
    enum { FEW = 64 };
    if (count > FEW) {
        qsort(faces, count, sizeof *faces, compare_faces);
        return;
    }
    for (size_t i = 1; i < count; i++) {
        const struct face face = faces[i];
        size_t at = i;
        for (; at && key_of(&faces[at - 1]) > key_of(&face); at--)
            faces[at] = faces[at - 1];
        faces[at] = face;
    }
}

static uint32_t match_bucket(struct face *faces, size_t count, uint32_t *neighbours)
{
    uint32_t overfull = 0;
    sort_faces(faces, count);
    for (size_t i = 0, end; i < count; i = end) {
        for (end = i + 1; end < count && faces[end].mid == faces[i].mid && faces[end].high == faces[i].high; end++)
            ;
        for (size_t face = i; face < end; face++)
            neighbours[faces[face].slot] = end - i == 2 ? faces[2 * i + 1 - face].slot : TETLOD_NONE;
        overfull += end - i > 2;
    }
    return overfull;
}

/* Matches the faces of one bucket after the other; `faces` has room for the largest. */
static uint32_t match_buckets(const uint32_t *corners, const uint32_t *slots, const size_t *ends, uint32_t vertex_count,
                              struct face *faces, uint32_t *neighbours)
{
    uint32_t overfull = 0, v[3];
    for (size_t i = 0, at = 0; i < vertex_count; i++) {
        size_t count = 0;
        for (; at < ends[i]; at++) {
            face_vertices(corners, slots[at], v);
            faces[count++] = (struct face){v[1], v[2], slots[at]};
        }
        overfull += match_bucket(faces, count, neighbours);
    }
    return overfull;
}

enum tetlod_status adjacency_build(const uint32_t *corners, uint32_t tet_count, uint32_t vertex_count,
                                   uint32_t *neighbours, uint32_t *out_overfull, struct tetlod_error *error)
{
    if (tet_count > ADJACENCY_MAX_TETS)
        return tetlodi_fail(error, TETLOD_ERR_LIMIT, "%u tetrahedra are more than the %d that fit", tet_count,
                            ADJACENCY_MAX_TETS);
    size_t slot_count = 4 * (size_t)tet_count, sum = 0, largest = 0;
    size_t *bucket = array_zero((size_t)vertex_count + 1, sizeof *bucket);
    uint32_t *slots = array_new(slot_count, sizeof *slots), v[3], overfull = 0;
    struct face *faces = NULL;
    for (size_t slot = 0; slot < slot_count && bucket; slot++) {
        face_vertices(corners, slot, v);
        bucket[v[0]]++;
    }
    for (uint32_t i = 0; i <= vertex_count && bucket; i++) {
        size_t size = bucket[i];
        largest = size > largest ? size : largest;
        bucket[i] = sum;
        sum += size;
    }
    if (bucket && slots)
        faces = array_new(largest, sizeof *faces);
    for (size_t slot = 0; slot < slot_count && faces; slot++) {
        face_vertices(corners, slot, v);
        slots[bucket[v[0]]++] = (uint32_t)slot; // when all are in, bucket[i] is the end of bucket i
    }
    if (faces)
        overfull = match_buckets(corners, slots, bucket, vertex_count, faces, neighbours);
    enum tetlod_status status = faces ? TETLOD_OK : tetlodi_fail_nomem(error, "the adjacency",
                                                                       slot_count * sizeof *slots);
    free(bucket);
    free(slots);
    free(faces);
    if (out_overfull)
        *out_overfull = overfull;
    return status;
}

void stars_build(const uint32_t *corners, uint32_t tet_count, uint32_t vertex_count, size_t *offsets, uint32_t *tets)
{
    size_t slots = 4 * (size_t)tet_count;
    for (size_t v = 0; v <= vertex_count; v++)
        offsets[v] = 0;
    for (size_t slot = 0; slot < slots; slot++)
        offsets[corners[slot] + 1]++;
    for (size_t v = 0; v < vertex_count; v++)
        offsets[v + 1] += offsets[v];
    for (size_t slot = 0; slot < slots; slot++)
        tets[offsets[corners[slot]]++] = (uint32_t)(slot / 4);
    for (size_t v = vertex_count; v > 0; v--) // the fill moved every start to the next one's
        offsets[v] = offsets[v - 1];
    offsets[0] = 0;
}
