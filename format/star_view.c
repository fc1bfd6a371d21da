/* SPDX-License-Identifier: BSD-3-Clause */
#include "format/star_view.h"

#include <string.h>

/* Links of up to so many vertices have a table of all pairs, larger ones a hash table of their edges. */
enum { LINK_SMALL = 256 };

static int room(struct tetlodi_star_view *view, struct tetlodi_memory *memory, size_t size, size_t vertices)
{
    size_t edges = 3 * size + 1, marks = view->mark_capacity, links = view->link_capacity; // one is written in vain
    if (!TETLODI_ROOM(memory, view->tets, view->tets_capacity, size + 1) ||
        !TETLODI_ROOM(memory, view->others, view->others_capacity, size + 1) ||
        !TETLODI_ROOM(memory, view->edges, view->edges_capacity, size + 1) ||
        !TETLODI_ROOM(memory, view->place, view->place_capacity, size + 1) ||
        !TETLODI_ROOM(memory, view->labels, view->labels_capacity, size + 1) ||
        !TETLODI_ROOM(memory, view->contexts, view->contexts_capacity, size + 1) ||
        !TETLODI_ROOM(memory, view->link, view->link_capacity, edges) ||
        !TETLODI_ROOM(memory, view->positions, view->positions_capacity, edges) ||
        !TETLODI_ROOM(memory, view->codes, view->codes_capacity, edges) ||
        !TETLODI_ROOM(memory, view->edge, view->edge_capacity, edges) ||
        !TETLODI_ROOM(memory, view->seen, view->seen_capacity, edges) ||
        !TETLODI_ROOM(memory, view->made, view->made_capacity, edges) ||
        !TETLODI_ROOM(memory, view->mark, view->mark_capacity, vertices))
        return 0;
    if (view->link_capacity > links)
        memset(view->link + links, 0, (view->link_capacity - links) * sizeof *view->link);
    if (view->mark_capacity > marks)
        memset(view->mark + marks, 0, (view->mark_capacity - marks) * sizeof *view->mark);
    return 1;
}

/* Corners of a tetrahedron but one, in order; which one that is. A table, as any branch would be a guess. */
static inline unsigned take_others(const uint32_t corners[4], uint32_t vertex, uint32_t others[3])
{
    static const uint8_t rest[4][4] = {{1, 2, 3}, {0, 2, 3}, {0, 1, 3}, {0, 1, 2}};
    unsigned place = (unsigned)(corners[1] == vertex) + 2 * (unsigned)(corners[2] == vertex) +
                     3 * (unsigned)(corners[3] == vertex);
    others[0] = corners[rest[place][0]];
    others[1] = corners[rest[place][1]];
    others[2] = corners[rest[place][2]];
    return place;
}

/* The number of a link vertex, in the order in which they are met. Marks are never cleared: one counts if the link says so
 * too (Briggs and Torczon 1993). Which are new cannot be foretold: all are written behind the last, some are counted. */
static inline uint32_t number_vertex(uint32_t *mark, uint32_t *link, uint32_t *count, uint32_t vertex)
{
    uint32_t n = mark[vertex], end = *count, fresh = (uint32_t)(n >= end) | (uint32_t)(link[n] != vertex);
    n = fresh ? end : n;
    mark[vertex] = n;
    link[end] = vertex;
    *count = end + fresh;
    return n;
}

static uint32_t number_link(struct tetlodi_star_view *view, const uint32_t *corners)
{
    uint32_t *mark = view->mark, *link = view->link, *tets = view->tets, (*others)[3] = view->others, count = 0;
    uint32_t vertex = view->vertex, size = view->size;
    uint8_t *place = view->place;
    place[size] = 0; // they are gone through in pairs
    for (uint32_t i = 0; i < size; i++)
        __builtin_prefetch(corners + 4 * (size_t)tets[i]);
    for (uint32_t i = 0; i < size; i++) {
        uint32_t other[3];
        place[i] = (uint8_t)take_others(corners + 4 * (size_t)tets[i], vertex, other);
        others[i][0] = number_vertex(mark, link, &count, other[0]);
        others[i][1] = number_vertex(mark, link, &count, other[1]);
        others[i][2] = number_vertex(mark, link, &count, other[2]);
    }
    return count;
}

/* The link's positions, from codes: values, as well, would be as many misses of the cache again in large meshes. What is soon
 * wanted of the fields is fetched at the same time. */
static void gather(struct tetlodi_star_view *view, const struct tetlodi_replay *replay)
{
    const struct tetlodi_column *columns = replay->columns;
    for (uint32_t f = 0; f < replay->column_count; f++)
        for (uint32_t i = 0; i < view->link_count; i++)
            __builtin_prefetch(columns[f].codes + (size_t)view->link[i] * columns[f].components);
    for (uint32_t i = 0; i < view->link_count; i++) {
        int64_t *codes = view->codes[i];
        memcpy(codes, columns->codes + (size_t)view->link[i] * 3, sizeof view->codes[i]);
        for (unsigned axis = 0; axis < 3; axis++)
            view->positions[i][axis] = scale_value(&columns->scale, axis, codes[axis]);
    }
}

/* The place in a hash table of edge (x, y): taken by it, or free. */
static uint32_t *find_edge(const struct tetlodi_star_view *view, uint32_t mask, uint32_t x, uint32_t y)
{
    uint32_t low = x < y ? x : y, high = x < y ? y : x, at = low * 0x9e3779b1u + high * 0x85ebca6bu;
    for (at = (at ^ at >> 15) & mask; view->table[at] != TETLOD_NONE; at = (at + 1) & mask) {
        uint32_t ends[2];
        tetlodi_star_ends(view, view->table[at], ends);
        if ((ends[0] == x && ends[1] == y) || (ends[0] == y && ends[1] == x))
            break;
    }
    return &view->table[at];
}

