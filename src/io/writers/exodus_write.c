/* SPDX-License-Identifier: BSD-3-Clause */
/* Writing Exodus II, classic netCDF with 64-bit offsets: one element block of tetrahedra, one step in time; components
 * of fields are variables NAMEX, NAMEY, NAMEZ (which VTK joins), or NAME_1, ... The file is made in memory. */
#include <netcdf.h>
#include <netcdf_mem.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "format/fail.h"
#include "src/io/writers/writers.h"
#include "src/util/array.h"

enum { NAME_SIZE = 257 };

struct writer {
    int file, result; /* result: of the first call that failed */
    int coordinates, connect, times, names[2], numbers, ids;
    int *variables; /* owned: of nodes, then of elements, component by component */
    size_t nodal, elemental;
};

static void keep(struct writer *w, int result)
{
    w->result = w->result == NC_NOERR ? result : w->result;
}

static size_t count_components(const struct point_field *fields, uint32_t count)
{
    size_t components = 0;
    for (uint32_t f = 0; f < count; f++)
        components += fields[f].components;
    return components;
}

static int dimension(struct writer *w, const char *name, size_t size)
{
    int id = 0;
    keep(w, nc_def_dim(w->file, name, size, &id));
    return id;
}

static int variable(struct writer *w, const char *name, nc_type type, int rank, const int *dims)
{
    int id = 0;
    keep(w, nc_def_var(w->file, name, type, rank, dims, &id));
    return id;
}

/* The variables of one kind, and of their names. */
static void define_fields(struct writer *w, const struct point_field *fields, uint32_t count, bool cell,
                          const int dims[2],
                          int name_length, int *out)
{
    char name[64];
    size_t components = count_components(fields, count), v = 0;
    if (!components)
        return;
    int names[2] = {dimension(w, cell ? "num_elem_var" : "num_nod_var", components), name_length};
    w->names[cell] = variable(w, cell ? "name_elem_var" : "name_nod_var", NC_CHAR, 2, names);
    for (uint32_t f = 0; f < count; f++)
        for (uint32_t c = 0; c < fields[f].components; c++, v++) {
            snprintf(name, sizeof name, cell ? "vals_elem_var%zueb1" : "vals_nod_var%zu", v + 1);
            out[v] = variable(w, name, fields[f].type == TETLOD_FLOAT32 ? NC_FLOAT : NC_DOUBLE, 2, dims);
            if (fields[f].unit[0])
                keep(w, nc_put_att_text(w->file, out[v], "units", strlen(fields[f].unit), fields[f].unit));
        }
}

static void define(struct writer *w, const struct tetmesh *mesh)
{
    const float version = 7.16f;
    const int word = 8, large = 1;
    nc_type real = mesh->position_type == TETLOD_FLOAT32 ? NC_FLOAT : NC_DOUBLE;
    keep(w, nc_put_att_float(w->file, NC_GLOBAL, "api_version", NC_FLOAT, 1, &version));
    keep(w, nc_put_att_float(w->file, NC_GLOBAL, "version", NC_FLOAT, 1, &version));
    keep(w, nc_put_att_int(w->file, NC_GLOBAL, "floating_point_word_size", NC_INT, 1, &word));
    keep(w, nc_put_att_int(w->file, NC_GLOBAL, "file_size", NC_INT, 1, &large));
    keep(w, nc_put_att_text(w->file, NC_GLOBAL, "title", 6, "tetlod"));
    int axes = dimension(w, "num_dim", 3), nodes = dimension(w, "num_nodes",
                                                             mesh->vertex_count), blocks, in_block, four, length, step;
    dimension(w, "num_elem", mesh->tet_count);
    blocks = dimension(w, "num_el_blk", 1);
    in_block = dimension(w, "num_el_in_blk1", mesh->tet_count);
    four = dimension(w, "num_nod_per_el1", 4);
    length = dimension(w, "len_name", NAME_SIZE);
    step = dimension(w, "time_step", NC_UNLIMITED);
    (void)axes;
    w->times = variable(w, "time_whole", NC_DOUBLE, 1, &step);
    w->ids = variable(w, "eb_prop1", NC_INT, 1, &blocks);
    keep(w, nc_put_att_text(w->file, w->ids, "name", 2, "ID"));
    w->numbers = variable(w, "eb_status", NC_INT, 1, &blocks);
    for (int d = 0; d < 3; d++) {
        int id = variable(w, (const char *const[]){"coordx", "coordy", "coordz"}[d], real, 1, &nodes);
        w->coordinates = d ? w->coordinates : id;
    }
    w->connect = variable(w, "connect1", NC_INT, 2, (const int[]){in_block, four});
    keep(w, nc_put_att_text(w->file, w->connect, "elem_type", 6, "TETRA4"));
    define_fields(w, mesh->fields, mesh->field_count, false, (const int[]){step, nodes}, length, w->variables);
    define_fields(w, mesh->cell_fields, mesh->cell_field_count, true, (const int[]){step, in_block}, length,
                  w->variables + w->nodal);
    keep(w, nc_enddef(w->file));
}

