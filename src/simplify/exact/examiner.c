/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/simplify/exact/examiner.h"

#include <float.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "format/fail.h"
#include "src/mesh/tet_geom.h"
#include "src/mesh/vector.h"
#include "src/simplify/ladder.h"
#include "src/util/array.h"

/* A point this near to the link leaves s' as good as free; what its error comes to is counted all the same. */
static const double MIN_WEIGHT = 1e-9;

/* Points this far beyond a wall or a face still count: they are at it, but for rounding. */
static const double BEYOND = 1e-9;

/* A crossing of a spoke and a face is off a wall by this fraction of the cover's reach at most, or the spoke lies in
 * the face. */
static const double IN_FACE = 1e-6;
enum { REFINEMENTS = 3 };

enum tetlod_status examiner_init(struct examiner *examiner, const struct working *working,
                                 struct tetlod_error *error)
{
    size_t components = working->component_count;
    *examiner = (struct examiner){.intervals = array_new(components, sizeof *examiner->intervals),
                                  .constants = array_new(4 * components, sizeof(double))};
    if (!examiner->intervals || !examiner->constants) {
        examiner_fini(examiner);
        return tetlodi_fail_nomem(error, "the exact limit", components * (32 + sizeof *examiner->intervals));
    }
    examiner->chosen = examiner->constants + components;
    examiner->errors = examiner->chosen + components;
    examiner->bases = examiner->errors + components;
    return cover_init(&examiner->cover, working, error);
}

void examiner_fini(struct examiner *examiner)
{
    cover_fini(&examiner->cover);
    free(examiner->intervals);
    free(examiner->level);
    free(examiner->original);
    free(examiner->points);
    free(examiner->places);
    free(examiner->cones);
    free(examiner->sets);
    free(examiner->constants);
    *examiner = (struct examiner){0};
}

/* ---- values */

static bool room(double **array, size_t *capacity, size_t needed)
{
    return ARRAY_RESERVE(*array, *capacity, needed);
}

/* Room for one more point. */
static bool point_room(struct examiner *examiner, size_t width)
{
    if (examiner->point_count < examiner->place_capacity)
        return true;
    if (!room(&examiner->points, &examiner->point_capacity, 2 * (examiner->point_count + 16) * width) ||
        !ARRAY_RESERVE(examiner->places, examiner->place_capacity, examiner->point_count + 1))
        return false;
    return ARRAY_RESERVE(examiner->cones, examiner->cone_capacity, examiner->place_capacity);
}

enum tetlod_status exact_begin(struct examiner *examiner, const struct working *working,
                                 const struct star *star, struct tetlod_error *error)
{
    struct cover *cover = &examiner->cover;
    TETLOD_TRY(cover_begin(cover, working, star, error));
    size_t links = cover->link_count;
    examiner->recent_count = 0;
    if (!room(&examiner->level, &examiner->level_capacity, links * working->component_count))
        return tetlodi_fail_nomem(error, "the exact limit", links * working->component_count * 8);
    for (uint32_t d = 0; d < working->component_count; d++) {
        const struct component *component = &working->components[d];
        examiner->bases[d] = links ? working_values(working, cover->link[0],
                                                    component->field)[component->component] : 0;
        for (size_t l = 0; l < links; l++)
            examiner->level[d * links + l] =
                working_values(working, cover->link[l], component->field)[component->component] - examiner->bases[d];
    }
    return TETLOD_OK;
}

/* Less the component's base. */
static double original_value(const struct examiner *examiner, const struct overlaps *overlaps,
                             const struct working *working,
                             uint32_t d, uint32_t vertex)
{
    const struct component *component = &working->components[d];
    const struct point_field *field = &overlaps->mesh->fields[component->field];
    double value = field->values[(size_t)vertex * field->components + component->component];
    return value - working->fields[component->field].middles[component->component] - examiner->bases[d];
}

static enum tetlod_status gather(struct examiner *examiner, const struct overlaps *overlaps,
                                 const struct working *working,
                                 const struct star *star, bool *out_few, struct tetlod_error *error)
{
    struct cover *cover = &examiner->cover;
    bool before = cover->gathered;
    TETLOD_TRY(cover_gather(cover, overlaps, star, out_few, error));
    size_t vertices = cover->vertex_count;
    if (!room(&examiner->original, &examiner->original_capacity, vertices * working->component_count))
        return tetlodi_fail_nomem(error, "the exact limit", vertices * working->component_count * 8);
    for (uint32_t d = 0; d < working->component_count && !before; d++)
        for (size_t v = 0; v < vertices; v++)
            examiner->original[d * vertices + v] = original_value(examiner, overlaps, working, d, cover->vertices[v]);
    return TETLOD_OK;
}

