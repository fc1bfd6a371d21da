/* SPDX-License-Identifier: BSD-3-Clause */
#include <jansson.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

#include "format/fail.h"
#include "src/cli/cli.h"
#include "src/cli/extract_step.h"
#include "src/cli/print_json.h"
#include "src/cli/stream_input.h"
#include "src/io/io.h"
#include "src/report/features_json.h"
#include "src/util/file.h"
#include "src/util/number_text.h"
#include "src/util/parallel.h"

static const char help[] =
    "usage: tetlod features FILE|URL --field NAME [--persistence P] [--above V] [--below V]\n"
    "                       [--level K | --error E] [--step N | --time T] [-o OUT.vtu|.csv] [--json]\n"
    "\n"
    "Lists the maxima and minima of a field that the original certainly has, with a box that holds each,\n"
    "and those that it may have. FILE is a stream, of which the coarsest level is read that decides, or a\n"
    "mesh file. URL is that of a stream, of which the bytes up to that level are fetched.\n"
    "\n"
    "  -f, --field NAME       the field; of a vector |NAME| or NAME:0\n"
    "      --persistence P    how far the field must fall from a maximum (rise from a minimum) before a\n"
    "                         higher (lower) one can be reached, a fraction of the range: 0.02 or 2%\n"
    "                         (default: 2%)\n"
    "      --abs-persistence P  the same in the field's units\n"
    "      --above V, --below V  instead: the parts of the domain where the field is above or below V,\n"
    "                         and reaches further than the persistence\n"
    "      --level K          this level of the stream; 0 is the coarsest\n"
    "      --error E          the coarsest level whose certified error is within E, part of the range\n"
    "      --step N, --time T  of a series, a step by its number or by its time; of a file with several\n"
    "                         steps --step\n"
    "  -o, --output OUT       also writes the features as points: .vtu or .csv\n"
    "      --json             as JSON\n"
    "\n"
    "The original has at least what is certain, and nothing else with 'at most'. A level whose boundary\n"
    "has moved proves nothing, nor does a field that the build did not control: where it is so, the\n"
    "finest level of a lossless stream answers.\n"
    "\n"
    "Exit status: 0 all that there are is certain; 5 some are merely possible.\n"
    "\n"
    "example: tetlod features blunt.tetlod --field Pressure --persistence 5% -o peaks.vtu\n";

struct request {
    const char *input, *output, *field, *step_text;
    struct feature_request features;
    struct step_selection step;
    bool of_step, json, has_level, has_error;
    uint64_t level;
    double error;
};

static const char *plural(enum feature_kind kind)
{
    static const char *const names[FEATURE_KINDS] = {"maxima", "minima", "components above", "components below"};
    return names[kind];
}

static void print_count(const struct feature_answer *answer, enum feature_kind kind)
{
    const struct features *features = &answer->features;
    uint32_t proven = features->proven[kind], possible = features->possible[kind];
    printf("%s: %u certain", plural(kind), proven);
    if (features->bounded[kind])
        printf(", %u at most", proven + possible);
    else
        printf(", %u more in this level, any number possible", possible);
    printf("; persistence above %.9g\n", answer->persistence);
}

static void print_feature(const struct feature *feature)
{
    const double *at = feature->at, *low = feature->box[0], *high = feature->box[1];
    printf("%s %s: %.9g to %.9g, persistence %s%.9g, at (%.9g, %.9g, %.9g)",
           feature->proven ? "certain " : "possible", feature_name(feature->kind), feature->range[0],
           feature->range[1], feature->proven ? "at least " : "", feature->persistence, at[0], at[1], at[2]);
    if (feature->proven)
        printf(", in (%.9g, %.9g, %.9g) to (%.9g, %.9g, %.9g)", low[0], low[1], low[2], high[0], high[1], high[2]);
    printf("\n");
}

static void print_text(const struct tetlod_info *info, const struct feature_answer *answer)
{
    for (int k = 0; k < FEATURE_KINDS; k++)
        if (answer->features.asked[k])
            print_count(answer, (enum feature_kind)k);
    for (size_t i = 0; i < answer->features.count; i++)
        print_feature(&answer->features.list[i]);
    if (info)
        printf("level %u of 0..%u, certified to %.9g, %u of %llu tetrahedra, %llu of %llu bytes\n", answer->level,
               info->level_count - 1, answer->error, answer->tets, (unsigned long long)info->tets,
               (unsigned long long)answer->bytes, (unsigned long long)info->bytes);
}

static bool ends_in(const char *path, const char *ending)
{
    size_t length = strlen(path), wanted = strlen(ending);
    return length > wanted && strcasecmp(path + length - wanted, ending) == 0;
}

