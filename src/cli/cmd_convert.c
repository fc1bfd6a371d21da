/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/cli/cli.h"
#include "src/cli/reading.h"
#include "src/io/io.h"

static const char help[] =
    "usage: tetlod convert INPUT -o OUT [OPTIONS]\n"
    "\n"
    "Reads a mesh and writes it in the format that OUT's extension names. Cells that are not tetrahedra\n"
    "are split so that neighbours match, points that no tetrahedron uses are dropped; each such change is\n"
    "reported.\n"
    "\n"
    "  -o, --output OUT        the file to write; 'tetlod formats' lists the formats that are read and\n"
    "                          written\n"
    READING_HELP
    "\n"
    "example: tetlod convert bluntfinxyz.bin --q bluntfinq.bin -o blunt.vtu\n";

static int convert(const char *input, const struct io_read_options *options, const char *output)
{
    struct tetmesh mesh;
    struct tetlod_error error = {0};
    struct io_report report;
    enum tetlod_status status = io_check_output(output, &error);
    if (status == TETLOD_OK)
        status = io_read(&mesh, input, options, &report, &error);
    if (status != TETLOD_OK)
        return cli_fail(&error);
    status = io_write(&mesh, output, &error);
    if (status == TETLOD_OK)
        reading_notes("convert", &report, &mesh);
    tetmesh_fini(&mesh);
    return status == TETLOD_OK ? EXIT_DONE : cli_fail(&error);
}

static int run(int argc, char **argv)
{
    static const struct option options[] = {{"output", required_argument, NULL, 'o'}, READING_OPTIONS, {0}};
    struct reading reading = {0};
    const char *output = NULL;
    for (int option; (option = cli_option(&command_convert, argc, argv, "o:", options)) != -1;) {
        if (option == 'o')
            output = optarg;
        else if (!reading_option(&reading, &command_convert, option, optarg))
            return EXIT_USAGE;
    }
    if (!cli_operands(&command_convert, argc, 1, "the INPUT mesh"))
        return EXIT_USAGE;
    if (!output)
        return cli_usage("convert", "-o OUT is missing: the file to write");
    const char *const inputs[] = {argv[optind], reading.options.solution};
    if (!cli_check_output(&command_convert, output, NULL, inputs, 2))
        return EXIT_USAGE;
    reading.options.output = output;
    return convert(argv[optind], &reading.options, output);
}

const struct command command_convert = {"convert", "from any readable mesh to any writable one", help, run};
