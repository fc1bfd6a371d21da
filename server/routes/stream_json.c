/* SPDX-License-Identifier: BSD-3-Clause */
#include "server/routes/stream_json.h"

#include <inttypes.h>
#include <stdbool.h>
#include <stdio.h>
#include <string.h>

#include "server/http/params.h"
#include "server/store/dataset.h"
#include "src/report/info_json.h"
#include "src/report/series_json.h"

/* What belongs to a stream, relative to the description's URL; links with {} are templates (RFC 6570). */
static json_t *links_of(const struct dataset *dataset, const char *name)
{
    const struct tetlod_info *info = dataset_info(dataset);
    char id[3 * ID_CAPACITY];
    const char *cid = info->cid;
    if (!percent_encode(name, id, sizeof id))
        return NULL;
    json_t *links = json_object();
    char self[24] = "";
    if (dataset_topology_number(dataset))
        snprintf(self, sizeof self, "?topology=%" PRIu32, dataset_topology_number(dataset));
    const struct {
        const char *name, *tail;
        bool content; /* under the content id */
        bool steps;   /* of a series only */
    } all[] = {
        {"self", self, false, false},
        {"mesh", "/mesh{?error,abs_error,level,tets,bytes,field,measure,format,cells,time,step}", false, false},
        {"prefix", "/prefix{?error,abs_error,level,tets,bytes,field,measure,fields,time,step}", false, false},
        {"level", "/levels/{level}/mesh.{format}{?cells}", true, false},
        {"surface", "/levels/{level}/surface.{format}", true, false},
        {"isosurface", "/levels/{level}/isosurface.{format}{?field,value}", true, false},
        {"slice", "/levels/{level}/slice.{format}{?origin,normal}", true, false},
        {"records", "/records/{from}-{to}{?fields}", true, false},
        {"stream", "/stream", true, false},
        {"group", "/bands/{band}/groups/{group}{?fields}", true, true},
        {"step", "/bands/{band}/steps/{step}/mesh.{format}{?cells}", true, true},
        {"stepSurface", "/bands/{band}/steps/{step}/surface.{format}", true, true},
        {"stepIsosurface", "/bands/{band}/steps/{step}/isosurface.{format}{?field,value}", true, true},
        {"stepSlice", "/bands/{band}/steps/{step}/slice.{format}{?origin,normal}", true, true},
    };
    for (size_t i = 0; links && i < sizeof all / sizeof *all; i++) {
        char path[640];
        if (all[i].steps && !dataset_series(dataset))
            continue;
        snprintf(path, sizeof path, "%s%s%s%s", id, all[i].content ? "/" : "", all[i].content ? cid : "",
                 all[i].tail);
        json_object_set_new(links, all[i].name, json_string(path));
    }
    return links;
}

json_t *describe_stream(const struct dataset *dataset, const char *id)
{
    const struct tetlod_info *info = dataset_info(dataset);
    const struct tetlod_series *series = dataset_series(dataset);
    json_t *object = info_json(info, id);
    json_t *levels = json_object_get(object, "levels");
    for (uint32_t k = 0; k < info->level_count; k++)
        json_object_set_new(json_array_get(levels, k), "offset", json_integer((json_int_t)info->levels[k].offset));
    json_object_set_new(object, "links", links_of(dataset, id));
    if (series)
        json_object_set_new(object, "series", series_json(series, info));
    return object;
}

static bool has_steps(const struct tetlod_info *info)
{
    for (uint32_t s = 0; s < info->section_count; s++)
        if (!strcmp(info->sections[s].tag, "TIME"))
            return true;
    return info->topology_count > 0;
}

json_t *describe_in_catalogue(const struct tetlod_info *info, const char *name)
{
    char id[3 * ID_CAPACITY], path[3 * ID_CAPACITY + 16];
    if (!percent_encode(name, id, sizeof id))
        return NULL;
    snprintf(path, sizeof path, "meshes/%s", id);
    json_t *fields = json_array();
    for (uint32_t f = 0; f < info->field_count; f++)
        json_array_append_new(fields, json_string(info->fields[f].name));
    return json_pack("{s:s, s:s, s:I, s:I, s:I, s:i, s:b, s:o, s:{s:s}}", "id", name, "cid", info->cid, "vertices",
                     (json_int_t)info->vertices, "tets", (json_int_t)info->tets, "bytes", (json_int_t)info->bytes,
                     "levels", (int)info->level_count, "series", has_steps(info), "fields", fields, "links", "self",
                     path);
}
