/* SPDX-License-Identifier: BSD-3-Clause */
#include <jansson.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "format/fail.h"
#include "src/build/build.h"
#include "src/build/measure.h"
#include "src/build/same.h"
#include "src/cli/cli.h"
#include "src/cli/progress.h"
#include "src/io/io.h"
#include "src/mesh/mesh_check.h"
#include "src/report/info_json.h"
#include "src/report/level_mesh.h"
#include "src/util/array.h"
#include "src/util/parallel.h"

static const char help[] =
    "usage: tetlod verify FILE.tetlod [--against INPUT [--q SOLUTION]] [--json]\n"
    "\n"
    "Decodes a stream whole: checks every checksum, replays all records and undoes them again, checks every level's mesh.\n"
    "\n"
    "      --against INPUT  also: the finest level is this mesh exactly, and the errors stored are the true ones\n"
    "      --q SOLUTION     the solution file of a PLOT3D grid\n"
    "      --threads N      0 (default): all cores\n"
    "      --json           the result as JSON\n"
    "      --progress, --quiet\n"
    "\n"
    "Exit status 0: all is well; 3: the message says what is not, and which levels can be read.\n";

struct request {
    const char *stream, *against, *solution;
    unsigned threads;
    bool json;
    struct progress progress;
};

struct verification {
    struct request *request;
    struct tetlod_file *file;
    struct tetlod_cursor *cursor;
    uint64_t *hashes; /* [level] of the arrays on the way up */
    struct mesh_report finest;
    struct tetlod_error *error;
};

static uint64_t hash_bytes(uint64_t hash, const void *bytes, size_t size)
{
    const uint64_t *words = bytes; // double and pairs of uint32_t: whole words
    for (size_t i = 0; i < size / 8; i++)
        hash = (hash ^ words[i]) * 0x9e3779b97f4a7c15u ^ hash >> 29;
    return hash;
}

static uint64_t hash_mesh(const struct verification *v)
{
    const struct tetlod_info *info = tetlod_info(v->file);
    struct tetlod_mesh mesh;
    tetlod_cursor_mesh(v->cursor, &mesh);
    uint64_t hash = hash_bytes(mesh.vertices, mesh.positions, (size_t)mesh.vertices * 24);
    hash = hash_bytes(hash, mesh.corners, (size_t)mesh.tets * 16);
    for (uint32_t f = 0; f < info->field_count; f++)
        hash = hash_bytes(hash, mesh.fields[f], (size_t)mesh.vertices * info->fields[f].components * 8);
    return hash;
}

static enum tetlod_status report_level(const struct verification *v, struct mesh_report *out)
{
    struct tetlod_mesh mesh;
    tetlod_cursor_mesh(v->cursor, &mesh);
    return mesh_check(mesh.positions, mesh.corners, mesh.vertices, mesh.tets, out, v->error);
}

/* What the original does not have, no level may have. */
static enum tetlod_status check_level(const struct verification *v, uint32_t level)
{
    struct mesh_report now;
    const struct mesh_report *original = &v->finest;
    TETLOD_TRY(report_level(v, &now));
    const struct {
        const char *what;
        uint64_t now, original;
        bool exactly;
    } counts[] = {{"inverted tetrahedra", now.inverted_tets, original->inverted_tets, false},
                  {"degenerate tetrahedra", now.degenerate_tets, original->degenerate_tets, false},
                  {"duplicate tetrahedra", now.duplicate_tets, original->duplicate_tets, false},
                  {"faces of more than two tetrahedra", now.overfull_faces, original->overfull_faces, false},
                  {"vertices that are no manifold points", now.singular_vertices, original->singular_vertices, false},
                  {"components", now.components, original->components, true},
                  {"boundary components", now.boundary_components, original->boundary_components, true},
                  {"as Euler characteristic", (uint64_t)now.euler, (uint64_t)original->euler, true}};
    for (size_t i = 0; i < sizeof counts / sizeof *counts; i++)
        if (counts[i].exactly ? counts[i].now != counts[i].original : counts[i].now > counts[i].original)
            return tetlodi_fail(v->error, TETLOD_ERR_MESH, "level %u has %lld %s, the original %lld", level,
                                (long long)counts[i].now, counts[i].what, (long long)counts[i].original);
    return TETLOD_OK;
}

static void progress(const struct verification *v, const char *phase, double done)
{
    progress_update(&v->request->progress, phase, done);
}

static enum tetlod_status replay(struct verification *v)
{
    uint32_t levels = tetlod_info(v->file)->level_count;
    for (uint32_t k = 0; k < levels; k++) {
        enum tetlod_status status = tetlod_cursor_seek(v->cursor, k, v->error);
        if (status != TETLOD_OK) {
            struct tetlod_error inner = *v->error;
            tetlodi_fail(v->error, status, "%.160s; %u of %u levels can be read", inner.message, k, levels);
            return status;
        }
        v->hashes[k] = hash_mesh(v);
        progress(v, "replay", (k + 1.0) / levels);
    }
    return report_level(v, &v->finest);
}

