/* SPDX-License-Identifier: BSD-3-Clause */
#include <unistd.h>

#include "format/fail.h"
#include "src/cli/cli.h"
#include "src/report/info_json.h"
#include "src/report/plot.h"
#include "src/util/file.h"

static const char help[] =
    "usage: tetlod plot FILE.tetlod -o OUT.svg [--field NAME]\n"
    "\n"
    "Draws the error of a stream's levels against their tetrahedra and their bytes, both axes logarithmic, a line for each\n"
    "measure that the index has.\n"
    "\n"
    "  -o, --output OUT.svg  the picture\n"
    "      --field NAME      the field (default: the first that the stream was built to control)\n"
    "\n"
    "Errors are percentages of the field's range; levels without any error are not drawn.\n";

static enum tetlod_status choose_field(const struct tetlod_info *info, const char *name, uint32_t *out,
                                       struct tetlod_error *error)
{
    *out = name ? tetlod_field_index(info, name) : 0;
    for (uint32_t f = info->field_count; f-- > 0 && !name;)
        if (info->fields[f].controlled)
            *out = f;
    if (*out < info->field_count)
        return TETLOD_OK;
    return name ? tetlodi_fail(error, TETLOD_ERR_FIELD, "there is no field '%.100s'; 'tetlod info' lists the fields", name)
                : tetlodi_fail(error, TETLOD_ERR_FIELD, "it has no field whose error could be drawn");
}

static enum tetlod_status write_plot(const struct tetlod_info *info, uint32_t field, const char *path, const char *output,
                                     struct tetlod_error *error)
{
    struct file_output *out;
    char id[256];
    stream_id(path, id, sizeof id);
    TETLOD_TRY(file_output_open(&out, output, error));
    struct tetlodi_sink sink = file_output_sink(out);
    enum tetlod_status status = plot_write(info, field, id, &sink, error);
    if (status == TETLOD_OK)
        return file_output_commit(out, error);
    file_output_abort(out);
    return status;
}

static int plot(const char *path, const char *output, const char *name)
{
    struct tetlod_error error = {0}, inner = {0};
    struct tetlod_file *file;
    uint32_t field;
    int fd;
    enum tetlod_status status = cli_open_stream(path, 1, &file, &fd, &error);
    if (status != TETLOD_OK)
        return cli_fail(&error);
    status = choose_field(tetlod_info(file), name, &field, &inner);
    if (status != TETLOD_OK)
        tetlodi_fail(&error, status, "%s: %.230s", path, inner.message);
    else
        status = write_plot(tetlod_info(file), field, path, output, &error);
    tetlod_close(file);
    close(fd);
    return status == TETLOD_OK ? EXIT_DONE : cli_fail(&error);
}

static int run(int argc, char **argv)
{
    static const struct option options[] = {
        {"output", required_argument, NULL, 'o'}, {"field", required_argument, NULL, 'f'}, {0}};
    const char *output = NULL, *field = NULL;
    for (int option; (option = cli_option(&command_plot, argc, argv, "o:", options)) != -1;) {
        if (option == 'o')
            output = optarg;
        else if (option == 'f')
            field = optarg;
        else
            return EXIT_USAGE;
    }
    if (!cli_operands(&command_plot, argc, 1, "the stream"))
        return EXIT_USAGE;
    if (!output)
        return cli_usage("plot", "where to? give -o OUT.svg");
    if (!cli_check_output(&command_plot, output, "svg", (const char *const[]){argv[optind]}, 1))
        return EXIT_USAGE;
    return plot(argv[optind], output, field);
}

const struct command command_plot = {"plot", "draw error against tetrahedra and bytes", help, run};
