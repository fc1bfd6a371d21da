/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * Binary data of an array: words (UInt32 or UInt64) and then the values. Uncompressed, one word: the bytes that follow.
 * Compressed: the number of blocks, the size of a whole block, the size of the last one if it is a partial one (else 0),
 * the compressed size of each block, then the blocks. As base64, header and values may be encoded apart or together.
 */
#include <limits.h>
#include <lz4.h>
#include <stdlib.h>
#include <string.h>
#include <zlib.h>

#include "format/fail.h"
#include "src/io/vtu_document.h"
#include "src/util/array.h"

/* Bytes, raw or out of base64 text. */
struct source {
    const unsigned char *at, *end;
    bool base64, big_endian;
    unsigned char held[3]; /* decoded and not yet taken */
    unsigned held_count;
};

static int base64_digit(unsigned char c)
{
    if (c >= 'A' && c <= 'Z')
        return c - 'A';
    if (c >= 'a' && c <= 'z')
        return c - 'a' + 26;
    if (c >= '0' && c <= '9')
        return c - '0' + 52;
    return c == '+' ? 62 : c == '/' ? 63 : -1;
}

/* The next four digits, of which up to two may be padding, into `held`. */
static bool hold_quad(struct source *s)
{
    uint32_t word = 0;
    unsigned digits = 0, padding = 0;
    while (digits + padding < 4) {
        if (s->at == s->end)
            return false;
        unsigned char c = *s->at++;
        int digit = base64_digit(c);
        if (c == ' ' || (c >= '\t' && c <= '\r'))
            continue;
        if (c == '=' && digits >= 2)
            padding++;
        else if (digit < 0 || padding)
            return false;
        else
            digits++;
        word = word << 6 | (digit < 0 ? 0 : (uint32_t)digit);
    }
    s->held_count = 3 - padding;
    for (unsigned b = 0; b < s->held_count; b++)
        s->held[b] = (unsigned char)(word >> (16 - 8 * b));
    return true;
}

static bool take(struct source *s, unsigned char *out, size_t size)
{
    if (!s->base64) {
        if ((size_t)(s->end - s->at) < size)
            return false;
        memcpy(out, s->at, size);
        s->at += size;
        return true;
    }
    for (size_t i = 0; i < size; i++) {
        if (s->held_count == 0 && !hold_quad(s))
            return false;
        out[i] = s->held[0];
        s->held[0] = s->held[1];
        s->held[1] = s->held[2];
        s->held_count--;
    }
    return true;
}

/* How many bytes the source can still give at most. */
static uint64_t most_left(const struct source *s)
{
    uint64_t left = (uint64_t)(s->end - s->at);
    return s->base64 ? left / 4 * 3 + s->held_count : left;
}

static bool take_word(struct source *s, size_t header_size, uint64_t *out)
{
    unsigned char bytes[8];
    int64_t value;
    if (!take(s, bytes, header_size))
        return false;
    values_to_ints(bytes, header_size == 8 ? VALUE_UINT64 : VALUE_UINT32, s->big_endian, 1, &value);
    *out = (uint64_t)value;
    return true;
}

static struct source source_of(const struct vtu_document *document, const struct vtu_array *array)
{
    struct source s = {.big_endian = document->big_endian};
    if (array->format != VTU_APPENDED) {
        s.base64 = true;
        s.at = document->bytes + array->begin;
        s.end = document->bytes + array->end;
        return s;
    }
    uint64_t left = document->size - document->appended;
    s.base64 = !document->appended_raw;
    s.at = document->bytes + document->appended + (size_t)(array->offset < left ? array->offset : left);
    s.end = document->bytes + document->size;
    return s;
}

static enum tetlod_status fail_array(struct tetlod_error *error, const struct vtu_array *array, const char *why)
{
    return tetlodi_fail(error, TETLOD_ERR_MESH, "array '%.60s' (line %llu): %s", array->name,
                        (unsigned long long)array->line, why);
}

