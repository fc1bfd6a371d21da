/* SPDX-License-Identifier: BSD-3-Clause */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>
#include <unistd.h>

#include "format/write/prefix.h"
#include "format/fail.h"
#include "src/cli/cli.h"
#include "src/cli/extract_region.h"
#include "src/cli/extract_step.h"
#include "src/cli/probe.h"
#include "src/cli/scratch_memory.h"
#include "src/cli/step_option.h"
#include "src/io/io.h"
#include "src/stream/level_mesh.h"
#include "src/stream/page_region.h"
#include "src/stream/selection.h"
#include "src/util/file.h"
#include "src/util/number_text.h"
#include "src/util/parallel.h"

static const char help[] =
    "usage: tetlod extract FILE.tetlod|URL -o OUT [--box BOX]...\n"
    "                      [--error E | --abs-error E | --level K | --tets N | --bytes N]\n"
    "\n"
    "Writes one level of a stream as a mesh file, in the format that OUT's extension names. Without a\n"
    "choice: the finest, which is the original mesh. With OUT.tetlod: a stream of the levels up to that\n"
    "one.\n"
    "\n"
    "  -o, --output OUT   the file to write\n"
    "      --error E      the coarsest level within this error, a fraction of the range: 0.01 or 1%\n"
    "      --abs-error E  the same in the field's units; of several fields, each in its own\n"
    "      --field NAME   the field that the error is about (default: every field that the stream\n"
    "                     controls)\n"
    "      --measure M    the measure: max (default, certified), sampled, rms, predicted\n"
    "      --level K      this level; 0 is the coarsest\n"
    "      --tets N       the finest level of at most N tetrahedra\n"
    "      --bytes N      the finest level whose prefix has at most N bytes; K, M, G may follow\n"
    "      --box X0,Y0,Z0,X1,Y1,Z1  finer in this box, up to --box-error: every tetrahedron of that finer\n"
    "                     level that meets the box is there as it is; in the transition around it no\n"
    "                     error is certified, it is measured. Up to 16 times. A cell field, Region, tells\n"
    "                     the parts: 0 the coarse level, 1 the fine one, 2 the transition; one of that\n"
    "                     name in the stream is left out. A local bound (build --local-bound) holds in\n"
    "                     all three. Where the finer level is in pages (build --paged), only the pages of\n"
    "                     the boxes are read, and the transition has an error that is certified, too:\n"
    "                     that of its coarsest level. The level outside is then the last before pages, or\n"
    "                     a finer one\n"
    "      --box-error E  the error in the boxes, as of --error or --abs-error. The default is the finest\n"
    "                     level; of a stream in pages the finest in pages, where values may be rounded\n"
    "                     (0 makes them exact, which needs the whole stream)\n"
    "      --time T       in a series the step whose time is nearest to T, in its coarsest form within\n"
    "                     --error or --abs-error: a fraction of the range over all steps. Without an\n"
    "                     error it is exact. Fields without steps are left out, at\n"
    "                     points and of cells. A time more than half a step outside is refused\n"
    "      --step N       the same for the step with this number, from 0\n"
    "      --original-order  the finest level in the input's own numbering, if tetlod build --keep-order\n"
    "                        kept it\n"
    "      --cells C      original: the finest level with the cells of the input, hexahedra as hexahedra,\n"
    "                     with their points, order and values, if tetlod build --keep-order kept them,\n"
    "                     in .vtu, .vtk and .vtkhdf. tetrahedra (default): those of the level\n"
    "      --points P     the values at points instead of the level's mesh, as .csv or .vtp: P is a file\n"
    "                     with x,y,z in each line, or the points themselves: 0,0,0;1,0.5,0. Outside of\n"
    "                     the mesh values are empty (.csv) or NaN (.vtp), and the column 'inside' is 0\n"
    "      --memory BYTES how much memory to take; K, M, G may follow: large arrays are in temporary\n"
    "                     files then. The bytes that are written are the same\n"
    "      --scratch DIR  the folder of temporary files (default: TMPDIR, else /tmp)\n"
    "      --quiet        do not say which level it is, and what error each field has there at most\n"
    "\n"
    "If a file is cut off, such as a download that stopped, the levels that are whole can still be\n"
    "extracted. Values of cells lie behind the levels: those of which bytes are missing are left out. A\n"
    "box needs the finest level, or its pages. Of a URL, on any host that answers Range requests, only\n"
    "the bytes that are needed are fetched.\n"
    "\n"
    "example: tetlod extract blunt.tetlod --error 1% -o coarse.vtu\n";

