/* SPDX-License-Identifier: BSD-3-Clause */
/* The options of tetlod build, by what they are about: fields, contraction, the stream, a series in time, the run. */
#include "src/cli/build_request.h"

#include <string.h>

#include "src/cli/mail.h"
#include "src/cli/show.h"
#include "src/util/parallel.h"

const char build_help[] =
    "usage: tetlod build INPUT... [-o OUT.tetlod] [OPTIONS]\n"
    "\n"
    "Reads a mesh, contracts it and writes the stream of its levels: from a few tetrahedra to the\n"
    "original. A file with several times, or several files, become a series: one mesh, with the values of\n"
    "the controlled fields at every step. Points may move: how far becomes the field point_displacement,\n"
    "which is controlled as well. Where the tetrahedra change from one step to the next, a topology group\n"
    "begins: a stream inside the stream, with levels of its own; errors are of the range over all steps.\n"
    "\n"
    "  -o, --output OUT        the stream to write (default: INPUT's name with .tetlod in this folder).\n"
    "                          OUT.vtkhdf is the stream inside a VTKHDF file: ParaView and VTK see a\n"
    "                          coarse level of it, tetlod the whole stream\n"
    "      --show E            that level's error, a fraction of the range (default: the finest level of\n"
    "                          at most 200,000 tetrahedra)\n"
    READING_HELP
    "      --field NAME        a field that is controlled: contractions keep its error within the limit.\n"
    "                          NAME:mag for a vector's magnitude (and the vector, so that its length is\n"
    "                          as exact as that), NAME:0 for a component, NAME:0.01 (or :1%) for an error\n"
    "                          limit of its own, which rounding is inside of. Lists A,B, patterns 'p*'\n"
    "                          and all are possible; may be given several times (default: all fields but\n"
    "                          ids, which are integers, names that end in Id or Ids, and whole numbers;\n"
    "                          with --for mail the first one; without any a coordinate)\n"
    "      --no-field NAME     a field, list or pattern that is not controlled\n"
    "      --abs-error E       the error limit of the --field before it, in that field's own units\n"
    "      --carry A,B         the fields to store, at points and of cells (default: all); those of\n"
    "                          --field and --region always are; without --field only these are controlled\n"
    "      --region NAME       values of cells that tell regions, such as materials: where two meet,\n"
    "                          vertices and faces stay as they are at every level (default: integers\n"
    "                          named region, material or the like, or of few values, 2 to 64)\n"
    "      --no-region         no regions; --region none says the same\n"
    "      --certify HOW       what holds the error: fast (default), a bound that is carried along;\n"
    "                          exact, the exact maximum over the whole domain: far fewer tetrahedra for\n"
    "                          the same error, in tens of times the time\n"
    "      --certify-all       a 'max' for every field, also those that are not controlled: the exact\n"
    "                          maximum of every level, measured at the end; takes several times as long\n"
    "      --summary           exact integrals, distributions of values, places of extremes, sums of\n"
    "                          boxes and regions, and the volume that the boundary sweeps: for tetlod\n"
    "                          ask (at most 5 kB a field)\n"
    "      --local-bound       a field 'NAME bound' of each controlled field: how far off it is at most\n"
    "                          at each point of a level\n"
    "      --keep-features P   every level has as many maxima and minima of a persistence above P as the\n"
    "                          original (tetlod features), in each controlled component: 0.02 or 2% of\n"
    "                          its range. Coarser levels than that allows are not stored\n"
    "      --metric M          what orders the contractions: envelope (default of fast), the carried\n"
    "                          bound; field-quadric (Cignoni and others; default of exact) or quadric\n"
    "                          (Garland and Heckbert). Two more are also the limit: sva, the accumulated\n"
    "                          prediction of scalar value assignment; measured, the true error at samples\n"
    "                          ('sampled')\n"
    "      --contract KIND     what is contracted: edge (default), face, tet, or hybrid, all three\n"
    "      --max-error E       stop at this error, a fraction of the range: 0.1 or 10% (default 1)\n"
    "      --min-tets N        stop at that many tetrahedra\n"
    "      --domain-error E    how far the boundary may move from the original's in all, a fraction of\n"
    "                          the diagonal (default 0.001; exact, measured: at most 0.000001; a series:\n"
    "                          0); 0: only planar boundary is simplified\n"
    "      --boundary-angle D  degrees by which boundary faces may turn and still count as one smooth\n"
    "                          surface; edges that turn more are creases, and are kept (default 30)\n"
    "      --growth G          vertices of a level / vertices of the one below (default 1.1)\n"
    "      --position-bits N   round coordinates to N bits across the bounds, 1 .. 30 (default: lossless)\n"
    "      --field-bits N      round values to N bits across the range, those of cells too, but for ids,\n"
    "                          integers and regions\n"
    "      --position-error E, --field-error E   as many bits as this error needs: a fraction of the\n"
    "                                            diagonal, of the range\n"
    "                          (rounding is in every error that the stream states)\n"
    "      --times A:B:C       of a series the steps numbered A to B, from 0, every C-th (default: all);\n"
    "                          --time N: that one step\n"
    "      --bands E,E,...     errors that the steps' values are stored for, fractions of the --range\n"
    "                          (default 5%,2%,1%,0.5%,0.2%,0.1%); the exact values are always stored\n"
    "      --range R           series (default): a field's range over all steps; step: each step's own,\n"
    "                          where it has one\n"
    "      --for mail          one small file to send: rounded, of the --field alone (and --carry), with\n"
    "                          the levels up to --error\n"
    "      --error E           with --for: the error of the finest level in the file (default 1%)\n"
    "      --paged[=TETS]      contract cells of about that many tetrahedra (default 100000, at least\n"
    "                          100) one by one, threads taking cells, and store their records in pages; a\n"
    "                          mesh of less than five cells is built as ever. Not of a series: the\n"
    "                          values of its steps are stored for whole levels, not page by page;\n"
    "                          --time N builds one step in pages\n"
    "      --bands BANDS       with --paged: fine, medium or coarse: a level in pages for all of 1, 1.5,\n"
    "                          2, 3, 5, 7 of each decade of errors, for 1, 2 and 5, or for every second\n"
    "                          of these while many cells are left. Fine leaves fewer tetrahedra and\n"
    "                          takes longer; with coarse, boxes and what a viewer looks at need fewer\n"
    "                          bytes (as with --paged=50000). Default: medium, and coarse from 4,194,304\n"
    "                          tetrahedra on\n"
    "      --keep-order        store the input's numbering too, for tetlod extract --original-order, and\n"
    "                          cells that are split as they were, for tetlod extract --cells original.\n"
    "                          Without it, large meshes that are not in order of space, as generators\n"
    "                          write them, are sorted first, which may halve the time of the build\n"
    "      --compress N        1 fast .. 22 small (default 19): from 20 on the coder's rates of learning\n"
    "                          are all tried\n"
    "      --threads N         up to 64; 0 (default): all cores; the bytes do not depend on it\n"
    "      --memory BYTES      how much memory to take; K, M, G may follow. A mesh for which that is\n"
    "                          too little is built by cells (--paged), with its large arrays in\n"
    "                          temporary files. What cannot be built so is refused. Of a series, fewer\n"
    "                          steps limit the contraction first\n"
    "      --scratch DIR       the folder of temporary files (default: TMPDIR, else /tmp)\n"
    "      --all               list every level (default: about ten)\n"
    "      --json              print the stream's index, and times and memory, as JSON\n"
    "      --progress, --quiet draw the progress bar in any case; say nothing but errors\n"
    "\n"
    "example: tetlod build bluntfinxyz.bin --q bluntfinq.bin --field Pressure -o blunt.tetlod\n";

