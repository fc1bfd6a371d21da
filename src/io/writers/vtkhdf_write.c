/* SPDX-License-Identifier: BSD-3-Clause */
/* Writing VTKHDF 1.0: one part, chunks of deflate. The file is made in memory, as HDF5 wants to go back and forth in
 * it. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "format/fail.h"
#include "src/io/writers/facts.h"
#include "src/io/writers/writers.h"
#include "src/io/services/h5.h"
#include "src/io/writers/cell_lists.h"
#include "src/mesh/mixed_cells.h"
#include "src/util/array.h"

struct writer {
    hid_t file, root;
    bool good;
};

/* Row by row chunks, compressed; data of `memory` type as `stored` type. */
static void put_set(struct writer *w, const char *name, int rank, const hsize_t *dims, hid_t memory, hid_t stored,
                    const void *data)
{
    enum { CHUNK_ROWS = 1 << 15 };
    hsize_t chunk[2] = {dims[0] < CHUNK_ROWS ? dims[0] : CHUNK_ROWS, rank > 1 ? dims[1] : 1};
    hid_t space = H5Screate_simple(rank, dims,
                                   NULL), list = H5Pcreate(H5P_DATASET_CREATE), links = H5Pcreate(H5P_LINK_CREATE);
    w->good =
        w->good && H5Pset_create_intermediate_group(links, 1) >= 0 && H5Pset_char_encoding(links, H5T_CSET_UTF8) >= 0;
    w->good = w->good && H5Pset_obj_track_times(list, false) >= 0; // the same mesh, the same bytes
    if (dims[0] > 1)
        w->good = w->good && H5Pset_chunk(list, rank, chunk) >= 0 && H5Pset_deflate(list, 4) >= 0;
    hid_t set = w->good ? H5Dcreate2(w->root, name, stored, space, links, list, H5P_DEFAULT) : -1;
    w->good = set >= 0 && H5Dwrite(set, memory, H5S_ALL, H5S_ALL, H5P_DEFAULT, data) >= 0;
    H5Dclose(set);
    H5Pclose(list);
    H5Pclose(links);
    H5Sclose(space);
}

static void put_text_attribute(struct writer *w, hid_t where, const char *name, const char *value)
{
    hid_t scalar = H5Screate(H5S_SCALAR), text = H5Tcopy(H5T_C_S1);
    H5Tset_size(text, strlen(value));
    H5Tset_strpad(text, H5T_STR_NULLPAD);
    H5Tset_cset(text, H5T_CSET_UTF8);
    hid_t attribute = H5Acreate2(where, name, text, scalar, H5P_DEFAULT, H5P_DEFAULT);
    w->good = w->good && attribute >= 0 && H5Awrite(attribute, text, value) >= 0;
    H5Aclose(attribute);
    H5Tclose(text);
    H5Sclose(scalar);
}

static void put_attributes(struct writer *w)
{
    const int64_t version[2] = {1, 0};
    hsize_t two = 2;
    hid_t space = H5Screate_simple(1, &two, NULL);
    hid_t attribute = H5Acreate2(w->root, "Version", H5T_STD_I64LE, space, H5P_DEFAULT, H5P_DEFAULT);
    w->good = w->good && attribute >= 0 && H5Awrite(attribute, H5T_NATIVE_INT64, version) >= 0;
    H5Aclose(attribute);
    H5Sclose(space);
    put_text_attribute(w, w->root, "Type", "UnstructuredGrid");
}

static hid_t float_type(enum tetlod_type type)
{
    return type == TETLOD_FLOAT32 ? H5T_IEEE_F32LE : H5T_IEEE_F64LE;
}

/* A unit as the attribute of a data set that netCDF, too, keeps it in. */
static void put_unit(struct writer *w, const char *path, const char *unit)
{
    hid_t set = w->good ? H5Dopen2(w->root, path, H5P_DEFAULT) : -1;
    w->good = set >= 0;
    put_text_attribute(w, set, H5_UNITS, unit);
    H5Dclose(set);
}

