/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * Nodes of the tree whose box lies in the question's are known whole: their volume, mean, least and greatest value,
 * each up to the rounding of its figure. Of nodes that stick out, at the finest depth, any part may be in the
 * question's box. So the answer is that of parts: `sure` volume with a mean between two numbers, and `open` volume, of
 * which any share may be there, with values between two numbers.
 */
#include "src/ask/box_answer.h"

#include <math.h>
#include <stdlib.h>

/* Of the range: cuts, sums and parts of ranges are rounded by less. */
static const double ROUNDING = 2e-9;

struct part {
    double sure, mean[2];
    double open, values[2]; /* volume that may be there beside, and its mean */
    double extremes[2][2];  /* the least value is between the first two, the greatest between the others */
    bool inside;
};

struct parts {
    const struct tetlodi_box_sums *sums;
    const struct ask_question *question;
    uint32_t component;
    unsigned depth;
    struct part list[(size_t)1 << (MAX_BOX_DEPTH + 1)];
    uint32_t count;
};

static double value(const struct parts *parts, int part)
{
    part = part < 0 ? 0 : part > BOX_PARTS ? BOX_PARTS : part;
    return tetlodi_part_of_range(parts->sums->ranges[parts->component], (unsigned)part, BOX_PARTS);
}

/* Least, greatest and mean of a node from those of the depth where they are stored. */
static void set_values(const struct parts *parts, uint32_t node, unsigned depth, struct part *out)
{
    const struct tetlodi_box_sums *sums = parts->sums;
    const uint32_t first = (node << (parts->depth - depth)) - ((uint32_t)1 << parts->depth);
    const double slack = ROUNDING * (sums->ranges[parts->component][1] / 2 - sums->ranges[parts->component][0] / 2);
    int least = BOX_PARTS, greatest = 0;
    for (uint32_t i = first; i < first + ((uint32_t)1 << (parts->depth - depth)); i++) {
        const uint32_t row = sums->firsts[parts->component] + i;
        if (sums->least[row] > sums->greatest[row])
            continue;
        least = sums->least[row] < least ? sums->least[row] : least;
        greatest = sums->greatest[row] > greatest ? sums->greatest[row] : greatest;
    }
    const double low = value(parts, least), high = value(parts, greatest);
    out->values[0] = low - slack;
    out->values[1] = high + slack;
    out->extremes[0][0] = low - slack;
    out->extremes[0][1] = value(parts, least + 1) + slack;
    out->extremes[1][0] = value(parts, greatest - 1) - slack;
    out->extremes[1][1] = high + slack;
    out->mean[0] = out->mean[1] = 0;
    if (depth < parts->depth)
        return;
    const unsigned mean = sums->means[sums->firsts[parts->component] + first];
    const double range[2] = {low, high};
    const double at = tetlodi_part_of_range(range, mean, VOLUME_PARTS);
    const double half = (high / 2 - low / 2) / VOLUME_PARTS * 1.01 + slack;
    out->mean[0] = at - half;
    out->mean[1] = at + half;
}

/* Is nothing in the node's box? */
static bool is_empty(const struct parts *parts, uint32_t node, unsigned depth)
{
    struct part part;
    if (parts->component == TETLOD_NONE)
        return false;
    set_values(parts, node, depth, &part);
    return part.values[0] > part.values[1];
}

static void add_part(struct parts *parts, uint32_t node, unsigned depth, const double volume[2], bool inside)
{
    struct part *part = &parts->list[parts->count++];
    *part = (struct part){.inside = inside, .sure = inside ? volume[0] : 0,
                          .open = inside ? volume[1] - volume[0] : volume[1]};
    if (parts->component == TETLOD_NONE)
        return;
    set_values(parts, node, depth, part);
    if (inside) {
        part->values[0] = part->mean[0];
        part->values[1] = part->mean[1];
    }
}

/* How a node's box lies to the question's: 1 in it, 0 partly, -1 apart. */
static int place_of(const double box[2][3], const double asked[2][3])
{
    int place = 1;
    for (int i = 0; i < 3; i++) {
        if (box[0][i] > asked[1][i] || box[1][i] < asked[0][i])
            return -1;
        if (box[0][i] < asked[0][i] || box[1][i] > asked[1][i])
            place = 0;
    }
    return place;
}

struct node {
    uint32_t number;
    unsigned depth;
    double box[2][3], volume[2];
};

