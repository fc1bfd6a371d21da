/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * Where a sample is has the same bits in whatever order a mesh lists its corners (sample_points.h). It is in a
 * tetrahedron whatever its weights, computed in doubles, may say so. Every tetrahedron, or else every closest face,
 * that may be the one gives a difference and how far off that may be: the sample's error is between the least and the
 * greatest of these.
 *
 * Where sheets of the level lie over each other, the straight way from the closest point of the boundary may not lead
 * to the sample: a search may then say that it is outside, and the closest faces are asked, too.
 */
#include "src/measure/measure_range.h"

#include <float.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "format/fail.h"
#include "src/measure/exact_cell.h"
#include "src/measure/same.h"
#include "src/measure/tally.h"
#include "src/measure/walk.h"
#include "src/measure/weights_map.h"
#include "src/mesh/locate.h"
#include "src/mesh/sample_points.h"
#include "src/mesh/tet_geom.h"
#include "src/mesh/triangle.h"
#include "src/mesh/vector.h"
#include "src/util/array.h"
#include "src/util/parallel.h"

/* Samples are located to that in doubles, as a weight (walk.c, locate.c). */
static const double ON_FACE = 2e-9;

/* Of a weight in doubles: so little that 113 bits would not tell more. */
static const double SMALL_DOUBT = 1e-12;

enum { CHUNK = 1024 };

/* Sums over a chunk of samples. */
struct sums {
    double most[2], squares[2]; /* of the least and of the greatest errors; these times the scale */
};

/* One thread's. */
struct worker {
    struct walker walker;
    uint32_t *near;
    size_t room;
    double *errors; /* [2 * field] of the current sample: the least and the greatest */
    double *measured; /* [field] of the sample; in the room of `errors` */
    bool failed;
};

struct ranges {
    const struct tetmesh *original, *level;
    const uint32_t *bodies;
    const uint8_t *counts; /* [tet of the original] */
    uint8_t *vertex_counts;
    struct locator locator;
    struct coarsening mesh; /* the level */
    double size; /* of the level: its diagonal */
    bool within; /* samples that a tetrahedron holds take its values only */
    /* the level is the original but for values: each sample is where it was, whatever else lies at the same point */
    bool in_place;
    const struct measure_levels *measured; /* or NULL */
    uint32_t *unclear_corners; /* [4 * ] of tetrahedra near which a sample may be in several, if there is `measured` */
    struct bvh unclear;
    struct sums *sums; /* [chunk][field] */
    double *scales;    /* [field] so that no square is too large or too small (tally.h) */
    struct worker *workers;
};

/* The current sample. */
struct sample {
    struct place place;
    double p[3];
    uint32_t body;
    bool held;
};

static void add_choice(struct worker *worker, uint32_t field, double least, double most)
{
    worker->errors[2 * field] = smaller(worker->errors[2 * field], least);
    worker->errors[2 * field + 1] = larger(worker->errors[2 * field + 1], most);
}

/* The sample takes the values of the level at a place, whose weights are wrong by `doubt` each at most. It is no
 * further off than the place's corner that is furthest off: a flat tetrahedron's weights say nothing. */
static void add_place(const struct ranges *r, struct worker *worker, const struct sample *sample,
                      const struct place *place, double doubt)
{
    for (uint32_t f = 0; f < r->original->field_count; f++) {
        const struct point_field *a = &r->original->fields[f], *b = &r->level->fields[f];
        double worst = 0, off = 0, corner = 0;
        for (uint32_t k = 0; k < a->components; k++) {
            double base = a->values[(size_t)sample->place.vertices[0] * a->components + k], spread = 0;
            double own = place_rise(a->values, a->components, k, &sample->place, base);
            for (int c = 0; c < 4 && doubt > 0; c++) {
                double value = b->values[(size_t)place->vertices[c] * a->components + k];
                spread = larger(spread, fabs(value - b->values[(size_t)place->vertices[0] * a->components + k]));
                corner = larger(corner, fabs(value - base - own) + 4 * spread * ON_FACE);
            }
            worst = larger(worst, fabs(place_rise(b->values, a->components, k, place, base) - own));
            off = larger(off, spread > 0 ? 4 * spread * doubt : 0);
        }
        double most = doubt > 0 ? smaller(worst + off, corner) : worst, least = worst - off > 0 ? worst - off : 0;
        add_choice(worker, f, smaller(least, most), most);
    }
}

