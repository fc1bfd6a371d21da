/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * A large array is a *region*: whole pages of its own, so that its address tells it from what the C library made. A
 * table lists them. What is being made, resized or freed is not in it: no pages are taken of that.
 * Pages are taken by a timer's signal, on the thread that brings them in: each thread has a timer of its own. On a busy
 * machine a thread that watched the others would come too late, and so would a signal to the process, which one thread
 * gets for all; timers of processor time look at the system's ticks alone, and in a tick a thread brings in 50 MB. What
 * a thread brings in stays below what it can touch in LOOK_AGAIN while it runs: its signal waits for it while it does
 * not. A handler takes the table's lock, so it never interrupts a thread that has it, and no call that waits for a disk
 * is made under it.
 * Each region in a file has a file for itself, with blocks for all of it: a folder that is full is found here, not
 * where the array is written. The files of what is freed serve what comes, or are gone where blocks are short.
 */
#define _GNU_SOURCE // mremap
#include "src/cli/scratch_memory.h"

#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <linux/userfaultfd.h>
#include <malloc.h>
#include <math.h>
#include <pthread.h>
#include <sched.h>
#include <signal.h>
#include <stdatomic.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>
#include <sys/ioctl.h>
#include <sys/mman.h>
#include <sys/syscall.h>
#include <time.h>
#include <unistd.h>

#include "format/fail.h"
#include "src/cli/spare_files.h"
#include "src/util/spool.h"

/* Arrays from this share of the limit on are regions, and from MIN_REGION bytes on. Regions are memory as long as they
 * take no more than MEMORY_SHARE of the limit or, where little else takes memory, ROOMY_SHARE of what it leaves beside
 * the program. The table is short: it lists large arrays only. */
enum { REGION_SHARE = 128, MIN_REGION = 1 << 16, MAX_REGIONS = 400, PROGRAM = 28 << 20 };

/* The C library keeps so much of the limit when it is free: a cell takes what the one before has left, where the system
 * would have to make each page anew. */
enum { KEPT_SHARE = 8 };
static const double MEMORY_SHARE = 0.25, ROOMY_SHARE = 0.6;

/* Pages are taken from a share of the limit on, piece by piece, until the share GIVEN_BACK is free again. What is left
 * up to the limit is for what threads bring in between two looks, of so many nanoseconds: BETWEEN bytes each, and more
 * than a share of a small limit cannot be spared for that; OF_MANY: where a touch brings in more than one page. Less
 * than WINDOW bytes of files are never taken: where a limit is too small for the rest, the program would only read the
 * same pages again and again. */
static const double MIN_LEFT = 0.05, MIN_LEFT_OF_MANY = 0.2, MAX_LEFT = 0.3, GIVEN_BACK = 0.1;
enum { LOOK_AGAIN = 250000, BETWEEN = 4 << 20, WINDOW = 4 << 20 };

/* A region has so many pieces at most, of MIN_PIECE bytes at least. One of which nothing was resident is passed over
 * EMPTY_TURNS times. */
enum { PIECES = 128, MIN_PIECE = 1 << 19, EMPTY_TURNS = 7 };

/* Where nearly all of a piece was resident it is gone through in order: then the system may bring in the pages around a
 * page that is read, AROUND_TURNS times, until that is looked at again. */
static const double IN_ORDER = 0.9;
enum { AROUND_TURNS = 3 };

/* Where more is free than all threads bring in meanwhile, the next look is later: so many times as late at most. */
enum { LATEST = 16 };

struct region {
    char *at;
    size_t size; /* in bytes, whole pages */
    int file;    /* -1: memory */
    uint8_t turns[PIECES];  /* [piece] it is passed over */
    uint8_t around[PIECES]; /* [piece] those around a page come too, until it was taken so many times */
};

