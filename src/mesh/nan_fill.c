/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/mesh/nan_fill.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "format/fail.h"
#include "src/util/array.h"

static void put(struct point_field *field, size_t i, double value, uint64_t *io_count)
{
    field->values[i] = grid_round(&field->grid, field->type, value);
    ++*io_count;
}

static void fill_value(struct point_field *field, size_t count, double value, uint64_t *io_count)
{
    for (size_t i = 0; i < count; i++)
        if (isnan(field->values[i]))
            put(field, i, value, io_count);
}

/* The points without a value of one component, and their neighbours: each once, in order. */
struct holes {
    uint32_t count, *vertices;
    size_t *first;        /* [hole + 1] into `neighbours` */
    uint32_t *neighbours;
    double *means;        /* [hole] of a ring; NaN: no neighbour has a value yet */
};

static void holes_fini(struct holes *holes)
{
    free(holes->vertices);
    free(holes->first);
    free(holes->neighbours);
    free(holes->means);
}

static int by_number(const void *a, const void *b)
{
    uint32_t x = *(const uint32_t *)a, y = *(const uint32_t *)b;
    return (x > y) - (x < y);
}

/* The other corners of all tetrahedra at a hole, each once. */
static void drop_repeated(struct holes *holes)
{
    size_t kept = 0;
    for (uint32_t h = 0; h < holes->count; h++) {
        uint32_t *own = holes->neighbours + holes->first[h];
        size_t count = holes->first[h + 1] - holes->first[h];
        qsort(own, count, sizeof *own, by_number);
        holes->first[h] = kept;
        for (size_t i = 0; i < count; i++)
            if (i == 0 || own[i] != own[i - 1])
                holes->neighbours[kept++] = own[i];
    }
    holes->first[holes->count] = kept;
}

static bool find_holes(const struct tetmesh *mesh, const struct point_field *field, uint32_t component,
                       struct holes *out)
{
    uint32_t k = field->components, *number = array_new(mesh->vertex_count, sizeof *number); /* the hole of a vertex */
    out->vertices = array_new(mesh->vertex_count, sizeof *out->vertices);
    for (uint32_t v = 0; number && out->vertices && v < mesh->vertex_count; v++) {
        number[v] = isnan(field->values[(size_t)v * k + component]) ? out->count : TETLOD_NONE;
        if (number[v] != TETLOD_NONE)
            out->vertices[out->count++] = v;
    }
    out->means = array_new(out->count, sizeof *out->means);
    out->first = array_zero((size_t)out->count + 2, sizeof *out->first);
    bool room = number && out->vertices && out->means && out->first;
    for (size_t c = 0; room && c < 4 * (size_t)mesh->tet_count; c++)
        if (number[mesh->corners[c]] != TETLOD_NONE)
            out->first[number[mesh->corners[c]] + 2] += 3;
    for (size_t h = 2; room && h < (size_t)out->count + 2; h++)
        out->first[h] += out->first[h - 1];
    room = room && (out->neighbours = array_new(out->first[out->count + 1], sizeof *out->neighbours));
    for (size_t c = 0; room && c < 4 * (size_t)mesh->tet_count; c++)
        for (size_t d = c & ~(size_t)3; d < (c | 3) + 1 && number[mesh->corners[c]] != TETLOD_NONE; d++)
            if (d != c)
                out->neighbours[out->first[number[mesh->corners[c]] + 1]++] = mesh->corners[d];
    if (room)
        drop_repeated(out);
    free(number);
    return room;
}

/* One ring further. False: there was nothing to fill, or nothing to fill it from. */
static bool fill_ring(struct point_field *field, uint32_t component, const struct holes *holes, uint64_t *io_count)
{
    uint32_t k = field->components;
    bool any = false;
    for (uint32_t h = 0; h < holes->count; h++) {
        double sum = 0;
        uint32_t parts = 0;
        bool open = isnan(field->values[(size_t)holes->vertices[h] * k + component]);
        for (size_t i = holes->first[h]; i < holes->first[h + 1] && open; i++) {
            double value = field->values[(size_t)holes->neighbours[i] * k + component];
            sum += isnan(value) ? 0 : value;
            parts += !isnan(value);
        }
        holes->means[h] = parts ? sum / parts : NAN;
        any |= parts > 0;
    }
    for (uint32_t h = 0; h < holes->count; h++)
        if (!isnan(holes->means[h]))
            put(field, (size_t)holes->vertices[h] * k + component, holes->means[h], io_count);
    return any;
}

static enum tetlod_status fill_from_neighbours(const struct tetmesh *mesh, struct point_field *field,
                                               uint32_t component, uint64_t *io_count,
                                               struct tetlod_error *error)
{
    struct holes holes = {0};
    bool room = find_holes(mesh, field, component, &holes);
    while (room && fill_ring(field, component, &holes, io_count))
        ;
    holes_fini(&holes);
    return room ? TETLOD_OK : tetlodi_fail_nomem(error, "the values that are filled",
                                                 mesh->vertex_count * (uint64_t)24);
}

enum tetlod_status nan_fill(struct tetmesh *mesh, const struct nan_fill *fill, uint64_t *out_count,
                            struct tetlod_error *error)
{
    *out_count = 0;
    for (uint32_t f = 0; f < mesh->field_count; f++) {
        struct point_field *field = &mesh->fields[f];
        if (fill->kind == NAN_FILL_VALUE)
            fill_value(field, (size_t)mesh->vertex_count * field->components, fill->value, out_count);
        for (uint32_t c = 0; c < field->components && fill->kind == NAN_FILL_NEIGHBOURS; c++)
            TETLOD_TRY(fill_from_neighbours(mesh, field, c, out_count, error));
    }
    return TETLOD_OK;
}
