/* SPDX-License-Identifier: BSD-3-Clause */
#include "tests/attack/boxed.h"

#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "tests/attack/shapes.h"

enum { MAX_ARRAYS = 32, TRANSITION = 2 };

struct array {
    char name[64];
    uint32_t components;
    double *values;
};

/* A mesh file. */
struct file_mesh {
    uint32_t vertices, tets, point_count, cell_count;
    double *positions;
    uint32_t *corners, *part;
    struct array points[MAX_ARRAYS], cells[MAX_ARRAYS];
};

static void release(struct file_mesh *mesh)
{
    for (uint32_t i = 0; i < mesh->point_count; i++)
        free(mesh->points[i].values);
    for (uint32_t i = 0; i < mesh->cell_count; i++)
        free(mesh->cells[i].values);
    free(mesh->positions);
    free(mesh->corners);
    free(mesh->part);
}

/* ---- the file */

static double number_of(const unsigned char *bytes, const char *type)
{
    uint64_t bits = 0;
    int size = strcmp(type, "double") == 0 || strstr(type, "int64") ? 8 : 4;
    for (int i = 0; i < size; i++)
        bits = bits << 8 | bytes[i];
    if (strcmp(type, "double") == 0) {
        double value;
        memcpy(&value, &bits, sizeof value);
        return value;
    }
    uint32_t half = (uint32_t)bits;
    float value;
    memcpy(&value, &half, sizeof value);
    return strcmp(type, "float") == 0 ? (double)value : size == 8 ? (double)(int64_t)bits : (double)(int32_t)half;
}

static double *read_numbers(FILE *in, const char *type, size_t count)
{
    size_t size = strcmp(type, "double") == 0 || strstr(type, "int64") ? 8 : 4;
    double *values = oracle_memory(count, sizeof *values);
    unsigned char bytes[8];
    for (size_t i = 0; i < count && fread(bytes, size, 1, in) == 1; i++)
        values[i] = number_of(bytes, type);
    return values;
}

static uint32_t *read_cells(FILE *in, uint32_t tets)
{
    uint32_t *corners = oracle_memory(4 * (size_t)tets, sizeof *corners);
    double *all = read_numbers(in, "int", 5 * (size_t)tets);
    for (size_t t = 0; t < tets; t++)
        for (size_t c = 0; c < 4; c++)
            corners[4 * t + c] = (uint32_t)all[5 * t + 1 + c];
    free(all);
    return corners;
}

static void read_array(FILE *in, const char *line, struct file_mesh *mesh, bool of_cells)
{
    uint32_t components, count, *used = of_cells ? &mesh->cell_count : &mesh->point_count;
    char name[64], type[32];
    if (sscanf(line, "%63s %" SCNu32 " %" SCNu32 " %31s", name, &components, &count, type) != 4 || *used == MAX_ARRAYS)
        return;
    struct array *array = (of_cells ? mesh->cells : mesh->points) + (*used)++;
    snprintf(array->name, sizeof array->name, "%s", name);
    array->components = components;
    array->values = read_numbers(in, type, (size_t)components * count);
}

static bool read_file(struct file_mesh *mesh, const char *path)
{
    FILE *in = fopen(path, "rb");
    char line[256], type[32];
    bool of_cells = false;
    *mesh = (struct file_mesh){0};
    while (in && fgets(line, sizeof line, in)) {
        uint32_t count;
        if (sscanf(line, "POINTS %" SCNu32 " %31s", &mesh->vertices, type) == 2)
            mesh->positions = read_numbers(in, type, 3 * (size_t)mesh->vertices);
        else if (sscanf(line, "CELLS %" SCNu32, &mesh->tets) == 1)
            mesh->corners = read_cells(in, mesh->tets);
        else if (sscanf(line, "CELL_TYPES %" SCNu32, &count) == 1)
            free(read_numbers(in, "int", count));
        else if (strncmp(line, "CELL_DATA", 9) == 0 || strncmp(line, "POINT_DATA", 10) == 0)
            of_cells = line[0] == 'C';
        else if (strncmp(line, "FIELD", 5) != 0)
            read_array(in, line, mesh, of_cells);
    }
    if (in)
        fclose(in);
    return mesh->positions && mesh->corners;
}

/* Spaces are written as %20. */
static const struct array *find(const struct array *arrays, uint32_t count, const char *name)
{
    char written[128] = "";
    for (size_t at = 0; *name && at + 4 < sizeof written; name++)
        at += (size_t)snprintf(written + at, sizeof written - at, *name == ' ' ? "%%20" : "%c", *name);
    for (uint32_t i = 0; i < count; i++)
        if (strcmp(arrays[i].name, written) == 0)
            return &arrays[i];
    return NULL;
}

/* ---- its parts */

/* The original's part of each mark. */
static bool find_parts(const struct region_case *c, struct file_mesh *mesh)
{
    const struct tetlod_info *info = tetlod_info(c->file);
    const struct array *mark = find(mesh->cells, mesh->cell_count, SHAPE_MARK);
    uint32_t field = tetlod_cell_field_index(info, SHAPE_MARK), *part_of = oracle_memory(info->tets + (size_t)1,
                                                                                         sizeof *part_of);
    double *marks = oracle_memory(info->tets, sizeof *marks);
    bool there = mark && field != TETLOD_NONE && tetlod_cells(c->file, field, marks, NULL) == TETLOD_OK;
    for (size_t t = 0; t < info->tets && there; t++)
        part_of[(size_t)marks[t]] = c->original->part[c->original->corners[4 * t]];
    mesh->part = oracle_memory(mesh->vertices, sizeof *mesh->part);
    for (size_t i = 0; i < 4 * (size_t)mesh->tets && there; i++)
        mesh->part[mesh->corners[i]] = part_of[(size_t)mark->values[i / 4]];
    free(part_of);
    free(marks);
    return there;
}

