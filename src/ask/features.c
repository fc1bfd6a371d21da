/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * Merge trees by union-find over vertices that are sorted by one function, their bars by another (PROOF.md 13).
 *
 * Goes in: a mesh with two functions that enclose a third. Comes out: the third's features.
 *   1. Minima are the maxima of what is turned upside down.
 *   2. Proven bars: joined by `upper`, measured by `lower`. Each gets a name.
 *   3. All bars: joined by `lower`, measured by `upper`. Those that hold no name are possible.
 *   4. The box of a proven one is that of its component where `upper` is above the level at which it must still be
 *      apart. These components are disjoint, so that looking for all of them looks at each vertex once. */
#include "src/ask/features.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "format/fail.h"
#include "src/mesh/adjacency.h"
#include "src/util/array.h"

struct bar {
    uint32_t vertex, end, name; /* name: number of the proven bar whose place it holds, or TETLOD_NONE */
    double peak, death;
};

struct bars {
    struct bar *list;
    size_t count, capacity;
};

/* The mesh as the search sees it: maxima only. */
struct search {
    const struct feature_mesh *mesh;
    const struct feature_query *query;
    bool is_down, has_floor;
    double floor;
    size_t *offsets; /* stars */
    uint32_t *tets;
    double *turned[3];
    const double *lower, *middle, *upper;
    uint32_t *order, *queue;
    bool *seen;
    /* union-find: of each vertex that has been reached */
    uint32_t *parent, *peak, *name;
    uint32_t *low; /* of a root: the vertex that was added last */
    uint32_t *names; /* [vertex] the proven bar that has it for a place, or TETLOD_NONE */
};

/* Is a - b > c, exactly? What the difference loses by rounding is a double. */
static bool exceeds(double a, double b, double c)
{
    double difference = a - b, part = a - difference;
    double lost = (a - (difference + part)) + (part - b);
    return difference > c || (difference == c && lost > 0);
}

static void search_fini(struct search *search)
{
    for (int i = 0; i < 3; i++)
        free(search->turned[i]);
    free(search->offsets);
    free(search->tets);
    free(search->order);
    free(search->queue);
    free(search->seen);
    free(search->parent);
    free(search->peak);
    free(search->name);
    free(search->low);
    free(search->names);
}

/* The function upside down, where minima are asked for. */
static const double *turn(struct search *search, int which, const double *values)
{
    double *turned = search->turned[which];
    if (!search->is_down)
        return values;
    for (uint32_t v = 0; v < search->mesh->vertices; v++)
        turned[v] = -values[v];
    return turned;
}

static enum tetlod_status search_init(struct search *search, struct tetlod_error *error)
{
    const struct feature_mesh *mesh = search->mesh;
    size_t vertices = mesh->vertices, entries = 4 * (size_t)mesh->tets;
    for (int i = 0; i < 3; i++)
        search->turned[i] = array_new(search->is_down ? vertices : 0, sizeof(double));
    search->offsets = array_new(vertices + 1, sizeof *search->offsets);
    search->tets = array_new(entries, sizeof *search->tets);
    search->order = array_new(vertices, sizeof *search->order);
    search->queue = array_new(vertices, sizeof *search->queue);
    search->seen = array_zero(vertices, sizeof *search->seen);
    search->parent = array_new(vertices, sizeof *search->parent);
    search->peak = array_new(vertices, sizeof *search->peak);
    search->name = array_new(vertices, sizeof *search->name);
    search->names = array_new(vertices, sizeof *search->names);
    search->low = array_new(vertices, sizeof *search->low);
    if (!search->turned[0] || !search->turned[1] || !search->turned[2] || !search->offsets || !search->tets ||
        !search->order || !search->queue || !search->seen || !search->parent || !search->peak || !search->name ||
        !search->names || !search->low)
        return tetlodi_fail_nomem(error, "the merge tree", 61 * vertices + sizeof *search->tets * entries);
    search->lower = turn(search, 0, search->is_down ? mesh->upper : mesh->lower);
    search->middle = turn(search, 1, mesh->middle);
    search->upper = turn(search, 2, search->is_down ? mesh->lower : mesh->upper);
    memset(search->names, 0xff, vertices * sizeof *search->names);
    stars_build(mesh->corners, mesh->tets, mesh->vertices, search->offsets, search->tets);
    return TETLOD_OK;
}

