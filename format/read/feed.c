/* SPDX-License-Identifier: BSD-3-Clause */
/* A stream that arrives in pieces: what has come is kept, and is a prefix of the stream that a file reads from. */
#include <stdlib.h>
#include <string.h>

#include "format/coding/pointer.h"
#include "format/fail.h"
#include "format/read/reader.h"

/* Bytes of the stream that came out of turn. */
struct piece {
    struct piece *next;
    uint64_t offset;
    size_t size;
    uint8_t bytes[];
};

/* A frame of the stream, in its order. */
struct fed_frame {
    uint64_t end;
    uint64_t left_out; /* bytes that are left out before it */
    bool skipped;
};

struct tetlod_feed {
    struct tetlodi_buffer bytes; /* what was added */
    uint64_t dropped;            /* bytes that were added before those */
    uint64_t pass;               /* bytes of an HDF5 file that come before its stream (SPEC 3.10) */
    uint64_t pointed;            /* bytes that the stream has in it; 0: it is no such file */
    uint64_t end;                /* of the stream as far as it is there; further on if frames are left out */
    struct tetlod_options options;
    struct tetlod_file *file;
    bool selects;
    struct tetlodi_buffer names; /* of the selected fields, each ended by NUL */
    struct fed_frame *frames;    /* [frame_count, and one behind], if it selects */
    size_t frame_count, frame;   /* that the next byte belongs to */
    struct piece *pieces;
};

enum tetlod_status tetlod_feed_new(struct tetlod_feed **out, const struct tetlod_options *options,
                                   struct tetlod_error *error)
{
    *out = calloc(1, sizeof **out);
    if (!*out)
        return tetlodi_fail_nomem(error, "a stream", sizeof **out);
    (*out)->options = tetlodi_options(options);
    return TETLOD_OK;
}

static void close_file(struct tetlod_feed *feed)
{
    tetlod_close(feed->file);
    free(feed->frames);
    feed->file = NULL;
    feed->frames = NULL;
}

void tetlod_feed_free(struct tetlod_feed *feed)
{
    if (!feed)
        return;
    tetlod_feed_forget(feed);
    close_file(feed);
    tetlodi_buffer_fini(&feed->bytes);
    tetlodi_buffer_fini(&feed->names);
    free(feed);
}

/* The first frame that ends behind one of the stream's bytes. */
static const struct fed_frame *frame_at(const struct tetlod_feed *feed, uint64_t offset)
{
    size_t low = 0, high = feed->frame_count;
    while (low < high) {
        size_t middle = low + (high - low) / 2;
        if (feed->frames[middle].end <= offset)
            low = middle + 1;
        else
            high = middle;
    }
    return &feed->frames[low];
}

static const struct piece *find_piece(const struct tetlod_feed *feed, uint64_t offset, size_t size)
{
    const struct piece *piece = feed->pieces;
    while (piece && (offset < piece->offset || size > piece->size || offset - piece->offset > piece->size - size))
        piece = piece->next;
    return piece;
}