/* The number of a link edge, in the same way. A small link's table has it at both (x, y) and (y, x). */
static inline uint32_t number_edge(struct tetlodi_link_edge *edge, uint32_t *count, uint32_t *place, uint32_t *mirror,
                                   uint32_t id)
{
    uint32_t known = *place, end = *count, n = known < end ? known : end;
    *place = *mirror = n;
    edge[end].first = id;
    edge[n].last = id;
    *count = end + (known > n);
    return n;
}

static uint32_t number_edges(struct tetlodi_star_view *view)
{
    uint32_t *table = view->table, links = view->link_count, size = view->size, count = 0, (*edges)[3] = view->edges;
    const uint32_t(*others)[3] = (const uint32_t(*)[3])view->others;
    struct tetlodi_link_edge *edge = view->edge;
    for (uint32_t i = 0; i < size; i++) {
        uint32_t x = others[i][0], y = others[i][1], z = others[i][2];
        uint32_t *of_x = table + links * x, *of_y = table + links * y, *of_z = table + links * z;
        edges[i][0] = number_edge(edge, &count, &of_y[z], &of_z[y], 3 * i);
        edges[i][1] = number_edge(edge, &count, &of_x[z], &of_z[x], 3 * i + 1);
        edges[i][2] = number_edge(edge, &count, &of_x[y], &of_y[x], 3 * i + 2);
    }
    return count;
}

static uint32_t number_edges_large(struct tetlodi_star_view *view, uint32_t mask)
{
    uint32_t count = 0;
    for (uint32_t i = 0; i < view->size; i++)
        for (unsigned c = 0; c < 3; c++) {
            uint32_t *place = find_edge(view, mask, view->others[i][c == 0], view->others[i][2 - (c == 2)]);
            view->edges[i][c] = number_edge(view->edge, &count, place, place, 3 * i + c);
        }
    return count;
}

int tetlodi_star_lay_out(struct tetlodi_star_view *view, const struct tetlodi_replay *replay, uint32_t vertex)
{
    const struct tetlodi_star *star = &replay->stars[vertex];
    if (!room(view, replay->memory, star->size, replay->vertices))
        return 0;
    view->vertex = vertex;
    view->size = star->size;
    view->extra_count = 0;
    memcpy(view->tets, replay->pool + star->at, star->size * sizeof *view->tets);
    view->link_count = number_link(view, replay->corners);
    gather(view, replay);
    int small = view->link_count <= LINK_SMALL;
    size_t places = small ? (size_t)view->link_count * view->link_count : 16;
    while (!small && places < 6 * (size_t)view->size)
        places *= 2;
    if (!TETLODI_ROOM(replay->memory, view->table, view->table_capacity, places + 1))
        return 0;
    memset(view->table, 0xff, places * sizeof *view->table); // TETLOD_NONE
    view->edge_count = small ? number_edges(view) : number_edges_large(view, (uint32_t)places - 1);
    memset(view->seen, 0, view->edge_count);
    memset(view->made, 0, view->edge_count);
    return 1;
}

void tetlodi_star_ends(const struct tetlodi_star_view *view, uint32_t e, uint32_t ends[2])
{
    const uint32_t *others = view->others[view->edge[e].first / 3];
    unsigned opposite = view->edge[e].first % 3;
    ends[0] = others[opposite == 0];
    ends[1] = others[2 - (opposite == 2)];
}

void tetlodi_star_between(const struct tetlodi_star_view *view, const struct tetlodi_replay *replay, uint32_t e,
                          uint32_t child, uint32_t corners[4])
{
    uint32_t tet = view->edge[e].first / 3;
    unsigned place = view->place[tet], opposite = view->edge[e].first % 3;
    opposite += opposite >= place;
    int goes = view->labels[tet];
    memcpy(corners, replay->corners + 4 * (size_t)view->tets[tet], 4 * sizeof *corners);
    corners[place] = goes ? child : view->vertex;
    corners[opposite] = goes ? view->vertex : child;
    /* Across the face that both share, the orientation turns: the two corners of the edge change places. */
    unsigned first = 0;
    while (first == place || first == opposite)
        first++;
    unsigned second = 6 - place - opposite - first;
    uint32_t swap = corners[first];
    corners[first] = corners[second];
    corners[second] = swap;
}

void tetlodi_star_fini(struct tetlodi_star_view *view, struct tetlodi_memory *memory)
{
    TETLODI_FREE(memory, view->tets, view->tets_capacity);
    TETLODI_FREE(memory, view->others, view->others_capacity);
    TETLODI_FREE(memory, view->edges, view->edges_capacity);
    TETLODI_FREE(memory, view->place, view->place_capacity);
    TETLODI_FREE(memory, view->labels, view->labels_capacity);
    TETLODI_FREE(memory, view->contexts, view->contexts_capacity);
    TETLODI_FREE(memory, view->link, view->link_capacity);
    TETLODI_FREE(memory, view->positions, view->positions_capacity);
    TETLODI_FREE(memory, view->codes, view->codes_capacity);
    TETLODI_FREE(memory, view->edge, view->edge_capacity);
    TETLODI_FREE(memory, view->seen, view->seen_capacity);
    TETLODI_FREE(memory, view->made, view->made_capacity);
    TETLODI_FREE(memory, view->mark, view->mark_capacity);
    TETLODI_FREE(memory, view->extras, view->extras_capacity);
    TETLODI_FREE(memory, view->table, view->table_capacity);
}
