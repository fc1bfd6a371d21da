/* SPDX-License-Identifier: BSD-3-Clause */
#include "server/routes/mesh_formats.h"

#include <string.h>

#include "format/fail.h"
#include "server/http/respond.h"
#include "src/io/io.h"

static const struct mesh_format mesh_formats[] = {
    {"vtu", "application/vnd.vtk.vtu", io_write_vtu_plain, io_layout_vtu},
    {"vtk", "application/vnd.vtk", io_write_vtk, io_layout_vtk},
    {"tetlod", "application/vnd.tetlod", NULL, NULL},
    {NULL, NULL, NULL, NULL},
};

const struct mesh_format *take_mesh_format(struct exchange *exchange, const char *name, bool from_mesh)
{
    for (const struct mesh_format *format = mesh_formats; format->name; format++)
        if (strcmp(format->name, name) == 0 && (!from_mesh || format->write))
            return format;
    json_t *names = json_array();
    for (const struct mesh_format *format = mesh_formats; format->name; format++)
        if (!from_mesh || format->write)
            json_array_append_new(names, json_string(format->name));
    response_problem_choices(exchange->response, 400, exchange->request->target, "formats", names,
                             "there is no format '%.64s' here", name);
    return NULL;
}

enum tetlod_status mesh_format_write(const struct mesh_format *format, const struct tetmesh *mesh, struct buffer *out,
                                     struct tetlod_error *error)
{
    struct tetlodi_sink sink = buffer_sink(out);
    return format->write(mesh, &sink, error);
}

enum tetlod_status mesh_format_measure(const struct mesh_format *format, const struct tetmesh *mesh, uint64_t *out,
                                       struct tetlod_error *error)
{
    struct io_layout *layout;
    TETLOD_TRY(format->lay_out(&layout, mesh, error));
    *out = io_layout_size(layout);
    io_layout_free(layout);
    return TETLOD_OK;
}

/* Both formats are binary. */
uint64_t mesh_format_bytes_of(const struct tetlod_info *info, uint64_t vertices, uint64_t tets)
{
    uint64_t components = 3;
    for (uint32_t f = 0; f < info->field_count; f++)
        components += info->fields[f].components;
    return vertices * components * 8 + tets * (uint64_t)25 + 4096;
}

uint64_t mesh_format_bytes(const struct tetlod_info *info, uint32_t level)
{
    return mesh_format_bytes_of(info, info->levels[level].vertices, info->levels[level].tets);
}
