/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/io/services/h5.h"

#include <stdlib.h>
#include <string.h>

#include "format/fail.h"
#include "src/util/array.h"

enum tetlod_status h5_open_file(const char *path, hid_t *out, struct tetlod_error *error)
{
    H5Eset_auto2(H5E_DEFAULT, NULL, NULL); // it would print
    *out = H5Fopen(path, H5F_ACC_RDONLY, H5P_DEFAULT);
    return *out >= 0 ? TETLOD_OK : tetlodi_fail(error, TETLOD_ERR_MESH,
                                                "is not an HDF5 file, or is damaged or truncated");
}

/* Whether values are in other files, which a hostile one could name. */
static bool is_elsewhere(hid_t set)
{
    hid_t list = H5Dget_create_plist(set);
    bool elsewhere = list < 0 || H5Pget_layout(list) == H5D_VIRTUAL || H5Pget_external_count(list) != 0;
    H5Pclose(list);
    return elsewhere;
}

/* Every link on the way is looked at: one to another file is not followed. */
bool h5_has(hid_t where, const char *name)
{
    char path[512];
    size_t length = strlen(name);
    if (length >= sizeof path)
        return false;
    for (size_t i = 1; i <= length; i++)
        if (name[i] == '/' || name[i] == 0) {
            memcpy(path, name, i);
            path[i] = 0;
            H5L_info_t link;
            if (strcmp(path, "/") != 0 &&
                (H5Lget_info(where, path, &link, H5P_DEFAULT) < 0 || link.type >= H5L_TYPE_EXTERNAL))
                return false;
        }
    return H5Oexists_by_name(where, name, H5P_DEFAULT) > 0;
}

uint64_t h5_row_size(const struct h5_set *set)
{
    uint64_t size = 1;
    for (int d = 1; d < set->rank; d++)
        size *= set->dims[d];
    return size;
}

static enum tetlod_status describe(struct h5_set *set, const char *name, uint64_t file_size, struct tetlod_error *error)
{
    enum { MAX_RATIO = 1100 }; // deflate reaches 1032
    hid_t type = H5Dget_type(set->id), space = H5Dget_space(set->id);
    H5T_class_t class = H5Tget_class(type);
    size_t size = H5Tget_size(type);
    hsize_t dims[H5_MOST_RANK] = {0};
    set->rank = H5Sget_simple_extent_ndims(space);
    bool numbers = class == H5T_INTEGER || class == H5T_FLOAT, fits = set->rank >= 0 && set->rank <= H5_MOST_RANK;
    if (fits)
        H5Sget_simple_extent_dims(space, dims, NULL);
    H5Tclose(type);
    H5Sclose(space);
    set->is_integer = class == H5T_INTEGER;
    set->type = class == H5T_FLOAT && size == 4 ? TETLOD_FLOAT32 : TETLOD_FLOAT64;
    if (!numbers || !fits)
        return tetlodi_fail(error, TETLOD_ERR_MESH,
                            "data set %.80s: it should be of numbers, in at most %d dimensions", name,
                            H5_MOST_RANK);
    set->count = 1;
    for (int d = 0; d < set->rank; d++) {
        set->dims[d] = dims[d];
        if (dims[d] && set->count > file_size * MAX_RATIO / dims[d])
            return tetlodi_fail(error, TETLOD_ERR_MESH, "data set %.80s: it has more values than the file can hold",
                                name);
        set->count *= dims[d];
    }
    return TETLOD_OK;
}

enum tetlod_status h5_open_set(hid_t where, const char *name, uint64_t file_size, struct h5_set *out,
                               struct tetlod_error *error)
{
    *out = (struct h5_set){.id = h5_has(where, name) ? H5Dopen2(where, name, H5P_DEFAULT) : -1};
    if (out->id < 0)
        return tetlodi_fail(error, TETLOD_ERR_MESH, "data set %.80s is missing or cannot be read", name);
    if (is_elsewhere(out->id)) {
        H5Dclose(out->id);
        return tetlodi_fail(error, TETLOD_ERR_MESH,
                            "data set %.80s has its values in another file; copy them into this one", name);
    }
    enum tetlod_status status = describe(out, name, file_size, error);
    if (status != TETLOD_OK)
        H5Dclose(out->id);
    return status;
}