/* ---- intervals */

static const struct sentinel nowhere = {TETLOD_NONE, {{TETLOD_NONE, TETLOD_NONE}, 0}};

static struct critical end_of_range(double value)
{
    return (struct critical){1, -value, nowhere, true};
}

/* The limit at which two bounds of s' from below and above meet, and where. */
static double meet(const struct critical *low, const struct critical *high, double *at)
{
    double moving = (low->fixed ? 0 : high->weight) + (high->fixed ? 0 : low->weight);
    double limit = (high->constant * low->weight - low->constant * high->weight) / moving;
    *at = ((low->fixed ? 0 : -limit) - low->constant) / low->weight;
    return limit;
}

/* Takes a corner of the overlay into account. Where nothing is left the limit rises as far as it has to: what it then
 * is, is a lower bound. True: it has risen. */
static bool narrow(struct interval *interval, double weight, double constant, const struct sentinel *where)
{
    double limit = interval->limit;
    if (fabs(weight * interval->low + constant) <= limit && fabs(weight * interval->high + constant) <= limit)
        return false;
    if (!(weight > MIN_WEIGHT))
        return false;
    struct critical here = {weight, constant, *where, false};
    double low = (-limit - constant) / weight, high = (limit - constant) / weight;
    if (low > interval->low) {
        interval->low = low;
        interval->lowest = here;
    }
    if (high < interval->high) {
        interval->high = high;
        interval->highest = here;
    }
    if (interval->low <= interval->high)
        return false;
    double at, raised = meet(&interval->lowest, &interval->highest, &at);
    if (at < interval->range[0] || at > interval->range[1]) {
        *(at < interval->range[0] ? &interval->lowest : &interval->highest) =
            end_of_range(interval->range[at > interval->range[1]]);
        raised = meet(&interval->lowest, &interval->highest, &at);
    }
    interval->limit = larger(limit, raised);
    interval->low = interval->high = at;
    return true;
}

/* May the limits that the intervals need still be below the cutoff? Below a cutoff of 0: is nothing refused so far? */
static bool below_cutoff(const struct examiner *examiner, const struct working *working, double cutoff)
{
    for (uint32_t d = 0; d < working->component_count; d++) {
        const struct interval *interval = &examiner->intervals[d];
        double factor = working->components[d].factor;
        if (interval->limit > interval->asked && interval->limit * factor >= cutoff)
            return false;
    }
    return true;
}

/* One corner of the overlay, whose constants are in examiner->constants. False: it is above the cutoff, or there is no
 * memory (then point_count is SIZE_MAX). */
static bool add_point(struct examiner *examiner, const struct working *working, double weight, uint32_t cone,
                      const struct sentinel *where, double cutoff)
{
    size_t width = 1 + (size_t)working->component_count;
    bool risen = false;
    if (!point_room(examiner, width)) {
        examiner->point_count = SIZE_MAX;
        return false;
    }
    examiner->places[examiner->point_count] = *where;
    examiner->cones[examiner->point_count] = cone;
    double *point = examiner->points + width * examiner->point_count++;
    point[0] = weight;
    for (uint32_t d = 0; d < working->component_count; d++) {
        point[1 + d] = examiner->constants[d];
        risen |= narrow(&examiner->intervals[d], weight, examiner->constants[d], where);
    }
    return !risen || below_cutoff(examiner, working, cutoff);
}

