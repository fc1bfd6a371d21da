/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * A stack: the pages of one part of space, of the levels in pages that follow each other with the same tree. What they
 * add hangs on no other page of these levels, so a stack is a mesh of its own with contractions of its own, which any
 * program can code. Not installed.
 */
#ifndef TETLOD_PAGE_STACK_H
#define TETLOD_PAGE_STACK_H

#include "format/common/bytes.h"
#include "format/common/values.h"
#include "format/write/write_input.h"

struct tetlodi_page_stack {
    /* Its mesh at the last level, and the contractions between its levels; NULL, or 0, is what is of no use here. The
     * arrays of it and of its fields are owned. */
    struct tetlodi_write_input in;
    struct tetlodi_write_field *fields; /* [in.field_count] those of `in`; owned, as all that follows */
    uint8_t *copied;                    /* [MAX_COMPONENTS * in.field_count] (recorder.h) */
    uint32_t level_count, *ends;        /* [level] coarse to fine: contractions of it and of finer ones */
    uint32_t vertices, tets;            /* at the begin, in order of arrival: */
    uint32_t *nodes, *numbers;          /* [vertices] of `in`; [tets] of `in` */
    uint8_t *seams, *leaves, *places;   /* [vertices]; [vertices] it never splits; [tets] (record_write.h) */
    unsigned slowest;
    bool keeps_mesh; /* it is asked what the mesh is at the end */
};

/* What coding has come to. Vertices are those at the last level, tetrahedra those that came with the levels, in order
 * of arrival, if it is asked. */
struct tetlodi_stack_level {
    uint32_t vertices, tets; /* that it adds */
    uint64_t labels;
    double box[6];           /* least, greatest */
};

struct tetlodi_stack_result {
    uint32_t level_count, parts;        /* parts: 1 + fields */
    struct tetlodi_stack_level *levels; /* [level] */
    struct tetlodi_buffer *frames;      /* [level * parts] */
    uint32_t vertices, tets;
    uint32_t *nodes, *numbers;
    uint8_t *leaves, *places;
};

/* What a program that shares out stacks gets (write_input.h). */
struct tetlodi_stack_work {
    uint32_t count;
    /* The stack of that number, on any thread. ERR_NOMEM, ERR_ARGUMENT. It can be freed in any case. */
    enum tetlod_status (*cut)(void *opaque, uint32_t number, struct tetlodi_page_stack *out,
                              struct tetlod_error *error);
    void *opaque;
    struct tetlodi_stack_result *results; /* [count] zeros, to be filled in */
};

/* Codes the pages of a stack. ERR_ARGUMENT: its contractions are of other pages, too; ERR_NOMEM. *out can be freed in
 * any case. */
TETLOD_CHECKED enum tetlod_status tetlodi_stack_encode(const struct tetlodi_page_stack *stack,
                                                       struct tetlodi_stack_result *out, struct tetlod_error *error);

void tetlodi_stack_fini(struct tetlodi_page_stack *stack);
void tetlodi_stack_result_fini(struct tetlodi_stack_result *result);

#endif
