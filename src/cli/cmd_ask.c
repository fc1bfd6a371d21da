/* SPDX-License-Identifier: BSD-3-Clause */
#include <jansson.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "format/fail.h"
#include "src/ask/ask.h"
#include "src/cli/cli.h"
#include "src/cli/print_json.h"
#include "src/level/metadata.h"
#include "src/util/parallel.h"

static const char help[] =
    "usage: tetlod ask FILE.tetlod QUESTION [--within WIDTH] [--json]\n"
    "\n"
    "Answers a question about the original with an interval that certainly holds the answer, from the coarsest level that\n"
    "is fine enough. Only that level's bytes are read.\n"
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
    "      --within W  the interval may be so wide, in the answer's units; or 1% of the field's range (of the volume, of\n"
    "                  the volume times the range) (default: 1%; 0: the finest level)\n"
    "      --json      as JSON\n"
    "\n"
    "Exit status: 0 answered, or yes; 4 no; 5 unknown even at the finest level.\n";

static const char *const verdicts[] = {"unknown", "no", "yes"};

static int print_answer(const struct tetlod_info *info, const char *text, const struct ask_question *question,
                        const struct ask_result *result, bool json)
{
    const struct ask_interval *interval = &result->interval;
    int verdict = ask_decide(question, interval);
    json_t *metadata = metadata_json(info);
    const char *unit = question->function == ASK_VOLUME || question->function == ASK_INTEGRAL
                           ? "" : metadata_unit(metadata, question->quantity.name);
    if (json) {
        json_t *object = json_pack("{s:s, s:f, s:f, s:s, s:s, s:I, s:I, s:I, s:I}", "question", text, "lower", interval->lower,
                                   "upper", interval->upper, "unit", unit, "bound", result->exact ? "exact" : "certified",
                                   "level", (json_int_t)result->level, "tets", (json_int_t)info->levels[result->level].tets,
                                   "bytes", (json_int_t)result->bytes, "of_bytes", (json_int_t)info->bytes);
        if (question->compare != ASK_NO_LIMIT && object)
            json_object_set_new(object, "answer", json_string(verdicts[verdict + 1]));
        json_decref(metadata);
        int status = cli_print_json(object);
        return status != EXIT_DONE || question->compare == ASK_NO_LIMIT || verdict > 0 ? status : verdict < 0 ? EXIT_UNDECIDED : EXIT_NO;
    }
    if (question->compare != ASK_NO_LIMIT)
        printf("%s: ", verdicts[verdict + 1]);
    printf("from %.9g to %.9g%s%s\n", interval->lower, interval->upper, *unit ? " " : "", unit);
    json_decref(metadata);
    printf("%s: level %u of 0..%u, %u of %u tetrahedra, %llu of %llu bytes\n",
           result->exact ? "exact but for rounding" : "certified", result->level, info->level_count - 1,
           info->levels[result->level].tets, info->tets, (unsigned long long)result->bytes, (unsigned long long)info->bytes);
    return question->compare == ASK_NO_LIMIT || verdict > 0 ? EXIT_DONE : verdict < 0 ? EXIT_UNDECIDED : EXIT_NO;
}

static int ask(const char *path, const char *text, const struct ask_within *within, bool json)
{
    struct tetlod_error error = {0}, inner = {0};
    struct ask_question question;
    struct ask_result result;
    struct tetlod_file *file;
    int fd, exit = EXIT_DONE;
    if (ask_parse(text, &question, &error) != TETLOD_OK)
        return cli_fail(&error);
    if (cli_open_stream(path, parallel_cores(), &file, &fd, &error) != TETLOD_OK)
        return cli_fail(&error);
    enum tetlod_status status = ask_stream(file, cli_finest_here(tetlod_info(file), fd), &question, within, &result, &inner);
    if (status == TETLOD_OK) {
        exit = print_answer(tetlod_info(file), text, &question, &result, json);
    } else {
        tetlodi_fail(&error, status, "%s: %.230s", path, inner.message);
        exit = cli_fail(&error);
    }
    tetlod_close(file);
    close(fd);
    return exit;
}

static bool parse_within(const char *text, struct ask_within *out)
{
    char *end;
    out->width = strtod(text, &end);
    out->relative = end != text && strcmp(end, "%") == 0;
    if (end != text && (!*end || out->relative) && isfinite(out->width) && out->width >= 0) {
        out->width *= out->relative ? 0.01 : 1;
        return true;
    }
    cli_usage("ask", "--within takes a number of the answer's units, or a percentage such as 1%%, not '%s'", text);
    return false;
}

static int run(int argc, char **argv)
{
    static const struct option options[] = {{"within", required_argument, NULL, 'w'}, {"json", no_argument, NULL, 'j'}, {0}};
    struct ask_within within = {0.01, true};
    bool json = false;
    for (int option; (option = cli_option(&command_ask, argc, argv, "", options)) != -1;) {
        if (option == 'w' && parse_within(optarg, &within))
            continue;
        if (option != 'j')
            return EXIT_USAGE;
        json = true;
    }
    if (!cli_operands(&command_ask, argc, 2, "the stream and the question"))
        return EXIT_USAGE;
    return ask(argv[optind], argv[optind + 1], &within, json);
}

const struct command command_ask = {"ask", "answer a question about the original, with its proof", help, run};
