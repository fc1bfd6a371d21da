/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * tetlod: levels of detail for tetrahedral volumes. The public interface of libtetlod.
 *
 * A stream holds levels 0 (the coarsest, the base mesh) to level_count - 1 (the original mesh). Every level is a byte
 * prefix of the stream. A reader (struct tetlod_file) gives the index; a cursor (struct tetlod_cursor) holds the mesh
 * of one level and moves to another by replaying or undoing refinement records, exactly both ways.
 *
 * An example: the coarsest level within 1 % of the fields' ranges.
 *
 *     struct tetlod_file *file = NULL;
 *     struct tetlod_cursor *cursor = NULL;
 *     struct tetlod_mesh mesh = {0};
 *     struct tetlod_error error = {TETLOD_OK, 0, ""};
 *     enum tetlod_status status = tetlod_open_fd(&file, open(path, O_RDONLY), NULL, &error);
 *     if (status == TETLOD_OK)
 *         status = tetlod_cursor_new(&cursor, file, NULL, 0, &error);
 *     const struct tetlod_info *info = status == TETLOD_OK ? tetlod_info(file) : NULL;
 *     if (status == TETLOD_OK)
 *         status = tetlod_cursor_seek(cursor, tetlod_level_for_error(info, 0.01, TETLOD_NONE, TETLOD_MAX), &error);
 *     if (status == TETLOD_OK)
 *         tetlod_cursor_mesh(cursor, &mesh); // mesh.vertices, positions, tets, corners, fields
 *
 * Ownership.
 *
 *     what                                  whose, and how long
 *     file, cursor, feed, series            the caller's; tetlod_close and the like free each
 *     source, bytes, descriptor of a file   borrowed until tetlod_close
 *     file of a cursor, series, topology    borrowed until that is freed: close the file last
 *     file of tetlod_feed_file              the feed's: do not close it
 *     what tetlod_info gives                the file's, until it is closed
 *     arrays of tetlod_cursor_mesh          the cursor's, until it moves
 *     values of tetlod_step_values          the series', until its next step
 *     arrays that a function fills          the caller's, before and after
 *
 * Caveats. A bound (TETLOD_MAX) is there for controlled fields; of others it is NaN, and a measured error may be known.
 * A level's vertices have new numbers: an index means something within one level. Positions and values are doubles,
 * whatever the original's type was. A stream that is cut off opens if its index is whole; the levels that are missing
 * fail when they are asked for.
 *
 * Conventions. Handles are opaque; every free accepts NULL. Fallible functions return enum tetlod_status and describe
 * a failure in the optional last argument. Nothing prints, exits or keeps global state. Ids and counts are 0-based.
 *
 * Threads. An open file does not change: any number of threads may use it, and cursors on it, at the same time, if its
 * source's `read` may be called by several at once (those of tetlod_open_memory and tetlod_open_fd may). A cursor is
 * for one thread at a time. So is a feed, together with its file and the cursors on that. With `threads` of struct
 * tetlod_options above 1, a cursor has helpers of its own while it decodes.
 *
 * Growing. Structs that the library fills have room for members to come, `reserved`, 0 until then. Those that a caller
 * fills begin with struct_size: members beyond it have their defaults.
 */
#ifndef TETLOD_H
#define TETLOD_H

#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#define TETLOD_VERSION_MAJOR 0
#define TETLOD_VERSION_MINOR 1
#define TETLOD_VERSION_PATCH 0
#define TETLOD_VERSION_STRING "0.1.0"

#define TETLOD_NONE UINT32_MAX

#if defined(__GNUC__)
#define TETLOD_API __attribute__((visibility("default")))
#define TETLOD_CHECKED __attribute__((warn_unused_result))
#else
#define TETLOD_API
#define TETLOD_CHECKED
#endif

/* name, number (pinned, never reused), what it says. 1-9 flow, 10-19 resources, 20-39 stream, 40-59 mesh, 60- misuse */
#define TETLOD_STATUS_LIST(X)                                                                                          \
    X(OK, 0, "done")                                                                                                   \
    X(MORE, 1, "more bytes are needed")                                                                                \
    X(END, 2, "there is no further record in that direction")                                                          \
    X(ERR_NOMEM, 10, "out of memory")                                                                                  \
    X(ERR_LIMIT, 11, "a limit was reached")                                                                            \
    X(ERR_IO, 12, "reading or writing failed")                                                                         \
    X(ERR_CANCELLED, 13, "cancelled")                                                                                  \
    X(ERR_NOT_TETLOD, 20, "not a tetlod stream")                                                                       \
    X(ERR_VERSION, 21, "the stream needs a newer reader")                                                              \
    X(ERR_STREAM, 22, "the stream is damaged")                                                                         \
    X(ERR_CHECKSUM, 23, "a checksum does not match")                                                                   \
    X(ERR_TRUNCATED, 24, "the stream ends too early")                                                                  \
    X(ERR_MESH, 40, "the mesh is not valid")                                                                           \
    X(ERR_FIELD, 41, "no such field")                                                                                  \
    X(ERR_MISMATCH, 42, "the meshes differ")                                                                           \
    X(ERR_ARGUMENT, 60, "an argument is not valid")

