/* SPDX-License-Identifier: BSD-3-Clause */
#include "format/coding/section.h"

#include <string.h>

#include "format/fail.h"

/* Tags that this library reads, and where their sections are. */
static const struct known {
    const char *tag;
    bool early, once;
} known_tags[] = {{TAG_METADATA, true, true}, {TAG_ORDER, false, true}, {TAG_CELLS, true, true},
                  {TAG_CELL_VALUES, false, false},
                {TAG_TIME, false, true},     {TAG_STEP_VALUES, false, false},
                {TAG_CELL_TIME, false, true}, {TAG_CELL_STEPS, false, false},
                {TAG_PARENTS, true, true},    {TAG_PARENT_MAP, false, true}, {TAG_PARENT_VALUES, false, false},
                {TAG_PARENT_TIME, false, true}, {TAG_PARENT_STEPS, false, false},
                {TAG_TOPOLOGIES, true, true},   {TAG_NEXT, false, true},
                {TAG_PAGES, true, true},       {"ORIG", false, true}};

static const struct known *find_known(const char *tag)
{
    for (size_t i = 0; i < sizeof known_tags / sizeof *known_tags; i++)
        if (strcmp(known_tags[i].tag, tag) == 0)
            return &known_tags[i];
    return NULL;
}

enum tetlodi_packing tetlodi_section_packing(const char *tag)
{
    static const char *const tables[] = {TAG_TIME, TAG_CELL_TIME, TAG_PARENT_TIME, TAG_TOPOLOGIES,
                                         TAG_PAGES};
    for (size_t i = 0; i < sizeof tables / sizeof *tables; i++)
        if (strcmp(tag, tables[i]) == 0)
            return PACKED_TABLE;
    return PACKED_VALUES;
}

struct tetlodi_frame tetlodi_frame_of(const void *bytes, size_t size)
{
    struct tetlodi_frame frame = {.size = size};
    tetlodi_digest(bytes, size, frame.digest);
    return frame;
}

void tetlodi_put_section(struct tetlodi_buffer *out, const struct tetlodi_section *section)
{
    tetlodi_put_block(out, section->tag, TAG_SIZE);
    tetlodi_put(out, section->flags, 4);
    tetlodi_put(out, section->frame.offset, 8);
    tetlodi_put(out, section->frame.size, 8);
    tetlodi_put(out, section->plain, 8);
    tetlodi_put_block(out, section->frame.digest, DIGEST_SIZE);
}

void tetlodi_get_section(struct tetlodi_bytes *in, struct tetlodi_section *section)
{
    const uint8_t *tag = tetlodi_get_block(in, TAG_SIZE);
    if (tag)
        memcpy(section->tag, tag, TAG_SIZE);
    section->flags = (uint32_t)tetlodi_get(in, 4);
    section->frame.offset = tetlodi_get(in, 8);
    section->frame.size = tetlodi_get(in, 8);
    section->plain = tetlodi_get(in, 8);
    const uint8_t *digest = tetlodi_get_block(in, DIGEST_SIZE);
    if (digest)
        memcpy(section->frame.digest, digest, DIGEST_SIZE);
}

bool tetlodi_sections_measure(const struct tetlodi_section *sections, uint32_t count, uint64_t *early, uint64_t *late)
{
    *early = *late = 0;
    for (uint32_t i = 0; i < count; i++) {
        uint64_t *end = sections[i].flags & SECTION_EARLY ? early : late;
        if (sections[i].frame.offset != *end || sections[i].frame.size > INT64_MAX - *end)
            return false;
        *end += sections[i].frame.size;
    }
    return true;
}

static bool is_tag(const char *tag)
{
    for (int i = 0; i < TAG_SIZE; i++)
        if (!((tag[i] >= 'A' && tag[i] <= 'Z') || (tag[i] >= '0' && tag[i] <= '9')))
            return false;
    return true;
}

/* Of tags that this library reads there is one section at most, at its place. */
static const char *contradiction(const struct tetlodi_section *sections, uint32_t i)
{
    const struct tetlodi_section *section = &sections[i];
    const struct known *known = find_known(section->tag);
    if (!is_tag(section->tag) || section->flags & ~(uint32_t)SECTION_FLAGS)
        return "malformed section";
    if (section->flags & SECTION_PACKED ? !tetlodi_packs(tetlodi_section_packing(section->tag), section->plain,
                                                         section->frame.size)
                                        : section->plain != section->frame.size)
        return "impossible size of section";
    if (known && known->once && tetlodi_section_find(sections, i, section->tag))
        return "duplicate section";
    if (known && known->early != ((section->flags & SECTION_EARLY) != 0))
        return "misplaced section";
    return strcmp(section->tag, TAG_METADATA) == 0 && section->plain > MAX_METADATA ? "too large section" : NULL;
}

enum tetlod_status tetlodi_sections_check(const struct tetlodi_section *sections, uint32_t count,
                                          struct tetlod_error *error)
{
    for (uint32_t i = 0; i < count; i++) {
        const char *tag = sections[i].tag, *wrong = contradiction(sections, i);
        if (wrong)
            return tetlodi_fail(error, TETLOD_ERR_STREAM, "the index is damaged: %s%s%s", wrong, is_tag(tag) ? " " : "",
                                is_tag(tag) ? tag : "");
        if (sections[i].flags & SECTION_CRITICAL && !find_known(tag))
            return tetlodi_fail(error, TETLOD_ERR_VERSION,
                                "the stream cannot be read without its section %s, which this program does not know",
                                tag);
    }
    return TETLOD_OK;
}

const struct tetlodi_section *tetlodi_section_find(const struct tetlodi_section *sections, uint32_t count,
                                                   const char *tag)
{
    for (uint32_t i = 0; i < count; i++)
        if (strcmp(sections[i].tag, tag) == 0)
            return &sections[i];
    return NULL;
}
