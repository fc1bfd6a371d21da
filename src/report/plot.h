/* SPDX-License-Identifier: BSD-3-Clause */
/* Pictures as SVG: what a stream's levels cost, error against tetrahedra and against bytes, both axes logarithmic; and
 * what the errors of a series are over time. */
#ifndef TETLOD_PLOT_H
#define TETLOD_PLOT_H

#include "format/common/sink.h"

/* Every measure of the field that the index has is a line; errors of 0 have no place on a logarithmic axis and are left
 * out. `id` names the stream. The same index gives the same bytes. ERR_NOMEM, or what the sink returned. */
TETLOD_CHECKED enum tetlod_status plot_write(const struct tetlod_info *info, uint32_t field, const char *id,
                                             const struct tetlodi_sink *sink, struct tetlod_error *error);

/* The errors of one field, fractions of its range. */
struct plot_steps {
    uint32_t step_count, band_count; /* without the exact band */
    const double *times;             /* [step] */
    const struct tetlod_band *bands;
    const double *sampled, *rms;       /* [band][step] */
};

/* A line for the largest error at samples and one for the RMS of each band, and a thin one at what the band
 * promises. */
TETLOD_CHECKED enum tetlod_status plot_write_steps(const struct plot_steps *steps, const char *field, const char *id,
                                                   const struct tetlodi_sink *sink, struct tetlod_error *error);

#endif
