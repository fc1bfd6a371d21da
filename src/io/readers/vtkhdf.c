/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * Reading VTKHDF: the group VTKHDF of an HDF5 file, of type UnstructuredGrid (in parts, one after the other in each
 * data set) or ImageData; versions 1.0 and 2.x with steps in time.
 */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "format/fail.h"
#include "src/io/services/contain.h"
#include "src/io/readers/readers.h"
#include "src/io/services/h5.h"
#include "src/io/services/pieces.h"
#include "src/io/services/time_steps.h"
#include "src/util/array.h"

struct vtkhdf {
    hid_t root;
    uint64_t size; /* of the file */
    struct blocks *out;
    const struct io_read_options *options;
    struct io_report *report;
    struct tetlod_error *error;
    bool has_steps;
    uint64_t step;
    uint32_t part, ranges; /* the one to be read, from 1; 0: all. ranges > 1: which one of the only part's ranges */
    bool counts;           /* none: they, or the ranges, are counted */
};

/* Where a part begins in the data sets. */
struct part {
    uint64_t points, cells, connectivity; /* how many */
    uint64_t first_point, first_cell, first_offset, first_connectivity;
    uint64_t points_before, cells_before; /* of the step's parts before */
};

/* An entry of the data set Steps/name: where a step begins. 0 if the file has no steps, or no such data set. */
static enum tetlod_status step_entry(const struct vtkhdf *v, const char *name, uint64_t *out)
{
    char path[512];
    int64_t *values;
    uint64_t count;
    *out = 0;
    if (!v->has_steps || strlen(name) > 400)
        return TETLOD_OK;
    memcpy(path, "Steps/", 6);
    memcpy(path + 6, name, strlen(name) + 1);
    if (!h5_has(v->root, path))
        return TETLOD_OK;
    TETLOD_TRY(h5_load_ints(v->root, path, v->size, &values, &count, v->error));
    bool good = v->step < count && values[v->step] >= 0;
    *out = good ? (uint64_t)values[v->step] : 0;
    free(values);
    return good ? TETLOD_OK : tetlodi_fail(v->error, TETLOD_ERR_MESH, "data set %.80s has no entry for the step", path);
}

static enum tetlod_status read_points(struct vtkhdf *v, const struct part *part, struct tetmesh *mesh)
{
    struct h5_set set;
    TETLOD_TRY(h5_open_set(v->root, "Points", v->size, &set, v->error));
    enum tetlod_status status = set.rank == 2 && set.dims[1] == 3 && part->points <= set.dims[0]
                                    ? assemble_points(mesh, part->points, set.type, v->error)
                                    : tetlodi_fail(v->error, TETLOD_ERR_MESH,
                                                   "data set Points should be %llu x 3 numbers or more",
                                                   (unsigned long long)part->points);
    if (status == TETLOD_OK)
        status = h5_read_doubles(&set, part->first_point, part->points, mesh->positions, v->error);
    H5Dclose(set.id);
    return status;
}

/* Opens a data set of integers of which so many are needed. */
static enum tetlod_status open_ints(struct vtkhdf *v, const char *name, uint64_t count, struct h5_set *out)
{
    TETLOD_TRY(h5_open_set(v->root, name, v->size, out, v->error));
    if (out->rank == 1 && count <= out->dims[0])
        return TETLOD_OK;
    H5Dclose(out->id);
    return tetlodi_fail(v->error, TETLOD_ERR_MESH, "data set %s should have %llu numbers or more", name,
                        (unsigned long long)count);
}

static enum tetlod_status read_types(struct vtkhdf *v, const struct part *part, struct cells *cells)
{
    struct h5_set set;
    TETLOD_TRY(open_ints(v, "Types", part->cells, &set));
    cells->types = array_new((size_t)part->cells, 1);
    enum tetlod_status status = cells->types ? h5_read_bytes(&set, part->first_cell, part->cells, cells->types,
                                                             v->error)
                                             : tetlodi_fail_nomem(v->error, "the cells", part->cells);
    for (uint64_t c = 0; c < part->cells && status == TETLOD_OK; c++)
        if (cells->types[c] == VTK_TYPE_POLYHEDRON)
            cells->types[c] = 255;
    H5Dclose(set.id);
    return status;
}

