/* SPDX-License-Identifier: BSD-3-Clause */
/* From the numbers that a file gives its points to indices. */
#ifndef TETLOD_TAG_MAP_H
#define TETLOD_TAG_MAP_H

#include "format/tetlod.h"

struct tag_map {
    int64_t first; /* the tag of index 0 */
    struct tag_entry {
        int64_t tag;
        uint32_t index;
    } *entries; /* owned, ascending tags once sorted; NULL while tags go up one by one */
    size_t count, capacity;
};

/* Appends the next index's tag. */
TETLOD_CHECKED enum tetlod_status tag_map_add(struct tag_map *map, int64_t tag, struct tetlod_error *error);

/* To be called before the first look-up; ERR_MESH if a tag is there twice. */
TETLOD_CHECKED enum tetlod_status tag_map_sort(struct tag_map *map, struct tetlod_error *error);

/* TETLOD_NONE if there is no such tag. O(1) where tags ascend one by one, else O(log n). */
uint32_t tag_map_find(const struct tag_map *map, int64_t tag);
void tag_map_fini(struct tag_map *map);

#endif
