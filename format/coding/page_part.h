/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * A page as a mesh of its own (SPEC 7.6): pages of a level touch no tetrahedron of each other, so each can be coded on
 * any thread and put back. Numbers inside a page are in the order of those outside, which is all that a record depends
 * on. Not installed.
 */
#ifndef TETLOD_PAGE_PART_H
#define TETLOD_PAGE_PART_H

#include "format/coding/record.h"
#include "format/common/threads.h"

/* Who has a vertex, beside the number of a page: PAGE_SEAM if several, or one and what is left out. */
#define PAGE_NOBODY UINT32_MAX
#define PAGE_SEAM (UINT32_MAX - 1)

/* The page of a tetrahedron of a page that is to come; that of one which is left out is TETLOD_NONE. */
#define NOT_THERE (UINT32_MAX - 1)

/* What each page of a level has, of the mesh before it. */
struct tetlodi_page_shares {
    struct tetlodi_replay *whole;        /* borrowed */
    uint32_t vertices, tets, pages;      /* before the level */
    const uint8_t *seams;                /* [seams_known] of the first ones it is known; borrowed */
    uint32_t seams_known;
    uint32_t *page_of;                   /* [tet]; of no more use once it is sorted by */
    uint32_t *owner;                     /* [vertex] the one page that has it, or PAGE_SEAM */
    uint32_t *local;                     /* [vertex] its number in its page, or PAGE_SEAM */
    uint32_t *tet_begins, *tet_list;     /* [page + 1]; tetrahedra page by page, ascending */
    uint32_t *inner_begins, *inner_list; /* the same of vertices that are not at seams */
};

/* Room for so many pages; 0 if there is none. The caller then sets page_of and sorts. */
int tetlodi_page_shares_init(struct tetlodi_page_shares *shares, struct tetlodi_replay *whole, size_t pages);
void tetlodi_page_shares_sort(struct tetlodi_page_shares *shares, struct tetlodi_helpers *helpers);
void tetlodi_page_shares_fini(struct tetlodi_page_shares *shares);

/* Bytes that it takes, but for those of pages. */
uint64_t tetlodi_page_shares_bytes(const struct tetlodi_replay *whole);

/* A vertex at a seam and its number in the page. */
struct tetlodi_seat {
    uint32_t vertex, number; /* PAGE_NOBODY: the seat is free */
};

/* Groups of one tree have the same pages: a part may have its page of one, then that of the next. */
enum { MAX_ALIKE = 4 };

/* What a page of one of these groups adds. */
struct tetlodi_part_run {
    uint32_t vertex, tet;             /* the first in the part */
    uint32_t first_vertex, first_tet; /* the same outside */
};

struct tetlodi_page_part {
    uint32_t page;                     /* of the group */
    const uint32_t *tets;              /* its tetrahedra; borrowed */
    uint32_t tet_count;
    uint32_t *listed, listed_count;    /* [vertex] outside, ascending; so many it has at the beginning */
    uint32_t room;                     /* vertices that it can have */
    uint8_t *seams;                    /* [vertex] */
    uint32_t *at_seams, at_seams_count; /* those outside, ascending; set before, they are not looked for again */
    struct tetlodi_seat *seats;        /* [mask + 1] of these, by a hash of their numbers */
    uint32_t mask;
    uint32_t run_count;
    struct tetlodi_part_run runs[MAX_ALIKE]; /* the caller says where they are outside */
    uint32_t *own;                     /* [vertex] 0, 1, 2 ... */
    struct tetlodi_memory memory;
    struct tetlodi_column *columns;
    struct tetlodi_replay replay;
};

void tetlodi_page_part_set(struct tetlodi_page_part *part, const struct tetlodi_page_shares *shares, uint32_t page);
void tetlodi_page_part_fini(struct tetlodi_page_part *part);

/* Lists the part's vertices: those that it alone has, and those at seams. It adds so many. 0 if out of memory. */
int tetlodi_page_part_list(struct tetlodi_page_part *part, const struct tetlodi_page_shares *shares, uint32_t adds);

/* A vertex outside in the part, of which the vertices are listed; PAGE_NOBODY: one at a seam that it does not have. */
uint32_t tetlodi_page_part_number(const struct tetlodi_page_part *part, const struct tetlodi_page_shares *shares,
                                  uint32_t vertex);

/* Makes the part as a base mesh, with room for what its pages add; it may take so much memory. 0 if that is out. */
int tetlodi_page_part_gather(struct tetlodi_page_part *part, const struct tetlodi_page_shares *shares,
                             uint32_t vertices, uint32_t tets, uint64_t most);

/* What is added from now on is of the next group's page. */
void tetlodi_page_part_next(struct tetlodi_page_part *part);

/* Begins with the page's records, to which it adds so many vertices, and tetrahedra at most. */
void tetlodi_page_part_begin(const struct tetlodi_page_part *part, struct tetlodi_recorder *recorder,
                             const struct tetlodi_recorder *whole, uint32_t vertices, uint32_t tets);

/* Puts the part back. What it writes is in no other part. */
void tetlodi_page_part_scatter(const struct tetlodi_page_part *part, const struct tetlodi_page_shares *shares);

/* Frees all but the part's log, whose vertices are numbered as outside from now on. */
void tetlodi_page_part_shrink(struct tetlodi_page_part *part);

/* A vertex of the part outside. */
static inline uint32_t page_part_outside(const struct tetlodi_page_part *part, uint32_t vertex)
{
    return part->listed[vertex];
}

#endif
