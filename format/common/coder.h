/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * The adaptive binary range coder (SPEC 6). One set of functions codes in both directions: an encoder takes the value
 * and returns it, a decoder ignores the argument and returns what the frame says. What is coded is thus written once. A
 * frame's trailing zero bytes are not stored: a decoder reads zeros beyond its end. Not installed.
 */
#ifndef TETLOD_CODER_H
#define TETLOD_CODER_H

#include <string.h>

#include "format/common/memory.h"

/* Loops that code much have the coder in a local variable and are compiled once for each direction, so that a decoder's
 * is in registers: no call takes the address of a coder that decodes. */
#define TETLODI_INLINE static inline __attribute__((always_inline))

/* tests/bench counts what is spent on what: a bit under a model that had a chance of so many 65536ths, or plain
 * bits. */
#ifndef TETLODI_COUNT
#define TETLODI_COUNT(model, chance, plain) ((void)0)
#endif

/* Bits needed to write a number: 0 for 0, 64 for the largest. */
static inline unsigned bit_length(uint64_t value)
{
    return value ? 64 - (unsigned)__builtin_clzll(value) : 0;
}

/* The probability that the next bit is 0, in 1/65536, and how many bits it has seen (up to a limit). */
struct tetlodi_bit {
    uint16_t p, seen;
};

/* What an encoder has besides. */
struct tetlodi_encoder {
    uint64_t low;
    uint64_t pending; /* bytes of 0xff, and the one before them, that a carry may still change */
    uint8_t first;    /* that one */
    struct tetlodi_memory *memory;
    uint8_t *bytes; /* owned */
    size_t size, capacity;
    int failed; /* out of memory */
};

struct tetlodi_coder {
    struct tetlodi_encoder *encoder; /* borrowed; NULL in a decoder */
    const uint8_t *at, *end;         /* decoder: borrowed */
    uint32_t range, code;
    unsigned seen_most; /* bits after which a model learns no slower */
    int bad;            /* the frame holds what no encoder writes */
};

/* What a coder encodes with, or NULL. Programs that only decode are made with TETLODI_DECODES_ONLY: they do without
 * what encodes. */
TETLODI_INLINE struct tetlodi_encoder *encoder_of(const struct tetlodi_coder *coder)
{
#ifdef TETLODI_DECODES_ONLY
    (void)coder;
    return NULL;
#else
    return coder->encoder;
#endif
}

/* Sets `count` models to even odds. */
void tetlodi_bits_init(struct tetlodi_bit *bits, size_t count);

/* `slowest` 5..7: the least step of learning is 1/2^slowest. Whoever decodes looks at `bad` in the end. */
void tetlodi_decode_start(struct tetlodi_coder *coder, unsigned slowest, const uint8_t *bytes, size_t size);
void tetlodi_encode_start(struct tetlodi_coder *coder, unsigned slowest, struct tetlodi_encoder *encoder,
                          struct tetlodi_memory *memory);      /* the encoder keeps its buffer */
void tetlodi_encode_finish(struct tetlodi_coder *coder);       /* the encoder's bytes, size are the frame */
void tetlodi_encode_shift(struct tetlodi_encoder *encoder);    /* gives out the top byte */

/* The step of adaptation: 1/2, 1/4, ... down to 1/128, by how many bits were seen. */
extern const uint8_t tetlodi_bit_shift[128];

TETLODI_INLINE void coder_refill(struct tetlodi_coder *coder)
{
    while (__builtin_expect(coder->range < 1u << 24, 0)) {
        coder->range <<= 8;
        if (encoder_of(coder))
            tetlodi_encode_shift(coder->encoder);
        else
            coder->code = coder->code << 8 | (coder->at < coder->end ? *coder->at++ : 0u);
    }
}

TETLODI_INLINE int code_bit(struct tetlodi_coder *coder, struct tetlodi_bit *model, int bit)
{
    unsigned p = model->p, seen = model->seen, shift = tetlodi_bit_shift[seen];
    uint32_t bound = (coder->range >> 12) * (uint32_t)(p >> 4);
    if (!encoder_of(coder))
        bit = coder->code >= bound;
    TETLODI_COUNT(model, bit ? 65536u - p : p, 0);
    model->seen = (uint16_t)(seen + (seen < coder->seen_most));
    if (bit) { // one branch for all that a bit decides: a right guess lets the next bit begin early
        if (encoder_of(coder))
            coder->encoder->low += bound;
        else
            coder->code -= bound;
        coder->range -= bound;
        model->p = (uint16_t)(p - (p >> shift));
    } else {
        coder->range = bound;
        model->p = (uint16_t)(p + ((65536u - p) >> shift));
    }
    coder_refill(coder);
    return bit;
}

/* `count` <= 16 bits without a model. */
TETLODI_INLINE uint32_t code_plain(struct tetlodi_coder *coder, unsigned count, uint32_t value)
{
    TETLODI_COUNT(NULL, 0, count);
    coder->range >>= count;
    if (encoder_of(coder)) {
        coder->encoder->low += (uint64_t)coder->range * value;
    } else {
        value = coder->code / coder->range;
        coder->code -= coder->range * value;
        coder->bad |= (int)(value >> count); // no encoder writes that
        value &= (1u << count) - 1;
    }
    coder_refill(coder);
    return value;
}

/* A number of `depth` bits, most significant first, each under a model chosen by those before it: 2^depth models. */
TETLODI_INLINE unsigned code_tree(struct tetlodi_coder *coder, struct tetlodi_bit *models, unsigned depth,
                                  unsigned value)
{
    unsigned node = 1;
    for (unsigned i = depth; i--;)
        node = node << 1 | (unsigned)code_bit(coder, &models[node], value >> i & 1);
    return node - (1u << depth);
}

/* A number of which the length in bits is known, at least 1: two bits below the first under models, the rest
 * without. */
TETLODI_INLINE uint64_t code_below(struct tetlodi_coder *coder, struct tetlodi_bit models[4], unsigned length,
                                   uint64_t value)
{
    unsigned left = length - 1, top = left < 2 ? left : 2;
    uint64_t bits = 1;
    if (top) {
        left -= top;
        bits = bits << top | code_tree(coder, models, top, (unsigned)(value >> left) & ((1u << top) - 1));
    }
    while (left) {
        unsigned some = left < 16 ? left : 16;
        left -= some;
        bits = bits << some | code_plain(coder, some, (uint32_t)(value >> left) & ((1u << some) - 1));
    }
    return bits;
}

/* Models of a signed number (SPEC 6.3): its length in bits under one of 66 contexts, its sign, two bits below the
 * first. */
enum { NUMBER_CONTEXTS = 66 };
struct tetlodi_number {
    struct tetlodi_bit length[NUMBER_CONTEXTS][128], sign, top[65][4];
};

void tetlodi_number_init(struct tetlodi_number *models);

TETLODI_INLINE int64_t code_number(struct tetlodi_coder *coder, struct tetlodi_number *models, unsigned context,
                                  int64_t value)
{
    uint64_t magnitude = value < 0 ? 0 - (uint64_t)value : (uint64_t)value;
    unsigned length = code_tree(coder, models->length[context], 7, bit_length(magnitude));
    if (length > 64) {
        coder->bad = 1;
        return 0;
    }
    if (!length)
        return 0;
    int negative = code_bit(coder, &models->sign, value < 0);
    uint64_t bits = code_below(coder, models->top[length], length, magnitude);
    return (int64_t)(negative ? 0 - bits : bits);
}

#endif