static enum tetlod_status read_offsets(struct vtkhdf *v, const struct part *part, struct cells *cells)
{
    struct h5_set set;
    TETLOD_TRY(open_ints(v, "Offsets", part->cells + 1, &set));
    cells->offsets = array_new((size_t)part->cells + 1, sizeof *cells->offsets);
    enum tetlod_status status = cells->offsets ? h5_read_ints(&set, part->first_offset, part->cells + 1,
                                                              (int64_t *)cells->offsets, v->error)
                                               : tetlodi_fail_nomem(v->error, "the cells", part->cells * 8);
    H5Dclose(set.id);
    return status;
}

/* The corners of a range are those between its first offset and its last; its offsets count from there. */
static enum tetlod_status narrow_corners(struct vtkhdf *v, struct part *io_part, uint64_t *offsets)
{
    const uint64_t first = offsets[0], end = offsets[io_part->cells];
    if (first > end || end > io_part->connectivity)
        return tetlodi_fail(v->error, TETLOD_ERR_MESH, "data set Offsets: %llu..%llu do not fit the %llu corners",
                            (unsigned long long)first, (unsigned long long)end,
                            (unsigned long long)io_part->connectivity);
    io_part->first_connectivity += first;
    io_part->connectivity = end - first;
    for (uint64_t c = 0; c <= io_part->cells; c++)
        offsets[c] -= first; // what falls becomes more than there is, which blocks_merge.c refuses
    return TETLOD_OK;
}

static enum tetlod_status read_connectivity(struct vtkhdf *v, const struct part *part, struct cells *cells)
{
    struct h5_set set;
    TETLOD_TRY(open_ints(v, "Connectivity", part->connectivity, &set));
    cells->connectivity = array_new((size_t)part->connectivity, sizeof *cells->connectivity);
    enum tetlod_status status =
        cells->connectivity ? h5_read_numbers(&set, part->first_connectivity, part->connectivity, cells->connectivity,
                                              v->error)
                            : tetlodi_fail_nomem(v->error, "the cells", part->connectivity * 4);
    H5Dclose(set.id);
    return status;
}

static enum tetlod_status read_cells(struct vtkhdf *v, const struct part *part, struct cells *cells)
{
    struct part own = *part;
    TETLOD_TRY(read_types(v, part, cells));
    TETLOD_TRY(read_offsets(v, part, cells));
    if (v->ranges > 1)
        TETLOD_TRY(narrow_corners(v, &own, cells->offsets));
    TETLOD_TRY(read_connectivity(v, &own, cells));
    cells->count = part->cells;
    cells->connectivity_count = own.connectivity;
    cells_drop_types(cells);
    return TETLOD_OK;
}

/* ---- values */

struct walk {
    struct vtkhdf *v;
    struct block *block;
    const char *group;
    bool cell;
    uint64_t first, rows, in_step; /* in_step: of the rows, those of the step's parts before */
    enum tetlod_status status;
};

/* Adds a field of these rows of the set. */
static enum tetlod_status take_set(const struct walk *w, const char *name, const struct h5_set *set, uint64_t width,
                                   uint64_t first,
                                   uint64_t rows, struct point_field **out)
{
    struct tetmesh *mesh = &w->block->mesh;
    char unit[2 * UNIT_SIZE];
    TETLOD_TRY(w->cell ? assemble_cell_field(mesh, name, width, set->type, w->rows, w->v->error)
                       : assemble_field(mesh, name, width, set->type, w->v->error));
    *out = w->cell ? &mesh->cell_fields[mesh->cell_field_count - 1] : &mesh->fields[mesh->field_count - 1];
    (*out)->is_integer = set->is_integer;
    h5_read_text(set->id, H5_UNITS, unit, sizeof unit);
    unit_set((*out)->unit, unit, strlen(unit));
    return h5_read_doubles(set, first, rows, (*out)->values, w->v->error);
}

/* The path of a data set, or false: it is left out. */
static bool path_of(const struct walk *w, const char *name, const H5L_info_t *link, char path[static 300])
{
    int length = snprintf(path, 300, "%s/%s", w->group, name);
    if (link->type < H5L_TYPE_EXTERNAL && length >= 0 && length < 300)
        return true;
    io_leave_out(w->v->report, &w->v->report->skipped_arrays, name, strlen(name));
    return false;
}

