/* SPDX-License-Identifier: BSD-3-Clause */
/* SPEC 6. The carry is propagated as in other byte-wise range coders (Martin 1979; Schindler 1998). */
#include "format/coder.h"

const uint8_t tetlodi_bit_shift[128] = {
    1, 2, 2, 3, 3, 3, 3, 4, 4, 4, 4, 4, 4, 4, 4, 5, 5, 5, 5, 5, 5, 5, 5, 5, 5, 5, 5, 5, 5, 5, 5, 6,
    6, 6, 6, 6, 6, 6, 6, 6, 6, 6, 6, 6, 6, 6, 6, 6, 6, 6, 6, 6, 6, 6, 6, 6, 6, 6, 6, 6, 6, 6, 6, 7,
    7, 7, 7, 7, 7, 7, 7, 7, 7, 7, 7, 7, 7, 7, 7, 7, 7, 7, 7, 7, 7, 7, 7, 7, 7, 7, 7, 7, 7, 7, 7, 7,
    7, 7, 7, 7, 7, 7, 7, 7, 7, 7, 7, 7, 7, 7, 7, 7, 7, 7, 7, 7, 7, 7, 7, 7, 7, 7, 7, 7, 7, 7, 7, 7,
};

void tetlodi_bits_init(struct tetlodi_bit *bits, size_t count)
{
    for (size_t i = 0; i < count; i++)
        bits[i] = (struct tetlodi_bit){32768, 0};
}

void tetlodi_number_init(struct tetlodi_number *models)
{
    tetlodi_bits_init(models->length[0], NUMBER_CONTEXTS * 128);
    tetlodi_bits_init(&models->sign, 1);
    tetlodi_bits_init(models->top[0], 65 * 4);
}

void tetlodi_decode_start(struct tetlodi_coder *coder, unsigned slowest, const uint8_t *bytes, size_t size)
{
    *coder = (struct tetlodi_coder){.range = UINT32_MAX, .at = bytes, .end = bytes + size,
                                    .seen_most = (1u << slowest) - 2};
    for (int i = 0; i < 4; i++)
        coder->code = coder->code << 8 | (coder->at < coder->end ? *coder->at++ : 0u);
}

void tetlodi_encode_start(struct tetlodi_coder *coder, unsigned slowest, struct tetlodi_memory *memory)
{
    *coder = (struct tetlodi_coder){.encoding = 1, .range = UINT32_MAX, .memory = memory, .bytes = coder->bytes,
                                    .seen_most = (1u << slowest) - 2, .capacity = coder->capacity};
}

static void put(struct tetlodi_coder *coder, uint8_t byte)
{
    if (coder->failed || !TETLODI_ROOM(coder->memory, coder->bytes, coder->capacity, coder->size + 1)) {
        coder->failed = 1;
        return;
    }
    coder->bytes[coder->size++] = byte;
}

void tetlodi_encode_shift(struct tetlodi_coder *coder)
{
    uint8_t top = (uint8_t)(coder->low >> 24);
    uint8_t carry = (uint8_t)(coder->low >> 32);
    if (!coder->pending) {
        coder->first = top;
    } else if (top != 0xff || carry) {
        put(coder, (uint8_t)(coder->first + carry));
        while (--coder->pending)
            put(coder, (uint8_t)(0xff + carry));
        coder->first = top;
    }
    coder->pending++;
    coder->low = (coder->low & 0x00ffffff) << 8;
}

void tetlodi_encode_finish(struct tetlodi_coder *coder)
{
    /* Of the numbers in [low, low + range) the one with most trailing zero bits. */
    uint64_t last = coder->low + coder->range - 1;
    for (unsigned zeros = 32; zeros--;) {
        uint64_t value = last >> zeros << zeros;
        if (value >= coder->low) {
            coder->low = value;
            break;
        }
    }
    for (int i = 0; i < 5; i++)
        tetlodi_encode_shift(coder);
    while (coder->size && !coder->bytes[coder->size - 1])
        coder->size--;
}
