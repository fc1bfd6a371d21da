/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/io/writers/npz_write.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <zlib.h>

#include "format/fail.h"
#include "src/util/array.h"
#include "src/util/put.h"

enum { HEAD = 128, LOCAL = 30, CENTRAL = 46, FIRST_DAY = 33, VERSION = 20, UTF8_NAMES = 1 << 11 };

/* A .npy file's header, of HEAD bytes. */
static void make_head(const struct npz_array *array, unsigned char out[HEAD])
{
    char text[HEAD], width[32] = "";
    static const char magic[] = "\x93NUMPY\x01"; // version 1, 0
    if (array->width > 1)
        snprintf(width, sizeof width, " %zu", array->width);
    int used = snprintf(text, sizeof text, "{'descr': '<f8', 'fortran_order': False, 'shape': (%zu,%s), }", array->rows,
                        width);
    memset(out, ' ', HEAD);
    memcpy(out, magic, sizeof magic); // with its end: the minor version
    out[8] = HEAD - 10;
    out[9] = 0;
    memcpy(out + 10, text, (size_t)used);
    out[HEAD - 1] = '\n';
}

static uint64_t size_of(const struct npz_array *array)
{
    return HEAD + (uint64_t)array->rows * array->width * 8;
}

/* The bytes of the values as they are in the file. */
static void put_values(struct put *put, const struct npz_array *array)
{
    for (size_t i = 0; i < array->rows * array->width; i++)
        put_double(put, array->values[i], TETLOD_FLOAT64);
}

static enum tetlod_status add_to_sum(void *opaque, const void *bytes, size_t size)
{
    uLong *sum = opaque;
    *sum = crc32_z(*sum, bytes, size);
    return TETLOD_OK;
}

static enum tetlod_status sum_of(const struct npz_array *array, uint32_t *out, struct tetlod_error *error)
{
    unsigned char head[HEAD];
    uLong sum = crc32_z(0, NULL, 0);
    const struct tetlodi_sink sink = {add_to_sum, &sum};
    struct put put;
    TETLOD_TRY(put_init(&put, &sink, false, error));
    make_head(array, head);
    put_bytes(&put, head, HEAD);
    put_values(&put, array);
    enum tetlod_status status = put_finish(&put);
    *out = (uint32_t)sum;
    return status;
}

/* What a file's two entries have in common. */
static void put_entry(struct put *put, const struct npz_array *array, uint32_t sum)
{
    put_word(put, VERSION, 2);
    put_word(put, UTF8_NAMES, 2);
    put_word(put, 0, 2); // stored
    put_word(put, 0, 2);
    put_word(put, FIRST_DAY, 2); // 1980-01-01, the first that there is
    put_word(put, sum, 4);
    put_word(put, size_of(array), 4);
    put_word(put, size_of(array), 4);
    put_word(put, strlen(array->name) + 4, 2);
    put_word(put, 0, 2);
}

static void put_name(struct put *put, const struct npz_array *array)
{
    put_text(put, array->name);
    put_text(put, ".npy");
}

static void put_files(struct put *put, const struct npz_array *arrays, size_t count, const uint32_t *sums)
{
    for (size_t i = 0; i < count; i++) {
        unsigned char head[HEAD];
        put_word(put, 0x04034b50, 4);
        put_entry(put, &arrays[i], sums[i]);
        put_name(put, &arrays[i]);
        make_head(&arrays[i], head);
        put_bytes(put, head, HEAD);
        put_values(put, &arrays[i]);
    }
}

static void put_directory(struct put *put, const struct npz_array *arrays, size_t count, const uint32_t *sums)
{
    uint64_t at = 0, size = 0;
    for (size_t i = 0; i < count; i++) {
        const uint64_t name = strlen(arrays[i].name) + 4;
        put_word(put, 0x02014b50, 4);
        put_word(put, VERSION, 2);
        put_entry(put, &arrays[i], sums[i]);
        put_word(put, 0, 2); // comment
        put_word(put, 0, 2); // disk
        put_word(put, 0, 2);
        put_word(put, 0, 4);
        put_word(put, at, 4);
        put_name(put, &arrays[i]);
        at += LOCAL + name + size_of(&arrays[i]);
        size += CENTRAL + name;
    }
    put_word(put, 0x06054b50, 4);
    put_word(put, 0, 4);
    put_word(put, count, 2);
    put_word(put, count, 2);
    put_word(put, size, 4);
    put_word(put, at, 4);
    put_word(put, 0, 2);
}

enum tetlod_status npz_write(const struct npz_array *arrays, size_t count, const struct tetlodi_sink *sink,
                             struct tetlod_error *error)
{
    struct put put;
    uint64_t size = 0;
    for (size_t i = 0; i < count; i++)
        size += size_of(&arrays[i]) + 2 * strlen(arrays[i].name) + 128;
    if (size > UINT32_MAX || count > UINT16_MAX)
        return tetlodi_fail(error, TETLOD_ERR_LIMIT, "a .npz file of 4 GiB or more is not written: take fewer points");
    uint32_t *sums = array_new(count, sizeof *sums);
    enum tetlod_status status = sums ? TETLOD_OK : tetlodi_fail_nomem(error, "a .npz file", count * 4);
    for (size_t i = 0; i < count && status == TETLOD_OK; i++)
        status = sum_of(&arrays[i], &sums[i], error);
    if (status == TETLOD_OK)
        status = put_init(&put, sink, false, error);
    if (status == TETLOD_OK) {
        put_files(&put, arrays, count, sums);
        put_directory(&put, arrays, count, sums);
        status = put_finish(&put);
    }
    free(sums);
    return status;
}
