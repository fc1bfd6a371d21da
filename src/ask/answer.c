/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/ask/answer.h"

#include <float.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "format/fail.h"
#include "src/ask/clip.h"
#include "src/cut/line.h"
#include "src/mesh/locate.h"
#include "src/mesh/tet_geom.h"
#include "src/util/array.h"

enum { LOWER, UPPER }; /* the two functions that enclose the original */

/* of a sum's absolute terms; a boundary that keeps its place to within rounding is in it */
static const double ROUNDING = 4e-12;

/* What is asked of each tetrahedron, and what has come together. */
struct pass {
    const struct ask_question *question;
    const struct ask_level *level;
    enum ask_compare side;    /* of a threshold, if the volume there is asked for */
    double thresholds[2];     /* of the answers' lower and upper end */
    /* The tetrahedron that is being looked at: what follows belongs to its corners. */
    double volume, ends[2][4], vectors[4][256], errors[4];
    /* The sums. touched: the volume of all tetrahedra that have a part of it. */
    long double whole, integral[2], absolute, part[2], touched[2];
    double least[2], most[2];
};

static double error_at(const struct ask_level *level, uint32_t vertex)
{
    return level->bounds ? level->bounds[vertex] : level->error;
}

static double length(const double *vector, uint32_t components)
{
    double sum = 0;
    for (uint32_t i = 0; i < components; i++)
        sum += vector[i] * vector[i];
    return sqrt(sum);
}

/* A length is convex: the interpolated lengths of the corners are above it, its tangent at the mean vector is below. */
static void enclose_length(struct pass *pass)
{
    uint32_t components = pass->level->components;
    double mean[256] = {0};
    for (uint32_t i = 0; i < components; i++)
        mean[i] = pass->vectors[0][i] + pass->vectors[1][i] + pass->vectors[2][i] + pass->vectors[3][i];
    double size = length(mean, components);
    for (int c = 0; c < 4; c++) {
        double along = 0;
        for (uint32_t i = 0; i < components && size > 0; i++)
            along += pass->vectors[c][i] * (mean[i] / size);
        pass->ends[LOWER][c] = along - pass->errors[c];
        pass->ends[UPPER][c] = length(pass->vectors[c], components) + pass->errors[c];
    }
}

/* The two functions at the tetrahedron's corners. */
static void enclose(struct pass *pass, uint32_t tet)
{
    const struct ask_level *level = pass->level;
    int component = pass->question->quantity.component;
    for (int c = 0; c < 4; c++) {
        uint32_t vertex = level->corners[4 * (size_t)tet + (size_t)c];
        const double *value = level->values ? level->values + (size_t)level->components * vertex : NULL;
        pass->errors[c] = error_at(level, vertex);
        if (value && component == ASK_LENGTH) {
            pass->errors[c] *= sqrt((double)level->components);
            memcpy(pass->vectors[c], value, level->components * sizeof *value);
        } else {
            double middle = value ? value[component < 0 ? 0 : component] : 0;
            pass->ends[LOWER][c] = middle - pass->errors[c];
            pass->ends[UPPER][c] = middle + pass->errors[c];
        }
    }
    if (level->values && component == ASK_LENGTH)
        enclose_length(pass);
}

/* The two functions at a point of the tetrahedron. Of a length the upper one is as near as its error. */
static void enclose_at(const struct pass *pass, const double weights[4], double out[2])
{
    out[LOWER] = out[UPPER] = 0;
    double error = 0;
    for (int c = 0; c < 4; c++) {
        out[LOWER] += weights[c] * pass->ends[LOWER][c];
        out[UPPER] += weights[c] * pass->ends[UPPER][c];
        error += weights[c] * pass->errors[c];
    }
    if (pass->question->quantity.component != ASK_LENGTH)
        return;
    double vector[256];
    for (uint32_t i = 0; i < pass->level->components; i++) {
        vector[i] = 0;
        for (int c = 0; c < 4; c++)
            vector[i] += weights[c] * pass->vectors[c][i];
    }
    double middle = length(vector, pass->level->components);
    out[UPPER] = middle + error;
    // there the length itself is what counts
    if (pass->question->function == ASK_MAX || pass->question->function == ASK_AT)
        out[LOWER] = middle - error;
}

