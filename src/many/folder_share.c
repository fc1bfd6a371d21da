/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * FOLDER/leader.lease      one of the members reads the mesh: "machine process"; its time is when that was last known
 *                          to live
 * FOLDER/helped            there are others
 * FOLDER/mesh              what tells the mesh and the options from others
 * FOLDER/over              all stages are done
 * FOLDER/stage-3/call      what the leader calls helpers for, and what it passes on to them
 * FOLDER/stage-3/parts     how many parts the third stage has
 * FOLDER/stage-3/17.in     what a helper needs of part 17, until it is done
 * FOLDER/stage-3/few-2     a helper is one of the few that do the stage
 * FOLDER/stage-3/17        part 17: its bytes
 * FOLDER/stage-3/17.lease  someone is at it
 *
 * Parts, and what helpers need of them, have their hash behind them.
 *
 * Times are compared as the folder's file system knows them, so that clocks of machines may differ.
 */
#include "src/many/folder_share.h"

#include <errno.h>
#include <fcntl.h>
#include <math.h>
#include <pthread.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <time.h>
#include <unistd.h>

#include "format/fail.h"
#include "src/util/array.h"
#include "src/util/clock.h"
#include "src/util/file.h"
#include "src/util/hash.h"

/* Seconds after which a lease that is not touched is nobody's; and between touches. */
enum { LEASE_LIFE = 60, LEASE_TOUCH = 10 };

/* Seconds between looks at what others do. */
static const double FIRST_WAIT = 0.01, LONGEST_WAIT = 0.5;

enum part_state { PART_OPEN, PART_HERE, PART_DONE };

struct folder_share {
    struct work_share all, few;         /* of the folder; of a stage that is one of few */
    char folder[4096 - 64], owner[320]; /* owner: "machine process" */
    bool leads, writes, passes;         /* passes: there may be helpers */
    bool orphaned;                      /* of a helper: the leader has died */
    pthread_mutex_t lock;               /* of the states and the next place */
    pthread_cond_t stopped;
    pthread_t toucher;
    bool touches, stops;
    uint32_t stage, parts, next;        /* next place to look at */
    const uint32_t *order;
    uint8_t *states;                    /* [part] enum part_state */
    struct file_output *call;           /* that the leader is writing, or NULL */
    struct file_view heard;             /* what a helper reads */
    size_t heard_at;
    bool cut_off;                       /* it is shorter than what there should be */
};

/* A file of the folder. */
static void file_of(const struct folder_share *share, char out[4096], const char *name)
{
    snprintf(out, 4096, "%s/%s", share->folder, name);
}

static void stage_path(const struct folder_share *share, uint32_t stage, char out[4096], const char *name)
{
    snprintf(out, 4096, "%s/stage-%u/%s", share->folder, stage, name);
}

/* A file of the current stage. */
static void path_of(const struct folder_share *share, char out[4096], const char *name)
{
    stage_path(share, share->stage, out, name);
}

static void part_path(const struct folder_share *share, char out[4096], uint32_t part, const char *suffix)
{
    char name[32];
    snprintf(name, sizeof name, "%u%s", part, suffix);
    path_of(share, out, name);
}

static bool is_there(const char *path)
{
    return access(path, F_OK) == 0;
}

static enum tetlod_status fail_at(struct tetlod_error *error, const char *path, const char *what)
{
    return tetlodi_fail(error, TETLOD_ERR_IO, "%s: cannot %s: %s", path, what, strerror(errno));
}

static bool is_done(const struct folder_share *share, uint32_t part)
{
    char path[4096];
    part_path(share, path, part, "");
    return is_there(path);
}

/* ---- leases */

/* Leaves a lease. False: there is one. */
static bool take_lease(const struct folder_share *share, const char *path)
{
    int fd = open(path, O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0666);
    if (fd < 0)
        return errno != EEXIST; // without a lease it may be done twice, and put() says what is wrong with the folder
    ssize_t written = write(fd, share->owner, strlen(share->owner));
    (void)written; // who cannot read the owner goes by the time
    close(fd);
    return true;
}