/* malloc has no context: the program's only state that is not passed on. */
static struct {
    atomic_bool on, stays;
    atomic_uint watched; /* threads */
    size_t page;
    atomic_size_t smallest;
    atomic_ullong limit;
    uint64_t libraries, in_memory, in_files, peak, given_back;
    bool roomy; /* little but regions takes memory */
    int statm; /* file of the system that says what is resident */
    int single; /* userfaultfd that keeps faults to single pages, or -1 */
    atomic_flag lock;
    struct region regions[MAX_REGIONS];
    unsigned count, hand; /* hand: the region whose pages are taken next */
    size_t taken;         /* bytes of it */
    unsigned made;        /* regions that there are, also those not in the table */
    int failed;           /* errno of the last file that there could not be */
    size_t wanted;        /* bytes of it */
} memory = {.lock = ATOMIC_FLAG_INIT};

void *__real_malloc(size_t size);
void *__real_calloc(size_t count, size_t size);
void *__real_realloc(void *block, size_t size);
void *__real_aligned_alloc(size_t alignment, size_t size);
void __real_free(void *block);
int __real_pthread_create(pthread_t *out, const pthread_attr_t *attributes, void *(*run)(void *), void *argument);
void *__wrap_malloc(size_t size);
void *__wrap_calloc(size_t count, size_t size);
void *__wrap_realloc(void *block, size_t size);
void *__wrap_aligned_alloc(size_t alignment, size_t size);
void __wrap_free(void *block);
int __wrap_pthread_create(pthread_t *out, const pthread_attr_t *attributes, void *(*run)(void *), void *argument);

/* ---- the lock */

/* Does this thread have the lock, or is it about to? Its signal's handler looks. */
static _Thread_local volatile sig_atomic_t has_lock;

static void lock(void)
{
    has_lock = 1;
    while (atomic_flag_test_and_set_explicit(&memory.lock, memory_order_acquire))
        sched_yield();
}

static void unlock(void)
{
    atomic_flag_clear_explicit(&memory.lock, memory_order_release);
    has_lock = 0;
}

/* ---- what is resident */

/* All that is resident, and what of it is of files. */
struct resident {
    uint64_t all, files;
};

static struct resident look(void)
{
    char text[128] = "";
    uint64_t pages[3] = {0}; // of all addresses, resident, of files
    ssize_t got = pread(memory.statm, text, sizeof text - 1, 0);
    const char *at = got > 0 ? text : "";
    for (int i = 0; i < 3 && *at; i++, at += *at == ' ')
        for (; *at >= '0' && *at <= '9'; at++)
            pages[i] = 10 * pages[i] + (uint64_t)(*at - '0');
    return (struct resident){pages[1] * memory.page, pages[2] * memory.page};
}

/* What may be resident now. */
static uint64_t allowed(void)
{
    double limit = (double)memory.limit, between = BETWEEN * (double)atomic_load(&memory.watched);
    double least = memory.single >= 0 ? MIN_LEFT : MIN_LEFT_OF_MANY;
    return (uint64_t)(limit - fmin(fmax(between, least * limit), MAX_LEFT * limit));
}

static bool is_above(struct resident now, uint64_t limit)
{
    return now.all > limit && now.files > memory.libraries + WINDOW;
}

/* Where a page is read the system brings in the fifteen around it as well, which would soon be all that is resident. It
 * does not where writing could be watched (asynchronously, so nothing waits). Systems before Linux 6.7, or some
 * containers, do not know that: there more is read. */
static int open_single(void)
{
    enum { ASYNCHRONOUS = 1 << 15, USER_MODE = 1 };
    struct uffdio_api api = {.api = UFFD_API, .features = ASYNCHRONOUS};
    int file = (int)syscall(SYS_userfaultfd, USER_MODE | O_CLOEXEC);
    if (file >= 0 && ioctl(file, UFFDIO_API, &api) != 0) {
        close(file);
        file = -1;
    }
    return file;
}

