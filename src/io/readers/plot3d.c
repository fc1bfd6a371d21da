/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * PLOT3D, binary: the number of grids, unless there is one only and it is left out; the three int32 dimensions of each;
 * then for each grid all x, all y, all z and perhaps an int32 for each point (iblank, 0: the point is blanked). The
 * solution: the same counts, and for each grid four numbers (Mach number, angle of attack, Reynolds number, time), then
 * density, the three momenta, stagnation energy, each for all points; what follows is not read. Byte order, precision,
 * iblank and record markers (the size of each record before and after it, as Fortran writes) are those that make the
 * size of the grid's file come out.
 */
#include <stdlib.h>
#include <string.h>

#include "format/fail.h"
#include "format/common/round.h"
#include "src/io/services/file_values.h"
#include "src/io/readers/readers.h"
#include "src/util/array.h"

struct layout {
    bool big_endian, has_markers, has_count, has_blank;
    enum value_type type;
    uint64_t grids;
    size_t dims_at; /* the dimensions of the first grid */
    size_t data_at; /* its record, or numbers */
};

static int64_t int_at(const unsigned char *bytes, bool big_endian, uint64_t at)
{
    int64_t value;
    values_to_ints(bytes + at, VALUE_INT32, big_endian, 1, &value);
    return value;
}

/* Points of a grid; 0 if its dimensions are not in the bytes, or more than these can hold. */
static uint64_t points_of(const unsigned char *bytes, size_t size, const struct layout *layout, uint64_t grid,
                          uint32_t dims[3])
{
    uint64_t points = 1;
    for (int d = 0; d < 3; d++) {
        uint64_t at = layout->dims_at + 12 * grid + 4 * (uint64_t)d;
        int64_t n = at + 4 <= size ? int_at(bytes, layout->big_endian, at) : 0;
        if (n < 1 || (uint64_t)n > size / points)
            return 0;
        dims[d] = (uint32_t)n;
        points *= (uint64_t)n;
    }
    return points;
}

static uint64_t grid_size(const struct layout *layout, uint64_t points)
{
    return points * (3 * value_size(layout->type) + (layout->has_blank ? 4 : 0));
}

/* Whether both markers about a record are its size. */
static bool is_record(const unsigned char *bytes, size_t size, const struct layout *layout, uint64_t at,
                      uint64_t length)
{
    return at + length + 8 <= size && int_at(bytes, layout->big_endian, at) == (int64_t)length &&
           int_at(bytes, layout->big_endian, at + 4 + length) == (int64_t)length;
}

/* Where the numbers of grids and their dimensions end; false if the markers about them are not there. */
static bool read_head(const unsigned char *bytes, size_t size, struct layout *layout)
{
    size_t marker = layout->has_markers ? 4 : 0, at = marker;
    layout->grids = 1;
    if (size < 32)
        return false;
    if (layout->has_count) {
        int64_t grids = int_at(bytes, layout->big_endian, at);
        if (grids < 1 || (uint64_t)grids > size / 12 || (marker && !is_record(bytes, size, layout, 0, 4)))
            return false;
        layout->grids = (uint64_t)grids;
        at += 4 + 2 * marker;
    }
    layout->dims_at = at;
    layout->data_at = at + 12 * (size_t)layout->grids + marker;
    return !marker || is_record(bytes, size, layout, at - marker, 12 * layout->grids);
}

/* Whether the sizes of all grids sum up to that of the file. */
static bool fits(const unsigned char *bytes, size_t size, struct layout *layout)
{
    uint32_t dims[3];
    if (!read_head(bytes, size, layout))
        return false;
    uint64_t at = layout->data_at;
    for (uint64_t g = 0; g < layout->grids; g++) {
        uint64_t points = points_of(bytes, size, layout, g, dims), length = grid_size(layout, points);
        if (!points || at > size || length > size - at ||
            (layout->has_markers && !is_record(bytes, size, layout, at, length)))
            return false;
        at += length + (layout->has_markers ? 8 : 0);
    }
    return at == size;
}

/* Finds the layout under which the bytes are grids and nothing else; the simplest if several fit. */
static bool find_layout(const unsigned char *bytes, size_t size, struct layout *out)
{
    for (int trial = 0; trial < 32; trial++) {
        struct layout layout = {.big_endian = trial & 1,
                                .type = trial & 2 ? VALUE_FLOAT64 : VALUE_FLOAT32,
                                .has_blank = trial & 4,
                                .has_count = trial & 8,
                                .has_markers = trial & 16};
        if (fits(bytes, size, &layout)) {
            *out = layout;
            return true;
        }
    }
    return false;
}

bool plot3d_sniff(const unsigned char *bytes, size_t size)
{
    struct layout layout;
    return find_layout(bytes, size, &layout);
}

static enum tetlod_type float_type(const struct layout *layout)
{
    return layout->type == VALUE_FLOAT32 ? TETLOD_FLOAT32 : TETLOD_FLOAT64;
}

/* One component of all points into every width-th double. */
static void read_column(const unsigned char *bytes, const struct layout *layout, uint64_t points, uint64_t column,
                        double *out, size_t width)
{
    size_t size = value_size(layout->type);
    for (uint64_t p = 0; p < points; p++)
        values_to_doubles(bytes + (column * points + p) * size, layout->type, layout->big_endian, 1, out + p * width);
}

/* ---- solution */

