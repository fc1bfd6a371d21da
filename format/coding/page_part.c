/* SPDX-License-Identifier: BSD-3-Clause */
#include "format/coding/page_part.h"

#include <stdlib.h>
#include <string.h>

#include "format/common/ascending.h"

/* ---- what pages have */

int tetlodi_page_shares_init(struct tetlodi_page_shares *shares, struct tetlodi_replay *whole, size_t pages)
{
    size_t vertices = whole->vertices, tets = whole->tets;
    *shares = (struct tetlodi_page_shares){.whole = whole,
                                           .vertices = whole->vertices,
                                           .tets = whole->tets,
                                           .pages = (uint32_t)pages,
                                           .page_of = malloc((tets + 1) * sizeof *shares->page_of),
                                           .owner = malloc((vertices + 1) * sizeof *shares->owner),
                                           .local = malloc((vertices + 1) * sizeof *shares->local),
                                           .tet_begins = malloc((pages + 2) * sizeof *shares->tet_begins),
                                           .tet_list = malloc((tets + 1) * sizeof *shares->tet_list),
                                           .inner_begins = malloc((pages + 2) * sizeof *shares->inner_begins),
                                           .inner_list = malloc((vertices + 1) * sizeof *shares->inner_list)};
    return shares->page_of && shares->owner && shares->local && shares->tet_begins && shares->tet_list &&
           shares->inner_begins && shares->inner_list;
}

void tetlodi_page_shares_fini(struct tetlodi_page_shares *shares)
{
    free(shares->page_of);
    free(shares->owner);
    free(shares->local);
    free(shares->tet_begins);
    free(shares->tet_list);
    free(shares->inner_begins);
    free(shares->inner_list);
    *shares = (struct tetlodi_page_shares){0};
}

uint64_t tetlodi_page_shares_bytes(const struct tetlodi_replay *whole)
{
    return whole->tets * (uint64_t)8 + whole->vertices * (uint64_t)12;
}

static void find_owners(struct tetlodi_page_shares *shares)
{
    const uint32_t *corners = shares->whole->corners;
    memset(shares->owner, 0xff, shares->vertices * sizeof *shares->owner);
    for (size_t i = 0; i < 4 * (size_t)shares->tets; i++) {
        uint32_t page = shares->page_of[i / 4], *owner;
        if (page == NOT_THERE)
            continue;
        owner = &shares->owner[corners[i]];
        page = page == TETLOD_NONE ? PAGE_SEAM : page; // it is left out
        *owner = *owner == PAGE_NOBODY || *owner == page ? page : PAGE_SEAM;
    }
    for (uint32_t v = 0; v < shares->seams_known; v++)
        shares->owner[v] = shares->seams[v] ? PAGE_SEAM : shares->owner[v];
    for (uint32_t v = 0; v < shares->vertices; v++)
        shares->local[v] = shares->owner[v] == PAGE_SEAM ? PAGE_SEAM : 0;
}

/* Numbers by what has them, in ascending order: one of [count] things, or none (above `things`). */
static void sort_out(const uint32_t *whose, uint32_t count, uint32_t things, uint32_t *begins, uint32_t *list)
{
    memset(begins, 0, (things + (size_t)2) * sizeof *begins);
    for (uint32_t i = 0; i < count; i++)
        if (whose[i] < things)
            begins[whose[i] + 2]++;
    for (uint32_t k = 2; k < things + 2; k++)
        begins[k] += begins[k - 1];
    for (uint32_t i = 0; i < count; i++)
        if (whose[i] < things)
            list[begins[whose[i] + 1]++] = i;
}

enum { TET_LIST, INNER_LIST, LISTS };

static int make_list(void *opaque, uint32_t kind)
{
    struct tetlodi_page_shares *shares = opaque;
    if (kind == INNER_LIST) {
        find_owners(shares);
        sort_out(shares->owner, shares->vertices, shares->pages, shares->inner_begins, shares->inner_list);
    } else {
        sort_out(shares->page_of, shares->tets, shares->pages, shares->tet_begins, shares->tet_list);
    }
    return 1;
}

void tetlodi_page_shares_sort(struct tetlodi_page_shares *shares, struct tetlodi_helpers *helpers)
{
    tetlodi_helpers_start(helpers, make_list, shares, LISTS);
    tetlodi_helpers_wait(helpers);
}

/* ---- a page's vertices */

