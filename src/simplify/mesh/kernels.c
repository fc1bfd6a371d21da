/* SPDX-License-Identifier: BSD-3-Clause */
/* kernels_avx2.c is this file once more, under another name and for other processors. */
#include "src/simplify/mesh/kernels.h"

#include <float.h>
#include <math.h>

#include "src/mesh/tet_geom.h"
#include "src/util/wide.h"

/* A flip is seen where the volume falls below this multiple of the cube of a sum of coordinates: about TET_DEGENERATE
 * of the longest edge's. Only those that are chosen are tested to the letter. */
#define MIN_VOLUME (8 * TET_DEGENERATE)

static inline wide length1(const wide a[4])
{
    return wide_add(wide_abs(a[0]), wide_add(wide_abs(a[1]), wide_abs(a[2])));
}

/* a x b */
static inline void wide_normal(const wide a[4], const wide b[4], wide out[3])
{
    for (int i = 0; i < 3; i++)
        out[i] = wide_cross(a[(i + 1) % 3], b[(i + 2) % 3], a[(i + 2) % 3], b[(i + 1) % 3]);
}

static inline wide wide_dot3(const wide a[3], const wide b[3])
{
    return wide_dot(a[0], b[0], a[1], b[1], a[2], b[2]);
}

static inline wide largest(wide a, wide b, wide c)
{
    return wide_max(a, wide_max(b, c));
}

/* The gradients of the two or four functions in one column block of the rows. */
static inline void set_gradient(double *gradient, const wide value[3], wide normals[3][3], wide inverse)
{
    wide f[3];
    for (int k = 0; k < 3; k++)
        f[k] = wide_mul(value[k], inverse);
    for (uint32_t d = 0; d < 3; d++)
        wide_store(gradient + WIDE * d, wide_dot(f[0], normals[0][d], f[1], normals[1][d], f[2], normals[2][d]));
}

static void set_rows(struct star_data *data, const struct working *working)
{
    uint32_t stride = working->stride;
    const double *own = working_row(working, data->vertex);
    for (uint32_t n = 0; n < data->count; n++) {
        const double *row = working_row(working, data->slots[n]);
        for (uint32_t i = 0; i < stride; i += WIDE)
            wide_store(data->rows + (size_t)n * stride + i, wide_sub(wide_load(row + i), wide_load(own + i)));
    }
}

static void prepare(struct star_data *data, const struct working *working)
{
    uint32_t stride = working->stride, functions = 2 * working->component_count, count = data->tet_count;
    set_rows(data, working);
    for (uint32_t i = count; i % BLOCK; i++)
        for (int k = 0; k < 3; k++)
            data->corners[k][i] = data->corners[k][0];
    for (uint32_t i = 0; i < (count + BLOCK - 1) / BLOCK * BLOCK; i += WIDE) {
        const double *rows[3][WIDE];
        double *planes = planes_at(data, working->component_count, i);
        wide at[3][4], normals[3][3], value[3];
        for (int k = 0; k < 3; k++) {
            for (int j = 0; j < WIDE; j++)
                rows[k][j] = data->rows + (size_t)data->corners[k][i + (uint32_t)j] * stride;
            wide_columns(rows[k], at[k]);
        }
        for (int k = 0; k < 3; k++)
            wide_normal(at[(k + 1) % 3], at[(k + 2) % 3], normals[k]);
        wide volume = wide_dot3(at[0], normals[0]), inverse = wide_div(wide_all(1), volume);
        for (uint32_t f = 0; f < functions; f++) {
            uint32_t column = ROW_FIELDS + f;
            if (column % WIDE == 0)
                for (int k = 0; k < 3; k++) {
                    for (int j = 0; j < WIDE; j++)
                        rows[k][j] += WIDE;
                    wide_columns(rows[k], at[k]);
                }
            if (column == ROW_FIELDS) { // the positions are in the same block
                wide size = largest(length1(at[0]), length1(at[1]), length1(at[2]));
                wide_store(planes + WIDE * PLANE_VOLUME, volume);
                wide_store(planes + WIDE * PLANE_LEAST,
                           wide_mul(wide_all(MIN_VOLUME), wide_mul(size, wide_mul(size, size))));
                for (uint32_t d = 0; d < 3; d++)
                    wide_store(planes + WIDE * (PLANE_SLOPE + d),
                               wide_sub(wide_all(0), wide_add(normals[0][d], wide_add(normals[1][d], normals[2][d]))));
            }
            for (int k = 0; k < 3; k++)
                value[k] = at[k][column % WIDE];
            set_gradient(planes + WIDE * (PLANE_GRADIENTS + 3 * f), value, normals, inverse);
        }
    }
    for (uint32_t i = count; i % BLOCK; i++) { // the repeated ones never turn over
        double *planes = planes_at(data, working->component_count, i / WIDE * WIDE) + i % WIDE;
        for (uint32_t d = 0; d < 3; d++)
            planes[WIDE * (PLANE_SLOPE + d)] = 0;
        planes[WIDE * PLANE_LEAST] = 0;
        planes[WIDE * PLANE_VOLUME] = 1;
    }
}

