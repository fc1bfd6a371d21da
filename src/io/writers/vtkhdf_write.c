/* SPDX-License-Identifier: BSD-3-Clause */
/* Writing VTKHDF 1.0: one part, chunks of deflate. The file is made in memory, as HDF5 wants to go back and forth in
 * it. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "format/fail.h"
#include "src/io/writers/facts.h"
#include "src/io/writers/vtkhdf_file.h"
#include "src/io/writers/writers.h"
#include "src/io/writers/cell_lists.h"
#include "src/mesh/mixed_cells.h"
#include "src/util/array.h"

/* Row by row chunks, compressed; data of `memory` type as `stored` type. */
static void put_set(struct vtkhdf_file *w, const char *name, int rank, const hsize_t *dims, bool grows, hid_t memory,
                    hid_t stored, const void *data)
{
    enum { CHUNK_ROWS = 1 << 15, GROWING_ROWS = 1 << 10 };
    const hsize_t width = rank > 1 ? dims[1] : 1, rows = grows && dims[0] < GROWING_ROWS ? GROWING_ROWS : dims[0];
    const hsize_t chunk[2] = {rows < CHUNK_ROWS ? rows : CHUNK_ROWS, width}, ends[2] = {H5S_UNLIMITED, width};
    hid_t space = H5Screate_simple(rank, dims, grows ? ends : NULL);
    hid_t list = H5Pcreate(H5P_DATASET_CREATE), links = H5Pcreate(H5P_LINK_CREATE);
    w->good =
        w->good && H5Pset_create_intermediate_group(links, 1) >= 0 && H5Pset_char_encoding(links, H5T_CSET_UTF8) >= 0;
    w->good = w->good && H5Pset_obj_track_times(list, false) >= 0; // the same mesh, the same bytes
    if (rows > 1)
        w->good = w->good && H5Pset_chunk(list, rank, chunk) >= 0 && H5Pset_deflate(list, 4) >= 0;
    hid_t set = w->good ? H5Dcreate2(w->root, name, stored, space, links, list, H5P_DEFAULT) : -1;
    w->good = set >= 0 && H5Dwrite(set, memory, H5S_ALL, H5S_ALL, H5P_DEFAULT, data) >= 0;
    H5Dclose(set);
    H5Pclose(list);
    H5Pclose(links);
    H5Sclose(space);
}

void vtkhdf_put_set(struct vtkhdf_file *w, const char *name, int rank, const hsize_t *dims, hid_t memory, hid_t stored,
                    const void *data)
{
    put_set(w, name, rank, dims, false, memory, stored, data);
}

void vtkhdf_put_growing(struct vtkhdf_file *w, const char *name, int rank, const hsize_t *dims, hid_t memory,
                        hid_t stored, const void *data)
{
    put_set(w, name, rank, dims, true, memory, stored, data);
}

/* What VTKHDF itself reads is ASCII: ParaView 5.11 refuses a file whose Type is marked as UTF-8. */
static void put_text_attribute(struct vtkhdf_file *w, hid_t where, const char *name, H5T_cset_t letters,
                               const char *value)
{
    hid_t scalar = H5Screate(H5S_SCALAR), text = H5Tcopy(H5T_C_S1);
    H5Tset_size(text, strlen(value));
    H5Tset_strpad(text, H5T_STR_NULLPAD);
    H5Tset_cset(text, letters);
    hid_t attribute = H5Acreate2(where, name, text, scalar, H5P_DEFAULT, H5P_DEFAULT);
    w->good = w->good && attribute >= 0 && H5Awrite(attribute, text, value) >= 0;
    H5Aclose(attribute);
    H5Tclose(text);
    H5Sclose(scalar);
}

void vtkhdf_put_attributes(struct vtkhdf_file *w, int64_t major)
{
    const int64_t version[2] = {major, 0};
    hsize_t two = 2;
    hid_t space = H5Screate_simple(1, &two, NULL);
    hid_t attribute = H5Acreate2(w->root, "Version", H5T_STD_I64LE, space, H5P_DEFAULT, H5P_DEFAULT);
    w->good = w->good && attribute >= 0 && H5Awrite(attribute, H5T_NATIVE_INT64, version) >= 0;
    H5Aclose(attribute);
    H5Sclose(space);
    put_text_attribute(w, w->root, "Type", H5T_CSET_ASCII, "UnstructuredGrid");
}

hid_t vtkhdf_float_type(enum tetlod_type type)
{
    return type == TETLOD_FLOAT32 ? H5T_IEEE_F32LE : H5T_IEEE_F64LE;
}

