/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/mpi/mpi_share.h"

#include <math.h>
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <time.h>

#include "format/fail.h"
#include "src/util/array.h"
#include "src/util/clock.h"

/* Counts of MPI are int: larger messages go in pieces. */
enum { PIECE = 1 << 30 };

/* What is passed to helpers goes in such pieces: what one has no room for it drops, piece by piece. */
enum { PASS_PIECE = 1 << 18 };

enum { TAG_PART, TAG_ASK };

/* Seconds between looks at whether others have come. */
static const double FIRST_WAIT = 1e-4, LONGEST_WAIT = 0.02;

struct result {
    unsigned char *bytes;
    uint64_t size;
    double begun; /* processor seconds of its thread */
};

/* What a stage costs this rank. */
struct stage_time {
    uint32_t parts;
    double begun, all, alone, longest;
};

struct mpi_share {
    MPI_Comm comm;
    int rank, ranks;
    MPI_Win window;      /* rank 0's: places that are taken */
    uint32_t *counter;
    pthread_mutex_t lock; /* of MPI, and what follows */
    uint32_t parts;
    const uint32_t *order;
    struct result *results; /* [part] */
    bool over, told;     /* a rank has failed, as all know; it was another one */
    bool ended;          /* all have done well, and know it */
    unsigned char *dropped; /* [PASS_PIECE] scratch */
    uint64_t moved;
    struct stage_time *stages; /* [stage_count] */
    uint32_t stage_count;
    double begun;              /* processor seconds before all */
};

static double process_seconds(void)
{
    struct timespec now;
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
    return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}

static struct stage_time *this_stage(const struct mpi_share *share)
{
    return &share->stages[share->stage_count - 1];
}

/* Waits without keeping a core busy that another rank may need. */
static void wait_for(MPI_Request *request)
{
    int done = 0;
    for (double wait = FIRST_WAIT; MPI_Test(request, &done, MPI_STATUS_IGNORE) == MPI_SUCCESS && !done;) {
        nanosleep(&(struct timespec){.tv_nsec = (long)(wait * 1e9)}, NULL);
        wait = 2 * wait < LONGEST_WAIT ? 2 * wait : LONGEST_WAIT;
    }
}

/* Have all ranks done well? */
static bool agree(struct mpi_share *share, bool good)
{
    int bad = !good, any = 0;
    MPI_Request request;
    MPI_Iallreduce(&bad, &any, 1, MPI_INT, MPI_MAX, share->comm, &request);
    wait_for(&request);
    share->over |= any;
    share->told |= good && any;
    return !any;
}

static enum tetlod_status other_failed(struct tetlod_error *error)
{
    return tetlodi_fail(error, TETLOD_ERR_CANCELLED, "another rank has failed");
}

static void drop_results(struct mpi_share *share)
{
    for (uint32_t part = 0; part < share->parts && share->results; part++)
        free(share->results[part].bytes);
    free(share->results);
    share->results = NULL;
    share->parts = 0;
}

static enum tetlod_status begin(void *opaque, uint32_t parts, const uint32_t *order, struct tetlod_error *error)
{
    struct mpi_share *share = opaque;
    const uint32_t none = 0;
    uint32_t before;
    struct stage_time *stages = array_resize(share->stages, share->stage_count + (size_t)1, sizeof *stages);
    share->stages = stages ? stages : share->stages;
    share->results = stages ? array_zero(parts, sizeof *share->results) : NULL;
    share->parts = share->results ? parts : 0;
    share->order = order;
    if (!agree(share, share->results != NULL))
        return share->told ? other_failed(error)
                           : tetlodi_fail_nomem(error, "the parts", parts * sizeof(struct result));
    if (share->rank == 0) { // nobody takes a part before
        MPI_Fetch_and_op(&none, &before, MPI_UINT32_T, 0, 0, MPI_REPLACE, share->window);
        MPI_Win_flush(0, share->window);
    }
    if (!agree(share, true))
        return other_failed(error);
    share->stages[share->stage_count++] = (struct stage_time){.parts = parts, .begun = process_seconds()};
    return TETLOD_OK;
}