/* The intervals before any point: the range. What rounding may hide is taken off the limit. */
static void open_intervals(struct examiner *examiner, const struct working *working, double limit)
{
    const struct cover *cover = &examiner->cover;
    for (uint32_t d = 0; d < working->component_count; d++) {
        const struct component *component = &working->components[d];
        const double *whole = working->fields[component->field].component_range[component->component];
        const double range[2] = {whole[0] - examiner->bases[d], whole[1] - examiner->bases[d]};
        double least = INFINITY, greatest = -INFINITY;
        for (size_t l = 0; l < cover->link_count; l++) {
            double value = examiner->level[d * (size_t)cover->link_count + l];
            least = smaller(least, value);
            greatest = larger(greatest, value);
        }
        for (size_t v = 0; v < cover->vertex_count; v++) {
            double value = examiner->original[d * (size_t)cover->vertex_count + v];
            least = smaller(least, value);
            greatest = larger(greatest, value);
        }
        double factor = component->factor, own = factor > 0 ? limit / factor : INFINITY;
        double slack = 64 * DBL_EPSILON * (cover->condition + 2) * (greatest - least);
        examiner->errors[d] = slack;
        examiner->intervals[d] = (struct interval){own * (1 + LIMIT_TIE / 2) - slack,
                                                   own * (1 + LIMIT_TIE / 2) - slack,
                                                   range[0],
                                                   range[1],
                                                   {range[0], range[1]},
                                                   end_of_range(range[0]),
                                                   end_of_range(range[1])};
    }
}

/* ---- the corners of the overlay */

/* What an examination works on. */
struct examination {
    struct examiner *examiner;
    const struct overlaps *overlaps;
    const struct working *working;
    const struct star *star;
    double cutoff;
    bool whole;
};

/* An original vertex in a cone of the star, v' as well if it is one. */
static bool at_vertex(const struct examination *e, uint32_t v)
{
    struct examiner *examiner = e->examiner;
    const struct cover *cover = &examiner->cover;
    const double *p = cover->positions[v];
    size_t links = cover->link_count, vertices = cover->vertex_count;
    if (p[0] == cover->apex[0] && p[1] == cover->apex[1] && p[2] == cover->apex[2]) {
        for (uint32_t d = 0; d < e->working->component_count; d++)
            examiner->constants[d] = -examiner->original[d * vertices + v];
        return add_point(examiner, e->working, 1, TETLOD_NONE, &nowhere, e->cutoff);
    }
    uint32_t f = cover_cone_of(cover, v);
    if (f == TETLOD_NONE)
        return true;
    const struct cone *cone = &cover->cones[f];
    double weight = cone->apex * cone_height(cone, cover, e->working, p);
    if (!(weight > 0))
        return true;
    for (uint32_t d = 0; d < e->working->component_count; d++) {
        double constant = -examiner->original[d * vertices + v];
        for (int k = 0; k < 3; k++)
            constant += cone->scale[k] * cover_distance(cover, cone->walls[k],
                                                        cover->offsets[v]) * examiner->level[d * links + cone->link[k]];
        examiner->constants[d] = constant;
    }
    const struct sentinel here = {cone->tet, {{cover->vertices[v], cover->vertices[v]}, 0}};
    return add_point(examiner, e->working, weight, f, &here, e->cutoff);
}

/* Where the edge from vertex a to vertex b crosses the plane of wall w, if that is in the wall. */
static bool at_wall(const struct examination *e, uint32_t a, uint32_t b, uint32_t w)
{
    struct examiner *examiner = e->examiner;
    const struct cover *cover = &examiner->cover;
    const struct cone *cone = &cover->cones[cover->walls[w].cones[0]];
    const double *from = cover->offsets[a], *to = cover->offsets[b], near = cover_distance(cover, w, from);
    double between = near - cover_distance(cover, w,
                                           to), t = between != 0 ? near / between : 0, s, x[3], weights[3], sum = 0;
    t = smaller(larger(t, 0), 1);
    s = 1 - t;
    for (int k = 0; k < 3; k++) {
        uint32_t other = cone->walls[k];
        weights[k] = other == w ? 0
                                : cone->scale[k] *
                                      (s * cover_distance(cover, other, from) + t * cover_distance(cover, other, to));
        if (weights[k] < -cover->beyond)
            return true;
        sum += weights[k];
    }
    if (sum > 1 + cover->beyond)
        return true;
    const double *p = cover->positions[a], *q = cover->positions[b];
    for (int i = 0; i < 3; i++)
        x[i] = s * p[i] + t * q[i];
    double weight = cone->apex * cone_height(cone, cover, e->working, x);
    if (!(weight > 0))
        return true;
    for (uint32_t d = 0; d < e->working->component_count; d++) {
        const double *level = examiner->level + d * (size_t)cover->link_count,
                     *original = examiner->original + d * (size_t)cover->vertex_count;
        double constant = -s * original[a] - t * original[b];
        for (int k = 0; k < 3; k++)
            constant += weights[k] * level[cone->link[k]];
        examiner->constants[d] = constant;
    }
    const struct sentinel here = {cone->tet, {{cover->vertices[a], cover->vertices[b]}, (float)t}};
    return add_point(examiner, e->working, weight, cover->walls[w].cones[0], &here, e->cutoff);
}

