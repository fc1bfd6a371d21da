/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * Welding: points at the same place with the same values become the one of least number. Points are hashed by the box of a
 * grid that they are in; with a tolerance the boxes are that wide, and the 26 around are looked at, too.
 */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "format/fail.h"
#include "src/io/services/assemble.h"
#include "src/util/array.h"

struct weld {
    struct tetmesh *mesh;
    double tolerance;
    uint32_t *first; /* [mask + 1]: of a bucket, TETLOD_NONE: empty */
    uint32_t *next;  /* [vertex]: in the bucket */
    uint32_t *target; /* [vertex]: what it becomes */
    size_t mask;
};

/* The box of a coordinate; without a tolerance every number is a box of its own. */
static double box_of(const struct weld *w, double value)
{
    return w->tolerance > 0 ? floor(value / w->tolerance) : value + 0.0; // -0 becomes 0
}

static size_t hash_box(const struct weld *w, const double box[3])
{
    uint64_t hash = 0;
    for (int d = 0; d < 3; d++) {
        double value = box[d] + 0.0;
        uint64_t bits;
        memcpy(&bits, &value, sizeof bits);
        hash = (hash ^ bits) * UINT64_C(0x9e3779b97f4a7c15);
        hash ^= hash >> 29;
    }
    return (size_t)hash & w->mask;
}

static bool same_values(const struct tetmesh *mesh, uint32_t a, uint32_t b)
{
    for (uint32_t f = 0; f < mesh->field_count; f++) {
        const struct point_field *field = &mesh->fields[f];
        for (size_t c = 0; c < field->components; c++) {
            double x = field->values[(size_t)a * field->components + c], y = field->values[(size_t)b * field->components + c];
            if (!(x == y || (isnan(x) && isnan(y))))
                return false;
        }
    }
    return true;
}

static bool is_near(const struct weld *w, uint32_t a, uint32_t b)
{
    const double *p = w->mesh->positions + 3 * (size_t)a, *q = w->mesh->positions + 3 * (size_t)b;
    if (w->tolerance <= 0)
        return p[0] == q[0] && p[1] == q[1] && p[2] == q[2];
    double x = p[0] - q[0], y = p[1] - q[1], z = p[2] - q[2];
    return x * x + y * y + z * z <= w->tolerance * w->tolerance;
}

/* The least point of the box that `v` can become, or TETLOD_NONE. */
static uint32_t find_in_box(const struct weld *w, const double box[3], uint32_t v)
{
    uint32_t found = TETLOD_NONE;
    for (uint32_t u = w->first[hash_box(w, box)]; u != TETLOD_NONE; u = w->next[u])
        if (u < found && is_near(w, u, v) && same_values(w->mesh, u, v))
            found = u;
    return found;
}

static uint32_t find(const struct weld *w, const double box[3], uint32_t v)
{
    if (w->tolerance <= 0)
        return find_in_box(w, box, v);
    uint32_t found = TETLOD_NONE;
    for (int n = 0; n < 27; n++) {
        const double near[3] = {box[0] + n % 3 - 1, box[1] + n / 3 % 3 - 1, box[2] + n / 9 - 1};
        uint32_t u = find_in_box(w, near, v);
        found = u < found ? u : found;
    }
    return found;
}

/* Cells refer to targets afterwards; the points that nothing uses any more are dropped like all such points. */
static void redirect(struct block *block, const uint32_t *target)
{
    struct cells *cells = &block->cells;
    for (uint64_t c = 0; c < cells->count; c++) {
        uint64_t begin = cells->offsets ? cells->offsets[c] : 4 * c, end = cells->offsets ? cells->offsets[c + 1] : begin + 4;
        uint64_t count_at = cells->types && cells->types[c] == VTK_TYPE_POLYHEDRON ? begin : UINT64_MAX;
        for (uint64_t i = begin; i < end && i < cells->connectivity_count; i++) {
            uint32_t *corner = &cells->connectivity[i];
            if (i == count_at)
                count_at = i == begin ? begin + 1 : i + 1 + *corner;
            else if (*corner < block->mesh.vertex_count)
                *corner = target[*corner];
        }
    }
}

enum tetlod_status block_weld(struct block *block, double tolerance, struct io_report *report, struct tetlod_error *error)
{
    struct weld w = {.mesh = &block->mesh, .tolerance = tolerance, .mask = 1};
    uint32_t count = block->mesh.vertex_count;
    enum tetlod_status status = TETLOD_OK;
    while (w.mask < count)
        w.mask = 2 * w.mask + 1;
    w.first = array_new(w.mask + 1, sizeof *w.first);
    w.next = array_new(count, sizeof *w.next);
    w.target = array_new(count, sizeof *w.target);
    if (!w.first || !w.next || !w.target) {
        status = tetlodi_fail_nomem(error, "welding", (uint64_t)count * 16);
        goto done;
    }
    memset(w.first, 0xff, (w.mask + 1) * sizeof *w.first); // TETLOD_NONE
    for (uint32_t v = 0; v < count; v++) {
        const double *p = w.mesh->positions + 3 * (size_t)v;
        const double box[3] = {box_of(&w, p[0]), box_of(&w, p[1]), box_of(&w, p[2])};
        uint32_t found = find(&w, box, v);
        w.target[v] = found == TETLOD_NONE ? v : found;
        if (found != TETLOD_NONE) {
            report->welded_points++;
            continue;
        }
        size_t bucket = hash_box(&w, box);
        w.next[v] = w.first[bucket];
        w.first[bucket] = v;
    }
    redirect(block, w.target);
done:
    free(w.first);
    free(w.next);
    free(w.target);
    return status;
}
