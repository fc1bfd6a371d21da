/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/cli/spare_files.h"

#include <pthread.h>
#include <unistd.h>

enum { MOST = 32 };

struct spare_file {
    int file;
    size_t size;
};

static struct {
    pthread_mutex_t lock; /* of what follows; no file is closed under it */
    struct spare_file files[MOST]; /* [count] the oldest first */
    unsigned count;
    uint64_t bytes;
    bool left;
} spare = {.lock = PTHREAD_MUTEX_INITIALIZER};

/* The lock is held. */
static struct spare_file take_out(unsigned number)
{
    const struct spare_file taken = spare.files[number];
    spare.count--;
    spare.bytes -= taken.size;
    for (unsigned i = number; i < spare.count; i++)
        spare.files[i] = spare.files[i + 1];
    return taken;
}

/* Closes the oldest until there is a place, and no more than so many bytes are left. */
static void close_oldest(unsigned places, uint64_t bytes)
{
    for (bool full = true; full;) {
        struct spare_file oldest = {.file = -1};
        pthread_mutex_lock(&spare.lock);
        full = spare.count && (spare.count > places || spare.bytes > bytes);
        if (full)
            oldest = take_out(0);
        pthread_mutex_unlock(&spare.lock);
        if (full)
            close(oldest.file);
    }
}

void spare_files_put(int file, size_t size, uint64_t room)
{
    bool kept = false;
    if (size <= room) {
        close_oldest(MOST - 1, room - size);
        pthread_mutex_lock(&spare.lock);
        kept = !spare.left && spare.count < MOST;
        if (kept) {
            spare.files[spare.count++] = (struct spare_file){file, size};
            spare.bytes += size;
        }
        pthread_mutex_unlock(&spare.lock);
    }
    if (!kept)
        close(file);
}

int spare_files_take(size_t size, size_t *out_size)
{
    struct spare_file taken = {.file = -1};
    unsigned best = 0;
    pthread_mutex_lock(&spare.lock);
    for (unsigned i = 1; i < spare.count; i++) {
        size_t own = spare.files[i].size, other = spare.files[best].size;
        if (own >= size ? other < size || own <= other : own >= other)
            best = i;
    }
    if (spare.count)
        taken = take_out(best);
    pthread_mutex_unlock(&spare.lock);
    *out_size = taken.size;
    return taken.file;
}

void spare_files_trim(uint64_t room)
{
    close_oldest(MOST, room);
}

bool spare_files_close(void)
{
    bool any = false;
    size_t size;
    for (int file = spare_files_take(0, &size); file >= 0; file = spare_files_take(0, &size)) {
        close(file);
        any = true;
    }
    return any;
}

void spare_files_leave(void)
{
    pthread_mutex_init(&spare.lock, NULL); // another thread may have had it
    spare.left = true;
    spare_files_close();
}