enum tetlod_status {
#define TETLOD_STATUS_ENUM(name, number, text) TETLOD_##name = number,
    TETLOD_STATUS_LIST(TETLOD_STATUS_ENUM)
#undef TETLOD_STATUS_ENUM
};

/* A static text for a status, never NULL. */
TETLOD_API const char *tetlod_status_text(enum tetlod_status status);

/* The library's version, as TETLOD_VERSION_STRING. */
TETLOD_API const char *tetlod_version(void);

/* What went wrong and where. `offset` is a byte offset in the stream or file where one is known, else UINT64_MAX. The
 * message has room for two long paths and what to do. */
struct tetlod_error {
    enum tetlod_status status;
    uint64_t offset;
    char message[1024];
};

/* Where a stream's bytes come from. `read` fills exactly `size` bytes from `offset` or fails; offset + size <= size of
 * the source is guaranteed by the caller. Both must outlive the file that is opened on them. */
struct tetlod_source {
    enum tetlod_status (*read)(void *opaque, uint64_t offset, void *buffer, size_t size);
    void *opaque;
    uint64_t size; /* bytes that are there; a prefix of a stream is a valid source for the levels that it holds */
};

enum tetlod_type { TETLOD_FLOAT32 = 0, TETLOD_FLOAT64 = 1 };

enum tetlod_measure { TETLOD_MAX = 0, TETLOD_SAMPLED = 1, TETLOD_RMS = 2, TETLOD_PREDICTED = 3, TETLOD_MEASURES = 4 };

/* "max", "sampled", "rms", "predicted". */
TETLOD_API const char *tetlod_measure_name(enum tetlod_measure measure);

/* A field that bounds the error of another one has that one's name and this behind it. */
#define TETLOD_BOUND_SUFFIX " bound"

struct tetlod_field {
    const char *name; /* UTF-8 */
    uint32_t components;
    enum tetlod_type type; /* of the original; a lossless stream restores it bit for bit */
    double range[2];       /* least and greatest value over all components of the original */
    int controlled;        /* its error drove the contraction */
    /* the field whose error this one bounds at every point of every level (SPEC 3.3); TETLOD_NONE: none */
    uint32_t bounds;
    uint64_t reserved[2];
};

struct tetlod_level {
    uint64_t vertices, tets;
    uint64_t offset; /* of the level's first byte: the base mesh's for level 0, its records' for the others */
    uint64_t end;    /* length of the prefix that decodes to this level */
    double domain_error;  /* fraction of the bounding box diagonal */
    const double *errors; /* [field_count * TETLOD_MEASURES], fractions of the field's range; NaN: not known */
    uint64_t reserved[2];
};

/* A part of a stream that belongs to no level: its tag says what it holds (SPEC 3.5). */
struct tetlod_section {
    char tag[5];     /* "META", "ORDR", ...; ended by NUL */
    int critical;    /* who does not know the tag cannot read the stream */
    uint64_t offset; /* in the stream */
    uint64_t stored; /* bytes there */
    uint64_t size;   /* bytes that tetlod_section_read gives */
    uint64_t reserved[2];
};

enum tetlod_cell_type {
    TETLOD_CELL_FLOAT32 = 0,
    TETLOD_CELL_FLOAT64 = 1,
    TETLOD_CELL_INT8 = 2,
    TETLOD_CELL_INT16 = 3,
    TETLOD_CELL_INT32 = 4,
    TETLOD_CELL_INT64 = 5
};

/* Values of the original's tetrahedra, such as materials. Each tetrahedron of a level is one of the original's, and has
 * its values. */
struct tetlod_cell_field {
    const char *name; /* UTF-8 */
    uint32_t components;
    enum tetlod_cell_type type;
    /* its numbers are those of regions: faces between different ones are the original's at every level */
    int region;
    double range[2]; /* of the finite ones */
    double quantum;  /* not 0: values are rounded to multiples of it */
    double error;    /* the greatest difference from the original's values, in the field's units */
};

/* A topology group: steps of a series over one mesh, where others are over other ones (SPEC 3.8). It is a stream of its
 * own inside the stream; the first one is the stream itself. */
struct tetlod_topology {
    uint32_t step_count;
    const double *times;   /* [step_count], not falling, also from one group to the next */
    char cid[33];          /* of its stream */
    uint64_t offset, size; /* of its stream's bytes in the whole */
    uint64_t reserved[2];
};

