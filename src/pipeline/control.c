/* SPDX-License-Identifier: BSD-3-Clause */
/* What the name of a controlled field means: a field, a magnitude, a component or a coordinate, and a limit. */
#include <ctype.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "format/fail.h"
#include "src/mesh/ids.h"
#include "src/mesh/tet_geom.h"
#include "src/pipeline/build.h"
#include "src/util/nearest.h"

static double derived_value(const double *row, uint32_t components, uint32_t component)
{
    if (component != TETLOD_NONE)
        return row[component];
    double sum = 0;
    for (uint32_t c = 0; c < components; c++)
        sum += row[c] * row[c];
    return sqrt(sum);
}

/* Adds the magnitude (component TETLOD_NONE) or a component of a field as a field of its own, once. */
static enum tetlod_status derive(struct tetmesh *mesh, uint32_t field, uint32_t component, const char *name,
                                 uint32_t *out, struct tetlod_error *error)
{
    *out = tetmesh_find_field(mesh, name);
    if (*out != TETLOD_NONE)
        return TETLOD_OK;
    enum tetlod_type type = mesh->fields[field].type;
    TETLOD_TRY(tetmesh_add_field(mesh, name, 1, type, error));
    const struct point_field *from = &mesh->fields[field];
    *out = mesh->field_count - 1;
    for (size_t v = 0; v < mesh->vertex_count; v++) {
        double value = derived_value(from->values + v * from->components, from->components, component);
        mesh->fields[*out].values[v] = type == TETLOD_FLOAT32 ? (float)value : value;
    }
    return TETLOD_OK;
}

/* Which part of a field the text behind its colon means. False: none. */
static bool part_of(const struct point_field *field, const char *text, uint32_t *component)
{
    char *end;
    *component = TETLOD_NONE;
    if (strcmp(text, "mag") == 0)
        return true;
    unsigned long number = strtoul(text, &end, 10);
    *component = (uint32_t)number;
    return isdigit((unsigned char)*text) && *end == 0 && number < field->components;
}

uint32_t build_control_source(const struct tetmesh *mesh, uint32_t field, uint32_t *component)
{
    const struct point_field *derived = &mesh->fields[field];
    const char *colon = strrchr(derived->name, ':');
    for (uint32_t f = 0; f < mesh->field_count && colon && derived->components == 1; f++) {
        const struct point_field *from = &mesh->fields[f];
        if (strlen(from->name) != (size_t)(colon - derived->name) ||
            strncmp(from->name, derived->name, strlen(from->name)) != 0 ||
            !part_of(from, colon + 1, component))
            continue;
        bool same = true;
        for (size_t v = 0; v < mesh->vertex_count && same; v++) {
            double value = derived_value(from->values + v * from->components, from->components, *component);
            same = derived->values[v] == (derived->type == TETLOD_FLOAT32 ? (float)value : value);
        }
        return same ? f : TETLOD_NONE;
    }
    return TETLOD_NONE;
}

static double width_of(const struct tetmesh *mesh, uint32_t field)
{
    double range[2];
    point_field_range(&mesh->fields[field], mesh->vertex_count, range);
    return range[1] - range[0];
}

/* An error e of every one of n components is one of sqrt(n) e of the vector at most. A constant magnitude leaves
 * nothing to be a share of: then the vector's own range counts. */
static double share_of_vector(const struct tetmesh *mesh, uint32_t magnitude, uint32_t vector)
{
    double own = width_of(mesh, magnitude), whole = width_of(mesh, vector);
    return (own > 0 && whole > 0 ? smaller(own / whole, 1) : 1) / sqrt(mesh->fields[vector].components);
}

