/* SPDX-License-Identifier: BSD-3-Clause */
#include "format/read/summary.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "format/fail.h"
#include "format/read/reader.h"

enum { SUMMARY_HEAD = 16, LEVEL_ROW = 4, COMPONENT_ROW = 16, COUNT_SIZE = 4, PLACES = 48, THRESHOLD_ROW = 16 };

int tetlodi_summary_allocate(struct tetlodi_summary *summary, uint32_t levels, uint32_t components,
                             uint32_t thresholds)
{
    size_t rows = (size_t)thresholds * components;
    *summary = (struct tetlodi_summary){.level_count = levels, .component_count = components,
                                        .threshold_count = thresholds};
    summary->places = calloc(components ? components : 1, sizeof *summary->places);
    summary->below = calloc(rows ? rows : 1, sizeof *summary->below);
    summary->swept = calloc(levels ? levels : 1, sizeof *summary->swept);
    summary->sums = calloc(components ? components : 1, sizeof *summary->sums);
    return summary->swept && summary->sums && summary->places && summary->below;
}

void tetlodi_summary_fini(struct tetlodi_summary *summary)
{
    free(summary->swept);
    free(summary->sums);
    free(summary->places);
    free(summary->below);
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
    if (summary->threshold_count)
        tetlodi_put(out, summary->threshold_count, COUNT_SIZE);
    for (uint32_t c = 0; c < summary->component_count && summary->threshold_count; c++) {
        for (int i = 0; i < 6; i++)
            tetlodi_put_f64(out, summary->places[c][i / 3][i % 3]);
        for (uint32_t t = 0; t < 2 * summary->threshold_count; t++)
            tetlodi_put_f64(out, summary->below[(size_t)c * summary->threshold_count + t / 2][t % 2]);
    }
}

/* Thresholds and volumes do not fall. */
static int is_distribution(const struct tetlodi_summary *summary, uint32_t component)
{
    double last[2] = {-INFINITY, 0};
    for (int i = 0; i < 6; i++)
        if (!isfinite(summary->places[component][i / 3][i % 3]))
            return 0;
    for (uint32_t t = 0; t < summary->threshold_count; t++)
        for (int i = 0; i < 2; i++) {
            double value = summary->below[(size_t)component * summary->threshold_count + t][i];
            if (!(value >= last[i]) || !isfinite(value))
                return 0;
            last[i] = value;
        }
    return last[1] <= summary->volume * (1 + 1e-9);
}

static enum tetlod_status decode_distributions(struct tetlodi_summary *summary, struct tetlodi_bytes *from,
                                               struct tetlod_error *error)
{
    for (uint32_t c = 0; c < summary->component_count && summary->threshold_count; c++) {
        for (int i = 0; i < 6; i++)
            summary->places[c][i / 3][i % 3] = tetlodi_get_f64(from);
        for (uint32_t t = 0; t < 2 * summary->threshold_count; t++)
            summary->below[(size_t)c * summary->threshold_count + t / 2][t % 2] = tetlodi_get_f64(from);
        if (!is_distribution(summary, c))
            return tetlodi_fail(error, TETLOD_ERR_STREAM,
                                "section SUMS: the places or the distribution of component %u are not of any field", c);
    }
    return TETLOD_OK;
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
    uint64_t plain = SUMMARY_HEAD + LEVEL_ROW * levels + COMPONENT_ROW * components, thresholds = 0;
    *summary = (struct tetlodi_summary){0};
    if (!from.failed && size >= plain + COUNT_SIZE && components) {
        struct tetlodi_bytes count = {.at = bytes + plain, .left = COUNT_SIZE};
        thresholds = tetlodi_get(&count, COUNT_SIZE);
        plain += COUNT_SIZE + components * (PLACES + THRESHOLD_ROW * thresholds);
        if (!thresholds || thresholds > MAX_SUMMARY_THRESHOLDS)
            from.failed = 1;
    }
    if (from.failed || size != plain)
        return tetlodi_fail(error, TETLOD_ERR_STREAM, "section SUMS: truncated or trailing bytes");
    if (!(volume >= 0) || isinf(volume))
        return tetlodi_fail(error, TETLOD_ERR_STREAM, "section SUMS: the volume is not a number");
    if (!tetlodi_summary_allocate(summary, (uint32_t)levels, (uint32_t)components, (uint32_t)thresholds)) {
        tetlodi_summary_fini(summary);
        return tetlodi_fail_nomem(error, "the section SUMS", size);
    }
    summary->volume = volume;
    enum tetlod_status status = decode_rows(summary, &from, error);
    if (thresholds)
        tetlodi_get(&from, COUNT_SIZE);
    if (status == TETLOD_OK)
        status = decode_distributions(summary, &from, error);
    if (status != TETLOD_OK)
        tetlodi_summary_fini(summary);
    return status;
}

enum tetlod_status tetlodi_summary_read(const struct tetlod_file *file, struct tetlodi_summary *out,
                                        struct tetlod_error *error)
{
    const struct tetlod_info *info = tetlod_info(file);
    const uint32_t components = tetlodi_component_count(info);
    uint8_t *bytes;
    size_t size;
    *out = (struct tetlodi_summary){0};
    TETLOD_TRY(tetlodi_read_tagged(file, TAG_SUMMARY, &bytes, &size, error));
    if (!bytes)
        return TETLOD_OK;
    enum tetlod_status status = tetlodi_summary_decode(out, bytes, size, error);
    free(bytes);
    if (status == TETLOD_OK && (out->component_count != components || out->level_count < info->level_count)) {
        status = tetlodi_fail(error, TETLOD_ERR_STREAM,
                              "section SUMS has %u levels and %u components, the stream %u and %u",
                              out->level_count, out->component_count, info->level_count, components);
        tetlodi_summary_fini(out);
    }
    return status;
}