/* The index. Borrowed from the file, valid as long as it. */
struct tetlod_info {
    char cid[33]; /* content id: 32 lower case hexadecimal digits */
    uint64_t vertices, tets; /* of the original */
    uint64_t bytes;          /* of the whole stream */
    double bounds[2][3];
    enum tetlod_type position_type;
    int lossless;
    uint64_t degenerate_tets, inverted_tets, unused_points;
    uint32_t field_count, level_count;
    const struct tetlod_field *fields;
    const struct tetlod_level *levels;
    const char *metadata; /* a JSON object: units, provenance; NUL-terminated */
    size_t metadata_size;
    int keeps_order; /* the original's own numbering is in it: tetlod_order */
    uint32_t section_count;
    const struct tetlod_section *sections;
    uint32_t cell_field_count;
    const struct tetlod_cell_field *cell_fields;
    uint32_t topology_count; /* 0: all steps have this mesh */
    const struct tetlod_topology *topologies;
    uint32_t cell_rows; /* rows of the values of cells: one for each cell that was split; 0: one for a tetrahedron */
    uint32_t page_count;        /* of all levels in pages (SPEC 7.6); 0: there are none */
    uint32_t first_paged_level; /* from there on levels are in pages, but for the exact values of a last one */
    int exact_last;             /* the last level has the tetrahedra of the one before, and makes values exact */
    uint64_t stream_offset; /* of the stream in its source: not 0 in an HDF5 file that holds one (SPEC 3.10) */
};

/* Set struct_size = sizeof it and leave the rest 0 for defaults. */
struct tetlod_options {
    size_t struct_size;
    /* memory that a file and its cursor may take together; 0: 16 GiB. Never more than 64 MiB and 256 for each byte of
     * the stream */
    uint64_t max_bytes;
    /* Where a cursor's arrays, which grow with the mesh, come from; NULL: realloc and free. Resizes a block (NULL: a
     * new one) to `size` bytes and returns it, or NULL with the block unchanged; `size` 0 frees it. Called by the
     * cursor's thread. */
    void *(*allocate)(void *opaque, void *block, size_t size);
    void *opaque;
    /* Threads that tetlod_cursor_seek decodes with, each a field, or a page of a level in pages; the caller's is one; 0
     * and 1: that one alone. They end before it returns. The source's `read` is called by all of them. Results do not
     * depend on it. */
    uint32_t threads;
};

struct tetlod_file;
struct tetlod_cursor;

/* Opens a stream: reads and checks header and index, nothing of the levels. Costs O(index). The source is copied, what
 * it points at is borrowed. On failure *out is NULL. ERR_NOT_TETLOD, ERR_VERSION, ERR_STREAM, ERR_CHECKSUM,
 * ERR_TRUNCATED, ERR_LIMIT, ERR_NOMEM, or what the source returned. */
TETLOD_API TETLOD_CHECKED enum tetlod_status tetlod_open(struct tetlod_file **out, const struct tetlod_source *source,
                                                         const struct tetlod_options *options,
                                                         struct tetlod_error *error);

/* The same over bytes that the caller keeps. */
TETLOD_API TETLOD_CHECKED enum tetlod_status tetlod_open_memory(struct tetlod_file **out, const void *bytes,
                                                                size_t size,
                                                                const struct tetlod_options *options,
                                                                struct tetlod_error *error);

/* The same over a regular file's descriptor, which stays the caller's and must stay open. */
TETLOD_API TETLOD_CHECKED enum tetlod_status tetlod_open_fd(struct tetlod_file **out, int fd,
                                                            const struct tetlod_options *options,
                                                            struct tetlod_error *error);

/* Opens a topology group as a stream of its own, over the same source, which both borrow; `file` may be closed before
 * it. Number 0 has the levels and steps of `file` itself. ERR_ARGUMENT if there is no such group, or as tetlod_open. */
TETLOD_API TETLOD_CHECKED enum tetlod_status tetlod_open_topology(struct tetlod_file **out,
                                                                  const struct tetlod_file *file, uint32_t topology,
                                                                  struct tetlod_error *error);

/* The topology group of a step, counted through all of them, and in *out_step (may be NULL) its number there.
 * TETLOD_NONE: there are none, or not so many steps. */
TETLOD_API uint32_t tetlod_topology_of_step(const struct tetlod_info *info, uint32_t step, uint32_t *out_step);

/* The topology group with the step whose time is nearest, or TETLOD_NONE if there are none. */
TETLOD_API uint32_t tetlod_topology_for_time(const struct tetlod_info *info, double time);

TETLOD_API void tetlod_close(struct tetlod_file *file);

TETLOD_API const struct tetlod_info *tetlod_info(const struct tetlod_file *file);

