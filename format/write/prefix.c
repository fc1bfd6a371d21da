/* SPDX-License-Identifier: BSD-3-Clause */
#include "format/write/prefix.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "format/coding/topologies.h"
#include "format/fail.h"
#include "format/read/reader.h"
#include "format/read/cell_values.h"
#include "format/write/cells_write.h"
#include "format/write/container.h"

enum { COPIED = 1 << 20 };

struct part {
    struct tetlodi_index index; /* borrows from the file's, but for exact_later and the sections */
    struct tetlodi_buffer *frames;
    struct tetlodi_cell_parts cells;
    struct tetlodi_buffer pages;
    struct tetlodi_write_section *sections;
    void **section_bytes; /* [own_count] */
    uint32_t section_count, own_count;
};

static enum tetlod_status copy(const struct tetlod_file *file, const struct tetlodi_sink *sink,
                               struct tetlod_error *error)
{
    uint8_t *block = malloc(COPIED);
    enum tetlod_status status = block ? TETLOD_OK : tetlodi_fail_nomem(error, "a block of the stream", COPIED);
    for (uint64_t at = 0, size; status == TETLOD_OK && at < file->index.info.bytes; at += size) {
        size = file->index.info.bytes - at < COPIED ? file->index.info.bytes - at : COPIED;
        status = file->source.read(file->source.opaque, at, block, (size_t)size);
        if (status == TETLOD_OK)
            status = sink->write(sink->opaque, block, (size_t)size);
    }
    free(block);
    return status;
}

/* The metadata with the id of the whole in front. */
static enum tetlod_status mark(const struct tetlod_info *info, void **out, size_t *size, struct tetlod_error *error)
{
    const char *text = info->metadata && info->metadata[0] == '{' ? info->metadata + 1 : "}";
    const char *comma = text[strspn(text, " \t\r\n")] == '}' ? "" : ",";
    size_t room = strlen(text) + sizeof info->cid + 32;
    char *marked = malloc(room);
    if (!marked)
        return tetlodi_fail_nomem(error, "the metadata", room);
    *size = (size_t)snprintf(marked, room, "{\"part_of\":\"%s\"%s%s", info->cid, comma, text);
    *out = marked;
    return TETLOD_OK;
}

/* The values of the level's tetrahedra, which come first; of a file that is cut off, of those fields that are whole. */
static enum tetlod_status take_cells(struct part *part, const struct tetlod_file *file, struct tetlod_error *error)
{
    const struct tetlod_info *info = &file->index.info;
    struct tetlodi_write_cells *cells = calloc(info->cell_field_count + (size_t)1, sizeof *cells);
    uint32_t *parents = NULL, *numbers = malloc(sizeof *numbers * ((size_t)part->index.info.tets + 1)), count = 0;
    enum tetlod_status status = cells && numbers ? TETLOD_OK : tetlodi_fail_nomem(error, "values of tetrahedra",
                                                                                  part->index.info.tets * (uint64_t)4);
    for (uint32_t t = 0; status == TETLOD_OK && t < part->index.info.tets; t++)
        numbers[t] = t;
    for (uint32_t f = 0; status == TETLOD_OK && f < info->cell_field_count; f++) {
        const struct tetlod_cell_field *field = &info->cell_fields[f];
        double *values = malloc(sizeof *values * ((size_t)info->tets * field->components + 1));
        status = values ? tetlod_cells(file, f, values, error) : tetlodi_fail_nomem(error, "values of tetrahedra",
                                                                                    info->tets * (uint64_t)8);
        if (status == TETLOD_OK)
            cells[count++] = (struct tetlodi_write_cells){field->name, field->components, field->type, field->region,
                                                          values, field->quantum, field->error};
        else
            free(values);
        status = status == TETLOD_ERR_TRUNCATED ? TETLOD_OK : status;
    }
    if (status == TETLOD_OK && count)
        status = tetlodi_read_parents(file, &parents, error);
    const struct tetlodi_cells_input in = {cells, count, part->index.info.tets, numbers, parents};
    if (status == TETLOD_OK && !tetlodi_cells_encode(&part->cells, &in))
        status = tetlodi_fail_nomem(error, "values of tetrahedra", part->index.info.tets * (uint64_t)8);
    if (status == TETLOD_OK)
        part->section_count += tetlodi_cells_list(&part->cells, cells, part->sections + part->section_count);
    for (uint32_t f = 0; f < count; f++)
        free((void *)(uintptr_t)cells[f].values);
    free(cells);
    free(numbers);
    free(parents);
    return status;
}

/* The groups of pages that are left. */
static enum tetlod_status take_pages(struct part *part, struct tetlod_error *error)
{
    struct tetlodi_page_table *table = &part->index.pages;
    uint32_t levels = part->index.info.level_count - (part->index.tail ? 1 : 0), fields = part->index.info.field_count;
    table->group_count = levels > table->first_level && table->group_count ? levels - table->first_level : 0;
    if (!table->group_count)
        return TETLOD_OK;
    tetlodi_page_table_encode(table, table->group_count, fields, &part->pages);
    part->sections[part->section_count++] = (struct tetlodi_write_section){
        TAG_PAGES, .early = 1, .row = tetlodi_page_row(fields), .bytes = part->pages.bytes, .size = part->pages.size};
    return part->pages.failed ? tetlodi_fail_nomem(error, "the table of pages", part->pages.size) : TETLOD_OK;
}

