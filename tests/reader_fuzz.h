/* SPDX-License-Identifier: BSD-3-Clause */
/* What the fuzz targets of the readers have in common. */
#ifndef TETLOD_READER_FUZZ_H
#define TETLOD_READER_FUZZ_H

#include "src/io/io.h"
#include "src/io/read_input.h"

/* Reads; a mesh that is accepted must be valid, pass through mesh_check, and come back the same from VTU and legacy
 * VTK. Aborts if not. */
void reader_fuzz(const char *path, const struct io_input *input);

/* The same for a format of two files. The first byte tells how many of the others are the first file: all (255), or in
 * 255ths. */
void reader_fuzz_two(const char *path, const char *other_path, const uint8_t *bytes, size_t size);

/* The same for a format whose first file names the others: `count` files in a folder of their own, of which the format
 * reads the first. A byte for each but the last tells how much of what is left it takes, in 255ths. */
void reader_fuzz_folder(const char *const *names, size_t count, const uint8_t *bytes, size_t size);

#endif
