/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/cli/sample_series.h"

#include <stdio.h>
#include <string.h>

#include "format/fail.h"
#include "format/common/utf8.h"
#include "src/io/io.h"
#include "src/util/file.h"
#include "src/util/put.h"

enum { PATH_SIZE = 4096 };

static double time_of(uint32_t step, uint32_t steps)
{
    return steps > 1 ? step / (steps - 1.0) : 0;
}

static enum tetlod_status write_steps(const struct sample *sample, struct tetmesh *mesh, uint32_t size, uint32_t steps,
                                      uint32_t remesh,
                                      const char *stem, struct tetlod_error *error)
{
    char path[PATH_SIZE + 32];
    for (uint32_t step = 0; step < steps; step++) {
        if (step == 0 || (remesh && step % remesh == 0)) {
            tetmesh_fini(mesh);
            TETLOD_TRY(sample->make(mesh, size + (remesh ? step / remesh : 0), error));
        }
        sample->move(mesh, time_of(step, steps));
        snprintf(path, sizeof path, "%s_%u.vtu", stem, step);
        TETLOD_TRY(io_write(mesh, path, error));
    }
    return TETLOD_OK;
}

static enum tetlod_status put_collection(const struct tetlodi_sink *sink, uint32_t steps, const char *name,
                                         struct tetlod_error *error)
{
    struct put put;
    TETLOD_TRY(put_init(&put, sink, false, error));
    put_text(&put, "<?xml version=\"1.0\"?>\n<VTKFile type=\"Collection\" version=\"0.1\">\n  <Collection>\n");
    for (uint32_t step = 0; step < steps; step++) {
        put_format(&put, "    <DataSet timestep=\"%.9g\" part=\"0\" file=\"", time_of(step, steps));
        put_escaped(&put, name);
        put_format(&put, "_%u.vtu\"/>\n", step);
    }
    put_text(&put, "  </Collection>\n</VTKFile>\n");
    return put_finish(&put);
}

enum tetlod_status sample_series_write(const struct sample *sample, uint32_t size, uint32_t steps, uint32_t remesh,
                                       const char *output,
                                       struct tetlod_error *error)
{
    struct tetmesh mesh = {0};
    struct file_output *file;
    char stem[PATH_SIZE];
    size_t length = strlen(output) - strlen(".pvd");
    if (length >= sizeof stem)
        return tetlodi_fail(error, TETLOD_ERR_IO, "the output's path is too long");
    memcpy(stem, output, length);
    stem[length] = 0;
    const char *slash = strrchr(stem, '/'), *name = slash ? slash + 1 : stem;
    if (!tetlodi_plain_text(name, strlen(name)))
        return tetlodi_fail(error, TETLOD_ERR_ARGUMENT,
                            "a PVD file names its parts in XML, which has no control characters and is UTF-8; choose "
                            "another name");
    enum tetlod_status status = write_steps(sample, &mesh, size, steps, remesh, stem, error);
    tetmesh_fini(&mesh);
    TETLOD_TRY(status);
    TETLOD_TRY(file_output_open(&file, output, error));
    const struct tetlodi_sink sink = file_output_sink(file);
    return file_output_finish(file, put_collection(&sink, steps, name, error), error);
}
