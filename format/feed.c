/* SPDX-License-Identifier: BSD-3-Clause */
/* A stream that arrives in pieces: what has come is kept, and is a prefix of the stream that a file reads from. */
#include <stdlib.h>
#include <string.h>

#include "format/fail.h"
#include "format/reader.h"

struct tetlod_feed {
    struct tetlodi_buffer bytes; /* the stream; zeros where frames are left out */
    struct tetlod_options options;
    struct tetlod_file *file;
    bool selects;
    struct tetlodi_buffer names; /* of the selected fields, each ended by NUL */
    bool *skipped;               /* [1 + field_count], if it selects: what is left out of every level */
    size_t frame;                /* that the next byte belongs to */
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
    tetlodi_buffer_fini(&feed->names);
    free(feed->skipped);
    free(feed);
}

static enum tetlod_status read_fed(void *opaque, uint64_t offset, void *buffer, size_t size)
{
    const struct tetlod_feed *feed = opaque;
    memcpy(buffer, feed->bytes.bytes + offset, size);
    return TETLOD_OK;
}

enum tetlod_status tetlod_feed_select(struct tetlod_feed *feed, const char *const *names, uint32_t count,
                                      struct tetlod_error *error)
{
    feed->selects = true;
    for (uint32_t i = 0; i < count; i++)
        tetlodi_put_block(&feed->names, names[i], strlen(names[i]) + 1);
    return feed->names.failed ? tetlodi_fail_nomem(error, "the names of fields", feed->names.size) : TETLOD_OK;
}

/* Which frames of a level are left out. */
static enum tetlod_status find_skipped(struct tetlod_feed *feed, struct tetlod_error *error)
{
    const struct tetlod_info *info = tetlod_info(feed->file);
    feed->skipped = malloc((1 + (size_t)info->field_count) * sizeof *feed->skipped);
    if (!feed->skipped)
        return tetlodi_fail_nomem(error, "a selection of fields", info->field_count);
    for (uint32_t part = 0; part <= info->field_count; part++)
        feed->skipped[part] = part > 0;
    for (size_t at = 0; at < feed->names.size; at += strlen((const char *)feed->names.bytes + at) + 1) {
        const char *name = (const char *)feed->names.bytes + at;
        uint32_t field = tetlod_field_index(info, name);
        if (field == TETLOD_NONE)
            return tetlodi_fail(error, TETLOD_ERR_FIELD, "the stream has no field '%.128s'", name);
        feed->skipped[1 + field] = false;
    }
    return TETLOD_OK;
}

/* Bytes from the beginning that are sure to be wanted before the index is there: up to the end of the header, then of the index. */
static enum tetlod_status wanted(const struct tetlod_feed *feed, uint64_t *out, struct tetlod_error *error)
{
    struct tetlodi_header header;
    *out = HEADER_SIZE;
    if (feed->bytes.size < HEADER_SIZE)
        return TETLOD_OK;
    TETLOD_TRY(tetlodi_header_decode(&header, feed->bytes.bytes, error));
    *out += header.index_size;
    return TETLOD_OK;
}

static enum tetlod_status put(struct tetlod_feed *feed, const uint8_t *bytes, size_t size, struct tetlod_error *error)
{
    uint64_t most = feed->options.max_bytes ? feed->options.max_bytes : UINT64_MAX;
    if (size > most - (feed->bytes.size < most ? feed->bytes.size : most))
        return tetlodi_fail(error, TETLOD_ERR_LIMIT, "the stream is longer than the %llu bytes allowed",
                            (unsigned long long)most);
    if (bytes)
        tetlodi_put_block(&feed->bytes, bytes, size);
    else
        tetlodi_put_zeros(&feed->bytes, size);
    return feed->bytes.failed ? tetlodi_fail_nomem(error, "the stream", feed->bytes.size + (uint64_t)size) : TETLOD_OK;
}

/* Takes what belongs to header and index, and opens the file when that is all. */
static enum tetlod_status take_index(struct tetlod_feed *feed, const uint8_t **bytes, size_t *size, struct tetlod_error *error)
{
    for (;;) {
        uint64_t end;
        TETLOD_TRY(wanted(feed, &end, error));
        if (feed->bytes.size == end)
            break;
        size_t taken = end - feed->bytes.size < *size ? (size_t)(end - feed->bytes.size) : *size;
        if (!taken)
            return TETLOD_MORE;
        TETLOD_TRY(put(feed, *bytes, taken, error));
        *bytes += taken;
        *size -= taken;
    }
    const struct tetlod_source source = {read_fed, feed, feed->bytes.size};
    TETLOD_TRY(tetlod_open(&feed->file, &source, &feed->options, error));
    return feed->selects ? find_skipped(feed, error) : TETLOD_OK;
}

/* Puts bytes into the frames that they are of, and zeros into those between. */
static enum tetlod_status take_frames(struct tetlod_feed *feed, const uint8_t *bytes, size_t size, struct tetlod_error *error)
{
    const struct tetlodi_index *index = &feed->file->index;
    size_t parts = 1 + (size_t)index->info.field_count;
    for (; feed->frame < index->info.level_count * parts; feed->frame++) {
        const struct tetlodi_frame *frame = &index->frames[feed->frame];
        size_t rest = (size_t)(frame->offset + frame->size - feed->bytes.size), taken = rest < size ? rest : size;
        if (feed->skipped[feed->frame % parts]) {
            TETLOD_TRY(put(feed, NULL, rest, error));
            continue;
        }
        TETLOD_TRY(put(feed, bytes, taken, error));
        bytes += taken;
        size -= taken;
        if (taken < rest)
            return TETLOD_OK;
    }
    return put(feed, bytes, size, error);
}

enum tetlod_status tetlod_feed_add(struct tetlod_feed *feed, const void *bytes, size_t size, struct tetlod_error *error)
{
    const uint8_t *at = bytes;
    if (!feed->file)
        TETLOD_TRY(take_index(feed, &at, &size, error));
    TETLOD_TRY(feed->selects ? take_frames(feed, at, size, error) : put(feed, at, size, error));
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

uint64_t tetlod_feed_bytes(const struct tetlod_feed *feed, uint32_t level)
{
    const struct tetlodi_index *index = &feed->file->index;
    size_t parts = 1 + (size_t)index->info.field_count, count = (level + (size_t)1) * parts;
    uint64_t bytes = index->info.levels[level].end;
    for (size_t i = 0; feed->selects && i < count; i++)
        if (feed->skipped[i % parts])
            bytes -= index->frames[i].size;
    return bytes;
}
