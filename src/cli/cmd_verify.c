/* SPDX-License-Identifier: BSD-3-Clause */
#include <inttypes.h>
#include <jansson.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "format/common/round.h"
#include "format/fail.h"
#include "format/write/page_check.h"
#include "src/pipeline/build.h"
#include "src/cli/against.h"
#include "src/cli/against_steps.h"
#include "src/cli/cli.h"
#include "src/cli/print_json.h"
#include "src/cli/progress.h"
#include "src/cli/reading.h"
#include "src/cli/stream_input.h"
#include "src/cli/verify_index.h"
#include "src/io/io.h"
#include "src/mesh/displacement.h"
#include "src/mesh/mesh_check.h"
#include "src/mesh/originals.h"
#include "src/stream/level_mesh.h"
#include "src/stream/metadata.h"
#include "src/util/json_text.h"
#include "src/util/array.h"
#include "src/util/parallel.h"

static const char help[] =
    "usage: tetlod verify FILE.tetlod|URL [--against INPUT [--all-levels]] [--json]\n"
    "\n"
    "Decodes a stream whole: checks every digest and section, replays all records and undoes them again,\n"
    "holds what the index says against what is decoded, checks every level's mesh. A stream at a URL is\n"
    "read by ranges, each once.\n"
    "\n"
    "      --against INPUT  also: the finest level is this mesh, exactly or rounded to the stream's\n"
    "                       grids, with its fields, values of cells and times; at every level 'sampled'\n"
    "                       and 'rms' are what is measured, the boundary is nowhere further off than the\n"
    "                       domain error, and 'max' is not below the exact maximum. Large meshes (levels\n"
    "                       times tetrahedra above 4 million) have the exact maximum taken at six levels,\n"
    "                       which it names. Of a part of a stream only max and the domain error are held\n"
    "                       against the input. Every step of a series is read: exact values are the\n"
    "                       input's bit for bit, and no band is further off than it says. Give the option\n"
    "                       once for each file if the series is made of several\n"
    "      --times A:B:C    the steps of a series, as when it was built\n"
    "      --all-levels     the exact maximum at every level of large meshes, too\n"
    "      --threads N      up to 64; 0 (default): all cores\n"
    "      --json           the result as JSON\n"
    "      --progress, --quiet\n"
    "\n"
    "How INPUT is read, as when the stream was built:\n"
    READING_HELP
    "\n"
    "Exit status 0: all is well; 3: the stream is damaged or says what is not true: the message says\n"
    "what, and which levels can be read; 4: it is valid, but its quality is poor: a level has inverted,\n"
    "degenerate or duplicate tetrahedra, or another topology, which its original has not.\n";

enum { MAX_INPUTS = 1024 };

struct request {
    const char *stream;
    struct series_input series; /* what --against names */
    struct reading reading;
    unsigned threads;
    bool json, all_levels;
    struct progress progress;
};

