/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/cli/series_input.h"

#include <inttypes.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "format/fail.h"
#include "src/mesh/displacement.h"
#include "src/pipeline/series_spool.h"
#include "src/util/array.h"

void series_input_init(struct series_input *input)
{
    *input = (struct series_input){.end = UINT64_MAX, .stride = 1};
    const double *usual = build_series_bands(&input->series.band_count);
    memcpy(input->bands, usual, input->series.band_count * sizeof *usual);
}

/* Reading it again must not keep what was read before. */
static void forget(struct series_input *input)
{
    spool_close(&input->spool);
    spool_close(&input->cell_spool);
    input->rounded = 0;
}

void series_input_fini(struct series_input *input)
{
    forget(input);
    free(input->times);
    free(input->types);
    free(input->cells);
    input->times = NULL;
    input->types = NULL;
    input->cells = NULL;
    input->series.points_move = false;
}

/* ---- options */

bool series_input_parse_times(struct series_input *input, const struct command *command, const char *text)
{
    uint64_t *const numbers[3] = {&input->begin, &input->end, &input->stride};
    const char *at = text;
    bool good = *text != 0;
    for (int i = 0; i < 3 && good && *at; i++) {
        char *end;
        if (*at != ':') {
            good = *at >= '0' && *at <= '9';
            *numbers[i] = strtoull(at, &end, 10);
            at = good ? end : at;
        }
        good = good && (*at == 0 || (*at == ':' && i < 2));
        at += good && *at == ':';
    }
    good = good && *at == 0 && input->begin <= input->end && input->stride;
    if (!good)
        cli_usage(command->name,
                  "--times takes A:B:C: the steps numbered A to B, every C-th of them; all three may be left out; not "
                  "'%s'", text);
    return good;
}

bool series_input_parse_bands(struct series_input *input, const struct command *command, const char *text)
{
    uint32_t count = 0;
    char part[32];
    for (const char *at = text; *at;) {
        size_t length = strcspn(at, ",");
        double error;
        snprintf(part, sizeof part, "%.*s", (int)(length < sizeof part ? length : sizeof part), at);
        if (!cli_parse_fraction(command, "bands", part, &error))
            return false;
        if (count + 1 >= MAX_SERIES_BANDS || !(error > 0) || error > 1 || (count && error >= input->bands[count - 1])) {
            cli_usage(command->name,
                      "--bands takes falling errors up to 1, at most %d, such as 5%%,1%%,0.1%%; not '%s'",
                      MAX_SERIES_BANDS - 1, text);
            return false;
        }
        input->bands[count++] = error;
        at += length + (at[length] == ',');
    }
    input->bands[count++] = 0; // the exact one is always there
    input->series.band_count = count;
    return true;
}

bool series_input_parse_range(struct series_input *input, const struct command *command, const char *text)
{
    input->series.own_ranges = strcmp(text, "step") == 0;
    if (!input->series.own_ranges && strcmp(text, "series") != 0)
        cli_usage(command->name, "--range takes series or step, not '%s'", text);
    return input->series.own_ranges || strcmp(text, "series") == 0;
}

/* ---- steps */

uint64_t series_input_number(const struct series_input *input, uint64_t step)
{
    return input->begin + (input->from + step) * input->stride;
}

enum tetlod_status series_input_read(const struct series_input *input, uint64_t step, const struct reading *reading,
                                     struct tetmesh *out,
                                     struct io_report *report, struct tetlod_error *error)
{
    char number[24];
    struct io_read_options options = reading->options;
    *report = (struct io_report){0};
    if (input->path_count > 1)
        return io_read(out, input->paths[step], &options, report, error);
    snprintf(number, sizeof number, "%" PRIu64, step);
    options.time = number;
    return io_read(out, input->paths[0], &options, report, error);
}

/* The step's mesh, which has the tetrahedra of the first one, gets its points. TETLOD_MORE: they move after all. */
static enum tetlod_status settle(struct series_input *input, struct tetmesh *mesh, const struct tetmesh *first,
                                 struct tetlod_error *error)
{
    if (input->series.points_move)
        return displacement_take(mesh, first, &input->rounded, error);
    input->series.points_move = displacement_moves(mesh, first);
    return input->series.points_move ? TETLOD_MORE : TETLOD_OK;
}

/* One step's values. TETLOD_MORE: a field needs float64, or another field is needed, after all. */
static enum tetlod_status put_step(struct series_input *input, struct tetmesh *mesh, const struct tetmesh *first,
                                   const struct build_control *controls, uint32_t count, struct tetlod_error *error)
{
    TETLOD_TRY(settle(input, mesh, first, error));
    TETLOD_TRY(series_spool_put(&input->spool, mesh, first, controls, count, input->types, error));
    return series_spool_put_cells(&input->cell_spool, mesh, first, input->cells, error);
}

