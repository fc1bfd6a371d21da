/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * Splitting deals the star of a vertex out to two vertices and appends tetrahedra to four stars; undoing drops them
 * from the stars' ends and merges the two. Both keep the stars ascending without sorting, because what arrives last has
 * the highest number. A star is a run in a pool; runs come in sizes four to an octave and freed ones are used again.
 */
#include "format/coding/replay.h"

#include <string.h>

#include "format/common/coder.h"

void tetlodi_replay_init(struct tetlodi_replay *replay, struct tetlodi_memory *memory, struct tetlodi_column *columns,
                         uint32_t column_count)
{
    memset(replay, 0, sizeof *replay);
    replay->memory = memory;
    replay->columns = columns;
    replay->column_count = column_count;
    for (int i = 0; i < STAR_CLASSES; i++)
        replay->free_runs[i] = TETLOD_NONE;
}

void tetlodi_replay_drop(struct tetlodi_replay *replay)
{
    struct tetlodi_memory *memory = replay->memory;
    for (uint32_t i = 0; i < replay->column_count; i++) {
        struct tetlodi_column *column = &replay->columns[i];
        TETLODI_FREE(memory, column->values, column->values_capacity);
        TETLODI_FREE(memory, column->before, column->before_capacity);
        TETLODI_FREE(memory, column->other_values, column->other_capacity);
    }
    TETLODI_FREE(memory, replay->parents, replay->parents_capacity);
    TETLODI_FREE(memory, replay->pool, replay->pool_capacity);
    TETLODI_FREE(memory, replay->stars, replay->stars_capacity);
    TETLODI_FREE(memory, replay->log, replay->log_capacity);
    TETLODI_FREE(memory, replay->labels, replay->labels_capacity);
}

void tetlodi_replay_fini(struct tetlodi_replay *replay)
{
    tetlodi_replay_drop(replay);
    for (uint32_t i = 0; i < replay->column_count; i++)
        TETLODI_FREE(replay->memory, replay->columns[i].codes, replay->columns[i].codes_capacity);
    TETLODI_FREE(replay->memory, replay->corners, replay->corners_capacity);
}

int tetlodi_column_room(struct tetlodi_column *column, struct tetlodi_memory *memory, size_t vertices, size_t records)
{
    size_t n = column->components;
    return TETLODI_ROOM(memory, column->codes, column->codes_capacity, vertices * n) &&
           TETLODI_ROOM(memory, column->values, column->values_capacity, vertices * n) &&
           TETLODI_ROOM(memory, column->before, column->before_capacity, records * n);
}

int tetlodi_replay_room(struct tetlodi_replay *replay, size_t vertices, size_t tets)
{
    struct tetlodi_memory *memory = replay->memory;
    return TETLODI_ROOM(memory, replay->corners, replay->corners_capacity, tets * 4) &&
           TETLODI_ROOM(memory, replay->parents, replay->parents_capacity, vertices) &&
           TETLODI_ROOM(memory, replay->stars, replay->stars_capacity, vertices);
}

/* Runs of 4, 5, 6, 7, 8, 10, 12, 14, 16, 20, ... elements: four classes to an octave. */
static unsigned class_of(uint32_t size)
{
    if (size <= 4)
        return 0;
    unsigned octave = bit_length(size - 1) - 3;
    return 4 * octave + (((size - 1) >> octave) & 3) + 1;
}

static uint32_t class_room(unsigned kind)
{
    return (4 + (kind & 3)) << (kind >> 2);
}

static int run_take(struct tetlodi_replay *replay, uint32_t size, struct tetlodi_star *star)
{
    unsigned kind = class_of(size);
    star->room = class_room(kind);
    if (replay->free_runs[kind] != TETLOD_NONE) {
        star->at = replay->free_runs[kind];
        replay->free_runs[kind] = replay->pool[star->at];
        return 1;
    }
    if (replay->pool_size + star->room >= TETLOD_NONE ||
        !TETLODI_ROOM(replay->memory, replay->pool, replay->pool_capacity, replay->pool_size + star->room))
        return 0;
    star->at = (uint32_t)replay->pool_size;
    replay->pool_size += star->room;
    return 1;
}

static void run_give(struct tetlodi_replay *replay, const struct tetlodi_star *star)
{
    unsigned kind = class_of(star->room);
    replay->pool[star->at] = replay->free_runs[kind];
    replay->free_runs[kind] = star->at;
}

