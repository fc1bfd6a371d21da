/* SPDX-License-Identifier: BSD-3-Clause */
/* A VTU file's XML part as a table of its arrays, and the decoding of one array wherever its values are. */
#ifndef TETLOD_VTU_DOCUMENT_H
#define TETLOD_VTU_DOCUMENT_H

#include "src/io/assemble.h"
#include "src/io/file_values.h"

enum vtu_section { VTU_ELSEWHERE, VTU_POINT_DATA, VTU_CELL_DATA, VTU_POINTS, VTU_CELLS };
enum vtu_format { VTU_ASCII, VTU_INLINE, VTU_APPENDED };
enum vtu_compressor { VTU_UNCOMPRESSED, VTU_ZLIB, VTU_LZ4 };

struct vtu_array {
    char *name; /* owned */
    enum vtu_section section;
    enum vtu_format format;
    enum value_type type;
    uint64_t components;
    size_t begin, end; /* of the text between its tags */
    uint64_t offset;   /* in the appended data */
    uint64_t line;
};

struct vtu_piece {
    uint64_t points, cells;
    size_t first_array, array_end;
};

struct vtu_document {
    const unsigned char *bytes;
    size_t size;
    bool big_endian, appended_raw;
    size_t header_size; /* of a word of the headers of binary data */
    enum vtu_compressor compressor;
    size_t appended; /* where offsets count from, or size */
    struct vtu_array *arrays; /* owned */
    struct vtu_piece *pieces; /* owned */
    size_t array_count, array_capacity, piece_count, piece_capacity;
};

/* Parses the XML up to the appended data. The bytes are borrowed. To be freed also after a failure. */
TETLOD_CHECKED enum tetlod_status vtu_parse(struct vtu_document *document, const unsigned char *bytes, size_t size,
                                            struct io_report *report, struct tetlod_error *error);
void vtu_document_fini(struct vtu_document *document);

/* NULL if the piece has none; any name if `name` is NULL. */
const struct vtu_array *vtu_find(const struct vtu_document *document, const struct vtu_piece *piece,
                                 enum vtu_section section, const char *name);

/* Whether `count` values can be in the bytes that are there: to be asked before room is made for them. */
TETLOD_CHECKED enum tetlod_status vtu_check_count(const struct vtu_document *document, const struct vtu_array *array,
                                                  uint64_t count, struct tetlod_error *error);

/* Exactly `count` values. */
TETLOD_CHECKED enum tetlod_status vtu_doubles(const struct vtu_document *document, const struct vtu_array *array,
                                              size_t count, double *out, struct tetlod_error *error);
TETLOD_CHECKED enum tetlod_status vtu_ints(const struct vtu_document *document, const struct vtu_array *array,
                                           size_t count, int64_t *out, struct tetlod_error *error);

#endif
