/* SPDX-License-Identifier: BSD-3-Clause */
#define _GNU_SOURCE // realpath
#include "src/io/io.h"

#include <limits.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

#include "format/fail.h"
#include "src/io/formats.h"
#include "src/mesh/cell_average.h"
#include "src/mesh/tet_clean.h"
#include "src/util/array.h"
#include "src/util/file.h"

enum { MOST_EXTENSIONS = 14 };

/* What a mesh is read from: one file or two. The second one is named by the user, or has the same name with another extension. */
enum files { ONE, SOLUTION, SIBLING };

struct format {
    const char *name, *about, *extensions[MOST_EXTENSIONS];
    enum files files;
    bool (*sniff)(const unsigned char *bytes, size_t size); /* NULL: by extension alone */
    enum tetlod_status (*read)(struct blocks *out, const struct io_input *input, struct io_report *report,
                               struct tetlod_error *error);
    enum tetlod_status (*write)(const struct tetmesh *mesh, const struct tetlodi_sink *sink, struct tetlod_error *error);
};

/* Formats that need a library: without it a name that says so. */
#ifdef TETLOD_HDF5
#define WITH_HDF5(function) function
#else
#define WITH_HDF5(function) NULL
#endif
#ifdef TETLOD_NETCDF
#define WITH_NETCDF(function) function
#else
#define WITH_NETCDF(function) NULL
#endif
#ifdef TETLOD_CGNS
#define WITH_CGNS(function) function
#else
#define WITH_CGNS(function) NULL
#endif

/* In the order in which contents are tried: PLOT3D, which has no magic, last. */
static const struct format formats[] = {
    {"tetlod", "a stream's finest level", {"tetlod"}, ONE, stream_sniff, stream_read, NULL},
    {"vtu", "VTK XML: unstructured, structured, rectilinear and image grids, their parallel forms, multi-block, time",
      {"vtu", "pvtu", "vts", "vtr", "vti", "vtm", "pvd", "pvts", "pvtr", "pvti", "vtpd", "vtpc"},
     ONE, vtkxml_sniff, vtkxml_read, io_write_vtu},
    {"vtk", "legacy VTK 1.0 to 5.1", {"vtk"}, ONE, vtk_sniff, vtk_read, io_write_vtk},
    {"gmsh", "Gmsh 2.2 and 4.1", {"msh"}, ONE, gmsh_sniff, gmsh_read, gmsh_write},
    {"vtkhdf", "VTKHDF: unstructured grids and images, steps in time (libhdf5)", {"vtkhdf", "hdf"}, ONE,
     WITH_HDF5(vtkhdf_sniff), WITH_HDF5(vtkhdf_read), WITH_HDF5(vtkhdf_write)},
    {"xdmf", "XDMF 2 and 3: text, raw, HDF5; collections (libhdf5)", {"xdmf", "xmf"}, ONE, WITH_HDF5(xdmf_sniff),
     WITH_HDF5(xdmf_read), xdmf_write},
    {"exodus", "Exodus II: element blocks, steps in time (libnetcdf)", {"exo", "e", "ex2", "exii"}, ONE,
     WITH_NETCDF(exodus_sniff), WITH_NETCDF(exodus_read), WITH_NETCDF(exodus_write)},
    {"cgns", "CGNS: unstructured and structured zones, polyhedra, steps in time (libcgns)", {"cgns"}, ONE,
     WITH_CGNS(cgns_sniff), WITH_CGNS(cgns_read), NULL},
    {"stl", "the boundary surface", {"stl"}, ONE, NULL, NULL, stl_write},
    {"ply", "the boundary surface with all fields", {"ply"}, ONE, NULL, NULL, ply_write},
    {"vtp", "the boundary surface with all fields", {"vtp"}, ONE, NULL, NULL, vtp_write},
    {"glb", "the boundary surface, coloured, with fields as attributes", {"glb"}, ONE, NULL, NULL, glb_write},
    {"inp", "Abaqus and CalculiX: nodes and elements", {"inp"}, ONE, inp_sniff, inp_read, NULL},
    {"medit", "Medit with its .sol, text and binary (text is written)", {"mesh"}, SOLUTION, medit_sniff, medit_read, medit_write},
    {"meshb", "Medit binary, versions 1 to 4, with its .solb", {"meshb"}, SOLUTION, NULL, medit_read, meshb_write},
    {"sol", "Medit's values at vertices: --q, and the fields of a .mesh", {"sol"}, ONE, NULL, NULL, sol_write},
    {"openfoam", "OpenFOAM cases by an empty NAME.foam in their folder: text, binary, gzip, polyhedra, times", {"foam", "openfoam"},
     ONE, NULL, foam_read, NULL},
    {"ensight", "EnSight Gold cases: text, C and Fortran binary, parts, variables of nodes and elements, times", {"case", "encas"}, ONE,
     ensight_sniff, ensight_read, NULL},
    {"tetgen", "TetGen .node with .ele", {"node", "ele"}, SIBLING, NULL, tetgen_read, NULL},
    {"plot3d", "PLOT3D grids with their solution: multi-grid, iblank, both endians, record markers", {"xyz", "p3d", "x"}, SOLUTION, plot3d_sniff, plot3d_read, NULL},
};