static enum tetlod_status undo(struct verification *v)
{
    uint32_t levels = tetlod_info(v->file)->level_count;
    struct tetlod_mesh mesh;
    for (uint32_t k = levels; k-- > 0;) {
        const struct tetlod_level *level = &tetlod_info(v->file)->levels[k];
        for (tetlod_cursor_mesh(v->cursor, &mesh); mesh.vertices > level->vertices; tetlod_cursor_mesh(v->cursor, &mesh))
            TETLOD_TRY(tetlod_cursor_coarsen(v->cursor, v->error));
        if (mesh.vertices != level->vertices || hash_mesh(v) != v->hashes[k])
            return tetlodi_fail(v->error, TETLOD_ERR_STREAM, "undoing the records does not lead back to level %u", k);
        TETLOD_TRY(check_level(v, k));
        progress(v, "undo", 1 - (double)k / levels);
    }
    return TETLOD_OK;
}

/* ---- against the input */

/* Fields that the build derived are not in the input: derived again. */
static enum tetlod_status derive_fields(const struct tetlod_info *info, struct tetmesh *input, struct tetlod_error *error)
{
    for (uint32_t f = 0; f < info->field_count; f++) {
        struct build_control ignored;
        if (tetmesh_find_field(input, info->fields[f].name) == TETLOD_NONE)
            TETLOD_TRY(build_control_parse(input, info->fields[f].name, &ignored, error));
    }
    return TETLOD_OK;
}

/* Two ways of measuring differ by the rounding of positions, which is that of the largest coordinate; a mean also where the
 * original has several values, of which the build knows the right one and we take the nearest. */
static bool honest(const struct tetlod_info *info, double stored, double measured, enum tetlod_measure measure)
{
    double largest = 0, smallest_side = INFINITY;
    for (int d = 0; d < 3; d++) {
        largest = fmax(largest, fmax(fabs(info->bounds[0][d]), fabs(info->bounds[1][d])));
        smallest_side = fmin(smallest_side, info->bounds[1][d] - info->bounds[0][d]);
    }
    double rounding = smallest_side > 0 ? 1e-12 * largest / smallest_side : 0;
    return measured <= stored * (measure == TETLOD_RMS ? 1 + 1e-3 : 1 + 1e-6) + 1e-9 + rounding;
}

static enum tetlod_status check_errors(const struct verification *v, struct measure *measure, double diagonal,
                                       uint32_t level, const struct tetmesh *mesh, const uint32_t *fields,
                                       struct measured *measured)
{
    const struct tetlod_info *info = tetlod_info(v->file);
    double domain;
    TETLOD_TRY(measure_mesh(measure, mesh, fields, v->request->threads, measured, &domain, v->error));
    if (!honest(info, info->levels[level].domain_error, diagonal > 0 ? domain / diagonal : 0, TETLOD_MAX))
        return tetlodi_fail(v->error, TETLOD_ERR_MISMATCH, "level %u: its domain error is %g, stored is %g", level,
                            domain / diagonal, info->levels[level].domain_error);
    for (uint32_t f = 0; f < info->field_count; f++) {
        const double *range = info->fields[f].range, *errors = info->levels[level].errors + f * TETLOD_MEASURES;
        double scale = range[1] > range[0] ? 1 / (range[1] - range[0]) : 0;
        const double now[2] = {measured[f].sampled * scale, measured[f].rms * scale};
        for (int i = 0; i < 2; i++)
            if (!honest(info, errors[TETLOD_SAMPLED + i], now[i], (enum tetlod_measure)(TETLOD_SAMPLED + i)))
                return tetlodi_fail(v->error, TETLOD_ERR_MISMATCH, "level %u, %.60s: its %s error is %g, stored is %g",
                                    level, info->fields[f].name,
                                    tetlod_measure_name((enum tetlod_measure)(TETLOD_SAMPLED + i)), now[i],
                                    errors[TETLOD_SAMPLED + i]);
        if (!isnan(errors[TETLOD_MAX]) && !honest(info, errors[TETLOD_MAX], now[0], TETLOD_MAX))
            return tetlodi_fail(v->error, TETLOD_ERR_MISMATCH, "level %u, %.60s: certified is %g, but measured is %g",
                                level, info->fields[f].name, errors[TETLOD_MAX], now[0]);
    }
    return TETLOD_OK;
}

