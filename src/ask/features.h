/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * Which maxima, minima and components of level sets a function has that lies between two others (PROOF.md 13).
 *
 * A *bar* is a maximum with its persistence: how far the function falls from there before its superlevel component
 * joins one with a higher maximum (of a body's highest maximum: as far as the body's least value). A function between
 * `lower` and `upper` has at least as many bars longer than a persistence as there are sets of points whose lower
 * values are so far above the saddles of `upper` between them, and at most as many as the other way round. */
#ifndef TETLOD_FEATURES_H
#define TETLOD_FEATURES_H

#include <stdbool.h>

#include "format/tetlod.h"

enum feature_kind { FEATURE_MAXIMUM, FEATURE_MINIMUM, FEATURE_ABOVE, FEATURE_BELOW, FEATURE_KINDS };

/* A mesh with two piecewise linear functions; all is borrowed. */
struct feature_mesh {
    const double *positions; /* [3 * vertices] */
    const uint32_t *corners; /* [4 * tets] */
    uint32_t vertices, tets;
    const double *lower, *upper; /* [vertices] lower <= upper, finite; one array if the function is known exactly */
    const double *middle;        /* [vertices] between them */
};

struct feature_query {
    enum feature_kind kind;
    double persistence; /* bars are longer, components reach further above (below) the threshold */
    double threshold;   /* of FEATURE_ABOVE and FEATURE_BELOW */
};

struct feature {
    enum feature_kind kind;
    bool proven;
    uint32_t vertex, end; /* its place; where it joins a higher (lower) one, or the body's other extreme */
    double at[3];       /* the vertex' place */
    double range[2];    /* proven: of the greatest (least) value; possible: of the value at the place */
    /* proven: at least; possible: what the level makes of it, at most that if the kind is bounded */
    double persistence;
    double box[2][3];   /* proven: the feature lies in it */
};

struct features {
    struct feature *list; /* a kind after the other, proven first, by falling persistence */
    size_t count, capacity;
    uint32_t proven[FEATURE_KINDS], possible[FEATURE_KINDS];
    bool asked[FEATURE_KINDS];
    bool bounded[FEATURE_KINDS]; /* there are no more than proven and possible ones together */
};

/* Appends what a query finds; its kind was not asked before. ERR_NOMEM. O(n log n). */
TETLOD_CHECKED enum tetlod_status features_find(struct features *out, const struct feature_mesh *mesh,
                                                const struct feature_query *query, struct tetlod_error *error);
void features_fini(struct features *features);

/* "maximum", "minimum", "component above", "component below" */
const char *feature_name(enum feature_kind kind);

#endif