static void drop_lease(const struct folder_share *share, uint32_t part)
{
    char path[4096];
    part_path(share, path, part, ".lease");
    unlink(path);
}

/* Is its owner a process of this machine that is no more? */
static bool owner_is_gone(const struct folder_share *share, const char *path)
{
    char owner[sizeof share->owner] = "";
    int fd = open(path, O_RDONLY | O_CLOEXEC);
    ssize_t size = fd < 0 ? 0 : read(fd, owner, sizeof owner - 1);
    if (fd >= 0)
        close(fd);
    const char *process = size > 0 ? strrchr(owner, ' ') : NULL;
    size_t machine = process ? (size_t)(process - owner) : 0;
    if (!process || strncmp(owner, share->owner, machine + 1) != 0)
        return false;
    long number = strtol(process, NULL, 10);
    return number > 0 && kill((pid_t)number, 0) != 0 && errno == ESRCH;
}

/* What time the folder's file system has: that of a file which is touched now. */
static time_t time_there(const struct folder_share *share)
{
    char path[4096];
    struct stat about;
    file_of(share, path, "clock");
    int fd = open(path, O_WRONLY | O_CREAT | O_CLOEXEC, 0666);
    bool known = fd >= 0 && futimens(fd, NULL) == 0 && fstat(fd, &about) == 0;
    if (fd >= 0)
        close(fd);
    return known ? about.st_mtime : time(NULL);
}

/* Takes away a lease whose owner has died. False: there is one, of a member that lives. */
static bool end_lease(const struct folder_share *share, const char *path)
{
    struct stat about;
    if (stat(path, &about) != 0)
        return true;
    if (!owner_is_gone(share, path) && time_there(share) - about.st_mtime <= LEASE_LIFE)
        return false;
    unlink(path);
    return true;
}

/* Is it nobody's? */
static bool is_open(const struct folder_share *share, uint32_t part)
{
    char path[4096];
    part_path(share, path, part, ".lease");
    return end_lease(share, path) && !is_done(share, part);
}

/* Says from time to time that this program lives. */
static void *touch_leases(void *opaque)
{
    struct folder_share *share = opaque;
    pthread_mutex_lock(&share->lock);
    while (!share->stops) {
        double until = monotonic_seconds() + LEASE_TOUCH;
        while (!share->stops && monotonic_cond_wait(&share->stopped, &share->lock, until))
            ;
        char path[4096];
        file_of(share, path, "leader.lease");
        if (share->leads && !share->writes && !share->stops)
            utimensat(AT_FDCWD, path, NULL, 0);
        for (uint32_t part = 0; part < share->parts && !share->stops; part++) {
            part_path(share, path, part, ".lease");
            if (share->states[part] == PART_HERE)
                utimensat(AT_FDCWD, path, NULL, 0);
        }
    }
    pthread_mutex_unlock(&share->lock);
    return NULL;
}

/* ---- stages */

/* All members must leave this text in a file, or they have not been given the same work. */
static enum tetlod_status agree(const char *path, const char *text, struct tetlod_error *error)
{
    unsigned char *bytes;
    size_t size;
    if (!is_there(path))
        TETLOD_TRY(file_write(path, text, strlen(text), error));
    TETLOD_TRY(file_read(path, &bytes, &size, error));
    bool same = size == strlen(text) && memcmp(bytes, text, size) == 0;
    free(bytes);
    return same ? TETLOD_OK
                : tetlodi_fail(error, TETLOD_ERR_IO,
                               "%s: is of other work: another input, other options or another version of tetlod; "
                               "tetlod plan begins anew in an empty folder",
                               path);
}

static enum tetlod_status same(void *opaque, uint64_t hash, struct tetlod_error *error)
{
    char path[4096], text[32];
    file_of(opaque, path, "mesh");
    snprintf(text, sizeof text, "%016llx\n", (unsigned long long)hash);
    return agree(path, text, error);
}

