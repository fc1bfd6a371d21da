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

static uint32_t find_edge(struct tetlodi_star_view *view, uint32_t x, uint32_t y, size_t mask)
{
    uint32_t low = x < y ? x : y, high = x < y ? y : x;
    uint32_t hash = low * 0x9e3779b1u + high * 0x85ebca6bu;
    size_t at = (hash ^ hash >> 15) & mask;
    struct tetlodi_edge_place *place = &view->table[at];
    for (; place->serial == view->serial; place = &view->table[at]) {
        if (place->x == low && place->y == high)
            return place->edge;
        at = (at + 1) & mask;
    }
    *place = (struct tetlodi_edge_place){low, high, view->edge_count, view->serial};
    return view->edge_count++;
}

int tetlodi_star_lay_out(struct tetlodi_star_view *view, const struct tetlodi_replay *replay, uint32_t vertex)
{
    const struct tetlodi_star *star = &replay->stars[vertex];
    if (!room(view, replay->memory, star->size + (size_t)1, replay->vertices))
        return 0;
    next_serial(view);
    size_t table = 16;
    while (table < 6 * (size_t)star->size)
        table *= 2;
    view->vertex = vertex;
    view->size = star->size;
    view->edge_count = view->extra_count = view->link_count = 0;
    memcpy(view->tets, replay->pool + star->at, star->size * sizeof *view->tets);
    for (uint32_t i = 0; i < star->size; i++) {
        const uint32_t *corners = replay->corners + 4 * (size_t)view->tets[i];
        uint32_t *other = view->others[i];
        unsigned place = corners[0] == vertex ? 0 : corners[1] == vertex ? 1 : corners[2] == vertex ? 2 : 3;
        view->place[i] = (uint8_t)place;
        for (unsigned c = 0, n = 0; c < 4; c++)
            if (c != place)
                other[n++] = corners[c];
        for (unsigned c = 0; c < 3; c++) {
            uint32_t x = other[c == 0 ? 1 : 0], y = other[c == 2 ? 1 : 2], edges = view->edge_count;
            uint32_t e = find_edge(view, x, y, table - 1);
            if (e == edges)
                view->edge[e] = (struct tetlodi_link_edge){.x = x, .y = y, .tet = i, .opposite = (uint8_t)c};
            view->edge[e].count++;
            view->edges[i][c] = e;
            if (view->mark[other[c]] != view->serial) {
                view->mark[other[c]] = view->serial;
                view->link[view->link_count++] = other[c];
            }
        }
    }
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