static bool take(void *opaque, uint32_t *out_part)
{
    struct mpi_share *share = opaque;
    const uint32_t one = 1;
    uint32_t place;
    pthread_mutex_lock(&share->lock);
    MPI_Fetch_and_op(&one, &place, MPI_UINT32_T, 0, 0, MPI_SUM, share->window);
    MPI_Win_flush(0, share->window);
    pthread_mutex_unlock(&share->lock);
    if (place >= share->parts)
        return false;
    *out_part = share->order ? share->order[place] : place;
    share->results[*out_part].begun = thread_seconds();
    return true;
}

static enum tetlod_status put(void *opaque, uint32_t part, const void *bytes, size_t size, struct tetlod_error *error)
{
    struct mpi_share *share = opaque;
    struct result *result = &share->results[part]; // no other thread has this part
    double seconds = thread_seconds() - result->begun;
    result->bytes = array_new(size, 1);
    result->size = size;
    if (!result->bytes)
        return tetlodi_fail_nomem(error, "a part", size);
    memcpy(result->bytes, bytes, size);
    pthread_mutex_lock(&share->lock);
    this_stage(share)->longest = fmax(this_stage(share)->longest, seconds);
    pthread_mutex_unlock(&share->lock);
    return TETLOD_OK;
}

/* ---- exchange */

/* Which rank has each part, and of what size it is. */
static bool list_results(const struct mpi_share *share, uint64_t **out)
{
    uint64_t *own = array_zero(2 * (size_t)share->parts, sizeof *own);
    *out = array_zero(2 * (size_t)share->parts, sizeof **out);
    for (uint32_t part = 0; part < share->parts && own; part++)
        if (share->results[part].bytes) {
            own[2 * (size_t)part] = (uint64_t)share->rank;
            own[2 * (size_t)part + 1] = share->results[part].size;
        }
    bool room = own && *out;
    if (room)
        MPI_Allreduce(own, *out, (int)(2 * share->parts), MPI_UINT64_T, MPI_MAX, share->comm);
    free(own);
    return room;
}

/* Room for what others have done, on rank 0. */
static bool make_room(struct mpi_share *share, const uint64_t *list)
{
    for (uint32_t part = 0; part < share->parts && share->rank == 0; part++) {
        struct result *result = &share->results[part];
        if (result->bytes)
            continue;
        *result = (struct result){array_new(list[2 * (size_t)part + 1], 1), list[2 * (size_t)part + 1], 0};
        share->moved += result->size;
        if (!result->bytes)
            return false;
    }
    return true;
}

/* Rank 0 is the other one, or the owner. */
static void move_part(struct mpi_share *share, struct result *result, int owner)
{
    for (uint64_t at = 0; at < result->size; at += PIECE) {
        int size = (int)(result->size - at < PIECE ? result->size - at : PIECE);
        if (share->rank == 0)
            MPI_Recv(result->bytes + at, size, MPI_BYTE, owner, TAG_PART, share->comm, MPI_STATUS_IGNORE);
        else
            MPI_Send(result->bytes + at, size, MPI_BYTE, 0, TAG_PART, share->comm);
    }
}

/* The parts of a rank come to rank 0 when it asks for them: until then the other one sleeps. */
static void move_parts(struct mpi_share *share, const uint64_t *list, int owner)
{
    MPI_Request request;
    if (share->rank == 0) {
        MPI_Send(NULL, 0, MPI_BYTE, owner, TAG_ASK, share->comm);
    } else {
        MPI_Irecv(NULL, 0, MPI_BYTE, 0, TAG_ASK, share->comm, &request);
        wait_for(&request);
    }
    for (uint32_t part = 0; part < share->parts; part++)
        if (list[2 * (size_t)part] == (uint64_t)owner)
            move_part(share, &share->results[part], owner);
}

