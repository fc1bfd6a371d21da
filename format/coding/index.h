/* SPDX-License-Identifier: BSD-3-Clause */
/* Header and index of a stream (SPEC.md, file layout): everything that a client needs to choose a level. */
#ifndef TETLOD_INDEX_H
#define TETLOD_INDEX_H

#include "format/coding/header.h"
#include "format/coding/page_table.h"
#include "format/coding/section.h"
#include "format/common/values.h"

enum {
    MAX_COUNT_BITS = 40,     /* vertices, tetrahedra of a stream: at most 2^40 (SPEC 2.3) */
    MAX_HELD_TETS = 1 << 30, /* of a level that this library decodes; vertices: below TETLOD_NONE */
    MAX_FIELDS = 256,
    MAX_LEVELS = 65536,
    MAX_SECTIONS = 65536,
    MAX_BITS = 30,
    MIN_SLOWEST = 5,
    MAX_SLOWEST = 7,
};

/* The index as it is in memory; `info` points into the rest. Frames of level k: [k * (1 + field_count)] is the
 * geometry's, the fields' follow. Those of a level in pages have neither offset nor digest: its pages' frames do. */
struct tetlodi_index {
    struct tetlod_info info;
    struct tetlod_field *fields;
    struct tetlod_level *levels;
    double *errors; /* [level][field][measure] */
    struct tetlodi_scale *scales; /* [1 + field_count] of positions, of the fields */
    struct tetlodi_frame *frames;
    struct tetlodi_section *sections; /* [info.section_count], as stored */
    struct tetlod_section *listed;    /* the same as callers see them */
    uint8_t *exact_later;       /* [field] coded on its grid, the tail has what makes it exact */
    int tail;                   /* the last level has the mesh of the one before it, and the tails */
    unsigned slowest;           /* the coder's slowest step of learning, 1/2^slowest */
    char *text;     /* names */
    char *metadata; /* from its section */
    struct tetlod_cell_field *cells; /* the same */
    char *cell_names;
    uint32_t parents; /* rows of the values of cells, if these are stored once a cell; 0: each tetrahedron has one */
    struct tetlod_topology *topologies; /* from its section */
    double *times;                      /* of all their steps */
    struct tetlodi_page_table pages;    /* from its section */
};

void tetlodi_index_fini(struct tetlodi_index *index);

/* Allocates the arrays for info.field_count fields and info.level_count levels, and those of info.section_count
 * sections. False: out of memory. */
bool tetlodi_index_allocate(struct tetlodi_index *index);
bool tetlodi_index_allocate_sections(struct tetlodi_index *index);

/* What the frames of a part give up to a level: vertices and tetrahedra, or a field's values, those of the tail as well
 * (SPEC 2.3). */
uint64_t tetlodi_part_numbers(const struct tetlodi_index *index, uint32_t level, uint32_t part);

/* The frames of a level in the order of the stream: one of each part, or, of a level in pages, those of its pages. */
size_t tetlodi_frame_count(const struct tetlodi_index *index, uint32_t level);
struct tetlodi_frame tetlodi_frame_at(const struct tetlodi_index *index, uint32_t level, size_t i, uint32_t *out_part);

/* What a step of a field at a level counts: vertices and tetrahedra, times components. */
uint64_t tetlodi_step_rows(const struct tetlodi_index *index, uint32_t field, uint32_t level);

/* ERR_LIMIT for more than this library holds in memory: it numbers with 32 bits. `level` is for the message. */
TETLOD_CHECKED enum tetlod_status tetlodi_check_held(uint32_t level, uint64_t vertices, uint64_t tets,
                                                     struct tetlod_error *error);
/* The same for the finest level, which values of cells and the original's numbering are of. */
TETLOD_CHECKED enum tetlod_status tetlodi_finest_held(const struct tetlodi_index *index, struct tetlod_error *error);

/* Vertices and tetrahedra of all levels, added up. */
uint64_t tetlodi_level_rows(const struct tetlodi_index *index);

/* Index to bytes, not packed, and back. Offsets of frames are not stored: they follow each other from `first_offset`
 * on, where the index ends, behind the early sections. */
void tetlodi_index_encode(const struct tetlodi_index *index, struct tetlodi_buffer *out);
TETLOD_CHECKED enum tetlod_status tetlodi_index_decode(struct tetlodi_index *index, const void *bytes, size_t size,
                                                       uint64_t first_offset, struct tetlod_error *error);

/* Bytes of a level in the index: the rows by which it is packed. */
uint32_t tetlodi_index_row(uint32_t field_count);

/* The stored index to its bytes, which the caller frees: unpacked if it is packed. */
TETLOD_CHECKED enum tetlod_status tetlodi_index_unpack(const struct tetlodi_header *header, const uint8_t *stored,
                                                       uint8_t **out,
                                                       struct tetlod_error *error);

#endif
