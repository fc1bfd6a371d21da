/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/simplify/fields.h"

#include <float.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "format/fail.h"
#include "format/round.h"
#include "src/mesh/tet_geom.h"
#include "src/util/array.h"

uint64_t fields_bytes(const struct tetmesh *mesh, uint32_t controlled_count)
{
    uint64_t components = 0, drivers = 0;
    for (uint32_t f = 0; f < mesh->field_count; f++)
        components += mesh->fields[f].components;
    drivers = controlled_count * (uint64_t)3;
    return mesh->vertex_count * 8 * (2 * components + drivers);
}

void fields_fini(struct fields *fields)
{
    for (uint32_t f = 0; f < fields->count && fields->fields; f++) {
        free(fields->fields[f].middles);
        free(fields->fields[f].component_range);
        free(fields->fields[f].values);
    }
    for (uint32_t d = 0; d < fields->driver_count && fields->drivers; d++) {
        free(fields->drivers[d].upper);
        free(fields->drivers[d].lower);
        free(fields->drivers[d].predicted);
        free(fields->drivers[d].quadrics);
        free(fields->drivers[d].envelopes);
    }
    free(fields->fields);
    free(fields->drivers);
    *fields = (struct fields){0};
}

double field_middle(const double range[2])
{
    double middle = range[0] / 2 + range[1] / 2;
    return fabs(middle) > 2 * (range[1] - range[0]) ? middle : 0;
}

static bool init_field(struct working_field *field, const struct point_field *from, size_t vertices)
{
    size_t k = from->components;
    *field = (struct working_field){.components = from->components,
                                    .type = from->type,
                                    .middles = array_new(k, sizeof(double)),
                                    .component_range = array_new(k, 2 * sizeof(double)),
                                    .values = array_new(vertices * k, sizeof(double)),
                                    .grid = from->grid,
                                    .is_ids = from->is_ids};
    if (!field->middles || !field->component_range || !field->values)
        return false;
    for (size_t c = 0; c < k; c++) {
        double *range = field->component_range[c];
        range[0] = range[1] = vertices ? from->values[c] : 0;
        for (size_t v = 1; v < vertices; v++) {
            range[0] = fmin(range[0], from->values[v * k + c]);
            range[1] = fmax(range[1], from->values[v * k + c]);
        }
        double middle = field->middles[c] = field_middle(range);
        for (size_t v = 0; v < vertices; v++)
            field->values[v * k + c] = grid_round(&field->grid, field->type, from->values[v * k + c]) - middle;
        range[0] = grid_round(&field->grid, field->type, range[0]) - middle;
        range[1] = grid_round(&field->grid, field->type, range[1]) - middle;
    }
    return true;
}

static bool init_driver(struct driver *driver, const struct tetmesh *mesh, uint32_t field, uint32_t component, double middle,
                        double weight)
{
    size_t n = mesh->vertex_count, k = mesh->fields[field].components;
    double range[2];
    point_field_range(&mesh->fields[field], mesh->vertex_count, range);
    *driver = (struct driver){field,
                              component,
                              range[1] > range[0] ? 1 / (range[1] - range[0]) : 0,
                              weight,
                              array_new(n, sizeof(double)),
                              array_new(n, sizeof(double)),
                              array_zero(n, sizeof(double)),
                              NULL,
                              NULL};
    if (!driver->upper || !driver->lower || !driver->predicted)
        return false;
    for (size_t v = 0; v < n; v++) // exact: not on the grid
        driver->upper[v] = driver->lower[v] = mesh->fields[field].values[v * k + component] - middle;
    return true;
}