/* A child: its box, and its volume to half of the last digit of the part. */
static struct node child_of(const struct tetlodi_box_sums *sums, const struct node *node, unsigned which)
{
    struct node out = *node;
    const unsigned axis = node->depth % 3, part = sums->parts[node->number];
    const double share = (double)(which ? VOLUME_PARTS - part : part), half = 0.5 + 1e-6;
    out.number = 2 * node->number + which;
    out.depth++;
    out.box[which ? 0 : 1][axis] = tetlodi_box_split(sums, node->number, node->box[0][axis], node->box[1][axis]);
    out.volume[0] *= fmax(share - half, 0) / VOLUME_PARTS;
    out.volume[1] *= fmin((share + half) / VOLUME_PARTS, 1);
    return out;
}

static void list_parts(struct parts *parts)
{
    const struct tetlodi_box_sums *sums = parts->sums;
    struct node open[MAX_BOX_DEPTH + 2];
    uint32_t count = 1;
    open[0] = (struct node){.number = 1, .volume = {sums->volume * (1 - 1e-9), sums->volume * (1 + 1e-9)}};
    for (int i = 0; i < 6; i++)
        open[0].box[i / 3][i % 3] = sums->box[i / 3][i % 3];
    while (count) {
        const struct node node = open[--count];
        const int place = place_of(node.box, parts->question->box);
        if (place < 0 || is_empty(parts, node.number, node.depth))
            continue;
        // means are stored at the depth alone
        const bool whole = place == 1 && (parts->component == TETLOD_NONE || node.depth == parts->depth);
        if (whole || node.depth == parts->depth) {
            add_part(parts, node.number, node.depth, node.volume, place == 1);
            continue;
        }
        open[count++] = child_of(sums, &node, 0);
        open[count++] = child_of(sums, &node, 1);
    }
}

/* ---- answers */

static struct ask_interval find_volume(const struct parts *parts)
{
    const enum ask_compare side = parts->question->side;
    const bool above = side == ASK_GREATER || side == ASK_AT_LEAST;
    struct ask_interval out = {0, 0};
    for (uint32_t i = 0; i < parts->count; i++) {
        const struct part *part = &parts->list[i];
        bool all = true, some = true;
        if (side != ASK_NO_LIMIT) {
            const double least = part->extremes[0][0], greatest = part->extremes[1][1], at = parts->question->number;
            all = above ? least > at : greatest < at;
            some = above ? greatest >= at : least <= at;
        }
        out.lower += all ? part->sure : 0;
        out.upper += some ? part->sure + part->open : 0;
    }
    return (struct ask_interval){out.lower * (1 - 1e-12), out.upper * (1 + 1e-12)};
}

static struct ask_interval find_integral(const struct parts *parts)
{
    struct ask_interval out = {0, 0};
    double absolute = 0;
    for (uint32_t i = 0; i < parts->count; i++) {
        const struct part *part = &parts->list[i];
        out.lower += part->sure * part->mean[0] + part->open * fmin(part->values[0], 0);
        out.upper += part->sure * part->mean[1] + part->open * fmax(part->values[1], 0);
        absolute += (part->sure + part->open) * fmax(fabs(part->values[0]), fabs(part->values[1]));
    }
    return (struct ask_interval){out.lower - 1e-12 * absolute, out.upper + 1e-12 * absolute};
}

static int compare_falling(const void *a, const void *b)
{
    const double one = ((const struct part *)a)->values[1], other = ((const struct part *)b)->values[1];
    return (one < other) - (one > other);
}

/* The greatest mean there can be: open volume counts as long as its values are above the mean of what is there. */
static double greatest_mean(struct parts *parts)
{
    double volume = 0, integral = 0, most = 0;
    for (uint32_t i = 0; i < parts->count; i++) {
        volume += parts->list[i].sure;
        integral += parts->list[i].sure * parts->list[i].mean[1];
        most = fmax(most, fabs(parts->list[i].values[1]));
    }
    qsort(parts->list, parts->count, sizeof *parts->list, compare_falling);
    for (uint32_t i = 0; i < parts->count && parts->list[i].values[1] * volume > integral; i++) {
        volume += parts->list[i].open;
        integral += parts->list[i].open * parts->list[i].values[1];
    }
    return integral / volume + 1e-12 * most;
}

