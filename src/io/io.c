/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/io/io.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "format/fail.h"
#include "src/io/read_input.h"
#include "src/io/readers/readers.h"
#include "src/io/registry.h"
#include "src/io/services/pieces.h"
#include "src/mesh/cell_average.h"
#include "src/mesh/ids.h"
#include "src/mesh/nan_fill.h"
#include "src/mesh/originals.h"
#include "src/mesh/tet_clean.h"
#include "src/util/array.h"
#include "src/util/channel.h"

bool io_format(size_t number, struct io_format *out)
{
    const struct format *format = format_at(number);
    if (!format)
        return false;
    *out = (struct io_format){.name = format->name, .about = format->about, .extensions = format->extensions};
    out->reads = format->read != NULL;
    out->writes = format->write != NULL;
    return true;
}

static io_reader read_any;

/* Adds the blocks of a file. */
static enum tetlod_status read_blocks(struct blocks *out, const char *path, const struct io_input *input,
                                      struct io_report *report, struct tetlod_error *error)
{
    const struct format *format = format_find(path, input->bytes, input->size);
    if (input->size == 0 && (!format || format->files != FOLDER))
        return tetlodi_fail(error, TETLOD_ERR_MESH, "is an empty file");
    if (!format)
        return tetlodi_fail(error, TETLOD_ERR_MESH,
                            "is not a mesh file that this binary reads ('tetlod formats' lists the formats); meshio or "
                            "ParaView may make a .vtu of it");
    if (input->other && format->files != SOLUTION && format->files != SIBLING)
        return tetlodi_fail(error, TETLOD_ERR_MESH, "is a %s file; only PLOT3D, Medit and MFEM have a solution file",
                            format->name);
    if (!input->other && format->files == SIBLING)
        return tetlodi_fail(error, TETLOD_ERR_MESH, "lacks its second file");
    if (!input->depth)
        report->format = format->name;
    if (input->view)
        file_view_release(input->view); // the format was looked for in it
    struct io_input known = *input;
    known.read_any = read_any;
    return format->read(out, &known, report, error);
}

/* Cells of the blocks from `first` on name points that there are, which a merge would count from another number on. The
 * faces of polyhedra are looked at where cells are split. */
static enum tetlod_status check_corners(const struct blocks *blocks, size_t first, struct tetlod_error *error)
{
    for (size_t b = first; b < blocks->count; b++) {
        const struct cells *cells = &blocks->at[b].cells;
        const size_t count = cells->connectivity ? (size_t)cells->connectivity_count : 0;
        const uint32_t points = blocks->at[b].mesh.vertex_count;
        if (cells->types && memchr(cells->types, VTK_TYPE_POLYHEDRON, (size_t)cells->count))
            continue;
        size_t i = tetmesh_find_outside(cells->connectivity, count, points);
        if (i < count)
            return tetlodi_fail(error, TETLOD_ERR_MESH, "a cell refers to point %lld, but there are only %u points",
                                cells->connectivity[i] == TETLOD_NONE ? -1 : (long long)cells->connectivity[i], points);
    }
    return TETLOD_OK;
}

static enum tetlod_status read_any(struct blocks *out, const struct io_input *input, struct io_report *report,
                                   struct tetlod_error *error)
{
    const size_t first = out->count;
    TETLOD_TRY(read_blocks(out, input->path, input, report, error));
    return check_corners(out, first, error);
}

static const struct io_read_options no_options;

/* Refuses options that the file has no use for, so that they are not passed over in silence. */
static enum tetlod_status check_choices(const struct io_read_options *options, const struct io_report *report,
                                        struct tetlod_error *error)
{
    if (options->block && !report->names_blocks)
        return tetlodi_fail(error, TETLOD_ERR_MESH, "has no blocks with names; leave --block %.60s out",
                            options->block);
    if (options->time && !report->steps && strcmp(options->time, "last") != 0 && strcmp(options->time, "0") != 0)
        return tetlodi_fail(error, TETLOD_ERR_MESH, "has no steps in time, of which %.40s could be chosen",
                            options->time);
    return TETLOD_OK;
}

