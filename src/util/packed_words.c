/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * A number of 4 bytes: the difference modulo 2^32, its sign last, seven bits a byte, the lowest first; the highest bit
 * says that more follow.
 * One of 8 bytes: what is not alike in both, without the zero bytes around: a byte of how many bytes there are (high
 * four bits) and how many zero bytes are below them, then these. None: the low four bits are the number of such numbers
 * that follow each other, less one.
 */
#include "src/util/packed_words.h"

#include <string.h>

enum { MAX_RUN = 16, MAX_VARINT = 5 };

/* ---- numbers of 4 bytes */

static unsigned char *put_numbers(unsigned char *to, const uint32_t *numbers, size_t count, unsigned lag)
{
    for (size_t i = 0; i < count; i++) {
        uint32_t more = numbers[i] - (i >= lag ? numbers[i - lag] : 0);
        uint32_t rest = more << 1 ^ (0 - (more >> 31));
        for (; rest > 127; rest >>= 7)
            *to++ = (unsigned char)(rest | 128);
        *to++ = (unsigned char)rest;
    }
    return to;
}

static bool get_numbers(struct words_source *source, uint32_t *numbers, size_t count, unsigned lag)
{
    for (size_t i = 0; i < count; i++) {
        uint32_t rest = 0;
        unsigned char byte = 128;
        for (unsigned n = 0; byte & 128; n++) {
            if (!source->left || n == MAX_VARINT)
                return false;
            byte = *source->at++;
            source->left--;
            rest |= (uint32_t)(byte & 127) << 7 * n;
        }
        numbers[i] = (rest >> 1 ^ (0 - (rest & 1))) + (i >= lag ? numbers[i - lag] : 0);
    }
    return true;
}

/* ---- numbers of 8 bytes */

static uint64_t load(const unsigned char *at)
{
    uint64_t word;
    memcpy(&word, at, sizeof word);
    return word;
}

enum { WORD = sizeof(uint64_t) };

/* Of a word whose lowest byte comes first in memory, and back. */
static uint64_t lowest_first(uint64_t word)
{
    return __BYTE_ORDER__ == __ORDER_BIG_ENDIAN__ ? __builtin_bswap64(word) : word;
}

static void store(unsigned char *to, uint64_t word)
{
    word = lowest_first(word);
    memcpy(to, &word, WORD);
}

/* The lowest bytes of a word. */
static uint64_t lowest(uint64_t word, unsigned bytes)
{
    return bytes < WORD ? word & (((uint64_t)1 << 8 * bytes) - 1) : word;
}

/* The next bytes, up to WORD, of those that are left; zeros behind them. */
static uint64_t peek(const struct words_source *source)
{
    uint64_t word = 0;
    if (source->left >= WORD)
        return lowest_first(load(source->at));
    memcpy(&word, source->at, source->left);
    return lowest_first(word);
}

static uint64_t changed(const unsigned char *words, size_t i, unsigned lag)
{
    return load(words + 8 * i) ^ (i >= lag ? load(words + 8 * (i - lag)) : 0);
}

static unsigned char *put_doubles(unsigned char *to, const unsigned char *words, size_t count, unsigned lag)
{
    for (size_t i = 0; i < count;) {
        unsigned run = 0;
        while (run < MAX_RUN && i + run < count && !changed(words, i + run, lag))
            run++;
        if (run) {
            *to++ = (unsigned char)(run - 1);
            i += run;
            continue;
        }
        uint64_t word = changed(words, i++, lag);
        unsigned below = (unsigned)__builtin_ctzll(word) / 8, size = 8 - (unsigned)__builtin_clzll(word) / 8 - below;
        *to++ = (unsigned char)(size << 4 | below);
        store(to, word >> 8 * below);
        to += size;
    }
    return to;
}

static bool get_doubles(struct words_source *source, unsigned char *words, size_t count, unsigned lag)
{
    for (size_t i = 0; i < count;) {
        unsigned head = source->left ? *source->at : 0, size = head >> 4, below = head & 15, run = size ? 1 : below + 1;
        if (source->left <= size || run > count - i || (size && size + below > WORD))
            return false;
        source->at++;
        source->left--;
        uint64_t word = size ? lowest(peek(source), size) << 8 * below : 0;
        source->at += size;
        source->left -= size;
        for (; run; run--, i++) {
            uint64_t is = word ^ (i >= lag ? load(words + 8 * (i - lag)) : 0);
            memcpy(words + 8 * i, &is, sizeof is);
        }
    }
    return true;
}

/* ---- all of them */

bool words_put(struct buffer *out, const void *words, size_t count, unsigned width, unsigned lag)
{
    size_t before = out->size;
    if (!count)
        return true;
    unsigned char *to = buffer_extend(out, count * (width + 1) + WORD); // no number takes more, and one is stored whole
    if (!to)
        return false;
    unsigned char *end = to + count;
    if (width == 1)
        memcpy(to, words, count);
    else
        end = width == 4 ? put_numbers(to, words, count, lag) : put_doubles(to, words, count, lag);
    out->size = before + (size_t)(end - to);
    return true;
}

bool words_fit(size_t count, unsigned width, size_t bytes)
{
    return count <= (width == 8 ? bytes * (size_t)MAX_RUN : bytes);
}

bool words_get(struct words_source *source, void *words, size_t count, unsigned width, unsigned lag)
{
    if (width == 4)
        return get_numbers(source, words, count, lag);
    if (width == 8)
        return get_doubles(source, words, count, lag);
    if (count > source->left)
        return false;
    if (count)
        memcpy(words, source->at, count);
    source->at += count;
    source->left -= count;
    return true;
}