static enum tetlod_status settle(void *opaque, enum tetlod_status status, bool *out_again, struct tetlod_error *error)
{
    struct mpi_share *share = opaque;
    uint64_t *list = NULL;
    *out_again = false;
    this_stage(share)->all = process_seconds() - this_stage(share)->begun;
    if (!agree(share, status == TETLOD_OK))
        return status == TETLOD_OK ? other_failed(error) : status;
    bool room = list_results(share, &list) && make_room(share, list);
    if (agree(share, room))
        for (int owner = 1; owner < share->ranks; owner++) {
            if (share->rank == 0 || share->rank == owner)
                move_parts(share, list, owner);
        }
    else
        status = share->told ? other_failed(error) : tetlodi_fail_nomem(error, "the parts", share->parts);
    free(list);
    return status;
}

static enum tetlod_status get(void *opaque, uint32_t part, unsigned char **out, size_t *size,
                              struct tetlod_error *error)
{
    const struct mpi_share *share = opaque;
    const struct result *result = &share->results[part];
    *size = result->size;
    *out = array_new(result->size, 1);
    if (!*out)
        return tetlodi_fail_nomem(error, "a part", result->size);
    memcpy(*out, result->bytes, result->size);
    return TETLOD_OK;
}

static void end(void *opaque)
{
    drop_results(opaque);
}

/* ---- helpers */

/* What rank 0 says comes to all, if all have done well. */
static bool call_all(struct mpi_share *share, bool good, enum work_call *io_call)
{
    int word = (int)*io_call;
    if (!agree(share, good))
        return false;
    MPI_Bcast(&word, 1, MPI_INT, 0, share->comm);
    *io_call = (enum work_call)word;
    share->ended = word == CALL_OVER;
    return true;
}

static enum tetlod_status call(void *opaque, enum work_call *io_call, struct tetlod_error *error)
{
    return call_all(opaque, true, io_call) ? TETLOD_OK : other_failed(error);
}

static void pass(void *opaque, void *bytes, size_t size)
{
    struct mpi_share *share = opaque;
    for (size_t at = 0; at < size; at += PASS_PIECE) {
        unsigned char *to = bytes ? (unsigned char *)bytes + at : share->dropped;
        MPI_Bcast(to, (int)(size - at < PASS_PIECE ? size - at : PASS_PIECE), MPI_BYTE, 0, share->comm);
    }
    share->moved += share->rank ? size : 0;
}

/* ---- cost */

static void spent_alone(void *opaque, double seconds)
{
    struct mpi_share *share = opaque;
    this_stage(share)->alone += seconds;
}

/* ---- the share */

enum tetlod_status mpi_share_new(struct work_share *out, MPI_Comm comm, struct tetlod_error *error)
{
    struct mpi_share *share = array_zero(1, sizeof *share);
    unsigned char *dropped = array_new(PASS_PIECE, 1);
    *out = (struct work_share){0};
    if (!share || !dropped) {
        free(share);
        free(dropped);
        return tetlodi_fail_nomem(error, "the ranks", PASS_PIECE);
    }
    share->dropped = dropped;
    MPI_Comm_dup(comm, &share->comm);
    MPI_Comm_rank(share->comm, &share->rank);
    MPI_Comm_size(share->comm, &share->ranks);
    MPI_Win_allocate(share->rank ? 0 : sizeof *share->counter, sizeof *share->counter, MPI_INFO_NULL, share->comm,
                     &share->counter, &share->window);
    MPI_Win_lock_all(0, share->window);
    pthread_mutex_init(&share->lock, NULL);
    share->begun = process_seconds();
    *out = (struct work_share){(uint32_t)share->ranks, share->rank == 0, begin, take, put, settle, get, end,
                               spent_alone, call, pass, share};
    return TETLOD_OK;
}

void mpi_share_free(struct work_share *share)
{
    struct mpi_share *mpi = share->opaque;
    if (!mpi)
        return;
    drop_results(mpi);
    free(mpi->stages);
    free(mpi->dropped);
    MPI_Win_unlock_all(mpi->window);
    MPI_Win_free(&mpi->window);
    MPI_Comm_free(&mpi->comm);
    pthread_mutex_destroy(&mpi->lock);
    free(mpi);
    *share = (struct work_share){0};
}