struct keyed {
    double key;
    uint32_t vertex;
};

static int compare_keyed(const void *a, const void *b)
{
    const struct keyed *one = a, *other = b;
    if (one->key != other->key)
        return one->key < other->key ? 1 : -1;
    return (one->vertex > other->vertex) - (one->vertex < other->vertex);
}

/* Vertices by falling key, ties by number. */
static enum tetlod_status sort(struct search *search, const double *keys, struct tetlod_error *error)
{
    uint32_t vertices = search->mesh->vertices;
    struct keyed *keyed = array_new(vertices, sizeof *keyed);
    if (!keyed)
        return tetlodi_fail_nomem(error, "the merge tree", vertices * sizeof *keyed);
    for (uint32_t v = 0; v < vertices; v++)
        keyed[v] = (struct keyed){keys[v], v};
    qsort(keyed, vertices, sizeof *keyed, compare_keyed);
    for (uint32_t v = 0; v < vertices; v++)
        search->order[v] = keyed[v].vertex;
    free(keyed);
    return TETLOD_OK;
}

static uint32_t root_of(struct search *search, uint32_t vertex)
{
    uint32_t *parent = search->parent;
    while (parent[vertex] != vertex)
        vertex = parent[vertex] = parent[parent[vertex]];
    return vertex;
}

static enum tetlod_status add_bar(struct bars *bars, const struct search *search, uint32_t root, const double *heights,
                                  uint32_t end, double death, struct tetlod_error *error)
{
    if (!ARRAY_RESERVE(bars->list, bars->capacity, bars->count + 1))
        return tetlodi_fail_nomem(error, "the features", (bars->count + 1) * sizeof *bars->list);
    uint32_t peak = search->peak[root];
    bars->list[bars->count++] = (struct bar){peak, end, search->name[root], heights[peak], death};
    return TETLOD_OK;
}

/* Two components meet at a vertex: the one with the lower peak ends there. */
static enum tetlod_status join(struct search *search, struct bars *bars, const double *heights, uint32_t one,
                               uint32_t other, uint32_t at, double height, struct tetlod_error *error)
{
    uint32_t a = search->peak[one], b = search->peak[other];
    bool is_older = heights[a] != heights[b] ? heights[a] > heights[b] : a < b;
    uint32_t older = is_older ? one : other, younger = is_older ? other : one;
    if (!search->has_floor && exceeds(heights[search->peak[younger]], height, search->query->persistence))
        TETLOD_TRY(add_bar(bars, search, younger, heights, at, height, error));
    else if (search->name[older] == TETLOD_NONE)
        search->name[older] = search->name[younger];
    search->parent[younger] = older;
    return TETLOD_OK;
}

static enum tetlod_status add_vertex(struct search *search, struct bars *bars, const double *keys,
                                     const double *heights, uint32_t vertex, struct tetlod_error *error)
{
    search->parent[vertex] = search->peak[vertex] = vertex;
    search->name[vertex] = search->names[vertex];
    search->seen[vertex] = true;
    for (size_t i = search->offsets[vertex]; i < search->offsets[vertex + 1]; i++)
        for (int c = 0; c < 4; c++) {
            uint32_t near = search->mesh->corners[4 * (size_t)search->tets[i] + (size_t)c];
            if (!search->seen[near])
                continue;
            uint32_t one = root_of(search, vertex), other = root_of(search, near);
            if (one != other)
                TETLOD_TRY(join(search, bars, heights, one, other, vertex, keys[vertex], error));
        }
    search->low[root_of(search, vertex)] = vertex;
    return TETLOD_OK;
}

