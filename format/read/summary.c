/* SPDX-License-Identifier: BSD-3-Clause */
#include "format/read/summary.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "format/fail.h"

enum { SUMMARY_HEAD = 16, LEVEL_ROW = 4, COMPONENT_ROW = 16 };

int tetlodi_summary_allocate(struct tetlodi_summary *summary, uint32_t levels, uint32_t components)
{
    *summary = (struct tetlodi_summary){.level_count = levels, .component_count = components};
    summary->swept = calloc(levels ? levels : 1, sizeof *summary->swept);
    summary->sums = calloc(components ? components : 1, sizeof *summary->sums);
    return summary->swept && summary->sums;
}

void tetlodi_summary_fini(struct tetlodi_summary *summary)
{
    free(summary->swept);
    free(summary->sums);
    *summary = (struct tetlodi_summary){0};
}

void tetlodi_summary_encode(const struct tetlodi_summary *summary, struct tetlodi_buffer *out)
{
    tetlodi_put(out, summary->level_count, 4);
    tetlodi_put(out, summary->component_count, 4);
    tetlodi_put_f64(out, summary->volume);
    for (uint32_t l = 0; l < summary->level_count; l++) {
        uint32_t bits;
        memcpy(&bits, &summary->swept[l], sizeof bits);
        tetlodi_put(out, bits, 4);
    }
    for (uint32_t c = 0; c < summary->component_count; c++) {
        tetlodi_put_f64(out, summary->sums[c][0]);
        tetlodi_put_f64(out, summary->sums[c][1]);
    }
}

static enum tetlod_status decode_rows(struct tetlodi_summary *summary, struct tetlodi_bytes *from,
                                      struct tetlod_error *error)
{
    for (uint32_t l = 0; l < summary->level_count; l++) {
        uint32_t bits = (uint32_t)tetlodi_get(from, 4);
        memcpy(&summary->swept[l], &bits, sizeof bits);
        if (!(summary->swept[l] >= 0) || (l > 0 && summary->swept[l] > summary->swept[l - 1]))
            return tetlodi_fail(error, TETLOD_ERR_STREAM,
                                "section SUMS: the swept volume of level %u is negative, or more than "
                                "that of the level before", l);
    }
    for (uint32_t c = 0; c < summary->component_count; c++) {
        summary->sums[c][0] = tetlodi_get_f64(from);
        summary->sums[c][1] = tetlodi_get_f64(from);
        if (!isfinite(summary->sums[c][0]) || !(summary->sums[c][1] >= 0) || isinf(summary->sums[c][1]))
            return tetlodi_fail(error, TETLOD_ERR_STREAM, "section SUMS: the sums of component %u are not numbers", c);
    }
    return TETLOD_OK;
}

enum tetlod_status tetlodi_summary_decode(struct tetlodi_summary *summary, const uint8_t *bytes, size_t size,
                                          struct tetlod_error *error)
{
    struct tetlodi_bytes from = {.at = bytes, .left = size};
    uint64_t levels = tetlodi_get(&from, 4), components = tetlodi_get(&from, 4);
    double volume = tetlodi_get_f64(&from);
    *summary = (struct tetlodi_summary){0};
    if (from.failed || size != SUMMARY_HEAD + LEVEL_ROW * levels + COMPONENT_ROW * components)
        return tetlodi_fail(error, TETLOD_ERR_STREAM, "section SUMS: truncated or trailing bytes");
    if (!(volume >= 0) || isinf(volume))
        return tetlodi_fail(error, TETLOD_ERR_STREAM, "section SUMS: the volume is not a number");
    if (!tetlodi_summary_allocate(summary, (uint32_t)levels, (uint32_t)components)) {
        tetlodi_summary_fini(summary);
        return tetlodi_fail_nomem(error, "the section SUMS", size);
    }
    summary->volume = volume;
    enum tetlod_status status = decode_rows(summary, &from, error);
    if (status != TETLOD_OK)
        tetlodi_summary_fini(summary);
    return status;
}

enum tetlod_status tetlodi_summary_read(const struct tetlod_file *file, struct tetlodi_summary *out,
                                        struct tetlod_error *error)
{
    const struct tetlod_info *info = tetlod_info(file);
    uint32_t section = tetlod_section_index(info, TAG_SUMMARY), components = 0;
    *out = (struct tetlodi_summary){0};
    if (section == TETLOD_NONE)
        return TETLOD_OK;
    size_t size = (size_t)info->sections[section].size;
    uint8_t *bytes = malloc(size ? size : 1);
    if (!bytes)
        return tetlodi_fail_nomem(error, "the section SUMS", size);
    enum tetlod_status status = tetlod_section_read(file, section, bytes, error);
    if (status == TETLOD_OK)
        status = tetlodi_summary_decode(out, bytes, size, error);
    free(bytes);
    for (uint32_t f = 0; f < info->field_count; f++)
        components += info->fields[f].components;
    if (status == TETLOD_OK && (out->component_count != components || out->level_count < info->level_count)) {
        status = tetlodi_fail(error, TETLOD_ERR_STREAM,
                              "section SUMS has %u levels and %u components, the stream %u and %u",
                              out->level_count, out->component_count, info->level_count, components);
        tetlodi_summary_fini(out);
    }
    return status;
}
