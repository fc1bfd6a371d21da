/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/simplify/exact/cover.h"

#include <float.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "format/fail.h"
#include "src/mesh/tet_geom.h"
#include "src/mesh/vector.h"
#include "src/util/array.h"

/* A star with more pairs of a vertex and a wall is refused: so many originals hardly ever fit a contraction. */
static const size_t MAX_SIDES = (size_t)1 << 19;

/* Distances from a plane through v', and heights over a link face, are this many units in the last place of the product
 * of the three lengths that they are made of wrong at most (PROOF.md, section 8). */
static const double PLANE_ROUNDING = 16 * DBL_EPSILON;

/* Points this far beyond a wall count, at least. */
static const double BEYOND = 1e-9;

/* A star in which all walls at a spoke are one plane but for this is left alone: nothing is exact across them. */
static const double MIN_SINE = 1e-3;

/* ---- memory */

/* Of a set of numbers below that. */
static size_t set_words(size_t count)
{
    return (count + 63) / 64;
}

enum part { TETS, CORNERS, VERTICES, EDGES, LINK, WALLS, CONES, NORMALS, POSITIONS, OFFSETS, SIGNS, CONE_WALLS,
           CONE_SIGNS, SPOKE_WALLS,
            SPOKES, TABLE, PAIRS, ORIGINAL_SIDES, HOMES, PLACES, HELD };

/* Room for that many elements in an array of the cover; `array` points to its pointer. */
static bool room(struct cover *cover, enum part part, void *array, size_t needed, size_t size)
{
    return array_reserve(array, &cover->capacity[part], needed, size);
}

static enum tetlod_status no_room(struct tetlod_error *error)
{
    return tetlodi_fail_nomem(error, "the originals under a star", 1 << 20);
}

enum tetlod_status cover_init(struct cover *cover, const struct working *working, struct tetlod_error *error)
{
    size_t set = set_words(working->tet_count), vertices = working->slot_count;
    *cover = (struct cover){.listed = array_zero(set, sizeof(uint64_t)),
                            .covered = array_zero(set, sizeof(uint64_t)),
                            .numbers = array_new(vertices, sizeof(uint32_t)),
                            .slot_numbers = array_new(vertices, sizeof(uint32_t))};
    if (!cover->listed || !cover->covered || !cover->numbers || !cover->slot_numbers) {
        cover_fini(cover);
        return tetlodi_fail_nomem(error, "the originals under a star", set * 16 + vertices * 8);
    }
    memset(cover->numbers, 0xff, vertices * sizeof *cover->numbers);
    memset(cover->slot_numbers, 0xff, vertices * sizeof *cover->slot_numbers);
    return TETLOD_OK;
}

void cover_fini(struct cover *cover)
{
    void *owned[] = {cover->tets,         cover->corners,      cover->vertices,    cover->edges,       cover->link,
                     cover->walls,        cover->cones,        cover->normals,     cover->positions,   cover->offsets,
                     cover->signs,
                     cover->cone_walls,   cover->cone_signs,   cover->spoke_walls, cover->spokes,      cover->table,
                     cover->pairs,        cover->sides,       cover->homes,       cover->listed,      cover->covered,
                     cover->places,       cover->held,
                     cover->numbers,      cover->slot_numbers};
    for (size_t i = 0; i < sizeof owned / sizeof *owned; i++)
        free(owned[i]);
    *cover = (struct cover){0};
}

/* Of the largest stars there are while much of the mesh is left. */
static const uint64_t STAR_BYTES = 7 << 18;

