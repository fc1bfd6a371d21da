/* SPDX-License-Identifier: BSD-3-Clause */
#include "format/coding/page_table.h"

#include <stdlib.h>
#include <string.h>

#include "format/common/allowance.h"

enum { PAGE_BYTES = 24, FRAME_BYTES = 4 + DIGEST_SIZE };

void tetlodi_page_table_fini(struct tetlodi_page_table *table)
{
    free(table->groups);
    free(table->pages);
    free(table->frames);
    free(table->cuts);
    free(table->needed);
    *table = (struct tetlodi_page_table){0};
}

uint64_t tetlodi_page_table_bytes(const struct tetlodi_page_table *table, uint32_t field_count)
{
    return table->group_count * sizeof *table->groups + table->cut_count * sizeof *table->cuts +
           table->needed_count * sizeof *table->needed +
           table->page_count * (sizeof *table->pages + (1 + (uint64_t)field_count) * sizeof *table->frames);
}

const struct tetlodi_group *tetlodi_group_of(const struct tetlodi_page_table *table, uint32_t level)
{
    return level >= table->first_level && level - table->first_level < table->group_count
               ? &table->groups[level - table->first_level]
               : NULL;
}

uint32_t tetlodi_level_of_page(const struct tetlodi_page_table *table, uint32_t page)
{
    uint32_t g = 0;
    while (page != TETLOD_NONE && page >= table->groups[g].first_page + table->groups[g].page_count)
        g++;
    return page == TETLOD_NONE ? table->first_level - 1 : table->first_level + g;
}

struct tetlodi_page_frame *tetlodi_page_frame(const struct tetlodi_page_table *table, uint32_t field_count,
                                              const struct tetlodi_group *group, uint32_t page, uint32_t part)
{
    return &table->frames[((size_t)group->first_page + page) * (1 + (size_t)field_count) + part];
}

uint32_t tetlodi_page_row(uint32_t field_count)
{
    return PAGE_BYTES + FRAME_BYTES * (1 + field_count);
}

bool tetlodi_pages_hold(uint64_t pages, uint64_t bytes)
{
    return is_within(pages * PAGE_MODELS, PAGE_MODELS_FREE, 1, bytes);
}

/* ---- to bytes */

static void put_cut(struct tetlodi_buffer *out, const struct tetlodi_cut *cut)
{
    uint32_t bits;
    memcpy(&bits, &cut->at, sizeof bits);
    tetlodi_put(out, cut->axis, 1);
    tetlodi_put(out, cut->axis == CUT_PAGE ? 0 : bits, 4);
}

static void put_page(struct tetlodi_buffer *out, const struct tetlodi_page *page,
                     const struct tetlodi_page_frame *frames, uint32_t parts)
{
    tetlodi_put(out, page->vertices, 4);
    tetlodi_put(out, page->tets, 4);
    for (int i = 0; i < 6; i++)
        tetlodi_put(out, page->box[i], 2);
    tetlodi_put(out, page->needed_count, 4);
    for (uint32_t part = 0; part < parts; part++) {
        tetlodi_put(out, frames[part].size, 4);
        tetlodi_put_block(out, frames[part].digest, DIGEST_SIZE);
    }
}

void tetlodi_page_table_encode(const struct tetlodi_page_table *table, uint32_t group_count, uint32_t field_count,
                               struct tetlodi_buffer *out)
{
    const struct tetlodi_group *end = table->groups + group_count;
    tetlodi_put(out, table->first_level, 4);
    tetlodi_put(out, group_count, 4);
    for (const struct tetlodi_group *group = table->groups; group < end; group++) {
        tetlodi_put(out, group->page_count, 4);
        tetlodi_put(out, group->node_count, 4);
    }
    for (const struct tetlodi_group *group = table->groups; group < end; group++)
        for (uint32_t i = 0; i < group->node_count; i++)
            put_cut(out, &group->tree[i]);
    uint32_t pages = end[-1].first_page + end[-1].page_count, needed = 0;
    for (uint32_t p = 0; p < pages; p++) {
        put_page(out, &table->pages[p], table->frames + p * (1 + (size_t)field_count), 1 + field_count);
        needed += table->pages[p].needed_count;
    }
    for (uint32_t i = 0; i < needed; i++)
        tetlodi_put(out, table->needed[i], 4);
}

/* ---- lists */

void tetlodi_page_lists_fini(struct tetlodi_page_lists *lists, struct tetlodi_memory *memory)
{
    TETLODI_FREE(memory, lists->page_of, lists->page_of_capacity);
    TETLODI_FREE(memory, lists->begins, lists->begins_capacity);
    TETLODI_FREE(memory, lists->vertices, lists->vertices_capacity);
    TETLODI_FREE(memory, lists->seams, lists->seams_capacity);
    TETLODI_FREE(memory, lists->stamps, lists->stamps_capacity);
}

static void find_pages(const struct tetlodi_replay *replay, const struct tetlodi_group *group, uint32_t *page_of)
{
    const double *positions = replay->columns[0].values;
    struct tetlodi_page_finder finder = tetlodi_page_finder(group->tree);
    for (uint32_t t = 0; t < replay->tets; t++)
        page_of[t] = tetlodi_page_at_corners(&finder, positions, replay->corners + 4 * (size_t)t);
}

/* Lists a vertex for the pages of its tetrahedra: counts it, or puts it behind what is listed there. */
static void list_vertex(struct tetlodi_page_lists *lists, const struct tetlodi_replay *replay, uint32_t v, bool counts)
{
    const struct tetlodi_star *star = &replay->stars[v];
    uint32_t pages = 0;
    for (uint32_t i = 0; i < star->size; i++) {
        uint32_t page = lists->page_of[replay->pool[star->at + i] / 4];
        if (lists->stamps[page] == v + 1)
            continue;
        lists->stamps[page] = v + 1;
        pages++;
        if (counts)
            lists->begins[page + 2]++; // two places on: filling moves begins[page + 1] to where the page ends
        else
            lists->vertices[lists->begins[page + 1]++] = v;
    }
    lists->seams[v] = pages > 1;
}

int tetlodi_page_lists_make(struct tetlodi_page_lists *lists, const struct tetlodi_replay *replay,
                            const struct tetlodi_group *group)
{
    struct tetlodi_memory *memory = replay->memory;
    size_t pages = group->page_count;
    if (!TETLODI_ROOM(memory, lists->page_of, lists->page_of_capacity, replay->tets) ||
        !TETLODI_ROOM(memory, lists->begins, lists->begins_capacity, pages + 2) ||
        !TETLODI_ROOM(memory, lists->stamps, lists->stamps_capacity, pages) ||
        !TETLODI_ROOM(memory, lists->seams, lists->seams_capacity, replay->vertices))
        return 0;
    memset(lists->begins, 0, (pages + 2) * sizeof *lists->begins);
    memset(lists->stamps, 0, pages * sizeof *lists->stamps);
    find_pages(replay, group, lists->page_of);
    for (uint32_t v = 0; v < replay->vertices; v++)
        list_vertex(lists, replay, v, true);
    size_t count = 0;
    for (size_t p = 0; p < pages + 2; p++)
        count += lists->begins[p];
    if (count > UINT32_MAX || !TETLODI_ROOM(memory, lists->vertices, lists->vertices_capacity, count))
        return 0;
    for (size_t p = 2; p < pages + 2; p++)
        lists->begins[p] += lists->begins[p - 1];
    memset(lists->stamps, 0, pages * sizeof *lists->stamps);
    for (uint32_t v = 0; v < replay->vertices; v++)
        list_vertex(lists, replay, v, false);
    return 1;
}