static void add_extremes(struct pass *pass, const double weights[4])
{
    double values[2];
    enclose_at(pass, weights, values);
    for (int e = 0; e < 2; e++) {
        pass->least[e] = smaller(pass->least[e], values[e]);
        pass->most[e] = larger(pass->most[e], values[e]);
    }
}

/* What is in the box of the tetrahedron. */
static void add_clipped(struct pass *pass, const struct clipped *part)
{
    pass->whole += pass->volume * part->share;
    for (unsigned v = 0; v < part->count; v++)
        add_extremes(pass, part->weights[v]);
    for (int e = 0; e < 2; e++) {
        double values[MAX_CLIP_CORNERS];
        for (unsigned v = 0; v < part->count; v++)
            values[v] = clip_value(pass->ends[e], part->weights[v]);
        pass->integral[e] += pass->volume * clip_integral(part, values);
        for (unsigned v = 0; v < part->count; v++)
            values[v] = fabs(values[v]);
        pass->absolute += pass->volume * clip_integral(part, values);
    }
}

/* The same of a tetrahedron as a whole, whose functions are linear. */
static void add_tetrahedron(struct pass *pass)
{
    pass->whole += pass->volume;
    for (int e = 0; e < 2; e++) {
        const double *v = pass->ends[e];
        for (int c = 0; c < 4; c++) {
            pass->least[e] = v[c] < pass->least[e] ? v[c] : pass->least[e];
            pass->most[e] = v[c] > pass->most[e] ? v[c] : pass->most[e];
        }
        pass->integral[e] += pass->volume * (v[0] + v[1] + v[2] + v[3]) / 4;
        pass->absolute += pass->volume * (fabs(v[0]) + fabs(v[1]) + fabs(v[2]) + fabs(v[3])) / 4;
    }
}

/* The volume on the asked side of the threshold, for one end of the answer. Where all of the tetrahedron is *at* the
 * threshold, that counts if the comparison allows it. */
static void add_side(struct pass *pass, double planes[][4], unsigned count, int which)
{
    bool above = pass->side == ASK_GREATER || pass->side == ASK_AT_LEAST;
    bool strict = pass->side == ASK_GREATER || pass->side == ASK_LESS, flat = true;
    int inside = 0, outside = 0;
    struct clipped part;
    const double *ends = pass->ends[above == (which == UPPER) ? UPPER : LOWER];
    for (int c = 0; c < 4; c++) {
        planes[count][c] = above ? ends[c] - pass->thresholds[which] : pass->thresholds[which] - ends[c];
        flat &= planes[count][c] == 0;
        inside += planes[count][c] > 0;
        outside += planes[count][c] < 0;
    }
    if (outside == 4)
        return;
    if (inside == 4 && !count) {
        pass->part[which] += pass->volume;
        pass->touched[which] += pass->volume;
        return;
    }
    if (flat && strict)
        return;
    clip_tet((const double(*)[4])planes, count + 1, &part);
    pass->part[which] += pass->volume * part.share;
    pass->touched[which] += part.share > 0 ? pass->volume : 0;
}

/* The sides of the box that pass through the tetrahedron, as functions; false if it is outside. */
static bool box_planes(const struct ask_question *question, const double *const corners[4], double planes[][4],
                       unsigned *count)
{
    const bool extreme = question->function == ASK_MIN || question->function == ASK_MAX;
    *count = 0;
    for (int i = 0; i < 3 && question->in_box; i++)
        for (int side = 0; side < 2; side++) {
            double *plane = planes[*count], least = DBL_MAX, most = -DBL_MAX;
            for (int c = 0; c < 4; c++) {
                plane[c] = side ? question->box[1][i] - corners[c][i] : corners[c][i] - question->box[0][i];
                least = smaller(least, plane[c]);
                most = larger(most, plane[c]);
            }
            if (most < 0 || (most == 0 && !extreme)) // what touches the box has no volume in it
                return false;
            *count += least < 0;
        }
    return true;
}

static void add_volumes(struct pass *pass, uint32_t tet, const double *const corners[4])
{
    double planes[MAX_CLIP_PLANES][4];
    unsigned count;
    struct clipped part;
    if (!box_planes(pass->question, corners, planes, &count))
        return;
    enclose(pass, tet);
    pass->volume = fabs(tet_volume6(corners[0], corners[1], corners[2], corners[3])) / 6;
    if (pass->side == ASK_NO_LIMIT && !count && pass->question->quantity.component != ASK_LENGTH) {
        add_tetrahedron(pass);
        return;
    }
    if (pass->side == ASK_NO_LIMIT) {
        clip_tet((const double(*)[4])planes, count, &part);
        add_clipped(pass, &part);
        return;
    }
    for (int which = LOWER; which <= UPPER; which++)
        add_side(pass, planes, count, which);
}

