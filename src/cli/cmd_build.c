/* SPDX-License-Identifier: BSD-3-Clause */
#include <inttypes.h>
#include <jansson.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "format/fail.h"
#include "src/pipeline/build.h"
#include "src/simplify/simplify.h"
#include "src/cli/carry.h"
#include "src/cli/cli.h"
#include "src/cli/mail.h"
#include "src/cli/print_json.h"
#include "src/cli/progress.h"
#include "src/cli/reading.h"
#include "src/cli/series_topologies.h"
#include "src/pipeline/local_bound.h"
#include "src/pipeline/topology_spool.h"
#include "src/io/io.h"
#include "src/mesh/displacement.h"
#include "src/report/info_json.h"
#include "src/report/series_json.h"
#include "src/util/array.h"
#include "src/util/file.h"
#include "src/util/parallel.h"

static const char help[] =
    "usage: tetlod build INPUT... [-o OUT.tetlod] [OPTIONS]\n"
    "\n"
    "Reads a mesh, contracts it and writes the stream of its levels: from a few tetrahedra to the original. A file with several\n"
    "times, or several files, become a series: one mesh, with the --field values of every step. Points may\n"
    "move: how far becomes the field point_displacement, which drives as well. Where the tetrahedra change from one step to the next,\n"
    "a topology group begins: a stream inside the stream, with levels of its own; errors are of the range over all steps.\n"
    "\n"
    "  -o, --output OUT        the stream to write (default: INPUT's name with .tetlod in this folder)\n"
    READING_HELP
    "      --field NAME        a field whose error drives the contraction; NAME:mag for a vector's magnitude (and the vector,\n"
    "                          held so that its length is as exact as that), NAME:0 for a component, NAME:0.01 (or :1%)\n"
    "                          for an error limit of its own, which rounding is inside of; may be given several times\n"
    "                          (default: the first scalar field)\n"
    "      --abs-error E       the error limit of the --field before it, in that field's own units\n"
    "      --carry A,B         the fields to store, at points and of cells (default: all); those of --field and --region always are\n"
    "      --region NAME       values of cells that tell regions, such as materials: where two meet, vertices and faces stay as\n"
    "                          they are at every level (default: integers named region, material or the like); none: no regions\n"
    "      --certify HOW       what holds the error: fast (default), a bound that is carried along; exact, the exact maximum\n"
    "                          over the whole domain: far fewer tetrahedra for the same error, in tens of times the time\n"
    "      --certify-all       a 'max' for every field, also without --field: the exact maximum of every level, measured at the end;\n"
    "                          takes several times as long\n"
    "      --local-bound       a field 'NAME bound' of each --field: how far off it is at most at each point of a level\n"
    "      --metric M          what orders the contractions: envelope (default of fast), the carried bound; field-quadric\n"
    "                          (Cignoni and others; default of exact) or quadric (Garland and Heckbert). Two more are\n"
    "                          also the limit: sva, the accumulated prediction of scalar value assignment; measured,\n"
    "                          the true error at samples ('sampled')\n"
    "      --contract KIND     what is contracted: edge (default), face, tet, or hybrid, all three in one queue\n"
    "      --candidates N      final vertex positions tried on a simplex: its vertices first, then its middle, then more\n"
    "                          between, up to 7 on an edge or a face and 19 on a tetrahedron (default: 3, 4 and 5)\n"
    "      --max-error E       stop at this error, a fraction of the range: 0.1 or 10% (default 1)\n"
    "      --min-tets N        stop at that many tetrahedra\n"
    "      --domain-error E    how far the boundary may move from the original's in all, a fraction of the diagonal\n"
    "                          (default 0.001; exact, measured: at most 0.000001; a series: 0); 0: only planar boundary is simplified\n"
    "      --boundary-angle D  degrees by which boundary faces may turn and still count as one smooth surface; edges that\n"
    "                          turn more are creases, and are kept (default 30)\n"
    "      --growth G          vertices of a level / vertices of the one below (default 1.1)\n"
    "      --position-bits N   round coordinates to N bits across the bounds, 1 .. 30 (default: lossless)\n"
    "      --field-bits N      round values to N bits across the range\n"
    "      --position-error E, --field-error E   as many bits as this error needs: a fraction of the diagonal, of the range\n"
    "                          (rounding is in every error that the stream states)\n"
    "      --times A:B:C       of a series the steps numbered A to B, from 0, every C-th (default: all); --time N: that one step\n"
    "      --bands E,E,...     errors that the steps' values are stored for, fractions of the --range (default\n"
    "                          5%,2%,1%,0.5%,0.2%,0.1%); the exact values are always stored\n"
    "      --range R           series (default): a field's range over all steps; step: each step's own, where it has one\n"
    "      --for mail          one small file to send: rounded, of the --field alone (and --carry), with the levels up to --error\n"
    "      --error E           with --for: the error of the finest level in the file (default 1%)\n"
    "      --keep-order        store the input's numbering too, for tetlod extract --original-order\n"
    "      --compress N        1 fast .. 22 small (default 19): from 20 on the coder's rates of learning are all tried\n"
    "      --threads N         0 (default): all cores; the bytes do not depend on it\n"
    "      --memory BYTES      refuse what needs more; K, M, G may follow. Of a series, fewer steps limit the contraction first\n"
    "      --all               list every level (default: about ten)\n"
    "      --json              print the stream's index, and times and memory, as JSON\n"
    "      --progress, --quiet draw the progress bar in any case; say nothing but errors\n"
    "\n"
    "example: tetlod build bluntfinxyz.bin --q bluntfinq.bin --field Pressure -o blunt.tetlod\n";