/* Is the origin in the triangle, which turns counterclockwise? Then its barycentric weights, as exact as they can be
 * had, and how far they are off: refined until that is within `tolerance`. */
static bool triangle_holds(const double p[3][2], const double tolerance[2], double weights[3], double off[2])
{
    double sum = 0;
    for (int k = 0; k < 3; k++) {
        const double *a = p[(k + 1) % 3], *b = p[(k + 2) % 3];
        weights[k] = a[0] * b[1] - a[1] * b[0];
        sum += weights[k];
    }
    for (int k = 0; k < 3; k++)
        if (!(sum > 0 && weights[k] >= -BEYOND * sum))
            return false;
    for (int k = 0; k < 3; k++)
        weights[k] /= sum;
    for (int refined = 0;; refined++) {
        for (int i = 0; i < 2; i++)
            off[i] = weights[0] * p[0][i] + weights[1] * p[1][i] + weights[2] * p[2][i];
        if (refined == REFINEMENTS || (fabs(off[0]) <= tolerance[0] && fabs(off[1]) <= tolerance[1]))
            return true;
        for (int k = 0; k < 3; k++) {
            const double *a = p[(k + 1) % 3], *b = p[(k + 2) % 3];
            weights[k] += ((a[0] - b[0]) * off[1] - (a[1] - b[1]) * off[0]) / sum;
        }
    }
}

/* Where the spoke to a link vertex crosses the original face of three vertices. In the plane of the distances from two
 * walls that meet in the spoke, the spoke is the origin. */
static bool at_face(const struct examination *e, uint32_t link, const uint32_t face[3])
{
    struct examiner *examiner = e->examiner;
    const struct cover *cover = &examiner->cover;
    const struct spoke *spoke = &cover->spokes[link];
    const double *tip = working_row(e->working, cover->link[link]);
    const double tolerance[2] = {cover->tolerances[spoke->walls[0]], cover->tolerances[spoke->walls[1]]};
    double across[3][2], weights[3], off[2], along[3], x[3] = {0, 0, 0};
    for (int k = 0; k < 3; k++)
        for (int i = 0; i < 2; i++)
            across[k][i] = cover_distance(cover, spoke->walls[i], cover->offsets[face[k]]);
    if (!triangle_holds(across, tolerance, weights, off))
        return true;
    for (int i = 0; i < 2; i++)
        if (fabs(off[i]) > IN_FACE * cover->reach * cover->walls[spoke->walls[i]].length)
            return true; // the spoke lies in the face: where it leaves that, it crosses others (PROOF.md, 8)
    for (int k = 0; k < 3; k++)
        for (int i = 0; i < 3; i++)
            x[i] += weights[k] * cover->positions[face[k]][i];
    subtract(tip, cover->apex, along);
    subtract(tip, x, x);
    double weight = dot(along, x) / dot(along, along);
    if (!(weight > 0) || weight > 1 + BEYOND)
        return true;
    for (uint32_t d = 0; d < e->working->component_count; d++) {
        const double *original = examiner->original + d * (size_t)cover->vertex_count;
        double constant = (1 - weight) * examiner->level[d * (size_t)cover->link_count + link];
        for (int k = 0; k < 3; k++)
            constant -= weights[k] * original[face[k]];
        examiner->constants[d] = constant;
    }
    const struct sentinel here = {cover->cones[spoke->cone].tet, {{TETLOD_NONE, TETLOD_NONE}, 0}};
    return add_point(examiner, e->working, weight, spoke->cone, &here, e->cutoff);
}

/* v' where it is no original vertex: in the original that it is least outside of. */
static bool at_apex(const struct examination *e)
{
    struct examiner *examiner = e->examiner;
    const struct cover *cover = &examiner->cover;
    const double *at = cover->apex;
    double most = -INFINITY;
    for (uint32_t t = 0; t < cover->tet_count; t++) {
        const double *p[4];
        for (int c = 0; c < 4; c++)
            p[c] = cover->positions[cover->corners[t][c]];
        double weights[4] = {tet_volume6(at, p[1], p[2], p[3]), tet_volume6(p[0], at, p[2], p[3]),
                             tet_volume6(p[0], p[1], at, p[3]), tet_volume6(p[0], p[1], p[2], at)};
        double volume = weights[0] + weights[1] + weights[2] + weights[3], least = INFINITY;
        for (int c = 0; c < 4; c++)
            least = smaller(least, weights[c] /= volume);
        if (!(least > most))
            continue;
        most = least;
        for (uint32_t d = 0; d < e->working->component_count; d++) {
            examiner->constants[d] = 0;
            for (int c = 0; c < 4; c++)
                examiner->constants[d] -=
                    weights[c] * examiner->original[d * (size_t)cover->vertex_count + cover->corners[t][c]];
        }
        if (most >= 0)
            break;
    }
    return most == -INFINITY || add_point(examiner, e->working, 1, TETLOD_NONE, &nowhere, e->cutoff);
}

