/* SPDX-License-Identifier: BSD-3-Clause */
#include <unistd.h>

#include "format/fail.h"
#include "src/cli/cli.h"
#include "src/cli/reading.h"
#include "src/cli/show.h"
#include "src/io/io.h"
#include "src/util/file.h"
#include "src/util/parallel.h"

static const char help[] =
    "usage: tetlod convert INPUT -o OUT [OPTIONS]\n"
    "\n"
    "Reads a mesh and writes it in the format that OUT's extension names. Cells that are not tetrahedra\n"
    "are split so that neighbours match, points that no tetrahedron uses are dropped; each such change is\n"
    "reported.\n"
    "\n"
    "  -o, --output OUT        the file to write; 'tetlod formats' lists the formats that are read and\n"
    "                          written\n"
    "      --stream            INPUT is a stream, OUT.vtkhdf a VTKHDF file with the whole stream in it,\n"
    "                          as 'tetlod build -o OUT.vtkhdf' makes it: ParaView and VTK see a coarse\n"
    "                          level, tetlod the stream. 'tetlod extract OUT.vtkhdf -o X.tetlod' takes it\n"
    "                          out again\n"
    "      --show E            with --stream: that level's error, a fraction of the range (default: the\n"
    "                          finest level of at most 200,000 tetrahedra)\n"
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

/* The stream as it is, in a VTKHDF file. */
static int convert_stream(const char *input, double show_error, const char *output)
{
    struct tetlod_error error = {0}, inner = {0};
    struct tetlod_file *file;
    struct file_output *out;
    int fd;
    if (cli_open_stream(input, parallel_cores(), &file, &fd, &error) != TETLOD_OK)
        return cli_fail(&error);
    enum tetlod_status status = file_output_open(&out, output, &error);
    if (status == TETLOD_OK) {
        const struct tetlodi_sink sink = file_output_sink(out);
        status = cli_is_whole(tetlod_info(file), fd)
                     ? show_write(file, show_error, &sink, &inner)
                     : tetlodi_fail(&inner, TETLOD_ERR_TRUNCATED,
                                    "it is cut off, and a VTKHDF file holds the whole stream");
        if (status != TETLOD_OK)
            tetlodi_fail(&error, status, "%s: %.400s", input, inner.message);
        status = file_output_finish(out, status, &error);
    }
    tetlod_close(file);
    close(fd);
    return status == TETLOD_OK ? EXIT_DONE : cli_fail(&error);
}

static int run(int argc, char **argv)
{
    static const struct option options[] = {{"output", required_argument, NULL, 'o'},
                                            {"stream", no_argument, NULL, 'S'},
                                            {"show", required_argument, NULL, 'E'},
                                            READING_OPTIONS,
                                            {0}};
    struct reading reading = {0};
    const char *output = NULL;
    bool is_stream = false;
    double show_error = -1;
    for (int option; (option = cli_option(&command_convert, argc, argv, "o:", options)) != -1;) {
        if (option == 'o')
            output = optarg;
        else if (option == 'S')
            is_stream = true;
        else if (option == 'E' && !cli_parse_fraction(&command_convert, "show", optarg, &show_error))
            return EXIT_USAGE;
        else if (option != 'E' && !reading_option(&reading, &command_convert, option, optarg))
            return EXIT_USAGE;
    }
    if (!cli_operands(&command_convert, argc, 1, "the INPUT mesh"))
        return EXIT_USAGE;
    if (!output)
        return cli_usage("convert", "-o OUT is missing: the file to write");
    const char *const inputs[] = {argv[optind], reading.options.solution};
    if (is_stream && !show_is_output(output))
        return cli_usage("convert", "--stream writes OUT.vtkhdf; for other formats leave it out, for OUT.tetlod take "
                                    "'tetlod extract'");
    if (show_error >= 0 && !is_stream)
        return cli_usage("convert", "--show goes with --stream");
    reading.options.output = output;
    int result = cli_check_output(&command_convert, output, NULL, inputs, 2);
    if (result == EXIT_DONE)
        result = is_stream ? convert_stream(argv[optind], show_error, output)
                           : convert(argv[optind], &reading.options, output);
    return result;
}

const struct command command_convert = {"convert", "from any readable mesh to any writable one", help, run};
