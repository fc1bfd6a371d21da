/* SPDX-License-Identifier: BSD-3-Clause */
#include "format/common/bytes.h"

#include <stdlib.h>
#include <string.h>

uint64_t tetlodi_get(struct tetlodi_bytes *bytes, unsigned width)
{
    uint64_t value = 0;
    const uint8_t *block = tetlodi_get_block(bytes, width);
    for (unsigned i = 0; i < width && block; i++)
        value |= (uint64_t)block[i] << (8 * i);
    return value;
}

double tetlodi_get_f64(struct tetlodi_bytes *bytes)
{
    uint64_t bits = tetlodi_get(bytes, 8);
    double value;
    memcpy(&value, &bits, sizeof value);
    return value;
}

const uint8_t *tetlodi_get_block(struct tetlodi_bytes *bytes, size_t size)
{
    if (size > bytes->left || bytes->failed) {
        bytes->failed = true;
        return NULL;
    }
    const uint8_t *block = bytes->at;
    bytes->at += size;
    bytes->left -= size;
    return block;
}

void tetlodi_buffer_fini(struct tetlodi_buffer *buffer)
{
    free(buffer->bytes);
    *buffer = (struct tetlodi_buffer){0};
}

void tetlodi_put_block(struct tetlodi_buffer *buffer, const void *block, size_t size)
{
    if (!buffer->failed && size > buffer->capacity - buffer->size) {
        size_t capacity = buffer->capacity + buffer->capacity / 2 + size + 256;
        uint8_t *grown = capacity > size ? (uint8_t *)realloc(buffer->bytes, capacity) : NULL;
        buffer->failed = !grown;
        buffer->bytes = grown ? grown : buffer->bytes;
        buffer->capacity = grown ? capacity : buffer->capacity;
    }
    if (buffer->failed || !size)
        return;
    memcpy(buffer->bytes + buffer->size, block, size);
    buffer->size += size;
}

void tetlodi_put(struct tetlodi_buffer *buffer, uint64_t value, unsigned width)
{
    uint8_t block[8];
    for (unsigned i = 0; i < width; i++)
        block[i] = (uint8_t)(value >> (8 * i));
    tetlodi_put_block(buffer, block, width);
}

void tetlodi_put_f64(struct tetlodi_buffer *buffer, double value)
{
    uint64_t bits;
    memcpy(&bits, &value, sizeof bits);
    tetlodi_put(buffer, bits, 8);
}
