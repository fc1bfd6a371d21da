/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/simplify/exact/patch.h"

#include <float.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "format/fail.h"
#include "src/mesh/tet_geom.h"
#include "src/mesh/vector.h"
#include "src/util/array.h"

/* A star with more pairs of a vertex and a wall is refused: so many originals hardly ever fit a contraction. */
static const size_t MOST_SIDES = (size_t)1 << 19;

/* Distances from a plane through v', and heights over a link face, are this many units in the last place of the product of
 * the three lengths that they are made of wrong at most (PROOF.md, section 8). */
static const double PLANE_ROUNDING = 16 * DBL_EPSILON;

/* Points this far beyond a wall count, at least. */
static const double BEYOND = 1e-9;

/* A star in which all walls at a spoke are one plane but for this is left alone: nothing is exact across them. */
static const double LEAST_SINE = 1e-3;

/* ---- memory */

/* Of a set of numbers below that. */
static size_t set_words(size_t count)
{
    return (count + 63) / 64;
}

enum part { TETS, CORNERS, VERTICES, EDGES, LINK, WALLS, CONES, NORMALS, POSITIONS, OFFSETS, SIGNS, CONE_WALLS, CONE_SIGNS, SPOKE_WALLS,
            SPOKES, TABLE, PAIRS, ORIGINAL_SIDES, HOMES, PLACES, HELD };

/* Room for that many elements in an array of the patch; `array` points to its pointer. */
static bool room(struct patch *patch, enum part part, void *array, size_t needed, size_t size)
{
    void *elements;
    memcpy(&elements, array, sizeof elements);
    bool done = array_reserve(&elements, &patch->capacity[part], needed, size);
    memcpy(array, &elements, sizeof elements);
    return done;
}

static enum tetlod_status no_room(struct tetlod_error *error)
{
    return tetlodi_fail_nomem(error, "the originals under a star", 1 << 20);
}

enum tetlod_status patch_init(struct patch *patch, const struct complex *complex, struct tetlod_error *error)
{
    size_t set = set_words(complex->tet_count), vertices = complex->vertex_count;
    *patch = (struct patch){.listed = array_zero(set, sizeof(uint64_t)),
                            .covered = array_zero(set, sizeof(uint64_t)),
                            .numbers = array_new(vertices, sizeof(uint32_t)),
                            .slot_numbers = array_new(vertices, sizeof(uint32_t))};
    if (!patch->listed || !patch->covered || !patch->numbers || !patch->slot_numbers) {
        patch_fini(patch);
        return tetlodi_fail_nomem(error, "the originals under a star", set * 16 + vertices * 8);
    }
    memset(patch->numbers, 0xff, vertices * sizeof *patch->numbers);
    memset(patch->slot_numbers, 0xff, vertices * sizeof *patch->slot_numbers);
    return TETLOD_OK;
}

void patch_fini(struct patch *patch)
{
    void *owned[] = {patch->tets,         patch->corners,      patch->vertices,    patch->edges,       patch->link,
                     patch->walls,        patch->cones,        patch->normals,     patch->positions,   patch->offsets,
                     patch->signs,
                     patch->cone_walls,   patch->cone_signs,   patch->spoke_walls, patch->spokes,      patch->table,
                     patch->pairs,        patch->sides,       patch->homes,       patch->listed,      patch->covered,
                     patch->places,       patch->held,
                     patch->numbers,      patch->slot_numbers};
    for (size_t i = 0; i < sizeof owned / sizeof *owned; i++)
        free(owned[i]);
    *patch = (struct patch){0};
}

/* Of the largest stars there are while much of the mesh is left. */
static const uint64_t STAR_BYTES = 7 << 18;

uint64_t patch_bytes(uint32_t vertices, uint32_t tets)
{
    return vertices * (uint64_t)8 + tets / 4 + STAR_BYTES;
}

void patch_renumber(struct patch *patch, const struct renumbering *slots)
{
    patch->slot_numbers = array_shrink(patch->slot_numbers, slots->after, sizeof *patch->slot_numbers);
}

/* ---- gathering */

static inline bool set_has(const uint64_t *set, uint32_t number)
{
    return set[number / 64] >> number % 64 & 1;
}

static inline void set_add(uint64_t *set, uint32_t number)
{
    set[number / 64] |= (uint64_t)1 << number % 64;
}