enum { MOST_CONTROLS = 64, MOST_NAMES = 6 };

struct request {
    const char *input, *output, *carry, *contract, *region;
    const char *fields[MOST_CONTROLS];
    double units[MOST_CONTROLS]; /* --abs-error of each field; 0: none */
    uint32_t field_count;
    double mail_error; /* of the finest level that is written; 0: all levels are */
    struct build_options build;
    struct reading reading;
    struct series_input series;
    struct series_topologies topologies; /* none: all steps are over one mesh */
    uint64_t nan_filled;
    bool for_mail, json, quiet, all, ordered, moves_boundary; /* ordered: --metric is given; moves_boundary: --domain-error */
    struct progress progress;
    double phase_started;
    enum build_phase phase;
    double seconds[BUILD_PHASES];
};

/* What is built: a mesh, and its controlled fields. */
struct input {
    struct tetmesh mesh;
    struct io_report read;
    struct build_control controls[2 * MOST_CONTROLS + 1]; // a magnitude brings its vector; and how far points move
    uint32_t count;
};

static const char *const phase_names[BUILD_PHASES] = {"contract", "measure", "encode"};

static bool on_progress(void *opaque, enum build_phase phase, double done)
{
    struct request *request = opaque;
    if (phase != request->phase) {
        double now = clock_seconds();
        request->seconds[request->phase] += now - request->phase_started;
        request->phase_started = now;
        request->phase = phase;
    }
    progress_update(&request->progress, phase_names[phase], done);
    return true;
}

/* ---- options */

static const char *const metric_names[] = {[METRIC_ENVELOPE] = "envelope",
                                           [METRIC_SVA] = "sva",
                                           [METRIC_FIELD_QUADRIC] = "field-quadric",
                                           [METRIC_QUADRIC] = "quadric",
                                           [METRIC_MEASURED] = "measured"};

static bool parse_metric(const char *text, enum metric *out)
{
    for (size_t i = 0; i < sizeof metric_names / sizeof *metric_names; i++)
        if (strcmp(text, metric_names[i]) == 0) {
            *out = (enum metric)i;
            return true;
        }
    cli_usage("build", "--metric is one of envelope, sva, field-quadric, quadric, measured, not '%s'", text);
    return false;
}

enum { CERTIFY_ALL = 256, LOCAL_BOUND }; /* options without a letter */

static const char *const certify_names[] = {[CERTIFY_FAST] = "fast", [CERTIFY_EXACT] = "exact"};

static bool parse_certify(const char *text, enum certify *out)
{
    for (size_t i = 0; i < sizeof certify_names / sizeof *certify_names; i++)
        if (strcmp(text, certify_names[i]) == 0) {
            *out = (enum certify)i;
            return true;
        }
    cli_usage("build", "--certify is fast or exact, not '%s'", text);
    return false;
}

static bool parse_contract(const char *text, unsigned *out)
{
    static const struct {
        const char *name;
        unsigned kinds;
    } kinds[] = {{"edge", CONTRACT_EDGES},
                 {"face", CONTRACT_FACES},
                 {"tet", CONTRACT_TETS},
                 {"hybrid", CONTRACT_EDGES | CONTRACT_FACES | CONTRACT_TETS}};
    for (size_t i = 0; i < sizeof kinds / sizeof *kinds; i++)
        if (strcmp(text, kinds[i].name) == 0) {
            *out = kinds[i].kinds;
            return true;
        }
    cli_usage("build", "--contract is one of edge, face, tet, hybrid, not '%s'", text);
    return false;
}

static bool parse_bits(const char *name, const char *text, unsigned *out)
{
    uint64_t bits;
    if (!cli_parse_count(&command_build, name, text, 1, QUANTISE_MOST_BITS, &bits))
        return false;
    *out = (unsigned)bits;
    return true;
}

static bool parse_units(struct request *request, const char *text)
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

