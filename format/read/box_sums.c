/* SPDX-License-Identifier: BSD-3-Clause */
#include "format/read/box_sums.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "format/fail.h"
#include "format/read/reader.h"

static void *room(size_t count, size_t size)
{
    return calloc(count ? count : 1, size);
}

int tetlodi_box_sums_allocate(struct tetlodi_box_sums *sums, uint32_t components, unsigned depth,
                              const uint8_t *depths, uint32_t regions)
{
    const size_t inner = (size_t)1 << depth;
    size_t rows = 0;
    *sums = (struct tetlodi_box_sums){.component_count = components, .depth = depth, .region_count = regions};
    sums->firsts = room(components, sizeof *sums->firsts);
    sums->depths = room(components, sizeof *sums->depths);
    for (uint32_t c = 0; c < components && sums->firsts && sums->depths; c++) {
        sums->depths[c] = depths[c];
        sums->firsts[c] = (uint32_t)rows;
        rows += (size_t)1 << depths[c];
    }
    sums->splits = room(inner, sizeof *sums->splits);
    sums->parts = room(inner, sizeof *sums->parts);
    sums->least = room(rows, sizeof *sums->least);
    sums->greatest = room(rows, sizeof *sums->greatest);
    sums->means = room(rows, sizeof *sums->means);
    sums->ranges = room(components, sizeof *sums->ranges);
    sums->regions = room(regions, sizeof *sums->regions);
    sums->region_rows = room((size_t)components * regions, sizeof *sums->region_rows);
    return sums->firsts && sums->depths && sums->splits && sums->parts && sums->least && sums->greatest &&
           sums->means && sums->ranges && sums->regions && sums->region_rows;
}

void tetlodi_box_sums_fini(struct tetlodi_box_sums *sums)
{
    free(sums->splits);
    free(sums->parts);
    free(sums->depths);
    free(sums->firsts);
    free(sums->least);
    free(sums->greatest);
    free(sums->means);
    free(sums->ranges);
    free(sums->regions);
    free(sums->region_rows);
    *sums = (struct tetlodi_box_sums){0};
}

double tetlodi_part_of_range(const double range[2], unsigned part, unsigned parts)
{
    const double share = (double)part / parts;
    return (1 - share) * range[0] + share * range[1];
}

double tetlodi_box_split(const struct tetlodi_box_sums *sums, uint32_t node, double low, double high)
{
    const double range[2] = {low, high};
    return tetlodi_part_of_range(range, sums->splits[node], BOX_SPLITS);
}

static void put_component(const struct tetlodi_box_sums *sums, uint32_t c, struct tetlodi_buffer *out)
{
    const uint32_t first = sums->firsts[c], count = (uint32_t)1 << sums->depths[c];
    tetlodi_put_f64(out, sums->ranges[c][0]);
    tetlodi_put_f64(out, sums->ranges[c][1]);
    tetlodi_put_block(out, sums->least + first, count);
    tetlodi_put_block(out, sums->greatest + first, count);
    for (uint32_t i = 0; i < count; i++)
        tetlodi_put(out, sums->means[first + i], 2);
}

void tetlodi_box_sums_encode(const struct tetlodi_box_sums *sums, struct tetlodi_buffer *out)
{
    const uint32_t inner = (uint32_t)1 << sums->depth, regions = sums->region_count;
    tetlodi_put(out, sums->component_count, 4);
    tetlodi_put(out, sums->depth, 2);
    tetlodi_put(out, regions, 2);
    for (int i = 0; i < 6; i++)
        tetlodi_put_f64(out, sums->box[i / 3][i % 3]);
    tetlodi_put_f64(out, sums->volume);
    tetlodi_put_block(out, sums->depths, sums->component_count);
    tetlodi_put_block(out, sums->splits + 1, inner - 1);
    for (uint32_t n = 1; n < inner; n++)
        tetlodi_put(out, sums->parts[n], 2);
    for (uint32_t c = 0; c < sums->component_count; c++)
        put_component(sums, c, out);
    for (uint32_t r = 0; r < 2 * regions; r++)
        tetlodi_put_f64(out, sums->regions[r / 2][r % 2]);
    for (size_t r = 0; r < 3 * (size_t)regions * sums->component_count; r++)
        tetlodi_put_f64(out, sums->region_rows[r / 3][r % 3]);
}

static bool is_range(const double range[2])
{
    return isfinite(range[0]) && isfinite(range[1]) && range[0] <= range[1];
}

/* A row of 2^depth bytes. */
static void get_row(uint8_t *out, uint32_t count, struct tetlodi_bytes *from)
{
    const uint8_t *row = tetlodi_get_block(from, count);
    if (row)
        memcpy(out, row, count);
}

static bool get_component(struct tetlodi_box_sums *sums, uint32_t c, struct tetlodi_bytes *from)
{
    const uint32_t first = sums->firsts[c], count = (uint32_t)1 << sums->depths[c];
    sums->ranges[c][0] = tetlodi_get_f64(from);
    sums->ranges[c][1] = tetlodi_get_f64(from);
    get_row(sums->least + first, count, from);
    get_row(sums->greatest + first, count, from);
    for (uint32_t i = 0; i < count; i++)
        sums->means[first + i] = (uint16_t)tetlodi_get(from, 2);
    return is_range(sums->ranges[c]);
}