/* The originals under the star's tetrahedra, each once; those under the ones that are removed first, for v' is likely there. */
static bool gather_tets(struct patch *patch, const struct overlaps *overlaps, const struct star *star)
{
    size_t most = 0;
    uint32_t count;
    for (uint32_t i = 0; i < star->tet_count; i++) {
        overlaps_of(overlaps, star->tets[i], &count);
        most += count;
    }
    patch->tet_count = 0;
    patch->steepest = 0;
    if (!room(patch, TETS, &patch->tets, most, sizeof *patch->tets))
        return false;
    for (int pass = 0; pass < 2; pass++)
        for (uint32_t i = 0; i < star->tet_count; i++) {
            const uint32_t *list = overlaps_of(overlaps, star->tets[i], &count);
            for (uint32_t k = 0; k < count && (star->moving[i] == STAR_REMOVED) == !pass; k++) {
                if (set_has(patch->listed, list[k]))
                    continue;
                set_add(patch->listed, list[k]);
                patch->tets[patch->tet_count++] = list[k];
            }
        }
    for (uint32_t t = 0; t < patch->tet_count; t++) {
        float slope = overlaps->slopes[patch->tets[t]];
        patch->listed[patch->tets[t] / 64] = 0;
        patch->steepest = slope > patch->steepest ? slope : patch->steepest;
    }
    return room(patch, CORNERS, &patch->corners, patch->tet_count, sizeof *patch->corners);
}

/* Numbers the originals' vertices, those that the star hosts first. */
static bool gather_vertices(struct patch *patch, const struct overlaps *overlaps, const struct star *star)
{
    static const uint32_t outside = (uint32_t)1 << 31; // a number among those that it does not host
    size_t most = 4 * (size_t)patch->tet_count;
    if (!room(patch, VERTICES, &patch->vertices, 2 * most, sizeof *patch->vertices))
        return false;
    uint32_t *corners = patch->corners[0], *others = patch->vertices + most, inside_count = 0, other_count = 0;
    for (uint32_t i = 0; i < star->tet_count; i++)
        set_add(patch->covered, star->tets[i]);
    for (size_t i = 0; i < most; i++) {
        uint32_t v = overlaps->mesh->corners[4 * (size_t)patch->tets[i / 4] + i % 4];
        uint32_t *number = &patch->numbers[v];
        if (*number == TETLOD_NONE) {
            uint32_t host = overlaps->host[v];
            bool inside = host != TETLOD_NONE && set_has(patch->covered, host);
            *number = inside ? inside_count : other_count | outside;
            if (inside)
                patch->vertices[inside_count++] = v;
            else
                others[other_count++] = v;
        }
        corners[i] = *number;
    }
    for (uint32_t i = 0; i < star->tet_count; i++)
        patch->covered[star->tets[i] / 64] = 0;
    for (size_t i = 0; i < most; i++)
        corners[i] = corners[i] & outside ? (corners[i] & ~outside) + inside_count : corners[i];
    memmove(patch->vertices + inside_count, others, other_count * sizeof *others);
    patch->inside_count = inside_count;
    patch->vertex_count = inside_count + other_count;
    if (!room(patch, POSITIONS, &patch->positions, patch->vertex_count, sizeof *patch->positions))
        return false;
    for (uint32_t v = 0; v < patch->vertex_count; v++) {
        patch->numbers[patch->vertices[v]] = TETLOD_NONE;
        memcpy(patch->positions[v], overlaps->mesh->positions + 3 * (size_t)patch->vertices[v], sizeof *patch->positions);
    }
    return true;
}

static uint32_t link_number(struct patch *patch, uint32_t slot)
{
    if (patch->slot_numbers[slot] == TETLOD_NONE) {
        patch->slot_numbers[slot] = patch->link_count;
        patch->link[patch->link_count++] = slot;
    }
    return patch->slot_numbers[slot];
}

/* A cone for every re-attached tetrahedron. */
static bool gather_cones(struct patch *patch, const struct complex *complex, const struct star *star)
{
    uint32_t most = star->tet_count - star->removed_count;
    patch->link_count = patch->cone_count = 0;
    if (!room(patch, CONES, &patch->cones, most, sizeof *patch->cones) ||
        !room(patch, LINK, &patch->link, 3 * (size_t)most, sizeof *patch->link))
        return false;
    for (uint32_t i = 0; i < star->tet_count; i++) {
        if (star->moving[i] == STAR_REMOVED)
            continue;
        struct cone *cone = &patch->cones[patch->cone_count++];
        cone->tet = star->tets[i];
        cone->outer = complex_boundary_face(complex, cone->tet, star->moving[i]);
        for (int k = 0; k < 3; k++)
            cone->link[k] =
                link_number(patch, complex->corners[4 * (size_t)cone->tet + tet_faces[star->moving[i]][k]]);
    }
    for (uint32_t l = 0; l < patch->link_count; l++)
        patch->slot_numbers[patch->link[l]] = TETLOD_NONE;
    return true;
}

