/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * Work shared over a folder that several programs see, also one after the other: for schedulers of jobs without MPI. A
 * part that is done is a file, which appears whole. Who begins a part leaves a lease beside it, which is touched while
 * the program lives: when that dies, others take the part. A part that two have done is the same bytes twice.
 */
#ifndef TETLOD_FOLDER_SHARE_H
#define TETLOD_FOLDER_SHARE_H

#include "src/util/work_share.h"

/* The members' share in `folder` (copied), which is there. *out is to be freed in any case. ERR_NOMEM; ERR_IO names a
 * file. */
TETLOD_CHECKED enum tetlod_status folder_share_new(struct work_share *out, const char *folder, uint32_t members,
                                                   struct tetlod_error *error);

/* Takes a share of zeros, too. */
void folder_share_free(struct work_share *share);

#endif