/* Where a vertex at a seam sits, or where it may. */
static struct tetlodi_seat *seat_of(const struct tetlodi_page_part *part, uint32_t vertex)
{
    uint32_t at = vertex * 0x9e3779b1u;
    for (at = (at ^ at >> 15) & part->mask; part->seats[at].vertex != PAGE_NOBODY; at = (at + 1) & part->mask)
        if (part->seats[at].vertex == vertex)
            break;
    return &part->seats[at];
}

/* So many free seats, in which those at seams sit that are listed. 0 if out of memory. */
static int make_seats(struct tetlodi_page_part *part, size_t places)
{
    free(part->seats);
    part->seats = malloc(places * sizeof *part->seats);
    part->mask = (uint32_t)(places - 1);
    if (!part->seats)
        return 0;
    memset(part->seats, 0xff, places * sizeof *part->seats); // PAGE_NOBODY
    for (uint32_t i = 0; i < part->at_seams_count; i++)
        seat_of(part, part->at_seams[i])->vertex = part->at_seams[i];
    return 1;
}

/* Lists a vertex at a seam that has no seat. Half of the seats are taken at most. 0 if out of memory. */
static int take_seat(struct tetlodi_page_part *part, uint32_t vertex)
{
    if (part->at_seams_count > part->mask / 2 && !make_seats(part, 2 * (part->mask + (size_t)1)))
        return 0;
    part->at_seams[part->at_seams_count++] = seat_of(part, vertex)->vertex = vertex;
    return 1;
}

enum { AHEAD = 8 }; /* tetrahedra whose corners are fetched before they are looked at */

/* The corners as they are outside, where there is room for them, and those at seams, each once. 0 if out of memory. */
static int gather_corners(struct tetlodi_page_part *part, const struct tetlodi_page_shares *shares)
{
    const uint32_t *corners = shares->whole->corners;
    uint32_t *to = part->replay.corners;
    for (uint32_t t = 0; t < part->tet_count; t++) {
        if (t + 2 * AHEAD < part->tet_count)
            __builtin_prefetch(corners + 4 * (size_t)part->tets[t + 2 * AHEAD]);
        for (int c = 0; t + AHEAD < part->tet_count && c < 4; c++)
            __builtin_prefetch(shares->local + corners[4 * (size_t)part->tets[t + AHEAD] + (unsigned)c]);
        for (const uint32_t *v = corners + 4 * (size_t)part->tets[t], *end = v + 4; v < end; v++) {
            if (shares->local[*v] == PAGE_SEAM && seat_of(part, *v)->vertex == PAGE_NOBODY && !take_seat(part, *v))
                return 0;
            if (to)
                *to++ = *v;
        }
    }
    return 1;
}

/* The corners, and the vertices at seams. 0 if out of memory. A page has few of these: seats for all that it could have
 * would take more than the page. */
static int list_seams(struct tetlodi_page_part *part, const struct tetlodi_page_shares *shares)
{
    size_t places = 512;
    while (places < 2 * (size_t)part->at_seams_count)
        places *= 2;
    if (part->at_seams)
        return make_seats(part, places);
    part->at_seams = malloc((4 * (size_t)part->tet_count + 1) * sizeof *part->at_seams);
    if (!part->at_seams || !make_seats(part, places) || !gather_corners(part, shares))
        return 0;
    ascending_sort(part->at_seams, part->at_seams_count);
    uint32_t *less = realloc(part->at_seams, (part->at_seams_count + (size_t)1) * sizeof *less);
    part->at_seams = less ? less : part->at_seams;
    return 1;
}

int tetlodi_page_part_list(struct tetlodi_page_part *part, const struct tetlodi_page_shares *shares, uint32_t adds)
{
    const uint32_t *inner = shares->inner_list + shares->inner_begins[part->page];
    uint32_t inner_count = shares->inner_begins[part->page + 1] - shares->inner_begins[part->page];
    int done = list_seams(part, shares);
    part->listed_count = inner_count + part->at_seams_count;
    part->room = part->listed_count + adds;
    part->listed = malloc((part->room + (size_t)1) * sizeof *part->listed);
    part->seams = calloc(part->room + (size_t)1, 1);
    part->own = malloc((part->room + (size_t)1) * sizeof *part->own);
    done = done && part->listed && part->seams && part->own;
    for (uint32_t v = 0; done && v < part->room; v++)
        part->own[v] = v;
    for (uint32_t n = 0, i = 0, s = 0; done && n < part->listed_count; n++) {
        int seam = i == inner_count || (s < part->at_seams_count && part->at_seams[s] < inner[i]);
        part->seams[n] = (uint8_t)seam;
        part->listed[n] = seam ? part->at_seams[s] : inner[i];
        if (seam)
            seat_of(part, part->at_seams[s])->number = n;
        else
            shares->local[inner[i]] = n;
        s += (uint32_t)seam;
        i += (uint32_t)!seam;
    }
    return done;
}