/* ---- the transition */

/* What is said of a field, a fraction of its range; fields come in order. */
static bool read_said(const char **at, const char *name, double *out)
{
    char sought[96];
    snprintf(sought, sizeof sought, " %s ", name);
    const char *found = strstr(*at, sought);
    if (!found || sscanf(found + strlen(sought), "%lf", out) != 1)
        return false;
    *at = found + strlen(sought);
    *out /= 100;
    return true;
}

static bool check_transition(const struct region_case *c, const struct file_mesh *mesh, struct oracle_mesh *level,
                             char *text, size_t size)
{
    const struct tetlod_info *info = tetlod_info(c->file);
    const struct array *region = find(mesh->cells, mesh->cell_count, "Region");
    const char *at = strstr(c->said, "transition between them:");
    struct oracle_place worst[ORACLE_MAX_VALUES];
    bool *wanted = oracle_memory(mesh->tets, sizeof *wanted), good = region && at;
    for (uint32_t t = 0; t < mesh->tets && good; t++)
        wanted[t] = region->values[t] == (double)TRANSITION;
    snprintf(text, size, "region: no field Region, or nothing is said of the transition");
    level->wanted = wanted;
    oracle_overlay(c->original, level, c->radius, worst);
    level->wanted = NULL;
    for (uint32_t f = 0; f < info->field_count && good; f++) {
        double said, truth = 0, range = info->fields[f].range[1] - info->fields[f].range[0];
        if (!info->fields[f].controlled || !(range > 0))
            continue;
        for (uint32_t i = 0; i < level->value_count; i++)
            if (c->field_of[i] == f)
                truth = fmax(truth, worst[i].difference / range);
        good = read_said(&at, info->fields[f].name, &said) && truth <= said * (1 + 1e-9) + 1e-12 &&
               (!c->definite || said <= truth * 1.02 + 1e-9);
        if (!good)
            snprintf(text, size, "transition: %s is off by %.9g, said is %.9g", info->fields[f].name, truth, said);
    }
    free(wanted);
    return good;
}

/* ---- local bounds */

/* s + (M - b) and s - (M - b) of one component against the original: neither may be further off than M. */
static bool check_bound(const struct region_case *c, const struct oracle_mesh *level, const double *bounds, uint32_t i,
                        char *text, size_t size)
{
    struct oracle_mesh original = *c->original, shifted = *level;
    struct oracle_place worst[ORACLE_MAX_VALUES];
    double *values[2], most = 0, range = 0;
    bool good = true;
    for (uint32_t v = 0; v < level->vertices; v++) {
        most = fmax(most, bounds[v]);
        range = fmax(range, fabs(level->values[i][(size_t)v * level->strides[i]]));
    }
    original.value_count = shifted.value_count = 2;
    for (int side = 0; side < 2; side++) {
        values[side] = oracle_memory(level->vertices, sizeof(double));
        for (size_t v = 0; v < level->vertices; v++)
            values[side][v] = level->values[i][v * level->strides[i]] + (side ? -1 : 1) * (most - bounds[v]);
        original.values[side] = c->original->values[i];
        original.strides[side] = c->original->strides[i];
        shifted.values[side] = values[side];
        shifted.strides[side] = 1;
    }
    double within = most * (1 + 1e-9) + 1e-14 * (most + range);
    oracle_overlay(&original, &shifted, c->radius, worst);
    for (uint32_t side = 0; side < 2 && good; side++) {
        uint32_t part = original.part[original.corners[4 * (size_t)worst[side].tet]];
        good = worst[side].difference <= within || oracle_partner(&shifted, part, worst[side].position, c->radius,
                                                                  side, worst[side].value, within);
        if (!good)
            snprintf(text, size, "local bound: it lacks %.9g of %.9g at (%.17g, %.17g, %.17g)",
                     worst[side].difference - most, most,
                     worst[side].position[0], worst[side].position[1], worst[side].position[2]);
    }
    free(values[0]);
    free(values[1]);
    return good;
}

static bool check_bounds(const struct region_case *c, const struct file_mesh *mesh, const struct oracle_mesh *level,
                         char *text, size_t size)
{
    const struct tetlod_info *info = tetlod_info(c->file);
    for (uint32_t f = 0; f < info->field_count; f++) {
        const struct array *bound = find(mesh->points, mesh->point_count, info->fields[f].name);
        for (uint32_t i = 0; i < level->value_count && bound; i++)
            if (info->fields[f].bounds == c->field_of[i] && !check_bound(c, level, bound->values, i, text, size))
                return false;
    }
    return true;
}

bool region_holds(const struct region_case *c, const char *path, char *text, size_t size)
{
    const struct tetlod_info *info = tetlod_info(c->file);
    struct file_mesh mesh;
    bool good = read_file(&mesh, path) && find_parts(c, &mesh);
    struct oracle_mesh level = {mesh.vertices, mesh.tets, c->original->value_count, mesh.positions, mesh.corners,
                                .part = mesh.part,
                                .turn = c->original->turn};
    snprintf(text, size, "region: the file cannot be read, or lacks a field");
    for (uint32_t i = 0; i < level.value_count && good; i++) {
        const struct array *field = find(mesh.points, mesh.point_count, info->fields[c->field_of[i]].name);
        good = field != NULL;
        level.values[i] = good ? field->values + c->component_of[i] : NULL;
        level.strides[i] = good ? field->components : 1;
    }
    if (good) {
        oracle_prepare(&level);
        good = check_transition(c, &mesh, &level, text, size) && check_bounds(c, &mesh, &level, text, size);
        oracle_finish(&level);
    }
    release(&mesh);
    return good;
}
