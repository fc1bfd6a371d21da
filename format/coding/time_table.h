/* SPDX-License-Identifier: BSD-3-Clause */
/* The section TIME (SPEC 3.7): steps, bands, and where each step's frame lies. Not installed. */
#ifndef TETLOD_TIME_TABLE_H
#define TETLOD_TIME_TABLE_H

#include "format/coding/section.h"

enum { MAX_STEPS = 1 << 20, MAX_BANDS = 64, STEP_GROUP = TETLOD_STEP_GROUP };

struct tetlodi_time_field {
    uint32_t field;        /* of the stream */
    enum tetlod_type type; /* that holds all values of all steps */
    double range[2];       /* over all steps and components */
};

struct tetlodi_time_entry {
    uint32_t size; /* of the frame */
    float error;   /* of the step in this band: a bound, a fraction of the field's range */
};

struct tetlodi_time {
    uint32_t field_count, band_count, step_count, group_count;
    /* 1 + the number of the field that moves the points; 0: they keep their places */
    uint32_t displacement;
    struct tetlodi_time_field *fields; /* [field] owned, as all here */
    struct tetlod_band *bands;         /* [band] */
    double *quanta;                    /* [band][field] */
    double *times;                     /* [step] */
    struct tetlodi_time_entry *entries;        /* [field][band][step] */
    uint8_t (*digests)[DIGEST_SIZE];           /* [field][band][group] */
    /* [field][band][group] of the group's frames among the row's; of a table that was decoded */
    uint64_t *ends;
};

/* Room for all of it, zero. 0: out of memory. */
int tetlodi_time_allocate(struct tetlodi_time *time, uint32_t fields, uint32_t bands, uint32_t steps);
void tetlodi_time_fini(struct tetlodi_time *time);

static inline size_t time_row(const struct tetlodi_time *time, uint32_t field, uint32_t band)
{
    return (size_t)field * time->band_count + band;
}

static inline struct tetlodi_time_entry *time_entries(const struct tetlodi_time *time, uint32_t field, uint32_t band)
{
    return time->entries + time_row(time, field, band) * time->step_count;
}

/* As the section's bytes, and back. Decoding checks what the table says by itself. ERR_STREAM, ERR_NOMEM. */
void tetlodi_time_encode(const struct tetlodi_time *time, struct tetlodi_buffer *out);
TETLOD_CHECKED enum tetlod_status tetlodi_time_decode(struct tetlodi_time *time, const uint8_t *bytes, size_t size,
                                                      struct tetlod_error *error);

/* The frames of a group of a row of a decoded table: their first byte among the row's, and their bytes together. */
void tetlodi_time_place(const struct tetlodi_time *time, uint32_t field, uint32_t band, uint32_t group,
                        uint64_t *offset, uint64_t *size);

#endif
