/* SPDX-License-Identifier: BSD-3-Clause */
#include "format/coding/pointer.h"

#include <string.h>

#include "format/common/bytes.h"
#include "format/coding/header.h"
#include "format/fail.h"

enum { MAGIC_SIZE = 8, CHECK_AT = 60, CHECK_SIZE = 4 };

void tetlodi_pointer_encode(const struct tetlodi_pointer *pointer, uint8_t out[POINTER_SIZE])
{
    struct tetlodi_buffer buffer = {out, 0, POINTER_SIZE, false};
    uint8_t digest[DIGEST_SIZE];
    memset(out, 0, POINTER_SIZE);
    tetlodi_put_block(&buffer, TETLODI_POINTER_MAGIC, MAGIC_SIZE);
    tetlodi_put(&buffer, pointer->offset, 8);
    tetlodi_put(&buffer, pointer->size, 8);
    tetlodi_digest(out, CHECK_AT, digest);
    memcpy(out + CHECK_AT, digest, CHECK_SIZE);
}

bool tetlodi_pointer_is(const uint8_t bytes[POINTER_SIZE])
{
    return memcmp(bytes, TETLODI_POINTER_MAGIC, MAGIC_SIZE) == 0;
}

enum tetlod_status tetlodi_pointer_decode(struct tetlodi_pointer *out, const uint8_t bytes[POINTER_SIZE],
                                          struct tetlod_error *error)
{
    struct tetlodi_bytes in = {bytes + MAGIC_SIZE, CHECK_AT - MAGIC_SIZE, false};
    uint8_t digest[DIGEST_SIZE];
    tetlodi_digest(bytes, CHECK_AT, digest);
    if (memcmp(bytes + CHECK_AT, digest, CHECK_SIZE) != 0)
        return tetlodi_fail(error, TETLOD_ERR_CHECKSUM,
                            "the pointer to the stream is damaged: its checksum does not match");
    out->offset = tetlodi_get(&in, 8);
    out->size = tetlodi_get(&in, 8);
    bool reserved = true;
    while (in.left)
        reserved = tetlodi_get(&in, 1) == 0 && reserved;
    if (!reserved || out->offset < POINTER_SIZE || out->size < HEADER_SIZE || out->offset > INT64_MAX - out->size)
        return tetlodi_fail(error, TETLOD_ERR_STREAM, "the pointer to the stream is damaged: it holds what no writer "
                                                      "writes");
    return TETLOD_OK;
}