/* What the options say of the values of cells. */
static enum tetlod_status treat_cell_data(struct tetmesh *mesh, const struct io_read_options *options,
                                          struct io_report *report, struct tetlod_error *error)
{
    bool averages = options->cell_data == CELL_DATA_AVERAGE || (options->cell_data == CELL_DATA_KEEP &&
                                                                !mesh->field_count);
    bool *ids = array_zero(mesh->cell_field_count, sizeof *ids);
    enum tetlod_status status = ids ? TETLOD_OK : tetlodi_fail_nomem(error, "the cell fields", mesh->cell_field_count);
    if (ids && averages)
        ids_find(mesh->cell_fields, mesh->cell_field_count, mesh->tet_count, ids);
    for (uint32_t f = 0; f < mesh->cell_field_count && averages && status == TETLOD_OK; f++)
        if (!ids[f]) { // a mean of ids means nothing
            status = cell_average(mesh, f, error);
            report->averaged_fields++;
        }
    free(ids);
    while (options->cell_data == CELL_DATA_DROP && mesh->cell_field_count)
        point_field_fini(&mesh->cell_fields[--mesh->cell_field_count]);
    return status;
}

static uint64_t count_nan_cells(const struct tetmesh *mesh)
{
    uint64_t count = 0;
    for (uint32_t f = 0; f < mesh->cell_field_count; f++) {
        const struct point_field *field = &mesh->cell_fields[f];
        for (size_t i = 0; i < (size_t)mesh->tet_count * field->components; i++)
            count += isnan(field->values[i]) != 0;
    }
    return count;
}

/* From tetrahedra as the file has them to a mesh that is valid. */
static enum tetlod_status clean(struct tetmesh *mesh, const struct io_read_options *options, struct io_report *report,
                                struct tetlod_error *error)
{
    if (options->drop_degenerate)
        TETLOD_TRY(tet_clean(mesh, &report->dropped_tets, error));
    TETLOD_TRY(tetmesh_validate_tets(mesh, error));
    TETLOD_TRY(originals_settle(mesh, error));
    TETLOD_TRY(tetmesh_drop_unused(mesh, error)); // often they are those that have no value
    mesh->unused_points -= mesh->unused_points < report->welded_points ? mesh->unused_points : report->welded_points;
    TETLOD_TRY(treat_cell_data(mesh, options, report, error));
    report->nan_cells = count_nan_cells(mesh);
    if (options->nan_fill)
        TETLOD_TRY(nan_fill(mesh, options->nan_fill, &report->nan_filled, error));
    return options->any_values ? tetmesh_validate_positions(mesh, error) : tetmesh_validate_values(mesh, error);
}

enum tetlod_status io_read_input(struct tetmesh *out, const char *path, const struct io_input *input,
                                 struct io_report *report, struct tetlod_error *error)
{
    const struct io_read_options *options = input->options ? input->options : &no_options;
    struct blocks blocks = {0};
    struct block block = {0};
    enum tetlod_status status;
    TETLOD_TRY_DONE(read_blocks(&blocks, path, input, report, error));
    TETLOD_TRY_DONE(check_choices(options, report, error));
    if (blocks.count == 0) {
        status = tetlodi_fail(error, TETLOD_ERR_MESH, "there is no volume in it");
        goto done;
    }
    TETLOD_TRY_DONE(blocks_merge(&blocks, options, &block, report, error));
    if (block.mesh.vertex_count == 0) {
        status = tetlodi_fail(error, TETLOD_ERR_MESH, "there is no point in it");
        goto done;
    }
    TETLOD_TRY_DONE(block_split(&block, options, out, report, error));
    block_fini(&block);
    status = clean(out, options, report, error);
done:
    block_fini(&block);
    blocks_fini(&blocks);
    return status;
}

/* ---- files */

/* The two files of a mesh whose extension names its format; the caller frees the names. */
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
                                     const struct io_read_options *options, struct io_report *report,
                                     struct tetlod_error *error)
{
    struct io_input input = {.other_path = second, .path = path, .options = options};
    struct opened_input opened;
    struct file_view other = {0};
    struct tetlod_error inner = {.offset = UINT64_MAX};
    enum tetlod_status status = io_input_open(&opened, &input, path, error);
    if (status == TETLOD_OK && second)
        status = file_view_path(&other, second, error);
    if (status == TETLOD_OK) {
        input.other = other.bytes;
        input.other_size = other.size;
        input.other_view = second ? &other : NULL;
        status = io_read_input(out, path, &input, report, &inner);
        if (status != TETLOD_OK)
            tetlodi_fail(error, status, "%.400s: %s", path, inner.message);
    }
    io_input_close(&opened);
    file_view_close(&other);
    return status;
}