static enum tetlod_status take_array(const struct walk *w, const char *name, const char *path)
{
    char offsets[300];
    struct h5_set set;
    struct point_field *field;
    uint64_t first = w->first;
    int length = snprintf(offsets, sizeof offsets, "Steps/%sOffsets/%s", w->group, name);
    if (w->v->has_steps && length > 0 && (size_t)length < sizeof offsets && h5_has(w->v->root, offsets)) {
        TETLOD_TRY(step_entry(w->v, offsets + sizeof "Steps/" - 1, &first)); // where the step begins in this array
        first += w->in_step;
    }
    TETLOD_TRY(h5_open_set(w->v->root, path, w->v->size, &set, w->v->error));
    uint64_t width = set.rank == 2 ? set.dims[1] : 1;
    enum tetlod_status status = TETLOD_OK;
    if (set.rank < 1 || set.rank > 2 || set.dims[0] < w->rows)
        status = tetlodi_fail(w->v->error, TETLOD_ERR_MESH, "data set %.80s should have %llu rows", path,
                              (unsigned long long)w->rows);
    if (status == TETLOD_OK)
        status = take_set(w, name, &set, width, first, w->rows, &field);
    if (status == TETLOD_OK && is_ghosts(name, width))
        status = block_take_ghosts(w->block, w->cell, w->v->report, w->v->error);
    H5Dclose(set.id);
    return status;
}

static herr_t on_array(hid_t group, const char *name, const H5L_info_t *link, void *opaque)
{
    struct walk *w = opaque;
    char path[300];
    (void)group;
    if (!path_of(w, name, link, path))
        return 0;
    struct tetlod_error *error = w->v->error, inner = {0};
    w->v->error = &inner;
    struct h5_set set;
    bool numbers = h5_open_set(w->v->root, path, w->v->size, &set, &inner) == TETLOD_OK;
    w->v->error = error;
    if (!numbers) { // strings, say
        io_leave_out(w->v->report, &w->v->report->skipped_arrays, name, strlen(name));
        return 0;
    }
    H5Dclose(set.id);
    w->status = take_array(w, name, path);
    return w->status == TETLOD_OK ? 0 : -1;
}

static enum tetlod_status read_fields(struct vtkhdf *v, struct block *block, bool cell, uint64_t first, uint64_t rows,
                                      uint64_t in_step)
{
    struct walk w = {v, block, cell ? "CellData" : "PointData", cell, first, rows, in_step, TETLOD_OK};
    if (!rows || !h5_has(v->root, w.group))
        return TETLOD_OK;
    herr_t result = H5Literate_by_name(v->root, w.group, H5_INDEX_NAME, H5_ITER_INC, NULL, on_array, &w, H5P_DEFAULT);
    if (w.status == TETLOD_OK && result < 0)
        return tetlodi_fail(v->error, TETLOD_ERR_MESH, "group %s cannot be read; is the file damaged?", w.group);
    return w.status;
}

/* ---- unstructured grids */

/* The range of the only part that is asked for. */
static struct part range_of(const struct vtkhdf *v, const struct part *whole)
{
    struct part part = *whole;
    uint64_t point = range_begin(whole->points, v->part - 1, v->ranges),
             cell = range_begin(whole->cells, v->part - 1, v->ranges);
    part.points = range_begin(whole->points, v->part, v->ranges) - point;
    part.cells = range_begin(whole->cells, v->part, v->ranges) - cell;
    part.first_point += point;
    part.points_before += point;
    part.first_cell += cell;
    part.cells_before += cell;
    part.first_offset += cell;
    return part;
}

static enum tetlod_status read_part(struct vtkhdf *v, const struct part *part)
{
    struct block *block;
    TETLOD_TRY(blocks_add(v->out, &block, v->error));
    block->goes_on = v->ranges > 1 && v->part > 1;
    TETLOD_TRY(read_points(v, part, &block->mesh));
    if (part->cells)
        TETLOD_TRY(read_cells(v, part, &block->cells));
    TETLOD_TRY(read_fields(v, block, false, part->first_point, part->points, part->points_before));
    return read_fields(v, block, true, part->first_cell, part->cells, part->cells_before);
}

/* Numbers of points, cells and corners of all parts of all steps. */
struct counts {
    int64_t *points, *cells, *connectivity; /* owned */
    uint64_t parts;
};

