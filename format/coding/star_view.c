/* SPDX-License-Identifier: BSD-3-Clause */
#include "format/coding/star_view.h"

#include <string.h>

/* Links of up to so many vertices have a table of all pairs, larger ones a hash table of their edges. */
enum { LINK_SMALL = 256 };

static int room(struct tetlodi_star_view *view, struct tetlodi_memory *memory, size_t size)
{
    size_t edges = 3 * size + 1; // one is written and not counted
    return TETLODI_ROOM(memory, view->which, view->which_capacity, size + 1) &&
           TETLODI_ROOM(memory, view->others, view->others_capacity, size + 1) &&
           TETLODI_ROOM(memory, view->edges, view->edges_capacity, size + 1) &&
           TETLODI_ROOM(memory, view->labels, view->labels_capacity, size + 1) &&
           TETLODI_ROOM(memory, view->contexts, view->contexts_capacity, size + 1) &&
           TETLODI_ROOM(memory, view->link, view->link_capacity, edges) &&
           TETLODI_ROOM(memory, view->positions, view->positions_capacity, edges) &&
           TETLODI_ROOM(memory, view->codes, view->codes_capacity, 3 * edges) &&
           TETLODI_ROOM(memory, view->edge, view->edge_capacity, edges) &&
           TETLODI_ROOM(memory, view->seen, view->seen_capacity, edges) &&
           TETLODI_ROOM(memory, view->made, view->made_capacity, edges);
}

static int marks_room(struct tetlodi_star_marks *marks, struct tetlodi_memory *memory, size_t edges, size_t vertices)
{
    size_t before = marks->mark_capacity;
    if (!TETLODI_ROOM(memory, marks->mark, marks->mark_capacity, vertices))
        return 0;
    if (marks->mark_capacity > before)
        memset(marks->mark + before, 0, (marks->mark_capacity - before) * sizeof *marks->mark);
    if (!marks->first_mark || UINT32_MAX - marks->first_mark < edges) { // earlier ones would look like new ones
        memset(marks->mark, 0, marks->mark_capacity * sizeof *marks->mark);
        marks->first_mark = 1;
    }
    return 1;
}

/* The number of a link vertex, in the order in which they are met. Each star has marks of its own, higher than all
 * before, so that none are cleared. Which ones are new cannot be predicted: all are written behind the last, the new
 * ones are counted. */
static inline uint32_t number_vertex(uint32_t *mark, uint32_t first, uint32_t *link, uint32_t *count, uint32_t vertex)
{
    uint32_t known = mark[vertex] - first, end = *count, n = known < end ? known : end;
    mark[vertex] = first + n;
    link[end] = vertex;
    *count = end + (known >= end);
    return n;
}

/* The corners but the vertex, in order. */
static uint32_t number_link(struct tetlodi_star_view *view, struct tetlodi_star_marks *marks, const uint32_t *all)
{
    static const uint8_t rest[4][4] = {{1, 2, 3}, {0, 2, 3}, {0, 1, 3}, {0, 1, 2}};
    uint32_t *mark = marks->mark, first = marks->first_mark, *link = view->link, (*others)[3] = view->others, count = 0;
    const uint32_t *corners = view->corners;
    uint8_t *all_which = view->which;
    uint32_t size = view->size;
    for (uint32_t i = 0; i < size; i++)
        __builtin_prefetch(all + corners[i]);
    for (uint32_t i = 0; i < size; i++) {
        const uint32_t *tet = all + (corners[i] & ~3u);
        const uint8_t *which = rest[corners[i] & 3];
        all_which[i] = (uint8_t)(corners[i] & 3);
        others[i][0] = number_vertex(mark, first, link, &count, tet[which[0]]);
        others[i][1] = number_vertex(mark, first, link, &count, tet[which[1]]);
        others[i][2] = number_vertex(mark, first, link, &count, tet[which[2]]);
    }
    marks->first_mark += count;
    return count;
}

