/* SPDX-License-Identifier: BSD-3-Clause */
/* What is taken of a stream: a level, a finer one in boxes, or a step in time. The command line and the server read
 * their texts into these structs, and say in their own words what cannot be taken. */
#ifndef TETLOD_SELECTION_H
#define TETLOD_SELECTION_H

#include "src/stream/region.h"

enum selection_kind { TAKE_FINEST, TAKE_ERROR, TAKE_ABS_ERROR, TAKE_LEVEL, TAKE_TETS, TAKE_BYTES };

enum { MAX_BOXES = 16 };

struct selection {
    enum selection_kind kind;
    double error;   /* TAKE_ERROR: a fraction of the range. TAKE_ABS_ERROR: in the field's units */
    uint64_t count; /* TAKE_LEVEL, TAKE_TETS, TAKE_BYTES */
    uint32_t field; /* that the error is about; TETLOD_NONE: all controlled ones */
    enum tetlod_measure measure;
    double box_error; /* in the boxes, of the same kind, field and measure */
    bool box_finest;  /* or no error was said: the finest level; of a stream in pages, the finest in pages */
    size_t box_count;
    struct region_box boxes[MAX_BOXES];
};

/* The level; TETLOD_NONE: no level is within the error, or has the number. */
uint32_t selection_level(const struct tetlod_info *info, const struct selection *selection);

/* The level in the boxes; TETLOD_NONE: no level is within the error. It may be no finer than the other. */
uint32_t selection_box_level(const struct tetlod_info *info, const struct selection *selection);

/* Whether the index has a measure of a field's errors, or of those of all controlled fields (TETLOD_NONE). */
bool selection_measured(const struct tetlod_info *info, uint32_t field, enum tetlod_measure measure);

/* TETLOD_MEASURES: no measure has the name. */
enum tetlod_measure selection_measure(const char *name);

/* x0,y0,z0,x1,y1,z1, the least corner first. */
bool selection_read_box(const char *text, size_t size, struct region_box *out);

/* A step of a series and its coarsest form within an error. */
struct step_selection {
    bool by_time, absolute;
    bool own_ranges; /* the series' errors are fractions of each step's own range: metadata_own_ranges */
    double time;   /* the nearest step's is taken */
    uint64_t step; /* or its number, counted through all topology groups */
    double error;  /* a fraction of the range, or in the fields' units */
};

/* The topology group that has the step, and the step's number in it where it is chosen by its number. TETLOD_NONE:
 * there is no such step. */
uint32_t selection_topology(const struct tetlod_info *info, const struct step_selection *selection, uint64_t *out_step);

/* The step and the band, of the series of a topology group that has `step`; TETLOD_NONE: there is none. */
uint32_t selection_step(const struct tetlod_series_info *series, const struct step_selection *selection, uint64_t step);
uint32_t selection_band(const struct tetlod_series *series, const struct step_selection *selection, uint32_t step);

#endif