struct request {
    const char *input, *output, *field, *points, *scratch;
    uint64_t memory; /* 0: as much as it takes */
    struct selection selection;
    enum level_form form;
    bool quiet;
    struct step_option step;
    struct probes probes; /* read from `points` */
};

static const char *form_option(const struct request *request)
{
    return request->form == FORM_CELLS ? "--cells original" : "--original-order";
}

static enum tetlod_status find_field(const struct tetlod_info *info, const char *name, uint32_t *out,
                                     struct tetlod_error *error)
{
    *out = TETLOD_NONE;
    if (!name)
        return TETLOD_OK;
    *out = tetlod_field_index(info, name);
    if (*out != TETLOD_NONE)
        return TETLOD_OK;
    char names[160] = "";
    for (uint32_t f = 0, used = 0; f < info->field_count && used < sizeof names; f++)
        used += (uint32_t)snprintf(names + used, sizeof names - used, "%s%s", f ? ", " : "", info->fields[f].name);
    return tetlodi_fail(error, TETLOD_ERR_FIELD, "it has no field '%.60s'; it has %s", name, names);
}

/* Why no level is within an error. */
static enum tetlod_status fail_error(const struct tetlod_info *info, const struct selection *selection, double wanted,
                                     struct tetlod_error *error)
{
    uint32_t finest = info->level_count - 1, field = selection->field;
    for (uint32_t f = 0; f < info->field_count; f++)
        if ((field == TETLOD_NONE ? info->fields[f].controlled : f == field) &&
            isnan(info->levels[finest].errors[f * TETLOD_MEASURES + (uint32_t)selection->measure]))
            return tetlodi_fail(error, TETLOD_ERR_ARGUMENT,
                                "its index has no '%s' error of %.60s; take --measure sampled or rms, or a field that "
                                "it "
                                "controls",
                                tetlod_measure_name(selection->measure), info->fields[f].name);
    return tetlodi_fail(error, TETLOD_ERR_ARGUMENT, "none of its levels is within an error of %g", wanted);
}

static enum tetlod_status choose(const struct tetlod_info *info, const struct selection *selection, uint32_t *out,
                                 struct tetlod_error *error)
{
    *out = selection_level(info, selection);
    if (*out != TETLOD_NONE)
        return TETLOD_OK;
    if (selection->kind != TAKE_LEVEL)
        return fail_error(info, selection, selection->error, error);
    return tetlodi_fail(error, TETLOD_ERR_ARGUMENT, "it has no level %llu; its finest is %u",
                        (unsigned long long)selection->count, info->level_count - 1);
}

