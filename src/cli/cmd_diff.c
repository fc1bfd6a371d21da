/* SPDX-License-Identifier: BSD-3-Clause */
#include <jansson.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "format/fail.h"
#include "src/cli/cli.h"
#include "src/cli/diff_limits.h"
#include "src/cli/print_json.h"
#include "src/cli/step_option.h"
#include "src/cli/stream_input.h"
#include "src/io/io.h"
#include "src/mesh/tet_geom.h"
#include "src/report/diff_json.h"
#include "src/util/parallel.h"

static const char help[] =
    "usage: tetlod diff A B --field NAME [--limit L] [-o OUT] [--json]\n"
    "       tetlod diff A B --limits FILE [--json]\n"
    "\n"
    "How much does a result differ from another one, on another mesh of the same domain? A and B are\n"
    "streams, mesh files, or URLs of streams. The answer is two intervals that certainly hold the largest\n"
    "difference and the root of the mean square, from the coarsest levels that decide the limit.\n"
    "\n"
    "      --field NAME   the field, which both have; NAME:0 is a component. Of a vector the largest\n"
    "                     difference is that of any component, the mean square that of its length\n"
    "  -l, --limit L      what the difference may be: in the field's units, or % of its range in A\n"
    "      --norm N       what the limit is about: max (default), the largest difference, or rms\n"
    "      --limits FILE  fields and limits, a line each: 'p 2%', 'T 0.5', 'p 0.1% rms'; '#' begins a\n"
    "                     comment, a name with blanks stands in \"quotes\"\n"
    "      --within W     without a limit: how wide the interval may be (default: 1%)\n"
    "  -o, --output OUT   write the difference as a mesh file: the first mesh, or its level, with values\n"
    "                     of its tetrahedra: 'difference', the mean of A - B; 'difference bound', which\n"
    "                     no difference in it is above; 'difference least', which one in it is not below;\n"
    "                     'covered', the share of it that B covers; 'where', 1 where the largest\n"
    "                     difference may be\n"
    "      --time T       in series the steps whose times are nearest to T; T,U: to T in A and to U in B.\n"
    "                     A mesh file with one time is taken as it is\n"
    "      --step N       the same by number, from 0; N,M. Of a mesh file with several times, too\n"
    "      --threads N    up to 64; 0 (default): all cores\n"
    "      --json         as JSON\n"
    "\n"
    "Domains that differ are compared where they overlap, and their volumes are said. Bodies that touch\n"
    "are compared each with itself. Where the boundary of a level has moved, places near it are compared\n"
    "with all that the original may have there.\n"
    "\n"
    "Exit status: 0 within, or no limit; 4 beyond the limit; 5 undecided even at the finest levels.\n"
    "\n"
    "example: tetlod diff reference.tetlod run.vtu --field p --limit 2%\n";

struct request {
    const char *places[2], *field, *limit, *limits, *within, *output;
    enum diff_norm norm;
    unsigned threads;
    bool json;
    struct step_option steps[2];
};

/* What the two operands are. */
struct operands {
    struct stream_input streams[2]; /* file NULL: a mesh */
    struct tetmesh meshes[2];       /* the whole, with all fields */
};

/* ---- reading */

static enum tetlod_status open_one(const struct request *request, int m, struct operands *operands,
                                   struct tetlod_error *error)
{
    const struct step_option *step = &request->steps[m];
    struct io_read_options options = {.any_values = true};
    struct io_report report = {0};
    char number[24];
    enum tetlod_status status = stream_input_open(&operands->streams[m], request->places[m], request->threads, error);
    if (status == TETLOD_OK || status != TETLOD_ERR_NOT_TETLOD || web_source_is(request->places[m]))
        return status;
    snprintf(number, sizeof number, "%llu", (unsigned long long)step->selection.step);
    options.time = step->given && !step->selection.by_time ? number : NULL;
    TETLOD_TRY(io_read(&operands->meshes[m], request->places[m], &options, &report, error));
    if (report.steps > 1 && step->given && step->selection.by_time)
        return tetlodi_fail(error, TETLOD_ERR_ARGUMENT, "%s: of a mesh file with several times choose one by its "
                            "number: --step", request->places[m]);
    return TETLOD_OK;
}