/* Makes room for `size` elements in a star; those there stay. */
static int star_room(struct tetlodi_replay *replay, struct tetlodi_star *star, uint32_t size)
{
    if (size <= star->room)
        return 1;
    struct tetlodi_star larger = *star;
    if (!run_take(replay, size, &larger))
        return 0;
    memcpy(replay->pool + larger.at, replay->pool + star->at, star->size * sizeof *replay->pool);
    run_give(replay, star);
    *star = larger;
    return 1;
}

int tetlodi_replay_base(struct tetlodi_replay *replay)
{
    struct tetlodi_star *stars = replay->stars;
    for (uint32_t v = 0; v < replay->vertices; v++) {
        stars[v] = (struct tetlodi_star){0};
        replay->parents[v] = v;
    }
    for (size_t i = 0; i < (size_t)replay->tets * 4; i++)
        stars[replay->corners[i]].room++;
    for (uint32_t v = 0; v < replay->vertices; v++)
        if (!run_take(replay, stars[v].room, &stars[v]))
            return 0;
    for (size_t i = 0; i < (size_t)replay->tets * 4; i++) {
        struct tetlodi_star *star = &stars[replay->corners[i]];
        replay->pool[star->at + star->size++] = (uint32_t)i;
    }
    replay->all_vertices = replay->vertices;
    replay->all_tets = replay->tets;
    return 1;
}

int tetlodi_replay_log(struct tetlodi_replay *replay, uint32_t vertex, uint32_t tets, int first)
{
    if (!TETLODI_ROOM(replay->memory, replay->log, replay->log_capacity, (size_t)replay->all_splits + 1))
        return 0;
    replay->log[replay->all_splits++] = (struct tetlodi_split){vertex, tets | (first ? SPLIT_FIRST : 0)};
    replay->all_vertices++;
    replay->all_tets += tets;
    return 1;
}

int tetlodi_replay_log_labels(struct tetlodi_replay *replay, const uint8_t *labels, uint32_t count)
{
    if (!TETLODI_ROOM(replay->memory, replay->labels, replay->labels_capacity, (replay->label + count) / 8 + 5))
        return 0;
    uint8_t *byte = replay->labels + (replay->label >> 3);
    unsigned have = replay->label & 7;
    for (uint32_t start = 0; start < count; start += 32, byte += 4) {
        uint64_t bits = 0;
        for (uint32_t i = count - start < 32 ? count : start + 32; i-- > start;)
            bits = bits << 1 | labels[i];
        bits = bits << have | (*byte & ((1u << have) - 1));
        for (int i = 0; i < 5; i++)
            byte[i] = (uint8_t)(bits >> 8 * i);
    }
    return 1;
}

/* The log's labels from number `at` on, the first in the lowest bit: 32 of them, those from `count` on 0. */
static uint32_t labels_at(const struct tetlodi_replay *replay, size_t at, uint32_t count)
{
    const uint8_t *b = replay->labels + (at >> 3);
    uint64_t bits = b[0] | (uint64_t)b[1] << 8 | (uint64_t)b[2] << 16 | (uint64_t)b[3] << 24 | (uint64_t)b[4] << 32;
    uint32_t mask = count < 32 ? (UINT32_C(1) << count) - 1 : UINT32_MAX;
    return (uint32_t)(bits >> (at & 7)) & mask;
}

/* Moves those of a star's tetrahedra that are labelled to its vertex's child. How many stay. */
static uint32_t deal_out(struct tetlodi_replay *replay, uint32_t *all, uint32_t size, uint32_t *theirs, uint32_t child)
{
    uint32_t kept = 0;
    for (uint32_t start = 0; start < size; start += 32) {
        uint32_t end = size - start < 32 ? size : start + 32, labels = labels_at(replay, replay->label + start,
                                                                                 size - start);
        for (uint32_t goes = labels; goes; goes &= goes - 1) {
            uint32_t corner = all[start + (uint32_t)__builtin_ctz(goes)];
            replay->corners[corner] = child;
            *theirs++ = corner;
        }
        for (uint32_t i = start; i < end; i++, labels >>= 1) {
            all[kept] = all[i];
            kept += ~labels & 1;
        }
    }
    return kept;
}

/* Adds `count` tetrahedra from `first` on to the stars of their corners. If memory is out, some are added. */
static int add_tets(struct tetlodi_replay *replay, uint32_t first, uint32_t count)
{
    if (!count) // there may be no corners at all
        return 1;
    const uint32_t *corners = replay->corners + 4 * (size_t)first;
    for (uint32_t c = 0; c < 4 * count; c++)
        __builtin_prefetch(replay->pool + replay->stars[corners[c]].at + replay->stars[corners[c]].size);
    for (uint32_t c = 0; c < 4 * count; c++) {
        struct tetlodi_star *star = &replay->stars[corners[c]];
        if (star->size == star->room && !star_room(replay, star, star->size + 1))
            return 0;
        replay->pool[star->at + star->size++] = 4 * first + c;
    }
    return 1;
}

