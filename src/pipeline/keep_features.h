/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * Levels that have as many maxima and as many minima of a persistence as the original, in every component of every
 * controlled field. Their vertices, and those where they end, stay in their places; of what is contracted then, the
 * levels are kept that have the original's numbers: they are counted, so that nothing is left to prove. */
#ifndef TETLOD_KEEP_FEATURES_H
#define TETLOD_KEEP_FEATURES_H

#include "src/log/contraction_log.h"
#include "src/pipeline/build_options.h"

struct kept_features {
    const struct build_options *options;
    bool *fixed;            /* [vertex] */
    uint32_t (*counts)[2];  /* [controlled component] maxima and minima of the original */
    double *persistences;   /* [controlled component] */
    uint32_t component_count;
};

/* Counts those of the original. ERR_NOMEM. O(n log n) for each component. */
TETLOD_CHECKED enum tetlod_status kept_features_init(struct kept_features *kept, const struct tetmesh *original,
                                                     const struct build_options *options, struct tetlod_error *error);
void kept_features_fini(struct kept_features *kept);

/* Takes the marks out of the log that have other numbers, and what was contracted behind the last one. `mesh` is what
 * was contracted. ERR_ARGUMENT if the original's numbers are lost by the rounding of its values alone; ERR_NOMEM. */
TETLOD_CHECKED enum tetlod_status kept_features_filter(const struct kept_features *kept, const struct tetmesh *mesh,
                                                       struct contraction_log *log, struct tetlod_error *error);

#endif