/* A file of bytes, with their hash behind them. */
static enum tetlod_status write_hashed(const char *path, const void *bytes, size_t size, struct tetlod_error *error)
{
    struct file_output *output;
    const uint64_t hash = hash_bytes(size, bytes, size);
    TETLOD_TRY(file_output_open(&output, path, error));
    const struct tetlodi_sink sink = file_output_sink(output);
    enum tetlod_status status = sink.write(sink.opaque, bytes, size);
    if (status == TETLOD_OK)
        status = sink.write(sink.opaque, &hash, sizeof hash);
    return file_output_finish(output, status, error);
}

/* The caller frees the block. */
static enum tetlod_status read_hashed(const char *path, unsigned char **out, size_t *out_size,
                                      struct tetlod_error *error)
{
    uint64_t hash;
    TETLOD_TRY(file_read(path, out, out_size, error));
    bool good = *out_size >= sizeof hash;
    *out_size -= good ? sizeof hash : 0;
    if (good)
        memcpy(&hash, *out + *out_size, sizeof hash);
    if (good && hash == hash_bytes(*out_size, *out, *out_size))
        return TETLOD_OK;
    free(*out);
    *out = NULL;
    return tetlodi_fail(error, TETLOD_ERR_IO, "%s: is not as it was written; remove it, and it is made again", path);
}

/* What helpers need of the parts that are not done. */
static enum tetlod_status write_inputs(const struct folder_share *share, const struct work_input *input,
                                       struct tetlod_error *error)
{
    enum tetlod_status status = TETLOD_OK;
    for (uint32_t part = 0; part < share->parts && status == TETLOD_OK; part++) {
        char path[4096];
        struct buffer bytes = {0};
        part_path(share, path, part, ".in");
        if (is_done(share, part) || is_there(path))
            continue;
        status = input->pack(input->opaque, part, &bytes, error);
        if (status == TETLOD_OK)
            status = write_hashed(path, bytes.bytes, bytes.size, error);
        buffer_fini(&bytes);
    }
    return status;
}

/* The call is there when all is that it is about. */
static enum tetlod_status publish(struct folder_share *share, const struct work_input *input,
                                  struct tetlod_error *error)
{
    struct file_output *call = share->call;
    share->call = NULL;
    enum tetlod_status status = input && share->passes ? write_inputs(share, input, error) : TETLOD_OK;
    return call ? file_output_finish(call, status, error) : status;
}

/* Also when it has not been heard to the end. */
static enum tetlod_status end_hearing(struct folder_share *share, struct tetlod_error *error)
{
    char path[4096];
    path_of(share, path, "call");
    file_view_close(&share->heard);
    share->heard = (struct file_view){0};
    return share->cut_off ? tetlodi_fail(error, TETLOD_ERR_IO, "%s: is not as it was written", path) : TETLOD_OK;
}

static enum tetlod_status make_stage(const struct folder_share *share, uint32_t stage, struct tetlod_error *error)
{
    char path[4096];
    stage_path(share, stage, path, "");
    return mkdir(path, 0777) == 0 || errno == EEXIST ? TETLOD_OK : fail_at(error, path, "make the folder");
}

static enum tetlod_status begin(void *opaque, uint32_t parts, const uint32_t *order, const struct work_input *input,
                                struct tetlod_error *error)
{
    struct folder_share *share = opaque;
    uint8_t *states = array_zero(parts, 1);
    if (!states)
        return tetlodi_fail_nomem(error, "the parts", parts);
    pthread_mutex_lock(&share->lock);
    share->stage++;
    share->states = states;
    share->order = order;
    share->parts = parts;
    share->next = 0;
    pthread_mutex_unlock(&share->lock);
    TETLOD_TRY(make_stage(share, share->stage, error));
    char path[4096], text[32];
    path_of(share, path, "parts");
    snprintf(text, sizeof text, "%u\n", parts);
    TETLOD_TRY(agree(path, text, error));
    return share->leads ? publish(share, input, error) : end_hearing(share, error);
}

