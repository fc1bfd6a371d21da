/* SPDX-License-Identifier: BSD-3-Clause */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

#include "format/fail.h"
#include "src/ask/quadrature.h"
#include "src/cli/cli.h"
#include "src/cli/stream_input.h"
#include "src/io/io.h"
#include "src/stream/level_mesh.h"
#include "src/stream/selection.h"
#include "src/util/array.h"
#include "src/util/file.h"
#include "src/util/parallel.h"

static const char help[] =
    "usage: tetlod sample-points FILE.tetlod|URL --count N -o OUT.npz\n"
    "                            [--error E | --level K] [--box BOX] [--seed S]\n"
    "\n"
    "Writes random points of a level with its values and weights, as arrays for numpy: 'points' (N x 3),\n"
    "'weights' (N) and 'values/NAME' of each field. Points are uniform, and spread evenly over the\n"
    "volume. Sums of weights, and of weights and values, are the volume and the integrals of the\n"
    "level, for every component, to rounding: sums over the points may stand for\n"
    "integrals, as when a network is trained.\n"
    "\n"
    "  -o, --output OUT.npz  the file to write\n"
    "      --count N         how many points; more than there are components\n"
    "      --error E         the coarsest level within this error, a fraction of the range: 0.01 or 1%\n"
    "                        (default: the finest level)\n"
    "      --level K         this level; 0 is the coarsest\n"
    "      --box X0,Y0,Z0,X1,Y1,Z1  points in this box alone; volume and integrals are those there\n"
    "      --seed S          other points (default 0); the same seed gives the same bytes\n"
    "\n"
    "example: tetlod sample-points blunt.tetlod --error 1% --count 10000 -o points.npz\n";

struct request {
    const char *input, *output;
    struct selection selection;
    uint64_t count, seed;
};

static enum tetlod_status read_level(const struct request *request, struct stream_input *input, struct tetmesh *mesh,
                                     uint32_t *level, struct tetlod_error *error)
{
    const struct tetlod_info *info = tetlod_info(input->file);
    struct tetlod_cursor *cursor;
    *level = selection_level(info, &request->selection);
    if (*level == TETLOD_NONE)
        return tetlodi_fail(error, TETLOD_ERR_ARGUMENT, "it has no such level; 'tetlod info' lists its levels");
    TETLOD_TRY(tetlod_cursor_new(&cursor, input->file, NULL, 0, error));
    enum tetlod_status status = tetlod_cursor_seek(cursor, *level, error);
    if (status == TETLOD_OK)
        status = level_mesh_take(info, &cursor, mesh, error);
    tetlod_cursor_free(cursor);
    return status;
}

/* ---- the file */

static char *name_of(const char *field)
{
    const size_t size = strlen(field) + sizeof "values/";
    char *name = array_new(size, 1);
    if (name)
        snprintf(name, size, "values/%s", field);
    for (char *c = name ? name + sizeof "values/" - 1 : NULL; c && *c; c++)
        *c = *c == '/' || *c == '\\' ? '_' : *c;
    return name;
}

/* A field's name and values, which an array of the file borrows. */
struct owned {
    char *name;
    double *values;
};

static enum tetlod_status take_values(const struct quadrature *points, const struct tetmesh *mesh,
                                      const struct point_field *field, struct owned *owned, struct npz_array *out,
                                      struct tetlod_error *error)
{
    owned->values = array_new(points->count, field->components * sizeof *owned->values);
    owned->name = name_of(field->name);
    if (!owned->values || !owned->name)
        return tetlodi_fail_nomem(error, "the values", points->count * (uint64_t)field->components * 8);
    for (size_t i = 0; i < points->count; i++)
        for (uint32_t c = 0; c < field->components; c++)
            owned->values[i * field->components + c] = quadrature_value(points, mesh, field, c, i);
    *out = (struct npz_array){owned->name, points->count, field->components, owned->values};
    return TETLOD_OK;
}

static enum tetlod_status write_arrays(const char *path, const struct npz_array *arrays, size_t count,
                                       struct tetlod_error *error)
{
    struct file_output *output;
    TETLOD_TRY(file_output_open(&output, path, error));
    const struct tetlodi_sink sink = file_output_sink(output);
    return file_output_finish(output, npz_write(arrays, count, &sink, error), error);
}