/* From now on a touch brings in one page there, or those around it, too. Where it cannot be said more is read. */
static void set_single(char *at, size_t size, bool single)
{
    struct uffdio_register pages = {{(uintptr_t)at, size}, UFFDIO_REGISTER_MODE_WP, 0};
    if (memory.single >= 0 && single)
        ioctl(memory.single, UFFDIO_REGISTER, &pages);
    else if (memory.single >= 0)
        ioctl(memory.single, UFFDIO_UNREGISTER, &pages.range);
}

/* Of a region that is new or another one. Nothing is read ahead of what is written for the first time: the system would
 * keep what it reads together, and look at all of it again for each page that is touched. */
static void bring_single(struct region *region)
{
    memset(region->turns, 0, sizeof region->turns);
    memset(region->around, 0, sizeof region->around);
    if (region->file < 0)
        return;
    madvise(region->at, region->size, MADV_NOHUGEPAGE); // of files, too: a touch would bring in 2 MB
    madvise(region->at, region->size, MADV_RANDOM);
    set_single(region->at, region->size, true);
}

static size_t whole_pages(size_t size)
{
    return (size + memory.page - 1) / memory.page * memory.page;
}

/* A piece at the hand. */
struct piece {
    struct region *region;
    unsigned number;
    char *at;
    size_t size; /* 0: nothing of it is to be taken */
};

/* The next piece. */
static struct piece next_piece(void)
{
    struct region *region = &memory.regions[memory.hand % memory.count];
    size_t size = whole_pages(region->size / PIECES > MIN_PIECE ? region->size / PIECES : MIN_PIECE);
    memory.taken -= memory.taken % size; // another region may have been there
    size_t left = region->size > memory.taken ? region->size - memory.taken : 0;
    struct piece piece = {.region = region,
                          .number = (unsigned)(memory.taken / size),
                          .at = region->at + memory.taken,
                          .size = left < size ? left : size};
    memory.taken += piece.size;
    if (piece.size == left || region->file < 0) {
        memory.hand++;
        memory.taken = 0;
    }
    piece.size = region->file < 0 ? 0 : piece.size;
    if (piece.size && region->turns[piece.number]) {
        region->turns[piece.number]--;
        piece.size = 0;
    }
    return piece;
}

/* Do the pages around come with one of the piece? */
static void choose_around(const struct piece *piece, bool in_order)
{
    uint8_t *around = &piece->region->around[piece->number], before = *around;
    *around = before ? before - 1 : in_order ? AROUND_TURNS : 0;
    if (!*around != !before)
        set_single(piece->at, piece->size, !*around);
}

/* Takes pieces until what is resident is no more than that. What is written there stays in the file, and what may come
 * back from a disk is read ahead. */
static void take_pieces(uint64_t low)
{
    unsigned last = memory.hand + (EMPTY_TURNS + 1) * memory.count;
    for (struct resident now = look(), then; memory.hand < last && is_above(now, low);) {
        const struct piece piece = next_piece();
        if (!piece.size)
            continue;
        madvise(piece.at, piece.size, MADV_DONTNEED);
        then = look();
        uint64_t given = now.files > then.files ? now.files - then.files : 0;
        piece.region->turns[piece.number] = given ? 0 : EMPTY_TURNS;
        memory.given_back += given;
        if (given) {
            madvise(piece.at, piece.size, MADV_NORMAL);
            choose_around(&piece, (double)given >= IN_ORDER * (double)piece.size);
        }
        now = then;
    }
}

/* This thread's timer, and how many times LOOK_AGAIN it waits. */
static _Thread_local timer_t own_timer;
static _Thread_local unsigned own_wait;

static bool set_wait(unsigned times)
{
    const long wait = (long)times * LOOK_AGAIN;
    own_wait = times;
    return timer_settime(own_timer, 0, &(struct itimerspec){{.tv_nsec = wait}, {.tv_nsec = wait}}, NULL) == 0;
}

