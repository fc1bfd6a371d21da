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

enum { TAG_PART, TAG_ASK, TAG_WANT, TAG_GIVEN, TAG_INPUT, TAG_SAY, TAG_SAID, TAG_FAILED };

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

struct mpi_share;

/* Ranks that a stage is of, and the last stage of these: rank 0, which leads, and some that follow each other. */
struct crew {
    struct work_share share; /* as its members see it */
    struct mpi_share *mpi;
    MPI_Comm comm;
    int rank, ranks;         /* in it; of other ranks none */
    int first, end;          /* besides rank 0, in the job */
    bool over;               /* one has failed, as all of these know */
    enum work_call called;   /* what the stage is about */
    pthread_mutex_t asking;  /* on other ranks: one thread at a time wants a part */
    uint32_t stage;          /* its number in the job */
    uint32_t parts;
    const uint32_t *order;
    uint32_t next;           /* on rank 0: places that are taken */
    const struct work_input *input; /* on rank 0 */
    pthread_t server;        /* on rank 0: gives parts to the other ranks in a stage */
    bool serves, stops;
    enum tetlod_status served; /* what it has come to, and why */
    struct tetlod_error why;
    struct result *results; /* [part] */
    unsigned char *arrived; /* on rank 0: all that others have done, in one array, which may be in a file */
};

struct mpi_share {
    struct crew all, few, rest; /* those that measure, and those that they leave */
    pthread_mutex_t lock; /* of MPI, and what follows */
    bool told;            /* another rank has failed */
    bool warned;          /* on rank 0: one has while rank 0 was busy with other ranks' stages, which are to end */
    bool ended;           /* all have done well, and know it */
    unsigned char *dropped; /* [PASS_PIECE] scratch */
    uint64_t moved;       /* to this rank */
    uint64_t passed[2];   /* on rank 0: to all, and to few */
    struct stage_time *stages; /* [stage_count] of the job; zeros: of others */
    uint32_t stage_count;
    double begun;         /* processor seconds before all */
    uint32_t samples;     /* the stage that measures */
    double meanwhile;     /* processor seconds outside of stages since that began, until the last pages */
};

static double process_seconds(void)
{
    struct timespec now;
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
    return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}

static struct stage_time *this_stage(const struct crew *crew)
{
    return &crew->mpi->stages[crew->stage];
}

/* Waits without keeping a core busy that another rank may need, nor the lock. */
static void wait_for(struct mpi_share *mpi, MPI_Request *request)
{
    int done = 0;
    for (double wait = FIRST_WAIT, waited = 0; !done;) {
        pthread_mutex_lock(&mpi->lock);
        MPI_Test(request, &done, MPI_STATUS_IGNORE);
        pthread_mutex_unlock(&mpi->lock);
        if (done)
            return;
        sleep_through(wait);
        waited += wait;
        wait = fmin(2 * wait, fmax(LONGEST_WAIT, fmin(LATE * waited, LATEST)));
    }
}

/* Messages to and from a rank of a crew that may sleep. */
static void send_to(struct crew *crew, const void *bytes, size_t size, int rank, int tag)
{
    MPI_Request request;
    pthread_mutex_lock(&crew->mpi->lock);
    MPI_Isend(bytes, (int)size, MPI_BYTE, rank, tag, crew->comm, &request);
    pthread_mutex_unlock(&crew->mpi->lock);
    wait_for(crew->mpi, &request);
}

static void receive_from(struct crew *crew, void *bytes, size_t size, int rank, int tag)
{
    MPI_Request request;
    pthread_mutex_lock(&crew->mpi->lock);
    MPI_Irecv(bytes, (int)size, MPI_BYTE, rank, tag, crew->comm, &request);
    pthread_mutex_unlock(&crew->mpi->lock);
    wait_for(crew->mpi, &request);
}

