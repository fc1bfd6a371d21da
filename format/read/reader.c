/* SPDX-License-Identifier: BSD-3-Clause */
#include "format/read/reader.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "format/coding/cells.h"
#include "format/coding/order.h"
#include "format/coding/page_decode.h"
#include "format/coding/pointer.h"
#include "format/coding/topologies.h"
#include "format/common/allowance.h"
#include "format/common/arithmetic.h"
#include "format/common/checksum.h"
#include "format/common/pack.h"
#include "format/fail.h"

static const uint64_t DEFAULT_BYTES = (uint64_t)16 << 30;

struct tetlod_options tetlodi_options(const struct tetlod_options *options)
{
    struct tetlod_options all = {0};
    if (options)
        memcpy(&all, options, options->struct_size < sizeof all ? options->struct_size : sizeof all);
    all.struct_size = sizeof all;
    all.max_bytes = all.max_bytes ? all.max_bytes : DEFAULT_BYTES;
    return all;
}

uint64_t tetlodi_memory_limit(const struct tetlod_file *file)
{
    uint64_t most = limit_of(MEMORY_FREE, MEMORY_PER_BYTE, file->index.info.bytes);
    return most < file->options.max_bytes ? most : file->options.max_bytes;
}

/* Stored bytes of the source, in a block that the caller frees. */
static enum tetlod_status read_stored(const struct tetlod_file *file, uint64_t offset, uint64_t stored, uint8_t **out,
                                      struct tetlod_error *error)
{
    size_t size = (size_t)stored;
    *out = NULL;
    if (stored > file->options.max_bytes || stored > SIZE_MAX)
        return tetlodi_fail(error, TETLOD_ERR_LIMIT,
                            "a part of the stream has %llu bytes, more than the memory allowed",
                            (unsigned long long)stored);
    if (offset > file->source.size || size > file->source.size - offset) {
        enum tetlod_status status = tetlodi_fail(error, TETLOD_ERR_TRUNCATED,
                                                 "the stream ends at byte %llu, before byte %llu that it should have",
                                                 (unsigned long long)file->source.size,
                                                 (unsigned long long)(offset + size));
        if (error)
            error->offset = file->source.size;
        return status;
    }
    *out = malloc(size ? size : 1);
    if (!*out)
        return tetlodi_fail_nomem(error, "a part of the stream", size);
    enum tetlod_status status = size ? file->source.read(file->source.opaque, offset, *out, size) : TETLOD_OK;
    if (status != TETLOD_OK) {
        free(*out);
        *out = NULL;
        return tetlodi_fail(error, status, "cannot read %zu bytes at %llu of the stream", size,
                            (unsigned long long)offset);
    }
    return TETLOD_OK;
}

static enum tetlod_status fail_digest(const struct tetlodi_frame *frame, const char *what, struct tetlod_error *error)
{
    tetlodi_fail(error, TETLOD_ERR_CHECKSUM, "%s, bytes %llu to %llu: the checksum does not match", what,
                 (unsigned long long)frame->offset, (unsigned long long)(frame->offset + frame->size));
    if (error)
        error->offset = frame->offset;
    return TETLOD_ERR_CHECKSUM;
}

enum tetlod_status tetlodi_read_part(const struct tetlod_file *file, const struct tetlodi_frame *frame,
                                     const char *what, uint8_t **out, struct tetlod_error *error)
{
    uint8_t digest[DIGEST_SIZE];
    TETLOD_TRY(read_stored(file, frame->offset, frame->size, out, error));
    tetlodi_digest(*out, (size_t)frame->size, digest);
    if (memcmp(digest, frame->digest, sizeof digest) == 0)
        return TETLOD_OK;
    free(*out);
    *out = NULL;
    return fail_digest(frame, what, error);
}

enum tetlod_status tetlodi_read_frame(const struct tetlod_file *file, uint32_t level, uint32_t part, uint8_t **out,
                                      size_t *out_size, struct tetlod_error *error)
{
    const struct tetlod_info *info = &file->index.info;
    const struct tetlodi_frame *frame = &file->index.frames[(size_t)level * (info->field_count + 1) + part];
    char what[96];
    snprintf(what, sizeof what, "level %u, %.60s", level, part ? info->fields[part - 1].name : "the records");
    *out_size = (size_t)frame->size;
    return tetlodi_read_part(file, frame, what, out, error);
}

