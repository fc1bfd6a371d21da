/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * Stages shared by ranks: each part is done once and comes to rank 0; what rank 0 passes on comes to the others, also
 * to one that has no room for it; what one rank fails with in a stage, before one, behind all of them or while others
 * have a stage of their own, all know, and none waits for ever. Run with two ranks or more, and with eight; prints
 * "good" on rank 0.
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
static enum tetlod_status pass_on(const struct work_share *share)
{
    static unsigned char many[700000], few[BYTES];
    struct tetlod_error error = {0};
    enum work_call called = share->leads ? CALL_PIECES : CALL_OVER;
    int ranks;
    bool drops;
    MPI_Comm_size(MPI_COMM_WORLD, &ranks);
    drops = !share->leads && rank == ranks - 1;
    memset(many, share->leads ? 7 : 0, sizeof many);
    memset(few, 0, sizeof few);
    if (share->leads)
        fill(few, 3);
    TETLOD_TRY(share->call(share, &called, &share, &error));
    share->pass(share->opaque, drops ? NULL : many, sizeof many);
    share->pass(share->opaque, few, sizeof few);
    expect(called == CALL_PIECES, "a call is another one");
    expect(many[sizeof many - 1] == (drops ? 0 : 7) && few[1] == 3 * 7 + 1, "what is passed on is something else");
    return TETLOD_OK;
}

/* The input of a part, of more than one piece for the first ones; that of the part `opaque` cannot be made. */
static enum tetlod_status pack(void *opaque, uint32_t part, struct buffer *out, struct tetlod_error *error)
{
    const uint32_t *broken = opaque;
    unsigned char bytes[BYTES];
    fill(bytes, part + 1);
    for (int i = 0; i < (part < 3 ? 600 : 1); i++)
        TETLOD_TRY(buffer_append(out, bytes, BYTES));
    return part == *broken ? tetlodi_fail(error, TETLOD_ERR_NOMEM, "it broke") : TETLOD_OK;
}

static void check_input(const struct work_share *share, uint32_t part, struct buffer *input)
{
    unsigned char bytes[BYTES];
    size_t size = BYTES * (size_t)(part < 3 ? 600 : 1);
    fill(bytes, part + 1);
    if (!share->leads)
        expect(input->size == size && memcmp(input->bytes + size - BYTES, bytes, BYTES) == 0,
               "an input is another one");
    buffer_fini(input);
    *input = (struct buffer){0};
}

/* A stage in which a rank fails once it has done its parts, or -1: none. */
static enum tetlod_status stage(const struct work_share *share, int fails)
{
    uint32_t none = PARTS;
    const struct work_input input = {pack, &none};
    struct buffer got = {0};
    struct tetlod_error error = {0};
    unsigned char bytes[BYTES], *back;
    uint32_t part, order[PARTS];
    size_t size;
    bool again = true;
    for (uint32_t i = 0; i < PARTS; i++)
        order[i] = PARTS - 1 - i;
    enum tetlod_status status = share->begin(share->opaque, PARTS, order, share->leads ? &input : NULL, &error);
    while (status == TETLOD_OK && share->take(share->opaque, &part, share->leads ? NULL : &got) && fill(bytes, part)) {
        check_input(share, part, &got);
        status = share->put(share->opaque, part, bytes, part % 2 ? BYTES : 0, &error);
    }
    if (status == TETLOD_OK)
        status = share->settle(share->opaque, rank == fails ? TETLOD_ERR_LIMIT : TETLOD_OK, &again, &error);
    for (part = 0; part < PARTS && status == TETLOD_OK && share->leads; part++) {
        size_t all = part % 2 ? BYTES : 0, enough = part % 3 ? SIZE_MAX : 5;
        status = share->get(share->opaque, part, enough, &back, &size, &error);
        expect(status == TETLOD_OK && size == (all < enough ? all : enough) && fill(bytes, part) &&
                   memcmp(bytes, back, size) == 0,
               "a part is another one");
        free(back);
    }
    share->end(share->opaque);
    return status;
}

/* The same behind a call. */
static enum tetlod_status called_stage(const struct work_share *share, int fails)
{
    struct tetlod_error error = {0};
    enum work_call called = share->leads ? CALL_CELLS : CALL_OVER;
    TETLOD_TRY(share->call(share, &called, &share, &error));
    return stage(share, fails);
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
    expect(called_stage(&share, -1) == TETLOD_OK, "a stage has failed");
    enum tetlod_status status = called_stage(&share, fails);
    expect((status == TETLOD_OK) == (fails < 0), "a rank does not know of another one's failure");
    bool good = status == TETLOD_OK && rank != fails_behind;
    bool all = mpi_share_finish(&share, good, rank == fails || rank == fails_behind ? "it broke" : "", &who, &text);
    int wanted = fails >= 0 ? fails : fails_behind;
    expect(all == (wanted < 0), "the end is another one");
    expect(wanted < 0 || (who == wanted && text && strcmp(text, "it broke") == 0), "another rank is blamed");
    free(text);
    mpi_share_free(&share);
}