/* The sum, the largest or the least of a crew's numbers comes to all of it. */
static void reduce(struct crew *crew, const void *own, void *out, uint32_t count, MPI_Datatype type, MPI_Op op)
{
    MPI_Request request;
    pthread_mutex_lock(&crew->mpi->lock);
    MPI_Iallreduce(own, out, (int)count, type, op, crew->comm, &request);
    pthread_mutex_unlock(&crew->mpi->lock);
    wait_for(crew->mpi, &request);
}

/* Bytes of a rank come to the others. */
static void broadcast(struct crew *crew, void *bytes, size_t size, int from)
{
    MPI_Request request;
    pthread_mutex_lock(&crew->mpi->lock);
    MPI_Ibcast(bytes, (int)size, MPI_BYTE, from, crew->comm, &request);
    pthread_mutex_unlock(&crew->mpi->lock);
    wait_for(crew->mpi, &request);
}

/* What a crew agrees on: whether one of it has not done well, and a word of rank 0. */
struct agreed {
    uint64_t bad, word;
};

/* Have all of the crew done well? Then *io_word is that of rank 0. Every rank tells rank 0, and hears of it: where
 * those that wait sleep, each further step between them would take as long as a sleep. The messages go through the
 * communicator of all ranks, because a rank that waits for a call does not know yet which crew the call is for. */
static bool agree_on(struct crew *crew, bool good, uint64_t *io_word)
{
    struct mpi_share *mpi = crew->mpi;
    struct agreed agreed = {!good, *io_word}, said;
    if (mpi->all.rank) {
        send_to(&mpi->all, &agreed, sizeof agreed, 0, TAG_SAY);
        receive_from(&mpi->all, &agreed, sizeof agreed, 0, TAG_SAID);
    }
    for (int rank = crew->first; rank < crew->end && !mpi->all.rank; rank++) {
        receive_from(&mpi->all, &said, sizeof said, rank, TAG_SAY);
        agreed.bad |= said.bad;
    }
    for (int rank = crew->first; rank < crew->end && !mpi->all.rank; rank++)
        send_to(&mpi->all, &agreed, sizeof agreed, rank, TAG_SAID);
    bool any = agreed.bad != 0;
    crew->over |= any;
    mpi->told |= good && any;
    *io_word = any ? *io_word : agreed.word;
    return !any;
}

static bool agree(struct crew *crew, bool good)
{
    uint64_t none = 0;
    return agree_on(crew, good, &none);
}

static enum tetlod_status other_failed(struct tetlod_error *error)
{
    return tetlodi_fail(error, TETLOD_ERR_CANCELLED, "another rank has failed");
}

static void drop_results(struct crew *crew)
{
    struct result *results = crew->results;
    pthread_mutex_lock(&crew->mpi->lock); // where a stage is not settled the server may look for a part
    uint32_t parts = crew->parts;
    crew->parts = 0;
    crew->results = NULL;
    pthread_mutex_unlock(&crew->mpi->lock);
    for (uint32_t part = 0; part < parts && results; part++)
        if (!results[part].arrived)
            free(results[part].bytes);
    free(results);
    free(crew->arrived);
    crew->arrived = NULL;
}

/* ---- parts */

/* Does rank 0 take no part of a stage? It packs what others take, and joins what comes of it, in which they wait for
 * it: where they are many it has enough to do, and needs no memory for a part. It cuts the mesh while its border is
 * found. */
static bool only_serves(int ranks, enum work_call stage)
{
    return ranks >= (stage == CALL_BORDER ? 2 : stage == CALL_SAMPLES ? WORK_FEW + 1 : MANY);
}

/* Are pages and the root left to those that do not measure? Pages are coded meanwhile, and rank 0 cuts no more than
 * these code. */
static bool has_two_crews(int ranks)
{
    return ranks >= MANY;
}

static bool is_of_rest(int ranks, enum work_call call)
{
    return (call == CALL_PAGES || call == CALL_ROOT) && has_two_crews(ranks);
}

static struct crew *crew_of(struct mpi_share *mpi, enum work_call call)
{
    return work_is_of_few(call) ? &mpi->few : is_of_rest(mpi->all.ranks, call) ? &mpi->rest : &mpi->all;
}

