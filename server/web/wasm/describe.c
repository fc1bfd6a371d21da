/* SPDX-License-Identifier: BSD-3-Clause */
/* The index of a stream as JSON: what TetlodStream.info is made of. */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "format/fail.h"
#include "server/web/wasm/view.h"

static void put(struct tetlodi_buffer *out, const char *text)
{
    tetlodi_put_block(out, text, strlen(text));
}

/* What is not whole is a string of its bits behind U+0001, which no name has: printing it would need 2 kB of the page.
 */
static void put_number(struct tetlodi_buffer *out, double number)
{
    char text[32] = "null";
    uint64_t bits;
    memcpy(&bits, &number, sizeof bits);
    if (fabs(number) < 0x1p53 && number == floor(number))
        snprintf(text, sizeof text, "%lld", (long long)number);
    else if (isfinite(number))
        snprintf(text, sizeof text, "\"\\u0001%016llx\"", (unsigned long long)bits);
    put(out, text);
}

/* A member whose value is a number, with the comma that is before it. */
static void put_member(struct tetlodi_buffer *out, const char *name, double number)
{
    put(out, ",\"");
    put(out, name);
    put(out, "\":");
    put_number(out, number);
}

static void put_string(struct tetlodi_buffer *out, const char *text)
{
    put(out, "\"");
    for (; *text; text++) {
        char escaped[8] = {*text};
        if ((unsigned char)*text < 0x20 || *text == '"' || *text == '\\')
            snprintf(escaped, sizeof escaped, "\\u%04x", (unsigned)(unsigned char)*text);
        put(out, escaped);
    }
    put(out, "\"");
}

static void put_point(struct tetlodi_buffer *out, const double *point, int count)
{
    for (int i = 0; i < count; i++) {
        put(out, i ? "," : "[");
        put_number(out, point[i]);
    }
    put(out, "]");
}

static void put_field(struct tetlodi_buffer *out, const struct tetlod_info *info, uint32_t f)
{
    const struct tetlod_field *field = &info->fields[f];
    put(out, "{\"name\":");
    put_string(out, field->name);
    put_member(out, "components", field->components);
    put(out, field->type == TETLOD_FLOAT64 ? ",\"type\":\"float64\",\"range\":" : ",\"type\":\"float32\",\"range\":");
    put_point(out, field->range, 2);
    put(out, field->controlled ? ",\"controlled\":true" : ",\"controlled\":false");
    if (field->bounds != TETLOD_NONE) {
        put(out, ",\"bounds\":");
        put_string(out, info->fields[field->bounds].name);
    }
    put(out, "}");
}

static const char *name_of(enum tetlod_cell_type type)
{
    static const char *const names[] = {"float32", "float64", "int8", "int16", "int32", "int64"};
    return names[type];
}

/* Values of tetrahedra, and where they are: their bytes, in the stream as a whole, and those of the map from tetrahedra
 * to cells. */
static void put_cell_fields(struct tetlodi_buffer *out, const struct tetlod_info *info)
{
    for (uint32_t f = 0; f < info->cell_field_count; f++) {
        const struct tetlod_cell_field *field = &info->cell_fields[f];
        uint32_t section = tetlod_cell_section(info, f),
                 map = info->cell_rows ? tetlod_section_index(info, "PMAP") : TETLOD_NONE;
        put(out, f ? ",{\"name\":" : "{\"name\":");
        put_string(out, field->name);
        put_member(out, "components", field->components);
        put(out, ",\"type\":");
        put_string(out, name_of(field->type));
        put(out, ",\"range\":");
        put_point(out, field->range, 2);
        put(out, field->region ? ",\"region\":true,\"place\":" : ",\"region\":false,\"place\":");
        put_point(out, (const double[]){(double)info->sections[section].offset,
                                        (double)info->sections[section].stored}, 2);
        if (map != TETLOD_NONE) {
            put(out, ",\"map\":");
            put_point(out, (const double[]){(double)info->sections[map].offset, (double)info->sections[map].stored}, 2);
        }
        put(out, "}");
    }
}

static void put_errors(struct tetlodi_buffer *out, const struct tetlod_info *info, const struct tetlod_level *level)
{
    put(out, ",\"errors\":{");
    for (uint32_t f = 0; f < info->field_count; f++) {
        put(out, f ? "," : "");
        put_string(out, info->fields[f].name);
        put(out, ":{");
        const char *comma = "\"";
        for (int m = 0; m < TETLOD_MEASURES; m++) {
            double error = level->errors[f * TETLOD_MEASURES + (uint32_t)m];
            if (!isfinite(error))
                continue;
            put(out, comma);
            put(out, tetlod_measure_name((enum tetlod_measure)m));
            put(out, "\":");
            put_number(out, error);
            comma = ",\"";
        }
        put(out, "}");
    }
    put(out, "}");
}

