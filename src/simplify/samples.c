/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/simplify/samples.h"

#include <math.h>
#include <stdlib.h>

#include "format/fail.h"
#include "src/mesh/sample_points.h"
#include "src/mesh/tet_geom.h"
#include "src/mesh/vector.h"
#include "src/util/array.h"

/* The limit is held by this much more, so that who measures again, in another order of operations, finds it held. */
static const double SPARE = 1e-9;

/* A sample whose weight at the new vertex is less does not ask anything of its value. */
static const double WEIGHTLESS = 1e-9;

/* A new tetrahedron, seen from the new vertex: a point at `r` from it has the weights rows . r at the link's vertices. */
struct cone {
    double rows[3][3];
    uint32_t link[3]; /* slots */
    uint32_t tet;
};

/* A sample of the star, and the cone that it is in. */
struct held {
    uint32_t sample, cone;
};

/* What the samples ask of a driver's value so far. */
struct demand {
    double least, most;            /* the interval for s' within the limit */
    double weight_low, weight_high; /* of the samples that say so */
    double centre_low, centre_high; /* the value that would suit each of them best */
    uint32_t tet_low, tet_high;
    double squares, products; /* of least squares */
};

/* A trial's new star, and what is known of it. */
struct attempt {
    struct cone *cones;
    uint32_t cone_count, cone; /* the one in which the last sample was */
    struct demand *demands;    /* [driver] */
};

/* ---- the samples */

uint64_t samples_bytes(const struct tetmesh *mesh, uint32_t driver_count)
{
    uint64_t samples = mesh->vertex_count + (uint64_t)SAMPLES_PER_TET * mesh->tet_count;
    return samples * (8 * (3 + (uint64_t)driver_count) + 4) + 8 * (uint64_t)mesh->tet_count;
}

void samples_fini(struct samples *samples)
{
    free(samples->rows);
    free(samples->first);
    free(samples->next);
    free(samples->held);
    *samples = (struct samples){0};
}

static void put_first(struct samples *samples, uint32_t sample, uint32_t tet)
{
    samples->next[sample] = samples->first[tet];
    samples->first[tet] = sample;
    samples->held[tet]++;
}

/* Appends the point with these weights in a tetrahedron. */
static void add_sample(struct samples *samples, const struct complex *complex, const struct fields *fields, uint32_t tet,
                       const double weights[4])
{
    const uint32_t *corners = complex->corners + 4 * (size_t)tet;
    double *row = samples->rows + (size_t)samples->count * samples->stride;
    for (uint32_t k = 0; k < samples->stride; k++) {
        row[k] = 0;
        for (int c = 0; c < 4 && k < 3; c++)
            row[k] += weights[c] * complex->positions[3 * (size_t)corners[c] + k];
        for (int c = 0; c < 4 && k >= 3; c++) {
            const struct driver *driver = &fields->drivers[k - 3];
            row[k] += weights[c] * driver->upper[corners[c]]; // the original's value, which need not be on the grid
        }
    }
    put_first(samples, samples->count++, tet);
}

static void add_samples(struct samples *samples, const struct tetmesh *mesh, const struct complex *complex,
                        const struct fields *fields, uint8_t *seen)
{
    for (uint32_t t = 0; t < complex->tet_count; t++) {
        const uint32_t *corners = complex->corners + 4 * (size_t)t;
        const double *p[4];
        double weights[4];
        samples->first[t] = TETLOD_NONE;
        for (int c = 0; c < 4; c++)
            p[c] = complex->positions + 3 * (size_t)corners[c];
        if (tet_orientation(p[0], p[1], p[2], p[3]) == 0)
            continue;
        for (unsigned i = 0; i < SAMPLES_PER_TET; i++) {
            sample_weights(mesh, corners, i, weights);
            add_sample(samples, complex, fields, t, weights);
        }
        for (int c = 0; c < 4; c++) { // last, which is first in the list: what removes the vertex errs most there
            double corner[4] = {c == 0, c == 1, c == 2, c == 3};
            if (!seen[corners[c]])
                add_sample(samples, complex, fields, t, corner);
            seen[corners[c]] = 1;
        }
    }
}