/* The original's own numbering: vertices[i] and tets[i] are the numbers there of vertex and tetrahedron i of the finest
 * level, and corner c of the original tetrahedron is corner corners[4 * i + c] of this one. The caller's arrays have
 * info->vertices, info->tets and 4 * info->tets elements. ERR_ARGUMENT if the stream does not keep it, or as the
 * cursor. */
TETLOD_API TETLOD_CHECKED enum tetlod_status tetlod_order(const struct tetlod_file *file, uint32_t *vertices,
                                                          uint32_t *tets,
                                                          uint8_t *corners, struct tetlod_error *error);

/* Reads section number `section` of the index, whatever its tag, checked and unpacked, into `out` of
 * info->sections[section].size bytes. ERR_ARGUMENT if there is none, or as tetlod_open. */
TETLOD_API TETLOD_CHECKED enum tetlod_status tetlod_section_read(const struct tetlod_file *file, uint32_t section,
                                                                 void *out,
                                                                 struct tetlod_error *error);

/* Number of the first section with a tag, or TETLOD_NONE. */
TETLOD_API uint32_t tetlod_section_index(const struct tetlod_info *info, const char *tag);

/* All values of a cell field, [components * info->tets] in the order in which tetrahedra arrive: those of a level's
 * tetrahedra are the first. They lie behind the last level: ERR_TRUNCATED in a prefix without them, whose levels can be
 * read all the same. ERR_ARGUMENT if there is no such field, ERR_STREAM, or as tetlod_section_read. */
TETLOD_API TETLOD_CHECKED enum tetlod_status tetlod_cells(const struct tetlod_file *file, uint32_t field, double *out,
                                                          struct tetlod_error *error);

/* Number of the section with a cell field's values, or TETLOD_NONE. Where they are stored once a cell, the map PMAP
 * from tetrahedra to cells lies before all of them, and is needed too. */
TETLOD_API uint32_t tetlod_cell_section(const struct tetlod_info *info, uint32_t field);

/* Index of a cell field by name, or TETLOD_NONE. */
TETLOD_API uint32_t tetlod_cell_field_index(const struct tetlod_info *info, const char *name);

/* Index of a field by name, or TETLOD_NONE. */
TETLOD_API uint32_t tetlod_field_index(const struct tetlod_info *info, const char *name);

/* The coarsest level whose error is at most `error` (a fraction of the range) in `measure`, for `field`, or for every
 * controlled field if `field` is TETLOD_NONE. TETLOD_NONE if no level does (lossy streams), or if the measure is not in
 * the index. Where the finest level is exact, every error >= 0 has a level. */
TETLOD_API uint32_t tetlod_level_for_error(const struct tetlod_info *info, double error, uint32_t field,
                                           enum tetlod_measure measure);

/* The same for an error in the field's own units: for several fields, each in its own range. */
TETLOD_API uint32_t tetlod_level_for_abs_error(const struct tetlod_info *info, double error, uint32_t field,
                                               enum tetlod_measure measure);

/* The finest level of at most `tets` tetrahedra, or of at most `bytes` bytes; level 0 if even that has more. */
TETLOD_API uint32_t tetlod_level_for_tets(const struct tetlod_info *info, uint64_t tets);
TETLOD_API uint32_t tetlod_level_for_bytes(const struct tetlod_info *info, uint64_t bytes);

/* The bytes to fetch for a move. `from` is the level that is there, TETLOD_NONE if not even the index is; `to` is
 * finer. With the geometry come the fields with these numbers (`fields` NULL: all of them). Spans are in order,
 * neighbours joined. Returns how many there are, and writes as many as `capacity` allows. Order and other late sections
 * are not among them: info->sections. */
struct tetlod_span {
    uint64_t offset, size;
};
TETLOD_API size_t tetlod_spans(const struct tetlod_file *file, uint32_t from, uint32_t to, const uint32_t *fields,
                               uint32_t field_count, struct tetlod_span *out, size_t capacity);

/* The mesh that a cursor holds, as flat arrays that stay valid until the cursor moves or is freed. Vertices and
 * tetrahedra are numbered in order of arrival: refining changes corners of present tetrahedra and appends, it never
 * renumbers. */
struct tetlod_mesh {
    uint32_t vertices, tets, level;
    const double *positions;     /* [3 * vertices] */
    const double *const *fields; /* [field_count], each [components * vertices], or NULL if not selected */
    const uint32_t *corners;     /* [4 * tets] */
    const uint32_t *parents;     /* [vertices] the vertex that it was split from, itself in the base mesh */
    const void *reserved[4];
};

/* A cursor at level 0. `fields` selects the fields to decode by index (NULL: all of them). The file is borrowed. */
TETLOD_API TETLOD_CHECKED enum tetlod_status tetlod_cursor_new(struct tetlod_cursor **out, struct tetlod_file *file,
                                                               const uint32_t *fields, uint32_t field_count,
                                                               struct tetlod_error *error);
