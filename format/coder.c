/* SPDX-License-Identifier: BSD-3-Clause */
#include "format/coder.h"

enum { PROBABILITY_BITS = 12, SLOWEST = 6, TOP = 1 << 24 };

void tetlodi_encoder_init(struct tetlodi_coder *coder, struct tetlodi_buffer *out)
{
    *coder = (struct tetlodi_coder){.encodes = true, .range = UINT32_MAX, .out = out, .pending = 1};
}

static void shift_low(struct tetlodi_coder *coder)
{
    if (coder->low < 0xff000000u || coder->low >> 32) {
        uint8_t carry = (uint8_t)(coder->low >> 32);
        for (; coder->pending; coder->pending--) {
            tetlodi_put(coder->out, (uint8_t)(coder->cache + carry), 1);
            coder->cache = 0xff;
        }
        coder->cache = (uint8_t)(coder->low >> 24);
    }
    coder->pending++;
    coder->low = (coder->low & 0x00ffffffu) << 8;
}

void tetlodi_encoder_finish(struct tetlodi_coder *coder)
{
    for (int i = 0; i < 5; i++)
        shift_low(coder);
}

void tetlodi_decoder_init(struct tetlodi_coder *coder, const void *bytes, size_t size)
{
    *coder = (struct tetlodi_coder){.range = UINT32_MAX, .in = {bytes, size, false}};
    for (int i = 0; i < 5; i++)
        coder->code = coder->code << 8 | (uint32_t)tetlodi_get(&coder->in, 1);
}

static inline void normalise(struct tetlodi_coder *coder)
{
    while (coder->range < TOP) {
        coder->range <<= 8;
        if (coder->encodes)
            shift_low(coder);
        else {
            struct tetlodi_bytes *in = &coder->in;
            coder->code <<= 8;
            if (in->left) {
                coder->code |= *in->at++;
                in->left--;
            } else
                in->failed = true;
        }
    }
}

/* Takes the lower `bound` of the range for a 0, the rest for a 1. */
static inline unsigned narrow(struct tetlodi_coder *coder, uint32_t bound, unsigned bit)
{
    if (!coder->encodes)
        bit = coder->code >= bound;
    if (bit) {
        coder->low += coder->encodes ? bound : 0;
        coder->code -= coder->encodes ? 0 : bound;
        coder->range -= bound;
    } else
        coder->range = bound;
    normalise(coder);
    return bit;
}

unsigned tetlodi_code_bit(struct tetlodi_coder *coder, struct tetlodi_bit *model, unsigned bit)
{
    bit = narrow(coder, (coder->range >> PROBABILITY_BITS) * model->zero, bit);
    unsigned speed = 2 + model->uses / 4;
    if (speed > SLOWEST)
        speed = SLOWEST;
    else
        model->uses++;
    if (bit)
        model->zero = (uint16_t)(model->zero - (model->zero >> speed));
    else
        model->zero = (uint16_t)(model->zero + ((4096 - model->zero) >> speed));
    if (model->zero < 32)
        model->zero = 32;
    if (model->zero > 4096 - 32)
        model->zero = 4096 - 32;
    return bit;
}

uint64_t tetlodi_code_raw(struct tetlodi_coder *coder, uint64_t value, unsigned bits)
{
    uint64_t result = 0;
    while (bits--)
        result = result << 1 | narrow(coder, coder->range >> 1, value >> bits & 1);
    return result;
}

static unsigned bit_length(uint64_t value)
{
    unsigned length = 0;
    for (; value; value >>= 1)
        length++;
    return length;
}

uint64_t tetlodi_code_number(struct tetlodi_coder *coder, struct tetlodi_number *model, uint64_t value)
{
    unsigned wanted = bit_length(value), node = 1;
    for (int i = 6; i >= 0; i--)
        node = node << 1 | tetlodi_code_bit(coder, &model->length[node], wanted >> i & 1);
    unsigned length = node & 127;
    if (length > 64) {
        coder->in.failed = true;
        return 0;
    }
    if (length < 2)
        return length;
    uint64_t result = 1;
    unsigned left = length - 1;
    for (unsigned i = 0, top = 1; i < 2 && left; i++) {
        left--;
        unsigned bit = tetlodi_code_bit(coder, &model->top[length][top], value >> left & 1);
        top = top << 1 | bit;
        result = result << 1 | bit;
    }
    uint64_t rest = tetlodi_code_raw(coder, left ? value & (((uint64_t)1 << left) - 1) : 0, left);
    return result << left | rest;
}

void tetlodi_number_init(struct tetlodi_number *model)
{
    for (int i = 0; i < 128; i++)
        model->length[i] = TETLODI_BIT_NEW;
    for (int i = 0; i < 65; i++)
        for (int k = 0; k < 4; k++)
            model->top[i][k] = TETLODI_BIT_NEW;
}