/* A copy of a mesh with one of its fields. */
static enum tetlod_status copy_mesh(const struct tetmesh *from, uint32_t field, struct tetmesh *out,
                                    struct tetlod_error *error)
{
    TETLOD_TRY(tetmesh_validate_field(from, field, error));
    const struct point_field *source = &from->fields[field];
    size_t positions = from->vertex_count * 3 * sizeof(double), corners = from->tet_count * 4 * sizeof(uint32_t);
    *out = (struct tetmesh){.vertex_count = from->vertex_count, .tet_count = from->tet_count,
                            .position_type = from->position_type, .positions = malloc(positions),
                            .corners = malloc(corners)};
    if (!out->positions || !out->corners)
        return tetlodi_fail_nomem(error, "a mesh", positions + corners);
    memcpy(out->positions, from->positions, positions);
    memcpy(out->corners, from->corners, corners);
    TETLOD_TRY(tetmesh_add_field(out, source->name, source->components, source->type, error));
    memcpy(out->fields[0].values, source->values,
           (size_t)from->vertex_count * source->components * sizeof *source->values);
    return TETLOD_OK;
}

static enum tetlod_status make_side(const struct request *request, struct operands *operands, int m, const char *field,
                                    struct diff_side *out, struct tetlod_error *error)
{
    const struct stream_input *stream = &operands->streams[m];
    const struct step_option *step = &request->steps[m];
    struct tetlod_error inner = {0};
    enum tetlod_status status;
    if (stream->file) {
        status = forms_init(&out->forms, stream->file, stream->finest, field,
                            step->given ? &step->selection : NULL, &inner);
        if (status == TETLOD_OK)
            status = diff_side_stream(out, &inner);
    } else {
        uint32_t number = tetmesh_find_field(&operands->meshes[m], field);
        status = number == TETLOD_NONE ? TETLOD_OK : copy_mesh(&operands->meshes[m], number, &out->mesh, &inner);
        if (status == TETLOD_OK)
            status = diff_side_mesh(out, field, &inner);
    }
    return status == TETLOD_OK ? status : stream_input_fail(stream, request->places[m], status, &inner, error);
}

/* ---- what is written */

/* `field`: one number for each tetrahedron. */
static enum tetlod_status add_cells(struct tetmesh *mesh, const char *name, double **out, struct tetlod_error *error)
{
    TETLOD_TRY(tetmesh_add_cell_field(mesh, name, 1, TETLOD_FLOAT64, mesh->tet_count, error));
    *out = mesh->cell_fields[mesh->cell_field_count - 1].values;
    return TETLOD_OK;
}

static enum tetlod_status write_difference(struct tetmesh *mesh, const struct diff_result *result, const char *path,
                                           struct tetlod_error *error)
{
    static const char *const names[] = {"difference", "difference bound", "difference least", "covered", "where"};
    double *columns[5];
    for (int i = 0; i < 5; i++)
        TETLOD_TRY(add_cells(mesh, names[i], &columns[i], error));
    for (uint32_t t = 0; t < mesh->tet_count; t++) {
        const struct difference_cell *cell = &result->difference.cells[t];
        const double *p[4];
        for (int c = 0; c < 4; c++)
            p[c] = mesh->positions + 3 * (size_t)mesh->corners[4 * (size_t)t + (size_t)c];
        double volume = fabs(tet_volume6(p[0], p[1], p[2], p[3])) / 6;
        columns[0][t] = cell->volume > 0 ? cell->integral / cell->volume : 0;
        columns[1][t] = cell->upper;
        columns[2][t] = cell->lower;
        columns[3][t] = volume > 0 ? fmin(cell->volume / volume, 1) : 0;
        columns[4][t] = cell->volume > 0 && cell->upper >= result->bounds[DIFF_MAX][0];
    }
    return io_write(mesh, path, error);
}