static enum tetlod_status take_sections(struct part *part, const struct tetlod_file *file, struct tetlod_error *error)
{
    const struct tetlod_info *info = &file->index.info;
    size_t size = 0, most = info->section_count + (size_t)info->cell_field_count + 3;
    part->sections = calloc(most, sizeof *part->sections);
    part->section_bytes = calloc(most, sizeof *part->section_bytes);
    if (!part->sections || !part->section_bytes)
        return tetlodi_fail_nomem(error, "the directory of sections", most * sizeof *part->sections);
    TETLOD_TRY(mark(info, &part->section_bytes[part->own_count++], &size, error));
    part->sections[part->section_count++] =
        (struct tetlodi_write_section){.tag = TAG_METADATA, .early = 1, .bytes = part->section_bytes[0], .size = size};
    for (uint32_t i = 0; i < info->section_count; i++) {
        const struct tetlodi_section *from = &file->index.sections[i];
        if (!(from->flags & SECTION_EARLY) || strcmp(from->tag, TAG_METADATA) == 0 ||
            strcmp(from->tag, TAG_CELLS) == 0 || strcmp(from->tag, TAG_PARENTS) == 0 ||
            strcmp(from->tag, TAG_TOPOLOGIES) == 0 || strcmp(from->tag, TAG_PAGES) == 0)
            continue; // those behind the levels are about the finest one, or about other steps
        void *bytes = malloc((size_t)from->plain + 1);
        part->section_bytes[part->own_count++] = bytes;
        if (!bytes)
            return tetlodi_fail_nomem(error, "a section", from->plain);
        TETLOD_TRY(tetlod_section_read(file, i, bytes, error));
        part->sections[part->section_count++] =
            (struct tetlodi_write_section){.tag = from->tag,
                                           .critical = (from->flags & SECTION_CRITICAL) != 0,
                                           .early = 1,
                                           .bytes = bytes,
                                           .size = (size_t)from->plain};
    }
    TETLOD_TRY(take_pages(part, error));
    return take_cells(part, file, error);
}

static enum tetlod_status take_frames(struct part *part, const struct tetlod_file *file, struct tetlod_error *error)
{
    size_t parts = 1 + (size_t)file->index.info.field_count;
    part->frames = calloc(part->index.info.level_count * parts, sizeof *part->frames);
    if (!part->frames)
        return tetlodi_fail_nomem(error, "the frames", part->index.info.level_count * parts * sizeof *part->frames);
    for (uint32_t level = 0; level < part->index.info.level_count; level++)
        TETLOD_TRY(tetlodi_read_level(file, level, &part->frames[level * parts], error));
    return TETLOD_OK;
}

enum tetlod_status tetlodi_write_prefix(const struct tetlod_file *file, uint32_t level, const struct tetlodi_sink *sink,
                                        struct tetlod_error *error)
{
    const struct tetlod_info *info = &file->index.info;
    if (level >= info->level_count)
        return tetlodi_fail(error, TETLOD_ERR_ARGUMENT, "there is no level %u", level);
    if (level + 1 == info->level_count && file->source.size >= info->bytes)
        return copy(file, sink, error);
    struct part part = {.index = file->index};
    size_t parts = 1 + (size_t)info->field_count;
    enum tetlod_status status = TETLOD_OK;
    part.index.info.level_count = level + 1;
    part.index.info.vertices = info->levels[level].vertices;
    part.index.info.tets = info->levels[level].tets;
    part.index.sections = NULL;
    part.index.listed = NULL;
    part.index.exact_later = calloc(parts, sizeof *part.index.exact_later);
    if (!part.index.exact_later)
        TETLOD_TRY_DONE(tetlodi_fail_nomem(error, "the index", parts));
    if (level + 1 == info->level_count)
        memcpy(part.index.exact_later, file->index.exact_later, info->field_count * sizeof *part.index.exact_later);
    else
        part.index.tail = 0;
    TETLOD_TRY_DONE(take_sections(&part, file, error));
    TETLOD_TRY_DONE(take_frames(&part, file, error));
    status = tetlodi_container_write(&part.index, part.frames, part.sections, part.section_count, sink, error);
done:
    for (size_t i = 0; part.frames && i < (level + 1) * parts; i++)
        tetlodi_buffer_fini(&part.frames[i]);
    for (uint32_t i = 0; part.section_bytes && i < part.own_count; i++)
        free(part.section_bytes[i]);
    tetlodi_cell_parts_fini(&part.cells);
    tetlodi_buffer_fini(&part.pages);
    free(part.frames);
    free(part.sections);
    free(part.section_bytes);
    free(part.index.exact_later);
    free(part.index.sections);
    free(part.index.listed);
    return status;
}
