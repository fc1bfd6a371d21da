/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/simplify/merge.h"

#include <float.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "src/mesh/tet_geom.h"
#include "src/util/array.h"
#include "src/util/wide.h"

/* An edge, and what contracting it makes of its vertices. */
struct join {
    uint32_t kept, dead;
    bool at_one_point; /* both are at one point: nothing moves */
    double p[3];
};

/* ---- the outcome */

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

/* Lists the star of one end; those with the other end only if it is the first. */
static void list_star(const struct run *run, struct weighing *weighing, uint32_t *list, uint32_t end, uint32_t other, bool first)
{
    static const uint8_t others_of[4][3] = {{1, 2, 3}, {0, 3, 2}, {0, 1, 3}, {0, 2, 1}};
    const struct working *working = run->working;
    const struct span *star = &working->stars[end];
    for (uint32_t i = 0; i < star->count; i++) {
        uint32_t tet = working->pool[star->begin + i];
        const uint32_t *corners = working->corners[tet];
        if (corners[0] == TETLOD_NONE)
            continue;
        bool both = corners[0] == other || corners[1] == other || corners[2] == other || corners[3] == other;
        if (both && !first)
            continue;
        const uint8_t *others = others_of[corner_of(corners, end)];
        uint32_t at = weighing->count++;
        list[at] = tet;
        weighing->moves[at] = !both;
        for (int k = 0; k < 4; k++) {
            uint32_t slot = weighing->slots[at][k] = k ? corners[others[k - 1]] : end;
            weighing->rows[k][at] = working_row(working, slot);
            __builtin_prefetch(working->values + (size_t)working->value_count * slot); // for say_all
            __builtin_prefetch(&run->proposals[slot]);                                 // for touch_stars
        }
    }
}

/* What the worker says of four values of the slots, by their number. */
static struct said *said_of(const struct worker *worker, uint32_t value)
{
    return &worker->said[value / WIDE];
}

/* Where both ends are at one point, only they say something. */
static void say_ends(const struct join *join, const double *values, size_t stride, uint32_t count, struct said *out)
{
    for (uint32_t c = 0; c < count; c++) {
        double first = values[join->kept * stride + c], second = values[join->dead * stride + c];
        out->low[c] = out->least[c] = smaller(first, second);
        out->high[c] = out->greatest[c] = larger(first, second);
        out->mean[c] = (first + second) / 2;
    }
}

/* All values that the slots have. */
static void say_all(const struct run *run, const struct worker *worker, const struct join *join)
{
    const struct working *working = run->working;
    uint32_t stride = working->value_count;
    for (uint32_t first = 0; first < stride; first += WIDE) {
        uint32_t count = stride - first < WIDE ? stride - first : WIDE;
        if (join->at_one_point)
            say_ends(join, working->values + first, stride, count, said_of(worker, first));
        else
            run->kernels->say(&worker->weighing, working->values + first, stride, count, said_of(worker, first));
    }
}

static void set_shares(struct weighing *weighing)
{
    double sum = 0;
    for (uint32_t i = 0; i < weighing->count; i++) {
        weighing->shares[i] = 1 / (1 + fabs(weighing->weights[0][i]) + fabs(weighing->weights[1][i]) + fabs(weighing->weights[2][i]));
        sum += weighing->shares[i];
    }
    for (uint32_t i = 0; i < weighing->count; i++)
        weighing->shares[i] /= sum;
}

static void bound_ends(const struct working *working, const double *a, const double *b, double *upper, double *lower, double *means)
{
    for (uint32_t c = 0; c < working->component_count; c++) {
        uint32_t column = ROW_FIELDS + 2 * c;
        upper[c] = larger(a[column], b[column]);
        lower[c] = smaller(a[column + 1], b[column + 1]);
        means[c] = (upper[c] + lower[c]) / 2;
    }
}

static void bound_star(const struct run *run, const struct weighing *weighing, double *upper, double *lower, double *means)
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

