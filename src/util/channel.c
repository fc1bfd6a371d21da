/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/util/channel.h"

#include <string.h>

#include "src/util/array.h"

void channel_bytes(struct channel *channel, void *bytes, size_t size)
{
    channel->share->pass(channel->share->opaque, bytes, size);
}

void *channel_array(struct channel *channel, void *array, size_t count, size_t element_size)
{
    if (!channel->share->leads) {
        array = channel->status == TETLOD_OK ? array_new(count, element_size) : NULL;
        channel->status = array ? TETLOD_OK : TETLOD_ERR_NOMEM;
    }
    channel_bytes(channel, array, count * element_size);
    return array;
}

char *channel_text(struct channel *channel, char *text)
{
    uint64_t size = text ? strlen(text) + 1 : 0;
    CHANNEL_VALUE(channel, size);
    return size ? channel_array(channel, text, size, 1) : NULL;
}
