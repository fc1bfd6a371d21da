/* SPDX-License-Identifier: BSD-3-Clause */
/* Memory by pages. */
#ifndef TETLOD_PAGES_H
#define TETLOD_PAGES_H

#include <stddef.h>

/* Gives back the pages that lie in a range as a whole. What was there is lost; the array that the range is of is still
 * to be freed. */
void pages_drop(void *begin, size_t size);

#endif
