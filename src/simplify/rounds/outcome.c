/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/simplify/rounds/outcome.h"

#include <math.h>
#include <stdlib.h>

#include "src/mesh/tet_geom.h"
#include "src/util/array.h"

/* ---- the star */

static bool reserve_weighing(struct weighing *weighing, size_t count)
{
    if (count + WIDE <= weighing->room)
        return true;
    size_t room = count + count / 2 + 64;
    bool done = true;
    free(weighing->slots);
    free(weighing->moves);
    free(weighing->spread);
    free(weighing->shares);
    for (int k = 0; k < 4; k++) {
        free(weighing->rows[k]);
        done &= (weighing->rows[k] = array_new(room, sizeof **weighing->rows)) != NULL;
    }
    for (int k = 0; k < 3; k++) {
        free(weighing->weights[k]);
        done &= (weighing->weights[k] = array_new(room, sizeof(double))) != NULL;
    }
    weighing->slots = array_new(room, sizeof *weighing->slots);
    weighing->moves = array_new(room, 1);
    weighing->spread = array_new(room, sizeof(double));
    weighing->shares = array_new(room, sizeof(double));
    done &= weighing->slots && weighing->moves && weighing->spread && weighing->shares;
    weighing->room = done ? room : 0;
    return done;
}

/* Lists the star of one of the simplex's vertices, without what came with an earlier one. */
static void list_star(const struct run *run, struct weighing *weighing, uint32_t *list, const struct join *join,
                      uint32_t of)
{
    static const uint8_t others_of[4][3] = {{1, 2, 3}, {0, 3, 2}, {0, 1, 3}, {0, 2, 1}};
    const struct working *working = run->working;
    uint32_t end = join->simplex[of];
    const struct span *star = &working->stars[end];
    for (uint32_t i = 0; i < star->count; i++) {
        uint32_t tet = working->pool[star->begin + i];
        const uint32_t *corners = working->corners[tet];
        if (corners[0] == TETLOD_NONE || tet_has_other(corners, join->simplex, of, of))
            continue;
        const uint8_t *others = others_of[corner_of(corners, end)];
        uint32_t at = weighing->count++;
        list[at] = tet;
        weighing->moves[at] = !tet_has_other(corners, join->simplex + of + 1, join->count - of - 1, join->count);
        for (int k = 0; k < 4; k++) {
            uint32_t slot = weighing->slots[at][k] = k ? corners[others[k - 1]] : end;
            weighing->rows[k][at] = working_row(working, slot);
            if (!k) // every tetrahedron has that one
                continue;
            __builtin_prefetch(working->values + (size_t)working->value_count * slot); // for say_all
            __builtin_prefetch(&run->proposals[slot]);                                 // for touch_star
        }
    }
}

bool outcome_list(const struct run *run, struct worker *worker, const struct join *join)
{
    size_t tets = 0;
    for (uint32_t s = 0; s < join->count; s++)
        tets += run->working->stars[join->simplex[s]].count;
    bool room = ARRAY_RESERVE(worker->list, worker->list_room, tets) && reserve_weighing(&worker->weighing, tets);
    worker->failed |= !room;
    worker->weighing.count = 0;
    for (uint32_t s = 0; s < join->count && room; s++)
        list_star(run, &worker->weighing, worker->list, join, s);
    return room;
}

static void set_shares(struct weighing *weighing)
{
    double sum = 0;
    for (uint32_t i = 0; i < weighing->count; i++) {
        weighing->shares[i] = 1 / (1 + fabs(weighing->weights[0][i]) + fabs(weighing->weights[1][i]) +
                                   fabs(weighing->weights[2][i]));
        sum += weighing->shares[i];
    }
    for (uint32_t i = 0; i < weighing->count; i++)
        weighing->shares[i] /= sum;
}

bool outcome_weigh(const struct run *run, struct worker *worker, const struct join *join)
{
    if (join->at_one_point)
        return true;
    bool fits = run->kernels->weigh(&worker->weighing, join->p);
    set_shares(&worker->weighing);
    return fits;
}

