/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/measure/measure.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "format/fail.h"
#include "src/measure/tally.h"
#include "src/mesh/locate.h"
#include "src/mesh/sample_points.h"
#include "src/mesh/tet_geom.h"
#include "src/util/array.h"
#include "src/util/parallel.h"

enum { MAX_OVERLAP = 128, CHUNK = 4096 };

struct measure {
    const struct tetmesh *original; /* borrowed */
    const uint32_t *fields;         /* [field_count] of the original, or NULL: all in order */
    uint32_t field_count;
    uint8_t *counts;        /* [sample] the original has an interpolant there */
    uint8_t *ambiguous;     /* [sample] the original may have several values there */
    struct locator locator; /* of the original */
};

/* The current comparison. */
struct comparison {
    const struct measure *measure;
    const struct tetmesh *level;
    const uint32_t *level_fields; /* NULL: all in order */
    struct locator locator;       /* of the level */
    double *scales;               /* [field] of the tallies */
    size_t chunks;
    struct tally *tallies;        /* [field][chunk] */
    double *errors;               /* [thread][field * (TALLY_CHUNK + 1)] of a chunk's samples, and of one */
    double enough;                /* of the domain error: smaller distances do not matter */
    const uint32_t *points;       /* of the current half of the domain error */
    const struct tetmesh *from;
    const struct mesh_surface *to;
    double *distances;
};

static const struct point_field *original_field(const struct measure *measure, uint32_t f)
{
    return &measure->original->fields[measure->fields ? measure->fields[f] : f];
}

static const struct point_field *level_field(const struct comparison *c, uint32_t f)
{
    return &c->level->fields[c->level_fields ? c->level_fields[f] : f];
}

double mesh_diagonal(const struct tetmesh *mesh)
{
    double sum = 0;
    for (int d = 0; d < 3; d++) {
        double least = INFINITY, greatest = -INFINITY;
        for (size_t v = 0; v < mesh->vertex_count; v++) {
            least = smaller(least, mesh->positions[3 * v + d]);
            greatest = larger(greatest, mesh->positions[3 * v + d]);
        }
        sum += mesh->vertex_count ? (greatest - least) * (greatest - least) : 0;
    }
    return sqrt(sum);
}

/* ---- one sample */

/* The difference at a place of the original and one of the level, largest over components, for each field: taken if it
 * is the least so far, for where a mesh overlaps itself or is double valued any of its values will do. */
static void compare_places(const struct comparison *c, const struct place *original, const struct place *level,
                           bool first, double *errors)
{
    for (uint32_t f = 0; f < c->measure->field_count; f++) {
        const struct point_field *a = original_field(c->measure, f), *b = level_field(c, f);
        double worst = 0;
        for (uint32_t k = 0; k < a->components; k++) {
            double base = a->values[(size_t)original->vertices[0] * a->components + k];
            worst = larger(worst, fabs(place_rise(b->values, b->components, k, level, base) -
                                       place_rise(a->values, a->components, k, original, base)));
        }
        if (first || worst < errors[f])
            errors[f] = worst;
    }
}

/* Well inside: no other tetrahedron has the point, unless the mesh overlaps itself. */
static bool strictly_inside(const double weights[4])
{
    return weights[0] > 1e-6 && weights[1] > 1e-6 && weights[2] > 1e-6 && weights[3] > 1e-6;
}

/* `near` is a tetrahedron of the level in which to begin to look; the one in which the sample was found becomes it. */
static void compare_sample(const struct comparison *c, size_t sample, uint32_t *near, double *errors)
{
    const struct measure *measure = c->measure;
    struct place original, level;
    double p[3];
    sample_place(measure->original, sample, &original);
    for (int d = 0; d < 3; d++)
        p[d] = place_value(measure->original->positions, 3, (uint32_t)d, &original);
    uint32_t found = measure->ambiguous[sample] ? TETLOD_NONE : locator_walk(&c->locator, *near, p, level.weights);
    if (found != TETLOD_NONE && strictly_inside(level.weights)) {
        memcpy(level.vertices, c->level->corners + 4 * (size_t)found, sizeof level.vertices);
        compare_places(c, &original, &level, true, errors);
        *near = found;
        return;
    }
    uint32_t tets[MAX_OVERLAP], count = locator_find(&c->locator, p, tets, MAX_OVERLAP);
    for (uint32_t i = 0; i < count; i++) {
        locator_weights(&c->locator, tets[i], p, level.weights);
        memcpy(level.vertices, c->level->corners + 4 * (size_t)tets[i], sizeof level.vertices);
        compare_places(c, &original, &level, i == 0, errors);
    }
    *near = count ? tets[0] : *near;
    if (count)
        return;
    locator_closest(&c->locator, p, &level);
    compare_places(c, &original, &level, true, errors);
}