/* ---- parts */

/* A part that nobody has begun, which is then this member's. */
static bool take_next(struct folder_share *share, uint32_t *out_part)
{
    bool found = false;
    pthread_mutex_lock(&share->lock);
    while (share->next < share->parts && !found) {
        char path[4096];
        uint32_t part = share->order ? share->order[share->next] : share->next;
        share->next++;
        part_path(share, path, part, ".lease");
        if (share->states[part] != PART_OPEN)
            continue;
        if (is_done(share, part)) {
            share->states[part] = PART_DONE;
        } else if (take_lease(share, path)) {
            if (is_done(share, part)) { // meanwhile, and its lease had gone
                unlink(path);
                continue;
            }
            share->states[part] = PART_HERE;
            *out_part = part;
            found = true;
        }
    }
    pthread_mutex_unlock(&share->lock);
    return found;
}

static bool take_input(const struct folder_share *share, uint32_t part, struct buffer *out)
{
    char path[4096];
    part_path(share, path, part, ".in");
    if (read_hashed(path, &out->bytes, &out->size, NULL) != TETLOD_OK)
        return false;
    out->capacity = out->size;
    return true;
}

static bool take(void *opaque, uint32_t *out_part, struct buffer *out_input)
{
    struct folder_share *share = opaque;
    while (take_next(share, out_part)) {
        if (!out_input || take_input(share, *out_part, out_input))
            return true;
        pthread_mutex_lock(&share->lock); // the leader does what cannot be read here
        share->states[*out_part] = PART_OPEN;
        pthread_mutex_unlock(&share->lock);
        drop_lease(share, *out_part);
    }
    return false;
}

static enum tetlod_status put(void *opaque, uint32_t part, const void *bytes, size_t size, struct tetlod_error *error)
{
    struct folder_share *share = opaque;
    char path[4096];
    part_path(share, path, part, "");
    TETLOD_TRY(write_hashed(path, bytes, size, error));
    pthread_mutex_lock(&share->lock);
    share->states[part] = PART_DONE;
    pthread_mutex_unlock(&share->lock);
    drop_lease(share, part);
    part_path(share, path, part, ".in");
    unlink(path);
    return TETLOD_OK;
}

static void wait_a_while(double *io_wait)
{
    sleep_through(*io_wait);
    *io_wait = fmin(2 * *io_wait, LONGEST_WAIT);
}

/* Are all parts done? *out_open: one of them is nobody's. */
static bool look(struct folder_share *share, bool *out_open)
{
    bool all = true;
    *out_open = false;
    pthread_mutex_lock(&share->lock);
    for (uint32_t part = 0; part < share->parts; part++) {
        if (share->states[part] != PART_DONE && is_done(share, part))
            share->states[part] = PART_DONE;
        all &= share->states[part] == PART_DONE;
        *out_open |= share->states[part] == PART_OPEN && is_open(share, part);
    }
    share->next = 0;
    pthread_mutex_unlock(&share->lock);
    return all;
}

/* A helper has done what it could take: the leader sees to the rest. */
static enum tetlod_status settle(void *opaque, enum tetlod_status status, bool *out_again, struct tetlod_error *error)
{
    struct folder_share *share = opaque;
    (void)error; // says what `status` is
    *out_again = false;
    if (status != TETLOD_OK || !share->leads)
        return status;
    for (double wait = FIRST_WAIT; !look(share, out_again) && !*out_again;)
        wait_a_while(&wait);
    return TETLOD_OK;
}

/* All of it: the hash is that of all bytes. */
static enum tetlod_status get(void *opaque, uint32_t part, size_t enough, unsigned char **out, size_t *size,
                              struct tetlod_error *error)
{
    char path[4096];
    (void)enough;
    part_path(opaque, path, part, "");
    return read_hashed(path, out, size, error);
}

