/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * The coding of records (SPEC 7 and 8), both ways: a record of the encoder is coded and applied, a decoder's is read
 * and applied. Not installed.
 */
#ifndef TETLOD_RECORD_H
#define TETLOD_RECORD_H

#include <stdbool.h>

#include "format/coder.h"
#include "format/replay.h"

enum { LABEL_CONTEXTS = 2 * 2 * 4 * 8 * 10 };

/* Models of how far a child is from the vertex along one axis (SPEC 7.2): whether at all, to which side, and how far in
 * bits, by how far the link reaches to that side and by how far along the axis before. */
struct tetlodi_step {
    struct tetlodi_bit none[8][4], side[4][3][5], level[4][2], rank[4][4][64], length[4][65][128], top[65][4];
};

/* What the geometry frames of all levels learn together. */
struct tetlodi_geometry_models {
    struct tetlodi_bit splits[8][16], arity[4], placement[4], label[LABEL_CONTEXTS], irregular, boundary[16], made[2], flip;
    struct tetlodi_bit seed, across[2], fresh, known[64];
    struct tetlodi_bit leaf[3][3][16];
    struct tetlodi_step step[3];
    struct tetlodi_number extra, vertex, middle[3], corner[3];
};

/* Trailing zeros of a code that are counted, at most. */
enum { MAX_ZEROS = 15 };

/* Of one field. A component that always has the codes of another one is not coded: copied[c] is that one, or c. */
struct tetlodi_field_models {
    struct tetlodi_number child[2][2], corner; /* child [original][first] */
    struct tetlodi_bit zeros[MAX_ZEROS + 1][16], kept[2][2], nudge[4], copies, source[64];
    uint8_t last_zeros[MAX_COMPONENTS], copied[MAX_COMPONENTS];
};

/* Where the vertex was among its children: at the first's place, in their middle, or elsewhere. */
enum tetlodi_placement { AT_FIRST = 0, IN_MIDDLE = 1, ELSEWHERE = 2 };

/* An edge of the link of the vertex that splits; it and the vertex are a face. */
struct tetlodi_link_edge {
    /* of the star that have it: 3 * the place in the star + which of the other corners is not on it */
    uint32_t first, last;
};
/* the labels of an edge's tetrahedra; sums of three do not mix */
enum { LABEL_STAYS = 1, LABEL_GOES = 4, LABELS_DIFFER = 5 };
/* a tetrahedron comes back at an edge; not as the edge implies */
enum { NOT_MADE = 0, MADE = 1, MADE_FLIPPED = 2 };

/* The star of a vertex laid out to be split. */
struct tetlodi_star_view {
    uint32_t vertex, size, link_count, edge_count, extra_count;
    /* the star in the replay's pool, until it is split: 4 * tetrahedron + which the vertex is */
    const uint32_t *corners;
    uint32_t (*others)[3], (*edges)[3]; /* others: the corners but the vertex, by number in the link */
    uint8_t *labels, *contexts;         /* label 1: goes with the child */
    uint32_t *link;                     /* vertices */
    double (*positions)[4];             /* theirs; the fourth is unused */
    int64_t *codes, *axis_codes[3];     /* theirs, axis by axis */
    struct tetlodi_link_edge *edge;
    uint8_t *seen, *made;    /* of edges */
    uint32_t (*extras)[2];   /* vertices */
    uint32_t *mark, *table;  /* numbers in the link of vertices, from first_mark on; of edges */
    uint32_t first_mark;
    size_t others_capacity, edges_capacity, labels_capacity, contexts_capacity, link_capacity, positions_capacity,
        codes_capacity, edge_capacity, seen_capacity, made_capacity, extras_capacity, mark_capacity,
        table_capacity;
};

struct tetlodi_record {
    uint32_t vertex, children; /* 2 to 4; the first child takes the vertex's place */
    unsigned leaves;           /* bit i: child i is a vertex of the original, which never splits */
    enum tetlodi_placement placement;
};