static bool parse_purpose(const char *text)
{
    if (strcmp(text, "mail") == 0)
        return true;
    cli_usage("build", "--for takes mail, not '%s'", text);
    return false;
}

static bool parse_option(struct request *request, int option, const char *value)
{
    struct build_options *build = &request->build;
    uint64_t count;
    switch (option) {
    case 'o':
        request->output = value;
        return true;
    case 'f':
        if (request->field_count == MOST_CONTROLS) {
            cli_usage("build", "at most %d --field", MOST_CONTROLS);
            return false;
        }
        request->fields[request->field_count++] = value;
        return true;
    case 'u':
        return parse_units(request, value);
    case 'Y':
        return request->for_mail = parse_purpose(value);
    case 'Z':
        return cli_parse_fraction(&command_build, "error", value, &request->mail_error);
    case 'c':
        request->carry = value;
        return true;
    case 'r':
        request->region = value;
        return true;
    case 'm':
        request->ordered = true;
        return parse_metric(value, &build->metric);
    case 'C':
        return parse_certify(value, &build->certify);
    case CERTIFY_ALL:
        return build->certify_all = true;
    case LOCAL_BOUND:
        return build->local_bound = true;
    case 'k':
        request->contract = value;
        return parse_contract(value, &build->contract);
    case 'n':
        if (!cli_parse_count(&command_build, "candidates", value, 2, MOST_CANDIDATES, &count))
            return false;
        build->candidates = (uint32_t)count;
        return true;
    case 'e':
        return cli_parse_fraction(&command_build, "max-error", value, &build->max_error);
    case 't':
        if (!cli_parse_count(&command_build, "min-tets", value, 1, UINT32_MAX, &count))
            return false;
        build->min_tets = (uint32_t)count;
        return true;
    case 'b':
        return cli_parse_number(&command_build, "boundary-angle", value, 0, &build->boundary_angle);
    case 'd':
        request->moves_boundary = true;
        return cli_parse_fraction(&command_build, "domain-error", value, &build->domain_error);
    case 'g':
        return cli_parse_number(&command_build, "growth", value, 1, &build->growth);
    case 'P':
        return parse_bits("position-bits", value, &build->quantise.position_bits);
    case 'F':
        return parse_bits("field-bits", value, &build->quantise.field_bits);
    case 'p':
        return cli_parse_fraction(&command_build, "position-error", value, &build->quantise.position_error);
    case 'E':
        return cli_parse_fraction(&command_build, "field-error", value, &build->quantise.field_error);
    case 'A':
        return request->all = true;
    case 'T':
        return series_input_parse_times(&request->series, &command_build, value);
    case 'B':
        return series_input_parse_bands(&request->series, &command_build, value);
    case 'R':
        return series_input_parse_range(&request->series, &command_build, value);
    case 'K':
        return build->keep_order = true;
    case 'z':
        if (!cli_parse_count(&command_build, "compress", value, 1, 22, &count))
            return false;
        build->compression = (int)count;
        return true;
    case 'j':
        if (!cli_parse_count(&command_build, "threads", value, 0, 1024, &count))
            return false;
        build->threads = (unsigned)count;
        return true;
    case 'M':
        return cli_parse_count(&command_build, "memory", value, 1, UINT64_MAX, &build->memory);
    default:
        return reading_option(&request->reading, &command_build, option, value);
    }
}

/* ---- fields */

static enum tetlod_status choose_fields(const struct request *request, struct tetmesh *mesh,
                                        struct build_control *controls, uint32_t *count, struct tetlod_error *error)
{
    TETLOD_TRY(build_controls_parse(mesh, request->fields, request->units, request->field_count, controls, count, error));
    if (request->carry)
        TETLOD_TRY(carry_only(mesh, request->carry, request->region, controls, *count, error));
    build_controls_add_vectors(mesh, controls, count);
    return TETLOD_OK;
}

/* ---- the build */

/* Adds the units of fields, where the file says them, to an object of units by name. */
static void add_units(json_t *units, const struct point_field *fields, uint32_t count)
{
    for (uint32_t f = 0; f < count; f++)
        if (fields[f].unit[0])
            json_object_set_new(units, fields[f].name, json_string(fields[f].unit));
}

/* The same of its local bound. */
static void add_bound_unit(json_t *units, const struct point_field *field)
{
    char *name = field->unit[0] ? local_bound_name(field->name) : NULL;
    if (name)
        json_object_set_new(units, name, json_string(field->unit));
    free(name);
}

