/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/util/channel.h"

#include <string.h>

#include "src/util/array.h"
#include "src/util/packed_words.h"

/* Of an array that is packed so many at a time. */
enum { BLOCK = 1 << 15 };

void channel_bytes(struct channel *channel, void *bytes, size_t size)
{
    channel->share->pass(channel->share->opaque, bytes, size);
}

/* Where a helper puts an array: NULL after a failure. The one that leads has it. */
static void *room_for(struct channel *channel, void *array, size_t count, size_t element_size)
{
    if (channel->share->leads)
        return array;
    array = channel->status == TETLOD_OK ? array_new(count, element_size) : NULL;
    channel->status = array ? TETLOD_OK : TETLOD_ERR_NOMEM;
    return array;
}

void *channel_array(struct channel *channel, void *array, size_t count, size_t element_size)
{
    array = room_for(channel, array, count, element_size);
    channel_bytes(channel, array, count * element_size);
    return array;
}

/* A packed block from one end to the other: of a helper *io_block is then what has come, or empty for want of room. */
static void pass_block(struct channel *channel, struct buffer *io_block)
{
    uint64_t size = io_block->size;
    CHANNEL_VALUE(channel, size);
    if (channel->share->leads) {
        channel_bytes(channel, io_block->bytes, size);
        return;
    }
    io_block->size = 0;
    unsigned char *to = buffer_extend(io_block, size);
    channel_bytes(channel, to, size);
    channel->status = to || !size ? channel->status : TETLOD_ERR_NOMEM;
}

void *channel_words(struct channel *channel, void *array, size_t count, size_t width, size_t lag)
{
    struct buffer block = {0};
    bool leads = channel->share->leads, good = true;
    unsigned char *at = array = room_for(channel, array, count, width);
    for (size_t i = 0; i < count; i += BLOCK) {
        size_t part = count - i < BLOCK ? count - i : BLOCK;
        block.size = 0;
        if (leads)
            good &= words_put(&block, at + i * width, part, (unsigned)width, (unsigned)lag);
        pass_block(channel, &block);
        struct words_source source = {block.bytes, block.size};
        if (!leads && at)
            good &= words_get(&source, at + i * width, part, (unsigned)width, (unsigned)lag);
    }
    channel->status = good ? channel->status : TETLOD_ERR_NOMEM;
    buffer_fini(&block);
    return array;
}

char *channel_text(struct channel *channel, char *text)
{
    uint64_t size = text ? strlen(text) + 1 : 0;
    CHANNEL_VALUE(channel, size);
    return size ? channel_array(channel, text, size, 1) : NULL;
}
