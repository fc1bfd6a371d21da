/* SPDX-License-Identifier: BSD-3-Clause */
#include "format/star_view.h"

#include <string.h>

static int room(struct tetlodi_star_view *view, struct tetlodi_memory *memory, size_t size, size_t vertices)
{
    size_t edges = 3 * size, table = 16;
    while (table < 2 * edges)
        table *= 2;
    size_t places = view->table_capacity, marks = view->mark_capacity;
    if (!TETLODI_ROOM(memory, view->tets, view->tets_capacity, size) ||
        !TETLODI_ROOM(memory, view->others, view->others_capacity, size) ||
        !TETLODI_ROOM(memory, view->edges, view->edges_capacity, size) ||
        !TETLODI_ROOM(memory, view->place, view->place_capacity, size) ||
        !TETLODI_ROOM(memory, view->labels, view->labels_capacity, size) ||
        !TETLODI_ROOM(memory, view->link, view->link_capacity, edges) ||
        !TETLODI_ROOM(memory, view->edge, view->edge_capacity, edges) ||
        !TETLODI_ROOM(memory, view->mark, view->mark_capacity, vertices) ||
        !TETLODI_ROOM(memory, view->table, view->table_capacity, table))
        return 0;
    if (view->table_capacity > places)
        memset(view->table + places, 0, (view->table_capacity - places) * sizeof *view->table);
    if (view->mark_capacity > marks)
        memset(view->mark + marks, 0, (view->mark_capacity - marks) * sizeof *view->mark);
    return 1;
}

/* Marks and the table are cleared by counting; at the counter's end they are cleared indeed. */
static void next_serial(struct tetlodi_star_view *view)
{
    if (++view->serial)
        return;
    memset(view->mark, 0, view->mark_capacity * sizeof *view->mark);
    memset(view->table, 0, view->table_capacity * sizeof *view->table);
    view->serial = 1;
}

/* The place of an edge in the table: used or free. */
static inline struct tetlodi_edge_place *find_place(struct tetlodi_edge_place *table, size_t mask, uint32_t serial,
                                                    uint32_t low, uint32_t high)
{
    uint32_t hash = low * 0x9e3779b1u + high * 0x85ebca6bu;
    size_t at = (hash ^ hash >> 15) & mask;
    while (table[at].serial == serial && (table[at].x != low || table[at].y != high))
        at = (at + 1) & mask;
    return &table[at];
}

/* Corners of a tetrahedron but one, in order; which one that is. */
static inline unsigned take_others(const uint32_t corners[4], uint32_t vertex, uint32_t others[3])
{
    unsigned place = corners[0] == vertex ? 0 : corners[1] == vertex ? 1 : corners[2] == vertex ? 2 : 3;
    others[0] = corners[place == 0];
    others[1] = corners[1 + (place <= 1)];
    others[2] = corners[2 + (place <= 2)];
    return place;
}

int tetlodi_star_lay_out(struct tetlodi_star_view *view, const struct tetlodi_replay *replay, uint32_t vertex)
{
    const struct tetlodi_star *star = &replay->stars[vertex];
    const uint32_t size = star->size, *all = replay->corners;
    if (!room(view, replay->memory, size + (size_t)1, replay->vertices))
        return 0;
    next_serial(view);
    size_t table_size = 16;
    while (table_size < 6 * (size_t)size)
        table_size *= 2;
    struct tetlodi_edge_place *table = view->table;
    struct tetlodi_link_edge *edge = view->edge;
    uint32_t *mark = view->mark, *link = view->link, serial = view->serial, edges = 0, links = 0;
    memcpy(view->tets, replay->pool + star->at, size * sizeof *view->tets);
    for (uint32_t i = 0; i < size; i++) {
        uint32_t other[3], *mine = view->edges[i];
        view->place[i] = (uint8_t)take_others(all + 4 * (size_t)view->tets[i], vertex, other);
        memcpy(view->others[i], other, sizeof other);
        for (unsigned c = 0; c < 3; c++) {
            uint32_t x = other[c == 0], y = other[2 - (c == 2)];
            struct tetlodi_edge_place *place = find_place(table, table_size - 1, serial, x < y ? x : y, x < y ? y : x);
            if (place->serial != serial) {
                *place = (struct tetlodi_edge_place){x < y ? x : y, x < y ? y : x, edges, serial};
                edge[edges++] = (struct tetlodi_link_edge){.x = x, .y = y, .tet = i, .opposite = (uint8_t)c};
            }
            edge[place->edge].count++;
            mine[c] = place->edge;
            if (mark[other[c]] != serial) {
                mark[other[c]] = serial;
                link[links++] = other[c];
            }
        }
    }
    view->vertex = vertex;
    view->size = size;
    view->edge_count = edges;
    view->link_count = links;
    view->extra_count = 0;
    return 1;
}

void tetlodi_star_between(const struct tetlodi_star_view *view, const struct tetlodi_replay *replay, uint32_t e,
                          uint32_t child, uint32_t corners[4])
{
    const struct tetlodi_link_edge *edge = &view->edge[e];
    unsigned place = view->place[edge->tet], opposite = edge->opposite + (edge->opposite >= place);
    int goes = view->labels[edge->tet];
    memcpy(corners, replay->corners + 4 * (size_t)view->tets[edge->tet], 4 * sizeof *corners);
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
    TETLODI_FREE(memory, view->link, view->link_capacity);
    TETLODI_FREE(memory, view->edge, view->edge_capacity);
    TETLODI_FREE(memory, view->mark, view->mark_capacity);
    TETLODI_FREE(memory, view->extras, view->extras_capacity);
    TETLODI_FREE(memory, view->table, view->table_capacity);
}