TETLOD_API void tetlod_cursor_free(struct tetlod_cursor *cursor);

/* Moves to a level by replaying or undoing. Costs O(records between). On failure the cursor is at the last level
 * that could be decoded and stays usable. */
TETLOD_API TETLOD_CHECKED enum tetlod_status tetlod_cursor_seek(struct tetlod_cursor *cursor, uint32_t level,
                                                                struct tetlod_error *error);

/* Moves towards a level by at most `records` records, so that no call takes long: a level's exact tail counts as one,
 * and reading and checking a level's frames comes with its first record. TETLOD_MORE if the level is not reached yet;
 * otherwise as tetlod_cursor_seek. Between two calls the cursor holds a mesh like any other, and may go elsewhere. */
TETLOD_API TETLOD_CHECKED enum tetlod_status tetlod_cursor_step(struct tetlod_cursor *cursor, uint32_t level,
                                                                uint32_t records,
                                                                struct tetlod_error *error);

/* Decodes one more field, for the current mesh and from then on. The cursor stays where it is. Costs what a new cursor
 * costs, and its memory meanwhile. On failure the cursor is as it was. ERR_ARGUMENT if there is no such field, or as
 * the cursor. */
TETLOD_API TETLOD_CHECKED enum tetlod_status tetlod_cursor_add_field(struct tetlod_cursor *cursor, uint32_t field,
                                                                     struct tetlod_error *error);

/* One record up or down. TETLOD_END at the finest level or at the base mesh. */
TETLOD_API TETLOD_CHECKED enum tetlod_status tetlod_cursor_refine(struct tetlod_cursor *cursor,
                                                                  struct tetlod_error *error);
TETLOD_API TETLOD_CHECKED enum tetlod_status tetlod_cursor_coarsen(struct tetlod_cursor *cursor,
                                                                   struct tetlod_error *error);

/* ---- some of the pages (SPEC 7.6): finer in parts of space than elsewhere, of streams with levels in pages */

/* A part of space, and the level that is wanted there. */
struct tetlod_place {
    double low[3], high[3]; /* of a box; a ball has its middle in `low`, and `high` is not used */
    double radius;          /* of a ball; 0: it is a box */
    uint32_t level;
};

/* A closed set of pages: with each page it has those that this page needs, so that they are a mesh together, without
 * gaps. At each point that mesh has the error of the level below the coarsest one of which a page is missing there. */
struct tetlod_page_set;

/* The pages of all levels up to `level`, of each place those up to its level whose boxes meet it, and all that these
 * need. Levels that are not in pages need none; the finest, which makes values exact, is for no places: take the one
 * before. ERR_ARGUMENT for a level that is not there, or for that one; ERR_NOMEM. */
TETLOD_API TETLOD_CHECKED enum tetlod_status tetlod_page_set_new(struct tetlod_page_set **out,
                                                                 const struct tetlod_file *file, uint32_t level,
                                                                 const struct tetlod_place *places, size_t place_count,
                                                                 struct tetlod_error *error);
TETLOD_API void tetlod_page_set_free(struct tetlod_page_set *set);

/* The same for so much memory (as tetlod_page_set_info says it): where that is not enough no level is finer than
 * *out_level, the finest for which it is enough, and coarser ones stay. ERR_LIMIT, and what they take, if even the
 * levels before those in pages take more. */
TETLOD_API TETLOD_CHECKED enum tetlod_status tetlod_page_set_fit(struct tetlod_page_set **out,
                                                                 const struct tetlod_file *file, uint32_t level,
                                                                 const struct tetlod_place *places, size_t place_count,
                                                                 uint64_t memory, uint32_t *out_level,
                                                                 struct tetlod_error *error);

/* One page more, by its level and its number there, and all that it needs. ERR_ARGUMENT if there is no such page. */
TETLOD_API TETLOD_CHECKED enum tetlod_status tetlod_page_set_add(struct tetlod_page_set *set, uint32_t level,
                                                                 uint32_t page, struct tetlod_error *error);

/* Takes a page out, if no page of the set needs it: ERR_ARGUMENT if one does, or if the page is not in the set. */
TETLOD_API TETLOD_CHECKED enum tetlod_status tetlod_page_set_remove(struct tetlod_page_set *set, uint32_t level,
                                                                    uint32_t page, struct tetlod_error *error);

/* Is a page in the set? */
TETLOD_API int tetlod_page_set_has(const struct tetlod_page_set *set, uint32_t level, uint32_t page);

/* What a set is. */
struct tetlod_page_set_info {
    uint32_t level; /* the finest of which it has a page, or the last one before those in pages */
    uint32_t pages;
    uint64_t vertices, tets; /* of the mesh with these pages */
    uint64_t memory;         /* bytes that a cursor with them and with all fields takes, not more */
    uint64_t reserved[1];
};
TETLOD_API void tetlod_page_set_info(const struct tetlod_page_set *set, struct tetlod_page_set_info *out);