/* The next part, on rank 0; false if there is none. */
static bool next_part(struct crew *crew, uint32_t *out)
{
    pthread_mutex_lock(&crew->mpi->lock);
    bool any = crew->next < crew->parts && !crew->mpi->warned;
    if (any)
        *out = crew->order ? crew->order[crew->next] : crew->next;
    crew->next += any;
    pthread_mutex_unlock(&crew->mpi->lock);
    return any;
}

/* Rank 0's answer to a rank that asks for a part. */
struct given {
    uint64_t is_part, part, size; /* size: of the input that follows */
};

/* Gives the rank a part with its input. A failure is known when the stage is settled: until then there is no part. */
static void give_part(struct crew *crew, int rank)
{
    struct buffer input = {0};
    uint32_t part = 0;
    struct given given = {.is_part = crew->served == TETLOD_OK && next_part(crew, &part), .part = part};
    if (given.is_part && crew->input)
        crew->served = crew->input->pack(crew->input->opaque, part, &input, &crew->why);
    given.is_part &= crew->served == TETLOD_OK;
    given.size = given.is_part ? input.size : 0;
    send_to(crew, &given, sizeof given, rank, TAG_GIVEN);
    for (uint64_t at = 0; at < given.size; at += PASS_PIECE)
        send_to(crew, input.bytes + at, given.size - at < PASS_PIECE ? given.size - at : PASS_PIECE, rank, TAG_INPUT);
    pthread_mutex_lock(&crew->mpi->lock);
    this_stage(crew)->given += given.is_part != 0;
    this_stage(crew)->inputs += given.size;
    pthread_mutex_unlock(&crew->mpi->lock);
    buffer_fini(&input);
}

/* The rank that has sent such an empty message, which is then received; 0: there is none. */
static int rank_that_sent(const struct crew *crew, int tag)
{
    MPI_Status status;
    int came = 0;
    MPI_Iprobe(MPI_ANY_SOURCE, tag, crew->comm, &came, &status);
    if (came)
        MPI_Recv(NULL, 0, MPI_BYTE, status.MPI_SOURCE, tag, crew->comm, MPI_STATUS_IGNORE);
    return came ? status.MPI_SOURCE : 0;
}

/* Until the stage is settled. */
static void *serve(void *opaque)
{
    struct crew *crew = opaque;
    bool stops = false;
    while (!stops) {
        pthread_mutex_lock(&crew->mpi->lock);
        int rank = rank_that_sent(crew, TAG_WANT);
        crew->mpi->warned |= rank_that_sent(crew, TAG_FAILED) != 0;
        stops = crew->stops;
        pthread_mutex_unlock(&crew->mpi->lock);
        if (rank)
            give_part(crew, rank);
        else if (!stops)
            sleep_through(LONGEST_WAIT);
    }
    return NULL;
}

static bool start_serving(struct crew *crew)
{
    crew->stops = false;
    crew->served = TETLOD_OK;
    crew->serves = crew->rank == 0 && crew->ranks > 1 && pthread_create(&crew->server, NULL, serve, crew) == 0;
    return crew->serves || crew->rank || crew->ranks == 1;
}

static void stop_serving(struct crew *crew)
{
    if (!crew->serves)
        return;
    pthread_mutex_lock(&crew->mpi->lock);
    crew->stops = true;
    pthread_mutex_unlock(&crew->mpi->lock);
    pthread_join(crew->server, NULL);
    crew->serves = false;
}

/* Makes the stages that are counted so many at least. */
static bool extend_stages(struct mpi_share *mpi, uint32_t count)
{
    if (count <= mpi->stage_count)
        return true;
    struct stage_time *stages = array_resize(mpi->stages, count, sizeof *stages);
    if (!stages)
        return false;
    mpi->stages = stages;
    for (; mpi->stage_count < count; mpi->stage_count++)
        stages[mpi->stage_count] = (struct stage_time){0};
    return true;
}

