/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/io/io.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

#include "format/fail.h"
#include "src/io/formats.h"
#include "src/util/file.h"

struct format {
    const char *name;
    const char *extensions[4];
    bool (*sniff)(const unsigned char *bytes, size_t size);
    enum tetlod_status (*read)(struct tetmesh *mesh, const struct io_input *input, struct io_report *report,
                               struct tetlod_error *error);
    enum tetlod_status (*write)(const struct tetmesh *mesh, const struct tetlodi_sink *sink, struct tetlod_error *error);
};

/* In the order in which contents are tried: PLOT3D, which has no magic, last. */
static const struct format formats[] = {
    {"vtu", {"vtu"}, vtu_sniff, vtu_read, io_write_vtu},
    {"vtk", {"vtk"}, vtk_sniff, vtk_read, io_write_vtk},
    {"plot3d", {"xyz", "p3d", "x"}, plot3d_sniff, plot3d_read, NULL},
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
        if (formats[f].sniff(bytes, size))
            return &formats[f];
    return by_extension(path);
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
    if (input->other && format->read != plot3d_read)
        return tetlodi_fail(error, TETLOD_ERR_MESH, "is a %s file; only a PLOT3D grid takes a solution file",
                            format->name);
    report->format = format->name;
    TETLOD_TRY(format->read(out, input, report, error));
    TETLOD_TRY(tetmesh_validate(out, error));
    return tetmesh_drop_unused(out, error);
}

enum tetlod_status io_read(struct tetmesh *out, const char *path, const struct io_read_options *options,
                           struct io_report *report, struct tetlod_error *error)
{
    struct io_report unasked;
    struct io_input input = {.other_path = options ? options->solution : NULL};
    unsigned char *bytes = NULL, *other = NULL;
    struct tetlod_error inner = {.offset = UINT64_MAX};
    report = report ? report : &unasked;
    *report = (struct io_report){0};
    *out = (struct tetmesh){0};
    enum tetlod_status status = file_read(path, &bytes, &input.size, error);
    if (status == TETLOD_OK && input.other_path)
        status = file_read(input.other_path, &other, &input.other_size, error);
    if (status == TETLOD_OK) {
        input.bytes = bytes;
        input.other = other;
        status = io_read_input(out, path, &input, report, &inner);
        if (status != TETLOD_OK)
            tetlodi_fail(error, status, "%.120s: %s", path, inner.message);
    }
    free(bytes);
    free(other);
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
