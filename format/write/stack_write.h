/* SPDX-License-Identifier: BSD-3-Clause */
/* A stream whose pages several programs code: its root as an input of its own, and then stacks (page_stack.h). Not
 * installed. */
#ifndef TETLOD_STACK_WRITE_H
#define TETLOD_STACK_WRITE_H

#include "format/write/page_stack.h"
#include "format/write/page_write.h"
#include "format/write/record_write.h"

/* Vertices of a page at seams, ascending. NULL: they are not known. */
struct tetlodi_page_seams {
    uint32_t *vertices, count;
};

/* Which of 64 tetrahedra of the input are there at the end, and how many of those before. */
struct tetlodi_at_end {
    uint64_t there;
    uint32_t before;
};

struct tetlodi_stacks {
    struct tetlodi_record_writer whole; /* numbers of nodes of the whole stream: its input and its columns, borrowed */
    struct tetlodi_page_writer *pages;  /* borrowed, as all up to slowest */
    struct tetlodi_helpers *helpers;
    const struct tetlodi_recorder *recorder; /* that the root is coded with */
    struct tetlod_error *error;
    unsigned slowest;
    struct tetlodi_page_stack root; /* `in` and `levels` of it: the root's input */
    uint32_t *root_nodes, *root_tets; /* [vertex, tetrahedron of it] in the stream's input */
    struct tetlodi_memory memory;
    uint32_t nodes;
    uint32_t *parent, *heirs; /* [node]; [node] the one that it is in at the end of the levels that are coded */
    uint32_t *place; /* [node] its vertex behind the root; then, of a contraction, its number in its stack */
    uint32_t vertices, tets; /* so far, in order of arrival: */
    uint32_t *node_at, *original_of;
    uint8_t *leaves, *places;
    struct tetlodi_column positions[2]; /* of the two that follow */
    struct tetlodi_replay begin, end;   /* the mesh at the levels' begin; at their end, of which vertices are nodes */
    struct tetlodi_page_shares shares;  /* of the end */
    struct tetlodi_at_end *at_end;      /* [tets of the input / 64 + 1]; NULL: all are there, as at the finest level */
    uint32_t *original_at_end;          /* [tetrahedron at the end] of the input; NULL as well */
    uint32_t first_level, level_count, taken; /* levels that are coded; of these */
    struct tetlodi_stack_result *results;     /* [page] */
    struct tetlodi_page_seams (*seams)[2];    /* [page] of one that was cut, at the begin and at the end */
    uint32_t page_count;
};

/* Cuts the root out. `whole`, and what is borrowed but the recorder, is set. It can be freed in any case. ERR_ARGUMENT:
 * the input is no forest; ERR_NOMEM. */
TETLOD_CHECKED enum tetlod_status tetlodi_stacks_init(struct tetlodi_stacks *stacks);
void tetlodi_stacks_fini(struct tetlodi_stacks *stacks);

/* The root is coded. ERR_NOMEM. */
TETLOD_CHECKED enum tetlod_status tetlodi_stacks_begin(struct tetlodi_stacks *stacks,
                                                       const struct tetlodi_record_writer *root);

/* Does anybody ask for the order of arrival behind the levels that are coded? Else it is not known. */
bool tetlodi_stacks_keep_order(const struct tetlodi_stacks *stacks);

/* Gives it to a writer, whose own is freed. */
void tetlodi_stacks_order(struct tetlodi_stacks *stacks, struct tetlodi_record_writer *out);

/* Takes the next level in pages, whose frames [1 + fields] are appended to, and counts its labels. All levels with the
 * tree of the first one are coded at once. ERR_ARGUMENT, ERR_NOMEM, or what the input's `share` fails with. */
TETLOD_CHECKED enum tetlod_status tetlodi_stacks_level(struct tetlodi_stacks *stacks, uint32_t level,
                                                       struct tetlodi_buffer *frames, uint64_t *io_labels);

#endif
