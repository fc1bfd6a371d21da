/* SPDX-License-Identifier: BSD-3-Clause */
/* Where the bytes of a stream are: geometry, each field, values of cells, steps in time. */
#ifndef TETLOD_BYTE_TABLE_H
#define TETLOD_BYTE_TABLE_H

#include <stdbool.h>
#include <stdio.h>

#include "format/tetlod.h"

/* A line for each part that takes much, and what would make the stream smaller, where one kind of part dominates.
 * `program` begins those lines of advice; they go to `advice`, the table to `out`. Either may be NULL. */
void byte_table_print(FILE *out, FILE *advice, const char *program, const struct tetlod_file *file);

#endif
