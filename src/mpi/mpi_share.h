/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * Work shared by the ranks of an MPI communicator. Rank 0 leads; the others help, and need no mesh. A rank that is
 * done takes the next part; when all are done, rank 0 gets what it has not done itself. Ranks that wait sleep. Without
 * faults of the network nothing is lost, so nothing is done again: a rank that dies ends the job.
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

/* What a job has cost, in processor seconds: stage by stage, and outside of them. */
struct stage_cost {
    enum work_call call; /* what it was about */
    uint32_t parts;
    double work;    /* of all ranks, without `alone` */
    double alone;   /* that every one of these ranks spends, however many there are */
    double longest; /* part */
    double moved;   /* bytes, about, if every part were another rank's than rank 0's: inputs and results */
};

struct job_cost {
    struct stage_cost *stages; /* [stage_count] owned */
    uint32_t stage_count;
    double alone;  /* outside of stages: of a rank that does not lead */
    double leads;  /* what rank 0 spends more: joining, and writing */
    double meanwhile; /* and between pages, which others may measure meanwhile */
    double passed[2];     /* bytes that came from rank 0 to every other one, and besides to every other of a few */
    double spent[2];      /* of the rank that spent most, and in all */
    uint64_t moved[2];    /* bytes that came from others to a rank, at most, and in all */
    uint64_t resident[2]; /* most that rank 0 had in memory, and any other one */
};

/* Collective, after a job that went well: what it has cost, on all ranks. ERR_NOMEM. */
TETLOD_CHECKED enum tetlod_status mpi_share_cost(const struct work_share *share, struct job_cost *out,
                                                 struct tetlod_error *error);
void job_cost_fini(struct job_cost *cost);

/* Processor seconds of the rank that takes longest if there were so many: the rank that leads, which waits for the
 * others in every stage. Those of all ranks; and bytes that come from one to another. */
double job_cost_of(const struct job_cost *cost, uint32_t ranks);
double job_cost_of_all(const struct job_cost *cost, uint32_t ranks);
double job_cost_moved(const struct job_cost *cost, uint32_t ranks);

#endif
