/* SPDX-License-Identifier: BSD-3-Clause */
/* Values of cells at the steps of a series (SPEC 3.7): the table, and values as the codes of step_code.h. Not
 * installed. */
#ifndef TETLOD_CELL_STEPS_H
#define TETLOD_CELL_STEPS_H

#include "format/coding/step_code.h"
#include "format/coding/time_table.h"

struct tetlodi_cell_time {
    uint32_t field_count, step_count, group_count;
    uint32_t *fields;                /* [field] number among the stream's cell fields, ascending; owned, as all here */
    double (*ranges)[2];             /* [field] over all steps */
    uint64_t *sizes;                 /* [field][step] bytes of the frame; 0: the values are those of the step before */
    uint8_t (*digests)[DIGEST_SIZE]; /* [field][group] */
    uint64_t *ends;                  /* [field][step] of the frame among the field's; of a table that was decoded */
};

/* Room for all of it, zero. False: out of memory. */
bool tetlodi_cell_time_allocate(struct tetlodi_cell_time *time, uint32_t fields, uint32_t steps);
void tetlodi_cell_time_fini(struct tetlodi_cell_time *time);

/* As the section's bytes, and back. Decoding checks what the table says by itself. ERR_STREAM, ERR_NOMEM. */
void tetlodi_cell_time_encode(const struct tetlodi_cell_time *time, struct tetlodi_buffer *out);
TETLOD_CHECKED enum tetlod_status tetlodi_cell_time_decode(struct tetlodi_cell_time *time, const uint8_t *bytes,
                                                           size_t size, struct tetlod_error *error);

/* Of a decoded table: bytes of the frames of a field's steps before step `step`, or of all. */
uint64_t tetlodi_cell_time_before(const struct tetlodi_cell_time *time, uint32_t field, uint32_t step);

/* The value of a code where values are rounded: (type)(quantum * code). */
double tetlodi_cell_value(enum tetlod_cell_type type, double quantum, double code);

/* Sums of frames may be this large; no file is. */
#define MAX_CELL_FRAME (UINT64_C(1) << 40)

/* Begins a group at the first step, whose `values` [row][component] these are. False: out of memory. To be freed even
 * so. */
bool tetlodi_cell_steps_start(struct tetlodi_steps *steps, enum tetlod_cell_type type, uint32_t components, size_t rows,
                              const double *values);

/* The values that the codes stand for. */
void tetlodi_cell_steps_values(const struct tetlodi_steps *steps, enum tetlod_cell_type type, double *out);

/* Appends the smallest frame for the values to `out`, none if they are those of the step before. Its size. out->failed:
 * out of memory. */
size_t tetlodi_cell_steps_encode(struct tetlodi_steps *steps, enum tetlod_cell_type type, const double *values,
                                 struct tetlodi_buffer *out);

#endif
