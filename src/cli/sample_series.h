/* SPDX-License-Identifier: BSD-3-Clause */
/* A sample as a series in time: a PVD file and a VTU file of each step beside it. */
#ifndef TETLOD_SAMPLE_SERIES_H
#define TETLOD_SAMPLE_SERIES_H

#include "src/sample/sample.h"

enum { MAX_SAMPLE_STEPS = 100000 };

/* Writes OUT.pvd, last, and OUT_0.vtu, OUT_1.vtu, ... Steps are made one at a time; after every `remesh` of them (0:
 * never) the mesh is another one, a size finer. The message names the file. */
TETLOD_CHECKED enum tetlod_status sample_series_write(const struct sample *sample, uint32_t size, uint32_t steps,
                                                      uint32_t remesh,
                                                      const char *output, struct tetlod_error *error);

#endif