void build_controls_add_vectors(const struct tetmesh *mesh, struct build_control *controls, uint32_t *count)
{
    uint32_t given = *count;
    for (uint32_t i = 0; i < given; i++) {
        uint32_t component, vector = build_control_source(mesh, controls[i].field, &component), k = 0;
        if (vector == TETLOD_NONE || component != TETLOD_NONE)
            continue;
        while (k < *count && controls[k].field != vector)
            k++;
        double share = share_of_vector(mesh, controls[i].field, vector), limit = controls[i].limit;
        if (k == *count)
            controls[(*count)++] = (struct build_control){vector, limit, share};
        else if (controls[k].limit <= 0 || limit <= 0)
            controls[k].share = share;
        else if (limit * share < controls[k].limit)
            controls[k] = (struct build_control){vector, limit, share};
    }
}

static enum tetlod_status no_such_field(const struct tetmesh *mesh, const char *text, struct tetlod_error *error)
{
    char names[160] = "";
    const char *best = NULL;
    size_t used = 0;
    for (uint32_t f = 0; f < mesh->field_count; f++) {
        nearest_offer(text, mesh->fields[f].name, &best);
        if (used < sizeof names)
            used += (size_t)snprintf(names + used, sizeof names - used, "%s%s", f ? ", " : "", mesh->fields[f].name);
    }
    if (tetmesh_find_cell_field(mesh, text) != TETLOD_NONE)
        return tetlodi_fail(error, TETLOD_ERR_FIELD,
                            "'%.60s' has values of cells, which are stored exactly; --cell-data average makes a field "
                            "at points of it",
                            text);
    return tetlodi_fail(error, TETLOD_ERR_FIELD, "there is no field '%.60s'%s%.60s%s; there is %s", text,
                        best ? " (did you mean '" : "", best ? best : "", best ? "'?)" : "",
                        mesh->field_count ? names : "none");
}

bool build_control_limit(const char *text, double *out)
{
    char *end;
    if (!strpbrk(text, ".%e") || !isdigit((unsigned char)*text))
        return false;
    *out = strtod(text, &end) * (strchr(text, '%') ? 0.01 : 1);
    return (*end == 0 || strcmp(end, "%") == 0) && *out > 0 && isfinite(*out);
}

/* NAME:500, where 500 is no component: somebody means units. */
static bool looks_like_units(const struct tetmesh *mesh, const char *text)
{
    const char *colon = strrchr(text, ':');
    char *end;
    if (!colon || !isdigit((unsigned char)colon[1]) || (strtod(colon + 1, &end), *end))
        return false;
    for (uint32_t f = 0; f < mesh->field_count; f++)
        if (strlen(mesh->fields[f].name) == (size_t)(colon - text) &&
            strncmp(mesh->fields[f].name, text, (size_t)(colon - text)) == 0)
            return true;
    return false;
}

static enum tetlod_status unit_limit(const char *text, struct tetlod_error *error)
{
    const char *colon = strrchr(text, ':');
    int length = (int)(colon - text);
    return tetlodi_fail(error, TETLOD_ERR_FIELD,
                        "'%.60s' has no component %.20s; a limit in its units is --field %.*s --abs-error %.20s, "
                        "one in the range %.*s:0.01 or %.*s:1%%",
                        text, colon + 1, length, text, colon + 1, length, text, length, text);
}

/* ---- coordinates */

static const char *const coordinate_names[3] = {COORDINATE_NAME "x", COORDINATE_NAME "y", COORDINATE_NAME "z"};

/* Adds a coordinate of the points as a field of its own, once. */
static enum tetlod_status add_coordinate(struct tetmesh *mesh, uint32_t axis, uint32_t *out, struct tetlod_error *error)
{
    *out = tetmesh_find_field(mesh, coordinate_names[axis]);
    if (*out != TETLOD_NONE)
        return TETLOD_OK;
    TETLOD_TRY(tetmesh_add_field(mesh, coordinate_names[axis], 1, mesh->position_type, error));
    *out = mesh->field_count - 1;
    for (size_t v = 0; v < mesh->vertex_count; v++)
        mesh->fields[*out].values[v] = mesh->positions[3 * v + axis];
    return TETLOD_OK;
}

