/* SPDX-License-Identifier: BSD-3-Clause */
/* What the two halves of a series' build share: bounding (build_series.c) and encoding (encode_series.c). */
#ifndef TETLOD_SERIES_PARTS_H
#define TETLOD_SERIES_PARTS_H

#include "format/coding/cell_steps.h"
#include "src/log/contraction_log.h"
#include "src/pipeline/build_options.h"
#include "src/simplify/retrace.h"
#include "src/util/spool.h"

struct series_encoding;

/* Steps of a band's grid in its error, at least: a value is half a step off by rounding. The level may be off by the
 * rest. */
enum { GRID_STEPS = 50 };
static const double HALF_STEP = 0.5 / GRID_STEPS, LEVEL_SHARE = 1 - 0.5 / GRID_STEPS;

struct series_build {
    const struct tetmesh *mesh; /* the first step */
    const struct build_options *options;
    const struct build_series *input;
    uint32_t component_count; /* of all controls, at one step */
    double (*ranges)[2];      /* [control] over all steps */
    double *units;            /* [step][control] what errors are fractions of */
    double reach;             /* the largest coordinate of a point that moves, over all steps */
    uint32_t key_count;
    const struct contraction_log *log;
    struct simplify_options simplify;
    double *worst;            /* [mark][control] the largest bound over the steps so far, a fraction of the range */
    uint32_t *band_marks;     /* [band] */
    struct series_encoding *encoding;
};

uint32_t series_components(const struct series_build *series, uint32_t control);

/* Of a control's range over all steps. */
static inline double series_width(const struct series_build *series, uint32_t control)
{
    return series->ranges[control][1] - series->ranges[control][0];
}

static inline double series_unit(const struct series_build *series, uint32_t step, uint32_t control)
{
    return series->units[(size_t)step * series->options->control_count + control];
}

static inline bool series_is_displacement(const struct series_build *series, uint32_t control)
{
    return series->input->points_move && control + 1 == series->options->control_count;
}

/* What rounding to the positions' type adds to a band's error of how far points move (PROOF.md, 10); 0 of other
 * controls, and where a band is so narrow that it holds that field bit for bit. */
double series_rounding(const struct series_build *series, uint32_t control, uint32_t band);

/* The error that a band has in a control's range over all steps, of which the rounding takes all. */
bool series_is_within_rounding(const struct series_build *series, uint32_t control, uint32_t band);

/* The values of a control at a step: [components * vertices]. */
TETLOD_CHECKED enum tetlod_status series_load(const struct series_build *series, uint32_t step, uint32_t control,
                                              double *out,
                                              struct tetlod_error *error);

/* Retraces `count` steps, whose numbers are listed: components are counted step by step, control by control. */
TETLOD_CHECKED enum tetlod_status
series_retrace(const struct series_build *series, const uint32_t *steps, uint32_t count,
               enum tetlod_status (*visit)(void *opaque, const struct retrace_mark *mark), void *opaque,
               struct tetlod_error *error);

/* Steps that are retraced together: groups of steps. */
uint32_t series_batch(const struct series_build *series);

void series_encoding_free(struct series_encoding *encoding);

/* The steps of fields of cells (encode_cells.c): the table and the frames of each field. */
struct series_cells_encoding {
    struct tetlodi_cell_time time;
    struct spool *spools;          /* [field] */
    struct tetlod_source *sources; /* the same, in the end */
    struct tetlodi_buffer table;
    uint64_t numbers, bytes;       /* that decoding the frames so far counts (SPEC 2.3); of these frames */
};

/* Encodes all steps; `rows` as of series_sections. To be freed also after a failure. */
TETLOD_CHECKED enum tetlod_status series_cells_encode(const struct series_build *series,
                                                      const struct tetlodi_late_rows *rows,
                                                      struct series_cells_encoding *out, struct tetlod_error *error);
void series_cells_encoding_fini(struct series_cells_encoding *encoding);

#endif