static enum tetlod_status fail_short(struct tetlod_error *error, const struct vtu_array *array, uint64_t count)
{
    return tetlodi_fail(error, TETLOD_ERR_MESH,
                        "array '%.60s' (line %llu): its data ends too early for %llu values; is the file truncated?",
                        array->name, (unsigned long long)array->line, (unsigned long long)count);
}

enum tetlod_status vtu_check_count(const struct vtu_document *document, const struct vtu_array *array, uint64_t count,
                                   struct tetlod_error *error)
{
    enum { MOST_RATIO = 1100 }; // deflate reaches 1032, lz4 255
    uint64_t most;
    if (array->format == VTU_ASCII)
        most = (array->end - array->begin + 1) / 2;
    else {
        struct source s = source_of(document, array);
        most = most_left(&s) * (document->compressor == VTU_UNCOMPRESSED ? 1 : MOST_RATIO) / value_size(array->type);
    }
    return count <= most ? TETLOD_OK : fail_short(error, array, count);
}

static enum tetlod_status inflate_block(enum vtu_compressor compressor, const unsigned char *block, size_t size,
                                        unsigned char *out, size_t out_size, const struct vtu_array *array,
                                        struct tetlod_error *error)
{
    bool good;
    if (compressor == VTU_ZLIB) {
        uLongf got = (uLongf)out_size;
        int result = uncompress(out, &got, block, (uLong)size);
        if (result == Z_MEM_ERROR)
            return tetlodi_fail_nomem(error, array->name, size);
        good = result == Z_OK && got == out_size;
    } else
        good = size <= INT_MAX && out_size <= INT_MAX &&
               LZ4_decompress_safe((const char *)block, (char *)out, (int)size, (int)out_size) == (int)out_size;
    return good ? TETLOD_OK : fail_array(error, array, "a compressed block is damaged");
}

struct blocks {
    uint64_t count, size, last;
    uint64_t *compressed; /* owned */
    uint64_t largest;
};

static enum tetlod_status read_block_header(struct source *s, size_t header_size, const struct vtu_array *array,
                                            uint64_t needed, struct blocks *out, struct tetlod_error *error)
{
    *out = (struct blocks){0};
    if (!take_word(s, header_size, &out->count) || !take_word(s, header_size, &out->size) ||
        !take_word(s, header_size, &out->last) || out->count > most_left(s) / header_size)
        return fail_short(error, array, needed / value_size(array->type));
    uint64_t whole = out->count - (out->last && out->count ? 1 : 0);
    if (out->count == 0 || out->last > needed || (whole && (out->size == 0 || whole > needed / out->size)) ||
        whole * out->size + out->last != needed)
        return fail_array(error, array, "it holds another number of values than the counts of its piece say");
    out->compressed = array_new(out->count, sizeof *out->compressed);
    if (!out->compressed)
        return tetlodi_fail_nomem(error, array->name, out->count * sizeof *out->compressed);
    for (uint64_t b = 0; b < out->count; b++) {
        if (!take_word(s, header_size, &out->compressed[b]) || out->compressed[b] > most_left(s))
            return fail_short(error, array, needed / value_size(array->type));
        out->largest = out->compressed[b] > out->largest ? out->compressed[b] : out->largest;
    }
    return TETLOD_OK;
}

static enum tetlod_status read_compressed(const struct vtu_document *document, const struct vtu_array *array,
                                          struct source *s, unsigned char *out, uint64_t needed,
                                          struct tetlod_error *error)
{
    struct blocks blocks;
    unsigned char *block = NULL;
    enum tetlod_status status = read_block_header(s, document->header_size, array, needed, &blocks, error);
    if (status != TETLOD_OK)
        goto done;
    block = array_new(blocks.largest, 1);
    if (!block) {
        status = tetlodi_fail_nomem(error, array->name, blocks.largest);
        goto done;
    }
    for (uint64_t b = 0; b < blocks.count; b++) {
        uint64_t size = b + 1 == blocks.count && blocks.last ? blocks.last : blocks.size;
        if (!take(s, block, blocks.compressed[b])) {
            status = fail_short(error, array, needed / value_size(array->type));
            goto done;
        }
        TETLOD_TRY_DONE(inflate_block(document->compressor, block, blocks.compressed[b], out, size, array, error));
        out += size;
    }
done:
    free(block);
    free(blocks.compressed);
    return status;
}