enum tetlod_status fields_init(struct fields *fields, const struct tetmesh *mesh, const uint32_t *controlled,
                               uint32_t controlled_count, const double *limits, struct tetlod_error *error)
{
    uint32_t driver_count = 0;
    for (uint32_t i = 0; i < controlled_count; i++)
        driver_count += mesh->fields[controlled[i]].components;
    *fields = (struct fields){.count = mesh->field_count,
                              .driver_count = driver_count,
                              .fields = array_zero(mesh->field_count, sizeof *fields->fields),
                              .drivers = array_zero(driver_count, sizeof *fields->drivers)};
    bool done = fields->fields && fields->drivers;
    for (uint32_t f = 0; f < mesh->field_count && done; f++)
        done = init_field(&fields->fields[f], &mesh->fields[f], mesh->vertex_count);
    for (uint32_t i = 0, d = 0; i < controlled_count && done; i++)
        for (uint32_t c = 0; c < mesh->fields[controlled[i]].components && done; c++)
            done = init_driver(&fields->drivers[d++], mesh, controlled[i], c, fields->fields[controlled[i]].middles[c],
                               limits ? 1 / limits[i] : 1);
    if (done)
        return TETLOD_OK;
    fields_fini(fields);
    return tetlodi_fail_nomem(error, "the fields", fields_bytes(mesh, controlled_count));
}

void fields_renumber(struct fields *fields, const struct renumbering *tets, const struct renumbering *slots)
{
    for (uint32_t f = 0; f < fields->count; f++)
        renumber_array(&fields->fields[f].values, fields->fields[f].components * sizeof(double), slots);
    for (uint32_t d = 0; d < fields->driver_count; d++) {
        struct driver *driver = &fields->drivers[d];
        renumber_array(&driver->upper, sizeof *driver->upper, slots);
        renumber_array(&driver->lower, sizeof *driver->lower, slots);
        renumber_array(&driver->predicted, sizeof *driver->predicted, slots);
        renumber_array(&driver->quadrics, QUADRIC_SIZE * sizeof *driver->quadrics, slots);
        renumber_array(&driver->envelopes, sizeof *driver->envelopes, tets);
    }
}

/* ---- quadrics */

void normalise_position(const struct fields *fields, const double p[3], double out[3])
{
    for (int i = 0; i < 3; i++)
        out[i] = (p[i] - fields->origin[i]) / fields->unit;
}

void driver_quadric(const struct driver *driver, const struct star *star, double out[QUADRIC_SIZE])
{
    for (int i = 0; i < QUADRIC_SIZE; i++) {
        out[i] = 0;
        for (uint32_t s = 0; s < star->simplex_count; s++)
            out[i] += driver->quadrics[QUADRIC_SIZE * (size_t)star->simplex[s] + (size_t)i];
    }
}

/* Adds a tetrahedron's share, weighted by its volume, to the quadrics of its corners. */
static void add_quadric(struct fields *fields, struct driver *driver, const struct complex *complex, uint32_t tet,
                        bool distance)
{
    const struct working_field *field = &fields->fields[driver->field];
    const uint32_t *corners = complex->corners + 4 * (size_t)tet;
    double points[4][4], quadric[QUADRIC_SIZE] = {0}, gradient[3] = {0}, constant;
    struct tet_affine affine;
    complex_affine(complex, tet, &affine);
    for (int c = 0; c < 4; c++) {
        normalise_position(fields, complex->positions + 3 * (size_t)corners[c], points[c]);
        points[c][3] = field->values[(size_t)corners[c] * field->components + driver->component] * driver->scale;
    }
    double weight = affine.volume6 / (fields->unit * fields->unit * fields->unit);
    for (int c = 1; c < 4; c++)
        for (int i = 0; i < 3; i++)
            gradient[i] += affine.gradient[c - 1][i] * fields->unit * (points[c][3] - points[0][3]);
    constant = points[0][3] - gradient[0] * points[0][0] - gradient[1] * points[0][1] - gradient[2] * points[0][2];
    if (distance)
        quadric_add_distance(quadric, (const double(*)[4])points, weight);
    else
        quadric_add_field(quadric, gradient, constant, weight);
    for (int c = 0; c < 4; c++)
        for (int i = 0; i < QUADRIC_SIZE; i++)
            driver->quadrics[QUADRIC_SIZE * (size_t)corners[c] + (size_t)i] += quadric[i];
}

