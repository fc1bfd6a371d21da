/* SPDX-License-Identifier: BSD-3-Clause */
#include "server/http/encode.h"

#include <stdbool.h>
#include <zlib.h>
#include <zstd.h>

#include "format/fail.h"
#include "src/util/array.h"

enum {
    GZIP_LEVEL = 4,  // 6 takes twice the time for 1 % less on mesh arrays
    ZSTD_LEVEL = 3,
};

static bool gzip(const struct buffer *in, struct buffer *out)
{
    z_stream stream = {0};
    if (deflateInit2(&stream, GZIP_LEVEL, Z_DEFLATED, 15 + 16, 8, Z_DEFAULT_STRATEGY) != Z_OK)
        return false;
    bool done = false;
    unsigned char *place = in->size <= INT32_MAX ? buffer_extend(out, deflateBound(&stream, (uLong)in->size)) : NULL;
    if (place) {
        stream.next_in = in->bytes;
        stream.avail_in = (uInt)in->size;
        stream.next_out = place;
        stream.avail_out = (uInt)out->size;
        done = deflate(&stream, Z_FINISH) == Z_STREAM_END;
        out->size = stream.total_out;
    }
    deflateEnd(&stream);
    return done;
}

static bool zstd(const struct buffer *in, struct buffer *out)
{
    unsigned char *place = buffer_extend(out, ZSTD_compressBound(in->size));
    if (!place)
        return false;
    // windows of at most 2 MiB: RFC 9659 allows 8
    size_t size = ZSTD_compress(place, out->size, in->bytes, in->size, ZSTD_LEVEL);
    out->size = ZSTD_isError(size) ? 0 : size;
    return !ZSTD_isError(size);
}

uint64_t buffer_encoding_bytes(uint64_t size, enum coding coding)
{
    enum { GZIP_BYTES = 300 << 10, ZSTD_BYTES = 4 << 20 }; // of the encoders themselves
    if (coding == CODING_IDENTITY)
        return 0;
    return coding == CODING_GZIP ? size + size / 1000 + GZIP_BYTES : ZSTD_compressBound((size_t)size) + ZSTD_BYTES;
}

enum tetlod_status buffer_encode(struct buffer *buffer, enum coding coding, struct tetlod_error *error)
{
    struct buffer encoded = {0};
    if (coding == CODING_IDENTITY)
        return TETLOD_OK;
    if (!(coding == CODING_GZIP ? gzip : zstd)(buffer, &encoded)) {
        buffer_fini(&encoded);
        return tetlodi_fail_nomem(error, "compressing an answer", buffer->size);
    }
    unsigned char *exact = array_resize(encoded.bytes, encoded.size, 1);
    if (exact) {
        encoded.bytes = exact;
        encoded.capacity = encoded.size;
    }
    buffer_fini(buffer);
    *buffer = encoded;
    return TETLOD_OK;
}
