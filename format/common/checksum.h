/* SPDX-License-Identifier: BSD-3-Clause */
/* SHA-256 (FIPS 180-4), and its first 16 bytes, which say what a part of a stream is (SPEC 2.1). */
#ifndef TETLOD_CHECKSUM_H
#define TETLOD_CHECKSUM_H

#include <stddef.h>
#include <stdint.h>

enum { DIGEST_SIZE = 16 };

struct tetlodi_sha256 {
    uint32_t state[8];
    uint64_t size;
    uint8_t block[64];
};

void tetlodi_sha256_init(struct tetlodi_sha256 *sha);
void tetlodi_sha256_add(struct tetlodi_sha256 *sha, const void *bytes, size_t size);
void tetlodi_sha256_finish(struct tetlodi_sha256 *sha, uint8_t out[32]);

/* The first 16 bytes of SHA-256. */
void tetlodi_digest(const void *bytes, size_t size, uint8_t out[DIGEST_SIZE]);

#endif