/* Of a file that is cut off: the finest level that is there, or a refusal that says what is there. */
static enum tetlod_status choose_here(const struct tetlod_info *info, uint32_t here, const struct request *request,
                                      uint32_t *level,
                                      struct tetlod_error *error)
{
    const struct selection *selection = &request->selection;
    TETLOD_TRY(choose(info, selection, level, error));
    if (selection->box_count && !page_region_is(info, selection_box_level(info, selection)) && here != TETLOD_NONE &&
        here + 1 < info->level_count)
        return tetlodi_fail(error, TETLOD_ERR_TRUNCATED,
                            "it is cut off: levels 0 to %u of %u are here, and --box needs the finest, "
                            "against which it measures", here, info->level_count - 1);
    if (here != TETLOD_NONE && *level <= here)
        return TETLOD_OK;
    if (here == TETLOD_NONE)
        return tetlodi_fail(error, TETLOD_ERR_TRUNCATED, "it is cut off before the end of level 0");
    if (request->form != FORM_STREAM)
        return tetlodi_fail(error, TETLOD_ERR_TRUNCATED,
                            "it is cut off: levels 0 to %u of %u are here, and %s needs the finest", here,
                            info->level_count - 1, form_option(request));
    if (request->selection.kind != TAKE_FINEST)
        return tetlodi_fail(error, TETLOD_ERR_TRUNCATED, "it is cut off: levels 0 to %u of %u are here, not level %u",
                            here, info->level_count - 1, *level);
    fprintf(stderr, "tetlod extract: %s is cut off: levels 0 to %u of %u are here\n", request->input, here,
            info->level_count - 1);
    *level = here;
    return TETLOD_OK;
}

/* Of a file that is cut off: the values of cells that the output is without. */
static void note_missing_cells(const struct tetlod_info *info, int fd, const char *path)
{
    const char *before = "";
    for (uint32_t f = 0; f < info->cell_field_count; f++) {
        if (fd < 0 || cli_cells_here(info, fd, f)) // a host has all
            continue;
        if (!*before)
            fprintf(stderr, "tetlod extract: %s is cut off before the values of cells ", path);
        fprintf(stderr, "%s%s", before, info->cell_fields[f].name);
        before = ", ";
    }
    if (*before)
        fprintf(stderr, ": they are left out\n");
}

/* The bytes of the levels up to one, which may be on a host. */
static enum tetlod_status fetch_levels(const struct stream_input *input, uint32_t level, struct tetlod_error *error)
{
    const struct tetlod_span prefix = {0, tetlod_info(input->file)->levels[level].end};
    return stream_input_fetch(input, &prefix, 1, error);
}

/* The levels up to one, as a stream. */
static enum tetlod_status extract_stream(const struct stream_input *input, const struct request *request,
                                         uint32_t level, struct tetlod_error *error)
{
    struct file_output *output;
    struct tetlod_error inner = {0};
    TETLOD_TRY(file_output_open(&output, request->output, error));
    const struct tetlodi_sink sink = file_output_sink(output);
    enum tetlod_status status = fetch_levels(input, level, &inner);
    if (status == TETLOD_OK)
        status = tetlodi_write_prefix(input->file, level, &sink, &inner);
    if (status != TETLOD_OK)
        stream_input_fail(input, request->input, status, &inner, error);
    return file_output_finish(output, status, error);
}

/* A level, or what is finer in boxes where they ask for a finer one: then `about` says what is promised of it. */
static enum tetlod_status extract_boxes(const struct stream_input *input, const struct request *request,
                                        struct tetmesh *mesh, uint32_t level, char *about, size_t about_size,
                                        struct tetlod_error *error)
{
    const struct selection *selection = &request->selection;
    const struct tetlod_info *info = tetlod_info(input->file);
    struct region region = {.coarse = level, .boxes = selection->boxes, .box_count = selection->box_count};
    region.fine = selection_box_level(info, selection);
    if (region.fine == TETLOD_NONE)
        return fail_error(info, selection, selection->box_error, error);
    if (region.fine <= level)
        return TETLOD_MORE;
    return extract_region(input, &region, mesh, about, about_size, error);
}

