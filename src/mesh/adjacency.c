/* SPDX-License-Identifier: BSD-3-Clause */
/* Faces are bucketed by their least vertex and matched inside the bucket: no hashing, linear for bounded stars. */
#include "src/mesh/adjacency.h"

#include <stdbool.h>
#include <stdlib.h>

#include "format/fail.h"
#include "src/mesh/tet_geom.h"
#include "src/util/array.h"

/* A face of a bucket: its two greater vertices, where it came first, and where again. */
struct face {
    uint64_t key;
    uint32_t first, again; /* 4 * tet + face; `again`: ONCE, OFTEN if it came more than twice */
};

enum { FEW = 64 };
static const uint32_t ONCE = TETLOD_NONE, OFTEN = TETLOD_NONE - 1;

/* The least vertex of a face. */
static uint32_t bucket_of(const uint32_t *tet, unsigned face)
{
    const uint8_t *of = tet_faces[face];
    const uint32_t a = tet[of[0]], b = tet[of[1]], c = tet[of[2]], less = a < b ? a : b;
    return less < c ? less : c;
}

/* Of a face of the bucket. */
static uint64_t key_of(const uint32_t *corners, uint32_t slot, uint32_t bucket)
{
    const uint32_t *tet = corners + (slot & ~(size_t)3);
    const uint8_t *of = tet_faces[slot & 3];
    const uint32_t a = tet[of[0]], b = tet[of[1]], c = tet[of[2]];
    return a == bucket ? pair_key(b, c) : b == bucket ? pair_key(a, c) : pair_key(a, b);
}

/* The face comes again. Returns whether it is the first that is too many. */
static bool join_face(struct face *face, uint32_t slot, uint32_t *neighbours)
{
    const bool second = face->again == ONCE, third = !second && face->again != OFTEN;
    neighbours[slot] = second ? face->first : TETLOD_NONE;
    neighbours[face->first] = second ? slot : TETLOD_NONE;
    if (third)
        neighbours[face->again] = TETLOD_NONE;
    face->again = second ? slot : OFTEN;
    return third;
}

static int compare_faces(const void *left, const void *right)
{
    const struct face *a = left, *b = right;
    return (a->key > b->key) - (a->key < b->key);
}

/* Each face of a bucket is looked for among those that came before: of the few of most buckets among all, of many, in
 * order, at the last one. */
static uint32_t match_bucket(struct face *faces, size_t count, uint32_t *neighbours)
{
    uint32_t overfull = 0;
    size_t known = 0;
    if (count > FEW)
        qsort(faces, count, sizeof *faces, compare_faces);
    for (size_t i = 0; i < count; i++) {
        const struct face face = faces[i];
        size_t at = count > FEW && known ? known - 1 : 0;
        while (at < known && faces[at].key != face.key)
            at++;
        if (at < known) {
            overfull += join_face(&faces[at], face.first, neighbours);
        } else {
            faces[known++] = face;
            neighbours[face.first] = TETLOD_NONE;
        }
    }
    return overfull;
}

/* Matches the faces of one bucket after the other; `faces` has room for the largest. */
static uint32_t match_buckets(const uint32_t *corners, const uint32_t *slots, const size_t *ends, uint32_t vertex_count,
                              struct face *faces, uint32_t *neighbours)
{
    uint32_t overfull = 0;
    size_t at = 0;
    for (uint32_t i = 0; i < vertex_count; i++) {
        size_t count = 0;
        for (; at < ends[i]; at++)
            faces[count++] = (struct face){key_of(corners, slots[at], i), slots[at], ONCE};
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
    uint32_t *slots = array_new(slot_count, sizeof *slots), overfull = 0;
    struct face *faces = NULL;
    for (size_t tet = 0; tet < slot_count && bucket; tet += 4)
        for (unsigned f = 0; f < 4; f++)
            bucket[bucket_of(corners + tet, f)]++;
    for (uint32_t i = 0; i <= vertex_count && bucket; i++) {
        size_t size = bucket[i];
        largest = size > largest ? size : largest;
        bucket[i] = sum;
        sum += size;
    }
    if (bucket && slots)
        faces = array_new(largest, sizeof *faces);
    for (size_t tet = 0; tet < slot_count && faces; tet += 4)
        for (unsigned f = 0; f < 4; f++) // when all are in, bucket[i] is the end of bucket i
            slots[bucket[bucket_of(corners + tet, f)]++] = (uint32_t)tet + f;
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
