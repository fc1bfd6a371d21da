/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * Readers on top of libraries that were not made for hostile files run in a process of their own: what goes wrong
 * there, a crash, a loop, memory without end, is an error message here.
 */
#ifndef TETLOD_CONTAIN_H
#define TETLOD_CONTAIN_H

#include "src/io/services/assemble.h"

typedef enum tetlod_status (*contained_reader)(struct blocks *out, const struct io_input *input,
                                               struct io_report *report,
                                               struct tetlod_error *error);

/* Runs `read` in a child and takes its blocks over. A killed child is ERR_MESH. */
TETLOD_CHECKED enum tetlod_status contain_read(contained_reader read, struct blocks *out, const struct io_input *input,
                                               struct io_report *report, struct tetlod_error *error);

/* For a reader that has opened another file of that size: it may take more memory and time. */
void contain_expect(uint64_t size);

#endif