enum tetlod_status tetlodi_read_level(const struct tetlod_file *file, uint32_t level, struct tetlodi_buffer *parts,
                                      struct tetlod_error *error)
{
    char what[48];
    snprintf(what, sizeof what, "level %u", level);
    for (size_t i = 0; i < tetlodi_frame_count(&file->index, level); i++) {
        uint8_t *bytes;
        uint32_t part;
        const struct tetlodi_frame frame = tetlodi_frame_at(&file->index, level, i, &part);
        if (!frame.size)
            continue;
        TETLOD_TRY(tetlodi_read_part(file, &frame, what, &bytes, error));
        tetlodi_put_block(&parts[part], bytes, (size_t)frame.size);
        free(bytes);
        if (parts[part].failed)
            return tetlodi_fail_nomem(error, "a level", frame.size);
    }
    return TETLOD_OK;
}

enum tetlod_status tetlodi_read_page_frame(const struct tetlod_file *file, uint32_t level, uint32_t page, uint32_t part,
                                           uint8_t **out, size_t *out_size, struct tetlod_error *error)
{
    const struct tetlodi_index *index = &file->index;
    const struct tetlod_info *info = &index->info;
    const struct tetlodi_page_frame *frame =
        tetlodi_page_frame(&index->pages, info->field_count, tetlodi_group_of(&index->pages, level), page, part);
    struct tetlodi_frame bytes = {.offset = frame->offset, .size = frame->size};
    char what[96];
    memcpy(bytes.digest, frame->digest, DIGEST_SIZE);
    snprintf(what, sizeof what, "level %u, page %u, %.60s", level, page,
             part ? info->fields[part - 1].name : "the records");
    *out_size = frame->size;
    return tetlodi_read_part(file, &bytes, what, out, error);
}

/* ---- sections */

/* A section as it was before it was packed, with room for its bytes at `out`. */
static enum tetlod_status read_section_into(const struct tetlod_file *file, const struct tetlodi_section *section,
                                            uint8_t *out,
                                            struct tetlod_error *error)
{
    char what[32];
    uint8_t *stored;
    enum tetlod_status status = TETLOD_OK;
    snprintf(what, sizeof what, "section %s", section->tag);
    TETLOD_TRY(tetlodi_read_part(file, &section->frame, what, &stored, error));
    if (section->flags & SECTION_PACKED)
        status = tetlodi_unpack(stored, (size_t)section->frame.size, out, (size_t)section->plain, error);
    else
        memcpy(out, stored, (size_t)section->plain);
    free(stored);
    return status;
}

/* The same with a NUL behind, in a block that the caller frees. */
enum tetlod_status tetlodi_read_section(const struct tetlod_file *file, const struct tetlodi_section *section,
                                        uint8_t **out, struct tetlod_error *error)
{
    *out = NULL;
    if (section->plain >= file->options.max_bytes || section->plain >= SIZE_MAX)
        return tetlodi_fail(error, TETLOD_ERR_LIMIT, "section %s has %llu bytes, more than the memory allowed",
                            section->tag,
                            (unsigned long long)section->plain);
    uint8_t *bytes = malloc((size_t)section->plain + 1);
    if (!bytes)
        return tetlodi_fail_nomem(error, section->tag, section->plain);
    enum tetlod_status status = read_section_into(file, section, bytes, error);
    bytes[section->plain] = 0;
    if (status == TETLOD_OK)
        *out = bytes;
    else
        free(bytes);
    return status;
}

enum tetlod_status tetlod_section_read(const struct tetlod_file *file, uint32_t section, void *out,
                                       struct tetlod_error *error)
{
    if (section >= file->index.info.section_count)
        return tetlodi_fail(error, TETLOD_ERR_ARGUMENT, "there is no section number %u", section);
    return read_section_into(file, &file->index.sections[section], (uint8_t *)out, error);
}

