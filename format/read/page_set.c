/* SPDX-License-Identifier: BSD-3-Clause */
/* Which pages are wanted, what they need, and where their bytes are (SPEC 7.6). */
#include "format/read/page_set.h"

#include <stdlib.h>
#include <string.h>

#include "format/fail.h"
#include "format/read/page_choice.h"
#include "format/read/span_list.h"

static enum tetlod_status fail_memory(const char *what, uint64_t needed, uint64_t most, struct tetlod_error *error)
{
    return tetlodi_fail(error, TETLOD_ERR_LIMIT,
                        "%s take %llu bytes of memory, and %llu are allowed: take fewer or coarser ones", what,
                        (unsigned long long)needed, (unsigned long long)most);
}

static const struct tetlodi_page_table *table_of(const struct tetlod_page_set *set)
{
    return &set->file->index.pages;
}

/* The number of a page among those of all groups; TETLOD_NONE: there is none. */
static uint32_t number_of(const struct tetlod_file *file, uint32_t level, uint32_t page)
{
    const struct tetlodi_group *group = tetlodi_group_of(&file->index.pages, level);
    return group && page < group->page_count ? group->first_page + page : TETLOD_NONE;
}

static enum tetlod_status fail_page(uint32_t level, uint32_t page, struct tetlod_error *error)
{
    return tetlodi_fail(error, TETLOD_ERR_ARGUMENT, "level %u has no page %u", level, page);
}

/* Adds all that the pages need, the finest first. */
static void close_set(struct tetlod_page_set *set)
{
    const struct tetlodi_page_table *table = table_of(set);
    for (uint32_t g = table->group_count; g-- > 1;) {
        const struct tetlodi_group *group = &table->groups[g];
        for (uint32_t p = group->first_page; p < group->first_page + group->page_count; p++)
            for (uint32_t i = 0; set->has[p] && i < table->pages[p].needed_count; i++)
                set->has[group[-1].first_page + table->needed[table->pages[p].needed_begin + i]] = 1;
    }
}

/* ---- places */

static void page_box(const struct tetlod_file *file, const struct tetlodi_page *page, double low[3], double high[3])
{
    for (unsigned axis = 0; axis < 3; axis++) {
        low[axis] = tetlodi_page_box(file->index.info.bounds, axis, page->box[axis]);
        high[axis] = tetlodi_page_box(file->index.info.bounds, axis, page->box[3 + axis]);
    }
}

/* A ball's distance has a rounding error of a few parts in 2^52: a page that it nearly meets is taken, too. */
static bool meets(const struct tetlod_place *place, const double low[3], const double high[3])
{
    double squares = 0, radius = place->radius * (1 + 0x1p-40);
    for (unsigned axis = 0; axis < 3; axis++) {
        double from = place->low[axis], to = place->radius > 0 ? from : place->high[axis];
        double gap = from > high[axis] ? from - high[axis] : to < low[axis] ? low[axis] - to : 0;
        if (gap > 0 && !(place->radius > 0))
            return false;
        squares += gap * gap;
    }
    return !(squares > radius * radius);
}

static void add_place(struct tetlod_page_set *set, const struct tetlod_place *place)
{
    const struct tetlodi_page_table *table = table_of(set);
    for (uint32_t g = 0; g < table->group_count && table->first_level + g <= place->level; g++) {
        const struct tetlodi_group *group = &table->groups[g];
        for (uint32_t p = group->first_page; p < group->first_page + group->page_count; p++) {
            double low[3], high[3];
            page_box(set->file, &table->pages[p], low, high);
            set->has[p] |= meets(place, low, high); // also one that adds nothing: its tetrahedra are of the level
        }
    }
}

static enum tetlod_status check_level(const struct tetlod_file *file, uint32_t level, struct tetlod_error *error)
{
    uint32_t levels = file->index.info.level_count;
    if (level >= levels)
        return tetlodi_fail(error, TETLOD_ERR_ARGUMENT, "there is no level %u; the finest is %u", level, levels - 1);
    if (level + 1 == levels && file->index.tail)
        return tetlodi_fail(error, TETLOD_ERR_ARGUMENT,
                            "level %u makes all values exact, and is not in pages: take level %u", level, level - 1);
    return TETLOD_OK;
}

