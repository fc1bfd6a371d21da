/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/simplify/metric.h"

#include <math.h>
#include <stdlib.h>

#include "format/fail.h"
#include "src/mesh/tet_geom.h"
#include "src/util/array.h"

enum tetlod_status metric_init(struct metric_scratch *scratch, const struct fields *fields, struct tetlod_error *error)
{
    scratch->bounds = array_new((size_t)fields->driver_count * MOST_TRIALS, sizeof *scratch->bounds);
    return scratch->bounds ? TETLOD_OK : tetlodi_fail_nomem(error, "the metric", fields->driver_count);
}

void metric_fini(struct metric_scratch *scratch)
{
    free(scratch->bounds);
    *scratch = (struct metric_scratch){0};
}

/* ---- what the tetrahedra say */

/* They are asked many times more often than they change. */
static void set_envelope(const struct fields *fields, struct driver *driver, const struct complex *complex, uint32_t tet,
                         enum metric metric)
{
    const struct working_field *field = &fields->fields[driver->field];
    const uint32_t *corners = complex->corners + 4 * (size_t)tet;
    struct tet_affine affine;
    complex_affine(complex, tet, &affine);
    for (int side = 0; side < 2; side++) {
        const double *values = metric == METRIC_SVA ? field->values + driver->component : side ? driver->upper : driver->lower;
        size_t stride = metric == METRIC_SVA ? field->components : 1;
        double f0 = values[corners[0] * stride], d1 = values[corners[1] * stride] - f0,
               d2 = values[corners[2] * stride] - f0, d3 = values[corners[3] * stride] - f0;
        driver->envelopes[tet].value[side] = f0;
        for (int i = 0; i < 3; i++)
            driver->envelopes[tet].gradient[side][i] =
                affine.gradient[0][i] * d1 + affine.gradient[1][i] * d2 + affine.gradient[2][i] * d3;
    }
}

enum tetlod_status metric_init_envelopes(enum metric metric, struct fields *fields, const struct complex *complex,
                                         struct tetlod_error *error)
{
    for (uint32_t d = 0; d < fields->driver_count; d++) {
        struct driver *driver = &fields->drivers[d];
        driver->envelopes = array_new(complex->tet_count, sizeof *driver->envelopes);
        if (!driver->envelopes)
            return tetlodi_fail_nomem(error, "the envelopes", complex->tet_count * sizeof *driver->envelopes);
        for (uint32_t t = 0; t < complex->tet_count; t++)
            set_envelope(fields, driver, complex, t, metric);
    }
    return TETLOD_OK;
}

void metric_update_envelopes(enum metric metric, struct fields *fields, const struct complex *complex, uint32_t vertex)
{
    const uint32_t *tets = complex->pool + complex->star_begin[vertex];
    for (uint32_t d = 0; d < fields->driver_count && fields->drivers[d].envelopes; d++)
        for (uint32_t i = 0; i < complex->star_count[vertex]; i++)
            set_envelope(fields, &fields->drivers[d], complex, tets[i], metric);
}

static inline double at(const struct envelope *envelope, int side, const double r[3])
{
    const double *gradient = envelope->gradient[side];
    return envelope->value[side] + gradient[0] * r[0] + gradient[1] * r[1] + gradient[2] * r[2];
}

/* With its corner `moving` at them, is the tetrahedron well oriented? Trials at which it is not are impossible. */
static void try_fits(const struct complex *complex, uint32_t tet, unsigned moving, struct trial *trials, uint32_t count)
{
    const uint32_t *corners = complex->corners + 4 * (size_t)tet;
    const double *q[3];
    double a[3], b[3], n[3];
    for (int k = 0; k < 3; k++)
        q[k] = complex->positions + 3 * (size_t)corners[tet_faces[moving][k]];
    for (int i = 0; i < 3; i++) {
        a[i] = (q[1][i] - q[0][i]) * complex->orientation;
        b[i] = q[2][i] - q[0][i];
    }
    for (int i = 0; i < 3; i++) // outwards
        n[i] = a[(i + 1) % 3] * b[(i + 2) % 3] - a[(i + 2) % 3] * b[(i + 1) % 3];
    for (uint32_t t = 0; t < count; t++) {
        const double *p = trials[t].position;
        double volume6 = n[0] * (q[0][0] - p[0]) + n[1] * (q[0][1] - p[1]) + n[2] * (q[0][2] - p[2]);
        if (!trials[t].possible || volume6 > complex->least_volume6[tet])
            continue;
        trials[t].possible = false;
        trials[t].witness[0] = trials[t].witness[1] = tet;
    }
}

