/* SPDX-License-Identifier: BSD-3-Clause */
/* Cells that helpers contract (src/util/work_share.h): a helper gets those that it takes, one by one. */
#ifndef TETLOD_CELL_HELP_H
#define TETLOD_CELL_HELP_H

#include "src/util/work_share.h"

struct cell_run;

/* Calls the run's crew, and passes on what the stage that follows works on. ERR_CANCELLED: a member has failed. */
TETLOD_CHECKED enum tetlod_status cells_pass(struct cell_run *run);

/* Of a helper, once it is called: its share of the stage. `threads` 0: all cores. ERR_NOMEM, ERR_CANCELLED, or what the
 * stage fails with. */
TETLOD_CHECKED enum tetlod_status cells_help(const struct work_share *share, unsigned threads,
                                             struct tetlod_error *error);

#endif
