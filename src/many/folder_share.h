/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * Work shared over a folder that several programs see, also one after the other: for schedulers of jobs without MPI.
 * The first that comes leads: it reads the mesh. The others help, and read what it leaves for them. A part that is done
 * is a file, which appears whole. Who begins a part leaves a lease beside it, which is touched while the program lives:
 * when that dies, others take the part. The lead is such a lease as well. A part that two have done is the same bytes
 * twice.
 */
#ifndef TETLOD_FOLDER_SHARE_H
#define TETLOD_FOLDER_SHARE_H

#include "src/util/work_share.h"

/* The members' share in `folder` (copied), which is there. `writes`: this one writes the stream, leads whoever leads as
 * well, and has no helpers. *out is to be freed in any case. ERR_NOMEM; ERR_IO names a file. */
TETLOD_CHECKED enum tetlod_status folder_share_new(struct work_share *out, const char *folder, uint32_t members,
                                                   bool writes, struct tetlod_error *error);

/* Are all stages done? */
bool folder_share_is_over(const struct work_share *share);

/* Has this one helped a leader that has died? Then the work is to be shared anew. */
bool folder_share_is_orphaned(const struct work_share *share);

/* All has gone well: whoever leads says so. ERR_IO names the file. */
TETLOD_CHECKED enum tetlod_status folder_share_finish(const struct work_share *share, struct tetlod_error *error);

/* Takes a share of zeros, too. */
void folder_share_free(struct work_share *share);

#endif