static enum tetlod_status extract_mesh(const struct stream_input *input, const struct request *request,
                                       struct tetmesh *mesh, uint32_t level, char *about, size_t about_size,
                                       struct tetlod_error *error)
{
    struct tetlod_file *file = input->file;
    const struct tetlod_info *info = tetlod_info(file);
    struct tetlod_cursor *cursor;
    if (request->step.given)
        return extract_step(file, &request->step.selection, request->form, mesh, about, about_size, error);
    if (request->selection.box_count) {
        enum tetlod_status made = extract_boxes(input, request, mesh, level, about, about_size, error);
        if (made != TETLOD_MORE) // the boxes' level is no finer
            return made;
    }
    TETLOD_TRY(fetch_levels(input, level, error));
    TETLOD_TRY(tetlod_cursor_new(&cursor, file, NULL, 0, error));
    enum tetlod_status status = tetlod_cursor_seek(cursor, level, error);
    if (status == TETLOD_OK)
        status = level_mesh_take(info, &cursor, mesh, error);
    if (status == TETLOD_OK)
        status = level_mesh_cells_here(file, NULL, NULL, mesh, error);
    if (status == TETLOD_OK)
        status = level_mesh_form(file, request->form, false, mesh, error);
    tetlod_cursor_free(cursor);
    return status;
}

static bool is_stream(const char *path)
{
    size_t length = strlen(path), ending = sizeof ".tetlod" - 1;
    return length > ending && strcasecmp(path + length - ending, ".tetlod") == 0;
}

/* What the user is told of a level that was written. */
static void print_level(const struct tetlod_info *info, uint32_t level, const struct tetmesh *mesh)
{
    fprintf(stderr, "tetlod extract: level %u of 0..%u, %llu vertices, %llu tetrahedra\n", level,
            info->level_count - 1, (unsigned long long)info->levels[level].vertices,
            (unsigned long long)info->levels[level].tets);
    if (mesh->cells)
        fprintf(stderr, "tetlod extract: the %u cells and %u points of the input%s\n", mesh->tet_count,
                mesh->vertex_count, info->lossless ? "" : "; the stream's points and values are rounded");
    cli_print_promises(stderr, info, level);
    cli_warn_uncontrolled("extract", info, level);
    if (info->topology_count)
        fprintf(stderr, "tetlod extract: it is the mesh of the first %u steps; --step and --time take others, on "
                        "their own\n",
                info->topologies[0].step_count);
}

/* To the output, from an open stream. */
static enum tetlod_status extract_from(const struct stream_input *input, struct request *request,
                                       struct tetlod_error *error)
{
    const struct tetlod_info *info = tetlod_info(input->file);
    struct tetlod_error inner = {0};
    struct tetmesh mesh = {0};
    char about[1024] = "";
    uint32_t level = 0;
    enum tetlod_status status = find_field(info, request->field, &request->selection.field, &inner);
    if (status == TETLOD_OK && !request->step.given)
        status = choose_here(info, input->finest, request, &level, &inner);
    if (status == TETLOD_OK && !is_stream(request->output))
        status = extract_mesh(input, request, &mesh, level, about, sizeof about, &inner);
    if (status == TETLOD_OK)
        status = level_mesh_units(info, &mesh, &inner);
    if (status != TETLOD_OK)
        stream_input_fail(input, request->input, status, &inner, error);
    else if (request->points)
        status = probes_write(&request->probes, &mesh, request->output, error);
    else
        status = is_stream(request->output) ? extract_stream(input, request, level, error)
                                            : io_write(&mesh, request->output, error);
    if (status == TETLOD_OK && !request->quiet) {
        if (about[0])
            fprintf(stderr, "tetlod extract: %u vertices, %u %s: %s\n", mesh.vertex_count, mesh.tet_count,
                    mesh.cells ? "cells" : "tetrahedra", about);
        else
            print_level(info, level, &mesh);
        note_missing_cells(info, input->fd, request->input);
    }
    tetmesh_fini(&mesh);
    return status;
}

