/* SPDX-License-Identifier: BSD-3-Clause */
/* FNV-1a of 64 bits: for tables and names, not against anybody who wants collisions. */
#ifndef TETLOD_HASH_H
#define TETLOD_HASH_H

#include <stddef.h>
#include <stdint.h>
#include <string.h>

static const uint64_t HASH_START = 0xcbf29ce484222325u;

static inline uint64_t hash_byte(uint64_t hash, unsigned char byte)
{
    return (hash ^ byte) * 0x100000001b3u;
}

static inline uint64_t hash_text(uint64_t hash, const char *text)
{
    while (*text)
        hash = hash_byte(hash, (unsigned char)*text++);
    return hash;
}

/* Eight bytes at once. */
static inline uint64_t hash_bytes(uint64_t hash, const void *bytes, size_t size)
{
    const unsigned char *at = bytes, *end = at + size;
    for (uint64_t word; end - at >= 8; at += 8) {
        memcpy(&word, at, sizeof word);
        hash = (hash ^ word) * 0x100000001b3u;
        hash ^= hash >> 32;
    }
    while (at < end)
        hash = hash_byte(hash, *at++);
    return hash;
}

/* In fewer bits. */
static inline uint32_t hash_folded(uint64_t hash)
{
    return (uint32_t)(hash ^ hash >> 32);
}

#endif