static const double *position(const struct ranges *r, uint32_t v)
{
    return r->level->positions + 3 * (size_t)v;
}

/* Has the tetrahedron of the level all corners that the sample's place in the original is made of, where they were?
 * Then the sample is in it, though far from the origin, where a place has few digits, its position may say
 * otherwise. */
static bool is_own(const struct ranges *r, const struct sample *sample, const uint32_t corners[4])
{
    for (int c = 0; c < 4; c++) {
        uint32_t v = sample->place.vertices[c];
        bool has = v == corners[0] || v == corners[1] || v == corners[2] || v == corners[3];
        if (sample->place.weights[c] != 0 &&
            (!has || memcmp(position(r, v), r->original->positions + 3 * (size_t)v, 3 * sizeof(double)) != 0))
            return false;
    }
    return true;
}

/* What a weight in a tetrahedron may be wrong by: heights are at least the volume by the square of the longest edge. */
static double doubt_of(double volume6, double size2)
{
    return ON_FACE + 48 * DBL_EPSILON * sqrt(size2) * size2 / fabs(volume6);
}

/* The weights of a point in doubles. False: it is so far outside that no rounding can have put it there, as most
 * tetrahedra near a sample are. */
static bool weigh_roughly(const double *const q[4], const double p[3], double volume6, double doubt, double weights[4])
{
    for (int c = 0; c < 4; c++) {
        const double *corners[4] = {q[0], q[1], q[2], q[3]};
        corners[c] = p;
        weights[c] = tet_volume6(corners[0], corners[1], corners[2], corners[3]) / volume6;
        if (weights[c] < -2 * doubt)
            return false;
    }
    return true;
}

/* The same in 113 bits, for tetrahedra in which doubles say little. */
static void weigh_exactly(const double *const q[4], const double p[3], double weights[4])
{
    struct exact_map map;
    quad exact[4];
    exact_map_set(&map, q);
    exact_weights(&map, (const quad[3]){p[0], p[1], p[2]}, exact);
    for (int c = 0; c < 4; c++)
        weights[c] = (double)exact[c];
}

/* The tetrahedra that may hold the sample. */
static void try_tets(const struct ranges *r, struct worker *worker, struct sample *sample, uint32_t count)
{
    for (uint32_t i = 0; i < count; i++) {
        struct place place;
        const double *q[4];
        memcpy(place.vertices, r->level->corners + 4 * (size_t)worker->near[i], sizeof place.vertices);
        if (r->bodies[place.vertices[0]] != sample->body)
            continue;
        if (is_own(r, sample, place.vertices)) {
            add_place(r, worker, sample, &sample->place, 0);
            sample->held = true;
        }
        for (int c = 0; c < 4; c++) {
            q[c] = position(r, place.vertices[c]);
            if (memcmp(q[c], sample->p, sizeof sample->p) != 0)
                continue;
            struct place corner = {{place.vertices[c], 0, 0, 0}, {1, 0, 0, 0}};
            add_place(r, worker, sample, &corner, 0);
            sample->held = true;
        }
        double volume6 = tet_volume6(q[0], q[1], q[2], q[3]), size2 = tet_size_squared(q[0], q[1], q[2], q[3]),
               least = INFINITY;
        double doubt = doubt_of(volume6, size2);
        if (volume6 == 0 || !weigh_roughly(q, sample->p, volume6, doubt, place.weights))
            continue;
        if (doubt - ON_FACE > SMALL_DOUBT)
            weigh_exactly(q, sample->p, place.weights);
        else
            doubt += doubt - ON_FACE;
        for (int c = 0; c < 4; c++)
            least = smaller(least, place.weights[c]);
        if (!(least >= -doubt))
            continue;
        add_place(r, worker, sample, &place, doubt);
        sample->held = true;
    }
}

/* Is the box of a face further away than that? Most faces near a closest one are. */
static bool is_box_beyond(const double *const q[3], const double p[3], double distance)
{
    double sum = 0;
    for (int d = 0; d < 3; d++) {
        double low = smaller(smaller(q[0][d], q[1][d]), q[2][d]), high = larger(larger(q[0][d], q[1][d]), q[2][d]);
        double out = larger(larger(low - p[d], p[d] - high), 0);
        sum += out * out;
    }
    return sum > distance * distance;
}