static void compare_samples(void *context, unsigned worker, size_t begin, size_t end)
{
    const struct comparison *c = context;
    uint32_t near = 0, fields = c->measure->field_count;
    double *errors = c->errors + (size_t)worker * fields * (TALLY_CHUNK +
                                                            1), *one = errors + fields * (size_t)TALLY_CHUNK;
    memset(errors, 0, (size_t)fields * TALLY_CHUNK * sizeof *errors);
    for (size_t sample = begin; sample < end; sample++) {
        if (!c->measure->counts[sample])
            continue;
        compare_sample(c, sample, &near, one);
        for (uint32_t f = 0; f < fields; f++)
            errors[f * TALLY_CHUNK + sample - begin] = one[f];
    }
    for (uint32_t f = 0; f < fields; f++)
        tally_add_up(errors + f * TALLY_CHUNK, end - begin, c->scales[f],
                     &c->tallies[f * c->chunks + begin / TALLY_CHUNK]);
}

static void summarise(const struct comparison *c, struct measured *out)
{
    size_t counted = 0;
    uint32_t fields = c->measure->field_count;
    for (size_t sample = 0; sample < sample_count(c->measure->original); sample++)
        counted += c->measure->counts[sample];
    for (uint32_t f = 0; f < fields; f++)
        tally_result(c->tallies + f * c->chunks, c->chunks, c->scales[f], counted, &out[f].sampled, &out[f].rms);
}

/* ---- domain error */

static void measure_distances(void *context, unsigned worker, size_t begin, size_t end)
{
    const struct comparison *c = context;
    uint32_t face;
    (void)worker;
    for (size_t i = begin; i < end; i++)
        c->distances[i] = mesh_surface_distance(c->to, 0, c->from->positions + 3 * (size_t)c->points[i], c->enough,
                                                &face);
}

/* Appends the vertices of a mesh's boundary, once each. */
static enum tetlod_status boundary_vertices(const struct tetmesh *mesh, const struct mesh_surface *surface,
                                            uint32_t *out,
                                            uint32_t *out_count, struct tetlod_error *error)
{
    uint8_t *seen = array_zero(mesh->vertex_count, 1);
    *out_count = 0;
    if (!seen)
        return tetlodi_fail_nomem(error, "the boundary", mesh->vertex_count);
    for (size_t i = 0; i < 3 * (size_t)surface->count; i++) {
        uint32_t v = surface->triangles[i];
        if (!seen[v])
            out[(*out_count)++] = v;
        seen[v] = 1;
    }
    free(seen);
    return TETLOD_OK;
}

/* Raises *io_most to the largest distance of a mesh's boundary vertices from the other's boundary. */
static enum tetlod_status largest_distance(struct comparison *c, const struct tetmesh *from,
                                           const struct mesh_surface *of,
                                           const struct mesh_surface *to, unsigned threads, double *io_most,
                                           struct tetlod_error *error)
{
    uint32_t count = 0, *points = array_new(from->vertex_count, sizeof *points);
    enum tetlod_status status = TETLOD_OK;
    c->distances = array_new(from->vertex_count, sizeof *c->distances);
    if (!points || !c->distances)
        TETLOD_TRY_DONE(tetlodi_fail_nomem(error, "distances", 12 * (uint64_t)from->vertex_count));
    TETLOD_TRY_DONE(boundary_vertices(from, of, points, &count, error));
    c->enough = *io_most;
    c->from = from;
    c->to = to;
    c->points = points;
    parallel_for(threads, count, 256, measure_distances, c);
    for (uint32_t i = 0; i < count; i++)
        *io_most = larger(*io_most, c->distances[i]);
done:
    free(points);
    free(c->distances);
    return status;
}

/* ---- the original */

void measure_free(struct measure *measure)
{
    if (!measure)
        return;
    free(measure->counts);
    free(measure->ambiguous);
    locator_fini(&measure->locator);
    free(measure);
}

static void find_counting(struct measure *measure)
{
    const struct tetmesh *mesh = measure->original;
    uint8_t *of_tets = measure->counts + mesh->vertex_count;
    for (size_t t = 0; t < mesh->tet_count; t++) {
        uint8_t counts = !sample_tet_is_degenerate(mesh, t);
        of_tets[SAMPLES_PER_TET * t] = of_tets[SAMPLES_PER_TET * t + 1] = counts;
        for (size_t i = 4 * t; i < 4 * t + 4; i++)
            measure->counts[mesh->corners[i]] |= counts;
    }
}

/* Vertices that are well inside a tetrahedron; samples inside one that are well inside another, too, or in none
 * well. */
static void look_for_overlap(void *context, unsigned worker, size_t begin, size_t end)
{
    struct measure *measure = context;
    (void)worker;
    for (size_t i = begin; i < end; i++) {
        struct place place;
        uint32_t tets[MAX_OVERLAP], inside = 0;
        double p[3], weights[4];
        if (!measure->counts[i])
            continue;
        sample_place(measure->original, i, &place);
        for (int d = 0; d < 3; d++)
            p[d] = place_value(measure->original->positions, 3, (uint32_t)d, &place);
        uint32_t count = locator_find(&measure->locator, p, tets, MAX_OVERLAP);
        for (uint32_t k = 0; k < count; k++) {
            locator_weights(&measure->locator, tets[k], p, weights);
            inside += strictly_inside(weights);
        }
        measure->ambiguous[i] |= inside != (i >= measure->original->vertex_count);
    }
}