/* U and L of the result in the worker's numbers. False: a tetrahedron would not be well oriented. */
static bool find_bounds(const struct run *run, struct worker *worker, const struct join *join)
{
    const struct working *working = run->working;
    const double *a = working_row(working, join->dead), *b = working_row(working, join->kept);
    double *upper = numbers_of(run, worker, NUMBERS_UPPER), *lower = numbers_of(run, worker, NUMBERS_LOWER);
    double *means = numbers_of(run, worker, NUMBERS_MEAN);
    worker->weighing.count = 0;
    list_star(run, &worker->weighing, worker->list, join->dead, join->kept, true);
    list_star(run, &worker->weighing, worker->list, join->kept, join->dead, false);
    if (!join->at_one_point && !run->kernels->weigh(&worker->weighing, join->p))
        return false;
    if (!join->at_one_point)
        set_shares(&worker->weighing);
    if (join->at_one_point)
        bound_ends(working, a, b, upper, lower, means);
    else
        bound_star(run, &worker->weighing, upper, lower, means);
    return true;
}

/* ---- making it so */

/* The values that cost next to nothing: those of the ends that are where the result is, or the mean of both. */
static uint32_t free_values(const struct working *working, const struct join *join, uint32_t field, uint32_t component,
                            double out[2])
{
    uint32_t ends[2] = {join->kept, join->dead}, count = 0;
    double sum = 0;
    for (int end = 0; end < 2; end++) {
        double value = working_values(working, ends[end], field)[component];
        sum += value;
        if (memcmp(working_row(working, ends[end]), join->p, sizeof join->p) == 0)
            out[count++] = value;
    }
    if (!count)
        out[count++] = field_round(&working->fields[field], component, sum / 2);
    return count;
}

/* The mean of what the star's interpolants say, as near to it as is allowed. It is nearer to the original on average (DEFAULTS.md). */
static double near_mean(const struct working_field *field, uint32_t component, double mean, double middle, double least,
                        double greatest)
{
    double most = 0.99 * (greatest - least) / 2; // so that rounding stays within
    double value = field_round(field, component, smaller(larger(mean, middle - most), middle + most));
    return value >= least && value <= greatest ? value : middle;
}

/* Takes values that are better or cost few bits in place of the middles of U and L, where the errors are no larger then than what the
 * rounds before have come to. And the predictions of these values, from those that the fields still have. */
static void choose_values(const struct run *run, const struct worker *worker, const struct join *join, double *values,
                          double *predicted)
{
    const struct working *working = run->working;
    const double *upper = numbers_of(run, worker, NUMBERS_UPPER), *lower = numbers_of(run, worker, NUMBERS_LOWER);
    const double *means = numbers_of(run, worker, NUMBERS_MEAN);
    for (uint32_t c = 0; c < working->component_count; c++) {
        const struct controlled *component = &working->components[c];
        const struct working_field *field = &working->fields[component->field];
        double there[2], error = component->scale > 0 ? run->certified[c] / component->scale : 0;
        double least = upper[c] - error, greatest = lower[c] + error;
        uint32_t at = working->firsts[component->field] + component->component;
        const struct said *said = said_of(worker, at);
        if (component->scale > 0) {
            uint32_t count = free_values(working, join, component->field, component->component, there);
            double value = near_mean(field, component->component, means[c], values[c], least, greatest);
            values[c] = field_cheap(field, component->component, there, count, value, least, greatest, error / CHEAP_PART);
        }
        predicted[c] = component->predicted[join->kept] + component->predicted[join->dead] +
                       larger(said->greatest[at % WIDE] - values[c], values[c] - said->least[at % WIDE]);
    }
}

/* A value among those of the star's vertices: what is not controlled has no bound that keeps it from extrapolating. */
static double carried_value(const struct worker *worker, const struct working *working, const struct join *join, uint32_t f,
                            uint32_t component)
{
    const struct working_field *field = &working->fields[f];
    uint32_t at = working->firsts[f] + component, i = at % WIDE;
    const struct said *said = said_of(worker, at);
    double there[2], spread = (said->greatest[i] - said->least[i]) / 2;
    if (field->is_ids) { // of the end that stays where it is, if one does
        bool dead = memcmp(working_row(working, join->dead), join->p, sizeof join->p) == 0;
        return working_values(working, dead ? join->dead : join->kept, f)[component];
    }
    double value = field_round(field, component, smaller(larger(said->mean[i], said->low[i]), said->high[i]));
    uint32_t count = free_values(working, join, f, component, there);
    return field_cheap(field, component, there, count, value, larger(said->low[i], value - spread),
                       smaller(said->high[i], value + spread), spread / CHEAP_PART);
}

