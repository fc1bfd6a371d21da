/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * A large array is a *region*: whole pages of its own, so that its address tells it from what the C library made. A
 * table lists them. Its lock also keeps the watching thread from taking pages of what another thread is about to free.
 * Each region in a file has a file for itself, with blocks for all of it: a folder that is full is found here, not
 * where the array is written; and what is freed is gone.
 */
#define _GNU_SOURCE // mremap
#include "src/cli/scratch_memory.h"

#include <errno.h>
#include <fcntl.h>
#include <pthread.h>
#include <signal.h>
#include <stdatomic.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <time.h>
#include <unistd.h>

#include "format/fail.h"
#include "src/util/spool.h"

/* Arrays from this share of the limit on are regions, and from MIN_REGION bytes on. Regions are memory as long as they
 * take no more than MEMORY_SHARE of the limit. The table is short: it lists large arrays only. */
enum { REGION_SHARE = 128, MIN_REGION = 1 << 16, MAX_REGIONS = 400 };
static const double MEMORY_SHARE = 0.25;

/* Shares of the limit: pages are taken from the first on, until the second is reached. Between two looks, of so many
 * nanoseconds, threads bring pages in. */
static const double HIGH = 0.7, LOW = 0.5;
enum { LOOK_AGAIN = 1000000 };

struct region {
    char *at;
    size_t size; /* in bytes, whole pages */
    int file;    /* -1: memory */
};

/* malloc has no context: the program's only state that is not passed on. */
static struct {
    atomic_bool on, stays;
    size_t page, smallest;
    uint64_t limit, in_memory, in_files, peak;
    int statm; /* file of the system that says what is resident */
    pthread_mutex_t lock;
    struct region regions[MAX_REGIONS];
    unsigned count, hand; /* hand: the region whose pages are taken next */
    int failed;           /* errno of the last file that there could not be */
    size_t wanted;        /* bytes of it */
} memory = {.lock = PTHREAD_MUTEX_INITIALIZER};

void *__real_malloc(size_t size);
void *__real_calloc(size_t count, size_t size);
void *__real_realloc(void *block, size_t size);
void *__real_aligned_alloc(size_t alignment, size_t size);
void __real_free(void *block);
void *__wrap_malloc(size_t size);
void *__wrap_calloc(size_t count, size_t size);
void *__wrap_realloc(void *block, size_t size);
void *__wrap_aligned_alloc(size_t alignment, size_t size);
void __wrap_free(void *block);

/* ---- what is resident */

static uint64_t resident(void)
{
    char text[128] = "";
    ssize_t got = pread(memory.statm, text, sizeof text - 1, 0);
    char *space = got > 0 ? strchr(text, ' ') : NULL;
    return space ? strtoull(space + 1, NULL, 10) * memory.page : 0;
}

/* Takes pages of files, region by region, until little is resident. What is written there stays in the file. */
static void take_pages(void)
{
    pthread_mutex_lock(&memory.lock);
    for (unsigned i = 0; i < memory.count && (double)resident() > LOW * (double)memory.limit; i++) {
        const struct region *region = &memory.regions[memory.hand++ % memory.count];
        if (region->file >= 0)
            madvise(region->at, region->size, MADV_DONTNEED);
    }
    pthread_mutex_unlock(&memory.lock);
}

static void *watch(void *argument)
{
    const struct timespec pause = {.tv_nsec = LOOK_AGAIN};
    (void)argument;
    for (;;) {
        if ((double)resident() > HIGH * (double)memory.limit)
            take_pages();
        nanosleep(&pause, NULL);
    }
    return NULL;
}

/* Signals are for the other threads. */
static int start_watching(void)
{
    sigset_t all, before;
    pthread_t thread;
    sigfillset(&all);
    pthread_sigmask(SIG_SETMASK, &all, &before);
    int failed = pthread_create(&thread, NULL, watch, NULL);
    pthread_sigmask(SIG_SETMASK, &before, NULL);
    if (!failed)
        pthread_detach(thread);
    return failed;
}

enum tetlod_status scratch_memory_begin(uint64_t limit, struct tetlod_error *error)
{
    struct spool probe;
    TETLOD_TRY(spool_open(&probe, error));
    spool_close(&probe);
    memory.page = (size_t)sysconf(_SC_PAGESIZE);
    memory.limit = limit;
    memory.smallest = limit / REGION_SHARE > MIN_REGION ? (size_t)(limit / REGION_SHARE) : MIN_REGION;
    memory.statm = open("/proc/self/statm", O_RDONLY | O_CLOEXEC);
    if (memory.statm < 0 || start_watching() != 0)
        return tetlodi_fail(error, TETLOD_ERR_NOMEM, "the memory in use cannot be watched");
    atomic_store(&memory.on, true);
    return TETLOD_OK;
}

void scratch_memory_stay(void)
{
    atomic_store(&memory.stays, true);
}

enum tetlod_status scratch_memory_failure(struct tetlod_error *error)
{
    if (!memory.failed)
        return TETLOD_OK;
    return tetlodi_fail(error, TETLOD_ERR_IO,
                        "the scratch folder %.100s has no room for %zu MB more: %s; --scratch names another folder",
                        spool_folder(), (memory.wanted >> 20) + 1, strerror(memory.failed));
}

uint64_t scratch_memory_peak(void)
{
    return memory.peak;
}

/* ---- regions; the lock is held */

static size_t whole_pages(size_t size)
{
    return (size + memory.page - 1) / memory.page * memory.page;
}