/* The link's positions, from codes: values, as well, would be as many misses of the cache again in large meshes. */
static void gather(struct tetlodi_star_view *view, const struct tetlodi_replay *replay)
{
    const struct tetlodi_column *columns = replay->columns;
    uint32_t count = view->link_count;
    for (uint32_t i = 0; i < count; i++)
        __builtin_prefetch(columns->codes + (size_t)view->link[i] * 3);
    int64_t *x = view->codes, *y = x + count, *z = y + count;
    view->axis_codes[0] = x;
    view->axis_codes[1] = y;
    view->axis_codes[2] = z;
    for (uint32_t i = 0; i < count; i++) {
        const int64_t *codes = columns->codes + (size_t)view->link[i] * 3;
        double *position = view->positions[i];
        position[0] = scale_value(&columns->scale, 0, x[i] = codes[0]);
        position[1] = scale_value(&columns->scale, 1, y[i] = codes[1]);
        position[2] = scale_value(&columns->scale, 2, z[i] = codes[2]);
    }
}

/* The ends of a link edge, by number in the link. */
static void ends_of(const struct tetlodi_star_view *view, uint32_t e, uint32_t ends[2])
{
    const uint32_t *others = view->others[view->edge[e].first / 3];
    unsigned opposite = view->edge[e].first % 3;
    ends[0] = others[opposite == 0];
    ends[1] = others[2 - (opposite == 2)];
}