static void add_point(struct pass *pass, uint32_t tet)
{
    const struct locator mesh = {.positions = pass->level->positions, .corners = pass->level->corners};
    double weights[4];
    if (!locator_contains(&mesh, tet, pass->question->place[0], weights))
        return;
    enclose(pass, tet);
    add_extremes(pass, weights);
}

static void add_stretch(struct pass *pass, uint32_t tet, const double *const corners[4])
{
    double at[2], weights[2][4];
    if (!cut_stretch(corners, pass->question->place[0], pass->question->place[1], at, weights))
        return;
    enclose(pass, tet);
    add_extremes(pass, weights[0]);
    add_extremes(pass, weights[1]);
}

/* Is the tetrahedron in another region than the one that is asked about? */
static bool is_elsewhere(const struct pass *pass, uint32_t tet)
{
    const struct ask_level *level = pass->level;
    return pass->question->over_region && level->regions[level->numbers[tet]] != pass->question->region;
}

static void add_tet(struct pass *pass, uint32_t tet)
{
    const struct ask_level *level = pass->level;
    const double *corners[4];
    if (is_elsewhere(pass, tet))
        return;
    for (int c = 0; c < 4; c++)
        corners[c] = level->positions + 3 * (size_t)level->corners[4 * (size_t)tet + (size_t)c];
    if (pass->question->function == ASK_AT)
        add_point(pass, tet);
    else if (pass->question->function == ASK_ALONG)
        add_stretch(pass, tet, corners);
    else
        add_volumes(pass, tet, corners);
}

/* ---- blocks */

enum block_place { OUTSIDE, ACROSS, INSIDE };

/* Can a box hold a part of the line, or the point? With room for what counts as inside of a tetrahedron. */
static bool is_on_way(const struct ask_question *question, const double box[6])
{
    static const double ROOM = 1e-6;
    const double *from = question->place[0], *to = question->place[question->function == ASK_ALONG];
    double least = 0, most = 1, size = larger(box[3] - box[0], larger(box[4] - box[1], box[5] - box[2]));
    for (int i = 0; i < 3; i++) {
        double low = box[i] - ROOM * size, high = box[i + 3] + ROOM * size, way = to[i] - from[i];
        double a = (low - from[i]) / way, b = (high - from[i]) / way;
        if (way == 0 && (from[i] < low || from[i] > high))
            return false;
        least = way == 0 ? least : larger(least, smaller(a, b) - ROOM);
        most = way == 0 ? most : smaller(most, larger(a, b) + ROOM);
    }
    return least <= most;
}

static enum block_place place_of(const struct ask_question *question, const struct ask_block *block)
{
    enum block_place place = INSIDE;
    if (question->function == ASK_AT || question->function == ASK_ALONG)
        return is_on_way(question, block->box) ? ACROSS : OUTSIDE;
    for (int i = 0; i < 3 && question->in_box; i++) {
        if (block->box[i + 3] < question->box[0][i] || block->box[i] > question->box[1][i])
            return OUTSIDE;
        if (block->box[i] < question->box[0][i] || block->box[i + 3] > question->box[1][i])
            place = ACROSS;
    }
    return place;
}

/* Do a block's sums say what is asked? Not of lengths, regions and errors that differ from point to point. */
static bool has_sums(const struct pass *pass)
{
    return !pass->question->over_region && !pass->level->bounds &&
        !(pass->level->values && pass->question->quantity.component == ASK_LENGTH);
}

static struct ask_block_values values_of(const struct pass *pass, uint32_t block)
{
    const struct ask_level *level = pass->level;
    int component = pass->question->quantity.component;
    if (!level->values)
        return (struct ask_block_values){0, 0, 0, 0};
    return level->blocks->values[(size_t)level->components * block + (component < 0 ? 0 : (uint32_t)component)];
}