static enum tetlod_status named_coordinate(struct tetmesh *mesh, const char *name, uint32_t *out,
                                           struct tetlod_error *error)
{
    for (uint32_t axis = 0; axis < 3; axis++)
        if (strcmp(name, coordinate_names[axis]) == 0)
            return add_coordinate(mesh, axis, out, error);
    return TETLOD_OK;
}

enum tetlod_status build_control_coordinate(struct tetmesh *mesh, struct build_control *out, struct tetlod_error *error)
{
    double width[3];
    for (size_t axis = 0; axis < 3; axis++) {
        double least = INFINITY, greatest = -INFINITY;
        for (size_t v = 0; v < mesh->vertex_count; v++) {
            least = smaller(least, mesh->positions[3 * v + axis]);
            greatest = larger(greatest, mesh->positions[3 * v + axis]);
        }
        width[axis] = greatest - least;
    }
    uint32_t axis = width[1] > width[0] ? 1 : 0;
    axis = width[2] > width[axis] ? 2 : axis;
    *out = (struct build_control){0};
    return add_coordinate(mesh, axis, &out->field, error);
}

/* ---- what a text names */

enum tetlod_status build_control_parse(struct tetmesh *mesh, const char *text, struct build_control *out,
                                       struct tetlod_error *error)
{
    char *name = strdup(text), *colon;
    if (!name)
        return tetlodi_fail_nomem(error, "a field's name", strlen(text));
    uint32_t component;
    enum tetlod_status status = TETLOD_OK;
    *out = (struct build_control){.field = tetmesh_find_field(mesh, name)};
    if (out->field == TETLOD_NONE && (colon = strrchr(name, ':')) && build_control_limit(colon + 1, &out->limit)) {
        *colon = 0;
        out->field = tetmesh_find_field(mesh, name);
    }
    if (out->field == TETLOD_NONE && (colon = strrchr(name, ':'))) {
        *colon = 0;
        uint32_t whole = tetmesh_find_field(mesh, name);
        bool there = whole != TETLOD_NONE && part_of(&mesh->fields[whole], colon + 1, &component);
        *colon = ':';
        if (there && component == 0 && mesh->fields[whole].components == 1)
            // the only component of a scalar: a copy would leave the field itself without its error and its local bound
            out->field = whole;
        else if (there)
            status = derive(mesh, whole, component, name, &out->field, error);
    }
    if (status == TETLOD_OK && out->field == TETLOD_NONE)
        status = named_coordinate(mesh, name, &out->field, error);
    if (status == TETLOD_OK && out->field == TETLOD_NONE)
        status = looks_like_units(mesh, name) ? unit_limit(name, error) : no_such_field(mesh, name, error);
    free(name);
    return status;
}

enum tetlod_status build_regions_choose(const struct tetmesh *mesh, const char *name, const char **out,
                                        struct tetlod_error *error)
{
    uint32_t field = TETLOD_NONE;
    *out = NULL;
    if (name)
        field = tetmesh_find_cell_field(mesh, name);
    else
        TETLOD_TRY(ids_find_region(mesh, &field, error));
    if (name && field == TETLOD_NONE && strcmp(name, "none") == 0)
        return TETLOD_OK;
    if (name && field == TETLOD_NONE)
        return tetlodi_fail(error, TETLOD_ERR_FIELD, "--region: no values of cells are named '%.60s'%s%.60s", name,
                            mesh->cell_field_count ? "; there is " : "; there are none",
                            mesh->cell_field_count ? mesh->cell_fields[0].name : "");
    if (name && (!mesh->cell_fields[field].is_integer || mesh->cell_fields[field].components != 1))
        return tetlodi_fail(error, TETLOD_ERR_FIELD, "--region: '%.60s' is not one integer for each cell", name);
    *out = field == TETLOD_NONE ? NULL : mesh->cell_fields[field].name;
    return TETLOD_OK;
}