/* Nine digits, rounded outwards. */
static void print_interval(const char *name, const double bounds[2], const double range[2])
{
    double width = range[1] - range[0];
    printf("%-13s from %.9g to %.9g", name, bounds[0] * (1 - 5e-9), bounds[1] * (1 + 5e-9));
    if (width > 0)
        printf(", %.4g to %.4g %% of the range", 100 * bounds[0] / width, 100 * bounds[1] / width);
    printf("\n");
}

static void print_used(const char *name, const struct diff_side *side, const struct diff_result *result, int m)
{
    const char *before = "";
    printf("%-13s ", name);
    if (side->of_stream) {
        printf("level %u of 0..%u", result->used[m].level, side->forms.info->level_count - 1);
        before = ", ";
    }
    printf("%s%u tetrahedra", before, result->used[m].tets);
    if (side->of_stream)
        printf(" of %llu, %llu of %llu bytes, values within %.4g", (unsigned long long)side->forms.info->tets,
               (unsigned long long)result->used[m].bytes, (unsigned long long)side->forms.info->bytes,
               result->used[m].error);
    printf("\n");
}

static void print_overlap(const struct diff_result *result)
{
    const struct difference *found = &result->difference;
    printf("%-13s %.6g, %.4f %% of the first's volume, %.4f %% of the second's", "overlap", found->overlap,
           100 * found->overlap / found->volumes[0], 100 * found->overlap / found->volumes[1]);
    if (result->swept > 0)
        printf(", but for %.3g that boundaries have swept", result->swept);
    printf("\n");
    if (found->apart > 0)
        printf("%-13s %.3g of the volume is in bodies that are not each other's\n", "not compared", found->apart);
    if (found->left_out[0] || found->left_out[1])
        printf("%-13s %llu and %llu tetrahedra that are degenerate, inverted or folded\n", "left out",
               (unsigned long long)found->left_out[0], (unsigned long long)found->left_out[1]);
}

static void print_result(const char *field, const struct diff_side sides[2], const struct diff_options *options,
                         const struct diff_result *result)
{
    static const char *const norms[] = {"largest", "rms"};
    const double *p = result->difference.place;
    struct diff_where where;
    printf("%s: %s", diff_verdict_name(result->verdict), field);
    if (options->limited)
        printf(", %s difference, limit %.9g", norms[options->norm], options->limit);
    printf("\n");
    for (int norm = 0; norm < DIFF_NORMS; norm++)
        print_interval(norms[norm], result->bounds[norm], sides[0].range);
    diff_where(&sides[0], result, &where);
    if (result->difference.max[0] > 0)
        printf("%-13s near (%.6g, %.6g, %.6g)\n", "where", p[0], p[1], p[2]);
    if (where.tets && result->bounds[DIFF_MAX][0] > 0)
        printf("%-13s in %u tetrahedra, from (%.6g, %.6g, %.6g) to (%.6g, %.6g, %.6g)\n", "may be", where.tets,
               where.box[0][0], where.box[0][1], where.box[0][2], where.box[1][0], where.box[1][1], where.box[1][2]);
    print_used("first", &sides[0], result, 0);
    print_used("second", &sides[1], result, 1);
    print_overlap(result);
}

/* ---- one field */

/* A name, or NAME:0. */
static enum tetlod_status split_name(const char *text, char name[256], int *component, struct tetlod_error *error)
{
    const char *colon = strrchr(text, ':');
    uint64_t number = 0;
    char *end;
    *component = -1;
    if (text[0] == '|' || (colon && strcmp(colon, ":mag") == 0))
        return tetlodi_fail(error, TETLOD_ERR_ARGUMENT, "the lengths of vectors have no certain difference: compare "
                            "the vectors, whose lengths differ by no more");
    if (colon && colon[1] >= '0' && colon[1] <= '9')
        number = strtoull(colon + 1, &end, 10);
    bool one = colon && colon[1] >= '0' && colon[1] <= '9' && !*end && number < 256;
    size_t length = one ? (size_t)(colon - text) : strlen(text);
    if (length > 255)
        return tetlodi_fail(error, TETLOD_ERR_FIELD, "a field's name has at most 255 bytes");
    memcpy(name, text, length);
    name[length] = 0;
    *component = one ? (int)number : -1;
    return TETLOD_OK;
}