/* A signal and a look take some microseconds of each thread: programs that wait for others would do little else. */
static void wait_by(struct resident now)
{
    uint64_t most = allowed(), between = BETWEEN * (uint64_t)atomic_load(&memory.watched);
    uint64_t left = now.all < most ? most - now.all : 0;
    unsigned times = 1;
    while (times < LATEST && 2 * times * between <= left)
        times *= 2;
    if (times != own_wait)
        set_wait(times);
}

/* Takes pages of files until little is resident. A signal's handler: where its thread has the lock, the next one takes
 * them. While another thread takes them, this one waits: it would bring in more. */
static void take_pages(int signal)
{
    const int before = errno;
    const struct resident now = look();
    (void)signal;
    if (!has_lock && is_above(now, allowed())) {
        lock();
        take_pieces(allowed() - (uint64_t)(GIVEN_BACK * (double)memory.limit));
        unlock();
    }
    wait_by(now);
    errno = before;
}

/* A timer whose signal this thread gets. */
static bool watch_thread(timer_t *out)
{
    struct sigevent event = {.sigev_notify = SIGEV_THREAD_ID, .sigev_signo = SIGPROF};
    event._sigev_un._tid = gettid(); // glibc has no other name for it
    if (timer_create(CLOCK_MONOTONIC, &event, out) != 0)
        return false;
    own_timer = *out;
    if (!set_wait(1)) {
        timer_delete(*out);
        return false;
    }
    atomic_fetch_add(&memory.watched, 1);
    return true;
}

static bool start_watching(void)
{
    timer_t timer; // until the program ends
    struct sigaction action = {.sa_handler = take_pages, .sa_flags = SA_RESTART};
    sigemptyset(&action.sa_mask);
    return sigaction(SIGPROF, &action, NULL) == 0 && watch_thread(&timer);
}

struct thread_start {
    void *(*run)(void *argument);
    void *argument;
};

/* A thread that there can be no timer for runs without: the others' take its pages. */
static void *run_watched(void *argument)
{
    struct thread_start start = *(struct thread_start *)argument;
    timer_t timer;
    __real_free(argument);
    bool watched = watch_thread(&timer);
    void *result = start.run(start.argument);
    if (watched) {
        timer_delete(timer);
        atomic_fetch_sub(&memory.watched, 1);
    }
    return result;
}

int __wrap_pthread_create(pthread_t *out, const pthread_attr_t *attributes, void *(*run)(void *), void *argument)
{
    struct thread_start *start = atomic_load(&memory.on) ? __real_malloc(sizeof *start) : NULL;
    if (!start)
        return __real_pthread_create(out, attributes, run, argument);
    *start = (struct thread_start){run, argument};
    int failed = __real_pthread_create(out, attributes, run_watched, start);
    if (failed)
        __real_free(start);
    return failed;
}

static void set_limit(uint64_t limit)
{
    atomic_store(&memory.limit, limit);
    atomic_store(&memory.smallest, limit / REGION_SHARE > MIN_REGION ? (size_t)(limit / REGION_SHARE) : MIN_REGION);
}

/* Of this process: a child's are its own. */
static bool watch_process(uint64_t limit)
{
    memory.statm = open("/proc/self/statm", O_RDONLY | O_CLOEXEC);
    memory.single = open_single();
    set_limit(limit);
    return memory.statm >= 0 && start_watching();
}

/* A child has no timers, and its files are its parent's. It reads for its parent (src/io/services/contain.h), which
 * holds what the child has sent: it gets half of the limit. */
static void begin_in_child(void)
{
    unlock();
    spare_files_leave();
    atomic_store(&memory.watched, 0);
    close(memory.statm);
    if (memory.single >= 0)
        close(memory.single);
    watch_process(memory.limit / 2); // if not, it takes more than that
}

enum tetlod_status scratch_memory_begin(uint64_t limit, struct tetlod_error *error)
{
    struct spool probe;
    TETLOD_TRY(spool_open(&probe, error));
    spool_close(&probe);
    memory.page = (size_t)sysconf(_SC_PAGESIZE);
    bool watched = watch_process(limit);
    memory.libraries = look().files;
    if (!watched || pthread_atfork(lock, unlock, begin_in_child) != 0)
        return tetlodi_fail(error, TETLOD_ERR_NOMEM, "the memory in use cannot be looked at");
    atomic_store(&memory.on, true);
    return TETLOD_OK;
}

