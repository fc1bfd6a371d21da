/* SPDX-License-Identifier: BSD-3-Clause */
/* Which fields are ids: numbers of nodes, parts or materials. A value between two ids means nothing. */
#ifndef TETLOD_IDS_H
#define TETLOD_IDS_H

#include "src/mesh/tetmesh.h"

/* Does the file say so, by integers or by a name that ends in Id or Ids? */
bool ids_by_kind(const struct point_field *field);

/* Are all values whole numbers, and not all the same? `count` values: components times points or cells. */
bool ids_by_values(const struct point_field *field, size_t count);

/* Which of so many fields with `count` values a component are ids: out[field]. Whole numbers are, unless that leaves
 * no field that is not, or constants alone. */
void ids_find(const struct point_field *fields, uint32_t field_count, size_t count, bool *out);

/* The field that is shown first: the first one with so many components (0: any) that is not ids, as far as is known
 * without its values. TETLOD_NONE: all are. */
uint32_t ids_first_other(const struct tetmesh *mesh, uint32_t components);

/* Integers of cells that may tell regions: one each, few values, and most vertices inside a region. TETLOD_NONE: there
 * are none. */
TETLOD_CHECKED enum tetlod_status ids_find_region(const struct tetmesh *mesh, uint32_t *out,
                                                  struct tetlod_error *error);

#endif