static enum tetlod_status load_counts(struct vtkhdf *v, struct counts *c)
{
    uint64_t cells, connectivity;
    TETLOD_TRY(h5_load_ints(v->root, "NumberOfPoints", v->size, &c->points, &c->parts, v->error));
    TETLOD_TRY(h5_load_ints(v->root, "NumberOfCells", v->size, &c->cells, &cells, v->error));
    TETLOD_TRY(h5_load_ints(v->root, "NumberOfConnectivityIds", v->size, &c->connectivity, &connectivity, v->error));
    bool good = cells == c->parts && connectivity == c->parts;
    for (uint64_t p = 0; good && p < c->parts; p++)
        good = c->points[p] >= 0 && c->cells[p] >= 0 && c->connectivity[p] >= 0;
    return good ? TETLOD_OK : tetlodi_fail(v->error, TETLOD_ERR_MESH,
                                           "the numbers of points, cells and corners do not match");
}

static enum tetlod_status read_parts(struct vtkhdf *v, const struct counts *c)
{
    struct part part = {0};
    uint64_t first = 0, count = c->parts;
    TETLOD_TRY(step_entry(v, "PartOffsets", &first));
    if (v->has_steps && h5_has(v->root, "Steps/NumberOfParts"))
        TETLOD_TRY(step_entry(v, "NumberOfParts", &count));
    TETLOD_TRY(step_entry(v, "PointOffsets", &part.first_point));
    TETLOD_TRY(step_entry(v, "CellOffsets", &part.first_cell));
    TETLOD_TRY(step_entry(v, "ConnectivityIdOffsets", &part.first_connectivity));
    part.first_offset = part.first_cell + (v->has_steps && part.first_cell ? first : 0);
    if (first > c->parts || count > c->parts - first)
        return tetlodi_fail(v->error, TETLOD_ERR_MESH, "the step has parts that are not there");
    if (v->counts)
        v->report->blocks = count == 1 ? pieces_ranges(v->options, (uint64_t)c->cells[first]) : count;
    v->ranges = count == 1 ? v->ranges : 0;
    for (uint64_t p = first; p < first + count && !v->counts; p++) {
        part.points = (uint64_t)c->points[p];
        part.cells = (uint64_t)c->cells[p];
        part.connectivity = (uint64_t)c->connectivity[p];
        const struct part range = v->ranges > 1 ? range_of(v, &part) : part;
        if (!v->part || v->ranges > 1 || v->part == p - first + 1)
            TETLOD_TRY(read_part(v, &range));
        part.first_point += part.points;
        part.points_before += part.points;
        part.first_cell += part.cells;
        part.cells_before += part.cells;
        part.first_offset += part.cells + 1;
        part.first_connectivity += part.connectivity;
    }
    return TETLOD_OK;
}

static enum tetlod_status read_unstructured(struct vtkhdf *v)
{
    struct counts counts = {0};
    enum tetlod_status status = load_counts(v, &counts);
    if (status == TETLOD_OK)
        status = read_parts(v, &counts);
    free(counts.points);
    free(counts.cells);
    free(counts.connectivity);
    return status;
}

/* ---- images */

static bool read_attribute(hid_t where, const char *name, hid_t type, size_t count, void *out)
{
    hid_t attribute = H5Aexists(where, name) > 0 ? H5Aopen(where, name, H5P_DEFAULT) : -1;
    if (attribute < 0)
        return false;
    hid_t space = H5Aget_space(attribute);
    bool good = H5Sget_simple_extent_npoints(space) == (hssize_t)count && H5Aread(attribute, type, out) >= 0;
    H5Sclose(space);
    H5Aclose(attribute);
    return good;
}

/* A data set whose dimensions are those of the points or cells, k first, and perhaps components; with steps, these in
 * front. */
