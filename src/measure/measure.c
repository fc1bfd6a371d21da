/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/measure/measure.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "format/fail.h"
#include "src/log/ancestry.h"
#include "src/mesh/locate.h"
#include "src/mesh/tet_geom.h"
#include "src/util/array.h"
#include "src/util/parallel.h"

/* Samples 0 .. vertices-1 are the vertices; tetrahedron t has MEASURE_PER_TET more. */
enum { MOST_OVERLAP = 128, CHUNK = 4096 };

struct measure {
    const struct tetmesh *original; /* borrowed */
    const uint32_t *fields;         /* [field_count] of the original, or NULL: all in order */
    uint32_t field_count;
    size_t sample_count;
    double *errors;     /* [field_count * sample] */
    uint32_t *hosts;    /* [sample] original tetrahedron whose image held the sample last, or TETLOD_NONE */
    uint8_t *degenerate; /* [tet] */
    uint8_t *hollow;     /* [vertex] all of its tetrahedra are degenerate: no interpolant has its value */
    uint32_t contractions;
    uint32_t *nearest;      /* [vertex] 4 * tet + face that became the level's boundary near this vertex of the original's, or
                               TETLOD_NONE */
    double domain;          /* the largest domain error of the sequence's levels so far */
    struct locator locator; /* of the original */
    uint8_t *ambiguous; /* [sample] the original may have several values there; NULL: not known yet */
};

/* One comparison at hand. */
struct comparison {
    struct measure *measure;
    const struct tetmesh *level;
    const uint32_t *level_fields;     /* NULL: all in order */
    const struct ancestry_level *ancestry; /* NULL: the meshes have nothing in common */
    uint8_t *unchanged;               /* [original tet] its image looks as it did at the last level */
    struct locator locator;           /* of the level */
    double enough;                    /* of the domain error: smaller distances do not matter */
    const uint32_t *points;           /* of the domain error's half at hand */
    const struct tetmesh *from;
    double *distances;
};

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

/* ---- samples */

static uint64_t mix(uint64_t x) // splitmix64's finaliser
{
    x += 0x9e3779b97f4a7c15ull;
    x = (x ^ x >> 30) * 0xbf58476d1ce4e5b9ull;
    x = (x ^ x >> 27) * 0x94d049bb133111ebull;
    return x ^ x >> 31;
}

/* A number that depends on a position only, -0 being 0. */
static uint64_t position_hash(const double p[3])
{
    const double plain[3] = {p[0] + 0.0, p[1] + 0.0, p[2] + 0.0};
    uint64_t bits[3];
    memcpy(bits, plain, sizeof bits);
    return mix(bits[0] + 0x9e3779b97f4a7c15ull * bits[1] + 0xc2b2ae3d27d4eb4full * bits[2]);
}

void measure_sample_weights(const struct tetmesh *mesh, const uint32_t corners[4], unsigned which, double weights[4])
{
    uint64_t hashes[4], sum = 0;
    double total = 0;
    for (int i = 0; i < 4; i++)
        weights[i] = 0.25;
    if (!which)
        return;
    for (int i = 0; i < 4; i++)
        sum += hashes[i] = position_hash(mesh->positions + 3 * (size_t)corners[i]);
    for (int i = 0; i < 4; i++)
        total += weights[i] = (double)((mix(hashes[i] + mix(sum)) >> 11) + 1);
    for (int i = 0; i < 4; i++)
        weights[i] /= total;
}

/* Has the original an interpolant there? */
static bool sample_counts(const struct measure *measure, size_t sample)
{
    size_t vertices = measure->original->vertex_count;
    return sample < vertices ? !measure->hollow[sample] : !measure->degenerate[(sample - vertices) / MEASURE_PER_TET];
}

/* The sample as a place in the original. */
static void sample_place(const struct measure *measure, size_t sample, struct place *out)
{
    const struct tetmesh *mesh = measure->original;
    *out = (struct place){{0}, {0}};
    if (sample < mesh->vertex_count) {
        out->vertices[0] = (uint32_t)sample;
        out->weights[0] = 1;
        return;
    }
    size_t k = sample - mesh->vertex_count;
    memcpy(out->vertices, mesh->corners + 4 * (k / MEASURE_PER_TET), sizeof out->vertices);
    measure_sample_weights(mesh, out->vertices, k % MEASURE_PER_TET, out->weights);
}

static double place_value(const double *values, uint32_t width, uint32_t component, const struct place *place)
{
    double sum = 0;
    for (int i = 0; i < 4; i++)
        sum += place->weights[i] * values[(size_t)place->vertices[i] * width + component];
    return sum;
}

