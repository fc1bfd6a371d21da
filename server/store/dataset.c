/* SPDX-License-Identifier: BSD-3-Clause */
#include "server/store/dataset.h"

#include <errno.h>
#include <inttypes.h>
#include <math.h>
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "format/fail.h"
#include "format/read/parts.h"
#include "src/report/promise.h"
#include "src/util/array.h"
#include "src/util/clock.h"
#include "src/util/parallel.h"

enum { MAX_READINGS = 3 /* of bytes while somebody writes */ };

#define UNCHECKED 0
#define MAX_HANG 5.0 /* seconds after which nobody else begins to read a file that does not answer */


struct dataset {
    struct stored *stored;
    struct tetlod_file *file;
    uint64_t offset; /* of its stream in the file */
    uint32_t topology, steps_before;
    struct tetlod_series *series; /* NULL: one moment */
    struct level_texts *level_texts; /* [level_count], printed once: every answer has them */
    struct tetlodi_frame *parts; /* [part_count] of the stream, which they cover */
    atomic_uint_fast64_t *checked; /* [part_count]: the file's version that the part was good in, or UNCHECKED */
    size_t part_count;
};

/* A stream's file, which its topology groups share. */
struct stored {
    atomic_uint references;
    char id[ID_CAPACITY];
    struct open_files *files;
    struct open_file *opened;
    struct file_identity identity; /* that it was opened with */
    pthread_mutex_t lock;          /* over the next two */
    struct file_identity seen;     /* at the last look */
    uint64_t version;              /* from 1; another one whenever somebody may have written */
    _Atomic double reading; /* since when the oldest of those who read it does; 0: nobody */
    atomic_bool all_checked, damaged; /* all parts were good once; a part was not */
    struct dataset *datasets; /* [count]: the whole stream, then its further topology groups */
    uint32_t count;
};

static void print_errors(const struct tetlod_info *info, uint32_t level, char *out, size_t capacity)
{
    size_t used = 0;
    out[0] = 0;
    for (int m = 0; m < TETLOD_MEASURES; m++) {
        double worst = -1;
        for (uint32_t f = 0; f < info->field_count; f++) {
            double error = info->levels[level].errors[f * TETLOD_MEASURES + (uint32_t)m];
            if (info->fields[f].controlled && (isnan(worst) || isnan(error) || error > worst))
                worst = isnan(worst) ? worst : error;
        }
        if (worst >= 0 && used < capacity)
            used += (size_t)snprintf(out + used, capacity - used, "%s%s=%.9g", used ? ", " : "",
                                     tetlod_measure_name((enum tetlod_measure)m), worst);
    }
}

static void print_uncontrolled(const struct tetlod_info *info, uint32_t level, char *out, size_t capacity)
{
    struct uncontrolled others = uncontrolled_at(info, level);
    out[0] = 0;
    if (others.count)
        snprintf(out, capacity, "fields=%" PRIu32 ", sampled=%.9g", others.count, others.sampled);
}

static enum tetlod_status print_levels(struct dataset *dataset, struct tetlod_error *error)
{
    const struct tetlod_info *info = tetlod_info(dataset->file);
    dataset->level_texts = array_new(info->level_count, sizeof *dataset->level_texts);
    if (!dataset->level_texts)
        return tetlodi_fail_nomem(error, "a stream's levels", info->level_count * sizeof *dataset->level_texts);
    for (uint32_t k = 0; k < info->level_count; k++) {
        struct level_texts *texts = &dataset->level_texts[k];
        snprintf(texts->level, sizeof texts->level, "%" PRIu32, k);
        snprintf(texts->vertices, sizeof texts->vertices, "%" PRIu64, info->levels[k].vertices);
        snprintf(texts->tets, sizeof texts->tets, "%" PRIu64, info->levels[k].tets);
        print_errors(info, k, texts->errors, sizeof texts->errors);
        print_uncontrolled(info, k, texts->uncontrolled, sizeof texts->uncontrolled);
    }
    return TETLOD_OK;
}

static bool hangs(const struct stored *stored)
{
    double since = atomic_load(&stored->reading);
    return since > 0 && monotonic_seconds() - since > MAX_HANG;
}

uint64_t dataset_file_number(const struct dataset *dataset)
{
    const struct file_identity *identity = &dataset->stored->identity;
    return identity->inode ^ identity->device * UINT64_C(0x9e3779b97f4a7c15);
}

bool dataset_hangs(const struct dataset *dataset)
{
    return hangs(dataset->stored);
}

