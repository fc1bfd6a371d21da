/* SPDX-License-Identifier: BSD-3-Clause */
#include "format/common/checksum.h"

#include <string.h>

/* FIPS 180-4. */
static const uint32_t rounds[64] = {
    0x428a2f98, 0x71374491, 0xb5c0fbcf, 0xe9b5dba5, 0x3956c25b, 0x59f111f1, 0x923f82a4, 0xab1c5ed5,
    0xd807aa98, 0x12835b01, 0x243185be, 0x550c7dc3, 0x72be5d74, 0x80deb1fe, 0x9bdc06a7, 0xc19bf174,
    0xe49b69c1, 0xefbe4786, 0x0fc19dc6, 0x240ca1cc, 0x2de92c6f, 0x4a7484aa, 0x5cb0a9dc, 0x76f988da,
    0x983e5152, 0xa831c66d, 0xb00327c8, 0xbf597fc7, 0xc6e00bf3, 0xd5a79147, 0x06ca6351, 0x14292967,
    0x27b70a85, 0x2e1b2138, 0x4d2c6dfc, 0x53380d13, 0x650a7354, 0x766a0abb, 0x81c2c92e, 0x92722c85,
    0xa2bfe8a1, 0xa81a664b, 0xc24b8b70, 0xc76c51a3, 0xd192e819, 0xd6990624, 0xf40e3585, 0x106aa070,
    0x19a4c116, 0x1e376c08, 0x2748774c, 0x34b0bcb5, 0x391c0cb3, 0x4ed8aa4a, 0x5b9cca4f, 0x682e6ff3,
    0x748f82ee, 0x78a5636f, 0x84c87814, 0x8cc70208, 0x90befffa, 0xa4506ceb, 0xbef9a3f7, 0xc67178f2};

static uint32_t rotate(uint32_t x, int by)
{
    return x >> by | x << (32 - by);
}

/* One round; word number `first` of v is the standard's a. */
static inline void add_round(uint32_t v[8], int first, uint32_t constant)
{
    uint32_t a = v[first & 7], b = v[(first + 1) & 7], c = v[(first + 2) & 7], e = v[(first + 4) & 7];
    uint32_t f = v[(first + 5) & 7], g = v[(first + 6) & 7];
    uint32_t t = v[(first + 7) & 7] + (rotate(e, 6) ^ rotate(e, 11) ^ rotate(e, 25)) + ((e & f) ^ (~e & g)) + constant;
    v[(first + 3) & 7] += t;
    v[(first + 7) & 7] = t + (rotate(a, 2) ^ rotate(a, 13) ^ rotate(a, 22)) + ((a & b) ^ (a & c) ^ (b & c));
}

static void add_block(struct tetlodi_sha256 *sha, const uint8_t block[64])
{
    uint32_t w[64], v[8];
    for (int i = 0; i < 16; i++)
        w[i] = (uint32_t)block[4 * i] << 24 | (uint32_t)block[4 * i + 1] << 16 | (uint32_t)block[4 * i + 2] << 8 |
               block[4 * i + 3];
    for (int i = 16; i < 64; i++) {
        uint32_t a = w[i - 15], b = w[i - 2];
        w[i] = w[i - 16] + w[i - 7] + (rotate(a, 7) ^ rotate(a, 18) ^ a >> 3) +
               (rotate(b, 17) ^ rotate(b, 19) ^ b >> 10);
    }
    memcpy(v, sha->state, sizeof v);
    for (int i = 0; i < 64; i += 8) { // eight rounds: each names the words one place further on instead of moving them
        add_round(v, 0, rounds[i] + w[i]);
        add_round(v, 7, rounds[i + 1] + w[i + 1]);
        add_round(v, 6, rounds[i + 2] + w[i + 2]);
        add_round(v, 5, rounds[i + 3] + w[i + 3]);
        add_round(v, 4, rounds[i + 4] + w[i + 4]);
        add_round(v, 3, rounds[i + 5] + w[i + 5]);
        add_round(v, 2, rounds[i + 6] + w[i + 6]);
        add_round(v, 1, rounds[i + 7] + w[i + 7]);
    }
    for (int i = 0; i < 8; i++)
        sha->state[i] += v[i];
}

void tetlodi_sha256_init(struct tetlodi_sha256 *sha)
{
    *sha = (struct tetlodi_sha256){{0x6a09e667, 0xbb67ae85, 0x3c6ef372, 0xa54ff53a, 0x510e527f, 0x9b05688c, 0x1f83d9ab,
                                    0x5be0cd19},
                                   0,
                                   {0}};
}

void tetlodi_sha256_add(struct tetlodi_sha256 *sha, const void *bytes, size_t size)
{
    const uint8_t *at = bytes;
    while (size) {
        size_t used = sha->size % 64, part = 64 - used < size ? 64 - used : size;
        if (part == 64)
            add_block(sha, at);
        else
            memcpy(sha->block + used, at, part);
        sha->size += part;
        at += part;
        size -= part;
        if (part < 64 && sha->size % 64 == 0)
            add_block(sha, sha->block);
    }
}

void tetlodi_sha256_finish(struct tetlodi_sha256 *sha, uint8_t out[32])
{
    uint64_t bits = sha->size * 8;
    uint8_t length[8];
    tetlodi_sha256_add(sha, "\x80", 1);
    while (sha->size % 64 != 56)
        tetlodi_sha256_add(sha, "", 1);
    for (int i = 0; i < 8; i++)
        length[i] = (uint8_t)(bits >> (56 - 8 * i));
    tetlodi_sha256_add(sha, length, 8);
    for (int i = 0; i < 32; i++)
        out[i] = (uint8_t)(sha->state[i / 4] >> (24 - 8 * (i % 4)));
}

void tetlodi_digest(const void *bytes, size_t size, uint8_t out[DIGEST_SIZE])
{
    struct tetlodi_sha256 sha;
    uint8_t digest[32];
    tetlodi_sha256_init(&sha);
    tetlodi_sha256_add(&sha, bytes, size);
    tetlodi_sha256_finish(&sha, digest);
    memcpy(out, digest, DIGEST_SIZE);
}