static bool is_original(const struct examination *e)
{
    const struct working *working = e->working;
    for (uint32_t s = 0; s < e->star->simplex_count; s++) {
        uint32_t slot = e->star->simplex[s];
        if (working->node[slot] < working->log->vertex_count &&
            memcmp(working_row(working, slot), e->examiner->cover.apex, 24) == 0)
            return true;
    }
    return false;
}

/* Are both ends of an edge outside of one of the cone's walls? `a` and `b` are their sets of sides. */
static inline bool beside(const struct cover *cover, uint32_t words, const uint64_t *a, const uint64_t *b, uint32_t f)
{
    uint32_t low = MAYBE_NOT_POSITIVE * words, high = MAYBE_NOT_NEGATIVE * words;
    const uint64_t *walls = cover->cone_walls + (size_t)f * words, *inside = cover->cone_signs + (size_t)f * words;
    uint64_t outside = 0;
    for (uint32_t word = 0; word < words; word++)
        outside |= (inside[word] & ~(a[high + word] | b[high + word])) |
                   ((walls[word] ^ inside[word]) & ~(a[low + word] | b[low + word]));
    return outside;
}

/* All walls whose planes have the ends of an edge on different sides. */
static bool try_walls(const struct examination *e, const uint32_t edge[2])
{
    const struct cover *cover = &e->examiner->cover;
    const uint64_t *a = cover_side(cover, edge[0], POSITIVE), *b = cover_side(cover, edge[1], POSITIVE);
    for (uint32_t word = 0; word < cover->words; word++)
        for (uint64_t bits = a[word] ^ b[word]; bits; bits &= bits - 1) {
            uint32_t w = 64 * word + (uint32_t)__builtin_ctzll(bits);
            const struct wall *wall = &cover->walls[w];
            if (!beside(cover, cover->words, a, b, wall->cones[0]) &&
                !beside(cover, cover->words, a, b, wall->cones[1]) &&
                !at_wall(e, edge[0], edge[1], w))
                return false;
        }
    return true;
}

enum { ARRIVED = -1, LOST = -2 };

/* The wall by which an edge leaves cone f: of those that its far end is outside of the one that it crosses first.
 * ARRIVED: of none. LOST: its near end is outside of one as well, so that rounding has led astray, or it leaves the
 * star. */
static int64_t way_out(const struct cover *cover, const uint32_t edge[2], uint32_t f)
{
    const double *from = cover->offsets[edge[0]], *to = cover->offsets[edge[1]];
    const uint64_t *near = cover_side(cover, edge[0], POSITIVE), *far = cover_side(cover, edge[1], POSITIVE),
                   *inside = cover->cone_signs + (size_t)f * cover->words;
    int64_t found = ARRIVED;
    double first = INFINITY;
    for (int k = 0; k < 3; k++) {
        uint32_t w = cover->cones[f].walls[k];
        uint64_t bit = (uint64_t)1 << w % 64;
        if (!((far[w / 64] ^ inside[w / 64]) & bit))
            continue;
        if ((near[w / 64] ^ inside[w / 64]) & bit || cover->walls[w].outer)
            return LOST;
        double distance = cover_distance(cover, w, from), t = distance / (distance - cover_distance(cover, w, to));
        if (t < first) {
            first = t;
            found = w;
        }
    }
    return found;
}

