/* SPDX-License-Identifier: BSD-3-Clause */
#include "server/assets.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "src/util/array.h"

struct assets {
    size_t count;
    struct asset *list;
};

void assets_free(struct assets *assets)
{
    if (!assets)
        return;
    for (size_t i = 0; i < assets->count; i++)
        for (int c = 0; c < CODINGS; c++)
            buffer_fini(&assets->list[i].encoded[c]);
    free(assets->list);
    free(assets);
}

static bool prepare(struct asset *asset, const struct embedded_file *file)
{
    size_t size = (size_t)(file->end - file->bytes);
    uint64_t hash = 0xcbf29ce484222325u; // FNV-1a: tells versions of our own files apart, nothing else
    for (const unsigned char *at = file->bytes; at < file->end; at++)
        hash = (hash ^ *at) * 0x100000001b3u;
    snprintf(asset->etag, sizeof asset->etag, "%016llx", (unsigned long long)hash);
    asset->file = file;
    for (int c = CODING_GZIP; c < CODINGS; c++) {
        if (buffer_append(&asset->encoded[c], file->bytes, size) != TETLOD_OK ||
            buffer_encode(&asset->encoded[c], (enum coding)c, NULL) != TETLOD_OK)
            return false;
        if (asset->encoded[c].size >= size)
            buffer_fini(&asset->encoded[c]);
    }
    return true;
}

struct assets *assets_new(void)
{
    struct assets *assets = array_zero(1, sizeof *assets);
    if (!assets)
        return NULL;
    assets->list = array_zero(embedded_file_count, sizeof *assets->list);
    bool prepared = assets->list != NULL;
    for (assets->count = 0; prepared && assets->count < embedded_file_count; assets->count++)
        prepared = prepare(&assets->list[assets->count], &embedded_files[assets->count]);
    if (prepared)
        return assets;
    assets_free(assets);
    return NULL;
}

const struct asset *assets_find(const struct assets *assets, const char *path)
{
    for (size_t i = 0; i < assets->count; i++)
        if (strcmp(assets->list[i].file->path, path) == 0)
            return &assets->list[i];
    return NULL;
}
