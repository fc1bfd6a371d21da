/* SPDX-License-Identifier: BSD-3-Clause */
#include "format/common/pack.h"

#include <stdlib.h>

#include "format/common/allowance.h"
#include "format/common/coder.h"
#include "format/fail.h"

enum { RATE = 6, MAX_STRIDE = 1 << 16, STRIDE_BYTES = 3, NODES = 256 };

/* `same`: is a byte the one above it, by its place in the row. Others: by place modulo 8, because most rows hold
 * numbers of 8 bytes; in rows of one byte, which are text, by the byte before. */
struct models {
    struct tetlodi_bit *same, *byte;
};

static bool models_init(struct models *models, uint32_t stride)
{
    size_t trees = stride == 1 ? 256 : 8;
    models->same = malloc(stride * sizeof *models->same);
    models->byte = malloc(trees * NODES * sizeof *models->byte);
    if (!models->same || !models->byte)
        return false;
    tetlodi_bits_init(models->same, stride);
    tetlodi_bits_init(models->byte, trees * NODES);
    return true;
}

static void models_fini(struct models *models)
{
    free(models->same);
    free(models->byte);
}

/* Both ways: an encoder's bytes are there, a decoder's are set. */
static void code_bytes(struct tetlodi_coder *coder, struct models *models, uint32_t stride, uint8_t *bytes, size_t size)
{
    for (size_t i = 0; i < size; i++) {
        uint8_t above = i >= stride ? bytes[i - stride] : 0;
        size_t place = stride == 1 ? above : i % stride % 8;
        if (code_bit(coder, &models->same[i % stride], bytes[i] == above))
            bytes[i] = above;
        else
            bytes[i] = (uint8_t)code_tree(coder, models->byte + place * NODES, 8, bytes[i]);
    }
}

bool tetlodi_packs(enum tetlodi_packing packing, uint64_t plain, uint64_t packed)
{
    return packing == PACKED_TABLE ? is_within(plain, PACKED_TABLE_FREE, PACKED_TABLE_PER_BYTE,
                                               packed) : is_within(plain, 0, PACKED_PER_BYTE, packed);
}

bool tetlodi_pack(enum tetlodi_packing packing, const uint8_t *bytes, size_t size, uint32_t stride,
                  struct tetlodi_buffer *out)
{
    struct tetlodi_memory memory = {.most = UINT64_MAX};
    struct tetlodi_encoder encoder = {0};
    struct tetlodi_coder coder;
    struct models models = {0};
    uint8_t *copy = malloc(size ? size : 1);
    bool packed = stride && stride < MAX_STRIDE && copy && models_init(&models, stride);
    if (packed) {
        memcpy(copy, bytes, size);
        tetlodi_put(out, stride, STRIDE_BYTES);
        tetlodi_encode_start(&coder, RATE, &encoder, &memory);
        code_bytes(&coder, &models, stride, copy, size);
        tetlodi_encode_finish(&coder);
        tetlodi_put_block(out, encoder.bytes, encoder.size);
        while (!out->failed && !tetlodi_packs(packing, size, out->size)) // zero bytes change nothing
            tetlodi_put(out, 0, 1);
        packed = !encoder.failed && !out->failed && out->size < size;
        TETLODI_FREE(&memory, encoder.bytes, encoder.capacity);
    }
    models_fini(&models);
    free(copy);
    return packed;
}

enum tetlod_status tetlodi_unpack(const uint8_t *packed, size_t packed_size, uint8_t *out, size_t size,
                                  struct tetlod_error *error)
{
    struct tetlodi_bytes in = {packed, packed_size, false};
    struct tetlodi_coder coder;
    struct models models = {0};
    uint32_t stride = (uint32_t)tetlodi_get(&in, STRIDE_BYTES);
    if (in.failed || !stride || stride >= MAX_STRIDE)
        return tetlodi_fail(error, TETLOD_ERR_STREAM, "a packed part has rows of no known length");
    enum tetlod_status status = TETLOD_OK;
    if (models_init(&models, stride)) {
        tetlodi_decode_start(&coder, RATE, in.at, in.left);
        code_bytes(&coder, &models, stride, out, size);
        while (coder.at < coder.end && *coder.at == 0)
            coder.at++;
        if (coder.at < coder.end)
            status = tetlodi_fail(error, TETLOD_ERR_STREAM, "a packed part has bytes that belong to nothing");
        if (coder.bad)
            status = tetlodi_fail(error, TETLOD_ERR_STREAM, "a packed part holds what no writer writes");
    } else {
        status = tetlodi_fail_nomem(error, "a packed part", size);
    }
    models_fini(&models);
    return status;
}
