/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * Which fields are controlled. Without a wish: every field of floating-point numbers that is not ids (ids.h), so that
 * an error is one of all fields. Where there is none, a coordinate of the points: then the error says how far the
 * boundary has moved.
 */
#ifndef TETLOD_FIELD_CHOICE_H
#define TETLOD_FIELD_CHOICE_H

#include "src/pipeline/build.h"

struct field_choice {
    const char *const
        *texts; /* names, lists A,B, patterns p* or "all", each with :LIMIT behind it if wanted; none: as above */
    const double *units;        /* of each text its limit in the field's units, or 0; may be NULL */
    uint32_t count;
    const char *const *without; /* names, lists and patterns that are not controlled */
    uint32_t without_count;
    const char *among;          /* without texts: only fields of this list, unless there are none; NULL: all */
    bool first_only;            /* without texts: the first field alone */
    /* whole numbers at the first step of a series say nothing, unless `later` has them, too */
    bool has_steps;
    const struct tetmesh *later; /* another step of the series: ids are whole numbers there, too; may be NULL */
};

/* Is the name in a list of names with commas between? */
bool field_choice_lists(const char *list, const char *name);

/* `controls` has room for 2 * MAX_CONTROLS: vectors join their magnitudes. Fields that are not controlled learn
 * whether they are ids. ERR_FIELD, ERR_ARGUMENT if a field is named twice, or has two limits. */
TETLOD_CHECKED enum tetlod_status field_choice_make(const struct field_choice *choice, struct tetmesh *mesh,
                                                    struct build_control *controls, uint32_t *out_count,
                                                    struct tetlod_error *error);

#endif
