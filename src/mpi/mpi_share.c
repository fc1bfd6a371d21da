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

/* So many ranks leave rank 0 to serve them. */
enum { MANY = 8 };

enum { TAG_PART, TAG_ASK, TAG_WANT, TAG_GIVEN, TAG_INPUT, TAG_SAY, TAG_SAID };

/* Seconds between looks at whether others have come, or want a part. Who has waited long looks late by a share of that:
 * a look costs as much as a fault. */
static const double FIRST_WAIT = 1e-4, LONGEST_WAIT = 4e-3, LATE = 0.01, LATEST = 0.1;

struct result {
    unsigned char *bytes;
    uint64_t size;
    double begun; /* processor seconds of its thread */
    bool arrived; /* the bytes are in mpi_share.arrived */
};

/* What a stage costs this rank. */
struct stage_time {
    enum work_call call;
    uint32_t parts;
    double begun, all, alone, longest;
    uint32_t given;       /* on rank 0: parts that others got */
    uint64_t inputs;      /* bytes of what they got with them */
    uint64_t results;     /* bytes of all parts */
};

struct mpi_share {
    MPI_Comm comm, few;   /* few: of the first WORK_FEW ranks, or MPI_COMM_NULL */
    MPI_Comm hears;       /* borrowed: of those that what is passed comes to */
    enum work_call called; /* for: what the next stage is about */
    int rank, ranks;
    pthread_mutex_t asking; /* on other ranks: one thread at a time wants a part */
    pthread_mutex_t lock; /* of MPI, and what follows */
    uint32_t parts;
    const uint32_t *order;
    uint32_t next;       /* on rank 0: places that are taken */
    const struct work_input *input; /* on rank 0 */
    pthread_t server;    /* on rank 0: gives parts to the other ranks in a stage */
    bool serves, stops;
    enum tetlod_status served; /* what it has come to, and why */
    struct tetlod_error why;
    struct result *results; /* [part] */
    unsigned char *arrived; /* on rank 0: all that others have done, in one array, which may be in a file */
    bool over, told;     /* a rank has failed, as all know; it was another one */
    bool ended;          /* all have done well, and know it */
    unsigned char *dropped; /* [PASS_PIECE] scratch */
    uint64_t moved;      /* to this rank */
    uint64_t passed[2];  /* on rank 0: to all, and to few */
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

/* Waits without keeping a core busy that another rank may need, nor the lock. */
static void wait_for(struct mpi_share *share, MPI_Request *request)
{
    int done = 0;
    for (double wait = FIRST_WAIT, waited = 0; !done;) {
        pthread_mutex_lock(&share->lock);
        MPI_Test(request, &done, MPI_STATUS_IGNORE);
        pthread_mutex_unlock(&share->lock);
        if (done)
            return;
        sleep_through(wait);
        waited += wait;
        wait = fmin(2 * wait, fmax(LONGEST_WAIT, fmin(LATE * waited, LATEST)));
    }
}

/* Messages to and from a rank that may sleep. */
static void send_to(struct mpi_share *share, const void *bytes, size_t size, int rank, int tag)
{
    MPI_Request request;
    pthread_mutex_lock(&share->lock);
    MPI_Isend(bytes, (int)size, MPI_BYTE, rank, tag, share->comm, &request);
    pthread_mutex_unlock(&share->lock);
    wait_for(share, &request);
}

static void receive_from(struct mpi_share *share, void *bytes, size_t size, int rank, int tag)
{
    MPI_Request request;
    pthread_mutex_lock(&share->lock);
    MPI_Irecv(bytes, (int)size, MPI_BYTE, rank, tag, share->comm, &request);
    pthread_mutex_unlock(&share->lock);
    wait_for(share, &request);
}

/* The sum, the largest or the least of all ranks' numbers comes to all. */
static void reduce(struct mpi_share *share, const void *own, void *out, uint32_t count, MPI_Datatype type, MPI_Op op)
{
    MPI_Request request;
    pthread_mutex_lock(&share->lock);
    MPI_Iallreduce(own, out, (int)count, type, op, share->comm, &request);
    pthread_mutex_unlock(&share->lock);
    wait_for(share, &request);
}

/* Bytes of a rank, or of rank 0 to those of `comm`, come to the others. */
static void broadcast(struct mpi_share *share, void *bytes, size_t size, int from, MPI_Comm comm)
{
    MPI_Request request;
    pthread_mutex_lock(&share->lock);
    MPI_Ibcast(bytes, (int)size, MPI_BYTE, from, comm, &request);
    pthread_mutex_unlock(&share->lock);
    wait_for(share, &request);
}

/* What all ranks agree on: whether one has not done well, and a word of rank 0. */
struct agreed {
    uint64_t bad, word;
};

/* Have all ranks done well? Then *io_word is that of rank 0. Every rank tells rank 0, and hears of it: where those that
 * wait sleep, each further step between them would take as long as a sleep. */
static bool agree_on(struct mpi_share *share, bool good, uint64_t *io_word)
{
    struct agreed agreed = {!good, *io_word}, said;
    if (share->rank) {
        send_to(share, &agreed, sizeof agreed, 0, TAG_SAY);
        receive_from(share, &agreed, sizeof agreed, 0, TAG_SAID);
    }
    for (int rank = 1; rank < share->ranks && !share->rank; rank++) {
        receive_from(share, &said, sizeof said, rank, TAG_SAY);
        agreed.bad |= said.bad;
    }
    for (int rank = 1; rank < share->ranks && !share->rank; rank++)
        send_to(share, &agreed, sizeof agreed, rank, TAG_SAID);
    bool any = agreed.bad != 0;
    share->over |= any;
    share->told |= good && any;
    *io_word = any ? *io_word : agreed.word;
    return !any;
}

static bool agree(struct mpi_share *share, bool good)
{
    uint64_t none = 0;
    return agree_on(share, good, &none);
}

static enum tetlod_status other_failed(struct tetlod_error *error)
{
    return tetlodi_fail(error, TETLOD_ERR_CANCELLED, "another rank has failed");
}

static void drop_results(struct mpi_share *share)
{
    for (uint32_t part = 0; part < share->parts && share->results; part++)
        if (!share->results[part].arrived)
            free(share->results[part].bytes);
    free(share->results);
    free(share->arrived);
    share->results = NULL;
    share->arrived = NULL;
    share->parts = 0;
}

/* ---- parts */

/* Does rank 0 take no part of a stage? It packs what others take, and joins what comes of it, in which they wait for
 * it: where they are many it has enough to do, and needs no memory for a part. It cuts the mesh while its border is
 * found. */
static bool only_serves(int ranks, enum work_call stage)
{
    return ranks >= (stage == CALL_BORDER ? 2 : stage == CALL_SAMPLES ? WORK_FEW + 1 : MANY);
}

/* Does a rank leave pages and the root to the others, as it measures? Where they are many rank 0 cuts no more than they
 * code. */
static bool is_spared(int rank, int ranks, enum work_call stage)
{
    return (stage == CALL_PAGES || stage == CALL_ROOT) && ranks >= MANY && rank > 0 && rank < WORK_FEW;
}

/* The next part, on rank 0; false if there is none. */
static bool next_part(struct mpi_share *share, uint32_t *out)
{
    pthread_mutex_lock(&share->lock);
    bool any = share->next < share->parts;
    if (any)
        *out = share->order ? share->order[share->next] : share->next;
    share->next += any;
    pthread_mutex_unlock(&share->lock);
    return any;
}

/* Rank 0's answer to a rank that asks for a part. */
struct given {
    uint64_t is_part, part, size; /* size: of the input that follows */
};

/* Gives the rank a part with its input. A failure is known when the stage is settled: until then there is no part. */
static void give_part(struct mpi_share *share, int rank)
{
    struct buffer input = {0};
    uint32_t part = 0;
    struct given given = {.is_part = share->served == TETLOD_OK && next_part(share, &part), .part = part};
    if (given.is_part && share->input)
        share->served = share->input->pack(share->input->opaque, part, &input, &share->why);
    given.is_part &= share->served == TETLOD_OK;
    given.size = given.is_part ? input.size : 0;
    send_to(share, &given, sizeof given, rank, TAG_GIVEN);
    for (uint64_t at = 0; at < given.size; at += PASS_PIECE)
        send_to(share, input.bytes + at, given.size - at < PASS_PIECE ? given.size - at : PASS_PIECE, rank, TAG_INPUT);
    pthread_mutex_lock(&share->lock);
    this_stage(share)->given += given.is_part != 0;
    this_stage(share)->inputs += given.size;
    pthread_mutex_unlock(&share->lock);
    buffer_fini(&input);
}

/* Until the stage is settled. */
static void *serve(void *opaque)
{
    struct mpi_share *share = opaque;
    bool stops = false;
    while (!stops) {
        MPI_Status status;
        int wanted = 0;
        pthread_mutex_lock(&share->lock);
        MPI_Iprobe(MPI_ANY_SOURCE, TAG_WANT, share->comm, &wanted, &status);
        if (wanted)
            MPI_Recv(NULL, 0, MPI_BYTE, status.MPI_SOURCE, TAG_WANT, share->comm, MPI_STATUS_IGNORE);
        stops = share->stops;
        pthread_mutex_unlock(&share->lock);
        if (wanted)
            give_part(share, status.MPI_SOURCE);
        else if (!stops)
            sleep_through(LONGEST_WAIT);
    }
    return NULL;
}

static bool start_serving(struct mpi_share *share)
{
    share->stops = false;
    share->served = TETLOD_OK;
    share->serves = share->rank == 0 && share->ranks > 1 &&
                    pthread_create(&share->server, NULL, serve, share) == 0;
    return share->serves || share->rank || share->ranks == 1;
}

static void stop_serving(struct mpi_share *share)
{
    if (!share->serves)
        return;
    pthread_mutex_lock(&share->lock);
    share->stops = true;
    pthread_mutex_unlock(&share->lock);
    pthread_join(share->server, NULL);
    share->serves = false;
}

static enum tetlod_status begin(void *opaque, uint32_t parts, const uint32_t *order, const struct work_input *input,
                                struct tetlod_error *error)
{
    struct mpi_share *share = opaque;
    struct stage_time *stages = array_resize(share->stages, share->stage_count + (size_t)1, sizeof *stages);
    share->stages = stages ? stages : share->stages;
    share->results = stages ? array_zero(parts, sizeof *share->results) : NULL;
    share->parts = share->results ? parts : 0;
    share->order = order;
    share->input = input;
    share->next = 0;
    if (stages) // before others are served
        share->stages[share->stage_count++] = (struct stage_time){.call = share->called, .parts = parts,
                                                                  .begun = process_seconds()};
    if (!agree(share, share->results && start_serving(share))) {
        stop_serving(share);
        return share->told ? other_failed(error)
                           : tetlodi_fail_nomem(error, "the parts", parts * sizeof(struct result));
    }
    return TETLOD_OK;
}

/* A part from rank 0. One thread asks at a time. */
static bool want_part(struct mpi_share *share, uint32_t *out_part, struct buffer *out_input)
{
    struct given given;
    send_to(share, NULL, 0, 0, TAG_WANT);
    receive_from(share, &given, sizeof given, 0, TAG_GIVEN);
    unsigned char *to = out_input && given.size ? buffer_extend(out_input, given.size) : NULL;
    for (uint64_t at = 0; at < given.size; at += PASS_PIECE)
        receive_from(share, to ? to + at : share->dropped,
                     given.size - at < PASS_PIECE ? given.size - at : PASS_PIECE, 0, TAG_INPUT);
    pthread_mutex_lock(&share->lock);
    share->moved += given.size;
    pthread_mutex_unlock(&share->lock);
    *out_part = (uint32_t)given.part;
    return given.is_part;
}

static bool take(void *opaque, uint32_t *out_part, struct buffer *out_input)
{
    struct mpi_share *share = opaque;
    bool any;
    if (share->rank == 0) {
        any = !only_serves(share->ranks, share->called) && next_part(share, out_part);
    } else if (is_spared(share->rank, share->ranks, share->called)) {
        any = false;
    } else {
        pthread_mutex_lock(&share->asking);
        any = want_part(share, out_part, out_input);
        pthread_mutex_unlock(&share->asking);
    }
    if (any)
        share->results[*out_part].begun = thread_seconds();
    return any;
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
    if (size)
        memcpy(result->bytes, bytes, size);
    pthread_mutex_lock(&share->lock);
    this_stage(share)->longest = fmax(this_stage(share)->longest, seconds);
    pthread_mutex_unlock(&share->lock);
    return TETLOD_OK;
}

/* ---- exchange */

/* Which rank has each part, and of what size it is. */
static bool list_results(struct mpi_share *share, uint64_t **out)
{
    uint64_t *own = array_zero(2 * (size_t)share->parts, sizeof *own);
    *out = array_zero(2 * (size_t)share->parts, sizeof **out);
    for (uint32_t part = 0; part < share->parts && own; part++)
        if (share->results[part].bytes) {
            own[2 * (size_t)part] = (uint64_t)share->rank;
            own[2 * (size_t)part + 1] = share->results[part].size;
        }
    bool room = agree(share, own && *out);
    if (room)
        reduce(share, own, *out, 2 * share->parts, MPI_UINT64_T, MPI_MAX);
    free(own);
    return room;
}

/* Room for what others have done, on rank 0. */
static bool make_room(struct mpi_share *share, const uint64_t *list)
{
    uint64_t all = 0, at = 0;
    for (uint32_t part = 0; part < share->parts && share->rank == 0; part++) {
        this_stage(share)->results += list[2 * (size_t)part + 1];
        all += share->results[part].bytes ? 0 : list[2 * (size_t)part + 1];
    }
    if (share->rank)
        return true;
    share->arrived = array_new(all, 1);
    for (uint32_t part = 0; part < share->parts && share->arrived; part++) {
        struct result *result = &share->results[part];
        if (result->bytes)
            continue;
        *result = (struct result){share->arrived + at, list[2 * (size_t)part + 1], 0, true};
        at += result->size;
    }
    share->moved += all;
    return share->arrived != NULL;
}

/* Rank 0 is the other one, or the owner. */
static void move_part(struct mpi_share *share, struct result *result, int owner)
{
    for (uint64_t at = 0; at < result->size; at += PIECE) {
        uint64_t size = result->size - at < PIECE ? result->size - at : PIECE;
        if (share->rank == 0)
            receive_from(share, result->bytes + at, size, owner, TAG_PART);
        else
            send_to(share, result->bytes + at, size, 0, TAG_PART);
    }
}

/* The parts of a rank come to rank 0 when it asks for them: until then the other one sleeps. */
static void move_parts(struct mpi_share *share, const uint64_t *list, int owner)
{
    if (share->rank == 0)
        send_to(share, NULL, 0, owner, TAG_ASK);
    else
        receive_from(share, NULL, 0, 0, TAG_ASK);
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
    bool good = agree(share, status == TETLOD_OK); // until then others may want parts
    stop_serving(share);
    if (!good)
        return status == TETLOD_OK ? other_failed(error) : status;
    bool room = list_results(share, &list) && make_room(share, list) && share->served == TETLOD_OK;
    if (agree(share, room))
        for (int owner = 1; owner < share->ranks; owner++) {
            if (share->rank == 0 || share->rank == owner)
                move_parts(share, list, owner);
        }
    else if (share->served != TETLOD_OK)
        status = tetlodi_fail(error, share->served, "%s", share->why.message);
    else
        status = share->told ? other_failed(error) : tetlodi_fail_nomem(error, "the parts", share->parts);
    free(list);
    return status;
}

static enum tetlod_status get(void *opaque, uint32_t part, size_t enough, unsigned char **out, size_t *size,
                              struct tetlod_error *error)
{
    const struct mpi_share *share = opaque;
    const struct result *result = &share->results[part];
    *size = result->size < enough ? result->size : enough;
    *out = array_new(*size, 1);
    if (!*out)
        return tetlodi_fail_nomem(error, "a part", *size);
    if (*size)
        memcpy(*out, result->bytes, *size);
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
    uint64_t word = *io_call;
    if (!agree_on(share, good, &word))
        return false;
    share->ended = word == CALL_OVER;
    share->called = (enum work_call)word;
    share->hears = work_is_of_few(share->called) ? share->few : share->comm;
    *io_call = share->called;
    return true;
}

static enum tetlod_status call(void *opaque, enum work_call *io_call, bool *out_idle, struct tetlod_error *error)
{
    const struct mpi_share *share = opaque;
    if (!call_all(opaque, true, io_call))
        return other_failed(error);
    if (out_idle)
        *out_idle = share->hears == MPI_COMM_NULL;
    return TETLOD_OK;
}

static void pass(void *opaque, void *bytes, size_t size)
{
    struct mpi_share *share = opaque;
    for (size_t at = 0; at < size; at += PASS_PIECE) {
        unsigned char *to = bytes ? (unsigned char *)bytes + at : share->dropped;
        broadcast(share, to, size - at < PASS_PIECE ? size - at : PASS_PIECE, 0, share->hears);
    }
    share->moved += share->rank ? size : 0;
    share->passed[share->hears == share->few] += size;
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
    MPI_Comm_split(share->comm, share->rank < WORK_FEW ? 0 : MPI_UNDEFINED, share->rank, &share->few);
    pthread_mutex_init(&share->lock, NULL);
    pthread_mutex_init(&share->asking, NULL);
    share->begun = process_seconds();
    const uint32_t few = share->ranks < WORK_FEW ? (uint32_t)share->ranks : WORK_FEW;
    *out = (struct work_share){.members = (uint32_t)share->ranks, .few = few - only_serves(share->ranks, CALL_SAMPLES),
                               .leads = share->rank == 0, .writes = share->rank == 0,
                               .serves = share->rank == 0 && only_serves(share->ranks, CALL_CELLS), .begin = begin,
                               .take = take, .put = put, .settle = settle, .get = get, .end = end,
                               .spent_alone = spent_alone, .call = call, .pass = pass, .opaque = share};
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
    if (mpi->few != MPI_COMM_NULL)
        MPI_Comm_free(&mpi->few);
    MPI_Comm_free(&mpi->comm);
    pthread_mutex_destroy(&mpi->lock);
    pthread_mutex_destroy(&mpi->asking);
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
    int own = good || mpi->told ? mpi->ranks : mpi->rank;
    size_t length = strlen(text);
    reduce(mpi, &own, out_rank, 1, MPI_INT, MPI_MIN);
    broadcast(mpi, &length, sizeof length, *out_rank, mpi->comm);
    *out_text = array_zero(length + 1, 1);
    if (!*out_text)
        return false;
    if (mpi->rank == *out_rank)
        memcpy(*out_text, text, length);
    broadcast(mpi, *out_text, length, *out_rank, mpi->comm);
    return false;
}

/* ---- what it has cost */

/* A stage on all ranks. */
static void sum_stage(struct mpi_share *share, const struct stage_time *own, struct stage_cost *out)
{
    const double add[2] = {own->all - own->alone, own->given ? (double)own->inputs * own->parts / own->given : 0};
    const double compare[3] = {own->longest, own->alone, (double)own->results};
    double sums[2], most[3];
    reduce(share, add, sums, 2, MPI_DOUBLE, MPI_SUM);
    reduce(share, compare, most, 3, MPI_DOUBLE, MPI_MAX);
    bool sweeps = own->call == CALL_SAMPLES; // many parts at once: each has its share
    *out = (struct stage_cost){own->call, own->parts, sums[0], most[1], sweeps ? sums[0] / own->parts : most[0],
                               sums[1] + most[2]};
}

enum tetlod_status mpi_share_cost(const struct work_share *share, struct job_cost *out, struct tetlod_error *error)
{
    struct mpi_share *mpi = share->opaque;
    struct rusage usage;
    double outside = process_seconds() - mpi->begun, least, most;
    *out = (struct job_cost){.stages = array_zero(mpi->stage_count, sizeof *out->stages),
                             .stage_count = mpi->stage_count};
    if (!agree(mpi, out->stages != NULL))
        return mpi->told ? other_failed(error) : tetlodi_fail_nomem(error, "the stages", mpi->stage_count);
    reduce(mpi, &outside, &out->spent[0], 1, MPI_DOUBLE, MPI_MAX);
    reduce(mpi, &outside, &out->spent[1], 1, MPI_DOUBLE, MPI_SUM);
    for (uint32_t i = 0; i < mpi->stage_count; i++) {
        sum_stage(mpi, &mpi->stages[i], &out->stages[i]);
        outside -= mpi->stages[i].all;
    }
    least = mpi->rank ? outside : INFINITY;
    most = mpi->rank ? 0 : outside;
    reduce(mpi, &least, &out->alone, 1, MPI_DOUBLE, MPI_MIN);
    reduce(mpi, &most, &out->leads, 1, MPI_DOUBLE, MPI_MAX);
    out->alone = mpi->ranks > 1 ? out->alone : 0;
    out->leads = fmax(out->leads - out->alone, 0);
    getrusage(RUSAGE_SELF, &usage);
    uint64_t resident = (uint64_t)usage.ru_maxrss << 10, all[5];
    const uint64_t bytes[5] = {mpi->moved, mpi->rank ? 0 : resident, mpi->rank ? resident : 0,
                               mpi->rank ? 0 : mpi->passed[0], mpi->rank ? 0 : mpi->passed[1]};
    reduce(mpi, bytes, all, 5, MPI_UINT64_T, MPI_MAX);
    reduce(mpi, &mpi->moved, &out->moved[1], 1, MPI_UINT64_T, MPI_SUM);
    out->moved[0] = all[0];
    memcpy(out->resident, all + 1, sizeof out->resident);
    out->passed[0] = (double)all[3];
    out->passed[1] = (double)all[4];
    return TETLOD_OK;
}

void job_cost_fini(struct job_cost *cost)
{
    free(cost->stages);
    *cost = (struct job_cost){0};
}

static bool serves_in(const struct stage_cost *stage, uint32_t ranks)
{
    return only_serves((int)ranks, stage->call);
}

/* Of so many ranks those that do parts of the stage. */
static uint32_t ranks_in(const struct stage_cost *stage, uint32_t ranks)
{
    if (stage->call == CALL_BORDER) // and rank 0 cuts
        return ranks < 2 ? ranks : 2;
    uint32_t those = stage->call == CALL_SAMPLES && ranks > WORK_FEW ? WORK_FEW : ranks;
    uint32_t spared = is_spared(1, (int)ranks, stage->call) ? WORK_FEW - 1 : 0;
    return those - serves_in(stage, ranks) - spared;
}

double job_cost_of(const struct job_cost *cost, uint32_t ranks)
{
    double seconds = cost->alone + cost->leads;
    for (uint32_t i = 0; i < cost->stage_count; i++) {
        const struct stage_cost *stage = &cost->stages[i];
        seconds += stage->alone + fmax(stage->work / ranks_in(stage, ranks), stage->longest);
    }
    return seconds;
}

double job_cost_of_all(const struct job_cost *cost, uint32_t ranks)
{
    double seconds = ranks * cost->alone + cost->leads;
    for (uint32_t i = 0; i < cost->stage_count; i++)
        seconds += cost->stages[i].work + ranks_in(&cost->stages[i], ranks) * cost->stages[i].alone;
    return seconds;
}

double job_cost_moved(const struct job_cost *cost, uint32_t ranks)
{
    double bytes = (ranks - 1) * cost->passed[0] + ((ranks < WORK_FEW ? ranks : WORK_FEW) - 1) * cost->passed[1];
    for (uint32_t i = 0; i < cost->stage_count; i++) {
        uint32_t own = !serves_in(&cost->stages[i], ranks), those = ranks_in(&cost->stages[i], ranks);
        bytes += cost->stages[i].moved * (those - own) / those;
    }
    return bytes;
}