/* A look at the file is between these two: it may hang, and its reader with it. */
struct look {
    double begun;
    size_t number;
};

static struct look begin_look(struct stored *stored)
{
    double now = monotonic_seconds(), nobody = 0;
    atomic_compare_exchange_strong(&stored->reading, &nobody, now);
    return (struct look){now, open_files_begin_look(stored->files)};
}

static void end_look(struct stored *stored, struct look look)
{
    open_files_end_look(stored->files, look.number);
    atomic_compare_exchange_strong(&stored->reading, &look.begun, 0); // unless somebody else came first
}

static enum tetlod_status fail_open(struct tetlod_error *error)
{
    return tetlodi_fail(error, errno == ESTALE || errno == ENOENT ? TETLOD_ERR_MISMATCH : TETLOD_ERR_IO, "%s",
                        strerror(errno));
}

static enum tetlod_status use_file(struct stored *stored, int *fd, struct tetlod_error *error)
{
    if (hangs(stored))
        return tetlodi_fail(error, TETLOD_ERR_IO, "it does not answer");
    struct look look = begin_look(stored);
    *fd = open_file_use(stored->opened);
    end_look(stored, look);
    return *fd < 0 ? fail_open(error) : TETLOD_OK;
}

static enum tetlod_status read_bytes(struct stored *stored, int fd, uint64_t offset, unsigned char *out, size_t size,
                                     struct tetlod_error *error)
{
    while (size) {
        struct look look = begin_look(stored);
        ssize_t got = pread(fd, out, size, (off_t)offset);
        end_look(stored, look);
        if (got <= 0)
            return got ? tetlodi_fail(error, TETLOD_ERR_IO, "%s", strerror(errno))
                       : tetlodi_fail(error, TETLOD_ERR_TRUNCATED, "it was cut off");
        out += got;
        offset += (uint64_t)got;
        size -= (size_t)got;
    }
    return TETLOD_OK;
}

/* The library's source. It holds what it reads against digests. */
static enum tetlod_status read_source(void *opaque, uint64_t offset, void *buffer, size_t size)
{
    struct stored *stored = opaque;
    int fd;
    TETLOD_TRY(use_file(stored, &fd, NULL));
    enum tetlod_status status = read_bytes(stored, fd, offset, buffer, size, NULL);
    open_file_let_go(stored->opened);
    return status;
}

/* The version of the file's bytes now, or UNCHECKED if they change as one looks. */
static uint64_t version_now(struct stored *stored, int fd)
{
    struct file_identity now;
    struct look look = begin_look(stored);
    bool settled = identity_settled(fd, &now);
    end_look(stored, look);
    if (!settled)
        return UNCHECKED;
    pthread_mutex_lock(&stored->lock);
    if (!identity_same(&now, &stored->seen)) {
        stored->seen = now;
        stored->version++;
    }
    uint64_t version = stored->version;
    pthread_mutex_unlock(&stored->lock);
    return version;
}

/* Whether nobody has written since `version`. Whoever writes into a file changes its time first: bytes that were read
 * before this look are those of that version. */
static bool is_still(struct stored *stored, int fd, uint64_t version)
{
    struct file_identity now;
    struct look look = begin_look(stored);
    bool same = identity_of(fd, &now);
    end_look(stored, look);
    pthread_mutex_lock(&stored->lock);
    same = same && stored->version == version && identity_same(&now, &stored->seen);
    pthread_mutex_unlock(&stored->lock);
    return same;
}

static enum tetlod_status fail_changing(struct tetlod_error *error)
{
    return tetlodi_fail(error, TETLOD_ERR_TRUNCATED, "it is being written");
}

/* Notes that a part is not what it should be: the next scan looks again. */
static enum tetlod_status note_damage(struct stored *stored, enum tetlod_status status)
{
    if (status == TETLOD_ERR_CHECKSUM || status == TETLOD_ERR_TRUNCATED)
        atomic_store(&stored->damaged, true);
    return status;
}

/* The part that has a byte. */
static size_t part_at(const struct dataset *dataset, uint64_t offset)
{
    size_t low = 0, high = dataset->part_count;
    while (high - low > 1) {
        size_t middle = low + (high - low) / 2;
        *(dataset->parts[middle].offset <= offset ? &low : &high) = middle;
    }
    return low;
}

/* Holds the parts from `first` on that begin before `end` against their digests, but for those that were good in this
 * version. */