uint32_t tetlodi_page_part_number(const struct tetlodi_page_part *part, const struct tetlodi_page_shares *shares,
                                  uint32_t vertex)
{
    uint32_t number = shares->local[vertex];
    return number == PAGE_SEAM ? seat_of(part, vertex)->number : number;
}

/* ---- the part */

void tetlodi_page_part_set(struct tetlodi_page_part *part, const struct tetlodi_page_shares *shares, uint32_t page)
{
    *part = (struct tetlodi_page_part){.page = page,
                                       .tets = shares->tet_list + shares->tet_begins[page],
                                       .tet_count = shares->tet_begins[page + 1] - shares->tet_begins[page]};
}

void tetlodi_page_part_fini(struct tetlodi_page_part *part)
{
    free(part->listed);
    free(part->seams);
    free(part->at_seams);
    free(part->seats);
    free(part->own);
    if (part->columns)
        tetlodi_replay_fini(&part->replay);
    free(part->columns);
    *part = (struct tetlodi_page_part){0};
}

/* A vertex's codes; values come of these, where there are any. */
static inline void copy_row(struct tetlodi_column *to, size_t row, const struct tetlodi_column *from, size_t from_row,
                            int position)
{
    size_t n = to->components;
    for (size_t i = 0; i < n; i++)
        to->codes[row * n + i] = from->codes[from_row * n + i];
    for (size_t i = 0; i < n && to->values; i++)
        to->values[row * n + i] = scale_value(&to->scale, position ? (unsigned)i : 0, to->codes[row * n + i]);
}

enum { POOL_OF_TET = 6 }; /* places in the pool of stars: four, and what is left between runs */

/* The part's columns as they are outside. Nobody asks for values of fields before they are put back. */
static int gather_columns(struct tetlodi_page_part *part, const struct tetlodi_replay *whole, size_t vertices)
{
    for (uint32_t c = 0; c < whole->column_count; c++) {
        struct tetlodi_column *column = &part->columns[c];
        const struct tetlodi_column *from = &whole->columns[c];
        size_t count = vertices * from->components;
        *column = (struct tetlodi_column){.scale = from->scale, .components = from->components,
                                          .frame_bytes = from->frame_bytes};
        if (!TETLODI_ROOM(&part->memory, column->codes, column->codes_capacity, count) ||
            (c == 0 && !TETLODI_ROOM(&part->memory, column->values, column->values_capacity, count)))
            return 0;
        for (size_t v = 0; v < part->listed_count; v++)
            copy_row(column, v, from, part->listed[v], c == 0);
    }
    return 1;
}

int tetlodi_page_part_gather(struct tetlodi_page_part *part, const struct tetlodi_page_shares *shares,
                             uint32_t vertices, uint32_t tets, uint64_t most)
{
    const struct tetlodi_replay *whole = shares->whole;
    struct tetlodi_replay *replay = &part->replay;
    const size_t all = part->tet_count + (size_t)tets, spare = 256; // what a record may bring back is laid there first
    part->memory = (struct tetlodi_memory){.most = most};
    part->columns = calloc(whole->column_count, sizeof *part->columns);
    tetlodi_replay_init(replay, &part->memory, part->columns, part->columns ? whole->column_count : 0);
    if (!part->columns ||
        !TETLODI_ROOM(&part->memory, replay->corners, replay->corners_capacity, 4 * (all + spare)) ||
        !tetlodi_page_part_list(part, shares, vertices) || !gather_columns(part, whole, part->room) ||
        !tetlodi_replay_room(replay, part->room, all) ||
        !TETLODI_ROOM(&part->memory, replay->pool, replay->pool_capacity, POOL_OF_TET * all))
        return 0;
    for (size_t i = 0; i < 4 * (size_t)part->tet_count; i++)
        replay->corners[i] = tetlodi_page_part_number(part, shares, replay->corners[i]);
    replay->vertices = part->listed_count;
    replay->tets = part->tet_count;
    tetlodi_page_part_next(part);
    if (!tetlodi_replay_base(replay))
        return 0;
    for (uint32_t v = 0; v < part->listed_count; v++)
        replay->stars[v].leaf = whole->stars[part->listed[v]].leaf;
    return 1;
}