static enum tetlod_status write_points(const struct quadrature *points, const struct tetmesh *mesh, const char *path,
                                       struct tetlod_error *error)
{
    enum { FIRST = 2 };
    const uint32_t fields = mesh->field_count;
    struct npz_array *arrays = array_zero(FIRST + (size_t)fields, sizeof *arrays);
    struct owned *owned = array_zero(fields, sizeof *owned);
    enum tetlod_status status = arrays && owned ? TETLOD_OK : tetlodi_fail_nomem(error, "the arrays", fields);
    for (uint32_t f = 0; status == TETLOD_OK && f < fields; f++)
        status = take_values(points, mesh, &mesh->fields[f], &owned[f], &arrays[FIRST + f], error);
    if (status == TETLOD_OK) {
        arrays[0] = (struct npz_array){"points", points->count, 3, points->points};
        arrays[1] = (struct npz_array){"weights", points->count, 1, points->weights};
        status = write_arrays(path, arrays, FIRST + (size_t)fields, error);
    }
    for (uint32_t f = 0; owned && f < fields; f++) {
        free(owned[f].name);
        free(owned[f].values);
    }
    free(owned);
    free(arrays);
    return status;
}

static int sample_points(const struct request *request)
{
    struct tetlod_error error = {0}, inner = {0};
    struct stream_input input;
    struct tetmesh mesh = {0};
    struct quadrature points = {0};
    uint32_t level = 0;
    double box[6];
    for (int i = 0; i < 3; i++) {
        box[i] = request->selection.boxes[0].low[i];
        box[3 + i] = request->selection.boxes[0].high[i];
    }
    enum tetlod_status status = stream_input_open(&input, request->input, parallel_cores(), &error);
    if (status == TETLOD_OK) {
        status = read_level(request, &input, &mesh, &level, &inner);
        if (status == TETLOD_OK)
            status = quadrature_make(&points, &mesh, request->selection.box_count ? box : NULL,
                                     (size_t)request->count, request->seed, &inner);
        if (status != TETLOD_OK)
            status = stream_input_fail(&input, request->input, status, &inner, &error);
    }
    if (status == TETLOD_OK)
        status = write_points(&points, &mesh, request->output, &error);
    if (status == TETLOD_OK)
        fprintf(stderr, "tetlod sample-points: level %u, %u tetrahedra, volume %.9g%s\n", level, mesh.tet_count,
                points.volume, points.has_negative ? "; some weights are negative: more points need no such ones" : "");
    quadrature_fini(&points);
    tetmesh_fini(&mesh);
    stream_input_close(&input);
    return status == TETLOD_OK ? EXIT_DONE : cli_fail(&error);
}

static bool take_option(struct request *request, int option, const char *value)
{
    struct selection *selection = &request->selection;
    if (option == 'e' || option == 'k') {
        selection->kind = option == 'e' ? TAKE_ERROR : TAKE_LEVEL;
        return option == 'e' ? cli_parse_fraction(&command_sample_points, "error", value, &selection->error)
                             : cli_parse_count(&command_sample_points, "level", value, 0, UINT32_MAX,
                                               &selection->count);
    }
    if (option == 'n')
        return cli_parse_count(&command_sample_points, "count", value, 1, UINT32_MAX, &request->count);
    if (option == 's')
        return cli_parse_count(&command_sample_points, "seed", value, 0, UINT32_MAX, &request->seed);
    if (option == 'B' && !selection->box_count &&
        selection_read_box(value, strlen(value), &selection->boxes[selection->box_count++]))
        return true;
    if (option == 'B')
        cli_usage("sample-points", "--box takes x0,y0,z0,x1,y1,z1, the least corner first, once, not '%s'", value);
    request->output = option == 'o' ? value : request->output;
    return option == 'o';
}

static int run(int argc, char **argv)
{
    static const struct option options[] = {
        {"output", required_argument, NULL, 'o'}, {"error", required_argument, NULL, 'e'},
        {"level", required_argument, NULL, 'k'},  {"count", required_argument, NULL, 'n'},
        {"seed", required_argument, NULL, 's'},   {"box", required_argument, NULL, 'B'},
        {0}};
    struct request request = {.selection = {.field = TETLOD_NONE, .measure = TETLOD_MAX}};
    for (int option; (option = cli_option(&command_sample_points, argc, argv, "o:", options)) != -1;)
        if (!take_option(&request, option, optarg))
            return EXIT_USAGE;
    if (!cli_operands(&command_sample_points, argc, 1, "the stream"))
        return EXIT_USAGE;
    request.input = argv[optind];
    if (!request.output || !request.count)
        return cli_usage("sample-points", "%s is missing", request.output ? "--count N" : "-o OUT.npz");
    int result = cli_check_output(&command_sample_points, request.output, "npz", &request.input, 1);
    return result == EXIT_DONE ? sample_points(&request) : result;
}

const struct command command_sample_points = {"sample-points", "points of a level with values and weights, for numpy",
                                              help, run};
