/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/simplify/rounds/merge.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "src/mesh/tet_geom.h"
#include "src/simplify/rounds/evaluate.h"
#include "src/simplify/rounds/outcome.h"
#include "src/simplify/rounds/simplices.h"
#include "src/util/array.h"
#include "src/util/wide.h"

/* ---- making it so */

/* The values that cost next to nothing: those of the vertices that are where the result is, or the mean of all. */
static uint32_t free_values(const struct working *working, const struct join *join, uint32_t field, uint32_t component,
                            double out[4])
{
    uint32_t count = 0;
    double sum = 0;
    for (uint32_t s = join->count; s-- > 0;) {
        double value = working_values(working, join->simplex[s], field)[component];
        sum += value;
        if (memcmp(working_row(working, join->simplex[s]), join->p, sizeof join->p) == 0)
            out[count++] = value;
    }
    if (!count)
        out[count++] = field_round(&working->fields[field], component, sum / join->count);
    return count;
}

/* The mean of what the star's interpolants say, as near to it as is allowed. It is nearer to the original on average
 * (DEFAULTS.md). */
static double near_mean(const struct working_field *field, uint32_t component, double mean, double middle, double least,
                        double greatest)
{
    double most = 0.99 * (greatest - least) / 2; // so that rounding stays within
    double value = field_round(field, component, smaller(larger(mean, middle - most), middle + most));
    return value >= least && value <= greatest ? value : middle;
}

/* A value that is better or costs few bits in place of the middle of U and L, where the error is no larger then than
 * what the rounds before have come to. */
static double better_value(const struct run *run, const struct worker *worker, const struct join *join, uint32_t c,
                           double value)
{
    const struct working *working = run->working;
    const struct component *component = &working->components[c];
    const struct working_field *field = &working->fields[component->field];
    double there[4], error = component->scale > 0 ? run->certified[c] / component->scale : 0;
    double least = numbers_of(run, worker, NUMBERS_UPPER)[c] - error,
           greatest = numbers_of(run, worker, NUMBERS_LOWER)[c] + error;
    if (!(component->scale > 0))
        return value;
    uint32_t count = free_values(working, join, component->field, component->component, there);
    value = near_mean(field, component->component, numbers_of(run, worker, NUMBERS_MEAN)[c], value, least, greatest);
    return field_cheap(field, component->component, there, count, value, least, greatest, error / CHEAP_PART);
}

/* Where the envelope orders, better values; and the predictions of the values, from those that the fields still
 * have. */
static void choose_values(const struct run *run, const struct worker *worker, const struct join *join, double *values,
                          double *predicted)
{
    const struct working *working = run->working;
    for (uint32_t c = 0; c < working->component_count; c++) {
        const struct component *component = &working->components[c];
        uint32_t at = working->firsts[component->field] + component->component;
        const struct star_values *at_star = outcome_star_values(worker, at);
        if (run->metric == METRIC_ENVELOPE)
            values[c] = better_value(run, worker, join, c, values[c]);
        predicted[c] = component->predicted[join_kept(join)];
        for (uint32_t s = join->count - 1; s-- > 0;)
            predicted[c] += component->predicted[join->simplex[s]];
        predicted[c] += larger(at_star->greatest[at % WIDE] - values[c], values[c] - at_star->least[at % WIDE]);
    }
}

/* The vertex that stays where it is, if one does. */
static uint32_t staying_vertex(const struct working *working, const struct join *join)
{
    for (uint32_t s = 0; s + 1 < join->count; s++)
        if (memcmp(working_row(working, join->simplex[s]), join->p, sizeof join->p) == 0)
            return join->simplex[s];
    return join_kept(join);
}

/* A value among those of the star's vertices: what is not controlled has no bound that keeps it from extrapolating. */
static double carried_value(const struct worker *worker, const struct working *working, const struct join *join,
                            uint32_t f,
                            uint32_t component)
{
    const struct working_field *field = &working->fields[f];
    uint32_t at = working->firsts[f] + component, i = at % WIDE;
    const struct star_values *at_star = outcome_star_values(worker, at);
    double there[4], spread = (at_star->greatest[i] - at_star->least[i]) / 2;
    if (field->is_ids)
        return working_values(working, staying_vertex(working, join), f)[component];
    double value = field_round(field, component, smaller(larger(at_star->mean[i], at_star->low[i]), at_star->high[i]));
    uint32_t count = free_values(working, join, f, component, there);
    return field_cheap(field, component, there, count, value, larger(at_star->low[i], value - spread),
                       smaller(at_star->high[i], value + spread), spread / CHEAP_PART);
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
            working_values(working, join_kept(join), f)[c] = carried_value(worker, working, join, f, c);
    }
}

static void log_values(const struct working *working, const struct join *join, uint32_t record)
{
    for (uint32_t f = 0; f < working->field_count; f++) {
        const struct working_field *field = &working->fields[f];
        size_t k = field->components;
        for (size_t c = 0; c < k; c++)
            working->log->fields[f].values[record * k + c] = working_values(working, join_kept(join),
                                                                            f)[c] + field->middles[c];
    }
}