/* A field there, less a value: so that rounding is about what varies, not about how far from zero it does. */
static double place_rise(const struct point_field *field, uint32_t component, const struct place *place, double base)
{
    double sum = 0;
    for (int i = 0; i < 4; i++)
        sum += place->weights[i] * (field->values[(size_t)place->vertices[i] * field->components + component] - base);
    return sum;
}

/* ---- one sample */

/* The difference at a place of the original and one of the level, largest over components, for each field: taken if it is
 * the least so far, for where a mesh overlaps itself or is double valued any of its values will do. */
static void compare_places(const struct comparison *c, const struct place *original, const struct place *level,
                           bool first, double *errors)
{
    const struct measure *measure = c->measure;
    for (uint32_t f = 0; f < measure->field_count; f++) {
        const struct point_field *a = &measure->original->fields[measure->fields ? measure->fields[f] : f];
        const struct point_field *b = &c->level->fields[c->level_fields ? c->level_fields[f] : f];
        double worst = 0;
        for (uint32_t k = 0; k < a->components; k++) {
            double base = a->values[(size_t)original->vertices[0] * a->components + k];
            worst = larger(worst, fabs(place_rise(b, k, level, base) - place_rise(a, k, original, base)));
        }
        if (first || worst < errors[f])
            errors[f] = worst;
    }
}

/* Which of the original's tetrahedra look as they did at the last level? */
static void find_unchanged(struct comparison *c)
{
    uint32_t last = c->measure->original->vertex_count + c->measure->contractions;
    memset(c->unchanged, 0, c->measure->original->tet_count);
    for (uint32_t t = 0; t < c->level->tet_count; t++) {
        bool unchanged = true;
        for (int i = 0; i < 4; i++)
            unchanged &= c->ancestry->nodes[c->level->corners[4 * (size_t)t + i]] < last;
        c->unchanged[c->ancestry->origin[t]] = unchanged;
    }
}

/* Is the sample's error what it was? A vertex that is still there has none, whatever else lies at the same point. */
static bool settled(const struct comparison *c, size_t sample)
{
    if (!c->ancestry)
        return false;
    if (sample < c->measure->original->vertex_count && c->ancestry->nodes[c->ancestry->standing[sample]] == sample)
        return true;
    uint32_t host = c->measure->hosts[sample];
    return host != TETLOD_NONE && c->unchanged[host];
}

/* Well inside: no other tetrahedron has the point, unless the mesh overlaps itself. */
static bool strictly_inside(const double weights[4])
{
    return weights[0] > 1e-6 && weights[1] > 1e-6 && weights[2] > 1e-6 && weights[3] > 1e-6;
}

/* A tetrahedron of the level that is near the sample: the image of what held it last, or one at the living ancestor of that
 * one's, or the sample's own, first vertex. */
static uint32_t walk_start(const struct comparison *c, size_t sample)
{
    const struct measure *measure = c->measure;
    uint32_t host = measure->hosts[sample], vertex = (uint32_t)sample;
    if (host != TETLOD_NONE && c->ancestry->image[host] != TETLOD_NONE)
        return c->ancestry->image[host];
    if (host == TETLOD_NONE && sample >= measure->original->vertex_count)
        host = (uint32_t)((sample - measure->original->vertex_count) / MEASURE_PER_TET);
    if (host != TETLOD_NONE)
        vertex = measure->original->corners[4 * (size_t)host];
    return c->locator.tet_of[c->ancestry->standing[vertex]];
}

/* `near` is a tetrahedron of the level in which to begin to look; the one in which the sample was found becomes it. */
static void compare_sample(const struct comparison *c, size_t sample, uint32_t *near)
{
    struct measure *measure = c->measure;
    double *errors = measure->errors + sample * measure->field_count;
    struct place original, level;
    if (!sample_counts(measure, sample) || settled(c, sample))
        return;
    double p[3];
    sample_place(measure, sample, &original);
    for (int d = 0; d < 3; d++)
        p[d] = place_value(measure->original->positions, 3, (uint32_t)d, &original);
    uint32_t found = TETLOD_NONE;
    if (c->ancestry || !measure->ambiguous[sample])
        found = locator_walk(&c->locator, c->ancestry ? walk_start(c, sample) : *near, p, level.weights);
    measure->hosts[sample] = TETLOD_NONE;
    if (found != TETLOD_NONE && (c->ancestry || strictly_inside(level.weights))) {
        memcpy(level.vertices, c->level->corners + 4 * (size_t)found, sizeof level.vertices);
        compare_places(c, &original, &level, true, errors);
        *near = found;
        measure->hosts[sample] = c->ancestry ? c->ancestry->origin[found] : TETLOD_NONE;
        return;
    }
    uint32_t tets[MOST_OVERLAP], count = locator_find(&c->locator, p, tets, MOST_OVERLAP);
    for (uint32_t i = 0; i < count; i++) {
        locator_weights(&c->locator, tets[i], p, level.weights);
        memcpy(level.vertices, c->level->corners + 4 * (size_t)tets[i], sizeof level.vertices);
        compare_places(c, &original, &level, i == 0, errors);
    }
    *near = count ? tets[0] : *near;
    if (!count) {
        locator_closest(&c->locator, p, &level);
        compare_places(c, &original, &level, true, errors);
    }
}