/* The least mean is the greatest of what is negated. */
static void negate(struct parts *parts)
{
    for (uint32_t i = 0; i < parts->count; i++) {
        struct part *part = &parts->list[i];
        const struct part old = *part;
        for (int e = 0; e < 2; e++) {
            part->mean[e] = -old.mean[1 - e];
            part->values[e] = -old.values[1 - e];
        }
    }
}

static struct ask_interval find_mean(struct parts *parts)
{
    struct ask_interval out;
    out.upper = greatest_mean(parts);
    negate(parts);
    out.lower = -greatest_mean(parts);
    return out;
}

/* The greatest of the greatest values: that of what is inside is there, that of what sticks out may be. */
static struct ask_interval find_extreme(const struct parts *parts, bool greatest)
{
    const double sign = greatest ? 1 : -1;
    struct ask_interval out = {-INFINITY, -INFINITY};
    for (uint32_t i = 0; i < parts->count; i++) {
        const double *of = parts->list[i].extremes[greatest];
        if (parts->list[i].inside)
            out.lower = fmax(out.lower, sign * of[greatest ? 0 : 1]);
        out.upper = fmax(out.upper, sign * of[greatest ? 1 : 0]);
    }
    return greatest ? out : (struct ask_interval){-out.upper, -out.lower};
}

static bool answer_box(struct parts *parts, struct ask_interval *out, double *volume)
{
    const enum ask_function function = parts->question->function;
    double sure = 0;
    bool inside = false;
    list_parts(parts);
    for (uint32_t i = 0; i < parts->count; i++) {
        sure += parts->list[i].sure;
        *volume += parts->list[i].sure + parts->list[i].open;
        inside |= parts->list[i].inside && parts->list[i].sure > 0;
    }
    if (!inside || !(sure > 0)) // the box may hold nothing: the levels say so
        return false;
    if (function == ASK_VOLUME)
        *out = find_volume(parts);
    else if (function == ASK_INTEGRAL)
        *out = find_integral(parts);
    else if (function == ASK_MEAN)
        *out = find_mean(parts);
    else
        *out = find_extreme(parts, function == ASK_MAX);
    return true;
}

/* A region's figures are exact up to rounding. */
static bool answer_region(const struct tetlodi_box_sums *sums, const struct ask_question *question, uint32_t component,
                          struct ask_interval *out, double *volume)
{
    uint32_t region = 0;
    while (region < sums->region_count && sums->regions[region][0] != question->region)
        region++;
    if (region == sums->region_count || !(sums->regions[region][1] > 0))
        return false;
    const double whole = *volume = sums->regions[region][1];
    const double *row = component == TETLOD_NONE ? NULL
                                                 : sums->region_rows[(size_t)component * sums->region_count + region];
    const double most = row ? fmax(fabs(row[0]), fabs(row[1])) : 1;
    double found = whole, slack = 4e-12 * whole * most;
    switch (question->function) {
    case ASK_VOLUME:
        if (question->side == ASK_NO_LIMIT)
            break;
        if (question->number >= row[0] && question->number <= row[1])
            return false;
        found = (question->number < row[0]) == (question->side > ASK_AT_MOST) ? whole : 0;
        slack = 4e-12 * found;
        break;
    case ASK_INTEGRAL:
        found = row[2];
        break;
    case ASK_MEAN:
        found = row[2] / whole;
        slack = 8e-12 * most;
        break;
    default:
        found = row[question->function == ASK_MAX];
        slack = 0;
    }
    *out = (struct ask_interval){found - slack, found + slack};
    return true;
}

bool box_answer(const struct tetlodi_box_sums *sums, const struct ask_question *question, uint32_t component,
                struct ask_interval *out, double *volume)
{
    *volume = 0;
    if (!sums->component_count || question->in_box == question->over_region ||
        question->function < ASK_MEAN || question->function == ASK_QUANTILE)
        return false;
    if (question->over_region)
        return answer_region(sums, question, component, out, volume);
    struct parts *parts = malloc(sizeof *parts);
    if (!parts) // the levels answer, too
        return false;
    parts->sums = sums;
    parts->question = question;
    parts->component = component;
    parts->depth = component == TETLOD_NONE ? sums->depth : sums->depths[component];
    parts->count = 0;
    bool found = answer_box(parts, out, volume);
    free(parts);
    return found;
}
