/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * In: a mesh, and the pages of its next level. 1. The page of each tetrahedron, and who has each vertex: one page, or
 * several (a seam). 2. Each page, on any thread: a mesh of its tetrahedra in numbers of its own, its records, and the
 * result put back where it belongs; what it adds has places that the table of pages says before. 3. The logs of all
 * pages, one after the other, between those of pages that were there before. Numbers inside a page are in the order of
 * those outside, which is all that a record depends on.
 */
#include "format/read/page_parts.h"

#include <stdlib.h>
#include <string.h>

#include "format/coding/record_fields.h"
#include "format/fail.h"
#include "format/read/page_runs.h"

/* Who has a vertex, beside the number of a page. */
#define NOBODY UINT32_MAX
#define SEAM (UINT32_MAX - 1)

enum { RECORDS = 96 }; /* whose fields are decoded in one go, as on one thread */

/* A vertex at a seam and its number in the page. */
struct seat {
    uint32_t vertex, number; /* NOBODY: the seat is free */
};

/* A page as a mesh of its own. */
struct part {
    uint32_t page;                       /* of the group */
    const uint32_t *tets;                /* its tetrahedra */
    uint32_t tet_count;
    uint32_t *listed, listed_count;      /* its vertices, ascending */
    uint8_t *seams;                      /* [listed_count] */
    struct seat *seats;                  /* [mask + 1] of its vertices at seams, by a hash of their numbers */
    uint32_t mask;
    uint32_t first_vertex, first_tet;    /* that it adds */
    struct tetlodi_memory memory;
    struct tetlodi_column *columns;
    struct tetlodi_replay replay;
    uint64_t labels;
    int unread; /* its frames could not be read */
    int done;   /* it has been put back */
    struct tetlod_error error;
};

struct level {
    struct tetlod_cursor *cursor;
    uint32_t number, vertices, tets;     /* before it */
    const struct tetlodi_coming *coming; /* some of the pages; NULL: all */
    uint32_t seam_count;                 /* vertices at seams */
    uint32_t *page_of;                   /* [tet] */
    uint32_t *owner;                     /* [vertex] */
    uint32_t *local;                     /* [vertex] its number in its page, if it is not at a seam */
    uint32_t *tet_begins, *tet_list;     /* [page + 1]; tetrahedra page by page, ascending */
    uint32_t *inner_begins, *inner_list; /* the same of vertices that are not at seams */
    struct part *parts;
    uint32_t part_count;
    uint64_t share;                      /* of memory that a part may take */
};

/* ---- what pages have */

enum { TETS_A_TASK = 1 << 14 };

/* The page of a tetrahedron that is in one of this level: the level before has the last one that it was in. */
static uint32_t page_of_tet(const struct level *level, uint32_t t)
{
    const struct tetlod_cursor *cursor = level->cursor;
    const struct tetlodi_group *group = cursor->group;
    const uint32_t *corners = cursor->replay.corners + 4 * (size_t)t;
    if (level->coming) {
        uint32_t last = cursor->choice->page_of[t], first_level = cursor->file->index.pages.first_level;
        if (last == NOT_THERE)
            return NOT_THERE;
        if (level->number == first_level ? last != TETLOD_NONE : last - group[-1].first_page >= group[-1].page_count)
            return TETLOD_NONE;
    }
    uint32_t page = tetlodi_page_at_corners(group->tree, cursor->columns[0].values, corners);
    return !level->coming || level->coming->pages[group->first_page + page] ? page : TETLOD_NONE;
}

static int find_some(void *opaque, uint32_t task)
{
    const struct level *level = opaque;
    uint32_t end = level->tets - task * (uint32_t)TETS_A_TASK;
    end = task * (uint32_t)TETS_A_TASK + (end < TETS_A_TASK ? end : TETS_A_TASK);
    for (uint32_t t = task * (uint32_t)TETS_A_TASK; t < end; t++)
        level->page_of[t] = page_of_tet(level, t);
    return 1;
}

