/* SPDX-License-Identifier: BSD-3-Clause */
/* What can be asked of the star of a simplex before it is contracted. */
#include <stdlib.h>
#include <string.h>

#include "format/fail.h"
#include "src/simplify/complex.h"
#include "src/mesh/tet_geom.h"
#include "src/util/array.h"

void star_fini(struct star *star)
{
    free(star->tets);
    free(star->moving);
    free(star->local_tets);
    free(star->marks);
    table_fini(&star->filed);
    *star = (struct star){0};
}

static bool reserve(struct star *star, size_t count)
{
    if (count <= star->capacity)
        return true;
    size_t capacity = count + count / 2 + 64;
    void *tets = array_resize(star->tets, capacity, sizeof *star->tets);
    star->tets = tets ? tets : star->tets;
    void *moving = array_resize(star->moving, capacity, 1);
    star->moving = moving ? moving : star->moving;
    if (!tets || !moving)
        return false;
    star->capacity = capacity;
    return true;
}

/* Bit c is set where corner c is the vertex; and the number of the one bit that is set. */
static inline unsigned corners_at(const uint32_t corners[4], uint32_t vertex)
{
    return (unsigned)(corners[0] == vertex) | (unsigned)(corners[1] == vertex) << 1 |
           (unsigned)(corners[2] == vertex) << 2 | (unsigned)(corners[3] == vertex) << 3;
}

static const uint8_t corner_number[16] = {0, 0, 1, 0, 2, 0, 0, 0, 3, 0, 0, 0, 0, 0, 0, 0};

/* The simplex, and room for so many tetrahedra. */
static enum tetlod_status begin(struct star *star, const struct complex *complex, const uint32_t *simplex,
                                uint32_t simplex_count, size_t most, struct tetlod_error *error)
{
    const double *first = complex->positions + 3 * (size_t)simplex[0];
    star->at_one_point = true;
    for (uint32_t s = 0; s < simplex_count; s++) {
        star->simplex[s] = simplex[s];
        star->at_one_point &= distance_squared(first, complex->positions + 3 * (size_t)simplex[s]) == 0;
    }
    star->simplex_count = simplex_count;
    star->tet_count = star->removed_count = 0;
    return reserve(star, most) ? TETLOD_OK : tetlodi_fail_nomem(error, "a star", most * 5);
}

enum tetlod_status star_gather_some(struct star *star, const struct complex *complex, const uint32_t *simplex,
                                    uint32_t simplex_count, const uint32_t *tets, uint32_t tet_count,
                                    struct tetlod_error *error)
{
    TETLOD_TRY(begin(star, complex, simplex, simplex_count, tet_count, error));
    for (uint32_t i = 0; i < tet_count; i++) {
        const uint32_t *corners = complex->corners + 4 * (size_t)tets[i];
        unsigned inside = 0, count = 0;
        for (uint32_t s = 0; s < simplex_count && corners[0] != TETLOD_NONE; s++) {
            unsigned at = corners_at(corners, simplex[s]);
            inside |= at;
            count += at != 0;
        }
        if (!count)
            continue;
        star->tets[star->tet_count] = tets[i];
        star->moving[star->tet_count++] = count > 1 ? STAR_REMOVED : corner_number[inside];
        star->removed_count += count > 1;
    }
    return TETLOD_OK;
}

enum tetlod_status star_gather(struct star *star, const struct complex *complex, const uint32_t *simplex,
                               uint32_t simplex_count, struct tetlod_error *error)
{
    size_t most = 0;
    for (uint32_t s = 0; s < simplex_count; s++)
        most += complex->star_count[simplex[s]];
    TETLOD_TRY(begin(star, complex, simplex, simplex_count, most, error));
    for (uint32_t s = 0; s < simplex_count; s++) {
        const uint32_t *tets = complex->pool + complex->star_begin[simplex[s]], count = complex->star_count[simplex[s]];
        for (uint32_t i = 0; i < count; i++) {
            __builtin_prefetch(complex->corners + 4 * (size_t)tets[i + 6 < count ? i + 6 : i]);
            const uint32_t *corners = complex->corners + 4 * (size_t)tets[i];
            unsigned own = corners_at(corners, simplex[s]), others = 0, earlier = 0;
            for (uint32_t r = 0; r < simplex_count; r++) {
                unsigned at = r == s ? 0 : corners_at(corners, simplex[r]);
                others |= at;
                earlier |= r < s ? at : 0;
            }
            if (earlier) // it came with an earlier vertex of the simplex
                continue;
            star->tets[star->tet_count] = tets[i];
            star->moving[star->tet_count++] = others ? STAR_REMOVED : corner_number[own];
            star->removed_count += others != 0;
        }
    }
    return TETLOD_OK;
}

static inline void cross(const double a[3], const double b[3], double scale, double out[3])
{
    out[0] = (a[1] * b[2] - a[2] * b[1]) * scale;
    out[1] = (a[2] * b[0] - a[0] * b[2]) * scale;
    out[2] = (a[0] * b[1] - a[1] * b[0]) * scale;
}