/* The bytes of the set's pages, as tetlod_spans says those of levels: these and tetlod_spans up to the level before
 * info->first_paged_level are what the set's mesh is decoded from. Spans with at most `gap` bytes between them are
 * joined: 24 KiB is a good gap where a request takes some tens of milliseconds. */
TETLOD_API size_t tetlod_page_set_spans(const struct tetlod_page_set *set, const uint32_t *fields, uint32_t field_count,
                                        uint64_t gap, struct tetlod_span *out, size_t capacity);

/* A page's row. */
struct tetlod_page {
    uint32_t vertices, tets; /* that it adds */
    double low[3], high[3];  /* a box around its tetrahedra */
    uint32_t needed_count;
    const uint32_t *needed; /* pages of the level before, by their numbers there; the file's */
    uint64_t reserved[2];
};

/* How many pages a level has: 0 if it is not in pages. */
TETLOD_API uint32_t tetlod_page_count(const struct tetlod_file *file, uint32_t level);

/* ERR_ARGUMENT if there is no such page. */
TETLOD_API TETLOD_CHECKED enum tetlod_status tetlod_page(const struct tetlod_file *file, uint32_t level, uint32_t page,
                                                         struct tetlod_page *out, struct tetlod_error *error);

/* The bytes of one page alone, as tetlod_page_set_spans says those of a set: for readers that keep or drop pages one by
 * one. 0 spans: there is no such page, or it adds nothing. */
TETLOD_API size_t tetlod_page_spans(const struct tetlod_file *file, uint32_t level, uint32_t page,
                                    const uint32_t *fields, uint32_t field_count, struct tetlod_span *out,
                                    size_t capacity);

/* From now on levels have the pages of this set only (NULL: all), up to the set's level. Pages that the cursor has and
 * that are not in the set go at once, without decoding; those that stay are kept; those that it has not are decoded,
 * and no others, when the set's level is asked for: whichever pages it had before, the mesh is then the same.
 * tetlod_cursor_step and tetlod_cursor_refine bring a page at least. Numbers are dense, in the order of pages: those
 * behind a page that goes or comes change, which takes a pass over what the cursor has. From all pages to a set, or
 * back, nothing is kept of the levels in pages. The set is copied. ERR_ARGUMENT if it is another file's; ERR_LIMIT, and
 * what they take, if the pages take more memory than the file's options allow; else as the cursor. Then the cursor has
 * the pages that it had. */
TETLOD_API TETLOD_CHECKED enum tetlod_status tetlod_cursor_select(struct tetlod_cursor *cursor,
                                                                  const struct tetlod_page_set *set,
                                                                  struct tetlod_error *error);

/* Which numbers the vertices and tetrahedra of the current mesh have with all pages: those by which tetlod_cells has
 * its values. Both are ascending, have room for all, and may be NULL. */
TETLOD_API void tetlod_cursor_numbers(const struct tetlod_cursor *cursor, uint32_t *vertices, uint32_t *tets);

/* The level that each tetrahedron of the current mesh is of, and whose errors hold in it. */
TETLOD_API void tetlod_cursor_tet_levels(const struct tetlod_cursor *cursor, uint32_t *out);

/* The current mesh; between two levels `level` is the coarser one. */
TETLOD_API void tetlod_cursor_mesh(const struct tetlod_cursor *cursor, struct tetlod_mesh *out);

/* What the current mesh has otherwise than a coarser `level`, beside what it has more: vertices of that level with
 * another position or value, tetrahedra of that level with another corner, in ascending order. For buffers that hold
 * one of the two and shall hold the other: ask after going up, or before going down. `vertices` and `tets` have room
 * for those of the level. Costs O(mesh + records between). ERR_ARGUMENT for a level above the current one,
 * ERR_NOMEM. */
TETLOD_API TETLOD_CHECKED enum tetlod_status tetlod_cursor_changes(const struct tetlod_cursor *cursor, uint32_t level,
                                                                   uint32_t *vertices, uint32_t *vertex_count,
                                                                   uint32_t *tets, uint32_t *tet_count,
                                                                   struct tetlod_error *error);

/* The numbers of `count` vertices from `first` on as float32, rounded to nearest: of a field, or the positions if
 * `field` is TETLOD_NONE. ERR_FIELD if it is not selected, ERR_ARGUMENT if there are not so many vertices. */
TETLOD_API TETLOD_CHECKED enum tetlod_status tetlod_cursor_floats(const struct tetlod_cursor *cursor, uint32_t field,
                                                                  uint32_t first, uint32_t count, float *out,
                                                                  struct tetlod_error *error);

