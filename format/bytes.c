/* SPDX-License-Identifier: BSD-3-Clause */
#include "format/bytes.h"

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

uint64_t tetlodi_get_varint(struct tetlodi_bytes *bytes)
{
    uint64_t value = 0;
    for (unsigned shift = 0; shift < 64; shift += 7) {
        uint64_t byte = tetlodi_get(bytes, 1);
        value |= (byte & 127) << shift;
        if (byte < 128)
            return value;
    }
    bytes->failed = true;
    return 0;
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
        uint8_t *grown = capacity > size ? realloc(buffer->bytes, capacity) : NULL;
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

void tetlodi_put_varint(struct tetlodi_buffer *buffer, uint64_t value)
{
    for (; value >= 128; value >>= 7)
        tetlodi_put(buffer, (value & 127) | 128, 1);
    tetlodi_put(buffer, value, 1);
}

void tetlodi_put_f64(struct tetlodi_buffer *buffer, double value)
{
    uint64_t bits;
    memcpy(&bits, &value, sizeof bits);
    tetlodi_put(buffer, bits, 8);
}

uint64_t tetlodi_ordered_bits(double value, bool wide)
{
    if (wide) {
        uint64_t bits;
        memcpy(&bits, &value, sizeof bits);
        return bits >> 63 ? ~bits : bits | (uint64_t)1 << 63;
    }
    float narrow = (float)value;
    uint32_t bits;
    memcpy(&bits, &narrow, sizeof bits);
    return bits >> 31 ? (uint32_t)~bits : bits | (uint32_t)1 << 31;
}

double tetlodi_from_ordered(uint64_t bits, bool wide)
{
    if (wide) {
        double value;
        bits = bits >> 63 ? bits & ~((uint64_t)1 << 63) : ~bits;
        memcpy(&value, &bits, sizeof value);
        return value;
    }
    uint32_t narrow = (uint32_t)bits;
    float value;
    narrow = narrow >> 31 ? narrow & ~((uint32_t)1 << 31) : ~narrow;
    memcpy(&value, &narrow, sizeof value);
    return (double)value;
}