/* The sums of a block inside of what is asked about. */
static void add_sums(struct pass *pass, const struct ask_block *block, const struct ask_block_values *values)
{
    double error = pass->level->error;
    pass->whole += block->volume;
    for (int e = 0; e < 2; e++) {
        double shift = e == LOWER ? -error : error;
        pass->least[e] = smaller(pass->least[e], values->least + shift);
        pass->most[e] = larger(pass->most[e], values->most + shift);
        pass->integral[e] += values->integral + shift * block->volume;
        pass->absolute += values->absolute + error * block->volume;
    }
}

/* The volume at the asked side of a threshold: -1 where some of the block is at either. */
static int side_of(const struct pass *pass, const struct ask_block_values *values, int which)
{
    bool above = pass->side == ASK_GREATER || pass->side == ASK_AT_LEAST;
    double shift = above == (which == UPPER) ? pass->level->error : -pass->level->error;
    double least = values->least + shift, most = values->most + shift, threshold = pass->thresholds[which];
    if (most < threshold || least > threshold)
        return above == (least > threshold);
    return -1;
}

/* False: its tetrahedra are to be asked one by one. */
static bool add_by_sides(struct pass *pass, enum block_place place, const struct ask_block *block,
                         const struct ask_block_values *values)
{
    int sides[2] = {0, 0};
    for (int which = LOWER; which <= UPPER; which++) {
        sides[which] = side_of(pass, values, which);
        if (sides[which] < 0 || (sides[which] > 0 && place == ACROSS))
            return false;
    }
    for (int which = LOWER; which <= UPPER; which++) {
        pass->part[which] += sides[which] ? block->volume : 0;
        pass->touched[which] += sides[which] ? block->volume : 0;
    }
    return true;
}

/* Can a block have a greater, or a lesser, value than was found? */
static bool may_be_extreme(const struct pass *pass, const struct ask_block_values *values)
{
    double error = pass->level->error;
    if (pass->question->function == ASK_MAX)
        return values->most - error > pass->most[LOWER] || values->most + error > pass->most[UPPER];
    return pass->question->function != ASK_MIN || values->least - error < pass->least[LOWER] ||
        values->least + error < pass->least[UPPER];
}

/* As a whole, if that can be. */
static bool add_block(struct pass *pass, uint32_t number, enum block_place place)
{
    const struct ask_block *block = &pass->level->blocks->blocks[number];
    struct ask_block_values values = values_of(pass, number);
    if (pass->side != ASK_NO_LIMIT)
        return add_by_sides(pass, place, block, &values);
    if (place == INSIDE)
        add_sums(pass, block, &values);
    return place == INSIDE || !may_be_extreme(pass, &values);
}

/* Blocks inside of what is asked about come first: the largest value in them rules others out. */
static void run_blocks(struct pass *pass)
{
    const struct ask_level *level = pass->level;
    const bool sums = has_sums(pass);
    for (enum block_place turn = INSIDE; turn > OUTSIDE; turn--)
        for (uint32_t b = 0; b < level->blocks->count; b++) {
            if (place_of(pass->question, &level->blocks->blocks[b]) != turn || (sums && add_block(pass, b, turn)))
                continue;
            for (uint32_t i = 0; i < BLOCK_TETS && b * BLOCK_TETS + i < level->tets; i++)
                add_tet(pass, b * BLOCK_TETS + i);
        }
}

static void run(struct pass *pass)
{
    pass->whole = pass->absolute = 0;
    for (int e = 0; e < 2; e++) {
        pass->integral[e] = pass->part[e] = pass->touched[e] = 0;
        pass->least[e] = INFINITY;
        pass->most[e] = -INFINITY;
    }
    run_blocks(pass);
}

/* The part of the domain that is asked about is all of it where nothing else is said. */
static enum tetlod_status run_whole(struct pass *pass, struct tetlod_error *error)
{
    static const char *const empty[] = {"the point lies outside of the mesh",
                                        "the line does not pass through the mesh"};
    run(pass);
    if (pass->question->function <= ASK_ALONG && !(pass->least[LOWER] <= pass->most[LOWER]))
        return tetlodi_fail(error, TETLOD_ERR_ARGUMENT, "%s", empty[pass->question->function]);
    if (pass->question->function > ASK_ALONG && !(pass->whole > 0) && !(pass->level->swept > 0))
        return tetlodi_fail(error, TETLOD_ERR_ARGUMENT, "the box, or the region, holds nothing of the mesh");
    return TETLOD_OK;
}

