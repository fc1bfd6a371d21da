/* SPDX-License-Identifier: BSD-3-Clause */
#include <jansson.h>
#include <math.h>

#include "format/fail.h"
#include "src/cli/cli.h"
#include "src/cli/print_json.h"
#include "src/cli/step_option.h"
#include "src/cli/stream_input.h"
#include "src/stream/metadata.h"
#include "src/report/ask_json.h"
#include "src/util/parallel.h"

static const char help[] =
    "usage: tetlod ask STREAM QUESTION [--within WIDTH] [--time T | --step N] [--json]\n"
    "\n"
    "Answers a question about the original with an interval that certainly holds the answer, from the\n"
    "coarsest level that is fine enough. Only that level's bytes are read. STREAM is a file or a URL: of\n"
    "a stream on any host that answers Range requests, or of a mesh of a tetlod server.\n"
    "\n"
    "  'mean(p)'  'integral(p)'  'min(p)'  'max(p)'     over the domain\n"
    "  'volume()'  'volume(T > 400)'                    also <, <=, >=\n"
    "  'quantile(T, 0.99)'                              the value below which 99 % of the volume lies\n"
    "  'p at (x,y,z)'  'p along line(x0,y0,z0, x1,y1,z1)'\n"
    "  'max(|v|)'  'mean(v:0)'                          the length of a vector, its first component\n"
    "  'mean(p) in box(x0,y0,z0, x1,y1,z1)'  'mean(p) over region 3'\n"
    "  'max(T) < 500'                                   yes, no or unknown\n"
    "\n"
    "A field's name with other signs than letters, digits, '_' and '.' stands in \"quotes\".\n"
    "\n"
    "      --within W  how wide the interval may be, in the answer's units; or % of the field's range\n"
    "                  (of the volume; of the volume times the range) (default: 1%; 0: the finest level)\n"
    "      --time T    in a series of the step whose time is nearest to T; more than half a step outside\n"
    "                  is refused. Without it, of the first step\n"
    "      --step N    the same of the step with this number, from 0\n"
    "      --json      as JSON\n"
    "\n"
    "Exit status: 0 answered, or yes; 4 no; 5 unknown even at the finest level.\n";

/* Nine digits, rounded outwards. */
static int print_as_text(const struct tetlod_info *info, const char *unit, const char *verdict,
                         const struct ask_result *result)
{
    double lower = result->interval.lower, upper = result->interval.upper;
    if (verdict)
        printf("%s: ", verdict);
    printf("from %.9g to %.9g%s%s\n", lower - 5e-9 * fabs(lower), upper + 5e-9 * fabs(upper), *unit ? " " : "", unit);
    printf("%s: ", result->exact ? "exact but for rounding" : "certified");
    if (result->level == TETLOD_NONE)
        printf("the index");
    else
        printf("level %u of 0..%u, %llu of %llu tetrahedra", result->level, result->level_count - 1,
               (unsigned long long)result->tets, (unsigned long long)result->of_tets);
    if (result->of_step)
        printf(", time %.9g", result->time);
    printf(", %llu of %llu bytes\n", (unsigned long long)result->bytes, (unsigned long long)info->bytes);
    return EXIT_DONE;
}

static int print_answer(const struct tetlod_info *info, const char *text, const struct ask_question *question,
                        const struct ask_result *result, bool json)
{
    static const int statuses[] = {EXIT_UNDECIDED, EXIT_NO, EXIT_DONE};
    int status;
    if (json) {
        status = cli_print_json(ask_json(info, text, question, result));
    } else {
        json_t *metadata = metadata_json(info);
        status = print_as_text(info, ask_unit(metadata, question), ask_verdict(question, &result->interval), result);
        json_decref(metadata);
    }
    bool predicate = question->compare != ASK_NO_LIMIT;
    return predicate && status == EXIT_DONE ? statuses[ask_decide(question, &result->interval) + 1] : status;
}

static int ask(const char *place, const char *text, const struct step_selection *step,
               const struct ask_options *options, bool json)
{
    struct tetlod_error error = {0}, inner = {0};
    struct ask_question question;
    struct ask_result result;
    struct stream_input input;
    int exit = EXIT_DONE;
    if (ask_parse(text, &question, &error) != TETLOD_OK)
        return cli_fail(&error);
    enum tetlod_status status = stream_input_open(&input, place, parallel_cores(), &error);
    if (status == TETLOD_OK) {
        status = ask_stream(input.file, input.finest, &question, step, options, &result, &inner);
        if (status == TETLOD_OK)
            exit = print_answer(tetlod_info(input.file), text, &question, &result, json);
        else
            stream_input_fail(&input, place, status, &inner, &error);
    }
    stream_input_close(&input);
    return status == TETLOD_OK ? exit : cli_fail(&error);
}

/* Reads an option's value; false after a usage message. */
static bool take_option(int option, struct ask_options *within, struct step_option *step)
{
    if (option == 'w' && !ask_parse_within(optarg, within)) {
        cli_usage("ask", "--within takes a number of the answer's units, or a percentage such as 1%%, not '%s'",
                  optarg);
        return false;
    }
    if (option == 'T' || option == 'S')
        return step_option_take(step, &command_ask, option == 'T', optarg);
    return option == 'w' || option == 'j';
}

static int run(int argc, char **argv)
{
    static const struct option options[] = {{"within", required_argument, NULL, 'w'}, {"json", no_argument, NULL, 'j'},
                                            {"time", required_argument, NULL, 'T'},
                                            {"step", required_argument, NULL, 'S'},   {0}};
    struct ask_options within = {.width = 0.01, .relative = true};
    struct step_option step = {0};
    bool json = false;
    for (int option; (option = cli_option(&command_ask, argc, argv, "", options)) != -1;) {
        if (!take_option(option, &within, &step))
            return EXIT_USAGE;
        json |= option == 'j';
    }
    if (!cli_operands(&command_ask, argc, 2, "the stream and the question"))
        return EXIT_USAGE;
    return ask(argv[optind], argv[optind + 1], step.given ? &step.selection : NULL, &within, json);
}

const struct command command_ask = {"ask", "answer a question about the original, with its proof", help, run};
