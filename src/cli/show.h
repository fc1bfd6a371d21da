/* SPDX-License-Identifier: BSD-3-Clause */
/* A stream in a VTKHDF file (SPEC 3.10), for build and convert: what other programs see of it is a coarse level. */
#ifndef TETLOD_SHOW_H
#define TETLOD_SHOW_H

#include <stdbool.h>

#include "format/common/sink.h"

/* Is it the name of such a file? */
bool show_is_output(const char *path);

/* The level that is shown is the coarsest within `limit`, a fraction of the range; a negative one: the finest of at
 * most 200,000 tetrahedra. Of a series it is that of every step. */
TETLOD_CHECKED enum tetlod_status show_write(struct tetlod_file *file, double limit, const struct tetlodi_sink *sink,
                                             struct tetlod_error *error);

#endif