/* The number of an option says what it is about, and which it is; the run's are letters. Further ones are
 * READING_... */
enum { ABOUT = ~0xff, OF_RUN = 0, OF_FIELDS = 0x100, OF_CONTRACTION = 0x200, OF_STREAM = 0x300, OF_SERIES = 0x400 };
enum {
    OUTPUT = 'o', THREADS = 't', MEMORY = 'm', ALL = 'a', JSON = 'j', PROGRESS = 'p', QUIET = 'q',
    SCRATCH = 's',
    FIELD = OF_FIELDS, NO_FIELD, ABS_ERROR, CARRY, REGION, NO_REGION,
    CERTIFY = OF_CONTRACTION, CERTIFY_ALL, SUMMARY, LOCAL_BOUND, METRIC, CONTRACT, MAX_ERROR, MIN_TETS,
    DOMAIN_ERROR, BOUNDARY_ANGLE, KEEP_FEATURES,
    GROWTH = OF_STREAM, POSITION_BITS, FIELD_BITS, POSITION_ERROR, FIELD_ERROR, PAGED, KEEP_ORDER, COMPRESS,
    PURPOSE, PURPOSE_ERROR, SHOW,
    TIMES = OF_SERIES, BANDS, RANGE,
};

static const struct option options[] = {
    {"output", required_argument, NULL, OUTPUT}, READING_OPTIONS,
    {"field", required_argument, NULL, FIELD}, {"no-field", required_argument, NULL, NO_FIELD},
    {"abs-error", required_argument, NULL, ABS_ERROR}, {"carry", required_argument, NULL, CARRY},
    {"region", required_argument, NULL, REGION}, {"no-region", no_argument, NULL, NO_REGION},
    {"certify", required_argument, NULL, CERTIFY}, {"certify-all", no_argument, NULL, CERTIFY_ALL},
    {"local-bound", no_argument, NULL, LOCAL_BOUND},
    {"summary", no_argument, NULL, SUMMARY}, {"keep-features", required_argument, NULL, KEEP_FEATURES},
    {"metric", required_argument, NULL, METRIC}, {"contract", required_argument, NULL, CONTRACT},
    {"max-error", required_argument, NULL, MAX_ERROR},
    {"min-tets", required_argument, NULL, MIN_TETS}, {"domain-error", required_argument, NULL, DOMAIN_ERROR},
    {"boundary-angle", required_argument, NULL, BOUNDARY_ANGLE}, {"growth", required_argument, NULL, GROWTH},
    {"position-bits", required_argument, NULL, POSITION_BITS}, {"field-bits", required_argument, NULL, FIELD_BITS},
    {"position-error", required_argument, NULL, POSITION_ERROR}, {"field-error", required_argument, NULL, FIELD_ERROR},
    {"paged", optional_argument, NULL, PAGED},
    {"keep-order", no_argument, NULL, KEEP_ORDER}, {"compress", required_argument, NULL, COMPRESS},
    {"for", required_argument, NULL, PURPOSE}, {"error", required_argument, NULL, PURPOSE_ERROR},
    {"show", required_argument, NULL, SHOW},
    {"times", required_argument, NULL, TIMES}, {"bands", required_argument, NULL, BANDS},
    {"range", required_argument, NULL, RANGE}, {"threads", required_argument, NULL, THREADS},
    {"memory", required_argument, NULL, MEMORY}, {"scratch", required_argument, NULL, SCRATCH},
    {"all", no_argument, NULL, ALL}, {"json", no_argument, NULL, JSON},
    {"progress", no_argument, NULL, PROGRESS}, {"quiet", no_argument, NULL, QUIET}, {0}};