/* Follows an edge from cone to cone through the walls that it crosses. Where that fails, all walls are tried. */
static bool at_edge(const struct examination *e, const uint32_t edge[2])
{
    const struct cover *cover = &e->examiner->cover;
    size_t before = e->examiner->point_count;
    uint32_t f = cover->homes[edge[0]];
    if (f != TETLOD_NONE && cover->homes[edge[1]] == f)
        return true; // most
    for (uint32_t steps = 0; f != TETLOD_NONE && steps < cover->wall_count; steps++) {
        int64_t w = way_out(cover, edge, f);
        if (w == ARRIVED)
            return true;
        if (w == LOST)
            break;
        if (!at_wall(e, edge[0], edge[1], (uint32_t)w))
            return false;
        f = cover->walls[w].cones[cover->walls[w].cones[0] == f];
    }
    e->examiner->point_count = before; // they are found again
    return try_walls(e, edge);
}

static bool at_edges(const struct examination *e)
{
    const struct cover *cover = &e->examiner->cover;
    for (uint32_t i = 0; i < cover->edge_count; i++)
        if (!at_edge(e, cover->edges[i]))
            return false;
    return true;
}

/* The walls that an original may lie on both sides of. */
static inline void both_sides(const struct cover *cover, const uint32_t corners[4], uint64_t *out)
{
    for (uint32_t word = 0; word < cover->words; word++) {
        uint64_t low = 0, high = 0;
        for (int c = 0; c < 4; c++) {
            low |= cover_side(cover, corners[c], MAYBE_NOT_POSITIVE)[word];
            high |= cover_side(cover, corners[c], MAYBE_NOT_NEGATIVE)[word];
        }
        out[word] = low & high;
    }
}

/* Are all walls that meet in the spoke among those? */
static inline bool around(const struct cover *cover, uint32_t words, const uint64_t *both, uint32_t link)
{
    const uint64_t *walls = cover->spoke_walls + (size_t)link * words;
    uint64_t missing = 0;
    for (uint32_t word = 0; word < words; word++)
        missing |= walls[word] & ~both[word];
    return !missing;
}

/* The same of an original face. */
static inline bool face_around(const struct cover *cover, uint32_t words, const uint32_t face[3], uint32_t link)
{
    const uint64_t *sides[3], *walls = cover->spoke_walls + (size_t)link * words;
    uint32_t low = MAYBE_NOT_POSITIVE * words, high = MAYBE_NOT_NEGATIVE * words;
    for (int k = 0; k < 3; k++)
        sides[k] = cover->signs + (size_t)face[k] * SIDES * words;
    uint64_t missing = 0;
    for (uint32_t word = 0; word < words; word++)
        missing |= walls[word] & ~((sides[0][low + word] | sides[1][low + word] | sides[2][low + word]) &
                                   (sides[0][high + word] | sides[1][high + word] | sides[2][high + word]));
    return !missing;
}

/* The faces that may cross a spoke: from one of their two tetrahedra they are seen to turn one way, from the other the
 * other way, so that each counts once. `sets` are the originals' walls of both sides. */
static inline bool at_spoke(const struct examination *e, uint32_t words, uint32_t link, const uint64_t *sets)
{
    const struct cover *cover = &e->examiner->cover;
    for (uint32_t t = 0; t < cover->tet_count; t++) {
        if (!around(cover, words, sets + (size_t)t * words, link))
            continue;
        for (int f = 0; f < 4; f++) {
            uint32_t face[3];
            for (int k = 0; k < 3; k++)
                face[k] = cover->corners[t][tet_faces[f][k]];
            if (face_around(cover, words, face, link) && !at_face(e, link, face))
                return false;
        }
    }
    return true;
}

static bool at_spokes(const struct examination *e)
{
    struct examiner *examiner = e->examiner;
    const struct cover *cover = &examiner->cover;
    size_t tets = cover->tet_count;
    if (!ARRAY_RESERVE(examiner->sets, examiner->set_capacity, tets * cover->words)) {
        examiner->point_count = SIZE_MAX;
        return false;
    }
    for (size_t t = 0; t < tets; t++)
        both_sides(cover, cover->corners[t], examiner->sets + t * cover->words);
    for (uint32_t link = 0; link < cover->link_count; link++)
        if (!(cover->words == 1   ? at_spoke(e, 1, link, examiner->sets)
              : cover->words == 2 ? at_spoke(e, 2, link, examiner->sets)
                                  : at_spoke(e, cover->words, link, examiner->sets)))
            return false;
    return true;
}

