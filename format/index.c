/* SPDX-License-Identifier: BSD-3-Clause */
#include "format/index.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "format/checksum.h"
#include "format/fail.h"

enum { CID_AT = 40, CID_SIZE = 16, CRC_AT = 60, FIELD_CONTROLLED = 1, STREAM_LOSSLESS = 1 };

void tetlodi_index_fini(struct tetlodi_index *index)
{
    free(index->fields);
    free(index->levels);
    free(index->errors);
    free(index->records);
    free(index->frames);
    free(index->text);
    *index = (struct tetlodi_index){0};
}

bool tetlodi_index_allocate(struct tetlodi_index *index)
{
    size_t fields = index->info.field_count, levels = index->info.level_count;
    index->fields = calloc(fields ? fields : 1, sizeof *index->fields);
    index->levels = calloc(levels, sizeof *index->levels);
    index->errors = calloc(levels * (fields ? fields : 1), TETLOD_MEASURES * sizeof *index->errors);
    index->records = calloc(levels, sizeof *index->records);
    index->frames = calloc(levels * (1 + fields), sizeof *index->frames);
    index->info.fields = index->fields;
    index->info.levels = index->levels;
    for (size_t k = 0; k < levels && index->levels; k++)
        index->levels[k].errors = index->errors + k * fields * TETLOD_MEASURES;
    return index->fields && index->levels && index->errors && index->records && index->frames;
}

/* ---- header */

void tetlodi_header_encode(const struct tetlodi_header *header, uint8_t out[HEADER_SIZE])
{
    struct tetlodi_buffer buffer = {out, 0, HEADER_SIZE, false};
    memset(out, 0, HEADER_SIZE);
    tetlodi_put_block(&buffer, TETLODI_MAGIC, 8);
    tetlodi_put(&buffer, FORMAT_MAJOR, 2);
    tetlodi_put(&buffer, FORMAT_MINOR, 2);
    tetlodi_put(&buffer, 0, 4); // required features
    tetlodi_put(&buffer, 0, 4); // optional features
    tetlodi_put(&buffer, header->stored, 4);
    tetlodi_put(&buffer, header->raw, 4);
    tetlodi_put(&buffer, header->crc, 4);
    tetlodi_put(&buffer, header->file_size, 8);
    tetlodi_put_block(&buffer, header->cid, CID_SIZE);
    tetlodi_put(&buffer, 0, 4); // reserved
    tetlodi_put(&buffer, tetlodi_crc32(out, CRC_AT), 4);
}

enum tetlod_status tetlodi_header_decode(struct tetlodi_header *header, const uint8_t bytes[HEADER_SIZE],
                                         struct tetlod_error *error)
{
    struct tetlodi_bytes in = {bytes, HEADER_SIZE, false};
    if (memcmp(tetlodi_get_block(&in, 8), TETLODI_MAGIC, 8) != 0)
        return tetlodi_fail(error, TETLOD_ERR_NOT_TETLOD, "not a tetlod stream");
    unsigned major = (unsigned)tetlodi_get(&in, 2), minor = (unsigned)tetlodi_get(&in, 2);
    if (tetlodi_crc32(bytes, CRC_AT) != (uint32_t)(bytes[60] | bytes[61] << 8 | bytes[62] << 16 | (uint32_t)bytes[63] << 24))
        return tetlodi_fail(error, TETLOD_ERR_CHECKSUM, "the header is damaged: its checksum does not match");
    if (major != FORMAT_MAJOR)
        return tetlodi_fail(error, TETLOD_ERR_VERSION, "format %u.%u, this program reads %d.x", major, minor, FORMAT_MAJOR);
    uint32_t required = (uint32_t)tetlodi_get(&in, 4);
    tetlodi_get(&in, 4); // optional features: none is known, any may be
    if (required)
        return tetlodi_fail(error, TETLOD_ERR_VERSION, "the stream needs features 0x%x, which this program lacks", required);
    header->stored = (uint32_t)tetlodi_get(&in, 4);
    header->raw = (uint32_t)tetlodi_get(&in, 4);
    header->crc = (uint32_t)tetlodi_get(&in, 4);
    header->file_size = tetlodi_get(&in, 8);
    memcpy(header->cid, tetlodi_get_block(&in, CID_SIZE), CID_SIZE);
    if (tetlodi_get(&in, 4) != 0 || header->raw > MOST_INDEX || header->stored > MOST_INDEX ||
        header->file_size < HEADER_SIZE + (uint64_t)header->stored)
        return tetlodi_fail(error, TETLOD_ERR_STREAM, "the header contradicts itself");
    return TETLOD_OK;
}

