/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * Welding: points at the same place with the same values become the one of least number. Points are hashed by their
 * values and by the box of a grid that they are in; with a tolerance the boxes are that wide, and the 26 around are
 * looked at, too. Points of one box with the same values that are not welded are further apart than the tolerance: a
 * bucket has a few of them.
 */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "format/fail.h"
#include "src/io/services/weld_pieces.h"
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

/* Numbers that are equal have the same hash: 0 and -0, and any NaN, which counts as equal among values. */
static uint64_t mix(uint64_t hash, double value)
{
    double normal = isnan(value) ? (double)NAN : value + 0.0;
    uint64_t bits;
    memcpy(&bits, &normal, sizeof bits);
    hash = (hash ^ bits) * UINT64_C(0x9e3779b97f4a7c15);
    return hash ^ hash >> 29;
}

static uint64_t hash_values(const struct tetmesh *mesh, uint32_t v)
{
    uint64_t hash = 0;
    for (uint32_t f = 0; f < mesh->field_count; f++) {
        const struct point_field *field = &mesh->fields[f];
        for (size_t c = 0; c < field->components; c++)
            hash = mix(hash, field->values[(size_t)v * field->components + c]);
    }
    return hash;
}

static size_t bucket_of(const struct weld *w, const double box[3], uint64_t values)
{
    return (size_t)mix(mix(mix(values, box[0]), box[1]), box[2]) & w->mask;
}

bool mesh_same_values(const struct tetmesh *mesh, uint32_t a, uint32_t b)
{
    for (uint32_t f = 0; f < mesh->field_count; f++) {
        const struct point_field *field = &mesh->fields[f];
        for (size_t c = 0; c < field->components; c++) {
            double x = field->values[(size_t)a * field->components + c],
                   y = field->values[(size_t)b * field->components + c];
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

/* The least point of the box that `v`, whose values have this hash, can become, or TETLOD_NONE. */
static uint32_t find_in_box(const struct weld *w, const double box[3], uint64_t values, uint32_t v)
{
    uint32_t found = TETLOD_NONE;
    for (uint32_t u = w->first[bucket_of(w, box, values)]; u != TETLOD_NONE; u = w->next[u])
        if (u < found && is_near(w, u, v) && mesh_same_values(w->mesh, u, v))
            found = u;
    return found;
}

static uint32_t find(const struct weld *w, const double box[3], uint64_t values, uint32_t v)
{
    if (w->tolerance <= 0)
        return find_in_box(w, box, values, v);
    uint32_t found = TETLOD_NONE;
    for (int n = 0; n < 27; n++) {
        const double near[3] = {box[0] + n % 3 - 1, box[1] + n / 3 % 3 - 1, box[2] + n / 9 - 1};
        uint32_t u = find_in_box(w, near, values, v);
        found = u < found ? u : found;
    }
    return found;
}

/* The box of a point. A point without a place (NaN) is at the place of no other: false. */
static bool find_place(const struct weld *w, uint32_t v, double box[3])
{
    for (int d = 0; d < 3; d++)
        box[d] = box_of(w, w->mesh->positions[3 * (size_t)v + (size_t)d]);
    return !isnan(box[0]) && !isnan(box[1]) && !isnan(box[2]);
}

static void enter(const struct weld *w, size_t bucket, uint32_t v)
{
    w->next[v] = w->first[bucket];
    w->first[bucket] = v;
}

/* Chooses what `v` becomes. */
static void weld_point(struct weld *w, uint32_t v)
{
    double box[3];
    w->target[v] = v;
    if (!find_place(w, v, box))
        return;
    uint64_t values = hash_values(w->mesh, v);
    uint32_t found = find(w, box, values, v);
    if (found != TETLOD_NONE) {
        w->target[v] = found;
        return;
    }
    enter(w, bucket_of(w, box, values), v);
}

/* Cells refer to targets afterwards; the points that nothing uses any more are dropped like all such points. */
void block_redirect(struct block *block, const uint32_t *target)
{
    struct cells *cells = &block->cells;
    for (uint64_t c = 0; c < cells->count; c++) {
        uint64_t begin = cells->offsets ? cells->offsets[c] : 4 * c,
                 end = cells->offsets ? cells->offsets[c + 1] : begin + 4;
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

/* Points at the place of one of another piece, with other values: pieces are often averaged each by itself. */
static uint64_t count_apart(const struct weld *w, const uint32_t *origins)
{
    const struct tetmesh *mesh = w->mesh;
    uint64_t apart = 0;
    memset(w->first, 0xff, (w->mask + 1) * sizeof *w->first);
    for (uint32_t v = 0; v < mesh->vertex_count; v++) {
        double box[3];
        if (w->target[v] != v || !find_place(w, v, box))
            continue;
        size_t bucket = bucket_of(w, box, 0);
        uint32_t u = w->first[bucket];
        while (u != TETLOD_NONE && !is_near(w, u, v))
            u = w->next[u];
        if (u == TETLOD_NONE)
            enter(w, bucket, v);
        else
            apart += origins[u] != origins[v] && !mesh_same_values(mesh, u, v);
    }
    return apart;
}

enum tetlod_status block_weld(struct block *block, double tolerance, const uint32_t *origins, bool drops,
                              struct io_report *report, struct tetlod_error *error)
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
    for (uint32_t v = 0; v < count; v++)
        weld_point(&w, v);
    if (origins)
        TETLOD_TRY_DONE(weld_untie(block, origins, w.target, error));
    for (uint32_t v = 0; v < count; v++)
        report->welded_points += w.target[v] != v;
    report->apart_points += origins ? count_apart(&w, origins) : 0;
    block_redirect(block, w.target);
    free(w.first);
    free(w.next);
    w.first = w.next = NULL;
    if (origins && !drops)
        status = block_check_twice(block, w.target, error);
done:
    free(w.first);
    free(w.next);
    free(w.target);
    return status;
}