static bool is_controlled(const struct working *working, uint32_t field)
{
    for (uint32_t c = 0; c < working->component_count; c++)
        if (working->components[c].field == field)
            return true;
    return false;
}

/* Fields that are not controlled. */
static void carry_fields(const struct worker *worker, const struct working *working, const struct join *join)
{
    for (uint32_t f = 0; f < working->field_count; f++) {
        bool carried = !is_controlled(working, f);
        for (uint32_t c = 0; c < working->fields[f].components && carried; c++)
            working_values(working, join->kept, f)[c] = carried_value(worker, working, join, f, c);
    }
}

static void log_values(const struct working *working, const struct join *join, uint32_t record)
{
    for (uint32_t f = 0; f < working->field_count; f++) {
        const struct working_field *field = &working->fields[f];
        size_t k = field->components;
        for (size_t c = 0; c < k; c++)
            working->log->fields[f].values[record * k + c] = working_values(working, join->kept, f)[c] + field->middles[c];
    }
}

static void set_components(const struct working *working, const struct join *join, const double *values, double *predicted)
{
    for (uint32_t c = 0; c < working->component_count; c++) {
        struct controlled *component = &working->components[c];
        component->predicted[join->kept] = predicted[c];
        predicted[c] *= component->scale;
        working_values(working, join->kept, component->field)[component->component] = values[c];
    }
}

static void set_row(const struct run *run, const struct worker *worker, const struct join *join, double moved)
{
    const struct working *working = run->working;
    const double *upper = numbers_of(run, worker, NUMBERS_UPPER), *lower = numbers_of(run, worker, NUMBERS_LOWER);
    double *row = working_row(working, join->kept);
    memcpy(row, join->p, sizeof join->p);
    for (uint32_t c = 0; c < working->component_count; c++) {
        row[ROW_FIELDS + 2 * c] = upper[c];
        row[ROW_FIELDS + 2 * c + 1] = lower[c];
    }
    row[row_moved(working)] = moved;
}

/* The slot's star has changed. Others of the round may say so, too. */
static void touch(const struct run *run, uint32_t slot)
{
    __atomic_store_n(&run->proposals[slot].dirty, TOUCHED, __ATOMIC_RELAXED);
    __atomic_store_n(&run->proposals[slot].changed, run->round, __ATOMIC_RELAXED);
}

static bool list_slot(uint32_t **list, size_t *count, size_t *room, uint32_t slot)
{
    void *grown = *list;
    if (!array_reserve(&grown, room, *count + 1, sizeof **list))
        return false;
    *list = grown;
    (*list)[(*count)++] = slot;
    return true;
}

static bool reserve(struct worker *worker, size_t tets)
{
    void *list = worker->list;
    bool room = array_reserve(&list, &worker->list_room, tets, sizeof *worker->list) &&
                reserve_weighing(&worker->weighing, tets);
    worker->list = list;
    worker->failed |= !room;
    return room;
}

/* It is not to be after all: the slot waits for that error. */
static void refuse(const struct run *run, struct worker *worker, uint32_t slot, double error, enum log_refusal refusal)
{
    worker->refused[refusal]++;
    run->proposals[slot].priority = PROPOSES_NOTHING;
    run->proposals[slot].waits = run->proposals[slot].waits_changed = (float)larger(error, run->limit * (1 + 1e-6));
}

/* What a result waits for before it is looked at, as a multiple of its own error: hardly any can be contracted within less. */
static const double RESULT_WAITS = 2;

/* All vertices of both stars have changed. Lists what has to be looked at when the round is over: kinds of boundary vertices, and
 * whether vertices are still frozen. */