void tetlodi_page_part_next(struct tetlodi_page_part *part)
{
    struct tetlodi_part_run *run = &part->runs[part->run_count++];
    run->vertex = part->replay.vertices;
    run->tet = part->replay.tets;
    for (uint32_t v = run->vertex; v <= part->room; v++)
        part->listed[v] = run->first_vertex + (v - run->vertex);
}

void tetlodi_page_part_begin(const struct tetlodi_page_part *part, struct tetlodi_recorder *recorder,
                             const struct tetlodi_recorder *whole, uint32_t vertices, uint32_t tets)
{
    uint32_t begins[2] = {0, part->replay.vertices};
    const struct tetlodi_page_lists lists = {.begins = begins, .vertices = part->own, .seams = part->seams};
    for (uint32_t f = 0; f + 1 < part->replay.column_count; f++)
        memcpy(recorder->field_models[f].copied, whole->field_models[f].copied,
               sizeof recorder->field_models[f].copied);
    tetlodi_page_begin(recorder, &lists, 0, vertices, tets);
}

/* A vertex that has split or is new. */
static void put_vertex(const struct tetlodi_page_part *part, struct tetlodi_replay *whole, uint32_t vertex)
{
    uint32_t to = page_part_outside(part, vertex);
    for (uint32_t c = 0; c < whole->column_count; c++)
        copy_row(&whole->columns[c], to, &part->columns[c], vertex, c == 0);
    whole->stars[to].leaf = part->replay.stars[vertex].leaf;
}

/* Nothing else has changed: a corner of a tetrahedron that was there is what it was, or a new vertex. */
void tetlodi_page_part_scatter(const struct tetlodi_page_part *part, const struct tetlodi_page_shares *shares)
{
    struct tetlodi_replay *whole = shares->whole;
    const struct tetlodi_replay *replay = &part->replay;
    const uint32_t known = part->listed_count, *listed = part->listed, *from = replay->corners;
    for (uint32_t t = 0; t < part->tet_count; t++, from += 4)
        if (from[0] >= known || from[1] >= known || from[2] >= known || from[3] >= known)
            for (uint32_t *to = whole->corners + 4 * (size_t)part->tets[t], c = 0; c < 4; c++)
                to[c] = listed[from[c]];
    for (const struct tetlodi_part_run *run = part->runs, *last = run + part->run_count - 1; run <= last; run++) {
        const uint32_t *end = replay->corners + 4 * (size_t)(run < last ? run[1].tet : replay->tets);
        for (uint32_t *to = whole->corners + 4 * (size_t)run->first_tet; from < end; from++)
            *to++ = listed[*from];
    }
    for (uint32_t v = known; v < replay->vertices; v++) {
        uint32_t parent = replay->parents[v];
        put_vertex(part, whole, v);
        if (parent < known)
            put_vertex(part, whole, parent);
        whole->parents[listed[v]] = listed[parent];
    }
}

void tetlodi_page_part_shrink(struct tetlodi_page_part *part)
{
    struct tetlodi_replay *replay = &part->replay;
    for (uint32_t s = 0; s < replay->splits; s++)
        replay->log[s].vertex = page_part_outside(part, replay->log[s].vertex);
    free(part->seats);
    free(part->listed);
    free(part->seams);
    free(part->at_seams);
    free(part->own);
    part->seats = NULL;
    part->listed = part->at_seams = part->own = NULL;
    part->seams = NULL;
    for (uint32_t c = 0; c < replay->column_count; c++) {
        TETLODI_FREE(&part->memory, part->columns[c].codes, part->columns[c].codes_capacity);
        TETLODI_FREE(&part->memory, part->columns[c].values, part->columns[c].values_capacity);
    }
    TETLODI_FREE(&part->memory, replay->corners, replay->corners_capacity);
    TETLODI_FREE(&part->memory, replay->parents, replay->parents_capacity);
    TETLODI_FREE(&part->memory, replay->pool, replay->pool_capacity);
    TETLODI_FREE(&part->memory, replay->stars, replay->stars_capacity);
}