struct verification {
    struct request *request;
    struct tetlod_file *file;
    struct tetlod_cursor *cursor;
    uint64_t *hashes; /* [level] of the arrays on the way up */
    struct mesh_report finest;
    struct against_report against;
    struct steps_found series; /* no steps: it is none */
    bool in_groups;            /* it is one of several topology groups */
    /* all levels that were measured, of all topology groups, were held against the exact maximum */
    bool whole;
    uint32_t poor_levels;      /* levels that are worse meshes than the finest one */
    char poor[160];            /* what the first of them has */
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

/* What the original does not have, no level should have. */
static void check_report(struct verification *v, uint32_t level, const struct mesh_report *report)
{
    const struct mesh_report now = *report, *original = &v->finest;
    const struct {
        const char *what;
        uint64_t now, original;
        bool exactly;
    } counts[] = {{"inverted tetrahedra", now.inverted_tets, original->inverted_tets, false},
                  {"degenerate tetrahedra", now.degenerate_tets, original->degenerate_tets, false},
                  {"faces with both tetrahedra on one side", now.same_side_faces, original->same_side_faces, false},
                  {"duplicate tetrahedra", now.duplicate_tets, original->duplicate_tets, false},
                  {"faces of more than two tetrahedra", now.overfull_faces, original->overfull_faces, false},
                  {"vertices that are no manifold points", now.singular_vertices, original->singular_vertices, false},
                  {"components", now.components, original->components, true},
                  {"boundary components", now.boundary_components, original->boundary_components, true},
                  {"as Euler characteristic", (uint64_t)now.euler, (uint64_t)original->euler, true}};
    for (size_t i = 0; i < sizeof counts / sizeof *counts; i++) {
        if (counts[i].exactly ? counts[i].now == counts[i].original : counts[i].now <= counts[i].original)
            continue;
        if (!v->poor_levels++)
            snprintf(v->poor, sizeof v->poor, "level %u has %lld %s, the original %lld", level,
                     (long long)counts[i].now, counts[i].what,
                     (long long)counts[i].original);
        return;
    }
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
            tetlodi_fail(v->error, status, "%s; %u of %u levels can be read", inner.message, k, levels);
            return status;
        }
        v->hashes[k] = hash_mesh(v);
        progress(v, "replay", (k + 1.0) / levels);
    }
    struct tetmesh finest;
    TETLOD_TRY(level_mesh_copy(tetlod_info(v->file), v->cursor, &finest, v->error));
    enum tetlod_status status = mesh_check(finest.positions, finest.corners, finest.vertex_count, finest.tet_count,
                                           &v->finest, v->error);
    if (status == TETLOD_OK)
        status = verify_index(v->file, &finest, v->error);
    tetmesh_fini(&finest);
    return status;
}

/* A level that waits to be checked: one a thread, so that they are checked at the same time. */
struct waiting_level {
    uint32_t level;
    struct tetmesh mesh;
    struct mesh_report report;
    enum tetlod_status status;
    struct tetlod_error error;
};

static void check_meshes(void *context, unsigned worker, size_t begin, size_t end)
{
    struct waiting_level *waiting = context;
    (void)worker;
    for (size_t i = begin; i < end; i++) {
        const struct tetmesh *mesh = &waiting[i].mesh;
        waiting[i].status = mesh_check(mesh->positions, mesh->corners, mesh->vertex_count, mesh->tet_count,
                                       &waiting[i].report, &waiting[i].error);
    }
}

/* Checks those that wait, and frees them; the first fault of them is the one that counts. */
static enum tetlod_status check_waiting(struct verification *v, struct waiting_level *waiting, uint32_t count)
{
    enum tetlod_status status = TETLOD_OK;
    parallel_for(v->request->threads, count, 1, check_meshes, waiting);
    for (uint32_t i = 0; i < count; i++) {
        if (status == TETLOD_OK && (status = waiting[i].status) != TETLOD_OK)
            *v->error = waiting[i].error;
        if (status == TETLOD_OK)
            check_report(v, waiting[i].level, &waiting[i].report);
        tetmesh_fini(&waiting[i].mesh);
    }
    return status;
}

static enum tetlod_status undo_to(const struct verification *v, uint32_t k)
{
    uint32_t vertices = tetlod_info(v->file)->levels[k].vertices;
    struct tetlod_mesh mesh;
    for (tetlod_cursor_mesh(v->cursor, &mesh); mesh.vertices > vertices || mesh.level > k;
         tetlod_cursor_mesh(v->cursor, &mesh))
        TETLOD_TRY(tetlod_cursor_coarsen(v->cursor, v->error));
    if (mesh.vertices != vertices || hash_mesh(v) != v->hashes[k])
        return tetlodi_fail(v->error, TETLOD_ERR_STREAM, "undoing the records does not lead back to level %u", k);
    return TETLOD_OK;
}

