/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * The mesh of a cursor (SPEC 4): vertices and tetrahedra in order of arrival, the star of every vertex in ascending
 * order, and the log of splits. A split is applied and undone from the log alone; what lies beyond the present counts
 * in the arrays is what redoing brings back. The encoder holds the same structure. Not installed.
 */
#ifndef TETLOD_REPLAY_H
#define TETLOD_REPLAY_H

#include "format/common/memory.h"
#include "format/common/values.h"

/* Positions, or one field. codes and values are [components * vertices]; before[record] holds what the record's vertex
 * has on the other side of the record: before it while the record is applied, after it while it is undone. */
struct tetlodi_column {
    struct tetlodi_scale scale;
    unsigned components;
    uint32_t records; /* of the log that the column has: fewer than all where fields are still to be decoded */
    int64_t *codes, *before;
    double *values; /* NULL: of a field that is written, of which nobody asks them after the base mesh */
    /* on the grid where `values` are the tail's exact ones, and the other way round; NULL: there is no tail */
    double *other_values;
    size_t codes_capacity, before_capacity, values_capacity, other_capacity;
    uint64_t frame_bytes; /* of its frames, up to the level that was begun last */
};

struct tetlodi_star {
    /* pool[at .. at + size), ascending: 4 * tetrahedron + which of its corners the vertex is */
    uint32_t at, size, room;
    uint32_t leaf;           /* a vertex of the original: it never splits. Right at the log's end only */
};

enum { STAR_CLASSES = 128 };

/* One vertex parted from another, with the tetrahedra that this brings back. */
struct tetlodi_split {
    uint32_t vertex;
    uint32_t tets; /* SPLIT_FIRST: the first of its record */
};
#define SPLIT_FIRST 0x80000000u

struct tetlodi_replay {
    struct tetlodi_memory *memory;
    uint32_t vertices, tets, splits, records; /* now */
    uint32_t all_vertices, all_tets, all_splits, all_records; /* in the log */
    size_t label; /* number of the next split's first label */
    uint32_t column_count;
    struct tetlodi_column *columns; /* borrowed; columns[0] are the positions */

    uint32_t *corners, *parents, *pool;
    struct tetlodi_star *stars;
    struct tetlodi_split *log;
    uint8_t *labels; /* one bit per tetrahedron of the star of each split: with the new vertex */
    uint32_t free_runs[STAR_CLASSES];
    size_t corners_capacity, parents_capacity, pool_capacity, stars_capacity, log_capacity,
        labels_capacity, pool_size;
};

void tetlodi_replay_init(struct tetlodi_replay *replay, struct tetlodi_memory *memory, struct tetlodi_column *columns,
                         uint32_t column_count);
void tetlodi_replay_fini(struct tetlodi_replay *replay); /* the columns' arrays as well */
/* all but corners and codes: for a reader that stops there */
void tetlodi_replay_drop(struct tetlodi_replay *replay);

/* Room in a column for so many vertices and records. 0 if there is no memory for them. */
int tetlodi_column_room(struct tetlodi_column *column, struct tetlodi_memory *memory, size_t vertices, size_t records);

/* Room for a mesh without its columns, likewise. */
int tetlodi_replay_room(struct tetlodi_replay *replay, size_t vertices, size_t tets);

/* The stars of a base mesh whose corners and counts are set. 0 if out of memory. */
int tetlodi_replay_base(struct tetlodi_replay *replay);

/* Puts the labels of the next split's star, 0 or 1, into the log. 0 if out of memory. */
int tetlodi_replay_log_labels(struct tetlodi_replay *replay, const uint8_t *labels, uint32_t count);

/* Appends to the log a split of `vertex` whose star's labels and whose tetrahedra's corners are in place. */
int tetlodi_replay_log(struct tetlodi_replay *replay, uint32_t vertex, uint32_t tets, int first);

/* The next split of the log, which is there. 0 if out of memory, with nothing changed. */
int tetlodi_replay_apply(struct tetlodi_replay *replay);

/* Undoes the last split. 0 if out of memory, with nothing changed. */
int tetlodi_replay_undo(struct tetlodi_replay *replay);

/* One record of the log up or down, its vertex's position and values included. 0 if out of memory, unchanged. */
int tetlodi_replay_forward(struct tetlodi_replay *replay);
int tetlodi_replay_back(struct tetlodi_replay *replay);

/* Where something begins in the log, or ends. */
struct tetlodi_log_place {
    size_t split, record, label;
};

/* Room in the log for so much. 0 if there is no memory for it. */
int tetlodi_replay_log_room(struct tetlodi_replay *replay, size_t splits, size_t records, size_t labels);

/* Copies labels of a log to number `to_at` of others; those around stay. */
void tetlodi_labels_copy(uint8_t *to, size_t to_at, const struct tetlodi_replay *from, size_t from_at, size_t count);

/* Puts the log of a part of the mesh that was split by itself, from one place in it to another, to a place where there
 * is room. Its vertices are numbered as those here. */
void tetlodi_replay_place(struct tetlodi_replay *replay, const struct tetlodi_log_place *place,
                          const struct tetlodi_replay *part, const struct tetlodi_log_place *from,
                          const struct tetlodi_log_place *to);

/* The mesh has so much, and the log ends here: all of it is in place but stars, which tetlodi_replay_restar makes. */
void tetlodi_replay_set(struct tetlodi_replay *replay, uint32_t vertices, uint32_t tets,
                        const struct tetlodi_log_place *end);

/* Makes all stars anew from corners. 0 if out of memory: then there are none. */
int tetlodi_replay_restar(struct tetlodi_replay *replay);

/* Forgets what the log holds beyond the present. */
void tetlodi_replay_forget(struct tetlodi_replay *replay);

/* Exchanges a record's vertex's codes and values with `before`. */
void tetlodi_replay_exchange(struct tetlodi_replay *replay, uint32_t vertex, uint32_t record);

/* Puts in what another column's vertex had before a record that is applied. */
void tetlodi_column_put(struct tetlodi_column *column, int position, uint32_t vertex,
                        const struct tetlodi_column *from, uint32_t record);

/* As tetlodi_replay_exchange, in one column, of positions or of a field. Nothing happens if the column does not have
 * the record. */
void tetlodi_column_exchange(struct tetlodi_column *column, int position, uint32_t vertex, uint32_t record);

#endif
