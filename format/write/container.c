/* SPDX-License-Identifier: BSD-3-Clause */
#include "format/write/container.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "format/common/allowance.h"
#include "format/fail.h"

enum { LARGE_SECTION = 1 << 16 }; /* sections are packed from this size on; smaller ones stay plain to read */

/* Reads a section's source, in order. */
static enum tetlod_status pass_source(const struct tetlodi_write_section *in, const struct tetlodi_sink *to)
{
    uint8_t piece[1 << 14];
    for (size_t at = 0; at < in->size;) {
        size_t left = in->size - at, some = left < sizeof piece ? left : sizeof piece;
        TETLOD_TRY(in->source->read(in->source->opaque, at, piece, some));
        TETLOD_TRY(to->write(to->opaque, piece, some));
        at += some;
    }
    return TETLOD_OK;
}

static enum tetlod_status add_to_digest(void *opaque, const void *bytes, size_t size)
{
    tetlodi_sha256_add(opaque, bytes, size);
    return TETLOD_OK;
}

static enum tetlod_status frame_of_source(struct tetlodi_frame *frame, const struct tetlodi_write_section *in,
                                          struct tetlod_error *error)
{
    struct tetlodi_sha256 sha;
    uint8_t digest[32];
    tetlodi_sha256_init(&sha);
    enum tetlod_status status = pass_source(in, &(struct tetlodi_sink){add_to_digest, &sha});
    if (status != TETLOD_OK)
        return tetlodi_fail(error, status, "a section's bytes cannot be read");
    tetlodi_sha256_finish(&sha, digest);
    *frame = (struct tetlodi_frame){.size = in->size};
    memcpy(frame->digest, digest, DIGEST_SIZE);
    return TETLOD_OK;
}

/* Enters a section into the directory, packed if that is worth it. The order is range coded already: it stays as it is,
 * because it does not become smaller. */
static enum tetlod_status add_section(struct tetlodi_section *section, const struct tetlodi_write_section *in,
                                      struct tetlodi_buffer *stored, struct tetlod_error *error)
{
    bool packed = in->row != ROW_CODED && (in->row || in->size >= LARGE_SECTION) && 
                  tetlodi_pack(tetlodi_section_packing(in->tag), in->bytes, in->size, in->row ? in->row : 1, stored);
    if (strlen(in->tag) != TAG_SIZE)
        return tetlodi_fail(error, TETLOD_ERR_ARGUMENT, "a section's tag has %d letters, not '%.16s'", TAG_SIZE,
                            in->tag);
    if (!packed && in->row != ROW_CODED) {
        tetlodi_buffer_fini(stored);
        tetlodi_put_block(stored, in->bytes, in->size);
    }
    if (stored->failed)
        return tetlodi_fail_nomem(error, "a section", in->size);
    memcpy(section->tag, in->tag, TAG_SIZE);
    section->flags =
        (in->critical ? SECTION_CRITICAL : 0u) | (in->early ? SECTION_EARLY : 0u) | (packed ? SECTION_PACKED : 0u);
    section->plain = in->size;
    if (in->source)
        return frame_of_source(&section->frame, in, error);
    section->frame =
        in->row == ROW_CODED ? tetlodi_frame_of(in->bytes, in->size) : tetlodi_frame_of(stored->bytes, stored->size);
    return TETLOD_OK;
}

/* Offsets count from where the index ends, or the last level: they do not depend on how the index is packed. */
static void place_sections(struct tetlodi_index *index, uint64_t *early, uint64_t *late)
{
    *early = *late = 0;
    for (uint32_t i = 0; i < index->info.section_count; i++) {
        uint64_t *end = index->sections[i].flags & SECTION_EARLY ? early : late;
        index->sections[i].frame.offset = *end;
        *end += index->sections[i].frame.size;
    }
}

/* A bound that takes few bytes: the least number that is no less and has 16 binary or 3 decimal digits. The latter are
 * what people ask for: a level made for 1 % stays one. */
static double short_error(double error)
{
    static const double tens[] = {1e0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9, 1e10, 1e11, 1e12};
    int exponent, digits = 2;
    if (!(error > 0) || !isfinite(error))
        return error;
    double mantissa = frexp(error, &exponent), binary = ldexp(ceil(ldexp(mantissa, 16)),
                                                              exponent - 16), decimal = INFINITY;
    while (digits < 12 && error * tens[digits] < 100)
        digits++;
    for (double n = floor(error * tens[digits]); n <= 1000 && isinf(decimal); n++)
        if (n / tens[digits] >= error)
            decimal = n / tens[digits];
    return decimal < binary ? decimal : binary;
}

/* Bits of bounds do not compress. */
static void shorten_errors(struct tetlodi_index *index)
{
    size_t count = (size_t)index->info.level_count * index->info.field_count * TETLOD_MEASURES;
    for (uint32_t k = 0; k < index->info.level_count; k++)
        index->levels[k].domain_error = short_error(index->levels[k].domain_error);
    for (size_t i = 0; i < count; i++)
        index->errors[i] = short_error(index->errors[i]);
}

static size_t frame_count(const struct tetlodi_index *index)
{
    return index->info.level_count * (1 + (size_t)index->info.field_count);
}