enum tetlod_status tetlod_page_set_new(struct tetlod_page_set **out, const struct tetlod_file *file, uint32_t level,
                                       const struct tetlod_place *places, size_t place_count,
                                       struct tetlod_error *error)
{
    const struct tetlodi_page_table *table = &file->index.pages;
    *out = NULL;
    if (!table->group_count)
        return tetlodi_fail(error, TETLOD_ERR_ARGUMENT, "the stream has no levels in pages");
    TETLOD_TRY(check_level(file, level, error));
    for (size_t i = 0; i < place_count; i++)
        TETLOD_TRY(check_level(file, places[i].level, error));
    struct tetlod_page_set *set = calloc(1, sizeof *set + table->page_count);
    if (!set)
        return tetlodi_fail_nomem(error, "a set of pages", table->page_count);
    set->file = file;
    for (uint32_t g = 0; g < table->group_count && table->first_level + g <= level; g++)
        memset(set->has + table->groups[g].first_page, 1, table->groups[g].page_count);
    for (size_t i = 0; i < place_count; i++)
        add_place(set, &places[i]);
    close_set(set);
    *out = set;
    return TETLOD_OK;
}

void tetlod_page_set_free(struct tetlod_page_set *set)
{
    free(set);
}

/* ---- one page */

enum tetlod_status tetlod_page_set_add(struct tetlod_page_set *set, uint32_t level, uint32_t page,
                                       struct tetlod_error *error)
{
    uint32_t number = number_of(set->file, level, page);
    if (number == TETLOD_NONE)
        return fail_page(level, page, error);
    set->has[number] = 1;
    close_set(set);
    return TETLOD_OK;
}

/* The first page of the next level in the set that needs this one. */
static uint32_t find_dependent(const struct tetlod_page_set *set, uint32_t level, uint32_t page)
{
    const struct tetlodi_page_table *table = table_of(set);
    const struct tetlodi_group *next = tetlodi_group_of(table, level + 1);
    for (uint32_t p = 0; next && p < next->page_count; p++) {
        const struct tetlodi_page *row = &table->pages[next->first_page + p];
        for (uint32_t i = 0; set->has[next->first_page + p] && i < row->needed_count; i++)
            if (table->needed[row->needed_begin + i] == page)
                return p;
    }
    return TETLOD_NONE;
}

enum tetlod_status tetlod_page_set_remove(struct tetlod_page_set *set, uint32_t level, uint32_t page,
                                          struct tetlod_error *error)
{
    uint32_t number = number_of(set->file, level, page), dependent = find_dependent(set, level, page);
    if (number == TETLOD_NONE || !set->has[number])
        return number == TETLOD_NONE ? fail_page(level, page, error)
                                     : tetlodi_fail(error, TETLOD_ERR_ARGUMENT, "page %u of level %u is not in the set",
                                                    page, level);
    if (dependent != TETLOD_NONE)
        return tetlodi_fail(error, TETLOD_ERR_ARGUMENT, "page %u of level %u is needed by page %u of level %u", page,
                            level, dependent, level + 1);
    set->has[number] = 0;
    return TETLOD_OK;
}

int tetlod_page_set_has(const struct tetlod_page_set *set, uint32_t level, uint32_t page)
{
    uint32_t number = number_of(set->file, level, page);
    return number != TETLOD_NONE && set->has[number];
}

uint32_t tetlod_page_count(const struct tetlod_file *file, uint32_t level)
{
    const struct tetlodi_group *group = tetlodi_group_of(&file->index.pages, level);
    return group ? group->page_count : 0;
}

enum tetlod_status tetlod_page(const struct tetlod_file *file, uint32_t level, uint32_t page, struct tetlod_page *out,
                               struct tetlod_error *error)
{
    const struct tetlodi_page_table *table = &file->index.pages;
    uint32_t number = number_of(file, level, page);
    if (number == TETLOD_NONE)
        return fail_page(level, page, error);
    const struct tetlodi_page *row = &table->pages[number];
    *out = (struct tetlod_page){.vertices = row->vertices,
                                .tets = row->tets,
                                .needed_count = row->needed_count,
                                .needed = table->needed + row->needed_begin};
    page_box(file, row, out->low, out->high);
    return TETLOD_OK;
}

