/* SPDX-License-Identifier: BSD-3-Clause */
#include "format/coding/index.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "format/common/allowance.h"
#include "format/common/round.h"
#include "format/common/utf8.h"
#include "format/fail.h"

enum { FIELD_CONTROLLED = 1, FIELD_EXACT_LATER = 2, FIELD_BOUND = 4, SCALE_FLOAT64 = 1, SCALE_NARROW = 2 };
enum { LEVEL_BYTES = 48, LEVEL_FIELD_BYTES = 56, FIELD_BYTES = 22 };

void tetlodi_index_fini(struct tetlodi_index *index)
{
    free(index->fields);
    free(index->levels);
    free(index->errors);
    free(index->scales);
    free(index->frames);
    free(index->exact_later);
    free(index->sections);
    free(index->listed);
    free(index->text);
    free(index->metadata);
    free(index->cells);
    free(index->cell_names);
    free(index->topologies);
    free(index->times);
    tetlodi_page_table_fini(&index->pages);
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

bool tetlodi_index_allocate_sections(struct tetlodi_index *index)
{
    size_t count = index->info.section_count;
    index->sections = calloc(count ? count : 1, sizeof *index->sections);
    index->listed = calloc(count ? count : 1, sizeof *index->listed);
    index->info.sections = index->listed;
    return index->sections && index->listed;
}

uint32_t tetlodi_index_row(uint32_t field_count)
{
    return LEVEL_BYTES + LEVEL_FIELD_BYTES * field_count;
}

uint64_t tetlodi_part_numbers(const struct tetlodi_index *index, uint32_t level, uint32_t part)
{
    const struct tetlod_level *to = &index->info.levels[level];
    if (!part)
        return to->vertices > to->tets ? to->vertices : to->tets;
    bool twice = index->tail && level + 1 == index->info.level_count && index->exact_later[part - 1];
    return (twice ? 2 : 1) * (uint64_t)to->vertices * index->info.fields[part - 1].components;
}

enum tetlod_status tetlodi_check_held(uint32_t level, uint64_t vertices, uint64_t tets, struct tetlod_error *error)
{
    if (vertices < TETLOD_NONE && tets <= MAX_HELD_TETS)
        return TETLOD_OK;
    return tetlodi_fail(error, TETLOD_ERR_LIMIT,
                        "level %u has %llu vertices and %llu tetrahedra; this library decodes levels of at most "
                        "4294967294 and 1073741824: take a coarser one, or fewer pages", level,
                        (unsigned long long)vertices, (unsigned long long)tets);
}

enum tetlod_status tetlodi_finest_held(const struct tetlodi_index *index, struct tetlod_error *error)
{
    return tetlodi_check_held(index->info.level_count - 1, index->info.vertices, index->info.tets, error);
}

size_t tetlodi_frame_count(const struct tetlodi_index *index, uint32_t level)
{
    const struct tetlodi_group *group = tetlodi_group_of(&index->pages, level);
    return (1 + (size_t)index->info.field_count) * (group ? group->page_count : 1);
}

struct tetlodi_frame tetlodi_frame_at(const struct tetlodi_index *index, uint32_t level, size_t i, uint32_t *out_part)
{
    const struct tetlodi_group *group = tetlodi_group_of(&index->pages, level);
    const uint32_t fields = index->info.field_count;
    *out_part = (uint32_t)i;
    if (!group)
        return index->frames[level * (1 + (size_t)fields) + i];
    const struct tetlodi_page_place place = tetlodi_page_place(i, group->page_count, 1 + fields);
    const struct tetlodi_page_frame *frame = tetlodi_page_frame(&index->pages, fields, group, place.page, place.part);
    struct tetlodi_frame out = {.offset = frame->offset, .size = frame->size};
    memcpy(out.digest, frame->digest, DIGEST_SIZE);
    *out_part = place.part;
    return out;
}

uint64_t tetlodi_step_rows(const struct tetlodi_index *index, uint32_t field, uint32_t level)
{
    const struct tetlod_level *of = &index->info.levels[level];
    return ((uint64_t)of->vertices + of->tets) * index->info.fields[field].components;
}

uint64_t tetlodi_level_rows(const struct tetlodi_index *index)
{
    uint64_t rows = 0;
    for (uint32_t k = 0; k < index->info.level_count; k++)
        rows += (uint64_t)index->info.levels[k].vertices + index->info.levels[k].tets;
    return rows;
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
    tetlodi_put(out, frame->size, 8);
    tetlodi_put_block(out, frame->digest, DIGEST_SIZE);
}

void tetlodi_index_encode(const struct tetlodi_index *index, struct tetlodi_buffer *out)
{
    const struct tetlod_info *info = &index->info;
    tetlodi_put(out, info->vertices, 8);
    tetlodi_put(out, info->tets, 8);
    tetlodi_put(out, info->level_count, 4);
    tetlodi_put(out, info->field_count, 2);
    tetlodi_put(out, index->slowest, 1);
    tetlodi_put(out, 0, 1); // reserved
    for (int i = 0; i < 6; i++)
        tetlodi_put_f64(out, info->bounds[i / 3][i % 3]);
    tetlodi_put(out, info->degenerate_tets, 8);
    tetlodi_put(out, info->inverted_tets, 8);
    tetlodi_put(out, info->unused_points, 8);
    put_scale(out, &index->scales[0], 3);
    for (uint32_t f = 0; f < info->field_count; f++) {
        const struct tetlod_field *field = &info->fields[f];
        size_t length = strlen(field->name);
        put_scale(out, &index->scales[1 + f], 1);
        tetlodi_put(out, field->components, 1);
        tetlodi_put(out, (field->controlled ? FIELD_CONTROLLED : 0) | (index->exact_later[f] ? FIELD_EXACT_LATER : 0) |
                             (field->bounds != TETLOD_NONE ? FIELD_BOUND : 0), 1);
        tetlodi_put_f64(out, field->range[0]);
        tetlodi_put_f64(out, field->range[1]);
        tetlodi_put(out, length, 2);
        tetlodi_put_block(out, field->name, length);
    }
    for (uint32_t k = 0; k < info->level_count; k++) {
        const struct tetlod_level *level = &info->levels[k];
        tetlodi_put(out, level->vertices, 8);
        tetlodi_put(out, level->tets, 8);
        tetlodi_put_f64(out, level->domain_error);
        for (uint32_t i = 0; i < info->field_count * TETLOD_MEASURES; i++)
            tetlodi_put_f64(out, level->errors[i]);
        for (uint32_t i = 0; i <= info->field_count; i++)
            put_frame(out, &index->frames[(size_t)k * (info->field_count + 1) + i]);
    }
    tetlodi_put(out, info->section_count, 4);
    for (uint32_t i = 0; i < info->section_count; i++)
        tetlodi_put_section(out, &index->sections[i]);
}

static bool valid_scale(const struct tetlodi_scale *scale, int axes)
{
    for (int i = 0; i < axes && scale->bits; i++) {
        double last = scale->origin[i] + scale->step[i] * (double)((UINT32_C(1) << scale->bits) - 1);
        last = tetlodi_round(scale->type, last);
        if (!isfinite(scale->origin[i]) || !(scale->step[i] > 0) || !isfinite(last))
            return false;
    }
    return true;
}

/* Errors do not grow from level to level. NaN is one that is not known: the next one is held against the last that
 * is. */
static bool grew(double *last, double error)
{
    if (error < 0 || error > *last)
        return true;
    *last = isnan(error) ? *last : error;
    return false;
}

static bool errors_grow(const struct tetlodi_index *index)
{
    const struct tetlod_info *info = &index->info;
    size_t measures = info->field_count * (size_t)TETLOD_MEASURES;
    for (size_t i = 0; i < measures; i++) {
        double last = INFINITY;
        for (uint32_t k = 0; k < info->level_count; k++)
            if (grew(&last, index->errors[k * measures + i]))
                return true;
    }
    return false;
}

static const char *wrong_fields(const struct tetlodi_index *index)
{
    const struct tetlod_info *info = &index->info;
    for (uint32_t f = 0; f <= info->field_count; f++) {
        const struct tetlodi_scale *scale = &index->scales[f];
        if ((unsigned)scale->original > TETLOD_FLOAT64 || scale->type > scale->original || scale->bits > MAX_BITS ||
            !valid_scale(scale, f ? 1 : 3))
            return "numbers of an unknown kind";
    }
    for (uint32_t f = 0; f < info->field_count; f++) {
        const struct tetlod_field *field = &info->fields[f];
        if (field->components < 1 || field->components > MAX_COMPONENTS)
            return "a field of too many components or none";
        if (!isfinite(field->range[0]) || !isfinite(field->range[1]) || field->range[0] > field->range[1])
            return "a field without a range";
        if (tetlod_field_index(info, field->name) != f)
            return "two fields of one name";
    }
    return NULL;
}

/* Do the frames of every part have the bytes that go with what they give, up to each level? */
static bool hold_enough(const struct tetlodi_index *index)
{
    const struct tetlod_info *info = &index->info;
    size_t parts = 1 + (size_t)info->field_count;
    for (uint32_t part = 0; part < parts; part++) {
        uint64_t bytes = 0;
        for (uint32_t k = 0; k < info->level_count; k++) {
            bytes += index->frames[k * parts + part].size;
            if (!is_within(tetlodi_part_numbers(index, k, part), NUMBERS_FREE, NUMBERS_PER_BYTE, bytes))
                return false;
        }
    }
    return true;
}

static const char *wrong_levels(const struct tetlodi_index *index)
{
    const struct tetlod_info *info = &index->info;
    uint32_t tail = index->tail ? info->level_count - 1 : TETLOD_NONE;
    for (uint32_t k = 0; k < info->level_count; k++) {
        const struct tetlod_level *level = &info->levels[k];
        if (k && k != tail && (level->vertices <= level[-1].vertices || level->tets < level[-1].tets))
            return "levels that do not grow";
        if (level->domain_error < 0)
            return "a negative domain error";
    }
    if (!hold_enough(index))
        return "levels of more than their bytes can hold";
    return errors_grow(index) ? "errors that grow with the level" : NULL;
}

/* The tail (SPEC 9.3): no mesh, and a frame for each field that it makes exact. */
static const char *wrong_tail(const struct tetlodi_index *index)
{
    const struct tetlod_info *info = &index->info;
    const struct tetlodi_frame *frames = &index->frames[(size_t)(info->level_count - 1) *
                                                        (info->field_count + (size_t)1)];
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
    const struct tetlod_level *finest = &info->levels[info->level_count - 1];
    for (int i = 0; i < 3; i++)
        if (!(isfinite(info->bounds[0][i]) && isfinite(info->bounds[1][i]) && info->bounds[0][i] <= info->bounds[1][i]))
            return "invalid bounds";
    const char *wrong = wrong_fields(index);
    wrong = wrong ? wrong : wrong_levels(index);
    wrong = wrong ? wrong : wrong_tail(index);
    if (!wrong && (finest->vertices != info->vertices || finest->tets != info->tets || info->tets == 0))
        wrong = "levels that do not lead to the original";
    return wrong;
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
    frame->size = tetlodi_get(in, 8);
    const uint8_t *digest = tetlodi_get_block(in, DIGEST_SIZE);
    if (digest)
        memcpy(frame->digest, digest, DIGEST_SIZE);
    in->failed |= frame->size > INT64_MAX / 2 - *offset;
    *offset += in->failed ? 0 : frame->size;
}

static uint64_t get_count(struct tetlodi_bytes *in)
{
    uint64_t count = tetlodi_get(in, 8);
    in->failed |= count > UINT64_C(1) << MAX_COUNT_BITS;
    return count;
}

static void decode_levels(struct tetlodi_index *index, struct tetlodi_bytes *in, uint64_t *offset)
{
    struct tetlod_info *info = &index->info;
    for (uint32_t k = 0; k < info->level_count; k++) {
        struct tetlod_level *level = &index->levels[k];
        level->vertices = get_count(in);
        level->tets = get_count(in);
        level->domain_error = tetlodi_get_f64(in);
        for (uint32_t i = 0; i < info->field_count * TETLOD_MEASURES; i++)
            index->errors[(size_t)k * info->field_count * TETLOD_MEASURES + i] = tetlodi_get_f64(in);
        level->offset = *offset;
        for (uint32_t i = 0; i <= info->field_count; i++)
            get_frame(in, &index->frames[(size_t)k * (info->field_count + 1) + i], offset);
        level->end = *offset;
    }
    const struct tetlod_level *last = &info->levels[info->level_count - 1];
    index->tail = info->level_count > 1 && last->vertices == last[-1].vertices && last->tets == last[-1].tets;
}

/* The levels' frames were placed where the index ends; the early sections lie between. Sections count from the index's
 * end or from that of the levels. */
static void place(struct tetlodi_index *index, uint64_t index_end, uint64_t early, uint64_t levels_end)
{
    struct tetlod_info *info = &index->info;
    for (uint32_t k = 0; k < info->level_count; k++) {
        index->levels[k].offset += early;
        index->levels[k].end += early;
    }
    for (size_t i = 0; i < info->level_count * (1 + (size_t)info->field_count); i++)
        index->frames[i].offset += early;
    for (uint32_t i = 0; i < info->section_count; i++) {
        struct tetlodi_section *section = &index->sections[i];
        section->frame.offset += section->flags & SECTION_EARLY ? index_end : levels_end + early;
        memcpy(index->listed[i].tag, section->tag, sizeof section->tag);
        index->listed[i].critical = (section->flags & SECTION_CRITICAL) != 0;
        index->listed[i].offset = section->frame.offset;
        index->listed[i].stored = section->frame.size;
        index->listed[i].size = section->plain;
    }
    info->keeps_order = tetlodi_section_find(index->sections, info->section_count, TAG_ORDER) != NULL;
}

/* The directory; `end` is where the levels' frames end if nothing lies between them and the index. */
static enum tetlod_status decode_sections(struct tetlodi_index *index, struct tetlodi_bytes *in, uint64_t index_end,
                                          uint64_t end,
                                          struct tetlod_error *error)
{
    struct tetlod_info *info = &index->info;
    uint64_t early = 0, late = 0;
    info->section_count = (uint32_t)tetlodi_get(in, 4);
    if (in->failed || info->section_count > MAX_SECTIONS || in->left != (size_t)info->section_count * SECTION_ENTRY)
        return tetlodi_fail(error, TETLOD_ERR_STREAM, "the index is damaged: it has less or more than it should");
    if (!tetlodi_index_allocate_sections(index))
        return tetlodi_fail_nomem(error, "the directory of sections", in->left);
    for (uint32_t i = 0; i < info->section_count; i++)
        tetlodi_get_section(in, &index->sections[i]);
    if (!tetlodi_sections_measure(index->sections, info->section_count, &early, &late) || early > MAX_EARLY ||
        late > INT64_MAX - MAX_EARLY - end)
        return tetlodi_fail(error, TETLOD_ERR_STREAM, "the index is damaged: its sections do not follow each other");
    TETLOD_TRY(tetlodi_sections_check(index->sections, info->section_count, error));
    place(index, index_end, early, end);
    info->bytes = end + early + late;
    return TETLOD_OK;
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

uint32_t tetlod_field_index(const struct tetlod_info *info, const char *name)
{
    for (uint32_t f = 0; f < info->field_count; f++)
        if (strcmp(info->fields[f].name, name) == 0)
            return f;
    return TETLOD_NONE;
}

/* The field whose name this one's is, but for TETLOD_BOUND_SUFFIX. */
static uint32_t find_bounded(const struct tetlod_info *info, const char *name)
{
    size_t length = strlen(name), suffix = sizeof TETLOD_BOUND_SUFFIX - 1;
    for (uint32_t f = 0; f < info->field_count && length > suffix; f++)
        if (strlen(info->fields[f].name) == length - suffix &&
            memcmp(info->fields[f].name, name, length - suffix) == 0 &&
            strcmp(name + length - suffix, TETLOD_BOUND_SUFFIX) == 0)
            return f;
    return TETLOD_NONE;
}

/* False: a name that is none. */
static bool decode_fields(struct tetlodi_index *index, struct tetlodi_bytes *in)
{
    struct tetlod_info *info = &index->info;
    char *text = index->text;
    bool named = true;
    for (uint32_t f = 0; f < info->field_count; f++) {
        struct tetlod_field *field = &index->fields[f];
        get_scale(in, &index->scales[1 + f], 1);
        field->type = index->scales[1 + f].original;
        field->components = (uint32_t)tetlodi_get(in, 1);
        unsigned flags = (unsigned)tetlodi_get(in, 1);
        field->controlled = (flags & FIELD_CONTROLLED) != 0;
        field->bounds = flags & FIELD_BOUND ? f : TETLOD_NONE; // until all names are known
        index->exact_later[f] = (flags & FIELD_EXACT_LATER) != 0;
        field->range[0] = tetlodi_get_f64(in);
        field->range[1] = tetlodi_get_f64(in);
        info->lossless &= index->scales[1 + f].bits == 0 || index->exact_later[f];
        size_t size = (size_t)tetlodi_get(in, 2);
        field->name = get_text(in, size, &text);
        named &= size && size <= MAX_NAME && !in->failed && tetlodi_plain_text(field->name, size);
    }
    for (uint32_t f = 0; f < info->field_count && named; f++)
        if (index->fields[f].bounds == f)
            index->fields[f].bounds = find_bounded(info, index->fields[f].name);
    return named;
}

/* What comes before the fields. False: no index. */
static bool decode_counts(struct tetlodi_index *index, struct tetlodi_bytes *in)
{
    struct tetlod_info *info = &index->info;
    info->vertices = get_count(in);
    info->tets = get_count(in);
    info->level_count = (uint32_t)tetlodi_get(in, 4);
    info->field_count = (uint32_t)tetlodi_get(in, 2);
    index->slowest = (unsigned)tetlodi_get(in, 1);
    uint64_t reserved = tetlodi_get(in, 1);
    for (int i = 0; i < 6; i++)
        info->bounds[i / 3][i % 3] = tetlodi_get_f64(in);
    info->degenerate_tets = tetlodi_get(in, 8);
    info->inverted_tets = tetlodi_get(in, 8);
    info->unused_points = tetlodi_get(in, 8);
    /* What is left bounds what is allocated. */
    uint64_t least =
        (uint64_t)info->level_count * tetlodi_index_row(info->field_count) + FIELD_BYTES * (uint64_t)info->field_count;
    return !in->failed && !reserved && index->slowest >= MIN_SLOWEST && index->slowest <= MAX_SLOWEST &&
           info->field_count <= MAX_FIELDS && info->level_count && info->level_count <= MAX_LEVELS && least <= in->left;
}

static enum tetlod_status decode(struct tetlodi_index *index, struct tetlodi_bytes *in, uint64_t first_offset,
                                 struct tetlod_error *error)
{
    struct tetlod_info *info = &index->info;
    uint64_t end = first_offset;
    size_t size = in->left;
    if (!decode_counts(index, in))
        return tetlodi_fail(error, TETLOD_ERR_STREAM, "the index is damaged, or has more than a stream can hold");
    index->text = malloc(size + info->field_count + 1);
    if (!tetlodi_index_allocate(index) || !index->text)
        return tetlodi_fail_nomem(error, "the index", size);
    get_scale(in, &index->scales[0], 3);
    info->position_type = index->scales[0].original;
    info->lossless = index->scales[0].bits == 0;
    bool named = decode_fields(index, in);
    decode_levels(index, in, &end);
    const char *wrong = in->failed ? "less than it should"
                        : named    ? contradiction(index)
                                   : "a field without a name, or with one of more than 255 bytes";
    if (wrong)
        return tetlodi_fail(error, TETLOD_ERR_STREAM, "the index is damaged: it has %s", wrong);
    TETLOD_TRY(decode_sections(index, in, first_offset, end, error));
    if (!is_within(tetlodi_level_rows(index), LEVEL_ROWS_FREE, LEVEL_ROWS_PER_BYTE, info->bytes))
        return tetlodi_fail(error, TETLOD_ERR_STREAM,
                            "the index is damaged: it has more levels than go with the stream's bytes");
    return TETLOD_OK;
}

enum tetlod_status tetlodi_index_decode(struct tetlodi_index *index, const void *bytes, size_t size,
                                        uint64_t first_offset,
                                        struct tetlod_error *error)
{
    struct tetlodi_bytes in = {(const uint8_t *)bytes, size, false};
    *index = (struct tetlodi_index){0};
    enum tetlod_status status = decode(index, &in, first_offset, error);
    if (status != TETLOD_OK)
        tetlodi_index_fini(index);
    return status;
}

enum tetlod_status tetlodi_index_unpack(const struct tetlodi_header *header, const uint8_t *stored, uint8_t **out,
                                        struct tetlod_error *error)
{
    size_t size = header->index_plain;
    *out = malloc(size ? size : 1);
    if (!*out)
        return tetlodi_fail_nomem(error, "the index", size);
    if (header->index_size == size) {
        memcpy(*out, stored, size);
        return TETLOD_OK;
    }
    enum tetlod_status status = tetlodi_unpack(stored, header->index_size, *out, size, error);
    if (status != TETLOD_OK) {
        free(*out);
        *out = NULL;
    }
    return status;
}