/* Header and stored index, which is packed if that makes it smaller. */
static enum tetlod_status encode_head(struct tetlodi_index *index, uint8_t bytes[HEADER_SIZE],
                                      struct tetlodi_buffer *stored,
                                      struct tetlod_error *error)
{
    struct tetlodi_header header = {0};
    struct tetlodi_buffer packed = {0};
    uint64_t early, late;
    place_sections(index, &early, &late);
    shorten_errors(index);
    tetlodi_index_encode(index, stored);
    if (stored->failed)
        return tetlodi_fail_nomem(error, "the index", stored->size);
    if (stored->size > MAX_INDEX || early > MAX_EARLY)
        return tetlodi_fail(error, TETLOD_ERR_LIMIT, "the index or its sections are too large; use a larger --growth");
    header.index_plain = (uint32_t)stored->size;
    if (tetlodi_pack(PACKED_TABLE, stored->bytes, stored->size, tetlodi_index_row(index->info.field_count), &packed)) {
        tetlodi_buffer_fini(stored);
        *stored = packed;
    } else {
        tetlodi_buffer_fini(&packed);
    }
    header.index_size = (uint32_t)stored->size;
    header.early_size = (uint32_t)early;
    header.paged = index->pages.group_count > 0;
    header.file_size = tetlodi_header_head(&header) + late;
    for (size_t i = 0; i < frame_count(index); i++)
        header.file_size += index->frames[i].size;
    if (!is_within(tetlodi_level_rows(index), LEVEL_ROWS_FREE, LEVEL_ROWS_PER_BYTE, header.file_size))
        return tetlodi_fail(error, TETLOD_ERR_LIMIT,
                            "there are more levels than go with the stream's bytes; use a larger --growth");
    tetlodi_header_encode(&header, bytes);
    tetlodi_content_id(bytes, stored->bytes, stored->size, header.cid);
    tetlodi_header_encode(&header, bytes);
    return TETLOD_OK;
}

static enum tetlod_status put(const struct tetlodi_sink *sink, const void *bytes, size_t size)
{
    return size ? sink->write(sink->opaque, bytes, size) : TETLOD_OK;
}

static enum tetlod_status put_sections(const struct tetlodi_index *index, const struct tetlodi_write_section *in,
                                       const struct tetlodi_buffer *stored, uint32_t early,
                                       const struct tetlodi_sink *sink)
{
    for (uint32_t i = 0; i < index->info.section_count; i++)
        if ((index->sections[i].flags & SECTION_EARLY) == early)
            TETLOD_TRY(in[i].source              ? pass_source(&in[i], sink)
                       : in[i].row == ROW_CODED ? put(sink, in[i].bytes, in[i].size)
                                                : put(sink, stored[i].bytes, stored[i].size));
    return TETLOD_OK;
}

/* Of a level in pages each part is there page after page: its frames are shuffled together. */
static enum tetlod_status put_level(const struct tetlodi_index *index, uint32_t level,
                                    const struct tetlodi_buffer *frames, const struct tetlodi_sink *sink)
{
    size_t parts = 1 + (size_t)index->info.field_count, done[1 + MAX_FIELDS] = {0};
    for (size_t i = 0; i < tetlodi_frame_count(index, level); i++) {
        uint32_t part;
        const size_t size = (size_t)tetlodi_frame_at(index, level, i, &part).size;
        if (size)
            TETLOD_TRY(put(sink, frames[level * parts + part].bytes + done[part], size));
        done[part] += size;
    }
    return TETLOD_OK;
}

static enum tetlod_status put_all(struct tetlodi_index *index, const uint8_t header[HEADER_SIZE],
                                  const struct tetlodi_buffer *stored_index,
                                  const struct tetlodi_buffer *frames, const struct tetlodi_write_section *in,
                                  const struct tetlodi_buffer *sections, const struct tetlodi_sink *sink)
{
    TETLOD_TRY(put(sink, header, HEADER_SIZE));
    TETLOD_TRY(put(sink, stored_index->bytes, stored_index->size));
    TETLOD_TRY(put_sections(index, in, sections, SECTION_EARLY, sink));
    for (uint32_t level = 0; level < index->info.level_count; level++)
        TETLOD_TRY(put_level(index, level, frames, sink));
    return put_sections(index, in, sections, 0, sink);
}

enum tetlod_status tetlodi_container_write(struct tetlodi_index *index, const struct tetlodi_buffer *frames,
                                           const struct tetlodi_write_section *sections, uint32_t count,
                                           const struct tetlodi_sink *sink, struct tetlod_error *error)
{
    struct tetlodi_buffer *stored = calloc(count ? count : 1, sizeof *stored), head = {0};
    uint8_t header[HEADER_SIZE];
    enum tetlod_status status = TETLOD_OK;
    index->info.section_count = count;
    if (!tetlodi_index_allocate_sections(index) || !stored)
        TETLOD_TRY_DONE(tetlodi_fail_nomem(error, "the directory of sections", count * (uint64_t)SECTION_ENTRY));
    for (uint32_t i = 0; i < count; i++)
        TETLOD_TRY_DONE(add_section(&index->sections[i], &sections[i], &stored[i], error));
    TETLOD_TRY_DONE(encode_head(index, header, &head, error));
    status = put_all(index, header, &head, frames, sections, stored, sink);
    if (status != TETLOD_OK)
        tetlodi_fail(error, status, "cannot write the stream");
done:
    for (uint32_t i = 0; i < count && stored; i++)
        tetlodi_buffer_fini(&stored[i]);
    free(stored);
    tetlodi_buffer_fini(&head);
    return status;
}