/* ---- U and L */

/* Where all vertices are at one point, only they say something. */
static void bound_ends(const struct working *working, const struct join *join, double *upper, double *lower,
                       double *means)
{
    for (uint32_t c = 0; c < working->component_count; c++) {
        uint32_t column = ROW_FIELDS + 2 * c;
        upper[c] = -INFINITY;
        lower[c] = INFINITY;
        for (uint32_t s = 0; s < join->count; s++) {
            const double *row = working_row(working, join->simplex[s]);
            upper[c] = larger(upper[c], row[column]);
            lower[c] = smaller(lower[c], row[column + 1]);
        }
        means[c] = (upper[c] + lower[c]) / 2;
    }
}

static void bound_star(const struct run *run, const struct weighing *weighing, double *upper, double *lower,
                       double *means)
{
    struct bounds bounds;
    for (uint32_t c = 0; c < run->working->component_count; c++) {
        uint32_t at = 2 * c % WIDE; // U, and L behind it
        if (at == 0)
            run->kernels->bound(weighing, ROW_FIELDS + 2 * c, &bounds);
        upper[c] = bounds.upper[at];
        lower[c] = bounds.lower[at + 1];
        means[c] = (bounds.mean[at] + bounds.mean[at + 1]) / 2;
    }
}

void outcome_bounds(const struct run *run, struct worker *worker, const struct join *join)
{
    double *upper = numbers_of(run, worker, NUMBERS_UPPER), *lower = numbers_of(run, worker, NUMBERS_LOWER);
    double *means = numbers_of(run, worker, NUMBERS_MEAN);
    if (join->at_one_point)
        bound_ends(run->working, join, upper, lower, means);
    else
        bound_star(run, &worker->weighing, upper, lower, means);
}

/* ---- values */

static void values_of_ends(const struct join *join, const double *values, size_t stride, uint32_t count,
                           struct star_values *out)
{
    for (uint32_t c = 0; c < count; c++) {
        double least = INFINITY, greatest = -INFINITY, sum = 0;
        for (uint32_t s = join->count; s-- > 0;) {
            double value = values[join->simplex[s] * stride + c];
            least = smaller(least, value);
            greatest = larger(greatest, value);
            sum += value;
        }
        out->low[c] = out->least[c] = least;
        out->high[c] = out->greatest[c] = greatest;
        out->mean[c] = sum / join->count;
    }
}

/* Has one of the values from this on, of those that are evaluated together, a controlled component? */
static bool has_controlled(const struct working *working, uint32_t first)
{
    for (uint32_t c = 0; c < working->component_count; c++)
        if ((working->firsts[working->components[c].field] + working->components[c].component) / WIDE == first / WIDE)
            return true;
    return false;
}

void outcome_say(const struct run *run, const struct worker *worker, const struct join *join, bool controlled_only)
{
    const struct working *working = run->working;
    uint32_t stride = working->value_count;
    for (uint32_t first = 0; first < stride; first += WIDE) {
        uint32_t count = stride - first < WIDE ? stride - first : WIDE;
        struct star_values *star_values = &worker->star_values[first / WIDE];
        if (controlled_only && !has_controlled(working, first))
            continue;
        if (join->at_one_point)
            values_of_ends(join, working->values + first, stride, count, star_values);
        else
            run->kernels->values_at(&worker->weighing, working->values + first, stride, count, star_values);
    }
}

void outcome_demands(const struct run *run, struct worker *worker)
{
    double *upper = numbers_of(run, worker, NUMBERS_UPPER), *lower = numbers_of(run, worker, NUMBERS_LOWER);
    const struct working *working = run->working;
    for (uint32_t c = 0; c < working->component_count && worker->map.point_count; c++) {
        const double *values = working->rows + ROW_FIELDS + 2 * c; // U, then L
        upper[c] = larger(upper[c], boundary_map_least(&worker->map, values, working->stride, 0));
        lower[c] = smaller(lower[c], boundary_map_greatest(&worker->map, values + 1, working->stride));
    }
}