/* The volume of the original in what is asked about. */
static struct ask_interval volume_range(const struct pass *pass)
{
    double swept = pass->level->swept, whole = (double)pass->whole;
    if (!pass->question->in_box && !pass->question->over_region && !isnan(pass->level->volume))
        return (struct ask_interval){pass->level->volume, pass->level->volume};
    return (struct ask_interval){fmax(whole * (1 - ROUNDING) - swept, 0), whole * (1 + ROUNDING) + swept};
}

/* ---- quantiles */

/* A tetrahedron, or a piece of one, of which it is not known on which side of the threshold it is: the function at its
 * corners, in rising order. */
struct portion {
    double volume, values[4];
};

/* A search for the threshold below which a function has a wanted volume. */
struct search {
    int function;
    double low, high;
    long double below, at_low, at_high; /* below: the volume of what is left out below `low` */
    struct portion *portions;           /* owned */
    size_t count, capacity;
};

static double shift_of(const struct pass *pass, int function)
{
    return function == LOWER ? -pass->level->error : pass->level->error;
}

/* A block of which some may be asked about, and its values. */
struct spread {
    double least, most, volume, expected; /* expected: of the volume */
    bool inside;
};

/* How much of a block's box is in the question's. */
static double share_asked(const struct ask_question *question, const struct ask_block *block)
{
    double share = 1;
    for (int i = 0; i < 3 && question->in_box; i++) {
        double low = larger(block->box[i], question->box[0][i]), high = smaller(block->box[i + 3], question->box[1][i]);
        double size = block->box[i + 3] - block->box[i];
        share *= size > 0 ? larger(high - low, 0) / size : 1;
    }
    return share;
}

/* What blocks say as they are: bounds, and in *guess where the threshold is expected, if values are even in each. */
static enum tetlod_status search_blocks(const struct pass *pass, const long double wanted[2], struct search *search,
                                        double *guess, struct tetlod_error *error)
{
    enum { HALVINGS = 16 };
    const struct ask_blocks *blocks = pass->level->blocks;
    const double shift = shift_of(pass, search->function);
    struct spread *spreads = array_new(blocks->count, sizeof *spreads);
    double low = search->low, high = search->high;
    size_t count = 0;
    if (!spreads)
        return tetlodi_fail_nomem(error, "the search for a quantile", blocks->count * (uint64_t)sizeof *spreads);
    for (uint32_t b = 0; b < blocks->count; b++) {
        struct ask_block_values values = values_of(pass, b);
        enum block_place place = place_of(pass->question, &blocks->blocks[b]);
        if (place != OUTSIDE)
            spreads[count++] = (struct spread){values.least + shift, values.most + shift, blocks->blocks[b].volume,
                                               share_asked(pass->question, &blocks->blocks[b]), place == INSIDE};
    }
    for (int k = 0; k < HALVINGS; k++) {
        double middle = low + (high - low) / 2, sums[3] = {0, 0, 0}; // of what is below: at least, at most, expected
        for (size_t i = 0; i < count; i++) {
            const struct spread *s = &spreads[i];
            const double share = (middle - s->least) / (s->most - s->least);
            sums[0] += s->most <= middle && s->inside ? s->volume : 0;
            sums[1] += s->least <= middle ? s->volume : 0;
            sums[2] += s->volume * s->expected * (s->most <= middle ? 1 : share > 0 ? share : 0);
        }
        if (sums[1] < (1 - ROUNDING) * (double)wanted[LOWER])
            search->low = larger(search->low, middle);
        else if (sums[0] * (1 - ROUNDING) >= (double)wanted[UPPER])
            search->high = smaller(search->high, middle);
        low = sums[2] < (double)wanted[LOWER] ? middle : low;
        high = sums[2] < (double)wanted[LOWER] ? high : middle;
    }
    *guess = low + (high - low) / 2;
    free(spreads);
    return TETLOD_OK;
}

static bool add_portion(struct search *search, double volume, const double values[4])
{
    struct portion portion = {volume, {values[0], values[1], values[2], values[3]}};
    clip_sort(portion.values);
    if (portion.values[3] <= search->low)
        search->below += volume;
    else if (portion.values[0] <= search->high) {
        if (!ARRAY_RESERVE(search->portions, search->capacity, search->count + 1))
            return false;
        search->portions[search->count++] = portion;
    }
    return true;
}