/* Column c of rows of `width` values, as the value of a variable at the first step. */
static void put_column(struct writer *w, int id, const double *values, uint32_t width, uint32_t c, size_t rows,
                       double *buffer, bool steps)
{
    const size_t start[2] = {0, 0}, size[2] = {steps ? 1 : rows, rows};
    for (size_t r = 0; r < rows; r++)
        buffer[r] = values[r * width + c];
    keep(w, nc_put_vara_double(w->file, id, start, size, buffer));
}

static void put_fields(struct writer *w, const struct point_field *fields, uint32_t count, size_t rows, bool cell,
                       double *buffer)
{
    size_t v = 0;
    for (uint32_t f = 0; f < count; f++)
        for (uint32_t c = 0; c < fields[f].components; c++, v++) {
            char name[NAME_SIZE] = "", part[16] = "";
            const size_t start[2] = {v, 0}, size[2] = {1, NAME_SIZE};
            if (fields[f].components == 3)
                snprintf(part, sizeof part, "%c", "XYZ"[c]);
            else if (fields[f].components > 1)
                snprintf(part, sizeof part, "_%u", c + 1);
            snprintf(name, sizeof name, "%.*s%s", NAME_SIZE - 20, fields[f].name, part);
            keep(w, nc_put_vara_text(w->file, w->names[cell], start, size, name));
            put_column(w, w->variables[v + (cell ? w->nodal : 0)], fields[f].values, fields[f].components, c, rows,
                       buffer, true);
        }
}

static enum tetlod_status put_all(struct writer *w, const struct tetmesh *mesh, struct tetlod_error *error)
{
    size_t rows = mesh->vertex_count > mesh->tet_count ? mesh->vertex_count : mesh->tet_count, zero = 0;
    double *buffer = array_new(rows, sizeof *buffer);
    int *corners = array_new(mesh->tet_count, 4 * sizeof *corners), one = 1;
    const double time = 0;
    if (buffer && corners) {
        keep(w, nc_put_var1_double(w->file, w->times, &zero, &time));
        keep(w, nc_put_var_int(w->file, w->ids, &one));
        keep(w, nc_put_var_int(w->file, w->numbers, &one));
        for (uint32_t d = 0; d < 3; d++)
            put_column(w, w->coordinates + (int)d, mesh->positions, 3, d, mesh->vertex_count, buffer, false);
        for (size_t i = 0; i < 4 * (size_t)mesh->tet_count; i++)
            corners[i] = (int)mesh->corners[i] + 1;
        keep(w, nc_put_var_int(w->file, w->connect, corners));
        put_fields(w, mesh->fields, mesh->field_count, mesh->vertex_count, false, buffer);
        put_fields(w, mesh->cell_fields, mesh->cell_field_count, mesh->tet_count, true, buffer);
    }
    bool nomem = !buffer || !corners;
    free(buffer);
    free(corners);
    return nomem ? tetlodi_fail_nomem(error, "the netCDF file", rows * 8) : TETLOD_OK;
}

enum tetlod_status exodus_write(const struct tetmesh *mesh, const struct tetlodi_sink *sink, struct tetlod_error *error)
{
    struct writer w = {.nodal = count_components(mesh->fields, mesh->field_count),
                       .elemental = count_components(mesh->cell_fields, mesh->cell_field_count)};
    NC_memio image = {0};
    if (mesh->vertex_count > INT32_MAX / 2 || mesh->tet_count > INT32_MAX / 8)
        return tetlodi_fail(error, TETLOD_ERR_LIMIT,
                            "is more than one variable of Exodus holds; write .vtkhdf or .vtu");
    w.variables = array_zero(w.nodal + w.elemental, sizeof *w.variables);
    if (!w.variables)
        return tetlodi_fail_nomem(error, "the variables", (w.nodal + w.elemental) * sizeof(int));
    enum tetlod_status status = TETLOD_OK;
    w.result = nc_create_mem("exodus", NC_64BIT_OFFSET, 1 << 20, &w.file);
    if (w.result == NC_NOERR) {
        define(&w, mesh);
        status = put_all(&w, mesh, error);
        keep(&w, nc_close_memio(w.file, &image));
    }
    if (status == TETLOD_OK)
        status = w.result == NC_NOERR ? sink->write(sink->opaque, image.memory, image.size)
                                      : tetlodi_fail(error, TETLOD_ERR_LIMIT, "netCDF: %s", nc_strerror(w.result));
    free(image.memory);
    free(w.variables);
    return status;
}