/* The closest point of a face, if that may be the closest of all. */
static bool is_closest(const struct ranges *r, const struct sample *sample, uint32_t triangle, double distance,
                       struct place *out)
{
    const uint32_t *v = r->locator.surface.triangles + 3 * (size_t)triangle;
    const double *q[3] = {position(r, v[0]), position(r, v[1]), position(r, v[2])};
    const double limit = distance * (1 + 1e-9);
    *out = (struct place){{v[0], v[1], v[2], v[0]}, {0}};
    return r->bodies[v[0]] == sample->body && !is_box_beyond(q, sample->p, limit * (1 + 1e-9)) &&
           sqrt(triangle_distance2(sample->p, q[0], q[1], q[2], out->weights)) <= limit;
}

/* The faces that may be the closest. */
static void try_faces(const struct ranges *r, struct worker *worker, const struct sample *sample, double distance,
                      uint32_t count)
{
    for (uint32_t i = 0; i < count; i++) {
        struct place place;
        double normal[3], u[3], v[3];
        if (!is_closest(r, sample, worker->near[i], distance, &place))
            continue;
        const double *q[3] = {position(r, place.vertices[0]), position(r, place.vertices[1]),
                              position(r, place.vertices[2])};
        double size2 = larger(larger(distance_squared(q[0], q[1]), distance_squared(q[1], q[2])),
                              distance_squared(q[2], q[0]));
        subtract(q[1], q[0], u);
        subtract(q[2], q[0], v);
        cross(u, v, normal);
        double area2 = dot(normal, normal);
        double doubt = area2 > 0 ? ON_FACE + 64 * DBL_EPSILON * size2 * size2 / area2 : 1;
        add_place(r, worker, sample, &place, smaller(doubt, 1));
    }
}

/* Does the straight way from every point of the boundary that may be the closest lead to the sample? */
static bool is_reached(const struct ranges *r, struct worker *worker, const struct sample *sample, double distance,
                       uint32_t count)
{
    for (uint32_t i = 0; i < count; i++) {
        struct place closest;
        double start[3], weights[4];
        bool room;
        if (!is_closest(r, sample, worker->near[i], distance, &closest))
            continue;
        for (uint32_t d = 0; d < 3; d++)
            start[d] = place_value(r->level->positions, 3, d, &closest);
        uint32_t tet = r->locator.surface.faces[worker->near[i]] / 4;
        if (!walk_along(&worker->walker, tet, start, sample->p, weights, &room)) {
            worker->failed |= !room;
            return false;
        }
    }
    return true;
}

static bool find_near(const struct bvh *bvh, struct worker *worker, const double p[3], double reach,
                      uint32_t *out_count)
{
    double box[6];
    for (int d = 0; d < 3; d++) {
        box[d] = p[d] - reach;
        box[d + 3] = p[d] + reach;
    }
    *out_count = bvh_find_box(bvh, box, worker->near, (uint32_t)worker->room);
    if (*out_count <= worker->room)
        return true;
    worker->failed |= !ARRAY_RESERVE(worker->near, worker->room, *out_count);
    return !worker->failed && bvh_find_box(bvh, box, worker->near, (uint32_t)worker->room) == *out_count;
}

/* What was measured is what it is: no other tetrahedron may hold the sample with another value. */
static bool is_clear(const struct ranges *r, struct worker *worker, const struct sample *sample, size_t number,
                     double *measured)
{
    uint32_t count = 0;
    if (!r->measured || !measure_levels_sample(r->measured, number, measured) ||
        (r->unclear.count && (!find_near(&r->unclear, worker, sample->p, 1e-7 * r->size, &count) || count)))
        return false;
    for (uint32_t f = 0; f < r->original->field_count; f++) // rounded up to a float
        add_choice(worker, f, measured[f] * (1 - FLT_EPSILON), measured[f]);
    return true;
}