/* Bars of components where `keys` are high, measured by `heights`. */
static enum tetlod_status sweep(struct search *search, struct bars *bars, const double *keys, const double *heights,
                                struct tetlod_error *error)
{
    uint32_t vertices = search->mesh->vertices, count = 0;
    TETLOD_TRY(sort(search, keys, error));
    memset(search->seen, 0, vertices * sizeof *search->seen);
    for (; count < vertices && (!search->has_floor || keys[search->order[count]] > search->floor); count++)
        TETLOD_TRY(add_vertex(search, bars, keys, heights, search->order[count], error));
    for (uint32_t i = 0; i < count; i++) {
        uint32_t root = search->order[i];
        if (search->parent[root] != root)
            continue;
        double death = search->has_floor ? search->floor : keys[search->low[root]];
        if (exceeds(heights[search->peak[root]], death, search->query->persistence))
            TETLOD_TRY(add_bar(bars, search, root, heights, search->low[root], death, error));
    }
    return TETLOD_OK;
}

static void widen(double box[2][3], const double at[3])
{
    for (int i = 0; i < 3; i++) {
        box[0][i] = fmin(box[0][i], at[i]);
        box[1][i] = fmax(box[1][i], at[i]);
    }
}

/* Where `upper` falls to a level on an edge, or a hair beyond. */
static void widen_to_level(const struct search *search, double box[2][3], uint32_t inside, uint32_t outside,
                           double level)
{
    const double *a = search->mesh->positions + 3 * (size_t)inside, *b = search->mesh->positions + 3 * (size_t)outside;
    double fall = search->upper[inside] - search->upper[outside], at[3];
    double t = fall > 0 ? fmin((search->upper[inside] - level) / fall * (1 + 1e-12), 1) : 1;
    if (!isfinite(t))
        t = 1;
    for (int i = 0; i < 3; i++)
        at[i] = a[i] + t * (b[i] - a[i]) + copysign(4e-16 * (fabs(a[i]) + fabs(b[i])), b[i] - a[i]);
    widen(box, at);
}

/* The component around a bar's peak where `upper` is above a level; gives the greatest value there. */
static double flood(struct search *search, uint32_t peak, double level, double box[2][3])
{
    const struct feature_mesh *mesh = search->mesh;
    size_t head = 0, tail = 0;
    double greatest = search->upper[peak];
    search->queue[tail++] = peak;
    search->seen[peak] = true;
    for (int i = 0; i < 3; i++)
        box[0][i] = box[1][i] = mesh->positions[3 * (size_t)peak + (size_t)i];
    while (head < tail) {
        uint32_t vertex = search->queue[head++];
        greatest = fmax(greatest, search->upper[vertex]);
        widen(box, mesh->positions + 3 * (size_t)vertex);
        for (size_t i = search->offsets[vertex]; i < search->offsets[vertex + 1]; i++)
            for (int c = 0; c < 4; c++) {
                uint32_t near = mesh->corners[4 * (size_t)search->tets[i] + (size_t)c];
                if (search->upper[near] <= level) {
                    widen_to_level(search, box, vertex, near, level);
                } else if (!search->seen[near]) {
                    search->seen[near] = true;
                    search->queue[tail++] = near;
                }
            }
    }
    return greatest;
}

/* Below the peak's lower value by more than the persistence, and not below the saddle of `upper`. */
static double level_of(const struct search *search, const struct bar *bar)
{
    double level = nextafter(bar->peak - search->query->persistence, -INFINITY);
    return search->has_floor || level < bar->death ? bar->death : level;
}

static enum tetlod_status add_feature(struct features *out, const struct search *search, const struct bar *bar,
                                      struct feature feature, struct tetlod_error *error)
{
    if (!ARRAY_RESERVE(out->list, out->capacity, out->count + 1))
        return tetlodi_fail_nomem(error, "the features", (out->count + 1) * sizeof *out->list);
    feature.kind = search->query->kind;
    feature.vertex = bar->vertex;
    feature.end = bar->end;
    feature.persistence = bar->peak - bar->death;
    memcpy(feature.at, search->mesh->positions + 3 * (size_t)bar->vertex, sizeof feature.at);
    if (search->is_down) {
        double least = -feature.range[1];
        feature.range[1] = -feature.range[0];
        feature.range[0] = least;
    }
    out->list[out->count++] = feature;
    (feature.proven ? out->proven : out->possible)[feature.kind]++;
    return TETLOD_OK;
}