/* The place in a hash table of edge (x, y): taken by it, or free. */
static uint32_t *find_edge(const struct tetlodi_star_view *view, const struct tetlodi_star_marks *marks, uint32_t x,
                           uint32_t y)
{
    uint32_t low = x < y ? x : y, high = x < y ? y : x, at = low * 0x9e3779b1u + high * 0x85ebca6bu;
    for (at = (at ^ at >> 15) & marks->mask; marks->table[at] != TETLOD_NONE; at = (at + 1) & marks->mask) {
        uint32_t ends[2];
        ends_of(view, marks->table[at], ends);
        if ((ends[0] == x && ends[1] == y) || (ends[0] == y && ends[1] == x))
            break;
    }
    return &marks->table[at];
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

static uint32_t number_edges(struct tetlodi_star_view *view, uint32_t *table)
{
    uint32_t links = view->link_count, size = view->size, count = 0, (*edges)[3] = view->edges;
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

static uint32_t number_edges_large(struct tetlodi_star_view *view, const struct tetlodi_star_marks *marks)
{
    uint32_t count = 0;
    for (uint32_t i = 0; i < view->size; i++)
        for (unsigned c = 0; c < 3; c++) {
            uint32_t *place = find_edge(view, marks, view->others[i][c == 0], view->others[i][2 - (c == 2)]);
            view->edges[i][c] = number_edge(view->edge, &count, place, place, 3 * i + c);
        }
    return count;
}

int tetlodi_star_lay_out(struct tetlodi_star_view *view, struct tetlodi_star_marks *marks,
                         const struct tetlodi_replay *replay, uint32_t vertex)
{
    const struct tetlodi_star *star = &replay->stars[vertex];
    if (!room(view, replay->memory, star->size) ||
        !marks_room(marks, replay->memory, 3 * (size_t)star->size + 1, replay->vertices))
        return 0;
    view->vertex = vertex;
    view->size = star->size;
    view->extra_count = 0;
    view->corners = replay->pool + star->at;
    memcpy(view->own, replay->columns->codes + (size_t)vertex * 3, sizeof view->own);
    view->link_count = number_link(view, marks, replay->corners);
    gather(view, replay);
    int small = view->link_count <= LINK_SMALL;
    size_t places = small ? (size_t)view->link_count * view->link_count : 16;
    while (!small && places < 6 * (size_t)view->size)
        places *= 2;
    if (!TETLODI_ROOM(replay->memory, marks->table, marks->table_capacity, places + 1))
        return 0;
    memset(marks->table, 0xff, places * sizeof *marks->table); // TETLOD_NONE
    marks->mask = small ? 0 : (uint32_t)places - 1;
    view->edge_count = small ? number_edges(view, marks->table) : number_edges_large(view, marks);
    memset(view->seen, 0, view->edge_count);
    memset(view->made, 0, view->edge_count);
    return 1;
}

void tetlodi_star_part(struct tetlodi_star_view *view, const struct tetlodi_replay *replay, uint32_t child)
{
    const double *positions = replay->columns->values;
    memcpy(view->ends[0], positions + (size_t)view->vertex * 3, sizeof *view->ends);
    memcpy(view->ends[1], positions + (size_t)child * 3, sizeof *view->ends);
}

uint32_t tetlodi_star_edge(const struct tetlodi_star_view *view, const struct tetlodi_star_marks *marks, uint32_t x,
                           uint32_t y)
{
    uint32_t first = marks->first_mark - view->link_count, links = view->link_count;
    uint32_t a = marks->mark[x] - first, b = marks->mark[y] - first;
    if (a >= links || b >= links)
        return TETLOD_NONE;
    return marks->mask ? *find_edge(view, marks, a, b) : marks->table[(size_t)links * a + b];
}

/* By which corner the vertex is and which other one is not on the edge: where the corners of the tetrahedron between
 * come from. Across the face that both share, the orientation turns: the two corners of the edge change places. */
static const uint8_t between_from[4][3][4] = {{{0, 1, 3, 2}, {0, 3, 2, 1}, {0, 2, 1, 3}},
                                              {{0, 1, 3, 2}, {3, 1, 2, 0}, {2, 1, 0, 3}},
                                              {{0, 3, 2, 1}, {3, 1, 2, 0}, {1, 0, 2, 3}},
                                              {{0, 2, 1, 3}, {2, 1, 0, 3}, {1, 0, 2, 3}}};

void tetlodi_star_between(const struct tetlodi_star_view *view, const struct tetlodi_replay *replay, uint32_t e,
                          uint32_t child, uint32_t corners[4])
{
    uint32_t first = view->edge[e].first, tet = first / 3, place = view->corners[tet] & 3, opposite = first % 3;
    const uint32_t *old = replay->corners + (view->corners[tet] & ~3u);
    const uint8_t *from = between_from[place][opposite];
    for (int c = 0; c < 4; c++)
        corners[c] = old[from[c]];
    int goes = view->labels[tet];
    corners[place] = goes ? child : view->vertex;
    corners[opposite + (opposite >= place)] = goes ? view->vertex : child;
}

void tetlodi_star_between_points(const struct tetlodi_star_view *view, uint32_t e, const double *points[4])
{
    // which a corner is but `place`
    static const uint8_t other[4][4] = {{0, 0, 1, 2}, {0, 0, 1, 2}, {0, 1, 0, 2}, {0, 1, 2, 0}};
    uint32_t first = view->edge[e].first, tet = first / 3, place = view->which[tet], opposite = first % 3;
    const uint8_t *from = between_from[place][opposite];
    for (int c = 0; c < 4; c++)
        points[c] = view->positions[view->others[tet][other[place][from[c]]]];
    int goes = view->labels[tet];
    points[place] = view->ends[goes];
    points[opposite + (opposite >= place)] = view->ends[!goes];
}

void tetlodi_star_fini(struct tetlodi_star_view *view, struct tetlodi_memory *memory)
{
    TETLODI_FREE(memory, view->which, view->which_capacity);
    TETLODI_FREE(memory, view->others, view->others_capacity);
    TETLODI_FREE(memory, view->edges, view->edges_capacity);
    TETLODI_FREE(memory, view->labels, view->labels_capacity);
    TETLODI_FREE(memory, view->contexts, view->contexts_capacity);
    TETLODI_FREE(memory, view->link, view->link_capacity);
    TETLODI_FREE(memory, view->positions, view->positions_capacity);
    TETLODI_FREE(memory, view->codes, view->codes_capacity);
    TETLODI_FREE(memory, view->edge, view->edge_capacity);
    TETLODI_FREE(memory, view->seen, view->seen_capacity);
    TETLODI_FREE(memory, view->made, view->made_capacity);
    TETLODI_FREE(memory, view->extras, view->extras_capacity);
}

void tetlodi_star_marks_fini(struct tetlodi_star_marks *marks, struct tetlodi_memory *memory)
{
    TETLODI_FREE(memory, marks->mark, marks->mark_capacity);
    TETLODI_FREE(memory, marks->table, marks->table_capacity);
}
