/* SPDX-License-Identifier: BSD-3-Clause */
/* The table of pages as an encoder makes it (SPEC 7.6). Not installed. */
#ifndef TETLOD_PAGE_WRITE_H
#define TETLOD_PAGE_WRITE_H

#include "format/coding/page_part.h"
#include "format/common/threads.h"

struct tetlodi_page_writer {
    struct tetlodi_memory *memory;
    const struct tetlodi_write_group *groups; /* [group_count] borrowed */
    uint32_t group_count, field_count;
    struct tetlodi_page_table table;
    struct tetlodi_page_shares shares; /* of the group */
    double (*boxes)[6];              /* [page of all groups] least, greatest */
    uint64_t *pairs;                 /* page of the group, page of the group before: of tetrahedra that are in both */
    uint64_t *sizes;                 /* [1 + field_count] bytes of the level's frames so far */
    uint32_t *former;                /* [tet] page of the group before, later of the group */
    uint32_t *added;                 /* [page of the group + 1] where the tetrahedra that it adds begin */
    uint32_t vertices, tets;         /* at the page's begin */
    const uint8_t *seams;            /* [seams_known] of the first vertices it is known; borrowed */
    uint32_t seams_known;
    size_t pairs_capacity, former_capacity, added_capacity, needed_capacity;
    struct tetlodi_buffer section;
};

void tetlodi_page_writer_init(struct tetlodi_page_writer *pages, struct tetlodi_memory *memory,
                              const struct tetlodi_write_group *groups, uint32_t group_count, uint32_t field_count);
void tetlodi_page_writer_fini(struct tetlodi_page_writer *pages);

/* Do two groups have the same pages? */
bool tetlodi_same_tree(const struct tetlodi_write_group *group, const struct tetlodi_write_group *before);

/* Sets the page of every tetrahedron that pages of a tree are to share. */
void tetlodi_find_pages(const struct tetlodi_page_shares *shares, const struct tetlodi_cut *tree,
                        struct tetlodi_helpers *helpers);

/* Before a group, which is that level: finds what its pages have. 0 if out of memory. */
int tetlodi_page_writer_begin(struct tetlodi_page_writer *pages, struct tetlodi_helpers *helpers,
                              struct tetlodi_replay *replay, const struct tetlodi_write_group *group, uint32_t level);

/* In place of it, of a group with the tree of the one before: its pages have [page] so many tetrahedra. */
int tetlodi_page_writer_follow(struct tetlodi_page_writer *pages, const uint32_t *tets);

/* Extends the box of a page of the group by a tetrahedron as it is in a mesh: at the begin, and at the end. */
void tetlodi_page_writer_box(struct tetlodi_page_writer *pages, uint32_t page, const struct tetlodi_replay *replay,
                             uint32_t tet);

/* The same for all tetrahedra of all its pages, in the whole mesh. */
void tetlodi_page_writer_extend(struct tetlodi_page_writer *pages, struct tetlodi_helpers *helpers);

/* Behind a page, with which there are so many vertices and tetrahedra, and whose bytes are the last of `frames` [1 +
 * field_count] of the level. 0 if out of memory. */
int tetlodi_page_writer_page(struct tetlodi_page_writer *pages, uint32_t vertices, uint32_t tets,
                             const struct tetlodi_buffer *frames);

/* Behind the last page, and what the level was padded with: that belongs to the last page that adds something. */
void tetlodi_page_writer_end(struct tetlodi_page_writer *pages, const struct tetlodi_buffer *frames);

/* Makes the section from the bounds of the stream. NULL: there are no pages; its `failed` says that memory was out. */
const struct tetlodi_buffer *tetlodi_page_writer_section(struct tetlodi_page_writer *pages, const double (*bounds)[3]);

#endif
