/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/report/info_json.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "src/stream/metadata.h"

void stream_id(const char *path, char *out, size_t size)
{
    const char *slash = strrchr(path, '/'), *name = slash ? slash + 1 : path;
    size_t length = strlen(name);
    if (length > 7 && (strcmp(name + length - 7, ".tetlod") == 0 || strcmp(name + length - 7, ".vtkhdf") == 0))
        length -= 7;
    snprintf(out, size, "%.*s", (int)length, name);
}

static json_t *field_json(const struct tetlod_info *info, uint32_t f)
{
    const struct tetlod_field *field = &info->fields[f];
    json_t *object = json_pack("{s:s, s:i, s:s, s:[f,f], s:b}", "name", field->name, "components",
                               (int)field->components, "type", field->type == TETLOD_FLOAT64 ? "float64" : "float32",
                               "range", field->range[0], field->range[1], "controlled", field->controlled);
    if (object && field->bounds != TETLOD_NONE)
        json_object_set_new(object, "bounds", json_string(info->fields[field->bounds].name));
    return object;
}

static json_t *cell_field_json(const struct tetlod_cell_field *field)
{
    static const char *const types[] = {"float32", "float64", "int8", "int16", "int32", "int64"};
    json_t *json = json_pack("{s:s, s:i, s:s, s:[f,f], s:b}", "name", field->name, "components", (int)field->components,
                             "type", types[field->type], "range", field->range[0], field->range[1], "region",
                             field->region);
    if (json && field->quantum > 0)
        json_object_set_new(json, "error", json_real(field->error));
    return json;
}

/* One field's errors at a level. JSON has finite numbers only: what is left out is not known, or has no bound. */
static json_t *measures_json(const double errors[TETLOD_MEASURES])
{
    json_t *measures = json_object();
    bool room = measures;
    for (int m = 0; m < TETLOD_MEASURES; m++)
        if (isfinite(errors[m]))
            room &= !json_object_set_new(measures, tetlod_measure_name((enum tetlod_measure)m), json_real(errors[m]));
    if (room)
        return measures;
    json_decref(measures);
    return NULL;
}

static json_t *errors_json(const struct tetlod_info *info, const struct tetlod_level *level)
{
    json_t *errors = json_object();
    bool room = errors;
    for (uint32_t f = 0; f < info->field_count; f++)
        room &= !json_object_set_new(errors, info->fields[f].name, measures_json(level->errors + f * TETLOD_MEASURES));
    if (room)
        return errors;
    json_decref(errors);
    return NULL;
}

static json_t *level_json(const struct tetlod_info *info, uint32_t k)
{
    const struct tetlod_level *level = &info->levels[k];
    return json_pack("{s:i, s:I, s:I, s:I, s:I, s:o, s:o}", "level", (int)k, "vertices", (json_int_t)level->vertices,
                     "tets", (json_int_t)level->tets, "bytes", (json_int_t)level->end, "offset",
                     (json_int_t)level->offset, "domain_error",
                     isfinite(level->domain_error) ? json_real(level->domain_error) : json_null(), "errors",
                     errors_json(info, level));
}

/* How many pages there are, and from which level on. */
static bool add_pages(json_t *object, const struct tetlod_info *info)
{
    return json_object_set_new(object, "pages", json_integer(info->page_count)) == 0 &&
           json_object_set_new(object, "first_paged_level", json_integer(info->first_paged_level)) == 0;
}

/* Where the steps over other meshes are. False: memory is out. */
static bool add_topologies(json_t *object, const struct tetlod_info *info)
{
    json_t *topologies = json_array();
    for (uint32_t t = 0; t < info->topology_count; t++) {
        const struct tetlod_topology *topology = &info->topologies[t];
        json_t *times = json_array();
        for (uint32_t s = 0; s < topology->step_count; s++)
            json_array_append_new(times, json_real(topology->times[s]));
        bool whole = json_array_size(times) == topology->step_count;
        json_array_append_new(topologies,
                              whole ? json_pack("{s:i, s:o, s:s, s:I, s:I}", "steps", (int)topology->step_count,
                                                "times", times, "cid", topology->cid, "offset",
                                                (json_int_t)topology->offset, "bytes", (json_int_t)topology->size)
                                    : NULL);
    }
    return json_array_size(topologies) == info->topology_count && !json_object_set_new(object, "topologies",
                                                                                       topologies);
}

json_t *info_json(const struct tetlod_info *info, const char *id)
{
    json_t *fields = json_array(), *levels = json_array(), *cells = json_array();
    for (uint32_t f = 0; f < info->cell_field_count; f++)
        json_array_append_new(cells, cell_field_json(&info->cell_fields[f]));
    for (uint32_t f = 0; f < info->field_count; f++)
        json_array_append_new(fields, field_json(info, f));
    for (uint32_t k = 0; k < info->level_count; k++)
        json_array_append_new(levels, level_json(info, k));
    const double(*b)[3] = info->bounds;
    json_t *object =
        json_pack("{s:s, s:s, s:I, s:I, s:I, s:[[f,f,f],[f,f,f]], s:b, s:I, s:I, s:I, s:o, s:o, s:o, "
                  "s:o}",
                  "id", id, "cid", info->cid, "vertices", (json_int_t)info->vertices, "tets", (json_int_t)info->tets,
                  "bytes", (json_int_t)info->bytes, "bounds", b[0][0], b[0][1], b[0][2], b[1][0], b[1][1], b[1][2],
                  "lossless", info->lossless, "degenerate_tets", (json_int_t)info->degenerate_tets, "inverted_tets",
                  (json_int_t)info->inverted_tets, "unused_points", (json_int_t)info->unused_points, "fields", fields,
                  "cell_fields", cells, "levels", levels, "metadata", metadata_json(info));
    // lists that lost an element to a failed allocation are not the stream's
    if (object && (json_array_size(fields) != info->field_count || json_array_size(levels) != info->level_count ||
                   json_array_size(cells) != info->cell_field_count || (info->topology_count &&
                                                                        !add_topologies(object, info)) ||
                   (info->page_count && !add_pages(object, info)))) {
        json_decref(object);
        return NULL;
    }
    return object;
}