/* Ambiguous are samples where the original overlaps itself, and all around tetrahedra without an interpolant, across
 * which its field may jump. */
static void find_ambiguous(struct measure *measure, unsigned threads)
{
    const struct tetmesh *mesh = measure->original;
    parallel_for(threads, mesh->vertex_count + SAMPLES_PER_TET * (size_t)mesh->tet_count, CHUNK, look_for_overlap,
                 measure);
    uint8_t *of_tets = measure->ambiguous + mesh->vertex_count, *counts = measure->counts + mesh->vertex_count;
    for (int round = 0; round < 3; round++) // from tetrahedra to vertices to tetrahedra to vertices
        for (size_t c = 0; c < 4 * (size_t)mesh->tet_count; c++) {
            size_t first = c / 4 * SAMPLES_PER_TET;
            uint8_t *vertex = &measure->ambiguous[mesh->corners[c]], *tet = of_tets + first;
            if (round % 2 == 0)
                *vertex |= (uint8_t)!counts[first] | tet[0] | tet[1];
            else
                tet[0] = tet[1] |= *vertex;
        }
}

enum tetlod_status measure_new(struct measure **out, const struct tetmesh *original, const uint32_t *fields,
                               uint32_t field_count, unsigned threads, struct tetlod_error *error)
{
    size_t samples = sample_count(original);
    struct measure *measure = array_zero(1, sizeof *measure);
    enum tetlod_status status = TETLOD_OK;
    *out = NULL;
    if (!measure)
        return tetlodi_fail_nomem(error, "samples", sizeof *measure);
    *measure = (struct measure){.original = original,
                                .fields = fields,
                                .field_count = field_count,
                                .counts = array_zero(samples, 1),
                                .ambiguous = array_zero(samples, 1)};
    if (!measure->counts || !measure->ambiguous)
        TETLOD_TRY_DONE(tetlodi_fail_nomem(error, "samples", 2 * (uint64_t)samples));
    TETLOD_TRY_DONE(locator_init(&measure->locator, original->positions, original->vertex_count, original->corners,
                                 original->tet_count, error));
    find_counting(measure);
    find_ambiguous(measure, threads);
    *out = measure;
done:
    if (status != TETLOD_OK)
        measure_free(measure);
    return status;
}

/* ---- the comparison */

static void set_scales(const struct comparison *c)
{
    for (uint32_t f = 0; f < c->measure->field_count; f++) {
        double ranges[2][2];
        point_field_range(original_field(c->measure, f), c->measure->original->vertex_count, ranges[0]);
        point_field_range(level_field(c, f), c->level->vertex_count, ranges[1]);
        c->scales[f] = tally_scale(ranges[0], ranges[1]);
    }
}

enum tetlod_status measure_mesh(const struct measure *measure, const struct tetmesh *mesh, const uint32_t *fields,
                                unsigned threads, struct measured *out, double *out_domain, struct tetlod_error *error)
{
    const struct tetmesh *original = measure->original;
    threads = threads < 1 ? 1 : threads > PARALLEL_MAX_THREADS ? PARALLEL_MAX_THREADS : threads;
    struct comparison c = {.measure = measure,
                           .level = mesh,
                           .level_fields = fields,
                           .scales = array_new(measure->field_count, sizeof(double)),
                           .chunks = tally_chunks(sample_count(original)),
                           .errors = array_new(threads * (size_t)measure->field_count,
                                               (TALLY_CHUNK + 1) * sizeof(double))};
    c.tallies = array_new(c.chunks * measure->field_count, sizeof(struct tally));
    enum tetlod_status status = TETLOD_OK;
    *out_domain = 0;
    if (!c.scales || !c.tallies || !c.errors)
        TETLOD_TRY_DONE(tetlodi_fail_nomem(error, "sums",
                                           threads * (uint64_t)measure->field_count * sizeof(struct tally)));
    set_scales(&c);
    TETLOD_TRY_DONE(locator_init(&c.locator, mesh->positions, mesh->vertex_count, mesh->corners, mesh->tet_count,
                                 error));
    parallel_for(threads, sample_count(original), TALLY_CHUNK, compare_samples, &c);
    summarise(&c, out);
    TETLOD_TRY_DONE(largest_distance(&c, original, &measure->locator.surface, &c.locator.surface, threads, out_domain,
                                     error));
    status = largest_distance(&c, mesh, &c.locator.surface, &measure->locator.surface, threads, out_domain, error);
done:
    locator_fini(&c.locator);
    free(c.scales);
    free(c.tallies);
    free(c.errors);
    return status;
}
