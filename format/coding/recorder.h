/* SPDX-License-Identifier: BSD-3-Clause */
/* What the coding of records works on: models, logs of fields, and the recorder that has all of it. Not installed. */
#ifndef TETLOD_RECORDER_H
#define TETLOD_RECORDER_H

#include "format/coding/star_view.h"
#include "format/common/coder.h"

enum { LABEL_CONTEXTS = 2 * 2 * 4 * 8 * 10, SPLIT_CONTEXTS = 16 };

/* Models of how far a child is from the vertex along one axis (SPEC 7.2): whether at all, to which side, and how far in
 * bits, by how far the link reaches to that side and by how far along the axis before. */
struct tetlodi_step {
    struct tetlodi_bit none[8][4], side[4][3][5], level[4][2], rank[4][4][64], length[4][65][128], top[65][4];
};

/* What the geometry frames of all levels learn together. */
struct tetlodi_geometry_models {
    struct tetlodi_bit splits[8][SPLIT_CONTEXTS];
    struct tetlodi_bit arity[4], placement[4], label[LABEL_CONTEXTS], irregular, boundary[16], made[2],
        flip;
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

struct tetlodi_record {
    uint32_t vertex, children; /* 2 to 4; the first child takes the vertex's place */
    unsigned leaves;           /* bit i: child i is a vertex of the original, which never splits */
    enum tetlodi_placement placement;
    uint32_t first_child, number; /* of the second child, which is new; of the record in the log */
    int64_t codes[3][4];          /* positions [axis][child]: an encoder sets them */
    uint32_t nodes[4];            /* an encoder's children, by which it knows the values of fields */
};

/* What fields need to know of a record's geometry (format/coding/record_fields.c). */
struct tetlodi_field_record {
    uint32_t vertex, first_child, number, link_count; /* as in a record */
    uint8_t children, placement, leaves;
    uint32_t nodes[4];
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
    struct tetlodi_star_view star;      /* a decoder's */
    struct tetlodi_star_marks marks;
    struct tetlodi_field_log *log;      /* of the records since fields were coded; NULL: nobody wants fields */
    struct tetlodi_field_log logs[2];   /* one is written while fields are coded from the other */
    uint32_t most_vertices, most_tets;  /* what the level may have */
    uint32_t walk, level_start;         /* the walk's vertex; vertices at its begin */
    int paged;                          /* the walk is of a page: listed vertices first, then those that it adds */
    const uint32_t *listed;             /* the page's vertices, ascending; borrowed */
    const uint8_t *seams;               /* [vertex before the group] it does not split; borrowed */
    uint32_t listed_count, place;       /* place: of the walk */
    uint64_t labels, max_labels; /* of all levels' records so far, and what their frames may have (SPEC 2.3) */
};

#endif