static enum tetlod_status undo(struct verification *v)
{
    uint32_t levels = tetlod_info(v->file)->level_count, count = 0;
    uint32_t most = v->request->threads;
    struct waiting_level *waiting = array_zero(most, sizeof *waiting);
    enum tetlod_status status = waiting ? TETLOD_OK : tetlodi_fail_nomem(v->error, "the levels",
                                                                         most * sizeof *waiting);
    for (uint32_t k = levels; k-- > 0 && status == TETLOD_OK;) {
        status = undo_to(v, k);
        waiting[count].level = k;
        if (status == TETLOD_OK)
            status = level_mesh_copy(tetlod_info(v->file), v->cursor, &waiting[count].mesh, v->error);
        count += status == TETLOD_OK;
        if (status == TETLOD_OK && (count == most || k == 0)) {
            status = check_waiting(v, waiting, count);
            count = 0;
        }
        progress(v, "undo", 1 - (double)k / levels);
    }
    for (uint32_t i = 0; i < count; i++)
        tetmesh_fini(&waiting[i].mesh);
    free(waiting);
    return status;
}

/* What a decoder takes for a wrong question is the stream's fault: nobody asked it anything. */
static enum tetlod_status blame_stream(enum tetlod_status status, struct tetlod_error *error)
{
    struct tetlod_error inner = *error;
    return status < TETLOD_ERR_ARGUMENT ? status : tetlodi_fail(error, TETLOD_ERR_STREAM, "%.250s", inner.message);
}

/* ---- against the input */

/* Fields that the build derived are not in the input: derived again. A local bound is 0 there. */
static enum tetlod_status derive_fields(const struct tetlod_info *info, struct tetmesh *input,
                                        struct tetlod_error *error)
{
    for (uint32_t f = 0; f < info->field_count; f++) {
        const struct tetlod_field *field = &info->fields[f];
        struct build_control ignored;
        if (tetmesh_find_field(input, field->name) != TETLOD_NONE)
            continue;
        enum tetlod_status status = field->bounds != TETLOD_NONE
                                        ? tetmesh_add_field(input, field->name, field->components, field->type, error)
                                        : build_control_parse(input, field->name, &ignored, error);
        TETLOD_TRY(blame_stream(status, error));
    }
    return TETLOD_OK;
}

/* A field of the input that the stream has not was lost, unless the build was told which to carry, or is not known. */
static enum tetlod_status check_carried(const struct tetlod_info *info, const struct tetmesh *input,
                                        struct tetlod_error *error)
{
    if (metadata_is_selection(info) || metadata_is_part(info))
        return TETLOD_OK;
    for (uint32_t f = 0; f < input->field_count; f++)
        if (tetlod_field_index(info, input->fields[f].name) == TETLOD_NONE)
            return tetlodi_fail(error, TETLOD_ERR_MISMATCH, "the stream has no field '%.60s', which the input has",
                                input->fields[f].name);
    for (uint32_t f = 0; f < input->cell_field_count; f++)
        if (tetlod_cell_field_index(info, input->cell_fields[f].name) == TETLOD_NONE)
            return tetlodi_fail(error, TETLOD_ERR_MISMATCH,
                                "the stream has no field '%.60s' of cells, which the input has",
                                input->cell_fields[f].name);
    return TETLOD_OK;
}

/* Values of cells as the stream rounds them: each within the error that it states. */
static enum tetlod_status round_cells(const struct tetlod_info *info, struct tetmesh *input, struct tetlod_error *error)
{
    for (uint32_t f = 0; f < info->cell_field_count; f++) {
        const struct tetlod_cell_field *field = &info->cell_fields[f];
        uint32_t found = tetmesh_find_cell_field(input, field->name);
        if (!(field->quantum > 0) || found == TETLOD_NONE)
            continue;
        double *values = input->cell_fields[found].values;
        enum tetlod_type type = field->type == TETLOD_CELL_FLOAT32 ? TETLOD_FLOAT32 : TETLOD_FLOAT64;
        for (size_t i = 0; i < (size_t)input->tet_count * input->cell_fields[found].components; i++) {
            double code = floor(values[i] / field->quantum + 0.5);
            double value = tetlodi_round(type, field->quantum * code);
            if (!(fabs(value - values[i]) <= field->error))
                return tetlodi_fail(error, TETLOD_ERR_MISMATCH,
                                    "a value of cells of '%.60s' is %g away from the input's, and the stream says %g "
                                    "at most",
                                    field->name, fabs(value - values[i]), field->error);
            values[i] = value;
        }
    }
    return TETLOD_OK;
}