static void compare_samples(void *context, unsigned worker, size_t begin, size_t end)
{
    (void)worker;
    uint32_t near = 0;
    for (size_t sample = begin; sample < end; sample++)
        compare_sample(context, sample, &near);
}

static void summarise(const struct measure *measure, struct measured *out)
{
    size_t counted = 0;
    memset(out, 0, measure->field_count * sizeof *out);
    for (size_t sample = 0; sample < measure->sample_count; sample++) {
        const double *errors = measure->errors + sample * measure->field_count;
        if (!sample_counts(measure, sample))
            continue;
        counted++;
        for (uint32_t f = 0; f < measure->field_count; f++) {
            if (errors[f] > out[f].sampled) { // in units of the largest so far, whose square may be no number
                double shrink = out[f].sampled / errors[f];
                out[f].rms *= shrink * shrink;
                out[f].sampled = errors[f];
            }
            double part = out[f].sampled > 0 ? errors[f] / out[f].sampled : 0;
            out[f].rms += part * part;
        }
    }
    for (uint32_t f = 0; f < measure->field_count; f++)
        out[f].rms = counted ? out[f].sampled * sqrt(out[f].rms / (double)counted) : 0;
}

/* ---- domain error */

/* The original's boundary remembers which face of its tetrahedra has become the one that is near. */
static double distance_to_level(const struct comparison *c, uint32_t v)
{
    uint32_t *nearest = &c->measure->nearest[v], face = *nearest;
    if (c->ancestry && face != TETLOD_NONE) {
        if (c->unchanged[face / 4])
            return 0; // or what it was at the last level
        uint32_t tet = c->ancestry->image[face / 4];
        face = tet == TETLOD_NONE ? tet : 4 * tet + face % 4;
    }
    double distance = locator_distance(&c->locator, c->measure->original->positions + 3 * (size_t)v, c->enough, &face);
    *nearest = !c->ancestry || face == TETLOD_NONE ? TETLOD_NONE : 4 * c->ancestry->origin[face / 4] + face % 4;
    return distance;
}

static void measure_distances(void *context, unsigned worker, size_t begin, size_t end)
{
    (void)worker;
    const struct comparison *c = context;
    for (size_t i = begin; i < end; i++) {
        uint32_t v = c->points[i], face = TETLOD_NONE;
        c->distances[i] = c->from == c->level ? locator_distance(&c->measure->locator, c->level->positions + 3 * (size_t)v,
                                                                 c->enough, &face)
                                              : distance_to_level(c, v);
    }
}

/* Has a boundary vertex of either mesh no distance, or one that counted at the last level? Vertices that the contractions have left
 * where they were are in both boundaries; others of the level were made once. */
static bool counted(const struct comparison *c, const struct tetmesh *from, uint32_t v)
{
    uint32_t vertices = c->measure->original->vertex_count;
    if (!c->ancestry)
        return false;
    if (from == c->level)
        return c->ancestry->nodes[v] < vertices + c->measure->contractions;
    return c->ancestry->nodes[c->ancestry->standing[v]] == v;
}

/* Appends the vertices of a mesh's boundary, once each, but for those that have counted. */
static enum tetlod_status boundary_vertices(const struct comparison *c, const struct tetmesh *mesh,
                                            const struct locator *locator, uint32_t *out, uint32_t *out_count,
                                            struct tetlod_error *error)
{
    uint8_t *seen = array_zero(mesh->vertex_count, 1);
    *out_count = 0;
    if (!seen)
        return tetlodi_fail_nomem(error, "the boundary", mesh->vertex_count);
    for (size_t i = 0; i < 3 * (size_t)locator->triangle_count; i++) {
        uint32_t v = locator->triangles[i];
        if (!seen[v] && !counted(c, mesh, v))
            out[(*out_count)++] = v;
        seen[v] = 1;
    }
    free(seen);
    return TETLOD_OK;
}

