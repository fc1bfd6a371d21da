/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * How much two results differ, on two meshes of one domain: intervals that hold the largest difference and the root of
 * the mean square, from the coarsest levels that decide.
 */
#ifndef TETLOD_DECIDE_H
#define TETLOD_DECIDE_H

#include "src/ask/forms.h"
#include "src/diff/difference.h"

/* One of the two results: a mesh, or a stream's forms. Owned. */
struct diff_side {
    struct tetmesh mesh; /* the whole, or the form that was taken last; with the field, and its bound behind it */
    uint32_t field;      /* of the mesh */
    bool of_stream;
    struct forms forms;
    double range[2];     /* of the field */
    uint32_t components;
};

/* Makes a side of a mesh, which it takes over, or of a stream's forms, which are there. ERR_FIELD. */
TETLOD_CHECKED enum tetlod_status diff_side_mesh(struct diff_side *side, const char *field, struct tetlod_error *error);
TETLOD_CHECKED enum tetlod_status diff_side_stream(struct diff_side *side, struct tetlod_error *error);
void diff_side_fini(struct diff_side *side);

enum diff_norm { DIFF_MAX, DIFF_RMS, DIFF_NORMS };

/* From best to worst. MEASURED: there is no limit. */
enum diff_verdict { DIFF_MEASURED, DIFF_WITHIN, DIFF_UNDECIDED, DIFF_BEYOND };

/* Limit and width in the field's units, or fractions of the first one's range. */
struct diff_options {
    int component;       /* -1: all */
    enum diff_norm norm; /* that the limit, or the width, is about */
    bool limited;        /* a limit is given; else the interval is to be no wider than `width` */
    double limit, width;
    bool all_cells;      /* the cells are wanted, not only the verdict */
    unsigned threads;
};

/* Bounds are in the field's units. */
struct diff_result {
    struct difference difference;   /* of the forms that decided: to be released */
    double bounds[DIFF_NORMS][2];   /* at least, at most */
    double l2[2];                   /* root of the integral of the square */
    double swept;                   /* by which the volumes are uncertain */
    enum diff_verdict verdict;
    struct { uint32_t level, tets; uint64_t bytes; double error; } used[2]; /* level: TETLOD_NONE of a mesh */
};

/* Reads a limit or a width, 0.5 or 2%, as a number of the field's units. `range` is that of the first one's field.
 * False if the text is none. */
bool diff_parse_limit(const char *text, const double range[2], double *out);

/* ERR_MISMATCH if the domains do not overlap, or the fields have other components; ERR_FIELD if nothing is certain of a
 * stream's field; or as the reader. */
TETLOD_CHECKED enum tetlod_status diff_decide(struct diff_side sides[2], const struct diff_options *options,
                                              struct diff_result *out, struct tetlod_error *error);

#endif