/* The values' bytes as they are in the file, into a block that the caller frees. */
static enum tetlod_status read_bytes(const struct vtu_document *document, const struct vtu_array *array, size_t count,
                                     unsigned char **out, struct tetlod_error *error)
{
    uint64_t needed = (uint64_t)count * value_size(array->type), stored;
    struct source s = source_of(document, array);
    *out = array_new(count, value_size(array->type));
    if (!*out)
        return tetlodi_fail_nomem(error, array->name, needed);
    if (document->compressor != VTU_UNCOMPRESSED)
        return read_compressed(document, array, &s, *out, needed, error);
    if (!take_word(&s, document->header_size, &stored))
        return fail_short(error, array, count);
    if (stored != needed)
        return fail_array(error, array, "it holds another number of values than the counts of its piece say");
    return take(&s, *out, needed) ? TETLOD_OK : fail_short(error, array, count);
}

static struct text text_of(const struct vtu_document *document, const struct vtu_array *array)
{
    const char *bytes = (const char *)document->bytes;
    return (struct text){bytes + array->begin, bytes + array->end};
}

static enum tetlod_status fail_ascii(struct tetlod_error *error, const struct vtu_array *array, struct text rest,
                                     size_t index, size_t count)
{
    if (rest.at == rest.end)
        return fail_short(error, array, count);
    return tetlodi_fail(error, TETLOD_ERR_MESH, "array '%.60s' (line %llu): value %zu is not a number", array->name,
                        (unsigned long long)array->line, index);
}

static enum tetlod_status check_end(struct text rest, const struct vtu_array *array, struct tetlod_error *error)
{
    struct text word = text_word(&rest);
    return word.at == word.end ? TETLOD_OK
                               : fail_array(error, array, "it holds more values than the counts of its piece say");
}

enum tetlod_status vtu_doubles(const struct vtu_document *document, const struct vtu_array *array, size_t count,
                               double *out, struct tetlod_error *error)
{
    if (count == 0)
        return TETLOD_OK; // pieces without points may leave out even the header
    if (array->format == VTU_ASCII) {
        struct text text = text_of(document, array);
        for (size_t i = 0; i < count; i++)
            if (!text_double(&text, array->type == VALUE_FLOAT32, &out[i]))
                return fail_ascii(error, array, text, i, count);
        return check_end(text, array, error);
    }
    unsigned char *bytes;
    enum tetlod_status status = read_bytes(document, array, count, &bytes, error);
    if (status == TETLOD_OK)
        values_to_doubles(bytes, array->type, document->big_endian, count, out);
    free(bytes);
    return status;
}

enum tetlod_status vtu_ints(const struct vtu_document *document, const struct vtu_array *array, size_t count,
                            int64_t *out, struct tetlod_error *error)
{
    if (count == 0)
        return TETLOD_OK;
    if (value_is_float(array->type))
        return fail_array(error, array, "it should hold integers");
    if (array->format == VTU_ASCII) {
        struct text text = text_of(document, array);
        for (size_t i = 0; i < count; i++)
            if (!text_int(&text, &out[i]))
                return fail_ascii(error, array, text, i, count);
        return check_end(text, array, error);
    }
    unsigned char *bytes;
    enum tetlod_status status = read_bytes(document, array, count, &bytes, error);
    if (status == TETLOD_OK)
        values_to_ints(bytes, array->type, document->big_endian, count, out);
    free(bytes);
    return status;
}
