/* SPDX-License-Identifier: BSD-3-Clause */
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "format/fail.h"
#include "src/cli/against_steps.h"
#include "src/cli/cli.h"
#include "src/cli/progress.h"
#include "src/report/info_json.h"
#include "src/report/plot.h"
#include "src/util/file.h"
#include "src/util/parallel.h"

static const char help[] =
    "usage: tetlod plot FILE.tetlod -o OUT.svg [--field NAME] [--steps]\n"
    "\n"
    "Draws the error of a stream's levels against their tetrahedra and their bytes, both axes logarithmic, a line for each\n"
    "measure that the index has. With --steps, of a series in time: the largest error at samples and the RMS of every step in\n"
    "each band, beside what the band promises.\n"
    "\n"
    "  -o, --output OUT.svg  the picture\n"
    "      --field NAME      the field (default: the first that the stream was built to control)\n"
    "      --steps           the errors of a series over time, measured against its exact values\n"
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

static uint32_t series_field(const struct tetlod_series_info *steps, const struct tetlod_info *info, const char *name)
{
    for (uint32_t f = 0; f < steps->field_count; f++)
        if (!name || strcmp(info->fields[steps->fields[f]].name, name) == 0)
            return f;
    return TETLOD_NONE;
}

static void show_measuring(void *progress, double done)
{
    progress_update(progress, "measure", done);
}

static enum tetlod_status measure_steps(struct tetlod_file *file, uint32_t field, struct steps_errors *out, struct tetlod_error *error)
{
    struct progress progress;
    const struct steps_watch watch = {show_measuring, &progress};
    progress_init(&progress, false, false);
    enum tetlod_status status = steps_measure(file, field, parallel_cores(), &watch, out, error);
    progress_end(&progress);
    return status;
}

static enum tetlod_status write_steps(struct tetlod_file *file, const struct tetlod_series *series, uint32_t field, const char *path,
                                      const char *output, struct tetlod_error *error)
{
    const struct tetlod_series_info *steps = tetlod_series_info(series);
    struct steps_errors errors;
    struct file_output *out;
    char id[256];
    enum tetlod_status status = measure_steps(file, field, &errors, error);
    if (status == TETLOD_OK)
        status = file_output_open(&out, output, error);
    if (status == TETLOD_OK) {
        const struct plot_steps picture = {steps->step_count, steps->band_count - 1, steps->times, steps->bands, errors.sampled, errors.rms};
        struct tetlodi_sink sink = file_output_sink(out);
        stream_id(path, id, sizeof id);
        status = plot_write_steps(&picture, tetlod_info(file)->fields[steps->fields[field]].name, id, &sink, error);
        status = file_output_finish(out, status, error);
    }
    free(errors.sampled);
    free(errors.rms);
    return status;
}

static enum tetlod_status plot_steps(struct tetlod_file *file, const char *path, const char *output, const char *name, struct tetlod_error *error)
{
    struct tetlod_series *series;
    struct tetlod_error inner;
    if (tetlod_series_new(&series, file, &inner) != TETLOD_OK)
        return tetlodi_fail(error, TETLOD_ERR_ARGUMENT, "%s: --steps: %.230s", path, inner.message);
    uint32_t field = series_field(tetlod_series_info(series), tetlod_info(file), name);
    enum tetlod_status status = field == TETLOD_NONE ? tetlodi_fail(error, TETLOD_ERR_FIELD, "%s: there are no steps of a field '%.100s'; 'tetlod info' lists those that have them", path, name)
                                                      : write_steps(file, series, field, path, output, error);
    tetlod_series_free(series);
    return status;
}

static enum tetlod_status plot_levels(struct tetlod_file *file, const char *path, const char *output, const char *name, struct tetlod_error *error)
{
    struct tetlod_error inner = {0};
    uint32_t field;
    enum tetlod_status status = choose_field(tetlod_info(file), name, &field, &inner);
    if (status != TETLOD_OK)
        return tetlodi_fail(error, status, "%s: %.230s", path, inner.message);
    return write_plot(tetlod_info(file), field, path, output, error);
}

static int plot(const char *path, const char *output, const char *name, bool steps)
{
    struct tetlod_error error = {0};
    struct tetlod_file *file;
    int fd;
    enum tetlod_status status = cli_open_stream(path, 1, &file, &fd, &error);
    if (status != TETLOD_OK)
        return cli_fail(&error);
    status = steps ? plot_steps(file, path, output, name, &error) : plot_levels(file, path, output, name, &error);
    tetlod_close(file);
    close(fd);
    return status == TETLOD_OK ? EXIT_DONE : cli_fail(&error);
}

static int run(int argc, char **argv)
{
    static const struct option options[] = {
        {"output", required_argument, NULL, 'o'}, {"field", required_argument, NULL, 'f'}, {"steps", no_argument, NULL, 's'}, {0}};
    const char *output = NULL, *field = NULL;
    bool steps = false;
    for (int option; (option = cli_option(&command_plot, argc, argv, "o:", options)) != -1;) {
        if (option == 'o')
            output = optarg;
        else if (option == 'f')
            field = optarg;
        else if (option == 's')
            steps = true;
        else
            return EXIT_USAGE;
    }
    if (!cli_operands(&command_plot, argc, 1, "the stream"))
        return EXIT_USAGE;
    if (!output)
        return cli_usage("plot", "where to? give -o OUT.svg");
    if (!cli_check_output(&command_plot, output, "svg", (const char *const[]){argv[optind]}, 1))
        return EXIT_USAGE;
    return plot(argv[optind], output, field, steps);
}

const struct command command_plot = {"plot", "draw error against tetrahedra and bytes", help, run};