static enum tetlod_status check_parts(struct dataset *dataset, size_t first, uint64_t end, uint64_t version, int fd,
                                      const atomic_bool *stop,
                                      struct tetlod_error *error)
{
    struct stored *stored = dataset->stored;
    for (size_t i = first; i < dataset->part_count && dataset->parts[i].offset < end; i++) {
        if (atomic_load(&dataset->checked[i]) == version)
            continue;
        if (stop && atomic_load(stop))
            return tetlodi_fail(error, TETLOD_ERR_LIMIT, "the server is stopping");
        TETLOD_TRY(note_damage(stored, tetlodi_check_part(dataset->file, &dataset->parts[i], error)));
        if (!is_still(stored, fd, version))
            return fail_changing(error);
        atomic_store(&dataset->checked[i], version);
    }
    return TETLOD_OK;
}

/* Reads bytes of the version that the file is in now. */
static enum tetlod_status read_version(struct dataset *dataset, int fd, uint64_t offset, void *out, size_t size,
                                       uint64_t *version,
                                       struct tetlod_error *error)
{
    struct stored *stored = dataset->stored;
    *version = version_now(stored, fd);
    if (*version == UNCHECKED)
        return fail_changing(error);
    TETLOD_TRY(check_parts(dataset, part_at(dataset, offset), offset + size, *version, fd, NULL, error));
    TETLOD_TRY(read_bytes(stored, fd, dataset->offset + offset, out, size, error));
    return is_still(stored, fd, *version) ? TETLOD_OK : fail_changing(error);
}

enum tetlod_status dataset_read(struct dataset *dataset, uint64_t offset, void *out, size_t size,
                                struct tetlod_error *error)
{
    struct stored *stored = dataset->stored;
    int fd;
    TETLOD_TRY(use_file(stored, &fd, error));
    enum tetlod_status status;
    uint64_t version;
    int left = MAX_READINGS;
    do
        status = read_version(dataset, fd, offset, out, size, &version, error);
    // what it saw may have been half of a change
    while (status != TETLOD_OK && --left && !is_still(stored, fd, version));
    open_file_let_go(stored->opened);
    return status;
}

/* Opens the whole stream, and makes a dataset for it and one for each further topology group. */
static enum tetlod_status open_whole(struct stored *stored, struct tetlod_error *error)
{
    const struct tetlod_source source = {read_source, stored, stored->identity.size};
    const struct tetlod_options options = {.struct_size = sizeof options, .threads = parallel_cores()};
    struct tetlod_file *file;
    TETLOD_TRY(tetlod_open(&file, &source, &options, error));
    const struct tetlod_info *info = tetlod_info(file);
    uint32_t count = info->topology_count ? info->topology_count : 1;
    stored->datasets = array_zero(count, sizeof *stored->datasets);
    if (!stored->datasets) {
        tetlod_close(file);
        return tetlodi_fail_nomem(error, "a stream", count * (uint64_t)sizeof *stored->datasets);
    }
    stored->count = count;
    stored->datasets[0].file = file;
    stored->datasets[0].offset = info->stream_offset;
    const uint64_t here = stored->identity.size - info->stream_offset;
    if (info->bytes <= here)
        return TETLOD_OK;
    return tetlodi_fail(error, TETLOD_ERR_TRUNCATED, "the stream ends too early: %llu of %llu bytes",
                        (unsigned long long)here,
                        (unsigned long long)info->bytes);
}

static enum tetlod_status open_topology(struct stored *stored, uint32_t topology, struct tetlod_error *error)
{
    struct dataset *dataset = &stored->datasets[topology];
    dataset->stored = stored;
    dataset->topology = topology;
    if (topology) {
        const struct tetlod_topology *topologies = tetlod_info(stored->datasets[0].file)->topologies;
        dataset->offset = stored->datasets[0].offset + topologies[topology].offset;
        dataset->steps_before = dataset[-1].steps_before + topologies[topology - 1].step_count;
        TETLOD_TRY(tetlod_open_topology(&dataset->file, stored->datasets[0].file, topology, error));
    }
    if (tetlod_section_index(tetlod_info(dataset->file), "TIME") != TETLOD_NONE)
        TETLOD_TRY(tetlod_series_new(&dataset->series, dataset->file, error));
    TETLOD_TRY(tetlodi_parts(dataset->file, dataset->series, &dataset->parts, &dataset->part_count, error));
    dataset->checked = array_zero(dataset->part_count, sizeof *dataset->checked);
    if (!dataset->checked)
        return tetlodi_fail_nomem(error, "a stream's parts", dataset->part_count * sizeof *dataset->checked);
    return print_levels(dataset, error);
}

