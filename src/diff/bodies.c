/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/diff/bodies.h"

#include <stdlib.h>

#include "src/util/array.h"

/* Bodies that share less than this of the smaller one touch; what is covered twice by more than this overlaps. */
static const double TOUCH = 0.1, TWICE = 1e-3;

void body_pairs_fini(struct body_pairs *pairs)
{
    free(pairs->pairs);
    *pairs = (struct body_pairs){0};
}

bool body_pairs_add(struct body_pairs *pairs, uint32_t a, uint32_t b, uint64_t volume)
{
    // neighbouring tetrahedra are of the same bodies: the pair is among the last ones but for a few
    for (size_t i = pairs->count; i-- > 0;)
        if (pairs->pairs[i].bodies[0] == a && pairs->pairs[i].bodies[1] == b) {
            pairs->pairs[i].volume += volume;
            return true;
        }
    if (!array_reserve((void **)&pairs->pairs, &pairs->capacity, pairs->count + 1, sizeof *pairs->pairs))
        return false;
    pairs->pairs[pairs->count++] = (struct body_pair){{a, b}, volume, false};
    return true;
}

static int compare(const void *x, const void *y)
{
    const struct body_pair *a = x, *b = y;
    for (int m = 0; m < 2; m++)
        if (a->bodies[m] != b->bodies[m])
            return a->bodies[m] < b->bodies[m] ? -1 : 1;
    return 0;
}

/* What two bodies share, of what they are together. */
static double likeness(const struct body_pair *pair, const uint64_t *const volumes[2])
{
    double both = (double)volumes[0][pair->bodies[0]] + (double)volumes[1][pair->bodies[1]];
    return (double)pair->volume / (both - (double)pair->volume);
}

/* Is the body of mesh m covered more than once? */
static bool is_covered_twice(const struct body_pairs *pairs, const struct body_pair *pair, int m,
                             const uint64_t *const volumes[2])
{
    double sum = 0;
    for (size_t i = 0; i < pairs->count; i++)
        sum += pairs->pairs[i].bodies[m] == pair->bodies[m] ? (double)pairs->pairs[i].volume : 0;
    return sum > (double)volumes[m][pair->bodies[m]] * (1 + TWICE);
}

/* Is no other pair of the body of mesh m more alike? The first of several. */
static bool is_best(const struct body_pairs *pairs, const struct body_pair *pair, int m,
                    const uint64_t *const volumes[2])
{
    double own = likeness(pair, volumes);
    for (const struct body_pair *other = pairs->pairs; other < pairs->pairs + pairs->count; other++)
        if (other->bodies[m] == pair->bodies[m] &&
            (likeness(other, volumes) > own || (other < pair && likeness(other, volumes) == own)))
            return false;
    return true;
}

void body_pairs_judge(struct body_pairs *pairs, const uint64_t *const volumes[2])
{
    if (pairs->count)
        qsort(pairs->pairs, pairs->count, sizeof *pairs->pairs, compare);
    for (struct body_pair *pair = pairs->pairs; pair < pairs->pairs + pairs->count; pair++) {
        uint64_t a = volumes[0][pair->bodies[0]], b = volumes[1][pair->bodies[1]];
        if (is_covered_twice(pairs, pair, 0, volumes) || is_covered_twice(pairs, pair, 1, volumes))
            pair->kept = is_best(pairs, pair, 0, volumes) || is_best(pairs, pair, 1, volumes);
        else
            pair->kept = (double)pair->volume > TOUCH * (double)(a < b ? a : b);
    }
}

bool body_pairs_kept(const struct body_pairs *pairs, uint32_t a, uint32_t b)
{
    const struct body_pair key = {{a, b}, 0, false};
    const struct body_pair *found = pairs->count ? bsearch(&key, pairs->pairs, pairs->count, sizeof key, compare)
                                                 : NULL;
    return found && found->kept;
}