enum tetlod_status io_read(struct tetmesh *out, const char *path, const struct io_read_options *options,
                           struct io_report *report, struct tetlod_error *error)
{
    struct io_report unasked;
    struct io_read_options own;
    struct io_sharing sharing;
    const char *solution = options ? options->solution : NULL;
    const struct format *format = format_by_extension(path);
    char *names[2] = {NULL, NULL};
    enum tetlod_status status = TETLOD_OK;
    report = report ? report : &unasked;
    *report = (struct io_report){0};
    *out = (struct tetmesh){0};
    if (options && options->sharing) {
        sharing = *options->sharing;
        sharing.path = path;
        own = *options;
        own.sharing = &sharing;
        options = &own;
    }
    if (!format || format->files != SIBLING)
        status = read_files(out, path, solution, options, report, error);
    else if (solution)
        status =
            tetlodi_fail(error, TETLOD_ERR_MESH,
                         "%.400s: is a %s file; only PLOT3D, Medit and MFEM have a solution file", path, format->name);
    else {
        status = name_siblings(path, format, names, error);
        if (status == TETLOD_OK)
            status = read_files(out, names[0], names[1], options, report, error);
    }
    free(names[0]);
    free(names[1]);
    if (status != TETLOD_OK)
        tetmesh_fini(out);
    return status;
}

enum tetlod_status io_read_help(const struct work_share *share, const struct io_read_options *options,
                                struct tetlod_error *error)
{
    struct channel channel = {share, TETLOD_OK};
    struct io_sharing sharing = {.share = share};
    struct io_read_options own = *options;
    struct tetmesh none;
    char *path = channel_text(&channel, NULL), *time = channel_text(&channel, NULL);
    CHANNEL_VALUE(&channel, sharing.pieces);
    own.sharing = &sharing;
    own.time = time;
    enum tetlod_status status = path ? io_read(&none, path, &own, NULL, error) : channel.status;
    if (status == TETLOD_OK) { // it has no pieces here
        tetmesh_fini(&none);
        status = tetlodi_fail(error, TETLOD_ERR_MESH, "%.400s: is another file where the first rank is", path);
    }
    free(path);
    free(time);
    return status == TETLOD_MORE ? TETLOD_OK : status;
}

bool io_is_stream(const char *path)
{
    struct file_input file;
    unsigned char head[8];
    if (file_input_open(&file, path, NULL) != TETLOD_OK)
        return false;
    const bool is_stream = stream_sniff(head, file_input_read(&file, 0, sizeof head, head));
    file_input_close(&file);
    return is_stream;
}

enum tetlod_status io_check_output(const char *path, struct tetlod_error *error)
{
    const struct format *format = format_by_extension(path);
    char known[128] = "";
    size_t length = 0;
    if (format && format->write)
        return TETLOD_OK;
    for (size_t f = 0; (format = format_at(f)); f++)
        if (format->write)
            length += (size_t)snprintf(known + length, sizeof known - length, "%s.%s", length ? ", " : "",
                                       format->extensions[0]);
    return tetlodi_fail(error, TETLOD_ERR_ARGUMENT,
                        "%.400s: the extension of an output decides its format: use one of %s", path, known);
}

enum tetlod_status io_check_cells_output(const char *path, struct tetlod_error *error)
{
    const struct format *format = format_by_extension(path);
    return !format || strcmp(format->name, "vtu") == 0 || strcmp(format->name, "vtk") == 0 ||
                   strcmp(format->name, "vtkhdf") == 0
               ? TETLOD_OK
               : tetlodi_fail(error, TETLOD_ERR_ARGUMENT,
                              "%.120s: %s files are written with tetrahedra alone; the original cells go into .vtu, "
                              ".vtk or .vtkhdf",
                              path, format->name);
}

enum tetlod_status io_write(const struct tetmesh *mesh, const char *path, struct tetlod_error *error)
{
    TETLOD_TRY(io_check_output(path, error));
    if (mesh->cells)
        TETLOD_TRY(io_check_cells_output(path, error));
    const struct format *format = format_by_extension(path);
    struct file_output *output;
    TETLOD_TRY(file_output_open(&output, path, error));
    struct tetlodi_sink sink = file_output_sink(output);
    struct tetlod_error inner = {.offset = UINT64_MAX};
    enum tetlod_status status = format->write(mesh, &sink, &inner);
    if (status == TETLOD_OK || status == TETLOD_ERR_IO) // commit knows what the system said
        return file_output_commit(output, error);
    file_output_abort(output);
    return tetlodi_fail(error, status, "%.400s: %s", path, inner.message);
}

enum tetlod_status io_write_stream(const struct shown_stream *stream, const struct shown_meshes *meshes,
                                   const struct tetlodi_sink *sink, struct tetlod_error *error)
{
#ifdef TETLOD_HDF5
    return vtkhdf_write_stream(stream, meshes, sink, error);
#else
    (void)stream;
    (void)meshes;
    (void)sink;
    return tetlodi_fail(error, TETLOD_ERR_ARGUMENT, "this program was built without libhdf5: write a .tetlod");
#endif
}
