/* SPDX-License-Identifier: BSD-3-Clause */
#ifndef TETLOD_MEMORY_LIMIT_H
#define TETLOD_MEMORY_LIMIT_H

#include <stdint.h>

/* Bytes that this process may use: the machine's memory, or the limit of its control group (version 1 or 2) where that
 * is less. `root` stands before the paths of /proc and /sys: "". */
uint64_t memory_limit(const char *root);

#endif