static void find_owners(struct level *level)
{
    const uint32_t *corners = level->cursor->replay.corners;
    memset(level->owner, 0xff, level->vertices * sizeof *level->owner);
    for (size_t i = 0; i < 4 * (size_t)level->tets; i++) {
        uint32_t page = level->page_of[i / 4], *owner;
        if (page == NOT_THERE)
            continue;
        owner = &level->owner[corners[i]];
        page = page == TETLOD_NONE ? SEAM : page; // a page that is left out
        *owner = *owner == NOBODY || *owner == page ? page : SEAM;
    }
    for (uint32_t v = 0; v < level->vertices; v++)
        level->seam_count += level->owner[v] == SEAM;
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

static int compare_numbers(const void *a, const void *b)
{
    uint32_t x = *(const uint32_t *)a, y = *(const uint32_t *)b;
    return x < y ? -1 : x > y;
}

/* Where a vertex at a seam sits, or where it may. */
static struct seat *seat_of(const struct part *part, uint32_t vertex)
{
    uint32_t at = vertex * 0x9e3779b1u;
    for (at = (at ^ at >> 15) & part->mask; part->seats[at].vertex != NOBODY; at = (at + 1) & part->mask)
        if (part->seats[at].vertex == vertex)
            break;
    return &part->seats[at];
}

/* The vertices at seams, ascending, each once; NULL: out of memory. */
static uint32_t *list_seams(const struct level *level, struct part *part, uint32_t *out_count)
{
    const uint32_t *corners = level->cursor->replay.corners;
    size_t most = 4 * (size_t)part->tet_count, places = 16;
    most = most < level->seam_count ? most : level->seam_count;
    while (places < 2 * most)
        places *= 2;
    uint32_t *list = malloc((most + 1) * sizeof *list);
    part->seats = malloc(places * sizeof *part->seats);
    part->mask = (uint32_t)(places - 1);
    *out_count = 0;
    if (!list || !part->seats) {
        free(list);
        return NULL;
    }
    memset(part->seats, 0xff, places * sizeof *part->seats); // NOBODY
    for (uint32_t t = 0; t < part->tet_count; t++)
        for (const uint32_t *v = corners + 4 * (size_t)part->tets[t], *end = v + 4; v < end; v++) {
            struct seat *seat = level->owner[*v] == SEAM ? seat_of(part, *v) : NULL;
            if (seat && seat->vertex == NOBODY)
                list[(*out_count)++] = seat->vertex = *v;
        }
    qsort(list, *out_count, sizeof *list, compare_numbers);
    return list;
}

/* The part's vertices: those that it alone has, and those at seams. */
static int list_vertices(const struct level *level, struct part *part)
{
    const uint32_t *inner = level->inner_list + level->inner_begins[part->page];
    uint32_t inner_count = level->inner_begins[part->page + 1] - level->inner_begins[part->page], seam_count;
    uint32_t *seams = list_seams(level, part, &seam_count);
    part->listed_count = inner_count + seam_count;
    part->listed = malloc((part->listed_count + (size_t)1) * sizeof *part->listed);
    part->seams = malloc(part->listed_count + (size_t)1);
    int done = seams && part->listed && part->seams;
    for (uint32_t n = 0, i = 0, s = 0; done && n < part->listed_count; n++) {
        int seam = i == inner_count || (s < seam_count && seams[s] < inner[i]);
        part->seams[n] = (uint8_t)seam;
        part->listed[n] = seam ? seams[s] : inner[i];
        if (seam)
            seat_of(part, seams[s])->number = n;
        else
            level->local[inner[i]] = n;
        s += (uint32_t)seam;
        i += (uint32_t)!seam;
    }
    free(seams);
    return done;
}

/* ---- one page */

static uint32_t local_number(const struct level *level, const struct part *part, uint32_t vertex)
{
    return level->owner[vertex] == SEAM ? seat_of(part, vertex)->number : level->local[vertex];
}

static uint32_t number_outside(const struct part *part, uint32_t vertex)
{
    return vertex < part->listed_count ? part->listed[vertex] : part->first_vertex + (vertex - part->listed_count);
}

static const struct tetlodi_page *row_of(const struct level *level, const struct part *part)
{
    return &level->cursor->file->index.pages.pages[level->cursor->group->first_page + part->page];
}

/* Codes and values of a vertex. */
static inline void copy_row(struct tetlodi_column *to, size_t row, const struct tetlodi_column *from, size_t from_row,
                            size_t n)
{
    for (size_t i = 0; i < n; i++) {
        to->codes[row * n + i] = from->codes[from_row * n + i];
        to->values[row * n + i] = from->values[from_row * n + i];
    }
}

/* The part's columns as they are outside. */
static int gather_columns(const struct level *level, struct part *part)
{
    const struct tetlodi_replay *whole = &level->cursor->replay;
    size_t vertices = part->listed_count + (size_t)row_of(level, part)->vertices;
    for (uint32_t c = 0; c < whole->column_count; c++) {
        struct tetlodi_column *column = &part->columns[c];
        const struct tetlodi_column *from = &whole->columns[c];
        size_t n = from->components;
        *column = (struct tetlodi_column){.scale = from->scale, .components = from->components,
                                          .frame_bytes = from->frame_bytes};
        if (!tetlodi_column_room(column, &part->memory, vertices, 0))
            return 0;
        for (size_t v = 0; v < part->listed_count; v++)
            copy_row(column, v, from, part->listed[v], n);
    }
    return 1;
}

/* The part as a base mesh. */
static int gather(const struct level *level, struct part *part)
{
    const struct tetlodi_replay *whole = &level->cursor->replay;
    const struct tetlodi_page *row = row_of(level, part);
    struct tetlodi_replay *replay = &part->replay;
    part->memory = (struct tetlodi_memory){.most = level->share};
    part->columns = calloc(whole->column_count, sizeof *part->columns);
    tetlodi_replay_init(replay, &part->memory, part->columns, part->columns ? whole->column_count : 0);
    if (!part->columns || !list_vertices(level, part) || !gather_columns(level, part) ||
        !tetlodi_replay_room(replay, part->listed_count + (size_t)row->vertices, part->tet_count + (size_t)row->tets))
        return 0;
    for (size_t t = 0; t < part->tet_count; t++)
        for (size_t c = 0; c < 4; c++)
            replay->corners[4 * t + c] = local_number(level, part, whole->corners[4 * (size_t)part->tets[t] + c]);
    replay->vertices = part->listed_count;
    replay->tets = part->tet_count;
    if (!tetlodi_replay_base(replay))
        return 0;
    for (uint32_t v = 0; v < part->listed_count; v++)
        replay->stars[v].leaf = whole->stars[part->listed[v]].leaf;
    return 1;
}

/* Puts the part back. What it writes is in no other part. */
static void scatter(const struct level *level, const struct part *part)
{
    struct tetlodi_replay *whole = &level->cursor->replay;
    const struct tetlodi_replay *replay = &part->replay;
    for (size_t t = 0; t < replay->tets; t++) {
        size_t to = t < part->tet_count ? part->tets[t] : part->first_tet + (t - part->tet_count);
        for (size_t c = 0; c < 4; c++)
            whole->corners[4 * to + c] = number_outside(part, replay->corners[4 * t + c]);
    }
    for (uint32_t v = 0; v < replay->vertices; v++) {
        uint32_t to = number_outside(part, v);
        if (v < part->listed_count && part->seams[v])
            continue;
        for (uint32_t c = 0; c < whole->column_count; c++)
            copy_row(&whole->columns[c], to, &part->columns[c], v, whole->columns[c].components);
        if (v >= part->listed_count)
            whole->parents[to] = number_outside(part, replay->parents[v]);
        whole->stars[to].leaf = replay->stars[v].leaf;
    }
}

/* All but the part's log. */
static void shrink(struct part *part)
{
    struct tetlodi_replay *replay = &part->replay;
    free(part->seats);
    part->seats = NULL;
    for (uint32_t c = 0; c < replay->column_count; c++) {
        TETLODI_FREE(&part->memory, part->columns[c].codes, part->columns[c].codes_capacity);
        TETLODI_FREE(&part->memory, part->columns[c].values, part->columns[c].values_capacity);
    }
    TETLODI_FREE(&part->memory, replay->corners, replay->corners_capacity);
    TETLODI_FREE(&part->memory, replay->parents, replay->parents_capacity);
    TETLODI_FREE(&part->memory, replay->pool, replay->pool_capacity);
    TETLODI_FREE(&part->memory, replay->stars, replay->stars_capacity);
}

static enum tetlod_status decode_fields(struct tetlodi_recorder *recorder, struct tetlod_error *error)
{
    if (!recorder->log || !recorder->log->count)
        return TETLOD_OK;
    if (!tetlodi_fields_room(recorder))
        return tetlodi_no_room(recorder->replay->memory, error);
    for (uint32_t c = 1; c < recorder->replay->column_count; c++) {
        tetlodi_field_decode(recorder, recorder->log, c);
        if (recorder->coders[c].bad)
            return tetlodi_fail_field(recorder->coders[c].bad, error);
    }
    tetlodi_field_log_clear(recorder->log);
    return TETLOD_OK;
}

/* The records, of frames that the coders were started on. */
static enum tetlod_status decode_records(struct tetlodi_recorder *recorder, uint32_t page, struct tetlod_error *error)
{
    struct tetlodi_replay *replay = recorder->replay;
    while (replay->vertices < recorder->most_vertices) {
        if (recorder->log && recorder->log->count == RECORDS)
            TETLOD_TRY(decode_fields(recorder, error));
        struct tetlod_error later = {0};
        enum tetlod_status status = tetlodi_record_decode(recorder, &later);
        if (status == TETLOD_OK)
            continue;
        TETLOD_TRY(decode_fields(recorder, error)); // of records before: that failure is the first
        *error = later;
        return status;
    }
    TETLOD_TRY(decode_fields(recorder, error));
    TETLOD_TRY(tetlodi_check_ends(recorder, error));
    if (replay->tets != recorder->most_tets)
        return tetlodi_fail(error, TETLOD_ERR_STREAM, "page %u has fewer tetrahedra than its row says", page);
    return TETLOD_OK;
}

/* With the models of a page, in the numbers of the part. */
static enum tetlod_status decode_with(const struct level *level, struct part *part, struct tetlodi_recorder *recorder,
                                      struct tetlod_error *error)
{
    const struct tetlodi_recorder *whole = &level->cursor->recorder;
    const struct tetlodi_page *row = row_of(level, part);
    uint32_t begins[2] = {0, part->listed_count};
    uint32_t *own = malloc((part->listed_count + (size_t)1) * sizeof *own);
    struct tetlodi_page_lists lists = {.begins = begins, .vertices = own, .seams = part->seams};
    if (!own)
        return tetlodi_fail_nomem(error, "a page", part->listed_count * sizeof *own);
    for (uint32_t v = 0; v < part->listed_count; v++)
        own[v] = v;
    for (uint32_t f = 0; f + 1 < part->replay.column_count; f++)
        memcpy(recorder->field_models[f].copied, whole->field_models[f].copied,
               sizeof recorder->field_models[f].copied);
    recorder->labels = whole->labels;
    recorder->max_labels = whole->max_labels;
    tetlodi_page_begin(recorder, &lists, 0, row->vertices, row->tets);
    enum tetlod_status status = decode_records(recorder, part->page, error);
    part->labels = recorder->labels - whole->labels;
    free(own);
    return status;
}

/* Reads the part's frames and decodes them. */
static enum tetlod_status decode_frames(const struct level *level, struct part *part, struct tetlodi_recorder *recorder,
                                        struct tetlod_error *error)
{
    struct tetlod_cursor *cursor = level->cursor;
    uint32_t count = part->replay.column_count;
    uint8_t **frames = calloc(count, sizeof *frames);
    enum tetlod_status status = frames ? TETLOD_OK : tetlodi_fail_nomem(error, "a page", count * sizeof *frames);
    for (uint32_t c = 0; c < count && status == TETLOD_OK; c++) {
        size_t size;
        status = tetlodi_read_page_frame(cursor->file, level->number, part->page, cursor->parts[c], &frames[c], &size,
                                         error);
        if (status == TETLOD_OK)
            tetlodi_decode_start(&recorder->coders[c], cursor->file->index.slowest, frames[c], size);
        else
            part->unread = 1;
    }
    if (status == TETLOD_OK)
        status = decode_with(level, part, recorder, error);
    for (uint32_t c = 0; c < count && frames; c++)
        free(frames[c]);
    free(frames);
    return status;
}

/* A page of which a reader has some and not others keeps its tetrahedra in its part of space (SPEC 7.6). */
static enum tetlod_status check_cell(const struct level *level, const struct part *part, struct tetlod_error *error)
{
    const struct tetlodi_replay *replay = &part->replay;
    const struct tetlodi_cut *tree = level->cursor->group->tree;
    for (uint32_t t = 0; level->coming && t < replay->tets; t++)
        if (tetlodi_page_at_corners(tree, part->columns[0].values, replay->corners + 4 * (size_t)t) != part->page)
            return tetlodi_fail(error, TETLOD_ERR_STREAM, "page %u has tetrahedra of another one", part->page);
    return TETLOD_OK;
}

static int decode_part(void *opaque, uint32_t number)
{
    const struct level *level = opaque;
    struct part *part = &level->parts[number];
    struct tetlod_error *error = &part->error;
    struct tetlodi_recorder recorder = {0};
    error->status = gather(level, part) ? TETLOD_OK : tetlodi_no_room(&part->memory, error);
    if (error->status == TETLOD_OK)
        error->status = tetlodi_recorder_init(&recorder, &part->replay, error);
    if (error->status == TETLOD_OK)
        error->status = decode_frames(level, part, &recorder, error);
    if (error->status == TETLOD_OK)
        error->status = check_cell(level, part, error);
    part->done = error->status == TETLOD_OK;
    if (part->done)
        scatter(level, part);
    tetlodi_recorder_fini(&recorder);
    shrink(part);
    return error->status == TETLOD_OK;
}

/* ---- all pages */

static void part_fini(struct part *part)
{
    free(part->listed);
    free(part->seams);
    free(part->seats);
    if (part->columns)
        tetlodi_replay_fini(&part->replay);
    free(part->columns);
}

static void level_fini(struct level *level)
{
    for (uint32_t i = 0; i < level->part_count; i++)
        part_fini(&level->parts[i]);
    free(level->parts);
    free(level->page_of);
    free(level->owner);
    free(level->local);
    free(level->tet_begins);
    free(level->tet_list);
    free(level->inner_begins);
    free(level->inner_list);
}

/* Takes back what a part has put into the mesh. */
static void undo_part(const struct level *level, const struct part *part)
{
    struct tetlodi_replay *whole = &level->cursor->replay;
    uint32_t records = part->replay.records, end = part->first_vertex + row_of(level, part)->vertices;
    for (uint32_t s = part->replay.splits; s-- > 0;) {
        uint32_t v = part->replay.log[s].vertex, number = number_outside(part, v);
        whole->stars[number].leaf = 0;
        if (!(part->replay.log[s].tets & SPLIT_FIRST))
            continue;
        records--;
        for (uint32_t c = 0; c < whole->column_count; c++)
            tetlodi_column_put(&whole->columns[c], c == 0, number, &part->columns[c], records);
    }
    for (size_t i = 0; i < 4 * (size_t)part->tet_count; i++) {
        uint32_t *corner = &whole->corners[4 * (size_t)part->tets[i / 4] + i % 4];
        while (*corner >= part->first_vertex && *corner < end)
            *corner = whole->parents[*corner];
    }
}

static int allocate(struct level *level)
{
    const struct tetlodi_replay *replay = &level->cursor->replay;
    size_t pages = level->cursor->group->page_count;
    level->vertices = replay->vertices;
    level->tets = replay->tets;
    level->page_of = malloc((level->tets + (size_t)1) * sizeof *level->page_of);
    level->owner = malloc((level->vertices + (size_t)1) * sizeof *level->owner);
    level->local = malloc((level->vertices + (size_t)1) * sizeof *level->local);
    level->tet_begins = malloc((pages + 2) * sizeof *level->tet_begins);
    level->tet_list = malloc((level->tets + (size_t)1) * sizeof *level->tet_list);
    level->inner_begins = malloc((pages + 2) * sizeof *level->inner_begins);
    level->inner_list = malloc((level->vertices + (size_t)1) * sizeof *level->inner_list);
    level->parts = calloc(pages, sizeof *level->parts);
    return level->page_of && level->owner && level->local && level->tet_begins && level->tet_list &&
           level->inner_begins && level->inner_list && level->parts;
}

/* Where the pages begin that may come: those of the level, behind it; or all of them, behind the levels before. */
static uint32_t first_page(const struct level *level, uint32_t *vertex, uint32_t *tet)
{
    const struct tetlod_cursor *cursor = level->cursor;
    uint32_t root = cursor->file->index.pages.first_level - 1;
    *vertex = level->coming ? cursor->vertices[root] : level->vertices;
    *tet = level->coming ? cursor->tets[root] : level->tets;
    return level->coming ? 0 : cursor->group->first_page;
}

/* Which pages there are to decode, and what each has. */
static void list_parts(struct level *level)
{
    struct tetlod_cursor *cursor = level->cursor;
    const struct tetlodi_group *group = cursor->group;
    const struct tetlodi_coming *coming = level->coming;
    uint32_t vertex, tet, p = first_page(level, &vertex, &tet);
    tetlodi_helpers_start(cursor->helpers, find_some, level, (level->tets + TETS_A_TASK - 1) / TETS_A_TASK);
    tetlodi_helpers_wait(cursor->helpers);
    find_owners(level);
    sort_out(level->page_of, level->tets, group->page_count, level->tet_begins, level->tet_list);
    sort_out(level->owner, level->vertices, group->page_count, level->inner_begins, level->inner_list);
    for (; p < group->first_page + group->page_count; p++) {
        const struct tetlodi_page *row = &cursor->file->index.pages.pages[p];
        uint32_t own = p - group->first_page;
        if (coming && !coming->next[p])
            continue;
        if (row->vertices && (!coming || coming->pages[p]))
            level->parts[level->part_count++] =
                (struct part){.page = own,
                              .tets = level->tet_list + level->tet_begins[own],
                              .tet_count = level->tet_begins[own + 1] - level->tet_begins[own],
                              .first_vertex = vertex,
                              .first_tet = tet};
        vertex += row->vertices;
        tet += row->tets;
    }
}

/* Each tetrahedron comes from a page that its page needs, so that what is taken out later is nobody's. */
static enum tetlod_status check_needed(const struct level *level, struct tetlod_error *error)
{
    const struct tetlod_cursor *cursor = level->cursor;
    const struct tetlodi_page_table *table = &cursor->file->index.pages;
    const struct tetlodi_group *group = cursor->group;
    uint32_t known_page = TETLOD_NONE, known = TETLOD_NONE;
    for (uint32_t t = 0; level->coming && level->number > table->first_level && t < level->tets; t++) {
        uint32_t page = level->page_of[t], last = cursor->choice->page_of[t];
        if (page >= group->page_count || (page == known_page && last == known))
            continue;
        const struct tetlodi_page *row = &table->pages[group->first_page + page];
        uint32_t i = row->needed_begin, end = i + row->needed_count;
        while (i < end && table->needed[i] != last - group[-1].first_page)
            i++;
        if (i == end)
            return tetlodi_fail(error, TETLOD_ERR_STREAM, "page %u needs page %u of the level before, and says not so",
                                page, last - group[-1].first_page);
        known_page = page;
        known = last;
    }
    return TETLOD_OK;
}

/* Of some pages: which tetrahedra were in them last. */
static void remember_pages(const struct level *level)
{
    const struct tetlodi_choice *choice = level->cursor->choice;
    const uint32_t first = level->cursor->group->first_page;
    for (uint32_t t = 0; t < level->tets; t++)
        if (level->page_of[t] < level->cursor->group->page_count)
            choice->page_of[t] = first + level->page_of[t];
    for (uint32_t i = 0; i < level->part_count; i++) {
        const struct part *part = &level->parts[i];
        for (size_t t = part->tet_count; t < part->replay.tets; t++)
            choice->page_of[part->first_tet + (t - part->tet_count)] = first + part->page;
    }
}

/* Room in the log for that of all parts, between what other pages have there. */
static enum tetlod_status open_log(struct level *level, struct tetlodi_log_place *at, struct tetlod_error *error)
{
    struct tetlod_cursor *cursor = level->cursor;
    struct tetlodi_replay *replay = &cursor->replay;
    struct tetlodi_log_place end = {replay->splits, replay->records, replay->label};
    *at = end;
    for (uint32_t i = 0; i < level->part_count; i++) {
        end.split += level->parts[i].replay.splits;
        end.record += level->parts[i].replay.records;
        end.label += level->parts[i].replay.label;
        if (level->coming)
            cursor->choice->logs[cursor->group->first_page + level->parts[i].page] =
                (struct tetlodi_page_log){level->parts[i].replay.records, level->parts[i].replay.label};
    }
    if (!tetlodi_replay_log_room(replay, end.split, end.record, end.label))
        return tetlodi_no_room(&cursor->memory, error);
    if (!level->coming)
        return TETLOD_OK;
    struct tetlodi_moves moves = {0};
    int done = tetlodi_moves_of_log(&moves, cursor, level->coming->next);
    if (done) {
        tetlodi_move_log(cursor, &moves);
        remember_pages(level);
        *at = tetlodi_log_of_root(cursor);
    }
    tetlodi_moves_fini(&moves);
    return done ? TETLOD_OK : tetlodi_fail_nomem(error, "pages in the log", end.label / 8);
}

/* The logs of all parts, each behind those of the pages before it. */
static enum tetlod_status put_logs(struct level *level, struct tetlod_error *error)
{
    struct tetlod_cursor *cursor = level->cursor;
    const struct tetlodi_page_table *table = &cursor->file->index.pages;
    struct tetlodi_recorder *recorder = &cursor->recorder;
    struct tetlodi_log_place at;
    uint32_t vertex, tet, i = 0;
    for (uint32_t k = 0; k < level->part_count; k++)
        recorder->labels += level->parts[k].labels;
    if (recorder->labels > recorder->max_labels)
        return tetlodi_fail(error, TETLOD_ERR_STREAM, "its records split larger stars than go with its bytes");
    TETLOD_TRY(open_log(level, &at, error));
    for (uint32_t p = first_page(level, &vertex, &tet); p < table->page_count; p++) {
        const struct part *part = &level->parts[i];
        bool is_part = i < level->part_count && p == cursor->group->first_page + part->page;
        if (!is_part && !(level->coming && level->coming->next[p]))
            continue;
        if (is_part)
            tetlodi_replay_place(&cursor->replay, &part->replay, part->listed, part->listed_count, part->first_vertex,
                                 &at);
        i += is_part;
        vertex += table->pages[p].vertices;
        tet += table->pages[p].tets;
        at.split += table->pages[p].vertices;
        at.record += is_part ? part->replay.records : cursor->choice->logs[p].records;
        at.label += is_part ? part->replay.label : cursor->choice->logs[p].labels;
    }
    tetlodi_replay_set(&cursor->replay, vertex, tet, &at);
    return TETLOD_OK;
}

static enum tetlod_status decode_all(struct level *level, struct tetlod_error *error)
{
    struct tetlod_cursor *cursor = level->cursor;
    const uint32_t threads = cursor->file->options.threads;
    list_parts(level);
    TETLOD_TRY(check_needed(level, error));
    level->share = (cursor->memory.most - cursor->memory.used) / (threads ? threads : 1);
    tetlodi_helpers_start(cursor->helpers, decode_part, level, level->part_count);
    tetlodi_helpers_wait(cursor->helpers);
    for (uint32_t i = 0; i < level->part_count; i++) {
        if (level->parts[i].error.status == TETLOD_OK)
            continue;
        cursor->unread = level->parts[i].unread;
        *error = level->parts[i].error;
        return error->status;
    }
    return put_logs(level, error);
}

enum tetlod_status tetlodi_decode_pages(struct tetlod_cursor *cursor, uint32_t level,
                                        const struct tetlodi_coming *coming, struct tetlod_error *error)
{
    struct level all = {.cursor = cursor, .number = level, .coming = coming};
    const struct tetlodi_replay *replay = &cursor->replay;
    uint64_t counted = replay->tets * (uint64_t)8 + replay->vertices * (uint64_t)12;
    if (!tetlodi_count(&cursor->memory, counted))
        return tetlodi_no_room(&cursor->memory, error);
    enum tetlod_status status = allocate(&all) ? decode_all(&all, error)
                                               : tetlodi_fail_nomem(error, "a level in pages", counted);
    for (uint32_t i = 0; i < all.part_count && status != TETLOD_OK; i++)
        if (all.parts[i].done)
            undo_part(&all, &all.parts[i]);
    level_fini(&all);
    cursor->memory.used -= counted;
    return status;
}
