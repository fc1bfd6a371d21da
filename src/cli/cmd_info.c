/* SPDX-License-Identifier: BSD-3-Clause */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <unistd.h>

#include "format/fail.h"
#include "src/cli/cli.h"
#include "src/report/info_json.h"
#include "src/report/promise.h"

static const char help[] =
    "usage: tetlod info FILE.tetlod [--json]\n"
    "\n"
    "Says what is in a stream: counts, fields, and the levels with their errors and bytes.\n"
    "\n"
    "      --json  the index as JSON, as /v1/meshes/{id} of the server gives it\n"
    "\n"
    "Errors are fractions of the field's range, in percent; a dash: not known. 'bytes' is the length of the prefix of the\n"
    "file that decodes to the level. 'others': the largest measured error of the fields that nothing held down.\n";

/* The field that the table's errors are about: the first controlled one. */
static uint32_t shown_field(const struct tetlod_info *info)
{
    for (uint32_t f = 0; f < info->field_count; f++)
        if (info->fields[f].controlled)
            return f;
    return 0;
}

static void print_levels(const struct tetlod_info *info)
{
    uint32_t field = shown_field(info);
    const struct uncontrolled others = uncontrolled_at(info, 0);
    printf("\n%5s %10s %10s %12s %10s", "level", "vertices", "tets", "bytes", "domain");
    for (int m = 0; m < TETLOD_MEASURES && info->field_count; m++)
        printf(" %9s%%", tetlod_measure_name((enum tetlod_measure)m));
    printf("%s\n", others.count ? "    others%" : "");
    for (uint32_t k = 0; k < info->level_count; k++) {
        const struct tetlod_level *level = &info->levels[k];
        printf("%5u %10u %10u %12llu %10.3g", k, level->vertices, level->tets, (unsigned long long)level->end,
               level->domain_error);
        for (int m = 0; m < TETLOD_MEASURES && info->field_count; m++) {
            double error = level->errors[field * TETLOD_MEASURES + (uint32_t)m];
            if (isnan(error))
                printf(" %10s", "-");
            else
                printf(" %10.4g", 100 * error);
        }
        if (others.count)
            printf(" %10.4g", 100 * uncontrolled_at(info, k).sampled);
        printf("\n");
    }
    if (info->field_count)
        printf("errors of %s, %% of its range\n", info->fields[field].name);
    if (others.count)
        printf("others: the largest measured error of the %u field%s not controlled, at level 0 that of %s\n", others.count,
               others.count == 1 ? " that is" : "s that are", info->fields[others.worst].name);
}

static void print_text(const struct tetlod_info *info)
{
    printf("content id    %s\n", info->cid);
    printf("vertices      %u\n", info->vertices);
    printf("tetrahedra    %u (%llu degenerate, %llu inverted or folded)\n", info->tets, (unsigned long long)info->degenerate_tets,
           (unsigned long long)info->inverted_tets);
    printf("unused points %llu\n", (unsigned long long)info->unused_points);
    printf("bytes         %llu (%.2f bits per tetrahedron), %s\n", (unsigned long long)info->bytes,
           8.0 * (double)info->bytes / info->tets, info->lossless ? "lossless" : "quantised");
    printf("bounds        %.9g %.9g %.9g .. %.9g %.9g %.9g\n", info->bounds[0][0], info->bounds[0][1],
           info->bounds[0][2], info->bounds[1][0], info->bounds[1][1], info->bounds[1][2]);
    for (uint32_t f = 0; f < info->field_count; f++) {
        const struct tetlod_field *field = &info->fields[f];
        printf("field         %s, %u x %s, range %.9g .. %.9g%s\n", field->name, field->components,
               field->type == TETLOD_FLOAT64 ? "float64" : "float32", field->range[0], field->range[1],
               field->controlled ? ", controlled" : "");
    }
    for (uint32_t f = 0; f < info->cell_field_count; f++) {
        static const char *const types[] = {"float32", "float64", "int8", "int16", "int32", "int64"};
        const struct tetlod_cell_field *field = &info->cell_fields[f];
        printf("cell field    %s, %u x %s, range %.9g .. %.9g%s\n", field->name, field->components, types[field->type],
               field->range[0], field->range[1], field->region ? ", regions" : "");
    }
    print_levels(info);
}

static int print_json(const struct tetlod_info *info, const char *path)
{
    char id[256];
    stream_id(path, id, sizeof id);
    json_t *object = info_json(info, id);
    char *text = object ? json_dumps(object, INFO_JSON_FLAGS) : NULL;
    struct tetlod_error error = {0};
    if (text)
        puts(text);
    else
        tetlodi_fail_nomem(&error, "the JSON", 4096);
    free(text);
    json_decref(object);
    return text ? EXIT_DONE : cli_fail(&error);
}

static int run(int argc, char **argv)
{
    static const struct option options[] = {{"json", no_argument, NULL, 'j'}, {0}};
    struct tetlod_error error = {0};
    struct tetlod_file *file;
    bool json = false;
    int fd, result = EXIT_DONE;
    for (int option; (option = cli_option(&command_info, argc, argv, "", options)) != -1;) {
        if (option != 'j')
            return EXIT_USAGE;
        json = true;
    }
    if (!cli_operands(&command_info, argc, 1, "the stream"))
        return EXIT_USAGE;
    if (cli_open_stream(argv[optind], &file, &fd, &error) != TETLOD_OK)
        return cli_fail(&error);
    if (json)
        result = print_json(tetlod_info(file), argv[optind]);
    else
        print_text(tetlod_info(file));
    tetlod_close(file);
    close(fd);
    return result;
}

const struct command command_info = {"info", "what is in a stream: counts, fields, levels with error and bytes", help, run};
