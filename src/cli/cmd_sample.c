/* SPDX-License-Identifier: BSD-3-Clause */
#include <inttypes.h>
#include <stdio.h>
#include <string.h>
#include <strings.h>

#include "src/cli/cli.h"
#include "src/cli/sample_series.h"
#include "src/io/io.h"
#include "src/sample/sample.h"

static const char help[] =
    "usage: tetlod sample NAME [--size N] -o OUT\n"
    "       tetlod sample wake --steps N [--remesh K] [--size N] -o OUT.pvd\n"
    "       tetlod sample --list\n"
    "\n"
    "Makes a mesh by formula, the same on every machine, in the format that OUT's extension names.\n"
    "\n"
    "  -o, --output OUT   the file to write\n"
    "      --size N       how fine it is; what N counts, and the default, differ between samples\n"
    "      --steps N      a series of N steps in time, from 0 to 1: OUT.pvd and, beside it, OUT_0.vtu,\n"
    "                     OUT_1.vtu, ...\n"
    "      --remesh K     another, finer mesh after every K steps, as simulations that adapt theirs write\n"
    "                     it\n"
    "      --list         list the samples\n"
    "\n"
    "example: tetlod sample fin -o fin.vtu\n";

static int list(void)
{
    for (const struct sample *s = samples; s->name; s++)
        printf("%-6s %s; default %" PRIu32 "\n", s->name, s->text, s->default_size);
    return EXIT_DONE;
}

static bool is_collection(const char *path)
{
    size_t length = strlen(path);
    return length > 4 && strcasecmp(path + length - 4, ".pvd") == 0;
}

static int make_series(const struct sample *sample, uint32_t size, uint32_t steps, uint32_t remesh, const char *output)
{
    struct tetlod_error error = {0};
    if (!sample->move)
        return cli_usage("sample", "nothing moves in '%s': --steps goes with wake", sample->name);
    if (!is_collection(output))
        return cli_usage("sample", "a series of --steps is written as -o OUT.pvd, not '%s'", output);
    return sample_series_write(sample, size, steps, remesh, output, &error) == TETLOD_OK ? EXIT_DONE : cli_fail(&error);
}

static int make(const struct sample *sample, uint32_t size, const char *output)
{
    struct tetmesh mesh = {0};
    struct tetlod_error error = {0};
    enum tetlod_status status = io_check_output(output, &error);
    if (status == TETLOD_OK)
        status = sample->make(&mesh, size, &error);
    if (status == TETLOD_OK)
        status = io_write(&mesh, output, &error);
    tetmesh_fini(&mesh);
    return status == TETLOD_OK ? EXIT_DONE : cli_fail(&error);
}

static int run(int argc, char **argv)
{
    static const struct option options[] = {
        {"output", required_argument, NULL, 'o'}, {"size", required_argument, NULL, 's'},
        {"list", no_argument, NULL, 'l'},         {"steps", required_argument, NULL, 't'},
        {"remesh", required_argument, NULL, 'r'}, {0}};
    const char *output = NULL, *size_text = NULL;
    uint64_t size = 0, steps = 0, remesh = 0;
    for (int option; (option = cli_option(&command_sample, argc, argv, "o:", options)) != -1;) {
        if (option == 'o')
            output = optarg;
        else if (option == 's')
            size_text = optarg;
        else if (option == 't' && !cli_parse_count(&command_sample, "steps", optarg, 1, MAX_SAMPLE_STEPS, &steps))
            return EXIT_USAGE;
        else if (option == 'r' && !cli_parse_count(&command_sample, "remesh", optarg, 1, MAX_SAMPLE_STEPS, &remesh))
            return EXIT_USAGE;
        else if (option != 't' && option != 'r')
            return option == 'l' ? list() : EXIT_USAGE;
    }
    if (!cli_operands(&command_sample, argc, 1, "the sample's NAME ('tetlod sample --list' shows them)"))
        return EXIT_USAGE;
    const struct sample *sample = sample_find(argv[optind]);
    if (!sample)
        return cli_usage("sample", "there is no sample '%s'; 'tetlod sample --list' shows them", argv[optind]);
    size = sample->default_size;
    if (size_text && !cli_parse_count(&command_sample, "size", size_text, sample->least_size, sample->most_size, &size))
        return EXIT_USAGE;
    if (!output)
        return cli_usage("sample", "-o OUT is missing: the file to write");
    if (remesh && !steps)
        return cli_usage("sample", "--remesh goes with --steps");
    int result = cli_check_output(&command_sample, output, NULL, NULL, 0);
    if (result == EXIT_DONE)
        result = steps ? make_series(sample, (uint32_t)size, (uint32_t)steps, (uint32_t)remesh, output)
                       : make(sample, (uint32_t)size, output);
    return result;
}

const struct command command_sample = {"sample", "make a sample mesh", help, run};
