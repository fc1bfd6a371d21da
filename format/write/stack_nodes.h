/* SPDX-License-Identifier: BSD-3-Clause */
/* What a stack has of its vertices, which are nodes of the whole stream. Not installed. */
#ifndef TETLOD_STACK_NODES_H
#define TETLOD_STACK_NODES_H

#include "format/write/page_stack.h"
#include "format/write/record_write.h"

/* The input of out->in.vertices nodes of the whole, and of out->in.contractions that contractions make. Corners and
 * children, of which out->in borrows, are to be filled in. False: out of memory. */
bool tetlodi_stack_copy_nodes(const struct tetlodi_record_writer *whole, struct tetlodi_page_stack *out,
                              const uint32_t *leaves, const uint32_t *contracted, uint32_t **out_corners,
                              uint32_t **out_children);

#endif