static inline wide plane_at(const double *plane, wide x, wide y, wide z)
{
    return wide_dot(wide_load(plane), x, wide_load(plane + WIDE), y, wide_load(plane + 2 * WIDE), z);
}

static inline void count_turned(const double *planes, wide x, wide y, wide z, struct edge_answer *answer)
{
    wide before = wide_load(planes + WIDE * PLANE_VOLUME), small = wide_load(planes + WIDE * PLANE_LEAST);
    wide after = wide_add(before, plane_at(planes + WIDE * PLANE_SLOPE, x, y, z));
    answer->turned += wide_count_at_most(after, small);
    answer->half_turned |= wide_at_most(wide_mul(wide_all(0.5), wide_add(after, before)), small);
}

static inline struct edge_answer query_edge_with(const struct star_data *data, uint32_t neighbour,
                                                 const struct edge_query *query, uint32_t stride,
                                                 uint32_t components)
{
    struct edge_answer answer = {.followed = true};
    size_t four = WIDE * plane_count(components); // planes of four tetrahedra
    const double *r = data->rows + (size_t)neighbour * stride;
    double *reach = data->reach + (size_t)neighbour * 2 * components;
    wide x = wide_all(r[0]), y = wide_all(r[1]), z = wide_all(r[2]);
    for (uint32_t c = 0; c < components; c++) {
        reach[2 * c] = -INFINITY;
        reach[2 * c + 1] = INFINITY;
    }
    const double *planes = data->planes;
    for (uint32_t begin = 0; begin < data->tet_count; begin += BLOCK, planes += 2 * four) {
        double error = 0;
        for (uint32_t c = 0; c < components; c++) {
            const double *first = planes + WIDE * (PLANE_GRADIENTS + 6 * c), *second = first + four;
            wide upper = wide_max(plane_at(first, x, y, z), plane_at(second, x, y, z));
            wide lower = wide_min(plane_at(first + 3 * WIDE, x, y, z), plane_at(second + 3 * WIDE, x, y, z));
            reach[2 * c] = larger(reach[2 * c], wide_greatest(upper));
            reach[2 * c + 1] = smaller(reach[2 * c + 1], wide_least(lower));
            error = larger(error,
                           (query->gaps[c] + query->part * (reach[2 * c] - reach[2 * c + 1])) / 2 * query->factors[c]);
        }
        count_turned(planes, x, y, z, &answer);
        count_turned(planes + four, x, y, z, &answer);
        answer.error = error;
        if (error > query->most) {
            answer.followed = false;
            break;
        }
        if (answer.half_turned && answer.turned > data->shared[neighbour]) // neither is possible
            break;
    }
    return answer;
}

static struct edge_answer query_edge(const struct star_data *data, uint32_t neighbour, const struct edge_query *query,
                                     uint32_t stride)
{
    return query->components == 1 ? query_edge_with(data, neighbour, query, stride, 1)
                                  : query_edge_with(data, neighbour, query, stride, query->components);
}

