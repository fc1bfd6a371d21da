/* SPDX-License-Identifier: BSD-3-Clause */
/* Content codings of answers. */
#ifndef TETLOD_SERVER_CODING_H
#define TETLOD_SERVER_CODING_H

enum coding { CODING_IDENTITY, CODING_GZIP, CODING_ZSTD, CODING_BROTLI, CODINGS };

/* What answers that are made here can have; Brotli is for files that were compressed before. */
enum { CODINGS_MADE = 1 << CODING_GZIP | 1 << CODING_ZSTD };

/* "", "gzip", "zstd", "br" */
const char *coding_name(enum coding coding);

#endif
