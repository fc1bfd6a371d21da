/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * FOLDER/stage-3/parts     how many parts the third stage has
 * FOLDER/stage-3/17        part 17: its bytes
 * FOLDER/stage-3/17.lease  someone is at it: "machine process"; its time is when that was last known to live
 *
 * Times are compared as the folder's file system knows them, so that clocks of machines may differ.
 */
#include "src/many/folder_share.h"

#include <errno.h>
#include <fcntl.h>
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

/* Seconds after which a lease that is not touched is nobody's; and between touches. */
enum { LEASE_LIFE = 60, LEASE_TOUCH = 10 };

/* Seconds between looks at what others do. */
static const double FIRST_WAIT = 0.01, LONGEST_WAIT = 0.5;

enum part_state { PART_OPEN, PART_HERE, PART_DONE };

struct folder_share {
    char folder[4096 - 64], owner[320]; /* owner: "machine process" */
    pthread_mutex_t lock;               /* of the states and the next place */
    pthread_cond_t stopped;
    pthread_t toucher;
    bool touches, stops;
    uint32_t stage, parts, next;        /* next place to look at */
    const uint32_t *order;
    uint8_t *states;                    /* [part] enum part_state */
};

static void path_of(const struct folder_share *share, char out[4096], const char *name)
{
    snprintf(out, 4096, "%s/stage-%u/%s", share->folder, share->stage, name);
}

static void part_path(const struct folder_share *share, char out[4096], uint32_t part, const char *suffix)
{
    char name[32];
    snprintf(name, sizeof name, "%u%s", part, suffix);
    path_of(share, out, name);
}

static enum tetlod_status fail_at(struct tetlod_error *error, const char *path, const char *what)
{
    return tetlodi_fail(error, TETLOD_ERR_IO, "%s: cannot %s: %s", path, what, strerror(errno));
}

static bool is_done(const struct folder_share *share, uint32_t part)
{
    char path[4096];
    part_path(share, path, part, "");
    return access(path, F_OK) == 0;
}

/* ---- leases */

/* Leaves a lease. False: there is one. */
static bool take_lease(const struct folder_share *share, uint32_t part)
{
    char path[4096];
    part_path(share, path, part, ".lease");
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
    path_of(share, path, "parts");
    return utimensat(AT_FDCWD, path, NULL, 0) == 0 && stat(path, &about) == 0 ? about.st_mtime : time(NULL);
}

/* Takes away a lease whose owner has died. True: the part is open. */
static bool lease_is_over(const struct folder_share *share, uint32_t part)
{
    char path[4096];
    struct stat about;
    part_path(share, path, part, ".lease");
    if (stat(path, &about) != 0)
        return !is_done(share, part);
    if (!owner_is_gone(share, path) && time_there(share) - about.st_mtime <= LEASE_LIFE)
        return false;
    unlink(path);
    return true;
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
        for (uint32_t part = 0; part < share->parts && !share->stops; part++) {
            char path[4096];
            part_path(share, path, part, ".lease");
            if (share->states[part] == PART_HERE)
                utimensat(AT_FDCWD, path, NULL, 0);
        }
    }
    pthread_mutex_unlock(&share->lock);
    return NULL;
}

/* ---- stages */

/* All members must see the same number of parts, or they have not been given the same work. */
static enum tetlod_status agree(const struct folder_share *share, struct tetlod_error *error)
{
    char path[4096], text[32];
    unsigned char *bytes;
    size_t size;
    path_of(share, path, "parts");
    snprintf(text, sizeof text, "%u\n", share->parts);
    if (access(path, F_OK) != 0)
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

static enum tetlod_status begin(void *opaque, uint32_t parts, const uint32_t *order, const struct work_input *input,
                                struct tetlod_error *error)
{
    (void)input; // all members have the mesh
    struct folder_share *share = opaque;
    char path[4096];
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
    path_of(share, path, "");
    if (mkdir(path, 0777) != 0 && errno != EEXIST)
        return fail_at(error, path, "make the folder");
    return agree(share, error);
}

static bool take(void *opaque, uint32_t *out_part, struct buffer *out_input)
{
    (void)out_input;
    struct folder_share *share = opaque;
    bool found = false;
    pthread_mutex_lock(&share->lock);
    while (share->next < share->parts && !found) {
        uint32_t part = share->order ? share->order[share->next] : share->next;
        share->next++;
        if (share->states[part] != PART_OPEN)
            continue;
        if (is_done(share, part)) {
            share->states[part] = PART_DONE;
        } else if (take_lease(share, part)) {
            if (is_done(share, part)) { // meanwhile, and its lease had gone
                drop_lease(share, part);
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

static enum tetlod_status put(void *opaque, uint32_t part, const void *bytes, size_t size, struct tetlod_error *error)
{
    struct folder_share *share = opaque;
    char path[4096];
    part_path(share, path, part, "");
    TETLOD_TRY(file_write(path, bytes, size, error));
    pthread_mutex_lock(&share->lock);
    share->states[part] = PART_DONE;
    pthread_mutex_unlock(&share->lock);
    drop_lease(share, part);
    return TETLOD_OK;
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
        *out_open |= share->states[part] == PART_OPEN && lease_is_over(share, part);
    }
    share->next = 0;
    pthread_mutex_unlock(&share->lock);
    return all;
}

static enum tetlod_status settle(void *opaque, enum tetlod_status status, bool *out_again, struct tetlod_error *error)
{
    struct folder_share *share = opaque;
    (void)error; // says what `status` is
    *out_again = false;
    if (status != TETLOD_OK)
        return status;
    for (double wait = FIRST_WAIT; !look(share, out_again) && !*out_again;) {
        nanosleep(&(struct timespec){.tv_nsec = (long)(wait * 1e9)}, NULL);
        wait = 2 * wait < LONGEST_WAIT ? 2 * wait : LONGEST_WAIT;
    }
    return TETLOD_OK;
}

static enum tetlod_status get(void *opaque, uint32_t part, unsigned char **out, size_t *size,
                              struct tetlod_error *error)
{
    char path[4096];
    part_path(opaque, path, part, "");
    return file_read(path, out, size, error);
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

enum tetlod_status folder_share_new(struct work_share *out, const char *folder, uint32_t members,
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
    pthread_mutex_init(&share->lock, NULL);
    monotonic_cond_init(&share->stopped);
    share->touches = pthread_create(&share->toucher, NULL, touch_leases, share) == 0;
    *out = (struct work_share){members, false, begin, take, put, settle, get, end, NULL, NULL, NULL, share};
    return TETLOD_OK;
}

void folder_share_free(struct work_share *share)
{
    struct folder_share *folder = share->opaque;
    if (!folder)
        return;
    pthread_mutex_lock(&folder->lock);
    folder->stops = true;
    pthread_cond_signal(&folder->stopped);
    pthread_mutex_unlock(&folder->lock);
    if (folder->touches)
        pthread_join(folder->toucher, NULL);
    pthread_cond_destroy(&folder->stopped);
    pthread_mutex_destroy(&folder->lock);
    free(folder);
    *share = (struct work_share){0};
}
