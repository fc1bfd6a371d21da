/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * A level of a stream in pages as a temporary file, for meshes that are larger than memory. A tetrahedron is what it is
 * at the level as soon as its page of each group is decoded, and its number is a sum over the table of pages: so pages
 * of the last group are decoded some at a time, with those that they need, and leave their tetrahedra and the vertices
 * of these behind. What takes memory is the cursor, with as many pages as are allowed.
 */
#ifndef TETLOD_LEVEL_FILE_H
#define TETLOD_LEVEL_FILE_H

#include <stdbool.h>
#include <stddef.h>

#include "format/tetlod.h"

struct level_file;

/* Is a level in pages, or the one behind them that makes values exact? */
bool level_file_is_for(const struct tetlod_info *info, uint32_t level);

/* Nothing is decoded yet. The file is borrowed until all is there. It takes `memory` bytes, or *out_memory, if no page
 * can be decoded with less. ERR_IO: there is no room for it in the temporary folder. */
TETLOD_CHECKED enum tetlod_status level_file_new(struct level_file **out, struct tetlod_file *file, uint32_t level,
                                                 uint64_t memory, uint64_t *out_memory, struct tetlod_error *error);
void level_file_free(struct level_file *level_file);

/* Decodes some pages. TETLOD_MORE: not all are there; OK: all are, and any number of threads may read them. */
TETLOD_CHECKED enum tetlod_status level_file_grow(struct level_file *level_file, struct tetlod_error *error);

/* Rows from `first` on of column 0, the positions, or 1 + f, field f; corners of tetrahedra. `level_file` is a struct
 * level_file. */
void level_file_values(const void *level_file, uint32_t column, uint64_t first, size_t count, double *out);
void level_file_corners(const void *level_file, uint64_t first, size_t count, uint32_t *out);

/* Could something not be read from the disk? Then these gave zeros. */
bool level_file_failed(const struct level_file *level_file);

#endif
