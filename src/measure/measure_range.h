/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * Between what and what the measured errors of a level are, where rounding or the mesh leave a choice: a point lies in
 * several tetrahedra where the level overlaps itself, is as near to two faces of its boundary, or is located to a few
 * digits only in a tetrahedron that is almost flat. For verdicts: slow, with weights in 113 bits.
 */
#ifndef TETLOD_MEASURE_RANGE_H
#define TETLOD_MEASURE_RANGE_H

#include "src/measure/measure_levels.h"

struct measured_range {
    struct measured least, most;
};

/* Of all fields of `level`, which are those of the original in order. Both meshes have the bodies `bodies` [vertex of
 * the original] (sheets_bodies), by the number of their vertices; a body is compared with itself. out [field_count].
 * `within`: a narrower range, sooner, as if each search found a tetrahedron where there is one. `measured`: at this
 * level; a still narrower range, much sooner: samples that are inside the level, and near no tetrahedron that is
 * flat, thin or turned over, are off by what was measured. NULL: all are looked for. The result does not depend on
 * `threads`. ERR_NOMEM. */
TETLOD_CHECKED enum tetlod_status measure_range(const struct tetmesh *original, const uint32_t *bodies,
                                                const struct tetmesh *level, bool within,
                                                const struct measure_levels *measured, unsigned threads,
                                                struct measured_range *out, struct tetlod_error *error);

#endif