enum tetlod_status scratch_memory_take(const char *folder, uint64_t limit, struct tetlod_error *error)
{
    if (folder && setenv("TMPDIR", folder, 1) != 0)
        return tetlodi_fail_nomem(error, "the environment", strlen(folder));
    return limit ? scratch_memory_begin(limit, error) : TETLOD_OK;
}

void scratch_memory_allow(uint64_t limit)
{
    lock();
    if (atomic_load(&memory.on) && limit > atomic_load(&memory.limit))
        set_limit(limit);
    unlock();
}

void scratch_memory_stay(void)
{
    atomic_store(&memory.stays, true);
    spare_files_close();
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

uint64_t scratch_memory_given_back(void)
{
    return memory.given_back;
}

/* ---- regions */

/* The lock is held. */
static void count_bytes(const struct region *region, int64_t more)
{
    uint64_t *sum = region->file < 0 ? &memory.in_memory : &memory.in_files;
    *sum += (uint64_t)more;
    memory.peak = memory.in_files > memory.peak ? memory.in_files : memory.peak;
}

/* The lock is held. */
static bool stays_in_memory(size_t size)
{
    const double limit = (double)memory.limit, roomy = memory.roomy ? ROOMY_SHARE * (limit - PROGRAM) : 0;
    return atomic_load(&memory.stays) ||
           (double)memory.in_memory + (double)size <= fmax(roomy, MEMORY_SHARE * limit);
}

/* Takes the region at an address out of the table: its thread changes it or frees it. False: there is none. */
static bool take_out(const void *block, struct region *out)
{
    bool found = false;
    lock();
    for (unsigned i = 0; i < memory.count && !found; i++)
        if (memory.regions[i].at == block) {
            found = true;
            *out = memory.regions[i];
            memory.regions[i] = memory.regions[--memory.count];
        }
    unlock();
    return found;
}

static void put_in(const struct region *region)
{
    lock();
    memory.regions[memory.count++] = *region;
    unlock();
}

/* That much more, or less, is a region's. */
static void settle(const struct region *region, int64_t more)
{
    lock();
    count_bytes(region, more);
    unlock();
}

static void note_failure(int failed, size_t size)
{
    lock();
    memory.failed = failed;
    memory.wanted = size;
    unlock();
}

/* Blocks for that much of a file: a signal would make it begin anew. 0 or an errno. */
static int allocate_blocks(int file, size_t size)
{
    sigset_t timer, before;
    sigemptyset(&timer);
    sigaddset(&timer, SIGPROF);
    pthread_sigmask(SIG_BLOCK, &timer, &before);
    int failed = posix_fallocate(file, 0, (off_t)size);
    pthread_sigmask(SIG_SETMASK, &before, NULL);
    return failed;
}

/* Bytes that spare files may have: with what is in use no more than the most that was. */
static uint64_t spare_room(void)
{
    lock();
    uint64_t room = memory.peak - memory.in_files;
    unlock();
    return room;
}

/* Blocks for that much of a file, of spare ones if need be. */
static bool reserve_blocks(int file, size_t size)
{
    int failed = allocate_blocks(file, size);
    if (failed && spare_files_close())
        failed = allocate_blocks(file, size);
    if (failed)
        note_failure(failed, size);
    return !failed;
}

/* A file of that size; of zeros, if they are asked for. */
static int new_file(size_t size, bool zeros)
{
    size_t spare_size = 0;
    int spare = zeros ? -1 : spare_files_take(size, &spare_size), file = spare >= 0 ? spare : spool_file();
    if (spare >= 0 && spare_size >= size && ftruncate(spare, (off_t)size) == 0)
        return spare;
    spare_files_trim(spare_room());
    if (file < 0 && spare_files_close())
        file = spool_file();
    if (file < 0) {
        note_failure(errno, size);
    } else if (!reserve_blocks(file, size)) {
        close(file);
        file = -1;
    }
    return file;
}

/* A place in the table, and a share of the memory if there is one. */
static bool reserve_region(size_t size, bool *out_in_memory)
{
    lock();
    bool room = memory.made < MAX_REGIONS;
    *out_in_memory = stays_in_memory(size);
    if (room) {
        memory.made++;
        count_bytes(&(struct region){.file = *out_in_memory ? -1 : 0}, (int64_t)size);
    }
    unlock();
    return room;
}

/* The region is no more. */
static void forget_region(const struct region *region)
{
    lock();
    count_bytes(region, -(int64_t)region->size);
    memory.made--;
    unlock();
}

static void *new_region(size_t size, bool zeros)
{
    struct region region = {.size = whole_pages(size), .file = -1};
    bool in_memory;
    if (region.size < size || !reserve_region(region.size, &in_memory))
        return NULL;
    bool done = in_memory || (region.file = new_file(region.size, zeros)) >= 0;
    void *at = done ? mmap(NULL, region.size, PROT_READ | PROT_WRITE,
                           in_memory ? MAP_PRIVATE | MAP_ANONYMOUS : MAP_SHARED, region.file, 0)
                    : MAP_FAILED;
    if (at == MAP_FAILED) {
        if (region.file >= 0)
            close(region.file);
        forget_region(&(struct region){.size = region.size, .file = in_memory ? -1 : 0});
        return NULL;
    }
    region.at = at;
    bring_single(&region);
    put_in(&region);
    return at;
}

/* Of a region that is taken out. */
static void free_region(const struct region *region)
{
    munmap(region->at, region->size);
    forget_region(region);
    if (region->file >= 0)
        spare_files_put(region->file, region->size, spare_room());
}

/* A file with the bytes of a region of memory, mapped in its place. */
static bool to_file(struct region *region)
{
    int file = new_file(region->size, false);
    bool done = file >= 0;
    for (size_t at = 0; at < region->size && done;) {
        ssize_t written = pwrite(file, region->at + at, region->size - at, (off_t)at);
        at += written > 0 ? (size_t)written : 0;
        done = written > 0 || errno == EINTR;
    }
    const int flags = MAP_SHARED | MAP_FIXED;
    if (done && mmap(region->at, region->size, PROT_READ | PROT_WRITE, flags, file, 0) == region->at)
        region->file = file;
    else if (file >= 0)
        close(file);
    return region->file >= 0;
}

/* Takes a region of memory out of the table. False: there is none. */
static bool take_memory(struct region *out)
{
    bool found = false;
    lock();
    for (unsigned i = 0; i < memory.count && !found; i++)
        if (memory.regions[i].file < 0) {
            found = true;
            *out = memory.regions[i];
            memory.regions[i] = memory.regions[--memory.count];
        }
    unlock();
    return found;
}

/* Only where pages can be taken: else what is kept free might be what the limit lacks. */
static void keep_free(void)
{
#ifdef __GLIBC__
    mallopt(M_MMAP_THRESHOLD, (int)fmin((double)atomic_load(&memory.smallest), INT_MAX));
    mallopt(M_TRIM_THRESHOLD, (int)fmin((double)atomic_load(&memory.limit) / KEPT_SHARE, INT_MAX));
    malloc_trim(0); // what follows is of other sizes
#endif
}

void scratch_memory_settle(bool roomy)
{
    struct region region;
    bool done = atomic_load(&memory.on) && !atomic_load(&memory.stays);
    lock();
    memory.roomy = roomy;
    unlock();
    if (done)
        keep_free();
    while (done && take_memory(&region)) {
        settle(&region, -(int64_t)region.size);
        done = to_file(&region);
        settle(&region, (int64_t)region.size);
        bring_single(&region);
        put_in(&region);
    }
}

/* Is a region of memory to become too large to stay there? */
static bool outgrows_memory(const struct region *region, size_t whole)
{
    lock();
    bool outgrows = region->file < 0 && whole > region->size && !stays_in_memory(whole - region->size);
    unlock();
    return outgrows;
}

/* The region's bytes at another place, perhaps, with room for so many. Pieces of a file that were taken are mapped in
 * another way than the rest, which mremap() does not take. */
static void *move_region(const struct region *region, size_t whole)
{
    if (region->file < 0)
        return mremap(region->at, region->size, whole, MREMAP_MAYMOVE);
    void *at = mmap(NULL, whole, PROT_READ | PROT_WRITE, MAP_SHARED, region->file, 0);
    if (at != MAP_FAILED)
        munmap(region->at, region->size);
    return at;
}

/* A region that is taken out becomes one of another size, at another place perhaps, and is put in again. NULL: it is as
 * before. */
static void *resize_region(struct region *region, size_t size)
{
    const struct region old = *region;
    size_t whole = whole_pages(size ? size : 1);
    if (outgrows_memory(region, whole)) {
        void *at = new_region(whole, false);
        if (at) {
            memcpy(at, old.at, old.size);
            free_region(&old);
        } else {
            put_in(&old);
        }
        return at;
    }
    bool done = whole >= size && (whole <= old.size || old.file < 0 || reserve_blocks(old.file, whole));
    void *at = done ? move_region(&old, whole) : MAP_FAILED;
    if (at != MAP_FAILED) {
        if (whole < old.size && old.file >= 0 && ftruncate(old.file, (off_t)whole) != 0)
            note_failure(errno, whole);
        settle(&old, (int64_t)whole - (int64_t)old.size);
        region->at = at;
        region->size = whole;
        bring_single(region);
        spare_files_trim(spare_room());
    }
    put_in(region);
    return at == MAP_FAILED ? NULL : at;
}

/* ---- what the program calls */

static bool is_large(size_t size)
{
    return atomic_load_explicit(&memory.on, memory_order_relaxed) && size >= atomic_load(&memory.smallest);
}

/* Regions begin with a page; hardly anything else does. */
static bool may_be_region(const void *block)
{
    return block && atomic_load_explicit(&memory.on, memory_order_relaxed) && (uintptr_t)block % memory.page == 0;
}

static void *make_region(size_t size, bool zeros)
{
    void *at = new_region(size, zeros);
    if (!at)
        errno = ENOMEM;
    return at;
}

void *__wrap_malloc(size_t size)
{
    return is_large(size) ? make_region(size, false) : __real_malloc(size);
}

void *__wrap_calloc(size_t count, size_t size)
{
    size_t bytes;
    if (__builtin_mul_overflow(count, size, &bytes))
        return NULL;
    return is_large(bytes) ? make_region(bytes, true) : __real_calloc(count, size);
}

void *__wrap_aligned_alloc(size_t alignment, size_t size)
{
    return is_large(size) && alignment <= memory.page ? make_region(size, false)
                                                      : __real_aligned_alloc(alignment, size);
}

void __wrap_free(void *block)
{
    struct region region;
    if (may_be_region(block) && take_out(block, &region))
        free_region(&region);
    else
        __real_free(block);
}

/* An array of the C library's that becomes a region. How large it was, is not known to be less than the new one. */
static void *move_to_region(void *block, size_t size)
{
    void *grown = __real_realloc(block, size);
    if (!grown || !is_large(size))
        return grown;
    void *at = make_region(size, false);
    if (!at)
        return grown;
    memcpy(at, grown, size);
    __real_free(grown);
    return at;
}

void *__wrap_realloc(void *block, size_t size)
{
    struct region region;
    if (may_be_region(block) && take_out(block, &region))
        return resize_region(&region, size);
    return block ? move_to_region(block, size) : __wrap_malloc(size);
}