enum { FORMATS = sizeof formats / sizeof *formats };

bool io_format(size_t number, struct io_format *out)
{
    if (number >= FORMATS)
        return false;
    const struct format *format = &formats[number];
    *out = (struct io_format){.name = format->name, .about = format->about, .extensions = format->extensions};
    out->reads = format->read != NULL;
    out->writes = format->write != NULL;
    return true;
}

/* Whether a name is in a list already: blocks and pieces repeat theirs. */
static bool is_listed(const char *list, const char *name, size_t length)
{
    for (const char *at = list; (at = strstr(at, "'")); at += strcspn(at, ",")) {
        at++;
        if (strncmp(at, name, length) == 0 && at[length] == '\'')
            return true;
    }
    return false;
}

void io_leave_out(struct io_report *report, uint32_t *counter, const char *name, size_t length)
{
    static const char more[] = ", ...";
    size_t used = strlen(report->left_out), room = sizeof report->left_out - sizeof more;
    bool full = used >= sizeof more && strcmp(report->left_out + used - (sizeof more - 1), more) == 0;
    (*counter)++;
    if (full || is_listed(report->left_out, name, length))
        return;
    if (used + length + 4 > room)
        snprintf(report->left_out + used, sizeof report->left_out - used, "%s", more);
    else
        snprintf(report->left_out + used, room - used + 1, "%s'%.*s'", used ? ", " : "", (int)length, name);
}

static const struct format *by_extension(const char *path)
{
    const char *dot = strrchr(path, '.');
    for (int f = 0; dot && f < FORMATS; f++)
        for (int e = 0; e < MOST_EXTENSIONS && formats[f].extensions[e]; e++)
            if (strcasecmp(dot + 1, formats[f].extensions[e]) == 0)
                return &formats[f];
    return NULL;
}

/* What its first bytes say it is; if they could be of several formats, what its name says, too: values may spell another's word. */
static const struct format *find_format(const char *path, const unsigned char *bytes, size_t size)
{
    const struct format *named = by_extension(path);
    if (named && named->sniff && named->sniff(bytes, size))
        return named;
    for (int f = 0; f < FORMATS; f++)
        if (formats[f].sniff && formats[f].sniff(bytes, size))
            return &formats[f];
    return named && named->read ? named : NULL;
}

/* Adds the blocks of a file. */
static enum tetlod_status read_blocks(struct blocks *out, const char *path, const struct io_input *input,
                                      struct io_report *report, struct tetlod_error *error)
{
    const struct format *format = find_format(path, input->bytes, input->size);
    if (input->size == 0 && (!format || format->read != foam_read)) // whose file only marks the folder
        return tetlodi_fail(error, TETLOD_ERR_MESH, "is an empty file");
    if (!format)
        return tetlodi_fail(error, TETLOD_ERR_MESH,
                            "is not a mesh file that this binary reads; 'tetlod formats' lists the formats");
    if (input->other && format->files != SOLUTION && format->files != SIBLING)
        return tetlodi_fail(error, TETLOD_ERR_MESH, "is a %s file; only PLOT3D and Medit have a solution file",
                            format->name);
    if (!input->other && format->files == SIBLING)
        return tetlodi_fail(error, TETLOD_ERR_MESH, "lacks its second file");
    if (!input->depth)
        report->format = format->name;
    if (input->view)
        file_view_release(input->view); // the format was looked for in it
    return format->read(out, input, report, error);
}