static void set_components(const struct working *working, const struct join *join, const double *values,
                           double *predicted)
{
    for (uint32_t c = 0; c < working->component_count; c++) {
        struct component *component = &working->components[c];
        component->predicted[join_kept(join)] = predicted[c];
        predicted[c] *= component->scale;
        working_values(working, join_kept(join), component->field)[component->component] = values[c];
    }
}

static void set_row(const struct run *run, const struct worker *worker, const struct join *join, double moved)
{
    const struct working *working = run->working;
    const double *upper = numbers_of(run, worker, NUMBERS_UPPER), *lower = numbers_of(run, worker, NUMBERS_LOWER);
    double *row = working_row(working, join_kept(join));
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
    if (!ARRAY_RESERVE(*list, *room, *count + 1))
        return false;
    (*list)[(*count)++] = slot;
    return true;
}

/* It is not to be after all: the slot waits for that error. */
static void refuse(const struct run *run, struct worker *worker, uint32_t slot, double error, enum log_refusal refusal)
{
    worker->refused[refusal]++;
    run->proposals[slot].priority = PROPOSES_NOTHING;
    run->proposals[slot].waits = run->proposals[slot].waits_changed = (float)larger(error, run->limit * (1 + 1e-6));
}

/* Do all tetrahedra that the contraction moves stay in the box? */
static bool stays_in_box(const struct run *run, const struct weighing *weighing, const struct join *join)
{
    for (uint32_t i = 0; i < weighing->count && run->box && !join->at_one_point; i++) {
        const double *points[4] = {join->p, weighing->rows[1][i], weighing->rows[2][i], weighing->rows[3][i]};
        double middle[3];
        tetlodi_middle_of_box(points, middle);
        if (weighing->moves[i] && !tetlodi_in_box(run->box, middle))
            return false;
    }
    return true;
}

/* What a result waits for before it is looked at, as a multiple of its own error: hardly any can be contracted within
 * less. */
static const double RESULT_WAITS = 2;

/* A vertex around the result: its star has changed, unless that is known from another of its tetrahedra. */
static void touch_around(const struct run *run, uint32_t slot, uint32_t kept)
{
    if (__atomic_load_n(&run->proposals[slot].changed, __ATOMIC_RELAXED) != run->round)
        touch(run, slot);
    if (run->plans && slot < kept) { // simplices with the result are its own, and new
        float none = 0;
        __atomic_store(&run->proposals[slot].waits, &none, __ATOMIC_RELAXED);
        __atomic_store(&run->proposals[slot].waits_changed, &none, __ATOMIC_RELAXED);
    }
}

/* Lists a vertex that has to be looked at when the round is over: the kind of one at the boundary, if faces of it may
 * have changed, and whether it is still frozen, where nothing has moved. */
static void list_for_later(const struct run *run, struct worker *worker, uint32_t slot, bool opens, bool thaws)
{
    bool room = true;
    if (opens && run->working->flags[slot] & VERTEX_BOUNDARY)
        room = list_slot(&worker->open, &worker->open_count, &worker->open_room, slot);
    if (room && thaws && run->working->flags[slot] & VERTEX_FROZEN)
        room = list_slot(&worker->unfreezing, &worker->unfreezing_count, &worker->unfreezing_room, slot);
    worker->failed |= !room;
}

/* All vertices of the star have changed. */
static void touch_star(const struct run *run, struct worker *worker, const struct join *join)
{
    const struct weighing *weighing = &worker->weighing;
    uint32_t kept = join_kept(join), dead = join->count - 1;
    bool opens = false;
    for (uint32_t s = 0; s < dead; s++)
        opens |= run->working->flags[join->simplex[s]] & VERTEX_BOUNDARY;
    list_for_later(run, worker, kept, opens, join->at_one_point);
    for (uint32_t i = 0; i < weighing->count; i++) {
        bool faces = opens && run->working->boundary_faces[worker->list[i]];
        for (int c = 1; c < 4; c++) { // the first is of the simplex
            uint32_t slot = weighing->slots[i][c];
            if (!weighing->moves[i] && (slot == kept || is_of(join->simplex, dead, slot)))
                continue;
            touch_around(run, slot, kept);
            if (faces || join->at_one_point)
                list_for_later(run, worker, slot, faces, join->at_one_point);
        }
    }
}

/* The slot's proposal, to where it leads. */
static struct join find_join(const struct run *run, uint32_t slot, const struct answer *answer)
{
    const struct working *working = run->working;
    struct join join = {.count = 0};
    join.count = proposed_simplex(run, slot, join.simplex);
    join.at_one_point = simplex_at_one_point(working, join.simplex, join.count);
    if (answer)
        memcpy(join.p, answer->position, sizeof join.p);
    else if (run->plans)
        simplex_position(run, &join, run->plans[slot].candidate, join.p);
    else if (run->proposals[slot].target % 2)
        middle_of(working, slot, join_kept(&join), join.p);
    else
        memcpy(join.p, working_row(working, join_kept(&join)), sizeof join.p);
    return join;
}