int tetlodi_replay_apply(struct tetlodi_replay *replay)
{
    const struct tetlodi_split *split = &replay->log[replay->splits];
    uint32_t v = split->vertex, added = split->tets & ~SPLIT_FIRST, child = replay->vertices, moved = 0;
    struct tetlodi_star *star = &replay->stars[v], *other = &replay->stars[child];
    uint32_t size = star->size;
    for (uint32_t i = 0; i < size; i += 32)
        moved += (uint32_t)__builtin_popcount(labels_at(replay, replay->label + i, size - i));
    /* All room first, by the most that can be needed, so that a failure changes nothing. */
    if (!run_take(replay, moved + added, other))
        return 0;
    other->size = moved;
    star->size = deal_out(replay, replay->pool + star->at, size, replay->pool + other->at, child);
    replay->label += size;
    replay->vertices++;
    replay->splits++;
    replay->parents[child] = v;
    uint32_t first = replay->tets;
    replay->tets += added;
    if (add_tets(replay, first, added))
        return 1;
    tetlodi_replay_undo(replay);
    return 0;
}

/* Takes the last `count` tetrahedra out of their stars, at whose ends they are. */
static void drop_tets(struct tetlodi_replay *replay, uint32_t count)
{
    while (count--) {
        uint32_t t = --replay->tets;
        const uint32_t *corners = replay->corners + 4 * (size_t)t;
        for (int c = 4; c--;) {
            struct tetlodi_star *star = &replay->stars[corners[c]];
            star->size -= star->size && replay->pool[star->at + star->size - 1] / 4 == t;
        }
    }
}

int tetlodi_replay_undo(struct tetlodi_replay *replay)
{
    const struct tetlodi_split *split = &replay->log[replay->splits - 1];
    uint32_t v = split->vertex, child = replay->vertices - 1;
    struct tetlodi_star *star = &replay->stars[v], *other = &replay->stars[child];
    /* Every tetrahedron to drop is in both stars. Room for the rest is taken before anything changes. */
    uint32_t dropped = split->tets & ~SPLIT_FIRST, both = star->size + other->size;
    if (both > 2 * dropped && !star_room(replay, star, both - 2 * dropped))
        return 0;
    drop_tets(replay, dropped);
    uint32_t *all = replay->pool + star->at, kept = star->size, moved = other->size, size = kept + moved;
    const uint32_t *theirs = replay->pool + other->at;
    for (uint32_t at = size; moved;) { /* from the back, in place */
        if (kept && all[kept - 1] > theirs[moved - 1]) {
            all[--at] = all[--kept];
        } else {
            replay->corners[theirs[--moved]] = v;
            all[--at] = theirs[moved];
        }
    }
    star->size = size;
    run_give(replay, other);
    replay->label -= size;
    replay->vertices--;
    replay->splits--;
    return 1;
}

int tetlodi_replay_log_room(struct tetlodi_replay *replay, size_t splits, size_t records, size_t labels)
{
    int done = TETLODI_ROOM(replay->memory, replay->log, replay->log_capacity, splits) &&
               TETLODI_ROOM(replay->memory, replay->labels, replay->labels_capacity, labels / 8 + 9);
    for (uint32_t c = 0; c < replay->column_count && done; c++) {
        struct tetlodi_column *column = &replay->columns[c];
        done = TETLODI_ROOM(replay->memory, column->before, column->before_capacity, records * column->components);
    }
    return done;
}

void tetlodi_labels_copy(uint8_t *to, size_t to_at, const struct tetlodi_replay *from, size_t from_at, size_t count)
{
    for (size_t done = 0; done < count; done += 32) {
        uint32_t some = count - done < 32 ? (uint32_t)(count - done) : 32;
        uint8_t *byte = to + ((to_at + done) >> 3);
        unsigned have = (to_at + done) & 7;
        uint64_t bits = (uint64_t)labels_at(from, from_at + done, some) << have, theirs = ((UINT64_C(1) << some) - 1)
                                                                                          << have;
        for (int i = 0; i < 5; i++)
            byte[i] = (uint8_t)((byte[i] & ~(theirs >> 8 * i)) | bits >> 8 * i);
    }
}