static void count_bytes(const struct region *region, int64_t more)
{
    uint64_t *sum = region->file < 0 ? &memory.in_memory : &memory.in_files;
    *sum += (uint64_t)more;
    memory.peak = memory.in_files > memory.peak ? memory.in_files : memory.peak;
}

static bool stays_in_memory(size_t size)
{
    return atomic_load(&memory.stays) || (double)memory.in_memory + (double)size <= MEMORY_SHARE * (double)memory.limit;
}

/* Blocks for that much of a file. */
static bool reserve_blocks(int file, size_t size)
{
    int failed = posix_fallocate(file, 0, (off_t)size);
    if (failed) {
        memory.failed = failed;
        memory.wanted = size;
    }
    return !failed;
}

static int new_file(size_t size)
{
    int file = spool_file();
    if (file < 0) {
        memory.failed = errno;
        memory.wanted = size;
    } else if (!reserve_blocks(file, size)) {
        close(file);
        file = -1;
    }
    return file;
}

static void *new_region(size_t size)
{
    struct region region = {.size = whole_pages(size), .file = -1};
    if (region.size < size || memory.count == MAX_REGIONS)
        return NULL;
    if (!stays_in_memory(region.size) && (region.file = new_file(region.size)) < 0)
        return NULL;
    void *at = mmap(NULL, region.size, PROT_READ | PROT_WRITE,
                    region.file < 0 ? MAP_PRIVATE | MAP_ANONYMOUS : MAP_SHARED, region.file, 0);
    if (at == MAP_FAILED) {
        if (region.file >= 0)
            close(region.file);
        return NULL;
    }
    region.at = at;
    count_bytes(&region, (int64_t)region.size);
    memory.regions[memory.count++] = region;
    return at;
}

/* The region at an address, or NULL. */
static struct region *find_region(const void *block)
{
    for (unsigned i = 0; i < memory.count; i++)
        if (memory.regions[i].at == block)
            return &memory.regions[i];
    return NULL;
}

static void free_region(struct region *region)
{
    munmap(region->at, region->size);
    if (region->file >= 0)
        close(region->file);
    count_bytes(region, -(int64_t)region->size);
    *region = memory.regions[--memory.count];
}

/* A region of memory that becomes too large to stay there; NULL: it is as before. */
static void *move_to_file(struct region *region, size_t size)
{
    struct region old = *region;
    void *at = new_region(size);
    if (!at)
        return NULL;
    memcpy(at, old.at, old.size);
    free_region(find_region(old.at));
    return at;
}

/* A region of another size, at another place perhaps; NULL: it is as before. */
static void *resize_region(struct region *region, size_t size)
{
    size_t whole = whole_pages(size ? size : 1);
    if (whole < size || (whole > region->size && region->file >= 0 && !reserve_blocks(region->file, whole)))
        return NULL;
    if (region->file < 0 && whole > region->size && !stays_in_memory(whole - region->size))
        return move_to_file(region, whole);
    void *at = mremap(region->at, region->size, whole, MREMAP_MAYMOVE);
    if (at == MAP_FAILED)
        return NULL;
    if (whole < region->size && region->file >= 0 && ftruncate(region->file, (off_t)whole) != 0)
        memory.failed = errno;
    count_bytes(region, (int64_t)whole - (int64_t)region->size);
    region->at = at;
    region->size = whole;
    return at;
}

/* ---- what the program calls */

static bool is_large(size_t size)
{
    return atomic_load_explicit(&memory.on, memory_order_relaxed) && size >= memory.smallest;
}

/* Regions begin with a page; hardly anything else does. */
static bool may_be_region(const void *block)
{
    return block && atomic_load_explicit(&memory.on, memory_order_relaxed) && (uintptr_t)block % memory.page == 0;
}

static void *make_region(size_t size)
{
    pthread_mutex_lock(&memory.lock);
    void *at = new_region(size);
    pthread_mutex_unlock(&memory.lock);
    if (!at)
        errno = ENOMEM;
    return at;
}

void *__wrap_malloc(size_t size)
{
    return is_large(size) ? make_region(size) : __real_malloc(size);
}

void *__wrap_calloc(size_t count, size_t size)
{
    size_t bytes;
    if (__builtin_mul_overflow(count, size, &bytes))
        return NULL;
    return is_large(bytes) ? make_region(bytes) : __real_calloc(count, size);
}

void *__wrap_aligned_alloc(size_t alignment, size_t size)
{
    return is_large(size) && alignment <= memory.page ? make_region(size) : __real_aligned_alloc(alignment, size);
}

void __wrap_free(void *block)
{
    struct region *region = NULL;
    if (may_be_region(block)) {
        pthread_mutex_lock(&memory.lock);
        region = find_region(block);
        if (region)
            free_region(region);
        pthread_mutex_unlock(&memory.lock);
    }
    if (!region)
        __real_free(block);
}

/* An array of the C library's that becomes a region. How large it was, is not known to be less than the new one. */
static void *move_to_region(void *block, size_t size)
{
    void *grown = __real_realloc(block, size);
    if (!grown || !is_large(size))
        return grown;
    void *at = make_region(size);
    if (!at)
        return grown;
    memcpy(at, grown, size);
    __real_free(grown);
    return at;
}

void *__wrap_realloc(void *block, size_t size)
{
    struct region *region = NULL;
    void *at = NULL;
    if (may_be_region(block)) {
        pthread_mutex_lock(&memory.lock);
        region = find_region(block);
        at = region ? resize_region(region, size) : NULL;
        pthread_mutex_unlock(&memory.lock);
    }
    if (region)
        return at;
    return block ? move_to_region(block, size) : __wrap_malloc(size);
}