void h5_read_text(hid_t where, const char *name, char *out, size_t size)
{
    out[0] = 0;
    hid_t attribute = H5Aexists(where, name) > 0 ? H5Aopen(where, name, H5P_DEFAULT) : -1;
    hid_t type = attribute >= 0 ? H5Aget_type(attribute) : -1, space = attribute >= 0 ? H5Aget_space(attribute) : -1;
    bool is_text = type >= 0 && H5Tget_class(type) == H5T_STRING && H5Sget_simple_extent_npoints(space) == 1;
    if (is_text && H5Tis_variable_str(type) > 0) {
        char *text = NULL;
        if (H5Aread(attribute, type, &text) >= 0 && text && strlen(text) < size)
            memcpy(out, text, strlen(text) + 1);
        H5free_memory(text);
    } else if (is_text && H5Tget_size(type) < size && H5Aread(attribute, type, out) >= 0) {
        out[H5Tget_size(type)] = 0;
    }
    H5Sclose(space);
    H5Tclose(type);
    H5Aclose(attribute);
}

/* Numbers that do not fit become the largest, whose bytes are all 255. */
static H5T_conv_ret_t on_misfit(H5T_conv_except_t what, hid_t from_type, hid_t to_type, void *from, void *to,
                                void *opaque)
{
    (void)from_type;
    (void)from;
    (void)opaque;
    if (what != H5T_CONV_EXCEPT_RANGE_LOW && what != H5T_CONV_EXCEPT_RANGE_HI)
        return H5T_CONV_UNHANDLED;
    memset(to, 255, H5Tget_size(to_type));
    return H5T_CONV_HANDLED;
}

static enum tetlod_status read_rows(const struct h5_set *set, uint64_t first, uint64_t rows, hid_t type, void *out,
                                    struct tetlod_error *error)
{
    hsize_t start[H5_MOST_RANK] = {first}, size[H5_MOST_RANK];
    for (int d = 0; d < set->rank; d++)
        size[d] = d ? set->dims[d] : rows;
    if (set->rank && (first > set->dims[0] || rows > set->dims[0] - first))
        return tetlodi_fail(error, TETLOD_ERR_MESH, "a data set has %llu rows, but rows %llu to %llu are needed",
                            (unsigned long long)set->dims[0], (unsigned long long)first,
                            (unsigned long long)(first + rows));
    if (rows == 0)
        return TETLOD_OK;
    hid_t space = H5Dget_space(set->id), memory = set->rank ? H5Screate_simple(set->rank, size,
                                                                               NULL) : H5Screate(H5S_SCALAR);
    bool good = space >= 0 && memory >= 0;
    if (good && set->rank)
        good = H5Sselect_hyperslab(space, H5S_SELECT_SET, start, NULL, size, NULL) >= 0;
    hid_t how = H5Pcreate(H5P_DATASET_XFER);
    if (H5Tget_sign(type) == H5T_SGN_NONE)
        good = good && H5Pset_type_conv_cb(how, on_misfit, NULL) >= 0;
    good = good && H5Dread(set->id, type, memory, space, how, out) >= 0;
    H5Pclose(how);
    H5Sclose(space);
    H5Sclose(memory);
    return good ? TETLOD_OK : tetlodi_fail(error, TETLOD_ERR_MESH, "a data set cannot be read; is the file damaged?");
}

enum tetlod_status h5_read_doubles(const struct h5_set *set, uint64_t first, uint64_t rows, double *out,
                                   struct tetlod_error *error)
{
    return read_rows(set, first, rows, H5T_NATIVE_DOUBLE, out, error);
}

enum tetlod_status h5_read_ints(const struct h5_set *set, uint64_t first, uint64_t rows, int64_t *out,
                                struct tetlod_error *error)
{
    return read_rows(set, first, rows, H5T_NATIVE_INT64, out, error);
}

enum tetlod_status h5_read_numbers(const struct h5_set *set, uint64_t first, uint64_t rows, uint32_t *out,
                                   struct tetlod_error *error)
{
    return read_rows(set, first, rows, H5T_NATIVE_UINT32, out, error);
}

enum tetlod_status h5_read_bytes(const struct h5_set *set, uint64_t first, uint64_t rows, uint8_t *out,
                                 struct tetlod_error *error)
{
    return read_rows(set, first, rows, H5T_NATIVE_UINT8, out, error);
}

enum tetlod_status h5_load_ints(hid_t where, const char *name, uint64_t file_size, int64_t **out, uint64_t *count,
                                struct tetlod_error *error)
{
    struct h5_set set;
    *out = NULL;
    TETLOD_TRY(h5_open_set(where, name, file_size, &set, error));
    *out = array_new((size_t)set.count, sizeof **out);
    *count = set.count;
    enum tetlod_status status = *out ? h5_read_ints(&set, 0, set.rank ? set.dims[0] : 1, *out, error)
                                     : tetlodi_fail_nomem(error, name, set.count * 8);
    H5Dclose(set.id);
    return status;
}
