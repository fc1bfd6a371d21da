/* SPDX-License-Identifier: BSD-3-Clause */
#include "format/index.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "format/checksum.h"
#include "format/fail.h"
#include "format/utf8.h"

enum { CID_AT = 40, CID_SIZE = 16, CRC_AT = 60, FIELD_CONTROLLED = 1, FIELD_EXACT_LATER = 2, SCALE_FLOAT64 = 1, SCALE_NARROW = 2 };

void tetlodi_index_fini(struct tetlodi_index *index)
{
    free(index->fields);
    free(index->levels);
    free(index->errors);
    free(index->scales);
    free(index->frames);
    free(index->exact_later);
    free(index->text);
    *index = (struct tetlodi_index){0};
}

bool tetlodi_index_allocate(struct tetlodi_index *index)
{
    size_t fields = index->info.field_count, levels = index->info.level_count;
    index->fields = calloc(fields ? fields : 1, sizeof *index->fields);
    index->levels = calloc(levels, sizeof *index->levels);
    index->errors = calloc(levels * (fields ? fields : 1), TETLOD_MEASURES * sizeof *index->errors);
    index->scales = calloc(1 + fields, sizeof *index->scales);
    index->frames = calloc(levels * (1 + fields), sizeof *index->frames);
    index->exact_later = calloc(fields ? fields : 1, sizeof *index->exact_later);
    index->info.fields = index->fields;
    index->info.levels = index->levels;
    for (size_t k = 0; k < levels && index->levels; k++)
        index->levels[k].errors = index->errors + k * fields * TETLOD_MEASURES;
    return index->fields && index->levels && index->errors && index->scales && index->frames && index->exact_later;
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
    tetlodi_put(&buffer, header->index_size, 4);
    tetlodi_put(&buffer, header->index_crc, 4);
    tetlodi_put(&buffer, 0, 4); // reserved
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
    if (major < FORMAT_MAJOR)
        return tetlodi_fail(error, TETLOD_ERR_VERSION,
                            "format %u.%u is the layout from before the first release; build the stream again", major, minor);
    if (major != FORMAT_MAJOR)
        return tetlodi_fail(error, TETLOD_ERR_VERSION, "format %u.%u, this program reads %d.x", major, minor, FORMAT_MAJOR);
    uint32_t required = (uint32_t)tetlodi_get(&in, 4);
    tetlodi_get(&in, 4); // optional features: none is known, any may be
    if (required)
        return tetlodi_fail(error, TETLOD_ERR_VERSION, "the stream needs features 0x%x, which this program lacks", required);
    header->index_size = (uint32_t)tetlodi_get(&in, 4);
    header->index_crc = (uint32_t)tetlodi_get(&in, 4);
    uint64_t reserved = tetlodi_get(&in, 4);
    header->file_size = tetlodi_get(&in, 8);
    memcpy(header->cid, tetlodi_get_block(&in, CID_SIZE), CID_SIZE);
    if (tetlodi_get(&in, 4) != 0 || reserved != 0 || header->index_size > MOST_INDEX ||
        header->file_size < HEADER_SIZE + (uint64_t)header->index_size)
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

static void put_scale(struct tetlodi_buffer *out, const struct tetlodi_scale *scale, int axes)
{
    int narrow = scale->original != scale->type;
    tetlodi_put(out, (scale->original == TETLOD_FLOAT64 ? SCALE_FLOAT64 : 0) | (narrow ? SCALE_NARROW : 0), 1);
    tetlodi_put(out, scale->bits, 1);
    for (int i = 0; i < axes && scale->bits; i++) {
        tetlodi_put_f64(out, scale->origin[i]);
        tetlodi_put_f64(out, scale->step[i]);
    }
}

static void put_frame(struct tetlodi_buffer *out, const struct tetlodi_frame *frame)
{
    tetlodi_put(out, frame->size, 4);
    tetlodi_put(out, frame->crc, 4);
}

void tetlodi_index_encode(const struct tetlodi_index *index, struct tetlodi_buffer *out)
{
    const struct tetlod_info *info = &index->info;
    tetlodi_put(out, info->vertices, 4);
    tetlodi_put(out, info->tets, 4);
    tetlodi_put(out, info->level_count, 4);
    tetlodi_put(out, info->field_count, 2);
    tetlodi_put(out, index->slowest, 1);
    tetlodi_put(out, 0, 1); // reserved
    for (int i = 0; i < 6; i++)
        tetlodi_put_f64(out, info->bounds[i / 3][i % 3]);
    tetlodi_put(out, info->degenerate_tets, 8);
    tetlodi_put(out, info->inverted_tets, 8);
    tetlodi_put(out, info->unused_points, 8);
    put_frame(out, &index->order);
    put_scale(out, &index->scales[0], 3);
    for (uint32_t f = 0; f < info->field_count; f++) {
        const struct tetlod_field *field = &info->fields[f];
        size_t length = strlen(field->name);
        put_scale(out, &index->scales[1 + f], 1);
        tetlodi_put(out, field->components, 1);
        tetlodi_put(out, (field->controlled ? FIELD_CONTROLLED : 0) | (index->exact_later[f] ? FIELD_EXACT_LATER : 0), 1);
        tetlodi_put_f64(out, field->range[0]);
        tetlodi_put_f64(out, field->range[1]);
        tetlodi_put(out, length, 2);
        tetlodi_put_block(out, field->name, length);
    }
    for (uint32_t k = 0; k < info->level_count; k++) {
        const struct tetlod_level *level = &info->levels[k];
        tetlodi_put(out, level->vertices, 4);
        tetlodi_put(out, level->tets, 4);
        tetlodi_put_f64(out, level->domain_error);
        for (uint32_t i = 0; i < info->field_count * TETLOD_MEASURES; i++)
            tetlodi_put_f64(out, level->errors[i]);
        for (uint32_t i = 0; i <= info->field_count; i++)
            put_frame(out, &index->frames[(size_t)k * (info->field_count + 1) + i]);
    }
    tetlodi_put(out, info->metadata_size, 4);
    tetlodi_put_block(out, info->metadata, info->metadata_size);
}

static bool valid_scale(const struct tetlodi_scale *scale, int axes)
{
    for (int i = 0; i < axes && scale->bits; i++) {
        double last = scale->origin[i] + scale->step[i] * (double)((UINT32_C(1) << scale->bits) - 1);
        last = scale->type == TETLOD_FLOAT32 ? (double)(float)last : last;
        if (!isfinite(scale->origin[i]) || !(scale->step[i] > 0) || !isfinite(last))
            return false;
    }
    return true;
}

/* The tail (SPEC 9.3): no mesh, and a frame for each field that it makes exact. */
static const char *contradictory_tail(const struct tetlodi_index *index)
{
    const struct tetlod_info *info = &index->info;
    const struct tetlodi_frame *frames = &index->frames[(size_t)(info->level_count - 1) * (info->field_count + 1)];
    if (index->tail && frames[0].size)
        return "a tail with a mesh of its own";
    for (uint32_t f = 0; f < info->field_count; f++)
        if ((index->exact_later[f] && (!index->tail || !index->scales[1 + f].bits)) ||
            (index->tail && !index->exact_later[f] && frames[1 + f].size))
            return "an exact tail that does not go with its fields";
    return NULL;
}

/* What every index must be, beyond being complete. */
static const char *contradiction(const struct tetlodi_index *index)
{
    const struct tetlod_info *info = &index->info;
    for (int i = 0; i < 3; i++)
        if (!(isfinite(info->bounds[0][i]) && isfinite(info->bounds[1][i]) && info->bounds[0][i] <= info->bounds[1][i]))
            return "bounds that are none";
    for (uint32_t f = 0; f <= info->field_count; f++) {
        const struct tetlodi_scale *scale = &index->scales[f];
        if ((unsigned)scale->original > TETLOD_FLOAT64 || scale->type > scale->original || scale->bits > MOST_BITS ||
            !valid_scale(scale, f ? 1 : 3))
            return "numbers of an unknown kind";
    }
    for (uint32_t f = 0; f < info->field_count; f++) {
        const struct tetlod_field *field = &info->fields[f];
        if (field->components < 1 || field->components > MOST_COMPONENTS)
            return "a field of too many components or none";
        if (!isfinite(field->range[0]) || !isfinite(field->range[1]) || field->range[0] > field->range[1])
            return "a field without a range";
    }
    uint32_t tail = index->tail ? info->level_count - 1 : TETLOD_NONE;
    for (uint32_t k = 0; k < info->level_count; k++) {
        const struct tetlod_level *level = &info->levels[k], *coarser = k ? level - 1 : NULL;
        if (coarser && k != tail && (level->vertices <= coarser->vertices || level->tets < coarser->tets))
            return "levels that do not grow";
        uint64_t most = MOST_EXPANSION * (1 + (uint64_t)index->frames[(size_t)k * (info->field_count + 1)].size);
        if (level->vertices - (coarser ? coarser->vertices : 0) > most || level->tets - (coarser ? coarser->tets : 0) > most)
            return "levels of more than their bytes can hold";
        for (uint32_t i = 0; i < info->field_count * TETLOD_MEASURES; i++)
            if (level->errors[i] < 0 || (coarser && level->errors[i] > coarser->errors[i]))
                return "errors that grow with the level";
    }
    const struct tetlod_level *finest = &info->levels[info->level_count - 1];
    if (finest->vertices != info->vertices || finest->tets != info->tets || info->tets == 0)
        return "levels that do not lead to the original";
    if (info->vertices == UINT32_MAX || info->tets > MOST_TETS)
        return "more vertices or tetrahedra than a stream can hold";
    return contradictory_tail(index);
}

static void get_scale(struct tetlodi_bytes *in, struct tetlodi_scale *scale, int axes)
{
    unsigned type = (unsigned)tetlodi_get(in, 1);
    scale->original = (enum tetlod_type)(type == 3 ? TETLOD_FLOAT64 : type); // 2, and what is above 3, is refused later
    scale->type = type == 3 ? TETLOD_FLOAT32 : scale->original;
    scale->bits = (unsigned)tetlodi_get(in, 1);
    for (int i = 0; i < axes && scale->bits; i++) {
        scale->origin[i] = tetlodi_get_f64(in);
        scale->step[i] = tetlodi_get_f64(in);
    }
}

static void get_frame(struct tetlodi_bytes *in, struct tetlodi_frame *frame, uint64_t *offset)
{
    frame->offset = *offset;
    frame->size = (uint32_t)tetlodi_get(in, 4);
    frame->crc = (uint32_t)tetlodi_get(in, 4);
    *offset += frame->size;
}

static void decode_levels(struct tetlodi_index *index, struct tetlodi_bytes *in, uint64_t offset)
{
    struct tetlod_info *info = &index->info;
    for (uint32_t k = 0; k < info->level_count; k++) {
        struct tetlod_level *level = &index->levels[k];
        level->vertices = (uint32_t)tetlodi_get(in, 4);
        level->tets = (uint32_t)tetlodi_get(in, 4);
        level->domain_error = tetlodi_get_f64(in);
        for (uint32_t i = 0; i < info->field_count * TETLOD_MEASURES; i++)
            index->errors[(size_t)k * info->field_count * TETLOD_MEASURES + i] = tetlodi_get_f64(in);
        level->offset = offset;
        for (uint32_t i = 0; i <= info->field_count; i++)
            get_frame(in, &index->frames[(size_t)k * (info->field_count + 1) + i], &offset);
        level->end = offset;
    }
    const struct tetlod_level *last = &info->levels[info->level_count - 1];
    index->tail = info->level_count > 1 && last->vertices == last[-1].vertices && last->tets == last[-1].tets;
    index->order.offset = offset;
    info->bytes = offset + index->order.size;
    info->keeps_order = index->order.size > 0;
}

/* A copy of `size` bytes with a NUL behind, in the index's text. */
static const char *get_text(struct tetlodi_bytes *in, size_t size, char **text)
{
    const uint8_t *bytes = tetlodi_get_block(in, size);
    char *start = *text;
    if (bytes)
        memcpy(start, bytes, size);
    *text += bytes ? size : 0;
    *(*text)++ = 0;
    return start;
}

/* False: a name that is none. */
static bool decode_fields(struct tetlodi_index *index, struct tetlodi_bytes *in, char **text)
{
    struct tetlod_info *info = &index->info;
    bool named = true;
    for (uint32_t f = 0; f < info->field_count; f++) {
        struct tetlod_field *field = &index->fields[f];
        get_scale(in, &index->scales[1 + f], 1);
        field->type = index->scales[1 + f].original;
        field->components = (uint32_t)tetlodi_get(in, 1);
        unsigned flags = (unsigned)tetlodi_get(in, 1);
        field->controlled = (flags & FIELD_CONTROLLED) != 0;
        index->exact_later[f] = (flags & FIELD_EXACT_LATER) != 0;
        field->range[0] = tetlodi_get_f64(in);
        field->range[1] = tetlodi_get_f64(in);
        info->lossless &= index->scales[1 + f].bits == 0 || index->exact_later[f];
        size_t size = (size_t)tetlodi_get(in, 2);
        field->name = get_text(in, size, text);
        named &= size && !in->failed && tetlodi_plain_text(field->name, size);
    }
    return named;
}

enum tetlod_status tetlodi_index_decode(struct tetlodi_index *index, const void *bytes, size_t size,
                                        uint64_t first_offset, struct tetlod_error *error)
{
    struct tetlodi_bytes in = {bytes, size, false};
    struct tetlod_info *info = &index->info;
    *index = (struct tetlodi_index){0};
    info->vertices = (uint32_t)tetlodi_get(&in, 4);
    info->tets = (uint32_t)tetlodi_get(&in, 4);
    info->level_count = (uint32_t)tetlodi_get(&in, 4);
    info->field_count = (uint32_t)tetlodi_get(&in, 2);
    index->slowest = (unsigned)tetlodi_get(&in, 1);
    uint64_t reserved = tetlodi_get(&in, 1), after = 0;
    for (int i = 0; i < 6; i++)
        info->bounds[i / 3][i % 3] = tetlodi_get_f64(&in);
    info->degenerate_tets = tetlodi_get(&in, 8);
    info->inverted_tets = tetlodi_get(&in, 8);
    info->unused_points = tetlodi_get(&in, 8);
    get_frame(&in, &index->order, &after);
    // a level takes 24 bytes and 40 a field, a field 22: what is left bounds what is allocated
    uint64_t least = (uint64_t)info->level_count * (24 + 40 * (uint64_t)info->field_count) + 22 * (uint64_t)info->field_count;
    if (in.failed || reserved || index->slowest < LEAST_SLOWEST || index->slowest > MOST_SLOWEST ||
        info->field_count > MOST_FIELDS || !info->level_count || info->level_count > MOST_LEVELS || least > in.left)
        return tetlodi_fail(error, TETLOD_ERR_STREAM, "the index is damaged");
    index->text = malloc(size + info->field_count + 2);
    if (!tetlodi_index_allocate(index) || !index->text) {
        tetlodi_index_fini(index);
        return tetlodi_fail_nomem(error, "the index", size);
    }
    char *text = index->text;
    get_scale(&in, &index->scales[0], 3);
    info->position_type = index->scales[0].original;
    info->lossless = index->scales[0].bits == 0;
    bool named = decode_fields(index, &in, &text);
    decode_levels(index, &in, first_offset);
    info->metadata_size = (size_t)tetlodi_get(&in, 4);
    info->metadata_size = info->metadata_size > MOST_METADATA ? MOST_METADATA : info->metadata_size;
    info->metadata = get_text(&in, info->metadata_size, &text);
    const char *wrong = in.failed ? "less than it should" : in.left ? "more than it should" : named ? contradiction(index) : "a field without a name";
    if (!wrong)
        return TETLOD_OK;
    tetlodi_index_fini(index);
    return tetlodi_fail(error, TETLOD_ERR_STREAM, "the index is damaged: it has %s", wrong);
}
