/* SPDX-License-Identifier: BSD-3-Clause */
#include "format/write/page_write.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

void tetlodi_page_writer_init(struct tetlodi_page_writer *pages, struct tetlodi_memory *memory,
                              const struct tetlodi_write_group *groups, uint32_t group_count, uint32_t field_count)
{
    *pages = (struct tetlodi_page_writer){
        .memory = memory, .groups = groups, .group_count = group_count, .field_count = field_count};
}

void tetlodi_page_writer_fini(struct tetlodi_page_writer *pages)
{
    if (!pages->memory)
        return;
    TETLODI_FREE(pages->memory, pages->pairs, pages->pairs_capacity);
    TETLODI_FREE(pages->memory, pages->former, pages->former_capacity);
    TETLODI_FREE(pages->memory, pages->added, pages->added_capacity);
    TETLODI_FREE(pages->memory, pages->table.needed, pages->needed_capacity);
    tetlodi_page_shares_fini(&pages->shares);
    tetlodi_page_table_fini(&pages->table);
    tetlodi_buffer_fini(&pages->section);
    free(pages->boxes);
    free(pages->sizes);
}

/* Room for all groups. */
static bool allocate(struct tetlodi_page_writer *pages)
{
    struct tetlodi_page_table *table = &pages->table;
    size_t count = 0, parts = 1 + (size_t)pages->field_count;
    for (uint32_t g = 0; g < pages->group_count; g++)
        count += pages->groups[g].pages;
    table->groups = calloc(pages->group_count, sizeof *table->groups);
    table->pages = calloc(count, sizeof *table->pages);
    table->frames = calloc(count * parts, sizeof *table->frames);
    pages->boxes = calloc(count, sizeof *pages->boxes);
    pages->sizes = calloc(parts, sizeof *pages->sizes);
    return table->groups && table->pages && table->frames && pages->boxes && pages->sizes;
}

bool tetlodi_same_tree(const struct tetlodi_write_group *group, const struct tetlodi_write_group *before)
{
    for (uint32_t i = 0; i < group->nodes && group->pages == before->pages; i++)
        if (group->tree[i].axis != before->tree[i].axis || group->tree[i].beyond != before->tree[i].beyond ||
            (group->tree[i].axis != CUT_PAGE &&
             (group->tree[i].at < before->tree[i].at || group->tree[i].at > before->tree[i].at)))
            return false;
    return group->pages == before->pages;
}

/* ---- boxes */

void tetlodi_page_writer_box(struct tetlodi_page_writer *pages, uint32_t page, const struct tetlodi_replay *replay,
                             uint32_t tet)
{
    double *box = pages->boxes[pages->table.groups[pages->table.group_count - 1].first_page + page];
    for (size_t i = 4 * (size_t)tet; i < 4 * (size_t)tet + 4; i++) {
        const double *p = replay->columns[0].values + 3 * (size_t)replay->corners[i];
        for (int axis = 0; axis < 3; axis++) {
            box[axis] = p[axis] < box[axis] ? p[axis] : box[axis];
            box[3 + axis] = p[axis] > box[3 + axis] ? p[axis] : box[3 + axis];
        }
    }
}

/* Extends the box of a page of the group by all its tetrahedra as they are. */
static int extend_page(void *opaque, uint32_t page)
{
    struct tetlodi_page_writer *pages = opaque;
    const struct tetlodi_page_shares *shares = &pages->shares;
    for (uint32_t i = shares->tet_begins[page]; i < shares->tet_begins[page + 1]; i++)
        tetlodi_page_writer_box(pages, page, shares->whole, shares->tet_list[i]);
    for (uint32_t t = pages->added[page]; t < pages->added[page + 1]; t++)
        tetlodi_page_writer_box(pages, page, shares->whole, t);
    return 1;
}

void tetlodi_page_writer_extend(struct tetlodi_page_writer *pages, struct tetlodi_helpers *helpers)
{
    tetlodi_helpers_start(helpers, extend_page, pages, pages->table.groups[pages->table.group_count - 1].page_count);
    tetlodi_helpers_wait(helpers);
}

/* The greatest step of the bounds that is no more than x, or the least that is no less. */
static uint16_t box_step(const double (*bounds)[3], unsigned axis, double x, bool greatest)
{
    double width = bounds[1][axis] - bounds[0][axis];
    double steps = width > 0 ? (x - bounds[0][axis]) / width * PAGE_BOX_STEPS : 0;
    double step = fmin(fmax(greatest ? ceil(steps) : floor(steps), 0), PAGE_BOX_STEPS);
    while (greatest && step < PAGE_BOX_STEPS && tetlodi_page_box(bounds, axis, (uint16_t)step) < x)
        step++;
    while (greatest && step > 0 && tetlodi_page_box(bounds, axis, (uint16_t)(step - 1)) >= x)
        step--;
    while (!greatest && step > 0 && tetlodi_page_box(bounds, axis, (uint16_t)step) > x)
        step--;
    while (!greatest && step < PAGE_BOX_STEPS && tetlodi_page_box(bounds, axis, (uint16_t)(step + 1)) <= x)
        step++;
    return (uint16_t)step;
}

