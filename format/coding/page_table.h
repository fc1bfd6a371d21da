/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * Levels whose records are in pages (SPEC 7.6): the section PAGE, and which vertices a page may split. A group is a
 * level in pages, the part of it in one cell of a partition of space is a page. Not installed.
 */
#ifndef TETLOD_PAGE_TABLE_H
#define TETLOD_PAGE_TABLE_H

#include "format/common/bytes.h"
#include "format/common/checksum.h"
#include "format/common/cuts.h"
#include "format/coding/replay.h"
#include "format/tetlod.h"

struct tetlodi_page_frame {
    uint64_t offset; /* in the stream, where it is read */
    uint32_t size;
    uint8_t digest[DIGEST_SIZE];
};

struct tetlodi_page {
    uint32_t vertices, tets;             /* that it adds */
    uint16_t box[6];                     /* least x, y, z, greatest: of its tetrahedra, in steps of the bounds */
    uint32_t needed_begin, needed_count; /* in `needed`: pages of the group before that have to be there first */
};

struct tetlodi_group {
    uint32_t page_count, first_page;
    uint32_t node_count;            /* 0: the tree is that of the group before */
    const struct tetlodi_cut *tree; /* borrowed from the table */
};

/* All groups, the coarsest first: group g is level first_level + g. */
struct tetlodi_page_table {
    uint32_t first_level, group_count, page_count, needed_count, cut_count;
    struct tetlodi_group *groups;
    struct tetlodi_page *pages;
    struct tetlodi_page_frame *frames; /* [page * (1 + field_count) + part] */
    struct tetlodi_cut *cuts;
    uint32_t *needed;
};

void tetlodi_page_table_fini(struct tetlodi_page_table *table);

/* Bytes that it takes. */
uint64_t tetlodi_page_table_bytes(const struct tetlodi_page_table *table, uint32_t field_count);

/* The group that a level is, or NULL. */
const struct tetlodi_group *tetlodi_group_of(const struct tetlodi_page_table *table, uint32_t level);

/* The level of a page, by its number among all; of TETLOD_NONE the last level before those in pages. */
uint32_t tetlodi_level_of_page(const struct tetlodi_page_table *table, uint32_t page);

/* The frame of a page of a group. */
struct tetlodi_page_frame *tetlodi_page_frame(const struct tetlodi_page_table *table, uint32_t field_count,
                                              const struct tetlodi_group *group, uint32_t page, uint32_t part);

/* Which frame of which page is number i of a group's, in the order of the stream (SPEC 7.6): geometry and first field
 * page by page, then each other field, page by page. */
struct tetlodi_page_place {
    uint32_t page, part;
};

static inline struct tetlodi_page_place tetlodi_page_place(size_t i, uint32_t pages, uint32_t parts)
{
    const size_t beside = parts < 2 ? parts : 2;
    return i < beside * pages ? (struct tetlodi_page_place){(uint32_t)(i / beside), (uint32_t)(i % beside)}
                              : (struct tetlodi_page_place){(uint32_t)(i % pages), (uint32_t)(i / pages)};
}

enum { PAGE_BOX_STEPS = 65535 };

/* Where a step of a page's box is on an axis. */
static inline double tetlodi_page_box(const double (*bounds)[3], unsigned axis, uint16_t step)
{
    if (step == 0 || step == PAGE_BOX_STEPS)
        return bounds[step != 0][axis];
    return bounds[0][axis] + (bounds[1][axis] - bounds[0][axis]) * (step / (double)PAGE_BOX_STEPS);
}

/* Bytes of a page's row. */
uint32_t tetlodi_page_row(uint32_t field_count);

/* The section of the first `group_count` groups. */
void tetlodi_page_table_encode(const struct tetlodi_page_table *table, uint32_t group_count, uint32_t field_count,
                               struct tetlodi_buffer *out);

/* May so many pages be decoded in so many bytes of geometry (SPEC 2.3)? */
bool tetlodi_pages_hold(uint64_t pages, uint64_t bytes);

/* Of a group, before it is decoded: which vertices each page has. */
struct tetlodi_page_lists {
    uint32_t *page_of;  /* [tet] */
    uint32_t *begins;   /* [page + 1] in `vertices` */
    uint32_t *vertices; /* of the tetrahedra of each page, ascending */
    uint8_t *seams;     /* [vertex] it has tetrahedra of several pages: it does not split */
    uint32_t *stamps;   /* [page] the last vertex, plus 1, that was listed for it */
    size_t page_of_capacity, begins_capacity, vertices_capacity, seams_capacity, stamps_capacity;
};

/* Makes the lists for the mesh as it is. 0 if out of memory. */
int tetlodi_page_lists_make(struct tetlodi_page_lists *lists, const struct tetlodi_replay *replay,
                            const struct tetlodi_group *group);

void tetlodi_page_lists_fini(struct tetlodi_page_lists *lists, struct tetlodi_memory *memory);

#endif