enum tetlod_status samples_init(struct samples *samples, const struct tetmesh *mesh, const struct complex *complex,
                                const struct fields *fields, struct tetlod_error *error)
{
    uint64_t most = mesh->vertex_count + (uint64_t)SAMPLES_PER_TET * mesh->tet_count;
    *samples = (struct samples){0};
    if (most >= TETLOD_NONE)
        return tetlodi_fail(error, TETLOD_ERR_LIMIT, "the mesh is too large for --metric measured; use another one");
    samples->stride = 3 + fields->driver_count;
    samples->rows = array_new(most, samples->stride * sizeof *samples->rows);
    samples->next = array_new(most, sizeof *samples->next);
    samples->first = array_new(mesh->tet_count, sizeof *samples->first);
    samples->held = array_zero(mesh->tet_count, sizeof *samples->held);
    uint8_t *seen = array_zero(mesh->vertex_count, 1);
    bool done = samples->rows && samples->next && samples->first && samples->held && seen;
    if (done)
        add_samples(samples, mesh, complex, fields, seen);
    free(seen);
    return done ? TETLOD_OK : tetlodi_fail_nomem(error, "the samples", samples_bytes(mesh, fields->driver_count));
}

enum tetlod_status sampler_init(struct sampler *sampler, const struct fields *fields, struct tetlod_error *error)
{
    size_t most = (size_t)fields->driver_count * MOST_TRIALS;
    *sampler = (struct sampler){.attempts = array_new(MOST_TRIALS, sizeof *sampler->attempts),
                                .demands = array_new(most, sizeof *sampler->demands),
                                .assigned = array_new(most, sizeof *sampler->assigned)};
    if (!sampler->attempts || !sampler->demands || !sampler->assigned)
        return tetlodi_fail_nomem(error, "the samples", most * (sizeof *sampler->demands + 8));
    for (uint32_t t = 0; t < MOST_TRIALS; t++)
        sampler->attempts[t].demands = sampler->demands + (size_t)t * fields->driver_count;
    return TETLOD_OK;
}

void sampler_fini(struct sampler *sampler)
{
    free(sampler->attempts);
    free(sampler->demands);
    free(sampler->assigned);
    free(sampler->cones);
    free(sampler->held);
    free(sampler->parts);
    *sampler = (struct sampler){0};
}

/* ---- the star at hand */

static enum tetlod_status reserve(struct sampler *sampler, const struct samples *samples, const struct fields *fields,
                                  const struct star *star, uint32_t trials, struct tetlod_error *error)
{
    size_t held = 0;
    for (uint32_t i = 0; i < star->tet_count; i++)
        held += samples->held[star->tets[i]];
    void *cones = sampler->cones, *list = sampler->held, *parts = sampler->parts;
    bool room = array_reserve(&cones, &sampler->cone_capacity, (size_t)trials * star->tet_count, sizeof *sampler->cones);
    sampler->cones = cones;
    room = room && array_reserve(&list, &sampler->held_capacity, held, sizeof *sampler->held);
    sampler->held = list;
    sampler->part_count = 2 * (size_t)fields->driver_count * trials;
    room = room && array_reserve(&parts, &sampler->part_capacity, held * sampler->part_count, sizeof(double));
    sampler->parts = parts;
    return room ? TETLOD_OK : tetlodi_fail_nomem(error, "the samples of a star", held * 16);
}

/* A tetrahedron with its corner `moving` at p. False: it flips or degenerates. */
static bool make_cone(struct cone *cone, const struct complex *complex, uint32_t tet, unsigned moving, const double p[3])
{
    const uint32_t *corners = complex->corners + 4 * (size_t)tet;
    double e[3][3], size2 = 0;
    int j = 0;
    cone->tet = tet;
    for (unsigned c = 0; c < 4; c++)
        if (c != moving) {
            const double *q = complex->positions + 3 * (size_t)corners[c];
            cone->link[j] = corners[c];
            for (int d = 0; d < 3; d++)
                e[j][d] = q[d] - p[d];
            j++;
        }
    for (j = 0; j < 3; j++) {
        const double *u = e[(j + 1) % 3], *v = e[(j + 2) % 3];
        cross(u, v, cone->rows[j]);
        size2 = larger(size2, larger(dot(u, u), distance_squared(u, v)));
    }
    double volume6 = dot(e[0], cone->rows[0]), inverse = 1 / volume6;
    if (!((moving % 2 ? -volume6 : volume6) * complex->orientation > TET_DEGENERATE * size2 * sqrt(size2)))
        return false;
    for (j = 0; j < 3; j++)
        for (int d = 0; d < 3; d++)
            cone->rows[j][d] *= inverse;
    return true;
}

/* The new tetrahedra with the new vertex at the trial. */
static void make_cones(struct cone *cones, const struct complex *complex, const struct star *star, struct trial *trial)
{
    uint32_t count = 0;
    for (uint32_t i = 0; i < star->tet_count && trial->possible; i++) {
        if (star->moving[i] == STAR_REMOVED || make_cone(&cones[count++], complex, star->tets[i], star->moving[i], trial->position))
            continue;
        trial->possible = false;
        trial->witness[0] = trial->witness[1] = star->tets[i];
    }
}