/* ---- what pages need */

static int compare_pairs(const void *a, const void *b)
{
    uint64_t x = *(const uint64_t *)a, y = *(const uint64_t *)b;
    return x < y ? -1 : x > y;
}

/* Which pages of the group before have tetrahedra of each page. */
static int find_needed(struct tetlodi_page_writer *pages, uint32_t tets)
{
    enum { SEEN = 1 << 10 }; // pairs that came before are mostly left out by a table of the last ones
    struct tetlodi_page_table *table = &pages->table;
    uint64_t seen[SEEN];
    size_t count = 0;
    if (table->group_count == 1)
        return 1;
    memset(seen, 0xff, sizeof seen); // no pair
    for (uint32_t t = 0; t < tets; t++) {
        uint64_t pair = (uint64_t)pages->shares.page_of[t] << 32 | pages->former[t];
        uint64_t *place = &seen[(pages->former[t] * 31 + pages->shares.page_of[t]) % SEEN];
        if (*place == pair)
            continue;
        *place = pair;
        if (!TETLODI_ROOM(pages->memory, pages->pairs, pages->pairs_capacity, count + 1))
            return 0;
        pages->pairs[count++] = pair;
    }
    qsort(pages->pairs, count, sizeof *pages->pairs, compare_pairs);
    if (!TETLODI_ROOM(pages->memory, table->needed, pages->needed_capacity, table->needed_count + count))
        return 0;
    for (size_t i = 0; i < count; i++) {
        struct tetlodi_page *page =
            &table->pages[table->groups[table->group_count - 1].first_page + (pages->pairs[i] >> 32)];
        if (i && pages->pairs[i] == pages->pairs[i - 1])
            continue;
        page->needed_begin = page->needed_count ? page->needed_begin : table->needed_count;
        page->needed_count++;
        table->needed[table->needed_count++] = (uint32_t)pages->pairs[i];
    }
    return 1;
}

/* ---- a group */

/* The pages of the group's tetrahedra are their former ones from now on. */
static int keep_former(struct tetlodi_page_writer *pages)
{
    struct tetlodi_page_shares *shares = &pages->shares;
    TETLODI_FREE(pages->memory, pages->former, pages->former_capacity);
    if (!tetlodi_count(pages->memory, (shares->tets + (uint64_t)1) * sizeof *shares->page_of))
        return 0;
    pages->former = shares->page_of;
    pages->former_capacity = shares->tets + (size_t)1;
    shares->page_of = NULL;
    return 1;
}

struct finding {
    const struct tetlodi_page_shares *shares;
    const struct tetlodi_cut *tree;
};

static int find_some(void *opaque, uint32_t task)
{
    const struct finding *finding = opaque;
    const struct tetlodi_page_shares *shares = finding->shares;
    const struct tetlodi_replay *replay = shares->whole;
    struct tetlodi_page_finder finder = tetlodi_page_finder(finding->tree);
    for (uint32_t t = tetlodi_task_begin(task), end = tetlodi_task_end(task, shares->tets); t < end; t++)
        shares->page_of[t] =
            tetlodi_page_at_corners(&finder, replay->columns[0].values, replay->corners + 4 * (size_t)t);
    return 1;
}

void tetlodi_find_pages(const struct tetlodi_page_shares *shares, const struct tetlodi_cut *tree,
                        struct tetlodi_helpers *helpers)
{
    tetlodi_helpers_share(helpers, find_some, &(struct finding){shares, tree}, shares->tets);
}

static void add_group(struct tetlodi_page_writer *pages, const struct tetlodi_write_group *group, bool same)
{
    struct tetlodi_page_table *table = &pages->table;
    table->groups[table->group_count++] =
        (struct tetlodi_group){group->pages, table->page_count, same ? 0 : group->nodes, group->tree};
    for (uint32_t p = 0; p < group->pages; p++)
        for (int i = 0; i < 6; i++)
            pages->boxes[table->page_count + p][i] = i < 3 ? INFINITY : -INFINITY;
    memset(pages->sizes, 0, (1 + (size_t)pages->field_count) * sizeof *pages->sizes);
}