static enum tetlod_status add_proven(struct features *out, struct search *search, const struct bars *bars,
                                     struct tetlod_error *error)
{
    memset(search->seen, 0, search->mesh->vertices * sizeof *search->seen);
    for (size_t b = 0; b < bars->count; b++) {
        const struct bar *bar = &bars->list[b];
        struct feature feature = {.proven = true};
        search->names[bar->vertex] = (uint32_t)b;
        feature.range[0] = bar->peak;
        feature.range[1] = flood(search, bar->vertex, level_of(search, bar), feature.box);
        TETLOD_TRY(add_feature(out, search, bar, feature, error));
    }
    return TETLOD_OK;
}

static enum tetlod_status add_possible(struct features *out, const struct search *search, const struct bars *bars,
                                       struct tetlod_error *error)
{
    for (size_t b = 0; b < bars->count; b++) {
        const struct bar *bar = &bars->list[b];
        struct feature feature = {.range = {search->lower[bar->vertex], search->upper[bar->vertex]}};
        if (bar->name == TETLOD_NONE)
            TETLOD_TRY(add_feature(out, search, bar, feature, error));
    }
    return TETLOD_OK;
}

static int compare_features(const void *a, const void *b)
{
    const struct feature *one = a, *other = b;
    if (one->proven != other->proven)
        return one->proven ? -1 : 1;
    if (one->persistence != other->persistence)
        return one->persistence < other->persistence ? 1 : -1;
    return (one->vertex > other->vertex) - (one->vertex < other->vertex);
}

/* Where the functions are further apart than the persistence, any number of bars fits between them: then the middle's
 * own are named as possible. */
static enum tetlod_status find(struct features *out, struct search *search, struct tetlod_error *error)
{
    struct bars proven = {0}, all = {0};
    size_t first = out->count;
    bool bounded = true;
    for (uint32_t v = 0; v < search->mesh->vertices && bounded; v++)
        bounded = !exceeds(search->upper[v], search->lower[v], search->query->persistence);
    out->bounded[search->query->kind] = bounded;
    enum tetlod_status status = sweep(search, &proven, search->upper, search->lower, error);
    if (status == TETLOD_OK)
        status = add_proven(out, search, &proven, error);
    if (status == TETLOD_OK && search->mesh->lower != search->mesh->upper)
        status = bounded ? sweep(search, &all, search->lower, search->upper, error)
                         : sweep(search, &all, search->middle, search->middle, error);
    if (status == TETLOD_OK)
        status = add_possible(out, search, &all, error);
    if (out->count > first)
        qsort(out->list + first, out->count - first, sizeof *out->list, compare_features);
    free(proven.list);
    free(all.list);
    return status;
}

enum tetlod_status features_find(struct features *out, const struct feature_mesh *mesh,
                                 const struct feature_query *query, struct tetlod_error *error)
{
    struct search search = {.mesh = mesh, .query = query, .has_floor = query->kind >= FEATURE_ABOVE,
                            .is_down = query->kind == FEATURE_MINIMUM || query->kind == FEATURE_BELOW};
    search.floor = search.is_down ? -query->threshold : query->threshold;
    out->asked[query->kind] = true;
    enum tetlod_status status = search_init(&search, error);
    if (status == TETLOD_OK)
        status = find(out, &search, error);
    search_fini(&search);
    return status;
}

void features_fini(struct features *features)
{
    free(features->list);
    *features = (struct features){0};
}

const char *feature_name(enum feature_kind kind)
{
    static const char *const names[FEATURE_KINDS] = {"maximum", "minimum", "component above", "component below"};
    return names[kind];
}