/* Parts stay for members that come later; what was begun here and is not done is nobody's. */
static void end(void *opaque)
{
    struct folder_share *share = opaque;
    pthread_mutex_lock(&share->lock);
    for (uint32_t part = 0; part < share->parts; part++)
        if (share->states[part] == PART_HERE)
            drop_lease(share, part);
    free(share->states);
    share->states = NULL;
    share->parts = 0;
    pthread_mutex_unlock(&share->lock);
}

/* ---- calls */

/* Helpers are called for the next stage. */
static enum tetlod_status begin_call(struct folder_share *share, struct tetlod_error *error)
{
    char path[4096];
    file_of(share, path, "helped");
    share->passes |= is_there(path);
    stage_path(share, share->stage + 1, path, "call");
    TETLOD_TRY(make_stage(share, share->stage + 1, error));
    if (share->passes && !is_there(path)) // else another leader has called
        return file_output_open(&share->call, path, error);
    return TETLOD_OK;
}

/* The call for the next stage that helpers are called for, which is then the next one; false: there is none yet. */
static bool find_call(struct folder_share *share, char path[4096])
{
    for (uint32_t stage = share->stage + 1;; stage++) {
        stage_path(share, stage, path, "call");
        if (is_there(path)) {
            share->stage = stage - 1;
            return true;
        }
        stage_path(share, stage, path, "");
        if (!is_there(path))
            return false;
    }
}

/* Waits until the leader calls, has ended or has died. False: there is nothing more to hear. */
static bool wait_for_call(struct folder_share *share, char path[4096])
{
    for (double wait = FIRST_WAIT;; wait_a_while(&wait)) {
        file_of(share, path, "leader.lease");
        bool led = is_there(path) && !end_lease(share, path);
        file_of(share, path, "over");
        if (is_there(path))
            return false;
        if (find_call(share, path))
            return true;
        if (!led) {
            share->orphaned = true;
            return false;
        }
    }
}

static void pass(void *opaque, void *bytes, size_t size)
{
    struct folder_share *share = opaque;
    if (share->call) {
        const struct tetlodi_sink sink = file_output_sink(share->call);
        enum tetlod_status written = sink.write(sink.opaque, bytes, size);
        (void)written; // publish() says what has failed
    }
    if (share->leads)
        return;
    size_t left = share->heard.size - share->heard_at, there = left < size ? left : size;
    if (bytes && there)
        memcpy(bytes, share->heard.bytes + share->heard_at, there);
    if (bytes && there < size)
        memset((unsigned char *)bytes + there, 0, size - there);
    share->cut_off |= there < size;
    share->heard_at += there;
    file_view_pass(&share->heard, share->heard.bytes + share->heard_at);
}

/* Is this helper one of the few that do the next stage? Those that come first are, beside the leader; who dies leaves
 * its parts to the leader. */
static bool is_of_few(const struct folder_share *share)
{
    for (uint32_t i = 1; i < WORK_FEW; i++) {
        char path[4096], name[16];
        snprintf(name, sizeof name, "few-%u", i);
        stage_path(share, share->stage + 1, path, name);
        if (take_lease(share, path))
            return true;
    }
    return false;
}

/* What the call is for comes first. */
static enum tetlod_status hear_call(struct folder_share *share, uint32_t *io_word, struct tetlod_error *error)
{
    char path[4096];
    *io_word = CALL_OVER;
    if (!wait_for_call(share, path))
        return TETLOD_OK;
    file_view_close(&share->heard); // of a stage that was left to others
    TETLOD_TRY(file_view_path(&share->heard, path, error));
    share->heard_at = 0;
    share->cut_off = false;
    pass(share, io_word, sizeof *io_word);
    return TETLOD_OK;
}

