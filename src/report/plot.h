/* SPDX-License-Identifier: BSD-3-Clause */
/* A picture of what a stream's levels cost: error against tetrahedra and against bytes, both axes logarithmic, as SVG. */
#ifndef TETLOD_PLOT_H
#define TETLOD_PLOT_H

#include "format/writer.h"

/* Every measure of the field that the index has is a line; errors of 0 have no place on a logarithmic axis and are left out.
 * `id` names the stream. The same index gives the same bytes. ERR_NOMEM, or what the sink returned. */
TETLOD_CHECKED enum tetlod_status plot_write(const struct tetlod_info *info, uint32_t field, const char *id,
                                             const struct tetlodi_sink *sink, struct tetlod_error *error);

#endif
