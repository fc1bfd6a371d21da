/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/pipeline/precision.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "format/fail.h"
#include "format/common/round.h"
#include "src/util/array.h"

/* Steps of a grid across its field's range, at least: half a step is 1/65536 of it at most, a sixth of the least error
 * that most ask for. */
enum { STEP_BITS = 15, MAX_GRID_BITS = 30 };

bool precision_is_narrow(const double *values, size_t count)
{
    for (size_t i = 0; i < count; i++)
        if ((double)(float)values[i] != values[i])
            return false;
    return true;
}

/* A power of two times whole numbers, 0 among them where it is in the range: what is round there stays round. It ends
 * inside the range. bits 0: there is no grid, every value is exact at once. The step of ids is 1 at most, so that they
 * are exact. */
static struct grid choose_grid(const double range[2], enum tetlod_type type, bool ids)
{
    struct grid none = {0, 0, 0, 0};
    double width = range[1] - range[0], size = fmax(fabs(range[0]), fabs(range[1]));
    if (!isfinite(width) || !(width > 0))
        return width == 0 ? (struct grid){1, range[0], 1, 0} : none;
    int exponent, of_size;
    frexp(width, &exponent);
    frexp(size, &of_size);
    exponent = exponent - 1 - STEP_BITS; // the range has 2^15 to 2^16 steps
    int least = of_size - (type == TETLOD_FLOAT32 ? 24 : 53); // between neighbours among the numbers of the type
    exponent = exponent > least ? exponent : least;
    exponent = ids && exponent > 0 ? 0 : exponent;
    double step = ldexp(1, exponent), origin = ceil(range[0] / step) * step, most = floor((range[1] - origin) / step);
    unsigned bits = 1;
    while (bits <= MAX_GRID_BITS && (double)((UINT64_C(1) << bits) - 1) < most)
        bits++;
    double last = origin + step * (double)((UINT64_C(1) << bits) - 1);
    last = tetlodi_round(type, last);
    bool good = step > 0 && most > 0 && isfinite(origin) && isfinite(last) && bits <= MAX_GRID_BITS;
    return good ? (struct grid){bits, origin, step, most} : none;
}

/* What a field's grid changes. */
static void weigh_rounding(struct precision *precision, uint32_t f)
{
    const struct point_field *field = &precision->mesh.fields[f];
    double most = 0, sum = 0;
    size_t count = field->grid.bits ? (size_t)precision->mesh.vertex_count * field->components : 0;
    for (size_t i = 0; i < count; i++) {
        double change = fabs(grid_round(&field->grid, field->type, field->values[i]) - field->values[i]);
        most = fmax(most, change);
        // the step is a power of two: no square overflows, and no digit is lost
        sum += change / field->grid.step * (change / field->grid.step);
    }
    precision->rounding[f] = most;
    precision->rounding_rms[f] = count ? sqrt(sum / (double)count) * field->grid.step : 0;
}

static void choose_precision(struct precision *precision, const struct tetmesh *mesh, uint32_t f)
{
    struct point_field *field = &precision->mesh.fields[f];
    double range[2];
    *field = mesh->fields[f];
    if (field->type == TETLOD_FLOAT64 &&
        precision_is_narrow(field->values, (size_t)mesh->vertex_count * field->components))
        field->type = TETLOD_FLOAT32;
    point_field_range(field, mesh->vertex_count, range);
    field->grid = choose_grid(range, field->type, field->is_ids);
    precision->tail |= field->grid.bits > 0;
    weigh_rounding(precision, f);
}

enum tetlod_status precision_init(struct precision *precision, const struct tetmesh *mesh, struct tetlod_error *error)
{
    uint32_t fields = mesh->field_count;
    *precision = (struct precision){.mesh = *mesh,
                                    .rounding = array_zero(fields, sizeof *precision->rounding),
                                    .rounding_rms = array_zero(fields, sizeof *precision->rounding_rms)};
    precision->mesh.fields = array_zero(fields, sizeof *precision->mesh.fields);
    if (!precision->mesh.fields || !precision->rounding || !precision->rounding_rms) {
        precision_fini(precision);
        return tetlodi_fail_nomem(error, "the fields", fields * sizeof *precision->mesh.fields);
    }
    if (mesh->position_type == TETLOD_FLOAT64 && !mesh->position_grid[0].bits &&
        precision_is_narrow(mesh->positions, 3 * (size_t)mesh->vertex_count))
        precision->mesh.position_type = TETLOD_FLOAT32;
    for (uint32_t f = 0; f < fields; f++)
        choose_precision(precision, mesh, f);
    return TETLOD_OK;
}

void precision_fini(struct precision *precision)
{
    free(precision->mesh.fields);
    free(precision->rounding);
    free(precision->rounding_rms);
    *precision = (struct precision){0};
}
