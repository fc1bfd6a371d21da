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

/* What the points of one component get from those around them. */
struct means {
    double *sums;    /* [vertex] */
    uint32_t *parts; /* [vertex] */
};

/* One ring further. False: there was nothing to fill, or nothing to fill it from. */
static bool fill_ring(const struct tetmesh *mesh, struct point_field *field, uint32_t component, const struct means *means,
                      uint64_t *io_count)
{
    uint32_t k = field->components;
    bool any = false;
    memset(means->sums, 0, mesh->vertex_count * sizeof *means->sums);
    memset(means->parts, 0, mesh->vertex_count * sizeof *means->parts);
    for (size_t t = 0; t < mesh->tet_count; t++)
        for (int c = 0; c < 4; c++) {
            const uint32_t *corners = mesh->corners + 4 * t;
            for (int d = 0; d < 4 && isnan(field->values[(size_t)corners[c] * k + component]); d++) {
                double value = field->values[(size_t)corners[d] * k + component];
                means->sums[corners[c]] += isnan(value) ? 0 : value;
                means->parts[corners[c]] += !isnan(value);
            }
        }
    for (size_t v = 0; v < mesh->vertex_count; v++)
        if (means->parts[v]) {
            put(field, v * k + component, means->sums[v] / means->parts[v], io_count);
            any = true;
        }
    return any;
}

enum tetlod_status nan_fill(struct tetmesh *mesh, const struct nan_fill *fill, uint64_t *out_count,
                            struct tetlod_error *error)
{
    struct means means = {array_new(mesh->vertex_count, sizeof(double)), array_new(mesh->vertex_count, sizeof(uint32_t))};
    enum tetlod_status status = TETLOD_OK;
    *out_count = 0;
    if (!means.sums || !means.parts)
        status = tetlodi_fail_nomem(error, "the values that are filled", mesh->vertex_count * (uint64_t)12);
    for (uint32_t f = 0; f < mesh->field_count && status == TETLOD_OK; f++) {
        struct point_field *field = &mesh->fields[f];
        if (fill->kind == NAN_FILL_VALUE)
            fill_value(field, (size_t)mesh->vertex_count * field->components, fill->value, out_count);
        for (uint32_t c = 0; c < field->components && fill->kind == NAN_FILL_NEIGHBOURS;)
            c += !fill_ring(mesh, field, c, &means, out_count);
    }
    free(means.sums);
    free(means.parts);
    return status;
}