/* Raises *io_most to the largest distance of a mesh's boundary vertices from the other's boundary. */
static enum tetlod_status largest_distance(struct comparison *c, const struct tetmesh *from, const struct locator *of,
                                           unsigned threads, double *io_most, struct tetlod_error *error)
{
    uint32_t count = 0, *points = array_new(from->vertex_count, sizeof *points);
    enum tetlod_status status = TETLOD_OK;
    c->distances = array_new(from->vertex_count, sizeof *c->distances);
    if (!points || !c->distances)
        TETLOD_TRY_DONE(tetlodi_fail_nomem(error, "distances", 12 * (uint64_t)from->vertex_count));
    TETLOD_TRY_DONE(boundary_vertices(c, from, of, points, &count, error));
    c->enough = *io_most;
    c->from = from;
    c->points = points;
    parallel_for(threads, count, 256, measure_distances, c);
    for (uint32_t i = 0; i < count; i++)
        *io_most = larger(*io_most, c->distances[i]);
done:
    free(points);
    free(c->distances);
    return status;
}

static enum tetlod_status domain_error(struct comparison *c, unsigned threads, double *io_most, struct tetlod_error *error)
{
    struct measure *measure = c->measure;
    *io_most = larger(*io_most, measure->domain);
    TETLOD_TRY(largest_distance(c, measure->original, &measure->locator, threads, io_most, error));
    TETLOD_TRY(largest_distance(c, c->level, &c->locator, threads, io_most, error));
    measure->domain = c->ancestry ? *io_most : 0;
    return TETLOD_OK;
}

/* ---- the whole */

void measure_free(struct measure *measure)
{
    if (!measure)
        return;
    free(measure->errors);
    free(measure->hosts);
    free(measure->degenerate);
    free(measure->hollow);
    free(measure->ambiguous);
    free(measure->nearest);
    locator_fini(&measure->locator);
    free(measure);
}

enum tetlod_status measure_new(struct measure **out, const struct tetmesh *original, const uint32_t *fields,
                               uint32_t field_count, struct tetlod_error *error)
{
    size_t samples = original->vertex_count + MEASURE_PER_TET * (size_t)original->tet_count;
    struct measure *measure = array_zero(1, sizeof *measure);
    *out = NULL;
    if (!measure)
        return tetlodi_fail_nomem(error, "samples", sizeof *measure);
    *measure = (struct measure){.original = original,
                                .fields = fields,
                                .field_count = field_count,
                                .sample_count = samples,
                                .errors = array_zero(samples * field_count, sizeof(double)),
                                .hosts = array_new(samples, sizeof(uint32_t)),
                                .nearest = array_new(original->vertex_count, sizeof(uint32_t)),
                                .degenerate = array_zero(original->tet_count, 1),
                                .hollow = array_new(original->vertex_count, 1)};
    enum tetlod_status status = TETLOD_OK;
    if (!measure->errors || !measure->hosts || !measure->nearest || !measure->degenerate || !measure->hollow)
        status = tetlodi_fail_nomem(error, "samples", samples * (8 * (uint64_t)field_count + 4));
    if (status == TETLOD_OK)
        status = locator_init(&measure->locator, original->positions, original->vertex_count, original->corners,
                              original->tet_count, error);
    if (status != TETLOD_OK) {
        measure_free(measure);
        return status;
    }
    memset(measure->hollow, 1, original->vertex_count);
    memset(measure->nearest, 0xff, original->vertex_count * sizeof(uint32_t));
    for (size_t t = 0; t < original->tet_count; t++) {
        const uint32_t *corners = original->corners + 4 * t;
        const double *p[4];
        for (int c = 0; c < 4; c++)
            p[c] = original->positions + 3 * (size_t)corners[c];
        measure->degenerate[t] = tet_orientation(p[0], p[1], p[2], p[3]) == 0;
        for (int c = 0; c < 4 && !measure->degenerate[t]; c++)
            measure->hollow[corners[c]] = 0;
    }
    for (size_t sample = 0; sample < samples; sample++)
        measure->hosts[sample] = sample < original->vertex_count
                                     ? TETLOD_NONE
                                     : (uint32_t)((sample - original->vertex_count) / MEASURE_PER_TET);
    *out = measure;
    return TETLOD_OK;
}

