/* SPDX-License-Identifier: BSD-3-Clause */
/* Contracts a level further, from the bounds that its vertices have come to: to see what other limits would leave of
 * it. */
#ifndef TETLOD_FURTHER_H
#define TETLOD_FURTHER_H

#include "src/simplify/simplify.h"

struct further {
    const struct tetmesh *level;
    /* [component of the vertex] of the controlled fields: largest of U - s and s - L there */
    const double *bounds;
    const double (*ranges)[2];  /* [controlled field] of the original */
    double from;                /* the first limit; options->max_error is the last */
};

/* Tetrahedra that are left, by the default metric. ERR_NOMEM. */
TETLOD_CHECKED enum tetlod_status simplify_further(uint32_t *out_tets, const struct further *further,
                                                   const uint32_t *controlled, uint32_t count,
                                                   const struct simplify_options *options, struct tetlod_error *error);

#endif