double outcome_middles(const struct run *run, const struct worker *worker, double *values)
{
    const double *upper = numbers_of(run, worker, NUMBERS_UPPER), *lower = numbers_of(run, worker, NUMBERS_LOWER);
    double worst = 0;
    for (uint32_t c = 0; c < run->working->component_count; c++) {
        const struct component *component = &run->working->components[c];
        double value =
            field_round(&run->working->fields[component->field], component->component, (upper[c] + lower[c]) / 2);
        worst = larger(worst, larger(upper[c] - value, value - lower[c]) * component->factor);
        if (values)
            values[c] = value;
    }
    return worst;
}

/* Scalar value assignment (thesis 4.1): the middle of what the star's interpolants say; what the vertices had adds
 * up. */
static double assign_middle(const struct run *run, const struct worker *worker, const struct join *join, uint32_t c,
                            double *value)
{
    const struct component *component = &run->working->components[c];
    const struct working_field *field = &run->working->fields[component->field];
    uint32_t at = run->working->firsts[component->field] + component->component;
    const struct star_values *at_star = outcome_star_values(worker, at);
    double least = at_star->least[at % WIDE], greatest = at_star->greatest[at % WIDE], before = 0;
    for (uint32_t s = 0; s < join->count; s++)
        before += component->predicted[join->simplex[s]];
    *value = field_round(field, component->component, (least + greatest) / 2);
    return before + larger(greatest - *value, *value - least);
}

/* The value that makes the quadric least, as near to it as the limit allows. */
static double assign_quadric(const struct run *run, const struct worker *worker, const struct join *join, uint32_t c,
                             double *value,
                             double *cost)
{
    const struct component *component = &run->working->components[c];
    double upper = numbers_of(run, worker, NUMBERS_UPPER)[c], lower = numbers_of(run, worker, NUMBERS_LOWER)[c];
    double quadric[QUADRIC_SIZE], p[3], middle = (upper + lower) / 2, s = middle * component->scale;
    quadrics_of(&run->quadrics, run->working, join->simplex, join->count, c, quadric);
    quadrics_place(&run->quadrics, join->p, p);
    *cost += quadric_least_at(quadric, p, &s);
    if (component->scale > 0 && isfinite(s)) {
        double room = larger(run->limit / component->factor - (upper - lower) / 2, 0);
        middle = smaller(larger(s / component->scale, middle - room), middle + room);
    }
    *value = field_round(&run->working->fields[component->field], component->component, middle);
    return larger(upper - *value, *value - lower);
}

double outcome_values(const struct run *run, const struct worker *worker, const struct join *join, double *values,
                      double *cost)
{
    double worst = 0, sum = 0, value;
    if (run->metric == METRIC_ENVELOPE)
        return outcome_middles(run, worker, values);
    for (uint32_t c = 0; c < run->working->component_count; c++) {
        double error = run->metric == METRIC_SVA ? assign_middle(run, worker, join, c, &value)
                                                 : assign_quadric(run, worker, join, c, &value, &sum);
        worst = larger(worst, error * run->working->components[c].factor);
        if (values)
            values[c] = value;
    }
    if (cost)
        *cost = sum;
    return worst;
}

double outcome_estimate(const struct run *run, const struct join *join, double *cost)
{
    double worst = 0, p[3];
    quadrics_place(&run->quadrics, join->p, p);
    *cost = 0;
    for (uint32_t c = 0; c < run->working->component_count; c++) {
        const struct component *component = &run->working->components[c];
        double quadric[QUADRIC_SIZE], s = 0;
        quadrics_of(&run->quadrics, run->working, join->simplex, join->count, c, quadric);
        double least = quadric_least_at(quadric, p, &s), weight = quadric_weight(quadric);
        *cost += least;
        if (weight > 0 && component->scale > 0)
            worst = larger(worst, sqrt(least / weight) * component->factor / component->scale);
    }
    return worst;
}
