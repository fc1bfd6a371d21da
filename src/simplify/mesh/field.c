/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/simplify/mesh/field.h"

#include <math.h>

#include "format/common/round.h"
#include "src/mesh/tet_geom.h"

double field_middle(const double range[2])
{
    double middle = range[0] / 2 + range[1] / 2;
    return fabs(middle) > 2 * (range[1] - range[0]) ? middle : 0;
}

double field_round(const struct working_field *field, uint32_t component, double value)
{
    const double *range = field->component_range[component];
    double middle = field->middles[component];
    value = grid_round(&field->grid, field->type, fmin(fmax(value, range[0]), range[1]) + middle) - middle;
    return fmin(fmax(value, range[0]), range[1]);
}

double field_cheap(const struct working_field *field, uint32_t component, const double *free_values, uint32_t count,
                   double middle,
                   double least, double greatest, double slack)
{
    const double *range = field->component_range[component];
    double step = field->grid.step, base = field->middles[component], round = middle;
    least = larger(least, range[0]);
    greatest = smaller(greatest, range[1]);
    for (uint32_t i = 0; i < count; i++)
        if (free_values[i] >= least && free_values[i] <= greatest)
            return free_values[i];
    least = larger(least, middle - slack);
    greatest = smaller(greatest, middle + slack);
    double k = (middle + base - field->grid.origin) / step;
    for (double spacing = 2; field->grid.bits && spacing * step <= greatest - least; spacing *= 2) {
        double value = field->grid.origin + step * (floor(k / spacing + 0.5) * spacing);
        value = tetlodi_round(field->type, value) - base;
        if (value >= least && value <= greatest)
            round = value;
    }
    return round;
}
