/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/mesh/mixed_cells.h"
#include "src/mesh/tetmesh.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "format/fail.h"
#include "src/util/array.h"

void point_field_fini(struct point_field *field)
{
    free(field->name);
    free(field->values);
    *field = (struct point_field){0};
}

void tetmesh_fini(struct tetmesh *mesh)
{
    for (uint32_t f = 0; f < mesh->field_count; f++)
        point_field_fini(&mesh->fields[f]);
    for (uint32_t f = 0; f < mesh->cell_field_count; f++)
        point_field_fini(&mesh->cell_fields[f]);
    free(mesh->fields);
    free(mesh->cell_fields);
    free(mesh->positions);
    free(mesh->corners);
    free(mesh->parents);
    free(mesh->further_places);
    if (mesh->cells)
        cells_fini(mesh->cells);
    if (mesh->further)
        tetmesh_fini(mesh->further);
    free(mesh->cells);
    free(mesh->further);
    *mesh = (struct tetmesh){0};
}

/* Appends to a list of fields of `rows` values each. */
static enum tetlod_status add_field(struct point_field **list, uint32_t *count, const char *name, uint32_t components,
                                    enum tetlod_type type, uint64_t rows, struct tetlod_error *error)
{
    struct point_field *fields = array_resize(*list, (size_t)*count + 1, sizeof *fields);
    if (!fields)
        return tetlodi_fail_nomem(error, "a field", sizeof *fields);
    *list = fields;
    struct point_field field = {.name = strdup(name), .components = components, .type = type};
    if (rows <= SIZE_MAX / components)
        field.values = array_zero((size_t)rows * components, sizeof *field.values);
    if (!field.name || !field.values) {
        point_field_fini(&field);
        return tetlodi_fail_nomem(error, name, rows * components * 8);
    }
    fields[(*count)++] = field;
    return TETLOD_OK;
}

enum tetlod_status tetmesh_add_field(struct tetmesh *mesh, const char *name, uint32_t components, enum tetlod_type type,
                                     struct tetlod_error *error)
{
    return add_field(&mesh->fields, &mesh->field_count, name, components, type, mesh->vertex_count, error);
}

enum tetlod_status tetmesh_add_cell_field(struct tetmesh *mesh, const char *name, uint32_t components,
                                          enum tetlod_type type, uint64_t cells, struct tetlod_error *error)
{
    return add_field(&mesh->cell_fields, &mesh->cell_field_count, name, components, type, cells, error);
}

static uint32_t find_field(const struct point_field *fields, uint32_t count, const char *name)
{
    for (uint32_t f = 0; f < count; f++)
        if (strcmp(fields[f].name, name) == 0)
            return f;
    return TETLOD_NONE;
}

uint32_t tetmesh_find_field(const struct tetmesh *mesh, const char *name)
{
    return find_field(mesh->fields, mesh->field_count, name);
}

uint32_t tetmesh_find_cell_field(const struct tetmesh *mesh, const char *name)
{
    return find_field(mesh->cell_fields, mesh->cell_field_count, name);
}

uint32_t tetmesh_find_region(const struct tetmesh *mesh)
{
    static const char *const names[] = {
        "region",    "regions",  "RegionId",        "material",      "MaterialId", "material_id",
        "Material",  "ObjectId", "ElementBlockIds", "gmsh:physical", "medit:ref",  "mfem:attribute",
        "cell_tags", "Region",   "PhysicalIds",     "CellEntityIds", "region_id"};
    for (size_t n = 0; n < sizeof names / sizeof *names; n++) {
        uint32_t f = tetmesh_find_cell_field(mesh, names[n]);
        if (f != TETLOD_NONE && mesh->cell_fields[f].is_integer && mesh->cell_fields[f].components == 1)
            return f;
    }
    return TETLOD_NONE;
}

static void keep_rows(double *values, uint32_t width, const uint32_t *target, uint32_t count)
{
    for (uint32_t v = 0; v < count; v++)
        if (target[v] != TETLOD_NONE)
            memmove(values + (size_t)target[v] * width, values + (size_t)v * width, width * sizeof *values);
}

