/* SPDX-License-Identifier: BSD-3-Clause */
#include "format/read/parts.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "format/coding/time_table.h"
#include "format/fail.h"

enum { PIECE = 1 << 16 };

/* Header and index end where the first section or the first level begins. */
static uint64_t head_size(const struct tetlodi_index *index)
{
    uint64_t end = index->info.levels[0].offset;
    for (uint32_t i = 0; i < index->info.section_count; i++)
        if (index->sections[i].frame.offset < end)
            end = index->sections[i].frame.offset;
    return end;
}

static int by_offset(const void *a, const void *b)
{
    const struct tetlodi_frame *one = a, *other = b;
    return one->offset < other->offset ? -1 : one->offset > other->offset;
}

/* Its groups have digests of their own. */
static bool has_groups(const struct tetlodi_section *section)
{
    static const char *const tags[] = {TAG_STEP_VALUES, TAG_CELL_STEPS, TAG_PARENT_STEPS};
    bool found = false;
    for (size_t i = 0; i < sizeof tags / sizeof *tags; i++)
        found |= strcmp(section->tag, tags[i]) == 0;
    return found;
}

enum tetlod_status tetlodi_parts(const struct tetlod_file *file, const struct tetlod_series *series,
                                 struct tetlodi_frame **out, size_t *out_count, struct tetlod_error *error)
{
    const struct tetlodi_index *index = &file->index;
    size_t frames = 0, used = 0;
    for (uint32_t level = 0; level < index->info.level_count; level++)
        frames += tetlodi_frame_count(index, level);
    size_t most = 1 + frames + index->info.section_count + (series ? tetlodi_series_parts(series, NULL) : 0);
    struct tetlodi_frame *parts = malloc(most * sizeof *parts);
    *out = parts;
    *out_count = 0;
    if (!parts)
        return tetlodi_fail_nomem(error, "the parts of a stream", most * sizeof *parts);
    parts[used++] = (struct tetlodi_frame){0, head_size(index), {0}}; // the content id is its digest
    for (uint32_t level = 0, part; level < index->info.level_count; level++)
        for (size_t i = 0; i < tetlodi_frame_count(index, level); i++) {
            parts[used] = tetlodi_frame_at(index, level, i, &part);
            used += parts[used].size > 0;
        }
    for (uint32_t i = 0; i < index->info.section_count; i++)
        if (index->sections[i].frame.size && !(series && has_groups(&index->sections[i])))
            parts[used++] = index->sections[i].frame;
    if (series)
        used += tetlodi_series_parts(series, parts + used);
    qsort(parts, used, sizeof *parts, by_offset);
    *out_count = used;
    return TETLOD_OK;
}

static enum tetlod_status fail_part(const struct tetlodi_frame *part, struct tetlod_error *error)
{
    tetlodi_fail(error, TETLOD_ERR_CHECKSUM, "bytes %llu to %llu do not match their digest",
                 (unsigned long long)part->offset, (unsigned long long)(part->offset + part->size));
    if (error)
        error->offset = part->offset;
    return TETLOD_ERR_CHECKSUM;
}

static enum tetlod_status read_piece(const struct tetlod_file *file, uint64_t offset, void *out, size_t size,
                                     struct tetlod_error *error)
{
    if (offset + size > file->source.size)
        return tetlodi_fail(error, TETLOD_ERR_TRUNCATED,
                            "the stream ends at byte %llu, before byte %llu that it should have",
                            (unsigned long long)file->source.size, (unsigned long long)(offset + size));
    enum tetlod_status status = file->source.read(file->source.opaque, offset, out, size);
    return status == TETLOD_OK ? status
                               : tetlodi_fail(error, status, "cannot read %zu bytes at %llu of the stream", size,
                                              (unsigned long long)offset);
}

/* Header and index are those that the stream was opened with, to the last byte. */
static enum tetlod_status check_head(const struct tetlod_file *file, const struct tetlodi_frame *head,
                                     struct tetlod_error *error)
{
    struct tetlodi_header header;
    uint8_t cid[DIGEST_SIZE];
    char text[2 * DIGEST_SIZE + 1] = "";
    uint8_t *bytes = malloc((size_t)head->size);
    if (!bytes)
        return tetlodi_fail_nomem(error, "the index", head->size);
    enum tetlod_status status = read_piece(file, 0, bytes, (size_t)head->size, error);
    if (status == TETLOD_OK) {
        bool good = tetlodi_header_decode(&header, bytes, NULL) == TETLOD_OK;
        tetlodi_content_id(bytes, bytes + HEADER_SIZE, (size_t)head->size - HEADER_SIZE, cid);
        for (int i = 0; i < DIGEST_SIZE; i++)
            snprintf(text + 2 * i, 3, "%02x", cid[i]);
        good = good && memcmp(header.cid, cid, sizeof cid) == 0 && strcmp(text, file->index.info.cid) == 0;
        status = good ? status : fail_part(head, error);
    }
    free(bytes);
    return status;
}

enum tetlod_status tetlodi_check_part(const struct tetlod_file *file, const struct tetlodi_frame *part,
                                      struct tetlod_error *error)
{
    struct tetlodi_sha256 sha;
    uint8_t digest[32];
    if (part->offset == 0)
        return check_head(file, part, error);
    uint8_t *piece = malloc(PIECE);
    enum tetlod_status status = piece ? TETLOD_OK : tetlodi_fail_nomem(error, "a part of the stream", PIECE);
    tetlodi_sha256_init(&sha);
    for (uint64_t done = 0; status == TETLOD_OK && done < part->size;) {
        size_t size = part->size - done < PIECE ? (size_t)(part->size - done) : PIECE;
        status = read_piece(file, part->offset + done, piece, size, error);
        if (status == TETLOD_OK)
            tetlodi_sha256_add(&sha, piece, size);
        done += size;
    }
    free(piece);
    if (status != TETLOD_OK)
        return status;
    tetlodi_sha256_finish(&sha, digest);
    return memcmp(digest, part->digest, DIGEST_SIZE) == 0 ? TETLOD_OK : fail_part(part, error);
}
