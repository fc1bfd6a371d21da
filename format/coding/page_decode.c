/* SPDX-License-Identifier: BSD-3-Clause */
#include "format/coding/page_decode.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "format/fail.h"

enum { CUT_BYTES = 5, GROUP_BYTES = 8 };

static const char *get_groups(struct tetlodi_page_table *table, struct tetlodi_bytes *in)
{
    uint64_t pages = 0, cuts = 0;
    for (uint32_t g = 0; g < table->group_count; g++) {
        struct tetlodi_group *group = &table->groups[g];
        group->page_count = (uint32_t)tetlodi_get(in, 4);
        group->node_count = (uint32_t)tetlodi_get(in, 4);
        group->first_page = (uint32_t)pages;
        pages += group->page_count;
        cuts += group->node_count;
        if (!group->page_count || pages > UINT32_MAX ||
            (group->node_count && group->node_count != 2 * (uint64_t)group->page_count - 1) ||
            (!group->node_count && (!g || group->page_count != group[-1].page_count)))
            return "groups of no known form";
    }
    table->page_count = (uint32_t)pages;
    table->cut_count = (uint32_t)cuts;
    return in->failed || cuts * CUT_BYTES > in->left ? "groups of no known form" : NULL;
}

/* A tree in preorder: behind a page comes the second part of the last cut that is still open. */
static const char *get_tree(struct tetlodi_group *group, struct tetlodi_cut *tree, struct tetlodi_bytes *in)
{
    uint32_t open[MAX_CUTS], depths[MAX_CUTS], count = 0, depth = 0, pages = 0;
    for (uint32_t i = 0; i < group->node_count; i++) {
        tree[i].axis = (uint8_t)tetlodi_get(in, 1);
        uint32_t bits = (uint32_t)tetlodi_get(in, 4);
        memcpy(&tree[i].at, &bits, sizeof bits);
        bool is_cut = tree[i].axis < CUT_PAGE && isfinite(tree[i].at), is_page = tree[i].axis == CUT_PAGE && !bits;
        if (is_cut && depth < MAX_CUTS) {
            depths[count] = ++depth;
            open[count++] = i;
            continue;
        }
        if (!is_page || (count == 0) != (i + 1 == group->node_count))
            return "a tree of no known form";
        tree[i].beyond = pages++;
        if (count) {
            depth = depths[--count];
            tree[open[count]].beyond = i + 1;
        }
    }
    group->tree = tree;
    return NULL;
}

static const char *get_trees(struct tetlodi_page_table *table, struct tetlodi_bytes *in)
{
    struct tetlodi_cut *tree = table->cuts;
    for (uint32_t g = 0; g < table->group_count; g++) {
        struct tetlodi_group *group = &table->groups[g];
        const char *wrong = group->node_count ? get_tree(group, tree, in) : NULL;
        if (wrong)
            return wrong;
        if (!group->node_count)
            group->tree = group[-1].tree;
        tree += group->node_count;
    }
    return NULL;
}

static void get_page(struct tetlodi_bytes *in, struct tetlodi_page *page, struct tetlodi_page_frame *frames,
                     uint32_t parts)
{
    page->vertices = (uint32_t)tetlodi_get(in, 4);
    page->tets = (uint32_t)tetlodi_get(in, 4);
    for (int i = 0; i < 6; i++)
        page->box[i] = (uint16_t)tetlodi_get(in, 2);
    page->needed_count = (uint32_t)tetlodi_get(in, 4);
    for (uint32_t part = 0; part < parts; part++) {
        frames[part].size = (uint32_t)tetlodi_get(in, 4);
        const uint8_t *digest = tetlodi_get_block(in, DIGEST_SIZE);
        if (digest)
            memcpy(frames[part].digest, digest, DIGEST_SIZE);
    }
}

