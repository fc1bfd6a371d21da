/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * In: a mesh, and the pages of its next level. 1. The page of each tetrahedron, and who has each vertex: one page, or
 * several (a seam). 2. Each page, on any thread: a mesh of its tetrahedra in numbers of its own, its records, and the
 * result put back where it belongs; what it adds has places that the table of pages says before. 3. The logs of all
 * pages, one after the other. Numbers inside a page are in the order of those outside, which is all that a record
 * depends on.
 */
#include "format/read/page_parts.h"

#include <stdlib.h>
#include <string.h>

#include "format/coding/record_fields.h"
#include "format/fail.h"

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
    struct tetlod_error error;
};

struct level {
    struct tetlod_cursor *cursor;
    uint32_t number, vertices, tets;     /* before it */
    uint32_t seam_count;                 /* vertices at seams */
    uint32_t *page_of;                   /* [tet] */
    uint32_t *owner;                     /* [vertex] */
    uint32_t *local;                     /* [vertex] its number in its page, if it is not at a seam */
    uint32_t *tet_begins, *tet_list;     /* [page + 1]; tetrahedra page by page, ascending */
    uint32_t *inner_begins, *inner_list; /* the same of vertices that are not at seams */
    struct part *parts;
    uint32_t part_count;
    uint64_t share;                      /* of memory that a part may take */
    /* what is put back after a failure */
    uint32_t *corners;
    int64_t **codes; /* [column] */
    uint8_t *leaves;
};

/* ---- what pages have */

enum { TETS_A_TASK = 1 << 14 };

static int find_some(void *opaque, uint32_t task)
{
    const struct level *level = opaque;
    const struct tetlodi_replay *replay = &level->cursor->replay;
    const double *positions = replay->columns[0].values;
    uint32_t end = level->tets - task * (uint32_t)TETS_A_TASK;
    end = task * (uint32_t)TETS_A_TASK + (end < TETS_A_TASK ? end : TETS_A_TASK);
    for (uint32_t t = task * (uint32_t)TETS_A_TASK; t < end; t++) {
        const double *points[4];
        double middle[3];
        for (int c = 0; c < 4; c++)
            points[c] = positions + 3 * (size_t)replay->corners[4 * (size_t)t + (size_t)c];
        tetlodi_middle_of_box(points, middle);
        level->page_of[t] = tetlodi_page_at(level->cursor->group->tree, middle);
    }
    return 1;
}