void complex_affine(const struct complex *complex, uint32_t tet, struct tet_affine *out)
{
    const uint32_t *corners = complex->corners + 4 * (size_t)tet;
    const double *p[4];
    double e[3][3];
    for (int c = 0; c < 4; c++)
        p[c] = complex->positions + 3 * (size_t)corners[c];
    for (int c = 0; c < 3; c++) {
        out->origin[c] = p[0][c];
        for (int d = 0; d < 3; d++)
            e[c][d] = p[c + 1][d] - p[0][d];
    }
    cross(e[1], e[2], 1, out->gradient[0]);
    double volume6 = e[0][0] * out->gradient[0][0] + e[0][1] * out->gradient[0][1] + e[0][2] * out->gradient[0][2];
    double inverse = 1 / volume6;
    for (int d = 0; d < 3; d++)
        out->gradient[0][d] *= inverse;
    cross(e[2], e[0], inverse, out->gradient[1]);
    cross(e[0], e[1], inverse, out->gradient[2]);
    out->volume6 = volume6 * complex->orientation;
    out->size2 = tet_size_squared(p[0], p[1], p[2], p[3]);
}

bool star_fits(const struct star *star, const struct complex *complex, const double p[3])
{
    for (uint32_t i = 0; i < star->tet_count; i++) {
        if (star->moving[i] == STAR_REMOVED || star->at_one_point)
            continue;
        const double *q[4];
        for (int c = 0; c < 4; c++)
            q[c] = complex->positions + 3 * (size_t)complex->corners[4 * (size_t)star->tets[i] + c];
        q[star->moving[i]] = p;
        if (tet_orientation(q[0], q[1], q[2], q[3]) != complex->orientation)
            return false;
    }
    return true;
}

/* ---- the link condition, on a copy of the star with the boundary coned to one more vertex */

struct local_complex {
    uint32_t count, vertex_count;
    uint32_t (*tets)[4];
};

static uint32_t local_number(struct complex *complex, uint32_t vertex, uint32_t *count)
{
    if (complex->epoch_of[vertex] != complex->epoch) {
        complex->epoch_of[vertex] = complex->epoch;
        complex->local[vertex] = (*count)++;
    }
    return complex->local[vertex];
}

/* The simplex's vertices are 0 .. simplex_count-1, the cone's apex is simplex_count, the others follow. */
static enum tetlod_status copy_star(struct local_complex *copy, struct star *star, struct complex *complex,
                                    struct tetlod_error *error)
{
    void *grown = star->local_tets;
    if (!array_reserve(&grown, &star->local_tet_capacity, 5 * (size_t)star->tet_count, 4 * sizeof(uint32_t)))
        return tetlodi_fail_nomem(error, "a link", 5 * (uint64_t)star->tet_count * 16);
    star->local_tets = grown;
    copy->tets = grown;
    copy->count = copy->vertex_count = 0;
    if (++complex->epoch == 0) { // it wraps
        memset(complex->epoch_of, 0, complex->slot_count * sizeof *complex->epoch_of);
        complex->epoch = 1;
    }
    for (uint32_t s = 0; s < star->simplex_count; s++)
        local_number(complex, star->simplex[s], &copy->vertex_count);
    uint32_t apex = copy->vertex_count++;
    for (uint32_t i = 0; i < star->tet_count; i++) {
        uint32_t tet[4];
        for (unsigned c = 0; c < 4; c++)
            tet[c] = local_number(complex, complex->corners[4 * (size_t)star->tets[i] + c], &copy->vertex_count);
        memcpy(copy->tets[copy->count++], tet, sizeof tet);
        for (unsigned f = 0; f < 4; f++)
            if (complex_boundary_face(complex, star->tets[i], f)) {
                uint32_t cone[4] = {tet[0], tet[1], tet[2], tet[3]};
                cone[f] = apex;
                memcpy(copy->tets[copy->count++], cone, sizeof cone);
            }
    }
    return TETLOD_OK;
}

enum { IN_A = 1, IN_B = 2, IN_AB = 4 };

static unsigned corner_mask(const uint32_t tet[4], uint32_t a, uint32_t b)
{
    unsigned mask = 0;
    for (int c = 0; c < 4; c++)
        mask |= tet[c] == a ? IN_A : tet[c] == b ? IN_B : 0;
    return mask;
}

/* Is the vertex in both links? */
static bool on_ring(const uint8_t *marks, uint32_t v)
{
    return (marks[v] & (IN_A | IN_B)) == (IN_A | IN_B);
}

/* Numbers of a copy's vertices are below 2^21; a triangle's key has the highest bit set. */
static const uint32_t MOST_OF_COPY = UINT32_C(1) << 21;