/* Rank 0: while some measure, two stages of the others. */
static enum tetlod_status lead_apart(const struct work_share *share, int fails)
{
    struct tetlod_error error = {0};
    const struct work_share *few, *rest;
    enum work_call samples = CALL_SAMPLES, pages = CALL_PAGES;
    bool again;
    TETLOD_TRY(share->call(share, &samples, &few, &error));
    expect(few->apart && few->members == WORK_FEW - 1, "those that measure are others");
    TETLOD_TRY(few->begin(few->opaque, PARTS, NULL, NULL, &error));
    for (int i = 0; i < 2; i++) {
        TETLOD_TRY(share->call(share, &pages, &rest, &error));
        TETLOD_TRY(stage(rest, i ? fails : -1));
    }
    TETLOD_TRY(few->settle(few->opaque, TETLOD_OK, &again, &error));
    for (uint32_t part = 0; part < PARTS; part++) {
        unsigned char *bytes;
        size_t size;
        expect(few->get(few->opaque, part, SIZE_MAX, &bytes, &size, &error) == TETLOD_OK && size == sizeof part &&
                   memcmp(bytes, &part, sizeof part) == 0,
               "a part that was measured is another one");
        free(bytes);
    }
    few->end(few->opaque);
    return TETLOD_OK;
}

static enum tetlod_status measure(const struct work_share *few, int fails)
{
    struct tetlod_error error = {0};
    uint32_t part;
    bool again;
    TETLOD_TRY(few->begin(few->opaque, PARTS, NULL, NULL, &error));
    while (few->take(few->opaque, &part, NULL))
        TETLOD_TRY(few->put(few->opaque, part, &part, sizeof part, &error));
    enum tetlod_status status =
        few->settle(few->opaque, rank == fails ? TETLOD_ERR_LIMIT : TETLOD_OK, &again, &error);
    few->end(few->opaque);
    return status;
}

/* Another rank: what it is called for, and how often that was. */
static enum tetlod_status help_apart(const struct work_share *share, int fails, int *out_count)
{
    struct tetlod_error error = {0};
    const struct work_share *crew;
    enum work_call called = CALL_OVER;
    for (*out_count = 0;; ++*out_count) {
        TETLOD_TRY(share->call(share, &called, &crew, &error));
        if (called == CALL_OVER)
            return TETLOD_OK;
        expect(called == (rank < WORK_FEW ? CALL_SAMPLES : CALL_PAGES), "it is called for what others do");
        TETLOD_TRY(called == CALL_SAMPLES ? measure(crew, fails) : stage(crew, *out_count ? fails : -1));
    }
}

/* Two crews at once; a rank of one of them may fail, or -1: none. */
static void go_apart(int fails)
{
    struct work_share share;
    struct tetlod_error error = {0};
    char *text = NULL;
    int who = -1, count = 1;
    expect(mpi_share_new(&share, MPI_COMM_WORLD, &error) == TETLOD_OK, "there is no share");
    enum tetlod_status status = share.leads ? lead_apart(&share, fails) : help_apart(&share, fails, &count);
    expect((status == TETLOD_OK) == (fails < 0), "a rank does not know of another one's failure in a crew");
    expect(fails >= 0 || share.leads || count == (rank < WORK_FEW ? 1 : 2), "it is not called so often");
    bool all = mpi_share_finish(&share, status == TETLOD_OK, rank == fails ? "it broke" : "", &who, &text);
    expect(all == (fails < 0), "the end of two crews is another one");
    expect(fails < 0 || (who == fails && text && strcmp(text, "it broke") == 0), "another rank of a crew is blamed");
    free(text);
    mpi_share_free(&share);
}

/* An input that cannot be made: rank 0 is blamed, if another rank wanted it. Rank 0 takes nothing here. */
static void go_without_input(void)
{
    struct work_share share;
    struct tetlod_error error = {0};
    uint32_t broken = 5;
    const struct work_input input = {pack, &broken};
    struct buffer got = {0};
    unsigned char bytes[BYTES] = {0};
    uint32_t part;
    bool again;
    char *text = NULL;
    int who = -1;
    expect(mpi_share_new(&share, MPI_COMM_WORLD, &error) == TETLOD_OK, "there is no share");
    expect(share.begin(share.opaque, PARTS, NULL, share.leads ? &input : NULL, &error) == TETLOD_OK, "no stage");
    while (!share.leads && share.take(share.opaque, &part, &got)) {
        check_input(&share, part, &got);
        expect(share.put(share.opaque, part, bytes, BYTES, &error) == TETLOD_OK, "a part cannot be put");
    }
    expect(share.settle(share.opaque, TETLOD_OK, &again, &error) != TETLOD_OK, "a stage without an input is settled");
    share.end(share.opaque);
    expect(!mpi_share_finish(&share, false, "it broke", &who, &text) && who == 0, "another rank is blamed");
    free(text);
    mpi_share_free(&share);
}

int main(int argc, char **argv)
{
    int provided, any, ranks;
    MPI_Init_thread(&argc, &argv, MPI_THREAD_SERIALIZED, &provided);
    MPI_Comm_rank(MPI_COMM_WORLD, &rank);
    go_through(-1, -1);
    go_through(1, -1);
    go_through(0, -1);
    go_through(-1, 1);
    go_without_input();
    MPI_Comm_size(MPI_COMM_WORLD, &ranks);
    for (int fails = -1; ranks >= 8 && fails < ranks; fails += fails > 0 ? 5 : 1) // none, 0, one of each crew
        go_apart(fails);
    MPI_Allreduce(&bad, &any, 1, MPI_INT, MPI_MAX, MPI_COMM_WORLD);
    if (rank == 0)
        puts(any ? "bad" : "good");
    MPI_Finalize();
    return any;
}