static int extract(struct request *request)
{
    struct tetlod_error error = {0}, inner = {0};
    struct stream_input input = {.fd = -1};
    if (!is_stream(request->output) && !request->points && io_check_output(request->output, &error) != TETLOD_OK)
        return cli_fail(&error);
    if (request->form == FORM_CELLS && io_check_cells_output(request->output, &error) != TETLOD_OK)
        return cli_fail(&error);
    enum tetlod_status status = scratch_memory_take(request->scratch, request->memory, &error);
    if (status == TETLOD_OK && request->points)
        status = probes_read(&request->probes, request->points, &error);
    if (status == TETLOD_OK)
        status = stream_input_open(&input, request->input, parallel_cores(), &error);
    if (status == TETLOD_OK)
        status = extract_from(&input, request, &error);
    stream_input_close(&input);
    probes_fini(&request->probes);
    if (status == TETLOD_ERR_NOMEM && scratch_memory_failure(&inner) != TETLOD_OK)
        error = inner;
    return status == TETLOD_OK ? EXIT_DONE : cli_fail(&error);
}

static bool parse_box(struct selection *selection, const char *value)
{
    if (selection->box_count < MAX_BOXES &&
        selection_read_box(value, strlen(value), &selection->boxes[selection->box_count++]))
        return true;
    cli_usage("extract", "--box takes x0,y0,z0,x1,y1,z1, the least corner first, at most %d times, not '%s'",
              MAX_BOXES, value);
    return false;
}

/* What does not go with a step. */
static const char *against_step(const struct request *request)
{
    if (request->selection.kind != TAKE_FINEST && request->selection.kind != TAKE_ERROR &&
        request->selection.kind != TAKE_ABS_ERROR)
        return "--level, --tets or --bytes: a step is there within errors; take --error";
    if (request->selection.box_count)
        return "--box";
    if (request->field || request->selection.measure != TETLOD_MAX)
        return "--field or --measure: its error is certified for every field";
    return is_stream(request->output) ? "a stream as output: it holds all steps" : NULL;
}

static bool parse_cells(struct request *request, const char *value)
{
    if (strcmp(value, "original") == 0)
        request->form = FORM_CELLS;
    else if (strcmp(value, "tetrahedra") != 0)
        cli_usage("extract", "--cells takes original or tetrahedra, not '%s'", value);
    return strcmp(value, "original") == 0 || strcmp(value, "tetrahedra") == 0;
}

static bool parse_choice(struct selection *selection, int option, const char *name, const char *value)
{
    static const struct {
        int option;
        enum selection_kind kind;
    } kinds[] = {{'e', TAKE_ERROR}, {'a', TAKE_ABS_ERROR}, {'k', TAKE_LEVEL}, {'t', TAKE_TETS}, {'b', TAKE_BYTES}};
    if (selection->kind != TAKE_FINEST) {
        cli_usage("extract", "--%s: one of --error, --abs-error, --level, --tets, --bytes is enough", name);
        return false;
    }
    for (size_t i = 0; i < sizeof kinds / sizeof *kinds; i++)
        if (kinds[i].option == option)
            selection->kind = kinds[i].kind;
    if (selection->kind == TAKE_ERROR)
        return cli_parse_fraction(&command_extract, name, value, &selection->error);
    if (selection->kind == TAKE_ABS_ERROR)
        return cli_parse_number(&command_extract, name, value, 0, &selection->error);
    return cli_parse_count(&command_extract, name, value, 0, selection->kind == TAKE_BYTES ? UINT64_MAX : UINT32_MAX,
                           &selection->count);
}