static void find_errors(const struct ranges *r, struct worker *worker, size_t number)
{
    struct sample sample = {.held = false};
    struct place closest;
    uint32_t count, face;
    sample_place(r->original, number, &sample.place);
    sample.body = r->bodies[sample.place.vertices[0]];
    for (uint32_t d = 0; d < 3; d++)
        sample.p[d] = place_value(r->original->positions, 3, d, &sample.place);
    for (uint32_t f = 0; f < r->original->field_count; f++) {
        worker->errors[2 * f] = INFINITY;
        worker->errors[2 * f + 1] = 0;
    }
    if (r->in_place) {
        add_place(r, worker, &sample, &sample.place, 0);
        return;
    }
    if (is_clear(r, worker, &sample, number, worker->measured))
        return;
    if (!find_near(&r->locator.tets, worker, sample.p, 1e-7 * r->size, &count))
        return;
    try_tets(r, worker, &sample, count);
    if (sample.held && r->within)
        return;
    double distance = mesh_surface_closest(&r->locator.surface, sample.body, sample.p, &closest, &face);
    if (face == TETLOD_NONE ||
        !find_near(&r->locator.surface.boxes, worker, sample.p, distance * (1 + 1e-9), &count) ||
        (sample.held && is_reached(r, worker, &sample, distance, count)))
        return;
    try_faces(r, worker, &sample, distance, count);
}

static void sum_chunk(void *context, unsigned number, size_t begin, size_t end)
{
    const struct ranges *r = context;
    struct worker *worker = &r->workers[number];
    uint32_t fields = r->original->field_count, vertices = r->original->vertex_count;
    struct sums *sums = r->sums + begin / CHUNK * fields;
    for (size_t i = begin; i < end; i++) {
        if (i < vertices ? !r->vertex_counts[i] : !r->counts[(i - vertices) / SAMPLES_PER_TET])
            continue;
        find_errors(r, worker, i);
        for (uint32_t f = 0; f < fields; f++)
            for (int side = 0; side < 2; side++) {
                double error = worker->errors[2 * f + (size_t)side];
                error = isfinite(error) ? error : side ? DBL_MAX : 0;
                sums[f].most[side] = larger(sums[f].most[side], error);
                sums[f].squares[side] += error * r->scales[f] * (error * r->scales[f]);
            }
    }
}

static void add_up(const struct ranges *r, size_t chunks, size_t counted, struct measured_range *out)
{
    uint32_t fields = r->original->field_count;
    for (uint32_t f = 0; f < fields; f++) {
        struct sums sum = {{0}, {0}};
        for (size_t i = 0; i < chunks; i++)
            for (int side = 0; side < 2; side++) {
                sum.most[side] = larger(sum.most[side], r->sums[i * fields + f].most[side]);
                sum.squares[side] += r->sums[i * fields + f].squares[side];
            }
        double by = counted ? (double)counted : 1;
        out[f].least = (struct measured){sum.most[0], sqrt(sum.squares[0] / by) / r->scales[f]};
        out[f].most = (struct measured){sum.most[1], sqrt(sum.squares[1] / by) / r->scales[f]};
    }
}

/* Which samples count: as measure_levels has it. Returns their number. */
static size_t find_counting(struct ranges *r, uint8_t *counts)
{
    const struct tetmesh *mesh = r->original;
    size_t counted = 0;
    for (size_t t = 0; t < mesh->tet_count; t++) {
        counts[t] = !sample_tet_is_degenerate(mesh, t);
        counted += SAMPLES_PER_TET * (size_t)counts[t];
        for (size_t i = 4 * t; i < 4 * t + 4; i++)
            r->vertex_counts[mesh->corners[i]] |= counts[t];
    }
    for (size_t v = 0; v < mesh->vertex_count; v++)
        counted += r->vertex_counts[v];
    r->counts = counts;
    return counted;
}

/* Tetrahedra of the level that are flat, or too thin for exact weights, or that lie over others: these are turned over,
 * or lie at one that is. */
