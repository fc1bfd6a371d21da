/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * Binary data of an array: words (UInt32 or UInt64) and then the values. Uncompressed, one word: the bytes that follow.
 * Compressed: the number of blocks, the size of a whole block, the size of the last one if it is a partial one (else 0),
 * the compressed size of each block, then the blocks. As base64, header and values may be encoded apart or together.
 */
#include <limits.h>
#include <stdatomic.h>
#include <lz4.h>
#include <lzma.h>
#include <stdlib.h>
#include <string.h>
#include <zlib.h>

#include "format/fail.h"
#include "src/io/vtkxml_document.h"
#include "src/util/array.h"
#include "src/util/parallel.h"

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

static struct source source_of(const struct vtkxml_document *document, const struct vtkxml_array *array)
{
    struct source s = {.big_endian = document->big_endian};
    if (array->format != VTKXML_APPENDED) {
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

static enum tetlod_status fail_array(struct tetlod_error *error, const struct vtkxml_array *array, const char *why)
{
    return tetlodi_fail(error, TETLOD_ERR_MESH, "array '%.60s' (line %llu): %s", array->name,
                        (unsigned long long)array->line, why);
}

static enum tetlod_status fail_short(struct tetlod_error *error, const struct vtkxml_array *array, uint64_t count)
{
    return tetlodi_fail(error, TETLOD_ERR_MESH,
                        "array '%.60s' (line %llu): its data ends too early for %llu values; is the file truncated?",
                        array->name, (unsigned long long)array->line, (unsigned long long)count);
}

enum tetlod_status vtkxml_check_count(const struct vtkxml_document *document, const struct vtkxml_array *array, uint64_t count,
                                   struct tetlod_error *error)
{
    static const unsigned ratios[] = {1, 1100, 300, 20000}; // deflate reaches 1032, lz4 255, lzma 7000
    uint64_t most;
    if (array->format == VTKXML_ASCII)
        most = (array->end - array->begin + 1) / 2;
    else {
        struct source s = source_of(document, array);
        most = most_left(&s) / value_size(array->type);
        if (document->compressor != VTKXML_UNCOMPRESSED)
            most = (most + 1) * ratios[document->compressor];
    }
    return count <= most ? TETLOD_OK : fail_short(error, array, count);
}

enum { BLOCK_DAMAGED = 1, BLOCK_NOMEM };

static int inflate_block(enum vtkxml_compressor compressor, const unsigned char *block, size_t size, unsigned char *out,
                         size_t out_size)
{
    bool good;
    if (compressor == VTKXML_ZLIB) {
        uLongf got = (uLongf)out_size;
        int result = uncompress(out, &got, block, (uLong)size);
        if (result == Z_MEM_ERROR)
            return BLOCK_NOMEM;
        good = result == Z_OK && got == out_size;
    } else if (compressor == VTKXML_LZMA) {
        uint64_t limit = (uint64_t)256 << 20; // dictionaries of the highest level take 64 MB
        size_t read = 0, written = 0;
        lzma_ret result = lzma_stream_buffer_decode(&limit, 0, NULL, block, &read, size, out, &written, out_size);
        if (result == LZMA_MEM_ERROR)
            return BLOCK_NOMEM;
        good = result == LZMA_OK && written == out_size;
    } else
        good = size <= INT_MAX && out_size <= INT_MAX &&
               LZ4_decompress_safe((const char *)block, (char *)out, (int)size, (int)out_size) == (int)out_size;
    return good ? 0 : BLOCK_DAMAGED;
}

/* ---- conversion */

/* Where values go. */
struct target {
    enum vtkxml_result result;
    void *out;
    enum value_type type;
    bool big_endian;
};

static void convert(const struct target *target, const unsigned char *bytes, size_t first, size_t count)
{
    switch (target->result) {
    case VTKXML_DOUBLES:
        values_to_doubles(bytes, target->type, target->big_endian, count, (double *)target->out + first);
        break;
    case VTKXML_INTS:
        values_to_ints(bytes, target->type, target->big_endian, count, (int64_t *)target->out + first);
        break;
    case VTKXML_NUMBERS:
        values_to_points(bytes, target->type, target->big_endian, count, (uint32_t *)target->out + first);
        break;
    case VTKXML_BYTES:
        values_to_bytes(bytes, target->type, target->big_endian, count, (uint8_t *)target->out + first);
        break;
    }
}

struct plain_job {
    const struct target *target;
    const unsigned char *bytes;
};

static void convert_range(void *context, unsigned worker, size_t begin, size_t end)
{
    const struct plain_job *job = context;
    (void)worker;
    convert(job->target, job->bytes + begin * value_size(job->target->type), begin, end - begin);
}

static void convert_all(const struct target *target, const unsigned char *bytes, size_t count)
{
    enum { CHUNK = 1 << 20 };
    struct plain_job job = {target, bytes};
    parallel_for(count > CHUNK ? parallel_cores() : 1, count, CHUNK, convert_range, &job);
}

/* ---- compressed data */

struct compressed {
    uint64_t count, size, last;
    uint64_t *compressed; /* owned: sizes */
    uint64_t total;       /* of them */
};

static enum tetlod_status read_block_header(struct source *s, size_t header_size, const struct vtkxml_array *array,
                                            uint64_t needed, struct compressed *out, struct tetlod_error *error)
{
    *out = (struct compressed){0};
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
        if (!take_word(s, header_size, &out->compressed[b]) || out->compressed[b] > most_left(s) - out->total)
            return fail_short(error, array, needed / value_size(array->type));
        out->total += out->compressed[b];
    }
    return TETLOD_OK;
}

/* Blocks that are decompressed and converted one by one, each thread in a buffer of its own. */
struct inflate_job {
    const struct target *target;
    const struct compressed *blocks;
    const unsigned char *bytes;
    const uint64_t *begins; /* [block]: in bytes */
    enum vtkxml_compressor compressor;
    unsigned char *buffers[PARALLEL_MOST_THREADS];
    atomic_int problem;
};

static void inflate_range(void *context, unsigned worker, size_t begin, size_t end)
{
    struct inflate_job *job = context;
    const struct compressed *blocks = job->blocks;
    size_t width = value_size(job->target->type);
    for (size_t b = begin; b < end && !atomic_load(&job->problem); b++) {
        size_t size = (size_t)(b + 1 == blocks->count && blocks->last ? blocks->last : blocks->size);
        int problem = inflate_block(job->compressor, job->bytes + job->begins[b], (size_t)blocks->compressed[b],
                                    job->buffers[worker], size);
        if (problem)
            atomic_store(&job->problem, problem);
        else
            convert(job->target, job->buffers[worker], b * (size_t)(blocks->size / width), size / width);
    }
}

static enum tetlod_status inflate_all(struct inflate_job *job, const struct vtkxml_array *array, struct tetlod_error *error)
{
    const struct compressed *blocks = job->blocks;
    unsigned threads = blocks->count > 1 ? parallel_cores() : 1;
    threads = threads < PARALLEL_MOST_THREADS ? threads : PARALLEL_MOST_THREADS;
    uint64_t size = blocks->count == 1 && blocks->last ? blocks->last : blocks->size; // a size that no block has may be anything
    bool good = true;
    for (unsigned t = 0; t < threads; t++) {
        job->buffers[t] = array_new((size_t)size, 1);
        good &= job->buffers[t] != NULL;
    }
    if (good)
        parallel_for(threads, (size_t)blocks->count, 8, inflate_range, job);
    for (unsigned t = 0; t < threads; t++)
        free(job->buffers[t]);
    int problem = good ? atomic_load(&job->problem) : BLOCK_NOMEM;
    if (problem == BLOCK_NOMEM)
        return tetlodi_fail_nomem(error, array->name, size);
    return problem ? fail_array(error, array, "a compressed block is damaged") : TETLOD_OK;
}

static enum tetlod_status read_compressed(const struct vtkxml_document *document, const struct vtkxml_array *array,
                                          struct source *s, const struct target *target, uint64_t needed,
                                          struct tetlod_error *error)
{
    struct compressed blocks;
    unsigned char *decoded = NULL; // of base64
    uint64_t *begins = NULL, at = 0;
    struct inflate_job job = {.target = target, .blocks = &blocks, .compressor = document->compressor};
    enum tetlod_status status;
    TETLOD_TRY_DONE(read_block_header(s, document->header_size, array, needed, &blocks, error));
    if (blocks.count > 1 && blocks.size % value_size(array->type)) {
        status = fail_array(error, array, "its blocks do not hold whole values");
        goto done;
    }
    begins = array_new((size_t)blocks.count, sizeof *begins);
    decoded = s->base64 ? array_new((size_t)blocks.total, 1) : NULL;
    if (!begins || (s->base64 && !decoded)) {
        status = tetlodi_fail_nomem(error, array->name, blocks.total);
        goto done;
    }
    if (s->base64 ? !take(s, decoded, (size_t)blocks.total) : (uint64_t)(s->end - s->at) < blocks.total) {
        status = fail_short(error, array, needed / value_size(array->type));
        goto done;
    }
    for (uint64_t b = 0; b < blocks.count; b++) {
        begins[b] = at;
        at += blocks.compressed[b];
    }
    job.begins = begins;
    job.bytes = s->base64 ? decoded : s->at;
    status = inflate_all(&job, array, error);
done:
    free(begins);
    free(decoded);
    free(blocks.compressed);
    return status;
}

static enum tetlod_status read_plain(const struct vtkxml_document *document, const struct vtkxml_array *array,
                                     struct source *s, const struct target *target, size_t count,
                                     struct tetlod_error *error)
{
    uint64_t needed = (uint64_t)count * value_size(array->type), stored;
    if (!take_word(s, document->header_size, &stored))
        return fail_short(error, array, count);
    if (stored != needed)
        return fail_array(error, array, "it holds another number of values than the counts of its piece say");
    if (!s->base64) {
        if ((uint64_t)(s->end - s->at) < needed)
            return fail_short(error, array, count);
        convert_all(target, s->at, count);
        return TETLOD_OK;
    }
    unsigned char *decoded = array_new(count, value_size(array->type));
    if (!decoded)
        return tetlodi_fail_nomem(error, array->name, needed);
    enum tetlod_status status = take(s, decoded, (size_t)needed) ? TETLOD_OK : fail_short(error, array, count);
    if (status == TETLOD_OK)
        convert_all(target, decoded, count);
    free(decoded);
    return status;
}

/* ---- text */

static enum tetlod_status fail_ascii(struct tetlod_error *error, const struct vtkxml_array *array, struct text rest,
                                     size_t index, size_t count)
{
    if (rest.at == rest.end)
        return fail_short(error, array, count);
    return tetlodi_fail(error, TETLOD_ERR_MESH, "array '%.60s' (line %llu): value %zu is not a number", array->name,
                        (unsigned long long)array->line, index);
}

/* A number of the text as the eight bytes that `convert` takes. */
static bool text_value(struct text *text, enum value_type type, struct target *target, size_t i)
{
    double number;
    int64_t whole;
    unsigned char bytes[8];
    bool is_float = value_is_float(type);
    if (is_float ? !text_double(text, type == VALUE_FLOAT32, &number) : !text_int(text, &whole))
        return false;
    if (is_float)
        memcpy(bytes, &number, 8);
    else
        memcpy(bytes, &whole, 8);
    convert(target, bytes, i, 1);
    return true;
}

static enum tetlod_status read_text(const struct vtkxml_document *document, const struct vtkxml_array *array,
                                    size_t count, struct target *target, struct tetlod_error *error)
{
    const char *bytes = (const char *)document->bytes;
    struct text text = {bytes + array->begin, bytes + array->end};
    target->type = value_is_float(array->type) ? VALUE_FLOAT64 : VALUE_INT64;
    target->big_endian = __BYTE_ORDER__ == __ORDER_BIG_ENDIAN__;
    for (size_t i = 0; i < count; i++)
        if (!text_value(&text, array->type, target, i))
            return fail_ascii(error, array, text, i, count);
    struct text word = text_word(&text);
    return word.at == word.end ? TETLOD_OK
                               : fail_array(error, array, "it holds more values than the counts of its piece say");
}

enum tetlod_status vtkxml_values(const struct vtkxml_document *document, const struct vtkxml_array *array, size_t count,
                                 enum vtkxml_result result, void *out, struct tetlod_error *error)
{
    struct target target = {result, out, array->type, document->big_endian};
    if (count == 0)
        return TETLOD_OK; // pieces without points may leave out even the header
    if (result != VTKXML_DOUBLES && value_is_float(array->type))
        return fail_array(error, array, "it should hold integers");
    if (array->format == VTKXML_ASCII)
        return read_text(document, array, count, &target, error);
    struct source s = source_of(document, array);
    if (document->compressor == VTKXML_UNCOMPRESSED)
        return read_plain(document, array, &s, &target, count, error);
    return read_compressed(document, array, &s, &target, (uint64_t)count * value_size(array->type), error);
}