/* ---- values */

static const char *const metric_names[] = {[METRIC_ENVELOPE] = "envelope",
                                           [METRIC_SVA] = "sva",
                                           [METRIC_FIELD_QUADRIC] = "field-quadric",
                                           [METRIC_QUADRIC] = "quadric",
                                           [METRIC_MEASURED] = "measured"};
static const char *const certify_names[] = {[CERTIFY_FAST] = "fast", [CERTIFY_EXACT] = "exact"};
static const char *const contract_names[] = {"edge", "face", "tet", "hybrid"};
enum { METRICS = sizeof metric_names / sizeof *metric_names, CERTIFIES = 2, CONTRACTS = 4 };

const char *build_metric_name(enum metric metric)
{
    return metric_names[metric];
}

const char *build_certify_name(enum certify certify)
{
    return certify_names[certify];
}

/* Which of the names the text is. */
static bool parse_name(const char *option, const char *text, const char *const *names, unsigned count, unsigned *out)
{
    char list[128] = "";
    size_t used = 0;
    for (*out = 0; *out < count; ++*out) {
        if (strcmp(text, names[*out]) == 0)
            return true;
        used += (size_t)snprintf(list + used, sizeof list - used, "%s%s", used ? ", " : "", names[*out]);
    }
    cli_usage("build", "--%s is one of %s, not '%s'", option, list, text);
    return false;
}

