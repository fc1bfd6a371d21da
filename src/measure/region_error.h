/* SPDX-License-Identifier: BSD-3-Clause */
/* How far the transition of a region is off: no certificate holds there, so the true maximum over it is measured. */
#ifndef TETLOD_REGION_ERROR_H
#define TETLOD_REGION_ERROR_H

#include "src/stream/region.h"

/* out[f]: the largest difference of field f from the original over the transition of `region`, which region_mesh made
 * (`tets` too), in the field's units: that from the finest level, and what the finest level is off; 0 where there is no
 * transition, and of a field that is not controlled. Each body is compared with itself; where it overlaps itself, the
 * best of the region's values counts for each of the original's.
 *
 * The local bounds of the region (SPEC 3.3) are raised where they do not hold in a tetrahedron of the transition: at
 * its four corners by the most that they lack in it. Of a body that overlaps itself they then hold for every value of
 * the original at a place.
 *
 * The forest has the finest level. The same on any number of threads. The room (NULL: no limit), which counts one
 * thread, is asked for memory as it goes on, and holds afterwards what it held before. ERR_NOMEM, and what the room
 * says. */
TETLOD_CHECKED enum tetlod_status region_measure(const struct forest *forest, struct tetmesh *region,
                                                 const uint32_t *tets, unsigned threads, struct room *room,
                                                 double *out, struct tetlod_error *error);

/* Memory that it takes at most: as if all were transition. */
uint64_t region_error_most_bytes(const struct tetlod_info *info);

#endif