static enum tetlod_status write_points(const char *path, const struct features *features, struct tetlod_error *error)
{
    struct file_output *output;
    TETLOD_TRY(file_output_open(&output, path, error));
    const struct tetlodi_sink sink = file_output_sink(output);
    return file_output_finish(output, ends_in(path, ".csv") ? features_write_csv(features, &sink, error)
                                                            : features_write_vtu(features, &sink, error), error);
}

static int show(const struct request *request, const struct tetlod_info *info, const struct feature_answer *answer)
{
    struct tetlod_error error = {0};
    const struct features *features = &answer->features;
    bool decided = true;
    int exit = EXIT_DONE;
    if (request->output && write_points(request->output, features, &error) != TETLOD_OK)
        return cli_fail(&error);
    if (request->json)
        exit = cli_print_json(features_json(info, request->field, answer));
    else
        print_text(info, answer);
    for (int k = 0; k < FEATURE_KINDS; k++)
        decided &= !features->asked[k] || (features->bounded[k] && !features->possible[k]);
    return exit == EXIT_DONE && !decided ? EXIT_UNDECIDED : exit;
}

static enum tetlod_status find_in_mesh(struct request *request, const struct tetmesh *mesh,
                                       struct feature_answer *answer, struct tetlod_error *error)
{
    struct ask_quantity *quantity = &request->features.quantity;
    bool is_name = tetmesh_find_field(mesh, request->field) != TETLOD_NONE;
    TETLOD_TRY(feature_quantity(request->field, is_name, quantity, error));
    uint32_t field = tetmesh_find_field(mesh, quantity->name);
    if (field == TETLOD_NONE)
        return tetlodi_fail(error, TETLOD_ERR_FIELD, "there is no field '%.100s' at its points", quantity->name);
    TETLOD_TRY(tetmesh_validate_field(mesh, field, error));
    const struct feature_values values = {mesh->positions, mesh->corners, mesh->vertex_count, mesh->tet_count,
                                          mesh->fields[field].components, mesh->fields[field].values};
    return features_of_mesh(&values, &request->features, answer, error);
}

static enum tetlod_status find_in_step(struct request *request, struct tetlod_file *file,
                                       struct feature_answer *answer, struct tetlod_error *error)
{
    struct tetmesh mesh = {0};
    char about[1024];
    enum tetlod_status status = extract_step(file, &request->step, false, &mesh, about, sizeof about, error);
    if (status == TETLOD_OK)
        status = find_in_mesh(request, &mesh, answer, error);
    tetmesh_fini(&mesh);
    return status;
}

/* The levels that may be taken. */
static enum tetlod_status choose_levels(struct request *request, const struct tetlod_info *info, uint32_t finest,
                                        struct tetlod_error *error)
{
    struct feature_request *features = &request->features;
    struct selection selection = {.kind = TAKE_ERROR, .error = request->error, .measure = TETLOD_MAX,
                                  .field = tetlod_field_index(info, features->quantity.name)};
    features->first = 0;
    features->last = finest;
    if (selection.field == TETLOD_NONE || (!request->has_level && !request->has_error))
        return TETLOD_OK; // the name is refused later
    uint32_t level = request->has_level ? (uint32_t)request->level : selection_level(info, &selection);
    if (level >= info->level_count)
        return tetlodi_fail(error, TETLOD_ERR_ARGUMENT, "none of its levels 0 to %u is %s", info->level_count - 1,
                            request->has_level ? "that one" : "certified to be within that error");
    if (finest == TETLOD_NONE || level > finest)
        return tetlodi_fail(error, TETLOD_ERR_TRUNCATED, "it is cut off before the end of level %u", level);
    features->first = features->last = level;
    return TETLOD_OK;
}

static enum tetlod_status find_in_stream(struct request *request, struct tetlod_file *file, uint32_t finest,
                                         struct feature_answer *answer, struct tetlod_error *error)
{
    const struct tetlod_info *info = tetlod_info(file);
    if (request->of_step)
        return find_in_step(request, file, answer, error);
    bool is_name = tetlod_field_index(info, request->field) != TETLOD_NONE;
    TETLOD_TRY(feature_quantity(request->field, is_name, &request->features.quantity, error));
    TETLOD_TRY(choose_levels(request, info, finest, error));
    return features_of_stream(file, &request->features, answer, error);
}

static int of_stream(struct request *request)
{
    struct tetlod_error error = {0}, inner = {0};
    struct feature_answer answer = {0};
    struct stream_input input;
    int exit = EXIT_FAILED;
    enum tetlod_status status = stream_input_open(&input, request->input, parallel_cores(), &error);
    if (status == TETLOD_OK) {
        const struct tetlod_info *info = tetlod_info(input.file);
        status = find_in_stream(request, input.file, input.finest, &answer, &inner);
        if (status == TETLOD_OK)
            exit = show(request, request->of_step ? NULL : info, &answer);
        else
            stream_input_fail(&input, request->input, status, &inner, &error);
    }
    feature_answer_fini(&answer);
    stream_input_close(&input);
    return status == TETLOD_OK ? exit : cli_fail(&error);
}