/* Numbers of regions rise, their volumes are some, and integrals lie between what the values allow. */
static bool get_regions(struct tetlodi_box_sums *sums, struct tetlodi_bytes *from)
{
    bool good = true;
    for (uint32_t r = 0; r < sums->region_count; r++) {
        double number = sums->regions[r][0] = tetlodi_get_f64(from);
        double volume = sums->regions[r][1] = tetlodi_get_f64(from);
        good &= isfinite(number) && volume >= 0 && volume <= sums->volume * (1 + 1e-9);
        good &= r == 0 || number > sums->regions[r - 1][0];
    }
    for (size_t r = 0; r < (size_t)sums->region_count * sums->component_count; r++) {
        for (int i = 0; i < 3; i++)
            sums->region_rows[r][i] = tetlodi_get_f64(from);
        good &= is_range(sums->region_rows[r]) && isfinite(sums->region_rows[r][2]);
    }
    return good;
}

/* Bytes of what the head and the depths ask for; 0: no section has such a head. */
static uint64_t size_of(uint64_t components, unsigned depth, const uint8_t *depths, uint64_t regions)
{
    uint64_t size = BOX_SUMS_HEAD + components + 3 * (((uint64_t)1 << depth) - 1) + 16 * regions;
    for (uint64_t c = 0; c < components; c++) {
        if (depths[c] > depth)
            return 0;
        size += 16 + ((uint64_t)4 << depths[c]) + 24 * regions;
    }
    return size;
}

static bool get_tree(struct tetlodi_box_sums *sums, struct tetlodi_bytes *from)
{
    const uint32_t inner = (uint32_t)1 << sums->depth;
    bool good = sums->volume >= 0 && isfinite(sums->volume);
    for (int i = 0; i < 3; i++)
        good &= isfinite(sums->box[0][i]) && isfinite(sums->box[1][i]) && sums->box[0][i] <= sums->box[1][i];
    tetlodi_get_block(from, sums->component_count); // the depths
    get_row(sums->splits + 1, inner - 1, from);
    for (uint32_t n = 1; n < inner; n++)
        sums->parts[n] = (uint16_t)tetlodi_get(from, 2);
    return good;
}

enum tetlod_status tetlodi_box_sums_decode(struct tetlodi_box_sums *sums, const uint8_t *bytes, size_t size,
                                           struct tetlod_error *error)
{
    struct tetlodi_bytes from = {.at = bytes, .left = size};
    const uint64_t components = tetlodi_get(&from, 4), depth = tetlodi_get(&from, 2), regions = tetlodi_get(&from, 2);
    double head[7];
    *sums = (struct tetlodi_box_sums){0};
    for (int i = 0; i < 7; i++)
        head[i] = tetlodi_get_f64(&from);
    if (from.failed || !components || depth > MAX_BOX_DEPTH || components > from.left ||
        size_of(components, (unsigned)depth, from.at, regions) != size)
        return tetlodi_fail(error, TETLOD_ERR_STREAM, "section KSUM: truncated or trailing bytes");
    if (!tetlodi_box_sums_allocate(sums, (uint32_t)components, (unsigned)depth, from.at, (uint32_t)regions)) {
        tetlodi_box_sums_fini(sums);
        return tetlodi_fail_nomem(error, "the section KSUM", size);
    }
    memcpy(sums->box, head, sizeof sums->box);
    sums->volume = head[6];
    bool good = get_tree(sums, &from);
    for (uint32_t c = 0; c < sums->component_count; c++)
        good &= get_component(sums, c, &from);
    good &= get_regions(sums, &from);
    if (good)
        return TETLOD_OK;
    tetlodi_box_sums_fini(sums);
    return tetlodi_fail(error, TETLOD_ERR_STREAM, "section KSUM: the box, the ranges or the regions are of no field");
}

enum tetlod_status tetlodi_box_sums_read(const struct tetlod_file *file, struct tetlodi_box_sums *out,
                                         struct tetlod_error *error)
{
    const struct tetlod_info *info = tetlod_info(file);
    const uint32_t components = tetlodi_component_count(info);
    uint8_t *bytes;
    size_t size;
    *out = (struct tetlodi_box_sums){0};
    TETLOD_TRY(tetlodi_read_tagged(file, TAG_BOX_SUMS, &bytes, &size, error));
    if (!bytes)
        return TETLOD_OK;
    enum tetlod_status status = tetlodi_box_sums_decode(out, bytes, size, error);
    free(bytes);
    if (status == TETLOD_OK && out->component_count != components) {
        status = tetlodi_fail(error, TETLOD_ERR_STREAM, "section KSUM has %u components, the stream %u",
                              out->component_count, components);
        tetlodi_box_sums_fini(out);
    }
    return status;
}
