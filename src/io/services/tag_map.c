/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/io/services/tag_map.h"

#include <stdbool.h>
#include <stdlib.h>

#include "format/fail.h"
#include "src/util/array.h"

static enum tetlod_status add_entry(struct tag_map *map, size_t index, int64_t tag, struct tetlod_error *error)
{
    if (!ARRAY_RESERVE(map->entries, map->capacity, index + 1))
        return tetlodi_fail_nomem(error, "the numbers of the points", (uint64_t)index * sizeof *map->entries);
    map->entries[index] = (struct tag_entry){tag, (uint32_t)index};
    return TETLOD_OK;
}

enum tetlod_status tag_map_add(struct tag_map *map, int64_t tag, struct tetlod_error *error)
{
    if (!map->count)
        map->first = tag;
    bool has_entries = map->entries != NULL, ascends = (uint64_t)tag - (uint64_t)map->first == map->count;
    for (size_t i = 0; !has_entries && !ascends && i < map->count; i++)
        TETLOD_TRY(add_entry(map, i, map->first + (int64_t)i, error));
    if (has_entries || !ascends)
        TETLOD_TRY(add_entry(map, map->count, tag, error));
    map->count++;
    return TETLOD_OK;
}

static int compare_tags(const void *left, const void *right)
{
    const struct tag_entry *a = left, *b = right;
    return a->tag < b->tag ? -1 : a->tag > b->tag;
}

enum tetlod_status tag_map_sort(struct tag_map *map, struct tetlod_error *error)
{
    if (!map->entries)
        return TETLOD_OK;
    size_t ascending = 1;
    while (ascending < map->count && map->entries[ascending - 1].tag < map->entries[ascending].tag)
        ascending++;
    if (ascending < map->count)
        qsort(map->entries, map->count, sizeof *map->entries, compare_tags);
    for (size_t i = 1; i < map->count; i++)
        if (map->entries[i - 1].tag == map->entries[i].tag)
            return tetlodi_fail(error, TETLOD_ERR_MESH, "point %lld is there twice", (long long)map->entries[i].tag);
    return TETLOD_OK;
}

uint32_t tag_map_find(const struct tag_map *map, int64_t tag)
{
    if (!map->entries)
        return (uint64_t)tag - (uint64_t)map->first < map->count ? (uint32_t)((uint64_t)tag -
                                                                              (uint64_t)map->first) : TETLOD_NONE;
    if (tag < map->entries[0].tag)
        return TETLOD_NONE;
    uint64_t guess = (uint64_t)tag - (uint64_t)map->entries[0].tag;
    if (guess < map->count && map->entries[guess].tag == tag)
        return map->entries[guess].index;
    const struct tag_entry key = {tag, 0};
    const struct tag_entry *found = bsearch(&key, map->entries, map->count, sizeof key, compare_tags);
    return found ? found->index : TETLOD_NONE;
}

void tag_map_fini(struct tag_map *map)
{
    free(map->entries);
    *map = (struct tag_map){0};
}