/* A wall for every edge of the link. */
static bool gather_walls(struct patch *patch)
{
    size_t links = patch->link_count, before = patch->capacity[PAIRS];
    patch->wall_count = 0;
    if (!room(patch, PAIRS, &patch->pairs, links * links, sizeof *patch->pairs) ||
        !room(patch, WALLS, &patch->walls, 3 * (size_t)patch->cone_count, sizeof *patch->walls))
        return false;
    memset(patch->pairs + before, 0, (patch->capacity[PAIRS] - before) * sizeof *patch->pairs);
    for (uint32_t f = 0; f < patch->cone_count; f++)
        for (int k = 0; k < 3; k++) {
            uint32_t a = patch->cones[f].link[(k + 1) % 3], b = patch->cones[f].link[(k + 2) % 3];
            uint32_t *pair = &patch->pairs[a < b ? a * links + b : b * links + a];
            if (!*pair) {
                patch->walls[patch->wall_count] = (struct wall){.link = {a, b}, .cones = {f, f}, .outer = true};
                *pair = ++patch->wall_count;
            } else {
                patch->walls[*pair - 1].cones[1] = f;
                patch->walls[*pair - 1].outer = false;
            }
            patch->cones[f].walls[k] = *pair - 1;
        }
    for (uint32_t w = 0; w < patch->wall_count; w++) {
        uint32_t a = patch->walls[w].link[0], b = patch->walls[w].link[1];
        patch->pairs[a < b ? a * links + b : b * links + a] = 0;
    }
    return true;
}

enum tetlod_status patch_begin(struct patch *patch, const struct complex *complex, const struct star *star,
                                 struct tetlod_error *error)
{
    patch->edge_count = patch->vertex_count = patch->tet_count = 0;
    patch->gathered = false;
    return gather_cones(patch, complex, star) && gather_walls(patch) ? TETLOD_OK : no_room(error);
}

enum tetlod_status patch_edges(struct patch *patch, struct tetlod_error *error)
{
    size_t most = 6 * (size_t)patch->tet_count, size = 64;
    if (patch->edge_count)
        return TETLOD_OK;
    while (size < most)
        size *= 2;
    if (!room(patch, TABLE, &patch->table, size, sizeof *patch->table) ||
        !room(patch, EDGES, &patch->edges, most, sizeof *patch->edges))
        return no_room(error);
    memset(patch->table, 0, size * sizeof *patch->table);
    for (uint32_t t = 0; t < patch->tet_count; t++)
        for (int e = 0; e < 6; e++) {
            uint32_t a = patch->corners[t][tet_edges[e][0]], b = patch->corners[t][tet_edges[e][1]];
            uint32_t least = a < b ? a : b, greatest = a < b ? b : a;
            size_t at = (least * (size_t)2654435761u + greatest * (size_t)40503u) & (size - 1);
            for (; patch->table[at]; at = (at + 1) & (size - 1)) {
                const uint32_t *edge = patch->edges[patch->table[at] - 1];
                if (edge[0] == least && edge[1] == greatest)
                    break;
            }
            if (patch->table[at])
                continue;
            patch->table[at] = patch->edge_count + 1;
            patch->edges[patch->edge_count][0] = least;
            patch->edges[patch->edge_count++][1] = greatest;
        }
    return TETLOD_OK;
}

/* ---- looking */

static const double *link_position(const struct patch *patch, const struct complex *complex, uint32_t link)
{
    return complex->positions + 3 * (size_t)patch->link[link];
}

/* Widens the reach to a distance, and with it what rounding may come to. */
static void reach_out(struct patch *patch, double reach)
{
    double ratio = reach / patch->reach;
    if (!(ratio > 1))
        return;
    patch->reach = reach;
    patch->condition *= ratio;
    for (uint32_t w = 0; w < patch->wall_count; w++) {
        patch->tolerances[w] *= ratio;
        patch->thresholds[w] *= ratio;
    }
    for (uint32_t f = 0; f < patch->cone_count; f++)
        patch->cones[f].tolerance *= ratio;
}

