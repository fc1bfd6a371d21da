/* SPDX-License-Identifier: BSD-3-Clause */
/* The 64 bytes that begin a stream (SPEC 3.1), and its content id. Not installed. */
#ifndef TETLOD_HEADER_H
#define TETLOD_HEADER_H

#include <stdbool.h>

#include "format/common/checksum.h"
#include "format/tetlod.h"

/* The minor version is that of what the stream uses: without pages it is 0. */
enum { HEADER_SIZE = 64, FORMAT_MAJOR = 2, FORMAT_MINOR_PAGED = 1, FEATURE_PAGED = 1 };
enum { MAX_INDEX = 1 << 28, MAX_EARLY = 1 << 28 };

#define TETLODI_MAGIC "\x89TLD\r\n\x1a\n"

struct tetlodi_header {
    uint32_t index_size;  /* as stored */
    uint32_t index_plain; /* unpacked; as stored if it is not packed */
    uint32_t early_size;  /* of the sections between the index and level 0 */
    uint64_t file_size;
    bool paged; /* some levels are in pages: a required feature */
    uint8_t cid[DIGEST_SIZE];
};

void tetlodi_header_encode(const struct tetlodi_header *header, uint8_t out[HEADER_SIZE]);

/* ERR_NOT_TETLOD, ERR_VERSION, ERR_CHECKSUM, ERR_STREAM. */
TETLOD_CHECKED enum tetlod_status tetlodi_header_decode(struct tetlodi_header *header, const uint8_t bytes[HEADER_SIZE],
                                                        struct tetlod_error *error);

/* The content id: a digest of the header without id and checksum, and of the stored index. */
void tetlodi_content_id(const uint8_t header[HEADER_SIZE], const void *index, size_t size, uint8_t out[DIGEST_SIZE]);

/* How many bytes have to be there before a file can be opened. */
static inline uint64_t tetlodi_header_head(const struct tetlodi_header *header)
{
    return HEADER_SIZE + (uint64_t)header->index_size + header->early_size;
}

#endif