static void compare_progress(void *opaque, double done)
{
    progress(opaque, "compare", done);
}

/* The mesh that the levels are held against: of a series its first step. */
static enum tetlod_status read_input(const struct verification *v, struct tetmesh *out)
{
    const struct series_input *series = &v->request->series;
    struct reading reading = v->request->reading;
    struct io_report report;
    reading.options.keep_cells = tetlod_section_index(tetlod_info(v->file), TAG_ORIGINALS) != TETLOD_NONE;
    if (v->series.steps) {
        uint64_t rounded = 0;
        TETLOD_TRY(series_input_read(series, series_input_number(series, 0), &reading, out, &report, v->error));
        enum tetlod_status status = v->series.move ? displacement_take(out, out, &rounded, v->error) : TETLOD_OK;
        if (status != TETLOD_OK)
            tetmesh_fini(out);
        return status;
    }
    return io_read(out, series->paths[0], &reading.options, NULL, v->error);
}

/* The cells that the stream keeps are the input's. */
static enum tetlod_status originals_against(const struct verification *v, const struct tetmesh *input)
{
    const struct tetlod_info *info = tetlod_info(v->file);
    uint32_t section = tetlod_section_index(info, TAG_ORIGINALS);
    bool derived = metadata_is_selection(info) || metadata_is_part(info);
    for (uint32_t f = 0; f < info->field_count; f++)
        derived |= info->fields[f].bounds != TETLOD_NONE;
    if (section == TETLOD_NONE || derived) // the section's list of fields is another then
        return TETLOD_OK;
    unsigned char *wanted = NULL, *found = array_new((size_t)info->sections[section].size, 1);
    size_t size = 0;
    enum tetlod_status status = found ? tetlod_section_read(v->file, section, found, v->error)
                                      : tetlodi_fail_nomem(v->error, "the original cells",
                                                           info->sections[section].size);
    if (status == TETLOD_OK && input->cells)
        status = originals_encode(input, &wanted, &size, v->error);
    if (status == TETLOD_OK && (size != info->sections[section].size || memcmp(wanted, found, size) != 0))
        status = tetlodi_fail(v->error, TETLOD_ERR_MISMATCH,
                              "the original cells that the stream keeps are not the input's");
    free(wanted);
    free(found);
    return status;
}

static enum tetlod_status verify_steps(struct verification *v)
{
    const struct steps_comparison comparison = {&v->request->series, &v->request->reading, v->request->threads,
                                                v->in_groups, {compare_progress, v}};
    return v->series.steps ? steps_against(v->file, &comparison, v->error) : TETLOD_OK;
}

static enum tetlod_status verify_against(struct verification *v)
{
    struct tetmesh input;
    TETLOD_TRY(read_input(v, &input));
    enum tetlod_status status = check_carried(tetlod_info(v->file), &input, v->error);
    if (status == TETLOD_OK)
        status = derive_fields(tetlod_info(v->file), &input, v->error);
    if (status == TETLOD_OK)
        status = round_cells(tetlod_info(v->file), &input, v->error);
    if (status == TETLOD_OK)
        status = originals_against(v, &input);
    const struct against_options comparing = {v->request->threads, v->request->all_levels, compare_progress, v};
    if (status == TETLOD_OK)
        status = against_check(v->file, v->cursor, &input, &comparing, &v->against, v->error);
    tetmesh_fini(&input);
    return status;
}

/* Every section's bytes. */
static enum tetlod_status check_sections(const struct verification *v)
{
    const struct tetlod_info *info = tetlod_info(v->file);
    enum tetlod_status status = TETLOD_OK;
    for (uint32_t i = 0; i < info->section_count && status == TETLOD_OK; i++) {
        void *bytes = info->sections[i].size < SIZE_MAX ? malloc((size_t)info->sections[i].size + 1) : NULL;
        status = bytes ? tetlod_section_read(v->file, i, bytes, v->error)
                       : tetlodi_fail_nomem(v->error, "a section", info->sections[i].size);
        free(bytes);
    }
    return status;
}