/* The walls' planes. */
static void set_walls(struct patch *patch, const struct complex *complex)
{
    for (uint32_t w = 0; w < patch->wall_count; w++) {
        const struct wall *wall = &patch->walls[w];
        double a[3], b[3], n[3];
        subtract(link_position(patch, complex, wall->link[0]), patch->apex, a);
        subtract(link_position(patch, complex, wall->link[1]), patch->apex, b);
        cross(a, b, n);
        patch->walls[w].length = sqrt(dot(n, n));
        patch->tolerances[w] = PLANE_ROUNDING * sqrt(dot(a, a) * dot(b, b)) * patch->reach;
        patch->thresholds[w] = wall->outer ? -patch->tolerances[w] : 0;
        for (int i = 0; i < 3; i++)
            patch->normals[(size_t)i * patch->stride + w] = n[i];
    }
    for (uint32_t w = patch->wall_count; w < patch->stride; w++) { // idle ones have nothing on any side
        patch->tolerances[w] = -1;
        patch->thresholds[w] = INFINITY;
        for (size_t i = 0; i < 3; i++)
            patch->normals[i * patch->stride + w] = 0;
    }
}

/* The weights in a cone; a wall on the boundary is turned so that the star is on its positive side. False if the cone has no
 * volume. */
static bool set_cone(struct patch *patch, const struct complex *complex, uint32_t f)
{
    struct cone *cone = &patch->cones[f];
    const double *p[3];
    double a[3], b[3];
    for (int k = 0; k < 3; k++)
        p[k] = link_position(patch, complex, cone->link[k]);
    subtract(p[1], p[0], a);
    subtract(p[2], p[0], b);
    cross(a, b, cone->normal);
    cone->tolerance = PLANE_ROUNDING * sqrt(dot(a, a) * dot(b, b)) * 2 * patch->reach;
    double height = cone_height(cone, patch, complex, patch->apex), size2 = tet_size_squared(patch->apex, p[0], p[1], p[2]);
    if (height < 0) {
        height = -height;
        for (int i = 0; i < 3; i++)
            cone->normal[i] = -cone->normal[i];
    }
    if (!(height > 0))
        return false;
    cone->apex = 1 / height;
    patch->condition = larger(patch->condition, size2 * patch->reach / height);
    memset(patch->cone_walls + (size_t)f * patch->words, 0, patch->words * sizeof(uint64_t));
    memset(patch->cone_signs + (size_t)f * patch->words, 0, patch->words * sizeof(uint64_t));
    for (int k = 0; k < 3; k++) {
        uint32_t w = cone->walls[k];
        double *n = patch->normals + w, r[3];
        size_t stride = patch->stride;
        subtract(p[k], patch->apex, r);
        double distance = n[0] * r[0] + n[stride] * r[1] + n[2 * stride] * r[2];
        if (distance == 0)
            return false;
        if (distance < 0 && patch->walls[w].outer) {
            distance = -distance;
            for (int i = 0; i < 3; i++)
                n[(size_t)i * stride] = -n[(size_t)i * stride];
        }
        cone->scale[k] = 1 / distance;
        patch->cone_walls[(size_t)f * patch->words + w / 64] |= (uint64_t)1 << w % 64;
        patch->cone_signs[(size_t)f * patch->words + w / 64] |= (uint64_t)(distance > 0) << w % 64;
    }
    return true;
}

/* Of the walls that meet in a spoke the two neighbours that are least alike. False if all are almost one plane. */
static bool set_spokes(struct patch *patch, const struct complex *complex)
{
    memset(patch->spoke_walls, 0, (size_t)patch->link_count * patch->words * sizeof(uint64_t));
    for (uint32_t w = 0; w < patch->wall_count; w++)
        for (int i = 0; i < 2 && !patch->walls[w].outer; i++)
            patch->spoke_walls[(size_t)patch->walls[w].link[i] * patch->words + w / 64] |= (uint64_t)1 << w % 64;
    for (uint32_t l = 0; l < patch->link_count; l++)
        patch->spokes[l].sine = 0;
    for (uint32_t f = 0; f < patch->cone_count; f++)
        for (int k = 0; k < 3; k++) {
            const struct cone *cone = &patch->cones[f];
            struct spoke *spoke = &patch->spokes[cone->link[k]];
            uint32_t u = cone->walls[(k + 1) % 3], v = cone->walls[(k + 2) % 3];
            double length = sqrt(distance_squared(patch->apex, link_position(patch, complex, cone->link[k])));
            double sine = fabs(length / cone->scale[k]) / (patch->walls[u].length * patch->walls[v].length);
            if (sine > spoke->sine)
                *spoke = (struct spoke){f, {u, v}, sine};
        }
    for (uint32_t l = 0; l < patch->link_count; l++)
        if (!(patch->spokes[l].sine > LEAST_SINE))
            return false;
    return true;
}