/* One part after the other, each the frame of the geometry or of a field. */
static void add_frames(const struct tetlod_file *file, const struct tetlodi_group *group, uint32_t page,
                       const uint32_t *fields, uint32_t field_count, struct tetlodi_span_list *spans)
{
    uint32_t parts = 1 + file->index.info.field_count;
    for (uint32_t part = 0; part < parts; part++) {
        if (!tetlodi_is_wanted(part, fields, field_count))
            continue;
        const struct tetlodi_page_frame *frame = tetlodi_page_frame(&file->index.pages, parts - 1, group, page, part);
        tetlodi_span_add(spans, frame->offset, frame->size);
    }
}

size_t tetlod_page_spans(const struct tetlod_file *file, uint32_t level, uint32_t page, const uint32_t *fields,
                         uint32_t field_count, struct tetlod_span *out, size_t capacity)
{
    const struct tetlodi_group *group = tetlodi_group_of(&file->index.pages, level);
    struct tetlodi_span_list spans = {.out = out, .capacity = capacity};
    if (group && page < group->page_count)
        add_frames(file, group, page, fields, field_count, &spans);
    return spans.count;
}

/* ---- the set */

/* What a cursor with such a mesh takes while it is decoded and when it moves: codes and values, stars, what undoes
 * records, models; arrays that grow have room to spare. */
static uint64_t memory_of(const struct tetlodi_index *index, uint64_t vertices, uint64_t tets, uint32_t components)
{
    uint64_t models = (1 << 20) + index->info.field_count * (uint64_t)sizeof(struct tetlodi_field_models);
    return vertices * (24 * (uint64_t)components + 64) + tets * 72 + models;
}

static uint32_t count_components(const struct tetlod_info *info)
{
    uint32_t components = 3;
    for (uint32_t f = 0; f < info->field_count; f++)
        components += info->fields[f].components;
    return components;
}

void tetlod_page_set_info(const struct tetlod_page_set *set, struct tetlod_page_set_info *out)
{
    const struct tetlodi_page_table *table = table_of(set);
    const struct tetlod_info *info = &set->file->index.info;
    uint32_t root = table->first_level - 1;
    *out = (struct tetlod_page_set_info){
        .level = root, .vertices = info->levels[root].vertices, .tets = info->levels[root].tets};
    for (uint32_t g = 0; g < table->group_count; g++)
        for (uint32_t i = 0; i < table->groups[g].page_count; i++) {
            uint32_t p = table->groups[g].first_page + i;
            if (!set->has[p])
                continue;
            out->level = table->first_level + g;
            out->pages++;
            out->vertices += table->pages[p].vertices;
            out->tets += table->pages[p].tets;
        }
    out->memory = memory_of(&set->file->index, out->vertices, out->tets, count_components(info));
}

static struct tetlod_place no_finer(const struct tetlod_place *place, uint32_t level)
{
    struct tetlod_place coarser = *place;
    coarser.level = place->level < level ? place->level : level;
    return coarser;
}

/* The set with no level finer than `most`. */
static enum tetlod_status make_coarser(struct tetlod_page_set **out, const struct tetlod_file *file, uint32_t level,
                                       const struct tetlod_place *places, size_t place_count, uint32_t most,
                                       struct tetlod_error *error)
{
    struct tetlod_place *coarser = malloc((place_count + 1) * sizeof *coarser);
    if (!coarser)
        return tetlodi_fail_nomem(error, "places", place_count * (uint64_t)sizeof *coarser);
    for (size_t i = 0; i < place_count; i++)
        coarser[i] = no_finer(&places[i], most);
    enum tetlod_status status =
        tetlod_page_set_new(out, file, level < most ? level : most, coarser, place_count, error);
    free(coarser);
    return status;
}

enum tetlod_status tetlod_page_set_fit(struct tetlod_page_set **out, const struct tetlod_file *file, uint32_t level,
                                       const struct tetlod_place *places, size_t place_count, uint64_t memory,
                                       uint32_t *out_level, struct tetlod_error *error)
{
    struct tetlod_page_set_info about;
    uint32_t most = level;
    for (size_t i = 0; i < place_count; i++)
        most = places[i].level > most ? places[i].level : most;
    for (;; most--) {
        TETLOD_TRY(make_coarser(out, file, level, places, place_count, most, error));
        tetlod_page_set_info(*out, &about);
        *out_level = most;
        if (about.memory <= memory)
            return TETLOD_OK;
        tetlod_page_set_free(*out);
        *out = NULL;
        if (most < file->index.pages.first_level)
            return fail_memory("the levels before those in pages", about.memory, memory, error);
    }
}

