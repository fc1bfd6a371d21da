/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * Work shared by the ranks of an MPI communicator. Rank 0 leads. A rank that is done takes the next part; when all are
 * done, each rank gets what it has not done itself. Ranks that wait sleep. Without faults of the network nothing is
 * lost, so nothing is done again: a rank that dies ends the job.
 */
#ifndef TETLOD_MPI_SHARE_H
#define TETLOD_MPI_SHARE_H

#include <mpi.h>

#include "src/util/work_share.h"

/* Collective. Threads of a rank may call take and put where MPI provides MPI_THREAD_SERIALIZED. *out is to be freed
 * where this is OK. ERR_NOMEM. */
TETLOD_CHECKED enum tetlod_status mpi_share_new(struct work_share *out, MPI_Comm comm, struct tetlod_error *error);
void mpi_share_free(struct work_share *share);

/* Collective, when a rank has nothing more to do: waits for the others. `text` is what it would say of a failure of its
 * own. Returns whether all are done well; *out_text (the caller frees it) is what the first rank *out_rank that has
 * failed by itself says, on all ranks. */
bool mpi_share_finish(struct work_share *share, bool good, const char *text, int *out_rank, char **out_text);

/* Bytes that this rank has sent to others, or received from them. */
uint64_t mpi_share_moved(const struct work_share *share);

#endif
