/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/mpi/mpi_share.h"

#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "format/fail.h"
#include "src/util/array.h"

/* Counts of MPI are int: larger messages go in pieces. */
enum { PIECE = 1 << 30 };

/* Seconds between looks at whether others have come. */
static const double FIRST_WAIT = 1e-4, LONGEST_WAIT = 0.02;

struct result {
    unsigned char *bytes;
    uint64_t size;
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
    uint64_t moved;
};

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
    share->results = array_zero(parts, sizeof *share->results);
    share->parts = share->results ? parts : 0;
    share->order = order;
    if (!agree(share, share->results != NULL))
        return share->told ? other_failed(error)
                           : tetlodi_fail_nomem(error, "the parts", parts * sizeof(struct result));
    if (share->rank == 0) { // nobody takes a part before
        MPI_Fetch_and_op(&none, &before, MPI_UINT32_T, 0, 0, MPI_REPLACE, share->window);
        MPI_Win_flush(0, share->window);
    }
    return agree(share, true) ? TETLOD_OK : other_failed(error);
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
    return true;
}

static enum tetlod_status put(void *opaque, uint32_t part, const void *bytes, size_t size, struct tetlod_error *error)
{
    struct mpi_share *share = opaque;
    struct result result = {array_new(size, 1), size};
    if (!result.bytes)
        return tetlodi_fail_nomem(error, "a part", size);
    memcpy(result.bytes, bytes, size);
    share->results[part] = result; // no other thread has this part
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

static void send_part(struct mpi_share *share, uint32_t part, int owner)
{
    struct result *result = &share->results[part];
    for (uint64_t at = 0; at < result->size; at += PIECE) {
        uint64_t left = result->size - at;
        MPI_Bcast(result->bytes + at, (int)(left < PIECE ? left : PIECE), MPI_BYTE, owner, share->comm);
    }
    share->moved += share->ranks > 1 ? result->size : 0;
}

/* Room for what others have done. */
static bool make_room(struct mpi_share *share, const uint64_t *list)
{
    for (uint32_t part = 0; part < share->parts; part++) {
        struct result *result = &share->results[part];
        if (result->bytes)
            continue;
        *result = (struct result){array_new(list[2 * (size_t)part + 1], 1), list[2 * (size_t)part + 1]};
        if (!result->bytes)
            return false;
    }
    return true;
}

static enum tetlod_status settle(void *opaque, enum tetlod_status status, bool *out_again, struct tetlod_error *error)
{
    struct mpi_share *share = opaque;
    uint64_t *list = NULL;
    *out_again = false;
    if (!agree(share, status == TETLOD_OK))
        return status == TETLOD_OK ? other_failed(error) : status;
    bool room = list_results(share, &list) && make_room(share, list);
    if (agree(share, room))
        for (uint32_t part = 0; part < share->parts; part++)
            send_part(share, part, (int)list[2 * (size_t)part]);
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

/* ---- the share */

enum tetlod_status mpi_share_new(struct work_share *out, MPI_Comm comm, struct tetlod_error *error)
{
    struct mpi_share *share = array_zero(1, sizeof *share);
    *out = (struct work_share){0};
    if (!share)
        return tetlodi_fail_nomem(error, "the ranks", sizeof *share);
    MPI_Comm_dup(comm, &share->comm);
    MPI_Comm_rank(share->comm, &share->rank);
    MPI_Comm_size(share->comm, &share->ranks);
    MPI_Win_allocate(share->rank ? 0 : sizeof *share->counter, sizeof *share->counter, MPI_INFO_NULL, share->comm,
                     &share->counter, &share->window);
    MPI_Win_lock_all(0, share->window);
    pthread_mutex_init(&share->lock, NULL);
    *out = (struct work_share){(uint32_t)share->ranks, share->rank == 0, begin, take, put, settle, get, end, share};
    return TETLOD_OK;
}

void mpi_share_free(struct work_share *share)
{
    struct mpi_share *mpi = share->opaque;
    if (!mpi)
        return;
    drop_results(mpi);
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
    *out_text = NULL;
    if (!mpi->over && agree(mpi, good))
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

uint64_t mpi_share_moved(const struct work_share *share)
{
    return ((const struct mpi_share *)share->opaque)->moved;
}