size_t tetlod_page_set_spans(const struct tetlod_page_set *set, const uint32_t *fields, uint32_t field_count,
                             uint64_t gap, struct tetlod_span *out, size_t capacity)
{
    const struct tetlodi_page_table *table = table_of(set);
    const uint32_t parts = 1 + set->file->index.info.field_count;
    struct tetlodi_span_list spans = {.out = out, .capacity = capacity, .gap = gap};
    for (const struct tetlodi_group *group = table->groups; group < table->groups + table->group_count; group++)
        for (size_t i = 0; i < (size_t)parts * group->page_count; i++) {
            const struct tetlodi_page_place at = tetlodi_page_place(i, group->page_count, parts);
            const struct tetlodi_page_frame *frame = tetlodi_page_frame(table, parts - 1, group, at.page, at.part);
            if (set->has[group->first_page + at.page] && tetlodi_is_wanted(at.part, fields, field_count))
                tetlodi_span_add(&spans, frame->offset, frame->size);
        }
    return spans.count;
}

/* ---- cursors */

/* With the cursor's fields only. */
static enum tetlod_status check_memory(const struct tetlod_cursor *cursor, const struct tetlod_page_set *set,
                                       struct tetlod_error *error)
{
    struct tetlod_page_set_info about;
    uint32_t components = 0;
    for (uint32_t c = 0; c < cursor->replay.column_count; c++)
        components += cursor->columns[c].components;
    tetlod_page_set_info(set, &about);
    uint64_t needed = memory_of(&cursor->file->index, about.vertices, about.tets, components);
    return needed <= cursor->memory.most ? TETLOD_OK : fail_memory("the pages", needed, cursor->memory.most, error);
}

enum tetlod_status tetlod_cursor_select(struct tetlod_cursor *cursor, const struct tetlod_page_set *set,
                                        struct tetlod_error *error)
{
    if (set && set->file != cursor->file)
        return tetlodi_fail(error, TETLOD_ERR_ARGUMENT, "the pages are those of another file");
    if (set)
        TETLOD_TRY(check_memory(cursor, set, error));
    return tetlodi_cursor_choose(cursor, set ? set->has : NULL, error);
}

/* Numbers with all pages of what the cursor has: in the levels before pages the same, then page by page. */
static void put_numbers(const struct tetlod_cursor *cursor, bool of_tets, uint32_t *out)
{
    const struct tetlodi_page_table *table = &cursor->file->index.pages;
    const struct tetlod_level *levels = cursor->file->index.info.levels;
    uint32_t count = of_tets ? cursor->replay.tets : cursor->replay.vertices, done = 0, number = 0;
    uint32_t root = cursor->choice ? table->first_level - 1 : 0;
    uint32_t same = !cursor->choice ? count : (uint32_t)(of_tets ? levels[root].tets : levels[root].vertices);
    for (; done < count && done < same; done++)
        out[done] = number++;
    for (uint32_t p = 0; p < table->page_count && done < count; p++) {
        uint32_t adds = of_tets ? table->pages[p].tets : table->pages[p].vertices;
        for (uint32_t i = 0; i < adds && cursor->choice->has[p] && done < count; i++)
            out[done++] = number + i;
        number += adds;
    }
}

void tetlod_cursor_numbers(const struct tetlod_cursor *cursor, uint32_t *vertices, uint32_t *tets)
{
    if (vertices)
        put_numbers(cursor, false, vertices);
    if (tets)
        put_numbers(cursor, true, tets);
}

void tetlod_cursor_tet_levels(const struct tetlod_cursor *cursor, uint32_t *out)
{
    const struct tetlodi_page_table *table = &cursor->file->index.pages;
    uint32_t page = TETLOD_NONE, level = table->first_level - 1;
    bool some = cursor->choice && cursor->level > level;
    for (uint32_t t = 0; t < cursor->replay.tets; t++) {
        if (some && cursor->choice->page_of[t] != page) { // mostly that of the one before
            page = cursor->choice->page_of[t];
            level = tetlodi_level_of_page(table, page);
        }
        out[t] = some && level < cursor->level ? level : cursor->level;
    }
}