/* The path of a data set in a group, to be freed; NULL: no memory. A '/' in a field's name would be a group. */
static char *path_of(const char *group, const char *name)
{
    size_t before = strlen(group), length = strlen(name);
    char *path = array_new(before + length + 1, 1);
    if (!path)
        return NULL;
    memcpy(path, group, before);
    memcpy(path + before, name, length + 1);
    for (char *c = path + before; *c; c++)
        *c = *c == '/' ? '_' : *c;
    return path;
}

static enum tetlod_status put_field(struct writer *w, const char *group, const struct point_field *field, uint64_t rows,
                                    struct tetlod_error *error)
{
    const hsize_t dims[2] = {rows, field->components};
    char *path = path_of(group, field->name);
    if (!path)
        return tetlodi_fail_nomem(error, "a field's name", strlen(field->name));
    put_set(w, path, field->components > 1 ? 2 : 1, dims, H5T_NATIVE_DOUBLE,
            field->is_integer ? H5T_STD_I64LE : float_type(field->type), field->values);
    if (field->unit[0])
        put_unit(w, path, field->unit);
    free(path);
    return TETLOD_OK;
}

static enum tetlod_status put_cells(struct writer *w, const struct tetmesh *mesh, struct tetlod_error *error)
{
    const hsize_t tets = mesh->tet_count, ends = tets + 1, corners = 4 * tets;
    int64_t *offsets = array_new((size_t)ends, sizeof *offsets);
    unsigned char *types = array_new((size_t)tets, 1);
    if (offsets && types) {
        memset(types, VTK_TYPE_TET, (size_t)tets);
        for (size_t i = 0; i < ends; i++)
            offsets[i] = 4 * (int64_t)i;
        put_set(w, "Connectivity", 1, &corners, H5T_NATIVE_UINT32, H5T_STD_I64LE, mesh->corners);
        put_set(w, "Offsets", 1, &ends, H5T_NATIVE_INT64, H5T_STD_I64LE, offsets);
        put_set(w, "Types", 1, &tets, H5T_NATIVE_UINT8, H5T_STD_U8LE, types);
    }
    bool nomem = !offsets || !types;
    free(offsets);
    free(types);
    return nomem ? tetlodi_fail_nomem(error, "the cells", tets * 9) : TETLOD_OK;
}

/* Cells of any kind but polyhedra, which the format has from a later version on. */
static enum tetlod_status put_lists(struct writer *w, const struct cell_lists *lists, struct tetlod_error *error)
{
    const hsize_t cells = lists->cell_count, ends = cells + 1, corners = lists->connectivity_count;
    if (lists->face_count)
        return tetlodi_fail(error, TETLOD_ERR_ARGUMENT,
                            "polyhedra cannot be written as VTKHDF of version 1; write .vtu or .vtk");
    uint32_t *offsets = array_zero((size_t)ends, sizeof *offsets);
    if (!offsets)
        return tetlodi_fail_nomem(error, "the cells", ends * sizeof *offsets);
    memcpy(offsets + 1, lists->ends, lists->cell_count * sizeof *offsets);
    put_set(w, "Connectivity", 1, &corners, H5T_NATIVE_UINT32, H5T_STD_I64LE, lists->connectivity);
    put_set(w, "Offsets", 1, &ends, H5T_NATIVE_UINT32, H5T_STD_I64LE, offsets);
    put_set(w, "Types", 1, &cells, H5T_NATIVE_UINT32, H5T_STD_U8LE, lists->types);
    free(offsets);
    return TETLOD_OK;
}

static enum tetlod_status put_fact(struct writer *w, const struct fact *fact, struct tetlod_error *error)
{
    char group[64];
    snprintf(group, sizeof group, "FieldData/%s%s", fact->name, fact->field ? " " : "");
    const hsize_t rows = fact->codes ? strlen(fact->codes) : 1;
    char *path = path_of(group, fact->field ? fact->field : "");
    if (!path)
        return tetlodi_fail_nomem(error, "a field's name", strlen(group));
    put_set(w, path, 1, &rows, fact->codes ? H5T_NATIVE_UINT8 : H5T_NATIVE_DOUBLE,
            fact->codes ? H5T_STD_U8LE : H5T_IEEE_F64LE, fact->codes ? (const void *)fact->codes : &fact->value);
    free(path);
    return TETLOD_OK;
}