enum tetlod_status patch_set_apex(struct patch *patch, const struct complex *complex, const double p[3], bool *out_sound,
                              struct tetlod_error *error)
{
    size_t cones = patch->cone_count, stride = patch->stride = (patch->wall_count + PATCH_LANES - 1) / PATCH_LANES * PATCH_LANES;
    size_t words = patch->words = (patch->wall_count + 63) / 64;
    double reach2 = 0;
    memcpy(patch->apex, p, sizeof patch->apex);
    *out_sound = true;
    if (!room(patch, NORMALS, &patch->normals, 5 * stride, sizeof *patch->normals) ||
        !room(patch, SIGNS, &patch->signs, SIDES * words, sizeof *patch->signs) ||
        !room(patch, CONE_WALLS, &patch->cone_walls, words * cones, sizeof *patch->cone_walls) ||
        !room(patch, CONE_SIGNS, &patch->cone_signs, words * cones, sizeof *patch->cone_signs) ||
        !room(patch, SPOKE_WALLS, &patch->spoke_walls, words * patch->link_count, sizeof *patch->spoke_walls) ||
        !room(patch, SPOKES, &patch->spokes, patch->link_count, sizeof *patch->spokes))
        return no_room(error);
    patch->tolerances = patch->normals + 3 * stride;
    patch->thresholds = patch->tolerances + stride;
    for (uint32_t l = 0; l < patch->link_count; l++)
        reach2 = larger(reach2, distance_squared(patch->apex, link_position(patch, complex, l)));
    patch->reach = sqrt(reach2);
    patch->condition = 0;
    set_walls(patch, complex);
    for (uint32_t f = 0; f < cones && *out_sound; f++)
        *out_sound = set_cone(patch, complex, f);
    *out_sound = *out_sound && set_spokes(patch, complex);
    return TETLOD_OK;
}

enum tetlod_status patch_gather(struct patch *patch, const struct overlaps *overlaps, const struct star *star,
                                bool *out_few, struct tetlod_error *error)
{
    double reach2 = 0;
    if (!patch->gathered && (!gather_tets(patch, overlaps, star) || !gather_vertices(patch, overlaps, star)))
        return no_room(error);
    patch->gathered = true;
    *out_few = (size_t)patch->stride * patch->vertex_count <= MOST_SIDES;
    if (*out_few && (!room(patch, OFFSETS, &patch->offsets, patch->vertex_count, sizeof *patch->offsets) ||
                     !room(patch, SIGNS, &patch->signs, SIDES * (size_t)patch->words * patch->vertex_count,
                           sizeof *patch->signs) ||
                     !room(patch, HOMES, &patch->homes, patch->vertex_count, sizeof *patch->homes)))
        return no_room(error);
    for (uint32_t v = 0; v < patch->vertex_count; v++)
        reach2 = larger(reach2, distance_squared(patch->apex, patch->positions[v]));
    reach_out(patch, sqrt(reach2));
    patch->beyond = BEYOND + PLANE_ROUNDING * patch->condition;
    patch->condition = larger(patch->condition, patch->steepest * patch->reach); // the originals' own planes and weights are rounded, too
    return TETLOD_OK;
}

/* As many walls at a time; a comparison gives all bits of a lane. */
typedef double lanes __attribute__((vector_size(PATCH_LANES * sizeof(double))));
typedef uint64_t lane_bits __attribute__((vector_size(PATCH_LANES * sizeof(uint64_t))));

#define LOAD(array) (*(const struct unaligned *)(const void *)(array)).lanes

struct unaligned {
    lanes lanes;
} __attribute__((packed, aligned(8), may_alias));

/* Distances of a place from as many walls. */
static inline lanes distances(const struct patch *patch, size_t wall, const double r[3])
{
    const double *n = patch->normals + wall;
    const lanes x = {r[0], r[0]}, y = {r[1], r[1]}, z = {r[2], r[2]};
    return LOAD(n) * x + LOAD(n + patch->stride) * y + LOAD(n + 2 * (size_t)patch->stride) * z;
}