/* Twice what tet_orientation asks for at most, for r may be longer than the edges were. */
static uint32_t doubt(struct star_data *data, uint32_t components, const double r[3])
{
    wide x = wide_all(r[0]), y = wide_all(r[1]), z = wide_all(r[2]);
    double length = fabs(r[0]) + fabs(r[1]) + fabs(r[2]);
    wide two = wide_all(2), own = wide_all(2 * MIN_VOLUME * (length * length * length));
    uint32_t count = 0;
    for (uint32_t i = 0; i < data->tet_count; i += WIDE) {
        const double *planes = planes_at(data, components, i);
        wide after = wide_add(wide_load(planes + WIDE * PLANE_VOLUME), plane_at(planes + WIDE * PLANE_SLOPE, x, y, z));
        unsigned small = wide_at_most(after, wide_max(own, wide_mul(two, wide_load(planes + WIDE * PLANE_LEAST))));
        for (uint32_t j = 0; j < WIDE && small; j++)
            if (small >> j & 1 && i + j < data->tet_count)
                data->doubtful[count++] = i + j;
    }
    return count;
}

/* Rows of the other corners of up to four tetrahedra of a star, from the *at-th on; the rest repeat the first. Returns
 * how many. */
static inline uint32_t four_of_star(const struct working *working, uint32_t slot, uint32_t *at,
                                    const double *rows[3][WIDE])
{
    static const uint8_t others_of[4][3] = {{1, 2, 3}, {0, 3, 2}, {0, 1, 3}, {0, 2, 1}};
    const struct span *star = &working->stars[slot];
    const uint32_t *tets = working->pool + star->begin;
    uint32_t count = 0;
    for (; *at < star->count && count < WIDE; (*at)++) {
        const uint32_t *corners = working->corners[tets[*at]];
        if (corners[0] == TETLOD_NONE)
            continue;
        const uint8_t *others = others_of[corner_of(corners, slot)];
        for (int k = 0; k < 3; k++)
            rows[k][count] = working_row(working, corners[others[k]]);
        count++;
    }
    for (uint32_t j = count; j < WIDE && count; j++)
        for (int k = 0; k < 3; k++)
            rows[k][j] = rows[k][0];
    return count;
}

static inline bool halfway_with(const struct working *working, uint32_t from, uint32_t to,
                                const struct edge_query *query,
                                struct half *half, uint32_t components)
{
    const double *rows[3][WIDE], *own = working_row(working, from), *target = working_row(working, to);
    wide r[3];
    for (int i = 0; i < 3; i++)
        r[i] = wide_all(target[i] - own[i]);
    for (uint32_t i = 0; i < working->stars[from].count; i++)
        __builtin_prefetch(working->corners[working->pool[working->stars[from].begin + i]]);
    for (uint32_t at = 0; four_of_star(working, from, &at, rows);) {
        wide corner[3][4], normals[3][3], weight[3], value[3];
        for (int k = 0; k < 3; k++) {
            wide_columns(rows[k], corner[k]);
            for (int i = 0; i < 4; i++)
                corner[k][i] = wide_sub(corner[k][i], wide_all(own[i]));
        }
        for (int k = 0; k < 3; k++)
            wide_normal(corner[(k + 1) % 3], corner[(k + 2) % 3], normals[k]);
        wide volume = wide_dot3(corner[0], normals[0]), inverse = wide_div(wide_all(1), volume);
        wide size = largest(length1(corner[0]), length1(corner[1]), length1(corner[2])), sum = wide_all(0);
        for (int k = 0; k < 3; k++) {
            weight[k] = wide_dot3(r, normals[k]);
            sum = wide_add(sum, weight[k]);
            weight[k] = wide_mul(weight[k], inverse);
        }
        wide left = wide_sub(volume, wide_mul(wide_all(0.5), sum));
        if (wide_at_most(left, wide_mul(wide_all(MIN_VOLUME), wide_mul(size, wide_mul(size, size)))))
            return false;
        half->error = 0;
        for (uint32_t f = 0; f < 2 * components; f++) {
            uint32_t column = ROW_FIELDS + f, c = f / 2;
            if (column % WIDE == 0)
                for (int k = 0; k < 3; k++) {
                    for (int j = 0; j < WIDE; j++)
                        rows[k][j] += WIDE;
                    wide_columns(rows[k], corner[k]);
                    for (uint32_t i = 0; i < 4; i++)
                        corner[k][i] = wide_sub(corner[k][i], wide_all(own[column + i]));
                }
            for (int k = 0; k < 3; k++)
                value[k] = corner[k][column % WIDE];
            wide rise = wide_dot(weight[0], value[0], weight[1], value[1], weight[2], value[2]);
            if (f % 2 == 0)
                half->upper[c] = larger(half->upper[c], half->rise[f] + 0.5 * wide_greatest(rise));
            else {
                half->lower[c] = smaller(half->lower[c], half->rise[f] + 0.5 * wide_least(rise));
                half->error = larger(half->error,
                                     (query->gaps[c] + half->upper[c] - half->lower[c]) / 2 * query->factors[c]);
            }
        }
        if (half->error > query->most)
            return true;
    }
    return true;
}

