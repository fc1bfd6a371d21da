/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * The file: a user block with the pointer, the HDF5 file's first objects, the stream, then the meshes. So the stream
 * begins within the first 4 KiB, and a client's first request has its index.
 *
 * Steps are written as VTKHDF 2.0 has them: data sets grow, and the group Steps says where each step begins. A step
 * that has the tetrahedra, or the points, of the step before has its rows, too.
 */
#include "src/io/writers/vtkhdf_stream.h"

#include <stdlib.h>
#include <string.h>

#include "format/coding/pointer.h"
#include "format/fail.h"
#include "src/io/writers/vtkhdf_file.h"
#include "src/mesh/mixed_cells.h"
#include "src/util/array.h"

enum { USER_BLOCK = 512 };

/* ---- the stream */

/* An uncompressed, contiguous data set. Returns where it is in the file; 0: it failed. */
static uint64_t make_room(struct vtkhdf_file *w, hsize_t size)
{
    hid_t space = H5Screate_simple(1, &size, NULL), list = H5Pcreate(H5P_DATASET_CREATE);
    hid_t links = H5Pcreate(H5P_LINK_CREATE);
    w->good = w->good && H5Pset_create_intermediate_group(links, 1) >= 0 && H5Pset_layout(list, H5D_CONTIGUOUS) >= 0;
    w->good = w->good && H5Pset_alloc_time(list, H5D_ALLOC_TIME_EARLY) >= 0 && H5Pset_obj_track_times(list, false) >= 0;
    hid_t set = w->good ? H5Dcreate2(w->file, "tetlod/stream", H5T_STD_U8LE, space, links, list, H5P_DEFAULT) : -1;
    haddr_t at = set >= 0 ? H5Dget_offset(set) : HADDR_UNDEF;
    w->good = at != HADDR_UNDEF;
    H5Dclose(set);
    H5Pclose(links);
    H5Pclose(list);
    H5Sclose(space);
    return w->good ? (uint64_t)at : 0;
}

/* Where the stream's bytes go. */
struct place {
    unsigned char *at;
    size_t left;
};

static enum tetlod_status put_bytes(void *opaque, const void *bytes, size_t size)
{
    struct place *place = opaque;
    if (size > place->left)
        return TETLOD_ERR_STREAM;
    memcpy(place->at, bytes, size);
    place->at += size;
    place->left -= size;
    return TETLOD_OK;
}

/* The whole file's bytes: pointer and stream are put where they belong, the rest is HDF5's. */
static enum tetlod_status finish(struct vtkhdf_file *w, const struct shown_stream *stream, uint64_t offset,
                                 const struct tetlodi_sink *sink, struct tetlod_error *error)
{
    size_t size;
    unsigned char *image = vtkhdf_image(w, &size);
    if (!image || offset < USER_BLOCK || size < offset || size - offset < stream->size)
        return tetlodi_fail_nomem(error, "the HDF5 file", stream->size);
    struct place place = {image + offset, (size_t)stream->size};
    tetlodi_pointer_encode(&(struct tetlodi_pointer){offset, stream->size}, image);
    enum tetlod_status status = stream->write(stream->opaque, &(struct tetlodi_sink){put_bytes, &place}, error);
    if (status == TETLOD_OK && place.left)
        status = tetlodi_fail(error, TETLOD_ERR_TRUNCATED, "the stream ends too early");
    return status == TETLOD_OK ? sink->write(sink->opaque, image, size) : status;
}

/* ---- steps */

enum column { PART, POINT, CELL, CORNER, POINT_VALUE, CELL_VALUE, COLUMNS };

struct steps {
    struct vtkhdf_file *w;
    uint32_t count, step;
    struct tetmesh last; /* the last step's: arrays that it has not are left out */
    struct tetmesh before;
    double *times;                /* [count] */
    int64_t *firsts;              /* [COLUMNS][count]: where a step's rows begin */
    int64_t now[COLUMNS], end[COLUMNS]; /* of this step, and of what has been written */
};

/* Rows behind those that the set has; a new one where there is none. */
static void append(struct vtkhdf_file *w, const char *name, hsize_t rows, hsize_t width, hid_t memory, hid_t stored,
                   const void *data)
{
    const hsize_t dims[2] = {rows, width};
    hsize_t before[2] = {0, 0};
    const int rank = width > 1 ? 2 : 1;
    if (w->good && !h5_has(w->root, name)) {
        vtkhdf_put_growing(w, name, rank, dims, memory, stored, data);
        return;
    }
    hid_t set = w->good ? H5Dopen2(w->root, name, H5P_DEFAULT) : -1, file = set >= 0 ? H5Dget_space(set) : -1;
    w->good = file >= 0 && H5Sget_simple_extent_dims(file, before, NULL) == rank;
    H5Sclose(file);
    const hsize_t all[2] = {before[0] + rows, width}, start[2] = {before[0], 0};
    w->good = w->good && H5Dset_extent(set, all) >= 0;
    file = w->good ? H5Dget_space(set) : -1;
    hid_t space = H5Screate_simple(rank, dims, NULL);
    w->good = file >= 0 && H5Sselect_hyperslab(file, H5S_SELECT_SET, start, NULL, dims, NULL) >= 0 &&
              H5Dwrite(set, memory, space, file, H5P_DEFAULT, data) >= 0;
    H5Sclose(space);
    H5Sclose(file);
    H5Dclose(set);
}