static int run(int argc, char **argv)
{
    static const struct option options[] = {
        {"output", required_argument, NULL, 'o'},    {"error", required_argument, NULL, 'e'},
        {"abs-error", required_argument, NULL, 'a'}, {"level", required_argument, NULL, 'k'},
        {"tets", required_argument, NULL, 't'},      {"bytes", required_argument, NULL, 'b'},
        {"field", required_argument, NULL, 'f'},     {"measure", required_argument, NULL, 'm'},
        {"box", required_argument, NULL, 'B'},       {"box-error", required_argument, NULL, 'E'},
        {"quiet", no_argument, NULL, 'q'},           {"original-order", no_argument, NULL, 'O'},
        {"time", required_argument, NULL, 'T'},      {"step", required_argument, NULL, 'S'},
        {"cells", required_argument, NULL, 'C'},     {"points", required_argument, NULL, 'P'},
        {"memory", required_argument, NULL, 'M'},    {"scratch", required_argument, NULL, 'D'},      {0}};
    static const char *const names[] = {['e'] = "error", ['a'] = "abs-error", ['k'] = "level", ['t'] = "tets",
                                        ['b'] = "bytes"};
    struct request request = {.selection.measure = TETLOD_MAX};
    struct selection *selection = &request.selection;
    const char *box_error = NULL;
    for (int option; (option = cli_option(&command_extract, argc, argv, "o:", options)) != -1;) {
        bool good = option != '?';
        if (option == 'o')
            request.output = optarg;
        else if (option == 'f')
            request.field = optarg;
        else if (option == 'q')
            request.quiet = true;
        else if (option == 'T' || option == 'S')
            good = step_option_take(&request.step, &command_extract, option == 'T', optarg);
        else if (option == 'B')
            good = parse_box(selection, optarg);
        else if (option == 'E')
            box_error = optarg;
        else if (option == 'O')
            request.form = request.form == FORM_CELLS ? FORM_CELLS : FORM_ORDER;
        else if (option == 'P')
            request.points = optarg;
        else if (option == 'D')
            request.scratch = optarg;
        else if (option == 'M')
            good = cli_parse_count(&command_extract, "memory", optarg, 1, UINT64_MAX, &request.memory);
        else if (option == 'C')
            good = parse_cells(&request, optarg);
        else if (option == 'm')
            good = cli_parse_measure(&command_extract, optarg, &selection->measure);
        else if (good)
            good = parse_choice(selection, option, names[option], optarg);
        if (!good)
            return EXIT_USAGE;
    }
    if (!cli_operands(&command_extract, argc, 1, "the stream"))
        return EXIT_USAGE;
    if (!request.output)
        return cli_usage("extract", "-o OUT is missing");
    bool absolute = selection->kind == TAKE_ABS_ERROR;
    if (box_error && !(absolute ? cli_parse_number(&command_extract, "box-error", box_error, 0, &selection->box_error)
                                : cli_parse_fraction(&command_extract, "box-error", box_error, &selection->box_error)))
        return EXIT_USAGE;
    selection->box_finest = !box_error;
    if (box_error && !selection->box_count)
        return cli_usage("extract", "--box-error needs a --box");
    if (request.form != FORM_STREAM && selection->box_count)
        return cli_usage("extract", "%s does not go with --box: it is for the finest level", form_option(&request));
    if (selection->box_count && selection->kind == TAKE_FINEST)
        return cli_usage("extract", "--box needs to know what is outside of it: --error or another choice of a level");
    if (request.points && !probe_is_output(request.output))
        return cli_usage("extract", "--points writes .csv or .vtp, not '%s'", request.output);
    if (request.points && request.form != FORM_STREAM)
        return cli_usage("extract", "%s does not go with --points: their values have the order of the points",
                         form_option(&request));
    if (request.form == FORM_ORDER && selection->kind != TAKE_FINEST)
        return cli_usage("extract", "--original-order is for the finest level: leave out the choice of one, such "
                                    "as --error or --level");
    if (request.step.given && against_step(&request))
        return cli_usage("extract", "--time and --step do not go with %s", against_step(&request));
    request.step.selection.error = selection->kind == TAKE_FINEST ? 0 : selection->error;
    request.step.selection.absolute = absolute;
    request.input = argv[optind];
    if (selection->box_count && is_stream(request.output))
        return cli_usage("extract", "--box is for a mesh file; a stream has levels that are the same everywhere");
    if (request.form != FORM_STREAM && is_stream(request.output))
        return cli_usage("extract", "%s is for a mesh file; a stream keeps the order that it has",
                         form_option(&request));
    int result = cli_check_output(&command_extract, request.output, NULL, &request.input, 1);
    return result == EXIT_DONE ? extract(&request) : result;
}

const struct command command_extract = {"extract", "one level as a mesh file", help, run};