void tetlodi_content_id(const uint8_t header[HEADER_SIZE], const void *index, size_t size, uint8_t out[16])
{
    struct tetlodi_sha256 sha;
    uint8_t digest[32];
    tetlodi_sha256_init(&sha);
    tetlodi_sha256_add(&sha, header, CID_AT);
    tetlodi_sha256_add(&sha, index, size);
    tetlodi_sha256_finish(&sha, digest);
    memcpy(out, digest, CID_SIZE);
}

/* ---- index */

void tetlodi_index_encode(const struct tetlodi_index *index, struct tetlodi_buffer *out)
{
    const struct tetlod_info *info = &index->info;
    tetlodi_put(out, info->vertices, 4);
    tetlodi_put(out, info->tets, 4);
    tetlodi_put(out, info->position_type, 1);
    tetlodi_put(out, info->lossless ? STREAM_LOSSLESS : 0, 1);
    tetlodi_put(out, info->field_count, 2);
    tetlodi_put(out, info->level_count, 4);
    for (int i = 0; i < 6; i++)
        tetlodi_put_f64(out, info->bounds[i / 3][i % 3]);
    tetlodi_put(out, info->degenerate_tets, 8);
    tetlodi_put(out, info->inverted_tets, 8);
    tetlodi_put(out, info->unused_points, 8);
    tetlodi_put(out, info->metadata_size, 4);
    tetlodi_put_block(out, info->metadata, info->metadata_size);
    for (uint32_t f = 0; f < info->field_count; f++) {
        const struct tetlod_field *field = &info->fields[f];
        size_t length = strlen(field->name);
        tetlodi_put(out, length, 2);
        tetlodi_put_block(out, field->name, length);
        tetlodi_put(out, field->type, 1);
        tetlodi_put(out, field->controlled ? FIELD_CONTROLLED : 0, 1);
        tetlodi_put(out, field->components, 2);
        tetlodi_put_f64(out, field->range[0]);
        tetlodi_put_f64(out, field->range[1]);
    }
    for (uint32_t k = 0; k < info->level_count; k++) {
        const struct tetlod_level *level = &info->levels[k];
        tetlodi_put(out, level->vertices, 4);
        tetlodi_put(out, level->tets, 4);
        tetlodi_put(out, index->records[k], 4);
        tetlodi_put_f64(out, level->domain_error);
        for (uint32_t i = 0; i < info->field_count * TETLOD_MEASURES; i++)
            tetlodi_put_f64(out, level->errors[i]);
        for (uint32_t i = 0; i <= info->field_count; i++) {
            const struct tetlodi_frame *frame = &index->frames[(size_t)k * (info->field_count + 1) + i];
            tetlodi_put(out, frame->stored, 4);
            tetlodi_put(out, frame->raw, 4);
            tetlodi_put(out, frame->crc, 4);
        }
    }
}

/* What every index must be, beyond being complete. */
static const char *contradiction(const struct tetlodi_index *index)
{
    const struct tetlod_info *info = &index->info;
    for (int i = 0; i < 3; i++)
        if (!(isfinite(info->bounds[0][i]) && isfinite(info->bounds[1][i]) && info->bounds[0][i] <= info->bounds[1][i]))
            return "bounds that are none";
    for (uint32_t f = 0; f < info->field_count; f++) {
        const struct tetlod_field *field = &info->fields[f];
        if (field->components < 1 || field->components > MOST_COMPONENTS || (unsigned)field->type > TETLOD_FLOAT64)
            return "a field of an unknown kind";
        if (!isfinite(field->range[0]) || !isfinite(field->range[1]) || field->range[0] > field->range[1])
            return "a field without a range";
    }
    for (uint32_t k = 0; k < info->level_count; k++) {
        const struct tetlod_level *level = &info->levels[k], *coarser = k ? level - 1 : NULL;
        if (coarser && (level->vertices <= coarser->vertices || level->tets < coarser->tets))
            return "levels that do not grow";
        if (coarser && index->records[k] > level->vertices - coarser->vertices)
            return "more records than vertices";
        for (uint32_t i = 0; i < info->field_count * TETLOD_MEASURES; i++)
            if (level->errors[i] < 0 || (coarser && level->errors[i] > coarser->errors[i]))
                return "errors that grow with the level";
    }
    const struct tetlod_level *finest = &info->levels[info->level_count - 1];
    if (finest->vertices != info->vertices || finest->tets != info->tets || info->levels[0].tets == 0)
        return "levels that do not lead to the original";
    return NULL;
}

