/* SPDX-License-Identifier: BSD-3-Clause */
/* The steps of a series, read one at a time: of a file with several times, or a file each. */
#ifndef TETLOD_SERIES_INPUT_H
#define TETLOD_SERIES_INPUT_H

#include "src/cli/progress.h"
#include "src/cli/reading.h"
#include "src/pipeline/build_series.h"
#include "src/util/spool.h"


struct series_input {
    const char *const *paths; /* as the command line has them */
    uint32_t path_count;
    uint64_t begin, end, stride; /* of --times: steps from begin to end, every stride-th */
    /* their count; the first of the current ones, which all have the same tetrahedra */
    uint32_t wanted, from;
    bool numbered;         /* numbers stand for times */
    double bands[MAX_SERIES_BANDS];
    struct build_series series;
    double *times;
    enum tetlod_type *types;
    struct spool spool; /* the controlled fields' values */
    struct build_series_cells *cells; /* fields of cells of the first step */
    struct spool cell_spool;          /* their values */
    uint64_t rounded; /* coordinates of points that move which come back to the last place only */
    uint32_t own_times; /* numbers stand for times, which fall or are not there */
};

/* To begin with: all steps, the usual bands. */
void series_input_init(struct series_input *input);
void series_input_fini(struct series_input *input);

/* --times A:B:C, --bands, and --range. False after a message. */
bool series_input_parse_times(struct series_input *input, const struct command *command, const char *text);
bool series_input_parse_bands(struct series_input *input, const struct command *command, const char *text);
bool series_input_parse_range(struct series_input *input, const struct command *command, const char *text);

/* The number, among all, of step `step` of the current ones. */
uint64_t series_input_number(const struct series_input *input, uint64_t step);

/* Reads one step's mesh: `step` counts from 0 over all of them, before --times. */
TETLOD_CHECKED enum tetlod_status series_input_read(const struct series_input *input, uint64_t step,
                                                    const struct reading *reading, struct tetmesh *out,
                                                    struct io_report *report, struct tetlod_error *error);

/* Counts what --times chooses of the `steps` that there are. ERR_LIMIT. */
TETLOD_CHECKED enum tetlod_status series_input_count(struct series_input *input, uint64_t steps,
                                                     struct tetlod_error *error);

/* Takes the steps over, from input->from on: what `controls` names of each, up to one that has other tetrahedra than
 * `first`, their first. Where points move, how far becomes a field of `first` and the last of `controls`, which has
 * room for it. The message names the step. */
TETLOD_CHECKED enum tetlod_status series_input_load(struct series_input *input, const struct reading *reading,
                                                    struct tetmesh *first, struct build_control *controls,
                                                    uint32_t *count, struct progress *progress,
                                                    struct tetlod_error *error);

/* Are there steps behind those that were loaded? */
bool series_input_goes_on(const struct series_input *input);

/* Fails with what is wrong with a step, and which it is. */
enum tetlod_status series_input_blame(const struct series_input *input, uint64_t number, enum tetlod_status status,
                                      const struct tetlod_error *inner, struct tetlod_error *error);

#endif