/* What fields need to know of a record's geometry (format/record_fields.c). */
struct tetlodi_field_record {
    uint32_t vertex, first_child, number, link_count; /* first_child: number of the second child, which is new */
    uint8_t children, placement, leaves;
};

/* Where a child is in the star before the split. */
struct tetlodi_location {
    uint32_t corners[3]; /* of a tetrahedron, but the vertex; TETLOD_NONE: at the vertex, or there is none */
    double weights[3];
};

struct tetlodi_field_log {
    uint32_t count;
    struct tetlodi_field_record *records;
    uint32_t *links;                    /* the vertices of all records' links */
    struct tetlodi_location *locations; /* of all their children */
    size_t link_count, location_count, records_capacity, links_capacity, locations_capacity;
};

enum { BAD_FRAME = 1, BAD_VALUE = 2 }; /* what a coder's `bad` says */

struct tetlodi_recorder {
    struct tetlodi_replay *replay;  /* borrowed */
    struct tetlodi_coder *coders;   /* [column] geometry, then the fields */
    struct tetlodi_geometry_models *models;
    struct tetlodi_field_models *field_models;
    struct tetlodi_star_view star;
    struct tetlodi_field_log *log;      /* of the records since fields were coded; NULL: nobody wants fields */
    /* an encoder's is the first one; a decoder writes one while fields are decoded from the other */
    struct tetlodi_field_log logs[2];
    int64_t (*codes)[4];                /* [components of all columns][child] of the record: an encoder sets them */
    uint32_t most_vertices, most_tets;  /* what the level may have */
    uint32_t walk, level_start;         /* the walk's vertex; vertices at its begin */
    /* The encoder's answers, once the star is laid out: its labels, its edges' made and flip, its extras. `child` is
     * 1 to 3. NULL in a decoder. 0 if out of memory. */
    int (*plan)(void *opaque, struct tetlodi_star_view *star, unsigned child);
    void *opaque;
    uint64_t labels, max_labels; /* of all levels' records so far, and what their frames may have (SPEC 2.3) */
};

/* Models as they are before the base mesh. The coders are started by the caller, each level. */
TETLOD_CHECKED enum tetlod_status tetlodi_recorder_init(struct tetlodi_recorder *recorder,
                                                        struct tetlodi_replay *replay,
                                                        struct tetlod_error *error);
void tetlodi_recorder_fini(struct tetlodi_recorder *recorder);

/* What its models take. */
uint64_t tetlodi_recorder_bytes(const struct tetlodi_recorder *recorder);

/* The code of the first child if the vertex is in the middle of all. */
int64_t tetlodi_middle(const struct tetlodi_scale *scale, unsigned axis, int64_t vertex_code, const int64_t codes[4],
                       uint32_t children);

/* The walk of a level that is to have so many vertices and tetrahedra (SPEC 7.1). It ends when they are there. A
 * decoder's columns have the bytes of their frames. */
void tetlodi_level_begin(struct tetlodi_recorder *recorder, uint32_t vertices, uint32_t tets);

/* May a column's frames have so many labels, times a field's components, in so many bytes (SPEC 2.3)? */
bool tetlodi_labels_hold(const struct tetlodi_recorder *recorder, uint32_t column, uint64_t bytes);

/* An encoder says whether the vertex at the walk splits; a decoder goes to the next that does, or to the walk's end. A
 * vertex that does not split is passed. 1 if there is one: it is at the walk. */
int tetlodi_level_says(struct tetlodi_recorder *recorder, int split);
int tetlodi_level_next(struct tetlodi_recorder *recorder);

/* Codes one record, logs it and applies it. A decoder decodes fields later, from the log. On failure the mesh is as it
 * was. */
TETLOD_CHECKED enum tetlod_status tetlodi_record_code(struct tetlodi_recorder *recorder, struct tetlodi_record *record,
                                                      struct tetlod_error *error);

#endif