/* Units, and provenance: what made the stream out of what. Machine and moment are left out, so that bytes repeat. */
static char *make_metadata(const struct request *request, const struct tetmesh *mesh,
                           const struct build_control *controls, uint32_t count)
{
    const struct build_options *build = &request->build;
    json_t *fields = json_array(), *object = NULL;
    for (uint32_t i = 0; i < count && fields; i++)
        json_array_append_new(fields, json_string(mesh->fields[controls[i].field].name));
    object = json_pack("{s:s, s:s, s:{s:o, s:s, s:s, s:s, s:i, s:f, s:i, s:f, s:f, s:f}}", "program", "tetlod " TETLOD_VERSION_STRING,
                       "input", cli_base_name(request->input), "options", "field", fields, "metric",
                       metric_names[build->metric], "certify", certify_names[build->certify], "contract", request->contract, "candidates", (int)build->candidates,
                       "max_error", build->max_error, "min_tets", (int)build->min_tets, "boundary_angle",
                       build->boundary_angle, "domain_error", build->domain_error, "growth", build->growth);
    if (object && build->series && build->series->own_ranges)
        json_object_set_new(json_object_get(object, "options"), SERIES_RANGE, json_string("step"));
    if (object && build->regions)
        json_object_set_new(json_object_get(object, "options"), "region", json_string(build->regions));
    if (object && request->reading.options.nan_fill) {
        json_t *fill = request->reading.fill.kind == NAN_FILL_VALUE ? json_real(request->reading.fill.value) : json_string("neighbours");
        json_object_set_new(json_object_get(object, "options"), "nan_fill", fill);
        json_object_set_new(object, "nan_filled", json_integer((json_int_t)request->nan_filled));
    }
    json_t *units = json_object();
    add_units(units, mesh->cell_fields, mesh->cell_field_count);
    add_units(units, mesh->fields, mesh->field_count);
    for (uint32_t i = 0; i < count && build->local_bound; i++)
        add_bound_unit(units, &mesh->fields[controls[i].field]);
    if (object && json_object_size(units))
        json_object_set(object, "units", units);
    json_decref(units);
    char *text = object ? json_dumps(object, JSON_COMPACT | JSON_PRESERVE_ORDER | JSON_REAL_PRECISION(17)) : NULL;
    json_decref(object);
    return text;
}

static enum tetlod_status write_stream(struct request *request, const struct input *in, const struct tetlodi_sink *sink,
                                       struct build_report *report, struct tetlod_error *error)
{
    struct build_options *options = &request->build;
    char *metadata = make_metadata(request, &in->mesh, in->controls, in->count);
    if (!metadata)
        return tetlodi_fail_nomem(error, "the metadata", 1024);
    options->controls = in->controls;
    options->control_count = in->count;
    options->metadata = metadata;
    options->progress = on_progress;
    options->progress_opaque = request;
    request->phase = BUILD_CONTRACT;
    request->phase_started = clock_seconds();
    enum tetlod_status status = build_stream(&in->mesh, options, sink, report, error);
    request->seconds[request->phase] += clock_seconds() - request->phase_started;
    progress_end(&request->progress);
    free(metadata);
    return status;
}

static enum tetlod_status build_file(struct request *request, const struct input *in, struct build_report *report,
                                     double *write_seconds, struct tetlod_error *error)
{
    struct file_output *output;
    struct tetlodi_buffer whole = {0};
    TETLOD_TRY(file_output_open(&output, request->output, error));
    const struct tetlodi_sink file = file_output_sink(output), sink = request->for_mail ? mail_sink(&whole) : file;
    enum tetlod_status status = write_stream(request, in, &sink, report, error);
    double encoded = clock_seconds();
    if (status == TETLOD_OK && request->for_mail)
        status = mail_write(&whole, request->mail_error, &file, error);
    status = file_output_finish(output, status, error);
    *write_seconds = clock_seconds() - encoded;
    tetlodi_buffer_fini(&whole);
    return status;
}

/* The most memory so far, in bytes. What getrusage says may be the peak of the process that started this one. */
static uint64_t peak_memory(void)
{
    static const char name[] = "VmHWM:";
    uint64_t peak = 0; // kB
    char line[256];
    FILE *status = fopen("/proc/self/status", "r");
    while (status && fgets(line, sizeof line, status))
        if (strncmp(line, name, sizeof name - 1) == 0)
            peak = strtoull(line + sizeof name - 1, NULL, 10);
    if (status)
        fclose(status);
    return peak << 10;
}

