/* SPDX-License-Identifier: BSD-3-Clause */
#include "format/coding/header.h"

#include <string.h>

#include "format/common/bytes.h"
#include "format/common/pack.h"
#include "format/fail.h"
#include "format/coding/page_table.h"

enum { CID_AT = 40, CHECK_AT = 60, CHECK_SIZE = 4 };

void tetlodi_header_encode(const struct tetlodi_header *header, uint8_t out[HEADER_SIZE])
{
    struct tetlodi_buffer buffer = {out, 0, HEADER_SIZE, false};
    uint8_t digest[DIGEST_SIZE];
    memset(out, 0, HEADER_SIZE);
    tetlodi_put_block(&buffer, TETLODI_MAGIC, 8);
    tetlodi_put(&buffer, FORMAT_MAJOR, 2);
    tetlodi_put(&buffer, header->paged ? FORMAT_MINOR_PAGED : 0, 2);
    tetlodi_put(&buffer, header->paged ? FEATURE_PAGED : 0, 4); // required features
    tetlodi_put(&buffer, 0, 4); // optional features
    tetlodi_put(&buffer, header->index_size, 4);
    tetlodi_put(&buffer, header->index_plain, 4);
    tetlodi_put(&buffer, header->early_size, 4);
    tetlodi_put(&buffer, header->file_size, 8);
    tetlodi_put_block(&buffer, header->cid, DIGEST_SIZE);
    tetlodi_put(&buffer, 0, 4); // reserved
    tetlodi_digest(out, CHECK_AT, digest);
    tetlodi_put_block(&buffer, digest, CHECK_SIZE);
}

static enum tetlod_status check_version(unsigned major, unsigned minor, struct tetlod_error *error)
{
    if (major == FORMAT_MAJOR)
        return TETLOD_OK;
    if (major < FORMAT_MAJOR)
        return tetlodi_fail(error, TETLOD_ERR_VERSION,
                            "the stream has the old layout (format %u.%u), from before the first release; build it "
                            "again from its mesh",
                            major, minor);
    return tetlodi_fail(error, TETLOD_ERR_VERSION, "the stream has format %u.%u, this program reads %d.x", major,
                        minor, FORMAT_MAJOR);
}

enum tetlod_status tetlodi_header_decode(struct tetlodi_header *header, const uint8_t bytes[HEADER_SIZE],
                                         struct tetlod_error *error)
{
    struct tetlodi_bytes in = {bytes, HEADER_SIZE, false};
    uint8_t digest[DIGEST_SIZE];
    if (memcmp(tetlodi_get_block(&in, 8), TETLODI_MAGIC, 8) != 0)
        return tetlodi_fail(error, TETLOD_ERR_NOT_TETLOD, "not a tetlod stream");
    unsigned major = (unsigned)tetlodi_get(&in, 2), minor = (unsigned)tetlodi_get(&in, 2);
    TETLOD_TRY(check_version(major, minor, error));
    tetlodi_digest(bytes, CHECK_AT, digest);
    if (memcmp(bytes + CHECK_AT, digest, CHECK_SIZE) != 0)
        return tetlodi_fail(error, TETLOD_ERR_CHECKSUM, "the header is damaged: its checksum does not match");
    uint32_t required = (uint32_t)tetlodi_get(&in, 4);
    tetlodi_get(&in, 4); // optional features: none is known, any may be
    if (required & ~(uint32_t)FEATURE_PAGED)
        return tetlodi_fail(error, TETLOD_ERR_VERSION, "the stream needs features 0x%x, which this program lacks",
                            required);
    header->paged = (required & FEATURE_PAGED) != 0;
    header->index_size = (uint32_t)tetlodi_get(&in, 4);
    header->index_plain = (uint32_t)tetlodi_get(&in, 4);
    header->early_size = (uint32_t)tetlodi_get(&in, 4);
    header->file_size = tetlodi_get(&in, 8);
    memcpy(header->cid, tetlodi_get_block(&in, DIGEST_SIZE), DIGEST_SIZE);
    if (tetlodi_get(&in, 4) != 0 || header->index_plain > MAX_INDEX || header->index_size > header->index_plain ||
        (header->index_plain != header->index_size &&
         !tetlodi_packs(PACKED_TABLE, header->index_plain, header->index_size)) || header->early_size > MAX_EARLY ||
        header->file_size > INT64_MAX || header->file_size < tetlodi_header_head(header))
        return tetlodi_fail(error, TETLOD_ERR_STREAM, "the header contradicts itself");
    return TETLOD_OK;
}

void tetlodi_content_id(const uint8_t header[HEADER_SIZE], const void *index, size_t size, uint8_t out[DIGEST_SIZE])
{
    struct tetlodi_sha256 sha;
    uint8_t digest[32];
    tetlodi_sha256_init(&sha);
    tetlodi_sha256_add(&sha, header, CID_AT);
    tetlodi_sha256_add(&sha, index, size);
    tetlodi_sha256_finish(&sha, digest);
    memcpy(out, digest, DIGEST_SIZE);
}