static enum tetlod_status append_field(struct vtkhdf_file *w, const char *group, const struct point_field *field,
                                       uint64_t rows, struct tetlod_error *error)
{
    char *path = vtkhdf_path(group, field->name);
    if (!path)
        return tetlodi_fail_nomem(error, "a field's name", strlen(field->name));
    bool is_new = w->good && !h5_has(w->root, path);
    append(w, path, rows, field->components, H5T_NATIVE_DOUBLE,
           field->is_integer ? H5T_STD_I64LE : vtkhdf_float_type(field->type), field->values);
    if (is_new && field->unit[0])
        vtkhdf_put_unit(w, path, field->unit);
    free(path);
    return TETLOD_OK;
}

static enum tetlod_status append_cells(struct steps *s, const struct tetmesh *mesh, struct tetlod_error *error)
{
    const uint64_t tets = mesh->tet_count;
    const int64_t counts[3] = {mesh->vertex_count, (int64_t)tets, 4 * (int64_t)tets};
    int64_t *offsets = array_new(tets + 1, sizeof *offsets);
    unsigned char *types = array_new(tets, 1);
    if (offsets && types) {
        for (uint64_t i = 0; i <= tets; i++)
            offsets[i] = 4 * (int64_t)i;
        memset(types, VTK_TYPE_TET, tets);
        append(s->w, "NumberOfPoints", 1, 1, H5T_NATIVE_INT64, H5T_STD_I64LE, &counts[0]);
        append(s->w, "NumberOfCells", 1, 1, H5T_NATIVE_INT64, H5T_STD_I64LE, &counts[1]);
        append(s->w, "NumberOfConnectivityIds", 1, 1, H5T_NATIVE_INT64, H5T_STD_I64LE, &counts[2]);
        append(s->w, "Connectivity", 4 * tets, 1, H5T_NATIVE_UINT32, H5T_STD_I64LE, mesh->corners);
        append(s->w, "Offsets", tets + 1, 1, H5T_NATIVE_INT64, H5T_STD_I64LE, offsets);
        append(s->w, "Types", tets, 1, H5T_NATIVE_UINT8, H5T_STD_U8LE, types);
    }
    bool nomem = !offsets || !types;
    free(offsets);
    free(types);
    s->end[PART]++;
    s->end[CELL] += (int64_t)tets;
    s->end[CORNER] += 4 * (int64_t)tets;
    return nomem ? tetlodi_fail_nomem(error, "the cells", tets * 9) : TETLOD_OK;
}

static bool same_cells(const struct tetmesh *a, const struct tetmesh *b)
{
    return a->vertex_count == b->vertex_count && a->tet_count == b->tet_count &&
           memcmp(a->corners, b->corners, (size_t)a->tet_count * 4 * sizeof *a->corners) == 0;
}

static bool same_points(const struct tetmesh *a, const struct tetmesh *b)
{
    return a->vertex_count == b->vertex_count &&
           memcmp(a->positions, b->positions, (size_t)a->vertex_count * 3 * sizeof *a->positions) == 0;
}

static enum tetlod_status append_values(struct steps *s, const struct tetmesh *mesh, struct tetlod_error *error)
{
    for (uint32_t f = 0; f < mesh->field_count; f++)
        if (tetmesh_find_field(&s->last, mesh->fields[f].name) != TETLOD_NONE)
            TETLOD_TRY(append_field(s->w, "PointData/", &mesh->fields[f], mesh->vertex_count, error));
    for (uint32_t f = 0; f < mesh->cell_field_count; f++)
        if (tetmesh_find_cell_field(&s->last, mesh->cell_fields[f].name) != TETLOD_NONE)
            TETLOD_TRY(append_field(s->w, "CellData/", &mesh->cell_fields[f], mesh->tet_count, error));
    s->now[POINT_VALUE] = s->end[POINT_VALUE];
    s->end[POINT_VALUE] += mesh->vertex_count;
    s->now[CELL_VALUE] = s->end[CELL_VALUE];
    s->end[CELL_VALUE] += mesh->tet_count;
    return TETLOD_OK;
}

/* What the step has otherwise than the one before. */
static enum tetlod_status append_step(struct steps *s, const struct tetmesh *mesh, struct tetlod_error *error)
{
    const bool first = s->step == 0, cells = first || !same_cells(mesh, &s->before);
    const bool points = cells || !same_points(mesh, &s->before);
    for (enum column c = PART; c <= CORNER; c++)
        if (c == POINT ? points : cells)
            s->now[c] = s->end[c];
    if (cells)
        TETLOD_TRY(append_cells(s, mesh, error));
    if (points) {
        append(s->w, "Points", mesh->vertex_count, 3, H5T_NATIVE_DOUBLE, vtkhdf_float_type(mesh->position_type),
               mesh->positions);
        s->end[POINT] += mesh->vertex_count;
    }
    TETLOD_TRY(append_values(s, mesh, error));
    s->times[s->step] = mesh->origin.time;
    for (enum column c = 0; c < COLUMNS; c++)
        s->firsts[c * s->count + s->step] = s->now[c];
    return TETLOD_OK;
}