static int print_json(const struct request *request, const struct build_report *report, double read_seconds,
                      double write_seconds)
{
    struct tetlod_file *file;
    struct tetlod_error error = {0};
    int fd;
    char id[256];
    if (cli_open_stream(request->output, 1, &file, &fd, &error) != TETLOD_OK)
        return cli_fail(&error);
    stream_id(request->output, id, sizeof id);
    uint64_t peak = peak_memory();
    json_t *object = info_json(tetlod_info(file), id);
    json_t *seconds = json_pack("{s:f, s:f, s:f, s:f, s:f}", "read", read_seconds, "contract",
                                request->seconds[BUILD_CONTRACT], "measure", request->seconds[BUILD_MEASURE], "encode",
                                request->seconds[BUILD_ENCODE], "write", write_seconds);
    json_t *refused = json_pack("{s:I, s:I, s:I, s:I, s:I}", "flip", (json_int_t)report->refused[LOG_REFUSED_FLIP], "link",
                                (json_int_t)report->refused[LOG_REFUSED_LINK], "boundary",
                                (json_int_t)report->refused[LOG_REFUSED_BOUNDARY], "rounding",
                                (json_int_t)report->refused[LOG_REFUSED_ROUNDING], "size",
                                (json_int_t)report->refused[LOG_REFUSED_SIZE]);
    json_t *more = json_pack("{s:o, s:o, s:I, s:I, s:I, s:f, s:i}", "seconds", seconds, "refused", refused, "contractions",
                             (json_int_t)report->contractions,
                             "nan_filled", (json_int_t)request->nan_filled,
                             "peak_memory", (json_int_t)peak, "bytes_per_tetrahedron",
                             (double)peak / (double)tetlod_info(file)->tets, "threads", (int)request->build.threads);
    if (object && (!more || json_object_update(object, more) != 0)) {
        json_decref(object);
        object = NULL;
    }
    json_decref(more);
    tetlod_close(file);
    close(fd);
    return cli_print_json(object);
}

/* Whose error is held, where nobody said so, and which fields are off by what comes. */
static void say_fields(const struct request *request, const struct tetmesh *mesh, const struct build_control *controls, uint32_t count)
{
    if (!request->field_count)
        fprintf(stderr, "tetlod build: no --field is given: the error of '%s' is held down\n", mesh->fields[controls[0].field].name);
    char names[300] = "";
    size_t used = 0;
    uint32_t others = 0;
    for (uint32_t f = 0; f < mesh->field_count; f++) {
        bool controlled = false;
        for (uint32_t i = 0; i < count; i++)
            controlled |= controls[i].field == f;
        if (!controlled && others++ < MOST_NAMES && used < sizeof names)
            used += (size_t)snprintf(names + used, sizeof names - used, "%s%.40s", others > 1 ? ", " : "", mesh->fields[f].name);
    }
    if (others)
        fprintf(stderr, "tetlod build: %" PRIu32 " field%s measured, nothing holds it down: %s%s\n", others,
                others == 1 ? " is not controlled: its error is" : "s are not controlled: their error is", names, others > MOST_NAMES ? ", ..." : "");
}

static void say(const struct request *request, const struct io_report *read, const struct tetmesh *mesh,
                const struct build_report *report)
{
    struct io_report notes_read = *read;
    if (request->build.series)
        notes_read.steps = 0; // all of them were read
    reading_notes("build", &notes_read, mesh);
    const struct {
        uint64_t count;
        const char *what;
    } notes[] = {{report->degenerate_tets, "degenerate tetrahedra, carried along; no promise is made inside them"},
                 {report->inverted_tets, "inverted tetrahedra, carried along; no promise is made inside them"},
                 {report->folded_tets, "folded tetrahedra, on the same side of a face as their neighbour, carried along; no promise "
                                       "is made inside them"}};
    for (size_t i = 0; i < sizeof notes / sizeof *notes; i++)
        if (notes[i].count)
            fprintf(stderr, "tetlod build: %" PRIu64 " %s\n", notes[i].count, notes[i].what);
    for (uint32_t g = 0; g < request->topologies.count; g++)
        fprintf(stderr, "tetlod build: topology group %" PRIu32 ": steps %" PRIu32 " to %" PRIu32 " over %" PRIu32 " tetrahedra\n", g,
                request->topologies.groups[g].from, request->topologies.groups[g].from + request->topologies.groups[g].count - 1,
                request->topologies.groups[g].tets);
    if (request->series.own_times)
        fprintf(stderr, "tetlod build: the steps' times do not rise: their numbers stand for them\n");
    if (request->build.series)
        fprintf(stderr, "tetlod build: %s%" PRIu32 " steps in time, of which %" PRIu32 " limit the contraction; fields that are not controlled are those of the first step\n",
                request->topologies.count ? "of topology group 0 " : "", request->build.series->step_count, report->keys);
    if (request->series.series.points_move)
        fprintf(stderr, "tetlod build: the points move: '" DISPLACEMENT_FIELD "' says how far and drives as the other fields do; all errors are "
                        "those at the same point of the body, proved on the mesh of the first step\n");
    if (request->series.rounded)
        fprintf(stderr, "tetlod build: %" PRIu64 " coordinates of points that move come back to the last place only, not bit for bit\n",
                request->series.rounded);
    fprintf(stderr, "tetlod build: %s: %s%" PRIu32 " vertices, %" PRIu32 " tetrahedra in %" PRIu32 " levels\n",
            request->output, request->for_mail ? "the coarse levels of " : "", mesh->vertex_count, mesh->tet_count, report->levels);
}