/* On which sides of up to 64 walls a place is. */
static inline void make_word(const struct patch *patch, const double r[3], size_t first, size_t last, uint64_t *signs)
{
    const lane_bits absolute = {INT64_MAX, INT64_MAX}; // all but the sign
    lane_bits positives = {0}, nears = {0}, bit = {1, 2};
    for (size_t w = first; w < last; w += PATCH_LANES, bit <<= PATCH_LANES) {
        lanes distance = distances(patch, w, r), tolerance = LOAD(patch->tolerances + w);
        positives |= (lane_bits)(distance >= LOAD(patch->thresholds + w)) & bit;
        nears |= (lane_bits)((lanes)((lane_bits)distance & absolute) <= tolerance) & bit;
    }
    uint64_t positive = positives[0] | positives[1], near = nears[0] | nears[1],
             all = ~(uint64_t)0 >> (64 - (last - first));
    signs[POSITIVE * patch->words] = positive;
    signs[MAYBE_NOT_POSITIVE * patch->words] = (~positive & all) | near;
    signs[MAYBE_NOT_NEGATIVE * patch->words] = positive | near;
}

static void make_signs(const struct patch *patch, const double r[3], uint64_t *signs)
{
    for (uint32_t word = 0; word < patch->words; word++) {
        size_t first = (size_t)64 * word, last = first + 64 < patch->stride ? first + 64 : patch->stride;
        make_word(patch, r, first, last, signs + word);
    }
}

/* The cone whose signs a vertex has. Most stars have no more walls than a word has bits. */
static uint32_t find_cone(const struct patch *patch, const uint64_t *signs)
{
    const uint64_t *one_walls = patch->cone_walls, *one_inside = patch->cone_signs;
    for (uint32_t f = 0; f < patch->cone_count && patch->words == 1; f++)
        if ((signs[0] & one_walls[f]) == one_inside[f])
            return f;
    for (uint32_t f = 0; f < patch->cone_count && patch->words > 1; f++) {
        const uint64_t *walls = patch->cone_walls + (size_t)f * patch->words,
                       *inside = patch->cone_signs + (size_t)f * patch->words;
        uint64_t differ = 0;
        for (uint32_t word = 0; word < patch->words; word++)
            differ |= (signs[word] & walls[word]) ^ inside[word];
        if (!differ)
            return f;
    }
    return TETLOD_NONE;
}

void patch_place(struct patch *patch, uint32_t vertex)
{
    uint64_t *signs = patch->signs + (size_t)vertex * SIDES * patch->words;
    subtract(patch->positions[vertex], patch->apex, patch->offsets[vertex]);
    make_signs(patch, patch->offsets[vertex], signs);
    patch->homes[vertex] = find_cone(patch, signs + POSITIVE * patch->words);
}

/* The sides that a place counts to alone, in the room of vertex 0, whose turn comes later. */
static void make_positives(const struct patch *patch, const double r[3])
{
    for (uint32_t word = 0; word < patch->words; word++) {
        lane_bits positives = {0}, bit = {1, 2};
        size_t first = (size_t)64 * word, last = first + 64 < patch->stride ? first + 64 : patch->stride;
        for (size_t w = first; w < last; w += PATCH_LANES, bit <<= PATCH_LANES)
            positives |= (lane_bits)(distances(patch, w, r) >= LOAD(patch->thresholds + w)) & bit;
        patch->signs[word] = positives[0] | positives[1];
    }
}

uint32_t patch_cone_at(struct patch *patch, const struct complex *complex, const double p[3], double weights[3],
                       double *apex_weight)
{
    double r[3];
    subtract(p, patch->apex, r);
    make_positives(patch, r);
    uint32_t f = find_cone(patch, patch->signs);
    if (f == TETLOD_NONE)
        return f;
    const struct cone *cone = &patch->cones[f];
    *apex_weight = cone->apex * cone_height(cone, patch, complex, p);
    for (int k = 0; k < 3; k++)
        weights[k] = cone->scale[k] * patch_distance(patch, cone->walls[k], r);
    return f;
}

uint32_t patch_cone_of(const struct patch *patch, uint32_t vertex)
{
    uint32_t best = patch->homes[vertex];
    if (best != TETLOD_NONE)
        return best;
    // rounding may leave a sliver between cones: the cone that it is least outside of
    double most = -patch->beyond;
    for (uint32_t f = 0; f < patch->cone_count; f++) {
        const struct cone *cone = &patch->cones[f];
        double least = INFINITY;
        for (int k = 0; k < 3; k++)
            least = smaller(least, cone->scale[k] * patch_distance(patch, cone->walls[k], patch->offsets[vertex]));
        if (least > most) {
            most = least;
            best = f;
        }
    }
    return best;
}

/* ---- handing on */

