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
#include "src/stream/series_time.h"
#include "src/util/array.h"
#include "src/util/file.h"
#include "src/util/parallel.h"

static const char help[] =
    "usage: tetlod plot FILE.tetlod -o OUT.svg [--field NAME] [--steps]\n"
    "\n"
    "Draws the error of a stream's levels against their tetrahedra and their bytes, both axes\n"
    "logarithmic, a line for each measure that the index has. With --steps it draws, for a series in\n"
    "time, the largest error at samples and the RMS of every step in each band, beside what the band\n"
    "promises.\n"
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
    return name ? tetlodi_fail(error, TETLOD_ERR_FIELD, "there is no field '%.100s'; 'tetlod info' lists the fields",
                               name)
                : tetlodi_fail(error, TETLOD_ERR_FIELD, "it has no field whose error could be drawn");
}

static enum tetlod_status write_plot(const struct tetlod_info *info, uint32_t field, const char *path,
                                     const char *output,
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

static enum tetlod_status measure_field(struct tetlod_file *file, uint32_t field, struct steps_errors *out,
                                        struct tetlod_error *error)
{
    struct progress progress;
    const struct steps_watch watch = {show_measuring, &progress};
    progress_init(&progress, false, false);
    enum tetlod_status status = steps_measure(file, field, parallel_cores(), &watch, out, error);
    progress_end(&progress);
    return status;
}

/* The errors of all steps, of one topology group after the other. */
struct all_steps {
    uint32_t count, bands, done;
    double *times;
    struct steps_errors errors;
};

static enum tetlod_status add_steps(struct all_steps *all, struct tetlod_file *file, const char *name,
                                    struct tetlod_error *error)
{
    struct tetlod_series *series;
    struct steps_errors errors = {0};
    TETLOD_TRY(tetlod_series_new(&series, file, error));
    const struct tetlod_series_info *steps = tetlod_series_info(series);
    uint32_t field = series_field(steps, tetlod_info(file), name), room = all->count - all->done;
    enum tetlod_status status = TETLOD_OK;
    if (field == TETLOD_NONE)
        status = tetlodi_fail(error, TETLOD_ERR_FIELD,
                              "there are no steps of a field '%.100s'; 'tetlod info' lists those that have them", name);
    else if (steps->band_count - 1 != all->bands || steps->step_count > room)
        status = tetlodi_fail(error, TETLOD_ERR_STREAM,
                              "a topology group has other bands or steps than the stream says");
    else
        status = measure_field(file, field, &errors, error);
    for (uint32_t s = 0; s < steps->step_count && status == TETLOD_OK; s++) {
        all->times[all->done + s] = steps->times[s];
        for (uint32_t b = 0; b < all->bands; b++) {
            all->errors.sampled[(size_t)b * all->count + all->done + s] = errors.sampled[(size_t)b *
                                                                                         steps->step_count + s];
            all->errors.rms[(size_t)b * all->count + all->done + s] = errors.rms[(size_t)b * steps->step_count + s];
        }
    }
    all->done += steps->step_count;
    free(errors.sampled);
    free(errors.rms);
    tetlod_series_free(series);
    return status;
}

static enum tetlod_status measure_steps(struct all_steps *all, struct tetlod_file *file, const char *name,
                                        struct tetlod_error *error)
{
    const struct tetlod_info *info = tetlod_info(file);
    size_t count = (size_t)all->bands * all->count;
    all->times = array_new(all->count, sizeof *all->times);
    all->errors = (struct steps_errors){array_new(count, sizeof(double)), array_new(count, sizeof(double))};
    if (!all->times || !all->errors.sampled || !all->errors.rms)
        return tetlodi_fail_nomem(error, "the errors of the steps", 2 * count * sizeof(double));
    if (!info->topology_count)
        return add_steps(all, file, name, error);
    for (uint32_t t = 0; t < info->topology_count; t++) {
        struct tetlod_file *part;
        TETLOD_TRY(tetlod_open_topology(&part, file, t, error));
        enum tetlod_status status = add_steps(all, part, name, error);
        tetlod_close(part);
        TETLOD_TRY(status);
    }
    return TETLOD_OK;
}

static enum tetlod_status write_steps(const struct all_steps *all, const struct tetlod_series_info *steps,
                                      const char *name, const char *path,
                                      const char *output, struct tetlod_error *error)
{
    const struct plot_steps picture = {all->count, all->bands, all->times, steps->bands, all->errors.sampled,
                                       all->errors.rms};
    struct file_output *out;
    char id[256];
    TETLOD_TRY(file_output_open(&out, output, error));
    struct tetlodi_sink sink = file_output_sink(out);
    stream_id(path, id, sizeof id);
    return file_output_finish(out, plot_write_steps(&picture, name, id, &sink, error), error);
}

static enum tetlod_status plot_steps(struct tetlod_file *file, const char *path, const char *output, const char *name,
                                     struct tetlod_error *error)
{
    struct tetlod_series *series;
    struct tetlod_error inner;
    const struct tetlod_info *info = tetlod_info(file);
    if (tetlod_series_new(&series, file, &inner) != TETLOD_OK)
        return tetlodi_fail(error, TETLOD_ERR_ARGUMENT, "%s: --steps: %.230s", path, inner.message);
    const struct tetlod_series_info *steps = tetlod_series_info(series);
    struct all_steps all = {.count = series_step_count(info, steps), .bands = steps->band_count - 1};
    const char *shown = name ? name : info->fields[steps->fields[0]].name;
    enum tetlod_status status = measure_steps(&all, file, shown, &inner);
    if (status != TETLOD_OK)
        tetlodi_fail(error, status, "%s: %.230s", path, inner.message);
    else
        status = write_steps(&all, steps, shown, path, output, error);
    free(all.times);
    free(all.errors.sampled);
    free(all.errors.rms);
    tetlod_series_free(series);
    return status;
}

static enum tetlod_status plot_levels(struct tetlod_file *file, const char *path, const char *output, const char *name,
                                      struct tetlod_error *error)
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
    static const struct option options[] = {{"output", required_argument, NULL, 'o'},
                                            {"field", required_argument, NULL, 'f'},
                                            {"steps", no_argument, NULL, 's'},
                                            {0}};
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
    int result = cli_check_output(&command_plot, output, "svg", (const char *const[]){argv[optind]}, 1);
    return result == EXIT_DONE ? plot(argv[optind], output, field, steps) : result;
}

const struct command command_plot = {"plot", "draw error against tetrahedra and bytes", help, run};