/* What is asked about of a tetrahedron. False: no memory. */
static bool add_portions(struct pass *pass, struct search *search, uint32_t tet, enum block_place place)
{
    const double *corners[4], *ends = pass->ends[search->function];
    double planes[MAX_CLIP_PLANES][4];
    struct clipped part;
    unsigned count = 0;
    bool room = true;
    for (size_t c = 0; c < 4; c++)
        corners[c] = pass->level->positions + 3 * (size_t)pass->level->corners[4 * (size_t)tet + c];
    if (is_elsewhere(pass, tet) || (place != INSIDE && !box_planes(pass->question, corners, planes, &count)))
        return true;
    enclose(pass, tet);
    if (smaller(smaller(ends[0], ends[1]), smaller(ends[2], ends[3])) > search->high)
        return true;
    const double volume = fabs(tet_volume6(corners[0], corners[1], corners[2], corners[3])) / 6;
    if (!count)
        return add_portion(search, volume, ends);
    clip_tet((const double(*)[4])planes, count, &part);
    for (unsigned i = 0; i < part.piece_count && room; i++) {
        double values[4];
        for (int c = 0; c < 4; c++)
            values[c] = clip_value(ends, part.weights[part.pieces[i][c]]);
        room = add_portion(search, volume * part.shares[i], values);
    }
    return room;
}

/* False: no memory. */
static bool add_block_portions(struct pass *pass, struct search *search, uint32_t number)
{
    const struct ask_block *block = &pass->level->blocks->blocks[number];
    const enum block_place place = place_of(pass->question, block);
    const struct ask_block_values values = values_of(pass, number);
    const double shift = shift_of(pass, search->function);
    bool sums = has_sums(pass), room = true;
    if (place == OUTSIDE || (sums && values.least + shift > search->high))
        return true;
    if (sums && place == INSIDE && values.most + shift <= search->low) {
        search->below += block->volume;
        return true;
    }
    for (uint32_t t = number * BLOCK_TETS; room && t < (number + 1) * BLOCK_TETS && t < pass->level->tets; t++)
        room = add_portions(pass, search, t, place);
    return room;
}

/* The volume of what is known to be on either side of a threshold, and of the shares of the rest. */
static long double volume_at_most(const struct search *search, double threshold)
{
    long double volume = search->below;
    for (size_t i = 0; i < search->count; i++)
        volume += search->portions[i].volume * clip_share_below(search->portions[i].values, threshold);
    return volume;
}

/* What is asked about between two thresholds. */
static enum tetlod_status list_portions(struct pass *pass, double low, double high, struct search *search,
                                        struct tetlod_error *error)
{
    search->low = low;
    search->high = high;
    search->below = 0;
    search->count = 0;
    for (uint32_t b = 0; b < pass->level->blocks->count; b++)
        if (!add_block_portions(pass, search, b))
            return tetlodi_fail_nomem(error, "the search for a quantile", 2 * search->count * sizeof *search->portions);
    return TETLOD_OK;
}

/* Few tetrahedra pass through thresholds near the one that is expected. If it is not there, it is in the bounds. */
static enum tetlod_status search_begin(struct pass *pass, int function, const long double wanted[2],
                                       struct search *search, struct tetlod_error *error)
{
    static const double NEAR = 1.0 / 64; // of the way between the bounds
    *search = (struct search){.function = function, .at_low = NAN, .at_high = NAN,
                              .low = fmin(pass->least[function], pass->level->range[0]),
                              .high = fmax(pass->most[function], pass->level->range[1])};
    double guess = NAN;
    if (has_sums(pass))
        TETLOD_TRY(search_blocks(pass, wanted, search, &guess, error));
    const double low = search->low, high = search->high, near = NEAR * (high - low);
    if (guess - near > low && guess + near < high) {
        TETLOD_TRY(list_portions(pass, guess - near, guess + near, search, error));
        search->at_low = volume_at_most(search, search->low);
        search->at_high = volume_at_most(search, search->high);
        if (search->at_low < wanted[LOWER] && search->at_high >= wanted[UPPER])
            return TETLOD_OK;
    }
    search->at_low = search->at_high = NAN;
    return list_portions(pass, low, high, search, error);
}