/* Room for what the stage costs; other crews' servers may be at work. */
static bool count_stage(struct crew *crew, uint32_t parts)
{
    struct mpi_share *mpi = crew->mpi;
    pthread_mutex_lock(&mpi->lock);
    bool room = extend_stages(mpi, crew->stage + 1);
    if (room)
        *this_stage(crew) = (struct stage_time){.call = crew->called, .parts = parts, .begun = process_seconds()};
    mpi->samples = crew->called == CALL_SAMPLES ? crew->stage : mpi->samples;
    pthread_mutex_unlock(&mpi->lock);
    return room;
}

static enum tetlod_status begin(void *opaque, uint32_t parts, const uint32_t *order, const struct work_input *input,
                                struct tetlod_error *error)
{
    struct crew *crew = opaque;
    crew->results = count_stage(crew, parts) ? array_zero(parts, sizeof *crew->results) : NULL;
    crew->parts = crew->results ? parts : 0;
    crew->order = order;
    crew->input = input;
    crew->next = 0;
    if (!agree(crew, crew->results && start_serving(crew))) {
        stop_serving(crew);
        return crew->mpi->told ? other_failed(error)
                               : tetlodi_fail_nomem(error, "the parts", parts * sizeof(struct result));
    }
    return TETLOD_OK;
}

/* A part from rank 0. One thread asks at a time. */
static bool want_part(struct crew *crew, uint32_t *out_part, struct buffer *out_input)
{
    struct given given;
    send_to(crew, NULL, 0, 0, TAG_WANT);
    receive_from(crew, &given, sizeof given, 0, TAG_GIVEN);
    unsigned char *to = out_input && given.size ? buffer_extend(out_input, given.size) : NULL;
    for (uint64_t at = 0; at < given.size; at += PASS_PIECE)
        receive_from(crew, to ? to + at : crew->mpi->dropped,
                     given.size - at < PASS_PIECE ? given.size - at : PASS_PIECE, 0, TAG_INPUT);
    pthread_mutex_lock(&crew->mpi->lock);
    crew->mpi->moved += given.size;
    pthread_mutex_unlock(&crew->mpi->lock);
    *out_part = (uint32_t)given.part;
    return given.is_part;
}

static bool take(void *opaque, uint32_t *out_part, struct buffer *out_input)
{
    struct crew *crew = opaque;
    bool any;
    if (crew->rank == 0) {
        any = !only_serves(crew->mpi->all.ranks, crew->called) && next_part(crew, out_part);
    } else {
        pthread_mutex_lock(&crew->asking);
        any = want_part(crew, out_part, out_input);
        pthread_mutex_unlock(&crew->asking);
    }
    if (any)
        crew->results[*out_part].begun = thread_seconds();
    return any;
}

static enum tetlod_status put(void *opaque, uint32_t part, const void *bytes, size_t size, struct tetlod_error *error)
{
    struct crew *crew = opaque;
    struct result *result = &crew->results[part]; // no other thread has this part
    double seconds = thread_seconds() - result->begun;
    result->bytes = array_new(size, 1);
    result->size = size;
    if (!result->bytes)
        return tetlodi_fail_nomem(error, "a part", size);
    if (size)
        memcpy(result->bytes, bytes, size);
    pthread_mutex_lock(&crew->mpi->lock);
    this_stage(crew)->longest = fmax(this_stage(crew)->longest, seconds);
    pthread_mutex_unlock(&crew->mpi->lock);
    return TETLOD_OK;
}

/* ---- exchange */

/* Which rank has each part, and of what size it is. */
static bool list_results(struct crew *crew, uint64_t **out)
{
    uint64_t *own = array_zero(2 * (size_t)crew->parts, sizeof *own);
    *out = array_zero(2 * (size_t)crew->parts, sizeof **out);
    for (uint32_t part = 0; part < crew->parts && own; part++)
        if (crew->results[part].bytes) {
            own[2 * (size_t)part] = (uint64_t)crew->rank;
            own[2 * (size_t)part + 1] = crew->results[part].size;
        }
    bool room = agree(crew, own && *out);
    if (room)
        reduce(crew, own, *out, 2 * crew->parts, MPI_UINT64_T, MPI_MAX);
    free(own);
    return room;
}

