/* SPDX-License-Identifier: BSD-3-Clause */
/* Header and index of a stream (SPEC.md, file layout): everything that a client needs to choose a level. */
#ifndef TETLOD_INDEX_H
#define TETLOD_INDEX_H

#include "format/bytes.h"
#include "format/values.h"

enum {
    HEADER_SIZE = 64,
    FORMAT_MAJOR = 2,
    FORMAT_MINOR = 0,
    MOST_TETS = 1 << 30,
    MOST_FIELDS = 256,
    MOST_LEVELS = 65536,
    MOST_METADATA = 1 << 20,
    MOST_INDEX = 1 << 28,
    MOST_BITS = 30,
    LEAST_SLOWEST = 5,
    MOST_SLOWEST = 7,
    MOST_EXPANSION = 1024, /* vertices or tetrahedra that a level adds per byte of its geometry, and one byte more */
};

#define TETLODI_MAGIC "\x89TLD\r\n\x1a\n"

/* What one coder has written for one level, or the original order at the end. */
struct tetlodi_frame {
    uint64_t offset;
    uint32_t size, crc;
};

/* The index as it is in memory; `info` points into the rest. Frames of level k: [k * (1 + field_count)] is the geometry's,
 * the fields' follow. */
struct tetlodi_index {
    struct tetlod_info info;
    struct tetlod_field *fields;
    struct tetlod_level *levels;
    double *errors; /* [level][field][measure] */
    struct tetlodi_scale *scales; /* [1 + field_count] of positions, of the fields */
    struct tetlodi_frame *frames;
    struct tetlodi_frame order; /* size 0: not kept */
    uint8_t *exact_later;       /* [field] coded on its grid, the tail has what makes it exact */
    int tail;                   /* the last level has the mesh of the one before it, and the tails */
    unsigned slowest;           /* the coder's slowest step of learning, 1/2^slowest */
    char *text;     /* names and metadata */
};

struct tetlodi_header {
    uint32_t index_size, index_crc;
    uint64_t file_size;
    uint8_t cid[16];
};

void tetlodi_index_fini(struct tetlodi_index *index);

/* Allocates the arrays for info.field_count fields and info.level_count levels. False: out of memory. */
bool tetlodi_index_allocate(struct tetlodi_index *index);

/* The header's 64 bytes. */
void tetlodi_header_encode(const struct tetlodi_header *header, uint8_t out[HEADER_SIZE]);
TETLOD_CHECKED enum tetlod_status tetlodi_header_decode(struct tetlodi_header *header, const uint8_t bytes[HEADER_SIZE],
                                                        struct tetlod_error *error);

/* The content id: SHA-256, shortened, over the header without id and checksum, and the stored index. */
void tetlodi_content_id(const uint8_t header[HEADER_SIZE], const void *index, size_t size, uint8_t out[16]);

/* Index to bytes and back. Offsets are not stored: frames follow each other from `first_offset`. */
void tetlodi_index_encode(const struct tetlodi_index *index, struct tetlodi_buffer *out);
TETLOD_CHECKED enum tetlod_status tetlodi_index_decode(struct tetlodi_index *index, const void *bytes, size_t size,
                                                       uint64_t first_offset, struct tetlod_error *error);

#endif