/* A part of the stream that is there, if it is not left out. */
static enum tetlod_status read_fed(void *opaque, uint64_t offset, void *buffer, size_t size)
{
    const struct tetlod_feed *feed = opaque;
    const struct piece *piece = find_piece(feed, offset, size);
    if (piece) {
        memcpy(buffer, piece->bytes + (offset - piece->offset), size);
        return TETLOD_OK;
    }
    if (feed->frames) {
        const struct fed_frame *frame = frame_at(feed, offset);
        if (frame->skipped && size)
            return TETLOD_ERR_FIELD;
        offset -= frame->left_out;
    }
    if (size && (offset < feed->dropped || offset - feed->dropped > feed->bytes.size ||
                 size > feed->bytes.size - (offset - feed->dropped)))
        return TETLOD_ERR_TRUNCATED;
    if (size)
        memcpy(buffer, feed->bytes.bytes + (offset - feed->dropped), size);
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

/* skipped: [1 + field_count] what is left out of every level. */
static enum tetlod_status find_skipped(const struct tetlod_feed *feed, bool *skipped, struct tetlod_error *error)
{
    const struct tetlod_info *info = &feed->file->index.info;
    for (size_t part = 0; part <= info->field_count; part++)
        skipped[part] = part > 0;
    for (size_t at = 0; at < feed->names.size; at += strlen((const char *)feed->names.bytes + at) + 1) {
        const char *name = (const char *)feed->names.bytes + at;
        uint32_t field = tetlod_field_index(info, name);
        if (field == TETLOD_NONE)
            return tetlodi_fail(error, TETLOD_ERR_FIELD, "the stream has no field '%.128s'", name);
        skipped[1 + field] = false;
    }
    return TETLOD_OK;
}

/* The frames, which of them are left out, and how many bytes before each. */
static enum tetlod_status list_frames(struct tetlod_feed *feed, struct tetlod_error *error)
{
    const struct tetlodi_index *index = &feed->file->index;
    bool skipped[1 + MAX_FIELDS];
    size_t count = 0;
    TETLOD_TRY(find_skipped(feed, skipped, error));
    for (uint32_t level = 0; level < index->info.level_count; level++)
        count += tetlodi_frame_count(index, level);
    feed->frame_count = count;
    feed->frames = calloc(count + 1, sizeof *feed->frames);
    if (!feed->frames)
        return tetlodi_fail_nomem(error, "a selection of fields", count * sizeof *feed->frames);
    struct fed_frame *to = feed->frames;
    for (uint32_t level = 0, part; level < index->info.level_count; level++)
        for (size_t i = 0; i < tetlodi_frame_count(index, level); i++, to++) {
            const struct tetlodi_frame frame = tetlodi_frame_at(index, level, i, &part);
            to->end = frame.offset + frame.size;
            to->skipped = skipped[part];
            to[1].left_out = to->left_out + (to->skipped ? frame.size : 0);
        }
    return TETLOD_OK;
}

/* Bytes from the beginning that are sure to be wanted before the file can be opened: the header, then all before level
 * 0. */
static enum tetlod_status wanted(const struct tetlod_feed *feed, uint64_t *out, struct tetlod_error *error)
{
    struct tetlodi_header header;
    *out = HEADER_SIZE;
    if (feed->bytes.size < HEADER_SIZE)
        return TETLOD_OK;
    TETLOD_TRY(tetlodi_header_decode(&header, feed->bytes.bytes, error));
    *out = tetlodi_header_head(&header);
    return TETLOD_OK;
}

static enum tetlod_status put(struct tetlod_feed *feed, const uint8_t *bytes, size_t size, struct tetlod_error *error)
{
    uint64_t most = feed->options.max_bytes;
    if (size > most - (feed->bytes.size < most ? feed->bytes.size : most))
        return tetlodi_fail(error, TETLOD_ERR_LIMIT, "the stream is longer than the %llu bytes allowed",
                            (unsigned long long)most);
    tetlodi_put_block(&feed->bytes, bytes, size);
    if (feed->bytes.failed)
        return tetlodi_fail_nomem(error, "the stream", feed->bytes.size + (uint64_t)size);
    feed->end += size;
    return TETLOD_OK;
}

/* The first bytes are those of an HDF5 file: what comes before its stream is passed. */
static enum tetlod_status take_pointer(struct tetlod_feed *feed, struct tetlod_error *error)
{
    struct tetlodi_pointer pointer;
    TETLOD_TRY(tetlodi_pointer_decode(&pointer, feed->bytes.bytes, error));
    feed->pass = pointer.offset - POINTER_SIZE;
    feed->pointed = pointer.size;
    feed->bytes.size = 0;
    feed->end = 0;
    return TETLOD_OK;
}

static enum tetlod_status open_file(struct tetlod_feed *feed, struct tetlod_error *error)
{
    const struct tetlod_source source = {read_fed, feed, feed->end};
    TETLOD_TRY(tetlod_open(&feed->file, &source, &feed->options, error));
    enum tetlod_status status = feed->selects ? list_frames(feed, error) : TETLOD_OK;
    if (status == TETLOD_OK && feed->pointed && feed->pointed != feed->file->index.info.bytes)
        status = tetlodi_fail(error, TETLOD_ERR_STREAM,
                              "the pointer to the stream says %llu bytes, and the stream %llu",
                              (unsigned long long)feed->pointed, (unsigned long long)feed->file->index.info.bytes);
    if (status != TETLOD_OK)
        close_file(feed);
    return status;
}

/* Takes what belongs to header and index, and opens the file when that is all. */
static enum tetlod_status take_index(struct tetlod_feed *feed, const uint8_t **bytes, size_t *size,
                                     struct tetlod_error *error)
{
    for (;;) {
        uint64_t end;
        size_t passed = feed->pass < *size ? (size_t)feed->pass : *size;
        feed->pass -= passed;
        *bytes += passed;
        *size -= passed;
        if (!feed->pointed && feed->bytes.size == POINTER_SIZE && tetlodi_pointer_is(feed->bytes.bytes)) {
            TETLOD_TRY(take_pointer(feed, error));
            continue;
        }
        TETLOD_TRY(wanted(feed, &end, error));
        if (feed->bytes.size == end)
            return open_file(feed, error);
        size_t taken = end - feed->bytes.size < *size ? (size_t)(end - feed->bytes.size) : *size;
        if (!taken)
            return TETLOD_MORE;
        TETLOD_TRY(put(feed, *bytes, taken, error));
        *bytes += taken;
        *size -= taken;
    }
}

/* Takes bytes for the frames that they are of, and passes those between. */
static enum tetlod_status take_frames(struct tetlod_feed *feed, const uint8_t *bytes, size_t size,
                                      struct tetlod_error *error)
{
    for (; feed->frame < feed->frame_count; feed->frame++) {
        const struct fed_frame *frame = &feed->frames[feed->frame];
        uint64_t rest = frame->end - feed->end;
        if (frame->skipped) {
            feed->end += rest;
            continue;
        }
        size_t taken = rest < size ? (size_t)rest : size;
        TETLOD_TRY(put(feed, bytes, taken, error));
        bytes += taken;
        size -= taken;
        if (taken < rest)
            return TETLOD_OK;
    }
    return put(feed, bytes, size, error);
}

/* What the file believes to be there: read_fed knows better. */
static void set_size(struct tetlod_feed *feed)
{
    uint64_t end = feed->end;
    for (const struct piece *piece = feed->pieces; piece; piece = piece->next)
        end = piece->offset + piece->size > end ? piece->offset + piece->size : end;
    feed->file->source.size = end;
}

enum tetlod_status tetlod_feed_add(struct tetlod_feed *feed, const void *bytes, size_t size, struct tetlod_error *error)
{
    const uint8_t *at = bytes;
    if (!feed->file)
        TETLOD_TRY(take_index(feed, &at, &size, error));
    uint64_t left = feed->file->index.info.bytes - feed->end;
    if (feed->pointed && size > left)
        size = (size_t)left; // the rest is of the HDF5 file
    TETLOD_TRY(feed->selects ? take_frames(feed, at, size, error) : put(feed, at, size, error));
    if (feed->end > feed->file->index.info.bytes)
        return tetlodi_fail(error, TETLOD_ERR_STREAM, "%llu bytes follow the end of the stream",
                            (unsigned long long)(feed->end - feed->file->index.info.bytes));
    set_size(feed);
    return TETLOD_OK;
}

enum tetlod_status tetlod_feed_put(struct tetlod_feed *feed, uint64_t offset, const void *bytes, size_t size,
                                   struct tetlod_error *error)
{
    uint64_t whole = feed->file ? feed->file->index.info.bytes : 0;
    if (offset > whole || size > whole - offset)
        return tetlodi_fail(error, TETLOD_ERR_ARGUMENT, "the stream has no %zu bytes at %llu", size,
                            (unsigned long long)offset);
    struct piece *piece = malloc(sizeof *piece + size);
    if (!piece)
        return tetlodi_fail_nomem(error, "a part of the stream", size);
    *piece = (struct piece){feed->pieces, offset, size};
    if (size)
        memcpy(piece->bytes, bytes, size);
    feed->pieces = piece;
    set_size(feed);
    return TETLOD_OK;
}

void tetlod_feed_forget(struct tetlod_feed *feed)
{
    while (feed->pieces) {
        struct piece *next = feed->pieces->next;
        free(feed->pieces);
        feed->pieces = next;
    }
    if (feed->file)
        set_size(feed);
}

struct tetlod_file *tetlod_feed_file(const struct tetlod_feed *feed)
{
    return feed->file;
}

const void *tetlod_feed_added(const struct tetlod_feed *feed, size_t *size)
{
    *size = feed->bytes.size;
    return feed->bytes.bytes;
}

uint32_t tetlod_feed_level(const struct tetlod_feed *feed)
{
    uint32_t level = TETLOD_NONE;
    const struct tetlod_info *info = feed->file ? tetlod_info(feed->file) : NULL;
    for (uint32_t k = 0; info && k < info->level_count && info->levels[k].end <= feed->end; k++)
        level = k;
    return level;
}

uint64_t tetlod_feed_bytes(const struct tetlod_feed *feed, uint32_t level)
{
    uint64_t end = tetlod_info(feed->file)->levels[level].end;
    return end - (feed->frames ? frame_at(feed, end)->left_out : 0);
}

void tetlod_feed_drop(struct tetlod_feed *feed, uint32_t level)
{
    uint64_t end = tetlod_feed_bytes(feed, level);
    if (end <= feed->dropped || end - feed->dropped > feed->bytes.size)
        return;
    struct tetlodi_buffer rest = {0};
    size_t gone = (size_t)(end - feed->dropped);
    tetlodi_put_block(&rest, feed->bytes.bytes + gone, feed->bytes.size - gone);
    if (rest.failed)
        return; // what was to give back memory stays without harm
    tetlodi_buffer_fini(&feed->bytes);
    feed->bytes = rest;
    feed->dropped = end;
}