static enum tetlod_status put_mesh(struct writer *w, const struct tetmesh *mesh, struct tetlod_error *error)
{
    const hsize_t one = 1, points[2] = {mesh->vertex_count, 3};
    int64_t counts[3] = {mesh->vertex_count, mesh->tet_count, 4 * (int64_t)mesh->tet_count};
    struct cell_lists lists = {0};
    enum tetlod_status status = mesh->cells ? cell_lists_make(&lists, mesh->cells, error) : TETLOD_OK;
    counts[2] = mesh->cells ? (int64_t)lists.connectivity_count : counts[2];
    put_attributes(w);
    put_set(w, "NumberOfPoints", 1, &one, H5T_NATIVE_INT64, H5T_STD_I64LE, &counts[0]);
    put_set(w, "NumberOfCells", 1, &one, H5T_NATIVE_INT64, H5T_STD_I64LE, &counts[1]);
    put_set(w, "NumberOfConnectivityIds", 1, &one, H5T_NATIVE_INT64, H5T_STD_I64LE, &counts[2]);
    put_set(w, "Points", 2, points, H5T_NATIVE_DOUBLE, float_type(mesh->position_type), mesh->positions);
    if (status == TETLOD_OK)
        status = mesh->cells ? put_lists(w, &lists, error) : put_cells(w, mesh, error);
    cell_lists_fini(&lists);
    if (status != TETLOD_OK)
        return status;
    for (uint32_t f = 0; f < mesh->field_count; f++)
        TETLOD_TRY(put_field(w, "PointData/", &mesh->fields[f], mesh->vertex_count, error));
    for (uint32_t f = 0; f < mesh->cell_field_count; f++)
        TETLOD_TRY(put_field(w, "CellData/", &mesh->cell_fields[f], mesh->tet_count, error));
    struct fact fact;
    for (uint32_t i = 0; fact_of(mesh, i, &fact); i++)
        TETLOD_TRY(put_fact(w, &fact, error));
    return TETLOD_OK;
}

static enum tetlod_status send_image(hid_t file, const struct tetlodi_sink *sink, struct tetlod_error *error)
{
    ssize_t size = H5Fget_file_image(file, NULL, 0);
    unsigned char *image = size > 0 ? array_new((size_t)size, 1) : NULL;
    enum tetlod_status status = TETLOD_OK;
    if (!image || H5Fget_file_image(file, image, (size_t)size) < 0)
        status = tetlodi_fail_nomem(error, "the HDF5 file", size > 0 ? (uint64_t)size : 0);
    else
        status = sink->write(sink->opaque, image, (size_t)size);
    free(image);
    return status;
}

enum tetlod_status vtkhdf_write(const struct tetmesh *mesh, const struct tetlodi_sink *sink, struct tetlod_error *error)
{
    enum { GROWTH = 1 << 22 };
    H5Eset_auto2(H5E_DEFAULT, NULL, NULL); // it would print
    hid_t access = H5Pcreate(H5P_FILE_ACCESS);
    struct writer w = {-1, -1, H5Pset_fapl_core(access, GROWTH, 0) >= 0};
    w.file = w.good ? H5Fcreate("vtkhdf", H5F_ACC_TRUNC, H5P_DEFAULT, access) : -1;
    w.root = w.file >= 0 ? H5Gcreate2(w.file, "VTKHDF", H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT) : -1;
    w.good = w.root >= 0;
    enum tetlod_status status = w.good ? put_mesh(&w, mesh, error) : TETLOD_OK;
    w.good = w.good && H5Fflush(w.file, H5F_SCOPE_LOCAL) >= 0;
    if (status == TETLOD_OK)
        status = w.good ? send_image(w.file, sink, error) : tetlodi_fail_nomem(error, "the HDF5 file", 0);
    H5Gclose(w.root);
    H5Fclose(w.file);
    H5Pclose(access);
    return status;
}