/* Leaves out what is below `low` or above `high` as a whole. */
static void narrow(struct search *search)
{
    size_t kept = 0;
    for (size_t i = 0; i < search->count; i++) {
        const struct portion *portion = &search->portions[i];
        if (portion->values[3] <= search->low)
            search->below += portion->volume;
        else if (portion->values[0] <= search->high)
            search->portions[kept++] = *portion;
    }
    search->count = kept;
}

/* Where to look next: a little below and a little above what is expected, or in the middle. `first`: the width of the
 * whole search; volumes are the straighter, the narrower it has become. */
static double next_threshold(const struct search *search, long double wanted, int step, double first)
{
    double width = search->high - search->low, middle = search->low + width / 2;
    double share = (double)((wanted - search->at_low) / (search->at_high - search->at_low));
    double margin = fmin(fmax(4 * width / first, 0x1p-20), 0x1p-6);
    if (step % 3 == 2 || !(share >= 0 && share <= 1))
        return middle;
    double at = search->low + width * (share + (step % 3 ? margin : -margin));
    return at > search->low && at < search->high ? at : middle;
}

/* Until the thresholds of both volumes that are wanted are known as near as is enough, or part. */
static void search_on(struct search *search, const long double wanted[2], double enough)
{
    enum { MAX_STEPS = 150 };
    const double first = search->high - search->low;
    for (int k = 0; k < MAX_STEPS && search->high - search->low > enough; k++) {
        double threshold = next_threshold(search, wanted[LOWER], k, first);
        if (!(threshold > search->low && threshold < search->high))
            return;
        long double found = volume_at_most(search, threshold);
        if (found >= wanted[UPPER]) {
            search->high = threshold;
            search->at_high = found;
        } else if (found < wanted[LOWER]) {
            search->low = threshold;
            search->at_low = found;
        } else {
            return;
        }
        narrow(search);
    }
}

/* Is nothing between the two functions? Then one search finds both ends, but for rounding. */
static bool is_one_function(const struct pass *pass)
{
    return pass->level->error == 0 && !pass->level->bounds && pass->question->quantity.component != ASK_LENGTH;
}

static enum tetlod_status copy_search(const struct search *from, struct search *out, struct tetlod_error *error)
{
    *out = *from;
    out->portions = array_new(from->count, sizeof *out->portions);
    if (!out->portions)
        return tetlodi_fail_nomem(error, "the search for a quantile", from->count * sizeof *out->portions);
    memcpy(out->portions, from->portions, from->count * sizeof *out->portions);
    return TETLOD_OK;
}

/* The least threshold below which at least a share of the volume lies: from below for the lower end, from above for the
 * upper. */
static enum tetlod_status find_quantile(struct pass *pass, struct ask_interval *out, struct tetlod_error *error)
{
    const double share = pass->question->number;
    const bool one = is_one_function(pass);
    struct ask_interval volume = volume_range(pass);
    long double slack = ROUNDING * pass->whole + pass->level->swept;
    const long double wanted[2] = {share * volume.lower - slack, share * volume.upper + slack};
    struct search searches[2] = {0};
    enum tetlod_status status;
    // of what the level's error leaves open, or of rounding
    const double enough = fmax(1e-6 * pass->level->error, 1e-13 * (pass->level->range[1] - pass->level->range[0]));
    TETLOD_TRY_DONE(search_begin(pass, LOWER, one ? wanted : (const long double[2]){wanted[0], wanted[0]},
                                 &searches[LOWER], error));
    if (one) {
        search_on(&searches[LOWER], wanted, enough);
        TETLOD_TRY_DONE(copy_search(&searches[LOWER], &searches[UPPER], error));
    } else {
        TETLOD_TRY_DONE(search_begin(pass, UPPER, (const long double[2]){wanted[1], wanted[1]}, &searches[UPPER],
                                     error));
    }
    for (int e = LOWER; e <= UPPER; e++)
        search_on(&searches[e], (const long double[2]){wanted[e], wanted[e]}, enough);
    *out = (struct ask_interval){searches[LOWER].low, searches[UPPER].high};
done:
    free(searches[LOWER].portions);
    free(searches[UPPER].portions);
    return status;
}