int tetlodi_page_writer_begin(struct tetlodi_page_writer *pages, struct tetlodi_helpers *helpers,
                              struct tetlodi_replay *replay, const struct tetlodi_write_group *group, uint32_t level)
{
    struct tetlodi_page_table *table = &pages->table;
    struct tetlodi_page_shares *shares = &pages->shares;
    if (!table->groups && !allocate(pages))
        return 0;
    table->first_level = table->group_count ? table->first_level : level;
    add_group(pages, group, table->group_count && tetlodi_same_tree(group, pages->groups + table->group_count - 1));
    pages->vertices = replay->vertices;
    pages->tets = replay->tets;
    tetlodi_page_shares_fini(shares);
    if (!tetlodi_page_shares_init(shares, replay, group->pages) ||
        !TETLODI_ROOM(pages->memory, pages->added, pages->added_capacity, group->pages + (size_t)1))
        return 0;
    tetlodi_find_pages(shares, group->tree, helpers);
    shares->seams = pages->seams;
    shares->seams_known = pages->seams_known;
    tetlodi_page_shares_sort(shares, helpers);
    if (!find_needed(pages, replay->tets) || !keep_former(pages))
        return 0;
    for (uint32_t p = 0; p <= group->pages; p++)
        pages->added[p] = replay->tets;
    return 1;
}

int tetlodi_page_writer_follow(struct tetlodi_page_writer *pages, const uint32_t *tets)
{
    struct tetlodi_page_table *table = &pages->table;
    const struct tetlodi_write_group *group = &pages->groups[table->group_count];
    if (!TETLODI_ROOM(pages->memory, table->needed, pages->needed_capacity, table->needed_count + (size_t)group->pages))
        return 0;
    add_group(pages, group, true);
    for (uint32_t p = 0; p < group->pages; p++) {
        struct tetlodi_page *page = &table->pages[table->page_count + p];
        page->needed_count = tets[p] > 0;
        page->needed_begin = table->needed_count;
        table->needed[table->needed_count] = p;
        table->needed_count += page->needed_count;
    }
    return 1;
}

int tetlodi_page_writer_page(struct tetlodi_page_writer *pages, uint32_t vertices, uint32_t tets,
                             const struct tetlodi_buffer *frames)
{
    struct tetlodi_page_table *table = &pages->table;
    uint32_t number = table->page_count++, parts = 1 + pages->field_count;
    struct tetlodi_page *page = &table->pages[number];
    page->vertices = vertices - pages->vertices;
    page->tets = tets - pages->tets;
    for (uint32_t part = 0; part < parts && page->vertices; part++) {
        struct tetlodi_page_frame *frame = &table->frames[number * (size_t)parts + part];
        frame->size = (uint32_t)(frames[part].size - pages->sizes[part]);
        tetlodi_digest(frames[part].bytes + pages->sizes[part], frame->size, frame->digest);
        pages->sizes[part] = frames[part].size;
    }
    const bool more = table->group_count < pages->group_count;
    const uint32_t of_group = number - table->groups[table->group_count - 1].first_page;
    if (more && !TETLODI_ROOM(pages->memory, pages->former, pages->former_capacity, tets))
        return 0;
    for (uint32_t t = pages->tets; t < tets && more; t++)
        pages->former[t] = of_group;
    pages->added[of_group + 1] = tets;
    pages->vertices = vertices;
    pages->tets = tets;
    return 1;
}

void tetlodi_page_writer_end(struct tetlodi_page_writer *pages, const struct tetlodi_buffer *frames)
{
    struct tetlodi_page_table *table = &pages->table;
    uint32_t last = table->page_count - 1, parts = 1 + pages->field_count;
    while (!table->pages[last].vertices) // a level adds something
        last--;
    for (uint32_t part = 0; part < parts; part++) {
        struct tetlodi_page_frame *frame = &table->frames[last * (size_t)parts + part];
        frame->size += (uint32_t)(frames[part].size - pages->sizes[part]);
        tetlodi_digest(frames[part].bytes + frames[part].size - frame->size, frame->size, frame->digest);
    }
}

const struct tetlodi_buffer *tetlodi_page_writer_section(struct tetlodi_page_writer *pages, const double (*bounds)[3])
{
    const struct tetlodi_page_table *table = &pages->table;
    if (!table->group_count)
        return NULL;
    for (uint32_t p = 0; p < table->page_count; p++)
        for (unsigned i = 0; i < 6; i++)
            if (pages->boxes[p][i % 3] <= pages->boxes[p][3 + i % 3]) // else it has no tetrahedra
                table->pages[p].box[i] = box_step(bounds, i % 3, pages->boxes[p][i], i >= 3);
    tetlodi_page_table_encode(table, table->group_count, pages->field_count, &pages->section);
    return &pages->section;
}
