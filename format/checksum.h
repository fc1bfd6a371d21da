/* SPDX-License-Identifier: BSD-3-Clause */
/* CRC-32 (IEEE 802.3, as zlib's) for damage, SHA-256 (FIPS 180-4) for identity. */
#ifndef TETLOD_CHECKSUM_H
#define TETLOD_CHECKSUM_H

#include <stddef.h>
#include <stdint.h>

uint32_t tetlodi_crc32(const void *bytes, size_t size);

struct tetlodi_sha256 {
    uint32_t state[8];
    uint64_t size;
    uint8_t block[64];
};

void tetlodi_sha256_init(struct tetlodi_sha256 *sha);
void tetlodi_sha256_add(struct tetlodi_sha256 *sha, const void *bytes, size_t size);
void tetlodi_sha256_finish(struct tetlodi_sha256 *sha, uint8_t out[32]);

#endif