/* New numbers of the points that are marked; gives how many there are. */
static uint32_t number_used(const unsigned char *used, uint32_t count, uint32_t *target)
{
    uint32_t kept = 0;
    for (uint32_t v = 0; v < count; v++)
        target[v] = used[v] ? kept++ : TETLOD_NONE;
    return kept;
}

static enum tetlod_status keep_used(struct tetmesh *mesh, const unsigned char *used, struct tetlod_error *error)
{
    uint32_t *target = array_new(mesh->vertex_count, sizeof *target);
    if (!target)
        return tetlodi_fail_nomem(error, "the used points", (uint64_t)mesh->vertex_count * sizeof *target);
    uint32_t kept = number_used(used, mesh->vertex_count, target);
    keep_rows(mesh->positions, 3, target, mesh->vertex_count);
    for (uint32_t f = 0; f < mesh->field_count; f++)
        keep_rows(mesh->fields[f].values, mesh->fields[f].components, target, mesh->vertex_count);
    for (size_t c = 0; c < 4 * (size_t)mesh->tet_count; c++)
        mesh->corners[c] = target[mesh->corners[c]];
    mesh->unused_points += mesh->vertex_count - kept;
    mesh->vertex_count = kept;
    free(target);
    return TETLOD_OK;
}

enum tetlod_status tetmesh_drop_unused(struct tetmesh *mesh, struct tetlod_error *error)
{
    unsigned char *used = array_zero(mesh->vertex_count, 1);
    if (!used)
        return tetlodi_fail_nomem(error, "the used points", mesh->vertex_count);
    for (size_t c = 0; c < 4 * (size_t)mesh->tet_count; c++)
        used[mesh->corners[c]] = 1;
    enum tetlod_status status = memchr(used, 0, mesh->vertex_count) ? keep_used(mesh, used, error) : TETLOD_OK;
    free(used);
    return status;
}

size_t tetmesh_find_outside(const uint32_t *corners, size_t count, uint32_t vertex_count)
{
    enum { STEP = 4096 };
    for (size_t begin = 0; begin < count; begin += STEP) {
        size_t end = count - begin < STEP ? count : begin + STEP;
        uint32_t outside = 0;
        for (size_t c = begin; c < end; c++)
            outside |= corners[c] >= vertex_count;
        for (size_t c = begin; outside && c < end; c++)
            if (corners[c] >= vertex_count)
                return c;
    }
    return count;
}

static bool has_repeated_corner(const uint32_t *c)
{
    return (c[0] == c[1]) | (c[0] == c[2]) | (c[0] == c[3]) | (c[1] == c[2]) | (c[1] == c[3]) | (c[2] == c[3]);
}

enum tetlod_status tetmesh_validate_tets(const struct tetmesh *mesh, struct tetlod_error *error)
{
    if (mesh->tet_count == 0)
        return tetlodi_fail(error, TETLOD_ERR_MESH,
                            "there is no tetrahedron in it, nor another cell that has a volume");
    size_t count = 4 * (size_t)mesh->tet_count, outside = tetmesh_find_outside(mesh->corners, count,
                                                                               mesh->vertex_count);
    if (outside < count)
        return tetlodi_fail(error, TETLOD_ERR_MESH, "tetrahedron %zu refers to point %u, but there are only %u points",
                            outside / 4, mesh->corners[outside], mesh->vertex_count);
    for (size_t t = 0; t < mesh->tet_count; t++)
        if (has_repeated_corner(mesh->corners + 4 * t))
            return tetlodi_fail(error, TETLOD_ERR_MESH,
                                "tetrahedron %zu names the same point twice; --drop-degenerate leaves such out", t);
    return TETLOD_OK;
}

/* The first of some values that is not finite, or their number. */
static size_t find_infinite(const double *values, size_t count)
{
    size_t i = 0;
    while (i < count && isfinite(values[i]))
        i++;
    return i;
}