/* Samples inside a tetrahedron that are well inside another one, too, or in none well. */
static void look_for_overlap(void *context, unsigned worker, size_t begin, size_t end)
{
    struct measure *measure = context;
    (void)worker;
    for (size_t i = begin; i < end; i++) {
        size_t sample = measure->original->vertex_count + i;
        struct place place;
        uint32_t tets[MOST_OVERLAP], inside = 0;
        double p[3], weights[4];
        if (!sample_counts(measure, sample))
            continue;
        sample_place(measure, sample, &place);
        for (int d = 0; d < 3; d++)
            p[d] = place_value(measure->original->positions, 3, (uint32_t)d, &place);
        uint32_t count = locator_find(&measure->locator, p, tets, MOST_OVERLAP);
        for (uint32_t k = 0; k < count; k++) {
            locator_weights(&measure->locator, tets[k], p, weights);
            inside += strictly_inside(weights);
        }
        measure->ambiguous[sample] |= inside != 1;
    }
}

/* Ambiguous are samples where the original overlaps itself, and all around tetrahedra without an interpolant, across which its
 * field may jump. */
static enum tetlod_status find_ambiguous(struct measure *measure, unsigned threads, struct tetlod_error *error)
{
    const struct tetmesh *mesh = measure->original;
    measure->ambiguous = array_zero(measure->sample_count, 1);
    if (!measure->ambiguous)
        return tetlodi_fail_nomem(error, "samples", measure->sample_count);
    parallel_for(threads, measure->sample_count - mesh->vertex_count, CHUNK, look_for_overlap, measure);
    uint8_t *of_tets = measure->ambiguous + mesh->vertex_count;
    for (int round = 0; round < 3; round++) // from tetrahedra to vertices to tetrahedra to vertices
        for (size_t c = 0; c < 4 * (size_t)mesh->tet_count; c++) {
            uint8_t *vertex = &measure->ambiguous[mesh->corners[c]], *tet = of_tets + c / 4 * MEASURE_PER_TET;
            if (round % 2 == 0)
                *vertex |= measure->degenerate[c / 4] | tet[0] | tet[1];
            else
                tet[0] = tet[1] |= *vertex;
        }
    return TETLOD_OK;
}

static enum tetlod_status compare(struct comparison *c, unsigned threads, struct measured *out, double *io_domain,
                                  struct tetlod_error *error)
{
    parallel_for(threads, c->measure->sample_count, CHUNK, compare_samples, c);
    summarise(c->measure, out);
    return domain_error(c, threads, io_domain, error);
}

/* The level's tetrahedra lie where the original's do: its locator takes over their order. */
static enum tetlod_status locate_level(struct comparison *c, unsigned threads, struct tetlod_error *error)
{
    const struct tetmesh *level = c->level;
    const struct bvh *original = &c->measure->locator.tets;
    if (!c->ancestry->neighbours)
        return locator_init(&c->locator, level->positions, level->vertex_count, level->corners, level->tet_count, error);
    uint32_t count = 0, *order = array_new(level->tet_count, sizeof *order);
    if (!order)
        return tetlodi_fail_nomem(error, "a locator", 4 * (uint64_t)level->tet_count);
    for (uint32_t i = 0; i < original->count; i++)
        if (c->ancestry->image[original->order[i]] != TETLOD_NONE)
            order[count++] = c->ancestry->image[original->order[i]];
    return locator_init_known(&c->locator, level->positions, level->vertex_count, level->corners, level->tet_count,
                              c->ancestry->neighbours, order, threads, error);
}

enum tetlod_status measure_level(struct measure *measure, const struct ancestry_level *level, uint32_t contractions,
                                 unsigned threads, struct measured *out, double *io_domain, struct tetlod_error *error)
{
    struct comparison c = {.measure = measure, .level = &level->mesh, .ancestry = level};
    enum tetlod_status status = TETLOD_OK;
    c.unchanged = array_new(measure->original->tet_count, 1);
    if (!c.unchanged)
        TETLOD_TRY_DONE(tetlodi_fail_nomem(error, "the samples", measure->original->tet_count));
    find_unchanged(&c);
    TETLOD_TRY_DONE(locate_level(&c, threads, error));
    status = compare(&c, threads, out, io_domain, error);
    measure->contractions = contractions;
done:
    locator_fini(&c.locator);
    free(c.unchanged);
    return status;
}

enum tetlod_status measure_mesh(struct measure *measure, const struct tetmesh *mesh, const uint32_t *fields,
                                unsigned threads, struct measured *out, double *out_domain, struct tetlod_error *error)
{
    struct comparison c = {.measure = measure, .level = mesh, .level_fields = fields};
    if (!measure->ambiguous)
        TETLOD_TRY(find_ambiguous(measure, threads, error));
    TETLOD_TRY(locator_init(&c.locator, mesh->positions, mesh->vertex_count, mesh->corners, mesh->tet_count, error));
    *out_domain = 0;
    enum tetlod_status status = compare(&c, threads, out, out_domain, error);
    locator_fini(&c.locator);
    return status;
}