/* A sentinel is a point of the overlay that must hold wherever v' is. False: no memory. */
static bool ask_sentinel(const struct examination *e, const struct watched *point)
{
    struct examiner *examiner = e->examiner;
    struct cover *cover = &examiner->cover;
    double p[3], weights[3], weight, t = point->along;
    if (point->ends[0] == TETLOD_NONE)
        return true;
    const double *a = e->overlaps->mesh->positions + 3 * (size_t)point->ends[0],
                 *b = e->overlaps->mesh->positions + 3 * (size_t)point->ends[1];
    for (int k = 0; k < 3; k++)
        p[k] = (1 - t) * a[k] + t * b[k];
    uint32_t f = cover_cone_at(cover, e->working, p, weights, &weight);
    if (f == TETLOD_NONE || !(weight > 0))
        return true;
    for (uint32_t d = 0; d < e->working->component_count; d++) {
        double constant = -(1 - t) * original_value(examiner, e->overlaps, e->working, d, point->ends[0]) -
                          t * original_value(examiner, e->overlaps, e->working, d, point->ends[1]);
        for (int k = 0; k < 3; k++)
            constant += weights[k] * examiner->level[d * (size_t)cover->link_count + cover->cones[f].link[k]];
        examiner->constants[d] = constant;
    }
    const struct sentinel here = {cover->cones[f].tet, *point};
    add_point(examiner, e->working, weight, f, &here, INFINITY);
    return examiner->point_count != SIZE_MAX;
}

/* What refused the star's other candidates, then the sentinels of its tetrahedra. False: above the cutoff, or no
 * memory. */
static bool ask_sentinels(const struct examination *e)
{
    const struct examiner *examiner = e->examiner;
    for (uint32_t i = 0; i < examiner->recent_count; i++)
        if (!ask_sentinel(e, &examiner->recent[i].point))
            return false;
    if (!below_cutoff(examiner, e->working, e->cutoff))
        return false;
    for (uint32_t i = 0; i < e->star->tet_count; i++)
        for (uint32_t k = e->overlaps->sentinels[e->star->tets[i]]; k != TETLOD_NONE; k = e->overlaps->watches[k].next)
            if (!ask_sentinel(e, &e->overlaps->watches[k].point))
                return false;
    return below_cutoff(examiner, e->working, e->cutoff);
}

/* Is the next kind of corners asked, too? Not if one has refused, unless the whole bound is wanted. */
static bool goes_on(const struct examination *e)
{
    return e->whole || below_cutoff(e->examiner, e->working, 0);
}

/* All corners of the overlay, kind by kind, the cheapest first: once one kind refuses, the next need not be asked.
 * False: above the cutoff, or out of memory. */
static bool examine_corners(const struct examination *e)
{
    struct cover *cover = &e->examiner->cover;
    if (!is_original(e) && !at_apex(e))
        return false;
    for (uint32_t v = 0; v < cover->vertex_count; v++) {
        cover_place(cover, v);
        if (!at_vertex(e, v))
            return false;
    }
    if (!goes_on(e))
        return false;
    struct tetlod_error error;
    if (cover_edges(cover, &error) != TETLOD_OK) {
        e->examiner->point_count = SIZE_MAX;
        return false;
    }
    return at_edges(e) && goes_on(e) && at_spokes(e);
}

/* ---- the finding */

/* What is left of the points raises the limit of an empty interval to what it is: each time by the worst of them. */
static void raise_limits(struct examiner *examiner, const struct working *working)
{
    size_t width = 1 + (size_t)working->component_count;
    for (uint32_t d = 0; d < working->component_count; d++) {
        struct interval *interval = &examiner->intervals[d];
        for (int round = 0; round < 20 && interval->limit > interval->asked; round++) {
            const double *worst = NULL;
            double most = interval->limit * (1 + 1e-9);
            for (size_t i = 0; i < examiner->point_count; i++) {
                const double *point = examiner->points + width * i;
                double error = fabs(point[0] * interval->low + point[1 + d]);
                if (error > most) {
                    most = error;
                    worst = point;
                }
            }
            if (!worst)
                break;
            narrow(interval, worst[0], worst[1 + d], &examiner->places[(size_t)(worst - examiner->points) / width]);
        }
    }
}

static bool refused(const struct examiner *examiner, const struct working *working, struct finding *out)
{
    out->error = 0;
    for (uint32_t d = 0; d < working->component_count; d++) {
        const struct interval *interval = &examiner->intervals[d];
        const struct component *component = &working->components[d];
        double bound = interval->limit * component->factor;
        if (interval->limit <= interval->asked || bound <= out->error)
            continue;
        out->error = bound;
        out->witness[0] = interval->lowest.where;
        out->witness[1] = interval->highest.where;
    }
    return out->error > 0;
}