/* A page that adds nothing has no bytes, and its box is in order. */
static bool is_page(const struct tetlodi_page *page, const struct tetlodi_page_frame *frames, uint32_t parts)
{
    uint64_t bytes = page->tets;
    for (uint32_t part = 0; part < parts; part++)
        bytes += frames[part].size;
    return (page->vertices || !bytes) && page->box[0] <= page->box[3] && page->box[1] <= page->box[4] &&
           page->box[2] <= page->box[5];
}

static const char *get_pages(struct tetlodi_page_table *table, uint32_t parts, struct tetlodi_bytes *in)
{
    uint64_t needed = 0;
    for (uint32_t p = 0; p < table->page_count; p++) {
        struct tetlodi_page *page = &table->pages[p];
        get_page(in, page, table->frames + p * (size_t)parts, parts);
        if (!is_page(page, table->frames + p * (size_t)parts, parts))
            return "a page of no known form";
        page->needed_begin = (uint32_t)needed;
        needed += page->needed_count;
    }
    if (in->failed || needed * 4 != in->left)
        return "less than it should";
    table->needed_count = (uint32_t)needed;
    return NULL;
}

static const char *get_needed(struct tetlodi_page_table *table, struct tetlodi_bytes *in)
{
    for (uint32_t g = 0; g < table->group_count; g++)
        for (uint32_t p = 0; p < table->groups[g].page_count; p++) {
            const struct tetlodi_page *page = &table->pages[table->groups[g].first_page + p];
            uint32_t pages = g ? table->groups[g - 1].page_count : 0;
            for (uint32_t i = page->needed_begin; i < page->needed_begin + page->needed_count; i++) {
                table->needed[i] = (uint32_t)tetlodi_get(in, 4);
                if (table->needed[i] >= pages || (i > page->needed_begin && table->needed[i] <= table->needed[i - 1]))
                    return "a page of no known form";
            }
        }
    return NULL;
}

/* Groups are the last levels, but for the tail. */
static bool begin_table(struct tetlodi_page_table *table, uint32_t levels, struct tetlodi_bytes *in)
{
    table->first_level = (uint32_t)tetlodi_get(in, 4);
    table->group_count = (uint32_t)tetlodi_get(in, 4);
    return !in->failed && table->first_level && table->first_level < levels &&
           table->group_count == levels - table->first_level && table->group_count <= in->left / GROUP_BYTES;
}

/* Room for as many pages as the bytes may be about. */
static bool allocate(struct tetlodi_page_table *table, uint32_t parts)
{
    table->pages = calloc(table->page_count, sizeof *table->pages);
    table->frames = calloc(table->page_count * (size_t)parts, sizeof *table->frames);
    return table->pages && table->frames;
}

enum tetlod_status tetlodi_page_table_decode(struct tetlodi_page_table *table, uint32_t levels, uint32_t field_count,
                                             const uint8_t *bytes, size_t size, struct tetlod_error *error)
{
    struct tetlodi_bytes in = {bytes, size, false};
    uint32_t parts = 1 + field_count;
    const char *wrong = begin_table(table, levels, &in) ? NULL : "groups of no known form";
    table->groups = calloc(wrong ? 1 : table->group_count, sizeof *table->groups);
    bool room = table->groups;
    if (room && !wrong)
        wrong = get_groups(table, &in);
    table->cuts = calloc(wrong ? 1 : table->cut_count + (size_t)1, sizeof *table->cuts);
    room = room && table->cuts;
    if (room && !wrong)
        wrong = get_trees(table, &in);
    if (!wrong && table->page_count > in.left / tetlodi_page_row(field_count))
        wrong = "less than it should";
    if (room && !wrong)
        room = allocate(table, parts);
    if (room && !wrong)
        wrong = get_pages(table, parts, &in);
    table->needed = calloc(table->needed_count + (size_t)1, sizeof *table->needed);
    room = room && table->needed;
    if (room && !wrong)
        wrong = get_needed(table, &in);
    if (!room)
        return tetlodi_fail_nomem(error, "the table of pages", size);
    return wrong ? tetlodi_fail(error, TETLOD_ERR_STREAM, "the table of pages is damaged: it has %s", wrong)
                 : TETLOD_OK;
}