static enum tetlod_status read_limit(const struct diff_limit *limit, const char *within, const double range[2],
                                     struct diff_options *out, struct tetlod_error *error)
{
    out->norm = limit->norm;
    out->limited = limit->limit != NULL;
    bool good = out->limited ? diff_parse_limit(limit->limit, range, &out->limit)
                             : diff_parse_limit(within, range, &out->width);
    return good ? TETLOD_OK
                : tetlodi_fail(error, TETLOD_ERR_ARGUMENT, "a limit is a number of the field's units, or a percentage "
                               "of its range such as 2%%, not '%.60s'", out->limited ? limit->limit : within);
}

static enum tetlod_status compare(const struct request *request, struct operands *operands,
                                  const struct diff_limit *limit, struct diff_side sides[2],
                                  struct diff_options *options, struct diff_result *result, struct tetlod_error *error)
{
    char name[256];
    TETLOD_TRY(split_name(limit->field, name, &options->component, error));
    for (int m = 0; m < 2; m++)
        TETLOD_TRY(make_side(request, operands, m, name, &sides[m], error));
    if (options->component >= (int)sides[0].components)
        return tetlodi_fail(error, TETLOD_ERR_FIELD, "%.100s has the components 0 to %u, not %d", name,
                            sides[0].components - 1, options->component);
    TETLOD_TRY(read_limit(limit, request->within, sides[0].range, options, error));
    return diff_decide(sides, options, result, error);
}

/* Compares one field and prints, or adds to the list, what was found. Gives the verdict, or a negative exit status. */
static int diff_field(const struct request *request, struct operands *operands, const struct diff_limit *limit,
                      json_t *list)
{
    struct diff_side sides[2] = {0};
    struct diff_options options = {.threads = request->threads, .all_cells = request->output != NULL};
    struct diff_result result = {0};
    struct tetlod_error error = {0};
    enum tetlod_status status = compare(request, operands, limit, sides, &options, &result, &error);
    if (status == TETLOD_OK && list)
        json_array_append_new(list, diff_json(limit->field, sides, &options, &result));
    else if (status == TETLOD_OK)
        print_result(limit->field, sides, &options, &result);
    if (status == TETLOD_OK && request->output)
        status = write_difference(&sides[0].mesh, &result, request->output, &error);
    difference_fini(&result.difference);
    for (int m = 0; m < 2; m++)
        diff_side_fini(&sides[m]);
    return status == TETLOD_OK ? (int)result.verdict : -cli_fail(&error);
}

/* The worst verdict of all fields, or a negative exit status. */
static int diff_fields(const struct request *request, struct operands *operands, const struct diff_limits *limits,
                       json_t *list)
{
    int worst = DIFF_MEASURED;
    for (size_t i = 0; i < limits->count && worst >= 0; i++) {
        int verdict = diff_field(request, operands, &limits->limits[i], list);
        worst = verdict < 0 || verdict > worst ? verdict : worst;
    }
    return worst;
}

static int print_list(const struct request *request, json_t *list, int verdict)
{
    json_t *object = request->limits ? json_pack("{s:s, s:O}", "verdict", diff_verdict_name((enum diff_verdict)verdict),
                                                 "fields", list)
                                     : json_incref(json_array_get(list, 0));
    return cli_print_json(object);
}

static int diff(const struct request *request, const struct diff_limits *limits)
{
    static const int statuses[] = {EXIT_DONE, EXIT_DONE, EXIT_UNDECIDED, EXIT_NO};
    struct operands operands = {.streams = {{.fd = -1}, {.fd = -1}}};
    struct tetlod_error error = {0};
    json_t *list = request->json ? json_array() : NULL;
    enum tetlod_status status = TETLOD_OK;
    for (int m = 0; m < 2 && status == TETLOD_OK; m++)
        status = open_one(request, m, &operands, &error);
    int verdict = status == TETLOD_OK ? diff_fields(request, &operands, limits, list) : -cli_fail(&error);
    int printed = verdict >= 0 && request->json ? print_list(request, list, verdict) : EXIT_DONE;
    json_decref(list);
    for (int m = 0; m < 2; m++) {
        stream_input_close(&operands.streams[m]);
        tetmesh_fini(&operands.meshes[m]);
    }
    return verdict < 0 ? -verdict : printed != EXIT_DONE ? printed : statuses[verdict];
}

