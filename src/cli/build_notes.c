/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/cli/build_notes.h"

#include <inttypes.h>
#include <jansson.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "src/cli/print_json.h"
#include "src/cli/scratch_memory.h"
#include "src/mesh/displacement.h"
#include "src/mesh/ids.h"
#include "src/pipeline/build_warnings.h"
#include "src/report/info_json.h"
#include "src/report/byte_table.h"

enum { MAX_NAMES = 8 };

/* ---- on standard error */

/* A list of names that ends with dots where it would be long. */
static void add_name(char *names, size_t size, uint32_t number, const char *name)
{
    size_t used = strlen(names);
    if (number < MAX_NAMES)
        snprintf(names + used, size - used, "%s%.40s", number ? ", " : "", name);
    else if (number == MAX_NAMES)
        snprintf(names + used, size - used, ", ...");
}

static bool is_controlled(const struct build_control *controls, uint32_t count, uint32_t field)
{
    for (uint32_t i = 0; i < count; i++)
        if (controls[i].field == field)
            return true;
    return false;
}

/* Which fields are controlled where nobody said so, and which are not. */
static void say_fields(const struct build_request *request, const struct tetmesh *mesh,
                       const struct build_control *controls, uint32_t count)
{
    char names[3][400] = {"", "", ""};
    uint32_t counts[3] = {0};
    enum { CONTROLLED, IDS, OTHERS };
    for (uint32_t f = 0; f < mesh->field_count; f++) {
        int kind = is_controlled(controls, count, f) ? CONTROLLED : mesh->fields[f].is_ids ? IDS : OTHERS;
        add_name(names[kind], sizeof *names, counts[kind]++, mesh->fields[f].name);
    }
    if (!request->field_count)
        fprintf(stderr, "tetlod build: controlled: %s%s\n", names[CONTROLLED],
                counts[CONTROLLED] > 1 ? " (--field A,B or --no-field A chooses)" : "");
    if (counts[IDS])
        fprintf(stderr, "tetlod build: ids, stored exactly, not controlled: %s\n", names[IDS]);
    if (counts[OTHERS])
        fprintf(stderr, "tetlod build: not controlled, their error is only measured: %s\n", names[OTHERS]);
    if (request->regions_are_found && request->build.regions)
        fprintf(stderr,
                "tetlod build: '%.60s' of cells tells regions, whose interfaces stay as they are; --no-region lets "
                "them go\n",
                request->build.regions);
}

/* Has the mesh values of cells that --cell-data average would make a field of? */
static bool has_averages_to_make(const struct build_request *request, const struct tetmesh *mesh)
{
    bool any = false;
    for (uint32_t f = 0; f < mesh->cell_field_count; f++)
        any |= !ids_by_kind(&mesh->cell_fields[f]);
    return any && request->reading.options.cell_data != CELL_DATA_AVERAGE;
}

/* What to add where nothing but a coordinate could be controlled. */
static void say_coordinate(const struct build_request *request, const struct tetmesh *mesh, uint32_t field)
{
    if (strncmp(mesh->fields[field].name, COORDINATE_NAME, strlen(COORDINATE_NAME)) != 0 || request->field_count)
        return;
    fprintf(stderr,
            "tetlod build: there is no field to control: the boundary is kept, and %s says how far a level is off; "
            "results come "
            "from a file that has them%s%s\n",
            mesh->fields[field].name, request->reading.options.solution ? "" : ", --q for PLOT3D",
            has_averages_to_make(request, mesh) ? ", --cell-data average from values of cells" : "");
}

/* The field that costs most. */
static void say_cost(const struct tetmesh *mesh, const struct field_cost *cost)
{
    if (cost->field == TETLOD_NONE)
        return;
    const char *name = mesh->fields[cost->field].name;
    fprintf(stderr,
            "tetlod build: '%.60s' costs most: without it the level within %g %% has about %.2g times fewer "
            "tetrahedra, %" PRIu32 " instead of %" PRIu32 " (--no-field '%.60s')\n",
            name, 100 * FIELD_COST_ERROR, (double)cost->tets_with / cost->tets_without, cost->tets_without,
            cost->tets_with, name);
}

static void say_warning(void *opaque, const char *line)
{
    (void)opaque;
    fprintf(stderr, "tetlod build: %s\n", line);
}

