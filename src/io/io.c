/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/io/io.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

#include "format/fail.h"
#include "src/io/formats.h"
#include "src/util/array.h"
#include "src/util/file.h"

/* What a second file of a mesh is: named by the user, or of the same name with another extension. */
enum second { NO_SECOND, SOLUTION, SIBLING };

struct format {
    const char *name;
    const char *extensions[4];
    enum second second;
    bool (*sniff)(const unsigned char *bytes, size_t size); /* NULL: by extension alone */
    enum tetlod_status (*read)(struct tetmesh *mesh, const struct io_input *input, struct io_report *report,
                               struct tetlod_error *error);
    enum tetlod_status (*write)(const struct tetmesh *mesh, const struct tetlodi_sink *sink, struct tetlod_error *error);
};

/* In the order in which contents are tried: PLOT3D, which has no magic, last. */
static const struct format formats[] = {
    {"tetlod", {"tetlod"}, NO_SECOND, stream_sniff, stream_read, NULL},
    {"vtu", {"vtu"}, NO_SECOND, vtu_sniff, vtu_read, io_write_vtu},
    {"vtk", {"vtk"}, NO_SECOND, vtk_sniff, vtk_read, io_write_vtk},
    {"gmsh", {"msh"}, NO_SECOND, gmsh_sniff, gmsh_read, gmsh_write},
    {"stl", {"stl"}, NO_SECOND, NULL, NULL, stl_write},
    {"ply", {"ply"}, NO_SECOND, NULL, NULL, ply_write},
    {"medit", {"mesh"}, SOLUTION, medit_sniff, medit_read, NULL},
    {"tetgen", {"node", "ele"}, SIBLING, NULL, tetgen_read, NULL},
    {"plot3d", {"xyz", "p3d", "x"}, SOLUTION, plot3d_sniff, plot3d_read, NULL},
};

enum { FORMATS = sizeof formats / sizeof *formats };

static const struct format *by_extension(const char *path)
{
    const char *dot = strrchr(path, '.');
    for (int f = 0; dot && f < FORMATS; f++)
        for (int e = 0; e < 4 && formats[f].extensions[e]; e++)
            if (strcasecmp(dot + 1, formats[f].extensions[e]) == 0)
                return &formats[f];
    return NULL;
}

static const struct format *find_format(const char *path, const unsigned char *bytes, size_t size)
{
    for (int f = 0; f < FORMATS; f++)
        if (formats[f].sniff && formats[f].sniff(bytes, size))
            return &formats[f];
    const struct format *format = by_extension(path);
    return format && format->read ? format : NULL;
}

enum tetlod_status io_read_input(struct tetmesh *out, const char *path, const struct io_input *input,
                                 struct io_report *report, struct tetlod_error *error)
{
    if (input->size == 0)
        return tetlodi_fail(error, TETLOD_ERR_MESH, "is an empty file");
    const struct format *format = find_format(path, input->bytes, input->size);
    if (!format)
        return tetlodi_fail(error, TETLOD_ERR_MESH,
                            "is not a mesh file that tetlod reads; 'tetlod help convert' lists the formats");
    if (input->other && format->second == NO_SECOND)
        return tetlodi_fail(error, TETLOD_ERR_MESH, "is a %s file; only PLOT3D and Medit have a solution file",
                            format->name);
    if (!input->other && format->second == SIBLING)
        return tetlodi_fail(error, TETLOD_ERR_MESH, "lacks its second file");
    report->format = format->name;
    TETLOD_TRY(format->read(out, input, report, error));
    if (input->nan_fill) {
        TETLOD_TRY(tetmesh_validate_tets(out, error));
        TETLOD_TRY(tetmesh_drop_unused(out, error)); // often they are those that have no value
        TETLOD_TRY(nan_fill(out, input->nan_fill, &report->nan_filled, error));
    }
    TETLOD_TRY(tetmesh_validate(out, error));
    return tetmesh_drop_unused(out, error);
}