static void touch_stars(const struct run *run, struct worker *worker, const struct join *join, uint32_t tets)
{
    const struct working *working = run->working;
    bool opens = working->flags[join->dead] & VERTEX_BOUNDARY;
    for (uint32_t i = 0; i < tets; i++)
        for (int c = 0; c < 4; c++) {
            uint32_t slot = working->corners[worker->list[i]][c];
            bool room = true;
            if (slot == join->dead)
                continue;
            if (slot != join->kept && __atomic_load_n(&run->proposals[slot].changed, __ATOMIC_RELAXED) != run->round)
                touch(run, slot);
            if (opens && working->flags[slot] & VERTEX_BOUNDARY)
                room = list_slot(&worker->open, &worker->open_count, &worker->open_room, slot);
            if (room && join->at_one_point && working->flags[slot] & VERTEX_FROZEN)
                room = list_slot(&worker->unfreezing, &worker->unfreezing_count, &worker->unfreezing_room, slot);
            worker->failed |= !room;
        }
}

void merge(const struct run *run, struct worker *worker, uint32_t slot, uint32_t record, struct merged *out, double *certified,
           double *predicted)
{
    struct working *working = run->working;
    uint32_t target = run->proposals[slot].target;
    struct join join = {.kept = target / 2, .dead = slot};
    uint32_t ends[2] = {join.dead, join.kept};
    double *values = numbers_of(run, worker, NUMBERS_RISE), moved = 0, most = run->border.limit;
    *out = (struct merged){.kept = join.kept};
    if (!reserve(worker, (size_t)working->stars[join.dead].count + working->stars[join.kept].count))
        return;
    join.at_one_point = distance_squared(working_row(working, join.dead), working_row(working, join.kept)) == 0;
    if (target % 2)
        middle_of(working, join.dead, join.kept, join.p);
    else
        memcpy(join.p, working_row(working, join.kept), sizeof join.p);
    if (!find_bounds(run, worker, &join)) {
        refuse(run, worker, slot, 0, LOG_REFUSED_FLIP);
        return;
    }
    if ((working->flags[join.dead] | working->flags[join.kept]) & VERTEX_BOUNDARY) {
        moved = border_moves(&run->border, working, ends, join.p, &worker->map);
        if (isinf(moved)) {
            refuse(run, worker, slot, 0, LOG_REFUSED_BOUNDARY);
            return;
        }
        most = boundary_map_most(&worker->map, run->border.most);
        add_demands(run, worker);
    }
    double error = assigned_error(run, worker, values);
    if (!(error <= run->limit * (1 + LIMIT_TIE))) {
        refuse(run, worker, slot, error, LOG_REFUSED_ROUNDING);
        return;
    }
    say_all(run, worker, &join);
    choose_values(run, worker, &join, values, predicted);
    const double *upper = numbers_of(run, worker, NUMBERS_UPPER), *lower = numbers_of(run, worker, NUMBERS_LOWER);
    for (uint32_t c = 0; c < working->component_count; c++) {
        const struct controlled *component = &working->components[c];
        double worst = larger(upper[c] - values[c], values[c] - lower[c]);
        double named = component->factor > 0 ? run->limit / component->factor * component->scale : INFINITY;
        certified[c] = smaller(smaller(worst * component->scale, named), 1); // within rounding of the limit is the limit
        if (working->log->components[c].bounds)
            working->log->components[c].bounds[record] = worst;
    }
    carry_fields(worker, working, &join);
    set_components(working, &join, values, predicted);
    log_values(working, &join, record);
    uint32_t *children = working->log->children + 4 * (size_t)record;
    children[0] = working->node[join.kept];
    children[1] = working->node[join.dead];
    children[2] = children[3] = TETLOD_NONE;
    memcpy(working->log->positions + 3 * (size_t)record, join.p, sizeof join.p);
    touch_stars(run, worker, &join, worker->weighing.count);
    set_row(run, worker, &join, moved);
    run->border.most[join.kept] = most;
    run->proposals[join.kept].priority = run->proposals[join.dead].priority = PROPOSES_NOTHING;
    run->proposals[join.kept].waits = run->proposals[join.kept].waits_changed = (float)(RESULT_WAITS * error);
    *out = (struct merged){true, join.kept, working_contract(working, join.kept, join.dead, worker->list), moved};
}