/* Weights of the link's vertices in the cone in which `r` lies; the search begins at *io_cone. By rounding, or outside a
 * boundary that has moved, it may lie in none: then the one that misses it least, and no weight is negative. */
static void find_cone(const struct cone *cones, uint32_t count, const double r[3], uint32_t *io_cone, double weights[3])
{
    double best = -INFINITY;
    uint32_t c = *io_cone;
    for (uint32_t i = 0; i < count; i++, c = c + 1 < count ? c + 1 : 0) {
        const struct cone *cone = &cones[c];
        double l[3] = {dot(cone->rows[0], r), dot(cone->rows[1], r), dot(cone->rows[2], r)};
        double least = smaller(l[0], smaller(l[1], l[2]));
        if (least <= best)
            continue;
        best = least;
        *io_cone = c;
        for (int j = 0; j < 3; j++)
            weights[j] = larger(l[j], 0);
        if (least >= 0)
            return;
    }
}

/* Takes a sample in: w s' + rest is its error. Returns a lower bound of the error that some s' can reach, in the field's units:
 * 0 as long as the limit can be held. */
static double take(struct demand *demand, double w, double rest, double limit, uint32_t tet)
{
    demand->squares += w * w;
    demand->products -= w * rest;
    if (w < WEIGHTLESS)
        return fabs(rest) > limit ? fabs(rest) : 0;
    double centre = -rest / w, reach = limit / w;
    if (centre - reach > demand->least) {
        demand->least = centre - reach;
        demand->weight_low = w;
        demand->centre_low = centre;
        demand->tet_low = tet;
    }
    if (centre + reach < demand->most) {
        demand->most = centre + reach;
        demand->weight_high = w;
        demand->centre_high = centre;
        demand->tet_high = tet;
    }
    if (demand->least <= demand->most)
        return 0;
    return (demand->centre_low - demand->centre_high) / (1 / demand->weight_low + 1 / demand->weight_high);
}

static double value_of(const struct fields *fields, const struct driver *driver, uint32_t slot)
{
    const struct working_field *field = &fields->fields[driver->field];
    return field->values[(size_t)slot * field->components + driver->component];
}

/* Takes a sample in for a trial, for all drivers; where a limit cannot be held, trial->error is a lower bound. */
static void take_sample(const struct fields *fields, const double *row, struct attempt *attempt, double limit,
                        struct trial *trial, double *parts)
{
    double r[3] = {row[0] - trial->position[0], row[1] - trial->position[1], row[2] - trial->position[2]}, l[3] = {0};
    find_cone(attempt->cones, attempt->cone_count, r, &attempt->cone, l);
    const struct cone *in = &attempt->cones[attempt->cone];
    double w = larger(1 - l[0] - l[1] - l[2], 0);
    for (uint32_t d = 0; d < fields->driver_count; d++) {
        const struct driver *driver = &fields->drivers[d];
        double unit = driver->scale * driver->weight, rest = -row[3 + d];
        for (int j = 0; j < 3; j++)
            rest += l[j] * value_of(fields, driver, in->link[j]);
        parts[2 * d] = w;
        parts[2 * d + 1] = rest;
        if (unit == 0)
            continue;
        struct demand *demand = &attempt->demands[d];
        double error = take(demand, w, rest, limit / unit, in->tet) * unit;
        if (error > trial->error) {
            trial->error = error;
            trial->witness[0] = w < WEIGHTLESS ? in->tet : demand->tet_low;
            trial->witness[1] = w < WEIGHTLESS ? in->tet : demand->tet_high;
        }
    }
}

/* All samples for all trials, or until none of them can be below the cutoff. */
static void take_all(const struct samples *samples, struct sampler *sampler, const struct fields *fields,
                     const struct star *star, double limit, double cutoff, struct trial *trials, uint32_t count)
{
    bool left = true;
    sampler->held_count = 0;
    for (uint32_t i = 0; i < star->tet_count && left; i++)
        for (uint32_t s = samples->first[star->tets[i]]; s != TETLOD_NONE && left; s = samples->next[s]) {
            const double *row = samples->rows + (size_t)s * samples->stride;
            double *parts = sampler->parts + sampler->held_count * sampler->part_count;
            left = false;
            for (uint32_t t = 0; t < count; t++) {
                if (!trials[t].possible || trials[t].error > cutoff)
                    continue;
                take_sample(fields, row, &sampler->attempts[t], limit, &trials[t], parts + 2 * (size_t)t * fields->driver_count);
                left |= trials[t].error <= cutoff;
            }
            sampler->held[sampler->held_count++] = (struct held){s, sampler->attempts[0].cone};
        }
}