enum tetlod_status fields_init_quadrics(struct fields *fields, const struct complex *complex, bool distance,
                                        struct tetlod_error *error)
{
    size_t n = complex->vertex_count;
    double high[3];
    for (int i = 0; i < 3; i++) {
        fields->origin[i] = high[i] = complex->positions[i];
        for (size_t v = 1; v < n; v++) {
            fields->origin[i] = fmin(fields->origin[i], complex->positions[3 * v + (size_t)i]);
            high[i] = fmax(high[i], complex->positions[3 * v + (size_t)i]);
        }
    }
    double diagonal = sqrt(distance_squared(fields->origin, high));
    fields->unit = diagonal > 0 ? diagonal : 1;
    for (uint32_t d = 0; d < fields->driver_count; d++) {
        struct driver *driver = &fields->drivers[d];
        driver->quadrics = array_zero(n, QUADRIC_SIZE * sizeof(double));
        if (!driver->quadrics)
            return tetlodi_fail_nomem(error, "the quadrics", n * QUADRIC_SIZE * sizeof(double));
        for (uint32_t t = 0; t < complex->tet_count; t++) {
            const double *p[4];
            for (int c = 0; c < 4; c++)
                p[c] = complex->positions + 3 * (size_t)complex->corners[4 * (size_t)t + (size_t)c];
            if (tet_orientation(p[0], p[1], p[2], p[3]) == complex->orientation)
                add_quadric(fields, driver, complex, t, distance);
        }
    }
    return TETLOD_OK;
}

double field_round(const struct working_field *field, uint32_t component, double value)
{
    const double *range = field->component_range[component];
    double middle = field->middles[component];
    value = grid_round(&field->grid, field->type, fmin(fmax(value, range[0]), range[1]) + middle) - middle;
    return fmin(fmax(value, range[0]), range[1]);
}

/* What one function's interpolants over the star say at p: their least and greatest values. With `rigorous`, each widened by
 * a bound of its rounding error (PROOF.md, rounding). Where nothing moves, it is what the simplex's vertices have. */
static void extremes(const struct complex *complex, const struct star *star, const double *values, size_t stride,
                     const double p[3], bool rigorous, double out[2])
{
    out[0] = INFINITY;
    out[1] = -INFINITY;
    for (uint32_t s = 0; s < star->simplex_count && star->at_one_point; s++) {
        out[0] = smaller(out[0], values[star->simplex[s] * stride]);
        out[1] = larger(out[1], values[star->simplex[s] * stride]);
    }
    for (uint32_t i = 0; i < star->tet_count && !star->at_one_point; i++) {
        struct tet_affine affine;
        complex_affine(complex, star->tets[i], &affine);
        const uint32_t *corners = complex->corners + 4 * (size_t)star->tets[i];
        double r[3] = {p[0] - affine.origin[0], p[1] - affine.origin[1], p[2] - affine.origin[2]};
        double f0 = values[corners[0] * stride], value = f0, largest = 1, spread = 0;
        for (int j = 0; j < 3; j++) {
            const double *g = affine.gradient[j];
            double lambda = g[0] * r[0] + g[1] * r[1] + g[2] * r[2];
            double difference = values[corners[j + 1] * stride] - f0;
            value += lambda * difference;
            largest = larger(largest, fabs(lambda));
            spread = larger(spread, fabs(difference));
        }
        double slack = 0;
        if (rigorous) {
            double size = sqrt(affine.size2), reach = sqrt(r[0] * r[0] + r[1] * r[1] + r[2] * r[2]);
            double lambdas = affine.size2 * (size * largest + reach) / affine.volume6;
            slack = 32 * DBL_EPSILON * (lambdas * spread + fabs(f0) + fabs(value));
        }
        out[0] = smaller(out[0], value - slack);
        out[1] = larger(out[1], value + slack);
    }
}

