/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/mesh/cell_average.h"

#include <float.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "format/fail.h"
#include "format/common/round.h"
#include "src/mesh/tet_geom.h"
#include "src/util/array.h"

/* Adds a component's values times the volumes at the points; a degenerate tetrahedron has a weight that only counts
 * where all around a point are so. */
static void gather(const struct tetmesh *mesh, const struct point_field *from, uint32_t component, double *sums,
                   double *weights)
{
    for (size_t t = 0; t < mesh->tet_count; t++) {
        const uint32_t *c = mesh->corners + 4 * t;
        const double *p = mesh->positions;
        double value = from->values[t * from->components + component];
        if (!isfinite(value))
            continue;
        double weight = fabs(tet_volume6(p + 3 * (size_t)c[0], p + 3 * (size_t)c[1], p + 3 * (size_t)c[2],
                                         p + 3 * (size_t)c[3]));
        weight = weight > 0 ? weight : DBL_MIN;
        for (int k = 0; k < 4; k++) {
            sums[c[k]] += weight * value;
            weights[c[k]] += weight;
        }
    }
}

enum tetlod_status cell_average(struct tetmesh *mesh, uint32_t cell_field, struct tetlod_error *error)
{
    char name[512];
    const struct point_field *from = &mesh->cell_fields[cell_field];
    size_t count = mesh->vertex_count;
    double *sums = array_new(count, sizeof *sums), *weights = array_new(count, sizeof *weights);
    enum tetlod_status status = TETLOD_OK;
    if (!sums || !weights) {
        status = tetlodi_fail_nomem(error, from->name, (uint64_t)count * 16);
        goto done;
    }
    snprintf(name, sizeof name, "%s", from->name);
    for (int n = 2; tetmesh_find_field(mesh, name) != TETLOD_NONE; n++)
        snprintf(name, sizeof name, "%.400s_%d", from->name, n);
    TETLOD_TRY_DONE(tetmesh_add_field(mesh, name, from->components, from->type, error));
    double *values = mesh->fields[mesh->field_count - 1].values;
    memcpy(mesh->fields[mesh->field_count - 1].unit, from->unit, sizeof from->unit);
    for (uint32_t k = 0; k < from->components; k++) {
        for (size_t v = 0; v < count; v++)
            sums[v] = weights[v] = 0;
        gather(mesh, from, k, sums, weights);
        for (size_t v = 0; v < count; v++) {
            double mean = weights[v] > 0 ? sums[v] / weights[v] : NAN;
            values[v * from->components + k] = tetlodi_round(from->type, mean);
        }
    }
done:
    free(sums);
    free(weights);
    return status;
}