static enum tetlod_status check_order(const struct verification *v)
{
    const struct tetlod_info *info = tetlod_info(v->file);
    uint32_t most = info->vertices > info->tets ? info->vertices : info->tets;
    uint32_t *vertices = array_new(info->vertices, sizeof *vertices), *tets = array_new(info->tets, sizeof *tets);
    uint8_t *corners = array_new(info->tets, 4), *seen = array_zero(most, 1);
    enum tetlod_status status = TETLOD_OK;
    if (!vertices || !tets || !corners || !seen)
        status = tetlodi_fail_nomem(v->error, "the original order", info->tets * (uint64_t)8);
    else
        status = tetlod_order(v->file, vertices, tets, corners, v->error);
    for (uint32_t i = 0; i < info->vertices && status == TETLOD_OK; i++)
        if (seen[vertices[i]]++)
            status = tetlodi_fail(v->error, TETLOD_ERR_STREAM, "the original order has vertex %u twice", vertices[i]);
    if (seen)
        memset(seen, 0, most);
    for (uint32_t i = 0; i < info->tets && status == TETLOD_OK; i++)
        if (seen[tets[i]]++)
            status = tetlodi_fail(v->error, TETLOD_ERR_STREAM, "the original order has tetrahedron %u twice", tets[i]);
    free(vertices);
    free(tets);
    free(corners);
    free(seen);
    return status;
}

/* The cells that were split can be made of the finest level, where the cursor is. */
static enum tetlod_status check_originals(const struct verification *v)
{
    struct tetmesh mesh = {0};
    enum tetlod_status status = level_mesh_copy(tetlod_info(v->file), v->cursor, &mesh, v->error);
    if (status == TETLOD_OK)
        status = level_mesh_form(v->file, FORM_CELLS, false, &mesh, v->error);
    tetmesh_fini(&mesh);
    return status;
}

static enum tetlod_status check_metadata(const struct verification *v)
{
    const struct tetlod_info *info = tetlod_info(v->file);
    bool good = !info->metadata_size || json_text_is_object(info->metadata, info->metadata_size);
    return good ? TETLOD_OK : tetlodi_fail(v->error, TETLOD_ERR_STREAM, "the metadata are not a JSON object");
}

/* All that a stream says without its input. */
static enum tetlod_status verify_alone(struct verification *v)
{
    enum tetlod_status status;
    v->hashes = array_new(tetlod_info(v->file)->level_count, sizeof *v->hashes);
    if (!v->hashes)
        TETLOD_TRY_DONE(tetlodi_fail_nomem(v->error, "the levels", tetlod_info(v->file)->level_count * 8));
    TETLOD_TRY_DONE(tetlod_cursor_new(&v->cursor, v->file, NULL, 0, v->error));
    TETLOD_TRY_DONE(replay(v));
    TETLOD_TRY_DONE(check_sections(v));
    TETLOD_TRY_DONE(tetlodi_check_pages(v->file, v->error));
    TETLOD_TRY_DONE(check_metadata(v));
    if (tetlod_info(v->file)->keeps_order)
        TETLOD_TRY_DONE(check_order(v));
    if (tetlod_info(v->file)->keeps_order && tetlod_section_index(tetlod_info(v->file), TAG_ORIGINALS) != TETLOD_NONE)
        TETLOD_TRY_DONE(check_originals(v));
    if (tetlod_section_index(tetlod_info(v->file), "TIME") != TETLOD_NONE) {
        TETLOD_TRY_DONE(steps_decode(v->file, &v->series, v->error));
        TETLOD_TRY_DONE(verify_cell_steps(v->file, v->error));
    }
    TETLOD_TRY_DONE(steps_check_ranges(&v->series, true, v->error));
    status = undo(v);
done:
    free(v->hashes);
    v->hashes = NULL;
    return status;
}

static enum tetlod_status verify_file(struct verification *v)
{
    enum tetlod_status status = blame_stream(verify_alone(v), v->error);
    if (status == TETLOD_OK && v->request->series.path_count)
        status = verify_against(v);
    if (status == TETLOD_OK && v->request->series.path_count)
        status = verify_steps(v);
    tetlod_cursor_free(v->cursor);
    return status;
}

