/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * Binary data of an array: words (UInt32 or UInt64) and then the values. Uncompressed, one word: the bytes that follow.
 * Compressed: the number of blocks, the size of a whole block, the size of the last one if it is a partial one (else
 * 0), the compressed size of each block, then the blocks. As base64, header and values may be encoded apart or
 * together.
 */
#include <limits.h>
#include <stdatomic.h>
#include <lz4.h>
#include <lzma.h>
#include <stdlib.h>
#include <string.h>
#include <zlib.h>

#include "format/fail.h"
#include "src/io/readers/vtkxml_document.h"
#include "src/util/array.h"
#include "src/util/parallel.h"

/* Bytes of the document, raw or out of base64 text, which is in memory. */
struct source {
    const struct vtkxml_document *document;
    size_t at, end;
    bool base64;
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
        unsigned char c = s->document->bytes[s->at++];
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

/* Quads of digits without anything between them, as far as they go; gives the bytes, a multiple of 3. */
static size_t take_quads(struct source *s, unsigned char *out, size_t size)
{
    size_t done = 0;
    for (; size - done >= 3 && s->end - s->at >= 4; done += 3, s->at += 4) {
        const unsigned char *c = s->document->bytes + s->at;
        int digits[4] = {base64_digit(c[0]), base64_digit(c[1]), base64_digit(c[2]), base64_digit(c[3])};
        if ((digits[0] | digits[1] | digits[2] | digits[3]) < 0)
            break;
        uint32_t word = (uint32_t)(digits[0] << 18 | digits[1] << 12 | digits[2] << 6 | digits[3]);
        out[done] = (unsigned char)(word >> 16);
        out[done + 1] = (unsigned char)(word >> 8);
        out[done + 2] = (unsigned char)word;
    }
    return done;
}

/* Bytes at a place of the document: as they are, or those of raw appended data read into the buffer. NULL: they cannot
 * be read. */
static const unsigned char *bytes_at(const struct vtkxml_document *document, size_t at, size_t size,
                                     unsigned char *buffer)
{
    if (!document->file || at + size <= document->text)
        return document->bytes + at;
    return file_input_read(document->file, at, size, buffer) == size ? buffer : NULL;
}

static bool take(struct source *s, unsigned char *out, size_t size)
{
    enum { PART = 1 << 16 };
    if (!s->base64) {
        const unsigned char *bytes = s->end - s->at < size ? NULL : bytes_at(s->document, s->at, size, out);
        if (bytes && bytes != out)
            memcpy(out, bytes, size);
        s->at += bytes ? size : 0;
        return bytes != NULL;
    }
    for (size_t i = 0; i < size; i++) {
        if (s->held_count == 0)
            i += take_quads(s, out + i, size - i < PART ? size - i : PART);
        file_view_pass(s->document->view, s->document->bytes + s->at);
        if (i == size)
            break;
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

/* Words of a header; false also if there are not as many. */
static bool take_words(struct source *s, size_t count, uint64_t *out)
{
    size_t width = s->document->header_size;
    // at the end, so that widening from the front is in place
    unsigned char *bytes = (unsigned char *)out + count * (sizeof *out - width);
    if (count > most_left(s) / width || !take(s, bytes, count * width))
        return false;
    values_to_ints(bytes, width == 8 ? VALUE_UINT64 : VALUE_UINT32, s->document->big_endian, count, (int64_t *)out);
    return true;
}

static struct source source_of(const struct vtkxml_document *document, const struct vtkxml_array *array)
{
    if (array->format != VTKXML_APPENDED)
        return (struct source){.document = document, .at = array->begin, .end = array->end, .base64 = true};
    uint64_t left = document->size - document->appended;
    return (struct source){.document = document,
                           .at = document->appended + (size_t)(array->offset < left ? array->offset : left),
                           .end = document->size,
                           .base64 = !document->appended_raw};
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

enum tetlod_status vtkxml_check_count(const struct vtkxml_document *document, const struct vtkxml_array *array,
                                      uint64_t count,
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

enum { BLOCK_DAMAGED = 1, BLOCK_UNREAD, BLOCK_NOMEM, BLOCK_DIFFERS };

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

/* Where values go; or, without `out`, which they should be: first, first + step, ... */
struct target {
    enum vtkxml_result result;
    void *out;
    int64_t first, step;
    bool *differs;
    enum value_type type;
    bool big_endian;
    struct vtkxml_slice slice;
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

/* Whether the values are those that they should be. */
static bool compare(const struct target *target, const unsigned char *bytes, size_t first, size_t count)
{
    enum { STEP = 512 };
    int64_t values[STEP], differs = 0;
    size_t width = value_size(target->type);
    for (size_t done = 0; done < count && !differs; done += STEP) {
        size_t some = count - done < STEP ? count - done : STEP;
        int64_t begin = target->first + target->step * (int64_t)(first + done);
        values_to_ints(bytes + done * width, target->type, target->big_endian, some, values);
        for (size_t i = 0; i < some; i++)
            differs |= values[i] ^ (begin + target->step * (int64_t)i);
    }
    return !differs;
}

/* ---- blocks */

/* An array as blocks of bytes, each of whole values: compressed by themselves, or the parts that one thread takes at a
 * time. */
struct data_blocks {
    uint64_t count, size, last; /* bytes of values; of the last one if it is a partial one, else 0 */
    uint64_t *stored;           /* owned: bytes of each in the file */
    uint64_t total, most;       /* of them */
};

static enum tetlod_status new_sizes(struct data_blocks *out, const struct vtkxml_array *array,
                                    struct tetlod_error *error)
{
    out->stored = array_new(out->count, sizeof *out->stored);
    return out->stored ? TETLOD_OK : tetlodi_fail_nomem(error, array->name, out->count * sizeof *out->stored);
}

static uint64_t block_size(const struct data_blocks *blocks, uint64_t b)
{
    return b + 1 == blocks->count && blocks->last ? blocks->last : blocks->size;
}

static enum tetlod_status fail_count(const struct vtkxml_array *array, struct tetlod_error *error)
{
    return fail_array(error, array, "it holds another number of values than the counts of its piece say");
}

static enum tetlod_status read_block_header(struct source *s, const struct vtkxml_array *array, uint64_t needed,
                                            struct data_blocks *out, struct tetlod_error *error)
{
    uint64_t words[3];
    if (!take_words(s, 3, words) || words[0] > most_left(s) / s->document->header_size)
        return fail_short(error, array, needed / value_size(array->type));
    out->count = words[0];
    out->size = words[1];
    out->last = words[2];
    uint64_t whole = out->count - (out->last && out->count ? 1 : 0);
    if (out->count == 0 || out->last > needed || (whole && (out->size == 0 || whole > needed / out->size)) ||
        whole * out->size + out->last != needed)
        return fail_count(array, error);
    if (out->count > 1 && out->size % value_size(array->type))
        return fail_array(error, array, "its blocks do not hold whole values");
    TETLOD_TRY(new_sizes(out, array, error));
    return take_words(s, (size_t)out->count, out->stored) ? TETLOD_OK
                                                          : fail_short(error, array, needed / value_size(array->type));
}

/* Of plain values, the header only says how many bytes follow. */
static enum tetlod_status read_plain_header(struct source *s, const struct vtkxml_array *array, uint64_t needed,
                                            struct data_blocks *out, struct tetlod_error *error)
{
    enum { PLAIN_BLOCK = 1 << 18 };
    uint64_t stored;
    if (!take_words(s, 1, &stored))
        return fail_short(error, array, needed / value_size(array->type));
    if (stored != needed)
        return fail_count(array, error);
    *out = (struct data_blocks){needed / PLAIN_BLOCK + (needed % PLAIN_BLOCK != 0), PLAIN_BLOCK, needed % PLAIN_BLOCK,
                                NULL, 0, 0};
    TETLOD_TRY(new_sizes(out, array, error));
    for (uint64_t b = 0; b < out->count; b++)
        out->stored[b] = block_size(out, b);
    return TETLOD_OK;
}

/* Sums the sizes up, which may be anything. */
static enum tetlod_status add_sizes(const struct source *s, const struct vtkxml_array *array,
                                    struct data_blocks *blocks,
                                    uint64_t needed, struct tetlod_error *error)
{
    uint64_t left = most_left(s);
    for (uint64_t b = 0; b < blocks->count; b++) {
        uint64_t size = blocks->stored[b];
        if (size > left - blocks->total)
            return fail_short(error, array, needed / value_size(array->type));
        if (size / 2 > block_size(blocks, b) + 1024)
            return fail_array(error, array, "a compressed block is larger than its values");
        blocks->total += size;
        blocks->most = size > blocks->most ? size : blocks->most;
    }
    return TETLOD_OK;
}

/* Blocks that are read, decompressed and converted one by one, each thread in buffers of its own. */
struct block_job {
    const struct vtkxml_document *document;
    const struct target *target;
    const struct data_blocks *blocks;
    const unsigned char *decoded; /* of base64: all of them; or NULL: they are in the document */
    const size_t *begins;         /* [block] */
    /* owned; NULL where they are not needed */
    unsigned char *stored[PARALLEL_MAX_THREADS], *plain[PARALLEL_MAX_THREADS];
    atomic_int problem;
};

/* Is anything of the block wanted? */
static bool has_wanted(const struct block_job *job, size_t b)
{
    const struct vtkxml_slice *slice = &job->target->slice;
    uint64_t each = job->blocks->size / value_size(job->target->type), first = b * each;
    return job->blocks->count == 1 || (first < slice->first + slice->count && slice->first < first + each);
}

static int convert_block(struct block_job *job, unsigned worker, size_t b)
{
    const struct vtkxml_document *document = job->document;
    size_t width = value_size(job->target->type), size = (size_t)block_size(job->blocks,
                                                                            b), stored = (size_t)job->blocks->stored[b];
    const unsigned char *bytes = job->decoded ? job->decoded + job->begins[b]
                                              : bytes_at(document, job->begins[b], stored, job->stored[worker]);
    if (!bytes)
        return BLOCK_UNREAD;
    if (document->compressor != VTKXML_UNCOMPRESSED) {
        int problem = inflate_block(document->compressor, bytes, stored, job->plain[worker], size);
        if (problem)
            return problem;
        bytes = job->plain[worker];
    }
    const struct vtkxml_slice *slice = &job->target->slice;
    uint64_t first = b * (job->blocks->size / width), end = first + size / width;
    uint64_t slice_end = slice->first + slice->count;
    uint64_t from = first > slice->first ? first : slice->first, to = end < slice_end ? end : slice_end;
    bytes += (size_t)(from - first) * width;
    if (!job->target->out)
        return compare(job->target, bytes, (size_t)(from - slice->first), (size_t)(to - from)) ? 0 : BLOCK_DIFFERS;
    convert(job->target, bytes, (size_t)(from - slice->first), (size_t)(to - from));
    return 0;
}

static void convert_range(void *context, unsigned worker, size_t begin, size_t end)
{
    struct block_job *job = context;
    for (size_t b = begin; b < end && !atomic_load(&job->problem); b++) {
        int problem = has_wanted(job, b) ? convert_block(job, worker, b) : 0;
        if (problem)
            atomic_store(&job->problem, problem);
    }
}

static enum tetlod_status convert_all(struct block_job *job, const struct vtkxml_array *array,
                                      struct tetlod_error *error)
{
    const struct data_blocks *blocks = job->blocks;
    unsigned threads = blocks->count > 1 ? parallel_cores() : 1;
    threads = threads < PARALLEL_MAX_THREADS ? threads : PARALLEL_MAX_THREADS;
    // a size that no block has may be anything
    uint64_t size = blocks->count == 1 ? block_size(blocks, 0) : blocks->size;
    bool reads = job->document->file && !job->decoded, inflates = job->document->compressor != VTKXML_UNCOMPRESSED,
         good = true;
    for (unsigned t = 0; t < threads; t++) {
        job->stored[t] = reads ? array_new((size_t)blocks->most, 1) : NULL;
        job->plain[t] = inflates ? array_new((size_t)size, 1) : NULL;
        good &= (job->stored[t] || !reads) && (job->plain[t] || !inflates);
    }
    if (good)
        parallel_for(threads, (size_t)blocks->count, 8, convert_range, job);
    for (unsigned t = 0; t < threads; t++) {
        free(job->stored[t]);
        free(job->plain[t]);
    }
    int problem = good ? atomic_load(&job->problem) : BLOCK_NOMEM;
    if (problem == BLOCK_NOMEM)
        return tetlodi_fail_nomem(error, array->name, size);
    if (problem == BLOCK_DIFFERS) {
        *job->target->differs = true;
        return TETLOD_OK;
    }
    return problem ? fail_array(error, array,
                                problem == BLOCK_UNREAD ? "it cannot be read" : "a compressed block is damaged")
                   : TETLOD_OK;
}

/* Plain values in base64, decoded and converted part by part. */
static enum tetlod_status convert_base64(struct source *s, const struct vtkxml_array *array,
                                         const struct target *target,
                                         const struct data_blocks *blocks, struct tetlod_error *error)
{
    size_t *begins = array_zero((size_t)blocks->count, sizeof *begins);
    unsigned char *part = array_new((size_t)blocks->most, 1);
    struct block_job job = {.document = s->document, .target = target, .blocks = blocks, .decoded = part,
                            .begins = begins};
    enum tetlod_status status = begins && part ? TETLOD_OK : tetlodi_fail_nomem(error, array->name, blocks->most);
    for (size_t b = 0; b < blocks->count && status == TETLOD_OK && !(target->differs && *target->differs); b++) {
        if (!take(s, part, (size_t)blocks->stored[b]))
            status = fail_short(error, array, blocks->total / value_size(array->type));
        else if (has_wanted(&job, b) && convert_block(&job, 0, b) == BLOCK_DIFFERS)
            *target->differs = true;
    }
    free(begins);
    free(part);
    return status;
}

/* Where each block begins, and the bytes of base64 decoded, then all blocks. */
static enum tetlod_status convert_blocks(struct source *s, const struct vtkxml_array *array,
                                         const struct target *target,
                                         const struct data_blocks *blocks, struct tetlod_error *error)
{
    size_t *begins = array_new((size_t)blocks->count, sizeof *begins);
    unsigned char *decoded = s->base64 ? array_new((size_t)blocks->total, 1) : NULL;
    struct block_job job = {.document = s->document, .target = target, .blocks = blocks, .decoded = decoded,
                            .begins = begins};
    enum tetlod_status status = TETLOD_OK;
    if (!begins || (s->base64 && !decoded))
        status = tetlodi_fail_nomem(error, array->name, blocks->total);
    else if (s->base64 && !take(s, decoded, (size_t)blocks->total))
        status = fail_short(error, array, blocks->total / value_size(array->type));
    size_t at = s->base64 ? 0 : s->at;
    for (uint64_t b = 0; status == TETLOD_OK && b < blocks->count; b++) {
        begins[b] = at;
        at += (size_t)blocks->stored[b];
    }
    if (status == TETLOD_OK)
        status = convert_all(&job, array, error);
    free(begins);
    free(decoded);
    return status;
}

static enum tetlod_status read_binary(const struct vtkxml_document *document, const struct vtkxml_array *array,
                                      const struct target *target, struct tetlod_error *error)
{
    struct source s = source_of(document, array);
    struct data_blocks blocks = {0};
    uint64_t needed = target->slice.all * value_size(array->type);
    enum tetlod_status status = document->compressor == VTKXML_UNCOMPRESSED
                                    ? read_plain_header(&s, array, needed, &blocks, error)
                                    : read_block_header(&s, array, needed, &blocks, error);
    if (status == TETLOD_OK)
        status = add_sizes(&s, array, &blocks, needed, error);
    bool is_plain_base64 = s.base64 && document->compressor == VTKXML_UNCOMPRESSED;
    if (status == TETLOD_OK)
        status = is_plain_base64 ? convert_base64(&s, array, target, &blocks, error)
                                 : convert_blocks(&s, array, target, &blocks, error);
    free(blocks.stored);
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
    for (size_t i = 0; i < count; i++) {
        if (!text_value(&text, array->type, target, i))
            return fail_ascii(error, array, text, i, count);
        file_view_pass(document->view, text.at);
    }
    struct text word = text_word(&text);
    return word.at == word.end ? TETLOD_OK
                               : fail_array(error, array, "it holds more values than the counts of its piece say");
}

enum tetlod_status vtkxml_values(const struct vtkxml_document *document, const struct vtkxml_array *array,
                                 struct vtkxml_slice slice, enum vtkxml_result result, void *out,
                                 struct tetlod_error *error)
{
    struct target target = {.result = result, .out = out, .type = array->type, .big_endian = document->big_endian,
                            .slice = slice};
    if (slice.count == 0)
        return TETLOD_OK; // pieces without points may leave out even the header
    if (result != VTKXML_DOUBLES && value_is_float(array->type))
        return fail_array(error, array, "it should hold integers");
    if (array->format == VTKXML_ASCII)
        return read_text(document, array, (size_t)slice.all, &target, error);
    return read_binary(document, array, &target, error);
}

enum tetlod_status vtkxml_is_sequence(const struct vtkxml_document *document, const struct vtkxml_array *array,
                                      struct vtkxml_slice slice, int64_t first, int64_t step, bool *out,
                                      struct tetlod_error *error)
{
    bool differs = value_is_float(array->type) || array->format == VTKXML_ASCII;
    struct target target = {.first = first, .step = step, .differs = &differs, .type = array->type,
                            .big_endian = document->big_endian, .slice = slice};
    enum tetlod_status status = differs ? TETLOD_OK : read_binary(document, array, &target, error);
    *out = !differs;
    return status;
}