void fields_outcome(const struct fields *fields, const struct complex *complex, const struct star *star,
                    const struct boundary_map *map, const double p[3], const double *assigned, struct outcome *out)
{
    for (uint32_t d = 0; d < fields->driver_count; d++) {
        const struct driver *driver = &fields->drivers[d];
        const struct working_field *field = &fields->fields[driver->field];
        double range[2], envelope[2][2], before = 0;
        extremes(complex, star, field->values + driver->component, field->components, p, false, range);
        extremes(complex, star, driver->upper, 1, p, true, envelope[1]);
        extremes(complex, star, driver->lower, 1, p, true, envelope[0]);
        double most = larger(envelope[1][1], boundary_map_least(map, driver->upper, 1, 0));
        double least = smaller(envelope[0][0], boundary_map_greatest(map, driver->lower, 1));
        double value = isnan(assigned[d]) ? (range[0] + range[1]) / 2 : assigned[d];
        value = field_round(field, driver->component, value);
        for (uint32_t s = 0; s < star->simplex_count; s++)
            before += driver->predicted[star->simplex[s]];
        out[d] = (struct outcome){value, most, least,
                                  before + fmax(range[1] - value, value - range[0])};
    }
}

double outcome_error(const struct fields *fields, const struct outcome *outcome)
{
    double worst = 0;
    for (uint32_t d = 0; d < fields->driver_count; d++) {
        const struct driver *driver = &fields->drivers[d];
        double error = fmax(outcome[d].upper - outcome[d].value, outcome[d].value - outcome[d].lower);
        worst = fmax(worst, error * driver->scale * driver->weight);
    }
    return worst;
}

double field_cheap(const struct working_field *field, uint32_t component, const double *free_values, uint32_t count, double middle,
                   double least, double greatest, double slack)
{
    const double *range = field->component_range[component];
    double step = field->grid.step, base = field->middles[component], round = middle;
    least = larger(least, range[0]);
    greatest = smaller(greatest, range[1]);
    for (uint32_t i = 0; i < count; i++)
        if (free_values[i] >= least && free_values[i] <= greatest)
            return free_values[i];
    least = larger(least, middle - slack);
    greatest = smaller(greatest, middle + slack);
    double k = (middle + base - field->grid.origin) / step;
    for (double spacing = 2; field->grid.bits && spacing * step <= greatest - least; spacing *= 2) {
        double value = field->grid.origin + step * (floor(k / spacing + 0.5) * spacing);
        value = tetlodi_round(field->type, value) - base;
        if (value >= least && value <= greatest)
            round = value;
    }
    return round;
}

/* The cheap value of a contraction to p. */
static double cheap_value(const struct complex *complex, const struct working_field *field, uint32_t component,
                          const struct star *star, const double p[3], double middle, double least, double greatest,
                          double slack)
{
    const double *values = field->values + component;
    double sum = 0, there[4];
    uint32_t count = 0;
    for (uint32_t s = 0; s < star->simplex_count; s++) {
        double value = values[(size_t)star->simplex[s] * field->components];
        sum += value;
        if (memcmp(complex->positions + 3 * (size_t)star->simplex[s], p, 3 * sizeof *p) == 0)
            there[count++] = value;
    }
    if (!count)
        there[count++] = field_round(field, component, sum / star->simplex_count);
    return field_cheap(field, component, there, count, middle, least, greatest, slack);
}

void fields_cheapen(const struct fields *fields, const struct complex *complex, const struct star *star, const double p[3],
                    const double *errors, struct outcome *outcome)
{
    for (uint32_t d = 0; d < fields->driver_count; d++) {
        const struct driver *driver = &fields->drivers[d];
        const struct working_field *field = &fields->fields[driver->field];
        struct outcome *of = &outcome[d];
        if (driver->scale > 0)
            of->value = cheap_value(complex, field, driver->component, star, p, of->value, of->upper - errors[d] / driver->scale,
                                    of->lower + errors[d] / driver->scale, errors[d] / driver->scale / CHEAP_PART);
    }
}