static bool halfway(const struct working *working, uint32_t from, uint32_t to, const struct edge_query *query,
                    struct half *half)
{
    return query->components == 1 ? halfway_with(working, from, to, query, half, 1)
                                 : halfway_with(working, from, to, query, half, query->components);
}

static inline wide wide_square(const wide a[4])
{
    return wide_dot(a[0], a[0], a[1], a[1], a[2], a[2]);
}

static inline void wide_less(const wide a[4], const wide b[4], wide out[4])
{
    for (int i = 0; i < 3; i++)
        out[i] = wide_sub(a[i], b[i]);
}

/* The square of the longest edge of a tetrahedron whose first corner is the origin. */
static inline wide longest_square(wide edges[3][4])
{
    wide size2 = largest(wide_square(edges[0]), wide_square(edges[1]), wide_square(edges[2]));
    for (int k = 0; k < 3; k++) {
        wide between[4];
        wide_less(edges[(k + 1) % 3], edges[k], between);
        size2 = wide_max(size2, wide_square(between));
    }
    return size2;
}

/* PROOF.md, 4: the weights' rounding per unit of u. */
static bool weigh(struct weighing *weighing, const double p[3])
{
    bool fits = true;
    uint32_t count = weighing->count;
    wide result[4] = {wide_all(p[0]), wide_all(p[1]), wide_all(p[2]), wide_all(0)}, one = wide_all(1);
    for (uint32_t i = count; i % WIDE; i++) {
        weighing->moves[i] = 0;
        for (int k = 0; k < 4; k++)
            weighing->rows[k][i] = weighing->rows[k][0];
    }
    for (uint32_t i = 0; i < count; i += WIDE) {
        wide corner[4][4], edges[3][4], normal[3], r[4], weight[3];
        for (int k = 0; k < 4; k++)
            wide_columns(weighing->rows[k] + i, corner[k]);
        for (int k = 0; k < 3; k++)
            wide_less(corner[k + 1], corner[0], edges[k]);
        wide_less(result, corner[0], r);
        wide_normal(edges[1], edges[2], normal);
        wide volume = wide_dot3(edges[0], normal), inverse = wide_div(one, volume), largest_weight = one;
        for (int k = 0; k < 3; k++) {
            if (k)
                wide_normal(edges[(k + 1) % 3], edges[(k + 2) % 3], normal);
            for (int d = 0; d < 3; d++)
                normal[d] = wide_mul(normal[d], inverse);
            weight[k] = wide_dot3(normal, r);
            largest_weight = wide_max(largest_weight, wide_abs(weight[k]));
            wide_store(weighing->weights[k] + i, weight[k]);
        }
        wide size2 = longest_square(edges), size = wide_sqrt(size2), reach = wide_sqrt(wide_square(r));
        wide_store(weighing->spread + i,
                   wide_div(wide_mul(size2, wide_add(wide_mul(size, largest_weight), reach)), volume));
        for (int k = 0; k < 3; k++)
            wide_less(corner[k + 1], result, edges[k]);
        wide_normal(edges[1], edges[2], normal);
        volume = wide_dot3(edges[0], normal);
        size2 = longest_square(edges);
        unsigned small = wide_at_most(volume, wide_mul(wide_all(TET_DEGENERATE), wide_mul(size2, wide_sqrt(size2))));
        for (uint32_t j = 0; j < WIDE; j++)
            fits &= !(small >> j & 1 && weighing->moves[i + j]);
    }
    return fits;
}

