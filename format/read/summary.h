/* SPDX-License-Identifier: BSD-3-Clause */
/* The section SUMS (SPEC 3.9): exact sums over the original, and what volume its boundary has swept. Not installed. */
#ifndef TETLOD_SUMMARY_H
#define TETLOD_SUMMARY_H

#include "format/coding/section.h"

struct tetlodi_summary {
    uint32_t level_count, component_count; /* of all fields */
    double volume;    /* of the original's tetrahedra */
    float *swept;     /* [level_count] volume that the boundary has swept between the original and the level: a bound */
    double (*sums)[2]; /* [component_count] integral of the component, and of its square */
    /* Of each component, if there are thresholds: where it is least and greatest, and its distribution. */
    uint32_t threshold_count;  /* of each component, ascending; 0: none of it is there */
    double (*places)[2][3];    /* [component_count] */
    double (*below)[2];        /* [threshold_count * component_count] a threshold; the volume where it is not above */
};

enum { MAX_SUMMARY_THRESHOLDS = 4096 };

/* Room for all of it, zero. 0: out of memory. */
int tetlodi_summary_allocate(struct tetlodi_summary *summary, uint32_t levels, uint32_t components,
                             uint32_t thresholds);
void tetlodi_summary_fini(struct tetlodi_summary *summary);

/* As the section's bytes, and back. Decoding checks what the section can be checked for by itself. ERR_STREAM,
 * ERR_NOMEM. */
void tetlodi_summary_encode(const struct tetlodi_summary *summary, struct tetlodi_buffer *out);
TETLOD_CHECKED enum tetlod_status tetlodi_summary_decode(struct tetlodi_summary *summary, const uint8_t *bytes,
                                                         size_t size, struct tetlod_error *error);

/* That of a stream, held against its levels and fields; empty (0 levels) if it has none. Or as tetlod_section_read. */
TETLOD_CHECKED enum tetlod_status tetlodi_summary_read(const struct tetlod_file *file, struct tetlodi_summary *out,
                                                       struct tetlod_error *error);

#endif