static enum tetlod_status compare_levels(const struct verification *v, const struct tetmesh *input)
{
    const struct tetlod_info *info = tetlod_info(v->file);
    uint32_t *fields = array_new(info->field_count, 2 * sizeof *fields);
    struct measured *measured = array_new(info->field_count, sizeof *measured);
    enum tetlod_status status = TETLOD_OK;
    if (!fields || !measured)
        status = tetlodi_fail_nomem(v->error, "the fields", info->field_count * sizeof *measured);
    for (uint32_t f = 0; f < info->field_count && status == TETLOD_OK; f++) {
        fields[f] = tetmesh_find_field(input, info->fields[f].name);
        fields[info->field_count + f] = f;
    }
    struct measure *measure = NULL;
    if (status == TETLOD_OK)
        status = measure_new(&measure, input, fields, info->field_count, v->error);
    for (uint32_t k = info->level_count; k-- > 0 && status == TETLOD_OK;) {
        struct tetmesh mesh = {0};
        status = tetlod_cursor_seek(v->cursor, k, v->error);
        if (status == TETLOD_OK)
            status = level_mesh_copy(info, v->cursor, &mesh, v->error);
        if (status == TETLOD_OK && k == info->level_count - 1 && info->lossless)
            status = mesh_same(input, &mesh, v->error);
        if (status == TETLOD_OK)
            status = check_errors(v, measure, mesh_diagonal(input), k, &mesh, fields + info->field_count, measured);
        tetmesh_fini(&mesh);
        progress(v, "compare", 1 - (double)k / info->level_count);
    }
    measure_free(measure);
    free(fields);
    free(measured);
    return status;
}

static enum tetlod_status verify_against(struct verification *v)
{
    struct tetmesh input;
    struct io_read_options options = {.solution = v->request->solution};
    TETLOD_TRY(io_read(&input, v->request->against, &options, NULL, v->error));
    enum tetlod_status status = derive_fields(tetlod_info(v->file), &input, v->error);
    if (status == TETLOD_OK)
        status = tetlod_cursor_seek(v->cursor, tetlod_info(v->file)->level_count - 1, v->error);
    if (status == TETLOD_OK)
        status = compare_levels(v, &input);
    tetmesh_fini(&input);
    return status;
}

static enum tetlod_status verify_file(struct verification *v)
{
    enum tetlod_status status;
    v->hashes = array_new(tetlod_info(v->file)->level_count, sizeof *v->hashes);
    if (!v->hashes)
        TETLOD_TRY_DONE(tetlodi_fail_nomem(v->error, "the levels", tetlod_info(v->file)->level_count * 8));
    TETLOD_TRY_DONE(tetlod_cursor_new(&v->cursor, v->file, NULL, 0, v->error));
    TETLOD_TRY_DONE(replay(v));
    TETLOD_TRY_DONE(undo(v));
    if (v->request->against)
        TETLOD_TRY_DONE(verify_against(v));
done:
    tetlod_cursor_free(v->cursor);
    free(v->hashes);
    return status;
}

static int print_result(const struct request *request, enum tetlod_status status, const struct tetlod_error *error)
{
    if (!request->json)
        return status == TETLOD_OK ? (printf("%s: ok\n", request->stream), EXIT_DONE) : cli_fail(error);
    json_t *object = json_pack("{s:s, s:b, s:s}", "file", request->stream, "ok", status == TETLOD_OK, "message",
                               status == TETLOD_OK ? "" : error->message);
    char *text = object ? json_dumps(object, INFO_JSON_FLAGS) : NULL;
    if (text)
        puts(text);
    free(text);
    json_decref(object);
    return status == TETLOD_OK && text ? EXIT_DONE : cli_fail(error);
}

static int verify(struct request *request)
{
    struct tetlod_error error = {0}, inner = {0};
    struct tetlod_file *file;
    int fd;
    enum tetlod_status status = cli_open_stream(request->stream, &file, &fd, &error);
    if (status == TETLOD_OK) {
        struct verification v = {.request = request, .file = file, .error = &inner};
        status = verify_file(&v);
        progress_end(&request->progress);
        if (status != TETLOD_OK)
            tetlodi_fail(&error, status, "%s: %.230s", request->stream, inner.message);
        tetlod_close(file);
        close(fd);
    }
    return print_result(request, status, &error);
}

static int run(int argc, char **argv)
{
    static const struct option options[] = {{"against", required_argument, NULL, 'a'}, {"q", required_argument, NULL, 'q'},
                                            {"threads", required_argument, NULL, 't'}, {"json", no_argument, NULL, 'j'},
                                            {"progress", no_argument, NULL, 'p'},      {"quiet", no_argument, NULL, 's'},
                                            {0}};
    struct request request = {0};
    uint64_t threads = 0;
    bool forced = false, quiet = false;
    for (int option; (option = cli_option(&command_verify, argc, argv, "", options)) != -1;) {
        if (option == 'a')
            request.against = optarg;
        else if (option == 'q')
            request.solution = optarg;
        else if (option == 'j')
            request.json = true;
        else if (option == 'p')
            forced = true;
        else if (option == 's')
            quiet = true;
        else if (option != 't' || !cli_parse_count(&command_verify, "threads", optarg, 0, 1024, &threads))
            return EXIT_USAGE;
    }
    if (!cli_operands(&command_verify, argc, 1, "the stream"))
        return EXIT_USAGE;
    request.stream = argv[optind];
    request.threads = threads ? (unsigned)threads : parallel_cores();
    progress_init(&request.progress, forced, quiet);
    return verify(&request);
}

const struct command command_verify = {"verify", "decode everything, check everything, compare with the input", help, run};