/* Room for what others have done, on rank 0. */
static bool make_room(struct crew *crew, const uint64_t *list)
{
    uint64_t all = 0, at = 0;
    for (uint32_t part = 0; part < crew->parts && crew->rank == 0; part++) {
        this_stage(crew)->results += list[2 * (size_t)part + 1];
        all += crew->results[part].bytes ? 0 : list[2 * (size_t)part + 1];
    }
    if (crew->rank)
        return true;
    crew->arrived = array_new(all, 1);
    for (uint32_t part = 0; part < crew->parts && crew->arrived; part++) {
        struct result *result = &crew->results[part];
        if (result->bytes)
            continue;
        *result = (struct result){crew->arrived + at, list[2 * (size_t)part + 1], 0, true};
        at += result->size;
    }
    crew->mpi->moved += all;
    return crew->arrived != NULL;
}

/* Rank 0 is the other one, or the owner. */
static void move_part(struct crew *crew, struct result *result, int owner)
{
    for (uint64_t at = 0; at < result->size; at += PIECE) {
        uint64_t size = result->size - at < PIECE ? result->size - at : PIECE;
        if (crew->rank == 0)
            receive_from(crew, result->bytes + at, size, owner, TAG_PART);
        else
            send_to(crew, result->bytes + at, size, 0, TAG_PART);
    }
}

/* The parts of a rank come to rank 0 when it asks for them: until then the other one sleeps. */
static void move_parts(struct crew *crew, const uint64_t *list, int owner)
{
    if (crew->rank == 0)
        send_to(crew, NULL, 0, owner, TAG_ASK);
    else
        receive_from(crew, NULL, 0, 0, TAG_ASK);
    for (uint32_t part = 0; part < crew->parts; part++)
        if (list[2 * (size_t)part] == (uint64_t)owner)
            move_part(crew, &crew->results[part], owner);
}

/* Then it is another rank that has failed. */
static bool is_warned(struct mpi_share *mpi)
{
    pthread_mutex_lock(&mpi->lock);
    mpi->told |= mpi->warned;
    bool warned = mpi->warned;
    pthread_mutex_unlock(&mpi->lock);
    return warned;
}

/* Processor time of the stage. What rank 0 does while others measure apart is other stages', or of none. */
static void count_spent(struct crew *crew)
{
    struct mpi_share *mpi = crew->mpi;
    const double now = process_seconds();
    if (crew->called != CALL_SAMPLES || !crew->share.apart || crew->rank)
        this_stage(crew)->all = now - this_stage(crew)->begun;
    if (crew->called != CALL_PAGES)
        return;
    mpi->meanwhile = now - mpi->stages[mpi->samples].begun;
    for (uint32_t i = mpi->samples; i < mpi->stage_count; i++)
        mpi->meanwhile -= mpi->stages[i].all;
}

static enum tetlod_status settle(void *opaque, enum tetlod_status status, bool *out_again, struct tetlod_error *error)
{
    struct crew *crew = opaque;
    uint64_t *list = NULL;
    *out_again = false;
    count_spent(crew);
    if (status != TETLOD_OK && crew->share.apart && crew->rank)
        send_to(crew, NULL, 0, 0, TAG_FAILED); // rank 0 may not settle this for long
    bool good = agree(crew, status == TETLOD_OK); // until then others may want parts
    stop_serving(crew);
    if (!good)
        return status == TETLOD_OK ? other_failed(error) : status;
    bool room = list_results(crew, &list) && make_room(crew, list) && crew->served == TETLOD_OK &&
                !is_warned(crew->mpi); // else parts are left
    if (agree(crew, room))
        for (int owner = 1; owner < crew->ranks; owner++) {
            if (crew->rank == 0 || crew->rank == owner)
                move_parts(crew, list, owner);
        }
    else if (crew->served != TETLOD_OK)
        status = tetlodi_fail(error, crew->served, "%s", crew->why.message);
    else
        status = crew->mpi->told ? other_failed(error) : tetlodi_fail_nomem(error, "the parts", crew->parts);
    free(list);
    return status;
}

