/* SPDX-License-Identifier: BSD-3-Clause */
/* SPEC 6. The carry is propagated as in other byte-wise range coders (Martin 1979; Schindler 1998). */
#include "format/common/coder.h"

#include <string.h>

const uint8_t tetlodi_bit_shift[128] = {
    1, 2, 2, 3, 3, 3, 3, 4, 4, 4, 4, 4, 4, 4, 4, 5, 5, 5, 5, 5, 5, 5, 5, 5, 5, 5, 5, 5, 5, 5, 5, 6,
    6, 6, 6, 6, 6, 6, 6, 6, 6, 6, 6, 6, 6, 6, 6, 6, 6, 6, 6, 6, 6, 6, 6, 6, 6, 6, 6, 6, 6, 6, 6, 7,
    7, 7, 7, 7, 7, 7, 7, 7, 7, 7, 7, 7, 7, 7, 7, 7, 7, 7, 7, 7, 7, 7, 7, 7, 7, 7, 7, 7, 7, 7, 7, 7,
    7, 7, 7, 7, 7, 7, 7, 7, 7, 7, 7, 7, 7, 7, 7, 7, 7, 7, 7, 7, 7, 7, 7, 7, 7, 7, 7, 7, 7, 7, 7, 7,
};

void tetlodi_bits_init(struct tetlodi_bit *bits, size_t count)
{
    if (count)
        bits[0] = (struct tetlodi_bit){32768, 0};
    for (size_t done = 1; done < count; done *= 2) // each page begins with all models anew
        memcpy(bits + done, bits, (done < count - done ? done : count - done) * sizeof *bits);
}

void tetlodi_number_init(struct tetlodi_number *models)
{
    tetlodi_bits_init(models->length[0], NUMBER_CONTEXTS * 128);
    tetlodi_bits_init(&models->sign, 1);
    tetlodi_bits_init(models->top[0], 65 * 4);
}

void tetlodi_decode_start(struct tetlodi_coder *coder, unsigned slowest, const uint8_t *bytes, size_t size)
{
    *coder =
        (struct tetlodi_coder){.at = bytes, .end = bytes + size, .range = UINT32_MAX, .seen_most = (1u << slowest) - 2};
    for (int i = 0; i < 4; i++)
        coder->code = coder->code << 8 | (coder->at < coder->end ? *coder->at++ : 0u);
    coder->bad = coder->code == coder->range;
}

void tetlodi_encode_start(struct tetlodi_coder *coder, unsigned slowest, struct tetlodi_encoder *encoder,
                          struct tetlodi_memory *memory)
{
    *encoder = (struct tetlodi_encoder){.memory = memory, .bytes = encoder->bytes, .capacity = encoder->capacity};
    *coder = (struct tetlodi_coder){.encoder = encoder, .range = UINT32_MAX, .seen_most = (1u << slowest) - 2};
}

static void put(struct tetlodi_encoder *encoder, uint8_t byte)
{
    if (encoder->failed || !TETLODI_ROOM(encoder->memory, encoder->bytes, encoder->capacity, encoder->size + 1)) {
        encoder->failed = 1;
        return;
    }
    encoder->bytes[encoder->size++] = byte;
}

void tetlodi_encode_shift(struct tetlodi_encoder *encoder)
{
    uint8_t top = (uint8_t)(encoder->low >> 24);
    uint8_t carry = (uint8_t)(encoder->low >> 32);
    if (!encoder->pending) {
        encoder->first = top;
    } else if (top != 0xff || carry) {
        put(encoder, (uint8_t)(encoder->first + carry));
        while (--encoder->pending)
            put(encoder, (uint8_t)(0xff + carry));
        encoder->first = top;
    }
    encoder->pending++;
    encoder->low = (encoder->low & 0x00ffffff) << 8;
}

void tetlodi_encode_finish(struct tetlodi_coder *coder)
{
    struct tetlodi_encoder *encoder = coder->encoder;
    /* Of the numbers in [low, low + range) the one with most trailing zero bits. */
    uint64_t last = encoder->low + coder->range - 1;
    for (unsigned zeros = 33; zeros--;) {
        uint64_t value = last >> zeros << zeros;
        if (value >= encoder->low) {
            encoder->low = value;
            break;
        }
    }
    for (int i = 0; i < 5; i++)
        tetlodi_encode_shift(encoder);
    while (encoder->size && !encoder->bytes[encoder->size - 1])
        encoder->size--;
}