/* A unit as the attribute of a data set that netCDF, too, keeps it in. */
void vtkhdf_put_unit(struct vtkhdf_file *w, const char *path, const char *unit)
{
    hid_t set = w->good ? H5Dopen2(w->root, path, H5P_DEFAULT) : -1;
    w->good = set >= 0;
    put_text_attribute(w, set, H5_UNITS, H5T_CSET_UTF8, unit);
    H5Dclose(set);
}

/* The path of a data set in a group, to be freed; NULL: no memory. A '/' in a field's name would be a group. */
char *vtkhdf_path(const char *group, const char *name)
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

static enum tetlod_status put_field(struct vtkhdf_file *w, const char *group, const struct point_field *field,
                                    uint64_t rows, struct tetlod_error *error)
{
    const hsize_t dims[2] = {rows, field->components};
    char *path = vtkhdf_path(group, field->name);
    if (!path)
        return tetlodi_fail_nomem(error, "a field's name", strlen(field->name));
    vtkhdf_put_set(w, path, field->components > 1 ? 2 : 1, dims, H5T_NATIVE_DOUBLE,
            field->is_integer ? H5T_STD_I64LE : vtkhdf_float_type(field->type), field->values);
    if (field->unit[0])
        vtkhdf_put_unit(w, path, field->unit);
    free(path);
    return TETLOD_OK;
}

static enum tetlod_status put_cells(struct vtkhdf_file *w, const struct tetmesh *mesh, struct tetlod_error *error)
{
    const hsize_t tets = mesh->tet_count, ends = tets + 1, corners = 4 * tets;
    int64_t *offsets = array_new((size_t)ends, sizeof *offsets);
    unsigned char *types = array_new((size_t)tets, 1);
    if (offsets && types) {
        memset(types, VTK_TYPE_TET, (size_t)tets);
        for (size_t i = 0; i < ends; i++)
            offsets[i] = 4 * (int64_t)i;
        vtkhdf_put_set(w, "Connectivity", 1, &corners, H5T_NATIVE_UINT32, H5T_STD_I64LE, mesh->corners);
        vtkhdf_put_set(w, "Offsets", 1, &ends, H5T_NATIVE_INT64, H5T_STD_I64LE, offsets);
        vtkhdf_put_set(w, "Types", 1, &tets, H5T_NATIVE_UINT8, H5T_STD_U8LE, types);
    }
    bool nomem = !offsets || !types;
    free(offsets);
    free(types);
    return nomem ? tetlodi_fail_nomem(error, "the cells", tets * 9) : TETLOD_OK;
}

/* Cells of any kind but polyhedra, which the format has from a later version on. */
static enum tetlod_status put_lists(struct vtkhdf_file *w, const struct cell_lists *lists, struct tetlod_error *error)
{
    const hsize_t cells = lists->cell_count, ends = cells + 1, corners = lists->connectivity_count;
    if (lists->face_count)
        return tetlodi_fail(error, TETLOD_ERR_ARGUMENT,
                            "polyhedra cannot be written as VTKHDF of version 1; write .vtu or .vtk");
    uint32_t *offsets = array_zero((size_t)ends, sizeof *offsets);
    if (!offsets)
        return tetlodi_fail_nomem(error, "the cells", ends * sizeof *offsets);
    memcpy(offsets + 1, lists->ends, lists->cell_count * sizeof *offsets);
    vtkhdf_put_set(w, "Connectivity", 1, &corners, H5T_NATIVE_UINT32, H5T_STD_I64LE, lists->connectivity);
    vtkhdf_put_set(w, "Offsets", 1, &ends, H5T_NATIVE_UINT32, H5T_STD_I64LE, offsets);
    vtkhdf_put_set(w, "Types", 1, &cells, H5T_NATIVE_UINT32, H5T_STD_U8LE, lists->types);
    free(offsets);
    return TETLOD_OK;
}

static enum tetlod_status put_fact(struct vtkhdf_file *w, const struct fact *fact, struct tetlod_error *error)
{
    char group[64];
    snprintf(group, sizeof group, "FieldData/%s%s", fact->name, fact->field ? " " : "");
    const hsize_t rows = fact->codes ? strlen(fact->codes) : 1;
    char *path = vtkhdf_path(group, fact->field ? fact->field : "");
    if (!path)
        return tetlodi_fail_nomem(error, "a field's name", strlen(group));
    vtkhdf_put_set(w, path, 1, &rows, fact->codes ? H5T_NATIVE_UINT8 : H5T_NATIVE_DOUBLE,
            fact->codes ? H5T_STD_U8LE : H5T_IEEE_F64LE, fact->codes ? (const void *)fact->codes : &fact->value);
    free(path);
    return TETLOD_OK;
}

