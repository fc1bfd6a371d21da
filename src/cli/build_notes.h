/* SPDX-License-Identifier: BSD-3-Clause */
/* The notes that tetlod build prints about the stream that it has built. */
#ifndef TETLOD_BUILD_NOTES_H
#define TETLOD_BUILD_NOTES_H

#include "src/cli/build_request.h"

/* On standard error: what was done to the mesh, whose error is held, what is in the stream. */
void build_notes(const struct build_request *request, const struct io_report *read, const struct tetmesh *mesh,
                 const struct build_control *controls, uint32_t count, const struct build_report *report);

/* On standard output: the levels, and with --for mail what the file promises of every field; or the index, times and
 * memory. They give the exit status. */
int build_print_levels(const struct build_request *request);
int build_print_json(const struct build_request *request, const struct build_report *report, double read_seconds,
                     double write_seconds);

#endif
