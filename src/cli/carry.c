/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/cli/carry.h"

#include <stdlib.h>
#include <string.h>

#include "format/fail.h"
#include "src/pipeline/field_choice.h"

static bool is_named(const struct point_field *fields, uint32_t count, const char *name, size_t length)
{
    for (uint32_t f = 0; f < count; f++)
        if (strlen(fields[f].name) == length && strncmp(fields[f].name, name, length) == 0)
            return true;
    return false;
}

static enum tetlod_status check_carry(const struct tetmesh *mesh, const char *list, struct tetlod_error *error)
{
    for (const char *at = list; *at;) {
        size_t length = strcspn(at, ",");
        if (!is_named(mesh->fields, mesh->field_count, at, length) &&
            !is_named(mesh->cell_fields, mesh->cell_field_count, at, length))
            return tetlodi_fail(error, TETLOD_ERR_FIELD, "--carry: there is no field '%.*s'", (int)length, at);
        at += length + (at[length] == ',');
    }
    return TETLOD_OK;
}

/* Drops the fields that are neither carried nor controlled. */
static void drop_fields(struct tetmesh *mesh, const char *carry, struct build_control *controls, uint32_t count)
{
    uint32_t kept = 0;
    for (uint32_t f = 0; f < mesh->field_count; f++) {
        bool keep = field_choice_lists(carry, mesh->fields[f].name);
        for (uint32_t i = 0; i < count; i++)
            keep |= controls[i].field == f;
        if (!keep) {
            free(mesh->fields[f].name);
            free(mesh->fields[f].values);
            continue;
        }
        for (uint32_t i = 0; i < count; i++)
            if (controls[i].field == f)
                controls[i].field = kept;
        mesh->fields[kept++] = mesh->fields[f];
    }
    mesh->field_count = kept;
}

/* The same of cells, but for the regions'. */
static void drop_cell_fields(struct tetmesh *mesh, const char *carry, const char *region)
{
    uint32_t kept = 0;
    for (uint32_t f = 0; f < mesh->cell_field_count; f++)
        if ((region && strcmp(region, mesh->cell_fields[f].name) == 0) ||
            field_choice_lists(carry, mesh->cell_fields[f].name))
            mesh->cell_fields[kept++] = mesh->cell_fields[f];
        else
            point_field_fini(&mesh->cell_fields[f]);
    mesh->cell_field_count = kept;
}

enum tetlod_status carry_only(struct tetmesh *mesh, const char *list, const char *region,
                              struct build_control *controls, uint32_t count,
                              struct tetlod_error *error)
{
    TETLOD_TRY(check_carry(mesh, list, error));
    drop_fields(mesh, list, controls, count);
    drop_cell_fields(mesh, list, region);
    return TETLOD_OK;
}