/* The levels, and what the file promises of every field. */
static int print_text(const struct request *request)
{
    struct tetlod_file *file;
    struct tetlod_error error = {0};
    int fd;
    if (cli_open_stream(request->output, 1, &file, &fd, &error) != TETLOD_OK)
        return cli_fail(&error);
    cli_print_levels(tetlod_info(file), request->all);
    if (request->for_mail)
        cli_print_promises(stdout, tetlod_info(file), tetlod_info(file)->level_count - 1);
    tetlod_close(file);
    close(fd);
    return EXIT_DONE;
}

/* Is it a series? Then --time has not chosen one step of it. */
static bool is_series(const struct request *request, const struct io_report *read)
{
    return !request->reading.options.time && (request->series.path_count > 1 || read->steps > 1);
}

/* The mesh, or a series' first step. */
static enum tetlod_status read_first(struct request *request, struct tetmesh *mesh, struct io_report *read, struct tetlod_error *error)
{
    const struct series_input *series = &request->series;
    if (request->reading.options.time)
        return io_read(mesh, request->input, &request->reading.options, read, error);
    if (series->from)
        return series_input_read(series, series_input_number(series, 0), &request->reading, mesh, read, error);
    TETLOD_TRY(series_input_read(series, 0, &request->reading, mesh, read, error));
    uint64_t steps = series->path_count > 1 ? series->path_count : read->steps;
    if (steps < 2 || series->begin == 0)
        return TETLOD_OK;
    tetmesh_fini(mesh);
    if (series->begin >= steps)
        return tetlodi_fail(error, TETLOD_ERR_MESH, "%s: has %" PRIu64 " steps in time, 0 to %" PRIu64 ": --times begins behind them", request->input,
                            steps, steps - 1);
    return series_input_read(series, series->begin, &request->reading, mesh, read, error);
}

/* Why a series cannot be built with these options, or NULL. */
static const char *against_series(const struct request *request)
{
    const struct build_options *build = &request->build;
    if (build->metric != METRIC_ENVELOPE || build->certify != CERTIFY_FAST || build->contract != CONTRACT_EDGES || build->candidates)
        return "--metric, --certify exact, --contract or --candidates";
    if (quantise_wanted(&build->quantise) || request->for_mail)
        return "rounding (--position-bits, --field-bits, --for mail and the like)";
    if (request->moves_boundary && build->domain_error > 0)
        return "--domain-error: it keeps its boundary";
    return build->certify_all ? "--certify-all" : build->local_bound ? "--local-bound" : NULL;
}

static enum tetlod_status load_series(struct request *request, struct input *in, struct tetlod_error *error)
{
    const char *wrong = against_series(request);
    struct series_input *series = &request->series;
    if (wrong && series->path_count > 1)
        return tetlodi_fail(error, TETLOD_ERR_ARGUMENT,
                            "%.60s is a second step in time, and a series cannot be built with %s (--json, --all and --quiet take no value)",
                            cli_base_name(series->paths[1]), wrong);
    if (wrong)
        return tetlodi_fail(error, TETLOD_ERR_ARGUMENT, "it has several steps in time, and a series cannot be built with %s; --time N builds one step",
                            wrong);
    TETLOD_TRY(series_input_count(series, series->path_count > 1 ? series->path_count : in->read.steps, error));
    TETLOD_TRY(series_input_load(series, &request->reading, &in->mesh, in->controls, &in->count, &request->progress, error));
    request->build.series = &series->series;
    request->build.domain_error = 0; // a step's error is then one at the same position (PROOF.md, 5)
    return TETLOD_OK;
}

/* The mesh, or what there is of the series from the step on that is at hand, with what is controlled. */
static enum tetlod_status prepare(struct request *request, struct input *in, struct tetlod_error *error)
{
    struct tetlod_error inner = {0};
    *in = (struct input){0};
    TETLOD_TRY(read_first(request, &in->mesh, &in->read, error));
    request->nan_filled += in->read.nan_filled;
    enum tetlod_status status = choose_fields(request, &in->mesh, in->controls, &in->count, &inner);
    if (status == TETLOD_OK)
        status = build_regions_choose(&in->mesh, request->region, &request->build.regions, &inner);
    if (status == TETLOD_OK && is_series(request, &in->read))
        status = load_series(request, in, &inner);
    return status == TETLOD_OK ? status : tetlodi_fail(error, status, "%s: %.200s", request->input, inner.message);
}

static void release(struct request *request, struct input *in)
{
    series_input_fini(&request->series);
    tetmesh_fini(&in->mesh);
}

/* ---- steps over several meshes */

