/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/mesh/ids.h"

#include <ctype.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "format/fail.h"
#include "src/util/array.h"

/* Cells have at most so many regions, and at most this share of the vertices lies between two: flags of single cells
 * are no regions. */
enum { MAX_REGIONS = 64 };
static const double MAX_BETWEEN = 0.5;

/* NodeId, GlobalIds, node_id, ID, nodeIDs; but neither grid nor FLUID. */
static bool name_says_ids(const char *name)
{
    size_t length = strlen(name);
    length -= length && name[length - 1] == 's';
    if (length < 2 || (name[length - 1] | 0x20) != 'd' || (name[length - 2] | 0x20) != 'i')
        return false;
    const char *id = name + length - 2;
    if (length == 2)
        return true;
    if (id[0] == 'I')
        return id[1] == 'd' || !isupper((unsigned char)id[-1]);
    return id[1] == 'd' && !isalpha((unsigned char)id[-1]);
}

bool ids_by_kind(const struct point_field *field)
{
    return field->is_integer || name_says_ids(field->name);
}

/* Floating-point numbers from 2^53 on are whole whatever they stand for. */
bool ids_by_values(const struct point_field *field, size_t count)
{
    bool differ = false;
    for (size_t i = 0; i < count; i++) {
        if (field->values[i] != floor(field->values[i]) || !(fabs(field->values[i]) < 0x1p53))
            return false;
        differ |= field->values[i] != field->values[0];
    }
    return differ;
}

/* Is it the same everywhere? */
static bool is_constant(const struct point_field *field, size_t count)
{
    size_t i = field->components;
    while (i < count && field->values[i] == field->values[i - field->components])
        i++;
    return i >= count;
}

void ids_find(const struct point_field *fields, uint32_t field_count, size_t count, bool *out)
{
    bool any_other = false;
    for (uint32_t f = 0; f < field_count; f++) {
        const size_t values = fields[f].components * count;
        out[f] = ids_by_kind(&fields[f]) || ids_by_values(&fields[f], values);
        any_other |= !out[f] && !is_constant(&fields[f], values);
    }
    for (uint32_t f = 0; f < field_count && !any_other; f++)
        out[f] = ids_by_kind(&fields[f]);
}

uint32_t ids_first_other(const struct tetmesh *mesh, uint32_t components)
{
    for (uint32_t f = 0; f < mesh->field_count; f++) {
        const struct point_field *field = &mesh->fields[f];
        if (!field->is_ids && !ids_by_kind(field) && (!components || field->components == components))
            return f;
    }
    return TETLOD_NONE;
}

/* ---- regions */

/* Ranks of processes and the like also have few values, but their interfaces are no part of the model. */
static bool is_about_computing(const char *name)
{
    static const char *const words[] = {"proc",   "rank",    "partition", "ghost",    "color",
                                        "colour", "quality", "celltype",  "cell_type"};
    char lower[64];
    size_t length = 0;
    for (; name[length] && length + 1 < sizeof lower; length++)
        lower[length] = (char)tolower((unsigned char)name[length]);
    lower[length] = 0;
    for (size_t w = 0; w < sizeof words / sizeof *words; w++)
        if (strstr(lower, words[w]))
            return true;
    return false;
}

/* 2 to MAX_REGIONS different values? */
static bool has_few_values(const double *values, size_t count)
{
    double seen[MAX_REGIONS];
    uint32_t found = 0, at = 0;
    for (size_t i = 0; i < count; i++) {
        if (found && seen[at] == values[i])
            continue;
        for (at = 0; at < found && seen[at] != values[i]; at++)
            ;
        if (at == MAX_REGIONS)
            return false;
        if (at == found)
            seen[found++] = values[i];
    }
    return found > 1;
}

/* The share of the vertices that cells of different values meet at. */
static double share_between(const struct tetmesh *mesh, const double *values, double *first, uint8_t *between)
{
    size_t count = 0;
    for (uint32_t v = 0; v < mesh->vertex_count; v++)
        first[v] = NAN;
    memset(between, 0, mesh->vertex_count);
    for (size_t c = 0; c < 4 * (size_t)mesh->tet_count; c++) {
        uint32_t v = mesh->corners[c];
        if (isnan(first[v]))
            first[v] = values[c / 4];
        between[v] |= first[v] != values[c / 4];
    }
    for (uint32_t v = 0; v < mesh->vertex_count; v++)
        count += between[v];
    return (double)count / mesh->vertex_count;
}

enum tetlod_status ids_find_region(const struct tetmesh *mesh, uint32_t *out, struct tetlod_error *error)
{
    *out = tetmesh_find_region(mesh);
    if (*out != TETLOD_NONE)
        return TETLOD_OK;
    double *first = array_new(mesh->vertex_count, sizeof *first);
    uint8_t *between = array_new(mesh->vertex_count, 1);
    enum tetlod_status status =
        first && between ? TETLOD_OK : tetlodi_fail_nomem(error, "the regions", 9 * (uint64_t)mesh->vertex_count);
    for (uint32_t f = 0; f < mesh->cell_field_count && status == TETLOD_OK && *out == TETLOD_NONE; f++) {
        const struct point_field *field = &mesh->cell_fields[f];
        if (field->is_integer && field->components == 1 && !is_about_computing(field->name) &&
            has_few_values(field->values, mesh->tet_count) &&
            share_between(mesh, field->values, first, between) <= MAX_BETWEEN)
            *out = f;
    }
    free(first);
    free(between);
    return status;
}