static enum tetlod_status get(void *opaque, uint32_t part, size_t enough, unsigned char **out, size_t *size,
                              struct tetlod_error *error)
{
    const struct crew *crew = opaque;
    const struct result *result = &crew->results[part];
    *size = result->size < enough ? result->size : enough;
    *out = array_new(*size, 1);
    if (!*out)
        return tetlodi_fail_nomem(error, "a part", *size);
    if (*size)
        memcpy(*out, result->bytes, *size);
    return TETLOD_OK;
}

static void end_stage(void *opaque)
{
    drop_results(opaque);
}

/* ---- helpers */

/* What rank 0 says, with the number of the stage that follows, comes to those that it is for, if all of them have done
 * well. */
static bool call_crew(struct mpi_share *mpi, bool good, enum work_call *io_call, struct crew **out)
{
    enum { CALL_BITS = 8 };
    struct crew *crew = mpi->all.rank ? &mpi->all : crew_of(mpi, *io_call);
    uint64_t word = *io_call | (uint64_t)mpi->stage_count << CALL_BITS;
    *out = crew;
    if (!agree_on(crew, good, &word))
        return false;
    *io_call = (enum work_call)(word & ((1 << CALL_BITS) - 1));
    *out = crew = crew_of(mpi, *io_call);
    crew->called = *io_call;
    crew->stage = (uint32_t)(word >> CALL_BITS);
    mpi->ended = *io_call == CALL_OVER;
    return true;
}

static enum tetlod_status call(const struct work_share *share, enum work_call *io_call, const struct work_share **out,
                               struct tetlod_error *error)
{
    struct crew *crew = share->opaque;
    if (!call_crew(crew->mpi, true, io_call, &crew))
        return other_failed(error);
    *out = &crew->share;
    return TETLOD_OK;
}

static void pass(void *opaque, void *bytes, size_t size)
{
    struct crew *crew = opaque;
    for (size_t at = 0; at < size; at += PASS_PIECE) {
        unsigned char *to = bytes ? (unsigned char *)bytes + at : crew->mpi->dropped;
        broadcast(crew, to, size - at < PASS_PIECE ? size - at : PASS_PIECE, 0);
    }
    crew->mpi->moved += crew->rank ? size : 0;
    crew->mpi->passed[crew == &crew->mpi->few] += size;
}

/* ---- cost */

static void spent_alone(void *opaque, double seconds)
{
    struct crew *crew = opaque;
    this_stage(crew)->alone += seconds;
}

/* ---- the share */

/* Collective: rank 0 and those from `first` to `end`. */
static void crew_init(struct crew *crew, struct mpi_share *mpi, MPI_Comm comm, int first, int end)
{
    int rank;
    MPI_Comm_rank(comm, &rank);
    const bool leads = rank == 0, is_in = leads || (rank >= first && rank < end);
    *crew = (struct crew){.mpi = mpi, .first = first, .end = end};
    pthread_mutex_init(&crew->asking, NULL);
    MPI_Comm_split(comm, is_in ? 0 : MPI_UNDEFINED, rank, &crew->comm);
    if (is_in) {
        MPI_Comm_rank(crew->comm, &crew->rank);
        MPI_Comm_size(crew->comm, &crew->ranks);
    }
    crew->share = (struct work_share){.members = (uint32_t)crew->ranks, .leads = leads, .writes = leads,
                                      .begin = begin, .take = take, .put = put, .settle = settle, .get = get,
                                      .end = end_stage, .spent_alone = spent_alone, .call = call, .pass = pass,
                                      .opaque = crew};
}

static void crew_fini(struct crew *crew)
{
    stop_serving(crew);
    drop_results(crew);
    if (crew->comm != MPI_COMM_NULL)
        MPI_Comm_free(&crew->comm);
    pthread_mutex_destroy(&crew->asking);
}