static enum tetlod_status call(const struct work_share *members, enum work_call *io_call,
                               const struct work_share **out, struct tetlod_error *error)
{
    struct folder_share *share = members->opaque;
    uint32_t word = (uint32_t)*io_call;
    if (share->leads) {
        TETLOD_TRY(begin_call(share, error));
        pass(share, &word, sizeof word);
    } else {
        TETLOD_TRY(hear_call(share, &word, error));
    }
    while (!share->leads && work_is_of_few((enum work_call)word) && !is_of_few(share)) {
        share->stage++; // others do it
        TETLOD_TRY(hear_call(share, &word, error));
    }
    *io_call = (enum work_call)word;
    *out = work_is_of_few(*io_call) ? &share->few : &share->all;
    return TETLOD_OK;
}

/* ---- the share */

/* Who comes first leads; the others say that they are there. */
static void find_role(struct folder_share *share)
{
    char path[4096];
    file_of(share, path, "leader.lease");
    share->leads = share->writes || (end_lease(share, path) && take_lease(share, path));
    file_of(share, path, "helped");
    int fd = share->leads ? -1 : open(path, O_WRONLY | O_CREAT | O_CLOEXEC, 0666);
    if (fd >= 0)
        close(fd);
}

enum tetlod_status folder_share_new(struct work_share *out, const char *folder, uint32_t members, bool writes,
                                    struct tetlod_error *error)
{
    struct folder_share *share = array_zero(1, sizeof *share);
    char machine[256] = "";
    *out = (struct work_share){0};
    if (!share)
        return tetlodi_fail_nomem(error, "the folder", sizeof *share);
    if (snprintf(share->folder, sizeof share->folder, "%s", folder) >= (int)sizeof share->folder) {
        free(share);
        return tetlodi_fail(error, TETLOD_ERR_IO, "%.100s...: the path is too long", folder);
    }
    gethostname(machine, sizeof machine - 1);
    snprintf(share->owner, sizeof share->owner, "%s %ld\n", machine, (long)getpid());
    share->writes = writes;
    share->passes = members > 1 && !writes;
    find_role(share);
    pthread_mutex_init(&share->lock, NULL);
    monotonic_cond_init(&share->stopped);
    share->touches = pthread_create(&share->toucher, NULL, touch_leases, share) == 0;
    share->all = (struct work_share){.members = members, .leads = share->leads, .writes = writes,
                                     .keeps_parts = true, .same = same, .begin = begin, .take = take, .put = put,
                                     .settle = settle, .get = get, .end = end, .call = writes ? NULL : call,
                                     .pass = pass, .opaque = share};
    share->few = share->all;
    share->few.members = members < WORK_FEW ? members : WORK_FEW;
    *out = share->all;
    return TETLOD_OK;
}

bool folder_share_is_over(const struct work_share *share)
{
    char path[4096];
    file_of(share->opaque, path, "over");
    return is_there(path);
}

bool folder_share_is_orphaned(const struct work_share *share)
{
    const struct folder_share *folder = share->opaque;
    return folder->orphaned;
}

enum tetlod_status folder_share_finish(const struct work_share *share, struct tetlod_error *error)
{
    char path[4096];
    const struct folder_share *folder = share->opaque;
    file_of(folder, path, "over");
    return folder->leads ? file_write(path, "", 0, error) : TETLOD_OK;
}

void folder_share_free(struct work_share *share)
{
    struct folder_share *folder = share->opaque;
    char path[4096];
    if (!folder)
        return;
    pthread_mutex_lock(&folder->lock);
    folder->stops = true;
    pthread_cond_signal(&folder->stopped);
    pthread_mutex_unlock(&folder->lock);
    if (folder->touches)
        pthread_join(folder->toucher, NULL);
    file_of(folder, path, "leader.lease");
    if (folder->leads && !folder->writes)
        unlink(path);
    file_output_abort(folder->call);
    file_view_close(&folder->heard);
    pthread_cond_destroy(&folder->stopped);
    pthread_mutex_destroy(&folder->lock);
    free(folder);
    *share = (struct work_share){0};
}
