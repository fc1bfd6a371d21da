/* SPDX-License-Identifier: BSD-3-Clause */
/* The XML part of a VTK file as tables of its pieces, arrays and further files, and the decoding of one array wherever
 * its values are. */
#ifndef TETLOD_VTKXML_DOCUMENT_H
#define TETLOD_VTKXML_DOCUMENT_H

#include "src/io/services/assemble.h"
#include "src/io/services/file_values.h"

/* What the type of a file says. */
enum vtkxml_kind {
    VTKXML_UNSTRUCTURED,
    VTKXML_STRUCTURED,
    VTKXML_RECTILINEAR,
    VTKXML_IMAGE,
    VTKXML_POLYGONS,   /* surfaces: nothing for tetlod */
    VTKXML_MULTIBLOCK, /* blocks and partitions in files of their own */
    VTKXML_COLLECTION, /* the same, at several times */
};

enum vtkxml_section {
    VTKXML_ELSEWHERE,
    VTKXML_POINT_DATA,
    VTKXML_CELL_DATA,
    VTKXML_POINTS,
    VTKXML_CELLS,
    VTKXML_COORDINATES
};
enum vtkxml_format { VTKXML_ASCII, VTKXML_INLINE, VTKXML_APPENDED };
enum vtkxml_compressor { VTKXML_UNCOMPRESSED, VTKXML_ZLIB, VTKXML_LZ4, VTKXML_LZMA };

struct vtkxml_array {
    char *name; /* owned */
    char unit[UNIT_SIZE];
    enum vtkxml_section section;
    enum vtkxml_format format;
    enum value_type type;
    uint64_t components;
    size_t begin, end; /* of the text between its tags */
    uint64_t offset;   /* in the appended data */
    uint64_t line;
};

struct vtkxml_piece {
    uint64_t points, cells;
    int64_t extent[6]; /* of structured kinds: the first and last point along i, j, k */
    size_t first_array, array_end;
    char *source; /* owned: of a parallel form, the file that it is in; or NULL */
};

/* A file that another one is made of. */
struct vtkxml_part {
    char *file;
    /* owned, as `file` is: "/BLOCK/.../NAME/", the names of the blocks that it is in and its own; those without a name
     * are not in it */
    char *path;
    double time;
    bool has_time;
};

struct vtkxml_document {
    const struct file_input *file; /* or NULL: all is in memory */
    /* of which the first `text` are not raw appended data, which is read range by range */
    const unsigned char *bytes;
    size_t text, size;
    struct file_view *view; /* of the bytes, or NULL */
    enum vtkxml_kind kind;
    bool big_endian, appended_raw, is_old_lagrange; /* the last: before version 2.1 */
    size_t header_size; /* of a word of the headers of binary data */
    enum vtkxml_compressor compressor;
    size_t appended; /* where offsets count from, or size */
    int64_t extent[6]; /* of the whole */
    double origin[3], spacing[3], direction[9]; /* of an image */
    struct vtkxml_array *arrays; /* owned */
    struct vtkxml_piece *pieces; /* owned */
    struct vtkxml_part *parts;   /* owned */
    size_t array_count, array_capacity, piece_count, piece_capacity, part_count, part_capacity;
};

/* Parses the XML up to the appended data. The input is borrowed. To be freed also after a failure. */
TETLOD_CHECKED enum tetlod_status vtkxml_parse(struct vtkxml_document *document, const struct io_input *input,
                                               struct io_report *report, struct tetlod_error *error);
void vtkxml_document_fini(struct vtkxml_document *document);

/* NULL if the piece has none; any name if `name` is NULL. */
const struct vtkxml_array *vtkxml_find(const struct vtkxml_document *document, const struct vtkxml_piece *piece,
                                       enum vtkxml_section section, const char *name);

/* Whether `count` values can be in the bytes that are there: to be asked before room is made for them. */
TETLOD_CHECKED enum tetlod_status vtkxml_check_count(const struct vtkxml_document *document,
                                                     const struct vtkxml_array *array, uint64_t count,
                                                     struct tetlod_error *error);

/* What values become: double, int64_t, uint32_t and uint8_t by values_to_points and values_to_bytes. */
enum vtkxml_result { VTKXML_DOUBLES, VTKXML_INTS, VTKXML_NUMBERS, VTKXML_BYTES };

/* Of an array of exactly `all` values those that are wanted: `count` from `first` on. */
struct vtkxml_slice {
    uint64_t all, first, count;
};

static inline struct vtkxml_slice vtkxml_whole(uint64_t count)
{
    return (struct vtkxml_slice){count, 0, count};
}

/* Values of a slice, decompressed and converted on all threads. Of text there is only the whole. */
TETLOD_CHECKED enum tetlod_status vtkxml_values(const struct vtkxml_document *document,
                                                const struct vtkxml_array *array,
                                                struct vtkxml_slice slice, enum vtkxml_result result, void *out,
                                                struct tetlod_error *error);

/* Whether the integers of a slice are first, first + step, ...: no room for them is needed. Of text it says no. */
TETLOD_CHECKED enum tetlod_status vtkxml_is_sequence(const struct vtkxml_document *document,
                                                     const struct vtkxml_array *array,
                                                     struct vtkxml_slice slice, int64_t first, int64_t step, bool *out,
                                                     struct tetlod_error *error);

/* Can ranges of the piece be read each by itself? */
bool vtkxml_has_ranges(const struct vtkxml_document *document, const struct vtkxml_piece *piece);

/* One block of the points, cells and values of a piece, or of one of `ranges` ranges of each of these. */
TETLOD_CHECKED enum tetlod_status vtkxml_read_piece(const struct vtkxml_document *document,
                                                    const struct vtkxml_piece *piece, uint32_t range, uint32_t ranges,
                                                    struct block *block, struct io_report *report,
                                                    struct tetlod_error *error);

/* Makes one structured block of those from `first` on, which lie in the whole extent as `extents` (six numbers each)
 * says. */
TETLOD_CHECKED enum tetlod_status vtkxml_join(struct blocks *blocks, size_t first, const int64_t (*extents)[6],
                                              const int64_t whole[6], struct io_report *report,
                                              struct tetlod_error *error);

#endif