uint64_t cover_bytes(uint32_t vertices, uint32_t tets)
{
    return vertices * (uint64_t)8 + tets / 4 + STAR_BYTES;
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

/* The originals under the star's tetrahedra, each once; those under the ones that are removed first, for v' is likely
 * there. */
static bool gather_tets(struct cover *cover, const struct overlaps *overlaps, const struct star *star)
{
    size_t most = 0;
    uint32_t count;
    for (uint32_t i = 0; i < star->tet_count; i++) {
        overlaps_of(overlaps, star->tets[i], &count);
        most += count;
    }
    cover->tet_count = 0;
    cover->steepest = 0;
    if (!room(cover, TETS, &cover->tets, most, sizeof *cover->tets))
        return false;
    for (int pass = 0; pass < 2; pass++)
        for (uint32_t i = 0; i < star->tet_count; i++) {
            const uint32_t *list = overlaps_of(overlaps, star->tets[i], &count);
            for (uint32_t k = 0; k < count && (star->moving[i] == STAR_REMOVED) == !pass; k++) {
                if (set_has(cover->listed, list[k]))
                    continue;
                set_add(cover->listed, list[k]);
                cover->tets[cover->tet_count++] = list[k];
            }
        }
    for (uint32_t t = 0; t < cover->tet_count; t++) {
        float slope = overlaps->slopes[cover->tets[t]];
        cover->listed[cover->tets[t] / 64] = 0;
        cover->steepest = slope > cover->steepest ? slope : cover->steepest;
    }
    return room(cover, CORNERS, &cover->corners, cover->tet_count, sizeof *cover->corners);
}

/* Numbers the originals' vertices, those that the star hosts first. */
static bool gather_vertices(struct cover *cover, const struct overlaps *overlaps, const struct star *star)
{
    static const uint32_t outside = (uint32_t)1 << 31; // a number among those that it does not host
    size_t most = 4 * (size_t)cover->tet_count;
    if (!room(cover, VERTICES, &cover->vertices, 2 * most, sizeof *cover->vertices))
        return false;
    uint32_t *corners = cover->corners[0], *others = cover->vertices + most, inside_count = 0, other_count = 0;
    for (uint32_t i = 0; i < star->tet_count; i++)
        set_add(cover->covered, star->tets[i]);
    for (size_t i = 0; i < most; i++) {
        uint32_t v = overlaps->mesh->corners[4 * (size_t)cover->tets[i / 4] + i % 4];
        uint32_t *number = &cover->numbers[v];
        if (*number == TETLOD_NONE) {
            uint32_t host = overlaps->host[v];
            bool inside = host != TETLOD_NONE && set_has(cover->covered, host);
            *number = inside ? inside_count : other_count | outside;
            if (inside)
                cover->vertices[inside_count++] = v;
            else
                others[other_count++] = v;
        }
        corners[i] = *number;
    }
    for (uint32_t i = 0; i < star->tet_count; i++)
        cover->covered[star->tets[i] / 64] = 0;
    for (size_t i = 0; i < most; i++)
        corners[i] = corners[i] & outside ? (corners[i] & ~outside) + inside_count : corners[i];
    memmove(cover->vertices + inside_count, others, other_count * sizeof *others);
    cover->inside_count = inside_count;
    cover->vertex_count = inside_count + other_count;
    if (!room(cover, POSITIONS, &cover->positions, cover->vertex_count, sizeof *cover->positions))
        return false;
    for (uint32_t v = 0; v < cover->vertex_count; v++) {
        cover->numbers[cover->vertices[v]] = TETLOD_NONE;
        memcpy(cover->positions[v], overlaps->mesh->positions + 3 * (size_t)cover->vertices[v],
               sizeof *cover->positions);
    }
    return true;
}

static uint32_t link_number(struct cover *cover, uint32_t slot)
{
    if (cover->slot_numbers[slot] == TETLOD_NONE) {
        cover->slot_numbers[slot] = cover->link_count;
        cover->link[cover->link_count++] = slot;
    }
    return cover->slot_numbers[slot];
}

/* A cone for every re-attached tetrahedron. */
static bool gather_cones(struct cover *cover, const struct working *working, const struct star *star)
{
    uint32_t most = star->tet_count - star->removed_count;
    cover->link_count = cover->cone_count = 0;
    if (!room(cover, CONES, &cover->cones, most, sizeof *cover->cones) ||
        !room(cover, LINK, &cover->link, 3 * (size_t)most, sizeof *cover->link))
        return false;
    for (uint32_t i = 0; i < star->tet_count; i++) {
        if (star->moving[i] == STAR_REMOVED)
            continue;
        struct cone *cone = &cover->cones[cover->cone_count++];
        cone->tet = star->tets[i];
        cone->outer = working->boundary_faces[cone->tet] >> star->moving[i] & 1;
        for (int k = 0; k < 3; k++)
            cone->link[k] =
                link_number(cover, working->corners[cone->tet][tet_faces[star->moving[i]][k]]);
    }
    for (uint32_t l = 0; l < cover->link_count; l++)
        cover->slot_numbers[cover->link[l]] = TETLOD_NONE;
    return true;
}

/* A wall for every edge of the link. */
static bool gather_walls(struct cover *cover)
{
    size_t links = cover->link_count, before = cover->capacity[PAIRS];
    cover->wall_count = 0;
    if (!room(cover, PAIRS, &cover->pairs, links * links, sizeof *cover->pairs) ||
        !room(cover, WALLS, &cover->walls, 3 * (size_t)cover->cone_count, sizeof *cover->walls))
        return false;
    memset(cover->pairs + before, 0, (cover->capacity[PAIRS] - before) * sizeof *cover->pairs);
    for (uint32_t f = 0; f < cover->cone_count; f++)
        for (int k = 0; k < 3; k++) {
            uint32_t a = cover->cones[f].link[(k + 1) % 3], b = cover->cones[f].link[(k + 2) % 3];
            uint32_t *pair = &cover->pairs[a < b ? a * links + b : b * links + a];
            if (!*pair) {
                cover->walls[cover->wall_count] = (struct wall){.link = {a, b}, .cones = {f, f}, .outer = true};
                *pair = ++cover->wall_count;
            } else {
                cover->walls[*pair - 1].cones[1] = f;
                cover->walls[*pair - 1].outer = false;
            }
            cover->cones[f].walls[k] = *pair - 1;
        }
    for (uint32_t w = 0; w < cover->wall_count; w++) {
        uint32_t a = cover->walls[w].link[0], b = cover->walls[w].link[1];
        cover->pairs[a < b ? a * links + b : b * links + a] = 0;
    }
    return true;
}

enum tetlod_status cover_begin(struct cover *cover, const struct working *working, const struct star *star,
                                 struct tetlod_error *error)
{
    cover->edge_count = cover->vertex_count = cover->tet_count = 0;
    cover->gathered = false;
    return gather_cones(cover, working, star) && gather_walls(cover) ? TETLOD_OK : no_room(error);
}

enum tetlod_status cover_edges(struct cover *cover, struct tetlod_error *error)
{
    size_t most = 6 * (size_t)cover->tet_count, size = 64;
    if (cover->edge_count)
        return TETLOD_OK;
    while (size < most)
        size *= 2;
    if (!room(cover, TABLE, &cover->table, size, sizeof *cover->table) ||
        !room(cover, EDGES, &cover->edges, most, sizeof *cover->edges))
        return no_room(error);
    memset(cover->table, 0, size * sizeof *cover->table);
    for (uint32_t t = 0; t < cover->tet_count; t++)
        for (int e = 0; e < 6; e++) {
            uint32_t a = cover->corners[t][tet_edges[e][0]], b = cover->corners[t][tet_edges[e][1]];
            uint32_t least = a < b ? a : b, greatest = a < b ? b : a;
            size_t at = (least * (size_t)2654435761u + greatest * (size_t)40503u) & (size - 1);
            for (; cover->table[at]; at = (at + 1) & (size - 1)) {
                const uint32_t *edge = cover->edges[cover->table[at] - 1];
                if (edge[0] == least && edge[1] == greatest)
                    break;
            }
            if (cover->table[at])
                continue;
            cover->table[at] = cover->edge_count + 1;
            cover->edges[cover->edge_count][0] = least;
            cover->edges[cover->edge_count++][1] = greatest;
        }
    return TETLOD_OK;
}

/* ---- looking */

static const double *link_position(const struct cover *cover, const struct working *working, uint32_t link)
{
    return working_row(working, cover->link[link]);
}

/* Widens the reach to a distance, and with it what rounding may come to. */
static void reach_out(struct cover *cover, double reach)
{
    double ratio = reach / cover->reach;
    if (!(ratio > 1))
        return;
    cover->reach = reach;
    cover->condition *= ratio;
    for (uint32_t w = 0; w < cover->wall_count; w++) {
        cover->tolerances[w] *= ratio;
        cover->thresholds[w] *= ratio;
    }
    for (uint32_t f = 0; f < cover->cone_count; f++)
        cover->cones[f].tolerance *= ratio;
}

/* The walls' planes. */
static void set_walls(struct cover *cover, const struct working *working)
{
    for (uint32_t w = 0; w < cover->wall_count; w++) {
        const struct wall *wall = &cover->walls[w];
        double a[3], b[3], n[3];
        subtract(link_position(cover, working, wall->link[0]), cover->apex, a);
        subtract(link_position(cover, working, wall->link[1]), cover->apex, b);
        cross(a, b, n);
        cover->walls[w].length = sqrt(dot(n, n));
        cover->tolerances[w] = PLANE_ROUNDING * sqrt(dot(a, a) * dot(b, b)) * cover->reach;
        cover->thresholds[w] = wall->outer ? -cover->tolerances[w] : 0;
        for (int i = 0; i < 3; i++)
            cover->normals[(size_t)i * cover->stride + w] = n[i];
    }
    for (uint32_t w = cover->wall_count; w < cover->stride; w++) { // idle ones have nothing on any side
        cover->tolerances[w] = -1;
        cover->thresholds[w] = INFINITY;
        for (size_t i = 0; i < 3; i++)
            cover->normals[i * cover->stride + w] = 0;
    }
}

/* The weights in a cone; a wall on the boundary is turned so that the star is on its positive side. False if the cone
 * has no volume. */
static bool set_cone(struct cover *cover, const struct working *working, uint32_t f)
{
    struct cone *cone = &cover->cones[f];
    const double *p[3];
    double a[3], b[3];
    for (int k = 0; k < 3; k++)
        p[k] = link_position(cover, working, cone->link[k]);
    subtract(p[1], p[0], a);
    subtract(p[2], p[0], b);
    cross(a, b, cone->normal);
    cone->tolerance = PLANE_ROUNDING * sqrt(dot(a, a) * dot(b, b)) * 2 * cover->reach;
    double height = cone_height(cone, cover, working, cover->apex),
           size2 = tet_size_squared(cover->apex, p[0], p[1], p[2]);
    if (height < 0) {
        height = -height;
        for (int i = 0; i < 3; i++)
            cone->normal[i] = -cone->normal[i];
    }
    if (!(height > 0))
        return false;
    cone->apex = 1 / height;
    cover->condition = larger(cover->condition, size2 * cover->reach / height);
    memset(cover->cone_walls + (size_t)f * cover->words, 0, cover->words * sizeof(uint64_t));
    memset(cover->cone_signs + (size_t)f * cover->words, 0, cover->words * sizeof(uint64_t));
    for (int k = 0; k < 3; k++) {
        uint32_t w = cone->walls[k];
        double *n = cover->normals + w, r[3];
        size_t stride = cover->stride;
        subtract(p[k], cover->apex, r);
        double distance = n[0] * r[0] + n[stride] * r[1] + n[2 * stride] * r[2];
        if (distance == 0)
            return false;
        if (distance < 0 && cover->walls[w].outer) {
            distance = -distance;
            for (int i = 0; i < 3; i++)
                n[(size_t)i * stride] = -n[(size_t)i * stride];
        }
        cone->scale[k] = 1 / distance;
        cover->cone_walls[(size_t)f * cover->words + w / 64] |= (uint64_t)1 << w % 64;
        cover->cone_signs[(size_t)f * cover->words + w / 64] |= (uint64_t)(distance > 0) << w % 64;
    }
    return true;
}

/* Of the walls that meet in a spoke the two neighbours that are least alike. False if all are almost one plane. */
static bool set_spokes(struct cover *cover, const struct working *working)
{
    memset(cover->spoke_walls, 0, (size_t)cover->link_count * cover->words * sizeof(uint64_t));
    for (uint32_t w = 0; w < cover->wall_count; w++)
        for (int i = 0; i < 2 && !cover->walls[w].outer; i++)
            cover->spoke_walls[(size_t)cover->walls[w].link[i] * cover->words + w / 64] |= (uint64_t)1 << w % 64;
    for (uint32_t l = 0; l < cover->link_count; l++)
        cover->spokes[l].sine = 0;
    for (uint32_t f = 0; f < cover->cone_count; f++)
        for (int k = 0; k < 3; k++) {
            const struct cone *cone = &cover->cones[f];
            struct spoke *spoke = &cover->spokes[cone->link[k]];
            uint32_t u = cone->walls[(k + 1) % 3], v = cone->walls[(k + 2) % 3];
            double length = sqrt(distance_squared(cover->apex, link_position(cover, working, cone->link[k])));
            double sine = fabs(length / cone->scale[k]) / (cover->walls[u].length * cover->walls[v].length);
            if (sine > spoke->sine)
                *spoke = (struct spoke){f, {u, v}, sine};
        }
    for (uint32_t l = 0; l < cover->link_count; l++)
        if (!(cover->spokes[l].sine > MIN_SINE))
            return false;
    return true;
}

enum tetlod_status cover_set_apex(struct cover *cover, const struct working *working, const double p[3],
                                  bool *out_sound,
                              struct tetlod_error *error)
{
    size_t cones = cover->cone_count, stride = cover->stride = (cover->wall_count + COVER_LANES -
                                                                1) / COVER_LANES * COVER_LANES;
    size_t words = cover->words = (cover->wall_count + 63) / 64;
    double reach2 = 0;
    memcpy(cover->apex, p, sizeof cover->apex);
    *out_sound = true;
    if (!room(cover, NORMALS, &cover->normals, 5 * stride, sizeof *cover->normals) ||
        !room(cover, SIGNS, &cover->signs, SIDES * words, sizeof *cover->signs) ||
        !room(cover, CONE_WALLS, &cover->cone_walls, words * cones, sizeof *cover->cone_walls) ||
        !room(cover, CONE_SIGNS, &cover->cone_signs, words * cones, sizeof *cover->cone_signs) ||
        !room(cover, SPOKE_WALLS, &cover->spoke_walls, words * cover->link_count, sizeof *cover->spoke_walls) ||
        !room(cover, SPOKES, &cover->spokes, cover->link_count, sizeof *cover->spokes))
        return no_room(error);
    cover->tolerances = cover->normals + 3 * stride;
    cover->thresholds = cover->tolerances + stride;
    for (uint32_t l = 0; l < cover->link_count; l++)
        reach2 = larger(reach2, distance_squared(cover->apex, link_position(cover, working, l)));
    cover->reach = sqrt(reach2);
    cover->condition = 0;
    set_walls(cover, working);
    for (uint32_t f = 0; f < cones && *out_sound; f++)
        *out_sound = set_cone(cover, working, f);
    *out_sound = *out_sound && set_spokes(cover, working);
    return TETLOD_OK;
}

enum tetlod_status cover_gather(struct cover *cover, const struct overlaps *overlaps, const struct star *star,
                                bool *out_few, struct tetlod_error *error)
{
    double reach2 = 0;
    if (!cover->gathered && (!gather_tets(cover, overlaps, star) || !gather_vertices(cover, overlaps, star)))
        return no_room(error);
    cover->gathered = true;
    *out_few = (size_t)cover->stride * cover->vertex_count <= MAX_SIDES;
    if (*out_few && (!room(cover, OFFSETS, &cover->offsets, cover->vertex_count, sizeof *cover->offsets) ||
                     !room(cover, SIGNS, &cover->signs, SIDES * (size_t)cover->words * cover->vertex_count,
                           sizeof *cover->signs) ||
                     !room(cover, HOMES, &cover->homes, cover->vertex_count, sizeof *cover->homes)))
        return no_room(error);
    for (uint32_t v = 0; v < cover->vertex_count; v++)
        reach2 = larger(reach2, distance_squared(cover->apex, cover->positions[v]));
    reach_out(cover, sqrt(reach2));
    cover->beyond = BEYOND + PLANE_ROUNDING * cover->condition;
    // the originals' own planes and weights are rounded, too
    cover->condition = larger(cover->condition, cover->steepest * cover->reach);
    return TETLOD_OK;
}

/* As many walls at a time; a comparison gives all bits of a lane. */
typedef double lanes __attribute__((vector_size(COVER_LANES * sizeof(double))));
typedef uint64_t lane_bits __attribute__((vector_size(COVER_LANES * sizeof(uint64_t))));

#define LOAD(array) (*(const struct unaligned *)(const void *)(array)).lanes

struct unaligned {
    lanes lanes;
} __attribute__((packed, aligned(8), may_alias));

/* Distances of a place from as many walls. */
static inline lanes distances(const struct cover *cover, size_t wall, const double r[3])
{
    const double *n = cover->normals + wall;
    const lanes x = {r[0], r[0]}, y = {r[1], r[1]}, z = {r[2], r[2]};
    return LOAD(n) * x + LOAD(n + cover->stride) * y + LOAD(n + 2 * (size_t)cover->stride) * z;
}

/* On which sides of up to 64 walls a place is. */
static inline void make_word(const struct cover *cover, const double r[3], size_t first, size_t last, uint64_t *signs)
{
    const lane_bits absolute = {INT64_MAX, INT64_MAX}; // all but the sign
    lane_bits positives = {0}, nears = {0}, bit = {1, 2};
    for (size_t w = first; w < last; w += COVER_LANES, bit <<= COVER_LANES) {
        lanes distance = distances(cover, w, r), tolerance = LOAD(cover->tolerances + w);
        positives |= (lane_bits)(distance >= LOAD(cover->thresholds + w)) & bit;
        nears |= (lane_bits)((lanes)((lane_bits)distance & absolute) <= tolerance) & bit;
    }
    uint64_t positive = positives[0] | positives[1], near = nears[0] | nears[1],
             all = ~(uint64_t)0 >> (64 - (last - first));
    signs[POSITIVE * cover->words] = positive;
    signs[MAYBE_NOT_POSITIVE * cover->words] = (~positive & all) | near;
    signs[MAYBE_NOT_NEGATIVE * cover->words] = positive | near;
}

static void make_signs(const struct cover *cover, const double r[3], uint64_t *signs)
{
    for (uint32_t word = 0; word < cover->words; word++) {
        size_t first = (size_t)64 * word, last = first + 64 < cover->stride ? first + 64 : cover->stride;
        make_word(cover, r, first, last, signs + word);
    }
}

/* The cone whose signs a vertex has. Most stars have no more walls than a word has bits. */
static uint32_t find_cone(const struct cover *cover, const uint64_t *signs)
{
    const uint64_t *one_walls = cover->cone_walls, *one_inside = cover->cone_signs;
    for (uint32_t f = 0; f < cover->cone_count && cover->words == 1; f++)
        if ((signs[0] & one_walls[f]) == one_inside[f])
            return f;
    for (uint32_t f = 0; f < cover->cone_count && cover->words > 1; f++) {
        const uint64_t *walls = cover->cone_walls + (size_t)f * cover->words,
                       *inside = cover->cone_signs + (size_t)f * cover->words;
        uint64_t differ = 0;
        for (uint32_t word = 0; word < cover->words; word++)
            differ |= (signs[word] & walls[word]) ^ inside[word];
        if (!differ)
            return f;
    }
    return TETLOD_NONE;
}

void cover_place(struct cover *cover, uint32_t vertex)
{
    uint64_t *signs = cover->signs + (size_t)vertex * SIDES * cover->words;
    subtract(cover->positions[vertex], cover->apex, cover->offsets[vertex]);
    make_signs(cover, cover->offsets[vertex], signs);
    cover->homes[vertex] = find_cone(cover, signs + POSITIVE * cover->words);
}

/* The sides that a place counts to alone, in the room of vertex 0, whose turn comes later. */
static void make_positives(const struct cover *cover, const double r[3])
{
    for (uint32_t word = 0; word < cover->words; word++) {
        lane_bits positives = {0}, bit = {1, 2};
        size_t first = (size_t)64 * word, last = first + 64 < cover->stride ? first + 64 : cover->stride;
        for (size_t w = first; w < last; w += COVER_LANES, bit <<= COVER_LANES)
            positives |= (lane_bits)(distances(cover, w, r) >= LOAD(cover->thresholds + w)) & bit;
        cover->signs[word] = positives[0] | positives[1];
    }
}

uint32_t cover_cone_at(struct cover *cover, const struct working *working, const double p[3], double weights[3],
                       double *apex_weight)
{
    double r[3];
    subtract(p, cover->apex, r);
    make_positives(cover, r);
    uint32_t f = find_cone(cover, cover->signs);
    if (f == TETLOD_NONE)
        return f;
    const struct cone *cone = &cover->cones[f];
    *apex_weight = cone->apex * cone_height(cone, cover, working, p);
    for (int k = 0; k < 3; k++)
        weights[k] = cone->scale[k] * cover_distance(cover, cone->walls[k], r);
    return f;
}

uint32_t cover_cone_of(const struct cover *cover, uint32_t vertex)
{
    uint32_t best = cover->homes[vertex];
    if (best != TETLOD_NONE)
        return best;
    // rounding may leave a sliver between cones: the cone that it is least outside of
    double most = -cover->beyond;
    for (uint32_t f = 0; f < cover->cone_count; f++) {
        const struct cone *cone = &cover->cones[f];
        double least = INFINITY;
        for (int k = 0; k < 3; k++)
            least = smaller(least, cone->scale[k] * cover_distance(cover, cone->walls[k], cover->offsets[vertex]));
        if (least > most) {
            most = least;
            best = f;
        }
    }
    return best;
}

/* ---- passing on */

/* On which sides of the walls an original may be with all its corners: two sets, the walls on whose negative side, and
 * on whose positive. */
static void find_sides(struct cover *cover, const uint32_t corners[4])
{
    size_t words = cover->words;
    for (size_t word = 0; word < words; word++) {
        cover->sides[word] = cover->sides[words + word] = ~(uint64_t)0;
        for (int c = 0; c < 4; c++) {
            cover->sides[word] &= cover_side(cover, corners[c], MAYBE_NOT_POSITIVE)[word];
            cover->sides[words + word] &= cover_side(cover, corners[c], MAYBE_NOT_NEGATIVE)[word];
        }
    }
}

/* Is an original, whose sides those are, on the other side of one of the cone's walls? */
static inline bool outside_walls(const struct cover *cover, size_t words, uint32_t f)
{
    const uint64_t *sides = cover->sides, *masks = cover->masks + 2 * f * words;
    uint64_t outside = 0;
    for (size_t word = 0; word < words; word++)
        outside |= (masks[word] & sides[word]) | (masks[words + word] & sides[words + word]);
    return outside;
}

static bool on_boundary(const struct cover *cover, const struct cone *cone)
{
    return cone->outer || cover->walls[cone->walls[0]].outer || cover->walls[cone->walls[1]].outer ||
           cover->walls[cone->walls[2]].outer;
}

/* Is the original behind the cone's link face? */
static bool behind(const struct cover *cover, const struct working *working, size_t tet, const struct cone *cone)
{
    for (int c = 0; c < 4; c++)
        if (cone->outer || cone_height(cone, cover, working,
                                       cover->positions[cover->corners[tet][c]]) > cone->tolerance)
            return false;
    return true;
}

/* Finds which vertices are inside the cones whose signs they have, not beyond their link faces. False: no memory. */
static bool find_held(struct cover *cover, const struct working *working)
{
    if (!room(cover, HELD, &cover->held, cover->vertex_count, sizeof *cover->held))
        return false;
    for (uint32_t v = 0; v < cover->vertex_count; v++) {
        uint32_t f = cover->homes[v];
        bool inside = f != TETLOD_NONE && cone_height(&cover->cones[f], cover, working,
                                                      cover->positions[v]) > cover->cones[f].tolerance;
        cover->held[v] = inside ? f : TETLOD_NONE;
    }
    return true;
}

/* Is a corner of the original inside the cone? */
static inline bool holds_corner(const struct cover *cover, const uint32_t corners[4], uint32_t f)
{
    const uint32_t *held = cover->held;
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

static void find_planes(const struct cover *cover, const uint32_t corners[4], struct planes *out)
{
    out->count = 0;
    for (int f = 0; f < 4; f++) {
        struct plane *plane = &out->planes[out->count];
        const double *p[3];
        double a[3], b[3], r[3];
        for (int k = 0; k < 3; k++)
            p[k] = cover->positions[corners[tet_faces[f][k]]];
        subtract(p[1], p[0], a);
        subtract(p[2], p[0], b);
        cross(a, b, plane->normal);
        subtract(cover->positions[corners[f]], p[0], r);
        bool turned = !(dot(plane->normal, r) > 0);
        for (int i = 0; i < 3; i++) {
            plane->origin[i] = p[0][i];
            plane->normal[i] = turned ? -plane->normal[i] : plane->normal[i];
        }
        plane->tolerance = PLANE_ROUNDING * sqrt(dot(a, a) * dot(b, b)) * 2 * cover->reach;
        out->count += !above(plane, cover->apex);
    }
}

/* Is the cone on the other side of one of the planes? */
static bool apart(const struct cover *cover, const struct working *working, const struct planes *planes,
                  const struct cone *cone)
{
    for (uint32_t i = 0; i < planes->count; i++) {
        bool beyond = true;
        for (int k = 0; k < 3 && beyond; k++)
            beyond = !above(&planes->planes[i], link_position(cover, working, cone->link[k]));
        if (beyond)
            return true;
    }
    return false;
}

/* Finds the cones that an original may overlap, and adds the pairs. False: no memory. */
static bool pair_original(struct cover *cover, const struct working *working, uint32_t tet)
{
    struct planes planes;
    bool found = false;
    size_t words = cover->words;
    const uint32_t *corners = cover->corners[tet];
    if (!room(cover, PLACES, &cover->places, cover->place_count + cover->cone_count, sizeof *cover->places))
        return false;
    find_sides(cover, corners);
    for (uint32_t f = 0; f < cover->cone_count; f++) {
        if (words == 1   ? outside_walls(cover, 1, f)
            : words == 2 ? outside_walls(cover, 2, f)
                         : outside_walls(cover, words, f))
            continue;
        if (!holds_corner(cover, corners, f)) {
            if (behind(cover, working, tet, &cover->cones[f]))
                continue;
            if (!found)
                find_planes(cover, corners, &planes);
            found = true;
            if (!on_boundary(cover, &cover->cones[f]) && apart(cover, working, &planes, &cover->cones[f]))
                continue;
        }
        cover->places[cover->place_count++] = (struct place){f, cover->tets[tet]};
        cover->cones[f].originals++;
    }
    return true;
}

/* Of each cone the walls that it is on the positive side of, and those that it is on the negative side of. Walls on the
 * boundary do not count, nor does a link face there: a cone is taken to reach beyond them, so that nothing is lost
 * where the boundary has moved. */
static bool make_masks(struct cover *cover)
{
    size_t words = cover->words;
    if (!room(cover, ORIGINAL_SIDES, &cover->sides, 2 * words * (1 + (size_t)cover->cone_count), sizeof *cover->sides))
        return false;
    cover->masks = cover->sides + 2 * words;
    memset(cover->masks, 0, 2 * words * cover->cone_count * sizeof *cover->masks);
    for (uint32_t f = 0; f < cover->cone_count; f++)
        for (int k = 0; k < 3; k++) {
            uint32_t w = cover->cones[f].walls[k];
            bool positive = cover->cone_signs[f * words + w / 64] >> w % 64 & 1;
            if (!cover->walls[w].outer)
                cover->masks[(2 * f + !positive) * words + w / 64] |= (uint64_t)1 << w % 64;
        }
    return true;
}

static bool pair_originals(struct cover *cover, const struct working *working)
{
    if (!make_masks(cover) || !find_held(cover, working))
        return false;
    cover->place_count = 0;
    for (uint32_t f = 0; f < cover->cone_count; f++)
        cover->cones[f].originals = 0;
    for (uint32_t t = 0; t < cover->tet_count; t++)
        if (!pair_original(cover, working, t))
            return false;
    return true;
}

static bool passed_room(struct passed *passed, size_t needed)
{
    return ARRAY_RESERVE(passed->numbers, passed->capacity, passed->count + needed);
}

/* The originals that may overlap a cone become its list. False: no memory. */
static bool pass_on_lists(struct cover *cover, const struct working *working, struct passed *passed)
{
    if (!pair_originals(cover, working) || !passed_room(passed, 2 * (size_t)cover->cone_count + cover->place_count))
        return false;
    for (uint32_t f = 0; f < cover->cone_count; f++) {
        uint32_t *list = passed->numbers + passed->count, count = cover->cones[f].originals;
        list[0] = cover->cones[f].tet;
        list[1] = count;
        cover->cones[f].originals = (uint32_t)passed->count + 2; // where the next one goes
        passed->count += 2 + (size_t)count;
    }
    for (size_t i = 0; i < cover->place_count; i++)
        passed->numbers[cover->cones[cover->places[i].cone].originals++] = cover->places[i].original;
    return true;
}

enum tetlod_status cover_pass_on(struct cover *cover, const struct working *working, struct passed *out,
                                 struct tetlod_error *error)
{
    out->count = 0;
    if (!pass_on_lists(cover, working, out))
        return no_room(error);
    out->list_count = out->count;
    if (!passed_room(out, 2 * (size_t)cover->vertex_count))
        return no_room(error);
    for (uint32_t v = 0; v < cover->vertex_count; v++) {
        uint32_t f = cover_cone_of(cover, v), host = f == TETLOD_NONE ? f : cover->cones[f].tet;
        if (v >= cover->inside_count &&
            (f == TETLOD_NONE || !(cone_height(&cover->cones[f], cover, working, cover->positions[v]) > 0)))
            continue;
        out->numbers[out->count++] = cover->vertices[v];
        out->numbers[out->count++] = host;
    }
    return TETLOD_OK;
}
