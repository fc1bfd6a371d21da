/* SPDX-License-Identifier: BSD-3-Clause */
/* What the readers of HDF5 files need of libhdf5: data sets of numbers, held against the size of the file before room
 * is made. */
#ifndef TETLOD_H5_H
#define TETLOD_H5_H

#include <hdf5.h>

#include "src/io/services/assemble.h"

enum { H5_MOST_RANK = 4 };

struct h5_set {
    hid_t id;
    int rank;
    uint64_t dims[H5_MOST_RANK];
    uint64_t count;      /* of values */
    enum tetlod_type type; /* FLOAT64 for all that is not float32 */
    bool is_integer;
};

/* ERR_MESH names the file's path. */
TETLOD_CHECKED enum tetlod_status h5_open_file(const char *path, hid_t *out, struct tetlod_error *error);

bool h5_has(hid_t where, const char *name);

/* To be closed with H5Dclose. Refused: what is not numbers, has more dimensions, or more values than a file of
 * `file_size` bytes can hold. */
TETLOD_CHECKED enum tetlod_status h5_open_set(hid_t where, const char *name, uint64_t file_size, struct h5_set *out,
                                              struct tetlod_error *error);

/* Rows `first` .. first + rows of the first dimension, all of the others. */
TETLOD_CHECKED enum tetlod_status h5_read_doubles(const struct h5_set *set, uint64_t first, uint64_t rows, double *out,
                                                  struct tetlod_error *error);
TETLOD_CHECKED enum tetlod_status h5_read_ints(const struct h5_set *set, uint64_t first, uint64_t rows, int64_t *out,
                                               struct tetlod_error *error);

/* The same as numbers of points: what is none, also what is negative, becomes the largest number. */
TETLOD_CHECKED enum tetlod_status h5_read_numbers(const struct h5_set *set, uint64_t first, uint64_t rows,
                                                  uint32_t *out,
                                                  struct tetlod_error *error);
TETLOD_CHECKED enum tetlod_status h5_read_bytes(const struct h5_set *set, uint64_t first, uint64_t rows, uint8_t *out,
                                                struct tetlod_error *error);

/* The attribute of a data set that holds its unit, as in netCDF files. */
#define H5_UNITS "units"

/* The text of an attribute, of fixed or of variable length; "" if there is none, or it does not fit. */
void h5_read_text(hid_t where, const char *name, char *out, size_t size);

/* A whole set in memory that the caller frees; *count values. */
TETLOD_CHECKED enum tetlod_status h5_load_ints(hid_t where, const char *name, uint64_t file_size, int64_t **out,
                                               uint64_t *count, struct tetlod_error *error);

/* Values of one row of the set. */
uint64_t h5_row_size(const struct h5_set *set);

#endif