/* The value whose differences at the corners of the overlay have the least sum of squares: it leaves contractions
 * beside it more room than the quadric's best does. */
static double fitting(const struct examiner *examiner, const struct working *working, uint32_t d)
{
    size_t width = 1 + (size_t)working->component_count;
    double products = 0, squares = 0;
    for (size_t i = 0; i < examiner->point_count; i++) {
        const double *point = examiner->points + width * i;
        products += point[0] * point[1 + d];
        squares += point[0] * point[0];
    }
    return squares > 0 ? -products / squares : 0;
}

/* The value of the field that is nearest to one that is less the base. */
static double round_value(const struct examiner *examiner, const struct working *working, uint32_t d, double value)
{
    const struct component *component = &working->components[d];
    return field_round(&working->fields[component->field], component->component, value + examiner->bases[d]);
}

static bool within(const struct examiner *examiner, uint32_t d, double rounded)
{
    double value = rounded - examiner->bases[d];
    return value >= examiner->intervals[d].low && value <= examiner->intervals[d].high;
}

/* The field's value in the interval that is nearest to the wanted one, if there is one. */
static double choose(const struct examiner *examiner, const struct working *working, uint32_t d, double wanted)
{
    const struct interval *interval = &examiner->intervals[d];
    double nearest = smaller(larger(wanted, interval->low), interval->high);
    double rounded = round_value(examiner, working, d, nearest);
    if (!within(examiner, d, rounded)) // a step inwards
        rounded = round_value(examiner, working, d, 2 * nearest - (rounded - examiner->bases[d]));
    if (!within(examiner, d, rounded))
        rounded = round_value(examiner, working, d, (interval->low + interval->high) / 2);
    return rounded;
}

/* The values, and the errors with them. */
static void settle(struct examiner *examiner, const struct working *working, double limit, struct finding *out)
{
    size_t width = 1 + (size_t)working->component_count;
    out->error = 0;
    for (uint32_t d = 0; d < working->component_count; d++) {
        const struct component *component = &working->components[d];
        examiner->chosen[d] = choose(examiner, working, d, fitting(examiner, working, d));
        double value = examiner->chosen[d] - examiner->bases[d], most = 0;
        for (size_t i = 0; i < examiner->point_count; i++) {
            const double *point = examiner->points + width * i;
            most = larger(most, fabs(point[0] * value + point[1 + d]));
        }
        examiner->errors[d] += most;
        out->error = larger(out->error, examiner->errors[d] * component->factor);
    }
    out->allowed = out->error <= limit * (1 + LIMIT_TIE);
}

enum tetlod_status exact_examine(struct examiner *examiner, const struct overlaps *overlaps,
                                 const struct working *working, const struct star *star,
                                 const double p[3], double limit, double cutoff, bool whole, struct finding *out,
                                 struct tetlod_error *error)
{
    const struct examination e = {examiner, overlaps, working, star, cutoff, whole};
    bool good;
    *out = (struct finding){.error = INFINITY, .witness = {nowhere, nowhere}};
    TETLOD_TRY(cover_set_apex(&examiner->cover, working, p, &good, error));
    if (!good)
        return TETLOD_OK;
    open_intervals(examiner, working, limit);
    examiner->point_count = 0;
    bool undecided = ask_sentinels(&e) && examiner->point_count != SIZE_MAX;
    if (undecided) {
        TETLOD_TRY(gather(examiner, overlaps, working, star, &good, error));
        out->large = !good;
        if (!good)
            return TETLOD_OK;
        open_intervals(examiner, working, limit);
        examiner->point_count = 0;
        examine_corners(&e);
    }
    if (examiner->point_count == SIZE_MAX)
        return tetlodi_fail_nomem(error, "the exact limit", examiner->point_capacity * 8);
    raise_limits(examiner, working);
    if (!refused(examiner, working, out))
        settle(examiner, working, limit, out);
    for (int i = 0; i < 2 && examiner->recent_count < RECENT; i++)
        examiner->recent[examiner->recent_count++] = out->witness[i];
    return TETLOD_OK;
}

enum tetlod_status exact_pass_on(struct examiner *examiner, const struct working *working, struct passed *out,
                                 struct tetlod_error *error)
{
    return cover_pass_on(&examiner->cover, working, out, error);
}