/* The same fields in the same order in every group: their ranges are common. */
static enum tetlod_status check_controls(const struct input *in, const char *const *names, uint32_t count, struct tetlod_error *error)
{
    for (uint32_t c = 0; c < count; c++)
        if (c >= in->count || strcmp(in->mesh.fields[in->controls[c].field].name, names[c]) != 0)
            return tetlodi_fail(error, TETLOD_ERR_FIELD, "its first field is not '%.60s', as in the first step; --field names the ones to be controlled", names[c]);
    return TETLOD_OK;
}

static enum tetlod_status build_topology(struct request *request, struct topology_spool *spool, uint32_t group, const char *const *names,
                                         uint32_t count, struct tetlod_error *error)
{
    const struct series_topology *topology = &request->topologies.groups[group];
    const struct tetlodi_sink sink = topology_spool_sink(spool);
    struct input in;
    struct build_report report;
    struct tetlod_error inner = {0};
    request->series.from = topology->from;
    enum tetlod_status status = prepare(request, &in, error);
    if (status == TETLOD_OK) {
        status = check_controls(&in, names, count, &inner);
        if (status == TETLOD_OK)
            status = write_stream(request, &in, &sink, &report, &inner);
        if (status == TETLOD_OK)
            status = topology_spool_note(spool, group, topology->count, request->topologies.times + topology->from, &inner);
        if (status != TETLOD_OK)
            series_input_blame(&request->series, series_input_number(&request->series, 0), status, &inner, error);
    }
    release(request, &in);
    return status;
}

static enum tetlod_status build_rest(struct request *request, struct topology_spool *spool, const char *const *names, uint32_t count,
                                     struct tetlod_error *error)
{
    const struct series_topologies *topologies = &request->topologies;
    request->series.series.ranges = (const double(*)[2])topologies->ranges;
    TETLOD_TRY(topology_spool_init(spool, topologies->count, error));
    TETLOD_TRY(topology_spool_note(spool, 0, topologies->groups[0].count, topologies->times, error));
    for (uint32_t g = 1; g < topologies->count; g++)
        TETLOD_TRY(build_topology(request, spool, g, names, count, error));
    TETLOD_TRY(topology_spool_sections(spool, error));
    request->build.sections = spool->sections;
    request->build.section_count = sizeof spool->sections / sizeof *spool->sections;
    return TETLOD_OK;
}

/* Steps behind those of `in` are over other meshes: they become streams, which go into the one of the first steps. */
static enum tetlod_status build_topologies(struct request *request, struct input *in, struct topology_spool *spool, struct tetlod_error *error)
{
    uint32_t count = in->count - request->series.series.points_move;
    char *copies[2 * MOST_CONTROLS + 1];
    bool room = true;
    for (uint32_t c = 0; c < count; c++)
        room &= (copies[c] = strdup(in->mesh.fields[in->controls[c].field].name)) != NULL;
    release(request, in);
    const char *const *names = (const char *const *)copies;
    enum tetlod_status status = room ? TETLOD_OK : tetlodi_fail_nomem(error, "the fields' names", count * sizeof *copies);
    if (status == TETLOD_OK)
        status = series_topologies_find(&request->topologies, &request->series, &request->reading, names, count, &request->progress, error);
    if (status == TETLOD_OK)
        status = build_rest(request, spool, names, count, error);
    request->series.from = 0;
    request->nan_filled = 0;
    for (uint32_t c = 0; c < count; c++)
        free(copies[c]);
    return status == TETLOD_OK ? prepare(request, in, error) : status;
}

static int build(struct request *request)
{
    struct tetlod_error error = {0}, inner = {0};
    struct build_report report = {0};
    struct input in;
    struct topology_spool spool = {0};
    double started = clock_seconds(), read_seconds, write_seconds = 0;
    enum tetlod_status status = prepare(request, &in, &error);
    if (status == TETLOD_OK && request->build.series && series_input_goes_on(&request->series))
        status = build_topologies(request, &in, &spool, &error);
    read_seconds = clock_seconds() - started;
    if (status == TETLOD_OK) {
        status = build_file(request, &in, &report, &write_seconds, &inner);
        bool named = status == TETLOD_ERR_IO; // the output's path is in it already
        if (status != TETLOD_OK)
            tetlodi_fail(&error, status, "%s%s%.200s", named ? "" : request->input, named ? "" : ": ", inner.message);
    }
    int result = status == TETLOD_OK ? EXIT_DONE : cli_fail(&error);
    if (status == TETLOD_OK && !request->quiet) {
        say_fields(request, &in.mesh, in.controls, in.count);
        say(request, &in.read, &in.mesh, &report);
    }
    if (status == TETLOD_OK && request->json)
        result = print_json(request, &report, read_seconds, write_seconds);
    else if (status == TETLOD_OK && !request->quiet)
        result = print_text(request);
    topology_spool_fini(&spool);
    series_topologies_fini(&request->topologies);
    release(request, &in);
    return result;
}

