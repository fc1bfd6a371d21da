/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/pipeline/cell_types.h"

#include <math.h>

enum tetlod_cell_type cell_type_of(const struct point_field *field, size_t cells)
{
    enum tetlod_cell_type type = TETLOD_CELL_INT8;
    if (!field->is_integer)
        return field->type == TETLOD_FLOAT32 ? TETLOD_CELL_FLOAT32 : TETLOD_CELL_FLOAT64;
    for (size_t i = 0; i < cells * field->components; i++) {
        double value = field->values[i];
        if (!(fabs(value) <= 0x1p53) || value != floor(value) || (value == 0 && signbit(value)))
            return TETLOD_CELL_FLOAT64; // filled or averaged since it was read
        enum tetlod_cell_type least = value >= -0x1p7 && value < 0x1p7     ? TETLOD_CELL_INT8
                                      : value >= -0x1p15 && value < 0x1p15 ? TETLOD_CELL_INT16
                                      : value >= -0x1p31 && value < 0x1p31 ? TETLOD_CELL_INT32
                                                                           : TETLOD_CELL_INT64;
        type = least > type ? least : type;
    }
    return type;
}

enum tetlod_cell_type cell_type_of_both(enum tetlod_cell_type a, enum tetlod_cell_type b)
{
    bool floats = a <= TETLOD_CELL_FLOAT64, other_floats = b <= TETLOD_CELL_FLOAT64;
    if (floats != other_floats)
        return TETLOD_CELL_FLOAT64;
    return a > b ? a : b;
}