static void fill_pressure(struct tetmesh *mesh)
{
    const double *density = mesh->fields[0].values, *momentum = mesh->fields[1].values,
                 *energy = mesh->fields[2].values;
    for (uint32_t v = 0; v < mesh->vertex_count; v++) {
        const double *m = momentum + 3 * (size_t)v;
        double pressure = 0.4 * (energy[v] - (m[0] * m[0] + m[1] * m[1] + m[2] * m[2]) / (2 * density[v]));
        mesh->fields[3].values[v] = tetlodi_round(mesh->fields[3].type, pressure);
    }
}

/* The fields of a grid from its five columns. */
static enum tetlod_status add_fields(struct tetmesh *mesh, const struct layout *layout, const unsigned char *numbers,
                                     struct tetlod_error *error)
{
    static const struct {
        const char *name;
        uint32_t components, column;
    } fields[] = {{"Density", 1, 0}, {"Momentum", 3, 1}, {"StagnationEnergy", 1, 4}, {"Pressure", 1, 5}};
    for (uint32_t f = 0; f < 4; f++) {
        TETLOD_TRY(tetmesh_add_field(mesh, fields[f].name, fields[f].components, float_type(layout), error));
        for (uint32_t c = 0; f < 3 && c < fields[f].components; c++)
            read_column(numbers, layout, mesh->vertex_count, fields[f].column + c, mesh->fields[f].values + c,
                        fields[f].components);
    }
    fill_pressure(mesh);
    return TETLOD_OK;
}

static enum tetlod_status fail_short(const struct io_input *input, uint64_t needed, struct tetlod_error *error)
{
    return tetlodi_fail(error, TETLOD_ERR_MESH, "%.400s: has %zu bytes, a solution for this grid has %llu",
                        input->other_path,
                        input->other_size, (unsigned long long)needed);
}

static enum tetlod_status read_solution(struct block *grids, const struct io_input *input, const struct layout *layout,
                                        struct tetlod_error *error)
{
    uint64_t marker = layout->has_markers ? 4 : 0, at = layout->data_at, width = value_size(layout->type);
    for (uint64_t g = 0; g < layout->grids; g++)
        for (uint64_t d = 0; d < 3; d++) {
            uint64_t dim_at = layout->dims_at + 12 * g + 4 * d;
            if (dim_at + 4 > input->other_size || int_at(input->other, layout->big_endian, dim_at) != grids[g].dims[d])
                return tetlodi_fail(error, TETLOD_ERR_MESH,
                                    "%.400s: does not start with the grid's dimensions %u x %u x %u; is it its "
                                    "solution?",
                                    input->other_path, grids[g].dims[0], grids[g].dims[1], grids[g].dims[2]);
        }
    for (uint64_t g = 0; g < layout->grids; g++) {
        uint64_t numbers = at + marker + 4 * width + 2 * marker, size = 5 * width * grids[g].mesh.vertex_count;
        if (numbers > input->other_size || size > input->other_size - numbers)
            return fail_short(input, numbers + size, error);
        TETLOD_TRY(add_fields(&grids[g].mesh, layout, input->other + numbers, error));
        at = numbers + size + marker;
    }
    return TETLOD_OK;
}

/* ---- grids */

static enum tetlod_status read_blank(struct block *block, const unsigned char *bytes, const struct layout *layout,
                                     struct io_report *report, struct tetlod_error *error)
{
    uint32_t points = block->mesh.vertex_count;
    unsigned char *blank = array_new(points, 1);
    if (!blank)
        return tetlodi_fail_nomem(error, "the blanked points", points);
    for (uint32_t p = 0; p < points; p++)
        blank[p] = int_at(bytes, layout->big_endian, 4 * (uint64_t)p) == 0;
    enum tetlod_status status = block_hide_points(block, blank, report, error);
    free(blank);
    return status;
}

static enum tetlod_status read_grid(struct blocks *out, const struct io_input *input, const struct layout *layout,
                                    uint64_t grid,
                                    uint64_t *io_at, struct io_report *report, struct tetlod_error *error)
{
    struct block *block;
    TETLOD_TRY(blocks_add(out, &block, error));
    uint64_t points = points_of(input->bytes, input->size, layout, grid, block->dims);
    const unsigned char *numbers = input->bytes + *io_at + (layout->has_markers ? 4 : 0);
    if (layout->grids == 1 && (block->dims[0] < 2 || block->dims[1] < 2 || block->dims[2] < 2))
        return tetlodi_fail(error, TETLOD_ERR_MESH, "a grid of %u x %u x %u points has no volume", block->dims[0],
                            block->dims[1],
                            block->dims[2]);
    TETLOD_TRY(assemble_points(&block->mesh, points, float_type(layout), error));
    for (uint32_t c = 0; c < 3; c++)
        read_column(numbers, layout, points, c, block->mesh.positions + c, 3);
    if (layout->has_blank)
        TETLOD_TRY(read_blank(block, numbers + 3 * points * value_size(layout->type), layout, report, error));
    *io_at += grid_size(layout, points) + (layout->has_markers ? 8 : 0);
    return TETLOD_OK;
}

enum tetlod_status plot3d_read(struct blocks *out, const struct io_input *input, struct io_report *report,
                               struct tetlod_error *error)
{
    struct layout layout;
    size_t first = out->count;
    if (!find_layout(input->bytes, input->size, &layout))
        return tetlodi_fail(error, TETLOD_ERR_MESH, "its %zu bytes are not binary PLOT3D grids, of either byte order",
                            input->size);
    uint64_t at = layout.data_at;
    for (uint64_t g = 0; g < layout.grids; g++)
        TETLOD_TRY(read_grid(out, input, &layout, g, &at, report, error));
    return input->other ? read_solution(out->at + first, input, &layout, error) : TETLOD_OK;
}