/* ---- trials */

/* What contracting the simplex inherits (thesis 4.1: the errors of its vertices add up). */
static double inherited(enum metric metric, const struct driver *driver, const struct star *star)
{
    double sum = 0;
    for (uint32_t s = 0; s < star->simplex_count && metric == METRIC_SVA; s++)
        sum += driver->predicted[star->simplex[s]];
    return sum;
}

/* The value of a driver between its bounds, as its type can hold it: their middle, or the quadric's best that keeps the error
 * within the limit; and what the quadric is there. */
static double choose_value(enum metric metric, const struct fields *fields, const struct driver *driver,
                           const double quadric[QUADRIC_SIZE], const double bounds[2], double limit, struct trial *trial)
{
    const struct working_field *field = &fields->fields[driver->field];
    double middle = (bounds[0] + bounds[1]) / 2, p[3], s = middle * driver->scale;
    if (!metric_has_quadrics(metric))
        return field_round(field, driver->component, middle);
    normalise_position(fields, trial->position, p);
    double cost = quadric_least_at(quadric, p, &s), weight = quadric_weight(quadric);
    trial->cost += cost;
    if (isinf(limit) && weight > 0)
        trial->error = larger(trial->error, sqrt(cost / weight) * driver->weight);
    if (driver->scale > 0 && isfinite(s)) {
        double room = larger(limit / (driver->scale * driver->weight) - (bounds[1] - bounds[0]) / 2, 0);
        middle = smaller(larger(s / driver->scale, middle - room), middle + room);
    }
    return field_round(field, driver->component, middle);
}

/* The drivers' values at the trials that are left, and the errors with them. */
static void assign(enum metric metric, struct metric_scratch *scratch, const struct fields *fields,
                   const struct star *star, double limit, struct trial *trials, uint32_t count)
{
    for (uint32_t d = 0; d < fields->driver_count; d++) {
        const struct driver *driver = &fields->drivers[d];
        double quadric[QUADRIC_SIZE], before = inherited(metric, driver, star);
        if (metric_has_quadrics(metric))
            driver_quadric(driver, star, quadric);
        for (uint32_t t = 0; t < count; t++) {
            struct metric_bounds *bounds = &scratch->bounds[d * MOST_TRIALS + t];
            if (!trials[t].possible || trials[t].error > limit)
                continue;
            double s = choose_value(metric, fields, driver, quadric, bounds->value, limit, &trials[t]);
            double error = before + larger(bounds->value[1] - s, s - bounds->value[0]);
            bounds->assigned = metric == METRIC_SVA ? NAN : s;
            trials[t].error = larger(trials[t].error, error * driver->scale * driver->weight);
        }
    }
}

/* Takes one tetrahedron's interpolants into a driver's bounds; a trial that gets above the limit drops out. */
static void widen(const struct driver *driver, const double *origin, uint32_t tet, double limit, double before,
                  struct trial *trials, uint32_t count, struct metric_bounds *bounds)
{
    const struct envelope *envelope = &driver->envelopes[tet];
    double factor = driver->scale * driver->weight;
    for (uint32_t t = 0; t < count; t++) {
        if (!trials[t].possible || trials[t].error > limit)
            continue;
        double r[3];
        for (int i = 0; i < 3; i++)
            r[i] = trials[t].position[i] - origin[i];
        double least = at(envelope, 0, r), greatest = at(envelope, 1, r);
        if (least < bounds[t].value[0]) {
            bounds[t].value[0] = least;
            bounds[t].tet[0] = tet;
        }
        if (greatest > bounds[t].value[1]) {
            bounds[t].value[1] = greatest;
            bounds[t].tet[1] = tet;
        }
        double error = (before + (bounds[t].value[1] - bounds[t].value[0]) / 2) * factor;
        if (error > trials[t].error) {
            trials[t].error = error;
            trials[t].witness[0] = bounds[t].tet[0];
            trials[t].witness[1] = bounds[t].tet[1];
        }
    }
}

static bool any_left(const struct trial *trials, uint32_t count, double limit)
{
    bool left = false;
    for (uint32_t t = 0; t < count; t++)
        left |= trials[t].possible && !(trials[t].error > limit);
    return left;
}

