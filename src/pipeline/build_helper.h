/* SPDX-License-Identifier: BSD-3-Clause */
/* A program that helps with a build and has no mesh (src/util/work_share.h). */
#ifndef TETLOD_BUILD_HELPER_H
#define TETLOD_BUILD_HELPER_H

#include "src/util/work_share.h"

/* What is no part of building. NULL: nobody asks for it. */
struct helper_hooks {
    /* Does what it is called for otherwise: reading, and memory. */
    enum tetlod_status (*other)(void *opaque, enum work_call call, struct tetlod_error *error);
    /* The arrays that are there change no more. `measures`: large ones take most of the memory until it is called
     * again. */
    void (*settle)(bool measures);
    void *opaque; /* of `other` */
};

/* Does what it is called for, until the build is over. `threads` 0: all cores. ERR_NOMEM, ERR_LIMIT, ERR_CANCELLED:
 * another member has failed; or what a hook fails with. */
TETLOD_CHECKED enum tetlod_status build_helper(const struct work_share *share, unsigned threads,
                                               const struct helper_hooks *hooks, struct tetlod_error *error);

#endif