/* ---- the command line */

/* A value for both, or one for each with a comma between them. */
static bool take_steps(struct request *request, bool by_time, const char *value)
{
    const char *comma = strchr(value, ',');
    char first[64];
    snprintf(first, sizeof first, "%.*s", comma ? (int)(comma - value) : 63, value);
    return step_option_take(&request->steps[0], &command_diff, by_time, first) &&
        step_option_take(&request->steps[1], &command_diff, by_time, comma ? comma + 1 : first);
}

static bool take_option(struct request *request, int option, const char *value)
{
    uint64_t threads;
    if (option == 'T' || option == 'S')
        return take_steps(request, option == 'T', value);
    if (option == 't') {
        if (!cli_parse_count(&command_diff, "threads", value, 0, PARALLEL_MAX_THREADS, &threads))
            return false;
        request->threads = threads ? (unsigned)threads : parallel_cores();
    } else if (option == 'n') {
        request->norm = strcmp(value, "rms") == 0 ? DIFF_RMS : DIFF_MAX;
        if (strcmp(value, "rms") != 0 && strcmp(value, "max") != 0) {
            cli_usage("diff", "--norm is max or rms, not '%s'", value);
            return false;
        }
    } else if (option == 'j') {
        request->json = true;
    } else {
        const char **const texts[] = {&request->field, &request->limit, &request->limits, &request->within,
                                      &request->output};
        const char *at = strchr("flLwo", option);
        if (!at)
            return false;
        *texts[at - "flLwo"] = value;
    }
    return true;
}

/* EXIT_DONE, or what a message has said. */
static int check(struct request *request, int argc, char **argv)
{
    struct tetlod_error error = {0};
    if (!cli_operands(&command_diff, argc, 2, "the two results"))
        return EXIT_USAGE;
    for (int m = 0; m < 2; m++)
        request->places[m] = argv[optind + m];
    if (!request->field == !request->limits || (request->limits && (request->limit || request->output)))
        return cli_usage("diff", "give --field NAME, with or without --limit and -o, or --limits FILE");
    if (request->output && io_check_output(request->output, &error) != TETLOD_OK)
        return cli_usage("diff", "%s", error.message);
    return request->output ? cli_check_output(&command_diff, request->output, NULL, request->places, 2) : EXIT_DONE;
}

static int run(int argc, char **argv)
{
    static const struct option options[] = {
        {"field", required_argument, NULL, 'f'},  {"limit", required_argument, NULL, 'l'},
        {"limits", required_argument, NULL, 'L'}, {"within", required_argument, NULL, 'w'},
        {"output", required_argument, NULL, 'o'}, {"norm", required_argument, NULL, 'n'},
        {"time", required_argument, NULL, 'T'},   {"step", required_argument, NULL, 'S'},
        {"threads", required_argument, NULL, 't'}, {"json", no_argument, NULL, 'j'}, {0}};
    struct request request = {.within = "1%", .threads = parallel_cores()};
    struct diff_limits limits = {0};
    struct tetlod_error error = {0};
    for (int option; (option = cli_option(&command_diff, argc, argv, "l:o:", options)) != -1;)
        if (!take_option(&request, option, optarg))
            return EXIT_USAGE;
    int result = check(&request, argc, argv);
    if (result != EXIT_DONE)
        return result;
    enum tetlod_status status;
    if (request.limits)
        status = diff_limits_read(&limits, request.limits, &error);
    else
        status = diff_limits_one(&limits, request.field, request.limit, request.norm, &error);
    result = status == TETLOD_OK ? diff(&request, &limits) : cli_fail(&error);
    diff_limits_fini(&limits);
    return result;
}

const struct command command_diff = {"diff", "bound how much two results differ, on any meshes", help, run};