/* The table of topology groups says what this one has. */
static enum tetlod_status check_topology(const struct tetlod_file *file, const struct tetlod_topology *says,
                                         uint32_t number, struct tetlod_error *error)
{
    struct tetlod_series *series;
    TETLOD_TRY(tetlod_series_new(&series, file, error));
    const struct tetlod_series_info *steps = tetlod_series_info(series);
    bool good = steps->step_count == says->step_count && memcmp(steps->times, says->times,
                                                                steps->step_count * sizeof *steps->times) == 0;
    tetlod_series_free(series);
    return good ? TETLOD_OK : tetlodi_fail(error, TETLOD_ERR_STREAM,
                                           "topology group %u has other steps than the table says", number);
}

/* One after the other, each as a stream of its own; what was found of it is added. */
static enum tetlod_status verify_topology(struct verification *v, uint32_t number)
{
    const struct tetlod_topology *says = &tetlod_info(v->file)->topologies[number];
    struct tetlod_file *file;
    struct tetlod_error inner = {0};
    TETLOD_TRY(tetlod_open_topology(&file, v->file, number, v->error));
    struct verification part = {.request = v->request, .file = file, .in_groups = true, .error = &inner};
    enum tetlod_status status = blame_stream(check_topology(file, says, number, &inner), &inner);
    if (status == TETLOD_OK && number)
        status = verify_file(&part);
    if (status == TETLOD_OK)
        status = steps_found_add(&v->series, &part.series, &inner);
    if (status != TETLOD_OK)
        tetlodi_fail(v->error, status, "topology group %u: %s", number, inner.message);
    steps_found_fini(&part.series);
    v->against.measured += part.against.measured;
    v->whole &= !number || part.against.exact_count == tetlod_info(file)->level_count;
    if (part.poor_levels && !v->poor_levels)
        snprintf(v->poor, sizeof v->poor, "topology group %u: %.120s", number, part.poor);
    v->poor_levels += part.poor_levels;
    free(part.against.exact);
    tetlod_close(file);
    v->request->series.from += says->step_count;
    return status;
}

static enum tetlod_status verify_topologies(struct verification *v)
{
    const struct tetlod_info *info = tetlod_info(v->file);
    for (uint32_t t = 0; t < info->topology_count; t++) {
        const struct tetlod_topology *group = &info->topologies[t];
        if (t && !(group->times[0] > group->times[-1]))
            return tetlodi_fail(v->error, TETLOD_ERR_STREAM,
                                "topology group %u begins at the time at which the one before it ends", t);
        TETLOD_TRY(verify_topology(v, t));
    }
    return steps_check_ranges(&v->series, false, v->error);
}

/* What was found to be well, in words. */
static void print_done(const struct verification *v)
{
    const struct against_report *against = &v->against;
    printf("%s: %s", v->request->stream, v->poor_levels ? "valid, of poor quality" : "ok");
    if (v->poor_levels)
        printf(" (%u level%s; %s)", v->poor_levels, v->poor_levels == 1 ? "" : "s", v->poor);
    if (v->series.steps)
        printf("; %u steps", v->series.steps);
    if (tetlod_info(v->file)->topology_count)
        printf(" in %u topology groups", tetlod_info(v->file)->topology_count);
    if (v->series.move)
        printf(" of points that move, which turns over %" PRIu64 " tetrahedra at most at one step in one band",
               v->series.turned);
    if (v->request->series.path_count)
        printf("; %u levels %s", against->measured ? against->measured : tetlod_info(v->file)->level_count,
               against->measured ? "measured" : "not measured, for they are a part of another stream's, or vertices "
                                                "are alike");
    if (v->request->series.path_count && v->whole)
        printf(", max held against the exact maximum at all of them");
    for (uint32_t i = v->whole ? 0 : against->exact_count; i-- > 0;)
        printf("%s%u", i + 1 == against->exact_count ? ", max held against the exact maximum at levels " : ", ",
               against->exact[i]);
    putchar('\n');
}