/* How far the boundary has moved at the result in all, at most by *most; INFINITY: it may not. */
static double move_boundary(const struct run *run, struct worker *worker, const struct join *join, double *most)
{
    bool open = false;
    *most = run->border.limit;
    worker->map.point_count = 0;
    for (uint32_t s = 0; s < join->count; s++)
        open |= run->working->flags[join->simplex[s]] & VERTEX_BOUNDARY;
    if (!open)
        return 0;
    double moved = border_moves(&run->border, run->working, join->simplex, join->count, join->p, &worker->map);
    if (!isinf(moved)) {
        *most = boundary_map_most(&worker->map, run->border.most);
        outcome_demands(run, worker);
    }
    return moved;
}

/* Is it the certified error that is limited? */
static bool limits_certified(const struct run *run)
{
    return run->asked ? run->asked->certifies : run->metric != METRIC_SVA;
}

/* The errors of the result as fractions of the range: what a limit has answered, or what U and L say. */
static void find_errors(const struct run *run, const struct worker *worker, const struct answer *answer,
                        const double *values,
                        uint32_t record, double *certified)
{
    const struct working *working = run->working;
    const double *upper = numbers_of(run, worker, NUMBERS_UPPER), *lower = numbers_of(run, worker, NUMBERS_LOWER);
    for (uint32_t c = 0; c < working->component_count; c++) {
        const struct component *component = &working->components[c];
        double worst =
            answer && run->asked->certifies ? answer->errors[c] : larger(upper[c] - values[c], values[c] - lower[c]);
        double named = component->factor > 0 && limits_certified(run)
                           ? run->limit / component->factor * component->scale
                           : INFINITY;
        // within rounding of the limit is the limit
        certified[c] = smaller(smaller(worst * component->scale, named), 1);
        if (working->log->components[c].bounds)
            working->log->components[c].bounds[record] = worst;
    }
}

static void log_join(const struct run *run, const struct join *join, uint32_t record)
{
    const struct working *working = run->working;
    uint32_t *children = working->log->children + 4 * (size_t)record;
    children[0] = working->node[join_kept(join)];
    for (uint32_t s = 1; s < 4; s++)
        children[s] = s < join->count ? working->node[join->simplex[join->count - 1 - s]] : TETLOD_NONE;
    memcpy(working->log->positions + 3 * (size_t)record, join->p, sizeof join->p);
    log_values(working, join, record);
}

/* What the vertices wait for now: the dead for nothing, the result to be looked at. */
static void forget_proposals(const struct run *run, const struct join *join, double error)
{
    struct proposal *kept = &run->proposals[join_kept(join)];
    for (uint32_t s = 0; s < join->count; s++) {
        run->proposals[join->simplex[s]].priority = PROPOSES_NOTHING;
        if (run->notes)
            notes_free(&run->notes[join->simplex[s]]);
    }
    kept->waits = kept->waits_changed = (float)(RESULT_WAITS * error);
    if (run->plans) {
        touch(run, join_kept(join));
        kept->waits = kept->waits_changed = 0;
    }
}

void merge(const struct run *run, struct worker *worker, uint32_t slot, uint32_t record, const struct answer *answer,
           struct merged *out, double *certified, double *predicted)
{
    struct working *working = run->working;
    struct join join = find_join(run, slot, answer);
    double *values = numbers_of(run, worker, NUMBERS_RISE), most;
    *out = (struct merged){.kept = join_kept(&join), .vertices = join.count - 1};
    if (!outcome_list(run, worker, &join))
        return;
    if (!outcome_weigh(run, worker, &join)) {
        refuse(run, worker, slot, 0, LOG_REFUSED_FLIP);
        return;
    }
    if (!stays_in_box(run, &worker->weighing, &join)) {
        refuse(run, worker, slot, 0, LOG_REFUSED_CELL);
        return;
    }
    outcome_bounds(run, worker, &join);
    double moved = move_boundary(run, worker, &join, &most), error = answer ? answer->error : 0;
    if (isinf(moved)) {
        refuse(run, worker, slot, 0, LOG_REFUSED_BOUNDARY);
        return;
    }
    if (run->metric == METRIC_SVA)
        outcome_say(run, worker, &join, true);
    if (answer)
        memcpy(values, answer->values, working->component_count * sizeof *values);
    else
        error = outcome_values(run, worker, &join, values, NULL);
    if (!answer && !(error <= run->limit * (1 + LIMIT_TIE))) {
        refuse(run, worker, slot, error, LOG_REFUSED_ROUNDING);
        return;
    }
    outcome_say(run, worker, &join, false);
    choose_values(run, worker, &join, values, predicted);
    find_errors(run, worker, answer, values, record, certified);
    carry_fields(worker, working, &join);
    set_components(working, &join, values, predicted);
    log_join(run, &join, record);
    touch_star(run, worker, &join);
    set_row(run, worker, &join, moved);
    quadrics_contract(&run->quadrics, working, join.simplex, join.count);
    run->border.most[join_kept(&join)] = most;
    forget_proposals(run, &join, error);
    out->removed = working_contract(working, join.simplex, join.count, worker->list);
    out->moved = moved;
    out->done = true;
}