/* What the user did not choose is chosen for a small file. */
static void prepare_mail(struct request *request)
{
    request->mail_error = request->mail_error > 0 ? request->mail_error : MAIL_ERROR;
    request->carry = request->carry ? request->carry : "";
    mail_round(&request->build.quantise, request->mail_error);
}

static int run(int argc, char **argv)
{
    enum { JSON = LOCAL_BOUND + 1, PROGRESS, QUIET };
    static const struct option options[] = {
        {"output", required_argument, NULL, 'o'},     READING_OPTIONS,
        {"field", required_argument, NULL, 'f'},      {"carry", required_argument, NULL, 'c'},
        {"region", required_argument, NULL, 'r'},
        {"metric", required_argument, NULL, 'm'},     {"contract", required_argument, NULL, 'k'},
        {"certify", required_argument, NULL, 'C'},    {"certify-all", no_argument, NULL, CERTIFY_ALL},
        {"local-bound", no_argument, NULL, LOCAL_BOUND},
        {"candidates", required_argument, NULL, 'n'},
        {"max-error", required_argument, NULL, 'e'},  {"min-tets", required_argument, NULL, 't'},
        {"boundary-angle", required_argument, NULL, 'b'}, {"domain-error", required_argument, NULL, 'd'},
        {"growth", required_argument, NULL, 'g'},
        {"position-bits", required_argument, NULL, 'P'}, {"field-bits", required_argument, NULL, 'F'},
        {"position-error", required_argument, NULL, 'p'}, {"field-error", required_argument, NULL, 'E'},
        {"keep-order", no_argument, NULL, 'K'},        {"compress", required_argument, NULL, 'z'},
        {"threads", required_argument, NULL, 'j'},
        {"abs-error", required_argument, NULL, 'u'},  {"for", required_argument, NULL, 'Y'},
        {"error", required_argument, NULL, 'Z'},      {"all", no_argument, NULL, 'A'},
        {"times", required_argument, NULL, 'T'},      {"bands", required_argument, NULL, 'B'},
        {"range", required_argument, NULL, 'R'},
        {"memory", required_argument, NULL, 'M'},     {"json", no_argument, NULL, JSON},
        {"progress", no_argument, NULL, PROGRESS},    {"quiet", no_argument, NULL, QUIET},
        {0}};
    struct request request = {.contract = "edge", .build = build_options_default()};
    bool forced = false;
    series_input_init(&request.series);
    for (int option; (option = cli_option(&command_build, argc, argv, "o:", options)) != -1;) {
        request.json |= option == JSON;
        request.quiet |= option == QUIET;
        forced |= option == PROGRESS;
        if ((option < JSON || option >= READING_FIRST) && !parse_option(&request, option, optarg))
            return EXIT_USAGE;
    }
    struct build_range bad;
    if (build_options_out_of_range(&request.build, &bad))
        return cli_usage("build", "--%s is %g to %g, not %g", bad.option, bad.least, bad.most, bad.value);
    if (argc == optind && !cli_operands(&command_build, argc, 1, "the INPUT mesh"))
        return EXIT_USAGE;
    request.series.paths = (const char *const *)(argv + optind);
    request.series.path_count = (uint32_t)(argc - optind);
    if (request.series.path_count > 1 && request.reading.options.time)
        return cli_usage("build", "--time chooses a step of one file, and there are %d files", argc - optind);
    if (request.build.certify == CERTIFY_EXACT && !request.ordered)
        request.build.metric = METRIC_FIELD_QUADRIC;
    if (request.build.certify == CERTIFY_EXACT && !metric_is_certified(request.build.metric))
        return cli_usage("build", "--metric %s has a limit of its own; leave out --certify exact",
                         metric_names[request.build.metric]);
    char output[4096];
    request.input = argv[optind];
    if (!request.build.threads)
        request.build.threads = parallel_cores();
    if (!request.output) {
        const char *name = cli_base_name(request.input), *dot = strrchr(name, '.');
        snprintf(output, sizeof output, "%.*s.tetlod", (int)(dot && dot != name ? dot - name : (long)strlen(name)), name);
        request.output = output;
    }
    if (!cli_check_output(&command_build, request.output, "tetlod", (const char *const[]){request.input, request.reading.options.solution}, 2))
        return EXIT_USAGE;
    if (request.mail_error > 0 && !request.for_mail)
        return cli_usage("build", "--error goes with --for mail; the limit of the contraction is --max-error, that of a level is chosen later");
    if (request.for_mail)
        prepare_mail(&request);
    progress_init(&request.progress, forced, request.quiet);
    return build(&request);
}

const struct command command_build = {"build", "read a mesh, contract it, write the stream of its levels", help, run};