/* For geomorphs: where every vertex of the current mesh comes from at a coarser `level`: the position there of the
 * vertex that it was split from, or was itself, and that one's values. `positions` [3 * vertices] and `fields`
 * [field_count], each [components * vertices] or NULL, are the caller's; either may be NULL. Costs O(vertices + records
 * between). ERR_ARGUMENT for a level above the current one. */
TETLOD_API TETLOD_CHECKED enum tetlod_status tetlod_cursor_origins(const struct tetlod_cursor *cursor, uint32_t level,
                                                                   double *positions, double *const *fields,
                                                                   struct tetlod_error *error);

/* Push decoding, for bytes that arrive in order: add what has come, open cursors on the file as soon as it is there,
 * seek to levels up to tetlod_feed_level; a level beyond it is ERR_TRUNCATED and can be tried again later. */
struct tetlod_feed;
TETLOD_API TETLOD_CHECKED enum tetlod_status tetlod_feed_new(struct tetlod_feed **out,
                                                             const struct tetlod_options *options,
                                                             struct tetlod_error *error);
/* Frees the file too; its cursors must be freed before. */
TETLOD_API void tetlod_feed_free(struct tetlod_feed *feed);

/* Before the first bytes: what will be added is header and index, and of every level the frames of its geometry and of
 * the fields with these names, nothing of others (SPEC 3; a server's `prefix` and `records` with `fields`). The names
 * are copied. Cursors can open with these fields only. ERR_NOMEM; if there is no such field, tetlod_feed_add says
 * ERR_FIELD. */
TETLOD_API TETLOD_CHECKED enum tetlod_status tetlod_feed_select(struct tetlod_feed *feed, const char *const *names,
                                                                uint32_t count, struct tetlod_error *error);

/* Copies `size` bytes: of a stream, or of an HDF5 file with one in it (format/SPEC.md, 3.10), whose other bytes are
 * passed. Offsets below are those in the stream. TETLOD_MORE until the index is complete, then OK; or as tetlod_open.
 */
TETLOD_API TETLOD_CHECKED enum tetlod_status tetlod_feed_add(struct tetlod_feed *feed, const void *bytes, size_t size,
                                                             struct tetlod_error *error);

/* NULL until the index is complete. Owned by the feed. */
TETLOD_API struct tetlod_file *tetlod_feed_file(const struct tetlod_feed *feed);

/* The finest level that is there whole, or TETLOD_NONE. */
TETLOD_API uint32_t tetlod_feed_level(const struct tetlod_feed *feed);

/* What was added and has not been dropped, until the next call; *size: how many bytes. */
TETLOD_API const void *tetlod_feed_added(const struct tetlod_feed *feed, size_t *size);

/* Gives back the memory of the bytes of levels 0 to `level`, which are there. For when the cursors that are wanted have
 * them: a cursor that needs them from now on, a new one too, says ERR_TRUNCATED. */
TETLOD_API void tetlod_feed_drop(struct tetlod_feed *feed, uint32_t level);

/* Copies bytes of the stream that lie elsewhere, once the index is there: a section, a group of steps. They are found
 * by whoever reads exactly these, or some of them, until they are forgotten. */
TETLOD_API TETLOD_CHECKED enum tetlod_status tetlod_feed_put(struct tetlod_feed *feed, uint64_t offset,
                                                             const void *bytes, size_t size,
                                                             struct tetlod_error *error);
TETLOD_API void tetlod_feed_forget(struct tetlod_feed *feed);

/* How many bytes have to be added for a level, once the index is there: the length of its prefix without what is not
 * selected. */
TETLOD_API uint64_t tetlod_feed_bytes(const struct tetlod_feed *feed, uint32_t level);

/* ---- series in time (SPEC 3.7): values of some fields at steps, over levels of the one mesh */

/* Values that are within `error` of the original's at every step: a fraction of the field's range over the series. 0:
 * exact. */
struct tetlod_band {
    double error;
    uint32_t level; /* whose vertices have values */
    uint64_t reserved[2];
};

/* Steps that are stored together: 0 to 7, 8 to 15, ... */
enum { TETLOD_STEP_GROUP = 8 };

struct tetlod_series_info {
    uint32_t step_count, band_count, field_count;
    /* the number, of these fields, of the one that moves the points; TETLOD_NONE: they keep their places */
    uint32_t displacement;
    const double *times;             /* [step_count], not falling */
    const struct tetlod_band *bands; /* coarse to fine */
    const uint32_t *fields;          /* [field_count] of the stream */
    const double (*ranges)[2];       /* [field_count] over all steps */
    uint32_t cell_field_count;            /* cell fields that have values at every step */
    const uint32_t *cell_fields;          /* [cell_field_count] of the stream's cell fields, ascending */
    const double (*cell_ranges)[2];       /* [cell_field_count] over all steps */
    const enum tetlod_type *types;        /* [field_count] of the steps' values; a field itself may be float32 */
};