enum tetlod_status mpi_share_new(struct work_share *out, MPI_Comm comm, struct tetlod_error *error)
{
    struct mpi_share *mpi = array_zero(1, sizeof *mpi);
    unsigned char *dropped = array_new(PASS_PIECE, 1);
    int ranks;
    *out = (struct work_share){0};
    if (!mpi || !dropped) {
        free(mpi);
        free(dropped);
        return tetlodi_fail_nomem(error, "the ranks", PASS_PIECE);
    }
    MPI_Comm_size(comm, &ranks);
    const int few = ranks < WORK_FEW ? ranks : WORK_FEW;
    mpi->dropped = dropped;
    pthread_mutex_init(&mpi->lock, NULL);
    crew_init(&mpi->all, mpi, comm, 1, ranks);
    crew_init(&mpi->few, mpi, comm, 1, few);
    crew_init(&mpi->rest, mpi, comm, few, ranks);
    mpi->all.share.serves = mpi->all.rank == 0 && only_serves(ranks, CALL_CELLS);
    mpi->few.share.members -= only_serves(ranks, CALL_SAMPLES) && mpi->few.ranks;
    mpi->few.share.apart = has_two_crews(ranks);
    mpi->begun = process_seconds();
    *out = mpi->all.share;
    return TETLOD_OK;
}

void mpi_share_free(struct work_share *share)
{
    if (!share->opaque)
        return;
    struct mpi_share *mpi = ((struct crew *)share->opaque)->mpi;
    crew_fini(&mpi->all);
    crew_fini(&mpi->few);
    crew_fini(&mpi->rest);
    free(mpi->stages);
    free(mpi->dropped);
    pthread_mutex_destroy(&mpi->lock);
    free(mpi);
    *share = (struct work_share){0};
}

/* Of rank 0: a crew that does not know yet that a rank has failed hears of it, when it has done what it is at. */
static void tell_rest(struct mpi_share *mpi)
{
    if (!mpi->all.over && !mpi->few.over)
        agree(&mpi->few, false);
    if (!mpi->all.over && !mpi->rest.over)
        agree(&mpi->rest, false);
}

bool mpi_share_finish(struct work_share *share, bool good, const char *text, int *out_rank, char **out_text)
{
    struct crew *crew = share->opaque;
    struct mpi_share *mpi = crew->mpi;
    enum work_call call = CALL_OVER;
    *out_text = NULL;
    if (mpi->ended ||
        (!mpi->all.over && !mpi->few.over && !mpi->rest.over && call_crew(mpi, good, &call, &crew)))
        return true;
    if (mpi->all.rank == 0)
        tell_rest(mpi);
    int own = good || mpi->told ? mpi->all.ranks : mpi->all.rank;
    size_t length = strlen(text);
    reduce(&mpi->all, &own, out_rank, 1, MPI_INT, MPI_MIN);
    broadcast(&mpi->all, &length, sizeof length, *out_rank);
    *out_text = array_zero(length + 1, 1);
    if (!*out_text)
        return false;
    if (mpi->all.rank == *out_rank)
        memcpy(*out_text, text, length);
    broadcast(&mpi->all, *out_text, length, *out_rank);
    return false;
}

/* ---- what it has cost */

/* A stage on all ranks. */
static void sum_stage(struct crew *crew, const struct stage_time *own, struct stage_cost *out)
{
    const double add[2] = {own->all - own->alone, own->given ? (double)own->inputs * own->parts / own->given : 0};
    const double compare[3] = {own->longest, own->alone, (double)own->results};
    double sums[2], most[3];
    reduce(crew, add, sums, 2, MPI_DOUBLE, MPI_SUM);
    reduce(crew, compare, most, 3, MPI_DOUBLE, MPI_MAX);
    bool sweeps = own->call == CALL_SAMPLES; // many parts at once: each has its share
    *out = (struct stage_cost){own->call, own->parts, sums[0], most[1], sweeps ? sums[0] / own->parts : most[0],
                               sums[1] + most[2]};
}