static enum tetlod_status find_unclear(struct ranges *r, struct tetlod_error *error)
{
    const struct tetmesh *level = r->level;
    uint32_t count = 0, positive = 0;
    double *volumes = array_new(level->tet_count, sizeof *volumes);
    r->unclear_corners = array_new(level->tet_count, 4 * sizeof *r->unclear_corners);
    if (!volumes || !r->unclear_corners) {
        free(volumes);
        return tetlodi_fail_nomem(error, "the samples", level->tet_count * (uint64_t)24);
    }
    for (uint32_t t = 0; t < level->tet_count; t++) {
        volumes[t] = tet_volume6(mesh_corner(level, t, 0), mesh_corner(level, t, 1), mesh_corner(level, t, 2),
                                 mesh_corner(level, t, 3));
        positive += volumes[t] > 0;
    }
    double sign = 2 * (uint64_t)positive >= level->tet_count ? 1 : -1;
    for (uint32_t t = 0; t < level->tet_count; t++) {
        double size2 = tet_size_squared(mesh_corner(level, t, 0), mesh_corner(level, t, 1), mesh_corner(level, t, 2),
                                        mesh_corner(level, t, 3));
        if (!(sign * volumes[t] > 0) || doubt_of(volumes[t], size2) > 2 * ON_FACE)
            memcpy(r->unclear_corners + 4 * (size_t)count++, level->corners + 4 * (size_t)t, 4 * sizeof(uint32_t));
    }
    free(volumes);
    return count ? bvh_build(&r->unclear, level->positions, r->unclear_corners, count, 4, BVH_LEAF, error) : TETLOD_OK;
}

enum tetlod_status measure_range(const struct tetmesh *original, const uint32_t *bodies, const struct tetmesh *level,
                                 bool within, const struct measure_levels *measured, unsigned threads,
                                 struct measured_range *out, struct tetlod_error *error)
{
    uint32_t fields = original->field_count;
    size_t samples = sample_count(original), chunks = (samples + CHUNK - 1) / CHUNK;
    threads = threads < 1 ? 1 : threads > PARALLEL_MAX_THREADS ? PARALLEL_MAX_THREADS : threads;
    struct ranges r = {.original = original, .level = level, .bodies = bodies, .size = mesh_diagonal(level),
                       .within = within, .in_place = mesh_same_order(original, level), .measured = measured};
    uint8_t *counts = array_new(original->tet_count, 1);
    enum tetlod_status status = TETLOD_OK;
    r.vertex_counts = array_zero(original->vertex_count, 1);
    r.sums = array_zero(chunks * fields, sizeof *r.sums);
    r.workers = array_zero(threads, sizeof *r.workers);
    r.scales = array_new(fields, sizeof *r.scales);
    bool room = r.scales && counts && r.vertex_counts && r.sums && r.workers;
    for (unsigned i = 0; i < threads && room; i++)
        room = (r.workers[i].errors = array_new(3 * (size_t)fields, sizeof(double))) != NULL;
    if (!room)
        TETLOD_TRY_DONE(tetlodi_fail_nomem(error, "the samples", chunks * fields * sizeof *r.sums));
    for (unsigned i = 0; i < threads; i++)
        r.workers[i].measured = r.workers[i].errors + 2 * (size_t)fields;
    if (measured)
        TETLOD_TRY_DONE(find_unclear(&r, error));
    for (uint32_t f = 0; f < fields; f++) {
        double ranges[2][2];
        point_field_range(&original->fields[f], original->vertex_count, ranges[0]);
        point_field_range(&level->fields[f], level->vertex_count, ranges[1]);
        r.scales[f] = tally_scale(ranges[0], ranges[1]);
    }
    size_t counted = find_counting(&r, counts);
    TETLOD_TRY_DONE(locator_init(&r.locator, level->positions, level->vertex_count, level->corners, level->tet_count,
                                 error));
    r.locator.surface.bodies = bodies;
    TETLOD_TRY_DONE(coarsening_init(&r.mesh, level, NULL, error));
    TETLOD_TRY_DONE(coarsening_need_neighbours(&r.mesh, error));
    for (unsigned i = 0; i < threads; i++)
        TETLOD_TRY_DONE(walker_init(&r.workers[i].walker, &r.mesh, error));
    parallel_for(threads, samples, CHUNK, sum_chunk, &r);
    add_up(&r, chunks, counted, out);
    for (unsigned i = 0; i < threads; i++)
        if (r.workers[i].failed)
            status = tetlodi_fail_nomem(error, "the samples", r.workers[i].room * 8);
done:
    for (unsigned i = 0; i < threads && r.workers; i++) {
        walker_fini(&r.workers[i].walker);
        free(r.workers[i].errors);
        free(r.workers[i].near);
    }
    locator_fini(&r.locator);
    bvh_fini(&r.unclear);
    free(r.unclear_corners);
    free(counts);
    free(r.vertex_counts);
    free(r.sums);
    free(r.scales);
    coarsening_fini(&r.mesh);
    free(r.workers);
    return status;
}