/* The weights and the share of the i-th tetrahedron, each four times. */
static inline void weights_of(const struct weighing *weighing, uint32_t i, wide weights[3], wide *share)
{
    for (int k = 0; k < 3; k++)
        weights[k] = wide_all(weighing->weights[k][i]);
    *share = wide_all(weighing->shares[i]);
}

static void bound(const struct weighing *weighing, uint32_t column, struct bounds *out)
{
    wide upper = wide_all(-INFINITY), lower = wide_all(INFINITY), mean = wide_all(0),
         rounding = wide_all(32 * DBL_EPSILON);
    for (uint32_t i = 0; i < weighing->count; i++) {
        wide weights[3], share, first = wide_load(weighing->rows[0][i] + column), value = first, spread = wide_all(0);
        weights_of(weighing, i, weights, &share);
        for (int k = 0; k < 3; k++) {
            wide difference = wide_sub(wide_load(weighing->rows[k + 1][i] + column), first);
            value = wide_add(value, wide_mul(weights[k], difference));
            spread = wide_max(spread, wide_abs(difference));
        }
        wide size = wide_add(wide_add(wide_mul(wide_all(weighing->spread[i]), spread), wide_abs(first)),
                             wide_abs(value));
        wide slack = wide_mul(rounding, size);
        upper = wide_max(upper, wide_add(value, slack));
        lower = wide_min(lower, wide_sub(value, slack));
        mean = wide_add(mean, wide_mul(share, value));
    }
    wide_store(out->upper, upper);
    wide_store(out->lower, lower);
    wide_store(out->mean, mean);
}

static inline void values_some(const struct weighing *weighing, const double *values, size_t stride, uint32_t count,
                            struct star_values *out)
{
    wide least = wide_all(INFINITY), greatest = wide_all(-INFINITY), low = least, high = greatest, mean = wide_all(0);
    for (uint32_t i = 0; i < weighing->count; i++) {
        wide weights[3], share, at[4];
        weights_of(weighing, i, weights, &share);
        for (int k = 0; k < 4; k++) {
            at[k] = wide_load_some(values + weighing->slots[i][k] * stride, count);
            low = wide_min(low, at[k]);
            high = wide_max(high, at[k]);
        }
        wide value = at[0];
        for (int k = 0; k < 3; k++)
            value = wide_add(value, wide_mul(weights[k], wide_sub(at[k + 1], at[0])));
        least = wide_min(least, value);
        greatest = wide_max(greatest, value);
        mean = wide_add(mean, wide_mul(share, value));
    }
    wide_store(out->least, least);
    wide_store(out->greatest, greatest);
    wide_store(out->mean, mean);
    wide_store(out->low, low);
    wide_store(out->high, high);
}

static void values_at(const struct weighing *weighing, const double *values, size_t stride, uint32_t count,
                      struct star_values *out)
{
    if (count == WIDE)
        values_some(weighing, values, stride, WIDE, out);
    else
        values_some(weighing, values, stride, count, out);
}

#if defined(KERNELS)
const struct kernels KERNELS = {prepare, query_edge, doubt, halfway, weigh, bound, values_at};
#else
const struct kernels kernels_plain = {prepare, query_edge, doubt, halfway, weigh, bound, values_at};

const struct kernels *kernels_choose(void)
{
#if defined(__x86_64__)
    if (__builtin_cpu_supports("avx2"))
        return &kernels_avx2;
#endif
    return &kernels_plain;
}
#endif