static bool parse_unsigned(const char *option, const char *text, unsigned least, unsigned most, unsigned *out)
{
    uint64_t count;
    if (!cli_parse_count(&command_build, option, text, least, most, &count))
        return false;
    *out = (unsigned)count;
    return true;
}

/* ---- fields */

static bool take_field(struct build_request *request, const char *text)
{
    if (request->field_count == MAX_FIELD_OPTIONS) {
        cli_usage("build", "at most %d --field; one may have a list: --field A,B", MAX_FIELD_OPTIONS);
        return false;
    }
    request->fields[request->field_count++] = text;
    return true;
}

static bool take_without(struct build_request *request, const char *text)
{
    if (request->without_count == MAX_FIELD_OPTIONS) {
        cli_usage("build", "at most %d --no-field; one may have a list: --no-field A,B", MAX_FIELD_OPTIONS);
        return false;
    }
    request->without[request->without_count++] = text;
    return true;
}

static bool take_units(struct build_request *request, const char *text)
{
    double *units = &request->units[request->field_count ? request->field_count - 1 : 0];
    if (!request->field_count || *units > 0) {
        cli_usage("build", "--abs-error %s: it belongs to the --field before it, one each", text);
        return false;
    }
    if (!cli_parse_number(&command_build, "abs-error", text, 0, units))
        return false;
    if (!(*units > 0))
        cli_usage("build", "--abs-error is more than 0; without it and with --max-error 0 nothing is simplified");
    return *units > 0;
}

static bool field_option(struct build_request *request, int option, const char *value)
{
    switch (option) {
    case FIELD:
        return take_field(request, value);
    case NO_FIELD:
        return take_without(request, value);
    case ABS_ERROR:
        return take_units(request, value);
    case CARRY:
        request->carry = value;
        return true;
    case NO_REGION:
        request->region = "none";
        return true;
    default:
        request->region = value;
        return true;
    }
}

/* ---- contraction */

static bool take_contract(struct build_request *request, const char *text)
{
    static const unsigned kinds[CONTRACTS] = {CONTRACT_EDGES, CONTRACT_FACES, CONTRACT_TETS,
                                              CONTRACT_EDGES | CONTRACT_FACES | CONTRACT_TETS};
    unsigned number;
    if (!parse_name("contract", text, contract_names, CONTRACTS, &number))
        return false;
    request->contract = text;
    request->build.contract = kinds[number];
    return true;
}

static bool take_kept_features(struct build_request *request, const char *text)
{
    double *out = &request->build.keep_features;
    if (!cli_parse_fraction(&command_build, "keep-features", text, out))
        return false;
    if (*out <= 0)
        cli_usage("build", "--keep-features takes a persistence above 0, a fraction of the range such as 2%%");
    return *out > 0;
}

