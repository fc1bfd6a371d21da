/* SPDX-License-Identifier: BSD-3-Clause */
/* How far the belt of a region is off: no certificate holds there, so the true maximum over it is measured. */
#ifndef TETLOD_REGION_ERROR_H
#define TETLOD_REGION_ERROR_H

#include "src/forest/region.h"

/* out[f]: the largest difference of field f over the belt of `mesh`, which region_mesh made, from the finest level, in the field's
 * units; 0 where there is no belt. The forest has the finest level. The same on any number of threads. */
TETLOD_CHECKED enum tetlod_status region_error(const struct forest *forest, const struct tetmesh *mesh, unsigned threads, double *out,
                                               struct tetlod_error *error);

/* Memory that it takes, about. */
uint64_t region_error_bytes(const struct tetlod_info *info);

#endif
