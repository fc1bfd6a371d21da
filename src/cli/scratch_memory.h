/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * Large arrays in files, so that the program can work on meshes that do not fit into memory.
 *
 * The linker leads malloc, calloc, realloc, aligned_alloc, free and pthread_create of this program's own code here
 * (--wrap in the Makefile). Until scratch_memory_begin they are those of the C library. From then on a large array is
 * mapped: as memory while little is in use, else as a file without a name in the scratch folder. Each thread has a
 * timer, whose signal (SIGPROF) looks how much of the process is resident; before that passes the limit it takes files'
 * pages away, which the system reads again where they are looked at. So no code knows where its arrays are, and the
 * bytes that it computes are the same.
 */
#ifndef TETLOD_SCRATCH_MEMORY_H
#define TETLOD_SCRATCH_MEMORY_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "format/tetlod.h"

/* From now on at most `limit` bytes are resident, if what is not in files leaves room. The calling thread is watched,
 * and those that it makes from now on. The scratch folder is TMPDIR's (src/util/spool.h). ERR_IO: there can be no files
 * in it. ERR_NOMEM: there is no timer. */
TETLOD_CHECKED enum tetlod_status scratch_memory_begin(uint64_t limit, struct tetlod_error *error);

/* What the options --scratch and --memory ask for: NULL, and 0, where they are not given. */
TETLOD_CHECKED enum tetlod_status scratch_memory_take(const char *folder, uint64_t limit, struct tetlod_error *error);

/* Large arrays that are memory become files: what is in them changes no more, and those to come, which do, are memory
 * as far as the limit allows. `roomy`: little else takes memory from now on. While no other thread uses the arrays.
 * What there is no room for stays. */
void scratch_memory_settle(bool roomy);

/* More may be resident than was said at first. */
void scratch_memory_allow(uint64_t limit);

/* All that is needed fits into memory: arrays that are made from now on are not in files. */
void scratch_memory_stay(void);

/* Fails with what kept an array from having a file, if something did: callers have only seen that memory was out. */
TETLOD_CHECKED enum tetlod_status scratch_memory_failure(struct tetlod_error *error);

/* The most bytes that were in files at once. */
uint64_t scratch_memory_peak(void);

/* Bytes that were taken away so far: what of them was written goes to the files, what is needed again comes back. */
uint64_t scratch_memory_given_back(void);

#endif