static void close_stored(struct stored *stored)
{
    for (uint32_t t = stored->count; t-- > 0;) {
        tetlod_series_free(stored->datasets[t].series);
        tetlod_close(stored->datasets[t].file);
        free(stored->datasets[t].level_texts);
        free(stored->datasets[t].parts);
        free(stored->datasets[t].checked);
    }
    open_file_free(stored->opened);
    pthread_mutex_destroy(&stored->lock);
    free(stored->datasets);
    free(stored);
}

enum tetlod_status dataset_open(struct dataset **out, const char *id, struct open_files *files, const char *path,
                                int fd,
                                const struct file_identity *identity, struct tetlod_error *error)
{
    struct stored *stored = array_zero(1, sizeof *stored);
    *out = NULL;
    if (!stored) {
        close(fd);
        return tetlodi_fail_nomem(error, "a stream", sizeof *stored);
    }
    stored->identity = stored->seen = *identity;
    stored->version = UNCHECKED + 1;
    stored->files = files;
    pthread_mutex_init(&stored->lock, NULL);
    atomic_init(&stored->references, 1);
    snprintf(stored->id, sizeof stored->id, "%s", id);
    stored->opened = open_file_new(files, path, fd, &stored->identity);
    enum tetlod_status status =
        stored->opened ? open_whole(stored, error) : tetlodi_fail_nomem(error, "a stream", sizeof *stored);
    for (uint32_t t = 0; status == TETLOD_OK && t < stored->count; t++)
        status = open_topology(stored, t, error);
    if (status == TETLOD_OK)
        *out = stored->datasets;
    else
        close_stored(stored);
    return status;
}

struct dataset *dataset_hold(struct dataset *dataset)
{
    atomic_fetch_add(&dataset->stored->references, 1);
    return dataset;
}

void dataset_release(struct dataset *dataset)
{
    if (dataset && atomic_fetch_sub(&dataset->stored->references, 1) == 1)
        close_stored(dataset->stored);
}

struct dataset *dataset_topology(struct dataset *whole, uint32_t topology)
{
    return &whole->stored->datasets[topology];
}

struct dataset *dataset_with_content(struct dataset *whole, const char *cid, size_t size)
{
    for (uint32_t t = 0; t < whole->stored->count; t++) {
        const char *own = tetlod_info(whole->stored->datasets[t].file)->cid;
        if (strlen(own) == size && memcmp(own, cid, size) == 0)
            return &whole->stored->datasets[t];
    }
    return NULL;
}

uint32_t dataset_topology_number(const struct dataset *dataset)
{
    return dataset->topology;
}

uint32_t dataset_steps_before(const struct dataset *dataset)
{
    return dataset->steps_before;
}

const char *dataset_id(const struct dataset *dataset)
{
    return dataset->stored->id;
}

const struct tetlod_info *dataset_info(const struct dataset *dataset)
{
    return tetlod_info(dataset->file);
}

const struct level_texts *dataset_level_texts(const struct dataset *dataset, uint32_t level)
{
    return &dataset->level_texts[level];
}

struct tetlod_file *dataset_file(struct dataset *dataset)
{
    return dataset->file;
}

const struct tetlod_series *dataset_series(const struct dataset *dataset)
{
    return dataset->series;
}

enum tetlod_status dataset_check(struct dataset *dataset, const atomic_bool *stop, struct tetlod_error *error)
{
    struct dataset *whole = dataset->stored->datasets;
    struct stored *stored = dataset->stored;
    int fd;
    TETLOD_TRY(use_file(stored, &fd, error));
    uint64_t version = version_now(stored, fd);
    atomic_store(&stored->damaged, false);
    enum tetlod_status status = version == UNCHECKED ? fail_changing(error) : check_parts(whole, 0, UINT64_MAX,
                                                                                          version, fd, stop, error);
    open_file_let_go(stored->opened);
    if (status == TETLOD_OK)
        atomic_store(&stored->all_checked, true);
    return status;
}

bool dataset_checked(const struct dataset *dataset)
{
    return atomic_load(&dataset->stored->all_checked);
}

bool dataset_damaged(const struct dataset *dataset)
{
    return atomic_load(&dataset->stored->damaged);
}

bool dataset_intact(struct dataset *dataset)
{
    struct stored *stored = dataset->stored;
    struct file_identity now;
    int fd = open_file_use(stored->opened);
    if (fd < 0)
        return false;
    bool same = identity_of(fd, &now) && identity_same_but_names(&now, &stored->identity);
    open_file_let_go(stored->opened);
    return same;
}
