/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * A mesh that is fine in some boxes and coarse elsewhere, out of pages (format/SPEC.md, 7.6): every tetrahedron is one
 * of some level, and that level's certified error holds in it. What the boxes do not need is not read.
 */
#ifndef TETLOD_PAGE_REGION_H
#define TETLOD_PAGE_REGION_H

#include "src/stream/region.h"

/* Is there such a mesh with this level in boxes? The level has to be in pages. */
bool page_region_is(const struct tetlod_info *info, uint32_t fine);

/* The finest level in pages; TETLOD_NONE: there is none. */
uint32_t page_region_finest(const struct tetlod_info *info);

/* The level outside of the boxes: the coarse one, but none before the last that is not in pages. */
uint32_t page_region_outside(const struct tetlod_info *info, uint32_t coarse);

/* Its pages. The caller frees the set. */
TETLOD_CHECKED enum tetlod_status page_region_set(const struct tetlod_file *file, const struct region *region,
                                                  struct tetlod_page_set **out, struct tetlod_error *error);

/* Memory that making it takes at most. */
uint64_t page_region_bytes(const struct tetlod_info *info, const struct tetlod_page_set_info *pages);

/* The mesh. Its vertices and tetrahedra are in the order of the levels'; the cell field REGION_FIELD says each
 * tetrahedron's part. *tets: their numbers with all pages, the caller's to free. *transition: the coarsest level of a
 * tetrahedron of the transition; TETLOD_NONE: there are none. The room (NULL: no limit) is asked for what the set
 * needs, and holds the mesh and `tets` afterwards. ERR_NOMEM, what the room says, or as the cursor. */
TETLOD_CHECKED enum tetlod_status page_region_mesh(struct tetlod_file *file, const struct tetlod_page_set *set,
                                                   const struct region *region, struct room *room,
                                                   struct tetmesh *out, uint32_t **tets, struct region_counts *counts,
                                                   uint32_t *transition, struct tetlod_error *error);

#endif
