/* SPDX-License-Identifier: BSD-3-Clause */
/* A stream that arrives in pieces: what has come is kept, and is a prefix of the stream that a file reads from. */
#include <stdlib.h>
#include <string.h>

#include "format/fail.h"
#include "format/reader.h"

struct tetlod_feed {
    struct tetlodi_buffer bytes;
    struct tetlod_options options;
    struct tetlod_file *file;
};

enum tetlod_status tetlod_feed_new(struct tetlod_feed **out, const struct tetlod_options *options,
                                   struct tetlod_error *error)
{
    *out = calloc(1, sizeof **out);
    if (!*out)
        return tetlodi_fail_nomem(error, "a stream", sizeof **out);
    (*out)->options.struct_size = sizeof (*out)->options;
    if (options && options->struct_size >= sizeof *options)
        (*out)->options = *options;
    return TETLOD_OK;
}

void tetlod_feed_free(struct tetlod_feed *feed)
{
    if (!feed)
        return;
    tetlod_close(feed->file);
    tetlodi_buffer_fini(&feed->bytes);
    free(feed);
}

static enum tetlod_status read_fed(void *opaque, uint64_t offset, void *buffer, size_t size)
{
    const struct tetlod_feed *feed = opaque;
    memcpy(buffer, feed->bytes.bytes + offset, size);
    return TETLOD_OK;
}

/* Opens the file once its header and index are there. */
static enum tetlod_status try_open(struct tetlod_feed *feed, struct tetlod_error *error)
{
    struct tetlodi_header header;
    if (feed->bytes.size < HEADER_SIZE)
        return TETLOD_MORE;
    TETLOD_TRY(tetlodi_header_decode(&header, feed->bytes.bytes, error));
    if (feed->bytes.size - HEADER_SIZE < header.index_size)
        return TETLOD_MORE;
    const struct tetlod_source source = {read_fed, feed, feed->bytes.size};
    return tetlod_open(&feed->file, &source, &feed->options, error);
}

enum tetlod_status tetlod_feed_add(struct tetlod_feed *feed, const void *bytes, size_t size, struct tetlod_error *error)
{
    uint64_t most = feed->options.max_bytes ? feed->options.max_bytes : UINT64_MAX;
    if (size > most - (feed->bytes.size < most ? feed->bytes.size : most))
        return tetlodi_fail(error, TETLOD_ERR_LIMIT, "the stream is longer than the %llu bytes allowed",
                            (unsigned long long)most);
    tetlodi_put_block(&feed->bytes, bytes, size);
    if (feed->bytes.failed)
        return tetlodi_fail_nomem(error, "the stream", feed->bytes.size + (uint64_t)size);
    if (!feed->file)
        return try_open(feed, error);
    feed->file->source.size = feed->bytes.size;
    return TETLOD_OK;
}

struct tetlod_file *tetlod_feed_file(const struct tetlod_feed *feed)
{
    return feed->file;
}

uint32_t tetlod_feed_level(const struct tetlod_feed *feed)
{
    uint32_t level = TETLOD_NONE;
    const struct tetlod_info *info = feed->file ? tetlod_info(feed->file) : NULL;
    for (uint32_t k = 0; info && k < info->level_count && info->levels[k].end <= feed->bytes.size; k++)
        level = k;
    return level;
}