static void find_owners(struct level *level)
{
    const uint32_t *corners = level->cursor->replay.corners;
    memset(level->owner, 0xff, level->vertices * sizeof *level->owner);
    for (size_t i = 0; i < 4 * (size_t)level->tets; i++) {
        uint32_t page = level->page_of[i / 4], *owner = &level->owner[corners[i]];
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
    for (uint32_t c = 0; c < level->cursor->replay.column_count && level->codes; c++)
        free(level->codes[c]);
    free(level->parts);
    free(level->page_of);
    free(level->owner);
    free(level->local);
    free(level->tet_begins);
    free(level->tet_list);
    free(level->inner_begins);
    free(level->inner_list);
    free(level->corners);
    free(level->codes);
    free(level->leaves);
}

/* What is there before the level. */
static int remember(struct level *level)
{
    const struct tetlodi_replay *replay = &level->cursor->replay;
    size_t corners = 4 * (size_t)level->tets;
    level->corners = malloc((corners + 1) * sizeof *level->corners);
    level->codes = calloc(replay->column_count, sizeof *level->codes);
    level->leaves = malloc(level->vertices + (size_t)1);
    int done = level->corners && level->codes && level->leaves;
    for (uint32_t c = 0; c < replay->column_count && done; c++) {
        size_t count = level->vertices * (size_t)replay->columns[c].components;
        level->codes[c] = malloc((count + 1) * sizeof *level->codes[c]);
        done = level->codes[c] != NULL;
        if (done)
            memcpy(level->codes[c], replay->columns[c].codes, count * sizeof *level->codes[c]);
    }
    if (done && corners)
        memcpy(level->corners, replay->corners, corners * sizeof *level->corners);
    for (uint32_t v = 0; v < level->vertices && done; v++)
        level->leaves[v] = (uint8_t)replay->stars[v].leaf;
    return done;
}

/* Puts back what was there before the level. */
static void put_back(const struct level *level)
{
    struct tetlodi_replay *replay = &level->cursor->replay;
    memcpy(replay->corners, level->corners, 16 * (size_t)level->tets);
    for (uint32_t c = 0; c < replay->column_count; c++) {
        struct tetlodi_column *column = &replay->columns[c];
        for (size_t i = 0; i < level->vertices * (size_t)column->components; i++) {
            column->codes[i] = level->codes[c][i];
            column->values[i] = scale_value(&column->scale, c ? 0 : (unsigned)(i % 3), column->codes[i]);
        }
    }
    for (uint32_t v = 0; v < level->vertices; v++)
        replay->stars[v].leaf = level->leaves[v];
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
           level->inner_begins && level->inner_list && level->parts && remember(level);
}

/* Which pages there are to decode, and what each has. */
static void list_parts(struct level *level)
{
    struct tetlod_cursor *cursor = level->cursor;
    const struct tetlodi_group *group = cursor->group;
    uint32_t vertex = level->vertices, tet = level->tets;
    tetlodi_helpers_start(cursor->helpers, find_some, level, (level->tets + TETS_A_TASK - 1) / TETS_A_TASK);
    tetlodi_helpers_wait(cursor->helpers);
    if (cursor->chosen) {
        struct tetlodi_page_choice choice = {cursor->chosen + group->first_page, level->number, cursor->left_out};
        tetlodi_page_leave_out(&choice, level->tets, level->page_of);
    }
    find_owners(level);
    sort_out(level->page_of, level->tets, group->page_count, level->tet_begins, level->tet_list);
    sort_out(level->owner, level->vertices, group->page_count, level->inner_begins, level->inner_list);
    for (uint32_t p = 0; p < group->page_count; p++) {
        const struct tetlodi_page *row = &cursor->file->index.pages.pages[group->first_page + p];
        if (!row->vertices || (cursor->chosen && !cursor->chosen[group->first_page + p]))
            continue;
        level->parts[level->part_count++] = (struct part){.page = p,
                                                          .tets = level->tet_list + level->tet_begins[p],
                                                          .tet_count = level->tet_begins[p + 1] - level->tet_begins[p],
                                                          .first_vertex = vertex,
                                                          .first_tet = tet};
        vertex += row->vertices;
        tet += row->tets;
    }
}

/* The logs of all parts, behind the cursor's. */
static enum tetlod_status append_parts(struct level *level, struct tetlod_error *error)
{
    struct tetlod_cursor *cursor = level->cursor;
    struct tetlodi_recorder *recorder = &cursor->recorder;
    for (uint32_t i = 0; i < level->part_count; i++) {
        struct part *part = &level->parts[i];
        recorder->labels += part->labels;
        if (recorder->labels > recorder->max_labels)
            return tetlodi_fail(error, TETLOD_ERR_STREAM, "its records split larger stars than go with its bytes");
        if (!tetlodi_replay_append(&cursor->replay, &part->replay, part->listed, part->listed_count,
                                   part->first_vertex))
            return tetlodi_no_room(&cursor->memory, error);
        part_fini(part);
        *part = (struct part){0};
    }
    return TETLOD_OK;
}

static enum tetlod_status decode_all(struct level *level, struct tetlod_error *error)
{
    struct tetlod_cursor *cursor = level->cursor;
    const uint32_t threads = cursor->file->options.threads;
    list_parts(level);
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
    return append_parts(level, error);
}

enum tetlod_status tetlodi_decode_pages(struct tetlod_cursor *cursor, uint32_t level, struct tetlod_error *error)
{
    struct level all = {.cursor = cursor, .number = level};
    struct tetlodi_replay *replay = &cursor->replay;
    uint32_t splits = replay->splits, records = replay->records;
    size_t label = replay->label;
    uint64_t counted = replay->tets * (uint64_t)24 + replay->vertices * (uint64_t)16;
    for (uint32_t c = 0; c < replay->column_count; c++)
        counted += replay->vertices * (uint64_t)replay->columns[c].components * 8;
    if (!tetlodi_count(&cursor->memory, counted))
        return tetlodi_no_room(&cursor->memory, error);
    bool begins = allocate(&all);
    enum tetlod_status status = begins ? decode_all(&all, error)
                                       : tetlodi_fail_nomem(error, "a level in pages", replay->tets * (uint64_t)40);
    if (status != TETLOD_OK && begins) {
        put_back(&all);
        replay->splits = splits;
        replay->records = records;
        replay->label = label;
        replay->vertices = all.vertices;
        replay->tets = all.tets;
        tetlodi_replay_forget(replay);
        for (uint32_t c = 0; c < replay->column_count; c++)
            replay->columns[c].records = records;
    }
    level_fini(&all);
    cursor->memory.used -= counted;
    return status;
}
