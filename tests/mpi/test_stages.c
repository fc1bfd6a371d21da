/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * Stages shared by ranks: each part is done once and comes to rank 0; what rank 0 passes on comes to the others, also
 * to one that has no room for it; what one rank fails with in a stage, before one or
 * behind all of them, all know, and none waits for ever. Run with two ranks or more; prints "good" on rank 0.
 */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "format/fail.h"
#include "src/mpi/mpi_share.h"

enum { PARTS = 57, BYTES = 1000 };

static int rank, bad;

static void expect(bool good, const char *what)
{
    if (!good)
        fprintf(stderr, "rank %d: %s\n", rank, what);
    bad |= !good;
}

static bool fill(unsigned char *bytes, uint32_t part)
{
    for (int i = 0; i < BYTES; i++)
        bytes[i] = (unsigned char)(part * 7 + (uint32_t)i);
    return true;
}

/* Bytes of rank 0, of more than one piece, for all but the last rank, which drops them; and then some for all. */
static enum tetlod_status pass_on(struct work_share *share)
{
    static unsigned char many[700000], few[BYTES];
    struct tetlod_error error = {0};
    enum work_call called = share->leads ? CALL_SAMPLES : CALL_OVER;
    int ranks;
    bool drops;
    MPI_Comm_size(MPI_COMM_WORLD, &ranks);
    drops = !share->leads && rank == ranks - 1;
    memset(many, share->leads ? 7 : 0, sizeof many);
    memset(few, 0, sizeof few);
    if (share->leads)
        fill(few, 3);
    TETLOD_TRY(share->call(share->opaque, &called, &error));
    share->pass(share->opaque, drops ? NULL : many, sizeof many);
    share->pass(share->opaque, few, sizeof few);
    expect(called == CALL_SAMPLES, "a call is another one");
    expect(many[sizeof many - 1] == (drops ? 0 : 7) && few[1] == 3 * 7 + 1, "what is passed on is something else");
    return TETLOD_OK;
}

/* A stage in which a rank fails once it has done its parts, or -1: none. */
static enum tetlod_status stage(struct work_share *share, int fails)
{
    struct tetlod_error error = {0};
    unsigned char bytes[BYTES], *back;
    uint32_t part, order[PARTS];
    size_t size;
    bool again = true;
    for (uint32_t i = 0; i < PARTS; i++)
        order[i] = PARTS - 1 - i;
    enum tetlod_status status = share->begin(share->opaque, PARTS, order, &error);
    while (status == TETLOD_OK && share->take(share->opaque, &part) && fill(bytes, part))
        status = share->put(share->opaque, part, bytes, part % 2 ? BYTES : 0, &error);
    if (status == TETLOD_OK)
        status = share->settle(share->opaque, rank == fails ? TETLOD_ERR_LIMIT : TETLOD_OK, &again, &error);
    for (part = 0; part < PARTS && status == TETLOD_OK && share->leads; part++) {
        status = share->get(share->opaque, part, &back, &size, &error);
        expect(status == TETLOD_OK && size == (part % 2 ? BYTES : 0) && fill(bytes, part) &&
                   memcmp(bytes, back, size) == 0,
               "a part is another one");
        free(back);
    }
    share->end(share->opaque);
    return status;
}

/* Two stages, of which the second may fail, and what comes behind them. */
static void go_through(int fails, int fails_behind)
{
    struct work_share share;
    struct tetlod_error error = {0};
    char *text = NULL;
    int who = -1, ranks;
    MPI_Comm_size(MPI_COMM_WORLD, &ranks);
    expect(mpi_share_new(&share, MPI_COMM_WORLD, &error) == TETLOD_OK, "there is no share");
    expect(pass_on(&share) == TETLOD_OK, "a call has failed");
    expect(stage(&share, -1) == TETLOD_OK, "a stage has failed");
    enum tetlod_status status = stage(&share, fails);
    expect((status == TETLOD_OK) == (fails < 0), "a rank does not know of another one's failure");
    bool good = status == TETLOD_OK && rank != fails_behind;
    bool all = mpi_share_finish(&share, good, rank == fails || rank == fails_behind ? "it broke" : "", &who, &text);
    int wanted = fails >= 0 ? fails : fails_behind;
    expect(all == (wanted < 0), "the end is another one");
    expect(wanted < 0 || (who == wanted && text && strcmp(text, "it broke") == 0), "another rank is blamed");
    free(text);
    mpi_share_free(&share);
}

int main(int argc, char **argv)
{
    int provided, any;
    MPI_Init_thread(&argc, &argv, MPI_THREAD_SERIALIZED, &provided);
    MPI_Comm_rank(MPI_COMM_WORLD, &rank);
    go_through(-1, -1);
    go_through(1, -1);
    go_through(0, -1);
    go_through(-1, 1);
    MPI_Allreduce(&bad, &any, 1, MPI_INT, MPI_MAX, MPI_COMM_WORLD);
    if (rank == 0)
        puts(any ? "bad" : "good");
    MPI_Finalize();
    return any;
}
