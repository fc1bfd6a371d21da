/* SPDX-License-Identifier: BSD-3-Clause */
/* Little-endian numbers in and out of memory, bounded both ways. */
#ifndef TETLOD_BYTES_H
#define TETLOD_BYTES_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/* What is left to read. A read past the end gives 0 and sets `failed`; it is checked once, at the end. */
struct tetlodi_bytes {
    const uint8_t *at;
    size_t left;
    bool failed;
};

/* What has been written. A failed allocation sets `failed`; it is checked once, at the end. */
struct tetlodi_buffer {
    uint8_t *bytes;
    size_t size, capacity;
    bool failed;
};

uint64_t tetlodi_get(struct tetlodi_bytes *bytes, unsigned width); /* 1..8 bytes */
double tetlodi_get_f64(struct tetlodi_bytes *bytes);
const uint8_t *tetlodi_get_block(struct tetlodi_bytes *bytes, size_t size); /* NULL past the end */

void tetlodi_buffer_fini(struct tetlodi_buffer *buffer);
void tetlodi_put(struct tetlodi_buffer *buffer, uint64_t value, unsigned width);
void tetlodi_put_f64(struct tetlodi_buffer *buffer, double value);
void tetlodi_put_block(struct tetlodi_buffer *buffer, const void *block, size_t size);

#endif