enum tetlod_status tetlodi_read_tagged(const struct tetlod_file *file, const char *tag, uint8_t **out, size_t *out_size,
                                       struct tetlod_error *error)
{
    const struct tetlodi_section *section = tetlodi_section_find(file->index.sections, file->index.info.section_count,
                                                                 tag);
    *out = NULL;
    *out_size = section ? (size_t)section->plain : 0;
    return section ? tetlodi_read_section(file, section, out, error) : TETLOD_OK;
}

uint32_t tetlodi_component_count(const struct tetlod_info *info)
{
    uint32_t count = 0;
    for (uint32_t f = 0; f < info->field_count; f++)
        count += info->fields[f].components;
    return count;
}

uint32_t tetlod_section_index(const struct tetlod_info *info, const char *tag)
{
    for (uint32_t i = 0; i < info->section_count; i++)
        if (strcmp(info->sections[i].tag, tag) == 0)
            return i;
    return TETLOD_NONE;
}

enum tetlod_status tetlod_order(const struct tetlod_file *file, uint32_t *vertices, uint32_t *tets, uint8_t *corners,
                                struct tetlod_error *error)
{
    const struct tetlod_info *info = &file->index.info;
    const struct tetlodi_section *section = tetlodi_section_find(file->index.sections, info->section_count, TAG_ORDER);
    struct tetlodi_order order = {(uint32_t)info->vertices, (uint32_t)info->tets, vertices, tets, corners};
    struct tetlodi_coder coder;
    uint8_t *bytes;
    if (!section)
        return tetlodi_fail(error, TETLOD_ERR_ARGUMENT,
                            "the stream keeps no original order: build it with --keep-order");
    TETLOD_TRY(tetlodi_finest_held(&file->index, error));
    TETLOD_TRY(tetlodi_read_section(file, section, &bytes, error));
    tetlodi_decode_start(&coder, file->index.slowest, bytes, (size_t)section->plain);
    int good = tetlodi_order_code(&coder, &order);
    while (good && coder.at < coder.end)
        good = *coder.at++ == 0;
    free(bytes);
    return good ? TETLOD_OK : tetlodi_fail(error, TETLOD_ERR_STREAM, "the original order is damaged");
}

/* ---- opening */

static enum tetlod_status read_metadata(struct tetlod_file *file, struct tetlod_error *error)
{
    struct tetlod_info *info = &file->index.info;
    const struct tetlodi_section *section = tetlodi_section_find(file->index.sections, info->section_count,
                                                                 TAG_METADATA);
    uint8_t *bytes = NULL;
    info->metadata = "";
    if (!section)
        return TETLOD_OK;
    TETLOD_TRY(tetlodi_read_section(file, section, &bytes, error));
    file->index.metadata = (char *)bytes;
    info->metadata = file->index.metadata;
    info->metadata_size = (size_t)section->plain;
    return TETLOD_OK;
}

/* Decodes the first section with a tag, if there is one, into the index. */
static enum tetlod_status read_table(struct tetlod_file *file, const char *tag,
                                     enum tetlod_status (*decode)(struct tetlodi_index *, const uint8_t *, size_t,
                                                                  struct tetlod_error *),
                                     struct tetlod_error *error)
{
    const struct tetlodi_section *section = tetlodi_section_find(file->index.sections, file->index.info.section_count,
                                                                 tag);
    uint8_t *bytes = NULL;
    if (!section)
        return TETLOD_OK;
    TETLOD_TRY(tetlodi_read_section(file, section, &bytes, error));
    enum tetlod_status status = decode(&file->index, bytes, (size_t)section->plain, error);
    free(bytes);
    return status;
}

/* Where the frames of a group's pages are. */
static void place_frames(const struct tetlodi_page_table *table, uint32_t parts, const struct tetlodi_group *group,
                         uint64_t offset)
{
    for (size_t i = 0; i < (size_t)parts * group->page_count; i++) {
        const struct tetlodi_page_place place = tetlodi_page_place(i, group->page_count, parts);
        struct tetlodi_page_frame *frame = tetlodi_page_frame(table, parts - 1, group, place.page, place.part);
        frame->offset = offset;
        offset += frame->size;
    }
}

