/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/report/level_mesh.h"

#include <string.h>

#include "format/fail.h"
#include "src/util/array.h"

enum tetlod_status level_mesh_copy(const struct tetlod_info *info, const struct tetlod_cursor *cursor,
                                   struct tetmesh *out, struct tetlod_error *error)
{
    struct tetlod_mesh mesh;
    tetlod_cursor_mesh(cursor, &mesh);
    *out = (struct tetmesh){.vertex_count = mesh.vertices, .tet_count = mesh.tets, .position_type = info->position_type};
    out->positions = array_new(mesh.vertices, 3 * sizeof(double));
    out->corners = array_new(mesh.tets, 4 * sizeof(uint32_t));
    enum tetlod_status status = TETLOD_OK;
    if (!out->positions || !out->corners)
        TETLOD_TRY_DONE(tetlodi_fail_nomem(error, "a level", (uint64_t)mesh.vertices * 24 + (uint64_t)mesh.tets * 16));
    memcpy(out->positions, mesh.positions, mesh.vertices * 3 * sizeof(double));
    memcpy(out->corners, mesh.corners, mesh.tets * 4 * sizeof(uint32_t));
    for (uint32_t f = 0; f < info->field_count; f++) {
        const struct tetlod_field *field = &info->fields[f];
        if (!mesh.fields[f])
            continue;
        TETLOD_TRY_DONE(tetmesh_add_field(out, field->name, field->components, field->type, error));
        memcpy(out->fields[out->field_count - 1].values, mesh.fields[f],
               (size_t)mesh.vertices * field->components * sizeof(double));
    }
done:
    if (status != TETLOD_OK)
        tetmesh_fini(out);
    return status;
}
