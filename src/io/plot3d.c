/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * PLOT3D, binary, one grid, no record markers: three int32 dimensions, then all x, all y, all z. The solution: the same
 * dimensions, four numbers (Mach number, angle of attack, Reynolds number, time), then density, the three momenta,
 * stagnation energy, each for all points; what follows is not read. Byte order and precision are those that make the
 * size of the grid's file come out.
 */
#include <string.h>

#include "format/fail.h"
#include "src/io/formats.h"
#include "src/io/file_values.h"

struct layout {
    uint32_t dims[3];
    uint64_t points;
    bool big_endian;
    enum value_type type;
};

/* Finds the layout under which `size` bytes are dimensions and three numbers a point. */
static bool find_layout(const unsigned char *bytes, size_t size, struct layout *out)
{
    if (size < 12)
        return false;
    for (int trial = 0; trial < 4; trial++) {
        struct layout layout = {.points = 1, .big_endian = trial & 1, .type = trial & 2 ? VALUE_FLOAT64 : VALUE_FLOAT32};
        uint64_t numbers = (size - 12) / value_size(layout.type);
        int64_t dims[3];
        values_to_ints(bytes, VALUE_INT32, layout.big_endian, 3, dims);
        for (int d = 0; d < 3 && layout.points; d++) {
            bool fits = dims[d] > 0 && (uint64_t)dims[d] <= numbers / layout.points;
            layout.points = fits ? layout.points * (uint64_t)dims[d] : 0;
            layout.dims[d] = fits ? (uint32_t)dims[d] : 0;
        }
        if (layout.points && (size - 12) % value_size(layout.type) == 0 && numbers == 3 * layout.points) {
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

/* One component of all points into every width-th double. */
static void read_column(const unsigned char *bytes, const struct layout *layout, uint64_t column, double *out, size_t width)
{
    size_t size = value_size(layout->type);
    for (uint64_t p = 0; p < layout->points; p++)
        values_to_doubles(bytes + (column * layout->points + p) * size, layout->type, layout->big_endian, 1,
                          out + p * width);
}

static void fill_pressure(struct tetmesh *mesh)
{
    const double *density = mesh->fields[0].values, *momentum = mesh->fields[1].values, *energy = mesh->fields[2].values;
    for (uint32_t v = 0; v < mesh->vertex_count; v++) {
        const double *m = momentum + 3 * (size_t)v;
        double pressure = 0.4 * (energy[v] - (m[0] * m[0] + m[1] * m[1] + m[2] * m[2]) / (2 * density[v]));
        mesh->fields[3].values[v] = mesh->fields[3].type == TETLOD_FLOAT32 ? (double)(float)pressure : pressure;
    }
}

static enum tetlod_status read_solution(struct tetmesh *mesh, const struct io_input *input, const struct layout *grid,
                                        struct tetlod_error *error)
{
    static const struct {
        const char *name;
        uint32_t components, column;
    } fields[] = {{"Density", 1, 0}, {"Momentum", 3, 1}, {"StagnationEnergy", 1, 4}, {"Pressure", 1, 5}};
    int64_t dims[3] = {0};
    if (input->other_size >= 12)
        values_to_ints(input->other, VALUE_INT32, grid->big_endian, 3, dims);
    for (int d = 0; d < 3; d++)
        if (dims[d] != grid->dims[d])
            return tetlodi_fail(error, TETLOD_ERR_MESH,
                                "%.80s: does not start with the grid's dimensions %u x %u x %u; is it its solution?",
                                input->other_path, grid->dims[0], grid->dims[1], grid->dims[2]);
    uint64_t needed = 12 + (4 + 5 * grid->points) * value_size(grid->type);
    if (input->other_size < needed)
        return tetlodi_fail(error, TETLOD_ERR_MESH, "%.80s: has %zu bytes, a solution for this grid has %llu",
                            input->other_path, input->other_size, (unsigned long long)needed);
    const unsigned char *numbers = input->other + 12 + 4 * value_size(grid->type);
    enum tetlod_type type = grid->type == VALUE_FLOAT32 ? TETLOD_FLOAT32 : TETLOD_FLOAT64;
    for (uint32_t f = 0; f < 4; f++) {
        TETLOD_TRY(tetmesh_add_field(mesh, fields[f].name, fields[f].components, type, error));
        for (uint32_t c = 0; f < 3 && c < fields[f].components; c++)
            read_column(numbers, grid, fields[f].column + c, mesh->fields[f].values + c, fields[f].components);
    }
    fill_pressure(mesh);
    return TETLOD_OK;
}

enum tetlod_status plot3d_read(struct blocks *out, const struct io_input *input, struct io_report *report,
                            struct tetlod_error *error)
{
    struct block *block;
    TETLOD_TRY(blocks_add(out, &block, error));
    struct tetmesh *mesh = &block->mesh;
    struct layout layout;
    if (!find_layout(input->bytes, input->size, &layout))
        return tetlodi_fail(error, TETLOD_ERR_MESH,
                            "its %zu bytes are not a PLOT3D grid (one binary grid without record markers)", input->size);
    if (layout.dims[0] < 2 || layout.dims[1] < 2 || layout.dims[2] < 2)
        return tetlodi_fail(error, TETLOD_ERR_MESH, "a grid of %u x %u x %u points has no volume", layout.dims[0],
                            layout.dims[1], layout.dims[2]);
    TETLOD_TRY(assemble_points(mesh, layout.points, layout.type == VALUE_FLOAT32 ? TETLOD_FLOAT32 : TETLOD_FLOAT64, error));
    for (uint32_t c = 0; c < 3; c++)
        read_column(input->bytes + 12, &layout, c, mesh->positions + c, 3);
    if (input->other)
        TETLOD_TRY(read_solution(mesh, input, &layout, error));
    memcpy(block->dims, layout.dims, sizeof block->dims);
    (void)report;
    return TETLOD_OK;
}