static int of_mesh(struct request *request)
{
    struct tetlod_error error = {0}, inner = {0};
    struct feature_answer answer = {0};
    struct tetmesh mesh = {0};
    const struct io_read_options options = {.time = request->step_text, .any_values = true};
    if (io_read(&mesh, request->input, &options, NULL, &error) != TETLOD_OK)
        return cli_fail(&error);
    enum tetlod_status status = find_in_mesh(request, &mesh, &answer, &inner);
    if (status != TETLOD_OK)
        tetlodi_fail(&error, status, "%s: %.230s", request->input, inner.message);
    int exit = status == TETLOD_OK ? show(request, NULL, &answer) : cli_fail(&error);
    feature_answer_fini(&answer);
    tetmesh_fini(&mesh);
    return exit;
}

static bool take_step(struct request *request, int option, const char *value)
{
    if (request->of_step) {
        cli_usage("features", "--time or --step: one step can be chosen");
        return false;
    }
    request->of_step = true;
    request->step.by_time = option == 'T';
    if (option == 'T')
        return cli_parse_number(&command_features, "time", value, -INFINITY, &request->step.time);
    request->step_text = value;
    return cli_parse_count(&command_features, "step", value, 0, UINT32_MAX, &request->step.step);
}

/* Nothing has more than the range: whoever writes 2 means 2 %. */
static bool take_persistence(const char *value, double *out)
{
    if (!cli_parse_fraction(&command_features, "persistence", value, out))
        return false;
    if (*out <= 1)
        return true;
    cli_usage("features", "--persistence is a fraction of the range, 0 to 1, or a percentage such as 2%%, not '%s'",
              value);
    return false;
}

static bool take_option(struct request *request, int option, const char *value)
{
    struct feature_request *features = &request->features;
    switch (option) {
    case 'f':
        request->field = value;
        return true;
    case 'o':
        request->output = value;
        return true;
    case 'j':
        return request->json = true;
    case 'p':
    case 'P':
        features->absolute = option == 'P';
        return features->absolute
                   ? cli_parse_number(&command_features, "abs-persistence", value, 0, &features->persistence)
                   : take_persistence(value, &features->persistence);
    case 'a':
        features->has_above = true;
        return cli_parse_number(&command_features, "above", value, -INFINITY, &features->above);
    case 'b':
        features->has_below = true;
        return cli_parse_number(&command_features, "below", value, -INFINITY, &features->below);
    case 'k':
        request->has_level = true;
        return cli_parse_count(&command_features, "level", value, 0, UINT32_MAX - 1, &request->level);
    case 'e':
        request->has_error = true;
        return cli_parse_fraction(&command_features, "error", value, &request->error);
    case 'S':
    case 'T':
        return take_step(request, option, value);
    default:
        return false;
    }
}

static int check(const struct request *request)
{
    if (!request->field)
        return cli_usage("features", "--field NAME is missing");
    if ((request->has_level || request->has_error) && (request->of_step || (request->has_level && request->has_error)))
        return cli_usage("features", "--level, --error, --step and --time: one is enough; a step is exact");
    if (request->output && !ends_in(request->output, ".vtu") && !ends_in(request->output, ".csv"))
        return cli_usage("features", "-o writes .vtu or .csv, not '%s'", request->output);
    return EXIT_DONE;
}

static int run(int argc, char **argv)
{
    static const struct option options[] = {
        {"field", required_argument, NULL, 'f'},   {"output", required_argument, NULL, 'o'},
        {"json", no_argument, NULL, 'j'},          {"persistence", required_argument, NULL, 'p'},
        {"above", required_argument, NULL, 'a'},   {"abs-persistence", required_argument, NULL, 'P'},
        {"below", required_argument, NULL, 'b'},   {"level", required_argument, NULL, 'k'},
        {"error", required_argument, NULL, 'e'},   {"step", required_argument, NULL, 'S'},
        {"time", required_argument, NULL, 'T'},    {0}};
    struct request request = {.features.persistence = 0.02};
    for (int option; (option = cli_option(&command_features, argc, argv, "f:o:", options)) != -1;)
        if (!take_option(&request, option, optarg))
            return EXIT_USAGE;
    if (!cli_operands(&command_features, argc, 1, "the stream or mesh file") || check(&request) != EXIT_DONE)
        return EXIT_USAGE;
    request.input = argv[optind];
    int result = request.output ? cli_check_output(&command_features, request.output, NULL, &request.input, 1)
                                : EXIT_DONE;
    if (result != EXIT_DONE)
        return result;
    return web_source_is(request.input) || cli_is_stream(request.input) ? of_stream(&request) : of_mesh(&request);
}

const struct command command_features = {"features", "extrema that the original certainly has", help, run};