static int print_result(const struct verification *v, enum tetlod_status status, const struct tetlod_error *error)
{
    if (!v->request->json) {
        if (status != TETLOD_OK)
            return cli_fail(error);
        print_done(v);
        return v->poor_levels ? EXIT_QUALITY : EXIT_DONE;
    }
    json_t *levels = json_array(), *object;
    for (uint32_t i = v->against.exact_count; i-- > 0 && levels;)
        json_array_append_new(levels, json_integer(v->against.exact[i]));
    object = json_pack("{s:s, s:b, s:s, s:s, s:i, s:i, s:o}", "file", v->request->stream, "ok", status == TETLOD_OK,
                       "message", status == TETLOD_OK ? "" : error->message, "quality", v->poor, "steps",
                       (int)v->series.steps, "measured_levels", (int)v->against.measured, "exact_levels", levels);
    int result = cli_print_json(object);
    if (status != TETLOD_OK)
        return cli_fail(error);
    return result == EXIT_DONE && v->poor_levels ? EXIT_QUALITY : result;
}

static int verify(struct request *request)
{
    struct tetlod_error error = {0}, inner = {0};
    struct tetlod_file *file;
    struct stream_input input;
    struct verification v = {.request = request, .error = &inner};
    enum tetlod_status status = stream_input_open(&input, request->stream, request->threads, &error);
    file = input.file;
    if (status == TETLOD_OK) {
        v.file = file;
        v.in_groups = tetlod_info(file)->topology_count > 0;
        status = verify_file(&v);
        v.whole = v.against.exact_count == tetlod_info(file)->level_count;
        if (status == TETLOD_OK)
            status = verify_topologies(&v);
        progress_end(&request->progress);
        if (status != TETLOD_OK)
            status = stream_input_fail(&input, request->stream, status, &inner, &error);
    }
    int result = print_result(&v, status, &error);
    stream_input_close(&input);
    free(v.against.exact);
    steps_found_fini(&v.series);
    return result;
}

static int run(int argc, char **argv)
{
    static const struct option options[] = {{"against", required_argument, NULL, 'a'},
                                            READING_OPTIONS,
                                            {"threads", required_argument, NULL, 't'},
                                            {"all-levels", no_argument, NULL, 'l'},
                                            {"times", required_argument, NULL, 'T'},
                                            {"json", no_argument, NULL, 'j'},
                                            {"progress", no_argument, NULL, 'p'},
                                            {"quiet", no_argument, NULL, 's'},
                                            {0}};
    struct request request = {0};
    const char *inputs[MAX_INPUTS];
    uint64_t threads = 0;
    bool forced = false, quiet = false;
    series_input_init(&request.series);
    request.series.paths = inputs;
    for (int option; (option = cli_option(&command_verify, argc, argv, "", options)) != -1;) {
        if (option == 'a' && request.series.path_count < MAX_INPUTS)
            inputs[request.series.path_count++] = optarg;
        else if (option == 'a')
            return cli_usage("verify", "at most %d --against", MAX_INPUTS);
        else if (option == 'T') {
            if (!series_input_parse_times(&request.series, &command_verify, optarg))
                return EXIT_USAGE;
        } else if (option >= READING_FIRST && option < READING_END) {
            if (!reading_option(&request.reading, &command_verify, option, optarg))
                return EXIT_USAGE;
        } else if (option == 'j')
            request.json = true;
        else if (option == 'l')
            request.all_levels = true;
        else if (option == 'p')
            forced = true;
        else if (option == 's')
            quiet = true;
        else if (option != 't' ||
                 !cli_parse_count(&command_verify, "threads", optarg, 0, PARALLEL_MAX_THREADS, &threads))
            return EXIT_USAGE;
    }
    if (!cli_operands(&command_verify, argc, 1, "the stream"))
        return EXIT_USAGE;
    request.stream = argv[optind];
    request.threads = threads ? (unsigned)threads : parallel_cores();
    if (web_source_is(request.stream))
        request.threads = 1; // its source is for one
    progress_init(&request.progress, forced, quiet);
    return verify(&request);
}

const struct command command_verify = {"verify", "decode everything, check everything, compare with the input", help,
                                       run};
