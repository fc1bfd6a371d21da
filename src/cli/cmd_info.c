/* SPDX-License-Identifier: BSD-3-Clause */
#include <stdio.h>
#include <string.h>
#include <unistd.h>

#include "src/cli/cli.h"
#include "src/cli/print_json.h"
#include "src/report/info_json.h"
#include "src/stream/metadata.h"
#include "src/report/series_json.h"
#include "src/report/byte_table.h"

static const char help[] =
    "usage: tetlod info FILE.tetlod [--all | --json]\n"
    "\n"
    "Says what is in a stream: counts, fields, where its bytes are, and the levels with their errors and\n"
    "bytes. About ten levels are shown: the coarsest, the finest, and those at an error of 20, 10, 5, 2,\n"
    "1, 0.5, 0.2 and 0.1 %.\n"
    "\n"
    "      --all   every level, and the measure 'predicted'\n"
    "      --json  the index as JSON, as /v1/meshes/{id} of the server gives it\n"
    "\n"
    "For a series in time it also lists the bands that hold the steps, with the bytes of a step.\n"
    "\n"
    "Errors are the largest of the controlled fields, each in percent of its range; a dash means that one\n"
    "is not known. 'bytes' is the length of the prefix of the file that decodes to the level. 'others' is\n"
    "the largest measured error of the fields that are not controlled. 'tetlod help words' explains the\n"
    "words.\n";

static bool is_cell_values(const struct tetlod_section *section)
{
    return strcmp(section->tag, "CVAL") == 0 || strcmp(section->tag, "PVAL") == 0;
}

/* Sections of a file that is cut off, those of cells by the names of the fields. */
static void print_missing(const struct tetlod_info *info, int fd)
{
    const char *before = "cut off       not here: ";
    for (uint32_t f = 0; f < info->cell_field_count; f++)
        if (!cli_cells_here(info, fd, f)) {
            printf("%scells' %s", before, info->cell_fields[f].name);
            before = ", ";
        }
    for (uint32_t i = 0; i < info->section_count; i++) {
        const struct tetlod_section *section = &info->sections[i];
        bool again = i && strcmp(section->tag, section[-1].tag) == 0 && !cli_section_here(info, &section[-1], fd);
        if (cli_section_here(info, section, fd) || is_cell_values(section) || again)
            continue;
        printf("%ssection %s", before, section->tag);
        before = ", ";
    }
    if (before[0] == ',')
        printf("\n");
}

/* A download that stopped still shows the levels that came. */
static void print_cut(const struct tetlod_info *info, int fd)
{
    uint32_t here = cli_finest_here(info, fd);
    if (here == TETLOD_NONE)
        printf("cut off       not even level 0 is whole\n");
    else if (here + 1 < info->level_count)
        printf("cut off       levels 0 to %u of %u are here\n", here, info->level_count - 1);
    print_missing(info, fd);
}

/* The series, if the file is one and holds the table whole; NULL otherwise. */
static struct tetlod_series *find_series(const struct tetlod_file *file)
{
    struct tetlod_series *series;
    if (tetlod_section_index(tetlod_info(file), "TIME") == TETLOD_NONE ||
        tetlod_series_new(&series, file, NULL) != TETLOD_OK)
        return NULL;
    return series;
}

static void print_field(const char *what, const char *name, uint32_t components, const char *type,
                        const double range[2],
                        const json_t *metadata)
{
    const char *unit = metadata_unit(metadata, name);
    printf("%s%s, %u x %s, range %.9g .. %.9g%s%s", what, name, components, type, range[0], range[1], *unit ? " " : "",
           unit);
}

