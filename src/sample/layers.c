/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/sample/layers.h"

#include <stdbool.h>
#include <stdlib.h>

#include "format/fail.h"
#include "src/util/array.h"

static uint32_t lattice(const struct surface *s, const uint32_t p[3])
{
    return p[0] + (s->size + 1) * (p[1] + (s->size + 1) * p[2]);
}

static bool is_on(const struct surface *s, const uint32_t p[3], enum surface_sides sides)
{
    for (int d = 0; d < 3; d++)
        if (p[d] == s->size || (sides == SIDES_ALL && p[d] == 0))
            return true;
    return false;
}

static void collect_points(struct surface *s, enum surface_sides sides)
{
    uint32_t p[3];
    for (p[2] = 0; p[2] <= s->size; p[2]++)
        for (p[1] = 0; p[1] <= s->size; p[1]++)
            for (p[0] = 0; p[0] <= s->size; p[0]++) {
                uint32_t at = lattice(s, p);
                s->index[at] = TETLOD_NONE;
                if (!is_on(s, p, sides))
                    continue;
                for (int d = 0; d < 3; d++)
                    s->points[s->point_count][d] = p[d];
                s->index[at] = s->point_count++;
            }
}

/* The quads of the side where coordinate `axis` is `value`. */
static void collect_side(struct surface *s, int axis, uint32_t value)
{
    int right = (axis + 1) % 3, up = (axis + 2) % 3;
    for (uint32_t j = 0; j < s->size; j++)
        for (uint32_t i = 0; i < s->size; i++) {
            uint32_t *quad = s->quads[s->quad_count++];
            for (uint32_t c = 0; c < 4; c++) {
                uint32_t p[3];
                p[axis] = value;
                p[right] = i + (c == 1 || c == 2);
                p[up] = j + (c >= 2);
                quad[c] = s->index[lattice(s, p)];
            }
        }
}

enum tetlod_status surface_init(struct surface *s, uint32_t size, enum surface_sides sides, struct tetlod_error *error)
{
    size_t row = (size_t)size + 1, most = 6 * row * row;
    *s = (struct surface){.size = size};
    s->points = array_new(most, sizeof *s->points);
    s->quads = array_new(most, sizeof *s->quads);
    s->index = array_new(row * row * row, sizeof *s->index);
    if (!s->points || !s->quads || !s->index) {
        surface_fini(s);
        return tetlodi_fail_nomem(error, "the sample", most * 28 + row * row * row * 4);
    }
    collect_points(s, sides);
    for (int axis = 0; axis < 3; axis++) {
        collect_side(s, axis, size);
        if (sides == SIDES_ALL)
            collect_side(s, axis, 0);
    }
    return TETLOD_OK;
}

void surface_fini(struct surface *s)
{
    free(s->points);
    free(s->quads);
    free(s->index);
    *s = (struct surface){0};
}