static bool contraction_option(struct build_request *request, int option, const char *value)
{
    struct build_options *build = &request->build;
    unsigned number = 0;
    bool good;
    switch (option) {
    case CERTIFY:
        good = parse_name("certify", value, certify_names, CERTIFIES, &number);
        build->certify = (enum certify)number;
        return good;
    case CERTIFY_ALL:
        return build->certify_all = true;
    case LOCAL_BOUND:
        return build->local_bound = true;
    case SUMMARY:
        return build->summary = true;
    case METRIC:
        good = parse_name("metric", value, metric_names, METRICS, &number);
        build->metric = (enum metric)number;
        return request->ordered = good;
    case CONTRACT:
        return take_contract(request, value);
    case MAX_ERROR:
        return cli_parse_fraction(&command_build, "max-error", value, &build->max_error);
    case KEEP_FEATURES:
        return take_kept_features(request, value);
    case MIN_TETS:
        return parse_unsigned("min-tets", value, 1, UINT32_MAX, &build->min_tets);
    case DOMAIN_ERROR:
        request->moves_boundary = true;
        return cli_parse_fraction(&command_build, "domain-error", value, &build->domain_error);
    default:
        return cli_parse_number(&command_build, "boundary-angle", value, 0, &build->boundary_angle);
    }
}

/* ---- the stream */

static bool take_purpose(struct build_request *request, const char *text)
{
    request->for_mail = strcmp(text, "mail") == 0;
    if (!request->for_mail)
        cli_usage("build", "--for takes mail, not '%s'", text);
    return request->for_mail;
}

static bool stream_option(struct build_request *request, int option, const char *value)
{
    struct build_options *build = &request->build;
    struct quantise_options *quantise = &build->quantise;
    unsigned effort = 0;
    bool good;
    switch (option) {
    case GROWTH:
        return cli_parse_number(&command_build, "growth", value, 1, &build->growth);
    case POSITION_BITS:
        return parse_unsigned("position-bits", value, 1, QUANTISE_MAX_BITS, &quantise->position_bits);
    case FIELD_BITS:
        return parse_unsigned("field-bits", value, 1, QUANTISE_MAX_BITS, &quantise->field_bits);
    case POSITION_ERROR:
        return cli_parse_fraction(&command_build, "position-error", value, &quantise->position_error);
    case FIELD_ERROR:
        return cli_parse_fraction(&command_build, "field-error", value, &quantise->field_error);
    case PAGED:
        build->paged = BUILD_CELL_TETS;
        return !value || parse_unsigned("paged", value, BUILD_MIN_CELL_TETS, BUILD_MAX_CELL_TETS, &build->paged);
    case KEEP_ORDER:
        return build->keep_order = request->reading.options.keep_cells = true;
    case COMPRESS:
        good = parse_unsigned("compress", value, 1, 22, &effort);
        build->compression = (int)effort;
        return good;
    case PURPOSE:
        return take_purpose(request, value);
    case SHOW:
        return cli_parse_fraction(&command_build, "show", value, &request->show_error);
    default:
        return cli_parse_fraction(&command_build, "error", value, &request->mail_error);
    }
}

/* ---- a series in time, and the run */

/* Of pages, or of the steps of a series. */
static bool take_bands(struct build_request *request, const char *value)
{
    static const char *const names[BANDS_COUNT] = {
        [BANDS_MEDIUM] = "medium", [BANDS_FINE] = "fine", [BANDS_COARSE] = "coarse"};
    for (int i = BANDS_MEDIUM; i < BANDS_COUNT; i++)
        if (strcmp(value, names[i]) == 0) {
            request->build.bands = (enum cell_bands)i;
            return true;
        }
    if (!strpbrk(value, "0123456789")) {
        cli_usage("build",
                  "--bands takes fine, medium or coarse, or falling errors of a series, such as 5%%,1%%; not '%s'",
                  value);
        return false;
    }
    return series_input_parse_bands(&request->series, &command_build, value);
}

static bool series_option(struct build_request *request, int option, const char *value)
{
    switch (option) {
    case TIMES:
        return series_input_parse_times(&request->series, &command_build, value);
    case BANDS:
        return take_bands(request, value);
    default:
        return series_input_parse_range(&request->series, &command_build, value);
    }
}