enum tetlod_status tetmesh_validate_positions(const struct tetmesh *mesh, struct tetlod_error *error)
{
    size_t count = 3 * (size_t)mesh->vertex_count, i = find_infinite(mesh->positions, count);
    if (i < count)
        return tetlodi_fail(error, TETLOD_ERR_MESH, "point %zu: its %c coordinate is not a finite number", i / 3,
                            "xyz"[i % 3]);
    return TETLOD_OK;
}

enum tetlod_status tetmesh_validate_field(const struct tetmesh *mesh, uint32_t number, struct tetlod_error *error)
{
    const struct point_field *field = &mesh->fields[number];
    size_t count = (size_t)mesh->vertex_count * field->components, i = find_infinite(field->values, count);
    if (i < count)
        return tetlodi_fail(error, TETLOD_ERR_MESH, "field %s: its value at point %zu is not a finite number%s%s",
                            field->name, i / field->components, isnan(field->values[i]) ? " but NaN" : "",
                            isnan(field->values[i]) ? "; --nan-fill of build or convert gives such points one" : "");
    return TETLOD_OK;
}

enum tetlod_status tetmesh_validate_values(const struct tetmesh *mesh, struct tetlod_error *error)
{
    TETLOD_TRY(tetmesh_validate_positions(mesh, error));
    for (uint32_t f = 0; f < mesh->field_count; f++)
        TETLOD_TRY(tetmesh_validate_field(mesh, f, error));
    return TETLOD_OK;
}

enum tetlod_status tetmesh_validate(const struct tetmesh *mesh, struct tetlod_error *error)
{
    TETLOD_TRY(tetmesh_validate_tets(mesh, error));
    return tetmesh_validate_values(mesh, error);
}

void tetmesh_set_origin(struct tetmesh *mesh, const struct tetlod_info *info, uint32_t level)
{
    const struct tetlod_level *at = &info->levels[level];
    mesh->origin = (struct mesh_origin){.level = level, .domain_error = at->domain_error};
    if (!info->lossless || level + 1 < info->level_count)
        memcpy(mesh->origin.id, info->cid, sizeof mesh->origin.id);
    for (uint32_t f = 0; f < info->field_count; f++) {
        uint32_t own = tetmesh_find_field(mesh, info->fields[f].name);
        double error = at->errors[f * TETLOD_MEASURES + TETLOD_MAX];
        if (own == TETLOD_NONE || isnan(error))
            continue;
        mesh->fields[own].has_error = true;
        mesh->fields[own].error = error;
    }
}

enum tetlod_status tetmesh_shape(const struct tetlod_info *info, uint32_t level, struct tetmesh *out,
                                 struct tetlod_error *error)
{
    const struct tetlod_level *counts = &info->levels[level];
    *out = (struct tetmesh){.vertex_count = (uint32_t)counts->vertices, .tet_count = (uint32_t)counts->tets,
                            .position_type = info->position_type};
    out->fields = array_zero(info->field_count + (size_t)1, sizeof *out->fields); // there may be none
    while (out->fields && out->field_count < info->field_count) {
        const struct tetlod_field *field = &info->fields[out->field_count];
        char *name = strdup(field->name);
        if (!name)
            break;
        out->fields[out->field_count++] = (struct point_field){.name = name, .components = field->components,
                                                               .type = field->type};
    }
    if (out->fields && out->field_count == info->field_count) {
        tetmesh_set_origin(out, info, level);
        return TETLOD_OK;
    }
    tetmesh_fini(out);
    return tetlodi_fail_nomem(error, "a level", 0);
}

void point_field_range(const struct point_field *field, uint32_t vertex_count, double range[2])
{
    size_t count = (size_t)vertex_count * field->components;
    range[0] = range[1] = count ? field->values[0] : 0;
    for (size_t i = 1; i < count; i++) {
        if (field->values[i] < range[0])
            range[0] = field->values[i];
        if (field->values[i] > range[1])
            range[1] = field->values[i];
    }
}

bool range_has_scale(const double range[2])
{
    double width = range[1] - range[0];
    return width > 0 && isfinite(width) && isfinite(1 / width);
}

double range_fraction(const double range[2], double error)
{
    if (range_has_scale(range))
        return error / (range[1] - range[0]);
    return range[1] > range[0] && error > 0;
}