/* On which sides of the walls an original may be with all its corners: two sets, the walls on whose negative side, and on whose positive. */
static void find_sides(struct patch *patch, const uint32_t corners[4])
{
    size_t words = patch->words;
    for (size_t word = 0; word < words; word++) {
        patch->sides[word] = patch->sides[words + word] = ~(uint64_t)0;
        for (int c = 0; c < 4; c++) {
            patch->sides[word] &= patch_side(patch, corners[c], MAYBE_NOT_POSITIVE)[word];
            patch->sides[words + word] &= patch_side(patch, corners[c], MAYBE_NOT_NEGATIVE)[word];
        }
    }
}

/* Is an original, whose sides those are, on the other side of one of the cone's walls? */
static inline bool outside_walls(const struct patch *patch, size_t words, uint32_t f)
{
    const uint64_t *sides = patch->sides, *masks = patch->masks + 2 * f * words;
    uint64_t outside = 0;
    for (size_t word = 0; word < words; word++)
        outside |= (masks[word] & sides[word]) | (masks[words + word] & sides[words + word]);
    return outside;
}

static bool on_boundary(const struct patch *patch, const struct cone *cone)
{
    return cone->outer || patch->walls[cone->walls[0]].outer || patch->walls[cone->walls[1]].outer ||
           patch->walls[cone->walls[2]].outer;
}

/* Is the original behind the cone's link face? */
static bool behind(const struct patch *patch, const struct complex *complex, size_t tet, const struct cone *cone)
{
    for (int c = 0; c < 4; c++)
        if (cone->outer || cone_height(cone, patch, complex, patch->positions[patch->corners[tet][c]]) > cone->tolerance)
            return false;
    return true;
}

/* Finds which vertices are inside the cones whose signs they have, not beyond their link faces. False: no memory. */
static bool find_held(struct patch *patch, const struct complex *complex)
{
    if (!room(patch, HELD, &patch->held, patch->vertex_count, sizeof *patch->held))
        return false;
    for (uint32_t v = 0; v < patch->vertex_count; v++) {
        uint32_t f = patch->homes[v];
        bool inside = f != TETLOD_NONE && cone_height(&patch->cones[f], patch, complex, patch->positions[v]) > patch->cones[f].tolerance;
        patch->held[v] = inside ? f : TETLOD_NONE;
    }
    return true;
}

/* Is a corner of the original inside the cone? */
static inline bool holds_corner(const struct patch *patch, const uint32_t corners[4], uint32_t f)
{
    const uint32_t *held = patch->held;
    return held[corners[0]] == f || held[corners[1]] == f || held[corners[2]] == f || held[corners[3]] == f;
}

/* The planes of an original's faces, but those that have the apex on the original's side: no cone is beyond these. */
struct planes {
    uint32_t count;
    struct plane {
        double origin[3], normal[3]; /* inwards */
        double tolerance;            /* of normal . (p - origin) */
    } planes[4];
};

static bool above(const struct plane *plane, const double p[3])
{
    double r[3];
    subtract(p, plane->origin, r);
    return dot(plane->normal, r) > plane->tolerance;
}

static void find_planes(const struct patch *patch, const uint32_t corners[4], struct planes *out)
{
    out->count = 0;
    for (int f = 0; f < 4; f++) {
        struct plane *plane = &out->planes[out->count];
        const double *p[3];
        double a[3], b[3], r[3];
        for (int k = 0; k < 3; k++)
            p[k] = patch->positions[corners[tet_faces[f][k]]];
        subtract(p[1], p[0], a);
        subtract(p[2], p[0], b);
        cross(a, b, plane->normal);
        subtract(patch->positions[corners[f]], p[0], r);
        bool turned = !(dot(plane->normal, r) > 0);
        for (int i = 0; i < 3; i++) {
            plane->origin[i] = p[0][i];
            plane->normal[i] = turned ? -plane->normal[i] : plane->normal[i];
        }
        plane->tolerance = PLANE_ROUNDING * sqrt(dot(a, a) * dot(b, b)) * 2 * patch->reach;
        out->count += !above(plane, patch->apex);
    }
}

/* Is the cone on the other side of one of the planes? */
static bool apart(const struct patch *patch, const struct complex *complex, const struct planes *planes, const struct cone *cone)
{
    for (uint32_t i = 0; i < planes->count; i++) {
        bool beyond = true;
        for (int k = 0; k < 3 && beyond; k++)
            beyond = !above(&planes->planes[i], link_position(patch, complex, cone->link[k]));
        if (beyond)
            return true;
    }
    return false;
}