static bool run_option(struct build_request *request, int option, const char *value)
{
    switch (option) {
    case OUTPUT:
        request->output = value;
        return true;
    case THREADS:
        return parse_unsigned("threads", value, 0, PARALLEL_MAX_THREADS, &request->build.threads);
    case MEMORY:
        return cli_parse_count(&command_build, "memory", value, 1, UINT64_MAX, &request->build.memory);
    case SCRATCH:
        request->scratch = value;
        return true;
    case ALL:
        return request->all = true;
    case JSON:
        return request->json = true;
    case PROGRESS:
        return request->draws_progress = true;
    case QUIET:
        return request->quiet = true;
    default: // cli_option has said what is wrong
        return false;
    }
}

static bool take_option(struct build_request *request, int option, const char *value)
{
    switch (option & ABOUT) {
    case OF_RUN:
        return run_option(request, option, value);
    case OF_FIELDS:
        return field_option(request, option, value);
    case OF_CONTRACTION:
        return contraction_option(request, option, value);
    case OF_STREAM:
        return stream_option(request, option, value);
    case OF_SERIES:
        return series_option(request, option, value);
    default:
        return reading_option(&request->reading, &command_build, option, value);
    }
}

/* ---- the request */

/* What the user did not choose is chosen for a small file. */
static void prepare_mail(struct build_request *request)
{
    request->mail_error = request->mail_error > 0 ? request->mail_error : MAIL_ERROR;
    request->carry = request->carry ? request->carry : "";
    mail_round(&request->build.quantise, request->mail_error);
}

/* Options that do not go together, or are out of range. */
static int check_options(struct build_request *request)
{
    struct build_options *build = &request->build;
    struct build_range bad;
    if (build_options_out_of_range(build, &bad))
        return cli_usage("build", "--%s is %g to %g, not %g", bad.option, bad.least, bad.most, bad.value);
    if (build->certify == CERTIFY_EXACT && !request->ordered)
        build->metric = METRIC_FIELD_QUADRIC;
    if (build->certify == CERTIFY_EXACT && !metric_is_certified(build->metric))
        return cli_usage("build", "--metric %s has a limit of its own; leave out --certify exact",
                         metric_names[build->metric]);
    if (request->mail_error > 0 && !request->for_mail)
        return cli_usage("build",
                         "--error goes with --for mail; the limit of the contraction is --max-error, that of a level "
                         "is chosen later");
    return EXIT_DONE;
}

/* The inputs, and the output, which has the first one's name if it has none. */
static int take_files(struct build_request *request, int argc, char **argv)
{
    if (argc == optind && !cli_operands(&command_build, argc, 1, "the INPUT mesh"))
        return EXIT_USAGE;
    request->input = argv[optind];
    request->series.paths = (const char *const *)(argv + optind);
    request->series.path_count = (uint32_t)(argc - optind);
    if (request->series.path_count > 1 && request->reading.options.time)
        return cli_usage("build", "--time chooses a step of one file, and there are %d files", argc - optind);
    if (!request->output) {
        const char *name = cli_base_name(request->input), *dot = strrchr(name, '.');
        snprintf(request->own_output, sizeof request->own_output, "%.*s.tetlod",
                 (int)(dot && dot != name ? dot - name : (long)strlen(name)), name);
        request->output = request->own_output;
    }
    const char *const inputs[] = {request->input, request->reading.options.solution};
    if (request->show_error >= 0 && !show_is_output(request->output))
        return cli_usage("build", "--show goes with -o OUT.vtkhdf: a .tetlod has all levels, and shows each");
    const char *extension = show_is_output(request->output) ? NULL : "tetlod";
    return cli_check_output_name(&command_build, request->output, extension, inputs, 2);
}

int build_request_parse(struct build_request *out, int argc, char **argv)
{
    *out = (struct build_request){.contract = contract_names[0], .build = build_options_default(), .show_error = -1};
    series_input_init(&out->series);
    for (int option; (option = cli_option(&command_build, argc, argv, "o:", options)) != -1;)
        if (!take_option(out, option, optarg))
            return EXIT_USAGE;
    int result = check_options(out);
    if (result == EXIT_DONE)
        result = take_files(out, argc, argv);
    if (!out->build.threads)
        out->build.threads = parallel_cores();
    if (out->for_mail)
        prepare_mail(out);
    return result;
}
