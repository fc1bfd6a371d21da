/* SPDX-License-Identifier: BSD-3-Clause */
#include "server/jobs/kept_levels.h"

#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "format/fail.h"
#include "src/util/array.h"
#include "src/util/hash.h"

enum { KEY_CAPACITY = 128 };

/* A level's arrays, one behind the other in one block. */
struct kept {
    struct form_mesh mesh;
    struct ask_blocks blocks;
    double numbers[];
};

static void print_key(const struct kept_levels *kept, uint32_t level, const char *field, char out[KEY_CAPACITY])
{
    snprintf(out, KEY_CAPACITY, "%s/asked/%" PRIu32 "/%016" PRIx64, kept->cid, level,
             (uint64_t)hash_text(HASH_START, field));
}

static bool take(void *opaque, uint32_t level, const char *field, struct form_mesh *out)
{
    struct kept_levels *kept = opaque;
    struct tetlod_error ignored;
    char key[KEY_CAPACITY];
    print_key(kept, level, field, key);
    struct cache_entry *entry = kept->count < MAX_KEPT_LEVELS ? cache_find(kept->memory, key) : NULL;
    const struct cache_value *value = entry && cache_finished(entry) ? cache_value(entry, &ignored) : NULL;
    if (value) {
        kept->held[kept->count++] = entry;
        *out = ((const struct kept *)value->data)->mesh;
    } else if (entry) {
        cache_release(kept->memory, entry);
    }
    return value != NULL;
}

static size_t size_of(const struct form_mesh *mesh, uint32_t components)
{
    const size_t columns = 3 + (mesh->values ? components : 0) + (mesh->bounds ? 1 : 0), blocks = mesh->blocks->count;
    return sizeof(struct kept) + columns * mesh->vertices * sizeof(double) +
        blocks * (sizeof(struct ask_block) + components * sizeof(struct ask_block_values)) +
        (size_t)mesh->tets * 5 * sizeof(uint32_t);
}

/* The next one of the arrays; NULL where there is none. */
static const void *copy_array(uint8_t **at, const void *values, size_t size)
{
    uint8_t *out = *at;
    if (!values)
        return NULL;
    memcpy(out, values, size);
    *at += size;
    return out;
}

static struct kept *copy(const struct form_mesh *mesh, uint32_t components)
{
    struct kept *out = malloc(size_of(mesh, components));
    if (!out)
        return NULL;
    const size_t column = mesh->vertices * sizeof(double), blocks = mesh->blocks->count;
    uint8_t *at = (uint8_t *)out->numbers;
    out->mesh = *mesh;
    out->blocks = *mesh->blocks;
    out->mesh.positions = copy_array(&at, mesh->positions, 3 * column);
    out->mesh.values = copy_array(&at, mesh->values, components * column);
    out->mesh.bounds = copy_array(&at, mesh->bounds, column);
    out->blocks.blocks = copy_array(&at, mesh->blocks->blocks, blocks * sizeof *out->blocks.blocks);
    out->blocks.values = copy_array(&at, mesh->blocks->values,
                                    mesh->values ? blocks * components * sizeof *out->blocks.values : 0);
    out->mesh.corners = copy_array(&at, mesh->corners, (size_t)mesh->tets * 4 * sizeof *mesh->corners);
    out->mesh.numbers = copy_array(&at, mesh->numbers, (size_t)mesh->tets * sizeof *mesh->numbers);
    out->mesh.blocks = &out->blocks;
    return out;
}

static void put(void *opaque, uint32_t level, const char *field, const struct form_mesh *mesh, uint32_t components)
{
    const struct kept_levels *kept = opaque;
    struct tetlod_error failure = {0};
    struct cache_value value = {NULL, size_of(mesh, components), free};
    char key[KEY_CAPACITY];
    bool mine;
    print_key(kept, level, field, key);
    struct cache_entry *entry = cache_fetch(kept->memory, key, &mine);
    if (!entry)
        return;
    if (mine) {
        if (cache_reserve(kept->memory, entry, value.size) == TETLOD_OK)
            value.data = copy(mesh, components);
        if (!value.data)
            (void)tetlodi_fail(&failure, TETLOD_ERR_LIMIT, "there is no room to keep a level");
        cache_finish(kept->memory, entry, value.data ? &value : NULL, &failure);
    }
    cache_release(kept->memory, entry);
}

void kept_levels_begin(struct kept_levels *kept, struct cache *memory, const char *cid)
{
    *kept = (struct kept_levels){.memory = memory, .cid = cid, .shelf = {kept, take, put}};
}

void kept_levels_end(struct kept_levels *kept)
{
    while (kept->count)
        cache_release(kept->memory, kept->held[--kept->count]);
}