/* The two files of a mesh that is told by its extension; the caller frees the names. */
static enum tetlod_status name_siblings(const char *path, const struct format *format, char *names[2],
                                        struct tetlod_error *error)
{
    int stem = (int)(strrchr(path, '.') - path);
    size_t capacity = strlen(path) + 8;
    for (int i = 0; i < 2; i++) {
        names[i] = array_new(capacity, 1);
        if (!names[i])
            return tetlodi_fail_nomem(error, "a file's name", capacity);
        snprintf(names[i], capacity, "%.*s.%s", stem, path, format->extensions[i]);
    }
    return TETLOD_OK;
}

static enum tetlod_status read_files(struct tetmesh *out, const char *path, const char *second,
                                     const struct nan_fill *nan_fill, struct io_report *report, struct tetlod_error *error)
{
    struct io_input input = {.other_path = second, .nan_fill = nan_fill};
    unsigned char *bytes = NULL, *other = NULL;
    struct tetlod_error inner = {.offset = UINT64_MAX};
    enum tetlod_status status = file_read(path, &bytes, &input.size, error);
    if (status == TETLOD_OK && second)
        status = file_read(second, &other, &input.other_size, error);
    if (status == TETLOD_OK) {
        input.bytes = bytes;
        input.other = other;
        status = io_read_input(out, path, &input, report, &inner);
        if (status != TETLOD_OK)
            tetlodi_fail(error, status, "%.120s: %s", path, inner.message);
    }
    free(bytes);
    free(other);
    return status;
}

enum tetlod_status io_read(struct tetmesh *out, const char *path, const struct io_read_options *options,
                           struct io_report *report, struct tetlod_error *error)
{
    struct io_report unasked;
    const char *solution = options ? options->solution : NULL;
    const struct nan_fill *nan_fill = options ? options->nan_fill : NULL;
    const struct format *format = by_extension(path);
    char *names[2] = {NULL, NULL};
    enum tetlod_status status = TETLOD_OK;
    report = report ? report : &unasked;
    *report = (struct io_report){0};
    *out = (struct tetmesh){0};
    if (!format || format->second != SIBLING)
        status = read_files(out, path, solution, nan_fill, report, error);
    else if (solution)
        status = tetlodi_fail(error, TETLOD_ERR_MESH, "%.120s: is a %s file; only PLOT3D and Medit have a solution file",
                              path, format->name);
    else {
        status = name_siblings(path, format, names, error);
        if (status == TETLOD_OK)
            status = read_files(out, names[0], names[1], nan_fill, report, error);
    }
    free(names[0]);
    free(names[1]);
    if (status != TETLOD_OK)
        tetmesh_fini(out);
    return status;
}

enum tetlod_status io_check_output(const char *path, struct tetlod_error *error)
{
    const struct format *format = by_extension(path);
    char known[128] = "";
    size_t length = 0;
    if (format && format->write)
        return TETLOD_OK;
    for (int f = 0; f < FORMATS; f++)
        if (formats[f].write)
            length += (size_t)snprintf(known + length, sizeof known - length, "%s.%s", length ? ", " : "",
                                       formats[f].extensions[0]);
    return tetlodi_fail(error, TETLOD_ERR_ARGUMENT,
                        "%.120s: the format of an output is told by its extension, which is one of %s", path, known);
}

enum tetlod_status io_write(const struct tetmesh *mesh, const char *path, struct tetlod_error *error)
{
    TETLOD_TRY(io_check_output(path, error));
    const struct format *format = by_extension(path);
    struct file_output *output;
    TETLOD_TRY(file_output_open(&output, path, error));
    struct tetlodi_sink sink = file_output_sink(output);
    struct tetlod_error inner = {.offset = UINT64_MAX};
    enum tetlod_status status = format->write(mesh, &sink, &inner);
    if (status == TETLOD_OK || status == TETLOD_ERR_IO) // commit knows what the system said
        return file_output_commit(output, error);
    file_output_abort(output);
    return tetlodi_fail(error, status, "%.120s: %s", path, inner.message);
}
