/* SPDX-License-Identifier: BSD-3-Clause */
#include "server/store/open_files.h"

#include <errno.h>
#include <fcntl.h>
#include <pthread.h>
#include <stdatomic.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "src/util/array.h"
#include "src/util/clock.h"

struct open_file {
    struct open_files *files;
    char *path;
    struct file_identity identity;
    int fd; /* -1: closed */
    unsigned users;
    struct open_file *newer, *older; /* among those that are open and nobody uses */
};

enum { LOOKS = 1024 /* at once; further ones are not counted */ };

struct open_files {
    _Atomic double looks[LOOKS]; /* since when, or 0 */
    pthread_mutex_t lock;
    size_t most, open;
    struct open_file *newest, *oldest;
};

static bool take_identity(const struct stat *about, struct file_identity *out)
{
    *out = (struct file_identity){(uint64_t)about->st_dev, (uint64_t)about->st_ino, (uint64_t)about->st_size,
                                  (uint64_t)about->st_nlink, about->st_mtim, about->st_ctim};
    return S_ISREG(about->st_mode);
}

bool identity_of(int fd, struct file_identity *out)
{
    struct stat about;
    return fstat(fd, &about) == 0 && take_identity(&about, out);
}

bool identity_at(int folder, const char *path, struct file_identity *out)
{
    struct stat about;
    return fstatat(folder, path, &about, 0) == 0 && take_identity(&about, out);
}

static bool same_time(const struct timespec *a, const struct timespec *b)
{
    return a->tv_sec == b->tv_sec && a->tv_nsec == b->tv_nsec;
}

bool identity_settled(int fd, struct file_identity *out)
{
    enum { TICK = 20 * 1000 * 1000, TRIES = 3 };
    for (int i = 0; i < TRIES && identity_of(fd, out); i++) {
        struct timespec now;
        clock_gettime(CLOCK_REALTIME, &now);
        long long age = (long long)(now.tv_sec - out->changed.tv_sec) * 1000000000 + (now.tv_nsec -
                                                                                      out->changed.tv_nsec);
        if (age < 0 || age >= TICK)
            return true;
        nanosleep(&(struct timespec){0, TICK}, NULL);
    }
    *out = (struct file_identity){0};
    return false;
}

static bool same_content(const struct file_identity *a, const struct file_identity *b)
{
    return a->device == b->device && a->inode == b->inode && a->size == b->size && same_time(&a->written, &b->written);
}

bool identity_same(const struct file_identity *a, const struct file_identity *b)
{
    return same_content(a, b) && same_time(&a->changed, &b->changed);
}

bool identity_same_but_names(const struct file_identity *a, const struct file_identity *b)
{
    return same_content(a, b) && (same_time(&a->changed, &b->changed) || a->links != b->links);
}

struct open_files *open_files_new(size_t most)
{
    struct open_files *files = array_zero(1, sizeof *files);
    if (!files)
        return NULL;
    pthread_mutex_init(&files->lock, NULL);
    files->most = most;
    return files;
}

void open_files_free(struct open_files *files)
{
    if (files)
        pthread_mutex_destroy(&files->lock);
    free(files);
}

size_t open_files_count(struct open_files *files)
{
    pthread_mutex_lock(&files->lock);
    size_t count = files->open;
    pthread_mutex_unlock(&files->lock);
    return count;
}

static void list_push(struct open_files *files, struct open_file *file)
{
    file->older = files->newest;
    file->newer = NULL;
    *(files->newest ? &files->newest->newer : &files->oldest) = file;
    files->newest = file;
}

static void list_remove(struct open_files *files, struct open_file *file)
{
    *(file->newer ? &file->newer->older : &files->newest) = file->older;
    *(file->older ? &file->older->newer : &files->oldest) = file->newer;
}

/* Closes what is too much. Called with the lock; to close a file that was only read takes no time. */
static void close_oldest(struct open_files *files)
{
    while (files->open > files->most && files->oldest) {
        struct open_file *file = files->oldest;
        list_remove(files, file);
        close(file->fd);
        file->fd = -1;
        files->open--;
    }
}

struct open_file *open_file_new(struct open_files *files, const char *path, int fd,
                                const struct file_identity *identity)
{
    struct open_file *file = array_zero(1, sizeof *file);
    char *copy = strdup(path);
    if (!file || !copy) {
        free(file);
        free(copy);
        close(fd);
        return NULL;
    }
    *file = (struct open_file){.files = files, .path = copy, .identity = *identity, .fd = fd};
    pthread_mutex_lock(&files->lock);
    files->open++;
    list_push(files, file);
    close_oldest(files);
    pthread_mutex_unlock(&files->lock);
    return file;
}

void open_file_free(struct open_file *file)
{
    if (!file)
        return;
    pthread_mutex_lock(&file->files->lock);
    if (file->fd >= 0) {
        list_remove(file->files, file);
        close(file->fd);
        file->files->open--;
    }
    pthread_mutex_unlock(&file->files->lock);
    free(file->path);
    free(file);
}

/* The same file again; nothing is locked meanwhile, because it may take its time. */
static int open_again(const struct open_file *file)
{
    struct file_identity now;
    int fd = open(file->path, O_RDONLY | O_CLOEXEC | O_NONBLOCK | O_NOCTTY);
    if (fd >= 0 && !(identity_of(fd, &now) && identity_same_but_names(&now, &file->identity))) {
        close(fd);
        errno = ESTALE;
        fd = -1;
    }
    return fd;
}

/* The descriptor if it is open; called with the lock. */
static int use_open(struct open_file *file)
{
    if (file->fd >= 0 && !file->users++)
        list_remove(file->files, file);
    return file->fd;
}

int open_file_use(struct open_file *file)
{
    struct open_files *files = file->files;
    pthread_mutex_lock(&files->lock);
    int fd = use_open(file);
    pthread_mutex_unlock(&files->lock);
    if (fd >= 0)
        return fd;
    int opened = open_again(file);
    if (opened < 0)
        return -1;
    pthread_mutex_lock(&files->lock);
    fd = use_open(file);
    if (fd < 0) { // nobody else opened it meanwhile
        fd = file->fd = opened;
        file->users = 1;
        files->open++;
        close_oldest(files);
    } else
        close(opened);
    pthread_mutex_unlock(&files->lock);
    return fd;
}

void open_file_let_go(struct open_file *file)
{
    struct open_files *files = file->files;
    pthread_mutex_lock(&files->lock);
    if (!--file->users) {
        list_push(files, file);
        close_oldest(files);
    }
    pthread_mutex_unlock(&files->lock);
}

size_t open_files_begin_look(struct open_files *files)
{
    double now = monotonic_seconds();
    for (size_t i = 0; i < LOOKS; i++) {
        double none = 0;
        if (atomic_load(&files->looks[i]) == 0 && atomic_compare_exchange_strong(&files->looks[i], &none, now))
            return i;
    }
    return LOOKS;
}

void open_files_end_look(struct open_files *files, size_t look)
{
    if (look < LOOKS)
        atomic_store(&files->looks[look], 0);
}

size_t open_files_hanging(struct open_files *files, double seconds)
{
    double now = monotonic_seconds();
    size_t count = 0;
    for (size_t i = 0; i < LOOKS; i++) {
        double since = atomic_load(&files->looks[i]);
        count += since > 0 && now - since > seconds;
    }
    return count;
}