void tetlodi_replay_place(struct tetlodi_replay *replay, const struct tetlodi_log_place *place,
                          const struct tetlodi_replay *part, const struct tetlodi_log_place *from,
                          const struct tetlodi_log_place *to)
{
    for (uint32_t c = 0; c < replay->column_count; c++) {
        struct tetlodi_column *column = &replay->columns[c];
        size_t n = column->components;
        memcpy(column->before + place->record * n, part->columns[c].before + from->record * n,
               (to->record - from->record) * n * sizeof(int64_t));
    }
    tetlodi_labels_copy(replay->labels, place->label, part, from->label, to->label - from->label);
    memcpy(replay->log + place->split, part->log + from->split, (to->split - from->split) * sizeof *replay->log);
}

void tetlodi_replay_set(struct tetlodi_replay *replay, uint32_t vertices, uint32_t tets,
                        const struct tetlodi_log_place *end)
{
    replay->vertices = vertices;
    replay->tets = tets;
    replay->splits = (uint32_t)end->split;
    replay->records = (uint32_t)end->record;
    replay->label = end->label;
    for (uint32_t c = 0; c < replay->column_count; c++)
        replay->columns[c].records = replay->records;
    tetlodi_replay_forget(replay);
}

int tetlodi_replay_restar(struct tetlodi_replay *replay)
{
    struct tetlodi_star *stars = replay->stars;
    size_t corners = (size_t)replay->tets * 4;
    replay->pool_size = 0;
    for (int i = 0; i < STAR_CLASSES; i++)
        replay->free_runs[i] = TETLOD_NONE;
    for (uint32_t v = 0; v < replay->vertices; v++)
        stars[v] = (struct tetlodi_star){.leaf = stars[v].leaf};
    for (size_t i = 0; i < corners; i++)
        stars[replay->corners[i]].room++;
    for (uint32_t v = 0; v < replay->vertices; v++)
        if (!run_take(replay, stars[v].room, &stars[v]))
            return 0;
    for (size_t i = 0; i < corners; i++) {
        struct tetlodi_star *star = &stars[replay->corners[i]];
        replay->pool[star->at + star->size++] = (uint32_t)i;
    }
    return 1;
}

void tetlodi_column_exchange(struct tetlodi_column *column, int position, uint32_t vertex, uint32_t record)
{
    size_t n = column->components;
    for (unsigned c = 0; c < n && record < column->records; c++) {
        int64_t *now = &column->codes[vertex * n + c], *other = &column->before[record * n + c];
        int64_t code = *now;
        *now = *other;
        *other = code;
        column->values[vertex * n + c] = scale_value(&column->scale, position ? c : 0, *now);
    }
}

void tetlodi_column_put(struct tetlodi_column *column, int position, uint32_t vertex,
                        const struct tetlodi_column *from, uint32_t record)
{
    size_t n = column->components;
    for (unsigned c = 0; c < n; c++) {
        column->codes[vertex * n + c] = from->before[record * n + c];
        column->values[vertex * n + c] = scale_value(&column->scale, position ? c : 0, from->before[record * n + c]);
    }
}

void tetlodi_replay_exchange(struct tetlodi_replay *replay, uint32_t vertex, uint32_t record)
{
    for (uint32_t i = 0; i < replay->column_count; i++)
        tetlodi_column_exchange(&replay->columns[i], i == 0, vertex, record);
}

static int goes_on(const struct tetlodi_replay *replay)
{
    return replay->splits < replay->all_splits && !(replay->log[replay->splits].tets & SPLIT_FIRST);
}

int tetlodi_replay_forward(struct tetlodi_replay *replay)
{
    uint32_t start = replay->splits, vertex = replay->log[start].vertex;
    do {
        if (!tetlodi_replay_apply(replay)) {
            while (replay->splits > start)
                tetlodi_replay_undo(replay);
            return 0;
        }
    } while (goes_on(replay));
    tetlodi_replay_exchange(replay, vertex, replay->records++);
    return 1;
}

int tetlodi_replay_back(struct tetlodi_replay *replay)
{
    uint32_t end = replay->splits;
    do {
        if (!tetlodi_replay_undo(replay)) {
            while (replay->splits < end)
                tetlodi_replay_apply(replay);
            return 0;
        }
    } while (!(replay->log[replay->splits].tets & SPLIT_FIRST));
    tetlodi_replay_exchange(replay, replay->log[replay->splits].vertex, --replay->records);
    return 1;
}

void tetlodi_replay_forget(struct tetlodi_replay *replay)
{
    replay->all_vertices = replay->vertices;
    replay->all_tets = replay->tets;
    replay->all_splits = replay->splits;
    replay->all_records = replay->records;
}
