/* SPDX-License-Identifier: BSD-3-Clause */
/* What several tasks build together, in a folder that all of them see: the arguments of tetlod build, and its inputs as
 * they were. */
#ifndef TETLOD_PLAN_H
#define TETLOD_PLAN_H

#include <jansson.h>

#include "src/cli/build_request.h"

struct plan {
    json_t *json;
    char folder[4096]; /* absolute */
    char **arguments;  /* [count + 1] of tetlod build; room for PLAN_MORE behind them */
    int count;
};

enum { PLAN_MORE = 8 };

/* Writes a plan into the folder, which is made if it is not there. ERR_IO: it has one already, or an input cannot be
 * looked at. */
TETLOD_CHECKED enum tetlod_status plan_write(const char *folder, const struct build_request *request, int argc,
                                             char **argv, struct tetlod_error *error);

/* Reads the plan of a folder and goes to where it was made, so that its paths hold. ERR_IO: there is none, it is of
 * another version, or an input has changed. *out is to be closed in any case. */
TETLOD_CHECKED enum tetlod_status plan_open(struct plan *out, const char *folder, struct tetlod_error *error);
void plan_close(struct plan *plan);

/* Adds an argument, which is borrowed: at most PLAN_MORE. */
void plan_add(struct plan *plan, const char *argument);

/* The same of an option with its value; NULL: neither. */
void plan_add_option(struct plan *plan, const char *option, const char *value);

#endif