/* All ranks count so many stages, though they had no part in some. */
static bool match_stages(struct mpi_share *mpi)
{
    uint32_t count;
    reduce(&mpi->all, &mpi->stage_count, &count, 1, MPI_UINT32_T, MPI_MAX);
    return extend_stages(mpi, count);
}

/* Outside of stages. */
static void sum_outside(struct mpi_share *mpi, double outside, struct job_cost *out)
{
    const bool leads = mpi->all.rank == 0;
    const double least = leads ? INFINITY : outside, most[2] = {leads ? outside : 0, leads ? mpi->meanwhile : 0};
    double all[2];
    reduce(&mpi->all, &least, &out->alone, 1, MPI_DOUBLE, MPI_MIN);
    reduce(&mpi->all, most, all, 2, MPI_DOUBLE, MPI_MAX);
    out->alone = mpi->all.ranks > 1 ? out->alone : 0;
    out->meanwhile = all[1];
    out->leads = fmax(all[0] - out->alone - out->meanwhile, 0);
}

static void sum_bytes(struct mpi_share *mpi, struct job_cost *out)
{
    const bool leads = mpi->all.rank == 0;
    struct rusage usage;
    getrusage(RUSAGE_SELF, &usage);
    uint64_t resident = (uint64_t)usage.ru_maxrss << 10, all[5];
    const uint64_t bytes[5] = {mpi->moved, leads ? resident : 0, leads ? 0 : resident,
                               leads ? mpi->passed[0] : 0, leads ? mpi->passed[1] : 0};
    reduce(&mpi->all, bytes, all, 5, MPI_UINT64_T, MPI_MAX);
    reduce(&mpi->all, &mpi->moved, &out->moved[1], 1, MPI_UINT64_T, MPI_SUM);
    out->moved[0] = all[0];
    memcpy(out->resident, all + 1, sizeof out->resident);
    out->passed[0] = (double)all[3];
    out->passed[1] = (double)all[4];
}

enum tetlod_status mpi_share_cost(const struct work_share *share, struct job_cost *out, struct tetlod_error *error)
{
    struct mpi_share *mpi = ((struct crew *)share->opaque)->mpi;
    struct crew *all = &mpi->all;
    double outside = process_seconds() - mpi->begun;
    *out = (struct job_cost){0};
    if (agree(all, match_stages(mpi)))
        out->stages = array_zero(mpi->stage_count, sizeof *out->stages);
    if (all->over || !agree(all, out->stages != NULL))
        return mpi->told ? other_failed(error) : tetlodi_fail_nomem(error, "the stages", mpi->stage_count);
    out->stage_count = mpi->stage_count;
    reduce(all, &outside, &out->spent[0], 1, MPI_DOUBLE, MPI_MAX);
    reduce(all, &outside, &out->spent[1], 1, MPI_DOUBLE, MPI_SUM);
    for (uint32_t i = 0; i < mpi->stage_count; i++) {
        sum_stage(all, &mpi->stages[i], &out->stages[i]);
        outside -= mpi->stages[i].all;
    }
    sum_outside(mpi, outside, out);
    sum_bytes(mpi, out);
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
    return those - serves_in(stage, ranks) - (is_of_rest((int)ranks, stage->call) ? WORK_FEW - 1 : 0);
}

double job_cost_of(const struct job_cost *cost, uint32_t ranks)
{
    double seconds = cost->alone + cost->leads, samples = 0, meanwhile = cost->meanwhile;
    for (uint32_t i = 0; i < cost->stage_count; i++) {
        const struct stage_cost *stage = &cost->stages[i];
        double *to = stage->call == CALL_SAMPLES ? &samples : stage->call == CALL_PAGES ? &meanwhile : &seconds;
        *to += stage->alone + fmax(stage->work / ranks_in(stage, ranks), stage->longest);
    }
    return seconds + (has_two_crews((int)ranks) ? fmax(samples, meanwhile) : samples + meanwhile);
}

double job_cost_of_all(const struct job_cost *cost, uint32_t ranks)
{
    double seconds = ranks * cost->alone + cost->leads + cost->meanwhile;
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