/* A trial's values by least squares within the limit, and the errors with them. */
static void settle(struct sampler *sampler, const struct fields *fields, uint32_t number, struct trial *trial)
{
    for (uint32_t d = 0; d < fields->driver_count; d++) {
        const struct driver *driver = &fields->drivers[d];
        const struct demand *demand = &sampler->attempts[number].demands[d];
        const double *part = sampler->parts + 2 * ((size_t)number * fields->driver_count + d);
        double unit = driver->scale * driver->weight, most = 0;
        double *value = &sampler->assigned[d * MOST_TRIALS + number];
        *value = NAN;
        if (unit == 0 || !(demand->squares > WEIGHTLESS * WEIGHTLESS))
            continue;
        *value = smaller(larger(demand->products / demand->squares, demand->least), demand->most);
        *value = field_round(&fields->fields[driver->field], driver->component, *value);
        for (uint32_t i = 0; i < sampler->held_count; i++, part += sampler->part_count)
            most = larger(most, fabs(part[0] * *value + part[1]));
        trial->error = larger(trial->error, most * unit);
    }
}

/* The new star at each trial, nothing taken in yet. False: none is possible. */
static bool attempt_all(struct sampler *sampler, const struct complex *complex, const struct fields *fields,
                        const struct star *star, struct trial *trials, uint32_t count)
{
    bool any = false;
    for (uint32_t t = 0; t < count; t++) {
        struct attempt *attempt = &sampler->attempts[t];
        attempt->cones = sampler->cones + (size_t)t * star->tet_count;
        attempt->cone_count = star->tet_count - star->removed_count;
        attempt->cone = 0;
        for (uint32_t d = 0; d < fields->driver_count; d++)
            attempt->demands[d] = (struct demand){-INFINITY, INFINITY, 1, 1, 0, 0, TETLOD_NONE, TETLOD_NONE, 0, 0};
        trials[t].error = trials[t].cost = 0;
        trials[t].witness[0] = trials[t].witness[1] = TETLOD_NONE;
        make_cones(attempt->cones, complex, star, &trials[t]);
        trials[t].possible &= attempt->cone_count > 0; // a body of its own does not vanish
        any |= trials[t].possible;
    }
    return any;
}

enum tetlod_status samples_try(const struct samples *samples, struct sampler *sampler, const struct complex *complex,
                               const struct fields *fields, const struct star *star, double limit, double cutoff,
                               struct trial *trials, uint32_t count, struct tetlod_error *error)
{
    TETLOD_TRY(reserve(sampler, samples, fields, star, count, error));
    if (!attempt_all(sampler, complex, fields, star, trials, count))
        return TETLOD_OK;
    take_all(samples, sampler, fields, star, limit * (1 - SPARE), cutoff, trials, count);
    for (uint32_t t = 0; t < count; t++) {
        if (trials[t].possible && trials[t].error == 0)
            settle(sampler, fields, t, &trials[t]);
        else
            trials[t].error = larger(trials[t].error, nextafter(limit, INFINITY)); // no value holds the limit
    }
    return TETLOD_OK;
}

void samples_assigned(const struct sampler *sampler, const struct fields *fields, uint32_t trial, double *out)
{
    for (uint32_t d = 0; d < fields->driver_count; d++)
        out[d] = sampler->assigned[d * MOST_TRIALS + trial];
}

/* Samples with larger errors come first in the lists: they refuse most of what is refused, so that little is looked at. */
enum { CLASSES = 4 };

static int class_of(const struct sampler *sampler, const struct fields *fields, uint32_t held, double most)
{
    double worst = 0;
    for (uint32_t d = 0; d < fields->driver_count; d++) {
        const double *part = sampler->parts + held * sampler->part_count + 2 * d;
        double value = sampler->assigned[d * MOST_TRIALS];
        worst = larger(worst, fabs((isnan(value) ? 0 : part[0] * value) + part[1]) * fields->drivers[d].scale *
                                  fields->drivers[d].weight);
    }
    return most > 0 ? (int)smaller(CLASSES * worst / most, CLASSES - 1) : 0;
}

void samples_contract(struct samples *samples, const struct sampler *sampler, const struct fields *fields,
                      const struct star *star, double error)
{
    for (uint32_t i = 0; i < star->tet_count; i++) {
        samples->first[star->tets[i]] = TETLOD_NONE;
        samples->held[star->tets[i]] = 0;
    }
    for (int pass = 0; pass < CLASSES; pass++)
        for (uint32_t i = 0; i < sampler->held_count; i++)
            if (class_of(sampler, fields, i, error) == pass)
                put_first(samples, sampler->held[i].sample, sampler->cones[sampler->held[i].cone].tet);
}