void metric_try(enum metric metric, struct metric_scratch *scratch, const struct fields *fields,
                const struct complex *complex, const struct star *star, const struct boundary_map *map, double limit,
                struct trial *trials, uint32_t count)
{
    for (uint32_t t = 0; t < count; t++) {
        trials[t].error = trials[t].cost = 0;
        trials[t].witness[0] = trials[t].witness[1] = TETLOD_NONE;
    }
    for (uint32_t d = 0; d < fields->driver_count; d++) {
        struct metric_bounds bounds = {{INFINITY, -INFINITY}, {TETLOD_NONE, TETLOD_NONE}, NAN};
        for (uint32_t s = 0; s < star->simplex_count && star->at_one_point; s++) {
            bounds.value[0] = smaller(bounds.value[0], fields->drivers[d].lower[star->simplex[s]]);
            bounds.value[1] = larger(bounds.value[1], fields->drivers[d].upper[star->simplex[s]]);
        }
        if (map && metric != METRIC_SVA) {
            bounds.value[0] = smaller(bounds.value[0], boundary_map_greatest(map, fields->drivers[d].lower, 1));
            bounds.value[1] = larger(bounds.value[1], boundary_map_least(map, fields->drivers[d].upper, 1, 0));
        }
        for (uint32_t t = 0; t < count; t++)
            scratch->bounds[d * MOST_TRIALS + t] = bounds;
    }
    bool bounded = isfinite(limit) || !metric_has_quadrics(metric); // quadrics alone need no bounds
    for (uint32_t i = 0; i < star->tet_count && !star->at_one_point && any_left(trials, count, limit); i++) {
        uint32_t tet = star->tets[i], ahead = star->tets[i + 4 < star->tet_count ? i + 4 : i];
        const double *origin = complex->positions + 3 * (size_t)complex->corners[4 * (size_t)tet];
        __builtin_prefetch(&complex->least_volume6[ahead]);
        if (star->moving[i] != STAR_REMOVED)
            try_fits(complex, tet, star->moving[i], trials, count);
        for (uint32_t d = 0; d < fields->driver_count && bounded; d++) {
            __builtin_prefetch(&fields->drivers[d].envelopes[ahead]);
            widen(&fields->drivers[d], origin, tet, limit, inherited(metric, &fields->drivers[d], star), trials, count,
                  scratch->bounds + d * MOST_TRIALS);
        }
    }
    assign(metric, scratch, fields, star, limit, trials, count);
}

void metric_demand(const struct metric_scratch *scratch, const struct fields *fields, const struct boundary_map *map,
                   uint32_t trial, double *io_error)
{
    for (uint32_t d = 0; d < fields->driver_count; d++) {
        const struct driver *driver = &fields->drivers[d];
        const double *bounds = scratch->bounds[d * MOST_TRIALS + trial].value;
        double least = smaller(bounds[0], boundary_map_greatest(map, driver->lower, 1));
        double greatest = larger(bounds[1], boundary_map_least(map, driver->upper, 1, 0));
        *io_error = larger(*io_error, (greatest - least) / 2 * driver->scale * driver->weight);
    }
}

void metric_assigned(const struct metric_scratch *scratch, const struct fields *fields, uint32_t trial, double *out)
{
    for (uint32_t d = 0; d < fields->driver_count; d++)
        out[d] = scratch->bounds[d * MOST_TRIALS + trial].assigned;
}

bool metric_optimum(const struct fields *fields, const struct star *star, double p[3])
{
    double sum[QUADRIC_SIZE] = {0}, quadric[QUADRIC_SIZE];
    for (uint32_t d = 0; d < fields->driver_count; d++) {
        driver_quadric(&fields->drivers[d], star, quadric);
        for (int i = 0; i < QUADRIC_SIZE; i++)
            sum[i] += quadric[i];
    }
    if (!quadric_optimum(sum, p))
        return false;
    for (int i = 0; i < 3; i++)
        p[i] = fields->origin[i] + p[i] * fields->unit;
    return true;
}

double metric_key(enum metric metric, const struct trial *trial, uint32_t removed)
{
    if (metric_has_quadrics(metric))
        return trial->cost / ((double)removed * removed);
    return metric == METRIC_SVA ? trial->error : trial->error / (removed * sqrt(removed));
}