/* Do the pages of a group give the level and its frames? */
static bool goes_with_level(const struct tetlodi_index *index, uint32_t g)
{
    static const uint8_t none[DIGEST_SIZE] = {0};
    const struct tetlodi_page_table *table = &index->pages;
    const struct tetlodi_group *group = &table->groups[g];
    uint32_t fields = index->info.field_count, level = table->first_level + g;
    const struct tetlod_level *to = &index->info.levels[level];
    uint64_t vertices = to[-1].vertices, tets = to[-1].tets;
    for (uint32_t p = 0; p < group->page_count; p++) {
        vertices += table->pages[group->first_page + p].vertices;
        tets += table->pages[group->first_page + p].tets;
    }
    for (uint32_t part = 0; part <= fields; part++) {
        const struct tetlodi_frame *whole = &index->frames[(size_t)level * (1 + (size_t)fields) + part];
        uint64_t size = 0;
        for (uint32_t p = 0; p < group->page_count; p++)
            size += tetlodi_page_frame(table, fields, group, p, part)->size;
        if (size != whole->size || memcmp(whole->digest, none, DIGEST_SIZE) != 0)
            return false;
    }
    return vertices == to->vertices && tets == to->tets;
}

/* Why the pages do not go with the levels, or NULL. */
static const char *wrong_pages(const struct tetlodi_index *index)
{
    const struct tetlodi_page_table *table = &index->pages;
    uint64_t bytes = 0;
    for (uint32_t level = 0; level < index->info.level_count; level++) {
        const struct tetlodi_group *group = tetlodi_group_of(table, level);
        bytes += index->frames[(size_t)level * (1 + (size_t)index->info.field_count)].size;
        if (group && !goes_with_level(index, level - table->first_level))
            return "pages that do not give their level";
        if (group && !tetlodi_pages_hold(group->first_page + (uint64_t)group->page_count, bytes))
            return "more pages than go with its bytes";
        if (group)
            place_frames(table, 1 + index->info.field_count, group, index->info.levels[level].offset);
    }
    return NULL;
}

/* Decodes the table of pages into the index. */
static enum tetlod_status decode_pages(struct tetlodi_index *index, const uint8_t *bytes, size_t size,
                                       struct tetlod_error *error)
{
    uint32_t levels = index->info.level_count - (index->tail ? 1 : 0);
    TETLOD_TRY(tetlodi_page_table_decode(&index->pages, levels, index->info.field_count, bytes, size, error));
    const char *wrong = wrong_pages(index);
    return wrong ? tetlodi_fail(error, TETLOD_ERR_STREAM, "the table of pages is damaged: it has %s",
                                wrong) : TETLOD_OK;
}

