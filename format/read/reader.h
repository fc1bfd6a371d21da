/* SPDX-License-Identifier: BSD-3-Clause */
/* An open stream, as the cursor and the server see it. Not installed. */
#ifndef TETLOD_READER_H
#define TETLOD_READER_H

#include "format/coding/index.h"

/* A stream inside a source: that of a topology group, with the times of its steps, or one in an HDF5 file. */
struct tetlodi_part {
    struct tetlod_source whole;
    uint64_t offset;
    uint32_t step_count; /* 0: it is no topology group */
    double times[];
};

struct tetlod_file {
    struct tetlod_source source;
    struct tetlod_options options; /* none is left out */
    uint64_t index_bytes;          /* that the index takes */
    struct tetlodi_part *part;     /* of a larger source that `source` is, or NULL */
    struct tetlodi_index index;
};

/* Memory that a cursor or a series may take: no stream of an encoder needs as much for each of its bytes. */
uint64_t tetlodi_memory_limit(const struct tetlod_file *file);

/* A caller's options with defaults for what it does not have or leaves 0. */
struct tetlod_options tetlodi_options(const struct tetlod_options *options);

/* The part's bytes, of which there are at most `size`. */
struct tetlod_source tetlodi_part_source(struct tetlodi_part *part, uint64_t size);

/* Reads and checks a frame and gives what is in it; the caller frees *out. `part` 0 is a level's geometry, 1 + f field
 * f; the level is not in pages. ERR_CHECKSUM, ERR_TRUNCATED, ERR_STREAM, ERR_LIMIT, ERR_NOMEM, or the source's. */
TETLOD_CHECKED enum tetlod_status tetlodi_read_frame(const struct tetlod_file *file, uint32_t level, uint32_t part,
                                                     uint8_t **out, size_t *out_size, struct tetlod_error *error);

/* Appends all frames of a level to those of its parts: of a level in pages, page after page. */
TETLOD_CHECKED enum tetlod_status tetlodi_read_level(const struct tetlod_file *file, uint32_t level,
                                                     struct tetlodi_buffer *parts, struct tetlod_error *error);

/* A frame of a page of the level, which is in pages. */
TETLOD_CHECKED enum tetlod_status tetlodi_read_page_frame(const struct tetlod_file *file, uint32_t level, uint32_t page,
                                                          uint32_t part, uint8_t **out, size_t *out_size,
                                                          struct tetlod_error *error);

/* Any part of the stream, checked: `what` is its name in messages. The caller frees *out. */
TETLOD_CHECKED enum tetlod_status tetlodi_read_part(const struct tetlod_file *file, const struct tetlodi_frame *frame,
                                                    const char *what, uint8_t **out, struct tetlod_error *error);

/* What a section holds, as it was before it was packed. The caller frees *out. */
TETLOD_CHECKED enum tetlod_status tetlodi_read_section(const struct tetlod_file *file,
                                                       const struct tetlodi_section *section, uint8_t **out,
                                                       struct tetlod_error *error);

/* The same of the first section with a tag; NULL if there is none. */
TETLOD_CHECKED enum tetlod_status tetlodi_read_tagged(const struct tetlod_file *file, const char *tag, uint8_t **out,
                                                      size_t *out_size, struct tetlod_error *error);

/* Components of all fields. */
uint32_t tetlodi_component_count(const struct tetlod_info *info);

#endif