static enum tetlod_status take_image_array(struct walk *w, const char *path, const char *name)
{
    struct h5_set set;
    struct point_field *field;
    uint64_t first;
    TETLOD_TRY(h5_open_set(w->v->root, path, w->v->size, &set, w->v->error));
    first = w->v->has_steps && set.dims[0] ? w->v->step : 0;
    uint64_t rows = w->v->has_steps ? 1 : set.rank ? set.dims[0] : 1, all = set.rank ? rows * h5_row_size(&set) : 1;
    uint64_t width = w->rows ? all / w->rows : 0;
    enum tetlod_status status = TETLOD_OK;
    if (width == 0 || width * w->rows != all)
        status = tetlodi_fail(w->v->error, TETLOD_ERR_MESH, "data set %.80s should have a value for each of %llu", path,
                              (unsigned long long)w->rows);
    if (status == TETLOD_OK)
        status = take_set(w, name, &set, width, first, rows, &field);
    if (status == TETLOD_OK && is_ghosts(name, width))
        status = block_take_ghosts(w->block, w->cell, w->v->report, w->v->error);
    H5Dclose(set.id);
    return status;
}

static herr_t on_image_array(hid_t group, const char *name, const H5L_info_t *link, void *opaque)
{
    struct walk *w = opaque;
    char path[300];
    (void)group;
    if (path_of(w, name, link, path))
        w->status = take_image_array(w, path, name);
    return w->status == TETLOD_OK ? 0 : -1;
}

static enum tetlod_status make_points(struct vtkhdf *v, struct block *block, const int64_t extent[6])
{
    double origin[3] = {0, 0, 0}, spacing[3] = {1, 1, 1}, direction[9] = {1, 0, 0, 0, 1, 0, 0, 0, 1};
    read_attribute(v->root, "Origin", H5T_NATIVE_DOUBLE, 3, origin);
    read_attribute(v->root, "Spacing", H5T_NATIVE_DOUBLE, 3, spacing);
    read_attribute(v->root, "Direction", H5T_NATIVE_DOUBLE, 9, direction);
    uint64_t points = 1;
    for (int d = 0; d < 3; d++)
        points *= block->dims[d];
    TETLOD_TRY(assemble_points(&block->mesh, points, TETLOD_FLOAT64, v->error));
    for (uint64_t p = 0; p < points; p++) {
        const uint64_t at[3] = {p % block->dims[0], p / block->dims[0] % block->dims[1],
                                p / block->dims[0] / block->dims[1]};
        for (int row = 0; row < 3; row++) {
            double sum = origin[row];
            for (int d = 0; d < 3; d++)
                sum += direction[3 * row + d] * (double)(extent[2 * d] + (int64_t)at[d]) * spacing[d];
            block->mesh.positions[3 * p + (uint64_t)row] = sum;
        }
    }
    return TETLOD_OK;
}

static enum tetlod_status read_image(struct vtkhdf *v)
{
    struct block *block;
    int64_t extent[6];
    uint64_t points = 1;
    TETLOD_TRY(blocks_add(v->out, &block, v->error));
    bool good = read_attribute(v->root, "WholeExtent", H5T_NATIVE_INT64, 6, extent);
    for (int d = 0; d < 3 && good; d++) {
        good = extent[2 * d] >= INT32_MIN && extent[2 * d + 1] <= INT32_MAX && extent[2 * d + 1] >= extent[2 * d];
        uint64_t n = good ? (uint64_t)(extent[2 * d + 1] - extent[2 * d] + 1) : 0;
        good = good && n <= v->size * 1100 / points; // there are values for them
        block->dims[d] = (uint32_t)n;
        points *= n;
    }
    if (!good)
        return tetlodi_fail(v->error, TETLOD_ERR_MESH,
                            "its WholeExtent is missing, or has more points than the file has values");
    TETLOD_TRY(make_points(v, block, extent));
    for (int cell = 0; cell < 2; cell++) {
        struct walk w = {v, block, cell ? "CellData" : "PointData", cell, 0, cell ? block_cell_count(block) : points, 0,
                         TETLOD_OK};
        if (w.rows && h5_has(v->root, w.group))
            H5Literate_by_name(v->root, w.group, H5_INDEX_NAME, H5_ITER_INC, NULL, on_image_array, &w, H5P_DEFAULT);
        TETLOD_TRY(w.status);
    }
    return TETLOD_OK;
}

/* ---- the whole */

