/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * An adaptive binary range coder (SPEC.md, entropy coding; after Martin 1979, with the carry handling usual since). One
 * interface codes both ways: an encoder takes the value it is given, a decoder ignores it, both return the value coded. So the
 * model is written once and cannot differ between the two.
 */
#ifndef TETLOD_CODER_H
#define TETLOD_CODER_H

#include "format/bytes.h"

/* Probability of a 0 in 1/4096, and how often it was used: the first uses adapt faster. */
struct tetlodi_bit {
    uint16_t zero, uses;
};

#define TETLODI_BIT_NEW ((struct tetlodi_bit){2048, 0})

/* A number by the length of its binary form, its next two bits, and the rest as they are. */
struct tetlodi_number {
    struct tetlodi_bit length[128], top[65][4];
};

struct tetlodi_coder {
    bool encodes;
    uint32_t range;
    uint32_t code;                /* decoder */
    struct tetlodi_bytes in;      /* decoder; reading past its end sets in.failed */
    uint64_t low;                 /* encoder */
    uint64_t pending;             /* encoder: bytes that a carry may still change */
    uint8_t cache;
    struct tetlodi_buffer *out;   /* encoder */
};

void tetlodi_encoder_init(struct tetlodi_coder *coder, struct tetlodi_buffer *out);
void tetlodi_encoder_finish(struct tetlodi_coder *coder);
void tetlodi_decoder_init(struct tetlodi_coder *coder, const void *bytes, size_t size);

unsigned tetlodi_code_bit(struct tetlodi_coder *coder, struct tetlodi_bit *model, unsigned bit);
uint64_t tetlodi_code_raw(struct tetlodi_coder *coder, uint64_t value, unsigned bits); /* bits <= 64 */
uint64_t tetlodi_code_number(struct tetlodi_coder *coder, struct tetlodi_number *model, uint64_t value);

void tetlodi_number_init(struct tetlodi_number *model);

#endif