enum tetlod_status series_input_blame(const struct series_input *input, uint64_t number, enum tetlod_status status,
                                      const struct tetlod_error *inner, struct tetlod_error *error)
{
    bool named = input->path_count > 1;
    return tetlodi_fail(error, status, "step %" PRIu64 "%s%.60s: %.160s", number, named ? ", " : "",
                        named ? cli_base_name(input->paths[number]) : "",
                        inner->message);
}

static enum tetlod_status put_steps(struct series_input *input, const struct reading *reading,
                                    const struct tetmesh *first, const struct build_control *controls, uint32_t count,
                                    struct progress *progress, struct tetlod_error *error)
{
    forget(input);
    TETLOD_TRY(spool_open(&input->spool, error));
    TETLOD_TRY(spool_open(&input->cell_spool, error));
    series_spool_cells(first, input->cells);
    uint32_t most = input->wanted - input->from, s = 0;
    for (bool same = true; s < most && same; s += same) {
        struct tetmesh mesh = {0};
        struct io_report report;
        struct tetlod_error inner = {0};
        uint64_t number = series_input_number(input, s);
        TETLOD_TRY(series_input_read(input, number, reading, &mesh, &report, error));
        input->times[s] = report.steps ? report.time : (double)number;
        same = !displacement_obstacle(&mesh, first);
        enum tetlod_status status = same ? put_step(input, &mesh, first, controls, count, &inner) : TETLOD_OK;
        tetmesh_fini(&mesh);
        if (status == TETLOD_MORE)
            return status;
        if (status != TETLOD_OK)
            return series_input_blame(input, number, status, &inner, error);
        progress_update(progress, "read", (s + 1.0) / most);
    }
    input->series.step_count = s;
    return TETLOD_OK;
}

/* Times that do not rise tell nothing. */
static void check_times(struct series_input *input)
{
    bool rise = !input->numbered;
    for (uint32_t s = 1; s < input->series.step_count; s++)
        rise &= input->times[s] > input->times[s - 1];
    for (uint32_t s = 0; s < input->series.step_count && !rise; s++)
        input->times[s] = (double)series_input_number(input, s);
    input->own_times = !rise;
}

/* The displacement is a field as others, and drives as they do. */
static enum tetlod_status control_displacement(struct series_input *input, struct tetmesh *first,
                                               struct build_control *controls, uint32_t *count,
                                               struct tetlod_error *error)
{
    TETLOD_TRY(displacement_take(first, first, &input->rounded, error));
    controls[*count] = (struct build_control){.field = first->field_count - 1};
    input->types[(*count)++] = TETLOD_FLOAT32;
    return TETLOD_OK;
}

/* All steps, once more whenever one shows that more is needed of those before it. */
static enum tetlod_status put_all(struct series_input *input, const struct reading *reading, struct tetmesh *first,
                                  struct build_control *controls,
                                  uint32_t *count, struct progress *progress, struct tetlod_error *error)
{
    for (;;) {
        bool moved = input->series.points_move;
        enum tetlod_status status = put_steps(input, reading, first, controls, *count, progress, error);
        if (status != TETLOD_MORE)
            return status;
        if (input->series.points_move != moved)
            TETLOD_TRY(control_displacement(input, first, controls, count, error));
    }
}

enum tetlod_status series_input_count(struct series_input *input, uint64_t steps, struct tetlod_error *error)
{
    uint64_t last = input->end < steps ? input->end : steps - 1, wanted = (last - input->begin) / input->stride + 1;
    if (wanted > MAX_SERIES_STEPS)
        return tetlodi_fail(error, TETLOD_ERR_LIMIT,
                            "%" PRIu64 " steps are more than a stream can have (%d); --times takes fewer",
                            wanted, MAX_SERIES_STEPS);
    input->wanted = (uint32_t)wanted;
    return TETLOD_OK;
}

enum tetlod_status series_input_load(struct series_input *input, const struct reading *reading, struct tetmesh *first,
                                     struct build_control *controls, uint32_t *count, struct progress *progress,
                                     struct tetlod_error *error)
{
    uint32_t most = input->wanted - input->from;
    input->times = array_new(most, sizeof *input->times);
    // float32 until a step says otherwise; and of the displacement
    input->types = array_zero(*count + (size_t)1, sizeof *input->types);
    input->cells = array_zero(first->cell_field_count, sizeof *input->cells);
    if (!input->times || !input->types || !input->cells)
        return tetlodi_fail_nomem(error, "the times", most * sizeof *input->times);
    TETLOD_TRY(put_all(input, reading, first, controls, count, progress, error));
    check_times(input);
    TETLOD_TRY(spool_source(&input->spool, &input->series.values, error));
    TETLOD_TRY(spool_source(&input->cell_spool, &input->series.cell_values, error));
    input->series.cells = input->cells;
    input->series.cell_count = first->cell_field_count;
    input->series.times = input->times;
    input->series.types = input->types;
    input->series.bands = input->bands;
    return TETLOD_OK;
}

bool series_input_goes_on(const struct series_input *input)
{
    return input->from + input->series.step_count < input->wanted;
}