/* Offset and bytes are of what comes: without fields that are left out. */
static void put_level(struct tetlodi_buffer *out, const struct view *view, uint32_t k)
{
    const struct tetlod_info *info = view_info(view);
    const struct tetlod_level *level = &info->levels[k];
    put(out, k ? ",{\"level\":" : "{\"level\":");
    put_number(out, k);
    put_member(out, "vertices", level->vertices);
    put_member(out, "tets", level->tets);
    put_member(out, "offset", k ? (double)tetlod_feed_bytes(view->feed, k - 1) : (double)level->offset);
    put_member(out, "bytes", (double)tetlod_feed_bytes(view->feed, k));
    put_member(out, "domainError", level->domain_error);
    put_errors(out, info, level);
    put(out, "}");
}

/* Where the table of steps is, with that of cells' steps behind it: their bytes, in the stream as a whole. */
static void put_table(struct tetlodi_buffer *out, const struct tetlod_info *info)
{
    uint32_t section = tetlod_section_index(info, "TIME");
    double place[2] = {0, 0};
    if (section == TETLOD_NONE) {
        put(out, "null");
        return;
    }
    place[0] = (double)info->sections[section].offset;
    place[1] = (double)info->sections[section].stored;
    if (section + 1 < info->section_count && (strcmp(info->sections[section + 1].tag, "CTIM") == 0 ||
                                               strcmp(info->sections[section + 1].tag, "PTIM") == 0))
        place[1] += (double)info->sections[section + 1].stored;
    put_point(out, place, 2);
}

static void put_band(struct tetlodi_buffer *out, const struct tetlod_band *band)
{
    put(out, "{\"error\":");
    put_number(out, band->error);
    put_member(out, "level", band->level);
    put(out, "}");
}

const char *view_describe_series(struct view *view)
{
    const struct tetlod_series_info *series = tetlod_series_info(view->series);
    struct tetlodi_buffer *out = &view->text;
    out->size = 0;
    put(out, "{\"group\":");
    put_number(out, TETLOD_STEP_GROUP);
    put(out, ",\"times\":");
    put_point(out, series->times, (int)series->step_count);
    put(out, ",\"bands\":[");
    for (uint32_t b = 0; b < series->band_count; b++) {
        put(out, b ? "," : "");
        put_band(out, &series->bands[b]);
    }
    put(out, "],\"fields\":[");
    for (uint32_t f = 0; f < series->field_count; f++) {
        put(out, f ? ",{\"name\":" : "{\"name\":");
        put_string(out, view_info(view)->fields[series->fields[f]].name);
        put(out, ",\"range\":");
        put_point(out, series->ranges[f], 2);
        put(out, "}");
    }
    put(out, "],\"cellFields\":[");
    for (uint32_t f = 0; f < series->cell_field_count; f++) {
        put(out, f ? ",{\"name\":" : "{\"name\":");
        put_string(out, view_info(view)->cell_fields[series->cell_fields[f]].name);
        put(out, ",\"range\":");
        put_point(out, series->cell_ranges[f], 2);
        put(out, "}");
    }
    put(out, "],\"displacement\":");
    if (series->displacement == TETLOD_NONE)
        put(out, "null");
    else
        put_string(out, view_info(view)->fields[series->fields[series->displacement]].name);
    tetlodi_put_block(out, "}", 2); // with the NUL
    return out->failed ? NULL : (const char *)out->bytes;
}

/* Topology groups: their steps, and where the stream of each is in the whole. */
static void put_topologies(struct tetlodi_buffer *out, const struct tetlod_info *info)
{
    for (uint32_t t = 0; t < info->topology_count; t++) {
        const struct tetlod_topology *topology = &info->topologies[t];
        put(out, t ? ",{\"cid\":" : "{\"cid\":");
        put_string(out, topology->cid);
        put_member(out, "offset", (double)topology->offset);
        put_member(out, "size", (double)topology->size);
        put(out, ",\"times\":");
        put_point(out, topology->times, (int)topology->step_count);
        put(out, "}");
    }
}

const char *view_describe(struct view *view)
{
    const struct tetlod_info *info = view_info(view);
    struct tetlodi_buffer *out = &view->text;
    out->size = 0;
    put(out, "{\"cid\":");
    put_string(out, info->cid);
    put_member(out, "vertices", info->vertices);
    put_member(out, "tets", info->tets);
    put_member(out, "bytes", (double)info->bytes);
    put_member(out, "degenerateTets", (double)info->degenerate_tets);
    put_member(out, "invertedTets", (double)info->inverted_tets);
    put_member(out, "paged", info->first_paged_level);
    put(out, ",\"bounds\":[");
    put_point(out, info->bounds[0], 3);
    put(out, ",");
    put_point(out, info->bounds[1], 3);
    put(out, info->lossless ? "],\"lossless\":true,\"fields\":[" : "],\"lossless\":false,\"fields\":[");
    for (uint32_t f = 0; f < info->field_count; f++) {
        put(out, f ? "," : "");
        put_field(out, info, f);
    }
    put(out, "],\"cellFields\":[");
    put_cell_fields(out, info);
    put(out, "],\"levels\":[");
    for (uint32_t k = 0; k < info->level_count; k++)
        put_level(out, view, k);
    put(out, "],\"topologies\":[");
    put_topologies(out, info);
    put(out, "],\"time\":");
    put_table(out, info);
    put(out, ",\"metadata\":");
    put_string(out, info->metadata);
    tetlodi_put_block(out, "}", 2); // with the NUL
    return out->failed ? NULL : (const char *)out->bytes;
}