/* The index's bytes are checked by the content id, in which the header is as well. */
static enum tetlod_status read_index(struct tetlod_file *file, const struct tetlodi_header *header,
                                     const uint8_t raw_header[HEADER_SIZE], struct tetlod_error *error)
{
    uint8_t *stored = NULL, *index = NULL, cid[DIGEST_SIZE];
    enum tetlod_status status;
    TETLOD_TRY_DONE(read_stored(file, HEADER_SIZE, header->index_size, &stored, error));
    tetlodi_content_id(raw_header, stored, header->index_size, cid);
    if (memcmp(cid, header->cid, sizeof cid) != 0)
        TETLOD_TRY_DONE(tetlodi_fail(error, TETLOD_ERR_CHECKSUM,
                                     "the index is damaged: the content id is not that of header and index"));
    TETLOD_TRY_DONE(tetlodi_index_unpack(header, stored, &index, error));
    TETLOD_TRY_DONE(tetlodi_index_decode(&file->index, index, header->index_plain,
                                         HEADER_SIZE + (uint64_t)header->index_size, error));
    if (file->index.info.bytes != header->file_size || file->index.info.levels[0].offset != tetlodi_header_head(header))
        TETLOD_TRY_DONE(tetlodi_fail(error, TETLOD_ERR_STREAM, "the header and the index disagree about sizes"));
    if (file->source.size > header->file_size)
        TETLOD_TRY_DONE(tetlodi_fail(error, TETLOD_ERR_STREAM, "%llu bytes follow the end of the stream",
                                     (unsigned long long)(file->source.size - header->file_size)));
    for (int i = 0; i < DIGEST_SIZE; i++)
        snprintf(file->index.info.cid + 2 * i, 3, "%02x", cid[i]);
    file->index_bytes =
        header->index_plain + file->index.info.level_count * sizeof *file->index.levels +
        file->index.info.level_count * (1 + (uint64_t)file->index.info.field_count) * sizeof *file->index.frames;
    TETLOD_TRY_DONE(read_metadata(file, error));
    TETLOD_TRY_DONE(read_table(file, TAG_CELLS, tetlodi_cells_decode, error));
    TETLOD_TRY_DONE(read_table(file, TAG_PARENTS, tetlodi_parents_decode, error));
    TETLOD_TRY_DONE(read_table(file, TAG_TOPOLOGIES, tetlodi_topologies_decode, error));
    TETLOD_TRY_DONE(read_table(file, TAG_PAGES, decode_pages, error));
    if (header->paged != (file->index.pages.group_count > 0))
        TETLOD_TRY_DONE(tetlodi_fail(error, TETLOD_ERR_STREAM, "the header and the index disagree about pages"));
    file->index_bytes += tetlodi_page_table_bytes(&file->index.pages, file->index.info.field_count);
    file->index.info.page_count = file->index.pages.page_count;
    file->index.info.first_paged_level = file->index.pages.first_level;
    file->index.info.exact_last = file->index.tail;
done:
    free(index);
    free(stored);
    return status;
}

static enum tetlod_status read_part_of(void *opaque, uint64_t offset, void *buffer, size_t size)
{
    const struct tetlodi_part *part = opaque;
    return part->whole.read(part->whole.opaque, part->offset + offset, buffer, size);
}

struct tetlod_source tetlodi_part_source(struct tetlodi_part *part, uint64_t size)
{
    uint64_t there = part->whole.size > part->offset ? part->whole.size - part->offset : 0;
    return (struct tetlod_source){read_part_of, part, there < size ? there : size};
}

/* Reads what a stream begins with. */
static enum tetlod_status read_header(struct tetlod_file *file, uint8_t **out, struct tetlod_error *error)
{
    if (file->source.size < HEADER_SIZE)
        return tetlodi_fail(error, file->source.size ? TETLOD_ERR_TRUNCATED : TETLOD_ERR_NOT_TETLOD,
                            "%llu bytes are less than a stream's header", (unsigned long long)file->source.size);
    return read_stored(file, 0, HEADER_SIZE, out, error);
}

/* Goes to the stream in an HDF5 file (SPEC 3.10), whose first bytes are in *bytes; then they are the stream's. */
static enum tetlod_status enter_stream(struct tetlod_file *file, uint8_t **bytes, struct tetlodi_pointer *pointer,
                                       struct tetlod_error *error)
{
    TETLOD_TRY(tetlodi_pointer_decode(pointer, *bytes, error));
    file->part = calloc(1, sizeof *file->part);
    if (!file->part)
        return tetlodi_fail_nomem(error, "a stream", sizeof *file->part);
    *file->part = (struct tetlodi_part){.whole = file->source, .offset = pointer->offset};
    file->source = tetlodi_part_source(file->part, pointer->size);
    free(*bytes);
    *bytes = NULL;
    return read_header(file, bytes, error);
}