static enum tetlod_status choose_step(struct vtkhdf *v)
{
    struct h5_set set;
    v->has_steps = h5_has(v->root, "Steps") && h5_has(v->root, "Steps/Values");
    if (!v->has_steps)
        return TETLOD_OK;
    TETLOD_TRY(h5_open_set(v->root, "Steps/Values", v->size, &set, v->error));
    double *times = array_new((size_t)set.count, sizeof *times);
    enum tetlod_status status = times ? h5_read_doubles(&set, 0, set.rank ? set.dims[0] : 1, times, v->error)
                                      : tetlodi_fail_nomem(v->error, "the steps", set.count * 8);
    if (status == TETLOD_OK && set.count)
        status = time_steps_pick(set.count, times, v->options, v->report, v->error);
    v->has_steps = set.count > 0;
    v->step = v->report->step;
    free(times);
    H5Dclose(set.id);
    return status;
}

static enum tetlod_status read_some(struct blocks *out, const struct io_input *input, bool counts,
                                    struct io_report *report, struct tetlod_error *error)
{
    hid_t file;
    char type[64];
    TETLOD_TRY(h5_open_file(input->path, &file, error));
    struct vtkhdf v = {.size = input->size, .out = out, .options = input->options, .report = report, .error = error,
                       .part = input->part, .ranges = input->ranges, .counts = counts};
    v.root = h5_has(file, "VTKHDF") ? H5Gopen2(file, "VTKHDF", H5P_DEFAULT) : -1;
    if (v.root < 0)
        return tetlodi_fail(error, TETLOD_ERR_MESH,
                            "is an HDF5 file without a group VTKHDF; if it belongs to an XDMF file, name that");
    h5_read_text(v.root, "Type", type, sizeof type);
    bool is_untyped = !type[0] && h5_has(v.root,
                                         "Connectivity"); // older files, which VTK's reader takes for grids, too
    enum tetlod_status status = choose_step(&v);
    if (status == TETLOD_OK && (is_untyped || strcmp(type, "UnstructuredGrid") == 0))
        status = read_unstructured(&v);
    else if (status == TETLOD_OK && strcmp(type, "ImageData") == 0)
        status = read_image(&v);
    else if (status == TETLOD_OK)
        status = tetlodi_fail(error, TETLOD_ERR_MESH,
                              "is VTKHDF of type '%.40s'; UnstructuredGrid and ImageData can be read", type);
    H5Gclose(v.root);
    H5Fclose(file);
    return status;
}

static enum tetlod_status read_file(struct blocks *out, const struct io_input *input, struct io_report *report,
                                    struct tetlod_error *error)
{
    return read_some(out, input, false, report, error);
}

static enum tetlod_status count_parts(struct blocks *out, const struct io_input *input, struct io_report *report,
                                      struct tetlod_error *error)
{
    return read_some(out, input, true, report, error);
}

static enum tetlod_status read_numbered(void *opaque, uint32_t number, struct blocks *out,
                                        const struct io_input *input, struct io_report *report,
                                        struct tetlod_error *error)
{
    struct io_input part = *input;
    part.part = number + 1;
    part.ranges = *(const uint32_t *)opaque;
    return contain_read(read_file, out, &part, report, error);
}

bool vtkhdf_sniff(const unsigned char *bytes, size_t size)
{
    static const char magic[] = "\x89HDF\r\n\x1a\n", group[] = "VTKHDF";
    if (size < 8 || memcmp(bytes, magic, 8) != 0)
        return false;
    size_t head = size < 65536 ? size : 65536;
    for (const unsigned char *at = bytes; (at = memchr(at, 'V', (size_t)(bytes + head - at))) != NULL; at++)
        if ((size_t)(bytes + head - at) >= 6 && memcmp(at, group, 6) == 0)
            return true;
    return false;
}

enum tetlod_status vtkhdf_read(struct blocks *out, const struct io_input *input, struct io_report *report,
                               struct tetlod_error *error)
{
    if (!input->path)
        return tetlodi_fail(error, TETLOD_ERR_MESH, "is an HDF5 file, which cannot be read from memory");
    struct io_report counted = {0};
    struct blocks none = {0};
    if (input->options && input->options->sharing)
        TETLOD_TRY(contain_read(count_parts, &none, input, &counted, error));
    uint32_t ranges = (uint32_t)counted.blocks; // where there is one part
    const struct piece_list list = {ranges, read_numbered, &ranges};
    return counted.blocks > 1 && counted.blocks < UINT32_MAX ? pieces_read(&list, out, input, report, error)
                                                              : contain_read(read_file, out, input, report, error);
}
