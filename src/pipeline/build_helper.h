/* SPDX-License-Identifier: BSD-3-Clause */
/* A program that helps with a build and has no mesh (src/util/work_share.h). */
#ifndef TETLOD_BUILD_HELPER_H
#define TETLOD_BUILD_HELPER_H

#include "src/util/work_share.h"

/* Does what it is called for, until the build is over. `threads` 0: all cores. ERR_NOMEM, ERR_LIMIT, ERR_CANCELLED:
 * another member has failed. */
TETLOD_CHECKED enum tetlod_status build_helper(const struct work_share *share, unsigned threads,
                                               struct tetlod_error *error);

#endif