struct tetlod_series;

/* Reads the table of steps. The file is borrowed. ERR_ARGUMENT if the stream has no steps; ERR_STREAM, or as
 * tetlod_section_read. */
TETLOD_API TETLOD_CHECKED enum tetlod_status tetlod_series_new(struct tetlod_series **out,
                                                               const struct tetlod_file *file,
                                                               struct tetlod_error *error);
TETLOD_API void tetlod_series_free(struct tetlod_series *series);

/* Borrowed from the series. */
TETLOD_API const struct tetlod_series_info *tetlod_series_info(const struct tetlod_series *series);

/* The coarsest band whose error is at most `error` (a fraction of the range), or TETLOD_NONE. */
TETLOD_API uint32_t tetlod_band_for_error(const struct tetlod_series_info *info, double error);

/* The same for an error in the fields' units, which holds for every field. */
TETLOD_API uint32_t tetlod_band_for_abs_error(const struct tetlod_series_info *info, double error);

/* The coarsest band in which the errors of one step (tetlod_step_error) are at most `error`, those of all fields: often
 * a coarser one than that which holds for every step. A fraction of the range over all steps, or in the fields' units.
 * Where the metadata say that errors are fractions of each step's own range (format/SPEC.md, 3.7), the bands' hold. */
TETLOD_API uint32_t tetlod_band_for_step(const struct tetlod_series *series, uint32_t step, double error);
TETLOD_API uint32_t tetlod_band_for_step_abs(const struct tetlod_series *series, uint32_t step, double error);

/* The step whose time is nearest: the first of several. */
TETLOD_API uint32_t tetlod_step_for_time(const struct tetlod_series_info *info, double time);

/* A bound of the error of the series' field number `field` at one step in one band, a fraction of its range; NaN if
 * there is no such step or band. */
TETLOD_API double tetlod_step_error(const struct tetlod_series *series, uint32_t field, uint32_t band, uint32_t step);

/* The bytes of the stream that a step needs in a band, of one field: those of its group of steps. Size 0 if there
 * are none. */
TETLOD_API struct tetlod_span tetlod_step_span(const struct tetlod_series *series, uint32_t field, uint32_t band,
                                               uint32_t step);

/* Moves the cursor, which is on the series' file, to the band's level, and decodes the values of a step there. The step
 * after the last one costs one frame, others those of their group up to it. Keep one series for each cursor.
 * ERR_ARGUMENT, or as tetlod_cursor_seek. */
TETLOD_API TETLOD_CHECKED enum tetlod_status tetlod_seek_step(struct tetlod_series *series,
                                                              struct tetlod_cursor *cursor, uint32_t band,
                                                              uint32_t step, struct tetlod_error *error);

/* The same without a cursor: `corners` are those of the band's level, from wherever the caller has them. */
TETLOD_API TETLOD_CHECKED enum tetlod_status tetlod_series_decode(struct tetlod_series *series,
                                                                  const uint32_t *corners, uint32_t band,
                                                                  uint32_t step, struct tetlod_error *error);

/* From now on only `count` of the series' fields are read and decoded, and the one that moves the points; NULL: all. */
TETLOD_API void tetlod_series_select(struct tetlod_series *series, const uint32_t *fields, uint32_t count);

/* The values that the last tetlod_seek_step gave, of the series' field number `field`: [components * vertices of the
 * band's level]; NULL if there are none. Valid until the next one. */
TETLOD_API const double *tetlod_step_values(const struct tetlod_series *series, uint32_t field);

/* Moves points to where they are at that step: `positions` [3 * vertices] are those of the band's level. Does nothing
 * where points keep their places. ERR_STREAM if one would not be finite. */
TETLOD_API TETLOD_CHECKED enum tetlod_status tetlod_step_move(const struct tetlod_series *series, double *positions,
                                                              struct tetlod_error *error);

/* Are there values of a cell field at a step? Those that have no steps are known at the first one only. */
TETLOD_API int tetlod_has_step_cells(const struct tetlod_series *series, uint32_t field, uint32_t step);

/* The values of cell field number `field` of the stream at a step, as tetlod_cells gives them. The step after the last
 * one costs one frame. ERR_ARGUMENT where there are none, or as tetlod_cells. */
TETLOD_API TETLOD_CHECKED enum tetlod_status tetlod_step_cells(struct tetlod_series *series, uint32_t field,
                                                               uint32_t step, double *out, struct tetlod_error *error);

/* The bytes of the stream that this needs beside those of tetlod_cells. Size 0: none. */
TETLOD_API struct tetlod_span tetlod_step_cells_span(const struct tetlod_series *series, uint32_t field, uint32_t step);

#ifdef __cplusplus
}
#endif
#endif
