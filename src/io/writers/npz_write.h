/* SPDX-License-Identifier: BSD-3-Clause */
/* Arrays of float64 as numpy's .npz: a zip file, stored, of .npy files. */
#ifndef TETLOD_NPZ_WRITE_H
#define TETLOD_NPZ_WRITE_H

#include "format/common/sink.h"

struct npz_array {
    const char *name;
    size_t rows, width; /* width 1: of one dimension */
    const double *values;
};

/* The same arrays, the same bytes. ERR_LIMIT: an array or all of them have 4 GiB or more. */
TETLOD_CHECKED enum tetlod_status npz_write(const struct npz_array *arrays, size_t count,
                                            const struct tetlodi_sink *sink, struct tetlod_error *error);

#endif
