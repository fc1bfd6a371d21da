/* SPDX-License-Identifier: BSD-3-Clause */
/* Files of arrays that were freed (scratch_memory.c), for those that come: their pages are there already. Any thread
 * may call these, but for signal handlers. */
#ifndef TETLOD_SPARE_FILES_H
#define TETLOD_SPARE_FILES_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/* Keeps a file of so many bytes, or closes it. All that are kept have `room` bytes at most: the oldest go first. */
void spare_files_put(int file, size_t size, uint64_t room);

/* Gives the file that fits best, with its size: the smallest that is large enough, or the largest, and the last of
 * these. -1: there is none. */
int spare_files_take(size_t size, size_t *out_size);

/* Closes the oldest until the others have no more than `room` bytes. */
void spare_files_trim(uint64_t room);

/* Closes all. False: there were none. */
bool spare_files_close(void);

/* In a child, which has one thread: they are its parent's, and so may be what is freed here. None is kept any more. */
void spare_files_leave(void);

#endif