static const struct io_read_options no_options;

/* Refuses options that the file has no use for, so that they are not passed over in silence. */
static enum tetlod_status check_choices(const struct io_read_options *options, const struct io_report *report, struct tetlod_error *error)
{
    if (options->block && !report->names_blocks)
        return tetlodi_fail(error, TETLOD_ERR_MESH, "has no blocks with names; leave --block %.60s out", options->block);
    if (options->time && !report->steps && strcmp(options->time, "last") != 0 && strcmp(options->time, "0") != 0)
        return tetlodi_fail(error, TETLOD_ERR_MESH, "has no steps in time; leave --time %.40s out", options->time);
    return TETLOD_OK;
}

/* What the options say of the values of cells. */
static enum tetlod_status treat_cell_data(struct tetmesh *mesh, const struct io_read_options *options,
                                          struct io_report *report, struct tetlod_error *error)
{
    bool averages = options->cell_data == CELL_DATA_AVERAGE || (options->cell_data == CELL_DATA_KEEP && !mesh->field_count);
    uint32_t region = options->cell_data == CELL_DATA_AVERAGE ? TETLOD_NONE : tetmesh_find_region(mesh);
    for (uint32_t f = 0; f < mesh->cell_field_count && averages; f++) {
        if (f == region)
            continue; // a mean of numbers of regions means nothing
        TETLOD_TRY(cell_average(mesh, f, error));
        report->averaged_fields++;
    }
    while (options->cell_data == CELL_DATA_DROP && mesh->cell_field_count)
        point_field_fini(&mesh->cell_fields[--mesh->cell_field_count]);
    return TETLOD_OK;
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
    TETLOD_TRY(tetmesh_drop_unused(mesh, error)); // often they are those that have no value
    mesh->unused_points -= mesh->unused_points < report->welded_points ? mesh->unused_points : report->welded_points;
    TETLOD_TRY(treat_cell_data(mesh, options, report, error));
    report->nan_cells = count_nan_cells(mesh);
    if (options->nan_fill)
        TETLOD_TRY(nan_fill(mesh, options->nan_fill, &report->nan_filled, error));
    return tetmesh_validate_values(mesh, error);
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
    TETLOD_TRY_DONE(blocks_merge(&blocks, options->welds ? options->weld : -1, &block, report, error));
    if (block.mesh.vertex_count == 0) {
        status = tetlodi_fail(error, TETLOD_ERR_MESH, "there is no point in it");
        goto done;
    }
    TETLOD_TRY_DONE(block_split(&block, options->subdivide, out, report, error));
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

/* Whether `path` is in the folder of `base`, whatever links are on the way. */
static bool is_beside(const char *base, const char *path)
{
    char *folder = realpath(base, NULL), *file = realpath(path, NULL);
    char *slash = folder ? strrchr(folder, '/') : NULL;
    bool beside = slash && file && strncmp(folder, file, (size_t)(slash - folder) + 1) == 0;
    free(folder);
    free(file);
    return beside;
}

bool sniff_holds(const unsigned char *bytes, size_t size, const char *word)
{
    size_t length = strlen(word);
    for (const unsigned char *at = bytes, *end = bytes + size; (size_t)(end - at) >= length; at++) {
        at = memchr(at, *word, (size_t)(end - at) - length + 1);
        if (!at)
            return false;
        if (memcmp(at, word, length) == 0)
            return true;
    }
    return false;
}

enum tetlod_status io_resolve(const struct io_input *from, const char *name, char **out, struct tetlod_error *error)
{
    const char *slash = from->path && *name != '/' ? strrchr(from->path, '/') : NULL;
    size_t folder = slash ? (size_t)(slash - from->path) + 1 : 0, size = folder + strlen(name) + 1;
    if (!from->path)
        return tetlodi_fail(error, TETLOD_ERR_MESH, "names the file %.80s, but is not in a folder", name);
    *out = array_new(size, 1);
    if (!*out)
        return tetlodi_fail_nomem(error, "a file's name", size);
    snprintf(*out, size, "%.*s%s", (int)folder, from->path, name);
    char *real = realpath(*out, NULL);
    bool is_there = real != NULL;
    free(real);
    if (from->options && from->options->output && file_same(*out, from->options->output)) {
        free(*out);
        *out = NULL;
        return tetlodi_fail(error, TETLOD_ERR_ARGUMENT, "names the file %.80s, which is the output, too: give the output another name", name);
    }
    if (!is_there || (from->options && from->options->follow) || is_beside(from->path, *out))
        return TETLOD_OK; // opening it says why it is not there
    free(*out);
    *out = NULL;
    return tetlodi_fail(error, TETLOD_ERR_MESH, "names the file %.80s, which is not in its folder; --follow reads it anyway",
                        name);
}

/* What an input is read from. */
struct loaded {
    struct file_input file;
    struct file_view view;
};

static void close_input(struct loaded *loaded)
{
    file_input_close(&loaded->file);
    file_view_close(&loaded->view);
}

/* A file's bytes. To be closed also after a failure. */
static enum tetlod_status open_input(struct loaded *loaded, struct io_input *input, const char *path, struct tetlod_error *error)
{
    *loaded = (struct loaded){.file = {-1, 0}};
    TETLOD_TRY(file_input_open(&loaded->file, path, error));
    TETLOD_TRY(file_view_open(&loaded->view, &loaded->file, path, error));
    input->file = &loaded->file;
    input->view = &loaded->view;
    input->bytes = loaded->view.bytes;
    input->size = loaded->view.size;
    return TETLOD_OK;
}

enum tetlod_status io_read_named(struct blocks *out, const struct io_input *from, const char *name,
                                 struct io_report *report, struct tetlod_error *error)
{
    enum { DEEPEST = 8 };
    char *path = NULL;
    struct loaded loaded;
    struct tetlod_error inner = {.offset = UINT64_MAX};
    struct io_input input = {.options = from->options, .depth = from->depth + 1};
    if (from->depth == DEEPEST)
        return tetlodi_fail(error, TETLOD_ERR_MESH, "files name one another more than %d times over", DEEPEST);
    TETLOD_TRY(io_resolve(from, name, &path, error));
    enum tetlod_status status = open_input(&loaded, &input, path, &inner);
    if (status == TETLOD_OK) {
        input.path = path;
        status = read_blocks(out, path, &input, report, &inner);
    }
    if (status != TETLOD_OK)
        tetlodi_fail(error, status, "%.80s: %.200s", name, inner.message);
    close_input(&loaded);
    free(path);
    return status;
}

static enum tetlod_status read_files(struct tetmesh *out, const char *path, const char *second,
                                     const struct io_read_options *options, struct io_report *report,
                                     struct tetlod_error *error)
{
    struct io_input input = {.other_path = second, .path = path, .options = options};
    struct loaded loaded;
    struct file_view other = {0};
    struct tetlod_error inner = {.offset = UINT64_MAX};
    enum tetlod_status status = open_input(&loaded, &input, path, error);
    if (status == TETLOD_OK && second)
        status = file_view_path(&other, second, error);
    if (status == TETLOD_OK) {
        input.other = other.bytes;
        input.other_size = other.size;
        input.other_view = second ? &other : NULL;
        status = io_read_input(out, path, &input, report, &inner);
        if (status != TETLOD_OK)
            tetlodi_fail(error, status, "%.120s: %s", path, inner.message);
    }
    close_input(&loaded);
    file_view_close(&other);
    return status;
}

enum tetlod_status io_read(struct tetmesh *out, const char *path, const struct io_read_options *options,
                           struct io_report *report, struct tetlod_error *error)
{
    struct io_report unasked;
    const char *solution = options ? options->solution : NULL;
    const struct format *format = by_extension(path);
    char *names[2] = {NULL, NULL};
    enum tetlod_status status = TETLOD_OK;
    report = report ? report : &unasked;
    *report = (struct io_report){0};
    *out = (struct tetmesh){0};
    if (!format || format->files != SIBLING)
        status = read_files(out, path, solution, options, report, error);
    else if (solution)
        status = tetlodi_fail(error, TETLOD_ERR_MESH, "%.120s: is a %s file; only PLOT3D and Medit have a solution file",
                              path, format->name);
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
                        "%.120s: the extension of an output decides its format: use one of %s", path, known);
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
