/* SPDX-License-Identifier: BSD-3-Clause */
/* An EnSight case: which files hold the geometry and the variables, at the step in time that is asked for. */
#ifndef TETLOD_ENSIGHT_CASE_H
#define TETLOD_ENSIGHT_CASE_H

#include "src/io/services/assemble.h"

/* A file of the case. */
struct ensight_entry {
    char *kind, *name, *file; /* owned: "scalar per node", what it is called, its name in the case's folder */
    int64_t time_set;         /* 0: not given */
    uint64_t step;            /* of its time set */
};

struct ensight_case {
    bool is_gold; /* else EnSight 6 */
    struct ensight_entry model;
    struct ensight_entry *variables; /* owned */
    size_t variable_count, variable_capacity;
};

/* To be freed also after a failure. */
TETLOD_CHECKED enum tetlod_status ensight_case_read(struct ensight_case *out, const struct io_input *input,
                                                    struct io_report *report,
                                                    struct tetlod_error *error);
void ensight_case_fini(struct ensight_case *ensight);

#endif