static uint64_t pair_key(uint32_t x, uint32_t y)
{
    return x < y ? (uint64_t)x << 32 | y : (uint64_t)y << 32 | x;
}

static uint32_t smallest(uint32_t x, uint32_t y)
{
    return x < y ? x : y;
}

static uint64_t triangle_key(const uint32_t v[3])
{
    uint64_t least = smallest(v[0], smallest(v[1], v[2])), sum = (uint64_t)v[0] + v[1] + v[2];
    uint64_t greatest = (uint32_t)~smallest(~v[0], smallest(~v[1], ~v[2]));
    return (uint64_t)1 << 63 | least << 42 | (sum - least - greatest) << 21 | greatest;
}

/* Marks the vertices of both links, and files the edges of Lk(ab) with the value 1. False: a common vertex is outside Lk(ab). */
static bool file_ring(struct table *filed, uint8_t *marks, const struct local_complex *copy, uint32_t a, uint32_t b)
{
    memset(marks, 0, copy->vertex_count);
    for (uint32_t i = 0; i < copy->count; i++) {
        unsigned mask = corner_mask(copy->tets[i], a, b);
        uint32_t ends[2] = {0, 0}, count = 0;
        for (int c = 0; c < 4 && mask; c++) {
            marks[copy->tets[i][c]] |= (uint8_t)(mask == (IN_A | IN_B) ? IN_A | IN_B | IN_AB : mask);
            if (copy->tets[i][c] != a && copy->tets[i][c] != b)
                ends[count++ & 1] = copy->tets[i][c];
        }
        if (mask == (IN_A | IN_B))
            *table_at(filed, pair_key(ends[0], ends[1]), 1) = 1;
    }
    marks[a] = marks[b] = 0;
    for (uint32_t v = 0; v < copy->vertex_count; v++)
        if (on_ring(marks, v) && !(marks[v] & IN_AB))
            return false;
    return true;
}

/* What a tetrahedron of a or of b has between vertices of the ring: of a it is filed; of b, false if a has it and Lk(ab) does not. */
static bool compare_links(struct table *filed, const uint8_t *marks, const uint32_t tet[4], unsigned mask)
{
    uint32_t v[4], count = 0;
    for (int c = 0; c < 4; c++)
        if (on_ring(marks, tet[c]))
            v[count++] = tet[c];
    for (uint32_t i = 0; i < count; i++)
        for (uint32_t k = i + 1; k < count; k++) {
            uint64_t key = pair_key(v[i], v[k]);
            const uint32_t *found = mask == IN_A ? table_at(filed, key, 0) : table_find(filed, key);
            if (mask == IN_B && found && !*found)
                return false;
        }
    if (count == 3 && mask == IN_A)
        table_at(filed, triangle_key(v), 0);
    return !(count == 3 && mask == IN_B && table_find(filed, triangle_key(v)));
}

/* Lk(a) and Lk(b) meet in Lk(ab) only. The table is empty and has room for all. */
static bool edge_links_meet_well(const struct local_complex *copy, uint32_t a, uint32_t b, uint8_t *marks, struct table *filed)
{
    if (!file_ring(filed, marks, copy, a, b))
        return false;
    for (unsigned mask = IN_A; mask <= IN_B; mask++)
        for (uint32_t i = 0; i < copy->count; i++)
            if (corner_mask(copy->tets[i], a, b) == mask && !compare_links(filed, marks, copy->tets[i], mask))
                return false;
    return true;
}

/* Contracts b into a in the copy. */
static void copy_contract(struct local_complex *copy, uint32_t a, uint32_t b)
{
    uint32_t kept = 0;
    for (uint32_t i = 0; i < copy->count; i++) {
        if (corner_mask(copy->tets[i], a, b) == (IN_A | IN_B))
            continue;
        for (int c = 0; c < 4; c++)
            copy->tets[kept][c] = copy->tets[i][c] == b ? a : copy->tets[i][c];
        kept++;
    }
    copy->count = kept;
}

enum tetlod_status star_link_condition(struct star *star, struct complex *complex, bool *out_holds,
                                       struct tetlod_error *error)
{
    struct local_complex copy = {0};
    *out_holds = false;
    TETLOD_TRY(copy_star(&copy, star, complex, error));
    void *grown = star->marks;
    if (!array_reserve(&grown, &star->mark_capacity, copy.vertex_count, 1))
        return tetlodi_fail_nomem(error, "a link", copy.vertex_count);
    star->marks = grown;
    *out_holds = copy.vertex_count < MOST_OF_COPY;
    for (uint32_t s = 1; s < star->simplex_count && *out_holds; s++) {
        if (!table_clear(&star->filed, 4 * (size_t)copy.count))
            return tetlodi_fail_nomem(error, "a link", copy.count * (uint64_t)72);
        *out_holds = edge_links_meet_well(&copy, 0, s, star->marks, &star->filed);
        copy_contract(&copy, 0, s);
    }
    return TETLOD_OK;
}
