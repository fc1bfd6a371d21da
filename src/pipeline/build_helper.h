/* SPDX-License-Identifier: BSD-3-Clause */
/* A program that helps with a build and has no mesh (src/util/work_share.h). */
#ifndef TETLOD_BUILD_HELPER_H
#define TETLOD_BUILD_HELPER_H

#include "src/util/work_share.h"

/* Does what it is called for, until the build is over. `threads` 0: all cores. What is no part of building, reading and
 * memory, is `other`'s, which may be NULL where nobody calls for it. ERR_NOMEM, ERR_LIMIT, ERR_CANCELLED: another
 * member has failed; or what `other` fails with. */
TETLOD_CHECKED enum tetlod_status build_helper(const struct work_share *share, unsigned threads,
                                               enum tetlod_status (*other)(void *opaque, enum work_call call,
                                                                           struct tetlod_error *error),
                                               void *opaque, struct tetlod_error *error);

#endif