enum tetlod_status tetlod_open(struct tetlod_file **out, const struct tetlod_source *source,
                               const struct tetlod_options *options, struct tetlod_error *error)
{
    struct tetlodi_header header;
    struct tetlodi_pointer pointer = {0};
    uint8_t *bytes = NULL;
    struct tetlod_file *file = calloc(1, sizeof *file);
    *out = NULL;
    if (!file)
        return tetlodi_fail_nomem(error, "a stream", sizeof *file);
    file->source = *source;
    file->options = tetlodi_options(options);
    enum tetlod_status status;
    if (!tetlodi_arithmetic_holds())
        TETLOD_TRY_DONE(tetlodi_fail(error, TETLOD_ERR_ARGUMENT,
                                     "this program rounds in its own way: compile tetlod without options such as "
                                     "-ffp-contract=fast, and leave the rounding mode alone"));
    TETLOD_TRY_DONE(read_header(file, &bytes, error));
    if (tetlodi_pointer_is(bytes))
        TETLOD_TRY_DONE(enter_stream(file, &bytes, &pointer, error));
    TETLOD_TRY_DONE(tetlodi_header_decode(&header, bytes, error));
    TETLOD_TRY_DONE(read_index(file, &header, bytes, error));
    if (pointer.size && pointer.size != header.file_size)
        TETLOD_TRY_DONE(tetlodi_fail(error, TETLOD_ERR_STREAM,
                                     "the pointer to the stream says %llu bytes, and the stream %llu",
                                     (unsigned long long)pointer.size, (unsigned long long)header.file_size));
    file->index.info.stream_offset = pointer.offset;
    *out = file;
done:
    free(bytes);
    if (status != TETLOD_OK)
        tetlod_close(file);
    return status;
}

static enum tetlod_status read_memory(void *opaque, uint64_t offset, void *buffer, size_t size)
{
    memcpy(buffer, (const uint8_t *)opaque + offset, size);
    return TETLOD_OK;
}

enum tetlod_status tetlod_open_memory(struct tetlod_file **out, const void *bytes, size_t size,
                                      const struct tetlod_options *options, struct tetlod_error *error)
{
    union {
        const void *in;
        void *out;
    } opaque = {bytes}; // the source's pointer is not const because other sources' is not; it is only read
    struct tetlod_source source = {read_memory, opaque.out, size};
    return tetlod_open(out, &source, options, error);
}

void tetlod_close(struct tetlod_file *file)
{
    if (!file)
        return;
    tetlodi_index_fini(&file->index);
    free(file->part);
    free(file);
}

/* ---- choosing */

const struct tetlod_info *tetlod_info(const struct tetlod_file *file)
{
    return &file->index.info;
}

/* What an error is compared with: a fraction of the range, or in the field's units. */
enum unit { FRACTION, FIELD_UNITS };

static int level_holds(const struct tetlod_info *info, uint32_t level, double error, enum unit unit, uint32_t field,
                       enum tetlod_measure measure)
{
    int any = 0;
    for (uint32_t f = 0; f < info->field_count; f++) {
        if (field == TETLOD_NONE ? !info->fields[f].controlled : f != field)
            continue;
        any = 1;
        double range = unit == FIELD_UNITS ? info->fields[f].range[1] - info->fields[f].range[0] : 1;
        if (!(info->levels[level].errors[f * TETLOD_MEASURES + measure] * range <= error))
            return 0;
    }
    return any;
}

static uint32_t coarsest_within(const struct tetlod_info *info, double error, enum unit unit, uint32_t field,
                                enum tetlod_measure measure)
{
    for (uint32_t k = 0; k < info->level_count; k++)
        if (level_holds(info, k, error, unit, field, measure))
            return k;
    return TETLOD_NONE;
}

uint32_t tetlod_level_for_error(const struct tetlod_info *info, double error, uint32_t field,
                                enum tetlod_measure measure)
{
    return coarsest_within(info, error, FRACTION, field, measure);
}

uint32_t tetlod_level_for_abs_error(const struct tetlod_info *info, double error, uint32_t field,
                                    enum tetlod_measure measure)
{
    return coarsest_within(info, error, FIELD_UNITS, field, measure);
}

uint32_t tetlod_level_for_tets(const struct tetlod_info *info, uint64_t tets)
{
    uint32_t k = info->level_count - 1;
    while (k > 0 && info->levels[k].tets > tets)
        k--;
    return k;
}

uint32_t tetlod_level_for_bytes(const struct tetlod_info *info, uint64_t bytes)
{
    uint32_t k = info->level_count - 1;
    while (k > 0 && info->levels[k].end > bytes)
        k--;
    return k;
}