/* Least and greatest value at the star's vertices. */
static void star_range(const struct complex *complex, const struct star *star, const double *values, size_t stride,
                       double out[2])
{
    out[0] = INFINITY;
    out[1] = -INFINITY;
    for (uint32_t i = 0; i < star->tet_count; i++)
        for (int c = 0; c < 4; c++) {
            double value = values[complex->corners[4 * (size_t)star->tets[i] + c] * stride];
            out[0] = smaller(out[0], value);
            out[1] = larger(out[1], value);
        }
}

/* Of the vertex that is at p, or of the first one. */
static void contract_ids(const struct working_field *field, const struct complex *complex, const struct star *star,
                         const double p[3], double *out)
{
    uint32_t v = star->simplex[0];
    for (uint32_t s = star->simplex_count; s-- > 0;)
        if (memcmp(complex->positions + 3 * (size_t)star->simplex[s], p, 3 * sizeof *p) == 0)
            v = star->simplex[s];
    memcpy(out, field->values + (size_t)v * field->components, field->components * sizeof *out);
}

/* What does not drive has no bound that keeps it from extrapolating out of thin tetrahedra: it stays among its neighbours'
 * values. */
static void contract_field(struct working_field *field, const struct complex *complex, const struct star *star,
                           const double p[3], double *out)
{
    double range[2];
    if (field->is_ids) {
        contract_ids(field, complex, star, p, out);
        return;
    }
    for (uint32_t c = 0; c < field->components; c++) {
        extremes(complex, star, field->values + c, field->components, p, false, range);
        double middle = (range[0] + range[1]) / 2;
        double spread = (range[1] - range[0]) / 2;
        star_range(complex, star, field->values + c, field->components, range);
        middle = field_round(field, c, smaller(larger(middle, range[0]), range[1]));
        out[c] = cheap_value(complex, field, c, star, p, middle, larger(range[0], middle - spread),
                             smaller(range[1], middle + spread), spread / CHEAP_PART);
    }
}

/* All components of a field drive, or none. */
static bool drives(const struct fields *fields, uint32_t field)
{
    for (uint32_t d = 0; d < fields->driver_count; d++)
        if (fields->drivers[d].field == field)
            return true;
    return false;
}

void fields_contract(struct fields *fields, const struct complex *complex, const struct star *star, const double p[3],
                     const struct outcome *outcome)
{
    const struct log_field *log = complex->log.fields; // of the contraction that complex_contract will log
    uint32_t c = complex->log.count, v = star->simplex[0];
    for (uint32_t f = 0; f < fields->count; f++) {
        struct working_field *field = &fields->fields[f];
        if (!drives(fields, f))
            contract_field(field, complex, star, p, log[f].values + (size_t)c * field->components);
    }
    for (uint32_t d = 0; d < fields->driver_count; d++) {
        struct driver *driver = &fields->drivers[d];
        struct working_field *field = &fields->fields[driver->field];
        log[driver->field].values[(size_t)c * field->components + driver->component] = outcome[d].value;
        driver->upper[v] = outcome[d].upper;
        driver->lower[v] = outcome[d].lower;
        driver->predicted[v] = outcome[d].predicted;
        if (driver->quadrics) {
            double sum[QUADRIC_SIZE];
            driver_quadric(driver, star, sum);
            memcpy(driver->quadrics + QUADRIC_SIZE * (size_t)v, sum, sizeof sum);
        }
    }
    for (uint32_t f = 0; f < fields->count; f++) {
        struct working_field *field = &fields->fields[f];
        double *now = field->values + (size_t)v * field->components, *node = log[f].values + (size_t)c * field->components;
        for (uint32_t k = 0; k < field->components; k++) {
            now[k] = node[k];
            node[k] += field->middles[k];
        }
    }
}