static void put_column(struct steps *s, const char *name, int rank, enum column column)
{
    const hsize_t dims[2] = {s->count, 1};
    vtkhdf_put_set(s->w, name, rank, dims, H5T_NATIVE_INT64, H5T_STD_I64LE, s->firsts + column * s->count);
}

static enum tetlod_status put_value_columns(struct steps *s, bool cell, struct tetlod_error *error)
{
    const struct point_field *fields = cell ? s->last.cell_fields : s->last.fields;
    for (uint32_t f = 0; f < (cell ? s->last.cell_field_count : s->last.field_count); f++) {
        char *path = vtkhdf_path(cell ? "Steps/CellDataOffsets/" : "Steps/PointDataOffsets/", fields[f].name);
        if (!path)
            return tetlodi_fail_nomem(error, "a field's name", strlen(fields[f].name));
        put_column(s, path, 1, cell ? CELL_VALUE : POINT_VALUE);
        free(path);
    }
    return TETLOD_OK;
}

/* The group Steps. */
static enum tetlod_status put_steps(struct steps *s, struct tetlod_error *error)
{
    const hsize_t count = s->count;
    hid_t group = s->w->good ? H5Gcreate2(s->w->root, "Steps", H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT) : -1;
    hid_t scalar = H5Screate(H5S_SCALAR);
    hid_t number = group >= 0 ? H5Acreate2(group, "NSteps", H5T_STD_I64LE, scalar, H5P_DEFAULT, H5P_DEFAULT) : -1;
    const int64_t steps = s->count;
    s->w->good = number >= 0 && H5Awrite(number, H5T_NATIVE_INT64, &steps) >= 0;
    H5Aclose(number);
    H5Sclose(scalar);
    H5Gclose(group);
    vtkhdf_put_set(s->w, "Steps/Values", 1, &count, H5T_NATIVE_DOUBLE, H5T_IEEE_F64LE, s->times);
    put_column(s, "Steps/PartOffsets", 1, PART);
    put_column(s, "Steps/PointOffsets", 1, POINT);
    put_column(s, "Steps/CellOffsets", 2, CELL);
    put_column(s, "Steps/ConnectivityIdOffsets", 2, CORNER);
    TETLOD_TRY(put_value_columns(s, false, error));
    TETLOD_TRY(put_value_columns(s, true, error));
    for (uint32_t i = 0; i < s->count; i++)
        s->firsts[i] = 1; // each step is one part
    put_column(s, "Steps/NumberOfParts", 1, PART);
    return TETLOD_OK;
}

static enum tetlod_status put_series(struct vtkhdf_file *w, const struct shown_meshes *meshes,
                                     struct tetlod_error *error)
{
    struct steps s = {.w = w, .count = meshes->steps};
    s.times = array_new(s.count, sizeof *s.times);
    s.firsts = array_new((size_t)s.count * COLUMNS, sizeof *s.firsts);
    enum tetlod_status status = s.times && s.firsts ? meshes->mesh(meshes->opaque, s.count - 1, &s.last, error)
                                                    : tetlodi_fail_nomem(error, "the steps", s.count * 56);
    vtkhdf_put_attributes(w, 2);
    for (; status == TETLOD_OK && s.step < s.count; s.step++) {
        struct tetmesh mesh = {0};
        status = meshes->mesh(meshes->opaque, s.step, &mesh, error);
        if (status == TETLOD_OK)
            status = append_step(&s, &mesh, error);
        tetmesh_fini(&s.before);
        s.before = mesh;
    }
    if (status == TETLOD_OK)
        status = put_steps(&s, error);
    tetmesh_fini(&s.before);
    tetmesh_fini(&s.last);
    free(s.times);
    free(s.firsts);
    return status;
}

/* ---- the whole */

static enum tetlod_status put_one(struct vtkhdf_file *w, const struct shown_meshes *meshes, struct tetlod_error *error)
{
    struct tetmesh mesh = {0};
    enum tetlod_status status = meshes->mesh(meshes->opaque, 0, &mesh, error);
    if (status == TETLOD_OK)
        status = vtkhdf_put_mesh(w, &mesh, error);
    tetmesh_fini(&mesh);
    return status;
}

enum tetlod_status vtkhdf_write_stream(const struct shown_stream *stream, const struct shown_meshes *meshes,
                                       const struct tetlodi_sink *sink, struct tetlod_error *error)
{
    struct vtkhdf_file w;
    vtkhdf_create(&w, USER_BLOCK);
    const uint64_t offset = make_room(&w, stream->size);
    vtkhdf_begin(&w);
    enum tetlod_status status = meshes->steps ? put_series(&w, meshes, error) : put_one(&w, meshes, error);
    if (status == TETLOD_OK)
        status = finish(&w, stream, offset, sink, error);
    vtkhdf_close(&w);
    return status;
}