/* Finds the cones that an original may overlap, and adds the pairs. False: no memory. */
static bool pair_original(struct patch *patch, const struct complex *complex, uint32_t tet)
{
    struct planes planes;
    bool found = false;
    size_t words = patch->words;
    const uint32_t *corners = patch->corners[tet];
    if (!room(patch, PLACES, &patch->places, patch->place_count + patch->cone_count, sizeof *patch->places))
        return false;
    find_sides(patch, corners);
    for (uint32_t f = 0; f < patch->cone_count; f++) {
        if (words == 1   ? outside_walls(patch, 1, f)
            : words == 2 ? outside_walls(patch, 2, f)
                         : outside_walls(patch, words, f))
            continue;
        if (!holds_corner(patch, corners, f)) {
            if (behind(patch, complex, tet, &patch->cones[f]))
                continue;
            if (!found)
                find_planes(patch, corners, &planes);
            found = true;
            if (!on_boundary(patch, &patch->cones[f]) && apart(patch, complex, &planes, &patch->cones[f]))
                continue;
        }
        patch->places[patch->place_count++] = (struct place){f, patch->tets[tet]};
        patch->cones[f].originals++;
    }
    return true;
}

/* Of each cone the walls that it is on the positive side of, and those that it is on the negative side of. Walls on the boundary do not
 * count, nor does a link face there: a cone is taken to reach beyond them, so that nothing is lost where the boundary has moved. */
static bool make_masks(struct patch *patch)
{
    size_t words = patch->words;
    if (!room(patch, ORIGINAL_SIDES, &patch->sides, 2 * words * (1 + (size_t)patch->cone_count), sizeof *patch->sides))
        return false;
    patch->masks = patch->sides + 2 * words;
    memset(patch->masks, 0, 2 * words * patch->cone_count * sizeof *patch->masks);
    for (uint32_t f = 0; f < patch->cone_count; f++)
        for (int k = 0; k < 3; k++) {
            uint32_t w = patch->cones[f].walls[k];
            bool positive = patch->cone_signs[f * words + w / 64] >> w % 64 & 1;
            if (!patch->walls[w].outer)
                patch->masks[(2 * f + !positive) * words + w / 64] |= (uint64_t)1 << w % 64;
        }
    return true;
}

static bool pair_originals(struct patch *patch, const struct complex *complex)
{
    if (!make_masks(patch) || !find_held(patch, complex))
        return false;
    patch->place_count = 0;
    for (uint32_t f = 0; f < patch->cone_count; f++)
        patch->cones[f].originals = 0;
    for (uint32_t t = 0; t < patch->tet_count; t++)
        if (!pair_original(patch, complex, t))
            return false;
    return true;
}

static bool handover_room(struct handover *handover, size_t needed)
{
    void *grown = handover->numbers;
    bool done = array_reserve(&grown, &handover->capacity, handover->count + needed, sizeof *handover->numbers);
    handover->numbers = grown;
    return done;
}

/* The originals that may overlap a cone become its list. False: no memory. */
static bool hand_on_lists(struct patch *patch, const struct complex *complex, struct handover *handover)
{
    if (!pair_originals(patch, complex) || !handover_room(handover, 2 * (size_t)patch->cone_count + patch->place_count))
        return false;
    for (uint32_t f = 0; f < patch->cone_count; f++) {
        uint32_t *list = handover->numbers + handover->count, count = patch->cones[f].originals;
        list[0] = patch->cones[f].tet;
        list[1] = count;
        patch->cones[f].originals = (uint32_t)handover->count + 2; // where the next one goes
        handover->count += 2 + (size_t)count;
    }
    for (size_t i = 0; i < patch->place_count; i++)
        handover->numbers[patch->cones[patch->places[i].cone].originals++] = patch->places[i].original;
    return true;
}

enum tetlod_status patch_hand_on(struct patch *patch, const struct complex *complex, struct handover *out, struct tetlod_error *error)
{
    out->count = 0;
    if (!hand_on_lists(patch, complex, out))
        return no_room(error);
    out->list_count = out->count;
    if (!handover_room(out, 2 * (size_t)patch->vertex_count))
        return no_room(error);
    for (uint32_t v = 0; v < patch->vertex_count; v++) {
        uint32_t f = patch_cone_of(patch, v), host = f == TETLOD_NONE ? f : patch->cones[f].tet;
        if (v >= patch->inside_count &&
            (f == TETLOD_NONE || !(cone_height(&patch->cones[f], patch, complex, patch->positions[v]) > 0)))
            continue;
        out->numbers[out->count++] = patch->vertices[v];
        out->numbers[out->count++] = host;
    }
    return TETLOD_OK;
}