void build_notes(const struct build_request *request, const struct io_report *read, const struct tetmesh *mesh,
                 const struct build_control *controls, uint32_t count, const struct build_report *report)
{
    say_fields(request, mesh, controls, count);
    say_coordinate(request, mesh, controls[0].field);
    say_cost(mesh, &report->cost);
    struct io_report notes_read = *read;
    if (request->build.series)
        notes_read.steps = 0; // all of them were read
    reading_notes("build", &notes_read, mesh);
    build_warnings(report, say_warning, NULL);
    for (uint32_t g = 0; g < request->topologies.count; g++)
        fprintf(stderr,
                "tetlod build: topology group %" PRIu32 ": steps %" PRIu32 " to %" PRIu32 " over %" PRIu32
                " tetrahedra\n",
                g, request->topologies.groups[g].from,
                request->topologies.groups[g].from + request->topologies.groups[g].count - 1,
                request->topologies.groups[g].tets);
    if (request->series.own_times)
        fprintf(stderr, "tetlod build: the steps' times do not rise: their numbers stand for them\n");
    if (request->build.series)
        fprintf(stderr,
                "tetlod build: %s%" PRIu32 " steps in time, of which %" PRIu32 " limit the contraction%s\n",
                request->topologies.count ? "of topology group 0 " : "", request->build.series->step_count,
                report->keys,
                count < mesh->field_count ? "; fields of points that are not controlled are those of the first step"
                                          : "");
    for (uint32_t c = 0; request->build.series && c < request->build.series->cell_count; c++)
        if (request->build.series->cells[c].missing)
            fprintf(
                stderr,
                "tetlod build: not every step has the values of cells %s: those of the first step alone are stored\n",
                mesh->cell_fields[c].name);
    if (request->series.series.points_move)
        fprintf(stderr, "tetlod build: the points move: '" DISPLACEMENT_FIELD "' says how far and drives as the other "
                                                                              "fields do; all errors are "
                        "those at the same point of the body, proved on the mesh of the first step\n");
    if (request->series.rounded)
        fprintf(stderr, "tetlod build: %" PRIu64 " coordinates of points that move come back to the last place only, "
                                                 "not bit for bit\n",
                request->series.rounded);
    fprintf(stderr, "tetlod build: %s: %s%" PRIu32 " vertices, %" PRIu32 " tetrahedra in %" PRIu32 " levels\n",
            request->output, request->for_mail ? "the coarse levels of " : "", mesh->vertex_count, mesh->tet_count,
            report->levels);
}

/* ---- on standard output */

/* Of the level that people take most. */
static void warn_at_one_percent(const struct tetlod_info *info)
{
    uint32_t level = tetlod_level_for_error(info, FIELD_COST_ERROR, TETLOD_NONE, TETLOD_MAX);
    if (level != TETLOD_NONE)
        cli_warn_uncontrolled("build", info, level);
}

int build_print_levels(const struct build_request *request)
{
    struct tetlod_file *file;
    struct tetlod_error error = {0};
    int fd;
    if (cli_open_stream(request->output, 1, &file, &fd, &error) != TETLOD_OK)
        return cli_fail(&error);
    cli_print_levels(tetlod_info(file), request->all);
    printf("\n");
    byte_table_print(stdout, NULL, NULL, file);
    fflush(stdout);
    byte_table_print(NULL, stderr, "tetlod build", file);
    warn_at_one_percent(tetlod_info(file));
    if (request->for_mail)
        cli_print_promises(stdout, tetlod_info(file), tetlod_info(file)->level_count - 1);
    tetlod_close(file);
    close(fd);
    return EXIT_DONE;
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

int build_print_json(const struct build_request *request, const struct build_report *report, double read_seconds,
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
    json_t *refused = json_pack("{s:I, s:I, s:I, s:I, s:I, s:I}", "flip",
                                (json_int_t)report->refused[LOG_REFUSED_FLIP], "link",
                                (json_int_t)report->refused[LOG_REFUSED_LINK], "boundary",
                                (json_int_t)report->refused[LOG_REFUSED_BOUNDARY], "rounding",
                                (json_int_t)report->refused[LOG_REFUSED_ROUNDING], "size",
                                (json_int_t)report->refused[LOG_REFUSED_SIZE], "cell",
                                (json_int_t)report->refused[LOG_REFUSED_CELL]);
    json_t *more = json_pack("{s:o, s:o, s:I, s:I, s:I, s:I, s:I, s:f, s:i}", "seconds", seconds, "refused", refused,
                             "contractions",
                             (json_int_t)report->contractions,
                             "nan_filled", (json_int_t)request->nan_filled,
                             "peak_memory", (json_int_t)peak,
                             "scratch_files", (json_int_t)scratch_memory_peak(),
                             "scratch_given_back", (json_int_t)scratch_memory_given_back(), "bytes_per_tetrahedron",
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
