/* SPDX-License-Identifier: BSD-3-Clause */
/* The options --time and --step: one step of a series. */
#ifndef TETLOD_STEP_OPTION_H
#define TETLOD_STEP_OPTION_H

#include "src/cli/cli.h"
#include "src/stream/selection.h"

/* Begins zeroed. */
struct step_option {
    bool given;
    struct step_selection selection;
};

/* Takes the value of --time, or of --step; false after a usage message. */
bool step_option_take(struct step_option *out, const struct command *command, bool by_time, const char *value);

#endif
