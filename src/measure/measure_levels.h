/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * The errors of a mesh's levels, from fine to coarse, by what changed: each sample knows the tetrahedron that holds it
 * and its error; only samples of tetrahedra that changed are looked for again. What comes out is what measure_mesh
 * would say of each level, but for the rounding of where samples lie, and rounded up by up to 1.2e-7 of itself: a
 * sample's error is kept as a float.
 */
#ifndef TETLOD_MEASURE_LEVELS_H
#define TETLOD_MEASURE_LEVELS_H

#include "src/log/coarsening.h"
#include "src/measure/measure.h"
#include "src/util/buffer.h"

struct measure_levels;

/* Prepares to measure levels against `original` (borrowed) on `coarsening` (borrowed, at its finest): the same vertices
 * and tetrahedra, with positions and values that may be rounded. ERR_NOMEM, ERR_LIMIT. */
TETLOD_CHECKED enum tetlod_status measure_levels_new(struct measure_levels **out, const struct tetmesh *original,
                                                     struct coarsening *coarsening, unsigned threads,
                                                     struct tetlod_error *error);
void measure_levels_free(struct measure_levels *measure);

/* Bytes that it takes beside the coarsening, about. */
uint64_t measure_levels_bytes(const struct tetmesh *original);

/* Measures the level that the coarsening is at: once at the finest level, then once after each step. out [field_count].
 * *io_domain comes in as what the domain error is known to be at least (0: nothing), which spares the search for
 * boundary points that are nearer, and is raised to the largest of this and all finer levels. ERR_NOMEM,
 * ERR_LIMIT. */
TETLOD_CHECKED enum tetlod_status measure_levels_next(struct measure_levels *measure, struct measured *out,
                                                      double *io_domain,
                                                      struct tetlod_error *error);

/* What a sample (sample_points.h) was found to be off by at the last level: out [field_count], in the fields' units,
 * rounded up as said above. False: the level does not hold it, and the closest point of its boundary was taken. */
bool measure_levels_sample(const struct measure_levels *measure, size_t sample, double *out);

/* ---- samples in parts, of which each program measures some (measure_shared.h) */

/* The samples are in so many parts, whatever their number. They follow each other in the mesh: who measures few large
 * ones comes to fewer of its pages and tetrahedra than who measures many small ones here and there. */
enum { MEASURE_PARTS = 20 };

/* Only parts that are mine[part] are measured, and the domain error where `bounds` is true; what measure_levels_next
 * says is then theirs alone. Before the first level. */
void measure_levels_restrict(struct measure_levels *measure, const bool mine[MEASURE_PARTS], bool bounds);

/* Appends what the level's samples of a part have come to. ERR_NOMEM. */
TETLOD_CHECKED enum tetlod_status measure_levels_pack(const struct measure_levels *measure, uint32_t part,
                                                      struct buffer *out);

/* The bytes of a part at one level, which measure_levels_pack appends. */
size_t measure_levels_part_size(const struct measure_levels *measure, uint32_t part);

/* Appends what one needs to know who joins the parts: so many bytes. ERR_NOMEM. */
TETLOD_CHECKED enum tetlod_status measure_levels_pack_sums(const struct measure_levels *measure, struct buffer *out);
static inline size_t measure_levels_sums_size(uint32_t fields)
{
    return sizeof(size_t) + fields * sizeof(double);
}

/* Of these bytes: what takes parts and says what they have come to, and measures nothing. It can be freed in any case.
 * ERR_NOMEM. */
TETLOD_CHECKED enum tetlod_status measure_levels_of_sums(struct measure_levels **out, const struct tetmesh *original,
                                                         const unsigned char *bytes, struct tetlod_error *error);

/* Takes a part that another program has measured. */
void measure_levels_unpack(struct measure_levels *measure, uint32_t part, const unsigned char *bytes);

/* What all parts of a level have come to. out [field_count]. */
void measure_levels_result(const struct measure_levels *measure, struct measured *out);

#endif