/* A volume is neither negative nor more than there is. */
static struct ask_interval find_volume(struct pass *pass)
{
    struct ask_interval all = volume_range(pass);
    double swept = pass->level->swept;
    if (pass->question->side == ASK_NO_LIMIT)
        return (struct ask_interval){all.lower * (1 - ROUNDING), all.upper * (1 + ROUNDING)};
    pass->side = pass->question->side;
    pass->thresholds[LOWER] = pass->thresholds[UPPER] = pass->question->number;
    run(pass);
    return (struct ask_interval){fmax((double)(pass->part[LOWER] - ROUNDING * pass->touched[LOWER]) - swept, 0),
                                 fmin((double)(pass->part[UPPER] + ROUNDING * pass->touched[UPPER]) + swept,
                                      all.upper * (1 + ROUNDING))};
}

/* The integral of what the quantity has more than `middle`. What lies in one of the two domains alone, or has its
 * partner elsewhere, is counted twice at most, and is no further from the middle than half the range and the error. */
static struct ask_interval integral_about(const struct pass *pass, double middle)
{
    const struct ask_level *level = pass->level;
    double furthest = fmax(level->range[1] - middle, middle - level->range[0]);
    furthest = fmax(furthest, (double)fmaxl(pass->most[UPPER] - middle, middle - pass->least[LOWER]));
    long double slack = ROUNDING * (pass->absolute + fabs(middle) * pass->whole) + 2 * level->swept * furthest;
    return (struct ask_interval){(double)(pass->integral[LOWER] - middle * pass->whole - slack),
                                 (double)(pass->integral[UPPER] - middle * pass->whole + slack)};
}

static struct ask_interval find_sum(const struct pass *pass, bool mean)
{
    double swept = pass->level->swept, middle = swept > 0 ? (pass->level->range[0] + pass->level->range[1]) / 2 : 0;
    struct ask_interval about = integral_about(pass, middle), volume = volume_range(pass);
    if (!mean)
        return (struct ask_interval){about.lower + fmin(middle * volume.lower, middle * volume.upper),
                                     about.upper + fmax(middle * volume.lower, middle * volume.upper)};
    if (swept == 0)
        volume.lower = volume.upper = (double)pass->whole;
    if (!(volume.lower > 0))
        return (struct ask_interval){pass->level->range[0], pass->level->range[1]};
    return (struct ask_interval){middle + fmin(about.lower / volume.lower, about.lower / volume.upper),
                                 middle + fmax(about.upper / volume.lower, about.upper / volume.upper)};
}

static struct ask_interval find(struct pass *pass)
{
    switch (pass->question->function) {
    case ASK_MEAN:
        return find_sum(pass, true);
    case ASK_INTEGRAL:
        return find_sum(pass, false);
    case ASK_MIN:
        return (struct ask_interval){pass->least[LOWER], pass->least[UPPER]};
    case ASK_MAX:
        return (struct ask_interval){pass->most[LOWER], pass->most[UPPER]};
    case ASK_VOLUME:
        return find_volume(pass);
    case ASK_QUANTILE: // find_quantile
    case ASK_AT:
    case ASK_ALONG:
        break;
    }
    return (struct ask_interval){pass->least[LOWER], pass->most[UPPER]};
}

enum tetlod_status ask_answer(const struct ask_question *question, const struct ask_level *level,
                              struct ask_interval *out, double *volume, struct tetlod_error *error)
{
    struct pass pass = {.question = question, .level = level};
    TETLOD_TRY(run_whole(&pass, error));
    *volume = volume_range(&pass).upper * (1 + ROUNDING);
    if (question->function == ASK_QUANTILE)
        TETLOD_TRY(find_quantile(&pass, out, error));
    else
        *out = find(&pass);
    if (question->quantity.component == ASK_LENGTH && question->function != ASK_VOLUME)
        out->lower = fmax(out->lower, 0);
    return TETLOD_OK;
}

int ask_decide(const struct ask_question *question, const struct ask_interval *interval)
{
    double lower = interval->lower, upper = interval->upper, limit = question->limit;
    switch (question->compare) {
    case ASK_LESS:
        return upper < limit ? 1 : lower >= limit ? 0 : -1;
    case ASK_AT_MOST:
        return upper <= limit ? 1 : lower > limit ? 0 : -1;
    case ASK_GREATER:
        return lower > limit ? 1 : upper <= limit ? 0 : -1;
    case ASK_AT_LEAST:
        return lower >= limit ? 1 : upper < limit ? 0 : -1;
    case ASK_NO_LIMIT:
        break;
    }
    return -1;
}