enum tetlod_status vtkhdf_put_mesh(struct vtkhdf_file *w, const struct tetmesh *mesh, struct tetlod_error *error)
{
    const hsize_t one = 1, points[2] = {mesh->vertex_count, 3};
    int64_t counts[3] = {mesh->vertex_count, mesh->tet_count, 4 * (int64_t)mesh->tet_count};
    struct cell_lists lists = {0};
    enum tetlod_status status = mesh->cells ? cell_lists_make(&lists, mesh->cells, error) : TETLOD_OK;
    counts[2] = mesh->cells ? (int64_t)lists.connectivity_count : counts[2];
    vtkhdf_put_attributes(w, 1);
    vtkhdf_put_set(w, "NumberOfPoints", 1, &one, H5T_NATIVE_INT64, H5T_STD_I64LE, &counts[0]);
    vtkhdf_put_set(w, "NumberOfCells", 1, &one, H5T_NATIVE_INT64, H5T_STD_I64LE, &counts[1]);
    vtkhdf_put_set(w, "NumberOfConnectivityIds", 1, &one, H5T_NATIVE_INT64, H5T_STD_I64LE, &counts[2]);
    vtkhdf_put_set(w, "Points", 2, points, H5T_NATIVE_DOUBLE, vtkhdf_float_type(mesh->position_type), mesh->positions);
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

/* The program's own memory, not that of HDF5's library: it may be in files. */
static void *image_resize(void *image, size_t size, H5FD_file_image_op_t when, void *opaque)
{
    (void)when;
    (void)opaque;
    return realloc(image, size);
}

static herr_t image_free(void *image, H5FD_file_image_op_t when, void *opaque)
{
    (void)when;
    (void)opaque;
    free(image);
    return 0;
}

bool vtkhdf_create(struct vtkhdf_file *out, hsize_t user_block)
{
    enum { GROWTH = 1 << 22 };
    H5Eset_auto2(H5E_DEFAULT, NULL, NULL); // it would print
    hid_t access = H5Pcreate(H5P_FILE_ACCESS), creation = H5Pcreate(H5P_FILE_CREATE);
    *out = (struct vtkhdf_file){-1, -1, (size_t)user_block, H5Pset_fapl_core(access, GROWTH, 0) >= 0};
    H5FD_file_image_callbacks_t image = {.image_realloc = image_resize, .image_free = image_free};
    out->good = out->good && H5Pset_file_image_callbacks(access, &image) >= 0;
    out->good = out->good && (!user_block || H5Pset_userblock(creation, user_block) >= 0);
    out->file = out->good ? H5Fcreate("vtkhdf", H5F_ACC_TRUNC, creation, access) : -1;
    out->good = out->file >= 0;
    H5Pclose(creation);
    H5Pclose(access);
    return out->good;
}

void vtkhdf_begin(struct vtkhdf_file *w)
{
    w->root = w->good ? H5Gcreate2(w->file, "VTKHDF", H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT) : -1;
    w->good = w->root >= 0;
}

unsigned char *vtkhdf_image(struct vtkhdf_file *w, size_t *size)
{
    void **image = NULL;
    w->good = w->good && H5Fflush(w->file, H5F_SCOPE_LOCAL) >= 0;
    const ssize_t end = w->good ? H5Fget_file_image(w->file, NULL, 0) : -1; // as HDF5 counts: behind the user block
    w->good = end > 0 && H5Fget_vfd_handle(w->file, H5P_DEFAULT, (void **)&image) >= 0;
    *size = w->good ? (size_t)end + w->user_block : 0;
    return w->good ? *image : NULL;
}

void vtkhdf_close(struct vtkhdf_file *w)
{
    H5Gclose(w->root);
    H5Fclose(w->file);
}

enum tetlod_status vtkhdf_write(const struct tetmesh *mesh, const struct tetlodi_sink *sink, struct tetlod_error *error)
{
    struct vtkhdf_file w;
    vtkhdf_create(&w, 0);
    vtkhdf_begin(&w);
    enum tetlod_status status = w.good ? vtkhdf_put_mesh(&w, mesh, error) : TETLOD_OK;
    size_t size;
    unsigned char *image = vtkhdf_image(&w, &size);
    if (status == TETLOD_OK)
        status = image ? sink->write(sink->opaque, image, size) : tetlodi_fail_nomem(error, "the HDF5 file", 0);
    vtkhdf_close(&w);
    return status;
}