static void decode_levels(struct tetlodi_index *index, struct tetlodi_bytes *in, uint64_t offset)
{
    struct tetlod_info *info = &index->info;
    for (uint32_t k = 0; k < info->level_count; k++) {
        struct tetlod_level *level = &index->levels[k];
        level->vertices = (uint32_t)tetlodi_get(in, 4);
        level->tets = (uint32_t)tetlodi_get(in, 4);
        index->records[k] = (uint32_t)tetlodi_get(in, 4);
        level->domain_error = tetlodi_get_f64(in);
        for (uint32_t i = 0; i < info->field_count * TETLOD_MEASURES; i++)
            index->errors[(size_t)k * info->field_count * TETLOD_MEASURES + i] = tetlodi_get_f64(in);
        level->offset = offset;
        for (uint32_t i = 0; i <= info->field_count; i++) {
            struct tetlodi_frame *frame = &index->frames[(size_t)k * (info->field_count + 1) + i];
            frame->offset = offset;
            frame->stored = (uint32_t)tetlodi_get(in, 4);
            frame->raw = (uint32_t)tetlodi_get(in, 4);
            frame->crc = (uint32_t)tetlodi_get(in, 4);
            offset += frame->stored;
        }
        level->end = offset;
    }
}

static bool decode_names(struct tetlodi_index *index, struct tetlodi_bytes *in, size_t size)
{
    struct tetlod_info *info = &index->info;
    const uint8_t *metadata = tetlodi_get_block(in, info->metadata_size);
    char *text = index->text = malloc(size + info->field_count + 2);
    if (!text)
        return false;
    if (metadata)
        memcpy(text, metadata, info->metadata_size);
    else
        info->metadata_size = 0;
    info->metadata = text;
    text += info->metadata_size;
    *text++ = 0;
    for (uint32_t f = 0; f < info->field_count && !in->failed; f++) {
        struct tetlod_field *field = &index->fields[f];
        size_t length = (size_t)tetlodi_get(in, 2);
        const uint8_t *name = tetlodi_get_block(in, length);
        field->name = text;
        if (name)
            memcpy(text, name, length);
        text += name ? length : 0;
        *text++ = 0;
        field->type = (enum tetlod_type)tetlodi_get(in, 1);
        field->controlled = (tetlodi_get(in, 1) & FIELD_CONTROLLED) != 0;
        field->components = (uint32_t)tetlodi_get(in, 2);
        field->range[0] = tetlodi_get_f64(in);
        field->range[1] = tetlodi_get_f64(in);
    }
    return true;
}

enum tetlod_status tetlodi_index_decode(struct tetlodi_index *index, const void *bytes, size_t size,
                                        uint64_t first_offset, struct tetlod_error *error)
{
    struct tetlodi_bytes in = {bytes, size, false};
    struct tetlod_info *info = &index->info;
    *index = (struct tetlodi_index){0};
    info->vertices = (uint32_t)tetlodi_get(&in, 4);
    info->tets = (uint32_t)tetlodi_get(&in, 4);
    unsigned type = (unsigned)tetlodi_get(&in, 1), flags = (unsigned)tetlodi_get(&in, 1);
    info->position_type = (enum tetlod_type)type;
    info->lossless = flags & STREAM_LOSSLESS;
    info->field_count = (uint32_t)tetlodi_get(&in, 2);
    info->level_count = (uint32_t)tetlodi_get(&in, 4);
    for (int i = 0; i < 6; i++)
        info->bounds[i / 3][i % 3] = tetlodi_get_f64(&in);
    info->degenerate_tets = tetlodi_get(&in, 8);
    info->inverted_tets = tetlodi_get(&in, 8);
    info->unused_points = tetlodi_get(&in, 8);
    info->metadata_size = (size_t)tetlodi_get(&in, 4);
    // a level takes 32 bytes and 44 a field: what is left bounds what is allocated
    bool fits = !in.failed && type <= TETLOD_FLOAT64 && flags <= STREAM_LOSSLESS && info->field_count <= MOST_FIELDS &&
                info->level_count >= 1 && info->level_count <= MOST_LEVELS && info->metadata_size <= MOST_METADATA &&
                (uint64_t)info->level_count * (32 + 44 * (uint64_t)info->field_count) <= in.left;
    if (!fits)
        return tetlodi_fail(error, TETLOD_ERR_STREAM, "the index is damaged");
    enum tetlod_status status = TETLOD_OK;
    if (!tetlodi_index_allocate(index) || !decode_names(index, &in, size))
        status = tetlodi_fail_nomem(error, "the index", size);
    if (status == TETLOD_OK) {
        decode_levels(index, &in, first_offset);
        const char *wrong = in.failed ? "less than it should" : in.left ? "more than it should" : contradiction(index);
        if (wrong)
            status = tetlodi_fail(error, TETLOD_ERR_STREAM, "the index is damaged: it has %s", wrong);
        info->bytes = index->levels[info->level_count - 1].end;
    }
    if (status != TETLOD_OK)
        tetlodi_index_fini(index);
    return status;
}