static void print_text(const struct tetlod_file *file, int fd, bool all)
{
    const struct tetlod_info *info = tetlod_info(file);
    struct tetlod_series *series = find_series(file);
    json_t *metadata = metadata_json(info), *ids = json_object_get(metadata, "ids");
    printf("content id    %s\n", info->cid);
    printf("vertices      %llu\n", (unsigned long long)info->vertices);
    printf("tetrahedra    %llu (%llu degenerate, %llu inverted or folded)\n", (unsigned long long)info->tets,
           (unsigned long long)info->degenerate_tets,
           (unsigned long long)info->inverted_tets);
    printf("unused points %llu\n", (unsigned long long)info->unused_points);
    printf("bytes         %llu (%.2f bits per tetrahedron), %s\n", (unsigned long long)info->bytes,
           8.0 * (double)info->bytes / info->tets, info->lossless ? "lossless" : "quantised");
    if (info->page_count)
        printf("pages         %u, from level %u on\n", info->page_count, info->first_paged_level);
    printf("bounds        %.9g %.9g %.9g .. %.9g %.9g %.9g\n", info->bounds[0][0], info->bounds[0][1],
           info->bounds[0][2], info->bounds[1][0], info->bounds[1][1], info->bounds[1][2]);
    for (uint32_t f = 0; f < info->field_count; f++) {
        const struct tetlod_field *field = &info->fields[f];
        print_field("field         ", field->name, field->components,
                    field->type == TETLOD_FLOAT64 ? "float64" : "float32",
                    field->range, metadata);
        if (field->bounds == TETLOD_NONE)
            printf("%s\n", field->controlled ? ", controlled" : metadata_is_id(ids, field->name) ? ", ids" : "");
        else
            printf(", bounds the error of %s\n", info->fields[field->bounds].name);
    }
    for (uint32_t f = 0; f < info->cell_field_count; f++) {
        static const char *const types[] = {"float32", "float64", "int8", "int16", "int32", "int64"};
        const struct tetlod_cell_field *field = &info->cell_fields[f];
        print_field("cell field    ", field->name, field->components, types[field->type], field->range, metadata);
        printf("%s", field->region ? ", regions" : "");
        if (field->quantum > 0)
            printf(", rounded: error at most %.3g", field->error);
        printf("\n");
    }
    if (info->cell_rows && info->cell_rows < info->tets)
        printf("cells         %u, split into the tetrahedra; their values are stored once a cell\n", info->cell_rows);
    json_decref(metadata);
    print_cut(info, fd);
    for (uint32_t t = 0, first = 0; t < info->topology_count; first += info->topologies[t++].step_count)
        printf("topology %-4u steps %u to %u, times %.9g .. %.9g, bytes %llu%s\n", t, first,
               first + info->topologies[t].step_count - 1,
               info->topologies[t].times[0], info->topologies[t].times[info->topologies[t].step_count -
                                                                       1], (unsigned long long)info->topologies[t].size,
               t ? "" : " (all of the stream; what follows is about this one)");
    if (series)
        series_print(stdout, series, info);
    tetlod_series_free(series);
    printf("\n");
    byte_table_print(stdout, NULL, NULL, file);
    printf("\n");
    cli_print_levels(info, all);
    fflush(stdout);
    byte_table_print(NULL, stderr, "tetlod info", file);
}

static int print_json(const struct tetlod_file *file, const char *path)
{
    char id[256];
    stream_id(path, id, sizeof id);
    json_t *object = info_json(tetlod_info(file), id);
    struct tetlod_series *series = find_series(file);
    if (series && object && json_object_set_new(object, "series", series_json(series, tetlod_info(file)))) {
        json_decref(object);
        object = NULL;
    }
    tetlod_series_free(series);
    return cli_print_json(object);
}

static int run(int argc, char **argv)
{
    static const struct option options[] = {{"json", no_argument, NULL, 'j'}, {"all", no_argument, NULL, 'a'}, {0}};
    struct tetlod_error error = {0};
    struct tetlod_file *file;
    bool json = false, all = false;
    int fd, result = EXIT_DONE;
    for (int option; (option = cli_option(&command_info, argc, argv, "", options)) != -1;) {
        if (option == '?')
            return EXIT_USAGE;
        json |= option == 'j';
        all |= option == 'a';
    }
    if (!cli_operands(&command_info, argc, 1, "the stream"))
        return EXIT_USAGE;
    if (cli_open_stream(argv[optind], 1, &file, &fd, &error) != TETLOD_OK)
        return cli_fail(&error);
    if (json)
        result = print_json(file, argv[optind]);
    else
        print_text(file, fd, all);
    tetlod_close(file);
    close(fd);
    return result;
}

const struct command command_info = {"info", "what is in a stream: counts, fields, levels with error and bytes", help,
                                     run};