bool mpi_share_finish(struct work_share *share, bool good, const char *text, int *out_rank, char **out_text)
{
    struct mpi_share *mpi = share->opaque;
    enum work_call call = CALL_OVER;
    *out_text = NULL;
    if (mpi->ended || (!mpi->over && call_all(mpi, good, &call)))
        return true;
    int own = good || mpi->told ? mpi->ranks : mpi->rank, length = (int)strlen(text);
    MPI_Allreduce(&own, out_rank, 1, MPI_INT, MPI_MIN, mpi->comm);
    MPI_Bcast(&length, 1, MPI_INT, *out_rank, mpi->comm);
    *out_text = array_zero((size_t)length + 1, 1);
    char none[1], *to = *out_text ? *out_text : none;
    if (*out_text && mpi->rank == *out_rank)
        memcpy(to, text, (size_t)length);
    if (*out_text)
        MPI_Bcast(to, length, MPI_CHAR, *out_rank, mpi->comm);
    return false;
}

/* ---- what it has cost */

/* A stage on all ranks. */
static void sum_stage(const struct mpi_share *share, const struct stage_time *own, struct stage_cost *out)
{
    double sums[2] = {own->all - own->alone, own->alone}, most[2] = {own->longest, own->alone};
    MPI_Allreduce(MPI_IN_PLACE, sums, 2, MPI_DOUBLE, MPI_SUM, share->comm);
    MPI_Allreduce(MPI_IN_PLACE, most, 2, MPI_DOUBLE, MPI_MAX, share->comm);
    bool sweeps = most[1] > 0; // many parts at once: each has its share
    *out = (struct stage_cost){own->parts, sums[0], most[1], sweeps ? sums[0] / own->parts : most[0]};
}

enum tetlod_status mpi_share_cost(const struct work_share *share, struct job_cost *out, struct tetlod_error *error)
{
    struct mpi_share *mpi = share->opaque;
    struct rusage usage;
    double outside = process_seconds() - mpi->begun, least = outside, most;
    *out = (struct job_cost){.stages = array_zero(mpi->stage_count, sizeof *out->stages),
                             .stage_count = mpi->stage_count};
    if (!agree(mpi, out->stages != NULL))
        return mpi->told ? other_failed(error) : tetlodi_fail_nomem(error, "the stages", mpi->stage_count);
    for (uint32_t i = 0; i < mpi->stage_count; i++) {
        sum_stage(mpi, &mpi->stages[i], &out->stages[i]);
        outside -= mpi->stages[i].all;
    }
    least = mpi->rank || mpi->ranks == 1 ? outside : INFINITY;
    most = mpi->rank ? 0 : outside;
    MPI_Allreduce(&least, &out->alone, 1, MPI_DOUBLE, MPI_MIN, mpi->comm);
    MPI_Allreduce(&most, &out->leads, 1, MPI_DOUBLE, MPI_MAX, mpi->comm);
    out->leads = fmax(out->leads - out->alone, 0);
    getrusage(RUSAGE_SELF, &usage);
    uint64_t resident = (uint64_t)usage.ru_maxrss << 10;
    uint64_t bytes[3] = {mpi->moved, mpi->rank ? 0 : resident, mpi->rank ? resident : 0};
    MPI_Allreduce(MPI_IN_PLACE, bytes, 3, MPI_UINT64_T, MPI_MAX, mpi->comm);
    out->moved = bytes[0];
    memcpy(out->resident, bytes + 1, sizeof out->resident);
    return TETLOD_OK;
}

void job_cost_fini(struct job_cost *cost)
{
    free(cost->stages);
    *cost = (struct job_cost){0};
}

double job_cost_of(const struct job_cost *cost, uint32_t ranks)
{
    double seconds = cost->alone + cost->leads;
    for (uint32_t i = 0; i < cost->stage_count; i++) {
        const struct stage_cost *stage = &cost->stages[i];
        seconds += stage->alone + fmax(stage->work / ranks, stage->longest);
    }
    return seconds;
}
