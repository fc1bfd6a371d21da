/* SPDX-License-Identifier: BSD-3-Clause */
/* The records of a mesh that is written, or of a page of it: the recorder asks, the contraction forest answers. Not
 * installed. */
#ifndef TETLOD_RECORD_WRITE_H
#define TETLOD_RECORD_WRITE_H

#include "format/coding/page_part.h"
#include "format/write/lineage.h"

/* A tetrahedron that comes with a record and has not come yet. */
struct tetlodi_arrival {
    uint32_t tet; /* its original number */
    bool there;   /* its corners are four by now, and among them are the vertex and its child; then: */
    uint32_t corners[4], others[2]; /* vertices of the part; those but the vertex and its child */
    uint32_t edge;                  /* of the link, between the others; TETLOD_NONE: it has none */
};

/* Records that are planned and applied, of which nothing is coded yet. */
struct tetlodi_batch {
    struct tetlodi_record *records;
    struct tetlodi_star_view *stars; /* of all records, one for each child but the first */
    uint32_t count, star_count;
    uint8_t *asked;                  /* which vertices split, as tetlodi_splits_encode takes it */
    size_t asked_count, asked_capacity;
    struct tetlodi_buffer *frames;   /* [column] which end behind it, or NULL */
};

/* What a column is coded with, by one thread at a time. */
struct tetlodi_written {
    struct tetlodi_encoder encoder;
    struct tetlodi_memory memory;
    bool failed; /* memory was out */
};

struct tetlodi_record_writer {
    const struct tetlodi_write_input *in;
    struct lineage *lineage;    /* borrowed; `waiting` counts down to the split with which a tetrahedron is there */
    uint32_t *slot_at;          /* [position] the leaf's living ancestor, a vertex of the whole mesh; borrowed */
    const struct tetlodi_page_part *part; /* that is written, or NULL: the whole mesh */
    uint32_t *node_at;          /* [vertex] */
    uint32_t *original_of;      /* [tet in order of arrival] */
    uint8_t *places;            /* [the same] which of the original's corners each of its four is, two bits each */
    size_t node_capacity, original_capacity, places_capacity;
    struct tetlodi_arrival *arrived;
    uint32_t arrived_count;
    size_t arrived_capacity;
    struct tetlodi_memory *memory; /* borrowed, as are the replay and its columns: positions, then the fields */
    struct tetlodi_replay *replay;
    struct tetlodi_recorder recorder;
    struct tetlodi_written *written;  /* [column] */
    unsigned slowest;
    struct tetlodi_helpers *helpers;  /* or NULL; borrowed */
    struct tetlodi_batch batches[2], *planned, *coded;
    uint32_t batch_stars;
    const struct tetlodi_field_log *fields_log; /* the batch before, whose fields are coded with `coded`'s geometry */
    struct tetlodi_buffer *fields_frames;
};

/* What columns are of an input: positions, then the fields. */
void tetlodi_set_columns(const struct tetlodi_write_input *in, struct tetlodi_column *columns);

/* All is set up to the lineage, slots, the part, helpers and the replay, whose memory it takes: room for so many
 * vertices and tetrahedra. On failure it can be freed, once no helper works for it. */
TETLOD_CHECKED enum tetlod_status tetlodi_record_writer_init(struct tetlodi_record_writer *writer, size_t vertices,
                                                             size_t tets, struct tetlod_error *error);
void tetlodi_record_writer_fini(struct tetlodi_record_writer *writer);

/* A component of a column at a node: as it is, and its code; where levels have the grid's nearest number and not the
 * original's, that is rounded. */
double tetlodi_node_value(const struct tetlodi_record_writer *writer, uint32_t column, uint32_t node, size_t component);
int64_t tetlodi_node_code(const struct tetlodi_record_writer *writer, uint32_t column, uint32_t node, size_t component);
bool tetlodi_node_is_rounded(const struct tetlodi_record_writer *writer, uint32_t column, uint32_t node);

/* Gives a vertex the node's codes in all columns. */
void tetlodi_set_codes(const struct tetlodi_record_writer *writer, uint32_t vertex, uint32_t node);

/* A corner's living ancestor. */
uint32_t tetlodi_slot_of(const struct tetlodi_record_writer *writer, uint32_t tet, int corner);

/* Gives a node a place among the living: a vertex becomes its leaves' ancestor. */
void tetlodi_settle_node(struct tetlodi_record_writer *writer, uint32_t node, uint32_t vertex);

/* Makes an original tetrahedron number `number` in the order of arrival, its corners in the order of `corners`. There
 * is room, for so many of them. */
void tetlodi_settle_tet(struct tetlodi_record_writer *writer, uint32_t number, uint32_t tet, const uint32_t corners[4]);
bool tetlodi_tets_room(struct tetlodi_record_writer *writer, size_t tets);

/* Starts the coders of all columns, and ends them, with all that was written and what they code coming to the end of
 * frames[column]. ERR_NOMEM. */
void tetlodi_start_coders(struct tetlodi_record_writer *writer, unsigned slowest);
TETLOD_CHECKED enum tetlod_status tetlodi_end_frames(struct tetlodi_record_writer *writer,
                                                     struct tetlodi_buffer *frames, struct tetlod_error *error);

/* Passes a vertex of the walk or plans its record, on the way to a level with so many contractions. */
TETLOD_CHECKED enum tetlod_status tetlodi_write_vertex(struct tetlodi_record_writer *writer, uint32_t contractions,
                                                       struct tetlod_error *error);

/* Begins to code what is planned, and the fields of what was before. With `frames` all coders end behind it: theirs is
 * in frames[column] in the end. */
TETLOD_CHECKED enum tetlod_status tetlodi_write_batch(struct tetlodi_record_writer *writer,
                                                      struct tetlodi_buffer *frames, struct tetlod_error *error);

/* Codes all that is planned: then frames are there. */
TETLOD_CHECKED enum tetlod_status tetlodi_write_rest(struct tetlodi_record_writer *writer, struct tetlod_error *error);

#endif
